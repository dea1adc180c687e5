# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decision table of the rules of joint states: parameters and messages in, states, causes and counters out.

A case lists messages in order, each with its expected outcome. The table holds no code of the library: messages are bytes
by rosbags, parameters have the monitor's names, expected states are numbers. `joint_state_readers.py` runs it.
"""

from joint_state_source_cases import SOURCE_CASES
from joint_state_time_cases import AGE_CASES, CLOCK_CASES, ODOMETRY_CASES, ORDER_CASES
from joint_state_value_cases import (
    EFFORT_CASES,
    ESTIMATE_CASES,
    LIMIT_CASES,
    MIMIC_CASES,
    NAME_CASES,
    NUMBER_CASES,
    STEP_CASES,
)

TABLE = {
    "names": NAME_CASES,
    "numbers": NUMBER_CASES,
    "order of stamps": ORDER_CASES,
    "clock": CLOCK_CASES,
    "age": AGE_CASES,
    "plausibility": LIMIT_CASES,
    "efforts": EFFORT_CASES,
    "mimic joints": MIMIC_CASES,
    "jumps": STEP_CASES,
    "interleaved sources": SOURCE_CASES,
    "estimated velocities": ESTIMATE_CASES,
    "odometry": ODOMETRY_CASES,
}
"""All cases, by rule."""

COUNTERS = sorted(
    {
        counter
        for cases in TABLE.values()
        for one in cases
        for step in one.steps
        for counter in (step.outcome, *step.also)
    }
    - {"odometry"}
)
"""Every counter that the table raises."""


def wiring(counter):
    """Return the shortest case that raises a counter."""
    cases = (one for cases in TABLE.values() for one in cases)
    raising = (
        one for one in cases if any(counter in (step.outcome, *step.also) for step in one.steps)
    )
    return min(raising, key=lambda one: len(one.steps))


WIRING = {counter: wiring(counter) for counter in COUNTERS}
"""Case by counter: one test of a node's wiring for each."""
