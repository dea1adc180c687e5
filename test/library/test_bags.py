# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of every kind, by `read_recording`: every state of a whole file, and of a damaged one all that is whole.

Files are written by the libraries mcap and rosbags. Of a damaged file, the findings name what is lost.
"""

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
    PLAIN,
    SQLITE,
    TEXT,
    ZSTD,
    arm,
    file_of,
    numbered,
    read,
    unread,
    write_mcap,
    write_ros1,
    write_rosbag2,
    write_split,
)
from examples import examples, some_of

COMPRESSIONS = (ZSTD, LZ4, PLAIN)
ROS1_COMPRESSIONS = (None, *rosbag1.Writer.CompressionFormat)


def in_one_folder(count):
    """Return hypothesis settings: every example may use the folder of the test."""
    return settings(examples(count), suppress_health_check=[HealthCheck.function_scoped_fixture])


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
    content = write_mcap(folder / "bag_1.mcap", messages[300:600]).read_bytes()
    (folder / "bag_1.mcap").write_bytes(content[: len(content) // 2])
    numbers, findings = read(folder)
    count = len(numbers) - 300
    assert 0 < count < 300 and numbers == [*range(300, 300 + count), *range(600, 900)]
    lost = unread(findings)
    assert "bag_0.mcap" in lost[0] and all("bag_1.mcap" in text for text in lost[1:]) and lost[1:]
    notes = " ".join(text for cause, text in findings if cause == "note")
    assert "does not list results.mcap" in notes


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


def test_paths_beside_a_folder(tmp_path):
    """Its metadata.yaml is read as the folder; a folder of folders has their names in the error."""
    for name in ("monday", "tuesday"):
        folder = write_rosbag2(tmp_path / name, numbered(20))
    assert read(folder / "metadata.yaml") == (list(range(20)), [])
    with pytest.raises(dd.InputError, match=r"no bags in it.* Is one of its folders meant: monday, tuesday\?"):
        dd.read_recording(tmp_path, arm("a"))


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
        ("x.db3", b"no database at all", "no such table: topics|not a database"),
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


@pytest.mark.parametrize(
    ("place", "new", "what"),
    [
        (33, b"1234", "chunk at byte {at}: crc validation failed"),
        (41, b"zsta", "compression 'zsta' is not known; zstd, lz4 and none are: {count} messages"),
        (53, b"\xff" * 20, ": {count} messages"),
        (1, b"\xff" * 8, "chunk at byte {at}: no chunk is here: {count} messages"),  # the length of the chunk
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
    assert np.median(found) > count // 4


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
    path = write_mcap(tmp_path / "x.mcap", numbered(2000, longest=400))
    path.write_bytes(zstandard.compress(path.read_bytes()))
    half = path.read_bytes()[: path.stat().st_size // 2]
    for content, what in ((half, str(path)), (half + b"\xff" * 10**6, "its compression")):
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


def chunks_of_ros1(content):
    """Return where the chunks of a ROS 1 bag begin and end."""
    found, at = [], content.index(b"\n") + 1
    while at < len(content):
        (head,) = struct.unpack_from("<I", content, at)
        (size,) = struct.unpack_from("<I", content, at + 4 + head)
        end = at + 8 + head + size
        if b"op=\5" in content[at : at + head + 4]:
            found.append((at, end))
        at = end
    return found


@pytest.mark.parametrize("compression", [None, rosbag1.Writer.CompressionFormat.LZ4])
@pytest.mark.parametrize("lacking", [0, 1, 8, 300, 1000])
def test_ros1_that_ends_within_a_chunk(tmp_path, compression, lacking):
    """The loss is the whole chunk, however few bytes of it are lacking; without any lacking there is none."""
    path = write_ros1(tmp_path / "x.bag", numbered(120), compression)
    content = path.read_bytes()
    begin, end = chunks_of_ros1(content)[3]
    path.write_bytes(content[:end])
    whole, _ = read(path)
    path.write_bytes(content[: end - lacking])
    numbers, findings = read(path)
    lost = f"{path}, byte {begin}: the file ends within a chunk: {end - lacking - begin} bytes"
    closed = f"{path}, byte {end}: the file was not closed: what came here, if anything, is lost"
    assert unread(findings) == [lost if lacking else closed]
    assert numbers == list(range(len(numbers))) and (numbers == whole) == (lacking == 0)


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
