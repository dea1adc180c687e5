# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What there is to do about a fleet's archive, and what has been done already."""

import glob
import hashlib
import json
import os
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

import diag_dynamics
from diag_dynamics.compiled.cache import source_hash
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.recording import Reading

UNFINISHED = ".unfinished"
"""Folder within that of the outputs, of files that are being written."""

OWN = "fleet.json", "fleet.parquet", "fleet.html"
"""Files of the outputs' folder that are of no single recording."""


class Options(NamedTuple):
    """How recordings are analysed."""

    model: object
    """RobotModel; None: the one that the bag describes."""
    columns: object
    """Map of the columns of tables, or its absolute path."""
    topic: tuple
    """Topics of the joint states; empty where a bag has one."""
    joint_names: object
    """The robot's name of a joint by that of the recording, or None."""
    parameters: dict
    gain: float
    """Of the observer [1/s]."""
    parquet: bool
    """Whether there is to be a Parquet file of each recording."""
    reports: bool
    """Whether there is to be a report of each recording."""
    piece: float
    """Length of the pieces of long recordings [s]."""

    def fingerprint(self):
        """What makes results others: texts and numbers as JSON has them."""
        columns = self.columns
        if isinstance(columns, str):
            columns = Path(columns).read_text(encoding="utf-8", errors="replace")
        about = {
            "version": f"{diag_dynamics.__version__} {source_hash()[:16]}",
            "model": None if self.model is None else _digest(self.model),
            "columns": columns,
            "topic": self.topic,
            "joint_names": self.joint_names,
            "parameters": self.parameters,
            "gain": self.gain,
            "parquet": self.parquet,
            "reports": self.reports,
        }
        return json.loads(json.dumps(about, default=str))


class Job(NamedTuple):
    """One recording."""

    path: str
    """Absolute."""
    name: str
    """Of its outputs, without a suffix."""
    out: str
    """Folder of the outputs: absolute."""
    options: Options
    fingerprint: dict

    @property
    def json(self):
        """Path of the summary, which is there when all else is."""
        return Path(self.out) / f"{self.name}.json"

    @property
    def parquet(self):
        """Path of the columns: a file, or of a recording in pieces a folder of files."""
        return Path(self.out) / f"{self.name}.parquet"

    @property
    def html(self):
        """Path of the report."""
        return Path(self.out) / f"{self.name}.html"

    @property
    def outputs(self):
        """Names of those files of one recording that people open: its report, if there is one, and its summary."""
        return [path.name for path in (self.html, self.json) if path.exists()]

    @property
    def unfinished(self):
        """Folder of files that are being written."""
        return Path(self.out) / UNFINISHED

    def reading(self):
        """The recording, opened."""
        options = self.options
        return Reading(
            self.path,
            options.model,
            options.columns,
            topic=options.topic,
            joint_names=options.joint_names,
            parameters=dict(options.parameters),
        )

    def finished(self):
        """Summary of a recording that has been analysed as it is now, by these options; None if it has not."""
        try:
            summary = json.loads(self.json.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        there = (not self.options.parquet or self.parquet.exists()) and (not self.options.reports or self.html.exists())
        return summary if there and summary.get("fingerprint") == self.fingerprint else None


def jobs_of(patterns, out, options):
    """Jobs of all recordings that patterns name.

    Parameters
    ----------
    patterns : sequence of str
        Paths, or patterns as of a shell; ``**`` is any number of folders.
    out : str or Path
        Folder of the outputs: what is in it is no recording.
    options : Options

    Raises
    ------
    InputError
        A pattern names nothing.
    """
    out, by = Path(out).expanduser().resolve(), options.fingerprint()
    return [
        Job(str(path), name_of(path), str(out), options, by | {"input": _input(path)}) for path in _paths(patterns, out)
    ]


def _paths(patterns, out):
    found = {}
    for pattern in patterns:
        pattern = os.path.expanduser(os.fspath(pattern))
        names = [pattern] if os.path.exists(pattern) else sorted(glob.glob(pattern, recursive=True))
        if not names:
            raise InputError(f"there is no recording '{pattern}'.")
        paths = [Path(name).resolve() for name in names]
        found |= dict.fromkeys(path for path in paths if path != out and out not in path.parents)
    return list(found)


def name_of(path):
    """Name of a recording's outputs: that of its folder and its own, and what keeps it apart from all others."""
    words = re.sub(r"[^\w.-]+", "_", f"{path.parent.name}-{path.stem}").strip("_.-")
    return f"{words}-{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"


def _input(path):
    """Names, sizes and times of change of a recording's files."""
    files = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
    told = [(one.name if one == path else one.relative_to(path).as_posix(), one.stat()) for one in files]
    return [[name, about.st_size, about.st_mtime_ns] for name, about in told]


def _digest(model):
    """Text that differs for models that do."""
    digest = hashlib.sha256()
    for name, value in sorted(vars(model).items()):
        if name.startswith("_"):
            continue
        if isinstance(value, np.ndarray):
            digest.update(name.encode() + np.ascontiguousarray(value).tobytes())
        else:
            digest.update(f"{name} {value!r}".encode())
    return digest.hexdigest()
