# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of text by pyarrow, many times as fast as line by line: blocks in which every line is a row of numbers."""

from importlib import import_module

import numpy as np

from diag_dynamics.tables import times
from diag_dynamics.tables.csv_head import BLANK, SPACES
from diag_dynamics.tables.csv_plain import are_blank, listed_numbers, times_of


class ByArrow:
    """Reads blocks of lines, or leaves them to :class:`ByLine`, which finds out what is wrong with them.

    Parameters
    ----------
    arrow : module
        pyarrow, its csv and its compute imported.
    head : Head
    choice : Choice
    decimal : {'.', ','}
    """

    def __init__(self, arrow, head, choice, decimal):
        self.arrow, self.choice, self.decimal = arrow, choice, decimal
        csv, used = arrow.csv, choice.used()
        self.listed = {k for k in used if head.columns[k].width}
        texts = {*choice.time, *choice.texts(), *self.listed}
        self.names = [column.name for column in head.columns]
        names = [str(k) for k in range(len(head.columns))]  # those in the file may be there twice
        # With Arrow's threads six of 148 processes were aborted at their end, without none of 220; a block takes as long.
        self._read = csv.ReadOptions(column_names=names, block_size=1 << 26, use_threads=False)
        self._parse = csv.ParseOptions(delimiter=head.delimiter)
        self._convert = csv.ConvertOptions(
            column_types={str(k): arrow.string() if k in texts else arrow.float64() for k in used},
            include_columns=[str(k) for k in used],
            null_values=sorted(BLANK),
            strings_can_be_null=False,
            decimal_point=decimal,
        )

    @classmethod
    def there(cls, head, choice, decimal):
        """One of them; None where pyarrow is not installed, or any number of spaces separates columns."""
        if head.delimiter == SPACES:
            return None
        try:
            for name in ("csv", "compute"):
                import_module(f"pyarrow.{name}")
        except ImportError:
            return None
        return cls(import_module("pyarrow"), head, choice, decimal)

    def rows(self, block, line, row, losses):
        """Rows of a block, as of :meth:`ByLine.rows`; None if any line of it is no row, or any field no number."""
        if b"\0" in block or block.startswith(b"#") or b"\n#" in block:
            return None
        try:
            read = self.arrow.csv.read_csv(self.arrow.BufferReader(block), self._read, self._parse, self._convert)
        except self.arrow.ArrowException:
            return None
        lines = block.count(b"\n") + (not block.endswith(b"\n"))
        if read.num_rows != lines:  # empty lines, or some between quotes
            return None
        return _Rows(self, read, range(line, line + lines), np.arange(row, row + lines), row + lines, losses)


class _Rows:
    """Rows of one block as a table of pyarrow's."""

    def __init__(self, reader, read, lines, indices, following, losses):
        self._reader, self._read, self._losses = reader, read, losses
        self.lines, self.indices, self.following = lines, indices, following

    def times(self):
        """Times and stamps."""
        choice, arrow = self._reader.choice, self._reader.arrow
        columns = [self._read.column(str(k)) for k in choice.time]
        try:
            floats = [arrow.compute.cast(column, arrow.float64()).to_numpy() for column in columns]
        except arrow.ArrowException:  # dates, or a text
            floats = []
        if len(floats) == 2:
            return times.of_pairs(*floats)
        if floats and times.survive_as_doubles(floats[0] * choice.time_scale):
            return times.of_floats(floats[0], choice.time_scale)
        return times_of([column.to_pylist() for column in columns], choice.time_scale, self._reader.decimal)

    def name_of(self, column):
        """Header of a column."""
        return self._reader.names[column]

    def texts(self, column):
        """Texts of a column."""
        return self._read.column(str(column)).to_pylist()

    def blank(self, column):
        """Whether cells of a column have nothing in them."""
        if column in self._reader.listed:
            return are_blank(self.texts(column))
        return self._read.column(str(column)).is_null().to_numpy()

    def numbers(self, column):
        """Numbers of a column, NaN where there are none."""
        if column in self._reader.listed:
            return listed_numbers(self, self._reader.choice, column, self._losses)
        return self._read.column(str(column)).to_numpy()
