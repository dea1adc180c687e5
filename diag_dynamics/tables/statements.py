# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statements of the order of joints, in comments, metadata and arrays of text."""

import json
import re
from contextlib import suppress
from functools import lru_cache
from typing import NamedTuple

from diag_dynamics.tables.names import is_identifier, is_name, names_of
from diag_dynamics.tables.units import is_unit

MAX_LENGTH = 10_000
"""Characters of a text that may state names of joints."""

_LABEL = re.compile(
    r"(?:^|[,;{|\"']\s*|[:=]\s?[^\s,;]{1,80}\s+)[\"']?(?:the\s+)?(?:(?:names?|order)\s+of\s+(?:the\s+|all\s+)?)?"
    r"(?P<label>joints?(?:[_ -]?(?:names?|order))?|names?|order|motors|actuators|axes|dofs)"
    r"(?:\s*\([^)]*\)|\s+(?:of|from|as|in order)\b[^:=,]*)?[\"']?\s*[:=]\s*(?P<names>.*)",
    re.IGNORECASE,
)
"""A label of a list of names, and the list."""

_BEFORE = r"(?:^|[^\w.])(?:[a-z_]+[\s.]?)?[\[(]?(?P<number>\d{1,3})[\])]?"
_NUMBER_OF = re.compile(rf"{_BEFORE}\s*(?:[:=)|]|->|=>|-(?=\s)|\bis\b)\s*['\"\[(]*$", re.IGNORECASE)
"""The number of a joint in front of its name: ``q1 = elbow``."""
_BARE_NUMBER = re.compile(rf"{_BEFORE}[\s'\"]+$", re.IGNORECASE)
"""Likewise, without a sign between them: ``[1] elbow``."""

_BEHIND = re.compile(
    r"['\"\s:=\[({]*(?:->|=>|is\b)?[\s\[({]*(?P<word>(?:columns?|col|index|joint|axis|pos|[qj])[\s_.\[(]*)?"
    r"(?P<number>[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?)",
    re.IGNORECASE,
)
"""A number behind the name of a joint: its index, or a value of the joint."""

_QUANTITIES = "q|qd|dq|pos|positions?|angles?|theta|vel|velocity|velocities|tau|torques?|efforts?|measured|actual"

_FILLERS = frozenset(
    (
        *("and", "then", "und", "et", "y", "in", "t", "time", "stamp"),
        *("joint", "joints", "j", "motor", "motors", "axis", "axes", "column", "columns"),
        *("col", "q", "qd", "dq", "qdot", "pos", "position", "positions", "angle"),
        *("angles", "theta", "vel", "velocity", "velocities", "tau", "torque", "torques", "effort"),
        *("efforts", "measured", "actual"),
    )
)
"""Words between the names of a list."""

_ENTRY = re.compile(r"-?\s*(?P<name>[\w./-]+)")


class Text(NamedTuple):
    """A text that may state names of joints."""

    where: str
    """Place in the file, for messages."""
    text: str
    following: tuple[str, ...] = ()
    """Comments in the next lines, without a line between them."""
    array: str = ""
    """Name of the array that holds the text."""


class Stated(NamedTuple):
    """Names of the joints of a table in the order of its columns."""

    joints: tuple[str, ...]
    where: str
    """Place in the file, for messages."""
    text: str = ""
    array: str = ""


def comments(lines):
    """Return texts of comments.

    Parameters
    ----------
    lines : list of (int, str)
        Numbers and texts of comments, without what marks them.
    """
    texts = []
    for k, (at, line) in enumerate(lines):
        following = []
        for n, (other, text) in enumerate(lines[k + 1 :], 1):
            if other != at + n:
                break
            following.append(text)
        if len(line) <= MAX_LENGTH:
            texts.append(Text(f"the comment in line {at}", line, tuple(following)))
    return texts


def metadata_texts(metadata):
    """Return texts of metadata, a dict of bytes or texts."""
    texts = []
    for key, value in (metadata or {}).items():
        key, value = (one.decode(errors="replace") if isinstance(one, bytes) else one for one in (key, value))
        if str(key) in ("pandas", "ARROW:schema"):
            continue
        with suppress(TypeError, ValueError):
            value = json.loads(value)
        if isinstance(value, dict):
            texts += metadata_texts(value)
            value = json.dumps(value) if all(isinstance(one, int) for one in value.values()) else ""
        texts += listing(f"metadata '{key}'", str(key), value)
    return texts


def listing(where, label, value, array=""):
    """Return a text or a list of texts with its label as a list of one :class:`Text`; empty if it is neither."""
    if isinstance(value, list) and all(isinstance(one, str) for one in value):
        value = ", ".join(value)
    if not isinstance(value, str) or len(value) > MAX_LENGTH or "<" in value:
        return []
    return [Text(where, f"{label}: {value}", (), array)]


def stated_order(texts, known, count, what="position"):
    """Return the statement of the order of columns: a problem or '', and a :class:`Stated` or None.

    Parameters
    ----------
    texts : sequence of Text
    known : tuple of str
        Names of the model's joints.
    count : int
        Columns of positions.
    what : str
        Name of these columns, for messages.
    """
    found = _full(texts, known, count)
    for one in found:
        if one.joints != found[0].joints:
            first = found[0]
            return (
                f"{_quoted(first)} has the joints {_list(first.joints)}, but {_quoted(one)} has {_list(one.joints)}. "
                "Say which by `joints` in the map of columns.",
                None,
            )
    if found:
        return "", found[0]
    for one, sure in _labelled(texts, known):
        names, ours = one.joints, set(one.joints) & set(known)
        if len(names) == count and (2 * len(ours) > count or (sure and ours)):
            return _twice(one) or "", one
        if sure and ours and len(names) > 1:
            problem = (
                _twice(one) or f"{what} has {count} columns, but {one.where} names {len(names)} joints: {_list(names)}."
            )
            return problem, None
        if sure and len(names) == count and len(set(names)) == count and (count > 1 or is_identifier(names[0])):
            if known:
                return (
                    f"{one.where} names {_list(names)}, none of which is among the joints of the model: {_list(known)}.",
                    None,
                )
            return "", one
    return "", None


def labelled_joints(texts, known):
    """Return the first list with a label of joint names that has joints of the model; None without one."""
    lists = [one for one, sure in _labelled(texts, known) if sure]
    return next((one for one in lists if len(one.joints) > 1 and set(one.joints) & set(known)), None)


def _full(texts, known, count):
    """Statements that have as many joints of the model as there are columns; in one line, or in several."""
    found, held = [], []
    for one in texts if known and count > 1 else ():
        order = _order(one.text, known)
        if len(order) == count:
            found.append(Stated(order, one.where, one.text, one.array))
        elif order:
            held.append(one)
    for one in held:
        text = one.text
        for line in one.following:
            text = f"{text}\n{line}"
            if len(text) > MAX_LENGTH or not 0 < len(_order(line, known)) < count:
                break
            if len(_order(text, known)) == count:
                found.append(Stated(_order(text, known), one.where, text, one.array))
                break
    return found


@lru_cache(maxsize=8)
def _matcher(known):
    """A pattern of the names of joints, the longest first, with a quantity before or behind."""
    names = [re.escape(one) for one in sorted(known, key=len, reverse=True) if re.search(r"[^\W\d]", one)]
    if not names:
        return None
    quantity = f"(?:{_QUANTITIES})"
    every = "|".join(names)
    end = rf"(?!\w|[./-](?!{every})\w)"
    return re.compile(rf"(?<!\w)(?:{quantity}\d*[_.])?(?P<name>{every})(?:[_.]{quantity}(?:\[\d+\])?)?{end}")


@lru_cache(maxsize=4096)
def _order(text, known):
    """Joints of the model in the order that a text gives them; empty if it gives none."""
    matcher = _matcher(known)
    marks = list(matcher.finditer(text)) if matcher else []
    names = list(dict.fromkeys(one["name"] for one in marks))
    first = [next(k for k, one in enumerate(marks) if one["name"] == name) for name in names]
    ends = [0, *(one.end() for one in marks)]
    begins = [*(one.start() for one in marks), len(text)]
    before = [text[ends[k] : begins[k]][-60:] for k in first]
    behind = [_BEHIND.match(text[ends[k + 1] : begins[k + 1]]) for k in first]
    if len(names) < 2:
        return tuple(names)
    if numbers := _integers(_NUMBER_OF.search(one) for one in before):
        return _by_number(numbers, names)
    if (numbers := _integers(_BARE_NUMBER.search(one) for one in before)) and _are_consecutive(numbers):
        return _by_number(numbers, names)
    if any(behind[:-1]):
        numbers = _integers(behind)
        indices = numbers and (_are_consecutive(numbers) or all(one["word"] for one in behind))
        return _by_number(numbers, names) if indices else ()
    gaps = [text[ends[k] : begins[k]] for k in range(1, first[-1] + 1)]
    return tuple(names) if all(map(_is_separator, gaps)) else ()


def _integers(matches):
    """Different integers of all matches; None if one has none."""
    matches = list(matches)
    if not all(one and re.fullmatch(r"\d+", one["number"]) for one in matches):
        return None
    numbers = [int(one["number"]) for one in matches]
    return numbers if len(set(numbers)) == len(numbers) else None


def _are_consecutive(numbers):
    return max(numbers) - min(numbers) == len(numbers) - 1


def _by_number(numbers, names):
    return tuple(name for _, name in sorted(zip(numbers, names, strict=True)))


def _is_separator(gap):
    """Whether a text between two joints only separates the entries of a list."""
    bare = re.sub(r"[\[({][^\[\](){}]*[\])}]", "", gap)
    return all(word.lower() in _FILLERS or is_unit(word) for word in re.findall(r"[^\W\d_]+", bare))


def _labelled(texts, known):
    """Lists with a label, and whether the label is one of joints."""
    for one in texts:
        found = _LABEL.search(one.text)
        if not found:
            continue
        text = re.split(r"\s+\w+\s*=", found["names"])[0]
        names = names_of(text) if text.strip() else _entries(one.following)
        split = bool(re.search(r"[,;|'\"\[]", text)) or not text.strip()
        if names and all(name in known or is_name(name, split) for name in names):
            yield Stated(names, one.where, one.text, one.array), "joint" in found[0][: found.start("names")].lower()


def _entries(lines):
    """Names on lines of their own."""
    names = []
    for line in lines:
        found = _ENTRY.fullmatch(line.strip())
        if found is None:
            return tuple(names) or names_of(line)
        names.append(found["name"])
    return tuple(names)


def _twice(stated):
    """A problem of a name that a statement has twice; empty if there is none."""
    names = stated.joints
    name = next((one for one in names if names.count(one) > 1), None)
    return name and f"{stated.where} names the joint '{name}' twice."


def _quoted(stated):
    text = " ".join(stated.text.split())
    return f"{stated.where} ('{text[:100]}{'…' if len(text) > 100 else ''}')"


def _list(names):
    return ", ".join(map(str, names))
