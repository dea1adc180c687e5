# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units of rejected values: whether positions or velocities beyond their bounds are degrees."""

import math

import numpy as np

from diag_dynamics.assembly.assembler import joints_of
from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.single_joints import places
from diag_dynamics.recordings.units import position_ratios
from diag_dynamics.sweeps.spatial import ANGULAR_X

UNITS = "units"
"""Cause of the finding."""

MAX_SAMPLE, MIN_SAMPLE = 2000, 10  # rejected messages that are sampled, the first ones
MIN_REJECTED = 0.5  # fraction of all messages: fewer rejected ones are garbage between good ones
MIN_WITHIN, SLACK = 0.99, 0.2  # fraction of values within the limits as degrees, and slack of these [rad]
MIN_TRAVEL, NEAR = 0.01, 1.2  # least range of a joint with a ratio, and factor within which it is a known one
DEGREE = math.pi / 180.0


class RejectedUnits:
    """Sample messages that were rejected for absurd values; `map_name` returns the robot's name of a joint."""

    def __init__(self, model, map_name):
        joints, bodies = joints_of(model), model.bodies
        own = bodies[1:][bodies["owner"][1:] == np.arange(1, len(bodies))]
        rotary = {model.dof_names[record["dof"]] for record in own if record["direction"] >= ANGULAR_X}
        which = [k for k, name in enumerate(joints.names) if name in rotary]
        self._map_name, self._names = map_name, [joints.names[k] for k in which]
        self._continuous = np.array([name in joints.continuous for name in self._names], dtype=bool)
        self._lower, self._upper = joints.lower[which] - SLACK, joints.upper[which] + SLACK
        self._limited = ~self._continuous & np.isfinite(self._lower) & np.isfinite(self._upper)
        self._limit = np.where(joints.velocity[which] > 0.0, joints.velocity[which], np.inf)
        self._rows = []  # place of the message, stamp [ns], positions, velocities

    def read(self, parts, rejected):
        """Sample JointStates of which `rejected`, bool by the place of a message, are true."""
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
                stamp = int(part.sec[k]) * SECOND + int(part.nanosec[k])
                found.append((part.rows[k], stamp, part.position[k, at], velocity))
        found.sort(key=lambda one: one[0])
        self._rows += found[: MAX_SAMPLE - len(self._rows)]

    def text(self):
        """Return the units that the values seem to have, and what to do; None if they are not degrees."""
        if len(self._rows) < MIN_SAMPLE:
            return None
        _, stamps, position, velocity = (np.array(column) for column in zip(*self._rows, strict=True))
        ratio = self._ratio(stamps, position, velocity)
        q, lower, upper = (x[..., self._limited] for x in (position, self._lower, self._upper))
        positions = _are_degrees(q, lower, upper)
        velocities = _are_degrees(velocity, -self._limit, self._limit)
        if positions:
            slow = np.isfinite(velocity).any() and not _is_near(ratio, 1.0 / DEGREE)
            velocities = slow and (velocities or _is_near(ratio, 1.0))
        else:
            velocities = velocities and _is_near(ratio, DEGREE)
        if not (positions or velocities):
            return None
        agrees = _is_near(ratio * DEGREE**positions / DEGREE**velocities, 1.0)
        what = " and ".join(["positions"] * positions + ["velocities"] * velocities)
        units = ", ".join(["position: deg"] * positions + ["velocity: deg/s"] * velocities)
        return (
            f"{what} seem to be in degrees: most are beyond what the joints can do, and as degrees within it"
            f"{', and positions then change as velocities say' if agrees else ''}. In a table, scale: {{{units}}} in a "
            "map of columns says so (docs/recordings.md); messages have radians (REP 103)"
        )

    def _ratio(self, stamps, position, velocity):
        """Return the median ratio of Δq to ∫q̇dt of the joints that move; NaN if none has one."""
        ratios = position_ratios(stamps, position, velocity, self._continuous)
        ratios = ratios[np.isfinite(ratios) & (np.ptp(position, axis=0) > MIN_TRAVEL)]
        return float(np.median(ratios)) if len(ratios) else math.nan


def _are_degrees(values, lower, upper):
    """Return whether most rows are beyond the limits, and within them as degrees."""
    beyond = ((values < lower) | (values > upper)).any(axis=1)
    within = (values * DEGREE >= lower) & (values * DEGREE <= upper)
    return bool(beyond.mean() > MIN_REJECTED and within.mean() >= MIN_WITHIN)


def _is_near(ratio, expected):
    return 1.0 / NEAR < ratio / expected < NEAR


def refuse_units(findings):
    """Reject a recording whose values are in degrees, by an InputError."""
    for finding in findings:
        if finding.cause == UNITS:
            raise InputError(f"{finding.text}.")
