# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories that excite the unknowns of an identification."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.checks import array_of, choice, instance, number, positive, whole
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.normal_equations import Regressors, require_single_joints
from diag_dynamics.identification.selection import BY_JOINT, read_what
from diag_dynamics.model import RobotModel
from diag_dynamics.sweeps.regressors import PARAMETERS
from diag_dynamics.text import distinct
from diag_dynamics.yaml_files import yaml_text

HARMONICS = 5
RANDOM_TRIALS = 24  # before the best trajectory is improved
MIN_EIGENVALUE = 1e-10  # of a combination of unknowns that motions excite, relative to the largest
MARGIN = 0.05  # fraction of a range at either end that is left free, unless the range is given
MIN_RANGE = 1e-4  # of a limit that a joint moves within [rad, m; rad/s, m/s]
POINTS_PER_PERIOD = 2000  # at which a trajectory is scaled to its limits
LIMITS = {
    "Velocity": (
        100.0,
        "expected finite numbers > 0. Give --velocity-limit JOINT=LIMIT (velocity_limits).",
    ),
    "Position": (1000.0, "expected lower < upper. Give --range JOINT=LOWER:UPPER (ranges)."),
}
"""Largest limits, as larger ones are placeholders such as 1e16 [rad/s, m/s; rad, m], and what to do
about others."""


class Excitation(NamedTuple):
    """A periodic trajectory of all degrees of freedom that begins and ends at rest.

    Attributes
    ----------
    joints : tuple of str
        Names of the nv columns.
    time : ndarray, shape (T,)
        [s], from 0.
    position, velocity, acceleration, effort : ndarray, shape (T, nv)
        [rad, m], [rad/s, m/s], [rad/s², m/s²], and efforts of the model with friction [N m, N].
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

    def to_json(self) -> str:
        """Return plain lists and numbers as JSON."""
        plain = {key: np.asarray(value).tolist() for key, value in self._asdict().items()}
        return json.dumps(plain, allow_nan=False)

    def to_message(self, approach: float = 5.0) -> str:
        """Return a trajectory_msgs/JointTrajectory in YAML for ``ros2 topic pub``.

        The controller's `tracking` accepts it.

        Parameters
        ----------
        approach : float
            Time to the first point [s].
        """
        points = []
        names = "positions", "velocities", "accelerations"
        for t, *values in zip(
            self.time, self.position, self.velocity, self.acceleration, strict=True
        ):
            seconds, nanoseconds = divmod(round((t + approach) * 1e9), 10**9)
            point = {
                name: np.round(column, 9).tolist()
                for name, column in zip(names, values, strict=True)
            }
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
    velocity: float = 0.5,
    effort: float = 0.7,
    trials: int = 300,
    rate: float = 50.0,
    seed: int = 0,
    progress: Callable[[int, float], object] | None = None,
) -> Excitation:
    """Find a trajectory within limits that excites the unknowns of an identification.

    Each joint follows a Fourier series that begins and ends at rest and without acceleration.
    Random coefficients are improved, so that the condition number of the regressor becomes small.
    Collisions of the robot with itself or its surroundings are not checked: give `ranges`, and
    simulate the trajectory.

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
        Lower and upper bound of a joint's position [rad, m], by name, within its limits. A joint
        for which the model has no limits, such as a continuous one, requires a range. ``*`` stands
        for all such joints.
    velocity_limits : mapping, optional
        Limits [rad/s, m/s] by name, required of joints for which the model has none: zero,
        negative, infinite or absent. ``*`` stands for all such joints.
    velocity, effort : float
        Fractions of the limits of velocity and effort. A joint without an effort limit has no
        bound.
    trials, seed : int
        Number of trajectories that are tried, and seed of their random numbers.
    rate : float
        Of points [1/s].
    progress : callable, optional
        Called with the number of trials and the best condition so far.

    Returns
    -------
    Excitation

    Raises
    ------
    InputError
        An argument has a wrong value, a joint that moves has no limit of velocity or position, the
        robot has no degrees of freedom, or a joint would need too much effort.
    UnsupportedError
        The robot has a floating base, or a joint of several degrees of freedom.
    """
    instance("model", model, RobotModel)
    names = model.dof_names
    if not names:
        raise InputError(
            f"robot '{model.name}' has no degrees of freedom; expected at least one movable joint."
        )
    require_single_joints(model)
    joints = names if joints is None else joints
    for name in joints:
        choice("joints: one of them", name, names)
    moving = np.isin(names, joints)
    unknowns, _, payloads = read_what(what, model)
    for name, value, unit in (
        ("duration", duration, "[s]"),
        ("period", period, "[s]"),
        ("rate", rate, "[1/s]"),
    ):
        positive(name, value, unit)
    for name, value in (("velocity", velocity), ("effort", effort)):
        number(name, value, "a number within 0 … 1", lambda x: 0.0 < x <= 1.0)
    cycles = round(duration / period)
    least = 2.0 * HARMONICS / period
    if cycles < 1 or abs(cycles * period - duration) > 1e-9 * duration:
        raise InputError(
            f"duration is {duration:.15g} s; expected a whole number of periods of {period:.15g} s."
        )
    if rate < least:
        rate_text, bound = distinct(rate, least)
        raise InputError(
            f"rate is {rate_text} 1/s; expected at least {bound} 1/s. Increase rate or period."
        )
    ranges = dict(ranges or {})
    (_, fastest), (low, high) = _find_limits(model, moving, velocity_limits or {}, ranges)
    free = np.where(np.isin(names, list(ranges)), 0.0, MARGIN) * (high - low)
    time = np.arange(round(duration * rate) + 1) / rate
    series = _Series(
        model, moving, (velocity * fastest, low + free, high - free, effort), period, time
    )
    series.choose_unknowns(unknowns, [model.placement_in_body(link)[0] for link in payloads])
    best, condition = _search(
        series, np.random.default_rng(seed), whole("trials", trials), progress
    )
    q, qd, qdd, tau = series.motion(best)
    return Excitation(names, time, q, qd, qdd, tau, period, condition, unknowns)


def _find_limits(model, moving, velocities, positions):
    """Return lower and upper limits of velocity and of position, (2, nv) each.

    They are the model's, arguments within them, or arguments where the model has none.
    """
    texts = []
    results = []
    arguments = {name: (0.0, largest) for name, largest in velocities.items()}, positions
    limits = (np.zeros(model.nv), model.velocity_limit), (model.lower, model.upper)
    for (kind, (largest, advice)), bounds, limit in zip(
        LIMITS.items(), arguments, limits, strict=True
    ):
        for name in bounds:
            choice(f"{kind} limits: a joint", name, (*model.dof_names, ALL))
        is_limited = (limit[0] + MIN_RANGE <= limit[1]) & (np.abs(limit).max(axis=0) <= largest)
        result = np.where(is_limited, limit, [[-1.0], [1.0]])
        missing = []
        for k, name in enumerate(model.dof_names):
            if name in bounds or (ALL in bounds and not is_limited[k]):
                within = result[:, k] if is_limited[k] else (-np.inf, np.inf)
                entry = bounds.get(name, bounds.get(ALL))
                result[:, k] = _read_bounds(kind, name, entry, *within)
            elif moving[k] and not is_limited[k]:
                missing.append(name)
        if missing:
            texts.append(f"{kind} limits of {', '.join(missing)} are missing; {advice}")
        results.append(result)
    if texts:
        raise InputError(" ".join(texts))
    return results


def _read_bounds(kind, name, entry, low, high):
    bounds = array_of(entry)
    if (
        bounds is None
        or bounds.shape != (2,)
        or not low <= bounds[0] <= bounds[1] - MIN_RANGE <= high - MIN_RANGE
        or np.isinf(bounds).any()
    ):
        raise InputError(
            f"{kind} limits of '{name}' are {entry!r}; expected finite limits that rise by "
            f"{MIN_RANGE:g} or more, within {low:g} … {high:g}."
        )
    return bounds


def _search(series, rng, trials, progress):
    """Return the best genes and their condition.

    Random genes come first, then steps from the best ones, wider after a success.
    """
    best = None
    value = np.inf
    width = 0.3
    for trial in range(trials):
        random = best is None or trial < min(RANDOM_TRIALS, trials // 2)
        genes = series.random_genes(rng) if random else best + width * rng.normal(size=best.shape)
        condition = series.condition(genes)
        if condition < value:
            best = genes
            value = condition
        if not random:
            width = max(width * (1.5 if best is genes else 0.93), 1e-3)
        if progress:
            progress(trial + 1, value)
    if best is None:
        raise InputError(
            "no trajectory within the limits of effort makes all unknowns of what observable. "
            "Increase period, effort or trials, narrow the ranges, move more joints, or choose "
            "fewer unknowns."
        )
    return best, float(value)


class _Series:
    """Fourier series by genes, and the parameters that they excite.

    Genes are coefficients, place and fraction of the range of each joint.
    """

    def __init__(self, model, moving, limits, period, time):
        self._model = model
        self._dynamics = DiagonalDynamics(model)
        self._time = time
        self._moving = moving
        self._fastest, self._low, self._high, effort = limits
        self._limit = effort * model.effort_bound
        w = 2.0 * np.pi / period * np.arange(1, HARMONICS + 1)
        # Velocities a cos wt + b sin wt and their slopes begin at zero: two coefficients fewer.
        constraints = np.zeros((2, 2 * HARMONICS))
        constraints[0, :HARMONICS] = 1.0
        constraints[1, HARMONICS:] = w
        free = np.linalg.svd(constraints)[2][2:].T
        self._bases = _bases(time, w, free)
        dense = np.linspace(0.0, period, POINTS_PER_PERIOD, endpoint=False)
        self._dense = _bases(dense, w, free)[:2]

    def choose_unknowns(self, names, carriers):
        """Choose the unknowns of these names, scaled by eight random motions.

        Combinations that no motion excites are omitted.
        """
        self._regressors = regressors = Regressors(self._model, carriers)
        bodies = np.isin(regressors.bodies, carriers) | ("inertias" in names)
        chosen = np.zeros(regressors.size, bool)
        chosen[: PARAMETERS * len(bodies)] = np.repeat(bodies, PARAMETERS)
        for step, columns in BY_JOINT.items():
            for column in columns if step in names else ():
                chosen[regressors.own(column)] = self._moving
        self._columns = np.flatnonzero(chosen)
        genes = [self.random_genes(np.random.default_rng(seed)) for seed in range(8)]
        excited = sum(self._information(*self.motion(motion)) for motion in genes)
        self._scale = 1.0 / np.sqrt(np.maximum(np.diag(excited), 1e-300))
        values, vectors = np.linalg.eigh(self._scale[:, None] * excited * self._scale)
        self._basis = vectors[:, values > MIN_EIGENVALUE * values.max(initial=0.0)]

    def random_genes(self, rng):
        """Return random genes, (nv, 2 HARMONICS)."""
        count = self._model.nv
        return np.hstack(
            [rng.normal(size=(count, 2 * HARMONICS - 2)), rng.uniform(-1, 1, (count, 2))]
        )

    def motion(self, genes):
        """Return positions, velocities, accelerations and efforts with friction, (T, nv) each."""
        shape = genes[:, :-2].T
        place = 0.5 + 0.5 * np.tanh(genes[:, -2])
        part = 0.75 + 0.25 * np.tanh(genes[:, -1])
        # Limits hold between points, too.
        position, velocity = (base @ shape for base in self._dense)
        low = position.min(axis=0)
        travel = np.ptp(position, axis=0)
        span = self._high - self._low
        fastest = abs(velocity).max(axis=0)
        scale = np.minimum(
            span / np.maximum(travel, 1e-12), self._fastest / np.maximum(fastest, 1e-12)
        )
        scale = np.where(self._moving, scale * part, 0.0)
        first = self._low + place * (span - scale * travel) - scale * low
        position, velocity, acceleration = (scale * (base @ shape) for base in self._bases)
        position += np.where(self._moving, first, self._low + 0.5 * span)
        motion = position, velocity, acceleration
        return *motion, self._dynamics.inverse_dynamics(*motion, friction=True)

    def condition(self, genes):
        """Return the condition number; inf where an effort does not suffice."""
        motion = self.motion(genes)
        if (abs(motion[-1]) > self._limit).any():
            return np.inf
        scaled = self._scale[:, None] * self._information(*motion) * self._scale
        values = np.linalg.eigvalsh(self._basis.T @ scaled @ self._basis)
        return float(np.sqrt(values[-1] / values[0])) if len(values) and values[0] > 0.0 else np.inf

    def _information(self, q, qd, _, tau):
        """Return AᵀA of the wanted unknowns, each joint's rows over the variance of its effort."""
        sums = self._regressors.sum_segment(self._time, q, qd, tau)
        A, _ = self._regressors.weighted(sums, np.maximum(tau.var(axis=0), 1e-12))
        return A[np.ix_(self._columns, self._columns)]


def _bases(time, w, free):
    """Return bases of position, velocity and acceleration of the free coefficients."""
    sine = np.sin(np.outer(time, w))
    cosine = np.cos(np.outer(time, w))
    columns = (sine / w, -cosine / w), (cosine, sine), (-sine * w, cosine * w)
    return [np.hstack(pair) @ free for pair in columns]
