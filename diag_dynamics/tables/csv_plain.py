# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of text line by line: every line that is none, and every field that is no number, by its place."""

import numpy as np

from diag_dynamics.tables import times
from diag_dynamics.tables.csv_head import BLANK, MISSING, fields_of
from diag_dynamics.tables.names import numbers_of, padded
from diag_dynamics.tables.pieces import LEFT_OUT, of_one_length

LONGEST = 1 << 20
"""Bytes of a line."""

WRONG_COUNT = "another number of columns than the header has"
NO_NUMBER = "text where a number belongs"
NO_LIST = "text where a list of numbers belongs"
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
        self.listed = {k for k, column in enumerate(head.columns) if column.width}
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

    def name_of(self, column):
        """Header of a column."""
        return self._reader.names[column]

    def texts(self, column):
        """Texts of a column."""
        return [row[column] for row in self._rows]

    def blank(self, column):
        """Whether cells of a column have nothing in them."""
        return are_blank(self.texts(column))

    def numbers(self, column):
        """Numbers of a column, NaN where there are none."""
        if column in self._reader.listed:
            return listed_numbers(self, self._reader.choice, column, self._losses)
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


def are_blank(texts):
    """Return whether texts stand for nothing: bool, shape (n,)."""
    return np.array([text is None or text.strip() in BLANK or text.strip() in ("[]", "()") for text in texts], bool)


def listed_numbers(rows, choice, column, losses):
    """Numbers of a column of lists in text, (n, k): NaN where a list is too short, or has another length than others."""
    lists = [numbers_of(text) for text in rows.texts(column)]
    odd = [k for k, one in enumerate(lists) if one is None and rows.texts(column)[k].strip() not in MISSING]
    if odd:
        text = rows.texts(column)[odd[0]].strip()[:40]
        example = f"column '{rows.name_of(column)}': '{text}'"
        losses.add(NO_LIST, f"line {rows.lines[odd[0]]}", "rows of it are NaN", len(odd), example)
    values, lengths = padded([one or () for one in lists])
    if choice.names:
        return values
    name = rows.name_of(column)
    return of_one_length(values, lengths, len(choice.joints), losses, lambda k: f"line {rows.lines[k]}", name)


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
