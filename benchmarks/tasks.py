# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ten tasks as programs, with Pinocchio's beside them: lines, and CPU-seconds of the whole process, cold and warm."""

import os
import subprocess
import sys
import tempfile
from typing import NamedTuple

from cold import used
from start import ROOT

from diag_dynamics.model.catalog import find_urdf

OURS = """
import numpy as np
import diag_dynamics as dd
dyn = dd.DiagonalDynamics(dd.load_robot("panda"))
q, v = dyn.model.neutral, np.full(dyn.model.nv, 0.1)
"""

THEIRS = """
import numpy as np
import pinocchio as pin
model = pin.buildModelFromUrdf({urdf!r}, {mimic})
data = model.createData()
q, v = pin.neutral(model), np.full(model.nv, 0.1)
"""


class Task(NamedTuple):
    """What is done, and how."""

    name: str
    ours: str
    theirs: str


TASKS = (
    Task("load, with a mimic gripper", "print(dyn.model.nv)", "print(model.nv)"),
    Task(
        "mass matrix",
        "print(dyn.mass_matrix(q))",
        "M = pin.crba(model, data, q)\nprint(np.triu(M) + np.triu(M, 1).T)",
    ),
    Task("gravity", "print(dyn.gravity_torque(q))", "print(pin.computeGeneralizedGravity(model, data, q))"),
    Task(
        "Coriolis",
        "print(dyn.bias(q, v))",
        "g = pin.computeGeneralizedGravity(model, data, q)\nprint(pin.nonLinearEffects(model, data, q, v) - g)",
    ),
    Task("forward dynamics", "print(dyn.forward_dynamics(q, v, v))", "print(pin.aba(model, data, q, v, v))"),
    Task(
        "simulate 1 s",
        "sim = dd.Simulation(dyn.model, q, v)\nsim.advance(steps=1000)\nprint(sim.q)",
        """
for _ in range(1000):  # semi-implicit Euler, without friction and limits
    a = pin.aba(model, data, q, v, np.zeros(model.nv))
    v = v + 1e-3 * a
    q = pin.integrate(model, q, 1e-3 * v)
print(q)""",
    ),
    Task(
        "kinetic energy per joint",
        "print(dyn.evaluate(q, v).energy_share)",
        """
M = pin.crba(model, data, q)
M = np.triu(M) + np.triu(M, 1).T
L = np.linalg.cholesky(M[::-1, ::-1])[::-1, ::-1]  # M = L Lᵀ, L upper triangular
print(0.5 * (L.T @ v) ** 2)""",
    ),
    Task(
        "reflected mass at the hand",
        'print(dyn.reflected_mass(q, "panda_hand", (1, 0, 0)))',
        """
J = pin.computeFrameJacobian(model, data, q, model.getFrameId("panda_hand"))
M = pin.crba(model, data, q)
M = np.triu(M) + np.triu(M, 1).T
print(1 / (J[0] @ np.linalg.solve(M, J[0])))""",
    ),
    Task(
        "external torque",
        """
observer = dd.DisturbanceObserver(dyn, gain=25.0)
for k in range(100):
    seen = observer.update(0.001 * k, q, v, v)
print(seen.external_torque)""",
        """
r, p0, total = np.zeros(model.nv), None, np.zeros(model.nv)
for k in range(100):
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    C = pin.computeCoriolisMatrix(model, data, q, v)
    g = pin.computeGeneralizedGravity(model, data, q)
    p0 = M @ v if p0 is None else p0
    total = total + 0.001 * (v + C.T @ v - g + r)
    r = 25.0 * (M @ v - p0 - total)
print(r)""",
    ),
    Task(
        "a log as CSV",
        """
T = 10_000
batch = dyn.evaluate_batch(np.tile(q, (T, 1)), np.tile(v, (T, 1)))
np.savetxt("log.csv", batch.energy_share, delimiter=",", header=",".join(dyn.model.dof_names))""",
        """
rows = []
for _ in range(10_000):
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    L = np.linalg.cholesky(M[::-1, ::-1])[::-1, ::-1]
    rows.append(0.5 * (L.T @ v) ** 2)
np.savetxt("log.csv", rows, delimiter=",", header=",".join(model.names[1:]))""",
    ),
)


class Measured(NamedTuple):
    """Lines and CPU-seconds of one task: ours cold and warm, theirs."""

    lines: tuple[int, int]
    cold: float
    warm: float
    theirs: float


def measure():
    """Each task once, in processes of its own: a list of (Task, Measured)."""
    found, urdf = [], str(find_urdf("panda"))
    for task in TASKS:
        ours = OURS + task.ours
        theirs = THEIRS.format(urdf=urdf, mimic=task is TASKS[0]) + task.theirs
        with tempfile.TemporaryDirectory() as folder:
            cold, warm = (_seconds(ours, folder) for _ in range(2))
            _seconds(theirs, folder)  # so that files are in memory
            pinocchio = _seconds(theirs, folder)
        found.append((task, Measured((_lines(ours), _lines(theirs)), cold, warm, pinocchio)))
    return found


def _lines(program):
    return len([line for line in program.splitlines() if line.strip()])


def _seconds(program, folder):
    """CPU-seconds of a program, with compiled code and files in a folder."""
    before = used()
    paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    environment = os.environ | {"NUMBA_CACHE_DIR": folder, "PYTHONPATH": paths}
    done = subprocess.run([sys.executable, "-c", program], cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"A task has failed:\n{program}\n{done.stderr}")
    return used() - before


def table(found):
    """The lines as a table."""
    lines = [
        "| task | lines | lines, Pinocchio | cold | warm | Pinocchio |",
        "|---|---|---|---|---|---|",
    ]
    for task, one in found:
        lines.append(
            f"| {task.name} | {one.lines[0]} | {one.lines[1]} | {one.cold:.1f} | {one.warm:.1f} | {one.theirs:.1f} |"
        )
    return "\n".join(lines) + "\n"
