# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of efforts: not measured, gravity's direction, exchanged joints, a unit, a sign, no gravity."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.recordings.balance import MAX_GAP
from diag_dynamics.recordings.effort_relation import (
    COLUMNS,
    DAMPING,
    ERRORS,
    FRICTION,
    INERTIAL,
    MODEL_ERROR,
    OFFSET,
    ROTOR,
    SINGULAR,
    EffortRelation,
    Relation,
    Run,
    remaining,
)
from diag_dynamics.recordings.states import States
from diag_dynamics.recordings.windows import column_maxima

ZERO, CONSTANT, TRAVEL = 1e-12, 1e-9, 0.01
"""Effort up to which it is 0 [N m, N], range of a constant one over its largest value, travel that needs torque [rad, m]."""

MAX_STATES, MOVING, MIN_RUN = 20_000, 0.01, 20
"""First states in motion that are compared, velocity of any joint in motion [rad/s, m/s], fewest states of a run."""

MIN_EXPLAINED, MAX_NOISE, MAX_LEFT, ALIKE = 0.8, 0.75, 0.4, 2.0
"""Fractions of the efforts' squares: least that a fault explains, most that it leaves where noise hides the rest, most that
it leaves of what the model leaves; and ratio of what two equally good faults leave."""

TURNED, WEIGHTLESS, FULL = np.radians(15.0), 0.3, (0.7, 1.4)
"""Angle of gravity from the model's that is a fault [rad], and sizes over the model's: of none, and of all of it."""

OTHER_SIGN, UNIT = (-1.6, -0.4), 1.6  # factors of an effort of the other sign, and from which it has another unit
OF_ALL = "sign", "unit", "weightless"  # faults that all joints have
LIGHT, VERY_LIGHT, LARGE = 0.5, 0.2, 0.02
"""Torque of a joint over that of a joint with a right effort, below which a small factor, or a large one and one of the
other sign, may be the model's fault; and square over the largest from which joints are found exchanged."""

MAX_WEIGHTLESS = 0.35  # largest factor of any joint without gravity
EXCHANGE, DISSIPATION = 4.0, 0.02
"""Factor by which an exchange reduces the square that is left, and least power of friction over that of efforts."""

UNITS = {
    1e3: "mN m, mA or per mille",
    1e2: "N cm or %",
    10.2: "kgf cm",
    1.0 / 9.81: "kgf m",
    1e-3: "kN m",
    141.6: "ozf in",
    8.85: "lbf in",
}
"""Names of units by their factors to N m."""

UNIT_ERROR = 1.15  # factor up to which one is that of a unit
CEILING = "gravity points the other way"
OTHER_SIGN_OF_ALL = "efforts of all joints seem to have the other sign (effort_scale: '*=-1')"


class EffortRange:
    """Find efforts that no sensor has measured: 0, constant or missing throughout; `states` is their number."""

    def __init__(self, names):
        self._names, self.states = np.array(names, dtype=object), 0
        self._low, self._high = np.full((2, 2, len(names)), [[[np.inf]], [[-np.inf]]])

    def add_values(self, positions, efforts):
        """Add positions and efforts, (T, n) each; NaN for efforts that are missing."""
        self.states += len(efforts)
        for row, values in enumerate((efforts, positions)):
            self._low[row] = np.minimum(self._low[row], -column_maxima(-values))
            self._high[row] = np.maximum(self._high[row], column_maxima(values))

    @property
    def moved(self):
        """Whether any joint has moved."""
        return bool(np.any(self._high[1] - self._low[1] > TRAVEL))

    @property
    def measures(self):
        """Whether the effort of any joint can have been measured."""
        return self.states < 2 or not np.all(np.any(self._faults(), axis=0))

    def unmeasured(self):
        """Return which efforts cannot have been measured, in words; or an empty text."""
        low = self._low[0]
        if self.states < 2 or not np.isfinite(low).any():
            return ""
        missing, zero, constant = self._faults()
        groups = [(missing, "missing"), (zero, "0")]
        groups += [(constant & (low == one), f"{one:.6g}") for one in np.unique(low[constant])]
        return "; ".join(
            f"efforts of {', '.join(self._names[which])} are {value} throughout (effort_available)"
            for which, value in groups
            if which.any()
        )

    def _faults(self):
        """Return which efforts are missing, 0 and constant throughout, bool, shape (n,) each."""
        (low, lowest), (high, highest) = self._low, self._high
        largest = np.maximum(np.abs(low), np.abs(high))
        zero = largest < ZERO
        with np.errstate(invalid="ignore"):
            return ~np.isfinite(low), zero, (highest - lowest > TRAVEL) & ~zero & (high - low <= CONSTANT * largest)


class MotionSample:
    """Keep the first states with efforts in motion of a model, and judge their efforts."""

    def __init__(self, model):
        self._model, self._parts = model, [States.empty(model.nq, model.nv)]
        self._room = 0 if model.floating_base or model.nq != model.nv or not model.nv else MAX_STATES

    def add_states(self, states):
        """Add states."""
        if self._room:
            moving = states.effort_known & (np.abs(states.velocity) > MOVING).any(axis=1)
            rows = np.flatnonzero(moving & np.isfinite(states.effort).all(axis=1))[: self._room]
            self._parts.append(states[rows])
            self._room -= len(rows)

    def fault(self):
        """Return the :class:`Fault` of efforts; None if nothing is wrong, or nothing can be said."""
        compared = EffortRelation(self._model)
        for run in self._runs():
            compared.add_run(run)
        return find_fault(compared, compared.fit())

    def _runs(self):
        """Yield runs of states without gaps."""
        states = States.concatenate(self._parts)
        steps = np.diff(states.stamp)
        bounds = np.flatnonzero((steps < 0) | (steps > MAX_GAP * SECOND) | states.jumped[1:]) + 1
        kept = np.append(True, steps > 0)
        kept[bounds] = True
        for rows in np.split(np.arange(len(states)), bounds):
            run = states[rows[kept[rows]]]
            if len(run) >= MIN_RUN:
                yield Run((run.stamp - run.stamp[0]) / SECOND, run.position, run.velocity, run.effort)


class Fault(NamedTuple):
    """What would explain the efforts, in words, and the fraction of their squares that it leaves."""

    kind: str  # sign, unit, weightless, gravity or order; joint, of single joints; light, of light joints alone
    text: str
    left: float = 1.0
    noise: float = 0.0  # what factors of gravity's and inertia's torques leave, too: noise, and what the model lacks


def find_fault(compared: EffortRelation, relation: Relation, tolerant: bool = False) -> Fault | None:
    """Return the fault of efforts, tolerant of a payload; None if nothing is wrong.

    It is that of all joints, if one explains their efforts; else that of gravity, of heavy joints, or of light ones.
    """
    common, wrong = _common_fault(compared), relation.wrong(tolerant)
    right = relation.judged() & ~wrong
    if common and common.kind in OF_ALL and np.any(relation.torque[right] >= LIGHT * relation.torque.max()):
        common = None  # where the effort of a heavy joint is right, it is not wrong in all
    if common:
        return common
    words = _Words(compared.model.dof_names, relation, tolerant)
    weightless = words.weightless() if wrong.any() else ""
    if weightless:
        return Fault("weightless", weightless)
    heavy = np.flatnonzero(wrong & ~_light(compared, relation, tolerant))
    if len(heavy):
        return Fault("joint", words.describe(heavy))
    doubtful = wrong if tolerant else wrong | relation.doubtful()
    if not doubtful.any():
        return None
    turned = doubtful & words.turned
    groups = [np.flatnonzero(turned)] if turned.any() else []
    groups += [np.array([k]) for k in np.flatnonzero(doubtful & ~turned)]
    texts = "; ".join(map(words.describe, groups))
    return Fault("light", f"{texts}; or the model misses what a light joint carries")


def _light(compared, relation, tolerant):
    """Return which joints have much less torque than one with a right effort, bool."""
    right = relation.judged() & ~relation.wrong(tolerant)
    largest = _of_kind(compared, np.where(right, relation.torque, 0.0))
    small = (relation.factor > OTHER_SIGN[1]) & (relation.factor < relation.limits(tolerant)[0])
    return relation.torque < np.where(small | relation.unrelated(), LIGHT, VERY_LIGHT) * largest


def _of_kind(compared, values):
    """Return for each joint the largest value of a joint of its kind, rotary or prismatic."""
    return np.array([values[compared.slides == one].max(initial=0.0) for one in compared.slides])


class _Squares:
    """Squares of each joint's torque columns and all efforts, without what the joint's other columns explain."""

    def __init__(self, compared, rotors=True):
        model, columns = compared.model, np.eye(COLUMNS + compared.model.nv)
        kept = [*range(INERTIAL + 1), *range(COLUMNS, len(columns))]
        self.products = remaining(
            compared.products, columns[kept], columns[[DAMPING, FRICTION, OFFSET, ROTOR][: 3 + rotors]]
        )
        self.needed, self.joints = np.append(model.gravity, 1.0), np.arange(model.nv)
        self.inner, self.across = self.products[:, :4, :4], self.products[:, :4, 4:]
        self.efforts = np.diagonal(self.products[:, 4:, 4:], axis1=1, axis2=2)
        whole = compared.products[:, :4, :4] @ self.needed @ self.needed
        torque = self.inner @ self.needed @ self.needed
        self.torque = np.where(torque > SINGULAR * whole, torque, 0.0)  # the rest is rounding
        largest = _of_kind(compared, self.torque)
        self.tiny = np.maximum(MODEL_ERROR**2 * largest, 1e-300)
        self.weight = 1.0 / (self.torque + self.tiny)
        self.large = self.torque > LARGE * np.maximum(largest, 1e-300)

    def left(self, needed, factor=1.0):
        """Return squares of efforts (columns) less a factor times the torque of joints (rows)."""
        torque = (self.inner @ needed @ needed)[:, None]
        return np.maximum(self.efforts - 2.0 * factor * (needed @ self.across) + factor**2 * torque, 0.0)

    def share(self, left, order=None):
        """Return the fraction of the efforts' squares that is left, all joints weighted by the model's torque."""
        pairs = self.joints, self.joints if order is None else order
        whole = self.weight @ self.efforts[pairs]
        return float(self.weight @ left[pairs] / whole) if whole > 0.0 else 1.0

    def fault(self, kind, text, needed, factor=1.0, order=None):
        """Return the :class:`Fault` of efforts that are these torques times a factor, in this order."""
        columns = np.eye(len(self.products[0]))
        noise = remaining(self.products, columns[4:], columns[:4])  # what no factors of gravity and inertia explain
        noise = np.maximum(np.diagonal(noise, axis1=1, axis2=2), 0.0)
        return Fault(kind, text, self.share(self.left(needed, factor), order), self.share(noise, order))

    def gravity(self):
        """Return the gravity that explains the efforts best, and that of the model, where the efforts show it."""
        A = np.einsum("k,kij->ij", self.weight, self.inner[:, :3, :3])
        b = self.weight @ (self.across[self.joints, :3, self.joints] - self.inner[:, :3, INERTIAL])
        values, vectors = np.linalg.eigh(A)
        shown = vectors[:, values > 1e-6 * max(values[-1], 1e-300)]
        found = shown @ np.linalg.solve(shown.T @ A @ shown, shown.T @ b)
        return found, shown @ (shown.T @ self.needed[:3])

    def factor(self):
        """Return the factor of all joints together that explains the efforts best."""
        across = self.weight @ (self.across[self.joints, :, self.joints] @ self.needed)
        return float(across / max(self.weight @ self.torque, 1e-300))

    def order(self):
        """Return the order of efforts that explains them best: exchanges of two joints while these help."""
        cost = np.log((self.left(self.needed) + self.tiny[:, None]) * self.weight[:, None])
        order = list(self.joints)

        def gain(pair):
            a, b = pair
            return cost[a, order[a]] + cost[b, order[b]] - cost[a, order[b]] - cost[b, order[a]]

        pairs = [pair for pair in combinations(self.joints, 2) if self.large[list(pair)].any()]
        while pairs and gain(best := max(pairs, key=gain)) > np.log(EXCHANGE):
            a, b = best
            order[a], order[b] = order[b], order[a]
        return order


def _common_fault(compared):
    """Return the fault that explains the efforts of all joints together; None if none does."""
    squares = _Squares(compared)
    plain = squares.share(squares.left(squares.needed))
    if not squares.torque.any() or plain <= 1.0 - MIN_EXPLAINED:
        return None
    faults = filter(None, (_factor(squares), _gravity(compared, squares), _order(squares, compared.model.dof_names)))
    faults = [
        one for one in faults if one.left <= min(MAX_LEFT * plain, max(1.0 - MIN_EXPLAINED, min(MAX_NOISE, one.noise)))
    ]
    floor = MODEL_ERROR**2  # what a model misses makes no fault better than another one
    best = ALIKE * (min((one.left for one in faults), default=0.0) + floor)
    return next((_told_apart(compared, one) for one in faults if one.left + floor <= best), None)


def _factor(squares):
    """Return a factor of all efforts as a fault."""
    factor = squares.factor()
    if factor == 0.0 or 1.0 / UNIT < factor < UNIT:
        return None
    if 1.0 / UNIT < -factor < UNIT:
        return squares.fault("sign", OTHER_SIGN_OF_ALL, squares.needed, factor)
    names = (name for one, name in UNITS.items() if 1.0 / UNIT_ERROR < abs(factor) / one < UNIT_ERROR)
    unit = next((f", as of {name}" for name in names), "")
    text = (
        f"efforts of all joints seem to have another unit{' and the other sign' if factor < 0.0 else ''}: they are "
        f"{factor:.3g} times what the model needs{unit} (effort_scale: '*={1.0 / factor:.3g}')"
    )
    return squares.fault("unit", text, squares.needed, factor)


def _gravity(compared, squares):
    """Return gravity's direction, or its absence, as a fault."""
    found, known = squares.gravity()
    size, length, full = np.linalg.norm(known), np.linalg.norm(found), np.linalg.norm(compared.model.gravity)
    if size == 0.0:
        return None
    if length / size < WEIGHTLESS:  # then efforts are what inertia needs, as far as the motion shows that
        text = "gravity seems not to be in the efforts (effort_includes_gravity: '*=false')"
        return _Squares(compared, rotors=False).fault("weightless", text, np.array([0.0, 0.0, 0.0, 1.0]))
    angle = np.arccos(np.clip(found @ known / (length * size), -1.0, 1.0))
    if angle < TURNED or not FULL[0] < length / full < FULL[1]:
        return None
    where = "on a ceiling" if angle > np.radians(150.0) else "on a wall" if angle > np.radians(60.0) else "on a slope"
    text = (
        f"gravity seems to point along [{', '.join(f'{x:.3g}' for x in np.round(found, 1) + 0.0)}] m/s² in the base, "
        f"{np.degrees(angle):.0f}° from the model's, as of a robot {where} (parameter gravity)"
    )
    return squares.fault("gravity", text, np.append(found, 1.0))


def _order(squares, names):
    """Return an order of the efforts as a fault."""
    order = squares.order()
    moved = [k for k, j in enumerate(order) if k != j]
    if not moved:
        return None
    joints, columns = (", ".join(names[k] for k in which) for which in (moved, [order[k] for k in moved]))
    text = f"efforts seem to be in another order: those of {joints} are in the columns of {columns}"
    if len(moved) == 2:
        text = f"efforts of {names[moved[0]]} and {names[moved[1]]} seem to be exchanged"
    return squares.fault("order", f"{text} (order of the joints)", squares.needed, order=order)


def _told_apart(compared, fault):
    """Return the fault; inertia and friction tell efforts of the other sign from gravity the other way round."""
    squares = _Squares(compared, rotors=False)
    found, known = squares.gravity()
    opposite = known.any() and found @ known <= -0.8 * np.linalg.norm(found) * np.linalg.norm(known)
    if fault.kind not in ("sign", "gravity") or not opposite:
        return fault
    needed = np.append(-compared.model.gravity, 1.0), -squares.needed
    ceiling, sign = (squares.share(squares.left(one)) + 1e-12 for one in needed)
    power = _friction_power(compared, needed[0])
    if sign < ceiling / ALIKE or power < 0.0:
        return Fault("sign", OTHER_SIGN_OF_ALL)
    turned = _gravity(compared, squares)
    if turned and (ceiling < sign / ALIKE or power > 0.0):
        return turned
    return Fault("sign", f"{OTHER_SIGN_OF_ALL}, or {CEILING}, as of a robot on a ceiling (parameter gravity)")


def _friction_power(compared, needed):
    """Return the sign of the power of friction if the torque is this one; 0 if there is hardly any friction."""
    rest, power, scale = [DAMPING, FRICTION, OFFSET], 0.0, 0.0
    for k, products in enumerate(compared.products):
        right = products[rest, COLUMNS + k] - products[np.ix_(rest, range(4))] @ needed
        x = np.linalg.lstsq(products[np.ix_(rest, rest)], right, rcond=SINGULAR)[0]
        power += x[:2] @ products[[DAMPING, FRICTION], DAMPING]
        scale += np.sqrt(products[COLUMNS + k, COLUMNS + k] * products[DAMPING, DAMPING])
    return 0.0 if abs(power) < DISSIPATION * scale else float(np.sign(power))


class _Words:
    """Texts on the efforts of single joints."""

    def __init__(self, names, relation, tolerant):
        self._names, self._of, self._tolerant = names, relation, tolerant
        factor = relation.factor  # of the other sign and of the right size:
        self.turned = (factor >= OTHER_SIGN[0]) & (factor <= OTHER_SIGN[1]) & ~relation.unrelated()

    def describe(self, joints):
        """Return what is wrong with the efforts of joints."""
        if self.turned[joints].any():
            return self._describe_turned(joints[self.turned[joints]])
        of = self._of
        k = joints[int(np.argmax(of.torque[joints]))]
        (low, high), factor, error = of.limits(self._tolerant), of.factor[k], ERRORS * of.error[k]
        begin = f"the effort of joint '{self._names[k]}'"
        text = f"{factor:.3g} ± {error:.2g} times what the model needs, expected {low[k]:g} to {high[k]:g}"
        if of.unrelated()[k] or abs(factor) <= min(WEIGHTLESS * low[k], error):
            return (
                f"{begin} has no relation to the motion: it changes by {text}. Check that it is a torque or a current of "
                "this joint"
            )
        return (
            f"{begin} changes by {text}: is it in N m or N, on the joint's side of the gear, and are the joints in order "
            "(effort_scale, docs/recordings.md)"
        )

    def _describe_turned(self, turned):
        heavy = self._of.heavy & self._of.judged()
        ceiling = ""
        if heavy.any() and heavy[turned].sum() == heavy.sum():
            ceiling = f", or {CEILING} (parameter gravity)"
        factors = ", ".join(f"{one:.2f}" for one in self._of.factor[turned])
        quoted = ", ".join(f"'{self._names[k]}'" for k in turned)
        if len(turned) > 1:
            begin, scale = f"efforts of joints {quoted} are of the other sign: they change", ""
        else:
            begin = f"the effort of joint {quoted} is of the other sign: it changes"
            scale = f" (effort_scale: '{self._names[turned[0]]}=-1')"
        return f"{begin} by {factors} times what the model needs{scale}{ceiling}"

    def weightless(self):
        """Return that no effort contains gravity, or that efforts have no relation to the motion; or an empty text."""
        of = self._of
        heavy = np.flatnonzero(of.heavy & (of.judged() | of.wrong(self._tolerant)))
        if not len(heavy) or np.any(np.abs(of.factor[heavy]) >= MAX_WEIGHTLESS):
            return ""
        k = heavy[int(np.argmax(of.torque[heavy]))]
        if of.torque[k] < LIGHT * of.torque.max():  # nothing is known of the heaviest joint
            return ""
        text = (
            f"gravity is not in the efforts: that of joint '{self._names[k]}' changes by {of.factor[k]:.2f} times what "
            "the model needs. If the driver has taken gravity out, read the recording with "
            "parameters={'effort_includes_gravity': ['*=false']}"
        )
        known = ERRORS * of.inertial_error < 1.0
        if not known.any():
            return f"{text}. If not, the efforts have no relation to the motion"
        return text if np.median(of.inertial[known]) > 0.5 else ""
