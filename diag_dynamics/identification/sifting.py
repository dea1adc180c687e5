# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What of a recording can be fitted, and what is left out, piece by piece."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.segments import Portion, Segment
from diag_dynamics.recordings.account import Finding
from diag_dynamics.recordings.states import States

FIRST = 20_000
"""States whose intervals tell what a gap is, and a sample."""

LEAST_GAP, GAPS = 0.05, 10.0
"""Time without states from which a segment begins anew: the longer one of this [s] and so many median intervals."""

TOO_FAST = 1.5
"""Multiple of the URDF's velocity limit above which a row is garbage."""

MOST_GARBAGE = 0.01
"""Part of the rows above which it is no garbage, but a unit."""

SHORTEST = 10
"""States of a segment; fewer are left out."""

NEVER = np.iinfo(np.int64).min
"""Before all stamps [ns]."""


class _Kept(NamedTuple):
    """States that are whole, and later than all before."""

    stamp: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    jumped: np.ndarray
    """Whether positions have jumped since the state before."""
    anew: np.ndarray
    """Whether time has begun anew since then."""

    def part(self, which):
        return _Kept(*(column[which] for column in self))

    @classmethod
    def together(cls, parts):
        return cls(*map(np.concatenate, zip(*parts, strict=True)))


class Sifter:
    """Takes the states of one recording in, and hands out those that can be fitted, as portions of segments.

    Parameters
    ----------
    model : RobotModel

    Attributes
    ----------
    sample : float
        Median interval within segments [s]; known once :data:`FIRST` states were kept, or all were taken in.
    """

    def __init__(self, model):
        self._model, self.sample = model, 0.0
        limit = np.asarray(model.velocity_limit)
        self._limit = TOO_FAST * np.where(limit > 0.0, limit, np.inf)  # 0 stands for none in many URDFs
        self._ahead = States.empty(model.nq, model.nv)  # states that those before them need to be judged
        self._beginnings, self._latest = Beginnings(), NEVER  # of states that are whole, since time began
        self._jumped = self._anew = False  # since the last state that was kept
        self._first, self._gap = [], None  # until it is known
        self._start, self._before, self._put_off = 0, None, 0  # stamps: of time 0, and of the last state that was kept
        self._short, self._number = [], 0  # of the segment: its states while they are too few, and how many there are
        self._whole = self._late = self._broken = self._fast = self._anews = self._lost = 0
        self._beyond, self._largest = np.zeros(model.nv, dtype=int), np.zeros(model.nv)

    def sifted(self, pieces):
        """Yield portions of what comes in pieces, each a recordings.states.States."""
        for states in pieces:
            whole = States.concatenate([self._ahead, states])
            count = max(0, len(whole) - SHORTEST + 1)
            self._ahead = whole[count:]
            yield from self._taken(whole, count)
        yield from self._taken(self._ahead, len(self._ahead))
        if self._gap is None:
            yield from self._begun()
        self._lose()

    def findings(self):
        """What was left out, once all is taken in: a list of Finding.

        Raises
        ------
        InputError
            There is too little, or velocities are beyond what the robot can do.
        """
        if not self._whole:
            raise InputError("no state of the recording is whole: positions, velocities and efforts of all joints.")
        self._refuse_units()
        left = self._whole - self._late - self._fast - self._lost
        if left < SHORTEST:
            raise InputError(f"the recording has {left} states to identify from, expected {SHORTEST} at least.")
        again = "stamps went back and on from there, as of a robot that was started again: what follows is fitted, too"
        findings = (
            Finding("not whole", self._broken, "states without position, velocity or effort of all joints, left out"),
            Finding("time did not go on", self._late, "states with a stamp that is not after all before, left out"),
            Finding(
                "too fast", self._fast, f"states with a velocity above {TOO_FAST} times the URDF's limit, left out"
            ),
            Finding("time began anew", self._anews, again),
            Finding("scattered", self._lost, f"states in runs of fewer than {SHORTEST}, left out"),
        )
        return [finding for finding in findings if finding.count]

    def _taken(self, states, count):
        """Portions of the first of some states; the others are of the next ones."""
        begins = self._beginnings.among(states.stamp, count)
        states = states[:count]
        finite = np.isfinite(states.effort).all(axis=1)
        for columns in (states.position, states.velocity):
            finite &= np.isfinite(columns).all(axis=1)
        forward = self._forward(states.stamp, finite, begins)
        fast = self._too_fast(states.velocity, forward)
        self._whole, self._broken = self._whole + int(finite.sum()), self._broken + int((~finite).sum())
        self._late, self._fast = self._late + int((finite & ~forward).sum()), self._fast + int((forward & fast).sum())
        kept = np.flatnonzero(forward & ~fast)
        again = np.zeros(count, dtype=bool)
        again[begins] = True
        jumped, self._jumped = _since(states.jumped, kept, self._jumped)
        anew, self._anew = _since(again, kept, self._anew)
        rows = _Kept(states.stamp, states.position, states.velocity, states.effort, states.jumped, again).part(kept)
        rows = rows._replace(jumped=jumped, anew=anew)
        if not len(kept):
            return
        if self._gap is not None:
            yield from self._split(rows)
            return
        self._first.append(rows)
        if sum(len(one.stamp) for one in self._first) >= FIRST:
            yield from self._begun()

    def _forward(self, stamps, finite, begins):
        """Which rows are whole, and later than all before that are."""
        forward = np.zeros(len(stamps), dtype=bool)
        for number, part in enumerate(np.split(np.arange(len(stamps)), begins)):
            if number:
                self._latest = NEVER
            latest = np.maximum.accumulate(np.r_[self._latest, np.where(finite[part], stamps[part], NEVER)])
            forward[part] = finite[part] & (stamps[part] > latest[:-1])
            self._latest = latest[-1]
        return forward

    def _too_fast(self, velocities, forward):
        """Rows with a velocity that the joint cannot have."""
        with np.errstate(invalid="ignore"):
            beyond = np.abs(velocities) > self._limit
        self._beyond += beyond[forward].sum(axis=0)
        self._largest = np.maximum(self._largest, np.abs(velocities[forward]).max(axis=0, initial=0.0))
        return beyond.any(axis=1)

    def _refuse_units(self):
        """Many velocities that a joint cannot have are another unit."""
        share = self._beyond / max(self._whole - self._late, 1)
        k = int(np.argmax(share))
        if share[k] > MOST_GARBAGE:
            raise InputError(
                f"velocities of joint '{self._model.dof_names[k]}' reach {self._largest[k]:.3g}, and {share[k]:.0%} of them "
                f"are above {TOO_FAST} times the URDF's limit, {self._model.velocity_limit[k]:.3g} rad/s or m/s: are they in "
                "degrees or revolutions, or of the motor?"
            )

    def _begun(self):
        """Portions of all that was kept until now: its first intervals say what a gap is."""
        self._gap = LEAST_GAP
        if not self._first:
            return
        rows, self._first = _Kept.together(self._first), []
        intervals = np.diff(rows.stamp[:FIRST]) * 1e-9
        if len(intervals):
            self._gap = max(LEAST_GAP, GAPS * float(np.median(intervals)))
            within = intervals[(intervals <= self._gap) & ~(rows.jumped | rows.anew)[1:FIRST]]
            self.sample = float(np.median(within)) if len(within) else 0.0
        self._start = int(rows.stamp[0])
        yield from self._split(rows)

    def _split(self, rows):
        """Portions of states that were kept, by segments."""
        first = self._before is None
        before = np.r_[rows.stamp[0] if first else self._before, rows.stamp[:-1]]
        anew = rows.anew & (np.arange(len(before)) > 0) if first else rows.anew
        begins = ((rows.stamp - before) * 1e-9 > self._gap) | rows.jumped | anew
        begins[0] |= first
        put_off = self._put_off + np.cumsum(np.where(anew, before - rows.stamp + round(2.0 * self._gap * SECOND), 0))
        self._before, self._put_off = rows.stamp[-1], put_off[-1]
        self._anews += int(anew.sum())
        whole = Segment(rows.stamp, (rows.stamp - (self._start - put_off)) * 1e-9, rows.q, rows.qd, rows.tau)
        for number, part in enumerate(np.split(np.arange(len(begins)), np.flatnonzero(begins))):
            if number:
                self._lose()
            if len(part):
                yield from self._long_enough(whole.part(slice(part[0], part[-1] + 1)))

    def _long_enough(self, part):
        """A part of a segment, with all before it if they were too few until now."""
        self._number += len(part.t)
        if self._short is None:
            yield Portion(part, False)
            return
        self._short.append(part)
        if self._number >= SHORTEST:
            yield Portion(Segment.together(self._short), True)
            self._short = None

    def _lose(self):
        """End a segment: one that is too short is left out."""
        if self._short is not None:
            self._lost += self._number
        self._short, self._number = [], 0


class Beginnings:
    """Finds rows from which time has begun anew: stamps go back, and rise from there, short of what they had been."""

    def __init__(self):
        self._latest = self._before = None  # largest stamp since time began, and the last one

    def among(self, stamps, count):
        """Which of the first `count` stamps [ns], a list; the next ones have to begin with those after them."""
        if not count:
            return []
        if self._latest is None:
            self._latest = self._before = stamps[0]
        found, latest, first = [], self._latest, 0
        for k in np.flatnonzero(np.diff(stamps[:count], prepend=self._before) < 0).tolist():
            latest, first = stamps[first:k].max(initial=latest), k
            ahead = stamps[k : k + SHORTEST]
            if len(ahead) == SHORTEST and (np.diff(ahead) >= 0).all() and ahead[-1] < latest:
                found.append(k)
                latest = stamps[k]
        self._latest, self._before = stamps[first:count].max(initial=latest), stamps[count - 1]
        return found


def _since(flags, kept, pending):
    """Of flags by row: whether there was one at each kept row or after the one before, and whether after the last."""
    count, bounds = np.r_[0, np.cumsum(flags)], np.r_[0, kept + 1]
    found, left = np.diff(count[bounds]) > 0, bool(count[-1] > count[bounds[-1]])
    if not len(found):
        return found, pending or left
    found[0] |= pending
    return found, left
