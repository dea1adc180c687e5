# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Modes of a control loop: a law, its targets and its Lyapunov rate."""

import numpy as np

from diag_dynamics.checks import numbers, vector
from diag_dynamics.control.by_dof import beyond_limits, by_dof
from diag_dynamics.control.following import Following
from diag_dynamics.control.laws import (
    GravityCompensation,
    JointRegulation,
    JointTracking,
    PoseError,
    PoseRegulation,
    RateDamping,
    largest_frequency,
)
from diag_dynamics.control.references import PoseTarget, SetPoint, Trajectory, at_rest, nearest
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.rotations import to_vector
from diag_dynamics.text import distinct

LAWS = {}
"""Modes by name, in the order of their definition."""

MAX_WAIT = 10.0
"""Maximum time from the arrival of a trajectory to its start [s].

Meanwhile the robot approaches its first point.
"""

DEFAULT_SPEED = 1.0
"""Speed limit of joints without one in the URDF [rad/s, m/s]."""

MAX_STEP = 0.05
"""Maximum distance of a trajectory from the robot and from its target at the start [rad, m]."""

APPROACH_RATE = 10.0
"""Final decay rate of the distance to a pose or, in regulation, to a set-point [1/s]."""

NULL_FREQUENCY = 3.0
"""Frequency of the damping of slower modes and of the null space in pose regulation [rad/s]."""

POSE_SPEED = np.array([1.0, 2.0])
"""Speed of the motion to a pose at a set_point_speed of 1 [m/s, rad/s]."""

AT_REST = 1e-3
"""Largest speed of a desired motion that rests [rad/s, m/s]."""

ARRIVED, PATIENCE = 0.01, 2.0
"""Distance at which a target is reached [rad, m], and time until one that rests has to be [s]."""

FRICTION_ERROR, FRICTION_SHARE = 0.02, 0.5
"""Error at which springs overcome Coulomb friction [rad, m], and compensated fraction at rest."""

STIFFNESS_RATIO = 4.0
"""Stiffness of regulation relative to that of tracking."""

ROUNDS = 8
"""Bisections of the largest stable stiffness."""

MAX_OVERSPEED = 1.1
"""Maximum speed between the points of a trajectory, relative to the limit."""


class Mode:
    """Law in a control loop, with its targets. A subclass with a name is a mode of the controller.

    The constructors of subclasses take the dynamics and the values of
    parameters.controller.PARAMETERS. `shortfall` names a joint or link that has been away from its
    target for :data:`PATIENCE`; it is empty at the target, and while the target moves.
    """

    name = ""  # in the parameter initial_mode and the service ~/mode/<name>
    targets = ()  # topics of take_pose, take_trajectory and take_set_point
    desired = None  # motion of the last command, in the modes of joints
    stops_arm = True  # whether the law stops a moving arm without making a joint faster
    _moving = False  # whether the target of the last command moves, and V with it

    def __init_subclass__(cls):
        if cls.name:
            LAWS[cls.name] = cls

    def __init__(self, law, values):
        self.law = law
        self._model = law.dynamics.model
        self._max_period = values["max_state_age"]
        self._max_error = values["following_energy"] or np.inf
        limits = self._model.velocity_bound
        self.max_speed = np.where(np.isfinite(limits), limits, DEFAULT_SPEED)  # [rad/s, m/s]
        self._target = None
        self.stop()

    def stop(self):
        """Make the next state the target."""
        self.begun = False
        self._lag = 0.0  # V of the last command relative to following_energy
        self.desired = None
        self._away_since = None
        self.shortfall = ""
        self.forget_rate()

    def begin(self, state):
        """Make a state the target, if targets are void."""
        if not self.begun:
            self.begun = True
            self._stay(state)

    def _stay(self, state):
        """Make the position of a state the target."""

    def adapt(self, position, period):
        """Adapt automatic gains to a position [rad, m] and the measured period of states [s]."""

    def follow(self, state):
        """Return the command, and why the position replaced the target; empty if it did not."""
        command = self.command(state)
        self._watch_arrival(command, state.newest)
        return command, ""

    def _watch_arrival(self, command, time):
        """Set the shortfall of the command for a state at a time [ns]."""
        distance = self._describe_distance(command)
        if not distance:
            self._away_since = None
        elif self._away_since is None:
            self._away_since = time
        is_late = distance and (time - self._away_since) * 1e-9 > PATIENCE
        self.shortfall = distance if is_late else ""

    def _describe_distance(self, command):
        """Return a joint or link with its distance from a target that rests.

        The text is empty at the target.
        """
        return ""

    def command(self, state):
        """Return the command of the law for a state."""
        return self.law.command(state.position, state.velocity)

    def measured_rate(self, command, time):
        """Return dV/dt from the last command to this one at a time [ns].

        It is None unless both have the same target.
        """
        V = command.lyapunov
        last = self._last
        self._lag = V / self._max_error
        self._last = None if self._moving else (V, time)
        if last is None or time <= last[1]:
            return None
        return (V - last[0]) / ((time - last[1]) * 1e-9)

    def forget_rate(self):
        """Measure no rate from the last command to the next one."""
        self._last = None  # V and time of the last command for the present target


def _coulomb_friction(model, gravity_torque):
    """Return the Coulomb friction of the joints [N m, N], shape (nv,), under a gravity torque."""
    return model.friction + model.load_friction * np.abs(gravity_torque)


def _gains(dynamics, values, name):
    """Return the gains of a parameter by degree of freedom."""
    return by_dof(name, values[name], dynamics.model.dof_names)


class GravityCompensationMode(Mode):
    """Gravity compensation: the robot is guided by hand."""

    name = "gravity_compensation"
    stops_arm = False

    def __init__(self, dynamics, values):
        super().__init__(GravityCompensation(dynamics), values)


class DampingMode(Mode):
    """Damping: the robot is braked."""

    name = "damping"

    def __init__(self, dynamics, values):
        super().__init__(RateDamping(dynamics, _gains(dynamics, values, "damping")), values)


class PoseMode(Mode):
    """Pose regulation of a link.

    Its springs pull to a pose that moves to the target at bounded speed.
    """

    name = "pose"
    targets = ("target",)
    stops_arm = False

    def __init__(self, dynamics, values):
        law = PoseRegulation(
            dynamics,
            values["controlled_link"],
            None,
            values["position_stiffness"],
            values["orientation_stiffness"],
            damping_ratio=values["pose_damping_ratio"],
            null_frequency=NULL_FREQUENCY,
        )
        super().__init__(law, values)
        self._link = values["controlled_link"]
        self._speed = values["set_point_speed"] * POSE_SPEED
        self._aim = None  # position [m] and axes to which the springs pull

    def _stay(self, state):
        self._aim = self.law.pose(state.position)
        self._target = None
        self.law.aim(*self._aim)

    def take_pose(self, state, link, position, orientation):
        """Go to a position [m], shape (3,), and a rotation matrix in the axes of a link.

        The motion starts from a RobotState.
        """
        name = "target.pose.position"
        position = numbers(name, position, (3,), "three finite numbers [m]")
        X = self.law.dynamics.placement(state.position, link)
        self.begin(state)
        goal = (X[:3, :3] @ position + X[:3, 3], X[:3, :3] @ orientation)
        motion = self._speed, APPROACH_RATE, self._max_period
        self._target = PoseTarget(goal, state.newest, self._aim, *motion, self._target)
        self.forget_rate()

    def command(self, state):
        """Return the command towards the aim, with the error from the target."""
        target = self._target
        if target:
            self._aim = target.sample(state.newest, self._lag)
            self.law.aim(*self._aim)
        command = super().command(state)
        self._moving = target is not None and not target.arrived
        if not self._moving:
            self._target = None
            return command
        position, axes = self.law.pose(state.position)
        return command._replace(
            error=PoseError(target.goal[0] - position, to_vector(target.goal[1] @ axes.T))
        )

    def _describe_distance(self, command):
        distance, angle = (np.linalg.norm(error) for error in command.error)
        if self._moving or max(distance, angle) <= ARRIVED:
            return ""
        text = f"{distance:.3g} m" if distance > ARRIVED else f"{angle:.3g} rad"
        return f"link '{self._link}' is {text} from its target"


class JointMode(Mode):
    """Mode with set-points and trajectories, whose law follows a desired motion of the joints."""

    targets = ("joint_trajectory", "set_point")

    def __init__(self, law, approach, values):
        super().__init__(law, values)
        model = self._model
        self._approach = approach  # final decay rates of the distance to a set-point [1/s]
        self._speed = values["set_point_speed"] * self.max_speed
        self._continuous = np.isin(model.dof_names, model.continuous_joints)
        self._rubs = values["friction_compensation"] and model.has_friction

    def _stay(self, state):
        self.desired = at_rest(state.position)
        self._set_target(state.position, state)

    def _set_target(self, position, state):
        """Make a position the target, from the desired motion on."""
        start = self.desired.position
        moving = self.desired.velocity
        model = self._model
        room = np.where(moving > 0.0, model.upper - start, start - model.lower)
        motion = self.desired, self._speed, self._approach, self._continuous
        self._target = SetPoint(position, state.newest, *motion, self._max_period, room)
        self.forget_rate()

    def take_set_point(self, state, position):
        """Go to positions [rad, m], shape (nv,), within limits, from a RobotState on."""
        position = vector("set_point.position", position, self._model.dof_names)
        self._require_within_limits("set_point.position", position)
        self.begin(state)
        self._set_target(position, state)

    def take_trajectory(self, state, waypoints, stamp, now, tolerances):
        """Return the Following of Waypoints that start at a stamp [ns]; 0: with a RobotState."""
        trajectory = Trajectory(
            waypoints, self._model.dof_names, self._model.continuous_joints, stamp
        )
        self._require_within_limits("trajectory.points[{}].positions", trajectory.positions)
        if (wait := (stamp - now) * 1e-9) > MAX_WAIT:
            wait, limit = distinct(wait, MAX_WAIT)
            raise InputError(
                f"trajectory.header.stamp is {wait} s in the future; expected {limit} s at most."
            )
        if trajectory.ends_before(now):
            raise InputError("trajectory is over at its arrival; expected a later header.stamp.")
        self.begin(state)
        trajectory.begin(state.newest, self.desired.position, self.desired.velocity)
        self._require_near(trajectory.sample(state.newest).position, state)
        self._require_speed(trajectory)
        self._target = trajectory
        self.forget_rate()
        return Following(self._model.dof_names, trajectory, tolerances, self._continuous)

    def _require_within_limits(self, field, positions):
        """Reject positions, shape (..., nv), beyond limits.

        A robot would press on its stops there.
        """
        if beyond := beyond_limits(self._model, positions):
            row, text = beyond
            raise InputError(f"{field.format(row)} of {text}.")

    def _require_near(self, position, state):
        starts = np.array([state.position, self.desired.position])
        away = np.abs(nearest(position, starts, self._continuous) - starts).min(axis=0)
        k = int(np.argmax(away))
        if away[k] > MAX_STEP:
            joint = f"joint '{self._model.dof_names[k]}'"
            step, limit = distinct(away[k], MAX_STEP, digits=3)
            raise InputError(
                f"trajectory begins {step} from where {joint} is; expected at most {limit}."
            )

    def _require_speed(self, trajectory):
        fastest = trajectory.fastest().max(axis=0, initial=0.0)
        too_fast = np.flatnonzero(~(fastest <= MAX_OVERSPEED * self.max_speed))
        if len(too_fast):
            k = too_fast[0]
            joint = f"joint '{self._model.dof_names[k]}'"
            speed, limit = distinct(fastest[k], self.max_speed[k])
            raise InputError(
                f"trajectory has {joint} move at {speed}; expected at most {limit}: its velocity "
                f"limit, or {DEFAULT_SPEED:g} without one in the URDF."
            )

    def follow(self, state):
        """Return the command, and why the position replaced the target.

        The reason is that V exceeds following_energy.
        """
        command, _ = super().follow(state)
        if command.lyapunov <= self._max_error:
            return command, ""
        energy, limit = distinct(command.lyapunov, self._max_error, digits=3)
        lost = f"V is {energy} J; expected at most following_energy = {limit} J"
        self.stop()
        self.begin(state)
        return self.command(state), f"target given up: {lost}"

    def _describe_distance(self, command):
        distances = np.abs(command.error)
        if (np.abs(self.desired.velocity) > AT_REST).any() or (distances <= ARRIVED).all():
            return ""
        k = int(np.argmax(distances))
        unit = "m" if sliding_dofs(self._model)[k] else "rad"
        name = self._model.dof_names[k]
        return f"joint '{name}' is {distances[k]:.3g} {unit} from its target"

    def command(self, state):
        """Return the command towards the desired motion of now."""
        self.desired = self._target.sample(state.newest, self._lag)
        command = self.law.command(state.position, state.velocity, *self.desired)
        return self._with_friction(state.position, command) if self._rubs else command

    def _spring(self, error):
        """Return the effort of springs at an error, where friction is compensated at rest."""
        return np.zeros_like(error)

    def _with_friction(self, q, command):
        """Add the friction of the model at the desired velocity and, at rest, a part of it.

        At rest this is the spring once more, at most FRICTION_SHARE of Coulomb friction: it alone
        does not move a joint.
        """
        model = self._model
        velocity = self.desired.velocity
        moving = np.minimum(np.abs(velocity) / max(model.friction_velocity, AT_REST), 1.0)
        bound = FRICTION_SHARE * _coulomb_friction(model, command.gravity_torque)
        effort = self.law.dynamics.friction_torque(velocity, q)
        effort += (1.0 - moving) * np.clip(self._spring(command.error), -bound, bound)
        added = self.law.dynamics.epsilon_from_tau(q, effort)
        tau = command.tau + effort
        epsilon = command.epsilon + added
        return command._replace(tau=tau, epsilon=epsilon, friction=added)


class TrackingMode(JointMode):
    """Tracking of set-points and trajectories.

    It rejects disturbances within `tracking_bound`, which is off by default.
    """

    name = "tracking"

    def __init__(self, dynamics, values):
        gain, convergence = (
            _gains(dynamics, values, f"tracking_{name}") for name in ("gain", "convergence")
        )
        options = {"closing": dynamics.model.velocity_bound, "bound": values["tracking_bound"]}
        super().__init__(JointTracking(dynamics, gain, convergence, **options), convergence, values)


class RegulationMode(JointMode):
    """Joint springs with one damping ratio.

    Their stiffness is a multiple of that of tracking, T = Λ^½ m K mᵀ Λ^½, so that a load leaves
    less error, with equal Λ in each joint, and on its diagonal that which overcomes Coulomb
    friction at FRICTION_ERROR. No mode of both exceeds half of the stable stiffness, and none of T
    a fourth: the diagonal is at most ω²D, D the inertia of a joint while all others are free. A
    joint with a stiffness of its own is not coupled, and not in this bound.
    """

    name = "regulation"

    def __init__(self, dynamics, values):
        names = dynamics.model.dof_names
        automatic = np.full(len(names), np.inf)
        self._chosen = by_dof(
            "regulation_stiffness", values["regulation_stiffness"], names, automatic
        )
        self._gain, self._convergence = (
            np.sqrt(_gains(dynamics, values, f"tracking_{name}"))
            for name in ("gain", "convergence")
        )
        self._period = values["max_state_age"]
        law = JointRegulation(dynamics, 1.0, values["regulation_damping_ratio"])
        super().__init__(law, APPROACH_RATE, values)

    def _stay(self, state):
        super()._stay(state)
        self.adapt(state.position, self._period)

    def adapt(self, position, period):
        """Set the stiffness for a position [rad, m] and a period [s]."""
        self._period = period
        law = self.law
        m, inverse = law.dynamics.factors(position)[:2]
        root = np.sqrt(STIFFNESS_RATIO) * self._convergence[:, None] * m * self._gain
        friction = _coulomb_friction(self._model, law.dynamics.gravity_torque(position))
        largest = 0.5 * largest_frequency(law.damping_ratio, period) ** 2  # of ω²
        chosen = np.isfinite(self._chosen)
        root[chosen] = friction[chosen] = 0.0
        stiffness = _stable_stiffness(inverse, root, friction / FRICTION_ERROR, largest)
        stiffness[chosen, chosen] = self._chosen[chosen]
        if not np.array_equal(stiffness, law.stiffness):
            law.stiffness = stiffness
            self.forget_rate()  # V of the last state has the stiffness from before

    def _spring(self, error):
        return self.law.stiffness @ error


def _stable_stiffness(inverse, root, single, largest):
    """Return the stiffness root rootᵀ + min(k, ω²D) of joint springs, by ℓ; k are those of joints.

    No mode exceeds the square `largest` of a frequency [1/s²]. D are the inertias of single joints,
    so that springs give way where they are stiff for their inertia.
    """
    fastest = np.linalg.norm(inverse @ root, 2) ** 2
    allowed = 0.5 * largest
    coupled = allowed / max(fastest, allowed) * root @ root.T
    inertia = 1.0 / np.square(inverse).sum(axis=0)
    low = 0.0
    high = largest
    square = largest
    for _ in range(ROUNDS):
        stiffness = coupled + np.diag(np.minimum(single, square * inertia))
        if np.linalg.norm(inverse @ stiffness @ inverse.T, 2) > largest:
            high = square
        else:
            low = square
        square = 0.5 * (low + high)
    return coupled + np.diag(np.minimum(single, low * inertia))


GRAVITY_COMPENSATION = GravityCompensationMode.name
DAMPING = DampingMode.name
POSE = PoseMode.name
TRACKING = TrackingMode.name
REGULATION = RegulationMode.name
