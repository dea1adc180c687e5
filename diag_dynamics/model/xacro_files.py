# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Xacro files, expanded by ROS's own package `xacro`."""

import os
import re
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

from diag_dynamics.entries import split_arguments
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model.options import warn
from diag_dynamics.model.sources import refuse_other_kinds


class _Arguments(dict):
    """Values by name; `used` are the names that xacro asked for, `missing` the last one without a value."""

    def __init__(self, values):
        super().__init__(values)
        self.used, self.missing = set(), None

    def __contains__(self, name):
        self.used.add(name)
        return super().__contains__(name)

    def __getitem__(self, name):
        self.used.add(name)
        return super().__getitem__(name)

    def __missing__(self, name):
        self.missing = name
        raise KeyError(name)

    def lack(self):
        """Say which name has no value; empty if none lacks one."""
        if self.missing is None:
            return ""
        give = f"{self.missing}:=VALUE behind the path, or xacro_args={{'{self.missing}': VALUE}}"
        return f"its argument '{self.missing}' has no value and no default. Give it: {give}."


def expanded(source, arguments):
    """Return the XML text of a xacro file, given by a path that ends with .xacro; any other source as it is.

    Arguments may follow the path, see :func:`split_arguments`.
    """
    if hasattr(source, "read") and str(getattr(source, "name", "")).lower().endswith(".xacro"):
        source = source.name  # of an open file: xacro finds what it includes by its place
    if arguments is not None and not isinstance(arguments, Mapping):
        raise InputError(f"xacro_args is {arguments!r}, expected a dict by name.")
    if isinstance(source, str):
        source, own = split_arguments(source)
        arguments = own | dict(arguments or {})
    is_xacro = isinstance(source, (str, os.PathLike)) and os.fspath(source).lower().endswith(".xacro")
    if not is_xacro:
        if arguments:
            raise InputError(
                f"xacro_args has {', '.join(map(str, arguments))}, but the source is no path of a .xacro file."
            )
        return source
    path = os.path.expanduser(os.fspath(source))
    if not os.path.isfile(path):
        raise UrdfError(f"Cannot read the xacro file '{path}': no such file.")
    with open(path, "rb") as file:
        refuse_other_kinds(file.read(10_000))
    try:
        xacro = import_module("xacro")
    except ImportError as error:
        raise UrdfError(
            f"'{path}' is a xacro file, and the package xacro is not installed: pip install xacro."
        ) from error
    mappings = _Arguments({str(name): _text(value) for name, value in (arguments or {}).items()})
    try:
        text = xacro.process_file(path, mappings=mappings).toxml()
    except Exception as error:  # it has exceptions of a dozen modules
        why = (
            mappings.lack()
            or _missing_package(path, str(error))
            or f"{type(error).__name__}: {' '.join(str(error).split())}"
        )
        raise UrdfError(f"xacro cannot expand '{path}': {why}") from error
    unused = [name for name in arguments or {} if str(name) not in mappings.used]
    if unused:
        used = f"it uses {', '.join(sorted(mappings.used))}" if mappings.used else "it uses none"
        warn(f"The xacro argument {', '.join(map(repr, unused))} has no effect on '{path}'; {used}.", stacklevel=4)
    return text


def _missing_package(path, said):
    """What a $(find …) lacks, by the name of the package; empty where that is not the error."""
    if found := re.search(r"package '([^']+)' not found", said):
        return f"package '{found[1]}' of a $(find …) is not installed. Install it, or source the workspace that has it."
    if "ament_index_python" not in said:
        return ""
    listed = " or ".join(f"'{name}'" for name in dict.fromkeys(_packages(Path(path)))) or "of an included file"
    return f"package {listed} of a $(find …) cannot be found without ROS 2. Source a ROS 2 workspace that has it."


def _text(value):
    """A value as xacro's command line has it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _packages(path):
    """Packages that a xacro file, and those that it includes by a relative path, have in $(find …)."""
    files, names = [path], []
    for file in files:
        try:
            text = re.sub(r"(?s)<!--.*?-->", "", file.read_text(encoding="utf-8", errors="replace"))
        except OSError:
            continue
        names += re.findall(r"\$\(\s*find\s+([^)\s]+)\s*\)", text)
        included = re.findall(r"<xacro:include\s[^>]*?filename\s*=\s*[\"']([^\"'$]+)[\"']", text)
        files += [other for name in included if len(files) < 100 and (other := file.parent / name) not in files]
    return names
