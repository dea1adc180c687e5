# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor node: joint_states and robot_description in, diagonalized dynamics out."""

import contextlib
from functools import partial

from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from diag_dynamics.exceptions import DiagDynamicsError, InputError, RejectedError
from diag_dynamics.joint_states.assembler import Rejected
from diag_dynamics.nodes.monitor.described import NO_PAYLOAD, MonitoredRobot, Refused, fitted, model_status
from diag_dynamics.nodes.monitor.energy_watch import numerical_health
from diag_dynamics.nodes.monitor.outputs import TYPES, Outputs
from diag_dynamics.nodes.monitor.services import DynamicsServices
from diag_dynamics.nodes.monitor.traffic import OVERLOAD, Traffic, foreign_stamps
from diag_dynamics.nodes.support.clocks import clock_notes, tell_of_time
from diag_dynamics.nodes.support.declaring import declare, judge
from diag_dynamics.nodes.support.descriptions import Descriptions, DescriptionTopic
from diag_dynamics.nodes.support.diagnostics import WARN, Diagnostics, Status, counted
from diag_dynamics.nodes.support.graph import publishers
from diag_dynamics.nodes.support.guard import attempt
from diag_dynamics.nodes.support.loading import load_robot
from diag_dynamics.nodes.support.managed import ACTIVE, INACTIVE, UNCONFIGURED, ManagedNode
from diag_dynamics.nodes.support.names import NODES
from diag_dynamics.nodes.support.publishing import connected
from diag_dynamics.nodes.support.reading import read_odometry
from diag_dynamics.nodes.support.runner import main_of
from diag_dynamics.nodes.support.start import stop
from diag_dynamics.nodes.support.usage import defaults_of, parser_of
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.parameters.shared import payload_entry, payloads_of

HEARTBEAT, OVERDUE = 0.1, 1.0
"""Period of the heartbeat, and how long it may be overdue before states are skipped [s].

An executor that serves events in their order puts everything off, services and diagnostics too, as long as states come in
faster than they can be evaluated.
"""


class MonitorNode(ManagedNode):
    """See the module; parameters are in :data:`PARAMETERS`, topics in :data:`TYPES`.

    A managed node. Configured, it has a robot or waits for one, and its services answer; active, it listens to states and
    publishes. With `autostart` it goes there by itself.
    """

    def __init__(self, **kwargs):
        super().__init__(NODES["monitor"], **kwargs)
        self._settings = Settings.of(declare(self, PARAMETERS))
        self._robot = self._outputs = self._offered = self._descriptions = None
        self._inputs = []
        self._refused = None  # description that is not in force, why, and its model if there is one
        self._loads = Descriptions(self, self._made, self._take_made)
        self._listening = 0  # number of the activation
        self._revision = 0
        self._traffic = Traffic(self.time.steady)
        judge(self, PARAMETERS, lambda: self._settings.values, self._take_parameters)
        self.time.on_jump(self._clock_jumped)
        self._diagnostics = Diagnostics(self, self._report, lambda: self._robot and self._robot.model)
        self._beat = self.time.steady()
        self.create_timer(HEARTBEAT, self._take_heartbeat, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.begin(self._settings.values["autostart"])

    # --- Lifecycle ---

    def set_up(self):
        """Make the outputs and services, and load the robot or wait for one."""
        self._outputs = Outputs(self)
        for topic in TYPES:
            self._outputs.limit(topic, self._settings.values[f"max_rate.{topic}"])
        self._offered = DynamicsServices(self, self._in_force, self._put_on)
        if self._settings.values["robot_description"]:
            self._adopt(self._loaded_from_parameter(self._settings))
        else:
            self._descriptions = DescriptionTopic(self, self._take_description)

    def listen(self):
        """Subscribe to the inputs."""
        sources = [(JointState, "joint_states", self._take_joint_state)]
        if self._settings.values["floating_base"]:
            sources.append((Odometry, "odom", self._take_odometry))
        self._listening += 1
        self._beat = self.time.steady()  # loading a robot may have taken long
        for kind, topic, take in sources:
            subscription = connected(
                self.create_subscription,
                kind,
                topic,
                partial(take, self._listening),
                QoSProfile(depth=5, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT),
                event_callbacks=SubscriptionEventCallbacks(message_lost=self._lost),
                raw=True,  # what is no message must not end the node
            )
            self._inputs.append(subscription)

    def stop_listening(self):
        """Take no states any more; of those that came before, none counts."""
        self._listening += 1  # events of a subscription that is gone may be served yet
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self._inputs = []
        if self._robot:
            self._robot.forget()
            self._robot.assembler.forget_clock()

    def tear_down(self):
        """Let the robot go, and all that was made for it."""
        self._loads.drop()
        if self._descriptions:
            self._descriptions.close()
        for part in (self._offered, self._outputs):
            if part:
                part.destroy()
        if self._robot:
            self._traffic.keep(self._robot)
        self._robot = self._outputs = self._offered = None
        self._descriptions = self._refused = None

    def _lost(self, info):
        self._traffic.counts["lost in transport"] += info.total_count_change

    def _clock_jumped(self):
        """Simulated time has started anew, or another clock is in force."""
        if self._robot:
            self._robot.forget()
            self._traffic.counts["clock jumped back"] += 1

    # --- The model ---

    def _take_description(self, description):
        """Make a new robot the one in force; keep the old one if the new one is not valid."""
        if self._robot and description == self._robot.description:
            self._loads.drop()
            self._refused = None
        elif description != self._loads.loading:
            self._loads.load(description, self._settings)

    def _made(self, description, settings):
        """Model of a description, and its robot or why the settings do not fit; in a thread: the node stays as it is."""
        model = load_robot(self, description, settings.values)
        try:
            return model, MonitoredRobot(description, model, settings, self._revision + 1)
        except DiagDynamicsError as error:
            return model, error

    def _take_made(self, made, description, settings):
        """Make the robot of a description the one in force, or tell why it cannot be."""
        model, robot = (None, made) if isinstance(made, Exception) else made
        _, fault = attempt(self._put_in_force, model, robot, description, settings)
        if fault:
            self._refused = Refused(description, fault.reason, model)
            kept = f"; keeping robot '{self._robot.model.name}'" if self._robot else ""
            said = f"robot_description refused{kept}: {fault.reason}"
            self.get_logger().error(said, throttle_duration_sec=0.5)

    def _put_in_force(self, model, robot, description, settings):
        """Put a robot in force, or raise the exception that is in its place; with the settings that are in force by now."""
        if isinstance(robot, Exception):
            if settings is self._settings:
                raise robot
            self._loads.load(description, self._settings)  # others may fit
            return
        if settings is not self._settings or robot.revision != self._revision + 1:
            robot.use(fitted(model, self._settings), self._settings, self._revision + 1)
        self._adopt(robot)
        self._refused = None

    def _loaded(self, description, settings):
        """The robot of a description.

        Raises
        ------
        DiagDynamicsError
            The description is not valid, or the settings do not fit it.
        """
        model = load_robot(self, description, settings.values)
        return MonitoredRobot(description, model, settings, self._revision + 1)

    def _loaded_from_parameter(self, settings):
        try:
            with stop.may_be_left(self.destroy_node):
                return self._loaded(settings.values["robot_description"], settings)
        except DiagDynamicsError as error:
            raise InputError(f"parameter 'robot_description' refused: {error}") from error

    def _adopt(self, robot):
        """Make this robot the one in force."""
        if self._robot:
            self._traffic.keep(self._robot)
        elif not self._revision:
            self.settled()  # the first robot has loaded all that any robot needs
        self._robot = robot
        self._revision += 1
        for link in robot.unapplied():
            self.get_logger().warning(
                f"The payload on '{link}' is not applied: robot '{robot.model.name}' has no such link."
            )
        if robot.without_rotors:
            self.get_logger().info(
                f"Joints at which the URDF has next to no inertia: {counted(robot.without_rotors)}. At its effort limit such "
                "a joint is at full speed before the motor's current has risen. Kinetic energy and alarms are wrong there "
                "without the rotor's inertia: armature, or a parameters_file by diag-dynamics identify (docs/identify.md)."
            )
        self.get_logger().info(
            f"Ready: robot '{robot.model.name}', {robot.model.nv} degrees of freedom, {robot.model.total_mass:.6g} kg; "
            f"listening to {self.resolve_topic_name('joint_states')}."
        )

    def _in_force(self):
        """What the services work with."""
        robot = self._robot
        return (robot.dynamics, robot.maker, robot.assembler.followers) if robot else None

    def _put_on(self, link, payload):
        """Change one payload, as the parameter `payloads`; returns the model with it."""
        payloads = payloads_of(self._settings.values["payloads"]) | {link: payload}
        entries = [payload_entry(name, one) for name, one in payloads.items() if one.mass] or [""]
        result = self.set_parameters([Parameter("payloads", value=entries)])[0]
        if not result.successful:
            raise InputError(result.reason)
        return self._robot.model

    # --- Every message ---

    def _take_heartbeat(self):
        self._beat = self.time.steady()

    def _overloaded(self):
        return self.time.steady() - self._beat > OVERDUE

    def _take_joint_state(self, listening, message):
        if listening != self._listening:
            return
        counts, robot = self._traffic.counts, self._robot
        counts["received"] += 1
        if self._overloaded():
            counts[OVERLOAD] += 1
            if robot:
                robot.assembler.pause()
            return
        if robot is None:
            counts["before the model"] += 1
            return

        self._guarded("rejected", self._serve, robot, message)

    def _serve(self, robot, message):
        """Publish the state that a joint state completes."""
        now = self.time.now()
        found = robot.assembler.accept(message, now)
        if isinstance(found, Rejected):
            self._reject("rejected", *found)
        elif found.state is not None:
            if not found.state.stamp_is_receive_time:
                newest = robot.assembler.newest if robot.base else found.state.newest  # without that of odometry
                self._traffic.arrived(newest, now)
            self._publish(robot, found.state, "published")

    def _take_odometry(self, listening, message):
        if listening != self._listening:
            return
        self._traffic.counts["odometry received"] += 1
        robot = self._robot
        if robot is None or robot.base is None:
            return
        if self._overloaded():
            self._traffic.counts[f"odometry {OVERLOAD}"] += 1
            return

        self._guarded("odometry rejected", self._serve_odometry, robot, message)

    def _serve_odometry(self, robot, message):
        """Store where the base is; publish the state of a robot that is all base."""
        try:
            message = read_odometry(message)
        except Exception as error:
            text = f"odom: {len(message)} bytes that are no nav_msgs/msg/Odometry ({error})"
            raise RejectedError("malformed", text) from error
        found = robot.assembler.accept_odometry(message, self.time.now())
        if isinstance(found, Rejected):
            self._reject("odometry rejected", *found)
        elif found.state is not None:
            self._publish(robot, found.state, "published from odometry")

    def _guarded(self, what, action, robot, message):
        """Nothing that arrives may end the node."""
        _, fault = attempt(action, robot, message)
        if fault:
            if what == "rejected":
                robot.assembler.pause()  # its stamp may not have been looked at
            self._reject(what, fault.cause, fault.text)

    def _reject(self, what, cause, text):
        self._traffic.rejected(what, cause, text)
        self.get_logger().debug(f"{what}: {cause}: {self._traffic.last_rejection}")
        self.get_logger().warning(f"Rejected: {self._traffic.last_rejection}", throttle_duration_sec=5.0)

    def _publish(self, robot, state, what):
        """Evaluate a state, and pass it on."""
        self._outputs.look()
        s, state = robot.evaluate(state)
        if robot.torque:  # a collision is told of before anything else
            self._observe(robot, state)
        powers = robot.powers(s)
        self._pass_on(robot, state.newest, s, powers, lambda topics: robot.encoder.messages(topics, s, state), what)

    def _observe(self, robot, state):
        """Observe external torque by a state as it was evaluated."""
        watch = robot.torque
        alarm = watch.take(state)
        self._log_collisions(watch)
        self._outputs.publish_beside(
            "external_torque",
            state.newest,
            lambda: robot.encoder.external_torque(watch.seen, watch.observation, state, watch.alarming),
        )
        if alarm:
            self._diagnostics.publish([robot.torque_report()])

    def _log_collisions(self, watch):
        """Log beginnings and ends of collisions."""
        for line, begins in watch.log.pop():
            if begins:
                self.get_logger().warning(line)
            else:
                self.get_logger().info(line)

    def _pass_on(self, robot, stamp, s, powers, messages, what):
        """Publish a state where somebody listens, and watch it, with its powers of gravity and friction [W].

        `messages` makes the messages of a list of topics.
        """
        if robot.contact.judges or self._outputs.touched:
            self._look_at_contact(robot, robot.state)
        self._outputs.publish(stamp, messages, robot.matrix)
        self._traffic.published(what, stamp)
        if self._outputs.drawn:
            self._outputs.publish_beside("markers", stamp, lambda: robot.markers(s))
        if robot.energy.take(stamp, s, *powers):  # an alarm does not wait for the second to be over
            self._diagnostics.publish([robot.energy.report()])

    def _look_at_contact(self, robot, state):
        """Tell what a touch would cost at a state where somebody listens, and at once where a limit is exceeded."""
        watch = robot.contact
        alarm = watch.judges and watch.take(state)
        self._outputs.publish_beside("contact", state.newest, lambda: robot.encoder.contact(watch.at(state), state))
        if alarm:
            self._diagnostics.publish([watch.report()])

    # --- Parameters ---

    def _take_parameters(self, _, changed):
        """Take new values over if all of them together make sense."""
        self._refuse_now(changed)
        settings = Settings.of(self._settings.values | changed)
        robot = self._reconsidered(settings, changed)
        self._settings = settings
        self.get_logger().debug(f"parameters taken: {', '.join(changed)}")
        if robot is not self._robot:
            self._refused = None
            self._loads.drop()
            self._adopt(robot)
        elif (
            self._refused and not self._refused.model and self._loads.loading is None
        ):  # the other settings may make a robot of it
            self._loads.load(self._refused.description, settings)
        for topic in TYPES if self._outputs else ():
            if f"max_rate.{topic}" in changed:
                self._outputs.limit(topic, changed[f"max_rate.{topic}"])

    def _refuse_now(self, changed):
        """Refuse to go over from a robot of the topic to one of the parameter, or back, unless unconfigured."""
        in_force = self._settings.values["robot_description"]
        if self.phase != UNCONFIGURED and bool(changed.get("robot_description", in_force)) != bool(in_force):
            raise InputError(
                "parameter 'robot_description' is read-only while the robot comes from the topic, and cannot become empty "
                "while it does not: clean the node up first."
            )

    def _reconsidered(self, settings, changed):
        """The robot with other settings: another one, or that in force, or none if there is none.

        Raises
        ------
        DiagDynamicsError
            The settings do not fit it; nothing has changed then.
        """
        robot = self._robot
        if changed.get("robot_description") and self.phase in (
            INACTIVE,
            ACTIVE,
        ):  # be it the same path: its file may not be
            return self._loaded_from_parameter(settings)
        if self._refused and self._refused.model:  # for want of these settings, perhaps
            with contextlib.suppress(DiagDynamicsError):
                model = fitted(self._refused.model, settings)
                return MonitoredRobot(self._refused.description, model, settings, self._revision + 1)
        if robot:
            self._use(robot, settings, changed)
        return robot

    def _use(self, robot, settings, changed):
        """Put the robot in force with other settings."""
        model = robot.model
        if "payloads" in changed:
            wanted = payloads_of(changed["payloads"])
            for link in robot.unapplied():  # has been left out before, and is said to be
                wanted.pop(link, None)
            for link in {**model.payloads, **wanted}:
                model = model.with_payload(link, *wanted.get(link, NO_PAYLOAD))
        if "gravity" in changed:
            model = model.with_gravity(changed["gravity"])
        revision = self._revision + (model is not robot.model)
        robot.use(model, settings, revision)
        self._revision = revision

    # --- Diagnostics ---

    def _report(self):
        robot = self._robot
        tell_of_time(self, self._traffic.counts["received"], foreign_stamps(robot) if robot else [])
        active = self.phase == ACTIVE
        statuses = [self._traffic.status(robot, self.time.now(), self._notes())]
        if not active:
            values = statuses[0].values
            statuses[0] = Status("joint states", WARN, f"{self.phase}: nothing is listened to", values)
        elif robot is None:
            statuses[0] = statuses[0]._replace(level=WARN, message=f"no robot yet; {statuses[0].message}")
        statuses += [
            model_status(robot, self.phase, self._revision, self.failure, self._refused, self._loads.loading),
            numerical_health(*((robot.dynamics, robot.state) if robot else (None, None))),
        ]
        if robot:
            statuses.append(robot.energy.report())
            if robot.torque:
                self._log_collisions(robot.torque)
                statuses.append(robot.torque_report())
            if robot.contact.judges:
                statuses.append(robot.contact.report())
        return statuses

    def _notes(self):
        """Who publishes the inputs, and what is wrong with that."""
        notes, problems = {}, []
        kinds = ("sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry")
        for subscription, kind in [
            *zip(self._inputs, kinds, strict=False),
            (self._descriptions and self._descriptions.subscription, "std_msgs/msg/String"),
        ]:
            if subscription:
                names, wrong = publishers(self, subscription, kind)
                notes[f"publishers of {subscription.topic_name}"] = counted(names)
                problems += wrong
        values, wrong = clock_notes(self)
        return notes | values | {None: problems + wrong}


main = main_of(MonitorNode, parser_of("monitor", __doc__, PARAMETERS), defaults_of(PARAMETERS))
