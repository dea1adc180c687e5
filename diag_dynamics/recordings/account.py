# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What became of the messages of a recording."""

from collections import Counter
from typing import NamedTuple

from diag_dynamics.assembly.jumps import INTERLEAVED
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.intake import ABSURD, LOST
from diag_dynamics.recordings.joint_names import describe_maps, listed, propose_maps
from diag_dynamics.recordings.refused_units import MIN_REJECTED, UNITS

NOTE = "note"
"""Cause of findings about how a file was understood, of which nothing is wrong."""


OTHER_TOPICS = "(--topic reads several)"
"""In the note about topics of joint states that are not read."""


class Finding(NamedTuple):
    """Something about a recording that a reader of its numbers should know."""

    cause: str
    """A short key, such as ``rejected: late`` or ``unread``."""
    count: int
    """How often."""
    text: str
    """What, and where it was first."""

    def __str__(self) -> str:
        return f"{self.cause} ({self.count} ×): {self.text}" if self.count > 1 else f"{self.cause}: {self.text}"


WITHOUT_VALUES = "rows of other topics"
"""Name of the count of rows of a table that have no value of any joint."""

TEXTS = {
    "incomplete": None,
    "foreign": None,
    WITHOUT_VALUES: "rows without a value of any joint, such as rows of other topics; they are no messages",
    LOST: "states that never came, by the gaps in the stamps",
    "positions jumped": None,
    INTERLEAVED: None,
    "mimic disagreement": None,
    "absurd effort": "efforts beyond what can be, taken as unknown (absurd.effort)",
    "before odometry": "joint states before the base was known",
    "time jumped back": "stamps went back: all joints were forgotten, and what follows is a stretch of its own",
    "awaiting velocity": "states before a velocity could be estimated",
}
"""What is told of, though no message was rejected, by the name of its count; without a text, that of the last time."""


def without_efforts(counts):
    """Why a recording has no efforts, by what became of its messages: the beginning of an error."""
    absurd = counts.get("absurd effort", 0)
    if absurd:
        return (
            f"the recording has no efforts, for those of {absurd} states are beyond what can be and were taken as unknown "
            "(absurd.effort, absurd.beyond_effort; are they in N m?)"
        )
    return "the recording has no efforts, or in no state one of every joint"


def without_states(path, findings):
    """The error about a recording without a single state: it says what became of its messages."""
    found = sorted((one for one in findings if one.cause != NOTE), key=lambda one: -one.count)
    told = "; ".join(map(str, found[:3])) or "it has no messages"
    topics = "".join(f" {one.text}" for one in findings if one.cause == NOTE and OTHER_TOPICS in one.text)
    return InputError(f"'{path}' has not a single state: {told.removesuffix('.')}.{topics}")


class Account:
    """Counts and texts of the messages of a recording.

    Parameters
    ----------
    intake : Intake
        Which has taken the messages in.
    unread : sequence of Unread
    notes : sequence of str
        What else is odd about the file.
    without_values : int
        Rows of a table that have no value of any joint.
    """

    misplaced = False

    def __init__(self, intake, unread=(), notes=(), without_values=0):
        assembler = intake.assembler
        self.counts = intake.counts + Counter({WITHOUT_VALUES: without_values})
        self._first, self._last, self._frozen = {}, intake.last_texts, Counter(assembler.frozen)
        self._missing, self._units = assembler.missing, intake.units.text()
        self._arrived, self._joints = dict(assembler.arrived), set(assembler.names)
        self._names, self._count = intake.names, len(assembler.joint_names)
        for rejection in intake.rejections:
            self._first.setdefault(rejection.cause, rejection.text)
        self._unread, self._notes = list(unread), list(notes)

    def findings(self):
        """What is worth knowing: a list of Finding, losses first, and how the file was understood last."""
        counts = self.counts
        found, refused = [], counts[f"rejected: {ABSURD}"]
        if self._units and refused > MIN_REJECTED * counts["received"]:
            found.append(Finding(UNITS, refused, self._units))
        found += [Finding("unread", 1, f"{one.file}, {one.where}: {one.what}") for one in self._unread]
        found += [Finding(cause, counts[cause], text) for cause, text in self._first.items()]
        for cause, text in TEXTS.items():
            if counts[cause]:
                found.append(Finding(cause, counts[cause], text or self._text(cause)))
        found += [
            Finding("frozen values", number, text.removeprefix("frozen values: "))
            for text, number in self._frozen.items()
        ]
        return found + [Finding(NOTE, 1, note) for note in self._notes]

    def without_states(self, path):
        """The error about a recording without a single state."""
        return without_states(path, self.findings())

    def _text(self, cause):
        missing = self._missing
        if not missing or cause not in ("incomplete", "foreign"):
            return "messages before all joints were known" if cause == "incomplete" else self._last[cause]
        own, map_name = self._joints, self._names.map_name if self._names else str
        others = [name for name in self._arrived if map_name(name) not in own]
        if cause == "foreign":
            what = "the robot has " if len(missing) == self._count else "never came: "
            text = f"messages without a joint of this robot, of {listed(others)}; {what}{listed(missing)}"
            return f"{text}. {self._advice(others)}"
        text = f"messages before all joints were known; never came: {listed(missing)}. "
        if self.counts["foreign"] or not others:
            return f"{text}{self._lock()}"
        return f"{text}Messages name {listed(others)}, which the robot lacks. {self._advice(others)}"

    def _lock(self):
        return f"A joint that does not move is held by locked_joints={self._missing[0]}=0"

    def _advice(self, others):
        """The map that leads from names that came to joints that did not."""
        found = propose_maps(others, self._missing)
        if not found:
            text = "Another name of a joint is given by --joint-names NAME=JOINT (joint_names)"
            return text if len(self._missing) == self._count else f"{text}. {self._lock()}"
        return describe_maps(found, others, self._joints)
