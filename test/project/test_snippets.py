# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs and commands of the pages on recordings, identification, alarms, inspection, contact and plots, as they stand.

Their files are a robot and its recordings: a UR5, two of whose names are those of the pages, with friction and rotors that
its URDF does not have.
"""

import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.parameters.files import parameters_of
from pages import blocks_of
from robots import robot_path

pytest.importorskip("rosbags", reason="rosbags is not installed")
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

DOCS = Path(__file__).parents[2] / "docs"
TYPE = "sensor_msgs/msg/JointState"
RATE = 100.0


def motion(model, seconds, seed):
    """Return times, positions, velocities and efforts of a robot that its URDF does not know all of."""
    unknown = dd.JointParameters(damping=2.0, friction=3.0, armature=0.2)
    real = dd.DiagonalDynamics(model.with_parameters(dd.Parameters(joints=dict.fromkeys(model.dof_names, unknown))))
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / RATE)[:, None]
    w = rng.uniform(0.8, 2.0, (2, model.nv))
    q = [0.0, -1.2, 1.2, 0.0, 0.5, 0.0] + 0.5 * np.sin(w[0] * t) + 0.2 * np.cos(w[1] * t)
    qd = 0.5 * w[0] * np.cos(w[0] * t) - 0.2 * w[1] * np.sin(w[1] * t)
    qdd = -0.5 * w[0] ** 2 * np.sin(w[0] * t) - 0.2 * w[1] ** 2 * np.cos(w[1] * t)
    tau = real.inverse_dynamics_batch(q, qd, qdd) + real.friction_torque_batch(qd)
    return t[:, 0], q, qd + rng.normal(0.0, 2e-3, q.shape), tau + rng.normal(0.0, 0.5, q.shape)


def write_bag(folder, urdf, names, columns, begin):
    """Write a rosbag2 folder, MCAP in it: description and joint states."""
    store = get_typestore(Stores.ROS2_JAZZY)
    Header, Time, Joints, String = (
        store.types[name]
        for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", TYPE, "std_msgs/msg/String")
    )
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        text = writer.add_connection("/robot_description", "std_msgs/msg/String", typestore=store)
        joints = writer.add_connection("/joint_states", TYPE, typestore=store)
        writer.write(text, begin - 1, store.serialize_cdr(String(urdf), "std_msgs/msg/String"))
        for t, q, qd, tau in zip(*columns, strict=True):
            at = begin + round(t * 1e9)
            message = Joints(Header(Time(*divmod(at, 10**9)), "base_link"), names, q, qd, tau)
            writer.write(joints, at, store.serialize_cdr(message, TYPE))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Make the files that the pages name."""
    folder = tmp_path_factory.mktemp("snippets")
    urdf = robot_path("ur_description/urdf/ur5_robot.urdf").read_text(encoding="utf-8")
    urdf = urdf.replace("shoulder_pan_joint", "joint_1").replace("wrist_3_link", "hand")
    for name in ("arm.urdf", "my.urdf", "my_robot.urdf"):
        (folder / name).write_text(urdf, encoding="utf-8")
    model = dd.load_urdf(urdf)
    for k, (name, seconds) in enumerate({"my_bag": 95.0, "free_1": 40.0, "free_2": 20.0}.items()):
        columns = motion(model, seconds, seed=k)
        write_bag(folder / name, urdf, list(model.dof_names), columns, (1_700_000_000 + 1000 * k) * 10**9)
        if name == "my_bag":
            header = ["t", *(f"{quantity}{k}" for quantity in ("q", "qd", "tau") for k in range(1, 7))]
            np.savetxt(
                folder / "log.csv", np.column_stack(columns), delimiter=",", header=",".join(header), comments=""
            )
    (recorded,) = (folder / "my_bag").glob("*.mcap")
    for name in ("a_day", "run", "monday", "tuesday"):
        shutil.copy(recorded, folder / f"{name}.mcap")
    shutil.copytree(folder / "free_1", folder / "free_motion")
    for name in ("contact_limits", "my_limits"):
        shutil.copy(DOCS.parent / "config" / "contact_limits.example.yaml", folder / f"{name}.yaml")
    recordings = [dd.read_recording(folder / name, model) for name in ("free_1", "free_2")]
    dd.identify(recordings, model).save(folder / "arm.yaml")
    dd.calibrate(recordings, dd.DiagonalDynamics(model), gain=25.0, false_alarms=1 / 60).save(folder / "alarms.yaml")
    return folder


GIVEN = {
    "contact": {
        "q": [0.0, -1.2, 1.2, 0.0, 0.5, 0.0],
        "qd": np.full(6, 0.3),
        "Q": np.tile([0.0, -1.2, 1.2, 0.0, 0.5, 0.0], (5, 1)),
        "QD": np.full((5, 6), 0.3),
        "u": [0.0, 0.0, 1.0],
        "point": [0.0, 0.0, 0.1],
    },
    "inspect": {"dd": dd},
}
"""Names that a program takes from the text around it."""

BLOCKS = [
    (page.stem, block)
    for page in sorted(DOCS.glob("*.md"))
    for block in blocks_of(page)
    if block.how == "run in a folder of recordings"
]

PROGRAMS = [
    pytest.param(page, block, id=f"{page}-{block.line}") for page, block in BLOCKS if block.language == "python"
]


@pytest.mark.parametrize(("page", "block"), PROGRAMS)
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_programs_run(page, block, files, monkeypatch):
    """To their end, with the files and names that the text has."""
    if page == "plots":
        pytest.importorskip("matplotlib", reason="matplotlib is not installed").use("agg")
    monkeypatch.chdir(files)
    exec(compile("\n" * block.line + block.code, f"docs/{page}.md", "exec"), dict(GIVEN.get(page, {})))


COMMANDS = [
    pytest.param(page, shlex.split(line, comments=True), id=f"{page}: {line[:60].strip()}")
    for page, block in BLOCKS
    if block.language == "bash"
    for line in block.code.splitlines()
]


@pytest.mark.parametrize(("page", "words"), COMMANDS)
def test_commands_run(page, words, files, monkeypatch, capsys):
    """They end with 0, or with 1 where there is something to look at, as short recordings; never without a result."""
    monkeypatch.chdir(files)
    assert len(COMMANDS) > 15 and words[0] == "diag-dynamics"
    status = main(words[1:])
    said = capsys.readouterr()
    assert status in (0, 1), said.err
    assert said.out.strip() or said.err.strip()


@pytest.mark.parametrize("page", ["control", "operations"])
def test_parameters_are_the_monitors(page, tmp_path):
    """Parameter files of the pages, as the monitor reads them."""
    shown = [block for block in blocks_of(DOCS / f"{page}.md") if "ros__parameters" in block.code]
    assert shown
    for block in shown:
        path = tmp_path / "parameters.yaml"
        path.write_text(block.code, encoding="utf-8")
        assert parameters_of([path]), f"line {block.line}"


def test_maps_are_read(tmp_path, monkeypatch):
    """The map of a file of numbers alone, on such a file."""
    monkeypatch.syspath_prepend(str(DOCS / "figures"))
    from rods import model

    monkeypatch.chdir(tmp_path)
    (numbers,) = [
        yaml.safe_load(one.code) for one in blocks_of(DOCS / "recordings.md") if one.how.startswith("columns")
    ]
    np.savetxt("numbers.csv", np.c_[np.arange(50) * 0.01, np.zeros((50, 9))], delimiter=",")
    recording = dd.read_recording("numbers.csv", model(), columns=numbers)
    assert recording.q.shape == (50, 3)
