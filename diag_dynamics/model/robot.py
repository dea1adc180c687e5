"""RobotModel: the tree of a robot as arrays, and how a URDF becomes one."""

from dataclasses import dataclass, field, replace

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.exceptions import (
    InputError,
    MasslessLinkError,
    MimicJointError,
    UnsupportedError,
    UrdfError,
)
from diag_dynamics.model.urdf import MOVING_TYPES, read_urdf
from diag_dynamics.spatial import PRISMATIC, REVOLUTE

BODY = np.dtype(
    [
        ("parent", "i8"),  # body that carries this one; 0 is the world
        ("kind", "i8"),  # REVOLUTE or PRISMATIC
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
"""One rigid body: all links that move as one, in a frame at its joint whose z is the joint's axis."""

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

_UPPER = np.triu_indices(3)


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot as a tree of rigid bodies; immutable. Made by :func:`load_urdf`.

    The order of degrees of freedom is base to tip, depth first, with siblings sorted by joint name, which is
    Pinocchio's order. Units are SI: [rad], [kg m²] for revolute and continuous joints, [m], [kg] for prismatic.

    Attributes
    ----------
    name : str
        Name of the robot.
    dof_names : tuple of str
        The nv degrees of freedom: the order of every vector. Here each is a joint's name.
    joint_names : tuple of str
        Joints that move, in the same order.
    link_names : tuple of str
        All links, base to tip: the order of link energies.
    root_link : str
        The link that is fixed in the world.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in the root link's axes [m/s²].
    lower, upper : ndarray, shape (nv,)
        Position limits [rad, m]; infinite where there are none.
    velocity_limit, effort_limit : ndarray, shape (nv,)
        Limits [rad/s, m/s] and [N m, N]; infinite where there are none.
    damping, friction : ndarray, shape (nv,)
        Joint damping [N m s/rad, N s/m] and Coulomb friction [N m, N] as the URDF gives them. They are not part
        of any dynamic quantity of this library but of the simulator.
    mimic_joints : tuple of str
        Joints that follow another one in the URDF.
    fixed_joints : tuple of str
        Joints of the URDF that do not move.
    total_mass : float
        Mass of all links [kg].
    """

    name: str
    dof_names: tuple
    joint_names: tuple
    link_names: tuple
    root_link: str
    gravity: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity_limit: np.ndarray
    effort_limit: np.ndarray
    damping: np.ndarray
    friction: np.ndarray
    mimic_joints: tuple
    fixed_joints: tuple
    total_mass: float
    bodies: np.ndarray = field(repr=False)
    links: np.ndarray = field(repr=False)

    def __post_init__(self):
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def nv(self):
        """Number of degrees of freedom."""
        return len(self.dof_names)

    @property
    def nq(self):
        """Number of position coordinates."""
        return self.nv

    @property
    def armature(self):
        """Reflected rotor inertia [kg m², kg], shape (nv,)."""
        return self.bodies["armature"][1:]

    def with_gravity(self, gravity):
        """Return this model with another acceleration of gravity [m/s²], shape (3,); everything else is shared."""
        return replace(self, gravity=_gravity(gravity))

    def __repr__(self):
        return f"<RobotModel '{self.name}': {self.nv} dof, {len(self.link_names)} links, {self.total_mass:.6g} kg>"


def load_urdf(
    source,
    floating_base=False,
    gravity=(0.0, 0.0, -9.81),
    mimic="embed",
    massless="error",
    locked_joints=None,
    armature=None,
    payloads=None,
):
    """Build a model from a URDF; meshes are neither needed nor looked for.

    Parameters
    ----------
    source : str, bytes or os.PathLike
        Path of a URDF file, or XML text.
    floating_base : bool
        Whether the root link moves freely. Not offered yet.
    gravity : array_like, shape (3,)
        Acceleration of gravity in the root link's axes [m/s²].
    mimic : {"embed", "free", "lock"}
        What to do with mimic joints: couple them to their leaders (not offered yet: raises where the robot has
        any), treat them as independent, or lock them (not offered yet).
    massless : {"error", "lock"}
        What to do with joints that move no inertia: raise, or lock them (not offered yet).
    locked_joints, payloads : dict
        Not offered yet.
    armature : dict or float
        Reflected rotor inertia [kg m², prismatic: kg] by joint name, or one number for all.

    Returns
    -------
    RobotModel

    Raises
    ------
    UrdfError
        The URDF is malformed or not a tree.
    MimicJointError
        It has mimic joints and ``mimic="embed"``.
    MasslessLinkError
        Joints move no inertia: the mass matrix would be singular.
    UnsupportedError
        It needs, or the arguments ask for, something that is not there yet.
    InputError
        An argument has a wrong value.
    """
    _choice("mimic", mimic, ("embed", "free", "lock"))
    _choice("massless", massless, ("error", "lock"))
    for option, wanted in (
        ("floating_base=True", floating_base),
        ("mimic='lock'", mimic == "lock"),
        ("massless='lock'", massless == "lock"),
        ("locked_joints", locked_joints),
        ("payloads", payloads),
    ):
        if wanted:
            raise UnsupportedError(f"load_urdf: {option} is not offered yet.")
    gravity = _gravity(gravity)
    robot, root = read_urdf(source)
    tree = _Tree(robot, root)
    followers = tuple(joint.name for joint in tree.joints if joint.mimic is not None)
    if followers and mimic == "embed":
        _check_leaders(tree)
        raise MimicJointError(
            f"robot '{robot.name}' has mimic joints ({', '.join(followers)}), and exact embedding of their coupling "
            "is not there yet. mimic='free' treats them as independent joints.",
            followers,
        )
    model = tree.model(gravity, _armature(armature, tree.joints), followers)
    _refuse_massless(model, tree)
    return model


def _check_leaders(tree):
    names = {joint.name for joint in tree.robot.joints}
    for joint in tree.joints:
        if joint.mimic is not None and joint.mimic.joint not in names:
            raise UrdfError(
                f"joint '{joint.name}': it mimics '{joint.mimic.joint}', which is not a joint of this URDF. "
                "mimic='free' treats it as an independent joint."
            )


def _choice(name, value, choices):
    if value not in choices:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(map(repr, choices))}.")


def _gravity(value):
    gravity = np.array(value, dtype=float)
    if gravity.shape != (3,) or not np.isfinite(gravity).all():
        raise InputError(f"gravity is {value!r}, expected three finite numbers [m/s²].")
    return gravity


def _armature(value, joints):
    """Armature of each moving joint, from one number or a dict by name."""
    names = [joint.name for joint in joints]
    given = dict.fromkeys(names, value) if isinstance(value, (int, float)) else dict(value or {})
    for name, inertia in given.items():
        if name not in names:
            raise InputError(f"armature: '{name}' is not a moving joint of this robot; those are {', '.join(names)}.")
        if not (np.isfinite(inertia) and inertia >= 0.0):
            raise InputError(f"armature of joint '{name}' is {inertia!r}, expected a finite number >= 0.")
    return np.array([given.get(name, 0.0) for name in names])


class _Tree:
    """A robot walked from its root: moving joints and links base to tip, links that move as one merged.

    Attributes
    ----------
    joints : list of yourdfpy.Joint
        Moving joints; joint k moves body k + 1.
    links : list of (yourdfpy.Link, int, ndarray)
        Each link with its body and its 4x4 placement in that body's frame.
    """

    def __init__(self, robot, root):
        self.robot, self.root = robot, root
        self.joints, self.links = [], []
        self._parents, self._placements, self._moved_links = [0], [np.eye(4)], [0]
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

        visit(self.root, 0, np.eye(4))
        while stack:
            joint, body, placement = stack.pop()
            origin = placement if joint.origin is None else placement @ joint.origin
            if joint.type == "fixed":
                visit(joint.child, body, origin)
            elif joint.type in MOVING_TYPES:
                visit(joint.child, *self._add_body(joint, body, origin))
            else:
                raise UnsupportedError(f"joint '{joint.name}': type '{joint.type}' is not offered yet.")

    def _add_body(self, joint, parent, origin):
        """A new body at a moving joint, in a frame whose z is the joint's axis."""
        turn = np.eye(4)
        turn[:3, :3] = _frame_about(joint.axis)
        self.joints.append(joint)
        self._parents.append(parent)
        self._placements.append(origin @ turn)
        self._moved_links.append(len(self.links))
        return len(self.joints), turn.T

    def model(self, gravity, armature, followers):
        """The tree as a RobotModel."""
        links = self._link_records()
        bodies = np.zeros(len(self.joints) + 1, BODY)
        bodies["parent"] = self._parents
        bodies["link"] = self._moved_links
        bodies["kind"][1:] = [PRISMATIC if joint.type == "prismatic" else REVOLUTE for joint in self.joints]
        bodies["armature"][1:] = armature
        for body, placement in zip(bodies, self._placements, strict=True):
            body["rotation"] = placement[:3, :3].ravel()
            body["translation"] = placement[:3, 3]
        for part in ("mass", "first_moment", "inertia"):
            np.add.at(bodies[part], links["body"], links[part])
        names = tuple(joint.name for joint in self.joints)
        return RobotModel(
            name=self.robot.name,
            dof_names=names,
            joint_names=names,
            link_names=tuple(link.name for link, _, _ in self.links),
            root_link=self.root,
            gravity=gravity,
            lower=self._numbers("limit", "lower", -np.inf),
            upper=self._numbers("limit", "upper", np.inf),
            velocity_limit=self._numbers("limit", "velocity", np.inf),
            effort_limit=self._numbers("limit", "effort", np.inf),
            damping=self._numbers("dynamics", "damping", 0.0),
            friction=self._numbers("dynamics", "friction", 0.0),
            mimic_joints=followers,
            fixed_joints=tuple(joint.name for joint in self.robot.joints if joint.type == "fixed"),
            total_mass=float(links["mass"].sum()),
            bodies=bodies,
            links=links,
        )

    def _link_records(self):
        """Links with inertia, each in the frame of its body."""
        records = []
        for index, (link, body, placement) in enumerate(self.links):
            if link.inertial is None or not (link.inertial.mass or np.any(link.inertial.inertia)):
                continue
            inertial = link.inertial
            centre = placement if inertial.origin is None else placement @ inertial.origin
            R, c, m = centre[:3, :3], centre[:3, 3], inertial.mass
            about_origin = R @ inertial.inertia @ R.T + m * (c @ c * np.eye(3) - np.outer(c, c))
            records.append((body, index, m, m * c, about_origin[_UPPER]))
        return np.array(records, LINK)

    def _numbers(self, element, attribute, default):
        """A number of each moving joint, with a default where the URDF is silent."""
        values = np.full(len(self.joints), default)
        for k, joint in enumerate(self.joints):
            value = getattr(getattr(joint, element), attribute, None)
            # A continuous joint turns without end, whatever its <limit> says of positions.
            if value is not None and not (joint.type == "continuous" and attribute in ("lower", "upper")):
                values[k] = value
        return values

    def inertia_beyond(self, k):
        """Whether any link that joint k moves, directly or through fixed joints, has mass or inertia."""
        return any(
            link.inertial is not None and (link.inertial.mass or np.any(link.inertial.inertia))
            for link, body, _ in self.links
            if body == k + 1
        )


def _frame_about(axis):
    """Rotation matrix whose third column is the axis; exact for axes along x, y or z."""
    z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    x = np.zeros(3)
    x[np.argmin(np.abs(z))] = 1.0
    x -= (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _refuse_massless(model, tree):
    """Raise where a joint moves no inertia in any of a few configurations: at one alone, M is merely singular there."""
    rng = np.random.default_rng(0)
    work = np.zeros(len(model.bodies), sweeps.WORK)
    smallest, massless = np.full(model.nv, np.inf), np.ones(model.nv, dtype=bool)
    for q in (np.zeros(model.nv), *rng.uniform(-1.0, 1.0, (3, model.nv))):
        D, magnitude = np.zeros(model.nv), np.zeros(model.nv)
        sweeps.joint_inertias(model.bodies, q, work, D, magnitude)
        massless &= ~(sweeps.SINGULAR * magnitude < D)
        smallest = np.minimum(smallest, D)
    if not massless.any():
        return
    found = np.flatnonzero(massless)
    lines = []
    for k in found:
        joint = tree.joints[k]
        why = "has little inertia about that axis" if tree.inertia_beyond(k) else "has no <inertial>"
        lines.append(f"  joint '{joint.name}' (D = {smallest[k]:.3g}): link '{joint.child}' {why}")
    raise MasslessLinkError(
        f"robot '{model.name}' has {len(found)} joint(s) that move no inertia, which makes its mass matrix singular:\n"
        + "\n".join(lines)
        + "\nGive the link mass and inertia in the URDF, make the joint fixed, or give the joint a rotor inertia "
        f"(armature={{'{tree.joints[found[0]].name}': …}}).",
        [tree.joints[k].name for k in found],
        smallest[found],
    )
