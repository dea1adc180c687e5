# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of contact for monitor and controller, and the contact points that they select."""

from diag_dynamics.collision.contact_points import ContactLimits, ContactPoints
from diag_dynamics.collision.link_geometry import link_geometry
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.spec import Spec

PARAMETERS = {
    "contact_limits.file": Spec(
        "",
        "YAML file of contact points and limits of body regions "
        "(config/contact_limits.example.yaml); empty: no limits.",
    ),
}
"""Specs by name."""


def limits_of(values):
    """Return the ContactLimits of parameters by name, None without a file.

    Raise InputError if the file is wrong.
    """
    try:
        file = values["contact_limits.file"]
        return ContactLimits.load(file) if file else None
    except InputError as error:
        raise InputError(f"parameter 'contact_limits.file': {error}") from None


def contact_points(model, description, limits):
    """Return the ContactPoints of a robot, and by link why its shapes do not count.

    Links whose list of body regions is empty are out of reach and have no points.

    Parameters
    ----------
    model : RobotModel
    description : str or bytes
        Its URDF, or the path of one.
    limits : ContactLimits or None

    Raises
    ------
    InputError
        The robot lacks a link, or meshes cannot be read without trimesh.
    """
    chosen = limits or ContactLimits()
    shapes = link_geometry(model, description, chosen.geometry)
    points = [point for point in shapes.points if chosen.links.get(point.link, True)]
    points += chosen.contact_points()
    return ContactPoints(model, points, limits, chosen.worst_by), shapes.left_out


def bounded_points(model, description, values):
    """Return the ContactPoints with limits of a controller's parameters by name.

    Return None without any limit.
    """
    limits = limits_of(values)
    energy = values["contact_limits.energy"]
    if energy:
        limits = (limits or ContactLimits()).with_energy(energy)
    if limits is None:
        return None
    points, _ = contact_points(model, description, limits)
    if not points.limited.any():
        raise InputError(
            "parameter 'contact_limits.file' has no limit for a link of this robot. "
            "Assign its links to a region with limits."
        )
    return points
