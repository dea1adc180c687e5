# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Causes of efforts that the model does not explain: gravity's direction, exchanged joints, a unit, a sign, no gravity."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from diag_dynamics.recordings.effort_relation import (
    COLUMNS,
    DAMPING,
    ERRORS,
    FRICTION,
    GRAVITY_X,
    INERTIAL,
    MODEL_ERROR,
    OFFSET,
    ROTOR,
    SINGULAR,
    EffortRelation,
    Relation,
)

EXPLAINED, NOISY, NEARLY = 0.8, 0.75, 1.3
"""Least share of the efforts' squares that a cause explains. Where noise hides the rest, largest part that it leaves, and
how many times what factors of the torques leave that may be."""

GAIN, LESS = 0.1, 0.4
"""Part of the efforts' squares that a cause explains beyond the model at least, and part that it leaves of what the model
leaves and factors of the torques explain."""

ALIKE = 2.0
"""Ratio of what two causes leave up to which they explain alike."""

TURNED = np.radians(15.0)
"""Angle from the model's gravity from which its direction is a cause [rad]."""

WEIGHTLESS, FULL = 0.3, (0.7, 1.4)
"""Ratio of gravity in the efforts to that of the model below which there is none, and within which it is all there."""

OTHER_SIGN = -1.6, -0.4
"""Factors of an effort of the other sign."""

OF_ALL = "sign", "unit", "weightless"
"""Causes that all joints have."""

LIGHT, VERY_LIGHT = 0.5, 0.2
"""Torque of a joint, in parts of that of a joint whose effort is right, below which a factor that is too small, and one that
is too large or of the other sign, may be the model's fault."""

MAX_WEIGHTLESS = 0.35
"""Largest factor of any joint where gravity is in no effort."""

SHARE = 0.02
"""Part of the largest torque's square that a joint's torque must have to be found exchanged."""

SWAPPED = 4.0
"""Factor by which an exchange makes the square of what is left smaller, of two joints together."""

UNITS = (
    (1e3, "mN m, mA or per mille"),
    (1e2, "N cm or %"),
    (10.2, "kgf cm"),
    (1.0 / 9.81, "kgf m"),
    (1e-3, "kN m"),
    (141.6, "ozf in"),
    (8.85, "lbf in"),
)
"""Factors of units to N m, and their names."""

NEAR = 1.15
"""Factor up to which one is that of a unit."""


class Cause(NamedTuple):
    """What would explain the efforts, in words, and what it leaves of their squares."""

    kind: str
    """sign, unit, weightless, gravity or order; joint, where it is of single joints, and light, where it is of light joints
    alone: the model may miss what they carry."""
    left: float
    text: str
    noise: float = 0.0
    """What factors of gravity's and inertia's torques leave, too: noise, and what the model does not have."""


class _Pairs:
    """Squares of each joint's torque columns and all efforts, without what the joint's other columns explain."""

    def __init__(self, relation: EffortRelation, rotors: bool):
        model, nv = relation.model, relation.model.nv
        rest = [DAMPING, FRICTION, OFFSET, *([ROTOR] if rotors else [])]
        kept = [*range(GRAVITY_X, INERTIAL + 1), *range(COLUMNS, COLUMNS + nv)]
        self.square = np.array([_without(one, kept, rest) for one in relation.products])
        self.needed = np.array([*model.gravity, 1.0])
        whole = relation.products[:, GRAVITY_X : INERTIAL + 1, GRAVITY_X : INERTIAL + 1]
        torque, whole = (
            np.einsum("i,kij,j->k", self.needed, one, self.needed) for one in (self.square[:, :4, :4], whole)
        )
        self.torque = np.where(torque > SINGULAR * whole, torque, 0.0)  # the rest is rounding
        largest = np.array([self.torque[relation.slides == one].max(initial=0.0) for one in relation.slides])
        self.tiny = np.maximum(MODEL_ERROR**2 * largest, 1e-300)
        self.weight = 1.0 / (self.torque + self.tiny)
        self.large = self.torque > SHARE * np.maximum(largest, 1e-300)

    def left(self, k, effort, needed, factor=1.0):
        """Return the square of an effort less a factor times a torque of joint k."""
        own, torque = self.square[k], needed @ self.square[k, :4, 4 + effort]
        of_torque = needed @ own[:4, :4] @ needed
        return max(own[4 + effort, 4 + effort] - 2.0 * factor * torque + factor**2 * of_torque, 0.0)

    def share_left(self, needed, factor=1.0, order=None):
        """Return the part of the efforts' squares that is left, all joints weighted by the model's torque."""
        order = range(len(self.square)) if order is None else order
        left = sum(self.weight[k] * self.left(k, j, needed, factor) for k, j in enumerate(order))
        whole = sum(self.weight[k] * self.square[k, 4 + j, 4 + j] for k, j in enumerate(order))
        return left / whole if whole > 0.0 else 1.0

    def share_unexplained(self, order=None):
        """Return the part of the efforts' squares that no factors of gravity's and inertia's torques explain."""
        left = whole = 0.0
        for k, j in enumerate(range(len(self.square)) if order is None else order):
            own = self.square[k]
            across = np.linalg.pinv(own[:4, :4], rcond=SINGULAR, hermitian=True) @ own[:4, 4 + j]
            left += self.weight[k] * max(own[4 + j, 4 + j] - own[:4, 4 + j] @ across, 0.0)
            whole += self.weight[k] * own[4 + j, 4 + j]
        return left / whole if whole > 0.0 else 1.0

    def gravity(self):
        """Return the gravity that explains the efforts best, and that of the model in the directions which they show."""
        A = np.einsum("k,kij->ij", self.weight, self.square[:, :3, :3])
        b = np.einsum("k,ki->i", self.weight, self.square[:, :3, 3] * -1.0)
        b = b + sum(self.weight[k] * self.square[k, :3, 4 + k] for k in range(len(self.square)))
        values, vectors = np.linalg.eigh(A)
        shown = vectors[:, values > 1e-6 * max(values[-1], 1e-300)]
        found = shown @ np.linalg.solve(shown.T @ A @ shown, shown.T @ b) if shown.shape[1] else np.zeros(3)
        return found, shown @ (shown.T @ self.needed[:3])

    def factor(self):
        """Return the factor of all joints together that explains the efforts best."""
        needed = self.needed
        across = sum(self.weight[k] * (needed @ own[:4, 4 + k]) for k, own in enumerate(self.square))
        return across / max(self.weight @ self.torque, 1e-300)

    def order(self):
        """Return the order of efforts that explains them best: exchanges of two joints while these help."""
        nv = len(self.square)
        cost = np.array([[self.left(k, j, self.needed) for j in range(nv)] for k in range(nv)])
        cost = np.log((cost + self.tiny[:, None]) * self.weight[:, None])
        order = list(range(nv))
        pairs = [pair for pair in combinations(range(nv), 2) if self.large[list(pair)].any()]
        while True:
            best, pair = np.log(SWAPPED), None
            for a, b in pairs:
                gain = cost[a, order[a]] + cost[b, order[b]] - cost[a, order[b]] - cost[b, order[a]]
                if gain > best:
                    best, pair = gain, (a, b)
            if pair is None:
                return order
            a, b = pair
            order[a], order[b] = order[b], order[a]


def _without(products, kept, rest):
    """Return products of some columns without what other ones explain."""
    inner, across = products[np.ix_(rest, rest)], products[np.ix_(rest, kept)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
    inverse = np.linalg.pinv(inner * np.outer(scale, scale), rcond=SINGULAR, hermitian=True)
    across = across * scale[:, None]
    return products[np.ix_(kept, kept)] - across.T @ inverse @ across


def likely_cause(relation: EffortRelation) -> Cause | None:
    """Return the cause that explains the efforts of all joints together; None if none does."""
    if not relation.rows:
        return None
    names, model = relation.model.dof_names, relation.model
    pairs = _Pairs(relation, rotors=True)
    if not pairs.torque.any():
        return None
    plain = pairs.share_left(pairs.needed)
    if plain <= 1.0 - EXPLAINED:
        return None
    found = [one for one in (_factor(pairs), _gravity(relation, pairs), _order(pairs, names)) if one]
    found = [
        one for one in found if one.left <= LESS * plain and one.left <= max(1.0 - EXPLAINED, min(NOISY, one.noise))
    ]
    if not found:
        return None
    best = min(one.left for one in found)
    floor = MODEL_ERROR**2  # what a model misses makes no cause better than another one
    return _ceiling(relation, next(one for one in found if one.left + floor <= ALIKE * (best + floor)), model)


def _explains(cause, plain):
    """Return whether a cause explains the efforts, and much better than the model, which leaves the part `plain` of them."""
    noise = min(cause.noise, cause.left)
    enough = cause.left <= max(1.0 - EXPLAINED, min(NOISY, NEARLY * cause.noise))
    return enough and plain - cause.left >= GAIN and cause.left - noise <= LESS * (plain - noise)


def _factor(pairs):
    """Return a factor of all efforts as a cause."""
    factor = pairs.factor()
    if factor == 0.0 or 1.0 / 1.6 < factor < 1.6:
        return None
    left, noise = pairs.share_left(pairs.needed, factor), pairs.share_unexplained()
    if 1.0 / 1.6 < -factor < 1.6:
        return Cause("sign", left, "efforts of all joints seem to have the other sign (effort_scale: '*=-1')", noise)
    unit = next((f", as of {unit}" for one, unit in UNITS if 1.0 / NEAR < abs(factor) / one < NEAR), "")
    sign = " and the other sign" if factor < 0.0 else ""
    return Cause(
        "unit",
        left,
        f"efforts of all joints seem to have another unit{sign}: they are {factor:.3g} times what the model needs{unit} "
        f"(effort_scale: '*={1.0 / factor:.3g}')",
        noise,
    )


def _gravity(relation, pairs):
    """Return gravity's direction, or its absence, as a cause."""
    found, known = pairs.gravity()
    size = np.linalg.norm(known)
    if size == 0.0:
        return None
    left = pairs.share_left(np.r_[found, 1.0])
    ratio = np.linalg.norm(found) / size
    if ratio < WEIGHTLESS:
        return _weightless(relation, pairs)
    angle = np.arccos(np.clip(found @ known / (ratio * size**2), -1.0, 1.0))
    full = np.linalg.norm(relation.model.gravity)
    if angle < TURNED or not FULL[0] < np.linalg.norm(found) / full < FULL[1]:
        return None
    where = "on a ceiling" if angle > np.radians(150.0) else "on a wall" if angle > np.radians(60.0) else "on a slope"
    vector = ", ".join(f"{x:.3g}" for x in np.round(found, 1) + 0.0)
    return Cause(
        "gravity",
        left,
        f"gravity seems to point along [{vector}] m/s² in the base, {np.degrees(angle):.0f}° from the model's, as of a robot "
        f"{where} (parameter gravity)",
        pairs.share_unexplained(),
    )


def _weightless(relation, pairs):
    """Return the absence of gravity as a cause: then efforts are what inertia needs, as far as the motion shows that."""
    apart = _Pairs(relation, rotors=False)
    inertial = np.array([0.0, 0.0, 0.0, 1.0])
    left = apart.share_left(inertial)
    text = "gravity seems not to be in the efforts (effort_includes_gravity: '*=false')"
    return Cause("weightless", left, text, apart.share_unexplained())


def _order(pairs, names):
    """Return an order of the efforts as a cause."""
    order = pairs.order()
    moved = [k for k, j in enumerate(order) if k != j]
    if not moved:
        return None
    left = pairs.share_left(pairs.needed, order=order)
    if len(moved) == 2:
        text = f"efforts of {names[moved[0]]} and {names[moved[1]]} seem to be exchanged"
    else:
        text = (
            f"efforts seem to be in another order: those of {', '.join(names[k] for k in moved)} are in the columns of "
        )
        text += ", ".join(names[order[k]] for k in moved)
    return Cause("order", left, f"{text} (order of the joints)", pairs.share_unexplained(order))


def _ceiling(relation, cause, model):
    """Return the cause; efforts of the other sign and gravity the other way round are told apart by inertia and friction."""
    if cause.kind not in ("sign", "gravity"):
        return cause
    apart = _Pairs(relation, rotors=False)
    found, known = apart.gravity()
    if not known.any() or found @ known > -0.8 * np.linalg.norm(found) * np.linalg.norm(known):
        return cause
    upside, other = np.r_[-model.gravity, 1.0], -apart.needed
    lefts = apart.share_left(upside), apart.share_left(other)
    friction = [_dissipated(relation, one) for one in (upside, other)]
    floor = 1e-12
    if lefts[1] + floor < (lefts[0] + floor) / ALIKE or friction[0] < 0.0:
        return _sign_of(lefts[1])
    ceiling = _gravity(relation, apart)
    if ceiling and (lefts[0] + floor < (lefts[1] + floor) / ALIKE or friction[0] > 0.0):
        return ceiling
    both = _sign_of(lefts[1])
    return both._replace(
        text=f"{both.text}, or gravity points the other way, as of a robot on a ceiling (parameter gravity)"
    )


def _sign_of(left):
    return Cause("sign", left, "efforts of all joints seem to have the other sign (effort_scale: '*=-1')")


def _dissipated(relation, needed):
    """Return the sign of the power that friction takes if the torque is this one; 0 where there is hardly any friction."""
    rest, power, scale = [DAMPING, FRICTION, OFFSET], 0.0, 0.0
    for k, products in enumerate(relation.products):
        right = products[rest, COLUMNS + k] - products[np.ix_(rest, range(4))] @ needed
        x = np.linalg.lstsq(products[np.ix_(rest, rest)], right, rcond=SINGULAR)[0]
        power += x[:2] @ products[np.ix_([DAMPING, FRICTION], [DAMPING])][:, 0]
        scale += np.sqrt(products[COLUMNS + k, COLUMNS + k] * products[DAMPING, DAMPING])
    return 0.0 if abs(power) < 0.02 * scale else float(np.sign(power))


def complaint(relation: EffortRelation, of: Relation, tolerant: bool = False) -> Cause | None:
    """Return what is wrong with the efforts; None where nothing is."""
    cause, wrong, light = likely_cause(relation), of.wrong(tolerant), _light(relation, of, tolerant)
    right = of.judged() & ~wrong
    if cause and cause.kind in OF_ALL and np.any(of.torque[right] >= LIGHT * of.torque.max()):
        cause = None  # where the effort of a heavy joint is right, it is not wrong in all
    if cause:
        return cause
    weightless = _all_weightless(of, relation.model.dof_names, tolerant) if wrong.any() else ""
    if weightless:
        return Cause("weightless", 1.0, weightless)
    heavy = np.flatnonzero(wrong & ~light)
    if len(heavy):
        return Cause("joint", 1.0, _of_joint(relation, of, heavy, tolerant))
    doubtful = np.flatnonzero(wrong if tolerant else wrong | of.doubtful())
    if not len(doubtful):
        return None
    texts = [_of_joint(relation, of, one, tolerant) for one in _alike(of, doubtful)]
    return Cause("light", 1.0, f"{'; '.join(texts)}; or the model misses what a light joint carries")


def _light(relation, of, tolerant):
    """Return which joints have much less torque than one whose effort is right, bool."""
    right = of.judged() & ~of.wrong(tolerant)
    largest = [of.torque[right & (relation.slides == slides)].max(initial=0.0) for slides in relation.slides]
    small = (of.factor > OTHER_SIGN[1]) & (of.factor < of.limits(tolerant)[0])
    return of.torque < np.where(small | of.unrelated(), LIGHT, VERY_LIGHT) * largest


def _of_other_sign(of):
    """Return which joints have an effort of the other sign and of the right size, bool."""
    return (of.factor >= OTHER_SIGN[0]) & (of.factor <= OTHER_SIGN[1]) & ~of.unrelated()


def _alike(of, joints):
    """Return joints in groups that one text describes: those of the other sign, and each other one."""
    turned = _of_other_sign(of)[joints]
    return [*([joints[turned]] if turned.any() else []), *joints[~turned][:, None]]


def _of_joint(relation, of, wrong, tolerant):
    """Return what is wrong with the effort of a joint, or of some, in words."""
    names = relation.model.dof_names
    low, high = of.limits(tolerant)
    turned = wrong[_of_other_sign(of)[wrong]]
    if len(turned):
        return _turned(turned, of, names)
    k = wrong[int(np.argmax(of.torque[wrong]))]
    factor, error = of.factor[k], ERRORS * of.error[k]
    told = f"{factor:.3g} ± {error:.2g} times what the model needs, expected {low[k]:g} to {high[k]:g}"
    if of.unrelated()[k] or abs(factor) <= min(WEIGHTLESS * low[k], error):
        return (
            f"the effort of joint '{names[k]}' has no relation to the motion: it changes by {told}. Check that it is a "
            "torque or a current of this joint"
        )
    return (
        f"the effort of joint '{names[k]}' changes by {told}: is it in N m or N, on the joint's side of the gear, and are "
        "the joints in order (effort_scale, docs/recordings.md)"
    )


def _turned(turned, of, names):
    """Return that efforts of some joints are of the other sign, in words."""
    every = of.heavy & of.judged()
    ceiling = (
        ", or gravity points the other way (parameter gravity)"
        if every.any() and every[turned].sum() == every.sum()
        else ""
    )
    if len(turned) > 1:
        quoted, factors = ", ".join(f"'{names[k]}'" for k in turned), ", ".join(f"{of.factor[k]:.2f}" for k in turned)
        beside = f"they change by {factors} times what the model needs{ceiling}"
        return f"efforts of joints {quoted} are of the other sign: {beside}"
    name = names[turned[0]]
    return (
        f"the effort of joint '{name}' is of the other sign: it changes by {of.factor[turned[0]]:.2f} times what the model "
        f"needs (effort_scale: '{name}=-1'){ceiling}"
    )


def _all_weightless(of, names, tolerant):
    """Return that gravity is in no effort, in words, or that efforts have no relation to the motion; empty where it is."""
    heavy = np.flatnonzero(of.heavy & (of.judged() | of.wrong(tolerant)))
    if not len(heavy) or np.any(np.abs(of.factor[heavy]) >= MAX_WEIGHTLESS):
        return ""
    k = heavy[int(np.argmax(of.torque[heavy]))]
    if of.torque[k] < LIGHT * of.torque.max():  # of which nothing is known
        return ""
    text = (
        f"gravity is not in the efforts: that of joint '{names[k]}' changes by {of.factor[k]:.2f} times what the model "
        "needs. If the driver has taken gravity out, read the recording with "
        "parameters={'effort_includes_gravity': ['*=false']}"
    )
    known = ERRORS * of.inertial_error < 1.0
    if not known.any():
        return f"{text}. If not, the efforts have no relation to the motion"
    return text if np.median(of.inertial[known]) > 0.5 else ""
