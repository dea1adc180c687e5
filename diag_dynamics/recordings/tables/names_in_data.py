# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in the data: in columns of text for each row, in comments, metadata and arrays for all rows."""

import json
import re
from contextlib import suppress
from functools import lru_cache
from itertools import takewhile
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.headers import is_unit

NAMES = ("name", "names", "joint", "joints", "joint_name", "joint_names", "joint_order")
MAX_LENGTH = 10_000  # characters of a text that may state names of joints

_HEADER = re.compile(r"(?:.*[./:\s|])?(?:(?:joints?[_ -]*)?names?|joints?|joint[_ -]?order)")
_NO_NAMES = ("", "nan", "none", "null", "na", "n/a", "-", "--")
_LABEL = re.compile(
    r"(?:^|[,;{|\"']\s*)[\"']?(?P<label>joints?(?:[_ -]?(?:names?|order))?|names?|order|motors|actuators|axes|dofs)"
    r"(?:\s*\([^)]*\))?[\"']?\s*[:=]\s*(?P<names>.*)",
    re.IGNORECASE,
)
"""A label of a list of names, and the list."""
_QUANTITIES = "q|qd|dq|pos|positions?|angles?|theta|vel|velocity|velocities|tau|torques?|efforts?|measured|actual"
_FILLERS = re.compile(
    f"and|then|is|und|et|y|in|t|time|stamp|index|joints?|j|motors?|ax[ei]s|columns?|col|qdot|{_QUANTITIES}"
)
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
        return [
            float(one) for one in re.split(r"\s*[,;]\s*|\s+", _inner(text).strip(" \t,;")) if one
        ]
    except ValueError:
        return None


def _inner(text):
    """Return the text between the innermost brackets at the end, or the text; scalars of numpy without their type."""
    text = re.sub(r"\b(?:np|numpy)\.\w+\(([^()\[\]]*)\)", r"\1", text.strip())
    match = re.search(r"[\[({]([^\[\](){}]*)[\])}]", text)
    return match[1] if match and text[-1] in "])}" else text


def _clean(text):
    text = text.strip().strip("'\"").strip()
    return "" if text.lower() in _NO_NAMES else text


# --- Names in rows ---


def find_row_names(columns, known):
    """Return all :class:`RowNames`: columns of texts with a header such as ``name0``, or with the model's joints."""
    sets = {}
    for k, column in enumerate(columns):
        header, names = column.name.strip().lower(), [names_of(text) for text in column.sample]
        match = re.fullmatch(r"(.*?)(\d{1,4})(\D*)", header, re.DOTALL)  # the last number
        stem, number = (f"{match[1]}*{match[3]}", int(match[2])) if match else (header, -1)
        labelled = bool(_HEADER.fullmatch(stem.replace("*", "").strip(" _.[](){}/-:|")))
        ours = any(set(one).intersection(known) for one in names)
        if any(names) and (labelled or ours):
            sets.setdefault((stem, labelled), []).append((number, k, names))
        if ours and not column.listed and max(map(len, names)) == 1:
            sets.setdefault((None, False), []).append((-1, k, names))
    found = [_row_names(columns, known, *key, sorted(members)) for key, members in sets.items()]
    return list(filter(None, found))


def _row_names(columns, known, stem, labelled, members):
    """Return the RowNames of columns of one stem, or of any header without one; None if their texts are no names."""
    numbers, places, names = zip(*members, strict=True)
    column, numbered = columns[places[0]], -1 not in numbers
    if (
        stem is not None
        and len(places) == 1
        and (column.listed or any(len(one) > 1 for one in names[0]))
    ):
        first = next(filter(None, names[0]))
        ours = len(set(first).intersection(known))
        split = column.listed or any(re.search("[,;|]", text) for text in column.sample)
        valid = 2 * ours > len(first) or (labelled and (ours or split))
        return RowNames(column.name, places, (), True, first, labelled, ours > 0) if valid else None
    rows = [tuple(next(iter(one), "") for one in row) for row in zip(*names, strict=False)]
    given = [list(filter(None, row)) for row in rows]
    different = len(places) > 1 and all(len(set(row)) == len(row) for row in given)
    if not any(given) or not (different if stem is None else len(places) == 1 or numbered):
        return None
    pattern = stem if numbered else ", ".join(columns[k].name for k in places)
    ours = any(set(row).intersection(known) for row in rows)
    return RowNames(
        pattern, places, numbers if numbered else (), False, next(filter(any, rows)), labelled, ours
    )


def shared_length(first, second):
    """Return how many characters two headers share from their beginnings on, whatever their case."""
    pairs = zip(first.lower(), second.lower(), strict=False)
    return len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))


def read_row_names(names, arrays):
    """Return the names of each row, (n, k) of str; `arrays` are those of pyarrow by index of the column."""
    if not names.listed:
        columns = [arrays[k].dictionary_encode() for k in names.columns]
        places = [
            one.indices.fill_null(len(one.dictionary)).to_numpy(zero_copy_only=False)
            for one in columns
        ]
        texts = [
            np.array([*map(_clean, one.dictionary.to_pylist()), ""], object) for one in columns
        ]
        return np.column_stack([text[place] for text, place in zip(texts, places, strict=True)])
    rows = [
        tuple(one) if isinstance(one, list) else one for one in arrays[names.columns[0]].to_pylist()
    ]
    split = {row: names_of(row) for row in set(rows)}
    width = max(map(len, split.values()), default=0)
    padded = {row: (*one, *[""] * (width - len(one))) for row, one in split.items()}
    return np.array([padded[row] for row in rows], object).reshape(len(rows), width)


# --- Comments, metadata and arrays ---


def comment_texts(lines):
    """Return the texts of comments, given by line number without their marks."""
    texts = []
    for at, line in lines.items():
        end = next(n for n in range(at + 1, at + len(lines) + 1) if n not in lines)
        texts.append(
            Text(f"line {at}", line[:MAX_LENGTH], tuple(lines[n] for n in range(at + 1, end)))
        )
    return texts


def metadata_texts(metadata):
    """Return the texts of metadata, a dict of bytes or texts."""
    texts = []
    for key, value in (metadata or {}).items():
        key, value = (
            one.decode(errors="replace") if isinstance(one, bytes) else one for one in (key, value)
        )
        with suppress(TypeError, ValueError):
            value = json.loads(value)
        if isinstance(value, dict) and key != "pandas":
            texts += metadata_texts(value)
            value = json.dumps(value)
        texts += label_text(f"metadata '{key}'", key, value)
    return texts


def label_text(where, label, value):
    """Return a text or a list of texts with its label as one :class:`Text` in a list; nothing of other values."""
    if isinstance(value, list) and all(isinstance(one, str) for one in value):
        value = ", ".join(value)
    is_text = isinstance(value, str) and len(value) <= MAX_LENGTH and "<" not in value
    return [Text(where, f"{label}: {value}")] if is_text else []


def stated_order(texts, known, count):
    """Return the joints of `count` columns and what states them, or None; InputError for contradictions."""
    orders = find_orders(texts, known, count)
    for order in orders:
        if order[0] != orders[0][0]:
            first, second = (
                f"{where} has the joints {', '.join(joints)}"
                for joints, where in (orders[0], order)
            )
            raise InputError(f"{first}, but {second}.")
    if orders:
        return orders[0]
    for names, where, of_joints in _find_lists(texts, known):
        ours, fits, twice = (
            len(set(names) & set(known)),
            len(names) == count,
            len(set(names)) < len(names),
        )
        says = f"{where} names {len(names)} joints: {', '.join(names)}"
        if ours and ((of_joints and len(names) > 1) or (fits and 2 * ours > count)):
            if twice or not fits:
                raise InputError(f"{says}; expected a different one for each of {count} columns.")
            return names, where
        if of_joints and fits and not twice and not ours and (count > 1 or _INDEX.search(names[0])):
            if known:
                raise InputError(
                    f"{says}, none of which is among the joints of the model: {', '.join(known)}."
                )
            return names, where
    return None


def find_orders(texts, known, count):
    """Return joints, as many of the model as there are columns, and what has them: a line, or several."""
    found = []
    for one in texts if known and count > 1 else ():
        order = _order(one.text, known, count)
        if (
            not order
            and one.following
            and any(map(itemgetter("name"), _tokens(known).finditer(one.text)))
        ):
            order = _order("\n".join((one.text, *one.following))[:MAX_LENGTH], known, count)
        if order:
            found.append((order, one.where))
    return found


@lru_cache(maxsize=8)
def _tokens(known):
    """Return a pattern of names of joints with a quantity before or after, words in brackets, numbers, and words."""
    names = [
        re.escape(one) for one in sorted(known, key=len, reverse=True) if re.search(r"[^\W\d]", one)
    ]
    every = "|".join(names) or r"(?!)"
    before, after = (
        rf"(?<!\w)(?:(?:{_QUANTITIES})\d*[_.])?",
        rf"(?:[_.](?:{_QUANTITIES})(?:\[\d+\])?)?",
    )
    name = rf"{before}(?P<name>{every}){after}(?!\w|[./-](?!{every})\w)"
    number = r"(?P<number>(?:(?<!\w)[-+])?\d+(?:\.\d*)?(?:e[-+]?\d+)?)(?P<mark>\s*[])}:=|>-])?"
    return re.compile(rf"{name}|\((?:(?!{every})[^()\d])*\)|{number}|(?P<word>[^\W\d_]+)")


@lru_cache(maxsize=4096)
def _order(text, known, count):
    """Return `count` joints of the model in the order of a text; empty if it gives none."""
    kinds, tokens, names = "", [], set()
    for token in _tokens(known).finditer(text):
        name, number, word = token["name"], token["number"], token["word"]
        is_filler = word and (_FILLERS.fullmatch(word.lower()) or is_unit(word))
        if name not in names and (name or number or (word and not is_filler)):
            kinds += "n" if name else "w" if word else "i" if number.isdecimal() else "f"
            tokens.append(token)
            names.add(name or "")
    for kind in ("in", "ni", "n"):
        at = kinds.find(kind * count)
        part = tokens[at : at + count * len(kind)] if at >= 0 else ()
        joints = tuple(filter(None, map(itemgetter("name"), part)))
        numbers = [int(one["number"]) for one in part if one["number"]]
        if joints and not numbers:
            return joints
        marked = kind == "in" and all(one["mark"] for one in part if one["number"])
        if len(set(numbers)) == count and (marked or max(numbers) - min(numbers) == count - 1):
            return tuple(name for _, name in sorted(zip(numbers, joints, strict=True)))
    return ()


def _find_lists(texts, known):
    """Yield lists with a label as names, what has them, and whether the label is one of joints."""
    for one in texts:
        if match := _LABEL.search(one.text):
            text = re.split(r"\s+\w+\s*=", match["names"])[0].strip()
            text = text or ",".join(line.strip("- ") for line in one.following)
            names, split = names_of(text), re.search(r"[,;|'\"\[]", text)
            # where blanks alone split a list, only names with an index are names
            pattern = rf"(?=.*[^\W\d])(?=.*{_INDEX.pattern if not split else ''})[\w./-]+(?<!ed)"
            foreign = [name for name in names if name not in known]
            if names and not any(
                is_unit(name) or not re.fullmatch(pattern, name) for name in foreign
            ):
                yield names, one.where, "joint" in match["label"].lower()
