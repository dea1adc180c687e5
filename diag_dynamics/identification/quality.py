# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality of an identification: cross-validation, certainty, warnings, and curves of residuals."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.identification.base_parameters import BaseParameters
from diag_dynamics.identification.dataset import DOUBTFUL
from diag_dynamics.identification.gains import gains_by_joint
from diag_dynamics.identification.result import deviations_of, parameters_of, payload_certainty
from diag_dynamics.identification.selection import GAIN
from diag_dynamics.recordings.balance import MIN_EXPLAINED, NOTHING_EXPLAINED, Balance
from diag_dynamics.recordings.data_checks import smoothed
from diag_dynamics.recordings.external_torque import Observer

OBSERVER_GAIN = 25.0  # the monitor's default [1/s]
# Shortest portion whose errors of effort count, and its ends: the filter has 5 Hz [s]
MIN_SMOOTHED, EDGE = 1.0, 0.2
ERRORS = 3.0  # standard deviations by which payloads of recordings may differ
MAX_CHANGE = 0.2  # relative change of kinetic energy without a warning
MAX_STEPS = 900  # of a curve: twice the pixels that they are drawn on


class Curves(NamedTuple):
    """Efforts below 5 Hz on held-out parts, downsampled to minima and maxima.

    Times [s] have the shape (P,), the others [N m, N] (P, nv). Efforts were measured, or are those
    of the model before and after with friction; NaN interrupts them.
    `files` are the recordings with the times at which they begin [s].
    """

    t: np.ndarray
    measured: np.ndarray
    before: np.ndarray
    after: np.ndarray
    error_before: np.ndarray
    error_after: np.ndarray
    files: list


def validate(models, parts):
    """Return how well models explain a block each, by key of the quality; NaN and None are unknown.

    A block is pairs of a segment and of the joints that have efforts there. Then rows of curves:
    time, measured effort, the model's and the error of each joint.
    """
    model = models[0]
    elapsed = 0.0
    curves = [np.empty((0, 1 + 3 * models[0].nv))]
    size = -(-sum(len(segment.t) for block in parts for segment, _ in block) // MAX_STEPS)
    balance = Balance()
    errors = []
    observed = []
    energies = []
    for fitted, block in zip(models, parts, strict=True):
        dynamics = DiagonalDynamics(fitted)
        observer = Observer(dynamics, OBSERVER_GAIN, friction=False)  # efforts are without friction
        for segment, measured_joints in block:
            t, q, qd, tau = segment.columns
            # Friction of rates as they are, because that of filtered ones turns later.
            tau = tau - dynamics.friction_torque(qd, q)
            if not measured_joints.all():  # the efforts of others are those of the model
                rest = dynamics.inverse_dynamics(q, qd, np.gradient(qd, t, axis=0))
                tau = np.where(measured_joints, tau, rest)
            s = dynamics.evaluate(q, qd, tau)
            balance.add_states(segment.states, s)
            states = observer.observe_batch(replace(segment.states, effort=tau))
            torque = states.external_torque[states.valid]
            observed.append(np.where(measured_joints, torque, np.nan))
            energies.append(s.kinetic_energy.copy())
            if segment.duration >= MIN_SMOOTHED:
                measured = smoothed(*segment.columns)[2]
                q, qd, tau, qdd = smoothed(t, q, qd, tau)
                inner = (t > t[0] + EDGE) & (t < t[-1] - EDGE)
                error = (tau - dynamics.inverse_dynamics(q, qd, qdd))[inner]
                errors.append(np.where(measured_joints, error, np.nan))
                columns = np.hstack([measured[inner], measured[inner] - error, error])
                curves.append(_downsample(elapsed + t[inner] - t[0], columns, size))
            elapsed += segment.duration
    none = [np.empty((0, model.nv))]
    error, torque = (
        np.ma.masked_invalid(np.concatenate(none + rows)) for rows in (errors, observed)
    )
    return {
        "torque_rms": np.sqrt((error**2).mean(axis=0)).filled(np.nan),  # below 5 Hz [N m, N]
        "explained": balance.explained,  # of dK/dt
        "explained_total": balance.explained_total,  # of d(K + U)/dt
        "observer_spread": torque.std(axis=0).filled(np.nan),  # of the external torque m r [N m, N]
        "kinetic_energy": float(np.concatenate(energies).mean()),  # [J]
    }, np.concatenate(curves)


def _downsample(t, columns, size):
    """Return times and columns as rows, minima and maxima over so many states, and a row of NaN."""
    first = np.arange(0, len(t), size)
    extremes = [extreme.reduceat(columns, first, axis=0) for extreme in (np.fmin, np.fmax)]
    rows = np.column_stack(
        [np.repeat(t[first], 2), np.stack(extremes, axis=1).reshape(2 * len(first), -1)]
    )
    return np.vstack([rows, np.full((1, rows.shape[1]), np.nan)])


def quality_of(model, selection, data, last):
    """Return the quality of what was selected, and Curves; `last` is the fit to all rows."""
    layout = selection.layout
    names = model.dof_names
    free = selection.free(selection.taken)
    count = len(data.blocks)
    (before, first), (after, then) = (validate([model] * count, data.parts),) * 2
    if free.any() or layout.without_rotors:
        models = [model.with_parameters(parameters_of(layout, x, free)) for x in selection.fits]
        after, then = validate(models, data.parts)
    findings = [finding for dataset in data.datasets for finding in dataset.findings]
    shares = after["explained"], after["explained_total"]
    nothing = None not in shares and max(shares) < NOTHING_EXPLAINED
    start = selection.squares_of([layout.known] * count)
    fits = selection.left_out() if data.gains is not None else selection.fits
    quality = {
        "held_out": f"each of {count} parts of all recordings, by parameters fitted to the others",
        "held_out_duration": float(sum(dataset.duration for dataset in data.loaded)),
        **{key: _pair(names, before[key], after[key]) for key in before},
        "row_residual": _pair(names, *map(selection.residuals, (start, selection.squares))),
        "taken": selection.named(selection.taken),
        "kept": selection.kept,
        "ladder": selection.ladder,
        "effort_factor": _factors(names, data.relations),
        "effort_gain": None if data.gains is None else gains_by_joint(names, data.gains),
        "partial": [] if data.measured.all() else np.array(names)[data.measured].tolist(),
        "efforts_judged": any(relation.judged().any() for relation in data.relations)
        and not nothing
        and DOUBTFUL not in [finding.cause for finding in findings],
        "velocity_delay": [dataset.delay for dataset in data.loaded],
        "deviations": deviations_of(layout, free, last, fits),
        "base_parameters": BaseParameters(layout).describe(last, fits, free),
        "payload": payload_certainty(layout, last, fits) if layout.payload else None,
        "warnings": selection.warnings,
        "findings": [
            *_shared_texts(data.datasets),
            *map(str, data.findings * selection.asks_for_joints),
        ],
    }
    if data.gains is not None:
        quality["warnings"].append(
            "efforts were multiplied by gains, effort_scale of the parameters. They are as wrong "
            "as the weight of the model's links, and other joints remain unknown"
        )
    if free[layout.inertial].any():
        quality["warnings"].append(
            "masses and inertias of single links are not observable: only their combinations are"
        )
    quality["warnings"] += _warnings(quality, data.unloaded is None, nothing)
    if layout.payload:
        quality["warnings"] += _warn_of_reach(model, layout.payload, quality["payload"])
        quality["warnings"] += _warn_of_payloads(selection, data, last)
    rows = np.stack([first, then])
    rows[:, :, np.r_[False, ~np.tile(data.measured, 3)]] = np.nan
    t, measured, efforts, errors = np.split(rows, 1 + model.nv * np.arange(3), axis=2)
    return quality, Curves(t[0, :, 0], measured[0], *efforts, *errors, data.beginnings())


def _shared_texts(datasets):
    """Return findings of recordings as texts, each once.

    A finding that not all recordings share begins with the names of its recordings.
    """
    names = {}
    for dataset in datasets:
        for finding in dataset.findings:
            names.setdefault(str(finding), []).append(dataset.name)
    return [
        text if len(owners) == len(datasets) else f"{', '.join(owners)}: {text}"
        for text, owners in names.items()
    ]


def _pair(names, before, after):
    """Return [before, after], by name if these are arrays; None for an unknown value."""
    if not isinstance(before, np.ndarray):
        return [before, after]
    pairs = zip(names, np.transpose([before, after]).tolist(), strict=True)
    return {name: [None if np.isnan(value) else value for value in pair] for name, pair in pairs}


def _factors(names, relations):
    """Return factor and standard error of each joint's effort, of the recording with the smallest.

    A joint without a finite pair has None.
    """
    best = [
        min((float(relation.error[k]), float(relation.factor[k])) for relation in relations)
        for k in range(len(names))
    ]
    return {
        name: [factor, error] if np.isfinite(error + factor) else None
        for name, (error, factor) in zip(names, best, strict=True)
    }


def _warn_of_reach(model, carrier, payload):
    """Return a warning of a payload's centre beyond the reach of the arm to its link."""
    reach = np.linalg.norm(carrier.placement[:3, 3])
    body = carrier.body
    while body > 0:
        reach += np.linalg.norm(model.bodies["translation"][body])
        body = int(model.bodies["parent"][body])
    distance = np.linalg.norm(payload["com"])
    if distance <= reach:
        return []
    return [
        f"payload of {carrier.link}: its centre is {distance:.2g} m from the link, beyond the "
        f"arm's reach of {reach:.2g} m. Mass and centre are not credible. Check the mounting of "
        "the base and the efforts of the last joints"
    ]


def _warn_of_payloads(selection, data, fit):
    """Return a warning of recordings whose payloads differ by more than their deviations allow."""
    if len(data.loaded) == 1:
        return []
    masses, deviations = np.transpose(selection.payload_by_recording(fit))
    lightest = int(np.argmin(masses))
    heaviest = int(np.argmax(masses))
    allowed = ERRORS * np.hypot(deviations[lightest], deviations[heaviest])
    if masses[heaviest] - masses[lightest] <= allowed:
        return []
    texts = [
        f"{data.loaded[k].name} {masses[k]:.3g} ± {deviations[k]:.1g} kg"
        for k in (lightest, heaviest)
    ]
    return [
        f"recordings have different payloads: {', '.join(texts)}. Identify each payload from its "
        "own recordings"
    ]


def _warnings(quality, without_reference, nothing):
    warnings = []
    payload = quality["payload"]
    if payload:
        warnings.append(f"payload of {payload['link']}: {payload['inertia_known']}")
    if payload and without_reference:
        warnings.append(
            f"payload of {payload['link']}: its standard deviations assume a correct model of the "
            "robot; a reference without the payload removes this assumption"
        )
    before, after = quality["kinetic_energy"]
    if before > 0.0 and abs(after / before - 1.0) > MAX_CHANGE:
        warnings.append(f"kinetic energy is {after / before:.2f} times that of the model")
    for step, joints in quality["kept"].items():
        if joints:
            warnings.append(
                f"{step} of {', '.join(joints)}: the model's values are kept, because fitted ones "
                f"do not reduce the cross-validation residual by {GAIN:.0%}"
            )
    share = quality["explained"]
    total = quality["explained_total"][1]
    if share[1] is not None and share[1] < MIN_EXPLAINED and not nothing:
        warnings.append(
            f"the identified model explains {share[1]:.2f} of the variance of dK/dt; expected at "
            "least "
            f"{MIN_EXPLAINED:g}. If the robot carries or lacks a tool, add payload:LINK to what"
        )
    if nothing:
        warnings.append(
            f"the identified model does not explain the motion: {share[1]:.3g} of the variance of "
            f"dK/dt and {total:.3g} of "
            "that of d(K + U)/dt. Check order of the joints and unit of the efforts (N m or N)"
        )
    return warnings
