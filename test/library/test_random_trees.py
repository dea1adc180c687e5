# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random trees of every kind of joint against Pinocchio: hypothesis draws the shape, a seed the
numbers.

To look at many more: see examples.py.
"""

import xml.etree.ElementTree as ET
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import event, given, note, settings
from hypothesis import strategies as st

import diag_dynamics as dd
import laws
import robots
from accuracy import EPS, assert_close, norm, tolerance
from coupling import with_payloads
from examples import examples, shortened
from oracles import Oracle
from robots import description, in_other_units, joint, link

# --- shapes


class Shape(NamedTuple):
    """What a tree is to be like; `seed` makes the numbers."""

    kinds: tuple[str, ...]  # of its joints, in order
    parents: tuple[int, ...]  # how many links back the parent of each is
    floating: bool
    spread: float  # decades over which masses and lengths scatter
    length: float  # [m]
    special: bool  # axes and angles that are multiples of 90°, positions of zero
    geared: float  # part of the joints with armature
    locked: float  # part of the joints that are held
    payloads: int
    gravity: tuple[float, float, float]
    speed: float
    seed: int


KINDS = ("revolute", "continuous", "prismatic", "planar", "floating", "fixed")
SINGLE = KINDS[:3]
GRAVITIES = ((0.0, 0.0, -9.81), (0.0, 0.0, 0.0), (1.5, -2.5, 3.0), (0.0, 250.0, 0.0))


@st.composite
def shapes(draw, least=1, most=10, kinds=KINDS, back=4, spread=2.0):
    """Draw a shape: chains where the parent is the link before, bushes where it is further back."""
    types = tuple(draw(st.lists(st.sampled_from(kinds), min_size=least, max_size=most)))
    parents = draw(st.lists(st.integers(0, back), min_size=len(types), max_size=len(types)))
    return Shape(
        types,
        tuple(parents),
        draw(st.booleans()),
        draw(st.sampled_from((0.0, spread / 2, spread))),
        draw(st.sampled_from((0.3, 0.01, 3.0))),
        draw(st.booleans()),
        draw(st.sampled_from((0.0, 0.5, 1.0))),
        draw(st.sampled_from((0.0, 0.0, 0.3))),
        draw(st.integers(0, 3)),
        draw(st.sampled_from(GRAVITIES)),
        draw(st.sampled_from((1.0, 0.0, 30.0))),
        draw(st.integers(0, 2**32 - 1)),
    )


def inertia(rng, shape):
    """Return mass, centre of mass and a physical inertia about it, of a body about as large as the
    links are long.
    """
    mass = 10.0 ** rng.uniform(-shape.spread, shape.spread)
    size = shape.length * 10.0 ** (0.3 * rng.uniform(-shape.spread, shape.spread))
    second = np.diag(
        rng.uniform(0.05, 1.0, 3)
    )  # of no rod or plate, which move no inertia about some axis
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    second = mass * size**2 * turn @ second @ turn.T
    return mass, size * rng.uniform(-1, 1, 3), np.trace(second) * np.eye(3) - second


def upper(matrix):
    """Return ixx ixy ixz iyy iyz izz."""
    return tuple(matrix[np.triu_indices(3)])


def rotation(rng, shape):
    """Return roll, pitch and yaw."""
    return rng.integers(-2, 3, 3) * np.pi / 2 if shape.special else rng.uniform(-np.pi, np.pi, 3)


class Tree:
    """The tree of a shape: its URDF, what is passed along, and one state of it."""

    def __init__(self, shape):
        self.shape = shape
        rng = np.random.default_rng(shape.seed)
        elements = [link("link_0", *self._own(rng))]
        names = ["link_0"]
        joints = []
        for k, (kind, back) in enumerate(zip(shape.kinds, shape.parents, strict=True)):
            parent = names[max(0, len(names) - 1 - back)]
            axis = (
                np.eye(3)[rng.integers(3)] * rng.choice([-1, 1])
                if shape.special
                else rng.standard_normal(3)
            )
            if kind == "planar":
                axis = np.array([0.0, 0.0, 1.0])  # the only one that Pinocchio knows
            xyz = (
                shape.length * rng.uniform(-1, 1, 3) * (rng.random(3) > 0.5 if shape.special else 1)
            )
            name = f"{rng.choice(list('abcxyz'))}_{k}"
            elements.append(
                joint(name, kind, parent, f"link_{k + 1}", axis, xyz, rotation(rng, shape))
            )
            elements.append(link(f"link_{k + 1}", *self._own(rng), rpy=rotation(rng, shape)))
            names.append(f"link_{k + 1}")
            if kind != "fixed":
                joints.append((name, kind))
        self.urdf = description("tree", *elements)
        single = [name for name, kind in joints if kind in SINGLE]
        self.locked = {name: rng.uniform(-3, 3) for name in single if rng.random() < shape.locked}
        self.armature = {
            name: float(10.0 ** rng.uniform(-3, 1)) * shape.length**2
            for name in single
            if name not in self.locked and rng.random() < shape.geared
        }
        self.payloads = {
            str(rng.choice(names)): dd.Payload(
                *(inertia(rng, shape) if rng.random() < 0.7 else (1.5, (0.1, 0, -0.2)))
            )
            for _ in range(shape.payloads)
        }
        self.rng = rng

    def _own(self, rng):
        mass, com, about = inertia(rng, self.shape)
        return mass, com, upper(about)

    @property
    def options(self):
        """Return what library and oracle take alike."""
        return {
            "floating_base": self.shape.floating,
            "gravity": self.shape.gravity,
            "armature": self.armature,
            "locked_joints": self.locked,
        }


def case_of(tree):
    """Return a tree in the library and in the oracle, at one state."""
    model = dd.load_urdf(tree.urdf, payloads=tree.payloads, **tree.options)
    shape = tree.shape
    rng = tree.rng
    o = Oracle(with_payloads(tree.urdf, tree.payloads), model.dof_names, **tree.options)
    nv = model.nv
    reach = np.array([shape.length if o.is_prismatic(k) else 6.0 for k in range(nv)])
    step = reach * rng.uniform(-1, 1, nv) * (rng.random(nv) > 0.5 if shape.special else 1)
    qd, tau, qdd = rng.standard_normal((3, nv)) * [[shape.speed], [10.0], [1.0]]
    c = laws.case_of(
        dd.DiagonalDynamics(model), o, robots.Sample(o.moved(o.neutral, step), qd, tau, qdd)
    )
    return c._replace(rounding=max(1e-12, EPS * c.t.scaled_condition))


# --- laws of their own: those whose errors are relative to more than their result


def link_energy(c):
    """The energy of every link, the payload's with the link that carries it."""
    expected = dict(c.t.link_energy)
    for name in c.model.payloads:
        expected[name] += expected.pop(f"on {name}")
    assert_close(c.s.link_energy, [expected[name] for name in c.model.link_names], 1e-11)


def coriolis_torque(c):
    """The classical torque c."""
    expected = c.t.c / c.unit
    assert_close(
        c.dyn.coriolis_torque(c.t.q, c.t.qd) / c.unit,
        expected,
        c.tolerance,
        norm(expected) + c.t.coriolis_scale,
    )


def forward_dynamics(c):
    """Rnea needs τ for the q̈: an error that no condition amplifies."""
    assert_drives(c, c.dyn.forward_dynamics(c.t.q, c.t.qd, c.t.tau), c.t.tau)


def forward_dynamics_of_aba(c):
    """q̈ of aba."""
    expected = c.t.acceleration * c.unit
    terms = sum(map(norm, (c.s.epsilon, c.s.coriolis, c.s.gravity)))
    actual = c.dyn.forward_dynamics(c.t.q, c.t.qd, c.t.tau) * c.unit
    assert_close(actual, expected, c.tolerance, norm(expected) + terms)


def assert_drives(c, acceleration, tau):
    """Pinocchio's rnea gives τ back."""
    needed = c.oracle.inverse_dynamics(c.t.q, c.t.qd, acceleration) / c.unit
    terms = (
        acceleration * c.unit,
        tau / c.unit,
        c.t.c / c.unit,
        c.t.g / c.unit,
        c.t.nu * norm(c.t.qd),
    )
    assert_close(needed, tau / c.unit, 1e-12, sum(map(norm, terms)))


LAWS = (
    laws.m_is_the_udu_factor,
    laws.m_factors_the_mass_matrix,
    laws.factors_have_the_sparsity_of_the_tree,
    laws.total_joint_rates,
    laws.working_moments,
    laws.gravity,
    laws.energy,
    laws.coriolis,
    laws.coriolis_unnormalized,
    laws.coriolis_does_no_work,
    laws.inverse_dynamics,
    laws.sweeps_are_the_factors,
    link_energy,
    coriolis_torque,
    forward_dynamics,
    forward_dynamics_of_aba,
)


def check(shape, chosen=LAWS):
    """Check laws on the tree of a shape."""
    tree = Tree(shape)
    note(tree.urdf)
    case = case_of(tree)
    assert np.isclose(
        case.model.total_mass, sum(body.mass for body in case.oracle.model.inertias), rtol=1e-12
    )
    if case.model.nv == 0:
        return
    event(f"condition about 1e{3 * round(np.log10(case.t.scaled_condition) / 3)}")
    for law in chosen:
        note(law.__doc__)
        law(case)


@examples(150)
@given(shapes())
def test_small_trees(shape):
    """Up to ten joints of every kind."""
    check(shape)


@settings(examples(25), max_examples=shortened(25, 5))
@given(shapes(least=20, most=60, back=12, spread=1.0))
def test_bushes(shape):
    """Tens of joints with many branches."""
    check(shape)


@settings(examples(4), max_examples=shortened(4, 1))
@given(shapes(least=150, most=200, kinds=SINGLE, back=0, spread=0.5))
def test_chains(shape):
    """Up to two hundred joints one behind the other."""
    check(shape)


@examples(40)
@given(shapes(most=8, spread=8.0))
def test_magnitudes(shape):
    """Masses from ten nanograms to a hundred thousand tonnes in one robot.

    Only what rounding cannot tell from a singular M is refused as such: never where cond(M) is
    below 1e8.
    """
    try:  # Pinocchio's aba is itself wrong there, by 1e-3 with large armature; its rnea is not
        check(shape, [law for law in LAWS if law is not forward_dynamics_of_aba])
    except (dd.MasslessLinkError, dd.SingularMassMatrixError) as error:
        note(str(error))
        event("refused")
        assert condition_without_library(Tree(shape)) > 1e8


def condition_without_library(tree):
    """Return cond(M) at the state of a tree that the library refused."""
    oracle = Oracle(with_payloads(tree.urdf, tree.payloads), **tree.options)
    q = oracle.moved(oracle.neutral, tree.rng.uniform(-3, 3, oracle.nv))
    return oracle.at(q, q[: oracle.nv]).scaled_condition


@examples(40)
@given(shapes(most=8), st.sampled_from((-9, -6, 6, 9)), st.sampled_from((-3, 3)))
def test_units_do_not_matter(shape, mass, length):
    """All masses and lengths of a robot in other units: no other verdict, the same ν and C but for
    the unit.
    """
    tree = Tree(shape)
    other = in_other_units(tree.urdf, 10.0**mass, 10.0**length)
    a, b = (
        dd.DiagonalDynamics(dd.load_urdf(urdf, floating_base=shape.floating))
        for urdf in (tree.urdf, other)
    )
    oracle = Oracle(tree.urdf, a.model.dof_names, floating_base=shape.floating)
    unit = np.array([10.0**length if oracle.is_prismatic(k) else 1.0 for k in range(oracle.nv)])
    step, qd = np.random.default_rng(shape.seed).uniform(-3, 3, (2, oracle.nv))
    oracle_q = oracle.moved(
        oracle.neutral, step * [not oracle.is_prismatic(k) for k in range(oracle.nv)]
    )
    s = a.evaluate(oracle_q, qd)
    t = b.evaluate(oracle_q, qd * unit)
    truth = oracle.at(oracle_q, qd)
    factor = 10.0 ** (mass / 2 + length)
    assert_close(t.nu / factor, s.nu, tolerance(truth))
    if oracle.nv:
        assert_close(t.coriolis / factor, s.coriolis, tolerance(truth), truth.coriolis_scale)


@pytest.mark.parametrize(
    "axis", [(1, 0, 0), (0, 1, 0), (0, 0, -1), (-3, 0, 0), (1, 2, -2), (0.3, -0.1, 0.2)], ids=str
)
def test_planar_joint_moves_normal_to_its_axis(axis):
    """A planar joint with any axis is one along z in a frame whose z that axis is (Pinocchio takes
    z for every one).
    """
    tree = Tree(
        Shape(
            ("revolute", "planar", "prismatic"),
            (0, 0, 0),
            True,
            0.5,
            0.3,
            False,
            0,
            0,
            0,
            (1, 2, 3),
            1.0,
            7,
        )
    )
    z = np.array(axis) / norm(axis)
    x = np.eye(3)[
        np.argmin(np.abs(z))
    ]  # the frame's x: the coordinate axis farthest from z, made normal to it
    x = (x - z * (x @ z)) / norm(x - z * (x @ z))
    R = np.column_stack([x, np.cross(z, x), z])
    described_tree = ET.fromstring(tree.urdf)
    turned = ET.fromstring(tree.urdf)
    planar = described_tree.find("joint[@type='planar']")
    planar.find("axis").set("xyz", " ".join(map(str, axis)))
    same = turned.find(f"joint[@name='{planar.get('name')}']")
    child = same.find("child").get("link")
    # … → fixed joint with R → planar joint along z → fixed joint with Rᵀ → the link
    before = joint("before", "fixed", same.find("parent").get("link"), "frame", **_pose(same, R))
    after = joint("after", "fixed", "moving", child, rpy=_angles(R.T))
    same.find("parent").set("link", "frame")
    same.find("child").set("link", "moving")
    same.find("origin").set("xyz", "0 0 0")
    same.find("origin").set("rpy", "0 0 0")
    for element in (link("frame"), link("moving"), before, after):
        turned.append(ET.fromstring(element))
    dyn = dd.DiagonalDynamics(dd.load_urdf(ET.tostring(described_tree), floating_base=True))
    oracle = Oracle(
        ET.tostring(turned, encoding="unicode"), dyn.model.dof_names, floating_base=True
    )
    step, qd, tau = np.random.default_rng(1).standard_normal((3, oracle.nv))
    t = oracle.at(oracle.moved(oracle.neutral, step), qd, tau)
    s = dyn.evaluate(t.q, t.qd, t.tau)
    assert_close(s.nu, t.nu, tolerance(t))
    assert_close(s.epsilon, t.epsilon, tolerance(t))
    assert_close(s.coriolis, t.coriolis, tolerance(t), t.coriolis_scale)


def _angles(R):
    return pin.rpy.matrixToRpy(R)


def _pose(element, R):
    xyz, rpy = (
        np.array(element.find("origin").get(name).split(), dtype=float) for name in ("xyz", "rpy")
    )
    return {"xyz": xyz, "rpy": _angles(pin.rpy.rpyToMatrix(*rpy) @ R)}
