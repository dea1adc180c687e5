# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of a fleet: a row for each recording, and all of them together for each robot."""

from collections import Counter

from diag_dynamics.recordings.balance import Balance, Moments
from diag_dynamics.recordings.histogram import Histogram
from diag_dynamics.recordings.summary import wrongs_of

MOMENTS = "kinetic", "total", "residual"

FEW = 5
"""Causes, and recordings that failed, that the text tells of one by one."""

KINDS = {
    "recording": "string",
    "robot": "string",
    "states": "int64",
    "hours": "float64",
    "kinetic_energy_max": "float64",
    "kinetic_energy_max_at": "float64",
    "kinetic_energy_mean": "float64",
    "explained": "float64",
    "explained_with_potential": "float64",
    "residual_power": "float64",
    "external_torque_max": "float64",
    "collisions": "int64",
    "rejected": "int64",
    "unread": "int64",
    "warnings": "int64",
    "wrong": "string",
    "pieces": "int64",
    "error": "string",
}
"""Columns of fleet.parquet with pyarrow's kinds, which no row may tell where a number is unknown in all of them."""

QUANTILES = 0.5, 0.99
"""Parts of the states below whose energy they are, that the text tells of."""


def report_of(summaries):
    """What is told of recordings.

    Parameters
    ----------
    summaries : list of dict
        As of :func:`summary_of`, with `recording`, the path.

    Returns
    -------
    dict
        `recordings`: of each one `recording`, `robot`, `states`, `hours`, `kinetic_energy_max` [J],
        `kinetic_energy_max_at` [s], `kinetic_energy_mean` [J], `explained`, `explained_with_potential`, `residual_power` [W],
        `external_torque_max` [N m, N], numbers of `collisions` (None where nothing is known of them), `rejected` messages,
        `unread` parts and `warnings`, what is `wrong` in words, and `pieces`. `robots`: of each one `robot`, `recordings`
        (their number), `states`, `hours`, `kinetic_energy`: `max`, `recording`, `at`, `mean`, `histogram`; `explained`,
        `explained_with_potential`, `residual_power` over all windows;
        `collisions`, and `unjudged`, the number of recordings in which nothing is known of any; `rejected` and `findings`:
        numbers by cause; `warnings`.
    """
    return {"recordings": [_row(summary) for summary in summaries], "robots": robots_of(summaries)}


def robots_of(summaries):
    """What is told of each robot over all its recordings, as in :func:`report_of`."""
    robots = {}
    for summary in summaries:
        robots.setdefault(summary["robot"], []).append(summary)
    return [_robot(name, of) for name, of in sorted(robots.items())]


def rows_of(report):
    """Rows of fleet.parquet: those of recordings, with the `error` of those that failed."""
    rows = [row | {"error": None} for row in report["recordings"]]
    return rows + [{"recording": path, "error": text} for path, text in report["failed"].items()]


def _row(summary):
    energy, torque = summary["kinetic_energy"], summary["peaks"].get("external_torque")
    return {
        "recording": summary["recording"],
        "robot": summary["robot"],
        "states": summary["states"],
        "hours": summary["duration"] / 3600.0,
        "kinetic_energy_max": energy["max"],
        "kinetic_energy_max_at": energy["at"],
        "kinetic_energy_mean": energy["mean"],
        "explained": summary["explained"],
        "explained_with_potential": summary["explained_with_potential"],
        "residual_power": summary["residual_power"],
        "external_torque_max": None if torque is None else torque["value"],
        "collisions": _collisions(summary),
        "rejected": sum(summary["rejected"].values()),
        "unread": sum(one["cause"] == "unread" for one in summary["findings"]),
        "warnings": len(summary["warnings"]),
        "wrong": "; ".join(wrongs_of(summary)),
        "pieces": summary["pieces"],
    }


def _collisions(summary):
    """How many there are; None where nothing is known of them, as for want of a threshold."""
    observer = summary["observer"]
    return len(summary["collisions"]) if observer["observed"] and not observer["missing"] else None


def _robot(name, summaries):
    states = sum(one["states"] for one in summaries)
    highest = max(summaries, key=lambda one: one["kinetic_energy"]["max"])
    histogram, balance = Histogram(), Balance(())
    rejected, findings = Counter(), Counter()
    known = [number for one in summaries if (number := _collisions(one)) is not None]
    balance.moved = any(one["explained"] is not None for one in summaries)
    for one in summaries:
        histogram.add(Histogram.of(one["kinetic_energy"]["histogram"]))
        for moments in MOMENTS:
            getattr(balance, moments).add(Moments(**one["balance"]["moments"][moments]))
        rejected.update(one["rejected"])
        for finding in one["findings"]:
            findings[finding["cause"]] += finding["count"]
    return {
        "robot": name,
        "recordings": len(summaries),
        "states": states,
        "hours": sum(one["duration"] for one in summaries) / 3600.0,
        "kinetic_energy": {
            "max": highest["kinetic_energy"]["max"],
            "recording": highest["recording"],
            "at": highest["kinetic_energy"]["at"],
            "mean": sum(one["kinetic_energy"]["mean"] * one["states"] for one in summaries) / states,
            "histogram": histogram.told(),
        },
        "explained": balance.explained,
        "explained_with_potential": balance.explained_total,
        "residual_power": balance.residual_power,
        "collisions": sum(known) if known else None,
        "unjudged": len(summaries) - len(known),
        "rejected": dict(rejected),
        "findings": dict(findings),
        "warnings": sum(len(one["warnings"]) for one in summaries),
    }


def text_of(report):
    """The same for people."""
    lines = []
    for robot in report["robots"]:
        lines += [*_about(robot), ""]
    failed = report["failed"]
    kept = f", {report['kept']} had been" if report["kept"] else ""
    lines.append(f"{report['computed']} recordings analysed{kept}; {len(failed)} failed")
    lines += [f"  {path}: {text}" for path, text in list(failed.items())[:FEW]]
    if len(failed) > FEW:
        lines.append(f"  … {len(failed) - FEW} more; fleet.json has all")
    return "\n".join(lines)


def table_of(summaries, failed):
    """A line for each recording.

    Parameters
    ----------
    summaries : list of dict
    failed : dict
        What is wrong with others, by path.
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


def collisions_of(robot, what="collisions"):
    """How many a robot had, and in how many of its recordings nothing is known of them, in words."""
    unjudged = robot["unjudged"]
    if robot["collisions"] is None:
        return f"nothing is known of {what}: their thresholds are not set, or there are no efforts"
    return f"{robot['collisions']} {what}" + (f", nothing known in {unjudged} recordings" if unjudged else "")


def _about(robot):
    energy = robot["kinetic_energy"]
    below = ", ".join(f"{part:.0%} of states below {_quantile(energy['histogram'], part):.3g} J" for part in QUANTILES)
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
    if robot["unjudged"]:
        lines.append(f"  {collisions_of(robot)}")
    elif robot["collisions"]:
        lines.append(f"  {robot['collisions']} collisions")
    for what, counts in (("rejected", robot["rejected"]), ("worth knowing", robot["findings"])):
        some = sorted(counts.items(), key=lambda one: -one[1])[:FEW]
        if some:
            more = f" and {len(counts) - FEW} more causes" if len(counts) > FEW else ""
            lines.append(f"  {what}: " + ", ".join(f"{cause} ({count} ×)" for cause, count in some) + more)
    return lines


def _quantile(histogram, part):
    """Upper bound of the bin within which so many of the states are reached [J]."""
    wanted, reached = part * sum(one["states"] for one in histogram), 0
    for one in histogram:
        reached += one["states"]
        if reached >= wanted:
            return one["to"]
    return 0.0
