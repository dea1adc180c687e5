# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The argument that names a robot, and those of its xacro file: the same of every command."""

import os

from diag_dynamics.entries import ARGUMENT, ASSIGNMENT
from diag_dynamics.exceptions import InputError

ROBOT = (
    "the robot: a URDF, xacro or MJCF file, or a name that `diag-dynamics robots` lists; arguments of a xacro file stand "
    "anywhere on the line, as NAME:=VALUE"
)
"""Help of the argument that names the robot."""


def parsed(parser, arguments):
    """Parse a command line on which xacro arguments may stand anywhere: they are the list `xacro_args` of the result."""
    chosen, left = parser.parse_known_args([word for word in arguments if not ARGUMENT.fullmatch(word)])
    chosen.xacro_args = [word for word in arguments if ARGUMENT.fullmatch(word)]
    for word in (*left, *(getattr(chosen, "recording", None) or ())):
        if ASSIGNMENT.fullmatch(word) and not os.path.exists(word):
            meant = word.replace("=", ":=", 1)
            parser.exit(2, f"{parser.prog}: '{word}' is no argument. Write {meant} for an argument of a xacro file.\n")
    if left:
        parser.error(f"unrecognized arguments: {' '.join(left)}")
    return chosen


def robot_of(robot, xacro_args):
    """Path of the robot that the arguments name, with its xacro arguments; None if they name none.

    Raises
    ------
    InputError
        As :func:`robot_source`; or there are xacro arguments without a robot.
    """
    from diag_dynamics.model.robot_source import (
        robot_source,  # it imports all that computes, which --help does not need
    )

    if robot is not None:
        return robot_source(robot, xacro_args)
    if xacro_args:
        raise InputError(f"'{xacro_args[0]}' is a xacro argument, but no robot is named. Give --urdf FILE.xacro.")
    return None
