# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of joints, elements and attributes. Each yields rows of the table below."""

from __future__ import annotations

import numpy as np

from diag_dynamics.inspection.urdf import Found, Urdf

TURNS = (
    20.0  # limit of a revolute joint, three turns, that the same number in degrees exceeds [rad]
)
TRAVEL = 10.0  # limit of a slide that a number in mm exceeds [m]
UNIT = 1e-3  # difference of an axis' length from 1 by rounding to three digits
FAST = 100.0  # velocity that no driven joint has [rad/s, m/s]; a propeller may
STRONG = (
    10000.0  # effort that few joints have [N m, N]; the first joint of large arms has 20 000 N m
)

BEYOND = {"revolute": ("wide", TURNS), "prismatic": ("long", TRAVEL)}

OF_INERTIAL = ("mass", "inertia", "origin")
OF_JOINT = ("origin", "axis", "limit", "mimic", "parent", "child", "dynamics")
ONCE = {"link": ("inertial",), "inertial": OF_INERTIAL, "geometry": ("*",), "joint": OF_JOINT}
"""Children that an element has once."""

# fmt: off
ROWS = {  # severity, unit, what, remedy
    "rotor": ("note", "kg m², kg", "rotor inertia N²J of <transmission>, part of the model",
              "Other readers ignore it. The option armature, or that of a file, replaces it."),
    "axis": ("note", "1", "axes that are not unit vectors, of length", "Normalize them."),
    "unlimited": ("warning", "", "no position limits, which URDF requires: unlimited here",
                  "Give <limit lower= upper=>, or make the joint continuous."),
    "shut": ("warning", "rad, m", "lower limit = upper limit: the joint cannot move",
             "Correct the limits, or make the joint fixed."),
    "wide": ("warning", "rad", "limits beyond three turns", "Are they in degrees?"),
    "long": ("note", "m", "limits beyond 10 m", "Are they in mm?"),
    "continuous": ("note", "", "position limits at a continuous joint: ignored",
                   "Make it revolute if they hold."),
    "no limit": ("note", "", "no {} limit: treated as unlimited", "Give that of the data sheet."),
    "zero": ("warning", "", "{} limit of zero: no controller moves the joint",
             "Give that of the data sheet."),
    "strong": ("note", "N m, N", "effort limit above that of any drive", "Placeholder or wrong unit?"),
    "fast": ("note", "rad/s, m/s", "velocity limit above that of any drive", "Placeholder or wrong unit?"),
    "short": ("note", "rad, m", "mimic joints with narrower limits than their source joint, by",
              "Limit the source joint to the range of the mimic joint."),
    "slow": ("note", "1", "mimic joints driven above their velocity limit by their source joint, by the factor",
             "Limit the source joint to the velocity of the mimic joint."),
}
# fmt: on


def elements(urdf: Urdf) -> Found:
    """Find repeated elements; readers differ in which one they read."""
    for element in urdf.elements:
        kind, name = f"{element.tag}s", element.get("name", "")
        for part in element.iter(*ONCE):
            for tag in ONCE[part.tag]:
                if len(part.findall(tag)) > 1:
                    what = f"more than one <{tag.replace('*', 'shape')}>; the first one counts"
                    row = kind, "warning", "", what, "Remove the other."
                    yield row, name, 0.0, name  # a finding each


def attributes(urdf: Urdf) -> Found:
    """Find unknown attributes and versions, axes without xyz and angles in degrees."""
    for remark in urdf.remarks:
        named = remark.kind in ("link", "joint")
        unit = "" if remark.angle is None else "rad"
        row = (f"{remark.kind}s" if named else "links", "warning", unit, "{}", remark.remedy)
        yield row, remark.name if named else None, remark.angle or 0.0, remark.what


def transmissions(urdf: Urdf) -> Found:
    """Find rotor inertias of transmissions."""
    return (("rotor", name, inertia) for name, inertia in urdf.rotors.items())


def axes(urdf: Urdf) -> Found:
    """Find axes that are not unit vectors; they scale positions and efforts in other readers."""
    for joint in urdf.joints:
        length = 1.0 if joint.axis is None else float(np.linalg.norm(joint.axis))
        if abs(length - 1.0) > UNIT and joint.kind not in ("fixed", "floating"):
            yield "axis", joint.name, length


def position_limits(urdf: Urdf) -> Found:
    """Find position limits that are missing, shut, or in other units."""
    for joint in urdf.joints:
        low, high = joint.limit["lower"], joint.limit["upper"]
        finite = [abs(x) for x in (low, high) if x is not None and np.isfinite(x)]
        row, maximum = BEYOND.get(joint.kind, ("", 0.0))
        if joint.kind == "continuous" and low is not None and high is not None and high > low:
            yield "continuous", joint.name, 0.0
        elif row and low is None and high is None:
            yield "unlimited", joint.name, 0.0
        elif row and (low or 0.0) == (high or 0.0):
            yield "shut", joint.name, low or 0.0
        elif row and max(finite, default=0.0) > maximum:
            yield row, joint.name, max(finite)


def effort_limits(urdf: Urdf) -> Found:
    """Find effort limits that are missing, zero or beyond any drive."""
    return _find_limits(urdf, "effort", "strong", STRONG)


def velocity_limits(urdf: Urdf) -> Found:
    """Find velocity limits that are missing, zero or beyond any drive."""
    return _find_limits(urdf, "velocity", "fast", FAST)


def _find_limits(urdf: Urdf, name: str, row: str, maximum: float) -> Found:
    for joint in urdf.joints:
        limit = joint.limit[name]
        if joint.kind in ("fixed", "floating", "planar") or joint.source is not None:
            continue
        if limit is None or limit <= 0.0:
            yield "no limit" if limit is None else "zero", joint.name, 0.0, name
        elif maximum < limit < np.inf:
            yield row, joint.name, limit


def mimic_joints(urdf: Urdf) -> Found:
    """Find mimic joints whose limits end before their source's."""
    joints = {joint.name: joint for joint in urdf.joints}
    for joint in joints.values():
        source = joints.get(joint.source or "")
        if joint.source is None or source is None:
            continue
        if joint.range and source.range:
            low, high = sorted(joint.multiplier * x + joint.offset for x in source.range)
            beyond = max(joint.range[0] - low, high - joint.range[1])
            if beyond > 0.01 * (high - low):
                yield "short", joint.name, beyond
        own, driven = joint.limit["velocity"], source.limit["velocity"]
        if own and driven and abs(joint.multiplier) * driven > 1.01 * own:
            yield "slow", joint.name, abs(joint.multiplier) * driven / own
