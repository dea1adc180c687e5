# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A UR5: its states, loops that control it, and the commands that it should be given by Pinocchio alone."""

import numpy as np
import pinocchio as pin
import scipy.linalg

import diag_dynamics as dd
from described import UR5, S, robot
from diag_dynamics.control.loop import ControlLoop
from diag_dynamics.control.modes import TRACKING
from diag_dynamics.control.references import Waypoints
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.parameters.controller import PARAMETERS

Q = np.array([0.3, -1.2, 1.4, -0.6, 0.5, 0.2])


def state_at(stamp, q, qd=None):
    """State of the robot at a time [ns], at rest by default."""
    qd = np.zeros(len(q)) if qd is None else qd
    return RobotState(
        np.array(q, dtype=float), np.array(qd, dtype=float), None, stamp, stamp, False
    )


def waypoints(points):
    """Waypoints of (time, positions, velocities, accelerations)."""
    times, tables, given = np.array([float(point[0]) for point in points]), [], []
    for k in (1, 2, 3):
        tables.append(
            np.array(
                [point[k] if len(point) > k else np.zeros(len(point[1])) for point in points], float
            )
        )
        given.append(np.array([len(point) > k for point in points]))
    return Waypoints(times, *tables, *given[1:])


def gravity_of(q):
    """Gravity torque of a UR5 by Pinocchio."""
    return robot(UR5).oracle.gravity_torque(np.array(q, dtype=float))


def pose_of(q):
    """Position and axes of a UR5's tool by Pinocchio."""
    oracle = robot(UR5).oracle.full
    pin.framesForwardKinematics(
        oracle.model, oracle.data, oracle.configuration(np.array(q, dtype=float))
    )
    placed = oracle.data.oMf[oracle.model.getFrameId("tool0")]
    return placed.translation.copy(), placed.rotation.copy()


def pinocchio_command(mode, q, qd, target, gain=1.0):
    """Effort of a law for a UR5 by Pinocchio alone, in the joint space; `gain` multiplies those of tracking.

    The target of tracking is a position, or that and a velocity and an acceleration.
    """
    oracle = robot(UR5).oracle
    state, names = oracle.at(q, qd), np.array(oracle.dof_names)
    if mode == "gravity_compensation":
        return state.g
    if mode == "damping_10":
        return state.g - 10.0 * state.M @ qd
    if mode == "damping":
        c = np.where(names == "elbow_joint", 5.0, 8.0)
        return state.g - state.m @ (c * (state.m.T @ qd))
    if mode == "regulation":  # set-points; 50 N m/rad, critically damped
        damping = state.m @ scipy.linalg.sqrtm(50.0 * state.l @ state.l.T).real @ state.m.T
        return state.g + 50.0 * (target - q) - 2.0 * damping @ qd
    if mode == "tracking":
        K = gain * np.where(names == "wrist_1_joint", 30.0, 20.0)
        limits = [
            float(oracle.xml.find(f"joint[@name='{name}']/limit").get("velocity")) for name in names
        ]
        q_d, qd_d, qdd_d = (
            target if isinstance(target, tuple) else (target, np.zeros(6), np.zeros(6))
        )
        back = np.clip(10.0 * (q_d - q), np.negative(limits), limits)
        qd_r, qdd_r = qd_d + back, qdd_d + np.where(np.abs(back) < limits, 10.0 * (qd_d - qd), 0.0)
        return (
            state.M @ qdd_r + state.C_s @ qd_r + state.g - state.m @ (K * (state.m.T @ (qd - qd_r)))
        )
    position, axes = pose_of(q)
    wrench = np.zeros(6)
    wrench[:3] = 200.0 * (target[0] - position)
    wrench[3:] = 0.5 * 20.0 * sum(np.cross(axes[:, j], target[1][:, j]) for j in range(3))
    units = np.array([oracle.effort_of(q, {"tool0": unit}, "world") for unit in np.eye(6)])
    root = state.l @ units.T * np.sqrt([200.0] * 3 + [20.0] * 3)
    modes, frequencies, _ = np.linalg.svd(root)  # critically damped, at 3 rad/s at least
    damping = 2.0 * modes * np.maximum(frequencies, 3.0) @ modes.T
    force = oracle.effort_of(q, {"tool0": wrench}, "world")
    return state.g - state.m @ damping @ (state.m.T @ qd) + force


def control_loop(model, compensated=False, points=None, **values):
    """Return a loop with the default parameters but for `values`."""
    defaults = {name: spec.default for name, spec in PARAMETERS.items()}
    return ControlLoop(model, defaults | values, compensated, points)


def loop_of(arm, compensated=False, **values):
    """Return a loop in mode tracking with the tool as its link, by default."""
    values = {"controlled_link": "tool0", "initial_mode": TRACKING} | values
    return control_loop(arm, compensated, **values)


class Cycles:
    """A loop on a plant, cycle by cycle; `lost` has the texts of modes that were left."""

    def __init__(self, loop, plant, rate=1000):
        self.loop, self.plant, self.rate, self.stamp, self.lost = loop, plant, rate, S, []

    def step(self):
        """Return the command for the next state of the plant."""
        self.stamp += S // self.rate
        sent = self.loop.step(state_at(self.stamp, self.plant.q, self.plant.qd), self.stamp)
        self.lost += [sent.lost] if sent.lost else []
        return sent


class Closed(Cycles):
    """A loop, by default with its defaults, on an arm without friction that nothing stops, at 1 kHz."""

    def __init__(self, arm, q, qd=None, carried=True, **values):
        """Put the arm somewhere; carried, it is at first."""
        nothing = np.zeros(6)
        plant = dd.Simulation(arm, q, qd, friction=nothing, damping=nothing, limits=False)
        super().__init__(loop_of(arm, **values), plant)
        self.sent, self.fastest, self.most = None, nothing, 0.0
        self.way = [np.array(q, dtype=float)]
        if carried:
            self.loop.limits.reset(robot(UR5).oracle.gravity_torque(np.array(q, dtype=float)))

    def go(self, seconds, push=None):
        """Let it go on; a push is a wrench on the tool."""
        for _ in range(round(1000 * seconds)):
            self.sent = self.step()
            self.plant.advance(self.sent.effort, f_ext=push)
            self.way.append(self.plant.q.copy())
            self.most = max(self.most, self.loop.energy)
            self.fastest = np.maximum(self.fastest, np.abs(self.plant.qd))
        return self
