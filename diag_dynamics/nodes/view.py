# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The view node: a browser page that shows the robots of monitors. It commands no robot."""

import json
import time
from collections import deque
from typing import ClassVar

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from diag_dynamics.description.check_table import handle_warnings
from diag_dynamics.description.urdf_text import read_text
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.msg import ContactLimits, DiagonalizedState, ExternalTorque
from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.nodes.support.declaring import TableNode, judge
from diag_dynamics.nodes.support.descriptions import RobotLoader
from diag_dynamics.nodes.support.diagnostics import Diagnostics, counted
from diag_dynamics.nodes.support.graph import topics_of
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.publishing import latched, newest
from diag_dynamics.nodes.support.statuses import WARN, Status, problem_status
from diag_dynamics.nodes.support.topics import NODES
from diag_dynamics.page.frames import States
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.server import PageServer
from diag_dynamics.page.stream import Received, RobotStream, compile_frames
from diag_dynamics.parameters.monitor import PARAMETERS as MONITOR
from diag_dynamics.parameters.monitor import observation_of
from diag_dynamics.parameters.robot_models import model_of
from diag_dynamics.parameters.shared import PARAMETERS as SHARED
from diag_dynamics.parameters.view import PARAMETERS
from diag_dynamics.text import listed, shortened

ROBOT_NODES = [name for node, name in NODES.items() if node != "view"]
"""Nodes of a robot whose diagnostics are shown."""

SEARCH_PERIOD, SEARCH_TIMEOUT = 1.0, 3.0
"""Time between two searches for monitors, and without one until that is reported [s]."""

KIND, STATE = "diag_dynamics/msg/DiagonalizedState", "/state"
"""Type of a monitor's states, and the end of their topic's name: a simulator's truth has another
one."""

OBSERVED = [
    name for name in MONITOR if name.startswith(("external_torque.", "collision.", "contact."))
]
"""Parameters of a monitor's observer."""

REQUESTED = ("robot_description", *SHARED, *OBSERVED)
"""Parameters of a monitor that make its model and its observer."""

MAX_DIFFERENCE = 0.1
"""Largest difference between the stamps of a state and of its external torque or contact [s]."""

MAX_REQUESTS = 10
"""Requests for parameters that await an answer. One is sent in each second, and a slow monitor
answers late."""

RESPONSE_TIMEOUT = 2.0
"""Time [s] without parameters or a description after which these are reported as missing."""

REMOVAL_TIMEOUT = 10.0
"""Time without a publisher after which a robot is removed [s]."""

VECTORS = (
    "position",
    "velocity",
    "effort",
    "nu",
    "epsilon",
    "coriolis",
    "gravity",
    "articulated_inertia",
)
"""Fields of a state's message, in the order of :class:`~diag_dynamics.page.frames.States`."""

CONTACT_VECTORS = {
    "contact_limits_speed": "speed",
    "contact_limits_mass": "reflected_mass",
    "contact_limits_energy": "transferable_energy",
    "contact_limits_allowed": "allowed_speed",
}
"""Fields of a frame, and those of the message that they are read from."""

DIAGNOSTICS_TIMEOUT = 5.0
"""Time [s] after which a status that is not repeated is removed; diagnostic_aggregator takes it
for stale then."""

KINDS = {
    "state": DiagonalizedState,
    "external_torque": ExternalTorque,
    "contact_limits": ContactLimits,
}
"""Types of a monitor's messages by topic."""


class RobotSubscription:
    """The robot of one monitor. Messages stay bytes until a page asks for a frame.

    Parameters
    ----------
    node : rclpy.node.Node
    monitor : str
        Full name of the monitor.

    Attributes
    ----------
    monitor, namespace : str
    stream : RobotStream
    difference : str
        Why the robot differs from the monitor's; empty if it does not.
    """

    def __init__(self, node, monitor):
        self.monitor = monitor
        self.namespace = monitor.rpartition("/")[0] or "/"
        self._node = node
        self._newest = {}
        self._count = 0
        self._read_count = 0
        is_usual = monitor.rpartition("/")[2] == NODES["monitor"]
        name = self.namespace if is_usual else monitor
        self.stream = RobotStream(name, self._read)
        self._subscriptions = {}
        self._added_at = node.time.steady()
        for topic in ("state", "external_torque"):
            self._subscribe(topic)
        self._topic = f"{self.namespace.rstrip('/')}/robot_description"
        self._subscriptions["robot_description"] = node.create_subscription(
            String, self._topic, self._receive_description, latched()
        )
        self._client = node.create_client(GetParameters, f"{monitor}/get_parameters")
        self._loader = RobotLoader(node, self._load_robot, self._take_robot)
        # Of the topic; of the monitor; both of the model in force.
        self._description = self._values = self._loaded = None
        self._requests = deque()
        self._published_at = self._added_at
        self._points = ()
        self._diagnostics = {}
        self._faults = dict.fromkeys(("silence", "parameters", "robot", "states"), "")
        self.difference = ""
        self.stream.waiting = f"waiting for the parameters of {monitor}"

    @property
    def fault(self):
        """Why the robot or its states cannot be shown; empty if nothing is wrong."""
        return "; ".join(filter(None, self._faults.values()))

    @property
    def has_gone(self):
        """Whether the monitor has had no publisher for :data:`REMOVAL_TIMEOUT`."""
        return self._node.time.steady() - self._published_at > REMOVAL_TIMEOUT

    def update(self):
        """Request the monitor's parameters; called once a second."""
        self._show_diagnostics()
        if not self._node.count_publishers(f"{self.monitor}/state"):
            return
        self._published_at = self._node.time.steady()
        self._set_fault("silence", self._explain_silence())
        if not self._client.service_is_ready():
            return
        if len(self._requests) == MAX_REQUESTS:
            self._client.remove_pending_request(self._requests.popleft())
        request = self._client.call_async(GetParameters.Request(names=list(REQUESTED)))
        self._requests.append(request)
        request.add_done_callback(
            lambda future: self._try("parameters", self._receive_parameters, future)
        )

    def set_diagnostics(self, statuses):
        """Show statuses of this robot's nodes."""
        for status in statuses:
            is_of_limits = status.name == f"{self.monitor.lstrip('/')}: contact limits"
            if is_of_limits and "contact_limits" not in self._subscriptions:
                # Without limits the monitor would compute contact for the page alone.
                self._subscribe("contact_limits")
            about = {
                "level": status.level[0],
                "name": status.name,
                "message": status.message,
                "values": {value.key: value.value for value in status.values},
            }
            self._diagnostics[status.name] = time.monotonic(), about
        self._show_diagnostics()

    def _show_diagnostics(self):
        oldest = time.monotonic() - DIAGNOSTICS_TIMEOUT
        statuses = []
        for name, (received, about) in list(self._diagnostics.items()):
            if received > oldest:
                statuses.append(about)
            else:
                del self._diagnostics[name]
        self.stream.set_diagnostics(statuses)

    def destroy(self):
        """Unsubscribe."""
        self._loader.drop()
        self._node.destroy_client(self._client)
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)

    def _subscribe(self, topic):
        def receive(raw):
            self._newest[topic] = raw

        callback = self._receive_state if topic == "state" else receive
        self._subscriptions[topic] = self._node.create_subscription(
            KINDS[topic], f"{self.monitor}/{topic}", callback, newest(), raw=True
        )

    # --- Faults ---

    def _set_fault(self, source, text):
        """Show why something failed; an empty text removes the fault. Threads may call it."""
        self._faults[source] = shortened(text)
        self.stream.error = self.fault

    def _try(self, source, action, *arguments):
        """Return the result of an action, None if it fails; a fault stays until the next result."""
        result, fault = attempt(action, *arguments)
        if fault:
            self._set_fault(source, f"{source} of {self.monitor}: {fault.reason}")
        elif result is not None:
            self._set_fault(source, "")
        return result

    def _explain_silence(self):
        """Return what does not come for RESPONSE_TIMEOUT; empty if nothing is missing."""
        if self._node.time.steady() - self._added_at < RESPONSE_TIMEOUT:
            return ""
        if self._values is None:
            return (
                f"{self.monitor}/get_parameters has no answer; expected parameters of a monitor, "
                "because the page requires its model. Start the monitor."
            )
        if not (self._values["robot_description"] or self._description):
            return f"{self._topic} has no message; expected a URDF. Start robot_state_publisher."
        return ""

    # --- The model ---

    def _receive_description(self, message):
        self._description = message.data
        self._load()

    def _receive_parameters(self, future):
        values = [parameter_value_to_python(value) for value in future.result().values]
        received = {
            name: value for name, value in zip(REQUESTED, values, strict=False) if value is not None
        }
        defaults = {name: MONITOR[name].default for name in (*SHARED, *OBSERVED)}
        self._values = defaults | {"robot_description": ""} | received
        self._load()
        return self._values

    def _load(self):
        """Load the robot as the monitor has it, unless it is loaded already."""
        if self._values is None:
            return
        description = self._values["robot_description"] or self._description
        if not description:
            self.stream.waiting = f"waiting for {self._topic}"
            return
        request = description, json.dumps(self._values, sort_keys=True, default=str)
        if request != self._loaded:
            self._loaded = request
            self._loader.load(description, self._values)

    def _load_robot(self, description, values):
        """Return dynamics, scene, meshes, covariance of the external torque, and the difference.

        The difference is that from the monitor's robot. It is called in a thread.
        """
        source = (
            description if values["robot_description"] else description.encode(errors="replace")
        )
        with handle_warnings(lambda warning: None):  # the monitor logs them
            text = read_text(source)
            difference = ""
            try:
                model = model_of(text, values)
            except InputError as error:  # as for a file of another machine
                if not values["parameters_file"]:
                    raise
                model = model_of(text, values | {"parameters_file": ""})
                difference = f"the page shows the model without parameters_file: {error}"
        meshes = MeshLibrary(mesh_folders(source if isinstance(source, str) else None))
        dynamics = DiagonalDynamics(model)
        observation = observation_of(values)
        covariance = observation.covariance_of(model.dof_names) if observation else None
        compile_frames(dynamics, covariance)
        return dynamics, scene_of(model, text, meshes), meshes, covariance, shortened(difference)

    def _take_robot(self, loaded, *_):
        if self._try("robot", self._show_robot, loaded) is None:
            self._loaded = None  # try again

    def _show_robot(self, loaded):
        """Show a loaded robot and return its model; raise the error of its loading."""
        if isinstance(loaded, Exception):
            raise loaded
        *robot, difference = loaded
        dynamics, _, meshes, _ = robot
        self._set_fault("states", "")  # of the robot before
        self.stream.set_robot(*robot, difference)
        name = dynamics.model.name
        node = self._node
        self.difference = difference and f"{self.monitor}: {difference}"
        node.log_info(f"Showing robot '{name}' of {self.monitor}.")
        for why in list(meshes.missing.values())[:3]:
            node.log_warning(f"Robot '{name}' lacks a mesh: {why}")
        return dynamics.model

    # --- States ---

    def _receive_state(self, raw):
        self._newest["state"] = raw, time.monotonic()
        self._count += 1

    def _read(self, dynamics):
        """Return the newest state as Received; called in the page's thread."""
        return self._try("states", self._read_state, dynamics)

    def _read_state(self, dynamics):
        if "state" not in self._newest:
            return None
        raw, received = self._newest.pop("state")
        count = self._count - self._read_count
        self._read_count = self._count
        message = deserialize_message(raw, DiagonalizedState)
        model = dynamics.model
        names = tuple(message.dof_names)
        positions = tuple(message.position_names)
        if names != model.dof_names or (positions or names) != model.coordinate_names:
            raise InputError(f"joint names differ from those of robot '{model.name}'")
        vectors = []
        for name in VECTORS:
            values = getattr(message, name)
            expected = model.nq if name == "position" else model.nv
            if len(values) not in (0, expected):
                raise InputError(f"{name} has {len(values)} entries; expected {expected}")
            vectors.append(row_of(values))
        t = stamp_of(message)
        torque, limits = self._read_torque(t, model)
        contact = self._read_contact_limits(t, model)
        states = States(
            np.array([t]),
            *vectors,
            np.array([message.kinetic_energy]),
            velocity_estimated=message.velocity_estimated,
            receive_time=message.stamp_is_receive_time,
            **torque,
            **contact,
        )
        return Received(states, received, count, limits, self._points)

    def _newest_message(self, topic):
        """Return the newest message of a topic; an empty one before the first."""
        kind = KINDS[topic]
        return deserialize_message(self._newest[topic], kind) if topic in self._newest else kind()

    def _read_torque(self, t, model):
        """Return fields of the external torque at a time, and thresholds of alarms."""
        message = self._newest_message("external_torque")
        if len(message.dof_names) != model.nv:
            return {}, ()
        limits = tuple(message.collision_threshold)
        if not message.valid or abs(stamp_of(message) - t) > MAX_DIFFERENCE:
            return {}, limits
        fields = {name: getattr(message, name) for name in ("norm", "collision", "contact")}
        for name in ("residual", "external_torque"):
            fields[name] = row_of(getattr(message, name))
        return fields, limits

    def _read_contact_limits(self, t, model):
        """Store name and link of each point of contact; return the fields of contact at a time."""
        message = self._newest_message("contact_limits")
        if not message.valid or not set(message.link_names) <= set(model.link_names):
            return {}
        self._points = tuple(zip(message.point_names, message.link_names, strict=True))
        if abs(stamp_of(message) - t) > MAX_DIFFERENCE:
            return {}
        fields = {field: row_of(getattr(message, name)) for field, name in CONTACT_VECTORS.items()}
        fields["contact_limits_worst"] = message.worst
        if message.worst >= 0:
            position = message.positions[3 * message.worst :][:3]
            fields["contact_limits_position"] = row_of(position)
        return fields


def row_of(values):
    """Return numbers of a message as one row; NaN if they are missing."""
    return np.asarray(values)[None] if len(values) else np.nan


def stamp_of(message):
    """Return the stamp of a message [s]."""
    stamp = message.header.stamp
    return stamp.sec + 1e-9 * stamp.nanosec


class ViewNode(TableNode, Node):
    """Serve the page of all robots whose monitors are on the graph.

    It subscribes to their states and passes the newest on to browsers. `on_push` is that of the
    server.
    """

    _robots: ClassVar = {}  # also of a node whose parameters are refused
    _server = None

    def __init__(self, on_push=None, **options):
        super().__init__(NODES["view"], PARAMETERS, **options)
        values = self.values
        self._robots = {}
        self._found_at = self.time.steady()  # last time of a monitor [s]
        self._missing = ""
        self._absence = RobotStream("no monitor", lambda dynamics: None)
        address = values["host"], values["port"]
        self._server = PageServer(self._streams, *address, values["rate"], on_push=on_push)
        self._server.start()
        self.log_info(f"Page: {self.address}")
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
        robots = self._robots
        self._robots = {}
        for robot in robots.values():
            attempt(robot.destroy)
        if self._server:
            attempt(self._server.stop)
        return super().destroy_node()

    # --- Robots ---

    def _streams(self):
        streams = [robot.stream for _, robot in sorted(self._robots.copy().items())]
        return streams or [self._absence] * bool(self._missing)

    def _explain_absence(self):
        """Return which topics a page without a monitor waits for; empty for SEARCH_TIMEOUT."""
        now = self.time.steady()
        if self._robots:
            self._found_at = now
        if now - self._found_at < SEARCH_TIMEOUT:
            return ""
        robots = ", ".join(filter(None, self.values["robots"])) or "all"
        return (
            "waiting for a monitor: "
            f"expected a topic <name>/{NODES['monitor']}{STATE} of type {KIND} (robots: {robots})"
        )

    def _looked(self):
        """Return where there are states."""
        return f"this type is on {listed(topics_of(self, KIND)) or 'no topic'}"

    def _find_monitors(self):
        """Find monitors. A robot stays for :data:`REMOVAL_TIMEOUT` after its monitor has gone."""
        topics = [topic for topic in topics_of(self, KIND) if topic.endswith(STATE)]
        monitors = [topic.removesuffix(STATE) for topic in topics]
        for monitor in monitors:
            if monitor not in self._robots and self._is_selected(monitor):
                self._robots[monitor] = RobotSubscription(self, monitor)
        self._missing = self._explain_absence()
        self._absence.waiting = f"{self._missing}; {self._looked()}"
        for robot in self._robots.values():
            _, fault = attempt(robot.update)
            if fault:
                text = shortened(f"{robot.monitor}: {fault.reason}")
                self.get_logger().error(text, throttle_duration_sec=5.0)
        for monitor in [monitor for monitor, robot in self._robots.items() if robot.has_gone]:
            self._robots.pop(monitor).destroy()

    def _is_selected(self, monitor):
        selected = {f"/{name.strip('/')}" for name in self.values["robots"] if name}
        return not selected or bool(selected & {monitor, monitor.rpartition("/")[0] or "/"})

    def _receive_diagnostics(self, message):
        for robot in self._robots.values():
            prefix = robot.namespace.strip("/")
            nodes = {f"{prefix}/{name}".lstrip("/") for name in ROBOT_NODES}
            nodes.add(robot.monitor.lstrip("/"))
            statuses = [
                status for status in message.status if status.name.partition(": ")[0] in nodes
            ]
            if statuses:
                robot.set_diagnostics(statuses)

    def _report(self):
        robots = self._robots.values()
        faults = [text for robot in robots for text in (robot.fault, robot.difference) if text]
        shown = {
            "address": self.address,
            "tabs": self._server.streams,
            "monitors": counted(sorted(self._robots)),
        }
        if text := self._missing:  # no robots
            log = f"{text}; {self._looked()}"
            return [Status("page", WARN, text, shown, log, age=SEARCH_TIMEOUT)]
        return [problem_status("page", faults, f"served at {self.address}", shown)]
