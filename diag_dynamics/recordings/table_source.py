# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables as batches of joint states, as a driver would have sent them."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.decoding import FIELDS, JointStates
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.recordings.intake import Batch
from diag_dynamics.recordings.joint_names import describe_maps, listed, propose_maps
from diag_dynamics.recordings.tables import open_table

LATEST = (1 << 31) - 1  # last second that a stamp can be of


class TableSource:
    """Rows of a table as joint states; stamps and log times are delayed so that the first one is not zero."""

    start = None  # as of BagSource

    def __init__(self, path, columns, names):
        self._path, self._columns, self.names = path, columns, names
        self._table, self._delay, self._named = None, None, {}
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
    def currents(self):
        """Columns of efforts that are motor currents [A]; empty for torques."""
        return self._table.currents if self._table else ""

    @property
    def notes(self):
        """How columns and times were understood: a list of str."""
        beyond = (
            f"{self._beyond} rows have times outside of 0 … {LATEST} s, the range of ROS stamps, and are rejected; the "
            f"first is {self._first_beyond}. If times are not in seconds, set scale: {{time: ms}} in a column map."
        )
        return [beyond] * (self._beyond > 0) + (self._table.notes if self._table else [])

    def description(self):
        """Raise an InputError: a table does not describe its robot."""
        raise InputError(
            f"'{self._path}' is a table, without a robot description. Give the robot: --urdf ROBOT (model)."
        )

    def joints(self, model):
        """Return the robot's names of all joints in rows, as a set."""
        table = open_table(
            self._path,
            self._columns,
            self._own_names(model) if self.names else single_joints(model),
        )
        names = (
            table.joints if one.names is None else filter(None, one.names.flat)
            for one in table.pieces()
        )
        return {
            self.names.map_name(name) if self.names else name for some in names for name in some
        }

    def limit(self, begin, end):
        """Omit nothing: a table has no index."""

    def batches(self, model):
        """Yield batches of messages in the order of the rows."""
        joints = self._own_names(model) if self.names else single_joints(model)
        try:
            self._table = open_table(self._path, self._columns, joints)
        except InputError as error:
            raise InputError(f"{error}{self._proposal(joints)}") from error
        for columns in self._table.pieces():
            yield self._make_batch(columns)
        own, named = [*single_joints(model), *model.mimics, *model.followers], list(self._named)
        if named and not any(
            (self.names.map_name(name) if self.names else name) in own for name in named
        ):
            found = [] if self.names else propose_maps(named, own)
            raise InputError(
                f"'{self._path}': rows name {listed(named)}; expected joints of the robot: {listed(own)}."
                f"{f' {describe_maps(found, named, own)}.' if found else ''}"
            )

    def _make_batch(self, columns):
        """Return the Batch of a piece of the table."""
        stamp, sec, nanosec = self._find_stamps(columns)
        groups = {tuple(self._table.joints): np.arange(len(stamp))}
        if columns.names is not None:
            groups = {}
            for k, names in enumerate(map(tuple, columns.names.tolist())):
                groups.setdefault(names, []).append(k)
            self._named |= dict.fromkeys(name for names in groups for name in names if name)
        parts = []
        for names, rows in groups.items():
            rows, there = (
                np.asarray(rows, dtype=np.int64),
                [place for place, name in enumerate(names) if name],
            )
            fields = (getattr(columns, field) for field in FIELDS)
            values = (
                np.zeros((len(rows), 0)) if one is None else one[np.ix_(rows, there)]
                for one in fields
            )
            parts.append(
                JointStates(rows, tuple(filter(None, names)), sec[rows], nanosec[rows], *values)
            )
        return Batch(stamp, parts, {}, {})

    def _find_stamps(self, columns):
        """Return stamps [ns], their seconds and nanoseconds; −1 s, which is rejected, for those that no message can have."""
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

    def _own_names(self, model):
        """Return the table's names of the joints of a robot, as its map leads to them."""
        joints = single_joints(model)
        undone = tuple(map(self.names.unmap_joint, joints))
        try:
            table = open_table(self._path, self._columns, ())
        except InputError:  # without names it is not certain which columns are read
            table = open_table(self._path, self._columns, undone)
        pieces = (
            table.joints if one.names is None else filter(None, one.names.flat)
            for one in table.pieces()
        )
        own = self.names.check_recording(pieces, model)
        return tuple(name for name in own if self.names.map_name(name) in joints) or undone

    def _proposal(self, joints):
        """Return the map of names by which a table can be read, as a sentence; empty without one."""
        try:
            own = [
                name
                for name in open_table(self._path, self._columns, ()).joints
                if name not in joints
            ]
        except InputError:
            return ""
        found = (
            [] if self.names else propose_maps(own, [joint for joint in joints if joint not in own])
        )
        return f" {describe_maps(found, own, joints)}." if found else ""
