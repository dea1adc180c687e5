# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robot of the monitor: the model in force, the received state, and its energies."""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from diag_dynamics.description.urdf_text import folder_of
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.entries import assignments
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.joint_states.assembler import StateAssembler
from diag_dynamics.joint_states.odometry import OdometryBase
from diag_dynamics.joint_states.robot_joints import LinkPositions, RobotState, joints_of
from diag_dynamics.nodes.monitor.collisions import CollisionWatch, LoadWatch
from diag_dynamics.nodes.monitor.markers import MarkerMaker
from diag_dynamics.nodes.monitor.watches import WATCHES
from diag_dynamics.nodes.support.descriptions import compile_dynamics, text_of
from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.messages import EVALUATED, BytesMaker, MessageMaker
from diag_dynamics.nodes.support.statuses import ERROR, OK, STALE, WARN, Status
from diag_dynamics.parameters.shared import payloads_of
from diag_dynamics.recordings.joint_names import JointNames
from diag_dynamics.sweeps import evaluation, workspace

ASSUMED_NOISE = 0.1
"""Noise of m r in each joint without a calibrated covariance [N m, N].

It is that of good torque sensors.
"""

MIN_LOAD = 0.1
"""Gravity torque [N m, N] that a robot at rest cannot carry without efforts."""


class MonitoredRobot:
    """All that belongs to one description.

    It goes with the description, so that nothing of two robots is ever mixed.

    Parameters
    ----------
    description : str or bytes
        What the model was made of.
    model : RobotModel
    settings : Settings
    revision : int
        Number of the model.
    node : MonitorNode, optional
        What the watches publish and log by; without it they only accept states.

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
    source : str, bytes or file
        The description as it was when the robot was loaded.
    watches : tuple of Watch

    Raises
    ------
    InputError
        The settings name a joint that this robot has not.
    """

    def __init__(self, description, model, settings, revision, node=None):
        self.description = description
        self.source = _kept(description)
        in_header = settings.values["odom_twist_frame"] == "header"
        self.base = OdometryBase(model, in_header) if model.floating_base else None
        names = joint_names_of(settings.values)
        self.name_entries = names.entries if names else ()
        self.assembler = StateAssembler(
            joints_of(model), settings.inputs, self.base, names and names.map_name
        )
        self._links = LinkPositions(model)
        self.watches = tuple(kind(self, node) for kind in WATCHES)
        of_kind = {type(watch): watch for watch in self.watches}
        self.torque = of_kind[CollisionWatch]
        self.load = of_kind[LoadWatch]
        self.settings = self.dynamics = self.revision = self.state = self.position = None
        self.first_received = None  # steady time of the first joint state [s]
        self._moved = 0  # jumps of positions that the watches know of
        self._stands_still = False  # whether the last two states have the same positions
        self.use(model, settings, revision)
        compile_dynamics()
        self._compile()

    def _compile(self):
        """Compile what each message needs, or load it from the cache.

        A thread does this.
        """
        nothing = np.zeros(self.model.nv)
        state = RobotState(self.model.start, nothing, nothing, 0, 0, False)
        with suppress(
            DiagDynamicsError
        ):  # a robot of numbers that nothing can be computed with; each state will say so
            s, _ = self.evaluate(state)
            self.friction_power(s)
            self.messages(tuple(EVALUATED), s)
            if self.settings.observation:
                watch = CollisionWatch(self, None)
                watch.configure(self.dynamics, self.settings)
                watch.accept_state(state)
        self.forget()

    @property
    def model(self):
        """The model in force."""
        return self.dynamics.model

    def use(self, model, settings, revision):
        """Put the same robot in force with other settings or another gravity or payload.

        `model` has them already.

        Raises
        ------
        InputError
            The settings name a joint that this robot has not; nothing has changed then.
        """
        self.assembler.check_options(settings.inputs)
        is_new = self.dynamics is None or model is not self.model
        dynamics = DiagonalDynamics(model) if is_new else self.dynamics
        self._configure_watches(dynamics, settings)
        self.assembler.configure(settings.inputs)
        self.settings = settings
        if is_new:
            self.dynamics = dynamics
            self.revision = None
            self.state = None
            self.dynamics.compile("evaluate")  # also for groups, or the first state would wait
            resistance = (
                np.asarray(values, dtype=float)
                for values in (model.damping, model.friction, model.effort_offset)
            )
            self._resistance = *resistance, float(model.friction_velocity)
            geared = model.load_friction.any() or model.root_friction.any()
            self._geared = bool(geared or model.has_follower_friction)
        self._markers = None  # made when somebody first listens to them
        if revision != self.revision:
            self.revision = revision
            self.maker = MessageMaker(model, revision)
            self.encoder = BytesMaker(model, revision)

    def _configure_watches(self, dynamics, settings):
        """Configure all watches, or none if one of them raises InputError."""
        configured = []
        try:
            for watch in self.watches:
                watch.configure(dynamics, settings)
                configured.append(watch)
        except DiagDynamicsError:
            for watch in configured if self.settings else ():
                watch.configure(self.dynamics, self.settings)
            raise

    @property
    def judges_collisions(self):
        """Whether the last state had a result of the observer."""
        return self.torque.seen.valid

    @property
    def threshold_count(self):
        """Number of joints with a threshold of collisions."""
        observation = self.settings.observation
        if not observation:
            return 0
        return int(np.isfinite(observation.collision.of_names(self.model.dof_names)[:-2]).sum())

    def use_gravity(self, gravity):
        """Turn gravity [m/s²] in the axes of the root link.

        Neither watches nor messages restart.
        """
        self.dynamics = DiagonalDynamics(self.model.with_gravity(gravity))
        self.torque.use_gravity(self.dynamics)

    def effort_problem(self, commands):
        """Return why the efforts of the last state are not measured; empty if they may be.

        `commands` are EffortCommands.
        """
        state = self.state
        effort = state and (state.partial if state.effort is None else state.effort)
        if effort is None:
            return ""
        joints = slice(len(effort) - len(self.assembler.joint_names), None)
        effort = effort[joints]
        names = "0"
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
        """Return the statuses of all watches, and start their next intervals."""
        return [status for watch in self.watches for status in watch.report()]

    def unapplied(self):
        """Links of payloads that are wanted, but not on this robot."""
        payloads = payloads_of(self.settings.values["payloads"])
        return [
            link
            for link, payload in payloads.items()
            if payload.mass and link not in self.model.link_names
        ]

    def forget(self):
        """Start anew, as after a jump of time or a pause."""
        self.assembler.forget()
        self._forget_motion()
        self.state = None

    def _forget_motion(self):
        """Have nothing of before count, because no motion has led to the next state."""
        self._links.forget()
        for watch in self.watches:
            watch.forget()

    def evaluate(self, state):
        """Evaluation of a whole state, and that state with efforts that hold gravity."""
        if self.assembler.counts["positions jumped"] > self._moved:
            self._moved = self.assembler.counts["positions jumped"]
            self._forget_motion()
        if state.effort is not None:
            state = state._replace(effort=self._of_joints(state.effort, state.position))
        elif state.partial is not None:
            state = state._replace(partial=self._of_joints(state.partial, state.position))
        if self._links.has_any:
            state = self._of_links(state)
        before = self.state
        self.state = None
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
        without = self.assembler.efforts.without_gravity
        if without is None:
            return effort
        gravity = self.dynamics.gravity_torque(position)
        gravity[: len(gravity) - len(without)] = 0.0  # of a base, on which no effort acts
        gravity[len(gravity) - len(without) :] *= without
        return effort + gravity

    def wrench(self, frame):
        """Return the ExternalWrench at a link, without a load, at the last state.

        It is None without a result of the observer.
        """
        watch = self.torque
        values = self.settings.values
        if not watch.seen.is_whole:
            return None
        most = (
            values["external_wrench.max_force_deviation"],
            values["external_wrench.max_torque_deviation"],
        )
        torque = watch.contact_torque
        covariance = watch.covariance
        if covariance is None:  # without one J⁻ᵀτ̂ has no bound near a singularity
            covariance = ASSUMED_NOISE**2 * np.eye(self.model.nv)
        return self.dynamics.wrench(
            self.state.position, frame, torque, covariance, max_deviation=most
        )

    def friction_power(self, s):
        """Return the power q̇·τ_fric of friction [W] at an Evaluation."""
        if self._geared:
            q = s.rows[workspace.POSITIONS, : self.model.nq]
            qd = s.rows[workspace.RATES, : self.model.nv]
            return float(qd @ self.dynamics.friction_torque(qd, q))
        return evaluation.friction_power(s.rows, *self._resistance)

    def markers(self, s):
        """Markers of the last state, of which `s` is the evaluation, or what stands for it."""
        if self._markers is None:
            self._markers = MarkerMaker(self.dynamics)
        return self._markers.message(s, self.state, self.torque)

    def messages(self, topics, s):
        """Return the messages of topics about the last state, or their bytes.

        `s` is the evaluation of that state.
        """
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
    return JointNames(entries) if entries else None


class _Text(NamedTuple):
    """File of a description, with its text when the robot was loaded.

    Its meshes are found beside it. Later changes do not count.
    """

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
    suffix = "; loading another robot_description" if loading is not None else ""
    return Status("model", OK, f"robot '{robot.model.name}'{suffix}", values)
