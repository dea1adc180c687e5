# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns of a table, and the units in their headers."""

import re
from math import pi
from typing import NamedTuple

QUANTITIES = ("position", "velocity", "effort")
_UNITS = {
    "time": {
        "s sec second seconds utc": 1.0,
        "ms msec": 1e-3,
        "us µs μs usec": 1e-6,
        "ns nsec nanosec": 1e-9,
        "min": 60.0,
        "h": 3600.0,
        "d day days": 86400.0,
    },
    "position": {
        "rad m": 1.0,
        "mrad mm": 1e-3,
        "cm": 1e-2,
        "deg degree degrees ° º": pi / 180,
        "rev": 2 * pi,
    },
    "velocity": {
        "rad/s rad/sec m/s": 1.0,
        "mrad/s mm/s": 1e-3,
        "cm/s": 1e-2,
        "deg/s deg/sec °/s": pi / 180,
        "rpm rev/min 1/min": 2 * pi / 60,
        "rev/s": 2 * pi,
    },
    "effort": {"nm n": 1.0, "mnm": 1e-3, "knm kn": 1e3, "ncm": 1e-2},
}
UNITS = {
    quantity: {unit: factor for units, factor in table.items() for unit in units.split()}
    for quantity, table in _UNITS.items()
}
"""Factor to SI by quantity and unit, in lower case without spaces and signs of multiplication."""
_BRACKETS = re.compile(r"(.+?)\s*[\[(]([^\[\]()]*[^\[\]()\d\s][^\[\]()]*)[\])]\s*")


class Column(NamedTuple):
    """One column of a table, or one array."""

    name: str
    width: int = 0  # columns of an array or of lists; 0 of one number a row
    unit: str | None = None  # outside of the name: in a line of units, in metadata
    numeric: bool = True  # whether the column holds numbers or times
    moments: bool = False  # whether all values are ISO 8601 times, or of a type of times
    type: str = ""  # of values that are no numbers, for messages
    sample: tuple[str, ...] = ()  # first values as texts

    def __str__(self):
        holds = "" if self.numeric or self.moments else self.type
        holds = f"{self.width} columns" if self.width else holds
        return f"{self.name} ({holds})" if holds else self.name


def factor_of(quantity, unit):
    """Return the factor of a unit to SI; None if the quantity has no such unit."""
    return UNITS[quantity].get(re.sub(r"[\s·*⋅.]", "", unit.lower()))


def split_unit(header):
    """Return a header without its unit in brackets, and the unit or None; ``q[3]`` has none."""
    match = _BRACKETS.fullmatch(header)
    return (match[1], match[2].strip()) if match else (header.strip(), None)


def unit_of(column, joints):
    """Return the unit of a column or None; a joint in brackets, as in ``q[elbow]``, is none."""
    unit = split_unit(column.name)[1]
    return column.unit or (None if unit in joints else unit)
