# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics calibrate`: alarm thresholds from recordings without contact."""

import math
import re
from datetime import datetime, timezone
from pathlib import Path

from diag_dynamics.cli import common
from diag_dynamics.cli.common import DONE, DOUBTFUL
from diag_dynamics.collision.calibration import format_rate
from diag_dynamics.collision.detector import HOLD_OFF, RELEASE, STANDING
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.recordings.calibration import calibrate
from diag_dynamics.recordings.summary import REJECTED
from diag_dynamics.text import Progress

EPILOG = """exit status: 0 calibrated; 1 calibrated with warnings: recordings too short for the rate, parts that differ,
wrong efforts, or unreadable data; 2 not calibrated. Requirements of recordings: docs/collision.md."""

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}

OUTPUTS = {"-o": "output"}

METHODS = {
    "counted": "from {} alarms",
    "tail": "extrapolated from {} peaks",
    "blocks": "extrapolated from {} maxima of one second each",
}
"""Origin of the thresholds by the method of a Calibration."""


def add_arguments(parser):
    """Declare the arguments."""
    common.add_recording(
        parser, "recordings without any contact: bag, MCAP, CSV, TSV, Parquet, npz"
    )
    text = "accepted rate of false alarms, all detectors together: N/s, N/min or N/h (default: %(default)s)"
    parser.add_argument("--false-alarms", metavar="N/min", default="1/min", help=text)
    text = "accepted rate of false contacts, for the lower thresholds (default: ten times that of false alarms)"
    parser.add_argument("--false-contacts", metavar="N/min", help=text)
    for option, default, text in (
        ("--gain", common.GAIN, "gain of the disturbance observer [1/s]"),
        ("--release", RELEASE, "fraction of its threshold below which a detector releases"),
        ("--hold-off", HOLD_OFF, "time after an alarm in which a rise belongs to that alarm [s]"),
        (
            "--standing",
            STANDING,
            "age of an alarm at which a constant torque becomes an offset [s], 0 for never",
        ),
    ):
        parser.add_argument(
            option, type=float, default=default, help=f"{text} (default: %(default)g)"
        )
    text = "parameter file for the monitor and for analyse --alarms"
    parser.add_argument("-o", "--output", metavar="ALARMS.yaml", required=True, help=text)
    common.add_threads(parser)
    common.add_quiet(parser)


def run(chosen):
    """Calibrate; return the exit status."""
    rate, parameters = (
        parse_rate("--false-alarms", chosen.false_alarms),
        common.chosen_parameters(chosen),
    )
    contacts = chosen.false_contacts and parse_rate("--false-contacts", chosen.false_contacts)
    with Progress(chosen.quiet) as progress:
        robot = common.chosen_robot(chosen)
        recordings = common.stream_recordings(chosen, chosen.recording, parameters, robot, progress)
        model = recordings[0].model
        names = [f"external_torque.{name}" for name in ("friction", "max_gap", "settles_on")]
        friction, max_gap, settles_on = (
            parameters.get(name, PARAMETERS[name].default) for name in names
        )
        found = calibrate(
            [one.pieces() for one in recordings],
            DiagonalDynamics(model),
            chosen.gain,
            rate,
            contacts,
            release=chosen.release,
            hold_off=chosen.hold_off,
            standing=chosen.standing or math.inf,
            friction=friction and model.has_friction,
            max_gap=max_gap,
            settles_on=settles_on,
            threads=chosen.threads,
        )
    found.save(chosen.output, _notes(chosen))
    findings = [
        (one.path, finding)
        for one in recordings
        for finding in one.findings
        if finding.cause != "note"
    ]
    if not chosen.quiet:
        texts = [f"'{Path(path).name}': {finding}" for path, finding in findings]
        print("\n".join(_summary(found, model, chosen.output, texts)))
    damaged = any(
        finding.cause == "unread" or finding.cause.startswith(REJECTED) for _, finding in findings
    )
    return DOUBTFUL if found.warnings or damaged else DONE


def _notes(chosen):
    """Return comments of the file: recordings, date and parameters."""
    notes = [
        f"From {', '.join(map(repr, chosen.recording))}, {datetime.now(timezone.utc):%Y-%m-%d}."
    ]
    if chosen.parameters or chosen.set:
        notes.append(
            f"With {', '.join([*map(repr, chosen.parameters), *chosen.set])}, which the monitor also needs."
        )
    return notes


def parse_rate(option, text):
    """Return the rate of an option's text such as ``1/min`` [1/s]."""
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*/\s*(s|min|h)\s*", text)
    try:
        rate = float(match[1]) / SECONDS[match[2]] if match else math.nan
    except ValueError:
        rate = math.nan
    if not 0.0 < rate < math.inf:
        raise InputError(
            f"{option} is {text!r}; expected a number > 0 per time: N/s, N/min or N/h."
        )
    return rate


def _summary(found, model, path, findings):
    contact = found.contact
    width = max(len("|m r|"), *map(len, found.joints))
    units = {
        name: "N" if slides else "N m"
        for name, slides in zip(model.dof_names, sliding_dofs(model), strict=True)
    }
    return [
        f"{found.duration:.4g} s without contact, {found.rest:.4g} s of it at rest, observer gain {found.gain:g}/s, "
        f"{'with' if found.friction else 'without'} friction of the model",
        f"Requested false alarms: {format_rate(found.asked)}, all detectors together",
        f"  {found.describe_rate()} With the final thresholds: {found.alarms}",
        f"Requested false contacts: {format_rate(contact.asked)}",
        f"  {contact.describe_rate()} With the final thresholds: {contact.alarms}",
        "",
        f"Thresholds of collision, {METHODS[found.method].format(found.peaks)}, "
        f"and of contact, {METHODS[contact.method].format(contact.peaks)}",
        *(
            f"  {name:{width}}  {x:.4g} {units[name]}  {contact.joints[name]:.4g}"
            for name, x in found.joints.items()
        ),
        f"  {'|m r|':{width}}  {found.external_torque:.4g} N m  {contact.external_torque:.4g}",
        f"  {'|r|':{width}}  {found.norm:.4g} J^0.5/s  {contact.norm:.4g}",
        *(
            ["", "Thresholds of an arm at rest, on the change of m r within 0.2 s"]
            if found.rest_joints
            else []
        ),
        *(
            f"  {name:{width}}  {x:.4g} {units[name]}  {contact.rest_joints.get(name, math.inf):.4g}"
            for name, x in found.rest_joints.items()
        ),
        *(["", "Warnings"] if found.warnings or findings or contact.warnings else []),
        *(f"  {text}" for text in (*found.warnings, *findings)),
        *(f"  Contact: {text}" for text in contact.warnings),
        "",
        f"Wrote {path}. Give it to the monitor as --params-file and to analyse as --alarms.",
    ]
