# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What type checkers and editors know of the library: they find a user's mistakes, and none where there is none."""

import ast
import inspect
import json
import os
import re
import subprocess
import sys
import typing
from importlib import import_module
from pathlib import Path

import pytest

import diag_dynamics as dd

ROOT = Path(__file__).parents[2]

if os.environ.get("DIAG_DYNAMICS_REQUIRE_ROS") != "1":  # where everything is installed, they have to be here
    pytest.importorskip("mypy", reason="mypy is not installed")
    pytest.importorskip("pyright", reason="pyright is not installed")

SCRIPT = """
import numpy as np

import diag_dynamics as dd

model = dd.load_urdf("arm.urdf", mimic="free", armature={"joint1": 0.1}, gravity=[0.0, 0.0, -1.62])
dyn = dd.DiagonalDynamics(model.with_payload("hand", 1.0))
q, qd, tau = model.neutral, np.zeros(model.nv), [0.0] * model.nv
s = dyn.evaluate(q, qd, tau, {"hand": np.ones(6)}, frame="world", friction=True)
out = dyn.new_evaluation()
energy: float = dyn.evaluate(q, qd, out=out).kinetic_energy
if s.epsilon is not None and s.power is not None:
    moments = s.epsilon - s.coriolis
    energy += s.power
batch = dyn.evaluate_batch(np.tile(q, (10, 1)), np.tile(qd, (10, 1)), out=dyn.new_batch(10))
mean = batch.kinetic_energy.mean()
factor = dyn.factors(q).m @ qd
law = dd.JointTracking(dyn, gain=2.0, convergence=np.ones(model.nv))
command = dd.EffortSaturation(model).filter(law.command(q, qd, q))
simulation = dd.Simulation(model, order=1, limits=dd.CompliantLimits(1e4))
simulation.advance(command.tau, steps=10)
residual = simulation.audit.residual
observer = dd.DisturbanceObserver(dyn, gain=25.0, threshold=1.0)
torque = observer.update(0.0, q, qd, tau).external_torque
"""

MISTAKES = {
    "a name that is not there": "dd.load_urdff('arm.urdf')",
    "an option that is not there": "dd.load_urdf('arm.urdf', mimic='embedded')",
    "an attribute of the model that is not there": "model.dof_name",
    "an argument too few": "dyn.evaluate(q)",
    "text for a vector": "dyn.evaluate('q', qd)",
    "a result that is written": "s.nu = q",
    "a result that may be absent": "s.epsilon + s.coriolis",
    "an argument that is misspelt": "dyn.forward_dynamics(q, qd, tau, friktion=True)",
    "a result of one state for many": "dyn.evaluate_batch([q], [qd], out=dyn.new_evaluation())",
    "an order that does not exist": "dd.Simulation(model, order=3)",
}


def mypy(folder, path):
    command = [sys.executable, "-m", "mypy", "--follow-imports=silent", "--ignore-missing-imports", path.name]
    environment = os.environ | {"MYPYPATH": str(ROOT), "MYPY_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600)
    assert re.search("^(Success|Found)", done.stdout, re.M), done.stdout + done.stderr
    return {int(line) for line in re.findall(rf"^{path.name}:(\d+): error", done.stdout, re.M)}


def pyright(folder, path):
    (folder / "pyrightconfig.json").write_text(json.dumps({"extraPaths": [str(ROOT)], "include": [path.name]}))
    command = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "--outputjson"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found = json.loads(done.stdout)["generalDiagnostics"]
    return {each["range"]["start"]["line"] + 1 for each in found if each["severity"] == "error"}


@pytest.mark.parametrize("checker", [mypy, pyright])
def test_mistakes_are_found(tmp_path, checker):
    """All of them, and nothing in the script that has none."""
    path, lines = tmp_path / "script.py", len(SCRIPT.splitlines())
    path.write_text(SCRIPT + "\n".join(MISTAKES.values()) + "\n")
    found = checker(tmp_path, path)
    missed = [what for k, what in enumerate(MISTAKES, lines + 1) if k not in found]
    assert not missed
    assert all(line > lines for line in found), [SCRIPT.splitlines()[line - 1] for line in found if line <= lines]


def test_package_says_that_it_is_typed():
    assert (ROOT / "diag_dynamics" / "py.typed").is_file()
    told = re.search(r"package-data\.diag_dynamics = \[.*\]", (ROOT / "pyproject.toml").read_text("utf-8"))
    assert '"py.typed"' in told.group()


def test_checkers_see_the_public_names():
    """Those that the module looks up when they are asked for, each where it is; nothing else has a name without _."""
    tree = ast.parse((ROOT / "diag_dynamics" / "__init__.py").read_text("utf-8"))
    (branch,) = [
        node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "_typing.TYPE_CHECKING"
    ]
    seen = {}
    for node in branch.body:
        for alias in node.names:
            assert alias.asname == alias.name  # else a checker takes it for private
            seen[alias.name] = node.module.removeprefix("diag_dynamics.")
    assert seen == dd._HOME | dict.fromkeys(dd._ROOMS, "diag_dynamics")
    others = [node for node in tree.body if isinstance(node, (ast.Import, ast.ImportFrom))]
    assert all((alias.asname or "").startswith("_") for node in others for alias in node.names)


def public_functions():
    """Return what the public names and the classes behind them offer, by dotted name."""
    for name in dd.__all__:
        value = getattr(dd, name)
        if inspect.isfunction(value):
            yield name, value
            continue
        if inspect.ismodule(value):
            yield from ((f"{name}.{one}", getattr(value, one)) for one in value.__all__)
            continue
        for one, member in vars(value).items():
            if member is getattr(object, one, None) or (one.startswith("_") and one != "__init__"):
                continue
            function = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
            if inspect.isfunction(function) and function.__module__.startswith("diag_dynamics"):
                yield f"{name}.{one}", function


def test_public_functions_have_types():
    """Every argument and every result, of types that exist."""
    checked = 0
    for name, function in public_functions():
        # RobotModel is a name that results imports for checkers only.
        hints = typing.get_type_hints(
            function, {"RobotModel": dd.RobotModel} | vars(import_module(function.__module__))
        )
        expected = {*list(inspect.signature(function).parameters)} - {"self", "cls"} | {"return"}
        assert expected <= set(hints), f"{name} lacks {sorted(expected - set(hints))}"
        checked += 1
    assert checked > 80
