# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of any table as columns of joints, in pieces and SI units."""

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.messages import Unread
from diag_dynamics.recordings.tables.cells import (
    are_blank,
    read_lists,
    read_numbers,
    read_pairs,
    read_texts,
    read_times,
    unify,
)
from diag_dynamics.recordings.tables.joint_names import read_row_names

ROWS = 20_000  # about as many are in a piece
LEFT_OUT = "rows left out"


class Columns(NamedTuple):
    """Rows that have a time; a value that is missing or no number is NaN."""

    time: np.ndarray  # [s], float64, shape (n,)
    stamp: np.ndarray  # [ns], int64, likewise: exact where the file is; cut at ±2⁶²
    position: np.ndarray  # [rad, m], float64, shape (n, k): a column for each joint
    velocity: np.ndarray | None  # [rad/s, m/s], likewise; None where the file has none
    effort: np.ndarray | None  # [N m, N], likewise
    rows: np.ndarray  # line of a text, or row of another file from 0: int64, shape (n,)
    names: np.ndarray | None = None  # joint of each value, str, shape (n, k), empty for none; None: those of the table

    def select(self, which):
        """Return some of the rows."""
        return Columns(*(None if one is None else one[which] for one in self))


class Losses:
    """Unreadable data, counted by cause; place and example of the first are kept."""

    def __init__(self, file):
        self._file, self._causes = file, {}

    def add(self, cause, where, unit="", count=1, example=""):
        """Count a loss of so many units, such as ``rows left out``."""
        self._causes.setdefault((cause, unit), [where, f" ({example})" if example else "", 0])[2] += count

    def listed(self):
        """Return all losses as a list of Unread."""
        return [
            Unread(self._file, where, cause + example + (f": {count} {unit}" if unit else ""))
            for (cause, unit), (where, example, count) in self._causes.items()
        ]


class Table:
    """Rows of a table in pieces, with `joints`, `notes` of how the columns were understood, and losses in `unread`.

    `unit`, ``line`` or ``row``, is what `Columns.rows` counts, `without_values` the number of rows without a value of any
    joint. It and `unread` are complete when all pieces have been read. The source has `path`, `headers`, `choice`, `notes`,
    `unit`, and `blocks(losses)`, which yields arrays of pyarrow by index of the column and the number of each row.
    """

    def __init__(self, source):
        self._source, self._choice, self._losses = source, source.choice, Losses(source.path)
        self.joints, self.unit, self.without_values = source.choice.joints, source.unit, 0
        self.notes = [*source.choice.notes, *source.notes]

    @property
    def unread(self):
        """Unreadable data, a list of Unread."""
        return self._losses.listed()

    def pieces(self):
        """Yield pieces as :class:`Columns`; a second call starts again.

        Raises
        ------
        InputError
            The unit of the times is in doubt, or rows of single joints are in the order of joints.
        """
        self._losses, self.without_values = Losses(self._source.path), 0
        names, pieces = self._choice.names, self._read_pieces()
        single = names and not names.listed and len(names.columns) == 1
        return _join_rows(pieces, self._source.path) if single else pieces

    def _read_pieces(self):
        in_doubt = self._choice.time_in_doubt
        for arrays, rows in self._source.blocks(self._losses):
            columns = self._read({k: unify(array) for k, array in arrays.items()}, rows)
            if len(columns.rows):
                if in_doubt:
                    _require_seconds(columns.time, self._source.path)
                in_doubt = False
                yield columns

    def _read(self, arrays, rows):
        """The rows that have a time and a value."""
        choice, names = self._choice, None
        times = [arrays[k] for k in choice.time]
        if len(times) == 2:
            time, stamp = read_pairs(*(read_times(one, 1.0)[0] for one in times))
        else:
            time, stamp = read_times(times[0], choice.time_scale)
        values = {quantity: self._read_values(one, arrays, rows) for quantity, one in choice.quantities.items() if one}
        if choice.names:
            names = self._place(values, read_row_names(choice.names, arrays), rows)
        empty = self._are_empty(values, names, arrays, rows)
        self.without_values += int(empty.sum())
        untimed = np.isnan(time)
        if (lost := np.flatnonzero(untimed & ~empty)).size:
            texts = [one[lost[0]][:40] for one in map(read_texts, times) if one is not None]
            example = " and ".join(map(repr, texts))
            self._lose(rows, "", "no time, or one that is no number", LEFT_OUT, lost, example)
        fields = [values.get(quantity) for quantity in choice.quantities]
        return Columns(time, stamp, *fields, rows, names).select(~(untimed | empty))

    def _read_values(self, quantity, arrays, rows):
        """Values of a quantity in SI units, (n, k)."""
        scale = np.ones(1) if isinstance(quantity.scale, Mapping) else quantity.scale
        if not quantity.whole:
            values = np.full((len(rows), len(quantity.columns)), np.nan)
            for joint, k in enumerate(quantity.columns):
                if k is not None:
                    values[:, joint] = read_numbers(arrays[k], self._lose_in_column(k, rows))
            return values * scale
        k = quantity.columns[0]
        values = read_lists(arrays[k], None if self._choice.names else len(self.joints), self._lose_in_column(k, rows))
        if values.shape[1] != len(scale):
            if len(set(scale.tolist())) > 1:
                expected = "expected one number, or one by joint, for rows that name different joints"
                raise InputError(f"scale has {len(scale)} numbers; {expected}.")
            scale = scale[:1]
        return values * scale

    def _lose(self, rows, before, cause, unit, lost, example):
        """Count a loss in some of the rows."""
        self._losses.add(cause, f"{self.unit} {rows[lost[0]]}", unit, len(lost), before + example)

    def _lose_in_column(self, k, rows):
        return partial(self._lose, rows, f"column '{self._source.headers[k]}': ")

    def _are_empty(self, values, names, arrays, rows):
        """Whether rows have neither a value nor the name of any joint, and no NaN in place of one."""
        empty = np.ones(len(rows), bool) if names is None else (names == "").all(axis=1)
        for one in values.values():
            empty &= np.isnan(one).all(axis=1)
        for k in self._choice.values if empty.any() else ():
            empty &= are_blank(arrays[k])
        return empty

    def _place(self, values, names, rows):
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
                lost, example = np.nonzero(odd)[0], f"{quantity} {one[odd][0]:g}"
                self._lose(rows, "", "values without the name of a joint", "values left out", lost, example)
                one[odd] = np.nan
        return names


def _require_seconds(time, path):
    """Reject times that in seconds would be beyond the year 5138."""
    middle = float(np.nanmedian(np.abs(time)))
    if 1e11 <= middle < np.inf:
        unit = "ms" if middle < 1e14 else "us" if middle < 1e17 else "ns"
        say = f"say what they are by `scale: {{time: {unit}}}` in the map of columns"
        raise InputError(f"'{path}': times are about {middle:.6g}, which in seconds is no time: {say}.")


def _widen(values, width, fill):
    return np.pad(values, ((0, 0), (0, width - values.shape[1])), constant_values=fill)


# --- Rows of single joints ---


def _join_rows(pieces, path):
    """Yield rows of single joints at one time as one row; the last time waits for its other rows."""
    held, one_joint = None, True
    for columns in pieces:
        if held:
            pairs = zip(held, columns, strict=True)
            columns = Columns(*(None if a is None else np.concatenate([a, b]) for a, b in pairs))
        name, stamp = columns.names[:, 0], columns.stamp
        others = np.flatnonzero(name != name[0])
        if one_joint and others.size:
            k, one_joint = others[0], False
            if stamp[k] < stamp[k - 1]:
                order = f"rows are in the order of joints, '{name[0]}' before '{name[k]}'"
                again = f"times begin again at {columns.time[k]:g} s"
                raise InputError(f"'{path}': {order}; {again}. Sort the rows by time.")
        starts = _find_starts(columns)
        held = columns.select(slice(starts[-1], None))
        if len(starts) > 1:
            yield _join(columns.select(slice(starts[-1])), starts[:-1])
    if held:
        yield _join(held, [0])


def _find_starts(columns):
    """First row of each time: rows of one time that name different joints belong together."""
    starts, there, last = [], set(), None
    for k, (stamp, name) in enumerate(zip(columns.stamp.tolist(), columns.names[:, 0].tolist(), strict=True)):
        if stamp != last or name in there:
            starts.append(k)
            there, last = set(), stamp
        there.add(name)
    return starts


def _join(columns, starts):
    """Rows from each start on as one."""
    counts = np.diff([*starts, len(columns.rows)])
    row = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(columns.rows)) - np.array(starts)[row]
    wide = {}
    for field in ("position", "velocity", "effort", "names"):
        if (values := getattr(columns, field)) is not None:
            wide[field] = np.full((len(starts), counts.max()), "" if field == "names" else np.nan, values.dtype)
            wide[field][row, place] = values[:, 0]
    return columns.select(starts)._replace(**wide)
