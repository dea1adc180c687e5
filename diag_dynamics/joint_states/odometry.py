# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of a floating base from nav_msgs/Odometry."""

import numpy as np

from diag_dynamics.exceptions import InputError, RejectedError
from diag_dynamics.joint_states.assembler import Rejected, StateAssembler
from diag_dynamics.joint_states.joints import Joints, Options
from diag_dynamics.model.base import base_state


class OdometryBase:
    """Keeps the newest state of the base. Its stamps have the rules of those of a joint.

    Parameters
    ----------
    model : RobotModel
        With a floating base.
    twist_in_header : bool
        Whether the twist of messages is in the axes of ``header.frame_id`` rather than of ``child_frame_id``.

    Attributes
    ----------
    position, velocity : ndarray or None
        None before the first message.
    stamp : int or None
        [ns]
    unstamped : bool
        Whether a time of reception stands for the stamp.
    stamps : StateAssembler
    """

    def __init__(self, model, twist_in_header):
        self._model = model
        self.twist_in_header = twist_in_header
        self.stamps = StateAssembler(Joints(("odom",)), Options(timeout=0.0), labels=("odom",))
        self.configure(Options())
        self.forget()

    def configure(self, options):
        """Use these :class:`Options` from now on."""
        own = Options(timeout=0.0, max_age=options.max_age, refuse_foreign=options.refuse_foreign)
        self.stamps.configure(own)
        self._bounds = options.max_position or np.inf, options.max_velocity or np.inf

    @property
    def jumps(self):
        """How often its time has restarted."""
        return self.stamps.counts["time jumped back"]

    def forget(self):
        """Forget the base, as after a restart of time."""
        self.stamp = self.position = self.velocity = None
        self.unstamped = False
        self.stamps.forget()

    def update(self, message, now):
        """Store what a nav_msgs/Odometry says; `now` [ns] stands for a stamp of zero.

        Raises
        ------
        RejectedError
            The child frame is not the root link nor attached to it, a number is not finite or absurd, or the message is out
            of time.
        """
        link = message.child_frame_id.lstrip("/")
        if not link:
            raise RejectedError(
                "malformed", f"odom: child_frame_id is empty, expected '{self._model.root_link}' or a link on it"
            )
        pose, twist = message.pose.pose, message.twist.twist
        p, o, v, w = pose.position, pose.orientation, twist.linear, twist.angular
        place, turn, motion = (p.x, p.y, p.z), (o.x, o.y, o.z, o.w), (v.x, v.y, v.z, w.x, w.y, w.z)
        try:
            position, velocity = base_state(self._model, link, place, turn, motion, self.twist_in_header)
        except InputError as error:
            raise RejectedError("malformed", f"odom: {error}") from error
        for what, values, most in zip(("position", "twist"), (position[:3], velocity), self._bounds, strict=True):
            if np.abs(values).max() > most:
                raise RejectedError(
                    "absurd value", f"odom: {what} is {values.tolist()}, expected within ±{most:g} (absurd.*)"
                )
        stamp = message.header.stamp
        found = self.stamps.accept_values(("odom",), stamp.sec, stamp.nanosec, [np.zeros(1)] * 3, now)
        if isinstance(found, Rejected):
            raise RejectedError(*found)
        state = found.state
        self.position, self.velocity, self.stamp = position, velocity, state.newest
        self.unstamped = state.stamp_is_receive_time
