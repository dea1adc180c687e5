# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulated robot whose model is wrong: it follows a motion, is pushed, and is recorded as a driver would."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import JointParameters, Parameters, RobotModel
from diag_dynamics.simulation import Simulation
from diag_dynamics.simulation.sensors import Errors, Sensors

STEP = 1e-3
"""Of the simulation and of the controller [s]."""

EVERY = 4
"""Steps from one recorded state to the next: 250 Hz."""

BANDWIDTH = 8.0
"""Of the position loop [1/s]."""

ERRORS = Errors(noise=(2e-5, 1e-3, 0.1), resolution=(1e-5, 0.0, 0.01), seed=1)
"""Of a good drive: an encoder's steps, filtered velocities, and the ripple of a torque [rad, rad/s, N m]."""


class Push(NamedTuple):
    """A force on a link, from one time to another one [s], in the world's axes [N]."""

    link: str
    begin: float
    end: float
    force: np.ndarray


class Recorded(NamedTuple):
    """What was recorded, a row for each state; shape (T,) and (T, nv)."""

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray


def real_robot(model: RobotModel, off: float, seed: int) -> RobotModel:
    """The robot that a URDF is thought to be of: inertias off, and friction and rotors that the URDF does not have.

    Friction and rotors are of the size that geared arms have: Coulomb friction of 4 % of the effort limit, as much again by
    damping at full speed, rotors that need a tenth of the limit to reach full speed in half a second.
    """
    rng = np.random.default_rng(seed)
    effort = np.where(np.isfinite(model.effort_limit) & (model.effort_limit > 0.0), model.effort_limit, 50.0)
    speed = np.where(np.isfinite(model.velocity_limit) & (model.velocity_limit > 0.0), model.velocity_limit, 2.0)
    some = rng.uniform(0.7, 1.3, (4, model.nv))
    joints = {
        name: JointParameters(
            damping=float(0.04 * effort[k] / speed[k] * some[0, k]),
            friction=float(0.04 * effort[k] * some[1, k]),
            effort_offset=float(0.01 * effort[k] * (some[2, k] - 1.0) / 0.3),
            armature=float(0.1 * effort[k] * 0.5 / speed[k] * some[3, k]),
        )
        for k, name in enumerate(model.dof_names)
    }
    return model.perturbed(off, seed).with_parameters(Parameters(joints=joints))


def recorded(robot: RobotModel, known: RobotModel, time, position, velocity, acceleration, pushes=(), errors=ERRORS):
    """Let a robot follow a motion, and return what its sensors say.

    Parameters
    ----------
    robot : RobotModel
        The real one.
    known : RobotModel
        What its controller takes it for.
    time, position, velocity, acceleration
        The motion, as of :class:`Excitation`.
    pushes : sequence of Push
    errors : Errors

    Returns
    -------
    Recorded
    """
    simulation, dynamics = Simulation(robot, q=position[0], step=STEP, order=1), DiagonalDynamics(known)
    sensors = Sensors(errors)
    steps = round((time[-1] - time[0]) / STEP)
    wanted = [_at(time, column, STEP * np.arange(steps)) for column in (position, velocity, acceleration)]
    for k in range(steps):
        q, qd = simulation.q, simulation.qd
        away, off = wanted[0][k] - q, wanted[1][k] - qd
        demanded = wanted[2][k] + 2.0 * BANDWIDTH * off + BANDWIDTH**2 * away
        # A spring beside what the model says: friction that it does not know would hold the joint far off.
        effort = dynamics.inverse_dynamics(q, qd, demanded) + _stiffness(robot) * (away + 0.2 * off)
        if k % EVERY == 0:
            sensors.measure(k * STEP, q, qd, np.clip(effort, -simulation.effort_limits, simulation.effort_limits))
        at = k * STEP
        wrench = {push.link: np.r_[push.force, np.zeros(3)] for push in pushes if push.begin <= at < push.end}
        simulation.advance(effort, f_ext=wrench or None, frame="world" if wrench else "link")
    states = sensors.known(np.inf)
    return Recorded(
        np.array([time for time, _, _ in states]), *(np.array([values[k] for _, values, _ in states]) for k in range(3))
    )


def _stiffness(robot):
    """Of that spring [N m/rad]: against it a joint's Coulomb friction holds it 25 mrad off."""
    return 40.0 * np.maximum(robot.friction, 0.1)


def _at(time, columns, wanted):
    return np.column_stack([np.interp(wanted, time, column) for column in columns.T])
