# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables as batches of joint states in SI units, as a driver would have sent them."""

import re
from contextlib import suppress
from functools import partial
from itertools import chain

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.decoding import FIELDS, JointStates
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.recordings.bag_messages import Unread
from diag_dynamics.recordings.intake import Batch
from diag_dynamics.recordings.tables.cells import (
    read_lists,
    read_numbers,
    read_texts,
    read_times,
    unify,
)
from diag_dynamics.recordings.tables.choice import choose
from diag_dynamics.recordings.tables.headers import UNITS
from diag_dynamics.recordings.tables.readers import open_reader
from diag_dynamics.recordings.tables.table import LEFT_OUT
from diag_dynamics.recordings.tables.template import write_template

LATEST = (1 << 31) - 1  # last second that a stamp can be of
MAX_STEP = 0.3  # interval of rows up to which a unit of times is likely [s]
MIN_STEPS = 100  # rows of which a half has to decrease


class TableSource:
    """Rows of a Table by a Choice, a Source; stamps and log times begin after zero."""

    start = None

    def __init__(self, path, columns, names):
        self._path = path
        self._columns = columns
        self._names = names
        self._table = None
        self._choice = None
        self._losses = {}
        self._without_values = 0  # rows
        self._first = None  # number of the first row at a rate
        self._delay = None  # of stamps [ns]

    @property
    def offset(self):
        """Delay of stamps from times in the table [ns]."""
        return self._delay or 0

    @property
    def unread(self):
        """Unreadable data, a list of Unread."""
        return [
            Unread(self._table.path, where, cause + example + (f": {count} {unit}" if unit else ""))
            for (cause, unit), (where, example, count) in self._losses.items()
        ]

    @property
    def notes(self):
        """How columns and times were read: a list of str."""
        notes = list(self._choice.notes) if self._choice else []
        if self._without_values:
            notes.append(f"rows without joint values, ignored: {self._without_values}.")
        return notes

    def description(self):
        """Raise an InputError: a table does not describe its robot."""
        raise InputError(
            f"'{self._path}' is a table, without a robot description. Give the robot: --urdf ROBOT "
            "(model)."
        )

    def joints(self, model):
        """Return the robot's names of all joints in rows, as a set.

        Fewer numbered columns than joints are of the first joints, if these carry all others.
        """
        opened = None
        for count in (None, *_leading_counts(model)):
            if opened is None:
                with suppress(InputError):
                    opened = self._open(model, count)
        table, choice = opened or self._open(model)  # raises the error of all joints
        names = {*choice.joints}
        for arrays, _ in table.blocks([], choice.names, _ignore) if choice.names else ():
            for array in arrays.values():
                names.update(_read_names(unify(array)).tolist())
        return {self._names.map_name(name) for name in names - {""}}

    def batches(self, model, _begin, _end):
        """Yield batches of messages in the order of the rows; a table has no index."""
        self._table, self._choice = self._open(model)
        count = 0
        texts = [*self._choice.time, *self._choice.names]
        for arrays, rows in self._table.blocks(self._choice.values, texts, self._lose):
            count += len(rows)
            arrays = {k: unify(array) for k, array in arrays.items()}
            time = self._read_times(arrays, rows)
            values = {
                key: self._read_values(quantity, arrays, rows)
                for key, quantity in self._choice.quantities.items()
            }
            names = self._read_joints(arrays)
            is_read = self._find_rows(time, values, names, arrays, rows)
            stamp = self._make_stamps(time, rows, is_read)
            if not is_read.any():
                continue
            seconds = divmod(stamp, SECOND)
            parts = self._make_parts(np.flatnonzero(is_read), *seconds, values, names)
            yield Batch(stamp, parts, {}, {})
        if not count and not self._losses:
            self._lose("there are no rows", "end")

    def write_column_map(self, path, joints):
        """Write a column map to fill in to a new file; `joints` are the model's, or empty."""
        write_template(path, open_reader(self._path, self._columns), joints)

    def _open(self, model, count=None):
        """Return the Table and its Choice by the map, with any names of the first joints."""
        joints = map(self._names.unmap_joint, single_joints(model)[:count])
        table = open_reader(self._path, self._columns)
        return table, choose(table, self._columns, tuple(chain.from_iterable(joints)))

    # --- Cells ---

    def _read_times(self, arrays, rows):
        """Return times [s], NaN if missing; lost rows at a rate have theirs."""
        scale = self._choice.time_scale
        if not self._choice.time:
            self._first = int(rows[0]) if self._first is None and len(rows) else self._first
            return (rows - (self._first or 0)) * np.longdouble(scale)
        seconds, *nanoseconds = (arrays[k] for k in self._choice.time)
        time = read_times(seconds, scale or 1.0)
        return time + read_times(nanoseconds[0], 1e-9) if nanoseconds else time

    def _read_values(self, quantity, arrays, rows):
        """Return values of a quantity as the file has them, (n, k)."""
        if quantity.whole:
            (k,) = quantity.columns
            return read_lists(arrays[k], len(self._choice.joints), self._lose_in_column(k, rows))
        values = np.full((len(rows), len(quantity.columns)), np.nan)
        for joint, k in enumerate(quantity.columns):
            if k is not None:
                values[:, joint] = read_numbers(arrays[k], self._lose_in_column(k, rows))
        return values

    def _read_joints(self, arrays):
        """Return the joint of each value, "" for none; None if all rows have the same joints."""
        if not self._choice.names:
            return None
        return np.column_stack([_read_names(arrays[k]) for k in self._choice.names])

    def _find_rows(self, time, values, names, arrays, rows):
        """Return which rows have a time and a value; count the others."""
        empty = np.ones(len(rows), bool) if names is None else (names == "").all(axis=1)
        for numbers in values.values():
            empty &= np.isnan(numbers).all(axis=1)
        self._without_values += int(empty.sum())
        untimed = np.isnan(time)
        if (lost := np.flatnonzero(untimed & ~empty)).size:
            texts = [read_texts(arrays[k]) for k in self._choice.time]
            cells = [cells[lost[0]][:40] for cells in texts if cells is not None]
            example = " and ".join(map(repr, cells))
            self._lose_rows(rows, "no time, or a time that is no number", LEFT_OUT, lost, example)
        return ~(untimed | empty)

    # --- Messages ---

    def _make_parts(self, places, sec, nanosec, values, names):
        """Return JointStates of rows in some places, those of the same joints together."""
        groups = {self._choice.joints: range(len(places))}
        if names is not None:
            groups = {}
            for k, joints in enumerate(map(tuple, names[places].tolist())):
                groups.setdefault(joints, []).append(k)
        parts = []
        values = {key: self._convert(key, x) for key, x in values.items()}
        for joints, members in groups.items():
            rows = np.array(members, np.int64)
            cells = np.ix_(places[rows], np.flatnonzero(joints))
            nothing = np.zeros((len(rows), 0))
            fields = [values[key][cells] if key in values else nothing for key in FIELDS]
            named = tuple(filter(None, joints))
            parts.append(JointStates(rows, named, sec[rows], nanosec[rows], *fields))
        return parts

    def _convert(self, key, values):
        """Return values of joints in SI units; power is the same at motors and joints."""
        quantity = self._choice.quantities[key]
        mixing = self._choice.mixing
        if (quantity.scale != 1.0).any():
            values = values * quantity.scale
        if mixing is not None:
            matrix = np.linalg.inv(mixing) if key == "effort" else mixing.T
            unknown = np.isnan(values).astype(float) @ (matrix != 0.0) > 0.0
            mixed = np.where(np.isnan(values), 0.0, values) @ matrix
            values = np.where(unknown, np.nan, mixed)
        return values + quantity.offset if quantity.offset.any() else values

    def _make_stamps(self, time, rows, is_read):
        """Return stamps of read rows, shifted after zero [ns]; not of times beyond all stamps."""
        if self._delay is None and is_read.any():
            self._check_times(time[is_read])
            first = time[is_read][0]
            # the first stamp is of a second or more
            self._delay = max(0, 1 - int(first // 1)) * SECOND if abs(first) < LATEST else 0
        least = -self.offset // SECOND
        is_beyond = is_read & ((time < least) | (time >= least + LATEST + 1))
        if (lost := np.flatnonzero(is_beyond)).size:
            cause = f"time outside of {least} … {least + LATEST} s"
            self._lose_rows(rows, cause, LEFT_OUT, lost, f"{time[lost[0]]:g} s")
        is_read &= ~is_beyond
        second = np.floor(time[is_read])  # a product with all nanoseconds would be rounded twice
        nanosecond = np.rint((time[is_read] - second) * SECOND)
        return second.astype(np.int64) * SECOND + nanosecond.astype(np.int64) + self.offset

    def _check_times(self, time):
        """Reject times that decrease, or that no stamp can be of in seconds."""
        middle = float(np.median(np.abs(time)))
        steps = np.diff(time, append=time[-1])
        count = int(np.count_nonzero(steps < 0))
        if 2 * count > max(len(steps), MIN_STEPS):
            raise InputError(
                f"'{self._table.path}': times decrease at {count} of {len(time)} rows; expected "
                "increasing ones. Sort the rows by time."
            )
        if not LATEST < middle < np.inf:
            return
        size = max(middle / LATEST, np.median(np.abs(steps)) / MAX_STEP)
        advice = "Subtract the first time from all"
        for unit in ("ns", "us", "ms"):
            if size * UNITS["time"][unit] <= (self._choice.time_scale or 1.0):
                advice = f"If they are in {unit}, set `scale: {{time: {unit}}}` in a column map"
        raise InputError(
            f"'{self._table.path}': times are about {middle:.6g} s; expected at most {LATEST} s. "
            f"{advice}."
        )

    # --- Losses ---

    def _lose(self, cause, where, unit="", count=1, example=""):
        """Count a loss of so many units, such as ``rows omitted``; the first is the example."""
        example = f" ({example})" if example else ""
        self._losses.setdefault((cause, unit), [where, example, 0])[2] += count

    def _lose_rows(self, rows, cause, unit, lost, example="", before=""):
        where = f"{self._table.unit} {rows[lost[0]]}"
        self._lose(cause, where, unit, len(lost), before + example)

    def _lose_in_column(self, k, rows):
        before = f"column '{self._table.columns[k].name}': "
        return partial(self._lose_rows, rows, before=before)


def _ignore(*_args, **_options):
    """Count no loss."""


def _read_names(array):
    """Return the texts of a column, (n,) of str; empty for null."""
    encoded = array.dictionary_encode()
    texts = np.array([*encoded.dictionary.to_pylist(), ""], object)
    return texts[encoded.indices.fill_null(len(texts) - 1).to_numpy(zero_copy_only=False)]


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
