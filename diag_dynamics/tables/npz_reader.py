# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays of an npz, by numpy."""

import tokenize
import zipfile
import zlib
from math import prod
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables import times
from diag_dynamics.tables.chosen import choose
from diag_dynamics.tables.csv_head import SAMPLE, sampled
from diag_dynamics.tables.headers import Column
from diag_dynamics.tables.names import NAMES
from diag_dynamics.tables.pieces import ROWS, Read, piece, refuse_doubtful
from diag_dynamics.tables.statements import listing
from diag_dynamics.tables.together import Together
from diag_dynamics.tables.unread import Losses

BROKEN = (
    *(zipfile.BadZipFile, zlib.error, ValueError, EOFError, OSError, NotImplementedError),
    RuntimeError,  # of what is encrypted, or says so
    *(SyntaxError, tokenize.TokenError),  # of numpy's header of an array
)
"""What comes of an archive, or of an array in it, that is damaged."""


class NpzReader:
    """Rows of the arrays of an npz in pieces. The arrays that are used are in memory as a whole: they were when written.

    Parameters, attributes and exceptions are those of :class:`~diag_dynamics.tables.csv_reader.CsvReader`. Arrays are (n,) or
    (n, k); one that is (k, n), where n is the length of an array of one dimension and k is none, is turned round. An array of
    strings with a row for each time names the joints of each row; another one called joint_names or the like those of all.
    """

    def __init__(self, path, wanted, joints):
        self._path = path
        self._losses = Losses(path)
        self._broken = {}
        for value in (wanted.time, wanted.position, wanted.velocity, wanted.effort):
            if isinstance(value, list | tuple) and any(isinstance(one, int) for one in value):
                raise InputError(f"'{path}' is an npz: its arrays have names, expected no numbers of columns.")
        with self._opened() as file:
            shapes = {name: self._shape(file, name) for name in file.namelist() if name.endswith(".npy")}
            shapes = {name.removesuffix(".npy"): shape for name, shape in shapes.items() if shape}
            texts = {name: self._texts_of(file, name) for name, (_, kind) in shapes.items() if kind in "US"}
        if not shapes:
            raise InputError(f"'{path}' has no array that can be read{self._why()}.")
        self._layouts = _layouts({name: shape for name, (shape, kind) in shapes.items() if kind in "iufMm"})
        stated = self._stated(shapes, texts, joints)
        columns = [self._column_of(name, kind, texts.get(name)) for name, (_, kind) in shapes.items()]
        self._names = list(shapes)
        try:
            self._choice = choose(columns, wanted, joints, path, stated)
        except InputError as error:
            raise InputError(f"{error.args[0]}{self._why()}") if self._broken else error from None
        self._kinds = [kind for _, kind in shapes.values()]
        self._check(shapes, wanted)
        self.joints = self._choice.joints
        used = [self._names[k] for k in self._choice.used()]
        turned = [name for name in used if self._layouts[name].turned and self._layouts[name].width]
        self._turned = [f"{name}: turned round, it has a row for each joint." for name in turned]

    @property
    def unread(self):
        """What could not be read."""
        return self._losses.listed()

    @property
    def notes(self):
        """How the columns were understood."""
        return (*self._choice.notes, *self._turned, *self._losses.notes())

    @property
    def without_values(self):
        """Number of rows without a value of any joint."""
        return self._losses.without_values

    def pieces(self):
        """Each piece as :class:`Columns`; a second call begins anew."""
        self._losses = Losses(self._path)
        arrays = self._arrays()
        for name, why in self._broken.items():
            self._losses.add(f"array '{name}' cannot be read: {why}: all its numbers are lost", f"array {name}", "")
        choice = self._choice._replace(
            **{
                name: None
                for name in ("velocity", "effort")
                if (one := getattr(self._choice, name)) and one.whole is not None and one.whole not in arrays
            }
        )
        count, together = self._count, Together(choice, self._path)
        for begin in range(0, count, ROWS):
            rows = np.arange(begin, min(begin + ROWS, count))
            part = {k: array[rows[0] : rows[-1] + 1] for k, array in arrays.items()}
            read = Read(
                *self._times([part[k] for k in choice.time]),
                rows,
                lambda k, part=part, rows=rows: part[k].astype(float) if k in part else np.full(len(rows), np.nan),
                lambda k, part=part: part[k].tolist(),
                lambda k, part=part, rows=rows: np.full(len(rows), k not in part),
                lambda k, rows=rows: f"row {rows[k]}",
            )
            columns = piece(choice, read, self._losses)
            if len(columns.rows):
                if begin == 0:
                    refuse_doubtful(choice, columns.time, self._path)
                yield from together.take(columns)
        yield from together.end()
        if not count:
            self._losses.add("there are no rows", "row 0", "")

    # --- What there is ---

    def _opened(self):
        """The archive, to be closed."""
        try:
            return zipfile.ZipFile(self._path)
        except BROKEN as error:
            raise InputError(
                f"'{self._path}' is no npz that can be read: {error}. What stands at its end says where everything is, and "
                "is missing in a file that was not closed or not copied whole."
            ) from error

    def _shape(self, file, name):
        """Shape and kind of an array by its header; None if it cannot be read."""
        try:
            with file.open(name) as member:
                version = np.lib.format.read_magic(member)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, dtype = read(member)
            size = file.getinfo(name).file_size
            if prod(shape) * dtype.itemsize > size:  # or memory would be taken for it
                raise ValueError(f"its shape is {shape}, but it has {size} bytes")
        except BROKEN as error:
            self._broken[name.removesuffix(".npy")] = " ".join(str(error).split())
            return None
        return shape, dtype.kind

    def _texts_of(self, file, name):
        """An array of texts; None if it cannot be read."""
        array = self._array(file, name)
        return None if array is None else array.astype(str)

    def _stated(self, shapes, texts, known):
        """Arrays of text that have no row for each time, and may state names of joints."""
        lengths, found = {layout.rows for layout in self._layouts.values()}, []
        for name, array in texts.items():
            if array is None or array.ndim > 1:
                continue
            value = array.tolist()
            once = array.ndim == 0 or (len(set(value)) == len(value) and set(value) <= set(known))
            if once or len(array) not in lengths:
                found += listing(f"array '{name}'", name.replace("/", ".").split(".")[-1], value, name)
        if not any(_is_label(one.array) for one in found):
            for name, (_, kind) in shapes.items():
                if kind == "O" and _is_label(name):
                    raise InputError(
                        f"'{self._path}': array '{name}' holds Python objects, which are not loaded. Save names as "
                        f"np.array({name}, dtype=str)."
                    )
        return found

    def _column_of(self, name, kind, texts):
        """What a column is by its array; one of texts gets a layout if it has a row for each time."""
        if name in self._layouts:
            return Column(name, self._layouts[name].width, moments=kind == "M")
        column = Column(name, numeric=False, type={"O": "object", "c": "complex", "b": "bool"}.get(kind, kind))
        if texts is None or texts.ndim not in (1, 2):
            return column
        if len(texts) not in {layout.rows for layout in self._layouts.values()} and texts.ndim == 2:
            return column
        self._layouts[name] = _Layout(len(texts), 0 if texts.ndim == 1 else texts.shape[1], False)
        first = texts[:SAMPLE].tolist()
        return sampled(column, first) if texts.ndim == 1 else column._replace(sample=tuple(first), listed=True)

    def _check(self, shapes, wanted):
        """Refuse arrays of different lengths, and what types say against a choice by names."""
        choice = self._choice
        lengths = {k: self._layouts[self._names[k]].rows for k in choice.used()}
        for k in lengths:
            if self._kinds[k] in "Mm" and k not in choice.time:
                raise InputError(f"'{self._path}': array '{self._names[k]}' is of times, expected numbers.")
        self._count = lengths[choice.time[0]]
        for k, length in lengths.items():
            if length != self._count:
                name, shape, time = self._names[k], shapes[self._names[k]][0], self._names[choice.time[0]]
                raise InputError(
                    f"'{self._path}': array '{name}' has shape {shape}, expected a row for each of the {self._count} times "
                    f"in '{time}'."
                )
        if self._kinds[choice.time[0]] in "Mm":
            if "time" in wanted.scale:
                name = self._names[choice.time[0]]
                raise InputError(f"'{self._path}': there is a scale of time, but '{name}' says its unit itself.")
            self._choice = choice._replace(time_in_doubt=False)

    def _why(self):
        """What could not be read, for messages."""
        return "".join(f"; array '{name}' cannot be read: {why}" for name, why in self._broken.items())

    # --- Rows ---

    def _arrays(self):
        """The arrays that are used, by index, rows first; those that cannot be read are counted, and missing."""
        needed = {*self._choice.time, *self._choice.position.columns, self._choice.position.whole}
        arrays = {}
        with self._opened() as file:
            for k in self._choice.used():
                name = self._names[k]
                array = self._array(file, name)
                if array is not None:
                    layout, array = self._layouts[name], array.astype(str) if array.dtype.kind in "US" else array
                    arrays[k] = (array.T if layout.turned else array) if layout.width else array.reshape(-1)
                elif k in needed:
                    raise InputError(f"'{self._path}'{self._why()}.")
        return arrays

    def _array(self, file, name):
        """An array; None if it cannot be read."""
        try:
            with file.open(f"{name}.npy") as member:
                return np.lib.format.read_array(member, allow_pickle=False)
        except BROKEN as error:
            self._broken[name] = " ".join(str(error).split())
            return None

    def _times(self, columns):
        """Times and stamps of one array, or of two."""
        if len(columns) == 2:
            return times.of_pairs(*(column.astype(float) for column in columns))
        (column,) = columns
        if column.dtype.kind == "U":
            return times.of_texts(column.tolist(), self._choice.time_scale)
        if column.dtype.kind in "Mm":
            known = ~np.isnat(column)
            integers = np.where(known, column.astype(f"{column.dtype.kind}8[ns]").astype(np.int64), 0)
            time, stamp = times.of_integers(integers, 1e-9)
            return np.where(known, time, np.nan), stamp
        if column.dtype.kind in "iu":
            return times.of_integers(column, self._choice.time_scale)
        return times.of_floats(column.astype(float), self._choice.time_scale)


def _is_label(name):
    """Whether an array of this name lists joints."""
    return name.replace("/", ".").split(".")[-1].lower() in NAMES


class _Layout(NamedTuple):
    """What the axes of an array are."""

    rows: int
    width: int
    """Columns of it; 0 if there is one."""
    turned: bool
    """Whether it has a row for each joint and a column for each time."""


def _layouts(shapes):
    """Layouts of the arrays of numbers with one axis or two, by name."""
    lengths = {shape[0] for shape in shapes.values() if len(shape) == 1}
    if 1 not in lengths:  # in a recording of one row, (1, k) are k joints
        lengths |= {max(shape) for shape in shapes.values() if len(shape) == 2 and 1 in shape}
    found = {name: _Layout(shape[0], 0, False) for name, shape in shapes.items() if len(shape) == 1}
    for name, shape in shapes.items():
        if len(shape) == 2:
            first, second = shape
            turned = second in lengths and (first not in lengths or first < second)
            rows, width = (second, first) if turned else (first, second)
            found[name] = _Layout(rows, 0 if width == 1 else width, turned)
    return found
