# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Report of an inspection: all checks in order, their findings, and facts."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import IO, Any

import numpy as np

from diag_dynamics import exceptions
from diag_dynamics.description.check_table import grouped, handle_warnings
from diag_dynamics.description.description import Description, Remark
from diag_dynamics.description.mjcf import is_mjcf, read_mjcf
from diag_dynamics.description.urdf import describe_urdf, parse_urdf
from diag_dynamics.description.urdf_text import folder_of, read_text
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.inspection import joint_findings, link_findings, motion
from diag_dynamics.inspection.inspected_robot import Found, Robot
from diag_dynamics.inspection.motion import Motion
from diag_dynamics.model import RobotModel, load_urdf

SEVERITIES = ("ok", "note", "warning", "error")
"""In ascending order: what may be intended, what is very likely a mistake of the URDF, and what
keeps results from being computed, in part or wholly."""

# Skipped for an MJCF, whose geometry is not read
OF_GEOMETRY = link_findings.centre_of_mass, link_findings.gyration, link_findings.meshes
OF_XML = (
    *(
        link_findings.possible_inertias,
        link_findings.missing_inertias,
        *OF_GEOMETRY,
        link_findings.placeholders,
    ),
    *(joint_findings.elements, joint_findings.attributes, joint_findings.transmissions),
    *(
        joint_findings.freedom,
        joint_findings.position_limits,
        joint_findings.effort_limits,
        joint_findings.velocity_limits,
    ),
)
OF_MOTION = motion.rotor_inertia, motion.gravity

CHECKS = ("loading", *(check.__name__ for check in (*OF_XML, *OF_MOTION)))  # names of all checks


@dataclass(frozen=True)
class Finding:
    """A probable mistake in the file of a robot, as a check has found it.

    It names the links and joints concerned, so that tools can point at them.
    """

    severity: str  # one of SEVERITIES
    check: str  # its name
    what: str  # the finding in words
    links: Sequence[str] = ()  # names concerned, the worst first
    joints: Sequence[str] = ()
    values: Mapping[str, float] = field(default_factory=dict)  # number by name, if there is one
    unit: str = ""  # of the numbers
    remedy: str = ""  # what to do


@dataclass(frozen=True)
class Report:
    """Facts about a robot, and findings of all checks of its file.

    `diag-dynamics inspect` prints it or writes it as JSON.
    """

    source: str  # file of the robot
    facts: dict[str, Any]  # by name; None where the robot has no model
    findings: tuple[Finding, ...]  # in descending order of severity
    checks: dict[str, str]  # severity of the worst finding of each; or ok, or skipped

    @property
    def status(self) -> int:
        """Exit status: 0 with nothing above a note, 1 with a warning, 2 with an error."""
        return max((SEVERITIES.index(finding.severity) - 1 for finding in self.findings), default=0)

    def to_dict(self) -> dict[str, Any]:
        """Return the report as JSON has it; numbers that are not finite are None."""
        findings = [asdict(finding) for finding in self.findings]
        for finding in findings:
            finding["values"] = {name: _finite(x) for name, x in finding["values"].items()}
        head = {"source": self.source, "status": self.status, "facts": self.facts}
        return head | {"checks": self.checks, "findings": findings}


def inspect_robot(
    source: str | bytes | os.PathLike[str] | IO[Any],
    floating_base: bool = False,
    loops: Any = None,
) -> Report:
    """Report facts about a robot's model, and findings of the checks of its URDF.

    An error of a robot that can be read is a finding. Joints that move no inertia are locked for
    the other checks.

    Parameters
    ----------
    source : str, bytes, os.PathLike or file
        As of :func:`load_urdf`, or the path of an MJCF. Meshes that the URDF names are read.
    floating_base : bool
        Whether the root link moves freely.
    loops : optional
        Closed loops, as of :func:`load_urdf`.

    Returns
    -------
    Report

    Raises
    ------
    UrdfError
        The robot cannot be read.
    """
    folder = folder_of(source)
    element = None
    if is_mjcf(source):
        description = read_mjcf(source)
    else:
        element = parse_urdf(read_text(source))
        description = describe_urdf(element)
    robot = Robot(description, element, folder)
    with np.errstate(all="ignore"):  # numbers that no robot has are findings
        model, poses, rows = _load(description, {"floating_base": floating_base, "loops": loops})
        robot.stands = model is not None and not model.floating_base
        rows_of = {"loading": iter(rows)}
        for check in OF_XML:
            if not robot.is_mjcf or check not in OF_GEOMETRY:
                rows_of[check.__name__] = check(robot)
        if poses:
            rows_of |= {check.__name__: check(poses) for check in OF_MOTION}
        findings = [finding for name, rows in rows_of.items() for finding in _findings(name, rows)]
        facts = _facts(robot, model, poses)
    findings.sort(key=lambda finding: -SEVERITIES.index(finding.severity))
    checks = dict.fromkeys(CHECKS, "skipped") | dict.fromkeys(rows_of, "ok")
    checks |= {finding.check: finding.severity for finding in reversed(findings)}
    return Report("text" if folder is None else str(source), facts, tuple(findings), checks)


def _findings(check: str, found: Found) -> list[Finding]:
    """Return a finding for each row, with each choice of words, that a check yields."""
    findings = []
    for (row, text), group in grouped(Remark(*fields) for fields in found).items():
        pairs = sorted(group.items(), key=lambda pair: pair[1] if row.ascending else -abs(pair[1]))
        named: dict[str, Any] = {f"{row.kind}s": tuple(dict(pairs))}
        named |= {"values": dict(pairs) if row.unit else {}, "unit": row.unit}
        findings.append(Finding(row.severity, check, text, remedy=row.remedy, **named))
    return findings


def _load(
    description: Description, options: dict[str, Any]
) -> tuple[RobotModel | None, Motion | None, list[Any]]:
    """Return the model, its motion, and rows of errors; options exclude what they can."""
    model = None
    rows = list[Any]()
    for _ in range(3):
        try:
            warnings: list[exceptions.ModelWarning] = []  # checks of the XML repeat most of them
            with handle_warnings(warnings.append):
                model = load_urdf(description, **options)
            of_start = [x for x in warnings if isinstance(x, exceptions.LoopWarning)]
            rows += [("start", None, 0.0, (str(warning),)) for warning in of_start]
            return model, Motion(model) if model.nv else None, rows
        except exceptions.MasslessLinkError as error:
            D = zip(error.joints, error.articulated_inertia, strict=True)
            rows += [("singular", *pair) for pair in D]
            options["massless"] = "lock"
        except exceptions.MimicJointError as error:
            rows += [("mimic", name, 0.0, (str(error),)) for name in error.joints]
            options["mimic"] = "free"
        except DiagDynamicsError as error:
            rows.append(("rejected", None, 0.0, (str(error),)))
            break
    return model, None, rows


def _facts(robot: Robot, model: RobotModel | None, poses: Motion | None) -> dict[str, Any]:
    moving = [joint for joint in robot.joints if joint.type != "fixed"]
    bare = [link for link in robot.links.values() if not link.has_inertial]
    return {
        "name": robot.description.name,
        "links": len(robot.links),
        "joints": len(robot.joints),
        "moving_joints": len(moving),
        "degrees_of_freedom": model.nv if model else None,
        "floating_base": model.floating_base if model else None,
        "root_link": model.root_link if model else None,
        "total_mass": robot.total_mass,
        "mimic_joints": [joint.name for joint in moving if joint.mimic is not None],
        "coupled_groups": [list(group) for group in model.coupled_groups] if model else None,
        "locked_joints": sorted(model.locked_joints) if model else None,
        "links_without_inertial": [link.name for link in bare],
        "frames": [link.name for link in bare if not link.has_geometry],
        "poses": motion.POSES if poses else 0,
        "kinetic_energy_at_velocity_limits": _finite(poses.largest_energy) if poses else None,
    }


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None
