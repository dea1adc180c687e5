# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The executors of rclpy by the names they have here."""

from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor

EXECUTORS = {
    "EventsExecutor": EventsExecutor,
    "SingleThreadedExecutor": SingleThreadedExecutor,
    "MultiThreadedExecutor": MultiThreadedExecutor,
}
