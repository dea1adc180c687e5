# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds from residuals without contact, and how far they can be trusted."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import positive
from diag_dynamics.collision.detector import NORM, TORQUE, AlarmDetector, AlarmThresholds, Judged
from diag_dynamics.collision.residuals import (
    Level,
    Residuals,
    Rows,
    block_maxima,
    find_level,
    poisson_interval,
    singular_joint,
)
from diag_dynamics.exceptions import InputError
from diag_dynamics.yaml_files import yaml_text

FOLDS = 5  # parts, each held out once
CONTACT_RATIO = 10.0  # default rate of false contacts per rate of false alarms
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
    settles_on : str
        Of the observer: ``torque`` or ``working_moment``.
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
    contact : Calibration
        Lower thresholds, for contact, and how far they can be trusted; None in those themselves.
    covariance : ndarray, shape (nv, nv)
        Noise of m r: its second moment about zero over all states [N² m², N² of prismatic joints].
    names : tuple of str
        Degrees of freedom, in the order of `covariance`.
    """

    gain: float
    friction: bool
    settles_on: str = "torque"
    asked: float
    duration: float
    alarms: int
    held_out: int
    method: str
    peaks: int
    warnings: tuple[str, ...] = ()
    contact: Calibration | None = None
    covariance: Array | None = field(default=None, compare=False)
    names: tuple[str, ...] = ()

    @property
    def rate(self) -> float:
        """Rate of false alarms in held-out parts [1/s]."""
        return self.held_out / self.duration

    @property
    def rate_interval(self) -> tuple[float, float]:
        """Confidence interval of that rate, 95 % [1/s]."""
        low, high = poisson_interval(self.held_out)
        return low / self.duration, high / self.duration

    def describe_rate(self) -> str:
        """Return the rate of false alarms in held-out parts in words."""
        rate, low, high = (format_rate(one, self.asked) for one in (self.rate, *self.rate_interval))
        alarms = f"{self.held_out} alarm{'s' * (self.held_out != 1)} in {self.duration:.4g} s"
        return f"Held-out parts: {alarms}, {rate} (95 % interval: {low} to {high})."

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
        head = [
            f"Thresholds for {format_rate(self.asked)} false alarms, all detectors together.",
            self.describe_rate(),
        ]
        if self.contact:
            head.append(f"Contact: {format_rate(self.contact.asked)} requested. {self.contact.describe_rate()}")
            head += [f"Contact: {text}" for text in self.contact.warnings]
        head += [
            *self.warnings,
            *notes,
            "Units: gain 1/s; joints and external_torque N m, of prismatic joints N; norm J^0.5/s; times s.",
        ]
        alarm = {
            **_entries(self),
            "release": float(self.release),
            "hold_off": float(self.hold_off),
            "standing": 0.0 if self.standing == math.inf else float(self.standing),
        }
        if self.contact:
            alarm |= {f"contact_{name}": value for name, value in _entries(self.contact).items()}
        torque = {"gain": float(self.gain), "friction": bool(self.friction), "settles_on": self.settles_on}
        if self.covariance is not None and not singular_joint(self.names, self.covariance):
            numbers = [float(f"{x:.10g}") for x in self.covariance.ravel().tolist()]
            torque |= {"covariance_joints": list(self.names), "covariance": numbers}
        lines = [f"# {' '.join(note.split())}\n" for note in head]
        content = yaml_text({"/**": {"ros__parameters": {"external_torque": torque, "alarm": alarm}}})
        try:
            Path(path).expanduser().write_text("".join([*lines, content]), encoding="utf-8")
        except OSError as error:
            raise InputError(f"'{os.fspath(path)}' cannot be written: {error.strerror}.") from error


def _entries(thresholds: AlarmThresholds) -> dict[str, Any]:
    """Return the parameters of thresholds."""
    return {
        "joints": [f"{name}={_rounded_up(value)!r}" for name, value in thresholds.joints.items()],
        TORQUE: _rounded_up(thresholds.external_torque),
        NORM: _rounded_up(thresholds.norm),
    }


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
    false_alarms: float,
    template: AlarmThresholds,
    warnings: Sequence[str] = (),
    *,
    false_contacts: float | None = None,
    **observer: Any,
) -> Calibration:
    """Return the Calibration of residuals of an observer, with release, hold-off and `standing` of a template."""
    rate, rows = positive("false_alarms", false_alarms, "[1/s]"), residuals.rows()
    contacts = CONTACT_RATIO * rate if false_contacts is None else positive("false_contacts", false_contacts, "[1/s]")
    if contacts < rate:
        raise InputError(
            f"false_contacts is {contacts:g} 1/s, expected at least {rate:g} 1/s (false_alarms): contact has the lower "
            "thresholds."
        )
    if not len(rows.stamps) or rows.time[-1] == 0.0:
        raise InputError("external torque is missing: the recordings have no efforts, or too long gaps.")
    found = _calibrate_rows(rows, names, rate, template, observer)
    lower = _calibrate_rows(rows, names, contacts, template, observer, found)
    joint = singular_joint(names, residuals.covariance)
    singular = [f"external torque of '{joint}' has no noise of its own: the file gets no covariance"] * bool(joint)
    return replace(
        found,
        warnings=(*warnings, *found.warnings, *singular),
        contact=lower,
        covariance=residuals.covariance,
        names=tuple(names),
    )


def _calibrate_rows(
    rows: Rows,
    names: Sequence[str],
    rate: float,
    template: AlarmThresholds,
    observer: Mapping[str, Any],
    upper: AlarmThresholds | None = None,
) -> Calibration:
    """Return thresholds for a rate, no higher than `upper`, with the alarms of held-out parts."""
    time = rows.time
    duration = float(time[-1])
    thresholds, level = _fit(rows, names, rate, template)
    if level is None:
        raise InputError(
            f"the recordings have {duration:.3g} s with fewer than four separate peaks, too few for a "
            "threshold. Record a longer motion."
        )
    if upper and thresholds.norm > upper.norm:  # all thresholds have one factor
        thresholds = replace(thresholds, joints=upper.joints, external_torque=upper.external_torque, norm=upper.norm)
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
        **observer,
        asked=rate,
        duration=duration,
        alarms=int(_detect(rows, names, thresholds).begins.sum()),
        held_out=held_out,
        method=level.method,
        peaks=level.peaks,
    )
    return replace(result, warnings=tuple(_warnings(result, alarm_time / duration)))


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
