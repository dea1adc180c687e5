# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names: those of this package's nodes, the same however they are started, and the one that a misspelt name means."""

from difflib import get_close_matches

NODES = {
    "monitor": "diag_dynamics",
    "simulator": "diag_dynamics_simulator",
    "controller": "diag_dynamics_controller",
    "view": "diag_dynamics_view",
}
"""Name of each executable's node. Topics, services and policies of access have it in theirs."""

NEAR = 0.8
"""Likeness of two names, by difflib, from which on one is taken for the other misspelt."""


def nearest(name, names):
    """The one of these names that is most like another one, or None if none is like it."""
    return next(iter(get_close_matches(name, names, n=1, cutoff=NEAR)), None)
