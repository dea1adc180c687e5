# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Services under load and under malformed requests: every answer is right or names its fault, and states go on."""

import math
from array import array

import numpy as np
import pytest
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics, SetPayload
from geometry_msgs.msg import Inertia, Vector3, Wrench
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.qos import QoSProfile

from nodes import MS, PANDA, START, Monitor, Truth, assert_close, joint_state, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"

HAND = "panda_hand"
LONGEST = 1100
"""Characters of a message: a thousand, and the word that there are more."""

SERVICES = {
    "forward_dynamics": ForwardDynamics,
    "inverse_dynamics": InverseDynamics,
    "diagonalize": Diagonalize,
}


@pytest.fixture(scope="module")
def running(peer):
    """Start the monitor of this file."""
    with Monitor(peer, "/asked", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))


@pytest.fixture
def monitor(monitor):
    """Return it; after the test every message it has received has one outcome."""
    yield monitor
    report = monitor.next_report()
    assert report.count("received") == report.outcomes()


# --- many at once


CLIENTS, CALLS = 8, 40


class Caller:
    """A client with all its requests in flight at once, each of another state, so that no two answers are alike."""

    def __init__(self, peer, monitor, panda, number):
        self.node = peer.node
        self.service = sorted(SERVICES)[number % 3]
        self.panda = panda
        # Its own queue is long enough: the answers to all clients of a service arrive at each of them.
        queue = QoSProfile(depth=2 * CLIENTS * CALLS)
        self.client = self.node.create_client(
            SERVICES[self.service], f"{monitor.name}/{self.service}", qos_profile=queue
        )
        rng = np.random.default_rng(number)
        self.states = [rng.uniform(-1, 1, (4, len(panda.names))) for _ in range(CALLS)]
        self.futures = []

    def ask(self):
        """Send all requests."""
        for q, qd, tau, qdd in self.states:
            request = SERVICES[self.service].Request(state=joint_state(self.panda.names, q, qd, tau))
            if self.service == "inverse_dynamics":
                request.acceleration = qdd.tolist()
            self.futures.append(self.client.call_async(request))

    def check(self):
        """Compare each answer with Pinocchio's to its own request."""
        for (q, qd, tau, qdd), future in zip(self.states, self.futures, strict=True):
            response, truth = future.result(), Truth(self.panda, q, qd, tau)
            assert response.success, response.message
            if self.service == "inverse_dynamics":
                expected = truth.state.oracle.inverse_dynamics(q, qd, qdd) / truth.unit
                assert_close(response.effort / truth.unit, expected, truth.tolerance)
            elif self.service == "forward_dynamics":
                expected = truth.state.acceleration * truth.unit
                assert_close(response.acceleration * truth.unit, expected, truth.tolerance)
            else:
                truth.check_state(response.state)


def test_many_clients_at_once(monitor, panda):
    """Eight clients, forty requests of each in flight, while states come in: all are answered, and each rightly."""
    peer, states = monitor.peer, monitor.topics["state"]
    callers = [Caller(peer, monitor, panda, number) for number in range(CLIENTS)]
    for caller in callers:
        peer.wait_until(caller.client.service_is_ready, "the service")
    peer.become_known(monitor.name)
    sent = []

    def feed():
        stamp = monitor.tick(20 * MS)
        sent.append(stamp)
        monitor.feeder.publish(panda.message(stamp, panda.samples[len(sent) % 3]))

    timer = peer.node.create_timer(0.005, feed)
    try:
        for caller in callers:
            caller.ask()

        def answered():
            return sum(future.done() for caller in callers for future in caller.futures)

        peer.wait_until(lambda: answered() == CLIENTS * CALLS, f"{CLIENTS * CALLS} answers")
    finally:
        timer.cancel()
        peer.node.destroy_timer(timer)
    for caller in callers:
        caller.check()
        peer.node.destroy_client(caller.client)
    monitor.serves(panda)
    received = set(states.stamps) & set(sent)
    assert received
    for stamp in sorted(received)[:: max(1, len(received) // 20)]:
        Truth(panda, *panda.samples[(sent.index(stamp) + 1) % 3][:3]).check_state(states.at(stamp))


def test_many_transitions_at_once(peer, panda):
    """Two hundred requests wait while the first of them loads a robot: all are answered, those that come too late by no."""
    with Monitor(peer, "/asked_often", autostart=False, robot_description=panda.path) as monitor:
        # As long a queue as there are answers: what does not fit into a client's own is lost there.
        queue = QoSProfile(depth=1000)
        client = peer.node.create_client(ChangeState, f"{monitor.name}/change_state", qos_profile=queue)
        peer.wait_until(client.service_is_ready, "the service")
        peer.become_known(monitor.name)
        labels = ["configure", *["activate", "deactivate"] * 99, "cleanup"]
        asked = [client.call_async(ChangeState.Request(transition=Transition(label=label))) for label in labels]
        try:
            peer.wait_until(lambda: all(answer.done() for answer in asked), f"{len(asked)} answers", 2 * START)
            assert all(answer.result().success for answer in asked)  # in order, or many of them would be wrong
            assert peer.phase(monitor.name) == "unconfigured"
            asked = [client.call_async(ChangeState.Request(transition=Transition(label="configure"))) for _ in labels]
            peer.wait_until(lambda: all(answer.done() for answer in asked), f"{len(asked)} answers", 2 * START)
            assert [answer.result().success for answer in asked] == [True] + [False] * (len(labels) - 1)
        finally:
            peer.node.destroy_client(client)


# --- requests that cannot be


MILLION = 1_000_000


def huge_name(request):
    request.state.name[0] = "x" * MILLION


def million_names(request):
    request.state.name = [f"joint{k}" for k in range(MILLION)]


def million_positions(request):
    request.state.position = array("d", bytes(8 * MILLION))


def million_velocities(request):
    request.state.velocity = array("d", bytes(8 * MILLION))


def million_copies(request):
    request.state.name = [request.state.name[0]] * MILLION


def many_wrenches(request):
    request.wrenches = [Wrench()] * 20_000
    request.wrench_links = [HAND] * 20_000


def huge_link(request):
    request.wrench_links, request.wrenches = ["y" * MILLION], [Wrench()]


def nan_everywhere(request):
    request.state.position = [math.nan] * len(request.state.name)


def infinite_gravity(request):
    request.override_gravity, request.gravity = True, Vector3(z=-math.inf)


MALFORMED = {
    "a name of a million characters": (huge_name, "state.name"),
    "a million unknown joints": (million_names, "state.name"),
    "a million positions": (million_positions, "state.position has 1000000 entries"),
    "a million velocities": (million_velocities, "state.velocity has 1000000 entries"),
    "a joint a million times": (million_copies, "state.name"),
    "20000 wrenches": (many_wrenches, "wrenches has 20000 entries"),
    "a link of a million characters": (huge_link, "yyyy"),
    "NaN": (nan_everywhere, "state.position"),
    "infinite gravity": (infinite_gravity, "gravity"),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_request(running, panda, case):
    """It fails with a message of bounded length that names the field; the next request and the next state are right."""
    spoil, named = MALFORMED[case]
    service = "diagonalize"
    request = SERVICES[service].Request(state=panda.message(0, panda.samples[0]))
    spoil(request)
    response = running.call(SERVICES[service], service, request)
    assert not response.success
    assert named in response.message
    assert len(response.message) <= LONGEST
    assert "Internal error" not in response.message
    assert len(response.state.nu) == 0
    good = running.call(Diagonalize, "diagonalize", Diagonalize.Request(state=panda.message(0, panda.samples[1])))
    Truth(panda, *panda.samples[1][:3]).check_state(good.state)
    running.serves(panda, 2)


def test_million_accelerations(running, panda):
    """So with the field that only inverse dynamics has."""
    request = InverseDynamics.Request(
        state=panda.message(0, panda.samples[0]), acceleration=array("d", bytes(8 * MILLION))
    )
    response = running.call(InverseDynamics, "inverse_dynamics", request)
    assert not response.success
    assert "acceleration has 1000000 entries" in response.message
    running.serves(panda)


def inertia(mass, moments=(0.01, 0.02, 0.025), **com):
    """Return an inertia."""
    message = Inertia(m=mass, com=Vector3(**com))
    message.ixx, message.iyy, message.izz = moments
    return message


UNPHYSICAL = {
    "no such link": (SetPayload.Request(link="tool", inertia=inertia(1.0)), "tool"),
    "no link": (SetPayload.Request(inertia=inertia(1.0)), "link"),
    "a link of a million characters": (SetPayload.Request(link="z" * MILLION, inertia=inertia(1.0)), "zzz"),
    "negative mass": (SetPayload.Request(link=HAND, inertia=inertia(-1.0)), "inertia.m"),
    "NaN mass": (SetPayload.Request(link=HAND, inertia=inertia(math.nan)), "inertia.m"),
    "a mass that nothing has": (SetPayload.Request(link=HAND, inertia=inertia(1e300)), "none beyond ±1e+09"),
    "infinite mass": (SetPayload.Request(link=HAND, inertia=inertia(math.inf)), "inertia.m"),
    "NaN in the centre of mass": (SetPayload.Request(link=HAND, inertia=inertia(1.0, y=math.nan)), "com"),
    "negative moment": (SetPayload.Request(link=HAND, inertia=inertia(1.0, (-0.01, 0.02, 0.02))), "inertia"),
    "moments of no body": (SetPayload.Request(link=HAND, inertia=inertia(1.0, (1.0, 1.0, 5.0))), "triangle"),
    "NaN moment": (SetPayload.Request(link=HAND, inertia=inertia(1.0, (math.nan, 1.0, 1.0))), "inertia"),
}


@pytest.mark.parametrize("case", UNPHYSICAL)
def test_payload_that_cannot_be(running, panda, case):
    """It is refused by name and in bounded length; neither the model nor the parameter has changed."""
    request, named = UNPHYSICAL[case]
    before = running.serves(panda)["state"].model_revision
    response = running.call(SetPayload, "set_payload", request)
    assert not response.success
    assert named in response.message
    assert len(response.message) <= LONGEST
    assert running.peer.get_parameters(running.name, ["payloads"]) == {"payloads": [""]}
    assert running.serves(panda, 1)["state"].model_revision == before


def test_parameter_follows_the_service(monitor, panda):
    """What set_payload attaches is in the parameter `payloads`, which attaches the same when it is set."""
    com, moments = (0.0, 0.1, 0.2), (0.01, 0.02, 0.025)
    loaded = panda.changed(payloads={HAND: (2.0, com, np.diag(moments))})
    both = panda.changed(
        payloads={HAND: (2.0, com, np.diag(moments)), "panda_link5": (1.0, (0, 0, 0), np.zeros((3, 3)))}
    )
    request = SetPayload.Request(link=HAND, inertia=inertia(2.0, moments, y=com[1], z=com[2]))
    response = monitor.call(SetPayload, "set_payload", request)
    assert response.success, response.message
    monitor.serves(loaded, 1)
    (entry,) = monitor.peer.get_parameters(monitor.name, ["payloads"])["payloads"]
    link, _, numbers = entry.partition("=")
    assert link == HAND
    assert [float(number) for number in numbers.split()] == [2.0, *com, *moments, 0.0, 0.0, 0.0]
    try:
        monitor.set_parameter("payloads", [entry, "panda_link5=1"])
        monitor.serves(both, 2)
        # the service changes one link's and leaves the other's
        off = monitor.call(SetPayload, "set_payload", SetPayload.Request(link="panda_link5"))
        assert off.success and off.total_mass == pytest.approx(response.total_mass)
        assert monitor.peer.get_parameters(monitor.name, ["payloads"])["payloads"] == [entry]
        monitor.serves(loaded, 0)
        monitor.set_parameter("payloads", [""])
        monitor.serves(panda, 1)
        monitor.set_parameter("payloads", [entry])
        monitor.serves(loaded, 2)
    finally:
        monitor.set_parameter("payloads", [""])
