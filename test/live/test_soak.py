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
def outcome(peer, ros_domain):
    """Run it once."""
    return soak(peer, ros_domain, SEED, SECONDS)


def test_everything_is_accounted_for(outcome):
    """Every message has one outcome, each fault its counter, every published state is Pinocchio's."""
    check(outcome)


def test_nothing_grows(outcome, peer, ros_domain):
    """Neither memory, once it has settled, nor threads nor file descriptors.

    A leak of a single JointState (1 kB) a message would be 1 MB a second; the allocator's own restlessness is far from that.
    Queues fill while a busy machine has no time for the monitor, in some soak or other; a leak is one in each.
    """
    for _ in range(2):
        if not grown(outcome):
            break
        outcome = soak(peer, ros_domain, SEED, SECONDS)
    settled, last = settled_and_last(outcome)
    assert not grown(outcome), (settled, last)
    assert last.threads <= settled.threads
    assert last.descriptors <= settled.descriptors


def settled_and_last(outcome):
    """What the monitor holds once its pools are filled, and in the end."""
    return outcome.usage[len(outcome.usage) // 3], outcome.usage[-1]


def grown(outcome):
    """Whether memory has grown from then on by 0.4 MB a second, or more."""
    settled, last = settled_and_last(outcome)
    return last.memory - settled.memory >= 0.4 * (last.time - settled.time)
