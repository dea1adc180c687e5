# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A monitor with many clients and subscribers: each request is answered rightly, and states go on."""

import signal

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState
from diag_dynamics.srv import Diagonalize
from rclpy.qos import QoSProfile

from nodes import MS, PANDA, Monitor, Truth, joint_state, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

CLIENTS, CALLS, SUBSCRIBERS = 8, 40, 200


@pytest.fixture(scope="module")
def running(peer):
    """Start the monitor of this file, which SIGTERM ends."""
    with Monitor(peer, "/busy", robot_description=robot(PANDA).path) as monitor:
        yield monitor.connect(robot(PANDA))
        monitor.process.stop(signal.SIGTERM)


def test_many_clients_at_once(monitor, panda):
    """Eight clients, forty requests of each in flight, all of different states, while states come in."""
    peer, sent, requests = monitor.peer, [], []
    queue = QoSProfile(depth=2 * CLIENTS * CALLS)  # the answers to all clients of a service arrive at each of them
    name = f"{monitor.name}/diagonalize"
    clients = [peer.node.create_client(Diagonalize, name, qos_profile=queue) for _ in range(CLIENTS)]
    for client in clients:
        peer.wait_until(client.service_is_ready, "the service")
    peer.become_known(monitor.name)

    def feed():
        sent.append(monitor.tick(20 * MS))
        monitor.feeder.publish(panda.message(sent[-1], panda.samples[0]))

    timer = peer.node.create_timer(0.005, feed)
    for state in np.random.default_rng(0).uniform(-1, 1, (CALLS * CLIENTS, 3, len(panda.names))):
        request = Diagonalize.Request(state=joint_state(panda.names, *state))
        requests.append((state, clients[len(requests) % CLIENTS].call_async(request)))
    peer.wait_until(lambda: all(future.done() for _, future in requests), f"{len(requests)} answers")
    peer.node.destroy_timer(timer)
    for state, future in requests:
        assert future.result().success, future.result().message
        Truth(panda, *state).check_state(future.result().state)
    for client in clients:
        peer.node.destroy_client(client)
    assert set(monitor.topics["state"].stamps) & set(sent)


def test_many_subscribers(monitor, panda):
    """All of them receive every state; the monitor goes on when they have left."""
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
    peer.wait_until(lambda: peer.node.count_subscribers(f"{monitor.name}/state") == 1, "their departure")
    monitor.serves(panda)
