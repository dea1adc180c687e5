# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parquet and npz as columns of pyarrow."""

import tokenize
import zipfile
import zlib
from contextlib import suppress
from itertools import islice

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.messages import describe_error
from diag_dynamics.recordings.tables.cells import SAMPLE, is_list, make_column, unify
from diag_dynamics.recordings.tables.choice import choose
from diag_dynamics.recordings.tables.headers import Column
from diag_dynamics.recordings.tables.names_in_data import NAMES, label_text, metadata_texts
from diag_dynamics.recordings.tables.table import ROWS

_UNREADABLE = (pa.ArrowException, OSError, UnicodeDecodeError)
_BROKEN = (
    *(
        zipfile.BadZipFile,
        zlib.error,
        ValueError,
        EOFError,
        OSError,
        NotImplementedError,
        MemoryError,
    ),
    *(
        RuntimeError,
        SyntaxError,
        tokenize.TokenError,
    ),  # of what is encrypted, and of numpy's header of an array
)
_NOT_WHOLE = "A file that was not closed or not copied completely lacks the index at its end."


class ParquetSource:
    """Rows of a Parquet file by row group; damaged ones are omitted. Fields of structs have names with dots."""

    notes, unit = (), "row"

    def __init__(self, path, wanted, joints, choose=choose):
        self.path = path
        with self._open() as file:
            empty = _flatten(file.schema_arrow.empty_table())
            columns = [
                _sample_column(file, field, empty.column(k)) for k, field in enumerate(empty.schema)
            ]
            metadata = [file.schema_arrow.metadata, *(field.metadata for field in empty.schema)]
        self.headers = [one.name for one in columns]
        self.choice = choose(
            columns,
            wanted,
            joints,
            path,
            [text for one in metadata for text in metadata_texts(one)],
        )
        for name in (self.headers[k] for k in self.choice.used):
            if self.headers.count(name) > 1:
                raise InputError(f"'{path}' has two columns '{name}'.")

    def blocks(self, lose):
        """Yield arrays by index of the column, and the number of each row."""
        used, row = {k: self.headers[k] for k in self.choice.used}, 0
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
                    lose(
                        "row group cannot be read",
                        place,
                        "rows lost",
                        end - row,
                        describe_error(error),
                    )
                row = end

    def _open(self):
        try:
            return parquet.ParquetFile(self.path, pre_buffer=False, buffer_size=1 << 20)
        except _UNREADABLE as error:
            raise InputError(
                f"'{self.path}' cannot be read: {describe_error(error)}. {_NOT_WHOLE}"
            ) from error


def _sample_column(file, field, empty):
    """Return the Column of a field, with its first rows that have a value if it has texts or lists."""
    unit = (field.metadata or {}).get(b"unit", b"").decode(errors="replace")
    array = unify(empty.combine_chunks())
    groups = (
        range(min(file.num_row_groups, 64))
        if pa.types.is_string(array.type) or is_list(array.type)
        else ()
    )
    for group in groups:
        with suppress(*_UNREADABLE, KeyError):
            for table in islice(_read_tables(file, group, 16, [field.name]), 64):
                array = unify(table.column(field.name).combine_chunks())
                if any(array.to_pylist()):
                    return make_column(field.name, array, unit)
    return make_column(field.name, array, unit)


def _read_tables(file, group, rows, names):
    """Yield so many rows of a row group at a time."""
    for batch in file.iter_batches(rows, row_groups=[group], columns=names, use_threads=False):
        yield _flatten(pa.Table.from_batches([batch]))


def _flatten(table):
    """Return a table with the fields of structs as columns; raise ArrowException for damaged values."""
    while any(map(pa.types.is_struct, table.schema.types)):
        table = table.flatten()
    table.validate(full=True)
    return table


class NpzSource:
    """Rows of the arrays of an npz, (n,) or (n, k); one that is (k, n) is transposed."""

    unit = "row"

    def __init__(self, path, wanted, joints, choose=choose):
        self.path = path
        arrays = _read_arrays(path)
        if not arrays:
            raise InputError(f"'{path}' is a zip archive without NumPy arrays.")
        turned = _turn(arrays)
        lengths = {len(one) for one in arrays.values() if _is_numeric(one)}
        texts = _pop_texts(arrays, lengths, joints)
        self.headers = list(arrays)
        columns = [_make_array_column(name, array, lengths) for name, array in arrays.items()]
        self.choice = choose(columns, wanted, joints, path, texts)
        self._arrays = {k: arrays[self.headers[k]] for k in self.choice.used}
        used = [self.headers[k] for k in self.choice.used]
        first, of = (
            (used[0], "rows of")
            if not self.choice.time
            else (self.headers[self.choice.time[0]], "times in")
        )
        self.notes = [
            f"{name}: transposed, because it has a row for each joint."
            for name in turned
            if name in used
        ]
        for name in used:
            if len(arrays[name]) != len(arrays[first]):
                what = f"expected a row for each of the {len(arrays[first])} {of} '{first}'"
                raise InputError(
                    f"'{path}': array '{name}' has shape {arrays[name].shape}, {what}."
                )

    def blocks(self, lose):
        """Yield arrays by index of the array, and the number of each row; the arrays that are used are in memory."""
        count = len(self._arrays[self.choice.used[0]])
        for begin in range(0, count, ROWS):
            arrays = {k: _convert(array[begin : begin + ROWS]) for k, array in self._arrays.items()}
            yield arrays, np.arange(begin, min(begin + ROWS, count))


def _read_arrays(path):
    """Return arrays by name, bytes as texts, without arrays of Python objects that cannot be names."""
    arrays, name = {}, ""
    try:
        with np.load(path) as file:
            for name in file.files:
                try:
                    array = file[name]
                except ValueError as error:
                    if "allow_pickle" in str(error) and _last(name).lower() not in NAMES:
                        continue
                    raise
                if isinstance(array, np.ndarray):
                    arrays[name] = array.astype(str) if array.dtype.kind == "S" else array
    except _BROKEN as error:
        why, where = describe_error(error), f"'{path}': array '{name}'" if name else f"'{path}'"
        advice = (
            " Save names as np.array(names, dtype=str)."
            if "allow_pickle" in why
            else ""
            if name
            else f" {_NOT_WHOLE}"
        )
        raise InputError(f"{where} cannot be read: {why}.{advice}") from error
    return arrays


def _is_numeric(array):
    return array.dtype.kind in "iufMm" and array.ndim in (1, 2)


def _turn(arrays):
    """Give all arrays of numbers a row for each time, (n,) or (n, k); return the names of those that were (k, n)."""
    shapes, turned = [array.shape for array in arrays.values() if _is_numeric(array)], []
    lengths = {shape[0] for shape in shapes if len(shape) == 1}
    if 1 not in lengths:  # in a recording of one row, (1, k) are k joints
        lengths |= {max(shape) for shape in shapes if len(shape) == 2 and 1 in shape}
    for name, array in arrays.items():
        if _is_numeric(array) and array.ndim == 2:
            first, second = array.shape
            if second in lengths and (first not in lengths or first < second):
                array, turned = array.T, [*turned, name] if first > 1 else turned
            arrays[name] = array.reshape(-1) if array.shape[1] == 1 else array
    return turned


def _pop_texts(arrays, lengths, known):
    """Remove the arrays of text that have no row for each time; return those that may state names of joints."""
    found = []
    for name, array in list(arrays.items()):
        value = array.tolist() if array.dtype.kind == "U" and array.ndim < 2 else None
        once = (
            isinstance(value, list) and len(set(value)) == len(value) and set(value) <= set(known)
        )
        if isinstance(value, str) or once or (value and len(value) not in lengths):
            found += label_text(f"array '{name}'", _last(name), value)
            del arrays[name]
    return found


def _make_array_column(name, array, lengths):
    """Return the Column of an array."""
    of_rows = array.ndim == 1 or (array.ndim == 2 and len(array) in lengths)
    if _is_numeric(array) or (array.dtype.kind == "U" and of_rows):
        return make_column(name, unify(_convert(array[:SAMPLE])))
    return Column(name, numeric=False, type=array.dtype.name)


def _last(name):
    return name.replace("/", ".").split(".")[-1]


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
