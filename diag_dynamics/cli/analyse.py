# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse`: summary, tables, messages and report of recordings."""

import shutil
import sys
import time
from functools import partial

from diag_dynamics.cli import common, fleet
from diag_dynamics.cli.common import DONE, DOUBTFUL, FAILED
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.findings import no_states_error
from diag_dynamics.recordings.fleet import merge_robots, printable
from diag_dynamics.recordings.outputs.mcap import TOPICS, WRITTEN, McapOutput
from diag_dynamics.recordings.outputs.report import ReportOutput
from diag_dynamics.recordings.outputs.tables import TableOutput
from diag_dynamics.recordings.recording import Reading
from diag_dynamics.recordings.summary import WIDTH, describe_faults, format_summary, summarize
from diag_dynamics.text import Progress

EPILOG = """exit status: 0 success; 1 analysed, but data could not be read, messages were rejected, the balance of power
explains less than 80 % (see the summary) or is missing although there are efforts, units do not agree, or one of several
recordings failed; 2 nothing could be analysed. docs/recordings.md describes formats and results."""

THRESHOLDS = {"alarm.joints", "alarm.external_torque", "alarm.norm", "external_torque.threshold"}
"""Parameters of the monitor that set a threshold; a file of alarms sets at least one."""

OUTPUTS = {f"--{name}": name for name in ("mcap", "parquet", "csv", "report", "json")}


def add_arguments(parser):
    """Declare the arguments."""
    common.add_recording(parser, "rosbag2 folder, .mcap, .db3, .bag, CSV, TSV, Parquet or npz; or several", nargs="*")
    parser.add_argument("--alarms", metavar="ALARMS.yaml", help="thresholds written by diag-dynamics calibrate")
    text = f"gain of the observer [1/s], unless external_torque.gain is set (default: {common.GAIN:g})"
    parser.add_argument("--gain", type=float, help=text)
    parser.add_argument("-o", "--mcap", metavar="OUT.mcap", help="messages of the monitor, for ros2 bag play")
    text = f"topics in OUT.mcap, separated by commas: {', '.join(TOPICS)} (default: {','.join(WRITTEN)})"
    parser.add_argument("--topics", help=text)
    parser.add_argument("--parquet", metavar="OUT.parquet", help="a column for each quantity and joint")
    parser.add_argument("--csv", metavar="OUT.csv", help="the same as text")
    parser.add_argument("--report", metavar="OUT.html", help="a page with all results; it needs no network")
    parser.add_argument("--json", metavar="SUMMARY.json", help="the summary for programs; - for stdout")
    common.add_threads(parser)
    common.add_quiet(parser)
    fleet.add_arguments(parser)


def run(chosen):
    """Analyse recordings; return the exit status."""
    if not chosen.recording and not chosen.fleet:
        raise InputError("no recording is named; expected one before --set and --joint-names, or --fleet PATTERN…")
    parameters, robot = _parameters(chosen), common.chosen_robot(chosen)
    if chosen.fleet is not None:
        return fleet.analyse(chosen, parameters, robot)
    fleet.refuse(chosen)
    if chosen.topics is not None and chosen.mcap is None:
        raise InputError("--topics are those of a file that --mcap writes.")
    is_single = len(chosen.recording) == 1
    for option, name in OUTPUTS.items():
        if name != "json" and getattr(chosen, name) and not is_single:
            count = f"there are {len(chosen.recording)}: --fleet --out DIR writes files of each."
            raise InputError(f"{option} is of a single recording, and {count}")
    with common.json_output(chosen.json) as write:
        return (_analyse if is_single else _analyse_several)(chosen, parameters, robot, write)


def _analyse(chosen, parameters, robot, write):
    start = time.perf_counter()
    summary = _summary(chosen, chosen.recording[0], parameters, robot)
    write(summary)
    faults = describe_faults(summary)
    if _prints(chosen):
        print(format_summary(summary, _width()))
        took = max(time.perf_counter() - start, 1e-9)
        ratio = summary["duration"] / took
        print(f"\nAnalysed in {took:.1f} s, {ratio:.3g} times as fast as it was recorded.", file=sys.stderr)
        common.report_written(*(getattr(chosen, name) for name in OUTPUTS.values()))
        if faults:
            print(f"Worth a look, so the exit status is {DOUBTFUL}: {'; '.join(faults)}.", file=sys.stderr)
    return DOUBTFUL if faults else DONE


def _analyse_several(chosen, parameters, robot, write):
    """Analyse one recording after another; one that fails does not stop the others."""
    summaries, failed = [], {}
    for recording in chosen.recording:
        try:
            summary = _summary(chosen, recording, parameters, robot)
        except (DiagDynamicsError, OSError) as error:
            failed[recording] = str(error)
            print(f"diag-dynamics analyse: {error}", file=sys.stderr)
            continue
        summaries.append(summary)
        if _prints(chosen):
            print(f"{printable(recording)}\n\n{format_summary(summary, _width())}\n")
    write({"recordings": summaries, "robots": merge_robots(summaries), "failed": failed})
    if _prints(chosen):
        print(printable(fleet.format_table(summaries, failed)))
    if not summaries:
        return FAILED
    return DOUBTFUL if failed or any(map(describe_faults, summaries)) else DONE


def _summary(chosen, recording, parameters, robot):
    """Analyse one recording, write its outputs, and return the summary."""
    reading = Reading(recording, robot, parameters=parameters, **common.reading_options(chosen))
    gain = common.GAIN if chosen.gain is None else chosen.gain
    analysis, outputs = Analysis(reading, gain=gain, threads=chosen.threads), []
    topics = WRITTEN if chosen.topics is None else chosen.topics.split(",")
    messages, csv = partial(McapOutput, topics=topics), partial(TableOutput, kind="csv")
    kinds = (chosen.mcap, messages), (chosen.parquet, TableOutput), (chosen.csv, csv)
    try:
        outputs += [kind(path, reading, analysis.friction) for path, kind in kinds if path]
        if chosen.report:
            outputs.append(ReportOutput(chosen.report, reading))
        with Progress(chosen.quiet) as progress:
            analysis.run(outputs, _progress_of_states(progress))
        if not analysis.states:
            raise _no_states(chosen, recording, analysis)
        summary = summarize(analysis) | {"recording": str(recording)}
        for output in outputs:
            output.close(summary)
    except BaseException:
        for output in outputs:
            output.drop()
        raise
    return summary


def _progress_of_states(progress):
    """Return a function that shows the number of states and the recorded time."""
    begun = None

    def show(states, log_time):
        nonlocal begun
        begun = log_time if begun is None else begun
        progress.show(f"{states} states, {(log_time - begun) * 1e-9:.0f} s")

    return show


def _no_states(chosen, recording, analysis):
    if (chosen.start, chosen.end) != (None, None) and not analysis.reading.counts["received"]:
        place = "no message is within --start and --end"
        return InputError(f"'{printable(recording)}' has not a single state: {place}.")
    return no_states_error(printable(recording), analysis.findings)


def _parameters(chosen):
    """Return parameters of the monitor, with the thresholds of --alarms."""
    alarms = [chosen.alarms] if chosen.alarms else []
    if alarms and not THRESHOLDS & set(parameters_of(alarms)):
        raise InputError(
            f"--alarms: '{printable(chosen.alarms)}' has no thresholds, expected one of {', '.join(sorted(THRESHOLDS))}, "
            "as diag-dynamics calibrate writes them; other parameters are for --parameters."
        )
    parameters = common.chosen_parameters(chosen, *alarms)
    if chosen.gain is not None and parameters.get("external_torque.threshold"):  # it counts only with a gain
        parameters["external_torque.gain"] = parameters.get("external_torque.gain") or chosen.gain
    return parameters


def _prints(chosen):
    return not chosen.quiet and chosen.json != "-"


def _width():
    return min(WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns)
