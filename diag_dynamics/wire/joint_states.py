# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint states as bytes: those of a text that is known are read without making Python objects of them.

What a driver sends again and again differs in stamp and numbers alone. Once a message has been taken in the ordinary way, its
text (the names and all lengths) and where its numbers lie are known, and one compiled pass takes in the next one: it compares
the text, judges the numbers and completes the state. Whatever is not plainly good it leaves to the ordinary way, as it was.
"""

import random
from dataclasses import dataclass

import numpy as np

from diag_dynamics.assembly.assembler import FOLLOWER_RULES, JOINT_RULES, RobotState
from diag_dynamics.assembly.jumps import MIN_STEP_TIME
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.assembly.stamps import FAR, SECOND
from diag_dynamics.compiled.kernel import COUNT, entry_kernel, kernel, large_kernel, ready
from diag_dynamics.compiled.tables import Addresses, Table, array
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.overrun import overruns

MOST_LAYOUTS, FREELY, SELDOM = 64, 200, 100
"""Texts that are known at a time; and how many are learned as they come, before only one of so many messages is looked at.

A text that never comes again is not worth it. Which one is looked at is left to chance, lest two drivers that take turns
have it always be the other's.
"""

LONGEST = 1 << 16
"""Longest message that is learned [bytes], which may hold a thousand joints: what is kept is a few megabytes at most."""

FIELDS = "position", "velocity", "effort"

WITHOUT_EFFORT, WITH_EFFORT = 1, 2
"""What :func:`take` has taken in."""

STAMPS = np.dtype([("newest", "i8"), ("oldest", "i8")])
"""Stamps of what it has taken in [ns]."""

KNOWN = Table(
    "Known",
    room=array(np.uint8),  # bytes of the message, numbers of which a text's places count
    words=array(np.int32),
    doubles=array(float),
    max_age=int,  # from here on: see PlainJudgement
    most_effort=float,
    mimic_tolerance=float,
    slack=float,
    joints=array(JOINT_RULES),
    followers=array(FOLLOWER_RULES),
    position=array(float),
    velocity=array(float),
    effort=array(float),
    stamp=array(int),
    known=array(bool),
    without_stamp=array(bool),
    follower_effort=array(float),
    follower_stamp=array(int),
    draft_position=array(float),  # what a state is made up in, before it is certain
    draft_velocity=array(float),
    draft_effort=array(float),
    state_position=array(float),  # what it is handed out in
    state_velocity=array(float),
    state_effort=array(float),
    no_effort=array(float),  # zeros
    stamps=array(STAMPS),
)
"""What :func:`take` judges by, keeps values in, and hands a state out in."""

TEXT = Table(
    "Text",
    data=array(np.uint8),  # as Template has it and `text`
    text=array(np.uint8),
    position=int,  # where in `doubles` these begin; -1 where there are none
    velocity=int,
    effort=int,
    there=array(int),  # places of needed joints in the message
    here=array(int),  # and in the robot
    beside=array(int),  # likewise of followers
    following=array(int),
    needed=array(bool),  # which are needed joints
)
"""What it has to know of messages of one text."""


@dataclass(slots=True)
class _Layout:
    """Messages of one text."""

    template: Template
    addresses: Addresses
    source: int | None  # whose stamps they have, as Stamps knows it; None if none of them can be plainly good
    used: bool = True  # whether one has come since layouts were last thrown away


class KnownJointStates:
    """Takes joint states in as bytes, for an assembler.

    Parameters
    ----------
    assembler : JointStateAssembler
    deserialize : callable
        Gives the JointState of its bytes, or raises any exception.

    Attributes
    ----------
    at_once : int
        How many messages were of a known text and plainly good.
    """

    def __init__(self, assembler, deserialize):
        self.at_once, self._deserialize = 0, deserialize
        self._assembler, self._stamps = assembler, assembler.stamps
        self._chance = random.Random(0)
        self._layouts = {}  # lists by the length of the message
        self._unknown = 0  # messages of no known text
        self._state, self._times = np.zeros((3, len(assembler.names))), np.zeros(1, STAMPS)
        self._allot(256)
        ready(_take)

    def configure(self):
        """Judge by the assembler's options, which have changed."""
        judged = self._assembler.plain_judgement()
        if not judged:
            self._addresses = None
            return
        after = self._room[8:]  # the encapsulation, before which there are four bytes
        draft, no_effort = np.zeros_like(self._state), np.zeros(len(judged.joints))
        self._addresses = Addresses(
            KNOWN,
            **judged._asdict(),
            **{"room": self._room[4:], "words": after.view(np.int32), "doubles": after.view(np.float64)},
            **{f"draft_{field}": row for field, row in zip(FIELDS, draft, strict=True)},
            **{f"state_{field}": row for field, row in zip(FIELDS, self._state, strict=True)},
            **{"no_effort": no_effort, "stamps": self._times},
        )

    def update(self, raw, now):
        """Take a serialized message in and return the state it completes: as JointStateAssembler.update does.

        Parameters
        ----------
        raw : bytes
        now : int
            Time of reception [ns].

        Raises
        ------
        RejectedError
            As there, or the bytes are no message.
        """
        found = self.taken(raw, now, _take)
        return self.state(found[0]) if found else self.deserialized(raw, now)

    def deserialized(self, raw, now):
        """As :meth:`update`, in the ordinary way."""
        try:
            if overruns(raw):
                raise ValueError("a sequence counts more entries than there are bytes")
            message = self._deserialize(raw)
        except Exception as error:
            raise RejectedError(
                "malformed", f"joint_states: {len(raw)} bytes that are no sensor_msgs/msg/JointState ({error})"
            ) from error
        state = self._assembler.update(message, now)
        self._learn(raw, message)
        return state

    def taken(self, raw, now, take, *more):
        """Take a serialized message in, if it is of a known text and plainly good.

        Parameters
        ----------
        raw : bytes
        now : int
            Time of reception [ns].
        take : entry kernel
            Calls :func:`take` with its first four arguments, and returns a tuple: what that has taken in, the message's
            stamp, and whatever else it makes of it.
        *more
            Its further arguments.

        Returns
        -------
        tuple or None
            What `take` returns; None if nothing is taken in, and nothing has changed.
        """
        mode = self._assembler.mode
        if mode is None or not now or not self._addresses:
            return None
        suspects, here = self._stamps.suspects, self._addresses.at
        for layout in self._layouts.get(len(raw), ()):
            if layout.source is not None and layout.source not in suspects:
                self._view[: len(raw)] = raw
                found = take(here, layout.addresses.at, now, mode, *more)
                if found[0]:
                    self.at_once += 1
                    layout.used = True
                    self._assembler.gaps.take(layout.source, found[1])
                    if mode:
                        self._stamps.offset = (now - found[1]) * 1e-9
                    return found
        return None

    def state(self, found):
        """The state that was taken in last, WITHOUT_EFFORT or WITH_EFFORT."""
        position, velocity, effort = self._state.copy()
        newest, oldest = self._times.item()
        return RobotState(position, velocity, effort if found == WITH_EFFORT else None, newest, oldest, False)

    def _allot(self, size):
        """Have room for messages of so many bytes; what comes after the encapsulation begins on a multiple of eight."""
        size += -size % 8
        room = np.zeros(size + 16, dtype=np.uint8)
        self._room = room[-room.ctypes.data % 8 :][: size + 8]
        self._size, self._view = size, memoryview(self._room)[4:]
        self.configure()

    def _learn(self, raw, message):
        """Get to know the text of a message, if that can be of use."""
        if len(raw) > LONGEST:
            return
        for layout in self._layouts.get(len(raw), ()):
            if layout.template.fits(raw):
                layout.used = True
                return
        self._unknown += 1
        if self._unknown > FREELY and self._chance.randrange(SELDOM):
            return
        count = len(message.name)
        template, columns = Template(message), self._assembler.columns(message)
        here = columns[1]
        complete = len(message.position) == len(message.velocity) == count and len(message.effort) in (0, count)
        if not template.holds(raw):
            return
        if sum(map(len, self._layouts.values())) >= MOST_LAYOUTS and not self._tidied():
            return
        if len(raw) > self._size:
            self._allot(2 * len(raw))
        needed = np.zeros(len(self._assembler.names), dtype=bool)
        needed[here] = True
        layout = _Layout(
            template,
            Addresses(
                TEXT,
                **{"data": template.data, "text": template.text, "needed": needed},
                **{field: template.first_double(field) for field in FIELDS},
                **dict(zip(("there", "here", "beside", "following"), columns, strict=True)),
            ),
            int(here.min()) if complete and len(here) else None,
        )
        self._layouts.setdefault(len(raw), []).append(layout)

    def _tidied(self):
        """Throw away what has not come since this was done last; whether there was any."""
        before = sum(map(len, self._layouts.values()))
        kept = {size: [layout for layout in some if layout.used] for size, some in self._layouts.items()}
        self._layouts = {size: some for size, some in kept.items() if some}
        for layout in (layout for some in self._layouts.values() for layout in some):
            layout.used = False
        return sum(map(len, self._layouts.values())) < before


known_at, _text_at = KNOWN.opened, TEXT.opened


@large_kernel
def take(known, layout, now, mode):
    """Take in a message that changes nothing but values: whether it did, with efforts or without; and its stamp.

    What makes it so is said in JointStateAssembler.update, where everything else is dealt with, too. Nothing is written
    before it is certain.
    """
    own, of = known_at(known), _text_at(layout)
    doubles, joints, followers, stamps = own.doubles, own.joints, own.followers, own.stamp
    draft_position, draft_velocity, draft_effort = own.draft_position, own.draft_velocity, own.draft_effort
    needed, with_efforts = of.needed, of.effort >= 0
    nothing = 0, 0
    differs = np.uint8(0)
    for k in range(len(of.data)):
        differs |= (own.room[k] ^ of.data[k]) & of.text[k]
    sec, nanosec = np.int64(own.words[0]), np.int64(own.words[1])  # of a second or more it may be negative here
    stamp = sec * SECOND + nanosec
    if differs or sec < 0 or not 0 <= nanosec < SECOND or stamp == 0:
        return nothing
    if mode and (abs(now - stamp) > own.max_age) != (mode == FAR):
        return nothing

    newest = oldest = stamp
    rests = rested = True
    for j in range(len(stamps)):
        if not own.known[j] or own.without_stamp[j] or (needed[j] and stamp < stamps[j]):
            return nothing
        draft_position[j], draft_velocity[j], draft_effort[j] = own.position[j], own.velocity[j], own.effort[j]
        if not needed[j]:
            newest, oldest = max(newest, stamps[j]), min(oldest, stamps[j])

    for k in range(len(of.here)):
        i, j = of.there[k], of.here[k]
        rules = joints[j]
        position, velocity = doubles[of.position + i], doubles[of.velocity + i]
        effort = doubles[of.effort + i] * rules.factor if with_efforts else np.nan
        if position < rules.lower or position > rules.upper or abs(velocity) > rules.fastest:
            return nothing
        if _absurd(effort, rules.strongest):
            return nothing
        elapsed = (stamp - stamps[j]) * 1e-9
        rests, rested = rests and velocity == 0.0, rested and own.velocity[j] == 0.0
        if own.slack > 0.0 and elapsed == 0.0 and position != own.position[j]:
            return nothing
        if own.slack > 0.0 and elapsed <= rules.lasting:
            step, speed = abs(position - own.position[j]), _faster(velocity, own.velocity[j], rules.reach)
            if rules.turns > 0.0:
                step = step % (2.0 * np.pi)
                step = min(step, 2.0 * np.pi - step)
            if step > speed * max(elapsed, MIN_STEP_TIME) + own.slack:  # as Jumps has it
                return nothing
        draft_position[j], draft_velocity[j], draft_effort[j] = position, velocity, effort
    if own.slack > 0.0 and rests and not rested:  # it stops, or another source rests
        return nothing

    with_effort = True
    for j in range(len(stamps)):
        if newest - (stamp if needed[j] else stamps[j]) > joints[j].span:
            return nothing
        if not (np.isfinite(draft_position[j]) and np.isfinite(draft_velocity[j])):
            return nothing
        with_effort = with_effort and np.isfinite(draft_effort[j])

    for k in range(len(of.following)):
        i, rules = of.beside[k], followers[of.following[k]]
        j = rules.leader
        position = doubles[of.position + i]
        fresh = needed[j] or abs(stamps[j] - stamp) <= joints[j].span
        apart = abs(position - (rules.multiplier * draft_position[j] + rules.offset))
        if own.mimic_tolerance and fresh and np.isfinite(position) and apart > own.mimic_tolerance:
            return nothing
        if with_efforts and _absurd(doubles[of.effort + i] * rules.factor, own.most_effort):
            return nothing

    for k in range(len(of.here)):
        j = of.here[k]
        own.position[j], own.velocity[j], own.effort[j] = draft_position[j], draft_velocity[j], draft_effort[j]
        stamps[j] = stamp
    for k in range(len(of.following)):
        i, f = of.beside[k], of.following[k]
        own.follower_effort[f] = doubles[of.effort + i] * followers[f].factor if with_efforts else np.nan
        own.follower_stamp[f] = stamp
    for j in range(len(stamps)):
        own.state_position[j], own.state_velocity[j] = draft_position[j], draft_velocity[j]
        own.state_effort[j] = draft_effort[j]
    own.stamps[0].newest, own.stamps[0].oldest = newest, oldest
    if with_effort:
        for f in range(len(followers)):
            fresh = abs(newest - own.follower_stamp[f]) <= followers[f].span
            effort = own.follower_effort[f] if fresh and np.isfinite(own.follower_effort[f]) else 0.0
            own.state_effort[followers[f].leader] += followers[f].multiplier * effort
    return WITH_EFFORT if with_effort else WITHOUT_EFFORT, stamp


@entry_kernel(COUNT, COUNT, COUNT, COUNT)
def _take(known, layout, now, mode):
    """:func:`take`, and nothing else."""
    return take(known, layout, now, mode)


@kernel
def _faster(velocity, before, reach):
    """Twice the larger of two speeds, of which the second one may be NaN, but no less than `reach`."""
    speed = abs(velocity)
    if abs(before) > speed:
        speed = abs(before)
    return max(2.0 * speed, reach)


@kernel
def _absurd(effort, most):
    return abs(effort) > most or np.isinf(effort)
