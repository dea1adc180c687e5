# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How much tests try: by default always the same few cases, so that a run is short and repeatable.

`make test-all` runs all cases and the full times. To have hypothesis look at a hundred times as many examples, and at others
each time: `pytest --hypothesis-profile=thorough test/…`
"""

import os
from itertools import islice

from hypothesis import HealthCheck, settings

settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,  # the first example of a process waits for compiled code
    database=None,
    max_examples=100,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.register_profile("thorough", settings.get_profile("repeatable"), derandomize=False, max_examples=10_000)
settings.load_profile("repeatable")


def examples(count: int) -> settings:
    """Return the settings of a test that tries this many examples, or the profile's multiple of that."""
    return settings(max_examples=count * settings().max_examples // 100)


ALL = os.environ.get("DIAG_DYNAMICS_TEST_ALL") == "1"
"""Whether all cases are wanted."""


def some_of(cases, stride):
    """Return every `stride`-th case, or all of them; a stride should have no common factor with what cases repeat by."""
    return islice(cases, 0, None, 1 if ALL else stride)


def shortened(full, short):
    """Return how long or how often something runs: `short`, where not all is wanted."""
    return full if ALL else short
