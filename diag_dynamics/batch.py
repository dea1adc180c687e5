# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many states at once: cut into pieces, each evaluated by a thread of its own, without the interpreter's lock."""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.arrays import Array, MatrixLike
from diag_dynamics.checks import has_names, in_order
from diag_dynamics.exceptions import InputError

PIECES = 4
"""Pieces for each thread: one that is held up leaves its share to the others."""

LEAST = 256
"""States that are worth a piece: fewer are done before another thread has begun."""


def cores():
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def states(name: str, value: MatrixLike, names: Sequence[str], length: int | None = None) -> Array:
    """An argument as a contiguous float64 array with a row for each state.

    Raises
    ------
    InputError
        It is not an array of numbers of shape (T, len(names)), T being `length` where that is given.
    """
    value = in_order(name, value, names)
    if isinstance(value, (list, tuple)) and any(has_names(row) or isinstance(row, Mapping) for row in value):
        value = [in_order(f"{name}[{t}]", row, names) for t, row in enumerate(value)]
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} is not an array of numbers: {error}.") from error
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name} is not an array of numbers: it has dtype {array.dtype}.")
    if array.ndim != 2 or array.shape[1] != len(names) or length not in (None, len(array)):
        rows = "T" if length is None else length
        raise InputError(f"{name} has shape {array.shape}, expected ({rows}, {len(names)}): a row for each state.")
    return np.ascontiguousarray(array, dtype=np.float64)


class Workspaces:
    """Those of one robot that no thread is using; making one takes as long as some hundred states."""

    def __init__(self, model):
        self._model, self._idle = model, []

    def take(self):
        """One for the calling thread alone."""
        try:
            return self._idle.pop()
        except IndexError:
            return sweeps.BatchWorkspace(self._model.bodies, self._model.gravity, sweeps.ROW_NUMBERS)

    def give_back(self, workspace):
        """Say that a workspace is not in use any more."""
        self._idle.append(workspace)


def evaluate(workspaces, Q, QD, TAU, memory, threads):
    """Fill `memory` with what sweeps.evaluate gives at each state.

    Parameters
    ----------
    workspaces : Workspaces
    Q, QD, TAU : ndarray
        As :func:`states` returns them; TAU may have one row for all.
    memory : results.BatchMemory
    threads : int

    Returns
    -------
    range
        States one of which fails; empty if none does.
    """

    def sweep(robot, first, last):
        return sweeps.evaluate_many(robot, Q, QD, TAU, first, last, *memory)

    return in_pieces(workspaces, len(Q), sweep, threads, sweeps.WIDTH)


def in_pieces(workspaces, count, sweep, threads, width=1):
    """Have threads sweep over pieces of many states.

    Parameters
    ----------
    workspaces : Workspaces
    count : int
        Number of states.
    sweep : callable
        Called with a robot, the first and the end of the states of a piece; returns the end of what it has done. The
        interpreter's lock is not held meanwhile, if it calls what lets it go.
    threads : int
    width : int
        States that it does, or fails to do, together.

    Returns
    -------
    range
        States one of which fails; empty if none does.
    """

    def piece(first, last):
        own = workspaces.take()
        done = sweep(own.robot, first, last)
        workspaces.give_back(own)
        return range(done, min(done + width, last))

    def work():
        """Evaluate pieces, the first before the later ones, until none is left or one fails; returns states that do."""
        failing = range(0)
        while pieces and not failing:
            try:
                first, last = pieces.pop()
            except IndexError:  # another thread was faster
                break
            failing = piece(first, last)
        return failing

    count_of_pieces = min(PIECES * threads, count // LEAST) if threads > 1 else 1
    cuts = np.linspace(0, count, max(1, count_of_pieces) + 1, dtype=int).tolist()
    pieces = list(itertools.pairwise(cuts))[::-1]
    helpers = min(threads, len(pieces)) - 1
    if helpers <= 0:
        return work()
    shared, others = [work], []
    try:
        for _ in range(helpers):
            others.append(_helpers().submit(_help, shared))
        failing = [work()]  # the calling thread is one of them
        failing += [other.result() for other in others if not other.cancel()]
    finally:
        pieces.clear()
        shared.clear()  # else a helper that has not begun would hold the memory of results
        _wait_for(others)
    return min((found for found in failing if found), key=lambda found: found[0], default=range(0))


def _wait_for(others):
    """Wait until no helper is at work: after a Ctrl-C it would go on writing to memory that the caller may use again.

    Another Ctrl-C ends the wait no sooner.
    """
    try:
        wait(others)
    finally:
        if not all(other.done() for other in others):
            _wait_for(others)


def _help(shared):
    for work in shared:
        return work()
    return range(0)


MOST = 1024
"""Threads of one process that help at most; they are made when they are needed, and kept."""


@functools.cache
def _helpers():
    """Threads that help, of this process: starting one anew takes as long as some hundred states."""
    return ThreadPoolExecutor(MOST, thread_name_prefix="diag_dynamics")


if hasattr(os, "register_at_fork"):
    # Threads do not survive a fork. Without this line a child would wait for its parent's.
    os.register_at_fork(after_in_child=_helpers.cache_clear)
