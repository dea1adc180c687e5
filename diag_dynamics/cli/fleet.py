# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse --fleet`: many recordings, and one table of them."""

import sys

from diag_dynamics.cli.given import gain_of, parse_joint_names
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.fleet import analyse_fleet, collisions_in_words, printable

ALONE = "mcap", "topics", "parquet", "csv", "report", "json", "threads", "start", "end"
"""Options of a single recording."""

TOGETHER = "out", "scheduler", "workers", "no_parquet", "reports"
"""Options of many."""

FEW = 5
"""Causes and failed recordings that the text lists one by one."""


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
            parquet=not chosen.no_parquet,
            reports=chosen.reports,
            progress=progress,
        )
    if not chosen.quiet:
        print(printable(text_of(report)))
    return report


def text_of(report):
    """Return the results of a fleet as text."""
    lines = []
    for robot in report["robots"]:
        lines += [*_about_robot(robot), ""]
    failed = report["failed"]
    kept = f", {report['kept']} had been" if report["kept"] else ""
    lines.append(f"{report['computed']} recordings analysed{kept}; {len(failed)} failed")
    lines += [f"  {path}: {text}" for path, text in list(failed.items())[:FEW]]
    if len(failed) > FEW:
        lines.append(f"  … {len(failed) - FEW} more; fleet.json has all")
    return "\n".join(lines)


def _about_robot(robot):
    energy = robot["kinetic_energy"]
    bounds = [(part, _quantile(energy["histogram"], part)) for part in (0.5, 0.99)]
    below = ", ".join(f"{part:.0%} of states below {bound:.3g} J" for part, bound in bounds)
    lines = [
        f"Robot '{robot['robot']}': {robot['recordings']} recordings, {robot['hours']:.4g} h, {robot['states']} states",
        f"  kinetic energy: at most {energy['max']:.4g} J, {below}",
        f"    in {energy['recording']} at {energy['at']:.6f} s",
    ]
    if robot["explained"] is not None:
        total = robot["explained_with_potential"]
        also = "" if total is None else f" (with potential energy {total:.3f})"
        rest = f"residual {robot['residual_power']:.3g} W rms"
        lines.append(f"  balance of power: explained {robot['explained']:.3f}{also}, {rest}")
    if robot["unjudged"] or robot["collisions"]:
        lines.append(f"  {collisions_in_words(robot)}")
    for heading, counts in (("rejected", robot["rejected"]), ("worth knowing", robot["findings"])):
        some = sorted(counts.items(), key=lambda one: -one[1])[:FEW]
        if some:
            more = f" and {len(counts) - FEW} more causes" if len(counts) > FEW else ""
            lines.append(f"  {heading}: " + ", ".join(f"{cause} ({count} ×)" for cause, count in some) + more)
    return lines


def _quantile(histogram, part):
    """Return the upper bound of the bin within which this part of the states is reached [J]."""
    wanted, reached = part * sum(one["states"] for one in histogram), 0
    for one in histogram:
        reached += one["states"]
        if reached >= wanted:
            return one["to"]
    return 0.0


def table_of(summaries, failed):
    """Return a line for each recording.

    Parameters
    ----------
    summaries : list of dict
    failed : iterable of str
        Paths of the other recordings.
    """
    rows = [("states", "s", "K max [J]", "explained", "residual [W]", "rejected", "recording")]
    for one in summaries:
        explained, residual = one["explained"], one["residual_power"]
        rows.append(
            (
                str(one["states"]),
                f"{one['duration']:.6g}",
                f"{one['kinetic_energy']['max']:.4g}",
                "-" if explained is None else f"{explained:.3f}",
                "-" if residual is None else f"{residual:.3g}",
                str(sum(one["rejected"].values())),
                one["recording"],
            )
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join([*(text.rjust(width) for text, width in zip(row[:-1], widths, strict=False)), row[-1]])
        for row in rows
    ]
    return "\n".join([*lines, *(f"failed: {path}" for path in failed)])


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
            print(f"{begin}{done} of {count} recordings: {printable(path)}", end=end, file=sys.stderr, flush=True)
