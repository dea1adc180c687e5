# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mimic joints (mimic="embed"): the model, equality with the dense GᵀMG, and what the loader
rejects.

The laws over coupled robots are in test_laws.py and test_derivatives.py.
"""

import pickle
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import test_random_trees as trees
from hypothesis import given
from hypothesis import strategies as st

import diag_dynamics as dd
import laws
import robots
from coupling import (
    NAMED,
    ROMEO,
    SINGLE,
    UNKNOWN_SOURCES,
    Coupling,
    mimic_tags,
    mimicking,
)
from diag_dynamics.model.mimic import Followers
from examples import examples
from laws import load
from robots import description, joint, link

# Some example robots have inertias that no rigid body has; test_urdf.py is about that.
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

# --- the model


def check_names(robot):
    """Independent joints only, with an entry for each."""
    model = robot.model
    c = robot.oracle.coupling
    assert set(model.joint_names) - {"root_joint"} == set(c.independent)
    for array in (
        model.velocity_limit,
        model.effort_limit,
        model.damping,
        model.friction,
        model.armature,
    ):
        assert array.shape == (model.nv,)
    assert model.lower.shape == model.upper.shape == (model.nq,)


def check_mimics(robot):
    """Who follows whom, resolved to independent joints; what stands still is locked."""
    model = robot.model
    c = robot.oracle.coupling
    assert set(model.mimics) == set(c.mimics)
    for name, mimic in c.mimics.items():
        leader, *numbers = model.mimics[name]
        assert leader == mimic.leader
        assert numbers == pytest.approx([mimic.multiplier, mimic.offset], rel=1e-13, abs=1e-15)
    assert dict(model.locked_joints) == pytest.approx(c.locked, rel=1e-14)
    tagged = [name for name, element in c.joints.items() if element.find("mimic") is not None]
    assert sorted(model.mimic_joints) == sorted(tagged)
    with pytest.raises(TypeError):
        model.mimics["another"] = None


DENSE = (
    laws.m_is_the_udu_factor,
    laws.m_factors_the_mass_matrix,
    laws.total_joint_rates,
    laws.working_moments,
    laws.gravity,
    laws.energy,
    laws.link_energy,
    laws.coriolis,
    laws.coriolis_unnormalized,
    laws.coriolis_does_no_work,
    laws.inverse_dynamics,
    laws.forward_dynamics,
    laws.power,
    laws.sweeps_are_the_factors,
)
"""Equality with M = GᵀM_full G, c = Gᵀc_full, g = Gᵀg_full and all that follows from them; see
`coupling.Coupled`.
"""


def check(robot):
    """Check the model and its answers."""
    for each in (check_names, check_mimics):
        each(robot)
    for case in robot.cases:
        for law in DENSE:
            law(case)


FACTORS = st.sampled_from((0.7, -0.4, 1.3, -1.2, 0.0))
GROUPS = st.lists(st.tuples(st.integers(0, 9), FACTORS, st.floats(-1, 1)), min_size=1, max_size=6)


@examples(60)
@given(trees.shapes(least=3, most=12, spread=0.5), GROUPS)
def test_random_trees(shape, groups):
    """Groups of joints in random trees: a follower's source is any joint before it in the file."""
    tree = trees.Tree(shape)
    xml = ET.fromstring(tree.urdf)
    single = [e for e in xml.findall("joint") if e.get("type") in SINGLE]
    for follower, (k, *numbers) in zip(single[1:], groups, strict=False):
        source = single[k % single.index(follower)].get("name")
        values = dict(zip(("multiplier", "offset"), map(repr, numbers), strict=True))
        ET.SubElement(follower, "mimic", {"joint": source} | values)
    urdf = ET.tostring(xml, encoding="unicode")
    options = {name: x for name, x in tree.options.items() if name != "gravity"}
    spec = robots.Robot(f"tree {shape.seed}", urdf, mimic="embed", **options)
    if single and any(joint.get("name") not in tree.locked for joint in single):
        check(load(spec, gravity=shape.gravity))


def chain(mimics, branches=()):
    """Return the model of joints a to f, one on the other, and of branches; `mimics` has the source
    of each mimic joint.
    """
    names = "abcdef"
    parents = {name: names[k - 1] if k else "base" for k, name in enumerate(names)} | dict(branches)
    body = {"mass": 1.0, "inertia": (1, 0, 0, 1, 0, 1)}
    links = link("base"), *(link(name, **body) for name in parents)
    joints = {
        name: joint(name, "revolute", parent, name, xyz=(0.1, 0.2, 0.3))
        for name, parent in parents.items()
    }
    joints |= {name: mimicking(joints[name], source) for name, source in mimics.items()}
    return dd.load_urdf(description("chain", *links, *joints.values()))


def test_groups_that_share_a_joint_are_one():
    assert chain({"c": "a", "d": "b"}).coupled_groups == (("a", "b", "c", "d"),)
    assert chain({"b": "a", "d": "c"}).coupled_groups == (("a", "b"), ("c", "d"))


def test_order_of_what_a_group_carries():
    """Joints on the first body of a group come before those on the next one."""
    model = chain({"b": "a"}, {"x": "a", "y": "b", "z": "a"})
    assert model.dof_names == ("a", "x", "z", "c", "d", "e", "f", "y")


def test_locked_on_the_way():
    """A follower that is held holds its own followers, where it has them stand."""
    urdf = NAMED["follower of a follower"].urdf
    model = dd.load_urdf(urdf, locked_joints={"b": 0.3})
    assert dict(model.locked_joints) == {"b": 0.3} and set(model.mimics) == {"b2", "c"}
    model = dd.load_urdf(urdf, locked_joints={"b2": 0.3})
    assert dict(model.locked_joints) == {"b2": 0.3, "c": 0.3}
    assert not model.mimics
    assert not model.coupled_groups
    model = dd.load_urdf(urdf, locked_joints={"a": 0.5})
    assert dict(model.locked_joints) == pytest.approx({"a": 0.5, "b2": -0.15, "c": -0.15})
    assert model.nv == 1
    released = model.with_locked_joints({})
    assert released.dof_names == dd.load_urdf(urdf).dof_names and set(released.mimics) == {
        "b2",
        "c",
    }
    again = released.with_locked_joints({"a": 0.5})
    assert again.bodies.tobytes() == model.bodies.tobytes()


# --- massless links


def test_massless_followers_need_no_cure():
    """A leader that moves inertia is enough; alone, a follower without inertia is refused."""
    spec = NAMED["massless follower link"]
    assert dd.load_urdf(spec.source).nv == 3
    with pytest.raises(dd.MasslessLinkError, match="'b'"):
        dd.load_urdf(tip(None, massless=("b",)))
    urdf = tip("b", massless=("b",))
    with pytest.raises(dd.MasslessLinkError, match="'b'"):
        dd.load_urdf(urdf, mimic="free")
    assert dd.load_urdf(urdf).dof_names == ("a",)


def tip(follower, massless=()):
    """Return a robot of two joints, a and b, which follows a; those of `massless` move no
    inertia.
    """
    inertial = {"mass": 1.0, "com": (0.1, 0.2, 0.3), "inertia": (0.1, 0, 0, 0.1, 0, 0.1)}
    second = joint("b", "revolute", "base", "b_link", axis=(0, 1, 0))
    return description(
        "tip",
        link("base"),
        *(link(f"{name}_link", **({} if name in massless else inertial)) for name in "ab"),
        joint("a", "revolute", "base", "a_link"),
        second if follower is None else mimicking(second, "a", 0.5),
    )


def test_massless_group():
    """Where neither leader nor followers move inertia the leader is refused by name, or held with
    them.
    """
    urdf = tip("b", massless=("a", "b")).replace("</robot>", "") + (
        link("c_link", 1.0, (0.1, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1))
        + joint("c", "revolute", "base", "c_link")
    )
    urdf += "</robot>"
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(urdf)
    assert caught.value.joints == ("a",)
    assert "'a'" in str(caught.value)
    model = dd.load_urdf(urdf, massless="lock")
    assert model.dof_names == ("c",) and dict(model.locked_joints) == {"a": 0.0, "b": 0.0}
    for name in "ab":  # a rotor on either will do
        assert dd.load_urdf(urdf, armature={name: 0.1}).nv == 2


def test_romeo_is_cured_by_locking_its_hands():
    """massless="lock" holds hands and with them their fingers."""
    urdf = robots.robot_path(ROMEO)
    model = dd.load_urdf(urdf, massless="lock")
    assert set(model.locked_joints) == set(robots.EXCLUDED[ROMEO].joints)
    stiff = Coupling(
        ET.fromstring(urdf.read_text()), {n: model.locked_joints[n] for n in ("LHand", "RHand")}
    )
    assert dict(model.locked_joints) == pytest.approx(stiff.locked)
    assert not model.mimics and not model.coupled_groups


# --- what is refused


def refused(*elements):
    """Return a robot that is regular without its mimic tags."""
    body = {"mass": 1.0, "com": (0.1, 0.2, 0.3), "inertia": (0.1, 0, 0, 0.1, 0, 0.1)}
    links = (link("base"), *(link(f"{name}_link", **body) for name in "abc"))
    return description("refused", *links, *elements)


def hinge(name, leader=None, kind="revolute"):
    element = joint(name, kind, "base", f"{name}_link", axis=(0, 0, 1))
    return element if leader is None else mimicking(element, leader, 0.5)


REFUSED = {
    "itself": (hinge("a", "a"), hinge("b"), hinge("c"), {"a"}),
    "each other": (hinge("a", "b"), hinge("b", "a"), hinge("c"), {"a", "b"}),
    "round in three": (hinge("a", "b"), hinge("b", "c"), hinge("c", "a"), {"a", "b", "c"}),
    "one that mimics itself": (hinge("a", "b"), hinge("b", "b"), hinge("c"), {"b"}),
    "nobody": (hinge("a", "nobody"), hinge("b"), hinge("c"), {"a", "nobody"}),
    "nobody, through another": (hinge("a", "b"), hinge("b", "nobody"), hinge("c"), {"b", "nobody"}),
    "a link": (hinge("a", "b_link"), hinge("b"), hinge("c"), {"a", "b_link"}),
    "planar leader": (hinge("a", "b"), hinge("b", kind="planar"), hinge("c"), {"a", "b"}),
    "floating leader": (hinge("a", "b"), hinge("b", kind="floating"), hinge("c"), {"a", "b"}),
    "planar follower": (hinge("a", "b", kind="planar"), hinge("b"), hinge("c"), {"a"}),
    "floating follower": (hinge("a", "b", kind="floating"), hinge("b"), hinge("c"), {"a"}),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    """As a UrdfError that names the joints; free, they are all joints like others."""
    *elements, names = REFUSED[case]
    with pytest.raises(dd.UrdfError) as caught:
        dd.load_urdf(refused(*elements))
    assert all(re.search(rf"\b{name}\b", str(caught.value)) for name in names), caught.value
    if isinstance(caught.value, dd.MimicJointError):
        assert set(caught.value.joints) <= {"a", "b", "c"} and caught.value.joints
        assert pickle.loads(pickle.dumps(caught.value)).joints == caught.value.joints
    model = dd.load_urdf(refused(*elements), mimic="free")
    assert set(model.joint_names) == {"a", "b", "c"}


@pytest.mark.parametrize(("multiplier", "length"), [(1e30, 2), (-1e30, 7), (1e-30, 11)])
def test_chain_beyond_all_numbers_is_refused(multiplier, length):
    """Of single multipliers that are legal; where the product of tiny ones vanishes it would hold
    the follower in silence.
    """
    body = {"mass": 1.0, "com": (0.1, 0.2, 0.3), "inertia": (0.1, 0, 0, 0.1, 0, 0.1)}
    elements = [
        link("base"),
        link("l0", **body),
        joint("j0", "revolute", "base", "l0", axis=(0, 0, 1)),
    ]
    for k in range(1, length + 1):
        hinge_ = joint(f"j{k}", "revolute", "base", f"l{k}", axis=(0, 0, 1))
        elements += [link(f"l{k}", **body), mimicking(hinge_, f"j{k - 1}", multiplier)]
    with pytest.raises(dd.MimicJointError, match=r"'j\d+' follows 'j\d+'"):
        dd.load_urdf(description("chain", *elements))


def test_sources_that_the_robot_does_not_have():
    urdf = robots.robot_path(UNKNOWN_SOURCES)
    tags = mimic_tags(urdf.read_text(encoding="utf-8"))
    assert tags
    with pytest.raises(dd.MimicJointError) as caught:
        dd.load_urdf(urdf)
    assert issubclass(dd.MimicJointError, dd.UrdfError) and issubclass(dd.UrdfError, dd.ModelError)
    assert any(
        f"'{name}'" in str(caught.value) and f"'{tags[name]}'" in str(caught.value) for name in tags
    )
    assert set(tags) <= set(dd.load_urdf(urdf, mimic="free").joint_names)


# --- other ways to treat them, copies


@pytest.mark.parametrize(
    "name", ["follower of a follower", "multiplier 0", "leader is fixed", "massless follower link"]
)
def test_free_and_lock(name):
    """Free, all joints are independent; locked, followers stand where their leaders at zero have
    them.
    """
    spec = NAMED[name]
    c = Coupling(ET.fromstring(spec.urdf), {})
    if "massless" not in name:
        free = dd.load_urdf(spec.source, mimic="free", armature=spec.armature)
        assert set(free.joint_names) == {*c.moving, *c.locked}
        assert not free.mimics and not free.coupled_groups and not free.locked_joints
        assert set(free.mimic_joints) == set(mimic_tags(spec.urdf))
    stiff = {name: mimic.offset for name, mimic in c.mimics.items()} | c.locked
    locked = dd.load_urdf(spec.source, mimic="lock", armature=spec.armature)
    assert dict(locked.locked_joints) == pytest.approx(stiff, abs=1e-15)
    assert set(locked.joint_names) == set(c.independent)
    assert not locked.mimics and not locked.coupled_groups


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("name", ["parallel gripper", "leader is fixed"])
def test_compiled_in_advance(name):
    """Also where all sweeps see an aggregate."""
    dd.DiagonalDynamics(dd.load_urdf(NAMED[name].source)).compile()


# --- motion


# --- Values in messages


def test_followers():
    """Velocities and efforts of mimic joints scale by the multiplier; unknown values are NaN."""
    mimics = {"left": dd.Mimic("turn", 2.0, 0.1), "right": dd.Mimic("slide", -0.5, 0.0)}
    followers = Followers(("slide", "turn"), mimics, tolerance=0.01, continuous=("left",))
    q = np.array([3.0, 0.2])
    np.testing.assert_allclose(followers.at(q)[0], [0.5, -1.5])
    np.testing.assert_allclose(followers.at(q)[1] @ q, [0.4, -1.5])
    np.testing.assert_allclose(followers.reflected(q, q, np.array([0.5, np.nan])), [3.0, 1.2])
    (text,) = followers.disagreements(q, np.array([0.5 + 2.0 * np.pi, -1.4]))
    assert "'right' is -1.4; expected -1.5 from 'slide'" in text
    assert not followers.disagreements(q, np.array([np.nan, -1.495]))
