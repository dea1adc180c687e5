"""Many states at once: cut into pieces, each evaluated by a thread of its own, without the interpreter's lock."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.exceptions import InputError
from diag_dynamics.lanes import WIDTH

PIECES = 4
"""Pieces for each thread: one that is held up leaves its share to the others."""

LEAST = 64
"""States that are worth a piece."""


def cores():
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def states(name, value, names, length=None):
    """An argument as a contiguous float64 array with a row for each state.

    Raises
    ------
    InputError
        It is not an array of numbers of shape (T, len(names)), T being `length` where that is given.
    """
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} is not an array of numbers: {error}.") from error
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name} is not an array of numbers: it has dtype {array.dtype}.")
    if array.ndim != 2 or array.shape[1] != len(names) or length not in (None, len(array)):
        rows = "T" if length is None else length
        raise InputError(f"{name} has shape {array.shape}, expected ({rows}, {len(names)}): a row for each state.")
    array = np.ascontiguousarray(array, dtype=np.float64)
    return array if array.flags.writeable else array.copy()  # compiled code takes no array that is read-only


def evaluate(model, Q, QD, TAU, states, threads):
    """Fill `states`, shape (T, sweeps.ROWS, nq), with what sweeps.evaluate gives.

    Parameters
    ----------
    Q, QD, TAU : ndarray
        As :func:`states` returns them; TAU may have one row for all.
    states : ndarray
    threads : int

    Returns
    -------
    range
        States one of which fails; empty if none does.
    """
    count = len(Q)

    def piece(first, last):
        part = slice(first, last)
        tau = TAU if len(TAU) < count else TAU[part]
        own = sweeps.WideWorkspace(model.bodies, model.gravity)
        done = first + sweeps.evaluate_many(own.robot, Q[part], QD[part], tau, states[part])
        return range(done, min(done + WIDTH, last))

    cuts = np.linspace(0, count, max(1, min(PIECES * threads, count // LEAST)) + 1, dtype=int)
    if len(cuts) == 2 or threads == 1:
        failing = [piece(0, count)]
    else:
        with ThreadPoolExecutor(threads) as pool:
            failing = list(pool.map(piece, cuts[:-1], cuts[1:]))
    return next((found for found in failing if found), range(0))
