# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analysis of many recordings: one task of Dask for each, one table and one page for all."""

import csv
import glob
import hashlib
import io
import json
import os
import pickle
import re
from contextlib import suppress
from importlib import import_module, resources
from pathlib import Path
from typing import NamedTuple

import diag_dynamics
from diag_dynamics.atomic_file import write_text
from diag_dynamics.checks import positive
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.optional import require
from diag_dynamics.parameters.robot_models import model_of, require_as_made
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.outputs.table_files import TableOutput
from diag_dynamics.recordings.recording import Reading, make_settings
from diag_dynamics.recordings.summary import make_row
from diag_dynamics.threads import cores


def analyse_fleet(
    patterns, out, model=None, *, gain=25.0, scheduler=None, progress=None, **reading
) -> list[dict]:
    """Analyse recordings by tasks of Dask, and return the rows of ``fleet.csv``.

    Dask starts processes: scripts call this below ``if __name__ == "__main__":``.

    Parameters
    ----------
    patterns : str, Path or sequence of these
        Paths of recordings, or patterns of a shell; ``**`` is any number of folders.
    out : str or Path
        Folder for fleet.csv, fleet.html, and columns (Parquet) and a summary (JSON) of each
        recording. A summary of the same recording, options and version is not computed again.
    model, reading
        Options of :func:`read_recording`.
    gain : float
        Gain of the observer [1/s], where the parameters have none.
    scheduler : str, optional
        Address of Dask, as ``tcp://10.0.0.1:8786``; by default processes of this machine.
    progress : callable, optional
        Called with the numbers of finished and of all recordings, and the path of the last one.
    """
    for name in ("distributed", "jinja2", "pyarrow"):
        require(name, "the analysis of a fleet")
    values = make_settings(reading.get("parameters")).values
    if isinstance(model, RobotModel):
        require_as_made(values)
    elif model is not None:
        model = model_of(os.fspath(model), values)
    about = reading | {"gain": positive("gain", gain, "[1/s]")}
    if isinstance(columns := reading.get("columns"), str | os.PathLike):
        reading["columns"] = os.path.abspath(os.path.expanduser(columns))
        about["columns"] = Path(reading["columns"]).read_text(encoding="utf-8", errors="replace")
    robot = hashlib.sha256(pickle.dumps(model)).hexdigest()
    about |= {"model": robot, "version": diag_dynamics.__version__}
    out = Path(out).expanduser().resolve()
    rows = {}
    out.mkdir(parents=True, exist_ok=True)
    jobs = [_make_job(path, out, about) for path in _find_recordings(patterns, out)]
    for row in _run(jobs, reading | {"model": model}, gain, scheduler):
        rows[row["recording"]] = row
        if progress:
            progress(len(rows), len(jobs), row["recording"])
    table = [rows[job.path] for job in jobs]
    write_text(out / "fleet.csv", _format_csv(table))
    write_text(out / "fleet.html", _render_page(table, jobs))
    return table


class _Job(NamedTuple):
    path: str
    stem: str  # path of the outputs without a suffix
    fingerprint: str  # of the recording and all options


def _find_recordings(patterns, out):
    """Return the paths that match, except those in the folder of the outputs."""
    paths = {}
    is_single = isinstance(patterns, str | os.PathLike)
    for pattern in map(os.fspath, [patterns] if is_single else patterns):
        pattern = os.path.expanduser(pattern)
        names = [pattern] if os.path.exists(pattern) else sorted(glob.glob(pattern, recursive=True))
        if not names:
            raise InputError(f"there is no recording '{pattern}'.")
        paths |= dict.fromkeys(Path(name).resolve() for name in names)
    return [path for path in paths if out not in (path, *path.parents)]


def _make_job(path, out, about):
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    stats = [(file.name, file.stat().st_size, file.stat().st_mtime_ns) for file in files]
    fingerprint = hashlib.sha256(json.dumps([about, stats], default=str).encode()).hexdigest()
    words = re.sub(r"[^\w.-]+", "_", f"{path.parent.name}-{path.stem}").strip("_.-")
    digest = hashlib.sha256(os.fsencode(path)).hexdigest()[:8]
    return _Job(str(path), str(out / f"{words}-{digest}"), fingerprint)


def _run(jobs, options, gain, scheduler):
    """Yield the row of each recording when its task has ended."""
    distributed = import_module("distributed")
    workers = min(cores(), len(jobs))
    local = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.Client(scheduler, **({} if scheduler else local)) as client:
        futures = client.map(_analyse, jobs, options=options, gain=gain, retries=2, pure=False)
        paths = {future.key: job.path for future, job in zip(futures, jobs, strict=True)}
        for future in distributed.as_completed(futures):
            error = future.exception()
            text = f"{type(error).__name__}: {error}"
            yield {"recording": paths[future.key], "error": text} if error else future.result()


def _analyse(job, options, gain):
    """Return the row of a recording on a worker, and write its outputs unless they exist."""
    summary_path = Path(f"{job.stem}.json")
    with suppress(OSError, ValueError):
        summary = json.loads(summary_path.read_text(encoding="utf-8"))
        if summary.get("fingerprint") == job.fingerprint:
            return make_row(summary)
    try:
        _remove_outputs(job)
        reading = Reading(job.path, **options)
        analysis = Analysis(reading, gain=gain, threads=1)
        summary = analysis.run([TableOutput(f"{job.stem}.parquet", reading)])
        summary |= {"fingerprint": job.fingerprint}
        write_text(summary_path, json.dumps(summary, indent=1, allow_nan=False))
        return make_row(summary)
    except (DiagDynamicsError, OSError) as error:
        _remove_outputs(job)
        return {"recording": job.path, "error": str(error)}


def _remove_outputs(job):
    for path in glob.glob(f"{glob.escape(job.stem)}.*"):
        os.remove(path)


def _format_csv(rows):
    text = io.StringIO()
    names = dict.fromkeys(name for row in rows for name in row)
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _render_page(rows, jobs):
    """Return fleet.html. All texts are escaped: names of files and robots come from strangers."""
    source = resources.files("diag_dynamics.recordings").joinpath("fleet.html.j2")
    text = source.read_text(encoding="utf-8")
    template = import_module("jinja2").Template(text, autoescape=True)
    links = {job.path: f"{Path(job.stem).name}.json" for job in jobs}
    folders = [os.path.dirname(job.path) for job in jobs]
    folder = os.path.join(os.path.commonpath(folders), "") if folders else ""
    return template.render(rows=rows, links=links, folder=folder)
