# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics identify`: friction, rotor inertias, payloads and inertias from recordings."""

import sys

from diag_dynamics.atomic_file import write_text
from diag_dynamics.cli import common
from diag_dynamics.cli.common import DONE, DOUBTFUL
from diag_dynamics.description.mjcf import is_mjcf
from diag_dynamics.description.urdf_text import read_text
from diag_dynamics.description.urdf_writer import urdf_with
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.fitting import identify
from diag_dynamics.identification.identification_report import write_report
from diag_dynamics.identification.result import require_masses
from diag_dynamics.identification.selection import STEPS
from diag_dynamics.model import JointParameters, Parameters
from diag_dynamics.optional import require
from diag_dynamics.recordings.balance import MIN_EXPLAINED
from diag_dynamics.recordings.sources import open_source
from diag_dynamics.text import Progress, aligned, plain

EPILOG = (
    "exit status: 0 identified, or the model needs nothing; 1 doubtful: less than 80 % of dK/dt "
    "explained on held-out data, or the efforts cannot be verified; 2 not identified, for example "
    "efforts with a wrong unit, sign or order. Requirements of recordings: docs/identification.md."
)

COLUMNS = (
    "damping",
    "friction",
    "offset",
    "armature",
    "load friction",
    "root friction",
    "effort scale",
)
UNITS = "N m s/rad", "N m", "N m", "kg m²", "1", "N m √(s/rad)", "N m/unit"
OUTPUTS = {"-o": "output", "--json": "json", "--report": "report", "--write-urdf": "write_urdf"}


def add_arguments(parser):
    """Declare the arguments."""
    common.add_recording(
        parser, "recordings without contact, in the formats of diag-dynamics analyse"
    )
    text = (
        "any of friction, rotors, inertias, gears, gains, payload:LINK, payload:LINK=MASS, "
        "separated by commas (default: %(default)s)"
    )
    parser.add_argument("--what", default=",".join(STEPS), metavar="WHAT", help=text)
    text = "recordings of the same robot without the payload"
    parser.add_argument("--reference", metavar="RECORDING", nargs="+", default=[], help=text)
    parser.add_argument(
        "-o", "--output", metavar="ARM.yaml", help="parameter file for all nodes and load_urdf"
    )
    parser.add_argument("--json", metavar="QUALITY.json", help="quality as JSON; - for stdout")
    text = (
        "curves of efforts before and after, intervals, steps and base parameters in one HTML file"
    )
    parser.add_argument("--report", metavar="PAGE.html", help=text)
    text = "copy of the URDF with inertias, payloads, damping and friction"
    parser.add_argument("--write-urdf", metavar="NEW.urdf", help=text)
    common.add_quiet(parser)


def run(chosen):
    """Identify; return the exit status."""
    parameters = common.chosen_parameters(chosen)
    robot = common.chosen_robot(chosen)
    if chosen.write_urdf and is_mjcf(robot):
        raise InputError(
            f"--write-urdf requires a URDF, but '{robot}' is an MJCF. Use -o ARM.yaml."
        )
    if "gains" in chosen.what.split(",") and any(parameters.get("effort_scale", [])):
        raise InputError(
            f"effort_scale is {parameters['effort_scale']}; expected none beside gains, which the "
            "output has as effort_scale."
        )
    if chosen.report:
        require("jinja2", f"'{chosen.report}'")  # before the fit
    with Progress(chosen.quiet) as progress, common.json_output(chosen.json) as write:
        model, loaded = common.stream_recordings(
            chosen, chosen.recording, parameters, robot, progress
        )
        _, unloaded = common.stream_recordings(
            chosen, chosen.reference, parameters, model, progress
        )
        steps = [name.strip() for name in chosen.what.split(",")]
        result = identify(loaded, model, steps, reference=unloaded or None)
        _write_parameters(chosen, result, parameters.get("parameters_file"), robot)
        if chosen.report:
            write_report(chosen.report, result)
        quality = result.quality
        write(quality)
    if not chosen.quiet and chosen.json != "-":
        print("\n".join(map(plain, format_summary(result))))
        _report_outputs(chosen)
    share = quality["explained"][1]
    is_good = bool(quality["taken"]) if share is None else share >= MIN_EXPLAINED
    return DONE if is_good and quality["efforts_judged"] else DOUBTFUL


def _write_parameters(chosen, result, earlier, robot):
    """Write parameters and URDF."""
    parameters = result.parameters
    if earlier:  # the model has them
        parameters = Parameters.load(earlier).merged_with(parameters)
    if chosen.output:
        parameters.save(chosen.output)
    if not chosen.write_urdf:
        return
    require_masses(result.model, parameters.payloads)
    source = robot
    if source is None:
        source = open_source(chosen.recording[0], chosen.columns, chosen.topic).description()
    text = urdf_with(read_text(source), parameters)
    write_text(chosen.write_urdf, f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n')


def _report_outputs(chosen):
    common.report_written(chosen.output, chosen.write_urdf, chosen.report, chosen.json)
    if not chosen.output:
        print("The parameters were not saved. Give -o ARM.yaml.", file=sys.stderr)


def format_summary(result):
    """Return lines on the parameters and the quality in cross-validation."""
    quality = result.quality
    model = result.model
    lines = [
        f"{model.name}: {', '.join(quality['taken']) or 'no parameter improved the model'}",
        "",
        f"Held out: {quality['held_out']} ({quality['held_out_duration']:.1f} s), before → after:",
        "",
        *aligned(_joint_rows(quality, result.parameters.joints)),
    ]
    if quality["partial"]:
        joints = ", ".join(quality["partial"])
        lines.append(f"  partial: of {joints} alone; the model's efforts stand for those of others")
    for key, rate in (("explained", "dK/dt"), ("explained_total", "d(K + U)/dt")):
        if None not in quality[key]:
            before, after = quality[key]
            lines.append(f"  variance explained of {rate}: {before:.3f} → {after:.3f}")
    before, after = quality["kinetic_energy"]
    lines.append(f"  mean kinetic energy: {before:.4g} J → {after:.4g} J")
    if quality["payload"]:
        lines += ["", _payload(quality["payload"])]
    for title in ("warnings", "findings"):
        if quality[title]:
            lines += ["", f"{title}:", *(f"  {text}" for text in quality[title])]
    return lines


def _joint_rows(quality, parameters):
    """Return rows of a table: errors of each joint before and after, and its parameters."""
    rows = [
        ["joint", "effort error", "external torque", *COLUMNS],
        ["SI units", "N m rms", "N m spread", *UNITS],
    ]
    count = len(rows)
    for name in quality["torque_rms"]:
        values = parameters.get(name, JointParameters())
        texts = ["" if value is None else f"{value:.3g}" for value in values]
        pairs = [_arrow(quality[key][name]) for key in ("torque_rms", "observer_spread")]
        rows.append([name, *pairs, *texts])
    columns = [column for column in zip(*rows, strict=True) if any(column[count:])]
    return list(zip(*columns, strict=True))


def _arrow(pair):
    return " → ".join("-" if value is None else f"{value:.3g}" for value in pair)


def _payload(payload):
    com = zip(payload["com"], payload["com_deviation"], strict=True)
    mass = f"{payload['mass']:.4g} ± {payload['mass_deviation']:.1g} kg"
    return (
        f"payload of {payload['link']}: {mass} at "
        f"{', '.join(f'{x:.4g} ± {off:.1g}' for x, off in com)} m"
    )
