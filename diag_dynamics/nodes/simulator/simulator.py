# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator node: a robot that moves under its own dynamics, takes effort commands and publishes what a driver would."""

from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.clock import Clock as SomeClock
from rclpy.clock import ClockType
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

from diag_dynamics.exceptions import DiagDynamicsError, InputError, RejectedError
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.model import Payload
from diag_dynamics.model.followers import Followers
from diag_dynamics.model.single_joints import single_joints
from diag_dynamics.msg import DiagonalizedState, EnergyAudit
from diag_dynamics.nodes.simulator.outgoing import audit_message, joint_state_message, odometry_message
from diag_dynamics.nodes.simulator.reports import CommandsReport, pace_status, simulation_status
from diag_dynamics.nodes.support.clocks import CLOCK, clock_notes
from diag_dynamics.nodes.support.declaring import declare, judge
from diag_dynamics.nodes.support.diagnostics import ERROR, WARN, Diagnostics, Status, shortened
from diag_dynamics.nodes.support.guard import answered
from diag_dynamics.nodes.support.loading import load_robot, text_of
from diag_dynamics.nodes.support.managed import ACTIVE, PATIENT, ManagedNode
from diag_dynamics.nodes.support.messages import MessageMaker, to_time
from diag_dynamics.nodes.support.names import NODES
from diag_dynamics.nodes.support.publishing import connected
from diag_dynamics.nodes.support.requests import requested_state
from diag_dynamics.nodes.support.runner import main_of
from diag_dynamics.nodes.support.usage import defaults_of, parser_of
from diag_dynamics.parameters.shared import payloads_of
from diag_dynamics.parameters.simulator import DYNAMIC, PARAMETERS
from diag_dynamics.simulation.lockstep import PATIENCE, Lockstep
from diag_dynamics.simulation.pace import Pace
from diag_dynamics.simulation.plant import Plant
from diag_dynamics.srv import SetState, Step

COMMANDS, WRENCHES = "effort_controller/commands", "external_wrench"

MOST_STEPS = 10_000
"""Steps that one request may ask for: nothing else is served meanwhile."""

UNPACED = 1e-4
"""Period of ticks where simulated time goes as fast as can be [s]: between two of them others have their turn."""

NOTHING = Payload(0.0)
"""What takes a payload off."""


class SimulatorNode(ManagedNode):
    """See the module; parameters are in :data:`~parameters.simulator.PARAMETERS`.

    A managed node. Configured, it has a robot and its services answer; active, the robot moves, listens and publishes.
    """

    def __init__(self, **kwargs):
        super().__init__(NODES["simulator"], **kwargs)
        self._values = declare(self, PARAMETERS)
        self._plant = self._pace = None
        self._published, self._listened, self._services_offered, self._timers_running = [], [], [], []
        self._paused, self._timeless, self._failure = False, False, ""
        self._last = None  # joint state
        self._lockstep = Lockstep()
        self._latest = 0  # stamp [ns]
        self._commands_report = CommandsReport()
        judge(self, PARAMETERS, lambda: self._values, self._take_parameters)
        self._diagnostics = Diagnostics(self, self._report, lambda: self._plant and self._plant.simulation.model)
        self.begin(self._values["autostart"])

    # --- Lifecycle ---

    def set_up(self):
        """Load the robot; make publishers and services."""
        values = self._values
        if not values["robot_description"]:
            raise InputError("parameter 'robot_description' is empty: give the simulator a URDF or the path of one.")
        if self._keeps_time and self.get_clock().ros_time_is_active:
            self.set_parameters([Parameter("use_sim_time", value=False)])  # as a launch sets it for all of its nodes
            self.get_logger().info(
                "Simulated time is this node's own to publish: its use_sim_time is false from now on."
            )
        text = text_of(values["robot_description"])
        model = self._robot(text)
        if values["real_time_factor"] != 1.0 and not self._keeps_time:
            self.get_logger().warning(
                f"real_time_factor is {values['real_time_factor']:g}, at which stamps leave the clock: nodes that compare "
                "them need publish_clock here and use_sim_time there."
            )
        self._plant = Plant(model, values)
        self._plant.simulation.dynamics.compile("evaluate", "gravity_torque", "nu_from_qd")
        self._revision, self._failure, self._paused = 1, "", False
        self._start = max(self.time.now(), self._latest)  # /clock never goes back
        self._pace = Pace(values["real_time_factor"], 1.0 / values["rate"], self._plant.simulation.step_size)
        self._use(model)
        for load in (self._truth_now, self._audit_now):  # what they call, before time goes on
            load()
        self._publish_to(text.lstrip())
        self._offer()
        self.settled()

    def _robot(self, text):
        """The robot of a description, which may differ from it."""
        values = self._values
        model = load_robot(self, text, values)
        off = values["inertia_error"]
        if not off:
            return model
        self.get_logger().info(f"Inertias are off from the description by up to {off:.0%}, as inertia_error wants.")
        try:
            return model.perturbed(off, values["inertia_error_seed"])
        except DiagDynamicsError as error:
            raise InputError(f"parameters inertia_error and inertia_error_seed: {error}") from error

    def _use(self, model):
        self._maker = MessageMaker(model, self._revision)
        self._followers = Followers(single_joints(model), model.mimics)

    @property
    def _keeps_time(self):
        return self._values["publish_clock"] or self._values["lockstep"]

    def _publish_to(self, text):
        once = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._description = self._publisher(String, "robot_description", once)
        self._description.publish(String(data=text))
        self._joint_states = self._publisher(JointState, "joint_states")
        self._odometry = self._publisher(Odometry, "odom") if self._plant.simulation.model.floating_base else None
        self._truth = self._publisher(DiagonalizedState, "~/ground_truth")
        self._audit = self._publisher(EnergyAudit, "~/energy_audit")
        self._clock_out = self._publisher(Clock, CLOCK) if self._keeps_time else None

    def _publisher(self, kind, topic, qos=None):
        publisher = connected(self.create_publisher, kind, topic, qos or QoSProfile(depth=10))
        self._published.append(publisher)
        return publisher

    def _offer(self):
        for kind, name, answer, keep in (
            (SetBool, "pause", self._pause, ()),
            (Step, "step", self._step, ("stamp",)),
            (Trigger, "reset", self._reset, ()),
            (SetState, "set_state", self._set_state, ()),
        ):
            callback = answered(self, kind, answer, keep=keep)
            self._services_offered.append(self.create_service(kind, f"~/{name}", callback, qos_profile=PATIENT))

    def listen(self):
        """Subscribe to commands and wrenches, and let time go on."""
        queue = QoSProfile(depth=10)
        listened = [(WrenchStamped, WRENCHES, self._take_wrench)]
        if self._values["motion"] != "wave":
            listened.append((Float64MultiArray, COMMANDS, self._take_command))
        for kind, topic, take in listened:
            self._listened.append(connected(self.create_subscription, kind, topic, take, queue))
        steady = SomeClock(clock_type=ClockType.STEADY_TIME)
        self._lockstep.begin(self.time.steady())
        self._go_on()
        if self._values["lockstep"]:
            self._timers_running.append(self.create_timer(PATIENCE / 2, self._remind, clock=steady))
            self._measure_and_publish()
        elif self._pace.factor:
            period = 1.0 / (self._values["rate"] * self._pace.factor)
            self._timers_running.append(self.create_timer(period, self._tick))
        else:
            self._timers_running.append(self.create_timer(UNPACED, self._tick, clock=steady))
        model = self._plant.simulation.model
        self.get_logger().info(
            f"Ready: robot '{model.name}', {model.nv} degrees of freedom, motion '{self._values['motion']}', "
            f"{self._values['rate']:g} Hz."
        )

    def stop_listening(self):
        """Let time stand still, and listen to nobody; whoever commands or pushes has to do so anew."""
        if self._plant:
            self._plant.drives.forget()
            self._plant.pushes.forget()
        for timer in self._timers_running:
            self.destroy_timer(timer)
        for subscription in self._listened:
            self.destroy_subscription(subscription)
        self._timers_running, self._listened = [], []

    def tear_down(self):
        """Let the robot go, and all that was made for it."""
        for service in self._services_offered:
            self.destroy_service(service)
        for publisher in self._published:
            self.destroy_publisher(publisher)
        self._services_offered, self._published = [], []
        self._plant = self._pace = None

    # --- Time ---

    @property
    def _moving(self):
        return self.phase == ACTIVE and not self._paused and not self._failure

    @property
    def _follows(self):
        """Whether stamps have to be those of the clock: simulated time is as fast, and not given to others."""
        return not self._keeps_time and self._values["real_time_factor"] == 1.0

    def _stamp_anew(self):
        """Have stamps that follow the clock go on from now; those of single steps while paused never go back."""
        if self._follows or self._timeless:
            now = self.time.now()
            self._start = max(now, self._latest * self._paused) - round(self._plant.time * 1e9)

    def _now(self):
        return self.time.now() * 1e-9

    def _go_on(self):
        """Have simulated time go on from here."""
        self._timeless = not self._now()  # nothing on /clock yet
        self._pace.resume(self._now(), self._plant.time)
        self._stamp_anew()
        self._lockstep.resume(self.time.steady())

    def _tick(self):
        """Bring the simulation up to now, and publish where it is."""
        if not self._moving:
            return
        if self._timeless:
            if not self._now():
                return
            self._stamp_anew()
            self._go_on()
        before = self._pace.skipped
        steps = self._pace.steps(self._now(), self._plant.time)
        if self._follows:
            self._start += round((self._pace.skipped - before) * 1e9)
        if steps:
            self._advance(steps)  # else nothing has happened that is not published yet

    def _advance(self, steps):
        """Take some steps and publish; whether that was possible."""
        try:
            self._plant.advance(steps)
            self._measure_and_publish()
        except DiagDynamicsError as error:
            self._failure = shortened(str(error))
            self.get_logger().error(f"The simulation has stopped: {error}")
            return False
        return True

    def _remind(self):
        """In lockstep, publish time and last joint state again where an answer to it may never come."""
        now = self.time.steady()
        heard = self.get_subscriptions_info_by_topic(self._joint_states.topic_name)
        sending = self.get_publishers_info_by_topic(self._listened[-1].topic_name)
        self._lockstep.meet({bytes(end.endpoint_gid) for end in (*heard, *sending)}, now)
        if self._moving and self._lockstep.repeat(now):
            self._publish_time()
            self._joint_states.publish(self._last)

    def _answer(self):
        """In lockstep, go on if the last joint state has been answered."""
        if self._values["lockstep"] and self._moving and self._lockstep.answered(self.time.steady()):
            self._advance(self._steps_of_a_period)

    @property
    def _steps_of_a_period(self):
        return round(1.0 / (self._values["rate"] * self._plant.simulation.step_size))

    # --- Inputs ---

    def _take_command(self, message):
        if self.phase != ACTIVE:
            return
        plant = self._plant
        try:
            plant.drives.command(message.data, plant.time)
        except RejectedError as error:
            self._lockstep.refuse()
            self._say_rejected(COMMANDS, error)
            return
        self._lockstep.command(self.time.steady())
        self._answer()

    def _take_wrench(self, message):
        if self.phase != ACTIVE:
            return
        try:
            self._plant.pushes.push(message, self._plant.time)
        except RejectedError as error:
            self._say_rejected(WRENCHES, error)

    def _say_rejected(self, topic, error):
        self.get_logger().debug(f"rejected on {topic}: {shortened(str(error))}")
        self.get_logger().warning(f"Rejected on {topic}: {shortened(str(error))}", throttle_duration_sec=5.0)

    # --- Outputs ---

    @property
    def _stamp(self):
        """Of this moment [ns]."""
        stamp = self._start + round(self._plant.time * 1e9)
        self._latest = max(self._latest, stamp)
        return stamp

    def _measure_and_publish(self):
        """Publish the time, what sensors have come to know, and the truth."""
        plant = self._plant
        self._publish_time()
        plant.measure(self._stamp)
        for measured in plant.known():
            stamp = to_time(measured.stamp)
            if measured.base is not None:
                self._odometry.publish(odometry_message(plant.simulation.model.root_link, measured, stamp))
            self._lockstep.publish()
            self._last = joint_state_message(plant.names, measured, stamp)
            self._joint_states.publish(self._last)
        if self._truth.get_subscription_count():
            self._truth.publish(self._truth_now())
        if self._audit.get_subscription_count():
            self._audit.publish(self._audit_now())

    def _publish_time(self):
        if self._clock_out:
            self._clock_out.publish(Clock(clock=to_time(self._stamp)))

    def _truth_now(self):
        simulation = self._plant.simulation
        effort, stamp = simulation.effort, self._stamp
        s = simulation.evaluate(effort)
        return self._maker.evaluated("state", s, RobotState(simulation.q, simulation.qd, effort, stamp, stamp, False))

    def _audit_now(self):
        return audit_message(self._plant.simulation, to_time(self._stamp))

    # --- Services ---

    def _pause(self, request, _):
        if request.data == self._paused:
            return "already paused" if self._paused else "not paused"
        self._paused = request.data
        if not self._paused:
            self._go_on()
            self._answer()  # which may have come meanwhile
        return "paused" if self._paused else "going on"

    def _step(self, request, response):
        response.stamp = to_time(self._stamp)
        if not self._paused or self.phase != ACTIVE:
            raise InputError(f"the simulation is {self.phase} and not paused: call pause first.")
        if self._failure:
            raise InputError(f"the simulation has stopped: {self._failure}")
        if not 1 <= request.steps <= MOST_STEPS:
            raise InputError(f"steps is {request.steps}, expected 1 to {MOST_STEPS}.")
        self._stamp_anew()
        whole, rest = divmod(request.steps, self._steps_of_a_period)
        moved = all(self._advance(steps) for steps in [self._steps_of_a_period] * whole + [rest] * bool(rest))
        response.stamp = to_time(self._stamp)
        if not moved:
            raise InputError(f"the simulation has stopped: {self._failure}")
        return ""

    def _reset(self, *_):
        self._plant.reset()
        return self._moved()

    def _set_state(self, request, _):
        state = requested_state(self._plant.simulation.model, request, self._followers)
        self._plant.put(state.position, state.velocity)
        return self._moved()

    def _moved(self):
        """Go on from another state."""
        if self._failure:  # which the command or the push in force may have brought about
            self._plant.drives.forget()
            self._plant.pushes.forget()
        self._failure = ""
        self._plant.advance(0)
        if self.phase == ACTIVE:
            self._go_on()
            if not self._timeless:
                self._measure_and_publish()
        return ""

    # --- Parameters ---

    def _take_parameters(self, given, changed):
        if given.get("use_sim_time") and self._plant and self._keeps_time:
            raise InputError("parameter 'use_sim_time' is true, but simulated time is this node's own to publish.")
        if self._plant and set(changed) & set(DYNAMIC):
            self._change(self._values | changed)
        self._values |= changed

    def _change(self, values):
        """Go on with other payloads and gravity."""
        model, wanted = self._plant.simulation.model, payloads_of(values["payloads"])
        for link in {**model.payloads, **wanted}:
            model = model.with_payload(link, *wanted.get(link, NOTHING))
        self._plant.simulation.change_model(model.with_gravity(values["gravity"]))
        self._revision += 1
        self._use(self._plant.simulation.model)

    # --- Diagnostics ---

    def _report(self):
        if self._plant is None:
            level, message = (ERROR, self.failure) if self.failure else (WARN, self.phase)
            return [Status("simulation", level, message, {"lifecycle": self.phase})]
        lockstep = self._lockstep if self._values["lockstep"] else None
        stuck = lockstep is not None and self._moving and lockstep.waits(self.time.steady())
        return [
            simulation_status(self._plant, self.phase, self._paused, self._failure),
            pace_status(self._pace, lockstep, stuck, *clock_notes(self, self._keeps_time)),
            self._commands_report.status(self._plant.drives, self._plant.pushes),
        ]


main = main_of(SimulatorNode, parser_of("simulator", __doc__, PARAMETERS), defaults_of(PARAMETERS))
