# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of a Panda that is pushed, and a monitor that observes them."""

import numpy as np
from diag_dynamics.msg import ContactLimits, ExternalTorque

from nodes import MS, PANDA, joint_state, robot

GAIN, STEP = 40.0, 2 * MS
TORQUE = "external torque"
"""Name of the entry on diagnostics."""


class Motion:
    """A swing of all joints by Pinocchio's efforts, less those of a push: states by number, `STEP`
    apart.
    """

    def __init__(self, robot, push=0.0, size=0.3, **options):
        self.robot = robot
        self.push = np.broadcast_to(push, len(robot.names))
        self.oracle = robot.make_oracle(robot.urdf, **options)
        self.middle = robot.samples[1].q
        self.size = size * np.cos(np.arange(len(self.middle)))

    def __call__(self, k):
        w = 4.0
        t = 1e-9 * STEP * k
        q = self.middle + self.size * np.sin(w * t)
        qd = self.size * w * np.cos(w * t)
        return (
            q,
            qd,
            self.oracle.inverse_dynamics(q, qd, -self.size * w**2 * np.sin(w * t)) - self.push,
        )


def subscribed(monitor):
    """Subscribe to the topics of this file."""
    monitor.torque = monitor.peer.topic(ExternalTorque, f"{monitor.name}/external_torque")
    monitor.contact_limits = monitor.peer.topic(ContactLimits, f"{monitor.name}/contact_limits")
    monitor.peer.pass_time(0.1)  # the monitor looks for subscriptions a hundred times a second
    return monitor


def feed(monitor, states):
    """Publish states `STEP` apart; return the message of external torque of each."""
    result = []
    for q, qd, tau in states:
        monitor.publish(
            joint_state(robot(PANDA).names, q, qd, () if tau is None else tau, monitor.tick(STEP))
        )
        result.append(monitor.torque.at(monitor.now))
    return result
