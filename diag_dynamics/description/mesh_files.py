# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of the meshes that a URDF names, and their content by trimesh, if it is installed."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from diag_dynamics.description.urdf_text import GIT_LFS
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.optional import require

_PACKAGE = re.compile(r"(?:package|model)://+([^/]+)/+(.+)")  # some exporters write a third slash


def find_mesh(name: str, folder: Path | None) -> Path:
    """Return the path of a mesh of a URDF.

    Its name is ``package://<package>/<file>``, ``file://<file>`` or a path. Packages are in
    AMENT_PREFIX_PATH and ROS_PACKAGE_PATH, or around the URDF, whose `folder` relative paths begin
    from.
    """
    if match := _PACKAGE.fullmatch(name.strip()):
        package, file = match.groups()
        places = [share / file for share in _packages(package, folder)]
    else:
        path = Path(os.path.expanduser(re.sub(r"^file:(//)?", "", name.strip())))
        if folder:
            path = folder / path  # which is `path` if that is absolute
        places = [path] if path.is_absolute() or folder else []
    for place in places:
        if place.is_file():
            return place
    raise UrdfError(
        f"mesh '{name}' cannot be found around the URDF, in AMENT_PREFIX_PATH or ROS_PACKAGE_PATH."
    )


def _packages(package: str, folder: Path | None) -> list[Path]:
    """Return the folders that may be those of a package."""
    prefixes, roots = (
        [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]
        for variable in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH")
    )
    places = [parent / package for parent in (*(prefix / "share" for prefix in prefixes), *roots)]
    places += [path for path in roots if path.name == package]
    for above in (folder, *folder.parents) if folder else ():
        places += [above, above / package] if above.name == package else [above / package]
    return places


class Meshes:
    """Meshes of one URDF, each read once; `folder` is that of the URDF, or None."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = None if folder is None else folder.resolve()
        self._meshes: dict[str, Any] = {}

    def mesh(self, name: str) -> Any:
        """Return a mesh as one trimesh.Trimesh, in metres and in the axes of its file."""
        if name not in self._meshes:
            self._meshes[name] = _read(name, find_mesh(name, self._folder))
        return self._meshes[name]


def _read(name: str, path: Path) -> Any:
    trimesh = require("trimesh", f"mesh '{name}'")
    with suppress(OSError), path.open("rb") as file:
        if file.read(len(GIT_LFS)) == GIT_LFS:
            raise UrdfError(f"mesh '{name}' is a pointer of Git LFS. Run git lfs pull.")
    try:
        scene = trimesh.load_scene(path)
        # A COLLADA file may have another unit.
        metres = re.fullmatch(r"([\d.eE+-]+) \* meters", str(scene.units))
        mesh = scene.to_mesh()
        if metres:
            mesh.apply_scale(float(metres[1]))
        # Vertices that differ in a normal or a texture only would leave the surface open.
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    except Exception as error:  # of a dozen parsers
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UrdfError(f"mesh '{name}' cannot be read: {reason}") from error
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise UrdfError(f"mesh '{name}' has no surface.")
    return mesh
