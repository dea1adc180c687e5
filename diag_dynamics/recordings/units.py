# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units of positions and velocities by the limits of joints."""

import math

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.joints import joints_of
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model.joint_types import places, sliding_dofs
from diag_dynamics.recordings.velocities import DEGREE, position_ratios
from diag_dynamics.text import distinct

UNITS = "units"  # cause of the finding about rejected values
MAX_SAMPLE, MIN_SAMPLE = 2000, 10  # rejected messages that are sampled, the first ones
MIN_REJECTED = 0.5  # fraction of all messages: fewer rejected ones are garbage between good ones
MIN_WITHIN, SLACK = (
    0.99,
    0.2,
)  # fraction of values within the limits as degrees, and slack of these [rad]
MAX_BEYOND = 0.01  # fraction of rows beyond a limit that casts no doubt on a unit
NEAR = 1.2  # factor within which a ratio is a known one


class RejectedUnits:
    """Sample messages that were rejected for implausible values; `map_name` returns the robot's name of a joint."""

    def __init__(self, model, map_name):
        joints, slides = (
            joints_of(model),
            dict(zip(model.dof_names, sliding_dofs(model), strict=True)),
        )
        rotary = [k for k, name in enumerate(joints.names) if not slides[name]]
        self._map_name, self._names = map_name, [joints.names[k] for k in rotary]
        self._continuous = np.array([name in joints.continuous for name in self._names], dtype=bool)
        self._lower, self._upper = joints.lower[rotary] - SLACK, joints.upper[rotary] + SLACK
        self._limited = ~self._continuous & np.isfinite(self._lower) & np.isfinite(self._upper)
        self._limit = np.where(joints.velocity[rotary] > 0.0, joints.velocity[rotary], np.inf)
        self._rows = []  # place of the message, stamp [ns], positions, velocities

    def read(self, parts, rejected):
        """Sample JointStates of which `rejected`, bool by the place of a message, are true."""
        if not rejected.any() or len(self._rows) >= MAX_SAMPLE or not self._names:
            return
        rows = []
        for part in parts:
            names = [self._map_name(name) for name in part.names]
            if not set(self._names) <= set(names) or part.position.shape[1] != len(names):
                continue
            at, missing = places(self._names, names), np.full(len(self._names), math.nan)
            for k in np.flatnonzero(rejected[part.rows]).tolist():
                velocity = part.velocity[k, at] if part.velocity.shape[1] == len(names) else missing
                stamp = int(part.sec[k]) * SECOND + int(part.nanosec[k])
                rows.append((part.rows[k], stamp, part.position[k, at], velocity))
        rows.sort(key=lambda row: row[0])
        self._rows += rows[: MAX_SAMPLE - len(self._rows)]

    def text(self):
        """Return the units that the values seem to have, and what to do; None if they are not degrees."""
        if len(self._rows) < MIN_SAMPLE:
            return None
        _, stamps, position, velocity = (
            np.array(column) for column in zip(*self._rows, strict=True)
        )
        ratios = position_ratios(stamps, position, velocity, self._continuous)
        ratios = ratios[np.isfinite(ratios)]
        ratio = float(np.median(ratios)) if len(ratios) else math.nan
        q, lower, upper = (x[..., self._limited] for x in (position, self._lower, self._upper))
        if _are_degrees(q, lower, upper):
            units = "position: deg" + ", velocity: deg/s" * _is_near(ratio, 1.0)
        elif _are_degrees(velocity, -self._limit, self._limit) and _is_near(ratio, DEGREE):
            units = "velocity: deg/s"
        else:
            return None
        quantities = " and ".join(name for name in ("positions", "velocities") if name[:6] in units)
        return (
            f"{quantities} seem to be in degrees: most exceed the limits of the joints, but not as "
            f"degrees. In a table, set scale: {{{units}}} in a column map (docs/recordings.md); "
            "messages must have radians (REP 103)"
        )


def excess_as_radians(model, names, stamps, position):
    """Return how positions (T, n) of joints exceed limits of a robot as radians; empty if they do not.

    `stamps` are in ns. Single rows beyond a limit are no excess.
    """
    joints = joints_of(model)
    slides = dict(zip(model.dof_names, sliding_dofs(model), strict=True))
    elapsed = np.diff(stamps) / SECOND
    for k, name in enumerate(names):
        if name not in joints.names or slides[name] or not len(stamps):
            continue
        j, q = joints.names.index(name), position[:, k]
        with np.errstate(all="ignore"):
            speed = np.abs(np.diff(q)) / np.where(elapsed > 0.0, elapsed, np.nan)
        lower, upper = joints.lower[j] - SLACK, joints.upper[j] + SLACK
        is_beyond = ((q < lower) | (q > upper)) & (name not in joints.continuous)
        if np.mean(is_beyond) > MAX_BEYOND:
            largest = q[np.argmax(np.where(is_beyond, np.abs(q), 0.0))]
            at, lowest, highest = distinct(largest, joints.lower[j], joints.upper[j], digits=4)
            return f"'{name}' would be at {at} rad, outside of {lowest} … {highest}"
        limit = joints.velocity[j]
        if limit > 0.0 and np.mean(speed > limit) > MAX_BEYOND:
            fastest, bound = distinct(np.nanmax(speed), limit, digits=4)
            return f"'{name}' would move at {fastest} rad/s, beyond {bound}"
    return ""


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
