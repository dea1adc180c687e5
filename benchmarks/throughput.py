"""Many states at once, on several threads."""

import os

import numpy as np
from cases import CLASSES
from peers import Parallel
from rows import Row
from timing import interleaved, ratio

OVER = "6–9 dof"

PAUSE = 0.02
"""Rest before a call [s]: OpenMP's threads keep a processor busy for a while after their work, which would slow others."""


def cores():
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads():
    """1, 2, 4, … and all."""
    return sorted({*(2**k for k in range(cores().bit_length()) if 2**k <= cores()), cores()})


def chosen(cases, pinocchios):
    """Those that are measured: the robots of the class that has a target, each with its peer."""
    return [pair for pair in zip(cases, pinocchios, strict=True) if pair[0].dof in CLASSES[OVER]]


def row(pairs, size, rounds):
    """The line of the table: time per state on all processors."""
    found = {}
    for case, pinocchio in pairs:
        times = interleaved(_calls(case, pinocchio, size, cores()), rounds, seconds=0.03, pause=PAUSE)
        found[case.label] = ratio(times["ours"], times["theirs"])
    return Row("`evaluate_batch` per state, all cores", "`pin.abaInParallel`, same threads", OVER, 0.4, found)


def curves(case, pinocchio, sizes, rounds):
    """States per second, by library and threads an array of one entry for each batch size."""
    calls = {}
    for count in threads():
        for size in sizes:
            both = _calls(case, pinocchio, size, count)
            calls["evaluate_batch", count, size] = both["ours"]
            calls["pin.abaInParallel", count, size] = both["theirs"]
    times = interleaved(calls, rounds, pause=PAUSE)
    lines = dict.fromkeys((name, count) for name, count, _ in calls)
    return {line: np.array([size / np.median(times[(*line, size)]) for size in sizes]) for line in lines}


def _calls(case, pinocchio, size, count):
    """One call of each, on the same states."""
    Q, QD, TAU = case.states(size)
    return {
        "ours": lambda: case.dynamics.evaluate_batch(Q, QD, TAU, threads=count),
        "theirs": Parallel(pinocchio, count, Q, QD, TAU),
    }
