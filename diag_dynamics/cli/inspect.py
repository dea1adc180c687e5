# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics inspect`: what the library makes of a robot."""

import argparse
import json
import sys
import textwrap
from pathlib import Path

from diag_dynamics.cli.robot_argument import ROBOT, parsed, robot_of
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.text import plain

WIDTH = 80

MOST = 6
"""Names that a finding shows; --json has all."""

JOINED = "\u00a0"
"""Space at which no line ends, until lines are made."""

STATUS = """\
exit status: 0 with nothing above a note, 1 with a warning, 2 with an error or
where there is no such robot. A note is worth knowing; a warning is very likely
a mistake of the URDF; an error is what keeps results from being computed."""


def run(name, arguments):
    """Inspect a robot, or write its URDF with estimated inertias; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog=f"diag-dynamics {name}",
        description="What the library makes of a robot: facts, and some twenty checks of its URDF.",
        epilog=STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("robot", metavar="ROBOT", help=ROBOT)
    parser.add_argument("--json", action="store_true", help="for machines")
    parser.add_argument("--floating-base", action="store_true", help="the root link moves freely")
    parser.add_argument(
        "--estimate-inertias",
        metavar="DENSITY",
        type=float,
        help="do not inspect, but write the URDF with inertias, estimated from geometry at this density [kg/m³], of links "
        "that have none",
    )
    parser.add_argument("-o", "--output", metavar="NEW.urdf", help="where to; a file that is not there yet")
    chosen = parsed(parser, arguments)
    if (chosen.estimate_inertias is None) != (chosen.output is None):
        parser.error("--estimate-inertias DENSITY and -o NEW.urdf belong together")
    try:
        return _run(chosen)
    except DiagDynamicsError as error:
        if chosen.json:
            _print_json({"source": chosen.robot, "status": 2, "error": str(error)})
        else:
            print(f"diag-dynamics {name}: {error}", file=sys.stderr)
        return 2


def _run(chosen):
    """Do what was chosen; what computes is imported only now, which --help and mistakes need not wait for."""
    from diag_dynamics.inspection import inspect_robot

    robot = robot_of(chosen.robot, chosen.xacro_args)
    if chosen.output is not None:
        return _estimate(robot, chosen.estimate_inertias, Path(chosen.output), chosen.json)
    report = inspect_robot(robot, chosen.floating_base)
    if chosen.json:
        _print_json(report.to_dict())
    else:
        print("\n".join(shown(report)))
    return report.status


def _print_json(document):
    print(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False))


def _estimate(robot, density, output, as_json):
    """Write a URDF with estimated inertias; returns the exit status: 1 where some could not be, or none had to be."""
    from diag_dynamics.model.estimation import estimated
    from diag_dynamics.model.robot_source import read_source
    from diag_dynamics.model.sources import folder_of

    if output.exists():
        raise InputError(f"'{output}' is there already, and is not overwritten.")
    described = read_source(robot)
    if described.is_mjcf:
        raise InputError(
            f"--estimate-inertias writes a URDF, but '{robot}' is an MJCF, whose inertias MuJoCo estimates."
        )
    found = estimated(described.text, density, folder_of(robot).resolve())
    if found.estimates:
        try:
            output.write_text(f'<?xml version="1.0" encoding="utf-8"?>\n{found.text}\n', encoding="utf-8")
        except OSError as error:
            raise InputError(f"Cannot write '{output}': {error.strerror}.") from error
    if as_json:
        estimates = [
            {
                "link": one.link,
                "mass": one.mass,
                "centre": list(one.centre),
                "inertia": one.inertia.tolist(),
                "from": one.source,
            }
            for one in found.estimates
        ]
        written = str(output) if found.estimates else None
        document = {"written": written, "density": density, "estimated": estimates, "failed": found.failed}
        _print_json(document)
    else:
        for one in found.estimates:
            print(plain(f"{one.link}: {one.mass:.4g} kg, estimated from {one.source}"))
        for link, reason in found.failed.items():
            print(plain(f"{link}: not estimated: {reason}"), file=sys.stderr)
        if found.estimates:
            print(
                plain(f"Wrote {output}: {len(found.estimates)} links with an inertia estimated at {density:g} kg/m³.")
            )
        elif not found.failed:
            print(
                "Every link with geometry has an <inertial>: nothing to estimate, and nothing written.", file=sys.stderr
            )
    return 0 if found.estimates and not found.failed else 1


def shown(report):
    """Lines of a report for people."""
    from diag_dynamics.inspection import SEVERITIES

    yield from _facts(report)
    for severity in reversed(SEVERITIES):
        findings = [finding for finding in report.findings if finding.severity == severity]
        for number, finding in enumerate(findings):
            if number == 0:
                yield ""
            yield from _finding(finding)
    yield ""
    for state in ("ok", "skipped"):
        names = [check for check, found in report.checks.items() if found == state]
        if names:
            yield from _wrapped(f"{state:9}", ", ".join(names))
    counts = {severity: sum(f.severity == severity for f in report.findings) for severity in reversed(SEVERITIES[1:])}
    yield ", ".join(_count(number, severity) for severity, number in counts.items())


def _count(number, noun):
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _facts(report):
    facts = report.facts
    yield from _wrapped("", facts["name"])
    joints = f"{facts['joints']}, {facts['moving_joints']} of which move"
    rows = [("file", _tail(report.source)), ("links", _links(facts)), ("joints", joints)]
    rows.append(("mass", f"{facts['total_mass']:.5g} kg"))
    if facts["degrees_of_freedom"] is not None:
        base = "floating" if facts["floating_base"] else "fixed"
        rows.insert(3, ("freedom", f"{facts['degrees_of_freedom']} degrees, {base} base '{facts['root_link']}'"))
    if facts["mimic_joints"]:
        groups = facts["coupled_groups"]
        coupled = f" ({_count(len(groups), 'coupled group')})" if groups else ""
        rows.append(("mimic", f"{_some(facts['mimic_joints'])}{coupled}"))
    if facts["locked_joints"]:
        rows.append(("locked", _some(facts["locked_joints"])))
    if facts["poses"]:
        rows.append(("cond M", _range(facts["condition_of_mass_matrix"], "")))
        energy = facts["kinetic_energy_at_velocity_limits"]
        if energy["greatest"]:
            rows.append(("energy", f"{_range(energy, 'J')} with all joints at their velocity limits"))
        for number, (tip, mass) in enumerate(facts["tips"].items()):
            if number == MOST:
                rows.append(("", f"… and {len(facts['tips']) - MOST} more"))
                break
            met = f"a push meets {_range(mass, 'kg')}" if mass["least"] is not None else "its origin stands still"
            rows.append(("" if number else "tips", f"{tip}: {met}"))
        rows.append(("", f"Ranges are those over {facts['poses']} random poses."))
    for title, value in rows:
        yield from _wrapped(f"  {title:9}", value)


def _tail(path):
    """The end of a path, as much as a line holds."""
    room = WIDTH - 11
    return path if len(path) <= room else f"…{path[1 - room :]}"


def _links(facts):
    without = len(facts["links_without_inertial"]) - len(facts["frames"])
    parts = [f"{facts['links']}"]
    if facts["frames"]:
        parts.append(f"{_count(len(facts['frames']), 'mere frame')}")
    if without:
        parts.append(f"{without} with geometry and without inertia")
    return ", ".join(parts)


def _range(found, unit):
    low, high = (found[name] for name in ("least", "greatest"))
    unit = unit and f" {unit}"
    if low is None or high is None:
        return "no bound" if low is None else f"from {low:.3g}{unit} on"
    return f"{low:.3g}{unit}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g}{unit}"


def _finding(finding):
    names = (*finding.links, *finding.joints)
    values = finding.values
    listed = _some([f"{name}{JOINED}{values[name]:.3g}" if name in values else name for name in names])
    unit = f" [{finding.unit.replace(' ', JOINED)}]" if finding.unit and values else ""
    count = f"{_count(len(names), 'link' if finding.links else 'joint')}: " if len(names) > 1 else ""
    yield from _wrapped(
        f"{finding.severity:9}", f"{finding.what.rstrip('.') if names else finding.what}{unit}{':' if names else ''}"
    )
    if names:
        yield from _wrapped(" " * 11, f"{count}{listed}")
    if finding.remedy:
        yield from _wrapped(f"{'':9}→ ", finding.remedy)


def _some(names):
    return ", ".join(names[:MOST]) + (f" … and {len(names) - MOST} more" if len(names) > MOST else "")


def _wrapped(start, text):
    """Lines of a text, indented by as much as it starts after."""
    lines = textwrap.wrap(plain(text), WIDTH - len(start), break_on_hyphens=False) or [""]
    for number, line in enumerate(lines):
        yield f"{' ' * len(start) if number else start}{line.replace(JOINED, ' ')}".rstrip()
