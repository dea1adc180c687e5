# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of rosbag2 and of ROS 1, written by rosbags, are read as rosbags reads them; damaged ones as far as they go."""

import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
import yaml
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_typestore

from bags import JOINT_STATE, TEXT, Told, ordered, some, told_by, write_mcap
from diag_dynamics.bags.mcap_reader import McapFile
from diag_dynamics.bags.messages import Connection
from diag_dynamics.bags.opening import open_bag
from diag_dynamics.bags.ros1_reader import Ros1Bag
from diag_dynamics.bags.sqlite_reader import SqliteFile
from diag_dynamics.exceptions import InputError

SQLITE, MCAP = StoragePlugin.SQLITE3, StoragePlugin.MCAP
ZSTD = b"\x28\xb5\x2f\xfd"


def write_folder(path, messages, plugin=SQLITE, mode=CompressionMode.NONE, version=9):
    """Write a folder of rosbag2; returns its path."""
    writer = rosbag2.Writer(path, version=version, storage_plugin=plugin)
    if mode != CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for one in messages:
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, JOINT_STATE, msgdef=TEXT, rihs01="RIHS01_0")
            writer.write(connections[one.topic], one.log_time, one.data)
    return path


def connections_of(messages):
    return [Connection(topic, JOINT_STATE, "cdr", TEXT) for topic in dict.fromkeys(one.topic for one in messages)]


def read(path):
    """Messages of a bag, and the bag."""
    bag = open_bag(path)
    return told_by(bag), bag


def assert_whole(bag):
    assert (bag.unread, bag.findings) == ([], [])


# --- rosbag2 ---


@pytest.mark.parametrize("version", [8, 9])
@pytest.mark.parametrize(
    ("plugin", "mode"),
    [
        *((plugin, mode) for plugin in (SQLITE, MCAP) for mode in CompressionMode if mode != CompressionMode.STORAGE),
        (MCAP, CompressionMode.STORAGE),
    ],
)
def test_folders_of_rosbag2(tmp_path, plugin, mode, version):
    messages = some(5000, disorder=4000, longest=300)
    folder = write_folder(tmp_path / "bag", messages, plugin, mode, version)
    told, bag = read(folder)
    assert told == ordered(messages)
    assert bag.connections == connections_of(messages) and bag.start == min(one.log_time for one in messages)
    assert_whole(bag)
    with rosbag2.Reader(folder) as reader:
        assert sorted(told) == sorted(Told(c.topic, t, bytes(data)) for c, t, data in reader.messages())
    for k, connection in enumerate(bag.connections):
        assert told_by(bag, [k]) == [one for one in told if one.topic == connection.topic]
    assert told_by(bag, []) == []
    assert_whole(bag)


@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.MESSAGE, CompressionMode.FILE])
@pytest.mark.parametrize("plugin", [SQLITE, MCAP])
def test_files_of_rosbag2_without_their_folder(tmp_path, plugin, mode):
    """What a message is compressed by stands in the folder's metadata.yaml alone; that it is, it says itself."""
    messages = some(500)
    folder = write_folder(tmp_path / "bag", messages, plugin, mode)
    (path,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
    told, bag = read(path)
    assert told == messages and bag.connections == connections_of(messages)
    assert_whole(bag)


@pytest.mark.parametrize("columns", ["", ", offered_qos_profiles TEXT"])
def test_older_files_in_sqlite(tmp_path, columns):
    """Their topics have fewer columns, and definitions are not in them."""
    messages = some(100)
    with sqlite3.connect(tmp_path / "x.db3") as database:
        database.execute(
            f"CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT{columns})"
        )
        database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data BLOB)")
        for k, topic in enumerate(dict.fromkeys(one.topic for one in messages)):
            row = (k + 1, topic, JOINT_STATE, "cdr")
            database.execute("INSERT INTO topics(id, name, type, serialization_format) VALUES(?, ?, ?, ?)", row)
        topics = dict(database.execute("SELECT name, id FROM topics"))
        rows = [(topics[one.topic], one.log_time, one.data) for one in messages]
        database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows)
    database.close()
    told, bag = read(tmp_path / "x.db3")
    assert told == messages
    assert bag.connections == [one._replace(definition="") for one in connections_of(messages)]
    assert_whole(bag)
    with sqlite3.connect(tmp_path / "x.db3") as database:
        database.execute("UPDATE messages SET topic_id = 9 WHERE id = 3")
        database.execute("UPDATE messages SET data = 'text' WHERE id = 5")
        database.execute("UPDATE messages SET timestamp = NULL WHERE id = 7")
    database.close()
    told, bag = read(tmp_path / "x.db3")
    assert told == [one for k, one in enumerate(messages) if k not in (2, 4, 6)]
    assert [lost.what for lost in bag.unread] == [
        "1 messages are of topics that are not listed",
        "2 messages have no bytes, or no time that int64 can hold",
    ]


def split(tmp_path, plugin, parts, name="bag", extra=()):
    """A folder with a file for each part, as rosbag2 splits recordings."""
    folder = tmp_path / name
    folder.mkdir()
    told = None
    for k, messages in enumerate(parts):
        part = write_folder(tmp_path / f"{name}_{k}", messages, plugin)
        own = yaml.safe_load((part / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        (file,) = (path for path in part.iterdir() if path.name != "metadata.yaml")
        file.rename(folder / file.name)
        if told is None:
            told = own
            continue
        told["relative_file_paths"] += own["relative_file_paths"]
        numbers = {topic["topic_metadata"]["name"]: topic for topic in told["topics_with_message_count"]}
        for topic in own["topics_with_message_count"]:
            if (had := numbers.get(topic["topic_metadata"]["name"])) is None:
                told["topics_with_message_count"].append(topic)
            else:
                had["message_count"] += topic["message_count"]
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": told}))
    return folder


@pytest.mark.parametrize("plugin", [SQLITE, MCAP])
def test_a_recording_of_several_files(tmp_path, plugin):
    """They overlap by some messages; each has topics of its own, in an order of its own."""
    messages = some(3000, disorder=20_000)
    parts = [messages[k : k + 250] for k in range(0, 3000, 250)]
    folder = split(tmp_path, plugin, parts)
    told, bag = read(folder)
    assert told == ordered(messages)
    assert sorted(bag.connections) == sorted(connections_of(messages))
    assert_whole(bag)
    (folder / "metadata.yaml").unlink()
    told, bag = read(folder)  # bag_10 comes behind bag_9, or those of the same time would change places
    assert told == ordered(messages)
    (finding,) = bag.findings
    assert finding.startswith(f"'{folder}' has no metadata.yaml") and bag.unread == []


def test_a_recording_of_which_a_file_is_damaged_missing_or_a_strangers(tmp_path):
    messages = some(3000)
    folder = split(tmp_path, MCAP, [messages[:1000], messages[1000:2000], messages[2000:]])
    write_mcap(folder / "results.mcap", some(10))
    (folder / "bag_0.mcap").unlink()
    content = (folder / "bag_1.mcap").read_bytes()
    (folder / "bag_1.mcap").write_bytes(content[: len(content) // 2])
    told, bag = read(folder)
    read_of_it = len(told) - 1000
    assert 0 < read_of_it < 1000
    assert told == messages[1000 : 1000 + read_of_it] + messages[2000:]
    assert bag.unread[0][:2] == (str(folder), "bag_0.mcap")
    assert {lost.file for lost in bag.unread[1:]} == {str(folder / "bag_1.mcap")}
    assert f"'{folder}': metadata.yaml does not list results.mcap: not read." in bag.findings
    for topic in ("/a", "/b", "/c"):
        there, all_ = (sum(one.topic == topic for one in some_) for some_ in (told, messages))
        assert (
            f"'{folder}': metadata.yaml tells of {all_} messages of '{topic}', and {there} are there." in bag.findings
        )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a: [",
        "rosbag2_bagfile_information:\n  version: 5\n",
        "- 1\n",
        "rosbag2_bagfile_information: {relative_file_paths: 3}",
    ],
)
def test_a_folder_whose_metadata_are_damaged(tmp_path, text):
    messages = some(100)
    folder = write_folder(tmp_path / "bag", messages)
    (folder / "metadata.yaml").write_text(text)
    told, bag = read(folder)
    assert told == messages and bag.unread == []
    (finding,) = bag.findings
    assert "metadata.yaml is damaged" in finding and "\n" not in finding


# --- Damage of SQLite ---


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A file in SQLite of many pages, and its messages."""
    messages = some(4000, disorder=3000, longest=400)
    folder = write_folder(tmp_path_factory.mktemp("sqlite") / "bag", messages)
    return folder / "bag.db3", ordered(messages)


@pytest.mark.parametrize("share", [0.999, 0.9, 0.6, 0.3, 0.05])
def test_a_file_in_sqlite_that_is_cut(tmp_path, recording, share):
    path, messages = recording
    content = path.read_bytes()
    (tmp_path / "x.db3").write_bytes(content[: int(share * len(content))])
    told, bag = read(tmp_path / "x.db3")
    assert set(told) <= set(messages) and len(set(told)) == len(told)
    assert len(told) > (share - 0.25) * len(messages)  # its definition and its index lie at the end, too
    assert bag.unread


def test_a_page_of_sqlite_that_is_overwritten(tmp_path, recording):
    """All messages but those on the page are read, and their numbers are named, whichever page it is."""
    path, messages = recording
    content = path.read_bytes()
    fewest = []
    for page in range(1, len(content) // 4096, 7):
        damaged = bytearray(content)
        damaged[4096 * page : 4096 * (page + 1)] = bytes([page % 256]) * 4096
        (tmp_path / "x.db3").write_bytes(damaged)
        told, bag = read(tmp_path / "x.db3")
        assert set(told) <= set(messages) and len(set(told)) == len(told)
        assert ordered(told) == messages or bag.unread, page
        fewest.append(len(told))
    assert np.median(fewest) > len(messages) - 40


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.integers(0, 10**6), new=st.binary(min_size=1, max_size=300))
def test_garbage_in_a_file_in_sqlite(tmp_path, recording, at, new):
    content = bytearray(recording[0].read_bytes())
    at %= len(content)
    content[at : at + len(new)] = new
    (tmp_path / "x.db3").write_bytes(content[: len(content)])
    read(tmp_path / "x.db3")


@pytest.mark.parametrize("mode", ["WAL", "DELETE"])
def test_what_an_ended_recorder_has_left_in_a_journal(tmp_path, recording, mode):
    """It is read in a copy; the files of the recording are not touched."""
    live, left = tmp_path / "live.db3", tmp_path / "left"
    left.mkdir()
    shutil.copy(recording[0], live)
    database = sqlite3.connect(live, isolation_level=None)
    database.execute(f"PRAGMA journal_mode={mode}")
    database.execute("PRAGMA cache_size=1")  # so that pages are written before they are committed
    database.execute("BEGIN")
    database.execute("UPDATE messages SET data = x'00010000'")
    if mode == "WAL":
        database.execute("COMMIT")
    for path in tmp_path.glob("live.db3*"):
        if not path.name.endswith("-shm"):
            shutil.copy(path, left)
    database.close()
    names = sorted(path.name for path in left.iterdir())
    assert names == ["live.db3", f"live.db3-{'wal' if mode == 'WAL' else 'journal'}"]
    before = {name: (left / name).read_bytes() for name in names}
    told, bag = read(left / "live.db3")
    if mode == "WAL":
        assert [one.data for one in told] == [b"\0\1\0\0"] * len(recording[1])
    else:  # what was not committed is taken back
        assert told == recording[1]
    assert bag.unread == [] and "has a journal" in bag.findings[0]
    assert {path.name: path.read_bytes() for path in left.iterdir()} == before


@pytest.mark.parametrize(
    "content", [b"", b"SQLite format 3\0", b"SQLite format 3\0" + bytes(5000), b"no database at all"]
)
def test_files_that_are_no_database(tmp_path, content):
    (tmp_path / "x.db3").write_bytes(content)
    told, bag = read(tmp_path / "x.db3")
    assert told == [] and bag.connections == [] and len(bag.unread) == 1


def test_a_database_of_something_else(tmp_path):
    database = sqlite3.connect(tmp_path / "x.db3")
    database.execute("CREATE TABLE cats(name)")
    database.commit()
    database.close()
    told, bag = read(tmp_path / "x.db3")
    assert told == [] and "no such table: topics" in bag.unread[0].what


def test_a_compressed_file_that_is_cut(tmp_path):
    messages = some(5000, longest=400)
    folder = write_folder(tmp_path / "bag", messages, MCAP, CompressionMode.FILE)
    path = folder / "bag.mcap.zstd"
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    told, bag = read(path)
    assert 0 < len(told) < 5000 and told == messages[: len(told)]
    assert {lost.file for lost in bag.unread} == {str(path)}
    path.write_bytes(content[: len(content) // 2] + b"\xff" * 10**6)
    told, bag = read(path)
    assert 0 < len(told) < 5000 and any("zstd says" in lost.what for lost in bag.unread)


# --- ROS 1 ---

NOETIC, JAZZY = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_JAZZY)


def joint_state(store, k, seq=None):
    """A JointState of either ROS."""
    types = store.types
    time = types["builtin_interfaces/msg/Time"](k, 7 * k)
    given = {"stamp": time, "frame_id": "b" * (k % 5)} | ({} if seq is None else {"seq": seq})
    header = types["std_msgs/msg/Header"](**given)
    names, values = [f"joint{i}" for i in range(k % 3)], np.arange(k % 3) * 0.1
    return types[JOINT_STATE](header, names, values, values + k, values[:0])


def write_ros1(path, count=300, compression=None, chunk=2000):
    """Write a bag of ROS 1; returns its messages as ROS 2 has them."""
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = chunk
    if compression:
        writer.set_compression(compression)
    messages = []
    with writer:
        topics = [writer.add_connection(topic, JOINT_STATE, typestore=NOETIC) for topic in ("/a", "/b")]
        for k in range(count):
            raw = NOETIC.serialize_ros1(joint_state(NOETIC, k, k), JOINT_STATE)
            writer.write(topics[k % 2], 10**9 + 1000 * k, raw)
            data = bytes(JAZZY.serialize_cdr(joint_state(JAZZY, k), JOINT_STATE))
            messages.append(Told(topics[k % 2].topic, 10**9 + 1000 * k, data))
    return messages


@pytest.mark.parametrize("compression", [None, *rosbag1.Writer.CompressionFormat])
def test_bags_of_ros1(tmp_path, compression):
    """Their messages are what ROS 2 would have written, to the byte."""
    messages = write_ros1(tmp_path / "x.bag", compression=compression)
    told, bag = read(tmp_path / "x.bag")
    assert told == messages and bag.start == 10**9
    assert_whole(bag)
    definition = JAZZY.generate_msgdef(JOINT_STATE, ros_version=2)[0]
    for k, connection in enumerate(bag.connections):
        assert connection[:3] == (("/a", "/b")[k], JOINT_STATE, "cdr")
        assert connection.definition.split("\n") == definition.split("\n")
        assert told_by(bag, [k]) == messages[k::2]


@pytest.mark.parametrize("compression", [None, rosbag1.Writer.CompressionFormat.LZ4])
def test_a_bag_of_ros1_that_is_cut(tmp_path, compression):
    """It has no index then, and is read up to its last whole chunk; so is one that was not closed."""
    path, before = tmp_path / "x.bag", 0
    messages = write_ros1(path, compression=compression)
    content = path.read_bytes()
    for end in [*range(0, len(content), 411), len(content) - 1]:
        path.write_bytes(content[:end])
        told, bag = read(path)
        assert told == messages[: len(told)] and len(told) >= before
        assert bag.unread
        before = len(told)
    assert before == len(messages)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_garbage_in_a_bag_of_ros1(tmp_path, data):
    path = tmp_path / "x.bag"
    path.unlink(missing_ok=True)
    messages = write_ros1(path, 60, data.draw(st.sampled_from([None, *rosbag1.Writer.CompressionFormat])))
    content = bytearray(path.read_bytes())
    at, new = data.draw(st.integers(0, len(content))), data.draw(st.binary(min_size=1, max_size=100))
    content[at : at + len(new)] = new
    path.write_bytes(content)
    told, bag = read(path)
    assert len(told) == len(messages) or bag.unread or bag.findings


def test_a_chunk_of_ros1_that_is_damaged(tmp_path):
    """The others are read."""
    path = tmp_path / "x.bag"
    messages = write_ros1(path, compression=rosbag1.Writer.CompressionFormat.BZ2)
    content = bytearray(path.read_bytes())
    at = content.index(b"BZh", len(content) // 3)
    content[at + 40 : at + 60] = bytes(20)
    path.write_bytes(content)
    told, bag = read(path)
    (lost,) = bag.unread
    assert lost.where.startswith("chunk at byte ") and lost.what.endswith(f": {len(messages) - len(told)} messages")
    assert [one for one in messages if one in set(told)] == told and len(told) > 200


def test_types_of_ros1_that_are_not_understood(tmp_path):
    """Their messages are handed out as they are, and so is their encoding named; what is not of its type is told of."""
    path = tmp_path / "x.bag"
    with rosbag1.Writer(path) as writer:
        odd = writer.add_connection("/odd", "x/msg/Y", msgdef="what is this?!", md5sum="0" * 32)
        short = writer.add_connection("/a", JOINT_STATE, typestore=NOETIC)
        writer.write(odd, 1, b"raw")
        writer.write(short, 2, b"short")
    told, bag = read(path)
    assert told == [Told("/odd", 1, b"raw")]
    assert [one.encoding for one in bag.connections] == ["ros1", "cdr"]
    assert "the type of topic '/odd' is not understood" in bag.findings[0]
    assert [lost.what for lost in bag.unread] == ["1 messages of '/a' are not of its type"]


@pytest.mark.parametrize("content", [b"", b"#ROSBAG V1.2\n" + bytes(5000), b"#ROSBAG V2.0\n", b"nothing of the kind"])
def test_files_that_are_no_bags_of_ros1(tmp_path, content):
    (tmp_path / "x.bag").write_bytes(content)
    told, bag = read(tmp_path / "x.bag")
    assert told == [] and bag.connections == [] and bag.unread


# --- Opening ---


def test_files_are_known_by_what_they_begin_with(tmp_path):
    messages = some(10)
    write_mcap(tmp_path / "mcap.bag", messages)
    shutil.copy(write_folder(tmp_path / "bag", messages) / "bag.db3", tmp_path / "sqlite.mcap")
    write_ros1(tmp_path / "ros1.bag.active")
    (tmp_path / "packed.txt").write_bytes(zstandard.compress((tmp_path / "mcap.bag").read_bytes()))
    for name, kind in [
        ("mcap.bag", McapFile),
        ("sqlite.mcap", SqliteFile),
        ("ros1.bag.active", Ros1Bag),
        ("packed.txt", McapFile),
    ]:
        told, bag = read(tmp_path / name)
        assert told and type(bag) is kind and bag.name == str(tmp_path / name)
        assert_whole(bag)


def test_what_is_no_bag_is_refused(tmp_path):
    known = r"folders of rosbag2, \.mcap and \.db3, each of them compressed by zstd or not, and \.bag of ROS 1\.$"
    (tmp_path / "x.csv").write_text("t,q\n")
    (tmp_path / "x.zst").write_bytes(zstandard.compress(b"text"))
    with pytest.raises(InputError, match=rf"x\.csv' is no bag that is known; there are {known}"):
        open_bag(tmp_path / "x.csv")
    with pytest.raises(InputError, match=rf"x\.zst' is no bag that is known; there are {known}"):
        open_bag(tmp_path / "x.zst")
    with pytest.raises(InputError, match=r"none\.mcap' cannot be read: No such file or directory"):
        open_bag(tmp_path / "none.mcap")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=rf"empty' has no metadata\.yaml and no bags in it; there are {known}"):
        open_bag(tmp_path / "empty")


def test_a_folder_of_any_bags(tmp_path):
    """Without metadata.yaml, all that are in it: here an MCAP of one half, and a bag of ROS 1 of the other."""
    (tmp_path / "both").mkdir()
    messages = write_ros1(tmp_path / "both" / "b.bag", 100)
    others = some(100)
    write_mcap(tmp_path / "both" / "a.mcap", others)
    told, bag = read(tmp_path / "both")
    assert told == ordered([*others, *messages])
    assert [one.topic for one in bag.connections].count("/a") == 1  # of the same type in both
    assert Path(bag.name) == tmp_path / "both" and bag.unread == []
