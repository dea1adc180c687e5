# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics calibrate`: alarm thresholds from recordings without contact."""

import math
from datetime import datetime, timezone
from pathlib import Path

from diag_dynamics.cli import common
from diag_dynamics.cli.common import DONE, DOUBTFUL
from diag_dynamics.collision.calibration import format_rate
from diag_dynamics.collision.detector import LABELS
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.recordings.findings import REJECTED
from diag_dynamics.recordings.threshold_calibration import calibrate
from diag_dynamics.text import Progress

EPILOG = (
    "exit status: 0 calibrated; 1 calibrated with warnings: recordings too short for the rate, "
    "parts that differ, wrong efforts, or unreadable data; 2 not calibrated. "
    "Requirements of recordings: docs/collision.md."
)

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
    text = (
        "accepted rate of false alarms, all detectors together: N/s, N/min or N/h "
        "(default: %(default)s)"
    )
    parser.add_argument("--false-alarms", metavar="N/min", default="1/min", help=text)
    text = "gain of the disturbance observer [1/s] (default: %(default)g)"
    parser.add_argument("--gain", type=float, default=common.GAIN, help=text)
    text = "parameter file for the monitor and for analyse --alarms"
    parser.add_argument("-o", "--output", metavar="ALARMS.yaml", required=True, help=text)
    common.add_threads(parser)
    common.add_quiet(parser)


def run(chosen):
    """Calibrate; return the exit status."""
    rate = parse_rate(chosen.false_alarms)
    parameters = common.chosen_parameters(chosen)
    values = {name: spec.default for name, spec in PARAMETERS.items()} | parameters
    with Progress(chosen.quiet) as progress:
        robot = common.chosen_robot(chosen)
        model, readers = common.stream_recordings(
            chosen, chosen.recording, parameters, robot, progress
        )
        findings = {}
        calibration = calibrate(
            [_with_findings(reader(), findings) for reader in readers],
            DiagonalDynamics(model),
            chosen.gain,
            rate,
            release=values["collision.release"],
            hold_off=values["collision.hold_off"],
            standing=values["collision.standing"] or math.inf,
            stiction=values["collision.stiction"],
            friction=values["external_torque.friction"] and model.has_friction,
            threads=chosen.threads,
        )
    calibration.save(chosen.output, _notes(chosen))
    texts = []
    is_damaged = False
    for path, of_path in findings.items():
        for finding in of_path:
            if finding.cause != "note":
                texts.append(f"'{Path(path).name}': {finding}")
            is_damaged |= finding.cause == "unread" or finding.cause.startswith(REJECTED)
    if not chosen.quiet:
        print("\n".join(_summary(calibration, model, chosen.output, texts)))
    return DOUBTFUL if calibration.warnings or is_damaged else DONE


def _with_findings(pieces, findings):
    """Yield pieces of a recording; their last findings are in a dict by path then."""
    for piece in pieces:
        findings[piece.path] = piece.findings
        yield piece


def _notes(chosen):
    """Return comments of the file: recordings, date and parameters."""
    notes = [
        f"From {', '.join(map(repr, chosen.recording))}, {datetime.now(timezone.utc):%Y-%m-%d}."
    ]
    if chosen.parameters or chosen.set:
        notes.append(
            f"With {', '.join([*map(repr, chosen.parameters), *chosen.set])}, "
            "which the monitor also needs."
        )
    return notes


def parse_rate(text):
    """Return the rate of a text such as ``1/min`` [1/s]."""
    count, _, unit = text.replace(" ", "").partition("/")
    try:
        rate = float(count) / SECONDS[unit]
    except (ValueError, KeyError):
        rate = math.nan
    if not 0.0 < rate < math.inf:
        raise InputError(
            f"--false-alarms is {text!r}; expected a number > 0 per time: N/s, N/min or N/h."
        )
    return rate


def _summary(calibration, model, path, findings):
    """Yield lines about a Calibration."""
    contact = calibration.contact
    yield (
        f"{calibration.duration:.4g} s without contact, observer gain {calibration.gain:g}/s, "
        f"{'with' if calibration.friction else 'without'} friction of the model"
    )
    for event, thresholds in (("alarms", calibration), ("contacts", contact)):
        yield f"Requested false {event}: {format_rate(thresholds.requested)}"
        alarms = thresholds.alarms
        yield f"  {thresholds.describe_rate()} With the final thresholds: {alarms}"
    method, contact_method = (
        METHODS[thresholds.method].format(thresholds.peaks) for thresholds in (calibration, contact)
    )
    yield ""
    yield f"Thresholds of collision, {method}, and of contact, {contact_method}; for joints also"
    yield "the smallest external torque that it shows while it stands"
    names = [LABELS.get(name, (name, ""))[0] for name in calibration.limits]
    width = max(map(len, names))
    units = _units(model)
    smallest = calibration.smallest_torques
    for name, label in zip(calibration.limits, names, strict=True):
        limits = f"{calibration.limits[name]:.4g} {units[name]}  {contact.limits[name]:.4g}"
        standing = f"  {smallest[name]:.4g}" if name in smallest else ""
        yield f"  {label:{width}}  {limits}{standing}"
    warnings = [*calibration.warnings, *findings]
    warnings += [f"Contact: {text}" for text in contact.warnings]
    if warnings:
        yield ""
        yield "Warnings"
    for text in warnings:
        yield f"  {text}"
    yield ""
    yield f"Wrote {path}. Give it to the monitor as --params-file and to analyse as --alarms."


def _units(model):
    """Return the unit of each threshold by name."""
    units = {name: unit for name, (_, unit) in LABELS.items()}
    for name, slides in zip(model.dof_names, sliding_dofs(model), strict=True):
        units[name] = "N" if slides else "N m"
    return units
