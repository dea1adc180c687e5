# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs of states that a filter can go through: what of a recording is fitted, and what is left out."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.account import Finding, without_efforts

LEAST_GAP, GAPS = 0.05, 10.0
"""Time without states from which a segment begins anew: the longer one of this [s] and so many median intervals."""

TOO_FAST = 1.5
"""Multiple of the URDF's velocity limit above which a row is garbage."""

MOST_GARBAGE = 0.01
"""Part of the rows above which it is no garbage, but a unit."""

LONG = 50_000
"""States of a part, about: what is mirrored and transformed as a whole takes forty times the memory of its states."""

SHORTEST = 10
"""States of a segment; fewer are left out."""


class Segment(NamedTuple):
    """States one after the other, without gaps."""

    stamp: np.ndarray
    """[ns], int64, shape (T,), rising."""
    t: np.ndarray
    """[s], from the first state of the recording; rising over all its segments, though stamps began anew in between."""
    q: np.ndarray
    """[rad, m], shape (T, nq)."""
    qd: np.ndarray
    """[rad/s, m/s], shape (T, nv)."""
    tau: np.ndarray
    """[N m, N], shape (T, nv)."""

    def part(self, which):
        """States of a slice or mask."""
        return Segment(*(np.ascontiguousarray(column[which]) for column in self))


def segments_of(recording, model, findings):
    """Segments of a recording; what is left out is added to the findings.

    Raises
    ------
    InputError
        There are no efforts, or velocities are beyond what the robot can do.
    """
    if recording.tau is None:
        raise InputError(f"{without_efforts(recording.counts)}, without which nothing can be identified.")
    stamp = np.asarray(recording.stamp)
    finite = np.isfinite(recording.tau).all(axis=1)
    for columns in (recording.q, recording.qd):
        finite &= np.isfinite(columns).all(axis=1)
    if not finite.any():
        raise InputError("no state of the recording is whole: positions, velocities and efforts of all joints.")
    begins = _beginnings(stamp)
    forward = np.concatenate(
        [_forward(*pair) for pair in zip(np.split(stamp, begins), np.split(finite, begins), strict=True)]
    )
    fast = _too_fast(recording.qd, model, forward)
    kept = np.flatnonzero(forward & ~fast)
    for count, cause, text in (
        (int((~finite).sum()), "not whole", "states without position, velocity or effort of all joints"),
        (int((finite & ~forward).sum()), "time did not go on", "states with a stamp that is not after all before"),
        (int((forward & fast).sum()), "too fast", f"states with a velocity above {TOO_FAST} times the URDF's limit"),
    ):
        if count:
            findings.append(Finding(cause, count, f"{text}, left out"))
    if len(kept) < SHORTEST:
        raise InputError(f"the recording has {len(kept)} states to identify from, expected {SHORTEST} at least.")
    run = np.searchsorted(begins, kept, side="right")
    interval, anew = np.diff(stamp[kept]) * 1e-9, np.diff(run) > 0
    gap = max(LEAST_GAP, GAPS * float(np.median(interval)))
    if anew.any():
        text = "stamps went back and on from there, as of a robot that was started again: what follows is fitted, too"
        findings.append(Finding("time began anew", int(anew.sum()), text))
    moved = np.concatenate([[0], np.cumsum(recording.states.moved)])
    jumped = moved[kept[1:] + 1] > moved[kept[:-1] + 1]
    parts = np.split(kept, np.flatnonzero((interval > gap) | jumped | anew) + 1)
    lost = sum(len(part) for part in parts if len(part) < SHORTEST)
    if lost:
        findings.append(Finding("scattered", lost, f"states in runs of fewer than {SHORTEST}, left out"))
    put_off = np.zeros(len(stamp), dtype=np.int64)
    put_off[kept[1:]] = np.cumsum(_overlaps(stamp[kept], anew, gap))
    first = stamp[kept[0]] - put_off
    return [
        Segment(
            stamp[part],
            (stamp[part] - first[part]) * 1e-9,
            *(np.ascontiguousarray(columns[part]) for columns in (recording.q, recording.qd, recording.tau)),
        )
        for part in parts
        if len(part) >= SHORTEST
    ]


def _beginnings(stamp):
    """Rows from which time has begun anew: stamps go back, and rise from there, short of what they had been."""
    found: list[int] = []
    latest, before = stamp[0], 0
    for k in (np.flatnonzero(np.diff(stamp) < 0) + 1).tolist():
        latest, before = max(latest, stamp[before:k].max()), k
        ahead = stamp[k : k + SHORTEST]
        if len(ahead) == SHORTEST and (np.diff(ahead) >= 0).all() and ahead[-1] < latest:
            found.append(k)
            latest = stamp[k]
    return np.array(found, dtype=int)


def _forward(stamp, finite):
    """Which rows are whole, and later than all before that are."""
    latest = np.maximum.accumulate(np.where(finite, stamp, np.iinfo(np.int64).min))
    return np.r_[True, stamp[1:] > latest[:-1]] & finite


def _overlaps(stamp, anew, gap):
    """By how much times are to be put off at each row but the first, so that they rise where stamps begin anew [ns]."""
    return np.where(anew, stamp[:-1] - stamp[1:] + round(2.0 * gap * SECOND), 0)


def _too_fast(qd, model, rows):
    """Rows with a velocity that the joint cannot have; many of them are another unit."""
    with np.errstate(invalid="ignore"):
        limit = np.where(model.velocity_limit > 0.0, model.velocity_limit, np.inf)  # 0 stands for none in many URDFs
        beyond = np.abs(qd) > TOO_FAST * limit
    share = beyond[rows].mean(axis=0) if rows.any() else np.zeros(model.nv)
    k = int(np.argmax(share))
    if share[k] > MOST_GARBAGE:
        largest = float(np.abs(qd[rows, k]).max())
        raise InputError(
            f"velocities of joint '{model.dof_names[k]}' reach {largest:.3g}, and {share[k]:.0%} of them are above "
            f"{TOO_FAST} times the URDF's limit, {model.velocity_limit[k]:.3g} rad/s or m/s: are they in degrees or "
            "revolutions, or of the motor?"
        )
    return beyond.any(axis=1)


def parts_of(segment):
    """Yield a segment in parts that a filter of both directions goes through one by one; a short one is a single part."""
    count = max(1, round(len(segment.t) / LONG))
    for bounds in np.array_split(np.arange(len(segment.t)), count):
        yield segment.part(slice(int(bounds[0]), int(bounds[-1]) + 1))


def duration(segments):
    """Time in segments [s]."""
    return float(sum(segment.t[-1] - segment.t[0] for segment in segments))
