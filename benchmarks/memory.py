# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What compiled code allocates, and what slices of states hold; in processes of their own, which print JSON."""

import json
import os
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
from rows import Row
from timing import Ratio

ROBOT = "xarm7"  # 7 dof
SIZE = 16384  # states of a batch
CALLS = 1000


def rows(states):
    """The lines of the table. Each is one count or peak, so its quartiles are itself."""
    counts = _run("allocations")
    few, many = _run("slices", max(states // 10, 4 * SIZE)), _run("slices", states)
    found = {name: Ratio(*[(more - one) / (CALLS - 1)] * 3) for name, (one, more) in counts.items()}
    peak = Ratio(*[many["peak"] / few["peak"]] * 3)
    sizes = f"{many['peak'] / 1e6:.0f} MB, all results are {many['results'] / 1e6:.0f} MB"
    return [
        Row(
            f"allocations of compiled code, of {CALLS} steps or states",
            "each further one",
            "7 dof",
            0.001,
            found,
        ),
        Row(
            f"memory of `evaluate` over slices, {many['states']:,} states",
            f"that of {few['states']:,} states",
            "7 dof",
            1.1,
            {sizes: peak},
        ),
    ]


def allocations():
    """How often compiled code allocates in one call, and in the same call with more to do."""
    from numba.core.runtime import rtsys

    import diag_dynamics as dd
    from diag_dynamics.description.catalog import find_urdf

    model = dd.load_urdf(find_urdf(ROBOT))
    dyn, simulation = dd.DiagonalDynamics(model), dd.Simulation(model)

    def batch(count):
        X = np.zeros((count, model.nv))
        return lambda: dyn.evaluate(X, X, X, threads=1)

    def count(call):
        call()
        before = rtsys.get_allocation_stats().alloc
        call()
        return rtsys.get_allocation_stats().alloc - before

    return {
        "`evaluate` of rows": [count(batch(1)), count(batch(CALLS))],
        "`Simulation.advance`": [count(partial(simulation.advance, steps=n)) for n in (1, CALLS)],
    }


def slices(states):
    """Largest additional memory [B] of evaluations of slices of mapped files, and that of all results."""
    import diag_dynamics as dd
    from diag_dynamics.description.catalog import find_urdf

    dyn = dd.DiagonalDynamics(dd.load_urdf(find_urdf(ROBOT)))
    nv, rng = dyn.model.nv, np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        arrays = []
        for name in ("Q", "QD", "TAU"):
            array = np.lib.format.open_memmap(Path(folder, f"{name}.npy"), "w+", shape=(states, nv))
            for first in range(0, states, SIZE):
                array[first : first + SIZE] = rng.uniform(
                    -1.0, 1.0, (len(array[first : first + SIZE]), nv)
                )
            arrays.append(np.load(array.filename, mmap_mode="r"))
            del array
        dyn.evaluate(*(array[:2] for array in arrays))
        base, peak, results, seen = _own_memory(), 0, 0, 0
        for first in range(0, states, SIZE):
            batch = dyn.evaluate(*(array[first : first + SIZE] for array in arrays))
            peak = max(peak, _own_memory() - base)
            results += batch.rows.nbytes
            seen += len(batch.nu)
    assert seen == states
    return {"states": states, "peak": peak, "results": results}


def _own_memory():
    """Resident bytes of this process without the pages of mapped files, which the system may drop at any time."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError as error:
        raise RuntimeError(
            "the memory of a process is read from /proc, which only Linux has"
        ) from error
    return 1024 * int(status.split("RssAnon:")[1].split()[0])


def _run(what, *arguments):
    command = [sys.executable, __file__, what, *map(str, arguments)]
    environment = os.environ | {"NUMBA_NRT_STATS": "1"}
    return json.loads(
        subprocess.run(
            command, env=environment, stdout=subprocess.PIPE, text=True, check=True
        ).stdout
    )


if __name__ == "__main__":
    print(
        json.dumps(
            {"allocations": allocations, "slices": slices}[sys.argv[1]](*map(int, sys.argv[2:]))
        )
    )
