# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The choice of joints by names that stand in rows, comments and metadata."""

import re

from diag_dynamics.tables.headers import found
from diag_dynamics.tables.names import RowNames, first_names, names_of, nearest, row_names, single_names
from diag_dynamics.tables.statements import labelled_joints, stated_order

_NUMBERED = re.compile(r"joints?|joint[_ ]?(?:names?|ids?|index|no|number)|axis|motor")
"""Headers of columns that number the joint of a row."""


class NamesInData:
    """Names of joints in rows, and in a comment or in metadata.

    Parameters
    ----------
    columns : list of Column
    wanted : ColumnMap
    model : sequence of str
        Names of the model's joints.
    texts : sequence of Text
        Comments, metadata and arrays that may state names.

    Attributes
    ----------
    array : str
        Name of the array whose names are used; empty without one.
    """

    def __init__(self, columns, wanted, model, texts):
        self._columns, self._wanted, self._model, self._texts = columns, wanted, tuple(model), tuple(texts)
        self.array = ""
        self._by_map = bool(wanted.joints) or isinstance(wanted.position, list)
        self._sets = row_names(columns, self._model)
        arrays = {text.array for text in self._texts}
        self._loose = tuple(k for k in single_names(columns, self._model) if columns[k].name not in arrays)

    def joints(self, group, count):
        """Joints of columns of positions by the data: a problem or '', joints or places, and columns; None without names."""
        if self._by_map or group.names_joints(self._model):
            return None
        rows = self._rows_for(group, count)
        if rows:
            return _places(group, rows, count)
        if len(self._loose) > 1:
            headers = [self._columns[k].name for k in self._loose]
            return (
                f"{group.pattern} has {count} columns, but {len(headers)} columns name joints: {_list(headers)}.",
                (),
                (),
            )
        numbered = next((one.name for one in self._columns if _NUMBERED.fullmatch(one.name.strip().lower())), None)
        problem, stated = stated_order(self._texts, self._model, count, group.pattern)
        if count == 1 < len(self._model) and numbered and not stated:
            return f"'{numbered}' numbers the joints of rows. Write their names in its place.", (), ()
        if problem:
            return problem, (), ()
        return ("", stated.joints, _in_order(group)) if stated else None

    def judge(self, group, joints, error, notes):
        """Compare names in the data with those that were chosen.

        Parameters
        ----------
        group
            Columns of positions.
        joints : tuple of str
            Those of its columns.
        error : callable
            Makes an error of a text.
        notes : list of str
            Receives what the map overrules.

        Returns
        -------
        tuple
            The names in rows that are used, and those that the map overrules; None where there are none.
        """
        count = len(joints)
        rows = self._rows_for(group, count)
        stated, labelled = stated_order(self._texts, self._model, count)[1], labelled_joints(self._texts, self._model)
        if self._by_map:
            notes += self._overruled_headers(group, joints)
            if stated and stated.joints != joints:
                notes.append(
                    f"joints: the map of columns gives {_list(joints)}; {stated.where} names {_list(stated.joints)} and is "
                    "not used."
                )
            return None, rows
        if group.names_joints(self._model):
            every = [(labelled.joints, labelled.where)] if labelled else []
            for names, where in (*every, *self._first_rows()):
                odd = [joint for joint in joints if joint not in names]
                if odd:
                    raise error(
                        f"headers name the joints {_list(joints)}, but {where} names {_list(names)}: {_list(odd)} is not "
                        "among them. Say which by `joints` and `position` in the map of columns."
                    )
            return None, None
        if rows and labelled and len(rows.first) == len(labelled.joints) and rows.first != labelled.joints:
            raise error(
                f"{labelled.where} names the joints {_list(labelled.joints)}, but '{rows.pattern}' names "
                f"{_list(rows.first)} in the first row. Say which by `joints` and `position` in the map of columns."
            )
        if stated and not rows:
            self.array = stated.array
            notes.append(f"joints: {_list(joints)}, by {stated.where}.")
        return rows, None

    def _overruled_headers(self, group, joints):
        """Headers of positions that name other joints than the map: a list of one sentence, or none."""
        if group.whole is not None or group.names_joints(self._model):
            return []
        longest_first = sorted(self._model, key=len, reverse=True)
        pairs = []
        for joint, k in zip(joints, _in_order(group), strict=False):
            one = found(self._columns[k], longest_first)
            if one and one.joint in self._model and one.joint != joint:
                pairs.append(f"'{self._columns[k].name}' to {joint}")
        return [f"joints: the map of columns gives {_list(pairs)}, though the headers name others."] if pairs else []

    def _first_rows(self):
        """Names of the first row, and where they are, of sets of the model's joints."""
        sets = [one for one in self._sets if one.labelled and one.known and len(one.first) > 1]
        return [(one.first, f"'{one.pattern}'") for one in sets]

    def _rows_for(self, group, count):
        """The columns of names that belong to columns of positions; None if there are none."""
        fitting = [one for one in self._sets if self._fits(one, group, count)]
        if count == len(self._loose) > 1 and not any(set(self._loose) <= set(one.used) for one in fitting):
            pattern = ", ".join(self._columns[k].name for k in self._loose)
            first = first_names([[names_of(text) for text in self._columns[k].sample] for k in self._loose])
            return RowNames(pattern, self._loose, first=first, known=True)
        if not fitting:
            return None
        near = nearest([one.pattern for one in fitting], group.pattern.strip("'"))
        return next(one for one in fitting if one.pattern == near[0])

    def _fits(self, rows, group, count):
        if rows.whole is None and not rows.numbers:  # a joint in each row
            return count == 1 and (rows.known or "joint" in rows.pattern.lower())
        places = len(rows.numbers) if rows.whole is None else len(rows.first)
        return places == count or (rows.labelled and (rows.known or group.whole is not None))


def _places(group, rows, count):
    """Places of columns of positions among those of names: a problem or '', labels, and columns."""
    labels = tuple(joint if number is None else str(number) for joint, number, _ in _sorted(group))
    if not rows.numbers or group.ordered:
        return "", labels or tuple(map(str, range(count))), _in_order(group)
    by_number = {number: k for _, number, k in group.members}
    if by_number.keys() <= set(rows.numbers):
        return "", tuple(map(str, rows.numbers)), tuple(by_number.get(number) for number in rows.numbers)
    if len({one - other for one, other in zip(sorted(by_number), rows.numbers, strict=False)}) == 1:  # from 1, from 0
        return "", labels, _in_order(group)
    problem = (
        f"{group.pattern} has the numbers {_list(by_number)}, but the joints' names are in '{rows.pattern}' with the "
        f"numbers {_list(rows.numbers)}."
    )
    return problem, (), ()


def _sorted(group):
    """Members in the order of their numbers, or as they are."""
    return group.members if group.ordered else sorted(group.members, key=lambda one: one[1])


def _in_order(group):
    return tuple(k for *_, k in _sorted(group))


def _list(names):
    return ", ".join(map(str, names))
