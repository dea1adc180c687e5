# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Managed node whose transitions may fail by an exception.

No request for a transition ends the node.
"""

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

from diag_dynamics.nodes.support.declaring import TableNode
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.text import shortened

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE

UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = "unconfigured", "inactive", "active", "finalized"


class ManagedNode(TableNode, LifecycleNode):
    """Managed node with transitions that may fail.

    Subclasses have `configure` and `activate`, which may raise, and `deactivate` and `clean_up`,
    which undo them.

    Attributes
    ----------
    phase : str
        Unconfigured, inactive, active or finalized.
    failure : str
        Why the last transition failed; empty if it succeeded.
    """

    def __init__(self, name, specs, **options):
        self.phase = UNCONFIGURED
        self.failure = ""
        super().__init__(name, specs, **options)
        for service in self.services:
            if (
                service.srv_type is ChangeState
            ):  # rclpy before 9 raises at a transition that the state has not
                service.callback = self._guarded(service.callback)

    @property
    def is_unconfigured(self):
        """Whether parameters may change that make the robot."""
        return self.phase == UNCONFIGURED

    def _guarded(self, answer):
        def callback(request, response):
            answered, fault = attempt(answer, request, response)
            if fault is None:
                return answered
            self.log_error(f"Transition rejected in state {self.phase}: {fault.reason}")
            response.success = False
            return response

        return callback

    def _transition(self, step, undo, phase, problem):
        _, fault = attempt(step)
        if fault is None:
            self.phase = phase
            self.failure = ""
            return SUCCESS
        self.failure = shortened(f"{problem}: {fault.text}")
        self.log_error(self.failure)
        undo()
        return FAILURE

    def on_configure(self, state):
        """Configure the node; it stays unconfigured if that raises."""
        return self._transition(self.configure, self.clean_up, INACTIVE, "configuration failed")

    def on_activate(self, state):
        """Activate the node; it stays inactive if that raises."""
        return self._transition(self.activate, self.deactivate, ACTIVE, "activation failed")

    def on_deactivate(self, state):
        """Deactivate the node."""
        self.deactivate()
        self.phase = INACTIVE
        return SUCCESS

    def on_cleanup(self, state):
        """Return to unconfigured, also after an error."""
        return self._leave(UNCONFIGURED)

    on_error = on_cleanup

    def on_shutdown(self, state):
        """Release everything and finish."""
        return self._leave(FINALIZED)

    def _leave(self, phase):
        self.deactivate()
        self.clean_up()
        self.phase = phase
        self.failure = ""
        return SUCCESS
