# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statuses of /diagnostics: texts without measured numbers, and the lines of the log about them."""

import pytest

from diag_dynamics.nodes.support.statuses import (
    ERROR,
    OK,
    STALE,
    WARN,
    RepeatLimit,
    Status,
    StatusLog,
    without_numbers,
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("position of joint 'joint 1' is 12.5; expected 3", "position of joint 'joint 1'"),
        (
            "the state is too old: 0.034 s; expected at most max_age = 0.02 s",
            "the state is too old",
        ),
        ("no command for command_timeout = 0.5 s", "no command for command_timeout = 0.5 s"),
        ("target.pose.position is [nan, -1e-05, 2]", "target.pose.position"),
        ("stamp of panda_link0 is 17.5 s behind /robot1/clock", "stamp of panda_link0"),
        ("trajectory.points[1].positions is 0.5 rad", "trajectory.points[1].positions"),
        ("3 joints lack data", "3 joints lack data"),
        ("'a' at 0.5 rad", "'a' at 0.5 rad"),
        ("arm-1, arm-2 are stuck at 0.5 rad", "arm-1, arm-2 are stuck"),
        ("position of 'a' is nan; expected a number", "position of 'a' is nan; expected a number"),
    ],
)
def test_messages_have_no_measured_numbers(text, expected):
    """A message ends before the first of them; numbers of parameters and in names stay."""
    assert without_numbers(text) == expected == without_numbers(expected)


def lines_of(*events):
    """Return time, level and text of the lines about a status `x`, of events: time, level,
    message.
    """
    log = StatusLog(period=10.0)
    return [
        (time, *line)
        for time, level, message in events
        for line in log.lines([Status("x", level, message, log=f"{message} 7")], time)
    ]


def every_second(*phases):
    """Return events of phases: level, message and number of seconds."""
    statuses = [phase[:2] for phase in phases for _ in range(phase[2])]
    return [(float(time), *status) for time, status in enumerate(statuses)]


def bad(seconds, text="bad"):
    return WARN, text, seconds


def fine(seconds):
    return OK, "fine", seconds


def unknown(seconds):
    return STALE, "no state", seconds


BEGIN = 1.0, WARN, "x: bad 7"
"""Line of a status that is bad from the first second on."""


@pytest.mark.parametrize(
    ("phases", "expected"),
    [
        ([fine(99)], []),
        ([unknown(99)], []),
        (
            [bad(20), unknown(20), bad(20), unknown(9)],
            [BEGIN, (41.0, WARN, "x: bad 7")],
        ),
        (
            [bad(20), unknown(20), fine(20)],
            [BEGIN, (40.0, OK, "x: fine (after 40 s)")],
        ),
        ([fine(3), bad(50)], [(4.0, WARN, "x: bad 7")]),
        (
            [bad(20), fine(30)],
            [BEGIN, (20.0, OK, "x: fine (after 20 s)")],
        ),
        (
            [bad(3), fine(30)],
            [BEGIN, (11.0, OK, "x: fine (after 3 s)")],
        ),
        (
            [bad(3), bad(30, "worse")],
            [BEGIN, (11.0, WARN, "x: worse 7")],
        ),
        (
            [bad(3), bad(3, "worse"), bad(30)],
            [BEGIN, (11.0, WARN, "x: bad 7; before: worse 7")],
        ),
        (
            [bad(20), fine(1), bad(30)],
            [BEGIN, (20.0, OK, "x: fine (after 20 s)"), (22.0, WARN, "x: bad 7")],
        ),
        (
            [bad(3), (ERROR, "fatal", 3), bad(24)],
            [BEGIN, (3.0, ERROR, "x: fatal 7"), (13.0, WARN, "x: bad 7")],
        ),
        ([bad(1), fine(6)] * 9, []),
        (
            [bad(1), fine(1)] * 4 + [fine(30)],
            [(5.0, WARN, "x: bad 7 (3 times in 10 s); ended")],
        ),
    ],
)
def test_lines_of_a_log(phases, expected):
    """One after a second and one at the end, a rise of the level at once, else one in ten
    seconds.
    """
    assert lines_of(*every_second(*phases)) == expected


def test_fault_that_began_before_its_first_report():
    """It has a line as soon as it has lasted for a second."""
    log = StatusLog()
    assert log.lines([Status("x", WARN, "bad", age=0.5)], 7.0) == []
    assert log.lines([Status("x", WARN, "bad", age=0.9)], 7.4) == [(WARN, "x: bad")]


def test_fault_that_the_node_has_logged():
    """Its begin has no second line; its end has one."""
    log = StatusLog(period=10.0)
    fault = Status("x", WARN, "hit", is_logged=True)
    assert log.lines([fault], 0.0) == log.lines([fault], 5.0) == []
    assert log.lines([Status("x", OK, "free")], 12.0) == [(OK, "x: free (after 12 s)")]
    statuses = [fault, Status("x", OK, "free")]
    times = [at for at in range(14, 40, 2) if log.lines([statuses[at // 2 % 2 - 1]], float(at))]
    assert times == [24, 36]  # one in ten seconds


def test_repeated_events():
    """Another event has a line at once, an equal one after ten seconds."""
    limit = RepeatLimit()
    events = [(0.0, "a"), (0.5, "b"), (1.0, "b"), (9.9, "a"), (10.0, "a")]
    times = [at for at, name in events if limit.is_due(f"position of '{name}' is {at}", at)]
    assert times == [0.0, 0.5, 10.0]


def test_statuses_have_lines_of_their_own():
    """A line about one status does not delay that about another one."""
    log = StatusLog()
    assert log.lines([Status("a", WARN, "bad")], 0.0) == []
    assert log.lines([Status("a", WARN, "bad")], 1.0) == [(WARN, "a: bad")]
    both = [Status("a", WARN, "bad"), Status("b", ERROR, "bad")]
    assert log.lines(both, 2.0) == []
    assert log.lines(both, 3.0) == [(ERROR, "b: bad")]
