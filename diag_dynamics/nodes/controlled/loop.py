"""One cycle of control after the other: from a state, or the want of one, to efforts."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control import (
    Command,
    EffortRateLimiter,
    EffortSaturation,
    EnergyLimiter,
    GravityCompensation,
    JointTracking,
    PoseRegulation,
    PositionRepulsion,
    RateDamping,
)
from diag_dynamics.control.limits import HEAVY
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.controlled.settings import (
    DAMPING,
    GRAVITY_COMPENSATION,
    MODES,
    POSE,
    TRACKING,
    by_dof,
    effort_limits,
)
from diag_dynamics.nodes.controlled.supervisor import ACTIVE, INACTIVE, RAMPING_DOWN, Supervisor
from diag_dynamics.nodes.controlled.targets import aimed, require_within, set_point
from diag_dynamics.nodes.controlled.trajectory import Trajectory
from diag_dynamics.observer import DisturbanceObserver

LONGEST_WAIT = 10.0
"""How long before its stamp a trajectory may come [s]: until then the robot goes towards its first point."""


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
    """

    effort: np.ndarray
    saturated: tuple
    stamp: int
    age: float
    command: Command | None = None
    energy_limited: bool = False
    lyapunov_rate: float | None = None


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
    state : RobotState or None
        The last valid one.
    energy : float
        Its kinetic energy [J].
    scale : float
        What moves the robot was multiplied with to respect effort limits, in the last command.

    Raises
    ------
    InputError, UnsupportedError
        The values do not fit the robot; or it has an unactuated base.
    """

    def __init__(self, model, values, compensated):
        names = model.dof_names
        self.dynamics = dynamics = DiagonalDynamics(model)
        self.compensated = compensated
        self._laws = {
            GRAVITY_COMPENSATION: GravityCompensation(dynamics),
            DAMPING: RateDamping(dynamics, by_dof("damping", values["damping"], names)),
            TRACKING: JointTracking(
                dynamics,
                by_dof("tracking_gain", values["tracking_gain"], names),
                by_dof("tracking_convergence", values["tracking_convergence"], names),
                np.where(model.velocity_limit > 0.0, model.velocity_limit, np.inf),
            ),
        }
        if values["controlled_link"]:
            self._laws[POSE] = PoseRegulation(
                dynamics,
                values["controlled_link"],
                by_dof("pose_damping", values["pose_damping"], names),
                values["position_stiffness"],
                values["orientation_stiffness"],
            )
        margin = values["limit_margin"]
        springs = (margin, values["limit_stiffness"], values["limit_damping"])
        self._springs = PositionRepulsion(dynamics, *springs) if margin else None
        limit, rate = values["energy_limit"], values["energy_rate"]
        self.energy_limiter = EnergyLimiter(dynamics, limit, rate) if limit else None
        gain = values["observer_gain"]
        self._observer = DisturbanceObserver(dynamics, gain, np.inf, effort="held") if gain else None
        self._saturation = EffortSaturation(model, effort_limits(values["effort_limit"], model))
        # Of what is sent, not of what acts: a robot that carries itself and is let go is sent zero, not less than its weight.
        self._ramp = EffortRateLimiter(model, by_dof("effort_rate", values["effort_rate"], names), np.zeros(model.nv))
        self.supervisor = Supervisor(values["max_state_age"], values["hold_time"], values["resume_after_ramp"])
        self._sent = np.zeros(model.nv)
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
        self._gravity = np.zeros_like(self._sent)
        self._time = self._origin = None  # of the last command, and of the first state [ns]
        self.energy, self.scale = 0.0, 1.0
        self._void()

    def _void(self):
        """Have targets begin at the next state."""
        self._target, self._to_begin = None, True
        self._no_rate()

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

    def take_pose(self, message):
        """Aim at a PoseStamped; see :func:`aimed`. It replaces the target before.

        Raises
        ------
        InputError
            It is no valid pose, or poses are not regulated now.
        """
        self._require(POSE, "target")
        target = aimed(message, self.dynamics, self.state.position)
        self._begin()
        self._laws[POSE].aim(*target)
        self._no_rate()

    def take_trajectory(self, message, now):
        """Follow a JointTrajectory; see :class:`Trajectory`. It replaces the target before.

        Raises
        ------
        InputError
            It is no valid trajectory, beyond a position limit, or over at the time `now` [ns]; or joints are not tracked now.
        """
        self._require(TRACKING, "trajectory")
        model = self.dynamics.model
        trajectory = Trajectory(message, model.dof_names, model.continuous_joints)
        require_within("trajectory.points[{}].positions", trajectory.positions, model)
        wait = (trajectory.stamp - now) * 1e-9
        if wait > LONGEST_WAIT:
            raise InputError(
                f"trajectory.header.stamp is {wait:.6g} s in the future, expected no more than {LONGEST_WAIT:g} s."
            )
        if trajectory.ends_before(now):
            raise InputError("trajectory.header.stamp is so long ago that the trajectory is over.")
        self._begin()
        self._target = trajectory
        self._no_rate()

    def take_set_point(self, message):
        """Go to the positions of a JointState. They replace the target before.

        Raises
        ------
        InputError
            It is no valid set-point or beyond a position limit, or joints are not tracked now.
        """
        self._require(TRACKING, "set_point")
        model = self.dynamics.model
        position = set_point(message, model.dof_names)
        require_within("set_point.position", position, model)
        self._begin()
        self._target = position
        self._no_rate()

    def _begin(self):
        """Take the state as it is for the target, unless that has been done."""
        if not self._to_begin:
            return
        self._to_begin = False
        q = self.state.position
        self._target = q.copy()
        if self.mode == POSE:
            self._laws[POSE].aim(*self._laws[POSE].pose(q))

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
        if self.supervisor.anew or not self._follows(state):
            self._void()
        before, self.state = self.state, state
        self._begin()
        external = self._observed(state)
        q, qd = state.position, state.velocity
        command = asked = self._law_command(state)
        self.energy = 0.5 * float(command.nu @ command.nu)
        rate = self._measured_rate(before, state, command)
        if self._springs:
            command = asked = self._springs.filter(q, qd, command)
        if self.energy_limiter:
            command = self.energy_limiter.filter(q, command, external)
        limited = command is not asked
        saturated = self._saturation.filter(command)
        self.scale = saturated.scale
        self._gravity = command.gravity_torque
        if before is None:
            self._carry_on()
        effort = saturated.tau
        if self.compensated:  # whose weight is more than its limit is left to the robot, and never pulled down
            heavy = np.abs(self._gravity) > self._saturation.limit
            effort = np.where(heavy, 0.0, effort - self._gravity)
        effort, waited = self._ramped(effort, state.newest)
        late = tuple(name for name in waited if name not in saturated.limited)
        self.supervisor.valid()  # not before there is a command: a law that fails is no reason to hold for ever
        return Sent(effort, saturated.limited + late, state.newest, self._age(now), command, limited, rate)

    def _carry_on(self):
        """Begin with what was sent last, as far as it carries the robot as it is now; a robot may carry itself."""
        carrying = np.zeros_like(self._gravity) if self.compensated else self._gravity
        self._sent = np.clip(self._sent, np.minimum(carrying, 0.0), np.maximum(carrying, 0.0))
        self._ramp.reset(self._sent)

    def _idle(self, state, now):
        """What is sent to a robot that has been given up while its states are valid: what goes to zero."""
        self.supervisor.wait()
        self.state = state
        nu = self.dynamics.nu_from_qd(state.position, state.velocity)
        self.energy = 0.5 * float(nu @ nu)
        effort, waited = self._ramped(self.at_rest, now)
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
        effort, waited = self._ramped(self.at_rest, now)
        return Sent(effort, waited, self.state.newest, self._age(now))

    @property
    def unlimited(self):
        """Joints whose effort nothing limits."""
        return self._named(np.isinf(self._saturation.limit))

    @property
    def heavy(self):
        """Joints whose weight takes more than HEAVY of their effort limit, in the last state."""
        return self._named(np.abs(self._gravity) > HEAVY * self._saturation.limit)

    def _named(self, these):
        return tuple(name for name, is_one in zip(self.dynamics.model.dof_names, these, strict=True) if is_one)

    @property
    def at_rest(self):
        """What is sent where no law is in force: gravity while it is held, and zero after that."""
        if self.compensated or self.supervisor.phase == RAMPING_DOWN:
            return np.zeros_like(self._gravity)
        return np.clip(self._gravity, -self._saturation.limit, self._saturation.limit)

    def leave(self):
        """What to send last, before nothing more is sent; None if nothing was."""
        if self.supervisor.phase == INACTIVE:
            return None
        self._sent = self.at_rest
        self._ramp.reset(self._sent)
        return self._sent

    def _age(self, now):
        return (now - self.state.newest) * 1e-9

    def _ramped(self, effort, time):
        """Efforts as the rate limit lets them pass; after a stall no more than within the largest age of a state."""
        elapsed = 0.0 if self._time is None else (time - self._time) * 1e-9
        self._time = time if self._time is None or elapsed > 0.0 or elapsed < -self.supervisor.max_age else self._time
        self._sent, waited = self._ramp.filter(effort, min(max(elapsed, 0.0), self.supervisor.max_age))
        return self._sent, waited

    def _observed(self, state):
        """ε of what pushes from outside, as far as it is known."""
        if self._observer is None:
            return None
        acting = self._sent + self._gravity if self.compensated else self._sent
        if self._origin is None:  # seconds since 1970 leave a float no more than a quarter of a microsecond
            self._origin = state.newest
        time = (state.newest - self._origin) * 1e-9
        return self._observer.update(time, state.position, state.velocity, acting).residual

    def _law_command(self, state):
        q, qd, law = state.position, state.velocity, self._laws[self.mode]
        if self.mode != TRACKING:
            return law.command(q, qd)
        if not isinstance(self._target, Trajectory):
            return law.command(q, qd, self._target)
        if not self._target.begun:
            self._target.begin(state.newest, q, qd)
        return law.command(q, qd, *self._target.sample(state.newest))

    def _measured_rate(self, before, state, command):
        """dV/dt from this state and the one before, if both are of one target."""
        last, self._lyapunov = self._lyapunov, command.lyapunov
        elapsed = (state.newest - before.newest) * 1e-9 if before is not None else 0.0
        return (command.lyapunov - last) / elapsed if last is not None and elapsed > 0.0 else None
