# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in the data: in columns of text for each row, in comments, metadata and arrays for all rows."""

import json
import re
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.headers import is_unit

NAMES = ("name", "names", "joint", "joints", "joint_name", "joint_names", "joint_order")
MAX_LENGTH = 10_000  # characters of a text that may state names of joints

_HEADER = re.compile(r"(?:.*[./:\s|])?(?:(?:joints?[_ -]*)?names?|joints?|joint[_ -]?order)")
_NO_NAMES = ("", "nan", "none", "null", "na", "n/a", "-", "--")
_LABEL = re.compile(
    r"(?:^|[,;{|\"']\s*|[:=]\s?[^\s,;]{1,80}\s+)[\"']?(?:the\s+)?(?:(?:names?|order)\s+of\s+(?:the\s+|all\s+)?)?"
    r"(?P<label>joints?(?:[_ -]?(?:names?|order))?|names?|order|motors|actuators|axes|dofs)"
    r"(?:\s*\([^)]*\)|\s+(?:of|from|as|in order)\b[^:=,]*)?[\"']?\s*[:=]\s*(?P<names>.*)",
    re.IGNORECASE,
)
"""A label of a list of names, and the list."""
_BEFORE = re.compile(
    r"(?:^|[^\w.])(?:[a-z_]+[\s.]?)?[\[(]?(?P<number>\d{1,3})[\])]??"
    r"\s*(?P<sign>[:=)|]|->|=>|-(?=\s)|\bis\b)?[\s'\"\[(]*$",
    re.IGNORECASE,
)
"""The number of a joint before its name: ``q1 = elbow``, ``[1] elbow``."""
_AFTER = re.compile(
    r"['\"\s:=\[({]*(?:->|=>|is\b)?[\s\[({]*(?P<sign>(?:columns?|col|index|joint|axis|pos|[qj])[\s_.\[(]*)?"
    r"(?P<number>[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?)",
    re.IGNORECASE,
)
"""A number after the name of a joint: its index or a value."""
_QUANTITIES = "q|qd|dq|pos|positions?|angles?|theta|vel|velocity|velocities|tau|torques?|efforts?|measured|actual"
_FILLERS = re.compile(f"and|then|und|et|y|in|t|time|stamp|joints?|j|motors?|ax[ei]s|columns?|col|qdot|{_QUANTITIES}")
"""Words between the names of a list."""
_INDEX = re.compile(r"[\d_/.]")  # a digit or a sign that no word has


class RowNames(NamedTuple):
    """Columns of text that name the joints of each row."""

    pattern: str
    columns: tuple[int, ...]
    numbers: tuple[int, ...] = ()  # of the columns by their headers; empty where headers have none
    listed: bool = False  # whether one column has a list of names in each row
    first: tuple[str, ...] = ()  # names in the first row that has any
    labelled: bool = False  # whether the header says that these are names
    known: bool = False  # whether the first rows name joints of the model


class Text(NamedTuple):
    """A text that may state names of joints."""

    where: str
    text: str
    following: tuple[str, ...] = ()  # comments in the next lines
    array: str = ""  # name of the array that holds the text


def names_of(text):
    """Return the names in a text, ``['a', 'b']``, ``(a; b)``, ``a, b``, ``a b`` or ``a``, or in a list of texts."""
    if not isinstance(text, str):
        return tuple("" if one is None else _clean(str(one)) for one in text or ())
    body = _inner(text)
    if quoted := re.findall(r"""b?'([^']*)'|b?"([^"]*)\"""", body):
        return tuple(_clean(one or other) for one, other in quoted)
    separator = next((one for one in ",;|\t" if one in body), None)
    return tuple(filter(None, map(_clean, body.split(separator))))


def numbers_of(text):
    """Return the numbers in the text of an array, ``(0.1, 0.2)`` or ``[0.1 0.2]``; None of any other text."""
    if not text.strip().endswith(("]", ")", "}")):
        return None
    try:
        return [float(one) for one in re.split(r"\s*[,;]\s*|\s+", _inner(text).strip(" \t,;")) if one]
    except ValueError:
        return None


def _inner(text):
    """The text between the innermost brackets at the end, or the text; scalars of numpy without their type."""
    text = re.sub(r"\b(?:np|numpy)\.\w+\(([^()\[\]]*)\)", r"\1", text.strip())
    match = re.search(r"[\[({]([^\[\](){}]*)[\])}]", text)
    return match[1] if match and text[-1] in "])}" else text


def _clean(text):
    text = text.strip().strip("'\"").strip()
    return "" if text.lower() in _NO_NAMES else text


# --- Names in rows ---


def find_row_names(columns, known, arrays):
    """Return all :class:`RowNames` of a table but for `arrays`, which name the joints of all rows.

    Headers such as ``name0`` say that texts are names. Columns with one joint of the model in each row may have any.
    """
    sets = {}
    for k, column in enumerate(columns):
        header, names = column.name.strip().lower(), [names_of(text) for text in column.sample]
        match = re.fullmatch(r"(.*?)(\d{1,4})(\D*)", header, re.DOTALL)  # the last number
        stem, number = (f"{match[1]}*{match[3]}", int(match[2])) if match else (header, -1)
        labelled = bool(_HEADER.fullmatch(stem.replace("*", "").strip(" _.[](){}/-:|")))
        ours = any(set(one).intersection(known) for one in names)
        if any(names) and (labelled or ours):
            sets.setdefault((stem, labelled), []).append((number, k, names))
        if ours and not column.listed and max(map(len, names)) == 1 and column.name not in arrays:
            sets.setdefault((None, False), []).append((-1, k, names))
    found = [_row_names(columns, known, *key, sorted(members)) for key, members in sets.items()]
    return list(filter(None, found))


def _row_names(columns, known, stem, labelled, members):
    """The RowNames of columns of one stem, or of any header without one; None if their texts are no names."""
    numbers, places, names = zip(*members, strict=True)
    column = columns[places[0]]
    listed = stem is not None and len(places) == 1 and (column.listed or any(len(one) > 1 for one in names[0]))
    rows = names[0] if listed else [tuple(next(iter(one), "") for one in row) for row in zip(*names, strict=False)]
    first = next(filter(any, rows), ())
    if listed:
        split = column.listed or any(re.search("[,;|]", text) for text in column.sample)
        ours = len(set(first).intersection(known))
        valid = 2 * ours > len(first) or (labelled and (ours or split))
    elif stem is None:
        given = [list(filter(None, row)) for row in rows]
        valid = len(places) > 1 and all(len(set(row)) == len(row) for row in given)
    else:
        valid = len(places) == 1 or -1 not in numbers
    ours = any(set(row).intersection(known) for row in rows)
    numbers = () if listed or -1 in numbers else numbers
    pattern = stem if numbers else ", ".join(columns[k].name for k in places)
    return RowNames(pattern, places, numbers, listed, first, labelled, ours) if first and valid else None


def shared_length(first, second):
    """Return how many characters two headers share from their beginnings on, whatever their case."""
    pairs = enumerate(zip(first.lower(), second.lower(), strict=False))
    return next((k for k, (one, other) in pairs if one != other), min(len(first), len(second)))


def read_row_names(names, arrays):
    """Return the names of each row, (n, k) of str; `arrays` are those of pyarrow by index of the column."""
    if not names.listed:
        columns = [arrays[k].dictionary_encode() for k in names.columns]
        places = [one.indices.fill_null(len(one.dictionary)).to_numpy(zero_copy_only=False) for one in columns]
        texts = [np.array([*map(_clean, one.dictionary.to_pylist()), ""], object) for one in columns]
        return np.column_stack([text[place] for text, place in zip(texts, places, strict=True)])
    rows = [tuple(one) if isinstance(one, list) else one for one in arrays[names.columns[0]].to_pylist()]
    split = {row: names_of(row) for row in set(rows)}
    width = max(map(len, split.values()), default=0)
    padded = {row: (*one, *[""] * (width - len(one))) for row, one in split.items()}
    return np.array([padded[row] for row in rows], object).reshape(len(rows), width)


# --- Comments, metadata and arrays ---


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
    """Return the joints of `count` columns and the :class:`Text` that states them, or None; InputError for contradictions."""
    orders = find_orders(texts, known, count)
    for order in orders:
        if order[0] != orders[0][0]:
            first, second = (
                f"{one.where} ('{' '.join(one.text.split())[:100]}') has the joints {', '.join(joints)}"
                for joints, one in (orders[0], order)
            )
            raise InputError(f"{first}, but {second}. Say which by `joints` in the map of columns.")
    if orders:
        return orders[0]
    for names, text, of_joints in find_lists(texts, known):
        ours, fits, twice = len(set(names) & set(known)), len(names) == count, len(set(names)) < len(names)
        says = f"{text.where} names {len(names)} joints: {', '.join(names)}"
        if ours and ((of_joints and len(names) > 1) or (fits and 2 * ours > count)):
            if twice:
                raise InputError(f"{says}. One of them is there twice.")
            if not fits:
                raise InputError(f"{pattern} has {count} columns, but {says}.")
            return names, text
        if of_joints and fits and not twice and not ours and (count > 1 or _INDEX.search(names[0])):
            if known:
                raise InputError(f"{says}, none of which is among the joints of the model: {', '.join(known)}.")
            return names, text
    return None


def find_orders(texts, known, count):
    """Return joints and texts with as many joints of the model as there are columns, in one line or in several."""
    found = []
    for one in texts if known and count > 1 else ():
        text, order = one.text, _order(one.text, known)
        for line in one.following if 0 < len(order) < count else ():
            if len(order) == count or len(text) > MAX_LENGTH or not 0 < len(_order(line, known)) < count:
                break
            text = f"{text}\n{line}"
            order = _order(text, known)
        if len(order) == count:
            found.append((order, one._replace(text=text)))
    return found


@lru_cache(maxsize=8)
def _joint_pattern(known):
    """A pattern of the names of joints, the longest first, with a quantity before or after."""
    names = [re.escape(one) for one in sorted(known, key=len, reverse=True) if re.search(r"[^\W\d]", one)]
    every = "|".join(names) or r"(?!)"
    before, after = rf"(?<!\w)(?:(?:{_QUANTITIES})\d*[_.])?", rf"(?:[_.](?:{_QUANTITIES})(?:\[\d+\])?)?"
    return re.compile(rf"{before}(?P<name>{every}){after}(?!\w|[./-](?!{every})\w)")


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
    before, after = [_BEFORE.search(gaps[k][-60:]) for k in places], [_AFTER.match(gaps[k + 1]) for k in places]
    if numbers := _numbers(before) or _numbers(after, mixed=True):
        return tuple(name for _, name in sorted(zip(numbers, names, strict=True)))
    between = re.sub(r"[\[({][^\[\](){}]*[\])}]", "", "\n".join(gaps[1 : places[-1] + 1]))
    words = re.findall(r"[^\W\d_]+", between)
    listed = all(_FILLERS.fullmatch(word.lower()) or is_unit(word) for word in words)
    return names if listed and not any(after[:-1]) else ()


def _numbers(matches, mixed=False):
    """Different integers of all matches, consecutive without signs; empty otherwise."""
    if not all(matches) or not all(match["number"].isdecimal() for match in matches):
        return []
    numbers, signs = [int(match["number"]) for match in matches], {bool(match["sign"]) for match in matches}
    consecutive = max(numbers) - min(numbers) == len(numbers) - 1 and (mixed or signs == {False})
    return numbers if len(set(numbers)) == len(numbers) and (signs == {True} or consecutive) else []


def find_lists(texts, known):
    """Yield lists with a label as names, the Text, and whether the label is one of joints."""
    for one in texts:
        if match := _LABEL.search(one.text):
            text = re.split(r"\s+\w+\s*=", match["names"])[0].strip()
            text = text or ",".join(line.strip("- ") for line in one.following)
            names = names_of(text)
            if names and _are_names([name for name in names if name not in known], re.search(r"[,;|'\"\[]", text)):
                yield names, one, "joint" in one.text[match.start() : match.start("names")].lower()


def _are_names(names, split):
    """Whether texts may be names of joints; where blanks alone split a list, only those with an index are."""
    return all(
        re.fullmatch(r"(?=.*[^\W\d])[\w./-]+(?<!ed)", name) and not is_unit(name) and (split or _INDEX.search(name))
        for name in names
    )
