# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A copy of a LeRobot dataset with the analysis of its episodes as further features."""

import json
import os
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.recordings.tables.lerobot import Dataset, split_episode

QUANTITIES = {
    "nu": lambda piece: piece.s.nu,
    "kinetic_energy": lambda piece: piece.s.kinetic_energy,
    "power": lambda piece: np.where(piece.states.effort_known, piece.s.effort_power, np.nan),
    "external_torque": lambda piece: piece.observed.external_torque,
    "residual": lambda piece: piece.observed.residual,
    "collision": lambda piece: np.where(piece.observed.valid, piece.observed.collision, np.nan),
}
"""Features by their name after ``dynamics.``, of a piece of the analysis: shape (T,) or (T, nv)."""


class LeRobotOutput:
    """Collect the analysis of episodes, and write a copy of their dataset to a folder that is not there yet."""

    def __init__(self, path, recording):
        root = split_episode(recording)[0]
        self._path, self._dataset, self._names = Path(path).expanduser(), Dataset(root), None
        self._values = {}  # by episode: numbers of frames, and values by quantity, of each piece
        if self._path.exists():
            raise InputError(f"'{path}' exists; expected the name of a new folder.")

    def add_episode(self, recording, reading):
        """Return an output of one episode, ``FOLDER#3``, or of the only one."""
        number = split_episode(recording)[1]
        number = next(iter(self._dataset.files)) if number is None else number
        names, judged = list(reading.model.dof_names), not reading.settings.unjudged_without
        if self._names not in (None, names):
            raise InputError(
                f"episode {number} has the joints {', '.join(names)}, unlike those before."
            )
        self._names, self._quantities = (
            names,
            [one for one in QUANTITIES if judged or one != "collision"],
        )
        self._values[number] = []
        return _Episode(self._values[number], self._quantities, reading, self._dataset.fps)

    def commit(self):
        """Write the dataset; frames without a result are NaN."""
        if not any(self._values.values()):
            raise InputError(f"'{self._path}' is not written: no episode has states.")
        part = self._path.with_name(f"{self._path.name}.part")
        try:
            shutil.copytree(self._dataset.root, part, copy_function=_copy_file)
            found, files = {}, {}
            for number, path in self._dataset.files.items():
                files.setdefault(path.relative_to(self._dataset.root), []).append(number)
            for path, numbers in files.items():
                found |= self._write_file(part / path, numbers)
            self._write_meta(part / "meta", found)
            os.rename(part, self._path)
        except OSError as error:
            raise InputError(
                f"'{self._path}' cannot be written: {error.strerror or error}."
            ) from error
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def _write_file(self, path, numbers):
        """Add columns to a file with these episodes; return values by feature and episode."""
        table, found = parquet.read_table(path), {number: {} for number in numbers}
        episode, frame = (table[name].to_numpy() for name in ("episode_index", "frame_index"))
        for quantity in self._quantities:
            width = len(self._names) if _is_of_joints(quantity) else 1
            values = np.full((len(table), width), np.nan, np.float32)
            for number in numbers:
                rows = np.flatnonzero(episode == number)
                place = dict(zip(frame[rows].tolist(), rows.tolist(), strict=True))
                for frames, some in self._values.get(number, ()):
                    at = np.array(
                        [place.get(one, -1) for one in frames.tolist()]
                    )  # times of a map may be of no frame
                    values[at[at >= 0]] = some[quantity].reshape(-1, width)[at >= 0]
                found[number][f"dynamics.{quantity}"] = values[rows]
            array = pa.array(values.ravel(), from_pandas=False)
            if _is_of_joints(quantity):
                array = pa.FixedSizeListArray.from_arrays(array, width)
            table = table.append_column(f"dynamics.{quantity}", array)
        parquet.write_table(table, path)
        return found

    def _write_meta(self, meta, found):
        """Add features to info.json, and their statistics to those of the dataset (3) or of each episode (2.1)."""
        features = {
            f"dynamics.{one}": {"dtype": "float32", "shape": [len(names)], "names": names}
            for one in self._quantities
            for names in [self._names if _is_of_joints(one) else [one]]
        }
        info = self._dataset.info | {"features": self._dataset.features | features}
        (meta / "info.json").write_text(json.dumps(info, indent=4), encoding="utf-8")
        if (path := meta / "stats.json").is_file():
            whole = {
                name: _statistics(np.concatenate([one[name] for one in found.values()]))
                for name in features
            }
            path.write_text(
                json.dumps(json.loads(path.read_text(encoding="utf-8")) | whole, indent=4),
                encoding="utf-8",
            )
        if (path := meta / "episodes_stats.jsonl").is_file():
            lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
            for line in lines:
                own = found.get(line["episode_index"], {})
                line["stats"] |= {name: _statistics(values) for name, values in own.items()}
            path.write_text("".join(f"{json.dumps(line)}\n" for line in lines), encoding="utf-8")


class _Episode:
    """The output of one episode, see :mod:`diag_dynamics.recordings.outputs`."""

    def __init__(self, pieces, quantities, reading, fps):
        self._pieces, self._quantities, self._reading, self._fps = pieces, quantities, reading, fps

    def write(self, piece):
        """Keep the values of a piece."""
        frames = np.rint((piece.states.stamp - self._reading.offset) / SECOND * self._fps).astype(
            int
        )
        values = {one: np.asarray(QUANTITIES[one](piece), np.float32) for one in self._quantities}
        self._pieces.append((frames, values))

    def close(self, _summary=None):
        """Do nothing: the dataset is written when all episodes are there."""

    def drop(self):
        """Forget the episode."""
        self._pieces.clear()


def _is_of_joints(quantity):
    return quantity in ("nu", "external_torque", "residual")


def _copy_file(source, target):
    """Copy a file, or link it if it is a video."""
    if source.endswith(".mp4"):
        with suppress(OSError):  # another file system
            return os.link(source, target)
    return shutil.copy2(source, target)


def _statistics(values):
    """Return statistics of columns as LeRobot has them, without NaN; zeros where there is no number."""
    known = np.ma.masked_invalid(values.astype(float))
    found = {name: getattr(known, name)(axis=0) for name in ("min", "max", "mean", "std")}
    return {name: np.ma.filled(one, 0.0).tolist() for name, one in found.items()} | {
        "count": [len(values)]
    }
