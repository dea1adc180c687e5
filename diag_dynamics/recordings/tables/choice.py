# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Choice of the columns that are read: by the map, and by names where it says nothing."""

import re
from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.joint_names import listed, suggest
from diag_dynamics.recordings.tables import headers, names_in_data
from diag_dynamics.recordings.tables.column_map import QUANTITIES, UNSAID
from diag_dynamics.recordings.tables.headers import JOINT, split_unit

_SI = {"position": "rad or m", "velocity": "rad/s or m/s", "effort": "N m or N", "time": "s"}
_ADVICE = (
    "Name the columns in a column map: `time`, `position`, `velocity`, `effort`, `joints`, `scale`."
)


class Quantity(NamedTuple):
    """Columns of positions, velocities or efforts."""

    columns: tuple[
        int | None, ...
    ]  # of each joint, or of each place where rows name joints; None: none
    whole: bool  # whether it is one column, of lists or of a whole array
    scale: np.ndarray  # factors to SI, (k,)


class Choice(NamedTuple):
    """Columns that are read of a table."""

    joints: tuple[str, ...]
    time: tuple[
        int, ...
    ]  # one column, or two: seconds and nanoseconds; none: rows follow at a rate
    time_scale: float | None  # None: nothing says the unit; of rows at a rate their interval [s]
    quantities: dict[str, Quantity | None]
    notes: list[str]
    names: names_in_data.RowNames | None  # columns that name the joints of each row
    currents: str = ""  # columns of efforts that are currents in A

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
    members: dict[
        str, int
    ]  # the first column of each joint, by its name or number; numbers in their order
    doubled: str = ""  # which two columns are of one joint
    ordered: bool = (
        False  # whether the order of the joints is that of a list, an array, or one column
    )
    width: int = 0  # columns of an array

    @property
    def count(self):
        return self.width or len(self.members)

    @property
    def columns(self):
        return tuple(self.members.values())

    def names_joints(self, model_joints):
        """Return whether headers name joints instead of numbering them."""
        return not self.ordered and not all(
            joint.isdecimal() and joint not in model_joints for joint in self.members
        )


def choose(columns, wanted, model_joints, file, texts=()):
    """Return the :class:`Choice` among columns by a ColumnMap; `texts` may state names of joints."""
    try:
        return _Chooser(columns, wanted, tuple(model_joints), texts).choose()
    except InputError as error:
        by = "" if wanted.source == "columns" else f" (by {wanted.source})"
        raise InputError(f"'{file}'{by}: {error.args[0]} {_ADVICE}") from None


class _Chooser:
    def __init__(self, columns, wanted, model_joints, texts):
        self._columns, self._wanted, self._model_joints, self._texts = (
            columns,
            wanted,
            model_joints,
            texts,
        )
        self._headers = [one.name for one in columns]
        self._known = wanted.joints or model_joints
        self._by_map = bool(wanted.joints) or isinstance(wanted.position, list)
        self._row_names = names_in_data.find_row_names(columns, model_joints)
        self._groups, self._notes, self._currents = self._group_columns(), [], ""

    def choose(self):
        """Return the :class:`Choice`."""
        time, scale = self._choose_time()
        group, (joints, columns, rows, where) = self._choose_position()
        if where:
            self._notes.append(f"joints: {listed(joints)}, by {where}.")
        if self._by_map:
            overruled = [
                (one.first, f"'{one.pattern}' in the first row")
                for one in self._row_names
                if one.known
            ]
            overruled += names_in_data.find_orders(self._texts, self._model_joints, len(joints))
            other = [
                f"{listed(names)} of {where}"
                for names, where in overruled
                if names != joints and len(names) > 1
            ]
            self._notes += [f"joints: those of the column map, not {one}." for one in other]
        numbers = [joint for k in columns for joint, column in group.members.items() if column == k]
        chosen = {"position": (group, columns)}
        chosen |= {
            quantity: self._choose_other(quantity, joints, numbers) for quantity in QUANTITIES[1:]
        }
        for quantity, one in chosen.items():
            if one:
                chosen[quantity] = self._make_quantity(quantity, *one, joints, rows)
            elif quantity in self._wanted.scale:
                raise InputError(f"there is a scale of {quantity}, but no column of it.")
        choice = Choice(joints, time, scale, chosen, self._notes, rows, self._currents)
        if unused := [name or "''" for k, name in enumerate(self._headers) if k not in choice.used]:
            self._notes.append(f"not read: {listed(unused)}.")
        return choice

    # --- Time ---

    def _choose_time(self):
        """Return the columns of times and their scale, None if it is not known."""
        scale, wanted = self._wanted.scale.get("time"), self._wanted.time
        if self._wanted.rate:
            self._notes.append(f"time: number of the row, at {self._wanted.rate:g} Hz.")
            return (), 1.0 / self._wanted.rate
        time = self._find_time() if wanted is UNSAID else self._find_columns("time", wanted)
        for k in time:
            self._require_numbers(k, "time")
        name = " and ".join(self._headers[k] for k in time)
        if len(time) == 2:
            if scale is not None:
                raise InputError(
                    "there is a scale of time, but two columns of times, seconds and nanoseconds."
                )
            self._notes.append(f"time: {name}, seconds and nanoseconds.")
            return time, 1.0
        unit = headers.unit_of_time(self._columns[time[0]])
        if scale is None and unit is not None:
            scale = _factor("time", unit, name)
        self._notes.append(f"time: {name}{_times([scale or 1.0], 'time')}.")
        return time, scale

    def _find_time(self):
        """Return the columns of times by their names; of several stamps those of the topic of the positions."""
        found = headers.time_columns(self._columns)
        if len(found) > 1 and all("stamp" in name.lower() for name in found):
            pattern = self._choose_position()[0].pattern.strip("'")
            shared = {name: names_in_data.shared_length(name, pattern) for name in found}
            near = {name: found[name] for name in found if shared[name] == max(shared.values())}
            found = near if len(near) == 1 else found
        if len(found) != 1:
            what = (
                f"several columns may be the time: {listed(found)}"
                if found
                else "no column is recognized as time"
            )
            rate = "" if found else " Rows at equal intervals need `rate: HZ` only."
            raise InputError(f"{what}; columns: {listed(self._headers)}.{rate}")
        return next(iter(found.values()))

    # --- Joints ---

    def _choose_group(self, quantity, word, match):
        """Return the only group that fits and the result of `match` for it, or None; and why others do not fit."""
        fitting, problems = [], []
        for group in self._candidates(word):
            try:
                fitting.append((group, match(group)))
            except InputError as error:
                problems.append(group.doubled or error.args[0])
        if len(fitting) > 1:
            patterns = " or ".join(group.pattern for group, _ in fitting)
            raise InputError(f"several sets of columns may be the {quantity}, {patterns}.")
        if fitting and fitting[0][0].doubled:
            raise InputError(fitting[0][0].doubled)
        return fitting[0] if fitting else None, problems

    def _choose_position(self):
        """Return the group of the positions, and the result of `_joints_of` for it."""
        found, problems = self._choose_group("position", "position", self._joints_of)
        if not found:
            none = f"no column is recognized as position; columns: {listed(self._headers)}."
            raise InputError(f"position: {' '.join(problems) or none}")
        return found

    def _joints_of(self, group):
        """Return joints of positions, a column for each, and RowNames or the place of a text that names them."""
        by_headers = self._by_map or group.names_joints(self._model_joints)
        return (None if by_headers else self._joints_in_data(group)) or self._joints_of_headers(
            group
        )

    def _joints_in_data(self, group):
        """Return the same for joints that rows, comments or metadata name; None without such names."""
        if rows := self._rows_for(group):
            numbers = rows.numbers if not group.ordered else ()
            shifts = {
                int(joint) - number for joint, number in zip(group.members, numbers, strict=False)
            }
            if len(shifts) > 1 or len(numbers or group.members) != len(group.members):
                both = f"{listed(group.members)}, but '{rows.pattern}' {listed(numbers)}"
                raise InputError(f"{group.pattern} has the numbers {both}.")
            return tuple(map(str, range(group.width) or group.members)), group.columns, rows, None
        for one in self._row_names:
            if one.known and not one.listed and len(one.columns) > 1:
                named = f"{len(one.columns)} columns name joints: {one.pattern}"
                raise InputError(f"{group.pattern} has {group.count} columns, but {named}.")
        stated = names_in_data.stated_order(self._texts, self._model_joints, group.count)
        return (stated[0], group.columns, None, stated[1]) if stated else None

    def _joints_of_headers(self, group):
        """Return the same for joints of the map, of the model, or of headers."""
        joints, columns = tuple(group.members), group.columns
        if self._known:
            joints, columns = self._known, self._match(group, self._known)
            if self._wanted.joints and None in columns:
                raise InputError(f"{group.pattern} has no column of {joints[columns.index(None)]}.")
            if not group.width:
                there = [k for k, column in enumerate(columns) if column is not None]
                joints, columns = (tuple(one[k] for k in there) for one in (joints, columns))
        elif group.ordered or _count_up(joints):
            joints = tuple(
                f"joint{number}"
                for number in (range(1, group.count + 1) if group.ordered else joints)
            )
        return joints, columns, None, None

    def _rows_for(self, group):
        """Return the columns of names that belong to columns of positions; None without any."""
        pattern = group.pattern.strip("'")
        fitting = [one for one in self._row_names if _fits(one, group)]
        shared = names_in_data.shared_length
        rank = [
            (len(one.columns), bool(one.numbers), shared(one.pattern, pattern)) for one in fitting
        ]
        return fitting[rank.index(max(rank))] if fitting else None

    def _choose_other(self, quantity, joints, numbers):
        """Return the group of velocities or efforts, and an index or None for each joint; None without columns."""
        value = getattr(self._wanted, quantity)
        if value is None or (value is UNSAID and self._wanted.position is not UNSAID):
            return None
        for word in ("effort", "current") if quantity == "effort" else (quantity,):
            match = partial(self._match, joints=joints, numbers=numbers)
            found, problems = self._choose_group(quantity, word, match)
            if problems and value is not UNSAID:
                raise InputError(f"{quantity}: {problems[0]}")
            if found:
                return found
        return None

    def _match(self, group, joints, numbers=()):
        """Return the column of each joint, None where it has none; `numbers` are those of the joints' positions."""
        if not group.ordered and group.members.keys() & set(joints):
            return tuple(map(group.members.get, joints))
        numbered = {joint for joint in group.members if joint.isdecimal()}
        if numbered and numbered <= set(numbers) and len(numbers) == len(joints):
            return tuple(map(group.members.get, numbers))
        if group.count == len(joints) and (group.ordered or _count_up(group.members)):
            return group.columns
        what = f"{group.count} columns" if group.ordered else listed(group.members)
        is_named = not (group.ordered or all(map(str.isdecimal, group.members)))
        but = "none of which is one of the" if is_named else "but there are"
        raise InputError(
            f"{group.pattern} has {what}, {but} {len(joints)} joints: {listed(joints)}."
        )

    # --- Columns ---

    def _find_columns(self, quantity, entries):
        """Return indices of columns by their names, with or without units, or numbers."""
        found, stems = [], [split_unit(one.strip())[0] for one in self._headers]
        for one in entries:
            places = [k for k, name in enumerate(self._headers) if one in (k, name)]
            places = places or [k for k, stem in enumerate(stems) if one == stem]
            if len(places) != 1:
                meant = "" if places else suggest(str(one), self._headers)
                there = f"expected the name or number of one of {listed(self._headers)}"
                raise InputError(
                    f"{quantity}: {one!r} is the name of {len(places)} columns; {there}.{meant}"
                )
            self._require_numbers(places[0], quantity)
            found += places
        return tuple(found)

    def _require_numbers(self, k, quantity):
        column, is_time = self._columns[k], quantity == "time"
        if (is_time and column.width) or not (column.numeric or (is_time and column.moments)):
            text = next((f" such as '{one!s:.40}'" for one in column.sample if one), "")
            holds = (
                f"has {column.width} columns" if column.width else f"is of type {column.type}{text}"
            )
            expected = (
                "numbers or ISO 8601 times" if is_time else "numbers in one or two dimensions"
            )
            raise InputError(f"{quantity}: '{column.name}' {holds}, expected {expected}.")

    def _candidates(self, quantity):
        """Return the groups that may be a quantity: the one of the map, or all by the rules for names."""
        value = getattr(self._wanted, quantity, UNSAID)
        if value is UNSAID:
            return self._groups.get(quantity, [])
        if isinstance(value, str) and JOINT in value:
            return [self._group_of_pattern(quantity, value)]
        places = self._find_columns(quantity, [value] if isinstance(value, str) else value)
        widths = [self._columns[k].width for k in places]
        if len(places) > 1 and (any(widths) or len(set(places)) < len(places)):
            raise InputError(
                f"{quantity}: {listed(value)} has an array or a column twice; expected different columns."
            )
        what = f"the list {listed(value)}" if len(places) > 1 else f"'{self._headers[places[0]]}'"
        return [
            _Group(what, {f"#{n}": k for n, k in enumerate(places)}, ordered=True, width=widths[0])
        ]

    def _group_of_pattern(self, quantity, pattern):
        """Return the group of columns that match a pattern, with or without their units in brackets."""
        before, after = pattern.split(JOINT)
        matcher = re.compile(f"{re.escape(before)}(.+){re.escape(after)}")
        found = [
            matcher.fullmatch(split_unit(name)[0]) or matcher.fullmatch(name)
            for name in self._headers
        ]
        numeric = [one.numeric and not one.width for one in self._columns]
        members = [(one[1], k) for k, one in enumerate(found) if one and numeric[k]]
        if not members:
            raise InputError(
                f"{quantity}: no column matches '{pattern}'; columns: {listed(self._headers)}."
            )
        return self._make_group(pattern, members)

    def _group_columns(self):
        """Return the groups of all columns by quantity."""
        sets, groups, longest_first = {}, {}, sorted(self._known, key=len, reverse=True)
        for k, column in enumerate(self._columns):
            named = any(
                name in self._known
                for text in column.sample
                for name in names_in_data.names_of(text)
            )
            header = (
                headers.parse_header(column, longest_first)
                if column.numeric and not named
                else None
            )
            if header:
                quantity, pattern, joint = header
                sets.setdefault((quantity, pattern), []).append((joint, k))
        for (quantity, pattern), members in sets.items():
            groups.setdefault(quantity, []).append(self._make_group(pattern, members))
        return groups

    def _make_group(self, pattern, members):
        """Return the group of pairs of joint and column; the joint is empty where headers have none."""
        first, doubled, (joint, column) = {}, "", members[0]
        for one, k in members:
            one = str(int(one)) if re.fullmatch("[0-9]{1,4}", one) else one
            if one in first:
                both = " and ".join(f"'{self._headers[n]}' (column {n})" for n in (first[one], k))
                doubled = doubled or f"{both} are both '{pattern}' of '{one}'."
            first.setdefault(one, k)
        if all(one.isdecimal() for one in first):
            first = dict(sorted(first.items(), key=lambda item: int(item[0])))
        return _Group(
            f"'{pattern}'", first, doubled, not joint, 0 if joint else self._columns[column].width
        )

    # --- Units ---

    def _make_quantity(self, quantity, group, columns, joints, rows):
        """Return columns with their scale, and note both."""
        scale = np.array(self._find_scale(quantity, group, columns, joints, rows), float)
        whose = (
            f"the joints that '{rows.pattern}' names in each row"
            if rows
            else f"{len(joints)} joints"
        )
        whose = listed(joints) if self._by_map else whose
        lack = [joint for joint, k in zip(joints, columns, strict=False) if k is None]
        none_for = f", none for {listed(lack)}" if lack else ""
        self._notes.append(
            f"{quantity}: {group.pattern} of {whose}{_times(scale.tolist(), quantity)}{none_for}."
        )
        return Quantity(columns, bool(group.width), scale)

    def _find_scale(self, quantity, group, columns, joints, rows):
        """Return the factors of columns by the map, or by their units."""
        scale = self._wanted.scale.get(quantity)
        if scale is None:
            labels = {k: joint for joint, k in group.members.items()}
            default = (
                "A" if quantity == "effort" and group in self._groups.get("current", []) else None
            )
            units = {
                k: headers.unit_of(self._columns[k], labels[k]) or default
                for k in columns
                if k is not None
            }
            if (
                quantity == "effort"
                and units
                and None not in map(headers.amperes_of, units.values())
            ):
                self._currents = group.pattern
                return [1.0 if k is None else headers.amperes_of(units[k]) for k in columns]
            return [
                1.0 if k is None else _factor(quantity, units[k], self._headers[k]) for k in columns
            ]
        if isinstance(scale, float):
            return [scale]
        factors = scale
        if isinstance(scale, Mapping):
            only = scale.keys() <= {ALL, *joints}
            factors = [scale.get(joint, scale.get(ALL)) for joint in joints] if only else []
        if rows or None in factors or len(factors) != len(joints):
            expected = "" if rows else f", or one for each of the joints {listed(joints)}"
            raise InputError(f"scale: {quantity} is {scale}; expected one number{expected}.")
        return factors


def _factor(quantity, unit, header):
    """Return the factor of a unit to SI; 1 without a unit."""
    factor = 1.0 if unit is None else headers.factor_of(quantity, unit)
    if factor is None:
        unknown = f"column '{header}' has the unit '{unit}', which has no factor to the SI unit of {quantity}"
        omit = (
            f", or omit the column by `{quantity}: null`"
            if quantity in ("velocity", "effort")
            else ""
        )
        raise InputError(f"{unknown}. Give the factor by `scale: {{{quantity}: …}}`{omit}.")
    return factor


def _fits(rows, group):
    """Return whether columns of names may belong to columns of positions."""
    if not rows.listed and not rows.numbers and len(rows.columns) == 1:  # a joint in each row
        return group.count == 1 and (rows.known or "joint" in rows.pattern.lower())
    return len(rows.first) == group.count or (rows.labelled and (rows.known or bool(group.width)))


def _times(scale, quantity):
    """Return factors for a note; an empty text if all are 1."""
    each = sorted(set(scale))
    return (
        ""
        if each == [1.0]
        else f", times {listed([f'{one:g}' for one in each])} for {_SI[quantity]}"
    )


def _count_up(numbers):
    """Return whether texts are the numbers 0, 1, 2, … or 1, 2, 3, … in their order."""
    return list(numbers) in [[str(k + first) for k in range(len(numbers))] for first in (0, 1)]
