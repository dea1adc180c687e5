# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Links and joints from checked XML, where yourdfpy is not installed: it brings 250 MB for meshes that nobody here looks at.

What it gives has the attributes of yourdfpy's objects that are read here, and the same bits.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(eq=False)
class Inertial:
    """Of a link: mass [kg], inertia (3, 3) about the centre of mass [kg m²], and the placement (4, 4) of its axes."""

    mass: float | None
    inertia: np.ndarray | None
    origin: np.ndarray | None


@dataclass(eq=False)
class Link:
    """A link and its inertia, if it has one."""

    name: str
    inertial: Inertial | None


@dataclass(eq=False)
class Limit:
    """Limits of a joint, each None where it is not given."""

    effort: float | None
    velocity: float | None
    lower: float | None
    upper: float | None


@dataclass(eq=False)
class Dynamics:
    """Damping and friction of a joint, as text."""

    damping: str | None
    friction: str | None


@dataclass(eq=False)
class Following:
    """The joint that another one mimics, and how."""

    joint: str
    multiplier: float
    offset: float


@dataclass(eq=False)
class Joint:
    """A joint."""

    name: str
    type: str
    parent: str
    child: str
    origin: np.ndarray | None
    axis: np.ndarray
    limit: Limit | None
    dynamics: Dynamics | None
    mimic: Following | None


@dataclass(eq=False)
class Robot:
    """All of a robot."""

    name: str
    links: list[Link]
    joints: list[Joint]


def read(element):
    """Robot of a checked `<robot>` element, which has nothing but what dynamics needs, and no origins."""
    links = [Link(link.get("name"), _inertial(link.find("inertial"))) for link in element.findall("link")]
    return Robot(element.get("name"), links, [_joint(joint) for joint in element.findall("joint")])


def _joint(element):
    limit, dynamics, mimic = (element.find(tag) for tag in ("limit", "dynamics", "mimic"))
    axis = element.find("axis")
    return Joint(
        element.get("name"),
        element.get("type"),
        element.find("parent").get("link"),
        element.find("child").get("link"),
        None,
        _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0")),
        None if limit is None else Limit(*(_number(limit, name) for name in ("effort", "velocity", "lower", "upper"))),
        None if dynamics is None else Dynamics(dynamics.get("damping"), dynamics.get("friction")),
        None
        if mimic is None
        else Following(mimic.get("joint"), float(mimic.get("multiplier", 1.0)), float(mimic.get("offset", 0.0))),
    )


def _inertial(element):
    if element is None:
        return None
    mass, inertia = element.find("mass"), element.find("inertia")
    return Inertial(
        None if mass is None else float(mass.get("value", 0.0)),
        None if inertia is None else _inertia(inertia),
        None,
    )


def _inertia(element):
    xx, yy, zz = (float(element.get(name, 1.0)) for name in ("ixx", "iyy", "izz"))
    xy, xz, yz = (float(element.get(name, 0.0)) for name in ("ixy", "ixz", "iyz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _numbers(text):
    return np.array([float(part) for part in text.split()])


def _number(element, name):
    text = element.get(name)
    return None if text is None else float(text)
