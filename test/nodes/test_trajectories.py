# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories and poses of the controller in lockstep with the simulator;
test_trajectory_action.py has the action.
"""

import numpy as np
import pytest
from control_msgs.msg import JointTrajectoryControllerState

from controllers import (
    START_AT,
    begin_at_rest,
    lockstep_arm,
    pose_error,
    pose_message,
    pose_of,
    trajectory,
)
from nodes import UR5, nanoseconds, robot

NAMES = robot(UR5).names
START = np.array(START_AT)
GOAL = START + 0.1


@pytest.fixture(scope="module")
def arm(peer):
    """A UR5 in lockstep with its controller, commands in another order than joint states."""
    values = {"controlled_link": "tool0", "effort_rate": ["*=5000.0"]}
    with lockstep_arm(peer, "/followed", list(NAMES[::-1]), **values) as arm:
        arm.states = peer.topic(JointTrajectoryControllerState, f"{arm.name}/controller_state")
        yield arm


@pytest.fixture(autouse=True)
def from_the_start(arm):
    begin_at_rest(arm)
    arm.states.forget()


def test_a_topic_reports_motion_and_success(arm):
    """Status and controller state have desired and actual motion, and the status the outcome;
    efforts are ignored, and a rejection names the joint.
    """
    message = trajectory([(1.0, GOAL, [0] * 6)], NAMES)
    message.points[0].effort = [1.0] * 6
    arm.trajectory.publish(message)
    arm.wait_for(lambda s: s.trajectory_active, "the trajectory")
    status = arm.wait_for(lambda s: not s.trajectory_active, "its end")
    assert (status.trajectory_code, status.trajectory_reason) == (0, "")
    assert "trajectory.points have efforts." in arm.process.output
    assert len(arm.states.messages) > 200  # in a second, one for each state
    statuses = {nanoseconds(status.header.stamp): status for status in arm.status.messages}
    for message in arm.states.messages:
        stamp = nanoseconds(message.header.stamp)
        state = arm.simulator.states.repeated(stamp)
        status = statuses[stamp]
        desired = message.reference
        actual = message.feedback
        error = message.error
        np.testing.assert_array_equal(actual.positions, state.position)
        np.testing.assert_array_equal(actual.velocities, state.velocity)
        np.testing.assert_array_equal(message.output.effort, status.effort_command)
        np.testing.assert_array_equal(desired.positions, status.desired_position)
        np.testing.assert_array_equal(actual.velocities, status.actual_velocity)
        for name in ("positions", "velocities"):
            expected = np.subtract(getattr(desired, name), getattr(actual, name))
            np.testing.assert_allclose(getattr(error, name), expected, atol=1e-12)
    np.testing.assert_allclose(desired.positions, GOAL, atol=1e-9)
    arm.trajectory.publish(trajectory([(1.0, GOAL)], ["wing", *NAMES[1:]]))
    status = arm.wait_for(lambda s: "'wing'" in s.trajectory_reason, "the rejection")
    assert status.trajectory_code == -1


def test_a_pose_in_the_axes_of_a_link(arm):
    """Its target is that of the message; frames that are no links are named."""
    arm.switch("pose")
    position, axes = pose_of(START)
    goal = np.add(position, [0.05, 0.1, -0.05])
    arm.target.publish(pose_message("world", goal, axes))  # the root of a UR5
    arm.wait_for(lambda s: pose_error(s)[0] > 0.1, "the target", timeout=1.0)
    arm.wait_for(lambda s: max(pose_error(s)) < 1e-3 and s.energy < 1e-6, "its pose")
    result = pose_of(arm.simulator.states.messages[-1].position)
    np.testing.assert_allclose(result[0], goal, atol=2e-3)
    np.testing.assert_allclose(result[1], axes, atol=5e-3)
    arm.refuses(lambda: arm.target.publish(pose_message("map", position)), "'map'; expected")
