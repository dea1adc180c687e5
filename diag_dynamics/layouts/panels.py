# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every layout shows: which field of which topic, entry by entry, under the joint's name."""

from typing import NamedTuple

from diag_dynamics.plot.drawing import COLOURS, GREY

MARKERS = "markers"
"""Topic of the robot in space."""


class Series(NamedTuple):
    """A number over time."""

    topic: str
    """Of the monitor."""
    field: str
    """Of its message."""
    index: int | None
    """Entry of an array."""
    label: str
    colour: str


class Panel(NamedTuple):
    """Series with one unit."""

    name: str
    """Short, of letters alone."""
    title: str
    """With the unit."""
    series: tuple[Series, ...]


def panels(model):
    """What is shown of a robot.

    Parameters
    ----------
    model : RobotModel

    Returns
    -------
    tuple of Panel
        Energies first; external torque, which is not always observed, last.
    """

    def each(topic, field):
        return tuple(Series(topic, field, k, name, COLOURS[k % len(COLOURS)]) for k, name in enumerate(model.dof_names))

    def one(topic, field, label, colour=COLOURS[0]):
        return Series(topic, field, None, label, colour)

    energy = (one("kinetic_energy", "total", "K", GREY), *each("kinetic_energy", "energy_share"))
    norms = (
        one("external_torque", "norm", "|r|"),
        one("external_torque", "threshold", "threshold of |r|", COLOURS[3]),
    )
    return (
        Panel("energy", "Kinetic energy K and shares ½ν² [J]", energy),
        Panel("power", "Power νᵀ(ε − ε_g) [W]", (one("kinetic_energy", "power", "dK/dt by efforts and gravity"),)),
        Panel("rates", "Total joint rates ν [J^½]", each("total_joint_rates", "nu")),
        Panel("moments", "Working moments ε [J^½/s]", each("working_moments", "epsilon")),
        Panel("coriolis", "Coriolis term C [J^½/s]", each("coriolis", "coriolis")),
        Panel("inertia", "Articulated inertia D [kg m², kg]", each("state", "articulated_inertia")),
        Panel("torque", "External torque m r [N m, N]", each("external_torque", "external_torque")),
        Panel("residual", "Residual |r| [J^½/s]", norms),
    )
