# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The columns of one table that are read: as its map says, and by their names where it says nothing."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import NamedTuple

import numpy as np

from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.tables.column_map import JOINT, UNSAID
from diag_dynamics.tables.headers import found, time_columns, unit_of, unit_of_time
from diag_dynamics.tables.names import RowNames, nearest
from diag_dynamics.tables.names_in_data import NamesInData
from diag_dynamics.tables.units import factor, split_unit


class Quantity(NamedTuple):
    """Columns of positions, velocities or efforts."""

    columns: tuple[int | None, ...]
    """Index of each joint's, None where a joint has none; empty of a whole array. Where rows name joints: of each place."""
    whole: int | None
    """Index of a whole array."""
    scale: np.ndarray
    """From the file's numbers to SI: shape (k,)."""


class Choice(NamedTuple):
    """What is read of a table."""

    joints: tuple[str, ...]
    time: tuple[int, ...]
    """One column, or two: seconds and nanoseconds."""
    time_scale: float
    """[s]"""
    time_in_doubt: bool
    """Whether nothing says the unit of the times, so that it can only be seen by their size."""
    position: Quantity
    velocity: Quantity | None
    effort: Quantity | None
    notes: tuple[str, ...]
    """How the columns were understood, a sentence for each quantity; and which were not read."""
    names: RowNames | None = None
    """Columns that name the joints of each row."""
    scale_of: Mapping = {}
    """Scales by joint, by quantity, where rows name joints."""
    overruled: RowNames | None = None
    """Columns that name the joints of each row, while the map names others."""

    def used(self):
        """Indices of all columns that are read, in their order."""
        quantities = [one for one in (self.position, self.velocity, self.effort) if one]
        each = {k for one in quantities for k in (*one.columns, one.whole) if k is not None}
        return sorted(each | set(self.time) | set(self.texts()))

    def texts(self):
        """Indices of columns of names."""
        return [k for one in (self.names, self.overruled) if one for k in one.used]

    def quantities(self):
        """Positions, velocities and efforts; None where there are none."""
        return self.position, self.velocity, self.effort


class _Group(NamedTuple):
    """Columns that differ in the joint only."""

    pattern: str
    members: tuple[tuple[str, int | None, int], ...]
    """Joint, its number where it is one, and the column."""
    whole: int | None = None
    ordered: bool = False
    """Whether they are in the order of the joints by themselves: a list, a whole array, or one column for one joint."""
    unit: str | None = None
    """What they are in if their names do not say it."""

    def without_doubles(self):
        """The first column of each joint."""
        first = {}
        for member in self.members:
            first.setdefault(member[0], member)
        return self._replace(members=tuple(first.values()))

    def names_joints(self, model):
        """Whether the headers name joints, and do not number them."""
        joints = {joint for joint, *_ in self.members}
        return not self.ordered and (None in [number for _, number, _ in self.members] or bool(joints & set(model)))


def choose(columns, wanted, known, file, texts=()):
    """Find the columns of a table.

    Parameters
    ----------
    columns : list of Column
        All that the table has.
    wanted : ColumnMap
    known : sequence of str
        Names of the model's joints that move, in their order; empty: not known.
    file : str
        For messages.
    texts : sequence of Text, optional
        Texts outside of headers and rows that may state names of joints.

    Returns
    -------
    Choice

    Raises
    ------
    InputError
        Something is missing, ambiguous, or has a unit that needs a scale.
    """
    return _Choosing(columns, wanted, tuple(known), file, texts).choice()


class _Choosing:
    """The state of :func:`choose`."""

    def __init__(self, columns, wanted, known, file, texts):
        self._columns = columns
        self._wanted = wanted
        self._model, self._known = known, wanted.joints or known
        self._file = file
        self._notes = []
        self._groups = None
        self._in_data = NamesInData(columns, wanted, known, texts)
        self._scale_of = {}

    def choice(self):
        """Everything, positions first: they say which joints there are."""
        time, time_scale, in_doubt = self._time()
        joints, group, columns = self._position()
        names, overruled = self._in_data.judge(group, joints, self._error, self._notes)
        self._by_rows = names
        chosen = {"position": self._quantity("position", group, columns, joints)}
        numbers = {number: k for k, number in enumerate(self._numbers_of(group, columns))}
        for name in ("velocity", "effort"):
            group, columns = self._other(name, joints, numbers)
            chosen[name] = None if group is None else self._quantity(name, group, columns, joints)
        for name in self._wanted.scale:
            if name != "time" and chosen[name] is None:
                raise self._error(f"there is a scale of {name}, but no column of it.")
        choice = Choice(joints, time, time_scale, in_doubt, **chosen, notes=(), names=names, overruled=overruled)
        choice = choice._replace(scale_of=self._scale_of)
        read = set(choice.used())
        unused = [one.name for k, one in enumerate(self._columns) if k not in read and one.name != self._in_data.array]
        if unused:
            self._notes.append(f"not read: {_list(unused)}.")
        return choice._replace(notes=tuple(self._notes))

    def _error(self, text):
        """An error that names the file, and the map if there is one."""
        by = "" if self._wanted.source == "columns" else f" (by {self._wanted.source})"
        return InputError(f"'{self._file}'{by}: {text}")

    # --- Time ---

    def _time(self):
        """Columns of the times, their scale, and whether nothing says it."""
        columns = self._columns
        if self._wanted.time is UNSAID:
            name, time = self._time_by_name()
        else:
            time = tuple(self._index(one, "time") for one in self._wanted.time)
            name = " and ".join(columns[k].name for k in time)
        for k in time:
            if columns[k].width:
                raise self._error(f"time: '{columns[k].name}' has {columns[k].width} columns, expected one.")
        given = self._wanted.scale.get("time")
        if len(time) == 2:
            if given is not None:
                raise self._error("there is a scale of time, but two columns of times, seconds and nanoseconds.")
            self._notes.append(f"time: {name}, seconds and nanoseconds.")
            return time, 1.0, False
        unit = unit_of_time(columns[time[0]])
        scale = given if given is not None else factor("time", unit, f"'{self._file}': column '{name}'")
        self._notes.append(f"time: {name}{_scaled(np.array([scale]), 's')}.")
        return time, scale, given is None and unit is None

    def _time_by_name(self):
        """The name of the times, and their columns, by the rules for names."""
        columns, what = self._columns, "name it by `time: …` in the map of columns"
        candidates = time_columns(columns)
        if len(candidates) > 1 and all("stamp" in name.lower() for name in candidates):
            pattern = self._position()[1].pattern.strip("'")
            near = nearest(list(candidates), pattern)
            candidates = {near[0]: candidates[near[0]]} if len(near) == 1 else candidates
        if len(candidates) > 1:
            raise self._error(f"several columns may be the times: {what}, one of {_list(candidates)}.")
        if candidates:
            return next(iter(candidates.items()))
        for texts in time_columns([one._replace(dated=not one.numeric, sample=()) for one in columns]).values():
            raise self._error(f"{self._no_numbers(texts[0])}, expected numbers or ISO 8601 times.")
        raise self._error(
            f"no column is known as that of the times: {what}, which of {_list(one.name for one in columns)}."
        )

    # --- Joints ---

    def _position(self):
        """Joints, and the columns of their positions: the group, and an index for each."""
        value = self._wanted.position
        if value is not UNSAID:
            group = self._explicit("position", value)
            problem, joints, columns = self._joints(group)
            if problem:
                raise self._error(f"position: {problem}")
            return joints, group, columns
        fitting, problems = [], []
        for group in self._by_name("position"):
            problem, joints, columns = self._joints(group.without_doubles())
            if problem:
                problems.append(self._doubled(group) or problem)
            else:
                fitting.append((joints, group, columns))
        if len(fitting) == 1:
            self._refuse_doubles(fitting[0][1])
            return fitting[0]
        if fitting:
            raise self._ambiguous("position", [group for _, group, _ in fitting])
        why = " ".join(problems) or f"no column is known as a position, of {_list(c.name for c in self._columns)}."
        advice = f"Name them by `position: …` in the map of columns: a pattern such as q_{JOINT}, or a list of columns."
        raise self._error(why if "in the map of columns" in why else f"{why} {advice}")

    def _joints(self, group):
        """Which joints the columns of positions are of: a problem or '', names, and the columns' indices."""
        known, asked = self._known, bool(self._wanted.joints)
        by_data = self._in_data.joints(group, self._count(group))
        if by_data:
            return by_data
        whose = "joints that the map names" if asked else "joints of the model"
        if group.ordered:
            count = self._count(group)
            if known and count != len(known):
                return (
                    f"{group.pattern} has {count} columns, but there are {len(known)} {whose}: {_list(known)}.",
                    (),
                    (),
                )
            names = known or tuple(f"joint{k + 1}" for k in range(count))
            return "", names, tuple(k for *_, k in group.members)
        by_joint = {joint: k for joint, _, k in group.members}
        if known and by_joint.keys() & set(known):
            missing = [joint for joint in known if joint not in by_joint]
            if asked and missing:
                return f"no column {group.pattern} for {_list(missing)}{self._near(missing[0], by_joint)}.", (), ()
            names = tuple(joint for joint in known if joint in by_joint)
            return "", names, tuple(by_joint[joint] for joint in names)
        numbered = sorted((number, joint, k) for joint, number, k in group.members if number is not None)
        numbers = [number for number, *_ in numbered]
        if len(numbered) == len(group.members) and (known or _count_up(numbers)):
            if known and (len(numbers) != len(known) or not _count_up(numbers)):
                return (
                    f"{group.pattern} has the numbers {_list(numbers)}, but there are {len(known)} {whose} "
                    f"({_list(known)}): say which by `joints: […]` in the map of columns.",
                    (),
                    (),
                )
            names = known or tuple(f"joint{number}" for number in numbers)
            return "", names, tuple(k for *_, k in numbered)
        if known:
            return f"{group.pattern} has {_list(by_joint)}, none of which is among the {whose}: {_list(known)}.", (), ()
        return "", tuple(by_joint), tuple(by_joint.values())

    def _numbers_of(self, group, columns):
        """Number of each joint in the names of its columns; empty if they have none."""
        number = {k: number for _, number, k in group.members}
        numbers = [number.get(k) for k in columns]
        return [] if None in numbers else numbers

    def _other(self, name, joints, numbers):
        """Columns of velocities or efforts: the group or None, and an index or None for each joint."""
        value = getattr(self._wanted, name)
        if value is None or (value is UNSAID and self._wanted.position is not UNSAID):
            return None, ()
        if value is not UNSAID:
            group = self._explicit(name, value)
            problem, columns = self._matched(group, joints, numbers)
            if problem:
                raise self._error(f"{name}: {problem}")
            if self._wanted.joints and None in columns:
                joint = joints[columns.index(None)]
                raise self._error(
                    f"{name}: no column {group.pattern} for {joint}{self._near(joint, self._names_of(group))}."
                )
            return group, columns
        for quantity in ("effort", "current") if name == "effort" else (name,):
            fitting = []
            for group in self._by_name(quantity):
                problem, columns = self._matched(group.without_doubles(), joints, numbers)
                if not problem:
                    fitting.append((group, columns))
                elif group.ordered:
                    self._notes.append(f"{name}: not taken: {self._doubled(group) or problem}")
            if len(fitting) > 1:
                raise self._ambiguous(name, [group for group, _ in fitting])
            if fitting:
                self._refuse_doubles(fitting[0][0])
                return fitting[0]
        return None, ()

    def _matched(self, group, joints, numbers):
        """A problem or '', and the column of each joint that has one."""
        if group.ordered:
            count = self._count(group)
            if count != len(joints):
                return f"{group.pattern} has {count} columns, but there are {len(joints)} joints: {_list(joints)}.", ()
            return "", tuple(k for *_, k in group.members)
        by_joint = {joint: k for joint, _, k in group.members}
        if by_joint.keys() & set(joints):
            return "", tuple(by_joint.get(joint) for joint in joints)
        by_number = {number: k for _, number, k in group.members if number is not None}
        if by_number and numbers and by_number.keys() <= numbers.keys():
            return "", tuple(by_number.get(number) for number in numbers)
        if len(by_number) == len(group.members) == len(joints) and _count_up(sorted(by_number)):
            return "", tuple(by_number[number] for number in sorted(by_number))
        return f"{group.pattern} has {_list(by_joint)}, but the joints are {_list(joints)}.", ()

    def _count(self, group):
        return len(group.members) if group.whole is None else self._columns[group.whole].width

    # --- Columns ---

    def _index(self, column, what):
        """Index of a column by its name or number."""
        if isinstance(column, int):
            if column >= len(self._columns):
                raise self._error(f"{what} is column {column}, but there are {len(self._columns)}, from 0.")
            return self._numeric(column, what)
        for name_of in (lambda one: one.name, lambda one: split_unit(one.name.strip())[0]):
            places = [k for k, one in enumerate(self._columns) if name_of(one) == column]
            if len(places) > 1:
                raise self._error(f"{what}: '{column}' is the name of columns {_list(places)}: give the number.")
            if places:
                return self._numeric(places[0], what)
        names = self._names()
        raise self._error(
            f"{what}: there is no column '{column}'{self._near(column, names)}. There are {_list(names)}."
        )

    def _numeric(self, k, what):
        """The index, if the column holds numbers."""
        column = self._columns[k]
        if what == "time" and not (column.numeric or column.dated):
            raise self._error(f"time: {self._no_numbers(k)}, expected numbers or ISO 8601 times.")
        if what != "time" and not column.numeric:
            raise self._error(f"{what}: '{column.name}' does not hold numbers in one or two dimensions.")
        return k

    def _no_numbers(self, k):
        """What a column holds that has no numbers."""
        column = self._columns[k]
        text = next((str(one) for one in column.sample if one), "")
        return (
            f"'{column.name}' holds text such as '{text[:40]}'" if text else f"'{column.name}' is of type {column.type}"
        )

    def _names(self):
        return [one.name for one in self._columns]

    def _near(self, name, names):
        near = get_close_matches(name, [str(one) for one in names], n=1)
        return f" (did you mean '{near[0]}'?)" if near else ""

    def _names_of(self, group):
        return [joint for joint, *_ in group.members]

    def _explicit(self, quantity, value):
        """The group that a map names."""
        if isinstance(value, str) and JOINT in value:
            return self._pattern(quantity, value)
        entries = [value] if isinstance(value, str) else value
        places = [self._index(one, quantity) for one in entries]
        if len(places) == 1 and self._columns[places[0]].width:
            return _Group(f"'{entries[0]}'", (), places[0], True)
        for k in places:
            if self._columns[k].width:
                raise self._error(f"{quantity}: '{self._columns[k].name}' is a whole array, in a list of columns.")
        if len(set(places)) != len(places):
            raise self._error(f"{quantity} has a column for two joints, of {_list(entries)}.")
        what = f"'{value}'" if isinstance(value, str) else f"the list {_list(entries)}"
        return _Group(what, tuple(("", None, k) for k in places), None, True)

    def _pattern(self, quantity, pattern):
        """The columns that match a pattern, which has units in brackets or not."""
        before, after = pattern.split(JOINT)
        matcher = re.compile(f"{re.escape(before)}(.+){re.escape(after)}")
        members, with_units = [], split_unit(pattern)[1] is not None
        for k, column in enumerate(self._columns):
            match = matcher.fullmatch(column.name if with_units else split_unit(column.name)[0])
            if match and column.numeric and not column.width:
                number = re.fullmatch(r"\d{1,4}", match[1], re.ASCII)
                members.append((match[1], number and int(match[1]), k))
        if not members:
            names = self._names()
            near = self._near(before + (self._known[0] if self._known else "") + after, names)
            raise self._error(f"{quantity}: no column is like '{pattern}'{near}. There are {_list(names)}.")
        group = _Group(f"'{pattern}'", tuple(members))
        self._refuse_doubles(group)
        return group

    def _by_name(self, quantity):
        """The groups of a quantity by the rules for names."""
        if self._groups is None:
            self._groups = {}
            longest_first = sorted(self._known, key=len, reverse=True)
            for k, column in enumerate(self._columns):
                one = found(column, longest_first)
                if one:
                    members = self._groups.setdefault(one.quantity, {}).setdefault(one.pattern, [])
                    members.append((one.joint, one.number, k))
            self._groups = {name: _without_numbers(groups, self._known) for name, groups in self._groups.items()}
        groups, unit = [], "A" if quantity == "current" else None
        for pattern, members in self._groups.get(quantity, {}).items():
            joint, _, k = members[0]
            if joint:
                groups.append(_Group(f"'{pattern}'", tuple(members), unit=unit))
            elif self._columns[k].width:
                groups.append(_Group(f"'{pattern}'", (), k, True, unit))
            else:
                groups.append(_Group(f"'{pattern}'", tuple(members), None, True, unit))
        return groups

    def _doubled(self, group):
        """A text on two columns of one joint; empty if there are none."""
        columns = {}
        for joint, _, k in group.members:
            if joint in columns:
                names = f"'{self._columns[columns[joint]].name}' (column {columns[joint]})"
                return f"{names} and '{self._columns[k].name}' (column {k}) are both {group.pattern} of '{joint}'."
            columns[joint] = k
        return ""

    def _refuse_doubles(self, group):
        """Refuse two columns of one joint."""
        if text := self._doubled(group):
            raise self._error(text)

    def _ambiguous(self, quantity, groups):
        listed = " or ".join(group.pattern for group in groups)
        return self._error(f"several sets of columns may be the {quantity}: say which by `{quantity}: …`, {listed}.")

    # --- Units ---

    def _quantity(self, name, group, columns, joints):
        """Columns with their scales; a note of how they were understood."""
        given = self._wanted.scale.get(name)
        if given is None:
            joint_of = {k: joint for joint, _, k in group.members}
            scales = [self._factor(name, group, k, joint_of.get(k)) for k in columns or (group.whole,) * len(joints)]
        elif isinstance(given, Mapping) and self._by_rows:
            scales, self._scale_of[name] = [1.0] * len(joints), given
        elif isinstance(given, Mapping):
            odd = [joint for joint in given if joint != ALL and joint not in joints]
            lacking = [joint for joint in joints if joint not in given and ALL not in given]
            if odd or lacking:
                problem = f"'{odd[0]}', which is none of" if odd else f"nothing for '{lacking[0]}', of"
                raise self._error(f"scale: {name} has {problem} the joints {_list(joints)}.")
            scales = [given.get(joint, given.get(ALL)) for joint in joints]
        elif isinstance(given, list):
            if len(given) != len(joints):
                raise self._error(f"scale: {name} has {len(given)} numbers, but there are {len(joints)} joints.")
            scales = given
        else:
            scales = [given] * len(joints)
        scale = np.array(scales, float)
        without = [joint for joint, k in zip(joints, columns, strict=False) if k is None]
        lack = f", none for {_list(without)}" if without else ""
        unit = {"position": "rad or m", "velocity": "rad/s or m/s", "effort": "N m or N"}[name]
        whose = f"{len(joints)} joints"
        if self._by_rows:
            whose, lack = f"the joints that '{self._by_rows.pattern}' names in each row", ""
        self._notes.append(f"{name}: {group.pattern} of {whose}{_scaled(scale, unit)}{lack}.")
        return Quantity(columns, group.whole, scale)

    def _factor(self, quantity, group, k, joint):
        """What the numbers of a column are multiplied by, from what its name says."""
        if k is None:
            return 1.0
        column = self._columns[k]
        without = column.name.replace(joint, " ", 1) if joint else column.name  # a joint may be called deg
        unit = unit_of(column, without) or group.unit
        return factor(quantity, unit, f"'{self._file}': column '{column.name}'")


def _without_numbers(groups, known):
    """Groups by pattern, those of single named joints together whose patterns differ in a number: ``q0_elbow``."""
    merged, found = {}, {}
    for pattern, members in groups.items():
        if len(members) == 1 and members[0][0] in known:
            merged.setdefault(re.sub(r"\d+", "*", pattern), []).append((pattern, members[0]))
    for general, several in merged.items():
        if len({joint for _, (joint, *_) in several}) == len(several) > 1:
            found |= dict.fromkeys([pattern for pattern, _ in several], general)
    result = {}
    for pattern, members in groups.items():
        result.setdefault(found.get(pattern, pattern), []).extend(members)
    return result


def _scaled(scale, unit):
    """What numbers are multiplied by, unless it is 1."""
    each = sorted(set(scale.tolist()))
    return "" if each == [1.0] else f", times {_list([f'{one:g}' for one in each])} for {unit}"


def _count_up(numbers):
    """Whether sorted numbers are 0, 1, 2, … or 1, 2, 3 and so on."""
    return bool(numbers) and numbers[0] in (0, 1) and numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def _list(names, most=12):
    names = [str(name) for name in names]
    return ", ".join(names[:most]) + (f" … ({len(names)})" if len(names) > most else "")
