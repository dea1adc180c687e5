# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tasks about one recording, as they are sent to workers: whatever they hand over is small, and they may be run again."""

import json
import os
from typing import NamedTuple
from uuid import uuid4

from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.outputs.report import ReportOutput
from diag_dynamics.recordings.outputs.tables import TableOutput
from diag_dynamics.recordings.pieces import WHOLE, repaired, seams, settling_time, together
from diag_dynamics.recordings.summary import summary_of


class Failed(NamedTuple):
    """A recording cannot be analysed."""

    text: str


class Cut(NamedTuple):
    """A recording is to be analysed in pieces: those of a span each, begin and end [ns]."""

    pieces: list


class Done(NamedTuple):
    """A recording has been analysed."""

    summary: dict


def begin(job):
    """Analyse a recording, if it is short: Done, Failed, or Cut."""
    return _attempted(_begin, job)


def piece(job, span):
    """Analyse a piece of a recording: Outcome, or Failed."""
    return _attempted(_piece, job, span)


def finish(job, pieces, outcomes):
    """Put the pieces of a recording together: Done, Failed, or Cut, if pieces have to be others."""
    failed = next((one for one in outcomes if isinstance(one, Failed)), None)
    return failed or _attempted(_finish, job, pieces, outcomes)


def _attempted(action, *arguments):
    try:
        return action(*arguments)
    except (DiagDynamicsError, OSError) as error:
        return Failed(str(error))


def _begin(job):
    reading = job.reading()
    if job.options.reports:
        return _reported(job, reading)
    pieces = seams(reading, job.options.piece)
    if len(pieces) > 1:
        return Cut(pieces)
    return _finish(job, [WHOLE], [_analysed(job, reading, WHOLE)])


def _reported(job, reading):
    """Analyse a recording in one piece, from which alone there can be a report, and write that, too."""
    written = job.unfinished / f"{uuid4().hex}.html"
    report = ReportOutput(written, reading)
    try:
        outcome = _analysed(job, reading, WHOLE, [report])
        if not outcome.states:
            raise outcome.account.without_states(job.path)
        report.close(summary_of(outcome) | {"recording": job.path})
    except BaseException:
        report.drop()
        raise
    os.replace(written, job.html)
    return _finish(job, [WHOLE], [outcome])


def _piece(job, span):
    reading = job.reading()
    reading.limit(*span, settling_time(reading.settings, job.options.gain))
    return _analysed(job, reading, span)


def _analysed(job, reading, span, others=()):
    analysis = Analysis(reading, gain=job.options.gain, threads=1)
    if not job.options.parquet:
        analysis.run(others)
        return analysis.outcome
    written = job.unfinished / f"{uuid4().hex}.parquet"  # of this attempt: another worker may be at the same task
    output = TableOutput(written, reading, analysis.friction)
    try:
        analysis.run([output, *others])
        if analysis.states:
            output.close()
        else:
            output.drop()
    except BaseException:
        output.drop()
        raise
    if analysis.states:
        os.replace(written, _part(job, span))
    return analysis.outcome


def _part(job, span):
    """Path of the columns of a piece until all are there."""
    return job.unfinished / f"{job.name}.{span[0]}-{span[1]}.parquet"


def _finish(job, pieces, outcomes):
    better = repaired(pieces, outcomes)
    if better != pieces:
        return Cut(better)
    whole = together(outcomes)
    if not whole.states:
        raise whole.account.without_states(job.path)
    if job.options.parquet:
        _gather(job, pieces, outcomes)
    summary = summary_of(whole) | {"recording": job.path, "pieces": len(pieces), "fingerprint": job.fingerprint}
    written = job.unfinished / f"{uuid4().hex}.json"
    written.write_text(json.dumps(summary, indent=1, allow_nan=False), encoding="utf-8")
    os.replace(written, job.json)
    return Done(summary)


def _gather(job, pieces, outcomes):
    """Give the columns of all pieces their names; those that have them already, of an earlier attempt, stay."""
    if len(pieces) > 1:
        job.parquet.mkdir(exist_ok=True)
    for k, (span, outcome) in enumerate(zip(pieces, outcomes, strict=True)):
        target = job.parquet / f"{k:04d}.parquet" if len(pieces) > 1 else job.parquet
        if _part(job, span).exists():
            os.replace(_part(job, span), target)
        elif outcome.states and not target.exists():
            raise InputError(f"'{_part(job, span)}' is not there: all workers have to share the folder.")
