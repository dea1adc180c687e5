# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mimic joints: the independent joint that each follows in the end, and those that are locked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from heapq import heapify, heappop, heappush, heapreplace
from typing import Any, NamedTuple, TypeAlias

from diag_dynamics.exceptions import MimicJointError
from diag_dynamics.model.joint_types import SINGLE
from diag_dynamics.model.origins import LARGEST

_CURE = "mimic='free' takes every joint as independent."

_End: TypeAlias = tuple[Any, float, float]
"""A joint of yourdfpy's at the end of a chain, with multiplier and offset."""


class Mimic(NamedTuple):
    """Coupling of a joint to its leader: position = multiplier · leader's position + offset.

    Attributes
    ----------
    leader : str
        Name of an independent joint.
    multiplier : float
        [rad/rad, or as the joints are, m/rad, rad/m].
    offset : float
        [rad, m].
    """

    leader: str
    multiplier: float
    offset: float


def resolve_mimics(robot: Any, mode: str, locked: Mapping[str, float]) -> tuple[dict[str, Mimic], dict[str, float]]:
    """Followers of independent joints, and the positions of all joints that are held.

    Parameters
    ----------
    robot : yourdfpy.Robot
    mode : {"embed", "free", "lock"}
    locked : dict
        Positions of joints that are held [rad, m].

    Returns
    -------
    mimics : dict
        :class:`Mimic` by name of the follower; none unless `mode` is "embed".
    held : dict
        `locked`, and with it the followers that stand still: all of them where `mode` is "lock", those of a joint that is
        held or fixed, and those whose multipliers come to 0. "free" holds no follower.
    """
    mimics: dict[str, Mimic] = {}
    held = dict(locked)
    if mode == "free":
        return mimics, held
    joints = {joint.name: joint for joint in robot.joints}
    ends: dict[str, _End] = {}
    for joint in robot.joints:
        if not _follows(joint, locked):
            continue
        leader, multiplier, offset = _followed(joint, joints, locked, ends)
        if leader.name in locked or leader.type == "fixed":
            held[joint.name] = offset + multiplier * locked.get(leader.name, 0.0)
        elif mode == "lock" or multiplier == 0.0:
            held[joint.name] = offset
        else:
            mimics[joint.name] = Mimic(leader.name, multiplier, offset)
    return mimics, held


def _follows(joint: Any, locked: Mapping[str, float]) -> bool:
    return joint.mimic is not None and joint.name not in locked and joint.type != "fixed"


def _followed(joint: Any, joints: Mapping[str, Any], locked: Mapping[str, float], ends: dict[str, _End]) -> _End:
    """The joint at the end of a chain of mimics, with multiplier and offset; `ends` keeps those that are known."""
    chain, on_the_way = [joint.name], {joint.name}
    while joint.name not in ends and _follows(joint, locked):
        _require_single(joint, chain)
        leader = joint.mimic.joint
        if leader not in joints:
            raise MimicJointError(
                f"joint '{joint.name}': it mimics '{leader}', which is not a joint of this URDF. {_CURE}", [joint.name]
            )
        if leader in on_the_way:
            raise MimicJointError(
                f"joint '{leader}' mimics itself: {' → '.join(map(repr, [*chain, leader]))}. {_CURE}", chain
            )
        joint = joints[leader]
        chain.append(leader)
        on_the_way.add(leader)
    _require_single(joint, chain)
    end: _End = ends.get(joint.name, (joint, 1.0, 0.0))
    for name in reversed(chain[:-1]):
        end = ends[name] = _led(joints[name], *end)
    return end


def _led(joint: Any, leader: Any, multiplier: float, offset: float) -> _End:
    """Leader, multiplier and offset of a follower, from those of the joint that it names."""
    own = joint.mimic
    factor = 1.0 if own.multiplier is None else own.multiplier
    product = factor * multiplier
    offset = (own.offset or 0.0) + factor * offset
    vanished = product == 0.0 and multiplier != 0.0 and factor != 0.0
    if vanished or not (abs(product) <= LARGEST and abs(offset) <= LARGEST):
        raise MimicJointError(
            f"joint '{joint.name}' follows '{leader.name}' with multiplier {product:g} and offset {offset:g}: these are "
            f"beyond {LARGEST:g}, or vanish. {_CURE}",
            [joint.name, leader.name],
        )
    return leader, product, offset


def _require_single(joint: Any, chain: list[str]) -> None:
    if joint.type not in (*SINGLE, "fixed"):
        follows = f"joint '{chain[-2]}' mimics it" if len(chain) > 1 else "it mimics another joint"
        raise MimicJointError(
            f"joint '{joint.name}' is {joint.type}, and {follows}: that takes joints of one degree of freedom. {_CURE}",
            chain,
        )


def coupled_groups(
    mimics: Mapping[str, Mimic], joints: Iterable[str], carriers: Mapping[str, str | None]
) -> dict[str, frozenset[str]]:
    """Joints that are eliminated together: from the lowest body that carries all of a coupling down to its members.

    Groups that share a body are one group.

    Parameters
    ----------
    mimics : dict
        :class:`Mimic` by name of the follower.
    joints : iterable of str
        All moving joints.
    carriers : dict
        Moving joint that carries each moving joint, or None.

    Returns
    -------
    dict
        The group, a frozenset of names, of each joint that is in one.
    """
    families: dict[str, list[str]] = {}
    for follower, mimic in mimics.items():
        families.setdefault(mimic.leader, [mimic.leader]).append(follower)
    sets = _Sets(joints, carriers)
    for names in families.values():
        sets.couple(names)
    return sets.groups()


class _Sets:
    """Disjoint sets of joints, each with the one that carries it."""

    def __init__(self, joints: Iterable[str], carriers: Mapping[str, str | None]) -> None:
        self._carriers = carriers
        self._place: dict[str | None, int] = {None: -1}
        self._depth: dict[str | None, int] = {None: 0}
        for k, name in enumerate(joints):
            self._place[name], self._depth[name] = k, self._depth[carriers[name]] + 1
        self._parent: dict[str, str] = {}
        self._members: dict[str, list[str]] = {}
        self._carrier: dict[str, str | None] = {}

    def _of(self, name: str) -> str:
        """The set of a joint, which is its own where it has not been in any yet."""
        if name not in self._parent:
            self._parent[name], self._members[name], self._carrier[name] = name, [name], self._carriers[name]
        while self._parent[name] != name:
            self._parent[name] = self._parent[self._parent[name]]
            name = self._parent[name]
        return name

    def _join(self, a: str, b: str) -> str:
        """Make one of two sets of which one is carried by the other, or both by the same joint; returns it."""
        carrier = min(self._carrier[a], self._carrier[b], key=self._depth.__getitem__)
        large, small = (a, b) if len(self._members[a]) >= len(self._members[b]) else (b, a)
        self._parent[small] = large
        self._members[large] += self._members.pop(small)
        self._carrier[large] = carrier
        return large

    def _entry(self, one: str) -> tuple[int, int, str]:
        carrier = self._carrier[one]
        return -self._depth[carrier], self._place[carrier], one

    def couple(self, names: Iterable[str]) -> None:
        """Merge the sets of some joints and of all joints between them; the set with the deepest carrier goes on first."""
        heap = [self._entry(one) for one in {self._of(name) for name in names}]
        heapify(heap)
        while len(heap) > 1:
            entry = heappop(heap)
            one, other = entry[-1], heap[0][-1]
            if one == other or entry != self._entry(self._of(one)):
                continue  # merged already: another entry stands for this set
            if heap[0] != self._entry(self._of(other)):
                heapreplace(heap, entry)  # an outdated entry on top: take it out, and look again
                continue
            carrier = self._carrier[one]
            if carrier is None or carrier == self._carrier[other]:  # None: that of both, for the deepest one goes first
                heappop(heap)
            else:
                other = self._of(carrier)
            heappush(heap, self._entry(self._join(one, other)))

    def groups(self) -> dict[str, frozenset[str]]:
        """The set of each joint that is in one."""
        found: dict[str, frozenset[str]] = {}
        for members in self._members.values():
            found.update(dict.fromkeys(members, frozenset(members)))
        return found
