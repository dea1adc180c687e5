# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The highest rate of joint states that a node serves without loss."""

from typing import NamedTuple

LOSSLESS = 1e-3
"""Part of what was sent that may be lost at a rate that counts as lossless, the same for every node."""

TRIES = 3
"""How often a rate is tried, at most: a node that can serve it may be kept from it by others on the machine."""

CLIMB = 2**0.5
"""Factor from one rate to the next on the way up, before the limit is bisected."""


class Search(NamedTuple):
    """How thoroughly to look."""

    seconds: float = 1.0  # of a burst
    first: float = 1000.0  # Hz
    last: float = 23000.0
    bisections: int = 3
    beyond: int = 2  # rates above the limit, for the picture


BACKLOG = 20
"""Joint states that may wait at the end of a burst: more, and the node had fallen behind and lived on its queue."""


def lossless(burst):
    """Whether so little was lost, and so little waited at the end, that the rate counts as served."""
    return burst.loss <= LOSSLESS and burst.backlog <= BACKLOG


def highest(bursts):
    """The highest rate that was served [Hz], as it was sent, and who was the limit; 0 if none was."""
    served = max(
        (burst for burst in bursts if lossless(burst)), key=lambda burst: burst.rate, default=None
    )
    if served and not served.kept:
        return served.rate, served.limit
    rate = served.rate if served else 0.0
    above = [burst for burst in bursts if not lossless(burst) and burst.rate > rate]
    return rate, min(above, key=lambda burst: burst.rate).limit if above else "none"


def search(session, how):
    """Climb until messages are lost, bisect between the last rate that was served and that one; returns all bursts."""
    bursts = []

    def served(rate):
        for _ in range(TRIES):
            bursts.append(session.burst(rate, how.seconds))
            if lossless(bursts[-1]):
                return True
        return False

    low = high = how.first
    if served(low):
        while high < how.last and bursts[-1].kept:
            high = min(low * CLIMB, how.last)
            if not served(high):
                break
            low = high
    else:
        while low > how.first / 8 and not served(low := low / CLIMB):
            high = low
    for _ in range(how.bisections if high > low else 0):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if served(middle) else (low, middle)
    top = max(burst.asked for burst in bursts)
    bursts += [
        session.burst(top * CLIMB**k, how.seconds)
        for k in range(1, how.beyond + 1)
        if top * CLIMB**k < how.last
    ]
    return bursts
