# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A soak of the monitor: a stream of states at a high rate with faults among them, and whether all of it is accounted for.

As a test, for seconds: test_soak.py. As a program, for hours: ``python test/support/soak.py --seconds 3600``.

A feeder in a process of its own publishes the states of a UR5 by two publishers, its arm and its wrist, and in between,
drawn by seed, messages that are wrong in every way known. Positions, velocities and efforts are functions of the time, so
whatever the monitor publishes can be traced to the message it came from, and computed anew by Pinocchio.
"""

import argparse
import json
import math
import os
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import psutil
import rclpy
from diag_dynamics.msg import DiagonalizedState
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from nodes import MS, START, TIMEOUT, UR5, Monitor, S, Truth, joint_state, nanoseconds, robot
from processes import LivePeer as Peer
from processes import Process

NAMESPACE = "/soak"
RATE = 1000.0
SOURCES = {"arm": slice(0, 4), "wrist": slice(4, 6)}
"""Joints of each publisher; one message in five is the wrist's."""
DEEP = QoSProfile(depth=20000)
MAX_AGE = 30.0
"""A busy machine may keep messages waiting for seconds: [s]."""


# --- what is sent


class Motion:
    """Where the joints are at a time, how fast, and with which efforts: sums of no common period."""

    def __init__(self, count):
        rng = np.random.default_rng(7)
        self._amplitude = rng.uniform(0.3, 1.2, count)
        self._rate = rng.uniform(0.7, 3.1, count)
        self._phase = rng.uniform(0.0, 6.0, count)

    def at(self, stamp):
        """Return q, q̇ and τ at a stamp [ns]."""
        angle = self._rate * (stamp % (10_000 * S)) * 1e-9 + self._phase
        return (
            self._amplitude * np.sin(angle),
            self._amplitude * self._rate * np.cos(angle),
            10.0 * np.sin(2.0 * angle),
        )


def with_entry(values, value):
    """Return the values with another first one."""
    return [value, *values[1:]]


FAULTS = {
    "none": lambda names, q, qd, tau, stamp: (names, q, qd, tau, stamp),
    "no effort": lambda names, q, qd, tau, stamp: (names, q, qd, [], stamp),
    "effort is inf": lambda names, q, qd, tau, stamp: (names, q, qd, with_entry(tau, math.inf), stamp),
    "extra joint": lambda names, q, qd, tau, stamp: ([*names, "lid"], [*q, math.nan], [*qd, 1e30], [*tau, 0.0], stamp),
    "other robot": lambda names, q, qd, tau, stamp: (["wheel"], [1.0], [math.nan], [], stamp),
    "empty": lambda names, q, qd, tau, stamp: ([], [], [], [], stamp),
    "velocity is NaN": lambda names, q, qd, tau, stamp: (names, q, with_entry(qd, math.nan), tau, stamp),
    "no velocity": lambda names, q, qd, tau, stamp: (names, q, [], tau, stamp),
    "position is NaN": lambda names, q, qd, tau, stamp: (names, with_entry(q, math.nan), qd, tau, stamp),
    "position is inf": lambda names, q, qd, tau, stamp: (names, with_entry(q, -math.inf), qd, tau, stamp),
    "no position": lambda names, q, qd, tau, stamp: (names, [], qd, tau, stamp),
    "position in degrees": lambda names, q, qd, tau, stamp: (names, with_entry(q, 80.0), qd, tau, stamp),
    "velocity is absurd": lambda names, q, qd, tau, stamp: (names, q, with_entry(qd, 1e9), tau, stamp),
    "too short": lambda names, q, qd, tau, stamp: (names, q[:-1], qd, tau, stamp),
    "too long": lambda names, q, qd, tau, stamp: (names, q, qd, [*tau, 0.0], stamp),
    "joint twice": lambda names, q, qd, tau, stamp: ([*names, names[0]], [*q, 0], [*qd, 0], [*tau, 0], stamp),
    "of last minute": lambda names, q, qd, tau, stamp: (names, with_entry(q, 0.5), qd, tau, stamp - 60 * S),
    "of next minute": lambda names, q, qd, tau, stamp: (names, with_entry(q, 0.5), qd, tau, stamp + 60 * S),
    "late": lambda names, q, qd, tau, stamp: (names, with_entry(q, 0.5), qd, tau, stamp - 400 * MS),
    "lost": None,
    "pause": None,
}
"""Each fault as a change of a good message."""

CAUSES = {
    "position is NaN": "no position",
    "position is inf": "no position",
    "no position": "no position",
    "position in degrees": "absurd value",
    "velocity is absurd": "absurd value",
    "too short": "wrong length",
    "too long": "wrong length",
    "joint twice": "duplicate name",
    "of last minute": "stamp from the past",
    "of next minute": "stamp from the future",
}
"""Faults that are refused whatever came before, and the cause they are counted under."""

USABLE = ("none", "no effort", "effort is inf", "extra joint")
"""Messages whose positions and velocities are good."""


class Sent(NamedTuple):
    """A message of the feeder: its source, its stamp [ns] and its fault."""

    source: str
    stamp: int
    fault: str


def feed(seed, seconds, record):
    """Publish for a time, and write a record of what was sent."""
    rng = random.Random(seed)
    names = list(robot(UR5).names)
    motion = Motion(len(names))
    rclpy.init()
    node = rclpy.create_node("feeder", namespace=NAMESPACE)
    publishers = {source: node.create_publisher(JointState, "joint_states", DEEP) for source in SOURCES}
    deadline = time.monotonic() + START
    while not all(publisher.get_subscription_count() for publisher in publishers.values()):
        assert time.monotonic() < deadline, "nobody listens to the feeder"
        rclpy.spin_once(node, timeout_sec=0.1)
    sent, begin, last = [], time.perf_counter(), 0
    k = 0
    while time.perf_counter() - begin < seconds:
        time.sleep(max(begin + k / RATE - time.perf_counter(), 0.0))  # the rate is what is asked for
        source = "wrist" if k % 5 == 0 else "arm"
        k += 1
        fault = rng.choice([*FAULTS][1:]) if rng.random() < 0.05 and k > 20 else "none"
        if fault == "pause":
            time.sleep(0.05)  # the fault itself
        if FAULTS[fault] is None:
            continue
        last = stamp = max(time.time_ns(), last + 1)
        part = SOURCES[source]
        values = FAULTS[fault](names[part], *(x[part].tolist() for x in motion.at(stamp)), stamp)
        publishers[source].publish(joint_state(*values[:4], stamp=values[4]))
        sent.append(Sent(source, stamp, fault))
    Path(record).write_text(json.dumps(sent))
    for publisher in publishers.values():
        publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=TIMEOUT))
    node.destroy_node()
    rclpy.try_shutdown()


# --- what is to come of it


class Reference:
    """The states that may be published, and Pinocchio's numbers for them."""

    def __init__(self, sent):
        self.robot, self.motion = robot(UR5), Motion(len(robot(UR5).names))
        # of each source, the position of its first joint says which message it is of
        self._sent = {source: {} for source in SOURCES}
        for source, stamp, fault in sent:
            if fault in USABLE:
                self._sent[source][self.motion.at(stamp)[0][SOURCES[source]][0]] = (stamp, fault)

    def check(self, message):
        """Trace a published state to the messages it came from, and compare it with Pinocchio; return its stamp [ns]."""
        state, stamps, believed = np.zeros((3, len(self.robot.names))), [], True
        for source, part in SOURCES.items():
            stamp, fault = self._sent[source][message.position[part][0]]  # KeyError: no good message has this position
            state[:, part] = np.array(self.motion.at(stamp))[:, part]
            believed &= fault not in ("no effort", "effort is inf")
            stamps.append(stamp)
        assert nanoseconds(message.oldest_stamp) == min(stamps)
        truth = Truth(self.robot, state[0], state[1], state[2] if believed else None)
        truth.check({"state": message}, max(stamps))
        return max(stamps)


class Usage(NamedTuple):
    """Resources of the monitor at a time [s]: resident memory [MB], threads and file descriptors."""

    time: float
    memory: float
    threads: int
    descriptors: int


class Outcome(NamedTuple):
    """Messages sent, states checked, the last report and the usage of a soak."""

    sent: list
    checked: int
    report: object
    usage: list


def soak(peer, seed, seconds):
    """Run a soak and check every state published; returns an :class:`Outcome`."""
    state, inputs = f"{NAMESPACE}/diag_dynamics/state", f"qos_overrides.{NAMESPACE}/joint_states.subscription"
    parameters = {f"qos_overrides.{state}.publisher.depth": 20000, "max_age": MAX_AGE, f"{inputs}.depth": 20000}
    states, usage = peer.topic(DiagonalizedState, state, DEEP), []
    with Monitor(peer, NAMESPACE, outputs=(), robot_description=robot(UR5).path, **parameters) as monitor:
        peer.wait_until(states.subscription.get_publisher_count, "the monitor", START)
        process = psutil.Process(monitor.process.popen.pid)
        with tempfile.TemporaryDirectory() as folder:
            record = Path(folder, "sent.json")
            feeder = Process([sys.executable, __file__, "--feed", record, "--seed", seed, "--seconds", seconds])
            while feeder.alive():
                memory = process.memory_info().rss / 1e6
                usage.append(Usage(time.monotonic(), memory, process.num_threads(), process.num_fds()))
                monitor.next_report()
            assert feeder.wait() == 0, feeder.tail()
            sent = [Sent(*entry) for entry in json.loads(record.read_text())]
        report = monitor.wait_for_report(lambda report: report.count("received") == len(sent), "all messages")
        peer.wait_until(lambda: len(states.messages) >= report.count("published"), "all states")
    peer.node.destroy_subscription(states.subscription)
    reference = Reference(sent)
    newest = [reference.check(message) for message in states.messages]
    assert newest == sorted(newest), "time went back"
    return Outcome(sent, len(newest), report, usage)


def check(outcome):
    """Hold what was sent, received, rejected and published against each other."""
    sent, report = Counter(entry.fault for entry in outcome.sent), outcome.report
    assert report.count("received") == len(outcome.sent)
    assert report.count("published") == outcome.checked
    assert report.count("received") == report.outcomes()
    skipped = report.count("skipped: overload")  # on a machine that stood still for a second
    expected = {f"rejected: {cause}": 0 for cause in CAUSES.values()}
    for fault, cause in CAUSES.items():
        expected[f"rejected: {cause}"] += sent[fault]
    expected |= {"foreign": sent["other robot"] + sent["empty"], "absurd effort": sent["effort is inf"]}
    for key, count in expected.items():
        assert count - skipped <= report.count(key) <= count, key
    assert report.count("rejected: late") >= 0.9 * sent["late"] - skipped  # after a pause they are not late
    assert "rejected: internal error" not in report.values
    assert outcome.checked > 0.7 * sum(sent[fault] for fault in USABLE)


def main():
    """Feed, or run a soak and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--feed", type=Path, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.feed:
        feed(chosen.seed, chosen.seconds, chosen.feed)
        return
    domain = int(os.environ.setdefault("ROS_DOMAIN_ID", "42"))
    with Peer(domain) as peer:
        outcome = soak(peer, chosen.seed, chosen.seconds)
    check(outcome)
    first, last = outcome.usage[len(outcome.usage) // 5], outcome.usage[-1]
    print(f"{len(outcome.sent)} messages, {outcome.checked} states published and checked, none wrong")
    print(f"memory {first.memory:.1f} -> {last.memory:.1f} MB, threads {first.threads} -> {last.threads}")
    print(f"descriptors {first.descriptors} -> {last.descriptors}")


if __name__ == "__main__":
    main()
