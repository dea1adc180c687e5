# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds of alarms that were found, and how far they can be trusted."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from diag_dynamics.collision.tail import poisson_interval, upper_limit
from diag_dynamics.collision.thresholds import AlarmThresholds
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.spec import as_yaml


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


def _listed(entries: Sequence[str]) -> str:
    return "\n".join(f'        - "{entry}"' for entry in entries)


def _rounded(value: float) -> str:
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
