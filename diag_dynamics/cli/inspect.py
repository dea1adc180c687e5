# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics inspect`: facts about a robot, and checks of its URDF."""

import json
import textwrap

from diag_dynamics.cli import common
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.text import listed, plain

WIDTH = 80

MAX_NAMES = 6  # names that a finding shows; --json has all

EPILOG = (
    "exit status: 0 notes at most, 1 warnings, 2 errors. A note is information. "
    "A warning is very likely a mistake in the URDF. An error prevents results from being computed."
)


def add_arguments(parser):
    """Declare the arguments."""
    common.add_robot(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--floating-base", action="store_true", help="the root link moves freely")
    parser.add_argument("--loops", metavar="FILE.yaml", help="closed loops of the robot")


def run(chosen):
    """Inspect a robot; return the exit status."""
    try:
        robot = common.chosen_robot(chosen)
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
    if energy := facts["kinetic_energy_at_velocity_limits"]:
        text = f"with all joints at their velocity limits, in {facts['poses']} random poses"
        rows.append(("energy", f"at most {energy:.3g} J {text}"))
    for title, value in rows:
        yield from _wrapped(f"  {title:9}", value)


def _links(facts):
    without = len(facts["links_without_inertial"]) - len(facts["frames"])
    parts = [f"{facts['links']}"]
    if facts["frames"]:
        parts.append(f"{_count(len(facts['frames']), 'coordinate frame')}")
    if without:
        parts.append(f"{without} with geometry but no inertia")
    return ", ".join(parts)


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
    whole = {"break_on_hyphens": False, "break_long_words": False}  # paths can be copied
    lines = textwrap.wrap(plain(text), WIDTH - len(start), **whole) or [""]
    for number, line in enumerate(lines):
        yield f"{' ' * len(start) if number else start}{line}".rstrip()
