# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes as the page receives them: bytes, each once, by their hash."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model.meshes import Meshes, find_mesh

SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".glb")
"""Suffixes of files that are read: a description may come from anybody and name any file."""

MAX_FILE_SIZE = 64 * 1024 * 1024
"""Maximum size of a file [bytes]."""


class DrawnMesh(NamedTuple):
    """A mesh of a MeshLibrary."""

    sha: str
    """SHA-256 of its bytes, hexadecimal."""
    corners: Array
    """Of the box around it [m], shape (8, 3)."""


class MeshLibrary:
    """Meshes of one robot as bytes: u32 vertices, u32 triangles, float32 positions, u32 indices, all little-endian.

    Parameters
    ----------
    folders : iterable of Path
        Folders for files that no ROS package has, see :func:`~diag_dynamics.model.meshes.find_mesh`.

    Attributes
    ----------
    missing : mapping
        Reasons why meshes are missing, by their names in the URDF.
    """

    def __init__(self, folders: Iterable[Path] = ()) -> None:
        self._folders = [*dict.fromkeys(folders), None]
        self._drawn: dict[tuple[str, tuple[float, ...]], DrawnMesh] = {}
        self._bytes: dict[str, bytes] = {}
        self._missing: dict[str, str] = {}

    @property
    def missing(self) -> Mapping[str, str]:
        """See the class."""
        return MappingProxyType(self._missing)

    def drawn(self, file: str, scale: tuple[float, ...]) -> DrawnMesh | None:
        """Return a mesh of the URDF, scaled; None if it is :attr:`missing`."""
        key = file, scale
        if file not in self._missing and key not in self._drawn:
            try:
                self._drawn[key] = self._store(self._load(file), scale)
            except (UrdfError, InputError) as error:
                self._missing[file] = str(error)
        return self._drawn.get(key)

    def data(self, sha: str) -> bytes | None:
        """Return the bytes of a mesh; None if there is none of this hash."""
        return self._bytes.get(sha)

    def __len__(self) -> int:
        return len(self._bytes)

    def _load(self, file: str) -> Any:
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

    def _store(self, mesh: Any, scale: tuple[float, ...]) -> DrawnMesh:
        vertices, triangles = np.asarray(mesh.vertices) * np.array(scale), np.asarray(mesh.faces)
        if np.prod(scale) < 0.0:  # a mirror turns faces inside out
            triangles = triangles[:, ::-1]
        sizes = np.array([len(vertices), len(triangles)], dtype="<u4")
        data = sizes.tobytes() + vertices.astype("<f4").tobytes() + triangles.astype("<u4").tobytes()
        sha = hashlib.sha256(data).hexdigest()
        self._bytes[sha] = data
        return DrawnMesh(sha, corners_of(vertices.min(axis=0), vertices.max(axis=0)))


def corners_of(low: Array, high: Array) -> Array:
    """Return the corners of a box, shape (8, 3)."""
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
