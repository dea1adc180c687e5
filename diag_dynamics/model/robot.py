# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""RobotModel: names, limits, inertias and options of a robot."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import choice, vector
from diag_dynamics.description.description import (
    Description,
    FlexibleJoint,
)
from diag_dynamics.description.options import with_gravity, with_locked_joints, with_payloads
from diag_dynamics.description.parameters import (
    Parameters,
    read_parameters,
    with_parameters,
)
from diag_dynamics.exceptions import InputError, UnsupportedError, attribute_error
from diag_dynamics.model.joint_types import is_angle, places
from diag_dynamics.model.loops import coupled_tree, coupling_tables
from diag_dynamics.model.massless import massless_freedoms, positions_to_hold, reject_massless
from diag_dynamics.model.mimic import FollowerMotion, FollowerState, closed, limit_by_followers
from diag_dynamics.model.tree import Tree, resolve_mimics
from diag_dynamics.rigid_body import RigidBody, not_physical, symmetric
from diag_dynamics.sweeps import joints, kinematics
from diag_dynamics.sweeps.memory import Workspace

REACH = 1.0  # distance from zero of random positions without limits [m]; angles are within ±π


class RobotModel:
    """A robot as a tree of rigid bodies.

    It is immutable, and made by :func:`load_urdf`. A wrong argument raises an InputError.

    Degrees of freedom are in Pinocchio's order: base to tip, depth first, with siblings sorted by
    joint name. Units are SI: [rad], [kg m²] for revolute and continuous joints, [m], [kg] for
    prismatic.

    A mimic joint that is coupled to its leader is no degree of freedom. A coupled group is all
    moving joints from the lowest body that carries both leader and followers, exclusive, down to
    them; groups that share a joint are one. Its degrees of freedom come together, before those of
    what the group carries.

    A planar joint moves in the plane normal to its axis: positions x, y, theta, rates v_x, v_y, w_z
    in the moving body's axes. A floating joint has positions x y z qx qy qz qw and as rates the
    body's twist in its own axes, linear first.

    Attributes
    ----------
    description : Description
        Records of links and joints that the model is made of. Models share it: never change it.
    name, root_link : str
        Name of the robot, and the link that is fixed in the world, or moves freely.
    floating_base : bool
        Whether the root link moves freely.
    nv, nq : int
        Numbers of degrees of freedom and of position coordinates.
    dof_names, coordinate_names : tuple of str
        The nv degrees of freedom, the order of every vector of rates or efforts, and the nq
        position coordinates: a joint's name, or ``<joint>/v_x`` … ``<joint>/w_z``, ``<joint>/x`` …
        ``<joint>/qw`` of a joint of several; the joint of a floating base is ``root_joint``.
    orientations : tuple of int
        For each position coordinate, which component of a quaternion it is (x y z w: 0 to 3), or
        -1.
    joint_names, fixed_joints, mimic_joints : tuple of str
        Joints that move, in the same order; joints of the URDF that do not move; those that follow
        another one there.
    continuous_joints : tuple of str
        Joints whose position is an angle that turns round, be they independent or not.
    link_names : tuple of str
        All links, base to tip: the order of link energies.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in the world's axes, those of the root link of a fixed base [m/s²].
    lower, upper : ndarray, shape (nq,)
        Position limits [rad, m]; infinite where there are none. Those of mimic joints do not bind
        their leaders. A joint that others follow by changing ratios stays where they are within
        theirs and its loop can be closed.
    velocity_limit, effort_limit, velocity_bound, effort_bound : ndarray, shape (nv,)
        Limits [rad/s, m/s] and [N m, N] of the URDF; infinite where it has none. Bounds are
        infinite where it has 0, too.
    damping, friction, effort_offset : ndarray, shape (nv,)
        Joint damping [N m s/rad, N s/m], Coulomb friction [N m, N], and the effort that is measured
        where none acts [N m, N], of the URDF or parameters beside it, those of mimic joints
        included. Dynamics ignores them by default.
    follower_damping, follower_friction : ndarray
        Damping and Coulomb friction of each of `followers` by its own rate.
    load_friction, root_friction : ndarray, shape (nv,)
        Coulomb friction by the torque of gravity [1], and friction by √|q̇| [N m √(s/rad), N
        √(s/m)], of parameters.
    effort_scale : mapping
        Effort by reported unit [N m, N] of joints whose parameters have it, by name; readers of
        joint states apply it.
    friction_velocity : float
        v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s]; 0 for f sign(q̇). A simulation's friction
        has none.
    armature : ndarray, shape (nv,)
        Reflected rotor inertia [kg m², kg], that of mimic joints included. A flexible joint has B
        where its effort is the motor's, as if it were rigid, and 0 where it is the spring torque.
    flexible_joints : mapping
        :class:`FlexibleJoint` of degrees of freedom with a spring, by name.
    mimics : mapping
        :class:`Mimic` (leader, multiplier, offset) of each joint that is coupled to an independent
        one, by name.
    flexible_links : mapping
        :class:`FlexibleLink`: modes, frequencies and shapes of links that bend, by name.
    followers, loops, loop_joints : mapping, tuple of tuple of Loop, tuple of tuple of str
        Independent joints by each joint that follows them by changing ratios; loops and joints of
        each closed group.
    coupled_groups : tuple of tuple of str
        Joints, independent ones and followers, of each coupled group, base to tip.
    locked_joints : mapping
        Joints that are held, with their positions [rad, m]; followers of joints that stand still
        are among them.
    payloads : mapping
        :class:`Payload` by link name; `total_mass` : float, the mass of all links and payloads
        [kg].
    omitted : tuple of str
        What forward and inverse dynamics omit of an MJCF, such as ``spring of joint 'knee'``, and
        limits of `followers`.
    """

    def __init__(self, tree: Tree) -> None:
        description = tree.description
        joints = description.joints
        springs = flexible_joints(tree)
        bodies, links = tree.records(description.payloads)
        coupled = tree.coupled
        groups = coupled.groups if coupled else []
        self.name = description.name
        self.dof_names = tree.dof_names
        self.coordinate_names = tree.coordinate_names
        self.nv = len(tree.dof_names)
        self.nq = len(tree.coordinate_names)
        self.joint_names = tuple(joint.name for joint in tree.joints)
        self.fixed_joints = tuple(n for n, j in joints.items() if j.type == "fixed")
        self.mimic_joints = tuple(
            name
            for name, joint in joints.items()
            if joint.mimic is not None and joint.type != "fixed"
        )
        self.continuous_joints = tuple(
            name for name, joint in joints.items() if joint.type == "continuous"
        )
        self.link_names = tuple(link.name for link, _, _ in tree.links)
        self.root_link = description.root
        self.floating_base = description.floating_base
        self.gravity = np.array(description.gravity, float)
        self.lower = tree.per_dof("lower", "coordinates")
        self.upper = tree.per_dof("upper", "coordinates")
        self.velocity_limit = tree.per_dof("velocity")
        self.effort_limit = tree.per_dof("effort")
        self.damping = tree.reflected("damping", 2)
        self.friction = tree.reflected("friction", 1)
        self.effort_offset = tree.reflected("effort_offset")
        self.load_friction = tree.reflected("load_friction", 0.0)
        self.root_friction = tree.reflected("root_friction", 1.5)
        self.effort_scale = MappingProxyType(
            {
                name: joint.effort_scale
                for name, joint in joints.items()
                if joint.effort_scale is not None
            }
        )
        self.flexible_joints = MappingProxyType(springs)
        self.friction_velocity = description.friction_velocity
        self.mimics = MappingProxyType(tree.mimics)
        self.followers = MappingProxyType(coupled.followers if coupled else {})
        self.loops = tuple(tuple(group.loops) for group in groups)
        self.loop_joints = tuple(
            tuple(name for name in tree.moving if name in group.joints) for group in groups
        )
        self.coupling_tables = (
            coupling_tables(tree, coupled) if coupled and coupled.followers else None
        )
        self.flexible_links = MappingProxyType(description.flexible.links)
        self.follower_damping = tree.of_followers("damping")
        self.follower_friction = tree.of_followers("friction")
        reject_friction(tree, self.followers)
        self.coupled_groups = tuple(tree.groups)
        self.locked_joints = MappingProxyType(tree.locked)
        self.payloads = MappingProxyType(description.payloads)
        self.total_mass = float(links["mass"].sum())
        self.omitted = description.omitted
        self.orientations = tree.orientations
        self.bodies = bodies
        self.links = links
        self.description = description
        self._tree = tree
        if self.followers:
            limits = limit_by_followers(self, tree.moving, self.lower, self.upper)
            self.omitted = *self.omitted, *limits
        self._freeze()

    def _freeze(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        vars(self)["_is_frozen"] = True

    def __setattr__(self, name: str, value: object) -> None:
        if "_is_frozen" in vars(self):
            raise AttributeError(f"A RobotModel is immutable: {name} cannot be set.")
        super().__setattr__(name, value)

    def _with(self, **changes: object) -> RobotModel:
        """Return this model with other values of some attributes; the rest is shared."""
        model = object.__new__(RobotModel)
        vars(model).update(vars(self) | changes)
        vars(model).pop("workspace", None)
        model._freeze()
        return model

    @property
    def has_friction(self) -> bool:
        """Whether any joint has friction of any kind, or an offset of its effort."""
        kinds = self.damping, self.friction, self.load_friction, self.root_friction
        followers = self.follower_damping, self.follower_friction
        return any(np.any(kind) for kind in (*kinds, self.effort_offset, *followers))

    @property
    def has_follower_friction(self) -> bool:
        """Whether a joint has friction that follows others by changing ratios."""
        return bool(self.follower_damping.any() or self.follower_friction.any())

    @property
    def armature(self) -> Array:  # noqa: D102  # with the other attributes
        moving = self.bodies[1:]
        reflected = np.zeros(self.nv)
        np.add.at(reflected, moving["dof"], moving["multiplier"] ** 2 * moving["armature"])
        reflected.flags.writeable = False
        return reflected

    @property
    def velocity_bound(self) -> Array:  # noqa: D102
        return np.where(self.velocity_limit > 0.0, self.velocity_limit, np.inf)

    @property
    def effort_bound(self) -> Array:  # noqa: D102
        return np.where(self.effort_limit > 0.0, self.effort_limit, np.inf)

    @property
    def neutral(self) -> Array:
        """Positions of zero, floating joints at the identity; shape (nq,)."""
        return self._tree.neutral.copy()

    @property
    def start(self) -> Array:
        """Positions at which loops are closed first, otherwise :attr:`neutral`; shape (nq,)."""
        return self._tree.start.copy()

    def followers_at(self, q: VectorLike, qd: VectorLike | None = None) -> FollowerState:
        """Return the :class:`FollowerState` at q, shape (nq,), and q̇, shape (nv,).

        The robot is at rest by default. It has positions, rates and ratios of mimic joints and
        `followers`. Raise LoopError where a loop cannot be closed.
        """
        rate = None if qd is None else vector("qd", qd, self.dof_names)
        return FollowerMotion(self).at(self._positions("q", q), rate)

    def random(self, rng: np.random.Generator | int | None = None) -> Array:
        """Return random positions, shape (nq,), evenly within limits, ±π or ±1 m.

        `rng` may be a seed.

        Where loops cannot be closed, their joints are moved toward the start until they are.
        """
        try:
            rng = np.random.default_rng(rng)  # a generator is itself
        except (TypeError, ValueError) as error:
            raise InputError(
                f"rng is {rng!r}; expected a numpy.random.Generator or a seed."
            ) from error
        free = np.where(is_angle(self), math.pi, REACH)
        has_lower = np.isfinite(self.lower)
        has_upper = np.isfinite(self.upper)
        # With one limit alone, the range begins or ends there.
        lower = np.where(has_lower, self.lower, np.where(has_upper, self.upper - 2.0 * free, -free))
        upper = np.where(has_upper, self.upper, np.where(has_lower, self.lower + 2.0 * free, free))
        q = rng.uniform(lower, upper)
        for k, component in enumerate(self.orientations):
            if component == 3:
                quaternion = rng.normal(size=4)
                q[k - 3 : k + 1] = quaternion / np.linalg.norm(quaternion)
        return closed(self, q) if self.loops else q

    def integrate(self, q: VectorLike, v: VectorLike) -> Array:
        """Return the positions reached from q along v, shape (nq,).

        v [rad, m], shape (nv,), is a rate times a time. They are q + v but for planar and floating
        joints, whose v is a twist in their own axes.
        """
        q = self._positions("q", q)
        v = vector("v", v, self.dof_names)
        result = np.empty(self.nq)
        if kinematics.integrate(self.workspace.robot, q, v, result):
            raise InputError("q and v are too large: a result overflows.")
        return result

    def difference(self, q0: VectorLike, q1: VectorLike) -> Array:
        """Return v, shape (nv,), with ``integrate(q0, v)`` at q1: [rad, m].

        Of a planar and a floating joint, and of a continuous one that no other joint follows, it is
        the shorter way round.
        """
        turning = set(self.continuous_joints) - {mimic.leader for mimic in self.mimics.values()}
        turns = np.array([1.0 if name in turning else 0.0 for name in self.dof_names])
        q0 = self._positions("q0", q0)
        q1 = self._positions("q1", q1)
        v = np.empty(self.nv)
        if kinematics.difference(self.workspace.robot, q0, q1, turns, v):
            raise InputError("q0 and q1 are too large: a result overflows.")
        return v

    def modal_effort(self, q: VectorLike, qd: VectorLike) -> Array:
        """Return the efforts of stiffness and damping on modes of flexible links, shape (nv,).

        They are zero on other joints. A :class:`Simulation` has them; dynamics is without, as it is
        without friction: add them to tau.
        """
        q = self._positions("q", q)
        rates = vector("qd", qd, self.dof_names)
        effort = np.zeros(self.nv)
        for link in self.flexible_links.values():
            dofs = places(link.modes, self.dof_names)
            positions = q[places(link.modes, self.coordinate_names)]
            effort[dofs] = link.effort(positions, rates[dofs])
        return effort

    def _positions(self, name: str, q: VectorLike) -> Array:
        """Return positions as a new array; each quaternion has length 1."""
        q = vector(name, q, self.coordinate_names)
        for k, component in enumerate(self.orientations):
            quaternion = q[k - 3 : k + 1]
            if component == 3 and abs(quaternion @ quaternion - 1.0) >= joints.UNIT_TOLERANCE:
                raise InputError(
                    f"{name} of joint '{self.coordinate_names[k].rpartition('/')[0]}' has the "
                    f"quaternion {quaternion.tolist()} (x, y, z, w); expected one of length 1."
                )
        return q

    @cached_property
    def workspace(self) -> Workspace:
        """Arguments of sweeps.

        Shared, so only for those that write to no memory of the workspace.
        """
        return self.new_workspace()

    def new_workspace(self) -> Workspace:
        """Return arguments of sweeps with memory of their own."""
        return Workspace(self.bodies, self.gravity, self.coupling_tables)

    def with_gravity(self, gravity: VectorLike) -> RobotModel:
        """Return this model with another acceleration of gravity [m/s²], shape (3,).

        Everything else is shared.
        """
        description = with_gravity(self.description, gravity)
        return self._with(gravity=description.gravity, description=description)

    def with_payload(
        self,
        link: str,
        mass: float,
        com: VectorLike = (0.0, 0.0, 0.0),
        inertia: MatrixLike | None = None,
    ) -> RobotModel:
        """Return this model with a payload on a link, in place of one that is there already.

        `mass`, `com` and `inertia` are those of :class:`Payload`; mass 0 takes the payload off.
        Joints that ``massless="lock"`` holds stay held.
        """
        load = (mass, com) if inertia is None else (mass, com, inertia)
        return build(with_payloads(self.description, {**self.payloads, link: load}))

    def without_payload(self, link: str) -> RobotModel:
        """Return this model without the payload of a link."""
        return self.with_payload(link, 0.0)

    def with_parameters(
        self, parameters: str | os.PathLike[str] | Parameters | Mapping[str, Any]
    ) -> RobotModel:
        """Return this model with parameters beside its URDF.

        They are friction, offsets, rotor inertias, inertias of links, and payloads. The argument is
        the path of a file, see :class:`Parameters`, or a dict with the file's keys. Payloads are
        added to those that are there. ``massless="lock"`` is applied again.
        """
        parameters = read_parameters(parameters)
        if flexible := sorted(parameters.links.keys() & self.flexible_links.keys()):
            raise InputError(
                f"parameters: link '{flexible[0]}' is flexible, "
                "and its inertia is divided among its modes."
                " Give the parameters to load_urdf."
            )
        description = with_parameters(self.description, parameters)
        return build(description._replace(held={}), parameters)

    def with_spring_efforts(self) -> RobotModel:
        """Return the model of the links, where efforts of flexible joints are those of springs."""
        joints = [
            joint._replace(spring=joint.spring._replace(effort="spring"))
            for joint in self.description.joints.values()
            if joint.spring is not None
        ]
        return build(self.description.with_joints(*joints)._replace(massless="error"))

    def with_locked_joints(self, locked_joints: Mapping[str, float]) -> RobotModel:
        """Return this model with exactly these positions [rad, m] of locked joints, by name.

        An empty mapping releases all. Joints that other options of load_urdf lock are added.
        """
        return build(with_locked_joints(self.description, locked_joints))

    def placement_in_root(self, link: str) -> Array:
        """Return the placement (4x4) in the root link of a link that is rigidly attached to it."""
        body, placement = self.placement_in_body(link)
        if body != self._tree.links[0][1]:
            raise InputError(
                f"link is '{link}'; expected one rigidly attached to root link '{self.root_link}'."
            )
        return placement

    def placement_in_body(self, link: str) -> tuple[int, Array]:
        """Return the index of a link's body, and the link's placement (4x4) in the body's frame."""
        choice("link", link, self.link_names)
        _, body, placement = self._tree.links[self.link_names.index(link)]
        return body, placement

    def first_body(self, joint: str) -> int:
        """Return the first body of a joint that moves."""
        return int(self._tree.first_body(joint))

    if not TYPE_CHECKING:  # mypy would accept any attribute

        def __getattr__(self, name):
            raise attribute_error(self, name)

    def __repr__(self) -> str:
        return (
            f"<RobotModel '{self.name}': {self.nv} dof, {len(self.link_names)} links, "
            f"{self.total_mass:.6g} kg>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self.description,)


def tree_of(description: Description) -> Tree:
    """Return the tree of a description, its mimic joints and loops resolved."""
    mimics, locked = resolve_mimics(description)
    if description.loops or description.curves or description.flexible.groups:
        return coupled_tree(description, mimics, locked)
    return Tree(description, locked, mimics)


def build(description: Description, applied: Parameters | None = None) -> RobotModel:
    """Build the model of a description; the mass that applied parameters take off must be there."""
    while True:
        tree = tree_of(description)
        if applied is not None:
            reject_too_light(tree, applied)
        model = RobotModel(tree)
        massless, smallest = massless_freedoms(model, tree)
        more = positions_to_hold(model, massless) if description.massless == "lock" else {}
        if not more:
            reject_massless(model, tree, massless, smallest)
            return model
        description = description._replace(held={**description.held, **more})


def _restored(description: Description) -> RobotModel:
    """Build a model from its pickled description, whose arrays are writeable again."""
    return build(with_payloads(description, description.payloads))


def flexible_joints(tree: Tree) -> dict[str, FlexibleJoint]:
    """Return the springs of degrees of freedom, in their order.

    InputError names joints that cannot have one.
    """
    springs = {}
    for name, joint in tree.description.joints.items():
        if joint.spring is None:
            continue
        springs[name] = joint.spring
        if joint.armature:
            raise InputError(
                f"flexible_joints: '{name}' has armature {joint.armature:g}; expected none. "
                "Set its rotor_inertia and gear."
            )
        if name not in (*tree.dof_names, *tree.locked):
            raise InputError(
                f"flexible_joints: '{name}' follows other joints; expected a degree of freedom."
            )
    return {name: springs[name] for name in tree.dof_names if name in springs}


def reject_friction(tree: Tree, followers: Iterable[str]) -> None:
    """Reject parameters of followers that no method reflects."""
    for kind in ("effort_offset", "load_friction", "root_friction"):
        for name in followers:
            if value := getattr(tree.description.joints[name], kind):
                raise UnsupportedError(
                    f"parameters: {kind} of joint '{name}' is {value:g}; expected 0, "
                    "because it follows other joints."
                )


def reject_too_light(tree: Tree, parameters: Parameters) -> None:
    """Reject payloads that take more mass off a link than moves with it."""
    bodies, _ = tree.records({})
    body_of = {link.name: body for link, body, _ in tree.links}
    for name in parameters.lighter_links:
        body = bodies[body_of[name]]
        mass = float(body["mass"])
        reason = None
        if mass > 0.0:
            whole = RigidBody.about_origin(mass, body["first_moment"], symmetric(body["inertia"]))
            reason = not_physical(whole.inertia, mass)
        if mass > 0.0 and not reason:
            continue
        raise InputError(
            f"parameters: a payload of negative mass is on link '{name}', which leaves "
            f"{mass:.3g} kg {reason or ''}: more is taken off than moves with that link."
        )
