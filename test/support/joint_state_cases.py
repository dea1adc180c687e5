# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decision table of the rules of joint states: parameters and messages in, states, causes and
counters out.

joint_states.yaml has the cases and describes their notation. It holds nothing of the library:
messages become bytes by rosbags, parameters have the monitor's names, expected states are numbers.
`joint_state_readers.py` runs the table.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import yaml

from joint_state_messages import IN_PLACE, MIMICS, MS, NAMES, NAN, NOW, S, joint_state, odometry

FILE = Path(__file__).with_name("joint_states.yaml")


class Step(NamedTuple):
    """A message, its time of reception, and its expected outcome."""

    raw: bytes
    outcome: str
    """published, a counter, or "rejected: <cause>"."""
    state: Mapping | None
    """Expected fields of the published state."""
    also: tuple
    """Further counters that it raises."""
    words: tuple
    """Parts of the text of the rejection."""
    now: int
    odometry: bool


class Case(NamedTuple):
    """Messages for a robot with some parameters."""

    name: str
    steps: tuple
    parameters: Mapping
    robot: str


OUTCOMES = (
    "published",
    "published from odometry",
    "odometry",
    "incomplete",
    "foreign",
    "empty",
    "followers only",
    "awaiting velocity",
    "before odometry",
)
"""Outcomes that are no cause of a rejection."""


def time_of(milliseconds):
    """Return the time [ns] that is so much later than NOW."""
    return NOW + round(MS * milliseconds)


def listed(value):
    """Return a list, or one value, as a tuple."""
    return tuple(value) if isinstance(value, list) else (value,)


def fields_of(row):
    """Return names, positions, velocities and efforts of a message."""
    names = [] if "mimics_only" in row else row.get("names", NAMES)
    base = [
        row.get("shift", 0.0) + NAMES.index(name) + 1.0 if name in NAMES else NAN for name in names
    ]
    seconds = 1e-3 * row.get("at", 0.0)
    rates = row.get("rates")
    position = row.get("position", base)
    velocity = row.get("velocity", [10.0 * x for x in base] if rates is None else rates)
    effort = row.get("effort", [100.0 * x for x in base])
    if rates is not None:
        position = [x + rate * seconds for x, rate in zip(position, rates, strict=True)]
    mimics = row.get("mimics", row.get("mimics_only"))
    if mimics is None:
        return names, position, velocity, effort
    places = dict(zip(names, position, strict=True)) | IN_PLACE | mimics
    efforts = dict(zip(names, effort, strict=True))
    mimic_effort = row.get("mimic_effort", [0.0] * 3 if names else None)
    if mimic_effort is not None:
        efforts |= dict(zip(MIMICS, mimic_effort, strict=True))
    speeds = dict(zip(names, velocity, strict=True))
    order = sorted(places)
    return (
        order,
        [places[name] for name in order],
        [speeds.get(name, NAN) for name in order],
        [efforts[name] for name in order] if efforts else [],
    )


def state_of(row, stamp, now):
    """Return the state of a message with all joints: its values, in the order of the model."""
    names, *values = fields_of({key: value for key, value in row.items() if key != "mimics"})
    if set(names) != set(NAMES):
        return {}
    state = {"received": stamp == 0, "estimated": False}
    state["newest"] = state["oldest"] = now if stamp == 0 else stamp
    for field, numbers in zip(("position", "velocity", "effort"), values, strict=True):
        if len(numbers) == 3 and all(map(math.isfinite, numbers)):
            state[field] = [numbers[names.index(name)] for name in NAMES]
        elif field == "effort":
            state[field] = None
    return state


def step_of(row):
    """Return the step of a row."""
    stamp = row.get("stamp", time_of(row.get("at", 0.0)) + row.get("ns", 0))
    now = time_of(row.get("received", 0.0))
    if isinstance(stamp, list):
        stamp = tuple(stamp)
    is_odometry = "odometry" in row
    usual = "followers only" if "mimics_only" in row else "published"
    outcome = row.get("is", "odometry" if is_odometry else usual)
    state = dict(row.get("state", {}))
    for name in ("newest", "oldest"):
        if name in state:
            state[name] = time_of(state[name])
    if is_odometry:
        raw = odometry(stamp, **row["odometry"])
    elif "bytes" in row:
        raw = row["bytes"]
    else:
        raw = joint_state(*fields_of(row), stamp, order=row.get("order", "<"))
        newest = stamp[0] * S + stamp[1] if isinstance(stamp, tuple) else stamp
        state = state_of(row, newest, now) | state
    if outcome not in OUTCOMES:
        outcome = f"{'odometry ' * is_odometry}rejected: {outcome}"
    also, words = (listed(row.get(key, [])) for key in ("also", "words"))
    published = outcome.startswith("published")
    return Step(raw, outcome, state if published else None, also, words, now, is_odometry)


def repeated(row):
    """Return copies of a row, each later than the one before it."""
    copies = []
    for k in range(row.get("times", 1)):
        later = {key: row[key] + k * row["every"] for key in ("at", "received") if k and key in row}
        copies.append(row | later)
    return copies


def case_of(name, entry, rule):
    """Return a case; its entry is a list of rows, or has them beside parameters and the robot."""
    entry = {"steps": entry} if isinstance(entry, list) else entry
    message = rule.get("message", {}) | entry.get("message", {})
    sources = entry.get("sources", [entry.get("steps")])
    rows = []
    for source in sources:
        for row in entry.get("before", rule.get("before", [])) + source:
            rows += repeated(message | row)
    if "sources" in entry:
        rows.sort(key=lambda row: row["at"])
    for row in rows:
        row["state"] = message.get("state", {}) | row.get("state", {})
    parameters = rule.get("parameters", {}) | entry.get("parameters", {})
    robot = entry.get("robot", rule.get("robot", "arm"))
    return Case(name, tuple(map(step_of, rows)), parameters, robot)


def read_table():
    """Return all cases, by rule."""
    rules = yaml.load(FILE.read_text(encoding="utf-8"), yaml.CSafeLoader)
    return {
        name: [case_of(str(case), entry, rule) for case, entry in rule["cases"].items()]
        for name, rule in rules.items()
    }


TABLE = read_table()
"""All cases, by rule."""


def raises(case, counter):
    """Return whether a case raises a counter."""
    return any(counter in (step.outcome, *step.also) for step in case.steps)


CASES = [case for cases in TABLE.values() for case in cases]
COUNTERS = {
    counter for case in CASES for step in case.steps for counter in (step.outcome, *step.also)
}
COUNTERS = sorted(COUNTERS - {"odometry"})
"""Every counter that the table raises."""

WIRING = {}
"""Shortest case by counter: one test of the monitor's wiring for each. It accepts foreign time."""
for case in sorted(CASES, key=lambda case: len(case.steps)):
    if "refuse_foreign" not in case.parameters:
        WIRING = {counter: case for counter in COUNTERS if raises(case, counter)} | WIRING
