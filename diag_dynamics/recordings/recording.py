# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording as columns of numbers: ``read_recording`` and ``stream_recording``."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.entries import ALL, assignments
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model import RobotModel
from diag_dynamics.parameters.contact_limits import contact_points
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.parameters.robot_models import model_of, require_as_made, require_single_joints
from diag_dynamics.recordings.findings import (
    NOTE,
    Finding,
    collect_findings,
    no_states_error,
)
from diag_dynamics.recordings.intake import Intake
from diag_dynamics.recordings.joint_names import JointNames
from diag_dynamics.recordings.sources import open_source, path_text
from diag_dynamics.recordings.states import States

SIZE = 20_000
"""States of a piece: more are no faster, and take more memory than the processor's cache has."""

MAX_SPAN = 1e9  # duration that no recording has [s]


class Recording:
    """States of a robot over time, as the monitor would have evaluated them.

    Attributes
    ----------
    model : RobotModel
    stamp : ndarray of int64, shape (T,)
        Stamps of the states [ns]; of a table, later than the times in it by a whole number of
        seconds.
    t : ndarray, shape (T,)
        Times of the states in the recording [s].
    q : ndarray, shape (T, nq)
        Positions [rad, m].
    qd : ndarray, shape (T, nv)
        Rates [rad/s, m/s].
    tau : ndarray, shape (T, nv), or None
        Efforts with gravity in them [N m, N]; NaN where they are unknown, None if no state has any.
    states : States
        These columns with log times, oldest stamps and flags.
    offset : int
        Delay of stamps from times in the recording [ns].
    counts : dict
        Number of messages, and of what became of them, by the monitor's names.
    findings : list of Finding
        Unreadable data, rejected messages, and notes.
    path : str or None
        File or folder.
    """

    def __init__(
        self,
        model: RobotModel,
        states: States,
        offset: int,
        counts: Mapping[str, int],
        findings: list[Finding],
        path: str | None = None,
    ) -> None:
        self.model = model
        self.states = states
        self.offset = offset
        self.stamp: Array = states.stamp
        self.t: Array = (states.stamp - offset) * 1e-9
        self.q: Array = states.position
        self.qd: Array = states.velocity
        self.tau: Array | None = states.effort if np.isfinite(states.effort).any() else None
        self.counts = dict(counts)
        self.findings = findings
        self.path = path

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        span = f"{self.t[-1] - self.t[0]:.6g} s" if len(self) else "no time"
        efforts = "with" if self.tau is not None else "without"
        return (
            f"<Recording of '{self.model.name}': {len(self)} states in {span}, {efforts} efforts, "
            f"{len(self.findings)} findings>"
        )


def read_recording(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    model: RobotModel | str | os.PathLike[str] | None = None,
    columns: Any = None,
    *,
    topic: str | Sequence[str] | None = None,
    joint_names: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    start: float | None = None,
    end: float | None = None,
) -> Recording:
    """Read a whole recording; :func:`stream_recording` reads one that is too large for that.

    Parameters
    ----------
    path : str, Path or list of these
        A rosbag2 folder, ``.mcap``, ``.db3``, a ROS 1 ``.bag``, an episode of a LeRobot dataset
        (``FOLDER#3``), or a table: CSV, TSV, Parquet, npz. Several tables are read side by side as
        one, also as ``q.csv+qd.csv+tau.csv``.
    model : RobotModel, str or Path, optional
        The robot, or its URDF; without it, ``robot_description`` of the bag.
    columns : str, Path or dict, optional
        Map of the columns of a table; without it their names decide, see docs/recordings.md.
    topic : str or sequence of str, optional
        Topics of the joint states, where a bag has several. Those of an arm and its gripper are
        merged in the order of log time, as messages of one topic are.
    joint_names : mapping of str to str, optional
        The robot's name of a joint by that of the recording. ``*`` stands for any text: ``{"fer_*":
        "panda_*"}``. Two names of the recording for one joint are an error. Without it, the
        parameter `joint_names` counts.
    parameters : mapping, optional
        Values of the monitor's parameters other than the defaults, by name. Those that shape a
        model, such as `armature` and `parameters_file`, need a description: a :class:`RobotModel`
        is made already.
    start, end : float, optional
        Part that is read, in seconds after the first message, by log times. The first states are
        those from which all joints have come.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        There is no such file, no robot, or no joint state in it, or a format that is not known.
        Damage raises nothing: it is among the findings.
    DiagDynamicsError
        The robot's description is refused.
    """
    stream = stream_recording(
        path,
        model,
        columns,
        topic=topic,
        joint_names=joint_names,
        parameters=parameters,
        start=start,
        end=end,
    )
    pieces = list(stream)
    whole = States.concatenate([piece.states for piece in pieces])
    last = pieces[-1]
    return Recording(last.model, whole, last.offset, last.counts, last.findings, last.path)


def stream_recording(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    model: RobotModel | str | os.PathLike[str] | None = None,
    columns: Any = None,
    *,
    topic: str | Sequence[str] | None = None,
    joint_names: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    start: float | None = None,
    end: float | None = None,
    size: int = SIZE,
) -> Iterator[Recording]:
    """Read a recording piece by piece, in bounded memory.

    Parameters
    ----------
    path, model, columns, topic, joint_names, parameters, start, end
        As of :func:`read_recording`.
    size : int
        Number of states in a piece, about.

    Yields
    ------
    Recording
        One piece; `counts` and `findings` are those of the recording up to its end. The last one
        may be empty.

    Raises
    ------
    InputError, DiagDynamicsError
        As of :func:`read_recording`.
    """
    reading = Reading(
        path,
        model,
        columns,
        topic=topic,
        joint_names=joint_names,
        parameters=parameters,
        start=start,
        end=end,
    )
    if isinstance(model, RobotModel):
        require_as_made(reading.settings.values)
    yield from reading.pieces(size)


class Reading:
    """A recording being read.

    `described` is the robot's description or path, None for a RobotModel.
    """

    def __init__(
        self,
        path,
        model=None,
        columns=None,
        *,
        topic=None,
        joint_names=None,
        parameters=None,
        start=None,
        end=None,
    ):
        self.settings = make_settings(parameters)
        self._span = _check_span(start, end)
        names = JointNames(
            joint_names or assignments("joint_names", self.settings.values["joint_names"], str)
        )
        locked = self.settings.values["locked_joints"]
        self._locks_rest = any(entry.startswith(ALL) for entry in locked)
        self._source = open_source(path, columns, topic, names)
        self.path = path_text(path)
        if isinstance(model, RobotModel):
            require_single_joints(model)
            self.model = model
            self.described = None
        else:
            self.described = self._source.description() if model is None else os.fspath(model)
            self.model = model_of(self.described, self.settings.values, self._source.joints)
        self.intake = Intake(self.model, self.settings, names)

    @cached_property
    def contact_points(self):
        """ContactPoints by the parameters, and causes by links without points.

        It raises InputError and UrdfError.
        """
        if self.described is None:
            raise InputError(
                "contact_limits.file requires the path or text of a URDF; the robot is a "
                "RobotModel."
            )
        return contact_points(self.model, self.described, self.settings.contact_limits)

    @property
    def offset(self):
        """Delay of stamps from times in the recording [ns]; known when there is a piece."""
        return self._source.offset

    @property
    def counts(self):
        """Number of messages, and of what became of them, by the monitor's names."""
        return self.intake.counts

    def time(self, stamp):
        """Return the time of a stamp [ns] in the recording [s], None for None."""
        return None if stamp is None else float((stamp - self.offset) * 1e-9)

    def no_states_error(self):
        """Return the InputError about a recording without a valid state."""
        if self._span != (-inf, inf) and not self.counts["received"]:
            return InputError(f"'{self.path}' contains no message between start and end.")
        return no_states_error(self.path, self.findings())

    def findings(self):
        """Return a list of Finding on the messages so far."""
        findings = collect_findings(self.counts, self.intake, self._source)
        locked = self.model.locked_joints
        if locked and self._locks_rest:
            entries = ", ".join(f"{name}={position:g}" for name, position in locked.items())
            text = f"joints that the recording lacks are locked: {entries}."
            findings.append(Finding(NOTE, 1, text))
        return findings

    def pieces(self, size=SIZE):
        """Yield pieces, see :func:`stream_recording`."""
        parts = []
        count = 0
        start = self._source.start
        for batch in self._source.batches(self.model, *self._limits_after(start)):
            if start is None and len(batch.log_time):
                start = int(batch.log_time[0])  # of a table
            begin, end = self._limits_after(start)
            is_within = (batch.log_time >= begin) & (batch.log_time < end)
            parts.append(self.intake.read(batch.select(is_within)))
            count += len(parts[-1])
            if count >= size:
                yield self._recording(parts)
                parts = []
                count = 0
        yield self._recording(parts or [States.empty(self.model.nq, self.model.nv)])

    def _limits_after(self, first):
        """Return the log times between which messages are read, from the first one [ns]."""
        return tuple((first or 0) + after for after in self._span)

    def _recording(self, parts):
        states = States.concatenate(parts)
        offset = self._source.offset
        return Recording(self.model, states, offset, self.counts, self.findings(), self.path)


def make_settings(parameters):
    """Return the monitor's Settings with these parameters, or None, other than by default."""
    parameters = parameters or {}
    if unknown := set(parameters) - set(PARAMETERS):
        raise InputError(f"the monitor has no parameter '{min(unknown)}'.")
    return Settings.of({name: spec.default for name, spec in PARAMETERS.items()} | parameters)


def _check_span(start, end):
    """Return start and end [s] in nanoseconds, -inf and inf for None."""
    begin = start or 0.0
    last = inf if end is None else end
    if not 0.0 <= begin < min(last, MAX_SPAN):
        raise InputError(
            f"start is {start!r} s and end is {end!r} s; expected seconds after the beginning of "
            "the recording, start from 0 and end after it."
        )
    first = -inf if start is None else round(begin * SECOND)
    return first, round(last * SECOND) if last < MAX_SPAN else inf
