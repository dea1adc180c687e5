# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated external torques of loads and pushes, as an observer that settles on torque finds them,
by Pinocchio.
"""

import numpy as np
import pinocchio as pin
from scipy.signal import lfilter

import diag_dynamics as dd
import robots
from coupling import with_payloads
from motions import efforts, fourier
from oracles import Oracle

GAIN, STEP = 25.0, 0.004
READY = {"panda": (0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8), "ur5": (0.0, -1.2, 1.4, -1.0, 1.2, 0.3)}
LINKS = {"panda": "panda_hand", "ur5": "tool0"}
NOISE = {"panda": (0.5, 0.5, 0.5, 0.4, 0.1, 0.1, 0.1), "ur5": (0.5, 0.5, 0.4, 0.1, 0.1, 0.1)}
FILES = {"panda": "panda_description/urdf/panda.urdf", "ur5": "ur_description/urdf/ur5_robot.urdf"}
SHARE = -np.expm1(-GAIN * STEP)


def low_pass(torque, step=STEP):
    """Response of 1/(s/GAIN + 1), from rest, to torques (T, nv) whose mean over each step acts on
    it.
    """
    share = -np.expm1(-GAIN * step)
    means = torque.copy()
    means[1:] = 0.5 * (torque[1:] + torque[:-1])
    means[0] = 0.0
    return lfilter([share], [1.0, share - 1.0], means, axis=0)


class Arm:
    """A simulated arm: the package's model, and Pinocchio's with and without a load."""

    def __init__(self, name, gravity=(0.0, 0.0, -9.81)):
        self.name = name
        self.link = LINKS[name]
        self.gravity = gravity
        self.locked = (
            {"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02} if name == "panda" else {}
        )
        self.urdf = robots.robot(FILES[name]).urdf
        locked = {joint: at for joint, at in self.locked.items() if not joint.endswith("2")}
        self.dynamics = dd.DiagonalDynamics(
            dd.load_urdf(self.urdf, locked_joints=locked, gravity=gravity)
        )
        self.free = self.oracle()
        self.deviation = np.array(NOISE[name])

    def oracle(self, payloads=()):
        """The arm in Pinocchio, with payloads on links."""
        urdf = with_payloads(self.urdf, dict(payloads))
        return Oracle(urdf, self.dynamics.model.dof_names, self.gravity, locked_joints=self.locked)

    def motion(self, rng, time, fastest=1.2):
        """Positions, rates and accelerations at times: a Fourier series about the ready pose."""
        ready = np.array(READY[self.name])
        return fourier(rng, time, ready - 1.2, ready + 1.2, fastest)

    def load_torque(self, motion, mass, center, inertia=None):
        """Torque on the joints of a body on the link at a motion, (T, nv); by default of a
        homogeneous ball of 3 cm.
        """
        ball = 3.6e-4 * mass * np.eye(3)
        loaded = self.oracle({self.link: (mass, center, ball if inertia is None else inertia)})
        return efforts(self.free, *motion) - efforts(loaded, *motion)

    def push_torque(self, q, link, point, force):
        """Torque of a force in world axes at a point of a link, at each of the positions; force (T,
        3).
        """
        model = self.free.model
        data = self.free.data
        frame = model.getFrameId(link, pin.FrameType.BODY)
        torque = np.zeros((len(q), self.free.nv))
        for t in np.flatnonzero(np.abs(force).max(axis=1) > 0.0):
            pin.computeJointJacobians(model, data, self.free.configuration(q[t]))
            pin.updateFramePlacements(model, data)
            J = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            arm = data.oMf[frame].rotation @ point
            torque[t] = self.free.from_pin(J.T @ np.r_[force[t], np.cross(arm, force[t])])
        return torque

    def observed(self, rng, external):
        """m r of an external torque (T, nv) and of measurement noise that gives it the deviations
        of this arm.
        """
        noise = rng.normal(size=external.shape) * self.deviation * np.sqrt((2.0 - SHARE) / SHARE)
        return low_pass(external) + lfilter([SHARE], [1.0, SHARE - 1.0], noise, axis=0)
