# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mimic joints: the source joint of each chain, and the groups that are eliminated together."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Set
from typing import TYPE_CHECKING

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.description.elements import LARGEST
from diag_dynamics.description.records import SINGLE, Description, Joint, Mimic
from diag_dynamics.exceptions import MimicJointError
from diag_dynamics.model.followers import FollowerMotion
from diag_dynamics.model.joint_types import places, single_joints
from diag_dynamics.rotations import wrap_angle

if TYPE_CHECKING:
    from diag_dynamics.model.robot import RobotModel

_CURE = "The parameter mimic=free takes every joint as independent."


def resolve_mimics(description: Description) -> tuple[dict[str, Mimic], dict[str, float]]:
    """Return :class:`Mimic` by mimic joint, and the positions of all locked joints.

    Mimic joints that stand still are locked, too. Joints with curves are no mimic joints.
    """
    mimics: dict[str, Mimic] = {}
    locked = {**description.locked, **description.held}
    positions = dict(locked)
    if description.mimic == "free":
        return mimics, positions
    joints = description.joints
    followers = {
        joint.name: joint.mimic
        for joint in joints.values()
        if joint.mimic is not None
        and joint.type != "fixed"
        and joint.name not in locked
        and joint.name not in description.curves
    }
    resolved: dict[str, Mimic] = {}
    for name in followers:
        mimic = _end_of_chain(name, followers, joints, resolved)
        if mimic.leader in locked or joints[mimic.leader].type == "fixed":
            leader_position = locked.get(mimic.leader, 0.0)
            positions[name] = mimic.offset + mimic.multiplier * leader_position
        elif description.mimic == "lock" or mimic.multiplier == 0.0:
            positions[name] = mimic.offset
        else:
            mimics[name] = mimic
    return mimics, positions


def _end_of_chain(
    name: str,
    followers: Mapping[str, Mimic],
    joints: Mapping[str, Joint],
    resolved: dict[str, Mimic],
) -> Mimic:
    """Return the coupling of a joint to the end of its chain of mimics.

    `resolved` has earlier ones.
    """
    chain = [name]
    while name not in resolved and name in followers:
        _require_single(joints[name], chain)
        leader = followers[name].leader
        if leader not in joints:
            raise MimicJointError(
                f"joint '{name}': it mimics '{leader}', which is not a joint of this URDF. {_CURE}",
                [name],
            )
        if leader in chain:
            way = " → ".join(map(repr, [*chain, leader]))
            raise MimicJointError(f"joint '{leader}' mimics itself: {way}. {_CURE}", chain)
        chain.append(leader)
        name = leader
    _require_single(joints[name], chain)
    mimic = resolved.get(name, Mimic(name, 1.0, 0.0))
    for follower in chain[-2::-1]:
        mimic = resolved[follower] = _composed(follower, followers[follower], mimic)
    return mimic


def _require_single(joint: Joint, chain: list[str]) -> None:
    if joint.type not in (*SINGLE, "fixed"):
        raise MimicJointError(
            f"joint '{joint.name}' is {joint.type} in {' → '.join(map(repr, chain))}, "
            "where each mimics the next"
            f"; expected one degree of freedom. {_CURE}",
            chain,
        )


def _composed(name: str, mimic: Mimic, leaders: Mimic) -> Mimic:
    """Return the coupling of a mimic joint to an independent one, given that of its leader."""
    product = mimic.multiplier * leaders.multiplier
    offset = mimic.offset + mimic.multiplier * leaders.offset
    vanished = product == 0.0 and leaders.multiplier != 0.0 and mimic.multiplier != 0.0
    if vanished or not (abs(product) <= LARGEST and abs(offset) <= LARGEST):
        text = (
            f"joint '{name}' follows '{leaders.leader}' with multiplier {product:g} and offset "
            f"{offset:g}"
        )
        text += f"; expected numbers within {LARGEST:g} that do not vanish. {_CURE}"
        raise MimicJointError(text, [name, leaders.leader])
    return Mimic(leaders.leader, product, offset)


def coupled_groups(
    mimics: Mapping[str, Mimic], carriers: Mapping[str, str | None], closed: Iterable[Set[str]]
) -> dict[str, set[str]]:
    """Return the group of each joint that is eliminated together with others.

    The same set belongs to all of its members. A group is all moving joints from the lowest body
    that carries a source joint and its mimic joints, exclusive, down to these, or the joints of a
    `closed` loop. Groups that share a joint are one group. `carriers` has the joint that carries
    each moving joint, or None.
    """
    families: dict[str, list[str]] = {}
    for name, mimic in mimics.items():
        families.setdefault(mimic.leader, [mimic.leader]).append(name)
    groups: dict[str, set[str]] = {}
    lowest = [joints_between(family, carriers) for family in families.values()]
    for group in [*lowest, *map(set, closed)]:
        for joined in {id(groups[name]): groups[name] for name in group if name in groups}.values():
            group |= joined
        groups.update(dict.fromkeys(group, group))
    return groups


def path_to(name: str | None, carriers: Mapping[str, str | None]) -> set[str]:
    """Return a joint and all that carry it; no joint moves the world, None."""
    path = set()
    while name is not None:
        path.add(name)
        name = carriers[name]
    return path


def joints_between(family: Iterable[str], carriers: Mapping[str, str | None]) -> set[str]:
    """Return the joints of a family, and those up to the lowest joint that carries all of them."""
    paths = {name: path_to(name, carriers) for name in family}
    common = set.intersection(*(path - {name} for name, path in paths.items()))
    return set().union(*paths.values()) - common


# --- Values of mimic joints in messages


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
        self.tolerance, self.motion = tolerance, motion
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
        return [
            self.disagreement(k, measured[k], expected[k])
            for k, far in enumerate(distance > self.tolerance)
            if far
        ]

    def disagreement(self, k: int, measured: float, expected: float) -> str:
        """Text on follower k, whose position is not the expected one."""
        sources = ", ".join(map(repr, self._sources[self.names[k]]))
        return (
            f"position of joint '{self.names[k]}' is {measured:.9g}, "
            f"expected {expected:.9g} from {sources}, "
            f"which it follows, within mimic_tolerance = {self.tolerance:g}"
        )
