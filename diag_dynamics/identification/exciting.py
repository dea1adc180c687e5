# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories that move a robot so that a recording of it tells what is to be identified."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import instance, number, positive, whole
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.identification.equations import DAMPING, FRICTION, OFFSET, ROTOR, Equations
from diag_dynamics.identification.kernels.normal_equations import OWN
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.identification.segments import Segment
from diag_dynamics.model import RobotModel
from diag_dynamics.yaml_files import yaml_text

HARMONICS = 5
"""Of each joint's Fourier series."""

FILTER = 2.0 * np.pi
"""λ of the filter that rows are looked at through [1/s], as identification has it."""

RANDOM = 24
"""Trajectories that are tried before the best one of them is improved."""

UNSEEN = 1e-10
"""Part of the largest eigenvalue below which no motion tells anything."""

MAX_VELOCITY, MAX_POSITION = 100.0, 1000.0
"""Limits beyond these are placeholders that nobody filled in [rad/s, m/s; rad, m]: 1e16, as exporters write."""

UNLIMITED = np.pi
"""Range of a joint that turns round without an end [rad]."""

MIN_TRAVEL, MIN_SPEED = 1e-3, 1e-3
"""Travel [rad, m] and largest speed [rad/s, m/s] below which a joint stands still."""

POINTS_PER_PERIOD = 2000
"""Points of a period at which a trajectory is scaled to its limits, however few of them are asked for."""

OTHERS = "*"
"""Stands for all joints without a limit of their own, as in the parameter effort_scale."""


class Excitation(NamedTuple):
    """A periodic trajectory that begins and ends at rest.

    Attributes
    ----------
    joints : tuple of str
        Degrees of freedom of the robot: the order of the columns.
    time : ndarray, shape (T,)
        From its begin [s].
    position, velocity, acceleration : ndarray, shape (T, nv)
        [rad, m], [rad/s, m/s], [rad/s², m/s²].
    effort : ndarray, shape (T, nv)
        That the model needs for it, friction included [N m, N].
    period : float
        Of the Fourier series [s].
    condition : float
        Of the regressor over the trajectory, its columns scaled and what no motion tells left out. Below 100 is good.
    what : tuple of str
        What it excites.
    """

    joints: tuple[str, ...]
    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    effort: Array
    period: float
    condition: float
    what: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain lists and numbers."""
        columns = {
            name: getattr(self, name).tolist() for name in ("time", "position", "velocity", "acceleration", "effort")
        }
        plain = {
            "joints": list(self.joints),
            "what": list(self.what),
            "period": self.period,
            "condition": self.condition,
        }
        return plain | columns

    def to_json(self) -> str:
        """:meth:`to_dict` as JSON."""
        return json.dumps(self.to_dict(), allow_nan=False)

    def to_message(self, approach: float = 5.0) -> str:
        """A trajectory_msgs/JointTrajectory in YAML, as ``ros2 topic pub`` takes it and the controller's `tracking`.

        Parameters
        ----------
        approach : float
            Time that the robot has to get to the first point [s].
        """
        points = []
        for t, *values in zip(self.time, self.position, self.velocity, self.acceleration, strict=True):
            at = round((t + approach) * 1e9)
            point = {name: np.round(one, 9).tolist() for name, one in zip(_FIELDS, values, strict=True)}
            points.append(point | {"time_from_start": {"sec": at // 10**9, "nanosec": at % 10**9}})
        return yaml_text({"joint_names": list(self.joints), "points": points})


_FIELDS = "positions", "velocities", "accelerations"


def excite(
    model: RobotModel,
    what: str | Sequence[str] = ("friction", "rotors"),
    *,
    duration: float = 20.0,
    period: float = 10.0,
    joints: Sequence[str] | None = None,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    velocity_limits: Mapping[str, float] | None = None,
    position_limits: Mapping[str, tuple[float, float]] | None = None,
    velocity: float = 0.5,
    effort: float = 0.7,
    margin: float = 0.05,
    trials: int = 300,
    rate: float = 50.0,
    seed: int = 0,
    progress: Callable[[int, float], object] | None = None,
) -> Excitation:
    """Find a trajectory within limits that excites what is to be identified.

    Each joint follows a Fourier series of five harmonics that begins and ends at rest and without acceleration. Its
    coefficients are drawn by chance and then improved, so that the condition of the regressor becomes small: no unknown is
    then lost in the noise of another one. Nobody looks whether the robot hits itself or something else: `ranges` keeps it
    away, and a simulation shows it.

    Parameters
    ----------
    model : RobotModel
        With a fixed base, and joints of one degree of freedom each.
    what : str or sequence of str
        As of :func:`identify`.
    duration, period : float
        [s]; the duration is a whole number of periods.
    joints : sequence of str, optional
        Those that move, by default all; the others rest in the middle of their range.
    ranges : mapping, optional
        Lower and upper bound of a joint's position [rad, m], by name, within its limits.
    velocity_limits, position_limits : mapping, optional
        Limits [rad/s, m/s], and lower and upper limits [rad, m], by name, of joints for which the model has none: zero,
        negative, infinite or absent ones, or a lower limit that is the upper one. ``*`` stands for all joints that lack one.
    velocity, effort : float
        Parts of the limits of velocity and effort that may be used. A joint without an effort limit has no bound of it.
    margin : float
        Part of a joint's range at either end that is not.
    trials : int
        Trajectories that are looked at.
    rate : float
        Of points [1/s].
    seed : int
        Of chance.
    progress : callable, optional
        Is told how many were looked at, and the best condition until now.

    Returns
    -------
    Excitation

    Raises
    ------
    InputError
        An argument has a wrong value, a joint that moves has no limit of velocity or position, no joint would move, the
        robot has no degrees of freedom, or a joint has not the effort to carry the robot along such a trajectory.
    UnsupportedError
        The robot has a floating base, or a joint of several degrees of freedom.
    """
    instance("model", model, RobotModel)
    if not model.nv:
        raise InputError(f"robot '{model.name}' has no degrees of freedom; expected one joint at least that can move.")
    if model.floating_base or model.nq != model.nv:
        raise UnsupportedError(
            f"robot '{model.name}' has a floating base, or a joint of several degrees of freedom: nothing excites that."
        )
    for name, value in (("duration", duration), ("period", period), ("rate", rate)):
        positive(name, value, "[s]" if name != "rate" else "[1/s]")
    for name, part, most in (("velocity", velocity, 1.0), ("effort", effort, 1.0), ("margin", margin, 0.45)):
        number(name, part, f"a number within 0 … {most:g}", _up_to(most))
    cycles = round(duration / period)
    if cycles < 1 or abs(cycles * period - duration) > 1e-9 * duration:
        raise InputError(f"duration is {duration:g} s, expected a whole number of periods of {period:g} s.")
    if rate < 2.0 * HARMONICS / period:
        raise InputError(
            f"rate is {rate:g} 1/s; expected {2.0 * HARMONICS / period:g} 1/s at least, two points for each swing of the "
            f"fastest harmonic. Give a higher rate, or a longer period."
        )
    what = (what,) if isinstance(what, str) else tuple(what)
    moving = _moving(model, joints)
    limits = _Limits(model, moving, velocity_limits or {}, position_limits or {}, ranges or {})
    family = _Family(limits, moving, period, cycles, rate, velocity, margin)
    judge = _Judge(model, family, what, effort)
    best, condition = _improved(family, judge, np.random.default_rng(seed), whole("trials", trials), progress)
    if best is None:
        raise InputError(judge.refusal())
    position, speed, acceleration = family.at(best)
    family.refuse_standstill(position, speed)
    needed = judge.effort_of(position, speed, acceleration)
    return Excitation(model.dof_names, family.time, position, speed, acceleration, needed, period, condition, what)


def _improved(family, judge, rng, trials, progress):
    """The best genes that were found, and the condition of the regressor then; None where no effort suffices.

    First by chance alone, then by steps from the best that become wider where they help, and narrower where they do not.
    """
    best, value, width = None, np.inf, 0.3
    for trial in range(trials):
        by_chance = best is None or trial < min(RANDOM, trials // 2)
        genes = family.by_chance(rng) if best is None or by_chance else best + width * rng.normal(size=best.shape)
        found = judge.condition(*family.at(genes))
        if found < value:
            best, value = genes, found
        if not by_chance:
            width = max(width * (1.5 if best is genes else 0.93), 1e-3)
        if progress:
            progress(trial + 1, value)
    return best, float(value)


def _up_to(most):
    return lambda x: 0.0 < x <= most


def _moving(model, joints):
    """Return which degrees of freedom move, bool, shape (nv,)."""
    chosen = tuple(model.dof_names if joints is None else joints)
    _refuse_unknown("joints", chosen, model)
    if not chosen:
        raise InputError("joints is empty; expected one joint at least that moves.")
    return np.array([name in chosen for name in model.dof_names])


def _refuse_unknown(what, names, model):
    """Raise InputError unless all names are joints of the robot."""
    for name in names:
        if name not in model.dof_names:
            raise InputError(
                f"{what}: '{name}' is not a joint of robot '{model.name}'; {', '.join(model.dof_names)} are."
            )


class _Limits:
    """Limits of the joints that move: those of the model, or given ones where the model has none.

    Parameters
    ----------
    model : RobotModel
    moving : ndarray of bool, shape (nv,)
    velocities, positions, ranges : mapping
        As `velocity_limits`, `position_limits` and `ranges` of :func:`excite`.
    """

    def __init__(self, model, moving, velocities, positions, ranges):
        self._model, self.ranges = model, ranges
        for what, given in (("velocity_limits", velocities), ("position_limits", positions), ("ranges", ranges)):
            _refuse_unknown(what, [name for name in given if what == "ranges" or name != OTHERS], model)
        self.velocity = model.velocity_limit.copy()
        self.lower, self.upper = model.lower.copy(), model.upper.copy()
        names = model.dof_names
        slow = moving & ~((self.velocity > 0.0) & (self.velocity <= MAX_VELOCITY))
        for k in _given(velocities, names, slow):
            self.velocity[k] = _velocity(model, k, velocities.get(names[k], velocities.get(OTHERS)), slow[k])
            slow[k] = False
        turning = np.isin(names, model.continuous_joints)
        widest = np.maximum(np.abs(self.lower), np.abs(self.upper))
        open_ = moving & ~turning & ~((widest <= MAX_POSITION) & (self.lower < self.upper))
        for k in _given(positions, names, open_):
            given = positions.get(names[k], positions.get(OTHERS))
            low, high = (-np.inf, np.inf) if open_[k] else (self.lower[k], self.upper[k])
            self.lower[k], self.upper[k] = _pair("position_limits", names[k], given, low, high)
            open_[k] = False
        for name, given in ranges.items():
            k = names.index(name)
            low, high = (-np.inf, np.inf) if open_[k] else (self.lower[k], self.upper[k])
            self.lower[k], self.upper[k] = _pair("ranges", name, given, low, high)
            open_[k] = False
        _refuse_missing(names, slow, open_)

    @property
    def names(self):
        """Degrees of freedom."""
        return self._model.dof_names

    def within(self, margin):
        """Return lower and upper bounds without the margins, and positions of rest; shape (nv,) each."""
        low, high = self.lower.copy(), self.upper.copy()
        bounded = np.isfinite(low) & np.isfinite(high)
        rest = np.where(bounded, 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0)), 0.0)
        rest = np.clip(rest, low, high)
        low, high = (np.where(np.isinf(one), sign * 0.5 * UNLIMITED, one) for sign, one in ((-1.0, low), (1.0, high)))
        own = np.array([0.0 if name in self.ranges else margin for name in self.names])
        return low + own * (high - low), high - own * (high - low), rest


def _given(given, names, missing):
    """Return the joints that limits are given for: those with a name, and with ``*`` all that lack one."""
    return [k for k, name in enumerate(names) if name in given or (OTHERS in given and missing[k])]


def _velocity(model, k, given, missing):
    """Return a given velocity limit."""
    name, most = model.dof_names[k], np.inf if missing else model.velocity_limit[k]
    if not isinstance(given, (int, float)) or not (0.0 < given < np.inf and given <= most):
        bound = "a finite number > 0" if missing else f"a number > 0 up to the model's limit, {most:g}"
        raise InputError(f"velocity_limits: '{name}' has {given!r}; expected {bound} [rad/s, m/s].")
    return given


def _pair(what, name, given, low, high):
    """Return given bounds of a position."""
    try:
        least, most = map(float, given)
    except (TypeError, ValueError):
        least = most = np.nan
    if not (low <= least < most <= high and np.isfinite([least, most]).all()):
        raise InputError(
            f"{what}: '{name}' has {given!r}, expected a lower and an upper bound within {low:g} … {high:g}."
        )
    return least, most


def _refuse_missing(names, velocities, positions):
    """Raise InputError if joints that move lack limits."""
    told = []
    for which, missing, expected, how in (
        ("Velocity", velocities, "finite numbers > 0", "--velocity-limit JOINT=LIMIT (velocity_limits)"),
        ("Position", positions, "lower < upper", "--position-limit JOINT=LOWER:UPPER (position_limits)"),
    ):
        if missing.any():
            lacking = ", ".join(names[k] for k in np.flatnonzero(missing))
            told.append(f"{which} limits of {lacking} are missing; expected {expected}. Give {how}.")
    if told:
        raise InputError(" ".join(told))


class _Family:
    """Trajectories that keep to the limits of position and velocity, by genes: what chance changes."""

    def __init__(self, limits, moving, period, cycles, rate, velocity, margin):
        self.time = np.arange(round(cycles * period * rate) + 1) / rate
        self.moving, self._names = moving, limits.names
        self._low, self._high, self._rest = limits.within(margin)
        self._fastest = velocity * limits.velocity
        w = 2.0 * np.pi / period * np.arange(1, HARMONICS + 1)
        # Of velocities a cos wt + b sin wt: that they and their slopes begin at zero leaves two coefficients fewer.
        held = np.zeros((2, 2 * HARMONICS))
        held[0, :HARMONICS], held[1, HARMONICS:] = 1.0, w
        free = np.linalg.svd(held)[2][2:]
        self.size = len(free)

        def bases(time):
            phase = np.outer(time, w)
            sine, cosine = np.sin(phase), np.cos(phase)
            columns = (sine / w, -cosine / w), (cosine, sine), (-sine * w, cosine * w)
            return [np.hstack(pair) @ free.T for pair in columns]

        self._bases = bases(self.time)
        self._dense = bases(np.linspace(0.0, period, POINTS_PER_PERIOD, endpoint=False))

    def by_chance(self, rng):
        """Genes: coefficients of each joint, its place in its range, and the part of its range that it takes."""
        return np.hstack([rng.normal(size=(len(self.moving), self.size)), rng.uniform(-1, 1, (len(self.moving), 2))])

    def at(self, genes):
        """Positions, velocities and accelerations, (T, nv) each."""
        shape = genes[:, : self.size].T
        # Between the points the arm moves on: the scale keeps the whole period within the limits.
        position, velocity = (base @ shape for base in self._dense[:2])
        low, high = position.min(axis=0), position.max(axis=0)
        place, part = 0.5 + 0.5 * np.tanh(genes[:, -2]), 0.75 + 0.25 * np.tanh(genes[:, -1])
        span = self._high - self._low
        scale = np.minimum(
            span / np.maximum(high - low, 1e-12), self._fastest / np.maximum(abs(velocity).max(axis=0), 1e-12)
        )
        scale = np.where(self.moving, scale * part, 0.0)
        left = span - scale * (high - low)
        first = np.where(self.moving, self._low + place * left - scale * low, self._rest)
        position, velocity, acceleration = (base @ shape for base in self._bases)
        return first + scale * position, scale * velocity, scale * acceleration

    @property
    def moving_names(self):
        """Joints that move."""
        return [name for name, moves in zip(self._names, self.moving, strict=True) if moves]

    def refuse_standstill(self, position, velocity):
        """Raise InputError if a joint that should move stands still."""
        travel, speed = np.ptp(position, axis=0), abs(velocity).max(axis=0)
        still = self.moving & ((travel < MIN_TRAVEL) | (speed < MIN_SPEED))
        if still.any():
            k = int(np.flatnonzero(still)[0])
            raise InputError(
                f"joint '{self._names[k]}' stands still: it moves over {travel[k]:.2g} rad or m at {speed[k]:.2g} rad/s or "
                f"m/s at most; expected {MIN_TRAVEL:g} and {MIN_SPEED:g}. Widen its limits or its range, or leave it out of "
                "joints."
            )


class _Judge:
    """Tells how well a trajectory excites the unknowns that are wanted."""

    def __init__(self, model, family, what, effort):
        self._model, self._dynamics, self._time = model, DiagonalDynamics(model), family.time
        self._limit = effort * np.where(model.effort_limit > 0.0, model.effort_limit, np.inf)
        self._velocity = model.friction_velocity
        self._worst = np.full(model.nv, np.inf)
        self._columns = self._wanted(what, family.moving)
        self._basis, self._scale = np.empty((0, 0)), np.empty(0)
        seen = 0.0
        for seed in range(8):  # what these together do not tell, no motion does
            seen = seen + self._told(*family.at(family.by_chance(np.random.default_rng(seed))))
        if not np.any(np.diag(seen) > 0.0):
            raise InputError(
                f"what is {', '.join(what)}; expected unknowns that a motion of {', '.join(family.moving_names)} shows. Let "
                "other joints move, or ask for something else."
            )
        self._scale = 1.0 / np.sqrt(np.maximum(np.diag(seen), 1e-300))
        values, vectors = np.linalg.eigh(self._scale[:, None] * seen * self._scale)
        self._basis = vectors[:, values > UNSEEN * values[-1]]

    def _wanted(self, what, moving):
        equations = Equations(self._model, FILTER, self._velocity)
        names, inertial = self._model.link_names, len(equations.bodies) * PARAMETERS
        own = inertial + OWN * np.arange(self._model.nv)[moving]
        wanted = []
        for one in what:
            kind, _, link = one.partition(":")
            if one == "friction":
                wanted += [own + DAMPING, own + FRICTION, own + OFFSET]
            elif one == "rotors":
                wanted.append(own + ROTOR)
            elif one == "inertias":
                wanted.append(np.arange(inertial))
            elif kind == "payload" and link in names:
                body = self._model.placement_in_body(link)[0]
                at = int(np.searchsorted(equations.bodies, body))
                if at == len(equations.bodies) or equations.bodies[at] != body:
                    raise InputError(f"what: link '{link}' moves with a body without inertia, or with the base.")
                wanted.append(PARAMETERS * at + np.arange(PARAMETERS))
            else:
                raise InputError(f"what has {one!r}, expected some of friction, rotors, inertias, payload:<link>.")
        if not wanted:
            raise InputError("what is empty: nothing is to be excited.")
        return np.unique(np.concatenate(wanted))

    def effort_of(self, position, velocity, acceleration):
        """Efforts of the model for a trajectory, friction included, (T, nv)."""
        return self._dynamics.inverse_dynamics_batch(position, velocity, acceleration, friction=True)

    def _told(self, position, velocity, acceleration):
        """AᵀA of the wanted unknowns, each joint's rows over the variance of its effort."""
        effort = self.effort_of(position, velocity, acceleration)
        equations = Equations(self._model, FILTER, self._velocity)
        stamp = np.round(self._time * 1e9).astype(np.int64)
        equations.take(Segment(stamp, self._time, position, velocity, effort))
        A, _ = equations.sums().weighted(np.maximum(effort.var(axis=0), 1e-12), equations.size)
        return A[np.ix_(self._columns, self._columns)]

    def condition(self, position, velocity, acceleration):
        """Condition of the regressor, inf where an effort does not suffice."""
        part = abs(self.effort_of(position, velocity, acceleration)).max(axis=0) / self._limit
        if (part > 1.0).any():
            self._worst = np.minimum(self._worst, part)
            return np.inf
        scaled = self._scale[:, None] * self._told(position, velocity, acceleration) * self._scale
        values = np.linalg.eigvalsh(self._basis.T @ scaled @ self._basis)
        return float(np.sqrt(values[-1] / values[0])) if values[0] > 0.0 else np.inf

    def refusal(self):
        """Why no trajectory will do."""
        if np.isinf(self._worst).all():
            return (
                "no trajectory shows all unknowns of what; expected a motion that tells them apart. Let more joints move, or "
                "ask for fewer unknowns."
            )
        k = int(np.argmax(np.where(np.isinf(self._worst), 0.0, self._worst)))
        return (
            f"joint '{self._model.dof_names[k]}' would need {self._worst[k]:.2g} times the effort that may be used: give a "
            "longer period, narrower ranges, or a larger part of the limits (effort)."
        )
