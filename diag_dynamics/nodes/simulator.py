# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulator node: a robot that moves by its dynamics and effort commands.

It publishes what a driver would.
"""

from collections import Counter

from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import SetBool, Trigger

from diag_dynamics.exceptions import DiagDynamicsError, InputError, RejectedError
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.model.mimic import Followers
from diag_dynamics.msg import DiagonalizedState
from diag_dynamics.nodes.support.clocks import steady_clock
from diag_dynamics.nodes.support.declaring import TableNode, judge
from diag_dynamics.nodes.support.descriptions import RobotLoader, load_robot, text_of
from diag_dynamics.nodes.support.diagnostics import Diagnostics, counted
from diag_dynamics.nodes.support.graph import CLOCK, clock_notes
from diag_dynamics.nodes.support.guard import offer
from diag_dynamics.nodes.support.messages import MessageMaker, doubles, to_time
from diag_dynamics.nodes.support.publishing import connected, latched
from diag_dynamics.nodes.support.requests import read_state
from diag_dynamics.nodes.support.statuses import (
    ERROR,
    OK,
    STALE,
    WARN,
    Status,
    problem_status,
    without_numbers,
)
from diag_dynamics.nodes.support.topics import NODES
from diag_dynamics.parameters.shared import check_entries, payloads_of, with_payloads
from diag_dynamics.parameters.simulator import DYNAMIC, PARAMETERS
from diag_dynamics.simulation.drives import TIMED_OUT
from diag_dynamics.simulation.pace import COMMAND_TIMEOUT, Lockstep, Pace
from diag_dynamics.simulation.plant import Plant, require_consistent
from diag_dynamics.srv import SetState
from diag_dynamics.text import shortened

MAX_OVERRUNS = 0.1
"""Skipped ticks, as a fraction of those that were not, above which the pace is a warning."""

COMMANDS, WRENCHES = "effort_controller/commands", "external_wrench"

UNPACED = 1e-4
"""Period of ticks where simulated time runs as fast as possible [s].

Other callbacks are served between two ticks.
"""

WORLD = "world"
"""Frame of a floating base's pose."""


def joint_state_message(names, measured, stamp):
    """Return a JointState of these joints."""
    message = JointState(name=names)
    message.header.stamp = stamp
    message.position = doubles(measured.position)
    message.velocity = doubles(measured.velocity)
    message.effort = doubles(measured.effort)
    return message


def odometry_message(root_link, measured, stamp):
    """Return the Odometry of a floating base."""
    q, qd = measured.base
    message = Odometry(child_frame_id=root_link)
    message.header.stamp = stamp
    message.header.frame_id = WORLD
    pose = message.pose.pose
    velocity = message.twist.twist
    position = pose.position
    o = pose.orientation
    position.x, position.y, position.z, o.x, o.y, o.z, o.w = map(float, q)
    linear = velocity.linear
    angular = velocity.angular
    linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = map(float, qd)
    return message


def simulation_status(plant, paused, failure):
    """Return the status of the robot; `failure` is why the simulation has stopped, or empty."""
    simulation = plant.simulation
    values = {
        "robot": simulation.model.name,
        "simulated time [s]": f"{plant.time:.3f}",
        "kinetic energy [J]": f"{simulation.kinetic_energy:.6g}",
        **{
            f"energy audit: {name} [J]": f"{value:.6g}"
            for name, value in simulation.audit._asdict().items()
        },
        "joints at their effort limit": counted(simulation.saturated),
        "joints at a position limit": counted(simulation.at_limit),
        "joints beyond their velocity limit": counted(simulation.overspeed),
        "payloads": counted(simulation.model.payloads),
    }
    if failure:
        values["failure"] = failure
        text = f"stopped: {failure}"
        return Status("simulation", ERROR, without_numbers(text), values, text)
    if paused:
        return Status("simulation", WARN, "paused", values)
    return Status("simulation", OK, "running", values)


def pace_status(pace, lockstep, waits, time_values, problems):
    """Return the status of time; `time_values` and `problems` are those of its publishers."""
    report = pace.report()
    values = {
        "ticks": report.ticks,
        "lateness, mean [s]": f"{report.mean:.6f}",
        "lateness, maximum [s]": f"{report.largest:.6f}",
        "overruns": report.overruns,
        "dropped lag [s]": f"{report.dropped:.3f}",
        "real-time factor": "lockstep" if lockstep else f"{pace.factor:g}",
        **time_values,
    }
    if waits:
        problems = [*problems, "lockstep: waiting for a command"]
    elif report.dropped > 0.0 or report.overruns > MAX_OVERRUNS * report.ticks:
        problems = [*problems, "too slow: ticks skipped"]
    return problem_status("pace", problems, "on schedule", values)


def commands_status(drives, pushes, recent):
    """Return the status of commands and wrenches; `recent` are their counts since the last one."""
    values = {
        "drives": drives.phase,
        "brakes": "closed" if drives.braked else "open",
        **dict(sorted((drives.counts + pushes.counts).items())),
    }
    problems = []
    for kind, inputs in (("command", drives), ("wrench", pushes)):
        if inputs.last_rejection:
            values[f"last rejected {kind}"] = inputs.last_rejection
        if any(key in inputs.counts and "rejected" in key for key in recent):
            problems.append(f"rejected: {inputs.last_rejection}")
    if drives.phase == TIMED_OUT:
        problems.append(f"no command for command_timeout = {drives.timeout:g} s")
    return problem_status("commands", problems, drives.phase, values)


class SimulatorNode(TableNode, Node):
    """Simulate a robot under effort commands and publish its joint states.

    It stands in for a robot in the demo and in trials of controllers. Parameters are in
    :data:`~parameters.simulator.PARAMETERS`.
    """

    def __init__(self, **options):
        super().__init__(NODES["simulator"], PARAMETERS, **options)
        values = self.values
        if not values["robot_description"]:
            raise InputError(
                "parameter 'robot_description' is empty; expected a URDF or the path of one."
            )
        require_consistent(values)
        check_entries(values)
        self._keeps_time = values["lockstep"] or values["real_time_factor"] != 1.0
        self._plant = None
        self._lockstep = Lockstep()
        self._paused = False
        self._timeless = False
        self._failure = ""
        self._revision = 1  # of the model
        self._reported = Counter()  # counts of inputs at the last report
        judge(self, PARAMETERS, self._take_parameters)
        self._diagnostics = Diagnostics(
            self, self._report, lambda: self._plant and self._plant.simulation.model
        )
        self._loader = RobotLoader(self, self._make_plant, self._take_plant)
        self._loader.load(values["robot_description"], values)

    # --- The robot

    def _make_plant(self, description, values):
        """Return the URDF and the plant of a description; in a thread."""
        text = text_of(description)
        model = load_robot(self, text, values)
        plant = Plant(model, values)
        plant.simulation.dynamics.compile("evaluate", "gravity_torque", "nu_from_qd")
        plant.simulation.evaluate(plant.simulation.effort)
        return text.lstrip(), plant

    def _take_plant(self, result, _, loaded):
        """Publish, offer services and start time; or end the node if the robot cannot be made."""
        if isinstance(result, Exception):
            self.finished.set_exception(result)
            return
        text, self._plant = result
        if any(self.values[name] != loaded[name] for name in DYNAMIC):  # changed meanwhile
            self._apply(self.values)
        values = self.values
        model = self._plant.simulation.model
        self._lockstep.begin(self.time.steady())
        self._start = self._now()
        self._pace = Pace(
            values["real_time_factor"], 1.0 / values["rate"], self._plant.simulation.step_size
        )
        self._use(model)
        self._connect(text)
        self._offer_services()
        self._go_on()
        if values["lockstep"]:
            self.create_timer(COMMAND_TIMEOUT / 2, self._repeat, clock=steady_clock())
            self._measure_and_publish()
        else:
            factor = self._pace.factor
            period = 1.0 / (values["rate"] * factor) if factor else UNPACED
            self.create_timer(
                period, self._tick, clock=steady_clock() if self._keeps_time else None
            )
        text = f"{model.nv} degrees of freedom, motion '{values['motion']}', {values['rate']:g} Hz"
        self.log_info(f"Ready: robot '{model.name}', {text}.")

    def _use(self, model):
        self._maker = MessageMaker(model, self._revision)
        self._followers = Followers.of(model)

    def _connect(self, text):
        """Make publishers and subscriptions."""

        def publish(kind, topic, qos=None):
            return connected(self.create_publisher, kind, topic, qos or QoSProfile(depth=10))

        publish(String, "robot_description", latched()).publish(String(data=text))
        self._joint_states = publish(JointState, "joint_states")
        self._odometry = (
            publish(Odometry, "odom") if self._plant.simulation.model.floating_base else None
        )
        self._truth = publish(DiagonalizedState, "~/ground_truth")
        self._clock_out = publish(Clock, CLOCK) if self._keeps_time else None
        inputs = [
            (WrenchStamped, WRENCHES, self._take_wrench),
            (Float64MultiArray, COMMANDS, self._take_command),
        ]
        for kind, topic, take in inputs[: 1 if self.values["motion"] == "wave" else 2]:
            connected(self.create_subscription, kind, topic, take, QoSProfile(depth=10))

    def _offer_services(self):
        for kind, name, answer in (
            (SetBool, "pause", self._pause),
            (Trigger, "reset", self._reset),
            (SetState, "set_state", self._set_state),
        ):
            offer(self, kind, name, answer)

    # --- Time

    @property
    def _moving(self):
        return not self._paused and not self._failure

    def _now(self):
        """Return the time [ns] of the system if this node keeps simulated time, or of its clock."""
        return self.time.system() if self._keeps_time else self.time.now()

    def _go_on(self):
        """Continue simulated time from here."""
        self._timeless = not self._now()  # nothing on /clock yet
        self._pace.resume(1e-9 * self._now(), self._plant.time)
        if not self._keeps_time:  # stamps follow the clock from now
            self._start = self._now() - round(self._plant.time * 1e9)
        self._lockstep.resume(self.time.steady())

    def _tick(self):
        """Advance the simulation to now and publish its state."""
        if not self._moving:
            return
        if self._timeless:
            if not self._now():
                return
            self._go_on()
        before = self._pace.skipped
        steps = self._pace.steps(1e-9 * self._now(), self._plant.time)
        if not self._keeps_time:
            self._start += round((self._pace.skipped - before) * 1e9)
        if steps:
            self._advance(steps)

    def _advance(self, steps):
        """Take some steps and publish, or stop the simulation."""
        try:
            self._plant.advance(steps)
            self._measure_and_publish()
        except DiagDynamicsError as error:
            self._failure = shortened(str(error))

    def _repeat(self):
        """Publish time and the last joint state again in lockstep if their answer may be lost."""
        now = self.time.steady()
        receivers = self.get_subscriptions_info_by_topic(self._joint_states.topic_name)
        senders = self.get_publishers_info_by_topic(self.resolve_topic_name(COMMANDS))
        self._lockstep.meet({bytes(end.endpoint_gid) for end in (*receivers, *senders)}, now)
        if self._moving and self._lockstep.repeat(now):
            self._publish_time()
            self._joint_states.publish(self._last)

    def _answer(self):
        """Advance in lockstep if the last joint state has been answered."""
        if self.values["lockstep"] and self._moving and self._lockstep.answered(self.time.steady()):
            self._advance(round(1.0 / (self.values["rate"] * self._plant.simulation.step_size)))

    # --- Inputs

    def _take_command(self, message):
        try:
            self._plant.drives.command(message.data, self._plant.time)
        except RejectedError as error:
            self._lockstep.refuse()
            self.log_debug(f"rejected on {COMMANDS}: {error}")
            return
        self._lockstep.command(self.time.steady())
        self._answer()

    def _take_wrench(self, message):
        f = message.wrench.force
        n = message.wrench.torque
        try:
            self._plant.pushes.push(
                message.header.frame_id, (f.x, f.y, f.z, n.x, n.y, n.z), self._plant.time
            )
        except RejectedError as error:
            self.log_debug(f"rejected on {WRENCHES}: {error}")

    # --- Outputs

    @property
    def _stamp(self):
        """The time stamp of this moment [ns]."""
        return self._start + round(self._plant.time * 1e9)

    def _measure_and_publish(self):
        """Publish the time, measurements and the truth."""
        plant = self._plant
        stamp = self._stamp
        simulation = self._plant.simulation
        self._publish_time()
        measured = plant.measure()
        time = to_time(stamp)
        if measured.base is not None:
            self._odometry.publish(odometry_message(simulation.model.root_link, measured, time))
        self._lockstep.publish()
        self._last = joint_state_message(plant.names, measured, time)
        self._joint_states.publish(self._last)
        if self._truth.get_subscription_count():
            effort = simulation.with_spring_torques(simulation.effort)
            state = RobotState(simulation.q, simulation.qd, effort, stamp, stamp, False)
            self._truth.publish(self._maker.evaluated("state", simulation.evaluate(effort), state))

    def _publish_time(self):
        if self._clock_out:
            self._clock_out.publish(Clock(clock=to_time(self._stamp)))

    # --- Services

    def _pause(self, request, _):
        if request.data == self._paused:
            return "already paused" if self._paused else "not paused"
        self._paused = request.data
        if not self._paused:
            self._go_on()
            self._answer()  # which may have arrived meanwhile
        return "paused" if self._paused else "running"

    def _reset(self, *_):
        self._plant.reset()
        self._restart()

    def _set_state(self, request, _):
        q, qd, *_ = read_state(self._plant.simulation.model, request, self._followers)
        self._plant.put(q, qd)
        self._restart()

    def _restart(self):
        """Continue from another state."""
        if self._failure:  # the command or the push in force may have caused it
            self._plant.drives.forget()
            self._plant.pushes.forget()
        self._failure = ""
        self._plant.advance(0)
        self._go_on()
        if not self._timeless:
            self._measure_and_publish()

    # --- Parameters

    def _take_parameters(self, changed):
        """Continue with other payloads and gravity."""
        values = self.values | changed
        if self._plant and set(changed) & set(DYNAMIC):
            self._apply(values)
            self._revision += 1
            self._use(self._plant.simulation.model)
        self.values = values

    def _apply(self, values):
        """Change the payloads and the gravity of the plant."""
        model = with_payloads(self._plant.simulation.model, payloads_of(values["payloads"]))
        self._plant.simulation.change_model(model.with_gravity(values["gravity"]))

    # --- Diagnostics

    def _report(self):
        if self._plant is None:
            return [Status("simulation", STALE, "loading the robot")]
        lockstep = self.values["lockstep"]
        waits = lockstep and self._moving and self._lockstep.waits(self.time.steady())
        drives = self._plant.drives
        pushes = self._plant.pushes
        counts = drives.counts + pushes.counts
        recent = counts - self._reported
        self._reported = counts
        return [
            simulation_status(self._plant, self._paused, self._failure),
            pace_status(self._pace, lockstep, waits, *clock_notes(self, self._keeps_time)),
            commands_status(drives, pushes, recent),
        ]
