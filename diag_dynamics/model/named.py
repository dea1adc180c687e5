# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models of robots by their names."""

from __future__ import annotations

import logging
import sys
from difflib import get_close_matches
from importlib import import_module, util
from pathlib import Path
from typing import Any

from diag_dynamics.exceptions import InputError
from diag_dynamics.model.example_robots import example_urdfs, find_urdf
from diag_dynamics.model.robot import RobotModel, load_urdf

logger = logging.getLogger("diag_dynamics")

DESCRIPTIONS = "robot_descriptions"
"""A package whose modules, one for each robot, clone a repository from the net when they are imported."""


def load_robot(name: str, **options: Any) -> RobotModel:
    """Build the model of a robot by its name.

    Parameters
    ----------
    name : str
        As ``diag-dynamics robots`` lists them, of the package `example-robot-data` (``panda``, ``ur5``): its file's name, or
        any part of its path that is its alone. Or, where `robot_descriptions` is installed, the name of a description there
        with a URDF (``panda_description``): the first time, that package clones it from the net, which a line on stderr says.
    **options
        Those of :func:`load_urdf`.

    Returns
    -------
    RobotModel

    Raises
    ------
    InputError
        There is no robot of that name, and the message names those of a similar one; or it could not be cloned.
    DiagDynamicsError
        As :func:`load_urdf`.
    """
    return load_urdf(robot_path(name), **options)


def robot_path(name: str) -> str | Path:
    """Path of the URDF or xacro file of a robot, whose name is as :func:`load_robot` takes it."""
    if not isinstance(name, str) or not name:
        raise InputError(f"name is {name!r}, expected the name of a robot, such as 'panda'.")
    return _cloned(name) if name in described() else _found(name)


def _found(name: str) -> Path:
    """Path of the URDF of an example robot."""
    try:
        return find_urdf(name)
    except InputError as error:
        near = get_close_matches(name, described(), n=3)
        if near:
            raise InputError(f"{error} {DESCRIPTIONS} has {' and '.join(near)}.") from None
        if not example_urdfs():
            raise InputError(f"{error} pip install example-robot-data brings it.") from None
        raise


def described() -> tuple[str, ...]:
    """Names of the descriptions with a URDF that robot_descriptions has; none where it is not installed."""
    if util.find_spec(DESCRIPTIONS) is None:
        return ()
    try:
        table = import_module(f"{DESCRIPTIONS}._descriptions").DESCRIPTIONS  # public in some versions only
    except (ImportError, AttributeError):
        return ()
    return tuple(name for name, one in table.items() if one.has_urdf)


def _cloned(name: str) -> str:
    """Path of the URDF of a description."""
    message = f"robot '{name}': {DESCRIPTIONS} gets it from the net if it has not yet, which may take a minute."
    logger.info(message)
    print(f"diag_dynamics: {message}", file=sys.stderr, flush=True)
    try:
        module = import_module(f"{DESCRIPTIONS}.{name}")
    except Exception as error:  # of git, of the net, or of the package
        raise InputError(f"robot '{name}': {DESCRIPTIONS} could not get it: {type(error).__name__}: {error}") from error
    path = getattr(module, "URDF_PATH", None) or getattr(module, "XACRO_PATH", None)  # load_urdf expands the latter
    if path is None:
        raise InputError(f"robot '{name}': {DESCRIPTIONS} has neither a URDF nor a xacro file of it.")
    return path
