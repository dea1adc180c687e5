# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Velocities against positions: one regression of Δq on ∫q̇dt gives units, errors and delays."""

import math

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.rotations import wrap_angle

WINDOW = 0.05  # time over which positions are compared with velocities [s]
MIN_R2 = 0.9  # squared correlation of Δq and ∫q̇dt that determines a ratio
MIN_EXPLAINED = 0.36  # fraction of the squares of Δq − ∫q̇dt that a delay explains
RATIO_ERROR = 1.1  # factor up to which a ratio is a known one
DEGREE = math.pi / 180.0
RATIOS = {
    1e-3: "times seem to be milliseconds (scale: {time: ms} in a column map)",
    1e-6: "times seem to be microseconds (scale: {time: us} in a column map)",
    1e-9: "times seem to be nanoseconds (scale: {time: ns} in a column map)",
    60.0: "times seem to be minutes, 60 s each (scale: {time: min} in a column map)",
    3600.0: "times seem to be hours, 3600 s each (scale: {time: h} in a column map)",
    86400.0: "times seem to be days, 86400 s each (scale: {time: d} in a column map)",
    DEGREE: "velocities seem to be in degrees (scale: {velocity: deg/s} in a column map)",
    1.0 / DEGREE: "positions seem to be in degrees (scale: {position: deg} in a column map)",
    -1.0: "velocities seem to have the wrong sign",
}
"""Causes by the ratio of Δq to ∫q̇dt."""
UNKNOWN = "times, positions or velocities seem to have a wrong unit"

MIN_TRAVEL = 0.01  # least distance from the first position of a joint with a ratio [rad, m]
SLOPE_ERROR, MIN_DELAY_R2, DELAY_TRAVEL = 0.02, 0.49, 0.02
"""Error of the slope without a delay; least squared correlation and travel of a joint that shows
the delay [rad, m]."""

MAX_DELAY, STEP, FINE = 0.3, 5e-3, 0.1
"""Largest delay, step of its search [s], and a finer step over that."""


class VelocityRelation:
    """Regression of Δq on ∫q̇dt, and of their difference on Δq̇, by joint."""

    def __init__(self, count):
        self._products = np.zeros((4, 4, count))

    def add_steps(self, changes, integrals, rates=None):
        """Add Δq, ∫q̇dt and Δq̇ of steps, (T, n) each; Δq̇ is required for delays alone."""
        rates = np.zeros_like(changes) if rates is None else rates
        steps = np.stack([changes, integrals, changes - integrals, rates])
        self._products += np.einsum("itk,jtk->ijk", steps, steps)

    @property
    def slope(self):
        """Slope of Δq over ∫q̇dt, (n,); 1 if units agree, NaN at rest."""
        with np.errstate(all="ignore"):
            return self._products[0, 1] / self._products[1, 1]

    @property
    def r2(self):
        """Squared correlation of Δq and ∫q̇dt, (n,); NaN at rest."""
        with np.errstate(all="ignore"):
            sizes = self._products[0, 0] * self._products[1, 1]
            return self._products[0, 1] ** 2 / sizes

    @property
    def travel(self):
        """Sum of Δq², (n,)."""
        return self._products[0, 0]

    @property
    def error(self):
        """Root mean square of Δq − ∫q̇dt over that of Δq, (n,); NaN at rest."""
        with np.errstate(all="ignore"):
            square = self._products[2, 2] / self.travel
            return np.where(self.travel > 0.0, np.sqrt(square), np.nan)

    @property
    def delay(self):
        """Delay of velocities that explains most of Δq − ∫q̇dt, (n,) [s]; NaN at constant ones."""
        with np.errstate(all="ignore"):
            return self._products[2, 3] / self._products[3, 3]

    @property
    def shows_delay(self):
        """Whether the delay explains much of Δq − ∫q̇dt, bool (n,)."""
        square = self._products[2, 3] ** 2
        return square > MIN_EXPLAINED * self._products[2, 2] * self._products[3, 3]


def turning_dofs(model):
    """Return which degrees of freedom may turn beyond ±π without another one, bool (nv,)."""
    coupled = {joint for group in model.coupled_groups for joint in group}
    return np.isin(model.dof_names, list(set(model.continuous_joints) - coupled))


def position_changes(position, continuous):
    """Return changes of positions from row to row, (T − 1, n); within ±π of continuous joints."""
    changes = np.diff(position, axis=0)
    changes[:, continuous] = wrap_angle(changes[:, continuous])
    return changes


def position_ratios(elapsed, changes, integrals):
    """Return the slope of Δq over ∫q̇dt of each joint, (n,), by steps of times [s], (T,).

    It is 1 if units agree, and NaN without correlation or at rest.
    """
    relation = VelocityRelation(changes.shape[1])
    follows = elapsed >= 0.0
    elapsed, changes, integrals = (steps[follows] for steps in (elapsed, changes, integrals))
    forward = np.flatnonzero(elapsed > 0.0)
    if len(forward):
        begins = np.append(0, forward[:-1] + 1)  # changes under one stamp belong to the next step
        usual = elapsed[forward] < 2.0 * np.median(elapsed[forward])
        relation.add_steps(
            np.add.reduceat(changes, begins)[usual], np.add.reduceat(integrals, begins)[usual]
        )
    travel = np.abs(np.cumsum(changes, axis=0)).max(axis=0, initial=0.0)
    return np.where((relation.r2 > MIN_R2) & (travel > MIN_TRAVEL), relation.slope, np.nan)


def cause_of_ratio(ratio):
    """Return the cause of a ratio of Δq to ∫q̇dt that is not 1; None for an unknown one."""
    distances = {
        cause: abs(np.log(ratio / expected))
        for expected, cause in RATIOS.items()
        if ratio / expected > 0.0
    }
    cause = min(distances, key=distances.get)
    return cause if distances[cause] < np.log(RATIO_ERROR) else None


def find_delay(model, name, runs):
    """Return the delay of velocities against positions [s] by times, positions and rates of runs.

    Raises InputError if their units differ, or it is too long.
    """
    longest = min(MAX_DELAY, 0.1 * max(t[-1] - t[0] for t, *_ in runs))
    tracks = [_track(turning_dofs(model), longest, *run) for run in runs]
    travel = np.max([np.ptp(q, axis=0) for _, q, _ in runs], axis=0)
    moved = np.flatnonzero(travel > DELAY_TRAVEL)
    changes = np.concatenate([_increments(q, t, at) for t, q, _, at in tracks])

    def relate(delay):
        parts = [_increments(integral, t, at + delay) for t, _, integral, at in tracks]
        relation = VelocityRelation(model.nv)
        relation.add_steps(changes, np.concatenate(parts))
        return relation

    def costs_of(delays):
        return np.array([1.0 - np.nan_to_num(relate(delay).r2[moved]) for delay in delays])

    steps = int(longest / STEP)
    delays = STEP * np.arange(-steps, steps + 1)
    costs = costs_of(delays)
    shown = costs.min(axis=0) <= 1.0 - MIN_DELAY_R2
    joints = moved[shown]
    if not len(joints):
        return 0.0
    best = int(np.argmin(costs[:, shown].sum(axis=1)))
    if steps and best in (0, 2 * steps):
        names = ", ".join(f"'{model.dof_names[k]}'" for k in joints)
        late = "later" if best else "earlier"
        raise InputError(
            f"{name}: velocities are {1e3 * longest:.0f} ms or more {late} than positions, those "
            f"of joint {names}; expected less. Check their time stamps and joints."
        )
    fine = delays[best] + FINE * STEP * np.arange(-1.0 / FINE, 1.0 / FINE + 0.5)
    cost = costs_of(fine)[:, shown].sum(axis=1)
    best = int(np.argmin(cost))
    delay = fine[best]
    if 0 < best < len(fine) - 1:
        before, least, after = cost[best - 1 : best + 2]  # a parabola passes through these
        bend = before - 2.0 * least + after
        delay += 0.5 * (before - after) / bend * FINE * STEP if bend > 0.0 else 0.0
    relation = relate(delay)
    for k in joints:
        # Noise of velocities makes one slope too small, noise of positions the other one too large.
        slope = relation.slope[k]
        low, high = sorted((slope, slope / relation.r2[k]), key=abs)
        if high < 1.0 - SLOPE_ERROR or low > 1.0 + SLOPE_ERROR:
            cause = cause_of_ratio(low) or UNKNOWN
            raise InputError(
                f"{name}: positions of joint '{model.dof_names[k]}' change by {low:.4g} times the "
                f"integral of its velocities; expected 1: {cause}"
            )
    return float(delay)


def _track(turning, longest, t, q, qd):
    """Return times, positions, integrated velocities, and the times between which they change."""
    window = max(WINDOW, np.median(np.diff(t)))
    points = np.arange(np.ceil((t[-1] - t[0] - 2.0 * longest) / window))
    q = np.where(turning, np.unwrap(q, axis=0), q)
    steps = 0.5 * (qd[1:] + qd[:-1]) * np.diff(t)[:, None]
    integral = np.cumsum(np.r_[np.zeros_like(qd[:1]), steps], axis=0)
    return t, q, integral, t[0] + longest + window * points


def _increments(columns, t, at):
    """Return changes of columns between times."""
    return np.diff(interpolated(columns, t, at), axis=0)


def interpolated(columns, t, at):
    """Return columns (T, n) of times t at other times."""
    return np.column_stack([np.interp(at, t, column) for column in columns.T])
