# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Feedback and results of trajectories: topics, and the action FollowJointTrajectory where control_msgs is installed."""

from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from diag_dynamics.control.following import INVALID_GOAL, SUCCESSFUL, Outcome
from diag_dynamics.nodes.support.messages import doubles, to_time
from diag_dynamics.nodes.support.publishing import RateLimit
from diag_dynamics.text import shortened

try:
    from control_msgs.action import FollowJointTrajectory
except ImportError:  # PyPI has no control_msgs
    FollowJointTrajectory = None

ACTION = "follow_joint_trajectory"


class _Goal:
    """A trajectory that is followed; by the action with a goal handle and a future result."""

    def __init__(self, following):
        self.following, self.handle, self.result = following, None, Future()

    async def wait(self, _):
        """Return the result of the action."""
        return await self.result


class Trajectories:
    """Feedback and results of a controller's trajectories.

    `publisher` makes a publisher from a message type and a topic. `accept` returns whether the goal
    of an action is followed, and `cancel()` ends the trajectory.
    """

    def __init__(self, node, publisher, accept, cancel):
        self._goals, self._accept, self._cancel, self._server = [], accept, cancel, None
        self._node, self._preempted = node, []  # handles of goals that newer trajectories replaced
        self._feedback = publisher(JointTrajectory, "~/trajectory_feedback")
        self._results = publisher(DiagnosticStatus, "~/trajectory_result")
        self._limit = RateLimit(node.values["max_rate.feedback"])
        if FollowJointTrajectory:
            self._canceler = node.create_client(CancelGoal, f"~/{ACTION}/_action/cancel_goal")
            self._server = ActionServer(
                node,
                FollowJointTrajectory,
                f"~/{ACTION}",
                lambda _: None,  # each goal has its own callback
                goal_callback=self._take_goal,
                handle_accepted_callback=self._begin,
                cancel_callback=self._take_cancel,
            )

    def destroy(self):
        """Remove the action from the graph."""
        if self._server:
            self._server.destroy()
            self._node.destroy_client(self._canceler)
            self._server = None

    def add(self, following):
        """Report a Following from now on."""
        self._goals.append(_Goal(following))

    def update(self):
        """Publish the results of trajectories that have ended, and the feedback of the present one if it is due."""
        for goal in self._goals.copy():
            following = goal.following
            if following.outcome:
                self._goals.remove(goal)
                self._end(goal)
            elif following.state and self._limit.due(following.state.newest):
                self._publish_feedback(goal)

    def reject(self, reason):
        """Publish the result of a trajectory that is not followed."""
        self._publish_result(Outcome(INVALID_GOAL, reason))

    # --- The action

    def _take_goal(self, request):
        return GoalResponse.ACCEPT if self._accept(request) else GoalResponse.REJECT

    def _begin(self, handle):
        goal = self._goals[-1]  # the one that has just been accepted
        goal.handle = handle
        handle.execute(goal.wait)

    def _take_cancel(self, handle):
        if handle in self._preempted:
            return CancelResponse.ACCEPT
        if not any(goal.handle is handle and not goal.following.outcome for goal in self._goals):
            return CancelResponse.REJECT
        self._cancel()  # the next update finishes the goal, because it is not canceling yet
        return CancelResponse.ACCEPT

    def _end(self, goal):
        """Finish a goal; rclpy requires a request to end a replaced one as canceled."""
        handle = goal.handle
        is_preempted = goal.following.outcome.canceled and handle and not handle.is_cancel_requested
        if not (is_preempted and self._canceler.service_is_ready()):
            self._finish(goal)
            return
        self._preempted.append(handle)
        request = CancelGoal.Request()
        request.goal_info.goal_id = handle.goal_id
        self._canceler.call_async(request).add_done_callback(lambda _: self._finish_preempted(goal))

    def _finish_preempted(self, goal):
        self._preempted.remove(goal.handle)
        self._finish(goal)

    # --- Messages

    def _finish(self, goal):
        outcome, handle = goal.following.outcome, goal.handle
        self._publish_result(outcome)
        if handle is None:
            return
        if outcome.code == SUCCESSFUL:
            handle.succeed()
        elif outcome.canceled and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        goal.result.set_result(
            FollowJointTrajectory.Result(error_code=outcome.code, error_string=outcome.reason)
        )

    def _publish_result(self, outcome):
        level = DiagnosticStatus.OK if outcome.code == SUCCESSFUL else DiagnosticStatus.ERROR
        code = KeyValue(key="error_code", value=str(outcome.code))
        self._results.publish(
            DiagnosticStatus(
                level=level, name="trajectory", message=shortened(outcome.reason), values=[code]
            )
        )

    def _publish_feedback(self, goal):
        following = goal.following
        state, desired = following.state, following.desired
        elapsed = state.newest - following.start
        points = [
            _point(desired.position, desired.velocity, elapsed),
            _point(state.position, state.velocity, elapsed),
            _point(*following.error, elapsed),
        ]
        message = JointTrajectory(joint_names=list(following.names), points=points)
        message.header.stamp = to_time(state.newest)
        self._feedback.publish(message)
        if goal.handle:
            names = ("desired", "actual", "error")
            goal.handle.publish_feedback(
                FollowJointTrajectory.Feedback(
                    header=message.header,
                    joint_names=message.joint_names,
                    **dict(zip(names, points, strict=True)),
                )
            )


def _point(position, velocity, elapsed):
    """Return a point of a trajectory; `elapsed` is the time from its start [ns]."""
    point = JointTrajectoryPoint(positions=doubles(position), velocities=doubles(velocity))
    point.time_from_start.sec, point.time_from_start.nanosec = divmod(elapsed, 1_000_000_000)
    return point
