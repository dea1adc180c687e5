# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Points of a robot's contact as parameters ask for them."""

from diag_dynamics.contact.geometry import link_geometry
from diag_dynamics.contact.limits import ContactLimits
from diag_dynamics.contact.points import ContactPoints
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.contact import Wanted


def contact_points(model, description, wanted):
    """ContactPoints of a robot, and why shapes of links do not count, by link.

    Parameters
    ----------
    model : RobotModel
    description : str or bytes
        Its URDF, or the path of one.
    wanted : parameters.contact.Wanted

    Raises
    ------
    InputError
        Parameters name a link that the robot lacks, or none that moves, or meshes cannot be read for want of trimesh.
    """
    if unknown := [link for link in wanted.links if link not in model.link_names]:
        raise InputError(f"parameter 'contact.links' names '{unknown[0]}', which is no link of robot '{model.name}'.")
    if wanted.links and all(model.placement_in_body(link)[0] == 0 for link in wanted.links):
        raise InputError(f"parameter 'contact.links' names no link that moves: '{wanted.links[0]}' does not.")
    found = link_geometry(model, description, wanted.geometry)
    own = [point for point in found.points if not wanted.links or point.link in wanted.links]
    more = (*wanted.points, *(wanted.limits.contact_points() if wanted.limits else ()))
    return ContactPoints(model, [*own, *more], wanted.limits, wanted.worst_by), found.left_out


ENERGY = "contact.energy_limit"
"""The controller's bound on transferable energy, and the name of the region that stands for it."""


def bounded_points(model, description, values):
    """ContactPoints at which a controller bounds contacts; None where it has nothing to bound them by.

    Raises
    ------
    InputError
        As :func:`contact_points`, or there are limits and no point that has one.
    """
    wanted = Wanted.of(values)
    if values[ENERGY]:
        wanted = wanted._replace(limits=(wanted.limits or ContactLimits()).with_energy(values[ENERGY], ENERGY))
    if wanted.limits is None:
        return None
    points, _ = contact_points(model, description, wanted)
    if not points.limited.any():
        raise InputError(
            "parameter 'contact.limits_file' limits no point of this robot: no region of its links has a limit."
        )
    return points
