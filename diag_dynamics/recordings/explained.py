# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Explained share of the change of energy, and what it says in words: of recordings, and of a monitor's last minute."""

from typing import NamedTuple

WINDOW = 0.1
"""Length of a window [s]: shorter ones have the noise of velocities in dK/dt, longer ones average what is wrong away."""

MAX_GAP = 0.1
"""Time without states beyond which a window begins anew [s]."""

LEAST = 20
"""Windows without which nothing is said."""

STILL = 1e-3
"""Root mean square of dK/dt below which nothing is said [W]: a robot at rest has noise there, and nothing explains it."""

NOTHING, PART = 0.3, 0.8
"""Explained shares below which the balance explains nothing, and only a part."""

CULPRIT = 0.2
"""Share of the sum of all joints' squared residuals from which a joint is named."""

FITS, ALIKE = 0.9, 1.5
"""Squared correlation of the efforts' power with what is needed from which a factor is told, and factors that are none."""


class Variances(NamedTuple):
    """Variances of powers over windows [W²]."""

    residual: float
    """What is needed less the efforts' power."""
    effort: float
    """νᵀε."""
    needed: float
    """dK/dt + νᵀ(ε_g + ε_fric)."""
    kinetic: float
    """dK/dt."""
    weightless: float
    """The residual of efforts without gravity in them: dK/dt + νᵀ(ε_fric − ε)."""


def is_judged(count, square):
    """Whether anything is said of so many windows, dK/dt having this mean square [W²]."""
    return count >= LEAST and square >= STILL**2


def explained_share(residual, change):
    """1 − var(residual) / var(change), from the two variances; None if nothing changes."""
    return float(1.0 - residual / change) if change > 0.0 else None


def culprits_of(names, squares):
    """Names of the joints at which most of the residual is, by the mean squares of their residuals."""
    total = sum(squares) or 1.0
    return [name for name, square in zip(names, squares, strict=True) if square / total >= CULPRIT]


def likely_cause(of):
    """What would explain the motion, in words: gravity, or a factor that all efforts lack; empty if neither does.

    Parameters
    ----------
    of : Variances
    """
    if of.kinetic > 0.0 and 1.0 - of.weightless / of.kinetic >= PART:
        return "gravity seems not to be in the efforts (effort_includes_gravity)"
    together = 0.5 * (of.needed + of.effort - of.residual)
    if of.effort * of.needed <= 0.0 or together**2 < FITS * of.effort * of.needed:
        return ""
    factor = together / of.effort
    if factor < 0.0:
        whose = "the efforts" if 1.0 / ALIKE < -factor < ALIKE else "efforts of some joints"
        return f"{whose} seem to have the wrong sign: times {factor:.3g} all are what is needed"
    if not 1.0 / ALIKE < factor < ALIKE:
        return f"the efforts seem to have another unit: times {factor:.3g} all are what is needed"
    return ""


def judgement(explained, total, culprits=(), cause=""):
    """What the balance says, in words.

    Parameters
    ----------
    explained, total : float or None
        Explained share of dK/dt, and of d(K + U)/dt; None without windows enough.
    culprits : sequence of str
        Joints at which most of the residual is.
    cause : str
        As of :func:`likely_cause`.

    Returns
    -------
    str
        Empty without windows enough.
    """
    if explained is None:
        return ""
    where = f"; most of what is missing is at {', '.join(culprits)}" if culprits else ""
    if explained >= PART:
        return f"the efforts explain {explained:.0%} of the change of kinetic energy"
    remedy = "check the unit of efforts, friction, rotor inertias, payload (docs/recordings.md)"
    if cause:
        remedy = f"{cause}; {remedy}"
    if total is not None and total >= PART and explained < NOTHING:
        return (
            f"kinetic energy changes less than what is not explained; of kinetic and potential energy together the "
            f"efforts explain {total:.0%}: for more, {remedy}"
        )
    if explained >= NOTHING:
        return f"the efforts explain only {explained:.0%} of the change of kinetic energy: {remedy}{where}"
    return f"the balance explains nothing ({explained:.3g}): {remedy}{where}"
