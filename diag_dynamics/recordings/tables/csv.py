# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text with a row on each line: CSV, TSV and the like, packed or not, by pyarrow."""

import bz2
import csv
import gzip
import lzma
import re
import zlib

import numpy as np
import pyarrow as pa
from pyarrow import csv as arrow_csv

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.cells import BLANK, MISSING, SAMPLE, is_date, is_number, make_column, unify
from diag_dynamics.recordings.tables.choice import choose
from diag_dynamics.recordings.tables.column_map import UNSAID
from diag_dynamics.recordings.tables.headers import is_unit
from diag_dynamics.recordings.tables.joint_names import comment_texts
from diag_dynamics.recordings.tables.table import LEFT_OUT, ROWS

SPACES = " "  # as a delimiter: any number of spaces and tabs
MAX_LINE = 1 << 26  # bytes
_BEGINNING = 1 << 20  # bytes in which the header and the first rows are
_COMMENTED = 100  # first lines whose comments may name joints
_COMMENT = re.compile(r'#|%[%\s]|"?sep=."?\s*$')
_PACKINGS = {
    b"\x1f\x8b": gzip.open,
    b"BZh": bz2.open,
    b"\xfd7zXZ\0": lzma.open,
    b"\x28\xb5\x2f\xfd": lambda file: pa.CompressedInputStream(pa.PythonFile(file), "zstd"),
    b"\x04\x22\x4d\x18": lambda file: pa.CompressedInputStream(pa.PythonFile(file), "lz4"),
}
_BROKEN = (EOFError, OSError, zlib.error, lzma.LZMAError)


class CsvSource:
    """Rows of a text. A line is a row: a quote that was lost does not take the rest of the file along."""

    notes, unit = (), "line"

    def __init__(self, path, wanted, joints):
        self.path, self._broken, self._decimal = path, "", wanted.decimal
        _, begin = next(self._read_lines(_BEGINNING), (1, b""))
        lines = [_decode(line) for line in begin.split(b"\n")]
        if len(lines) < 2 or "\0" in lines[0]:
            why = self._broken or "its first line is no text (UTF-8) with a line break behind it (LF or CR LF)"
            raise InputError(f"'{path}' is neither CSV nor Parquet or npz that can be read: {why}.")
        columns, self._delimiter, self._above = _read_head(lines, wanted, joints, path)
        self.headers = [one.name for one in columns]
        marked = [
            (at, re.sub(r"^[#%\s]+", "", line))
            for at, line in enumerate(lines[:_COMMENTED], 1)
            if at <= wanted.skip or line.startswith(("#", "%"))
        ]
        self.choice = choose(columns, wanted, joints, path, comment_texts(marked))
        self._size = min(max(ROWS * (len(begin) // len(lines) + 1), _BEGINNING), MAX_LINE)
        self._scalars = {*self.choice.values, *self.choice.time} - {k for k, one in enumerate(columns) if one.listed}
        numbers = self._scalars.difference(self.choice.time)
        self._convert = arrow_csv.ConvertOptions(
            column_types={str(k): pa.float64() if k in numbers else pa.string() for k in self.choice.used},
            include_columns=[str(k) for k in self.choice.used],
            null_values=list(BLANK),
            decimal_point=wanted.decimal,
        )

    def blocks(self, losses):
        """Yield arrays by index of the column, and the number of each line."""
        end = self._above + 1
        for line, text in self._read_lines(self._size):
            if line == 1:  # the lines above the rows are all in it
                *above, text = text.split(b"\n", self._above)
                line, text = self._above + 1, text if len(above) == self._above else b""
            yield self._parse(text, line) or self._parse_lines(text, line, losses)
            end = line + text.count(b"\n") + (not text.endswith(b"\n") and text != b"")
        if self._broken:
            losses.add(f"{self._broken}: all behind this line is lost", f"line {end - 1}")
        if end == self._above + 1:
            losses.add("there is no row below the header", f"line {end}")

    def _read_lines(self, size):
        """Yield whole lines, about `size` bytes at a time, and the number of the first."""
        held, line = bytearray(), 1
        for chunk in self._read_chunks():
            held += chunk
            end = held.rfind(b"\n") + 1 if chunk or self._broken else len(held)
            if end and (len(held) >= size or not chunk):
                yield line, bytes(held[:end]).removeprefix(b"\xef\xbb\xbf" if line == 1 else b"")
                line += held.count(b"\n", 0, end)
                del held[:end]
            elif len(held) > size + MAX_LINE:
                raise InputError(f"'{self.path}': line {line} has more than {MAX_LINE} bytes.")

    def _read_chunks(self):
        """Yield unpacked bytes, an empty chunk at the end; `_broken` says why it is not the end of the file."""
        self._broken = ""
        with open(self.path, "rb") as file:
            begin = file.read(8)
            file.seek(0)
            opener = next((one for magic, one in _PACKINGS.items() if begin.startswith(magic)), None)
            stream = opener(file) if opener else file
            try:
                while chunk := stream.read1(1 << 18):
                    yield chunk
            except _BROKEN as error:
                why = str(error).rstrip(".") or type(error).__name__
                cut = isinstance(error, EOFError) or "Truncated" in why
                doubt = "" if cut else "; it is damaged, and rows before that may be wrong"
                self._broken = f"the packed stream cannot be read to its end: {why}{doubt}"
        yield b""

    def _parse(self, text, line):
        """A block in which each line is a row of numbers; None for others."""
        if text.startswith(b"#") or b"\n#" in text or self._delimiter == SPACES:
            return None
        names = [str(k) for k in range(len(self.headers))]  # headers may be there twice
        read = arrow_csv.ReadOptions(column_names=names, block_size=1 << 27, use_threads=False)
        parse = arrow_csv.ParseOptions(delimiter=self._delimiter)
        try:
            table = arrow_csv.read_csv(pa.BufferReader(text), read, parse, self._convert)
        except pa.ArrowException:
            return None
        count = text.count(b"\n") + (not text.endswith(b"\n"))
        if table.num_rows != count:  # empty lines, or some between quotes
            return None
        arrays = {k: table.column(str(k)).combine_chunks() for k in self.choice.used}
        return self._replace_commas(arrays), np.arange(line, line + count)

    def _parse_lines(self, text, line, losses):
        """A block line by line; what is no row is counted."""
        width, kept, lines = len(self.headers), [], []
        for at, one in enumerate(_decode(text).split("\n"), line):
            if one.startswith("#") or not one.strip():
                continue
            fields = fields_of(one, self._delimiter)
            if not any(field.strip() for field in fields[width:]):
                del fields[width:]
            if len(fields) == width:
                kept.append(fields)
                lines.append(at)
            else:
                example = f"{len(fields)} instead of {width}"
                losses.add("another number of columns than the header has", f"line {at}", LEFT_OUT, example=example)
        arrays = {k: pa.array([fields[k] for fields in kept], pa.string()) for k in self.choice.used}
        return self._replace_commas(arrays), np.array(lines, np.int64)

    def _replace_commas(self, arrays):
        """Texts of numbers with a point for the decimal comma; a point, which separates thousands, makes them none."""
        for k in self._scalars if self._decimal == "," else ():
            if pa.types.is_string(arrays[k].type):
                texts = arrays[k].to_pylist()
                texts = [one if is_date(one) else one.replace(".", "_").replace(",", ".") for one in texts]
                arrays[k] = pa.array(texts, pa.string())
        return arrays


def _decode(data):
    """Bytes as text: UTF-8, or Latin-1 of older spreadsheets."""
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


def _read_head(lines, wanted, known, path):
    """Columns, delimiter, and the number of lines above the first row."""
    at, comment = wanted.skip, None
    while at < len(lines) and (not lines[at].strip() or _COMMENT.match(lines[at].lstrip())):
        comment = lines[at].lstrip("#% \t").rstrip() if lines[at].strip() else comment
        at += 1
    rows = [(n, line) for n, line in enumerate(lines[at:], at + 1) if line.strip() and not line.startswith("#")]
    if not rows and comment is None:
        raise InputError(
            f"'{path}' has {len(lines)} lines, and nothing in them behind the {wanted.skip} to be skipped."
        )
    rows, comment = (rows[: SAMPLE + 3], comment) if rows else ([(at, comment)], None)
    delimiter = wanted.delimiter or _guess_delimiter([line for _, line in rows], wanted.decimal)
    fields = [(n, fields_of(line, delimiter)) for n, line in rows]
    names, units, used = _read_header(fields, comment and fields_of(comment, delimiter), wanted, known, path)
    below = [row for _, row in fields[used:]][:SAMPLE]
    commas = [one.strip() for row in below for one in row if re.fullmatch(r"\s*[+-]?\d+,\d+(e[+-]?\d+)?\s*", one)]
    if commas and "," not in (delimiter, wanted.decimal):
        raise InputError(
            f"'{path}': numbers such as '{commas[0]}' have a decimal comma: say `decimal: ','` in the map of columns."
        )
    texts = [[row[k] if k < len(row) else "" for row in below] for k in range(len(names))]
    arrays = [unify(pa.array(one, pa.string())) for one in texts]
    columns = [make_column(*one, True) for one in zip(names, arrays, units, strict=True)]
    return columns, delimiter, fields[used - 1][0] if used else at


def _guess_delimiter(rows, decimal):
    """What separates the columns of the first lines."""
    first = re.sub(r'\[[^\]]*\]|\([^)]*\)|"[^"]*"', "", rows[0])
    candidates = [one for one in "\t;|," if one in first and one != decimal]
    for one in candidates:
        count = len(fields_of(rows[0], one))
        if any(len(fields_of(row, one)) == count for row in rows[1:]):
            return one
    return candidates[0] if candidates else SPACES if len(first.split()) > 1 else ","


def _read_header(fields, comment, wanted, known, path):
    """Names and units of columns by the first lines, and how many of these are above the rows."""
    line, first = fields[0]
    names = _find_echoed_names(first) if wanted.header is None and wanted.position is UNSAID else None
    if names or not (_is_header(first, path, line) if wanted.header is None else wanted.header):
        if comment and wanted.header is None and len(comment) == len(first):
            names = names or comment
        by_numbers = wanted.time is not UNSAID and isinstance(wanted.position, list)
        by_numbers = by_numbers and all(isinstance(one, int) for one in (*wanted.time, *wanted.position))
        if not (names or by_numbers or wanted.header is False):
            raise InputError(
                f"'{path}' has no header, line {line} is of numbers: give a map of columns (--columns MAP.yaml) with "
                f"`header: false`, and with `time`, `position` … as numbers of columns, from 0 to {len(first) - 1}."
            )
        names = names or list(map(str, range(len(first))))
        return [name.strip() for name in names], [None] * len(names), 0
    names, used, below = first, 1, [row for _, row in fields[1:]]
    if below and (joined := _join_headers(names, below[0], known)):
        names, used = joined, 2
        if len(below) > 1 and below[1][0].strip() and not any(one.strip() for one in below[1][1:]):
            names[0], used = below[1][0], 3  # pandas' name of the index
    names = [name.strip() for name in names]
    units = [field.strip().strip("[]()") for field in fields[used][1]] if used < len(fields) else []
    if len(units) == len(names) and "n" not in _kinds(units) and any(map(is_unit, units)):
        return names, [None if unit in MISSING else unit for unit in units], used + 1
    return names, [None] * len(names), used


def _kinds(fields):
    """A letter for each field: number or time, text, or nothing."""
    return "".join("n" if is_number(one) else " " if one.strip() in MISSING else "t" for one in fields)


def _find_echoed_names(fields):
    """Names of columns of `ros2 topic echo --csv` of joint states, which has no header; None for any other line."""
    match = re.fullmatch(r"nn[t ]([t ]+)(n+) *", _kinds(fields))
    if not match or len(match[2]) not in (len(match[1]), 3 * len(match[1])) or not "".join(fields[:2]).isdecimal():
        return None
    quantities = ("name", "position", "velocity", "effort")[: 1 + len(match[2]) // len(match[1])]
    return ["sec", "nanosec", "frame_id", *(f"{one}{k}" for one in quantities for k in range(len(match[1])))]


def _is_header(fields, path, line):
    """Whether a first line names columns."""
    kinds, counting = _kinds(fields), [str(k) for k in range(len(fields))]
    if "n" in kinds and ("t" in kinds or [field.strip() for field in fields] == counting != ["0"]):
        say = "say `header: true` or `header: false` in the map of columns"
        raise InputError(f"'{path}': line {line} has text and numbers, or counts, and may be a header or a row: {say}.")
    return "n" not in kinds


def _join_headers(names, below, known):
    """Names of columns of which two lines hold quantities and joints, either above the other; None for other lines."""
    if len(names) != len(below) or "n" in _kinds(below):
        return None
    for above, joints, others in ((False, below, names), (True, names, below)):
        joints, others = [one.strip() for one in joints], [one.strip() for one in others]
        if not any(one in known for one in joints):
            continue
        for k in range(1, len(joints) if above else 0):  # merged cells of a spreadsheet
            joints[k] = joints[k - 1] if not joints[k] and joints[k - 1] in known else joints[k]
        pairs = list(zip(joints, others, strict=True))
        if any(one in known and any(joint in other for joint in known) for one, other in pairs):
            return None
        return [f"{re.sub(r'[ _.([{]*[0-9]+[])}]*$', '', b)}.{a}" if a in known else b or a for a, b in pairs]
    return None
