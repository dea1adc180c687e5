# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The action of the controller by rclpy's own client over DDS, with the executor of the nodes, in
one process.
"""

import numpy as np
import pytest
import rclpy
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState

from controllers import START_AT, trajectory
from diag_dynamics.nodes.controller.controller import ControllerNode
from diag_dynamics.nodes.support.runner import Executor
from nodes import UR5, robot

pytestmark = pytest.mark.live

NAMES, Q = robot(UR5).names, np.array(START_AT)
PARAMETERS = {
    "robot_description": robot(UR5).path,
    "robot_compensates_gravity": True,
    "autostart": True,
    "max_state_age": 1.0,
    "hold_time": 10.0,
    "following_energy": 0.0,
}


class Live:
    """A controller of an arm that stands, and an action client."""

    def __init__(self):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        arguments = [
            word for name, value in PARAMETERS.items() for word in ("-p", f"{name}:={value}")
        ]
        self.node = ControllerNode(cli_args=["--ros-args", *arguments], context=self.context)
        self.peer = Node("peer", context=self.context)
        self.states = self.peer.create_publisher(JointState, "joint_states", 10)
        name = f"{self.node.get_name()}/follow_joint_trajectory"
        self.client = ActionClient(self.peer, FollowJointTrajectory, name)
        self.feedback = []
        self.executors = (
            Executor(context=self.context),
            SingleThreadedExecutor(context=self.context),
        )
        for executor, node in zip(self.executors, (self.node, self.peer), strict=True):
            executor.add_node(node)

    def close(self):
        for executor in self.executors:
            executor.shutdown()
        self.node.destroy_node()
        self.peer.destroy_node()
        self.context.try_shutdown()

    def is_in_force(self):
        """Whether the law has taken the arm up."""
        loop = self.node._loop
        return loop and loop.state and not loop.supervisor.starting

    def wait(self, condition, what, rounds=20_000):
        """Feed the same state until a condition holds."""
        for _ in range(rounds):
            if condition():
                return
            message = JointState(name=list(NAMES), position=list(Q), velocity=[0.0] * 6)
            message.header.stamp = self.peer.get_clock().now().to_msg()
            self.states.publish(message)
            self.executors[0].spin_until_future_complete(Future(), timeout_sec=0.002)
            self.executors[1].spin_once(timeout_sec=0.002)
        raise AssertionError(f"waited {rounds} rounds in vain for {what}")

    def result_of(self, future, what):
        self.wait(future.done, what)
        return future.result()

    def send(self, goal, names=NAMES, seconds=0.5, **tolerances):
        message = FollowJointTrajectory.Goal(
            trajectory=trajectory([(seconds, goal, [0.0] * len(names))], names), **tolerances
        )
        return self.result_of(
            self.client.send_goal_async(message, self.feedback.append), "an answer to the goal"
        )


@pytest.fixture(scope="module")
def live():
    live = Live()
    try:
        live.wait(live.client.server_is_ready, "the action")
        live.wait(live.is_in_force, "the law in force")
        yield live
    finally:
        live.close()


def test_success_cancel_preemption_and_rejection(live):
    """Each goal ends with its status and result; the client of the older goal is told."""
    done = live.send(Q + 0.01)
    assert done.accepted
    result = live.result_of(done.get_result_async(), "success")
    assert result.status == GoalStatus.STATUS_SUCCEEDED and result.result.error_code == 0
    assert list(live.feedback[-1].feedback.joint_names) == list(NAMES)
    np.testing.assert_array_equal(live.feedback[-1].feedback.actual.positions, Q)

    canceled = live.send(Q + 0.01, seconds=60.0)
    answer = live.result_of(canceled.cancel_goal_async(), "an answer to the cancellation")
    assert len(answer.goals_canceling) == 1
    result = live.result_of(canceled.get_result_async(), "the end of the canceled goal")
    assert result.status == GoalStatus.STATUS_CANCELED and "canceled" in result.result.error_string

    older = live.send(Q + 0.01, seconds=60.0)
    newer = live.send(Q + 0.02, seconds=60.0)
    result = live.result_of(older.get_result_async(), "the end of the older goal")
    assert result.status == GoalStatus.STATUS_CANCELED and "newer" in result.result.error_string
    live.node.trigger_deactivate()
    result = live.result_of(newer.get_result_async(), "the end by deactivation")
    assert result.status == GoalStatus.STATUS_ABORTED
    assert "deactivated" in result.result.error_string
    assert not live.send(Q + 0.01).accepted  # inactive
    live.node.trigger_activate()
    loop = live.node._loop
    live.wait(lambda: loop.state and not loop.supervisor.starting, "the law in force again")
    assert not live.send(Q, ["wing", *NAMES[1:]]).accepted
    assert "joint_names has 'wing'" in live.node._record._last_refusal
    close = JointTolerance(name=NAMES[2], position=1e-7)
    beyond = live.send(Q + 0.01, seconds=60.0, path_tolerance=[close])
    result = live.result_of(beyond.get_result_async(), "the end beyond a tolerance")
    assert (result.status, result.result.error_code) == (GoalStatus.STATUS_ABORTED, -4)
    assert f"joint '{NAMES[2]}' on the trajectory is" in result.result.error_string
    part = live.send(Q[1:] + 0.01, NAMES[1:])
    result = live.result_of(part.get_result_async(), "success of some joints")
    assert result.status == GoalStatus.STATUS_SUCCEEDED
    live.node.trigger_deactivate()
    live.node.trigger_cleanup()
    live.wait(lambda: not live.client.server_is_ready(), "the end of the action")
