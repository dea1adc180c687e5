# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of any table as columns of joints, in pieces and SI units."""

import re
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import pyarrow as pa

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.recordings.messages import Unread
from diag_dynamics.recordings.tables.cells import (
    read_lists,
    read_numbers,
    read_texts,
    read_times,
    unify,
)
from diag_dynamics.recordings.tables.headers import QUANTITIES, Column

ROWS = 20_000  # about as many are in a piece
LEFT_OUT = "rows omitted"
_DECIMAL_COMMA = re.compile(r"'[-+]?\d+,\d+(?:e[-+]?\d+)?'", re.IGNORECASE)


@runtime_checkable
class Table(Protocol):
    """A file of rows: its columns, and blocks of cells. Readers of formats are Tables."""

    path: str
    unit: str  # what numbers of rows count: line or row
    columns: list[Column]
    texts: list[str]  # comments and metadata, which may name joints
    notes: list[str]  # how the file was read; complete after the last block

    def blocks(
        self, numbers: list[int], texts: list[int], lose: Callable[..., None]
    ) -> Iterator[tuple[dict[int, pa.Array], Array]]:
        """Yield cells of columns of numbers, of times and names by column, and rows' numbers.

        `lose(cause, where, unit, count, example)` counts what cannot be read.
        """


class Columns(NamedTuple):
    """Rows that have a time; a value that is missing or no number is NaN."""

    time: np.ndarray  # [s], float64, shape (n,)
    stamp: np.ndarray  # [ns], int64, likewise: exact where the file is; cut at ±4e18
    position: np.ndarray  # [rad, m], float64, shape (n, k): a column for each joint
    velocity: np.ndarray | None  # [rad/s, m/s], likewise; None where the file has none
    effort: np.ndarray | None  # [N m, N], likewise
    rows: np.ndarray  # line of a text, or row of another file from 0: int64, shape (n,)
    names: np.ndarray | None = None  # joint of each value, empty for none; None: of the table

    def select(self, places):
        """Return some of the rows."""
        return Columns(*(None if column is None else column[places] for column in self))


class JointTable:
    """Rows of a Table in pieces, by a Choice; `notes` tell how columns were read.

    `unread` and the number of rows `without_values` are complete after the last piece.
    """

    def __init__(self, table, choice):
        self._table, self._choice, self.without_values, self._losses = table, choice, 0, {}
        self.joints, self.unit, self._first = choice.joints, table.unit, None

    @property
    def notes(self):
        """How the file and its columns were read: a list of str."""
        return [*self._choice.notes, *self._table.notes]

    @property
    def unread(self):
        """Unreadable data, a list of Unread."""
        return [
            Unread(self._table.path, where, cause + example + (f": {count} {unit}" if unit else ""))
            for (cause, unit), (where, example, count) in self._losses.items()
        ]

    def _lose(self, cause, where, unit="", count=1, example=""):
        """Count a loss of so many units, such as ``rows omitted``; the first is the example."""
        if self.unit == "line" and _DECIMAL_COMMA.search(example):
            example += "; decimal commas need decimal: ',' in a column map"
        example = f" ({example})" if example else ""
        self._losses.setdefault((cause, unit), [where, example, 0])[2] += count

    def pieces(self):
        """Yield pieces as :class:`Columns`, once."""
        checked, count = self._choice.time_scale is not None, 0
        texts = [*self._choice.time, *self._choice.names]
        for arrays, rows in self._table.blocks(self._choice.values, texts, self._lose):
            count += len(rows)
            columns = self._read({k: unify(array) for k, array in arrays.items()}, rows)
            if not checked and len(columns.rows):
                _require_seconds(columns.time, self._table.path)
                checked = True
            if len(columns.rows):
                yield columns
        if not count:
            self._lose("there are no rows", "end")

    def _read(self, arrays, rows):
        """Return the rows that have a time and a value."""
        choice, names = self._choice, None
        times = [arrays[k] for k in choice.time]
        if times:
            time, stamp = read_times(times[0], choice.time_scale or 1.0)
        else:
            time, stamp = self._count_times(rows)
        for nanoseconds in times[1:]:
            more = read_times(nanoseconds, 1e-9)
            time, stamp = time + more[0], stamp + more[1]
        values = {
            key: self._read_values(quantity, arrays, rows)
            for key, quantity in choice.quantities.items()
        }
        if choice.names:
            names = np.column_stack([_read_names(arrays[k]) for k in choice.names])
            self._lose_nameless(values, names, rows)
        empty = np.ones(len(rows), bool) if names is None else (names == "").all(axis=1)
        for numbers in values.values():
            empty &= np.isnan(numbers).all(axis=1)
        self.without_values += int(empty.sum())
        untimed = np.isnan(time)
        if (lost := np.flatnonzero(untimed & ~empty)).size:
            cells = [cells[lost[0]][:40] for cells in map(read_texts, times) if cells is not None]
            cause, example = "no time, or a time that is no number", " and ".join(map(repr, cells))
            self._lose_rows(rows, "", cause, LEFT_OUT, lost, example)
        values = {key: self._convert(key, value) for key, value in values.items()}
        columns = Columns(time, stamp, *map(values.get, QUANTITIES), rows, names)
        left_out = untimed | empty
        return columns.select(~left_out) if left_out.any() else columns

    def _count_times(self, rows):
        """Return times and stamps of rows that follow at a rate; lost rows have theirs too."""
        self._first = int(rows[0]) if self._first is None and len(rows) else self._first
        time = (rows - (self._first or 0)) * self._choice.time_scale
        return time, np.rint(time * SECOND).astype(np.int64)

    def _read_values(self, quantity, arrays, rows):
        """Return values of a quantity as the file has them, (n, k)."""
        if quantity.whole:
            k = quantity.columns[0]
            return read_lists(arrays[k], len(self.joints), self._lose_in_column(k, rows))
        values = np.full((len(rows), len(quantity.columns)), np.nan)
        for joint, k in enumerate(quantity.columns):
            if k is not None:
                values[:, joint] = read_numbers(arrays[k], self._lose_in_column(k, rows))
        return values

    def _convert(self, key, values):
        """Return values of joints in SI units; power is the same at motors and joints."""
        quantity, mixing = self._choice.quantities[key], self._choice.mixing
        if (quantity.scale != 1.0).any():
            values = values * quantity.scale
        if mixing is not None:
            matrix = np.linalg.inv(mixing) if key == "effort" else mixing.T
            unknown = np.isnan(values).astype(float) @ (matrix != 0.0) > 0.0
            mixed = np.where(np.isnan(values), 0.0, values) @ matrix
            values = np.where(unknown, np.nan, mixed)
        return values + quantity.offset if quantity.offset.any() else values

    def _lose_rows(self, rows, before, cause, unit, lost, example):
        self._lose(cause, f"{self.unit} {rows[lost[0]]}", unit, len(lost), before + example)

    def _lose_in_column(self, k, rows):
        return partial(self._lose_rows, rows, f"column '{self._table.columns[k].name}': ")

    def _lose_nameless(self, values, names, rows):
        """Count values without the name of a joint as lost."""
        for key, numbers in values.items():
            odd = (names == "") & ~np.isnan(numbers)
            if odd.any():
                cause, example = "values without the name of a joint", f"{key} {numbers[odd][0]:g}"
                self._lose_rows(rows, "", cause, "values omitted", np.nonzero(odd)[0], example)


def _read_names(array):
    """Return the texts of a column, (n,) of str; empty for null."""
    encoded = array.dictionary_encode()
    texts = np.array([*encoded.dictionary.to_pylist(), ""], object)
    return texts[encoded.indices.fill_null(len(texts) - 1).to_numpy(zero_copy_only=False)]


def _require_seconds(time, path):
    """Reject times that in seconds would be beyond the year 5138."""
    middle = float(np.nanmedian(np.abs(time)))
    if 1e11 <= middle < np.inf:
        unit = "ms" if middle < 1e14 else "us" if middle < 1e17 else "ns"
        advice = f"Set `scale: {{time: {unit}}}` in a column map"
        raise InputError(f"'{path}': times are about {middle:.6g}; expected seconds. {advice}.")
