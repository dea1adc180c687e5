# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Several files side by side as one table, by their times or by their rows."""

from functools import reduce
from pathlib import Path

import numpy as np
import pyarrow as pa

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables import conventions
from diag_dynamics.recordings.tables.cells import read_times, unify
from diag_dynamics.recordings.tables.table import LEFT_OUT, ROWS


class JoinedTable:
    """Rows of several files; a column without a quantity gets that of its file.

    Column elbow of q.csv is position.elbow.
    """

    unit = "row"

    def __init__(self, path, parts, rate):
        self.path, self._parts = path, parts
        times = [[] if rate else _find_times(part) for part in parts]
        self._times = times if all(times) else None
        first = next((n for n, columns in enumerate(times) if columns), None)
        self._places = [
            (n, k)
            for n, part in enumerate(parts)
            for k in range(len(part.columns))
            if n == first or k not in times[n]
        ]
        self.columns = [_name_column(parts[n], k) for n, k in self._places]
        self.texts = [text for part in parts for text in part.texts]

    @property
    def notes(self):
        """How the files were read: a list of str."""
        by = "times" if self._times else "row numbers"
        notes = [note for part in self._parts for note in part.notes]
        return [f"files: {len(self._parts)} side by side, by {by}.", *notes]

    def blocks(self, numbers, others, lose):
        """Yield arrays by column, and the number of each row; all files are in memory."""
        parts = [self._read_part(n, numbers, others, lose) for n in range(len(self._parts))]
        tables, keys = zip(*parts, strict=True)
        shared = reduce(np.intersect1d, keys)
        for part, key in zip(self._parts, keys, strict=True):
            if not self._times and key[-1:].tolist() != keys[0][-1:].tolist():
                counts = f"{len(key)} rows, and '{self._parts[0].path}' {len(keys[0])}"
                expected = "expected the same number, or times in each file"
                raise InputError(f"'{part.path}' has {counts}; {expected}.")
            if 2 * len(shared) < len(key):
                counts = f"{len(shared)} of {len(key)} times in '{part.path}' are in all of"
                advice = "Interpolate the files at common times"
                raise InputError(f"{counts} '{self.path}'; expected the same times. {advice}.")
            if lost := len(key) - len(shared):
                lose(f"times of '{part.path}' that not all files have", "row 0", LEFT_OUT, lost)
        rows = []
        for key in keys:
            unique, first = np.unique(key, return_index=True)
            rows.append(first[np.isin(unique, shared)])
        for begin in range(0, len(rows[0]), ROWS):
            chosen = [pa.array(part[begin : begin + ROWS]) for part in rows]
            places = {k: self._places[k] for k in (*numbers, *others)}
            arrays = {k: tables[n][column].take(chosen[n]) for k, (n, column) in places.items()}
            yield arrays, rows[0][begin : begin + ROWS]

    def _read_part(self, n, numbers, others, lose):
        """Return the arrays of a file by column, and the stamp or the number of each row."""
        part, times = self._parts[n], self._times[n] if self._times else []
        numbers, others = (
            [self._places[k][1] for k in columns if self._places[k][0] == n]
            for columns in (numbers, others)
        )
        others = list(dict.fromkeys([*others, *times]))
        pieces = [piece for piece in part.blocks(numbers, others, lose) if len(piece[1])]
        if not pieces:
            raise InputError(f"'{part.path}' has no rows.")
        blocks, rows = zip(*pieces, strict=True)
        arrays = {k: pa.concat_arrays([unify(block[k]) for block in blocks]) for k in blocks[0]}
        key = read_times(arrays[times[0]], 1.0)[1] if times else np.concatenate(rows) - rows[0][0]
        return arrays, key


def _find_times(part):
    """Return the number of the column of times of a file in a list; empty without any."""
    times = [k for k, column in enumerate(part.columns) if conventions.match_time(column)]
    return [conventions.find_time(part.columns)] if times else []


def _name_column(part, k):
    """Return a column with the quantity of its file before its name, if that has none."""
    column, quantity = part.columns[k], conventions.find_quantity(Path(part.path).name)
    if conventions.match_time(column) or conventions.find_quantity(column.name) or not quantity:
        return column
    return column._replace(name=f"{quantity}.{column.name}")
