# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A managed node that can bring itself up, and that no transition, however wrong, brings down."""

from functools import cached_property

from lifecycle_msgs import srv
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.qos import QoSProfile

from diag_dynamics.compiled.progress import tell_by
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.clocks import NodeTime
from diag_dynamics.nodes.support.diagnostics import shortened
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.logger import PlainLogger
from diag_dynamics.nodes.support.overrides import tell_unknown
from diag_dynamics.nodes.support.start import stop

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE

UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = "unconfigured", "inactive", "active", "finalized"

PATIENT = QoSProfile(depth=1000)
"""Requests that wait, of every service: rclpy's default keeps ten, and lets the others go without an answer."""


class ManagedNode(LifecycleNode):
    """A lifecycle node in four steps, of which the first two may raise: the node stays as it was before, then.

    Subclasses have :meth:`set_up` (to be configured), :meth:`listen` (to be active), :meth:`stop_listening` and
    :meth:`tear_down`, both of which may find things half made.

    Attributes
    ----------
    phase : str
        Unconfigured, inactive, active or finalized.
    failure : str
        Why the node could not be configured or activated, empty if it could.
    time : NodeTime
        Every time that the node reads; tests pass a class whose time they set.
    """

    def __init__(self, name, time=NodeTime, **kwargs):
        self.phase, self.failure = UNCONFIGURED, ""
        self._beginning = False  # whoever runs the process says then what is wrong
        self._diagnostics = None
        super().__init__(name, enable_communication_interface=False, **kwargs)
        self.time = time(self)
        tell_by(self._tell_of_compiling)
        for service, kind in (
            ("change_state", srv.ChangeState),
            ("get_state", srv.GetState),
            ("get_available_states", srv.GetAvailableStates),
            ("get_available_transitions", srv.GetAvailableTransitions),
            ("get_transition_graph", srv.GetAvailableTransitions),
        ):  # as rclpy would offer them, with a queue of ten requests
            answer = getattr(self, f"_LifecycleNodeMixin__on_{service}")
            answer = self._harmless(answer) if kind is srv.ChangeState else answer
            self.create_service(kind, f"~/{service}", answer, qos_profile=PATIENT)

    @cached_property
    def _plain_logger(self):
        return PlainLogger(super().get_logger().name)

    def get_logger(self):
        """The node's logger: names of joints and the like, which anybody may have written, cannot forge its lines."""
        return self._plain_logger

    def _harmless(self, answer):
        """Answer to a wrong transition, at which rclpy before 9 would end the node."""

        def callback(request, response):
            answered, fault = attempt(answer, request, response)
            if fault is None:
                return answered
            said = f"Transition refused in state {self.phase}: {fault.error}"
            self.get_logger().error(said, throttle_duration_sec=0.5)
            response.success = False
            return response

        return callback

    def _tell_of_compiling(self, text):
        """Say a line on what is compiled, in a thread: whoever compiles has no time for it."""
        attempt(self.get_logger().info, text)
        if self._diagnostics:
            attempt(self._diagnostics.tell_compiling, text)

    def destroy_node(self):
        """See rclpy; what is compiled from now on is told of on stderr."""
        tell_by(None)
        return super().destroy_node()

    def settled(self):
        """Called when all that stays has been loaded; whoever runs the process puts something in its place."""

    def begin(self, autostart):
        """Begin to live, all parameters being declared: start, or say what is waited for."""
        tell_unknown(self)
        if autostart:
            self._beginning = True
            self.start()
            self._beginning = False
        else:
            configure = f"diag-dynamics (or ros2) lifecycle set {self.get_fully_qualified_name()} configure"
            self.get_logger().info(f"Waiting to be configured (autostart is false): {configure}")

    def start(self):
        """Configure and activate.

        Raises
        ------
        InputError
            That was not possible.
        """
        if self.trigger_configure() != SUCCESS or self.trigger_activate() != SUCCESS:
            self.destroy_node()
            raise InputError(self.failure)

    def _tried(self, step, undo, what):
        """Whether a step could be taken; rclpy would swallow why not."""
        _, fault = attempt(step)
        if fault is None:
            self.failure = ""
            return True
        self.failure = shortened(f"{what}: {fault.text}")
        if not self._beginning:
            self.get_logger().error(self.failure)
        undo()
        return False

    def on_configure(self, state):
        """Set up."""
        with stop.may_be_left(self.destroy_node):  # loading and compiling a robot, which nobody hears of yet
            configured = self._tried(self.set_up, self.tear_down, "not configured")
        if not configured:
            return FAILURE
        self.phase = INACTIVE
        return super().on_configure(state)

    def on_activate(self, state):
        """Listen."""
        if not self._tried(self.listen, self.stop_listening, "not activated"):
            return FAILURE
        self.phase = ACTIVE
        return super().on_activate(state)

    def on_deactivate(self, state):
        """Stop listening."""
        self.stop_listening()
        self.phase = INACTIVE
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        """Let all go that was set up."""
        self._let_go()
        self.phase = UNCONFIGURED
        return super().on_cleanup(state)

    def on_shutdown(self, state):
        """Let all go, for good."""
        self._let_go()
        self.phase = FINALIZED
        return super().on_shutdown(state)

    def on_error(self, state):
        """Let all go; the node can be configured anew."""
        self._let_go()
        self.phase = UNCONFIGURED
        return SUCCESS

    def _let_go(self):
        self.stop_listening()
        self.tear_down()
        self.failure = ""
