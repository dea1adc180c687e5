# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings from files: bags of every kind, tables of every kind, real ones; and what is written is read again."""

import json
import os
import subprocess
import sys
from argparse import Namespace
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.bags.mcap_writer import McapWriter
from diag_dynamics.cli import given
from diag_dynamics.cli.main import main
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import definition_with_parts, message_type
from hostile import JOINT_STATE, START, Driver, S

pytest.importorskip("pyarrow", reason="pyarrow is not installed")
pytest.importorskip("rosbags", reason="rosbags is not installed")
from mcap.reader import make_reader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

RECORDINGS = Path(
    os.environ.get("DIAG_DYNAMICS_RECORDINGS", Path(__file__).parents[2].parent / "shared" / "recordings")
)
MS = 10**6
COUNT = 400
TIME = "builtin_interfaces/msg/Time"


@pytest.fixture(scope="module")
def panda():
    return dd.load_robot("panda")


@pytest.fixture(scope="module")
def driven(panda):
    """Messages of a driver, their stamps, and what is in them."""
    driver = Driver(panda, 3)
    stamps = START + np.arange(COUNT) * 2 * MS
    states = [driver.state(int(stamp)) for stamp in stamps]
    return driver.names, stamps, *(np.array([state[k] for state in states]) for k in (1, 2, 3))


@pytest.fixture(scope="module")
def raws(panda):
    driver = Driver(panda, 3)
    return [driver.good(START + k * 2 * MS) for k in range(COUNT)]


def write_mcap(path, raws, description=None, encoding="cdr", topics=("/joint_states",)):
    with McapWriter(path, chunk_size=20_000) as writer:
        if description:
            text = message_type("std_msgs/msg/String")(data=description)
            channel = writer.channel("/robot_description", "std_msgs/msg/String", "string data")
            row = np.frombuffer(Template(text).encoded(), dtype=np.uint8)[None]
            writer.write_rows(channel, row, np.array([START - S]))
        for topic in topics:
            channel = writer.channel(topic, JOINT_STATE, definition_with_parts(JOINT_STATE), encoding)
            for k, raw in enumerate(raws):
                row = np.frombuffer(raw, dtype=np.uint8)[None]
                writer.write_rows(channel, row, np.array([START + k * 2 * MS + 1000]))


def write_bag(path, raws, kind):
    """The same as rosbags writes it."""
    if kind == "bag":
        store, newer = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)
        Header, Time, Joints = (store.types[name] for name in ("std_msgs/msg/Header", TIME, JOINT_STATE))
        with Writer1(path) as writer:
            connection = writer.add_connection("/joint_states", JOINT_STATE, typestore=store)
            for k, raw in enumerate(raws):
                new = newer.deserialize_cdr(raw + bytes(-len(raw) % 4), JOINT_STATE)
                header = Header(k, Time(new.header.stamp.sec, new.header.stamp.nanosec), new.header.frame_id)
                old = Joints(header, new.name, new.position, new.velocity, new.effort)
                writer.write(connection, START + k * 2 * MS + 1000, store.serialize_ros1(old, JOINT_STATE))
        return
    store = get_typestore(Stores.ROS2_JAZZY)
    plugin = {"db3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[kind]
    with Writer2(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/joint_states", JOINT_STATE, typestore=store)
        for k, raw in enumerate(raws):
            writer.write(connection, START + k * 2 * MS + 1000, raw)


def check(recording, driven):
    _, stamps, position, velocity, effort = driven
    assert recording.findings == []
    np.testing.assert_array_equal(recording.stamp, stamps)
    np.testing.assert_allclose(recording.t, stamps * 1e-9, rtol=1e-15)
    for actual, expected in ((recording.q, position), (recording.qd, velocity), (recording.tau, effort)):
        np.testing.assert_array_equal(actual, expected)


# --- Bags ---


def test_mcap(tmp_path, panda, driven, raws):
    path = tmp_path / "a recording.mcap"
    write_mcap(path, raws)
    check(dd.read_recording(path, panda), driven)


@pytest.mark.parametrize("kind", ["db3", "mcap", "bag"])
def test_bags_of_others(tmp_path, panda, driven, raws, kind):
    path = tmp_path / ("recording.bag" if kind == "bag" else "recording")
    write_bag(path, raws, kind)
    check(dd.read_recording(str(path), panda), driven)
    if kind == "db3":
        check(dd.read_recording(path / "recording.db3", panda), driven)


def test_robot_of_the_bag(tmp_path, driven, raws):
    path = tmp_path / "recording.mcap"
    write_mcap(path, raws, Path(find_urdf("panda")).read_text(encoding="utf-8"))
    recording = dd.read_recording(path)
    assert recording.model.name == "panda"
    check(recording, driven)


def test_pieces_are_the_whole(tmp_path, panda, raws):
    path = tmp_path / "recording.mcap"
    write_mcap(path, raws)
    whole = dd.read_recording(path, panda)
    pieces = list(dd.stream_recording(path, panda, size=100))
    assert len(pieces) > 1
    np.testing.assert_array_equal(np.concatenate([piece.q for piece in pieces]), whole.q)
    assert pieces[-1].counts == whole.counts
    assert "400 states" in repr(whole)


def test_every_recording_of_a_command_is_read_by_the_same_parameters(tmp_path, driven, raws):
    """The later ones, too, whose robot is that of the first one's description; and as often as it is wanted."""
    paths = [str(tmp_path / name) for name in ("a.mcap", "b.mcap")]
    for path in paths:
        write_mcap(path, raws, Path(find_urdf("panda")).read_text(encoding="utf-8"))
    chosen = Namespace(columns=None, topic=None, start=None, end=None)
    recordings = given.streamed(chosen, paths, {"effort_scale": ["*=0.5"]}, None)
    efforts = driven[4][:, [driven[0].index(name) for name in recordings[0].model.dof_names]]
    for _ in range(2):
        for one in recordings:
            assert one.model is recordings[0].model
            np.testing.assert_array_equal(np.concatenate([piece.tau for piece in one.pieces()]), 0.5 * efforts)


@pytest.mark.parametrize("cut", [0.3, 0.7, 0.999])
def test_cut_files_give_what_is_whole(tmp_path, panda, driven, raws, cut):
    path = tmp_path / "recording.mcap"
    write_mcap(path, raws)
    content = path.read_bytes()
    path.write_bytes(content[: int(cut * len(content))])
    recording = dd.read_recording(path, panda)
    assert any(finding.cause == "unread" for finding in recording.findings)
    np.testing.assert_array_equal(recording.q, driven[2][: len(recording)])


def test_what_is_refused_names_it(tmp_path, panda, raws):
    path = tmp_path / "recording.mcap"
    with pytest.raises(dd.InputError, match=r"no file or folder.*nothing\.mcap"):
        dd.read_recording(tmp_path / "nothing.mcap", panda)
    write_mcap(path, raws)
    with pytest.raises(dd.InputError, match=r"recording\.mcap"):
        dd.read_recording(tmp_path / "recordin.mcap", panda)
    with pytest.raises(dd.InputError, match="robot_description"):
        dd.read_recording(path)
    with pytest.raises(dd.InputError, match=r"no topic '/joint_state'.*'/joint_states'"):
        dd.read_recording(path, panda, topic="/joint_state")
    with pytest.raises(dd.InputError, match="map of columns"):
        dd.read_recording(path, panda, columns={"time": "t"})
    with pytest.raises(dd.InputError, match="no parameter 'max_agge'"):
        dd.read_recording(path, panda, parameters={"max_agge": 1.0})
    write_mcap(path, raws, encoding="json")
    with pytest.raises(dd.InputError, match="encoded as 'json'"):
        dd.read_recording(path, panda)
    write_mcap(path, raws, topics=("/left/states", "/right/states"))
    with pytest.raises(dd.InputError, match="/left/states, /right/states"):
        dd.read_recording(path, panda)
    assert len(dd.read_recording(path, panda, topic="/left/states")) == COUNT
    write_mcap(path, [])
    assert len(dd.read_recording(path, panda)) == 0
    path.write_bytes(b"")
    with pytest.raises(dd.InputError, match=r"recording\.mcap"):
        dd.read_recording(path, panda)


def test_parameters_judge(tmp_path, panda, raws):
    path = tmp_path / "recording.mcap"
    write_mcap(path, raws)
    half = dd.read_recording(path, panda, parameters={"effort_scale": ["*=0.5"]})
    np.testing.assert_array_equal(half.tau, 0.5 * dd.read_recording(path, panda).tau)
    assert dd.read_recording(path, panda, parameters={"effort_available": ["*=false"]}).tau is None


# --- Tables ---


@pytest.mark.parametrize("kind", ["csv", "npz", "parquet"])
def test_tables(tmp_path, panda, driven, kind):
    import pandas

    names, stamps, position, velocity, effort = driven
    path, t = tmp_path / f"table.{kind}", (stamps - stamps[0]) * 1e-9
    blocks = {"q": position, "qd": velocity, "tau": effort}
    if kind == "npz":
        np.savez(path, time=t, position=position, velocity=velocity, effort=effort)
    else:
        columns = {f"{block}_{name}": values[:, k] for block, values in blocks.items() for k, name in enumerate(names)}
        frame = pandas.DataFrame({"t": t} | columns)
        frame.to_csv(path, index=False) if kind == "csv" else frame.to_parquet(path)
    recording = dd.read_recording(path, panda)
    np.testing.assert_allclose(recording.t, t, atol=1e-12)
    for actual, expected in ((recording.q, position), (recording.qd, velocity), (recording.tau, effort)):
        np.testing.assert_array_equal(actual, expected)
    assert recording.offset == S  # a stamp of zero is none


def test_garbage_rows_are_refused_and_counted(tmp_path, panda, driven):
    names, stamps, position, velocity, effort = driven
    header = ["t", *(f"{block}_{name}" for block in ("q", "qd", "tau") for name in names)]
    rows = np.column_stack([(stamps - stamps[0]) * 1e-9, position, velocity, effort]).tolist()
    lines = [",".join(map(repr, row)) for row in rows]
    lines[100] = ",".join([repr(rows[100][0]), *["253"] * (len(header) - 1)])
    lines[150] = ",".join([repr(rows[150][0]), "1e297", *map(repr, rows[150][2:])])
    lines[200] = ",".join([repr(rows[200][0] + 86400.0), *map(repr, rows[200][1:])])
    lines[250] = "1,2,3"
    path = tmp_path / "table.csv"
    path.write_text("\n".join([",".join(header), *lines]) + "\n")
    recording = dd.read_recording(path, panda)
    assert recording.counts["rejected: absurd value"] == 2
    causes = {finding.cause for finding in recording.findings}
    assert "unread" in causes
    # The jump of a day moves the joints' time on: what comes then is late, until time is believed to have started anew.
    assert len(recording) > COUNT - 280
    assert not (recording.q == 253).any()


# --- Real recordings ---


def real(name):
    path = RECORDINGS / name
    if not path.exists():
        pytest.skip(f"{path} is not there: recordings of real arms are no part of this package")
    return path


def without_hand(path):
    """URDF of a Panda without its hand."""
    import xml.etree.ElementTree as ET

    hand = {"panda_hand", "panda_hand_tcp", "panda_leftfinger", "panda_rightfinger"}
    root = ET.parse(find_urdf("panda")).getroot()
    for part in list(root):
        child = part.find("child")
        if part.get("name") in hand or (child is not None and child.get("link") in hand):
            root.remove(part)
    path.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
    return path


def test_a_real_panda(tmp_path):
    path, urdf = real("panda/exciting_trajectory.csv.gz"), without_hand(tmp_path / "panda.urdf")
    assert main(["analyse", str(path), "--urdf", str(urdf), "--quiet", "--json", str(tmp_path / "a.json")]) == 0
    summary = json.loads((tmp_path / "a.json").read_text())
    assert summary["states"] == 20544
    assert summary["explained"] == pytest.approx(0.95, abs=0.01)
    assert summary["explained_with_potential"] > 0.99
    assert summary["quality"]["velocity_delay"] == pytest.approx(0.005, abs=0.001)


def test_a_hand_that_is_not_mounted_is_missing_in_the_balance(tmp_path):
    path = real("panda/exciting_trajectory.csv.gz")
    urdf = tmp_path / "panda.urdf"
    urdf.write_text(Path(find_urdf("panda")).read_text(encoding="utf-8"))
    fixed = ["--set", "locked_joints=['panda_finger_joint1=0.0']", "mimic=free", "massless=lock"]
    fixed[1] = "locked_joints=['panda_finger_joint1=0.0', 'panda_finger_joint2=0.0']"
    status = main(["analyse", str(path), "--urdf", str(urdf), *fixed, "--quiet", "--json", str(tmp_path / "a.json")])
    summary = json.loads((tmp_path / "a.json").read_text())
    assert status == 1
    assert summary["explained"] == pytest.approx(0.29, abs=0.02)
    assert "payload" in summary["balance"]["says"]


def test_a_real_kuka(tmp_path):
    path, urdf = real("kuka_lwr4/measurements_1.npz"), real("kuka_lwr4/kuka_lwr4.urdf")
    main(["analyse", str(path), "--urdf", str(urdf), "--quiet", "--json", str(tmp_path / "a.json")])
    summary = json.loads((tmp_path / "a.json").read_text())
    assert summary["states"] == 5027
    assert summary["explained"] < 0.0 < 0.95 < summary["explained_with_potential"]


# --- What is written ---


@pytest.fixture(scope="module")
def written(tmp_path_factory, panda, raws):
    folder = tmp_path_factory.mktemp("written")
    write_mcap(folder / "in.mcap", raws)
    outputs = ["-o", "out.mcap", "--parquet", "out.parquet", "--csv", "out.csv", "--json", "out.json"]
    outputs = [str(folder / one) if "." in one else one for one in outputs]
    status = main(["analyse", str(folder / "in.mcap"), "--urdf", "panda", *outputs, "--quiet"])
    assert status == 0
    assert not list(folder.glob("*.part"))
    return folder


@pytest.mark.parametrize("name", ["out.mcap", "out.csv", "out.json"])
def test_what_is_no_file_is_written_itself(written, tmp_path, name):
    """A named pipe stays one, as /dev/null has to, and carries what the file has; behind a link stands the file."""
    pipe, link, target = tmp_path / "pipe", tmp_path / "link", tmp_path / "elsewhere" / "target"
    os.mkfifo(pipe)
    target.parent.mkdir()
    link.symlink_to(target)
    option, command = f"--{name.partition('.')[2]}", ["analyse", str(written / "in.mcap"), "--urdf", "panda", "--quiet"]
    with ThreadPoolExecutor(1) as pool:
        read = pool.submit(pipe.read_bytes)
        assert main([*command, option, str(pipe)]) == 0
        assert read.result(timeout=60) == (written / name).read_bytes()
    assert pipe.is_fifo()
    for _ in range(2):  # it is not there, and it is
        assert main([*command, option, str(link)]) == 0
        assert link.is_symlink() and target.read_bytes() == (written / name).read_bytes()
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["elsewhere", "link", "pipe", "target"]


@pytest.mark.parametrize("name", ["out.mcap", "out.csv", "out.json"])
def test_a_file_with_the_temporary_name_stays(written, tmp_path, name):
    """It is somebody's, or of another process that writes the same."""
    other = tmp_path / f"{name}.part"
    other.write_text("mine")
    command = ["analyse", str(written / "in.mcap"), "--urdf", "panda", "--quiet"]
    assert main([*command, f"--{name.partition('.')[2]}", str(tmp_path / name)]) == 0
    assert other.read_text() == "mine" and (tmp_path / name).read_bytes() == (written / name).read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [name, other.name]


def test_parquet_into_a_pipe_is_refused(written, tmp_path, capsys):
    """Its writer asks where in the file it is. The pipe stays."""
    os.mkfifo(tmp_path / "pipe")
    with ThreadPoolExecutor(1) as pool:
        pool.submit((tmp_path / "pipe").read_bytes)
        assert main(["analyse", str(written / "in.mcap"), "--urdf", "panda", "--parquet", str(tmp_path / "pipe")]) == 2
    assert f"'{tmp_path}/pipe' cannot be written: lseek failed" in capsys.readouterr().err
    assert (tmp_path / "pipe").is_fifo()


@pytest.fixture(scope="module")
def evaluated(panda, driven):
    _, _, position, velocity, effort = driven
    dynamics = dd.DiagonalDynamics(panda)
    return dynamics.evaluate_batch(position, velocity, effort, friction=True)


def test_parquet_has_every_quantity(written, panda, driven, evaluated):
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(written / "out.parquet")
    s = evaluated
    for quantity in ("nu", "xi", "epsilon", "kappa", "coriolis", "gravity", "articulated_inertia", "energy_share"):
        for k, name in enumerate(panda.dof_names):
            np.testing.assert_array_equal(table[f"{quantity}.{name}"].to_numpy(), getattr(s, quantity)[:, k])
    for k, name in enumerate(panda.link_names):
        np.testing.assert_array_equal(table[f"link_energy.{name}"].to_numpy(), s.link_energy[:, k])
    np.testing.assert_array_equal(table["kinetic_energy"].to_numpy(), s.kinetic_energy)
    np.testing.assert_array_equal(table["power"].to_numpy(), s.effort_power)
    np.testing.assert_array_equal(table["stamp"].to_numpy(), driven[1])
    assert table.schema.field("nu.panda_joint1").metadata[b"unit"] == b"J^0.5"
    assert table.schema.metadata[b"robot"] == b"panda"
    assert not any(field.nullable for field in table.schema)


def test_parquet_tells_where_a_time_or_a_peak_is(written, driven, evaluated):
    """What is no joint's or link's, so that who looks for it can skip the rest of a day."""
    import pyarrow.parquet

    group = pyarrow.parquet.ParquetFile(written / "out.parquet").metadata.row_group(0)
    told = {one.path_in_schema: one.statistics for one in map(group.column, range(group.num_columns))}
    for name, expected in (("stamp", driven[1]), ("kinetic_energy", evaluated.kinetic_energy)):
        assert (told[name].min, told[name].max) == (expected.min(), expected.max())
    assert told["nu.panda_joint1"] is None


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_tables_of_ours_are_recordings(written, panda, driven, kind):
    _, stamps, position, velocity, effort = driven
    again = dd.read_recording(written / f"out.{kind}", panda)
    np.testing.assert_array_equal(again.stamp, stamps)
    for actual, expected in ((again.q, position), (again.qd, velocity), (again.tau, effort)):
        np.testing.assert_array_equal(actual, expected)


def test_mcap_has_every_field(written, panda, driven, evaluated):
    """Read by mcap and rosbags, field by field."""
    from rosbags.typesys import get_types_from_msg

    store = get_typestore(Stores.ROS2_JAZZY)
    s, found = evaluated, {}
    with open(written / "out.mcap", "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if schema.name not in store.fielddefs:
                store.register(get_types_from_msg(schema.data.decode(), schema.name))
            raw = message.data + bytes(-len(message.data) % 4)
            found.setdefault(channel.topic, []).append((message.log_time, store.deserialize_cdr(raw, schema.name)))
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/diag_dynamics/state": COUNT,
        "/diag_dynamics/kinetic_energy": COUNT,
        "/diag_dynamics/external_torque": COUNT,
    }
    _, stamps, position, velocity, effort = driven
    for k, (log_time, message) in enumerate(found["/diag_dynamics/state"]):
        assert log_time == stamps[k] + 1000
        assert message.header.stamp.sec * S + message.header.stamp.nanosec == stamps[k]
        assert message.header.frame_id == panda.root_link
        assert list(message.dof_names) == list(panda.dof_names)
        for field, values in (("position", position), ("velocity", velocity), ("effort", effort)):
            np.testing.assert_array_equal(getattr(message, field), values[k])
        for field in ("nu", "xi", "epsilon", "kappa", "coriolis", "gravity", "articulated_inertia", "friction"):
            np.testing.assert_array_equal(getattr(message, field), getattr(s, field)[k])
        assert message.kinetic_energy == s.kinetic_energy[k]
        assert message.power == s.effort_power[k]
        assert message.effort_valid
        assert message.friction_valid
        assert not message.velocity_estimated
    for k, (_, message) in enumerate(found["/diag_dynamics/kinetic_energy"]):
        assert message.total == s.kinetic_energy[k]
        np.testing.assert_array_equal(message.link_energy, s.link_energy[k])
        np.testing.assert_array_equal(message.energy_share, s.energy_share[k])
        assert list(message.link_names) == list(panda.link_names)
    observed = [message for _, message in found["/diag_dynamics/external_torque"]]
    assert [message.valid for message in observed] == [False] + [True] * (COUNT - 1)
    assert observed[0].residual.size == 0
    assert observed[5].residual.size == panda.nv
    assert all(one.torque_threshold.size == one.joint_collision.size == 0 for one in observed)
    assert all(one.torque_norm_threshold == np.inf for one in observed)


def test_mcap_has_alarms(tmp_path, panda, raws):
    """Joint by joint, as the detector says of the same numbers."""
    from rosbags.typesys import get_types_from_msg

    write_mcap(tmp_path / "in.mcap", raws)
    thresholds = dd.AlarmThresholds({"panda_joint1": 1e-3, "panda_joint2": 2.0}, 50.0, 40.0)
    settings = [
        *("external_torque.gain=25", "alarm.joints=[panda_joint1=0.001, panda_joint2=2]"),
        *("alarm.external_torque=50", "alarm.norm=40"),
    ]
    given = [word for one in settings for word in ("--set", one)]
    paths = [str(tmp_path / name) for name in ("in.mcap", "out.mcap")]
    main(["analyse", paths[0], "--urdf", "panda", "-o", paths[1], *given, "--quiet"])
    store, found, stamps = get_typestore(Stores.ROS2_JAZZY), [], []
    with open(paths[1], "rb") as file:
        for schema, _, message in make_reader(file).iter_messages(topics=["/diag_dynamics/external_torque"]):
            if schema.name not in store.fielddefs:
                store.register(get_types_from_msg(schema.data.decode(), schema.name))
            found.append(store.deserialize_cdr(message.data + bytes(-len(message.data) % 4), schema.name))
            stamps.append(found[-1].header.stamp.sec * S + found[-1].header.stamp.nanosec)
    valid, nothing = np.array([one.valid for one in found]), np.zeros(panda.nv)
    r = np.array([one.residual if one.valid else nothing for one in found])
    torque = np.array([one.external_torque if one.valid else nothing for one in found])
    judged = dd.AlarmDetector(panda.dof_names, thresholds).judge(np.array(stamps), r, torque.copy(), valid)
    assert valid.sum() == COUNT - 1 and judged.joints[:, 0].any() and not judged.joints[:, 2:].any()
    for k, one in enumerate(found):
        assert one.collision == judged.alarm[k]
        assert one.joint_collision.tolist() == (judged.joints[k].tolist() if one.valid else [])
        assert one.torque_threshold.tolist() == [1e-3, 2.0] + [np.inf] * (panda.nv - 2)
        assert one.torque_norm == pytest.approx(np.linalg.norm(torque[k])) and one.torque_norm_threshold == 50.0
        assert one.threshold == 40.0


def test_summary_for_programs(written):
    summary = json.loads((written / "out.json").read_text())
    assert summary["states"] == COUNT
    assert set(summary) >= {"duration", "rejected", "kinetic_energy", "explained", "residual_power", "collisions"}
    assert set(summary["kinetic_energy"]) >= {"mean", "max", "at"}


# --- The command ---


def test_command_says_what_is_wrong(tmp_path, raws, capsys):
    path = tmp_path / "in.mcap"
    write_mcap(path, raws)
    assert main(["analyse", str(tmp_path / "none.mcap")]) == 2
    assert "no file or folder" in capsys.readouterr().err
    assert main(["analyse", str(path)]) == 2
    assert "robot_description" in capsys.readouterr().err
    assert main(["analyse", str(path), "--urdf", "panda", "--set", "max_agee=1"]) == 2
    assert "'max_age' meant" in capsys.readouterr().err
    assert main(["analyse", str(path), "--urdf", "panda", "--parquet", str(tmp_path / "no" / "out.parquet")]) == 2
    assert "no folder" in capsys.readouterr().err
    assert main(["analyse", str(path), "--urdf", "ur5", "--parquet", str(tmp_path / "out.parquet")]) == 2
    said = capsys.readouterr().err
    assert "not a single state" in said and ".." not in said
    assert not list(tmp_path.glob("out*"))
    arm = tmp_path / "arm.yaml"
    arm.write_text("joints: {panda_joint1: {damping: 1.0}}\n")
    assert main(["analyse", str(path), "--urdf", "panda", "--alarms", str(arm)]) == 2
    assert f"'{arm}' has no thresholds" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--mcap", "--parquet", "--csv", "--json"])
def test_nothing_is_written_over_what_is_read(tmp_path, raws, capsys, option):
    path, urdf, folder = tmp_path / "in.mcap", tmp_path / "panda.urdf", tmp_path / "bag"
    write_mcap(path, raws)
    write_bag(folder, raws, "mcap")
    urdf.write_text(Path(find_urdf("panda")).read_text(encoding="utf-8"))
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    for recording, output in ((path, path), (path, urdf), (folder, folder / "bag.mcap"), (folder, folder / "new")):
        assert main(["analyse", str(recording), "--urdf", str(urdf), option, str(output), "--quiet"]) == 2
        assert "is read, so nothing is written there" in capsys.readouterr().err
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


def test_options_that_would_do_nothing_are_refused(tmp_path, raws, capsys):
    path, out = tmp_path / "in.mcap", tmp_path / "out"
    write_mcap(path, raws)
    for options, what in (
        (["--topics", "state"], "--topics are those of a file that --mcap writes"),
        (["--out", str(out)], "--out belongs to --fleet"),
        (["--piece", "60"], "--piece belongs to --fleet"),
        (["--workers", "0"], "--workers belongs to --fleet"),
        (["--no-parquet"], "--no-parquet belongs to --fleet"),
        (["--parquet", str(out), "--csv", str(out)], "--parquet is written into it"),
        (["--json", str(out / "a.json")], "there is no folder"),
        (["--start", "50"], "no message is within --start and --end"),
    ):
        assert main(["analyse", str(path), "--urdf", "panda", *options]) == 2
        assert what in capsys.readouterr().err
    assert not list(tmp_path.glob("out*"))


def test_joints_that_never_come_are_named_and_can_be_held(tmp_path, driven, capsys):
    """A Panda by its name, of whose gripper the recording knows nothing."""
    names, stamps, position, velocity, effort = driven
    arm = [k for k, name in enumerate(names) if "finger" not in name]
    columns = {"t [s]": (stamps - stamps[0]) * 1e-9}
    for letter, values in (("q", position), ("qd", velocity), ("tau", effort)):
        columns |= {f"{letter}_{names[k]}": values[:, k] for k in arm}
    path = tmp_path / "arm.csv"
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")
    assert main(["analyse", str(path), "--urdf", "panda"]) == 2
    told = capsys.readouterr().err
    assert f"incomplete ({COUNT} ×)" in told
    assert "never came: panda_finger_joint1." in told
    assert "held by locked_joints=panda_finger_joint1=0" in told
    held = ["--set", "locked_joints=panda_finger_joint1=0"]
    main(["analyse", str(path), "--urdf", "panda", *held, "--json", "-"])
    summary = json.loads(capsys.readouterr().out)
    assert summary["states"] == COUNT
    assert summary["degrees_of_freedom"] == [names[k] for k in arm]


def test_parameters_that_a_model_would_not_obey_are_refused(tmp_path, panda, raws):
    path = tmp_path / "in.mcap"
    write_mcap(path, raws)
    for name, value in (
        ("locked_joints", ["panda_joint1=0"]),
        ("gravity", [0.0, 0.0, -1.6]),
        ("friction_velocity", 0.1),
    ):
        with pytest.raises(dd.InputError, match=f"'{name}' shapes a robot"):
            dd.read_recording(path, panda, parameters={name: value})
    assert len(dd.read_recording(path, panda, parameters={"gravity": [0.0, 0.0, -9.81]})) == COUNT


def test_a_bag_of_nothing_says_why(tmp_path):
    path = tmp_path / "broken.mcap"
    path.write_bytes(bytes(range(256)) * 8)
    with pytest.raises(dd.InputError, match=r"has nothing.*byte 0: the file does not begin as one of MCAP does"):
        dd.read_recording(path)


@pytest.mark.parametrize("output", [("--json", "-"), ("--csv", "/dev/stdout")], ids=["json", "csv"])
def test_who_stops_listening_is_no_fault(tmp_path, raws, output):
    """As `… --json - | head -3` does."""
    path = tmp_path / "in.mcap"
    write_mcap(path, raws)
    listening, said = os.pipe()
    os.close(listening)
    command = [sys.executable, "-m", "diag_dynamics", "analyse", str(path), "--urdf", "panda", *output]
    done = subprocess.run(command, stdout=said, stderr=subprocess.PIPE, text=True, timeout=300)
    os.close(said)
    assert "Broken pipe" not in done.stderr
    assert done.returncode == 0


def test_help_says_eighty_per_cent(capsys):
    with pytest.raises(SystemExit):
        main(["analyse", "--help"])
    assert "80 % (" in capsys.readouterr().out


OUTPUTS = "-o", "--parquet", "--csv", "--json"


@pytest.fixture
def table(tmp_path, panda, driven):
    """The driver's messages as a table."""
    names, stamps, *values = driven
    path = tmp_path / "log.csv"
    header = ["t", *(f"{quantity}_{name}" for quantity in ("q", "qd", "tau") for name in names)]
    rows = np.column_stack([1e-9 * (stamps - stamps[0]), *values])
    np.savetxt(path, rows, delimiter=",", header=",".join(header), comments="")
    return path


@pytest.mark.parametrize("option", OUTPUTS)
def test_nothing_is_written_over_the_recording(tmp_path, table, option, capsys):
    before = table.read_bytes()
    (tmp_path / "link.csv").symlink_to(table)
    for recording, output in ((table, table), (table, tmp_path / "." / "link.csv"), (tmp_path / "link.csv", table)):
        assert main(["analyse", str(recording), "--urdf", "panda", option, str(output), "--quiet"]) == 2
        assert "is read, so nothing is written there" in capsys.readouterr().err
    assert table.read_bytes() == before
    assert sorted(one.name for one in tmp_path.iterdir()) == ["link.csv", "log.csv"]


def test_two_outputs_at_one_path_are_refused(tmp_path, table, capsys):
    path = str(tmp_path / "out")
    assert main(["analyse", str(table), "--urdf", "panda", "--csv", path, "--json", path, "--quiet"]) == 2
    assert "--csv is written into it" in capsys.readouterr().err
    assert not list(tmp_path.glob("out*"))


def test_what_is_no_file_may_be_given_twice(tmp_path, table):
    """As /dev/null, for which a pipe of our own stands here."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        given.refuse_outputs([str(table)], {"--csv": str(pipe), "--json": str(pipe)})
    finally:
        os.close(reader)


def test_a_link_that_leads_to_itself_is_named(tmp_path, table, capsys):
    path = tmp_path / "round"
    path.symlink_to(path)
    assert main(["analyse", str(table), "--urdf", "panda", "--csv", str(path), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert f"--csv '{path}'" in said
    assert "Traceback" not in said


def test_why_the_exit_status_is_1_is_said(table, capsys):
    *rows, last = table.read_text().splitlines()
    time, _, rest = last.split(",", 2)
    table.write_text("\n".join([*rows, f"{time},1e9,{rest}"]))
    assert main(["analyse", str(table), "--urdf", "panda"]) == 1
    assert "the exit status is 1: 1 message was rejected" in capsys.readouterr().err


def test_an_output_by_the_temporary_name_of_another_is_refused(tmp_path, table, capsys):
    path = str(tmp_path / "out")
    for first, second in (("--csv", "--json"), ("--json", "--csv")):
        given = [first, path, second, f"{path}.part", "--quiet"]
        assert main(["analyse", str(table), "--urdf", "panda", *given]) == 2
        assert f"{first} '{path}' has the name that {second} was given" in capsys.readouterr().err
    assert not list(tmp_path.glob("out*"))


def test_no_messages_are_written_into_the_bag(tmp_path, raws, capsys):
    (tmp_path / "bag").mkdir()
    write_mcap(tmp_path / "bag" / "bag_0.mcap", raws)
    out = str(tmp_path / "bag" / "out.mcap")
    assert main(["analyse", str(tmp_path / "bag"), "--urdf", "panda", "-o", out, "--quiet"]) == 2
    assert "is read, so nothing is written there" in capsys.readouterr().err


@pytest.mark.parametrize("option", OUTPUTS)
def test_outputs_that_cannot_be_written_are_named_first(tmp_path, table, option, capsys, monkeypatch):
    monkeypatch.setattr("diag_dynamics.recordings.analysis.Analysis.run", None)  # nothing is analysed
    for path, what in ((tmp_path, "it is a folder"), (tmp_path / "no" / "out", "no folder"), ("/proc/out", "No such")):
        if option != "-o" or path != tmp_path:
            assert main(["analyse", str(table), "--urdf", "panda", option, str(path), "--quiet"]) == 2
            said = capsys.readouterr().err
            assert what in said and str(path) in said
    assert [one.name for one in tmp_path.iterdir()] == ["log.csv"]


def test_a_full_disk_leaves_nothing(tmp_path, table):
    """By the limit of a shell: none of the files may become larger than 100 KiB."""
    outputs = " ".join(f"{option} out{option}" for option in OUTPUTS)
    command = f"ulimit -f 100; {sys.executable} -m diag_dynamics analyse log.csv --urdf panda {outputs}"
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    for only in ("", " --topics joint_space_dynamics"):
        ran = subprocess.run(
            ["bash", "-c", command + only], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert ran.returncode == 2, ran.stderr
        assert "File too large" in ran.stderr
        assert [one.name for one in tmp_path.iterdir()] == ["log.csv"]


def test_names_that_are_no_utf8(tmp_path, table, capsys):
    folder = tmp_path / os.fsdecode(b"a \xff\xfe")
    folder.mkdir()
    table.rename(folder / "log.csv")
    outputs = [one for option in OUTPUTS for one in (option, str(folder / f"out{option}"))]
    assert main(["analyse", str(folder / "log.csv"), "--urdf", "panda", *outputs]) == 0
    assert len(list(folder.iterdir())) == 5
    assert main(["analyse", str(folder / "log.csvv"), "--urdf", "panda"]) == 2


def test_losses_are_told_before_what_was_understood(tmp_path, table, capsys):
    lines = table.read_text().splitlines()
    lines[50] = lines[50].replace(",", ",nan,", 1).rsplit(",", 1)[0]
    table.write_text("\n".join(lines))
    assert main(["analyse", str(table), "--urdf", "panda"]) == 1
    said = capsys.readouterr().out
    assert "  rejected: no position" in said.split("Worth knowing")[1].split("How it was read")[0]
    assert "note" not in said
    recording = dd.read_recording(table, dd.load_robot("panda"))
    assert [one.cause == "note" for one in recording.findings] == [False] + [True] * 4


def test_names_of_another_robot_are_told(tmp_path, raws, capsys):
    path = tmp_path / "in.mcap"
    write_mcap(path, raws)
    assert main(["analyse", str(path), "--urdf", "ur5"]) == 2
    assert "without a joint of this robot, of panda_" in capsys.readouterr().err


def test_a_table_without_velocities_says_what_to_do(tmp_path, table, capsys):
    columns = np.loadtxt(table, delimiter=",", skiprows=1)
    header = table.read_text().partition("\n")[0].split(",")
    keep = [k for k, name in enumerate(header) if not name.startswith("qd_")]
    np.savetxt(table, columns[:, keep], delimiter=",", header=",".join(header[k] for k in keep), comments="")
    assert main(["analyse", str(table), "--urdf", "panda"]) == 2
    assert "(missing_velocity: estimate" in capsys.readouterr().err
    assert main(["analyse", str(table), "--urdf", "panda", "--set", "missing_velocity=estimate"]) in (0, 1)


def test_times_that_no_stamp_can_be_of(tmp_path, table):
    columns = np.loadtxt(table, delimiter=",", skiprows=1)
    columns[100:110, 0] = 1e15
    np.savetxt(table, columns, delimiter=",", header=table.read_text().partition("\n")[0], comments="")
    recording = dd.read_recording(table, dd.load_robot("panda"))
    assert recording.counts["rejected: malformed stamp"] == 10
    (note,) = [one.text for one in recording.findings if "no stamp can be of" in one.text]
    assert note.startswith("10 rows") and "row 100, of 1e+15 s" in note


def test_seldom_states_with_efforts_are_no_success(tmp_path, table, capsys):
    columns = np.loadtxt(table, delimiter=",", skiprows=1)
    columns[:, 0] *= 1e3
    np.savetxt(table, columns, delimiter=",", header=table.read_text().partition("\n")[0], comments="")
    assert main(["analyse", str(table), "--urdf", "panda"]) == 1
    assert "milliseconds" in capsys.readouterr().out


def test_several_recordings(tmp_path, table, raws, capsys):
    """Each has its summary, and all a table; one that cannot be read stops no other."""
    bag, out = tmp_path / "in.mcap", tmp_path / "all.json"
    write_mcap(bag, raws)
    several = ["analyse", str(bag), str(tmp_path / "none.csv"), str(table), "--urdf", "panda"]
    assert main([*several, "--json", str(out)]) == 1
    said, wrong = capsys.readouterr()
    assert "no file or folder" in wrong
    *rows, failed = said.splitlines()[-4:]
    assert [row.split()[-1] for row in rows] == ["recording", str(bag), str(table)]
    assert [row.split()[0] for row in rows] == ["states", str(COUNT), str(COUNT)]
    assert failed == f"failed: {tmp_path / 'none.csv'}"
    summary = json.loads(out.read_text())
    assert [one["recording"] for one in summary["recordings"]] == [str(bag), str(table)]
    assert [one["states"] for one in summary["robots"]] == [2 * COUNT]
    assert list(summary["failed"]) == [str(tmp_path / "none.csv")]
    main(["analyse", str(bag), "--urdf", "panda", "--json", str(out), "--quiet"])
    alone = json.loads(out.read_text())
    assert summary["recordings"][0] == alone
    assert main(["analyse", str(bag), str(table), "--urdf", "panda", "--quiet"]) == 0
    assert main(["analyse", str(tmp_path / "a"), str(tmp_path / "b"), "--quiet"]) == 2
    capsys.readouterr()
    for option in OUTPUTS[:3]:
        assert main([*several, option, str(tmp_path / "x")]) == 2
        assert "is of a single recording, and there are 3: --fleet" in capsys.readouterr().err
    assert main([*several, "--json", str(table)]) == 2
    assert "is read, so nothing is written there" in capsys.readouterr().err


def test_command_takes_the_monitors_file(tmp_path, raws, capsys):
    path, file = tmp_path / "in.mcap", tmp_path / "monitor.yaml"
    write_mcap(path, raws)
    file.write_text("/**:\n  ros__parameters:\n    external_torque: {gain: 10, threshold: 0.5}\n    max_age: 2\n")
    main(["analyse", str(path), "--urdf", "panda", "--parameters", str(file), "--json", "-"])
    summary = json.loads(capsys.readouterr().out)
    known = {"gain": 10.0, "threshold": 0.5, "judged": [], "missing": [], "observed": COUNT - 1, "says": ""}
    assert summary["observer"] == known
    assert summary["collisions"]
    file.write_text("/**:\n  ros__parameters: {nonsense: 1}\n")
    assert main(["analyse", str(path), "--urdf", "panda", "--parameters", str(file)]) == 2
    assert "no parameter 'nonsense'" in capsys.readouterr().err


def test_command_takes_the_robots_file(tmp_path, raws, capsys):
    """Rotor inertias of a file beside the URDF: more kinetic energy by half of each times its joint's rate squared."""
    path, file = tmp_path / "in.mcap", tmp_path / "arm.yaml"
    write_mcap(path, raws)
    model = dd.load_robot("panda")
    dd.Parameters(joints={"panda_joint1": dd.JointParameters(armature=0.8)}).save(file)

    def mean(*options):
        main(["analyse", str(path), "--urdf", "panda", "--json", "-", *options])
        return json.loads(capsys.readouterr().out)["kinetic_energy"]["mean"]

    rate = dd.read_recording(path, model).qd[:, 0]
    assert mean("--parameters", str(file)) - mean() == pytest.approx(0.4 * np.mean(rate**2), rel=1e-9)
    file.write_text("joints: {elbow: {damping: 1}}")
    assert main(["analyse", str(path), "--urdf", "panda", "--parameters", str(file)]) == 2
    assert "'elbow' is not a joint of robot 'panda'" in capsys.readouterr().err


def test_packaged_parameters_are_taken(tmp_path, raws):
    path = tmp_path / "in.mcap"
    write_mcap(path, raws)
    config = Path(__file__).parents[2] / "config" / "monitor.yaml"
    assert main(["analyse", str(path), "--urdf", "panda", "--parameters", str(config), "--quiet"]) == 0


def test_without_ros(tmp_path, raws):
    """In a process that cannot import any of ROS."""
    path = tmp_path / "in.mcap"
    write_mcap(path, raws)
    program = (
        "import sys\n"
        "for name in ('rclpy', 'sensor_msgs', 'std_msgs', 'builtin_interfaces', 'rosidl_runtime_py'):\n"
        "    sys.modules[name] = None\n"
        "import diag_dynamics as dd\n"
        f"recording = dd.read_recording({str(path)!r}, dd.load_robot('panda'))\n"
        "assert len(recording) == 400\n"
        "print(dd.observe(dd.DiagonalDynamics(recording.model), recording).norm[-1])\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, timeout=300)
