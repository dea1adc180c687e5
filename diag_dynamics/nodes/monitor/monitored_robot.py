# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot as the monitor keeps it: the model in force, what has arrived of its state, and its energies."""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from diag_dynamics.description.text import folder_of
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.entries import assignments
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.inspection.motion import too_quick
from diag_dynamics.joint_states.assembler import StateAssembler
from diag_dynamics.joint_states.joints import LinkPositions, RobotState, joints_of
from diag_dynamics.joint_states.odometry import OdometryBase
from diag_dynamics.nodes.monitor.external_torque import TorqueWatch, check_load_link
from diag_dynamics.nodes.monitor.markers import MarkerMaker
from diag_dynamics.nodes.monitor.watches import ContactLimitsWatch, EnergyWatch, LoopWatch
from diag_dynamics.nodes.support.descriptions import compile_dynamics, text_of
from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.messages import EVALUATED, BytesMaker, MessageMaker
from diag_dynamics.nodes.support.statuses import ERROR, OK, STALE, WARN, Status
from diag_dynamics.parameters.contact_limits import contact_points
from diag_dynamics.parameters.shared import payloads_of
from diag_dynamics.recordings.joint_names import JointNames
from diag_dynamics.sweeps import evaluation, workspace

ASSUMED_NOISE = 0.1
"""Noise of m r in each joint without a calibrated covariance, as of good torque sensors [N m, N]."""

POSES = 20
"""Poses in which a joint's largest D is looked for: it changes little."""

MIN_LOAD = 0.1
"""Gravity torque [N m, N] that a robot at rest cannot carry without efforts."""


class MonitoredRobot:
    """All that belongs to one description and goes with it, so that nothing of two robots is ever mixed.

    Parameters
    ----------
    description : str or bytes
        What the model was made of.
    model : RobotModel
    settings : Settings
    revision : int
        Number of the model.

    Attributes
    ----------
    revision : int
    dynamics : DiagonalDynamics
    maker : MessageMaker
        For services.
    encoder : BytesMaker
        For topics.
    assembler : StateAssembler
    base : OdometryBase or None
    state : RobotState or None
        The last one, which was evaluated; None if it could not be, or all has been forgotten since.
    energy : EnergyWatch
    torque : TorqueWatch or None
        What observes external torque, if it is wanted.
    contact_limits : ContactLimitsWatch
    without_rotors : tuple of str
        Joints whose D is so far below what their effort limits suggest that their rotors' inertia
        must be missing.

    Raises
    ------
    InputError
        The settings name a joint that this robot has not.
    """

    def __init__(self, description, model, settings, revision):
        self.description, self._source = description, _kept(description)
        in_header = settings.values["odom_twist_frame"] == "header"
        self.base = OdometryBase(model, in_header) if model.floating_base else None
        names = joint_names_of(settings.values)
        self.name_entries = names.entries if names else ()
        self.assembler = StateAssembler(
            joints_of(model), settings.inputs, self.base, names and names.map_name
        )
        self._links = LinkPositions(model)
        self.energy = EnergyWatch(model, settings.thresholds)
        self.contact_limits = ContactLimitsWatch()
        self.settings = self.dynamics = self.revision = self.torque = self.state = self.position = (
            None
        )
        self.first_received = None  # steady time of the first joint state [s]
        self._moved = 0  # jumps of positions that the watches know of
        self._stands_still = False  # whether the last two states have the same positions
        self.use(model, settings, revision)
        compile_dynamics()
        self._compile()

    def _compile(self):
        """Compile what each message needs, or load it from the cache: here, as this is done in a thread."""
        nothing = np.zeros(self.model.nv)
        state = RobotState(self.model.start, nothing, nothing, 0, 0, False)
        with suppress(
            DiagDynamicsError
        ):  # a robot of numbers that nothing can be computed with; each state will say so
            s, _ = self.evaluate(state)
            self.friction_power(s)
            self.messages(tuple(EVALUATED), s)
            if self.torque:
                link = self.settings.values["load.link"]
                TorqueWatch(self.dynamics, self.settings.observation, link).accept_state(state)
        self.forget()

    @property
    def model(self):
        """The model in force."""
        return self.dynamics.model

    def use(self, model, settings, revision):
        """Put the same robot in force with other settings or another gravity or payload; `model` is as it shall be.

        Raises
        ------
        InputError
            The settings name a joint that this robot has not; nothing has changed then.
        """
        self.assembler.check_options(settings.inputs)
        link = settings.values["markers.link"]
        if link and link not in model.link_names:
            raise InputError(
                f"parameter 'markers.link' is '{link}', expected a link of robot '{model.name}'."
            )
        moved = {name for name in model.link_names if model.placement_in_body(name)[0]}
        if wrong := [frame for frame in settings.frames if frame not in moved]:
            raise InputError(
                f"parameter 'external_wrench.frames' has '{wrong[0]}', expected links of robot '{model.name}' that a joint "
                "moves."
            )
        check_load_link(model, settings.values["load.link"])
        if settings.observation:
            settings.observation.collision.of_names(model.dof_names)
            settings.observation.contact.of_names(model.dof_names, "contact.threshold")
            settings.observation.covariance_of(model.dof_names)
        others = (
            self.dynamics is None
            or model is not self.model
            or settings.contact_limits != self.settings.contact_limits
        )
        touched = contact_points(model, self._source, settings.contact_limits) if others else None
        self.energy.configure(model, settings.thresholds)
        self.assembler.configure(settings.inputs)
        before, self.settings = self.settings, settings
        if self.dynamics is None or model is not self.model:
            self.dynamics, self.revision, self.state = DiagonalDynamics(model), None, None
            self.dynamics.compile("evaluate")  # also for groups, or the first state would wait
            self.without_rotors = _without_rotors(self.dynamics)
            resistance = (
                np.asarray(one, dtype=float)
                for one in (model.damping, model.friction, model.effort_offset)
            )
            self._resistance = *resistance, float(model.friction_velocity)
            geared = model.load_friction.any() or model.root_friction.any() or model.couplings
            self.loops = LoopWatch(model) if model.loops else None
            self._geared = bool(geared or model.has_follower_friction)
        if settings.frames:
            self.dynamics.compile("wrench")
        if settings.observation and settings.observation.covariance:
            self.dynamics.compile("touched_link", "wrench")  # wrench: of markers
        self.contact_limits.use(self.dynamics, settings, touched)
        self._markers = None  # made when somebody first listens to them
        if revision != self.revision:
            self.revision = revision
            self.maker = MessageMaker(model, revision)
            self.encoder = BytesMaker(model, revision)
        self._observe(before)

    def _observe(self, before):
        """Restart the observer of external torque if model, parameters or input options changed."""
        wanted, settings, link = (
            self.settings.observation,
            self.settings,
            self.settings.values["load.link"],
        )
        if wanted is None:
            self.torque = None
        elif self.torque is None:
            self.torque = TorqueWatch(self.dynamics, wanted, link)
        else:
            now, earlier = (
                (one.observation, _values_by(one.inputs), one.values["load.link"])
                for one in (settings, before)
            )
            if (self.dynamics, *now) != (self.torque.dynamics, *earlier):
                self.torque.use(self.dynamics, wanted, link)

    def use_gravity(self, gravity):
        """Turn gravity [m/s²] in the axes of the root link; neither watches nor messages restart."""
        self.dynamics = DiagonalDynamics(self.model.with_gravity(gravity))
        if self.torque:
            self.torque.use_gravity(self.dynamics)

    def torque_report(self):
        """Status of external torque, where it is observed."""
        return self.torque.report(self.assembler.without_effort)

    def effort_problem(self, commands):
        """Return why the efforts of the last state are not measured; empty if they may be.

        `commands` are EffortCommands.
        """
        state = self.state
        effort = state and (state.partial if state.effort is None else state.effort)
        if effort is None:
            return ""
        joints = slice(len(effort) - len(self.assembler.joint_names), None)
        effort, names = effort[joints], "0"
        if effort[~np.isnan(effort)].any():
            names = "commands"
            if not (self._stands_still and commands.repeated_by(effort)):
                return ""
        excess = effort - self.dynamics.gravity_torque(state.position)[joints]
        load = np.nan_to_num(np.abs(excess)).max(initial=0.0)
        if load <= MIN_LOAD:
            return ""
        return (
            f"all efforts are {names}, but gravity requires others: the brakes hold the robot, or "
            "the driver does not measure efforts (effort_available)"
        )

    def report(self):
        """Return the statuses of what watches states, and begin the next interval."""
        statuses = [self.energy.report()]
        self.energy.start_interval()
        if self.torque:
            statuses.append(self.torque_report())
            statuses += [self.torque.load.report()] if self.torque.load else []
            self.torque.start_interval()
        if self.loops:
            statuses.append(self.loops.report(self.state, self.assembler.follower_rates))
        if self.contact_limits.has_limits:
            statuses.append(self.contact_limits.report())
            self.contact_limits.start_interval()
        return statuses

    def unapplied(self):
        """Links of payloads that are wanted, but not on this robot."""
        wanted = payloads_of(self.settings.values["payloads"])
        return [
            link
            for link, payload in wanted.items()
            if payload.mass and link not in self.model.link_names
        ]

    def forget(self):
        """Start anew, as after a jump of time or a pause."""
        self.assembler.forget()
        self.energy.forget()
        if self.torque:
            self.torque.forget()
        self.contact_limits.forget()
        self._links.forget()
        self.state = None

    def evaluate(self, state):
        """Evaluation of a whole state, and that state with efforts that hold gravity."""
        if self.assembler.counts["positions jumped"] > self._moved:  # no motion has led here
            self._moved = self.assembler.counts["positions jumped"]
            self.energy.forget()
            self._links.forget()
            if self.torque:
                self.torque.forget()
        if state.effort is not None:
            state = state._replace(effort=self._of_joints(state.effort, state.position))
        elif state.partial is not None:
            state = state._replace(partial=self._of_joints(state.partial, state.position))
        if self._links.has_any:
            state = self._of_links(state)
        before, self.state = self.state, None
        self._stands_still = before is not None and np.array_equal(before.position, state.position)
        friction = self.settings.values["publish_friction"]
        s = self.dynamics.evaluate(state.position, state.velocity, state.effort, friction=friction)
        self.state = state
        return s, state

    def _of_links(self, state):
        """Return a state with the links' positions and rates."""
        effort = state.partial if state.effort is None else state.effort
        effort = np.full(self.model.nv, np.nan) if effort is None else effort
        stamp = np.array([state.newest])
        q, qd = self._links.convert(
            stamp, state.position[None], state.velocity[None], effort[None], [False]
        )
        return state._replace(position=q[0], velocity=qd[0])

    def _of_joints(self, effort, position):
        """Return efforts of joints with gravity."""
        effort, without = self.model.joint_efforts(effort), self.assembler.efforts.without_gravity
        if without is None:
            return effort
        gravity = self.dynamics.gravity_torque(position)
        gravity[: len(gravity) - len(without)] = 0.0  # of a base, on which no effort acts
        gravity[len(gravity) - len(without) :] *= without
        return effort + gravity

    def wrench(self, frame):
        """Return the ExternalWrench at a link, without a load, at the last state; None without a result of the observer."""
        watch, values = self.torque, self.settings.values
        if not watch.seen.is_whole:
            return None
        most = (
            values["external_wrench.max_force_deviation"],
            values["external_wrench.max_torque_deviation"],
        )
        torque, covariance = watch.contact_torque, watch.covariance
        if covariance is None:  # without one J⁻ᵀτ̂ has no bound near a singularity
            covariance = ASSUMED_NOISE**2 * np.eye(self.model.nv)
        return self.dynamics.wrench(
            self.state.position, frame, torque, covariance, max_deviation=most
        )

    def friction_power(self, s):
        """Return the power q̇·τ_fric of friction [W] at an Evaluation."""
        if self._geared:
            q, qd = (
                s.rows[workspace.POSITIONS, : self.model.nq],
                s.rows[workspace.RATES, : self.model.nv],
            )
            return float(qd @ self.dynamics.friction_torque(qd, q))
        return evaluation.friction_power(s.rows, *self._resistance)

    def markers(self, s):
        """Markers of the last state, of which `s` is the evaluation, or what stands for it."""
        if self._markers is None:
            self._markers = MarkerMaker(
                self.dynamics, self._source, self.settings.values["markers.link"]
            )
        return self._markers.message(s, self.state, self.torque)

    def messages(self, topics, s):
        """Return the messages of topics about the last state, or their bytes; `s` is the evaluation of that state."""
        with_inverse = self.settings.values["publish_inverse_factor"]
        return [
            self.encoder.evaluated(topic, s, self.state)
            if topic in EVALUATED
            else self.encoder.matrix(topic, self.dynamics, self.state, with_inverse)
            for topic in topics
        ]


def joint_names_of(values):
    """Return the JointNames of the parameter `joint_names`; None without entries."""
    entries = assignments("joint_names", values["joint_names"], kind=str)
    return JointNames(entries, "parameter 'joint_names'") if entries else None


def _values_by(options):
    """Return the options of joint states without those that change no values."""
    return options._replace(stuck_timeout=0.0)


def _without_rotors(dynamics):
    """Names of joints that move nearly nothing, over poses by chance that are the same each time."""
    model, rng = dynamics.model, np.random.default_rng(0)
    if not model.nv:
        return ()
    still = np.zeros(model.nv)
    with suppress(
        DiagDynamicsError
    ):  # a robot of numbers that nothing can be computed with; each state will say so
        D = np.array(
            [dynamics.evaluate(model.random(rng), still).articulated_inertia for _ in range(POSES)]
        )
        return tuple(name for name in too_quick(model, D) if name not in model.flexible_joints)
    return ()


class _Text(NamedTuple):
    """A file that was read when the robot was loaded: its meshes are found beside it, and later changes do not count."""

    text: str
    name: str

    def read(self, _=-1):
        return self.text


def _kept(description):
    """Return a description, or the text of one that is a path."""
    folder = folder_of(description)
    return (
        description if folder is None else _Text(text_of(description), str(folder / "robot.urdf"))
    )


class Refused(NamedTuple):
    """A description that is not in force, and why."""

    description: bytes
    reason: str


def model_status(robot, revision, refused, loading):
    """Return the status of the model.

    Parameters
    ----------
    robot : MonitoredRobot or None
        In force.
    revision : int
        Of the last model.
    refused : Refused or None
    loading : str, bytes or None
        The description that is being loaded.
    """
    values = {"model revision": revision}
    values["loading"] = (
        "nothing" if loading is None else f"a robot_description of {len(loading)} bytes"
    )
    if robot:
        model = robot.model
        values |= {
            "robot": model.name,
            "degrees of freedom": model.nv,
            "total mass [kg]": f"{model.total_mass:.6g}",
            "mimic joints": counted((*model.mimics, *model.followers)),
            "locked joints": counted(model.locked_joints),
            "payloads": counted(model.payloads),
            "topics serialized by rclpy": counted(sorted(robot.encoder.unlike)),
            "joints that may lack rotor inertia": counted(robot.without_rotors),
        }
        if model.flexible_joints:
            rigid = [
                name for name, joint in model.flexible_joints.items() if joint.effort == "motor"
            ]
            values["flexible joints taken as rigid"] = counted(rigid)
    if refused:
        return Status("model", ERROR, f"robot_description rejected: {refused.reason}", values)
    if robot is None and loading is not None:
        return Status("model", STALE, "loading the robot_description", values)
    if robot is None:
        text = "waiting for the robot_description"
        return Status("model", WARN, text, values, is_logged=True)
    if unapplied := robot.unapplied():
        return Status("model", WARN, f"payloads on unknown links: {', '.join(unapplied)}", values)
    another = "; loading another robot_description" if loading is not None else ""
    return Status("model", OK, f"robot '{robot.model.name}'{another}", values)
