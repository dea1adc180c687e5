# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots of a parameter or a topic, loaded in a thread beside the executor."""

import codecs
import gc
import threading
from functools import cache

import numpy as np
from std_msgs.msg import String

from diag_dynamics.description.check_table import handle_warnings
from diag_dynamics.description.description import Description, Inertial, Joint, Link
from diag_dynamics.description.mjcf import is_mjcf
from diag_dynamics.description.urdf_text import read_text
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import UnsupportedError
from diag_dynamics.model import Parameters, load_urdf
from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.nodes.support.description_process import described
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.publishing import connected, latched
from diag_dynamics.nodes.support.runner import Stop
from diag_dynamics.parameters.robot_models import model_of

COMPILED = (
    "evaluate",
    "factors",
    "forward_dynamics",
    "inverse_dynamics",
    "mass_matrix",
    "coriolis_torque",
    "gravity_torque",
    "contact_limits",
    "nu_from_qd",
    "qd_from_nu",
    "placement",
    "wrench_factor",
    "momentum",
    "epsilon_from_tau",
)
"""Methods of DiagonalDynamics that nodes call."""

SMALL = Description(
    "any",
    "a",
    {"a": Link("a"), "b": Link("b", Inertial(1.0, np.eye(4), np.eye(3)))},
    {"j": Joint("j", "continuous", "a", "b", np.eye(4), np.array([1.0, 0.0, 0.0]))},
)
"""Robot to compile for.

The matrices of a large robot take time, and compiled code is the same for all.
"""


@cache
def compile_dynamics():
    """Compile what nodes call, or load it from the cache."""
    DiagonalDynamics(load_urdf(SMALL)).compile(*COMPILED)


def text_of(description):
    """Return the URDF text of a description; see :func:`load_robot`."""
    _refuse_mjcf(description)
    return read_text(description)


def _refuse_mjcf(description):
    """Refuse an MJCF: its gravity and its base would differ from the node's parameters."""
    if is_mjcf(description):
        raise UnsupportedError(
            f"robot_description is '{description}', an MJCF; expected a URDF or xacro file. "
            "Nodes do not read MJCFs."
        )


def load_robot(node, description, values):
    """Return the model of a description by parameters of a node, and log its warnings.

    Errors are those of :func:`model_of`. A description is a URDF, or the path of a URDF or xacro
    file with arguments of xacro behind it.
    """
    _refuse_mjcf(description)
    node.log_info("Loading the robot.")
    warnings = []
    if path := values["parameters_file"]:
        parameters = Parameters.load(path)
        values = values | {"parameters_file": parameters}
        count = parameters.joint_count
        text = f"Parameters of {count} joint{'s' * (count != 1)} from '{path}'."
        node.log_info(text)
    with handle_warnings(warnings.append):
        model = model_of(described(description), values)
    for warning in warnings:
        node.log_warning(str(warning))
    return model


# --- Robots of a parameter or a topic

PERIOD = 0.02
"""How often the executor looks whether the thread has finished [s]."""

THREAD = "description"
"""Name of the thread."""


class RobotLoader:
    """Loads descriptions in a thread, one after the other; only the newest counts.

    The thread calls `make` with the arguments of :meth:`load`; it must not change the node. The
    executor calls `take` with the result, or the exception, and the same arguments. `loading` is
    the description that is loaded, or None.
    """

    def __init__(self, node, make, take):
        self._node = node
        self._make = make
        self._take = take
        self.loading = self._requested = self._thread = self._timer = self._made = None

    def load(self, description, *context):
        """Load this description instead of any other."""
        self.loading = description
        self._requested = (description, *context)  # compared by identity
        if self._timer is None:
            self._timer = self._node.create_timer(PERIOD, self._look, clock=steady_clock())
        self._begin()

    def drop(self):
        """Discard what is being loaded; its thread ends by itself."""
        self.loading = self._requested = None
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def finish(self):
        """Wait until the newest description is loaded and in use, or a signal ends the process."""
        while self.loading is not None and not Stop.requested:
            self._thread.join(PERIOD)
            self._look()

    def _begin(self):
        if self._thread is None:  # a daemon, so that the process may end meanwhile
            self._thread = threading.Thread(
                target=self._run, args=(self._requested,), name=THREAD, daemon=True
            )
            self._thread.start()

    def _run(self, request):
        result, fault = attempt(self._make, *request)
        self._made = request, fault.error if fault else result

    def _look(self):
        """Take over what the thread has made, or load what was requested meanwhile."""
        if self._timer is None or self._thread.is_alive():
            return
        self._thread = None
        request, result = self._made
        if request is not self._requested:
            self._begin()
            return
        self.drop()
        self._take(result, *request)
        if gc.get_freeze_count():  # the process runs nodes and nothing else
            gc.freeze()


def subscribe_description(node, take):
    """Subscribe to robot_description; `take` is called with each description as bytes.

    A path comes by a parameter only: bytes are never looked up as a file. rclpy has decoded the
    text whatever encoding the XML declares, so a byte-order mark states UTF-8.
    """

    def take_message(message):
        description = codecs.BOM_UTF8 + message.data.lstrip("\ufeff").encode(errors="replace")
        node.log_debug(f"robot_description received: {len(description)} bytes")
        take(description)

    subscription = connected(
        node.create_subscription, String, "robot_description", take_message, latched()
    )
    node.log_info(f"Waiting for a robot on {subscription.topic_name}.")
    return subscription
