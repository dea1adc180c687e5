# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Datasets of LeRobot, versions 2 and 3: a folder with meta/info.json.

``FOLDER#3`` is its episode 3.
"""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.bag_messages import describe_error
from diag_dynamics.recordings.tables import is_dataset
from diag_dynamics.recordings.tables.cells import SAMPLE, make_column
from diag_dynamics.recordings.tables.columnar import MemoryTable
from diag_dynamics.recordings.tables.conventions import find_quantity

_UNSTATED = "not stated by the dataset"  # unit of positions: radians, degrees, or percent
_NUMERIC = re.compile("float(16|32|64)|u?int(8|16|32|64)")
_DAMAGED = OSError, pa.ArrowException
_OWN = "timestamp", "frame_index", "episode_index", "index", "task_index"
_EPISODES = "episode_index", "data/chunk_index", "data/file_index"
_ROWS = "episode_index", "frame_index"


class Dataset:
    """A dataset: `fps` [Hz], `features` by name, and `files`.

    `files` has the Parquet file of each episode by its number.
    """

    def __init__(self, root):
        self.root = Path(root)
        try:
            self.info = json.loads((self.root / "meta/info.json").read_text(encoding="utf-8"))
            self.fps = float(self.info["fps"])
            self.features = dict(self.info["features"])
            self.files = {
                k: self.root / self.info["data_path"].format(**at)
                for k, at in self._find_episodes()
            }
        except (*_DAMAGED, ValueError, LookupError, TypeError, AttributeError) as error:
            raise InputError(
                f"'{root}' is no LeRobot dataset of version 2 or 3: {type(error).__name__} "
                f"{describe_error(error)}."
            ) from error

    def _find_episodes(self):
        """Yield the number of each episode, and the fields of the path of its file."""
        if files := sorted(self.root.glob("meta/episodes/**/*.parquet")):
            for path in files:
                for row in parquet.read_table(path, columns=list(_EPISODES)).to_pylist():
                    number, chunk, file = (row[name] for name in _EPISODES)
                    yield number, {"chunk_index": chunk, "file_index": file}
            return
        for line in (self.root / "meta/episodes.jsonl").read_text(encoding="utf-8").splitlines():
            number = json.loads(line)["episode_index"]
            chunk = number // self.info["chunks_size"]
            yield number, {"episode_chunk": chunk, "episode_index": number}

    def read(self, number, names):
        """Return columns of an episode as a table of pyarrow, in the order of its frames."""
        path = self.files[number]
        rows = [("episode_index", "=", number)]
        try:
            table = parquet.read_table(path, columns=list(names), filters=rows)
        except _DAMAGED as error:
            raise InputError(f"'{path}' cannot be read: {describe_error(error)}.") from error
        return table.sort_by("frame_index")


def split_episode(path):
    """Return the folder of a dataset, and the number of an episode or None."""
    root, number = re.fullmatch(r"(.*?)(?:#(\d+))?", path, re.DOTALL).groups()
    return root, None if number is None else int(number)


def expand_episodes(paths):
    """Return paths of recordings with those of all its episodes in place of a dataset."""
    expanded = []
    for path in paths:
        is_whole = is_dataset(path) and split_episode(path)[1] is None
        expanded += [f"{path}#{k}" for k in Dataset(path).files] if is_whole else [path]
    return expanded


def read_episode(path):
    """Return the Table of the frames of an episode.

    Element `elbow` of observation.velocity is the column velocity.elbow.
    """
    root, number = split_episode(path)
    dataset = Dataset(root)
    if number is None and len(dataset.files) == 1:
        number = next(iter(dataset.files))
    if number not in dataset.files:
        raise InputError(
            f"'{path}' is one of {len(dataset.files)} episodes; expected a number such as "
            f"'{root}#{next(iter(dataset.files), 0)}'."
        )
    features = {key: entry for key, entry in dataset.features.items() if _is_read(key, entry)}
    table = dataset.read(number, [*_ROWS, *features])
    rows = table["frame_index"].to_numpy()
    arrays = {"time": pa.array(rows / dataset.fps)}
    for name, feature in features.items():
        arrays |= _split_feature(name, feature, table[name].combine_chunks(), path)
    columns = [
        make_column(name, array.slice(0, SAMPLE), _UNSTATED if _is_position(name) else None)
        for name, array in arrays.items()
    ]
    return MemoryTable(path, columns, list(arrays.values()), rows=rows)


def _is_read(name, feature):
    """Return whether a feature may be measured values of joints; actions are commands."""
    is_vector = len(feature["shape"]) == 1 and _NUMERIC.fullmatch(feature["dtype"])
    return is_vector and name not in _OWN and not name.startswith("action")


def _split_feature(name, feature, array, path):
    """Return a column for each named element, or the whole array under the feature's name."""
    names = feature.get("names")
    size = feature["shape"][0]
    if isinstance(names, dict):  # such as {"motors": [...]}
        names = [name for group in names.values() for name in np.atleast_1d(group).tolist()]
    if size == 1 or not names or len(set(names)) != size:
        return {name: array}
    values = array.flatten() if hasattr(array.type, "value_type") else array
    if len(values) != size * len(array):
        raise InputError(
            f"'{path}': rows of '{name}' have not {size} elements each, as meta/info.json says."
        )
    values = values.to_numpy(zero_copy_only=False).reshape(-1, size)
    last = name.split(".")[-1]
    kind = find_quantity(name) or ("position" if last == "state" else name)
    columns = {}
    for k, element in enumerate(map(str, names)):
        joint, _, quantity = element.rpartition(".")
        is_quantity = joint and find_quantity(quantity)
        columns[f"{quantity}.{joint}" if is_quantity else f"{kind}.{element}"] = values[:, k]
    return {name: pa.array(column) for name, column in columns.items()}


def _is_position(name):
    return find_quantity(name) == "position" or name.endswith("state")
