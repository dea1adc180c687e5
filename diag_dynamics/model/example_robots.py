# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Search for a URDF by the name of a robot in the `example-robot-data` wheel."""

import os
from difflib import get_close_matches
from importlib import metadata
from pathlib import Path

from diag_dynamics.exceptions import InputError

_FOLDER = "example-robot-data/robots/"


def example_urdfs():
    """Paths of all URDFs of the wheel by their short name (``panda_description/urdf/panda``); empty without it."""
    try:
        files = metadata.files("example-robot-data") or ()
    except metadata.PackageNotFoundError:
        return {}
    found = {}
    for file in files:
        text = file.as_posix()
        if text.endswith(".urdf") and _FOLDER in text:
            found[text.split(_FOLDER)[1].removesuffix(".urdf")] = Path(file.locate()).resolve()
    return dict(sorted(found.items()))


def find_urdf(robot):
    """Return the path of a URDF, given as a path, or as the name of an example robot.

    A name is that of the file (``panda``), or a part of one path only.
    """
    path = Path(os.path.expanduser(robot))
    try:
        if path.is_file():
            return path.resolve()
    except OSError as error:  # of a folder without permission
        raise InputError(f"robot '{robot}' cannot be read: {error.strerror}.") from error
    urdfs = example_urdfs()
    name = robot.removesuffix(".urdf")
    stems = {key: key.rsplit("/", 1)[-1] for key in urdfs}
    exact = [urdfs[key] for key, stem in stems.items() if name in (key, stem)]
    exact = exact or [urdfs[key] for key, stem in stems.items() if stem == f"{name}_robot"]  # ur5 is in ur5_robot.urdf
    part = {key: path for key, path in urdfs.items() if name.lower() in key.lower()}
    if len(exact) == 1:
        return exact[0]
    if robot.startswith(("/", ".", "~")) or robot.endswith((".urdf", ".xml", ".xacro")):  # meant as a path
        raise InputError(f"robot '{robot}': no such file.")
    if len(part) == 1:
        return next(iter(part.values()))
    if part:
        known = list(stems.values())
        short = (stems[key] if known.count(stems[key]) == 1 else key for key in part)
        raise InputError(f"robot '{robot}' could be any of: {', '.join(short)}.")
    if not urdfs:
        raise InputError(
            f"robot '{robot}' is no file, and the package example-robot-data, whose robots have names, is absent."
        )
    known = sorted({key.rsplit("/", 1)[-1] for key in urdfs})
    near = get_close_matches(name.lower(), known, n=3, cutoff=0.6)
    meant = f"; did you mean {' or '.join(near)}?" if near else "."
    raise InputError(
        f"robot '{robot}' is neither a file nor one of the {len(urdfs)} example robots{meant} "
        "All of them: diag-dynamics robots"
    )
