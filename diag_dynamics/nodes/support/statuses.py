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

MIN_DURATION = 0.9
"""Minimum duration of a fault that is logged: two reports, a second apart with jitter [s]."""

_MEASURED = re.compile(
    r"'[^']*'|= [^\s,;]+|\[|(?<![\w/.^])(?<![^\W\d]-)[-+±]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w/])"
)

_OPEN_END = re.compile(r"(?:[\s:,;(<>=~]|\b(?:is|are|has|for|by|of|to|from|than|at|within))+$")


class Status(NamedTuple):
    """One entry: its name after the node's, level, message, and values by key.

    The message stays the same while a fault lasts; `log` is one with its numbers. `is_logged`: the
    node has logged the begin of this fault. `age` is how long it had lasted at its first report [s].
    """

    name: str
    level: bytes
    message: str
    values: Mapping = {}
    log: str = ""
    is_logged: bool = False
    age: float = 0.0


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
    """Fault of one status and what the log has of it; times are steady [s].

    `text` is that of a fault without a line, `is_open` whether the log has a begin without an end.
    """

    fault, text, is_open = (OK, ""), "", False
    begins = duration = 0.0
    logged_at, logged_level = -inf, OK


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

    A fault has a line if it lasts for MIN_DURATION. A status has at most one line in `period` [s],
    of its newest fault, unless the level rises. The end follows no sooner.
    """

    def __init__(self, period=LOG_PERIOD):
        self._period, self._entries = period, {}

    def lines(self, statuses, now):
        """Return level and text of each line that is due at a steady time [s]."""
        lines = (self._line(status, now) for status in statuses)
        return [line for line in lines if line]

    def _line(self, status, now):
        entry = self._entries.setdefault(status.name, _Entry())
        is_fault = status.level in (WARN, ERROR)
        fault = status.level, status.message if is_fault else ""
        if fault != entry.fault:
            if is_fault and entry.fault[0] not in (WARN, ERROR):
                entry.begins = now - status.age
            has_line = status.is_logged or not is_fault
            entry.text = "" if has_line else status.log or status.message
            entry.fault, entry.duration = fault, now - entry.begins
        entry.is_open |= is_fault and status.is_logged
        is_due = now - entry.logged_at >= self._period
        lasts = now - entry.begins >= MIN_DURATION
        if entry.text and lasts and (is_due or status.level > entry.logged_level):
            line, entry.text, entry.is_open = f"{status.name}: {entry.text}", "", True
            entry.logged_at, entry.logged_level = now, status.level
            return status.level, line
        if not (entry.is_open and is_due and status.level == OK):
            return None
        entry.is_open = False
        if entry.duration < MIN_DURATION:
            return None
        entry.logged_at, entry.logged_level = now, OK
        return OK, f"{status.name}: {status.message} (after {entry.duration:.0f} s)"
