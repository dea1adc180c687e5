# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tree of a description as arrays: mimic joints are resolved, links that move as one are merged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Set
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from diag_dynamics import rotations
from diag_dynamics.arrays import Array
from diag_dynamics.description.description import (
    SINGLE,
    Description,
    Joint,
    Mimic,
    Payload,
)
from diag_dynamics.description.elements import LARGEST
from diag_dynamics.exceptions import MimicJointError, UrdfError
from diag_dynamics.model.joint_types import JOINT_TYPES, QUATERNION
from diag_dynamics.rigid_body import parallel_axes
from diag_dynamics.sweeps.records import BODY, LINK, VIRTUAL

if TYPE_CHECKING:
    from diag_dynamics.model.loops import Coupled

_UPPER = np.triu_indices(3)
_CURE = "The parameter mimic=free takes every joint as independent."


class MovingJoint:
    """A moving joint, the one that carries it or None, and its placement (4, 4) there."""

    def __init__(self, joint: Joint, carrier: str | None, placement: Array) -> None:
        self.joint = joint
        self.name = joint.name
        self.type = JOINT_TYPES[joint.type]
        self.carrier = carrier
        self.placement = placement
        self.dof_names = [self._named(suffix) for suffix, _ in self.type.freedoms]
        self.coordinate_names = [self._named(suffix) for suffix in self.type.coordinates]

    def _named(self, suffix: str) -> str:
        return f"{self.name}/{suffix}" if suffix else self.name


class Tree:
    """A description walked from its root, with positions of locked joints and mimics.

    `mimics` has a :class:`Mimic` by name. `joints` are independent, base to tip. Those of a coupled
    group come together, before what the group carries; `groups` has the names of all of its joints.
    `links` has each :class:`Link` with its body, and its placement (4, 4) in that body's frame.
    `start` are positions at which loops are closed first, otherwise those of `neutral`.
    """

    def __init__(
        self,
        description: Description,
        locked: Mapping[str, float],
        mimics: Mapping[str, Mimic],
        coupled: Coupled | None = None,
    ) -> None:
        self.description = description
        self.locked = locked
        self.mimics = mimics
        self.coupled = coupled
        self._followers = coupled.followers if coupled else {}
        self.joints: list[MovingJoint] = []
        self.groups: list[tuple[str, ...]] = []
        self._coordinates = self._dofs = 0
        self._records = [np.zeros((), BODY)]
        self.last_body: dict[str | None, int] = {None: 0}  # of each moving joint, by name
        self.moving: dict[str, MovingJoint] = {}
        places = self._merge_links()
        self._order = {link: k for k, link in enumerate(places)}
        self.carriers = {name: joint.carrier for name, joint in self.moving.items()}
        leaders = {name: mimic.leader for name, mimic in mimics.items()}
        closed: list[Set[str]] = []
        if coupled:
            leaders |= {name: curve.source for name, curve in coupled.curves.items()}
            closed += [*(group.joints for group in coupled.groups), *coupled.flexible.groups]
        groups = coupled_groups(leaders, self.carriers, closed)
        for block in self._blocks(groups):
            self._add_block(block)
            if block[0] in groups:
                self.groups.append(tuple(block))
        self.links = [
            (description.links[link], self.last_body[carrier], place)
            for link, (carrier, place) in places.items()
        ]
        self.dof_names = tuple(name for joint in self.joints for name in joint.dof_names)
        self.coordinate_names = tuple(
            name for joint in self.joints for name in joint.coordinate_names
        )
        suffixes = [suffix for joint in self.joints for suffix in joint.type.coordinates]
        self.orientations = tuple(
            QUATERNION.index(suffix) if suffix in QUATERNION else -1 for suffix in suffixes
        )
        _reject_duplicates("degrees of freedom", self.dof_names)
        _reject_duplicates("positions", self.coordinate_names)
        self.neutral = np.array([1.0 if index == 3 else 0.0 for index in self.orientations])
        self.start = self.neutral.copy()
        if coupled:
            for k, name in enumerate(self.coordinate_names):
                self.start[k] = coupled.start.get(name, self.start[k])

    def _merge_links(self) -> dict[str, tuple[str | None, Array]]:
        """Find the moving joints.

        Return the joint that moves each link, and the link's placement in its frame.
        """
        joints = self.description.joints
        root = self.description.root
        outboard: dict[str, list[Joint]] = {}
        # reversed, as a stack takes the last one first
        for joint in sorted(joints.values(), key=lambda joint: joint.name.encode(), reverse=True):
            outboard.setdefault(joint.parent, []).append(joint)
        base = None
        if self.description.floating_base:
            base = "root_joint"
            while base in joints:
                base += "_"
            joint = Joint(base, "floating", "", root, np.eye(4), np.zeros(3))
            self.moving[base] = MovingJoint(joint, None, np.eye(4))
        places: dict[str, tuple[str | None, Array]] = {root: (base, np.eye(4))}
        stack = list(outboard.get(root, ()))
        while stack:
            joint = stack.pop()
            stack += outboard.get(joint.child, ())
            carrier, placement = places[joint.parent]
            origin = placement @ joint.origin
            if joint.name in self.locked:
                origin = origin @ _displacement(joint, self.locked[joint.name])
            elif joint.type != "fixed":
                turn = np.eye(4)  # z of a body is the joint's axis
                if joint.type != "floating":
                    turn[:3, :3] = rotations.frame_about(joint.axis)
                self.moving[joint.name] = MovingJoint(joint, carrier, origin @ turn)
                carrier = joint.name
                origin = turn.T
            places[joint.child] = carrier, origin
        return places

    def _blocks(self, groups: Mapping[str, set[str]]) -> Iterator[list[str]]:
        """Yield the names of joints base to tip, depth first; those of a group come together."""
        carried: dict[str | None, list[str]] = {}
        rank = {name: k for k, name in enumerate(self.moving)}
        for name, joint in self.moving.items():
            carried.setdefault(joint.carrier, []).append(name)
        ahead = carried.get(None, [])[::-1]
        done = set[str]()
        while ahead:
            name = ahead.pop()
            if name in done:
                continue
            block = sorted(groups.get(name, {name}), key=rank.__getitem__)
            done.update(block)
            yield block
            for member in block[::-1]:
                ahead += [joint for joint in carried.get(member, ())[::-1] if joint not in done]

    @property
    def count(self) -> int:
        """The number of bodies, that of the world included."""
        return len(self._records)

    def first_body(self, name: str) -> int:
        """Return the first body of a moving joint."""
        last = self.last_body[name]
        return last - int(self._records[last]["rank"])

    def parent(self, body: int) -> int:
        """Return the body that carries another one."""
        return int(self._records[body]["parent"])

    def _add_block(self, block: list[str]) -> None:
        """Add the bodies of joints that are eliminated together."""
        first = self.count
        start = self._dofs
        for name in block:
            self._add_joint(self.moving[name])
        for record in self._records[first:]:
            record["first"] = first
            record["last"] = self.count - 1
            record["start"] = start
        for name in block:
            if name in self.mimics:
                mimic = self.mimics[name]
                record = self._records[self.last_body[name]]
                self._follow(record, mimic.leader)
                record["multiplier"] = mimic.multiplier
                record["offset"] = mimic.offset
            for rank, leader in enumerate(self._followers.get(name, ())):
                self._follow(self._records[self.first_body(name) + rank], leader)

    def _follow(self, record: npt.NDArray[np.void], leader: str) -> None:
        """Give a body the coordinate of another joint."""
        source = self._records[self.last_body[leader]]
        record["q"] = source["q"]
        record["dof"] = source["dof"]
        record["leader"] = self.last_body[leader]

    def _add_joint(self, joint: MovingJoint) -> None:
        """Add the bodies of a joint: one for each degree of freedom, or each source joint."""
        parent = self.last_body[joint.carrier]
        placement = joint.placement
        leaders = self._followers.get(joint.name, ())
        directions = [direction for _, direction in joint.type.freedoms] * max(1, len(leaders))
        for rank, direction in enumerate(directions):
            body = np.zeros((), BODY)
            index = self.count
            body["parent"] = parent
            body["direction"] = direction
            body["kind"] = VIRTUAL if leaders and rank else joint.type.kind
            body["dofs"] = len(directions)
            body["rank"] = rank
            if not leaders:
                body["q"] = self._coordinates
                body["dof"] = self._dofs + rank
                body["leader"] = index
                body["multiplier"] = 1.0
            body["link"] = self._order[joint.joint.child]
            body["rotation"] = placement[:3, :3].ravel()
            body["translation"] = placement[:3, 3]
            parent = index
            placement = np.eye(4)
            self._records.append(body)
        self.last_body[joint.name] = parent
        if not leaders and joint.name not in self.mimics:
            self._coordinates += len(joint.type.coordinates)
            self._dofs += len(joint.type.freedoms)
            self.joints.append(joint)

    def per_dof(self, field: str, part: str = "freedoms") -> Array:
        """Return a field of joints for each degree of freedom, or for each of their coordinates."""
        counts = [len(getattr(joint.type, part)) for joint in self.joints]
        return np.repeat([float(getattr(x.joint, field)) for x in self.joints], counts)

    def of_followers(self, field: str) -> Array:
        """Return a field of joints that follow others by changing ratios."""
        return np.array([getattr(self.moving[name].joint, field) for name in self._followers])

    def reflected(self, field: str, exponent: float | None = None) -> Array:
        """Return a field by degree of freedom, with that of mimic joints.

        A mimic joint counts times its multiplier, or times |multiplier|^exponent.
        """
        values = self.per_dof(field)
        for name, mimic in self.mimics.items():
            factor = mimic.multiplier if exponent is None else abs(mimic.multiplier) ** exponent
            dof = self._records[self.last_body[name]]["dof"]
            values[dof] += getattr(self.moving[name].joint, field) * factor
        return values

    def records(
        self, payloads: Mapping[str, Payload]
    ) -> tuple[npt.NDArray[np.void], npt.NDArray[np.void]]:
        """Return the arrays of bodies and links, with payloads by link."""
        links = self._link_records(payloads)
        bodies = np.array(self._records, BODY)
        for name, joint in self.moving.items():
            first = self.first_body(name) if name in self._followers else self.last_body[name]
            bodies["armature"][first : self.last_body[name] + 1] = joint.joint.reflected_inertia
        for part in ("mass", "first_moment", "inertia"):
            np.add.at(bodies[part], links["body"], links[part])
        return bodies, links

    def _link_records(self, payloads: Mapping[str, Payload]) -> npt.NDArray[np.void]:
        """Return the records of links with inertia, payloads included."""
        records = []
        for index, (link, body, placement) in enumerate(self.links):
            inertials = [link.inertial] if link.inertial is not None else []
            if link.name in payloads:
                inertials.append(payloads[link.name].inertial)
            mass = 0.0
            first_moment = np.zeros(3)
            inertia = np.zeros((3, 3))
            for part in inertials:
                centre = placement @ part.placement
                R = centre[:3, :3]
                c = centre[:3, 3]
                mass += part.mass
                first_moment = first_moment + part.mass * c
                inertia = inertia + (R @ part.inertia @ R.T + parallel_axes(part.mass, c))
            if mass or np.any(inertia):
                records.append((body, index, mass, first_moment, inertia[_UPPER]))
        return np.array(records, LINK)


def _reject_duplicates(kind: str, names: tuple[str, ...]) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise UrdfError(f"Two {kind} would have the name '{name}': rename one of the joints.")


def _displacement(joint: Joint, position: float) -> Array:
    """Return the 4x4 displacement of a joint of one degree of freedom."""
    axis = joint.axis / np.linalg.norm(joint.axis)
    if joint.type == "prismatic":
        return rotations.pose(position * axis)
    frame = rotations.frame_about(axis)
    turn = rotations.from_rpy(0.0, 0.0, position)
    return rotations.pose(np.zeros(3), frame @ turn @ frame.T)


# --- Mimic joints: the source joint of each chain, and groups that are eliminated together


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
    for name in followers:
        mimic = _end_of_chain(name, followers, joints)
        if mimic.leader in locked or joints[mimic.leader].type == "fixed":
            leader_position = locked.get(mimic.leader, 0.0)
            positions[name] = mimic.offset + mimic.multiplier * leader_position
        elif description.mimic == "lock" or mimic.multiplier == 0.0:
            positions[name] = mimic.offset
        else:
            mimics[name] = mimic
    return mimics, positions


def _end_of_chain(name: str, followers: Mapping[str, Mimic], joints: Mapping[str, Joint]) -> Mimic:
    """Return the coupling of a joint to the end of its chain of mimics."""
    chain = [name]
    _require_single(joints[name], chain)
    while chain[-1] in followers:
        follower = chain[-1]
        leader = followers[follower].leader
        if leader not in joints:
            raise MimicJointError(
                f"joint '{follower}' mimics '{leader}'; expected a joint of this URDF. {_CURE}",
                [follower],
            )
        if leader in chain:
            way = " → ".join(map(repr, [*chain, leader]))
            raise MimicJointError(f"joint '{leader}' mimics itself: {way}. {_CURE}", chain)
        chain.append(leader)
        _require_single(joints[leader], chain)
    multiplier = 1.0
    offset = 0.0
    for follower in chain[-2::-1]:
        mimic = followers[follower]
        multiplier = mimic.multiplier * multiplier
        offset = mimic.offset + mimic.multiplier * offset
    vanishes = multiplier == 0.0 and all(followers[joint].multiplier for joint in chain[:-1])
    if vanishes or not (abs(multiplier) <= LARGEST and abs(offset) <= LARGEST):
        raise MimicJointError(
            f"joint '{name}' follows '{chain[-1]}' with multiplier {multiplier:g} and offset "
            f"{offset:g}; expected numbers within {LARGEST:g} that do not vanish. {_CURE}",
            [name, chain[-1]],
        )
    return Mimic(chain[-1], multiplier, offset)


def _require_single(joint: Joint, chain: list[str]) -> None:
    if joint.type not in (*SINGLE, "fixed"):
        raise MimicJointError(
            f"joint '{joint.name}' is {joint.type} in {' → '.join(map(repr, chain))}, "
            "where each mimics the next"
            f"; expected one degree of freedom. {_CURE}",
            chain,
        )


def coupled_groups(
    leaders: Mapping[str, str], carriers: Mapping[str, str | None], closed: Iterable[Set[str]]
) -> dict[str, set[str]]:
    """Return the group of each joint that is eliminated together with others.

    The same set belongs to all of its members. A group is all moving joints from the lowest body
    that carries a source joint and its mimic joints, exclusive, down to these, or the joints of a
    `closed` loop. Groups that share a joint are one group. `carriers` has the joint that carries
    each moving joint, or None.
    """
    families: dict[str, list[str]] = {}
    for name, leader in leaders.items():
        families.setdefault(leader, [leader]).append(name)
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
