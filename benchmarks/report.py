# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What was measured, as Markdown."""

import os
import platform
import re
import subprocess
from datetime import date
from importlib.metadata import version
from pathlib import Path

import numpy as np
from growth import CHAIN, KINDS
from single import COLUMNS
from timing import ratio

import diag_dynamics as dd

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- benchmarks: begin -->\n", "<!-- benchmarks: end -->\n"


def summary(rows):
    """The first table of the page: a line for each target, the worst of it deciding."""
    lines = [
        "| measured | against | on | target | median | worst | |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        targets = row.target.values() if isinstance(row.target, dict) else [row.target]
        limits = "" if row.target is None else "≤ " + ", ".join(f"{target:g}" for target in targets)
        verdict = "" if row.target is None else "met" if row.met else "missed"
        median = np.median([r.median for r in row.ratios.values()])
        worst = f"{_text(row.ratios[row.worst].median)} ({row.worst})"
        cells = row.subject, row.peer, row.over, limits, _text(median), worst, verdict
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def page(measured):
    """The whole report: the summary, then every robot and method, and where it was measured."""
    error, where = measured.agreement
    return f"""\
# Benchmark of the library

{BEGIN}{summary(measured.rows)}{END}
Ratios of times, smaller is better: in every round all that is compared takes its turn, and the ratio is the median over
rounds. *Median* and *worst* are over the robots, or whatever the line is about; the worst, relative to its target, decides
whether the targets are met. Lines without a target are for comparison. Fields of an evaluation that are made when they
are read are left out of the bare call and counted in the line after it.

Before anything was timed, outputs were compared: they agree to {error:.0e} relative to their norms ({where}).

![Time of a call against degrees of freedom](dof.png)

![Time against the number of joints](growth.png)

![States per second against the size of a batch](batch.png)

While batches were measured, other work kept {measured.other_work:.2f} processors busy: the more, the less is to be made
of what takes all of them.

## The peers

* `pin.aba`: q̈ by Pinocchio, from Python, its data allocated once, in the faster of its two conventions (`WORLD`).
* NumPy and Pinocchio route, *dense*: everything that `evaluate` returns, by `crba`, `cholesky.decompose`,
  `computeCoriolisMatrix`, `computeGeneralizedGravity` and triangular solves of LAPACK (`benchmarks/peers.py`).
* `mj_forward`: MuJoCo's kinematics, M, its LᵀDL, bias forces and q̈; constraints, contacts and sensors are off.
* `pin.abaInParallel`: q̈ only, on the same number of threads, a model for each, into memory that is allocated once.

## Robots, one state at a time

Medians, and quartiles in brackets.

{_robots(measured.single, measured.dof)}
## Growth

Exponents from N = 32 on, and the time on the longest chain against that of `nu_from_qd`.

{_growth(measured.growth, measured.slopes)}
## Other lines, one by one

{_details(measured.others)}
## Machine

{machine(("numpy", "scipy", "numba", "pin", "mujoco", "yourdfpy", "example-robot-data"))}"""


def _text(number):
    """A number with three digits, and not fewer than two places if small."""
    return f"{number:.3f}" if number < 0.1 else f"{number:.2f}" if number < 100 else f"{number:.0f}"


def quartiles(r):
    """A Ratio as text."""
    return f"{_text(r.median)} ({_text(r.low)}–{_text(r.high)})"


def _robots(times, dof):
    lines = [f"| robot | dof | {' | '.join(COLUMNS)} |", "|---|---|" + "---|" * len(COLUMNS)]
    for name, t in times.items():
        cells = (quartiles(ratio(t[ours], t[theirs])) for ours, theirs in COLUMNS.values())
        lines.append(f"| {name} | {dof[name]} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _growth(times, slopes):
    lines = [
        f"| | {' | '.join(KINDS)} | against `nu_from_qd` |",
        "|---|" + "---|" * (len(KINDS) + 1),
    ]
    longest = max(n for _, _, n in times)
    for method in dict.fromkeys(method for _, method in slopes):
        cells = [quartiles(slopes[kind, method]) for kind in KINDS]
        more = ratio(times[CHAIN, method, longest], times[CHAIN, "nu_from_qd", longest])
        lines.append(f"| `{method}` | {' | '.join(cells)} | {_text(more.median)} |")
    return "\n".join(lines) + "\n"


def _details(rows):
    lines = ["| measured | against | on | ratio |", "|---|---|---|---|"]
    for row in rows:
        lines += [
            f"| {row.subject} | {row.peer} | {name} | {quartiles(r)} |"
            for name, r in row.ratios.items()
        ]
    return "\n".join(lines) + "\n"


VECTORS = {"AVX-512": "avx512f", "AVX2": "avx2"}
"""Extensions of x86 by name, and their flags in Linux."""


def machine(packages, extra=""):
    """Processor, date and commit, and the versions of packages and of what `extra` tells."""
    versions = [f"diag_dynamics {dd.__version__}", f"Python {platform.python_version()}"]
    versions += [f"{name} {version(name)}" for name in packages]
    return (
        f"{_processor()}, {len(os.sched_getaffinity(0))} cores, {platform.system()} {platform.machine()}; "
        f"{date.today()}, commit {_commit()}\n\n"
        f"{', '.join(filter(None, (*versions, extra)))}\n"
    )


def _processor():
    """Name of the processor and its widest vectors, by which the speed of batches differs twofold."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        text = ""
    found = re.search(r"model name\s*: (.*)", text)
    vectors = next(
        (f" ({name})" for name, flag in VECTORS.items() if re.search(rf"\b{flag}\b", text)), ""
    )
    return (found[1] if found else platform.processor() or "unknown processor") + vectors


def _commit():
    """The commit that was measured."""

    def git(*arguments):
        command = ["git", "-C", str(ROOT), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        changed = git(
            "status", "--porcelain", "--", "diag_dynamics", "benchmarks", ":!benchmarks/results"
        )
        return git("rev-parse", "--short", "HEAD") + (" with changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
