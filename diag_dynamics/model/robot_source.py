# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots as command lines and nodes name them: a URDF, a xacro file with arguments, an MJCF, or a robot by its name."""

import os
import shlex
from collections.abc import Sequence
from typing import Any

from diag_dynamics.entries import arguments_of, split_arguments
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.mjcf import Described, is_mjcf, read_mjcf
from diag_dynamics.model.named import robot_path
from diag_dynamics.model.sources import urdf_text
from diag_dynamics.model.xacro_files import expanded


def robot_source(robot: str, arguments: Sequence[str] = ()) -> str:
    """Return the path of a robot, followed by its xacro arguments, as an argument of :func:`read_source`.

    A robot is the path of a URDF, xacro or MJCF file, or a name, see :func:`load_robot`; xacro arguments ``NAME:=VALUE`` may
    follow it, and `arguments` are more of them.
    """
    name, own = split_arguments(robot)
    path = os.path.expanduser(name)
    if os.path.isdir(path):
        raise InputError(f"robot is '{name}', a folder; expected a URDF, xacro or MJCF file, or a robot by its name.")
    if not os.path.isfile(path):
        path = str(robot_path(name))
    values = own | arguments_of(arguments)
    if values and not path.lower().endswith(".xacro"):
        first = next(iter(values))
        raise InputError(f"'{first}:={values[first]}' is a xacro argument, but robot '{name}' is no .xacro file.")
    return " ".join([path, *(shlex.quote(f"{name}:={value}") for name, value in values.items())])


def read_source(source: Any, xacro_args: Any = None) -> Described:
    """Describe a robot as a URDF and options of :func:`load_urdf`; the source is as of that, or the path of an MJCF."""
    if not is_mjcf(source):
        return Described(urdf_text(expanded(source, xacro_args)))
    if xacro_args:
        raise InputError(f"xacro_args has {', '.join(map(str, xacro_args))}, but the source is an MJCF.")
    return read_mjcf(source)
