"""The state of a floating base from nav_msgs/Odometry."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.model.base import base_state
from diag_dynamics.nodes.joint_states import RejectedError


class OdometryBase:
    """Keeps the newest state of the base.

    Parameters
    ----------
    model : RobotModel
        With a floating base.
    twist_in_header : bool
        Whether the twist of messages is in the axes of ``header.frame_id`` rather than of ``child_frame_id``.
    """

    def __init__(self, model, twist_in_header):
        self._model = model
        self.twist_in_header = twist_in_header
        self.stamp = -1
        self.position = self.velocity = None
        self._unstamped = False

    def update(self, message, now):
        """Take a nav_msgs/Odometry in; `now` [ns] stands for a stamp of zero.

        Raises
        ------
        RejectedError
            The child frame is not the root link nor attached to it, or a number is no good, or the message is late.
        """
        link = message.child_frame_id.lstrip("/")
        if not link:
            raise RejectedError(
                "odometry", f"odom: child_frame_id is empty, expected '{self._model.root_link}' or a link on it"
            )
        pose, twist = message.pose.pose, message.twist.twist
        p, o, v, w = pose.position, pose.orientation, twist.linear, twist.angular
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        unstamped, stamp = stamp == 0, stamp or now
        if -1_000_000_000 < stamp - self.stamp < 0:
            raise RejectedError(
                "late odometry", f"odom: stamp {(self.stamp - stamp) * 1e-9:.6f} s older than the one before"
            )
        try:
            self.position, self.velocity = base_state(
                self._model,
                link,
                (p.x, p.y, p.z),
                (o.x, o.y, o.z, o.w),
                (v.x, v.y, v.z, w.x, w.y, w.z),
                self.twist_in_header,
            )
        except InputError as error:
            raise RejectedError("odometry", f"odom: {error}") from error
        self.stamp, self._unstamped = stamp, unstamped

    def with_joints(self, state, timeout):
        """The state of the whole robot from that of its joints, or None before the base is known.

        Raises
        ------
        RejectedError
            The base's state is more than `timeout` [s] older or newer than the joints'; 0 for no limit.
        """
        if self.stamp < 0:
            return None
        apart = abs(state.newest - self.stamp) * 1e-9
        ahead = self.stamp - state.newest > 1_000_000_000  # of joints whose time has started anew
        if (timeout and apart > timeout) or ahead:
            raise RejectedError("stale odometry", f"odom is {apart:.3f} s away from the joints, more than {timeout} s")
        effort = None if state.effort is None else np.concatenate([np.zeros(6), state.effort])
        return state._replace(
            position=np.concatenate([self.position, state.position]),
            velocity=np.concatenate([self.velocity, state.velocity]),
            effort=effort,
            newest=max(state.newest, self.stamp),
            oldest=min(state.oldest, self.stamp),
            stamp_is_receive_time=state.stamp_is_receive_time or self._unstamped,
        )
