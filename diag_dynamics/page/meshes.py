# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes as the page receives them: bytes, each once, by their hash."""

import hashlib

import numpy as np

from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model.meshes import Meshes, find_mesh

SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".glb")
"""Suffixes of files that are read: a description may come from anybody and name any file."""

MAX_FILE_SIZE = 64 * 1024 * 1024
"""Maximum size of a file [bytes]."""


class MeshLibrary:
    """Meshes of one robot as bytes: u32 vertices, u32 triangles, float32 positions, u32 indices, all little-endian.

    Parameters
    ----------
    folders : iterable of Path
        Folders for files that no ROS package has, see :func:`~diag_dynamics.model.meshes.find_mesh`.

    Attributes
    ----------
    meshes : dict
        Bytes by hash.
    missing : dict
        Reasons why meshes are missing, by their names in the URDF.
    """

    def __init__(self, folders=()):
        self._folders = [*dict.fromkeys(folders), None]
        self._hashes, self.meshes, self.missing = {}, {}, {}

    def add(self, file, scale):
        """Return the hash of a mesh of the URDF, scaled: SHA-256, hexadecimal; None if it is :attr:`missing`."""
        key = file, scale
        if file not in self.missing and key not in self._hashes:
            try:
                self._hashes[key] = self._store(self._load(file), scale)
            except (UrdfError, InputError) as error:
                self.missing[file] = str(error)
        return self._hashes.get(key)

    def data(self, sha):
        """Return the bytes of a mesh; None if there is none of this hash."""
        return self.meshes.get(sha)

    def __len__(self):
        return len(self.meshes)

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
            raise UrdfError(f"mesh '{file}' has {path.stat().st_size} bytes; expected at most {MAX_FILE_SIZE}.")
        return Meshes(folder).mesh(file)

    def _store(self, mesh, scale):
        vertices, triangles = np.asarray(mesh.vertices) * np.array(scale), np.asarray(mesh.faces)
        if np.prod(scale) < 0.0:  # a mirror turns faces inside out
            triangles = triangles[:, ::-1]
        sizes = np.array([len(vertices), len(triangles)], dtype="<u4")
        data = sizes.tobytes() + vertices.astype("<f4").tobytes() + triangles.astype("<u4").tobytes()
        sha = hashlib.sha256(data).hexdigest()
        self.meshes[sha] = data
        return sha
