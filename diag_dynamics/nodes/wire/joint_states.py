"""Joint states as bytes: those of a text that is known are read without making Python objects of them.

What a driver sends again and again differs in stamp and numbers alone. Once a message has been taken in the ordinary way, its
text (the names and all lengths) and where its numbers lie are known, and one compiled pass takes in the next one: it compares
the text, judges the numbers and completes the state. Whatever is not plainly good it leaves to the ordinary way, as it was.
"""

import random
from collections import namedtuple
from dataclasses import dataclass

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from diag_dynamics.assembly.assembler import RobotState
from diag_dynamics.assembly.jumps import SHORTEST
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.assembly.stamps import FAR, SECOND
from diag_dynamics.compiled.addresses import Addresses, bytes_at, flags_at, indices_at, matrix_at, vector_at, words_at
from diag_dynamics.compiled.kernel import COUNT, entry_kernel, kernel, large_kernel, ready
from diag_dynamics.nodes.wire.cdr import Template
from diag_dynamics.nodes.wire.overrun import overruns

MOST_LAYOUTS, FREELY, SELDOM = 64, 200, 100
"""Texts that are known at a time; and how many are learned as they come, before only one of so many messages is looked at.

A text that never comes again is not worth it. Which one is looked at is left to chance, lest two drivers that take turns
have it always be the other's.
"""

LONGEST = 1 << 16
"""Longest message that is learned [bytes], which may hold a thousand joints: what is kept is a few megabytes at most."""

WITHOUT_EFFORT, WITH_EFFORT = 1, 2
"""What :func:`take` has taken in."""

NO_EFFORT, DRAFT, ROWS = 3, 4, 7
"""Rows of what it hands a state out in: position, velocity and effort, zeros, and again the former, not valid yet."""


@dataclass(slots=True)
class _Layout:
    """Of messages of one text: what :func:`take` has to know of them."""

    template: Template
    addresses: Addresses
    source: int | None  # whose stamps they have, as Stamps knows it; None if none of them can be plainly good
    used: bool = True  # whether one has come since layouts were last thrown away


class KnownJointStates:
    """Takes joint states in as bytes, for an assembler.

    Parameters
    ----------
    assembler : JointStateAssembler

    Attributes
    ----------
    at_once : int
        How many messages were of a known text and plainly good.
    """

    def __init__(self, assembler):
        self.at_once = 0
        self._assembler, self._stamps = assembler, assembler.stamps
        self._chance = random.Random(0)
        self._layouts = {}  # lists by the length of the message
        self._unknown = 0  # messages of no known text
        self._values, self._times = np.zeros((ROWS, len(assembler.names))), np.zeros(2, dtype=np.int64)
        self._allot(256)
        ready(_take)

    def configure(self):
        """Judge by the assembler's options, which have changed."""
        judged, names = self._assembler.plain_judgement(), self._assembler
        shape = len(names.names), len(names.followers.names)
        self._addresses = judged and Addresses(*shape, self._room, *judged, self._values, self._times)

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
            message = deserialize_message(raw, JointState)
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
        mode = self._stamps.mode
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
        position, velocity, effort = self._values[:3].copy()
        newest, oldest = self._times.tolist()
        return RobotState(position, velocity, effort if found == WITH_EFFORT else None, newest, oldest, False)

    def _allot(self, size):
        """Have room for messages of so many bytes; what comes after the encapsulation begins on a multiple of eight."""
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
        fields = [template.first_double(field) for field in ("position", "velocity", "effort")]
        text = template.data, template.text, len(template.data)
        places = [entry for column in columns for entry in (len(column), column)]
        layout = _Layout(
            template,
            Addresses(*text, *fields, *places, needed),
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


_Known = namedtuple(
    "_Known",
    [
        *("room", "words", "doubles", "max_age", "limits", "most"),
        *("kept", "stamps", "known", "unstamped"),
        *("leaders", "coupling", "follower_effort", "follower_stamps"),
        *("values", "times"),
    ],
)
"""What is judged by, and kept in: see JointStateAssembler.plain_judgement; then what a state is handed out in."""

_Text = namedtuple("_Text", ["data", "text", "fields", "there", "here", "beside", "following", "needed"])
"""The bytes of a text, where they are looked at, and where position, velocity and effort begin; places of needed joints in
the message and in the robot, likewise of followers; and which are needed joints."""


@kernel
def _opened_known(address):
    at = indices_at(address, (16,))
    n, followers = at[0], at[1]
    return _Known(
        bytes_at(at[2] + 4, (LONGEST,)),
        words_at(at[2] + 8, (LONGEST // 4,)),
        vector_at(at[2] + 8, (LONGEST // 8,)),
        at[3],
        matrix_at(at[4], (9, n)),
        vector_at(at[5], (3,)),
        matrix_at(at[6], (3, n)),
        indices_at(at[7], (n,)),
        flags_at(at[8], (n,)),
        flags_at(at[9], (n,)),
        indices_at(at[10], (followers,)),
        matrix_at(at[11], (4, followers)),
        vector_at(at[12], (followers,)),
        indices_at(at[13], (followers,)),
        matrix_at(at[14], (ROWS, n)),
        indices_at(at[15], (2,)),
    )


@kernel
def _opened_text(address, n):
    at = indices_at(address, (15,))
    return _Text(
        bytes_at(at[0], (at[2],)),
        bytes_at(at[1], (at[2],)),
        (at[3], at[4], at[5]),
        indices_at(at[7], (at[6],)),
        indices_at(at[9], (at[8],)),
        indices_at(at[11], (at[10],)),
        indices_at(at[13], (at[12],)),
        flags_at(at[14], (n,)),
    )


@kernel
def value_at(address, row):
    """A row of what :func:`take` has handed out last, see :data:`NO_EFFORT`."""
    at = indices_at(address, (16,))
    return vector_at(at[14] + 8 * row * at[0], (at[0],))


@kernel
def times_at(address):
    """The newest and the oldest of the stamps of what :func:`take` has handed out last [ns]."""
    return indices_at(indices_at(address, (16,))[15], (2,))


@large_kernel
def take(known, layout, now, mode):
    """Take in a message that changes nothing but values: whether it did, with efforts or without; and its stamp.

    What makes it so is said in JointStateAssembler.update, where everything else is dealt with, too. Nothing is written
    before it is certain.
    """
    own, of = _opened_known(known), _opened_text(layout, _opened_known(known).stamps.size)
    doubles, kept, stamps, draft = own.doubles, own.kept, own.stamps, own.values[DRAFT:]
    begin, with_efforts = of.fields, of.fields[2] >= 0
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
    for j in range(len(stamps)):
        if not own.known[j] or own.unstamped[j] or (of.needed[j] and stamp < stamps[j]):
            return nothing
        draft[0, j], draft[1, j], draft[2, j] = kept[0, j], kept[1, j], kept[2, j]
        if not of.needed[j]:
            newest, oldest = max(newest, stamps[j]), min(oldest, stamps[j])

    most_effort, tolerance, slack = own.most[0], own.most[1], own.most[2]
    lower, upper, factor, span = own.limits[0], own.limits[1], own.limits[2], own.limits[3]
    fastest, strongest, reach, lasting, turns = (
        own.limits[4],
        own.limits[5],
        own.limits[6],
        own.limits[7],
        own.limits[8],
    )
    for k in range(len(of.here)):
        i, j = of.there[k], of.here[k]
        position, velocity = doubles[begin[0] + i], doubles[begin[1] + i]
        effort = doubles[begin[2] + i] * factor[j] if with_efforts else np.nan
        if position < lower[j] or position > upper[j] or abs(velocity) > fastest[j] or _absurd(effort, strongest[j]):
            return nothing
        elapsed = (stamp - stamps[j]) * 1e-9
        if slack > 0.0 and elapsed <= lasting[j]:
            step, speed = abs(position - kept[0, j]), _faster(velocity, kept[1, j], reach[j])
            if turns[j] > 0.0:
                step = step % (2.0 * np.pi)
                step = min(step, 2.0 * np.pi - step)
            if step > speed * max(elapsed, SHORTEST) + slack:  # as Jumps has it
                return nothing
        draft[0, j], draft[1, j], draft[2, j] = position, velocity, effort

    with_effort = True
    for j in range(len(stamps)):
        if newest - (stamp if of.needed[j] else stamps[j]) > span[j]:
            return nothing
        if not (np.isfinite(draft[0, j]) and np.isfinite(draft[1, j])):
            return nothing
        with_effort = with_effort and np.isfinite(draft[2, j])

    leaders, multiplier, offset = own.leaders, own.coupling[0], own.coupling[1]
    follower_factor, follower_span = own.coupling[2], own.coupling[3]
    for k in range(len(of.following)):
        i, f = of.beside[k], of.following[k]
        j = leaders[f]
        position = doubles[begin[0] + i]
        fresh = of.needed[j] or abs(stamps[j] - stamp) <= span[j]
        apart = abs(position - (multiplier[f] * draft[0, j] + offset[f]))
        if tolerance and fresh and np.isfinite(position) and apart > tolerance:
            return nothing
        if with_efforts and _absurd(doubles[begin[2] + i] * follower_factor[f], most_effort):
            return nothing

    for k in range(len(of.here)):
        j = of.here[k]
        kept[0, j], kept[1, j], kept[2, j], stamps[j] = draft[0, j], draft[1, j], draft[2, j], stamp
    for k in range(len(of.following)):
        i, f = of.beside[k], of.following[k]
        own.follower_effort[f] = doubles[begin[2] + i] * follower_factor[f] if with_efforts else np.nan
        own.follower_stamps[f] = stamp
    for row in range(3):
        for j in range(len(stamps)):
            own.values[row, j] = draft[row, j]
    own.times[0], own.times[1] = newest, oldest
    if with_effort:
        for f in range(len(leaders)):
            fresh = abs(newest - own.follower_stamps[f]) <= follower_span[f]
            effort = own.follower_effort[f] if fresh and np.isfinite(own.follower_effort[f]) else 0.0
            own.values[2, leaders[f]] += multiplier[f] * effort
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
