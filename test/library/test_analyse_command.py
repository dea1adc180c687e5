# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse`: files that others can read, exit status, and errors that say what to
do.
"""

import json
import os
import resource
import signal
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import diag_dynamics as dd
from bags import MCAP, Message, description, serialized, write_mcap, write_rosbag2
from commands import quiet_compiler  # noqa: F401 (a fixture of all tests here)
from diag_dynamics.cli.main import main
from diag_dynamics.description.catalog import find_urdf
from hostile import MS, START, Driver
from limits import HANG

COUNT, OUTPUTS = 300, ("--mcap", "--parquet", "--csv", "--json")
UNJUDGED = 1
"""Exit status of 0.6 s with efforts: they have no balance of power."""


@pytest.fixture(scope="module")
def panda():
    return dd.load_robot("panda")


@pytest.fixture(scope="module")
def driven(panda):
    """Names, stamps, positions, velocities and efforts of a driver, 500 Hz."""
    driver = Driver(panda, 3)
    stamps = START + np.arange(COUNT) * 2 * MS
    states = [driver.state(int(stamp)) for stamp in stamps]
    return driver.names, stamps, *(np.array([state[k] for state in states]) for k in (1, 2, 3))


@pytest.fixture(scope="module")
def states(driven):
    """The same as messages."""
    names, stamps, *values = driven
    rows = zip(stamps.tolist(), *values, strict=True)
    return [
        Message("/joint_states", stamp + 1000, serialized(stamp, names, *row))
        for stamp, *row in rows
    ]


@pytest.fixture
def bag(tmp_path, states):
    """The same in a file."""
    return write_mcap(tmp_path / "in.mcap", states, chunk_size=20_000)


@pytest.fixture
def table(tmp_path, driven):
    """The same as a table."""
    names, stamps, *values = driven
    header = ["t", *(f"{quantity}_{name}" for quantity in ("q", "qd", "tau") for name in names)]
    rows = np.column_stack([1e-9 * (stamps - stamps[0]), *values])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=",".join(header), comments="")
    return tmp_path / "log.csv"


@pytest.fixture
def analyse(capsys):
    """Run the command; return its status and both streams."""

    def run(*arguments, urdf="panda"):
        try:
            status = main(["analyse", *map(str, arguments), *(["--urdf", urdf] if urdf else [])])
        except SystemExit as end:  # of argparse
            status = end.code
        return status, *capsys.readouterr()

    return run


@pytest.fixture(scope="module")
def written(tmp_path_factory, states):
    """Folder with a recording and all outputs of it."""
    folder = tmp_path_factory.mktemp("written")
    path = write_mcap(folder / "in.mcap", states, chunk_size=20_000)
    outputs = [word for option in OUTPUTS for word in (option, str(folder / f"out.{option[2:]}"))]
    assert main(["analyse", str(path), "--urdf", "panda", *outputs, "--quiet"]) == UNJUDGED
    assert sorted(entry.name for entry in folder.iterdir()) == [
        "in.mcap",
        *sorted(f"out.{entry[2:]}" for entry in OUTPUTS),
    ]
    return folder


# --- What is written ---


def test_tables_that_were_written_are_recordings(written, panda, driven):
    """Parquet has no nulls, and statistics of what is no joint's or link's; test_report.py has the
    values.
    """
    file = pyarrow.parquet.ParquetFile(written / "out.parquet")
    group = file.metadata.row_group(0)
    schema = file.schema_arrow
    statistics = {
        entry.path_in_schema: entry.statistics
        for entry in map(group.column, range(group.num_columns))
    }
    assert statistics["kinetic_energy"].max > 0.0 and statistics["nu.panda_joint1"] is None
    assert schema.metadata[b"robot"] == b"panda" and not any(field.nullable for field in schema)
    for kind in ("csv", "parquet"):
        again = dd.read_recording(written / f"out.{kind}", panda)
        for actual, expected in zip(
            (again.stamp, again.q, again.qd, again.tau), driven[1:], strict=True
        ):
            np.testing.assert_array_equal(actual, expected)


def messages_of(path):
    """Return log times and messages by topic, read by mcap and deserialized by rosbags."""
    store = get_typestore(Stores.ROS2_JAZZY)
    result = {}
    with open(path, "rb") as file:
        for schema, channel, entry in make_reader(file, validate_crcs=True).iter_messages():
            if schema.name not in store.fielddefs:
                store.register(get_types_from_msg(schema.data.decode(), schema.name))
            message = store.deserialize_cdr(entry.data + bytes(-len(entry.data) % 4), schema.name)
            assert entry.publish_time == entry.log_time
            result.setdefault(channel.topic, []).append((entry.log_time, message))
    return result


TOPICS = [f"/diag_dynamics/{name}" for name in ("state", "kinetic_energy", "external_torque")]


def test_others_read_the_mcap(written, tmp_path, driven, table, analyse):
    """Log times are those of joint states; messages are in their order where stamps go back.

    test_monitor_recording.py compares fields with the monitor's.
    """
    with Reader(written / "out.mcap") as reader:
        assert sorted(entry.topic for entry in reader.connections) == sorted(TOPICS)
        times = [(connection.topic, time) for connection, time, _ in reader.messages()]
    for topic in TOPICS:
        result = [time for name, time in times if name == topic]
        assert result == (driven[1] + 1000).tolist()
    header, *rows = table.read_text().splitlines()
    (tmp_path / "twice.csv").write_text("\n".join([header, *rows[100:], *rows]))
    assert analyse(tmp_path / "twice.csv", "-o", tmp_path / "out.mcap", "--quiet")[0] in (0, 1)
    times, _ = zip(*messages_of(tmp_path / "out.mcap")[TOPICS[0]], strict=True)
    assert list(times) == sorted(times) and COUNT > len(times) > len(set(times)) == 200


# --- Files ---

DIRECT = "csv", "json"


def test_pipes_and_links(written, tmp_path, analyse):
    """A named pipe stays one, as /dev/null has to; a link stays one, too. Files beside it stay."""
    pipes = {name: tmp_path / f"{name}.pipe" for name in DIRECT}
    links = {name: tmp_path / f"{name}.link" for name in ("mcap", *DIRECT)}
    (tmp_path / "elsewhere").mkdir()
    for name, path in links.items():
        path.symlink_to(tmp_path / "elsewhere" / name)
        (tmp_path / "elsewhere" / f"{name}.part").write_text("of another process")
    for path in pipes.values():
        os.mkfifo(path)
    with ThreadPoolExecutor(2) as pool:
        read = {name: pool.submit(path.read_bytes) for name, path in pipes.items()}
        for paths in (pipes, links):
            outputs = [word for name, path in paths.items() for word in (f"--{name}", path)]
            assert analyse(written / "in.mcap", *outputs, "--quiet") == (UNJUDGED, "", "")
    for name, path in links.items():
        expected = (written / f"out.{name}").read_bytes()
        assert (tmp_path / "elsewhere" / name).read_bytes() == expected and path.is_symlink()
        if name in pipes:
            assert read[name].result() == expected and pipes[name].is_fifo()
    assert len(list((tmp_path / "elsewhere").iterdir())) == 6


def reading(path, size, then):
    """Read some bytes of a pipe, do something, and read or leave the rest."""

    def read():
        with open(path, "rb") as file:
            file.read(size)
            if then is not None:
                then()
                file.read()

    thread = threading.Thread(target=read)
    thread.start()
    return thread


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_leaves_nothing(tmp_path, bag, analyse, number):
    """What was there stays as it was. The signal comes while the CSV is written."""
    pipe = tmp_path / "out.csv"
    older = tmp_path / "out.json"
    os.mkfifo(pipe)
    older.write_text("of yesterday")
    main_thread = threading.main_thread().ident
    reader = reading(pipe, 1000, lambda: signal.pthread_kill(main_thread, number))
    result, _, printed = analyse(
        bag, "--mcap", tmp_path / "out.mcap", "--csv", pipe, "--json", older
    )
    reader.join(HANG)
    assert result == 128 + number and "diag-dynamics analyse: interrupted.\n" in printed
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.mcap", "out.csv", "out.json"]
    assert older.read_text() == "of yesterday"


def test_pipes_whose_reader_leaves(tmp_path, bag, monkeypatch, capfd):
    """`… --csv /dev/stdout | head -3` and `… --json - | head -3` are no fault.

    Parquet and MCAP into a pipe are errors.
    """
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = reading(pipe, 1000, None)
    assert main(["analyse", str(bag), "--urdf", "panda", "--csv", str(pipe)]) == 0
    reader.join(HANG)
    listening, sending = os.pipe()
    os.close(listening)
    with monkeypatch.context() as patch, open(sending, "w") as stdout:
        patch.setattr(sys, "stdout", stdout)
        assert main(["analyse", str(bag), "--urdf", "panda", "--json", "-"]) == 0
    assert "Broken pipe" not in capfd.readouterr().err
    for option, cause in (("--parquet", "lseek failed"), ("--mcap", "Illegal seek")):
        reader = reading(pipe, -1, None)
        status = main(["analyse", str(bag), "--urdf", "panda", option, str(pipe)])
        reader.join(HANG)
        assert status == 2 and f"'{pipe}' cannot be written: {cause}" in capfd.readouterr().err


def test_a_full_disk_leaves_nothing(tmp_path, table, analyse):
    """No file may become larger than 100 KiB."""
    outputs = [word for option in OUTPUTS for word in (option, tmp_path / f"out{option}")]
    analyse(table, "--quiet")  # so that all is compiled
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for only in ((), ("--topics", "joint_space_dynamics")):
        resource.setrlimit(resource.RLIMIT_FSIZE, (100 * 1024, before[1]))
        try:
            status, _, printed = analyse(table, *outputs, *only)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert status == 2 and "File too large" in printed
        assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


@pytest.mark.parametrize("option", [*OUTPUTS, "--report"])
def test_where_nothing_is_written(tmp_path, bag, table, states, analyse, option, monkeypatch):
    """Over what is read, and where nothing can be written, which is named before anything is
    analysed.
    """
    monkeypatch.setattr("diag_dynamics.recordings.recording.Reading.pieces", None)  # unused
    urdf = tmp_path / "panda.urdf"
    folder = write_rosbag2(tmp_path / "bag", states, MCAP)
    urdf.write_text(Path(find_urdf("panda")).read_text(encoding="utf-8"))
    (tmp_path / "link").symlink_to(table)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    problem = "is an input. Choose another file"
    for recording, output, what in (
        (bag, bag, problem),
        (bag, urdf, problem),
        (folder, folder / "bag.mcap", problem),
        (folder, folder / "new", problem),
        (table, tmp_path / "." / "link", problem),
        (table, tmp_path, "folder"),
        (table, "/proc/out", "No such"),
        (table, tmp_path / "no" / "out", "no folder"),
    ):
        status, _, printed = analyse(recording, option, output, "--quiet", urdf=str(urdf))
        assert status == 2 and what in printed and "Traceback" not in printed
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


# --- Exit status and errors ---

WRONG = {
    ("--set", "maxage=1"): "'max_age' meant",
    ("--set", "max_age=-3"): "'max_age' is -3.0; expected 0 to",
    ("--topics", "state"): "--topics requires --mcap",
    ("--out", "{out}"): "--out requires --fleet",
    ("--threads", "0"): "argument --threads: value is 0; expected at least 1",
    ("--csv", "{out}", "--json", "{out}"): "--csv writes this file",
    ("--json", "{out}/a.json"): "there is no folder",
    ("--csv", "{out}/"): "there is no folder",
    ("--start", "50"): "contains no message between start and end",
    ("--parameters", "{nonsense}"): "no parameter 'nonsense'",
    ("--joint-names", "a=b", "a=c"): "parameter '--joint-names' has two entries for 'a'",
    ("--parameters", "{elbow}"): "'elbow'; expected",
}


@pytest.mark.parametrize("options", WRONG, ids=" ".join)
def test_wrong_options(tmp_path, bag, analyse, options):
    files = {
        "elbow": "joints: {elbow: {damping: 1}}",
    }
    files["nonsense"] = "/**:\n  ros__parameters: {nonsense: 1}\n"
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    paths = {name: tmp_path / name for name in ("out", *files)}
    status, _, printed = analyse(bag, *(entry.format(**paths) for entry in options))
    assert status == 2 and WRONG[options].format(**paths) in printed
    assert not list(tmp_path.glob("out*"))


def test_recordings_that_cannot_be_analysed(tmp_path, bag, table, analyse):
    """What is missing is named, and what to do."""
    status, _, printed = analyse(bag, "--parquet", tmp_path / "out.parquet", urdf="ur5")
    assert status == 2
    assert "no valid state" in printed
    assert "messages of other joints: panda_" in printed
    assert not list(tmp_path.glob("out*"))
    rows = np.loadtxt(table, delimiter=",", dtype=str, comments=None)

    def without(word):
        columns = rows[:, [word not in name for name in rows[0]]]
        table.write_text("\n".join(map(",".join, columns)))

    without("qd_")
    status, _, printed = analyse(table)
    assert status == 2 and "(missing_velocity: estimate" in printed
    assert analyse(table, "--set", "missing_velocity=estimate")[0] in (0, 1)
    without("finger")
    status, _, printed = analyse(table)
    assert status == 2 and f"incomplete ({COUNT} ×)" in printed
    assert "missing: panda_finger_joint1." in printed
    assert "--set locked_joints=panda_finger_joint1=0" in printed
    _, out, _ = analyse(table, "--set", "locked_joints=panda_finger_joint1=0", "--json", "-")
    assert json.loads(out)["degrees_of_freedom"] == [f"panda_joint{k}" for k in range(1, 8)]


def test_what_makes_the_exit_status_1(table, analyse):
    """Rejected messages, losses, and efforts without a balance."""
    text = table.read_text().splitlines()
    time, _, rest = text[-1].split(",", 2)
    table.write_text("\n".join([*text[:-1], f"{time},1e9,{rest}"]))
    status, _, printed = analyse(table)
    assert status == 1 and "Problems (exit status 1): 1 rejected message" in printed
    table.write_text("\n".join([*text[:60], "1,2", *text[60:]]))
    status, out, printed = analyse(table)
    assert status == 1 and "unreadable data" in printed
    columns = np.loadtxt(text[1:], delimiter=",")
    columns[:, 0] *= 1e3
    np.savetxt(table, columns, delimiter=",", header=text[0], comments="")
    status, out, printed = analyse(table)
    assert status == 1
    assert "no power balance, although there are efforts" in printed
    assert "milliseconds" in out


def test_several_recordings(tmp_path, table, bag, analyse):
    """Each has its summary; one that cannot be read stops no other."""
    out = tmp_path / "all.json"
    none = tmp_path / "none.csv"
    status, printed, wrong = analyse(bag, none, table, "--json", out)
    assert status == 1 and "no file or folder" in wrong
    assert [line for line in printed.splitlines() if line in (str(bag), str(none), str(table))] == [
        str(bag),
        str(table),
    ]
    summary = json.loads(out.read_text())
    assert list(summary["failed"]) == [str(none)]
    assert summary["recordings"][0] == json.loads(analyse(bag, "--json", "-")[1])
    assert analyse(bag, table, "--quiet") == (UNJUDGED, "", "")
    assert len(analyse(bag, 5000 * "n", "--quiet")[2]) < 1000
    assert (
        "writes results of one recording, but there are 2. Use --fleet"
        in analyse(bag, table, "--csv", tmp_path / "x")[2]
    )
    assert "is an input. Choose another file" in analyse(bag, table, "--json", table)[2]


def test_joints_that_a_recording_lacks_are_locked(tmp_path, driven, table, analyse):
    """A star locks them, in tables and bags, by the robot's names; others in the same list keep
    their positions.
    """
    names, stamps, *values = driven
    prefixed = [name.replace("panda", "fer") for name in names]
    sent = [
        Message(
            "/joint_states",
            stamp,
            serialized(stamp, prefixed[:6], *(entry[k, :6] for entry in values)),
        )
        for k, stamp in enumerate(stamps.tolist())
    ]
    bag = write_mcap(tmp_path / "arm.mcap", sent)
    options = (
        "--joint-names",
        "fer_*=panda_*",
        "--set",
        "locked_joints=*=0.01",
        "locked_joints=panda_joint7=0.2",
    )
    lines = table.read_text().splitlines()
    left = [
        k
        for k, name in enumerate(lines[0].split(","))
        if not any(entry in name for entry in ("joint7", "finger"))
    ]
    rows = [",".join(line.split(",")[k] for k in left) for line in lines]
    table.write_text("\n".join(rows) + "\n")
    star = "--set", "locked_joints=*"
    for recording, more in ((bag, options), (table, star)):
        _, out, printed = analyse(recording, *more, "--json", "-")
        summary = json.loads(out)
        assert summary["states"] == COUNT and summary["degrees_of_freedom"] == names[:6], printed
        (content,) = (
            entry["text"] for entry in summary["findings"] if "are locked" in entry["text"]
        )
        locked = (
            ("panda_finger_joint1=0.01", "panda_joint7=0.2")
            if recording == bag
            else ("panda_joint7=0,",)
        )
        assert all(entry in content for entry in locked)
    rec = dd.read_recording(
        bag,
        find_urdf("panda"),
        joint_names={"fer_*": "panda_*"},
        parameters={"locked_joints": ["*=0.01"]},
    )
    assert rec.model.locked_joints["panda_joint7"] == 0.01 and rec.q.shape == (COUNT, 6)
    assert "'locked_joints' has '*'" in analyse("--fleet", bag, "--out", tmp_path / "o", *star)[2]
    foreign = analyse(bag, *star)
    assert foreign[0] == 2 and "fer*=panda*" in foreign[2]


def test_topics_and_names_of_one_robot(tmp_path, driven, analyse):
    """An arm and its hand on two topics make the same summary as one topic with the robot's
    names.
    """
    names, stamps, *values = driven
    bags = []
    for path, topics, prefix in (
        ("one", ["/joint_states"] * 2, "panda"),
        ("several", ["/arm", "/hand"], "fer"),
    ):
        sent = []
        for k, stamp in enumerate(stamps.tolist()):
            for topic, part in zip(topics, (slice(0, 7), slice(7, None)), strict=True):
                prefixed = [name.replace("panda", prefix) for name in names[part]]
                sent.append(
                    Message(
                        topic,
                        stamp,
                        serialized(stamp, prefixed, *(entry[k, part] for entry in values)),
                    )
                )
        bags.append(write_mcap(tmp_path / f"{path}.mcap", sent, chunk_size=20_000))
    summary = json.loads(analyse(bags[0], "--json", "-")[1])
    assert summary["states"] == 2 * COUNT - 1
    assert any(
        "repeat the previous time stamp: messages of arm and gripper" in text
        for text in summary["warnings"]
    )
    options = "--topic", "/arm", "--topic", "/hand", "--joint-names", "fer_*=panda_*"
    merged = json.loads(analyse(bags[1], *options, "--json", "-")[1])
    assert merged == summary | {"recording": str(bags[1])}


def test_parameters_in_files(tmp_path, bag, analyse):
    """The monitor's and the packaged one."""
    file = tmp_path / "monitor.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    external_torque: {gain: 10}\n    collision: "
        "{threshold: [norm=0.5]}\n    max_age: 2\n"
    )
    summary = json.loads(analyse(bag, "--parameters", file, "--json", "-")[1])
    observed = {
        "gain": 10.0,
        "judged": ["norm"],
        "missing": [],
        "observed": COUNT - 1,
        "unobserved": [],
        "text": "",
    }
    assert summary["observer"] == observed and summary["collisions"]
    threshold = "--set", "collision.threshold=norm=0.5", "--gain", 10
    assert json.loads(analyse(bag, *threshold, "--json", "-")[1])["observer"] == observed
    config = Path(__file__).parents[2] / "config" / "monitor.yaml"
    assert analyse(bag, "--parameters", config, "--quiet")[0] == UNJUDGED


def test_the_robot_of_the_bag_and_a_part(tmp_path, states, analyse):
    urdf = Path(find_urdf("panda")).read_text(encoding="utf-8")
    path = write_mcap(tmp_path / "in.mcap", [description(urdf, START), *states])
    summary = json.loads(
        analyse(path, "--start", "0.1", "--end", "0.4", "--json", "-", urdf=None)[1]
    )
    assert summary["robot"] == "panda" and summary["duration"] == pytest.approx(0.3, abs=0.005)
