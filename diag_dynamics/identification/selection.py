# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stepwise selection: friction, rotors and inertias are taken where they reduce the residual of other rows."""

import copy

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.fit import MIN_VARIANCE, Layout, fit_rows
from diag_dynamics.identification.regressors import DAMPING, FRICTION, OFFSET, ROTOR

WEIGHT, SHORT_WEIGHT, SHORT = 10.0, 30.0, 6.0  # γ of the prior on inertias; for less motion than this [s]
BY_JOINT = {"friction": (DAMPING, FRICTION, OFFSET), "rotors": (ROTOR,)}  # unknowns that are taken joint by joint
STEPS = *BY_JOINT, "inertias"  # beside payloads, in the order in which they are tried
GAIN, ROTOR_GAIN = 0.1, 0.01  # reductions of the held-out residual to take a step, and to leave out the model's rotors
MIN_BLOCKS = 3  # of rows, for cross-validation


def read_what(what, model):
    """Return names of what to identify, its steps in order, and the links of its payloads."""
    names = (what,) if isinstance(what, str) else tuple(what)
    steps = [step for step in STEPS if step in names]
    links = [name[8:] for name in names if str(name).startswith("payload:")]
    if not names or set(names) != {*steps, *(f"payload:{link}" for link in links)}:
        raise InputError(f"what is {what!r}; expected one or more of {', '.join(STEPS)}, payload:<link>.")
    for link in links:
        if model.placement_in_body(link)[0] == 0:
            raise InputError(
                f"what is {what!r}, but no joint moves link '{link}'. Name the link that carries the payload."
            )
    return names, steps, links


class Selection:
    """Choose steps by rows that are held out, and the joints of a step by cross-validation.

    `fit` is that of the steps `taken` to the other rows, None if nothing is fitted. `ladder` has the steps
    that were tried with their scores, `kept` by step and joint that keeps the model's values the residuals
    with these and with its own.
    """

    def __init__(self, model, steps, payload, data):
        self._model, self._payload, self._data = model, payload, data
        self.layout, self.warnings, self.taken, self.fit = Layout(model, data.regressors, payload), [], [], None
        self.asks_for_joints = bool(steps)
        self._beside = [] if data.unloaded is None else [(data.unloaded, False)]
        self._early, self.held_out = [(data.fitted, True)], [(data.held_out, True)]
        self._weight = WEIGHT if data.duration >= SHORT else SHORT_WEIGHT
        self._moving = data.moving if steps else np.zeros(model.nv, dtype=bool)
        if steps and not self._moving.any() and not payload:
            raise InputError(f"no joint moves enough: {data.findings[-1].text}.")
        self._own = dict.fromkeys(BY_JOINT, self._moving)
        self.kept = {step: {} for step in BY_JOINT}
        if self.layout.known[self.layout.own(ROTOR)].any():
            self._choose_rotors(steps)
        self._select([step for step in steps if step == "inertias" or self._moving.any()])

    def free(self, steps, **joints):
        """Return which unknowns steps fit, bool; `joints` of a step replace those that were chosen."""
        own, free = self._own | joints, self.layout.inertial & ("inertias" in steps or bool(self._beside))
        free[self.layout.robot :] = True
        for step, columns in BY_JOINT.items():
            for column in columns if step in steps else ():
                free[self.layout.own(column)] = own[step]
        return free

    def fit_all(self):
        """Return the fit of the steps that were taken to all rows."""
        return self.fit_to([*self._early, *self.held_out], self.free(self.taken))

    def with_payload(self, payload):
        """Return mass and score of a payload that is fitted beside the steps that were taken."""
        trial = copy.copy(self)
        trial.layout = Layout(self._model, self._data.regressors, payload)
        trial.layout.without_rotors = self.layout.without_rotors
        if self.layout.without_rotors:
            trial.layout.known[trial.layout.own(ROTOR)] = 0.0
        x = trial.fit_to(self._early, trial.free(self.taken)).x
        return x[trial.layout.robot], trial.score_of(x)

    def named(self, steps):
        """Return names of steps, the payload first."""
        return ([f"payload:{self._payload.link}"] if self._payload else []) + list(steps)

    def fit_to(self, rows, free):
        """Return the fit of the free unknowns to rows and to references."""
        return fit_rows(self.layout, [*rows, *self._beside], free, self._weight)

    def score_of(self, x):
        """Return the geometric mean over joints of the residual of rows held out."""
        squares = self.layout.mean_squares(self.held_out, x)
        efforts = self.layout.mean_squares(self.held_out, np.zeros(self.layout.size))
        return float(np.exp(0.5 * np.log(np.maximum(squares, max(MIN_VARIANCE * efforts.mean(), 1e-300))).mean()))

    def _choose_rotors(self, steps):
        """Leave the model's rotor inertias out if the efforts do not contain them, as of torque sensors."""
        free = self.free(["friction"] if "friction" in steps else [])
        known, columns = self.layout.known, self.layout.own(ROTOR)
        rotors, scores = known[columns], []
        for armature in (0.0, rotors):
            known[columns] = armature
            scores.append(self.score_of(self.fit_to(self._early, free).x))
        gain = 1.0 - scores[0] / scores[1]
        self.layout.without_rotors = gain > ROTOR_GAIN
        if self.layout.without_rotors:
            known[columns] = 0.0
            self.warnings.append(
                f"rotor inertias of the model are omitted: the held-out residual is {gain:.1%} smaller without them, as with "
                "torque sensors behind the gears"
            )

    def _select(self, left):
        """Take each step that reduces the score enough; after it try those again that a larger error has hidden."""
        if self._payload:
            self.fit = self.fit_to(self._early, self.free([]))
        self.score, refused = self.score_of(self.fit.x if self.fit else self.layout.known), {}
        self.ladder = [{"steps": self.named([]), "score": self.score, "taken": True}]
        ahead = list(left)
        while ahead:
            step = ahead.pop(0)
            refused[step] = self._try_step(step)
            if not refused[step]:
                left.remove(step)
                ahead = list(left)
        self.warnings += filter(None, refused.values())
        self.kept = {step: joints for step, joints in self.kept.items() if step in self.taken and joints}

    def _try_step(self, step):
        """Take a step if it reduces the score enough; else return why not."""
        steps = [one for one in STEPS if one in self.taken or one == step]
        if step in BY_JOINT:
            self._choose_joints(step)
        fit = self.fit_to(self._early, self.free(steps))
        score = self.score_of(fit.x)
        gain = 1.0 - score / max(self.score, 1e-300)
        better = bool(score <= (1.0 - GAIN) * self.score)
        self.ladder.append({"steps": self.named(steps), "score": score, "taken": better})
        if not better:
            return (
                f"{step}: the model's values are kept, because the held-out residual would be only {max(0.0, gain):.1%} "
                f"smaller; expected at least {GAIN:.0%}"
            )
        self.taken, self.fit = steps, fit
        before = sum(own.sum() for own in self._own.values())
        for one in BY_JOINT:
            if one in steps and one != step and self.kept[one]:
                self._choose_joints(one)
        if sum(own.sum() for own in self._own.values()) > before:
            self.fit = self.fit_to(self._early, self.free(steps))
        self.score = self.score_of(self.fit.x)
        return ""

    def _choose_joints(self, step):
        """Choose joints of which a step reduces the residual of blocks that are left out of the fit in turn."""
        blocks, fitted = self._data.blocks, self._data.fitted
        if len(blocks) < MIN_BLOCKS:
            self._own[step] = self._moving
            return
        again = step in self.taken
        before, steps, squares = self._own[step] & again, [*self.taken, step], np.zeros((2, self._model.nv))
        for block in blocks:
            for total, joints in zip(squares, (before, self._moving), strict=True):
                x = self.fit_to([(fitted - block, True)], self.free(steps, **{step: joints})).x
                total += self.layout.squares([(block, True)], x)
        without, own = np.sqrt(squares / max(fitted[-1], 1e-300))
        self._own[step] = before | (self._moving & (own < (1.0 - GAIN * again) * without))
        kept = np.flatnonzero(self._moving & ~self._own[step])
        self.kept[step] = {self._model.dof_names[k]: [float(without[k]), float(own[k])] for k in kept}
