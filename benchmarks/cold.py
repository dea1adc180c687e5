# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cold and warm starts: CPU-seconds of whole processes, with nothing compiled before, and with everything."""

import importlib.util
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from start import FIRST, ROOT

from diag_dynamics.description.catalog import find_urdf

SIMULATION = """\
import diag_dynamics as dd
dd.Simulation(dd.load_urdf({!r})).advance(steps=10)"""

EVERYTHING = """\
import numpy as np
import diag_dynamics as dd
model = dd.load_urdf({!r})
dyn, zero, q = dd.DiagonalDynamics(model), np.zeros(model.nv), model.neutral
s = dyn.evaluate(q, zero, zero)
s.link_energy, dyn.mass_matrix(q), dyn.gravity_torque(q), dyn.forward_dynamics(q, zero, zero)
dyn.inverse_dynamics(q, zero, zero), dyn.factors(q), dyn.placement(q, model.link_names[-1])
for sweep in (dyn.nu_from_qd, dyn.qd_from_nu, dyn.epsilon_from_tau, dyn.tau_from_epsilon):
    sweep(q, zero)
dyn.reflected_mass(q, model.link_names[-1], (1, 0, 0))
dyn.evaluate(q[None], zero[None], zero[None]).link_energy
dd.DisturbanceObserver(dyn, gain=25.0).update(0.0, q, zero, zero)
dd.JointTracking(dyn, gain=1.0, convergence=1.0).command(q, zero, q)
dd.RateDamping(dyn, gain=1.0).command(q, zero)
dd.Simulation(model).advance(steps=10)"""

HUMANOID = """\
import diag_dynamics as dd
model = dd.load_urdf({!r}, floating_base=True)
zero = [0.0] * model.nv
dd.DiagonalDynamics(model).evaluate(model.neutral, zero, zero)"""

ARM = "ur5"

LISTED = 0.05
"""Least CPU time of a function with a row of its own [s]."""

READY = "Ready"
"""What a node says when it has started."""


class Start(NamedTuple):
    """One line: what starts, its command, what else it has in its environment, and the target of a cold start [CPU-s]."""

    subject: str
    command: list
    environment: dict
    target: float | None


def starts():
    """All lines; those of nodes where there is a ROS 2."""
    urdf, arm = str(find_urdf("panda")), str(find_urdf(ARM))
    python = [sys.executable, "-c"]
    humanoid = HUMANOID.format(str(find_urdf("talos_full_v2")))
    lines = [
        Start("import, load, first `evaluate` of a UR5", [*python, FIRST.format(arm)], {}, 6.5),
        Start(
            "the same of a Panda, whose fingers are coupled",
            [*python, FIRST.format(urdf)],
            {},
            None,
        ),
        Start("the same of a Talos with a floating base", [*python, humanoid], {}, 12.0),
        Start("`Simulation` of a UR5", [*python, SIMULATION.format(arm)], {}, 14.5),
        Start(
            "everything that a script may call, of a Panda",
            [*python, EVERYTHING.format(urdf)],
            {},
            32.0,
        ),
    ]
    if importlib.util.find_spec("rclpy"):
        robot = ["--ros-args", "-p", f"robot_description:={urdf}"]
        more = {"controller": ["-p", "robot_compensates_gravity:=false", "-p", "autostart:=true"]}
        for node in ("monitor", "simulator", "controller"):
            command = [sys.executable, "-m", "diag_dynamics", node, *robot, *more.get(node, [])]
            lines.append(
                Start(f"`{node}`, until it is ready", command, {"ROS_DOMAIN_ID": "83"}, 20.0)
            )
    return lines


def measure(rounds):
    """CPU-seconds of each start, cold and warm: a list of (Start, array, array)."""
    found = []
    for start in starts():
        cold, warm = [], []
        for _ in range(rounds):
            with tempfile.TemporaryDirectory() as folder:
                cold.append(_seconds(start, folder))
                warm.append(_seconds(start, folder))
        found.append((start, np.array(cold), np.array(warm)))
    return found


def _seconds(start, folder):
    """CPU-seconds of a process and of those it starts, with compiled code in a folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": folder} | start.environment
    before = used()
    process = subprocess.Popen(
        start.command,
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    said = []
    for line in process.stdout:
        said.append(line)
        if READY in line:
            process.send_signal(signal.SIGINT)
    if process.wait() != 0:
        sys.exit(f"{start.subject} has failed:\n{''.join(said[-20:])}")
    return used() - before


def used():
    """CPU-seconds of all processes that have been waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def table(found):
    """The lines as a table: medians."""
    lines = ["| starts | cold | target | | warm |", "|---|---|---|---|---|"]
    for start, cold, warm in found:
        median = float(np.median(cold))
        target, verdict = (
            ("", "")
            if start.target is None
            else (f"≤ {start.target:g}", "met" if median <= start.target else "missed")
        )
        lines.append(
            f"| {start.subject} | {median:.1f} | {target} | {verdict} | {float(np.median(warm)):.1f} |"
        )
    return "\n".join(lines) + "\n"


def compilations():
    """The CPU time of what the first `evaluate` of an arm compiles, by function, as a table."""
    with tempfile.TemporaryDirectory() as folder:
        output = subprocess.run(
            [sys.executable, "benchmarks/compilations.py", FIRST.format(str(find_urdf(ARM)))],
            cwd=ROOT,
            env=os.environ | {"NUMBA_CACHE_DIR": folder},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout
    total, functions = json.loads(output)
    ranked = sorted(functions.items(), key=lambda item: -item[1][1])
    listed = [item for item in ranked if item[1][1] >= LISTED]
    lines = ["| function | compiled | CPU-s |", "|---|---|---|"]
    lines += [f"| `{name}` | {count} × | {seconds:.2f} |" for name, (count, seconds) in listed]
    others = [seconds for _, (_, seconds) in ranked[len(listed) :]]
    compiled = sum(seconds for _, (_, seconds) in ranked)
    lines += [
        f"| {len(others)} others | | {sum(others):.2f} |",
        f"| imports, load, linking and storing | | {total - compiled:.2f} |",
    ]
    return "\n".join(lines) + "\n"


def page(found, machine):
    """The whole page."""
    rounds = len(found[0][1])
    return f"""\
# Benchmark of start-up

CPU-seconds of a whole process, Python and imports included: cold with an empty cache of compiled code, warm with what
the cold start has left there. Medians of {rounds}. Nodes have a Panda. *Everything*: load, evaluate, link energies, M, g,
forward and inverse dynamics, factors, the four sweeps, placement, reflected mass, batch, observer, two laws, simulation. The
target of `Simulation` is that of `evaluate` and 8 more.

{table(found)}
## What the first `evaluate` of a UR5 compiles

One run; a function without those that it calls, and those of at least {LISTED} s.

{compilations()}
{machine}"""


def write(found, machine, folder: Path):
    """Write the page."""
    (folder / "start.md").write_text(page(found, machine), encoding="utf-8")
