# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effort commands of other nodes, which drivers without effort sensors report as efforts."""

from collections import deque

import numpy as np
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64MultiArray

from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.publishing import connected, newest

TOPIC = "effort_controller/commands"

MAX_COMMANDS = 5
"""Number of commands that are compared: efforts follow their command by one or two states."""


class EffortCommands:
    """The last commands on TOPIC."""

    def __init__(self, node):
        self._commands = deque(maxlen=MAX_COMMANDS)
        create = node.create_subscription
        take = self._take
        connected(create, Float64MultiArray, TOPIC, take, newest(), raw=True)

    def _take(self, raw):
        self._commands.append(raw)

    def repeated_by(self, effort):
        """Return whether the known ones of efforts are those of a command, in any order."""
        values = np.sort(effort[~np.isnan(effort)])
        for raw in reversed(self._commands):
            message, fault = attempt(deserialize_message, raw, Float64MultiArray)
            if not fault and np.array_equal(np.sort(message.data), values):
                return True
        return False
