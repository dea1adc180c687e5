# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units of rejected values: whether positions or velocities beyond their bounds are degrees."""

import math

import numpy as np

from diag_dynamics.assembly.assembler import joints_of
from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.single_joints import places
from diag_dynamics.sweeps.spatial import ANGULAR_X

UNITS = "units"
"""Cause of the finding."""

MAX_SAMPLE, MIN_SAMPLE = 2000, 10
"""Rejected messages that are sampled, the first ones."""

MIN_REJECTED = 0.5
"""Fraction of all messages that have to be rejected: fewer are garbage between good ones."""

MIN_WITHIN, SLACK = 0.99, 0.2
"""Fraction of the values that have to be within the limits as degrees, and slack of these [rad]."""

MIN_TRAVEL, MIN_CORRELATION, NEAR = 0.01, 0.9, 1.2
"""Least range and least squared correlation of Δq with q̇dt of a ratio, and factor within which it is a known one."""

DEGREE = math.pi / 180.0


class RejectedUnits:
    """Samples messages that were rejected for absurd values.

    Parameters
    ----------
    model : RobotModel
    map_name : callable
        Returns the robot's name of a joint by its name in messages.
    """

    def __init__(self, model, map_name):
        joints, bodies = joints_of(model), model.bodies
        own = bodies[1:][bodies["owner"][1:] == np.arange(1, len(bodies))]
        rotary = {model.dof_names[record["dof"]] for record in own if record["direction"] >= ANGULAR_X}
        which = [k for k, name in enumerate(joints.names) if name in rotary]
        self._map_name, self._names = map_name, [joints.names[k] for k in which]
        self._continuous = np.array([name in joints.continuous for name in self._names], dtype=bool)
        self._lower, self._upper = joints.lower[which], joints.upper[which]
        self._limit = np.where(joints.velocity[which] > 0.0, joints.velocity[which], np.inf)
        self._rows = []

    def read(self, parts, rejected):
        """Sample messages.

        Parameters
        ----------
        parts : sequence of JointStates
        rejected : ndarray of bool
            By the place of a message.
        """
        if not rejected.any() or len(self._rows) >= MAX_SAMPLE or not self._names:
            return
        found = []
        for part in parts:
            names = [self._map_name(name) for name in part.names]
            if not set(self._names) <= set(names) or part.position.shape[1] != len(names):
                continue
            at, missing = places(self._names, names), np.full(len(self._names), math.nan)
            for k in np.flatnonzero(rejected[part.rows]).tolist():
                velocity = part.velocity[k, at] if part.velocity.shape[1] == len(names) else missing
                found.append((part.rows[k], part.sec[k] + part.nanosec[k] / SECOND, part.position[k, at], velocity))
        found.sort(key=lambda one: one[0])
        self._rows += found[: MAX_SAMPLE - len(self._rows)]

    def text(self):
        """Return the units that the values seem to have, and what to do; None if they are not degrees."""
        if len(self._rows) < MIN_SAMPLE:
            return None
        _, t, position, velocity = (np.array(column) for column in zip(*self._rows, strict=True))
        ratio = self._ratio(t - t[0], position, velocity)
        positions, velocities = self._are_positions_degrees(position), self._are_velocities_degrees(velocity)
        if positions:
            slow = np.isfinite(velocity).any() and not _is_near(ratio, 1.0 / DEGREE)
            velocities = slow and (_is_near(ratio, 1.0) or velocities)
        else:
            velocities = velocities and _is_near(ratio, DEGREE)
        units = ["position: deg"] * positions + ["velocity: deg/s"] * velocities
        if not units:
            return None
        agrees = _is_near(ratio * (DEGREE if positions else 1.0) / (DEGREE if velocities else 1.0), 1.0)
        what = " and ".join(["positions"] * positions + ["velocities"] * velocities)
        agreed = ", and positions then change as velocities say" if agrees else ""
        return (
            f"{what} seem to be in degrees: most are beyond what the joints can do, and as degrees within it{agreed}. "
            f"In a table, scale: {{{', '.join(units)}}} in a map of columns says so (docs/recordings.md); messages have "
            "radians (REP 103)"
        )

    def _are_positions_degrees(self, position):
        """Whether positions are beyond the limits, and within them as degrees; those of continuous joints have no bound."""
        limited = ~self._continuous & np.isfinite(self._lower) & np.isfinite(self._upper)
        q, lower, upper = position[:, limited], self._lower[limited] - SLACK, self._upper[limited] + SLACK
        beyond = ((q < lower) | (q > upper)).any(axis=1)
        return bool(
            beyond.mean() > MIN_REJECTED and ((q * DEGREE >= lower) & (q * DEGREE <= upper)).mean() >= MIN_WITHIN
        )

    def _are_velocities_degrees(self, velocity):
        beyond = (np.abs(velocity) > self._limit).any(axis=1)
        return bool(beyond.mean() > MIN_REJECTED and (np.abs(velocity) * DEGREE <= self._limit).mean() >= MIN_WITHIN)

    def _ratio(self, t, position, velocity):
        """Return the median over joints of the ratio of Δq to q̇dt; NaN if they do not correlate."""
        elapsed = np.diff(t)[:, None]
        if not (elapsed > 0.0).any():
            return math.nan
        steady = (elapsed > 0.0) & (elapsed < 2.0 * np.median(elapsed[elapsed > 0.0]))
        travelled, integral = np.diff(position, axis=0), 0.5 * elapsed * (velocity[1:] + velocity[:-1])
        turned = (travelled + np.pi) % (2.0 * np.pi) - np.pi
        travelled = np.where(self._continuous, turned, travelled)
        known = steady & np.isfinite(travelled) & np.isfinite(integral)
        travelled, integral = (np.where(known, x, 0.0) for x in (travelled, integral))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            travel, change, together = (travelled**2).sum(0), (integral**2).sum(0), (travelled * integral).sum(0)
            clear = (together**2 > MIN_CORRELATION * travel * change) & (np.ptp(position, axis=0) > MIN_TRAVEL)
            ratios = (together / change)[clear]
        return float(np.median(ratios)) if len(ratios) else math.nan


def _is_near(ratio, expected):
    return 1.0 / NEAR < ratio / expected < NEAR


def refuse_units(findings):
    """Reject a recording whose values are in degrees, by an InputError."""
    for finding in findings:
        if finding.cause == UNITS:
            raise InputError(f"{finding.text}.")
