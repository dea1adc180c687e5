"""From a checked URDF to arrays: the tree walked from its root, links that move as one merged."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.spatial import ANGULAR_X, ANGULAR_Y, ANGULAR_Z, LINEAR_X, LINEAR_Y, LINEAR_Z

BODY = np.dtype(
    [
        ("parent", "i8"),  # body that carries this one; 0 is the world
        ("direction", "i8"),  # of its degree of freedom: LINEAR_X … ANGULAR_Z
        ("dofs", "i8"),  # degrees of freedom of its joint
        ("rank", "i8"),  # which of them this one is, from 0
        ("q", "i8"),  # first position coordinate of its joint
        ("link", "i8"),  # index of the link that the joint moves
        ("rotation", "f8", 9),  # constant placement in the parent at q = 0, row-major
        ("translation", "f8", 3),
        ("mass", "f8"),
        ("first_moment", "f8", 3),  # mass times centre of mass
        ("inertia", "f8", 6),  # about the origin: xx xy xz yy yz zz
        ("armature", "f8"),
    ],
    align=True,
)
"""One degree of freedom and the rigid body it moves, all links that move as one, in a frame at the joint whose z is the
joint's axis. A joint of several degrees of freedom is several bodies in one frame, all but the last without inertia."""

LINK = np.dtype(
    [
        ("body", "i8"),
        ("index", "i8"),
        ("mass", "f8"),
        ("first_moment", "f8", 3),
        ("inertia", "f8", 6),
    ],
    align=True,
)
"""One link with inertia, in the frame of the body it belongs to."""

_LINEAR = (("v_x", LINEAR_X), ("v_y", LINEAR_Y), ("v_z", LINEAR_Z))
_ANGULAR = (("w_x", ANGULAR_X), ("w_y", ANGULAR_Y), ("w_z", ANGULAR_Z))

# Of each joint type: its degrees of freedom (suffix of the name, direction) and the suffixes of its coordinates.
FREEDOMS = {
    "revolute": (("", ANGULAR_Z),),
    "continuous": (("", ANGULAR_Z),),
    "prismatic": (("", LINEAR_Z),),
    "planar": (*_LINEAR[:2], _ANGULAR[2]),
    "floating": (*_LINEAR, *_ANGULAR),
}
COORDINATES = {
    "revolute": ("",),
    "continuous": ("",),
    "prismatic": ("",),
    "planar": ("x", "y", "theta"),
    "floating": ("x", "y", "z", "qx", "qy", "qz", "qw"),
}

_UPPER = np.triu_indices(3)


class Freedom:
    """A moving joint: its name, its type and what the URDF says of it (None for a floating base)."""

    def __init__(self, name, kind, joint=None):
        self.name, self.kind, self.joint = name, kind, joint

    def _named(self, suffixes):
        return tuple(f"{self.name}/{suffix}" if suffix else self.name for suffix in suffixes)

    @property
    def dof_names(self):
        """Names of its degrees of freedom."""
        return self._named(suffix for suffix, _ in FREEDOMS[self.kind])

    @property
    def coordinate_names(self):
        """Names of its position coordinates."""
        return self._named(COORDINATES[self.kind])

    @property
    def is_single(self):
        """Whether it has one degree of freedom."""
        return len(FREEDOMS[self.kind]) == 1

    def number(self, element, attribute, default):
        """A number of one of the URDF's child elements, with a default where it is silent."""
        value = getattr(getattr(self.joint, element, None), attribute, None)
        return default if value is None else float(value)


class Tree:
    """A robot walked from its root.

    Parameters
    ----------
    robot : yourdfpy.Robot
    root : str
        Its root link.
    floating_base : bool
        Whether the root link moves freely.
    locked : dict
        Joints of one degree of freedom that are held, with their positions [rad, m].

    Attributes
    ----------
    joints : list of Freedom
        Moving joints, base to tip.
    links : list of (yourdfpy.Link, int, ndarray)
        Each link with its body and its 4x4 placement in that body's frame.
    """

    def __init__(self, robot, root, floating_base=False, locked=None):
        self.robot, self.root = robot, root
        self.floating_base, self.locked = floating_base, dict(locked or {})
        self.joints, self.links = [], []
        self._records = [np.zeros((), BODY)]
        self._coordinates = 0
        self._link = {link.name: link for link in robot.links}
        self._outboard = {}
        for joint in sorted(robot.joints, key=lambda joint: joint.name.encode(), reverse=True):
            self._outboard.setdefault(joint.parent, []).append(joint)  # reversed: the stack turns it round
        self._walk()

    def _walk(self):
        stack = []

        def visit(link, body, placement):
            self.links.append((self._link[link], body, placement))
            stack.extend((joint, body, placement) for joint in self._outboard.get(link, ()))

        body, placement = 0, np.eye(4)
        if self.floating_base:
            body, placement = self._add_joint(Freedom(self._base_name(), "floating"), 0, placement)
        visit(self.root, body, placement)
        while stack:
            joint, body, placement = stack.pop()
            origin = placement if joint.origin is None else placement @ joint.origin
            if joint.name in self.locked:
                visit(joint.child, body, origin @ _displacement(joint, self.locked[joint.name]))
            elif joint.type == "fixed":
                visit(joint.child, body, origin)
            else:
                visit(joint.child, *self._add_joint(Freedom(joint.name, joint.type, joint), body, origin))

    def _base_name(self):
        name = "root_joint"
        while any(joint.name == name for joint in self.robot.joints):
            name += "_"
        return name

    def _add_joint(self, freedom, parent, origin):
        """Bodies of a moving joint, in a frame whose z is its axis; returns the last, and the link's placement in it."""
        turn = np.eye(4)
        if freedom.kind != "floating":
            turn[:3, :3] = _frame_about(freedom.joint.axis)
        placement = origin @ turn
        directions = [direction for _, direction in FREEDOMS[freedom.kind]]
        for rank, direction in enumerate(directions):
            body = np.zeros((), BODY)
            body["parent"], body["direction"] = parent, direction
            body["dofs"], body["rank"], body["q"] = len(directions), rank, self._coordinates
            body["link"] = len(self.links)
            body["rotation"], body["translation"] = placement[:3, :3].ravel(), placement[:3, 3]
            parent, placement = len(self._records), np.eye(4)
            self._records.append(body)
        self._coordinates += len(COORDINATES[freedom.kind])
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
            max(k - 3, -1) if joint.kind == "floating" else -1
            for joint in self.joints
            for k in range(len(COORDINATES[joint.kind]))
        )

    def per_dof(self, element, attribute, default):
        """A number of the URDF for each degree of freedom; those of a joint that has several share it."""
        return np.array(
            [joint.number(element, attribute, default) for joint in self.joints for _ in FREEDOMS[joint.kind]],
            dtype=float,
        )

    def limits(self, attribute, default):
        """A position limit for each coordinate; only joints with one coordinate that does not turn round have any."""
        return np.array(
            [
                joint.number("limit", attribute, default) if joint.kind in ("revolute", "prismatic") else default
                for joint in self.joints
                for _ in COORDINATES[joint.kind]
            ],
            dtype=float,
        )

    def records(self, armature, payloads):
        """Arrays of bodies and links.

        Parameters
        ----------
        armature : dict
            Rotor inertia by joint name [kg m², kg].
        payloads : dict
            (mass, centre of mass, inertia about it) by link name, in the link's axes.
        """
        links = self._link_records(payloads)
        bodies = np.array(self._records, BODY)
        first = 1
        for joint in self.joints:
            bodies["armature"][first] = armature.get(joint.name, 0.0)
            first += len(FREEDOMS[joint.kind])
        for part in ("mass", "first_moment", "inertia"):
            np.add.at(bodies[part], links["body"], links[part])
        return bodies, links

    def _link_records(self, payloads):
        """Links with inertia, payloads included."""
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
        """Names of the joints that move, directly or through fixed joints, a link with mass or inertia in the URDF."""
        bodies = {
            body
            for link, body, _ in self.links
            if link.inertial is not None and (link.inertial.mass or np.any(link.inertial.inertia))
        }
        names, last = set(), 0
        for joint in self.joints:
            last += len(FREEDOMS[joint.kind])
            if last in bodies:
                names.add(joint.name)
        return names


def _about_origin(centre, mass, about_centre):
    """Mass, first moment and inertia about the origin of a rigid body, given the 4x4 placement of its centre."""
    R, c = centre[:3, :3], centre[:3, 3]
    return mass, mass * c, R @ about_centre @ R.T + mass * (c @ c * np.eye(3) - np.outer(c, c))


def _translation(vector):
    placement = np.eye(4)
    placement[:3, 3] = vector
    return placement


def _displacement(joint, position):
    """4x4 motion of a joint of one degree of freedom."""
    axis = np.asarray(joint.axis, dtype=float) / np.linalg.norm(joint.axis)
    if joint.type == "prismatic":
        return _translation(position * axis)
    if joint.type not in ("revolute", "continuous"):
        raise InputError(f"joint '{joint.name}' cannot be locked: it is {joint.type}.")
    turn = np.eye(4)
    frame = _frame_about(axis)
    c, s = np.cos(position), np.sin(position)
    turn[:3, :3] = frame @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ frame.T
    return turn


def _frame_about(axis):
    """Rotation matrix whose third column is the axis; exact for axes along x, y or z."""
    z = np.asarray(axis, dtype=float) / np.abs(axis).max()
    z /= np.linalg.norm(z)
    x = np.zeros(3)
    x[np.argmin(np.abs(z))] = 1.0
    x -= (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
