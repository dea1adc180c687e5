# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tree of a checked URDF as arrays; links that move as one are merged."""

from collections import Counter

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.exceptions import UrdfError
from diag_dynamics.model.joint_types import JOINT_TYPES, QUATERNION
from diag_dynamics.model.mimic import Mimic, coupled_groups
from diag_dynamics.rigid_body import parallel_axes
from diag_dynamics.sweeps.records import BODY, LINK, VIRTUAL

_UPPER = np.triu_indices(3)


class MovingJoint:
    """A moving joint, its carrier or None, and its placement (4, 4) there; `joint` is None for a floating base."""

    def __init__(self, name, kind, carrier, placement, joint=None):
        self.name, self.kind, self.type = name, kind, JOINT_TYPES[kind]
        self.carrier, self.placement, self.joint = carrier, placement, joint
        self.dof_names, self.coordinate_names = (
            [f"{name}/{suffix}" if suffix else name for suffix in suffixes]
            for suffixes in ([suffix for suffix, _ in self.type.freedoms], self.type.coordinates)
        )

    def number(self, element, attribute, default):
        """Return a number of a child element in the URDF."""
        value = getattr(getattr(self.joint, element, None), attribute, None)
        return default if value is None else float(value)

    def limit(self, attribute, default):
        """Return a position limit in the URDF."""
        return (
            self.number("limit", attribute, default)
            if self.kind in ("revolute", "prismatic")
            else default
        )


class Tree:
    """A robot (yourdfpy.Robot) walked from its root, with positions of locked joints and :class:`Mimic` by name.

    `joints` are independent, base to tip. Those of a coupled group come together, before what the
    group carries; `groups` has the names of all of its joints, `group_sizes` its number of bodies.
    `links` has each link (yourdfpy.Link) with its body, and its placement (4, 4) in that body's
    frame.
    """

    def __init__(self, robot, root, floating_base, locked, mimics, coupled=None):
        self.robot, self.root, self.floating_base = robot, root, floating_base
        self.locked, self.mimics, self.coupled = locked, mimics, coupled
        self._followers = coupled.followers if coupled else {}
        self.joints, self.groups, self.group_sizes = [], [], []
        self._coordinates = self._dofs = 0
        self._records = [np.zeros((), BODY)]
        self.last_body = {None: 0}  # of each moving joint, by name
        self.moving = {}
        places = self._merge_links()
        self._order = {link: k for k, link in enumerate(places)}
        carriers = {name: joint.carrier for name, joint in self.moving.items()}
        ratios = (
            mimics | {name: Mimic(curve.source, 0.0, 0.0) for name, curve in coupled.curves.items()}
            if coupled
            else mimics
        )
        closed = (
            [*(group.joints for group in coupled.groups), *coupled.flexible.groups]
            if coupled
            else ()
        )
        groups = coupled_groups(ratios, carriers, closed)
        for block in self._blocks(groups):
            self._add_block(block)
            if block[0] in groups:
                self.groups.append(tuple(block))
                sizes = (
                    len(self._followers.get(name, self.moving[name].type.freedoms))
                    for name in block
                )
                self.group_sizes.append(sum(sizes))
        links = {link.name: link for link in robot.links}
        self.links = [
            (links[link], self.last_body[carrier], place)
            for link, (carrier, place) in places.items()
        ]
        self.dof_names = tuple(name for joint in self.joints for name in joint.dof_names)
        self.coordinate_names = tuple(
            name for joint in self.joints for name in joint.coordinate_names
        )
        suffixes = [suffix for j in self.joints for suffix in j.type.coordinates]
        self.orientations = tuple(
            QUATERNION.index(suffix) if suffix in QUATERNION else -1 for suffix in suffixes
        )
        for what, names in (
            ("degrees of freedom", self.dof_names),
            ("positions", self.coordinate_names),
        ):
            [(name, count)] = Counter(names).most_common(1) or [("", 0)]
            if count > 1:
                raise UrdfError(
                    f"Two {what} would have the name '{name}': rename one of the joints."
                )

    def _merge_links(self):
        """Find the moving joints; return the joint that moves each link, and the link's placement in its frame."""
        outboard = {}
        for joint in sorted(self.robot.joints, key=lambda joint: joint.name.encode(), reverse=True):
            outboard.setdefault(joint.parent, []).append(
                joint
            )  # reversed, as a stack takes the last one first
        base = None
        if self.floating_base:
            base, taken = "root_joint", {joint.name for joint in self.robot.joints}
            while base in taken:
                base += "_"
            self.moving[base] = MovingJoint(base, "floating", None, np.eye(4))
        places = {self.root: (base, np.eye(4))}
        stack = list(outboard.get(self.root, ()))
        while stack:
            joint = stack.pop()
            stack += outboard.get(joint.child, ())
            carrier, placement = places[joint.parent]
            origin = placement if joint.origin is None else placement @ joint.origin
            if joint.name in self.locked:
                origin = origin @ _displacement(joint, self.locked[joint.name])
            elif joint.type != "fixed":
                turn = np.eye(4)  # z of a body is the joint's axis
                if joint.type != "floating":
                    turn[:3, :3] = rotations.frame_about(joint.axis)
                self.moving[joint.name] = MovingJoint(
                    joint.name, joint.type, carrier, origin @ turn, joint
                )
                carrier, origin = joint.name, turn.T
            places[joint.child] = carrier, origin
        return places

    def _blocks(self, groups):
        """Yield the names of joints base to tip, depth first; those of a group come together."""
        carried, rank = {}, {name: k for k, name in enumerate(self.moving)}
        for name, joint in self.moving.items():
            carried.setdefault(joint.carrier, []).append(name)
        ahead, done = carried.get(None, [])[::-1], set()
        while ahead:
            name = ahead.pop()
            if name in done:
                continue
            block = sorted(groups.get(name, (name,)), key=rank.__getitem__)
            done.update(block)
            yield block
            ahead += [
                one
                for member in block[::-1]
                for one in carried.get(member, ())[::-1]
                if one not in done
            ]

    @property
    def count(self):
        """The number of bodies, that of the world included."""
        return len(self._records)

    def first_body(self, name):
        """Return the first body of a moving joint."""
        last = self.last_body[name]
        return last - int(self._records[last]["rank"])

    def parent(self, body):
        """Return the body that carries another one."""
        return int(self._records[body]["parent"])

    def _add_block(self, block):
        """Add the bodies of joints that are eliminated together."""
        first, start = len(self._records), self._dofs
        for name in block:
            if name in self._followers:
                self._add_follower(self.moving[name])
            else:
                self._add_joint(self.moving[name])
        for record in self._records[first:]:
            record["first"], record["last"], record["start"] = first, len(self._records) - 1, start
        for name in block:
            if name in self.mimics:
                leader, multiplier, offset = self.mimics[name]
                record, led = (
                    self._records[self.last_body[name]],
                    self._records[self.last_body[leader]],
                )
                record["q"], record["dof"], record["leader"] = (
                    led["q"],
                    led["dof"],
                    self.last_body[leader],
                )
                record["multiplier"], record["offset"] = multiplier, offset
            for rank, leader in enumerate(self._followers.get(name, ())):
                record, led = (
                    self._records[self.first_body(name) + rank],
                    self._records[self.last_body[leader]],
                )
                record["q"], record["dof"], record["leader"] = (
                    led["q"],
                    led["dof"],
                    self.last_body[leader],
                )

    def _add_follower(self, joint):
        """Add a body of a joint for each independent joint that it follows."""
        parent, placement, leaders = (
            self.last_body[joint.carrier],
            joint.placement,
            self._followers[joint.name],
        )
        for rank in range(len(leaders)):
            body = np.zeros((), BODY)
            body["parent"], body["direction"] = parent, joint.type.freedoms[0][1]
            body["kind"] = VIRTUAL if rank else joint.type.kind
            body["dofs"], body["rank"] = len(leaders), rank
            body["link"] = self._order[joint.joint.child]
            body["rotation"], body["translation"] = placement[:3, :3].ravel(), placement[:3, 3]
            parent, placement = len(self._records), np.eye(4)
            self._records.append(body)
        self.last_body[joint.name] = parent

    def _add_joint(self, joint):
        """Add the bodies of a joint, one for each degree of freedom."""
        parent, placement = self.last_body[joint.carrier], joint.placement
        for rank, (_, direction) in enumerate(joint.type.freedoms):
            body, own = np.zeros((), BODY), len(self._records)
            body["parent"], body["direction"] = parent, direction
            body["kind"], body["dofs"], body["rank"] = (
                joint.type.kind,
                len(joint.type.freedoms),
                rank,
            )
            body["q"], body["dof"] = self._coordinates, self._dofs + rank
            body["leader"], body["multiplier"] = own, 1.0
            body["link"] = self._order[joint.joint.child if joint.joint else self.root]
            body["rotation"], body["translation"] = placement[:3, :3].ravel(), placement[:3, 3]
            parent, placement = own, np.eye(4)
            self._records.append(body)
        self.last_body[joint.name] = parent
        if joint.name not in self.mimics:
            self._coordinates += len(joint.type.coordinates)
            self._dofs += len(joint.type.freedoms)
            self.joints.append(joint)

    def per_dof(self, element, attribute, default):
        """Return a number of the URDF for each degree of freedom; those of one joint share it."""
        return np.array(
            [
                joint.number(element, attribute, default)
                for joint in self.joints
                for _ in joint.type.freedoms
            ],
            float,
        )

    def limits(self, attribute, default):
        """Return a position limit for each coordinate; continuous joints and those of several coordinates have none."""
        values = []
        for joint in self.joints:
            values += [joint.limit(attribute, default)] * len(joint.type.coordinates)
        return np.array(values, float)

    def of_followers(self, attribute):
        """Return damping or friction of joints that follow others by changing ratios."""
        return np.array(
            [self.moving[name].number("dynamics", attribute, 0.0) for name in self._followers]
        )

    def resistance(self, attribute, exponent):
        """Return damping or friction of each degree of freedom, with that of mimic joints times |multiplier|^exponent."""
        values = self.per_dof("dynamics", attribute, 0.0)
        for name, mimic in self.mimics.items():
            own = self.moving[name].number("dynamics", attribute, 0.0)
            values[self._records[self.last_body[name]]["dof"]] += (
                own * abs(mimic.multiplier) ** exponent
            )
        return values

    def reflected(self, efforts, exponent=None):
        """Return efforts of degrees of freedom, with those of mimic joints times multipliers, or |multiplier|^exponent."""
        values = np.zeros(self._dofs)
        for name, effort in efforts.items():
            if name in self.last_body:
                record = self._records[self.last_body[name]]
                factor = (
                    record["multiplier"]
                    if exponent is None
                    else abs(record["multiplier"]) ** exponent
                )
                values[record["dof"]] += effort * factor
        return values

    def records(self, armature, payloads):
        """Return the arrays of bodies and links, given rotor inertias by joint [kg m², kg] and payloads by link."""
        links = self._link_records(payloads)
        bodies = np.array(self._records, BODY)
        for name in self.moving:
            first = self.first_body(name) if name in self._followers else self.last_body[name]
            bodies["armature"][first : self.last_body[name] + 1] = armature.get(name, 0.0)
        for part in ("mass", "first_moment", "inertia"):
            np.add.at(bodies[part], links["body"], links[part])
        return bodies, links

    def _link_records(self, payloads):
        """Return the records of links with inertia, payloads included."""
        records = []
        for index, (link, body, placement) in enumerate(self.links):
            parts = []
            if link.inertial is not None:
                own = (
                    placement if link.inertial.origin is None else placement @ link.inertial.origin
                )
                parts.append(_about_origin(own, link.inertial.mass, link.inertial.inertia))
            if link.name in payloads:
                mass, centre, about_centre = payloads[link.name]
                parts.append(_about_origin(placement @ _translation(centre), mass, about_centre))
            if parts:
                mass, first_moment, inertia = (sum(values) for values in zip(*parts, strict=True))
                if mass or np.any(inertia):
                    records.append((body, index, mass, first_moment, inertia[_UPPER]))
        return np.array(records, LINK)


def _about_origin(centre, mass, inertia):
    """Return mass, first moment and inertia about the origin, given the 4x4 placement of the centre of mass."""
    R, c = centre[:3, :3], centre[:3, 3]
    return mass, mass * c, R @ inertia @ R.T + parallel_axes(mass, c)


def _translation(vector):
    placement = np.eye(4)
    placement[:3, 3] = vector
    return placement


def _displacement(joint, position):
    """Return the 4x4 displacement of a joint of one degree of freedom."""
    axis = np.asarray(joint.axis, dtype=float) / np.linalg.norm(joint.axis)
    if joint.type == "prismatic":
        return _translation(position * axis)
    turn = np.eye(4)
    frame = rotations.frame_about(axis)
    c, s = np.cos(position), np.sin(position)
    turn[:3, :3] = frame @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ frame.T
    return turn
