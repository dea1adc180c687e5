# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds from residuals without contact, and how far they can be trusted."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from diag_dynamics.checks import positive
from diag_dynamics.collision.detector import AlarmDetector, AlarmThresholds, Judged
from diag_dynamics.collision.residuals import Level, Residuals, Rows, block_maxima, find_level, poisson_interval
from diag_dynamics.exceptions import InputError
from diag_dynamics.yaml_files import yaml_text

FOLDS = 5  # parts, each held out once
SPREAD = 0.9  # fraction of the seconds whose maxima are within a detector's spread
MAX_ALARM_TIME = 0.05  # fraction of the held-out time
UNSEEN = -math.log(0.05)  # expected number of alarms that are none with a probability of 5 %


@dataclass(frozen=True, kw_only=True)
class Calibration(AlarmThresholds):
    """Thresholds of an :class:`AlarmDetector`, and how far they can be trusted; see docs/collision.md.

    Attributes
    ----------
    joints, external_torque, norm, release, hold_off, standing
        As of :class:`AlarmThresholds`.
    gain : float
        Of the observer [1/s].
    friction : bool
        Whether the observer subtracts the friction of the model.
    asked : float
        Requested rate of false alarms, of all detectors together [1/s].
    duration : float
        Time with a result of the observer, in all recordings [s].
    alarms : int
        Alarms of these thresholds in the same recordings.
    held_out : int
        Alarms in each fifth of the recordings by thresholds from the other four.
    method : str
        ``counted``: the recordings hold enough alarms; ``tail``: extrapolated from the peaks of
        alarms; ``blocks``: from the maxima of single seconds.
    peaks : int
        Number of peaks that the thresholds are based on.
    warnings : tuple of str
        Why the thresholds may be wrong.
    """

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
    def rate(self) -> float:
        """Rate of false alarms in held-out parts [1/s]."""
        return self.held_out / self.duration

    @property
    def rate_interval(self) -> tuple[float, float]:
        """Confidence interval of that rate, 95 % [1/s]."""
        low, high = poisson_interval(self.held_out)
        return low / self.duration, high / self.duration

    @property
    def vouched(self) -> float:
        """Lowest rate that this duration can demonstrate: 95 % limit at zero alarms [1/s]."""
        return UNSEEN / self.duration

    def save(self, path: str | os.PathLike[str], notes: Sequence[str] = ()) -> None:
        """Write a parameter file of the monitor, with `notes` as further comments at its head.

        Raises
        ------
        InputError
            It cannot be written.
        """
        rate, low, high = (format_rate(one, self.asked) for one in (self.rate, *self.rate_interval))
        head = [
            f"Thresholds for {format_rate(self.asked)} false alarms, all detectors together.",
            f"Held-out parts: {self.held_out} alarms in {self.duration:.4g} s, {rate} (95 %: {low} to {high}).",
            *self.warnings,
            *notes,
            "Units: gain 1/s; joints and external_torque N m, of prismatic joints N; norm J^0.5/s; times s.",
        ]
        alarm = {
            "joints": [f"{name}={_rounded_up(value)!r}" for name, value in self.joints.items()],
            "external_torque": _rounded_up(self.external_torque),
            "norm": _rounded_up(self.norm),
            "release": float(self.release),
            "hold_off": float(self.hold_off),
            "standing": 0.0 if self.standing == math.inf else float(self.standing),
        }
        torque = {"gain": float(self.gain), "friction": bool(self.friction)}
        lines = [f"# {' '.join(note.split())}\n" for note in head]
        content = yaml_text({"/**": {"ros__parameters": {"external_torque": torque, "alarm": alarm}}})
        try:
            Path(path).expanduser().write_text("".join([*lines, content]), encoding="utf-8")
        except OSError as error:
            raise InputError(f"'{os.fspath(path)}' cannot be written: {error.strerror}.") from error


def _rounded_up(value: float) -> float:
    """Return a value rounded up to four digits."""
    digits = 3 - math.floor(math.log10(value))
    return float(f"{math.ceil(value * 10.0**digits * (1.0 - 1e-12)) / 10.0**digits:.12g}")


def format_rate(rate: float, unit_of: float | None = None) -> str:
    """Return a rate [1/s] such as ``3/min``, in the unit of another rate if that is given."""
    size = rate if unit_of is None else unit_of
    if size >= 1.0:
        return f"{rate:.3g}/s"
    if size == 0.0 or size * 60.0 >= 0.1:
        return f"{rate * 60.0:.3g}/min"
    return f"{rate * 3600.0:.3g}/h"


def calibrate_residuals(
    residuals: Residuals,
    names: Sequence[str],
    gain: float,
    false_alarms: float,
    template: AlarmThresholds,
    friction: bool = False,
    warnings: Sequence[str] = (),
) -> Calibration:
    """Return the Calibration of residuals, with release, hold-off and `standing` of a template."""
    rate, rows = positive("false_alarms", false_alarms, "[1/s]"), residuals.rows()
    time = rows.time
    duration = float(time[-1]) if len(time) else 0.0
    if duration == 0.0:
        raise InputError("external torque is missing: the recordings have no efforts, or too long gaps.")
    thresholds, level = _fit(rows, names, rate, template)
    if level is None:
        raise InputError(
            f"the recordings have {duration:.3g} s with fewer than four separate peaks, too few for a "
            "threshold. Record a longer motion."
        )
    held_out, alarm_time = 0, 0.0
    for low, high in pairwise([*np.linspace(0.0, duration, FOLDS + 1)[:-1], math.inf]):
        inside = (time >= low) & (time < high)
        rest = rows._replace(segment=2 * rows.segment + (time >= high)).select(~inside)
        others, found = _fit(rest, names, rate, template) if inside.any() and len(rest.stamps) else (template, None)
        if found:
            part = rows.select(inside)
            judged = _detect(part, names, others)
            held_out += int(judged.begins.sum())
            alarm_time += float(judged.alarm.mean() * part.time[-1])
    result = Calibration(
        **vars(thresholds),
        gain=gain,
        friction=friction,
        asked=rate,
        duration=duration,
        alarms=int(_detect(rows, names, thresholds).begins.sum()),
        held_out=held_out,
        method=level.method,
        peaks=level.peaks,
    )
    return replace(result, warnings=(*warnings, *_warnings(result, alarm_time / duration)))


def _fit(
    rows: Rows, names: Sequence[str], rate: float, template: AlarmThresholds
) -> tuple[AlarmThresholds, Level | None]:
    """Return thresholds, and the level that is their factor upon the spread of each detector."""
    spread = np.quantile(block_maxima(rows.split(rows.values)), SPREAD, axis=0, method="lower")
    spread[spread <= 1e-9 * spread.max()] = math.inf  # a joint without residuals gets no threshold
    scores = rows.split((rows.values / spread).max(axis=1))
    level = find_level(scores, float(rows.time[-1]), rate, template.release, template.hold_off)
    *joints, torque, norm = (spread * level.value if level else spread).tolist()
    finite = {name: limit for name, limit in zip(names, joints, strict=True) if limit < math.inf}
    return replace(template, joints=finite, external_torque=torque, norm=norm), level


def _detect(rows: Rows, names: Sequence[str], thresholds: AlarmThresholds) -> Judged:
    torque, r = np.split(rows.x, 2, axis=1)
    valid, detector = np.ones(len(r), dtype=bool), AlarmDetector(names, thresholds)
    return detector.judge(rows.stamps, r, torque, valid, rows.starts, rows.values)


def _warnings(result: Calibration, alarm_time: float) -> list[str]:
    """Return why the thresholds may be wrong."""
    asked, best, rate = map(format_rate, (result.asked, result.vouched, result.rate))
    warnings = {
        f"too short for {asked}: {result.duration:.4g} s can demonstrate at best {best}; "
        f"record {UNSEEN / result.asked:.3g} s without an alarm": result.vouched > result.asked,
        f"alarms overlap: thresholds are from {result.peaks} maxima of one second each": result.method == "blocks",
        f"parts of the recordings differ: {result.held_out} alarms by thresholds from the other parts, {rate}, "
        f"active {alarm_time:.0%} of the time": (result.rate_interval[0] > result.asked or alarm_time > MAX_ALARM_TIME),
    }
    return [text for text, applies in warnings.items() if applies]
