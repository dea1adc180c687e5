# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A short soak: what goes in, what is refused and what comes out add up, all of it is right, and nothing grows.

DIAG_DYNAMICS_SOAK_SECONDS makes it as long as wanted, DIAG_DYNAMICS_SOAK_SEED another one.
"""

import os

import pytest

from soak import check, soak

SECONDS = float(os.environ.get("DIAG_DYNAMICS_SOAK_SECONDS", "15"))
SEED = int(os.environ.get("DIAG_DYNAMICS_SOAK_SEED", "1"))


@pytest.fixture(scope="module")
def outcome(peer, ros_domain):
    """Run it once."""
    return soak(peer, ros_domain, SEED, SECONDS)


def test_everything_is_accounted_for(outcome):
    """Every message has one outcome, each fault its counter, every published state is Pinocchio's."""
    check(outcome)


def test_nothing_grows(outcome):
    """Neither memory, once it has settled, nor threads nor file descriptors.

    A leak of a single JointState (1 kB) a message would be 1 MB a second; the allocator's own restlessness is far from that.
    """
    settled = outcome.usage[len(outcome.usage) // 3]
    last = outcome.usage[-1]
    assert last.memory - settled.memory < 0.4 * (last.time - settled.time)
    assert last.threads <= settled.threads
    assert last.descriptors <= settled.descriptors
