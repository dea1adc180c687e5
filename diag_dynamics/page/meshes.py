# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes as bytes by their hash, and compressed numbers and meshes of a report."""

import gzip
import hashlib
from typing import NamedTuple

import numpy as np

from diag_dynamics.description.meshes import Meshes, find_mesh
from diag_dynamics.exceptions import InputError, UrdfError

SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".glb")
"""Suffixes of files that are read: a description may come from anybody and name any file."""

MAX_FILE_SIZE = 64 * 1024 * 1024
"""Maximum size of a file [bytes]."""


class MeshLibrary:
    """Meshes of one robot as bytes, little-endian.

    They are u32 vertices, u32 triangles, float32 positions and u32 indices.

    Parameters
    ----------
    folders : iterable of Path
        Folders for files that no ROS package has, see
        :func:`~diag_dynamics.description.meshes.find_mesh`.

    Attributes
    ----------
    meshes : dict
        Bytes by hash.
    missing : dict
        Reasons why meshes are missing, by their names in the URDF.
    """

    def __init__(self, folders=()):
        self._folders = [*dict.fromkeys(folders), None]
        self._hashes = {}
        self.meshes = {}
        self.missing = {}

    def add(self, file, scale):
        """Return the SHA-256 of a scaled mesh of the URDF; None if it is :attr:`missing`."""
        key = file, scale
        if file not in self.missing and key not in self._hashes:
            try:
                self._hashes[key] = self._store(self._load(file), scale)
            except (UrdfError, InputError) as error:
                self.missing[file] = str(error)
        return self._hashes.get(key)

    def _load(self, file):
        if not file.lower().endswith(SUFFIXES):
            raise UrdfError(f"mesh '{file}' is none of {', '.join(SUFFIXES)}.")
        for folder in self._folders:
            try:
                path = find_mesh(file, folder)
            except UrdfError:
                if folder is None:
                    raise
            else:
                break
        if path.stat().st_size > MAX_FILE_SIZE:
            raise UrdfError(
                f"mesh '{file}' has {path.stat().st_size} bytes; expected at most {MAX_FILE_SIZE}."
            )
        return Meshes(folder).mesh(file)

    def _store(self, mesh, scale):
        vertices = np.asarray(mesh.vertices) * np.array(scale)
        triangles = np.asarray(mesh.faces)
        if np.prod(scale) < 0.0:  # a mirror turns faces inside out
            triangles = triangles[:, ::-1]
        sizes = np.array([len(vertices), len(triangles)], dtype="<u4")
        data = (
            sizes.tobytes() + vertices.astype("<f4").tobytes() + triangles.astype("<u4").tobytes()
        )
        sha = hashlib.sha256(data).hexdigest()
        self.meshes[sha] = data
        return sha


# --- Compressed numbers and meshes of a report

LEVELS = 65_000
"""Maximum number of different values of a column."""

PER_DIFFERENCE = 1.4826 / np.sqrt(6.0)
"""Standard deviation of white noise per median magnitude of its second differences."""

CELLS = 96
"""Cells along the longest side of a mesh in a report: vertices in one cell become one."""


class Packed(NamedTuple):
    """Columns as bytes; of each the value of 1, and the step. 0 is unknown."""

    columns: list
    data: bytes


def pack(numbers, levels=LEVELS, of_noise=0.0):
    """Pack a matrix, shape (T, k), column by column. Numbers that are not finite are unknown.

    A column is rounded to `levels` values between its minimum and maximum, or to steps of the
    fraction `of_noise` of the standard deviation of its noise, where these are coarser. Columns of
    integers that span less are exact.
    """
    columns = []
    planes = []
    for column in np.asarray(numbers, dtype=float).T:
        finite = np.isfinite(column)
        low, step = _scale(column[finite], levels, of_noise)
        whole = np.zeros(len(column), dtype="<u2")
        whole[finite] = np.rint((column[finite] - low) / step) + 1
        columns.append([low, step])
        planes.append(_difference_planes(whole))
    return Packed(columns, _compress(b"".join(planes)))


def _scale(finite, levels, of_noise):
    """Return the smallest number and the step from one value to the next."""
    if not len(finite):
        return 0.0, 1.0
    low = float(finite.min())
    high = float(finite.max())
    if high - low < levels and (finite == np.rint(finite)).all():
        return low, 1.0
    noise = (
        float(np.median(np.abs(np.diff(finite, 2)))) * PER_DIFFERENCE if len(finite) > 2 else 0.0
    )
    return low, max((high - low) / levels, of_noise * noise, np.finfo(float).tiny)


def pack_times(t):
    """Pack times [s] that do not decrease, to the microsecond."""
    return _compress(
        _difference_planes(np.maximum.accumulate(np.rint(np.asarray(t) * 1e6)).astype("<u8"))
    )


def _difference_planes(whole):
    """Return byte planes of first differences, lowest bytes first, signs in lowest bits."""
    bits = 8 * whole.itemsize - 1
    differences = np.diff(whole, prepend=np.zeros(1, whole.dtype))  # they wrap around
    zigzag = (differences << 1) ^ (np.zeros_like(whole) - (differences >> bits))
    return zigzag.view(np.uint8).reshape(-1, whole.itemsize).T.tobytes()


def _compress(data):
    return gzip.compress(data, 6, mtime=0)


def pack_mesh(data):
    """Pack a mesh of a :class:`MeshLibrary`, with one vertex, their mean, for those of one cell."""
    vertices, triangles = map(int, np.frombuffer(data, "<u4", 2))
    points = np.frombuffer(data, "<f4", 3 * vertices, 8).reshape(-1, 3)
    faces = np.frombuffer(data, "<u4", 3 * triangles, 8 + 12 * vertices).reshape(-1, 3)
    low = points.min(axis=0)
    span = max(float(np.ptp(points, axis=0).max()), 1e-9)
    places = np.floor((points - low) * (CELLS / span)).astype(np.int64)
    _, cell = np.unique(places, axis=0, return_inverse=True)
    cell = cell.ravel()
    sums = np.stack([np.bincount(cell, axis) for axis in points.T], axis=1)
    points = sums / np.bincount(cell)[:, None]
    a, b, c = cell[faces].T
    faces = np.unique(cell[faces][(a != b) & (b != c) & (c != a)], axis=0)
    order, index = np.unique(faces, return_inverse=True)  # vertices without a face are left out
    whole = np.rint((points[order] - low) / span * 65535.0).astype("<u2")
    sizes = np.array([len(order), len(faces)], dtype="<u4")
    scale = np.array([*low, span], dtype="<f4")
    planes = _difference_planes(whole.T.ravel()) + _difference_planes(index.ravel().astype("<u4"))
    return _compress(sizes.tobytes() + scale.tobytes() + planes)


def pack_meshes(meshes, most):
    """Pack meshes by hash into at most so many bytes: the largest are left out."""
    packed = {sha: pack_mesh(data) for sha, data in meshes.items()}
    while sum(map(len, packed.values())) > most:
        del packed[max(packed, key=lambda sha: len(packed[sha]))]
    return packed
