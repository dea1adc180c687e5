# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of recorded messages, made as by the monitor, and counts of other messages.

States are in columns.
"""

from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, cause_of
from diag_dynamics.joint_states import codes
from diag_dynamics.joint_states.assembler import Rejected, StateAssembler
from diag_dynamics.joint_states.odometry import OdometryBase
from diag_dynamics.joint_states.robot_joints import LinkPositions, joints_of
from diag_dynamics.recordings.joint_names import SAME_NAMES
from diag_dynamics.recordings.states import States
from diag_dynamics.wire.definitions import read_message

JOINT_STATE, ODOMETRY = "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry"

MAX_TEXTS = 20  # rejections whose text is kept, of each cause


class Batch(NamedTuple):
    """Messages in the order of their log time.

    One that is in no part is in `odometry` or `errors`.
    """

    log_time: np.ndarray  # [ns], int64, shape (n,)
    parts: list  # of JointStates
    odometry: dict  # bytes of nav_msgs/Odometry by place
    errors: dict  # what is wrong with bytes that are no joint state, by place

    def names(self):
        """Return the names of joints in messages, a set."""
        return {name for part in self.parts for name in part.names}

    def select(self, is_selected):
        """Return the messages of a mask."""
        if is_selected.all():
            return self
        place = np.cumsum(is_selected) - 1
        parts = [part.select(is_selected[part.rows]) for part in self.parts]
        parts = [part._replace(rows=place[part.rows]) for part in parts if len(part.rows)]
        odometry = {int(place[k]): raw for k, raw in self.odometry.items() if is_selected[k]}
        errors = {int(place[k]): text for k, text in self.errors.items() if is_selected[k]}
        return Batch(self.log_time[is_selected], parts, odometry, errors)


class Rejection(NamedTuple):
    """One message that made no state."""

    log_time: int
    cause: str
    text: str


class Intake:
    """Make states of messages with the rules of the monitor, batch by batch.

    `rejections` are the first of each cause. States and counts are those of the monitor, bit for
    bit.
    """

    def __init__(self, model, settings, names=SAME_NAMES):
        values = settings.values
        self.names = names
        self._model = model
        self._dynamics = DiagonalDynamics(model)
        self._mapped = {}
        self._joints = {*model.joint_names, *model.mimics, *model.followers, *model.locked_joints}
        self._base = None
        if model.floating_base:
            self._base = OdometryBase(model, values["odom_twist_frame"] == "header")
        joints = joints_of(model)
        self.assembler = StateAssembler(joints, settings.inputs, self._base, self._map_name)
        self._counts = Counter()
        self.rejections = []
        self._links = LinkPositions(model)
        self._moved = False  # whether positions jumped since the last state
        self._nothing = States.empty(model.nq, model.nv)

    @property
    def counts(self):
        """How many messages there were and what became of them, by the monitor's names."""
        jumps = self._base.jumps if self._base else 0
        return self._counts + self.assembler.counts + Counter({"time jumped back": jumps})

    def _map_name(self, name):
        """Return the robot's name of a joint; reject a second name of one of its joints."""
        joint = self.names.map_name(name)
        if joint in self._joints and (other := self._mapped.setdefault(joint, name)) != name:
            raise InputError(
                f"joint_names maps both '{other}' and '{name}' to joint '{joint}'; expected one "
                "name of the recording for each joint."
            )
        return joint

    def reject(self, now, error):
        """Count a state that was handed out and cannot be evaluated."""
        self._counts["published"] -= 1
        self._reject(now, f"rejected: {cause_of(error)}", str(error))

    def read(self, batch):
        """Return the States that a batch of messages makes."""
        parts = [self._nothing]
        begin = 0
        place = np.arange(len(batch.log_time))
        for k in [*sorted(batch.odometry), len(place)]:
            if k > begin:
                parts.append(self._read_joints(batch.select((place >= begin) & (place < k))))
            if k < len(place):
                parts.append(self._read_odometry(batch.odometry[k], int(batch.log_time[k])))
            begin = k + 1
        return self._of_links(self._with_gravity(States.concatenate(parts)))

    def _read_joints(self, batch):
        """Return the States of a batch without odometry."""
        now = batch.log_time
        self._counts["received"] += len(now)
        assembled = self.assembler.assemble(batch.parts, now)
        code = assembled.outcome["code"]
        malformed = np.flatnonzero(code == codes.MALFORMED).tolist()
        rejected = assembled.rejected | {k: ("malformed", batch.errors[k]) for k in malformed}
        for k, (cause, text) in sorted(rejected.items()):
            self._reject(int(now[k]), f"rejected: {cause}", text)
        is_state = code == codes.STATE
        self._counts["published"] += int(is_state.sum())
        moved = self._moved_at(assembled.outcome["events"] & codes.MOVED > 0, is_state)
        outcome = assembled.outcome[is_state]
        stamps = (np.ascontiguousarray(outcome[field]) for field in ("newest", "oldest"))
        values = (column[is_state] for column in assembled[1:4])
        flags = (outcome[field] > 0 for field in ("with_effort", "received", "estimated"))
        return States(*stamps, now[is_state], *values, *flags, moved)

    def _moved_at(self, moved, is_state):
        """Return for each state whether positions jumped since the state before."""
        total = np.cumsum(moved) + int(self._moved)
        at = total[is_state]
        self._moved = bool(len(total) and total[-1] > (at[-1] if len(at) else 0))
        return np.diff(at, prepend=0) > 0

    def _read_odometry(self, raw, now):
        """Store the base of an odometry message.

        Return the state that it makes of a robot that is all base.
        """
        self._counts["odometry received"] += 1
        try:
            message = read_message(raw, ODOMETRY)
        except Exception as error:  # nothing that was recorded may end the reading of the rest
            text = f"odom: {len(raw)} bytes that are no nav_msgs/msg/Odometry ({error})"
            result = Rejected("malformed", text)
        else:
            result = self.assembler.accept_odometry(message, now)
        if isinstance(result, Rejected):
            self._reject(now, f"odometry rejected: {result.cause}", result.text)
            return self._nothing
        if result.state is None:
            return self._nothing
        self._counts["published from odometry"] += 1
        state = result.state
        times = np.array([[state.newest], [state.newest], [now]])
        effort = np.full(self._model.nv, np.nan)
        values = (row[None, :] for row in (state.position, state.velocity, effort))
        flags = np.array([[False], [state.stamp_is_receive_time], [False], [False]])
        return States(*times, *values, *flags)

    def _with_gravity(self, states):
        """Return states with efforts of joints that contain gravity.

        Parameters may say that reported efforts do not.
        """
        without = self.assembler.efforts.without_gravity
        if without is None or not np.isfinite(states.effort).any():
            return states
        gravity = self._dynamics.gravity_torque(states.position)
        joints = gravity.shape[1] - len(without)
        gravity[:, :joints] = 0.0  # of a base, on which no effort acts
        gravity[:, joints:] *= without
        return replace(states, effort=states.effort + gravity)

    def _of_links(self, states):
        """Return states with positions and rates of links, in place of those of motors.

        Joint states of flexible joints may have those of motors.
        """
        if not self._links.has_any:
            return states
        columns = states.stamp, states.position, states.velocity, states.effort, states.jumped
        position, velocity = self._links.convert(*columns)
        return replace(states, position=position, velocity=velocity)

    def _reject(self, now, cause, text):
        self._counts[cause] += 1
        if self._counts[cause] <= MAX_TEXTS:
            self.rejections.append(Rejection(now, cause, text))
