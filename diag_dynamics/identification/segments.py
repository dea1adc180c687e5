# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs of states that a filter can go through, in portions: memory does not grow with the length of a recording."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

SIZE = 20_000
"""States of a portion; of what is left at the end of a segment, half as many at least and half as many again at most."""


class Segment(NamedTuple):
    """States one after the other, without gaps."""

    stamp: np.ndarray
    """[ns], int64, shape (T,), rising."""
    t: np.ndarray
    """[s], from the first state of the recording; rising over all its segments, though stamps began anew in between."""
    q: np.ndarray
    """[rad, m], shape (T, nq)."""
    qd: np.ndarray
    """[rad/s, m/s], shape (T, nv)."""
    tau: np.ndarray
    """[N m, N], shape (T, nv)."""

    def part(self, which):
        """States of a slice or mask."""
        return Segment(*(np.ascontiguousarray(column[which]) for column in self))

    @classmethod
    def together(cls, parts):
        """All states of several parts."""
        return parts[0] if len(parts) == 1 else cls(*map(np.concatenate, zip(*parts, strict=True)))


class Portion(NamedTuple):
    """Some states of a segment; the next ones follow in the next portion, or begin another segment."""

    states: Segment
    begins: bool
    """Whether no state of the segment came before."""


def in_portions(portions, size=SIZE):
    """Yield the same states in portions of about a size, which do not depend on those that they came in."""
    held: list[Segment] = []
    number, begins = 0, True
    for states, anew in portions:
        if anew:
            if held:
                yield Portion(Segment.together(held), begins)
            held, number, begins = [], 0, True
        held.append(states)
        number += len(states.t)
        while 2 * number >= 3 * size:
            whole = Segment.together(held)
            yield Portion(whole.part(slice(size)), begins)
            held, number, begins = [whole.part(slice(size, None))], number - size, False
    if held:
        yield Portion(Segment.together(held), begins)


def without_delay(portions, delay):
    """Yield portions whose velocities are those of the time of their positions; ends that have none are cut off.

    Parameters
    ----------
    portions : iterable of Portion
    delay : float
        Of velocities against positions [s].
    """
    if not delay:
        yield from portions
        return
    held, start, done, first = (
        None,
        0.0,
        0,
        True,
    )  # `done` of the states that are held were handed out, or have no velocity
    for states, begins in portions:
        if begins:
            held, start, done, first = states, states.t[0], 0, True
        else:
            held = Segment.together([held, states])
        at = held.t[done:] + delay
        ready = int(np.searchsorted(at, held.t[-1], side="right"))
        known = np.arange(done, done + ready)[at[:ready] >= start]
        if len(known):
            at = held.t[known] + delay
            velocities = np.column_stack([np.interp(at, held.t, column) for column in held.qd.T])
            yield Portion(held.part(known)._replace(qd=velocities), first)
            first = False
        done += ready
        wanted = held.t[min(done, len(held.t) - 1)] + delay
        past = min(max(0, int(np.searchsorted(held.t, wanted, side="right")) - 1), done)
        held, done = held.part(slice(past, None)), done - past


def since(portions, begin):
    """Yield what of portions is not before a time [s]; the segment that it falls into begins there."""
    passed = False
    for states, begins in portions:
        passed = passed and not begins
        if states.t[-1] >= begin:
            yield Portion(states.part(slice(int(np.searchsorted(states.t, begin)), None)), not passed)
            passed = True
