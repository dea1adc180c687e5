# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories of the controller in lockstep with the simulator: topics and action, by a goal handle of the test's own."""

import contextlib
import sys
from types import ModuleType, SimpleNamespace
from unittest import mock
from uuid import uuid4

import numpy as np
import pinocchio as pin
import pytest
from action_msgs.srv import CancelGoal
from control_msgs.msg import JointTrajectoryControllerState
from rclpy.action import CancelResponse, GoalResponse
from unique_identifier_msgs.msg import UUID

from controllers import (
    START_AT,
    begin_at_rest,
    lockstep_arm,
    pose_error,
    pose_message,
    pose_of,
    trajectory,
)
from nodes import UR5, S, nanoseconds, robot

NAMES = robot(UR5).names
START = np.array(START_AT)
GOAL = START + 0.1
MODULE = "diag_dynamics.nodes.controller.trajectories"


class Message(SimpleNamespace):
    """Stands in for messages of control_msgs, which PyPI has not."""


STAND_IN = SimpleNamespace(Result=Message, Feedback=Message)


class Handle:
    """A goal handle with the transitions of rcl_action."""

    def __init__(self, request):
        self.request, self.state, self.feedback, self.wait = request, "executing", [], None
        self.goal_id = UUID(uuid=list(uuid4().bytes))

    @property
    def is_cancel_requested(self):
        return self.state == "canceling"

    def execute(self, callback):
        self.wait = callback(self)

    def publish_feedback(self, feedback):
        assert self.state == "executing"
        self.feedback.append(feedback)

    def _end(self, state, allowed):
        assert self.state in allowed, (self.state, state)
        self.state = state

    def succeed(self):
        self._end("succeeded", ("executing", "canceling"))

    def abort(self):
        self._end("aborted", ("executing", "canceling"))

    def canceled(self):
        self._end("canceled", ("canceling",))

    def result(self):
        """Return the result that the coroutine of the server returns; it must be done."""
        if self.wait:
            with pytest.raises(StopIteration) as end:
                self.wait.send(None)
            self.wait, self._result = None, end.value.value
        return self._result


class Server:
    """An action server whose requests are calls of the test; rclpy calls the callbacks in the same order."""

    def __init__(
        self, node, kind, name, execute, *, goal_callback, handle_accepted_callback, cancel_callback
    ):
        self.accept, self.begin, self.confirm = (
            goal_callback,
            handle_accepted_callback,
            cancel_callback,
        )
        self.destroyed, node.action, self.handles = False, self, []
        assert name == "~/follow_joint_trajectory"
        node.create_service(CancelGoal, f"{name}/_action/cancel_goal", self._take_request)

    def _take_request(self, request, response):
        """Cancel the goal of a request."""
        (handle,) = (one for one in self.handles if one.goal_id == request.goal_info.goal_id)
        assert self.cancel(handle)
        return response

    def send(self, message, path=(), goal=(), time=0.0):
        """Return the handle of a goal, or None if it is rejected."""
        seconds = SimpleNamespace(sec=int(time), nanosec=round(S * (time % 1.0)))
        fields = {
            "trajectory": message,
            "path_tolerance": path,
            "goal_tolerance": goal,
            "goal_time_tolerance": seconds,
        }
        request = Message(**fields)
        if self.accept(request) == GoalResponse.REJECT:
            return None
        handle = Handle(request)
        self.handles.append(handle)
        self.begin(handle)
        return handle

    def cancel(self, handle):
        if self.confirm(handle) == CancelResponse.ACCEPT:
            handle.state = "canceling"
        return handle.state == "canceling"

    def destroy(self):
        self.destroyed = True


class Buffer:
    """A buffer of tf2_ros with one transform."""

    transform = None

    def lookup_transform(self, target, source, time):
        if source != "table":
            raise LookupError(
                f'"{source}" passed to lookupTransform argument source_frame does not exist'
            )
        assert target == "world"  # the root of a UR5
        return self.transform


@pytest.fixture(scope="module")
def arm(peer):
    module = ModuleType("tf2_ros")
    module.Buffer, module.TransformListener = Buffer, lambda buffer, node: None
    with contextlib.ExitStack() as stack:
        stack.enter_context(mock.patch.dict(sys.modules, tf2_ros=module))
        stack.enter_context(mock.patch(f"{MODULE}.ActionServer", Server))
        stack.enter_context(mock.patch(f"{MODULE}.FollowJointTrajectory", STAND_IN))
        values = {
            "controlled_link": "tool0",
            "effort_rate": ["*=5000.0"],
        }
        arm = stack.enter_context(lockstep_arm(peer, "/followed", list(NAMES), **values))
        arm.states = peer.topic(JointTrajectoryControllerState, f"{arm.name}/controller_state")
        yield arm


@pytest.fixture(autouse=True)
def from_the_start(arm):
    begin_at_rest(arm)
    arm.states.forget()


def to_goal(names=NAMES, goal=GOAL):
    return trajectory([(1.0, goal, [0] * len(names))], names)


def server(arm):
    return arm.process.node.action


def go(arm, seconds):
    """Let the arm go on for a time of its stamps."""
    first = nanoseconds(arm.wait_for(lambda s: True, "a status").header.stamp)
    status = arm.wait_for(lambda s: nanoseconds(s.header.stamp) - first >= seconds * S, "time")
    return np.array(arm.simulator.states.messages[-1].position), status


def test_a_topic_reports_motion_and_success(arm):
    """Status and controller state have desired and actual motion, and the status the outcome."""
    arm.trajectory.publish(to_goal())
    begun = nanoseconds(arm.wait_for(lambda s: s.trajectory_active, "the trajectory").header.stamp)
    status = arm.wait_for(lambda s: not s.trajectory_active, "its end")
    assert (status.trajectory_code, status.trajectory_reason) == (0, "")
    assert len(arm.states.messages) > 200  # in a second, one for each state
    statuses = {nanoseconds(status.header.stamp): status for status in arm.status.messages}
    for message in arm.states.messages:
        stamp = nanoseconds(message.header.stamp)
        state, status = arm.simulator.states.repeated(stamp), statuses[stamp]
        desired, actual, error = message.reference, message.feedback, message.error
        np.testing.assert_array_equal(actual.positions, state.position)
        np.testing.assert_array_equal(actual.velocities, state.velocity)
        np.testing.assert_array_equal(message.output.effort, status.effort_command)
        np.testing.assert_array_equal(desired.positions, status.desired_position)
        np.testing.assert_array_equal(actual.velocities, status.actual_velocity)
        for name in ("positions", "velocities"):
            expected = np.subtract(getattr(desired, name), getattr(actual, name))
            np.testing.assert_allclose(getattr(error, name), expected, atol=1e-12)
        t = min(max((stamp - begun) / S, 0.0), 1.0)
        part = t**2 * (3.0 - 2.0 * t)  # a cubic between rests, written out
        np.testing.assert_allclose(desired.positions, START + part * 0.1, atol=2e-3)
        np.testing.assert_allclose(desired.velocities, 0.6 * (t - t**2), atol=0.02)


def test_an_action_of_some_joints_in_another_order_succeeds(arm):
    """The other joint holds its position; efforts are ignored with a warning."""
    goal = to_goal(NAMES[:0:-1], GOAL[:0:-1])
    goal.points[0].effort = [1.0] * len(goal.joint_names)
    handle = server(arm).send(goal)
    assert "trajectory.points have efforts." in arm.process.output
    go(arm, 0.5)
    assert handle.state == "executing" and len(handle.feedback) >= 8
    assert handle.feedback[-1].joint_names == list(NAMES)
    q, status = go(arm, 0.8)
    assert status.trajectory_code == 0 and not status.trajectory_active
    assert handle.state == "succeeded" and handle.result() == Message(error_code=0, error_string="")
    np.testing.assert_allclose(q, [START[0], *GOAL[1:]], atol=5e-3)


def test_cancel_holds_the_position(arm):
    handle = server(arm).send(to_goal())
    go(arm, 0.5)
    assert server(arm).cancel(handle)
    _, status = go(arm, 1.0)
    assert handle.state == "canceled" and "canceled" in handle.result().error_string
    assert max(map(abs, status.tracking_error)) < 1e-3
    assert not server(arm).cancel(Handle(None))


def test_abort(arm):
    """A newer goal cancels the first one, and an error beyond its tolerance ends the newer one."""
    tolerance = SimpleNamespace(name=NAMES[2], position=1e-7, velocity=0.0, acceleration=0.0)
    first = server(arm).send(to_goal())
    go(arm, 0.3)
    second = server(arm).send(to_goal(), path=[tolerance])
    go(arm, 0.3)
    for handle, state, code, reason in (
        (first, "canceled", -1, "a newer trajectory"),
        (second, "aborted", -4, f"joint '{NAMES[2]}' on the trajectory is"),
    ):
        assert handle.state == state and handle.result().error_code == code
        assert reason in handle.result().error_string


def test_rejection_names_the_joint(arm):
    wrong, unknown = to_goal(["wing", *NAMES[1:]]), "joint_names has 'wing'"
    for send, reason in (
        (lambda: server(arm).send(wrong), unknown),
        (
            lambda: server(arm).send(to_goal(), goal=[SimpleNamespace(name="wing")]),
            "goal_tolerance has 'wing'",
        ),
        (lambda: arm.trajectory.publish(wrong), unknown),
    ):
        assert send() is None
        status = arm.wait_for(lambda s, text=reason: text in s.trajectory_reason, "the reason")
        assert status.trajectory_code == -1 and not status.trajectory_active
    log = "Rejected on follow_joint_trajectory: "
    for reason in (unknown, "goal_tolerance has 'wing'"):  # at once, each
        assert any(log in line and reason in line for line in arm.process.node.output)
    arm.switch("damping")
    assert server(arm).send(to_goal()) is None


def test_a_pose_in_a_frame_of_tf(arm):
    """Its target is Pinocchio's composition of transform and pose; unknown and old frames are named."""
    arm.switch("pose")
    position, axes = pose_of(START)
    placement = pin.SE3(pin.rpy.rpyToMatrix(0.2, -0.4, 1.1), np.array([0.5, -0.3, 0.2]))
    x, y, z, w = map(float, pin.Quaternion(placement.rotation).coeffs())
    p = SimpleNamespace(**dict(zip("xyz", placement.translation, strict=True)))
    stamp = SimpleNamespace(sec=0, nanosec=0)
    transform = SimpleNamespace(translation=p, rotation=SimpleNamespace(x=x, y=y, z=z, w=w))
    buffer = arm.process.node._transforms._buffer
    buffer.transform = SimpleNamespace(header=SimpleNamespace(stamp=stamp), transform=transform)
    goal = pin.SE3(axes, position + np.array([0.05, 0.1, -0.05]))
    pose = placement.inverse() * goal
    arm.target.publish(pose_message("table", pose.translation, pose.rotation))
    arm.wait_for(lambda s: pose_error(s)[0] > 0.1, "the target", timeout=1.0)
    arm.wait_for(lambda s: max(pose_error(s)) < 1e-3 and s.energy < 1e-6, "its pose")
    found = pose_of(arm.simulator.states.messages[-1].position)
    np.testing.assert_allclose(found[0], goal.translation, atol=2e-3)
    np.testing.assert_allclose(found[1], goal.rotation, atol=5e-3)
    arm.refuses(lambda: arm.target.publish(pose_message("map", position)), "frame_id is 'map'")
    stamp.nanosec = 1  # of the epoch
    if arm.process.node.time.now() > 2 * S:
        arm.refuses(lambda: arm.target.publish(pose_message("table", position)), "the transform is")
    arm.process.node._transforms = None
    arm.refuses(
        lambda: arm.target.publish(pose_message("table", position)), "needs package tf2_ros"
    )


def test_deactivation_aborts_and_cleanup_removes_the_action(arm):
    action, handle = server(arm), server(arm).send(to_goal())
    go(arm, 0.3)
    assert arm.peer.transition(arm.name, "deactivate")
    assert handle.state == "aborted" and "deactivated" in handle.result().error_string
    assert action.send(to_goal()) is None and not action.destroyed
    assert arm.peer.transition(arm.name, "cleanup") and action.destroyed
