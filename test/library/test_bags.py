# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of every kind, by `read_recording`: every state of a whole file, and of a damaged one all that is whole.

Files are written by the libraries mcap and rosbags. Of a damaged file, the findings name what is lost.
"""

import re
import shutil
import sqlite3
import struct
import sys

import numpy as np
import pytest
import yaml
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from rosbags import rosbag1
from rosbags.rosbag2 import CompressionMode

import diag_dynamics as dd
from bags import (
    ALL,
    JOINT_STATE,
    LZ4,
    MCAP,
    NO_CHUNKS,
    NO_INDEX,
    NO_MESSAGES,
    NOETIC,
    ODOMETRY,
    PLAIN,
    SQLITE,
    STRING,
    TEXT,
    ZSTD,
    Message,
    arm,
    definitions_of_ros1,
    description,
    file_of,
    numbered,
    odometry,
    of_ros1,
    serialized,
    urdf_of,
    write_mcap,
    write_ros1,
    write_rosbag2,
    write_split,
)
from examples import examples, some_of
from hostile import MS, START

COMPRESSIONS = (ZSTD, LZ4, PLAIN)
ROS1_COMPRESSIONS = (None, *rosbag1.Writer.CompressionFormat)


def in_one_folder(count):
    """Return hypothesis settings: every example may use the folder of the test."""
    return settings(examples(count), suppress_health_check=[HealthCheck.function_scoped_fixture])


def read(path, topic=None):
    """Return the numbers of the messages read, and the findings; nothing read is a finding, too.

    No message is changed, and none comes twice or before an earlier one.
    """
    try:
        recording = dd.read_recording(path, arm("a"), topic=topic)
    except dd.InputError as error:
        return [], [("unread", str(error))]
    numbers = (recording.stamp - START) // MS
    np.testing.assert_array_equal(recording.stamp, START + numbers * MS)
    np.testing.assert_allclose(recording.q[:, 0], 1e-4 * numbers, rtol=1e-15)
    assert (np.diff(numbers) > 0).all()
    gaps = "lost by gaps in stamps"  # of what is missing
    return numbers.tolist(), [(one.cause, one.text) for one in recording.findings if one.cause != gaps]


def unread(findings):
    """Return the texts of what could not be read."""
    return [text for cause, text in findings if cause == "unread"]


# --- Whole files ---


@in_one_folder(100)
@given(
    seed=st.integers(0, 2**32),
    count=st.integers(1, 150),
    disorder=st.sampled_from([0, 1, 30, 1000]),
    compression=st.sampled_from(COMPRESSIONS),
    chunk_size=st.sampled_from([1, 100, 1000, 10**6]),
    options=st.fixed_dictionaries(
        {
            "index_types": st.sampled_from([ALL, NO_MESSAGES, NO_CHUNKS, NO_INDEX]),
            "use_chunking": st.booleans(),
            "repeat_channels": st.booleans(),
            "repeat_schemas": st.booleans(),
            "use_statistics": st.booleans(),
            "use_summary_offsets": st.booleans(),
            "enable_crcs": st.booleans(),
            "enable_data_crcs": st.booleans(),
        }
    ),
)
def test_mcap(tmp_path, seed, count, disorder, compression, chunk_size, options):
    """Chunks that overlap in time have one message each here; see the next test."""
    apart = chunk_size == 1 and options["use_chunking"]
    messages = numbered(count, disorder=disorder if apart else 0, seed=seed)
    path = write_mcap(tmp_path / "x.mcap", messages, compression, chunk_size, **options)
    assert read(path) == (list(range(count)), [])


def test_mcap_with_messages_out_of_order_in_a_chunk(tmp_path):
    assert read(write_mcap(tmp_path / "x.mcap", numbered(50, disorder=3))) == (list(range(50)), [])


ROSBAG2 = [
    *((plugin, mode) for plugin in (SQLITE, MCAP) for mode in CompressionMode if mode != CompressionMode.STORAGE),
    (MCAP, CompressionMode.STORAGE),
]


@pytest.mark.parametrize("version", [8, 9])
@pytest.mark.parametrize(("plugin", "mode"), ROSBAG2)
def test_rosbag2(tmp_path, plugin, mode, version):
    """A folder, and its file without the folder: only metadata.yaml says by what messages are compressed."""
    messages = numbered(150, topics=("/a", "/b"), disorder=4 if plugin is SQLITE else 0, longest=300)
    folder = write_rosbag2(tmp_path / "bag", messages, plugin, mode, version)
    for path in (folder, file_of(folder)):
        for k, topic in enumerate(("/a", "/b")):
            assert read(path, topic) == (list(range(k, 150, 2)), [])


@pytest.mark.parametrize("compression", ROS1_COMPRESSIONS)
def test_ros1(tmp_path, compression):
    path = write_ros1(tmp_path / "x.bag", numbered(100, topics=("/a", "/b")), compression)
    for k, topic in enumerate(("/a", "/b")):
        assert read(path, topic) == (list(range(k, 100, 2)), [])


ROS1_DEFINITIONS = {
    "whole": definitions_of_ros1(JOINT_STATE),
    "without its header": {"sensor_msgs/JointState": TEXT},
    "empty": {},
}
MD5 = NOETIC.generate_msgdef(JOINT_STATE, ros_version=1)[1]


@pytest.mark.parametrize("schema", ["ros1msg", "msg", ""])
@pytest.mark.parametrize("definitions", ROS1_DEFINITIONS)
@pytest.mark.parametrize(
    ("compression", "options"), [(ZSTD, {}), (LZ4, {"index_types": NO_INDEX}), (PLAIN, {"use_chunking": False})]
)
def test_ros1_in_mcap(tmp_path, compression, options, definitions, schema):
    """`mcap convert` keeps messages, types and definitions of a ROS 1 bag, its first releases as schema ``msg``."""
    messages = of_ros1(numbered(60, topics=("/a", "/b")))
    encoded = {"encoding": "ros1", "schema": schema, "definitions": ROS1_DEFINITIONS[definitions]}
    path = write_mcap(tmp_path / "x.mcap", messages, compression, metadata={"md5sum": MD5}, **encoded, **options)
    for k, topic in enumerate(("/a", "/b")):
        assert read(path, topic) == (list(range(k, 60, 2)), [])
    path.write_bytes(path.read_bytes()[:-500])
    numbers, findings = read(path, "/a")
    assert 0 < len(numbers) <= 30 and numbers == list(range(0, 2 * len(numbers), 2)) and unread(findings)


def test_a_robot_of_ros1_in_mcap(tmp_path):
    """Its description and its odometry are read; the states are those of the same messages of ROS 2."""
    stamps = [START + k * MS for k in range(20)]
    inertial = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    sent = [description(urdf_of("a").replace('<link name="base"/>', f'<link name="base">{inertial}</link>'))]
    for k, stamp in enumerate(stamps):
        pose, twist = [0.1 * k, 0, 0, 0, 0, 0, 1], [0.1, 0, 0, 0, 0, 0.2]
        sent.append(Message("/odom", stamp, odometry(stamp, "base", pose, twist), ODOMETRY))
        sent.append(Message("/joint_states", stamp, serialized(stamp, ["a"], [0.01 * k], [0.1], [2.0])))
    new = write_mcap(tmp_path / "new.mcap", sent)
    definitions = definitions_of_ros1(JOINT_STATE, ODOMETRY, STRING)
    old = write_mcap(tmp_path / "old.mcap", of_ros1(sent), encoding="ros1", schema="ros1msg", definitions=definitions)
    expected, found = (dd.read_recording(path, parameters={"floating_base": True}) for path in (new, old))
    assert len(expected) > 15 and found.findings == expected.findings
    for ours, theirs in zip(found.states, expected.states, strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("data", "metadata", "type", "what"),
    [
        (b"short", {}, "sensor_msgs/JointState", "40 messages of '/joint_states' are not of its type"),
        (None, {"md5sum": "1" * 32}, "sensor_msgs/JointState", f"its MD5 sum is {'1' * 32}; expected {MD5}"),
        (
            None,
            {},
            "my_msgs/JointState",
            "has no joint states: its topics are /joint_states .my_msgs/msg/JointState, enc",
        ),
    ],
)
def test_ros1_in_mcap_that_is_not_understood(tmp_path, data, metadata, type, what):
    messages = [one._replace(data=data or one.data, type=type) for one in of_ros1(numbered(40))]
    path = write_mcap(
        tmp_path / "x.mcap", messages, chunk_size=10**6, encoding="ros1", metadata=metadata, definitions={}
    )
    try:
        said = " ".join(unread([(one.cause, one.text) for one in dd.read_recording(path, arm("a")).findings]))
    except dd.InputError as error:
        said = str(error)
    assert re.search(what, said)


@pytest.mark.parametrize("name", ["sensor_msgs/JointState", "sensor_msgs::msg::dds_::JointState_"])
@pytest.mark.parametrize("kind", ["mcap", "db3"])
def test_names_of_types(tmp_path, kind, name):
    """Releases and vendors write them without ``/msg/``, or as DDS has them."""
    messages, path = numbered(40), tmp_path / f"x.{kind}"
    if kind == "mcap":
        write_mcap(path, [one._replace(type=name) for one in messages])
    else:
        file_of(write_rosbag2(tmp_path / "bag", messages)).rename(path)
        with sqlite3.connect(path) as database:
            database.execute("UPDATE topics SET type = ?", [name])
        database.close()
    assert read(path) == (list(range(40)), [])


@pytest.mark.parametrize("encoding", ["json", "protobuf", "cbor", "flatbuffer", ""])
@pytest.mark.parametrize("type", [JOINT_STATE, "foxglove.JointStates", ""])
def test_encodings_that_are_not_read_are_named(tmp_path, encoding, type):
    """With the topic; a second topic that can be read is read."""
    odd = [one._replace(topic="/odd/joint_states", type=type, data=b"{}") for one in numbered(20)]
    path = write_mcap(tmp_path / "odd.mcap", odd, encoding=encoding)
    for topic in (None, "/odd/joint_states"):
        with pytest.raises(
            dd.InputError, match=rf"/odd/joint_states.* encoded as '{encoding}'.* 'cdr' of ROS 2 or 'ros1'"
        ):
            dd.read_recording(path, arm("a"), topic=topic)
    with open(tmp_path / "both.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        channels = [
            writer.register_channel(topic, form, writer.register_schema(kind, "ros2msg", b""))
            for topic, form, kind in (("/odd/joint_states", encoding, type), ("/a", "cdr", JOINT_STATE))
        ]
        for one, other in zip(odd, numbered(20), strict=True):
            writer.add_message(channels[0], one.log_time, one.data, one.log_time)
            writer.add_message(channels[1], one.log_time, other.data, one.log_time)
        writer.finish()
    numbers, findings = read(tmp_path / "both.mcap")
    assert numbers == list(range(20)) and unread(findings) == []


@pytest.mark.parametrize("md5", [MD5, "*"])
def test_ros1_without_definitions(tmp_path, md5):
    """Its type and MD5 sum say which definition it is."""
    path = tmp_path / "x.bag"
    with rosbag1.Writer(path) as writer:
        connection = writer.add_connection("/joint_states", JOINT_STATE, msgdef="", md5sum=md5)
        for one in of_ros1(numbered(30)):
            writer.write(connection, one.log_time, one.data)
    assert read(path) == (list(range(30)), [])


def test_records_that_are_no_messages_are_ignored(tmp_path):
    """Attachments and metadata; kinds of records that the format does not have are named."""
    with open(tmp_path / "x.mcap", "wb") as file:
        writer = Writer(file, chunk_size=300)
        writer.start(profile="ros2")
        channel = writer.register_channel("/a", "cdr", writer.register_schema(JOINT_STATE, "ros2msg", TEXT.encode()))
        for one in numbered(20):
            writer.add_message(channel, one.log_time, one.data, one.log_time)
            writer.add_metadata("rosbag2", {"a": "b"})
            writer.add_attachment(1, 1, "image", "image/png", b"\5" + bytes(100))
            file.write(b"\x90\4" + bytes(7) + b"ours")
        writer.finish()
    numbers, findings = read(tmp_path / "x.mcap")
    (lost,) = unread(findings)
    assert numbers == list(range(20)) and "kinds that the format does not have" in lost and "20, 260 bytes" in lost


@pytest.mark.parametrize("profiles", ["", ", offered_qos_profiles TEXT"])
def test_older_sqlite(tmp_path, profiles):
    """Topics have fewer columns, and no definitions. Rows that are no messages are counted."""
    path, messages = tmp_path / "x.db3", numbered(100)
    with sqlite3.connect(path) as database:
        database.execute(f"CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format{profiles})")
        database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data BLOB)")
        database.execute(
            "INSERT INTO topics(id, name, type, serialization_format) VALUES(1, '/a', ?, 'cdr')", [JOINT_STATE]
        )
        rows = [(one.log_time, one.data) for one in messages]
        database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", rows)
    assert read(path) == (list(range(100)), [])
    with database:
        for id, change in ((3, "topic_id = 9"), (5, "data = 'text'"), (7, "timestamp = NULL")):
            database.execute(f"UPDATE messages SET {change} WHERE id = {id}")
    database.close()
    numbers, findings = read(path)
    assert numbers == [k for k in range(100) if k not in (2, 4, 6)]
    assert [text.split(": ")[-1] for text in unread(findings)] == [
        "1 messages are of topics that are not listed",
        "2 messages have no bytes, or no time that int64 can hold",
    ]


@pytest.mark.parametrize("plugin", [SQLITE, MCAP])
def test_folders_of_several_files(tmp_path, plugin):
    """Files overlap. Without metadata.yaml, bag_10 is behind bag_9, also where messages are of the same time."""
    messages = [*numbered(270, disorder=20), *numbered(330)[270:]]
    parts = [sorted(messages[k : k + 30], key=lambda one: one.log_time) for k in range(0, 330, 30)]
    parts[10][0] = parts[10][0]._replace(log_time=parts[9][-1].log_time)
    folder = write_split(tmp_path / "bag", parts, plugin)
    assert read(folder) == (list(range(330)), [])
    for text in (None, "", "a: [", "- 1\n", "rosbag2_bagfile_information: {relative_file_paths: 3}"):
        (folder / "metadata.yaml").unlink()
        if text is not None:
            (folder / "metadata.yaml").write_text(text)
        numbers, ((cause, said),) = read(folder)
        assert numbers == list(range(330)) and cause == "note" and "\n" not in said
        assert ("has no metadata.yaml" if text is None else "metadata.yaml is damaged") in said
        (folder / "metadata.yaml").touch()


def test_folders_that_are_not_as_their_metadata(tmp_path):
    """A file is missing, one is cut, and one is of somebody else."""
    messages = numbered(900)
    folder = write_split(tmp_path / "bag", [messages[:300], messages[300:600], messages[600:]], MCAP)
    write_mcap(folder / "results.mcap", numbered(10))
    (folder / "bag_0.mcap").unlink()
    content = (folder / "bag_1.mcap").read_bytes()
    (folder / "bag_1.mcap").write_bytes(content[: len(content) // 2])
    numbers, findings = read(folder)
    count = len(numbers) - 300
    assert 0 < count < 300 and numbers == [*range(300, 300 + count), *range(600, 900)]
    lost = unread(findings)
    assert "bag_0.mcap" in lost[0] and all("bag_1.mcap" in text for text in lost[1:]) and lost[1:]
    notes = " ".join(text for cause, text in findings if cause == "note")
    assert "does not list results.mcap" in notes
    assert f"tells of 900 messages of '/joint_states', and {300 + count} are there" in notes


RENAMED = {
    "one": {"bag_0": "monday"},
    "one of three": {"bag_1": "tuesday"},
    "two of three": {"bag_0": "z", "bag_2": "a"},
    "all": {"bag_0": "9_run", "bag_1": "10_run", "bag_2": "11_run"},
}


@pytest.mark.parametrize("case", RENAMED)
@pytest.mark.parametrize("suffix", ["", ".mcap", ".db3", ".mcap.zstd"])
def test_renamed_files_of_a_folder(tmp_path, case, suffix):
    """Whatever the new name ends with, they are read, and each has a note with both names."""
    names, messages = RENAMED[case], numbered(90)
    plugin, ending = (SQLITE, ".db3") if suffix == ".db3" else (MCAP, ".mcap")
    parts = [messages] if case == "one" else [messages[:30], messages[30:61], messages[61:]]
    folder = write_split(tmp_path / "bag", parts, plugin)
    expected = []
    for old, new in names.items():
        path = (folder / f"{old}{ending}").rename(folder / f"{new}{suffix}")
        if suffix.endswith(".zstd"):
            path.write_bytes(zstandard.compress(path.read_bytes()))
        what = f"metadata.yaml lists {old}{ending}, which is not there; {path.name} is read instead."
        expected.append(("note", f"'{folder}': {what}"))
    assert read(folder) == (list(range(90)), expected)


def test_a_renamed_file_among_others(tmp_path):
    """It is recognized by its first time, topics and number of messages; without these an error has both lists."""
    folder = write_split(tmp_path / "bag", [numbered(100)], MCAP)
    (folder / "bag_0.mcap").rename(folder / "monday.mcap")
    write_mcap(folder / "longer.mcap", numbered(101))
    write_mcap(folder / "results.mcap", [one._replace(topic="/energy") for one in numbered(100)])
    numbers, findings = read(folder)
    assert numbers == list(range(100)) and "monday.mcap is read instead" in findings[0][1]
    assert "does not list longer.mcap, results.mcap: not read" in findings[1][1]
    metadata = yaml.safe_load((folder / "metadata.yaml").read_text())
    for key in ("starting_time", "files"):
        del metadata["rosbag2_bagfile_information"][key]
    (folder / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    what = (
        r"lists bag_0\.mcap; the folder has longer\.mcap, monday\.mcap, results\.mcap instead, .* delete metadata\.yaml"
    )
    with pytest.raises(dd.InputError, match=what):
        dd.read_recording(folder, arm("a"))
    for name in ("longer.mcap", "results.mcap"):
        (folder / name).unlink()
    assert read(folder)[0] == list(range(100))


def test_metadata_that_lists_no_files(tmp_path):
    """As of a recorder that was ended, and a bag without a name that says so."""
    folder = write_split(tmp_path / "bag", [numbered(50)], MCAP)
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {relative_file_paths: []}")
    (folder / "bag_0.mcap").rename(folder / "recording")
    numbers, ((cause, text),) = read(folder)
    assert numbers == list(range(50)) and cause == "note" and "metadata.yaml lists no files" in text
    (folder / "recording").unlink()
    with pytest.raises(dd.InputError, match=r"has a metadata\.yaml that lists no files, and no bags in it"):
        dd.read_recording(folder, arm("a"))


def test_kinds_are_known_by_content(tmp_path):
    messages = numbered(50)
    paths = [
        write_mcap(tmp_path / "mcap.bag", messages),
        shutil.copy(file_of(write_rosbag2(tmp_path / "bag", messages)), tmp_path / "sqlite.mcap"),
        write_ros1(tmp_path / "ros1.bag.active", messages),
        tmp_path / "packed.mcap",
    ]
    paths[3].write_bytes(zstandard.compress(paths[0].read_bytes()))
    for path in paths:
        assert read(path) == (list(range(50)), [])


def test_a_folder_of_any_bags(tmp_path):
    (tmp_path / "both").mkdir()
    messages = numbered(100)
    write_ros1(tmp_path / "both" / "b.bag", messages[50:])
    write_mcap(tmp_path / "both" / "a.mcap", messages[:50])
    numbers, findings = read(tmp_path / "both")
    assert numbers == list(range(100)) and unread(findings) == []


@pytest.mark.parametrize(
    ("name", "content", "what"),
    [
        ("x.mcap", b"", "the file is empty"),
        ("x.mcap", b"\x89MCAP", "the file has no end"),
        ("x.mcap", b"\x89MCAP0\r\n", "the file has no end"),
        ("x.mcap", b"\xff\xd8\xff\xe0" + bytes(100_000), "byte 0: the file does not begin as one of MCAP does"),
        ("x.db3", b"", "has no joint states"),
        ("x.db3", b"SQLite format 3\0" + bytes(5000), "has no joint states"),
        ("x.db3", b"no database at all", "not a database"),
        ("x.bag", b"#ROSBAG V1.2\n" + bytes(5000), "has no joint states"),
        ("x.bag", b"#ROSBAG V2.0\n", "has no joint states"),
        ("x.bag", b"nothing of the kind", "has no joint states"),
        ("x.mcap", zstandard.compress(b"text"), "does not begin as one of MCAP does"),
    ],
)
def test_files_without_messages(tmp_path, name, content, what):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(dd.InputError, match=what):
        dd.read_recording(tmp_path / name, arm("a"))


def test_folders_and_databases_without_messages(tmp_path):
    with pytest.raises(dd.InputError, match=r"has no metadata\.yaml and no bags in it; there are folders of rosbag2"):
        dd.read_recording(tmp_path, arm("a"))
    database = sqlite3.connect(tmp_path / "x.db3")
    database.execute("CREATE TABLE cats(name)")
    database.close()
    with pytest.raises(dd.InputError, match="no such table: topics"):
        dd.read_recording(tmp_path / "x.db3", arm("a"))


@pytest.mark.parametrize(("compression", "module"), [(ZSTD, "zstandard"), (LZ4, "lz4.frame")])
def test_a_library_that_is_missing_is_named(tmp_path, monkeypatch, compression, module):
    path, package = write_mcap(tmp_path / "x.mcap", numbered(100), compression), module.partition(".")[0]
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(dd.InputError, match=f"pip install {package}"):
        dd.read_recording(path, arm("a"))


# --- Several topics of one robot ---


def arm_and_gripper(topics):
    """Return messages of an arm (joints a, b) and its gripper (c) on two topics; some have the same log time."""
    sent = []
    for k in range(60):
        names, topic = (["c"], topics[1]) if k % 3 == 2 else (["b", "a"], topics[0])
        stamp = START + 2 * k * MS
        values = [0.01 * k + place for place in range(len(names))], [0.1] * len(names), [1.0 * k] * len(names)
        sent.append(Message(topic, stamp - (k % 30 == 29) * 2 * MS, serialized(stamp, names, *values)))
    return sent


WRITERS = {
    "mcap": lambda folder, sent: write_mcap(folder / "x.mcap", sent),
    "db3": lambda folder, sent: write_rosbag2(folder / "bag", sent),
    "ROS 1": lambda folder, sent: write_ros1(folder / "x.bag", sent),
    "ROS 1 in MCAP": lambda folder, sent: write_mcap(
        folder / "x.mcap",
        of_ros1(sent),
        encoding="ros1",
        schema="ros1msg",
        definitions=ROS1_DEFINITIONS["whole"],
    ),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_topics_of_one_robot_are_merged(tmp_path, kind):
    """States, counts and findings are those of one topic with the same messages, whatever the order of the names."""
    robot, two = arm("a", "b", "c"), ("/arm/joint_states", "/gripper/joint_states")
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    one = WRITERS[kind](tmp_path / "one", arm_and_gripper(["/joint_states"] * 2))
    path = WRITERS[kind](tmp_path / "two", arm_and_gripper(two))
    expected = dd.read_recording(one, robot)
    assert len(expected) == 58 and np.isfinite(expected.tau).all()
    for topics in (two, list(reversed(two)), [*two, two[0]]):
        found = dd.read_recording(path, robot, topic=topics)
        assert found.counts == expected.counts and found.findings == expected.findings
        for ours, theirs in zip(found.states, expected.states, strict=True):
            np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(dd.InputError, match=r"/arm/joint_states, /gripper/joint_states\. .*--topic .* --topic"):
        dd.read_recording(path, robot)
    with pytest.raises(dd.InputError, match=r"no topic '/gripper' .*, only /arm/joint_states, /gripper/joint_states"):
        dd.read_recording(path, robot, topic=[two[0], "/gripper"])


def test_topics_that_are_not_read_are_named(tmp_path):
    """One topic has the usual name, others have another name or another type."""
    sent = [*arm_and_gripper(("/joint_states", "/gripper")), description(urdf_of("a"))]
    path = write_mcap(tmp_path / "x.mcap", sent)
    notes = [one.text for one in dd.read_recording(path, arm("a", "b")).findings if one.cause == "note"]
    assert notes == [
        f"'{path}': joint states of /joint_states are read, not those of /gripper (--topic reads several)."
    ]
    with pytest.raises(dd.InputError, match="topic /robot_description is of std_msgs/msg/String; expected sensor_msgs"):
        dd.read_recording(path, arm("a"), topic=["/joint_states", "/robot_description"])
    for topic in ("", 3, ["/joint_states", None]):
        with pytest.raises(dd.InputError, match=r"topic is .*; expected the name of a topic or a list of names"):
            dd.read_recording(path, arm("a"), topic=topic)


def test_robots_of_several_namespaces(tmp_path):
    """The description is that in the namespace of the topics."""
    sent = [one._replace(topic=f"/{side}/joint_states") for side in ("left", "right") for one in numbered(10)]
    sent += [description(urdf_of(*names))._replace(topic=f"/{side}/robot_description") for side, names in SIDES.items()]
    path = write_mcap(tmp_path / "x.mcap", sorted(sent, key=lambda one: one.log_time))
    for side, names in SIDES.items():
        assert dd.read_recording(path, topic=f"/{side}/joint_states").model.joint_names == names
    with pytest.raises(dd.InputError, match=r"several topics of std_msgs/msg/String: .*\. Give the robot: --urdf"):
        dd.read_recording(path)


SIDES = {"left": ("a",), "right": ("a", "b")}


# --- Damaged MCAP ---


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("options", [{}, {"index_types": NO_INDEX}, {"use_chunking": False}], ids=str)
def test_mcap_that_is_cut_anywhere(tmp_path, compression, options):
    """Its beginning is read, and no longer file has fewer messages."""
    path, before = write_mcap(tmp_path / "x.mcap", numbered(25), compression, **options), 0
    content = path.read_bytes()
    for end in (*some_of(range(0, len(content), 11), 14), len(content) - 1):
        path.write_bytes(content[:end])
        numbers, findings = read(path)
        assert numbers == list(range(len(numbers))) and len(numbers) >= before and unread(findings), end
        before = len(numbers)
    assert before == 25


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_the_last_chunk_of_a_cut_file_is_read_as_far_as_it_goes(tmp_path, compression):
    """The last seconds before a crash are what a recording is made for."""
    path = write_mcap(tmp_path / "x.mcap", numbered(1500, longest=400), compression, 10**7)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    numbers, findings = read(path)
    assert 200 < len(numbers) < 1500 and numbers == list(range(len(numbers)))
    assert "the file ends within it: " in unread(findings)[0]


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("options", [{}, {"index_types": NO_INDEX}], ids=str)
def test_mcap_with_a_flipped_bit(tmp_path, compression, options):
    """No message is changed, because chunks have CRCs. Missing messages are named."""
    path = write_mcap(tmp_path / "x.mcap", numbered(25), compression, **options)
    content = path.read_bytes()
    for at in some_of(range(0, len(content), 11), 14):
        damaged = bytearray(content)
        damaged[at] ^= 1 << at % 8
        path.write_bytes(damaged)
        numbers, findings = read(path)
        assert numbers == list(range(25)) or findings, at


def opened(path):
    """Read a file of which anything may be wrong: states and findings, or an InputError."""
    try:
        return dd.read_recording(path, arm("a"))
    except dd.InputError:
        return None


HUGE = st.sampled_from([b"\xff" * 8, b"\0" * 8, b"\xff\xff\xff\x7f\0\0\0\0", b"\xff" * 7 + b"\x7f"])


@in_one_folder(200)
@given(data=st.data(), kind=st.sampled_from(["mcap", "db3", "bag"]))
def test_garbage_in_the_middle(tmp_path, data, kind):
    """Bytes that are overwritten, put in or left out: no other error, and no allocation that a length asks for."""
    path, messages = tmp_path / f"x.{kind}", numbered(60)
    if kind == "mcap":
        options = data.draw(st.sampled_from([{}, {"enable_crcs": False}, {"use_chunking": False}]))
        write_mcap(path, messages, data.draw(st.sampled_from(COMPRESSIONS)), **options)
    elif kind == "db3":
        shutil.rmtree(tmp_path / "bag", ignore_errors=True)
        file_of(write_rosbag2(tmp_path / "bag", messages)).rename(path)
    else:
        path.unlink(missing_ok=True)
        write_ros1(path, messages, data.draw(st.sampled_from(ROS1_COMPRESSIONS)))
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at, new = data.draw(st.integers(0, len(content))), data.draw(st.one_of(HUGE, st.binary(max_size=200)))
        content[at : at + data.draw(st.sampled_from([0, len(new), 50]))] = new
    path.write_bytes(content)
    recording = opened(path)
    assert recording is None or len(recording) == len(messages) or recording.findings or kind == "db3"


def chunks(content):
    """Return where the chunks of a file begin."""
    found, at = [], 8
    while at < len(content) - 8:
        kind, size = struct.unpack_from("<BQ", content, at)
        if kind == 6:
            found.append(at)
        at += 9 + size
    return found


def test_records_go_on_behind_garbage(tmp_path):
    """Without an index, too."""
    content = write_mcap(tmp_path / "x.mcap", numbered(100), index_types=NO_INDEX).read_bytes()
    at = chunks(content)[5]
    for garbage in (np.random.default_rng(0).bytes(3000), bytes(3000), b"\5" + bytes(7), np.arange(1000).tobytes()):
        (tmp_path / "x.mcap").write_bytes(content[:at] + garbage + content[at:])
        numbers, findings = read(tmp_path / "x.mcap")
        assert numbers == list(range(100))
        (lost,) = unread(findings)
        assert lost == f"{tmp_path / 'x.mcap'}, byte {at}: no record begins here: {len(garbage)} bytes"


@pytest.mark.parametrize(
    ("place", "new", "what"),
    [
        (33, b"1234", "chunk at byte {at}: its CRC is wrong: {count} messages"),
        (41, b"zsta", "compression 'zsta' is not known; zstd, lz4 and none are: {count} messages"),
        (53, b"\xff" * 20, "zstd says: "),
        (1, b"\xff" * 8, "byte {at}: no record begins here: "),  # the length of the chunk
    ],
)
def test_what_is_lost_of_a_chunk_is_named(tmp_path, place, new, what):
    path = write_mcap(tmp_path / "x.mcap", numbered(200))
    content = bytearray(path.read_bytes())
    at = chunks(content)[3]
    content[at + place : at + place + len(new)] = new
    path.write_bytes(content)
    numbers, findings = read(path)
    (lost,) = unread(findings)
    assert 180 < len(numbers) < 200 and what.format(at=at, count=200 - len(numbers)) in lost


def test_damage_in_chunks_of_other_topics_is_no_loss(tmp_path):
    """As of images that nobody reads."""
    messages = [*numbered(100, ["/a"]), *numbered(100, ["/b"], seed=1)]
    path = write_mcap(tmp_path / "x.mcap", messages, PLAIN)
    content = bytearray(path.read_bytes())
    content[content.index(messages[190].data) + 9] ^= 1
    path.write_bytes(content)
    assert read(path, "/a") == (list(range(100)), [])
    numbers, findings = read(path, "/b")
    assert len(numbers) < 100 and len(unread(findings)) == 1


def test_messages_of_no_channel_and_of_no_time(tmp_path):
    messages = numbered(30)
    path = write_mcap(tmp_path / "x.mcap", messages, PLAIN, 10**6, enable_crcs=False)
    content = bytearray(path.read_bytes())
    begin = [content.index(one.data) - 22 for one in messages[:2]]
    content[begin[0] : begin[0] + 2] = b"\7\0"
    content[begin[1] + 13] = 0xFF
    path.write_bytes(content)
    numbers, findings = read(path)
    assert numbers == list(range(2, 30))
    for text, what in zip(unread(findings), ("declared nowhere", "log times that int64 cannot hold"), strict=True):
        assert "1 messages " in text and what in text


# --- Damaged SQLite ---


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    """Content of a database of many pages, and the number of its messages."""
    return file_of(write_rosbag2(tmp_path_factory.mktemp("x") / "bag", numbered(800, longest=400))).read_bytes(), 800


@pytest.mark.parametrize("share", [0.999, 0.6, 0.05])
def test_sqlite_that_is_cut(tmp_path, database, share):
    content, count = database
    (tmp_path / "x.db3").write_bytes(content[: int(share * len(content))])
    numbers, findings = read(tmp_path / "x.db3")
    assert unread(findings)
    assert len(numbers) > (share - 0.25) * count  # the index lies at the end, too


def test_sqlite_with_an_overwritten_page(tmp_path, database):
    """All messages but those on the page are read, whichever page it is."""
    content, count = database
    found = []
    for page in some_of(range(1, len(content) // 4096), 9):
        damaged = bytearray(content)
        damaged[4096 * page : 4096 * (page + 1)] = bytes([page % 256]) * 4096
        (tmp_path / "x.db3").write_bytes(damaged)
        numbers, findings = read(tmp_path / "x.db3")
        assert len(numbers) == count or unread(findings), page
        found.append(len(numbers))
    assert np.median(found) > count - 40


@pytest.mark.parametrize("mode", ["WAL", "DELETE"])
def test_the_journal_of_a_killed_recorder(tmp_path, database, mode):
    """What was committed is read, in a copy; what was not is taken back. The files are not changed."""
    live, left = tmp_path / "live.db3", tmp_path / "left"
    left.mkdir()
    live.write_bytes(database[0])
    connection = sqlite3.connect(live, isolation_level=None)
    connection.execute(f"PRAGMA journal_mode={mode}")
    connection.execute("PRAGMA cache_size=1")  # so that pages are written before they are committed
    connection.execute("BEGIN")
    connection.execute("DELETE FROM messages WHERE id > 100")
    if mode == "WAL":
        connection.execute("COMMIT")
    for path in tmp_path.glob("live.db3*"):
        if not path.name.endswith("-shm"):
            shutil.copy(path, left)
    connection.close()
    names = ["live.db3", f"live.db3-{'wal' if mode == 'WAL' else 'journal'}"]
    before = {name: (left / name).read_bytes() for name in names}
    numbers, findings = read(left / "live.db3")
    assert numbers == list(range(100 if mode == "WAL" else database[1]))
    assert [cause for cause, _ in findings] == ["note"] and "has a journal" in findings[0][1]
    assert {path.name: path.read_bytes() for path in left.iterdir()} == before


def test_a_compressed_file_that_is_cut(tmp_path):
    folder = write_rosbag2(tmp_path / "bag", numbered(2000, longest=400), MCAP, CompressionMode.FILE)
    path = file_of(folder)
    half = path.read_bytes()[: path.stat().st_size // 2]
    for content, what in ((half, str(path)), (half + b"\xff" * 10**6, "zstd says")):
        path.write_bytes(content)
        numbers, findings = read(path)
        assert 0 < len(numbers) < 2000 and numbers == list(range(len(numbers)))
        assert any(what in text for text in unread(findings))


# --- Damaged ROS 1 ---


@pytest.mark.parametrize("compression", [None, rosbag1.Writer.CompressionFormat.LZ4])
def test_ros1_that_is_cut(tmp_path, compression):
    """It has no index then, as one that was not closed, and is read up to its last whole chunk."""
    path, before = write_ros1(tmp_path / "x.bag", numbered(120), compression), 0
    content = path.read_bytes()
    for end in (*some_of(range(0, len(content), 411), 3), len(content) - 1):
        path.write_bytes(content[:end])
        numbers, findings = read(path)
        assert numbers == list(range(len(numbers))) and len(numbers) >= before and unread(findings), end
        before = len(numbers)
    assert before == 120


def test_a_damaged_chunk_of_ros1(tmp_path):
    path = write_ros1(tmp_path / "x.bag", numbered(300), rosbag1.Writer.CompressionFormat.BZ2)
    content = bytearray(path.read_bytes())
    at = content.index(b"BZh", len(content) // 3)
    content[at + 40 : at + 60] = bytes(20)
    path.write_bytes(content)
    numbers, findings = read(path)
    (lost,) = unread(findings)
    assert 200 < len(numbers) < 300
    assert "chunk at byte " in lost and lost.endswith(f": {300 - len(numbers)} messages")


def test_types_of_ros1_that_are_not_understood(tmp_path):
    path = tmp_path / "x.bag"
    with rosbag1.Writer(path) as writer:
        odd = writer.add_connection("/odd", JOINT_STATE, msgdef="what is this?!", md5sum="0" * 32)
        short = writer.add_connection("/a", JOINT_STATE, typestore=NOETIC)
        writer.write(odd, 1, b"raw")
        writer.write(short, 2, b"short")
    with pytest.raises(dd.InputError, match=r"encoded as 'ros1'.* the type of topic '/odd' is not understood"):
        dd.read_recording(path, arm("a"), topic="/odd")
    recording = dd.read_recording(path, arm("a"), topic="/a")
    assert len(recording) == 0
    assert [one.text.split(": ")[-1] for one in recording.findings if one.cause == "unread"] == [
        "1 messages of '/a' are not of its type"
    ]
