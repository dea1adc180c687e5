# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of messages, opened by what they begin with, and by their names where that says nothing."""

import shutil
import tempfile
from pathlib import Path

from diag_dynamics.bags.compression import ZSTD, extra
from diag_dynamics.bags.mcap_reader import MAGIC, McapFile
from diag_dynamics.bags.ros1_reader import Ros1Bag
from diag_dynamics.bags.sqlite_reader import SqliteFile
from diag_dynamics.exceptions import InputError

_BEGINNINGS = {MAGIC: McapFile, b"SQLite format 3\0": SqliteFile, b"#ROSBAG V": Ros1Bag}
_ENDINGS = {".mcap": McapFile, ".db3": SqliteFile, ".bag": Ros1Bag}
_UNCLOSED, _PACKED = (
    ".active",
    ".zstd",
)  # what rosbag of ROS 1 adds while it records, and rosbag2 to what it has compressed

KNOWN = "folders of rosbag2, .mcap and .db3, each of them compressed by zstd or not, and .bag of ROS 1"
"""What can be read, in words."""


def is_named_as_bag(name):
    """Whether a file has the name of one that can be read."""
    return any(name.removesuffix(_PACKED).removesuffix(_UNCLOSED).endswith(ending) for ending in _ENDINGS)


def begins_as_bag(path):
    """Return whether the first bytes of a file are those of a bag; False where it cannot be read."""
    try:
        with open(path, "rb") as file:
            begin = file.read(16)
    except OSError:
        return False
    return any(begin.startswith(sign) for sign in _BEGINNINGS)


def open_file(path, name=None):
    """Open a file of messages, which is called `name` where it is another one's content.

    Raises
    ------
    InputError
        There is none, it is of a kind that is not known, or a package that it needs is not installed.
    """
    path, name = Path(path), str(path) if name is None else name
    try:
        with open(path, "rb") as file:
            begin = file.read(16)
    except OSError as error:
        raise InputError(f"'{name}' cannot be read: {error.strerror}.") from error
    if begin.startswith(ZSTD):
        return _unpacked(path)
    for sign, reader in _BEGINNINGS.items():
        if begin.startswith(sign):
            return reader(path, name)
    for ending, reader in _ENDINGS.items():
        if path.name.removesuffix(_UNCLOSED).endswith(ending):
            return reader(path, name)
    raise InputError(f"'{name}' is no bag that is known; there are {KNOWN}.")


def _unpacked(path):
    """Open what a compressed file holds, as a file of its own, which is there as long as its reader."""
    zstandard = extra("zstandard")
    folder, problem = tempfile.TemporaryDirectory(prefix="diag_dynamics-"), None
    content = Path(folder.name) / path.name.removesuffix(_PACKED)
    try:
        with open(path, "rb") as file, open(content, "wb") as out:
            reader = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)
            try:
                shutil.copyfileobj(reader, out, 1 << 17)
            except zstandard.ZstdError as error:
                problem = error
    except OSError as error:
        raise InputError(f"'{path}' cannot be decompressed: {error.strerror}.") from error
    bag = open_file(content, str(path))
    bag.keep(folder)
    if problem:
        bag.lose("its compression", f"zstd says: {problem}; only what came before can be read")
    return bag
