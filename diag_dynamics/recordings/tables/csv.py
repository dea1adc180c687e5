# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text with a row on each line: CSV, TSV and the like, compressed or not, by pyarrow."""

import csv
import re

import numpy as np
import pyarrow as pa
from pyarrow import csv as arrow_csv

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.bag_messages import describe_error
from diag_dynamics.recordings.bags import first_bytes
from diag_dynamics.recordings.tables.cells import (
    BLANK,
    MISSING,
    SAMPLE,
    is_number,
    make_column,
    unify,
)
from diag_dynamics.recordings.tables.table import LEFT_OUT

SPACES = " "  # as a delimiter: any number of spaces and tabs
MAX_LINE = 1 << 26  # bytes
_CODECS = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bz2",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x04\x22\x4d\x18": "lz4",
}
"""Compressions that are read, by the first bytes."""
_BEGINNING, _BLOCK = 1 << 20, 1 << 22  # bytes with the header and first rows, and of a block
_COMMENTED = 100  # first lines whose comments may name joints
_COMMENT = re.compile(r'#|%[%\s]|"?sep=."?\s*$')
_POINT = re.compile(rb"(?<=\d)(?<!:\d\d)(?<!T\d{6})\.(?=\d)", re.IGNORECASE)
_COMMA = re.compile(rb",(?=\d)")


class CsvTable:
    """Rows of a text. A line is a row: a quote that was lost loses no other line."""

    unit = "line"

    def __init__(self, path, column_map):
        self.path = path
        begin = first_bytes(path)
        codecs = (codec for magic, codec in _CODECS.items() if begin.startswith(magic))
        self._codec = next(codecs, None)
        self._decimal = column_map.decimal
        _, begin = next(self._read_lines(_BEGINNING), (1, b""))
        lines = [_decode(line) for line in begin.split(b"\n")]
        if len(lines) < 2 or "\0" in lines[0]:
            raise InputError(
                f"'{path}' is not readable as CSV, Parquet or npz: its first line is not UTF-8 "
                "text with a line break (LF or CR LF). Unpack files, but for gzip, bz2, zstd, lz4."
            )
        self.columns, self._delimiter, self._above = _read_head(lines, column_map, path)
        self.texts = [
            f"line {at}: {line}"
            for at, line in enumerate(lines[:_COMMENTED], 1)
            if line and (at <= column_map.skip or line[0] in "#%") and at != self._above
        ]

    def blocks(self, numbers, texts, lose):
        """Yield numbers and texts by column, and the number of each line."""
        types = dict.fromkeys(numbers, pa.float64()) | dict.fromkeys(texts, pa.string())
        convert = arrow_csv.ConvertOptions(
            column_types={str(k): kind for k, kind in types.items()},
            include_columns=list(map(str, types)),
            null_values=list(BLANK),
        )
        for line, text in self._read_lines(_BLOCK):
            if line == 1:  # the lines above the rows are all in it
                *above, text = text.split(b"\n", self._above)
                line = self._above + 1
                text = text if len(above) == self._above else b""
            if self._decimal == ",":
                text = _POINT.sub(b"_", text)  # of thousands: no number
                text = _COMMA.sub(b".", text)
            yield self._parse(text, line, convert) or self._parse_lines(text, line, types, lose)

    def _read_lines(self, size):
        """Yield whole lines, about `size` bytes at a time, and the number of the first."""
        text = bytearray()
        line = 1
        try:
            with pa.input_stream(str(self.path), self._codec) as stream:
                while chunk := stream.read(size):
                    text += chunk
                    end = text.rfind(b"\n") + 1
                    if end:
                        yield line, bytes(text[:end]).removeprefix(b"\xef\xbb\xbf")
                        line += text.count(b"\n", 0, end)
                        del text[:end]
                    elif len(text) > MAX_LINE:
                        raise InputError(
                            f"'{self.path}': line {line} has more than {MAX_LINE} bytes."
                        )
        except (OSError, pa.ArrowException) as error:
            raise InputError(
                f"'{self.path}': {describe_error(error)} after line {line}. It is damaged or was "
                "not copied completely: unpack what can be read."
            ) from error
        if text:
            yield line, bytes(text)

    def _parse(self, text, line, convert):
        """Return the columns of a block in which each line is a row; None for others."""
        if text.startswith(b"#") or b"\n#" in text or self._delimiter == SPACES:
            return None
        names = [str(k) for k in range(len(self.columns))]  # headers may be there twice
        read = arrow_csv.ReadOptions(column_names=names, block_size=1 << 27, use_threads=False)
        parse = arrow_csv.ParseOptions(delimiter=self._delimiter)
        try:
            table = arrow_csv.read_csv(pa.BufferReader(text), read, parse, convert)
        except pa.ArrowException:
            return None
        count = text.count(b"\n") + (not text.endswith(b"\n"))
        if table.num_rows != count:  # empty lines, or some between quotes
            return None
        arrays = {int(name): table.column(name).combine_chunks() for name in table.column_names}
        return arrays, np.arange(line, line + count)

    def _parse_lines(self, text, line, used, lose):
        """Return the columns of a block line by line; count lines that are no rows."""
        width = len(self.columns)
        rows = []
        lines = []
        for at, content in enumerate(_decode(text).split("\n"), line):
            if content.startswith("#") or not content.strip():
                continue
            fields = fields_of(content, self._delimiter)
            if not any(field.strip() for field in fields[width:]):
                del fields[width:]
            if len(fields) == width:
                rows.append(fields)
                lines.append(at)
            else:
                lose(
                    "another number of columns than the header has",
                    f"line {at}",
                    LEFT_OUT,
                    example=f"{len(fields)} instead of {width}",
                )
        arrays = {k: pa.array([fields[k] for fields in rows], pa.string()) for k in used}
        return arrays, np.array(lines, np.int64)


def _decode(data):
    """Return bytes as text: UTF-8, or Latin-1 of older spreadsheets."""
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


def fields_of(line, delimiter):
    """Return the fields of a line without their quotes."""
    if delimiter == SPACES:
        return line.split()
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter))
    except (csv.Error, StopIteration):  # a field of more than 131,072 characters
        return []


# --- Header ---


def _read_head(lines, column_map, path):
    """Return columns, delimiter, and how many lines are above the rows."""
    at = column_map.skip
    comment = None
    while at < len(lines) and (not lines[at].strip() or _COMMENT.match(lines[at].lstrip())):
        comment = lines[at].lstrip("#% \t").rstrip() if lines[at].strip() else comment
        at += 1
    rows = [
        (n, line)
        for n, line in enumerate(lines[at:], at + 1)
        if line.strip() and not line.startswith("#")
    ]
    if not rows and comment is None:
        raise InputError(
            f"'{path}' has {len(lines)} lines; expected text after the {column_map.skip} skipped "
            "lines."
        )
    if not rows:
        rows = [(at, comment)]
        comment = None
    rows = rows[: SAMPLE + 2]
    delimiter = _guess_delimiter(rows[0][1], column_map.decimal)
    fields = [(n, fields_of(line, delimiter)) for n, line in rows]
    names, used = _read_header(fields, comment and fields_of(comment, delimiter), column_map, path)
    below = [row for _, row in fields[used:]]
    units = [None] * len(names)
    kinds = _kinds(below[0]) if used and below and len(below[0]) == len(names) else ""
    if "t" in kinds and "n" not in kinds:
        units = [unit.strip("[]() ") for unit in below.pop(0)]  # or other texts, which are none
        units = [None if unit in MISSING else unit for unit in units]
        used += 1
    texts = [[row[k] if k < len(row) else "" for row in below[:SAMPLE]] for k in range(len(names))]
    arrays = [unify(pa.array(cells, pa.string())) for cells in texts]
    columns = [make_column(*parts, True) for parts in zip(names, arrays, units, strict=True)]
    return columns, delimiter, fields[used - 1][0] if used else at


def _guess_delimiter(row, decimal):
    """Return the delimiter of the first line."""
    text = re.sub(r'\[[^\]]*\]|\([^)]*\)|"[^"]*"', "", row)
    candidates = (sign for sign in "\t;|," if sign in text and sign != decimal)
    return next(candidates, SPACES if len(text.split()) > 1 else ",")


def _read_header(fields, comment, column_map, path):
    """Return names of columns, and whether the first line has them."""
    line, first = fields[0]
    numbers = [str(k) for k in range(len(first))]
    if column_map.header or (column_map.header is None and "n" not in _kinds(first)):
        return [name.strip() for name in first], 1
    if column_map.header is None and [name.strip() for name in first] == numbers != ["0"]:
        raise InputError(
            f"'{path}': line {line} has the numbers of the columns. Set `header: true` or "
            "`header: false` in a column map."
        )
    is_header = column_map.header is None and comment and len(comment) == len(first)
    return [name.strip() for name in comment] if is_header else numbers, 0


def _kinds(fields):
    """Return a letter for each field: n for a number or time, t for text, a blank for no value."""
    return "".join(
        "n" if is_number(cell) else " " if cell.strip() in MISSING else "t" for cell in fields
    )
