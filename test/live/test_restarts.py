# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes that are killed without warning and come back, in every order."""

import contextlib
import itertools
import signal
import time

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from diag_dynamics.nodes.support.statuses import OK, STALE, WARN
from nodes import MAX_AGE, OUTPUTS, PANDA, Reports, Truth, nanoseconds, robot
from processes import node_process

pytestmark = [pytest.mark.full, pytest.mark.live]


class Pair(contextlib.ExitStack):
    """A simulated Panda and its monitor in processes, connected by topics alone, and all that both
    publish.

    Parameters
    ----------
    peer : LivePeer
    namespace : str
    """

    def __init__(self, peer, namespace):
        super().__init__()
        self.peer = peer
        self.robot = robot(PANDA)
        self.namespace = namespace
        self.name = f"{namespace}/diag_dynamics"
        self.states = peer.topic(JointState, f"{namespace}/joint_states")
        self.topics = {
            topic: peer.topic(kind, f"{self.name}/{topic}") for topic, kind in OUTPUTS.items()
        }
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        self.running = {}

    def start(self, *names):
        """Start "robot" and "monitor" one after the other, each when the one before is ready."""
        here = "-r", f"__ns:={self.namespace}"
        for name in names:
            if name == "robot":
                motion = {"robot_description": self.robot.path, "motion": "wave", "rate": 50.0}
                process = node_process("simulator", *here, **motion)
                ready = "Ready: robot 'panda'"
            else:
                process = node_process("monitor", *here, max_age=MAX_AGE)
                ready = "Waiting for a robot"
            self.running[name] = self.enter_context(process)
            process.wait_for_text(ready)

    def kill(self, *names):
        """Kill processes, all at once."""
        for name in names:
            self.running[name].signal(signal.SIGKILL)
        for name in names:
            assert self.running.pop(name).wait() == -signal.SIGKILL

    def forget(self):
        """Drop all messages received so far, but for the last report."""
        for topic in (self.states, *self.topics.values()):
            topic.forget()
        del self.reports[:-1]

    def wait_for_silence(self, since):
        """Wait for two reports of no joint states after a time [ns], the second of a longer
        silence; check the topics.
        """

        def silent(report):
            return (
                report.stamp > since
                and report.level in (WARN, STALE)
                and "no joint states" in report.message
            )

        reports = [self.reports.wait_for(silent, "silence") for _ in range(2)]
        ages = [float(report.values["age of the last state [s]"]) for report in reports]
        assert ages[1] > ages[0]
        for topic in self.topics.values():
            assert not [stamp for stamp in topic.stamps if since < stamp < reports[1].stamp]

    def wait_for_states(self, since, count=40):
        """Wait until each topic has so many states that are newer than a stamp, and check all that
        was published.
        """

        def newer(topic):
            return (
                sum(stamp > since and self.states.at(stamp) is not None for stamp in topic.stamps)
                >= count
            )

        self.peer.wait_until(
            lambda: all(map(newer, self.topics.values())),
            f"states of {self.name}",
        )
        self.check()

    def wait_for_recovery(self, since):
        """Wait for right states that are newer than a stamp, and a report without warning."""
        self.wait_for_states(since)
        self.reports.wait_for(lambda report: report.level == OK, "OK")

    def check(self):
        """Compare all that was published with Pinocchio's numbers for the joint state of its stamp;
        stamps only grow.

        A joint state that did not arrive here may have reached the monitor: its results are not
        compared.
        """
        inputs = {nanoseconds(message.header.stamp): message for message in self.states.messages}
        for name, topic in self.topics.items():
            assert all(a < b for a, b in itertools.pairwise(topic.stamps)), (
                f"stamps of {name} go back"
            )
        for stamp in inputs.keys() & set(
            itertools.chain(*(topic.stamps for topic in self.topics.values()))
        ):
            message = inputs[stamp]
            at = [message.name.index(name) for name in self.robot.names]
            state = (
                np.array(field)[at]
                for field in (message.position, message.velocity, message.effort)
            )
            published = {
                name: topic.at(stamp) for name, topic in self.topics.items() if topic.at(stamp)
            }
            Truth(self.robot, *state).check(published, stamp)


@pytest.fixture(scope="module")
def pair(peer):
    """Start a robot and its monitor."""
    with Pair(peer, "/pair") as pair:
        pair.start("robot", "monitor")
        pair.wait_for_recovery(since=0)
        yield pair


@pytest.mark.parametrize(
    "killed",
    [("robot",), ("monitor",), ("robot", "monitor"), ("monitor", "robot")],
    ids=" then ".join,
)
def test_restart(pair, killed):
    """Whoever is killed comes back, in the order named: the pair recovers without help, and nothing
    wrong is published.
    """
    pair.forget()
    pair.kill(*killed)
    death = time.time_ns()
    if killed == ("robot",):
        pair.wait_for_silence(since=death)
    pair.start(killed[0])
    if killed[0] == "monitor" and len(killed) == 2:
        text = "waiting for the robot_description"
        report = pair.reports.wait_for(lambda report: report.message == text, text)
        assert report.level == WARN
        assert not any(stamp > death for topic in pair.topics.values() for stamp in topic.stamps)
    pair.start(*killed[1:])
    pair.wait_for_recovery(since=death)
