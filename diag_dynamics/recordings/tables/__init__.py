# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of joint states: CSV and the like, Parquet, and npz."""

from importlib import import_module

from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require

_SOURCES = {b"PAR1": ("arrays", "ParquetSource")} | dict.fromkeys(
    (b"PK\x03\x04", b"PK\x05\x06"), ("arrays", "NpzSource")
)


def open_table(path, columns, joints):
    """Return the :class:`Table` of a file, by its first bytes; `joints` are the model's, empty if unknown."""
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
    module, name = _SOURCES.get(begin[:4], ("csv", "CsvSource"))
    source = getattr(import_module(f"{__name__}.{module}"), name)(path, columns, joints)
    return import_module(f"{__name__}.table").Table(source)
