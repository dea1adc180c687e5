"""RobotModel, and how a URDF becomes one."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.exceptions import (
    InertiaWarning,
    InputError,
    MasslessLinkError,
    MimicJointError,
    UrdfError,
)
from diag_dynamics.model.tree import Tree
from diag_dynamics.model.urdf import read_urdf

SINGLE = ("revolute", "continuous", "prismatic")
"""Joint types of one degree of freedom."""


class Payload(NamedTuple):
    """A rigid body attached to a link, in the link's axes.

    Attributes
    ----------
    mass : float
        [kg].
    com : array_like, shape (3,)
        Centre of mass from the link's origin [m].
    inertia : array_like, shape (3, 3)
        About the centre of mass [kg m²]; that of a point by default.
    """

    mass: float
    com: object = (0.0, 0.0, 0.0)
    inertia: object = ((0.0,) * 3,) * 3


class Options(NamedTuple):
    """How a robot is to be modelled: the arguments of :func:`load_urdf`, checked."""

    floating_base: bool
    gravity: np.ndarray
    mimic: str
    massless: str
    locked: dict
    armature: dict
    payloads: dict


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot as a tree of rigid bodies; immutable. Made by :func:`load_urdf`.

    The order of degrees of freedom is base to tip, depth first, with siblings sorted by joint name, which is
    Pinocchio's order. Units are SI: [rad], [kg m²] for revolute and continuous joints, [m], [kg] for prismatic.

    A planar joint moves in the plane normal to its axis: positions x, y, theta, rates v_x, v_y, w_z in the moving body's
    axes. A floating joint has positions x y z qx qy qz qw and as rates the body's twist in its own axes, linear first.

    Attributes
    ----------
    name : str
        Name of the robot.
    dof_names : tuple of str
        The nv degrees of freedom: the order of every vector of rates or efforts. A joint's name, or for a joint of
        several degrees of freedom ``<joint>/v_x`` … ``<joint>/w_z``; the joint of a floating base is ``root_joint``.
    coordinate_names : tuple of str
        The nq position coordinates; likewise, ``<joint>/x`` … ``<joint>/qw``.
    joint_names : tuple of str
        Joints that move, in the same order.
    link_names : tuple of str
        All links, base to tip: the order of link energies.
    root_link : str
        The link that is fixed in the world, or moves freely.
    floating_base : bool
        Whether it moves freely.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in the world's axes, those of the root link of a fixed base [m/s²].
    lower, upper : ndarray, shape (nq,)
        Position limits [rad, m]; infinite where there are none.
    velocity_limit, effort_limit : ndarray, shape (nv,)
        Limits [rad/s, m/s] and [N m, N]; infinite where there are none.
    damping, friction : ndarray, shape (nv,)
        Joint damping [N m s/rad, N s/m] and Coulomb friction [N m, N] as the URDF gives them. No dynamic quantity
        holds them unless it is asked to.
    mimic_joints : tuple of str
        Joints that follow another one in the URDF.
    fixed_joints : tuple of str
        Joints of the URDF that do not move.
    locked_joints : mapping
        Joints that are held, with their positions [rad, m].
    payloads : mapping
        :class:`Payload` by link name.
    total_mass : float
        Mass of all links and payloads [kg].
    """

    name: str
    dof_names: tuple
    coordinate_names: tuple
    joint_names: tuple
    link_names: tuple
    root_link: str
    floating_base: bool
    gravity: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity_limit: np.ndarray
    effort_limit: np.ndarray
    damping: np.ndarray
    friction: np.ndarray
    mimic_joints: tuple
    fixed_joints: tuple
    locked_joints: Mapping
    payloads: Mapping
    total_mass: float
    bodies: np.ndarray = field(repr=False)
    links: np.ndarray = field(repr=False)
    _tree: Tree = field(repr=False)
    _options: Options = field(repr=False)

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
        return len(self.coordinate_names)

    @property
    def armature(self):
        """Reflected rotor inertia [kg m², kg], shape (nv,)."""
        return self.bodies["armature"][1:]

    @property
    def neutral(self):
        """Positions of zero, floating joints at the identity; shape (nq,)."""
        return np.array([1.0 if name.endswith("/qw") else 0.0 for name in self.coordinate_names])

    def with_gravity(self, gravity):
        """Return this model with another acceleration of gravity [m/s²], shape (3,); everything else is shared.

        Raises
        ------
        InputError
            `gravity` is not three finite numbers.
        """
        gravity = _gravity(gravity)
        return replace(self, gravity=gravity, _options=self._options._replace(gravity=gravity))

    def with_payload(self, link, mass, com=(0.0, 0.0, 0.0), inertia=None):
        """Return this model with a payload on a link, in place of one that is there already; the rest is shared.

        Parameters
        ----------
        link : str
            Name of the link.
        mass, com, inertia
            See :class:`Payload`. Mass 0 takes the payload off.

        Raises
        ------
        InputError
            No such link, or numbers that are not finite or of the wrong shape.
        MasslessLinkError
            Without the payload a joint moves no inertia.
        """
        payloads = {name: payload for name, payload in self.payloads.items() if name != link}
        added = _payloads({link: (mass, com) if inertia is None else (mass, com, inertia)}, self._tree.robot)
        payloads |= added
        bodies, links = self._tree.records(self._options.armature, payloads)
        model = replace(
            self,
            payloads=MappingProxyType(payloads),
            bodies=bodies,
            links=links,
            total_mass=float(links["mass"].sum()),
            _options=self._options._replace(payloads=payloads),
        )
        _refuse_massless(model, _massless(model))
        return model

    def without_payload(self, link):
        """Return this model without the payload of a link."""
        return self.with_payload(link, 0.0)

    def with_locked_joints(self, locked_joints):
        """Return this model with exactly these joints held, and those that the options of load_urdf lock besides.

        Parameters
        ----------
        locked_joints : dict
            Position [rad, m] by joint name; empty releases all.

        Raises
        ------
        InputError
            No such joint, one that has not one degree of freedom, or a position that is not a finite number.
        """
        robot = self._tree.robot
        return _model(robot, self._tree.root, self._options._replace(locked=_locked(locked_joints, robot)))

    def placement_in_root(self, link):
        """Placement (4x4) in the root link of one that is rigidly attached to it.

        Raises
        ------
        InputError
            No such link, or a joint moves it against the root.
        """
        links = self._tree.links
        if link not in self.link_names:
            raise InputError(f"'{link}' is not a link of robot '{self.name}'.")
        _, body, placement = links[self.link_names.index(link)]
        if body != links[0][1]:
            raise InputError(f"link '{link}' is not rigidly attached to the root link '{self.root_link}'.")
        return placement

    def wrenches(self, f_ext, frame):
        """Records of external wrenches for the sweeps: see :data:`sweeps.WRENCH`.

        Parameters
        ----------
        f_ext : dict
            Force [N] and moment [N m] at the link's origin, six numbers, by link name.
        frame : {"link", "world"}
            Axes they are in.

        Raises
        ------
        InputError
            No such link, or not six finite numbers.
        """
        _choice("frame", frame, ("link", "world"))
        _mapping("f_ext", f_ext)
        records = np.zeros(len(f_ext), sweeps.WRENCH)
        for record, (name, wrench) in zip(records, f_ext.items(), strict=True):
            if name not in self.link_names:
                raise InputError(f"f_ext: '{name}' is not a link of robot '{self.name}'.")
            wrench = _numbers(
                f"f_ext on link '{name}'", wrench, (6,), "six finite numbers, force [N] then moment [N m]"
            )
            _, body, placement = self._tree.links[self.link_names.index(name)]
            turn = np.eye(3) if frame == "world" else placement[:3, :3]
            record["body"], record["point"] = body, placement[:3, 3]
            record["force"], record["moment"] = turn @ wrench[:3], turn @ wrench[3:]
        return records

    def __repr__(self):
        return f"<RobotModel '{self.name}': {self.nv} dof, {len(self.link_names)} links, {self.total_mass:.6g} kg>"

    def __reduce__(self):
        return _restored, (self._tree.robot, self._tree.root, self._options)


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
        Whether the root link moves freely.
    gravity : array_like, shape (3,)
        Acceleration of gravity in the world's axes, those of the root link of a fixed base [m/s²].
    mimic : {"embed", "free", "lock"}
        What to do with mimic joints: couple them to their leaders (not offered yet: raises where the robot has
        any), treat them as independent, or lock them where they belong with their leaders at zero, or as these are
        locked.
    massless : {"error", "lock"}
        What to do with joints that move no inertia: raise, or lock them at zero or, where that is outside their limits,
        at the limit next to it.
    locked_joints : dict
        Joints that are held, with their positions [rad, m].
    armature : dict or float
        Reflected rotor inertia [kg m², prismatic: kg] by joint name, or one number for all joints of one degree of
        freedom.
    payloads : dict
        :class:`Payload`, or a tuple of its fields, by link name.

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
    InputError
        An argument has a wrong value.

    Warns
    -----
    InertiaWarning
        A link's inertia is not that of any rigid body.
    """
    _choice("mimic", mimic, ("embed", "free", "lock"))
    _choice("massless", massless, ("error", "lock"))
    gravity = _gravity(gravity)
    robot, root = read_urdf(source)
    _warn_of_inertias(robot)
    options = Options(
        bool(floating_base),
        gravity,
        mimic,
        massless,
        _locked({} if locked_joints is None else locked_joints, robot),
        _armature(armature, robot),
        _payloads({} if payloads is None else payloads, robot),
    )
    return _model(robot, root, options)


def _model(robot, root, options):
    """Model of a robot, following all options."""
    tree = Tree(robot, root, options.floating_base, _with_mimics_locked(robot, options))
    followers = [joint for joint in tree.joints if joint.joint is not None and joint.joint.mimic is not None]
    if followers and options.mimic == "embed":
        _refuse_mimics(robot, followers)
    model = _model_of(tree, options)
    found = _massless(model)
    while options.massless == "lock" and len(found[0]):
        held = _held(model, found)
        if not held:
            break
        model = _model_of(Tree(robot, root, options.floating_base, model._tree.locked | held), options)
        found = _massless(model)
    _refuse_massless(model, found)
    return model


def _restored(robot, root, options):
    """Model from its pickled parts, whose arrays have come back writeable."""
    return _model(robot, root, options._replace(payloads=_payloads(options.payloads, robot)))


def _model_of(tree, options):
    """Model of a tree as it is."""
    bodies, links = tree.records(options.armature, options.payloads)
    names = tree.dof_names
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UrdfError(f"Two degrees of freedom would have the name '{twice}': rename one of the joints.")
    return RobotModel(
        name=tree.robot.name,
        dof_names=names,
        coordinate_names=tree.coordinate_names,
        joint_names=tuple(joint.name for joint in tree.joints),
        link_names=tuple(link.name for link, _, _ in tree.links),
        root_link=tree.root,
        floating_base=tree.floating_base,
        gravity=options.gravity,
        lower=tree.limits("lower", -np.inf),
        upper=tree.limits("upper", np.inf),
        velocity_limit=tree.per_dof("limit", "velocity", np.inf),
        effort_limit=tree.per_dof("limit", "effort", np.inf),
        damping=tree.per_dof("dynamics", "damping", 0.0),
        friction=tree.per_dof("dynamics", "friction", 0.0),
        mimic_joints=tuple(joint.name for joint in tree.robot.joints if joint.mimic is not None),
        fixed_joints=tuple(joint.name for joint in tree.robot.joints if joint.type == "fixed"),
        locked_joints=MappingProxyType(dict(tree.locked)),
        payloads=MappingProxyType(dict(options.payloads)),
        total_mass=float(links["mass"].sum()),
        bodies=bodies,
        links=links,
        _tree=tree,
        _options=options,
    )


# --- Options ----------------------------------------------------------------------------------------------


def _choice(name, value, choices):
    if value not in choices:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(map(repr, choices))}.")


def _gravity(value):
    return _numbers("gravity", value, (3,), "three finite numbers [m/s²]")


def _numbers(name, value, shape, expected):
    """`value` as a new float array, or an error that says what was expected."""
    try:
        array = np.array(value)
        array = array.astype(float) if array.dtype.kind in "fiu" else np.array(np.nan)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.shape != shape or not np.isfinite(array).all():
        raise InputError(f"{name} is {value!r}, expected {expected}.")
    return array


def _mapping(name, value):
    if not isinstance(value, Mapping):
        raise InputError(f"{name} is {value!r}, expected a dict by name.")
    return value


def _armature(value, robot):
    """Armature by joint name, from one number or a dict."""
    single = [joint.name for joint in robot.joints if joint.type in SINGLE]
    given = {} if value is None else value
    if not isinstance(given, Mapping):
        number = float(_numbers("armature", value, (), "a finite number >= 0 or such by joint name"))
        given = dict.fromkeys(single, number)
    checked, known = {}, set(single)
    for name, inertia in given.items():
        if name not in known:
            raise InputError(
                f"armature: {name!r} is not a joint of one degree of freedom of this robot; those are {_some(single)}."
            )
        checked[name] = float(_numbers(f"armature of joint '{name}'", inertia, (), "a finite number >= 0"))
        if checked[name] < 0.0:
            raise InputError(f"armature of joint '{name}' is {inertia!r}, expected a finite number >= 0.")
    return checked


def _some(names, most=12):
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")


def _locked(value, robot):
    """Positions of locked joints, checked."""
    joints = {joint.name: joint for joint in robot.joints}
    locked = {}
    for name, position in _mapping("locked_joints", value).items():
        if name not in joints:
            raise InputError(f"locked_joints: '{name}' is not a joint of robot '{robot.name}'.")
        if joints[name].type not in SINGLE:
            raise InputError(f"locked_joints: joint '{name}' is {joints[name].type}, expected one degree of freedom.")
        expected = "a finite number [rad, m]"
        locked[name] = float(_numbers(f"locked_joints: position of joint '{name}'", position, (), expected))
    return locked


def _payloads(value, robot):
    """Payloads as :class:`Payload` of read-only arrays, checked; those without mass are none."""
    links = {link.name for link in robot.links}
    checked = {}
    for name, given in _mapping("payloads", value).items():
        try:
            known = name in links
        except TypeError:
            known = False
        if not known:
            raise InputError(f"payloads: {name!r} is not a link of robot '{robot.name}'.")
        try:
            mass, com, inertia = Payload(*given)
        except TypeError as error:
            raise InputError(f"payloads: '{name}' has {given!r}, expected (mass, com, inertia).") from error
        expected = "a finite number >= 0 [kg]"
        mass = float(_numbers(f"payloads: mass on link '{name}'", mass, (), expected))
        if mass < 0.0:
            raise InputError(f"payloads: mass on link '{name}' is {mass}, expected {expected}.")
        com = _numbers(f"payloads: com on link '{name}'", com, (3,), "three finite numbers [m]")
        inertia = _numbers(f"payloads: inertia on link '{name}'", inertia, (3, 3), "3 x 3 finite numbers [kg m²]")
        reason = _not_physical(inertia, mass)
        if reason or not np.allclose(inertia, inertia.T, rtol=1e-9, atol=0.0):
            raise InputError(f"payloads: inertia on link '{name}' is {inertia.tolist()}, {reason or 'not symmetric'}.")
        com.flags.writeable = inertia.flags.writeable = False
        if mass > 0.0:
            checked[name] = Payload(mass, com, inertia)
    return checked


# --- Mimic joints -----------------------------------------------------------------------------------------


def _refuse_mimics(robot, followers):
    """Raise, for want of embedding or because a leader does not exist."""
    names = {joint.name for joint in robot.joints}
    for follower in followers:
        leader = follower.joint.mimic.joint
        if leader not in names:
            raise UrdfError(
                f"joint '{follower.name}': it mimics '{leader}', which is not a joint of this URDF. "
                "mimic='free' treats it as an independent joint."
            )
    listed = ", ".join(joint.name for joint in followers)
    raise MimicJointError(
        f"robot '{robot.name}' has mimic joints ({listed}), and exact embedding of their coupling is not there yet. "
        "mimic='free' treats them as independent joints, mimic='lock' locks them.",
        [joint.name for joint in followers],
    )


def _with_mimics_locked(robot, options):
    """Locked joints, and the followers that are locked with them: all of them, or those of leaders that are locked."""
    locked = dict(options.locked)
    if options.mimic == "free":
        return locked
    joints = {joint.name: joint for joint in robot.joints}
    for joint in robot.joints:
        if joint.mimic is None or joint.name in locked or joint.type == "fixed":
            continue
        if options.mimic == "lock" or _leader(joint, joints, options.locked) in options.locked:
            locked[joint.name] = _follow(joint, joints, options.locked)
    return locked


def _leader(joint, joints, locked):
    """Name of the joint that a follower follows in the end."""
    seen = set()
    while (
        joint.mimic is not None and joint.name not in locked and joint.name not in seen and joint.mimic.joint in joints
    ):
        seen.add(joint.name)
        joint = joints[joint.mimic.joint]
    return joint.name


def _follow(joint, joints, locked):
    """Position of a mimic joint with its leader as locked, or at zero."""
    position, scale, seen = 0.0, 1.0, []
    while joint.mimic is not None and joint.name not in locked:
        if joint.name in seen:
            raise UrdfError(f"joint '{joint.name}' mimics itself through {', '.join(seen)}.")
        seen.append(joint.name)
        position += scale * (joint.mimic.offset or 0.0)
        scale *= 1.0 if joint.mimic.multiplier is None else joint.mimic.multiplier
        if joint.mimic.joint not in joints:
            raise UrdfError(
                f"joint '{joint.name}': it mimics '{joint.mimic.joint}', which is not a joint of this URDF."
            )
        joint = joints[joint.mimic.joint]
    return position + scale * locked.get(joint.name, 0.0)


# --- Inertias ---------------------------------------------------------------------------------------------


def _not_physical(inertia, mass):
    """Why an inertia about the centre of mass is that of no rigid body, or None."""
    moments = np.linalg.eigvalsh(inertia)
    # A radius of gyration of a micrometre is that of a point.
    rounding = max(1e-6 * np.abs(moments).max(), 1e-12 * mass)
    if moments[0] < -rounding:
        return f"whose principal moments {_short(moments)} are not all positive"
    if moments[2] > moments[0] + moments[1] + rounding:
        return f"whose principal moments {_short(moments)} break the triangle inequality"
    return None


def _short(numbers):
    return ", ".join(f"{number:.3g}" for number in numbers)


def _warn_of_inertias(robot):
    for link in robot.links:
        reason = None if link.inertial is None else _not_physical(link.inertial.inertia, link.inertial.mass)
        if reason:
            text = f"link '{link.name}' of robot '{robot.name}' has an inertia {reason}: no rigid body is like that."
            warnings.warn(text, InertiaWarning, stacklevel=3)


def _massless(model):
    """Degrees of freedom that move no inertia in any of a few configurations, and the smallest D of every one.

    At a single configuration M may be merely singular there.
    """
    rng = np.random.default_rng(0)
    work = np.zeros(len(model.bodies), sweeps.WORK)
    smallest, massless = np.full(model.nv, np.inf), np.ones(model.nv, dtype=bool)
    for spread in (0.0, 1.0, 1.0, 1.0):
        q = model.neutral
        turning = np.array(
            [not name.endswith(("/qx", "/qy", "/qz", "/qw")) for name in model.coordinate_names], dtype=bool
        )
        q[turning] += spread * rng.uniform(-1.0, 1.0, turning.sum())
        D, magnitude = np.zeros(model.nv), np.zeros(model.nv)
        sweeps.joint_inertias(model.bodies, q, work, D, magnitude)
        massless &= ~(sweeps.SINGULAR * magnitude < D)
        smallest = np.minimum(smallest, D)
    return np.flatnonzero(massless), smallest


def _joints_of_dofs(model):
    """The joint of each degree of freedom."""
    return [joint for joint in model._tree.joints for _ in joint.dof_names]


MOST_LISTED = 50
"""Joints that a message lists at most."""


def _refuse_massless(model, found):
    """Raise, naming all joints that move no inertia, and their cures."""
    massless, smallest = found
    if not len(massless):
        return
    joints = _joints_of_dofs(model)
    heavy = model._tree.joints_with_inertia()
    lines = []
    for k in massless[:MOST_LISTED]:
        joint = joints[k]
        link = joint.joint.child if joint.joint else model.root_link
        why = "has little inertia about that axis" if joint.name in heavy else "has no <inertial>"
        lines.append(f"  joint '{model.dof_names[k]}' (D = {smallest[k]:.3g}): link '{link}' {why}")
    if len(massless) > MOST_LISTED:
        lines.append(f"  … and {len(massless) - MOST_LISTED} more")
    lines.append("Give the link mass and inertia in the URDF, or make the joint fixed.")
    single = next((joints[k].name for k in massless if joints[k].is_single), None)
    if single is not None:
        lines[-1] += (
            f" Or give the joint a rotor inertia, armature={{'{single}': …}}, or lock it, "
            f"locked_joints={{'{single}': 0.0}} or massless='lock'."
        )
    raise MasslessLinkError(
        f"robot '{model.name}' has {len(massless)} joint(s) that move no inertia, which makes its mass matrix "
        "singular:\n" + "\n".join(lines),
        [model.dof_names[k] for k in massless],
        smallest[massless],
    )


def _held(model, found):
    """Positions at which joints that move no inertia are locked: zero, or their limit next to it."""
    joints = _joints_of_dofs(model)
    held = {}
    for k in found[0]:
        if joints[k].is_single:
            lower, upper = (
                joints[k].number("limit", side, sign * np.inf) for side, sign in (("lower", -1), ("upper", 1))
            )
            held[joints[k].name] = float(np.clip(0.0, lower, upper))
    return held
