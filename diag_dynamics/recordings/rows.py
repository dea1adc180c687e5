# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rows of a table as the messages that a driver would have sent."""

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.bags.messages import Messages
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.intake import JOINT_STATE
from diag_dynamics.recordings.tables.columns import Columns
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import message_type

FIELDS = "position", "velocity", "effort"

MAX_TEMPLATES = 256
"""Sets of joints in rows whose messages are laid out once."""

LATEST = (1 << 31) - 1
"""Last second that a stamp can be of."""


class Rows:
    """Makes joint states of rows: stamp and time of reception are the row's time, put off so that the first one is not zero.

    Parameters
    ----------
    joints : sequence of str
        Of the columns; rows that name their joints do not need them.

    Attributes
    ----------
    offset : int
        By how much stamps are later than times in the table [ns].
    notes : list of str
        What is odd about times.
    named : dict
        Joints that rows have named as keys, in the order in which they came.
    """

    def __init__(self, joints):
        self._joints, self._templates = list(joints), {}
        self.named = {}
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
        stamp = columns.stamp + self.offset
        times = self._times(columns, stamp)
        if columns.names is None:
            return _messages([(slice(None), self._written(self._joints, columns, times))], stamp)
        rows = {}
        for k, names in enumerate(map(tuple, columns.names.tolist())):
            rows.setdefault(names, []).append(k)
        parts = []
        for names, which in rows.items():
            self.named |= dict.fromkeys(filter(None, names))
            there = [place for place, name in enumerate(names) if name]
            part = Columns(*(None if one is None else one[which] for one in columns))
            part = part._replace(**{field: _places(getattr(part, field), there) for field in FIELDS})
            written = self._written([names[k] for k in there], part, [one[which] for one in times])
            parts.append((which, written))
        return _messages(parts, stamp)

    def _times(self, columns, stamp):
        """Seconds and nanoseconds of stamps; -1 s for those that no message can have."""
        seconds, nanoseconds = stamp // SECOND, stamp % SECOND
        beyond = (seconds < 0) | (seconds > LATEST)
        if beyond.any():
            if not self._beyond:
                k = int(np.argmax(beyond))
                self._first_beyond = f"row {columns.rows[k]}, of {columns.time[k]:g} s"
            self._beyond += int(beyond.sum())
            seconds = np.where(beyond, -1, seconds)  # such a row is refused for its stamp
        return seconds, nanoseconds

    def _written(self, joints, columns, times):
        """Bytes of messages with these joints, (n, size)."""
        given = {field: getattr(columns, field) for field in FIELDS}
        given = {field: np.ascontiguousarray(values) for field, values in given.items() if values is not None}
        if not joints:
            given = {}
        template, (seconds, nanoseconds) = self._template(tuple(joints), tuple(given)), times
        data = np.tile(template.data, (len(columns.stamp), 1))
        for path, values in (
            ("header.stamp.sec", seconds.astype(np.int32)[:, None]),
            ("header.stamp.nanosec", nanoseconds.astype(np.uint32)[:, None]),
            *given.items(),
        ):
            begin, width = template.place(path), values.dtype.itemsize * values.shape[1]
            data[:, begin : begin + width] = values.view(np.uint8).reshape(len(values), width)
        return data

    def _offset(self, stamps):
        """What makes the first stamp a second or more, in whole seconds."""
        first = int(stamps[0]) if len(stamps) else 0
        if not 0 <= first // SECOND + (offset := max(0, 1 - first // SECOND)) <= LATEST:
            raise InputError(
                f"the first row is of {first / SECOND:g} s, later than {LATEST} s: is the time in another unit than seconds? "
                "(scale: {time: 1e-9} in the map of columns)"
            )
        return offset * SECOND

    def _template(self, joints, fields):
        if (joints, fields) not in self._templates:
            if len(self._templates) >= MAX_TEMPLATES:
                self._templates.clear()
            some = [1.0] * len(joints)
            message = message_type(JOINT_STATE)(name=list(joints), **dict.fromkeys(fields, some))
            self._templates[joints, fields] = Template(message)
        return self._templates[joints, fields]


def _places(values, there):
    """Columns of the places that have a joint."""
    return None if values is None else values[:, there]


def _messages(parts, stamp):
    """Messages in the order of their rows, of parts: rows, and their bytes."""
    begin, at, size = 0, np.zeros(len(stamp), dtype=int), np.zeros(len(stamp), dtype=int)
    for which, data in parts:
        at[which], size[which] = begin + np.arange(len(data)) * data.shape[1], data.shape[1]
        begin += data.size
    data = [data.reshape(-1) for _, data in parts]
    whole = np.concatenate(data) if len(data) != 1 else data[0]
    return Messages(whole, np.zeros(len(stamp), dtype=int), at, size, stamp)
