# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One identification: rows that are fitted, rows that are held out, and steps that are taken where they pay."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from typing import Any

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.identification import result
from diag_dynamics.identification.cross_validation import Blocks
from diag_dynamics.identification.equations import ROTOR
from diag_dynamics.identification.fit import (
    LEAST_VARIANCE,
    SHORT,
    SHORT_WEIGHT,
    WEIGHT,
    Free,
    Layout,
    Rows,
    fitted,
)
from diag_dynamics.identification.found import Identification
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.identification.suitability import DOUBTFUL
from diag_dynamics.recordings.balance import NOTHING_EXPLAINED

GAIN = 0.1
"""What a further step has to take off the residual of rows that it was not fitted to, or it is not taken."""

UNFELT = 0.01
"""Fraction by which the residual of rows that are held out has to be smaller without the model's rotor inertias."""

LEAST_EFFECTIVE = 5.0
"""Parameters of inertia that the rows have to tell, all bodies together, for inertias to be fitted."""

CHANGED = 0.2
"""Change of kinetic energy that is worth a warning."""

STEPS = "friction", "rotors", "inertias"
"""What can be identified beside payloads, in the order that it is tried in."""

BY_JOINT = "friction", "rotors"
"""Those of them that are taken for each joint by itself."""


class Attempt:
    """One identification, from rows to an outcome.

    Parameters
    ----------
    model : RobotModel
    steps : list of str
        Some of :data:`STEPS`, in their order.
    payload : Payload or None
    gathered : Gathered
        Rows of the recordings; the payload's body is among its carriers.
    """

    def __init__(self, model, steps, payload, gathered):
        self._model, self._payload, self._gathered = model, payload, gathered
        self._loaded, self._unloaded = gathered.loaded, gathered.unloaded
        self._findings = gathered.findings()
        self._warnings = []
        everything = sum(one.duration for one in (*self._loaded, *self._unloaded))
        self._weight = WEIGHT if everything >= SHORT else SHORT_WEIGHT
        self._steps = steps
        self._moving = np.zeros(model.nv, dtype=bool)
        if steps:
            self._moving = gathered.excitation.enough(self._findings)
            if not self._moving.any() and not self._payload:
                raise InputError(f"no joint moves enough: {self._findings[-1].text}.")
        self._own = {step: self._moving.copy() for step in BY_JOINT}
        self._kept = {step: {} for step in BY_JOINT}
        carries = payload is not None
        self._layout, self._blocks = Layout(model, gathered.equations, payload), Blocks(gathered.bounds, carries)
        self._beside = [Rows(gathered.beside, False)] if gathered.beside else []
        self._held, self._whole = [Rows(gathered.held, carries)], [Rows(gathered.whole, carries), *self._beside]
        if self._layout.known[self._layout.own(ROTOR)].any():
            self._choose_rotors()

    def _free(self, steps, **joints):
        """What is fitted in steps; `joints` are others than those that were found to pay, by step."""
        nobody = np.zeros(self._model.nv, dtype=bool)
        own = {step: joints.get(step, self._own[step]) if step in steps else nobody for step in BY_JOINT}
        return Free(own["friction"], own["rotors"], "inertias" in steps or bool(self._unloaded), self._payload)

    def _fitted(self, steps):
        """The fit to rows that are not held out."""
        return fitted(self._layout, [self._blocks.rows, *self._beside], self._free(steps), self._weight)

    def _choose_rotors(self):
        """Leave the model's rotor inertias out if the efforts do not contain them, as of sensors behind the gears."""
        steps = [step for step in self._steps if step == "friction" and self._moving.any()]
        known, scores = self._layout.known, []
        rotors, columns = known[self._layout.own(ROTOR)], self._layout.own(ROTOR)
        for armature in (rotors, 0.0):
            known[columns] = armature
            scores.append(self._score(self._fitted(steps).x if steps or self._payload else known))
        gain = 1.0 - scores[1] / scores[0]
        self._layout.without_rotors = gain > UNFELT
        if self._layout.without_rotors:
            self._warnings.append(
                f"rotor inertias of the model are left out: the residual of what was held out is {gain:.1%} smaller without "
                "them, as of torque sensors behind the gears"
            )
        else:
            known[columns] = rotors

    def _choose(self, step, taken):
        """Find for which joints a step pays, by blocks of the fitted rows that are left out in turn."""
        again = step in taken
        before = self._own[step] if again else np.zeros(self._model.nv, dtype=bool)
        steps = [*taken, step]
        free, without = self._free(steps, **{step: self._moving}), self._free(steps, **{step: before})
        worth = self._blocks.worth(self._layout, self._beside, free, without, self._weight)
        if worth is None:
            self._own[step] = self._moving.copy()
            return
        self._own[step] = before | (self._moving & worth.pays(GAIN if again else 0.0))
        self._kept[step] = {
            self._model.dof_names[k]: [float(worth.without[k]), float(worth.fitted[k])]
            for k in np.flatnonzero(self._moving & ~self._own[step])
        }

    def ladder(self):
        """Steps that are taken, the fit of them to the first part, and what was tried."""
        taken: list[str] = []
        fit = self._fitted(taken) if self._payload else None
        score = self._score(self._layout.known if fit is None else fit.x)
        rungs = [{"steps": self._named([]), "score": score, "taken": True}]
        left = [step for step in self._steps if step == "inertias" or self._moving.any()]
        refused: dict[str, str] = {}
        ahead = list(left)
        while ahead:
            step = ahead.pop(0)
            steps = [one for one in STEPS if one in taken or one == step]
            if step in BY_JOINT:
                self._choose(step, taken)
            found = self._fitted(steps)
            told = self._effective(found).sum() if step == "inertias" else LEAST_EFFECTIVE
            reached = self._score(found.x)
            better = bool(reached <= (1.0 - GAIN) * score and told >= LEAST_EFFECTIVE)
            rungs.append({"steps": self._named(steps), "score": reached, "taken": better})
            if better:
                taken = steps
                fit = self._fitted(taken) if self._chosen_anew(taken, step) else found
                score = self._score(fit.x)
                left.remove(step)
                refused.pop(step, None)
                ahead = list(left)  # what a larger error has hidden may pay now that it is gone
            else:
                refused[step] = _refusal(step, told, 1.0 - reached / score if score > 0.0 else 0.0)
        self._warnings += refused.values()
        self._kept = {step: self._kept[step] for step in BY_JOINT if step in taken and self._kept[step]}
        return taken, fit, rungs

    def _chosen_anew(self, taken, latest):
        """Whether further joints have their own numbers in steps that were taken before the latest one."""
        before = {step: self._own[step].sum() for step in BY_JOINT}
        for step in BY_JOINT:
            if step in taken and step != latest and self._kept[step]:
                self._choose(step, taken)
        return any(self._own[step].sum() > before[step] for step in BY_JOINT)

    def payload_mass(self, fit):
        """Mass of the payload by a fit [kg]."""
        return float(result.payload_in_link(self._layout, fit.x, self._payload)[0])

    def _named(self, steps):
        return ([f"payload:{self._payload.link}"] if self._payload else []) + list(steps)

    def _score(self, x):
        """Geometric mean over joints of the residual of rows held out."""
        squares = self._layout.mean_squares(self._held, x)
        efforts = sum(sums.effort / np.maximum(sums.weight, 1e-300) for sums, _ in self._held)
        least = max(
            LEAST_VARIANCE * float(np.mean(efforts)), 1e-300
        )  # a joint of which nothing is left is no better still
        return float(np.exp(0.5 * np.log(np.maximum(squares, least)).mean()))

    def _effective(self, fit):
        """How many parameters of each body the rows tell."""
        told = np.zeros(self._layout.robot)
        inside = fit.free < self._layout.robot
        told[fit.free[inside]] = fit.known[inside]
        count = PARAMETERS * len(self._layout.bodies)
        return told[:count].reshape(-1, PARAMETERS).sum(axis=1)

    def outcome(self):
        """The :class:`Identification`."""
        layout, velocity = self._layout, self._model.friction_velocity
        carries = self._payload is not None
        taken, early, rungs = self.ladder()
        free = self._free(taken)
        nothing = early is None
        last = early if nothing else fitted(layout, self._whole, free, self._weight)
        x = layout.known if nothing else early.x
        subjects = [(self._model, result.friction_of(layout, layout.known, velocity))]
        if not nothing:
            subjects.append((result.model_of(layout, x, carries), result.friction_of(layout, x, velocity)))
        held_out = self._gathered.judged(subjects)
        before, after = held_out.verdicts[0], held_out.verdicts[-1]
        quality = self._quality(taken, rungs, held_out, x)
        if last is not None:
            self._tell(last, free, quality)
        self._warn(quality, before, after)
        free = free._replace(inertias="inertias" in taken)
        origin = self._origin(taken, quality)
        parameters = result.parameters_of(layout, layout.known if nothing else last.x, free, velocity, origin)
        return Identification(self._model.with_parameters(parameters), parameters, quality)

    def _quality(self, taken, rungs, held_out, x):
        names, layout, last = self._model.dof_names, self._layout, self._loaded[-1]
        before, after = held_out.verdicts[0], held_out.verdicts[-1]
        rows = [np.sqrt(layout.mean_squares(self._held, y)) for y in (layout.known, x)]
        return {
            "held_out": [last.start + (stamp - last.zero) * 1e-9 for stamp in held_out.stamps],
            "held_out_duration": held_out.duration,
            "torque_rms": _pairs(names, before.torque, after.torque),
            "explained": [before.explained, after.explained],
            "explained_total": [before.explained_total, after.explained_total],
            "row_residual": _pairs(names, *rows),
            "observer_spread": _pairs(names, before.spread, after.spread),
            "kinetic_energy": [before.kinetic, after.kinetic],
            "taken": self._named(taken),
            "kept": self._kept,
            "ladder": rungs,
            "effort_factor": _factors(names, self._gathered.relations),
            "efforts_judged": any(one.judged().any() for one in self._gathered.relations)
            and not any(finding.cause == DOUBTFUL for finding in self._findings),
            "velocity_delay": [one.delay for one in self._loaded],
            "effective_parameters": {},
            "payload": None,
            "warnings": self._warnings,
            "findings": [str(finding) for finding in self._findings],
        }

    def _tell(self, fit, free, quality):
        """What the rows have told of inertias."""
        model = self._model
        if free.inertias:
            links, masses = (model.bodies[key][self._layout.bodies] for key in ("link", "mass"))
            quality["effective_parameters"] = {
                model.link_names[link]: float(told)
                for link, mass, told in zip(links, masses, self._effective(fit), strict=True)
                if mass > 0.0
            }
            self._warnings.append(
                "masses and inertias of single links are not determined by any motion: only what they do together is"
            )
        if self._payload:
            quality["payload"] = told = result.payload_certainty(self._layout, fit, self._payload)
            self._warnings.append(f"payload of {self._payload.link}: {told['inertia_known']}")
            if not self._unloaded:
                self._warnings.append(
                    f"payload of {self._payload.link}: its deviations take the model of the robot for right; a reference "
                    "without the payload would tell"
                )

    def _warn(self, quality, before, after):
        if before.kinetic > 0.0 and abs(after.kinetic / before.kinetic - 1.0) > CHANGED:
            ratio = after.kinetic / before.kinetic
            self._warnings.append(f"kinetic energy is {ratio:.2f} times what it was with the model")
        for name, (first, then) in quality["row_residual"].items():
            if then > first:
                self._warnings.append(
                    f"what is left of the effort of joint '{name}' is {then:.3g}, more than with the model, {first:.3g}: on "
                    "what was held out it behaves otherwise"
                )
        for step, joints in self._kept.items():
            self._warnings += [_kept(step, name, *pair) for name, pair in joints.items()]
        shares = quality["explained"]
        if None not in shares and shares[1] < shares[0]:
            self._warnings.append(f"the efforts explain less of dK/dt than before: {shares[1]:.2f} of {shares[0]:.2f}")
        total = quality["explained_total"][1]
        if None not in (shares[1], total) and max(shares[1], total) < NOTHING_EXPLAINED:
            quality["efforts_judged"] = False
            self._warnings.append(
                f"the identified model explains nothing of the motion: {shares[1]:.3g} of dK/dt and {total:.3g} of "
                "d(K + U)/dt. Check that efforts are those of these joints, in their order and in N m or N"
            )

    def _origin(self, taken, quality) -> Mapping[str, Any]:
        locked = {name: float(value) for name, value in self._model.locked_joints.items()}
        return ({"locked_joints": locked} if locked else {}) | {
            "recordings": [
                {
                    "path": one.path,
                    "robot": one.robot,
                    "states": one.states,
                    "start": one.start,
                    "end": one.end,
                }
                for one in (*self._loaded, *self._unloaded)
            ],
            "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "method": "filtered momentum, " + (", ".join(self._named(taken)) or "nothing taken"),
            "quality": {key: quality[key] for key in ("held_out", "torque_rms", "explained", "observer_spread")},
        }


def _refusal(step, told, gain):
    """Why a step was not taken, in words."""
    if told < LEAST_EFFECTIVE:
        return (
            f"{step} stay as the model has them: the motion tells {told:.1f} of their parameters, expected "
            f"{LEAST_EFFECTIVE:g} at least"
        )
    return (
        f"{step} stay as the model has them: the residual of what was held out would be {max(0.0, gain):.1%} smaller, "
        f"expected {GAIN:.0%} at least"
    )


def _kept(step, joint, without, own):
    """Why a joint has no numbers of its own, in words."""
    text = (
        f"{step} of joint '{joint}': as the model has it. In blocks of the recording that were left out of the fit in turn, "
        f"{own:.3g} would be left of the effort, and without {without:.3g}"
    )
    return text if own >= without else f"{text}: less than the {GAIN:.0%} that is asked of what was refused before"


def _factors(names, relations):
    """Factor and standard error of each joint's effort, of the recording that tells it best; None where none does."""
    errors = np.array([one.error for one in relations])
    best = np.argmin(errors, axis=0)
    found = {}
    for k, name in enumerate(names):
        factor, error = relations[best[k]].factor[k], errors[best[k], k]
        found[name] = [float(factor), float(error)] if np.isfinite([factor, error]).all() else None
    return found


def _pairs(names, before, after):
    """[before, after] by name; None for what is not known."""
    return {
        name: [None if np.isnan(one) else float(one) for one in pair]
        for name, *pair in zip(names, before, after, strict=True)
    }
