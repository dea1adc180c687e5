# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Description of a robot as records: links, joints and loops of a URDF or an MJCF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import vector
from diag_dynamics.exceptions import InputError
from diag_dynamics.rigid_body import RigidBody
from diag_dynamics.rotations import from_rpy, pose
from diag_dynamics.text import listed

SINGLE = "revolute", "continuous", "prismatic"
"""Types of joints of one degree of freedom."""

JOINT_TYPES = (*SINGLE, "fixed", "floating", "planar")

FRICTION_VELOCITY = 5e-3
"""Default v₀ [rad/s, m/s]: estimated velocities at rest are milliradians per second."""

LARGEST_INERTIA = 1e9
"""Largest mass, length, inertia or armature accepted, in SI units."""

LOOP_TYPES = {"point": 1, "revolute": 2, "weld": 3}
"""Pairs of points that coincide, by the type of a loop."""


class Payload(NamedTuple):
    """A rigid body attached to a link, in the link's axes.

    `mass` [kg]; `com`, shape (3,), the centre of mass from the link's origin [m]; `inertia`, shape
    (3, 3), about the centre of mass [kg m²], that of a point by default.
    """

    mass: float
    com: VectorLike = (0.0, 0.0, 0.0)
    inertia: MatrixLike = ((0.0,) * 3,) * 3

    @property
    def body(self) -> RigidBody:
        """The same as a :class:`RigidBody`."""
        return RigidBody(self.mass, np.asarray(self.com, float), np.asarray(self.inertia, float))

    @property
    def inertial(self) -> Inertial:
        """The same as an :class:`Inertial`."""
        return Inertial(self.mass, pose(self.body.centre), self.body.inertia)


class FlexibleJoint(NamedTuple):
    """Spring and rotor of a joint in the reduced model.

    The energy of a rotor is that of its own spin alone. With the motor's position θ = θ_motor/N and
    the link's q the spring torque is τ_J = k(θ − q) + d(θ̇ − q̇), and B = N²J_rotor. Joint states
    carry the position of the "motor" (θ) or the "link" (q), and the effort of the "motor" (N
    τ_motor) or of the "spring" (τ_J).
    """

    stiffness: float  # k [N m/rad, N/m]
    rotor_inertia: float  # J_rotor, at the motor [kg m²]
    damping: float = 0.0  # d [N m s/rad, N s/m]
    gear: float = 1.0  # N [1, prismatic: rad/m]
    position: str = "motor"
    effort: str = "motor"

    @property
    def reflected_inertia(self) -> float:
        """B [kg m², kg]."""
        return self.gear**2 * self.rotor_inertia


class Mimic(NamedTuple):
    """Coupling of a joint to another one: position = multiplier · leader's position + offset.

    The multiplier is in [rad/rad, or as the joints are, m/rad, rad/m], the offset in [rad, m]. The
    leader in a model's `mimics` is independent.
    """

    leader: str
    multiplier: float
    offset: float


class Curve(NamedTuple):
    """A joint whose position is a function of that of another one, as pieces of a polynomial.

    A row of `pieces` has the source's position where a piece begins, and coefficients of the
    distance from there, the constant first.
    """

    source: str
    pieces: Array

    def __call__(self, x: float) -> float:
        """Return the position at a position of the source."""
        row = self.pieces[max(0, int(np.searchsorted(self.pieces[:, 0], x, "right")) - 1)]
        return float(np.polynomial.Polynomial(row[1:])(x - row[0]))


class LoopEnd(NamedTuple):
    """A frame on a link where a loop is closed, in the link's frame.

    Its position is in m, its roll, pitch and yaw in rad.
    """

    link: str
    xyz: tuple[float, ...] = (0.0, 0.0, 0.0)
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)

    @property
    def placement(self) -> Array:
        """The frame (4, 4) in the link."""
        return pose(self.xyz, from_rpy(*self.rpy))


class Loop(NamedTuple):
    """A loop that is closed where two frames meet.

    Their origins meet ("point"), or axes too ("revolute"), or all of both ("weld"). `axis` is in
    both frames. `independent` are joints of the loop whose rates are degrees of freedom, chosen if
    it is empty. `start` has positions [rad, m] near those in which loops are first closed, by
    joint: they choose the branch. Those of all loops of a robot count for each of its loops.
    """

    name: str
    a: LoopEnd
    b: LoopEnd
    type: str = "point"
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)
    independent: tuple[str, ...] = ()
    start: Mapping[str, float] = {}  # never changed

    @property
    def points(self) -> list[tuple[Array, Array]]:
        """Pairs of points that coincide, each in the frame of its link."""
        axis = np.asarray(self.axis) / np.linalg.norm(self.axis)
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        offsets = [np.zeros(3), axis, across][: LOOP_TYPES[self.type]]
        a = self.a.placement
        b = self.b.placement
        return [(a[:3, 3] + a[:3, :3] @ x, b[:3, 3] + b[:3, :3] @ x) for x in offsets]


def loop_names(loops: Sequence[Loop]) -> str:
    """Return the names of loops for texts."""
    return f"loop{'s' * (len(loops) > 1)} {listed([repr(loop.name) for loop in loops])}"


class Inertial(NamedTuple):
    """Mass [kg], axes of the inertia in the link (4, 4), and inertia in them (3, 3) [kg m²]."""

    mass: float
    placement: Array
    inertia: Array

    @property
    def body(self) -> RigidBody:
        """The same in the axes of the link."""
        return RigidBody(self.mass, np.zeros(3), self.inertia).moved(self.placement)


class Link(NamedTuple):
    """A link of a Description by its name.

    It has the mass and inertia that its file states, None without them.
    """

    name: str
    inertial: Inertial | None = None


class Joint(NamedTuple):
    """A joint by its file, parameters beside the file, and arguments, merged in this order.

    Numbers of a joint of one degree of freedom are by its own rate and effort; those from
    `effort_offset` on, and `armature`, stand in no URDF.
    """

    name: str
    type: str  # of JOINT_TYPES
    parent: str  # link
    child: str  # link
    origin: Array  # (4, 4) placement in the parent link
    axis: Array  # (3,) in the joint's frame, of any length
    lower: float = -np.inf  # position limits [rad, m]
    upper: float = np.inf
    velocity: float = np.inf  # limit [rad/s, m/s]
    effort: float = np.inf  # limit [N m, N]
    mimic: Mimic | None = None
    damping: float = 0.0  # [N m s/rad, N s/m]
    friction: float = 0.0  # Coulomb [N m, N]
    armature: float = 0.0  # reflected rotor inertia [kg m², kg]
    effort_offset: float = 0.0  # effort that is measured where none acts [N m, N]
    load_friction: float = 0.0  # Coulomb friction by the torque of gravity [1]
    root_friction: float = 0.0  # friction by √|q̇| [N m √(s/rad), N √(s/m)]
    effort_scale: float | None = None  # effort by reported unit [N m, N], NaN if it is unknown
    spring: FlexibleJoint | None = None

    @property
    def reflected_inertia(self) -> float:
        """Inertia of rotors that the joint's effort moves [kg m², kg]."""
        if self.spring is not None and self.spring.effort == "motor":
            return self.spring.reflected_inertia
        return self.armature


class Station(NamedTuple):
    """A frame of a flexible link, in the axes of its beam.

    It is at `at` + Φη − ½ e ηᵀHη, turned by R_z R_y R_x of Θη.
    """

    at: Array  # (3,) [m]
    shape: Array  # Φ (3, n)
    slope: Array  # Θ (3, n)
    shortening: Array  # H (n, n)
    mass: float = 0.0
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)  # about its axes [kg m²]


class FlexibleLink(NamedTuple):
    """A link with modes η of unit modal mass, the positions [√kg m] of the joints `modes`.

    Attributes
    ----------
    modes : tuple of str
        ``<link>/y1`` … bend it along y, ``<link>/z1`` … along z, ``<link>/x1`` … twist it.
    axes : ndarray, shape (3, 3)
        Axes of the beam in the link: x leads to the tip.
    frequencies, damping_ratio : ndarray, shape (n,)
        Of the link clamped at its origin [rad/s], and [1].
    sections : tuple of Station
        The mass of the link.
    tips : mapping
        :class:`Station` of the joint that the modes move.
    bends : ndarray, shape (p, 2, n)
        Curvature κ [√J] and slope σ [1] of points of the beam by η, for the strain energy of
        `bending_energy`.
    """

    modes: tuple[str, ...]
    axes: Array
    frequencies: Array
    damping_ratio: Array
    sections: tuple[Station, ...]
    tips: Mapping[str, Station]
    bends: Array

    def effort(self, eta: VectorLike, etad: VectorLike) -> Array:
        """Return −ω²η − 2ζω η̇ − ∂U₄₆/∂η, shape (n,), the efforts of stiffness and damping."""
        eta = vector("eta", eta, self.modes)
        etad = vector("etad", etad, self.modes)
        linear = self.frequencies * (self.frequencies * eta + 2.0 * self.damping_ratio * etad)
        curvature, slope = (self.bends @ eta).T
        moment = curvature * (slope**2 + slope**4) @ self.bends[:, 0]
        return np.asarray(
            -linear - moment - curvature**2 * (slope + 2.0 * slope**3) @ self.bends[:, 1]
        )

    def slope(self, eta: Array) -> float:
        """Return the largest rotation of a tip about an axis of the beam [rad]."""
        return max(float(np.abs(tip.slope @ eta).max()) for tip in self.tips.values())


class Form(NamedTuple):
    """A joint whose position follows modes η: linearᵀη + ½ηᵀ quadratic η."""

    sources: tuple[str, ...]
    linear: Array
    quadratic: Array


class Flexible(NamedTuple):
    """Flexible links of a robot, forms of the joints that follow modes, and joints of each link."""

    links: Mapping[str, FlexibleLink] = {}  # never changed
    forms: Mapping[str, Form] = {}  # never changed
    groups: tuple[frozenset[str], ...] = ()

    @property
    def joints(self) -> frozenset[str]:
        """All joints that are modes or follow them."""
        return frozenset().union(*self.groups)


class Remark(NamedTuple):
    """A check that fails: its row in checks.CHECKS, a name, a number, and words of the text.

    The name is that of a link or joint, as `kind` or the row says, or None for the robot.
    """

    row: str
    name: str | None = None
    number: float = 0.0
    words: tuple[object, ...] = ()
    kind: str = ""


class Description(NamedTuple):
    """A robot: a tree of links and joints by name in the file's order, and loops that close in it.

    `driven` are joints with an actuator, `remarks` probable mistakes of the file. An MJCF states
    `floating_base`, `gravity` [m/s²] and positions of `locked` joints [rad, m] too; `omitted` has
    its forces that no model has, `balls` its ball joints, each of three hinges. `friction_velocity`
    is that of :class:`Parameters`. Arguments of :func:`load_urdf` are merged, too; `held` are
    positions of joints that massless="lock" locks.
    """

    name: str
    root: str  # link
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    loops: tuple[Loop, ...] = ()
    curves: Mapping[str, Curve] = {}  # non-linear mimic joints
    driven: tuple[str, ...] = ()
    floating_base: bool = False
    gravity: VectorLike = (0.0, 0.0, -9.81)
    locked: Mapping[str, float] = {}
    omitted: tuple[str, ...] = ()
    balls: tuple[str, ...] = ()
    friction_velocity: float = FRICTION_VELOCITY
    mimic: str = "embed"
    massless: str = "error"
    payloads: Mapping[str, Payload] = {}
    held: Mapping[str, float] = {}
    flexible: Flexible = Flexible()
    remarks: tuple[Remark, ...] = ()

    def link(self, where: str, name: str) -> Link:
        """Return a link by its name; `where` is for errors."""
        if name not in self.links:
            raise InputError(
                f"{where} has '{name}'; expected a link of robot '{self.name}': "
                f"{listed(list(self.links))}."
            )
        return self.links[name]

    def single_joint(self, where: str, name: str) -> Joint:
        """Return a joint of one degree of freedom by its name; `where` is for errors."""
        if name not in self.joints:
            raise InputError(
                f"{where} has '{name}'; expected a joint of robot '{self.name}': "
                f"{listed(list(self.joints))}."
            )
        kind = self.joints[name].type
        if kind not in SINGLE:
            raise InputError(f"{where}: joint '{name}' is {kind}; expected one degree of freedom.")
        return self.joints[name]

    def with_joints(self, *joints: Joint) -> Description:
        """Return this description with these joints in place of those of the same names."""
        return self._replace(joints={**self.joints, **{joint.name: joint for joint in joints}})
