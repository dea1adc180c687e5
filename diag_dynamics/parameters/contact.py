# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of contact, shared by monitor and controller: what is looked at, and limits."""

from typing import NamedTuple

from diag_dynamics.contact.limits import ContactLimits
from diag_dynamics.contact.point import ContactPoint
from diag_dynamics.entries import assignments
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.spec import Spec

PARAMETERS = {
    "contact.limits_file": Spec(
        "",
        "YAML file of body regions, what they bear, and which of them each link may meet, as you enter them; see "
        "config/contact_limits.example.yaml. Empty: no limits.",
    ),
    "contact.geometry": Spec(
        "primitives",
        "Points of links at which contact is looked at: of the URDF's boxes, cylinders, spheres and capsules (primitives), "
        "also of its meshes, whose files are opened (meshes), or the origins of links and of the joints they carry "
        "(frames), which links without such shapes have in any case.",
        choices=("primitives", "meshes", "frames"),
    ),
    "contact.links": Spec([""], "Links that are looked at; by default all that move."),
    "contact.points": Spec(
        [""],
        "Points that are looked at besides, each as name=link x y z, in the link's axes [m]; and those of limits_file.",
    ),
    "contact.worst_by": Spec(
        "limit",
        "Which point of a link is its worst: that of the largest transferable energy, of the largest force, or that whose "
        "speed is the largest part of the allowed one (limit), without limits that of the largest energy.",
        choices=("limit", "energy", "force"),
    ),
}
"""Of both nodes."""


class Wanted(NamedTuple):
    """What contact is looked at, from the parameters of that name."""

    limits: ContactLimits | None
    geometry: str
    links: tuple
    points: tuple
    worst_by: str

    @classmethod
    def of(cls, values):
        """What the values ask for.

        Raises
        ------
        InputError
            The file cannot be read, or an entry is wrong.
        """
        file = values["contact.limits_file"]
        try:
            limits = ContactLimits.load(file) if file else None
        except InputError as error:
            raise InputError(f"parameter 'contact.limits_file': {error}") from None
        return cls(
            limits,
            values["contact.geometry"],
            tuple(link for link in values["contact.links"] if link),
            tuple(
                _point(name, text)
                for name, text in assignments("contact.points", values["contact.points"], str).items()
            ),
            values["contact.worst_by"],
        )


def _point(name, text):
    """A point that an entry of contact.points asks for."""
    link, *numbers = text.split() or [""]
    try:
        place = tuple(float(number) for number in numbers)
    except ValueError:
        place = ()
    if len(place) != 3:
        raise InputError(f"parameter 'contact.points' has {name}={text}, expected name=link x y z [m].")
    return ContactPoint(name, link, place)
