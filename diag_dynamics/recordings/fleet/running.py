# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The analysis of a fleet's archive: tasks are handed to Dask, and what comes back is told of in one table."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from typing import Any
from uuid import uuid4

from diag_dynamics.batch import cores
from diag_dynamics.checks import positive
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.parameters.robots import model_of, require_as_made
from diag_dynamics.recordings.atomic_file import AtomicFile
from diag_dynamics.recordings.fleet import tasks
from diag_dynamics.recordings.fleet.jobs import OWN, Options, jobs_of
from diag_dynamics.recordings.fleet.page import page_of
from diag_dynamics.recordings.fleet.table import KINDS, report_of, rows_of
from diag_dynamics.recordings.sources import checked_topics

PIECE = 600.0
"""Length of the pieces of long recordings [s]: the time to settle is less than a hundredth of it."""

MISSING = "a fleet's recordings are analysed by Dask, which is not installed: pip install 'dask[distributed]'."


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
    piece: float = PIECE,
    parquet: bool = True,
    reports: bool = False,
    progress: Callable[[int, int, str], object] | None = None,
) -> dict[str, Any]:
    """Analyse many recordings, each by a task of its own, long ones in pieces; what has been done already stays.

    A recording that cannot be analysed is told of, and stops no other. Processes are begun anew for the work: a script that
    calls this has to do so below ``if __name__ == "__main__":``.

    Parameters
    ----------
    patterns : sequence of str
        Paths of recordings, or patterns as of a shell; ``**`` is any number of folders.
    out : str or Path
        Folder for the outputs, which all workers share: of each recording a summary in JSON and its columns in Parquet; and
        fleet.json, fleet.parquet and fleet.html, the table of all. No two runs may write into one folder at the same time.
    model, columns, topic, joint_names, parameters
        As of :func:`read_recording`.
    gain : float
        Of the observer [1/s], where the parameters have none.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://10.0.0.1:8786``, whose workers have this package; without it, processes
        of this machine.
    workers : int, optional
        Number of those processes, by default as many as there are processors.
    piece : float
        Length of the pieces of recordings that are longer [s]; their results are those of one piece.
    parquet : bool
        Whether columns are written, and not only summaries.
    reports : bool
        Whether a report of each recording is written, too, as :class:`ReportOutput` has it: then none is cut into pieces.
    progress : callable, optional
        Called with the number of recordings that are done, that of all, and the path of the last one.

    Returns
    -------
    dict
        What is in fleet.json: `recordings`, summaries in short; `robots`, see `report_of`; `failed`, what is wrong with
        others, by path; and the numbers `computed` and `kept`.

    Raises
    ------
    InputError
        A pattern names nothing, an option is not possible, or Dask or pyarrow is needed and not installed.
    OSError
        The folder cannot be written, or the scheduler cannot be reached.
    """
    if isinstance(patterns, str | os.PathLike):
        raise InputError(f"patterns is {patterns!r}, expected a list of paths and patterns.")
    options = _options(model, columns, topic, joint_names, parameters, gain, piece, parquet, reports)
    out = Path(out).expanduser()
    out.mkdir(parents=True, exist_ok=True)
    jobs = jobs_of(patterns, out, options)
    summaries, failed, open_jobs = {}, {}, []
    for job in jobs:
        summary = job.finished()
        if summary is None:
            open_jobs.append(job)
        else:
            summaries[job.path] = summary
    kept = len(summaries)
    tell = progress or (lambda done, count, path: None)
    if open_jobs:
        for job, result in _results(open_jobs, scheduler, workers):
            if isinstance(result, tasks.Done):
                summaries[job.path] = result.summary
            else:
                failed[job.path] = result.text
            tell(len(summaries) + len(failed), len(jobs), job.path)
    ordered = [summaries[job.path] for job in jobs if job.path in summaries]
    report = report_of(ordered) | {
        "failed": {job.path: failed[job.path] for job in jobs if job.path in failed},
        "computed": len(summaries) - kept,
        "kept": kept,
    }
    _write(report, out, parquet, {job.path: job.outputs for job in jobs})
    return report


def _options(model, columns, topic, joint_names, parameters, gain, piece, parquet, reports):
    parameters = dict(parameters or {})
    unknown = set(parameters) - set(PARAMETERS)
    if unknown:
        raise InputError(f"the monitor has no parameter '{min(unknown)}'.")
    settings = Settings.of({name: spec.default for name, spec in PARAMETERS.items()} | parameters)
    if isinstance(model, RobotModel):
        require_as_made(settings.values)
    elif model is not None:
        model = model_of(os.fspath(model), settings.values)
    if isinstance(columns, str | os.PathLike):
        columns = str(Path(columns).expanduser().resolve())
    gain, piece = positive("gain", gain, "[1/s]"), positive("piece", piece, "[s]")
    return Options(model, columns, checked_topics(topic), joint_names, parameters, gain, parquet, reports, piece)


def _results(jobs, scheduler, workers):
    """Jobs and what became of them, Done or Failed, as they come."""
    try:
        distributed = import_module("distributed")
        if jobs[0].options.parquet:
            import_module("pyarrow.parquet")
    except ImportError as error:
        raise InputError(MISSING) from error
    unfinished = jobs[0].unfinished
    shutil.rmtree(unfinished, ignore_errors=True)  # of a run that was ended
    unfinished.mkdir()
    try:
        with ExitStack() as stack:
            if scheduler is None:
                cluster = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=workers or min(cores(), len(jobs)), threads_per_worker=1, dashboard_address=None
                    )
                )
            client = stack.enter_context(distributed.Client(cluster if scheduler is None else scheduler))
            yield from _Tasks(client, distributed.as_completed(), jobs).results()
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


class _Tasks:
    """Tasks of jobs that are under way."""

    def __init__(self, client, completed, jobs):
        self._client, self._completed = client, completed
        self._of, self._pieces = (
            {},
            {},
        )  # job of each future that is waited for, by key; futures of pieces, by name and span
        for job in jobs:
            job.json.unlink(missing_ok=True)
            job.html.unlink(missing_ok=True)
            _remove(job.parquet)
            self._wait(job, tasks.begin, job)

    def results(self):
        """Jobs and what became of them, as they come."""
        for future in self._completed:
            job = self._of.pop(future.key)
            error = future.exception()
            result = tasks.Failed(f"{type(error).__name__}: {error}") if error else future.result()
            if isinstance(result, tasks.Cut):
                self._cut(job, result.pieces)
            else:
                self._pieces.pop(job.name, None)
                yield job, result

    def _cut(self, job, pieces):
        """Have pieces analysed, those that are not yet, and put together."""
        known = self._pieces.get(job.name, {})
        self._pieces[job.name] = futures = {
            span: known.get(span) or self._submitted(job, tasks.piece, job, span) for span in pieces
        }
        self._wait(job, tasks.finish, job, pieces, list(futures.values()))

    def _wait(self, job, task, *arguments):
        future = self._submitted(job, task, *arguments)
        self._of[future.key] = job
        self._completed.add(future)

    def _submitted(self, job, task, *arguments):
        return self._client.submit(task, *arguments, key=f"{task.__name__}-{job.name}-{uuid4().hex}", pure=False)


def _remove(path):
    """Delete a file or a folder, if it is there."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _write(report, out, parquet, outputs):
    """Write fleet.json, fleet.html and fleet.parquet, each of which has a temporary name until it is whole."""
    texts = {OWN[0]: json.dumps(report, indent=1, allow_nan=False), OWN[2]: page_of(report, outputs)}
    for name, text in texts.items():
        part = AtomicFile(out / name)
        Path(part.name).write_text(text, encoding="utf-8", errors="backslashreplace")
        part.commit()
    if not parquet:
        return
    try:
        arrow = import_module("pyarrow")
        writer = import_module("pyarrow.parquet")
    except ImportError as error:
        raise InputError(MISSING) from error
    part, schema = (
        AtomicFile(out / OWN[1]),
        arrow.schema([(name, getattr(arrow, kind)()) for name, kind in KINDS.items()]),
    )
    writer.write_table(arrow.Table.from_pylist(rows_of(report), schema), part.name)
    part.commit()
