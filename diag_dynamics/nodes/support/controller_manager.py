# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of ros2_control's controllers, where controller_manager_msgs is installed."""

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.publishing import connected, latched

try:
    from controller_manager_msgs.srv import ListControllers, SwitchController
except ImportError:  # PyPI has no controller_manager_msgs
    ListControllers = SwitchController = None
try:
    from controller_manager_msgs.msg import ControllerManagerActivity
except ImportError:  # nor has ROS 2 Humble this type
    ControllerManagerActivity = None

ACTIVE, UNCONFIGURED, NOT_LOADED = "active", "unconfigured", "not loaded"
"""States of a controller, the last one for a name that its manager does not list."""


class ControllerActivity:
    """State of the controller that receives a topic, by the activity of its controller manager.

    `state` is None until a message arrives. `take` is called with the state before and the new one.
    """

    is_installed = ControllerManagerActivity is not None  #: whether there is a type to receive

    def __init__(self, node, topic, take):
        controller = topic.rpartition("/")[0]
        namespace, _, self.name = controller.rpartition("/")
        self.state = None
        self._node = node
        self._take = take
        self.topic = f"{namespace}/controller_manager/activity"
        self._subscription = None
        if self.is_installed:
            self._subscription = connected(
                node.create_subscription,
                ControllerManagerActivity,
                self.topic,
                self._take_activity,
                latched(),
            )

    def check(self):
        """Return the state; forget it if its manager has left the graph."""
        if self._subscription and not self._subscription.get_publisher_count():
            self.state = None
        return self.state

    def destroy(self):
        """Remove the subscription."""
        if self._subscription:
            self._node.destroy_subscription(self._subscription)

    def _take_activity(self, message):
        states = {controller.name: controller.state.label for controller in message.controllers}
        before = self.state
        self.state = states.get(self.name, NOT_LOADED)
        self._take(before, self.state)


class ControllerSwitch:
    """Controllers that a request deactivates and activates, compared with list_controllers.

    `service` is the name of switch_controller.
    """

    def __init__(self, node, service, deactivate, activate):
        self._deactivate = deactivate
        self._activate = activate
        self._states = self._listing = self._take = None
        manager = node.resolve_service_name(service).rpartition("/")[0]
        self._name = f"{manager}/list_controllers"
        self._client = node.create_client(ListControllers, self._name)

    @staticmethod
    def service_type():
        """Return the type of the service."""
        if SwitchController is None:
            raise InputError(
                "parameters 'reaction.deactivate' or 'reaction.activate' have controllers; "
                "expected an installed package controller_manager_msgs. Install it."
            )
        return SwitchController

    def requests(self):
        """Return the request, and one with the deactivations alone or None.

        controller_manager rejects a request as a whole if none of its deactivations, or none of its
        activations, is loaded.
        """
        options = {"strictness": SwitchController.Request.BEST_EFFORT, "activate_asap": True}
        whole, part = (
            SwitchController.Request(
                deactivate_controllers=self._deactivate, activate_controllers=names, **options
            )
            for names in (self._activate, [])
        )
        return whole, part if self._activate and self._deactivate else None

    def update(self, take=None):
        """Request the states; `take` is called with what then differs from the request."""
        self._take = take or self._take
        if self._listing:
            self._client.remove_pending_request(self._listing)
        self._listing = None
        if self._client.service_is_ready():
            self._listing = self._client.call_async(ListControllers.Request())
            self._listing.add_done_callback(self._take_states)

    def _take_states(self, future):
        if future is not self._listing:
            return
        self._listing = None
        take = self._take
        self._take = None
        self._states = {
            controller.name: controller.state for controller in future.result().controller
        }
        if take:
            take(self._differences())

    def _differences(self):
        """Return the controllers that are not in the state of the request."""
        differences = [
            f"controller '{name}' is {ACTIVE}; expected inactive"
            for name in self._deactivate
            if self._states.get(name) == ACTIVE
        ]
        states = {name: self._states.get(name, NOT_LOADED) for name in self._activate}
        differences += [
            f"controller '{name}' is {state}; expected {ACTIVE}"
            for name, state in states.items()
            if state != ACTIVE
        ]
        return "; ".join(differences)

    def problem(self):
        """Return why a request would fail by the last states; empty if it would not."""
        if self._states is None:
            return f"no response of '{self._name}' yet"
        problems = [
            f"controller '{name}' is {NOT_LOADED}"
            for name in (*self._deactivate, *self._activate)
            if name not in self._states
        ]
        problems += [
            f"controller '{name}' is {UNCONFIGURED}"
            for name in self._activate
            if self._states.get(name) == UNCONFIGURED
        ]
        return "; ".join(problems)
