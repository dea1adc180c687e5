# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds of alarms from recordings without contact, or from a run of the monitor: ``calibrate``."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import instance, positive
from diag_dynamics.collision.detector import SECOND, AlarmDetector
from diag_dynamics.collision.residuals import Piece, Residuals
from diag_dynamics.collision.tail import BLOCKS, Level, Stretch, block_peaks, level_of, upper_limit
from diag_dynamics.collision.thresholds import HOLD_OFF, RELEASE, STANDING, AlarmThresholds
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.account import Finding
from diag_dynamics.recordings.calibration_result import Calibration as Calibration
from diag_dynamics.recordings.calibration_result import per_time as per_time
from diag_dynamics.recordings.effort_range import EffortRange
from diag_dynamics.recordings.observed import Observer, require_efforts, require_same_robot
from diag_dynamics.recordings.recording import Recording
from diag_dynamics.recordings.refused_units import refuse_units

PARTS = 5
"""Parts in turn held out."""

SPREAD = 0.9
"""Part of the blocks of a second whose peaks are within a detector's spread: a jerk, which is in fewer than the rest, does
not change it."""

MUCH = 0.05
"""Part of the time that alarms may take in parts that were held out."""


def calibrate(
    recordings: Recording | Iterable[Recording | Iterable[Recording]],
    dynamics: DiagonalDynamics,
    gain: float = 25.0,
    false_alarms: float = 1 / 60,
    *,
    release: float = RELEASE,
    hold_off: float = HOLD_OFF,
    standing: float = STANDING,
    friction: bool | None = None,
    max_gap: float = 0.1,
    threads: int | None = None,
) -> Calibration:
    """Thresholds of alarms from recordings in which nothing touched the robot, for a rate of false alarms.

    Each detector (a joint's |m r|, ‖m r‖, |r|) has its threshold at its own spread times one factor, such that all together
    make alarms at the rate that is asked for.

    Parameters
    ----------
    recordings : Recording, or iterable of recordings
        Without contact; of the motions that the alarms are for. What is no :class:`Recording` among them is the pieces of
        one, as :func:`stream_recording` yields them: these are taken in one by one, in bounded memory.
    dynamics : DiagonalDynamics
        Of the robot, as the monitor will have it.
    gain : float
        Of the observer [1/s].
    false_alarms : float
        Rate, of all detectors together [1/s].
    release, hold_off, standing
        As of :class:`AlarmThresholds`.
    friction : bool, optional
        Whether the observer takes the friction of the model into account; by default where the model has any.
    max_gap : float
        Longest interval that the observer integrates over [s].
    threads : int, optional
        For evaluation, by default as many as there are processors.

    Returns
    -------
    Calibration
        Its `warnings` say where the recordings are too short, or their parts unlike one another.

    Raises
    ------
    InputError
        An argument has a wrong value, a recording is of another robot or without efforts, or there are too few peaks for any
        threshold.
    """
    instance("dynamics", dynamics, DiagonalDynamics)
    model = dynamics.model
    gain = positive("gain", gain, "[1/s]")
    if friction is None:
        friction = model.has_friction
    positive("false_alarms", false_alarms, "[1/s]")
    ends = AlarmThresholds({}, release=release, hold_off=hold_off, standing=standing)
    seen = Residuals(model.nv, max_gap)
    many = iter([recordings] if isinstance(recordings, Recording) else recordings)
    first = next(many, None)
    if first is None:
        raise InputError("recordings are none, expected at least one.")
    efforts = EffortRange(model.dof_names)
    for one in chain([first], many):
        observer = Observer(dynamics, gain, friction=friction, max_gap=max_gap, threads=threads)
        with_states = with_efforts = False
        counts: Counter[str] = Counter()
        findings: list[Finding] = []
        for piece in [one] if isinstance(one, Recording) else one:
            require_same_robot(dynamics, piece)
            with_states, with_efforts = with_states or len(piece) > 0, with_efforts or piece.tau is not None
            counts.update(piece.counts)
            findings = piece.findings
            efforts.take(piece.states.position[:, -model.nv :], piece.states.effort)
            for stamps, (residual, torque, _, valid, _) in observer.observed(piece.states):
                seen.take(stamps, residual, torque, valid)
        refuse_units(findings)
        if not with_efforts:
            require_efforts(with_states, counts)
    unmeasured = efforts.complaint()
    if unmeasured and not efforts.measures:
        raise InputError(f"{unmeasured}. Record the efforts of the joints.")
    still = "" if efforts.moved else "no joint moves: the thresholds are those of a robot at rest"
    warnings = [text for text in (unmeasured, still) if text]
    return calibrated(seen, model.dof_names, gain, false_alarms, ends, friction=friction, warnings=warnings)


def calibrated(
    seen: Residuals | Sequence[Piece],
    names: Sequence[str],
    gain: float,
    false_alarms: float,
    ends: AlarmThresholds,
    *,
    friction: bool = False,
    warnings: Sequence[str] = (),
) -> Calibration:
    """The same of what an observer has seen, from recordings or live.

    Parameters
    ----------
    seen : Residuals or sequence of Piece
        It, or its pieces, which stay as they are while it takes in more.
    names : sequence of str
        Degrees of freedom.
    gain, false_alarms, friction
        As of :func:`calibrate`.
    ends : AlarmThresholds
        How alarms end.
    warnings : sequence of str
        What else keeps the thresholds from being trusted.

    Raises
    ------
    InputError
        The rate is wrong, or there is too little for any threshold.
    """
    rate = positive("false_alarms", false_alarms, "[1/s]")
    pieces = seen.pieces() if isinstance(seen, Residuals) else list(seen)
    duration = sum(piece.duration for piece in pieces)
    if duration <= 0.0:
        raise InputError("there is no external torque to be seen: no efforts, or states too far apart.")
    limits, level = _fitted(pieces, rate, ends)
    if level is None:
        raise InputError(
            f"too short for any threshold: {duration:.3g} s, in which the residuals have fewer than four peaks apart from "
            "one another."
        )
    held_out, on, unfit = 0, 0.0, 0
    for others, out in _folds(pieces, duration):
        there, found = _fitted(others, rate, ends)
        if found is None:
            unfit += 1
            continue
        for piece in out:
            count, part = _alarms(names, there, ends, piece)
            held_out, on = held_out + count, on + part * piece.duration / duration
    thresholds = _with(ends, names, limits)
    result = Calibration(
        thresholds, gain, friction, rate, duration, sum(_alarms(names, limits, ends, piece)[0] for piece in pieces), held_out,
        level.method, level.peaks, tuple(warnings),
    )  # fmt: skip
    return _judged(result, on, unfit)


def time_needed(false_alarms: float) -> float:
    """Time without an alarm that vouches for a rate [1/s], with a confidence of 95 % [s]."""
    return upper_limit(0) / false_alarms


def _fitted(pieces: list[Piece], rate: float, ends: AlarmThresholds) -> tuple[Array, Level | None]:
    """Thresholds of all detectors, and the Level that they were made by."""
    peaks = np.concatenate([block_peaks(piece.stamps, piece.values) for piece in pieces])
    spread = np.quantile(peaks, SPREAD, axis=0, method="lower")
    judged = spread > 1e-9 * spread.max()  # a joint on which never anything is seen is none to judge by
    spread[~judged] = math.inf
    stretches = [Stretch(piece.stamps, (piece.values / spread).max(axis=1)) for piece in pieces]
    duration = sum(piece.duration for piece in pieces)
    level = level_of(stretches, duration, rate, ends.release, ends.hold_off)
    return (spread * level.level if level else spread), level


def _folds(pieces: list[Piece], duration: float) -> Iterator[tuple[list[Piece], list[Piece]]]:
    """The rest and the part that is held out, for each part: stretches of time that follow one another."""
    bounds = np.linspace(0.0, duration, PARTS + 1)
    bounds[-1] = math.inf
    for low, high in pairwise(bounds):
        rest: list[Piece] = []
        out: list[Piece] = []
        before = 0.0
        for piece in pieces:
            at = before + (piece.stamps - piece.stamps[0]) / SECOND
            inside = (at >= low) & (at < high)
            if inside.sum() > 1:
                out.append(piece.part(inside))
            rest += [piece.part(side) for side in (at < low, at >= high) if side.sum() > 1]
            before += piece.duration
        if out and rest:
            yield rest, out


def _with(ends: AlarmThresholds, names: Sequence[str], limits: Array) -> AlarmThresholds:
    joints = {name: float(limit) for name, limit in zip(names, limits, strict=False) if math.isfinite(limit)}
    return AlarmThresholds(joints, float(limits[-2]), float(limits[-1]), ends.release, ends.hold_off, ends.standing)


def _alarms(names: Sequence[str], limits: Array, ends: AlarmThresholds, piece: Piece) -> tuple[int, float]:
    """How many alarms a detector makes of a piece, and for which part of its states one is on."""
    everywhere = np.ones(len(piece.stamps), dtype=bool)
    judged = AlarmDetector(names, _with(ends, names, limits)).judge(
        piece.stamps, piece.residual, piece.torque, everywhere, values=piece.values.copy()
    )
    return int(judged.begins.sum()), float(judged.alarm.mean())


def _judged(result: Calibration, on: float, unfit: int) -> Calibration:
    """The result with what is to be said against it."""
    warnings = list(result.warnings)
    low, _ = result.rate_interval
    if result.vouched > result.asked:
        warnings.append(
            f"too short for {per_time(result.asked)}: {result.duration:.4g} s can vouch for {per_time(result.vouched)} at "
            f"best; it takes {time_needed(result.asked):.3g} s without an alarm"
        )
    if result.method == BLOCKS:
        warnings.append(
            f"alarms run into one another at any threshold that makes some: by {result.peaks} peaks of single seconds"
        )
    if low > result.asked or on > MUCH:
        warnings.append(
            f"parts are unlike one another: thresholds from the others let {result.held_out} alarms through, "
            f"{per_time(result.rate)}, on for {on:.0%} of the time"
        )
    if unfit:
        warnings.append(f"{unfit} of {PARTS} parts could not be held out: too little is left")
    return replace(result, warnings=tuple(warnings))
