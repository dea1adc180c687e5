# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes that are killed without warning and come back, in every order; several monitors on one graph."""

import contextlib
import signal
import time

import pytest

from network import STALE, WARN, Pair
from nodes import PANDA, TALOS, UR5, Monitor, robot

pytestmark = [pytest.mark.full, pytest.mark.live]


def test_namespaces(peer):
    """Three monitors of three robots: each publishes Pinocchio's numbers, also when one of them has been killed."""
    robots = {"/left": robot(PANDA), "/right": robot(UR5), "/torso": robot(TALOS)}
    with contextlib.ExitStack() as stack:
        monitors = {
            space: stack.enter_context(Monitor(peer, space, robot_description=own.path))
            for space, own in robots.items()
        }
        for space, monitor in monitors.items():
            monitor.connect(robots[space]).serves(robots[space])
        killed = monitors.pop("/left").process
        killed.signal(signal.SIGKILL)
        assert killed.wait() == -signal.SIGKILL
        for space, monitor in monitors.items():
            monitor.serves(robots[space], 1)
            report = monitor.next_report()
            assert report.values["robot"] == robots[space].oracle.xml.get("name")
            assert not [name for name in report.counts() if name.startswith("rejected: ")]


@pytest.fixture(scope="module")
def pair(peer):
    """Start a robot and its monitor."""
    with Pair(peer, "/pair") as pair:
        pair.start("robot", "monitor")
        pair.wait_for_recovery(since=0)
        yield pair


@pytest.mark.parametrize(
    "killed", [("robot",), ("monitor",), ("robot", "monitor"), ("monitor", "robot")], ids=" then ".join
)
def test_restart(pair, killed):
    """Whoever is killed comes back, in the order named: the pair recovers without help, and nothing wrong is published."""
    pair.forget()
    pair.kill(*killed)
    death = time.time_ns()
    if killed == ("robot",):
        pair.wait_for_silence(since=death)
    pair.start(killed[0])
    if killed[0] == "monitor" and len(killed) == 2:
        report = pair.reports.wait_for(lambda report: "no robot" in report.message, "no robot")
        assert report.level in (WARN, STALE)
        assert not any(stamp > death for topic in pair.topics.values() for stamp in topic.stamps)
    pair.start(*killed[1:])
    pair.wait_for_recovery(since=death)
