# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Closed loops and non-linear mimic joints: their independent joints, and tables for the sweeps."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from itertools import combinations
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description.check_table import warn
from diag_dynamics.description.description import (
    Curve,
    Description,
    Flexible,
    Form,
    Loop,
    Mimic,
    loop_names,
)
from diag_dynamics.exceptions import InputError, LoopError, LoopWarning
from diag_dynamics.model.tree import Tree, coupled_groups, path_to
from diag_dynamics.sweeps import couplings, kinematics
from diag_dynamics.sweeps.memory import Workspace
from diag_dynamics.text import listed

DEPENDENT = 1e-7
"""Singular value of a loop's equations, by the largest, below which they depend on each other at
the start."""

GAP, CLOSED = 1e-3, 1e-5
"""Tolerance for rounded descriptions: distance of the ends of a loop [m], and along directions in
which they can part."""

RANK, ROUNDED_RANK = 1e-9, 1e-4
"""Singular values of J, by the largest, below which no step is made.

Axes in descriptions may be rounded to 1e-4 rad.
"""

MAX_CHOICES = 500
"""Maximum number of sets of independent joints that are compared."""

MAX_STEP, MAX_STEPS = 0.3, 200
"""Largest correction of a joint by a step to the start, and the number of steps."""

FIRST_DAMPING, NEAR = 1e-3, 1e-6
"""Damping by the square of J's largest singular value, and the gap below which steps have none."""


# --- Joints that depend on others -----------------------------------------------------------------


Closure = tuple[str | None, str | None, Array, Array, Array]
"""Joints that carry both ends, points in their bodies, and a direction: see couplings.CLOSURE."""


class Group(NamedTuple):
    """Joints of loops that share some, their loops, mimic joints among them, and closures."""

    joints: set[str]
    loops: list[Loop]
    equations: dict[str, Curve]
    closures: list[Closure]


class Coupled(NamedTuple):
    """Joints of a robot that depend on others by changing ratios.

    `followers` has the independent joints on which each depends, by name; `mimics` are those of a
    constant ratio, `curves` those that are in no group. `start` are positions in which loops are
    closed. Joints of `flexible` links follow modes.
    """

    followers: dict[str, tuple[str, ...]]
    mimics: dict[str, Mimic]
    groups: list[Group]
    curves: dict[str, Curve]
    start: dict[str, float]
    flexible: Flexible


def resolve_curves(
    description: Description,
    curves: Mapping[str, Curve],
    mimics: dict[str, Mimic],
    locked: dict[str, float],
) -> dict[str, Curve]:
    """Return the curves of joints that move, by follower, whose sources are independent.

    Followers of a joint that is locked are locked as well.
    """
    resolved: dict[str, Curve] = {}
    for name, curve in curves.items():
        for joint in (name, curve.source):
            description.single_joint(f"mimics of '{name}'", joint)
        if curve.source in curves or curve.source in mimics:
            raise InputError(
                f"mimics of '{name}': its source '{curve.source}' follows another joint; "
                "expected an independent joint."
            )
        if curve.source in locked:
            locked.setdefault(name, curve(locked[curve.source]))
        elif name not in locked:
            resolved[name] = curve
    for name, mimic in mimics.items():
        if mimic.leader in curves:
            raise InputError(
                f"mimics: joint '{name}' mimics '{mimic.leader}', which follows another joint; "
                f"give '{name}' an entry in mimics, too."
            )
    return resolved


def coupled_tree(
    description: Description, mimics: dict[str, Mimic], locked: dict[str, float]
) -> Tree:
    """Return the tree of a description that has loops, curves or flexible links."""
    curves = {} if description.mimic == "free" else description.curves
    flexible = description.flexible
    if wrong := sorted(flexible.joints & locked.keys()):
        raise InputError(
            f"locked_joints: '{wrong[0]}' is of a flexible link. Take a rigid link, or fewer modes."
        )
    if not (description.loops or curves or flexible.forms):
        return Tree(description, locked, mimics)
    curves = resolve_curves(description, curves, mimics, locked)
    coupled = close(Tree(description, locked, {}), curves, mimics, flexible)
    return Tree(description, locked, coupled.mimics, coupled)


def close(
    tree: Tree, curves: dict[str, Curve], mimics: dict[str, Mimic], flexible: Flexible
) -> Coupled:
    """Return the joints that depend on others, given the cut tree.

    All joints of the cut tree are independent. Driven joints are independent if they can be.
    """
    loops = tree.description.loops
    driven = frozenset(tree.description.driven)
    followers: dict[str, tuple[str, ...]] = {f: (curve.source,) for f, curve in curves.items()}
    followers |= {name: form.sources for name, form in flexible.forms.items()}
    result = Coupled(followers, dict(mimics), [], dict(curves), {}, flexible)
    for name, count in Counter(loop.name for loop in loops).items():
        if count > 1:
            raise LoopError(f"two loops have the name '{name}'; expected other names. Rename one.")
    cut = _Cut(tree)
    start = cut.start(loops)
    linear = {
        name: Curve(mimic.leader, np.array([[0.0, mimic.offset, mimic.multiplier]]))
        for name, mimic in mimics.items()
    }
    curves = linear | curves
    members = [cut.members(loop) for loop in loops]
    sources = {name: curve.source for name, curve in curves.items()}
    groups = coupled_groups(sources, tree.carriers, members)
    for loop, joints in zip(loops, members, strict=True):
        if not joints:
            gap = float(np.linalg.norm(cut.equations(start, [], Group(set(), [loop], {}, []))[0]))
            if gap > GAP:
                raise open_error([loop], gap)
    closed = [groups[min(joints)] for joints in members if joints]
    for joints in {id(joints): joints for joints in closed}.values():
        cuts = [loop for loop, part in zip(loops, members, strict=True) if part and part <= joints]
        equations = {name: curve for name, curve in curves.items() if name in joints}
        group = Group(joints, cuts, equations, [])
        for name in equations:
            for kind in (result.curves, result.mimics, result.followers):
                kind.pop(name, None)
        _choose(cut, group, driven, start, result)
        result.groups.append(group)
    return result


def open_error(loops: list[Loop], gap: float) -> LoopError:
    """Return the error of loops that stay open."""
    return LoopError(
        f"{loop_names(loops)} cannot be closed from the start values, {gap:.3g} remains. "
        "Give other ones, or correct the ends."
    )


def _choose(
    cut: _Cut, group: Group, driven: Set[str], start_values: Array, result: Coupled
) -> None:
    """Close a group near start values, and divide its joints into independent and dependent."""
    names = [name for name in cut.names if name in group.joints]
    title = loop_names(group.loops)
    if several := group.joints - set(names):
        raise LoopError(
            f"{title}: joint '{min(several)}' in it has several degrees of freedom; expected one."
        )
    if modal := group.joints & result.flexible.joints:
        raise LoopError(
            f"{title}: joint '{min(modal)}' in it is of a flexible link; expected rigid links."
        )
    chosen = {name for loop in group.loops for name in loop.independent} - cut.tree.locked.keys()
    if foreign := chosen - group.joints:
        raise LoopError(
            f"{title}: independent joint '{min(foreign)}' is not in it; "
            f"its joints are {listed(names)}."
        )
    for fixed, dependent in ((chosen, RANK), (set[str](), RANK), (set[str](), ROUNDED_RANK)):
        start = start_values.copy()
        J, gap = cut.close(start, names, group, fixed, dependent)
        closures, apart = cut.closures(start, names, group, max(DEPENDENT, 10.0 * gap))
        if gap <= GAP and apart <= CLOSED:
            break
    else:
        raise open_error(group.loops, gap)
    values, basis = np.linalg.svd(J)[1:]
    rank = int((values > max(DEPENDENT, 10.0 * gap) * values[0]).sum())
    free = len(names) - rank
    poses = []
    columns = cut.columns(names)
    directions = basis[rank:]
    for step in (*directions, *-directions):
        q = start.copy()
        q[columns] += MAX_STEP * step
        J_there, gap_there = cut.close(q, names, group, set())
        if gap_there < 1e-9:
            poses.append(J_there)
    if any(np.linalg.matrix_rank(J, 1e-3 * values[0]) > rank for J in poses):
        raise LoopError(f"{title}: the start is singular. Give other start values.")
    if free < 1:
        raise LoopError(
            f"{title} leaves none of its joints free: {listed(names)}. Lock them, "
            "or cut the loop elsewhere."
        )
    if chosen and len(chosen) != free:
        raise LoopError(
            f"{title}: {len(chosen)} independent joints are given, {listed(sorted(chosen))}; "
            f"its degrees of freedom are {free}."
        )
    independent = (
        [name for name in names if name in chosen]
        if chosen
        else _independent(title, [J, *poses], names, free, driven)
    )
    followers = [name for name in names if name not in independent]
    if not _ratio(J, names, followers) > couplings.NEARLY_SINGULAR:
        raise LoopError(
            f"{title}: the start is singular for the independent joints {listed(independent)}."
            " Give other start values."
        )
    group.closures.extend(closures)
    result.followers.update(dict.fromkeys(followers, tuple(independent)))
    result.start.update(zip(names, start[columns].tolist(), strict=True))


def _ratio(J: Array, names: list[str], followers: list[str]) -> float:
    """Return the least singular value of the followers' columns by the largest of all."""
    columns = J[:, [names.index(name) for name in followers]]
    return (
        float(np.linalg.svd(columns, compute_uv=False)[-1] / np.linalg.norm(J, 2))
        if followers
        else 1.0
    )


def _independent(
    title: str, poses: list[Array], names: list[str], free: int, driven: Set[str]
) -> list[str]:
    """Return independent joints, as many driven ones as possible, far from singular in all poses.

    At the first pose they are independent.
    """
    options = (
        list(combinations(names, free))
        if math.comb(len(names), free) <= MAX_CHOICES
        else [_pivots(J, names, free, driven) for J in poses]
    )
    ratios = {
        option: [_ratio(J, names, [name for name in names if name not in option]) for J in poses]
        for option in options
    }

    def quality(option: tuple[str, ...]) -> tuple[bool, int, float]:
        is_regular = ratios[option][0] > couplings.NEARLY_SINGULAR
        return is_regular, len(driven & set(option)), min(ratios[option])

    independent = max(options, key=quality)
    motors = driven & set(independent)
    for option in options:
        driven_there = driven & set(option)
        if len(driven_there) > len(motors) and max(ratios[option]) > couplings.NEARLY_SINGULAR:
            chosen = listed(sorted(set(independent) - motors))
            text = (
                f"{title}: the start is a dead point of motor '{min(driven_there - motors)}', "
                "in place of"
            )
            text += f" which passive joints are independent: {chosen}. Start at another pose."
            warn(text, LoopWarning)
            break
    return list(independent)


def _pivots(J: Array, names: list[str], free: int, driven: Set[str]) -> tuple[str, ...]:
    """Return the joints whose columns are nearest to those of others, driven ones first."""
    A = J.copy()
    weight = np.array([1e-6 if name in driven else 1.0 for name in names])
    for _ in range(len(names) - free):
        k = int(np.argmax(weight * np.linalg.norm(A, axis=0)))
        axis = A[:, k] / np.linalg.norm(A[:, k])
        A -= np.outer(axis, axis @ A)
        weight[k] = 0.0
    return tuple(name for name, is_left in zip(names, weight, strict=True) if is_left)


class _Cut:
    """The tree of a robot whose loops are cut, and closures there."""

    def __init__(self, tree: Tree) -> None:
        self.tree = tree
        bodies, _ = tree.records({})
        self._workspace = Workspace(bodies, np.zeros(3))
        self._places = {link.name: (body, place) for link, body, place in tree.links}
        self._of_body = {body: name for name, body in tree.last_body.items()}
        self.names = [joint.name for joint in tree.joints if len(joint.dof_names) == 1]
        self._q = {name: k for k, name in enumerate(tree.coordinate_names)}
        self._dof = {name: k for k, name in enumerate(tree.dof_names)}

    def members(self, loop: Loop) -> set[str]:
        """Return the joints between the ends of a loop."""
        for end in (loop.a, loop.b):
            if end.link not in self._places:
                raise LoopError(f"loop '{loop.name}' has '{end.link}'; expected a link.")
        for name in {*loop.independent, *loop.start} - self.tree.locked.keys():
            if name not in self._q:
                raise LoopError(
                    f"loop '{loop.name}' has '{name}'; expected a moving joint of one degree of "
                    "freedom."
                )
        for name, x in loop.start.items():
            if (
                name in self._q
                and self.tree.moving[name].joint.type != "prismatic"
                and abs(x) > 2.0 * np.pi
            ):
                raise LoopError(
                    f"loop '{loop.name}': start of '{name}' is {x:g}; expected radians within ±2π."
                )
        ends = (self._of_body[self._places[end.link][0]] for end in (loop.a, loop.b))
        first, second = (path_to(joint, self.tree.carriers) for joint in ends)
        return first ^ second

    def start(self, loops: Sequence[Loop]) -> Array:
        """Return positions of all joints: the start values of loops, otherwise 0."""
        q = self.tree.neutral.copy()
        first: dict[str, Loop] = {}
        for loop in loops:
            for name in loop.start.keys() & self._q.keys():
                earlier = first.setdefault(name, loop)
                if abs(loop.start[name] - earlier.start[name]) > GAP:
                    raise LoopError(
                        f"start of '{name}' is {earlier.start[name]:g} in loop '{earlier.name}' "
                        f"and {loop.start[name]:g} in loop '{loop.name}'; expected one value. "
                        "Remove it from one of them."
                    )
                q[self._q[name]] = earlier.start[name]
        return q

    def columns(self, names: list[str]) -> list[int]:
        """Return the places of joints in q."""
        return [self._q[name] for name in names]

    def _on_body(self, link: str, point: Array) -> tuple[int, Array]:
        """Return the body of a link, and a point of the link in the frame of the body."""
        body, place = self._places[link]
        return body, place[:3, 3] + place[:3, :3] @ point

    def _point(self, q: Array, link: str, point: Array) -> tuple[Array, Array]:
        """Return position and Jacobian of a point of a link in the world."""
        body, point = self._on_body(link, point)
        X = np.empty((3, 4))
        J = np.empty((1, 6, len(self._dof)))
        kinematics.placement(self._workspace.robot, q, body, X)
        kinematics.jacobians(self._workspace.robot, body, point, False, q[None], J)
        return X[:, :3] @ point + X[:, 3], X[:, :3] @ J[0, :3]

    def equations(self, q: Array, names: list[str], group: Group) -> tuple[Array, Array]:
        """Return φ in the axes of the world, and its Jacobian by the joints."""
        phi = []
        J = []
        for loop in group.loops:
            for a, b in loop.points:
                at_a, J_a = self._point(q, loop.a.link, a)
                at_b, J_b = self._point(q, loop.b.link, b)
                phi.append(at_a - at_b)
                J.append(J_a - J_b)
        for name, curve in group.equations.items():
            row = np.zeros((1, len(self._dof)))
            x = q[self._q[curve.source]]
            row[0, self._dof[name]] = 1.0
            row[0, self._dof[curve.source]] = -(curve(x + 1e-6) - curve(x - 1e-6)) / 2e-6
            phi.append(np.array([q[self._q[name]] - curve(x)]))
            J.append(row)
        return np.concatenate(phi), np.concatenate(J)[:, [self._dof[name] for name in names]]

    def close(
        self, q: Array, names: list[str], group: Group, held: set[str], dependent: float = RANK
    ) -> tuple[Array, float]:
        """Move joints by damped steps (Levenberg-Marquardt) to where loops are closed.

        Return J there, and the gap that remains. Positions of `held` joints stay. No step is made
        along singular values below `dependent`, by the largest.
        """
        moves = np.array([name not in held for name in names])
        columns = self.columns(names)
        phi, J = self.equations(q, names, group)
        gap = float(np.linalg.norm(phi))
        damping = FIRST_DAMPING
        for _ in range(MAX_STEPS):
            if gap < 1e-14:
                break
            U, values, Vt = np.linalg.svd(J * moves, full_matrices=False)
            is_large = values > dependent * values[0]
            values = values[is_large]
            factors = values / (values**2 + damping * values[:1] ** 2)
            step = (factors * (phi @ U[:, is_large])) @ Vt[is_large]
            moved = q.copy()
            moved[columns] -= step * min(1.0, MAX_STEP / max(np.abs(step).max(), 1e-300))
            moved_phi, moved_J = self.equations(moved, names, group)
            moved_gap = float(np.linalg.norm(moved_phi))
            is_stalled = gap < NEAR and moved_gap > 0.5 * gap
            if moved_gap < gap:
                q[:] = moved
                phi = moved_phi
                J = moved_J
                gap = moved_gap
                damping = 0.0 if gap < NEAR else 0.1 * damping
            else:
                damping = 10.0 * max(damping, FIRST_DAMPING)
            if is_stalled:
                break
        return J, gap

    def closures(
        self, q: Array, names: list[str], group: Group, threshold: float
    ) -> tuple[list[Closure], float]:
        """Return the closures of a group, and the largest gap there.

        Closures are only directions in which the points of a pair can part. Positions beside the
        loop show them: no joint of a planar loop moves a point out of its plane.
        """
        rng = np.random.default_rng(0)
        X = np.empty((3, 4))
        carrier = self.tree.parent(self.tree.first_body(names[0]))
        kinematics.placement(self._workspace.robot, q, carrier, X)
        pairs = [
            [self._on_body(loop.a.link, a), self._on_body(loop.b.link, b)]
            for loop in group.loops
            for a, b in loop.points
        ]
        columns = []
        for _ in range(3):
            moved = q.copy()
            moved[self.columns(names)] += rng.uniform(-1.0, 1.0, len(names))
            J = self.equations(moved, names, group)[1][: 3 * len(pairs)]
            columns.append(X[:, :3].T @ J.reshape(len(pairs), 3, -1))
        M = np.concatenate(columns, axis=2)
        gaps = self.equations(q, names, group)[0][: 3 * len(pairs)].reshape(-1, 3) @ X[:, :3]
        rows_before = np.zeros((0, M.shape[2]))
        closures = []
        largest = 0.0
        for ends, rows, gap in zip(pairs, M, gaps, strict=True):
            U, values, V = np.linalg.svd(
                rows - rows @ rows_before.T @ rows_before, full_matrices=False
            )
            apart = values > threshold * np.linalg.norm(M)
            rows_before = np.vstack([rows_before, V[apart]])
            of = [
                name if (name := self._of_body[body]) in group.joints else None for body, _ in ends
            ]
            closures += [(*of, ends[0][1], ends[1][1], d) for d in U.T[apart]]
            largest = max(largest, *np.abs(U.T[apart] @ gap), 0.0)
        return closures, largest


# --- Tables for the sweeps ------------------------------------------------------------------------


def form_tables(forms: Mapping[str, Form], first_body: Mapping[str, int]) -> tuple[Array, Array]:
    """Return the records of forms for the sweeps, and their coefficients."""
    records = []
    coefficients = np.zeros(0)
    for name, form in forms.items():
        records.append((first_body[name], len(coefficients)))
        coefficients = np.append(coefficients, np.column_stack([form.linear, form.quadratic]))
    return np.array(records, couplings.FORM), coefficients


def coupling_tables(tree: Tree, coupled: Coupled) -> couplings.CouplingTables:
    """Return the tables of a tree with followers."""
    first_body = {name: tree.first_body(name) for name in tree.moving}
    loops = list[tuple[int, ...]]()
    joints = list[tuple[int, ...]]()
    start = list[float]()
    closures = list[tuple[object, ...]]()
    curves = list[tuple[object, ...]]()
    pieces = list[Array]()

    def add_curve(curve: Curve, loop: int, *ends: int) -> None:
        curves.append(
            (
                loop,
                *ends,
                len(pieces),
                len(pieces) + len(curve.pieces),
            )
        )
        pieces.extend(curve.pieces)

    for number_, group in enumerate(coupled.groups):
        names = sorted(group.joints, key=first_body.__getitem__)
        place = {name: len(joints) + k for k, name in enumerate(names)} | {None: -1}
        of_body = {
            body: name if name in group.joints else None for name, body in tree.last_body.items()
        }
        followers = [name for name in names if name in coupled.followers]
        order = [*followers, *coupled.followers[followers[0]]]
        span = len(closures), len(closures) + len(group.closures)
        loops.append(
            (
                len(joints),
                len(joints) + len(names),
                len(followers),
                *span,
                span[1] - span[0] + len(group.equations),
            )
        )
        for name, ordered in zip(names, order, strict=True):
            joints.append(
                (first_body[name], place[of_body[tree.parent(first_body[name])]], place[ordered])
            )
            start.append(coupled.start[name])
        closures += [(place[a], place[b], *points) for a, b, *points in group.closures]
        for name, curve in group.equations.items():
            add_curve(curve, number_, place[name], place[curve.source])
    for name, curve in coupled.curves.items():
        add_curve(curve, -1, first_body[name], first_body[curve.source])
    table = np.zeros((len(pieces), max(map(len, pieces), default=2)))
    for row, piece in zip(table, pieces, strict=True):
        row[: len(piece)] = piece
    forms, coefficients = form_tables(coupled.flexible.forms, first_body)
    return couplings.CouplingTables(
        np.array(loops, couplings.LOOP),
        np.array(joints, couplings.JOINT),
        np.array(closures, couplings.CLOSURE),
        np.array(curves, couplings.CURVE),
        table,
        np.array(start, float),
        forms,
        coefficients,
    )
