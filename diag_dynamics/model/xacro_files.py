# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Xacro files, expanded by ROS's own package `xacro`."""

import os
from collections.abc import Mapping
from importlib import import_module

from diag_dynamics.exceptions import InputError, UrdfError


def expanded(source, arguments):
    """XML text of a xacro file; anything else as it is.

    Parameters
    ----------
    source
        As of :func:`load_urdf`. A path whose name ends with .xacro is one of such a file.
    arguments : dict or None
        Values by name, as ``xacro name:=value`` has them.

    Raises
    ------
    UrdfError
        The package `xacro`, or one that a $(find …) needs, is not installed; or it cannot expand the file.
    InputError
        Arguments of what is no xacro file, or which are no dict.
    """
    if hasattr(source, "read") and str(getattr(source, "name", "")).lower().endswith(".xacro"):
        source = source.name  # of an open file: xacro finds what it includes by its place
    is_xacro = isinstance(source, (str, os.PathLike)) and os.fspath(source).lower().endswith(".xacro")
    if arguments is not None and not isinstance(arguments, Mapping):
        raise InputError(f"xacro_args is {arguments!r}, expected a dict by name.")
    if not is_xacro:
        if arguments:
            raise InputError(
                f"xacro_args has {', '.join(map(str, arguments))}, but the source is no path of a .xacro file."
            )
        return source
    path = os.path.expanduser(os.fspath(source))
    if not os.path.isfile(path):
        raise UrdfError(f"Cannot read the xacro file '{path}': no such file.")
    try:
        xacro = import_module("xacro")
    except ImportError as error:
        raise UrdfError(
            f"'{path}' is a xacro file, and the package xacro is not installed: pip install xacro."
        ) from error
    mappings = {str(name): _text(value) for name, value in (arguments or {}).items()}
    try:
        return xacro.process_file(path, mappings=mappings).toxml()
    except Exception as error:  # it has exceptions of a dozen modules
        why = f"{type(error).__name__}: {' '.join(str(error).split())}"
        if "ament_index_python" in why:  # of $(find package)
            why = "it has a $(find …) of a package, for which ament_index_python is needed: source a ROS 2 that has it."
        raise UrdfError(f"xacro cannot expand '{path}': {why}") from error


def _text(value):
    """A value as xacro's command line has it."""
    return str(value).lower() if isinstance(value, bool) else str(value)
