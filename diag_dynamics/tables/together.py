# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of single joints at one time as one row: long tables."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables.columns import Columns


class Together:
    """Joins rows of one time, each of which names one joint, and leaves other tables as they are.

    Parameters
    ----------
    choice : Choice
    path : str
    """

    def __init__(self, choice, path):
        names = choice.names
        self._joins = names is not None and names.whole is None and len(names.columns) == 1
        self._path, self._held, self._seen, self._last = path, None, set(), None

    def take(self, columns):
        """Take a piece; return pieces of whole rows, of which the last may be held back."""
        if not self._joins:
            return [columns]
        self._refuse_order_of_joints(columns)
        if self._held is not None:
            columns = _joined(self._held, columns)
        starts = _starts(columns)
        last = starts[-1]
        self._held = _part(columns, slice(last, None))
        return [_together(_part(columns, slice(0, last)), starts[:-1])] if last else []

    def end(self):
        """Return what was held back."""
        if self._held is None:
            return []
        held, self._held = self._held, None
        return [_together(held, _starts(held))]

    def _refuse_order_of_joints(self, columns):
        """Refuse rows in the order of joints: times begin anew with the second one."""
        names, stamps = columns.names[:, 0], columns.stamp
        if len(self._seen) > 1:
            return
        for k, name in enumerate(names.tolist()):
            if self._seen and name not in self._seen:
                if self._last is not None and stamps[k] < self._last[1]:
                    raise InputError(
                        f"'{self._path}': rows are in the order of joints, '{self._last[0]}' before '{name}'; times begin "
                        f"again at {columns.time[k]:g} s. Sort the rows by time."
                    )
                self._seen.add(name)
                return
            self._seen.add(name)
            self._last = name, stamps[k]


def _starts(columns):
    """First row of each time: rows of one time that name different joints belong together."""
    stamps, names, starts, there = columns.stamp.tolist(), columns.names[:, 0].tolist(), [], set()
    for k, (stamp, name) in enumerate(zip(stamps, names, strict=True)):
        if not k or stamp != stamps[k - 1] or name in there:
            starts.append(k)
            there = set()
        there.add(name)
    return starts


def _together(columns, starts):
    """Rows from each start on as one."""
    starts = np.array(starts)
    counts = np.diff([*starts, len(columns.rows)])
    row = np.repeat(np.arange(len(starts)), counts)
    place = np.arange(len(columns.rows)) - starts[row]

    def wide(values, fill):
        if values is None:
            return None
        found = np.full((len(starts), int(counts.max())), fill, dtype=values.dtype)
        found[row, place] = values[:, 0]
        return found

    values = [wide(one, np.nan) for one in (columns.position, columns.velocity, columns.effort)]
    return Columns(columns.time[starts], columns.stamp[starts], *values, columns.rows[starts], wide(columns.names, ""))


def _part(columns, which):
    return Columns(*(None if one is None else one[which] for one in columns))


def _joined(first, second):
    return Columns(
        *(None if one is None else np.concatenate([one, other]) for one, other in zip(first, second, strict=True))
    )
