"""Joint states as bytes: those of a text that is known are read without making Python objects of them.

What a driver sends again and again differs in stamp and numbers alone. Once a message has been taken in the ordinary way, its
text (the names and all lengths) and where its numbers lie are known, and one compiled pass takes in the next one: it compares
the text, judges the numbers and completes the state. Whatever is not plainly good it leaves to the ordinary way, as it was.
"""

import random
from dataclasses import dataclass

import numpy as np
from numba import boolean, int32, int64, uint8
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from diag_dynamics.kernel import COUNT, MATRIX, VECTOR, Lent, entry_kernel, kernel, ready
from diag_dynamics.nodes.cdr import Template
from diag_dynamics.nodes.inputs.joint_states import RobotState
from diag_dynamics.nodes.inputs.rejected import RejectedError
from diag_dynamics.nodes.inputs.stamps import FAR, SECOND

MOST_LAYOUTS, FREELY, SELDOM = 64, 200, 100
"""Texts that are known at a time; and how many are learned as they come, before only one of so many messages is looked at.

A text that never comes again is not worth it. Which one is looked at is left to chance, lest two drivers that take turns
have it always be the other's.
"""

LONGEST = 1 << 16
"""Longest message that is learned [bytes], which may hold a thousand joints: what is kept is a few megabytes at most."""

_BYTES, _WORDS, _INDICES, _FLAGS = Lent(uint8, 1), Lent(int32, 1), Lent(int64, 1), Lent(boolean, 1)


_NO_EFFORT, _WITH_EFFORT = 1, 2


@dataclass(slots=True)
class _Layout:
    """Of messages of one text: what :func:`_take` has to know of them."""

    template: Template
    fixed: tuple  # the bytes of the text, where they are looked at, and where position, velocity and effort begin
    places: (
        tuple  # of needed joints in the message and in the robot, likewise of followers; and which are needed joints
    )
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
        self._shape = 3, len(assembler.names)
        self._allot(256)
        ready(_take)
        self.configure()

    def configure(self):
        """Judge by the assembler's options, which have changed."""
        self._judged = self._assembler.plain_judgement()

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
        layouts = self._layouts.get(len(raw))
        if layouts and self._judged and now:
            mode, suspects = self._stamps.mode, self._stamps.suspects
            for layout in layouts if mode is not None else ():
                if layout.source is not None and layout.source not in suspects:
                    state = self._taken(layout, raw, now, mode)
                    if state is not None:
                        return state
        try:
            message = deserialize_message(raw, JointState)
        except Exception as error:
            raise RejectedError(
                "malformed", f"joint_states: {len(raw)} bytes that are no sensor_msgs/msg/JointState ({error})"
            ) from error
        state = self._assembler.update(message, now)
        self._learn(raw, message)
        return state

    def _allot(self, size):
        room = np.zeros(size + 16, dtype=np.uint8)
        room = room[-room.ctypes.data % 8 :]
        self._size, self._view = size, memoryview(room)[4:]
        self._room = room[4:], room[8 : 8 + size // 4 * 4].view(np.int32), room[8 : 8 + size // 8 * 8].view(np.float64)

    def _taken(self, layout, raw, now, mode):
        """The state that a message of this layout completes; None if there is anything to be said against it."""
        self._view[: len(raw)] = raw
        values = np.empty(self._shape)
        known, newest, oldest, stamp = _take(
            *self._room, *layout.fixed, *layout.places, now, mode, *self._judged, values
        )
        if not known:
            return None
        self.at_once += 1
        layout.used = True
        if mode:
            self._stamps.offset = (now - stamp) * 1e-9
        position, velocity, effort = values
        return RobotState(position, velocity, effort if known == _WITH_EFFORT else None, newest, oldest, False)

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
        fields = np.array([template.first_double(field) for field in ("position", "velocity", "effort")])
        layout = _Layout(
            template,
            (template.data, template.text, fields),
            (*columns, needed),
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


@entry_kernel(
    *(_BYTES, _WORDS, VECTOR),
    *(_BYTES, _BYTES, _INDICES),
    *(_INDICES, _INDICES, _INDICES, _INDICES, _FLAGS),
    *(COUNT, COUNT, COUNT),
    *(MATRIX, VECTOR, MATRIX, _INDICES, _FLAGS, _FLAGS),
    *(_INDICES, MATRIX, VECTOR, _INDICES),
    MATRIX,
)
def _take(
    room,
    words,
    doubles,
    data,
    text,
    fields,
    there,
    here,
    beside,
    following,
    needed,
    now,
    mode,
    max_age,
    limits,
    most,
    kept,
    stamps,
    known,
    unstamped,
    leaders,
    coupling,
    follower_effort,
    follower_stamps,
    values,
):
    """Take in a message that changes nothing but values: whether it did, with efforts or without; and three stamps.

    What makes it so is said in JointStateAssembler.update, where everything else is dealt with, too. Nothing is written
    before it is certain.
    """
    nothing = 0, 0, 0, 0
    differs = np.uint8(0)
    for k in range(len(data)):
        differs |= (room[k] ^ data[k]) & text[k]
    sec, nanosec = np.int64(words[0]), np.int64(words[1])  # of a second or more it may be negative here
    stamp = sec * SECOND + nanosec
    if differs or sec < 0 or not 0 <= nanosec < SECOND or stamp == 0:
        return nothing
    if mode and (abs(now - stamp) > max_age) != (mode == FAR):
        return nothing

    newest = oldest = stamp
    for j in range(len(stamps)):
        if not known[j] or unstamped[j] or (needed[j] and stamp < stamps[j]):
            return nothing
        values[0, j], values[1, j], values[2, j] = kept[0, j], kept[1, j], kept[2, j]
        if not needed[j]:
            newest, oldest = max(newest, stamps[j]), min(oldest, stamps[j])

    fastest, most_effort, tolerance = most[0], most[1], most[2]
    lower, upper, factor, span = limits[0], limits[1], limits[2], limits[3]
    for k in range(len(here)):
        i, j = there[k], here[k]
        position, velocity = doubles[fields[0] + i], doubles[fields[1] + i]
        effort = np.nan if fields[2] < 0 else doubles[fields[2] + i] * factor[j]
        if position < lower[j] or position > upper[j] or abs(velocity) > fastest or _absurd(effort, most_effort):
            return nothing
        values[0, j], values[1, j], values[2, j] = position, velocity, effort

    with_effort = True
    for j in range(len(stamps)):
        if newest - (stamp if needed[j] else stamps[j]) > span[j]:
            return nothing
        if not (np.isfinite(values[0, j]) and np.isfinite(values[1, j])):
            return nothing
        with_effort = with_effort and np.isfinite(values[2, j])

    multiplier, offset, follower_factor, follower_span = coupling[0], coupling[1], coupling[2], coupling[3]
    for k in range(len(following)):
        i, f = beside[k], following[k]
        j = leaders[f]
        own = doubles[fields[0] + i]
        fresh = needed[j] or abs(stamps[j] - stamp) <= span[j]
        apart = abs(own - (multiplier[f] * values[0, j] + offset[f]))
        if tolerance and fresh and np.isfinite(own) and apart > tolerance:
            return nothing
        if fields[2] >= 0 and _absurd(doubles[fields[2] + i] * follower_factor[f], most_effort):
            return nothing

    for k in range(len(here)):
        j = here[k]
        kept[0, j], kept[1, j], kept[2, j], stamps[j] = values[0, j], values[1, j], values[2, j], stamp
    for k in range(len(following)):
        i, f = beside[k], following[k]
        follower_effort[f] = np.nan if fields[2] < 0 else doubles[fields[2] + i] * follower_factor[f]
        follower_stamps[f] = stamp
    if with_effort:
        for f in range(len(leaders)):
            fresh = abs(newest - follower_stamps[f]) <= follower_span[f]
            own = follower_effort[f] if fresh and np.isfinite(follower_effort[f]) else 0.0
            values[2, leaders[f]] += multiplier[f] * own
    return _WITH_EFFORT if with_effort else _NO_EFFORT, newest, oldest, stamp


@kernel
def _absurd(effort, most):
    return abs(effort) > most or np.isinf(effort)
