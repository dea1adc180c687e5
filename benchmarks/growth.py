# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How cost grows with the number of joints: chains, balanced trees, and chains with a coupled gripper of fixed size.

The exponent is that of a line fitted to the logarithms of median times from 32 joints on; 1 is O(N).
"""

import numpy as np
from rows import Row
from timing import Ratio, interleaved
from trees import balanced, chain

import diag_dynamics as dd

SIZES = (8, 16, 32, 64, 128, 256, 512, 1024)
FIRST = 32  # joints from which on the fit counts: below, what Python does for a call counts too
CHAIN, TREE, COUPLED = "serial chain", "balanced tree", "chain with a coupled gripper"
KINDS = {CHAIN: chain, TREE: balanced, COUPLED: lambda joints: chain(joints, coupled=True)}


def calls(dyn):
    """What is timed: one call of each method, at one state."""
    rng = np.random.default_rng(0)
    q, qd, tau = rng.uniform(-1.0, 1.0, (3, dyn.model.nv))
    tip = dyn.model.link_names[-1]
    return {
        "evaluate": lambda: dyn.evaluate(q, qd, tau),
        "forward_dynamics": lambda: dyn.forward_dynamics(q, qd, tau),
        "inverse_dynamics": lambda: dyn.inverse_dynamics(q, qd, tau),
        "nu_from_qd": lambda: dyn.nu_from_qd(q, qd),
        "qd_from_nu": lambda: dyn.qd_from_nu(q, qd),
        "epsilon_from_tau": lambda: dyn.epsilon_from_tau(q, tau),
        "tau_from_epsilon": lambda: dyn.tau_from_epsilon(q, tau),
        "m_rate_transposed_times": lambda: dyn.m_rate_transposed_times(q, qd, tau),
        "coriolis_bracket_times": lambda: dyn.coriolis_bracket_times(q, qd, tau),
        "coriolis_matrix_times": lambda: dyn.coriolis_matrix_times(q, qd, tau),
        "log_det_rate": lambda: dyn.log_det_rate(q, qd),
        "wrench_factor": lambda: dyn.wrench_factor(q, tip),
    }


def measure(sizes, rounds):
    """Seconds per call by kind, method and size; all of them take turns."""
    timed = {}
    for kind, make in KINDS.items():
        for size in sizes:
            dyn = dd.DiagonalDynamics(dd.load_urdf(make(size)))
            timed |= {(kind, method, size): call for method, call in calls(dyn).items()}
    return interleaved(timed, rounds)


def exponents(times):
    """Slope of log time over log size by kind and method, each with the quartiles of the slopes of single rounds."""
    found = {}
    for kind, method, _ in times:
        sizes = sorted(n for k, m, n in times if (k, m) == (kind, method) and n >= FIRST)
        taken = np.array([times[kind, method, n] for n in sizes])
        slope = np.polyfit(np.log(sizes), np.log(np.median(taken, axis=1)), 1)[0]
        single = np.polyfit(np.log(sizes), np.log(taken), 1)[0]
        found[kind, method] = Ratio(slope, *np.percentile(single, (25, 75)))
    return found


def row(slopes, sizes):
    """The line of the table: every O(N) method, on chains and trees."""
    found = {
        f"`{method}`, {kind}": slope for (kind, method), slope in slopes.items() if kind != COUPLED
    }
    return Row(
        "growth of every O(N) method",
        f"exponent of N, from {FIRST} to {sizes[-1]}",
        f"{CHAIN}s, {TREE}s",
        1.05,
        found,
    )
