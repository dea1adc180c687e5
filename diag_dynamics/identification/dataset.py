# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording in memory, ready to be fitted: its usable states, in segments without gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from diag_dynamics.checks import instance
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.data_checks import (
    UNSCALED,
    EffortRange,
    EffortRelation,
    describe_unknown,
    end_links,
    find_fault,
)
from diag_dynamics.recordings.findings import (
    Finding,
    explain_missing_efforts,
    no_states_error,
    require_plausible,
)
from diag_dynamics.recordings.recording import SIZE, Recording
from diag_dynamics.recordings.states import States
from diag_dynamics.recordings.velocities import find_delay, interpolated

MAX_VALUES = 25_000_000  # positions, velocities and efforts of all recordings: 200 MB
MIN_GAP, GAP = 0.05, 10.0  # the larger of this time [s] and so many median intervals is a gap
MIN_STATES = 10  # shorter segments are left out
MAX_IMPLAUSIBLE = 0.5  # fraction of states with implausible efforts

DOUBTFUL = "effort doubtful"  # cause of findings


class Segment(NamedTuple):
    """Times from the first state on [s], and states without gaps."""

    t: np.ndarray
    states: States

    @property
    def columns(self):
        """Times, positions, velocities and efforts."""
        return self.t, self.states.position, self.states.velocity, self.states.effort

    @property
    def duration(self):
        """Time from the first to the last state [s]."""
        return self.t[-1] - self.t[0]

    def part(self, rows):
        """Return the segment of consecutive rows, bool.

        Its first state alone is marked as a jump.
        """
        states = replace(self.states, jumped=np.cumsum(rows) == 1)
        return Segment(self.t[rows], states[rows])


def portions(segments):
    """Yield parts of segments, of about SIZE states."""
    for t, states in segments:
        edges = [0, *range(SIZE, len(t) - SIZE // 2 + 1, SIZE), len(t)]
        for part in pairwise(edges):
            yield Segment(t[slice(*part)], states[slice(*part)])


def list_recordings(name, recordings):
    """Return recordings as a list of Recording and of functions that return pieces of one."""
    listed = list(recordings) if isinstance(recordings, Sequence) else [recordings]
    if not listed or not all(
        callable(recording) or isinstance(recording, Recording) for recording in listed
    ):
        raise InputError(
            f"{name} is {recordings!r}; expected recordings, or functions that return the pieces "
            "of a recording such as lambda: dd.stream_recording(path, model)."
        )
    return listed


class Dataset:
    """Segments of a recording that can be fitted.

    Velocities are at the time of the positions: `delay` [s] was removed. `known` are the joints
    with efforts (bool); those of the others are the model's. Errors begin with `name`, the path if
    there is one. `origin` has path, robot, number of all states, and times of the first and the
    last one [s]. Raises InputError if the recording is of another robot, too long, lacks states or
    efforts, or has velocities in another unit. Efforts that are not `in_torque` may be of any size.
    """

    def __init__(self, name, recording, model, max_values=MAX_VALUES, in_torque=True):
        self.delay = 0.0
        self.findings = []
        self.name = name
        self.known = np.ones(model.nv, bool)
        self._max_implausible = MAX_IMPLAUSIBLE if in_torque else 1.0
        try:
            self._prepare(recording, model, max_values)
        except InputError as error:
            text = str(error)
            named = text.startswith((self.name, "'"))  # readers quote the path
            raise InputError(text if named else f"{self.name}: {text}") from error

    def _prepare(self, recording, model, max_values):
        """Read, check and clean the recording."""
        self.segments = self._clean(self._read(recording, model, max_values))
        self._remove_delay(
            find_delay(model, self.name, [segment.columns[:3] for segment in self.segments])
        )
        if not self.known.all():
            self._fill_efforts(model)

    def relate_efforts(self, model, ends=()):
        """Return the Relation of efforts to model torques, NaN for joints of unknown efforts."""
        compared = EffortRelation(model, ends)
        for part in portions(self.segments):
            compared.add_run(*part.columns)
        relation = compared.fit()
        factor = np.where(self.known, relation.factor, np.nan)
        error = np.where(self.known, relation.error, np.inf)
        return relation._replace(factor=factor, error=error)

    def check_efforts(self, model):
        """Return the Relation of efforts, and add findings; InputError for a clear fault."""
        relation = self.relate_efforts(model, end_links(model))
        fault = find_fault(relation)
        if fault and not fault.light:
            raise InputError(f"{self.name}: {fault.text}.")
        if fault:
            self._add(1, DOUBTFUL, fault.text)
        elif payload := relation.hypotheses.payload():
            self._add(1, "payload", payload)
        if not relation.judged().any():
            self._add(
                1,
                "efforts not judged",
                "no effort clearly follows the motion. Check that efforts are in N m or N and "
                "contain gravity",
            )
        return relation

    def _remove_delay(self, delay):
        """Remove the delay of velocities against positions, if it is longer than a sample."""
        steps = np.concatenate([np.diff(segment.t) for segment in self.segments])
        if abs(delay) <= np.median(steps):
            return
        self.delay = delay
        size = f"{abs(delay) * 1e3:.1f} ms"
        late = "later" if delay > 0.0 else "earlier"
        text = f"velocities are {size} {late} than positions; the delay was removed"
        self._add(1, "velocity delay", text)
        long = [segment for segment in self.segments if segment.duration > abs(delay)]
        if not long:
            raise InputError(f"{self.name} has no segment longer than the velocity delay, {size}.")
        self.segments = [_shifted(segment, delay) for segment in long]

    @property
    def duration(self):
        """Time in segments [s]."""
        return sum(segment.duration for segment in self.segments)

    @property
    def key(self):
        """Order among recordings that does not depend on how they were given."""
        first = self.segments[0].states
        return self.duration, *first.position[0].tolist(), *first.velocity[0].tolist()

    def _read(self, recording, model, max_values):
        """Return the states of a recording.

        InputError if they have more than a number of values.
        """
        limit = max_values // (model.nq + 2 * model.nv)
        pieces = []
        count = 0
        for piece in _pieces(self.name, recording):
            if piece.model.dof_names != model.dof_names:
                raise InputError(
                    f"{self.name} is of robot '{piece.model.name}', whose degrees of freedom are "
                    "not those of the model."
                )
            if piece.path is not None:
                self.name = f"'{piece.path}'"
            pieces.append(piece)
            count += len(piece)
            if count > limit:
                raise InputError(
                    f"{self.name} has more than {limit} states, which all recordings share. Select "
                    "a part by --start and --end, or give fewer recordings."
                )
        findings = pieces[-1].findings if pieces else []  # of all pieces
        require_plausible(findings)
        if not count:
            raise no_states_error(self.name, findings)
        self._counts = pieces[-1].counts
        times = np.concatenate([piece.t for piece in pieces])
        self.origin = {
            "path": pieces[-1].path,
            "robot": model.name,
            "states": count,
            "start": float(times[0]),
            "end": float(times[-1]),
        }
        states = States.concatenate([piece.states for piece in pieces])
        unknown = np.isnan(states.effort).sum(axis=0)
        if np.all(unknown == count):
            raise self._no_efforts()
        efforts = EffortRange(model)
        efforts.add_values(states.position, states.effort)
        if efforts.unmeasured() and not efforts.measures:
            raise InputError(f"{self.name}: {efforts.unmeasured()}. Record efforts.")
        self._lacking = np.array(model.dof_names)[2 * unknown > count].tolist()
        for word, joints in efforts.groups().items():
            self._set_unknown(model, joints, word)
        self._add(
            states.velocity_estimated.sum(),
            "velocity estimated",
            "velocities were estimated from positions. Record the velocities of the driver if it "
            "sends any",
        )
        return states

    def _clean(self, states):
        """Return segments of usable states, and add findings on the others."""
        efforts = states.effort[:, self.known]
        finite = np.isfinite(np.hstack([states.position, states.velocity, efforts])).all(axis=1)
        implausible = self._counts.get("implausible effort", 0)
        if not finite.any() or implausible > self._max_implausible * len(states):
            raise self._no_efforts(self._lacking)
        rows = np.flatnonzero(finite)
        again = np.diff(states.stamp[rows], prepend=-1) == 0
        rows = rows[~again]
        segments, restarts = _cut(states[rows], _any_since(np.flatnonzero(states.jumped), rows))
        left = len(rows) - sum(len(segment.t) for segment in segments)
        if not segments:
            raise InputError(
                f"the recording has no run of {MIN_STATES} states without a gap; usable states: "
                f"{len(rows)}."
            )
        self._add(
            sum(~finite),
            "incomplete state",
            "states without position, velocity or effort of some joint were omitted",
        )
        self._add(
            sum(again),
            "repeated time stamp",
            "states with the time stamp of the previous state were omitted",
        )
        self._add(
            restarts,
            "restart of time stamps",
            "stamps jumped back; the data after it are used, too",
        )
        self._add(left, "scattered", f"states in runs of fewer than {MIN_STATES} were omitted")
        return segments

    def _no_efforts(self, joints=()):
        """Return the InputError about a recording without efforts, or without those of joints."""
        text = explain_missing_efforts(self._counts, joints)
        return InputError(f"{text}. Identification requires them.")

    def scale_efforts(self, model, gains):
        """Multiply efforts by gains; those of joints without a gain (NaN) become unknown."""
        joints = [model.dof_names[k] for k in np.flatnonzero(np.isnan(gains) & self.known)]
        self._set_unknown(model, joints, UNSCALED)
        scale = np.where(np.isnan(gains), 1.0, gains)
        self.segments = [
            Segment(t, replace(states, effort=states.effort * scale)) for t, states in self.segments
        ]
        self._fill_efforts(model)

    def _set_unknown(self, model, joints, word):
        """Leave the efforts of joints out; InputError if none is left."""
        if not joints:
            return
        self.known &= ~np.isin(model.dof_names, joints)
        self._add(
            1, "effort unknown", f"{describe_unknown(word, joints)}: nothing is fitted to them"
        )
        if not self.known.any():
            texts = "; ".join(
                finding.text for finding in self.findings if finding.cause == "effort unknown"
            )
            raise InputError(f"{self.name} has no efforts: {texts}. Record efforts.")

    def _fill_efforts(self, model):
        """Replace efforts of joints whose effort is unknown by the model's."""
        dynamics = DiagonalDynamics(model)
        for k, segment in enumerate(self.segments):
            t, q, qd, tau = segment.columns
            effort = dynamics.inverse_dynamics(q, qd, np.gradient(qd, t, axis=0))
            effort = np.where(self.known, tau, effort)
            self.segments[k] = Segment(t, replace(segment.states, effort=effort))

    def _add(self, count, cause, text):
        """Add a finding if there is any."""
        if count:
            self.findings.append(Finding(cause, int(count), text))


def _pieces(name, recording):
    pieces = recording if isinstance(recording, Recording) else recording()
    for piece in [pieces] if isinstance(pieces, Recording) else pieces:
        yield instance(f"a piece of {name}", piece, Recording)


def _any_since(rows, numbers):
    """Return for each kept row whether any of the rows is in the steps since the one before."""
    return np.diff(np.searchsorted(rows, numbers, side="right"), prepend=0) > 0


def _cut(states, jumped):
    """Return segments of states between gaps, jumps and restarts, and the number of restarts.

    Short segments are omitted.
    """
    steps = np.diff(states.stamp, prepend=states.stamp[:1])
    gap = max(MIN_GAP, GAP * float(np.median(steps[1:])) * 1e-9) if len(steps) > 1 else MIN_GAP
    restarts = steps < 0
    begins = (steps * 1e-9 > gap) | jumped | restarts
    parts = np.split(np.arange(len(steps)), np.flatnonzero(begins[1:]) + 1)
    return [_run(states[rows]) for rows in parts if len(rows) >= MIN_STATES], restarts.sum()


def _run(states):
    """Return a segment whose first state alone is marked as a jump, and whose efforts are used."""
    first = np.arange(len(states)) == 0
    has_efforts = np.ones(len(states), bool)
    t = (states.stamp - states.stamp[0]) * 1e-9
    return Segment(t, replace(states, jumped=first, effort_known=has_efforts))


def _shifted(segment, delay):
    """Return a segment with velocities of the time of its positions.

    Its first state alone is marked as a jump.
    """
    t, states = segment
    at = t + delay
    velocity = interpolated(states.velocity, t, at)
    # Ends have no values.
    return Segment(t, replace(states, velocity=velocity)).part((at >= t[0]) & (at <= t[-1]))
