# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The beginning of a text with a row on each line: what separates its columns, what they are called, where the rows begin."""

import csv
import re
from typing import NamedTuple

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables.column_map import UNSAID
from diag_dynamics.tables.headers import Column
from diag_dynamics.tables.names import numbers_of
from diag_dynamics.tables.packed import chunks
from diag_dynamics.tables.statements import comments
from diag_dynamics.tables.times import is_date
from diag_dynamics.tables.units import is_unit

SPACES = " "
"""As a delimiter: any number of spaces and tabs."""

MISSING = frozenset(
    ("", "nan", "NaN", "NAN", "-nan", "-NaN", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "none", "-", "--")
)
"""Texts that stand for no number."""

BLANK = frozenset(text for text in MISSING if text.strip("-").lower() != "nan")
"""Those of cells with nothing in them; nan is a value that a driver has sent."""

SAMPLE, COMMENTED = 6, 100
"""First rows that show what a column holds, and first lines whose comments may name joints."""

_SIZE = 1 << 20
"""Bytes in which the header and the first row have to lie."""

_CANDIDATES = "\t;|,"
"""What may separate columns, first those that no number has in it; if none of them does, spaces do."""

BOM = b"\xef\xbb\xbf"


class Head(NamedTuple):
    """Where the rows begin, and what they are."""

    columns: list
    delimiter: str
    lines: int
    """Lines of the file before the first row."""
    length: int
    """Bytes of a line, of the first ones on average."""
    texts: tuple = ()
    """Comments that may state names of joints."""


def head(path, wanted, known=()):
    """Read the beginning of a text.

    Parameters
    ----------
    path : str
    wanted : ColumnMap
    known : sequence of str
        Names of the model's joints.

    Returns
    -------
    Head

    Raises
    ------
    InputError
        It is no text; it has no header, or what may be one, or decimal commas, and the map does not say so.
    """
    lines = _first_lines(path)
    at, delimiter, comment = _above(lines, wanted, path)
    rows = [line for line in lines[at:] if line.strip() and not line.startswith("#")][:SAMPLE]
    if not rows:
        if comment is None:
            raise InputError(f"'{path}' has {len(lines)} lines and nothing in them.")
        rows, comment = [comment.lstrip("#% \t")], None
    delimiter = delimiter or _delimiter(rows, wanted.decimal)
    split = [fields_of(row, delimiter) for row in rows]
    has_header, echoed = wanted.header, _echoed(split[0], wanted, path)
    if echoed:
        has_header = False
    if has_header is None:
        has_header = _is_header(split[0], path, at + 1)
    if has_header:
        names, at, below = split[0], at + 1, split[1:]
    else:
        names, below = echoed or [str(k) for k in range(len(split[0]))], split
        named = fields_of(comment.lstrip("#% \t"), delimiter) if comment and wanted.header is None else []
        if len(named) == len(names):
            names = named
        elif wanted.header is None and not echoed and not _by_numbers(wanted):
            raise InputError(
                f"'{path}' has no header, line {at + 1} is of numbers: give a map of columns (--columns MAP.yaml) with "
                f"`header: false`, and with `time`, `position` … as numbers of columns, from 0 to {len(names) - 1}."
            )
    _refuse_decimal_commas(below, delimiter, wanted.decimal, path)
    if has_header and below and (joined := _joined(names, below[0], known)):
        names, at, below = joined, lines.index(rows[1], at) + 1, below[1:]
        if below and below[0][0].strip() and not any(one.strip() for one in below[0][1:]):  # pandas' name of the index
            names[0], at, below = below[0][0], lines.index(rows[2], at) + 1, below[1:]
    columns = [Column(name.strip()) for name in names]
    if has_header and below and _are_units(below[0], len(columns)):
        units = [field.strip().strip("[]()") for field in below[0]]
        columns = [
            column._replace(unit=None if unit in MISSING else unit) for column, unit in zip(columns, units, strict=True)
        ]
        at, below = lines.index(rows[1], at) + 1, below[1:]
    columns = [sampled(column, [row[k] if k < len(row) else "" for row in below]) for k, column in enumerate(columns)]
    return Head(columns, delimiter, at, sum(map(len, lines)) // len(lines) + 1, _comments(lines, wanted.skip))


def _above(lines, wanted, path):
    """Number of lines above the first that is neither empty nor a comment, the delimiter, and the last comment."""
    at, delimiter, comment = wanted.skip, wanted.delimiter, None
    if at >= len(lines):
        raise InputError(f"'{path}': {at} lines are to be skipped, but there are {len(lines)}.")
    while at < len(lines):
        line = lines[at].strip()
        if found := re.fullmatch(r'"?sep=(.)"?', line):  # of a spreadsheet
            delimiter = delimiter or found[1]
        elif line.startswith("#") or re.match(r"%[%\s]", line):
            comment = line
        elif line:
            break
        at += 1
    return at, delimiter, comment


def _comments(lines, end):
    """Texts of comments in the first lines, and of lines that are skipped."""
    return tuple(
        comments(
            [
                (at, re.sub(r"^[#%\s]+", "", line))
                for at, line in enumerate(lines[:COMMENTED], 1)
                if at <= end or line.startswith(("#", "%"))
            ]
        )
    )


def _echoed(fields, wanted, path):
    """Names of columns of `ros2 topic echo --csv` of joint states, which has no header; None of any other line.

    They are stamp and frame, all names, all positions, and all velocities and efforts or neither.
    """
    if wanted.header is not None or wanted.position is not UNSAID or len(fields) < 5:
        return None
    kinds = ["number" if is_number(one) else "text" for one in fields]
    if (
        kinds[:2] != ["number", "number"]
        or kinds[2] == "number"
        or not all(re.fullmatch(r"\d+", one) for one in fields[:2])
    ):
        return None
    count = next((k for k, kind in enumerate(kinds[3:]) if kind == "number"), 0)
    values = [one for one in kinds[3 + count :] if one == "number"]
    rest = [one for one in fields[3 + count :] if one.strip()]
    if not count or len(rest) != len(values) or len(rest) % count or len(rest) // count > 3:
        return None
    if len(rest) == 2 * count:
        raise InputError(
            f"'{path}' has no header and two numbers for each of {count} names: position, and velocity or effort. Write a "
            "header such as sec,nanosec,frame_id,name0,position0,velocity0, with as many names."
        )
    fieldnames = ("name", "position", "velocity", "effort")[: 1 + len(rest) // count]
    return ["sec", "nanosec", "frame_id", *(f"{one}{k}" for one in fieldnames for k in range(count))]


def sampled(column, texts):
    """The column with the texts of its first rows: lists of numbers, times, or whatever is no number."""
    texts = tuple("" if text is None else text.strip() for text in texts)
    given = [text for text in texts if text not in MISSING]
    if any(map(is_number, given)):
        return column._replace(dated=True, moments=all(map(is_date, given)))
    lists = [numbers_of(text) for text in given]
    if given and None not in lists and any(lists):
        return column._replace(width=max(map(len, lists)), listed=True, numeric=True)
    return column._replace(sample=texts, listed=bool(given) and all(text.endswith((")", "]")) for text in given))


def _first_lines(path):
    """Lines of the beginning, as text."""
    broken, begin = [], b""
    for chunk in chunks(path, broken.append):
        begin += chunk
        if len(begin) >= _SIZE:
            break
    if begin.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(f"'{path}' is text in UTF-16: save it in UTF-8.")
    begin = begin.removeprefix(BOM)
    if not begin:
        raise InputError(f"'{path}' has nothing in it{f': {broken[0]}' if broken else ''}.")
    first, ended, _ = begin.partition(b"\n")
    if b"\0" in first:
        raise InputError(
            f"'{path}' is neither a table of text nor Parquet or npz: there are NUL bytes in its first line."
        )
    if not ended:
        if b"\r" in begin.strip(b"\r"):
            raise InputError(f"'{path}': lines end with CR alone, expected LF or CR LF.")
        if len(begin) >= _SIZE or broken:
            why = broken[0] if broken else f"there is no line break in its first {_SIZE} bytes"
            raise InputError(f"'{path}' is no table that can be read: {why}.")
    elif len(begin) >= _SIZE:
        begin = begin[: begin.rfind(b"\n") + 1]
    return [_text(line) for line in begin.split(b"\n")]


def _text(line):
    """A line as text: in UTF-8, or what spreadsheets wrote before."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def fields_of(line, delimiter):
    """Fields of a line, their quotes taken off."""
    if delimiter == SPACES:
        return line.split()
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter))
    except (csv.Error, StopIteration):  # a field of more than 131,072 characters
        return []


def is_number(text):
    """Whether a field is a number or a date."""
    text = text.strip()
    try:
        float(text.replace(",", "."))
    except ValueError:
        return is_date(text)
    return text not in MISSING and "_" not in text


def _delimiter(rows, decimal):
    """What separates the columns of the first lines."""
    first = re.sub(r'\[[^\]]*\]|\([^)]*\)|"[^"]*"', "", rows[0])
    candidates = [one for one in _CANDIDATES if one in first and one != decimal]
    for one in candidates:
        count = len(fields_of(rows[0], one))
        if any(len(fields_of(row, one)) == count for row in rows[1:]):
            return one
    if candidates:
        return candidates[0]
    return SPACES if len(first.split()) > 1 else ","


def _is_header(fields, path, line):
    """Whether a first line names columns."""
    numbers = [is_number(field) for field in fields]
    if not any(numbers):
        return True
    known = [field.strip() for field in fields]
    if all(one or field in MISSING for one, field in zip(numbers, known, strict=True)):
        if len(known) > 1 and known == [str(k) for k in range(len(known))]:
            raise InputError(
                f"'{path}': line {line} counts from 0 to {known[-1]}, which may be a header or a row: say `header: true` or "
                "`header: false` in the map of columns."
            )
        return False
    raise InputError(
        f"'{path}': line {line} has text and numbers, so it may be a header or a row: say `header: true` or `header: false` "
        "in the map of columns."
    )


def _by_numbers(wanted):
    """Whether a map names columns by their numbers only."""
    given = [*(wanted.time if isinstance(wanted.time, tuple) else [""])]
    for value in (wanted.position, wanted.velocity, wanted.effort):
        given += value if isinstance(value, list) else [value] if isinstance(value, str) else []
    return all(isinstance(one, int) for one in given) and isinstance(wanted.position, list)


def _refuse_decimal_commas(rows, delimiter, decimal, path):
    """Refuse 0,5 unless the map says that it is a number."""
    if delimiter == "," or decimal == ",":
        return
    for row in rows:
        for field in row:
            if re.fullmatch(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*", field):
                raise InputError(
                    f"'{path}': numbers such as '{field.strip()}' have a decimal comma: say `decimal: ','` in the map of "
                    "columns."
                )


def _joined(names, below, known):
    """Names of columns of which two lines hold quantities and joints, either above the other; None of any other lines."""
    if len(names) != len(below) or any(map(is_number, below)):
        return None
    for joints, others in ((below, names), (names, below)):
        joints = [one.strip() for one in joints]
        if not any(one in known for one in joints):
            continue
        if joints == [one.strip() for one in names]:  # merged cells of a spreadsheet
            for k, one in enumerate(joints):
                joints[k] = joints[k - 1] if k and not one and joints[k - 1] in known else one
        if any(
            one in known and any(joint in other for joint in known) for one, other in zip(joints, others, strict=True)
        ):
            return None
        return [
            f"{re.sub(r'[ _.([{]*[0-9]+[])}]*$', '', other.strip())}.{one}" if one in known else other.strip() or one
            for one, other in zip(joints, others, strict=True)
        ]
    return None


def _are_units(fields, count):
    """Whether a line below the header holds units."""
    texts = [field.strip().strip("[]()") for field in fields]
    return len(texts) == count and not any(map(is_number, texts)) and any(map(is_unit, texts))
