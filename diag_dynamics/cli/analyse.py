# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse`: summary, tables, messages and report of recordings."""

import sys
from pathlib import Path

from diag_dynamics.cli import common, fleet
from diag_dynamics.cli.common import DONE, DOUBTFUL, FAILED
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.outputs.mcap import TOPICS, WRITTEN, McapOutput
from diag_dynamics.recordings.outputs.report import ReportOutput
from diag_dynamics.recordings.outputs.table_files import TableOutput
from diag_dynamics.recordings.recording import Reading
from diag_dynamics.recordings.sources import BagSource, open_source
from diag_dynamics.recordings.summary import (
    describe_faults,
    format_summary,
)
from diag_dynamics.text import Progress, plain, shortened

EPILOG = (
    "exit status: 0 no problem; 1 unreadable data, rejected messages, a wrong unit, a power "
    "balance that explains less than 80 % or that a moving robot lacks, or one of several "
    "recordings failed; 2 no result. Collisions are results. "
    "Formats and results: docs/recordings.md."
)

OUTPUTS = {f"--{name}": name for name in ("mcap", "parquet", "csv", "report", "json")}


def add_arguments(parser):
    """Declare the arguments."""
    common.add_recording(
        parser,
        "rosbag2 folder, .mcap, .db3, .bag, CSV, TSV, Parquet, npz or LeRobot dataset",
        nargs="*",
    )
    parser.add_argument(
        "--alarms", metavar="ALARMS.yaml", help="thresholds written by diag-dynamics calibrate"
    )
    text = f"observer gain [1/s] unless external_torque.gain is set (default: {common.GAIN:g})"
    parser.add_argument("--gain", type=float, help=text)
    parser.add_argument(
        "-o", "--mcap", metavar="OUT.mcap", help="messages of the monitor, for ros2 bag play"
    )
    text = (
        f"topics in OUT.mcap, separated by commas: {', '.join(TOPICS)} "
        f"(default: {','.join(WRITTEN)})"
    )
    parser.add_argument("--topics", help=text)
    parser.add_argument(
        "--parquet", metavar="OUT.parquet", help="table with a column for each quantity and joint"
    )
    parser.add_argument("--csv", metavar="OUT.csv", help="the same table as text")
    parser.add_argument(
        "--report", metavar="OUT.html", help="self-contained HTML page with all results"
    )
    parser.add_argument("--json", metavar="SUMMARY.json", help="summary as JSON; - for stdout")
    common.add_threads(parser)
    common.add_quiet(parser)
    fleet.add_arguments(parser)


def run(chosen):
    """Analyse recordings; return the exit status."""
    if not chosen.recording and not chosen.fleet:
        raise InputError(
            "recording is missing; expected a path before --set and --joint-names, or --fleet "
            "PATTERN."
        )
    parameters = _parameters(chosen)
    robot = common.chosen_robot(chosen)
    if chosen.fleet is not None:
        return fleet.analyse(chosen, parameters, robot)
    fleet.refuse(chosen)
    if chosen.topics is not None and chosen.mcap is None:
        raise InputError("--topics requires --mcap OUT.mcap.")
    chosen.recording = common.expand_recordings(chosen.recording)
    if chosen.columns and not Path(chosen.columns).expanduser().exists():
        return _write_column_map(chosen)
    for option, name in OUTPUTS.items():
        if name != "json" and getattr(chosen, name) and len(chosen.recording) > 1:
            count = (
                f"there are {len(chosen.recording)}. Use --fleet --out DIR to write files of each."
            )
            raise InputError(f"{option} writes results of one recording, but {count}")
    with common.json_output(chosen.json) as write:
        return _analyse(chosen, parameters, robot, write)


def _write_column_map(chosen):
    """Write a column map of the first recording to fill in."""
    path = Path(chosen.columns).expanduser()
    recording = chosen.recording[0]
    source = open_source(recording)
    if isinstance(source, BagSource):
        raise InputError(f"'{plain(recording)}' is no table; expected --columns with a file.")
    joints = single_joints(common.chosen_model(chosen)) if chosen.urdf else ()
    source.write_column_map(path, joints)
    text = f"Wrote {path}, the columns of '{recording}'. Complete it and repeat the command."
    print(plain(text), file=sys.stderr)
    return FAILED


def _analyse(chosen, parameters, robot, write):
    """Analyse one recording after another; one that fails does not stop the others."""
    is_single = len(chosen.recording) == 1
    prints = not chosen.quiet and chosen.json != "-"
    summaries = []
    failed = {}
    for recording in chosen.recording:
        try:
            summary = _summary(chosen, recording, parameters, robot)
        except (DiagDynamicsError, OSError) as error:
            if is_single:
                raise
            failed[recording] = str(error)
            common.report_error("analyse", error, chosen)
            continue
        summaries.append(summary)
        if prints:
            text = format_summary(summary)
            print(text if is_single else f"{plain(recording)}\n\n{text}\n")
    write(summaries[0] if is_single else {"recordings": summaries, "failed": failed})
    faults = [fault for summary in summaries for fault in describe_faults(summary)]
    if prints:
        common.report_written(*(getattr(chosen, name) for name in OUTPUTS.values()))
        if faults:
            text = f"Problems (exit status {DOUBTFUL}): {'; '.join(faults)}."
            print(shortened(text), file=sys.stderr)
    if not summaries:
        return FAILED
    return DOUBTFUL if failed or faults else DONE


def _summary(chosen, recording, parameters, robot):
    """Analyse one recording, write its outputs, and return the summary."""
    reading = Reading(recording, robot, parameters=parameters, **common.reading_options(chosen))
    gain = common.GAIN if chosen.gain is None else chosen.gain
    analysis = Analysis(reading, gain=gain, threads=chosen.threads)
    with Progress(chosen.quiet) as progress:
        return analysis.run(
            _open_outputs(chosen, reading), lambda states: progress.show(f"{states} states")
        )


def _open_outputs(chosen, reading):
    """Yield the outputs of one recording."""
    if chosen.mcap:
        topics = WRITTEN if chosen.topics is None else chosen.topics.split(",")
        yield McapOutput(chosen.mcap, reading, topics)
    for kind in ("parquet", "csv"):
        if path := getattr(chosen, kind):
            yield TableOutput(path, reading, kind)
    if chosen.report:
        yield ReportOutput(chosen.report, reading)


def _parameters(chosen):
    """Return parameters of the monitor, with the thresholds of --alarms."""
    parameters = common.chosen_parameters(chosen, *filter(None, [chosen.alarms]))
    # it counts only with a gain
    if chosen.gain is not None and parameters.get("collision.threshold"):
        parameters["external_torque.gain"] = parameters.get("external_torque.gain") or chosen.gain
    return parameters
