# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse`: a recording in, everything that the library says of it out."""

import argparse
import json
import shutil
import sys
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from diag_dynamics.cli import fleet, given
from diag_dynamics.cli.given import FAILED
from diag_dynamics.cli.interrupted import orderly
from diag_dynamics.cli.robot_argument import parsed, robot_of
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.atomic_file import AtomicFile
from diag_dynamics.recordings.findings import no_states_error
from diag_dynamics.recordings.fleet import merge_robots, printable
from diag_dynamics.recordings.outputs.mcap import TOPICS, WRITTEN, McapOutput
from diag_dynamics.recordings.outputs.report import ReportOutput
from diag_dynamics.recordings.outputs.tables import TableOutput
from diag_dynamics.recordings.recording import Reading
from diag_dynamics.recordings.summary import WIDTH, describe_faults, format_summary, summarize

DONE, WORTH_KNOWING = range(2)
"""Exit statuses: all is well; the recording has been analysed, but something about it is not right."""

DESCRIPTION = """A recording in, everything that the library says of it out: energies, balance of power, external torque,
quality of the data. docs/recordings.md says what is read, and what the numbers mean."""

EPILOG = """exit status: 0 all is well; 1 analysed, but part of it could not be read, messages were rejected, the balance of
power explains less than 80 % (see the summary), or there is none though there are efforts, or units do not agree, or one
of several recordings failed; 2 nothing could be analysed."""

THRESHOLDS = {"alarm.joints", "alarm.external_torque", "alarm.norm", "external_torque.threshold"}
"""Parameters without any of which a file has no alarms."""

OUTPUTS = "mcap", "parquet", "csv", "report", "json"
"""Options that name a file to be written."""


@given.reported
def run(name, arguments):
    """Analyse recordings; returns the exit status."""
    parser = argparse.ArgumentParser(prog=f"diag-dynamics {name}", description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument(
        "recording", nargs="*", help="rosbag2 folder, .mcap, .db3, ROS 1 .bag, or CSV, TSV, Parquet, npz; or several"
    )
    given.add_arguments(parser)
    parser.add_argument("--alarms", metavar="ALARMS.yaml", help="thresholds that diag-dynamics calibrate has written")
    parser.add_argument(
        "--gain",
        type=float,
        help="of the disturbance observer [1/s], where the parameter external_torque.gain is not set (default: "
        f"{given.GAIN:g})",
    )
    parser.add_argument("-o", "--mcap", metavar="OUT.mcap", help="messages of the monitor, for ros2 bag play")
    parser.add_argument(
        "--topics", help=f"of OUT.mcap: some of {', '.join(TOPICS)}, with commas (default: {','.join(WRITTEN)})"
    )
    parser.add_argument("--parquet", metavar="OUT.parquet", help="a column for each quantity and joint")
    parser.add_argument("--csv", metavar="OUT.csv", help="the same as text")
    parser.add_argument("--report", metavar="OUT.html", help="all of it to be seen, in one file that needs no network")
    parser.add_argument("--json", metavar="SUMMARY.json", help="the summary for programs; - for stdout")
    parser.add_argument("--threads", type=int, help="for evaluation (default: as many as there are processors)")
    parser.add_argument("--quiet", action="store_true", help="no progress and no summary")
    fleet.add_arguments(parser)
    chosen = parsed(parser, arguments)
    if not chosen.recording and not chosen.fleet:
        parser.error("a recording is expected, before --set and --joint-names, or --fleet PATTERN…")
    with orderly(name, [] if chosen.fleet is not None else [getattr(chosen, option) for option in OUTPUTS]):
        if chosen.fleet is not None:
            return _analyse_fleet(chosen)
        return _analyse(chosen) if len(chosen.recording) == 1 else _analyse_several(chosen)


def _analyse(chosen):
    parameters, robot = _common(chosen)
    (recording,) = chosen.recording
    _refuse_outputs(chosen)
    begun = time.perf_counter()
    with _json_output(chosen) as write:
        summary = _summary(chosen, recording, parameters, robot)
        write(summary)
    wrong = describe_faults(summary)
    if _speaks(chosen):
        print(format_summary(summary, _width()))
        ratio = summary["duration"] / max(time.perf_counter() - begun, 1e-9)
        took = time.perf_counter() - begun
        print(f"\nAnalysed in {took:.1f} s, {ratio:.3g} times as fast as it was recorded.", file=sys.stderr)
        for path in (*_outputs(chosen).values(), chosen.json):
            if path:
                print(f"Wrote {printable(path)}.", file=sys.stderr)
        if wrong:
            print(f"Worth a look, so the exit status is {WORTH_KNOWING}: {'; '.join(wrong)}.", file=sys.stderr)
    return WORTH_KNOWING if wrong else DONE


def _analyse_several(chosen):
    """Analyse one recording after another; one that cannot be analysed stops no other."""
    given = [option for option, value in _outputs(chosen).items() if value]
    if given:
        raise InputError(
            f"{given[0]} is of a single recording, and there are {len(chosen.recording)}: "
            "--fleet --out DIR writes files of each."
        )
    parameters, robot = _common(chosen)
    _refuse_outputs(chosen)
    summaries, failed = [], {}
    with _json_output(chosen) as write:
        for recording in chosen.recording:
            try:
                summary = _summary(chosen, recording, parameters, robot)
            except (DiagDynamicsError, OSError) as error:
                failed[recording] = str(error)
                print(f"diag-dynamics analyse: {error}", file=sys.stderr)
                continue
            summaries.append(summary)
            if _speaks(chosen):
                print(f"{printable(recording)}\n\n{format_summary(summary, _width())}\n")
        write({"recordings": summaries, "robots": merge_robots(summaries), "failed": failed})
    if _speaks(chosen):
        print(printable(fleet.table_of(summaries, failed)))
    if not summaries:
        return FAILED
    return WORTH_KNOWING if failed or any(map(describe_faults, summaries)) else DONE


def _common(chosen):
    """Parameters and robot of all recordings."""
    if chosen.threads is not None and chosen.threads < 1:
        raise InputError(f"--threads is {chosen.threads}, expected at least 1.")
    fleet.refuse(chosen)
    if chosen.topics is not None and chosen.mcap is None:
        raise InputError("--topics are those of a file that --mcap writes.")
    return _parameters(chosen), robot_of(chosen.urdf, chosen.xacro_args)


def _summary(chosen, recording, parameters, robot):
    """Analyse one recording, and write what is wanted of it."""
    reading = Reading(recording, robot, parameters=parameters, **given.reading_arguments(chosen))
    messages = partial(McapOutput, topics=WRITTEN if chosen.topics is None else chosen.topics.split(","))
    kinds = (chosen.mcap, messages), (chosen.parquet, TableOutput), (chosen.csv, partial(TableOutput, kind="csv"))
    analysis, outputs = Analysis(reading, gain=given.gain_of(chosen), threads=chosen.threads), []
    try:
        for path, kind in kinds:
            if path:
                outputs.append(kind(path, reading, analysis.friction))
        if chosen.report:
            outputs.append(ReportOutput(chosen.report, reading))
        with _Progress(chosen.quiet) as progress:
            analysis.run(outputs, progress)
        if not analysis.states:
            if (chosen.start, chosen.end) != (None, None) and not analysis.reading.counts["received"]:
                raise InputError(
                    f"'{printable(recording)}' has not a single state: no message is within --start and --end."
                )
            raise no_states_error(printable(recording), analysis.findings)
        summary = summarize(analysis) | {"recording": str(recording)}
        for output in outputs:
            output.close(summary)
    except BaseException:
        for output in outputs:
            output.drop()
        raise
    return summary


def _outputs(chosen):
    """Paths of files that are written of one recording, by option."""
    return {"--mcap": chosen.mcap, "--parquet": chosen.parquet, "--csv": chosen.csv, "--report": chosen.report}


@contextmanager
def _json_output(chosen):
    """Yield a function that writes a summary for programs; a file is begun before all else, and left out after errors."""
    file = AtomicFile(chosen.json) if chosen.json and chosen.json != "-" else None

    def write(summary):
        text = json.dumps(summary, indent=1, allow_nan=False)
        if file:
            Path(file.name).write_text(text, encoding="utf-8")
            file.commit()
        elif chosen.json == "-":
            print(text)

    try:
        yield write
    except BaseException:
        if file:
            file.discard()
        raise


def _width():
    return min(WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns)


def _speaks(chosen):
    return not chosen.quiet and chosen.json != "-"


def _analyse_fleet(chosen):
    parameters = _parameters(chosen)
    report = fleet.analyse(chosen, parameters, robot_of(chosen.urdf, chosen.xacro_args))
    if not report["recordings"]:
        return FAILED
    return WORTH_KNOWING if report["failed"] or any(row["wrong"] for row in report["recordings"]) else DONE


def _parameters(chosen):
    """Parameters of the monitor, of all files and of the command line."""
    if chosen.alarms and not THRESHOLDS & set(parameters_of([chosen.alarms])):
        raise InputError(
            f"--alarms: '{printable(chosen.alarms)}' has no thresholds, expected one of {', '.join(sorted(THRESHOLDS))}, as "
            "diag-dynamics calibrate writes them; other parameters are for --parameters."
        )
    parameters = parameters_of([*chosen.parameters, *([chosen.alarms] if chosen.alarms else [])], chosen.set)
    if chosen.gain is not None and parameters.get("external_torque.threshold"):  # which counts only with a gain
        parameters["external_torque.gain"] = parameters.get("external_torque.gain") or chosen.gain  # 0 is none
    return parameters


def _refuse_outputs(chosen):
    read = [*chosen.recording, chosen.urdf, chosen.columns, chosen.alarms, *chosen.parameters]
    given.refuse_outputs(read, {f"--{option}": getattr(chosen, option) for option in OUTPUTS})


class _Progress(given.Progress):
    """States and recorded time, five times a second."""

    def __init__(self, quiet):
        super().__init__(quiet)
        self._begun, self._last = None, -1.0

    def __call__(self, states, log_time):
        now = time.perf_counter()
        self._begun = log_time if self._begun is None else self._begun
        if now - self._last > 0.2:
            self._last = now
            self.show(f"{states} states, {(log_time - self._begun) * 1e-9:.0f} s")
