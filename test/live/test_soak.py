# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A short soak: what goes in, what is refused and what comes out add up, all of it is right, and nothing grows.

DIAG_DYNAMICS_SOAK_SECONDS makes it as long as wanted, DIAG_DYNAMICS_SOAK_SEED another one.
"""

import os

import pytest

from soak import check, soak

pytestmark = [pytest.mark.full, pytest.mark.live]

SECONDS = float(os.environ.get("DIAG_DYNAMICS_SOAK_SECONDS", "15"))
SEED = int(os.environ.get("DIAG_DYNAMICS_SOAK_SEED", "1"))


@pytest.fixture(scope="module")
def outcome(peer):
    """Run it once."""
    return soak(peer, SEED, SECONDS)


def test_everything_is_accounted_for(outcome):
    """Every message has one outcome, each fault its counter, every published state is Pinocchio's."""
    check(outcome)


def test_nothing_grows(outcome, peer):
    """Threads and descriptors are constant, memory grows by less than 0.4 MB a second once pools are filled.

    A leak of one JointState (1 kB) a message is 1 MB a second, in each soak; on a busy machine queues fill in some.
    """
    for attempt in range(3):
        settled, last = outcome.usage[len(outcome.usage) // 3], outcome.usage[-1]
        assert last.threads <= settled.threads and last.descriptors <= settled.descriptors
        if last.memory - settled.memory < 0.4 * (last.time - settled.time):
            return
        outcome = soak(peer, SEED + attempt, SECONDS)
    pytest.fail(f"memory grew from {settled} to {last}")
