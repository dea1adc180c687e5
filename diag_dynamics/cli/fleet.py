# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse --fleet`: many recordings, and one table of them."""

import sys

from diag_dynamics.cli.given import gain_of, parse_joint_names
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.fleet.running import PIECE, analyse_fleet
from diag_dynamics.recordings.fleet.table import text_of

ALONE = "mcap", "topics", "parquet", "csv", "report", "json", "threads", "start", "end"
"""Options of a single recording."""

TOGETHER = "out", "scheduler", "workers", "piece", "no_parquet", "reports"
"""Options of many."""


def add_arguments(parser):
    """Declare the options of a fleet."""
    group = parser.add_argument_group("many recordings")
    group.add_argument("--fleet", metavar="PATTERN", nargs="*", help="recordings: paths or patterns, ** is any folders")
    group.add_argument(
        "--out", metavar="DIR", help="folder for a summary and a Parquet file of each, fleet.json and fleet.html"
    )
    group.add_argument(
        "--scheduler", metavar="tcp://HOST:PORT", help="of a Dask cluster (default: processes of this machine)"
    )
    group.add_argument("--workers", type=int, help="number of these processes (default: as many as processors)")
    group.add_argument(
        "--piece", type=float, metavar="SECONDS", help=f"long ones are cut into these (default: {PIECE:g})"
    )
    group.add_argument("--no-parquet", action="store_true", help="summaries alone")
    group.add_argument("--reports", action="store_true", help="a report of each, too, to which fleet.html leads")


def refuse(chosen):
    """Refuse options of many recordings, of which there is one."""
    for name in TOGETHER:
        value = getattr(chosen, name)
        if value is not None and value is not False:  # 0 is a value
            raise InputError(f"--{name.replace('_', '-')} belongs to --fleet.")


def analyse(chosen, parameters, model):
    """Analyse the recordings that were chosen; returns the report."""
    given = [name for name in ALONE if getattr(chosen, name) is not None]
    if given:
        raise InputError(f"--{given[0]} is of a single recording, not of --fleet, which writes into --out.")
    if chosen.out is None:
        raise InputError("--fleet needs --out DIR, the folder for what is written.")
    if chosen.workers is not None and chosen.workers < 1:
        raise InputError(f"--workers is {chosen.workers}, expected at least 1.")
    with _Progress(chosen.quiet) as progress:
        report = analyse_fleet(
            [*chosen.recording, *chosen.fleet],
            chosen.out,
            model,
            chosen.columns,
            topic=chosen.topic,
            joint_names=parse_joint_names(chosen),
            parameters=parameters,
            gain=gain_of(chosen),
            scheduler=chosen.scheduler,
            workers=chosen.workers,
            piece=PIECE if chosen.piece is None else chosen.piece,
            parquet=not chosen.no_parquet,
            reports=chosen.reports,
            progress=progress,
        )
    if not chosen.quiet:
        print(text_of(report))
    return report


class _Progress:
    """A line on stderr: written anew where that is a terminal, else one for each recording."""

    def __init__(self, quiet):
        self._quiet, self._anew = quiet, sys.stderr.isatty()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if not self._quiet and self._anew:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

    def __call__(self, done, count, path):
        if not self._quiet:
            begin, end = ("\r\033[K", "") if self._anew else ("", "\n")
            print(f"{begin}{done} of {count} recordings: {path}", end=end, file=sys.stderr, flush=True)
