# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of a floating base from nav_msgs/Odometry."""

import numpy as np

from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.assembly.stamps import SECOND, Stamps, nanoseconds, stamp_of
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.base import base_state


class OdometryBase:
    """Keeps the newest state of the base.

    Parameters
    ----------
    model : RobotModel
        With a floating base.
    twist_in_header : bool
        Whether the twist of messages is in the axes of ``header.frame_id`` rather than of ``child_frame_id``.

    Attributes
    ----------
    stamps : Stamps
    jumps : int
        How often its time has started anew.
    unstamped : bool
        Whether a time of reception stands for its stamp.
    """

    def __init__(self, model, twist_in_header):
        self._model = model
        self.twist_in_header = twist_in_header
        self.stamps = Stamps()
        self.jumps = 0
        self._farthest = self._fastest = np.inf
        self.forget()

    def configure(self, options):
        """Judge odometry by these :class:`Options` from now on."""
        self.stamps.max_age, self.stamps.refuse_foreign = options.max_age, options.refuse_foreign
        self._farthest, self._fastest = options.max_position or np.inf, options.max_velocity or np.inf

    def forget(self):
        """Start anew, as after a jump of time."""
        self.stamp = None
        self.position = self.velocity = None
        self.unstamped = False

    def update(self, message, now):
        """Take a nav_msgs/Odometry in; `now` [ns] stands for a stamp of zero.

        Raises
        ------
        RejectedError
            The child frame is not the root link nor attached to it, a number is no good or absurd, or the message is out of
            time.
        """
        link = message.child_frame_id.lstrip("/")
        if not link:
            raise RejectedError(
                "malformed", f"odom: child_frame_id is empty, expected '{self._model.root_link}' or a link on it"
            )
        pose, twist = message.pose.pose, message.twist.twist
        p, o, v, w = pose.position, pose.orientation, twist.linear, twist.angular
        stamp, unstamped = stamp_of(message, now)
        try:
            position, velocity = base_state(
                self._model,
                link,
                (p.x, p.y, p.z),
                (o.x, o.y, o.z, o.w),
                (v.x, v.y, v.z, w.x, w.y, w.z),
                self.twist_in_header,
            )
        except InputError as error:
            raise RejectedError("malformed", f"odom: {error}") from error
        for what, values, most in (
            ("position", position[:3], self._farthest),
            ("twist", velocity, self._fastest),
        ):
            if np.abs(values).max() > most:
                raise RejectedError(
                    "absurd value", f"odom: {what} is {values.tolist()}, expected within ±{most:g} (absurd.*)"
                )
        # A stamp may be of another clock than a time of reception: comparing the two would refuse good odometry.
        last = self.stamp if unstamped == self.unstamped else None
        accepted = self.stamps.judge("odom", "odom", stamp, 0 if unstamped else now, last, SECOND)
        self.stamps.accept(accepted)
        self.jumps += accepted.anew
        self.position, self.velocity, self.stamp, self.unstamped = position, velocity, stamp, unstamped

    def with_joints(self, state, timeout):
        """The state of the whole robot from that of its joints, or None before the base is known.

        Raises
        ------
        RejectedError
            The base's state is more than `timeout` [s] older or newer than the joints'; 0 for no limit.
        """
        if self.stamp is None:
            return None
        apart = abs(state.newest - self.stamp)
        if timeout and apart > nanoseconds(timeout):
            raise RejectedError(
                "stale odometry", f"odom is {apart * 1e-9:.3f} s away from the joints, more than {timeout:g} s"
            )
        effort = None if state.effort is None else np.concatenate([np.zeros(6), state.effort])
        return state._replace(
            position=np.concatenate([self.position, state.position]),
            velocity=np.concatenate([self.velocity, state.velocity]),
            effort=effort,
            newest=max(state.newest, self.stamp),
            oldest=min(state.oldest, self.stamp),
            stamp_is_receive_time=state.stamp_is_receive_time or self.unstamped,
        )
