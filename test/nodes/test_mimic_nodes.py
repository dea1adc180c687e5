# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mimic joints in joint states and requests: listed or not, in place or not, moved by efforts of
their own.
"""

import math

import numpy as np
import pytest
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics
from std_msgs.msg import String

from diag_dynamics.nodes.support.statuses import OK, WARN
from nodes import LATCHED, Monitor, Truth, assert_close, description, joint_state, robot

FAN = "several followers of one leader"
GRIPPER = "parallel gripper"
SOURCE, MIMIC = "f1", "f2"
"""Of FAN; q(f2) = 0.8 q(f1)."""


class Whole:
    """A state of all joints of a robot, mimic joints too, with efforts of their own or zero."""

    def __init__(self, robot, sample=0, **own):
        self.robot = robot
        oracle = robot.oracle
        self.q, self.qd, tau, self.qdd = robot.samples[sample]
        self.names = oracle.full.dof_names
        self.position = oracle.q_full(self.q)
        self.velocity = oracle.G @ self.qd
        effort = dict(zip(robot.names, tau, strict=True)) | own
        self.effort = np.array([effort.get(name, 0.0) for name in self.names])
        self.truth = Truth(robot, self.q, self.qd, oracle.G.T @ self.effort)

    def message(self, stamp=0, names=None, **position):
        """List all joints, or those given, shuffled; positions may be put in place of the right
        ones.
        """
        names = (
            np.random.default_rng(7).permutation(self.names if names is None else names).tolist()
        )
        at = [self.names.index(name) for name in names]
        message = joint_state(names, self.position[at], self.velocity[at], self.effort[at], stamp)
        for name, value in position.items():
            message.position[names.index(name)] = value
        return message


@pytest.fixture(scope="module")
def monitor(peer):
    """Start a monitor that gets its robots by topic."""
    descriptions = peer.publisher(String, "/mimic/robot_description", LATCHED)
    with Monitor(peer, "/mimic") as monitor:
        monitor.describe = lambda urdf: descriptions.publish(description(urdf))
        yield monitor
        assert not any("internal error" in key for key in monitor.next_report().values)


def use(monitor, id):
    """Put a robot in force, all joints fresh, and return it."""
    result = robot(id)
    monitor.describe(result.urdf)
    monitor.wait_for_report(
        lambda report: report.values.get("robot") == result.oracle.xml.get("name"), id
    )
    monitor.feed(Whole(result).message(monitor.tick()))
    monitor.forget()
    return result


@pytest.fixture
def fan(monitor):
    """Return a state of a robot with three mimic joints of one source joint, which is in force."""
    return Whole(use(monitor, FAN))


# --- joint states


def test_disagreement(monitor, fan):
    """Counted and named; states go on by the source joint. The tolerance holds for services, too,
    and changes at run time.
    """
    expected = 0.8 * fan.q[fan.robot.names.index(SOURCE)]
    for apart, tolerance_, good in (
        (0.0101, 0.01, False),
        (0.5, 0.6, True),
    ):
        before = monitor.next_report()
        with monitor.having(mimic_tolerance=tolerance_):
            message = fan.message(monitor.tick(), f2=expected + apart)
            fan.truth.check(monitor.feed(message), monitor.now)
            assert answer(monitor, "diagonalize", message, success=good)
            report = monitor.next_report()
        assert report.since(before) == {"received": 1, "published": 1} | (
            {} if good else {"mimic disagreement": 1}
        )
        assert report.level == (OK if good else WARN)
        if not good:
            for text in (
                MIMIC,
                SOURCE,
                f"{expected + apart:.6g}"[:6],
                f"{expected:.6g}"[:6],
                "mimic_tolerance = 0.01",
            ):
                assert text in report.values["last mimic disagreement"]
            assert report.message.endswith("joint 'f2'")


# --- requests

SERVICES = {
    "forward_dynamics": ForwardDynamics,
    "inverse_dynamics": InverseDynamics,
    "diagonalize": Diagonalize,
}


def answer(monitor, service, state, success=True, **fields):
    """Call a service and return its response."""
    response = monitor.call(
        SERVICES[service], service, SERVICES[service].Request(state=state, **fields)
    )
    assert response.success == success, response.message
    return response


def test_services(monitor):
    """Efforts of mimic joints are reflected, their velocities and accelerations ignored."""
    result = use(monitor, GRIPPER)
    options = {name: 1.0 + k for k, name in enumerate(result.oracle.coupling.mimics)}
    whole = Whole(result, 1, **options)
    state = whole.message(0, whole.names)
    truth = whole.truth
    truth.check_state(answer(monitor, "diagonalize", state).state)
    for name in options:
        state.velocity[state.name.index(name)] = 1e3
    response = answer(monitor, "forward_dynamics", state)
    assert_close(
        response.acceleration * truth.unit, truth.state.acceleration * truth.unit, truth.tolerance
    )
    acceleration = dict(zip(result.names, whole.qdd.tolist(), strict=True))
    acceleration = [acceleration.get(name, -1e3) for name in state.name]
    response = answer(monitor, "inverse_dynamics", state, acceleration=acceleration)
    expected = result.oracle.inverse_dynamics(whole.q, whole.qd, whole.qdd)
    assert_close(response.effort / truth.unit, expected / truth.unit, truth.tolerance)


def test_wrong_mimic_joints_in_requests(monitor, fan):
    """The response names joint, value and the expected value; NaN is neither compared nor an
    effort.
    """
    for state, words in (
        (fan.message(f2=7.25), ("state.position", "'f2' is 7.25; expected ", "'f1'", "0.01")),
        (fan.message(names=[name for name in fan.names if name != SOURCE]), ("'f1' is missing",)),
        (fan.message(names=[*fan.names, MIMIC]), ("'f2'; expected each joint",)),
    ):
        for service in SERVICES:
            response = answer(monitor, service, state, success=False)
            assert all(word in response.message for word in words), response.message
    unknown = fan.message(f2=math.nan, g1=math.nan)
    unknown.effort[unknown.name.index("f3")] = math.nan
    fan.truth.check_state(answer(monitor, "diagonalize", unknown).state)
