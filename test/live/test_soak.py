# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A soak of the monitor at 1 kHz with faults among the states: counters add up, states are right,
and nothing grows.

DIAG_DYNAMICS_SOAK_SECONDS sets the duration.
"""

import math
import os
import time
from collections import Counter
from typing import NamedTuple

import numpy as np
import psutil
import pytest
from diag_dynamics.msg import DiagonalizedState
from rclpy.qos import QoSProfile

from nodes import UR5, Monitor, S, joint_state, robot

pytestmark = [pytest.mark.full, pytest.mark.live]

SECONDS = float(os.environ.get("DIAG_DYNAMICS_SOAK_SECONDS", "30"))
DEEP = QoSProfile(depth=20_000)
SAMPLES = robot(UR5).samples

FAULTS = {
    "no position": lambda q, qd, tau, stamp: ([math.nan, *q[1:]], qd, tau, stamp),
    "implausible value": lambda q, qd, tau, stamp: ([80.0, *q[1:]], qd, tau, stamp),
    "no velocity": lambda q, qd, tau, stamp: (q, [], tau, stamp),
    "wrong length": lambda q, qd, tau, stamp: (q[:-1], qd, tau, stamp),
    "stamp from the past": lambda q, qd, tau, stamp: (q, qd, tau, stamp - 60 * S),
    "stamp from the future": lambda q, qd, tau, stamp: (q, qd, tau, stamp + 60 * S),
}
"""Faults by the cause of their rejection, as changes of a good message."""


class Usage(NamedTuple):
    """Resources of the monitor at a time [s]: resident memory [MB], threads and file
    descriptors.
    """

    time: float
    memory: float
    threads: int
    descriptors: int


def publish(monitor, rng, stamp):
    """Publish a joint state, one in twenty with a fault, and return its fault."""
    fault = str(rng.choice([*FAULTS])) if rng.random() < 0.05 else None
    good = (*(values.tolist() for values in SAMPLES[stamp % 3][:3]), stamp)
    *values, stamp = FAULTS[fault](*good) if fault else good
    monitor.feeder.publish(joint_state(robot(UR5).names, *values, stamp))
    return fault


def test_soak(peer):
    """Memory grows by less than 0.4 MB a second once pools are filled; a leak of a joint state each
    is 1 MB a second.

    On a machine that stands still for a second the monitor skips states, and counts them.
    """
    inputs = {
        "qos_overrides./soak/joint_states.subscription.depth": 20_000,
        "qos_overrides./soak/diag_dynamics/state.publisher.depth": 20_000,
    }
    sent = Counter()
    usage = []
    rng = np.random.default_rng(1)
    with Monitor(
        peer, "/soak", outputs=(), robot_description=robot(UR5).path, max_age=30.0, **inputs
    ) as monitor:
        states = peer.topic(DiagonalizedState, f"{monitor.name}/state", DEEP)
        peer.wait_until(
            lambda: (
                states.subscription.get_publisher_count()
                and monitor.feeder.get_subscription_count()
            ),
            "it",
        )
        monitor.process.wait_for_text("Ready")
        process = psutil.Process(monitor.process.popen.pid)
        end = time.monotonic() + SECONDS
        timer = peer.node.create_timer(
            1e-3, lambda: sent.update([publish(monitor, rng, peer.now())])
        )
        while time.monotonic() < end:
            monitor.next_report()
            memory = process.memory_info().rss / 1e6
            usage.append(Usage(time.monotonic(), memory, process.num_threads(), process.num_fds()))
        peer.node.destroy_timer(timer)
        report = monitor.wait_for_report(
            lambda report: report.count("received") == sent.total(), "all messages"
        )
        peer.wait_until(lambda: len(states.messages) >= report.count("published"), "all states")
    skipped = report.count("skipped: overload")
    assert report.count("received") == report.outcomes()
    assert report.count("published") == len(states.messages) > 0.7 * sent[None] - skipped
    settled = usage[len(usage) // 3]
    last = usage[-1]
    assert last.threads <= settled.threads and last.descriptors <= settled.descriptors
    assert last.memory - settled.memory < 0.4 * (last.time - settled.time)
