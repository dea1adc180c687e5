# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact limiter on the graph, in lockstep with the simulator: the bound is kept, a push is told of, and it scales."""

import numpy as np
import pytest
from std_msgs.msg import Float64

import diag_dynamics as dd
from controllers import START_AT, begin_at_rest, lockstep_arm, record, trajectory
from nodes import UR5, S, nanoseconds, robot

BOUND = 0.12
"""Of the energy that a contact could take out of the arm [J]."""


@pytest.fixture(scope="module")
def arm(peer):
    """A UR5 in lockstep with its controller, contacts bounded."""
    own = {"effort_rate": ["*=1e5"], "following_energy": 0.0, "contact.energy_limit": BOUND}
    scale = peer.publisher(Float64, "/bound/contact_scale")
    with lockstep_arm(peer, "/bound", list(robot(UR5).names), **own) as controller:
        controller.scale = scale
        yield controller


@pytest.fixture(autouse=True)
def from_the_start(arm):
    """Every test begins with the arm at rest, and nothing scaled."""
    arm.scale.publish(Float64(data=1.0))
    begin_at_rest(arm)


def swing(arm, seconds=2.0):
    """Follow a trajectory that is faster than the bound lets it be; return the statuses until it is over."""
    goal = np.add(START_AT, (0.9, 0.4, -0.5, 0.3, 0.2, 0.0))
    points = [(0.5 * seconds, goal, [0] * 6, [0] * 6), (seconds, START_AT, [0] * 6, [0] * 6)]
    arm.trajectory.publish(trajectory(points, arm.simulator.robot.names))
    first = arm.wait_for(lambda s: s.contact_limited, "the limiter")
    end = nanoseconds(first.header.stamp) + int(seconds * S)
    arm.wait_for(lambda s: nanoseconds(s.header.stamp) > end, "the end")
    return list(arm.status.messages)


def energies(arm, statuses):
    """By status: the largest transferable energy [J] of any link, and of each link by name, at the simulator's state."""
    model = dd.load_urdf(robot(UR5).path)
    dynamics = dd.DiagonalDynamics(model)
    points = dd.ContactPoints(model, dd.link_geometry(model, robot(UR5).path).points)
    found = []
    for status in statuses:
        state = arm.simulator.states.repeated(nanoseconds(status.header.stamp))
        if state is not None:
            contact = dynamics.contact(np.array(state.position), np.array(state.velocity), points)
            found.append((status, contact.energy.max(), dict(zip(contact.links, contact.energy, strict=True))))
    assert len(found) > 100
    return found


def test_the_command_never_adds_energy_above_the_bound(arm):
    """No link has more than the bound, at no state; without a bound the same motion has a multiple of it."""
    found = energies(arm, swing(arm))
    assert 0.9 * BOUND < max(energy for _, energy, _ in found) <= BOUND
    moving = [(s, energy, by_link) for s, energy, by_link in found if energy > 1e-3 * BOUND and s.contact_valid]
    assert len(moving) > 50 and sum(s.contact_limited for s, *_ in moving) > 20
    for status, energy, by_link in moving:
        assert status.contact_energy == pytest.approx(energy, rel=1e-6)
        assert status.contact_energy_limit == pytest.approx(BOUND)
        assert by_link[status.contact_link] == pytest.approx(
            energy, rel=1e-6
        )  # of two with as much either may be named


def test_a_push_is_told_of(arm):
    """What pushes puts energy in above the bound: the status says how much, and diagnostics that it was so."""
    arm.switch("gravity_compensation")
    record(arm)
    begin = len(arm.reports)
    arm.simulator.push("tool0", 0, 60, 40, 0, 0, 0)
    above = arm.wait_for(lambda s: s.contact_energy > 1.02 * s.contact_energy_limit > 0.0, "energy above the bound")
    assert above.contact_limited and above.contact_energy_limit == pytest.approx(BOUND)

    def told(report):  # of any link: the pushed arm turns between status and report
        return "contact energy above its limit at '" in report.entries["commands"].message

    arm.wait_for_report(told, "the diagnostics", begin)
    assert above.contact_link
    arm.simulator.push("tool0", 0, 0, 0, 0, 0, 0)
    arm.wait_for(lambda s: s.contact_energy < 0.99 * BOUND, "the bound")


def test_a_scale_stops_the_arm_and_lets_it_go_on(arm):
    """Zero on contact_scale: the arm stands still; a half: a quarter of the energy. What is no scale is refused by name."""
    arm.scale.publish(Float64(data=0.0))
    arm.wait_for_report(lambda r: r.values.get("contact limits", "").endswith("scale 0"), "a scale of 0")
    arm.wait_for(lambda s: s.contact_energy < 1e-4 * BOUND, "rest")
    record(arm)
    goal = np.array(START_AT) + 0.5
    arm.trajectory.publish(trajectory([(1.0, goal, [0] * 6, [0] * 6)], arm.simulator.robot.names))
    arm.wait_for(lambda s: s.tracking_error_valid and max(s.tracking_error) > 0.45, "a target far ahead")
    assert max(s.contact_energy for s in arm.status.messages) < 1e-3 * BOUND
    arm.scale.publish(Float64(data=0.5))
    record(arm)
    arm.wait_for(lambda s: s.contact_energy > 0.8 * 0.25 * BOUND, "motion at half of the speed")
    assert max(s.contact_energy for s in arm.status.messages) <= 0.25 * BOUND
    arm.scale.publish(Float64(data=1.0))
    arm.wait_for(lambda s: max(map(abs, s.tracking_error)) < 1e-3, "the target")
    arm.refuses(lambda: arm.scale.publish(Float64(data=2.0)), "contact_scale is 2.0")
