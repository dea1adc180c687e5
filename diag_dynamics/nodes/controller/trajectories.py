# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of ros2_control's JointTrajectoryController where control_msgs is installed.

They are its action and its controller state.
"""

import numpy as np
from action_msgs.srv import CancelGoal
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectoryPoint

from diag_dynamics.control.following import INVALID_GOAL, SUCCESSFUL, Outcome
from diag_dynamics.nodes.support.messages import doubles, to_time
from diag_dynamics.nodes.support.publishing import RateLimit

try:
    from control_msgs.action import FollowJointTrajectory
    from control_msgs.msg import JointTrajectoryControllerState
except ImportError:  # PyPI has no control_msgs
    FollowJointTrajectory = JointTrajectoryControllerState = None

ACTION = "follow_joint_trajectory"

FEEDBACK_RATE = 20.0
"""Maximum rate of the feedback of the action [Hz]."""


class _Goal:
    """A trajectory that is followed; by the action with a goal handle and a future result."""

    def __init__(self, following):
        self.following = following
        self.handle = None
        self.result = Future()

    async def wait(self, _):
        """Return the result of the action."""
        return await self.result


class Trajectories:
    """Action and controller state of a controller's trajectories.

    `publisher` makes a publisher from a message type and a topic. `accept` returns whether the goal
    of an action is followed, and `cancel()` ends the trajectory. `outcome` is that of the last
    trajectory that ended or was rejected.
    """

    def __init__(self, node, publisher, accept, cancel):
        self._goals = []
        self._accept = accept
        self._cancel = cancel
        self._server = None
        self._node = node
        self._preempted = []  # handles of goals that newer trajectories replaced
        self._limit = RateLimit(FEEDBACK_RATE)
        self.outcome = Outcome(SUCCESSFUL)
        self._states = None  # publisher of the controller state
        if FollowJointTrajectory:
            self._states = publisher(JointTrajectoryControllerState, "~/controller_state")
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

    @property
    def receivers(self):
        """Number of receivers of the controller state."""
        return self._states.get_subscription_count() if self._states else 0

    @property
    def is_active(self):
        """Whether a trajectory is followed."""
        return bool(self._goals)

    def update(self):
        """End the goals of trajectories that have ended.

        Publish the feedback of the present one if it is due.
        """
        for goal in self._goals.copy():
            following = goal.following
            if following.outcome:
                self.outcome = following.outcome
                self._goals.remove(goal)
                self._end(goal)
            elif goal.handle and following.state and self._limit.due(following.state.newest):
                self._publish_feedback(goal)

    def reject(self, reason):
        """Report a trajectory that is not followed."""
        self.outcome = Outcome(INVALID_GOAL, reason)

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
        outcome = goal.following.outcome
        handle = goal.handle
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

    def publish_state(self, status):
        """Publish the controller state of a ControllerStatus if the topic has a subscriber."""
        if not self.receivers:
            return
        message = JointTrajectoryControllerState(
            header=status.header,
            joint_names=status.dof_names,
            feedback=_point(status.actual_position, status.actual_velocity),
            output=JointTrajectoryPoint(effort=status.effort_command),
        )
        if status.tracking_error_valid:
            velocity_error = np.subtract(status.desired_velocity, status.actual_velocity)
            message.reference = _point(status.desired_position, status.desired_velocity)
            message.error = _point(status.tracking_error, velocity_error)
        self._states.publish(message)

    def _publish_feedback(self, goal):
        following = goal.following
        state = following.state
        desired = following.desired
        elapsed = state.newest - following.start
        message = FollowJointTrajectory.Feedback(
            header=Header(stamp=to_time(state.newest)),
            joint_names=list(following.names),
            desired=_point(desired.position, desired.velocity, elapsed),
            actual=_point(state.position, state.velocity, elapsed),
            error=_point(*following.error, elapsed),
        )
        goal.handle.publish_feedback(message)


def _point(position, velocity, elapsed=0):
    """Return a point of a trajectory; `elapsed` is the time from its start [ns]."""
    point = JointTrajectoryPoint(positions=doubles(position), velocities=doubles(velocity))
    point.time_from_start.sec, point.time_from_start.nanosec = divmod(elapsed, 1_000_000_000)
    return point
