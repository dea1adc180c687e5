# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact: points of links, predicted contact there, limits of body regions, impacts. Advisory, not safety-rated.

A wrong argument raises an InputError that names it, its value and what was expected.

points: points of links. geometry: those of a link's shapes. limits: body regions. impact: the transient contact of two
masses, and ν before and after an impact. results: the predicted contact. The arithmetic at many points is in sweeps.
"""

from diag_dynamics.contact.geometry import LinkGeometry, link_geometry
from diag_dynamics.contact.impact import (
    Impact,
    contact_energy,
    contact_force,
    impact,
    reduced_mass,
    simplified_mass,
    speed_of_energy,
    speed_of_force,
)
from diag_dynamics.contact.limits import BodyRegion, ContactLimits
from diag_dynamics.contact.points import ContactPoint, ContactPoints
from diag_dynamics.contact.results import Contact

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
