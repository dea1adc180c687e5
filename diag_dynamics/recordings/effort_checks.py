# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of efforts: not measured, gravity's direction, exchanged joints, a unit, a sign, no gravity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.optional import require
from diag_dynamics.recordings.balance import MAX_GAP
from diag_dynamics.recordings.effort_relation import (
    ERRORS,
    INERTIAL,
    MODEL_ERROR,
    EffortRelation,
    Relation,
    largest_of_kind,
)
from diag_dynamics.recordings.states import States
from diag_dynamics.recordings.windows import column_maxima

ZERO, CONSTANT, TRAVEL, MIN_STATES = 1e-12, 1e-9, 0.01, 1000
"""Effort up to which it is 0 [N m, N], range of a constant one over its largest value, travel that needs torque [rad, m],
and fewest states after which a constant effort is unknown."""

PUSHED = 0.05  # travel of a robot that stands and is pushed [rad, m]

MAX_STATES, MOVING, MIN_RUN = 20_000, 0.01, 20
"""First states in motion that are compared, velocity of any joint in motion [rad/s, m/s], fewest states of a run."""

MIN_BY_FAULT, MAX_LEFT, ALIKE = 0.8, 0.4, 2.0
"""Least fraction of the efforts' squares that a fault of all joints explains, most that it leaves of the squares that the
model leaves, and ratio of what two equally good faults leave."""

TURNED, FULL = (
    15.0,
    (0.7, 1.4),
)  # angle of gravity [°], and its size over the model's, of a robot on a wall
OTHER_SIGN, UNIT = (
    (-1.6, -0.4),
    1.6,
)  # factors of an effort of the other sign, and from which it has another unit
LIGHT, VERY_LIGHT = 0.5, 0.2
"""Torque of a joint over that of a joint with a right effort, below which a small factor, or a large one and one of the
other sign, may be the model's fault."""

WEIGHTLESS = 0.35  # largest factor of any joint without gravity
EXCHANGE = 4.0  # factor by which an exchange of two joints reduces the square that is left

UNITS = {
    1e3: "mN m, mA or ‰",
    1e2: "N cm or %",
    10.2: "kgf cm",
    0.102: "kgf m",
    8.85: "lbf in",
    141.6: "ozf in",
}
"""Names of units by their factors to N m."""

UNIT_ERROR = 1.15  # factor up to which one is that of a unit
SIGN = "efforts of all joints seem to have the opposite sign (effort_scale: '*=-1')"
CEILING = ", or gravity points the other way, as for a robot on a ceiling (parameter gravity)"


class EffortRange:
    """Find efforts that no sensor has measured: 0, constant or missing throughout; `states` is their number."""

    def __init__(self, names):
        self._names, self.states = names, 0
        self._low, self._high = np.full((2, 2, len(names)), [[[np.inf]], [[-np.inf]]])

    def add_values(self, positions, efforts):
        """Add positions and efforts, (T, n) each; NaN for efforts that are missing."""
        self.states += len(efforts)
        for row, values in enumerate((efforts, positions)):
            self._low[row] = np.minimum(self._low[row], -column_maxima(-values))
            self._high[row] = np.maximum(self._high[row], column_maxima(values))

    @property
    def moved(self):
        """Whether any joint has moved farther than a push moves a robot that stands."""
        return bool(np.any(self._high[1] - self._low[1] > PUSHED))

    @property
    def measures(self):
        """Whether the effort of any joint can have been measured."""
        return len(self.values()) < len(self._names)

    def hide_constant(self, states):
        """Add States; return them without efforts of joints that have moved while their efforts were constant."""
        self.add_values(states.position[:, -len(self._names) :], states.effort)
        constant = self._constant()
        is_clear = self.states >= MIN_STATES and constant.any() and self.measures
        return states.without_efforts(constant) if is_clear else states

    def groups(self, missing="missing"):
        """Return joints whose efforts cannot have been measured, by the word for these; `missing` is that of unknown ones."""
        values = self.values()
        several = len(set(values.values()) - {"0", "missing"}) > 1
        words = {"0": "0", "missing": missing}
        words = {
            name: words.get(text, "constant" if several else text) for name, text in values.items()
        }
        return {word: [name for name in words if words[name] == word] for word in words.values()}

    def unmeasured(self, missing="missing"):
        """Return which efforts cannot have been measured, in words; or an empty text."""
        groups = self.groups(missing)
        if len(groups.get(missing, ())) == len(self._names):
            return ""
        return "; ".join(
            f"efforts of {', '.join(names)} are {word} throughout (effort_available)"
            for word, names in groups.items()
        )

    def values(self):
        """Return the values of efforts that cannot have been measured as texts, by joint."""
        low, largest = self._low[0], np.maximum(np.abs(self._low[0]), np.abs(self._high[0]))
        texts = np.where(self._constant(), [f"{value:.6g}" for value in low], "")
        texts = np.where(np.isfinite(low), np.where(largest < ZERO, "0", texts), "missing").tolist()
        return {
            name: text
            for name, text in zip(self._names, texts, strict=True)
            if text and self.states > 1
        }

    def _constant(self):
        """Return which joints have moved while their efforts were constant or missing, bool (n,)."""
        (low, lowest), (high, highest) = self._low, self._high
        with np.errstate(invalid="ignore"):
            return (highest - lowest > TRAVEL) & (
                high - low <= CONSTANT * np.maximum(np.abs(low), np.abs(high))
            )


class MotionSample:
    """Keep the first states with efforts in motion of a model, and judge their efforts."""

    def __init__(self, model):
        self._model, self._parts = model, [States.empty(model.nq, model.nv)]
        self._remaining = (
            0 if model.floating_base or model.nq != model.nv or not model.nv else MAX_STATES
        )

    def add_states(self, states):
        """Add states."""
        if self._remaining:
            moving = states.effort_known & (np.abs(states.velocity) > MOVING).any(axis=1)
            rows = np.flatnonzero(moving & np.isfinite(states.effort).all(axis=1))[
                : self._remaining
            ]
            self._parts.append(states[rows])
            self._remaining -= len(rows)

    def fault(self):
        """Return the :class:`Fault` of efforts; None if nothing is wrong, or nothing can be said."""
        compared, states = EffortRelation(self._model), States.concatenate(self._parts)
        steps = np.diff(states.stamp)
        bounds = np.flatnonzero((steps < 0) | (steps > MAX_GAP * SECOND) | states.jumped[1:]) + 1
        kept = np.append(True, steps > 0)
        kept[bounds] = True
        for rows in np.split(np.arange(len(states)), bounds):
            run = states[rows[kept[rows]]]
            if len(run) >= MIN_RUN:
                compared.add_run(
                    (run.stamp - run.stamp[0]) / SECOND, run.position, run.velocity, run.effort
                )
        return find_fault(compared.fit())


class Fault(NamedTuple):
    """What would explain the efforts, in words."""

    text: str
    light: bool = (
        False  # whether it is of light joints alone, of which the model may miss something
    )


def find_fault(relation: Relation, tolerant: bool = False) -> Fault | None:
    """Return the fault of efforts, tolerant of a payload; None if nothing is wrong."""
    torque, factor, wrong = relation.torque, relation.factor, relation.wrong(tolerant)
    right = relation.judged() & ~wrong
    heavy_right = np.any(
        torque[right] >= LIGHT * torque.max(initial=0.0)
    )  # then not all have another scale
    text = _explain_all(relation, not heavy_right) or _describe_weightless(relation, wrong)
    if text:
        return Fault(text)
    texts = np.array(
        [_describe_joint(relation, tolerant, k) for k in range(len(torque))], dtype=object
    )
    turned = (
        (factor >= OTHER_SIGN[0])
        & (factor <= OTHER_SIGN[1])
        & (np.abs(factor) > ERRORS * relation.error)
    )
    small = ~turned & (factor < relation.limits(tolerant)[0])
    largest = largest_of_kind(relation.model, np.where(right, torque, 0.0))
    heavy = wrong & (torque >= np.where(small, LIGHT, VERY_LIGHT) * largest)
    if heavy.any():
        which = (
            heavy & turned if np.any(heavy & turned) else heavy & (torque == torque[heavy].max())
        )
        weighty = relation.heavy & relation.judged()
        ceiling = weighty.any() and np.all((which & turned)[weighty])
        return Fault("; ".join(texts[which]) + (CEILING if ceiling else ""))
    doubtful = wrong if tolerant else wrong | relation.doubtful()
    text = f"{'; '.join(texts[doubtful])}; or the model lacks the load of a light joint"
    return Fault(text, light=True) if doubtful.any() else None


def _describe_joint(relation, tolerant, k):
    """Return what is wrong with the effort of a joint."""
    name, factor, error = (
        relation.model.dof_names[k],
        relation.factor[k],
        ERRORS * relation.error[k],
    )
    low, high = relation.limits(tolerant)[:, k]
    begin, text = (
        f"the effort of joint '{name}'",
        f"{factor:.3g} ± {error:.2g} times the model torque",
    )
    if abs(factor) <= error:
        return f"{begin} does not follow the motion: it is {text}. Check that it is measured at this joint"
    if OTHER_SIGN[0] <= factor <= OTHER_SIGN[1]:
        return f"{begin} has the opposite sign: it is {text} (effort_scale: '{name}=-1')"
    return (
        f"{begin} is {text}; expected {low:g} to {high:g}. Check unit (N m, N), side of the gear and order of the joints "
        "(effort_scale). For raw units of drives use diag-dynamics identify --what gains,friction"
    )


def _describe_weightless(relation, wrong):
    """Return that no effort contains gravity; an empty text if one does, or inertia is not in them."""
    heavy = np.flatnonzero(relation.heavy & (relation.judged() | wrong))
    if not wrong.any() or not len(heavy) or np.any(np.abs(relation.factor[heavy]) >= WEIGHTLESS):
        return ""
    known = ERRORS * relation.inertial_error < 1.0
    if known.any() and np.median(relation.inertial[known]) <= 0.5:
        return ""
    k = heavy[int(np.argmax(relation.torque[heavy]))]
    text = (
        "gravity seems to be missing in the efforts (effort_includes_gravity: '*=false'): that of joint "
        f"'{relation.model.dof_names[k]}' is {relation.factor[k]:.2f} times the model torque"
    )
    return text if known.any() else f"{text}, or efforts do not follow the motion"


def _explain_all(relation, scaled):
    """Return the fault that explains the efforts of all joints together, a factor of all if `scaled`; or an empty text."""
    explained = _Explanations(relation)
    plain = explained.share(explained.needed)
    if not explained.torque.any() or plain <= 1.0 - MIN_BY_FAULT:
        return ""
    limit, floor = (
        min(MAX_LEFT * plain, 1.0 - MIN_BY_FAULT),
        MODEL_ERROR**2,
    )  # a model's errors make no fault better
    faults = filter(
        None, (explained.scale() if scaled else None, explained.gravity(), explained.order())
    )
    faults = [(left + floor, text) for left, text in faults if left <= limit]
    best = ALIKE * min((left for left, _ in faults), default=0.0)
    texts = [text for left, text in faults if left <= best]
    return SIGN + CEILING if texts[:1] == [SIGN] and len(texts) > 1 else "".join(texts[:1])


class _Explanations:
    """Faults of all efforts together: the fraction of their squares that each leaves, and a text; or None."""

    def __init__(self, relation):
        self.needed, self._model, products = (
            np.append(relation.model.gravity, 1.0),
            relation.model,
            relation.products,
        )
        self.torque = np.where(relation.geared, 0.0, relation.torque**2)
        self._tiny = np.maximum(
            MODEL_ERROR**2 * largest_of_kind(relation.model, self.torque), 1e-300
        )
        self._weight, self._joints = 1.0 / (self.torque + self._tiny), np.arange(len(self.torque))
        self._inner, self._across = products[:, :4, :4], products[:, :4, 4:]
        self._own = self._across[self._joints, :, self._joints]
        self._efforts = np.diagonal(products[:, 4:, 4:], axis1=1, axis2=2)

    def _left(self, needed, factor=1.0):
        """Return squares of efforts (columns) less a factor times the torque of joints (rows)."""
        torque = (self._inner @ needed @ needed)[:, None]
        return np.maximum(
            self._efforts - 2.0 * factor * (needed @ self._across) + factor**2 * torque, 0.0
        )

    def share(self, needed, factor=1.0, order=None):
        """Return the fraction of the efforts' squares that is left."""
        pairs = self._joints, self._joints if order is None else order
        whole = self._weight @ self._efforts[pairs]
        return (
            float(self._weight @ self._left(needed, factor)[pairs] / whole) if whole > 0.0 else 1.0
        )

    def scale(self):
        """Explain the efforts by one factor of all of them."""
        factor = float(
            self._weight @ self._own @ self.needed / max(self._weight @ self.torque, 1e-300)
        )
        if factor == 0.0 or 1.0 / UNIT < factor < UNIT:
            return None
        left, sign = (
            self.share(self.needed, factor),
            " and the opposite sign" if factor < 0.0 else "",
        )
        names = (
            name for one, name in UNITS.items() if 1.0 / UNIT_ERROR < abs(factor) / one < UNIT_ERROR
        )
        unit = next((f", as in {name}" for name in names), "")
        if 1.0 / UNIT < -factor < UNIT:
            return left, SIGN
        return left, (
            f"efforts of all joints seem to have another unit{sign}: they are {factor:.3g} times the model torque{unit} "
            f"(effort_scale: '*={1.0 / factor:.3g}', or by joint from diag-dynamics identify --what gains,friction)"
        )

    def gravity(self):
        """Explain the efforts by another direction of gravity, the best one."""
        A = np.einsum("k,kij->ij", self._weight, self._inner[:, :3, :3])
        inverse = np.linalg.pinv(A, rcond=1e-6, hermitian=True)
        found = inverse @ (self._weight @ (self._own[:, :3] - self._inner[:, :3, INERTIAL]))
        known, size = (
            inverse @ A @ self._model.gravity,
            np.linalg.norm(found),
        )  # where the efforts show it
        if not known.any() or not FULL[0] < size / np.linalg.norm(self._model.gravity) < FULL[1]:
            return None
        angle = np.degrees(
            np.arccos(np.clip(found @ known / (size * np.linalg.norm(known)), -1.0, 1.0))
        )
        if angle < TURNED:
            return None
        where = "on a ceiling" if angle > 150.0 else "on a wall" if angle > 60.0 else "on a slope"
        return self.share(np.append(found, 1.0)), (
            f"gravity seems to point along [{', '.join(f'{x:.3g}' for x in np.round(found, 1) + 0.0)}] m/s² in the base, "
            f"{angle:.0f}° from the model's, as for a robot {where} (parameter gravity)"
        )

    def order(self):
        """Explain the efforts by another order; an exchange of two joints has to reduce the rest by EXCHANGE."""
        cost = np.log((self._left(self.needed) + self._tiny[:, None]) * self._weight[:, None])
        cost[~np.eye(len(cost), dtype=bool)] += 0.5 * np.log(EXCHANGE)
        order = require("scipy.optimize", "the judgement of efforts").linear_sum_assignment(cost)[1]
        moved = np.flatnonzero(order != self._joints)
        if not len(moved):
            return None
        joints, columns = (
            [self._model.dof_names[k] for k in which] for which in (moved, order[moved])
        )
        text = f"efforts of {' and '.join(joints)} seem to be exchanged"
        if len(moved) > 2:
            joints, columns = ", ".join(joints), ", ".join(columns)
            text = f"efforts seem to be in another order: those of {joints} are in the columns of {columns}"
        return self.share(self.needed, order=order), f"{text} (order of the joints)"
