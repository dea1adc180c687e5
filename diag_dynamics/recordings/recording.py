"""A recording as columns of numbers: ``read_recording`` and ``stream_recording``."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.parameters.robots import model_of, require_single_joints
from diag_dynamics.recordings.intake import Intake, States
from diag_dynamics.recordings.sources import source_of

SIZE = 20_000
"""States of a piece: more are no faster, and take more memory than the processor's cache has."""


class Finding(NamedTuple):
    """Something about a recording that a reader of its numbers should know."""

    cause: str
    """A short key, such as ``rejected: late`` or ``unread``."""
    count: int
    """How often."""
    text: str
    """What, and where it was first."""

    def __str__(self) -> str:
        return f"{self.cause} ({self.count} ×): {self.text}" if self.count > 1 else f"{self.cause}: {self.text}"


class Recording:
    """States of a robot over time, as the monitor would have taken them in.

    Attributes
    ----------
    model : RobotModel
    stamp : ndarray of int64, shape (T,)
        Stamps of the states [ns]; of a table, later than the times in it by a whole number of seconds.
    t : ndarray, shape (T,)
        Times of the states as they are in the recording [s].
    q : ndarray, shape (T, nq)
        Positions [rad, m].
    qd : ndarray, shape (T, nv)
        Rates [rad/s, m/s].
    tau : ndarray, shape (T, nv), or None
        Efforts with gravity in them [N m, N]: rows of NaN in states without; None without any.
    states : States
        All of the above, and more.
    offset : int
        By how much stamps are later than times in the recording [ns].
    counts : dict
        How many messages there were, and what became of them, by the monitor's names.
    findings : list of Finding
        What could not be read, and what was not believed.
    """

    def __init__(
        self, model: RobotModel, states: States, offset: int, counts: Mapping[str, int], findings: list[Finding]
    ) -> None:
        self.model, self.states, self.offset = model, states, offset
        self.stamp: Array = states.newest
        self.t: Array = (states.newest - offset) * 1e-9
        self.q: Array = states.position
        self.qd: Array = states.velocity
        self.tau: Array | None = states.effort if states.with_effort.any() else None
        self.counts, self.findings = dict(counts), findings

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
    path: str | os.PathLike[str],
    model: RobotModel | str | os.PathLike[str] | None = None,
    columns: Any = None,
    *,
    topic: str | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> Recording:
    """Read a recording, whole: see :func:`stream_recording` for one that is too large for that.

    Parameters
    ----------
    path : str or Path
        A rosbag2 folder, ``.mcap``, ``.db3``, a ROS 1 ``.bag``, or a table: CSV, TSV, Parquet, npz.
    model : RobotModel, str or Path, optional
        The robot, or its URDF; without it, ``robot_description`` of the bag.
    columns : str, Path or dict, optional
        Map of the columns of a table; without it they are guessed from its header, see docs/recordings.md.
    topic : str, optional
        That of the joint states, where a bag has several of them.
    parameters : mapping, optional
        Parameters of the monitor, by name, that are to have other values than there by default.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        There is no such file, no robot, or no joint state in it, or a format that is not known. Damage raises nothing: it is
        among the findings.
    DiagDynamicsError
        The robot's description is refused.
    """
    pieces = list(stream_recording(path, model, columns, topic=topic, parameters=parameters))
    last = pieces[-1]
    whole = States.together([piece.states for piece in pieces])
    return Recording(last.model, whole, last.offset, last.counts, last.findings)


def stream_recording(
    path: str | os.PathLike[str],
    model: RobotModel | str | os.PathLike[str] | None = None,
    columns: Any = None,
    *,
    topic: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    size: int = SIZE,
) -> Iterator[Recording]:
    """Read a recording piece by piece, in bounded memory.

    Parameters
    ----------
    path, model, columns, topic, parameters
        As of :func:`read_recording`.
    size : int
        States of a piece, about.

    Yields
    ------
    Recording
        Of one piece; `counts` and `findings` are those of all that came until then. The last one may be empty.
    """
    yield from Reading(path, model, columns, topic=topic, parameters=parameters).pieces(size)


class Reading:
    """A recording that is being read.

    Attributes
    ----------
    model : RobotModel
    settings : Settings
        Of the monitor that would have taken it in.
    """

    def __init__(self, path, model=None, columns=None, *, topic=None, parameters=None):
        unknown = set(parameters or {}) - set(PARAMETERS)
        if unknown:
            raise InputError(f"the monitor has no parameter '{min(unknown)}'.")
        defaults = {name: spec.default for name, spec in PARAMETERS.items()}
        self.settings = Settings.of(defaults | dict(parameters or {}))
        self._source = source_of(path, columns, topic)
        if isinstance(model, RobotModel):
            require_single_joints(model)
            self.model = model
        else:
            description = self._source.description() if model is None else os.fspath(model)
            self.model = model_of(description, self.settings.values)
        self.intake = Intake(self.model, self.settings)

    @property
    def offset(self):
        """By how much stamps are later than times in the recording [ns]; known when there is a piece."""
        return self._source.offset

    def pieces(self, size=SIZE):
        """See :func:`stream_recording`."""
        held, count = [], 0
        for messages, kinds in self._source.pieces(self.model):
            held.append(self.intake.take(messages, kinds))
            count += held[-1].number
            if count >= size:
                yield self._recording(States.together(held))
                held, count = [], 0
        yield self._recording(States.together(held) if held else States.none(self.model))

    def _recording(self, states):
        return Recording(self.model, states, self._source.offset, self.intake.counts, self.findings())

    def findings(self):
        """What is known of the recording by now."""
        counts, first = self.intake.counts, {}
        for rejection in self.intake.rejections:
            first.setdefault(rejection.cause, rejection.text)
        found = [Finding("unread", 1, f"{one.file}, {one.where}: {one.what}") for one in self._source.unread]
        found += [Finding("note", 1, note) for note in self._source.notes]
        found += [Finding(cause, counts[cause], text) for cause, text in first.items()]
        for cause, text in (
            ("lost by gaps in stamps", "states that never came, by the gaps in the stamps"),
            ("positions jumped", self.intake.assembler.jumps.last),
            ("mimic disagreement", self.intake.assembler.last_disagreement),
            ("absurd effort", "efforts beyond what can be, taken as unknown"),
            ("incomplete", "messages before all joints were known"),
            ("before odometry", "joint states before the base was known"),
            ("foreign", "messages without a joint of this robot"),
            ("time jumped back", "stamps went back, and all joints were forgotten"),
            ("awaiting velocity", "states before a velocity could be estimated"),
        ):
            if counts[cause]:
                found.append(Finding(cause, counts[cause], text))
        return found + [Finding("frozen values", number, text) for text, number in self.intake.frozen_texts.items()]
