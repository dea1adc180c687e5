# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From nothing to the first result, in processes of their own: the library with its compiled code cached, and its imports."""

import subprocess
import sys
from pathlib import Path

import numpy as np
from rows import Row
from timing import ratio

from diag_dynamics.description.catalog import find_urdf

ROOT = Path(__file__).resolve().parents[1]

CLOCK = "from time import perf_counter; start = perf_counter()\n{}\nprint(perf_counter() - start)"

FIRST = """\
import diag_dynamics as dd
dynamics = dd.DiagonalDynamics(dd.load_urdf({!r}))
zero = [0.0] * dynamics.model.nv
dynamics.evaluate(zero, zero, zero).coriolis"""


def row(robots, rounds):
    """The line of the table."""
    programs = {robot: FIRST.format(str(find_urdf(robot))) for robot in robots}
    programs |= {"numba": "import numba", "yourdfpy": "import yourdfpy"}
    for program in programs.values():
        _seconds(program)  # so that compiled code is cached, and files are in memory
    times = [{name: _seconds(program) for name, program in programs.items()} for _ in range(rounds)]
    times = {name: np.array([t[name] for t in times]) for name in programs}
    imports = times["numba"] + times["yourdfpy"]
    found = {robot: ratio(times[robot], imports) for robot in robots}
    return Row(
        "import to first result, compiled code cached",
        "`import numba` + `import yourdfpy`",
        ", ".join(robots),
        None,
        found,
    )


def _seconds(program):
    command = [sys.executable, "-c", CLOCK.format(program)]
    return float(
        subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout
    )
