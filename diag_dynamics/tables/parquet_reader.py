# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parquet, by pyarrow: columns of numbers, lists of them, and structs of either."""

from importlib import import_module
from itertools import islice

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables import times
from diag_dynamics.tables.chosen import choose
from diag_dynamics.tables.csv_head import SAMPLE, sampled
from diag_dynamics.tables.csv_plain import are_blank
from diag_dynamics.tables.headers import Column
from diag_dynamics.tables.names import numbers_of, padded
from diag_dynamics.tables.pieces import ROWS, Read, of_one_length, piece, refuse_doubtful
from diag_dynamics.tables.statements import metadata_texts
from diag_dynamics.tables.together import Together
from diag_dynamics.tables.unread import Losses

LONGEST = 10_000
"""Characters of a text that is read."""

_UNIT = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class ParquetReader:
    """Rows of a Parquet file in pieces: one row group after another, those that are damaged left out.

    Parameters, attributes and exceptions are those of :class:`~diag_dynamics.tables.csv_reader.CsvReader`. Columns of
    strings, or of lists of them, may name the joints of each row; the metadata of the schema may name those of all rows.
    """

    def __init__(self, path, wanted, joints):
        self._path = path
        self._losses = Losses(path)
        try:
            self._arrow = import_module("pyarrow")
            self._parquet = import_module("pyarrow.parquet")
            self._compute = import_module("pyarrow.compute")
        except ImportError as error:
            raise InputError(
                f"'{path}' is a Parquet file, and pyarrow is not installed: pip install pyarrow."
            ) from error
        with self._opened() as file:
            fields = list(_flat(self._arrow.types, file.schema_arrow))
            units, stated = _units(file.schema_arrow), _texts(file.schema_arrow)
            self._kinds = [kind for _, kind in fields]
            self._columns = [self._column_of(file, name, kind, units.get(name)) for name, kind in fields]
        self._choice = choose(self._columns, wanted, joints, path, stated)
        self._check(wanted)
        self.joints = self._choice.joints

    @property
    def unread(self):
        """What could not be read."""
        return self._losses.listed()

    @property
    def notes(self):
        """How the columns were understood."""
        return (*self._choice.notes, *self._losses.notes())

    @property
    def without_values(self):
        """Number of rows without a value of any joint."""
        return self._losses.without_values

    def pieces(self):
        """Each piece as :class:`Columns`; a second call begins anew."""
        self._losses = Losses(self._path)
        first, row = True, 0
        used, together = [self._columns[k].name for k in self._choice.used()], Together(self._choice, self._path)
        with self._opened() as file:
            for group in range(file.num_row_groups):
                end = row + file.metadata.row_group(group).num_rows
                try:
                    for batch in file.iter_batches(ROWS, row_groups=[group], columns=used, use_threads=False):
                        columns = self._piece(batch, row)
                        row += batch.num_rows
                        if len(columns.rows):
                            if first:
                                refuse_doubtful(self._choice, columns.time, self._path)
                            first = False
                            yield from together.take(columns)
                except (self._arrow.ArrowException, OSError) as error:
                    why = " ".join(str(error).split())
                    self._losses.add(
                        "row group cannot be read", f"row {row}, row group {group}", "rows lost", end - row, why
                    )
                row = end
            yield from together.end()
            if not file.metadata.num_rows:
                self._losses.add("there are no rows", "row 0", "")

    # --- What there is ---

    def _opened(self):
        """The file, to be closed."""
        try:
            return self._parquet.ParquetFile(self._path, pre_buffer=False, buffer_size=1 << 20)
        except (self._arrow.ArrowException, OSError, UnicodeDecodeError) as error:  # the last of a name
            raise InputError(
                f"'{self._path}' is no Parquet file that can be read: {' '.join(str(error).split())} What stands at its end "
                "says where everything is, and is missing in a file that was not closed or not copied whole."
            ) from error

    def _column_of(self, file, name, kind, unit):
        """What a column is by its type, and by its first rows if it has texts."""
        column = Column(name, self._width(file, name, kind), unit, numeric=self._is_numeric(kind))
        column = column._replace(moments=self._arrow.types.is_timestamp(kind), type=str(kind))
        if self._is_list(kind):
            column = column._replace(numeric=column.numeric and column.width > 0)
        if not self._is_text(kind.value_type if self._is_list(kind) else kind):
            return column
        texts = []
        for batch in self._beginning(file, name):
            texts += self._texts(batch, name)
            if any(texts):
                break
        texts = texts[: max(SAMPLE, next((k for k, text in enumerate(texts) if text), 0) + 1)]
        if self._is_list(kind):
            return column._replace(sample=tuple(one or () for one in texts), listed=True)
        return sampled(column, texts)

    def _is_text(self, kind):
        types = self._arrow.types
        if types.is_dictionary(kind):
            kind = kind.value_type
        tests = ("string", "large_string", "string_view", "binary", "large_binary", "binary_view")
        return any(getattr(types, f"is_{name}", lambda _: False)(kind) for name in tests)

    def _texts(self, batch, name):
        """Texts of a column, or lists of them; None of null."""
        column = self._column(batch, name)
        if self._arrow.types.is_dictionary(column.type):
            column = column.dictionary_decode()
        return _decoded(column.to_pylist())

    def _width(self, file, name, kind):
        """Columns of a list, which its first row that is not empty has; 0 of what is none."""
        types = self._arrow.types
        if not self._is_list(kind) or not self._is_numeric(kind):
            return 0
        if types.is_fixed_size_list(kind):
            return kind.list_size
        for batch in self._beginning(file, name):
            lengths = self._compute.list_value_length(self._column(batch, name)).to_numpy(zero_copy_only=False)
            lengths = lengths[np.nan_to_num(lengths) > 0]
            if lengths.size:
                return int(lengths[0])
        return 0

    def _beginning(self, file, name):
        """The first rows of a column, a few at a time: it may be one of pictures. None where they cannot be read."""
        try:
            yield from islice(file.iter_batches(16, columns=[name], use_threads=False), 64)
        except (self._arrow.ArrowException, OSError):
            return

    def _is_numeric(self, kind):
        """Whether a type is one of numbers, of lists of them, or of times."""
        types = self._arrow.types
        if types.is_dictionary(kind) or self._is_list(kind):
            kind = kind.value_type
        plain = types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind) or types.is_null(kind)
        return plain or types.is_timestamp(kind) or types.is_duration(kind)

    def _is_list(self, kind):
        types = self._arrow.types
        return types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)

    def _is_temporal(self, k):
        types, kind = self._arrow.types, self._kinds[k]
        return types.is_timestamp(kind) or types.is_duration(kind)

    def _check(self, wanted):
        """Refuse what types say against a choice by names."""
        choice = self._choice
        names = [column.name for column in self._columns]
        for k in choice.used():
            if names.count(names[k]) > 1:
                raise InputError(f"'{self._path}' has two columns '{names[k]}'.")
            if self._is_temporal(k) and k not in choice.time:
                raise InputError(f"'{self._path}': column '{names[k]}' is of times, expected numbers.")
        if self._is_temporal(choice.time[0]):
            if "time" in wanted.scale:
                raise InputError(
                    f"'{self._path}': there is a scale of time, but '{names[choice.time[0]]}' says its unit itself."
                )
            self._choice = choice._replace(time_in_doubt=False)

    # --- Rows ---

    def _piece(self, batch, row):
        """Rows of a batch."""
        rows = np.arange(row, row + batch.num_rows)
        read = Read(
            *self._times(batch),
            rows,
            lambda k: self._numbers(batch, k, rows),
            lambda k: self._texts(batch, self._columns[k].name),
            lambda k: self._blank(batch, k),
            lambda k: f"row {rows[k]}",
        )
        return piece(self._choice, read, self._losses)

    def _column(self, batch, name):
        """A column of a batch, also one in a struct."""
        found = batch.schema.get_field_index(name)
        if found >= 0:
            return batch.column(found)
        head = next(one for one in batch.schema.names if name.startswith(f"{one}."))
        inner = batch.column(batch.schema.get_field_index(head))
        rest = name[len(head) + 1 :]
        while rest:
            head = next(one.name for one in inner.type if rest == one.name or rest.startswith(f"{one.name}."))
            inner, rest = self._compute.struct_field(inner, head), rest[len(head) + 1 :]
        return inner

    def _times(self, batch):
        """Times and stamps of a batch."""
        columns = [self._column(batch, self._columns[k].name) for k in self._choice.time]
        if len(columns) == 2:
            return times.of_pairs(*(self._floats(column) for column in columns))
        column, scale, types = columns[0], self._choice.time_scale, self._arrow.types
        if types.is_dictionary(column.type):
            column = column.dictionary_decode()
        if self._is_text(column.type):
            return times.of_texts([one or "" for one in _decoded(column.to_pylist())], scale)
        if self._is_temporal(self._choice.time[0]):
            column, scale = column.cast(self._arrow.int64()), _UNIT[column.type.unit]
        if types.is_integer(column.type):
            known = column.is_valid().to_numpy(zero_copy_only=False)
            integers = self._compute.fill_null(column, 0).to_numpy(zero_copy_only=False)
            time, stamp = times.of_integers(integers, scale)
            return np.where(known, time, np.nan), stamp
        if types.is_decimal(column.type):
            return times.of_texts([str(one) for one in column.to_pylist()], scale)
        return times.of_floats(self._floats(column), scale)

    def _floats(self, column):
        """Numbers as doubles; null is NaN."""
        if self._arrow.types.is_dictionary(column.type):
            column = column.dictionary_decode()
        return column.cast(self._arrow.float64(), safe=False).to_numpy(zero_copy_only=False)

    def _blank(self, batch, k):
        """Whether cells of a column have nothing in them: null, or an empty list."""
        column = self._column(batch, self._columns[k].name)
        if self._is_list(column.type):
            lengths = self._compute.fill_null(self._compute.list_value_length(column), 0)
            return lengths.to_numpy(zero_copy_only=False) == 0
        if self._is_text(column.type):
            return are_blank(self._texts(batch, self._columns[k].name))
        return column.is_null().to_numpy(zero_copy_only=False)

    def _numbers(self, batch, k, rows):
        """Numbers of a column by its index."""
        name, width = self._columns[k].name, self._columns[k].width
        column = self._column(batch, name)
        if not width:
            return self._floats(column)
        if self._is_text(column.type):
            values, lengths = padded([numbers_of(text or "") or () for text in self._texts(batch, name)])
        else:
            lengths = np.nan_to_num(self._compute.list_value_length(column).to_numpy(zero_copy_only=False)).astype(int)
            values = np.full((len(rows), lengths.max(initial=0)), np.nan)
            values[np.arange(values.shape[1]) < lengths[:, None]] = self._floats(column.flatten())
        if self._choice.names:
            return values
        return of_one_length(values, lengths, width, self._losses, lambda at: f"row {rows[at]}", name)


def _decoded(texts):
    """Texts, or lists of them, of bytes; what is too long for a time or names, such as a picture, is empty."""
    if isinstance(texts, list):
        return [_decoded(one) for one in texts]
    if isinstance(texts, bytes | str) and len(texts) > LONGEST:
        return None
    return texts.decode("utf-8", "replace") if isinstance(texts, bytes) else texts


def _units(schema):
    """Units of columns by name, where the metadata of their fields have one."""
    found = ((field.name, (field.metadata or {}).get(b"unit")) for field in schema)
    return {name: unit.decode(errors="replace") for name, unit in found if unit}


def _texts(schema):
    """Texts in the metadata of the schema, and of fields, that may state names of joints."""
    every = [schema.metadata, *(field.metadata for field in schema)]
    return [text for metadata in every for text in metadata_texts(metadata)]


def _flat(types, fields, prefix=""):
    """Names and types of fields, those in structs behind a dot."""
    for field in fields:
        if types.is_struct(field.type):
            yield from _flat(types, field.type, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name, field.type
