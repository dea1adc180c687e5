# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact: points of links, what a touch there could transfer, limits of body regions, impacts. Advisory, not safety-rated.

A wrong argument raises an InputError that names it, its value and what was expected.

points: what is looked at. geometry: points of a link's shapes. limits: body regions and what they bear, as the user enters
it. transient: the model of a short contact, on numbers. impact: ν before and after one. results: what is computed. The
arithmetic at many points is in sweeps.
"""

from diag_dynamics.contact.geometry import LinkGeometry, link_geometry
from diag_dynamics.contact.impact import Impact, impact
from diag_dynamics.contact.limits import BodyRegion, ContactLimits
from diag_dynamics.contact.point import ContactPoint
from diag_dynamics.contact.points import ContactPoints
from diag_dynamics.contact.results import Contact
from diag_dynamics.contact.transient import (
    contact_energy,
    contact_force,
    reduced_mass,
    simplified_mass,
    speed_of_energy,
    speed_of_force,
)

__all__ = [
    "BodyRegion",
    "Contact",
    "ContactLimits",
    "ContactPoint",
    "ContactPoints",
    "Impact",
    "LinkGeometry",
    "contact_energy",
    "contact_force",
    "impact",
    "link_geometry",
    "reduced_mass",
    "simplified_mass",
    "speed_of_energy",
    "speed_of_force",
]
