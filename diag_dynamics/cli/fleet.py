# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse --fleet`: many recordings, and one table of them."""

import sys

from diag_dynamics.cli import common
from diag_dynamics.cli.common import DONE, DOUBTFUL, FAILED
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.fleet_analysis import analyse_fleet
from diag_dynamics.text import Progress, plain, shortened

ALONE = "mcap", "topics", "parquet", "csv", "report", "json", "threads"  # options without --fleet


def add_arguments(parser):
    """Declare the options of a fleet."""
    group = parser.add_argument_group("many recordings")
    text = "paths or patterns; ** is any number of folders"
    group.add_argument("--fleet", metavar="PATTERN", nargs="*", help=text)
    text = "folder for fleet.html, fleet.csv, and a summary and a Parquet file of each"
    group.add_argument("--out", metavar="DIR", help=text)
    text = "Dask cluster (default: local processes)"
    group.add_argument("--scheduler", metavar="tcp://HOST:PORT", help=text)


def refuse(chosen):
    """Reject options of many recordings."""
    for name in ("out", "scheduler"):
        if getattr(chosen, name) is not None:
            raise InputError(f"--{name} requires --fleet.")


def analyse(chosen, parameters, robot):
    """Analyse the recordings; return the exit status."""
    if alone := [name for name in ALONE if getattr(chosen, name) is not None]:
        text = "cannot be combined with --fleet, which writes its results into --out DIR."
        raise InputError(f"--{alone[0]} {text}")
    if chosen.out is None:
        raise InputError("--out is missing; --fleet requires --out DIR for its results.")
    with Progress(chosen.quiet, lines=True) as progress:
        rows = analyse_fleet(
            [*chosen.recording, *chosen.fleet],
            chosen.out,
            robot,
            gain=common.GAIN if chosen.gain is None else chosen.gain,
            scheduler=chosen.scheduler,
            progress=lambda done, count, path: progress.show(
                f"{done} of {count} recordings: {plain(path)}"
            ),
            parameters=parameters,
            **common.reading_options(chosen),
        )
    errors = [shortened(row["error"]) for row in rows if "error" in row]
    if not chosen.quiet:
        for error in errors:
            print(f"diag-dynamics analyse: {error}", file=sys.stderr)
        text = f"{len(rows) - len(errors)} recordings analysed, {len(errors)} failed"
        print(plain(f"{text}: {chosen.out}/fleet.html"))
    if len(errors) == len(rows):
        return FAILED
    return DOUBTFUL if errors or any(row["faults"] for row in rows) else DONE
