# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stepwise selection: friction, rotors and inertias are taken where they reduce the residual of other rows."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.fit import MIN_VARIANCE, Free, Layout, fit_rows
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.identification.regressors import ROTOR

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
        self._model, self._steps, self._payload, self._data = model, steps, payload, data
        self.layout, self.warnings, self.taken = Layout(model, data.regressors, payload), [], []
        self._beside = [] if data.unloaded is None else [(data.unloaded, False)]
        self._early, self.held_out = self._rows(data.fitted), self._rows(data.held_out)
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

    def _rows(self, sums):
        return [(sums, self._payload is not None)]

    def free(self, steps, **joints):
        """Return the :class:`Free` of steps; `joints` of a step replace those that were chosen."""
        own = self._own | joints
        friction, rotors = (own[step] & (step in steps) for step in BY_JOINT)
        return Free(friction, rotors, "inertias" in steps or bool(self._beside), self._payload is not None)

    def fit_all(self):
        """Return the fit of the steps that were taken to all rows."""
        return self._fit([*self._early, *self.held_out], self.free(self.taken))

    def effective_parameters(self, fit):
        """Return how many parameters of each body the rows determine."""
        known, count = np.zeros(self.layout.size), PARAMETERS * len(self.layout.bodies)
        known[fit.free] = fit.determined
        return known[:count].reshape(-1, PARAMETERS).sum(axis=1)

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
        squares = self.layout.mean_squares(self.held_out, x)
        efforts = self.layout.mean_squares(self.held_out, np.zeros(self.layout.size))
        return float(np.exp(0.5 * np.log(np.maximum(squares, max(MIN_VARIANCE * efforts.mean(), 1e-300))).mean()))

    def _choose_rotors(self):
        """Leave the model's rotor inertias out if the efforts do not contain them, as of torque sensors."""
        steps = [step for step in self._steps if step == "friction"]
        known, columns, scores = self.layout.known, self.layout.own(ROTOR), []
        rotors = known[columns]
        for armature in (rotors, 0.0):
            known[columns] = armature
            scores.append(self._score(self._fit(self._early, self.free(steps)).x))
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
        self.fit = self._fit(self._early, self.free([])) if self._payload else None
        score = self._score(self.fit.x if self.fit else self.layout.known)
        self.ladder, refused = [{"steps": self.named([]), "score": score, "taken": True}], {}
        left = [step for step in self._steps if step == "inertias" or self._moving.any()]
        ahead = list(left)
        while ahead:
            step = ahead.pop(0)
            steps = [one for one in STEPS if one in self.taken or one == step]
            if step in BY_JOINT:
                self._choose_joints(step)
            fit = self._fit(self._early, self.free(steps))
            effective = self.effective_parameters(fit).sum() if step == "inertias" else MIN_EFFECTIVE
            reached = self._score(fit.x)
            better = bool(reached <= (1.0 - GAIN) * score and effective >= MIN_EFFECTIVE)
            self.ladder.append({"steps": self.named(steps), "score": reached, "taken": better})
            if not better:
                gain = max(0.0, 1.0 - reached / score) if score > 0.0 else 0.0
                refused[step] = (
                    f"{step} stay as the model has them: the motion determines {effective:.1f} of their parameters, "
                    f"expected {MIN_EFFECTIVE:g}"
                    if effective < MIN_EFFECTIVE
                    else f"{step} stay as the model has them: the residual of what was held out would be {gain:.1%} smaller, "
                    f"expected {GAIN:.0%} at least"
                )
                continue
            self.taken, self.fit = steps, fit
            if self._choose_again(step):
                self.fit = self._fit(self._early, self.free(steps))
            score = self._score(self.fit.x)
            left.remove(step)
            refused.pop(step, None)
            ahead = list(left)
        self.warnings += refused.values()
        self.kept = {step: joints for step, joints in self.kept.items() if step in self.taken and joints}

    def _choose_again(self, latest):
        """Choose joints of earlier steps again; return whether there are more of them."""
        before = sum(own.sum() for own in self._own.values())
        for step in BY_JOINT:
            if step in self.taken and step != latest and self.kept[step]:
                self._choose_joints(step)
        return sum(own.sum() for own in self._own.values()) > before

    def _choose_joints(self, step):
        """Choose joints of which a step reduces the residual of blocks that are left out of the fit in turn."""
        blocks, fitted = self._data.blocks, self._data.fitted
        if len(blocks) < MIN_BLOCKS:
            self._own[step] = self._moving
            return
        again = step in self.taken
        before = self._own[step] & again
        steps, squares = [*self.taken, step], np.zeros((2, self._model.nv))
        for block in blocks:
            for total, joints in zip(squares, (before, self._moving), strict=True):
                x = self._fit(self._rows(fitted - block), self.free(steps, **{step: joints})).x
                total += self.layout.squares(self._rows(block), x)
        without, own = np.sqrt(squares / max(fitted[-1], 1e-300))
        self._own[step] = before | (self._moving & (own < (1.0 - GAIN * again) * without))
        kept = np.flatnonzero(self._moving & ~self._own[step])
        self.kept[step] = {self._model.dof_names[k]: [float(without[k]), float(own[k])] for k in kept}
