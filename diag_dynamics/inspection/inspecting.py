# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""All checks of a robot, in order, and the facts beside them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import IO, Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import DiagDynamicsError, InputError, MasslessLinkError, MimicJointError
from diag_dynamics.inspection import dynamics, elements, inertias
from diag_dynamics.inspection.description import Description
from diag_dynamics.inspection.findings import SEVERITIES, Finding, Report
from diag_dynamics.inspection.motion import Motion
from diag_dynamics.inspection.subject import Check, Subject, about_links
from diag_dynamics.model import RobotModel, load_urdf
from diag_dynamics.model.mjcf import Described
from diag_dynamics.model.options import negative_moments, warnings_told
from diag_dynamics.model.robot_source import read_source
from diag_dynamics.model.sources import folder_of

OF_TEXT: dict[str, Check] = {
    "possible_inertias": inertias.possible_inertias,
    "missing_inertias": inertias.missing_inertias,
    "mass_without_geometry": inertias.mass_without_geometry,
    "density": inertias.density,
    "uniform_density": inertias.uniform_density,
    "centre_of_mass": inertias.centre_of_mass,
    "gyration": inertias.gyration,
    "inertia_axes": inertias.inertia_axes,
    "placeholders": inertias.placeholders,
    "sides": inertias.sides,
    "meshes": elements.meshes,
    "elements": elements.elements,
    "attributes": elements.attributes,
    "transmissions": elements.transmissions,
    "axes": elements.axes,
    "position_limits": elements.position_limits,
    "effort_limits": elements.effort_limits,
    "velocity_limits": elements.velocity_limits,
    "mimic_joints": elements.mimic_joints,
}
"""Checks of what the XML says, which need no model."""

OF_GEOMETRY = (
    *("mass_without_geometry", "density", "uniform_density", "centre_of_mass"),
    *("gyration", "inertia_axes", "meshes"),
)
"""Those that compare with geometry, which the description of an MJCF has not."""

OF_MOTION: dict[str, Check] = {
    "rotor_inertia": dynamics.rotor_inertia,
    "gravity": dynamics.gravity,
    "conditioning": dynamics.conditioning,
    "kinetic_energy": dynamics.kinetic_energy,
}
"""Checks of what the robot does in random poses."""

LOADING = "loading"
"""The first check: whether the library accepts the robot."""

CHECKS = (LOADING, *OF_TEXT, *OF_MOTION)
"""Names of all checks."""


def inspect_robot(
    source: str | bytes | os.PathLike[str] | IO[Any],
    floating_base: bool = False,
    xacro_args: Mapping[str, Any] | None = None,
) -> Report:
    """Report what the library makes of a robot.

    What it refuses is a finding, too: checks of the XML go on, and joints that move no inertia are locked for the rest.

    Parameters
    ----------
    source : str, bytes, os.PathLike or file
        As of :func:`load_urdf`, or the path of an MJCF. Meshes that the URDF names are read.
    floating_base : bool
        Whether the root link moves freely; an MJCF says that itself.
    xacro_args : dict, optional
        Arguments of a xacro file, by name.

    Raises
    ------
    UrdfError
        There is no such file, or it is no XML of a robot at all.
    """
    folder, name = folder_of(source), os.fspath(source) if isinstance(source, (str, os.PathLike)) else "text"
    described = read_source(source, xacro_args)
    if floating_base and not described.options.get("floating_base", True):
        raise InputError("floating_base is True; expected False: the MJCF has no free body, or several.")
    if folder is None:
        name = "text"
    description = Description(described.text, folder)
    model, findings = _loaded(described.text, {"floating_base": floating_base, **described.options})
    with np.errstate(all="ignore"):  # of numbers that no robot has, which findings tell of
        motion, more = _motion(model)
        findings = [*_negative(description), *findings, *more] if findings or more else []
        findings += _omitted(described)
        subject, checks = Subject(description, model, motion), {}
        for title, check in OF_TEXT.items():
            found = [] if described.is_mjcf and title in OF_GEOMETRY else list(check(subject))
            checks[title] = "skipped" if described.is_mjcf and title in OF_GEOMETRY else _worst(found)
            findings += found
        for title, check in OF_MOTION.items():
            checks[title] = _worst(found := list(check(subject))) if motion else "skipped"
            findings += found
        facts = facts_of(subject)
    findings.sort(key=lambda finding: -SEVERITIES.index(finding.severity))
    loading = _worst([finding for finding in findings if finding.check == LOADING])
    return Report(str(name), facts, tuple(findings), {LOADING: loading, **checks})


def _worst(findings: list[Finding]) -> str:
    return max((finding.severity for finding in findings), key=SEVERITIES.index, default="ok")


def _omitted(described: Described) -> list[Finding]:
    """What an MJCF has that forward and inverse dynamics omit."""
    remedy = "M, C, ν and K do not depend on it."
    return [
        Finding("note", LOADING, f"forward and inverse dynamics omit: {text}", remedy=remedy)
        for text in described.omitted
    ]


def _loaded(text: str, options: dict[str, Any]) -> tuple[RobotModel | None, list[Finding]]:
    """The model, with what is refused left out where options can, and what was refused."""
    findings: list[Finding] = []
    while True:
        try:
            with warnings_told(lambda said: None):  # possible_inertias tells of them
                return load_urdf(text, **options), findings
        except MasslessLinkError as error:
            findings.append(
                Finding(
                    "error",
                    LOADING,
                    "joints that move no inertia make the mass matrix singular; with D",
                    joints=error.joints,
                    values=dict(zip(error.joints, error.articulated_inertia, strict=True)),
                    unit="kg m², kg",
                    remedy="Give their links inertia (--estimate-inertias DENSITY -o new.urdf does where there is "
                    "geometry), or load with massless='lock', as is done for the other checks.",
                )
            )
            again = {"massless": "lock"}
        except MimicJointError as error:
            remedy = "Mend <mimic>, or load with mimic='free', as is done for the other checks."
            findings.append(Finding("error", LOADING, str(error), joints=error.joints, remedy=remedy))
            again = {"mimic": "free"}
        except DiagDynamicsError as error:
            findings.append(Finding("error", LOADING, str(error)))
            return None, findings
        if again.items() <= options.items():
            return None, findings
        options |= again


def _negative(description: Description) -> list[Finding]:
    """Negative principal moments, the cause of errors about D."""
    least = {
        link.name: float(np.linalg.eigvalsh(link.inertia)[0])
        for link in description.links.values()
        if link.inertia is not None and negative_moments(link.inertia, link.mass or 0.0)
    }
    return list(about_links("error", LOADING, inertias.NEGATIVE, least, "kg m²", inertias.CORRECT))


def _motion(model: RobotModel | None) -> tuple[Motion | None, list[Finding]]:
    """How the model moves, and why that cannot be said if so."""
    if model is None or not model.nv:
        return None, []
    try:
        motion = Motion(model)
        _ = motion.D, motion.M, motion.gravity_torque
    except DiagDynamicsError as error:
        return None, [Finding("error", LOADING, f"in a random pose within the limits: {error}")]
    return motion, []


def facts_of(subject: Subject) -> dict[str, Any]:
    """What a robot is."""
    description, model, motion = subject.description, subject.model, subject.motion
    moving = [joint for joint in description.joints if joint.moves]
    bare = [link.name for link in description.links.values() if not link.has_inertial]
    facts: dict[str, Any] = {
        "name": description.name,
        "links": len(description.links),
        "joints": len(description.joints),
        "moving_joints": len(moving),
        "degrees_of_freedom": model.nv if model else None,
        "floating_base": model.floating_base if model else None,
        "root_link": model.root_link if model else None,
        "total_mass": subject.total_mass,
        "mimic_joints": [joint.name for joint in moving if joint.mimic],
        "coupled_groups": [list(group) for group in model.coupled_groups] if model else None,
        "locked_joints": sorted(model.locked_joints) if model else None,
        "links_without_inertial": bare,
        "frames": [name for name in bare if not description.links[name].has_geometry],
        "poses": motion.poses if motion else 0,
        "condition_of_mass_matrix": _range(motion.condition) if motion else None,
        "kinetic_energy_at_velocity_limits": _range(motion.energy_at_limits) if motion else None,
        "tips": {tip: _range(motion.reflected_mass(tip)) if motion else None for tip in _tips(subject)},
    }
    return facts


def _range(values: Array) -> dict[str, float | None]:
    """Least, median and greatest of a quantity; None of one that is not finite."""
    found = {"least": values.min(), "median": np.median(values), "greatest": values.max()}
    return {name: float(value) if np.isfinite(value) else None for name, value in found.items()}


def _tips(subject: Subject) -> list[str]:
    """Of every body that moves and carries none, the link that is farthest out."""
    parents = {joint.parent for joint in subject.description.joints if joint.moves}
    moved = {joint.child for joint in subject.description.joints if joint.moves}
    tips = []
    for body in subject.description.bodies:
        if body.links[0].name in moved and not parents & set(body.names):
            tips.append(max(body.names, key=lambda name: np.linalg.norm(body.placements[name][:3, 3]).round(9)))
    return tips
