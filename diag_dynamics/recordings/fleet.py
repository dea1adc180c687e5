# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fleet's archive: every recording is a task of Dask, and one table has all of them."""

from __future__ import annotations

import glob
import hashlib
import json
import os
import pickle
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module, resources
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import diag_dynamics
from diag_dynamics.checks import positive
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.optional import require
from diag_dynamics.parameters.robots import model_of, require_as_made
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.atomic_file import AtomicFile
from diag_dynamics.recordings.balance import MIN_WINDOWS, explained_share
from diag_dynamics.recordings.findings import no_states_error
from diag_dynamics.recordings.outputs.report import ReportOutput
from diag_dynamics.recordings.outputs.tables import TableOutput
from diag_dynamics.recordings.recording import Reading, make_settings
from diag_dynamics.recordings.sources import check_topics
from diag_dynamics.recordings.summary import count_collisions, describe_faults, summarize
from diag_dynamics.threads import cores

COLUMNS = {
    "recording": ("string", itemgetter("recording")),
    "robot": ("string", itemgetter("robot")),
    "states": ("int64", itemgetter("states")),
    "hours": ("float64", lambda one: one["duration"] / 3600.0),
    "kinetic_energy_max": ("float64", lambda one: one["kinetic_energy"]["max"]),
    "kinetic_energy_max_at": ("float64", lambda one: one["kinetic_energy"]["at"]),
    "kinetic_energy_mean": ("float64", lambda one: one["kinetic_energy"]["mean"]),
    "explained": ("float64", itemgetter("explained")),
    "explained_with_potential": ("float64", itemgetter("explained_with_potential")),
    "residual_power": ("float64", itemgetter("residual_power")),
    "external_torque_max": (
        "float64",
        lambda one: one["peaks"].get("external_torque", {}).get("value"),
    ),
    "collisions": ("int64", count_collisions),
    "rejected": ("int64", lambda one: sum(one["rejected"].values())),
    "unread": (
        "int64",
        lambda one: sum(finding["cause"] == "unread" for finding in one["findings"]),
    ),
    "warnings": ("int64", lambda one: len(one["warnings"])),
    "wrong": ("string", lambda one: "; ".join(describe_faults(one))),
}
"""Types of the columns of fleet.parquet, and their values from a summary."""


def analyse_fleet(
    patterns: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    model: RobotModel | str | os.PathLike[str] | None = None,
    columns: Any = None,
    *,
    topic: str | Sequence[str] | None = None,
    joint_names: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    gain: float = 25.0,
    scheduler: str | None = None,
    workers: int | None = None,
    parquet: bool = True,
    reports: bool = False,
    progress: Callable[[int, int, str], object] | None = None,
) -> dict[str, Any]:
    """Analyse many recordings, each by a task of Dask, except those whose results exist.

    Dask starts processes: scripts call this below ``if __name__ == "__main__":``.

    Parameters
    ----------
    patterns : sequence of str
        Paths of recordings, or patterns of a shell; ``**`` is any number of folders.
    out : str or Path
        Folder that all workers share, for one call at a time: a summary in JSON and columns in Parquet of
        each recording; fleet.json, fleet.parquet and fleet.html.
    model, columns, topic, joint_names, parameters
        As of :func:`read_recording`.
    gain : float
        Gain of the observer [1/s], where the parameters have none.
    scheduler : str, optional
        Address of Dask, as ``tcp://10.0.0.1:8786``; by default processes of this machine.
    workers : int, optional
        Number of these; by default that of the processors.
    parquet, reports : bool
        Whether to write columns, and a report, of each recording.
    progress : callable, optional
        Called with the numbers of finished and of all recordings, and the path of the last one.

    Returns
    -------
    dict
        As fleet.json: `recordings`, rows of fleet.parquet; `robots`; `failed`, errors by the path of the
        recording; numbers `computed` and `kept`.

    Raises
    ------
    InputError
        A pattern matches nothing, an option is not possible, or Dask or pyarrow is not installed.
    OSError
        The folder cannot be written, or the scheduler cannot be reached.
    """
    if isinstance(patterns, str | os.PathLike):
        raise InputError(f"patterns is {patterns!r}, expected a list of paths and patterns.")
    for name in ("distributed", "jinja2", *(["pyarrow.parquet"] if parquet else [])):
        require(name, "the analysis of a fleet")
    values = make_settings(parameters).values
    if isinstance(model, RobotModel):
        require_as_made(values)
    elif model is not None:
        model = model_of(os.fspath(model), values)
    if isinstance(columns, str | os.PathLike):
        columns = str(Path(columns).expanduser().resolve())
    options = {"model": model, "columns": columns, "topic": check_topics(topic)}
    options |= {"joint_names": joint_names, "parameters": dict(parameters or {})}
    suffixes = [suffix for suffix, chosen in (("parquet", parquet), ("html", reports)) if chosen]
    out = Path(out).expanduser().resolve()
    out.mkdir(parents=True, exist_ok=True)
    about = options | {"gain": positive("gain", gain, "[1/s]"), "outputs": suffixes}
    jobs = _make_jobs(patterns, out, about)
    results = {job.path: summary for job in jobs if (summary := job.read_summary())}
    kept = len(results)
    for path, result in _run(
        [job for job in jobs if job.path not in results], options, scheduler, workers
    ):
        results[path] = result
        if progress:
            progress(len(results), len(jobs), path)
    results = {job.path: results[job.path] for job in jobs}
    summaries = [result for result in results.values() if isinstance(result, dict)]
    report = {
        "recordings": list(map(_make_row, summaries)),
        "robots": merge_robots(summaries),
        "failed": {path: text for path, text in results.items() if isinstance(text, str)},
        "computed": len(summaries) - kept,
        "kept": kept,
    }
    _write(out / "fleet.json", json.dumps(report, indent=1, allow_nan=False))
    _write(out / "fleet.html", _make_page(report, jobs))
    if parquet:
        _write_table(out / "fleet.parquet", report)
    return report


class _Job(NamedTuple):
    path: str
    stem: str  # path of the outputs without a suffix
    fingerprint: dict  # of the recording and all options

    def output(self, suffix):
        return Path(f"{self.stem}.{suffix}")

    def read_summary(self):
        """Return the summary, which is written last; None if it is not that of the same job."""
        try:
            summary = json.loads(self.output("json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        is_complete = all(self.output(suffix).exists() for suffix in self.fingerprint["outputs"])
        return summary if is_complete and summary.get("fingerprint") == self.fingerprint else None

    def remove_outputs(self, suffix):
        for path in glob.glob(f"{glob.escape(self.stem)}.{suffix}"):
            os.remove(path)


def _make_jobs(patterns, out, about):
    """Return the jobs of all recordings but of what is in the folder of the outputs; `about` has all options."""
    paths = {}
    for pattern in map(os.path.expanduser, map(os.fspath, patterns)):
        names = [pattern] if os.path.exists(pattern) else sorted(glob.glob(pattern, recursive=True))
        if not names:
            raise InputError(f"there is no recording '{pattern}'.")
        paths |= dict.fromkeys(Path(name).resolve() for name in names)
    about = about | {"version": diag_dynamics.__version__}
    if isinstance(about["columns"], str):
        about["columns"] = Path(about["columns"]).read_text(encoding="utf-8", errors="replace")
    if about["model"] is not None:
        about["model"] = hashlib.sha256(pickle.dumps(about["model"])).hexdigest()
    about, jobs = json.loads(json.dumps(about, default=str)), []
    for path in paths:
        if path == out or out in path.parents:
            continue
        words = re.sub(r"[^\w.-]+", "_", f"{path.parent.name}-{path.stem}").strip("_.-")
        stem = str(out / f"{words}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}")
        files = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
        times = [[one.name, one.stat().st_size, one.stat().st_mtime_ns] for one in files]
        jobs.append(_Job(str(path), stem, about | {"input": times}))
    return jobs


def _run(jobs, options, scheduler, workers):
    """Analyse recordings; yield the path of each and its summary or the text of its error."""
    if not jobs:
        return
    distributed = import_module("distributed")
    for job in jobs:
        job.remove_outputs("*")
    local = {
        "threads_per_worker": 1,
        "dashboard_address": None,
        "n_workers": workers or min(cores(), len(jobs)),
    }
    try:
        with distributed.Client(scheduler, **({} if scheduler else local)) as client:
            futures = client.map(_analyse, jobs, options=options, retries=2, pure=False)
            paths = {future.key: job.path for future, job in zip(futures, jobs, strict=True)}
            completed = distributed.as_completed(futures)
            del futures
            for future in completed:  # enumerate would hold the future
                error, path = future.exception(), paths[future.key]
                result = f"{type(error).__name__}: {error}" if error else future.result()
                del future  # what has come is not computed again when its worker dies
                yield path, result
    finally:
        for job in jobs:
            job.remove_outputs("*.part")  # of attempts that were ended


def _analyse(job, options):
    """Analyse a recording on a worker; return its summary, or the text of its error."""
    try:
        reading, outputs = Reading(job.path, **options), []
        analysis = Analysis(reading, gain=job.fingerprint["gain"], threads=1)
        if "parquet" in job.fingerprint["outputs"]:
            outputs.append(TableOutput(job.output("parquet"), reading, analysis.friction))
        if "html" in job.fingerprint["outputs"]:
            outputs.append(ReportOutput(job.output("html"), reading))
        analysis.run(outputs)
        if not analysis.states:
            raise no_states_error(job.path, analysis.findings)
        summary = summarize(analysis) | {"recording": job.path}
        for output in outputs:
            output.close(summary)
        summary["fingerprint"] = job.fingerprint
        _write(job.output("json"), json.dumps(summary, indent=1, allow_nan=False))
        return summary
    except (DiagDynamicsError, OSError) as error:
        return str(error)


def merge_robots(summaries):
    """Return the results of all recordings of each robot together, a list of dict."""
    names = sorted({one["robot"] for one in summaries})
    return [_merge_summaries([one for one in summaries if one["robot"] == name]) for name in names]


def _merge_summaries(summaries):
    rows = list(map(_make_row, summaries))
    highest = max(rows, key=lambda row: row["kinetic_energy_max"])
    known = [row["collisions"] for row in rows if row["collisions"] is not None]
    states, energies = (
        sum(row["states"] for row in rows),
        [one["kinetic_energy"] for one in summaries],
    )
    bins = _add_up(
        ((part["from"], part["to"]), part["states"])
        for one in energies
        for part in one["histogram"]
    )
    return {
        "robot": highest["robot"],
        "recordings": len(rows),
        "states": states,
        "hours": sum(row["hours"] for row in rows),
        "kinetic_energy": {
            "max": highest["kinetic_energy_max"],
            "recording": highest["recording"],
            "at": highest["kinetic_energy_max_at"],
            "mean": sum(row["kinetic_energy_mean"] * row["states"] for row in rows) / states,
            "histogram": [
                {"from": low, "to": high, "states": n} for (low, high), n in sorted(bins.items())
            ],
        },
        **_merge_balances(summaries),
        "collisions": sum(known) if known else None,
        "unjudged": len(rows) - len(known),
        "rejected": _add_up(pair for one in summaries for pair in one["rejected"].items()),
        "findings": _add_up(
            (one["cause"], one["count"]) for each in summaries for one in each["findings"]
        ),
        "warnings": sum(row["warnings"] for row in rows),
    }


def _make_row(summary):
    return {name: value(summary) for name, (_, value) in COLUMNS.items()}


def _add_up(pairs):
    """Return the sum of the numbers of each key."""
    totals = Counter()
    for key, count in pairs:
        totals[key] += count
    return dict(totals)


def _merge_balances(summaries):
    """Return the balance of power over the windows of all recordings."""

    def pooled(name):
        """Return number, mean and variance over all windows."""
        moments = [one["balance"]["moments"][name] for one in summaries]
        count, means, squares = (
            np.array([one[key] for one in moments]) for key in ("count", "mean", "squares")
        )
        windows = max(int(count.sum()), 1)
        mean = count @ means / windows
        return count.sum(), mean, (squares.sum() + count @ (means - mean) ** 2) / windows

    windows, mean, variance = pooled("residual")
    has_moved = any(one["explained"] is not None for one in summaries)
    shares = [
        explained_share(variance, pooled(name)[2]) if has_moved else None
        for name in ("kinetic", "total")
    ]
    balance = *shares, float(np.sqrt(variance + mean**2))
    names = "explained", "explained_with_potential", "residual_power"
    return dict(zip(names, balance if windows >= MIN_WINDOWS else [None] * 3, strict=True))


def describe_collisions(robot):
    """Return how many a robot had, and in how many of its recordings this is unknown."""
    if robot["collisions"] is None:
        return "collisions unknown: no thresholds, or no efforts"
    unknown = f", unknown in {robot['unjudged']} recordings" if robot["unjudged"] else ""
    return f"{robot['collisions']} collisions{unknown}"


def _write(path, text):
    file = AtomicFile(path)
    Path(file.name).write_text(text, encoding="utf-8", errors="backslashreplace")
    file.commit()


def _make_page(report, jobs):
    """Return fleet.html. All texts are escaped: names of files and robots come from strangers."""
    jinja2, rows = import_module("jinja2"), report["recordings"]
    text = (
        resources.files("diag_dynamics.recordings")
        .joinpath("fleet.html.j2")
        .read_text(encoding="utf-8")
    )
    template = jinja2.Template(text, autoescape=True, undefined=jinja2.StrictUndefined)
    folders = [os.path.dirname(row["recording"]) for row in rows]
    outputs = {job.path: [job.output("html"), job.output("json")] for job in jobs}
    return template.render(
        report,
        links={
            path: [file.name for file in files if file.exists()] for path, files in outputs.items()
        },
        folder=os.path.join(os.path.commonpath(folders), "") if folders else "",
        wrong={row["recording"]: row["wrong"] for row in rows if row["wrong"]},
        collisions=describe_collisions,
    )


def _write_table(path, report):
    arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    types = {name: kind for name, (kind, _) in COLUMNS.items()} | {"error": "string"}
    schema = arrow.schema([(name, getattr(arrow, kind)()) for name, kind in types.items()])
    rows = report["recordings"] + [
        {"recording": one, "error": text} for one, text in report["failed"].items()
    ]
    rows = [
        {name: printable(x) if isinstance(x, str) else x for name, x in row.items()} for row in rows
    ]
    file = AtomicFile(path)
    parquet.write_table(arrow.Table.from_pylist(rows, schema), file.name)
    file.commit()


def printable(text):
    """Return a text in which escapes stand for the bytes of a file's name that are not UTF-8."""
    return text.encode(errors="backslashreplace").decode()
