# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text with a row on each line: CSV, TSV and the like, packed or not, by pyarrow."""

import bz2
import csv
import gzip
import lzma
import os
import re
import zlib

import numpy as np
import pyarrow as pa
from pyarrow import csv as arrow_csv

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.cells import BLANK, MISSING, SAMPLE, parse_number, sample_column
from diag_dynamics.recordings.tables.choice import choose
from diag_dynamics.recordings.tables.column_map import UNSAID
from diag_dynamics.recordings.tables.headers import Column
from diag_dynamics.recordings.tables.joint_names import comment_texts
from diag_dynamics.recordings.tables.table import LEFT_OUT, ROWS, Block
from diag_dynamics.recordings.tables.times import is_date
from diag_dynamics.recordings.tables.units import is_unit

SPACES = " "
"""As a delimiter: any number of spaces and tabs."""
MAX_LINE = 1 << 26
"""Bytes."""
_BEGINNING = 1 << 20
"""Bytes in which the header and the first rows are."""
_COMMENTED = 100
"""First lines whose comments may name joints."""
_CHUNK = 1 << 18
_BOM = b"\xef\xbb\xbf"
_COMMENT = re.compile(r'#|%[%\s]|"?sep=."?\s*$')
_PACKINGS = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bz2",
    b"\xfd7zXZ\0": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x04\x22\x4d\x18": "lz4",
}
_OPENERS = {"gzip": gzip.open, "bz2": bz2.open, "xz": lzma.open}


class CsvSource:
    """Rows of a text. A line is a row: a quote that was lost does not take the rest of the file along."""

    notes = ()

    def __init__(self, path, wanted, joints):
        self.path, self._decimal = path, wanted.decimal
        lines = self._first_lines()
        columns, self._delimiter, self.lines = _read_head(lines, wanted, joints, path)
        self.headers = [one.name for one in columns]
        marked = [
            (at, line)
            for at, line in enumerate(lines[:_COMMENTED], 1)
            if at <= wanted.skip or line.startswith(("#", "%"))
        ]
        comments = comment_texts([(at, re.sub(r"^[#%\s]+", "", line)) for at, line in marked])
        self.choice = choose(columns, wanted, joints, path, comments)
        self._size = min(max(ROWS * (sum(map(len, lines)) // len(lines) + 1), _BEGINNING), MAX_LINE)
        texts = set(self.choice.used) - {k for k in self.choice.values if not columns[k].width} | set(self.choice.time)
        self._convert = arrow_csv.ConvertOptions(
            column_types={str(k): pa.string() if k in texts else pa.float64() for k in self.choice.used},
            include_columns=[str(k) for k in self.choice.used],
            null_values=list(BLANK),
            strings_can_be_null=False,
            decimal_point=wanted.decimal,
        )

    def blocks(self, losses):
        """Yield each :class:`Block`."""
        row = 0
        for line, text in self._read_lines(losses):
            if line == 1:  # the first lines are all in it
                parts = text.removeprefix(_BOM).split(b"\n", self.lines)
                line, text = self.lines + 1, parts[self.lines] if len(parts) > self.lines else b""
            if text:
                block, count = self._parse(text, line, row) or self._parse_lines(text, line, row, losses)
                row += count
                yield block
        if not row:
            losses.add("there is no row below the header", f"line {self.lines + 1}")

    def _chunks(self, broken):
        """Unpacked bytes; `broken` receives why the file cannot be read to its end."""
        size = os.path.getsize(self.path)
        with open(self.path, "rb") as file:
            begin = file.read(8)
            file.seek(0)
            packed = next((name for magic, name in _PACKINGS.items() if begin.startswith(magic)), None)
            stream = _OPENERS[packed](file) if packed in _OPENERS else file
            if packed in ("zstd", "lz4"):
                stream = pa.CompressedInputStream(pa.PythonFile(file, mode="r"), packed)
            try:
                while chunk := stream.read1(_CHUNK):
                    yield chunk
            except (EOFError, OSError, zlib.error, lzma.LZMAError) as error:
                why = str(error).rstrip(".") or type(error).__name__
                cut = isinstance(error, EOFError) or "Truncated" in why
                doubt = "" if cut else "; it is damaged, and rows before that may be wrong"
                at = f"at byte {min(file.tell(), size)} of {size}, or shortly before"
                broken.append(f"the {packed or 'file'} stream cannot be read to its end, {at}: {why}{doubt}")

    def _first_lines(self):
        """Lines of the beginning, as text."""
        broken, begin = [], b""
        for chunk in self._chunks(broken):
            begin += chunk
            if len(begin) >= _BEGINNING:
                begin = begin[: begin.rfind(b"\n") + 1]  # nothing without a line break
                break
        begin = begin.removeprefix(_BOM)
        first = begin.partition(b"\n")[0]
        why = broken[0] if broken and b"\n" not in begin else ""
        if b"\0" in first:
            why = "it is neither a table of text nor Parquet or npz: there are NUL bytes in its first line"
        elif not why and (not begin or (first == begin and b"\r" in begin.strip(b"\r"))):
            why = f"there is no line break, LF or CR LF, in its first {_BEGINNING} bytes"
        if why:
            raise InputError(f"'{self.path}' is no table that can be read: {why}.")
        return [_text(line) for line in begin.split(b"\n")]

    def _read_lines(self, losses):
        """Whole lines, about ROWS at a time, and the number of the first."""
        broken, held, line = [], bytearray(), 1
        for chunk in self._chunks(broken):
            held += chunk
            end = held.rfind(b"\n") + 1 if len(held) >= self._size else 0
            if end:
                yield line, bytes(held[:end])
                line += held.count(b"\n", 0, end)
                del held[:end]
            elif len(held) > self._size + MAX_LINE:
                raise InputError(f"'{self.path}': line {line} has more than {MAX_LINE} bytes.")
        if broken:
            end = held.rfind(b"\n") + 1
            lost = ", and with it the row in which it breaks off" if end < len(held) else ""
            del held[end:]
            last = line + held.count(b"\n") - 1
            losses.add(f"{broken[0]}: all behind this line is lost{lost}", f"line {last}")
        if held:
            yield line, bytes(held)

    def _parse(self, text, line, row):
        """A block in which each line is a row of numbers, and the number of rows; None of others."""
        if b"\0" in text or text.startswith(b"#") or b"\n#" in text or self._delimiter == SPACES:
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
        return Block(arrays, np.arange(row, row + count), range(line, line + count), self._decimal), count

    def _parse_lines(self, text, line, row, losses):
        """A block line by line, and the number of rows; what is no row is counted."""
        width, kept, places, count = len(self.headers), [], [], 0
        for at, one in enumerate(_text(text).split("\n"), line):
            if one.startswith("#") or not one.strip():
                continue
            fields = fields_of(one, self._delimiter)
            if not any(field.strip() for field in fields[width:]):
                del fields[width:]
            if "\0" in one:
                losses.add("NUL bytes, as files have them of a machine that lost its power", f"line {at}", LEFT_OUT)
            elif len(fields) != width:
                example = f"{len(fields)} instead of {width}"
                losses.add("another number of columns than the header has", f"line {at}", LEFT_OUT, example=example)
            else:
                kept.append(fields)
                places.append((row + count, at))
            count += 1
        rows, lines = np.array(places, np.int64).reshape(-1, 2).T
        arrays = {k: pa.array([fields[k] for fields in kept], pa.string()) for k in self.choice.used}
        return Block(arrays, rows, lines, self._decimal), count


def _text(data):
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
    if at >= len(lines):
        raise InputError(f"'{path}': {at} lines are to be skipped, but there are {len(lines)}.")
    while at < len(lines) and (not lines[at].strip() or _COMMENT.match(lines[at].lstrip())):
        comment = lines[at].lstrip("#% \t").rstrip() if lines[at].strip() else comment
        at += 1
    rows = [(n, line) for n, line in enumerate(lines[at:], at + 1) if line.strip() and not line.startswith("#")][
        : SAMPLE + 3
    ]
    if not rows and comment is None:
        raise InputError(f"'{path}' has {len(lines)} lines and nothing in them.")
    rows, comment = (rows, comment) if rows else ([(at, comment)], None)
    delimiter = wanted.delimiter or _guess_delimiter([line for _, line in rows], wanted.decimal)
    fields = [(n, fields_of(line, delimiter)) for n, line in rows]
    columns, used = _read_header(fields, comment and fields_of(comment, delimiter), wanted, known, path)
    below = [row for _, row in fields[used:]][:SAMPLE]
    decimal_comma = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*")
    commas = [one.strip() for row in below for one in row if decimal_comma.fullmatch(one)]
    if commas and "," not in (delimiter, wanted.decimal):
        raise InputError(
            f"'{path}': numbers such as '{commas[0]}' have a decimal comma: say `decimal: ','` in the map of columns."
        )
    columns = [sample_column(one, [row[k] if k < len(row) else "" for row in below]) for k, one in enumerate(columns)]
    return columns, delimiter, fields[used - 1][0] if used else at


def _read_header(fields, comment, wanted, known, path):
    """Columns by the first lines, and how many of these are above the rows."""
    line, first = fields[0]
    echoed = _echoed_names(first, wanted, path)
    if echoed or not (_is_header(first, path, line) if wanted.header is None else wanted.header):
        named = comment if comment and wanted.header is None and len(comment) == len(first) else None
        if not (echoed or named or wanted.header is False or _by_numbers(wanted)):
            raise InputError(
                f"'{path}' has no header, line {line} is of numbers: give a map of columns (--columns MAP.yaml) with "
                f"`header: false`, and with `time`, `position` … as numbers of columns, from 0 to {len(first) - 1}."
            )
        return [Column(name.strip()) for name in echoed or named or map(str, range(len(first)))], 0
    names, used, below = first, 1, [row for _, row in fields[1:]]
    if below and (joined := _join_headers(names, below[0], known)):
        names, used = joined, 2
        if len(below) > 1 and below[1][0].strip() and not any(one.strip() for one in below[1][1:]):
            names[0], used = below[1][0], 3  # pandas' name of the index
    columns = [Column(name.strip()) for name in names]
    units = [field.strip().strip("[]()") for field in fields[used][1]] if used < len(fields) else []
    if len(units) == len(columns) and not any(map(_is_number, units)) and any(map(is_unit, units)):
        columns = [
            one._replace(unit=None if unit in MISSING else unit) for one, unit in zip(columns, units, strict=True)
        ]
        used += 1
    return columns, used


def _echoed_names(fields, wanted, path):
    """Names of columns of `ros2 topic echo --csv` of joint states, which has no header; None of any other line."""
    kinds = "".join("n" if _is_number(one) else "t" if one.strip() else " " for one in fields)
    match = re.fullmatch(r"nn[t ]([t ]+)(n+) *", kinds)
    if wanted.header is not None or wanted.position is not UNSAID or not match or not "".join(fields[:2]).isdecimal():
        return None
    names, times = len(match[1]), len(match[2]) / len(match[1])
    if times == 2:
        raise InputError(
            f"'{path}' has no header and two numbers for each of {names} names: position, and velocity or effort. Write a "
            "header such as sec,nanosec,frame_id,name0,position0,velocity0, with as many names."
        )
    labels = [f"{one}{k}" for one in ("name", "position", "velocity", "effort")[: 1 + int(times)] for k in range(names)]
    return ["sec", "nanosec", "frame_id", *labels] if times in (1, 3) else None


def _is_number(text):
    """Whether a field is a number or a date."""
    return text.strip() not in MISSING and (parse_number(text.replace(",", ".")) is not None or is_date(text))


def _guess_delimiter(rows, decimal):
    """What separates the columns of the first lines."""
    first = re.sub(r'\[[^\]]*\]|\([^)]*\)|"[^"]*"', "", rows[0])
    candidates = [one for one in "\t;|," if one in first and one != decimal]
    for one in candidates:
        count = len(fields_of(rows[0], one))
        if any(len(fields_of(row, one)) == count for row in rows[1:]):
            return one
    return candidates[0] if candidates else SPACES if len(first.split()) > 1 else ","


def _is_header(fields, path, line):
    """Whether a first line names columns."""
    known = [field.strip() for field in fields if field.strip() not in MISSING]
    numbers = sum(map(_is_number, known))
    counting = len(known) == len(fields) > 1 and known == [str(k) for k in range(len(known))]
    if not numbers or (numbers == len(known) and not counting):
        return not numbers
    what = f"counts from 0 to {known[-1]}" if counting else "has text and numbers"
    raise InputError(
        f"'{path}': line {line} {what}, so it may be a header or a row: say `header: true` or `header: false` in the map of "
        "columns."
    )


def _by_numbers(wanted):
    """Whether a map names columns by their numbers only."""
    values = [wanted.time, wanted.position, wanted.velocity, wanted.effort]
    entries = [one for value in values if isinstance(value, list | tuple | str) for one in value]
    return (
        wanted.time is not UNSAID and isinstance(wanted.position, list) and all(isinstance(one, int) for one in entries)
    )


def _join_headers(names, below, known):
    """Names of columns of which two lines hold quantities and joints, either above the other; None of any other lines."""
    if len(names) != len(below) or any(map(_is_number, below)):
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
