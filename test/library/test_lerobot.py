# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Datasets of LeRobot, versions 2.1 and 3.0: episodes are recordings."""

import json

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import diag_dynamics as dd
from bags import arm as arm_of
from diag_dynamics.cli.main import main
from hostile import MS, START, Driver

FPS, LENGTHS = 50, (40, 25, 31)
JOINTS = tuple(f"panda_joint{k}" for k in range(1, 8))
RADIANS = {"scale": {"position": "rad"}}
OWN = "timestamp", "frame_index", "episode_index", "index", "task_index"


@pytest.fixture(scope="module")
def arm():
    return dd.load_robot("panda", locked_joints={"panda_finger_joint1": 0.0})


@pytest.fixture(scope="module")
def motion(arm):
    """Positions, velocities and efforts of each episode."""
    result = []
    for seed, length in enumerate(LENGTHS):
        driver = Driver(arm, seed)
        states = [driver.state(START + k * 1000 * MS // FPS) for k in range(length)]
        result.append([np.array([state[k] for state in states], np.float32) for k in (1, 2, 3)])
    return result


def feature(names, size=None):
    return {"dtype": "float32", "shape": [size or len(names)], "names": names}


def columns(number, values, features):
    """Return the table of an episode."""
    n = len(values[0])
    table = {
        "timestamp": (np.arange(n) / FPS).astype(np.float32),
        "frame_index": np.arange(n),
        "episode_index": np.full(n, number),
        "index": np.arange(n) + sum(LENGTHS[:number]),
        "task_index": np.zeros(n, int),
    }
    for name, entry in zip(features, values, strict=True):
        entry = np.ascontiguousarray(entry)
        table[name] = pa.FixedSizeListArray.from_arrays(pa.array(entry.ravel()), entry.shape[1])
    return pa.table(table, metadata={b"huggingface": b'{"info": {"features": {}}}'})


def write_dataset(root, version, episodes, features, fps=FPS):
    """Write episodes, each a list of arrays (n, k) for the features, in a published version of the
    format.
    """
    is_new = version == "v3.0"
    path = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
    path = path if is_new else "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    columns_there = {
        name: {"dtype": "float32" if name == "timestamp" else "int64", "shape": [1], "names": None}
        for name in OWN
    }
    video = {
        "observation.images.top": {"dtype": "video", "shape": [3, 4, 4], "names": ["c", "h", "w"]}
    }
    info = {"codebase_version": version, "fps": fps, "chunks_size": 2, "data_path": path}
    info["features"] = features | video | columns_there
    tables = [columns(k, entry, features) for k, entry in enumerate(episodes)]
    (root / "meta").mkdir(parents=True)
    (root / "meta" / "info.json").write_text(json.dumps(info))
    if is_new:  # two episodes in the first file
        where = [(0, 0), (0, 0), (0, 1)][: len(tables)]
        for place in sorted(set(where)):
            some = [table for table, entry in zip(tables, where, strict=True) if entry == place]
            save(
                pa.concat_tables(some),
                root / path.format(chunk_index=place[0], file_index=place[1]),
            )
        meta = {"episode_index": range(len(tables)), "length": map(len, tables)}
        meta |= {
            f"data/{name}_index": [entry[k] for entry in where]
            for k, name in enumerate(("chunk", "file"))
        }
        save(
            pa.table({name: list(entry) for name, entry in meta.items()}),
            root / "meta/episodes/chunk-000/file-000.parquet",
        )
    else:
        for k, table in enumerate(tables):
            save(table, root / path.format(episode_chunk=k // 2, episode_index=k))
        lines = [
            json.dumps({"episode_index": k, "tasks": ["move"], "length": len(t)})
            for k, t in enumerate(tables)
        ]
        (root / "meta" / "episodes.jsonl").write_text("\n".join(lines) + "\n")
    return root


def save(table, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table, path)


FEATURES = {
    "observation.state": feature(list(JOINTS)),
    "observation.velocity": feature({"motors": list(JOINTS)}, len(JOINTS)),
    "observation.effort": feature([f"{name}.effort" for name in JOINTS]),
    "action": feature([f"{name}.pos" for name in JOINTS]),
}


@pytest.fixture(params=["v2.1", "v3.0"])
def dataset(request, tmp_path, motion):
    episodes = [[q, qd, tau, 0.0 * q] for q, qd, tau in motion]
    return write_dataset(tmp_path / "set", request.param, episodes, FEATURES)


def test_episodes_are_recordings(dataset, arm, motion):
    """Numbers are those of the files to the last bit, and times are multiples of the period."""
    for k, (q, qd, tau) in enumerate(motion):
        recording = dd.read_recording(f"{dataset}#{k}", arm, RADIANS)
        for result, expected in ((recording.q, q), (recording.qd, qd), (recording.tau, tau)):
            np.testing.assert_array_equal(result, expected)
        np.testing.assert_array_equal(
            recording.stamp - recording.offset, np.arange(len(q)) * 20_000_000
        )
    for path, what in (
        (dataset, "is one of 3 episodes; expected a number"),
        (f"{dataset}#3", "is one of 3 episodes"),
    ):
        with pytest.raises(dd.InputError, match=what):
            dd.read_recording(path, arm, RADIANS)


def test_the_command_analyses_all_episodes(dataset, tmp_path, capsys):
    """A dataset stands for its episodes, in the order of their numbers."""
    out = tmp_path / "all.json"
    columns = tmp_path / "map.yaml"
    columns.write_text("scale: {position: rad}")
    arguments = ["analyse", str(dataset), "--urdf", "panda", "--set", "locked_joints=*"]
    arguments += ["--columns", str(columns)]
    assert main([*arguments, "--json", str(out)]) < 2
    assert f"{dataset}#2" in capsys.readouterr().out
    recordings = json.loads(out.read_text())["recordings"]
    assert [recording["states"] for recording in recordings] == list(LENGTHS)


def test_the_unit_of_positions_is_asked_for(dataset, arm):
    """No dataset states whether positions are radians, degrees or percent."""
    for columns in (None, {"scale": {"velocity": "rad/s"}}):
        with pytest.raises(
            dd.InputError, match=r"unit 'not stated by the .*`scale: \{position: UNIT\}`"
        ):
            dd.read_recording(f"{dataset}#0", arm, columns)


DESK = "shoulder_pan", "elbow_flex", "gripper"


def test_units_and_names_are_never_guessed(tmp_path):
    """Degrees and units of the range need a scale; names that are no joints of the robot need a
    map.
    """
    q = np.column_stack(
        [np.linspace(5, 40, 60), np.linspace(0, -30, 60), np.linspace(0, 100, 60)]
    ).astype(np.float32)
    names = feature([f"{name}.pos" for name in DESK])
    root = write_dataset(tmp_path / "desk", "v3.0", [[q]], {"observation.state": names})
    model = arm_of("a1", "a2", "jaw")
    joints = dict(zip(DESK, ("a1", "a2", "jaw"), strict=True))
    options = {"parameters": {"missing_velocity": "estimate"}}
    with pytest.raises(
        dd.InputError, match=r"not stated.*expected .*rad or m.*`scale: \{position: UNIT\}`"
    ):
        dd.read_recording(root, model, joint_names=joints, **options)
    with pytest.raises(
        dd.InputError, match="no columns are recognized as positions of a1, a2, jaw"
    ):
        dd.read_recording(root, model, {"scale": {"position": "deg"}}, **options)
    scale = {"position": ["deg", "deg", 1e-3]}
    recording = dd.read_recording(root, model, {"scale": scale}, joint_names=joints, **options)
    np.testing.assert_allclose(recording.q, (q * [np.pi / 180, np.pi / 180, 1e-3])[1:], rtol=1e-12)
    bare = write_dataset(
        tmp_path / "bare", "v2.1", [[q / 100]], {"observation.state": feature(None, 3)}
    )
    with pytest.raises(
        dd.InputError, match=r"no columns are recognized .*columns: .*observation\.state"
    ):
        dd.read_recording(bare, model, **options)
    by_map = RADIANS | {"position": "observation.state", "joints": ["jaw", "a2", "a1"]}
    assert dd.read_recording(bare, model, by_map, **options).q[:, 2].tolist() == pytest.approx(
        (q[1:, 0] / 100).tolist()
    )


def test_damaged_datasets_are_named(dataset, arm):
    info = dataset / "meta" / "info.json"
    for path in dataset.glob("data/**/*"):
        if path.is_file():
            path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(dd.InputError, match=r"\.parquet' cannot be read"):
        dd.read_recording(f"{dataset}#0", arm)
    for text in (
        "{",
        '{"fps": 30}',
        json.dumps(json.loads(info.read_text()) | {"data_path": "data/{other}"}),
    ):
        info.write_text(text)
        with pytest.raises(dd.InputError, match="is no LeRobot dataset of version 2 or 3"):
            dd.read_recording(f"{dataset}#0", arm)
