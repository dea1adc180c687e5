# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks before a fit: units and delay of velocities, efforts against the model's torques, motion of every joint."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.account import Finding
from diag_dynamics.recordings.effort_checks import find_fault
from diag_dynamics.recordings.effort_relation import ERRORS, EffortRelation, Run
from diag_dynamics.sweeps.spatial import ANGULAR_X

INCREMENT = 0.05  # time over which positions are compared with integrated velocities [s]
TOLERANCE, MIN_CORRELATION = 0.02, 0.7  # accepted error of their slope; correlation from which a joint counts
DELAYS = np.arange(-20.0, 40.5, 0.5) * 1e-3  # of velocities against positions that are tried [s]
PART = 1000  # increments that are compared at once
TINY = 1e-30  # sum of squares of a joint at rest [rad², m²]
NOT_JUDGED, DOUBTFUL = "efforts not judged", "effort doubtful"  # causes of findings
MOVING, EACH_WAY, RANGE = 0.05, 1.0, 0.5  # velocity [rad/s], time above it each way [s], range [rad] for friction
PRISMATIC = 0.1  # factor of these for a prismatic joint [m]
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


def find_delay(model, t, states, segments):
    """Return the delay of velocities against positions [s].

    Raises
    ------
    InputError
        Positions of a joint do not change as its velocity says.
    """
    size, product, square = np.zeros(model.nv), *np.zeros((2, len(DELAYS), model.nv))
    for segment in segments:
        for increments, integrals in _increments(model, t[segment], states[segment]):
            size += (increments**2).sum(axis=0)
            product += (integrals * increments).sum(axis=1)
            square += (integrals**2).sum(axis=1)
    size, square = np.maximum(size, TINY), np.maximum(square, TINY)
    unexplained = np.maximum(0.0, 1.0 - product**2 / (square * size))
    clear = np.sqrt(1.0 - unexplained.min(axis=0)) >= MIN_CORRELATION
    if not clear.any():
        return 0.0
    cost = unexplained[:, clear].sum(axis=1)
    best = int(np.argmin(cost))
    for k in np.flatnonzero(clear):
        # Noise of velocities makes one slope too small, noise of positions the other one too large.
        slopes = sorted((product[best, k] / square[best, k], size[k] / product[best, k]), key=abs)
        if max(slopes) < 1.0 - TOLERANCE or min(slopes) > 1.0 + TOLERANCE:
            unit = next(
                (f"velocities seem to be {text}" for one, text in UNITS if abs(slopes[0] / one - 1.0) < 0.05), ""
            )
            raise InputError(
                f"positions of joint '{model.dof_names[k]}' change by {slopes[0]:.4g} times what its velocities say, "
                f"expected 1: {unit or 'are velocities those of the motor, or of another joint?'}"
                f"{'.' if unit else ''}"
            )
    return _refine_minimum(cost, best)


def _increments(model, t, states):
    """Yield increments of positions (K, nv) and of integrated velocities by delay (D, K, nv)."""
    points = np.arange(np.ceil((t[-1] - DELAYS[-1] - t[0] + DELAYS[0]) / INCREMENT))
    if len(points) < 3:
        return
    coupled = {joint for group in model.coupled_groups for joint in group}
    turning = np.array([name in model.continuous_joints and name not in coupled for name in model.dof_names])
    q, qd = states.position.copy(), states.velocity
    q[:, turning] = np.unwrap(q[:, turning], axis=0)
    steps = 0.5 * (qd[1:] + qd[:-1]) * np.diff(t)[:, None]
    integral = np.cumsum(np.r_[np.zeros_like(qd[:1]), steps], axis=0)
    for first in range(0, len(points) - 1, PART):
        some = t[0] - DELAYS[0] + INCREMENT * points[first : first + PART + 1]
        at = some + DELAYS[:, None]
        sampled = np.column_stack([np.interp(some, t, column) for column in q.T])
        integrals = np.stack([np.interp(at, t, column) for column in integral.T], axis=-1)
        yield np.diff(sampled, axis=0), np.diff(integrals, axis=1)


def _refine_minimum(cost, best):
    """Return the delay of the smallest cost, by the parabola through it and its neighbours."""
    if not 0 < best < len(DELAYS) - 1:
        return float(DELAYS[best])
    before, here, after = cost[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(DELAYS[best] + shift * (DELAYS[1] - DELAYS[0]))


def check_efforts(model, dataset, tolerant):
    """Compare efforts with the torques that the model needs; return their Relation and add findings to the dataset.

    A `tolerant` comparison allows for a payload. Raises InputError if efforts lack gravity, have another
    sign or unit, or are of joints in another order.
    """
    compared, states = EffortRelation(model), dataset.states
    for part in dataset.portions():
        compared.add_run(Run(dataset.t[part], states.position[part], states.velocity[part], states.effort[part]))
    relation = compared.fit()
    wrong = find_fault(compared, relation, tolerant)
    if wrong and wrong.kind != "light":
        raise InputError(f"{wrong.text}.")
    if wrong:
        dataset.findings.append(Finding(DOUBTFUL, 1, wrong.text))
    if not relation.judged().any():
        dataset.findings.append(Finding(NOT_JUDGED, 1, _reason(model.dof_names, relation)))
    return relation


def _reason(names, relation):
    """Return why efforts say nothing of their unit."""
    if not np.isfinite(relation.error).any():
        return (
            "the motion shows no torque of the model apart from friction and offset: whether efforts are in N m or N, and "
            "hold gravity, is for you to know"
        )
    k = int(np.nanargmin(np.where(np.isfinite(relation.error), relation.error + relation.model_error, np.nan)))
    return (
        f"no effort has a clear relation to the motion: that of joint '{names[k]}' changes by {relation.factor[k]:.2g} ± "
        f"{ERRORS * relation.error[k]:.2g} times what the model needs. Whether efforts are in N m or N is for you to know"
    )


def check_motion(model, datasets):
    """Return which degrees of freedom move enough for their friction, bool (nv,), and findings on the others."""
    own = model.bodies[1:][model.bodies["owner"][1:] == np.arange(1, len(model.bodies))]
    unit = np.ones(model.nv)
    unit[own["dof"][own["direction"] < ANGULAR_X]] = PRISMATIC
    times = np.zeros((2, model.nv))
    for one in datasets:
        step = np.diff(one.t, prepend=one.t[0])
        step[one.states.jumped] = 0.0
        times += [step @ (sign * one.states.velocity > MOVING * unit) for sign in (1.0, -1.0)]
    positions = [one.states.position for one in datasets]
    low, high = np.min([q.min(axis=0) for q in positions], axis=0), np.max([q.max(axis=0) for q in positions], axis=0)
    enough, findings = (times >= EACH_WAY).all(axis=0) & (high - low >= RANGE * unit), []
    for k in np.flatnonzero(~enough):
        metre, moved = ("m" if unit[k] != 1.0 else "rad"), high[k] - low[k]
        text = (
            f"joint '{model.dof_names[k]}' moves {times[0, k]:.2g} s forward and {times[1, k]:.2g} s backward above "
            f"{MOVING * unit[k]:g} {metre}/s, over {moved:.2g} {metre}; its friction needs {EACH_WAY:g} s each way, and "
            f"{RANGE * unit[k]:g}: it stays as the model has it"
        )
        findings.append(Finding("not excited", 1, text))
    return enough, findings
