# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The reader of a table by its path and first bytes."""

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables import is_dataset, split_paths
from diag_dynamics.recordings.tables.columnar import ParquetTable, read_npz
from diag_dynamics.recordings.tables.csv import CsvTable
from diag_dynamics.recordings.tables.joined import JoinedTable
from diag_dynamics.recordings.tables.lerobot import read_episode

_READERS = {b"PAR1": ParquetTable, b"PK\x03\x04": read_npz, b"PK\x05\x06": read_npz}


def open_reader(path, columns):
    """Return the Table of a path, with the header and the lines of text that a ColumnMap states."""
    if is_dataset(path):
        return read_episode(path)
    readers = [_open_file(part, columns) for part in split_paths(path)]
    return readers[0] if len(readers) == 1 else JoinedTable(path, readers, columns.rate)


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
        raise InputError(
            f"'{path}' is a single array without names. Write an npz with arrays of these names: "
            "time, position."
        )
    reader = _READERS.get(begin[:4])
    return reader(path) if reader else CsvTable(path, columns)
