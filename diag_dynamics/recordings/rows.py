# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of a table as the joint states that a driver would have sent."""

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.assembler import FIELDS, JointStates
from diag_dynamics.recordings.intake import Batch

LATEST = (1 << 31) - 1
"""Last second that a stamp can be of."""


class Rows:
    """Makes joint states of rows. Stamp and log time are the row's time, delayed so that the first one is not zero.

    Parameters
    ----------
    joints : sequence of str
        Of the columns; rows that name their joints do not need them.

    Attributes
    ----------
    offset : int
        By how much stamps are later than times in the table [ns]; None before the first rows.
    notes : list of str
        What is odd about times.
    named : dict
        Joints that rows have named as keys, in the order in which they came.
    """

    def __init__(self, joints):
        self._joints, self.named, self.offset = tuple(joints), {}, None
        self._beyond, self._first_beyond = 0, ""  # rows of times that no stamp can be of

    @property
    def notes(self):
        """Of rows that are rejected for their times, which their stamps cannot tell."""
        if not self._beyond:
            return []
        return [
            f"{self._beyond} rows are of times that no stamp can be of, before 0 s or after {LATEST} s, and are refused as "
            f"of -1 s; the first is {self._first_beyond} (if times are not seconds: scale: {{time: ms}} in a map of columns)."
        ]

    def batch(self, columns):
        """Return the Batch of a piece of a table.

        Parameters
        ----------
        columns : Columns

        Raises
        ------
        InputError
            The first time is none that a stamp can be of.
        """
        if self.offset is None:
            self.offset = self._offset(columns.stamp)
        stamp = columns.stamp + self.offset
        sec, nanosec = self._times(columns, stamp)
        groups = {self._joints: np.arange(len(stamp))}
        if columns.names is not None:
            groups = {}
            for k, names in enumerate(map(tuple, columns.names.tolist())):
                groups.setdefault(names, []).append(k)
        parts = []
        for names, rows in groups.items():
            if columns.names is not None:
                self.named |= dict.fromkeys(filter(None, names))
            there = [place for place, name in enumerate(names) if name]
            fields = (getattr(columns, field) for field in FIELDS)
            values = (np.zeros((len(rows), 0)) if one is None else one[np.ix_(rows, there)] for one in fields)
            rows = np.asarray(rows, dtype=np.int64)
            parts.append(JointStates(rows, tuple(filter(None, names)), sec[rows], nanosec[rows], *values))
        return Batch(stamp, parts, {}, {})

    def _times(self, columns, stamp):
        """Return seconds and nanoseconds of stamps; −1 s for those that no message can have."""
        sec, nanosec = stamp // SECOND, stamp % SECOND
        beyond = (sec < 0) | (sec > LATEST)
        if beyond.any():
            if not self._beyond:
                k = int(np.argmax(beyond))
                self._first_beyond = f"row {columns.rows[k]}, of {columns.time[k]:g} s"
            self._beyond += int(beyond.sum())
            sec = np.where(beyond, -1, sec)  # such a row is rejected for its stamp
        return sec, nanosec

    def _offset(self, stamps):
        """Return what makes the first stamp a second or more, in whole seconds [ns]."""
        first = int(stamps[0]) if len(stamps) else 0
        if not 0 <= first // SECOND + (offset := max(0, 1 - first // SECOND)) <= LATEST:
            raise InputError(
                f"the first row is of {first / SECOND:g} s, later than {LATEST} s: is the time in another unit than seconds? "
                "(scale: {time: 1e-9} in the map of columns)"
            )
        return offset * SECOND
