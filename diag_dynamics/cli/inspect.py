# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics inspect`: facts about a robot, and checks of its URDF."""

import json
import sys
import textwrap
from pathlib import Path

from diag_dynamics.atomic_file import write_text
from diag_dynamics.cli import common
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.text import listed, plain, shortened

WIDTH = 80

MAX_NAMES = 6  # names that a finding shows; --json has all

EPILOG = (
    "exit status: 0 notes at most, 1 warnings, 2 errors. A note is information. "
    "A warning is very likely a mistake in the URDF. An error prevents results from being computed."
)

OUTPUTS = {"-o": "output"}


def add_arguments(parser):
    """Declare the arguments."""
    common.add_robot(parser)
    group = parser.add_mutually_exclusive_group()
    group.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--floating-base", action="store_true", help="the root link moves freely")
    parser.add_argument("--loops", metavar="FILE.yaml", help="closed loops of the robot")
    text = (
        "write a URDF in which links without an inertia have one from geometry "
        "at this density [kg/m³]"
    )
    group.add_argument("--estimate-inertias", metavar="DENSITY", type=float, help=text)
    parser.add_argument(
        "-o", "--output", metavar="NEW.urdf", help="new file of --estimate-inertias"
    )


def run(chosen):
    """Inspect a robot, or write its URDF with estimated inertias; return the exit status."""
    try:
        if (chosen.estimate_inertias is None) != (chosen.output is None):
            raise InputError("--estimate-inertias DENSITY and -o NEW.urdf require each other.")
        robot = common.chosen_robot(chosen)
        if chosen.output is not None:
            return _estimate(robot, chosen.estimate_inertias, Path(chosen.output))
        from diag_dynamics.inspection import inspect_robot

        report = inspect_robot(robot, chosen.floating_base, loops=chosen.loops)
    except DiagDynamicsError as error:
        if not chosen.json:
            raise
        _print_json({"source": chosen.urdf, "status": common.FAILED, "error": str(error)})
        return common.FAILED
    if chosen.json:
        _print_json(report.to_dict())
    else:
        print("\n".join(report_lines(report)))
    return report.status


def _print_json(document):
    print(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))


# --- Estimated inertias


def _estimate(robot, density, output):
    """Write a URDF with estimated inertias; return the exit status."""
    from diag_dynamics.description.geometry import estimated
    from diag_dynamics.description.mjcf import is_mjcf
    from diag_dynamics.description.text import folder_of, read_text

    if output.exists():
        raise InputError(f"-o is '{output}', which exists. Choose another name.")
    if is_mjcf(robot):
        raise InputError(
            f"--estimate-inertias writes a URDF, but '{robot}' is an MJCF. "
            "MuJoCo estimates its inertias."
        )
    result = estimated(read_text(robot), density, folder_of(robot).resolve())
    for estimate in result.estimates:
        mass = f"{estimate.body.mass:.4g} kg, estimated from {estimate.source}"
        print(plain(f"{estimate.link}: {mass} at {density:g} kg/m³"))
    for link, reason in result.failed.items():
        print(shortened(f"{link}: not estimated: {reason}"), file=sys.stderr)
    if not result.estimates:
        why = "" if result.failed else ": no link without <inertial> has geometry"
        print(f"No inertia was estimated{why}. No file was written.", file=sys.stderr)
        return common.DOUBTFUL
    write_text(output, f'<?xml version="1.0" encoding="utf-8"?>\n{result.text}\n')
    common.report_written(output)
    return common.DOUBTFUL if result.failed else common.DONE


# --- Report


def report_lines(report):
    """Yield lines of a report: facts, findings from errors on, other checks, and counts."""
    from diag_dynamics.inspection import SEVERITIES

    yield from _facts(report)
    for severity in reversed(SEVERITIES):
        findings = [finding for finding in report.findings if finding.severity == severity]
        yield from [""] if findings else []
        for finding in findings:
            yield from _finding(finding)
    yield ""
    for state in ("ok", "skipped"):
        names = [check for check, outcome in report.checks.items() if outcome == state]
        if names:
            yield from _wrapped(f"{state:9}", ", ".join(names))
    counts = {
        severity: sum(f.severity == severity for f in report.findings)
        for severity in reversed(SEVERITIES[1:])
    }
    yield ", ".join(_count(number, severity) for severity, number in counts.items())


def _count(number, noun):
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _facts(report):
    facts = report.facts
    yield from _wrapped("", facts["name"])
    rows = [
        ("file", report.source),
        ("links", _links(facts)),
        ("joints", f"{facts['joints']}, {facts['moving_joints']} movable"),
    ]
    if (count := facts["degrees_of_freedom"]) is not None:
        base = "floating" if facts["floating_base"] else "fixed"
        rows.append(("freedom", f"{count} degrees, {base} base '{facts['root_link']}'"))
    rows.append(("mass", f"{facts['total_mass']:.5g} kg"))
    if facts["mimic_joints"]:
        groups = facts["coupled_groups"]
        coupled = f" ({_count(len(groups), 'coupled group')})" if groups else ""
        rows.append(("mimic", f"{listed(facts['mimic_joints'], MAX_NAMES)}{coupled}"))
    if facts["locked_joints"]:
        rows.append(("locked", listed(facts["locked_joints"], MAX_NAMES)))
    if facts["poses"]:
        rows += _ranges(facts)
    for title, value in rows:
        yield from _wrapped(f"  {title:9}", value)


def _ranges(facts):
    """Return rows of the ranges over random poses."""
    rows = [("cond M", _range(facts["condition_of_mass_matrix"], ""))]
    energy = facts["kinetic_energy_at_velocity_limits"]
    if energy["greatest"]:
        rows.append(("energy", f"{_range(energy, 'J')} with all joints at their velocity limits"))
    for number, (tip, mass) in enumerate(facts["tips"].items()):
        if number == MAX_NAMES:
            rows.append(("", f"… and {len(facts['tips']) - MAX_NAMES} more"))
            break
        push = (
            f"effective mass {_range(mass, 'kg')}"
            if mass["least"] is not None
            else "its origin does not move"
        )
        rows.append(("" if number else "ends", f"{tip}: {push}"))
    return [*rows, ("", f"Ranges are over {facts['poses']} random poses.")]


def _links(facts):
    without = len(facts["links_without_inertial"]) - len(facts["frames"])
    parts = [f"{facts['links']}"]
    if facts["frames"]:
        parts.append(f"{_count(len(facts['frames']), 'coordinate frame')}")
    if without:
        parts.append(f"{without} with geometry but no inertia")
    return ", ".join(parts)


def _range(extremes, unit):
    low, high = (extremes[name] for name in ("least", "greatest"))
    unit = unit and f" {unit}"
    if low is None or high is None:
        return "unbounded" if low is None else f"{low:.3g}{unit} or more"
    return f"{low:.3g}{unit}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g}{unit}"


def _finding(finding):
    names = (*finding.links, *finding.joints)
    values = finding.values
    unit = f" [{finding.unit}]" if finding.unit and values else ""
    text = f"{finding.what.rstrip('.') if names else finding.what}{unit}{':' if names else ''}"
    yield from _wrapped(f"{finding.severity:9}", text)
    if names:
        count = (
            f"{_count(len(names), 'link' if finding.links else 'joint')}: "
            if len(names) > 1
            else ""
        )
        texts = [f"{name} {values[name]:.3g}" if name in values else name for name in names]
        yield from _wrapped(" " * 11, f"{count}{listed(texts, MAX_NAMES)}")
    if finding.remedy:
        yield from _wrapped(f"{'':9}→ ", finding.remedy)


def _wrapped(start, text):
    """Yield the lines of a text behind `start`."""
    lines = textwrap.wrap(plain(text), WIDTH - len(start), break_on_hyphens=False) or [""]
    for number, line in enumerate(lines):
        yield f"{' ' * len(start) if number else start}{line}".rstrip()
