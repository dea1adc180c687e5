# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Xacro files, expanded by ROS's own package `xacro`."""

import os
from collections.abc import Mapping
from importlib import import_module

from diag_dynamics.entries import split_arguments
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model.remarks import warn
from diag_dynamics.model.sources import reject_other_kinds


class _Arguments(dict):
    """Values by name; `used` are the names that xacro asked for."""

    def __init__(self, values):
        super().__init__(values)
        self.used = set()

    def __contains__(self, name):
        self.used.add(name)
        return super().__contains__(name)

    def __getitem__(self, name):
        self.used.add(name)
        return super().__getitem__(name)


def expanded(source, arguments):
    """Return the XML text of a xacro file, given by a path that ends with .xacro; any other source as it is.

    Arguments may follow the path, see :func:`split_arguments`.
    """
    if hasattr(source, "read") and str(getattr(source, "name", "")).lower().endswith(".xacro"):
        source = source.name  # of an open file: xacro finds what it includes by its place
    if arguments is not None and not isinstance(arguments, Mapping):
        raise InputError(f"xacro_args is {arguments!r}, expected a dict by name.")
    arguments = dict(arguments or {})
    if isinstance(source, str):
        source, own = split_arguments(source)
        arguments = own | arguments
    if not (isinstance(source, (str, os.PathLike)) and os.fspath(source).lower().endswith(".xacro")):
        if arguments:
            names = ", ".join(map(str, arguments))
            raise InputError(f"xacro_args has {names}, but the source is no path of a .xacro file.")
        return source
    path = os.path.expanduser(os.fspath(source))
    if not os.path.isfile(path):
        raise UrdfError(f"Cannot read the xacro file '{path}': no such file.")
    with open(path, "rb") as file:
        reject_other_kinds(file.read(10_000))
    try:
        xacro = import_module("xacro")
    except ImportError as error:
        raise UrdfError(
            f"'{path}' is a xacro file, and the package xacro is not installed: pip install xacro."
        ) from error
    texts = {  # as xacro's command line has them
        str(name): str(value).lower() if isinstance(value, bool) else str(value) for name, value in arguments.items()
    }
    mappings = _Arguments(texts)
    try:
        text = xacro.process_file(path, mappings=mappings).toxml()
    except Exception as error:  # it has exceptions of a dozen modules
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        missing = sorted(mappings.used.difference(mappings))
        give = (
            f". Give {missing[0]}:=VALUE behind the path, or xacro_args={{'{missing[0]}': VALUE}}." if missing else ""
        )
        raise UrdfError(f"xacro cannot expand '{path}': {reason}{give}") from error
    if unused := [name for name in texts if name not in mappings.used]:
        used = ", ".join(sorted(mappings.used)) or "none"
        warn(
            f"The xacro argument {', '.join(map(repr, unused))} has no effect on '{path}'; it uses {used}.",
            stacklevel=4,
        )
    return text
