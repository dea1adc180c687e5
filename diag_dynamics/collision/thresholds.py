# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds of collision detection, with hysteresis and hold-off."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import mapping, not_negative, number, positive
from diag_dynamics.entries import ALL, by_name

RELEASE, HOLD_OFF, STANDING = 0.7, 0.5, 2.0

TORQUE, NORM = "external_torque", "norm"
"""Names of the detectors of ‖m r‖ and of |r|; the others have the names of joints."""


@dataclass(frozen=True)
class AlarmThresholds:
    """Thresholds of an :class:`~diag_dynamics.AlarmDetector`; inf switches a detector off.

    Parameters
    ----------
    joints : mapping
        |m r| by joint [N m, N], ``*`` for all other joints. A joint that is missing has none.
    external_torque : float
        ‖m r‖ of all joints [N m].
    norm : float
        |r| [J^½/s].
    release : float
        Fraction of its threshold below which a detector releases.
    hold_off : float
        Time after an alarm within which another rise belongs to it [s].
    standing : float
        Age of an alarm from which an offset follows the torque [s]; inf: never. See docs/alarms.md.

    Raises
    ------
    InputError
        A value is wrong.
    """

    joints: Mapping[str, float] = field(default_factory=dict)
    external_torque: float = math.inf
    norm: float = math.inf
    release: float = RELEASE
    hold_off: float = HOLD_OFF
    standing: float = STANDING

    def __post_init__(self) -> None:
        for name, value in mapping("joints", self.joints).items():
            _check(f"threshold of joint '{name}'", value, "[N m]")
        _check(TORQUE, self.external_torque, "[N m]")
        _check(NORM, self.norm, "[J^½/s]")
        _check("standing", self.standing, "[s]")
        number("release", self.release, "a fraction > 0 and <= 1", lambda x: 0.0 < x <= 1.0)
        not_negative("hold_off", self.hold_off, "[s]")

    def limits(self, names: Sequence[str]) -> Array:
        """Return the thresholds of these joints, of ‖m r‖ and of |r|; inf without one.

        Raises
        ------
        InputError
            There is a threshold of another joint.
        """
        joints = by_name("alarm.joints", self.joints, (*names, ALL))
        limits = [joints.get(name, math.inf) for name in names]
        return np.array([*limits, self.external_torque, self.norm])


def _check(name: str, value: float, unit: str) -> None:
    if value != math.inf:
        positive(name, value, unit)
