# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A load on the hand of a Panda on the monitor's topic and services, by efforts of Pinocchio with
the load as a payload.
"""

import math

import numpy as np
import pytest
from diag_dynamics.msg import Load
from diag_dynamics.srv import SetPayload
from geometry_msgs.msg import WrenchStamped
from std_srvs.srv import Trigger

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.statuses import OK, WARN
from nodes import PANDA, Monitor, robot
from pushed import GAIN, TORQUE, Motion, feed, subscribed

HAND, MASS, CENTER = "panda_hand", 1.2, (0.02, -0.01, 0.06)
NAMES = robot(PANDA).names
COVARIANCE = np.diag([0.3] * 4 + [0.1] * (len(NAMES) - 4)) ** 2
OBSERVED = {
    "external_torque.gain": GAIN,
    "external_torque.friction": False,
    "external_torque.covariance_joints": list(NAMES),
    "external_torque.covariance": COVARIANCE.ravel().tolist(),
    "collision.threshold": ["total=5"],
    "robot_description": robot(PANDA).path,
}
LOADED = Motion(robot(PANDA), payloads={HAND: (MASS, CENTER, 5e-4 * np.eye(3))})


@pytest.fixture
def monitor(peer, request):
    """Start a monitor that estimates a load on the hand."""
    parameters = (
        OBSERVED
        | {"load.link": HAND, "external_wrench.frames": [HAND]}
        | getattr(request, "param", {})
    )
    with Monitor(peer, "/loaded", outputs=["state"], **parameters) as monitor:
        monitor.wrench = peer.topic(WrenchStamped, f"{monitor.name}/external_wrench")
        monitor.load = peer.topic(Load, f"{monitor.name}/load")
        yield subscribed(monitor)


def call(monitor, name):
    return monitor.call(Trigger, name, Trigger.Request())


def payload(monitor):
    """Return the payload on the hand in the model in force."""
    return monitor.process.node._robot.model.payloads.get(HAND)


def test_a_load_is_no_collision_once_it_explains_the_torque(monitor):
    result = feed(monitor, map(LOADED, range(900)))
    assert any(message.collision for message in result[:400]) and not any(
        message.collision for message in result[750:]
    )
    assert (
        np.linalg.norm(result[-1].external_torque) > 5.0
    )  # the message has all of the external torque
    force = monitor.wrench.messages[-1].wrench.force
    assert math.hypot(force.x, force.y, force.z) < 0.2 * 9.81 * MASS  # the wrench lacks the load
    last = monitor.load.messages[-1]
    assert last.valid and last.is_load and last.header.frame_id == HAND and last.explained > 0.95
    assert last.mass == pytest.approx(MASS, abs=min(0.1, 2.0 * last.mass_deviation))
    c = last.center_of_mass
    deviation = last.center_of_mass_deviation
    np.testing.assert_allclose((c.x, c.y, c.z), CENTER, atol=0.02)
    assert 0.0 < deviation.x < 0.05 and last.payload.m == 0.0
    report = monitor.next_report()
    assert report.entries["load"].level == OK
    assert report.entries["load"].message == f"load at '{HAND}'"
    assert "Picked up: load" in monitor.process.output
    # a push on the load is a collision
    q, qd, tau = zip(*map(LOADED, range(900, 1100)), strict=True)
    push = 30.0 * np.array([name == "panda_joint2" for name in NAMES])
    pushed = feed(monitor, zip(q, qd, np.array(tau) - push, strict=True))
    assert any(message.collision for message in pushed[:30])
    assert monitor.next_report().entries[TORQUE].level == WARN


@pytest.mark.parametrize("monitor", [{"collision.threshold": ["total=5", "norm=5"]}], indirect=True)
def test_an_unknown_effort_with_a_load(monitor):
    """The joint without effort gets no torque of the load: no collision, but a push is one."""
    feed(monitor, map(LOADED, range(900)))
    assert monitor.load.messages[-1].is_load
    unknown = np.where(np.arange(len(NAMES)) == NAMES.index("panda_joint2"), np.nan, 0.0)
    push = 30.0 * (np.array(NAMES) == "panda_joint4")
    for count, force, collides in ((60, 0.0, False), (30, push, True)):
        states = [LOADED(900 + k) for k in range(count)]
        messages = feed(monitor, [(q, qd, tau - force + unknown) for q, qd, tau in states])
        assert any(message.collision for message in messages) == collides
        assert messages[-1].valid and np.isnan(messages[-1].external_torque[1])


def test_accept(monitor):
    """Accepted twice, less is put down."""
    response = call(monitor, "accept_payload")
    assert not response.success and "unknown" in response.message
    request = SetPayload.Request(link=HAND)
    request.inertia.m = 0.4
    assert monitor.call(SetPayload, "set_payload", request).success
    heavier = Motion(robot(PANDA), payloads={HAND: (2.0, CENTER, 5e-4 * np.eye(3))})
    for first, motion, mass in ((0, LOADED, MASS), (900, heavier, 2.0)):
        feed(monitor, map(motion, range(first, first + 900)))
        assert call(monitor, "accept_payload").success
        assert payload(monitor).mass == pytest.approx(mass, abs=0.06)
    feed(monitor, map(heavier, range(1800, 1810)))
    response = call(monitor, "accept_payload")  # of nothing more
    assert not response.success and "expected a recognized load" in response.message
    feed(monitor, map(LOADED, range(1810, 2710)))
    load = monitor.load.messages[-1]
    assert load.is_load and load.mass == pytest.approx(MASS - 2.0, abs=0.1)
    assert load.payload.m == payload(monitor).mass
    assert "Put down: load -0." in monitor.process.output
    assert "Picked up: load -" not in monitor.process.output


def test_parameters_name_what_is_missing(peer):
    for changed, text in (
        (
            {"external_torque.covariance": [0.0], "external_torque.covariance_joints": [""]},
            "covariance",
        ),
        ({"load.link": "panda_link0"}, "a joint moves"),
        ({"load.link": "hook"}, "'hook'"),
    ):
        with pytest.raises(InputError, match=text):
            peer.start("monitor", **(OBSERVED | {"load.link": HAND} | changed))
    limits = {"collision.threshold": ["*=50"]}
    with Monitor(peer, "/unloaded", outputs=["state"], **OBSERVED | limits) as monitor:
        text = f"Collision thresholds of {len(NAMES)} joints."
        assert text in monitor.process.output
        response = call(monitor, "accept_payload")
        assert not response.success and "load.link" in response.message
        assert peer.set_parameter(monitor.name, "load.link", HAND).successful
        assert not peer.set_parameter(monitor.name, "load.link", "hook").successful
