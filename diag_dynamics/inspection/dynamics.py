# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of what the robot does in motion: against its effort and velocity limits, and against the numbers' precision."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.inspection.findings import Finding
from diag_dynamics.inspection.subject import Subject, about_joints, least
from diag_dynamics.model import RobotModel

CURRENT_RISE = 1e-3
"""Time that a motor's current, and so its torque, takes to rise, L/R [s]: a millisecond or more for those of robots."""

BALANCED = 2.0
"""Gravity torque by the effort limit up to which springs or counterweights, which a URDF has no place for, may carry it."""

OFTEN = 0.05
"""Share of poses beyond which the robot is not merely outstretched."""

LOST_DIGITS = 1e8
"""Condition number by which accelerations have half of the 16 digits that they are computed with."""

SPEED = 50.0
"""Speed of a robot's mass on average that is beyond any [m/s]; the tips of the fastest arms have some 10."""


def too_quick(model: RobotModel, D: Array) -> dict[str, float]:
    """Time D q̇_max/τ_max [s] of the joints in which it is less than a motor's current takes to rise; see below.

    Parameters
    ----------
    model : RobotModel
    D : ndarray, shape (poses, nv)
        Articulated inertias [kg m², kg].
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        time = D.max(axis=0) * model.velocity_limit / model.effort_limit
    bounded = np.isfinite(model.velocity_limit) & np.isfinite(model.effort_limit)
    driven = bounded & (model.effort_limit > 0.0) & (model.velocity_limit > 0.0)
    return {name: float(time[k]) for k, name in enumerate(model.dof_names) if driven[k] and time[k] < CURRENT_RISE}


def rotor_inertia(subject: Subject) -> Iterator[Finding]:
    """Joints without the inertia of their motors' rotors.

    A rotor behind a gear of ratio n has n² times its inertia at the joint, which often exceeds that of all links. Few
    URDFs give it, in a <transmission>. Without it the time D q̇_max/τ_max from rest to the velocity limit at the effort
    limit is too short: below a millisecond a motor's current has not risen yet, so no drive reaches it, and no loop at
    1 kHz controls it.
    D is the largest over poses.
    """
    if not subject.motion or not subject.model:
        return
    quick = {name: 1e3 * time for name, time in too_quick(subject.model, subject.motion.D).items()}
    yield from about_joints(
        "note",
        "rotor_inertia",
        "no rotor inertia: at its effort limit the joint is at its velocity limit before the motor's current has risen, in",
        quick,
        "ms",
        "Give load_urdf armature={joint: n² J_rotor}, or an effort limit of the joint's own drive.",
        least,
    )


def gravity(subject: Subject) -> Iterator[Finding]:
    """Gravity torque beyond the effort limit: the robot cannot hold itself; masses are too large, or the limit is too small.

    Of a robot that walks or flies the base is held here, so its legs hang.
    """
    if not subject.motion or not subject.model:
        return
    model = subject.model
    load = np.abs(subject.motion.gravity_torque)
    kept = np.isfinite(model.effort_limit) & (model.effort_limit > 0.0)
    heavy: dict[str, float] = {}
    slight: dict[str, float] = {}
    for k in np.flatnonzero(kept):
        ratio, limit = float(load[:, k].max() / model.effort_limit[k]), model.effort_limit[k]
        if ratio > 1.0:
            clear = ratio > BALANCED and (load[:, k] > limit).mean() > OFTEN
            (heavy if clear else slight)[model.dof_names[k]] = ratio
    remedy = "Are masses in kg, and is the effort limit that of the drive behind its gear?"
    what = "gravity exceeds the effort limit in some poses, at most by the factor"
    yield from about_joints("warning", "gravity", what, heavy, "1", remedy)
    yield from about_joints("note", "gravity", what, slight, "1", "Fine with springs or counterweights.")


def conditioning(subject: Subject) -> Iterator[Finding]:
    """Condition number of the mass matrix over poses: its logarithm is the number of digits that accelerations lose."""
    if not subject.motion or not subject.model:
        return
    worst = float(subject.motion.condition.max())
    if worst > LOST_DIGITS:
        smallest = subject.motion.D.min(axis=0)
        lightest = {subject.model.dof_names[k]: float(smallest[k]) for k in np.argsort(smallest)[:3]}
        digits = 16.0 - np.log10(worst)
        yield from about_joints(
            "note" if digits > 4.0 else "warning",
            "conditioning",
            f"cond M up to {worst:.2g} leaves {max(digits, 0.0):.0f} digits of accelerations; the joints with the least D",
            lightest,
            "kg m², kg",
            "Give these links their inertia, or their joints a rotor's: armature.",
            least,
        )


def kinetic_energy(subject: Subject) -> Iterator[Finding]:
    """Speed that the robot's mass would have on average with all joints at their velocity limits: √(2K/m)."""
    if not subject.motion or not subject.model or not subject.model.total_mass > 0.0:
        return
    model, motion = subject.model, subject.motion
    speed = float(np.sqrt(2.0 * motion.energy_at_limits.max() / model.total_mass))
    if speed > SPEED:
        limit = np.where(np.isfinite(model.velocity_limit), model.velocity_limit, 0.0)
        alone = 0.5 * np.einsum("tkk->tk", motion.M).max(axis=0) * limit**2
        fastest = {model.dof_names[k]: float(limit[k]) for k in np.argsort(-alone)[:3]}
        yield from about_joints(
            "warning",
            "kinetic_energy",
            f"at its velocity limits the robot's mass moves at {speed:.3g} m/s on average; limits that matter most",
            fastest,
            "rad/s, m/s",
            "Is the velocity limit in rad/s, and not in degrees or a placeholder?",
        )
