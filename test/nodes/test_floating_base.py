# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor of a robot with a floating base: joint_states and odom in, Pinocchio's free-flyer dynamics out."""

import contextlib
import math

import numpy as np
import pinocchio as pin
import pytest
from diag_dynamics.msg import DiagonalizedState, KineticEnergy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from nodes import BELIEVING, LATCHED, MANY, START, TIMEOUT, S, description, joint_state, nanoseconds
from robots import robot_path

SOLO = "solo_description/robots/solo12.urdf"
NAMESPACE = "/floating"


class Rig:
    """A monitor of Solo, its inputs, and what Pinocchio says."""

    def __init__(self, peer, namespace, *, description=SOLO, **parameters):
        self.peer, self.now, self.reports = peer, 500 * S, []
        urdf = robot_path(SOLO).read_text()
        self.model = pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
        self.data = self.model.createData()
        self.joints = list(self.model.names)[2:]
        node = f"{namespace}/diag_dynamics"
        self.feeder = peer.publisher(JointState, f"{namespace}/joint_states")
        self.odom = peer.publisher(Odometry, f"{namespace}/odom")
        self.state = peer.topic(DiagonalizedState, f"{node}/state")
        self.energy = peer.topic(KineticEnergy, f"{node}/kinetic_energy")
        peer.node.create_subscription(DiagnosticArray, "/diagnostics", self._report, MANY)
        self.name = node
        if description:
            parameters["robot_description"] = robot_path(description)
        for topic in ("joint_states", "odom"):
            parameters[f"qos_overrides.{namespace}/{topic}.subscription.reliability"] = "reliable"
        self.process = peer.start("monitor", "-r", f"__ns:={namespace}", floating_base=True, **BELIEVING | parameters)
        rng = np.random.default_rng(3)
        self.q = pin.neutral(self.model)
        self.q[:3], self.q[7:] = rng.normal(size=3), rng.uniform(-1, 1, len(self.joints))
        turn = rng.normal(size=4)
        self.q[3:7] = turn / np.linalg.norm(turn)
        self.v = rng.normal(size=self.model.nv)

    def _report(self, array):
        self.reports += [status for status in array.status if self.name.lstrip("/") in status.name]

    def odometry(self, stamp, child="base_link", attached=None, in_header=False):
        """Return odom of a frame with the placement `attached` in the root link, which moves with it."""
        attached = pin.SE3.Identity() if attached is None else attached
        there = pin.SE3(pin.Quaternion(self.q[3:7]).matrix(), self.q[:3]) * attached
        twist = attached.actInv(pin.Motion(self.v[:6]))
        linear, angular = twist.linear, twist.angular
        if in_header:
            linear, angular = there.rotation @ linear, there.rotation @ angular
        message = Odometry(child_frame_id=child)
        message.header.frame_id = "odom"
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
        pose, velocity = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y, pose.position.z = map(float, there.translation)
        o = pin.Quaternion(there.rotation)
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = o.x, o.y, o.z, o.w
        velocity.linear.x, velocity.linear.y, velocity.linear.z = map(float, linear)
        velocity.angular.x, velocity.angular.y, velocity.angular.z = map(float, angular)
        return message

    def feed(self, **odometry):
        """Publish odom, then the joints, with the next stamp."""
        self.now += S
        self.odom.publish(self.odometry(self.now, **odometry))
        # The two come on different topics: the joints' answer counts once the base is known, as both are repeated.
        self.feeder.publish(joint_state(self.joints, self.q[7:], self.v[6:], np.zeros(12), self.now))

    def answer(self, **odometry):
        """Return what the node makes of odom and joints of one stamp.

        Fed anew until it comes: the first messages get lost while the two sides discover each other, and the joints may
        overtake odom.
        """
        inputs = (self.feeder, self.odom)
        self.peer.wait_until(lambda: all(p.get_subscription_count() for p in inputs), f"{self.name} to listen", START)
        patience = 0.5
        while patience < TIMEOUT:
            self.feed(**odometry)
            with contextlib.suppress(AssertionError):
                self.peer.wait_until(self._complete, "an answer", patience)
                return self.state.at(self.now), self.energy.at(self.now)
            patience *= 1.1  # it may be slow, too
        raise AssertionError(f"no answer of {self.name} to any state")

    def _complete(self):
        state = self.state.at(self.now)
        return state and nanoseconds(state.oldest_stamp) == self.now and self.energy.at(self.now)


@pytest.fixture(scope="module")
def rig(peer):
    rig = Rig(peer, NAMESPACE)
    with rig.process:
        yield rig


def check(rig, state, energy):
    """Compare with Pinocchio's free-flyer: U √D of its mass matrix, in the same order."""
    M = pin.crba(rig.model, rig.data, rig.q)
    pin.cholesky.decompose(rig.model, rig.data)
    m = np.triu(rig.data.U) * np.sqrt(rig.data.D)
    nu = m.T @ rig.v
    assert list(state.dof_names)[6:] == rig.joints
    assert state.dof_names[0] == "root_joint/v_x" and state.position_names[6] == "root_joint/qw"
    assert state.header.frame_id == "base_link"
    same = np.sign(np.dot(state.position[3:7], rig.q[3:7]))
    np.testing.assert_allclose(
        np.r_[state.position[:3], same * np.array(state.position[3:7]), state.position[7:]], rig.q, atol=1e-12
    )
    np.testing.assert_allclose(state.velocity, rig.v, atol=1e-12)
    np.testing.assert_allclose(state.nu, nu, atol=1e-11)
    gravity = np.linalg.solve(m, pin.computeGeneralizedGravity(rig.model, rig.data, rig.q))
    np.testing.assert_allclose(state.gravity, gravity, atol=1e-10)
    assert abs(np.dot(state.nu, state.coriolis)) < 1e-12 * np.linalg.norm(nu) * np.linalg.norm(state.coriolis)
    K = 0.5 * rig.v @ (np.triu(M) + np.triu(M, 1).T) @ rig.v
    assert energy.total == pytest.approx(K, rel=1e-12)
    assert energy.base_energy == pytest.approx(0.5 * nu[:6] @ nu[:6], rel=1e-11)
    assert math.fsum(energy.link_energy) == pytest.approx(K, rel=1e-12)


def test_base_from_odometry(rig):
    check(rig, *rig.answer())


def test_wrong_frame_is_named_and_nothing_comes_of_it(rig):
    """Odometry of a link that moves against the root, or of none, is rejected by name; then all is well again."""
    rig.answer()
    for child in ("FL_FOOT", "nowhere", ""):
        rig.reports.clear()
        rig.odom.publish(rig.odometry(rig.now + S, child=child))
        rig.peer.wait_until(
            lambda child=child: any((child or "empty") in r.message for r in rig.reports), f"a report of {child}"
        )
    check(rig, *rig.answer())


def test_odometry_of_an_attached_link_in_the_header_frame(peer):
    """A camera on the base may be what is tracked, and its twist in the axes of the world."""
    root = robot_path(SOLO).read_text()
    camera = (
        '<link name="camera"/><joint name="mount" type="fixed"><parent link="base_link"/><child link="camera"/>'
        '<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/></joint></robot>'
    )
    descriptions = peer.publisher(String, "/camera/robot_description", LATCHED)
    descriptions.publish(description(root.replace("</robot>", camera)))
    attached = pin.SE3(pin.rpy.rpyToMatrix(0.4, 0.5, 0.6), np.array([0.1, 0.2, 0.3]))
    rig = Rig(peer, "/camera", description=None, odom_twist_frame="header")
    with rig.process:
        check(rig, *rig.answer(child="camera", attached=attached, in_header=True))


def test_robot_that_is_all_base(peer):
    """A drone has no joint, so odometry alone makes a state; one without a stamp has that of its reception, and says so."""
    node = "/drone/diag_dynamics"
    odom = peer.publisher(Odometry, "/drone/odom")
    states = peer.topic(DiagonalizedState, f"{node}/state")
    message = Odometry(child_frame_id="base_link")
    message.pose.pose.orientation.w = 1.0
    message.twist.twist.linear.x = 2.0
    drone = robot_path("hector_description/robots/quadrotor_base.urdf")
    with peer.start("monitor", "-r", "__ns:=/drone", robot_description=drone, floating_base=True):
        peer.wait_until(odom.get_subscription_count, "the subscription to odom", START)
        for _ in range(240):
            odom.publish(message)
            with contextlib.suppress(AssertionError):
                peer.wait_until(lambda: states.messages, "a state", 0.5)
                break
        state = states.messages[-1]
    mass = 1.477
    assert len(state.nu) == 6
    assert state.kinetic_energy == pytest.approx(0.5 * mass * 2.0**2)
    assert state.stamp_is_receive_time
