# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller node: joint_states and targets in, efforts out, by laws in total joint rates."""

from array import array
from collections import Counter
from functools import partial

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import ParameterDescriptor
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from diag_dynamics.control.by_dof import command_order, require_same_joints
from diag_dynamics.control.loop import ControlLoop
from diag_dynamics.control.modes import LAWS
from diag_dynamics.control.supervisor import ACTIVE as IN_FORCE
from diag_dynamics.control.supervisor import HOLDING, RAMPING_DOWN
from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError, RejectedError
from diag_dynamics.joint_states.assembler import Rejected, StateAssembler
from diag_dynamics.joint_states.robot_joints import Options, joints_of
from diag_dynamics.msg import ControllerStatus
from diag_dynamics.nodes.controller import received
from diag_dynamics.nodes.controller.lifecycle import (
    ACTIVE,
    INACTIVE,
    SUCCESS,
    ManagedNode,
)
from diag_dynamics.nodes.controller.record import (
    Record,
    problems_of_limits,
    status_message,
    values_of_loop,
)
from diag_dynamics.nodes.controller.trajectories import ACTION, Trajectories
from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.nodes.support.controller_manager import ACTIVE as RUNNING
from diag_dynamics.nodes.support.controller_manager import NOT_LOADED, ControllerActivity
from diag_dynamics.nodes.support.declaring import judge
from diag_dynamics.nodes.support.descriptions import RobotLoader, load_robot, subscribe_description
from diag_dynamics.nodes.support.diagnostics import Diagnostics, counted
from diag_dynamics.nodes.support.graph import clock_notes, node_names
from diag_dynamics.nodes.support.guard import Fault, attempt, offer
from diag_dynamics.nodes.support.publishing import RateLimit, connected, newest
from diag_dynamics.nodes.support.statuses import (
    ERROR,
    WARN,
    RepeatLimit,
    Status,
    without_numbers,
)
from diag_dynamics.nodes.support.topics import NODES
from diag_dynamics.parameters.contact_limits import bounded_points
from diag_dynamics.parameters.controller import (
    COMPENSATES,
    PARAMETERS,
    WHY_REQUIRED,
    check_values,
)
from diag_dynamics.parameters.spec import Spec
from diag_dynamics.text import shortened

COMMANDS, SCALE = "effort_controller/commands", "contact_scale"
TRAJECTORY = "joint_trajectory"

REQUESTS, RETRY_PERIOD = 5, 0.2
"""Requests of the parameter `joints` of the effort controller, and time between them [s].

A service that has not discovered its client yet drops the response.
"""

WATCHES = 4
"""Checks of the age of the last state within its largest age."""

PLAUSIBLE = {"beyond_limits": 0.5, "beyond_velocity": 5.0, "jump": 0.1}
"""Plausible distance outside of limits, velocity as a multiple of its limit, and jump [rad, m].

Springs would throw an arm with an encoder a turn off; damping, one with a wrong velocity. A pushed
arm may exceed three times its limit, and has to be braked.
"""


class ControllerNode(ManagedNode):
    """Managed node that answers robot states by commands; see the module.

    Parameters are in :data:`~parameters.controller.PARAMETERS`, and one more that has no default.
    Configured, it loads a robot or waits for its description; active, it answers every state by a
    command.
    """

    _loop = _watch = _trajectories = None  # also of a node whose parameters are refused
    _subscribed = ()

    def __init__(self, **options):
        super().__init__(NODES["controller"], PARAMETERS, **options)
        required = ParameterDescriptor(description=f"Required: {WHY_REQUIRED}.")
        self.values[COMPENSATES] = self.declare_parameter(
            COMPENSATES, Parameter.Type.BOOL, required
        ).value
        check_values(self.values)
        self._states = self._descriptions = None
        self._activity = None  # of the effort controller
        self._description = None
        self._refused = ""
        self._other = None
        self._published = []
        self._subscribed = []
        self._offered = []
        self._record = Record()
        self._order_known = ""
        self._left = {}  # efforts that the robot was left with, by joint
        self._last_time = None  # of anything [ns]
        self._lines = RepeatLimit()
        self._hold_is_logged = False
        specs = PARAMETERS | {COMPENSATES: Spec(False, WHY_REQUIRED, while_unconfigured=True)}
        judge(self, specs, self.values.update)
        self._diagnostics = Diagnostics(
            self, self._report, lambda: self._loop and self._loop.dynamics.model
        )
        self._loader = RobotLoader(self, self._make_robot, self._take_robot)
        self._starting = self.values["autostart"]  # activates itself as soon as there is a robot
        if not self._starting:
            todo = f"ros2 lifecycle set {self.get_fully_qualified_name()} configure"
            self.log_info(
                f"Waiting to be configured: {todo}. Or start the node with -p autostart:=true."
            )
        elif self.trigger_configure() != SUCCESS:
            self.destroy_node()
            raise InputError(self.failure)

    def destroy_node(self):
        """Leave the robot by a last command, and end."""
        self.deactivate()
        if self._trajectories:
            self._trajectories.destroy()
        super().destroy_node()

    # --- Lifecycle

    def configure(self):
        """Load the robot or wait for one; make publishers and services."""
        if self.values[COMPENSATES] is None:
            raise InputError(
                f"parameter '{COMPENSATES}' is not set and has no default. Set {WHY_REQUIRED}."
            )
        self._commands = self._publisher(Float64MultiArray, COMMANDS)
        self._activity = ControllerActivity(self, self._commands.topic_name, self._take_activity)
        self._status = self._publisher(ControllerStatus, "~/status")
        check_values(self.values)  # which may have changed since the start
        self._status_limit = RateLimit(self.values["max_rate.status"])
        self._trajectories = Trajectories(self, self._publisher, self._take_goal, self._cancel)
        for mode in LAWS:
            service = offer(self, Trigger, f"mode/{mode}", partial(self._switch, mode))
            self._offered.append(service)
        if self.values["robot_description"]:
            self._loader.load(self.values["robot_description"], dict(self.values))
        else:
            self._descriptions = subscribe_description(self, self._take_description)

    def _publisher(self, kind, topic):
        self._published.append(connected(self.create_publisher, kind, topic, QoSProfile(depth=10)))
        return self._published[-1]

    def activate(self):
        """Compare orders of joints, and subscribe to states and targets.

        The order must be that of the effort controller.
        """
        self._starting = False  # or a robot that is loaded meanwhile would be activated, too
        self._loader.finish()  # or the model of a robot that is being replaced would move it
        if self._loop is None or self._refused:
            raise InputError(self._refused or "no robot_description received yet.")
        self._compare_joints()
        self._loop.forget()
        self._states.forget()
        self._states.forget_clock()
        self._last_time = None
        self._record.begin()
        self._reported = IN_FORCE, ""  # phase of the supervisor, and its reason
        self._subscribe(JointState, "joint_states", self._take_joint_state, newest(), raw=True)
        loop = self._loop
        names = loop.dynamics.model.dof_names
        for kind, topic, take in (
            (
                PoseStamped,
                "target",
                lambda message: loop.take_pose(*received.pose(message)),
            ),
            (JointTrajectory, "~/joint_trajectory", self._take_trajectory),
            (
                JointState,
                "set_point",
                lambda message: loop.take_set_point(received.set_point(message, names)),
            ),
            (Float64, SCALE, lambda message: loop.take_scale(message.data, self.time.now())),
        ):
            target = topic.removeprefix("~/")
            self._subscribe(
                kind, topic, partial(self._take_target, target, take), QoSProfile(depth=1)
            )
        # Simulated time where the node uses it; else steady time: timers stop while system time is
        # set back.
        clock = self.get_clock() if self.get_clock().ros_time_is_active else steady_clock()
        self._watch = self.create_timer(
            self.values["max_state_age"] / WATCHES, self._look, clock=clock
        )
        self.log_info(f"Active: mode {loop.mode}, commands for {', '.join(self._joints)}.")

    def _subscribe(self, kind, topic, take, qos, **options):
        self._subscribed.append(
            connected(self.create_subscription, kind, topic, take, qos, **options)
        )

    def deactivate(self):
        """Send a last command, the gravity torque of the robot, and unsubscribe."""
        if self._watch:
            self.destroy_timer(self._watch)
            self._watch = None
        if self._subscribed:
            effort = self._loop.leave()
            if effort is not None:
                self._send(effort)
            self._loop.stop_trajectory("the controller was deactivated")
            self._trajectories.update()
        for subscription in self._subscribed:
            self.destroy_subscription(subscription)
        self._subscribed = []
        if self._loop:
            self._loop.supervisor.forget()

    def on_deactivate(self, state):
        """Stop, and load the robot that was described meanwhile."""
        result = super().on_deactivate(state)
        if self._other is not None:
            self._take_description(self._other)
        return result

    def clean_up(self):
        """Release the robot, its publishers and its services."""
        self._loader.drop()
        if self._descriptions:
            self.destroy_subscription(self._descriptions)
        for service in self._offered:
            self.destroy_service(service)
        for publisher in self._published:
            self.destroy_publisher(publisher)
        if self._trajectories:
            self._trajectories.destroy()
        if self._activity:
            self._activity.destroy()
        self._offered = []
        self._published = []
        self._left = self._standing()
        self._loop = self._descriptions = self._description = self._trajectories = None
        self._activity = None
        self._refused = ""
        self._other = None

    # --- The robot

    def _make_robot(self, description, values):
        """Return the control loop, joints, their order and states of a description.

        A thread calls it.
        """
        model = load_robot(self, description, values | {"floating_base": False})
        joints, order = command_order(values["command_joints"], model.dof_names)
        # A single state from the future would make all correct ones late, so none is accepted.
        age = values["max_state_age"]
        options = Options(timeouts={ALL: age}, max_age=age, refuse_foreign=True, **PLAUSIBLE)
        states = StateAssembler(joints_of(model), options, limit="max_state_age")
        points = bounded_points(model, description, values)
        states.forget()  # compiles its rules, or loads them from the cache
        return ControlLoop(model, values, values[COMPENSATES], points), joints, order, states

    def _take_robot(self, result, description, _):
        """Control the robot of a description, or report why it is rejected."""
        self.failure = ""  # that of the robot before
        if isinstance(result, Exception):
            self._refuse(Fault(result).reason)
            if self._starting and self.values["robot_description"]:
                self.finished.set_exception(InputError(self._refused))
            return
        standing = self._standing()
        self._loop, self._joints, self._order, self._states = result
        self._description = description
        model = self._loop.dynamics.model
        limits = self._loop.limits
        limits.reset(np.array([standing.get(name, 0.0) for name in model.dof_names]))
        self.log_info(f"Ready: robot '{model.name}', {model.nv} degrees of freedom.")
        if limits.unlimited:
            joints = ", ".join(limits.unlimited)
            self.log_warning(f"No effort limit for {joints}: commands are not limited.")
        if self._starting:
            self._starting = False
            if self.trigger_activate() != SUCCESS and self.values["robot_description"]:
                self.finished.set_exception(InputError(self.failure))

    def _standing(self):
        """Return the last effort of each joint: another robot or payload continues from there."""
        if self._loop is None:
            return self._left
        return dict(zip(self._loop.dynamics.model.dof_names, self._loop.limits.sent, strict=True))

    def _take_description(self, description):
        """Load another robot, unless the controller is active."""
        self._refused = ""
        self._other = None
        if description == self._description:
            self._loader.drop()
        elif self.phase == ACTIVE:
            self._other = description
            self._refuse("the controller is active. Deactivate it before another robot is loaded.")
        elif description != self._loader.loading:
            self._loader.load(description, dict(self.values))

    def _refuse(self, reason):
        self._refused = shortened(f"robot_description rejected: {reason}")
        self.log_error(self._refused)

    @property
    def _controller(self):
        """Name of the effort controller by its topic."""
        return self.resolve_topic_name(COMMANDS).rpartition("/")[0]

    def _receivers(self):
        """Return the names of the nodes that receive the commands."""
        return node_names(self.get_subscriptions_info_by_topic(self._commands.topic_name))

    def _compare_joints(self):
        """Raise InputError if the effort controller has another order of joints."""
        controller = self._controller
        theirs = joints_of_controller(self, controller)
        if not theirs:
            self._order_known = f"not compared: no parameter 'joints' from {controller}"
            self.log_warning(f"The order of joints is {self._order_known}.")
        else:
            require_same_joints(self._joints, theirs, controller)
            self._order_known = f"that of {controller}"

    # --- Every cycle

    def _cycle(self):
        """Return the time of a cycle [ns].

        If it has gone back, forget all states, because their stamps are ahead.
        """
        now = self.time.now()
        last = self._last_time
        if last is not None and now < last - self.values["max_state_age"] * 1e9:
            self._record.counts["clock went back"] += 1
            self._states.forget()
            self._states.forget_clock()
        self._last_time = now
        return now

    def _take_joint_state(self, raw):
        if self.phase != ACTIVE:
            return
        self._record.counts["joint states"] += 1
        now = self._cycle()
        self._answer(self._attempt(now, self._step, raw, now), now)

    def _attempt(self, now, step, *arguments):
        """Return the result of a step; hold the robot if it fails, which is not left by itself."""
        sent, fault = attempt(step, *arguments)
        if fault is None:
            return sent
        reason = shortened(fault.text)
        self._record.refuse(f"rejected: {fault.cause}", reason)
        return self._loop.without_state(now, reason)

    def _step(self, raw, now):
        self._loop.not_executed = self._not_executed()
        accepted = self._states.accept(raw, now)
        if isinstance(accepted, Rejected):
            raise RejectedError(*accepted)
        return accepted.state and self._loop.step(accepted.state, now)

    def _not_executed(self):
        """Return why the effort controller does not execute the commands; empty if unknown."""
        state = self._activity.state
        name = self._activity.name
        if state in (None, RUNNING):
            return ""
        if state == NOT_LOADED and set(self._receivers()) - {self._controller}:
            return ""  # another node may execute them
        return f"controller '{name}' is {state}"

    def _take_activity(self, before, state):
        """Start anew when the state of the effort controller changes.

        A controller that has been activated has forgotten its command, so it receives one at once.
        """
        if self._loop is None or before in (None, state):
            return
        reason = f"controller '{self._activity.name}' is {state}"
        now = self.time.now()
        if self._loop.supervisor.phase == IN_FORCE:
            self._attempt(now, self._loop.stand_by, now, reason)
        if self._loop.supervisor.phase == HOLDING:
            self._send(self._loop.limits.sent)

    def _look(self):
        """Hold the robot if the last state has become too old."""
        state = self._loop.state
        now = self._cycle()
        if self.phase == ACTIVE and state and (problem := self._loop.age_problem(state, now)):
            late = self._states.stale(now)
            if 0 < len(late) < len(self._states.joint_names):
                problem = f"joint '{late[0]}' is older than {self.values['max_state_age']:g} s"
            self._answer(self._loop.without_state(now, problem), now)
        self._trajectories.update()

    def _answer(self, sent, now):
        """Send a command, and publish status and controller state."""
        if sent is None:
            return
        if not sent.silent:
            self._send(sent.effort)
        self._report_phase()
        if sent.lost:
            self._record.refuse("targets aborted", sent.lost)
            self.get_logger().warning(shortened(sent.lost), throttle_duration_sec=1.0)
        self._record.command(now, sent, self._loop, self.values["max_state_age"])
        self._trajectories.update()
        receivers = self._status.get_subscription_count() + self._trajectories.receivers
        if receivers and self._status_limit.due(now):
            message = status_message(self._loop, sent, self._trajectories)
            self._trajectories.publish_state(message)
            self._status.publish(message)

    def _report_phase(self):
        """Log that a hold or a ramp begins, has another reason, or ends; report its begin, too."""
        supervisor = self._loop.supervisor
        phase = supervisor.phase
        before, reason = self._reported
        self._reported = phase, without_numbers(supervisor.reason)
        if self._reported == (before, reason):
            return
        if phase == HOLDING:
            is_logged = self._log_limited(
                self.log_warning, f"Holding gravity: {supervisor.reason}."
            )
            self._hold_is_logged = is_logged or (before == HOLDING and self._hold_is_logged)
        elif phase == RAMPING_DOWN and before != phase:
            self.log_error(f"Ramping down: {supervisor.reason}.")
        elif before == RAMPING_DOWN:
            self.log_warning(f"Resumed: mode {self._loop.mode}. Choose a mode to go on.")
        elif before == HOLDING and self._hold_is_logged:
            self.log_info(f"Resumed: mode {self._loop.mode}.")
        if phase not in (before, IN_FORCE):
            self._diagnostics.publish([self._control_status(Counter())])

    def _log_limited(self, log, text):
        """Log a text unless an equal one was logged in the last ten seconds; return whether."""
        is_due = self._lines.is_due(text, self.time.steady())
        if is_due:
            log(text)
        return is_due

    def _send(self, effort):
        self._commands.publish(Float64MultiArray(data=array("d", effort[self._order])))

    # --- Targets and modes

    def _take_target(self, topic, take, message):
        """Take a target; return whether it is accepted."""
        if self.phase != ACTIVE:
            return False
        _, fault = attempt(self._check_and_take, topic, take, message)
        if fault is None:
            self._record.counts[f"{topic} accepted"] += 1
            self._trajectories.update()
            return True
        if topic in (TRAJECTORY, ACTION):
            self._trajectories.reject(fault.reason)
        self._record.refuse(f"{topic} rejected", fault.reason)
        self._log_rejected(topic, fault.reason)
        return False

    def _log_rejected(self, topic, reason):
        self._log_limited(self.log_warning, f"Rejected on {topic}: {reason}")

    def _check_and_take(self, topic, take, message):
        if topic != SCALE:
            target = TRAJECTORY if topic == ACTION else topic
            self._loop.require(target)  # before a long message is read
        take(message)

    def _take_trajectory(self, message, goal=None):
        loop = self._loop
        names = loop.dynamics.model.dof_names
        tolerances = loop.tolerances
        if goal:
            tolerances = received.tolerances(goal, names, tolerances)
        if any(len(point.effort) for point in message.points):
            self.get_logger().warning(
                "trajectory.points have efforts. "
                "They are ignored because the law computes efforts.",
                throttle_duration_sec=1.0,
            )
        points = received.trajectory(message, names, loop.desired.position)
        loop.take_trajectory(*points, self.time.now(), tolerances)
        self._trajectories.add(loop.following)

    def _take_goal(self, goal):
        """Follow the trajectory of an action goal; return whether it is accepted."""
        if self.phase != ACTIVE:
            self._log_rejected(ACTION, f"the controller is {self.phase}.")
        return self._take_target(
            ACTION, lambda goal: self._take_trajectory(goal.trajectory, goal), goal
        )

    def _cancel(self):
        self._loop.stop_trajectory("canceled by request", canceled=True)

    def _switch(self, mode, *_):
        if self.phase != ACTIVE:
            raise InputError(f"the controller is {self.phase}. Activate it first.")
        self._loop.switch(mode)
        self._trajectories.update()
        self.log_warning(f"Mode {mode}, by service.")
        return f"mode {mode}"

    # --- Diagnostics

    def _report(self):
        record = self._record
        recent = self._record.take_recent()
        missing = {}
        if self.phase == ACTIVE:
            missing["missing joints"] = counted(self._states.missing)
            missing["publishers of joint_states"] = self.count_publishers(
                self.resolve_topic_name("joint_states")
            )
        time_values, time_problems = clock_notes(self)
        problems, values = self._listeners()
        return [
            self._control_status(recent),
            record.command_status(recent, problems, values),
            record.input_status(recent, missing | time_values, time_problems),
        ]

    def _control_status(self, recent):
        values = {"lifecycle": self.phase}
        if self._loop:
            values |= values_of_loop(self._loop)
            values |= {
                "robot compensates gravity": self.values[COMPENSATES],
                "order of joints": self._order_known,
            }
        reason = self.failure or self._refused
        if self.phase == ACTIVE:
            status = self._record.law_status(recent, self._loop, values)
            if reason:
                status = status._replace(level=ERROR, message=f"{status.message}; {reason}")
            by_phase = self._loop.supervisor.phase != HOLDING or self._hold_is_logged
            is_logged = bool(self._loop.state and by_phase and not self._loop.shortfall)
            return status._replace(is_logged=is_logged)
        if reason:
            return Status("control", ERROR, reason, values, is_logged=True)
        waiting = self.phase == INACTIVE and not self._loop
        message = "no robot yet" if waiting else f"{self.phase}; no commands"
        if self._loader.loading is not None:
            message = f"{self.phase}; loading a robot_description"
        is_logged = self._loop is None  # what the node waits for
        return Status("control", WARN, message, values, is_logged=is_logged)

    def _listeners(self):
        """Return problems of receivers and limits, and diagnostic values of receivers."""
        if self.phase != ACTIVE:
            return [], {}
        topic = self._commands.topic_name
        problems = []
        state = self._activity.check()
        receivers = self._commands.get_subscription_count()
        other_count = self.count_publishers(topic) - 1
        if not receivers:
            problems.append(f"{topic} has no subscriber")
        elif self._controller in self._receivers():
            if "not compared" in self._order_known:
                problems.append(f"the order of joints is {self._order_known}")
            if not self._activity.is_installed:
                problems.append(
                    f"whether {self._controller} is active is unknown: install a "
                    "controller_manager_msgs with ControllerManagerActivity"
                )
        if other_count > 0:
            problems.append(f"other nodes publish {topic}")
        return [*problems, *problems_of_limits(self._loop.limits)], {
            "subscribers": receivers,
            "other publishers": other_count,
            "state of the effort controller": state or "unknown",
        }


def joints_of_controller(node, controller):
    """Return the parameter `joints` of another node; None if it does not answer.

    `node` asks, by a node of its own: its executor runs the callback that calls this.
    """
    asking = rclpy.create_node(
        f"{node.get_name()}_asking", context=node.context, use_global_arguments=False
    )
    executor = SingleThreadedExecutor(context=node.context)
    try:
        executor.add_node(asking)
        client = asking.create_client(GetParameters, f"{controller}/get_parameters")
        request = GetParameters.Request(names=["joints"])
        futures = []
        for _ in range(REQUESTS):
            futures.append(client.call_async(request))
            executor.spin_until_future_complete(futures[-1], timeout_sec=RETRY_PERIOD)
            done = next(filter(Future.done, futures), None)  # perhaps an earlier one
            if done:
                return [joint for x in done.result().values for joint in x.string_array_value]
        return None
    finally:
        executor.shutdown()
        asking.destroy_node()
