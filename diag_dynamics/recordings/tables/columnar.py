# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parquet and npz as columns of pyarrow."""

import tokenize
import zipfile
import zlib
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.bag_messages import describe_error
from diag_dynamics.recordings.tables.cells import SAMPLE, make_column, unify
from diag_dynamics.recordings.tables.headers import Column
from diag_dynamics.recordings.tables.table import ROWS

HEAD = 100  # first rows that show what columns hold
_UNREADABLE = pa.ArrowException, OSError, UnicodeDecodeError
_BROKEN = zipfile.BadZipFile, zlib.error, ValueError, EOFError, OSError, MemoryError
_BROKEN += (RuntimeError, SyntaxError, tokenize.TokenError)
"""Errors of damaged and encrypted archives, and of NumPy's header of an array."""
_OWN = b"pandas", b"ARROW:schema", b"PARQUET:field_id", b"unit"
"""Keys of metadata that have no order of joints."""
_NOT_WHOLE = "A file that was not closed or not copied completely lacks the index at its end."


class ParquetTable:
    """Rows of a Parquet file by row group; fields of structs have names with dots."""

    unit = "row"

    def __init__(self, path):
        self.path = path
        with self._open() as file:
            fields = list(_flatten(file.schema_arrow.empty_table()).schema)
            self.columns = [_sample_column(file, field) for field in fields]
            metadata = [file.schema_arrow.metadata, *(field.metadata for field in fields)]
        self.texts = [
            f"metadata '{key.decode(errors='replace')}': {text.decode(errors='replace')}"
            for entries in metadata
            for key, text in (entries or {}).items()
            if key not in _OWN
        ]

    def blocks(self, numbers, texts, lose):
        """Yield arrays by column, and the number of each row."""
        used = {k: self.columns[k].name for k in (*numbers, *texts)}
        row = 0
        names = [column.name for column in self.columns]
        for name in used.values():
            if names.count(name) > 1:
                raise InputError(f"'{self.path}' has two columns '{name}'; expected one.")
        with self._open() as file:
            for group in range(file.num_row_groups):
                end = row + file.metadata.row_group(group).num_rows
                try:
                    for table in _read_tables(file, group, ROWS, list(used.values())):
                        arrays = {
                            k: table.column(name).combine_chunks() for k, name in used.items()
                        }
                        yield arrays, np.arange(row, row + len(table))
                        row += len(table)
                except _UNREADABLE as error:
                    place = f"row {row}, row group {group}"
                    why = describe_error(error)
                    lose("row group cannot be read", place, "rows lost", end - row, why)
                row = end

    def _open(self):
        try:
            return parquet.ParquetFile(self.path, pre_buffer=False, buffer_size=1 << 20)
        except _UNREADABLE as error:
            raise InputError(
                f"'{self.path}' cannot be read: {describe_error(error)}. {_NOT_WHOLE}"
            ) from error


def _sample_column(file, field):
    """Return the Column of a field with its first values in groups that are readable."""
    array = pa.nulls(0, field.type)
    for group in range(file.num_row_groups):
        with suppress(*_UNREADABLE):
            for table in _read_tables(file, group, ROWS, [field.name]):
                array = unify(table.column(0).combine_chunks()).drop_null()
                if len(array):
                    break
        if len(array):
            break
    unit = (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
    return make_column(field.name, array.slice(0, HEAD), unit)


def _read_tables(file, group, rows, names):
    """Yield so many rows of a row group at a time."""
    for batch in file.iter_batches(rows, row_groups=[group], columns=names, use_threads=False):
        yield _flatten(pa.Table.from_batches([batch]))


def _flatten(table):
    """Return a table with the fields of structs as columns; ArrowException for damaged values."""
    while any(map(pa.types.is_struct, table.schema.types)):
        table = table.flatten()
    table.validate(full=True)
    return table


@dataclass
class MemoryTable:
    """Rows of arrays in memory, a Table; their numbers are `rows`, or begin at 0."""

    path: str
    columns: list
    arrays: list
    texts: tuple = ()
    rows: np.ndarray | None = None
    unit = "row"

    def blocks(self, numbers, texts, _lose):
        """Yield arrays by column, and the number of each row."""
        used = [*texts[:1], *numbers, *texts[1:]]
        count = len(self.arrays[used[0]])
        first = self.columns[used[0]].name
        for k in used:
            if (length := len(self.arrays[k])) != count:
                raise InputError(
                    f"'{self.path}': '{self.columns[k].name}' has {length} rows; expected {count}, "
                    f"as '{first}' has."
                )
        rows = np.arange(count) if self.rows is None else self.rows
        for begin in range(0, count, ROWS):
            arrays = {k: self.arrays[k].slice(begin, ROWS) for k in used}
            yield arrays, rows[begin : begin + ROWS]


def read_npz(path):
    """Return the Table of the arrays (n,) or (n, k) of an npz; None stands for others."""
    arrays = _read_arrays(path)
    texts = []
    columns = []
    converted = []
    if not arrays:
        raise InputError(f"'{path}' is a zip archive without NumPy arrays.")
    lengths = {len(array) for array in arrays.values() if _is_numeric(array)}
    for name, array in arrays.items():
        kind = array.dtype.kind
        if kind == "U" and not (array.ndim == 1 and len(array) in lengths):
            texts.append(f"array '{name}': {array.ravel()[:20].tolist()}")
        elif _is_numeric(array) or (kind == "U" and array.ndim == 1):
            converted.append(_convert(array))
            columns.append(make_column(name, unify(converted[-1].slice(0, SAMPLE))))
        else:
            converted.append(None)
            content = f"{' × '.join(map(str, array.shape))} {array.dtype.name}"
            content = "Python objects" if kind == "O" else content
            columns.append(Column(name, numeric=False, type=content, sample=(content,)))
    return MemoryTable(path, columns, converted, texts)


def _read_arrays(path):
    """Return arrays by name, bytes as texts."""
    try:
        with np.load(path) as file:
            contents = {name: _read_array(file, name) for name in file.files}
    except _BROKEN as error:
        text = f"'{path}' cannot be read: {describe_error(error)}. {_NOT_WHOLE}"
        raise InputError(text) from error
    arrays = {name: x for name, x in contents.items() if isinstance(x, np.ndarray)}
    return {name: x.astype(str) if x.dtype.kind == "S" else x for name, x in arrays.items()}


def _read_array(file, name):
    """Return an array of an archive; an empty one for Python objects, which are not read."""
    try:
        return file[name]
    except ValueError as error:
        if "allow_pickle" not in str(error):
            raise
        return np.empty(0, object)


def _is_numeric(array):
    return array.dtype.kind in "iufMm" and array.ndim in (1, 2)


def _convert(array):
    """Return an array (n,) or (n, k) as an array or as lists of pyarrow."""
    kind = array.dtype.kind
    native = {"M": "M8[ns]", "m": "m8[ns]", "f": float}.get(kind, array.dtype.newbyteorder("="))
    array = array.astype(native, copy=False)
    if array.ndim == 1:
        return pa.array(array, from_pandas=False)
    return pa.FixedSizeListArray.from_arrays(
        pa.array(np.ascontiguousarray(array).reshape(-1)), array.shape[1]
    )
