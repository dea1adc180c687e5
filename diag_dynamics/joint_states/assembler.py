# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Assembler of robot states from joint states, each of which may have only some of the joints."""

import struct
from collections import Counter
from itertools import islice
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import RejectedError
from diag_dynamics.joint_states import codes, rule_memory
from diag_dynamics.joint_states.decoding import FIELDS, Decoder, Layouts
from diag_dynamics.joint_states.jumps import SAMPLES
from diag_dynamics.joint_states.robot_joints import (
    EffortMeaning,
    RobotState,
    age_limits,
    joint_limits,
)
from diag_dynamics.joint_states.rules import judge_messages
from diag_dynamics.joint_states.stamps import nanoseconds
from diag_dynamics.model.mimic import Followers, loop_title
from diag_dynamics.sweeps.followers import positions


class Accepted(NamedTuple):
    """An accepted message and the RobotState that it completes, or None."""

    state: RobotState | None


class Rejected(NamedTuple):
    """A rejected message or state: cause and text."""

    cause: str
    text: str


class Assembled(NamedTuple):
    """Results of a batch of messages, an element for each."""

    outcome: np.ndarray
    """Outcomes of the messages, with the fields of rule_memory.OUTCOME."""
    position: np.ndarray
    """States, (number of messages, nq) and (number of messages, nv).

    They count where the code is STATE.
    """
    velocity: np.ndarray
    effort: np.ndarray
    rejected: dict
    """Rejected of messages that are not malformed, by place."""


MAX_LISTS = 16  # lists of joints that are compared at a time

MAX_NAMES, MAX_NAME_LENGTH = 1000, 256
"""Names of joints in messages that are kept, and the length of each."""

NAME_BYTES = 64  # memory of a name, apart from its letters

MESSAGE = struct.Struct("=4q")  # A rule_memory.MESSAGE

IN_STEP = {-1: None, 0: False, 1: True}


class StateAssembler:
    """Complete states of a robot from joint states, each of which may have only some of its joints.

    `base` is the OdometryBase of a floating base, `map_name` returns the robot's name of a joint,
    `labels` name joints, then mimic joints, in texts. `counts` and `last_texts` are by event,
    `stuck` counts stuck sensors by text, `arrived` has names in messages. InputError names joints
    of the options that the robot lacks.
    """

    def __init__(self, joints, options, base=None, map_name=None, labels=None, limit="max_age"):
        self._joints = joints
        self._base = base
        self._map_name = map_name or str
        self._limit = limit
        self.followers = Followers(
            joints.names, joints.mimics, 0.0, joints.continuous, joints.motion
        )
        self.joint_names = joints.names
        self.names = (*joints.names, *self.followers.names)
        loops = (
            [loop_title(joints.motion.model, k) for k in range(len(joints.motion.model.loops))]
            if joints.motion
            else ()
        )
        self._labels = (*(labels or (f"joint '{name}'" for name in self.names)), *loops)
        self.counts = Counter()
        self.stuck = Counter()
        self.last_foreign = ()
        self.last_texts = {}
        self._layouts = Layouts()
        self.arrived = {}
        self._lists = set()
        self._alternating = set()
        self._memory = rule_memory.Memory.create(len(joints.names), len(self.followers.names))
        self._shared = self._memory.shared[0]
        self._own = self._memory.joints
        self._shared["in_step"] = self._shared["stuck_last"] = self._shared["base_stamp"] = -1
        self._shared["needs_base"] = base is not None
        self._own["other_stamp"] = -1
        for field in FIELDS:
            self._own[field] = self._memory.followers[field] = np.nan
        self._follow()
        self._one = rule_memory.Batch.create(1, (), self._memory)
        self._message = memoryview(self._one.messages.view(np.uint8))
        self._summary = self._one.outcome.view(np.int64)[: len(rule_memory.SUMMARY)]
        self._states = tuple(self._one.states[:, 0])
        self._decoder = Decoder()
        self.configure(options)

    def _follow(self):
        """Write how followers depend on joints: mimic joints, then those with changing ratios."""
        followers = self.followers
        count = len(self.followers.leaders)
        _write(
            self._memory.followers[:count],
            source=followers.leaders,
            multiplier=followers.multipliers,
            offset=followers.offsets,
        )
        if followers.motion:
            model = followers.motion.model
            self._ratios = followers.motion.memory()
            sizes = {"bodies": len(model.bodies), "nq": model.nq, "nv": model.nv}
            robot = followers.motion.workspace.robot
            ratios = self._ratios.ctypes.data
            _write(self._shared, robot=robot, follow=positions.address, ratios=ratios, **sizes)
            self._memory.followers["body"][count:] = [
                model.first_body(name) for name in followers.names[count:]
            ]

    # --- Options ---

    def check_options(self, options):
        """Raise InputError if options name a joint that is not there."""
        efforts = EffortMeaning(
            self.joint_names, self.followers.names, options, self._joints.effort_scale
        )
        return efforts, age_limits(self.names, options)

    def configure(self, options):
        """Use other options from now on; InputError if they name a joint that is not there."""
        efforts, ages = self.check_options(options)
        count = len(self._own)
        joints = self._own
        limits = joint_limits(self._joints, options)
        _write(joints, factor=efforts.factors[:count], span=ages[:count], **limits)
        _write(
            self._memory.followers,
            turns=self.followers.turns,
            factor=efforts.factors[count:],
            span=ages[count:],
        )
        timeout = nanoseconds(options.stuck_timeout)
        if timeout != self._shared["stuck_timeout"]:
            _write(self._shared, stuck_last=-1, stuck_kind=0)
        _write(
            self._shared,
            max_age=nanoseconds(options.max_age),
            refuse_foreign=options.refuse_foreign,
            estimate=options.estimate_velocity,
            filter_time=options.velocity_filter_time,
            slack=options.jump,
            tolerance=options.mimic_tolerance,
            stuck_timeout=timeout,
            stuck_step=max(1, -(-timeout // SAMPLES)),
        )
        if not options.estimate_velocity:
            joints["velocity"][joints["estimated"] > 0] = np.nan
            _write(joints, estimated=0, estimate_known=0)
        if not options.jump:
            _write(joints, other_stamp=-1)
        self.efforts = efforts
        self.followers.tolerance = options.mimic_tolerance
        if self._base:
            self._base.configure(options)

    # --- Status ---

    @property
    def missing(self):
        """Joints that never arrived."""
        return self._joints_where(self._own["known"] == 0)

    def unknown_names(self, ignored=()):
        """Return names in messages that no joint of the robot, or in `ignored`, has."""
        joints = {*self.names, *ignored}
        return [name for name in self.arrived if self._map_name(name) not in joints]

    @property
    def estimated(self):
        """Joints whose velocities are estimated from their positions."""
        return self._joints_where((self._own["known"] > 0) & (self._own["estimated"] > 0))

    @property
    def without_effort(self):
        """Joints that have arrived without an effort."""
        return self._joints_where((self._own["known"] > 0) & ~np.isfinite(self._own["effort"]))

    @property
    def unavailable_efforts(self):
        """Joints whose efforts are unavailable by the parameters, or in an unknown unit."""
        return self._joints_where(np.isnan(self._own["factor"]))

    def stale(self, now):
        """Return the joints that have arrived, but not within their age limit before `now` [ns]."""
        return self._joints_where(
            (self._own["known"] > 0) & (now - self._own["stamp"] > self._own["span"])
        )

    def overlapping_joints(self):
        """Return joints that seem to have several sources since the last call.

        Their messages have other lists of joints, or positions that alternate.
        """
        counts = Counter(name for joints in self._lists for name in joints)
        overlap = [name for name in self.names if counts[name] > 1 or name in self._alternating]
        self._lists.clear()
        self._alternating.clear()
        return overlap

    def _joints_where(self, mask):
        return [self.names[k] for k in np.flatnonzero(mask)]

    @property
    def newest(self):
        """The newest stamp of the joints that have arrived [ns]; 0 without any."""
        return int(self._own["stamp"][self._own["known"] > 0].max(initial=0))

    @property
    def in_step(self):
        """Whether stamps agree with this node's clock; None before that is known."""
        return IN_STEP[int(self._shared["in_step"])]

    @property
    def offset(self):
        """Clock of this node less the last accepted stamp that was compared with it [s]."""
        return int(self._shared["apart"]) * 1e-9

    @property
    def stuck_text(self):
        """Text on the joint whose sensor is stuck; empty if none is."""
        kind, joint, more = (
            int(self._shared[f"stuck_{field}"]) for field in ("kind", "joint", "more")
        )
        return codes.stuck_text(kind, joint, more, self._labels) if kind else ""

    # --- Restarts ---

    def forget(self):
        """Reset all joints and the base, as after a restart of time stamps."""
        self._judge_one(self._one, rule_memory.FORGET, 0)
        if self._base:
            self._base.forget()

    def forget_clock(self):
        """Reset the comparison of stamps with this node's clock, and late stamps."""
        _write(self._shared, in_step=-1, refused=0)
        self._own["late_count"] = 0
        if self._base:
            self._base.stamps.forget_clock()

    # --- Messages ---

    def accept(self, message, now):
        """Judge the bytes of a JointState received at `now` [ns]; return Accepted or Rejected.

        A rejected message leaves no trace but what a later restart of time, setting of a clock or
        jump depends on.
        """
        try:
            places = self._decoder.find_places(message)
        except ValueError as error:
            self._judge_one(self._one, rule_memory.UNREADABLE, now)
            return Rejected("malformed", f"joint_states: {error}")
        kind = f"{places.order}f8"
        fields = [
            np.frombuffer(message, kind, count, first)
            for first, count in zip(places.first, places.counts, strict=True)
        ]
        stamp = struct.unpack_from(f"{places.order}iI", message, 4)
        return self.accept_values(places.names, *stamp, fields, now)

    def accept_values(self, names, sec, nanosec, fields, now):
        """Judge a joint state by its names, stamp, and positions, velocities and efforts."""
        layout = self._layout(names, *map(len, fields))
        layout.batch.numbers[0] = np.concatenate(fields)
        code, events, stuck, newest, oldest, with_effort, received, estimated = self._judge_one(
            layout.batch, 0, now, sec, nanosec
        )
        if len(self._lists) < MAX_LISTS:
            self._lists.add(layout.joints)
        if code == codes.INTERLEAVED:
            self._alternating.add(self.names[self._one.outcome[0]["joint"]])
        if code or events or stuck:
            self._count(self._one.outcome, np.zeros(1, int), [layout.names])
        if code > 0:
            return self._rejection(layout, self._one.outcome[0])
        if code:
            return Accepted(None)
        states = self._states
        if self._base:
            states = _add_base(self._base.position, self._base.velocity, states)
        position, velocity, effort = map(np.copy, states)
        partial = None
        if not with_effort:
            effort, partial = None, effort if np.isfinite(effort).any() else None
        flags = received > 0, estimated > 0
        return Accepted(RobotState(position, velocity, effort, newest, oldest, *flags, partial))

    def accept_odometry(self, message, now):
        """Judge a nav_msgs.msg.Odometry; it completes a state of a robot without joints."""
        try:
            self._base.update(message, now)
        except RejectedError as error:
            return Rejected(error.cause, str(error))
        if self.joint_names:
            return Accepted(None)
        base = self._base
        position, velocity, _ = _add_base(base.position, base.velocity, np.zeros((3, 0)))
        stamps = base.stamp, base.stamp
        return Accepted(RobotState(position, velocity, None, *stamps, base.unstamped))

    def _judge_one(self, batch, layout, now, sec=0, nanosec=0):
        """Judge the message of a batch of one; return the SUMMARY of its outcome."""
        MESSAGE.pack_into(self._message, 0, sec, nanosec, now, layout)
        self._judge_batch(batch)
        return self._summary.tolist()

    def _judge_batch(self, batch):
        """Judge messages with the base of the newest odometry.

        Reset the base where time restarted without it.
        """
        base = self._base
        if base:
            stamp = -1 if base.stamp is None else base.stamp
            _write(self._shared, base_stamp=stamp, base_unstamped=base.unstamped)
        batch.outcome.fill(0)
        judge_messages(*self._memory, *batch)
        if base and base.stamp is not None and self._shared["base_stamp"] < 0:
            base.forget()

    # --- Many messages ---

    def assemble(self, parts, now):
        """Judge JointStates in `parts`, received at `now` [ns] (k,).

        A message in no part is malformed.
        """
        layouts = [
            self._layout(part.names, *(getattr(part, field).shape[1] for field in FIELDS))
            for part in parts
        ]
        widths = [sum(layout.lengths) for layout in layouts]
        rows = [layout.row for layout in layouts]
        batch = rule_memory.Batch.create(len(now), rows, self._memory, max(widths, default=0))
        messages = batch.messages
        messages["now"] = now
        messages["layout"] = rule_memory.UNREADABLE
        for k, (part, width) in enumerate(zip(parts, widths, strict=True)):
            messages["sec"][part.rows] = part.sec
            messages["nanosec"][part.rows] = part.nanosec
            messages["layout"][part.rows] = k
            batch.numbers[part.rows, :width] = np.hstack(
                [part.position, part.velocity, part.effort]
            )
        base = self._base and (self._base.position, self._base.velocity)
        self._judge_batch(batch)
        self._count(batch.outcome, messages["layout"], [part.names for part in parts])
        states = batch.states if base is None else _add_base(*base, batch.states)
        rejected = {
            k: self._rejection(layouts[messages["layout"][k]], batch.outcome[k])
            for k in np.flatnonzero(batch.outcome["code"] > codes.MALFORMED).tolist()
        }
        return Assembled(batch.outcome, *states, rejected)

    def _layout(self, names, *lengths):
        """Return the layout of messages with one list of names, and lengths of the fields."""
        layout = self._layouts.get((names, lengths))
        if layout is None:
            layout = self._make_layout(names, lengths)
            size = sum(NAME_BYTES + len(name) for name in names)
            self._layouts.keep((names, lengths), layout, size)
        return layout

    def _make_layout(self, names, lengths):
        short = (name for name in names if len(name) <= MAX_NAME_LENGTH)
        self.arrived |= dict.fromkeys(islice(short, MAX_NAMES - len(self.arrived)))
        joints = [self._map_name(name) for name in names]
        index = {name: k for k, name in enumerate(self.names)}
        listed = tuple(dict.fromkeys(joint for joint in joints if joint in index))
        code, text = _check_layout(names, joints, lengths)
        places = {index[joint]: joints.index(joint) for joint in listed}
        if code == codes.DUPLICATE_NAME:
            places = {}
        begins = np.cumsum([0, *lengths[:2]])
        begins[[code > 0 or not length for length in lengths]] = rule_memory.UNUSED
        row = rule_memory.layout_row(self._memory, code, places, begins)
        batch = self._one._replace(layouts=row[None], numbers=np.zeros((1, sum(lengths))))
        return _Layout(names, listed, text, lengths, row, batch)

    def _count(self, outcome, layout, names):
        """Count outcomes and events of messages."""
        for code, name in codes.COUNTS.items():
            self.counts[name] += int((outcome["code"] == code).sum())
        foreign = [names[layout[k]] for k in np.flatnonzero(outcome["code"] == codes.FOREIGN)]
        empty = foreign.count(())
        self.counts["empty"] += empty
        self.counts["foreign"] -= empty
        self.last_foreign = next(filter(None, reversed(foreign)), self.last_foreign)
        for event, name in codes.EVENTS.items():
            rows = np.flatnonzero(outcome["events"] & event)
            self.counts[name] += len(rows)
            if len(rows):
                self.last_texts[name] = self._event_text(event, outcome[rows[-1]])
        stuck = outcome[["stuck_kind", "stuck_joint", "stuck_more"]][outcome["stuck_kind"] > 0]
        for kind, number in Counter(stuck.tolist()).items():
            self.stuck[codes.stuck_text(*kind, self._labels)] += number

    def _event_text(self, event, outcome):
        if event == codes.MOVED:
            name = self._labels[outcome["moved"] - 1]
            first, second = outcome[["moved_from", "moved_to"]]
            return codes.STEP.format(name=name, first=first, second=second)
        if event == codes.DISAGREES:
            positions, expected = (self._memory.followers[field] for field in ("own", "expected"))
            astray = np.flatnonzero(~np.isnan(positions))
            return "; ".join(
                self.followers.disagreement(k, positions[k], expected[k]) for k in astray
            )
        return ""

    def _rejection(self, layout, outcome):
        """Return the Rejected of a message that was rejected."""
        code = int(outcome["code"])
        text = layout.text
        if code not in codes.LAYOUT_ERRORS:
            text = codes.rejection_text(outcome, self._labels, self._limit)
        return Rejected(codes.CAUSES[code], text)


class _Layout(NamedTuple):
    """Messages with one list of names, and lengths of the fields."""

    names: tuple
    joints: tuple  # of the robot, in the order of the names
    text: str  # error of such messages, if the layout itself has one
    lengths: tuple
    row: np.ndarray  # of rule_memory.Batch.layouts
    batch: rule_memory.Batch  # of one such message


def _write(array, **fields):
    for name, values in fields.items():
        array[name] = values


def _check_layout(names, joints, lengths):
    """Return the code and the text of an error of names and lengths.

    Without an error they are 0 and an empty text.
    """
    for name, count in Counter(joints).items():
        if count > 1:
            return codes.DUPLICATE_NAME, f"joint '{name}' is listed twice in one message"
    for field, length in zip(FIELDS, lengths, strict=True):
        if names and length not in (0, len(names)):
            first = names[min(length, len(names) - 1)]  # without a value, or the last with a name
            text = f"{field} has {length} entries for {len(names)} names (first at '{first}')"
            return codes.WRONG_LENGTH, text
    return 0, ""


def _add_base(position, velocity, states):
    """Return positions, velocities and efforts of joints behind those of a base.

    These are NaN where they are unknown, None, and without the effort of a joint.
    """
    rows = states[0].shape[:-1]
    effort = np.where(np.isfinite(states[2]).any(axis=-1, keepdims=True), np.zeros(6), np.nan)
    position = np.full(7, np.nan) if position is None else position
    velocity = np.full(6, np.nan) if velocity is None else velocity
    return (
        np.concatenate([np.broadcast_to(position, (*rows, 7)), states[0]], axis=-1),
        np.concatenate([np.broadcast_to(velocity, (*rows, 6)), states[1]], axis=-1),
        np.concatenate([effort, states[2]], axis=-1),
    )
