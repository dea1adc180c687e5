# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Several files side by side as one table, row by row."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.recordings.tables import conventions
from diag_dynamics.recordings.tables.cells import read_times, unify
from diag_dynamics.recordings.tables.table import ROWS


class JoinedTable:
    """Rows of several files; a column without a quantity gets that of its file.

    Column elbow of q.csv is position.elbow.
    """

    unit = "row"

    def __init__(self, path, parts, rate):
        self.path = path
        self._parts = parts
        self._times = [[] if rate else _find_times(part) for part in parts]
        self._first = next((n for n, times in enumerate(self._times) if times), 0)
        self._places = [
            (n, k)
            for n, part in enumerate(parts)
            for k in range(len(part.columns))
            if n == self._first or k not in self._times[n]
        ]
        self.columns = [_name_column(parts[n], k) for n, k in self._places]
        self.texts = [text for part in parts for text in part.texts]

    def blocks(self, numbers, texts, lose):
        """Yield arrays by column, and the number of each row; all files are in memory."""
        parts = [self._read_part(n, numbers, texts, lose) for n in range(len(self._parts))]
        tables, rows, stamps = zip(*parts, strict=True)
        for n, part in enumerate(self._parts):
            is_same = not self._times[n] or np.array_equal(
                stamps[n], stamps[self._first], equal_nan=True
            )
            if not (is_same and np.array_equal(rows[n], rows[0])):
                raise InputError(
                    f"rows of '{part.path}' and '{self._parts[self._first].path}' differ; expected "
                    "the same number and times. Interpolate the files at common times."
                )
        for begin in range(0, len(rows[0]), ROWS):
            places = {k: self._places[k] for k in (*numbers, *texts)}
            arrays = {k: tables[n][column].slice(begin, ROWS) for k, (n, column) in places.items()}
            yield arrays, rows[0][begin : begin + ROWS]

    def _read_part(self, n, numbers, texts, lose):
        """Return the arrays of a file by column, the numbers of rows from 0, and their stamps."""
        part = self._parts[n]
        times = self._times[n]
        numbers, texts = (
            [self._places[k][1] for k in columns if self._places[k][0] == n]
            for columns in (numbers, texts)
        )
        texts = list(dict.fromkeys([*texts, *times]))
        pieces = [piece for piece in part.blocks(numbers, texts, lose) if len(piece[1])]
        if not pieces:
            raise InputError(f"'{part.path}' has no rows.")
        blocks, rows = zip(*pieces, strict=True)
        arrays = {k: pa.concat_arrays([unify(block[k]) for block in blocks]) for k in blocks[0]}
        stamps = np.rint(read_times(arrays[times[0]], 1.0) * SECOND) if times else ()
        return arrays, np.concatenate(rows) - rows[0][0], stamps


def _find_times(part):
    """Return the number of the column of times of a file in a list; empty without any."""
    times = [k for k, column in enumerate(part.columns) if conventions.match_time(column)]
    return [conventions.find_time(part.columns)] if times else []


def _name_column(part, k):
    """Return a column with the quantity of its file before its name, if that has none."""
    column = part.columns[k]
    quantity = conventions.find_quantity(Path(part.path).name)
    if conventions.match_time(column) or conventions.find_quantity(column.name) or not quantity:
        return column
    return column._replace(name=f"{quantity}.{column.name}")
