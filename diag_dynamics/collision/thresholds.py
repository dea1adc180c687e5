# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds of alarms: of each joint, of two norms, and how an alarm ends."""

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
"""Names of the two detectors that are no joint's: of ‖m r‖, and of |r|."""


@dataclass(frozen=True)
class AlarmThresholds:
    """What a :class:`~diag_dynamics.AlarmDetector` judges by. What is inf is not judged.

    Parameters
    ----------
    joints : mapping
        |m r| of each joint by name [N m, N], ``*`` for all others; what is not in it is not judged.
    external_torque : float
        ‖m r‖ of all joints [N m].
    norm : float
        |r| [J^½/s].
    release : float
        Part of its threshold below which a detector is quiet again.
    hold_off : float
        Time after an alarm within which a further rise belongs to it [s].
    standing : float
        Time after which what keeps an alarm up is taken for an offset that stands, see docs/alarms.md [s]; inf: never.

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
            _threshold(f"threshold of joint '{name}'", value, "[N m]")
        _threshold(TORQUE, self.external_torque, "[N m]")
        _threshold(NORM, self.norm, "[J^½/s]")
        number("release", self.release, "a part of the threshold, > 0 and <= 1", lambda x: 0.0 < x <= 1.0)
        not_negative("hold_off", self.hold_off, "[s]")
        _threshold("standing", self.standing, "[s]")

    def limits(self, names: Sequence[str]) -> Array:
        """Threshold of each detector: of these joints, of ‖m r‖, of |r|; inf where there is none.

        Raises
        ------
        InputError
            There is a threshold of another joint.
        """
        joints = by_name("alarm.joints", self.joints, (*names, ALL))
        return np.array([*(joints.get(name, math.inf) for name in names), self.external_torque, self.norm])


def _threshold(name: str, value: float, unit: str) -> None:
    if value != math.inf:
        positive(name, value, unit)
