# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of contact, shared by monitor and controller, and the contact points that they select."""

from typing import NamedTuple

from diag_dynamics.contact.geometry import link_geometry
from diag_dynamics.contact.points import ContactLimits, ContactPoint, ContactPoints
from diag_dynamics.entries import assignments
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.spec import Spec

PARAMETERS = {
    "contact.limits_file": Spec(
        "",
        "YAML file with limits of body regions (config/contact_limits.example.yaml); empty: no limits.",
    ),
    "contact.geometry": Spec(
        "primitives",
        "Contact points: on primitive shapes, also on meshes, or at link frames.",
        choices=("primitives", "meshes", "frames"),
    ),
    "contact.links": Spec([""], "Links with contact points; by default all moving links."),
    "contact.points": Spec(
        [""], "Additional contact points, each as name=link x y z in the link's axes [m]."
    ),
    "contact.worst_by": Spec(
        "limit",
        "Criterion for the reported point of each link.",
        choices=("limit", "energy", "force"),
    ),
}
"""Specs by name."""

ENERGY_LIMIT = "contact.energy_limit"
"""The controller's limit of transferable energy, and the name of its region."""


class ContactOptions(NamedTuple):
    """Values of the parameters."""

    limits: ContactLimits | None
    geometry: str
    links: tuple
    points: tuple
    worst_by: str

    @classmethod
    def from_values(cls, values):
        """Return the options of parameters by name; raise InputError if a file or an entry is wrong."""
        file = values["contact.limits_file"]
        try:
            limits = ContactLimits.load(file) if file else None
        except InputError as error:
            raise InputError(f"parameter 'contact.limits_file': {error}") from None
        entries = assignments("contact.points", values["contact.points"], str)
        links = tuple(link for link in values["contact.links"] if link)
        points = tuple(_parse_point(name, text) for name, text in entries.items())
        return cls(limits, values["contact.geometry"], links, points, values["contact.worst_by"])


def _parse_point(name, text):
    link, *numbers = text.split() or [""]
    try:
        place = tuple(float(number) for number in numbers)
    except ValueError:
        place = ()
    if len(place) != 3:
        raise InputError(
            f"parameter 'contact.points' has {name}={text}, expected name=link x y z [m]."
        )
    return ContactPoint(name, link, place)


def contact_points(model, description, options):
    """Return the ContactPoints of a robot, and the reasons why shapes of links do not count, by link.

    Parameters
    ----------
    model : RobotModel
    description : str or bytes
        Its URDF, or the path of one.
    options : ContactOptions

    Raises
    ------
    InputError
        The robot lacks a link, none of the links moves, or meshes cannot be read without trimesh.
    """
    if unknown := [link for link in options.links if link not in model.link_names]:
        raise InputError(
            f"parameter 'contact.links' has '{unknown[0]}', expected a link of robot '{model.name}'."
        )
    if options.links and all(model.placement_in_body(link)[0] == 0 for link in options.links):
        raise InputError(
            f"parameter 'contact.links' is {list(options.links)}, expected a moving link."
        )
    found = link_geometry(model, description, options.geometry)
    points = [point for point in found.points if not options.links or point.link in options.links]
    points += [*options.points, *(options.limits.contact_points() if options.limits else ())]
    return ContactPoints(model, points, options.limits, options.worst_by), found.left_out


def bounded_points(model, description, values):
    """Return the ContactPoints with limits of a controller's parameters by name; None without any limit."""
    options, energy = ContactOptions.from_values(values), values[ENERGY_LIMIT]
    if energy:
        limits = (options.limits or ContactLimits()).with_energy(energy, ENERGY_LIMIT)
        options = options._replace(limits=limits)
    if options.limits is None:
        return None
    points, _ = contact_points(model, description, options)
    if not points.limited.any():
        raise InputError(
            "parameter 'contact.limits_file' has no limit for a link of this robot. Assign its links to a region with limits."
        )
    return points
