# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns of tables that are read without a column map: docs/recordings.md has the conventions.

Each returns keys of a column map with numbers of columns, or nothing. A header counts as a whole:
one with any other word is not read.
"""

import re

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.headers import QUANTITIES, split_unit
from diag_dynamics.text import listed

_WORDS = {
    "position": "positions position pos q angles angle theta",
    "velocity": "velocities velocity vel qdot q_dot qd dq speeds speed",
    "effort": "efforts effort eff torques torque tau_j tau",
}
_QUANTITY_OF = {word: quantity for quantity, words in _WORDS.items() for word in words.split()}
_PREFIX = r"(?:/?joint_states?[/.]|state\.|actual_|measured_)?"
_WORD = rf"(?P<word>(?i:{'|'.join(sorted(_QUANTITY_OF, key=len, reverse=True))}))"
_NUMBER = r"(?:(?i:joint|axis|j)[\W_]*)?(?P<label>\d{1,3})"
_LOOSE = re.compile(rf"(?<![a-z0-9]){_WORD}(?![a-z])", re.IGNORECASE)
_COMMAND = re.compile(
    r"(?<![a-z])(?:target|desired|des|command|commanded|cmd|reference|ref|setpoint|goal|error|err"
    r"|planned|external|ext|limits?|acc|tcp)(?![a-z])|(?<![a-z])(?:d?q|qd|tau|tau_j)_d(?![a-z0-9])",
    re.IGNORECASE,
)
_TIME = re.compile(
    r"t|times?|timestamps?|time_stamp|stamp|secs?|seconds?|elapsed|elapsed_time|unix_time|[%_]*time"
    r"|rosbagtimestamp|(?:.*[./])?header[./]stamp"
    r"|(?P<part>(?:.*[./_])?(?:(?:n|nano)secs?|stamp[./_]secs?))",
    re.IGNORECASE,
)
_TIME_UNIT = re.compile(r"(.*?)(?:_(s|sec|ms|msec|us|usec|µs|ns|nsec))?")
_MENTION = re.compile(r"(?<![a-z])(?:joint|name|motor|order|axe)s?(?![a-z])", re.IGNORECASE)


def recognize(columns, texts, joints):
    """Return the keys of a column map that the only fitting convention gives.

    `texts` of the file may state another order of joints; numbered columns have none then. Without
    texts, None, the joints have the order of the columns.
    """
    if echo := by_echo(columns):
        return echo
    named = by_joint(columns, joints)
    used = {k for key in QUANTITIES for k in named.get(key, ())}
    numbered = by_number(_blank(columns, used), joints)
    if not (named or numbered.get("position")):
        raise InputError(
            f"no columns are recognized as positions of {listed(joints)}; columns: "
            f"{listed(columns)}. Map other names of joints by --joint-names (joint_names)."
        )
    if named and numbered:
        raise InputError("columns have both names and numbers of joints.")
    if numbered and texts is not None:
        _require_order(columns, texts, joints)
    return named or numbered


def by_joint(columns, joints):
    """Return columns with joint and quantity: ``q_elbow``, ``elbow/position``, ``tau[elbow]``."""
    names = "|".join(map(re.escape, sorted(joints, key=len, reverse=True)))
    members = _parse(columns, joints, rf"(?P<label>{names})", r"[\W_]+")
    present = tuple(joint for joint in joints if joint in members["position"])
    places = {key: tuple(map(members[key].get, present)) for key in QUANTITIES if members[key]}
    return {"joints": present, **places} if present else {}


def by_number(columns, joints):
    """Return numbered columns, ``q1`` to ``q7``, or arrays, of as many joints as there are."""
    places = {}
    ranges = [[*range(first, first + len(joints))] for first in (0, 1)]
    for key, members in _parse(columns, joints, _NUMBER, r"[\W_]*").items():
        numbers = sorted(map(int, members))
        if numbers in ranges:
            places[key] = tuple(members[str(number)] for number in numbers)
    unequal = {k for k, column in enumerate(columns) if (column.width or 1) != len(joints)}
    for key, members in _parse(_blank(columns, unequal), joints, "(?P<label>)", "").items():
        for k in members.values():
            if key in places:
                raise _ambiguous(key, columns, places[key][0], k)
            places[key] = (k,)
    return {"joints": tuple(joints), **places} if places else {}


def by_echo(columns):
    """Return the columns of `ros2 topic echo --csv`: stamp, frame, and names before the values."""
    texts = [not column.numeric for column in columns[3:]]
    count = texts.index(False) if False in texts else 0
    is_bare = [column.name for column in columns] == list(map(str, range(len(columns))))
    is_stamp = all(column.sample and column.sample[0].isdecimal() for column in columns[:2])
    if not (is_bare and is_stamp and count and texts == [True] * count + [False] * 3 * count):
        return {}
    blocks = [tuple(range(k, k + count)) for k in range(3, len(columns), count)]
    return {"time": (0, 1), "joints": (), **dict(zip(("names", *QUANTITIES), blocks, strict=True))}


def find_time(columns):
    """Return the number of the only column of times."""
    times = [k for k, column in enumerate(columns) if match_time(column)]
    if len(times) != 1 or match_time(columns[times[0]])["part"]:
        names = listed(columns[k].name for k in times)
        text = f"the time may be {names}" if times else "no column is recognized as time"
        raise InputError(
            f"{text}; columns: {listed(columns)}. Rows at equal intervals need `rate: HZ`."
        )
    return times[0]


def match_time(column):
    """Return the match of the header of a column of times, None of any other header."""
    stem = split_unit(column.name)[0]
    return _TIME.fullmatch(stem) or _TIME.fullmatch(_TIME_UNIT.fullmatch(stem)[1])


def unit_of_time(column):
    """Return the unit at the end of the name of a column of times, or None."""
    return _TIME_UNIT.fullmatch(split_unit(column.name)[0])[2]


def find_quantity(text):
    """Return the quantity of a name that has words of only one, and none of commands; or None."""
    quantities = {_QUANTITY_OF[match["word"].lower()] for match in _LOOSE.finditer(text)}
    return quantities.pop() if len(quantities) == 1 and not _COMMAND.search(text) else None


def _blank(columns, places):
    """Return columns without the names of those in some places."""
    return [column._replace(name="") if k in places else column for k, column in enumerate(columns)]


def _parse(columns, joints, label, gap):
    """Return the numbers of columns by quantity and by the text of the pattern `label`."""
    members = {key: {} for key in QUANTITIES}
    patterns = [rf"{_PREFIX}{_WORD}{gap}{label}[\])]?", rf"{_PREFIX}{label}[\W_]+{_WORD}"]
    for k, column in enumerate(columns):
        stem, unit = split_unit(column.name)
        names = [column.name.strip(), *([] if unit in joints else [stem])]
        matches = [re.fullmatch(pattern, name) for name in names for pattern in patterns]
        if match := next(filter(None, matches), None):
            key = _QUANTITY_OF[match["word"].lower()]
            text = match["label"]
            text = str(int(text)) if text.isdecimal() and text not in joints else text
            if text in members[key]:
                raise _ambiguous(key, columns, members[key][text], k)
            members[key][text] = k
    return members


def _ambiguous(key, columns, *places):
    names = " or ".join(f"'{columns[k].name}' (column {k})" for k in places)
    return InputError(f"the {key} may be {names}.")


def _require_order(columns, texts, joints):
    """Reject numbered columns of joints whose names have other numbers, or that a text may name."""
    labels = [[int(number) for number in re.findall(r"\d+", joint)[-1:]] for joint in joints]
    if all(labels) and labels != sorted(labels):
        raise InputError(f"columns have numbers, and the joints others: {listed(joints)}.")
    cells = [
        f"{column.name}: {', '.join(column.sample)}"
        for column in columns
        if not (column.numeric or column.type.endswith("bool"))
    ]
    names = "|".join(map(re.escape, joints))
    for text in [*texts, *cells] if len(joints) > 1 else ():
        if _MENTION.search(text) or re.search(rf"(?<!\w)(?:{names})(?!\w)", text):
            raise InputError(f"columns have numbers, and '{text:.60}' may state their order.")
