# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of any table as columns of joints, in pieces and SI units."""

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.messages import Unread
from diag_dynamics.recordings.tables.cells import (
    MISSING,
    are_blank,
    decoded,
    is_text,
    read_lists,
    read_numbers,
    read_texts,
)
from diag_dynamics.recordings.tables.columns import Columns
from diag_dynamics.recordings.tables.joint_names import read_row_names
from diag_dynamics.recordings.tables.times import doubtful_unit, read_pairs, read_times

ROWS = 20_000
"""About as many rows are in a piece."""
LEFT_OUT = "rows left out"


class Block(NamedTuple):
    """Rows of a table."""

    arrays: dict[int, Any]
    """Array of pyarrow by index of the column."""
    rows: np.ndarray
    """Rows of the file, int64, shape (n,)."""
    lines: Any = None
    """Lines of these rows in a text."""
    decimal: str = "."

    def where(self, k):
        """Return the place of the k-th row."""
        return f"row {self.rows[k]}" if self.lines is None else f"line {self.lines[k]}"


class Losses:
    """Unreadable data, counted by cause."""

    def __init__(self, file):
        self._file, self._causes = file, {}

    def add(self, cause, where, unit="", count=1, example=""):
        """Count a loss of so many units, such as ``rows left out``; place and example of the first are kept."""
        self._causes.setdefault((cause, unit), [where, example, 0])[2] += count

    def listed(self):
        """Return all losses as a list of Unread."""
        found = []
        for (cause, unit), (where, example, count) in self._causes.items():
            what = cause + (f" ({example})" if example else "") + (f": {count} {unit}" if unit else "")
            found.append(Unread(self._file, where, what))
        return found


class Table:
    """Rows of a table in pieces.

    Parameters
    ----------
    source : CsvSource, ParquetSource or NpzSource
        It has `path`, `headers`, `choice`, `notes`, and `blocks(losses)`, which yields :class:`Block`.

    Attributes
    ----------
    joints : tuple of str
    notes : list of str
        How the columns were understood.
    unread : list of Unread
        Complete when all pieces have been read.
    without_values : int
        Rows without a value of any joint; likewise.
    """

    def __init__(self, source):
        self._source, self._choice, self._losses = source, source.choice, Losses(source.path)
        self.joints, self.without_values = source.choice.joints, 0
        self.notes = [*source.choice.notes, *source.notes]

    @property
    def unread(self):
        """Unreadable data."""
        return self._losses.listed()

    def pieces(self):
        """Yield pieces as :class:`Columns`; a second call starts again.

        Raises
        ------
        InputError
            The unit of the times is in doubt, or rows of single joints are in the order of joints.
        """
        self._losses, self.without_values = Losses(self._source.path), 0
        names, first = self._choice.names, True
        joined = _JoinedRows(self._source.path) if names and not names.listed and len(names.columns) == 1 else None
        for block in self._source.blocks(self._losses):
            columns = self._read(block)
            if not len(columns.rows):
                continue
            unit = doubtful_unit(columns.time) if first and self._choice.time_in_doubt else None
            if unit:
                raise InputError(
                    f"'{self._source.path}': times are about {np.median(columns.time):.6g}, which in seconds is no time: say "
                    f"what they are by `scale: {{time: {unit}}}` in the map of columns."
                )
            first, columns = False, joined.add(columns) if joined else columns
            if columns:
                yield columns
        if joined and (columns := joined.finish()):
            yield columns

    def _read(self, block):
        """The rows of a block that have a time and a value."""
        choice, names = self._choice, None
        time, stamp = self._times(block)
        values = {quantity: self._values(block, one) for quantity, one in choice.quantities.items() if one}
        if choice.names:
            names = read_row_names(choice.names, block.arrays)
            names = self._place(values, names, block)
        empty, untimed = self._are_empty(block, values, names), np.isnan(time)
        if untimed.any():
            texts = [read_texts(block.arrays[k]) for k in choice.time if is_text(block.arrays[k].type)]
            empty[[k for k in np.flatnonzero(untimed) if any(one[k].strip() not in MISSING for one in texts)]] = False
            lost = np.flatnonzero(untimed & ~empty)
            if lost.size:
                example = " and ".join(f"'{one[lost[0]][:40]}'" for one in texts)
                self._losses.add(
                    "no time, or one that is no number", block.where(lost[0]), LEFT_OUT, lost.size, example
                )
        self.without_values += int(empty.sum())
        kept = ~(untimed | empty)
        values = [values[one][kept] if one in values else None for one in choice.quantities]
        return Columns(time[kept], stamp[kept], *values, block.rows[kept], None if names is None else names[kept])

    def _times(self, block):
        arrays = [decoded(block.arrays[k]) for k in self._choice.time]
        if len(arrays) == 2:
            return read_pairs(*(read_times(one, 1.0, block.decimal)[0] for one in arrays))
        return read_times(arrays[0], self._choice.time_scale, block.decimal)

    def _values(self, block, quantity):
        """Values of a quantity in SI units, (n, k)."""
        scale = np.ones(1) if isinstance(quantity.scale, Mapping) else quantity.scale
        if quantity.whole:
            k = quantity.columns[0]
            values = read_lists(block.arrays[k], None if self._choice.names else len(self.joints), self._lose(block, k))
            if values.shape[1] == len(scale):
                return values * scale
            if len(set(scale.tolist())) > 1:
                expected = "expected one number, or one by joint, for rows that name different joints"
                raise InputError(f"scale has {len(scale)} numbers; {expected}.")
            return values * scale[:1]
        values = np.full((len(block.rows), len(quantity.columns)), np.nan)
        for joint, k in enumerate(quantity.columns):
            if k is not None:
                values[:, joint] = read_numbers(block.arrays[k], block.decimal, self._lose(block, k))
        return values * scale

    def _lose(self, block, k):
        """What counts losses of a column."""

        def lose(cause, unit, rows, example):
            example = f"column '{self._source.headers[k]}': {example}"
            self._losses.add(cause, block.where(rows[0]), unit, len(rows), example)

        return lose

    def _are_empty(self, block, values, names):
        """Whether rows have neither a value nor the name of any joint, and no NaN in place of one."""
        empty = np.ones(len(block.rows), bool) if names is None else (names == "").all(axis=1)
        for one in values.values():
            empty &= np.isnan(one).all(axis=1)
        for k in self._choice.values if empty.any() else ():
            empty &= are_blank(block.arrays[k])
        return empty

    def _place(self, values, names, block):
        """Give values and names as many places, and values the scale of their joint; those without a name are lost."""
        width = max(one.shape[1] for one in (names, *values.values()))
        names = _widen(names, width, "")
        for quantity, one in values.items():
            values[quantity] = one = _widen(one, width, np.nan)
            scale = self._choice.quantities[quantity].scale
            if isinstance(scale, Mapping):
                factors = {name: scale.get(name, scale.get(ALL)) for name in set(names.ravel().tolist())} | {"": 1.0}
                if lacking := [name for name, factor in factors.items() if factor is None]:
                    missing = f"{quantity} has nothing for '{min(lacking)}', which rows name"
                    raise InputError(f'scale: {missing}. Add it, or "*".')
                one *= np.vectorize(factors.get, otypes=[float])(names)
            odd = (names == "") & ~np.isnan(one)
            if odd.any():
                k = int(np.argmax(odd.any(axis=1)))
                cause, example = "values without the name of a joint", f"{quantity} {one[k][odd[k]][0]:g}"
                self._losses.add(cause, block.where(k), "values left out", int(odd.sum()), example)
                one[odd] = np.nan
        return names


def _widen(values, width, fill):
    return np.pad(values, ((0, 0), (0, width - values.shape[1])), constant_values=fill)


class _JoinedRows:
    """Rows of single joints at one time as one row; the last time waits for its other rows."""

    def __init__(self, path):
        self._path, self._held, self._joint = path, None, None

    def add(self, columns):
        """Return all rows of times before the last one, or None."""
        self._require_order_of_time(columns)
        if self._held:
            pairs = zip(self._held, columns, strict=True)
            columns = Columns(*(None if a is None else np.concatenate([a, b]) for a, b in pairs))
        starts = _starts(columns)
        self._held = _part(columns, slice(starts[-1], None))
        return _join(_part(columns, slice(0, starts[-1])), starts[:-1]) if len(starts) > 1 else None

    def finish(self):
        """Return the rows of the last time, or None."""
        return _join(self._held, [0]) if self._held else None

    def _require_order_of_time(self, columns):
        """Reject rows in the order of joints: times start again with the second one."""
        for name, stamp, time in zip(columns.names[:, 0], columns.stamp, columns.time, strict=True):
            joint, last = self._joint or (name, stamp)
            if joint is not None and name != joint and stamp < last:
                order = f"rows are in the order of joints, '{joint}' before '{name}'; times begin again at {time:g} s"
                raise InputError(f"'{self._path}': {order}. Sort the rows by time.")
            self._joint = (name if name == joint else None), stamp
            if self._joint[0] is None:
                return


def _starts(columns):
    """First row of each time: rows of one time that name different joints belong together."""
    starts, there, last = [], set(), None
    for k, (stamp, name) in enumerate(zip(columns.stamp.tolist(), columns.names[:, 0].tolist(), strict=True)):
        if stamp != last or name in there:
            starts.append(k)
            there, last = set(), stamp
        there.add(name)
    return starts


def _part(columns, which):
    return Columns(*(None if one is None else one[which] for one in columns))


def _join(columns, starts):
    """Rows from each start on as one."""
    counts = np.diff([*starts, len(columns.rows)])
    row = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(columns.rows)) - np.array(starts)[row]

    def widen(values, fill):
        if values is None:
            return None
        wide = np.full((len(starts), counts.max()), fill, values.dtype)
        wide[row, place] = values[:, 0]
        return wide

    values = map(partial(widen, fill=np.nan), columns[2:5])
    return Columns(columns.time[starts], columns.stamp[starts], *values, columns.rows[starts], widen(columns.names, ""))
