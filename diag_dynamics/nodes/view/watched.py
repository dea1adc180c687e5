# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One monitor as the view watches it: its messages as bytes, and the model that it has, as its parameters make it."""

import json
import time
from pathlib import Path

import numpy as np
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.options import warnings_told
from diag_dynamics.model.robot_source import read_source
from diag_dynamics.msg import DiagonalizedState, ExternalTorque
from diag_dynamics.nodes.support.descriptions import Descriptions
from diag_dynamics.nodes.support.diagnostics import shortened
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.names import NODES
from diag_dynamics.nodes.view.reading import QUEUE, SECOND, Reader, drained
from diag_dynamics.nodes.view.touching import JUDGED, ContactReader
from diag_dynamics.page.frames import Seen, States, Told
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.show import Show, Taken
from diag_dynamics.parameters.robots import model_of
from diag_dynamics.parameters.shared import PARAMETERS as SHARED

ASKED = ("use_sim_time", "robot_description", "friction_velocity", *SHARED)
"""Parameters of a monitor that make its model, and whose time its stamps are of."""

APART = 0.1
"""How far an external torque may be from a state to be of it [s]."""

GONE = 600.0
"""How long nobody may publish the states of a robot before it is no longer listed [s]."""

ANSWER = 5.0
"""How long a monitor may take to answer before it is asked again [s]."""


class WatchedRobot:
    """The robot of one monitor.

    States and external torques stay where DDS puts them until a page wants a frame: the thread that serves it takes them
    then, all that there are, and reads the newest. Nothing is called as they come, and none is ever waited for.

    Parameters
    ----------
    node : ManagedNode
        Its executor serves what comes seldom: the description, and the monitor's answers.
    aside : rclpy.node.Node
        One that nobody spins.
    monitor : str
        Full name of the monitor.
    folders : list of Path
        Where meshes may be.

    Attributes
    ----------
    monitor : str
    namespace : str
    show : Show
    """

    def __init__(self, node, aside, monitor, folders):
        self.monitor, self.namespace = monitor, monitor.rpartition("/")[0] or "/"
        self._node, self._aside, self._folders = node, aside, folders
        usual = monitor.rpartition("/")[2] == NODES["monitor"]
        self.show = Show(
            self.namespace if usual else monitor, self._take, lambda dynamics: self._contact.take(dynamics)
        )
        self._states, self._torques = Reader(DiagonalizedState), Reader(ExternalTorque)
        newest = QoSProfile(depth=QUEUE, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._inputs = [
            aside.create_subscription(kind, f"{monitor}/{topic}", lambda _: None, newest, raw=True)
            for kind, topic in ((DiagonalizedState, "state"), (ExternalTorque, "external_torque"))
        ]
        self._contact = ContactReader(node, aside, monitor)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        topic = f"{self.namespace.rstrip('/')}/robot_description"
        self._topic = node.create_subscription(String, topic, self._take_description, latched)
        self._parameters = node.create_client(GetParameters, f"{monitor}/get_parameters")
        self._loads = Descriptions(node, self._made, self._take_made)
        self._described, self._values, self._asked = None, None, None  # of the topic, of the monitor, when it was asked
        self._wanted = self._in_force = None  # description and values
        self._revision = None  # of the last state, and whether it is another one than the model's
        self._publishers, self._anew = set(), True
        self._gone = None  # since when nobody has published states
        self._torque = None
        self._foreign_time = False
        self._diagnostics = {}
        self._refused = self._unread = ""
        self.show.wait_for(f"waiting for the parameters of {monitor}")

    @property
    def fault(self):
        """Why nothing is shown, or what is wrong with what comes; empty if nothing is."""
        return self._refused or self._unread

    @property
    def has_gone(self):
        """Whether its monitor has not been there for :data:`GONE`."""
        return self._gone is not None and time.monotonic() - self._gone > GONE

    def look(self):
        """Once a second: ask the monitor for its parameters where they are not known, or may be others by now."""
        info = self._node.get_publishers_info_by_topic(self._inputs[0].topic_name)
        publishers, now = {bytes(end.endpoint_gid) for end in info}, time.monotonic()
        if not publishers:
            self._gone = self._gone or now
            return
        self._gone = None
        if publishers != self._publishers:
            self._publishers, self._anew = publishers, True  # it has come, or come again
        if self._asked is not None and now - self._asked < ANSWER:
            return
        if (self._anew or self._asked is not None) and self._parameters.service_is_ready():
            self._asked, self._anew = now, False
            asked = self._parameters.call_async(GetParameters.Request(names=list(ASKED)))
            asked.add_done_callback(lambda future: attempt(self._take_parameters, future))

    def tell(self, statuses):
        """Take entries of diagnostics of this robot's nodes."""
        for status in statuses:
            if status.name == f"{self.monitor.lstrip('/')}: {JUDGED}":
                self._contact.listen()
            self._diagnostics[status.name] = {
                "level": status.level[0],
                "name": status.name,
                "message": status.message,
                "values": {value.key: value.value for value in status.values},
            }
        self.show.tell(sorted(self._diagnostics.values(), key=lambda one: (-one["level"], one["name"])))

    def destroy(self):
        """Watch no more."""
        self._loads.drop()
        self._node.destroy_client(self._parameters)
        self._node.destroy_subscription(self._topic)
        self._contact.destroy()
        for subscription in self._inputs:
            self._aside.destroy_subscription(subscription)

    # --- The model ---

    def _take_description(self, message):
        self._described = message.data
        self._load()

    def _take_parameters(self, future):
        self._asked = None
        values = [parameter_value_to_python(value) for value in future.result().values]
        defaults = {name: spec.default for name, spec in SHARED.items()} | {"robot_description": ""}
        told = {name: value for name, value in zip(ASKED, values, strict=False) if value is not None}
        self._foreign_time = bool(told.pop("use_sim_time", False)) != self._node.get_clock().ros_time_is_active
        self._values = defaults | told
        self._load()

    def _load(self):
        """Load the robot as the monitor has it, unless it is loaded already."""
        values = self._values
        if values is None:
            return
        description = values["robot_description"] or self._described
        if not description:
            self.show.wait_for(f"waiting for {self._topic.topic_name}")
            return
        wanted = description, json.dumps(values, sort_keys=True, default=str)
        if wanted != self._wanted:
            self._wanted = wanted
            self._loads.load(description, values)

    def _made(self, description, values):
        """Model, scene and meshes of a description, put to be shown; in a thread."""
        source = description if values["robot_description"] else description.encode(errors="replace")
        with warnings_told(lambda text: None):  # the monitor logs them
            text = read_source(source).text
            try:
                model = model_of(text, values)
            except InputError:
                if not values["parameters_file"]:
                    raise
                model = model_of(text, values | {"parameters_file": ""})  # a file of another machine
        folders = [*self._folders, *mesh_folders(source if isinstance(source, str) else None)]
        meshes = MeshLibrary(folders)
        self.show.use(DiagonalDynamics(model), scene_of(model, text, meshes), meshes)
        return model.name, meshes.missing

    def _take_made(self, made, *_):
        if isinstance(made, Exception):
            self._refused = shortened(f"the robot of {self.monitor} cannot be shown: {made}")
            self.show.wait_for(self._refused)
            self._node.get_logger().error(self._refused)
            return
        name, missing = made
        self._refused = ""
        self._node.get_logger().info(f"Showing robot '{name}' of {self.monitor}.")
        for why in list(missing.values())[:3]:
            self._node.get_logger().warning(f"robot '{name}' is shown without some meshes: {shortened(why)}")

    # --- States: by whichever thread wants a frame, one at a time ---

    def _take(self, dynamics):
        taken, fault = attempt(self._newest, dynamics)
        if fault:
            self._unread = f"states of {self.monitor} cannot be read: {fault.reason}"
            self._node.get_logger().error(self._unread, throttle_duration_sec=5.0)
        elif taken:
            self._unread = ""
        return taken

    def _newest(self, dynamics):
        raw, info, count = drained(self._inputs[0])
        torque, _, _ = drained(self._inputs[1])
        if torque is not None:
            self._torque = torque
        if raw is None:
            return None
        state, model = self._states.read(raw), dynamics.model
        revision = state.number("model_revision")
        if revision != self._revision:
            self._revision, self._anew = revision, True
        if state.names != model.dof_names or state.positions != model.coordinate_names:
            self._anew = True
            raise InputError(f"they are of another robot than '{model.name}', which is shown")
        nv, stamp = len(state.names), state.stamp
        rows = {name: state.rows(name) for name in ("effort", "epsilon")}
        vectors = [state.rows(name) for name in ("nu", "coriolis", "gravity", "articulated_inertia")]
        nu, coriolis, gravity, D = (np.zeros((1, nv)) if row is None else row for row in vectors)
        q, qd = (
            np.zeros((1, size)) if (row := state.rows(name)) is None else row
            for name, size in (("position", model.nq), ("velocity", nv))
        )
        t, K = np.array([stamp / SECOND]), np.array([state.number("kinetic_energy")])
        states = States(t, q, qd, rows["effort"], nu, rows["epsilon"], coriolis, gravity, D, K)
        seen, limits = self._seen(stamp, nv)
        now = time.time_ns()
        received = info.get("received_timestamp") or now
        late = np.nan if self._foreign_time else self._node.get_clock().now().nanoseconds - stamp - (now - received)
        told = Told(state.number("velocity_estimated"), state.number("stamp_is_receive_time"), late / SECOND)
        since = max(now - received, 0) / SECOND
        return Taken(states, seen, told, time.monotonic() - since, count if count < QUEUE else None, limits)

    def _seen(self, stamp, nv):
        """What the observer says at a stamp, and its thresholds."""
        if self._torque is None:
            return None, ()
        torque = self._torques.read(self._torque)
        if len(torque.names) != nv:
            return None, ()
        joints = torque.rows("torque_threshold")
        joints = np.full(nv, np.inf) if joints is None else joints[0]
        limits = (*joints.tolist(), torque.number("torque_norm_threshold"), torque.number("threshold"))
        valid = torque.number("valid") and abs(torque.stamp - stamp) <= APART * SECOND
        if not valid:
            return None, limits
        arrays = [torque.rows(name) for name in ("residual", "external_torque")]
        if any(row is None for row in arrays):
            return None, limits
        return Seen([True], *arrays, np.array([torque.number("norm")]), [torque.number("collision")]), limits


def folders_of(entries):
    """Folders of the parameter mesh_folders.

    Raises
    ------
    InputError
        One is none.
    """
    folders = [Path(entry).expanduser() for entry in entries if entry]
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"parameter 'mesh_folders' has '{folder}', which is no folder.")
    return folders
