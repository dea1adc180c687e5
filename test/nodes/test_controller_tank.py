# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The energy tank in the diagnostics of the controller."""

import pytest

import diag_dynamics as dd
from arm import Q, S, loop_of, state_at
from diag_dynamics.nodes.controller.record import values_of_loop
from nodes import UR5, robot

CAPACITY = 0.3
"""Of the tank [J]."""


def test_diagnostics_report_the_tank():
    """Energy. A tenth of the capacity below zero is rounding of late efforts;
    more is a problem.
    """
    loop = loop_of(dd.load_urdf(robot(UR5).urdf), tank_energy=CAPACITY)
    loop.step(state_at(S, Q), S)
    tank = loop.limits.tank
    for energy, reported in (
        (CAPACITY, False),
        (-0.09 * CAPACITY, False),
        (-0.11 * CAPACITY, True),
    ):
        tank.energy = energy
        values = values_of_loop(loop)
        assert float(values["tank energy [J]"]) == pytest.approx(energy)
        assert tank.is_overdrawn == reported
