# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units of columns: names, factors to SI, and units in headers."""

import re
from math import pi

_UNITS = {
    "time": {
        "s sec secs second seconds utc gmt unix epoch": 1.0,
        "ms msec millisec milliseconds": 1e-3,
        "us µs usec microsec microseconds": 1e-6,
        "ns nsec nanosec nanoseconds": 1e-9,
        "min minute minutes": 60.0,
        "h hour hours": 3600.0,
        "d day days": 86400.0,
    },
    "position": {
        "rad radian radians m": 1.0,
        "mrad mm": 1e-3,
        "cm": 1e-2,
        "deg degree degrees °": pi / 180,
        "rev revs turn turns": 2 * pi,
    },
    "velocity": {
        "rad/s m/s": 1.0,
        "mrad/s mm/s": 1e-3,
        "cm/s": 1e-2,
        "deg/s °/s": pi / 180,
        "rpm rev/min 1/min": 2 * pi / 60,
        "rev/s 1/s hz": 2 * pi,
    },
    "effort": {"nm n": 1.0, "mnm": 1e-3, "knm kn": 1e3, "ncm": 1e-2},
}
UNITS = {
    quantity: {unit: factor for units, factor in table.items() for unit in units.split()}
    for quantity, table in _UNITS.items()
}
"""Factor to SI by quantity and unit, in small letters without spaces and signs of multiplication."""
_WITHOUT_FACTOR = re.compile("a|ma|amps?|amperes?|v|volts?|%|percent|ticks|counts|steps")

_BRACKETS = re.compile(r"(?P<stem>.*?)(?P<space>\s*)[\[(](?P<unit>[^\[\]()]*[^\[\]()\s][^\[\]()]*)[\])]\s*$")
_WORDS = re.compile(
    r"(?P<sign>°(?:/s)?)|(?<![a-z0-9])(?:"
    r"(?P<per>deg|degrees?|rad|radians?|rev|mm|mrad)(?:_s|_?per_?s(?:ec(?:ond)?)?|_?p_?s|/s)"
    r"|(?P<dps>dps)|(?P<plain>deg|degrees?|rad|radians?|mrad|revs?|turns?|mm|rpm|nm|mnm"
    r"|ma|amps?|amperes?|volts?|percent|ticks|counts|steps)"
    r")(?![a-z])"
)
"""A unit as a word in a header. Letters alone (m, s, A) are units in brackets only."""
_PER_SECOND = {"degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad"}


def _normalized(unit):
    """A unit in small letters without signs of multiplication and spaces; ``s^-1`` is ``/s``."""
    text = re.sub(r"[\s·*⋅.]", "", unit.strip().lower()).replace("\u03bc", "µ").replace("º", "°")
    text = re.sub(r"(?:s\^?-1|s⁻¹)$", "/s", text).replace("//", "/")
    return re.sub(r"/sec(?:ond)?$", "/s", text).replace("degrees/", "deg/").replace("radians/", "rad/")


def is_unit(text):
    """Return whether a text is a known unit of any quantity."""
    unit = _normalized(text)
    return any(unit in table for table in UNITS.values()) or bool(_WITHOUT_FACTOR.fullmatch(unit))


def factor_of(quantity, unit):
    """Return the factor of a unit to SI; None if the quantity has no such unit."""
    return UNITS[quantity].get(_normalized(unit))


def split_unit(header):
    """Return a header without its unit in brackets, and the unit or None.

    Behind a space any text in brackets is a unit, right behind a name a known unit only: ``pos[0]`` has none.
    """
    match = _BRACKETS.match(header)
    if match is None or not match["stem"]:
        return header, None
    unit = match["unit"].strip()
    if unit.isdigit() or not (match["space"] or is_unit(unit)):
        return header, None
    return match["stem"], unit


def unit_word(text):
    """Return place and name of a unit that is a word of a header in small letters; None without one."""
    match = _WORDS.search(text)
    if match is None:
        return None
    if match["per"]:
        return match.span(), f"{_PER_SECOND.get(match['per'], match['per'])}/s"
    return match.span(), "deg/s" if match["dps"] else match["sign"] or match["plain"]
