# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor node: joint_states and robot_description in, diagonalized dynamics out."""

from nav_msgs.msg import Odometry
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState

from diag_dynamics.exceptions import DiagDynamicsError, InputError, RejectedError
from diag_dynamics.joint_states.assembler import Rejected
from diag_dynamics.nodes.monitor.commands import EffortCommands
from diag_dynamics.nodes.monitor.gravity import GravitySource
from diag_dynamics.nodes.monitor.input_statistics import OVERLOAD, InputStatistics
from diag_dynamics.nodes.monitor.joint_coverage import joint_coverage
from diag_dynamics.nodes.monitor.monitored_robot import (
    MonitoredRobot,
    Refused,
    joint_names_of,
    model_status,
)
from diag_dynamics.nodes.monitor.outputs import Outputs
from diag_dynamics.nodes.monitor.reaction import Reaction
from diag_dynamics.nodes.monitor.services import Services
from diag_dynamics.nodes.monitor.watch import Moment
from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.nodes.support.declaring import TableNode, judge
from diag_dynamics.nodes.support.descriptions import RobotLoader, load_robot, subscribe_description
from diag_dynamics.nodes.support.diagnostics import Diagnostics, counted
from diag_dynamics.nodes.support.graph import clock_notes, publishers, topics_of
from diag_dynamics.nodes.support.guard import Fault, attempt
from diag_dynamics.nodes.support.publishing import connected, newest
from diag_dynamics.nodes.support.statuses import OK, STALE, WARN, Status
from diag_dynamics.nodes.support.topics import NODES
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.parameters.shared import (
    check_entries,
    payload_entry,
    payloads_of,
    with_payloads,
)
from diag_dynamics.text import listed, shortened

START_PERIOD = 2.0
"""Time [s] after a start, or after a new robot, without warnings of inputs that are silent."""

HEARTBEAT, OVERDUE = 0.1, 1.0
"""Period of the heartbeat, and how long it may be overdue before states are skipped [s].

An executor that serves events in their order delays services and diagnostics while states arrive
faster than they are evaluated.
"""


class MonitorNode(TableNode, Node):
    """Evaluate each joint state of a robot and publish the results to subscribers.

    Watches observe the states and report to /diagnostics. Parameters are in :data:`PARAMETERS`,
    topics in outputs.TYPES.
    """

    def __init__(self, **options):
        super().__init__(NODES["monitor"], PARAMETERS, **options)
        self._settings = Settings.of(self.values)
        self._robot = self._refused = None  # in force; a description that is not
        self._revision, self._started = 0, self.time.steady()
        self._statistics = InputStatistics(self.time.steady)
        self._outputs = Outputs(self)
        self._outputs.use_rates(self._settings.rates)
        check_entries(self.values)
        joint_names_of(self.values)  # reject wrong entries before a robot is loaded
        self.reaction = Reaction(self)
        self.commands = EffortCommands(self)
        self._diagnostics = Diagnostics(
            self, self._report, lambda: self._robot and self._robot.model
        )
        Services(self, lambda: self._robot, self._set_payload)
        self._loader = RobotLoader(self, self._make_robot, self._take_robot)
        self._gravity = GravitySource(self, lambda: self._robot)
        self._subscribe()
        judge(self, PARAMETERS, self._take_parameters)
        self.time.on_jump(self._take_clock_jump)
        self._beat = self.time.steady()
        self.create_timer(HEARTBEAT, self._take_heartbeat, clock=steady_clock())

    def _subscribe(self):
        """Subscribe to the inputs, and load the robot of the parameter if there is one."""
        sources = [(JointState, "joint_states", self._take_joint_state)]
        if self.values["floating_base"]:
            sources.append((Odometry, "odom", self._take_odometry))
        if self._gravity.topic:
            sources.append((Imu, self._gravity.topic, self._gravity.accept_imu))
        self._inputs = [
            connected(
                self.create_subscription,
                kind,
                topic,
                take,
                newest(),
                event_callbacks=SubscriptionEventCallbacks(message_lost=self._count_lost),
                raw=True,  # bytes that are no message must not end the node
            )
            for kind, topic, take in sources
        ]
        if self.values["robot_description"]:
            self._loader.load(self.values["robot_description"], self._settings)
        else:
            self._inputs.append(subscribe_description(self, self._take_description))

    def _count_lost(self, info):
        self._statistics.counts["lost in transport"] += info.total_count_change

    def _take_clock_jump(self):
        """Simulated time restarts, or another clock is in force."""
        if self._robot:
            self._robot.forget()
            self.reaction.end()
            self._statistics.counts["clock jumped back"] += 1

    # --- The robot

    def _take_description(self, description):
        """Load another robot; the one in force stays until that has succeeded."""
        if self._robot and description == self._robot.description:
            self._loader.drop()
            self._refused = None
        elif description != self._loader.loading:
            self._loader.load(description, self._settings)

    def _make_robot(self, description, settings):
        """Return the robot of a description; in a thread, so the node stays as it is."""
        model = load_robot(self, description, settings.values)
        return MonitoredRobot(description, model, settings, self._revision + 1, self)

    def _take_robot(self, result, description, _):
        """Put a robot in force, or report why it could not be made."""
        if not isinstance(result, Exception):
            self._put_in_force(result)
            return
        reason = Fault(result).reason
        if self.values["robot_description"] and not self._robot:
            self.finished.set_exception(
                InputError(f"the robot of parameter 'robot_description' is rejected: {reason}")
            )
            return
        self._refused = Refused(description, reason)

    def _put_in_force(self, robot):
        if self._robot:
            self._statistics.keep(self._robot)
        self._robot, self._refused, self._started = robot, None, self.time.steady()
        self.reaction.end()
        self._revision = robot.revision
        if count := robot.threshold_count:
            self.log_info(f"Collision thresholds of {count} joints.")
        size = f"{robot.model.nv} degrees of freedom, {robot.model.total_mass:.6g} kg"
        topic = self.resolve_topic_name("joint_states")
        self.log_info(f"Ready: robot '{robot.model.name}', {size}; subscribed to {topic}.")

    def _set_payload(self, link, payload):
        """Change one payload by the parameter `payloads`; return the model with it."""
        payloads = payloads_of(self.values["payloads"]) | {link: payload}
        texts = [payload_entry(name, body) for name, body in payloads.items() if body.mass] or [""]
        result = self.set_parameters([Parameter("payloads", value=texts)])[0]
        if not result.successful:
            raise InputError(result.reason)
        return self._robot.model

    # --- Every message

    def _take_heartbeat(self):
        self._beat = self.time.steady()
        self.reaction.check(self._beat)

    def _overloaded(self):
        """Store the time of reception of a message; return whether the heartbeat is overdue."""
        self._received = self.time.steady()
        return self._received - self._beat > OVERDUE

    def _take_joint_state(self, message):
        counts = self._statistics.counts
        robot = self._robot
        counts["received"] += 1
        if self._overloaded():
            counts[OVERLOAD] += 1
        elif robot is None:
            counts["before the model"] += 1
        else:
            self._guarded("rejected", self._serve, robot, message)

    def _serve(self, robot, message):
        """Publish the state that a joint state completes."""
        now = self.time.now()
        robot.first_received = robot.first_received or self._received
        result = robot.assembler.accept(message, now)
        if isinstance(result, Rejected):
            self._reject("rejected", *result)
        elif result.state is not None:
            if not result.state.stamp_is_receive_time:
                newest = (
                    robot.assembler.newest if robot.base else result.state.newest
                )  # without that of odometry
                self._statistics.add_latency(newest, now)
            self._publish(robot, result.state, "published")

    def _take_odometry(self, message):
        self._statistics.counts["odometry received"] += 1
        robot = self._robot
        if robot is None or robot.base is None:
            return
        if self._overloaded():
            self._statistics.counts[f"odometry {OVERLOAD}"] += 1
        else:
            self._guarded("odometry rejected", self._serve_odometry, robot, message)

    def _serve_odometry(self, robot, message):
        """Store the pose of the base; publish the state of a robot that has no joints."""
        try:
            message = deserialize_message(message, Odometry)
        except Exception as error:
            text = f"odom: {len(message)} bytes; expected a nav_msgs/msg/Odometry ({error})"
            raise RejectedError("malformed", text) from error
        result = robot.assembler.accept_odometry(message, self.time.now())
        if isinstance(result, Rejected):
            self._reject("odometry rejected", *result)
        elif result.state is not None:
            self._publish(robot, result.state, "published from odometry")

    def _guarded(self, outcome, action, robot, message):
        """Serve a message; an exception is counted and logged as a rejection."""
        _, fault = attempt(action, robot, message)
        if fault:
            self._reject(outcome, fault.cause, fault.text)

    def _reject(self, outcome, cause, text):
        self._statistics.count_rejected(outcome, cause, text)
        self.log_debug(f"{outcome}: {self._statistics.last_rejection}")

    def _publish(self, robot, state, outcome):
        """Evaluate a state, watch it, and publish it where there are subscribers."""
        self._outputs.look()
        robot.position = state.position
        self._gravity.check()
        moment = Moment(*robot.evaluate(state), self._received)
        for watch in robot.watches:
            if alarms := watch.accept(moment):  # which do not wait for the next second
                self._diagnostics.publish(alarms)
            watch.publish(moment, self._outputs)
        self._outputs.publish(moment, robot)
        self._statistics.count_published(outcome, moment.state.newest)

    # --- Parameters

    def _take_parameters(self, changed):
        """Apply new values if all of them together are valid.

        Load the robot anew where they may change it.
        """
        if not changed:
            return
        in_force = self.values["robot_description"]
        if bool(changed.get("robot_description", in_force)) != bool(in_force):
            raise InputError(
                "parameter 'robot_description' cannot replace the topic or become empty "
                "in a running node. Restart it."
            )
        settings = Settings.of(self.values | changed)
        if self._robot:
            try:
                self._use(self._robot, settings, changed)
            except DiagDynamicsError:
                if not self._refused:  # whose robot they may fit
                    raise
        if settings.rates != self._settings.rates:
            self._outputs.use_rates(settings.rates)
        self._settings = settings
        self.values = settings.values
        waiting = self._loader.loading or (self._refused and self._refused.description)
        if description := changed.get("robot_description") or waiting:
            self._loader.load(description, settings)

    def _use(self, robot, settings, changed):
        """Put the robot in force with other settings."""
        model = robot.model
        if "payloads" in changed:
            payloads = payloads_of(changed["payloads"])
            for link in robot.unapplied():  # a warning has named it
                payloads.pop(link, None)
            model = with_payloads(model, payloads)
        if "gravity" in changed:
            model = model.with_gravity(changed["gravity"])
        revision = self._revision + (model is not robot.model)
        robot.use(model, settings, revision)
        self._revision = revision
        if not robot.judges_collisions:  # the observer has ended or restarted
            self.reaction.end()

    # --- Diagnostics

    def _report(self):
        robot = self._robot
        counts = self._statistics.counts
        states = self._statistics.report(robot, self.time.now(), *self._notes())
        is_starting = self.time.steady() - self._started < START_PERIOD
        if is_starting and not (counts["received"] or counts["odometry received"]):
            states = states._replace(level=STALE)
        statuses = [
            states,
            *self._joint_reports(),
            model_status(robot, self._revision, self._refused, self._loader.loading),
        ]
        return (
            statuses
            + self._gravity.report()
            + (robot.report() if robot else [])
            + self.reaction.report()
        )

    def _notes(self):
        """Return the publishers of the inputs, and under None their problems."""
        notes = {}
        problems = []
        for subscription in self._inputs:
            kind = subscription.msg_type
            package, middle, _ = kind.__module__.split(".", 2)
            names, wrong = publishers(self, subscription, f"{package}/{middle}/{kind.__name__}")
            notes[f"publishers of {subscription.topic_name}"] = counted(names)
            problems += wrong.values()
            if kind is JointState and self._robot:
                problems += self._overlap(subscription.topic_name, sorted({*names} - {*wrong}))
                problems += [] if names else [self._absence(subscription.topic_name)]
        values, wrong = clock_notes(self)
        return notes | values, problems + wrong

    def _joint_reports(self):
        """Return the statuses of joints without data and of efforts; none without a robot."""
        if (robot := self._robot) is None:
            return []
        first = robot.first_received
        model = robot.model
        elapsed = None if first is None else self.time.steady() - first
        ignored = (*model.fixed_joints, *model.locked_joints)
        problem = robot.effort_problem(self.commands)
        return [
            joint_coverage(robot.assembler, ignored, robot.name_entries, elapsed, self._statistics),
            Status("efforts", WARN if problem else OK, problem or "not contradicted by gravity"),
        ]

    def _absence(self, topic):
        """Return the problem that nothing publishes the topic of joint states."""
        topics = topics_of(self, "sensor_msgs/msg/JointState")
        elsewhere = f"; joint states are on {listed(topics)}. Remap joint_states" if topics else ""
        return f"{topic} has no publisher{elsewhere}"

    def _overlap(self, topic, names):
        """Return the problem that nodes of these names publish the same joints."""
        joints = self._robot.assembler.overlapping_joints()
        if len(names) < 2 or not joints:
            return []
        return [
            f"more than one of these nodes publishes '{shortened(joints[0])}' on {topic}: "
            f"{', '.join(names)}. Stop one of them, or remap its topic"
        ]
