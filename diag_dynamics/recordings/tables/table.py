# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of any table as columns of joints, in pieces and SI units."""

import re
from functools import partial
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.recordings.messages import Unread
from diag_dynamics.recordings.tables.cells import (
    are_blank,
    read_lists,
    read_numbers,
    read_texts,
    read_times,
    unify,
)
from diag_dynamics.recordings.tables.column_map import QUANTITIES
from diag_dynamics.recordings.tables.names_in_data import read_row_names

ROWS = 20_000  # about as many are in a piece
LEFT_OUT = "rows omitted"
_DECIMAL_COMMA = re.compile(r"'[-+]?\d+,\d+(?:e[-+]?\d+)?'", re.IGNORECASE)


class Columns(NamedTuple):
    """Rows that have a time; a value that is missing or no number is NaN."""

    time: np.ndarray  # [s], float64, shape (n,)
    stamp: np.ndarray  # [ns], int64, likewise: exact where the file is; cut at ±4e18
    position: np.ndarray  # [rad, m], float64, shape (n, k): a column for each joint
    velocity: np.ndarray | None  # [rad/s, m/s], likewise; None where the file has none
    effort: np.ndarray | None  # [N m, N], likewise
    rows: np.ndarray  # line of a text, or row of another file from 0: int64, shape (n,)
    names: np.ndarray | None = (
        None  # joint of each value, str, shape (n, k), empty for none; None: those of the table
    )

    def select(self, which):
        """Return some of the rows."""
        return Columns(*(None if one is None else one[which] for one in self))


class Table:
    """Rows of a table in pieces; `notes` tell how columns were read, `unread` what was lost.

    `unit`, ``line`` or ``row``, is what `Columns.rows` counts. `unread` and the number of rows `without_values` are complete
    after the last piece.
    """

    def __init__(self, source):
        self._source, self._choice, self.without_values, self._losses = source, source.choice, 0, {}
        self.currents, self._first = source.choice.currents, None  # number of the first row
        self.joints, self.unit, self.notes = (
            source.choice.joints,
            source.unit,
            [*source.choice.notes, *source.notes],
        )

    @property
    def unread(self):
        """Unreadable data, a list of Unread."""
        return [
            Unread(
                self._source.path, where, cause + example + (f": {count} {unit}" if unit else "")
            )
            for (cause, unit), (where, example, count) in self._losses.items()
        ]

    def _lose(self, cause, where, unit="", count=1, example=""):
        """Count a loss of so many units, such as ``rows omitted``; place and example of the first are kept."""
        if self.unit == "line" and _DECIMAL_COMMA.search(example):
            example += "; decimal commas need decimal: ',' in a column map"
        self._losses.setdefault((cause, unit), [where, f" ({example})" if example else "", 0])[
            2
        ] += count

    def pieces(self):
        """Yield pieces as :class:`Columns`, once."""
        names = self._choice.names
        held, checked, single = None, False, names and not names.listed and len(names.columns) == 1
        count = 0
        for arrays, rows in self._source.blocks(self._lose):
            count += len(rows)
            columns = self._read({k: unify(array) for k, array in arrays.items()}, rows)
            if not (checked or self._choice.time_scale) and len(columns.rows):
                _require_seconds(columns.time, self._source.path)
                checked = True
            if single:  # the last time waits for its other rows
                columns, held = _join_rows(held, columns, self._source.path)
            if len(columns.rows):
                yield columns
        if held and len(held.rows):
            yield _join(held, np.zeros(1, int))
        if not count:
            self._lose("there are no rows", "end")

    def _read(self, arrays, rows):
        """Return the rows that have a time and a value."""
        choice, names = self._choice, None
        times = [arrays[k] for k in choice.time]
        time, stamp = (
            read_times(times[0], choice.time_scale or 1.0) if times else self._count_times(rows)
        )
        for nanoseconds in times[1:]:
            more = read_times(nanoseconds, 1e-9)
            time, stamp = time + more[0], stamp + more[1]
        values = {
            name: self._read_values(one, arrays, rows)
            for name, one in choice.quantities.items()
            if one
        }
        if choice.names:
            names = self._name_values(values, read_row_names(choice.names, arrays), rows)
        empty = self._are_empty(values, names, arrays, rows)
        self.without_values += int(empty.sum())
        untimed = np.isnan(time)
        if (lost := np.flatnonzero(untimed & ~empty)).size:
            texts = [one[lost[0]][:40] for one in map(read_texts, times) if one is not None]
            example = " and ".join(map(repr, texts))
            self._lose_rows(
                rows, "", "no time, or a time that is no number", LEFT_OUT, lost, example
            )
        columns, left_out = (
            Columns(time, stamp, *map(values.get, QUANTITIES), rows, names),
            untimed | empty,
        )
        return columns.select(~left_out) if left_out.any() else columns

    def _count_times(self, rows):
        """Return times and stamps of rows that follow at a rate; lost rows have theirs too."""
        self._first = int(rows[0]) if self._first is None and len(rows) else self._first
        time = (rows - (self._first or 0)) * self._choice.time_scale
        return time, np.rint(time * SECOND).astype(np.int64)

    def _read_values(self, quantity, arrays, rows):
        """Return values of a quantity in SI units, (n, k)."""
        if quantity.whole:
            k, width = quantity.columns[0], None if self._choice.names else len(self.joints)
            values = read_lists(arrays[k], width, self._lose_in_column(k, rows))
        else:
            values = np.full((len(rows), len(quantity.columns)), np.nan)
            for joint, k in enumerate(quantity.columns):
                if k is not None:
                    values[:, joint] = read_numbers(arrays[k], self._lose_in_column(k, rows))
        return values if (quantity.scale == 1.0).all() else values * quantity.scale

    def _lose_rows(self, rows, before, cause, unit, lost, example):
        self._lose(cause, f"{self.unit} {rows[lost[0]]}", unit, len(lost), before + example)

    def _lose_in_column(self, k, rows):
        return partial(self._lose_rows, rows, f"column '{self._source.headers[k]}': ")

    def _are_empty(self, values, names, arrays, rows):
        """Return whether rows have neither a value nor the name of any joint, and no NaN in place of one."""
        empty = np.ones(len(rows), bool) if names is None else (names == "").all(axis=1)
        for one in values.values():
            empty &= np.isnan(one).all(axis=1)
        for k in self._choice.values if empty.any() else ():
            empty &= are_blank(arrays[k])
        return empty

    def _name_values(self, values, names, rows):
        """Return the names, with values and names padded to one width; count values without a name as lost."""
        width = max(one.shape[1] for one in (names, *values.values()))
        names = _widen(names, width, "")
        for quantity, one in values.items():
            values[quantity] = one = _widen(one, width, np.nan)
            odd = (names == "") & ~np.isnan(one)
            if odd.any():
                example = f"{quantity} {one[odd][0]:g}"
                cause = "values without the name of a joint"
                self._lose_rows(rows, "", cause, "values omitted", np.nonzero(odd)[0], example)
        return names


def _require_seconds(time, path):
    """Reject times that in seconds would be beyond the year 5138."""
    middle = float(np.nanmedian(np.abs(time)))
    if 1e11 <= middle < np.inf:
        unit = "ms" if middle < 1e14 else "us" if middle < 1e17 else "ns"
        raise InputError(
            f"'{path}': times are about {middle:.6g}; expected seconds. Set `scale: {{time: {unit}}}` in a column map."
        )


def _widen(values, width, fill):
    return np.pad(values, ((0, 0), (0, width - values.shape[1])), constant_values=fill)


# --- Rows of single joints ---


def _join_rows(held, columns, path):
    """Return rows of single joints as one of each time, and those of the last time, which may be incomplete."""
    if held:
        pairs = zip(held, columns, strict=True)
        columns = Columns(*(None if a is None else np.concatenate([a, b]) for a, b in pairs))
    stamp, name = columns.stamp, columns.names[:, :1].ravel()
    back = np.flatnonzero((stamp[1:] < stamp[:-1]) & (name[1:] != name[:-1]))
    if back.size and (name[: back[0] + 1] == name[0]).all():
        order = f"rows are in the order of joints, '{name[0]}' before '{name[back[0] + 1]}'"
        raise InputError(f"'{path}': {order}. Sort the rows by time.")
    starts = np.flatnonzero(np.diff(stamp, prepend=stamp[:1] - 1))
    if len(starts) < 2:
        return columns.select(slice(0)), columns
    return _join(columns.select(slice(starts[-1])), starts[:-1]), columns.select(
        slice(starts[-1], None)
    )


def _join(columns, starts):
    """Return the rows from each start on as one."""
    counts = np.diff([*starts, len(columns.rows)])
    row = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(columns.rows)) - starts[row]
    wide = {}
    for field in (*QUANTITIES, "names"):
        if (values := getattr(columns, field)) is not None:
            wide[field] = np.full(
                (len(starts), counts.max()), "" if field == "names" else np.nan, values.dtype
            )
            wide[field][row, place] = values[:, 0]
    return columns.select(starts)._replace(**wide)
