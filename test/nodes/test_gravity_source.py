# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Direction of gravity from an IMU or tf: gravity of the published state, against Pinocchio with
another gravity.
"""

import sys
from unittest import mock

import numpy as np
import pinocchio as pin
import pytest
from sensor_msgs.msg import Imu

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.statuses import OK, WARN
from nodes import MS, PANDA, Monitor, S, joint_state, robot
from pushed import GAIN, Motion, feed, subscribed
from transforms import transform_of, with_tf2_ros

G = 9.81
TILT = pin.rpy.rpyToMatrix(0.3, -0.2, 0.5)
"""Axes of the root link in the world: the vehicle's."""


class Carried(Monitor):
    """A monitor of a Panda on a vehicle, and its IMU."""

    def __init__(self, peer, name, **parameters):
        super().__init__(
            peer, name, outputs=["coriolis"], robot_description=robot(PANDA).path, **parameters
        )
        self.imu = peer.publisher(Imu, f"{name}/imu")
        self.node = self.process.node
        self.state = robot(PANDA).samples[1]
        peer.pass_time(0.1)

    def send(self, frame="panda_link0", orientation=None):
        """Publish a rotation of the IMU in the world, or none."""
        message = Imu()
        message.header.frame_id = frame
        if orientation is None:
            message.orientation_covariance[0] = -1.0
        else:
            o = message.orientation
            o.x, o.y, o.z, o.w = pin.Quaternion(orientation).coeffs()
        self.imu.publish(message)
        self.peer.pass_time(0.03)

    def gravity(self):
        """Return ε_g of the state, which is published now; None if it is rejected."""
        stamp = self.tick(20 * MS)
        self.publish(joint_state(robot(PANDA).names, self.state.q, self.state.qd, (), stamp))
        result = self.topics["coriolis"].at(stamp)
        return None if result is None else np.array(result.gravity)


def expected(rotation, state):
    """Return ε_g where the root link has this rotation in the world."""
    oracle = robot(PANDA).make_oracle(robot(PANDA).urdf, gravity=tuple(-G * rotation[2]))
    return oracle.at(state.q, state.qd).gravity


def hand_in_root(q):
    """Return the rotation of the hand in the root link."""
    oracle = robot(PANDA).oracle.full
    model = oracle.model
    data = oracle.model.createData()
    pin.framesForwardKinematics(model, data, oracle.configuration(robot(PANDA).oracle.q_full(q)))
    return data.oMf[model.getFrameId("panda_hand")].rotation


def test_orientation_and_timeout(peer):
    """States are rejected before the first message and after a second without one."""
    with Carried(peer, "/tilted", gravity_imu="imu") as monitor:
        assert monitor.gravity() is None
        report = monitor.next_report()
        assert report.entries["gravity"].level == WARN
        assert "no message" in report.entries["gravity"].message
        assert report.count("rejected: gravity unknown") == 1
        for rotation in (TILT, np.eye(3), TILT @ TILT):
            monitor.send(orientation=rotation)
            np.testing.assert_allclose(
                monitor.gravity(), expected(rotation, monitor.state), atol=1e-9
            )
        assert monitor.next_report().entries["gravity"].level == OK
        peer.pass_time(1.1)
        assert monitor.gravity() is None
        assert "is old" in monitor.next_report().entries["gravity"].message
        monitor.send(orientation=TILT)
        np.testing.assert_allclose(monitor.gravity(), expected(TILT, monitor.state), atol=1e-9)


def test_orientation_of_a_moving_link(peer):
    with Carried(peer, "/shaken", gravity_imu="imu") as monitor:
        hand = hand_in_root(monitor.state.q)
        monitor.gravity()  # a position for the placement of the hand
        monitor.send("panda_hand", orientation=TILT @ hand)
        np.testing.assert_allclose(monitor.gravity(), expected(TILT, monitor.state), atol=1e-6)


def test_observer_goes_on(peer):
    """The efforts of a tilted arm are explained while it tilts; nothing restarts and no revision
    changes.
    """
    parameters = {
        "external_torque.gain": GAIN,
        "external_torque.friction": False,
        "gravity_imu": "imu",
    }
    with Carried(peer, "/rolling", **parameters) as monitor:
        subscribed(monitor)
        for k in range(60):
            tilt = pin.rpy.rpyToMatrix(0.005 * k, 0.0, 0.0)
            motion = Motion(robot(PANDA), size=0.0, gravity=tuple(-G * tilt[2]))
            monitor.send(orientation=tilt)
            (result,) = feed(monitor, [motion(0)])
            assert result.valid == (k > 0)
        assert np.abs(result.external_torque).max() < 1e-6
        assert monitor.node._revision == 1


def test_wrong_messages_are_faults(peer):
    with Carried(peer, "/wrong", gravity_imu="imu") as monitor:
        for send, text in (
            ({"frame": "camera", "orientation": TILT}, "'camera'; expected"),
            ({"frame": "panda_hand", "orientation": TILT}, "no joint state yet"),
            ({}, "has no orientation"),
        ):
            monitor.send(**send)
            assert monitor.gravity() is None
            assert text in monitor.next_report().entries["gravity"].message
            monitor.node._robot.position = None
        monitor.imu.publish(Imu())  # a quaternion of zeros
        monitor.node._gravity.accept_imu(b"no message")
        assert monitor.gravity() is None and monitor.process.alive()


def test_frame_of_tf(peer):
    """By a fake of tf2_ros; a transform without a stamp is static."""
    with with_tf2_ros(), Carried(peer, "/framed", gravity_frame="world") as monitor:
        assert monitor.gravity() is None
        buffer = monitor.node._gravity._transforms._buffer
        buffer.frames = ("panda_link0", "world")
        buffer.transform = transform_of(TILT.T)
        peer.pass_time(0.03)
        np.testing.assert_allclose(monitor.gravity(), expected(TILT, monitor.state), atol=1e-9)
        buffer.transform.header.stamp.sec = peer.now() // S - 5
        peer.pass_time(1.1)
        assert monitor.gravity() is None
        assert "the transform" in monitor.next_report().entries["gravity"].message


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"gravity_frame": "world"}, "tf2_ros"),
        (
            {"gravity_frame": "world", "gravity_imu": "imu"},
            "'gravity_imu' is 'imu'; expected empty",
        ),
        ({"gravity_imu": "imu", "floating_base": True}, "'floating_base' is set"),
    ],
)
def test_parameters_that_do_not_go_together(peer, parameters, text):
    with mock.patch.dict(sys.modules, tf2_ros=None), pytest.raises(InputError, match=text):
        peer.start("monitor", robot_description=robot(PANDA).path, **parameters)
