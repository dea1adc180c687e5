# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units of values that were refused: whether positions or velocities beyond what can be are degrees."""

import math

import numpy as np

from diag_dynamics.assembly.assembler import joints_of
from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.single_joints import places
from diag_dynamics.sweeps.spatial import ANGULAR_X

UNITS = "units"
"""Cause of the finding."""

SAMPLE, FEWEST = 2000, 10
"""Refused messages that are looked at, the first ones; and how many there have to be."""

MOST = 0.5
"""Part of all messages that have to be refused: less are garbage between good ones, and no unit."""

WITHIN, SLACK = 0.99, 0.2
"""Part of the values that have to be within the limits of their joints as degrees, and how far these may be left [rad]."""

TRAVEL = 0.01
"""Range of a joint's positions [rad, or what they are in] from which they can be compared with velocities."""

ALIKE, NEAR = 0.9, 1.2
"""Squared correlation of Δq with q̇dt from which their ratio is told; and factor up to which it is one that is expected."""

DEGREE = math.pi / 180.0


class RefusedUnits:
    """Looks at messages that were refused for absurd values.

    Joints that turn for ever say nothing by their positions, which have no bound: one of them may truly be far round.

    Parameters
    ----------
    model : RobotModel
    map_name : callable, optional
        Returns the robot's name of a joint by its name in messages.
    """

    def __init__(self, model, map_name=None):
        self._map_name = map_name
        joints, bodies = joints_of(model), model.bodies
        own = bodies[1:][bodies["owner"][1:] == np.arange(1, len(bodies))]
        rotary = {model.dof_names[record["dof"]] for record in own if record["direction"] >= ANGULAR_X}
        which = [k for k, name in enumerate(joints.names) if name in rotary]
        self._names = [joints.names[k] for k in which]
        self._turns = np.array([name in joints.continuous for name in self._names], dtype=bool)
        self._lower, self._upper = joints.lower[which], joints.upper[which]
        self._fastest = joints.velocity[which]
        self._rows = []

    def read(self, parts, rejected):
        """Sample messages that were rejected.

        Parameters
        ----------
        parts : sequence of JointStates
        rejected : ndarray of bool
            By the place of a message.
        """
        if not rejected.any() or len(self._rows) >= SAMPLE or not self._names:
            return
        found = []
        for part in parts:
            names = [self._map_name(name) for name in part.names] if self._map_name else part.names
            if not set(self._names) <= set(names) or part.position.shape[1] != len(names):
                continue
            at = places(self._names, names)
            for k in np.flatnonzero(rejected[part.rows]).tolist():
                velocity = part.velocity[k, at] if part.velocity.shape[1] == len(names) else np.full(len(at), math.nan)
                stamp = part.sec[k] + part.nanosec[k] / SECOND
                found.append((part.rows[k], (stamp, part.position[k, at], velocity)))
        found.sort(key=lambda one: one[0])
        self._rows += [row for _, row in found[: SAMPLE - len(self._rows)]]

    def text(self):
        """What units the values seem to have, and what to do; None if they are not degrees."""
        if len(self._rows) < FEWEST:
            return None
        t, position, velocity = (np.array(column) for column in zip(*self._rows, strict=True))
        ratio = self._ratio(t - t[0], position, velocity)
        slow = np.isfinite(velocity).any() and not _near(ratio, 1.0 / DEGREE)
        if self._far(position):
            told, what = ["position: deg"], "positions"
            if slow and (_near(ratio, 1.0) or self._fast(velocity)):
                told, what = [*told, "velocity: deg/s"], "positions and velocities"
        elif self._fast(velocity) and _near(ratio, DEGREE):
            told, what = ["velocity: deg/s"], "velocities"
        else:
            return None
        agreed = ", and positions then change as velocities say" if _agree(told, ratio) else ""
        return (
            f"{what} seem to be in degrees: most are beyond what the joints can do, and as degrees within it{agreed}. "
            f"In a table, scale: {{{', '.join(told)}}} in a map of columns says so (docs/recordings.md); messages have "
            "radians (REP 103)"
        )

    def _far(self, position):
        """Whether positions are beyond the limits, and within them as degrees."""
        limited = ~self._turns & np.isfinite(self._lower) & np.isfinite(self._upper)
        q, lower, upper = position[:, limited], self._lower[limited] - SLACK, self._upper[limited] + SLACK
        beyond = ((q < lower) | (q > upper)).any(axis=1)
        turned = q * DEGREE
        return bool(beyond.mean() > MOST and ((turned >= lower) & (turned <= upper)).mean() >= WITHIN)

    def _fast(self, velocity):
        """Likewise for velocities, whose limits are of one side."""
        limit = np.where(self._fastest > 0.0, self._fastest, np.inf)
        beyond = (np.abs(velocity) > limit).any(axis=1)
        return bool(beyond.mean() > MOST and (np.abs(velocity) * DEGREE <= limit).mean() >= WITHIN)

    def _ratio(self, t, position, velocity):
        """Median over joints of the ratio of Δq to q̇dt; NaN if none of them tells."""
        elapsed = np.diff(t)[:, None]
        if not (elapsed > 0.0).any():
            return math.nan
        steady = (elapsed > 0.0) & (elapsed < 2.0 * np.median(elapsed[elapsed > 0.0]))
        travelled, integral = np.diff(position, axis=0), 0.5 * elapsed * (velocity[1:] + velocity[:-1])
        turned = (travelled + np.pi) % (2.0 * np.pi) - np.pi
        travelled = np.where(self._turns, turned, travelled)
        known = steady & np.isfinite(travelled) & np.isfinite(integral)
        travelled, integral = (np.where(known, x, 0.0) for x in (travelled, integral))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            travel, change, together = (travelled**2).sum(0), (integral**2).sum(0), (travelled * integral).sum(0)
            telling = (together**2 > ALIKE * travel * change) & (np.ptp(position, axis=0) > TRAVEL)
            ratios = (together / change)[telling]
        return float(np.median(ratios)) if len(ratios) else math.nan


def _agree(told, ratio):
    """Whether positions change as velocities say once both are converted."""
    for one in told:
        ratio *= DEGREE if one.startswith("position") else 1.0 / DEGREE
    return _near(ratio, 1.0)


def _near(ratio, expected):
    return 1.0 / NEAR < ratio / expected < NEAR


def refuse_units(findings):
    """Refuse a recording whose values are in degrees.

    Raises
    ------
    InputError
    """
    for finding in findings:
        if finding.cause == UNITS:
            raise InputError(f"{finding.text}.")
