# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks before a fit: units and delay of velocities, efforts against the model's torques, motion."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.effort_checks import find_fault
from diag_dynamics.recordings.effort_relation import ERRORS, EffortRelation, Run
from diag_dynamics.recordings.findings import Finding

INCREMENT = 0.05  # time over which positions are compared with integrated velocities [s]
TOLERANCE, MIN_CORRELATION = 0.02, 0.7  # error of their slope; correlation from which a joint counts
DELAYS = np.arange(-20.0, 40.5, 0.5) * 1e-3  # of velocities against positions that are tried [s]
TINY = 1e-30  # sum of squares of a joint at rest [rad², m²]
NOT_JUDGED, DOUBTFUL = "efforts not judged", "effort doubtful"  # causes of findings
MOVING, EACH_WAY, RANGE = 0.05, 1.0, 0.5  # velocity [rad/s], time above it each way [s], range [rad]
PRISMATIC = 0.1  # factor of these for a prismatic joint [m]
UNITS = (  # slopes of positions over integrated velocities, and what velocities then are
    (-1.0, "of the other sign"),
    (np.pi / 180.0, "in degrees per second"),
    (np.pi / 30.0, "in revolutions per minute"),
    (2.0 * np.pi, "in revolutions per second"),
    (180.0 / np.pi, "right, and positions in degrees"),
    (1e-3, "in mm/s or mrad/s"),
    (1e3, "right, and positions in mm or mrad"),
)


def find_delay(model, segments):
    """Return the delay of velocities against positions [s].

    Raises
    ------
    InputError
        Positions of a joint do not change as its velocity says.
    """
    size, product, square = np.zeros(model.nv), *np.zeros((2, len(DELAYS), model.nv))
    for segment in segments:
        _add_increments(model, segment, size, product, square)
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
            cause = "are velocities those of the motor, or of another joint?"
            for slope, text in UNITS:
                cause = f"velocities seem to be {text}." if abs(slopes[0] / slope - 1.0) < 0.05 else cause
            raise InputError(
                f"positions of joint '{model.dof_names[k]}' change by {slopes[0]:.4g} times what its "
                f"velocities say, expected 1: {cause}"
            )
    if not 0 < best < len(DELAYS) - 1:
        return float(DELAYS[best])
    before, here, after = cost[best - 1 : best + 2]  # a parabola passes through these
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(DELAYS[best] + shift * (DELAYS[1] - DELAYS[0]))


def _add_increments(model, segment, size, product, square):
    """Add products of increments of positions and of integrated velocities, by delay and joint."""
    t, q, qd, _ = segment.columns
    points = np.arange(np.ceil((segment.duration - DELAYS[-1] + DELAYS[0]) / INCREMENT))
    if len(points) < 3:
        return
    coupled = {joint for group in model.coupled_groups for joint in group}
    turning = np.isin(model.dof_names, list(set(model.continuous_joints) - coupled))
    q = np.where(turning, np.unwrap(q, axis=0), q)
    steps = 0.5 * (qd[1:] + qd[:-1]) * np.diff(t)[:, None]
    integral = np.cumsum(np.r_[np.zeros_like(qd[:1]), steps], axis=0)

    def increments(columns, at):
        return np.diff(np.column_stack([np.interp(at, t, column) for column in columns.T]), axis=0)

    at = t[0] - DELAYS[0] + INCREMENT * points
    moved = increments(q, at)
    size += (moved**2).sum(axis=0)
    for k, delay in enumerate(DELAYS):
        integrals = increments(integral, at + delay)
        product[k] += (integrals * moved).sum(axis=0)
        square[k] += (integrals**2).sum(axis=0)


def check_efforts(model, dataset, tolerant):
    """Compare efforts with the torques that the model needs; return their Relation and add findings.

    A `tolerant` comparison allows for a payload. Raises InputError if efforts lack gravity, have
    another sign or unit, or are of joints in another order.
    """
    compared = EffortRelation(model)
    for part in dataset.portions():
        compared.add_run(Run(*part.columns))
    relation = compared.fit()
    wrong = find_fault(compared, relation, tolerant)
    if wrong and wrong.kind != "light":
        raise InputError(f"{wrong.text}.")
    if wrong:
        dataset.findings.append(Finding(DOUBTFUL, 1, wrong.text))
    if not relation.judged().any():
        dataset.findings.append(Finding(NOT_JUDGED, 1, _describe_unclear(model.dof_names, relation)))
    return relation


def _describe_unclear(names, relation):
    """Return why efforts say nothing of their unit."""
    text, known = "the motion shows no torque beside friction and offset", np.isfinite(relation.error)
    if known.any():
        k = int(np.nanargmin(np.where(known, relation.error + relation.model_error, np.nan)))
        text = (
            f"no effort has a clear relation to the motion: that of joint '{names[k]}' changes by "
            f"{relation.factor[k]:.2g} ± {ERRORS * relation.error[k]:.2g} times what the model needs"
        )
    return f"{text}. Check that efforts are in N m or N, and contain gravity"


def check_motion(model, datasets, slides):
    """Return which joints move enough for their friction, bool (nv,), and findings on the others; `slides` are prismatic."""
    unit, times = np.where(slides, PRISMATIC, 1.0), np.zeros((2, model.nv))
    segments = [segment for one in datasets for segment in one.segments]
    for t, states in segments:
        step = np.diff(t, prepend=t[0])
        times += [step @ (sign * states.velocity > MOVING * unit) for sign in (1.0, -1.0)]
    low = np.min([states.position.min(axis=0) for _, states in segments], axis=0)
    moved = np.max([states.position.max(axis=0) for _, states in segments], axis=0) - low
    enough, findings = (times >= EACH_WAY).all(axis=0) & (moved >= RANGE * unit), []
    for k in np.flatnonzero(~enough):
        metre = "m" if slides[k] else "rad"
        text = (
            f"joint '{model.dof_names[k]}' moves {times[0, k]:.2g} s forward and {times[1, k]:.2g} s backward above "
            f"{MOVING * unit[k]:g} {metre}/s, over {moved[k]:.2g} {metre}; its friction needs {EACH_WAY:g} s each way, "
            f"and {RANGE * unit[k]:g}: it stays as the model has it"
        )
        findings.append(Finding("not excited", 1, text))
    return enough, findings
