# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quantities of joints that `top` shows: what each is, and the row that it has in a history."""

from typing import NamedTuple

import numpy as np


class Quantity(NamedTuple):
    """One number for each degree of freedom."""

    name: str
    symbol: str
    unit: str
    """Of what turns; what slides has another one, see docs/top.md."""
    of_limit: str
    """What it is told in parts of; empty: of nothing."""
    adds_up: bool
    """Whether the chart shows the sum of all joints, and not the largest."""


QUANTITIES = (
    Quantity("energy", "½ν²", "J", "", True),
    Quantity("torque", "τ", "N m", "limit", False),
    Quantity("external", "m r", "N m", "threshold", False),
    Quantity("velocity", "q̇", "rad/s", "limit", False),
    Quantity("exchange", "νC", "W", "", False),
    Quantity("inertia", "D", "kg m²", "", False),
)
"""In the order of their keys. The exchange is what Coriolis forces take from one total rate and give to another: its sum is
zero."""

ENERGY, TORQUE, EXTERNAL, VELOCITY, EXCHANGE, INERTIA = range(len(QUANTITIES))


def columns(state, external):
    """Quantities of a DiagonalizedState, (quantities, nv); NaN where one is not known.

    Parameters
    ----------
    state : diag_dynamics.msg.DiagonalizedState
        Or what has its fields.
    external : ndarray or None
        External torque, the last that is known.

    Raises
    ------
    ValueError
        Its vectors are not of one length.
    """
    nu = np.asarray(state.nu)
    values = np.full((len(QUANTITIES), len(nu)), np.nan)
    values[ENERGY] = 0.5 * nu * nu
    if state.effort_valid:
        values[TORQUE] = state.effort
    if external is not None:
        values[EXTERNAL] = external
    values[VELOCITY] = state.velocity
    values[EXCHANGE] = nu * np.asarray(state.coriolis)
    values[INERTIA] = state.articulated_inertia
    return values
