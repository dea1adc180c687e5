"""How cost grows with the number of joints: chains, balanced trees, and chains with a coupled gripper of fixed size.

The exponent is that of a line fitted to the logarithms of median times above 32 joints; 1 is O(N). Beside it stands the
time on the longest chain against that of `nu_from_qd`, which is little more than the factorization.
"""

import timeit

import numpy as np
from trees import balanced, chain

import diag_dynamics as dd

SIZES = (8, 16, 32, 64, 128, 256, 512, 1024)
KINDS = {
    "serial chain": chain,
    "balanced tree": balanced,
    "chain with a coupled gripper": lambda joints: chain(joints, coupled=True),
}
REPEATS = 15


def calls(dyn):
    """Return what is timed: one call of each method, at one state."""
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
        "m_rate_transposed": lambda: dyn.m_rate_transposed(q, qd, tau),
        "coriolis_bracket": lambda: dyn.coriolis_bracket(q, qd, tau),
        "coriolis_product": lambda: dyn.coriolis_product(q, qd, tau),
        "mass_matrix_rate_times": lambda: dyn.mass_matrix_rate_times(q, qd, tau),
        "log_det_rate": lambda: dyn.log_det_rate(q, qd),
        "wrench_factor": lambda: dyn.wrench_factor(q, tip),
    }


def measure():
    """Return median seconds by kind, method and size; repeats of all of them are interleaved."""
    timers = {}
    for kind, make in KINDS.items():
        for size in SIZES:
            dyn = dd.DiagonalDynamics(dd.load_urdf(make(size)))
            for method, call in calls(dyn).items():
                call()
                timers[kind, method, size] = timeit.Timer(call), max(1, 4000 // size)
    times = {key: [] for key in timers}
    for _ in range(REPEATS):
        for key, (timer, number) in timers.items():
            times[key].append(timer.timeit(number) / number)
    return {key: float(np.median(values)) for key, values in times.items()}


def exponent(times, kind, method):
    """Return the slope of log time over log size above 32 joints."""
    sizes = [size for size in SIZES if size >= 32]
    return float(np.polyfit(np.log(sizes), [np.log(times[kind, method, size]) for size in sizes], 1)[0])


def main():
    """Measure, and print a Markdown table."""
    times = measure()
    print("| | " + " | ".join(KINDS) + " | against `nu_from_qd` |\n|---|" + "---|" * (len(KINDS) + 1))
    chain_of = {
        method: time for (kind, method, size), time in times.items() if (kind, size) == ("serial chain", SIZES[-1])
    }
    for method in dict.fromkeys(method for _, method, _ in times):
        row = [f"{exponent(times, kind, method):.3f}" for kind in KINDS]
        print(f"| `{method}` | " + " | ".join(row) + f" | {chain_of[method] / chain_of['nu_from_qd']:.2f} |")


if __name__ == "__main__":
    main()
