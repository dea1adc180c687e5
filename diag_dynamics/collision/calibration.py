# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds from residuals without contact, and how far they can be trusted."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from textwrap import indent
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, IntArray
from diag_dynamics.atomic_file import write_text
from diag_dynamics.checks import positive
from diag_dynamics.collision.detector import NORM, SECOND, TOTAL, Detector, Judged, Thresholds
from diag_dynamics.collision.residuals import (
    Residuals,
    Rows,
    allowed_alarms,
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
MAX_RATIO = 1.5  # of a threshold to the largest value in the recordings, without a warning
MAX_ALARM_TIME = 0.05  # fraction of the held-out time
UNSEEN = -math.log(0.05)  # expected number of alarms that are none with a probability of 5 %


@dataclass(frozen=True, kw_only=True)
class Calibration(Thresholds):
    """Thresholds of a :class:`Detector`, and how far they can be trusted; see docs/collision.md.

    Attributes
    ----------
    limits, release, hold_off, standing, stiction
        As of :class:`Thresholds`; `limits` has all joints by name, ``total`` and ``norm``.
    gain : float
        Of the observer [1/s].
    friction : bool
        Whether the observer subtracts the friction of the model.
    requested : float
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
    parts : str
        The parts that are held out in turn, for example ``3 recordings``.
    dead_zones : dict
        Largest dead zone of each standing joint in the recordings [N m, N]. Of a joint that never
        stands there, it is the largest that it would have.
    warnings : tuple of str
        Why the thresholds may be wrong.
    contact : Calibration
        Lower thresholds, for contact, and how far they can be trusted; None in those themselves.
    covariance : ndarray, shape (nv, nv)
        Noise of m r: its second moment about zero [N² m², N² of prismatic joints]. None where a
        joint has no noise of its own.
    names : tuple of str
        Degrees of freedom, in the order of `covariance`.
    """

    gain: float
    friction: bool
    requested: float
    duration: float
    alarms: int
    held_out: int
    method: str
    peaks: int
    parts: str = ""
    dead_zones: Mapping[str, float] = field(default_factory=dict)
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
        low, high = (format_rate(rate, self.requested) for rate in self.rate_interval)
        alarms = f"{self.held_out} alarm{'s' * (self.held_out != 1)} in {self.duration:.4g} s"
        rate = format_rate(self.rate, self.requested)
        return f"Held out: {rate} ({low} to {high}, 95 % interval): {alarms}, by {self.parts}."

    @property
    def demonstrable_rate(self) -> float:
        """Lowest rate that this duration can demonstrate: 95 % limit at zero alarms [1/s]."""
        return UNSEEN / self.duration

    @property
    def smallest_torques(self) -> dict[str, float]:
        """Smallest external torque that a standing joint shows [N m, N].

        It is √(threshold² + dead zone²).
        """
        return {
            name: math.hypot(limit, self.dead_zones.get(name, 0.0))
            for name, limit in self.limits.items()
            if name not in (TOTAL, NORM)
        }

    def save(self, path: str | os.PathLike[str], notes: Sequence[str] = ()) -> None:
        """Write a parameter file of the monitor, with `notes` as further comments at its head.

        Raises
        ------
        InputError
            It cannot be written.
        """
        requested = format_rate(self.requested)
        head = [
            f"Thresholds for {requested} false alarms, all detectors together.",
            self.describe_rate(),
        ]
        values: dict[str, Any] = {
            "collision": {
                "threshold": _entries(self),
                "release": float(self.release),
                "hold_off": float(self.hold_off),
                "standing": 0.0 if self.standing == math.inf else float(self.standing),
                "stiction": float(self.stiction),
            }
        }
        if self.contact:
            requested = format_rate(self.contact.requested)
            head.append(f"Contact: {requested} requested. {self.contact.describe_rate()}")
            head += [f"Contact: {text}" for text in self.contact.warnings]
            values["contact"] = {"threshold": _entries(self.contact)}
        head += [*self.warnings, *notes, UNITS]
        torque: dict[str, Any] = {}
        if self.covariance is not None:
            numbers = [float(f"{x:.10g}") for x in self.covariance.ravel().tolist()]
            torque |= {"covariance_joints": list(self.names), "covariance": numbers}
        torque |= {"gain": float(self.gain), "friction": bool(self.friction)}
        lines = [f"# {' '.join(note.split())}\n" for note in head]
        lines.append(yaml_text({"/**": {"ros__parameters": values}}))
        # The monitor rejects a cut file, which has thresholds without a gain or an open brace.
        lines.append(f"    external_torque:\n{indent(yaml_text(torque, in_braces=True), 6 * ' ')}")
        write_text(path, "".join(lines))


UNITS = "Units: gain 1/s; thresholds of joints and total N m, of prismatic joints N; norm J^0.5/s."


def _entries(thresholds: Thresholds) -> list[str]:
    """Return the thresholds as a parameter."""
    return [f"{name}={_rounded_up(limit)!r}" for name, limit in thresholds.limits.items()]


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
    template: Thresholds,
    *,
    false_contacts: float | None = None,
    **trust: Any,
) -> Calibration:
    """Return the Calibration of residuals of an observer.

    It has release, hold-off, `standing` and `stiction` of a template, and further attributes
    `trust`, warnings among them.
    """
    rate = positive("false_alarms", false_alarms, "[1/s]")
    rows = residuals.rows()
    contacts = (
        CONTACT_RATIO * rate
        if false_contacts is None
        else positive("false_contacts", false_contacts, "[1/s]")
    )
    if contacts < rate:
        value, bound = distinct(contacts, rate)
        raise InputError(
            f"false_contacts is {value} 1/s; expected at least {bound} 1/s (false_alarms). "
            "Contact has the lower thresholds."
        )
    trust = {"warnings": (), **trust}
    result = _calibrate_rows(rows, names, rate, template, trust)
    contact = _calibrate_rows(rows, names, contacts, template, trust, result.of_names(names))
    warnings = [*trust["warnings"], *result.warnings]
    if joint := singular_joint(names, residuals.covariance):
        joint = joint if residuals.whole else names[int(np.argmin(residuals.known))]
        warnings.append(
            f"external torque of '{joint}' has no noise of its own: the file gets no covariance"
        )
    return replace(
        result,
        warnings=tuple(warnings),
        contact=contact,
        covariance=None if joint else residuals.covariance,
        names=tuple(names),
    )


def _calibrate_rows(
    rows: Rows,
    names: Sequence[str],
    rate: float,
    template: Thresholds,
    trust: Mapping[str, Any],
    upper: Array | None = None,
) -> Calibration:
    """Return thresholds for a rate, no higher than `upper`, with the alarms of held-out parts."""
    options = rate, template.release, template.hold_off
    limits, level = fit_limits(rows, *options)
    duration = rows.duration
    if level is None:
        raise InputError(
            f"the recordings have {duration:.3g} s with fewer than four separate peaks, "
            "too few for a threshold. Record a longer motion."
        )
    numbers, parts = part_numbers(rows)
    held_out = _HeldOut(rows.cut(numbers), numbers, names, rate, template)
    limits = limits * held_out.factor()
    if upper is not None:
        limits = np.minimum(limits, upper)
    thresholds = _thresholds(names, template, limits)
    alarms, alarm_time = held_out.alarms()
    result = Calibration(
        **vars(thresholds),
        **trust,
        requested=rate,
        duration=duration,
        alarms=int(_detect(rows, names, thresholds).begins.sum()),
        held_out=alarms,
        method=level.method,
        peaks=level.peaks,
        parts=parts,
    )
    longest = MAX_ALARM_TIME if upper is None else 1.0  # contact may be on for long
    warnings = _warnings(result, alarm_time / duration, longest)
    if upper is None and (text := held_out.describe_largest()):
        warnings.append(text)
    ratios = np.where(limits < math.inf, limits, 0.0) / rows.values.max(axis=0, initial=1e-300)
    if upper is None and ratios.max() > MAX_RATIO:
        name = (*names, TOTAL, NORM)[int(np.argmax(ratios))]
        warnings.append(
            f"extrapolated: the threshold of '{name}' is {ratios.max():.3g} times the largest "
            "value in the recordings; record longer"
        )
    return replace(result, warnings=tuple(warnings))


class _HeldOut:
    """Alarms of each part by thresholds from the other parts, times a factor."""

    def __init__(
        self,
        rows: Rows,
        numbers: IntArray,
        names: Sequence[str],
        rate: float,
        template: Thresholds,
    ) -> None:
        self._rows = rows
        self._names = names
        self._template = template
        self._rate = rate
        self._parts = []  # and thresholds from the others
        for k in range(int(numbers.max()) + 1):
            outside = rows.select(numbers != k)
            if not outside.duration:
                continue
            limits, level = fit_limits(outside, rate, template.release, template.hold_off)
            if level:
                self._parts.append((rows.select(numbers == k), limits))
        self._judge = cache(self._count)

    def _count(self, k: int, factor: float) -> tuple[int, float]:
        """Return the number of alarms in a part, and their time [s]."""
        part, limits = self._parts[k]
        judged = _detect(
            part, self._names, _thresholds(self._names, self._template, factor * limits)
        )
        return int(judged.begins.sum()), float(judged.alarm.mean() * part.duration)

    def describe_largest(self) -> str:
        """Return where the largest value is; empty without an alarm by the largest factor."""
        ratios = [part.values / limits for part, limits in self._parts]
        maxima = np.array([ratio.max() for ratio in ratios])
        largest = maxima.max(initial=0.0)
        if largest <= FACTORS[-1]:
            return ""
        k = int(np.argmax(maxima))
        row, detector = np.unravel_index(np.argmax(ratios[k]), ratios[k].shape)
        part = self._parts[k][0]
        number = part.recording[row]
        begin = self._rows.stamps[self._rows.recording == number][0]
        return (
            f"may contain contact: {(part.stamps[row] - begin) / SECOND:.4g} s after the begin of "
            f"recording {number} there is {largest:.3g} times the threshold of "
            f"'{(*self._names, TOTAL, NORM)[detector]}' from the other parts"
        )

    def factor(self, without: int | None = None) -> float:
        """Return the smallest factor at which held-out parts have the allowed alarms, or one."""
        counted = [k for k in range(len(self._parts)) if k != without]
        time = sum(self._parts[k][0].duration for k in counted)
        allowed = max(1.0, allowed_alarms(self._rate, time))
        for factor in FACTORS:
            if sum(self._judge(k, factor)[0] for k in counted) <= allowed:
                break
        return float(factor)

    def alarms(self) -> tuple[int, float]:
        """Return number and time [s] of the alarms of each part with the factor of the others."""
        counts = [self._judge(k, self.factor(k)) for k in range(len(self._parts))]
        return sum(alarms for alarms, _ in counts), sum(time for _, time in counts)


def _thresholds(names: Sequence[str], template: Thresholds, limits: Array) -> Thresholds:
    """Return the thresholds of all detectors; those of inf are omitted."""
    by_name = zip((*names, TOTAL, NORM), limits.tolist(), strict=True)
    return replace(template, limits={name: limit for name, limit in by_name if limit < math.inf})


def _detect(rows: Rows, names: Sequence[str], thresholds: Thresholds) -> Judged:
    """Return the results of a detector."""
    torque, r = np.split(rows.x, 2, axis=1)
    valid = np.ones(len(r), dtype=bool)
    detector = Detector(names, thresholds)
    return detector.judge(rows.stamps, r, torque, valid, rows.starts, rows.values)


def _warnings(result: Calibration, alarm_time: float, longest: float) -> list[str]:
    """Return why the thresholds may be wrong."""
    warnings = []
    requested = format_rate(result.requested)
    if result.demonstrable_rate > result.requested:
        warnings.append(
            f"too short for {requested}: {result.duration:.4g} s can demonstrate at best "
            f"{format_rate(result.demonstrable_rate)}; "
            f"record {UNSEEN / result.requested:.3g} s without an alarm"
        )
    if result.method == "blocks":
        warnings.append(
            f"alarms overlap: thresholds are from {result.peaks} maxima of one second each"
        )
    if result.rate_interval[0] > result.requested or alarm_time > longest:
        warnings.append(
            f"parts of the recordings differ: {result.held_out} alarms by thresholds from the "
            f"other parts, {format_rate(result.rate)}, active {alarm_time:.0%} of the time"
        )
    return warnings
