# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Direction of gravity from tf or an IMU, for arms on vehicles."""

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu

from diag_dynamics.exceptions import InputError, RejectedError
from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.statuses import problem_status
from diag_dynamics.nodes.support.tf import Transforms, unit_quaternion
from diag_dynamics.rotations import from_quaternion

PERIOD = 0.019
"""Minimum time between two changes of the model's gravity [s]: at 50 Hz each message counts."""

TIMEOUT = 1.0
"""Age of the direction above which states are rejected [s]."""


class GravitySource:
    """Turn the robot's gravity by the parameter gravity_frame or gravity_imu; keep its magnitude.

    `current` returns the MonitoredRobot or None. Without these parameters nothing changes.
    """

    def __init__(self, node, current):
        values = node.values
        self._current = current
        self._time = node.time
        self._frame = values["gravity_frame"]
        self.topic = values["gravity_imu"]
        self._robot = None
        self._fault = ""
        if self._frame:
            self._transforms = Transforms.if_installed(node)
            if self._transforms is None:
                raise InputError(
                    f"parameter 'gravity_frame' is '{self._frame}'; expected an installed package "
                    "tf2_ros. Install it or set gravity_imu."
                )
            node.create_timer(PERIOD, lambda: self._accept(self._read_frame), clock=steady_clock())

    def check(self):
        """Raise RejectedError while the direction is unknown or old."""
        if problem := self._problem():
            raise RejectedError("gravity unknown", problem)

    def _problem(self):
        if not (self._frame or self.topic):
            return ""
        source = f"direction of gravity from '{self._frame or self.topic}'"
        if self._robot is None or self._robot is not self._current() or self._up is None:
            return f"{source} is unknown: {self._fault or 'no message'}"
        age = self._time.steady() - self._received
        return f"{source} is old: {self._fault or 'no message'}" if age > TIMEOUT else ""

    def accept_imu(self, message):
        """Use the bytes of a sensor_msgs/Imu."""
        self._accept(self._read_imu, message)

    def _accept(self, read, *arguments):
        """Use the vector that `read` returns, up in the root link's axes."""
        robot = self._current()
        if robot is None:
            return
        if robot is not self._robot:
            self._robot = robot
            self._up = None
            self._changed = -np.inf
        up, fault = attempt(read, robot, *arguments)
        self._fault = fault.reason if fault else ""
        if fault:
            return
        now = self._time.steady()
        self._up = up
        self._received = now
        if now - self._changed >= PERIOD:
            self._changed = now
            robot.use_gravity(-float(np.linalg.norm(robot.settings.values["gravity"])) * self._up)

    def _read_imu(self, robot, message):
        imu = deserialize_message(message, Imu)
        if imu.orientation_covariance[0] == -1.0:
            raise InputError(
                "the Imu has no orientation; expected one, as of the package imu_filter_madgwick"
            )
        link = imu.header.frame_id
        body, placement = robot.model.placement_in_body(link)
        if body:
            if robot.position is None:
                raise InputError(f"no joint state yet, which places link '{link}' of the IMU")
            placement = robot.dynamics.placement(robot.position, link)
        up = from_quaternion(*unit_quaternion(imu.orientation))[2]  # the world's z in its axes
        return placement[:3, :3] @ up

    def _read_frame(self, robot):
        _, axes = self._transforms.find(robot.model.root_link, self._frame, TIMEOUT)
        return axes[:, 2]

    def report(self):
        """Return the status of the direction in a list; empty without a source."""
        if not (self._frame or self.topic):
            return []
        problem = self._problem()
        values = {}
        if self._robot is not None and self._up is not None:
            values["up in the axes of the root link"] = " ".join(f"{x:.4f}" for x in self._up)
        return [problem_status("gravity", [problem] * bool(problem), "direction is known", values)]
