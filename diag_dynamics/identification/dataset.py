# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording in memory, ready to be fitted: its usable states, in segments without gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.checks import instance
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.data_checks import find_delay
from diag_dynamics.recordings.effort_checks import EffortRange
from diag_dynamics.recordings.findings import Finding, without_efforts, without_states
from diag_dynamics.recordings.recording import Recording
from diag_dynamics.recordings.refused_units import refuse_units
from diag_dynamics.recordings.states import States

MAX_VALUES = 25_000_000  # positions, velocities and efforts of all recordings: 200 MB
SIZE = 20_000  # states over which dynamics are evaluated at once
MIN_GAP, GAP = 0.05, 10.0  # the larger of this time [s] and so many median intervals is a gap
MAX_VELOCITY, MAX_GARBAGE = 1.5, 0.01  # multiple of the URDF's limit; larger fraction: another unit
MIN_STATES = 10  # shorter segments are left out
FINDINGS = (
    ("not whole", "states without position, velocity or effort of all joints, left out"),
    ("time did not go on", "states with a stamp that is not after all before, left out"),
    ("too fast", f"states with a velocity above {MAX_VELOCITY} times the URDF's limit, left out"),
    ("time began anew", "stamps went back and on from there; what follows is fitted, too"),
    ("scattered", f"states in runs of fewer than {MIN_STATES}, left out"),
)


class Segment(NamedTuple):
    """Times [s], which rise even where stamps start again, and states without gaps."""

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


def list_recordings(name, recordings):
    """Return recordings as a list of Recording and of functions that return pieces of one."""
    found = list(recordings) if isinstance(recordings, Sequence) else [recordings]
    for k, one in enumerate(found):
        if not callable(one) and not isinstance(one, Recording):
            raise InputError(
                f"{name}[{k}] is {one!r}; expected a Recording, or a function that returns the "
                "pieces of one. Give lambda: dd.stream_recording(path, model)."
            )
    if not found:
        raise InputError(f"{name} is empty, expected one recording or more.")
    return found


class Dataset:
    """Segments of a recording that can be fitted. A long recording is thinned while it is read.

    Velocities are at the time of the positions: `delay` [s] was removed. `spans` are the times of the
    segments that have such velocities [s], which begin and end between states. `start` and `end` are
    times of all `count` states [s], `zero` is the stamp of the first one [ns]. Raises InputError
    if the recording is of another robot, lacks states or efforts, or has velocities in another unit.
    """

    def __init__(self, name, recording, model, max_values=MAX_VALUES):
        self.path, self.robot, self.count = None, model.name, 0
        self.start, self.end, self.zero, self.delay, self.findings = 0.0, 0.0, 0, 0.0, []
        self.segments = self._clean(self._read(name, recording, model, max_values), model)
        delay = find_delay(model, self.segments)
        if abs(delay) > np.median(np.concatenate([np.diff(one.t) for one in self.segments])):
            self.delay = delay
            self.segments = [one for one in self.segments if one.duration > abs(delay)]
            size, late = f"{abs(delay) * 1e3:.1f} ms", "late" if delay > 0.0 else "early"
            text = f"velocities are {size} {late} against positions, which was taken out"
            self.findings.append(Finding("velocity delay", 1, text))
        if not self.segments:
            raise InputError(f"{name} has no segment longer than the velocities' delay, {size}.")
        head, tail = max(0.0, -self.delay), max(0.0, self.delay)
        self.spans = [(t[0] + head, t[-1] - tail) for t, _ in self.segments]
        if self.delay:
            self.segments = [_shifted(one, delay) for one in self.segments]

    @property
    def duration(self):
        """Time in spans [s]."""
        return sum(end - begin for begin, end in self.spans)

    def portions(self, begin=-np.inf):
        """Yield parts of segments, of about SIZE states, from a time on [s]."""
        for t, states in self.segments:
            first = int(np.searchsorted(t, begin))
            edges = [first, *range(first + SIZE, len(t) - SIZE // 2 + 1, SIZE), len(t)]
            for part in pairwise(edges):
                if first < len(t):
                    yield Segment(t[slice(*part)], states[slice(*part)])

    def _read(self, name, recording, model, max_values):
        """Return the states of a recording, thinned to a number of values."""
        limit, step, parts, jumps = max_values // (model.nq + 2 * model.nv), 1, [], []
        counts, refused, with_efforts, estimated = {}, [], False, 0
        efforts = EffortRange(model.dof_names)
        for piece in _pieces(name, recording):
            if piece.model.dof_names != model.dof_names:
                raise InputError(
                    f"{name} is of robot '{piece.model.name}', whose degrees of freedom are not those of the model."
                )
            states, counts, refused = piece.states, piece.counts, piece.findings
            if len(piece) and not self.count:
                self.path, self.robot = piece.path, piece.model.name
                self.start, self.zero = float(piece.t[0]), int(piece.stamp[0])
            self.end = float(piece.t[-1]) if len(piece) else self.end
            with_efforts = with_efforts or piece.tau is not None
            estimated += int(states.velocity_estimated.sum())
            efforts.add_values(states.position, states.effort)
            jumps.append(self.count + np.flatnonzero(states.jumped))
            parts.append(states[-(self.count + 1) % step :: step])  # rows step − 1, 2 step − 1, …
            self.count += len(states)
            while sum(map(len, parts)) > limit:
                parts, step = [States.concatenate(parts)[1::2]], 2 * step
        refuse_units(refused)
        if not self.count:
            raise without_states(name, refused)
        if efforts.unmeasured():
            raise InputError(
                f"{efforts.unmeasured()}. Record the efforts of these joints, or lock the joints (locked_joints)."
            )
        if not with_efforts:
            raise InputError(f"{without_efforts(counts)}, without which nothing can be identified.")
        if step > 1:
            text = f"every {step}th of {self.count} states is used, as the recording is long"
            self.findings.append(Finding("thinned", 1, text))
        if estimated:
            text = "velocities were estimated from positions: those of the driver would be better"
            self.findings.append(Finding("velocity estimated", estimated, text))
        jumped = _any_since(np.concatenate(jumps), np.arange(step - 1, self.count, step))
        return replace(States.concatenate(parts), jumped=jumped)

    def _clean(self, states, model):
        """Return segments of usable states, and add findings on the others."""
        columns = states.position, states.velocity, states.effort
        finite = np.logical_and.reduce([np.isfinite(column).all(axis=1) for column in columns])
        if not finite.any():
            raise InputError("no state of the recording is whole: positions, velocities and efforts of all joints.")
        restarts = find_restarts(states.stamp)
        forward = _forward(states.stamp, finite, restarts)
        limit = np.where(model.velocity_limit > 0.0, model.velocity_limit, np.inf)  # 0: none
        with np.errstate(invalid="ignore"):
            beyond = np.abs(states.velocity) > MAX_VELOCITY * limit
        _refuse_fast(model, states.velocity[forward], beyond[forward])
        fast = beyond.any(axis=1)
        kept = np.flatnonzero(forward & ~fast)
        restarted, jumped = (_any_since(rows, kept) for rows in (restarts, np.flatnonzero(states.jumped)))
        restarted[:1] = False
        segments = _cut(states[kept], jumped, restarted)
        used = sum(len(one.t) for one in segments)
        if not segments:
            raise InputError(f"the recording has no {MIN_STATES} states without a gap among {len(kept)} usable ones.")
        counts = [~finite, finite & ~forward, forward & fast, restarted, np.ones(len(kept) - used)]
        pairs = zip(FINDINGS, (int(one.sum()) for one in counts), strict=True)
        self.findings[:0] = [Finding(cause, count, text) for (cause, text), count in pairs if count]
        return segments


def _pieces(name, recording):
    pieces = recording if isinstance(recording, Recording) else recording()
    for piece in [pieces] if isinstance(pieces, Recording) else pieces:
        yield instance(f"a piece of {name}", piece, Recording)


def _any_since(rows, kept):
    """Return for each kept row whether any of the rows is it, or is between it and the one before."""
    return np.diff(np.searchsorted(rows, kept, side="right"), prepend=0) > 0


def find_restarts(stamps):
    """Return the rows from which stamps rise again without reaching the latest one before."""
    found, latest, before = [], np.iinfo(np.int64).min, 0
    for k in (np.flatnonzero(np.diff(stamps) < 0) + 1).tolist():
        latest, before = max(latest, stamps[before:k].max()), k
        ahead = stamps[k : k + MIN_STATES]
        if len(ahead) == MIN_STATES and (np.diff(ahead) >= 0).all() and ahead[-1] < latest:
            found.append(k)
            latest = stamps[k]
    return found


def _forward(stamps, finite, restarts):
    """Return which rows are finite, and later than all finite ones since the last restart."""
    forward, never = np.zeros(len(stamps), dtype=bool), np.iinfo(np.int64).min
    for run in np.split(np.arange(len(stamps)), restarts):
        latest = np.maximum.accumulate(np.r_[never, np.where(finite[run], stamps[run], never)])
        forward[run] = finite[run] & (stamps[run] > latest[:-1])
    return forward


def _refuse_fast(model, velocity, beyond):
    """Refuse velocities of which many are beyond what a joint can do: they have another unit."""
    share = beyond.mean(axis=0) if len(beyond) else np.zeros(model.nv)
    k = int(np.argmax(share))
    if share[k] > MAX_GARBAGE:
        raise InputError(
            f"velocities of joint '{model.dof_names[k]}' reach {np.abs(velocity[:, k]).max():.3g}, and {share[k]:.0%} "
            f"of them are above {MAX_VELOCITY} times the URDF's limit, {model.velocity_limit[k]:.3g} rad/s or m/s: are "
            "they in degrees, or of the motor?"
        )


def _cut(states, jumped, restarted):
    """Return the segments of states between gaps, jumps and restarts, without short ones."""
    steps = np.diff(states.stamp, prepend=states.stamp[:1])
    gap = max(MIN_GAP, GAP * float(np.median(steps[1:])) * 1e-9) if len(steps) > 1 else MIN_GAP
    later = np.cumsum(np.where(restarted, round(2.0 * gap * SECOND) - steps, 0))
    t = (states.stamp - states.stamp[:1] + later) * 1e-9
    begins = (steps * 1e-9 > gap) | jumped | restarted
    ends = [0, *(np.flatnonzero(begins[1:]) + 1), len(t)]
    rows = [slice(*pair) for pair in pairwise(ends) if pair[1] - pair[0] >= MIN_STATES]
    return [_segment(t[some], states[some]) for some in rows]


def _segment(t, states):
    """Return a segment, whose first state alone is marked as a jump."""
    return Segment(t, replace(states, jumped=np.arange(len(t)) == 0, effort_known=np.ones(len(t), dtype=bool)))


def _shifted(segment, delay):
    """Return a segment with velocities of the time of its positions; ends without any are cut off."""
    t, states = segment
    at = t + delay
    inside = (at >= t[0]) & (at <= t[-1])
    velocity = np.column_stack([np.interp(at, t, column) for column in states.velocity.T])
    return _segment(t[inside], replace(states, velocity=velocity)[inside])
