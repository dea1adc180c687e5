# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A UR5: its states, loops that control it, and the commands that it should be given by Pinocchio
alone.
"""

import numpy as np
import pinocchio as pin

import diag_dynamics as dd
from described import UR5, S, robot
from diag_dynamics.control.loop import ControlLoop
from diag_dynamics.control.modes import TRACKING
from diag_dynamics.control.references import Waypoints
from diag_dynamics.joint_states.robot_joints import RobotState
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
    times = np.array([float(point[0]) for point in points])
    tables = []
    inputs = []
    for k in (1, 2, 3):
        tables.append(
            np.array(
                [point[k] if len(point) > k else np.zeros(len(point[1])) for point in points], float
            )
        )
        inputs.append(np.array([len(point) > k for point in points]))
    return Waypoints(times, *tables, *inputs[1:])


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
    """Effort of a law for a UR5 by Pinocchio alone, in the joint space; `gain` multiplies those of
    tracking.

    The target of tracking is a position.
    """
    oracle = robot(UR5).oracle
    state = oracle.at(q, qd)
    names = np.array(oracle.dof_names)
    if mode == "damping_10":
        return state.g - 10.0 * state.M @ qd
    if mode == "damping":
        c = np.where(names == "elbow_joint", 5.0, 8.0)
        return state.g - state.m @ (c * (state.m.T @ qd))
    K = gain * np.where(names == "wrist_1_joint", 30.0, 20.0)
    limits = [
        float(oracle.xml.find(f"joint[@name='{name}']/limit").get("velocity")) for name in names
    ]
    back = np.clip(10.0 * (target - q), np.negative(limits), limits)
    change = -10.0 * qd * (np.abs(back) < limits)
    braking = state.m @ (K * (state.m.T @ (qd - back)))
    return state.M @ change + state.C_s @ back + state.g - braking


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
        self.loop = loop
        self.plant = plant
        self.rate = rate
        self.stamp = S
        self.lost = []

    def step(self):
        """Return the command for the next state of the plant."""
        self.stamp += S // self.rate
        sent = self.loop.step(state_at(self.stamp, self.plant.q, self.plant.qd), self.stamp)
        self.lost += [sent.lost] if sent.lost else []
        return sent


class Closed(Cycles):
    """A loop, by default with its defaults, on an arm without friction that nothing stops, at 1
    kHz.
    """

    def __init__(self, arm, q, qd=None, carried=True, **values):
        """Put the arm somewhere; carried, it is at first."""
        nothing = np.zeros(6)
        plant = dd.Simulation(arm, q, qd, friction=nothing, damping=nothing, limits=False)
        super().__init__(loop_of(arm, **values), plant)
        self.sent = None
        self.fastest = nothing
        self.most = 0.0
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
