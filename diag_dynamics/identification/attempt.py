"""One identification: rows that are fitted, rows that are held out, and steps that are taken where they pay."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.identification import result
from diag_dynamics.identification.equations import Equations
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
from diag_dynamics.identification.judgement import judged
from diag_dynamics.identification.kernels.regressors import PARAMETERS
from diag_dynamics.identification.segments import duration
from diag_dynamics.identification.suitability import excited
from diag_dynamics.model import Parameters
from diag_dynamics.recordings.recording import Recording

RATE = 2.0 * np.pi
"""λ of the filter [1/s]: 1 Hz. At 3 Hz the noise of velocities biases the columns."""

HELD_OUT = 1.0 / 3.0
"""Part of the recordings that a fit is judged by."""

GAIN = 0.1
"""What a further step has to take off the residual of rows that it was not fitted to, or it is not taken."""

LEAST_EFFECTIVE = 5.0
"""Parameters of inertia that the rows have to tell, all bodies together, for inertias to be fitted."""

CHANGED = 0.2
"""Change of kinetic energy that is worth a warning."""

STEPS = "friction", "rotors", "inertias"
"""What can be identified beside payloads, in the order that it is tried in."""


class Prepared(NamedTuple):
    """A recording, ready to be fitted."""

    recording: Recording
    segments: list
    delay: float
    """Of velocities, that was taken out; 0 if it is less than a sample [s]."""
    findings: list


class Attempt:
    """One identification, from rows to an outcome.

    Parameters
    ----------
    model : RobotModel
    steps : list of str
        Some of :data:`STEPS`, in their order.
    payload : Payload or None
    loaded, unloaded : list of Prepared
        Recordings with the payload, if there is one; and without it.
    """

    def __init__(self, model, steps, payload, loaded, unloaded):
        self._model, self._payload, self._loaded, self._unloaded = model, payload, loaded, unloaded
        self._findings = [finding for one in (*loaded, *unloaded) for finding in one.findings]
        self._warnings = []
        everything = [segment for one in (*loaded, *unloaded) for segment in one.segments]
        self._weight = WEIGHT if duration(everything) >= SHORT else SHORT_WEIGHT
        self._steps = steps
        self._moving = np.zeros(model.nv, dtype=bool)
        if steps:
            self._moving = excited(everything, model, self._findings)
            if not self._moving.any() and not self._payload:
                raise InputError(f"no joint moves enough: {self._findings[-1].text}.")
        self._split()
        self._layout, self._fitted_rows, self._held_rows, self._all_rows = self._rows()

    def _split(self):
        """Where the part held out begins: of the last recording, a third of all time, or the whole of it if that is less."""
        last = self._loaded[-1].segments
        total = sum(duration(one.segments) for one in self._loaded)
        held = min(HELD_OUT * total, duration(last) if len(self._loaded) > 1 else total)
        remaining = held
        for segment in reversed(last):
            length = segment.t[-1] - segment.t[0]
            if length >= remaining:
                self._begin = float(segment.t[-1] - remaining)
                break
            remaining -= length
        else:
            self._begin = float(last[0].t[0])
        self._held = [part for segment in last if len((part := segment.part(segment.t >= self._begin)).t) > 1]

    def _rows(self):
        """The layout; rows that are fitted first, that are held out, and all."""
        carrier = [self._payload.body] if self._payload else []
        equations = Equations(self._model, RATE, self._model.friction_velocity, carrier)
        layout = Layout(self._model, equations, self._payload)
        for one in self._loaded[:-1]:
            for segment in one.segments:
                equations.take(segment)
        anew = True
        last = self._loaded[-1].segments
        for segment in last:
            early = segment.part(segment.t < self._begin)
            if len(early.t):
                equations.take(early)
                anew = len(early.t) == len(segment.t)
        before = equations.sums()
        for segment in last:
            late = segment.part(segment.t >= self._begin)
            if len(late.t):
                equations.take(late, anew)
                anew = True
        whole = equations.sums()
        carries = self._payload is not None
        fitted_rows, held, all_rows = [Rows(before, carries)], [Rows(whole - before, carries)], [Rows(whole, carries)]
        if self._unloaded:
            alone = Equations(self._model, RATE, self._model.friction_velocity, carrier)
            for one in self._unloaded:
                for segment in one.segments:
                    alone.take(segment)
            beside = Rows(alone.sums(), False)
            fitted_rows, all_rows = [*fitted_rows, beside], [*all_rows, beside]
        return layout, fitted_rows, held, all_rows

    def _free(self, steps):
        nobody = np.zeros(self._model.nv, dtype=bool)
        return Free(
            self._moving if "friction" in steps else nobody,
            self._moving if "rotors" in steps else nobody,
            "inertias" in steps or bool(self._unloaded),
            self._payload,
        )

    def ladder(self):
        """Steps that are taken, the fit of them to the first part, and what was tried."""
        layout = self._layout
        taken: list[str] = []
        fit = fitted(layout, self._fitted_rows, self._free(taken), self._weight) if self._payload else None
        score = self._score(layout.known if fit is None else fit.x)
        rungs = [{"steps": self._named([]), "score": score, "taken": True}]
        left = [step for step in self._steps if step == "inertias" or self._moving.any()]
        refused: dict[str, str] = {}
        ahead = list(left)
        while ahead:
            step = ahead.pop(0)
            steps = [one for one in STEPS if one in taken or one == step]
            found = fitted(layout, self._fitted_rows, self._free(steps), self._weight)
            told = self._effective(found).sum() if step == "inertias" else LEAST_EFFECTIVE
            reached = self._score(found.x)
            better = bool(reached <= (1.0 - GAIN) * score and told >= LEAST_EFFECTIVE)
            rungs.append({"steps": self._named(steps), "score": reached, "taken": better})
            if better:
                taken, score, fit = steps, reached, found
                left.remove(step)
                refused.pop(step, None)
                ahead = list(left)  # what a larger error has hidden may pay now that it is gone
            else:
                refused[step] = _refusal(step, told, 1.0 - reached / score if score > 0.0 else 0.0)
        self._warnings += refused.values()
        return taken, fit, rungs

    def payload_mass(self, fit):
        """Mass of the payload by a fit [kg]."""
        return float(result.payload_in_link(self._layout, fit.x, self._payload)[0])

    def _named(self, steps):
        return ([f"payload:{self._payload.link}"] if self._payload else []) + list(steps)

    def _score(self, x):
        """Geometric mean over joints of the residual of rows held out."""
        squares = self._layout.mean_squares(self._held_rows, x)
        efforts = sum(sums.effort / np.maximum(sums.weight, 1e-300) for sums, _ in self._held_rows)
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
        last = early if nothing else fitted(layout, self._all_rows, free, self._weight)
        x = layout.known if nothing else early.x
        before = judged(self._model, result.friction_of(layout, layout.known, velocity), self._held)
        after = before
        if not nothing:
            model = result.model_of(layout, x, carries)
            after = judged(model, result.friction_of(layout, x, velocity), self._held)
        quality = self._quality(taken, rungs, before, after, x)
        if last is not None:
            self._tell(last, free, quality)
        self._warn(quality, before, after)
        free = free._replace(inertias="inertias" in taken)
        origin = self._origin(taken, quality)
        parameters = Parameters(origin=origin)
        if last is not None:
            parameters = result.parameters_of(layout, last, free, velocity, origin)
        return Identification(self._model.with_parameters(parameters), parameters, quality)

    def _quality(self, taken, rungs, before, after, x):
        names, layout = self._model.dof_names, self._layout
        rows = [np.sqrt(layout.mean_squares(self._held_rows, y)) for y in (layout.known, x)]
        last = self._loaded[-1]
        first = float(last.recording.t[0]) + int(last.segments[0].stamp[0] - last.recording.stamp[0]) * 1e-9
        first -= float(last.segments[0].t[0])
        return {
            "held_out": [first + self._begin, first + float(last.segments[-1].t[-1])],
            "torque_rms": _pairs(names, before.torque, after.torque),
            "explained": [before.explained, after.explained],
            "explained_total": [before.explained_total, after.explained_total],
            "row_residual": _pairs(names, *rows),
            "observer_spread": _pairs(names, before.spread, after.spread),
            "kinetic_energy": [before.kinetic, after.kinetic],
            "taken": self._named(taken),
            "ladder": rungs,
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
            names = [model.link_names[model.bodies["link"][body]] for body in self._layout.bodies]
            told = self._effective(fit)
            quality["effective_parameters"] = {name: float(one) for name, one in zip(names, told, strict=True)}
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
        shares = quality["explained"]
        if None not in shares and shares[1] < shares[0]:
            self._warnings.append(f"the efforts explain less of dK/dt than before: {shares[1]:.2f} of {shares[0]:.2f}")

    def _origin(self, taken, quality) -> Mapping[str, Any]:
        return {
            "recordings": [
                {
                    "path": one.recording.path,
                    "robot": one.recording.model.name,
                    "states": len(one.recording),
                    "start": float(one.recording.t[0]),
                    "end": float(one.recording.t[-1]),
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


def _pairs(names, before, after):
    """[before, after] by name; None for what is not known."""
    return {
        name: [None if np.isnan(one) else float(one) for one in pair]
        for name, *pair in zip(names, before, after, strict=True)
    }
