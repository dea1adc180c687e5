# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of joints in columns of text, row by row."""

import re
from typing import NamedTuple

import numpy as np

from diag_dynamics.tables.units import is_unit

NAMES = ("name", "names", "joint", "joints", "joint_name", "joint_names", "joint_order")
"""Names of lists of joint names, in small letters."""

_LABEL = re.compile(r"(?:.*[./:\s|])?(?:(?:joints?[_ -]*)?names?|joints?|joint[_ -]?order)")
"""Header of a column of joint names without its index, in small letters."""

_QUOTED = re.compile(r"""b?'([^']*)'|b?"([^"]*)\"""")

_SCALAR = re.compile(r"\b(?:np|numpy)\.\w+\(([^()\[\]]*)\)")

_PROSE = frozenset(
    (
        *("a", "all", "and", "any", "are", "as", "at", "axes", "axis", "bad"),
        *("both", "by", "cold", "continuous", "days", "each", "every", "false", "first", "five"),
        *("fixed", "floating", "for", "four", "from", "good", "hot", "in", "is", "it"),
        *("left", "lower", "manual", "motors", "new", "no", "none", "not", "of", "off"),
        *("ok", "old", "on", "one", "only", "or", "order", "planar", "position", "positions"),
        *("prismatic", "revolute", "right", "same", "see", "six", "ten", "the", "these", "they"),
        *("three", "to", "true", "two", "unknown", "upper", "was", "were", "with", "velocity"),
        *("velocities", "effort", "efforts", "torque", "torques", "yes", "zero", "run", "test", "trial"),
    )
)
"""Words that are no names of joints."""

_NO_NAMES = frozenset(("", "nan", "none", "null", "na", "n/a", "-", "--"))


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


def is_name(text, split):
    """Return whether a text may be the name of a joint.

    Parameters
    ----------
    text : str
    split : bool
        Whether signs other than blanks split the list. Between blanks only identifiers are names, because words are prose.
    """
    if not re.fullmatch(r"(?=.*[^\W\d])[\w./-]+", text):
        return False
    word = text.lower()
    return is_identifier(text) or (split and word not in _PROSE and not word.endswith("ed") and not is_unit(word))


def is_identifier(text):
    """Return whether a name has a digit or a sign that no word has."""
    return bool(re.search(r"[\d_/.]", text)) and not is_unit(text)


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
            ours = sum(name in known for name in first)
            split = column.listed or any(re.search("[,;|]", text) for text in column.sample)
            if not (ours if flags["labelled"] else 2 * ours > len(first)) and not (
                flags["labelled"] and all(is_name(name, split) for name in first)
            ):
                continue
            found.append(RowNames(column.name, whole=places[0], first=first, **flags))
        elif len(members) == 1 and numbers == (-1,):
            found.append(RowNames(column.name, places, first=first, **flags))
        elif -1 not in numbers:
            first = first_names(names)
            found.append(RowNames(stem.replace("{}", "*"), places, numbers, first=first, **flags))
    return found


def first_names(columns):
    """Return the names of the first row that has any, of names in the first rows of columns."""
    rows = ([next(iter(one), "") for one in row] for row in zip(*columns, strict=False))
    return tuple(next((row for row in rows if any(row)), ()))


def single_names(columns, known):
    """Return the indices of columns of text with one name in each row, joints of the model among them, by content alone.

    They are none if a row has a joint twice, because columns of names have each joint once.
    """
    found = {}
    for k, column in enumerate(columns):
        names = [names_of(text) for text in column.sample]
        if not column.listed and any(map(set(known).intersection, names)) and max(map(len, names)) == 1:
            found[k] = names
    rows = [[one[0] for one in row if one] for row in zip(*found.values(), strict=False)]
    return tuple(found) if all(len(set(row)) == len(row) for row in rows) else ()


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
