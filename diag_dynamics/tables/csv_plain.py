# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of text line by line: every line that is none, and every field that is no number, by its place."""

import numpy as np

from diag_dynamics.tables import times
from diag_dynamics.tables.csv_head import MISSING, fields_of
from diag_dynamics.tables.pieces import LEFT_OUT

LONGEST = 1 << 20
"""Bytes of a line."""

WRONG_COUNT = "another number of columns than the header has"
NO_NUMBER = "text where a number belongs"
NUL = "NUL bytes, as files have them of a machine that lost its power"
TOO_LONG = f"line of more than {LONGEST} bytes"


class ByLine:
    """Reads blocks of lines by what Python has for it.

    Parameters
    ----------
    head : Head
    choice : Choice
    decimal : {'.', ','}
    """

    def __init__(self, head, choice, decimal):
        self.names = [column.name for column in head.columns]
        self.choice, self.decimal = choice, decimal
        self._delimiter = head.delimiter

    def rows(self, block, line, row, losses):
        """Rows of a block.

        Parameters
        ----------
        block : bytes
        line : int
            Number of its first line.
        row : int
            Number of its first row.
        losses : Losses
        """
        count, kept, lines, indices = len(self.names), [], [], []
        for at, text in enumerate(block.decode("latin-1").split("\n"), line):
            if text.startswith("#") or not text.strip():
                continue
            problem, example, fields = "", "", []
            if len(text) > LONGEST:
                problem = TOO_LONG
            elif "\0" in text:
                problem = NUL
            else:
                fields = fields_of(text, self._delimiter)
                if len(fields) > count and not any(field.strip() for field in fields[count:]):
                    del fields[count:]
                if len(fields) != count:
                    problem, example = WRONG_COUNT, f"{len(fields)} instead of {count}"
            if problem:
                losses.add(problem, f"line {at}", LEFT_OUT, example=example)
            else:
                kept.append(fields)
                lines.append(at)
                indices.append(row)
            row += 1
        return _Rows(self, kept, lines, np.array(indices, np.int64), row, losses)


class _Rows:
    """Rows of one block as text."""

    def __init__(self, reader, rows, lines, indices, following, losses):
        self._reader, self._rows, self._losses = reader, rows, losses
        self.lines, self.indices, self.following = lines, indices, following

    def times(self):
        """Times and stamps."""
        choice = self._reader.choice
        texts = [[row[k] for row in self._rows] for k in choice.time]
        return times_of(texts, choice.time_scale, self._reader.decimal)

    def numbers(self, column):
        """Numbers of a column, NaN where there are none."""
        texts = [row[column] for row in self._rows]
        try:
            if any("_" in text or "," in text or ("." in text and self._reader.decimal == ",") for text in texts):
                raise ValueError
            return np.array(list(map(float, texts)), float)
        except ValueError:
            return np.array([self._number(text, column, at) for text, at in zip(texts, self.lines, strict=True)], float)

    def _number(self, text, column, line):
        """The number of a field, or NaN."""
        plain = text.strip()
        if plain in MISSING:
            return np.nan
        try:
            if "_" in plain or (self._reader.decimal == "," and "." in plain):
                raise ValueError
            return float(plain.replace(",", ".") if self._reader.decimal == "," else plain)
        except ValueError:
            example = f"column '{self._reader.names[column]}': '{plain[:40]}'"
            self._losses.add(NO_NUMBER, f"line {line}", "fields are NaN", example=example)
            return np.nan


def times_of(texts, scale, decimal):
    """Times and stamps of texts in one column, or in two: seconds and nanoseconds."""
    if decimal == ",":
        texts = [
            [text if times.is_date(text) else "" if "." in text else text.replace(",", ".") for text in column]
            for column in texts
        ]
    if len(texts) == 2:
        return times.of_pairs(*(times.of_texts(column, 1.0)[0] for column in texts))
    return times.of_texts(texts[0], scale)
