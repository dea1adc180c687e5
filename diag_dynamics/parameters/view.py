# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the view, all in one table."""

from diag_dynamics.parameters.spec import Spec


def _once(default, description, **options):
    return Spec(default, description, read_only=True, **options)


PARAMETERS = {
    "host": _once(
        "127.0.0.1",
        "Address that the page is served on. Of another machine only one that is not loopback can be reached, and whoever "
        "reaches it sees the robots: the page has no password.",
    ),
    "port": _once(8420, "Port that the page is served on; 0: any free one, which the log names."),
    "robots": _once(
        [""], "Namespaces, or full names of monitors, whose robots are shown; by default all that are found."
    ),
    "rate": _once(60.0, "Most frames that a tab gets per second [Hz].", minimum=0.1, maximum=240.0),
    "tabs": _once(
        8, "Most tabs that are shown robots at a time, from 1 to 64; together they get 200 frames per second."
    ),
    "mesh_folders": _once(
        [""],
        "Folders around which meshes are looked for that no package of AMENT_PREFIX_PATH or ROS_PACKAGE_PATH has: relative "
        "paths of a URDF begin there.",
    ),
}
"""Specs of all parameters, by name."""
