# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts by the name of the tool."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.checks import choice
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.layouts.foxglove import foxglove
from diag_dynamics.layouts.plotjuggler import plotjuggler
from diag_dynamics.layouts.rviz import rviz


class Tool(NamedTuple):
    """A viewer: how it is called, and how it is told to open a layout."""

    title: str
    opened: str


TOOLS = {
    "rviz": Tool("RViz", "rviz2 -d FILE"),
    "foxglove": Tool("Foxglove", "Layouts, Import from file"),
    "lichtblick": Tool("Lichtblick", "Layouts, Import from file"),
    "plotjuggler": Tool("PlotJuggler", "plotjuggler --layout FILE"),
}


def layout(tool, model, monitor="/diag_dynamics"):
    """Text of a layout.

    Parameters
    ----------
    tool : str
        One of :data:`TOOLS`.
    model : RobotModel
    monitor : str
        Name of the monitor on the graph, with its namespace.

    Raises
    ------
    InputError
        There is no such tool, or the name is no whole one.
    """
    choice("tool", tool, TOOLS)
    if not monitor.startswith("/") or monitor.endswith("/"):
        raise InputError(
            f"the monitor is {monitor!r}, expected its whole name, as /diag_dynamics or /arm/diag_dynamics."
        )
    if tool == "plotjuggler":
        return plotjuggler(model, monitor)
    dynamics, q = DiagonalDynamics(model), model.neutral
    origin = dynamics.placement(q, model.root_link)[:3, 3]
    reach = max(float(np.linalg.norm(dynamics.placement(q, link)[:3, 3] - origin)) for link in model.link_names)
    if tool == "rviz":
        return rviz(model, monitor, max(reach, 0.2))
    return foxglove(model, monitor, max(reach, 0.2), tool)
