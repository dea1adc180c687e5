# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of a table as the messages that a driver would have sent."""

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.bags.messages import Messages
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.intake import JOINT_STATE
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import message_type

LATEST = (1 << 31) - 1
"""Last second that a stamp can be of."""


class Rows:
    """Makes joint states of rows: stamp and time of reception are the row's time, put off so that the first one is not zero.

    Parameters
    ----------
    joints : sequence of str
        Of the columns.

    Attributes
    ----------
    offset : int
        By how much stamps are later than times in the table [ns].
    notes : list of str
        What is odd about times.
    """

    def __init__(self, joints):
        self._joints, self._templates = list(joints), {}
        self.offset = None
        self._beyond, self._first_beyond = 0, ""  # rows of times that no stamp can be of

    @property
    def notes(self):
        """Of rows that are refused for their times, which their stamps cannot tell."""
        if not self._beyond:
            return []
        return [
            f"{self._beyond} rows are of times that no stamp can be of, before 0 s or after {LATEST} s, and are refused as "
            f"of -1 s; the first is {self._first_beyond} (if times are not seconds: scale: {{time: ms}} in a map of columns)."
        ]

    def messages(self, columns):
        """Messages of a piece of a table, in its order.

        Parameters
        ----------
        columns : tables.columns.Columns

        Raises
        ------
        InputError
            The first time is none that a stamp can be of.
        """
        if self.offset is None:
            self.offset = self._offset(columns.stamp)
        given = {
            "position": columns.position,
            "velocity": columns.velocity,
            "effort": columns.effort,
        }
        given = {field: np.ascontiguousarray(values) for field, values in given.items() if values is not None}
        template, count = self._template(tuple(given)), len(columns.stamp)
        stamp = columns.stamp + self.offset
        seconds, nanoseconds = stamp // SECOND, stamp % SECOND
        beyond = (seconds < 0) | (seconds > LATEST)
        if beyond.any():
            if not self._beyond:
                k = int(np.argmax(beyond))
                self._first_beyond = f"row {columns.rows[k]}, of {columns.time[k]:g} s"
            self._beyond += int(beyond.sum())
            seconds = np.where(beyond, -1, seconds)  # such a row is refused for its stamp
        data = np.tile(template.data, (count, 1))
        for path, values in (
            ("header.stamp.sec", seconds.astype(np.int32)[:, None]),
            ("header.stamp.nanosec", nanoseconds.astype(np.uint32)[:, None]),
            *given.items(),
        ):
            begin, width = template.place(path), values.dtype.itemsize * values.shape[1]
            data[:, begin : begin + width] = values.view(np.uint8).reshape(count, width)
        size = data.shape[1]
        return Messages(
            data.reshape(-1), *np.zeros((1, count), dtype=int), np.arange(count) * size, np.full(count, size), stamp
        )

    def _offset(self, stamps):
        """What makes the first stamp a second or more, in whole seconds."""
        first = int(stamps[0]) if len(stamps) else 0
        if not 0 <= first // SECOND + (offset := max(0, 1 - first // SECOND)) <= LATEST:
            raise InputError(
                f"the first row is of {first / SECOND:g} s, later than {LATEST} s: is the time in another unit than seconds? "
                "(scale: {time: 1e-9} in the map of columns)"
            )
        return offset * SECOND

    def _template(self, fields):
        if fields not in self._templates:
            some = [1.0] * len(self._joints)
            message = message_type(JOINT_STATE)(name=self._joints, **dict.fromkeys(fields, some))
            self._templates[fields] = Template(message)
        return self._templates[fields]
