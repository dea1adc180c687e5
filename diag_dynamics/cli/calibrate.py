# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics calibrate`: recordings without contact in, thresholds of alarms for the monitor out."""

import argparse
import math
import re
from datetime import datetime, timezone
from pathlib import Path

from diag_dynamics.cli import given
from diag_dynamics.cli.interrupted import orderly
from diag_dynamics.cli.robot_argument import parsed, robot_of
from diag_dynamics.collision.calibration import format_rate
from diag_dynamics.collision.detector import HOLD_OFF, RELEASE, STANDING
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.single_joints import sliding_dofs
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.recordings.calibration import calibrate
from diag_dynamics.recordings.summary import REJECTED

DONE, WORTH_KNOWING = range(2)
"""Exit statuses: thresholds that hold what was asked; thresholds with a warning."""

EPILOG = """exit status: 0 calibrated; 1 calibrated, but the recordings are too short for what was asked, their parts are
unlike, efforts are wrong, or something of them could not be read (see the summary); 2 not calibrated."""

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


@given.reported
def run(name, arguments):
    """Calibrate; returns the exit status."""
    parser = argparse.ArgumentParser(prog=f"diag-dynamics {name}", description=__doc__, epilog=EPILOG)
    parser.add_argument("recording", nargs="+", help="without any contact: bag, MCAP, CSV, TSV, Parquet, npz")
    given.add_arguments(parser)
    parser.add_argument(
        "--gain", type=float, default=given.GAIN, help="of the disturbance observer [1/s] (default: 25)"
    )
    parser.add_argument(
        "--false-alarms", metavar="N/min", default="1/min", help="N/s, N/min or N/h, of all detectors together (1/min)"
    )
    parser.add_argument("--release", type=float, default=RELEASE, help=f"alarm.release (default: {RELEASE:g})")
    parser.add_argument("--hold-off", type=float, default=HOLD_OFF, help=f"alarm.hold_off [s] (default: {HOLD_OFF:g})")
    parser.add_argument(
        "--standing", type=float, default=STANDING, help=f"alarm.standing [s], 0 for never (default: {STANDING:g})"
    )
    parser.add_argument("-o", "--output", metavar="ALARMS.yaml", required=True, help="for monitor and analyse --alarms")
    parser.add_argument("--threads", type=int, help="for evaluation (default: as many as there are processors)")
    parser.add_argument("--quiet", action="store_true", help="no summary")
    chosen = parsed(parser, arguments)
    with orderly(name, [chosen.output]):
        return _calibrate(chosen)


def _calibrate(chosen):
    rate = rate_of(chosen.false_alarms)
    if chosen.threads is not None and chosen.threads < 1:
        raise InputError(f"--threads is {chosen.threads}, expected at least 1.")
    given.refuse_outputs([*chosen.recording, chosen.urdf, chosen.columns, *chosen.parameters], {"-o": chosen.output})
    parameters = parameters_of(chosen.parameters, chosen.set)
    recordings = given.streamed(chosen, chosen.recording, parameters, robot_of(chosen.urdf, chosen.xacro_args))
    model = recordings[0].model
    chosen_friction = parameters.get("external_torque.friction", PARAMETERS["external_torque.friction"].default)
    found = calibrate(
        [one.pieces() for one in recordings],
        DiagonalDynamics(model),
        chosen.gain,
        rate,
        release=chosen.release,
        hold_off=chosen.hold_off,
        standing=chosen.standing or math.inf,
        friction=chosen_friction and model.has_friction,
        max_gap=parameters.get("external_torque.max_gap", PARAMETERS["external_torque.max_gap"].default),
        threads=chosen.threads,
    )
    notes = [f"From {', '.join(map(repr, chosen.recording))}, {datetime.now(timezone.utc):%Y-%m-%d}."]
    if chosen.parameters or chosen.set:
        notes.append(f"By {', '.join([*map(repr, chosen.parameters), *chosen.set])}, which the monitor needs as well.")
    found.save(chosen.output, notes)
    findings = [
        (Path(one.path).name, finding) for one in recordings for finding in one.findings if finding.cause != "note"
    ]
    if not chosen.quiet:
        told = [f"'{name}': {finding}" for name, finding in findings]
        print("\n".join(text_of(found, model, chosen.output, told)))
    unread = any(finding.cause == "unread" or finding.cause.startswith(REJECTED) for _, finding in findings)
    return WORTH_KNOWING if found.warnings or unread else DONE


def rate_of(text):
    """Rate of a text such as ``1/min`` [1/s].

    Raises
    ------
    InputError
        It is none.
    """
    match = re.fullmatch(r"\s*([0-9.eE+-]+)\s*/\s*(s|min|h)\s*", text)
    try:
        rate = float(match[1]) / SECONDS[match[2]] if match else math.nan
    except ValueError:
        rate = math.nan
    if not 0.0 < rate < math.inf:
        raise InputError(f"--false-alarms is {text!r}, expected a number > 0 per time: N/s, N/min or N/h.")
    return rate


def text_of(found, model, path, findings):
    """Lines for people."""
    low, high = found.rate_interval
    how = f"{found.peaks} alarms counted" if found.method == "counted" else f"from the tail of {found.peaks} peaks"
    width = max(len("|m r|"), *map(len, found.joints))
    units = {name: "N" if slides else "N m" for name, slides in zip(model.dof_names, sliding_dofs(model), strict=True)}
    return [
        f"{found.duration:.4g} s without contact, observer of gain {found.gain:g}/s "
        f"{'with' if found.friction else 'without'} friction of the model",
        f"False alarms asked for: {format_rate(found.asked)}, all detectors together; {how}",
        f"Held-out parts: {found.held_out} alarms in {found.duration:.4g} s, {format_rate(found.rate)} "
        f"(95 %: {format_rate(low)} to {format_rate(high)}); on the recordings themselves {found.alarms}",
        "",
        "Thresholds",
        *(f"  {name:{width}}  {value:.4g} {units[name]}" for name, value in found.joints.items()),
        f"  {'|m r|':{width}}  {found.external_torque:.4g} N m",
        f"  {'|r|':{width}}  {found.norm:.4g} J^0.5/s",
        *(["", "Worth knowing"] if found.warnings or findings else []),
        *(f"  {text}" for text in (*found.warnings, *findings)),
        "",
        f"Wrote {path}: for the monitor as --params-file, for analyse as --alarms.",
    ]
