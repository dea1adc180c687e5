# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of any kind, opened by their first bytes, and the columns that they yield."""

import os
from importlib import import_module
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.column_map import column_map

_READERS = {b"PAR1": "ParquetSource", b"PK\x03\x04": "NpzSource", b"PK\x05\x06": "NpzSource"}
_REJECTED = {
    b"\x93NUMPY": "is a single array without names: write an npz, np.savez(path, time=…, position=…)",
    b"\x89HDF": "is an HDF5 file, which is not read: write CSV, Parquet or npz",
    b"ARROW1": "is an Arrow or Feather file, which is not read: write Parquet",
    b"MATLAB": "is a file of MATLAB's, which is not read: write CSV, Parquet or npz",
    b"\xd0\xcf\x11\xe0": "is a file of a spreadsheet, which is not read: save it as CSV",
    b"SQLite format 3": "is a bag or a database, no table",
    b"\x89MCAP": "is a bag, no table",
    b"#ROSBAG": "is a bag, no table",
    b"\xff\xfe": "is text in UTF-16: save it in UTF-8",
    b"\xfe\xff": "is text in UTF-16: save it in UTF-8",
}
"""What is wrong with files that begin so."""


class Columns(NamedTuple):
    """Rows as they stand in the file; a value that is missing or cannot be read as a number is NaN.

    Every row has a time. Rows without one, and rows that are none, are left out and counted in the reader's `unread`.
    """

    time: np.ndarray
    """[s], float64, shape (n,); as in the file."""
    stamp: np.ndarray
    """[ns], int64, likewise: exact where the file is, which a double is not (it holds 1.7e9 s to 2.4e-7 s). Cut at ±2⁶², so
    that differences of two do not overflow."""
    position: np.ndarray
    """[rad, m], float64, shape (n, k): a column for each of the joints."""
    velocity: np.ndarray | None
    """[rad/s, m/s], likewise; None where the file has none."""
    effort: np.ndarray | None
    """[N m, N], likewise."""
    rows: np.ndarray
    """Row of the file that each is, from 0 after the header: int64, shape (n,). Rows that are left out count, empty lines and
    comments do not."""
    names: np.ndarray | None = None
    """Joint of each value, str, shape (n, k), where rows name their joints; empty where a row has fewer. None: every row has
    the reader's `joints`."""


def open_table(path, columns=None, joints=()):
    """Open a table of joint states: CSV and the like, packed or not; Parquet; or npz.

    Parameters
    ----------
    path : str or Path
        The kind follows from the first bytes, whatever the name.
    columns : str, Path, dict, ColumnMap or None
        The map of columns; None: all follows from their names.
    joints : iterable of str
        Names of the model's joints that move, in their order; empty: unknown.

    Returns
    -------
    Table
        `joints` and `notes` are there at once, `pieces()` yields :class:`Columns`, `unread` and `without_values` are
        complete when all pieces have been read.

    Raises
    ------
    InputError
        The file cannot be read at all, its columns are ambiguous, or pyarrow is not installed.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"path is {path!r}, expected the path of a table.")
    if isinstance(joints, str):
        raise InputError(f"joints is '{joints}', expected a list of names.")
    path, wanted = os.path.expanduser(os.fspath(path)), column_map(columns)
    try:
        with open(path, "rb") as file:
            begin = file.read(16)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error
    if not begin:
        raise InputError(f"'{path}' is empty: it has 0 bytes.")
    for magic, what in _REJECTED.items():
        if begin.startswith(magic):
            raise InputError(f"'{path}' {what}.")
    reader = next((name for magic, name in _READERS.items() if begin.startswith(magic)), "CsvSource")
    try:
        import_module("pyarrow")
    except ImportError as error:
        need = "pyarrow is not installed: pip install diag_dynamics[recordings]"
        raise InputError(f"'{path}' is a table, and {need}.") from error
    package = __name__.rpartition(".")[0]
    readers = import_module(f"{package}.{'csv' if reader == 'CsvSource' else 'arrays'}")
    source = getattr(readers, reader)(path, wanted, tuple(joints))
    return import_module(f"{package}.table").Table(source)
