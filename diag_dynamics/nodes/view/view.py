# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The view node: a page in the browser that shows the robots of monitors, live. It commands no robot."""

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.nodes.support.declaring import TableNode, judge
from diag_dynamics.nodes.support.diagnostics import OK, WARN, Diagnostics, Status, counted
from diag_dynamics.nodes.support.graph import topics_of
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.names import NODES
from diag_dynamics.nodes.view.robot_subscription import RobotSubscription, folders_of
from diag_dynamics.page.server import PageServer
from diag_dynamics.parameters.view import PARAMETERS

ROBOT_NODES = [name for node, name in NODES.items() if node != "view"]
"""Nodes of a robot whose diagnostics are shown."""

SEARCH_PERIOD = 1.0
"""Time between two searches for monitors [s]."""

KIND, STATE = "diag_dynamics/msg/DiagonalizedState", "/state"
"""Type of a monitor's states, and the end of their topic's name: a simulator's truth has another one."""

MAX_TABS, MAX_ROBOTS = 64, 32


class ViewNode(TableNode, Node):
    """See the module; parameters are in :data:`~parameters.view.PARAMETERS`, and `on_push` is that of the server."""

    def __init__(self, on_push=None, **options):
        super().__init__(NODES["view"], PARAMETERS, **options)
        values = self.values
        if not 1 <= values["tabs"] <= MAX_TABS:
            raise InputError(f"parameter 'tabs' is {values['tabs']}, expected a whole number from 1 to {MAX_TABS}.")
        self._robots, self._folders = {}, folders_of(values["mesh_folders"])
        address = values["host"], values["port"]
        self._server = PageServer(self._streams, *address, values["rate"], values["tabs"], on_push)
        self._server.start()
        self.get_logger().info(f"Page: {self.address}")
        self._diagnostics = Diagnostics(self, self._report, lambda: None)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._receive_diagnostics, 10)
        self.create_timer(SEARCH_PERIOD, self._find_monitors, clock=steady_clock())
        self._find_monitors()
        judge(self, PARAMETERS, self.values.update)

    @property
    def address(self):
        """URL of the page."""
        return self._server.address

    def destroy_node(self):
        """End the streams and unsubscribe."""
        robots, self._robots = self._robots, {}
        for robot in robots.values():
            attempt(robot.destroy)
        attempt(self._server.stop)
        return super().destroy_node()

    # --- Robots ---

    def _streams(self):
        return [robot.stream for _, robot in sorted(self._robots.copy().items())]

    def _find_monitors(self):
        """Find monitors. A robot whose monitor has gone stays for a time, with the age of its last state."""
        for topic in topics_of(self, KIND):
            monitor = topic.removesuffix(STATE)
            if topic.endswith(STATE) and monitor not in self._robots and self._is_selected(monitor):
                self._add_robot(monitor)
        for robot in self._robots.values():
            _, fault = attempt(robot.update)
            if fault:
                self.get_logger().error(f"{robot.monitor}: {fault.text}", throttle_duration_sec=5.0)
        for monitor in [monitor for monitor, robot in self._robots.items() if robot.has_gone]:
            self._robots.pop(monitor).destroy()

    def _is_selected(self, monitor):
        wanted = {name.rstrip("/") or "/" for name in self.values["robots"] if name}
        wanted = {name if name.startswith("/") else f"/{name}" for name in wanted}
        return not wanted or bool(wanted & {monitor, monitor.rpartition("/")[0] or "/"})

    def _add_robot(self, monitor):
        if len(self._robots) >= MAX_ROBOTS:
            self.get_logger().warning(f"The page shows at most {MAX_ROBOTS} robots and omits {monitor}.", once=True)
            return
        self._robots[monitor] = RobotSubscription(self, monitor, self._folders)

    def _receive_diagnostics(self, message):
        for robot in self._robots.values():
            own = {f"{robot.namespace.rstrip('/')}/{name}".lstrip("/") for name in ROBOT_NODES}
            own.add(robot.monitor.lstrip("/"))
            statuses = [status for status in message.status if status.name.partition(": ")[0] in own]
            if statuses:
                robot.set_diagnostics(statuses)

    def _report(self):
        faults = [robot.fault for robot in self._robots.values() if robot.fault]
        shown = {
            "address": self.address,
            "tabs": self._server.streams,
            "monitors": counted(sorted(self._robots)),
        }
        if faults:
            return [Status("page", WARN, "; ".join(faults), shown)]
        return [Status("page", OK, f"served at {self.address}" if self._robots else "no monitor found", shown)]
