# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External wrench of the monitor as a force-torque sensor: value, sign, frame, rate and validity,
against Pinocchio.
"""

import numpy as np
import pytest
from diag_dynamics.msg import ExternalWrench
from geometry_msgs.msg import WrenchStamped

from diag_dynamics.exceptions import InputError
from nodes import PANDA, Monitor, S, joint_state, nanoseconds, robot
from pushed import GAIN, STEP, Motion

HAND, WRIST = "panda_hand", "panda_link7"
FORCE = np.array([8.0, -15.0, 11.0, 0.7, -1.2, 0.4])
"""Wrench on the hand, in its axes at its origin [N, N m]."""
WIDE = {"external_wrench.max_force_deviation": 1e3, "external_wrench.max_torque_deviation": 1e3}
"""Limits with which all directions count at the hand, unweighted."""
EVERY = {"max_rate": ["*=0"]}
"""Rates with which every state has messages."""
TORQUE = {"external_torque.gain": GAIN, "external_torque.friction": False}
ARM = robot(PANDA)


def pushed(wrench, link=HAND):
    """Return the state of an arm at rest on whose link a wrench acts."""
    still = Motion(ARM, size=0.0)
    return Motion(ARM, still.oracle.effort_of(still.middle, {link: wrench}, "link"), size=0.0)


def jacobian(link):
    """Return Pinocchio's J at the pose of :func:`pushed`, column by column of Jᵀ."""
    still = Motion(ARM, size=0.0)
    return np.array(
        [still.oracle.effort_of(still.middle, {link: axis}, "link") for axis in np.eye(6)]
    )


class Frames:
    """A monitor with wrenches at two frames."""

    def __init__(self, monitor):
        self.monitor = monitor
        self.peer = monitor.peer
        self.hand = self.peer.topic(WrenchStamped, f"{monitor.name}/external_wrench")
        self.estimates = self.peer.topic(
            ExternalWrench, f"{monitor.name}/external_wrench_estimates"
        )

    def feed(self, *states):
        """Publish states and forget earlier messages; return the stamps."""
        for topic in (self.hand, self.estimates):
            topic.forget()
        stamps = []
        for q, qd, tau in states:
            stamps.append(self.monitor.tick(STEP))
            self.monitor.publish(
                joint_state(ARM.names, q, qd, () if tau is None else tau, stamps[-1])
            )
        return stamps

    def at(self, frame):
        """Return the estimates at a frame."""
        return [message for message in self.estimates.messages if message.header.frame_id == frame]


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda with two frames."""
    values = TORQUE | {
        "external_wrench.frames": f"[{HAND}, {WRIST}]",
        "robot_description": ARM.path,
    }
    with Monitor(peer, "/wrench", outputs=["state"], **values) as monitor:
        yield Frames(monitor.connect(ARM))


@pytest.fixture
def frames(running):
    """Let time pass, so that the next state is the first one."""
    running.monitor.tick(10 * S)
    return running


def vector(wrench):
    """Return a Wrench as six numbers."""
    f = wrench.force
    n = wrench.torque
    return np.array([f.x, f.y, f.z, n.x, n.y, n.z])


@pytest.mark.parametrize("variances", [(), np.linspace(0.01, 0.2, len(ARM.names))])
def test_wrench_on_the_hand(frames, variances):
    """Every state has one message: the wrench of the environment on the robot, in the axes of its
    frame at its origin.

    Its covariance is (JΣ⁻¹Jᵀ)⁻¹, by default of 0.1 N m in each joint.
    """
    noise = np.diag(variances) if len(variances) else 0.01 * np.eye(len(ARM.names))
    values = {
        "external_torque.covariance": noise.ravel().tolist(),
        "external_torque.covariance_joints": [*ARM.names],
    }
    with frames.monitor.having(**WIDE, **EVERY, **(values if len(variances) else {})):
        stamps = frames.feed(*[pushed(FORCE)(0)] * 400)
    assert frames.hand.stamps == stamps[1:]  # the observer starts at the second state
    last = frames.hand.messages[-1]
    assert last.header.frame_id == HAND
    np.testing.assert_allclose(vector(last.wrench), FORCE, rtol=1e-6)
    J = jacobian(HAND)
    estimate = frames.at(HAND)[-1]
    assert estimate.valid and not estimate.unobserved and estimate.chi_square < 1e-6
    assert estimate.wrench == last.wrench and nanoseconds(estimate.header.stamp) == stamps[-1]
    expected = np.linalg.inv(J @ np.linalg.solve(noise, J.T))
    np.testing.assert_allclose(np.reshape(estimate.covariance, (6, 6)), expected, atol=1e-9)


def test_no_wrench_without_a_result(frames):
    """A controller receives nothing; the estimates say so, with zeros."""
    state = pushed(FORCE)(0)
    with frames.monitor.having(**WIDE, **EVERY):
        frames.feed(*[state] * 10)
        frames.feed(*[(*state[:2], None)] * 3)
    assert not frames.hand.messages
    for estimate in frames.at(HAND) + frames.at(WRIST):
        assert not estimate.valid
        assert not vector(estimate.wrench).any()
        assert not np.any(estimate.covariance)
        assert not estimate.unobserved and estimate.chi_square == 0.0
    assert len(frames.at(HAND)) == len(frames.at(WRIST)) == 3
    with frames.monitor.having(**WIDE):
        frames.feed(*[state] * 2)
    assert frames.hand.messages and frames.at(HAND)[0].valid


def test_no_wrench_with_unobserved_directions(frames):
    """A zero there would be no measurement. Estimates name the directions, log and diagnostics the
    loss.
    """
    begin = len(frames.monitor.reports)
    deviations = ("external_wrench.max_force_deviation", "external_wrench.max_torque_deviation")
    with frames.monitor.having(**dict.fromkeys(deviations, 1e-3)):  # below the assumed noise
        frames.feed(*[pushed(FORCE)(0)] * 10)
        frames.monitor.peer.pass_time(60.0)
        frames.feed(*[pushed(FORCE)(0)] * 10)
    assert not frames.hand.messages
    for frame in (HAND, WRIST):
        assert [bool(estimate.unobserved) for estimate in frames.at(frame) if estimate.valid].count(
            True
        ) >= 4
    key = "wrenches with unobserved directions"
    frames.monitor.wait_for_report(lambda report: report.count(key), key, begin)
    lines = frames.monitor.process.output.splitlines()
    (line,) = (line for line in lines if "No external wrench at " in line)
    assert f"at {HAND}: " in line


def test_rates(frames):
    """Each topic has a rate of its own, 250 Hz by default, which all frames share."""
    with frames.monitor.having(max_rate=["external_wrench_estimates=50"], **WIDE):
        frames.feed(*[pushed(FORCE)(0)] * 101)
    assert set(np.diff(frames.hand.stamps)) == {2 * STEP}
    assert set(np.diff([nanoseconds(estimate.header.stamp) for estimate in frames.at(HAND)])) == {
        10 * STEP
    }
    assert len(frames.at(HAND)) == len(frames.at(WRIST))


def test_frames_of_a_running_node(frames):
    """The first frame has the WrenchStamped; links of another robot are an error."""
    name = "external_wrench.frames"
    with frames.monitor.having(**{name: [WRIST, HAND]}, **WIDE):
        frames.feed(*[pushed(FORCE)(0)] * 400)
        np.testing.assert_allclose(vector(frames.at(HAND)[-1].wrench), FORCE, rtol=1e-6)
        assert {message.header.frame_id for message in frames.hand.messages} == {WRIST}
    result = frames.monitor.set_parameters({name: ["tool0"]})
    assert not result.successful
    assert (
        "parameter 'external_wrench.frames' is 'tool0'; expected a link of robot 'panda'"
        in result.reason
    )
    with frames.monitor.having(**{name: [""]}):
        frames.feed(*[pushed(FORCE)(0)] * 10)
        assert not frames.hand.messages and not frames.estimates.messages


def test_frames_without_an_observer(peer):
    """The error names both parameters."""
    with pytest.raises(InputError, match=r"external_torque\.gain is 0.*external_wrench\.frames"):
        Monitor(
            peer,
            "/lone",
            outputs=["state"],
            robot_description=ARM.path,
            **{"external_wrench.frames": f"[{HAND}]"},
        )
