# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks before a fit: units and delay of velocities, efforts against the model's torques, motion."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.data_checks import ERRORS, EffortRelation, find_fault
from diag_dynamics.recordings.findings import Finding
from diag_dynamics.recordings.units import cause_of_ratio, regress_changes

INCREMENT = 0.05  # time over which positions are compared with integrated velocities [s]
TOLERANCE, MIN_R2 = (
    0.02,
    0.49,
)  # error of their slope; squared correlation from which a joint counts
MAX_DELAY, COARSE, FINE = (
    0.3,
    5e-3,
    5e-4,
)  # of velocities against positions: largest one and steps of the search [s]
TRAVEL = 0.02  # change of position from which a joint's velocities are judged [rad, m]
MIN_INTERVAL, SLOW, SLIGHT = (
    0.02,
    1e-2,
    1e-3,
)  # of states whose efforts are searched for a delay, and steps of that [s]
MIN_GAIN = (
    0.03  # reduction of the residual, geometric mean over joints, from which efforts are late
)
NOT_JUDGED, DOUBTFUL = "efforts not judged", "effort doubtful"  # causes of findings
MAX_GAIN_ERROR = 0.5  # of a gain, relative, ERRORS times its standard deviation
MOVING, EACH_WAY, RANGE = (
    0.05,
    1.0,
    0.5,
)  # velocity [rad/s], time above it each way [s], range [rad]
PRISMATIC = 0.1  # factor of these for a prismatic joint [m]


def find_delay(model, name, segments):
    """Return the delay of velocities against positions [s]; InputError if their units differ, or it is too long."""
    longest = min(MAX_DELAY, 0.1 * max(segment.duration for segment in segments))
    tracks = [_track(model, segment, longest) for segment in segments]
    moved = np.max([np.ptp(q, axis=0) for _, q, _, _ in tracks], axis=0) > TRAVEL
    changes = np.concatenate([_increments(q, t, at) for t, q, _, at in tracks])

    def regress(delays):
        found = []
        for delay in delays:
            integrals = np.concatenate(
                [_increments(integral, t, at + delay) for t, _, integral, at in tracks]
            )
            found.append(regress_changes(changes, integrals))
        slopes, r2 = np.transpose(np.nan_to_num(found), (1, 0, 2))
        return slopes, r2, np.flatnonzero((r2.max(axis=0) >= MIN_R2) & moved)

    steps = int(longest / COARSE)
    coarse = COARSE * np.arange(-steps, steps + 1)
    _, r2, clear = regress(coarse)
    if not len(clear):
        return 0.0
    best = int(np.argmin((1.0 - r2[:, clear]).sum(axis=1)))
    if steps and best in (0, len(coarse) - 1):
        joint = model.dof_names[clear[np.argmax(np.ptp(r2[:, clear], axis=0))]]
        raise InputError(
            f"{name}: velocities are {1e3 * longest:.0f} ms or more {'later' if best else 'earlier'} than positions, most "
            f"clearly those of joint '{joint}'; expected less. Check their time stamps and joints."
        )
    delays = coarse[best] + np.arange(-COARSE, COARSE + 0.5 * FINE, FINE)
    slopes, r2, _ = regress(delays)
    cost = (1.0 - r2[:, clear]).sum(axis=1)
    best = int(np.argmin(cost))
    for k in clear:
        # Noise of velocities makes one slope too small, noise of positions the other one too large.
        low, high = sorted((slopes[best, k], slopes[best, k] / r2[best, k]), key=abs)
        if high < 1.0 - TOLERANCE or low > 1.0 + TOLERANCE:
            cause = cause_of_ratio(low) or "are velocities those of the motor, or of another joint?"
            raise InputError(
                f"{name}: positions of joint '{model.dof_names[k]}' change by {low:.4g} times the integral of its "
                f"velocities; expected 1: {cause}"
            )
    if not 0 < best < len(delays) - 1:
        return float(delays[best])
    before, here, after = cost[best - 1 : best + 2]  # a parabola passes through these
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(delays[best] + shift * FINE)


def find_effort_delay(model, dataset):
    """Return the delay of efforts against positions [s], 0 if it hardly matters; a finding if the search ends before it.

    It minimizes what no multiples of gravity, inertia, acceleration and friction of the joint
    explain.
    """
    longest = min(MAX_DELAY, 0.1 * max(one.duration for one in dataset.segments))
    columns, times, tracks = zip(
        *(_explanations(model, one, longest) for one in dataset.segments), strict=True
    )
    moved = (
        np.max([np.ptp(one.states.position, axis=0) for one in dataset.segments], axis=0) > TRAVEL
    )
    joints = np.flatnonzero(dataset.known & moved)
    bases = [_orthonormal(np.concatenate([one[k] for one in columns])) for k in joints]

    def log_residuals(delays):
        """Return half the logarithm of the squares that are left at each delay, the mean over joints."""
        left = np.zeros(len(delays))
        for k, basis in zip(joints, bases, strict=True):
            parts = [
                np.interp(at[:, None] + delays, even, tau[:, k])
                for at, (even, tau) in zip(times, tracks, strict=True)
            ]
            late = np.concatenate(parts)
            rest = late - basis @ (basis.T @ late)
            left += np.log(
                np.maximum((rest**2).sum(axis=0), 1e-12 * (late**2).sum(axis=0) + 1e-300)
            )
        return 0.5 * left / max(len(joints), 1)

    steps = int(longest / SLOW)
    coarse = SLOW * np.arange(-steps, steps + 1)
    cost = log_residuals(coarse)
    best = int(np.argmin(cost))
    if not len(joints) or 1.0 - np.exp(cost[best] - cost[steps]) < MIN_GAIN:
        return 0.0
    if best in (0, len(coarse) - 1):
        text = (
            f"efforts seem to be {1e3 * longest:.0f} ms or more {'later' if best else 'earlier'} than positions; nothing is "
            "removed. Check their time stamps"
        )
        dataset.findings.append(Finding(DOUBTFUL, 1, text))
        return 0.0
    delays = coarse[best] + np.arange(-SLOW, SLOW + 0.5 * SLIGHT, SLIGHT)
    return float(delays[np.argmin(log_residuals(delays))])


def _explanations(model, segment, longest):
    """Return columns of what may explain efforts, (nv, T, 8), their times, and (times, efforts) of all states, smoothed."""
    t = segment.t
    even = np.linspace(t[0], t[-1], len(t))
    columns, tau = EffortRelation(model).columns(*segment.columns)
    inner = np.flatnonzero((even >= t[0] + longest) & (even <= t[-1] - longest))
    rows = inner[:: max(1, round(MIN_INTERVAL / (even[1] - even[0])))]
    return columns[:, rows], even[rows], (even, tau)


def _orthonormal(columns):
    """Return an orthonormal basis of columns."""
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    basis, values, _ = np.linalg.svd(columns / scale, full_matrices=False)
    return basis[:, values > 1e-9 * values[0]]


def _track(model, segment, longest):
    """Return times, positions, integrated velocities, and the times between which positions are compared."""
    t, q, qd, _ = segment.columns
    points = np.arange(np.ceil((segment.duration - 2.0 * longest) / INCREMENT))
    coupled = {joint for group in model.coupled_groups for joint in group}
    turning = np.isin(model.dof_names, list(set(model.continuous_joints) - coupled))
    q = np.where(turning, np.unwrap(q, axis=0), q)
    steps = 0.5 * (qd[1:] + qd[:-1]) * np.diff(t)[:, None]
    integral = np.cumsum(np.r_[np.zeros_like(qd[:1]), steps], axis=0)
    return t, q, integral, t[0] + longest + INCREMENT * points


def _increments(columns, t, at):
    """Return changes of columns between times."""
    return np.diff(np.column_stack([np.interp(at, t, column) for column in columns.T]), axis=0)


def _relate(model, dataset, payload=False):
    """Return the Relation of efforts to model torques, unknown for joints whose effort is not known."""
    compared, known = EffortRelation(model, payload), dataset.known
    for part in dataset.portions():
        compared.add_run(*part.columns)
    relation = compared.fit()
    factor, error = (
        np.where(known, relation.factor, np.nan),
        np.where(known, relation.error, np.inf),
    )
    return relation._replace(factor=factor, error=error)


def find_gains(model, datasets):
    """Return torque by unit of effort and its standard deviation by joint, NaN where gravity does not show it.

    Inertia shows no gain, because it may be a rotor's.
    """
    relations = [_relate(model, one) for one in datasets]
    factors, errors = (
        np.array([getattr(one, name) for one in relations]) for name in ("factor", "error")
    )
    usable = np.isfinite(factors) & np.array([one.heavy for one in relations])
    weights = np.where(usable, 1.0 / np.maximum(errors, 1e-300) ** 2, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = (weights * np.nan_to_num(factors)).sum(axis=0) / weights.sum(axis=0)
        error = 1.0 / np.sqrt(weights.sum(axis=0))
        gains = np.where(ERRORS * error < MAX_GAIN_ERROR * np.abs(factor), 1.0 / factor, np.nan)
        return gains, np.abs(gains) * error / np.abs(factor)


def check_efforts(model, dataset):
    """Return the Relation of efforts to model torques and add findings; InputError for a clear fault."""
    relation = _relate(model, dataset, payload=True)
    fault = find_fault(relation)
    if fault and not fault.light:
        raise InputError(f"{dataset.name}: {fault.text}.")
    if fault:
        dataset.findings.append(Finding(DOUBTFUL, 1, fault.text))
    if not relation.judged().any():
        text = "no effort clearly follows the motion. Check that efforts are in N m or N and contain gravity"
        dataset.findings.append(Finding(NOT_JUDGED, 1, text))
    return relation


def check_motion(model, datasets, slides):
    """Return which joints move, which in each direction, and which of these far, bool (3, nv), and findings on the others.

    An offset requires the first, friction the second, and what depends on acceleration or load the
    third.
    """
    unit, times = np.where(slides, PRISMATIC, 1.0), np.zeros((2, model.nv))
    segments = [segment for one in datasets for segment in one.segments]
    for t, states in segments:
        step = np.diff(t, prepend=t[0])
        times += [step @ (sign * states.velocity > MOVING * unit) for sign in (1.0, -1.0)]
    low = np.min([states.position.min(axis=0) for _, states in segments], axis=0)
    moved = np.max([states.position.max(axis=0) for _, states in segments], axis=0) - low
    each_way, findings = (times >= EACH_WAY).all(axis=0), []
    for k in np.flatnonzero(~each_way):
        metre = "m" if slides[k] else "rad"
        text = (
            f"joint '{model.dof_names[k]}' moves {times[0, k]:.2g} s forward and {times[1, k]:.2g} s backward above "
            f"{MOVING * unit[k]:g} {metre}/s; its friction requires {EACH_WAY:g} s each way, and keeps the model's values"
        )
        findings.append(Finding("not excited", 1, text))
    able = moved > TRAVEL, each_way, each_way & (moved >= RANGE * unit)
    return np.array(able), findings
