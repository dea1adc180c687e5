"""One cycle of control after the other: from a state, or the want of one, to efforts."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control import (
    Command,
    GravityCompensation,
    JointTracking,
    PoseError,
    PoseRegulation,
    RateDamping,
)
from diag_dynamics.control.by_dof import by_dof
from diag_dynamics.control.filters import Efforts
from diag_dynamics.control.modes import DAMPING, GRAVITY_COMPENSATION, MODES, POSE, TRACKING
from diag_dynamics.control.observer import DisturbanceObserver
from diag_dynamics.control.pose import rotation_vector
from diag_dynamics.control.references import PoseTarget, SetPoint, at_rest, nearest
from diag_dynamics.control.supervisor import ACTIVE, HOLDING, INACTIVE, RAMPING_DOWN, Supervisor
from diag_dynamics.control.targets import aimed, require_within
from diag_dynamics.control.trajectory import Trajectory
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError

LONGEST_WAIT = 10.0
"""How long before its stamp a trajectory may come [s]: until then the robot goes towards its first point."""

BEYOND = 0.05
"""How far outside of its limits a joint may be where a law begins [rad, m]: at a stop, as its encoder sees it."""

SPEED = 1.0
"""Of a joint of which nobody says how fast it may be [rad/s, m/s]."""

SLOW = 0.1
"""Part of its highest speed at which a robot may move when a law takes it up."""

PATIENCE = 1.0
"""How long it is waited for that, once efforts carry it [s]: by a load that is not known it may sink for ever."""

STEP = 0.05
"""How far from the robot's place, and from where it should be, a trajectory may begin, or go on after a hold [rad, m]."""

APPROACH = 10.0
"""Rate at which the way to a pose decays in the end [1/s]."""

OVERSPEED = 1.1
"""How much faster than its limit a joint may be between the points of a trajectory."""


class Sent(NamedTuple):
    """What one cycle sends, and why.

    Attributes
    ----------
    effort : ndarray, shape (nv,)
        As sent, after every limit [N m, N], in the robot's order; without gravity if the robot adds that itself.
    saturated : tuple of str
        Joints whose effort or effort rate was limited.
    stamp : int
        Of the state the command was computed from [ns]; of the last one while there is none.
    age : float
        That state's age [s].
    command : Command or None
        What the law and the energy limiter asked for; None without a valid state.
    energy_limited : bool
        Whether the energy limiter took power out of it.
    lyapunov_rate : float or None
        dV/dt from this state and the one before [W]; None where there is no such one for the same target.
    lost : str
        Why the target was given up for the robot's position; empty if it was not.
    """

    effort: np.ndarray
    saturated: tuple
    stamp: int
    age: float
    command: Command | None = None
    energy_limited: bool = False
    lyapunov_rate: float | None = None
    lost: str = ""


class ControlLoop:
    """Laws, filters and safety for one robot: what the controller node runs, in anybody's loop.

    Parameters
    ----------
    model : RobotModel
    values : dict
        Values of settings.PARAMETERS.
    compensated : bool
        Whether the robot adds what carries its weight to what it is sent.

    Attributes
    ----------
    dynamics : DiagonalDynamics
    supervisor : Supervisor
    mode : str
        The law in force.
    taking_up : bool
        Whether the robot is only damped yet, until efforts carry it.
    state : RobotState or None
        The last valid one.
    energy : float
        Its kinetic energy [J].
    efforts : Efforts

    Raises
    ------
    InputError, UnsupportedError
        The values do not fit the robot; or it has an unactuated base.
    """

    def __init__(self, model, values, compensated):
        names = model.dof_names
        self.dynamics = dynamics = DiagonalDynamics(model)
        self.efforts = Efforts(dynamics, values, compensated)
        self._fastest = np.where(model.velocity_limit > 0.0, model.velocity_limit, np.inf)
        self._laws = {
            GRAVITY_COMPENSATION: GravityCompensation(dynamics),
            DAMPING: RateDamping(dynamics, by_dof("damping", values["damping"], names)),
            TRACKING: JointTracking(
                dynamics,
                by_dof("tracking_gain", values["tracking_gain"], names),
                by_dof("tracking_convergence", values["tracking_convergence"], names),
                self._fastest,
            ),
        }
        self._highest = np.where(np.isfinite(self._fastest), self._fastest, SPEED)
        self._speed = values["set_point_speed"] * self._highest
        self._turns = np.array([name in model.continuous_joints for name in names])
        self._pose_speed = np.array([values["position_speed"], values["orientation_speed"]])
        self._most_behind = values["following_energy"] or np.inf
        if values["controlled_link"]:
            self._laws[POSE] = PoseRegulation(
                dynamics,
                values["controlled_link"],
                by_dof("pose_damping", values["pose_damping"], names),
                values["position_stiffness"],
                values["orientation_stiffness"],
            )
        gain = values["observer_gain"]
        self._observer = DisturbanceObserver(dynamics, gain, np.inf, effort="held") if gain else None
        if values["hold_time"] < 2.0 * values["max_state_age"]:
            raise InputError(
                f"parameter 'hold_time' is {values['hold_time']:g} s, expected at least twice max_state_age = "
                f"{values['max_state_age']:g} s: a single state that fails would let the robot go."
            )
        self.supervisor = Supervisor(values["max_state_age"], values["hold_time"], values["resume_after_ramp"])
        self._initial_mode = values["initial_mode"]
        self._require_law(self._initial_mode)
        self.forget()

    def forget(self):
        """Begin anew with the next valid state, in the initial mode.

        Efforts go on from what was sent last, as far as that carries the robot: it may have been moved meanwhile.
        """
        self.supervisor.forget()
        self.mode = self._initial_mode
        self.state = None
        self.efforts.begin()
        self._origin = None  # time of the first state [ns]
        self.taking_up, self._carried = True, None  # and since when efforts carry the robot meanwhile [ns]
        self.energy = 0.0
        self._void()

    def _void(self):
        """Have targets begin at the next state."""
        self._target, self._to_begin = None, True
        self._no_rate()

        self._behind = 0.0

    def _no_rate(self):
        self._lyapunov = None

    # --- Modes and targets ---

    def _require_law(self, mode):
        if mode not in MODES:
            raise InputError(f"mode is '{mode}', expected one of {', '.join(MODES)}.")
        if mode not in self._laws:
            raise InputError("parameter 'controlled_link' is empty: there is no pose to regulate.")

    def switch(self, mode):
        """Put another law in force, from the next state on, with that state as its target.

        Efforts stay continuous: they go to those of the law at the effort rate. A robot that was given up is taken up again.

        Raises
        ------
        InputError
            There is no such law, or no valid state to take the robot up again.
        """
        self._require_law(mode)
        self.supervisor.release()
        self.mode = mode
        self._void()

    def _require(self, mode, what):
        if self.mode != mode:
            raise InputError(f"{what} is for mode {mode}, but {self.mode} is in force.")
        if self.supervisor.phase != ACTIVE:
            raise InputError(f"{what} comes while the law is not in force: {self.supervisor.reason}.")
        if self.taking_up:
            raise InputError(f"{what} comes while the robot is taken up: it is damped until efforts carry it.")

    def take_pose(self, link, position, orientation):
        """Go to a pose; see :func:`aimed` and :class:`PoseTarget`. It replaces the target before.

        Parameters
        ----------
        link : str
            In whose axes, from whose origin it is.
        position : array_like, shape (3,)
            [m].
        orientation : array_like, shape (4,) or (3, 3)
            Unit quaternion x y z w, or rotation matrix.

        Raises
        ------
        InputError
            It is no valid pose, or poses are not regulated now.
        """
        self._require(POSE, "target")
        target = aimed(link, position, orientation, self.dynamics, self.state.position)
        self._begin()
        speed, rate = self._pose_speed, np.full(2, APPROACH)
        self._target = PoseTarget(
            target, self.state.newest, self._aim, speed, rate, self.supervisor.max_age, self._target
        )
        self._no_rate()

    def take_trajectory(self, waypoints, stamp, now):
        """Follow a trajectory from where the robot should be; see :class:`Trajectory`. It replaces the target before.

        Parameters
        ----------
        waypoints : Waypoints
        stamp : int
            When it starts [ns]; 0: with the last state.
        now : int
            The time [ns].

        Raises
        ------
        InputError
            It is no valid trajectory, beyond a position or velocity limit, or over by now; or joints are not tracked now.
        """
        self._require(TRACKING, "trajectory")
        model = self.dynamics.model
        trajectory = Trajectory(waypoints, model.dof_names, model.continuous_joints, stamp)
        require_within("trajectory.points[{}].positions", trajectory.positions, model)
        wait = (trajectory.stamp - now) * 1e-9
        if wait > LONGEST_WAIT:
            raise InputError(
                f"trajectory.header.stamp is {wait:.6g} s in the future, expected no more than {LONGEST_WAIT:g} s."
            )
        if trajectory.ends_before(now):
            raise InputError("trajectory.header.stamp is so long ago that the trajectory is over.")
        self._begin()
        trajectory.begin(self.state.newest, self._desired.position, self._desired.velocity)
        self._require_near(trajectory.sample(self.state.newest).position)
        self._require_speed(trajectory)
        self._target = trajectory
        self._no_rate()

    def _way(self, there, here):
        """From one position to another [rad, m], the shorter way where joints turn round."""
        return nearest(there, here, self._turns) - here

    def _require_near(self, position):
        away = [np.abs(self._way(position, place)) for place in (self.state.position, self._desired.position)]
        away = np.minimum(*away)
        if (away > STEP).any():
            k = int(np.argmax(away))
            raise InputError(
                f"trajectory begins {away[k]:.3g} from where joint '{self.dynamics.model.dof_names[k]}' is and should be, "
                f"expected no more than {STEP:g}."
            )

    def _require_speed(self, trajectory):
        fastest = trajectory.fastest().max(axis=0, initial=0.0)
        beyond = ~(fastest <= OVERSPEED * self._highest) | ~np.isfinite(fastest)
        if beyond.any():
            k = int(np.argmax(beyond))
            limit = f"its limit {self._highest[k]:g}"
            if np.isinf(self._fastest[k]):
                limit = f"{self._highest[k]:g}, as the URDF has no velocity limit for it"
            raise InputError(
                f"trajectory has joint '{self.dynamics.model.dof_names[k]}' move at {fastest[k]:.6g}, expected no more than "
                f"{limit}."
            )

    def take_set_point(self, position):
        """Go to positions; see :class:`SetPoint`. They replace the target before.

        Parameters
        ----------
        position : ndarray, shape (nv,)
            [rad, m].

        Raises
        ------
        InputError
            It is no valid set-point or beyond a position limit, or joints are not tracked now.
        """
        self._require(TRACKING, "set_point")
        require_within("set_point.position", position, self.dynamics.model)
        self._begin()
        self._target = self._to(position)
        self._no_rate()

    def _to(self, position):
        rate = self._laws[TRACKING].convergence
        longest, model = self.supervisor.max_age, self.dynamics.model
        here, moving = self._desired.position, self._desired.velocity
        room = np.where(moving > 0.0, model.upper - here, here - model.lower)
        return SetPoint(position, self.state.newest, self._desired, self._speed, rate, self._turns, longest, room)

    def _begin(self):
        """Take the state as it is for the target, unless that has been done."""
        if not self._to_begin:
            return
        self._to_begin = False
        q = self.state.position
        self._desired = at_rest(q)
        self._target = self._to(q)
        if self.mode == POSE:
            self._aim, self._target = self._laws[POSE].pose(q), None
            self._laws[POSE].aim(*self._aim)

    # --- Cycles ---

    def step(self, state, now):
        """The command for a state that has come at the time `now` [ns]; None before the first valid one.

        Parameters
        ----------
        state : RobotState
        now : int
        """
        if problem := self.age_problem(state, now):
            return self.without_state(now, problem)
        if self.supervisor.latched:
            return self._idle(state, now)
        if self.supervisor.anew:
            if problem := self._outside(state.position):
                return self.without_state(now, problem)
            self.taking_up, self._carried = True, None
        held = self.supervisor.phase == HOLDING
        if self.supervisor.anew or not self._follows(state):
            self._void()
        before, self.state = self.state, state
        self._begin()
        external = self._observed(state)
        q, qd = state.position, state.velocity
        if self.taking_up:
            command, lost = self._take_up(state, before, external), ""
        if not self.taking_up:
            command, lost = self._followed(state, held)
        self.energy = 0.5 * float(command.nu @ command.nu)
        rate = None if self.taking_up else self._measured_rate(before, state, command)
        filtered = self.efforts.filtered(q, qd, command, external)
        effort, waited = self.efforts.ramped(filtered.effort, state.newest)
        at_limit = filtered.command.limited
        late = tuple(name for name in waited if name not in at_limit)
        self.supervisor.valid(now)  # not before there is a command: a law that fails is no reason to hold for ever
        age, energy_limited = self._age(now), filtered.energy_limited
        return Sent(effort, at_limit + late, state.newest, age, filtered.command, energy_limited, rate, lost)

    def _outside(self, q):
        """What is wrong about positions outside of their limits, None if nothing is: springs would throw such a joint."""
        model = self.dynamics.model
        beyond = (q < model.lower - BEYOND) | (q > model.upper + BEYOND)
        if not beyond.any():
            return None
        k = int(np.argmax(beyond))
        return (
            f"joint '{model.dof_names[k]}' is at {q[k]:.6g}, outside of its limits {model.lower[k]:g} … {model.upper[k]:g}: "
            "no law begins there"
        )

    def _take_up(self, state, before, external):
        """What damps a robot until efforts carry it and it is slow; then the law may begin, this state its target."""
        q, qd = state.position, state.velocity
        command = self._laws[DAMPING].command(q, qd)._replace(error=None)
        asked = self.efforts.filtered(q, qd, command, external).effort
        if before is None:
            self.efforts.carry_on()
        if self._carried is None and self.efforts.carry(asked, state.newest):
            self._carried = state.newest
        if self._carried is not None:
            slow = (np.abs(qd) <= SLOW * self._highest).all()
            self.taking_up = not (slow or state.newest - self._carried > PATIENCE * 1e9)
        self._void()
        self._begin()
        return command

    def _followed(self, state, held):
        """The law's command, and why the target was given up, if it was: the robot stays where it is then."""
        if self.mode != TRACKING:
            return self._law_command(state), ""
        before = self._desired.position
        command = self._law_command(state)
        names, went = self.dynamics.model.dof_names, np.abs(self._way(self._desired.position, before))
        if command.lyapunov > self._most_behind:
            k = int(np.argmax(np.abs(command.error)))
            lost = f"V is {command.lyapunov:.3g} J, expected no more than following_energy = {self._most_behind:g} J; joint "
            lost += f"'{names[k]}' is {abs(command.error[k]):.3g} behind"
        elif held and (went > STEP).any():
            k = int(np.argmax(went))
            lost = (
                f"that of joint '{names[k]}' has gone on by {went[k]:.3g} during a hold, expected no more than {STEP:g}"
            )
        else:
            return command, ""
        self._void()
        self._begin()
        return self._law_command(state), f"target given up: {lost}"

    def _idle(self, state, now):
        """What is sent to a robot that has been given up while its states are valid: what goes to zero."""
        self.supervisor.wait()
        self.state = state
        nu = self.dynamics.nu_from_qd(state.position, state.velocity)
        self.energy = 0.5 * float(nu @ nu)
        effort, waited = self.efforts.ramped(self.at_rest, now)
        return Sent(effort, waited, state.newest, self._age(now))

    def age_problem(self, state, now):
        """What is wrong about the age of a state at a time [ns], None if nothing is: no joint's values may be too old."""
        if state.stamp_is_receive_time:
            return "joint states without stamps: how old they are is not known"
        judge = self.supervisor.age_problem
        return judge(state.newest, now) or judge(state.oldest, now)

    def _follows(self, state):
        """Whether a state comes after the last one, and no later than the hold of that one would have been over."""
        if self.state is None:
            return False
        gap = (state.newest - self.state.newest) * 1e-9
        return 0.0 <= gap <= self.supervisor.max_age + self.supervisor.hold_time

    def without_state(self, now, reason):
        """What is sent at the time `now` [ns] for want of a valid state; None before the first one.

        The last gravity torque, while it is held, and then zero; either is approached at the effort rate. Nothing is
        damped: velocities that are not valid can drive what they should brake.
        """
        self.supervisor.invalid(now, reason)
        if self.supervisor.phase == INACTIVE:
            return None
        self._no_rate()
        if self._observer:
            self._observer.reset()
        effort, waited = self.efforts.ramped(self.at_rest, now)
        return Sent(effort, waited, self.state.newest, self._age(now))

    @property
    def at_rest(self):
        """What is sent where no law is in force: gravity while it is held, and zero after that."""
        carrying = self.efforts.carrying
        return np.zeros_like(carrying) if self.supervisor.phase == RAMPING_DOWN else carrying

    def leave(self):
        """What to send last, before nothing more is sent; None if nothing was."""
        if self.supervisor.phase == INACTIVE:
            return None
        self.efforts.reset(self.at_rest)
        return self.efforts.sent

    def _age(self, now):
        return (now - self.state.newest) * 1e-9

    def _observed(self, state):
        """ε of what pushes from outside, as far as it is known."""
        if self._observer is None:
            return None
        if self._origin is None:  # seconds since 1970 leave a float no more than a quarter of a microsecond
            self._origin = state.newest
        time = (state.newest - self._origin) * 1e-9
        return self._observer.update(time, state.position, state.velocity, self.efforts.acting).residual

    def _law_command(self, state):
        q, qd, law = state.position, state.velocity, self._laws[self.mode]
        lag = self._behind / self._most_behind
        if self.mode == POSE:
            return self._towards(law, state, lag)
        if self.mode != TRACKING:
            return law.command(q, qd)
        self._desired = self._target.sample(state.newest, lag)
        return law.command(q, qd, *self._desired)

    def _towards(self, law, state, lag):
        """The command of pose regulation on its way: its springs pull to where that has come, its error is from the goal."""
        q, target = state.position, self._target
        if target is None:
            return law.command(q, state.velocity)
        self._aim = target.sample(state.newest, lag)
        law.aim(*self._aim)
        command = law.command(q, state.velocity)
        if target.arrived:
            self._target = None
            return command
        self._no_rate()
        position, axes = law.pose(q)
        return command._replace(error=PoseError(target.goal[0] - position, rotation_vector(target.goal[1] @ axes.T)))

    def _measured_rate(self, before, state, command):
        """dV/dt from this state and the one before, if both are of one target."""
        self._behind = command.lyapunov
        on_its_way = self.mode == POSE and self._target is not None  # V is that of a target which moves
        last, self._lyapunov = self._lyapunov, None if on_its_way else command.lyapunov
        elapsed = (state.newest - before.newest) * 1e-9 if before is not None else 0.0
        return (command.lyapunov - last) / elapsed if last is not None and elapsed > 0.0 else None
