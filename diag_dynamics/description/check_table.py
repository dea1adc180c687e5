# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""All checks of robots: severity, unit, text and remedy of each; and warnings.

`load_urdf` warns of those that have a category of warnings; `inspect` shows all. Their conditions
are in `remarks.py` for elements of a URDF and inertias, and in the package `inspection` for the
rest.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from inspect import currentframe
from typing import NamedTuple

from diag_dynamics.description.description import Remark
from diag_dynamics.exceptions import InertiaWarning, ModelWarning
from diag_dynamics.text import short

MAX_MISTAKES = 10  # mistakes that a warning lists

MEASURED = "Give measured ones, or those of CAD."
UNITS = "Is it in kg m², about the centre of mass, and of this link?"
RATIO = "radius of gyration over the distance of the farthest point"
EXCESS = "excess of the largest principal moment over the sum of the others"
GRAVITY = "gravity exceeds the effort limit in some poses, at most by the factor"


class Check(NamedTuple):
    """A check of links or joints: severity, unit of its numbers, text with fields, and remedy."""

    severity: str
    unit: str
    text: str
    remedy: str
    ascending: bool = False  # the smallest number is the worst
    warning: type[ModelWarning] | None = None  # load_urdf warns of it, too
    kind: str = "link"


LINKS = {
    "rejected": Check("error", "", "{}", ""),
    "start": Check("warning", "", "{}", ""),
    "omitted": Check(
        "note",
        "",
        "forward and inverse dynamics omit: {}",
        "M, C, ν and K do not depend on it.",
        warning=ModelWarning,
    ),
    "negative": Check(
        "warning",
        "kg m²",
        "the smallest principal moment of inertia is negative",
        "Correct the inertia in the URDF.",
        warning=InertiaWarning,
    ),
    "triangle": Check(
        "warning",
        "%",
        f"inertias of no rigid body: {EXCESS}",
        "Give it about the centre of mass, in kg m², in the inertial's axes.",
        warning=InertiaWarning,
    ),
    "rounded": Check(
        "note",
        "%",
        f"inertias of negligible mass: {EXCESS}",
        "No effect on results. Remove the <inertial>.",
    ),
    "massless": Check(
        "error", "", "no link has mass: no dynamics; links without <inertial>", MEASURED
    ),
    "moving": Check("warning", "", "moving links with geometry but without <inertial>", MEASURED),
    "point": Check(
        "warning",
        "kg",
        "mass with an inertia of zero: a point mass, which rotates without effort",
        "Give the moments of inertia.",
    ),
    "no mass": Check("warning", "", "inertia without mass, which is impossible", "Give the mass."),
    "outside": Check(
        "warning",
        "m",
        "centre of mass outside of the geometry's bounding box, by",
        "Is the inertial's origin in the link's axes, and are visuals where the link is?",
    ),
    "large": Check("warning", "1", f"inertia too large for the geometry: {RATIO}", UNITS),
    "idle": Check(
        "note",
        "1",
        f"inertia too large for the geometry, no effect on a fixed base: {RATIO}",
        "Usual for identified parameters. A floating base needs correct inertias.",
    ),
    "small": Check("note", "1", f"inertia nearly that of a point: {RATIO}", UNITS, True),
    "identity": Check(
        "warning",
        "m",
        "placeholder of 1 kg m² about all axes, that of a ball of diameter",
        MEASURED,
    ),
    "unreadable": Check(
        "warning",
        "",
        "unreadable geometry: {}",
        "Put meshes where the URDF says, or their package into ROS_PACKAGE_PATH.",
    ),
}

JOINTS = {
    "rotor": Check(
        "note",
        "kg m², kg",
        "rotor inertia N²J of <transmission>, part of the model",
        "Other readers ignore it. The option armature, or that of a file, replaces it.",
    ),
    "repeated": Check(
        "warning",
        "",
        "more than one <{}>; the first one counts",
        "Remove the other.",
    ),
    "unlimited": Check(
        "warning",
        "",
        "no position limits, which URDF requires: unlimited here",
        "Give <limit lower= upper=>, or make the joint continuous.",
    ),
    "shut": Check(
        "warning",
        "rad, m",
        "lower limit = upper limit: the joint cannot move",
        "Correct the limits, or make the joint fixed.",
    ),
    "wide": Check("warning", "rad", "limits beyond three turns", "Are they in degrees?"),
    "long": Check("note", "m", "limits beyond 10 m", "Are they in mm?"),
    "no limit": Check(
        "note", "", "no {} limit: treated as unlimited", "Give that of the data sheet."
    ),
    "zero": Check(
        "warning",
        "",
        "{} limit of zero: no controller moves the joint",
        "Give that of the data sheet.",
    ),
    "strong": Check(
        "note",
        "N m, N",
        "effort limit above that of any drive",
        "Placeholder or wrong unit?",
    ),
    "fast": Check(
        "note",
        "rad/s, m/s",
        "velocity limit above that of any drive",
        "Placeholder or wrong unit?",
    ),
    "several": Check(
        "note",
        "",
        "several degrees of freedom: nodes, analyse, identify, calibrate and excite reject it",
        "Make it joints of one degree of freedom. A moving root needs no joint, but floating_base.",
    ),
    "singular": Check(
        "error",
        "kg m², kg",
        "joints that move no inertia make the mass matrix singular; with D",
        "Give their links inertia, or lock the joints, as the other checks do (other commands: "
        "--set massless=lock).",
    ),
    "mimic": Check(
        "error",
        "",
        "{}",
        "Correct <mimic>, or take the joint as independent, as the other checks do (other "
        "commands: --set mimic=free).",
    ),
    "quick": Check(
        "note",
        "ms",
        "no rotor inertia: the effort limit accelerates the joint to its velocity limit "
        "before a motor's current has risen, in",
        "Give the joint its armature n² J_rotor, or the drive's effort limit.",
        True,
    ),
    "heavy": Check(
        "warning",
        "1",
        GRAVITY,
        "Are masses in kg, and effort limits those of the joint, not of the motor?",
    ),
    "balanced": Check("note", "1", GRAVITY, "Fine with springs or counterweights."),
}

WARNED = {  # mistakes of elements, of links, joints or the robot
    "attribute": Check(
        "warning", "", "<{}> has the unknown attribute {}, ignored", "Is it misspelt?"
    ),
    "angle": Check(
        "warning", "rad", "<origin rpy> is beyond 2π", "Is it in degrees? URDF has radians."
    ),
    "element": Check("warning", "", "<{}> within <{}> is ignored", "Is it misspelt or misplaced?"),
    "no axis": Check(
        "warning",
        "",
        "<axis> has no xyz, so the axis is 1 0 0",
        'Give <axis xyz="…">.',
    ),
    "simulated": Check(
        "warning",
        "",
        "<joint> of <gazebo> is ignored: the model is the open tree without it",
        "Forward dynamics lacks its forces.",
        kind="joint",
    ),
    "plugin": Check(
        "warning",
        "",
        "plugin {} of <gazebo> couples links or joints and is not modelled",
        "Describe it by <loop_joint>, loops, <mimic> or payloads.",
    ),
    "mimic parameter": Check(
        "warning",
        "",
        "parameter 'mimic' of <ros2_control> is not modelled",
        "Give the joint a <mimic>.",
        kind="joint",
    ),
    "ignored rotor": Check(
        "warning",
        "",
        "the rotor inertia of {} is ignored: expected one from 0 to 1e9 kg m² at one joint of one "
        "degree of freedom and one gear ratio other than 0",
        "Give the armature of each joint.",
    ),
}

CHECKS = dict(LINKS)
CHECKS |= {name: check._replace(warning=ModelWarning) for name, check in WARNED.items()}
CHECKS |= {name: check._replace(kind="joint") for name, check in JOINTS.items()}


def grouped(remarks: Iterable[Remark]) -> dict[tuple[Check, str], dict[str, float]]:
    """Return numbers by name of remarks that have the same check and text."""
    groups: dict[tuple[Check, str], dict[str, float]] = {}
    for row, name, number, words, kind in remarks:
        check = CHECKS[row]
        check = check._replace(kind=kind or check.kind)
        numbers = groups.setdefault((check, check.text.format(*words)), {})
        if name is not None:
            numbers[name] = float(number)
    return groups


def warn_of(robot: str, remarks: Iterable[Remark]) -> None:
    """Warn of checks that fail, those of one category at once."""
    texts_by_category: dict[type[ModelWarning], list[str]] = {}
    for (check, text), numbers in grouped(remarks).items():
        if check.warning is None:
            continue
        if numbers:
            name, number = next(iter(numbers.items()))
            others = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
            size = f" ({number:.3g} {check.unit})" if check.unit else ""
            text = f"{check.kind} {short(name)}{others}{size}: {text}"
        texts_by_category.setdefault(check.warning, []).append(f"{text}. {check.remedy}")
    for category, texts in texts_by_category.items():
        if more := texts[MAX_MISTAKES:]:
            text = f"And {len(more)} more mistakes: diag-dynamics inspect lists them."
            texts[MAX_MISTAKES:] = [text]
        warn(f"robot {short(robot)}: {' '.join(texts)}", category)


_handler: ContextVar[Callable[[ModelWarning], object] | None] = ContextVar("handler", default=None)


@contextmanager
def handle_warnings(handler: Callable[[ModelWarning], object]) -> Iterator[None]:
    """Call `handler` with each ModelWarning in this context.

    Python's warnings are shared by threads.
    """
    token = _handler.set(handler)
    try:
        yield
    finally:
        _handler.reset(token)


def warn(text: str, category: type[ModelWarning] = ModelWarning) -> None:
    """Warn of a robot's file by the function of :func:`handle_warnings`, or by a Python warning.

    The warning names the line that called this package.
    """
    if handler := _handler.get():
        handler(category(text))
        return
    frame = currentframe()
    level = 1
    while frame and frame.f_globals.get("__name__", "").startswith("diag_dynamics."):
        frame = frame.f_back
        level = level + 1
    warnings.warn(text, category, stacklevel=level)
