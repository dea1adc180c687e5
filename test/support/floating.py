# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A monitor of a robot with a floating base, compared with Pinocchio's free-flyer."""

import math

import numpy as np
import pinocchio as pin
from nav_msgs.msg import Odometry

from nodes import Monitor, S, joint_state
from robots import robot_path

SOLO = "solo_description/robots/solo12.urdf"


class FloatingMonitor(Monitor):
    """A monitor of Solo, with joint states and odometry of one random state.

    Attributes
    ----------
    q, v : ndarray
        The state as Pinocchio has it.
    joints : list of str
        Joints in Pinocchio's order.
    """

    def __init__(self, peer, namespace, *, description=SOLO, **parameters):
        """Start it; without `description` its robot comes by topic."""
        if description:
            parameters["robot_description"] = robot_path(description)
        self.odom = peer.publisher(Odometry, f"{namespace}/odom")
        super().__init__(peer, namespace, floating_base=True, **parameters)
        self.model = pin.buildModelFromXML(robot_path(SOLO).read_text(), pin.JointModelFreeFlyer())
        self.data = self.model.createData()
        self.joints = list(self.model.names)[2:]
        rng = np.random.default_rng(3)
        self.q = pin.neutral(self.model)
        self.q[:3], self.q[7:] = rng.normal(size=3), rng.uniform(-1, 1, len(self.joints))
        turn = rng.normal(size=4)
        self.q[3:7] = turn / np.linalg.norm(turn)
        self.v = rng.normal(size=self.model.nv)

    def odometry(self, stamp, child="base_link", attached=None, in_header=False):
        """Return odometry of a frame with the placement `attached` in the root link, which moves
        with it.
        """
        attached = pin.SE3.Identity() if attached is None else attached
        there = pin.SE3(pin.Quaternion(self.q[3:7]).matrix(), self.q[:3]) * attached
        twist = attached.actInv(pin.Motion(self.v[:6]))
        linear, angular = twist.linear, twist.angular
        if in_header:
            linear, angular = there.rotation @ linear, there.rotation @ angular
        message = Odometry(child_frame_id=child)
        message.header.frame_id = "odom"
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
        turn = pin.Quaternion(there.rotation)
        pose, velocity = message.pose.pose, message.twist.twist
        for target, source in (
            (pose.position, there.translation),
            (pose.orientation, (turn.x, turn.y, turn.z, turn.w)),
            (velocity.linear, linear),
            (velocity.angular, angular),
        ):
            for axis, value in zip("xyzw", source, strict=False):
                setattr(target, axis, float(value))
        return message

    def joints_message(self, stamp, some=slice(None), effort=None):
        """Return a joint state with some of the joints."""
        effort = np.zeros(len(self.joints)) if effort is None else effort
        return joint_state(
            self.joints[some], self.q[7:][some], self.v[6:][some], effort[some], stamp
        )

    def answer(self, effort=None, step=S, **odometry):
        """Publish odometry and all joints of one stamp, and return what comes back by topic."""
        stamp = self.tick(step)
        self.odom.publish(self.odometry(stamp, **odometry))
        return self.feed(self.joints_message(stamp, effort=effort))

    def check(self, published):
        """Compare with Pinocchio's free-flyer: U √D of its mass matrix, in the same order."""
        state, energy = published["state"], published["kinetic_energy"]
        M = pin.crba(self.model, self.data, self.q)
        pin.cholesky.decompose(self.model, self.data)
        m = np.triu(self.data.U) * np.sqrt(self.data.D)
        nu = m.T @ self.v
        assert list(state.dof_names)[6:] == self.joints
        assert state.dof_names[0] == "root_joint/v_x"
        assert state.position_names[6] == "root_joint/qw"
        assert state.header.frame_id == "base_link"
        same = np.sign(np.dot(state.position[3:7], self.q[3:7]))
        position = np.r_[
            state.position[:3], same * np.array(state.position[3:7]), state.position[7:]
        ]
        np.testing.assert_allclose(position, self.q, atol=1e-12)
        np.testing.assert_allclose(state.velocity, self.v, atol=1e-12)
        np.testing.assert_allclose(state.nu, nu, atol=1e-11)
        gravity = np.linalg.solve(m, pin.computeGeneralizedGravity(self.model, self.data, self.q))
        np.testing.assert_allclose(state.gravity, gravity, atol=1e-10)
        assert abs(np.dot(state.nu, state.coriolis)) < 1e-12 * np.linalg.norm(nu) * np.linalg.norm(
            state.coriolis
        )
        K = 0.5 * self.v @ (np.triu(M) + np.triu(M, 1).T) @ self.v
        assert math.isclose(energy.total, K, rel_tol=1e-12)
        assert math.isclose(energy.base_energy, 0.5 * nu[:6] @ nu[:6], rel_tol=1e-11)
        assert math.isclose(math.fsum(energy.link_energy), K, rel_tol=1e-12)
