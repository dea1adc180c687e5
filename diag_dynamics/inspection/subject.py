# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is inspected: a robot's text, and where the library accepts it, its model and how that moves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from diag_dynamics.inspection.description import Description
from diag_dynamics.inspection.findings import Finding
from diag_dynamics.inspection.motion import Motion
from diag_dynamics.model import RobotModel

NEGLIGIBLE = 1e-5
"""Share of the robot's mass below which a link's inertia changes results less than rounding of the URDF's numbers does."""


class Subject(NamedTuple):
    """A robot under inspection.

    Attributes
    ----------
    description : Description
    model : RobotModel or None
        None where the library refuses the robot.
    motion : Motion or None
        None without a model, or of one that cannot move.
    """

    description: Description
    model: RobotModel | None
    motion: Motion | None

    @property
    def total_mass(self) -> float:
        """[kg]."""
        return self.description.total_mass

    def is_negligible(self, mass: float | None) -> bool:
        """Whether a mass is next to nothing beside that of the robot."""
        return not mass or mass < NEGLIGIBLE * self.total_mass


Check = Callable[[Subject], Iterable[Finding]]
"""A check looks at one thing and tells what it has found; nothing, if all is well."""


def about_links(
    severity: str,
    check: str,
    what: str,
    values: dict[str, float],
    unit: str = "",
    remedy: str = "",
    worst: Callable[[float], float] = abs,
) -> Iterator[Finding]:
    """A finding of links, if there are any; with a number each if that has a unit, the largest by `worst` first."""
    if values:
        names, shown = _in_order(values, unit, worst)
        yield Finding(severity, check, what, links=names, values=shown, unit=unit, remedy=remedy)


def about_joints(
    severity: str,
    check: str,
    what: str,
    values: dict[str, float],
    unit: str = "",
    remedy: str = "",
    worst: Callable[[float], float] = abs,
) -> Iterator[Finding]:
    """A finding of joints, as :func:`about_links`."""
    if values:
        names, shown = _in_order(values, unit, worst)
        yield Finding(severity, check, what, joints=names, values=shown, unit=unit, remedy=remedy)


def least(value: float) -> float:
    """Order in which the least value is the worst."""
    return -value


def _in_order(
    values: dict[str, float], unit: str, worst: Callable[[float], float]
) -> tuple[tuple[str, ...], dict[str, float]]:
    if not unit:
        return tuple(values), {}
    names = tuple(sorted(values, key=lambda name: worst(values[name]), reverse=True))
    return names, {name: float(values[name]) for name in names}


def named(names: Sequence[str]) -> dict[str, float]:
    """Names without numbers."""
    return dict.fromkeys(names, 0.0)
