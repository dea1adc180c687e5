# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of joint states: CSV and the like, Parquet, and npz."""

import os
import re
from importlib import import_module

from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require

_READERS = {b"PAR1": "ParquetTable", b"PK\x03\x04": "NpzTable", b"PK\x05\x06": "NpzTable"}


def open_table(path, columns, joints):
    """Return the JointTable of a file, an episode of LeRobot, or several files ``a+b``."""
    table, choice = import_module(f"{__name__}.table"), import_module(f"{__name__}.choice")
    reader = open_reader(path, columns)
    return table.JointTable(reader, choice.choose(reader, columns, joints))


def open_reader(path, columns):
    """Return the Table of a path, with the header and the lines of text that a ColumnMap states."""
    require("pyarrow", f"'{path}'")
    if is_dataset(path):
        return import_module(f"{__name__}.lerobot").LeRobotTable(path)
    readers = [_open_file(part, columns) for part in split_paths(path)]
    if len(readers) == 1:
        return readers[0]
    return import_module(f"{__name__}.joined").JoinedTable(path, readers, columns.rate)


def is_dataset(path):
    """Return whether a path is a dataset of LeRobot, or an episode ``FOLDER#3`` of one."""
    return os.path.isfile(os.path.join(re.sub(r"#\d+$", "", path), "meta", "info.json"))


def split_paths(path):
    """Return the paths of ``a.csv+b.csv``, tables side by side; a file of that name is one path."""
    path = os.path.expanduser(path)
    return [path] if os.path.exists(path) else list(map(os.path.expanduser, path.split("+")))


def _open_file(path, columns):
    """Return the Table of a file by its first bytes."""
    try:
        with open(path, "rb") as file:
            begin = file.read(8)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error
    if not begin:
        raise InputError(f"'{path}' is empty: it has 0 bytes.")
    if begin.startswith(b"\x93NUMPY"):
        advice = "Write an npz with arrays of these names: time, position"
        raise InputError(f"'{path}' is a single array without names. {advice}.")
    if name := _READERS.get(begin[:4]):
        return getattr(import_module(f"{__name__}.arrays"), name)(path)
    return import_module(f"{__name__}.csv").CsvTable(path, columns)
