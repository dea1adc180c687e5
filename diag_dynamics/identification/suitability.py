# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a recording must be before anything is fitted to it: units, delays and gravity right, and the motion rich enough."""

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.segments import parts_of
from diag_dynamics.identification.torques import smoothed
from diag_dynamics.recordings.account import Finding
from diag_dynamics.sweeps.spatial import ANGULAR_X

INCREMENT = 0.05
"""Time over which positions are compared with integrated velocities [s]."""

TOLERANCE = 0.02
"""Distance from 1 of the slope of positions over integrated velocities that is accepted."""

LEAST_CORRELATION = 0.7
"""Correlation of the two without which a joint moves too little to be judged."""

DELAYS = np.arange(-20.0, 40.5, 0.5) * 1e-3
"""Delays of velocities against positions that are tried [s]."""

UNITS = (
    (-1.0, "of the other sign"),
    (np.pi / 180.0, "in degrees per second"),
    (np.pi / 30.0, "in revolutions per minute"),
    (2.0 * np.pi, "in revolutions per second"),
    (180.0 / np.pi, "right, and positions in degrees"),
    (1e-3, "in mm/s or mrad/s"),
    (1e3, "right, and positions in mm or mrad"),
)
"""Slopes of positions over integrated velocities, and what velocities then are."""

PART = 1000
"""Increments that are looked at together: all delays of them take memory."""

TINY = 1e-30
"""Sum of squares of a joint that does not move [rad², m²]."""

HEAVY = 3.0
"""Standard deviation of gravity's effort from which it can be looked for in what was measured [N m, N]."""

MOVING, EACH_WAY, RANGE = 0.05, 1.0, 0.5
"""Velocity [rad/s], time above it in each direction [s] and range of positions [rad] that a joint's friction needs."""

PRISMATIC = 0.1
"""What these are times in m, of a prismatic joint."""


def judged_velocities(segments, model):
    """Delay of velocities against positions [s], where both are of the same units.

    Raises
    ------
    InputError
        Positions of a joint do not change as its velocity says.
    """
    size, product, square = np.zeros(model.nv), *np.zeros((2, len(DELAYS), model.nv))
    for increments, integrals in _increments(segments, model):
        size += (increments**2).sum(axis=0)
        product += (integrals * increments).sum(axis=1)
        square += (integrals**2).sum(axis=1)
    if not size.any():
        return 0.0
    size, square = np.maximum(size, TINY), np.maximum(square, TINY)
    explained = np.maximum(0.0, 1.0 - product**2 / (square * size))  # unexplained share, by delay and joint
    telling = np.sqrt(np.maximum(0.0, 1.0 - explained.min(axis=0))) >= LEAST_CORRELATION
    if not telling.any():
        return 0.0
    cost = explained[:, telling].sum(axis=1)
    best = int(np.argmin(cost))
    for k in np.flatnonzero(telling):
        # Noise of velocities makes one slope too small, that of positions the other one too large.
        slopes = sorted((product[best, k] / square[best, k], size[k] / product[best, k]), key=abs)
        low, high = min(slopes), max(slopes)
        if high < 1.0 - TOLERANCE or low > 1.0 + TOLERANCE:
            slope = float(slopes[0])
            raise InputError(
                f"positions of joint '{model.dof_names[k]}' change by {slope:.4g} times what its velocities say"
                f"{_unit(slope)}."
            )
    return _refined(cost, best)


def _refined(cost, best):
    """Delay of the smallest cost, by the parabola through it and its neighbours."""
    if not 0 < best < len(DELAYS) - 1:
        return float(DELAYS[best])
    before, here, after = cost[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(DELAYS[best] + shift * (DELAYS[1] - DELAYS[0]))


def _unit(slope):
    for value, text in UNITS:
        if abs(slope / value - 1.0) < 0.05:
            return f", expected 1: velocities seem to be {text}"
    return ", expected 1: are velocities those of the motor, or of another joint?"


def _increments(segments, model):
    """Increments of positions, (K, nv), and integrals of velocities of each delay, (D, K, nv); yields some at a time."""
    turning = np.array([name in model.continuous_joints and name not in _coupled(model) for name in model.dof_names])
    for segment in segments:
        t = segment.t
        first, last = t[0] - DELAYS[0], t[-1] - DELAYS[-1]
        if last - first < 2.0 * INCREMENT:
            continue
        grid = np.arange(first, last, INCREMENT)
        positions = _unwrapped(segment.q, turning)
        steps = 0.5 * (segment.qd[1:] + segment.qd[:-1]) * np.diff(t)[:, None]
        integral = np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])
        for begin in range(0, len(grid) - 1, PART):
            some = grid[begin : begin + PART + 1]
            q = np.column_stack([np.interp(some, t, column) for column in positions.T])
            at = some + DELAYS[:, None]
            values = np.stack([np.interp(at, t, column) for column in integral.T], axis=-1)
            yield np.diff(q, axis=0), np.diff(values, axis=1)


def _coupled(model):
    return {joint for group in model.coupled_groups for joint in group}


def _unwrapped(q, turning):
    q = q.copy()
    q[:, turning] = np.unwrap(q[:, turning], axis=0)
    return q


def without_delay(segments, delay):
    """Segments whose velocities are those of the time of their positions; ends that have none are cut off."""
    found = []
    for segment in segments:
        within = (segment.t + delay >= segment.t[0]) & (segment.t + delay <= segment.t[-1])
        if within.sum() > 1:
            at = segment.t[within] + delay
            velocities = np.column_stack([np.interp(at, segment.t, column) for column in segment.qd.T])
            found.append(segment.part(within)._replace(qd=velocities))
    return found


def judge_efforts(segments, model, friction_velocity, tolerant, findings):
    """Look for the model's gravity in the efforts.

    Parameters
    ----------
    tolerant : bool
        Whether the robot may carry what the model does not, or lack what it has.

    Raises
    ------
    InputError
        Gravity is not in them, of the other sign, or much too large or small.
    """
    parts = (_smoothed(part) for segment in segments for part in parts_of(segment))
    q, qd, tau, qdd = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    gravity = DiagonalDynamics(model).gravity_torque_batch(q)
    heavy = np.flatnonzero(gravity.std(axis=0) > HEAVY)
    if not len(heavy):
        findings.append(
            Finding(
                "efforts not judged",
                1,
                f"gravity changes the effort of no joint by {HEAVY:g} N m or N: whether efforts are in these units, and hold "
                "gravity, is for you to know",
            )
        )
        return
    slopes = {}
    for k in heavy.tolist():
        # The acceleration is a column, for in a swing it goes with gravity: a rotor's inertia would be taken for less weight.
        resisting = [qd[:, k], np.tanh(qd[:, k] / max(friction_velocity, 1e-9)), np.ones(len(q)), qdd[:, k]]
        columns = [gravity[:, k], *resisting]
        slopes[k] = float(np.linalg.lstsq(np.column_stack(columns), tau[:, k], rcond=None)[0][0])
    if all(abs(slope) < 0.35 for slope in slopes.values()):
        k = max(slopes, key=lambda k: gravity[:, k].std())
        raise InputError(
            f"gravity is not in the efforts: that of joint '{model.dof_names[k]}' changes by {slopes[k]:.2f} times what the "
            "model's gravity does. If the driver has taken it out, read the recording with "
            "parameters={'effort_includes_gravity': ['*=false']}."
        )
    low, high = (0.2, 5.0) if tolerant else (0.6, 1.6)
    wrong = {k: slope for k, slope in slopes.items() if not low <= slope <= high}
    for k, slope in wrong.items():
        if -1.6 <= slope <= -0.4:
            raise InputError(
                f"the effort of joint '{model.dof_names[k]}' is of the other sign: it changes by {slope:.2f} times what the "
                "model's gravity does (effort_scale: '" + model.dof_names[k] + "=-1')."
            )
    for k, slope in wrong.items():
        raise InputError(
            f"the effort of joint '{model.dof_names[k]}' changes by {slope:.3g} times what the model's gravity does, "
            f"expected {low:g} to {high:g}: is it in N m or N, on the joint's side of the gear, and are the joints in order? "
            "(effort_scale, docs/recordings.md)"
        )


def _smoothed(segment):
    """Positions, rates, efforts and accelerations of a segment, all through the same filter."""
    n, m = segment.q.shape[1], segment.q.shape[1] + segment.qd.shape[1]
    _, columns, rates = smoothed(segment.t, np.hstack([segment.q, segment.qd, segment.tau]))
    return columns[:, :n], columns[:, n:m], columns[:, m:], rates[:, n:m]


def excited(segments, model, findings):
    """Which degrees of freedom move enough for their friction to be known, bool, shape (nv,)."""
    forward, backward = np.zeros((2, model.nv))
    low, high = np.full(model.nv, np.inf), np.full(model.nv, -np.inf)
    own = model.bodies[1:][model.bodies["owner"][1:] == np.arange(1, len(model.bodies))]
    unit = np.ones(model.nv)
    unit[own["dof"][own["direction"] < ANGULAR_X]] = PRISMATIC
    for segment in segments:
        q = segment.q
        step = np.diff(segment.t)[:, None]
        forward += ((segment.qd[1:] > MOVING * unit) * step).sum(axis=0)
        backward += ((segment.qd[1:] < -MOVING * unit) * step).sum(axis=0)
        low, high = np.minimum(low, q.min(axis=0)), np.maximum(high, q.max(axis=0))
    enough = (forward >= EACH_WAY) & (backward >= EACH_WAY) & (high - low >= RANGE * unit)
    for k in np.flatnonzero(~enough):
        metre = unit[k] != 1.0
        findings.append(
            Finding(
                "not excited",
                1,
                f"joint '{model.dof_names[k]}' moves {forward[k]:.2g} s forward and {backward[k]:.2g} s backward above "
                f"{MOVING * unit[k]:g} {'m/s' if metre else 'rad/s'}, over {high[k] - low[k]:.2g} {'m' if metre else 'rad'}; "
                f"its friction needs {EACH_WAY:g} s each way, and {RANGE * unit[k]:g}: it stays as the model has it",
            )
        )
    return enough
