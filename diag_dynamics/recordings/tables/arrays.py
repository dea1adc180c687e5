# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parquet and npz as columns of pyarrow."""

import tokenize
import zipfile
import zlib
from contextlib import suppress
from itertools import chain, islice
from math import prod
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.cells import SAMPLE, decoded, is_text, read_texts, sample_column
from diag_dynamics.recordings.tables.choice import choose
from diag_dynamics.recordings.tables.headers import Column
from diag_dynamics.recordings.tables.joint_names import NAMES, label_text, metadata_texts
from diag_dynamics.recordings.tables.table import ROWS, Block

_BROKEN = (
    *(zipfile.BadZipFile, zlib.error, ValueError, EOFError, OSError, NotImplementedError, MemoryError),
    *(RuntimeError, SyntaxError, tokenize.TokenError),  # of what is encrypted, and of numpy's header of an array
)
_UNREADABLE = (pa.ArrowException, OSError, UnicodeDecodeError)
_NOT_WHOLE = (
    "What stands at its end says where everything is, and is missing in a file that was not closed or not copied whole."
)


def _check_times(path, columns, choice, wanted):
    """Reject times in place of numbers, and a scale of times that have their unit; return the choice."""
    for k in sorted(choice.values):
        if columns[k].moments or columns[k].type.startswith("duration"):
            raise InputError(f"'{path}': column '{columns[k].name}' is of times, expected numbers.")
    time = columns[choice.time[0]]
    if time.type.startswith(("timestamp", "duration")):
        if "time" in wanted.scale:
            raise InputError(f"'{path}': there is a scale of time, but '{time.name}' says its unit itself.")
        return choice._replace(time_in_doubt=False)
    return choice


class ParquetSource:
    """Rows of a Parquet file: one row group after another, those that are damaged left out.

    Fields of structs have names with dots. The metadata of the schema may name the joints of all rows.
    """

    notes = ()

    def __init__(self, path, wanted, joints):
        self.path = path
        with self._open() as file:
            schema = _flatten(file.schema_arrow.empty_table()).schema
            columns = [self._column(file, field) for field in schema]
            every = [file.schema_arrow.metadata, *(field.metadata for field in schema)]
            texts = [text for metadata in every for text in metadata_texts(metadata)]
        self.headers = [one.name for one in columns]
        choice = choose(columns, wanted, joints, path, texts)
        for k in choice.used:
            if self.headers.count(self.headers[k]) > 1:
                raise InputError(f"'{path}' has two columns '{self.headers[k]}'.")
        self.choice = _check_times(path, columns, choice, wanted)

    def blocks(self, losses):
        """Yield each :class:`Block`."""
        used, row = {k: self.headers[k] for k in self.choice.used}, 0
        options = {"columns": list(used.values()), "use_threads": False}
        with self._open() as file:
            for group in range(file.num_row_groups):
                end = row + file.metadata.row_group(group).num_rows
                try:
                    for batch in file.iter_batches(ROWS, row_groups=[group], **options):
                        table = _flatten(pa.Table.from_batches([batch]))
                        arrays = {k: table.column(name).combine_chunks() for k, name in used.items()}
                        yield Block(arrays, np.arange(row, row + len(table)))
                        row += len(table)
                except _UNREADABLE as error:
                    why = " ".join(str(error).split())
                    losses.add("row group cannot be read", f"row {row}, row group {group}", "rows lost", end - row, why)
                row = end
        if not row:
            losses.add("there are no rows", "row 0")

    def _open(self):
        try:
            return parquet.ParquetFile(self.path, pre_buffer=False, buffer_size=1 << 20)
        except _UNREADABLE as error:
            why = " ".join(str(error).split())
            raise InputError(f"'{self.path}' is no Parquet file that can be read: {why} {_NOT_WHOLE}") from error

    def _column(self, file, field):
        """Content of a column by its type, and by its first rows if it has texts."""
        kind, types = field.type, pa.types
        listed = types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)
        inner = kind.value_type if listed or types.is_dictionary(kind) else kind
        tests = ("integer", "floating", "decimal", "null", "timestamp", "duration")
        unit = (field.metadata or {}).get(b"unit")
        column = Column(
            field.name,
            unit=unit and unit.decode(errors="replace"),
            numeric=any(getattr(types, f"is_{name}")(inner) for name in tests),
            moments=types.is_timestamp(kind),
            type=str(kind),
        )
        if is_text(inner):
            texts = []
            for array in self._first_rows(file, field.name):
                texts += read_texts(decoded(array))
                if any(texts):
                    break
            texts = texts[: max(SAMPLE, next((k for k, text in enumerate(texts) if text), 0) + 1)]
            if listed:
                return column._replace(sample=tuple(one or () for one in texts), listed=True)
            return sample_column(column, texts)
        if not (listed and column.numeric):
            return column
        lengths = (n for array in self._first_rows(file, field.name) for n in array.value_lengths().to_pylist() if n)
        width = kind.list_size if types.is_fixed_size_list(kind) else next(lengths, 0)
        return column._replace(width=width, numeric=width > 0)

    def _first_rows(self, file, name):
        """The first rows of a column, a few at a time: it may be one of pictures."""
        groups = (self._rows_of_group(file, name, group) for group in range(file.num_row_groups))
        return islice(chain.from_iterable(groups), 64)

    @staticmethod
    def _rows_of_group(file, name, group):
        """Rows of a column; those of a damaged row group up to the damage."""
        with suppress(*_UNREADABLE, KeyError):
            for batch in file.iter_batches(16, row_groups=[group], columns=[name], use_threads=False):
                yield _flatten(pa.Table.from_batches([batch])).column(name).combine_chunks()


def _flatten(table):
    """A table with the fields of structs as columns; an ArrowException where damage has left invalid values."""
    while any(map(pa.types.is_struct, table.schema.types)):
        table = table.flatten()
    table.validate(full=True)
    return table


class _Layout(NamedTuple):
    """Axes of an array."""

    rows: int
    width: int
    """Columns; 0 of an array that has one."""
    turned: bool
    """Whether it has a row for each joint and a column for each time."""


class NpzSource:
    """Rows of the arrays of an npz, (n,) or (n, k); one that is (k, n) is turned round.

    An array of texts with a row for each time names the joints of each row; one called joint_names or the like those of all.
    """

    def __init__(self, path, wanted, joints):
        self.path, self._broken = path, {}
        for value in (wanted.time, wanted.position, wanted.velocity, wanted.effort):
            if isinstance(value, list | tuple) and any(isinstance(one, int) for one in value):
                raise InputError(f"'{path}' is an npz: its arrays have names, expected no numbers of columns.")
        with self._open() as file:
            members = file.namelist()
            names = [name.removesuffix(".npy") for name in members if name.endswith(".npy")]
            if members and not names:
                what = f"is a zip archive without numpy's arrays (it has {', '.join(members[:5])})"
                raise InputError(f"'{path}' {what}: unpack it.")
            shapes = {name: shape for name in names if (shape := self._shape(file, name))}
            texts = {name: self._array(file, name) for name, (_, kind) in shapes.items() if kind.kind in "US"}
            while True:  # without arrays that turn out to be damaged
                shapes = {name: shape for name, shape in shapes.items() if name not in self._broken}
                self._choose(shapes, texts, wanted, joints)
                arrays = {k: self._array(file, self.headers[k]) for k in self.choice.used}
                if all(array is not None for array in arrays.values()):
                    break
        self._arrays, self.notes, time = {}, [], self.headers[self.choice.time[0]]
        for k, array in arrays.items():
            name = self.headers[k]
            layout, count = self._layouts[name], self._layouts[time].rows
            if layout.rows != count:
                what = f"has shape {array.shape}, expected a row for each of the {count} times in '{time}'"
                raise InputError(f"'{path}': array '{name}' {what}.")
            if layout.turned and layout.width:
                self.notes.append(f"{name}: turned round, it has a row for each joint.")
            self._arrays[k] = (array.T if layout.turned else array) if layout.width else array.reshape(-1)

    def blocks(self, losses):
        """Yield each :class:`Block`; the arrays that are used are in memory."""
        for name, why in self._broken.items():
            losses.add(f"array '{name}' cannot be read: {why}: all its numbers are lost", f"array {name}")
        count = len(self._arrays[self.choice.time[0]])
        for begin in range(0, count, ROWS):
            arrays = {k: _in_arrow(array[begin : begin + ROWS]) for k, array in self._arrays.items()}
            yield Block(arrays, np.arange(begin, min(begin + ROWS, count)))
        if not count:
            losses.add("there are no rows", "row 0")

    def _choose(self, shapes, texts, wanted, joints):
        """Choose among arrays that can be read."""
        why = "".join(f"; array '{name}' cannot be read: {why}" for name, why in self._broken.items())
        if not shapes:
            raise InputError(f"'{self.path}' has no array that can be read{why}.")
        self.headers = list(shapes)
        self._layouts = _layouts({name: shape for name, (shape, kind) in shapes.items() if kind.kind in "iufMm"})
        stated = self._stated(shapes, texts, joints)
        columns = [self._column(name, kind, texts.get(name)) for name, (_, kind) in shapes.items()]
        try:
            choice = choose(columns, wanted, joints, self.path, stated)
        except InputError as error:
            raise InputError(f"{error.args[0]}{why}") from None
        self.choice = _check_times(self.path, columns, choice, wanted)

    def _open(self):
        try:
            return zipfile.ZipFile(self.path)
        except _BROKEN as error:
            raise InputError(f"'{self.path}' is no npz that can be read: {error}. {_NOT_WHOLE}") from error

    def _shape(self, file, name):
        """Shape and type of an array by its header; None if it cannot be read."""
        try:
            with file.open(f"{name}.npy") as member:
                version = np.lib.format.read_magic(member)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, kind = read(member)
            size = file.getinfo(f"{name}.npy").file_size
            if prod(shape) * kind.itemsize > size:  # or memory would be taken for it
                raise ValueError(f"its shape is {shape}, but it has {size} bytes")
            return shape, kind
        except _BROKEN as error:
            self._broken[name] = " ".join(str(error).split())
            return None

    def _array(self, file, name):
        """An array, bytes as texts; None if it cannot be read."""
        try:
            with file.open(f"{name}.npy") as member:
                array = np.lib.format.read_array(member, allow_pickle=False)
            return array.astype(str) if array.dtype.kind == "S" else array
        except _BROKEN as error:
            self._broken[name] = " ".join(str(error).split())
            return None

    def _stated(self, shapes, texts, known):
        """Arrays of text that have no row for each time, and may state names of joints."""
        lengths, found = {layout.rows for layout in self._layouts.values()}, []
        for name, array in texts.items():
            value = array.tolist() if array is not None and array.ndim < 2 else None
            once = isinstance(value, list) and len(set(value)) == len(value) and set(value) <= set(known)
            if isinstance(value, str) or once or (value and len(value) not in lengths):
                found += label_text(f"array '{name}'", _last(name), value, name)
        if not any(_last(one.array).lower() in NAMES for one in found):
            for name, (_, kind) in shapes.items():
                if kind.kind == "O" and _last(name).lower() in NAMES:
                    raise InputError(
                        f"'{self.path}': array '{name}' holds Python objects, which are not loaded. Save names as "
                        f"np.array({name}, dtype=str)."
                    )
        return found

    def _column(self, name, kind, texts):
        """Content of an array; one of texts gets a layout if it has a row for each time."""
        if name in self._layouts:
            label = {"M": "timestamp", "m": "duration"}.get(kind.kind, "")
            return Column(name, self._layouts[name].width, moments=kind.kind == "M", type=label)
        column = Column(name, numeric=False, type=kind.name)
        rows = {layout.rows for layout in self._layouts.values()}
        if texts is None or texts.ndim not in (1, 2) or (texts.ndim == 2 and len(texts) not in rows):
            return column
        self._layouts[name] = _Layout(len(texts), 0 if texts.ndim == 1 else texts.shape[1], False)
        first = texts[:SAMPLE].tolist()
        return sample_column(column, first) if texts.ndim == 1 else column._replace(sample=tuple(first), listed=True)


def _last(name):
    return name.replace("/", ".").split(".")[-1]


def _in_arrow(array):
    """An array (n,) or (n, k) as an array or lists of pyarrow."""
    kind = array.dtype.kind
    if kind in "Mm":
        array = array.astype(f"{kind}8[ns]")
    elif kind == "f":
        array = array.astype(float)
    elif kind in "iu":
        array = array.astype(array.dtype.newbyteorder("="))
    if array.ndim == 1:
        return pa.array(array, from_pandas=False)
    return pa.FixedSizeListArray.from_arrays(pa.array(np.ascontiguousarray(array).reshape(-1)), array.shape[1])


def _layouts(shapes):
    """Layouts of the arrays of numbers with one axis or two, by name."""
    lengths = {shape[0] for shape in shapes.values() if len(shape) == 1}
    if 1 not in lengths:  # in a recording of one row, (1, k) are k joints
        lengths |= {max(shape) for shape in shapes.values() if len(shape) == 2 and 1 in shape}
    found = {name: _Layout(shape[0], 0, False) for name, shape in shapes.items() if len(shape) == 1}
    for name, (first, second) in ((name, shape) for name, shape in shapes.items() if len(shape) == 2):
        turned = second in lengths and (first not in lengths or first < second)
        rows, width = (second, first) if turned else (first, second)
        found[name] = _Layout(rows, 0 if width == 1 else width, turned)
    return found
