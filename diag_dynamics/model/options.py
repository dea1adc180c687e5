# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Options of load_urdf, checked; an error names the argument and its value."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import mapping, not_negative, numbers
from diag_dynamics.exceptions import InertiaWarning, InputError, ModelWarning
from diag_dynamics.model.joint_types import SINGLE

FRICTION_VELOCITY = 5e-3
"""Default v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s]: estimated velocities at rest are milliradians per second."""

LARGEST = 1e9
"""Largest mass, length, inertia or armature accepted, in SI units."""

LARGEST_GRAVITY = 1000.0
"""Largest component of gravity accepted [m/s²]: a value in mm/s² is beyond it."""


class Payload(NamedTuple):
    """A rigid body attached to a link, in the link's axes.

    Attributes
    ----------
    mass : float
        [kg].
    com : array_like, shape (3,)
        Centre of mass from the link's origin [m].
    inertia : array_like, shape (3, 3)
        About the centre of mass [kg m²]; that of a point by default.
    """

    mass: float
    com: VectorLike = (0.0, 0.0, 0.0)
    inertia: MatrixLike = ((0.0,) * 3,) * 3


class Options(NamedTuple):
    """Arguments of :func:`load_urdf`, checked."""

    floating_base: bool
    gravity: Array
    mimic: str
    massless: str
    locked: dict[str, float]
    armature: dict[str, float]
    effort_offset: dict[str, float]
    payloads: dict[str, Payload]
    max_coupled: int
    held: dict[str, float] | None = None  # joints that massless="lock" has locked; None before that was decided
    friction_velocity: float = FRICTION_VELOCITY
    estimated_links: tuple[str, ...] = ()
    omitted: tuple[str, ...] = ()


def gravity_vector(value: object) -> Array:
    """Return the acceleration of gravity as a new array."""
    return numbers("gravity", value, (3,), "three finite numbers [m/s²]", LARGEST_GRAVITY)


def friction_velocity_of(value: object) -> float:
    """Return v₀ of Coulomb friction."""
    return not_negative("friction_velocity", value, "[rad/s, m/s]")


def armature_by_joint(value: object, robot: Any) -> dict[str, float]:
    """Return the armature by joint name, given one number or a dict."""
    single = [joint.name for joint in robot.joints if joint.type in SINGLE]
    given = {} if value is None else value
    if not isinstance(given, Mapping):
        number = float(numbers("armature", value, (), "a finite number >= 0 or such by joint name"))
        given = dict.fromkeys(single, number)
    checked, known = {}, set(single)
    for name, inertia in given.items():
        if name not in known:
            raise InputError(
                f"armature: {name!r} is not a joint of one degree of freedom of this robot; those are {_some(single)}."
            )
        checked[name] = float(numbers(f"armature of joint '{name}'", inertia, (), "a finite number >= 0", LARGEST))
        if checked[name] < 0.0:
            raise InputError(f"armature of joint '{name}' is {inertia!r}, expected a finite number >= 0.")
    return checked


def _some(names: Sequence[str], most: int = 12) -> str:
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")


def locked_positions(value: object, robot: Any) -> dict[str, float]:
    """Return the positions of locked joints."""
    joints = {joint.name: joint for joint in robot.joints}
    locked = {}
    for name, position in mapping("locked_joints", value).items():
        if name not in joints:
            raise InputError(f"locked_joints: '{name}' is not a joint of robot '{robot.name}'.")
        if joints[name].type not in SINGLE:
            raise InputError(f"locked_joints: joint '{name}' is {joints[name].type}, expected one degree of freedom.")
        expected = "a finite number [rad, m]"
        locked[name] = float(numbers(f"locked_joints: position of joint '{name}'", position, (), expected, LARGEST))
    return locked


def checked_payloads(value: object, robot: Any) -> dict[str, Payload]:
    """Return each :class:`Payload` with mass, of read-only arrays."""
    links = {link.name for link in robot.links}
    checked = {}
    for name, given in mapping("payloads", value).items():
        try:
            known = name in links
        except TypeError:
            known = False
        if not known:
            raise InputError(f"payloads: {name!r} is not a link of robot '{robot.name}'.")
        try:
            payload = Payload(*given)
        except TypeError as error:
            raise InputError(f"payloads: '{name}' has {given!r}, expected (mass, com, inertia).") from error
        payload = checked_inertia(_on_link(name), payload)
        if payload.mass > 0.0:
            checked[name] = payload
    return checked


def _on_link(link: str) -> Callable[[str], str]:
    return lambda part: f"payloads: {part} on link '{link}'"


def checked_inertia(where: Callable[[str], str], body: Payload, may_be_negative: bool = False) -> Payload:
    """Return mass, centre and inertia of a rigid body as read-only arrays; `where` names a part in errors.

    Mass may be negative if something is taken off.
    """
    expected = "a finite number [kg]" if may_be_negative else "a finite number >= 0 [kg]"
    mass = float(numbers(where("mass"), body.mass, (), expected, LARGEST))
    if mass < 0.0 and not may_be_negative:
        raise InputError(f"{where('mass')} is {mass}, expected {expected}.")
    com = numbers(where("com"), body.com, (3,), "three finite numbers [m]", LARGEST)
    inertia = numbers(where("inertia"), body.inertia, (3, 3), "3 x 3 finite numbers [kg m²]", LARGEST)
    reason = None if mass < 0.0 else not_physical(inertia, mass)
    if reason or np.abs(inertia - inertia.T).max() > 1e-9 * np.abs(inertia).max():
        raise InputError(f"{where('inertia')} is {inertia.tolist()}, {reason or 'not symmetric'}.")
    inertia = 0.5 * (inertia + inertia.T)
    com.flags.writeable = inertia.flags.writeable = False
    return Payload(mass, com, inertia)


def negative_moments(inertia: Array, mass: float) -> str:
    """Return the principal moments of an inertia as text if one is negative beyond rounding; else an empty text."""
    moments: Array = np.linalg.eigvalsh(np.asarray(inertia, np.float64))
    return _short(moments) if moments[0] < -_rounding(moments, mass) else ""


def _rounding(moments: Array, mass: float) -> float:
    # The moments of plates and rods lie on the bound; rounded to four digits, they are beyond it by this much. A radius
    # of gyration of a micrometre counts as that of a point.
    return float(max(1e-3 * np.abs(moments).max(), 1e-12 * mass))


def not_physical(inertia: Array, mass: float) -> str | None:
    """Return the reason why no rigid body has an inertia about its centre of mass, or None."""
    if negative := negative_moments(inertia, mass):
        return f"whose principal moments {negative} are not all positive"
    moments: Array = np.linalg.eigvalsh(np.asarray(inertia, np.float64))
    rounding = _rounding(moments, mass)
    if moments[2] > moments[0] + moments[1] + rounding:
        return f"whose principal moments {_short(moments)} break the triangle inequality"
    return None


def _short(numbers: Iterable[float]) -> str:
    return ", ".join(f"{number:.3g}" for number in numbers)


_tell: ContextVar[Callable[[str], object] | None] = ContextVar("tell", default=None)


@contextmanager
def warnings_told(tell: Callable[[str], object]) -> Iterator[None]:
    """Call `tell` with the text of each ModelWarning in this context; Python's warnings are shared by threads."""
    token = _tell.set(tell)
    try:
        yield
    finally:
        _tell.reset(token)


def warn_of_inertias(robot: Any, estimated: str, lighter: Container[str] = ()) -> None:
    """Warn of estimated inertias, and of links whose inertia no rigid body can have, but for the `lighter` ones."""
    texts = [estimated] if estimated else []
    for link in robot.links:
        reason = None if link.inertial is None else not_physical(link.inertial.inertia, link.inertial.mass)
        if reason and link.name not in lighter:
            texts.append(
                f"link '{link.name}' of robot '{robot.name}' has an inertia {reason}: no rigid body is like that."
            )
    for text in texts:
        warn(text, InertiaWarning, stacklevel=4)


def warn(text: str, category: type[ModelWarning] = ModelWarning, stacklevel: int = 3) -> None:
    """Warn of a robot's file by the function of :func:`warnings_told`, or by Python's own warning."""
    if tell := _tell.get():
        tell(text)
    else:
        warnings.warn(text, category, stacklevel=stacklevel)
