# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tree of a checked URDF as arrays; links that move as one are merged."""

from collections import Counter

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.model.joint_types import JOINT_TYPES, QUATERNION
from diag_dynamics.model.mimic import coupled_groups
from diag_dynamics.rigid_body import parallel_axes
from diag_dynamics.sweeps.records import BODY, LINK

_UPPER = np.triu_indices(3)


def refuse_same_names(what, names):
    """Reject names of which two are the same."""
    if len(set(names)) < len(names):
        [(twice, _)] = Counter(names).most_common(1)
        raise UrdfError(f"Two {what} would have the name '{twice}': rename one of the joints.")


class MovingJoint:
    """A moving joint: name, type by name and as a JointType, and joint of the URDF (None for a floating base)."""

    def __init__(self, name, kind, joint=None):
        self.name, self.kind, self.joint = name, kind, joint
        self.type = JOINT_TYPES[kind]

    def _named(self, suffixes):
        return tuple(f"{self.name}/{suffix}" if suffix else self.name for suffix in suffixes)

    @property
    def dof_names(self):
        """Names of degrees of freedom."""
        return self._named(suffix for suffix, _ in self.type.freedoms)

    @property
    def coordinate_names(self):
        """Names of position coordinates."""
        return self._named(self.type.coordinates)

    @property
    def is_single(self):
        """Whether it has one degree of freedom."""
        return len(self.type.freedoms) == 1

    def number(self, element, attribute, default):
        """Return a number of a child element in the URDF."""
        value = getattr(getattr(self.joint, element, None), attribute, None)
        return default if value is None else float(value)


class Tree:
    """A robot walked from its root.

    Parameters
    ----------
    robot : yourdfpy.Robot
    root : str
    floating_base : bool
    locked : dict
        Positions [rad, m] of locked joints of one degree of freedom.
    mimics : dict
        :class:`Mimic` by name; their leaders are neither fixed nor locked.

    Attributes
    ----------
    joints : list of MovingJoint
        Independent joints, base to tip; those of a coupled group come together, before what the group carries.
    groups : list of tuple of str
        Joints of each coupled group, base to tip.
    group_sizes : list of int
        Bodies of each of them.
    links : list of (yourdfpy.Link, int, ndarray)
        Each link with its body and its 4x4 placement in that body's frame.
    """

    def __init__(self, robot, root, floating_base=False, locked=None, mimics=None):
        self.robot, self.root = robot, root
        self.floating_base, self.locked, self.mimics = floating_base, dict(locked or {}), dict(mimics or {})
        self.joints, self.groups, self.group_sizes, self.links = [], [], [], []
        self._records = [np.zeros((), BODY)]
        self._coordinates = self._dofs = 0
        self._body = {}  # last body of each moving joint, by name
        self._link = {link.name: link for link in robot.links}
        self._outboard = {}
        for joint in sorted(robot.joints, key=lambda joint: joint.name.encode(), reverse=True):
            self._outboard.setdefault(joint.parent, []).append(joint)  # reversed, as a stack takes the last one first
        self._order = {name: k for k, name in enumerate(self._depth_first())}
        self._walk(coupled_groups(self.mimics, *self._carriers()))

    def _depth_first(self):
        """Names of all links."""
        stack = [self.root]
        while stack:
            link = stack.pop()
            yield link
            stack.extend(joint.child for joint in self._outboard.get(link, ()))

    def _moves(self, joint):
        return joint.type != "fixed" and joint.name not in self.locked

    def _carriers(self):
        """Return the moving joints, and of each the one that carries it, or None."""
        inboard = {joint.child: joint for joint in self.robot.joints}
        carrier_of_link, carriers = {self.root: None}, {}
        for link in list(self._order)[1:]:
            joint = inboard[link]
            carrier = carrier_of_link[joint.parent]
            if self._moves(joint):
                carriers[joint.name] = carrier
                carrier = joint.name
            carrier_of_link[link] = carrier
        return list(carriers), carriers

    def _walk(self, group_of):
        body, placement = 0, np.eye(4)
        if self.floating_base:
            body, placement = self._add_joint(MovingJoint(self._base_name(), "floating"), 0, placement)
        waiting = {}  # joints of each group that leave its carrier
        ahead = self._note_groups(self._add_links(self.root, body, placement), group_of, waiting)
        while ahead:
            joint, body, origin = ahead.pop()
            if joint.name in self._body:
                continue  # added with its group
            if joint.name in group_of:
                leaving = self._add_group(group_of[joint.name], waiting)
            else:
                freedom = MovingJoint(joint.name, joint.type, joint)
                leaving = self._add_links(joint.child, *self._add_joint(freedom, body, origin))
            ahead += self._note_groups(leaving, group_of, waiting)
        self.links.sort(key=lambda entry: self._order[entry[0].name])

    def _add_links(self, link, body, placement):
        """Add a link and all that move with it; return the moving joints that leave them, the first one last."""
        stack, leaving = [(link, placement)], []
        while stack:
            link, placement = stack.pop()
            if not isinstance(link, str):
                leaving.append((link, body, placement))
                continue
            self.links.append((self._link[link], body, placement))
            for joint in self._outboard.get(link, ()):
                origin = placement if joint.origin is None else placement @ joint.origin
                if self._moves(joint):
                    stack.append((joint, origin))
                elif joint.name in self.locked:
                    stack.append((joint.child, origin @ _displacement(joint, self.locked[joint.name])))
                else:
                    stack.append((joint.child, origin))
        return leaving[::-1]

    def _note_groups(self, leaving, group_of, waiting):
        """Note the joints of groups among those that leave a body."""
        for entry in leaving:
            if entry[0].name in group_of:
                waiting.setdefault(group_of[entry[0].name], []).append(entry)
        return leaving

    def _add_group(self, group, waiting):
        """Add all bodies of a coupled group; return the moving joints that leave them, the first one last."""
        first, start, names = len(self._records), self._dofs, []
        stack = waiting.pop(group)
        carried = []
        while stack:
            joint, body, origin = stack.pop()
            names.append(joint.name)
            freedom = MovingJoint(joint.name, joint.type, joint)
            leaving = self._add_links(joint.child, *self._add_joint(freedom, body, origin))
            stack += [entry for entry in leaving if entry[0].name in group]
            carried.append([entry for entry in leaving if entry[0].name not in group])
        for record in self._records[first:]:
            record["first"], record["last"], record["start"] = first, len(self._records) - 1, start
        for name in names:
            if name in self.mimics:
                leader, multiplier, offset = self.mimics[name]
                follower, led = self._records[self._body[name]], self._records[self._body[leader]]
                follower["q"], follower["dof"], follower["leader"] = led["q"], led["dof"], self._body[leader]
                follower["multiplier"], follower["offset"] = multiplier, offset
        self.groups.append(tuple(names))
        self.group_sizes.append(len(self._records) - first)
        return [entry for leaving in reversed(carried) for entry in leaving]

    def _base_name(self):
        name, taken = "root_joint", {joint.name for joint in self.robot.joints}
        while name in taken:
            name += "_"
        return name

    def _add_joint(self, freedom, parent, origin):
        """Add the bodies of a joint, whose z is its axis; return the last one, and the link's placement in it."""
        turn = np.eye(4)
        if freedom.kind != "floating":
            turn[:3, :3] = rotations.frame_about(freedom.joint.axis)
        placement = origin @ turn
        directions = [direction for _, direction in freedom.type.freedoms]
        first, follows = len(self._records), freedom.name in self.mimics
        for rank, direction in enumerate(directions):
            body, own = np.zeros((), BODY), len(self._records)
            body["parent"], body["direction"] = parent, direction
            body["kind"], body["dofs"], body["rank"] = freedom.type.kind, len(directions), rank
            body["q"] = self._coordinates
            body["dof"], body["leader"], body["multiplier"] = self._dofs + rank, own, 1.0
            body["first"], body["last"], body["start"] = first, first + len(directions) - 1, self._dofs
            body["link"] = self._order[freedom.joint.child if freedom.joint else self.root]
            body["rotation"], body["translation"] = placement[:3, :3].ravel(), placement[:3, 3]
            parent, placement = own, np.eye(4)
            self._records.append(body)
        self._body[freedom.name] = parent
        if not follows:
            self._coordinates += len(freedom.type.coordinates)
            self._dofs += len(directions)
            self.joints.append(freedom)
        return parent, turn.T

    @property
    def dof_names(self):
        """Names of all degrees of freedom."""
        return tuple(name for joint in self.joints for name in joint.dof_names)

    @property
    def coordinate_names(self):
        """Names of all position coordinates."""
        return tuple(name for joint in self.joints for name in joint.coordinate_names)

    @property
    def orientations(self):
        """For each position coordinate, which component of a quaternion it is (x y z w: 0 to 3), or -1."""
        return tuple(
            QUATERNION.index(suffix) if suffix in QUATERNION else -1
            for joint in self.joints
            for suffix in joint.type.coordinates
        )

    def of_type(self, kind):
        """Names of the URDF's joints of a type, in its order."""
        return tuple(joint.name for joint in self.robot.joints if joint.type == kind)

    def per_dof(self, element, attribute, default):
        """Return a number of the URDF for each degree of freedom; those of one joint share it."""
        return np.array(
            [joint.number(element, attribute, default) for joint in self.joints for _ in joint.type.freedoms],
            dtype=float,
        )

    def resistance(self, attribute, exponent):
        """Return damping or friction of each degree of freedom, with that of mimic joints times |multiplier|^exponent."""
        values = self.per_dof("dynamics", attribute, 0.0)
        for joint in self.robot.joints:
            if joint.name in self.mimics:
                own = MovingJoint(joint.name, joint.type, joint).number("dynamics", attribute, 0.0)
                values[self._records[self._body[joint.name]]["dof"]] += (
                    own * abs(self.mimics[joint.name].multiplier) ** exponent
                )
        return values

    def reflected(self, efforts):
        """Return the effort at each degree of freedom, with those of mimic joints times their multipliers."""
        values = np.zeros(self._dofs)
        for name, effort in efforts.items():
            if name in self._body:
                record = self._records[self._body[name]]
                values[record["dof"]] += effort * record["multiplier"]
        return values

    def limits(self, attribute, default):
        """Return a position limit for each coordinate; continuous joints and those of several coordinates have none."""
        return np.array(
            [
                joint.number("limit", attribute, default) if joint.kind in ("revolute", "prismatic") else default
                for joint in self.joints
                for _ in joint.type.coordinates
            ],
            dtype=float,
        )

    def records(self, armature, payloads):
        """Return the arrays of bodies and links, given rotor inertias by joint [kg m², kg] and payloads by link."""
        links = self._link_records(payloads)
        bodies = np.array(self._records, BODY)
        for name, body in self._body.items():
            bodies["armature"][body] = armature.get(name, 0.0)  # joints of several degrees of freedom have no limits
        for part in ("mass", "first_moment", "inertia"):
            np.add.at(bodies[part], links["body"], links[part])
        return bodies, links

    def _link_records(self, payloads):
        """Return the records of links with inertia, payloads included."""
        records = []
        for index, (link, body, placement) in enumerate(self.links):
            parts = []
            if link.inertial is not None:
                own = placement if link.inertial.origin is None else placement @ link.inertial.origin
                parts.append(_about_origin(own, link.inertial.mass, link.inertial.inertia))
            if link.name in payloads:
                mass, centre, about_centre = payloads[link.name]
                parts.append(_about_origin(placement @ _translation(centre), mass, about_centre))
            if parts:
                mass, first_moment, inertia = (sum(values) for values in zip(*parts, strict=True))
                if mass or np.any(inertia):
                    records.append((body, index, mass, first_moment, inertia[_UPPER]))
        return np.array(records, LINK)

    def joints_with_inertia(self):
        """Return the joints that move, directly or through fixed joints, a link with mass or inertia in the URDF."""
        bodies = {
            body
            for link, body, _ in self.links
            if link.inertial is not None and (link.inertial.mass or np.any(link.inertial.inertia))
        }
        return {name for name, body in self._body.items() if body in bodies}


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
    if joint.type not in ("revolute", "continuous"):
        raise InputError(f"joint '{joint.name}' cannot be locked: it is {joint.type}.")
    turn = np.eye(4)
    frame = rotations.frame_about(axis)
    c, s = np.cos(position), np.sin(position)
    turn[:3, :3] = frame @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ frame.T
    return turn
