# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statuses of /diagnostics and what a log says about them; no ROS is needed to import this."""

import re
from collections.abc import Mapping
from math import inf
from typing import NamedTuple

OK, WARN, ERROR, STALE = (bytes([level]) for level in range(4))
"""Levels of DiagnosticStatus. A STALE status lacks data because of another one."""

LOG_PERIOD = 10.0
"""Minimum time between two lines about a status, unless its level rises [s]."""

MIN_DURATION = 1.0
"""Minimum duration of a fault whose end is logged [s]."""

NO_FAULT = OK, ""

_MEASURED = re.compile(
    r"'[^']*'|= [^\s,;]+|\[|(?<![\w/.^])(?<![^\W\d]-)[-+±]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w/])"
)

_OPEN_END = re.compile(r"(?:[\s:,;(<>=~]|\b(?:is|are|has|for|by|of|to|from|than|at|within))+$")


class Status(NamedTuple):
    """One entry: its name after the node's, level, message, and values by key.

    The message stays the same while a fault lasts; `log` is one with its numbers. `is_logged`: the
    node has logged the begin of this fault.
    """

    name: str
    level: bytes
    message: str
    values: Mapping = {}
    log: str = ""
    is_logged: bool = False


def without_numbers(text):
    """Return what is before the first measured number of a text, such as ``position of 'a'``.

    Numbers of parameters (``name = number``) and within names stay. The text stays whole if no
    word without quotes would be left.
    """
    measured = (number for number in _MEASURED.finditer(text) if number[0][0] not in "'=")
    first = next(measured, None)
    start = _OPEN_END.sub("", text[: first.start()]) if first else text
    return start if re.search(r"\w", re.sub("'[^']*'", "", start)) else text


def problem_status(name, problems, message, values, is_logged=False):
    """Return a status that warns of problems, texts with numbers; without any it has the message."""
    if not problems:
        return Status(name, OK, message, values)
    stable = "; ".join(map(without_numbers, problems))
    return Status(name, WARN, stable, values, "; ".join(problems), is_logged)


class _Entry:
    """Fault of one status, and the texts of faults since the last line; times are steady [s]."""

    def __init__(self):
        self.fault, self.texts = NO_FAULT, {}
        self.begins = self.duration = 0.0
        self.logged_at, self.logged_level, self.is_open = -inf, OK, False

    def update(self, status, now):
        """Note a change of the fault."""
        is_fault, was_fault = (level in (WARN, ERROR) for level in (status.level, self.fault[0]))
        fault = (status.level, status.message if is_fault else "")
        if fault == self.fault:
            return
        if status.level == OK:
            self.duration = now - self.begins
        elif is_fault:
            self.begins = self.begins if was_fault else now
            if not status.is_logged:
                text = status.log or status.message
                self.texts[text] = self.texts.pop(text, 0) + 1  # the newest is the last one
        self.fault = fault

    def describe(self, elapsed):
        """Return the faults since the last line, `elapsed` [s] ago: the newest first."""
        return "; before: ".join(
            f"{text} ({count} times in {elapsed:.0f} s)" if count > 1 else text
            for text, count in reversed(self.texts.items())
        )


class RepeatLimit:
    """Limit equal lines of a log to one in LOG_PERIOD; measured numbers make no difference."""

    def __init__(self):
        self._logged = {}  # times by text

    def is_due(self, text, now):
        """Return whether a text may be logged at a steady time [s], and count it as logged then."""
        text = without_numbers(text)
        self._logged = {logged: at for logged, at in self._logged.items() if now - at < LOG_PERIOD}
        is_due = text not in self._logged
        self._logged.setdefault(text, now)
        return is_due


class StatusLog:
    """Choose lines of a log: one when a fault begins, and one when it ends.

    Faults of a status have at most one line in `period` [s], unless the level rises; the next line
    says how often they began. The end follows no sooner, and is left out after less than
    MIN_DURATION.
    """

    def __init__(self, period=LOG_PERIOD):
        self._period, self._entries = period, {}

    def lines(self, statuses, now):
        """Return level and text of each line that is due at a steady time [s]."""
        lines = (self._line(status, now) for status in statuses)
        return [line for line in lines if line]

    def _line(self, status, now):
        entry = self._entries.setdefault(status.name, _Entry())
        entry.update(status, now)
        if status.level == STALE and not entry.texts:  # no end of a fault
            return None
        level = OK if status.level == STALE else status.level
        elapsed = now - entry.logged_at
        if elapsed >= self._period:
            entry.logged_level = OK
        elif level <= entry.logged_level:
            return None
        was_open, entry.is_open = entry.is_open, level != OK
        if entry.texts:
            text = entry.describe(elapsed) + ("; ended" if level == OK else "")
            entry.texts.clear()
            entry.logged_at, entry.logged_level = now, max(level, WARN)
            return entry.logged_level, f"{status.name}: {text}"
        if was_open and not entry.is_open and entry.duration >= MIN_DURATION:
            entry.logged_at = now
            return OK, f"{status.name}: {status.message} (after {entry.duration:.0f} s)"
        return None
