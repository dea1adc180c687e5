# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds from residuals without contact, and how far they can be trusted."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, IntArray
from diag_dynamics.atomic_file import write_text
from diag_dynamics.checks import positive
from diag_dynamics.collision.detector import NORM, TORQUE, AlarmDetector, AlarmThresholds, Judged
from diag_dynamics.collision.residuals import (
    Level,
    Residuals,
    Rows,
    fit_limits,
    part_numbers,
    poisson_interval,
    singular_joint,
)
from diag_dynamics.exceptions import InputError
from diag_dynamics.text import distinct
from diag_dynamics.yaml_files import yaml_text

CONTACT_RATIO = 10.0  # default rate of false contacts per rate of false alarms
FACTORS = np.geomspace(1.0, 2.0, 25)  # of thresholds whose held-out parts have too many alarms
MIN_REST = 10.0  # shortest time at rest for thresholds of its own [s]
MIN_RATIO = 0.05  # smallest ratio of a threshold at rest to that of motion
MAX_ALARM_TIME = 0.05  # fraction of the held-out time
UNSEEN = -math.log(0.05)  # expected number of alarms that are none with a probability of 5 %


@dataclass(frozen=True, kw_only=True)
class Calibration(AlarmThresholds):
    """Thresholds of an :class:`AlarmDetector`, and how far they can be trusted; see docs/collision.md.

    Attributes
    ----------
    joints, external_torque, norm, release, hold_off, standing, rest_joints, rest_external_torque
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
        Alarms in each of the `parts` by thresholds from the others.
    method : str
        ``counted``: the recordings hold enough alarms; ``tail``: extrapolated from the peaks of
        alarms; ``blocks``: from the maxima of single seconds.
    peaks : int
        Number of peaks that the thresholds are based on.
    rest : float
        Time at rest, in all recordings [s].
    parts : str
        The parts that are held out in turn, for example ``3 recordings``.
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
    rest: float = 0.0
    parts: str = ""
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
        return f"Held out: {rate} ({low} to {high}, 95 % interval): {alarms}, by {self.parts}."

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
            head.append(
                f"Contact: {format_rate(self.contact.asked)} requested. {self.contact.describe_rate()}"
            )
            head += [f"Contact: {text}" for text in self.contact.warnings]
        head += [
            *self.warnings,
            *notes,
            "Units: gain 1/s; joints and external_torque N m, of prismatic joints N; norm J^0.5/s; times s.",
        ]
        alarm = {
            "joint_count": len(self.joints),
            **_entries(self),
            "release": float(self.release),
            "hold_off": float(self.hold_off),
            "standing": 0.0 if self.standing == math.inf else float(self.standing),
        }
        if self.contact:
            alarm |= {f"contact_{name}": value for name, value in _entries(self.contact).items()}
        torque = {"gain": float(self.gain), "settles_on": self.settles_on}
        if self.covariance is not None and not singular_joint(self.names, self.covariance):
            numbers = [float(f"{x:.10g}") for x in self.covariance.ravel().tolist()]
            torque |= {"covariance_joints": list(self.names), "covariance": numbers}
        torque["friction"] = bool(self.friction)  # last: a part of a truth value is none
        lines = [f"# {' '.join(note.split())}\n" for note in head]
        content = yaml_text(
            {"/**": {"ros__parameters": {"alarm": alarm, "external_torque": torque}}}
        )
        write_text(path, "".join([*lines, content]))


def _entries(thresholds: AlarmThresholds) -> dict[str, Any]:
    """Return the parameters of thresholds."""
    return {
        "joints": [f"{name}={_rounded_up(value)!r}" for name, value in thresholds.joints.items()],
        TORQUE: _rounded_up(thresholds.external_torque),
        NORM: _rounded_up(thresholds.norm),
        "rest_joints": [
            f"{name}={_rounded_up(value)!r}" for name, value in thresholds.rest_joints.items()
        ]
        or [""],
        f"rest_{TORQUE}": _rounded_up(thresholds.rest_external_torque),
    }


def _rounded_up(value: float) -> float:
    """Return a value rounded up to four digits; 0 for none."""
    if value == math.inf:
        return 0.0
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
    contacts = (
        CONTACT_RATIO * rate
        if false_contacts is None
        else positive("false_contacts", false_contacts, "[1/s]")
    )
    if contacts < rate:
        value, bound = distinct(contacts, rate)
        raise InputError(
            f"false_contacts is {value} 1/s, expected at least {bound} 1/s (false_alarms): contact has the lower "
            "thresholds."
        )
    if rows.duration == 0.0:
        raise InputError(
            "external torque is missing: the recordings have no efforts, or too long gaps."
        )
    found = _calibrate_rows(rows, names, rate, template, observer)
    upper = np.append(found.limits(names), found.rest_limits(names))
    lower = _calibrate_rows(rows, names, contacts, template, observer, upper)
    joint = singular_joint(names, residuals.covariance)
    singular = [
        f"external torque of '{joint}' has no noise of its own: the file gets no covariance"
    ] * bool(joint)
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
    upper: Array | None = None,
) -> Calibration:
    """Return thresholds for a rate, no higher than `upper`, with the alarms of held-out parts."""
    (limits, level), duration = _fit(rows, rate, template), rows.duration
    if level is None:
        raise InputError(
            f"the recordings have {duration:.3g} s with fewer than four separate peaks, too few for a "
            "threshold. Record a longer motion."
        )
    numbers, parts = part_numbers(rows)
    held_out = _HeldOut(rows.cut(numbers), numbers, names, rate, template)
    factor = held_out.factor()
    limits = limits * factor if upper is None else np.minimum(limits * factor, upper)
    thresholds = _thresholds(names, template, limits)
    alarms, alarm_time = held_out.alarms()
    result = Calibration(
        **vars(thresholds),
        **observer,
        asked=rate,
        duration=duration,
        alarms=int(_detect(rows, names, thresholds).begins.sum()),
        held_out=alarms,
        method=level.method,
        peaks=level.peaks,
        rest=rows.cut(rows.rest).select(rows.rest).duration,
        parts=parts,
    )
    return replace(result, warnings=tuple(_warnings(result, alarm_time / duration)))


class _HeldOut:
    """Alarms of each part by thresholds from the other parts, times a factor."""

    def __init__(
        self,
        rows: Rows,
        numbers: IntArray,
        names: Sequence[str],
        rate: float,
        template: AlarmThresholds,
    ) -> None:
        self._names, self._template, self._rate = names, template, rate
        self._parts, self._limits = [], []
        for k in range(int(numbers.max()) + 1):
            inside = numbers == k
            others = rows.select(~inside)
            limits, level = _fit(others, rate, template) if others.duration else (np.empty(0), None)
            if level:
                self._parts.append(rows.select(inside))
                self._limits.append(limits)
        self._time = np.array([part.duration for part in self._parts])
        self._found = [[self._judge(k, 1.0) for k in range(len(self._parts))]]

    def _judge(self, k: int, factor: float) -> tuple[int, float]:
        """Return the number of alarms in a part, and their time [s]."""
        part = self._parts[k]
        judged = _detect(
            part, self._names, _thresholds(self._names, self._template, factor * self._limits[k])
        )
        return int(judged.begins.sum()), float(judged.alarm.mean() * part.duration)

    def _chosen(self, without: int | None = None) -> int:
        """Return the number of the first factor at which the parts have alarms at the rate, or at most one."""
        counted = np.arange(len(self._parts)) != without
        for k in range(len(FACTORS)):
            if k == len(self._found):
                self._found.append(
                    [self._judge(part, FACTORS[k]) for part in range(len(self._parts))]
                )
            count = sum(
                one[0] for one, counts in zip(self._found[k], counted, strict=True) if counts
            )
            if count <= max(1.0, self._rate * self._time[counted].sum()):
                break
        return k

    def factor(self) -> float:
        """Return the smallest factor with which the alarms of held-out parts have the requested rate."""
        return float(FACTORS[self._chosen()])

    def alarms(self) -> tuple[int, float]:
        """Return number and time [s] of the alarms, in each part with the factor from the others."""
        found = [self._found[self._chosen(k)][k] for k in range(len(self._parts))]
        return sum(one[0] for one in found), sum(one[1] for one in found)


def _fit(rows: Rows, rate: float, template: AlarmThresholds) -> tuple[Array, Level | None]:
    """Return thresholds of all detectors for a rate. Detectors at rest get its share by time at rest, at most half."""
    options = template.release, template.hold_off
    rest = rows.cut(rows.rest).select(rows.rest)
    share = min(0.5, rest.duration / rows.duration)
    limits, level = fit_limits(rows, rows.values, rate * (1.0 - share), *options)
    changes = np.full(len(limits) - 1, math.inf)
    if rest.duration >= MIN_REST:
        changes, _ = fit_limits(
            rest, rest.changes, rate * share * rows.duration / rest.duration, *options
        )
        changes = np.maximum(changes, MIN_RATIO * limits[:-1])
    return np.append(limits, changes), level


def _thresholds(names: Sequence[str], template: AlarmThresholds, limits: Array) -> AlarmThresholds:
    """Return the thresholds of all detectors; those of inf are omitted."""
    n = len(names) + 2
    (*joints, torque, norm), (*rest_joints, rest_torque) = limits[:n].tolist(), limits[n:].tolist()
    moving, rest = (
        {name: limit for name, limit in zip(names, one, strict=True) if limit < math.inf}
        for one in (joints, rest_joints)
    )
    return replace(
        template,
        joints=moving,
        external_torque=torque,
        norm=norm,
        rest_joints=rest,
        rest_external_torque=rest_torque,
    )


def _detect(rows: Rows, names: Sequence[str], thresholds: AlarmThresholds) -> Judged:
    torque, r = np.split(rows.x, 2, axis=1)
    valid, detector, given = (
        np.ones(len(r), dtype=bool),
        AlarmDetector(names, thresholds),
        (rows.values, rows.changes),
    )
    return detector.judge(
        rows.stamps, r, torque, valid, rows.starts, given, velocity=rows.speed[:, None]
    )


def _warnings(result: Calibration, alarm_time: float) -> list[str]:
    """Return why the thresholds may be wrong."""
    asked, best, rate = map(format_rate, (result.asked, result.vouched, result.rate))
    warnings = {
        f"too short for {asked}: {result.duration:.4g} s can demonstrate at best {best}; "
        f"record {UNSEEN / result.asked:.3g} s without an alarm": result.vouched > result.asked,
        f"alarms overlap: thresholds are from {result.peaks} maxima of one second each": result.method
        == "blocks",
        f"parts of the recordings differ: {result.held_out} alarms by thresholds from the other parts, {rate}, "
        f"active {alarm_time:.0%} of the time": (
            result.rate_interval[0] > result.asked or alarm_time > MAX_ALARM_TIME
        ),
    }
    return [text for text, applies in warnings.items() if applies]
