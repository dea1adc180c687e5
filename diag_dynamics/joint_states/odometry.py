# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of a floating base from nav_msgs/Odometry."""

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.checks import numbers
from diag_dynamics.exceptions import InputError, RejectedError
from diag_dynamics.joint_states.assembler import Rejected, StateAssembler
from diag_dynamics.joint_states.jumps import MAX_POSITION, MAX_VELOCITY
from diag_dynamics.joint_states.robot_joints import Joints, Options


class OdometryBase:
    """Store the newest state of a floating base.

    `position`, `velocity` and `stamp` [ns] are None before it. Stamps follow the rules of those of
    a joint. `twist_in_header`: twists are in the axes of header.frame_id.
    """

    def __init__(self, model, twist_in_header):
        self._model = model
        self.twist_in_header = twist_in_header
        self.stamps = StateAssembler(Joints(("odom",)), Options(timeouts={}), labels=("odom",))
        self.configure(Options())
        self.forget()

    def configure(self, options):
        """Use these :class:`Options` from now on."""
        stamp_options = Options(
            timeouts={}, max_age=options.max_age, refuse_foreign=options.refuse_foreign
        )
        self.stamps.configure(stamp_options)

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
        """Store a nav_msgs/Odometry received at `now` [ns].

        Raise RejectedError for an invalid one.
        """
        link = message.child_frame_id.lstrip("/")
        if not link:
            raise RejectedError(
                "malformed",
                "odom: child_frame_id is empty; "
                f"expected '{self._model.root_link}' or a link on it",
            )
        pose = message.pose.pose
        twist = message.twist.twist
        p = pose.position
        o = pose.orientation
        v = twist.linear
        w = twist.angular
        place = p.x, p.y, p.z
        turn = o.x, o.y, o.z, o.w
        motion = v.x, v.y, v.z, w.x, w.y, w.z
        try:
            position, velocity = base_state(
                self._model, link, place, turn, motion, self.twist_in_header
            )
        except InputError as error:
            raise RejectedError("malformed", f"odom: {error}") from error
        for quantity, values, bound in (
            ("position", position[:3], MAX_POSITION),
            ("twist", velocity, MAX_VELOCITY),
        ):
            if np.abs(values).max() > bound:
                raise RejectedError(
                    "implausible value",
                    f"odom: {quantity} is {values.tolist()}; expected within ±{bound:g}",
                )
        stamp = message.header.stamp
        result = self.stamps.accept_values(
            ("odom",), stamp.sec, stamp.nanosec, [np.zeros(1)] * 3, now
        )
        if isinstance(result, Rejected):
            raise RejectedError(*result)
        state = result.state
        self.position = position
        self.velocity = velocity
        self.stamp = state.newest
        self.unstamped = state.stamp_is_receive_time


def base_state(model, link, position, quaternion, twist, twist_in_world=False):
    """Return x y z qx qy qz qw and the body twist of the root link, linear first.

    `position` [m] and `quaternion` (x y z w) are the pose of a link attached to the root, `twist`
    [m/s, rad/s] that of its origin, in its own axes or in those of the world.
    """
    values = {"position": (position, 3), "orientation": (quaternion, 4), "twist": (twist, 6)}
    for name, (value, length) in values.items():
        numbers(f"{name} of '{link}'", value, (length,), f"{length} finite numbers")
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1.0) > 1e-2:
        raise InputError(
            f"orientation of '{link}' is the quaternion {list(quaternion)} "
            f"of length {length:.3g}; expected 1."
        )
    attached = model.placement_in_root(link)
    R = rotations.from_quaternion(*map(float, quaternion))
    linear = np.asarray(twist[:3], float)
    angular = np.asarray(twist[3:], float)
    if twist_in_world:
        linear = R.T @ linear
        angular = R.T @ angular
    turn = attached[:3, :3]
    offset = attached[:3, 3]
    angular = turn @ angular
    linear = turn @ linear - np.cross(angular, offset)
    root = R @ turn.T
    x, y, z = np.asarray(position, float) - root @ offset
    return np.array([x, y, z, *rotations.to_quaternion(root)]), np.concatenate([linear, angular])
