# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs and commands of the pages: the tutorial from its first block to its last, and blocks on
recordings.

The latter read a robot and its recordings: a UR5 with friction and rotor inertia that its URDF does
not have.
"""

import os
import shlex
import shutil
import signal
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
from bags import MCAP, Message, description, serialized, write_rosbag2
from diag_dynamics.cli.main import main
from limits import HANG
from pages import blocks_of
from robots import robot_path

pytestmark = [pytest.mark.full]

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
RATE = 100.0


# --- Blocks on recordings ---


def motion(model, seconds, seed):
    """Return times, positions, velocities and efforts of a robot whose URDF lacks friction and
    rotor inertia.
    """
    unknown = dd.JointParameters(damping=2.0, friction=3.0, armature=0.2)
    real = dd.DiagonalDynamics(
        model.with_parameters(dd.Parameters(joints=dict.fromkeys(model.dof_names, unknown)))
    )
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / RATE)[:, None]
    w = rng.uniform(0.8, 2.0, (2, model.nv))
    q = [0.0, -1.2, 1.2, 0.0, 0.5, 0.0] + 0.5 * np.sin(w[0] * t) + 0.2 * np.cos(w[1] * t)
    qd = 0.5 * w[0] * np.cos(w[0] * t) - 0.2 * w[1] * np.sin(w[1] * t)
    qdd = -0.5 * w[0] ** 2 * np.sin(w[0] * t) - 0.2 * w[1] ** 2 * np.cos(w[1] * t)
    tau = real.inverse_dynamics(q, qd, qdd) + real.friction_torque(qd)
    return t[:, 0], q, qd + rng.normal(0.0, 2e-3, q.shape), tau + rng.normal(0.0, 0.5, q.shape)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Make the files that the pages name."""
    folder = tmp_path_factory.mktemp("recordings")
    urdf = robot_path("ur_description/urdf/ur5_robot.urdf").read_text(encoding="utf-8")
    urdf = urdf.replace("shoulder_pan_joint", "joint_1").replace("wrist_3_link", "hand")
    for name in ("arm.urdf", "my.urdf", "my_robot.urdf"):
        (folder / name).write_text(urdf, encoding="utf-8")
    model = dd.load_urdf(urdf)
    for k, (name, seconds) in enumerate({"my_bag": 95.0, "free_1": 40.0, "free_2": 20.0}.items()):
        columns = motion(model, seconds, seed=k)
        begin = (1_700_000_000 + 1000 * k) * 10**9
        messages = [description(urdf, begin - 1)]
        for t, *values in zip(*columns, strict=True):
            at = begin + round(t * 1e9)
            messages.append(
                Message(
                    "/joint_states", at, serialized(at, model.dof_names, *values, frame="base_link")
                )
            )
        write_rosbag2(folder / name, messages, MCAP)
        if name == "my_bag":
            header = [
                "t",
                *(f"{quantity}{k}" for quantity in ("q", "qd", "tau") for k in range(1, 7)),
            ]
            np.savetxt(
                folder / "log.csv",
                np.column_stack(columns),
                delimiter=",",
                header=",".join(header),
                comments="",
            )
    (recorded,) = (folder / "my_bag").glob("*.mcap")
    for name in ("a_day", "run", "monday", "tuesday"):
        shutil.copy(recorded, folder / f"{name}.mcap")
    shutil.copytree(folder / "free_1", folder / "free_motion")
    for name in ("contact_limits", "my_limits"):
        shutil.copy(ROOT / "config" / "contact_limits.example.yaml", folder / f"{name}.yaml")
    recordings = [dd.read_recording(folder / name, model) for name in ("free_1", "free_2")]
    dd.identify(recordings, model).save(folder / "arm.yaml")
    dd.calibrate(recordings, dd.DiagonalDynamics(model), gain=25.0, false_alarms=1 / 60).save(
        folder / "alarms.yaml"
    )
    return folder


GIVEN = {
    "contact-limits": {
        "q": [0.0, -1.2, 1.2, 0.0, 0.5, 0.0],
        "qd": np.full(6, 0.3),
        "Q": np.tile([0.0, -1.2, 1.2, 0.0, 0.5, 0.0], (5, 1)),
        "QD": np.full((5, 6), 0.3),
        "u": [0.0, 0.0, 1.0],
        "point": [0.0, 0.0, 0.1],
    },
    "inspection": {"dd": dd},
}
"""Names that the text around a program defines."""

BLOCKS = [
    (page.stem, block)
    for page in sorted(DOCS.glob("*.md"))
    for block in blocks_of(page)
    if block.how == "run in a folder of recordings"
]

PROGRAMS = [
    pytest.param(page, block, id=f"{page}-{block.line}")
    for page, block in BLOCKS
    if block.language == "python"
]


@pytest.mark.parametrize(("page", "block"), PROGRAMS)
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_programs_run(page, block, files, monkeypatch):
    """Run a program with the files and names of the text around it."""
    import_module("matplotlib").use("agg")
    monkeypatch.chdir(files)
    exec(
        compile("\n" * block.line + block.code, f"docs/{page}.md", "exec"),
        dict(GIVEN.get(page, {})),
    )


COMMANDS = [
    pytest.param(page, shlex.split(line, comments=True), id=f"{page}: {line[:60].strip()}")
    for page, block in BLOCKS
    if block.language == "bash"
    for line in block.code.splitlines()
]


@pytest.mark.parametrize(("page", "words"), COMMANDS)
def test_commands_run(page, words, files, monkeypatch, capsys):
    """A command ends with 0, or with 1 where it reports findings, as in short recordings."""
    monkeypatch.chdir(files)
    assert words[0] == "diag-dynamics"
    status = main(words[1:])
    output = capsys.readouterr()
    assert status in (0, 1), output.err
    assert output.out.strip() or output.err.strip()


# --- The tutorial ---


REPLACEMENTS = {"ros2 topic echo": "echo.py", "ros2 service call": "call.py"}
"""Commands of ros2cli, and the programs that the tutorial names for ROS 2 from PyPI."""


def start(block, folder, environment):
    """Start a bash that runs a block."""
    from processes import Process  # which needs ROS 2

    code = block.code
    for command, program in REPLACEMENTS.items():
        path = shlex.quote(str(ROOT / "examples" / program))
        code = code.replace(command, f"python3 {path}")
    return Process(["bash", "-euo", "pipefail", "-c", code], cwd=folder, env=environment)


def interrupt(process):
    """Send Ctrl-C to a bash and its children, and wait for its end."""
    if process.alive():
        os.killpg(process.popen.pid, signal.SIGINT)
    process.wait(HANG)


def run_block(block, folder, environment, names, running):
    """Run a block as its comment says; `running` are the processes in the background by name."""
    if block.how == "end":
        for name in block.what.split(", "):
            interrupt(running.pop(name))
    elif block.how == "hear":
        name, text = block.what.split(", ")
        running[name].wait_for_text(text)
    elif block.language == "python":
        exec(compile("\n" * block.line + block.code, "docs/tutorial.md", "exec"), names)
    elif block.how == "run in the background":
        name, _, texts = block.what.partition(", until ")
        running[name] = start(block, folder, environment)
        for text in texts.split(", and ") if texts else ():
            running[name].wait_for_text(text)
    elif block.how == "run until":
        process = start(block, folder, environment)
        try:
            process.wait_for_text(block.what)
        finally:
            interrupt(process)
    else:
        process = start(block, folder, environment)
        assert process.wait(HANG) == 0, f"docs/tutorial.md, line {block.line}: {process.tail()}"


@pytest.mark.live
@pytest.mark.ros
def test_the_tutorial_runs_to_its_end(ros_domain, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    environment = os.environ | {
        "ROS_DOMAIN_ID": str(ros_domain),
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
    }
    names = {}
    running = {}
    try:
        for block in blocks_of(DOCS / "tutorial.md"):
            if block.how != "not run":
                run_block(block, tmp_path, environment, names, running)
            for name, process in running.items():
                assert process.alive(), f"{name} has ended: {process.tail()}"
    finally:
        for process in running.values():
            interrupt(process)
    assert running == {}
    assert {"arm.urdf", "arm.yaml", "alarms.yaml"} <= {path.name for path in tmp_path.iterdir()}
