# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of joints, elements and attributes. Each yields fields of remarks."""

from __future__ import annotations

import numpy as np

from diag_dynamics.description.description import SINGLE
from diag_dynamics.inspection.inspected_robot import Found, Robot

TURNS = (
    20.0  # limit of a revolute joint, three turns, that the same number in degrees exceeds [rad]
)
TRAVEL = 10.0  # limit of a slide that a number in mm exceeds [m]
FAST = 100.0  # velocity that no driven joint has [rad/s, m/s]; a propeller may
STRONG = (
    10000.0  # effort that few joints have [N m, N]; the first joint of large arms has 20 000 N m
)

BEYOND = {"revolute": ("wide", TURNS), "prismatic": ("long", TRAVEL)}

OF_INERTIAL = ("mass", "inertia", "origin")
OF_JOINT = ("origin", "axis", "limit", "mimic", "parent", "child", "dynamics")
ONCE = {"link": ("inertial",), "inertial": OF_INERTIAL, "geometry": ("*",), "joint": OF_JOINT}
"""Children that an element has once."""


def elements(robot: Robot) -> Found:
    """Find repeated elements; readers differ in which one they read."""
    for element in robot.elements:
        name = element.get("name", "")
        for part in element.iter(*ONCE):
            for tag in ONCE[part.tag]:
                if len(part.findall(tag)) > 1:
                    words = tag.replace("*", "shape"), name  # a finding each
                    yield "repeated", name, 0.0, words, element.tag


def attributes(robot: Robot) -> Found:
    """Find unknown attributes, axes without xyz, angles in degrees, and forces that are omitted."""
    return iter(robot.description.remarks)


def transmissions(robot: Robot) -> Found:
    """Find rotor inertias of transmissions."""
    if not robot.is_mjcf:
        rotors = {joint.name: joint.armature for joint in robot.joints if joint.armature}
        yield from (("rotor", name, inertia) for name, inertia in rotors.items())


def freedom(robot: Robot) -> Found:
    """Find joints of several degrees of freedom, whose state is in no joint state."""
    for joint in robot.joints:
        if joint.type not in (*SINGLE, "fixed"):
            yield "several", joint.name, 0.0


def position_limits(robot: Robot) -> Found:
    """Find position limits that are missing, shut, or in other units."""
    for joint in robot.joints:
        low = joint.lower
        high = joint.upper
        finite = [abs(x) for x in (low, high) if np.isfinite(x)]
        row, maximum = BEYOND.get(joint.type, ("", 0.0))
        if row and not finite:
            yield "unlimited", joint.name, 0.0
        elif row and low == high:
            yield "shut", joint.name, low
        elif row and max(finite) > maximum:
            yield row, joint.name, max(finite)


def effort_limits(robot: Robot) -> Found:
    """Find effort limits that are missing, zero or beyond any drive."""
    return _find_limits(robot, "effort", "strong", STRONG)


def velocity_limits(robot: Robot) -> Found:
    """Find velocity limits that are missing, zero or beyond any drive."""
    return _find_limits(robot, "velocity", "fast", FAST)


def _find_limits(robot: Robot, name: str, row: str, maximum: float) -> Found:
    for joint in robot.joints:
        limit = getattr(joint, name)
        if joint.type not in SINGLE or joint.mimic is not None:
            continue
        if limit <= 0.0:
            yield "zero", joint.name, 0.0, (name,)
        elif limit == np.inf and not robot.is_mjcf:  # an MJCF requires no limits
            yield "no limit", joint.name, 0.0, (name,)
        elif maximum < limit < np.inf:
            yield row, joint.name, limit
