# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of joint states: CSV and the like, Parquet, and npz."""

import os
from importlib import import_module

from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require
from diag_dynamics.recordings.tables.column_map import column_map


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
        `joints` and `notes` are there at once, `pieces()` yields its rows, `unread` and `without_values` are
        complete when all pieces have been read.

    Raises
    ------
    InputError
        The file cannot be read at all, its columns are ambiguous, or pyarrow is not installed.
    """
    path, wanted = os.path.expanduser(os.fspath(path)), column_map(columns)
    try:
        with open(path, "rb") as file:
            begin = file.read(8)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error
    if not begin:
        raise InputError(f"'{path}' is empty: it has 0 bytes.")
    if begin.startswith(b"\x93NUMPY"):
        raise InputError(f"'{path}' is a single array without names: write an npz, np.savez(path, time=…, position=…).")
    require("pyarrow", f"'{path}'")
    module, kind = ("csv", "Csv")
    if begin.startswith((b"PAR1", b"PK\x03\x04", b"PK\x05\x06")):
        module, kind = "arrays", "Parquet" if begin.startswith(b"PAR1") else "Npz"
    source = getattr(import_module(f"{__name__}.{module}"), f"{kind}Source")(path, wanted, tuple(joints))
    return import_module(f"{__name__}.table").Table(source)
