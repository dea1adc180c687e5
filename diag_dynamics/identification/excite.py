# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories that excite the unknowns of an identification."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import instance, number, positive, whole
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.identification.regressors import DAMPING, FRICTION, OFFSET, ROTOR, Regressors
from diag_dynamics.model import RobotModel
from diag_dynamics.yaml_files import yaml_text

HARMONICS = 5
RANDOM_TRIALS = 24  # before the best trajectory is improved
MIN_EIGENVALUE = 1e-10  # of a combination of unknowns that motions excite, relative to the largest
MAX_VELOCITY, MAX_POSITION = 100.0, 1000.0  # larger limits are placeholders, such as 1e16 [rad/s, m/s; rad, m]
CONTINUOUS_RANGE = np.pi  # [rad]
MIN_TRAVEL, MIN_SPEED = 1e-3, 1e-3  # below these a joint stands still [rad, m; rad/s, m/s]
POINTS_PER_PERIOD = 2000  # at which a trajectory is scaled to its limits
OTHERS = "*"  # all joints without a limit of their own


class Excitation(NamedTuple):
    """A periodic trajectory that begins and ends at rest.

    Attributes
    ----------
    joints : tuple of str
        Degrees of freedom in the order of the columns.
    time : ndarray, shape (T,)
        [s], from 0.
    position, velocity, acceleration : ndarray, shape (T, nv)
        [rad, m], [rad/s, m/s], [rad/s², m/s²].
    effort : ndarray, shape (T, nv)
        Effort of the model, friction included [N m, N].
    period : float
        Of the Fourier series [s].
    condition : float
        Condition number of the scaled regressor without what no motion excites. Below 100 is good.
    what : tuple of str
        Unknowns that it excites.
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
        """Return plain lists and numbers."""
        return {key: np.asarray(value).tolist() for key, value in self._asdict().items()}

    def to_json(self) -> str:
        """Return :meth:`to_dict` as JSON."""
        return json.dumps(self.to_dict(), allow_nan=False)

    def to_message(self, approach: float = 5.0) -> str:
        """Return a trajectory_msgs/JointTrajectory in YAML for ``ros2 topic pub``, as the controller's `tracking` takes it.

        Parameters
        ----------
        approach : float
            Time to the first point [s].
        """
        points, names = [], ("positions", "velocities", "accelerations")
        for t, *values in zip(self.time, self.position, self.velocity, self.acceleration, strict=True):
            seconds, nanoseconds = divmod(round((t + approach) * 1e9), 10**9)
            point = {name: np.round(one, 9).tolist() for name, one in zip(names, values, strict=True)}
            points.append(point | {"time_from_start": {"sec": seconds, "nanosec": nanoseconds}})
        return yaml_text({"joint_names": list(self.joints), "points": points})


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
    """Find a trajectory within limits that excites the unknowns of an identification.

    Each joint follows a Fourier series that begins and ends at rest and without acceleration. Random
    coefficients are improved, so that the condition number of the regressor becomes small. Collisions of
    the robot with itself or its surroundings are not checked: give `ranges`, and simulate the trajectory.

    Parameters
    ----------
    model : RobotModel
        With a fixed base, and joints of one degree of freedom each.
    what : str or sequence of str
        As of :func:`identify`.
    duration, period : float
        [s]; the duration is a whole number of periods.
    joints : sequence of str, optional
        Joints that move, by default all; the others rest in the middle of their range.
    ranges : mapping, optional
        Lower and upper bound of a joint's position [rad, m], by name, within its limits.
    velocity_limits, position_limits : mapping, optional
        Limits [rad/s, m/s], and lower and upper limits [rad, m], by name, of joints for which the model
        has none: zero, negative, infinite or absent. ``*`` stands for all joints that lack one.
    velocity, effort : float
        Fractions of the limits of velocity and effort. A joint without an effort limit has no bound.
    margin : float
        Fraction of a joint's range at either end that is left free.
    trials : int
        Number of trajectories that are tried.
    rate : float
        Of points [1/s].
    seed : int
        Of random numbers.
    progress : callable, optional
        Called with the number of trials and the best condition so far.

    Returns
    -------
    Excitation

    Raises
    ------
    InputError
        An argument has a wrong value, a joint that moves has no limit of velocity or position, no joint
        would move, the robot has no degrees of freedom, or a joint's effort limit is too small.
    UnsupportedError
        The robot has a floating base, or a joint of several degrees of freedom.
    """
    instance("model", model, RobotModel)
    what, names = (what,) if isinstance(what, str) else tuple(what), model.dof_names
    moving = _read_joints(model, names if joints is None else joints)
    for name, value, unit in (("duration", duration, "[s]"), ("period", period, "[s]"), ("rate", rate, "[1/s]")):
        positive(name, value, unit)
    for name, value in (("velocity", velocity), ("effort", effort)):
        number(name, value, "a number within 0 … 1", lambda x: 0.0 < x <= 1.0)
    number("margin", margin, "a number within 0 … 0.45", lambda x: 0.0 < x <= 0.45)
    cycles = round(duration / period)
    if cycles < 1 or abs(cycles * period - duration) > 1e-9 * duration:
        raise InputError(f"duration is {duration:g} s, expected a whole number of periods of {period:g} s.")
    if rate * period < 2.0 * HARMONICS:
        least = 2.0 * HARMONICS / period
        raise InputError(
            f"rate is {rate:g} 1/s; expected {least:g} 1/s at least. Give a higher rate, or a longer period."
        )
    fastest, low, high = _find_limits(model, moving, velocity_limits or {}, position_limits or {}, ranges or {})
    margins = np.where(np.isin(names, list(ranges or {})), 0.0, margin)
    time = np.arange(round(duration * rate) + 1) / rate
    family = _Family((velocity * fastest, low, high), moving, period, time, margins)
    objective = _Objective(model, family, what, effort)
    best, condition = _search(family, objective, np.random.default_rng(seed), whole("trials", trials), progress)
    if best is None:
        raise InputError(objective.refusal())
    q, qd, qdd = family.trajectory(best)
    travel, speed = np.ptp(q, axis=0), abs(qd).max(axis=0)
    for k in np.flatnonzero(moving & ((travel < MIN_TRAVEL) | (speed < MIN_SPEED))):
        raise InputError(
            f"joint '{names[k]}' stands still: it moves over {travel[k]:.2g} rad or m at {speed[k]:.2g} rad/s or m/s at "
            "most. Widen its limits or its range, or leave it out of joints."
        )
    return Excitation(names, time, q, qd, qdd, objective.effort_of(q, qd, qdd), period, condition, what)


def _read_joints(model, joints):
    """Return which degrees of freedom move, bool (nv,)."""
    if not model.nv:
        raise InputError(f"robot '{model.name}' has no degrees of freedom; expected one joint at least that can move.")
    if model.floating_base or model.nq != model.nv:
        raise UnsupportedError(
            f"robot '{model.name}' has a floating base, or a joint of several degrees of freedom: nothing excites that."
        )
    _refuse_unknown("joints", joints, model)
    if not joints:
        raise InputError("joints is empty; expected one joint at least that moves.")
    return np.isin(model.dof_names, joints)


def _search(family, objective, rng, trials, progress):
    """Return the best genes and their condition: random ones, then steps from the best one, wider after a success."""
    best, value, width = None, np.inf, 0.3
    for trial in range(trials):
        random = best is None or trial < min(RANDOM_TRIALS, trials // 2)
        genes = family.random_genes(rng) if random else best + width * rng.normal(size=best.shape)
        condition = objective.condition(*family.trajectory(genes))
        if condition < value:
            best, value = genes, condition
        if not random:
            width = max(width * (1.5 if best is genes else 0.93), 1e-3)
        if progress:
            progress(trial + 1, value)
    return best, float(value)


def _refuse_unknown(what, names, model):
    for name in names:
        if name not in model.dof_names:
            joints = ", ".join(model.dof_names)
            raise InputError(f"{what}: '{name}' is not a joint of robot '{model.name}'; {joints} are.")


def _find_limits(model, moving, velocities, positions, ranges):
    """Return velocity, lower and upper limits: the model's, or given ones where the model has none; ranges within them."""
    names = model.dof_names
    velocity, lower, upper = model.velocity_limit.copy(), model.lower.copy(), model.upper.copy()
    slow = moving & ~((velocity > 0.0) & (velocity <= MAX_VELOCITY))
    widest = np.maximum(np.abs(lower), np.abs(upper))
    unbounded = moving & ~np.isin(names, model.continuous_joints) & ~((widest <= MAX_POSITION) & (lower < upper))
    velocity[slow], lower[unbounded], upper[unbounded] = np.inf, -np.inf, np.inf
    velocities = {name: (0.0, one) for name, one in velocities.items()}
    for what, given, low, high, missing in (
        ("velocity_limits", velocities, np.zeros(model.nv), velocity, slow),
        ("position_limits", positions, lower, upper, unbounded),
        ("ranges", ranges, lower, upper, unbounded),
    ):
        _refuse_unknown(what, [name for name in given if what == "ranges" or name != OTHERS], model)
        for k, name in enumerate(names):
            if name in given or (missing[k] and OTHERS in given):
                bounds = given.get(name, given.get(OTHERS))
                low[k], high[k] = _read_bounds(f"{what}: '{name}'", bounds, low[k], high[k])
                missing[k] = False
    lacks = (
        ("Velocity", slow, "finite numbers > 0", "--velocity-limit JOINT=LIMIT (velocity_limits)"),
        ("Position", unbounded, "lower < upper", "--position-limit JOINT=LOWER:UPPER (position_limits)"),
    )
    texts = [
        f"{what} limits of {', '.join(np.array(names)[missing])} are missing; expected {bounds}. Give {option}."
        for what, missing, bounds, option in lacks
        if missing.any()
    ]
    if texts:
        raise InputError(" ".join(texts))
    return velocity, lower, upper


def _read_bounds(name, given, low, high):
    try:
        least, most = map(float, given)
    except (TypeError, ValueError):
        least = most = np.nan
    if not (low <= least < most <= high and np.isfinite([least, most]).all()):
        raise InputError(f"{name} has {given!r}; expected finite limits that rise, within {low:g} … {high:g}.")
    return least, most


class _Family:
    """Trajectories within limits of position and velocity, by genes."""

    def __init__(self, limits, moving, period, time, margin):
        self.time, self.moving = time, moving
        self._fastest, low, high = limits
        bounded = np.isfinite(low) & np.isfinite(high)
        middle = 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0))
        self._rest = np.clip(middle, low, high)
        low, high = (np.where(np.isinf(x), sign * 0.5 * CONTINUOUS_RANGE, x) for sign, x in ((-1.0, low), (1.0, high)))
        self._low, self._high = low + margin * (high - low), high - margin * (high - low)
        w = 2.0 * np.pi / period * np.arange(1, HARMONICS + 1)
        # Velocities a cos wt + b sin wt and their slopes begin at zero: two coefficients fewer.
        held = np.zeros((2, 2 * HARMONICS))
        held[0, :HARMONICS], held[1, HARMONICS:] = 1.0, w
        self._free, self._w = np.linalg.svd(held)[2][2:].T, w
        self._bases = self._make_bases(time)
        self._dense = self._make_bases(np.linspace(0.0, period, POINTS_PER_PERIOD, endpoint=False))[:2]

    def _make_bases(self, time):
        """Return bases of position, velocity and acceleration."""
        w = self._w
        sine, cosine = np.sin(np.outer(time, w)), np.cos(np.outer(time, w))
        columns = (sine / w, -cosine / w), (cosine, sine), (-sine * w, cosine * w)
        return [np.hstack(pair) @ self._free for pair in columns]

    def random_genes(self, rng):
        """Return coefficients of each joint, its place in its range, and its fraction of the range."""
        count = len(self.moving)
        return np.hstack([rng.normal(size=(count, self._free.shape[1])), rng.uniform(-1, 1, (count, 2))])

    def trajectory(self, genes):
        """Return positions, velocities and accelerations, (T, nv) each."""
        shape = genes[:, :-2].T
        position, velocity = (base @ shape for base in self._dense)  # limits hold between points, too
        low, high, span = position.min(axis=0), position.max(axis=0), self._high - self._low
        place, part = 0.5 + 0.5 * np.tanh(genes[:, -2]), 0.75 + 0.25 * np.tanh(genes[:, -1])
        fastest = np.maximum(abs(velocity).max(axis=0), 1e-12)
        scale = np.minimum(span / np.maximum(high - low, 1e-12), self._fastest / fastest)
        scale = np.where(self.moving, scale * part, 0.0)
        first = self._low + place * (span - scale * (high - low)) - scale * low
        position, velocity, acceleration = (scale * (base @ shape) for base in self._bases)
        return np.where(self.moving, first, self._rest) + position, velocity, acceleration


class _Objective:
    """Condition number of the regressor of the wanted unknowns over a trajectory."""

    def __init__(self, model, family, what, effort):
        self._model, self._dynamics, self._time = model, DiagonalDynamics(model), family.time
        self._limit = effort * np.where(model.effort_limit > 0.0, model.effort_limit, np.inf)
        self._worst, self._regressors = np.full(model.nv, np.inf), Regressors(model)
        self._columns = self._find_columns(what, family.moving)
        generators = [np.random.default_rng(seed) for seed in range(8)]
        excited = sum(self._information(*family.trajectory(family.random_genes(rng))) for rng in generators)
        if not np.any(np.diag(excited) > 0.0):
            names = ", ".join(np.array(model.dof_names)[family.moving])
            raise InputError(
                f"what is {', '.join(what)}; expected unknowns that a motion of {names} shows. Let other joints move."
            )
        self._scale = 1.0 / np.sqrt(np.maximum(np.diag(excited), 1e-300))
        values, vectors = np.linalg.eigh(self._scale[:, None] * excited * self._scale)
        self._basis = vectors[:, values > MIN_EIGENVALUE * values[-1]]

    def _find_columns(self, what, moving):
        """Return the unknowns of `what`."""
        model, bodies, own = self._model, self._regressors.bodies, self._regressors.own
        known = {
            "friction": [own(column)[moving] for column in (DAMPING, FRICTION, OFFSET)],
            "rotors": [own(ROTOR)[moving]],
            "inertias": [np.arange(PARAMETERS * len(bodies))],
        }
        places = [PARAMETERS * np.flatnonzero(bodies == model.placement_in_body(link)[0]) for link in model.link_names]
        for link, at in zip(model.link_names, places, strict=True):
            if len(at):  # a body with inertia
                known[f"payload:{link}"] = [at[0] + np.arange(PARAMETERS)]
        for one in what:
            if one not in known:
                raise InputError(f"what has {one!r}, expected some of friction, rotors, inertias, payload:<link>.")
        if not what:
            raise InputError("what is empty: nothing is to be excited.")
        return np.unique(np.concatenate([columns for one in what for columns in known[one]]))

    def effort_of(self, *motion):
        """Return efforts of the model, friction included, (T, nv)."""
        return self._dynamics.inverse_dynamics_batch(*motion, friction=True)

    def _information(self, *motion):
        """Return AᵀA of the wanted unknowns, each joint's rows over the variance of its effort."""
        effort = self.effort_of(*motion)
        sums = self._regressors.sum_segment(self._time, *motion[:2], effort)
        A, _ = self._regressors.weighted(sums, np.maximum(effort.var(axis=0), 1e-12))
        return A[np.ix_(self._columns, self._columns)]

    def condition(self, *motion):
        """Return the condition number; inf where an effort does not suffice."""
        part = abs(self.effort_of(*motion)).max(axis=0) / self._limit
        if (part > 1.0).any():
            self._worst = np.minimum(self._worst, part)
            return np.inf
        scaled = self._scale[:, None] * self._information(*motion) * self._scale
        values = np.linalg.eigvalsh(self._basis.T @ scaled @ self._basis)
        return float(np.sqrt(values[-1] / values[0])) if values[0] > 0.0 else np.inf

    def refusal(self):
        """Return why no trajectory is possible."""
        if np.isinf(self._worst).all():
            return "no trajectory tells all unknowns of what apart. Let more joints move, or ask for fewer unknowns."
        k = int(np.argmax(np.where(np.isinf(self._worst), 0.0, self._worst)))
        return (
            f"joint '{self._model.dof_names[k]}' would need {self._worst[k]:.2g} times the effort that may be used: give a "
            "longer period, narrower ranges, or a larger part of the limits (effort)."
        )
