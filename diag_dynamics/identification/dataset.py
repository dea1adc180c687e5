# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording in memory, ready to be fitted: its usable states, in segments without gaps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.checks import instance
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.data_checks import find_delay
from diag_dynamics.recordings.account import Finding, without_efforts, without_states
from diag_dynamics.recordings.effort_checks import EffortRange
from diag_dynamics.recordings.recording import Recording
from diag_dynamics.recordings.refused_units import refuse_units
from diag_dynamics.recordings.states import States

MAX_VALUES = 25_000_000  # positions, velocities and efforts of all recordings in memory: 200 MB
SIZE = 20_000  # states of a portion, over which dynamics are evaluated
MIN_GAP, GAP = 0.05, 10.0  # the larger of this time [s] and so many median intervals ends a segment
MAX_VELOCITY, MAX_GARBAGE = 1.5, 0.01  # multiple of the URDF's limit of garbage; larger fraction: another unit
MIN_STATES = 10  # shorter segments are left out


def list_recordings(name, recordings):
    """Return recordings as a list of Recording and of functions that return pieces of one."""
    found = recordings if isinstance(recordings, Iterable) and not isinstance(recordings, Iterator) else [recordings]
    for k, one in enumerate(found := list(found)):
        if not callable(one) and not isinstance(one, Recording):
            raise InputError(
                f"{name}[{k}] is {one!r}; expected a Recording, or a function that returns the pieces of one. Give lambda: "
                "dd.stream_recording(path, model)."
            )
    if not found:
        raise InputError(f"{name} is empty, expected one recording or more.")
    return found


class Dataset:
    """States of a recording that can be fitted. A long recording is thinned while it is read.

    `t` [s] rises even where stamps start again. `segments` are slices of `t` and `states` without gaps.
    Velocities are at the time of the positions: `delay` [s] was removed. `start` and `end` are times of all
    `count` states of the recording [s], `zero` is the stamp of the first one [ns]. Raises InputError if the
    recording is of another robot, lacks states or efforts, or has velocities in another unit.
    """

    def __init__(self, name, recording, model, max_values=MAX_VALUES):
        self.path, self.robot, self.count, self.start, self.end, self.zero = None, model.name, 0, 0.0, 0.0, 0
        self.delay, self.findings = 0.0, []
        self._clean(self._read(name, recording, model, max_values), model)
        found = find_delay(model, self.t, self.states, self.segments)
        sample = np.median(np.concatenate([np.diff(self.t[segment]) for segment in self.segments]))
        if abs(found) > sample:
            self._shift(found)
            late = "late" if found > 0.0 else "early"
            text = f"velocities are {abs(found) * 1e3:.1f} ms {late} against positions, which was taken out"
            self.findings.append(Finding("velocity delay", 1, text))
        if not self.segments:
            delay = f"the delay of its velocities, {found * 1e3:.1f} ms"
            raise InputError(f"{name} has no segment that is longer than {delay}.")

    @property
    def spans(self):
        """Begin and end of each segment [s]."""
        return [(self.t[segment.start], self.t[segment.stop - 1]) for segment in self.segments]

    @property
    def duration(self):
        """Time in segments [s]."""
        return sum(end - begin for begin, end in self.spans)

    def portions(self, begin=-np.inf):
        """Yield slices of about SIZE states without gaps, from a time on [s]."""
        for segment in self.segments:
            first = segment.start + int(np.searchsorted(self.t[segment], begin))
            while 2 * (segment.stop - first) >= 3 * SIZE:
                yield slice(first, first + SIZE)
                first += SIZE
            if first < segment.stop:
                yield slice(first, segment.stop)

    def _read(self, name, recording, model, max_values):
        """Return the states of a recording, thinned to a number of values."""
        limit, parts, rest, step, held = max_values // (model.nq + 2 * model.nv), [], None, 1, 0
        counts, refused, with_efforts, estimated, efforts = {}, [], False, 0, EffortRange(model.dof_names)
        for piece in _pieces(name, recording):
            if piece.model.dof_names != model.dof_names:
                robot = piece.model.name
                raise InputError(f"{name} is of robot '{robot}', whose degrees of freedom are not those of the model.")
            counts, refused, with_efforts = piece.counts, piece.findings, with_efforts or piece.tau is not None
            estimated += int(piece.states.velocity_estimated.sum())
            if len(piece) and not self.count:
                self.path, self.robot = piece.path, piece.model.name
                self.start, self.zero = float(piece.t[0]), int(piece.stamp[0])
            if len(piece):
                self.count, self.end = self.count + len(piece), float(piece.t[-1])
            efforts.add_values(piece.states.position, piece.states.effort)
            whole = States.concatenate([rest, piece.states]) if rest else piece.states
            part, rest = _thinned(whole, step), whole[len(whole) // step * step :]
            parts, held = [*parts, part], held + len(part)
            while held > limit:
                parts = [_thinned(States.concatenate(parts)[held % 2 :], 2)]
                step, held = 2 * step, len(parts[0])
        refuse_units(refused)
        if not self.count:
            raise without_states(name, refused)
        unmeasured = efforts.unmeasured()
        if unmeasured:
            raise InputError(f"{unmeasured}. Record the efforts of these joints, or lock the joints (locked_joints).")
        if not with_efforts:
            raise InputError(f"{without_efforts(counts)}, without which nothing can be identified.")
        if step > 1:
            text = f"every {step}th of {self.count} states is used, as the recording is long"
            self.findings.append(Finding("thinned", 1, text))
        if estimated:
            text = "velocities were estimated from positions: those of the driver would be better"
            self.findings.append(Finding("velocity estimated", estimated, text))
        return States.concatenate(parts) if len(parts) > 1 else parts[0]

    def _clean(self, states, model):
        """Keep usable states, cut into segments."""
        columns = states.position, states.velocity, states.effort
        finite = np.logical_and.reduce([np.isfinite(column).all(axis=1) for column in columns])
        restarts = find_restarts(states.stamp)
        forward = _forward(states.stamp, finite, restarts)
        limit = np.asarray(model.velocity_limit)
        limit = MAX_VELOCITY * np.where(limit > 0.0, limit, np.inf)  # 0 stands for none in many URDFs
        with np.errstate(invalid="ignore"):
            beyond = np.abs(states.velocity) > limit
        fast = beyond.any(axis=1)
        if not finite.any():
            raise InputError("no state of the recording is whole: positions, velocities and efforts of all joints.")
        _refuse_fast(model, states.velocity[forward], beyond[forward])
        kept, restarted = np.flatnonzero(forward & ~fast), np.zeros(len(states), dtype=bool)
        restarted[restarts] = True
        restarted, jumped = _since(restarted, kept), _since(states.jumped, kept)
        restarted[:1] = False
        lost = self._cut(states[kept], jumped, restarted)
        if len(self.t) < MIN_STATES:
            count = len(self.t)
            raise InputError(f"the recording has {count} states to identify from, expected {MIN_STATES} at least.")
        counts = (~finite).sum(), (finite & ~forward).sum(), (forward & fast).sum(), restarted.sum(), lost
        found = zip(counts, FINDINGS, strict=True)
        self.findings[:0] = [Finding(cause, int(count), text) for count, (cause, text) in found if count]

    def _cut(self, states, jumped, restarted):
        """Set times, states and segments; return how many states are in segments that are too short."""
        intervals = np.diff(states.stamp) * 1e-9
        gap = max(MIN_GAP, GAP * float(np.median(intervals))) if len(intervals) else MIN_GAP
        begins = np.r_[True, intervals > gap][: len(states)] | jumped | restarted
        steps = np.diff(states.stamp, prepend=states.stamp[:1])
        later = np.cumsum(np.where(restarted, round(2.0 * gap * SECOND) - steps, 0))
        lengths = np.diff(np.r_[np.flatnonzero(begins), len(states)])
        kept = np.repeat(lengths >= MIN_STATES, lengths)
        self.t = ((states.stamp - (states.stamp[:1] - later)) * 1e-9)[kept]
        self._set_states(states if kept.all() else states[kept], lengths[lengths >= MIN_STATES])
        return int((~kept).sum())

    def _set_states(self, states, lengths):
        ends = np.cumsum(lengths)
        self.segments = [slice(end - length, end) for end, length in zip(ends.tolist(), lengths.tolist(), strict=True)]
        begins = np.zeros(len(states), dtype=bool)
        begins[ends - lengths] = True
        self.states = replace(states, jumped=begins, effort_known=np.ones(len(states), dtype=bool))

    def _shift(self, delay):
        """Shift velocities to the time of the positions; ends of segments without velocities are cut off."""
        velocity, inside, lengths = np.empty_like(self.states.velocity), [], []
        for segment in self.segments:
            t, at = self.t[segment], self.t[segment] + delay
            for k, column in enumerate(self.states.velocity[segment].T):
                velocity[segment, k] = np.interp(at, t, column)
            inside.append((at >= t[0]) & (at <= t[-1]))
            lengths.append(inside[-1].sum() if t[-1] - t[0] > abs(delay) else 0)
            inside[-1] &= lengths[-1] > 0
        inside, lengths = np.concatenate(inside), np.array(lengths)
        self.delay, self.t = delay, self.t[inside]
        self._set_states(replace(self.states, velocity=velocity)[inside], lengths[lengths > 0])


FINDINGS = (
    ("not whole", "states without position, velocity or effort of all joints, left out"),
    ("time did not go on", "states with a stamp that is not after all before, left out"),
    ("too fast", f"states with a velocity above {MAX_VELOCITY} times the URDF's limit, left out"),
    ("time began anew", "stamps went back and on from there, as of a restarted robot: what follows is fitted, too"),
    ("scattered", f"states in runs of fewer than {MIN_STATES}, left out"),
)


def _pieces(name, recording):
    pieces = recording if isinstance(recording, Recording) else recording()
    if isinstance(pieces, Recording):
        pieces = [pieces]
    if not isinstance(pieces, Iterable):
        raise InputError(f"{name} returns {pieces!r}, expected pieces of a recording.")
    for piece in pieces:
        yield instance(f"a piece of {name}", piece, Recording)


def _thinned(states, step):
    """Return the last state of each `step` states; a jump in between counts."""
    if step == 1:
        return states
    count = len(states) // step
    jumped = states.jumped[: count * step].reshape(count, step).any(axis=1)
    return replace(states[step - 1 :: step], jumped=jumped)


def find_restarts(stamps):
    """Return the rows at which stamps start again: they go back, and rise from there without reaching the latest one."""
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
        largest, limit = np.abs(velocity[:, k]).max(), model.velocity_limit[k]
        raise InputError(
            f"velocities of joint '{model.dof_names[k]}' reach {largest:.3g}, and {share[k]:.0%} of them are above "
            f"{MAX_VELOCITY} times the URDF's limit, {limit:.3g} rad/s or m/s: are they in degrees, or of the motor?"
        )


def _since(flags, kept):
    """Return for each kept row whether a flag was set there or since the kept row before."""
    return np.diff(np.cumsum(flags)[kept], prepend=0) > 0
