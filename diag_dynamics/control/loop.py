# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One cycle of control after the other: from a state, or the want of one, to efforts."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.checks import number
from diag_dynamics.control.command import Command
from diag_dynamics.control.filters import Efforts
from diag_dynamics.control.modes import DAMPING, LAWS, highest_speeds
from diag_dynamics.control.observer import DisturbanceObserver
from diag_dynamics.control.supervisor import ACTIVE, HOLDING, INACTIVE, RAMPING_DOWN, Supervisor
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError

BEYOND = 0.05
"""How far outside of its limits a joint may be where a law begins [rad, m]: at a stop, as its encoder sees it."""

SLOW = 0.1
"""Part of its highest speed at which a robot may move when a law takes it up."""

PATIENCE = 1.0
"""How long it is waited for that, once efforts carry it [s]: by a load that is not known it may sink for ever."""


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
    contact_limited : bool
        Whether the contact limiter did.
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
    contact_limited: bool = False
    lyapunov_rate: float | None = None
    lost: str = ""


class ControlLoop:
    """Laws, filters and safety for one robot: what the controller node runs, in anybody's loop.

    Parameters
    ----------
    model : RobotModel
    values : dict
        Values of parameters.controller.PARAMETERS.
    compensated : bool
        Whether the robot adds what carries its weight to what it is sent.
    points : ContactPoints, optional
        Where contacts are bounded.

    Attributes
    ----------
    dynamics : DiagonalDynamics
    supervisor : Supervisor
    modes : dict
        A :class:`~modes.Mode` by name, of those that the parameters allow.
    mode : str
        Name of the one in force.
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

    def __init__(self, model, values, compensated, points=None):
        self.dynamics = dynamics = DiagonalDynamics(model)
        self.efforts = Efforts(dynamics, values, compensated, points)
        self._scale_timeout, self._scaled = values["contact.scale_timeout"], None  # scale, and when it came [ns]
        self._lacks = {name: kind.missing(values) for name, kind in LAWS.items()}
        self.modes = {name: kind.of(dynamics, values) for name, kind in LAWS.items() if not self._lacks[name]}
        self._highest = highest_speeds(model)
        gain = values["observer_gain"]
        self._observer = DisturbanceObserver(dynamics, gain, np.inf, effort="held") if gain else None
        if values["hold_time"] < 2.0 * values["max_state_age"]:
            raise InputError(
                f"parameter 'hold_time' is {values['hold_time']:g} s, expected at least twice max_state_age = "
                f"{values['max_state_age']:g} s: a single state that fails would let the robot go."
            )
        self.supervisor = Supervisor(values["max_state_age"], values["hold_time"], values["resume_after_ramp"])
        self._initial_mode = self._mode_of(values["initial_mode"])
        self.forget()

    def forget(self):
        """Begin anew with the next valid state, in the initial mode.

        Efforts go on from what was sent last, as far as that carries the robot: it may have been moved meanwhile.
        """
        self.supervisor.forget()
        self._mode, self.state = self._initial_mode, None
        self.efforts.begin()
        self._origin = None  # time of the first state [ns]
        self.taking_up, self._carried = True, None  # and since when efforts carry the robot meanwhile [ns]
        self.energy = 0.0
        self._mode.void()

    # --- Modes and targets ---

    @property
    def mode(self):
        """Name of the mode in force."""
        return self._mode.name

    def _mode_of(self, name):
        if name not in LAWS:
            raise InputError(f"mode is '{name}', expected one of {', '.join(LAWS)}.")
        if lacks := self._lacks[name]:
            raise InputError(lacks)
        return self.modes[name]

    def switch(self, mode):
        """Put another law in force, from the next state on, with that state as its target.

        Efforts stay continuous: they go to those of the law at the effort rate. A robot that was given up is taken up again.

        Raises
        ------
        InputError
            There is no such law, or no valid state to take the robot up again.
        """
        chosen = self._mode_of(mode)
        self.supervisor.release()
        self._mode = chosen
        chosen.void()

    def require(self, what):
        """Refuse a target, named by its topic, that is not taken now.

        Raises
        ------
        InputError
            It is for another mode, or there is no law in force yet.
        """
        if what not in self._mode.targets:
            others = " or ".join(name for name, kind in LAWS.items() if what in kind.targets)
            raise InputError(f"{what} is for mode {others}, but {self.mode} is in force.")
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
        self.require("target")
        self._mode.take_pose(self.state, link, position, orientation)

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
        self.require("trajectory")
        self._mode.take_trajectory(self.state, waypoints, stamp, now)

    def take_set_point(self, position):
        """Go to positions; see :class:`SetPoint`. They replace the target before.

        Parameters
        ----------
        position : array_like, shape (nv,)
            [rad, m].

        Raises
        ------
        InputError
            It is no valid set-point or beyond a position limit, or joints are not tracked now.
        """
        self.require("set_point")
        self._mode.take_set_point(self.state, position)

    def take_scale(self, scale, now):
        """Scale what contacts are bounded by: the part of the allowed speeds, from 0 to 1, from the time `now` [ns] on.

        Raises
        ------
        InputError
            It is no such number, or contacts are not bounded.
        """
        if self.efforts.contact_limiter is None:
            raise InputError("contact_scale is given, and contacts are not bounded: see contact.limits_file.")
        self._scaled = number("contact_scale", scale, "a number from 0 to 1", lambda x: 0.0 <= x <= 1.0), now

    def _scale_contact(self, now):
        """Where a scale is waited for, none and one that is too old stand for 0."""
        limiter, longest = self.efforts.contact_limiter, self._scale_timeout
        if limiter is None:
            return
        if self._scaled is None:
            limiter.scale = 0.0 if longest else 1.0
        else:
            scale, then = self._scaled
            limiter.scale = 0.0 if longest and not 0.0 <= (now - then) * 1e-9 <= longest else scale

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
            self._mode.void()
        before, self.state = self.state, state
        self._mode.begin(state)
        external = self._observed(state)
        q, qd = state.position, state.velocity
        if self.taking_up:
            command, lost = self._take_up(state, before, external), ""
        if not self.taking_up:
            command, lost = self._mode.followed(state, held)
        self.energy = 0.5 * float(command.nu @ command.nu)
        elapsed = (state.newest - before.newest) * 1e-9 if before is not None else 0.0
        rate = None if self.taking_up else self._mode.measured_rate(command, elapsed)
        self._scale_contact(now)
        filtered = self.efforts.filtered(q, qd, command, external, state.newest)
        effort, waited = self.efforts.ramped(filtered.effort, state.newest)
        at_limit = filtered.command.limited
        late = tuple(name for name in waited if name not in at_limit)
        self.supervisor.valid(now)  # not before there is a command: a law that fails is no reason to hold for ever
        by = filtered.energy_limited, filtered.contact_limited
        return Sent(effort, at_limit + late, state.newest, self._age(now), filtered.command, *by, rate, lost)

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
        command = self.modes[DAMPING].law.command(q, qd)._replace(error=None)
        asked = self.efforts.filtered(q, qd, command, external, state.newest).effort
        if before is None:
            self.efforts.carry_on()
        if self._carried is None and self.efforts.carry(asked, state.newest):
            self._carried = state.newest
        if self._carried is not None:
            slow = (np.abs(qd) <= SLOW * self._highest).all()
            self.taking_up = not (slow or state.newest - self._carried > PATIENCE * 1e9)
        self._mode.void()
        self._mode.begin(state)
        return command

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
        self._mode.forget_rate()
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
