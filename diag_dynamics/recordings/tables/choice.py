# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Choice of the columns that are read: by the map, and by names where it says nothing."""

import re
from collections.abc import Mapping
from contextlib import suppress
from difflib import get_close_matches
from typing import NamedTuple

import numpy as np

from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables.column_map import JOINT, UNSAID
from diag_dynamics.recordings.tables.headers import parse_header, time_columns, unit_of, unit_of_time
from diag_dynamics.recordings.tables.joint_names import (
    MismatchError,
    RowNames,
    find_loose_names,
    find_row_names,
    labelled_joints,
    names_of,
    nearest,
    stated_order,
)
from diag_dynamics.recordings.tables.units import factor_of, split_unit

_NUMBERED = re.compile(r"joints?|joint[_ ]?(?:names?|ids?|index|no|number)|axis|motor")
"""Headers of columns that number the joint of a row."""
_SI = {"position": "rad or m", "velocity": "rad/s or m/s", "effort": "N m or N"}
_ADVICE = "Say which by `joints` or `position` in the map of columns."


class Quantity(NamedTuple):
    """Columns of positions, velocities or efforts."""

    columns: tuple[int | None, ...]
    """Index for each joint, or for each place where rows name joints; None where a joint has no column."""
    whole: bool
    """Whether it is one column, of lists or of a whole array."""
    scale: np.ndarray | Mapping[str, float]
    """Factor to SI, shape (k,); by joint where rows name joints and the map has factors by joint."""


class Choice(NamedTuple):
    """Columns that are read of a table."""

    joints: tuple[str, ...]
    time: tuple[int, ...]
    """One column, or two: seconds and nanoseconds."""
    time_scale: float
    time_in_doubt: bool
    """Whether nothing says the unit of the times."""
    quantities: dict[str, Quantity | None]
    notes: list[str]
    names: RowNames | None
    """Columns that name the joints of each row."""

    @property
    def values(self):
        """Indices of the columns of quantities."""
        return {k for one in self.quantities.values() if one for k in one.columns if k is not None}

    @property
    def used(self):
        """Indices of all columns that are read, in their order."""
        return sorted({*self.values, *self.time, *(self.names.columns if self.names else ())})


class _Group(NamedTuple):
    """Columns that differ in the joint only."""

    pattern: str
    members: tuple[tuple[str, int | None, int], ...]
    """Joint, its number if it is one, and the column."""
    ordered: bool = False
    """Whether columns are in the order of the joints by themselves: a list, an array, or one column."""
    width: int = 0
    """Columns of an array."""
    unit: str | None = None

    @property
    def count(self):
        return self.width or len(self.members)

    @property
    def columns(self):
        """Columns in the order of their numbers, or as they are."""
        members = self.members if self.ordered else sorted(self.members, key=lambda one: one[1])
        return tuple(k for *_, k in members)

    def without_doubles(self):
        """The first column of each joint."""
        first = {one[0]: one for one in reversed(self.members)}
        return self._replace(members=tuple(first.values())[::-1])

    def names_joints(self, model):
        """Whether headers name joints instead of numbering them."""
        return not self.ordered and any(number is None or joint in model for joint, number, _ in self.members)


def choose(columns, wanted, model, file, texts=()):
    """Return the :class:`Choice` among columns by a ColumnMap; InputError if one is missing, ambiguous or needs a scale.

    `model` are the names of the model's joints that move, in their order, or empty; `texts` may state names of joints.
    """
    try:
        return _Chooser(columns, wanted, tuple(model), texts).choose()
    except MismatchError as error:
        by = "" if wanted.source == "columns" else f" (by {wanted.source})"
        raise InputError(f"'{file}'{by}: {error}") from None


class _Chooser:
    def __init__(self, columns, wanted, model, texts):
        self._columns, self._wanted, self._model, self._texts = columns, wanted, model, texts
        self._headers = [one.name for one in columns]
        self._known = wanted.joints or model
        self._by_map = bool(wanted.joints) or isinstance(wanted.position, list)
        self._row_names = find_row_names(columns, model)
        self._loose = find_loose_names(columns, model, {text.array for text in texts})
        self._groups, self._notes = self._group_columns(), []

    def choose(self):
        time, time_scale, in_doubt = self._choose_time()
        group, joints, places = self._choose_position()
        names, array = self._compare_names(group, joints)
        numbers = {k: number for _, number, k in group.members}
        numbers = [numbers.get(k) for k in places]
        chosen = {"position": (group, places)}
        for quantity in ("velocity", "effort"):
            chosen[quantity] = self._choose_other(quantity, joints, [] if None in numbers else numbers)
        for quantity, one in chosen.items():
            if one is None and quantity in self._wanted.scale:
                raise MismatchError(f"there is a scale of {quantity}, but no column of it.")
            if one:
                chosen[quantity] = self._make_quantity(quantity, *one, joints, names)
        choice = Choice(joints, time, time_scale, in_doubt, chosen, self._notes, names)
        unused = [name for k, name in enumerate(self._headers) if k not in choice.used and name != array]
        if unused:
            self._notes.append(f"not read: {_list(unused)}.")
        return choice

    # --- Time ---

    def _choose_time(self):
        """Columns of the times, their scale, and whether nothing says it."""
        columns, given = self._columns, self._wanted.scale.get("time")
        time = self._time_by_name() if self._wanted.time is UNSAID else self._find_columns("time", self._wanted.time)
        name = " and ".join(columns[k].name for k in time)
        for k in time:
            if columns[k].width:
                raise MismatchError(f"time: '{columns[k].name}' has {columns[k].width} columns, expected one.")
        if len(time) == 2:
            if given is not None:
                raise MismatchError("there is a scale of time, but two columns of times, seconds and nanoseconds.")
            self._notes.append(f"time: {name}, seconds and nanoseconds.")
            return time, 1.0, False
        unit = unit_of_time(columns[time[0]])
        scale = _factor("time", unit, name) if given is None else given
        self._notes.append(f"time: {name}{_times([scale], 's')}.")
        return time, scale, given is None and unit is None

    def _time_by_name(self):
        found = time_columns(self._columns)
        if len(found) > 1 and all("stamp" in name.lower() for name in found):
            near = nearest(list(found), self._choose_position()[0].pattern.strip("'"))
            found = {near[0]: found[near[0]]} if len(near) == 1 else found
        if len(found) == 1:
            return next(iter(found.values()))
        advice = "name it by `time: …` in the map of columns"
        if found:
            raise MismatchError(f"several columns may be the times: {advice}, one of {_list(found)}.")
        for texts in time_columns([one._replace(dated=not one.numeric, sample=()) for one in self._columns]).values():
            self._require_numbers(texts[0], "time")
        raise MismatchError(f"no column is known as that of the times: {advice}, which of {_list(self._headers)}.")

    # --- Joints ---

    def _choose_position(self):
        """The group of the positions, the joints, and a column for each."""
        fitting, problems = [], []
        for group in self._candidates("position"):
            try:
                fitting.append((group, *self._joints_of(group.without_doubles())))
            except MismatchError as error:
                problems.append(self._doubled(group) or str(error))
        if fitting:
            self._require_one("position", [one[0] for one in fitting])
            return fitting[0]
        why = " ".join(problems) or f"no column is known as a position, of {_list(self._headers)}."
        raise MismatchError(f"position: {why}" + ("" if "in the map of columns" in why else f" {_ADVICE}"))

    def _joints_of(self, group):
        """Joints of columns of positions, and a column for each."""
        by_data = None if self._by_map or group.names_joints(self._model) else self._joints_by_data(group)
        if by_data:
            return by_data
        if self._known:
            columns = self._match(group, self._known)
            self._require_all(group, self._known, columns)
            kept = [k for k, column in enumerate(columns) if column is not None]
            joints = self._known if group.width else tuple(self._known[k] for k in kept)
            return joints, tuple(columns[k] for k in kept)
        if group.ordered:
            return tuple(f"joint{k + 1}" for k in range(group.count)), group.columns
        if _count_up([number for _, number, _ in group.members if number is not None], group.count):
            return tuple(f"joint{number}" for number in sorted(number for _, number, _ in group.members)), group.columns
        return tuple(joint for joint, *_ in group.members), tuple(k for *_, k in group.members)

    def _joints_by_data(self, group):
        """Joints or places by names in rows, comments and metadata, and columns; None without names."""
        rows, loose = self._rows_for(group), self._loose
        if rows:
            return self._places(group, rows)
        if len(loose.columns) > 1:
            named = f"{len(loose.columns)} columns name joints: {loose.pattern}"
            raise MismatchError(f"{group.pattern} has {group.count} columns, but {named}.")
        stated = stated_order(self._texts, self._model, group.count, group.pattern)
        numbered = next((one for one in self._headers if _NUMBERED.fullmatch(one.strip().lower())), None)
        if group.count == 1 < len(self._model) and numbered and not stated:
            raise MismatchError(f"'{numbered}' numbers the joints of rows. Write their names in its place.")
        return stated and (stated[0], group.columns)

    def _rows_for(self, group):
        """The columns of names that belong to columns of positions; None without any."""
        fitting = [one for one in self._row_names if _fits(one, group)]
        loose = self._loose
        if group.count == len(loose.columns) > 1 and not any({*loose.columns} <= {*one.columns} for one in fitting):
            return loose
        near = nearest([one.pattern for one in fitting], group.pattern.strip("'"))
        return next((one for one in fitting if one.pattern in near), None)

    def _places(self, group, rows):
        """Labels and columns of positions by the places of names in rows."""
        by_number = {number: k for _, number, k in group.members}
        if rows.numbers and not group.ordered:
            if by_number.keys() <= set(rows.numbers):
                return tuple(map(str, rows.numbers)), tuple(map(by_number.get, rows.numbers))
            if len({a - b for a, b in zip(sorted(by_number), rows.numbers, strict=False)}) > 1:  # not from 0 and from 1
                numbers = f"the joints' names are in '{rows.pattern}' with the numbers {_list(rows.numbers)}"
                raise MismatchError(f"{group.pattern} has the numbers {_list(by_number)}, but {numbers}.")
        if group.width:
            return tuple(map(str, range(group.width))), group.columns
        labels = {k: joint if number is None else str(number) for joint, number, k in group.members}
        return tuple(map(labels.get, group.columns)), group.columns

    def _compare_names(self, group, joints):
        """Names in rows that are used, and the array whose names are used."""
        rows, labelled = self._rows_for(group), labelled_joints(self._texts, self._model)
        if self._by_map:
            self._note_overruled(group, joints, rows)
            return None, ""
        if group.names_joints(self._model):
            named = [(labelled[0], labelled[1].where)] if labelled else []
            sets = [one for one in self._row_names if one.labelled and one.known and len(one.first) > 1]
            for names, where in (*named, *((one.first, f"'{one.pattern}'") for one in sets)):
                if odd := [joint for joint in joints if joint not in names]:
                    differ = f"{where} names {_list(names)}: {_list(odd)} is not among them"
                    raise MismatchError(f"headers name the joints {_list(joints)}, but {differ}. {_ADVICE}")
            return None, ""
        if rows and labelled and len(rows.first) == len(labelled[0]) and rows.first != labelled[0]:
            names = f"{labelled[1].where} names the joints {_list(labelled[0])}"
            raise MismatchError(f"{names}, but '{rows.pattern}' names {_list(rows.first)} in the first row. {_ADVICE}")
        stated = None if rows else stated_order(self._texts, self._model, len(joints))
        if stated:
            self._notes.append(f"joints: {_list(joints)}, by {stated[1].where}.")
        return rows, stated[1].array if stated else ""

    def _note_overruled(self, group, joints, rows):
        """Note headers, rows, comments and metadata that name other joints than the map."""
        longest_first, others = sorted(self._model, key=len, reverse=True), []
        by_headers = () if group.width or group.names_joints(self._model) else group.columns
        for joint, k in zip(joints, by_headers, strict=False):
            header = parse_header(self._columns[k], longest_first)
            if header and header.joint in self._model and header.joint != joint:
                others.append(f"'{self._headers[k]}' to {joint}")
        gives = f"joints: the map of columns gives {_list(joints)};"
        if others:
            self._notes.append(f"joints: the map of columns gives {_list(others)}, though the headers name others.")
        if rows:
            where = f"'{rows.pattern}' names {_list(rows.first)} in the first row"
            self._notes.append(f"{gives} {where}. Names in rows are not used.")
        with suppress(MismatchError):
            stated = stated_order(self._texts, self._model, len(joints))
            if stated and stated[0] != joints:
                self._notes.append(f"{gives} {stated[1].where} names {_list(stated[0])} and is not used.")

    def _choose_other(self, quantity, joints, numbers):
        """The group of velocities or efforts, and an index or None for each joint; None without columns."""
        value = getattr(self._wanted, quantity)
        if value is None or (value is UNSAID and self._wanted.position is not UNSAID):
            return None
        for word in ("effort", "current") if quantity == "effort" else (quantity,):
            fitting = []
            for group in self._candidates(word):
                try:
                    fitting.append((group, self._match(group.without_doubles(), joints, numbers)))
                except MismatchError as error:
                    if value is not UNSAID:
                        raise MismatchError(f"{quantity}: {error}") from None
                    if group.ordered:
                        self._notes.append(f"{quantity}: not taken: {self._doubled(group) or error}")
            if fitting:
                self._require_one(quantity, [group for group, _ in fitting])
                if value is not UNSAID:
                    self._require_all(fitting[0][0], joints, fitting[0][1])
                return fitting[0]
        return None

    def _match(self, group, joints, numbers=()):
        """The column of each joint, None where it has none; `numbers` are those of the joints' positions."""
        by_joint = {joint: k for joint, _, k in group.members}
        by_number = {number: k for _, number, k in group.members if number is not None}
        if group.ordered and group.count == len(joints):
            return group.columns
        if not group.ordered:
            if by_joint.keys() & set(joints):
                return tuple(map(by_joint.get, joints))
            if by_number and by_number.keys() <= set(numbers):
                return tuple(map(by_number.get, numbers))
            if group.count == len(joints) and _count_up(by_number, group.count):
                return group.columns
        what = f"{group.count} columns" if group.ordered else _list(by_joint)
        raise MismatchError(f"{group.pattern} has {what}, but there are {len(joints)} joints: {_list(joints)}.")

    def _require_all(self, group, joints, columns):
        """Require a column for each joint that the map names."""
        if self._wanted.joints and None in columns:
            joint = joints[columns.index(None)]
            near = _near(joint, [one for one, *_ in group.members])
            raise MismatchError(f"no column {group.pattern} for {joint}{near}.")

    # --- Columns ---

    def _find_columns(self, quantity, entries):
        """Indices of columns by their names or numbers."""
        found, stems = [], [split_unit(one.strip())[0] for one in self._headers]
        for one in entries:
            if isinstance(one, int):
                places = [one] if one < len(self._columns) else []
            else:
                places = [k for k, name in enumerate(self._headers) if name == one]
                places = places or [k for k, stem in enumerate(stems) if stem == one]
            if len(places) > 1:
                raise MismatchError(f"{quantity}: '{one}' is the name of columns {_list(places)}: give the number.")
            if not places:
                near = "" if isinstance(one, int) else _near(one, self._headers)
                there = f"There are {len(self._columns)}: {_list(self._headers)}"
                raise MismatchError(f"{quantity}: there is no column {one!r}{near}. {there}.")
            self._require_numbers(places[0], quantity)
            found += places
        return tuple(found)

    def _require_numbers(self, k, quantity):
        column = self._columns[k]
        text = next((str(one)[:40] for one in column.sample if one), "")
        holds = f"holds text such as '{text}'" if text else f"is of type {column.type}"
        if quantity == "time" and not (column.numeric or column.dated):
            raise MismatchError(f"time: '{column.name}' {holds}, expected numbers or ISO 8601 times.")
        if quantity != "time" and not column.numeric:
            raise MismatchError(f"{quantity}: '{column.name}' {holds}, expected numbers in one or two dimensions.")

    def _candidates(self, quantity):
        """Groups that may be a quantity: the one that the map names, or all by the rules for names."""
        value = getattr(self._wanted, quantity, UNSAID)
        if value is UNSAID:
            return self._groups.get(quantity, [])
        if isinstance(value, str) and JOINT in value:
            return [self._group_of_pattern(quantity, value)]
        places = self._find_columns(quantity, [value] if isinstance(value, str) else value)
        widths = [self._columns[k].width for k in places]
        if len(set(places)) != len(places) or (any(widths) and len(places) > 1):
            array = next((f"'{self._headers[k]}' is a whole array" for k in places if self._columns[k].width), None)
            raise MismatchError(f"{quantity} has {array or 'a column for two joints'}, in the list {_list(value)}.")
        what = f"the list {_list(value)}" if len(places) > 1 else f"'{self._headers[places[0]]}'"
        names = [f"#{n}" for n in range(len(places))] if places[1:] else [""]
        return [_Group(what, tuple((name, None, k) for name, k in zip(names, places, strict=True)), True, widths[0])]

    def _group_of_pattern(self, quantity, pattern):
        """The columns that match a pattern, with or without their units in brackets."""
        before, after = pattern.split(JOINT)
        matcher = re.compile(f"{re.escape(before)}(.+){re.escape(after)}")
        members, with_units = [], split_unit(pattern)[1] is not None
        for k, column in enumerate(self._columns):
            match = matcher.fullmatch(column.name if with_units else split_unit(column.name)[0])
            if match and column.numeric and not column.width:
                number = int(match[1]) if re.fullmatch(r"[0-9]{1,4}", match[1]) else None
                members.append((match[1], number, k))
        if not members:
            near = _near(before + (self._known[0] if self._known else "") + after, self._headers)
            raise MismatchError(f"{quantity}: no column is like '{pattern}'{near}. There are {_list(self._headers)}.")
        return _Group(f"'{pattern}'", tuple(members))

    def _group_columns(self):
        """Groups by quantity; numbers beside a joint of the model do not split a group."""
        sets, longest_first = {}, sorted(self._known, key=len, reverse=True)
        for k, column in enumerate(self._columns):
            named = any(name in self._known for text in column.sample for name in names_of(text))
            header = parse_header(column, longest_first) if column.numeric and not named else None
            if header:
                general = re.sub(r"\d+", "*", header.pattern) if header.joint in self._known else header.pattern
                sets.setdefault((header.quantity, general), []).append((header, k))
        groups = {}
        for (quantity, general), members in sets.items():
            first, k = members[0]
            pattern = first.pattern if len({header.pattern for header, _ in members}) == 1 else general
            joints = tuple((header.joint, header.number, k) for header, k in members)
            width, unit = 0 if first.joint else self._columns[k].width, "A" if quantity == "current" else None
            groups.setdefault(quantity, []).append(_Group(f"'{pattern}'", joints, not first.joint, width, unit))
        return groups

    def _doubled(self, group):
        """A text on two columns of one joint; empty if there are none."""
        columns = {}
        for joint, _, k in group.members:
            if joint in columns:
                first, second = (f"'{self._headers[one]}' (column {one})" for one in (columns[joint], k))
                return f"{first} and {second} are both {group.pattern} of '{joint}'."
            columns[joint] = k
        return ""

    def _require_one(self, quantity, groups):
        """Reject several groups, and two columns of one joint."""
        if len(groups) > 1:
            listed = " or ".join(group.pattern for group in groups)
            raise MismatchError(
                f"several sets of columns may be the {quantity}: say which by `{quantity}: …`, {listed}."
            )
        if text := self._doubled(groups[0]):
            raise MismatchError(text)

    # --- Units ---

    def _make_quantity(self, quantity, group, columns, joints, names):
        """Columns with their scale, and a note of both."""
        scale = self._wanted.scale.get(quantity)
        if scale is None:
            every = columns * len(joints) if group.width else columns
            scale = [1.0 if k is None else self._factor_of(quantity, group, k) for k in every]
        elif isinstance(scale, Mapping) and not names:
            odd = [joint for joint in scale if joint != ALL and joint not in joints]
            lacking = [joint for joint in joints if joint not in scale and ALL not in scale]
            if odd or lacking:
                problem = f"'{odd[0]}', which is none of" if odd else f"nothing for '{lacking[0]}', of"
                raise MismatchError(f"scale: {quantity} has {problem} the joints {_list(joints)}.")
            scale = [scale.get(joint, scale.get(ALL)) for joint in joints]
        elif isinstance(scale, list) and len(scale) != len(joints):
            raise MismatchError(f"scale: {quantity} has {len(scale)} numbers, but there are {len(joints)} joints.")
        elif not isinstance(scale, Mapping):
            scale = scale if isinstance(scale, list) else [scale] * len(joints)
        whose, lack = f"{len(joints)} joints", [joint for joint, k in zip(joints, columns, strict=False) if k is None]
        if names:
            whose, lack = f"the joints that '{names.pattern}' names in each row", []
        lack = f", none for {_list(lack)}" if lack else ""
        times = "" if isinstance(scale, Mapping) else _times(scale, _SI[quantity])
        self._notes.append(f"{quantity}: {group.pattern} of {whose}{times}{lack}.")
        return Quantity(columns, bool(group.width), scale if isinstance(scale, Mapping) else np.array(scale, float))

    def _factor_of(self, quantity, group, k):
        header, joint = self._headers[k], next(joint for joint, _, one in group.members if one == k)
        without = header.replace(joint, " ", 1) if joint else header  # a joint may be called deg
        return _factor(quantity, unit_of(self._columns[k], without) or group.unit, header)


def _factor(quantity, unit, header):
    """Factor of a unit to SI."""
    factor = 1.0 if unit is None else factor_of(quantity, unit)
    if factor is None:
        leave = f", or `{quantity}: null` to do without" if quantity in ("velocity", "effort") else ""
        scale = f"give in the map of columns `scale: {{{quantity}: …}}`, by which its numbers are multiplied{leave}"
        raise MismatchError(
            f"column '{header}' is in '{unit}', from which the {quantity} in SI units does not follow: {scale}."
        )
    return factor


def _fits(rows, group):
    """Whether columns of names may belong to columns of positions."""
    if not rows.listed and not rows.numbers:  # a joint in each row
        return group.count == 1 and (rows.known or "joint" in rows.pattern.lower())
    places = len(rows.first) if rows.listed else len(rows.numbers)
    return places == group.count or (rows.labelled and (rows.known or bool(group.width)))


def _times(scale, unit):
    """What numbers are multiplied by, unless it is 1."""
    each = sorted(set(scale))
    return "" if each == [1.0] else f", times {_list([f'{one:g}' for one in each])} for {unit}"


def _count_up(numbers, count):
    """Whether numbers are 0, 1, 2, … or 1, 2, 3, … in any order."""
    return sorted(numbers) in (list(range(count)), list(range(1, count + 1)))


def _near(name, names):
    near = get_close_matches(name, [str(one) for one in names], n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def _list(names, most=12):
    names = [str(name) for name in names]
    return ", ".join(names[:most]) + (f" … ({len(names)})" if len(names) > most else "")
