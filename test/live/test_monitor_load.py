# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A monitor with many clients and subscribers: each request is answered rightly, and states go on."""

import signal

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics
from rclpy.qos import QoSProfile

from nodes import MS, PANDA, START, Monitor, Truth, assert_close, joint_state, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

SERVICES = {"forward_dynamics": ForwardDynamics, "inverse_dynamics": InverseDynamics, "diagonalize": Diagonalize}
CLIENTS, CALLS, SUBSCRIBERS = 8, 40, 200


@pytest.fixture(scope="module")
def running(peer):
    """Start the monitor of this file, which SIGTERM ends."""
    with Monitor(peer, "/busy", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))
        monitor.process.stop(signal.SIGTERM)


class Caller:
    """A client with all its requests in flight at once, each of another state, so that no two answers are alike."""

    def __init__(self, peer, monitor, panda, number):
        self.node, self.panda, self.service = peer.node, panda, sorted(SERVICES)[number % 3]
        # Its own queue is long enough: the answers to all clients of a service arrive at each of them.
        queue = QoSProfile(depth=2 * CLIENTS * CALLS)
        name = f"{monitor.name}/{self.service}"
        self.client = self.node.create_client(SERVICES[self.service], name, qos_profile=queue)
        self.states = [np.random.default_rng(number).uniform(-1, 1, (4, len(panda.names))) for _ in range(CALLS)]
        self.futures = []

    def send(self):
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
    """Eight clients, forty requests of each in flight, while states come in."""
    peer, states, sent = monitor.peer, monitor.topics["state"], []
    callers = [Caller(peer, monitor, panda, number) for number in range(CLIENTS)]
    for caller in callers:
        peer.wait_until(caller.client.service_is_ready, "the service")
    peer.become_known(monitor.name)

    def feed():
        sent.append(monitor.tick(20 * MS))
        monitor.feeder.publish(panda.message(sent[-1], panda.samples[len(sent) % 3]))

    timer = peer.node.create_timer(0.005, feed)
    for caller in callers:
        caller.send()
    futures = [future for caller in callers for future in caller.futures]
    peer.wait_until(lambda: all(future.done() for future in futures), f"{len(futures)} answers")
    peer.node.destroy_timer(timer)
    for caller in callers:
        caller.check()
        peer.node.destroy_client(caller.client)
    monitor.serves(panda)
    received = sorted(set(states.stamps) & set(sent))
    assert received
    for stamp in received[:: max(1, len(received) // 20)]:
        Truth(panda, *panda.samples[(sent.index(stamp) + 1) % 3][:3]).check_state(states.at(stamp))


def test_many_subscribers(monitor, panda):
    """All of them receive every state."""
    peer = monitor.peer
    many = [peer.topic(DiagonalizedState, f"{monitor.name}/state") for _ in range(SUBSCRIBERS)]
    peer.wait_until(lambda: all(topic.subscription.get_publisher_count() for topic in many), "all to be matched")

    def received():
        monitor.serves(panda)
        return all(topic.messages for topic in many)

    peer.wait_until(received, "all to be known")
    for sample in range(3):
        state, stamp = monitor.serves(panda, sample)["state"], monitor.now
        peer.wait_until(lambda stamp=stamp: all(topic.at(stamp) for topic in many), "a state, at all of them")
        assert all(topic.at(stamp) == state for topic in many)
    for topic in many:
        peer.node.destroy_subscription(topic.subscription)


def test_start_with_a_hostile_robot(peer, tmp_path):
    """A node that a robot's description ends says so in one printable line."""
    path = tmp_path / "hostile.urdf"
    path.write_text(
        '<robot name="r"><link name="base"/><link name="arm&#x9b;2J"><inertial><mass value="-1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        '<joint name="j" type="continuous"><parent link="base"/><child link="arm&#x9b;2J"/></joint></robot>',
        encoding="utf-8",
    )
    process = peer.start("monitor", "-r", "__ns:=/ended", robot_description=path)
    assert process.wait(START) == 1
    assert r"link 'arm\x9b2J': mass -1 kg is negative." in process.output
    assert all(line.isprintable() for line in process.output.split("\n"))
