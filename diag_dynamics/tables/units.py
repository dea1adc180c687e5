# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units in which columns are written, by what is written in them."""

import re
from math import pi

from diag_dynamics.exceptions import InputError

_DEG, _RPM = pi / 180, 2 * pi / 60

UNITS = {
    "time": {
        **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "utc", "gmt", "unix", "epoch"), 1.0),
        **dict.fromkeys(("ms", "msec", "millisec", "milliseconds"), 1e-3),
        **dict.fromkeys(("us", "µs", "usec", "microsec", "microseconds"), 1e-6),
        **dict.fromkeys(("ns", "nsec", "nanosec", "nanoseconds"), 1e-9),
        **dict.fromkeys(("min", "minute", "minutes"), 60.0),
        **dict.fromkeys(("h", "hour", "hours"), 3600.0),
        **dict.fromkeys(("d", "day", "days"), 86400.0),
    },
    "position": {
        **dict.fromkeys(("rad", "radian", "radians", "m"), 1.0),
        **dict.fromkeys(("mrad", "mm"), 1e-3),
        **dict.fromkeys(("deg", "degree", "degrees", "°"), _DEG),
        **dict.fromkeys(("rev", "revs", "turn", "turns"), 2 * pi),
        "cm": 1e-2,
    },
    "velocity": {
        **dict.fromkeys(("rad/s", "m/s"), 1.0),
        **dict.fromkeys(("mrad/s", "mm/s"), 1e-3),
        **dict.fromkeys(("deg/s", "°/s"), _DEG),
        **dict.fromkeys(("rpm", "rev/min", "1/min"), _RPM),
        **dict.fromkeys(("rev/s", "1/s", "hz"), 2 * pi),
        "cm/s": 1e-2,
    },
    "effort": {
        **dict.fromkeys(("nm", "n"), 1.0),
        **dict.fromkeys(("mnm",), 1e-3),
        **dict.fromkeys(("knm", "kn"), 1e3),
        "ncm": 1e-2,
    },
}
"""Factor to SI of each unit that needs no scale, by what is written in it; written as :func:`_plain` leaves them."""

OTHERS = {
    "a",
    "ma",
    "amp",
    "amps",
    "ampere",
    "amperes",
    "v",
    "volt",
    "volts",
    "%",
    "percent",
    "ticks",
    "counts",
    "steps",
}
"""Units which no factor of ours makes SI: a scale has to."""

_ALL = OTHERS.union(*UNITS.values())

_BRACKETS = re.compile(r"(?P<stem>.*?)(?P<space>\s*)[\[(](?P<unit>[^\[\]()]*[^\[\]()\s][^\[\]()]*)[\])]\s*$")
"""A unit in brackets at the end of a header."""

_WORDS = re.compile(
    r"(?P<sign>°(?:/s)?)|(?<![a-z0-9])(?:"
    r"(?P<per>deg|degrees?|rad|radians?|rev|mm|mrad)(?:_s|_?per_?s(?:ec(?:ond)?)?|_?p_?s|/s)"
    r"|(?P<dps>dps)|(?P<plain>deg|degrees?|rad|radians?|mrad|revs?|turns?|mm|rpm|nm|mnm"
    r"|ma|amps?|amperes?|volts?|percent|ticks|counts|steps)"
    r")(?![a-z])"
)
"""A unit as a word in a header, such as of q_deg_1. Letters alone (m, s, A) are units in brackets only."""

_PER_SECOND = {"degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad"}


def _plain(unit):
    """A unit in small letters, without signs of multiplication and spaces; ``s^-1`` is ``/s``."""
    text = re.sub(r"[\s·*⋅.]", "", unit.strip().lower()).replace("\u03bc", "µ").replace("º", "°")
    text = re.sub(r"(?:s\^?-1|s⁻¹)$", "/s", text).replace("//", "/")
    return re.sub(r"/sec(?:ond)?$", "/s", text).replace("degrees/", "deg/").replace("radians/", "rad/")


def split_unit(header):
    """A header without its unit in brackets, and the unit; None where there is none.

    ``q1 [deg]`` has one, ``pos[0]`` and ``position[elbow]`` have none: what stands right behind a name is a unit if it is
    known as one, what stands behind a space always.
    """
    found = _BRACKETS.match(header)
    if found is None or not found["stem"]:
        return header, None
    unit = found["unit"].strip()
    if unit.isdigit() or not (found["space"] or _plain(unit) in _ALL):
        return header, None
    return found["stem"], unit


def word_of_unit(text):
    """Place and name of a unit that is a word of a header; None where there is none.

    Parameters
    ----------
    text : str
        In small letters.
    """
    found = _WORDS.search(text)
    if found is None:
        return None
    if found["per"]:
        return found.span(), f"{_PER_SECOND.get(found['per'], found['per'])}/s"
    return found.span(), "deg/s" if found["dps"] else found["sign"] or found["plain"]


def factor(quantity, unit, column):
    """Factor from a unit to SI.

    Parameters
    ----------
    quantity : {'time', 'position', 'velocity', 'effort'}
    unit : str or None
        None: there is none, so it is SI.
    column : str
        Whose unit it is, for messages.

    Raises
    ------
    InputError
        It needs a scale: amperes, ticks, or a unit that is not known.
    """
    if unit is None:
        return 1.0
    known = UNITS[quantity].get(_plain(unit))
    if known is None:
        leave = f", or `{quantity}: null` to do without" if quantity in ("velocity", "effort") else ""
        raise InputError(
            f"{column} is in '{unit}', from which the {quantity} in SI units does not follow: give in the map of columns "
            f"`scale: {{{quantity}: …}}`, by which its numbers are multiplied{leave}."
        )
    return known


def named(quantity, text):
    """Factor of a unit by its name, or None."""
    return UNITS[quantity].get(_plain(text))


def is_unit(text):
    """Whether a text is a unit that is known, of whatever."""
    return _plain(text) in _ALL
