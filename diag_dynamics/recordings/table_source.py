# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables as batches of joint states, as a driver would have sent them."""

import re
from contextlib import suppress

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.decoding import FIELDS, JointStates
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.recordings.intake import Batch
from diag_dynamics.recordings.tables import open_reader, open_table
from diag_dynamics.recordings.tables.template import write_template

LATEST = (1 << 31) - 1  # last second that a stamp can be of


class TableSource:
    """Rows of a table as joint states, a Source; stamps and log times begin after zero."""

    start = None

    def __init__(self, path, columns, names):
        self._path, self._columns, self.names = path, columns, names
        self._table, self._delay = None, None
        self._beyond, self._first_beyond = 0, ""  # rows of times that no stamp can be of

    @property
    def offset(self):
        """Delay of stamps from times in the table [ns]."""
        return self._delay or 0

    @property
    def unread(self):
        """Unreadable data: a list of Unread."""
        return self._table.unread if self._table else []

    @property
    def without_values(self):
        """Number of rows without a value of any joint."""
        return self._table.without_values if self._table else 0

    @property
    def notes(self):
        """How columns and times were read: a list of str."""
        beyond = (
            f"{self._beyond} rows have times outside of 0 … {LATEST} s, the range of ROS stamps, "
            "and are rejected; the "
            f"first is {self._first_beyond}. If times are not in seconds, set scale: {{time: ms}} "
            f"in a column map."
        )
        notes = [beyond] * (self._beyond > 0)
        return notes + (self._table.notes if self._table else [])

    def description(self):
        """Raise an InputError: a table does not describe its robot."""
        text = f"'{self._path}' is a table, without a robot description"
        raise InputError(f"{text}. Give the robot: --urdf ROBOT (model).")

    def joints(self, model):
        """Return the robot's names of all joints in rows, as a set.

        Fewer numbered columns than joints are of the first joints, if these carry all others.
        """
        map_name, table = self.names.map_name if self.names else str, None
        for count in (None, *_leading_counts(model)):
            if table is None:
                with suppress(InputError):
                    table = self._open(model, count)
        table = table or self._open(model)  # raises the error of all joints
        return {map_name(name) for names in _names(table) for name in names}

    def limit(self, begin, end):
        """Omit nothing: a table has no index."""

    def batches(self, model):
        """Yield batches of messages in the order of the rows."""
        self._table = self._open(model)
        for columns in self._table.pieces():
            yield self._make_batch(columns)

    def write_column_map(self, path, joints):
        """Write a column map to fill in to a new file; `joints` are the model's, or empty."""
        write_template(path, open_reader(self._path, self._columns), joints)

    def _open(self, model, count=None):
        """Return the table with any names of the joints, or of the first `count`, by the map."""
        joints = single_joints(model)[:count]
        if self.names:
            joints = [name for joint in joints for name in self.names.unmap_joint(joint)]
        return open_table(self._path, self._columns, tuple(joints))

    def _make_batch(self, columns):
        """Return the Batch of a piece of the table."""
        stamp, sec, nanosec = self._find_stamps(columns)
        groups = {tuple(self._table.joints): range(len(stamp))}
        if columns.names is not None:
            groups = {}
            for k, names in enumerate(map(tuple, columns.names.tolist())):
                groups.setdefault(names, []).append(k)
        parts, fields = [], [getattr(columns, field) for field in FIELDS]
        for names, places in groups.items():
            rows = np.array(places, np.int64)
            named, nothing = np.flatnonzero(names), np.zeros((len(rows), 0))
            values = (nothing if x is None else x[np.ix_(rows, named)] for x in fields)
            joints = tuple(filter(None, names))
            parts.append(JointStates(rows, joints, sec[rows], nanosec[rows], *values))
        return Batch(stamp, parts, {}, {})

    def _find_stamps(self, columns):
        """Return stamps [ns], their seconds and nanoseconds.

        Stamps that no message can have are −1 s, which is rejected.
        """
        if self._delay is None:  # the first stamp is of a second or more
            first = int(columns.stamp[0]) // SECOND
            self._delay = max(0, 1 - first) * SECOND if first > -LATEST else 0
        stamp = columns.stamp + self._delay
        sec, nanosec = stamp // SECOND, stamp % SECOND
        beyond = (sec < 0) | (sec > LATEST)
        if beyond.any() and not self._beyond:
            k = int(np.argmax(beyond))
            self._first_beyond = f"{self._table.unit} {columns.rows[k]}, of {columns.time[k]:g} s"
        self._beyond += int(beyond.sum())
        return stamp, np.where(beyond, -1, sec), nanosec


def _leading_counts(model):
    """Yield how many of the first joints are a chain that carries all others.

    Names of these have no numbers, or those of their order.
    """
    joints = single_joints(model)
    bodies = [model.first_body(name) for name in joints]
    for count in range(len(joints) - 1, 0, -1):
        numbers = [re.findall(r"\d+", name)[-1:] for name in joints[:count]]
        is_chain = all(
            body in _carriers(model, last)
            for last in bodies[count - 1 :]
            for body in bodies[:count]
        )
        is_ordered = len({int(*digits) - k for k, digits in enumerate(numbers) if digits}) < 2
        if is_chain and is_ordered and all(numbers) == any(numbers):
            yield count


def _carriers(model, body):
    """Return a body and those that carry it, as a set."""
    carriers = set()
    while body > 0:
        carriers.add(body)
        body = int(model.bodies["parent"][body])
    return carriers


def _names(table):
    """Yield the names of joints of a table, or of each of its pieces."""
    if table.joints:
        yield table.joints
        return
    for columns in table.pieces():
        yield filter(None, columns.names.flat)
