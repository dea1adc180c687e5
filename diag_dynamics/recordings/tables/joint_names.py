# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in the data: in columns of text row by row, in comments, metadata and arrays for all rows."""

import json
import re
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from diag_dynamics.recordings.tables.units import is_unit

NAMES = ("name", "names", "joint", "joints", "joint_name", "joint_names", "joint_order")
MAX_LENGTH = 10_000
"""Characters of a text that may state names of joints."""

_HEADER = re.compile(r"(?:.*[./:\s|])?(?:(?:joints?[_ -]*)?names?|joints?|joint[_ -]?order)")
_QUOTED = re.compile(r"""b?'([^']*)'|b?"([^"]*)\"""")
_SCALAR = re.compile(r"\b(?:np|numpy)\.\w+\(([^()\[\]]*)\)")
_LABEL = re.compile(
    r"(?:^|[,;{|\"']\s*|[:=]\s?[^\s,;]{1,80}\s+)[\"']?(?:the\s+)?(?:(?:names?|order)\s+of\s+(?:the\s+|all\s+)?)?"
    r"(?P<label>joints?(?:[_ -]?(?:names?|order))?|names?|order|motors|actuators|axes|dofs)"
    r"(?:\s*\([^)]*\)|\s+(?:of|from|as|in order)\b[^:=,]*)?[\"']?\s*[:=]\s*(?P<names>.*)",
    re.IGNORECASE,
)
"""A label of a list of names, and the list."""
_BEFORE = r"(?:^|[^\w.])(?:[a-z_]+[\s.]?)?[\[(]?(?P<number>\d{1,3})[\])]?"
_NUMBER_OF = re.compile(rf"{_BEFORE}\s*(?:[:=)|]|->|=>|-(?=\s)|\bis\b)\s*['\"\[(]*$", re.IGNORECASE)
"""The number of a joint before its name: ``q1 = elbow``."""
_BARE_NUMBER = re.compile(rf"{_BEFORE}[\s'\"]+$", re.IGNORECASE)
"""The same without a sign: ``[1] elbow``."""
_BEHIND = re.compile(
    r"['\"\s:=\[({]*(?:->|=>|is\b)?[\s\[({]*(?P<word>(?:columns?|col|index|joint|axis|pos|[qj])[\s_.\[(]*)?"
    r"(?P<number>[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?)",
    re.IGNORECASE,
)
"""A number behind the name of a joint: its index or a value."""
_QUANTITIES = "q|qd|dq|pos|positions?|angles?|theta|vel|velocity|velocities|tau|torques?|efforts?|measured|actual"
_FILLERS = re.compile(
    "and|then|und|et|y|in|t|time|stamp|joint|joints|j|motor|motors|axis|axes|column|columns|col|q|qd|dq|"
    "qdot|pos|position|positions|angle|angles|theta|vel|velocity|velocities|tau|torque|torques|effort|"
    "efforts|measured|actual"
)
"""Words between the names of a list."""
_PROSE = re.compile(
    "a|all|and|any|are|as|at|axes|axis|bad|both|by|cold|continuous|days|each|every|false|first|five|"
    "fixed|floating|for|four|from|good|hot|in|is|it|left|lower|manual|motors|new|no|none|not|of|off|ok|"
    "old|on|one|only|or|order|planar|position|positions|prismatic|revolute|right|same|see|six|ten|the|"
    "these|they|three|to|true|two|unknown|upper|was|were|with|velocity|velocities|effort|efforts|torque|"
    "torques|yes|zero|run|test|trial"
)
"""Words that are no names of joints."""


class MismatchError(Exception):
    """Columns do not fit joints; the text says why."""


class RowNames(NamedTuple):
    """Columns of text that name the joints of each row."""

    pattern: str
    columns: tuple[int, ...]
    numbers: tuple[int, ...] = ()
    """Index of each column in its header; empty where headers have none."""
    listed: bool = False
    """Whether one column has a list of names in each row."""
    first: tuple[str, ...] = ()
    """Names in the first row that has any."""
    labelled: bool = False
    """Whether the header says that these are names."""
    known: bool = False
    """Whether the first rows name joints of the model."""


class Text(NamedTuple):
    """A text that may state names of joints."""

    where: str
    text: str
    following: tuple[str, ...] = ()
    """Comments in the next lines."""
    array: str = ""
    """Name of the array that holds the text."""


def names_of(text):
    """Return the names in a text: ``['a', 'b']``, ``(a; b)``, ``a, b``, ``a b`` or ``a``; or in a list of texts."""
    if not isinstance(text, str):
        return () if text is None else tuple("" if one is None else _clean(str(one)) for one in text)
    body = _inner(text)
    if quoted := _QUOTED.findall(body):
        return tuple(_clean(one or other) for one, other in quoted)
    separator = next((one for one in ",;|\t" if one in body), None)
    return tuple(filter(None, map(_clean, body.split(separator))))


def numbers_of(text):
    """Return the numbers in the text of an array, ``(0.1, 0.2)`` or ``[0.1 0.2]``; None of any other text."""
    text = text.strip()
    if not text or text[-1] not in "])}":
        return None
    body = _inner(text).strip(" \t,;")
    try:
        return [float(one) for one in re.split(r"\s*[,;]\s*|\s+", body)] if body else []
    except ValueError:
        return None


def _inner(text):
    """The text between the innermost brackets, or the text; scalars of numpy without their type."""
    text = _SCALAR.sub(r"\1", text.strip())
    match = re.search(r"[\[({]([^\[\](){}]*)[\])}]", text)
    return match[1] if match and text[-1] in "])}" else text


def _clean(text):
    """A name without quotes and blanks; empty for texts that stand for no value."""
    text = text.strip().strip("'\"").strip()
    return "" if text.lower() in ("", "nan", "none", "null", "na", "n/a", "-", "--") else text


# --- Rows ---


def find_row_names(columns, known):
    """Return all :class:`RowNames` of a table: by headers such as ``name0``, or because texts are joints of the model."""
    sets = {}
    for k, column in enumerate(columns):
        match = re.fullmatch(r"(.*?)(\d{1,4})(\D*)", column.name.strip().lower(), re.DOTALL)  # the last number
        stem, number = (f"{match[1]}*{match[3]}", int(match[2])) if match else (column.name.strip().lower(), -1)
        labelled = bool(_HEADER.fullmatch(stem.replace("*", "").strip(" _.[](){}/-:|")))
        names = [names_of(text) for text in column.sample]
        ours = any(name in known for one in names for name in one)
        if names and (labelled or ours):
            sets.setdefault(stem, []).append((number, k, names, labelled, ours))
    found = []
    for stem, members in sets.items():
        numbers, places, names, labelled, ours = zip(*sorted(members, key=lambda one: one[:2]), strict=True)
        column = columns[places[0]]
        rows = RowNames(stem, places, numbers, False, _first_names(names), all(labelled), any(ours))
        if len(places) == 1 and (column.listed or any(len(one) > 1 for one in names[0])):
            first = next(filter(any, names[0]), ())
            rows = rows._replace(pattern=column.name, numbers=(), listed=True, first=first)
            split = column.listed or any(re.search("[,;|]", text) for text in column.sample)
            count = sum(name in known for name in first)
            if first and (2 * count > len(first) or (rows.labelled and (count or _are_names(first, split)))):
                found.append(rows)
        elif any(rows.first) and (numbers == (-1,) or -1 not in numbers):
            found.append(rows._replace(pattern=column.name, numbers=()) if numbers == (-1,) else rows)
    return found


def find_loose_names(columns, known, arrays):
    """Return a :class:`RowNames` of all columns but `arrays` with one joint of the model in each row.

    There are none if a row has a joint twice.
    """
    found = {}
    for k, column in enumerate(columns):
        names = [names_of(text) for text in column.sample] if column.name not in arrays else []
        if not column.listed and any(map(set(known).intersection, names)) and max(map(len, names)) == 1:
            found[k] = names
    rows = [[one[0] for one in row if one] for row in zip(*found.values(), strict=False)]
    if any(len(set(row)) < len(row) for row in rows):
        return RowNames("", ())
    pattern = ", ".join(columns[k].name for k in found)
    return RowNames(pattern, tuple(found), first=_first_names(found.values()), known=True)


def _first_names(columns):
    """Names of the first row that has any, one of each column."""
    rows = ([next(iter(one), "") for one in row] for row in zip(*columns, strict=False))
    return tuple(next(filter(any, rows), ()))


def nearest(headers, pattern):
    """Return those of several headers that share the longest beginning with a pattern."""
    pattern, lengths = pattern.lower(), []
    for header in headers:
        begins = (size for size in range(len(header), -1, -1) if pattern.startswith(header.lower()[:size]))
        lengths.append(next(begins))
    return [one for one, length in zip(headers, lengths, strict=True) if length == max(lengths)]


def read_row_names(names, arrays):
    """Return the names of each row, (n, k) of str; `arrays` are those of pyarrow by index of the column."""
    if not names.listed:
        return np.column_stack([_read_names(arrays[k]) for k in names.columns])
    rows = [tuple(one) if isinstance(one, list) else one for one in arrays[names.columns[0]].to_pylist()]
    split = {row: names_of(row) for row in set(rows)}
    width = max(map(len, split.values()), default=0)
    padded = {row: (*one, *[""] * (width - len(one))) for row, one in split.items()}
    return np.array([padded[row] for row in rows], object).reshape(len(rows), width)


def _read_names(array):
    """The name in each cell of a column of texts."""
    encoded = array if hasattr(array, "dictionary") else array.dictionary_encode()
    names = [one.decode(errors="replace") if isinstance(one, bytes) else one for one in encoded.dictionary.to_pylist()]
    names = np.array([*map(_clean, names), ""], object)
    return names[encoded.indices.fill_null(len(names) - 1).to_numpy(zero_copy_only=False)]


# --- Statements ---


def comment_texts(lines):
    """Return the texts of comments, given as pairs of line number and text without the mark."""
    texts = []
    for k, (at, line) in enumerate(lines):
        following = [text for n, (other, text) in enumerate(lines[k:]) if other == at + n][1:]
        texts.append(Text(f"the comment in line {at}", line, tuple(following)))
    return [one for one in texts if len(one.text) <= MAX_LENGTH]


def metadata_texts(metadata):
    """Return the texts of metadata, a dict of bytes or texts."""
    texts = []
    for key, value in (metadata or {}).items():
        key, value = (one.decode(errors="replace") if isinstance(one, bytes) else one for one in (key, value))
        with suppress(TypeError, ValueError):
            value = json.loads(value)
        if key not in ("pandas", "ARROW:schema"):
            if isinstance(value, dict):
                texts += metadata_texts(value)
                value = json.dumps(value) if all(isinstance(one, int) for one in value.values()) else ""
            texts += label_text(f"metadata '{key}'", key, value)
    return texts


def label_text(where, label, value, array=""):
    """Return a text or a list of texts with its label as one :class:`Text` in a list; nothing of other values."""
    if isinstance(value, list) and all(isinstance(one, str) for one in value):
        value = ", ".join(value)
    is_text = isinstance(value, str) and len(value) <= MAX_LENGTH and "<" not in value
    return [Text(where, f"{label}: {value}", (), array)] if is_text else []


def stated_order(texts, known, count, pattern="position"):
    """Return the joints of `count` columns and the :class:`Text` that states them, or None.

    Raises
    ------
    MismatchError
        Statements contradict each other, or the number of columns.
    """
    orders = _find_orders(texts, known, count)
    for joints, text in orders:
        if joints != orders[0][0]:
            first, second = (
                f"{one.where} ('{' '.join(one.text.split())[:100]}') has the joints {', '.join(order)}"
                for order, one in (orders[0], (joints, text))
            )
            raise MismatchError(f"{first}, but {second}. Say which by `joints` in the map of columns.")
    if orders:
        return orders[0]
    for names, text, of_joints in _find_lists(texts, known):
        ours = len(set(names) & set(known))
        complete = len(names) == count and (2 * ours > count or (of_joints and ours))
        twice = next((name for name in names if names.count(name) > 1), None)
        says = f"{text.where} names {len(names)} joints: {', '.join(names)}"
        if complete or (of_joints and ours and len(names) > 1):
            if twice:
                raise MismatchError(f"{text.where} names the joint '{twice}' twice.")
            if not complete:
                raise MismatchError(f"{pattern} has {count} columns, but {says}.")
            return names, text
        if of_joints and len(names) == count and not twice and (count > 1 or _has_index(names[0])):
            if known:
                raise MismatchError(f"{says}, none of which is among the joints of the model: {', '.join(known)}.")
            return names, text
    return None


def labelled_joints(texts, known):
    """Return the first list of several names with a label of joints that has joints of the model, as stated_order."""
    lists = ((names, text) for names, text, of_joints in _find_lists(texts, known) if of_joints)
    return next((one for one in lists if len(one[0]) > 1 and set(one[0]) & set(known)), None)


def _find_orders(texts, known, count):
    """Joints and texts with as many joints of the model as there are columns, in one line or in several."""
    whole, parts = [], []
    for one in texts if known and count > 1 else ():
        order, text = _order(one.text, known), one.text
        if len(order) == count:
            whole.append((order, one))
        for line in one.following if 0 < len(order) < count else ():
            text = f"{text}\n{line}"
            if len(text) > MAX_LENGTH or not 0 < len(_order(line, known)) < count:
                break
            if len(order := _order(text, known)) == count:
                parts.append((order, one._replace(text=text)))
                break
    return whole + parts


@lru_cache(maxsize=8)
def _joint_pattern(known):
    """A pattern of the names of joints, the longest first, with a quantity before or behind."""
    names = [re.escape(one) for one in sorted(known, key=len, reverse=True) if re.search(r"[^\W\d]", one)]
    every = "|".join(names) or r"(?!)"
    begin, behind = rf"(?<!\w)(?:(?:{_QUANTITIES})\d*[_.])?", rf"(?:[_.](?:{_QUANTITIES})(?:\[\d+\])?)?"
    return re.compile(rf"{begin}(?P<name>{every}){behind}(?!\w|[./-](?!{every})\w)")


@lru_cache(maxsize=4096)
def _order(text, known):
    """Joints of the model in the order that a text gives them; empty if it gives none."""
    marks, first = list(_joint_pattern(known).finditer(text)), {}
    for k, one in enumerate(marks):
        first.setdefault(one["name"], k)
    names, places = tuple(first), list(first.values())
    if len(names) < 2:
        return names
    begins, ends = [*(one.start() for one in marks), len(text)], [0, *(one.end() for one in marks)]
    gaps = [text[end:begin] for end, begin in zip(ends, begins, strict=True)]
    numbers = _integers(_NUMBER_OF.search(gaps[k][-60:]) for k in places)
    if not numbers:
        numbers = _consecutive(_integers(_BARE_NUMBER.search(gaps[k][-60:]) for k in places))
    behind = [_BEHIND.match(gaps[k + 1]) for k in places]
    if not numbers and any(behind[:-1]):
        numbers = _integers(behind)
        numbers = numbers if numbers and all(one["word"] for one in behind) else _consecutive(numbers)
        if not numbers:
            return ()
    if numbers:
        return tuple(name for _, name in sorted(zip(numbers, names, strict=True)))
    return names if all(map(_is_separator, gaps[1 : places[-1] + 1])) else ()


def _integers(matches):
    """Different integers of all matches; empty if one has none."""
    numbers = [match["number"] if match else "" for match in matches]
    return (
        [int(one) for one in numbers] if all(map(str.isdecimal, numbers)) and len(set(numbers)) == len(numbers) else []
    )


def _consecutive(numbers):
    """Numbers without gaps; empty of others."""
    return numbers if numbers and max(numbers) - min(numbers) == len(numbers) - 1 else []


def _is_separator(gap):
    """Whether a text between two joints only separates the entries of a list."""
    words = re.findall(r"[^\W\d_]+", re.sub(r"[\[({][^\[\](){}]*[\])}]", "", gap))
    return all(_FILLERS.fullmatch(word.lower()) or is_unit(word) for word in words)


def _find_lists(texts, known):
    """Lists with a label, and whether the label is one of joints."""
    for one in texts:
        match = _LABEL.search(one.text)
        text = re.split(r"\s+\w+\s*=", match["names"])[0] if match else ""
        names = names_of(text) if text.strip() or not match else _entries(one.following)
        split = bool(re.search(r"[,;|'\"\[]", text)) or not text.strip()
        if match and names and _are_names([name for name in names if name not in known], split):
            label = match[0][: match.start("names") - match.start()]
            yield names, one, "joint" in label.lower()


def _entries(lines):
    """Names on lines of their own."""
    names = []
    for line in lines:
        match = re.fullmatch(r"-?\s*([\w./-]+)", line.strip())
        if match is None:
            return tuple(names) or names_of(line)
        names.append(match[1])
    return tuple(names)


def _are_names(names, split):
    """Whether texts may be names of joints; where blanks alone split a list, only those with an index are."""
    for name in names:
        word = name.lower()
        is_word = not split or _PROSE.fullmatch(word) or word.endswith("ed")
        if not re.fullmatch(r"(?=.*[^\W\d])[\w./-]+", name) or is_unit(name) or (is_word and not _has_index(name)):
            return False
    return True


def _has_index(name):
    """Whether a name has a digit or a sign that no word has."""
    return bool(re.search(r"[\d_/.]", name)) and not is_unit(name)
