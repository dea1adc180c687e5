# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Choice of the columns that are read: by a column map, or by a convention."""

from dataclasses import replace
from shlex import quote
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables import conventions
from diag_dynamics.recordings.tables.headers import QUANTITIES, UNITS, factor_of, unit_of
from diag_dynamics.text import listed

_SI = {"position": "rad or m", "velocity": "rad/s or m/s", "effort": "N m or N", "time": "s"}
_ADVICE = "Write a column map to fill in: diag-dynamics analyse {} --urdf ROBOT --columns NEW.yaml"


class Quantity(NamedTuple):
    """Columns of positions, velocities or efforts."""

    columns: tuple[int | None, ...]  # of each joint, None: none; or one array
    whole: bool  # whether it is one array or column of lists
    scale: np.ndarray  # factors to SI, (k,)
    offset: np.ndarray  # summands in SI, (k,)


class Choice(NamedTuple):
    """Columns that are read of a table."""

    joints: tuple[str, ...]  # empty if each row names its own
    names: tuple[int, ...]  # columns of the names in rows
    time: tuple[int, ...]  # one, or two: seconds and nanoseconds; none: rows follow at a rate
    time_scale: float | None  # None: nothing states the unit; of rows at a rate their interval [s]
    quantities: dict[str, Quantity]
    mixing: np.ndarray | None  # B of q = B θ
    notes: list[str]

    @property
    def values(self):
        """Numbers of the columns of quantities."""
        chosen = self.quantities.values()
        return sorted({k for quantity in chosen for k in quantity.columns if k is not None})


def choose(table, column_map, joints):
    """Return the :class:`Choice` among the columns of a Table by a ColumnMap."""
    try:
        return _Chooser(table.columns, _complete(table, column_map, joints), joints).choose()
    except InputError as error:
        by = "" if column_map.source == "columns" else f" (by {column_map.source})"
        raise InputError(f"'{table.path}'{by}: {error}") from None


def _complete(table, column_map, joints):
    """Return a ColumnMap with positions and a time, by a convention where it states none."""
    try:
        if column_map.position is None:
            texts = None if column_map.joints else table.texts
            fields = conventions.recognize(table.columns, texts, column_map.joints or joints)
            if column_map.joints:  # they overrule names in rows
                fields |= {"joints": column_map.joints, "names": ()}
            stated = [key for key in fields if getattr(column_map, key) is not None]
            column_map = replace(column_map, **{key: fields[key] for key in fields.keys() - stated})
        if column_map.time is None and column_map.rate is None:
            column_map = replace(column_map, time=(conventions.find_time(table.columns),))
    except InputError as error:
        raise InputError(f"{error} {_ADVICE.format(quote(table.path))}") from None
    return column_map


class _Chooser:
    def __init__(self, columns, column_map, model_joints):
        self._columns = columns
        self._map = column_map
        self._notes = []
        self._headers = [column.name for column in columns]
        self._names = self._find("names", column_map.names or ())
        places = tuple(map(str, range(len(self._names))))
        self._joints = places or column_map.joints or model_joints

    def choose(self):
        """Return the :class:`Choice`."""
        time, time_scale = self._choose_time()
        values = {key: getattr(self._map, key) for key in QUANTITIES}
        places = {key: self._place(key, value) for key, value in values.items() if value}
        quantities = {key: self._make_quantity(key, columns) for key, columns in places.items()}
        for name in ("scale", "offset"):
            for key in sorted(getattr(self._map, name).keys() - {"time", *quantities}):
                raise InputError(f"{name} has {key}; expected columns of it.")
        joints = () if self._names else self._joints
        mixing = self._make_mixing()
        choice = Choice(joints, self._names, time, time_scale, quantities, mixing, self._notes)
        used = {*choice.values, *time, *self._names}
        if unused := [name or "''" for k, name in enumerate(self._headers) if k not in used]:
            self._notes.append(f"not read: {listed(unused)}.")
        return choice

    def _choose_time(self):
        """Return the columns of times and their scale, None if it is not known."""
        if self._map.rate:
            self._notes.append(f"time: number of the row, at {self._map.rate:g} Hz.")
            return (), 1.0 / self._map.rate
        time = self._find("time", self._map.time)
        (scale,) = self._map.scale.get("time", (None,))
        column = self._columns[time[0]]
        unit = unit_of(column, ()) or conventions.unit_of_time(column)
        if len(time) == 2:
            if scale is not None:
                raise InputError("time has a scale and two columns; expected one of them.")
            scale = 1.0
        elif scale is None and unit is not None:
            scale = _factor("time", unit, column)
        names = " and ".join(self._headers[k] for k in time)
        self._notes.append(f"time: {names}{_in_words([scale or 1.0])}.")
        return time, scale

    # --- Columns ---

    def _find(self, key, entries):
        """Return numbers of columns by names or numbers."""
        places = []
        for entry in entries:
            fitting = [k for k, name in enumerate(self._headers) if entry in (k, name)]
            if entry is not None and len(fitting) != 1:
                raise InputError(
                    f"{key}: {entry!r} is the name of {len(fitting)} columns; expected the name or "
                    f"number of one of {listed(self._headers)}."
                )
            places.append(None if entry is None else fitting[0])
            if fitting:
                _require_type(key, self._columns[fitting[0]])
        return tuple(places)

    def _place(self, key, value):
        """Return the column of each joint, None where it has none; or that of one array."""
        places = self._find(key, value)
        widths = [self._columns[k].width for k in places if k is not None]
        is_list = len(places) > 1 or not any(widths)
        count = len(places) if is_list else widths[0]
        joints = self._joints
        if count != len(joints) or (is_list and any(widths)):
            kind = "an array in a list" if is_list and any(widths) else f"{count} columns"
            raise InputError(
                f"{key} has {kind}; expected one for each of {len(joints)} joints: "
                f"{listed(joints)}."
            )
        return places

    # --- Numbers ---

    def _make_quantity(self, key, columns):
        """Return columns with their scale and offset, and note both."""
        scale = self._numbers("scale", key) or [
            1.0
            if k is None
            else _factor(key, unit_of(self._columns[k], self._joints), self._columns[k])
            for k in columns
        ]
        names = listed("none" if k is None else self._headers[k] for k in columns)
        whose = "joints that rows name" if self._names else listed(self._joints)
        self._notes.append(f"{key}: {names} of {whose}{_in_words(scale)}.")
        whole = len(columns) == 1 and columns[0] is not None and self._columns[columns[0]].width > 0
        offset = np.array(self._numbers("offset", key) or [0.0])
        return Quantity(columns, whole, np.array(scale), offset)

    def _numbers(self, name, key):
        """Return the scale or the offset of a quantity by the map: one number, or one a joint."""
        numbers = getattr(self._map, name).get(key, ())
        if len(numbers) > 1 and (self._names or len(numbers) != len(self._joints)):
            raise InputError(
                f"{name}: {key} has {len(numbers)} numbers; expected one, or one for each of the "
                f"joints {listed(self._joints)}."
            )
        return numbers

    def _make_mixing(self):
        """Return the matrix of a map; None without one."""
        rows = self._map.mixing
        joints = () if self._names else self._joints
        if rows is not None and len(rows) != len(joints):
            raise InputError(
                f"mixing has {len(rows)} rows; expected {len(joints)}, of joints of the map."
            )
        return None if rows is None else np.array(rows)


def _require_type(key, column):
    """Reject a column of another type than names, times or numbers have."""
    valid = column.numeric and not column.moments
    expected = "numbers in one or two dimensions"
    if key == "time":
        valid = (column.numeric or column.moments) and not column.width
        expected = (
            "numbers in one dimension, or times in ISO 8601 such as '2024-05-13T14:03:07.25' or "
            "'2024-05-13 14:03:07+02:00'. Convert the column, or set `time: null` and `rate: HZ` "
            "in a column map"
        )
    elif key == "names":
        is_text = column.type in ("", "string")
        valid = is_text and not column.numeric
        expected = "a column of texts for each joint"
    if not valid:
        example = next((f" such as '{text:.40}'" for text in column.sample if text), "")
        holds = f"is of type {column.type}{example}"
        holds = f"has {column.width} columns" if column.width else holds
        raise InputError(f"{key}: '{column.name}' {holds}; expected {expected}.")


def _in_words(factors):
    """Return factors to SI for a note, or nothing if all are 1."""
    different = sorted({*factors})
    return "" if different == [1.0] else f", factor {listed(f'{x:g}' for x in different)}"


def _factor(key, unit, column):
    """Return the factor of the unit of a column to SI, 1 without any."""
    factor = 1.0 if unit is None else factor_of(key, unit)
    if factor is None:
        leave = f" or `{key}: null`" if key in QUANTITIES[1:] else ""
        raise InputError(
            f"column '{column.name}' has the unit '{unit}'; expected one with a factor to "
            f"{_SI[key]}. Set `scale: {{{key}: UNIT}}`{leave} in a column map; UNIT is a factor or "
            f"one of {listed(UNITS[key], 6)}."
        )
    return factor
