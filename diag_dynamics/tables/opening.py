# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of any kind, by what is in them."""

import os
import zipfile

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables.column_map import column_map
from diag_dynamics.tables.csv_reader import CsvReader
from diag_dynamics.tables.npz_reader import BROKEN, NpzReader
from diag_dynamics.tables.packed import packing
from diag_dynamics.tables.parquet_reader import ParquetReader

_REFUSED = {
    b"\x93NUMPY": "is a single array without names: write an npz, np.savez(path, time=…, position=…)",
    b"\x89HDF": "is an HDF5 file, which is not read: write CSV, Parquet or npz",
    b"ARROW1": "is an Arrow or Feather file, which is not read: write Parquet",
    b"MATLAB": "is a file of MATLAB's, which is not read: write CSV, Parquet or npz",
    b"\xd0\xcf\x11\xe0": "is a file of a spreadsheet, which is not read: save it as CSV",
    b"SQLite format 3": "is a bag or a database, no table",
    b"\x89MCAP": "is a bag, no table",
    b"#ROSBAG": "is a bag, no table",
}
"""What is wrong with files that begin so."""


def open_table(path, columns=None, joints=()):
    """Open a table of joints' states: CSV and the like, packed by gzip, bz2, xz, zstd or lz4 or not; Parquet; or npz.

    Parameters
    ----------
    path : str or Path
        The kind follows from the first bytes, whatever the name.
    columns : str, Path, dict or None
        The map of columns, see :func:`~diag_dynamics.tables.column_map.column_map`; None: by the rules for their names,
        :data:`~diag_dynamics.tables.headers.RULES`.
    joints : iterable of str
        Names of the model's joints that move, in their order; empty: not known.

    Returns
    -------
    CsvReader, ParquetReader or NpzReader
        `joints` and `notes` are there at once, `pieces()` yields :class:`~diag_dynamics.tables.columns.Columns`, `unread` is
        complete when they have been read.

    Raises
    ------
    InputError
        The file cannot be read at all, or it is not sure what its columns are.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"path is {path!r}, expected the path of a table.")
    path = os.path.expanduser(os.fspath(path))
    if os.path.isdir(path):
        raise InputError(f"'{path}' is a folder, expected a file.")
    if isinstance(joints, str):
        raise InputError(f"joints is '{joints}', expected a list of names.")
    wanted, joints = column_map(columns), tuple(joints)
    if packing(path) is None:
        with open(path, "rb") as file:
            begin = file.read(16)
        if begin.startswith(b"PAR1"):
            return ParquetReader(path, wanted, joints)
        if begin.startswith(b"PK\x03\x04") or begin.startswith(b"PK\x05\x06"):
            return _zipped(path, wanted, joints)
        for magic, what in _REFUSED.items():
            if begin.startswith(magic):
                raise InputError(f"'{path}' {what}.")
    return CsvReader(path, wanted, joints)


def _zipped(path, wanted, joints):
    """An npz; any other archive is refused."""
    try:
        with zipfile.ZipFile(path) as file:
            names = file.namelist()
    except BROKEN:
        names = []  # the reader says what is wrong
    if names and not any(name.endswith(".npy") for name in names):
        raise InputError(
            f"'{path}' is a zip archive without numpy's arrays (it has {', '.join(names[:5])}): unpack it."
        )
    return NpzReader(path, wanted, joints)
