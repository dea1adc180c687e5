# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Several files side by side as one table, by their times or by their rows; such as q.csv, qd.csv and tau.csv."""

from functools import reduce
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.cells import read_times, unify
from diag_dynamics.recordings.tables.choice import choose
from diag_dynamics.recordings.tables.headers import find_quantity, parse_header, time_columns
from diag_dynamics.recordings.tables.table import LEFT_OUT, ROWS


class _AllColumns(NamedTuple):
    """All columns of one file, in place of a Choice."""

    columns: list
    texts: list
    values = frozenset()

    @property
    def used(self):
        return range(len(self.columns))

    @property
    def time(self):
        return next(iter(time_columns(self.columns).values()), ())


def take_all(columns, _wanted, _joints, _path, texts=()):
    """Return all columns of a file."""
    return _AllColumns(columns, list(texts))


class JoinedSource:
    """Rows of several files; a column without a quantity gets that of its file: elbow in q.csv is position.elbow."""

    unit = "row"

    def __init__(self, path, parts, wanted, joints):
        self.path, self._parts = path, parts
        every = [part.choice for part in parts]
        timed = [] if wanted.rate else [k for k, one in enumerate(every) if one.time]
        self._by_time = len(timed) == len(parts)
        self._places = [
            (n, k)
            for n, one in enumerate(every)
            for k in one.used
            if k not in one.time or timed[:1] == [n]
        ]
        columns = [
            _named_column(every[n].columns[k], parts[n].path, joints) for n, k in self._places
        ]
        self.headers = [one.name for one in columns]
        texts = [text for one in every for text in one.texts]
        self.choice = choose(columns, wanted, joints, path, texts)
        by = "times" if self._by_time else "row numbers"
        self.notes = [
            f"files: {len(parts)} side by side, by {by}.",
            *(note for one in parts for note in one.notes),
        ]

    def blocks(self, lose):
        """Yield arrays by index of the column, and the number of each row; all files are in memory."""
        tables, keys = zip(*(self._read_part(part, lose) for part in self._parts), strict=True)
        shared = reduce(np.intersect1d, keys)
        for part, key in zip(self._parts, keys, strict=True):
            if not self._by_time and key[-1:].tolist() != keys[0][-1:].tolist():
                counts = f"{len(key)} rows, and '{self._parts[0].path}' {len(keys[0])}"
                raise InputError(
                    f"'{part.path}' has {counts}; expected the same number, or times in each file."
                )
            if 2 * len(shared) < len(key):
                counts = f"{len(shared)} of the {len(key)} times in '{part.path}' are in all of '{self.path}'"
                raise InputError(
                    f"{counts}; expected the same times. Interpolate the files at common times."
                )
            if lost := len(key) - len(shared):
                lose(f"times of '{part.path}' that not all files have", "row 0", LEFT_OUT, lost)
        rows = [
            first[np.isin(key, shared)]
            for key, first in (np.unique(key, return_index=True) for key in keys)
        ]
        for begin in range(0, len(rows[0]), ROWS):
            some = [pa.array(one[begin : begin + ROWS]) for one in rows]
            taken = {k: self._places[k] for k in self.choice.used}
            yield (
                {k: tables[n][column].take(some[n]) for k, (n, column) in taken.items()},
                rows[0][begin : begin + ROWS],
            )

    def _read_part(self, part, lose):
        """Return the arrays of a file by column, and the stamp or the number of each row."""
        pieces = [one for one in part.blocks(lose) if len(one[1])]
        if not pieces:
            raise InputError(f"'{part.path}' has no rows.")
        blocks, rows = zip(*pieces, strict=True)
        arrays = {k: pa.concat_arrays([unify(one[k]) for one in blocks]) for k in part.choice.used}
        key = np.concatenate(rows) - rows[0][0]
        if self._by_time:
            key = sum(
                read_times(arrays[k], scale)[1]
                for k, scale in zip(part.choice.time, (1.0, 1e-9), strict=False)
            )
        return arrays, key


def _named_column(column, path, joints):
    """Return a column with the quantity of its file before its name, if that has none and is no time."""
    if time_columns([column]) or parse_header(column, sorted(joints, key=len, reverse=True)):
        return column
    stem = Path(path).name.partition(".")[0]
    quantity = find_quantity(stem.lower())
    return column._replace(name=f"{quantity.lastgroup if quantity else stem}.{column.name}")
