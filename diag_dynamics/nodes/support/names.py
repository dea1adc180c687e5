# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of this package's nodes, and the name that a misspelt one resembles."""

from difflib import get_close_matches

NODES = {
    "monitor": "diag_dynamics",
    "simulator": "diag_dynamics_simulator",
    "controller": "diag_dynamics_controller",
    "view": "diag_dynamics_view",
}
"""Name of each executable's node. Topics, services and access policies contain it."""


def nearest(name, names):
    """Return the one of these names that resembles another one, or None."""
    return next(iter(get_close_matches(name, names, n=1, cutoff=0.8)), None)
