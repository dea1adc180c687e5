# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""``identify``: from recordings to a model that explains them."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

import numpy as np

from diag_dynamics.checks import instance
from diag_dynamics.exceptions import DiagDynamicsError, InputError, UnsupportedError
from diag_dynamics.identification.data_checks import DOUBTFUL, check_efforts, check_motion
from diag_dynamics.identification.dataset import MAX_VALUES, Dataset, list_recordings
from diag_dynamics.identification.fit import payload_at
from diag_dynamics.identification.regressors import NormalEquations, Regressors
from diag_dynamics.identification.result import Identification, friction_of, model_of, parameters_of, payload_certainty
from diag_dynamics.identification.selection import GAIN, STEPS, Selection
from diag_dynamics.identification.validation import validate
from diag_dynamics.model import RobotModel
from diag_dynamics.model.single_joints import single_joints
from diag_dynamics.recordings.balance import NOTHING_EXPLAINED
from diag_dynamics.recordings.recording import Recording

Readable: TypeAlias = Recording | Callable[[], Iterable[Recording]]  # in memory, or a function that returns pieces
HELD_OUT = 1.0 / 3.0  # fraction of the recordings that validates a fit
MAX_BLOCKS, MIN_BLOCK = 8, 1.0  # of other rows for cross-validation; shortest length: six time constants [s]
UNASKED_GAIN, MAX_TIPS = 0.3, 3  # gain from which an unasked payload is named; ends of the robot that are tried
MAX_CHANGE = 0.2  # relative change of kinetic energy without a warning


def identify(
    recordings: Readable | Sequence[Readable],
    model: RobotModel,
    what: str | Sequence[str] = ("friction", "rotors"),
    *,
    reference: Readable | Sequence[Readable] | None = None,
) -> Identification:
    """Identify friction, rotor inertias, a payload or link inertias from recordings without contact.

    The momentum balance is fitted through a low-pass of 1 Hz, which needs no accelerations. Rows of a
    joint are weighted by the variance of their residual. Inertias stay physical, and near the model's
    where the motion does not determine them; friction and rotor inertias stay positive. A step is taken
    if it reduces the residual of rows that are held out by a tenth; of friction and rotors, for joints
    whose residual in cross-validation it reduces. All rows are then fitted. Columns follow Gautier and
    Khalil, the prior Lee, Wensing and Park (IEEE T-RO 36(2), 2020). See docs/identify.md.

    Parameters
    ----------
    recordings : Recording, callable, or sequence of these
        Without contact, with efforts that contain gravity [N m, N]. A callable returns the pieces of one
        recording: ``lambda: dd.stream_recording(path, model)``. Long ones are thinned while they are read.
    model : RobotModel
        With a fixed base, and joints of one degree of freedom each.
    what : str or sequence of str
        ``"friction"`` (damping, Coulomb friction and offset of each joint that moves enough), ``"rotors"``
        (reflected inertia of motors, for efforts measured by current), ``"payload:<link>"`` (mass that a
        link carries beside the model, or lacks), ``"inertias"`` (of all links).
    reference : Recording, callable, or sequence of these, optional
        Of the same robot without the payload: its links are then fitted too, so that their errors do not
        become part of the payload.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        An argument has a wrong value; a recording is of another robot, or has no efforts; velocities or
        efforts cannot be in SI units; or no joint moves enough. The joint and, if it can be guessed, the
        unit are named.
    UnsupportedError
        The robot has a floating base, or a joint of several degrees of freedom.
    """
    instance("model", model, RobotModel)
    steps, payload = _read_what(what, model, reference)
    _refuse_unsupported(model)
    tips = _tips(model)
    carriers = [one.body for one in ([payload] if payload else tips)]
    data = Data(model, carriers, recordings, reference, payload is not None)
    result = _identify(model, Selection(model, steps, payload, data), data)
    if payload is None and "inertias" not in result.quality["taken"]:
        result.quality["warnings"] += _warn_of_payload(model, steps, tips, data, result.quality["ladder"])
    return result


def _read_what(what, model, reference):
    """Return steps, in order, and the Payload or None."""
    names, steps, payloads = (what,) if isinstance(what, str) else tuple(what), [], []
    for name in names:
        if isinstance(name, str) and name.startswith("payload:"):
            payloads.append(name.removeprefix("payload:"))
            if payloads[-1] not in model.link_names:
                raise InputError(f"what: '{payloads[-1]}' is not a link of robot '{model.name}'.")
            if model.placement_in_body(payloads[-1])[0] == 0:
                raise InputError(f"what: no joint moves link '{payloads[-1]}', whose payload nothing shows.")
        elif name in STEPS:
            steps.append(name)
        else:
            raise InputError(f"what has {name!r}, expected {', '.join(STEPS)} or payload:<link>.")
    if not names:
        raise InputError(f"what is empty, expected some of {', '.join(STEPS)}, payload:<link>.")
    if len(payloads) > 1:
        raise InputError(f"what has {len(payloads)} payloads, expected one.")
    if reference is not None and not payloads:
        raise InputError("reference is for a payload, and what has none.")
    if payloads and reference is None and "inertias" in steps:
        raise InputError(
            f"what has both inertias and payload:{payloads[0]}: give a recording without the payload as reference."
        )
    return [step for step in STEPS if step in steps], payload_at(model, payloads[0]) if payloads else None


def _refuse_unsupported(model):
    if model.floating_base:
        raise UnsupportedError(f"robot '{model.name}' has a floating base, whose support nothing measures.")
    for name in set(model.joint_names) - set(single_joints(model)):
        raise UnsupportedError(f"joint '{name}' has several degrees of freedom, which is not supported here.")


def _tips(model):
    """Return payloads at ends of the robot that nobody asked for."""
    tips = np.setdiff1d(np.arange(1, len(model.bodies)), model.bodies["parent"])[-MAX_TIPS:]
    return [payload_at(model, model.link_names[model.bodies["link"][tip]]) for tip in tips]


class Data:
    """Normal equations of recordings, with and without (`unloaded`) the payload that bodies `carriers` may have.

    The part from the time `begin` [s] of the last one on is held out; `blocks` are the others.
    """

    def __init__(self, model, carriers, recordings, reference, tolerant):
        self.regressors = Regressors(model, carriers)
        loaded = list_recordings("recordings", recordings)
        unloaded = [] if reference is None else list_recordings("reference", reference)
        share = MAX_VALUES // (len(loaded) + len(unloaded))
        self.loaded = [Dataset(f"recordings[{k}]", one, model, share) for k, one in enumerate(loaded)]
        unloaded = [Dataset(f"reference[{k}]", one, model, share) for k, one in enumerate(unloaded)]
        self.datasets = [*self.loaded, *unloaded]
        self.relations = [check_efforts(model, one, tolerant and one in self.loaded) for one in self.datasets]
        self.moving, self.findings = check_motion(model, self.datasets)
        self.duration = sum(one.duration for one in self.datasets)
        self.begin, early = self._split()
        parts, zero = self._sum_blocks(early), NormalEquations.zero(self.regressors.columns)
        self.held_out, self.blocks = parts.pop(MAX_BLOCKS, zero), [parts[k] for k in sorted(parts)]
        self.fitted = sum(self.blocks, zero)
        beside = (self.regressors.sum_rows(*rows) for one in unloaded for _, rows in self._rows(one))
        self.unloaded = sum(beside, zero) if unloaded else None

    def _split(self):
        """Return where the held-out part begins in the last dataset, and the time before it [s]."""
        last, total = self.loaded[-1], sum(one.duration for one in self.loaded)
        held = remaining = min(HELD_OUT * total, last.duration if len(self.loaded) > 1 else total)
        for begin, end in reversed(last.spans):
            if end - begin >= remaining:
                return end - remaining, total - held
            remaining -= end - begin
        return last.spans[0][0], total - held

    def _rows(self, dataset):
        """Yield slices of states, and their filtered rows and weights."""
        states = dataset.states
        for one in dataset.segments:
            columns = dataset.t[one], states.position[one], states.velocity[one], states.effort[one]
            first = one.start + 1
            for rows in self.regressors.filtered_rows(*columns):
                yield slice(first, first + len(rows[0])), rows
                first += len(rows[0])

    def _sum_blocks(self, early):
        """Return normal equations by number of the block; MAX_BLOCKS is that of the held-out part."""
        count, parts, elapsed = int(np.clip(early // MIN_BLOCK, 1, MAX_BLOCKS)), {}, 0.0
        for dataset in self.loaded:
            number = np.zeros(len(dataset.t), dtype=int)
            for one in dataset.segments:
                t = dataset.t[one]
                if early > 0.0:
                    number[one] = np.minimum((elapsed + t - t[0]) // (early / count), count - 1)
                elapsed += t[-1] - t[0]
            if dataset is self.loaded[-1]:
                number[dataset.t >= self.begin] = MAX_BLOCKS
            for part, rows in self._rows(dataset):
                for block in np.unique(number[part]).tolist():
                    chosen = number[part] == block
                    sums = self.regressors.sum_rows(*(column[chosen] for column in rows))
                    parts[block] = parts[block] + sums if block in parts else sums
        return parts


def _warn_of_payload(model, steps, tips, data, ladder):
    """Return a warning of the payload at an end of the robot that would explain much of the residual."""
    left = min(rung["score"] for rung in ladder if rung["taken"])
    best, warnings = (1.0 - UNASKED_GAIN) * left, []
    for payload in tips:
        try:
            trial = Selection(model, steps, payload, data)
        except DiagDynamicsError:
            continue
        if trial.score < best:
            best = trial.score
            warnings = [
                f"a payload of {trial.payload_mass():+.2g} kg at '{payload.link}' would make the residual of what was held "
                f"out {1.0 - best / left:.0%} smaller: if the robot carries, or lacks, something there, ask for "
                f"payload:{payload.link}, too; else for inertias"
            ]
    return warnings


def _identify(model, selection, data):
    """Return the :class:`Identification`, given the steps that were selected."""
    layout, nothing, payload = selection.layout, selection.fit is None, selection.layout.payload
    free = selection.free(selection.taken)
    last = None if nothing else selection.fit_all()
    x = layout.known if nothing else selection.fit.x
    subjects = [(model, friction_of(layout, layout.known))]
    if not nothing:
        subjects.append((model_of(layout, x, payload is not None), friction_of(layout, x)))
    validations = [validate(*subject, data.loaded[-1], data.begin) for subject in subjects]
    quality = _quality(model, selection, data, validations, x)
    if last is not None:
        _add_certainty(model, selection, data, last, free, quality)
    _add_warnings(selection, quality)
    free = free._replace(inertias="inertias" in selection.taken)
    parameters = parameters_of(layout, layout.known if nothing else last.x, free, _origin(model, data, quality))
    return Identification(model.with_parameters(parameters), parameters, quality)


def _quality(model, selection, data, validations, x):
    names, before, after, last = model.dof_names, validations[0], validations[-1], data.loaded[-1]
    held = np.flatnonzero(last.t >= data.begin)[[0, -1]]
    findings = [finding for one in data.datasets for finding in one.findings]
    judged = any(one.judged().any() for one in data.relations)
    layout = selection.layout
    residuals = [np.sqrt(layout.mean_squares(selection.held_out, y)) for y in (layout.known, x)]
    return {
        "held_out": [last.start + int(stamp - last.zero) * 1e-9 for stamp in last.states.stamp[held]],
        "held_out_duration": float(np.diff(last.t[held])[0]),
        "torque_rms": _pairs(names, before.torque, after.torque),
        "explained": [before.explained, after.explained],
        "explained_total": [before.explained_total, after.explained_total],
        "row_residual": _pairs(names, *residuals),
        "observer_spread": _pairs(names, before.spread, after.spread),
        "kinetic_energy": [before.kinetic, after.kinetic],
        "taken": selection.named(selection.taken),
        "kept": selection.kept,
        "ladder": selection.ladder,
        "effort_factor": _factors(names, data.relations),
        "efforts_judged": judged and not any(finding.cause == DOUBTFUL for finding in findings),
        "velocity_delay": [one.delay for one in data.loaded],
        "effective_parameters": {},
        "payload": None,
        "warnings": selection.warnings,
        "findings": [str(finding) for finding in findings + data.findings * selection.asks_for_joints],
    }


def _add_certainty(model, selection, data, fit, free, quality):
    """Add what the rows determine of inertias."""
    warnings, layout = quality["warnings"], selection.layout
    if free.inertias:
        effective = selection.effective_parameters(fit)
        quality["effective_parameters"] = {
            model.link_names[model.bodies["link"][body]]: float(count)
            for body, count in zip(layout.bodies, effective, strict=True)
            if model.bodies["mass"][body] > 0.0
        }
        warnings.append(
            "masses and inertias of single links are not determined by any motion: only what they do together is"
        )
    if layout.payload:
        quality["payload"] = payload_certainty(layout, fit)
        warnings.append(f"payload of {layout.payload.link}: {quality['payload']['inertia_known']}")
        if data.unloaded is None:
            warnings.append(
                f"payload of {layout.payload.link}: its deviations take the model of the robot for right; a reference "
                "without the payload would tell"
            )


def _add_warnings(selection, quality):
    warnings, (before, after) = quality["warnings"], quality["kinetic_energy"]
    if before > 0.0 and abs(after / before - 1.0) > MAX_CHANGE:
        warnings.append(f"kinetic energy is {after / before:.2f} times what it was with the model")
    for name, (first, then) in quality["row_residual"].items():
        if then > first:
            warnings.append(f"the held-out residual of joint '{name}' is {then:.3g}, with the model {first:.3g}")
    for step, joints in selection.kept.items():
        for name, (without, own) in joints.items():
            end = "" if own >= without else f"; a step that was refused before needs {GAIN:.0%} less"
            warnings.append(
                f"{step} of joint '{name}': as the model has it. In cross-validation the residual is {own:.3g} with numbers "
                f"of its own, {without:.3g} with the model's{end}"
            )
    share, total = quality["explained"], quality["explained_total"][1]
    if None not in share and share[1] < share[0]:
        warnings.append(f"the efforts explain less of dK/dt than before: {share[1]:.2f} of {share[0]:.2f}")
    if None not in (share[1], total) and max(share[1], total) < NOTHING_EXPLAINED:
        quality["efforts_judged"] = False
        warnings.append(
            f"the identified model explains nothing of the motion: {share[1]:.3g} of dK/dt and {total:.3g} of d(K + U)/dt. "
            "Check that efforts are those of these joints, in their order and in N m or N"
        )


def _origin(model, data, quality):
    locked = {name: float(value) for name, value in model.locked_joints.items()}
    recordings = [
        {"path": one.path, "robot": one.robot, "states": one.count, "start": one.start, "end": one.end}
        for one in data.datasets
    ]
    return ({"locked_joints": locked} if locked else {}) | {
        "recordings": recordings,
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "method": "filtered momentum, " + (", ".join(quality["taken"]) or "nothing taken"),
        "quality": {key: quality[key] for key in ("held_out", "torque_rms", "explained", "observer_spread")},
    }


def _factors(names, relations):
    """Return factor and standard error of each joint's effort, of the recording with the smallest; None without any."""
    errors = np.array([one.error for one in relations])
    found = {}
    for k, best in enumerate(np.argmin(errors, axis=0).tolist()):
        pair = float(relations[best].factor[k]), float(errors[best, k])
        found[names[k]] = list(pair) if np.isfinite(pair).all() else None
    return found


def _pairs(names, before, after):
    """Return [before, after] by name; None for an unknown value."""
    pairs = zip(names, np.transpose([before, after]).tolist(), strict=True)
    return {name: [None if np.isnan(one) else one for one in pair] for name, pair in pairs}
