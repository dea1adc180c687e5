# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a touch would cost, point by point, for the page, beside what half of the robot's mass would say."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.contact import Contact, ContactPoints, simplified_mass
from diag_dynamics.model import RobotModel
from diag_dynamics.page.layout import finite


class Touch(NamedTuple):
    """Contact at some points of a robot, at one state."""

    t: float
    """Stamp of the state [s]."""
    names: list[str]
    """Of the points, (n,)."""
    links: list[str]
    """That they are on, (n,)."""
    position: Array
    """In the root link's axes [m], shape (n, 3)."""
    speed: Array
    """Along the point's motion [m/s], shape (n,)."""
    mass: Array
    """Reflected mass along it [kg], shape (n,); 0 where the point rests."""
    energy: Array
    """Transferable energy [J], shape (n,)."""
    allowed: Array
    """Allowed speed [m/s], shape (n,); inf without a limit."""
    worst: int
    """Index of the worst point; -1: none."""
    estimated: bool
    """Whether a velocity was estimated."""


def mass_of_half(model: RobotModel) -> float:
    """M/2 + m_L [kg]: half the mass of the links that move, and all payloads on these; ISO/TS 15066's simplified mass."""
    # Body 0 is the root link's, which a fixed base keeps where it is.
    moving = {name for name in model.link_names if model.floating_base or model.placement_in_body(name)[0] > 0}
    links = [model.link_names[index] for index in model.links["index"]]
    total = sum(float(mass) for name, mass in zip(links, model.links["mass"], strict=True) if name in moving)
    carried = sum(float(payload.mass) for name, payload in model.payloads.items() if name in moving)
    return simplified_mass(total - carried, carried)


def told(touch: Touch, model: RobotModel) -> bytes:
    """A :class:`Touch` as JSON: ``t``, ``half`` (mass_of_half), ``worst``, ``estimated``, ``points``.

    A point has name, link, position, speed, mass, energy, allowed (null without a limit) and margin, as of
    :class:`Contact`.
    """
    with np.errstate(invalid="ignore"):
        margin = finite(touch.allowed - np.maximum(touch.speed, 0.0))
    numbers = [finite(row) for row in (touch.speed, touch.mass, touch.energy, touch.allowed)]
    place = finite(np.ravel(touch.position))
    places = zip(place[0::3], place[1::3], place[2::3], strict=True)
    rows = zip(touch.names, touch.links, places, *numbers, margin, strict=True)
    points = [
        {
            "name": name,
            "link": link,
            "position": position,
            **dict(zip(("speed", "mass", "energy", "allowed", "margin"), values, strict=True)),
        }
        for name, link, position, *values in rows
    ]
    said: dict[str, Any] = {"t": touch.t, "half": mass_of_half(model), "worst": int(touch.worst)}
    return json.dumps(said | {"estimated": bool(touch.estimated), "points": points}, allow_nan=False).encode()


def kept_of(contact: Contact) -> Array:
    """Contact at T states as a report keeps it, shape (T, 4 + 2n + number of entries with a limit).

    The worst entry, where its worst point is [m], speeds [m/s], and the logarithms to the base 10 of reflected masses [kg]
    and of the allowed speeds [m/s] of entries that have one. What is zero or infinite of these is not known then.
    """
    worst, states = contact.worst, np.arange(len(contact.nu))
    place = np.where(worst[:, None] < 0, np.nan, contact.position[states, worst])
    with np.errstate(divide="ignore"):
        logarithms = np.log10(contact.reflected_mass), np.log10(contact.allowed_speed[:, contact.points.limited])
    return np.concatenate([worst[:, None], place, contact.speed, *logarithms], axis=1)


def kept_width(points: ContactPoints) -> int:
    """Numbers that :func:`kept_of` gives of a state."""
    return 4 + 2 * len(points) + int(points.limited.sum())


def kept_about(points: ContactPoints) -> list[dict[str, Any]]:
    """Whose numbers :func:`kept_of` gives, for JSON: ``name``, ``link``, and whether they are ``limited``, ``directed``."""
    entries = zip(points.names, points.links, points.limited.tolist(), points.directed.tolist(), strict=True)
    return [dict(zip(("name", "link", "limited", "directed"), entry, strict=True)) for entry in entries]
