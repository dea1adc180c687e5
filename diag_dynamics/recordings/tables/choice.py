# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Choice of the columns that are read: by the map, and by names where it says nothing."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from functools import partial
from typing import NamedTuple

import numpy as np

from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.tables import headers, joint_names
from diag_dynamics.recordings.tables.column_map import UNSAID
from diag_dynamics.recordings.tables.headers import JOINT, split_unit

_SI = {"position": "rad or m", "velocity": "rad/s or m/s", "effort": "N m or N", "time": "s"}
_ADVICE = "Say which by `joints` or `position` in the map of columns."


class Quantity(NamedTuple):
    """Columns of positions, velocities or efforts."""

    columns: tuple[int | None, ...]  # of each joint, or of each place where rows name joints; None: none
    whole: bool  # whether it is one column, of lists or of a whole array
    scale: np.ndarray | Mapping[str, float]  # factor to SI, (k,); by joint where rows name joints


class Choice(NamedTuple):
    """Columns that are read of a table."""

    joints: tuple[str, ...]
    time: tuple[int, ...]  # one column, or two: seconds and nanoseconds
    time_scale: float
    time_in_doubt: bool  # whether nothing says the unit of the times
    quantities: dict[str, Quantity | None]
    notes: list[str]
    names: joint_names.RowNames | None  # columns that name the joints of each row

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
    members: dict[str, int]  # the first column of each joint, by its name or number
    doubled: str = ""  # which two columns are of one joint
    ordered: bool = False  # whether the order of the joints is that of a list, an array, or one column
    width: int = 0  # columns of an array

    @property
    def count(self):
        return self.width or len(self.members)

    @property
    def numbers(self):
        """Columns by the numbers of their joints, in the order of the numbers."""
        numbered = {int(joint): k for joint, k in self.members.items() if re.fullmatch("[0-9]{1,4}", joint)}
        return dict(sorted(numbered.items()))

    @property
    def columns(self):
        """Columns in their order, or in that of their numbers."""
        return tuple(self.members.values() if self.ordered else self.numbers.values())

    def names_joints(self, model):
        """Whether headers name joints instead of numbering them."""
        named = any(joint in model for joint in self.members) or len(self.numbers) < len(self.members)
        return named and not self.ordered


def choose(columns, wanted, model, file, texts=()):
    """Return the :class:`Choice` among columns by a ColumnMap; InputError if one is missing, ambiguous or lacks a scale.

    `model` are the names of the model's joints that move, in their order, or empty; `texts` may state names of joints.
    """
    try:
        return _Chooser(columns, wanted, tuple(model), texts).choose()
    except InputError as error:
        by = "" if wanted.source == "columns" else f" (by {wanted.source})"
        raise InputError(f"'{file}'{by}: {error.args[0]}") from None


class _Chooser:
    def __init__(self, columns, wanted, model, texts):
        self._columns, self._wanted, self._model, self._texts = columns, wanted, model, texts
        self._headers = [one.name for one in columns]
        self._known = wanted.joints or model
        self._by_map = bool(wanted.joints) or isinstance(wanted.position, list)
        self._row_names = joint_names.find_row_names(columns, model, {text.array for text in texts})
        self._groups, self._notes = self._group_columns(), []

    def choose(self):
        time, scale, in_doubt = self._choose_time()
        group, (joints, columns, rows, text) = self._choose_position()
        self._compare_names(group, joints, rows)
        if text:
            self._notes.append(f"joints: {_list(joints)}, by {text.where}.")
        numbers = {k: number for number, k in group.numbers.items()}
        numbers = [numbers[k] for k in columns if k in numbers]
        chosen = {"position": (group, columns)}
        for quantity in ("velocity", "effort"):
            chosen[quantity] = self._choose_other(quantity, joints, numbers)
        for quantity, one in chosen.items():
            if one:
                chosen[quantity] = self._make_quantity(quantity, *one, joints, rows)
            elif quantity in self._wanted.scale:
                raise InputError(f"there is a scale of {quantity}, but no column of it.")
        choice = Choice(joints, time, scale, in_doubt, chosen, self._notes, rows)
        array = text and text.array
        if unused := [name for k, name in enumerate(self._headers) if k not in choice.used and name != array]:
            self._notes.append(f"not read: {_list(unused)}.")
        return choice

    # --- Time ---

    def _choose_time(self):
        """Columns of the times, their scale, and whether nothing says it."""
        given, wanted = self._wanted.scale.get("time"), self._wanted.time
        time = self._find_time() if wanted is UNSAID else self._find_columns("time", wanted)
        for k in time:
            self._require_numbers(k, "time")
        columns = [self._columns[k] for k in time]
        name = " and ".join(one.name for one in columns)
        if len(time) == 2:
            if given is not None:
                raise InputError("there is a scale of time, but two columns of times, seconds and nanoseconds.")
            self._notes.append(f"time: {name}, seconds and nanoseconds.")
            return time, 1.0, False
        unit = headers.unit_of_time(columns[0])
        scale = _factor("time", unit, name) if given is None else given
        self._notes.append(f"time: {name}{_times([scale], 'time')}.")
        return time, scale, given is None and unit is None

    def _find_time(self):
        """Columns of the times by their names; of several stamps those beside the positions."""
        advice, texts = (
            "name it by `time: …` in the map of columns",
            [one._replace(dated=True) for one in self._columns],
        )
        found = headers.time_columns(self._columns) or headers.time_columns(texts)
        if len(found) > 1 and all("stamp" in name.lower() for name in found):
            pattern = self._choose_position()[0].pattern.strip("'")
            shared = {name: joint_names.shared_length(name, pattern) for name in found}
            near = {name: found[name] for name in found if shared[name] == max(shared.values())}
            found = near if len(near) == 1 else found
        if len(found) == 1:
            return next(iter(found.values()))
        if found:
            raise InputError(f"several columns may be the times: {advice}, one of {_list(found)}.")
        raise InputError(f"no column is known as that of the times: {advice}, which of {_list(self._headers)}.")

    # --- Joints ---

    def _choose_group(self, quantity, word, match):
        """The only group that fits and what `match` returns of it, or None; and why others do not fit."""
        fitting, problems = [], []
        for group in self._candidates(word):
            try:
                fitting.append((group, match(group)))
            except InputError as error:
                problems.append((group, group.doubled or error.args[0]))
        if len(fitting) > 1:
            listed = " or ".join(group.pattern for group, _ in fitting)
            raise InputError(f"several sets of columns may be the {quantity}: say which by `{quantity}: …`, {listed}.")
        if fitting and fitting[0][0].doubled:
            raise InputError(fitting[0][0].doubled)
        return fitting[0] if fitting else None, problems

    def _choose_position(self):
        """The group of the positions, and what `_joints_of` returns of it."""
        found, problems = self._choose_group("position", "position", self._joints_of)
        if found:
            return found
        why = " ".join(text for _, text in problems)
        why = why or f"no column is known as a position, of {_list(self._headers)}."
        raise InputError(f"position: {why}" + ("" if "in the map of columns" in why else f" {_ADVICE}"))

    def _joints_of(self, group):
        """Joints of columns of positions, a column for each, and the RowNames or the Text that names the joints."""
        if not self._by_map and not group.names_joints(self._model):
            if rows := self._rows_for(group):
                return *self._places(group, rows), rows, None
            for one in self._row_names:
                if one.known and not one.listed and len(one.columns) > 1:
                    named = f"{len(one.columns)} columns name joints: {one.pattern}"
                    raise InputError(f"{group.pattern} has {group.count} columns, but {named}.")
            if stated := joint_names.stated_order(self._texts, self._model, group.count, group.pattern):
                return stated[0], group.columns, None, stated[1]
        joints, columns = tuple(group.members), tuple(group.members.values())
        if self._known:
            joints, columns = self._known, self._match(group, self._known)
            if not group.width:
                there = [k for k, column in enumerate(columns) if column is not None]
                joints, columns = (tuple(one[k] for k in there) for one in (joints, columns))
        elif group.ordered or _count_up(group.numbers, group.count):
            numbers = range(1, group.count + 1) if group.ordered else group.numbers
            joints, columns = tuple(f"joint{number}" for number in numbers), group.columns
        return joints, columns, None, None

    def _rows_for(self, group):
        """The columns of names that belong to columns of positions; None without any."""
        pattern = group.pattern.strip("'")
        fitting = [one for one in self._row_names if _fits(one, group)]
        sizes = [
            (len(one.columns), bool(one.numbers), joint_names.shared_length(one.pattern, pattern)) for one in fitting
        ]
        return fitting[sizes.index(max(sizes))] if fitting else None

    def _places(self, group, rows):
        """Labels and columns of positions by the places of names in rows."""
        numbers = group.numbers
        if rows.numbers and not group.ordered:
            if numbers.keys() <= set(rows.numbers):
                return tuple(map(str, rows.numbers)), tuple(map(numbers.get, rows.numbers))
            if len({a - b for a, b in zip(numbers, rows.numbers, strict=False)}) > 1:  # not from 0 and from 1
                named = f"the joints' names are in '{rows.pattern}' with the numbers {_list(rows.numbers)}"
                raise InputError(f"{group.pattern} has the numbers {_list(numbers)}, but {named}.")
        labels = range(group.width) or (group.members if group.ordered else numbers)
        return tuple(map(str, labels)), group.columns

    def _compare_names(self, group, joints, rows):
        """Reject names in headers, rows and texts that contradict each other; note those that the map overrules."""
        lists = joint_names.find_lists(self._texts, self._model)
        lists = [(text.where, names) for names, text, of_joints in lists if of_joints and len(names) > 1]
        named = {where: names for where, names in lists if set(names) & set(self._model)}
        sets = [one for one in self._row_names if one.labelled and one.known and len(one.first) > 1]
        in_rows = {f"'{one.pattern}' in the first row": one.first for one in sets}
        orders = joint_names.find_orders(self._texts, self._model, len(joints)) if self._by_map else ()
        by_headers = group.names_joints(self._model)
        named |= {text.where: order for order, text in orders} | (in_rows if by_headers or self._by_map else {})
        for where, names in named.items():
            if self._by_map:
                if names != joints:
                    self._notes.append(f"joints: those of the map of columns, not {_list(names)} of {where}.")
            elif by_headers and not set(joints) <= set(names):
                odd = _list([joint for joint in joints if joint not in names])
                differ = f"{where} names {_list(names)}: {odd} is not among them"
                raise InputError(f"headers name the joints {_list(joints)}, but {differ}. {_ADVICE}")
            elif rows and len(rows.first) == len(names) and rows.first != names:
                differ = f"'{rows.pattern}' names {_list(rows.first)} in the first row"
                raise InputError(f"{where} names the joints {_list(names)}, but {differ}. {_ADVICE}")

    def _choose_other(self, quantity, joints, numbers):
        """The group of velocities or efforts, and an index or None for each joint; None without columns."""
        value = getattr(self._wanted, quantity)
        if value is None or (value is UNSAID and self._wanted.position is not UNSAID):
            return None
        by_map = value is not UNSAID
        for word in ("effort", "current") if quantity == "effort" else (quantity,):
            match = partial(self._match, joints=joints, numbers=numbers, complete=by_map)
            found, problems = self._choose_group(quantity, word, match)
            if problems and by_map:
                raise InputError(f"{quantity}: {problems[0][1]}")
            self._notes += [f"{quantity}: not taken: {text}" for group, text in problems if group.ordered]
            if found:
                return found
        return None

    def _match(self, group, joints, numbers=(), complete=True):
        """The column of each joint, None where it has none; `numbers` are those of the joints' positions."""
        by_joint, by_number = group.members, group.numbers
        if not group.ordered and by_joint.keys() & set(joints):
            columns = tuple(map(by_joint.get, joints))
        elif by_number and by_number.keys() <= set(numbers) and len(numbers) == len(joints):
            columns = tuple(map(by_number.get, numbers))
        elif group.count == len(joints) and (group.ordered or _count_up(group.numbers, group.count)):
            columns = group.columns
        else:
            what = f"{group.count} columns" if group.ordered else _list(group.members)
            raise InputError(f"{group.pattern} has {what}, but there are {len(joints)} joints: {_list(joints)}.")
        if complete and self._wanted.joints and None in columns:
            joint = joints[columns.index(None)]
            raise InputError(f"no column {group.pattern} for {joint}{_near(joint, group.members)}.")
        return columns

    # --- Columns ---

    def _find_columns(self, quantity, entries):
        """Indices of columns by their names, with or without units, or numbers."""
        found, stems = [], [split_unit(one.strip())[0] for one in self._headers]
        for one in entries:
            places = [one] if isinstance(one, int) and one < len(self._columns) else []
            for names in (self._headers, stems):
                places = places or [k for k, name in enumerate(names) if name == one]
            if len(places) > 1:
                raise InputError(f"{quantity}: '{one}' is the name of columns {_list(places)}: give the number.")
            if not places:
                there = f"There are {len(self._columns)}: {_list(self._headers)}"
                raise InputError(f"{quantity}: there is no column {one!r}{_near(one, self._headers)}. {there}.")
            self._require_numbers(places[0], quantity)
            found += places
        return tuple(found)

    def _require_numbers(self, k, quantity):
        column, is_time = self._columns[k], quantity == "time"
        if (is_time and column.width) or not (column.numeric or (is_time and column.dated)):
            text = next((str(one)[:40] for one in column.sample if one), "")
            holds = f"holds text such as '{text}'" if text else f"is of type {column.type}"
            holds = f"has {column.width} columns" if column.width else holds
            expected = "numbers or ISO 8601 times" if is_time else "numbers in one or two dimensions"
            raise InputError(f"{quantity}: '{column.name}' {holds}, expected {expected}.")

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
            array = next((f": '{self._headers[k]}' is a whole array" for k in places if self._columns[k].width), None)
            raise InputError(f"{quantity}{array or ' has a column for two joints'}, in the list {_list(value)}.")
        what = f"the list {_list(value)}" if len(places) > 1 else f"'{self._headers[places[0]]}'"
        return [_Group(what, {f"#{n}": k for n, k in enumerate(places)}, ordered=True, width=widths[0])]

    def _group_of_pattern(self, quantity, pattern):
        """The columns that match a pattern, with or without their units in brackets."""
        before, after = pattern.split(JOINT)
        matcher = re.compile(f"{re.escape(before)}(.+){re.escape(after)}")
        with_units = split_unit(pattern)[1] is not None
        names = self._headers if with_units else [split_unit(one)[0] for one in self._headers]
        found = [(k, matcher.fullmatch(name)) for k, name in enumerate(names)]
        members = [(one[1], k) for k, one in found if one and self._columns[k].numeric and not self._columns[k].width]
        if not members:
            near = _near(before + (self._known[0] if self._known else "") + after, self._headers)
            raise InputError(f"{quantity}: no column is like '{pattern}'{near}. There are {_list(self._headers)}.")
        return self._make_group(pattern, members)

    def _group_columns(self):
        """Groups by quantity; numbers beside a joint of the model do not split a group."""
        sets, longest_first = {}, sorted(self._known, key=len, reverse=True)
        for k, column in enumerate(self._columns):
            named = any(name in self._known for text in column.sample for name in joint_names.names_of(text))
            header = headers.parse_header(column, longest_first) if column.numeric and not named else None
            if header:
                general = re.sub(r"\d+", "*", header.pattern) if header.joint in self._known else header.pattern
                sets.setdefault((header.quantity, general), []).append((header, k))
        groups = {}
        for (quantity, general), members in sets.items():
            pattern = general if len({header.pattern for header, _ in members}) > 1 else members[0][0].pattern
            group = self._make_group(pattern, [(header.joint, k) for header, k in members])
            groups.setdefault(quantity, []).append(group)
        return groups

    def _make_group(self, pattern, members):
        """A group of pairs of joint and column, the joint empty where headers have none."""
        first, doubled, (joint, column) = {}, "", members[0]
        for one, k in members:
            if one in first:
                both = " and ".join(f"'{self._headers[n]}' (column {n})" for n in (first[one], k))
                doubled = doubled or f"{both} are both '{pattern}' of '{one}'."
            first.setdefault(one, k)
        return _Group(f"'{pattern}'", first, doubled, not joint, 0 if joint else self._columns[column].width)

    # --- Units ---

    def _make_quantity(self, quantity, group, columns, joints, rows):
        """Columns with their scale, and a note of both."""
        scale = self._find_scale(quantity, group, columns, joints, rows)
        times, lack = "", [joint for joint, k in zip(joints, columns, strict=False) if k is None and not rows]
        if not isinstance(scale, Mapping):
            times, scale = _times(scale, quantity), np.array(scale, float)
        whose = f"the joints that '{rows.pattern}' names in each row" if rows else f"{len(joints)} joints"
        whose = _list(joints) if self._by_map else whose
        lack = f", none for {_list(lack)}" if lack else ""
        self._notes.append(f"{quantity}: {group.pattern} of {whose}{times}{lack}.")
        return Quantity(columns, bool(group.width), scale)

    def _find_scale(self, quantity, group, columns, joints, rows):
        """Factors of the columns by the map, or by their units; those by joint as they are where rows name joints."""
        scale, count = self._wanted.scale.get(quantity), len(joints)
        if scale is None:
            labels = {k: joint for joint, k in group.members.items()}
            default = "A" if quantity == "effort" and group in self._groups.get("current", []) else None
            units = {k: headers.unit_of(self._columns[k], labels[k]) or default for k in columns if k is not None}
            scale = [1.0 if k is None else _factor(quantity, units[k], self._headers[k]) for k in columns]
            return scale * count if group.width else scale
        if isinstance(scale, list) and len(scale) != count:
            raise InputError(f"scale: {quantity} has {len(scale)} numbers, but there are {count} joints.")
        if isinstance(scale, Mapping) and not rows:
            odd = [joint for joint in scale if joint != ALL and joint not in joints]
            lacking = [joint for joint in joints if joint not in scale and ALL not in scale]
            if odd or lacking:
                problem = f"'{odd[0]}', which is none of" if odd else f"nothing for '{lacking[0]}', of"
                raise InputError(f"scale: {quantity} has {problem} the joints {_list(joints)}.")
            return [scale.get(joint, scale.get(ALL)) for joint in joints]
        return scale if isinstance(scale, list | Mapping) else [scale] * count


def _factor(quantity, unit, header):
    """Factor of a unit to SI."""
    factor = 1.0 if unit is None else headers.factor_of(quantity, unit)
    if factor is None:
        leave = f", or `{quantity}: null` to do without" if quantity in ("velocity", "effort") else ""
        unknown = f"column '{header}' is in '{unit}', from which the {quantity} in SI units does not follow"
        scale = f"give in the map of columns `scale: {{{quantity}: …}}`, by which its numbers are multiplied{leave}"
        raise InputError(f"{unknown}: {scale}.")
    return factor


def _fits(rows, group):
    """Whether columns of names may belong to columns of positions."""
    if not rows.listed and not rows.numbers and len(rows.columns) == 1:  # a joint in each row
        return group.count == 1 and (rows.known or "joint" in rows.pattern.lower())
    return len(rows.first) == group.count or (rows.labelled and (rows.known or bool(group.width)))


def _times(scale, quantity):
    """What numbers are multiplied by, unless it is 1."""
    each = sorted(set(scale))
    return "" if each == [1.0] else f", times {_list([f'{one:g}' for one in each])} for {_SI[quantity]}"


def _count_up(numbers, count):
    """Whether numbers are 0, 1, 2, … or 1, 2, 3, … in any order."""
    return sorted(numbers) in (list(range(count)), list(range(1, count + 1)))


def _near(name, names):
    near = get_close_matches(str(name), [str(one) for one in names], n=1)
    return f" (did you mean '{near[0]}'?)" if near else ""


def _list(names, most=12):
    names = [str(name) for name in names]
    return ", ".join(names[:most]) + (f" … ({len(names)})" if len(names) > most else "")
