# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Time of `evaluate` of robots with closed loops, by that of their cut trees: ``python3 benchmarks/loops.py``.

Both take turns in one process, and the least time of each counts. States are 0.1 or 10 mrad apart.
"""

import time
from pathlib import Path

import numpy as np

import diag_dynamics as dd
from diag_dynamics.sweeps import evaluation
from diag_dynamics.sweeps import workspace as ws

FOLDER = Path(__file__).parents[1] / "examples" / "closed_loops"
CALLS, TURNS = 200, 100


def calls(model, q, step):
    """Return functions that evaluate states near q by the public call and by the kernel."""
    states = [q + step * np.sin(0.1 * k) for k in range(CALLS)]
    dynamics, own, zero = dd.DiagonalDynamics(model), model.new_workspace(), np.zeros(model.nv)
    qd, out = np.ones(model.nv), np.zeros((ws.N_ROWS, model.nv))

    def public():
        for q in states:
            dynamics.evaluate(q, qd)

    def kernel():
        for q in states:
            evaluation.evaluate.run(own.robot, q, qd, zero, out)

    return public, kernel


def main():
    """Print a row for each mechanism and step."""
    print("mechanism          step [rad, m]  public [µs]  by cut tree  kernel [µs]  by cut tree")
    for name in ("four_bar_gripper", "delta", "leg", "excavator"):
        urdf, beside = FOLDER / f"{name}.urdf", FOLDER / f"{name}.yaml"
        model = dd.load_urdf(urdf, loops=beside if beside.exists() else None)
        # Links that only a loop moves have no inertia of their own.
        cut = dd.load_urdf(urdf, mimic="free", loops=[], armature=1e-3)
        for step in (1e-3, 0.1):
            functions = [*calls(model, model.start, step), *calls(cut, cut.neutral, step)]
            least = np.full(4, np.inf)
            for _ in range(TURNS):
                for k, function in enumerate(functions):
                    start = time.perf_counter()
                    function()
                    least[k] = min(least[k], (time.perf_counter() - start) / CALLS * 1e6)
            public, kernel, cut_public, cut_kernel = least
            ratios = f"{public:11.2f}  {public / cut_public:11.2f}  {kernel:11.2f}  {kernel / cut_kernel:11.2f}"
            print(f"{name:18} {0.1 * step:13g}  {ratios}")


if __name__ == "__main__":
    main()
