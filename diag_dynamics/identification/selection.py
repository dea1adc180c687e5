# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stepwise selection: friction, rotors and inertias are taken where they reduce the residual of other rows."""

from __future__ import annotations

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.fit import MIN_VARIANCE, Free, Layout, Rows, fit_rows
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.identification.regressors import ROTOR
from diag_dynamics.identification.result import payload_in_link

WEIGHT, SHORT_WEIGHT, SHORT = 10.0, 30.0, 6.0  # γ of the prior on inertias; for less motion than this [s]
STEPS = "friction", "rotors", "inertias"  # beside payloads, in the order in which they are tried
BY_JOINT = STEPS[:2]  # steps that are taken for each joint by itself
GAIN, ROTOR_GAIN = 0.1, 0.01  # reductions of the held-out residual to take a step, and to leave out the model's rotors
MIN_EFFECTIVE = 5.0  # parameters of inertia that the rows have to determine
MIN_BLOCKS = 3  # of rows, for cross-validation


class Selection:
    """Choose steps by rows that are held out, and the joints of a step by cross-validation.

    `fit` is that of the steps `taken` to the other rows, None if nothing is fitted. `ladder` has the steps
    that were tried with their scores, `kept` by step and joint that keeps the model's values the residuals
    with these and with its own.
    """

    def __init__(self, model, steps, payload, data):
        self._model, self._steps, self._payload = model, steps, payload
        self.layout, self.warnings, carries = Layout(model, data.regressors, payload), [], payload is not None
        self._beside = [Rows(data.unloaded, False)] if data.unloaded else []
        self._blocks = [Rows(block, carries) for block in data.blocks]
        self._early, self.held_out = Rows(data.fitted, carries), [Rows(data.held_out, carries)]
        self._weight = WEIGHT if data.duration >= SHORT else SHORT_WEIGHT
        self.asks_for_joints = bool(steps)
        self._moving = data.moving if steps else np.zeros(model.nv, dtype=bool)
        if steps and not self._moving.any() and not payload:
            raise InputError(f"no joint moves enough: {data.findings[-1].text}.")
        self._own = dict.fromkeys(BY_JOINT, self._moving)
        self.kept = {step: {} for step in BY_JOINT}
        if self.layout.known[self.layout.own(ROTOR)].any():
            self._choose_rotors()
        self._select()

    def free(self, steps, **joints):
        """Return the :class:`Free` of steps; `joints` of a step replace those that were chosen."""
        nobody = np.zeros(self._model.nv, dtype=bool)
        own = {step: joints.get(step, self._own[step]) if step in steps else nobody for step in BY_JOINT}
        fits_links = "inertias" in steps or bool(self._beside)
        return Free(own["friction"], own["rotors"], fits_links, self._payload is not None)

    def fit_all(self):
        """Return the fit of the steps that were taken to all rows."""
        return self._fit([self._early, *self.held_out], self.free(self.taken))

    def effective_parameters(self, fit):
        """Return how many parameters of each body the rows determine."""
        known, count = np.zeros(self.layout.size), PARAMETERS * len(self.layout.bodies)
        known[fit.free] = fit.determined
        return known[:count].reshape(-1, PARAMETERS).sum(axis=1)

    def payload_mass(self):
        """Return the mass of the payload [kg]."""
        return float(payload_in_link(self.layout, self.fit.x, self._payload)[0])

    @property
    def score(self):
        """Score of the steps that were taken."""
        return min(rung["score"] for rung in self.ladder if rung["taken"])

    def named(self, steps):
        """Return names of steps, the payload first."""
        return ([f"payload:{self._payload.link}"] if self._payload else []) + list(steps)

    def _fit(self, rows, free):
        return fit_rows(self.layout, [*rows, *self._beside], free, self._weight)

    def _score(self, x):
        """Return the geometric mean over joints of the residual of rows held out."""
        ((sums, _),) = self.held_out
        least = MIN_VARIANCE * float(np.mean(sums.effort_squares) / max(sums.weight, 1e-300))
        squares = np.maximum(self.layout.mean_squares(self.held_out, x), max(least, 1e-300))
        return float(np.exp(0.5 * np.log(squares).mean()))

    def _choose_rotors(self):
        """Leave the model's rotor inertias out if the efforts do not contain them, as of torque sensors."""
        steps = [step for step in self._steps if step == "friction" and self._moving.any()]
        known, columns, scores = self.layout.known, self.layout.own(ROTOR), []
        rotors = known[columns]
        for armature in (rotors, 0.0):
            known[columns] = armature
            x = self._fit([self._early], self.free(steps)).x if steps or self._payload else known
            scores.append(self._score(x))
        gain = 1.0 - scores[1] / scores[0]
        self.layout.without_rotors = gain > ROTOR_GAIN
        if self.layout.without_rotors:
            self.warnings.append(
                f"rotor inertias of the model are left out: the residual of what was held out is {gain:.1%} smaller without "
                "them, as of torque sensors behind the gears"
            )
        else:
            known[columns] = rotors

    def _select(self):
        """Take each step that reduces the score enough; after it try those again that a larger error has hidden."""
        self.taken, refused = [], {}
        self.fit = self._fit([self._early], self.free([])) if self._payload else None
        score = self._score(self.fit.x if self.fit else self.layout.known)
        self.ladder = [{"steps": self.named([]), "score": score, "taken": True}]
        left = [step for step in self._steps if step == "inertias" or self._moving.any()]
        ahead = list(left)
        while ahead:
            step = ahead.pop(0)
            steps = [one for one in STEPS if one in self.taken or one == step]
            if step in BY_JOINT:
                self._choose_joints(step)
            fit = self._fit([self._early], self.free(steps))
            effective = self.effective_parameters(fit).sum() if step == "inertias" else MIN_EFFECTIVE
            reached = self._score(fit.x)
            better = bool(reached <= (1.0 - GAIN) * score and effective >= MIN_EFFECTIVE)
            self.ladder.append({"steps": self.named(steps), "score": reached, "taken": better})
            if not better:
                refused[step] = _refusal(step, effective, 1.0 - reached / score if score > 0.0 else 0.0)
                continue
            self.taken, self.fit = steps, fit
            if self._choose_again(step):
                self.fit = self._fit([self._early], self.free(steps))
            score = self._score(self.fit.x)
            left.remove(step)
            refused.pop(step, None)
            ahead = list(left)
        self.warnings += refused.values()
        self.kept = {step: self.kept[step] for step in BY_JOINT if step in self.taken and self.kept[step]}

    def _choose_again(self, latest):
        """Choose joints of earlier steps again; return whether there are more of them."""
        before = sum(own.sum() for own in self._own.values())
        for step in BY_JOINT:
            if step in self.taken and step != latest and self.kept[step]:
                self._choose_joints(step)
        return sum(own.sum() for own in self._own.values()) > before

    def _choose_joints(self, step):
        """Choose joints of which a step reduces the residual of blocks that are left out of the fit in turn."""
        if len(self._blocks) < MIN_BLOCKS:
            self._own[step] = self._moving
            return
        again = step in self.taken
        before = self._own[step] if again else np.zeros(self._model.nv, dtype=bool)
        steps, squares = [*self.taken, step], np.zeros((2, self._model.nv))
        for block in self._blocks:
            rest = Rows(self._early.sums - block.sums, block.loaded)
            for total, joints in zip(squares, (before, self._moving), strict=True):
                x = self._fit([rest], self.free(steps, **{step: joints})).x
                total += block.sums.residual_squares(self.layout.effective(x, block.loaded))
        without, own = np.sqrt(squares / max(self._early.sums.weight, 1e-300))
        self._own[step] = before | (self._moving & (own < (1.0 - GAIN * again) * without))
        self.kept[step] = {
            self._model.dof_names[k]: [float(without[k]), float(own[k])]
            for k in np.flatnonzero(self._moving & ~self._own[step])
        }


def _refusal(step, effective, gain):
    if effective < MIN_EFFECTIVE:
        return (
            f"{step} stay as the model has them: the motion tells {effective:.1f} of their parameters, expected "
            f"{MIN_EFFECTIVE:g} at least"
        )
    return (
        f"{step} stay as the model has them: the residual of what was held out would be {max(0.0, gain):.1%} smaller, "
        f"expected {GAIN:.0%} at least"
    )
