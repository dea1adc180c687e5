# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints that follow others: positions and rates at a state, and values in messages."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description.description import Mimic, loop_names
from diag_dynamics.exceptions import LoopError
from diag_dynamics.model.joint_types import places, single_joints
from diag_dynamics.rotations import wrap_angle
from diag_dynamics.sweeps import couplings, followers
from diag_dynamics.text import listed

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel
    from diag_dynamics.model.tree import MovingJoint

WAYS = [0.8**k for k in range(31)]
"""Fractions of the way from the start to random positions, tried where a loop is open."""


class FollowerState(NamedTuple):
    """Followers at a state, f of them, and how they depend on the independent joints.

    `position` [rad, m] and `rate` [rad/s, m/s] have the shape (f,), `ratios` G = ∂rate/∂q̇ has
    (f, nv). `singularity` is the smallest |R_kk| of J_d = QR by the longest
    column of J of each closed group, in the order of `RobotModel.loops`: near 0 the independent
    joints do not determine the others.
    """

    names: tuple[str, ...]
    position: Array
    rate: Array
    ratios: Array
    singularity: tuple[float, ...]


class FollowerMotion:
    """Followers of a model, mimic joints first, for one thread.

    The last state chooses the branch of a loop.
    """

    def __init__(self, model: RobotModel) -> None:
        self.model = model
        self.names = (*model.mimics, *model.followers)
        self._rows = [model.first_body(name) for name in self.names]
        self.workspace = model.new_workspace()

    def memory(self) -> Array:
        """Return memory for sweeps.followers."""
        return np.zeros((len(self.model.bodies), 1 + 2 * self.model.nv))

    def at(self, q: Array, qd: Array | None = None) -> FollowerState:
        """Return the :class:`FollowerState` at q, shape (nq,), and q̇, shape (nv,), 0 by default.

        LoopError without one.

        The coordinates of a floating base may be missing.
        """
        model = self.model
        nv = self.model.nv
        loops = self.workspace.couplings
        q = np.append(model.neutral[: model.nq - len(q)], q)
        qd = np.zeros(nv) if qd is None else qd
        ratios = self.memory()
        if status := followers.ratios(self.workspace.robot, q, qd, ratios):
            raise loop_error(model, status)
        rows = ratios[self._rows]
        G = rows[:, 1 : 1 + nv]
        singularity = tuple(loops.ratio.tolist()) if loops else ()
        return FollowerState(self.names, rows[:, 0], G @ qd, G, singularity)


def loop_error(model: RobotModel, status: int) -> LoopError:
    """Return the error of a kernel's status on a loop."""
    kind, number = divmod(-status, 1000)
    if kind == 0:
        return LoopError(f"positions or rates of robot '{model.name}' are not finite.")
    is_singular = -1000 * kind == couplings.SINGULAR_LOOP
    why = "is singular for its independent joints" if is_singular else "cannot be closed"
    return LoopError(
        f"{loop_title(model, number)} of robot '{model.name}' {why} at these positions."
    )


def loop_title(model: RobotModel, number: int) -> str:
    """Return the names of the loops of a closed group, and its joints."""
    return f"{loop_names(model.loops[number])} ({', '.join(model.loop_joints[number])})"


def closed(model: RobotModel, q: Array) -> Array:
    """Return positions in which loops are closed: q, or joints of loops nearer to the start."""
    motion = FollowerMotion(model)
    start = q.copy()
    names = {name for group in model.loop_joints for name in group}
    moved = [k for k, name in enumerate(model.coordinate_names) if name in names]
    start[moved] = model.start[moved]
    for way in WAYS:
        try:
            motion.at(start)  # the branch is that of the start
            motion.at(start + way * (q - start))
        except LoopError:
            continue
        return start + way * (q - start)
    return start


STEP, STEPS = 0.02, 1000
"""Step [rad, m] by which an independent joint moves to where a follower ends, and the number of
steps."""

PRECISE = 1e-8
"""Precision of such an end [rad, m]: loops are not singular yet."""


def limit_by_followers(
    model: RobotModel, joints: Mapping[str, MovingJoint], lower: Array, upper: Array
) -> list[str]:
    """Narrow limits of independent joints so that followers keep theirs and loops close.

    Return texts on followers whose limits do not count: those of several joints, of continuous
    ones, and those that are beyond their limits at the start.
    """
    ends = {}
    for name in model.followers:
        ends[name] = np.array([joints[name].joint.lower, joints[name].joint.upper])
    limited = [name for name in ends if np.isfinite(ends[name]).any()]
    omitted = set[str]()
    for leaders in set(model.followers.values()):
        group = {
            name: ends[name] for name, sources in model.followers.items() if sources == leaders
        }
        if len(leaders) > 1 or leaders[0] in model.continuous_joints:
            omitted |= group.keys()
        elif group.keys() & set(limited) or any(leaders[0] in names for names in model.loop_joints):
            k = model.coordinate_names.index(leaders[0])
            bounds = [_end(model, k, lower[k], -1.0, group), _end(model, k, upper[k], 1.0, group)]
            if None in bounds:
                omitted |= group.keys()
            else:
                lower[k], upper[k] = bounds
    return [
        f"limits of joint '{name}', which follows {listed(model.followers[name])}"
        for name in limited
        if name in omitted
    ]


def _end(
    model: RobotModel, k: int, limit: float, sign: float, group: Mapping[str, Array]
) -> float | None:
    """Return the position up to which a joint moves toward its limit from the start.

    Return None if followers are beyond theirs.
    """
    motion = FollowerMotion(model)
    start = model.start
    rows = [motion.names.index(name) for name in group]
    ends = np.array(list(group.values()))

    def fits(x: float) -> bool:
        start[k] = x
        try:
            position = motion.at(start).position[rows]
        except LoopError:
            return False
        return not ((position < ends[:, 0]) | (position > ends[:, 1])).any()

    good = float(start[k])
    steps = 0
    if not fits(good):
        return None
    while sign * (limit - good) > 0.0 and steps < STEPS:
        ahead = min(sign * limit, sign * good + STEP) * sign
        steps = steps + 1
        if not fits(ahead):
            while abs(ahead - good) > PRECISE:
                middle = 0.5 * (good + ahead)
                good, ahead = (middle, ahead) if fits(middle) else (good, middle)
            return good
        good = ahead
    return limit


# --- Values of followers in messages


class Followers:
    """Positions of followers by their sources, and efforts of followers on their sources.

    `joints` are the independent joints, `mimics` is :class:`Mimic` by name, and `continuous` has
    followers whose position is an angle that wraps. A measured position of a follower may differ by
    `tolerance` [rad, m] from the position by its source; 0 accepts any. `motion` is the
    FollowerMotion of a model whose ratios change. Vectors of followers are in the order of `names`,
    mimic joints first, NaN for unknown values.
    """

    def __init__(
        self,
        joints: Iterable[str],
        mimics: Mapping[str, Mimic],
        tolerance: float = 0.0,
        continuous: Container[str] = (),
        motion: FollowerMotion | None = None,
    ) -> None:
        self.names = tuple(motion.names if motion else mimics)
        self.tolerance = tolerance
        self.motion = motion
        joints = tuple(joints)
        self._sources: dict[str, tuple[str, ...]] = {
            name: (mimic.leader,) for name, mimic in mimics.items()
        }
        self._sources |= motion.model.followers if motion else {}
        self.leaders = np.array(
            places([mimic.leader for mimic in mimics.values()], joints), dtype=np.int64
        )
        self.turns = np.array([name in continuous for name in self.names], dtype=bool)
        self.multipliers = np.array([mimic.multiplier for mimic in mimics.values()], float)
        self.offsets = np.array([mimic.offset for mimic in mimics.values()], float)
        self._G = np.zeros((len(mimics), len(joints)))
        self._G[np.arange(len(mimics)), self.leaders] = self.multipliers

    @classmethod
    def of(cls, model: RobotModel, tolerance: float = 0.0) -> Followers:
        """Return the followers of a model."""
        motion = FollowerMotion(model) if model.followers else None
        return cls(single_joints(model), model.mimics, tolerance, model.continuous_joints, motion)

    def at(self, position: Array) -> tuple[Array, Array]:
        """Return positions of followers [rad, m] by those of independent joints, and G, (f, n).

        LoopError without.
        """
        if self.motion is None:
            return self._G @ position + self.offsets, self._G
        now = self.motion.at(position)
        return now.position, now.ratios[:, now.ratios.shape[1] - len(position) :]

    def reflected(self, position: Array, effort: Array, loads: Array) -> Array:
        """Return efforts of the independent joints and, through G, of the followers.

        Unknown efforts of followers count as zero.
        """
        reflected: Array = effort + np.where(np.isfinite(loads), loads, 0.0) @ self.at(position)[1]
        return reflected

    def disagreements(self, position: Array, measured: Array) -> list[str]:
        """Texts, one for each follower further than `tolerance` from where its source puts it.

        NaN is not compared.
        """
        if not self.tolerance:
            return []
        expected, _ = self.at(position)
        distance = np.abs(np.where(np.isfinite(measured), measured, np.nan) - expected)
        distance = np.where(self.turns, np.abs(wrap_angle(distance)), distance)
        far = np.flatnonzero(distance > self.tolerance).tolist()
        return [self.disagreement(k, measured[k], expected[k]) for k in far]

    def disagreement(self, k: int, measured: float, expected: float) -> str:
        """Text on follower k, whose position is not the expected one."""
        sources = ", ".join(map(repr, self._sources[self.names[k]]))
        return (
            f"position of joint '{self.names[k]}' is {measured:.9g}; "
            f"expected {expected:.9g} from {sources}, "
            f"which it follows, within mimic_tolerance = {self.tolerance:g}"
        )
