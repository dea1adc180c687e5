# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text with a row on each line: CSV, TSV and the like, packed or not."""

from functools import partial

from diag_dynamics.tables.chosen import choose
from diag_dynamics.tables.csv_arrow import ByArrow
from diag_dynamics.tables.csv_head import BOM, head
from diag_dynamics.tables.csv_plain import LONGEST, ByLine
from diag_dynamics.tables.packed import chunks
from diag_dynamics.tables.pieces import ROWS, Read, piece, refuse_doubtful
from diag_dynamics.tables.together import Together
from diag_dynamics.tables.unread import Losses

_MOST = 1 << 25
"""Bytes that are read at a time."""


class CsvReader:
    """Rows of a text in pieces.

    A line is a row: there are no line breaks in quotes, so that a quote that was lost does not take the rest of the file with
    it. A row with another number of columns than the header is left out (empty fields at its end do not count), and so is one
    without a time. Any other field that is no number is NaN. Lines that begin with # are comments.

    Parameters
    ----------
    path : str
    wanted : ColumnMap
    joints : sequence of str
        The model's, in their order; empty: not known.

    Attributes
    ----------
    joints : tuple of str
    notes : tuple of str
        How the columns were understood; complete when all pieces have been read.
    without_values : int
        Rows that have no value of any joint; likewise.
    unread : list of Unread
        Complete when all pieces have been read.
    """

    def __init__(self, path, wanted, joints):
        self._path = path
        self._losses = Losses(path)
        self._head = head(path, wanted, joints)
        self._choice = choose(self._head.columns, wanted, joints, path, self._head.texts)
        self._arrow = ByArrow.there(self._head, self._choice, wanted.decimal)
        self._plain = ByLine(self._head, self._choice, wanted.decimal)
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
        """Each piece as :class:`Columns`; a second call begins anew.

        Raises
        ------
        InputError
            The unit of the times is in doubt.
        """
        self._losses = Losses(self._path)
        row, first = 0, True
        together = Together(self._choice, self._path)
        for line, block in self._blocks():
            rows = self._arrow.rows(block, line, row, self._losses) if self._arrow else None
            rows = rows or self._plain.rows(block, line, row, self._losses)
            where = partial(_line, rows.lines)
            read = Read(*rows.times(), rows.indices, rows.numbers, rows.texts, rows.blank, where)
            columns = piece(self._choice, read, self._losses)
            row = rows.following
            if len(columns.rows):
                if first:
                    refuse_doubtful(self._choice, columns.time, self._path)
                first = False
                yield from together.take(columns)
        yield from together.end()
        if not row:
            self._losses.add("there is no row below the header", f"line {self._head.lines + 1}", "")

    # --- Blocks ---

    def _blocks(self):
        """Whole lines of about ROWS rows, and the number of the first of them."""
        broken, held, size, line, skip = [], [], 0, 1, self._head.lines
        limit = usual = min(ROWS * self._head.length, _MOST)
        for chunk in chunks(self._path, broken.append):
            held.append(chunk)
            size += len(chunk)
            if size < limit:
                continue
            text = b"".join(held)
            end = text.rfind(b"\n") + 1
            if not end:  # a long line is cut as long as it is; what is left of it is left out
                held, size = [text[: LONGEST + 1]], min(size, LONGEST + 1)
                limit = size + usual
                continue
            count = text.count(b"\n", 0, end)
            yield from _below(skip, line, text[:end])
            line += count
            held, size, limit = [text[end:]], len(text) - end, usual
        text = b"".join(held)
        if broken:
            end = text.rfind(b"\n") + 1
            text, rest = text[:end], text[end:]
            lost = ", and with it the row in which it breaks off" if rest else ""
            count = text.count(b"\n")
            self._losses.add(f"{broken[0]}: all behind this line is lost{lost}", f"line {line + count - 1}", "")
        if text:
            yield from _below(skip, line, text)


def _line(lines, k):
    return f"line {lines[k]}"


def _below(skip, line, text):
    """Lines below the header, and the number of the first of them; nothing if there are none."""
    begin = 0
    if line == 1:
        text = text.removeprefix(BOM)
    while line <= skip:
        begin = text.find(b"\n", begin) + 1
        if not begin:
            return
        line += 1
    if begin < len(text):
        yield line, text[begin:]
