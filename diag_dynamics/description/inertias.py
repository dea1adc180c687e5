# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertias of payloads and links: their checks, and the bounds that those of rigid bodies keep."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import numbers
from diag_dynamics.description.checks import Remark
from diag_dynamics.description.records import Payload
from diag_dynamics.exceptions import InputError

NEGLIGIBLE = 1e-5  # fraction of the robot's mass that rounding of its numbers exceeds
LARGEST = 1e9  # largest mass, length, inertia or armature accepted, in SI units


def checked_body(
    body: Payload, before: str, after: str = "", may_be_negative: bool = False
) -> Payload:
    """Return a body, whose mass may be negative if it is taken off.

    Errors name a part between two texts.
    """
    mass_name, com_name, inertia_name = (f"{before}{part}{after}" for part in Payload._fields)
    expected = "a finite number [kg]" if may_be_negative else "a finite number >= 0 [kg]"
    mass = float(numbers(mass_name, body.mass, (), expected, LARGEST))
    if mass < 0.0 and not may_be_negative:
        raise InputError(f"{mass_name} is {mass}, expected {expected}.")
    com = numbers(com_name, body.com, (3,), "three finite numbers [m]", LARGEST)
    inertia = numbers(inertia_name, body.inertia, (3, 3), "3 x 3 finite numbers [kg m²]", LARGEST)
    reason = None if mass < 0.0 else not_physical(inertia, mass)
    if reason or np.abs(inertia - inertia.T).max() > 1e-9 * np.abs(inertia).max():
        raise InputError(f"{inertia_name} is {inertia.tolist()}, {reason or 'not symmetric'}.")
    inertia = 0.5 * (inertia + inertia.T)
    com.flags.writeable = inertia.flags.writeable = False
    return Payload(mass, com, inertia)


def negative_moments(inertia: Array, mass: float) -> str:
    """Return the principal moments of an inertia as text if one is negative beyond rounding.

    Otherwise the text is empty.
    """
    moments, rounding = _moments(inertia, mass)
    return _short(moments) if moments[0] < -rounding else ""


def not_physical(inertia: Array, mass: float) -> str | None:
    """Return the reason why no rigid body has an inertia about its centre of mass, or None."""
    if negative := negative_moments(inertia, mass):
        return f"whose principal moments {negative} are not all positive"
    moments, rounding = _moments(inertia, mass)
    if moments[2] > moments[0] + moments[1] + rounding:
        return f"whose principal moments {_short(moments)} break the triangle inequality"
    return None


def unphysical(inertias: Iterable[tuple[str, float, Array, float]]) -> Iterator[Remark]:
    """Find moments of inertia below zero or above the sum of the others, beyond rounding.

    `inertias` has link, mass, inertia, and half a unit of the inertia's last digit.
    """
    rows = list(inertias)
    negligible = NEGLIGIBLE * sum(mass for _, mass, _, _ in rows)
    for name, mass, inertia, half_digit in rows:
        if not_physical(inertia, mass) is None:
            continue
        first, second, third = np.linalg.eigvalsh(inertia)
        rounding = 3.0 * half_digit  # norm of the matrix of errors bounds that of eigenvalues
        excess, is_light = third - first - second, not mass or mass < negligible
        if first < -rounding and not is_light:
            yield Remark("negative", name, first)
        else:
            row = "rounded" if is_light or excess <= 3.0 * rounding else "triangle"
            yield Remark(row, name, 100.0 * excess / max(abs(first), third))


def _moments(inertia: Array, mass: float) -> tuple[Array, float]:
    """Return the principal moments, and their tolerance for rounding to three digits [kg m²]."""
    moments: Array = np.linalg.eigvalsh(np.asarray(inertia, np.float64))
    return moments, float(max(1e-3 * np.abs(moments).max(), 1e-12 * mass))


def _short(numbers: Iterable[float]) -> str:
    return ", ".join(f"{number:.3g}" for number in numbers)
