# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of joint states: CSV and the like, Parquet, and npz."""

import os
import re
from importlib import import_module

from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require

_SOURCES = {b"PAR1": ("arrays", "ParquetSource")} | dict.fromkeys(
    (b"PK\x03\x04", b"PK\x05\x06"), ("arrays", "NpzSource")
)


def open_table(path, columns, joints):
    """Return the :class:`Table` of a file, an episode of LeRobot, or several files ``a+b``.

    `joints` are the model's, empty if unknown.
    """
    require("pyarrow", f"'{path}'")
    paths = split_paths(path)
    if is_dataset(path):
        source = import_module(f"{__name__}.lerobot").LeRobotSource(path, columns, joints)
    elif len(paths) == 1:
        source = _open_source(path, columns, joints)
    else:
        joined = import_module(f"{__name__}.joined")
        parts = [_open_source(one, columns, joints, joined.take_all) for one in paths]
        source = joined.JoinedSource(path, parts, columns, joints)
    return import_module(f"{__name__}.table").Table(source)


def is_dataset(path):
    """Return whether a path is a dataset of LeRobot, or an episode ``FOLDER#3`` of one."""
    return os.path.isfile(os.path.join(re.sub(r"#\d+$", "", path), "meta", "info.json"))


def split_paths(path):
    """Return the paths of ``a.csv+b.csv``, tables side by side; a file of that name is one path."""
    path = os.path.expanduser(path)
    return [path] if os.path.exists(path) else list(map(os.path.expanduser, path.split("+")))


def _open_source(path, columns, joints, *choose):
    """Return the source of a file by its first bytes; `choose` is another choice of columns than by the map."""
    try:
        with open(path, "rb") as file:
            begin = file.read(8)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}.") from error
    if not begin:
        raise InputError(f"'{path}' is empty: it has 0 bytes.")
    if begin.startswith(b"\x93NUMPY"):
        raise InputError(
            f"'{path}' is a single array without names: write an npz, np.savez(path, time=…, position=…)."
        )
    module, name = _SOURCES.get(begin[:4], ("csv", "CsvSource"))
    return getattr(import_module(f"{__name__}.{module}"), name)(path, columns, joints, *choose)
