# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reaction of the monitor to collisions: the topic ~/collision, and one service call with its
latency.
"""

import contextlib
from unittest import mock

import numpy as np
import pytest
from std_msgs.msg import Bool, Float64MultiArray
from std_srvs.srv import Trigger

from controller_managers import ControllerManager
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.monitor.collisions import CollisionWatch
from diag_dynamics.nodes.support import controller_manager
from diag_dynamics.nodes.support.statuses import ERROR, OK
from nodes import LATCHED, PANDA, Monitor, robot
from pushed import GAIN, Motion, feed, subscribed

REACTION = "reaction"
"""Name of the entry on diagnostics."""
THRESHOLDS = {
    "external_torque.gain": GAIN,
    "external_torque.friction": False,
    "collision.threshold": ["total=20"],
}
THRESHOLDS["collision.hold_off"] = 0.5
UR5 = {"robot_description": str(find_urdf("ur5"))}
JOINTS = np.array(robot(PANDA).names)
PUSHED, FREE = (
    Motion(robot(PANDA), push * (JOINTS == "panda_joint2"), size=0.0)(0) for push in (30.0, 0.0)
)


class Stop:
    """A service whose calls are counted, with the time that it takes and its response."""

    def __init__(self, peer, name):
        self.peer = peer
        self.calls = 0
        self.time = 0.0
        self.response = Trigger.Response(success=True)
        self.service = peer.node.create_service(Trigger, name, self._accept)

    def _accept(self, request, _):
        self.calls += 1
        self.peer.graph.skip(self.time)
        return self.response


@pytest.fixture(scope="module")
def running(peer):
    """Start a monitor of the Panda that calls a service."""
    parameters = THRESHOLDS | {"reaction.service": "stop", "robot_description": robot(PANDA).path}
    with Monitor(peer, "/reacting", outputs=["state"], **parameters) as monitor:
        monitor.collision = peer.topic(Bool, f"{monitor.name}/collision", LATCHED)
        yield subscribed(monitor).connect(robot(PANDA))


@pytest.fixture
def monitor(running, peer):
    """Return the monitor of this file at rest, a service beside it, and no messages yet."""
    running.stop_service = Stop(peer, "/reacting/stop")
    feed(running, [FREE] * 300)  # after the arm has jumped to this pose, which is a collision
    running.collision.forget()
    running.stop_service.calls = 0
    yield running
    peer.node.destroy_service(running.stop_service.service)


def published(monitor):
    """Return the values on ~/collision since the last call."""
    values = [message.data for message in monitor.collision.messages]
    monitor.collision.forget()
    return values


def test_one_call_and_one_message_per_change(monitor):
    """The state that shows the collision sends both; a standing collision sends none; the next one
    does again.
    """
    result = feed(monitor, [FREE] * 3)
    assert published(monitor) == [] and not result[-1].collision
    for number in (1, 2):
        for _ in range(60):
            assert monitor.stop_service.calls == number - 1 and not published(monitor)
            if feed(monitor, [PUSHED])[0].collision:
                break
        assert monitor.stop_service.calls == number and published(monitor) == [True]
        feed(monitor, [PUSHED] * 100)
        assert monitor.stop_service.calls == number and not published(monitor)
        assert not feed(monitor, [FREE] * 300)[-1].collision  # longer than collision.hold_off
        assert published(monitor) == [False]
    assert monitor.stop_service.calls == 2


def collisions(monitor):
    """Return the number of collisions in the next report."""
    values = monitor.next_report().entries["external torque"].values
    return next(int(entry.value) for entry in values if entry.key == "collisions")


def test_a_further_push_in_a_collision_makes_no_call(monitor):
    """It is a further event, but the arm is already reacting."""
    before = collisions(monitor)
    harder = Motion(robot(PANDA), 90.0 * (JOINTS == "panda_joint2"), size=0.0)(0)
    feed(monitor, [PUSHED] * 200)
    assert monitor.stop_service.calls == 1 and published(monitor) == [True]
    assert feed(monitor, [harder] * 100)[-1].collision
    assert collisions(monitor) == before + 2
    assert monitor.stop_service.calls == 1 and not published(monitor)


def test_late_subscribers_receive_the_present_value(monitor, peer):
    """The first value is false, although there was no change."""
    with Monitor(
        peer, "/late", outputs=["state"], robot_description=robot(PANDA).path, **THRESHOLDS
    ) as other:
        subscribed(other)
        values = [peer.topic(Bool, f"{other.name}/collision", LATCHED).messages]
        feed(other, [FREE])
        assert values == [[]]  # the observer has no result yet
        for state, value in ((FREE, False), (PUSHED, True)):
            feed(other, [state] * 60)
            values.append(peer.topic(Bool, f"{other.name}/collision", LATCHED).messages)
            peer.pass_time(0.01)
            assert [entry.data for entry in values[-1]] == [value]
        assert REACTION not in other.next_report().entries  # no service


def test_a_collision_ends_without_a_result(monitor, peer):
    """Efforts are missing, or joint states stop."""
    q, qd, _ = FREE
    feed(monitor, [PUSHED] * 60)
    assert published(monitor) == [True]
    assert not feed(monitor, [(q, qd, None)] * 10)[-1].valid and published(monitor) == [False]
    feed(monitor, [FREE] * 300)
    monitor.collision.forget()
    feed(monitor, [PUSHED] * 60)
    assert published(monitor) == [True]
    peer.pass_time(0.9)
    assert not published(monitor)
    peer.pass_time(0.3)
    assert published(monitor) == [False]


@pytest.mark.parametrize(
    ("first", "factor", "text"), [(0.0, 0.0, "0"), (np.nan, 0.0, "0"), (0.0, 0.5, "commands")]
)
def test_efforts_that_are_not_measured(monitor, peer, first, factor, text):
    """Brakes hold the arm, or the driver repeats commands: no result, no collision, no call."""
    q, qd, tau = FREE
    efforts = np.array([first, *factor * tau[1:]])
    commands = peer.publisher(Float64MultiArray, "/reacting/effort_controller/commands")
    commands.publish(Float64MultiArray(data=np.nan_to_num(efforts)[::-1]))
    monitor.next_report()  # of the states before
    assert not any(message.valid for message in feed(monitor, [(q, qd, efforts)] * 100))
    report = monitor.next_report()
    assert "collision" not in report.entries["external torque"].message
    note = f"all efforts are {text}, but gravity requires"
    assert note in report.entries["efforts"].message
    moving = [(q + 1e-9 * number, qd, efforts) for number in range(3)]
    assert feed(monitor, moving)[-1].valid == (text == "commands")
    peer.node.destroy_publisher(commands)
    assert feed(monitor, [FREE] * 60)[-1].valid
    assert not published(monitor) and not monitor.stop_service.calls


@pytest.mark.parametrize(
    "changed",
    [
        {"collision.threshold": [""]},
        {"external_torque.gain": 0.0, "collision.threshold": [""]},
        UR5,
    ],
    ids=["thresholds", "gain", "robot"],
)
def test_a_collision_ends_with_the_parameters(peer, changed):
    """At once: thresholds are removed, the observer, or the robot."""
    with Monitor(
        peer, "/changed", outputs=["state"], robot_description=robot(PANDA).path, **THRESHOLDS
    ) as other:
        other.collision = peer.topic(Bool, f"{other.name}/collision", LATCHED)
        feed(subscribed(other), [FREE] + [PUSHED] * 60)
        assert published(other)[-1] is True
        assert other.set_parameters(changed).successful
        peer.pass_time(0.1)
        assert published(other) == [False]


def test_nothing_without_thresholds(monitor, peer):
    """An observer alone judges nothing."""
    parameters = {"external_torque.gain": GAIN, "robot_description": robot(PANDA).path}
    with Monitor(peer, "/unjudged", outputs=["state"], **parameters) as other:
        values = peer.topic(Bool, f"{other.name}/collision", LATCHED).messages
        assert feed(subscribed(other), [PUSHED] * 60)[-1].valid and not values


def test_latency(monitor, peer):
    """From the reception of the joint state to the call, and to the response; of the last call, and
    the largest.
    """
    accept = CollisionWatch.accept_state

    def late(watch, state):
        peer.graph.skip(0.003)
        return accept(watch, state)

    for time, largest in ((0.02, "23"), (0.01, "23")):
        monitor.stop_service.time = time
        with mock.patch.object(CollisionWatch, "accept_state", late):
            feed(monitor, [PUSHED] * 60)
        feed(monitor, [FREE] * 300)
        entry = monitor.next_report().entries[REACTION]
        values = {item.key: item.value for item in entry.values}
        assert (entry.level, entry.message) == (OK, "'stop': ready")
        assert values["call sent after [ms]"] == values["call sent after, maximum [ms]"] == "3"
        assert values["response after [ms]"] == f"{1e3 * (time + 0.003):.3g}"
        assert values["response after, maximum [ms]"] == largest
    assert "Reaction: response of 'stop' 13 ms after the joint state." in monitor.process.output


def test_failures(monitor, peer):
    """A failed, an absent and a missing response are errors, at once; the node lives, and the next
    call is made. That of an absent service follows while the collision lasts.
    """
    stop = monitor.stop_service
    stop.response = Trigger.Response(success=False, message="brakes are stuck")
    feed(monitor, [PUSHED] * 60 + [FREE] * 300)
    assert (
        "Reaction failed: 'stop': the response is a failure: brakes are stuck"
        in monitor.process.output
    )
    entry = monitor.next_report().entries[REACTION]
    assert entry.level == ERROR and "brakes are stuck" in entry.message
    stop.service.send_response = lambda *_: None
    feed(monitor, [PUSHED] * 60 + [FREE] * 300)
    peer.pass_time(1.5)
    assert monitor.next_report().entries[REACTION].message == "'stop': no response within 1 s"
    peer.node.destroy_service(stop.service)
    assert "not available" in monitor.next_report().entries[REACTION].message  # before it is needed
    count = len(monitor.reports)
    feed(monitor, [PUSHED] * 60)
    at_once = next(
        report.entries for report in monitor.reports[count:] if REACTION in report.entries
    )
    assert at_once[REACTION].level == ERROR and "not available" in at_once[REACTION].message
    assert "Reaction failed: 'stop': the service is not available" in monitor.process.output
    monitor.stop_service = Stop(peer, "/reacting/stop")
    feed(monitor, [PUSHED] * 60 + [FREE] * 300)
    feed(monitor, [FREE] * 60)
    assert monitor.stop_service.calls == 1 and monitor.next_report().entries[REACTION].level == OK


def test_contact_as_the_event(monitor, peer):
    """With reaction.event contact, a push below the thresholds of collision calls the service."""
    parameters = THRESHOLDS | {
        "reaction.service": "stop",
        "reaction.event": "contact",
        "contact.threshold": ["total=9"],
    }
    stop = Stop(peer, "/careful/stop")
    with Monitor(
        peer, "/careful", outputs=["state"], robot_description=robot(PANDA).path, **parameters
    ) as other:
        subscribed(other)
        pushed = Motion(robot(PANDA), 15.0 * (JOINTS == "panda_joint2"), size=0.0)(0)
        result = feed(other, [FREE] * 3 + [pushed] * 100)
        assert stop.calls == 1 and result[-1].contact and not result[-1].collision
        feed(other, [FREE] * 300 + [PUSHED] * 100)
        assert stop.calls == 2
    peer.node.destroy_service(stop.service)


# --- parameters

SWITCH = {"reaction.deactivate": ["arm_controller"]}


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"collision.threshold": [""]}, "collision.threshold is empty"),
        ({"reaction.service": "no service"}, "parameter 'reaction.service' is 'no service'"),
        ({"reaction.event": "contact"}, "contact.threshold is empty"),
        (SWITCH, "controller_manager_msgs"),
    ],
)
def test_wrong_parameters(peer, monkeypatch, values, named):
    """The node does not start, and the error names the parameter."""
    monkeypatch.setattr(controller_manager, "SwitchController", None)
    values = (
        {"reaction.service": "stop", "robot_description": robot(PANDA).path} | THRESHOLDS | values
    )
    with pytest.raises(InputError) as error:
        Monitor(peer, "/wrong", outputs=["state"], **values)
    assert named in str(error.value)


def test_thresholds_stay_while_there_is_a_service(monitor):
    """A running node rejects values with which it would never call."""
    result = monitor.set_parameters({"collision.threshold": [""]})
    assert not result.successful and "reaction.service is set" in result.reason


# --- controllers


@pytest.fixture
def switching(peer):
    """Return a function that returns a manager of controllers with states, and a monitor."""
    with contextlib.ExitStack() as stack:

        def start(activate=("hold",), **states):
            manager = ControllerManager(peer, "/switching", **states)
            stack.callback(manager.leave)
            parameters = THRESHOLDS | SWITCH | {"robot_description": robot(PANDA).path}
            parameters["reaction.service"] = "controller_manager/switch_controller"
            parameters["reaction.activate"] = list(activate)
            other = stack.enter_context(
                Monitor(peer, "/switching", outputs=["state"], **parameters)
            )
            return manager, subscribed(other)

        yield start


def entry_of(monitor):
    """Return level and message of the next entry but one, which has the states of now."""
    monitor.next_report()
    entry = monitor.next_report().entries[REACTION]
    return entry.level, entry.message.partition(": ")[2]


def test_switch_of_controllers(switching):
    """One request; names are compared before it, and states after it."""
    manager, other = switching(arm_controller="active", hold="inactive")
    assert entry_of(other) == (OK, "ready")
    feed(other, [FREE] * 3 + [PUSHED] * 60)
    assert manager.states == {"arm_controller": "inactive", "hold": "active"}
    assert len(manager.requests) == 1 and entry_of(other) == (OK, "ready")
    assert "Reaction failed" not in other.process.output


@pytest.mark.parametrize(
    ("activate", "states", "before", "after", "requests"),
    [
        (["hold"], {}, "'hold' is not loaded", "no controller with this name exists", 2),
        (["hold"], {"hold": "unconfigured"}, "'hold' is unconfigured", "'hold' is unconfigured", 1),
        (
            ["wing", "hold"],
            {"hold": "inactive"},
            "'wing' is not loaded",
            "'wing' is not loaded; expected active",
            1,
        ),
    ],
    ids=["unknown", "unconfigured", "one of two"],
)
def test_controllers_that_cannot_be_activated(switching, activate, states, before, after, requests):
    """Others are switched. Diagnostics name these before a collision, the log after it."""
    manager, other = switching(activate, arm_controller="active", **states)
    level, message = entry_of(other)
    assert level == ERROR and before in message
    feed(other, [FREE] * 3 + [PUSHED] * 60)
    assert manager.states["arm_controller"] == "inactive"
    assert manager.states.get("hold") == {"inactive": "active"}.get(
        states.get("hold"), states.get("hold")
    )
    assert len(manager.requests) == requests and not any(
        request.activate_controllers for request in manager.requests[1:]
    )
    assert any("Reaction failed" in line and after in line for line in other.process.node.output)
    level, message = entry_of(other)
    assert level == ERROR and "last call failed: " in message
    values = {entry.key: entry.value for entry in other.next_report().entries[REACTION].values}
    assert values["calls"] == values["failed calls"] == "1"


def test_a_manager_that_changes_nothing(switching):
    """A response of success with the states as before is a failure."""
    manager, other = switching(arm_controller="active", hold="inactive")
    manager.switch = lambda *_: None
    feed(other, [FREE] * 3 + [PUSHED] * 60)
    differences = (
        "after the response controller 'arm_controller' is active; expected inactive; "
        "controller 'hold' is inactive; expected active"
    )
    assert differences in other.process.output and entry_of(other)[0] == ERROR
