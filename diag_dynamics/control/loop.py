# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control loop with one call per cycle, with or without a valid state.

See :mod:`supervisor` for its states.
"""

from typing import NamedTuple

import numpy as np

from diag_dynamics.control.by_dof import beyond_limits, by_dof, effort_limits
from diag_dynamics.control.filters import Limited, Limits
from diag_dynamics.control.following import (
    INVALID_GOAL,
    PATH_TOLERANCE_VIOLATED,
    Outcome,
    Tolerances,
)
from diag_dynamics.control.laws import Command
from diag_dynamics.control.limiters import names_where
from diag_dynamics.control.modes import DAMPING, GRAVITY_COMPENSATION, LAWS, POSE, REGULATION
from diag_dynamics.control.observer import DisturbanceObserver
from diag_dynamics.control.references import at_rest
from diag_dynamics.control.supervisor import ACTIVE, INACTIVE, RAMPING_DOWN, Supervisor
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.text import distinct

MAX_BEYOND_LIMITS = 0.05
"""Maximum distance of a joint outside of its limits at a start [rad, m], for encoder errors."""

SLOW = 0.05
"""Fraction of its maximum speed below which every joint must be at the end of a start."""

STANDING = 0.003
"""Fraction of its maximum speed below which every joint stands."""

BRAKING = "braking before the mode begins"
"""Text of a start, and of a mode that waits for the arm to stand."""

NO_LINK = "parameter 'controlled_link' is empty; expected a link for mode pose."
"""Error of mode pose without a link."""

VOID = "the robot's position replaced the target: no valid joint state for longer than hold_time"
"""Reason of targets that end with a gap of the states, also where their time goes back."""

CHECK_EVERY, MAX_PERIODS = 8, 100
"""Numbers of states and of periods.

Gains are checked every `CHECK_EVERY` states, from the first state on. The mean counts the last
`MAX_PERIODS` periods.
"""

START_TIMEOUT = 1.0
"""Timeout for the arm to slow down under gravity compensation, and for it to stand [s].

An unknown load or noise may prevent it.
"""


class Sent(NamedTuple):
    """Effort of one cycle, and its reasons."""

    # The fields of Limited: the command is None without a valid state.
    effort: np.ndarray
    demand: np.ndarray
    command: Command | None
    saturated: tuple
    energy_limited: bool
    contact_limited: bool
    stamp: int  # of the command's state, or of the last valid one [ns]
    age: float  # of that state [s]
    # dV/dt since the state before [W]; None unless both have the same target
    lyapunov_rate: float | None = None
    # why the robot's position replaced the target, or another mode its own; empty if it did not
    lost: str = ""
    silent: bool = False  # whether there is no command, because a ramp to zero has ended


def require_consistent(values):
    """Raise InputError if values of the controller's parameters contradict each other."""
    hold_time = values["hold_time"]
    max_age = values["max_state_age"]
    if hold_time < 2.0 * max_age:
        hold, least, age = distinct(hold_time, 2.0 * max_age, max_age)
        raise InputError(
            f"parameter 'hold_time' is {hold} s; expected at least {least} s, twice "
            f"max_state_age = {age} s. Else a single invalid state lets the robot go."
        )
    if values["initial_mode"] == POSE and not values["controlled_link"]:
        raise InputError(NO_LINK)


def _limits(dynamics, values, compensated, points):
    """Return the Limits of the parameters; efforts begin at zero."""
    model = dynamics.model
    unbounded = np.full(model.nv, np.inf)
    shares = values["joint_energy_limit"]
    rates = values["effort_rate"]
    return Limits(
        dynamics,
        margin=values["limit_margin"],
        energy_limit=values["energy_limit"] or np.inf,
        joint_energy_limit=by_dof("joint_energy_limit", shares, model.dof_names, unbounded),
        energy_rate=values["energy_rate"],
        tank_energy=values["tank_energy"],
        contact_points=points,
        effort_limit=effort_limits(values["effort_limit"], model),
        effort_rate=by_dof("effort_rate", rates, model.dof_names),
        compensated=compensated,
        start=np.zeros(model.nv),
    )


class ControlLoop:
    """Laws, filters and safety of one RobotModel, without ROS.

    `values` are those of parameters.controller.PARAMETERS, `compensated` is whether the robot adds
    gravity compensation to the efforts that it receives, and `points` are ContactPoints with
    limits. `modes` are those that the parameters allow, by name, `state` is the last valid
    RobotState or None, `energy` its kinetic energy [J], `following` the :class:`Following` of the
    last trajectory or None, and `tolerances` the default ones of trajectories. `not_executed` is
    why the robot does not execute the commands, empty if it does.
    """

    def __init__(self, model, values, compensated, points=None):
        require_consistent(values)
        self.dynamics = dynamics = DiagonalDynamics(model)
        self.limits = _limits(dynamics, values, compensated, points)
        self._max_period = values["max_state_age"]
        self._scale_timeout = values["contact_limits.scale_timeout"]
        self._scale = 0.0, 0  # and its time [ns]
        allowed = [name for name in LAWS if name != POSE or values["controlled_link"]]
        self.modes = {name: LAWS[name](dynamics, values) for name in allowed}
        self._max_speed = self.modes[DAMPING].max_speed
        gain = values["observer_gain"]
        self._observer = DisturbanceObserver(dynamics, gain, effort="held") if gain else None
        self.supervisor = Supervisor(values["max_state_age"], values["hold_time"])
        self._initial_mode = self._mode_of(values["initial_mode"])
        self.following = None  # of the last trajectory
        self.tolerances = Tolerances.of_parameters(values, model.dof_names)
        self.not_executed = ""
        self.forget()

    def forget(self):
        """Wait for the next valid state, which starts the initial mode."""
        self.supervisor.forget()
        self._mode = self._initial_mode
        self.state = None
        self.energy = 0.0
        self._stands_by = False  # whether the last command came from stand_by
        self._is_late = False  # whether the last period was longer than max_age
        self._periods = 0  # number of measured periods of states
        self._period = 0.0  # and their mean [s]
        self._braking = self.modes[DAMPING]  # mode of the start
        self._stopping = None  # mode until the arm stands
        self._stopping_since = 0  # and its first stamp [ns]
        self._mode.stop()

    def _begin_efforts(self):
        """Start from the last effort, with a full tank."""
        self.limits.begin()
        self._time = None  # of the last command [ns]
        self._carried_since = None  # stamp at which efforts reached gravity compensation [ns]

    # --- Modes and targets ---

    @property
    def mode(self):
        """Name of the mode in force."""
        return self._mode.name

    def _mode_of(self, name):
        if name not in LAWS:
            raise InputError(f"mode is '{name}'; expected one of {', '.join(LAWS)}.")
        if name not in self.modes:
            raise InputError(NO_LINK)
        return self.modes[name]

    def switch(self, mode):
        """Put a mode in force from the next state on, with that state as its target.

        One without joint springs begins when the arm stands.

        Efforts approach those of the new law at the effort rate, the energy tank is filled, and
        springs at position limits begin where the joints are. An InputError names gains that are
        unstable at the rate of the states.
        """
        chosen = self._mode_of(mode)
        if unstable := self._unstable(chosen):
            raise InputError(unstable)
        if self.supervisor.phase == RAMPING_DOWN:
            raise InputError(
                "the controller has no valid state yet: "
                f"{self.supervisor.reason}; expected one after its stop."
            )
        self.supervisor.cause = ""
        self.limits.renew()
        self.stop_trajectory(f"mode {mode} was requested")
        self._mode = chosen
        chosen.stop()

    def _unstable(self, mode):
        """Return why the gains of a mode are unstable at the measured rate of the states.

        The text is empty if they are stable, or if the rate is not known yet.
        """
        if self._periods < CHECK_EVERY:
            return ""
        mode.adapt(self.state.position, self._period)
        try:
            mode.law.require_stable(self.state.position, self._period)
        except InputError as error:
            return f"mode {mode.name} is unstable: {error}"
        return ""

    def _check_gains(self, before):
        """Measure the period, and replace modes that it makes unstable.

        Damping or gravity compensation replaces them. Return the reason.
        """
        gap = 0.0 if before is None else (self.state.newest - before.newest) * 1e-9
        was_late = self._is_late
        self._is_late = gap > self.supervisor.max_age
        if gap <= 0.0 or (self._is_late and not was_late):  # a single stall
            return ""
        self._periods += 1
        gap = min(gap, self.supervisor.max_age)  # a hold follows
        self._period += (gap - self._period) / min(self._periods, MAX_PERIODS)
        if self._periods % CHECK_EVERY:
            return ""
        damping = self.modes[DAMPING]
        self._braking = self.modes[GRAVITY_COMPENSATION] if self._unstable(damping) else damping
        unstable = self._unstable(self._mode)
        if unstable:
            self._mode = self._braking
            self._mode.stop()
        if self._stopping is not None:
            self._choose_stopping()
        return unstable

    def require(self, target):
        """Raise InputError unless a target, by the name of its topic, is accepted now."""
        if target not in self._mode.targets:
            modes = " or ".join(name for name, kind in LAWS.items() if target in kind.targets)
            raise InputError(f"{target} came in mode {self.mode}; expected mode {modes}.")
        if self.supervisor.phase != ACTIVE:
            raise InputError(
                f"{target} comes while the law is not in force: {self.supervisor.reason}."
            )
        if self.is_braking:
            raise InputError(f"{target} came while {BRAKING}; expected one afterwards.")

    def take_pose(self, link, position, orientation):
        """Go to a position [m] and an orientation; see :class:`PoseTarget`.

        The orientation is a rotation matrix. Both are in the axes of a link and from its origin,
        where these are now. Each target replaces the one before.
        """
        self.require("target")
        self._mode.take_pose(self.state, link, position, orientation)

    @property
    def is_braking(self):
        """Whether the mode waits until efforts carry the arm and it stands."""
        return self.supervisor.starting or (self.state is not None and self._waits)

    @property
    def _waits(self):
        """Whether the mode has no joint springs and waits for the arm to stand.

        From motion, springs of poses make joints faster, and so may gravity compensation.
        """
        mode = self._mode
        return not (mode.begun or mode.stops_arm or self._is_slow(STANDING))

    @property
    def shortfall(self):
        """Joint or link that stays away from its target, with the distance; otherwise empty."""
        return self._mode.shortfall if self.supervisor.phase == ACTIVE else ""

    @property
    def desired(self):
        """Motion that the mode demands; rest at the last state without one."""
        return self._mode.desired or at_rest(self.state.position)

    def take_trajectory(self, waypoints, stamp, now, tolerances=None):
        """Follow Waypoints within position and velocity limits and Tolerances.

        See :class:`Trajectory`. The trajectory starts from the desired position, at a stamp [ns]
        or, if that is 0, with the last state.
        """
        self.require("joint_trajectory")
        tolerances = tolerances or self.tolerances
        following = self._mode.take_trajectory(self.state, waypoints, stamp, now, tolerances)
        self._finish("a newer trajectory replaced the trajectory", canceled=True)
        self.following = following

    def stop_trajectory(self, reason, canceled=False):
        """End the trajectory for a reason: the position of the next state becomes the target."""
        if self._finish(reason, canceled=canceled):
            self._mode.stop()

    def _finish(self, reason, code=INVALID_GOAL, canceled=False):
        """Set the outcome of the trajectory; return whether it was being followed."""
        return self.following is not None and self.following.finish(Outcome(code, reason, canceled))

    def take_set_point(self, position):
        """Go to positions [rad, m], shape (nv,), within limits; see :class:`SetPoint`."""
        self.require("set_point")
        self._mode.take_set_point(self.state, position)
        self._finish("a set-point replaced the trajectory")

    def take_scale(self, scale, now):
        """Set the fraction of the allowed contact speeds, from 0 to 1, at the time `now` [ns]."""
        if self.limits.contact is None:
            raise InputError(
                "contact_scale is set; expected contact limits. Set contact_limits.file."
            )
        self.limits.contact.scale = scale  # which checks it
        self._scale = scale, now

    def _scale_contact(self, now):
        """With a timeout, a missing or stale scale of the contact limiter counts as 0."""
        if self.limits.contact and self._scale_timeout:
            scale, time = self._scale
            is_fresh = 0.0 <= (now - time) * 1e-9 <= self._scale_timeout
            self.limits.contact.scale = scale if is_fresh else 0.0

    # --- Cycles ---

    def step(self, state, now):
        """Return the :class:`Sent` for a RobotState at the time `now` [ns].

        It is None before the first valid state.
        """
        supervisor = self.supervisor
        problem = self.age_problem(state, now)
        if not problem and supervisor.will_start:
            problem = self._outside_limits(state.position)
        if problem:
            return self.without_state(now, problem)
        before = self.state
        self.state = state
        if supervisor.will_start:
            self._begin_efforts()
        if supervisor.phase == RAMPING_DOWN:  # the arm may have been moved, perhaps by a person
            self._mode = self._braking
        is_start = supervisor.will_start or supervisor.starting
        lost = ""
        if is_start or self._is_interrupted(before):
            is_void = self._mode.begun and self._mode.targets and not self._stands_by
            lost = VOID if is_void else ""
            self._finish(VOID)
            self._mode.stop()
            self._stopping = None
        if unstable := self._check_gains(before):
            lost = unstable
            self._finish(unstable)
        waits = self.not_executed
        if not waits and self._stands_by:
            waits = self._outside_limits(state.position)
        if waits:
            return self.stand_by(now, waits)._replace(lost=lost)
        self._stands_by = False
        self._scale_contact(now)
        external = self._observed(state)
        sent = self._start(before, external, now) if is_start else None
        has_started = sent is None
        if has_started:
            sent = self._follow(external, now)
        # After the command, because a law that fails must not prolong the hold.
        supervisor.valid(now, has_started)
        return sent._replace(lost=lost or sent.lost)

    def stand_by(self, now, reason):
        """Return gravity compensation with damping; the next state starts from it anew."""
        self._finish(reason)
        self._stands_by = True
        if self._observer:
            self._observer.reset()
        self._begin_efforts()
        sent = self._limited(self._braking.command(self.state), None, now)
        self.limits.reset(sent.demand)
        self.supervisor.stand_by(now, reason)
        return sent._replace(effort=sent.demand, saturated=self.limits.saturated)

    def _is_interrupted(self, before):
        """Return whether the state does not follow the one before within the longest hold."""
        if before is None:
            return True
        gap = (self.state.newest - before.newest) * 1e-9
        return not 0.0 <= gap <= self.supervisor.max_age + self.supervisor.hold_time

    def _start(self, before, external, now):
        """Return damping until efforts have reached gravity compensation and joints are slow.

        Return None then.
        """
        state = self.state
        limits = self.limits
        command = self._braking.command(state)
        time = state.newest
        if before is None:
            limits.limit_to_gravity(command)
        if self._carried_since is None and limits.reaches_gravity(command, self._elapsed(time)):
            self._carried_since = time
        if self._carried_since is not None:
            timeout = state.newest - self._carried_since > START_TIMEOUT * 1e9
            if timeout or self._is_slow(SLOW):
                return None
        sent = self._limited(command, external, now)
        if self._carried_since is None:
            limits.renew()  # a sinking arm has drained the tank and presses on springs
        return sent

    def _is_slow(self, fraction):
        """Return whether no joint exceeds a fraction of its maximum speed."""
        return (np.abs(self.state.velocity) <= fraction * self._max_speed).all()

    def _stops(self):
        """Return whether another mode stops the arm before the mode begins."""
        time = self.state.newest
        if not self._waits:
            self._stopping = None
            return False
        if self._stopping is None:
            self._stopping_since = time
            self._choose_stopping()
        return time - self._stopping_since <= START_TIMEOUT * 1e9

    def _choose_stopping(self):
        """Let regulation stop the arm if it is stable at the measured rate, else as at a start."""
        regulation = self.modes[REGULATION]
        is_stable = self._periods >= CHECK_EVERY and not self._unstable(regulation)
        stopping = regulation if is_stable else self._braking
        if stopping is not self._stopping:
            self._stopping = stopping
            stopping.stop()

    def _follow(self, external, now):
        """Return the command of the mode in force, or of the one that stops the arm before it."""
        state = self.state
        if self._stops():
            self._stopping.begin(state)
            command = self._stopping.command(state)._replace(error=None)
            return self._limited(command, external, now)
        self._mode.begin(state)
        command, lost = self._mode.follow(state)
        if lost:
            self._finish(lost, PATH_TOLERANCE_VIOLATED)
        sent = self._limited(command, external, now)
        rate = self._mode.measured_rate(command, state.newest)
        return sent._replace(lyapunov_rate=rate, lost=lost or self._check_trajectory())

    def _check_trajectory(self):
        """Return the reason of a trajectory that ends by its tolerances; stop it."""
        following = self.following
        if following is None or following.outcome:
            return ""
        lost = following.check(self.state, self._mode.desired)
        if lost:
            self._mode.stop()
        return lost

    def _limited(self, command, external, now):
        """Return the :class:`Sent` for the command of a law in the last state."""
        state = self.state
        self.energy = 0.5 * float(command.nu @ command.nu)
        period = self._elapsed(state.newest)
        limited = self.limits.filter(state.position, state.velocity, command, period, external)
        self._count_time(state.newest)
        return Sent(*limited, state.newest, (now - state.newest) * 1e-9)

    def _elapsed(self, time):
        """Return the time since the last command [s].

        After a stall it is no more than the longest cycle.
        """
        elapsed = 0.0 if self._time is None else (time - self._time) * 1e-9
        return min(max(elapsed, 0.0), self._max_period)

    def _count_time(self, time):
        """Count the period of the next command from a time [ns].

        Ignore a step back within the longest cycle.
        """
        if self._time is None or not -self._max_period * 1e9 <= time - self._time < 0:
            self._time = time

    def _outside_limits(self, q):
        """Return the error of positions outside of their limits; None if they are valid.

        Springs would throw a joint there.
        """
        beyond = beyond_limits(self.dynamics.model, q, MAX_BEYOND_LIMITS)
        return f"{beyond[1]}; laws start there" if beyond else None

    def age_problem(self, state, now):
        """Return the error of the age of a state's joints at a time [ns]; None if it is valid."""
        if state.stamp_is_receive_time:
            return "joint states without stamps: how old they are is not known"
        return self.supervisor.age_problem(state.newest, now) or self.supervisor.age_problem(
            state.oldest, now
        )

    def without_state(self, now, reason):
        """Return the :class:`Sent` without a valid state at the time `now` [ns].

        It is None before the first valid state. There is no damping, because invalid velocities can
        drive the robot.
        """
        self.supervisor.invalid(now, reason)
        self._stands_by = False
        if self.supervisor.phase == INACTIVE:
            return None
        self.stop_trajectory(f"no valid joint state: {reason}")
        self._mode.forget_rate()
        if self._observer:
            self._observer.reset()
        silent = self.is_silent
        demand = self.at_rest
        still = min(self.supervisor.still, self._max_period)
        effort = self.limits.ramp(demand, max(self._elapsed(now), still))
        self._count_time(now)
        waiting = names_where(self.dynamics.model.dof_names, effort != demand)
        age = (now - self.state.newest) * 1e-9
        limited = Limited(effort, demand, None, waiting, False, False)
        return Sent(*limited, self.state.newest, age, silent=silent)

    @property
    def is_silent(self):
        """Whether there is no command until a state is valid, because a ramp to zero has ended."""
        return self.supervisor.phase == RAMPING_DOWN and not self.limits.sent.any()

    @property
    def at_rest(self):
        """Effort without a law [N m, N].

        It is gravity compensation during the hold, and zero after it.
        """
        gravity = self.limits.gravity_compensation
        return np.zeros_like(gravity) if self.supervisor.phase == RAMPING_DOWN else gravity

    def leave(self):
        """Return gravity compensation to end the loop; None: no command.

        There is none during and after a ramp: its last effort stays.
        """
        if self.supervisor.will_start:
            return None
        self.limits.reset(self.at_rest)
        return self.limits.sent

    def _observed(self, state):
        """Return ε of external forces by the observer; None without a result."""
        if self._observer is None:
            return None
        time = state.newest * 1e-9
        motion = state.position, state.velocity
        return self._observer.update(time, *motion, self.limits.acting).residual
