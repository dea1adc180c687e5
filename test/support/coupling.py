# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coupled joints (URDF mimic tags) without the library: their tags, an oracle, named and random
robots.

`Coupling` reads the tags: which joint follows which, and what stands still. `Coupled` is an oracle
with the interface of `oracles.Oracle`, in independent coordinates: Pinocchio's model with every
joint independent, projected by q̇_full = G q̇. Imports nothing of diag_dynamics.
"""

import xml.etree.ElementTree as ET
import zlib
from functools import cached_property
from typing import NamedTuple

import numpy as np

from oracles import COORDINATES, EARTH, ROOT, Oracle, State
from robots import Robot, all_robots, description, joint, link, robot

SINGLE = ("revolute", "continuous", "prismatic")


# --- structure


class Mimic(NamedTuple):
    """How a follower moves: q = multiplier · q_leader + offset, the leader independent."""

    leader: str
    multiplier: float
    offset: float


class Coupling:
    """Which joints follow others, and what stands still, by the tags of a URDF.

    Attributes
    ----------
    joints : dict
        The <joint> elements by name.
    mimics : dict
        `Mimic` of each follower that moves, by name.
    locked : dict
        Positions of locked joints, and of followers that stand still for them or by a multiplier of
        0.
    moving : list
        Names of the joints that move, followers included.
    """

    def __init__(self, xml, locked):
        """Read the tags."""
        self.joints = {element.get("name"): element for element in xml.findall("joint")}
        self._held = dict(locked)
        self.mimics = {}
        self.locked = dict(locked)
        for name, element in self.joints.items():
            if (
                element.find("mimic") is not None
                and element.get("type") != "fixed"
                and name not in locked
            ):
                leader, multiplier, offset = self._position(name)
                if leader is None:
                    self.locked[name] = offset
                else:
                    self.mimics[name] = Mimic(leader, multiplier, offset)
        self.moving = [name for name in self.joints if self._moves(name)]

    def kind(self, name):
        """Return the type of a joint."""
        return self.joints[name].get("type")

    def _position(self, name):
        """Return the independent joint that a joint follows in the end (None: it stands still),
        factor and offset.
        """
        if name in self._held:
            return None, 0.0, self._held[name]
        if self.kind(name) == "fixed":
            return None, 0.0, 0.0
        tag = self.joints[name].find("mimic")
        if tag is None:
            return name, 1.0, 0.0
        leader, factor, offset = self._position(tag.get("joint"))
        multiplier = float(tag.get("multiplier", 1.0))
        offset = multiplier * offset + float(tag.get("offset", 0.0))
        factor *= multiplier
        return (leader if factor else None), factor, offset

    def _moves(self, name):
        return self.kind(name) != "fixed" and name not in self.locked

    @property
    def independent(self):
        """Return the names of the moving joints that follow no other."""
        return [name for name in self.moving if name not in self.mimics]


# --- the oracle


def with_payloads(urdf, payloads):
    """Return a URDF with (mass, com, inertia about it) on links, each as a link "on <link>" behind
    a fixed joint.
    """
    robot = ET.fromstring(urdf)
    for name, (mass, com, inertia) in payloads.items():
        upper = np.array(inertia, dtype=float)[np.triu_indices(3)]
        robot.append(ET.fromstring(link(f"on {name}", mass, com, upper)))
        robot.append(ET.fromstring(joint(f"on {name}", "fixed", name, f"on {name}")))
    return ET.tostring(robot, encoding="unicode")


def upper_factor(M):
    """Return U, unit upper triangular, and D of M = U D Uᵀ."""
    rest = M.copy()
    unit = np.eye(len(M))
    D = np.zeros(len(M))
    for k in reversed(range(len(M))):
        D[k] = rest[k, k]
        unit[:k, k] = rest[:k, k] / D[k]
        rest[:k, :k] -= D[k] * np.outer(unit[:k, k], unit[:k, k])
    return unit, D


def upper_factor_rate(m, Mdot):
    """Return ṁ of M = m mᵀ: ℓṀℓᵀ = X + Xᵀ with X = ℓṁ upper triangular."""
    A = np.linalg.solve(m, np.linalg.solve(m, Mdot).T)
    return m @ (np.triu(A, 1) + 0.5 * np.diag(np.diag(A)))


class Coupled:
    """A robot with its mimic joints coupled: M = GᵀM_full G and so on, dense, with the interface of
    `Oracle`.
    """

    Full = Oracle
    """Class of the oracle in which all joints are independent."""

    def __init__(
        self,
        urdf,
        dof_names=None,
        gravity=EARTH,
        armature=None,
        floating_base=False,
        locked_joints=None,
        payloads=None,
    ):
        """Build it from URDF text; `dof_names` are the independent dofs in the caller's order."""
        self.xml = ET.fromstring(urdf)
        self._payloads = dict(payloads or {})
        self.coupling = coupling = Coupling(self.xml, dict(locked_joints or {}))
        moved = {
            name: inertia for name, inertia in (armature or {}).items() if name in coupling.moving
        }
        urdf = with_payloads(urdf, self._payloads)
        self.full = full = self.Full(urdf, None, gravity, moved, floating_base, coupling.locked)
        options = {}  # dofs by joint
        for k, name in enumerate(full.dof_names):
            options.setdefault(full.model.names[full._joint[k]], []).append(name)
        assert set(options) - {ROOT} == set(coupling.moving)
        natural = [
            name for joint in options if joint not in coupling.mimics for name in options[joint]
        ]
        self.dof_names = tuple(natural if dof_names is None else dof_names)
        if sorted(self.dof_names) != sorted(natural):
            raise ValueError(f"dofs {sorted(self.dof_names)} are not {sorted(natural)}")
        self.nv = len(self.dof_names)
        joint_of = {dof: name for name, dofs in options.items() for dof in dofs}
        self.joint_of_dof = [joint_of[dof] for dof in self.dof_names]
        self.joint_names = tuple(dict.fromkeys(self.joint_of_dof))
        self._maps(options)

    def _maps(self, own):
        """Make G, and the affine map of positions."""
        full = self.full
        mimics = self.coupling.mimics
        self.G = np.zeros((full.nv, self.nv))
        for row, name in enumerate(full.dof_names):
            leader, multiplier, _ = mimics.get(name, Mimic(name, 1.0, 0.0))
            self.G[row, self.dof_names.index(leader)] = multiplier
        at = {
            full.model.names[j]: (full._first[j], COORDINATES[full.model.nvs[j]])
            for j in full._joints
        }
        self._chosen = [at[name][0] + i for name in self.joint_names for i in range(at[name][1])]
        self.joint_of_coordinate = [name for name in self.joint_names for _ in range(at[name][1])]
        self.nq = len(self._chosen)
        self.positions = np.zeros((full.nq, self.nq))
        self.offset = np.zeros(full.nq)
        self.positions[self._chosen, range(self.nq)] = 1.0
        for name, (leader, multiplier, offset) in mimics.items():
            self.positions[at[name][0], self._chosen.index(at[leader][0])] = multiplier
            self.offset[at[name][0]] = offset

    # --- structure

    def joint_mates(self, k):
        """Return all dofs of the joint of dof k."""
        return {j for j in range(self.nv) if self.joint_of_dof[j] == self.joint_of_dof[k]}

    @property
    def mass(self):
        """Return the total mass of the moving bodies [kg]."""
        return self.full.mass

    def is_prismatic(self, k):
        """Whether dof k is a translation."""
        return self.full.is_prismatic(self.full.dof_names.index(self.dof_names[k]))

    def is_circular(self, k):
        """Whether dof k is a continuous joint."""
        return self.full.is_circular(self.full.dof_names.index(self.dof_names[k]))

    # --- configurations

    def q_full(self, q):
        """Return the positions of all joints, in the order of `full`."""
        return self.positions @ q + self.offset

    @property
    def neutral(self):
        """Return the positions of zero, quaternions at the identity."""
        return self.full.neutral[self._chosen]

    def moved(self, q, step):
        """Return q after a step."""
        return self.full.moved(self.q_full(q), self.G @ step)[self._chosen]

    def at(self, q, qd, tau=None):
        """Return the oracle's answers at one state."""
        return CoupledState(
            self, *(None if x is None else np.array(x, float) for x in (q, qd, tau))
        )

    # --- dynamics

    def mass_matrix(self, q):
        """Return M = GᵀM_full G."""
        M = self.G.T @ self.full.mass_matrix(self.q_full(q)) @ self.G
        return 0.5 * (M + M.T)

    def unit_factor(self, q):
        """Return U with unit diagonal, and D, of M = U D Uᵀ."""
        return upper_factor(self.mass_matrix(q))

    factor = Oracle.factor

    def coriolis_torque(self, q, qd):
        """Return c = Gᵀc_full, without gravity."""
        return self.G.T @ self.full.coriolis_torque(self.q_full(q), self.G @ qd)

    def gravity_torque(self, q):
        """Return g = Gᵀg_full."""
        return self.G.T @ self.full.gravity_torque(self.q_full(q))

    def coriolis_matrix(self, q, qd):
        """Return C_s with c = C_s q̇ and Ṁ = C_s + C_sᵀ."""
        return self.G.T @ self.full.coriolis_matrix(self.q_full(q), self.G @ qd) @ self.G

    def inverse_dynamics(self, q, qd, qdd):
        """Return τ, gravity included."""
        return self.G.T @ self.full.inverse_dynamics(self.q_full(q), self.G @ qd, self.G @ qdd)

    def forward_dynamics(self, q, qd, tau):
        """Return q̈ by a dense solve, gravity included."""
        M = self.mass_matrix(q)
        bias = self.coriolis_torque(q, qd) + self.gravity_torque(q)
        unit = np.sqrt(np.diag(M))
        scaled = M / np.outer(unit, unit)
        return np.linalg.solve(scaled, (tau - bias) / unit) / unit

    def effort_of(self, q, wrenches, frame):
        """Return Jᵀf of wrenches, force first, at the origins of links, in the axes of the link or
        the world.
        """
        return self.G.T @ self.full.effort_of(self.q_full(q), wrenches, frame)

    def potential_energy(self, q):
        """Return the energy in the field of gravity."""
        return self.full.potential_energy(self.q_full(q))

    def center_of_mass(self, q):
        """Return mass and centre of mass of all bodies."""
        return self.full.center_of_mass(self.q_full(q))

    def regressor(self, q, qd, qdd, links):
        """Return Gᵀ Y_full of the parameters of links."""
        arguments = self.q_full(q), self.G @ qd, self.G @ qdd
        return self.G.T @ self.full.regressor(*arguments, links)

    def link_energy(self, q, qd):
        """Return the energy per URDF link with its payload; a joint's armature counts for the link
        it moves.
        """
        energy = self.full.at(self.q_full(q), self.G @ qd).link_energy
        for name in self._payloads:
            energy[name] += energy.pop(f"on {name}")
        return energy


class CoupledState(State):
    """What the oracle says at one (q, q̇, τ) in independent coordinates."""

    @cached_property
    def cancellation(self):
        """Return what GᵀM_full G loses to rounding: the terms of its diagonal in magnitude over
        their sum, at most.

        Followers may undo each other's motion, so that M_kk is a small difference of large terms.
        """
        full = self.oracle.full.mass_matrix(self.oracle.q_full(self.q))
        G = np.abs(self.oracle.G)
        terms = np.einsum("ik,ij,jk->k", G, np.abs(full), G)
        return float((terms / np.diag(self.M)).max(initial=1.0))

    @cached_property
    def mdot(self):
        """Return ṁ, exact: the differential of the upper factor, Ṁ = C_s + C_sᵀ."""
        return upper_factor_rate(self.m, self.C_s + self.C_s.T)

    @cached_property
    def link_energy(self):
        """Return the energy per URDF link, armature included."""
        return self.oracle.link_energy(self.q, self.qd)


def oracle_of(robot, dof_names=None, **more):
    """Return the oracle of a robot, which couples its mimic joints where the robot does."""
    return (Coupled if robot.mimic == "embed" else Oracle)(
        robot.urdf, dof_names, **robot.options, **more
    )


# --- robots


UNKNOWN_SOURCES = "alex_description/urdf/alex_psyonic_hands.urdf"
"""Robot of the wheel whose mimic joints name source joints that it does not have."""
ROMEO = "romeo_description/urdf/romeo.urdf"


def mimic_tags(urdf):
    """Return the source joint of each mimic joint that is not fixed."""
    elements = [e for e in ET.fromstring(urdf).findall("joint") if e.find("mimic") is not None]
    return {
        e.get("name"): e.find("mimic").get("joint") for e in elements if e.get("type") != "fixed"
    }


def wheel():
    """Return the robots of the wheel that have mimic joints, Romeo with its massless hands
    locked.
    """
    ids = [id for id in all_robots() if id != UNKNOWN_SOURCES and mimic_tags(robot(id).urdf)]
    hands = {"LHand": 0.0, "RHand": 0.0}
    return [robot(id)._replace(locked_joints=hands if id == ROMEO else {}) for id in ids]


def mimicking(element, leader, multiplier=None, offset=None):
    """Return a <joint> that follows another; attributes that are None are left out."""
    attributes = "".join(
        f' {name}="{float(value)!r}"'
        for name, value in (("multiplier", multiplier), ("offset", offset))
        if value is not None
    )
    return element.replace("</joint>", f'<mimic joint="{leader}"{attributes}/></joint>')


def _body(name, rng):
    """Return a link with a body whose inertia is that of a cloud of points."""
    mass = rng.uniform(0.3, 2.0)
    A = rng.uniform(-0.2, 0.2, (3, 3)) + 0.1 * np.eye(3)
    second = mass * (A @ A.T + 0.002 * np.eye(3))
    inertia = (np.trace(second) * np.eye(3) - second)[np.triu_indices(3)]
    return link(name, mass, rng.uniform(-0.15, 0.15, 3), inertia, rpy=rng.uniform(-3, 3, 3))


def _crooked(name, kind, parent, child, rng):
    """Return a joint with a random axis and origin."""
    axis = np.array([0.0, 0.0, 1.0]) if kind in ("planar", "floating") else rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    return joint(name, kind, parent, child, axis, rng.uniform(-0.4, 0.4, 3), rng.uniform(-3, 3, 3))


R, C, P = SINGLE


def tree(id, *rows, massless=(), **options):
    """Return a robot of rows (parent, joint, type[, leader[, multiplier[, offset]]]).

    A parent is the joint that moves it, or "base"; the links are named "<joint>_link". Those of the
    joints in `massless` have no inertia, and those of fixed joints neither. Numbers are random, by
    the id.
    """
    rng = np.random.default_rng(zlib.crc32(id.encode()))
    elements = [_body("base", rng)]
    for parent, name, kind, *mimic in rows:
        parent = parent if parent == "base" else f"{parent}_link"
        element = _crooked(name, kind, parent, f"{name}_link", rng)
        elements.append(mimicking(element, *mimic) if mimic else element)
        bare = name in massless or kind == "fixed"
        elements.append(link(f"{name}_link") if bare else _body(f"{name}_link", rng))
    return Robot(id, description(id.replace(" ", "_"), *elements), **options)


def _parallel_gripper():
    """Return a gripper of two parallelograms, whose tips do not turn: each tip undoes the turn of
    its finger.
    """
    box = {"inertia": (2e-4, 0, 0, 3e-4, 0, 1.5e-4)}
    elements = [link("base", 1.0, (0, 0, 0.02), (4e-3, 0, 0, 4e-3, 0, 3e-3))]
    elements += [link("palm", 0.5, (0, 0, 0.05), (1e-3, 0, 0, 1e-3, 0, 5e-4))]
    elements += [joint("wrist", R, "base", "palm", axis=(0, 0.6, 0.8), xyz=(0, 0, 0.1))]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        finger, bar, tip = (f"{side}_{part}" for part in ("finger", "bar", "tip"))
        for name, mass in ((finger, 0.2), (bar, 0.1), (tip, 0.15)):
            elements.append(link(f"{name}_link", mass, (0, 0, 0.03), **box))
        swing = joint(
            finger, R, "palm", f"{finger}_link", axis=(0, 1, 0), xyz=(0.03 * sign, 0, 0.1)
        )
        elements.append(swing if side == "left" else mimicking(swing, "left_finger", -1.0))
        other = joint(bar, R, "palm", f"{bar}_link", axis=(0, 1, 0), xyz=(0.05 * sign, 0, 0.1))
        elements.append(mimicking(other, finger))
        level = joint(tip, R, f"{finger}_link", f"{tip}_link", axis=(0, 1, 0), xyz=(0, 0, 0.06))
        elements.append(mimicking(level, finger, -1.0))
    return Robot("parallel gripper", description("parallel_gripper", *elements))


NAMED = {
    robot.id: robot
    for robot in (
        tree(
            "follower of a follower",
            ("base", "a", R),
            ("a", "b", R),
            ("b", "c", R, "b2"),
            ("b", "b2", R, "a", -0.7, 0.2),
        ),
        tree(
            "several followers of one leader",
            ("base", "arm", R),
            ("arm", "f1", R),
            ("arm", "f2", R, "f1", 0.8),
            ("arm", "f3", P, "f1", -0.4),
            ("f1", "g1", R, "f1", 1.3),
        ),
        tree(
            "multiplier 0",
            ("base", "a", R),
            ("a", "b", R, "a", 0.0, 0.6),
            ("b", "c", R, "a", 0.5),
            ("c", "d", R, "b", 2.0, 0.1),
            ("d", "e", R),
        ),
        tree(
            "leader outboard of its follower",
            ("base", "a", R),
            ("a", "b", R, "c", 0.9),
            ("b", "c", R),
            ("c", "d", R),
        ),
        tree(
            "massless follower link",
            ("base", "a", R),
            ("a", "b", R),
            ("a", "c", R, "b", -0.6),
            ("c", "d", P, "b"),
            ("d", "e", R),
            massless=("c", "d"),
        ),
        tree(
            "leader is fixed",
            ("base", "a", R),
            ("a", "weld", "fixed"),
            ("weld", "b", R, "weld", 2.0, 0.4),
            ("b", "c", R, "b", 3.0),
            ("c", "d", R),
            ("d", "e", R, "d", 0.5),
        ),
        tree(
            "nested three deep",
            ("base", "a", R),
            ("a", "b", R, "a", 0.5),
            ("b", "c", R),
            ("b", "d", R, "c", -0.5),
            ("d", "e", R),
            ("d", "f", P, "e", 0.4),
            ("e", "g", R),
            ("g", "h", R, "g", 0.3),
            ("a", "i", R),
        ),
        _parallel_gripper(),
    )
}
"""Robots of one feature each, by name; random trees of test_mimic.py have the others."""
