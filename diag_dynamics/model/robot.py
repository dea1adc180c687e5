# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""RobotModel, and the way from a URDF to it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import IO, Any, Literal

import numpy as np
import numpy.typing as npt

from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import choice, number, whole
from diag_dynamics.exceptions import InputError, MimicJointError
from diag_dynamics.model.configurations import difference, integrated, random_positions
from diag_dynamics.model.geometry import estimated
from diag_dynamics.model.massless import massless_freedoms, positions_to_hold, refuse_massless
from diag_dynamics.model.mimic import Mimic, resolve_mimics
from diag_dynamics.model.options import (
    FRICTION_VELOCITY,
    Options,
    Payload,
    armature_by_joint,
    checked_payloads,
    friction_velocity_of,
    gravity_vector,
    locked_positions,
    warn,
    warn_of_inertias,
)
from diag_dynamics.model.parameters import (
    Parameters,
    of_joints,
    parameters_of,
    perturbed_links,
    refuse_too_light,
    robot_with,
)
from diag_dynamics.model.remarks import limits_in_degrees, remarks_of, warning_of
from diag_dynamics.model.sources import folder_of, urdf_text
from diag_dynamics.model.transmissions import reflected_inertias
from diag_dynamics.model.tree import Tree, refuse_same_names
from diag_dynamics.model.urdf import MAX_JOINTS, parse_urdf, read_element
from diag_dynamics.model.xacro_files import expanded
from diag_dynamics.sweeps.workspace import Workspace

MAX_COUPLED = 200
"""Largest number of bodies in a coupled group, by default."""


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot as a tree of rigid bodies; immutable. Made by :func:`load_urdf`. A wrong argument raises an InputError.

    The order of degrees of freedom is base to tip, depth first, with siblings sorted by joint name, which is
    Pinocchio's order. Units are SI: [rad], [kg m²] for revolute and continuous joints, [m], [kg] for prismatic.

    A mimic joint that is coupled to its leader is no degree of freedom. A coupled group is all moving joints from the
    lowest body that carries both leader and followers, exclusive, down to them; groups that share a joint are one. Its
    degrees of freedom come together, in base-to-tip order, before those of what the group carries.

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
        Limits [rad/s, m/s] and [N m, N]; infinite where there are none. These limits and those of position are a joint's
        own: a follower's do not bind its leader.
    damping, friction, effort_offset : ndarray, shape (nv,)
        Joint damping [N m s/rad, N s/m] and Coulomb friction [N m, N] as the URDF gives them, or parameters beside it, and
        the effort that is measured where none acts [N m, N]; a follower's reflected to its leader. No dynamic quantity holds
        them unless it is asked to.
    mimic_joints : tuple of str
        Joints that follow another one in the URDF.
    mimics : mapping
        :class:`Mimic` (leader, multiplier, offset) of each joint that is coupled to an independent one, by name; chains of
        mimics are followed to their end.
    coupled_groups : tuple of tuple of str
        Joints, independent ones and followers, of each coupled group, base to tip.
    fixed_joints : tuple of str
        Joints of the URDF that do not move.
    continuous_joints : tuple of str
        Joints whose position is an angle that turns round, be they independent or not.
    locked_joints : mapping
        Joints that are held, with their positions [rad, m]; followers of joints that stand still are among them.
    payloads : mapping
        :class:`Payload` by link name.
    total_mass : float
        Mass of all links and payloads [kg].
    """

    name: str
    dof_names: tuple[str, ...]
    coordinate_names: tuple[str, ...]
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    root_link: str
    floating_base: bool
    gravity: Array
    lower: Array
    upper: Array
    velocity_limit: Array
    effort_limit: Array
    damping: Array
    friction: Array
    effort_offset: Array
    mimic_joints: tuple[str, ...]
    mimics: Mapping[str, Mimic]
    coupled_groups: tuple[tuple[str, ...], ...]
    fixed_joints: tuple[str, ...]
    continuous_joints: tuple[str, ...]
    locked_joints: Mapping[str, float]
    payloads: Mapping[str, Payload]
    total_mass: float
    bodies: npt.NDArray[np.void] = field(repr=False)
    links: npt.NDArray[np.void] = field(repr=False)
    _tree: Tree = field(repr=False)
    _options: Options = field(repr=False)

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def nv(self) -> int:
        """Number of degrees of freedom."""
        return len(self.dof_names)

    @property
    def nq(self) -> int:
        """Number of position coordinates."""
        return len(self.coordinate_names)

    @property
    def orientations(self) -> tuple[int, ...]:
        """For each position coordinate, which component of a quaternion it is (x y z w: 0 to 3), or -1."""
        return self._tree.orientations

    @property
    def friction_velocity(self) -> float:
        """v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s]; 0 for f sign(q̇). A simulation's friction has none."""
        return self._options.friction_velocity

    @property
    def has_friction(self) -> bool:
        """Whether any joint has damping, Coulomb friction, or an offset of its effort."""
        return bool(self.damping.any() or self.friction.any() or self.effort_offset.any())

    @property
    def estimated_links(self) -> tuple[str, ...]:
        """Links whose inertia the URDF lacks and `estimate_inertias` has estimated, in the URDF's order."""
        return self._options.estimated_links

    @property
    def omitted(self) -> tuple[str, ...]:
        """What forward and inverse dynamics omit of an MJCF, such as ``spring of joint 'knee'``; empty for a URDF."""
        return self._options.omitted

    def with_omitted(self, omitted: Sequence[str]) -> RobotModel:
        """Return this model with these texts as :attr:`omitted`."""
        return replace(self, _options=self._options._replace(omitted=tuple(omitted)))

    @property
    def armature(self) -> Array:
        """Reflected rotor inertia [kg m², kg], shape (nv,), that of followers included."""
        moving, reflected = self.bodies[1:], np.zeros(self.nv)
        np.add.at(reflected, moving["dof"], moving["multiplier"] ** 2 * moving["armature"])
        reflected.flags.writeable = False
        return reflected

    @property
    def velocity_bound(self) -> Array:
        """Velocity limits, infinite where the URDF has 0, as authors write who know none; shape (nv,) [rad/s, m/s]."""
        return np.where(self.velocity_limit > 0.0, self.velocity_limit, np.inf)

    @property
    def effort_bound(self) -> Array:
        """Effort limits, infinite where the URDF has 0; shape (nv,) [N m, N]."""
        return np.where(self.effort_limit > 0.0, self.effort_limit, np.inf)

    @property
    def neutral(self) -> Array:
        """Positions of zero, floating joints at the identity; shape (nq,)."""
        return np.array([1.0 if orientation == 3 else 0.0 for orientation in self.orientations])

    def random(self, rng: np.random.Generator | int | None = None) -> Array:
        """Return random positions, shape (nq,): evenly within the limits, orientations evenly of all.

        Parameters
        ----------
        rng : numpy.random.Generator or int, optional
            Generator or seed. Without limits, angles are within a turn and positions within a metre of zero.
        """
        return random_positions(self, rng)

    def integrate(self, q: VectorLike, v: VectorLike) -> Array:
        """Return the positions reached from q along v, shape (nq,): v [rad, m], shape (nv,), is a rate times a time.

        q + v of joints of one degree of freedom; of a planar or floating joint, v is a twist in its own axes that is held
        for a unit of time, as in Pinocchio.
        """
        return integrated(self, q, v)

    def difference(self, q0: VectorLike, q1: VectorLike) -> Array:
        """Return v, shape (nv,), with ``integrate(q0, v)`` at q1: [rad, m].

        Of a planar and a floating joint, and of a continuous one that no other joint follows, it is the shorter way round,
        so that it may arrive a whole number of turns from q1, and a quaternion at −1 times it.
        """
        return difference(self, q0, q1)

    @cached_property
    def workspace(self) -> Workspace:
        """Arguments of sweeps; shared, so only for those that write to no memory of the workspace."""
        return Workspace(self.bodies, self.gravity)

    def with_gravity(self, gravity: VectorLike) -> RobotModel:
        """Return this model with another acceleration of gravity [m/s²], shape (3,); everything else is shared."""
        vector = gravity_vector(gravity)
        return replace(self, gravity=vector, _options=self._options._replace(gravity=vector))

    def with_payload(
        self, link: str, mass: float, com: VectorLike = (0.0, 0.0, 0.0), inertia: MatrixLike | None = None
    ) -> RobotModel:
        """Return this model with a payload on a link, in place of one that is there already; the rest is shared.

        Parameters
        ----------
        link : str
            Name of the link.
        mass, com, inertia
            See :class:`Payload`. Mass 0 takes the payload off. Joints that ``massless="lock"`` holds stay held.

        Raises
        ------
        InputError
            No such link, or numbers that are not finite or of the wrong shape.
        MasslessLinkError
            Without the payload a joint moves no inertia.
        """
        if link not in self.link_names:
            raise InputError(f"payloads: {link!r} is not a link of robot '{self.name}'.")
        payloads = {name: payload for name, payload in self.payloads.items() if name != link}
        added = checked_payloads({link: (mass, com) if inertia is None else (mass, com, inertia)}, self._tree.robot)
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
        refuse_massless(model, self._tree, massless_freedoms(model))
        return model

    def without_payload(self, link: str) -> RobotModel:
        """Return this model without the payload of a link."""
        return self.with_payload(link, 0.0)

    def with_parameters(self, parameters: str | os.PathLike[str] | Parameters | Mapping[str, Any]) -> RobotModel:
        """Return this model with parameters beside its URDF: friction, offsets, rotor inertias, inertias of links, payloads.

        Payloads are added to those that are there. ``massless="lock"`` is applied again.

        Parameters
        ----------
        parameters : str, os.PathLike, Parameters or dict
            Path of a file, see :class:`Parameters`; or a dict with the file's keys.

        Raises
        ------
        InputError
            The file cannot be read, an entry is unknown or has a wrong value, the robot lacks a joint or link that it names,
            or more is taken off a link than moves with it.
        MasslessLinkError
            With them a joint moves no inertia.
        """
        given = parameters_of(parameters)
        robot = robot_with(self._tree.robot, given)
        options = self._options._replace(
            armature=self._options.armature | armature_by_joint(of_joints(given, "armature"), robot),
            effort_offset=self._options.effort_offset | of_joints(given, "effort_offset"),
            held=None,
        )
        if given.friction_velocity is not None:
            options = options._replace(friction_velocity=given.friction_velocity)
        return _model_beside(robot, self._tree.root, options, given)

    def perturbed(self, part: float, seed: int = 0) -> RobotModel:
        """Return this model with random errors of its inertias, as a real robot has compared to its URDF.

        Parameters
        ----------
        part : float
            Largest relative error of masses, of centres in radii of gyration, and twice that of lengths; from 0 to 0.9.
            Rigid bodies stay such. Payloads, rotors and friction do not change.
        seed : int
            Seed of the errors, >= 0.
        """
        number("part", part, "a number from 0 to 0.9", lambda x: 0.0 <= x <= 0.9)
        number("seed", seed, "a whole number >= 0", lambda x: x >= 0.0 and x == int(x))
        links = perturbed_links(self._tree.robot, part, np.random.default_rng(int(seed)))
        return self.with_parameters(Parameters(links=links))

    def with_locked_joints(self, locked_joints: Mapping[str, float]) -> RobotModel:
        """Return this model with exactly these positions [rad, m] of locked joints, by name; empty releases all.

        Joints that other options of load_urdf lock are added.
        """
        robot = self._tree.robot
        options = self._options._replace(locked=locked_positions(locked_joints, robot), held=None)
        return _model(robot, self._tree.root, options)

    def placement_in_root(self, link: str) -> Array:
        """Return the placement (4x4) in the root link of a link that is rigidly attached to it."""
        body, placement = self.placement_in_body(link)
        if body != self._tree.links[0][1]:
            raise InputError(f"link '{link}' is not rigidly attached to the root link '{self.root_link}'.")
        return placement

    def placement_in_body(self, link: str) -> tuple[int, Array]:
        """Return the index of the body of a link, and the link's placement (4x4) in the frame of that body."""
        if link not in self.link_names:
            raise InputError(f"'{link}' is not a link of robot '{self.name}'.")
        _, body, placement = self._tree.links[self.link_names.index(link)]
        return body, placement

    def __repr__(self) -> str:
        return f"<RobotModel '{self.name}': {self.nv} dof, {len(self.link_names)} links, {self.total_mass:.6g} kg>"

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self._tree.robot, self._tree.root, self._options)


def load_urdf(
    source: str | bytes | os.PathLike[str] | IO[Any],
    floating_base: bool = False,
    gravity: VectorLike = (0.0, 0.0, -9.81),
    mimic: Literal["embed", "free", "lock"] = "embed",
    massless: Literal["error", "lock"] = "error",
    locked_joints: Mapping[str, float] | None = None,
    armature: Mapping[str, float] | float | None = None,
    payloads: Mapping[str, Payload | tuple[Any, ...]] | None = None,
    max_joints: int = MAX_JOINTS,
    max_coupled: int = MAX_COUPLED,
    friction_velocity: float | None = None,
    xacro_args: Mapping[str, Any] | None = None,
    estimate_inertias: float | None = None,
    parameters: str | os.PathLike[str] | Parameters | Mapping[str, Any] | None = None,
) -> RobotModel:
    """Build a model from a URDF; meshes are read by `estimate_inertias` only.

    Parameters
    ----------
    source : str, bytes, os.PathLike or file
        Path of a URDF file, an open one, or XML text. A file whose name ends with .xacro is expanded by the package `xacro`,
        if that is installed; its arguments may follow the path: ``"arm.urdf.xacro prefix:=left_"``.
    floating_base : bool
        Whether the root link moves freely.
    gravity : array_like, shape (3,)
        Acceleration of gravity in the world's axes, those of the root link of a fixed base [m/s²], within ±1000.
    mimic : {"embed", "free", "lock"}
        Treatment of mimic joints: couple them to their leaders, exactly; treat them as independent; or lock them at the
        positions that belong to leaders at zero, or at their locked positions.
    massless : {"error", "lock"}
        Treatment of joints that move no inertia: raise, or lock them at zero or, where that is outside their limits,
        at the limit next to it.
    locked_joints : dict
        Positions [rad, m] of locked joints. These numbers, and those of `armature` and `payloads`, are within ±1e9; those of
        the URDF within ±1e30.
    armature : dict or float
        Reflected rotor inertia [kg m², prismatic: kg] by joint name, or one number for all joints of one degree of
        freedom. It replaces that of `parameters`, which replaces N²J of the URDF's transmissions: their rotor inertia J
        (<drake:rotor_inertia>, <rotorInertia>) and reduction N (<drake:gear_ratio>, <mechanicalReduction>,
        <mechanical_reduction>).
    payloads : dict
        :class:`Payload`, or a tuple of its fields, by link name.
    max_joints : int
        Maximum number of joints, fixed ones included. The largest public robots have some 200; loading takes time and memory
        in proportion.
    max_coupled : int
        Maximum number of bodies of a coupled group, see `coupled_groups`. An evaluation takes time as its cube.
    friction_velocity : float
        v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s]; 0 for f sign(q̇). By default that of `parameters`, or 5e-3.
    xacro_args : dict
        Arguments of a xacro file, by name.
    estimate_inertias : float
        Density [kg/m³] of links that have geometry and no <inertial>. Their collision geometry counts, else the visual one; a
        mesh that is not watertight by its convex hull. :attr:`RobotModel.estimated_links` names them. It opens the files
        that the URDF names, so it is not for untrusted descriptions; meshes need trimesh.
    parameters : str, os.PathLike, Parameters or dict
        Friction, offsets, rotor inertias, inertias of links and payloads beside the URDF, see :class:`Parameters`; `armature`
        and `friction_velocity` have precedence over those in it.

    Returns
    -------
    RobotModel

    Raises
    ------
    UrdfError
        The URDF is malformed, not a tree, or has more joints than `max_joints`; or a xacro file cannot be expanded.
    MimicJointError
        Mimic joints follow themselves, a joint that does not exist, or one of several degrees of freedom; or a coupled
        group is larger than `max_coupled`.
    MasslessLinkError
        Joints move no inertia: the mass matrix would be singular.
    InputError
        An argument has a wrong value.

    Warns
    -----
    ModelWarning
        The URDF has probable mistakes: unknown attributes or version, an axis without xyz, angles in degrees. One warning
        names all of them.
    InertiaWarning
        A link's inertia is not that of any rigid body. With `estimate_inertias`, which links' are estimated, and of which no
        inertia could be.
    """
    choice("mimic", mimic, ("embed", "free", "lock"))
    choice("massless", massless, ("error", "lock"))
    vector = gravity_vector(gravity)
    folder, source = folder_of(source), expanded(source, xacro_args)
    found = None
    if estimate_inertias is not None:
        found = estimated(urdf_text(source), estimate_inertias, folder)
        source = found.text
    element = parse_urdf(urdf_text(source).encode(errors="replace"))
    robot, root = read_element(element, whole("max_joints", max_joints))
    beside = Parameters() if parameters is None else parameters_of(parameters)
    robot = robot_with(robot, beside)
    rotors, left_out = reflected_inertias(element)
    if mistakes := warning_of(robot.name, [*remarks_of(element), *limits_in_degrees(element), *left_out]):
        warn(mistakes)
    warn_of_inertias(robot, found.said(robot.name) if found else "", beside.lighter_links)
    if friction_velocity is None:
        friction_velocity = FRICTION_VELOCITY if beside.friction_velocity is None else beside.friction_velocity
    options = Options(
        bool(floating_base),
        vector,
        mimic,
        massless,
        locked_positions({} if locked_joints is None else locked_joints, robot),
        rotors | armature_by_joint(of_joints(beside, "armature"), robot) | armature_by_joint(armature, robot),
        of_joints(beside, "effort_offset"),
        checked_payloads({} if payloads is None else payloads, robot),
        whole("max_coupled", max_coupled),
        friction_velocity=friction_velocity_of(friction_velocity),
        estimated_links=tuple(estimate.link for estimate in found.estimates) if found else (),
    )
    return _model_beside(robot, root, options, beside)


def _model_beside(robot: Any, root: str, options: Options, given: Parameters) -> RobotModel:
    """Build the model of a robot with parameters applied; the mass that they take off must be there."""
    lighter = given.lighter_links
    if lighter:
        refuse_too_light(_tree(robot, root, options, options.held or {}), lighter, given.origin)
    return _model(robot, root, options)


def _model(robot: Any, root: str, options: Options) -> RobotModel:
    """Build the model of a robot with all options."""
    tree = _tree(robot, root, options, options.held or {})
    model = _model_of(tree, options)
    found = massless_freedoms(model)
    held: dict[str, float] = {}
    while options.massless == "lock" and options.held is None and len(found[0]):
        more = positions_to_hold(model, tree, found)
        if not more:
            break
        held |= more
        tree = _tree(robot, root, options, held)
        model = _model_of(tree, options)
        found = massless_freedoms(model)
    refuse_massless(model, tree, found)
    return model if options.held is not None else replace(model, _options=options._replace(held=held))


def _tree(robot: Any, root: str, options: Options, held: dict[str, float]) -> Tree:
    """Walk the robot with more joints locked than the options lock."""
    mimics, held = resolve_mimics(robot, options.mimic, options.locked | held)
    tree = Tree(robot, root, options.floating_base, held, mimics)
    for group, size in zip(tree.groups, tree.group_sizes, strict=True):
        if size > options.max_coupled:
            raise MimicJointError(
                f"robot '{robot.name}' has a group of {len(group)} coupled joints, '{group[0]}' to '{group[-1]}', of {size} "
                f"bodies, and no more than {options.max_coupled} are accepted. Raise max_coupled, or "
                "take every joint as independent by mimic='free'.",
                group,
            )
    return tree


def _restored(robot: Any, root: str, options: Options) -> RobotModel:
    """Build a model from its pickled parts, whose arrays are writeable again."""
    return _model(robot, root, options._replace(payloads=checked_payloads(options.payloads, robot)))


def _model_of(tree: Tree, options: Options) -> RobotModel:
    """Build the model of a tree."""
    bodies, links = tree.records(options.armature, options.payloads)
    refuse_same_names("degrees of freedom", tree.dof_names)
    refuse_same_names("positions", tree.coordinate_names)
    return RobotModel(
        name=tree.robot.name,
        dof_names=tree.dof_names,
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
        damping=tree.resistance("damping", 2),
        friction=tree.resistance("friction", 1),
        effort_offset=tree.reflected(options.effort_offset),
        mimic_joints=tuple(j.name for j in tree.robot.joints if j.mimic is not None and j.type != "fixed"),
        mimics=MappingProxyType(tree.mimics),
        coupled_groups=tuple(tree.groups),
        fixed_joints=tree.of_type("fixed"),
        continuous_joints=tree.of_type("continuous"),
        locked_joints=MappingProxyType(dict(tree.locked)),
        payloads=MappingProxyType(dict(options.payloads)),
        total_mass=float(links["mass"].sum()),
        bodies=bodies,
        links=links,
        _tree=tree,
        _options=options,
    )
