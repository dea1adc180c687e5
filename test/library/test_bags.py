# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of every kind by `read_recording`: all states of whole files, all undamaged ones of others,
damage by name.

The libraries mcap and rosbags write the files.
"""

import re
import shutil
import sqlite3
import struct
import sys

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer
from rosbags import rosbag1
from rosbags.rosbag2 import CompressionMode

import diag_dynamics as dd
from bags import (
    JOINT_STATE,
    MCAP,
    NO_INDEX,
    PLAIN,
    SQLITE,
    START,
    STRING,
    TEXT,
    Message,
    arm,
    file_of,
    numbered,
    read,
    refused,
    unread,
    write_mcap,
    write_ros1,
    write_rosbag2,
    write_split,
)
from examples import examples, some_of

COMPRESSIONS = tuple(CompressionType)
ROS1_COMPRESSIONS = (None, *rosbag1.Writer.CompressionFormat)


def in_one_folder(count):
    """Return hypothesis settings under which every example may use the folder of the test."""
    parent = examples(count)
    checks = (*parent.suppress_health_check, HealthCheck.function_scoped_fixture)
    return settings(parent, suppress_health_check=checks)


# --- Whole files ---

FLAGS = (
    "use_chunking repeat_channels repeat_schemas use_statistics use_summary_offsets "
    "enable_crcs enable_data_crcs"
)


@in_one_folder(60)
@given(data=st.data(), count=st.integers(1, 150), disorder=st.sampled_from([0, 1, 30, 1000]))
def test_mcap(tmp_path, data, count, disorder):
    """Chunks overlap in time, with one or more messages each."""
    options = {flag: data.draw(st.booleans()) for flag in FLAGS.split()}
    options["index_types"] = data.draw(
        st.sampled_from([IndexType.ALL, IndexType.CHUNK, IndexType.MESSAGE, NO_INDEX])
    )
    messages = numbered(count, disorder=disorder, seed=data.draw(st.integers(0, 2**32)))
    sizes = (
        data.draw(st.sampled_from(COMPRESSIONS)),
        data.draw(st.sampled_from([1, 100, 1000, 10**6])),
    )
    assert read(write_mcap(tmp_path / "x.mcap", messages, *sizes, **options)) == (
        list(range(count)),
        [],
    )


@pytest.mark.parametrize(
    ("mode", "version"), [*((mode, 9) for mode in CompressionMode), (CompressionMode.FILE, 8)]
)
@pytest.mark.parametrize("plugin", [SQLITE, MCAP])
def test_rosbag2(tmp_path, plugin, mode, version):
    """A folder, and its file alone: only metadata.yaml says that messages are compressed one by
    one.
    """
    if (plugin, mode) == (SQLITE, CompressionMode.STORAGE):
        return
    folder = write_rosbag2(
        tmp_path / "bag", numbered(150, ("/a", "/b"), 4, 300), plugin, mode, version
    )
    for path in (folder, file_of(folder)):
        for k, topic in enumerate(("/a", "/b")):
            assert read(path, topic) == (list(range(k, 150, 2)), [])


@pytest.mark.parametrize("compression", ROS1_COMPRESSIONS)
def test_ros1(tmp_path, compression):
    path = write_ros1(tmp_path / "x.bag", numbered(100, ("/a", "/b")), compression)
    for k, topic in enumerate(("/a", "/b")):
        assert read(path, topic) == (list(range(k, 100, 2)), [])


def test_records_that_are_no_messages(tmp_path):
    """Attachments, metadata and private records are ignored, with an index and without it."""
    path = tmp_path / "x.mcap"
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=300)
        writer.start(profile="ros2")
        channel = writer.register_channel(
            "/a", "cdr", writer.register_schema(JOINT_STATE, "ros2msg", TEXT.encode())
        )
        for message in numbered(20):
            writer.add_message(channel, message.log_time, message.data, message.log_time)
            writer.add_metadata("rosbag2", {"a": "b"})
            writer.add_attachment(1, 1, "image", "image/png", b"\5" + bytes(100))
            file.write(b"\x90\4" + bytes(7) + b"ours")
        writer.finish()
    assert read(path)[0] == list(range(20))
    path.write_bytes(path.read_bytes()[:-1])
    numbers, findings = read(path)
    assert numbers == list(range(20)) and len(unread(findings)) == 1


@pytest.mark.parametrize("profiles", ["", ", offered_qos_profiles TEXT"])
def test_older_sqlite(tmp_path, profiles):
    """Topics have fewer columns, and no definitions. Rows that are no messages are counted."""
    path = tmp_path / "x.db3"
    rows = [(message.log_time, message.data) for message in numbered(100)]
    with sqlite3.connect(path) as database:
        database.execute(
            f"CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, "
            f"serialization_format{profiles})"
        )
        database.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data BLOB)"
        )
        columns = "topics(id, name, type, serialization_format)"
        database.execute(f"INSERT INTO {columns} VALUES(1, '/a', ?, 'cdr')", [JOINT_STATE])
        database.executemany(
            "INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", rows
        )
    assert read(path) == (list(range(100)), [])
    with database:
        for id, change in ((5, "data = 'text'"), (7, "timestamp = 0.5")):
            database.execute(f"UPDATE messages SET {change} WHERE id = {id}")
    database.close()
    numbers, findings = read(path)
    assert numbers == [k for k in range(100) if k not in (4, 6)]
    assert "no bytes, or no log time in int64: 2 messages; " in unread(findings)[0]


@pytest.mark.parametrize("plugin", [SQLITE, MCAP])
def test_folders_of_several_files(tmp_path, plugin):
    """Files overlap. Without metadata.yaml bag_10 is behind bag_9, also where both begin at the
    same time.
    """
    messages = [*numbered(90, disorder=20), *numbered(110)[90:]]
    parts = [
        sorted(messages[k : k + 10], key=lambda message: message.log_time) for k in range(0, 90, 10)
    ]
    parts += [
        messages[90:91],
        [messages[91]._replace(log_time=messages[90].log_time), *messages[92:]],
    ]
    folder = write_split(tmp_path / "bag", parts, plugin)
    assert read(folder) == read(folder / "metadata.yaml") == (list(range(110)), [])
    for text in (None, "a: [", "rosbag2_bagfile_information: {relative_file_paths: 3}"):
        (folder / "metadata.yaml").unlink()
        if text is not None:
            (folder / "metadata.yaml").write_text(text)
        assert read(folder) == (list(range(110)), [])
        (folder / "metadata.yaml").touch()


def test_folders_that_differ_from_their_metadata(tmp_path):
    """A file is missing, one is cut, and one that is not listed has no joint states."""
    messages = numbered(900)
    folder = write_split(
        tmp_path / "bag", [messages[:300], messages[300:600], messages[600:]], MCAP
    )
    write_mcap(folder / "results.mcap", [Message("/x", START, bytes(20), STRING)])
    (folder / "bag_0.mcap").unlink()
    content = write_mcap(folder / "bag_1.mcap", messages[300:600]).read_bytes()
    (folder / "bag_1.mcap").write_bytes(content[: len(content) // 2])
    numbers, findings = read(folder)
    count = len(numbers) - 300
    lost = unread(findings)
    assert 0 < count < 300 and numbers == [*range(300, 300 + count), *range(600, 900)]
    assert "bag_0.mcap" in lost[0] and all("bag_1.mcap" in text for text in lost[1:]) and lost[1:]


@pytest.mark.parametrize("suffix", ["", ".db3", ".mcap.zstd"])
def test_renamed_files_of_a_folder(tmp_path, suffix):
    """They are read whatever the new name ends with, once if a file is there unpacked, too."""
    plugin, ending = (SQLITE, ".db3") if suffix == ".db3" else (MCAP, ".mcap")
    messages = numbered(90)
    folder = write_split(tmp_path / "bag", [messages[:30], messages[30:61], messages[61:]], plugin)
    for old, new in {"bag_0": "9_run", "bag_1": "10_run", "bag_2": "11_run"}.items():
        path = (folder / f"{old}{ending}").rename(folder / f"{new}{suffix}")
        if suffix.endswith(".zstd"):
            shutil.copy(path, path.with_suffix(""))
            path.write_bytes(zstandard.compress(path.read_bytes()))
    assert read(folder) == (list(range(90)), [])


def test_folders_without_a_list_of_files(tmp_path):
    """Names and first bytes tell bags."""
    folder = write_split(tmp_path / "monday", [numbered(50)], MCAP)
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {relative_file_paths: []}")
    (folder / "monday_0.mcap").rename(folder / "recording")
    assert read(folder) == (list(range(50)), [])
    (folder / "recording").unlink()
    refused("contains no bag; expected", folder, arm("a"))


def test_kinds_are_known_by_content(tmp_path):
    messages = numbered(50)
    paths = [
        write_mcap(tmp_path / "mcap.bag", messages),
        write_ros1(tmp_path / "ros1.mcap", messages),
        tmp_path / "packed.mcap",
        shutil.copy(file_of(write_rosbag2(tmp_path / "bag", messages)), tmp_path / "50% #1?.mcap"),
    ]
    paths[2].write_bytes(zstandard.compress(paths[0].read_bytes()))
    for path in paths:
        assert read(path) == (list(range(50)), [])


@pytest.mark.parametrize(
    ("name", "content", "what"),
    [
        ("x.mcap", b"", r"byte 0: the file is empty\.$"),
        ("x.mcap", b"\x89MCAP", "the file has no footer"),
        (
            "x.mcap",
            b"\xff\xd8\xff\xe0" + bytes(100_000),
            "byte 0: the file does not start with the magic bytes of MCAP",
        ),
        ("x.db3", b"", r"index: the file is empty\.$"),
        (
            "x.db3",
            b"SQLite format 3\0" + bytes(5000),
            "has no joint states.* not a database: .*sqlite3 .* .recover",
        ),
        ("x.bag", b"", r"index: the file is empty\.$"),
        ("x.bag", b"#ROSBAG V1.2\n" + bytes(5000), "version 102 is not supported"),
        (
            "x.bag",
            b"#ROSBAG V2.0\n",
            "index: .*: 13 bytes; `rosbag reindex .*x.bag` may help",
        ),
    ],
)
def test_files_without_messages(tmp_path, name, content, what):
    (tmp_path / name).write_bytes(content)
    refused(what, tmp_path / name, arm("a"))


@pytest.mark.parametrize(
    ("compression", "module"), [("ZSTD", "zstandard"), ("LZ4", "lz4.frame"), ("NONE", "mcap")]
)
def test_a_library_that_is_missing_is_named(tmp_path, monkeypatch, compression, module):
    path = write_mcap(tmp_path / "x.mcap", numbered(100), CompressionType[compression])
    monkeypatch.setitem(sys.modules, module, None)
    refused(f"pip install {module.partition('.')[0]}", path, arm("a"))


# --- Damaged MCAP ---


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize(
    "options", [{}, {"index_types": NO_INDEX}, {"use_chunking": False}], ids=str
)
def test_mcap_that_is_cut_or_has_a_flipped_bit(tmp_path, compression, options):
    """It is read up to its last whole chunk. Chunks have CRCs, so no message changes; missing ones
    are named.
    """
    path = write_mcap(tmp_path / "x.mcap", numbered(25), compression, **options)
    before = 0
    content = path.read_bytes()
    for end in (*some_of(range(0, len(content), 11), 14), len(content) - 1):
        path.write_bytes(content[:end])
        numbers, findings = read(path)
        assert (
            numbers == list(range(len(numbers))) and len(numbers) >= before and unread(findings)
        ), end
        before = len(numbers)
    assert before == 25
    for at in some_of(range(0, len(content), 11), 14) if "use_chunking" not in options else ():
        damaged = bytearray(content)
        damaged[at] ^= 1 << at % 8
        path.write_bytes(damaged)
        numbers, findings = read(path)
        assert set(numbers) <= set(range(25)) and (len(numbers) == 25 or findings), at


def test_mcap_chunk_that_is_no_chunk_any_more(tmp_path):
    """Statistics count it, where no index has it."""
    path = write_mcap(tmp_path / "x.mcap", numbered(25), COMPRESSIONS[0], index_types=NO_INDEX)
    content = bytearray(path.read_bytes())
    content[content.index(b"\x06", 200)] ^= 1
    path.write_bytes(content)
    numbers, findings = read(path)
    assert len(numbers) < 25 and unread(findings)


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("is_cut", [True, False])
def test_mcap_whose_only_chunk_has_no_end(tmp_path, compression, is_cut):
    """The states before the cut are read, or before what a crash left unwritten."""
    path = write_mcap(tmp_path / "x.mcap", numbered(4000), compression, chunk_size=1 << 22)
    content = path.read_bytes()
    half = content[: len(content) // 2]
    path.write_bytes(half if is_cut else half.ljust(len(content), b"\0"))
    numbers, findings = read(path)
    assert numbers == list(range(len(numbers))) and 1000 < len(numbers) < 3000
    assert unread(findings)


def test_mcap_chunk_that_ends_with_zeros(tmp_path):
    """They are the content of its last message, so that a flipped bit loses the chunk."""
    messages = numbered(20, longest=1)
    size = 10 * (31 + len(messages[0].data)) + 1000  # with declarations, without zeros
    parts = [(*messages[k : k + 10], Message("/x", START, bytes(2000), STRING)) for k in (0, 10)]
    path = write_mcap(tmp_path / "x.mcap", [*parts[0], *parts[1]], PLAIN, chunk_size=size)
    content = bytearray(path.read_bytes())
    content[content.index(messages[3].data) + len(messages[3].data) - 2] ^= 1
    path.write_bytes(content)
    numbers, findings = read(path)
    assert numbers == list(range(10, 20)) and "crc" in unread(findings)[0]


HUGE = st.sampled_from([b"\xff" * 8, b"\0" * 8, b"\xff\xff\xff\x7f\0\0\0\0", b"\xff" * 7 + b"\x7f"])


@in_one_folder(200)
@given(data=st.data(), kind=st.sampled_from(["mcap", "db3", "bag"]))
def test_garbage_in_the_middle(tmp_path, data, kind):
    """Bytes that are overwritten, inserted or removed cause no other error, whatever sizes they
    pretend.
    """
    path = tmp_path / f"x.{kind}"
    messages = numbered(60)
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
        at = data.draw(st.integers(0, len(content)))
        new = data.draw(st.one_of(HUGE, st.binary(max_size=200)))
        content[at : at + data.draw(st.sampled_from([0, len(new), 50]))] = new
    path.write_bytes(content)
    try:
        recording = dd.read_recording(path, arm("a"))
    except dd.InputError:
        return
    assert len(recording) == len(messages) or recording.findings or kind == "db3"


def chunks(content):
    """Return where the chunks of a file begin."""
    result = []
    at = 8
    while at < len(content) - 8:
        kind, size = struct.unpack_from("<BQ", content, at)
        if kind == 6:
            result.append(at)
        at += 9 + size
    return result


@pytest.mark.parametrize(
    ("place", "new", "what"),
    [
        (33, b"1234", r"crc validation failed in Chunk.*: \d+ bytes"),
        (41, b"zsta", r"compression is 'zsta'; expected zstd, lz4 or none: \d+ bytes"),
        (
            25,
            b"\xff\xff\xff\x7f",
            r"2147483647 bytes is not the uncompressed size: \d+ bytes",
        ),
        (1, b"\xff" * 8, r"the bytes are not a chunk: \d+ bytes"),
    ],
)
def test_what_is_lost_of_a_chunk_is_named(tmp_path, place, new, what):
    """With the index all other chunks are read."""
    path = write_mcap(tmp_path / "x.mcap", numbered(200))
    content = bytearray(path.read_bytes())
    at = chunks(content)[3]
    content[at + place : at + place + len(new)] = new
    path.write_bytes(content)
    numbers, findings = read(path)
    pattern = f"{path}, chunk at byte {at}: {what}"
    assert 180 < len(numbers) < 200 and re.fullmatch(pattern, *unread(findings))


def test_garbage_between_chunks(tmp_path):
    """Without an index, all behind it is lost."""
    content = write_mcap(tmp_path / "x.mcap", numbered(100), index_types=NO_INDEX).read_bytes()
    begin = chunks(content)[5]
    for garbage in (bytes(3000), b"\5" + bytes(7), b"\xff" * 1000):
        (tmp_path / "x.mcap").write_bytes(content[:begin] + garbage + content[begin:])
        numbers, findings = read(tmp_path / "x.mcap")
        size = len(content) + len(garbage) - begin
        assert 0 < len(numbers) < 100 and numbers == list(range(len(numbers)))
        (lost,) = unread(findings)
        assert (
            f"byte {begin}: no record starts here: {size} bytes (`mcap recover` may find more)"
            in lost
        )


def test_damage_in_chunks_of_other_topics_is_no_loss(tmp_path):
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
    begin = [content.index(message.data) - 22 for message in messages[:2]]
    content[begin[0] : begin[0] + 2] = b"\7\0"
    content[begin[1] + 13] = 0xFF
    path.write_bytes(content)
    numbers, findings = read(path)
    assert numbers == list(range(2, 30))
    for text, what in zip(
        unread(findings), ("undeclared channels", "log times that int64 cannot hold"), strict=True
    ):
        assert "1 messages " in text and what in text


# --- Damaged SQLite, compressed files and ROS 1 ---


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    """Content of a database of 800 messages on many pages."""
    return file_of(
        write_rosbag2(tmp_path_factory.mktemp("x") / "bag", numbered(800, longest=400))
    ).read_bytes()


def test_damaged_sqlite(tmp_path, database):
    """What it lacks is a finding with the command that recovers it; no message is wrong."""
    path = tmp_path / "x.db3"
    contents = [database[: int(share * len(database))] for share in (0.999, 0.05)]
    for page in some_of(range(1, len(database) // 4096), 9):
        end = 4096 * (page + 1)
        contents.append(database[: end - 4096] + bytes([page % 256]) * 4096 + database[end:])
    for content in contents:
        path.write_bytes(content)
        numbers, findings = read(path)
        assert numbers == list(range(len(numbers)))
        if len(numbers) < 800:
            assert f"`sqlite3 {path} .recover` may help" in unread(findings)[0]


def test_the_journal_of_a_killed_recorder(tmp_path, database):
    """It is not read, and a finding has the command that writes it into the file."""
    path = tmp_path / "live.db3"
    path.write_bytes(database)
    (tmp_path / "live.db3-wal").write_bytes(b"7")
    numbers, findings = read(path)
    assert numbers == list(range(800))
    assert f"journal: it is not read; `sqlite3 {path} .schema`" in unread(findings)[0]


def test_a_compressed_file_that_is_cut(tmp_path):
    path = write_mcap(tmp_path / "x.mcap", numbered(2000, longest=400), PLAIN)
    content = zstandard.compress(path.read_bytes())
    half = content[: len(content) // 2]
    for content, what in ((half, str(path)), (half + b"\xff" * 10**6, "its compression")):
        path.write_bytes(content)
        numbers, findings = read(path)
        assert 0 < len(numbers) < 2000 and numbers == list(range(len(numbers)))
        assert any(what in text for text in unread(findings))


def test_ros1_without_its_index(tmp_path):
    """As a recorder that was killed leaves it, and a copy that was not finished. Others of its
    folder are read.
    """
    path = tmp_path / "bag" / "b.bag"
    messages = numbered(120)
    path.parent.mkdir()
    content = write_ros1(path, messages[60:]).read_bytes()
    write_mcap(path.with_name("a.mcap"), messages[:60])
    assert read(path.parent)[0] == list(range(120))
    for size in (len(content) - 1, len(content) // 2, 100):
        path.write_bytes(content[:size])
        refused(f"{size} bytes; `rosbag reindex {path}` may help", path, arm("a"))
        numbers, findings = read(path.parent)
        assert numbers == list(range(60)) and f"`rosbag reindex {path}`" in unread(findings)[0]


@pytest.mark.parametrize(("compression", "sign"), [("BZ2", b"BZh"), (None, b"op=\2")])
def test_damage_within_ros1(tmp_path, compression, sign):
    """It is read up to the damage, and all messages behind it are counted."""
    formats = rosbag1.Writer.CompressionFormat
    path = write_ros1(
        tmp_path / "x.bag", numbered(300), formats[compression] if compression else None
    )
    content = bytearray(path.read_bytes())
    at = content.index(sign, len(content) // 2)
    content[at : at + 4] = bytes(4)
    path.write_bytes(content)
    numbers, findings = read(path)
    (lost,) = unread(findings)
    assert 50 < len(numbers) < 250 and numbers == list(range(len(numbers)))
    assert "after log time " in lost and f": {300 - len(numbers)} messages; " in lost
