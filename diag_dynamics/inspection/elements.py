# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of what the XML says of joints and files: limits, axes, mimics, meshes, elements that stand twice."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.inspection.findings import Finding
from diag_dynamics.inspection.subject import Subject, about_joints, about_links, named
from diag_dynamics.model.meshes import find_mesh
from diag_dynamics.model.remarks import TURNS, Remark

TRAVEL = 10.0
"""Length that limits of a slide stay below [m]: a number in mm is above."""

UNIT = 1e-3
"""Difference of an axis' length from 1 that rounding to three digits leaves."""

FAST = 100.0
"""Velocity that no driven joint has [rad/s, m/s]; 955 turns a minute behind a gear. A propeller may."""

STRONG = 10000.0
"""Effort that no joint of a robot has [N m, N]: the largest industrial arms have 20 000 N m at the first."""


def meshes(subject: Subject) -> Iterator[Finding]:
    """Meshes that cannot be found, or measured.

    Dynamics needs none. A viewer shows nothing in their place, and there is nothing to compare masses with.
    """
    lost: dict[str, str] = {}
    strange, not_installed = dict(subject.description.bad_shapes), ""
    for link, shape, error in subject.description.unmeasured():
        reason = str(error).replace(shape.file, _short(shape.file)) if shape.file else str(error)
        reason = reason.replace(" cannot be found:", ":")
        if isinstance(error, InputError):
            not_installed = reason
        elif _is_lost(shape.file, subject.description.folder):
            lost.setdefault(link, reason)
        else:
            strange.setdefault(link, reason)
    if lost:
        what = f"meshes that cannot be found; {next(iter(lost.values()))}"
        remedy = "Put them where the URDF says, or name their package's folder in ROS_PACKAGE_PATH."
        yield from about_links("warning", "meshes", what, named(list(lost)), "", remedy)
    if strange:
        what = f"geometry that cannot be measured; {next(iter(strange.values()))}"
        yield from about_links(
            "note", "meshes", what, named(list(strange)), "", "Checks against geometry leave them out."
        )
    if not_installed:
        yield Finding("note", "meshes", f"meshes are not measured: {not_installed}")


def _short(file: str) -> str:
    """The end of a file's name, which fits into a line."""
    parts = file.split("/")
    return file if len(parts) < 3 else f"…/{'/'.join(parts[-2:])}"


def _is_lost(file: str, folder: Path | None) -> bool:
    try:
        if file:
            find_mesh(file, folder)
    except UrdfError:
        return True
    return False


def elements(subject: Subject) -> Iterator[Finding]:
    """Elements that stand twice where one is read: readers differ in which, so that the same file is two robots."""
    for kind, name, tag in subject.description.twice:
        about = about_links if kind == "link" else about_joints
        what = f"more than one <{tag.rpartition('/')[2].replace('*', 'shape')}>; the first one counts"
        yield from about("warning", "elements", what, named([name]), "", "Take out the other.")


def attributes(subject: Subject) -> Iterator[Finding]:
    """Attributes that URDF has not, unknown versions, axes without xyz and angles in degrees."""
    groups: dict[tuple[str, str], list[Remark]] = {}
    for remark in subject.description.remarks:
        groups.setdefault((remark.kind, remark.what), []).append(remark)
    for (kind, what), remarks in groups.items():
        about = {"link": about_links, "joint": about_joints}.get(kind)
        severity, unit, remedy = "note" if remarks[0].harmless else "warning", remarks[0].unit, remarks[0].remedy
        values = {remark.name: remark.value or 0.0 for remark in remarks}
        if about is None:
            yield Finding(severity, "attributes", what, remedy=remedy)
        else:
            yield from about(severity, "attributes", what, values, unit, remedy)


def transmissions(subject: Subject) -> Iterator[Finding]:
    """Rotor inertias that transmissions give: part of the model, and ignored by readers such as Pinocchio."""
    what = "rotor inertia of <transmission>, reflected to the joint (N²J): part of the model"
    remedy = "Other readers ignore it. The armature of load_urdf, or of a file of parameters, replaces it."
    yield from about_joints("note", "transmissions", what, subject.description.rotors, "kg m², kg", remedy)


def axes(subject: Subject) -> Iterator[Finding]:
    """Axes that are no unit vectors. They are normalized here; a reader that does not scales positions and efforts."""
    lengths = {
        joint.name: float(np.linalg.norm(joint.axis))
        for joint in subject.description.joints
        if joint.axis is not None and joint.kind not in ("fixed", "floating")
    }
    odd = {name: length for name, length in lengths.items() if abs(length - 1.0) > UNIT}
    yield from about_joints("note", "axes", "axes that are no unit vectors, of length", odd, "1", "Normalize them.")


def position_limits(subject: Subject) -> Iterator[Finding]:
    """Position limits that are missing, shut, or in other units.

    URDF asks for <limit> at every revolute and prismatic joint. A range of zero, the default of exporters, leaves the joint
    where it is; 180 is an angle in degrees.
    """
    check = "position_limits"
    missing, shut, wide, long, ignored = [], {}, {}, {}, []
    for joint in subject.description.joints:
        low, high = (None if joint.limit is None else joint.limit[name] for name in ("lower", "upper"))
        largest = max((abs(value) for value in (low, high) if value is not None and np.isfinite(value)), default=0.0)
        if joint.kind == "continuous" and low is not None and high is not None and high > low:
            ignored.append(joint.name)
        if joint.kind not in ("revolute", "prismatic"):
            continue
        if joint.limit is None or (low is None and high is None):
            missing.append(joint.name)
        elif (low or 0.0) == (high or 0.0):
            shut[joint.name] = low or 0.0
        elif joint.kind == "revolute" and largest > TURNS:
            wide[joint.name] = largest
        elif joint.kind == "prismatic" and largest > TRAVEL:
            long[joint.name] = largest
    yield from about_joints(
        "warning",
        check,
        "no position limits, which URDF asks for: taken as unlimited here, and as shut by others",
        named(missing),
        "",
        "Give <limit lower= upper=>, or make the joint continuous.",
    )
    yield from about_joints(
        "warning",
        check,
        "lower limit = upper limit: the joint cannot move",
        shut,
        "rad, m",
        "Open it, or make it fixed.",
    )
    yield from about_joints("warning", check, "limits beyond three turns", wide, "rad", "Are they in degrees?")
    yield from about_joints("note", check, "limits beyond 10 m", long, "m", "Are they in mm?")
    yield from about_joints(
        "note",
        check,
        "position limits at a continuous joint, which has none: ignored",
        named(ignored),
        "",
        "Make it revolute if they hold.",
    )


def effort_limits(subject: Subject) -> Iterator[Finding]:
    """Effort limits that are missing, zero or beyond any drive: controllers saturate at them, simulators scale by them."""
    yield from _limits(subject, "effort", STRONG, "N m, N")


def velocity_limits(subject: Subject) -> Iterator[Finding]:
    """Velocity limits that are missing, zero or beyond any drive: planners go as fast as they say."""
    yield from _limits(subject, "velocity", FAST, "rad/s, m/s")


def _limits(subject: Subject, name: str, most: float, unit: str) -> Iterator[Finding]:
    missing, zero, absurd = [], [], {}
    for joint in subject.description.joints:
        if joint.kind in ("fixed", "floating", "planar") or joint.mimic:
            continue
        value = None if joint.limit is None else joint.limit[name]
        if value is None:
            missing.append(joint.name)
        elif value <= 0.0:
            zero.append(joint.name)
        elif value > most and np.isfinite(value):
            absurd[joint.name] = value
    check = f"{name}_limits"
    yield from about_joints(
        "note",
        check,
        f"no {name} limit: taken as unlimited",
        named(missing),
        "",
        f"Give <limit {name}=> from the data sheet.",
    )
    yield from about_joints(
        "warning",
        check,
        f"{name} limit of zero: whoever keeps to it moves nothing",
        named(zero),
        "",
        f"Give <limit {name}=> from the data sheet.",
    )
    yield from about_joints(
        "note", check, f"{name} limit beyond any drive", absurd, unit, "A placeholder, or another unit?"
    )


def mimic_joints(subject: Subject) -> Iterator[Finding]:
    """Followers that cannot go where their leader takes them.

    A follower is at multiplier times the leader's position plus offset. Where its own range or speed ends before the leader's
    does, one of the two is wrong, and a planner that reads only the leader's drives the follower into its stop.
    """
    joints = {joint.name: joint for joint in subject.description.joints}
    short: dict[str, float] = {}
    slow: dict[str, float] = {}
    for joint in joints.values():
        leader = joints.get(joint.mimic[0]) if joint.mimic else None
        if leader is None or leader.limit is None or joint.limit is None or joint.mimic is None:
            continue
        _, multiplier, offset = joint.mimic
        own, of_leader = joint.range, leader.range
        if own and of_leader:
            reached = sorted(multiplier * x + offset for x in of_leader)
            beyond = max(own[0] - reached[0], reached[1] - own[1])
            if beyond > 0.01 * (reached[1] - reached[0]):
                short[joint.name] = beyond
        speed, wanted = joint.limit["velocity"], leader.limit["velocity"]
        if speed and wanted and abs(multiplier) * wanted > 1.01 * speed:
            slow[joint.name] = abs(multiplier) * wanted / speed
    yield from about_joints(
        "note",
        "mimic_joints",
        "followers whose position limits end before their leader's, by",
        short,
        "rad, m",
        "Let the leader's limits be those at which the follower stops.",
    )
    yield from about_joints(
        "note",
        "mimic_joints",
        "followers that their leader's velocity limit drives faster than their own, by the factor",
        slow,
        "1",
        "Let the leader's limit be the one at which the follower's is kept.",
    )
