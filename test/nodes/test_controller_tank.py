# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Energy tank and effort limits in the diagnostics of the controller."""

import pytest

import diag_dynamics as dd
from arm import Q, S, loop_of, state_at
from diag_dynamics.nodes.controller.record import problems_of_limits, values_of_loop
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
        problems = problems_of_limits(loop.limits)
        assert float(values["tank energy [J]"]) == pytest.approx(energy)
        assert any("tank is overdrawn" in problem for problem in problems) == reported


def test_diagnostics_report_efforts_that_do_not_hold_the_arm():
    """Limits below gravity, and rates that reach it late; none by default."""
    model = dd.load_urdf(robot(UR5).urdf)
    for values, begin in (
        ({}, None),
        ({"effort_limit": ["shoulder_lift_joint=20.0"]}, "gravity nearly reaches the effort limit"),
        ({"effort_rate": ["*=100.0"]}, "effort_rate is too low to hold"),
    ):
        loop = loop_of(model, **values)
        loop.step(state_at(S, Q), S)
        problems = problems_of_limits(loop.limits)
        assert [begin in text and "shoulder_lift_joint" in text for text in problems] == (
            [True] if begin else []
        )
