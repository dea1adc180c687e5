"""Thresholds of alarms from recordings without contact: ``calibrate``."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from diag_dynamics.alarms.detector import SECOND, AlarmDetector, detected
from diag_dynamics.alarms.rates import BLOCKS, Stretch, block_peaks, level_of, poisson_interval, upper_limit
from diag_dynamics.alarms.thresholds import HOLD_OFF, RELEASE, STANDING, AlarmThresholds
from diag_dynamics.arrays import Array
from diag_dynamics.checks import instance, positive
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.spec import as_yaml
from diag_dynamics.recordings.observed import Observed, observe
from diag_dynamics.recordings.recording import Recording

PARTS = 5
"""Parts in turn held out."""

SPREAD = 0.9
"""Part of the blocks of a second whose peaks are within a detector's spread: a jerk, which is in fewer than the rest, does
not change it."""

MUCH = 0.05
"""Part of the time that alarms may take in parts that were held out."""


@dataclass(frozen=True)
class Calibration:
    """Thresholds of alarms, and how far they can be trusted; see docs/alarms.md.

    Attributes
    ----------
    thresholds : AlarmThresholds
        For :class:`AlarmDetector`.
    gain : float
        Of the observer [1/s].
    friction : bool
        Whether the observer knew of the friction of the model.
    asked : float
        Rate of false alarms that was asked for, of all detectors together [1/s].
    duration : float
        For which external torque was known, in all recordings [s].
    alarms : int
        How many alarms these thresholds would have made of the very recordings.
    held_out : int
        How many alarms there were in parts of the recordings by thresholds from the other parts.
    method : str
        ``counted``: so many alarms are in the recordings; ``tail``: the rate lies beyond them, and their peaks' tail says;
        ``blocks``: that of the peaks of single seconds, as alarms are too few.
    peaks : int
        How many peaks the level is based on.
    warnings : tuple of str
        What keeps the thresholds from being trusted.
    """

    thresholds: AlarmThresholds
    gain: float
    friction: bool
    asked: float
    duration: float
    alarms: int
    held_out: int
    method: str
    peaks: int
    warnings: tuple[str, ...] = ()

    @property
    def joints(self) -> dict[str, float]:
        """Threshold of |m r| of each joint [N m, N]."""
        return dict(self.thresholds.joints)

    @property
    def external_torque(self) -> float:
        """Threshold of ‖m r‖ [N m]."""
        return self.thresholds.external_torque

    @property
    def norm(self) -> float:
        """Threshold of |r| [J^½/s]."""
        return self.thresholds.norm

    @property
    def release(self) -> float:
        """Part of its threshold below which a detector is quiet again."""
        return self.thresholds.release

    @property
    def hold_off(self) -> float:
        """Time after an alarm within which a further rise belongs to it [s]."""
        return self.thresholds.hold_off

    @property
    def rate(self) -> float:
        """Rate of false alarms in parts that were held out [1/s]."""
        return self.held_out / self.duration

    @property
    def rate_interval(self) -> tuple[float, float]:
        """Between what the rate lies, with a confidence of 95 % [1/s]."""
        low, high = poisson_interval(self.held_out)
        return low / self.duration, high / self.duration

    @property
    def vouched(self) -> float:
        """Lowest rate that recordings of this duration could vouch for, had there been no alarm: 95 % [1/s]."""
        return upper_limit(0) / self.duration

    @property
    def _standing(self) -> float:
        return 0.0 if self.thresholds.standing == math.inf else float(self.thresholds.standing)

    def save(self, path: str | os.PathLike[str], notes: Sequence[str] = ()) -> None:
        """Write a parameter file that the monitor takes as it is.

        Parameters
        ----------
        path : str or Path
        notes : sequence of str
            Lines of comment at its head: what else is to be known of where it comes from.

        Raises
        ------
        InputError
            It cannot be written.
        """
        try:
            Path(path).expanduser().write_text(self.yaml(notes), encoding="utf-8")
        except OSError as error:
            raise InputError(f"'{os.fspath(path)}' cannot be written: {error.strerror}.") from error

    def yaml(self, notes: Sequence[str] = ()) -> str:
        """Text of that file."""
        low, high = self.rate_interval
        joints = [f"{name}={_rounded(value)}" for name, value in self.joints.items()]
        head = [
            f"Alarms on external torque: calibrated to {per_time(self.asked)}, all detectors together.",
            f"Held out by parts: {self.held_out} alarms in {self.duration:.4g} s, {per_time(self.rate)} "
            f"(95 %: {per_time(low)} to {per_time(high)}).",
            *self.warnings,
            *notes,
        ]
        lines = [
            *(f"# {' '.join(note.split())}" for note in head),
            "/**:",
            "  ros__parameters:",
            "    external_torque:",
            f"      gain: {as_yaml(float(self.gain))}  # 1/s",
            f"      friction: {as_yaml(self.friction)}",
            "    alarm:",
            f"      joints:  # |m r| [N m, prismatic: N]\n{_listed(joints)}",
            f"      external_torque: {_rounded(self.external_torque)}  # norm of m r [N m]",
            f"      norm: {_rounded(self.norm)}  # |r| [J^0.5/s]",
            f"      release: {as_yaml(float(self.release))}",
            f"      hold_off: {as_yaml(float(self.hold_off))}  # s",
            f"      standing: {as_yaml(self._standing)}  # s",
        ]
        return "\n".join(lines) + "\n"


def _listed(entries):
    return "\n".join(f'        - "{entry}"' for entry in entries)


def _rounded(value):
    """Four digits, never below the value."""
    digits = 3 - math.floor(math.log10(value))
    return as_yaml(float(f"{math.ceil(value * 10.0**digits * (1.0 - 1e-12)) / 10.0**digits:.12g}"))


def per_time(rate: float) -> str:
    """Words for a rate [1/s]."""
    if rate == 0.0:
        return "0/min"
    for seconds, unit in ((1.0, "s"), (60.0, "min")):
        if rate * seconds >= 0.1:
            return f"{rate * seconds:.3g}/{unit}" if unit == "min" or rate >= 1.0 else f"{rate * 60:.3g}/min"
    return f"{rate * 3600:.3g}/h"


def calibrate(
    recordings: Recording | Sequence[Recording],
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
    recordings : Recording, or sequence of Recording
        Without contact; of the motions that the alarms are for.
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
    many = [recordings] if isinstance(recordings, Recording) else list(recordings)
    if not many:
        raise InputError("recordings are none, expected at least one.")
    seen = [
        (one.stamp, observe(dynamics, one, gain, friction=friction, max_gap=max_gap, threads=threads)) for one in many
    ]
    return calibrated(
        seen, model.dof_names, gain, false_alarms, AlarmThresholds({}, release=release, hold_off=hold_off, standing=standing),
        friction=friction, max_gap=max_gap,
    )  # fmt: skip


def calibrated(
    seen: Sequence[tuple[Array, Observed]],
    names: Sequence[str],
    gain: float,
    false_alarms: float,
    ends: AlarmThresholds,
    *,
    friction: bool = False,
    max_gap: float = 0.1,
) -> Calibration:
    """The same of what an observer has seen: stamps [ns] and columns of each recording; `ends` says how alarms end."""
    rate = positive("false_alarms", false_alarms, "[1/s]")
    pieces = [part for stamps, observed in seen for part in _stretches(stamps, observed, max_gap)]
    duration = sum(piece.duration for piece in pieces)
    if duration <= 0.0:
        raise InputError("there is no external torque in the recordings: no efforts, or states too far apart.")
    limits, level = _fitted(pieces, rate, ends)
    if level is None:
        raise InputError(
            f"the recordings are too short for any threshold: {duration:.3g} s, in which the residuals have fewer than four "
            "peaks apart from one another."
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
        level.method, level.peaks,
    )  # fmt: skip
    return _judged(result, on, unfit)


class _Piece:
    """What was seen without a gap."""

    def __init__(self, stamps, residual, torque):
        self.stamps, self.residual, self.torque = stamps, residual, torque
        self.values = detected(torque, residual)
        self.duration = (int(stamps[-1]) - int(stamps[0])) / SECOND
        self.peaks = block_peaks(stamps, self.values)

    def part(self, which):
        """Some of it."""
        return _Piece(self.stamps[which], self.residual[which], self.torque[which])


def _stretches(stamps, observed, max_gap):
    """Pieces between which results are missing, or states."""
    valid = np.flatnonzero(observed.valid)
    if len(valid) < 2:
        return []
    step = np.diff(stamps[valid])
    cuts = np.flatnonzero((step < 0) | (step > max_gap * SECOND)) + 1
    rows = [part for part in np.split(valid, cuts) if len(part) > 1]
    return [_Piece(stamps[part], observed.residual[part], observed.external_torque[part]) for part in rows]


def _fitted(pieces, rate, ends):
    """Thresholds of all detectors, and the Level that they were made by."""
    spread = np.quantile(np.concatenate([piece.peaks for piece in pieces]), SPREAD, axis=0, method="lower")
    judged = spread > 1e-9 * spread.max()  # a joint on which never anything is seen is none to judge by
    spread[~judged] = math.inf
    stretches = [Stretch(piece.stamps, (piece.values / spread).max(axis=1)) for piece in pieces]
    duration = sum(piece.duration for piece in pieces)
    level = level_of(stretches, duration, rate, ends.release, ends.hold_off)
    return (spread * level.level if level else spread), level


def _folds(pieces, duration):
    """The rest and the part that is held out, for each part: stretches of time that follow one another."""
    bounds = np.linspace(0.0, duration, PARTS + 1)
    bounds[-1] = math.inf
    for low, high in pairwise(bounds):
        rest, out, before = [], [], 0.0
        for piece in pieces:
            at = before + (piece.stamps - piece.stamps[0]) / SECOND
            inside = (at >= low) & (at < high)
            if inside.sum() > 1:
                out.append(piece.part(inside))
            rest += [piece.part(side) for side in (at < low, at >= high) if side.sum() > 1]
            before += piece.duration
        if out and rest:
            yield rest, out


def _with(ends, names, limits):
    joints = {name: float(limit) for name, limit in zip(names, limits, strict=False) if math.isfinite(limit)}
    return AlarmThresholds(joints, float(limits[-2]), float(limits[-1]), ends.release, ends.hold_off, ends.standing)


def _alarms(names, limits, ends, piece):
    """How many alarms a detector makes of a piece, and for which part of its states one is on."""
    judged = AlarmDetector(names, _with(ends, names, limits)).judge(
        piece.stamps, piece.residual, piece.torque, np.ones(len(piece.stamps), dtype=bool)
    )
    return int(judged.begins.sum()), float(judged.alarm.mean())


def _judged(result, on, unfit):
    """The result with what is to be said against it."""
    warnings = []
    low, _ = result.rate_interval
    if result.vouched > result.asked:
        warnings.append(
            f"too short for {per_time(result.asked)}: {result.duration:.4g} s can vouch for {per_time(result.vouched)} at "
            f"best; it takes {upper_limit(0) / result.asked:.3g} s without an alarm"
        )
    if result.method == BLOCKS:
        warnings.append(
            f"alarms run into one another at any threshold that makes some: by {result.peaks} peaks of single seconds"
        )
    if low > result.asked or on > MUCH:
        warnings.append(
            f"parts of the recordings are unlike: thresholds from the others let {result.held_out} alarms through, "
            f"{per_time(result.rate)}, on for {on:.0%} of the time"
        )
    if unfit:
        warnings.append(f"{unfit} of {PARTS} parts could not be held out: too little is left")
    return Calibration(**{**result.__dict__, "warnings": tuple(warnings)})
