# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A stand-in of controller_manager 4.46 with its types and its rules of BEST_EFFORT."""

from controller_manager_msgs.msg import (
    ControllerManagerActivity,
    ControllerState,
    NamedLifecycleState,
)
from controller_manager_msgs.srv import ListControllers, SwitchController

from nodes import LATCHED


class ControllerManager:
    """Controllers by name with their state; `requests` are those of switch_controller."""

    def __init__(self, peer, namespace, **states):
        self.peer = peer
        self.states = states
        self.requests = []
        self.node = peer.extra_node("controller_manager", namespace)
        self._activity = self.node.create_publisher(
            ControllerManagerActivity, "~/activity", LATCHED
        )
        self.node.create_service(ListControllers, "~/list_controllers", self._list)
        self.node.create_service(SwitchController, "~/switch_controller", self._switch)
        self.publish()

    def leave(self):
        """Leave the graph."""
        self.peer.drop_node(self.node)

    def publish(self):
        """Publish the activity."""
        message = ControllerManagerActivity()
        for name, state in self.states.items():
            message.controllers.append(NamedLifecycleState(name=name))
            message.controllers[-1].state.label = state
        self._activity.publish(message)

    def _list(self, _, response):
        response.controller = [
            ControllerState(name=name, state=state) for name, state in self.states.items()
        ]
        return response

    def _switch(self, request, response):
        """Reject a list without a loaded controller; ignore those that cannot be switched."""
        assert request.strictness == request.BEST_EFFORT and request.activate_asap
        self.requests.append(request)
        off = list(request.deactivate_controllers)
        on = list(request.activate_controllers)
        for names, verb in ((off, "deactivate"), (on, "activate")):
            if names and not any(name in self.states for name in names):
                response.message = (
                    f"Could not {verb} controller with name '{names[0]}' because no controller "
                    "with this name exists\n"
                )
                return response
        self.switch(off, on)
        response.ok = True
        return response

    def switch(self, off, on):
        """Deactivate active controllers and activate inactive ones, in one cycle."""
        for names, before, after in ((off, "active", "inactive"), (on, "inactive", "active")):
            for name in names:
                if self.states.get(name) == before:
                    self.states[name] = after
        self.publish()
