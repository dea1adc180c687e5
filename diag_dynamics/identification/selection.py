# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stepwise selection of friction, rotors and inertias by cross-validation of the residual."""

import copy

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.fit import (
    MIN_VARIANCE,
    ConvergenceError,
    Layout,
    fit_rows,
)
from diag_dynamics.identification.normal_equations import (
    DAMPING,
    FRICTION,
    LOAD,
    OFFSET,
    OWN,
    ROOT,
    ROTOR,
)
from diag_dynamics.identification.result import parameters_of

# γ of the prior on inertias; for less motion than this [s]
WEIGHT, SHORT_WEIGHT, SHORT = 10.0, 30.0, 6.0
# Steps that are taken joint by joint
BY_JOINT = {
    "friction": (DAMPING, FRICTION, OFFSET),
    "rotors": (ROTOR,),
    "gears": (LOAD, ROOT),
}
# Steps beside payloads, in the order in which they are tried
STEPS = "friction", "rotors", "inertias", "gears"
PAYLOAD = "payload:"  # before the link that carries it
MIN_RESIDUAL = 2e-3  # relative to the effort: what a sampled motion leaves anyway
# Torque of gravity in the filtered load column over the effort, of a joint with load friction
MIN_LOAD = 0.1
# Reductions of the residual to take a step, and to leave out the model's rotors
GAIN, ROTOR_GAIN = 0.03, 0.01
ERRORS = 3.0  # standard deviations of noise that reduce the residual less


def read_what(what, model):
    """Return names of what to identify, its steps in order, and masses of payloads by link.

    Inertias alone are all steps. An unknown mass is None.
    """
    names = (what,) if isinstance(what, str) else tuple(what)
    steps = [step for step in STEPS if step in names or set(names) - {"gains"} == {"inertias"}]
    carried = [name for name in names if str(name).startswith(PAYLOAD)]
    if not names or not set(names) <= {*STEPS, "gains", *carried}:
        raise InputError(
            f"what is {what!r}; expected one or more of {', '.join(STEPS)}, gains, payload:<link>."
        )
    masses = {}
    for name in carried:
        link, is_known, mass = name.removeprefix(PAYLOAD).partition("=")
        masses[link] = _read_mass(what, mass) if is_known else None
        if is_known and "gains" not in names:
            raise InputError(
                f"what is {what!r}; expected gains beside a known payload. Add gains, or remove "
                f"={mass}."
            )
        if model.placement_in_body(link)[0] == 0:
            raise InputError(
                f"what is {what!r}, but no joint moves link '{link}'. Name the link that carries "
                "the payload."
            )
    return names, steps, masses


def _read_mass(what, text):
    """Return the mass of a known payload [kg]."""
    try:
        mass = float(text)
    except ValueError:
        mass = np.nan
    if not 0.0 < mass < np.inf:
        raise InputError(f"what is {what!r}; expected payload:<link>=<mass> with a mass > 0 [kg].")
    return mass


class Selection:
    """Choose steps, and the joints of a step, by cross-validation over blocks of all recordings.

    Each block is left out of the fit in turn. A step has to reduce the residual of some joint over
    all blocks by more than chance, and the geometric mean over joints. Friction, rotors and gears
    are taken at joints whose residual they reduce by GAIN. `fits` without each block, (blocks,
    size), and the `squares` of that block's residuals, (blocks, nv), are those of the steps
    `taken`. `ladder` has the steps that were tried with their scores, `kept` by step and joint that
    keeps the model's values the residuals with these and with its own.
    """

    def __init__(self, model, steps, payload, data):
        self._model = model
        self._payload = payload
        self._data = data
        self.layout = Layout(model, data.regressors, payload)
        self.warnings = []
        self.taken = []
        self.asks_for_joints = bool(steps)
        self._weight = WEIGHT if data.duration >= SHORT else SHORT_WEIGHT
        self._moving = {
            step: np.any([data.able[column] for column in columns], axis=0) & bool(steps)
            for step, columns in BY_JOINT.items()
        }
        if steps and not data.able[FRICTION].any() and not payload:
            files = ", ".join(dataset.name for dataset in data.datasets)
            raise InputError(f"{files}: no joint moves enough: {data.findings[-1].text}.")
        efforts = self.layout.squares([(data.fitted, True)], np.zeros(self.layout.size))
        self._negligible = max(MIN_VARIANCE * efforts.mean(), 1e-300)
        self._floor = MIN_RESIDUAL * self.residuals(efforts[None])
        # Fits to other blocks change residuals e by d. Noise alone reduces e² by 2ed − d², at most
        # by the square of its standard normal component along d. Weights count independent rows.
        chance = -np.expm1(-0.5 * ERRORS**2 / data.fitted[-1])
        self._gain = max(GAIN, chance)
        self._rotor_gain = max(ROTOR_GAIN, chance / data.measured.sum())
        at = LOAD - len(OWN) - 1
        self._loaded = np.array(
            [products[at, at] > MIN_LOAD**2 * products[-1, -1] for products in data.fitted[:-1]]
        )
        self._own = dict(self._moving)
        self.kept = {step: {} for step in BY_JOINT}
        if self.layout.known[self.layout.own(ROTOR)].any():
            self._choose_rotors(steps)
        impossible = {"rotors"} if self.layout.without_rotors else set()
        impossible |= {step for step, joints in self._moving.items() if not joints.any()}
        self._select([step for step in steps if step not in impossible])

    @property
    def score(self):
        """Geometric mean over joints of the residual of the steps taken."""
        return self._score_of(self.squares)

    def free(self, steps, **joints):
        """Return which unknowns steps fit, bool.

        `joints` of a step replace those that were chosen.
        """
        chosen = self._own | joints
        free = self.layout.inertial & ("inertias" in steps or self._data.unloaded is not None)
        free[self.layout.robot :] = True
        for step, columns in BY_JOINT.items():
            for column in columns if step in steps else ():
                free[self.layout.own(column)] = (
                    chosen[step] & self._data.able[column] & (self._loaded | (column != LOAD))
                )
        return free

    def fit_all(self):
        """Return the fit of the steps that were taken to all rows."""
        return self._fit_to(self._data.fitted, self.free(self.taken))

    def left_out(self):
        """Return the fits of the accepted steps without each block in turn, (blocks, size).

        Gains are without that block, too.
        """
        free = self.free(self.taken)
        return np.array([self._fit_to(sums, free).x for sums in self._data.left_out()])

    def payload_by_recording(self, fit):
        """Return mass and standard deviation of the payload in each recording.

        Other unknowns are as in a fit.
        """
        layout = copy.copy(self.layout)
        mass = self.layout.robot
        layout.known = fit.x
        masses = []
        free = np.arange(layout.size) >= mass
        for sums in self._data.sum_recordings():
            fit = fit_rows(layout, [(sums, True)], free, self._weight)
            variance = fit.certainty.covariance[mass, mass] + fit.certainty.by_gains[mass, mass]
            masses.append((float(fit.x[mass]), float(np.sqrt(variance))))
        return masses

    def named(self, steps):
        """Return names of steps, gains and the payload first."""
        first = ["gains"] * (self._data.gains is not None) + [
            f"payload:{payload.link}" for payload in [self._payload] if payload
        ]
        return first + list(steps)

    def residuals(self, squares):
        """Return the root mean squared residual of each degree of freedom over all blocks."""
        return np.sqrt(np.maximum(squares.sum(axis=0), self._negligible) / self._data.fitted[-1])

    def squares_of(self, fits):
        """Return squared residuals of each block with its row of unknowns, (blocks, nv)."""
        return np.array(
            [
                self.layout.squares([(block, True)], x)
                for block, x in zip(self._data.blocks, fits, strict=True)
            ]
        )

    def _fit_to(self, sums, free, similar=None):
        """Return the fit of the free unknowns to normal equations and to those of references."""
        unloaded = [] if self._data.unloaded is None else [(self._data.unloaded, False)]
        return fit_rows(self.layout, [(sums, True), *unloaded], free, self._weight, similar)

    def _update_load(self):
        """Let the load of gears be that of the inertias that were fitted."""
        if "inertias" in self.taken:
            parameters = parameters_of(self.layout, self.fit_all().x, self.free(self.taken))
            self._data.use_load_of(self._model.with_parameters(parameters))

    def cross_validate(self, free):
        """Return unknowns fitted without each block in turn, and the block's squared residuals."""
        whole = self._fit_to(self._data.fitted, free)
        parts = [self._data.fitted - block for block in self._data.blocks]
        fits = np.array([self._fit_to(part, free, whole).x for part in parts])
        return fits, self.squares_of(fits)

    def _score_of(self, squares):
        """Return the geometric mean over joints of the residual of all blocks."""
        return float(np.exp(np.log(self.residuals(squares)[self._data.measured]).mean()))

    def _choose_rotors(self, steps):
        """Omit the model's rotor inertias if efforts do not contain them, as of torque sensors."""
        free = self.free(["friction"] if "friction" in steps else [])
        unknowns = self.layout.known
        columns = self.layout.own(ROTOR)
        rotors = unknowns[columns]
        scores = []
        for armature in (0.0, rotors):
            unknowns[columns] = armature
            scores.append(self._score_of(self.cross_validate(free)[1]))
        gain = 1.0 - scores[0] / scores[1]
        self.layout.without_rotors = gain > self._rotor_gain
        if self.layout.without_rotors:
            unknowns[columns] = 0.0
            self.warnings.append(
                f"rotor inertias of the model are omitted: the held-out residual is {gain:.1%} "
                "smaller without them, as with torque sensors behind the gears"
            )

    def _select(self, steps):
        """Take each step that reduces the residual enough.

        After it try those again that a larger error has hidden.
        """
        self.fits, self.squares = self.cross_validate(self.free([]))
        self.ladder = [self._rung([], self.squares, True)]
        refused = {}
        ahead = list(steps)
        while ahead:
            step = ahead.pop(0)
            refused[step] = self._try_step(step)
            if not refused[step]:
                for earlier in [
                    earlier for earlier in self.taken if earlier != step and self.kept.get(earlier)
                ]:
                    self._try_step(earlier)
                steps.remove(step)
                ahead = list(steps)
        if {"inertias", "gears"} <= set(self.taken):
            self._update_load()
            self.fits, self.squares = self.cross_validate(self.free(self.taken))
        self.warnings += filter(None, refused.values())
        self.kept = {
            step: joints for step, joints in self.kept.items() if step in self.taken and joints
        }

    def _rung(self, steps, squares, taken):
        """Return an entry of the ladder."""
        residuals = dict(zip(self._model.dof_names, self.residuals(squares).tolist(), strict=True))
        return {
            "steps": self.named(steps),
            "score": self._score_of(squares),
            "taken": taken,
            "residuals": residuals,
        }

    def _try_step(self, step):
        """Take a step if its fit converges and reduces the residual enough; else return why not."""
        try:
            return self._judge_step(step)
        except ConvergenceError:
            return (
                f"{step}: the model's values are kept, because the fit does not converge. "
                f"Leave {step} out of what"
            )

    def _judge_step(self, step):
        """Take a step if it reduces the residual enough, at joints where it does.

        Otherwise return the reason.
        """
        if step == "gears":
            self._update_load()
        again = step in self.taken
        steps = [earlier for earlier in STEPS if earlier in self.taken or earlier == step]
        candidates = (
            self._moving[step] & ~(self._own[step] & again)
            if step in BY_JOINT
            else np.ones(self._model.nv, bool)
        )
        joints = {step: self._moving[step]} if step in BY_JOINT else {}
        result = self.cross_validate(self.free(steps, **joints))
        without = self.residuals(self.squares)
        residuals = self.residuals(result[1])
        gains = np.where(
            candidates,
            1.0 - np.hypot(residuals, self._floor) / np.hypot(without, self._floor),
            -np.inf,
        )
        if joints:
            rejected = np.flatnonzero(candidates & (gains < GAIN))
            self.kept[step] = {
                self._model.dof_names[k]: [float(without[k]), float(residuals[k])] for k in rejected
            }
            joints = {step: self._moving[step] & ~np.isin(np.arange(len(gains)), rejected)}
            if 0 < len(rejected) < candidates.sum():
                result = self.cross_validate(self.free(steps, **joints))
        score = self._score_of(result[1])
        least = GAIN if again else self._gain
        better = bool(gains.max() >= least and score < self.score)
        if better or not again:
            self.ladder.append(self._rung(steps, result[1], better))
        if better:
            self.taken = steps
            self.fits, self.squares = result
            self._own |= joints
        if better or again:
            return ""
        return (
            f"{step}: the model's values are kept, because fitted ones do not reduce the "
            f"cross-validation residual by {self._gain:.0%} at a joint and over all"
        )
