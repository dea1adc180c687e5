# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plant: a simulated robot with drives, sensors and external wrenches. It imports no ROS."""

import math
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.model.joint_types import places, single_joints
from diag_dynamics.model.mimic import Followers
from diag_dynamics.simulation.drives import Drives, Pushes, Sensors
from diag_dynamics.simulation.simulation import CompliantLimits, Simulation, rest_position
from diag_dynamics.text import distinct

STIFFNESS, DAMPING = 625.0, 50.0
"""Gains on errors of position [1/s²] and rate [1/s]: critically damped.

So stiff that a push of the demo turns no joint faster than the monitor accepts."""

RAMP = 1.0
"""Time in which the amplitude grows to half [s]."""


class Wave:
    """Motion of a simulation: every joint swings about the middle of its range, within limits.

    Each has a frequency of its own.

    The effort is that of a computed-torque controller, M(q) q̈_c + c + g + d q̇_d with q̈_c from
    the reference and the error; damping and friction are compensated at the desired rate. The robot
    starts at the middle of its ranges. Joints of several degrees of freedom raise UnsupportedError.
    """

    def __init__(self, simulation):
        model = simulation.model
        if (model.bodies["dofs"][1:] > 1).any():
            raise UnsupportedError(
                f"robot '{model.name}' has joints of several degrees of freedom, which no wave "
                "drives. Set motion to free."
            )
        self._simulation = simulation
        bounded = np.isfinite(model.lower) & np.isfinite(model.upper)
        span = np.where(bounded, model.upper - model.lower, 2.0)
        self._centre = np.where(bounded, model.lower, 0.0) + 0.5 * span
        self._centre = np.where(bounded, self._centre, rest_position(model))
        k = np.arange(model.nv)
        golden = 0.5 * (np.sqrt(5.0) - 1.0)
        self._pace = 2.0 * np.pi * (0.15 + 0.25 * ((k + 1) * golden % 1.0))  # [rad/s], no two alike
        slow = model.velocity_bound / (self._pace + 0.65 / RAMP)
        amplitude = np.minimum(np.minimum(0.35 * span, 0.7), slow)
        self._swing = np.where(k % 2, -1.0, 1.0) * amplitude
        simulation.reset(self._centre, np.zeros(model.nv))

    def effort(self):
        """Joint efforts for the simulation's present time and state [N m, N], shape (nv,)."""
        simulation = self._simulation
        swing = self._swing
        t = simulation.time
        T = RAMP
        grown = t**2 / (t**2 + T**2)
        growing = 2 * t * T**2 / (t**2 + T**2) ** 2
        bending = 2 * T**2 * (T**2 - 3 * t**2) / (t**2 + T**2) ** 3
        s = np.sin(self._pace * t)
        c = np.cos(self._pace * t)
        w = self._pace
        q_d = self._centre + swing * grown * s
        qd_d = swing * (growing * s + grown * w * c)
        qdd_d = swing * (bending * s + 2.0 * growing * w * c - grown * w * w * s)
        q = simulation.q
        qd = simulation.qd
        qdd = qdd_d + DAMPING * (qd_d - qd) + STIFFNESS * (q_d - q)
        tau = simulation.dynamics.inverse_dynamics(q, qd, qdd) + simulation.damping * qd_d
        flexible = simulation.flexible
        tau[flexible.dofs] += flexible.rotor_inertia * qdd[flexible.dofs]
        return tau + simulation.friction * np.sign(qd_d) + simulation.effort_offset


# --- The plant

BRAKE_FACTOR = 2.0
"""Torque of a brake, as a multiple of its drive's largest effort."""

COMPLIANT = CompliantLimits(1e4, 100.0)
"""Compliant limits: stiffness [N m/rad, N/m] and damping [N m s/rad, N s/m]."""

UNLIMITED_BRAKE = 1e9
"""Torque of a brake whose drive has no limit [N m, N]."""


class Measured(NamedTuple):
    """Sensor values of all joints, mimic joints last, and q and q̇ of a floating base.

    Efforts are in the unit that the model's `effort_scale` converts.
    """

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    base: tuple | None


class Plant:
    """A :class:`Simulation` with drives, sensors and pushes, by parameters of the simulator.

    `names` are those of all joints, mimic joints last.
    """

    def __init__(self, model, values):
        for link in model.flexible_links:
            raise UnsupportedError(
                f"link '{link}' is flexible, and no joint state has modes. Omit flexible_links."
            )
        if model.flexible_joints and values["without_command"] == "brake":
            raise UnsupportedError(
                "parameter 'without_command' is 'brake'; expected 'zero': brakes hold links, "
                "and joint "
                f"'{next(iter(model.flexible_joints))}' is flexible."
            )
        require_consistent(values)
        period = 1.0 / values["rate"]
        steps = math.ceil(period / values["step"] - 1e-9)  # of a period
        limits = {"hard": True, "compliant": COMPLIANT, "none": False}[values["limits"]]
        self.simulation = Simulation(model, step=period / steps, limits=limits)
        joints = single_joints(model)
        self._followers = Followers.of(model)
        self.names = (*joints, *self._followers.names)
        self._driven = np.array(places(joints, model.dof_names), dtype=int)
        self._scale = np.nan_to_num(
            [model.effort_scale.get(name, 1.0) for name in self.names], nan=1.0
        )
        self.drives = Drives(
            joints, values["command_joints"], values["command_timeout"], values["without_command"]
        )
        self.sensors = Sensors(values["sensor_noise"])
        self.pushes = Pushes(model.link_names, values["wrench_timeout"])
        self._hard = values["limits"] == "hard"
        self._axes = values["wrench_axes"]
        self._compensates_gravity = values["compensates_gravity"]
        self._wave = Wave(self.simulation) if values["motion"] == "wave" else None
        self._friction = self.simulation.friction
        self._braked = False
        limit = model.effort_bound[self._driven]
        self._brakes = self._friction.copy()
        self._brakes[self._driven] += np.where(
            np.isfinite(limit), BRAKE_FACTOR * limit, UNLIMITED_BRAKE
        )
        self._start = self.simulation.q, self.simulation.qd
        self._before = 0.0
        self.advance(0)

    @property
    def time(self):
        """Simulated time [s]; another state of the robot does not reset it."""
        return self._before + self.simulation.time

    def advance(self, steps):
        """Take steps, with commands that do not time out between them."""
        simulation = self.simulation
        begin = self.time
        if not steps:
            simulation.advance(self._effort(begin), steps=0)
        for _ in range(steps):
            effort = self._effort(begin)
            wrenches = self.pushes.at(self.time)
            simulation.advance(
                effort, f_ext=wrenches or None, frame=self._axes if wrenches else "link"
            )

    def _effort(self, begin):
        """Return the efforts of the drives at `begin` [s], shape (nv,); open or close brakes."""
        simulation = self.simulation
        drives = self.drives
        if self._wave:
            return self._wave.effort()
        effort = np.zeros(simulation.model.nv)
        effort[self._driven] = drives.effort(begin)
        if drives.braked != self._braked:
            self._braked = drives.braked
            simulation.friction = self._brakes if self._braked else self._friction
        if self._compensates_gravity and not self._braked:
            effort[self._driven] += simulation.dynamics.gravity_torque(simulation.q)[self._driven]
        return effort

    def measure(self):
        """Return the present state as :class:`Measured` by the sensors."""
        simulation = self.simulation
        followers = self._followers
        q = simulation.q
        qd = simulation.qd
        actuated = q[len(q) - len(self._driven) :]
        rate = qd[self._driven]
        followed, G = followers.at(actuated)
        position = np.append(actuated, followed)
        velocity = np.append(rate, G @ rate)
        effort = np.zeros(len(self.names))  # mimic joints have no drives
        effort[: len(rate)] = simulation.effort[self._driven]
        theta = simulation.theta
        thetad = simulation.thetad
        torque = simulation.spring_torque
        for i, (name, joint) in enumerate(simulation.model.flexible_joints.items()):
            k = self.names.index(name)
            if joint.position == "motor":
                position[k] = theta[i]
                velocity[k] = thetad[i]
            if joint.effort == "spring":
                effort[k] = torque[i]
        base = (q[:7], qd[:6]) if simulation.model.floating_base else None
        position, velocity, effort = self.sensors.measure(position, velocity, effort)
        return Measured(position, velocity, effort / self._scale, base)

    def put(self, q, qd):
        """Put the robot into a state; time and command stay.

        Raise InputError for a joint beyond a hard limit or an energy that is not finite, and change
        nothing.
        """
        simulation = self.simulation
        before = self.time
        model = simulation.model
        outside = (np.asarray(q) < model.lower) | (np.asarray(q) > model.upper)
        if self._hard and outside.any():
            k = int(np.argmax(outside))
            position, lower, upper = distinct(q[k], model.lower[k], model.upper[k])
            raise InputError(
                f"position of '{model.coordinate_names[k]}' is {position}; expected within its "
                "hard limits "
                f"{lower} … {upper}."
            )
        if not np.isfinite(simulation.dynamics.evaluate(q, qd).kinetic_energy):
            raise InputError("the kinetic energy is not finite.")
        simulation.reset(q, qd)
        self._before = before

    def reset(self):
        """Reset state, commands, wrenches and the sequence of sensor errors, but not the time."""
        self.put(*self._start)
        self.drives.forget()
        self.pushes.forget()
        self.sensors.restart()


def require_consistent(values):
    """Raise InputError for values that contradict each other or lie outside of their ranges."""
    factor = values["real_time_factor"]
    if 0.0 < factor < 1e-3:
        raise InputError(f"parameter 'real_time_factor' is {factor}; expected 0 or at least 0.001.")
    if values["lockstep"] and values["motion"] != "free":
        raise InputError(
            "parameter 'lockstep' is true, for which there must be a command for every joint "
            f"state, but 'motion' is '{values['motion']}'; expected 'free'."
        )
