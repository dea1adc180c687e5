# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many states at once, on several threads."""

import os
import time
from collections import deque

import numpy as np
from cases import COMPARED, WITH_TARGETS, targets
from peers import Parallel
from rows import Row
from timing import interleaved, ratio

KEPT = 2000
"""States of a batch of which every result is kept."""

PAUSE = 0.02
"""Rest before a call [s]: OpenMP's threads keep a processor busy for a while after their work, which would slow others."""


def cores():
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads():
    """1, 2, 4, … and all."""
    return sorted({*(2**k for k in range(cores().bit_length()) if 2**k <= cores()), cores()})


def chosen(cases, pinocchios):
    """Those that are measured: the robots that have a target, each with its peer."""
    return [pair for pair in zip(cases, pinocchios, strict=True) if pair[0].label in WITH_TARGETS]


def rows(pairs, size, rounds):
    """Lines of the table: time per state on all processors, against the peer's and of large batches against small ones."""
    found = {name: {} for name in ("ours", "kept", "wrench", "touched")}
    for case, pinocchio in pairs:
        times = interleaved(
            _calls(case, pinocchio, size, cores()), rounds, seconds=0.03, pause=PAUSE
        )
        found["ours"][case.label] = ratio(times["ours"], times["theirs"])
        times = interleaved(_kept(case, pinocchio, cores()), rounds, seconds=0.03, pause=PAUSE)
        found["kept"][case.label] = ratio(times["ours"], times["theirs"])
        calls = _external(case, pinocchio, size, cores())
        times = interleaved(calls, rounds, seconds=0.03, pause=PAUSE)
        for name in ("wrench", "touched"):
            label = f"{case.label}, {1e6 * _cpu_time(calls[name]) / size:.2g} µs of CPU time"
            found[name][label] = ratio(times[name], times["theirs"])
    peer = "`pin.abaInParallel`, same threads"
    case, _ = pairs[0]
    calls = {count: _call(case, count, cores()) for count in (10 * size, size)}
    times = interleaved(calls, max(3, rounds // 5), seconds=0.03, pause=PAUSE)
    growth = {case.label: ratio(times[10 * size] / 10, times[size])}
    return [
        Row(
            "`evaluate` of rows per state, all cores",
            peer,
            COMPARED,
            targets(0.45, 0.4, 0.36),
            found["ours"],
        ),
        Row(
            f"`evaluate` of {KEPT} rows, all results kept",
            peer,
            COMPARED,
            None,
            found["kept"],
        ),
        Row(
            "`wrench` of rows at the last link per state, all cores",
            peer,
            COMPARED,
            None,
            found["wrench"],
        ),
        Row(
            "`touched_link` of rows in contact per state, all cores",
            peer,
            COMPARED,
            None,
            found["touched"],
        ),
        Row(
            f"`evaluate` of rows per state, {10 * size:,} states",
            f"{size:,} states",
            case.label,
            1.25,
            growth,
        ),
    ]


def curves(case, pinocchio, sizes, rounds):
    """States per second, by library and threads an array of one entry for each batch size."""
    calls = {}
    for count in threads():
        for size in sizes:
            both = _calls(case, pinocchio, size, count)
            calls["evaluate", count, size] = both["ours"]
            calls["pin.abaInParallel", count, size] = both["theirs"]
    times = interleaved(calls, rounds, pause=PAUSE)
    lines = dict.fromkeys((name, count) for name, count, _ in calls)
    return {
        line: np.array([size / np.median(times[(*line, size)]) for size in sizes]) for line in lines
    }


def _calls(case, pinocchio, size, count):
    """One call of each, on the same states."""
    Q, QD, TAU = case.states(size)
    return {
        "ours": lambda: case.dynamics.evaluate(Q, QD, TAU, threads=count),
        "theirs": Parallel(pinocchio, count, Q, QD, TAU),
    }


def _call(case, size, count):
    Q, QD, TAU = case.states(size)
    return lambda: case.dynamics.evaluate(Q, QD, TAU, threads=count)


def _kept(case, pinocchio, count):
    """Calls of few states, of which ours keeps the last hundred results: their memory is fresh."""
    kept, evaluate, (Q, QD, TAU) = (
        deque(maxlen=100),
        case.dynamics.evaluate,
        case.states(KEPT),
    )
    return {
        "ours": lambda: kept.append(evaluate(Q, QD, TAU, threads=count)),
        "theirs": Parallel(pinocchio, count, Q, QD, TAU),
    }


def _cpu_time(call):
    """Least CPU-seconds of a call."""
    starts = [(time.process_time(), call(), time.process_time()) for _ in range(5)]
    return min(end - start for start, _, end in starts)


def _external(case, pinocchio, size, count):
    """Wrench and touched link of external torque that always stands out of its noise."""
    dynamics, (Q, QD, TAU) = case.dynamics, case.states(size)
    covariance = 0.04 * np.eye(dynamics.model.nv) + 0.01
    link = dynamics.model.link_names[int(dynamics.model.bodies["link"][-1])]
    return {
        "wrench": lambda: dynamics.wrench(Q, link, TAU, covariance, threads=count),
        "touched": lambda: dynamics.touched_link(
            Q, TAU, covariance, significance=0.0, threads=count
        ),
        "theirs": Parallel(pinocchio, count, Q, QD, TAU),
    }
