# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Assembler of states from joint states in columns: arrays of the rules, and counts and texts of what they return."""

from collections import Counter
from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.bounds import Bounds
from diag_dynamics.assembly.efforts import Efforts
from diag_dynamics.assembly.followers import Followers
from diag_dynamics.assembly.frozen import SAMPLES
from diag_dynamics.assembly.gaps import WINDOW
from diag_dynamics.assembly.jumps import MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT
from diag_dynamics.assembly.stamps import nanoseconds
from diag_dynamics.entries import by_name
from diag_dynamics.joint_states import codes, memory
from diag_dynamics.joint_states.rules import judge_messages
from diag_dynamics.joint_states.steps import ROWS


class JointStates(NamedTuple):
    """Joint states with one list of names, in columns."""

    rows: np.ndarray
    """Place of each message among all of a batch: int64, shape (k,)."""
    names: tuple
    """Of joints, length n."""
    sec: np.ndarray
    """Seconds and nanoseconds of header.stamp: int64, shape (k,)."""
    nanosec: np.ndarray
    position: np.ndarray
    """[rad, m], shape (k, n), or (k, any other number), which rejects the messages but for 0."""
    velocity: np.ndarray
    """[rad/s, m/s], likewise."""
    effort: np.ndarray
    """As sent, likewise."""

    def select(self, which):
        """Return the messages of a mask."""
        names, columns = self.names, (column[which] for column in self[2:])
        return JointStates(self.rows[which], names, *columns)


FIELDS = "position", "velocity", "effort"


class Assembled(NamedTuple):
    """What comes of a batch of messages, an element for each."""

    outcome: np.ndarray
    """Of memory.OUTCOME."""
    position: np.ndarray
    """States of the joints, (number of messages, number of joints); they count where the code is STATE."""
    velocity: np.ndarray
    effort: np.ndarray
    rejected: dict
    """Cause and text of rejected messages, by place."""


MAX_LAYOUTS = 256
"""Lists of names that are kept."""

MAX_NAMES = 1000
"""Names of joints in messages that are kept."""


class StateAssembler:
    """Keeps the newest values of every joint, and completes states from joint states that may bring only some of them.

    Parameters
    ----------
    joints : Joints
    options : Options
    frozen_timeout : float
        Of stuck sensors [s]; 0: not judged.
    refuse_frozen : bool
        Whether states with stuck sensors are rejected.
    map_name : callable, optional
        Returns the robot's name of a joint by its name in messages.

    Attributes
    ----------
    names : tuple of str
        Joints, then followers.
    counts : Counter
        Messages that complete no state and are not rejected, by cause, and events, by name.
    frozen : Counter
        States with stuck sensors that were compared, by text.
    arrived : dict
        Names of joints in messages as keys, in their order, at most :data:`MAX_NAMES`.
    last_foreign : tuple of str
        Names in the last message without a joint of this robot.
    without_gravity : ndarray or None
        1 for each joint whose effort has gravity taken out, 0 for the others.

    Raises
    ------
    InputError
        The options name a joint that is not there.
    """

    def __init__(self, joints, options, frozen_timeout=0.0, refuse_frozen=False, map_name=None):
        self._map_name = map_name or str
        self._followers = Followers(joints.names, joints.mimics, options.mimic_tolerance, joints.continuous)
        self._sources = [source for source, _, _ in joints.mimics.values()]
        self.names = (*joints.names, *self._followers.names)
        self.counts, self.frozen, self.last_foreign, self._last = Counter(), Counter(), (), {}
        self._layouts, self.arrived = {}, {}
        count, beside = len(joints.names), len(self._followers.names)
        self._memory = memory.Memory(
            np.zeros(1, memory.SHARED),
            np.zeros(count, memory.JOINT),
            np.zeros(beside, memory.FOLLOWER),
            np.zeros((count, count)),
            np.zeros((count, WINDOW)),
            np.zeros((ROWS, max(count, WINDOW))),
        )
        shared, own = self._memory.shared, self._memory.joints
        for field in ("in_step", "frozen_last", "base_stamp"):
            shared[field] = -1
        shared["frozen_timeout"], shared["frozen_refused"] = round(frozen_timeout * 1e9), refuse_frozen
        shared["frozen_step"] = np.maximum(1, -(-shared["frozen_timeout"] // SAMPLES))
        own["gap_last"] = -1
        own["position"] = own["velocity"] = own["effort"] = self._memory.followers["effort"] = np.nan
        self._configure(joints, options)

    def _configure(self, joints, options):
        """Write rules into the arrays."""
        own, followers = joints.names, self._followers
        efforts = Efforts(own, followers.names, options, joints.effort)
        turns = [name in joints.continuous for name in own]
        lower = np.full(len(own), -np.inf) if joints.lower is None else joints.lower
        upper = np.full(len(own), np.inf) if joints.upper is None else joints.upper
        bounds = Bounds(own, lower, upper, turns, options, joints.velocity)
        ages = by_name("joint_timeouts", options.timeouts, self.names)
        spans = np.array([nanoseconds(ages.get(name, options.timeout)) or np.inf for name in self.names])
        reach = (
            np.zeros(len(own))
            if joints.velocity is None
            else np.where(np.isfinite(joints.velocity), joints.velocity, 0)
        )
        _write(
            self._memory.joints,
            lower=bounds.lower,
            upper=bounds.upper,
            fastest=bounds.fastest,
            factor=efforts.factors,
            strongest=efforts.strongest,
            reach=reach,
            turns=turns,
            span=spans[: len(own)],
            lasting=np.where(reach > 0.0, MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT),
        )
        _write(
            self._memory.followers,
            source=followers.leaders,
            multiplier=followers.multipliers,
            offset=followers.offsets,
            turns=followers.turns,
            factor=efforts.follower_factors,
            span=spans[len(own) :],
        )
        _write(
            self._memory.shared,
            max_age=nanoseconds(options.max_age),
            refuse_foreign=options.refuse_foreign,
            estimate=options.estimate_velocity,
            filter_time=options.velocity_filter_time,
            max_velocity=options.max_velocity,
            slack=options.jump,
            tolerance=options.mimic_tolerance,
            max_effort=efforts.most,
        )
        self.without_gravity = efforts.without_gravity

    @property
    def lost(self):
        """Number of states that never came, by gaps in stamps."""
        return int(self._memory.shared["lost"][0])

    @property
    def joint_names(self):
        """The joints, without followers."""
        return self.names[: len(self._memory.joints)]

    @property
    def missing(self):
        """Joints that never arrived."""
        return [self.names[k] for k in np.flatnonzero(self._memory.joints["known"] == 0)]

    @property
    def without_effort(self):
        """Joints without a last effort, although others have one, and efforts of these are available."""
        own = self._memory.joints
        unknown = np.isnan(own["effort"])
        lacks = unknown & np.isfinite(own["factor"])
        return [] if unknown.all() else [self.names[k] for k in np.flatnonzero(lacks)]

    @property
    def last_texts(self):
        """Text on the last time of each event, by its name."""
        return {codes.EVENTS[event]: text for event, text in self._last.items()}

    def use_base(self, stamp, unstamped, timeout):
        """Complete states by a base of this stamp [ns], −1 for none, within a timeout [s], 0 for any."""
        _write(
            self._memory.shared,
            needs_base=1,
            base_stamp=stamp,
            base_unstamped=unstamped,
            base_timeout=nanoseconds(timeout),
        )

    @property
    def base_stamp(self):
        """Stamp of the base [ns]; −1 where time restarted without it."""
        return int(self._memory.shared["base_stamp"][0])

    def assemble(self, parts, now):
        """Judge messages one after the other.

        Parameters
        ----------
        parts : sequence of JointStates
            A message that is in none of them is malformed.
        now : ndarray of int64, shape (k,)
            Time of reception of each [ns], which stands for a stamp of zero.

        Returns
        -------
        Assembled
        """
        own, beside = len(self._memory.joints), len(self._memory.followers)
        if len(self._layouts) > MAX_LAYOUTS:
            self._layouts.clear()
        messages, outcome = np.zeros(len(now), memory.MESSAGE), np.zeros(len(now), memory.OUTCOME)
        messages["now"], messages["layout"] = now, -1
        values = [np.full((len(now), own), np.nan) for _ in FIELDS]
        others = [np.full((len(now), beside), np.nan) for _ in FIELDS]
        layouts = [self._layout(part) for part in parts]
        for k, (part, layout) in enumerate(zip(parts, layouts, strict=True)):
            messages["sec"][part.rows], messages["nanosec"][part.rows] = part.sec, part.nanosec
            messages["layout"][part.rows] = k
            if not layout.error:
                _place(part, layout.joints, values)
                _place(part, layout.followers, others)
        states = [np.empty((len(now), own)) for _ in FIELDS]
        tables = _tables(layouts, own, beside)
        judge_messages(*self._memory, *tables, messages, *values, others[0], others[2], outcome, *states)
        self._count(outcome, messages["layout"], parts)
        errors = [layout.text for layout in layouts]
        return Assembled(outcome, *states, _texts(outcome, messages["layout"], errors, self.names))

    def _layout(self, part):
        """Return the layout of messages with one list of names."""
        key = part.names, *(getattr(part, field).shape[1] for field in FIELDS)
        if key not in self._layouts:
            self._layouts[key] = self._make_layout(*key)
        return self._layouts[key]

    def _make_layout(self, names, *lengths):
        self.arrived |= dict.fromkeys(names[: MAX_NAMES - len(self.arrived)])
        joints = [self._map_name(name) for name in names]
        count = len(self._memory.joints)
        if len(set(joints)) < len(joints):
            twice = next(name for name, number in Counter(joints).items() if number > 1)
            return _Layout(codes.DUPLICATE_NAME, f"joint '{twice}' is listed twice in one message")
        index = {name: k for k, name in enumerate(self.names)}
        found = [(k, index[joint]) for k, joint in enumerate(joints) if joint in index]
        there = np.array(found, dtype=np.int64).reshape(-1, 2).T
        own, beside = there[:, there[1] < count], there[:, there[1] >= count] - [[0], [count]]
        for field, length in zip(FIELDS, lengths, strict=True):
            if names and length not in (0, len(names)):
                at = min(length, len(names) - 1)  # the first joint without a value, or without a name
                text = f"{field} has {length} entries for {len(names)} names (first at '{names[at]}')"
                return _Layout(codes.WRONG_LENGTH, text, own, beside)
        return _Layout(0, "", own, beside)

    def _count(self, outcome, layout, parts):
        """Count what came of messages."""
        for code, name in codes.COUNTS.items():
            self.counts[name] += int((outcome["code"] == code).sum())
        foreign = np.flatnonzero(outcome["code"] == codes.FOREIGN)
        if len(foreign):
            self.last_foreign = parts[layout[foreign[-1]]].names
        for event, name in codes.EVENTS.items():
            rows = np.flatnonzero(outcome["events"] & event)
            self.counts[name] += len(rows)
            if len(rows):
                self._last[event] = self._event_text(event, outcome[rows[-1]])
        stuck = outcome[["frozen_kind", "frozen_joint", "frozen_more"]][outcome["frozen_kind"] > 0]
        for kind, number in Counter(stuck.tolist()).items():
            self.frozen[codes.frozen_text(*kind, self.names)] += number

    def _event_text(self, event, outcome):
        if event == codes.MOVED:
            return codes.moved_text(outcome, self.names)
        if event == codes.CONTRADICTS:
            return codes.contradiction_text(outcome, self.names)
        if event == codes.DISAGREES:
            shared, followers = self._memory.shared[0], self._memory.followers
            own = self.names[len(self._memory.joints) :]
            return codes.disagreement_text(followers, own, self._sources, shared["tolerance"])
        return ""


class _Layout(NamedTuple):
    """Places of joints, and of followers, in messages and in the robot: (2, number)."""

    error: int
    text: str
    joints: np.ndarray = np.zeros((2, 0), np.int64)
    followers: np.ndarray = np.zeros((2, 0), np.int64)


def _write(array, **fields):
    for name, values in fields.items():
        array[name] = values


def _place(part, where, arrays):
    """Write values of messages into the arrays of a batch, in the order of the robot."""
    there, here = where
    for field, array in zip(FIELDS, arrays, strict=True):
        values = getattr(part, field)
        if values.shape[1] and len(there):
            array[part.rows[:, None], here] = values[:, there]


def _tables(layouts, own, beside):
    """Return the Layouts of a batch."""
    sizes = np.zeros(len(layouts), memory.LAYOUT)
    joints, followers = np.zeros((len(layouts), own), np.int64), np.zeros((len(layouts), beside), np.int64)
    for k, layout in enumerate(layouts):
        here, others = layout.joints[1], layout.followers[1]
        sizes[k] = len(here), len(others), layout.error
        joints[k, : len(here)], followers[k, : len(others)] = here, others
    return memory.Layouts(sizes, joints, followers)


def _texts(outcome, layout, errors, names):
    """Return cause and text of each rejected message, but for malformed ones, by its place."""
    found = {}
    for k in np.flatnonzero(outcome["code"] > codes.MALFORMED).tolist():
        code = int(outcome["code"][k])
        text = errors[layout[k]] if code in codes.LAYOUT_ERRORS else codes.rejection_text(outcome[k], names)
        found[k] = codes.CAUSES[code], text
    return found
