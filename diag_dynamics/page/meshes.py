# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Meshes as bytes that a page draws: each once, by the hash of what is in it."""

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

KINDS = (".stl", ".obj", ".dae", ".ply", ".glb")
"""Suffixes of files that are read: a description comes from anybody, and names whatever it likes."""

LARGEST = 64 * 1024 * 1024
"""Largest file that is read [bytes]."""


_UNTOLD = (102, 102, 102, 255)
"""What trimesh says where a file says nothing."""


class DrawnMesh(NamedTuple):
    """A mesh that a page can ask for.

    Attributes
    ----------
    sha : str
        SHA-256 of its bytes, hexadecimal: what it is asked for by.
    color : tuple of float or None
        Red, green, blue, opacity, 0 to 1, of most of it, where the file says so.
    corners : ndarray, shape (8, 3)
        Of the box around it [m].
    """

    sha: str
    color: tuple[float, float, float, float] | None
    corners: Array


class MeshLibrary:
    """Meshes of one robot as bytes: u32 vertices, u32 triangles, float32 positions, u32 indices, all little-endian.

    Parameters
    ----------
    folders : iterable of Path
        Where files may lie that no ROS package has, see :func:`~diag_dynamics.model.meshes.find_mesh`: relative paths begin
        there, and packages are looked for around them.

    Attributes
    ----------
    missing : mapping
        Why a mesh is not there, by the name that the URDF has for it.
    """

    def __init__(self, folders: Iterable[Path] = ()) -> None:
        self._folders = [*dict.fromkeys(folders), None]
        self._drawn: dict[tuple[str, tuple[float, ...]], DrawnMesh] = {}
        self._bytes: dict[str, bytes] = {}
        self._missing: dict[str, str] = {}

    @property
    def missing(self) -> Mapping[str, str]:
        """See above."""
        return MappingProxyType(self._missing)

    def drawn(self, file: str, scale: tuple[float, ...]) -> DrawnMesh | None:
        """The mesh that a URDF names, scaled; None if it cannot be had, and :attr:`missing` says why."""
        key = file, scale
        if file not in self._missing and key not in self._drawn:
            try:
                mesh = self._loaded(file)
            except (UrdfError, InputError) as error:
                self._missing[file] = str(error)
            else:
                self._drawn[key] = self._kept(mesh, scale)
        return self._drawn.get(key)

    def data(self, sha: str) -> bytes | None:
        """Bytes of a mesh; None if there is none of this hash."""
        return self._bytes.get(sha)

    def __len__(self) -> int:
        return len(self._bytes)

    @property
    def size(self) -> int:
        """All bytes."""
        return sum(map(len, self._bytes.values()))

    def _loaded(self, file: str) -> Any:
        if not file.lower().endswith(KINDS):
            raise UrdfError(f"mesh '{file}' is none of {', '.join(KINDS)}.")
        path, folder = self._found(file)
        if path.stat().st_size > LARGEST:
            raise UrdfError(f"mesh '{file}' has more than the {LARGEST} bytes that are read.")
        return Meshes(folder).mesh(file)

    def _found(self, file: str) -> tuple[Path, Path | None]:
        for folder in self._folders[:-1]:
            try:
                return find_mesh(file, folder), folder
            except UrdfError:
                pass  # the last place says what is wrong
        return find_mesh(file, None), None

    def _kept(self, mesh: Any, scale: tuple[float, ...]) -> DrawnMesh:
        color = _color(mesh)
        vertices, triangles = np.asarray(mesh.vertices) * np.array(scale), np.asarray(mesh.faces)
        if np.prod(scale) < 0.0:  # a mirror turns faces inside out
            triangles = triangles[:, ::-1]
        parts = (
            np.array([len(vertices), len(triangles)], dtype="<u4"),
            vertices.astype("<f4"),
            triangles.astype("<u4"),
        )
        data = b"".join(part.tobytes() for part in parts)
        sha = hashlib.sha256(data).hexdigest()
        self._bytes[sha] = data
        return DrawnMesh(sha, color, corners_of(vertices.min(axis=0), vertices.max(axis=0)))


def corners_of(low: Array, high: Array) -> Array:
    """Corners of a box, shape (8, 3)."""
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def _color(mesh: Any) -> tuple[float, float, float, float] | None:
    """Main color of a trimesh.Trimesh; None if its file has none, or where trimesh cannot say."""
    visual = mesh.visual
    if not getattr(visual, "defined", False):
        return None
    material = getattr(visual, "material", None)
    main = getattr(material if material is not None else visual, "main_color", None)
    if main is None or len(main) != 4 or tuple(main) == _UNTOLD:
        return None
    red, green, blue, opacity = (float(part) / 255.0 for part in main)
    return red, green, blue, opacity
