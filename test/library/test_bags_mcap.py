# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of MCAP are read as the library mcap reads them; of damaged ones all that is whole, and the rest is named."""

import struct
import sys
import tracemalloc
from itertools import islice

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader

from bags import ALL, JOINT_STATE, NO_CHUNKS, NO_INDEX, NO_MESSAGES, TEXT, ordered, some, told_by, write_mcap
from diag_dynamics.bags.mcap_reader import McapFile
from diag_dynamics.bags.messages import Connection
from diag_dynamics.exceptions import InputError

COMPRESSIONS = ("zstd", "lz4", "")


def by_mcap(path):
    """What the library mcap reads in a file: topic, log time and data, in the order of log time."""
    with open(path, "rb") as file:
        return sorted((m.log_time, c.topic, m.data) for _, c, m in NonSeekingReader(file).iter_messages())


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32),
    count=st.integers(0, 150),
    disorder=st.sampled_from([0, 900, 30_000, 10**6]),
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
def test_files_of_the_library_mcap(tmp_path, seed, count, disorder, compression, chunk_size, options):
    messages = some(count, np.random.default_rng(seed), disorder=disorder)
    path = write_mcap(tmp_path / "x.mcap", messages, compression, chunk_size, **options)
    bag = McapFile(path)
    told = told_by(bag)
    assert told == ordered(messages)
    assert sorted((one.log_time, one.topic, one.data) for one in told) == by_mcap(path)
    assert bag.unread == [] and bag.findings == []
    assert bag.start is None or bag.start <= min(one.log_time for one in messages)
    topics = list(dict.fromkeys(one.topic for one in messages))
    assert bag.connections == [Connection(topic, JOINT_STATE, "cdr", TEXT) for topic in topics]


def test_only_what_is_wanted_is_read(tmp_path):
    messages = some(300)
    bag = McapFile(write_mcap(tmp_path / "x.mcap", messages))
    for k, connection in enumerate(bag.connections):
        assert told_by(bag, [k]) == [one for one in messages if one.topic == connection.topic]
    assert told_by(bag, []) == []
    with pytest.raises(InputError, match="connection 3 is wanted"):
        next(bag.pieces([3]))


@pytest.mark.parametrize("whole", [True, False])
def test_chunks_of_other_topics_are_not_read(tmp_path, whole):
    """Nor is damage in them told of: images, say, that nobody wants."""
    messages = [*some(100, topics=["/a"]), *some(100, np.random.default_rng(1), ["/b"])]
    content = bytearray(write_mcap(tmp_path / "x.mcap", messages, "").read_bytes())
    content[content.index(messages[190].data) + 4] ^= 1
    (tmp_path / "x.mcap").write_bytes(content if whole else content[:-8])
    bag = McapFile(tmp_path / "x.mcap")
    said = list(bag.unread)
    assert told_by(bag, [0]) == messages[:100] and bag.unread == said
    assert len(told_by(bag, [1])) < 100 and len(bag.unread) == len(said) + 1


def test_chunks_that_overlap_are_merged_and_no_others(tmp_path):
    """A topic that lags far behind does not have all of the file be held."""
    early, late = some(200, topics=["/a"]), some(200, topics=["/b"])
    path = write_mcap(tmp_path / "x.mcap", [*early, *late], chunk_size=300)
    assert told_by(McapFile(path)) == ordered([*early, *late])
    begin = [piece.log_time[0] for piece in islice(McapFile(path).pieces(), 3)]
    assert begin[2] < early[30].log_time


def test_a_long_file_is_never_in_memory(tmp_path):
    messages = some(20_000, longest=1000)
    path = write_mcap(tmp_path / "x.mcap", messages, chunk_size=100_000)
    tracemalloc.start()
    count = sum(len(piece.at) for piece in McapFile(path).pieces())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert count == len(messages) and path.stat().st_size > 9e6
    assert peak < 2e6


def test_records_that_are_no_messages_are_passed_over(tmp_path):
    """Attachments, metadata, and kinds of records that are not known, which the format says to skip."""
    from mcap.writer import Writer

    with open(tmp_path / "x.mcap", "wb") as file:
        writer = Writer(file, chunk_size=100)
        writer.start(profile="ros2")
        channel = writer.register_channel("/a", "json", 0)
        for k in range(20):
            writer.add_message(channel, k, b"{}", k)
            writer.add_metadata("rosbag2", {"a": "b"})
            writer.add_attachment(k, k, "image", "image/png", b"\5" + bytes(100))
            file.write(struct.pack("<BQ", 0x90, 4) + b"ours")
        writer.finish()
    bag = McapFile(tmp_path / "x.mcap")
    assert bag.connections == [Connection("/a", "", "json", "")]
    assert [one.log_time for one in told_by(bag)] == list(range(20))
    (lost,) = bag.unread
    assert lost.what == "records of kinds that the format does not have, the first one here: 20, 260 bytes"


@pytest.mark.parametrize(("compression", "package"), [("zstd", "zstandard"), ("lz4", "lz4")])
def test_a_library_that_is_missing_is_named(tmp_path, monkeypatch, compression, package):
    path = write_mcap(tmp_path / "x.mcap", some(100), compression)
    monkeypatch.setitem(sys.modules, {"zstandard": "zstandard", "lz4": "lz4.frame"}[package], None)
    with pytest.raises(InputError, match=rf"need the package {package}: pip install {package}"):
        told_by(McapFile(path))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="cannot be read: No such file"):
        McapFile(tmp_path / "none.mcap")


# --- Damage ---


def read(path, content):
    """Messages of a file of this content, and the bag."""
    path.write_bytes(content)
    bag = McapFile(path)
    return told_by(bag), bag


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("options", [{}, {"index_types": NO_INDEX}, {"use_chunking": False}], ids=str)
def test_a_file_that_is_cut_anywhere(tmp_path, compression, options):
    """Its beginning is read, and each byte more loses nothing that was read before."""
    messages, before = some(25), 0
    path = write_mcap(tmp_path / "x.mcap", messages, compression, **options)
    content = path.read_bytes()
    for end in range(len(content)):
        told, bag = read(path, content[:end])
        assert told == messages[: len(told)], end
        assert len(told) >= before, end
        assert bag.unread, end
        before = len(told)
    assert before == len(messages)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_chunk_that_is_cut_still_has_its_beginning(tmp_path, compression):
    """The last seconds before a crash are what a recording is made for."""
    messages = some(5000, longest=400)
    path = write_mcap(tmp_path / "x.mcap", messages, compression, chunk_size=10**7)
    told, bag = read(path, path.read_bytes()[:500_000])
    assert 1000 < len(told) < 5000 and told == messages[: len(told)]
    assert bag.unread[0].what.startswith("the file ends within it: ")


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("options", [{}, {"index_types": NO_INDEX}], ids=str)
def test_a_bit_that_is_flipped_anywhere(tmp_path, compression, options):
    """No message is changed: chunks have CRCs. What is not handed out is told of."""
    messages = some(25)
    path = write_mcap(tmp_path / "x.mcap", messages, compression, **options)
    content = path.read_bytes()
    for at in range(len(content)):
        damaged = bytearray(content)
        damaged[at] ^= 1 << at % 8
        told, bag = read(path, damaged)
        assert set(told) <= set(messages), at
        assert ordered(told) == messages or bag.unread, at
        assert told == ordered(told) or bag.findings, at


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), options=st.sampled_from([{}, {"enable_crcs": False}, {"use_chunking": False}]))
def test_garbage_in_the_middle(tmp_path, data, options):
    """Bytes that are overwritten, put in or left out: no exception, no endless loop, no allocation that a length asks for."""
    messages = some(60)
    compression = data.draw(st.sampled_from(COMPRESSIONS))
    path = write_mcap(tmp_path / "x.mcap", messages, compression, **options)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        huge = st.sampled_from([b"\xff" * 8, b"\0" * 8, b"\xff\xff\xff\x7f\0\0\0\0", b"\xff" * 7 + b"\x7f"])
        new = data.draw(st.one_of(huge, st.binary(max_size=200)))
        content[at : at + data.draw(st.sampled_from([0, len(new), 50]))] = new
    tracemalloc.start()
    path.write_bytes(content)
    bag = McapFile(path)
    list(bag.pieces())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 60e6  # the search for records takes 4 MB at a time


def test_records_go_on_behind_garbage(tmp_path):
    """All chunks but the one that was hit are read, without an index, too."""
    messages = some(200)
    path = write_mcap(tmp_path / "x.mcap", messages, index_types=NO_INDEX)
    content, rng = path.read_bytes(), np.random.default_rng(0)
    at = [part.at for part in McapFile(path)._parts][5]
    for garbage in (rng.bytes(3000), bytes(3000), b"\5" + bytes(7), np.arange(1000).tobytes()):
        told, bag = read(path, content[:at] + garbage + content[at:])
        assert told == messages
        (lost,) = bag.unread
        assert lost == (str(path), f"byte {at}", f"no record begins here: {len(garbage)} bytes")


def test_what_is_lost_is_named(tmp_path):
    messages = some(200)
    path = write_mcap(tmp_path / "x.mcap", messages)
    content = bytearray(path.read_bytes())
    at, behind = (part.at for part in McapFile(path)._parts[3:5])
    crc, name, stored = at + 9 + 24, at + 9 + 32, at + 9 + 44

    def lost(place, new):
        damaged = content.copy()
        damaged[place : place + len(new)] = new
        told, bag = read(path, damaged)
        (unread,) = bag.unread
        assert unread.file == str(path) and told != messages and set(told) <= set(messages)
        return unread.where, unread.what, len(messages) - len(told)

    where, what, count = lost(crc, b"1234")
    assert (where, what) == (f"chunk at byte {at}", f"its CRC is wrong: {count} messages")
    where, what, count = lost(name, b"zsta")
    assert what == f"compression 'zsta' is not known; zstd, lz4 and none are: {count} messages"
    where, what, count = lost(stored, b"\xff" * 20)
    assert what.startswith("zstd says: ") and what.endswith(f": {count} messages")
    where, what, count = lost(at + 1, b"\xff" * 8)  # the length of the chunk
    assert where == f"byte {at}" and what.startswith("no record begins here: ")
    assert at + int(what.split()[-2]) < behind  # its message indexes are found


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "the file is empty"),
        (b"\x89MCAP", "the file has no end: what came here, if anything, is lost"),
        (b"\x89MCAP0\r\n", "the file has no end: what came here, if anything, is lost"),
        (b"\xff\xd8\xff\xe0" + bytes(100_000), "the file does not begin as one of MCAP does"),
    ],
)
def test_files_that_are_none(tmp_path, content, what):
    told, bag = read(tmp_path / "x.mcap", content)
    assert told == [] and bag.connections == []
    assert what in [lost.what for lost in bag.unread]


def test_messages_that_no_channel_and_no_time_can_have(tmp_path):
    """A channel that is declared nowhere, a time after the year 2262, and a record that is too short for a message."""
    messages = some(30, topics=["/a"])
    path = write_mcap(tmp_path / "x.mcap", messages, "", 10**6, enable_crcs=False)
    content = bytearray(path.read_bytes())
    at = [content.index(one.data) - 22 for one in messages[:3]]
    content[at[0] : at[0] + 2] = b"\7\0"
    content[at[1] + 13] = 0xFF
    told, bag = read(path, content)
    assert told == messages[2:]
    assert [lost.what for lost in bag.unread] == [
        "1 messages are of channels that are declared nowhere",
        "1 messages have log times that int64 cannot hold",
    ]
