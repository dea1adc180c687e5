# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots on the graph in this terminal: their joints by energy, torque or velocity, with peaks, limits and alarms."""

import argparse
import copy
import math
import sys
import time
from collections import deque
from contextlib import suppress
from functools import partial

import numpy as np
from lxml import etree
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from rclpy.validate_topic_name import validate_topic_name
from std_msgs.msg import String

from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from diag_dynamics.nodes.support.graph import topics_of
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.names import NODES
from diag_dynamics.nodes.support.runner import run
from diag_dynamics.text import plain
from diag_dynamics.views.top.choices import Choices
from diag_dynamics.views.top.frame import Shown, frame, line_of
from diag_dynamics.views.top.history import RobotHistory
from diag_dynamics.views.top.quantities import TORQUE, VELOCITY, columns
from diag_dynamics.views.top.screen import Screen, has_colours, is_dumb, is_fancy

KIND = "diag_dynamics/msg/DiagonalizedState"
"""Type of a monitor's states."""

TRUTH = "/ground_truth"
"""End of the name of a simulator's own states, which are shown only to who asks for them."""

LOOK = 1.0
"""How often the graph is looked at [s]."""

MOST = 60.0
"""Frames a second at most."""


class Top(Node):
    """Shows robots by their states; see the module.

    Parameters
    ----------
    topics : list of str
        States to be shown; none: those of all robots on the graph.
    rate : float
        Frames a second.
    duration : float or None
        After how many seconds to end.
    lines : bool
        Whether to write a line a second, and no frames.
    """

    def __init__(self, topics, rate, duration, lines, **kwargs):
        super().__init__("top", enable_rosout=False, start_parameter_services=False, **kwargs)
        self.finished = Future()
        self._asked, self._robots, self._snapshot = topics, {}, None
        self._choices, self._ends = Choices(), None if duration is None else time.monotonic() + duration
        self._colours, self._fancy = has_colours(), is_fancy()
        self._screen = None if lines else Screen()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._look()
        self.create_timer(LOOK, self._look, clock=steady)
        self.create_timer(1.0 if lines else 1.0 / rate, self._write_lines if lines else self._draw, clock=steady)

    def _look(self):
        """Listen to robots that have come."""
        found = self._asked or [topic for topic in topics_of(self, KIND) if not topic.endswith(TRUTH)]
        for topic in found:
            if topic not in self._robots:
                self._robots[topic] = _Robot(self, topic)

    def _shown(self):
        """What there is to show: at least one."""
        robots = [self._robots[topic].shown() for topic in sorted(self._robots)]
        waiting = f"waiting for a monitor: nobody publishes {KIND} yet"
        return robots or [Shown("diag_dynamics", waiting=waiting)]

    def _draw(self):
        choices = self._choices
        choices.take(self._screen.typed())
        if choices.ends or self._is_over():
            self._end()
            return
        if choices.restarts:
            choices.restarts = False
            for robot in self._robots.values():
                robot.restart()
        if not choices.paused:
            self._snapshot = None
        elif self._snapshot is None:
            self._snapshot = copy.deepcopy(self._shown())
        width, height = self._screen.size
        shown = self._snapshot or self._shown()
        self._screen.show(frame(shown, choices, width, height, self._colours, self._fancy))

    def _write_lines(self):
        for shown in self._shown():
            print(plain(line_of(shown)), flush=True)
        if self._is_over():
            self._end()

    def _is_over(self):
        return self._ends is not None and time.monotonic() > self._ends

    def _end(self):
        if not self.finished.done():
            self.finished.set_result(None)

    def destroy_node(self):
        """Give the terminal back."""
        if self._screen:
            self._screen.close()
            self._screen = None
        super().destroy_node()


class _Robot:
    """Listens to one robot: its states, the external torque that the same monitor tells, and the limits of its URDF."""

    def __init__(self, node, topic):
        self._node, self._history = node, None
        monitor = topic.rsplit("/", 1)[0]
        namespace, name = monitor.rsplit("/", 1)
        title = (namespace or "/") if name == NODES["monitor"] else topic
        self._told = Shown(title, waiting=f"waiting for states on {topic}")
        self._external, self._limits = None, {}
        self._came, self._received, self._late = deque(maxlen=5000), time.monotonic(), math.nan
        newest = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, name, take, qos in (
            (DiagonalizedState, topic, self._take, newest),
            (ExternalTorque, f"{monitor}/external_torque", self._take_external, newest),
            (String, f"{namespace}/robot_description", self._take_description, latched),
        ):
            node.create_subscription(kind, name, partial(self._guarded, take), qos)

    def _guarded(self, take, message):
        """Nothing that arrives may end the view."""
        if attempt(take, message)[1]:
            self._told.refused += 1

    def restart(self):
        """Begin peaks anew."""
        if self._history:
            self._history.restart()

    def _take(self, message):
        history = self._history
        if history is None or history.names != message.dof_names:
            history = self._history = RobotHistory(message.dof_names)
            self._set_limits()
        stamp = message.header.stamp
        at = stamp.sec + 1e-9 * stamp.nanosec
        now = self._node.get_clock().now().nanoseconds
        self._late = 1e-9 * (now - (stamp.sec * 1_000_000_000 + stamp.nanosec))
        external = self._external
        if external is not None and len(external) != len(history.names):
            external = None
        history.add(at, columns(message, external))
        self._told.power = message.power if message.effort_valid else math.nan
        self._received = time.monotonic()
        self._came.append(self._received)

    def _take_external(self, message):
        told = self._told
        if not message.valid:
            self._external, told.torque, told.residual = None, (math.nan, math.inf), (math.nan, math.inf)
            told.alarm = ""
            return
        self._external = np.array(message.external_torque)
        told.torque = message.torque_norm, _bound(message.torque_norm_threshold)
        told.residual = message.norm, _bound(message.threshold)
        joints = [name for name, on in zip(message.dof_names, message.joint_collision, strict=False) if on]
        told.alarm = f"collision: {', '.join(joints)}" if joints else "collision" if message.collision else ""
        if self._history:
            self._history.set_thresholds([_bound(threshold) for threshold in message.torque_threshold])

    def _take_description(self, message):
        self._limits = limits_of(message.data)
        if self._history:
            self._set_limits()

    def _set_limits(self):
        for row, which in ((TORQUE, 0), (VELOCITY, 1)):
            known = [self._limits.get(name, (math.inf, math.inf))[which] for name in self._history.names]
            self._history.limits[row] = known

    def shown(self):
        """What there is to show now."""
        now, came, told = time.monotonic(), self._came, self._told
        while came and came[0] < now - 1.0:
            came.popleft()
        told.history, told.rate, told.late, told.silent = self._history, len(came), self._late, now - self._received
        return told


def limits_of(text):
    """Limits of effort and velocity by joint, of a URDF; inf where there is none. What is no URDF has none."""
    limits = {}
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, recover=True)
    with suppress(etree.XMLSyntaxError, ValueError):
        root = etree.fromstring(text.encode(), parser)
        for joint in root.iterfind("joint") if root is not None else ():
            limit = joint.find("limit")
            if limit is not None:
                limits[joint.get("name")] = _number(limit.get("effort")), _number(limit.get("velocity"))
    return limits


def _number(text):
    try:
        return _bound(float(text or 0.0))
    except ValueError:
        return math.inf


def _bound(value):
    """A bound, inf where there is none."""
    return value if 0.0 < value < math.inf else math.inf


def options(parser):
    """Declare the arguments."""
    parser.add_argument(
        "--state",
        metavar="TOPIC",
        action="append",
        default=[],
        help="states to be shown (default: those of all robots); may be repeated",
    )
    parser.add_argument("--rate", type=float, default=10.0, help="frames a second (default: 10)")
    parser.add_argument("--duration", type=float, help="end after so many seconds")
    parser.add_argument(
        "--lines",
        action="store_true",
        help="a line a second, as on a terminal that can do no more, or where there is none",
    )
    return parser


def main(args=None):
    """Show robots: ``ros2 run diag_dynamics top``."""
    parser = options(argparse.ArgumentParser(prog="top", description=__doc__))
    chosen = parser.parse_args(remove_ros_args(args or sys.argv)[1:])
    if not 0.0 < chosen.rate <= MOST:
        parser.error(f"argument --rate: {chosen.rate} is not a number > 0 and <= {MOST:g}")
    if chosen.duration is not None and not 0.0 < chosen.duration < math.inf:
        parser.error(f"argument --duration: {chosen.duration} is not a number > 0")
    for topic in chosen.state:
        try:
            validate_topic_name(topic)
        except InvalidTopicNameException as error:
            parser.error(f"argument --state: {error}")
        if not topic.startswith("/"):
            parser.error(f"argument --state: '{topic}' does not begin with /")
    lines = chosen.lines or is_dumb()
    return run(lambda: Top(chosen.state, chosen.rate, chosen.duration, lines), args)


if __name__ == "__main__":
    sys.exit(main())
