# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arms with friction and an unknown load by Pinocchio alone, and the control loop on them."""

import numba
import numpy as np
import pinocchio as pin

import diag_dynamics as dd
import robots
from arm import Cycles, control_loop
from controlled import ARM, START, UR5, Z1

STEP = 5e-4
"""Step of the plant [s]."""

LINK = '<link name="{}"><inertial><origin xyz="{}"/><mass value="{}"/>{}</inertial></link>'
INERTIA = '<inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/>'
JOINT = (
    '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="{}"/>'
    '<axis xyz="{}"/><limit lower="-2.5" upper="2.5" effort="{}" velocity="2"/>'
    '<dynamics damping="{}" friction="{}"/></joint>'
)
URDF = robots.description(
    "four_joints",
    robots.link("base"),
    LINK.format("turret", "0 0 0.1", 3.0, INERTIA.format(0.015, 0.015, 0.01)),
    LINK.format("upper", "0.2 0 0", 2.5, INERTIA.format(0.003, 0.035, 0.035)),
    LINK.format("fore", "0.15 0 0", 1.5, INERTIA.format(0.001, 0.012, 0.012)),
    LINK.format("hand", "0.05 0 0", 0.6, INERTIA.format(0.0006, 0.0008, 0.0008)),
    JOINT.format("j1", "base", "turret", "0 0 0.05", "0 0 1", 80, 0.5, 0.4),
    JOINT.format("j2", "turret", "upper", "0 0 0.2", "0 1 0", 80, 0.5, 0.4),
    JOINT.format("j3", "upper", "fore", "0.4 0 0", "0 1 0", 40, 0.5, 0.4),
    JOINT.format("j4", "fore", "hand", "0.3 0 0", "1 0 0", 10, 0.1, 0.1),
)
FOUR_JOINTS = robots.Robot("four_joints", URDF)
"""An arm whose last joint turns 0.6 g m² against 0.1 N m of friction."""

ARMS = (
    (FOUR_JOINTS, np.array([0.2, 0.5, 0.6, 0.3]), "hand"),
    (UR5, START[UR5.id], "tool0"),
    (ARM, START[ARM.id], "panda_hand"),
    (Z1, START[Z1.id], "gripperMover"),
)
"""Arms with a position [rad] and the link that carries a load."""


@numba.njit
def friction_impulse(free, W, bound, impulse):
    """Change impulses within their bounds to those that stop joints of rates free + W impulse."""
    for _ in range(200):
        change = 0.0
        for k in range(len(free)):
            stopping = impulse[k] - (free[k] + np.dot(W[k], impulse)) / W[k, k]
            stopping = min(max(stopping, -bound[k]), bound[k])
            change = max(change, abs(stopping - impulse[k]))
            impulse[k] = stopping
        if change < 1e-12:
            return


class RubbingArm:
    """Arm at rest: semi-implicit Euler steps, in which Coulomb friction stops joints exactly.

    `load` is a mass [kg] at the origin of a link, `friction` a factor on Coulomb friction of the
    URDF. All joints but those of `names` are locked.
    """

    def __init__(self, robot, names, q, link, load=0.0, friction=1.0):
        model = pin.buildModelFromXML(robot.urdf)
        locked = [n for n in model.names if n not in (*names, "universe")]
        position = None
        position = pin.neutral(model)
        for name in locked:  # a finger that mimics a locked one has its position
            position[model.joints[model.getJointId(name)].idx_q] = max(robot.locked_joints.values())
        model = pin.buildReducedModel(model, [model.getJointId(n) for n in locked], position)
        frame = model.frames[model.getFrameId(link)]
        inertia = pin.Inertia(load, np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(frame.parentJoint, inertia, frame.placement)
        assert tuple(model.names)[1:] == tuple(names)
        self._model = model
        self._data = model.createData()
        self._armature = np.diag([robot.armature.get(name, 0.0) for name in names])
        self._friction = friction * np.array(model.friction)
        self.q = np.array(q)
        self.qd = np.zeros(model.nv)
        self._impulse = np.zeros(model.nv)

    def gravity_torque(self):
        """Return the effort that carries arm and load [N m]."""
        return pin.computeGeneralizedGravity(self._model, self._data, self.q)

    def advance(self, effort, period):
        """Apply an effort [N m] for a period [s]."""
        model = self._model
        data = self._data
        for _ in range(round(period / STEP)):
            M = np.triu(pin.crba(model, data, self.q))
            M += np.triu(M, 1).T + self._armature
            force = effort - pin.nle(model, data, self.q, self.qd)
            W = np.linalg.inv(M + STEP * np.diag(model.damping))
            free = W @ (M @ self.qd + STEP * force)
            friction_impulse(free, W, STEP * self._friction, self._impulse)
            self.qd = free + W @ self._impulse
            self.q = self.q + STEP * self.qd


class Closed(Cycles):
    """Control loop with default parameters but for `values`, on an arm that it carries at first."""

    def __init__(self, robot, q, link, rate, load=0.0, friction=1.0, **values):
        model = dd.load_urdf(robot.source, **robot.options)
        plant = RubbingArm(robot, model.dof_names, q, link, load, friction)
        super().__init__(control_loop(model, **values), plant, rate)
        self.loop.limits.reset(self.plant.gravity_torque())

    def run(self, seconds):
        """Run for a time [s]; return the efforts of all cycles."""
        efforts = []
        for _ in range(round(seconds * self.rate)):
            efforts.append(self.step().effort)
            self.plant.advance(efforts[-1], 1.0 / self.rate)
        return np.array(efforts)

    def go(self, goal, seconds=3.5):
        """Start, go to a set-point, and return the distances of the joints from it [rad]."""
        self.run(0.2)
        self.loop.take_set_point(goal)
        self.run(seconds)
        assert not self.lost
        return np.abs(goal - self.plant.q)
