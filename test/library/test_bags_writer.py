# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of MCAP that are written by columns are read by mcap and rosbags, message for message, and by time."""

import os
import stat
import struct
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, SeekingReader
from rosbags.rosbag2 import Reader

from bags import JOINT_STATE, TEXT, Told, ordered, told_by
from diag_dynamics.bags.mcap_reader import McapFile
from diag_dynamics.bags.mcap_writer import McapWriter
from diag_dynamics.exceptions import InputError

OTHER = "float64 x\n"


def piece(rng, topic, count, size, spread):
    """Rows and times of a topic, and the same as messages."""
    rows = rng.integers(0, 256, (count, size), dtype=np.uint8)
    log_time = 10**9 + rng.integers(0, spread, count)
    return rows, log_time, [Told(topic, int(t), row.tobytes()) for t, row in zip(log_time, rows, strict=True)]


def write(path, calls, **options):
    """Write calls of pieces, which are by topic; returns the messages as they are to stand in the file."""
    written, channels = [], {}
    with McapWriter(path, **options) as writer:
        for k, topic in enumerate(("/a", "/b", "/c")):
            channels[topic] = writer.channel(topic, JOINT_STATE if k < 2 else "x/msg/Y", TEXT if k < 2 else OTHER)
        for call in calls:
            writer.write([(channels[topic], rows, log_time) for topic, (rows, log_time, _) in call.items()])
            written += ordered([one for _, _, told in call.values() for one in told])
    return written


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32),
    sizes=st.lists(st.dictionaries(st.sampled_from(["/a", "/b", "/c"]), st.integers(0, 60)), max_size=4),
    spread=st.sampled_from([1, 50, 10**9]),
    compression=st.sampled_from(["zstd", "lz4", ""]),
    chunk_size=st.sampled_from([1, 300, 4000, 1 << 20]),
)
def test_others_read_the_same(tmp_path, seed, sizes, spread, compression, chunk_size):
    rng, path = np.random.default_rng(seed), tmp_path / "x.mcap"
    calls = [
        {topic: piece(rng, topic, count, int(rng.integers(0, 70)), spread) for topic, count in call.items()}
        for call in sizes
    ]
    messages = write(path, calls, compression=compression, chunk_size=chunk_size)
    assert told_by(McapFile(path)) == ordered(messages)
    assert (McapFile(path).unread, McapFile(path).findings) == ([], [])
    with open(path, "rb") as file:
        in_file = NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False)
        assert [Told(c.topic, m.log_time, m.data) for _, c, m in in_file] == messages
    by_time = sorted(ordered(messages))
    with open(path, "rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        assert sorted(Told(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()) == by_time
        begin, end = 10**9 + spread // 3, 10**9 + spread // 2
        chosen = [one for one in by_time if begin <= one.log_time < end and one.topic != "/b"]
        found = reader.iter_messages(topics=["/a", "/c"], starting_at=begin, ending_before=end)
        assert sorted(Told(c.topic, m.log_time, m.data) for _, c, m in found) == chosen
        summary = reader.get_summary()
    numbers = summary.statistics
    times = [one.log_time for one in messages]
    assert (numbers.message_count, numbers.schema_count, numbers.channel_count) == (len(messages), 2, 3)
    assert numbers.chunk_count == len(summary.chunk_indexes) > 0
    assert (numbers.message_start_time, numbers.message_end_time) == (min(times, default=0), max(times, default=0))
    assert {summary.channels[c].topic: n for c, n in numbers.channel_message_counts.items()} == {
        topic: n for topic in ("/a", "/b", "/c") if (n := sum(one.topic == topic for one in messages))
    }
    with Reader(path) as reader:
        assert sorted(Told(c.topic, t, data) for c, t, data in reader.messages()) == by_time
        assert {c.topic: (c.msgtype, c.msgdef.data, c.ext.serialization_format) for c in reader.connections} == {
            **dict.fromkeys(["/a", "/b"], (JOINT_STATE, TEXT, "cdr")),
            "/c": ("x/msg/Y", OTHER, "cdr"),
        }


def test_messages_are_numbered_and_published_when_logged(tmp_path):
    rng, path = np.random.default_rng(0), tmp_path / "x.mcap"
    write(
        path, [{"/a": piece(rng, "/a", 20, 9, 99)}, {"/b": piece(rng, "/b", 5, 9, 99), "/a": piece(rng, "/a", 3, 9, 1)}]
    )
    with open(path, "rb") as file:
        found = list(NonSeekingReader(file).iter_messages(log_time_order=False))
    for topic, count in (("/a", 23), ("/b", 5)):
        numbers = [m.sequence for _, c, m in found if c.topic == topic]
        assert sorted(numbers[:20]) == list(range(min(count, 20))) and sorted(numbers) == list(range(count))
    assert all(m.publish_time == m.log_time for _, _, m in found)


def test_chunks_are_as_large_as_they_are_to_be(tmp_path):
    path = tmp_path / "x.mcap"
    with McapWriter(path, chunk_size=10_000) as writer:
        channel = writer.channel("/a", JOINT_STATE, TEXT)
        for k in range(0, 1000, 7):  # calls that are much smaller than a chunk
            writer.write_rows(channel, np.zeros((7, 100), np.uint8), np.arange(k, k + 7))
        writer.write_rows(channel, np.zeros((1, 50_000), np.uint8), np.array([2000]))
    with open(path, "rb") as file:
        sizes = [chunk.uncompressed_size for chunk in SeekingReader(file).get_summary().chunk_indexes]
    assert all(10_000 <= size < 10_131 for size in sizes[:-1])
    assert 50_000 < sizes[-1] < 60_131


def test_the_crc_of_data_is_that_of_the_file_up_to_its_record(tmp_path):
    path = tmp_path / "x.mcap"
    write(path, [{"/a": piece(np.random.default_rng(0), "/a", 100, 9, 99)}])
    content = path.read_bytes()
    (begin,) = struct.unpack_from("<Q", content, len(content) - 28)
    kind, size, crc = struct.unpack_from("<BQI", content, begin - 13)
    assert (kind, size, crc) == (15, 4, zlib.crc32(content[: begin - 13]))


def test_profiles_of_publishers_are_kept(tmp_path):
    """As they are, for rosbag2; without them the entry is there and empty, which all its releases read."""
    profile = "- history: 1\n  depth: 10\n"
    with McapWriter(tmp_path / "x.mcap") as writer:
        writer.channel("/a", JOINT_STATE, TEXT, offered_qos_profiles=profile)
        writer.channel("/b", JOINT_STATE, TEXT)
    with open(tmp_path / "x.mcap", "rb") as file:
        channels = SeekingReader(file).get_summary().channels.values()
    assert {c.topic: c.metadata["offered_qos_profiles"] for c in channels} == {"/a": profile, "/b": ""}


def test_a_file_has_its_name_when_it_is_whole(tmp_path):
    path = tmp_path / "x.mcap"
    path.write_text("older")
    with McapWriter(path) as writer:
        writer.write_rows(writer.channel("/a", JOINT_STATE, TEXT), np.zeros((5, 3), np.uint8), np.arange(5))
        assert path.read_text() == "older" and os.listdir(tmp_path) != ["x.mcap"]
    assert os.listdir(tmp_path) == ["x.mcap"]
    assert len(told_by(McapFile(path))) == 5
    before = path.read_bytes()
    with pytest.raises(KeyError), McapWriter(path):
        raise KeyError
    assert os.listdir(tmp_path) == ["x.mcap"] and path.read_bytes() == before


def test_a_folder_or_a_disk_that_takes_nothing(tmp_path):
    with pytest.raises(InputError, match="cannot be written: there is no folder"):
        McapWriter(tmp_path / "none" / "x.mcap")
    with pytest.raises(InputError, match="compression is 'gzip', expected 'zstd', 'lz4' or ''"):
        McapWriter(tmp_path / "x.mcap", compression="gzip")
    assert os.listdir(tmp_path) == []
    if not os.path.exists("/dev/full") or not stat.S_ISCHR(os.stat("/dev/full").st_mode):
        pytest.skip("there is no /dev/full, which takes nothing")
    (tmp_path / "full.mcap").symlink_to("/dev/full")
    with (
        pytest.raises(InputError, match=r"full\.mcap' cannot be written: No space left on device"),
        McapWriter(tmp_path / "full.mcap", compression="") as writer,
    ):
        channel = writer.channel("/a", JOINT_STATE, TEXT)
        writer.write_rows(channel, np.zeros((10**5, 100), np.uint8), np.arange(10**5))
    assert os.listdir(tmp_path) == ["full.mcap"] and stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_columns_that_are_none(tmp_path):
    with McapWriter(tmp_path / "x.mcap") as writer:
        channel = writer.channel("/a", JOINT_STATE, TEXT)
        rows, times = np.zeros((5, 3), np.uint8), np.arange(5)
        for bad, what in [
            ((channel, rows.view(np.int8), times), r"messages of '/a' are int8 of shape \(5, 3\), not rows of uint8"),
            ((channel, rows[0], times), r"messages of '/a' are uint8 of shape \(3,\)"),
            ((channel, rows, times[1:]), r"log times of '/a' are int64 of shape \(4,\), not int64 of shape \(5,\)"),
            ((channel, rows, times * 1.0), "log times of '/a' are float64"),
            ((channel, rows, times - 2), "the log time of message 0 of '/a' is -2 ns"),
            ((channel + 1, rows, times), "has no channel 2"),
        ]:
            with pytest.raises(InputError, match=what):
                writer.write([(channel, rows, times), bad])
    assert told_by(McapFile(tmp_path / "x.mcap")) == []
