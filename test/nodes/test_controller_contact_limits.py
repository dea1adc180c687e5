# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact limiter on the graph, in lockstep with the simulator: a push is reported, and the
limit scales.
"""

import pytest
from std_msgs.msg import Float64

from controllers import begin_at_rest, lockstep_arm, record
from nodes import UR5, robot

BOUND = 0.12
"""Of the energy that a contact could take out of the arm [J]."""


@pytest.fixture(scope="module")
def arm(peer):
    """A UR5 in lockstep with its controller, contacts bounded."""
    options = {"effort_rate": ["*=1e5"], "following_energy": 0.0, "contact_limits.energy": BOUND}
    scale = peer.publisher(Float64, "/bound/contact_scale")
    with lockstep_arm(peer, "/bound", list(robot(UR5).names), **options) as controller:
        controller.scale = scale
        yield controller


@pytest.fixture(autouse=True)
def from_the_start(arm):
    """Every test begins with the arm at rest, and nothing scaled."""
    arm.scale.publish(Float64(data=1.0))
    begin_at_rest(arm)


def test_a_push_is_told_of(arm):
    """What pushes puts energy in above the bound: the status says how much, and diagnostics that it
    was so.
    """
    arm.switch("gravity_compensation")
    record(arm)
    begin = len(arm.reports)
    arm.simulator.push("tool0", 0, 60, 40, 0, 0, 0)
    above = arm.wait_for(
        lambda s: s.contact_energy > 1.02 * s.contact_energy_limit > 0.0, "energy above the bound"
    )
    assert above.contact_limited and above.contact_energy_limit == pytest.approx(BOUND)

    def told(report):  # of any link: the pushed arm turns between status and report
        return "contact energy above its limit at '" in report.entries["commands"].message

    arm.wait_for_report(told, "the diagnostics", begin)
    assert above.contact_link
    arm.simulator.push("tool0", 0, 0, 0, 0, 0, 0)
    arm.wait_for(lambda s: s.contact_energy < 0.99 * BOUND, "the bound")


def test_a_scale_is_in_force_or_refused(arm):
    """What is no scale is refused by name; test_control_loop.py has the motion."""
    arm.scale.publish(Float64(data=0.0))
    arm.wait_for_report(
        lambda r: r.values.get("contact limits", "").endswith("scale 0"), "a scale of 0"
    )
    arm.refuses(lambda: arm.scale.publish(Float64(data=2.0)), "scale is 2.0")
