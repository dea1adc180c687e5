# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse --fleet`: many recordings, and one table of them."""

import numpy as np

from diag_dynamics.cli import common
from diag_dynamics.cli.common import DONE, DOUBTFUL, FAILED
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.fleet import analyse_fleet, describe_collisions, printable
from diag_dynamics.recordings.summary import count_collisions
from diag_dynamics.text import Progress

ALONE = "mcap", "topics", "parquet", "csv", "report", "json", "threads", "start", "end"
"""Options of a single recording."""

TOGETHER = "out", "scheduler", "workers", "no_parquet", "reports"  # options of many
MAX_LISTED = 5  # causes and failed recordings that the text lists


def add_arguments(parser):
    """Declare the options of a fleet."""
    group = parser.add_argument_group("many recordings")
    group.add_argument(
        "--fleet",
        metavar="PATTERN",
        nargs="*",
        help="paths or patterns; ** is any number of folders",
    )
    group.add_argument(
        "--out",
        metavar="DIR",
        help="folder for fleet.html, and a summary and a Parquet file of each",
    )
    group.add_argument(
        "--scheduler", metavar="tcp://HOST:PORT", help="Dask cluster (default: local processes)"
    )
    group.add_argument(
        "--workers",
        type=common.positive_int,
        help="number of local processes (default: processors)",
    )
    group.add_argument("--no-parquet", action="store_true", help="write no Parquet files")
    group.add_argument(
        "--reports", action="store_true", help="write a report of each, linked from fleet.html"
    )


def refuse(chosen):
    """Reject options of many recordings."""
    for name in TOGETHER:
        value = getattr(chosen, name)
        if value is not None and value is not False:
            raise InputError(f"--{name.replace('_', '-')} requires --fleet.")


def analyse(chosen, parameters, robot):
    """Analyse the recordings; return the exit status."""
    if alone := [name for name in ALONE if getattr(chosen, name) is not None]:
        raise InputError(
            f"--{alone[0]} cannot be combined with --fleet, which writes its results into --out DIR."
        )
    if chosen.out is None:
        raise InputError("--out is missing; --fleet requires --out DIR for its results.")
    options = {name: getattr(chosen, name) for name in ("topic", "scheduler", "workers", "reports")}
    options |= {
        "joint_names": common.reading_options(chosen)["joint_names"],
        "parameters": parameters,
    }
    options |= {
        "gain": common.GAIN if chosen.gain is None else chosen.gain,
        "parquet": not chosen.no_parquet,
    }
    with Progress(chosen.quiet, lines=True) as progress:
        report = analyse_fleet(
            [*chosen.recording, *chosen.fleet],
            chosen.out,
            robot,
            chosen.columns,
            progress=lambda done, count, path: progress.show(
                f"{done} of {count} recordings: {printable(path)}"
            ),
            **options,
        )
    if not chosen.quiet:
        print(printable(format_report(report)))
    if not report["recordings"]:
        return FAILED
    return (
        DOUBTFUL if report["failed"] or any(row["wrong"] for row in report["recordings"]) else DONE
    )


def format_report(report):
    """Return the results of a fleet as text."""
    lines = [line for robot in report["robots"] for line in (*_robot_lines(robot), "")]
    failed = report["failed"]
    kept = f", {report['kept']} unchanged" if report["kept"] else ""
    lines.append(f"{report['computed']} recordings analysed{kept}, {len(failed)} failed")
    lines += [f"  {path}: {text}" for path, text in list(failed.items())[:MAX_LISTED]]
    if len(failed) > MAX_LISTED:
        lines.append(f"  … {len(failed) - MAX_LISTED} more; fleet.json has all")
    return "\n".join(lines)


def _robot_lines(robot):
    """Yield lines on all recordings of a robot."""
    energy, total = robot["kinetic_energy"], robot["explained_with_potential"]
    yield f"Robot '{robot['robot']}': {robot['recordings']} recordings, {robot['hours']:.4g} h, {robot['states']} states"
    below = [
        f"{part:.0%} of states below {_quantile(energy['histogram'], part):.3g} J"
        for part in (0.5, 0.99)
    ]
    yield f"  kinetic energy: maximum {energy['max']:.4g} J, {', '.join(below)}"
    yield f"    in {energy['recording']} at {energy['at']:.6f} s"
    if robot["explained"] is not None:
        also = "" if total is None else f" ({total:.3f} with potential energy)"
        rest = f"residual {robot['residual_power']:.3g} W rms"
        yield f"  power balance: variance explained {robot['explained']:.3f}{also}, {rest}"
    if robot["unjudged"] or robot["collisions"]:
        yield f"  {describe_collisions(robot)}"
    for heading, counts in (("rejected", robot["rejected"]), ("findings", robot["findings"])):
        causes = [
            f"{cause} ({n} ×)" for cause, n in sorted(counts.items(), key=lambda one: -one[1])
        ]
        more = f" and {len(causes) - MAX_LISTED} more causes" if len(causes) > MAX_LISTED else ""
        if causes:
            yield f"  {heading}: {', '.join(causes[:MAX_LISTED])}{more}"


def _quantile(histogram, part):
    """Return the upper bound of the bin that this part of the states does not exceed [J]."""
    states = [one["states"] for one in histogram]
    k = int(np.searchsorted(np.cumsum(states), part * sum(states)))
    return histogram[k]["to"] if histogram else 0.0


def format_table(summaries, failed):
    """Return a line for each recording, of these summaries and paths that failed."""
    rows = [
        (
            "states",
            "s",
            "K max [J]",
            "explained",
            "residual [W]",
            "collisions",
            "rejected",
            "recording",
        )
    ]
    for one in summaries:
        numbers = [one["states"], one["duration"], one["kinetic_energy"]["max"], one["explained"]]
        numbers += [one["residual_power"], count_collisions(one), sum(one["rejected"].values())]
        formats = zip(numbers, ("d", ".6g", ".4g", ".3f", ".3g", "d", "d"), strict=True)
        rows.append(
            (*("-" if x is None else format(x, form) for x, form in formats), one["recording"])
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    lines = ["  ".join([*map(str.rjust, row[:-1], widths), row[-1]]) for row in rows]
    return "\n".join([*lines, *(f"failed: {path}" for path in failed)])
