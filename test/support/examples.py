# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How much the tests try. The gate tries few robots and examples; the full tier tries all.

`--robots=all` selects every robot and the full durations. `--hypothesis-profile=full` selects every
example; `--hypothesis-profile=thorough` draws a hundred times as many, others in each run.
"""

from itertools import islice

from hypothesis import HealthCheck, settings

GATE_EXAMPLES = 25

settings.register_profile(
    "gate",
    derandomize=True,
    deadline=None,  # the first example of a process waits for compiled code
    database=None,
    max_examples=GATE_EXAMPLES,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.register_profile("full", settings.get_profile("gate"), max_examples=100)
settings.register_profile(
    "thorough", settings.get_profile("gate"), derandomize=False, max_examples=10_000
)
settings.load_profile("gate")

_all_robots = False


def select_robots(which):
    """Select "few" or "all" robots; called by conftest.py before it collects tests."""
    global _all_robots
    _all_robots = which == "all"


def all_robots_selected():
    """Return whether the full tier runs."""
    return _all_robots


def examples(count):
    """Return hypothesis settings: `count` examples in the full tier, at most GATE_EXAMPLES in the
    gate.
    """
    chosen = settings().max_examples
    return settings(
        max_examples=min(count, chosen) if chosen == GATE_EXAMPLES else count * chosen // 100
    )


def some_of(cases, stride):
    """Return a list of every `stride`-th case in the gate, of all cases in the full tier."""
    return list(islice(cases, 0, None, 1 if _all_robots else stride))


def shortened(full, short):
    """Return a duration or a count: `short` in the gate, `full` in the full tier."""
    return full if _all_robots else short
