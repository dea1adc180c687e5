# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in the data of a table: in columns of text row by row, in comments, in metadata."""

import json
import re
from contextlib import suppress
from typing import NamedTuple

import numpy as np

NAMES = ("name", "names", "joint", "joints", "joint_name", "joint_names", "joint_order")
"""Names of lists of joint names, in small letters."""

_LABEL = re.compile(r"(?:.*[./:\s|])?(?:(?:joints?[_ -]*)?names?|joints?|joint[_ -]?order)")
"""Header of a column of joint names without its index, in small letters."""

_LIST = re.compile(
    r"\b(?P<label>(?:joints?|joint[_ -]?(?:names?|order)|names?|order)\b[^:=,;\[]*)(?P<quote>[\"']?)\s*[:=]\s*(?P<names>.*)",
    re.IGNORECASE,
)
"""A label, and what it lists."""

_PAIR = re.compile(
    r"(?:^|[\s,;([{])(?:[a-z]+[\s_]?)?[\[(]?(?P<number>\d{1,3})[\])]?\s*(?:[:=]|->|=>)\s*['\"]?(?P<name>[a-z_/][\w./-]*)",
    re.IGNORECASE,
)
"""The number of a joint, and its name: ``q1 = elbow``."""

_ENTRY = re.compile(r"-?\s*(?P<name>[\w./-]+)")

_QUOTED = re.compile(r"""b?'([^']*)'|b?"([^"]*)\"""")

_SCALAR = re.compile(r"\b(?:np|numpy)\.\w+\(([^()\[\]]*)\)")

_NO_NAMES = frozenset(("", "nan", "none", "null", "na", "n/a", "-", "--"))


class Stated(NamedTuple):
    """Names of the joints of a table in the order of its columns."""

    joints: tuple[str, ...]
    where: str
    """Place in the file, for messages."""


class RowNames(NamedTuple):
    """Columns of text that name the joints of each row: one for each place, or one for all places."""

    pattern: str
    columns: tuple[int, ...] = ()
    numbers: tuple[int, ...] = ()
    """Index of each of these columns in its header, ascending; empty of a single column without one."""
    whole: int | None = None
    """Column of lists."""
    first: tuple[str, ...] = ()
    """Names in the first row that has any."""
    labelled: bool = False
    """Whether the header says that these are names."""
    known: bool = False
    """Whether a name of the model's joints is in the first rows."""

    @property
    def used(self):
        """Indices of the columns."""
        return self.columns if self.whole is None else (self.whole,)


def names_of(text):
    """Return the names in a text: ``['a', 'b']``, ``(a; b)``, ``a, b``, ``a b`` or ``a``."""
    if not isinstance(text, str):
        return () if text is None else tuple("" if one is None else _clean(str(one)) for one in text)
    body = _inner(text)
    quoted = _QUOTED.findall(body)
    if quoted:
        return tuple(_clean(one or other) for one, other in quoted)
    separator = next((one for one in ",;|\t" if one in body), None)
    return tuple(filter(None, map(_clean, body.split(separator))))


def numbers_of(text):
    """Return the numbers in the text of an array, ``(0.1, 0.2)`` or ``[0.1 0.2]``; None if it is none."""
    text = text.strip()
    if not text or text[-1] not in "])}":
        return None
    body = _inner(text)
    try:
        return tuple(map(float, re.split(r"\s*[,;]\s*|\s+", body.strip(" \t,;")))) if body.strip() else ()
    except ValueError:
        return None


def _inner(text):
    """The text between the innermost brackets, or the text; scalars of numpy are what is in them."""
    text = _SCALAR.sub(r"\1", text.strip())
    found = re.search(r"[\[({]([^\[\](){}]*)[\])}]", text)
    return found[1] if found and text[-1] in "])}" else text


def _clean(text):
    """A name without quotes and blanks; empty for texts that stand for no value."""
    text = text.strip().strip("'\"").strip()
    return "" if text.lower() in _NO_NAMES else text


def stated_in_comments(lines, known):
    """Return the names that comments state, such as ``# joints: elbow, wrist``; None otherwise.

    Parameters
    ----------
    lines : list of (int, str)
        Numbers and texts of comments, without what marks them.
    known : sequence of str
        Names of the model's joints.
    """
    pairs = [(int(one["number"]), one["name"], at) for at, line in lines for one in _PAIR.finditer(line)]
    pairs = [one for one in pairs if one[1] in known] if known else []
    if len(pairs) > 1 and len({number for number, *_ in pairs}) == len(pairs):
        return Stated(tuple(name for _, name, _ in sorted(pairs)), f"the comment in line {pairs[0][2]}")
    for k, (at, line) in enumerate(lines):
        found = _LIST.search(line)
        if found:
            text = re.split(r"\s+\w+\s*=", found["names"])[0]
            names = names_of(text) if text.strip() else _entries(lines[k + 1 :])
            sure = "joint" in line[: found.start("names")].lower()
            if names and all(map(_is_name, names)) and (sure or 2 * len(set(names) & set(known)) > len(names)):
                return Stated(names, f"the comment in line {at}")
        elif len(names := names_of(line)) > 1 and set(names) <= set(known):
            return Stated(names, f"the comment in line {at}")
    return None


def _entries(lines):
    """Names on lines of their own."""
    names = []
    for _, line in lines:
        found = _ENTRY.fullmatch(line.strip())
        if found is None:
            return tuple(names) or names_of(line)
        names.append(found["name"])
    return tuple(names)


def _is_name(text):
    return bool(re.search(r"[^\W\d]", text)) and not re.search(r"\s", text)


def stated_in_metadata(metadata):
    """Return the names that metadata state, a dict of bytes or texts, and their key; None otherwise."""
    for key, value in (metadata or {}).items():
        key, value = (one.decode(errors="replace") if isinstance(one, bytes) else one for one in (key, value))
        if str(key).lower() not in (*NAMES, "pandas_attrs"):
            continue
        with suppress(TypeError, ValueError):
            value = json.loads(value)
        if isinstance(value, dict):
            found = stated_in_metadata(value)
            if found:
                return found
        elif names := names_of(value) if isinstance(value, str | list) else ():
            return Stated(names, f"metadata '{key}'")
    return None


def row_names(columns, known):
    """Return the sets of columns that name joints row by row.

    A column is one of them by its header, such as ``name0``, or because names of the model's joints are among its texts.

    Parameters
    ----------
    columns : list of Column
    known : sequence of str
        Names of the model's joints.

    Returns
    -------
    list of RowNames
    """
    sets = {}
    for k, column in enumerate(columns):
        if not column.sample:
            continue
        stem, number = _stem(column.name)
        labelled = bool(_LABEL.fullmatch(stem.replace("{}", "").strip(" _.[](){}/-:|")))
        names = [names_of(text) for text in column.sample]
        is_known = any(name in known for one in names for name in one)
        if labelled or is_known:
            sets.setdefault(stem, []).append((-1 if number is None else number, k, names, labelled, is_known))
    found = []
    for stem, members in sets.items():
        members.sort(key=lambda one: one[:2])
        numbers, places, names, labels, knows = zip(*members, strict=True)
        if not any(any(one) for sample in names for one in sample):
            continue
        flags = {"labelled": all(labels), "known": any(knows)}
        first, column = next((one for one in names[0] if any(one)), ()), columns[places[0]]
        if len(members) == 1 and (column.listed or any(len(one) > 1 for one in names[0])):
            found.append(RowNames(column.name, whole=places[0], first=first, **flags))
        elif len(members) == 1 and numbers == (-1,):
            found.append(RowNames(column.name, places, first=first, **flags))
        elif -1 not in numbers:
            rows = ([next(iter(one), "") for one in row] for row in zip(*names, strict=False))
            first = tuple(next((row for row in rows if any(row)), ()))
            found.append(RowNames(stem.replace("{}", "*"), places, numbers, first=first, **flags))
    return found


def _stem(header):
    """A header in small letters with {} for its last number, and the number; None where it has none."""
    header = header.strip().lower()
    found = list(re.finditer(r"\d{1,4}", header))
    if not found:
        return header, None
    at = found[-1]
    return f"{header[: at.start()]}{{}}{header[at.end() :]}", int(at[0])


def nearest(headers, pattern):
    """Return those of several headers that begin most like a pattern."""
    common = [_common(one.lower(), pattern.lower()) for one in headers]
    return [one for one, length in zip(headers, common, strict=True) if length == max(common)]


def _common(one, other):
    """Number of characters at the beginning of two texts that are the same."""
    pairs = enumerate(zip(one, other, strict=False))
    return next((k for k, (a, b) in pairs if a != b), min(len(one), len(other)))


def names_in_rows(names, texts, count):
    """Return the names of each row, (n, k) of str, empty where a place has none.

    Parameters
    ----------
    names : RowNames
    texts : callable
        Texts, or lists of them, of a column by its index.
    count : int
        Rows.
    """
    if names.whole is None:
        columns = [texts(k) for k in names.columns]
        known = {text: _clean(text) if isinstance(text, str) else "" for column in columns for text in set(column)}
        return np.array([[known[text] for text in column] for column in columns], object).T.reshape(count, -1)
    rows = list(map(_key, texts(names.whole)))
    known = {row: names_of(list(row) if isinstance(row, tuple) else row) for row in set(rows)}
    width = max(map(len, known.values()), default=0)
    padded = {row: (*one, *[""] * (width - len(one))) for row, one in known.items()}
    return np.array([padded[row] for row in rows], object).reshape(count, width)


def _key(text):
    """A text as it is, a list of texts as a tuple."""
    return text if text is None or isinstance(text, str) else tuple(text)


def padded(lists):
    """Return lists of numbers as (n, k), NaN behind the end of each, and their lengths."""
    lengths = np.array([len(one) for one in lists], int)
    values = np.full((len(lists), max(lengths, default=0)), np.nan)
    values[np.arange(values.shape[1]) < lengths[:, None]] = [number for one in lists for number in one]
    return values, lengths
