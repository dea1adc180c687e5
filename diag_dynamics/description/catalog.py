# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots by name, or by the path of a URDF, a xacro file with arguments, or an MJCF."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module, metadata, util
from pathlib import Path
from typing import Any

from diag_dynamics.description.description import Description
from diag_dynamics.description.elements import Element
from diag_dynamics.description.mjcf import is_mjcf, read_mjcf
from diag_dynamics.description.urdf import describe_urdf, parse_urdf
from diag_dynamics.description.urdf_text import read_text
from diag_dynamics.entries import arguments_of, split_arguments
from diag_dynamics.exceptions import InputError

# Its modules, one for each robot, clone a repository when they are imported.
DESCRIPTIONS = "robot_descriptions"
_FOLDER = "example-robot-data/robots/"
_OWN = Path(__file__).parents[1] / "robots"  # robots of this package, each in a folder of its name


def robot_path(name: str) -> Path:
    """Return the path of the URDF or xacro file of a robot by its name, see :func:`load_robot`."""
    if not isinstance(name, str) or not name:
        raise InputError(f"name is {name!r}; expected the name of a robot, such as 'panda'.")
    is_description = name.isidentifier() and name.endswith("_description")
    if is_description and util.find_spec(DESCRIPTIONS) and util.find_spec(f"{DESCRIPTIONS}.{name}"):
        return _cloned(name)
    return find_urdf(name)


def _cloned(name: str) -> Path:
    """Return the path of the URDF of a description."""
    text = (
        f"robot '{name}': {DESCRIPTIONS} gets it from the net if it has not yet, "
        "which may take a minute."
    )
    print(f"diag_dynamics: {text}", file=sys.stderr, flush=True)
    try:
        module = import_module(f"{DESCRIPTIONS}.{name}")
    except Exception as error:  # of git, of the net, or of the package
        raise InputError(
            f"robot '{name}': {DESCRIPTIONS} could not get it: {type(error).__name__}: {error}"
        ) from error
    # load_urdf expands a xacro file.
    path = getattr(module, "URDF_PATH", None) or getattr(module, "XACRO_PATH", None)
    if path is None:
        raise InputError(
            f"robot '{name}': {DESCRIPTIONS} has neither a URDF nor a xacro file of it."
        )
    return Path(path)


def example_urdfs() -> dict[str, Path]:
    """Return paths of URDFs by short name: those of this package and of example-robot-data.

    Those of example-robot-data are listed if it is installed.
    """
    of_package = {path.stem: path for path in _OWN.glob("*/*.urdf")}
    examples = {}
    with suppress(metadata.PackageNotFoundError):
        for file in metadata.files("example-robot-data") or ():
            name = file.as_posix().partition(_FOLDER)[2]
            if name.endswith(".urdf"):
                examples[name.removesuffix(".urdf")] = Path(str(file.locate())).resolve()
    return of_package | dict(sorted(examples.items()))


def find_urdf(robot: str) -> Path:
    """Return the path of a URDF, or that of an example robot by its key or file name (``ur5``)."""
    if os.path.isfile(path := os.path.expanduser(robot)):
        return Path(path).resolve()
    urdfs = example_urdfs()
    name = robot.removesuffix(".urdf")
    keys = [name] if name in urdfs else [key for key in urdfs if Path(key).name == name]
    keys = keys or [key for key in urdfs if Path(key).name == f"{name}_robot"]  # ur5_robot.urdf
    if len(keys) > 1:
        raise InputError(f"robot '{robot}' could be any of: {', '.join(keys)}.")
    if not keys:
        raise InputError(
            f"robot '{robot}' is neither a file nor an example robot. All of these: "
            f"diag-dynamics robots. More: {sys.executable} -m pip install example-robot-data."
        )
    return urdfs[keys[0]]


def robot_source(robot: str, arguments: Sequence[str] = ()) -> str:
    """Return a robot's path or name with xacro arguments ``NAME:=VALUE`` behind it.

    See :func:`load_robot` for names.
    """
    name, in_name = split_arguments(robot)
    path = os.path.expanduser(name)
    if not os.path.isfile(path):
        path = str(robot_path(name))
    values = in_name | arguments_of(arguments)
    if values and not path.lower().endswith(".xacro"):
        first = next(iter(values))
        raise InputError(
            f"'{first}:={values[first]}' is a xacro argument, but robot '{name}' is no .xacro file."
        )
    return " ".join([path, *(shlex.quote(f"{name}:={value}") for name, value in values.items())])


def describe(source: Any) -> Description:
    """Return the description of a robot by a source of :func:`load_urdf` or the path of an MJCF."""
    if isinstance(source, Description):
        return source
    if is_mjcf(source):
        return read_mjcf(source)
    return describe_urdf(parse_urdf(read_text(source)))


def link_elements(source: Any) -> dict[str, Element]:
    """Return the elements of the links of a URDF, by name.

    The result is empty for an MJCF, whose geometry is not read.
    """
    if is_mjcf(source):
        return {}
    links = parse_urdf(read_text(source)).iterfind("link")
    return {link.get("name"): link for link in links}
