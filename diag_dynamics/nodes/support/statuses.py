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

MIN_SHORT = 3
"""Number of shorter faults in LOG_PERIOD that are logged."""

NO_FAULT = OK, ""

_MEASURED = re.compile(
    r"'[^']*'|= [^\s,;]+|(?<!\w)\["
    r"|(?<![\w/.^])(?<!\w\[)(?<![^\W\d]-)[-+±]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w/])"
)

_OPEN_END = re.compile(r"(?:[\s:,;(<>=~]|\b(?:is|are|has|for|by|of|to|from|than|at|within))+$")


class Status(NamedTuple):
    """One entry: its name after the node's, level, message, and values by key.

    The message stays the same while a fault lasts; `log` is one with its numbers. `is_logged` is
    whether the node has logged the begin of this fault. `age` is how long it had lasted at its
    first report [s].
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

    Numbers of parameters (``name = number``), indices and those within names stay. The text stays
    whole if no word without quotes would be left.
    """
    measured = (number for number in _MEASURED.finditer(text) if number[0][0] not in "'=")
    first = next(measured, None)
    start = _OPEN_END.sub("", text[: first.start()]) if first else text
    return start if re.search(r"\w", re.sub("'[^']*'", "", start)) else text


def problem_status(name, problems, message, values, is_logged=False):
    """Return a status that warns of problems, texts with numbers.

    Without problems it has the message.
    """
    if not problems:
        return Status(name, OK, message, values)
    stable = "; ".join(map(without_numbers, problems))
    return Status(name, WARN, stable, values, "; ".join(problems), is_logged)


class _Entry:
    """Fault of one status, and the texts of faults since the last line; times are steady [s].

    `_pending` is the text of a fault that has not lasted for MIN_DURATION.
    """

    def __init__(self):
        self.fault = NO_FAULT
        self.texts = {}
        self._pending = ""
        self._short = []
        self.begins = self.duration = 0.0
        self.logged_at = -inf
        self.logged_level = OK
        self.is_open = False

    def update(self, status, now):
        """Store a change of the fault, and count faults that last or come often."""
        is_fault = status.level in (WARN, ERROR)
        fault = (status.level, status.message if is_fault else "")
        if fault != self.fault:
            self._change(status, is_fault, now)
            self.fault = fault
        if self._pending and now - self.begins >= MIN_DURATION:
            self._count(self._pending)
            self._pending = ""

    def _change(self, status, is_fault, now):
        if is_fault:
            if self.fault[0] not in (WARN, ERROR):
                self.begins = now - status.age
            self._pending = "" if status.is_logged else status.log or status.message
            return
        if status.level == OK:
            self.duration = now - self.begins
        if self._pending:  # no report after MIN_DURATION had it
            recent = [(at, text) for at, text in self._short if now - at < LOG_PERIOD]
            self._short = [*recent, (now, self._pending)]
            self._pending = ""
        if len(self._short) >= MIN_SHORT:
            for _, text in self._short:
                self._count(text)
            self._short = []

    def _count(self, text):
        self.texts[text] = self.texts.pop(text, 0) + 1  # the newest is the last one

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

    A fault has a line after MIN_DURATION. Faults of a status have at most one line in `period` [s],
    unless the level rises; the next line says how often they began. The end follows no sooner.
    Shorter faults have no line, unless there are MIN_SHORT in LOG_PERIOD.
    """

    def __init__(self, period=LOG_PERIOD):
        self._period = period
        self._entries = {}

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
        was_open = entry.is_open
        has_line = was_open or status.is_logged or bool(entry.texts)
        entry.is_open = level != OK and has_line
        if entry.texts:
            text = entry.describe(min(elapsed, self._period)) + ("; ended" if level == OK else "")
            entry.texts.clear()
            entry.logged_at = now
            entry.logged_level = max(level, WARN)
            return entry.logged_level, f"{status.name}: {text}"
        if was_open and not entry.is_open and entry.duration >= MIN_DURATION:
            entry.logged_at = now
            return OK, f"{status.name}: {status.message} (after {entry.duration:.0f} s)"
        return None
