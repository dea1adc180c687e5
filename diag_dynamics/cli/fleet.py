# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics analyse --fleet`: many recordings, and one table of them."""

import sys

import numpy as np

from diag_dynamics.cli.given import gain_of, parse_joint_names
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.fleet import analyse_fleet, describe_collisions, printable

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
    """Analyse the recordings that were chosen; return the report."""
    if given := [name for name in ALONE if getattr(chosen, name) is not None]:
        raise InputError(f"--{given[0]} is of a single recording, not of --fleet, which writes into --out.")
    if chosen.out is None:
        raise InputError("--fleet needs --out DIR, the folder for what is written.")
    if chosen.workers is not None and chosen.workers < 1:
        raise InputError(f"--workers is {chosen.workers}, expected at least 1.")
    options = {name: getattr(chosen, name) for name in ("topic", "scheduler", "workers", "reports")}
    options |= {"joint_names": parse_joint_names(chosen), "parameters": parameters, "gain": gain_of(chosen)}
    options |= {"parquet": not chosen.no_parquet, "progress": None if chosen.quiet else _show_progress}
    try:
        report = analyse_fleet([*chosen.recording, *chosen.fleet], chosen.out, model, chosen.columns, **options)
    finally:
        if not chosen.quiet and sys.stderr.isatty():
            print("\r\033[K", end="", file=sys.stderr, flush=True)
    if not chosen.quiet:
        print(printable(text_of(report)))
    return report


def _show_progress(done, count, path):
    """Write a line on stderr, over the last one where that is a terminal."""
    begin, end = ("\r\033[K", "") if sys.stderr.isatty() else ("", "\n")
    print(f"{begin}{done} of {count} recordings: {printable(path)}", end=end, file=sys.stderr, flush=True)


def text_of(report):
    """Return the results of a fleet as text."""
    lines = [line for robot in report["robots"] for line in (*_about_robot(robot), "")]
    failed = report["failed"]
    kept = f", {report['kept']} had been" if report["kept"] else ""
    lines.append(f"{report['computed']} recordings analysed{kept}; {len(failed)} failed")
    lines += [f"  {path}: {text}" for path, text in list(failed.items())[:FEW]]
    if len(failed) > FEW:
        lines.append(f"  … {len(failed) - FEW} more; fleet.json has all")
    return "\n".join(lines)


def _about_robot(robot):
    """Yield lines on all recordings of a robot."""
    energy, total = robot["kinetic_energy"], robot["explained_with_potential"]
    yield f"Robot '{robot['robot']}': {robot['recordings']} recordings, {robot['hours']:.4g} h, {robot['states']} states"
    below = [f"{part:.0%} of states below {_quantile(energy['histogram'], part):.3g} J" for part in (0.5, 0.99)]
    yield f"  kinetic energy: at most {energy['max']:.4g} J, {', '.join(below)}"
    yield f"    in {energy['recording']} at {energy['at']:.6f} s"
    if robot["explained"] is not None:
        also = "" if total is None else f" (with potential energy {total:.3f})"
        rest = f"residual {robot['residual_power']:.3g} W rms"
        yield f"  balance of power: explained {robot['explained']:.3f}{also}, {rest}"
    if robot["unjudged"] or robot["collisions"]:
        yield f"  {describe_collisions(robot)}"
    for heading, counts in (("rejected", robot["rejected"]), ("worth knowing", robot["findings"])):
        causes = [f"{cause} ({n} ×)" for cause, n in sorted(counts.items(), key=lambda one: -one[1])]
        more = f" and {len(causes) - FEW} more causes" if len(causes) > FEW else ""
        if causes:
            yield f"  {heading}: {', '.join(causes[:FEW])}{more}"


def _quantile(histogram, part):
    """Return the upper bound of the bin within which this part of the states is reached [J]."""
    states = [one["states"] for one in histogram]
    k = int(np.searchsorted(np.cumsum(states), part * sum(states)))
    return histogram[k]["to"] if histogram else 0.0


def table_of(summaries, failed):
    """Return a line for each recording, of these summaries and paths that failed."""
    rows = [("states", "s", "K max [J]", "explained", "residual [W]", "rejected", "recording")]
    for one in summaries:
        numbers = [one["states"], one["duration"], one["kinetic_energy"]["max"], one["explained"]]
        numbers += [one["residual_power"], sum(one["rejected"].values())]
        formats = zip(numbers, ("d", ".6g", ".4g", ".3f", ".3g", "d"), strict=True)
        rows.append((*("-" if x is None else format(x, form) for x, form in formats), one["recording"]))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    lines = ["  ".join([*map(str.rjust, row[:-1], widths), row[-1]]) for row in rows]
    return "\n".join([*lines, *(f"failed: {path}" for path in failed)])
