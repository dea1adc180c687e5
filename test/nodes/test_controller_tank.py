# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The energy tank of the controller node, in lockstep with the simulator: kinetic energy,
diagnostics and mode services.
"""

import numpy as np
import pytest

import diag_dynamics as dd
from arm import loop_of
from controllers import START_AT, begin_at_rest, lockstep_arm, trajectory
from diag_dynamics.nodes.controller.record import problems_of_limits
from nodes import UR5, robot

CAPACITY = 0.3
"""Of the tank [J]."""


@pytest.fixture(scope="module")
def arm(peer):
    """A UR5 in lockstep with its controller, with a tank."""
    options = {"effort_rate": ["*=1e5"], "following_energy": 0.0, "tank_energy": CAPACITY}
    with lockstep_arm(peer, "/tank", list(robot(UR5).names), **options) as controller:
        yield controller


def wait_for_tank(arm, condition, what):
    """Return the first report from now on of which a condition on x [J] and the refused power [W]
    holds.
    """

    def holds(report):
        values = [
            report.values.get(key) for key in ("tank energy [J]", "power refused by the tank [W]")
        ]
        return None not in values and condition(*map(float, values))

    return arm.wait_for_report(holds, what, len(arm.reports))


def test_diagnostics_report_the_tank(arm):
    """A far target drains it and power is refused; a mode service fills it."""
    begin_at_rest(arm)
    wait_for_tank(arm, lambda x, _: x == pytest.approx(CAPACITY, rel=1e-5), "a full tank")
    goal = np.add(START_AT, (1.2, 0.5, -0.5, 0.3, 0.2, 0.0))
    arm.trajectory.publish(trajectory([(1.0, goal, [0] * 6, [0] * 6)], arm.simulator.robot.names))
    arm.wait_for(lambda s: s.energy_limited and s.energy > 0.5 * CAPACITY, "the tank")
    wait_for_tank(
        arm, lambda x, refused: x < 0.5 * CAPACITY and refused > 0.0, "a tank that refuses power"
    )
    arm.switch("damping")
    arm.wait_for(lambda s: s.energy < 1e-6, "rest")
    arm.switch("damping")
    wait_for_tank(
        arm, lambda x, _: x == pytest.approx(CAPACITY, rel=1e-5), "a tank that a mode has filled"
    )


def test_an_overdrawn_tank_is_reported():
    """A tenth of the capacity below zero is rounding of late efforts; more is a problem."""
    limits = loop_of(dd.load_urdf(robot(UR5).urdf), tank_energy=CAPACITY).limits
    for energy, reported in (
        (CAPACITY, False),
        (-0.09 * CAPACITY, False),
        (-0.11 * CAPACITY, True),
    ):
        limits.tank.energy = energy
        assert (
            any("tank is overdrawn" in problem for problem in problems_of_limits(limits))
            == reported
        )
