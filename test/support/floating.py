# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A monitor of a robot with a floating base, compared with the library."""

import numpy as np
import pinocchio as pin
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

import bags
import diag_dynamics as dd
from nodes import Monitor, S, joint_state
from robots import robot_path

IDENTITY = pin.SE3.Identity()
SOLO = "solo_description/robots/solo12.urdf"


class FloatingMonitor(Monitor):
    """A monitor of Solo, with joint states and odometry of one random state.

    Attributes
    ----------
    q, v : ndarray
        The state.
    joints : list of str
        Joints in the order of the model.
    """

    def __init__(self, peer, namespace, *, description=SOLO, **parameters):
        """Start it; without `description` its robot comes by topic."""
        if description:
            parameters["robot_description"] = robot_path(description)
        self.odom = peer.publisher(Odometry, f"{namespace}/odom")
        super().__init__(peer, namespace, floating_base=True, **parameters)
        model = dd.load_urdf(robot_path(SOLO), floating_base=True)
        self.dynamics = dd.DiagonalDynamics(model)
        self.joints = list(model.dof_names[6:])
        rng = np.random.default_rng(3)
        self.q = model.random(rng)
        self.v = rng.normal(size=model.nv)
        self.q[:3] = rng.normal(size=3)

    def odometry(self, stamp, child="base_link", attached=IDENTITY, in_header=False):
        """Return odometry of a frame with the placement `attached` in the root link, which moves
        with it.
        """
        there = pin.SE3(pin.Quaternion(self.q[3:7]).matrix(), self.q[:3]) * attached
        twist = attached.actInv(pin.Motion(self.v[:6]))
        axes = there.rotation if in_header else np.eye(3)
        pose = *there.translation, *pin.Quaternion(there.rotation).coeffs()
        rates = *(axes @ twist.linear), *(axes @ twist.angular)
        return deserialize_message(bags.odometry(stamp, child, pose, rates), Odometry)

    def joints_message(self, stamp):
        """Return a joint state."""
        return joint_state(self.joints, self.q[7:], self.v[6:], 0.0 * self.v[6:], stamp)

    def answer(self, **odometry):
        """Publish odometry and all joints of one stamp, and return what comes back by topic."""
        stamp = self.tick(S)
        self.odom.publish(self.odometry(stamp, **odometry))
        return self.feed(self.joints_message(stamp))

    def check(self, published):
        """Compare with the library's numbers, which its own tests compare with Pinocchio's."""
        state = published["state"]
        energy = published["kinetic_energy"]
        assert list(state.dof_names)[6:] == self.joints
        assert state.dof_names[0] == "root_joint/v_x"
        assert state.position_names[6] == "root_joint/qw"
        assert state.header.frame_id == "base_link"
        q = np.array(state.position)
        q[3:7] *= np.sign(q[3:7] @ self.q[3:7])
        np.testing.assert_allclose(q, self.q, atol=1e-12)
        np.testing.assert_allclose(state.velocity, self.v, atol=1e-12)
        s = self.dynamics.evaluate(self.q, self.v)
        for name in ("nu", "coriolis", "gravity"):
            np.testing.assert_allclose(getattr(state, name), getattr(s, name), atol=1e-10)
        energies = energy.total, energy.base_energy
        np.testing.assert_allclose(energies, (s.kinetic_energy, s.base_energy), rtol=1e-11)
