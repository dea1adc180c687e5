# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes as bytes by their hash, and compressed numbers and meshes of a report."""

import gzip
import hashlib

import numpy as np

from diag_dynamics.description.mesh_files import Meshes, find_mesh
from diag_dynamics.exceptions import InputError, UrdfError

SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".glb")
"""Suffixes of files that are read: a description may come from anybody and name any file."""

MAX_FILE_SIZE = 64 * 1024 * 1024
"""Maximum size of a file [bytes]."""


def mesh_bytes(vertices, triangles):
    """Return counts of both (u32), positions (float32) and indices (u32), little-endian."""
    sizes = np.array([len(vertices), len(triangles)], dtype="<u4")
    parts = sizes, vertices.astype("<f4"), triangles.astype("<u4")
    return b"".join(part.tobytes() for part in parts)


class MeshLibrary:
    """Meshes of one robot as :func:`mesh_bytes`.

    Parameters
    ----------
    folders : iterable of Path
        Folders for files that no ROS package has, see
        :func:`~diag_dynamics.description.mesh_files.find_mesh`.

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
        data = mesh_bytes(vertices, triangles)
        sha = hashlib.sha256(data).hexdigest()
        self.meshes[sha] = data
        return sha


# --- Compressed numbers and meshes of a report

CELLS = 96
"""Cells along the longest side of a mesh in a report: vertices in one cell become one."""


def pack(t, numbers):
    """Pack times (T) [s], and numbers (T, k) to 16 significant bits.

    They are float64 times, and the float32 columns without their lowest bytes: of each column all
    second bytes, then all third and all highest ones.
    """
    bits = np.ascontiguousarray(np.transpose(numbers), dtype="<f4").view("<u4") + 0x80  # rounds
    planes = bits.view(np.uint8).reshape(*bits.shape, 4).swapaxes(1, 2)[:, 1:]
    return _compress(np.asarray(t, dtype="<f8").tobytes() + planes.tobytes())


def _compress(data):
    return gzip.compress(data, 6, mtime=0)


def pack_mesh(data):
    """Pack a mesh of a :class:`MeshLibrary`, with one vertex for all those of one cell."""
    vertices, triangles = map(int, np.frombuffer(data, "<u4", 2))
    points = np.frombuffer(data, "<f4", 3 * vertices, 8).reshape(-1, 3)
    faces = np.frombuffer(data, "<u4", 3 * triangles, 8 + 12 * vertices).reshape(-1, 3)
    span = max(float(np.ptp(points, axis=0).max()), 1e-9)
    cells = np.floor((points - points.min(axis=0)) * (CELLS / span))
    _, first, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    faces = cell.ravel()[faces]
    is_flat = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return _compress(mesh_bytes(points[first], faces[~is_flat]))


def pack_meshes(meshes, most):
    """Pack meshes by hash into at most so many bytes: the largest are left out."""
    packed = {sha: pack_mesh(data) for sha, data in meshes.items()}
    while sum(map(len, packed.values())) > most:
        del packed[max(packed, key=lambda sha: len(packed[sha]))]
    return packed
