# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coupled joints (mimic="embed"): the laws of test_physics.py in independent coordinates, and what is theirs alone."""

import ast
import pickle
import re
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import test_physics as physics
from hypothesis import given
from hypothesis import strategies as st
from test_physics import Case, Robot, everything

import coupling
import diag_dynamics as dd
import robots
from accuracy import assert_close, norm, tolerance, tolerance_of_differences
from coupling import NAMED, SEEDS, Coupled, Coupling, coupled_tree, mimicking
from examples import examples
from oracles import Oracle
from robots import TwoLinkArm, description, joint, link

# Some example robots have inertias that no rigid body has; test_urdf.py is about that.
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

PANDA = "panda_description/urdf/panda.urdf"
ROMEO = "romeo_description/urdf/romeo.urdf"
ALEX = "alex_description/urdf/alex_psyonic_hands.urdf"  # its followers name leaders that it does not have
TALOS = "talos_data/robots/talos_reduced.urdf"  # its followers are fixed joints
GRIPPER = NAMED["parallel gripper"]


def mimic_tags(urdf):
    """Return by follower the joint it mimics, of joints that are not fixed."""
    elements = [e for e in ET.fromstring(urdf).findall("joint") if e.find("mimic") is not None]
    return {e.get("name"): e.find("mimic").get("joint") for e in elements if e.get("type") != "fixed"}


def wheel():
    """Return the robots of the wheel that have coupled joints; of Romeo, whose hands have no inertia, with hands held."""
    ids = [id for id in robots.all_robots() if id != ALEX and mimic_tags(robots.robot(id).urdf)]
    hands = {"LHand": 0.0, "RHand": 0.0}
    return [robots.robot(id)._replace(locked_joints=hands if id == ROMEO else {}) for id in ids]


FIXED = (*NAMED.values(), *map(coupled_tree, SEEDS), *wheel())
ALL = FIXED + tuple(robot.floating for robot in FIXED)


def load(robot, **more):
    """Return a robot in library and oracle with its samples evaluated, as `test_physics.load` does."""
    model = dd.load_urdf(robot.source, **robot.options, **more)
    oracle = Coupled(robot.urdf, model.dof_names, **robot.options, **more)
    return evaluated(robot.id, model, oracle)


def evaluated(id, model, oracle):
    """Return library and oracle of a robot with its samples evaluated."""
    dyn, cases = dd.DiagonalDynamics(model), []
    for sample in robots.samples(id, oracle):
        truth = oracle.at(sample.q, sample.qd, sample.tau)
        s = dyn.evaluate(sample.q, sample.qd, sample.tau)
        cases.append(Case(dyn, truth, sample, s, dyn.factors(sample.q), np.sqrt(np.diag(truth.M))))
    return Robot(id, model, dyn, oracle, cases)


@pytest.fixture(scope="module", params=ALL, ids=lambda robot: robot.id)
def robot(request):
    """Return each robot in turn."""
    return load(request.param)


@pytest.fixture(scope="module", params=ALL, ids=lambda robot: robot.id)
def oracle(request):
    """Return each robot's oracle alone, in its own order of dofs, with its samples."""
    found = Coupled(request.param.urdf, **request.param.options)
    return found, [found.at(s.q, s.qd, s.tau) for s in robots.samples(request.param.id, found)]


# --- the oracle itself


def test_oracle_imports_nothing_of_the_library():
    tree = ast.parse(Path(coupling.__file__).read_text(encoding="utf-8"))
    names = [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
    names += [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
    assert names and not [name for name in names if name.startswith("diag_dynamics")]


def test_random_trees_cover_all_that_was_thought_of():
    """Every feature occurs in two random trees at least."""
    found = [coupling.features(coupled_tree(seed)) for seed in SEEDS]
    rare = [feature for feature in coupling.FEATURES if sum(feature in f for f in found) < 2]
    assert not rare


@pytest.mark.parametrize("feature", coupling.FEATURES)
def test_every_feature_has_a_robot_of_its_name(feature):
    assert feature in coupling.features(NAMED[feature])


def test_oracle_factorizes(oracle):
    """M = U D Uᵀ = m mᵀ with Cholesky's m, and G has one leader per joint."""
    o, states = oracle
    assert (np.count_nonzero(o.G, axis=1) == 1).all()
    for t in states:
        m = np.linalg.cholesky(t.M[::-1, ::-1])[::-1, ::-1]
        unit = np.sqrt(np.diag(t.M))
        assert (np.triu(t.unit) == t.unit).all()
        assert_close(t.m / unit[:, None], m / unit[:, None], tolerance(t))
        assert_close(t.M / np.outer(unit, unit), (t.m @ t.m.T) / np.outer(unit, unit), 1e-13)


def test_oracle_rates_of_factors(oracle):
    """ṁ and Ṁ of the oracle are what m and M do along q̇; G q̇ is what the joints do."""
    o, states = oracle
    for t in states:
        unit = np.sqrt(np.diag(t.M))[:, None]
        scale = norm(t.m / unit) * norm(t.qd)
        assert_close(t.mdot / unit, t.mdot_by_difference / unit, tolerance_of_differences(t), scale)
        Mdot = o.derivative(o.mass_matrix, t.q, t.qd) / unit / unit.T
        assert_close((t.C_s + t.C_s.T) / unit / unit.T, Mdot, 1e-10 * t.cancellation, norm(t.qd) * o.nv)
        assert_close(t.C_s @ t.qd / unit[:, 0], t.c / unit[:, 0], 1e-12 * t.cancellation, norm(t.nu) * norm(t.qd))
        q = o.q_full(o.moved(t.q, 1e-3 * t.qd))
        ahead = o.full.configuration(o.full.moved(o.q_full(t.q), 1e-3 * o.G @ t.qd))
        assert_close(o.full.configuration(q), ahead, 1e-14)


def test_oracle_conserves_energy(oracle):
    """νᵀC = 0, and K̇ = νᵀ(ε − ε_g) by two routes."""
    for t in oracle[1]:
        assert_close(t.nu @ t.coriolis, 0.0, 1e-12, norm(t.nu) * t.coriolis_scale)
        terms = norm(t.nu) * (norm(t.epsilon) + norm(t.gravity) + t.coriolis_scale)
        assert_close(t.power, t.nu @ (t.epsilon - t.gravity), tolerance(t), terms)
        assert_close(sum(t.link_energy.values()), t.kinetic_energy, 1e-12 * t.cancellation)


@pytest.mark.parametrize("robot", robots.random_robots(), ids=lambda robot: robot.id)
def test_oracle_without_mimics(robot):
    """Where nothing is coupled it is Pinocchio, factor and all."""
    o = Coupled(robot.urdf, **robot.options)
    plain = Oracle(robot.urdf, o.dof_names, **robot.options)
    assert o.coupling.aggregates == [] and (o.q_full(o.neutral) == o.full.neutral).all()
    for sample in robots.samples(robot.id, plain):
        ours, theirs = (x.at(sample.q, sample.qd, sample.tau) for x in (o, plain))
        for name in ("M", "unit", "D", "nu", "epsilon", "coriolis", "coriolis_unnormalized", "acceleration"):
            assert_close(getattr(ours, name), getattr(theirs, name), tolerance(theirs))
        assert [o.ancestors(k) - o.joint_mates(k) for k in range(o.nv)] == [
            set(plain.ancestors(k)) - plain.joint_mates(k) for k in range(o.nv)
        ]


# --- the model


def test_names(robot):
    """Independent joints only, each after those that carry it, aggregates together; links are the URDF's."""
    model, o, c = robot.model, robot.oracle, robot.oracle.coupling
    assert model.nv == len(model.dof_names) == o.nv  # the same names: the oracle has made sure of that
    assert model.nq == len(model.coordinate_names) == o.nq
    assert model.joint_names == o.joint_names
    assert (model.neutral == o.neutral).all()
    assert sorted(model.link_names) == sorted(link.get("name") for link in o.xml.findall("link"))
    assert all(j < k for k in range(model.nv) for j in o.ancestors(k))
    place = {name: k for k, name in enumerate(model.joint_names)}
    for name in c.independent:
        assert all(place[other] < place[name] for other in c.path(name)[:-1] if other in place)
    nodes = [o._node(k) for k in range(model.nv)]
    changes = 1 + sum(a != b for a, b in pairwise(nodes))
    assert changes == len(set(nodes))
    for array in (model.velocity_limit, model.effort_limit, model.damping, model.friction, model.armature):
        assert array.shape == (model.nv,)
    for array in (model.lower, model.upper):
        assert array.shape == (model.nq,)


def test_mimics(robot):
    """Who follows whom, resolved to independent joints; what stands still is locked."""
    model, c = robot.model, robot.oracle.coupling
    assert set(model.mimics) == set(c.mimics)
    for name, mimic in c.mimics.items():
        assert model.mimics[name].leader == mimic.leader
        assert model.mimics[name].multiplier == pytest.approx(mimic.multiplier, rel=1e-14)
        assert model.mimics[name].offset == pytest.approx(mimic.offset, rel=1e-13, abs=1e-15)
        assert tuple(model.mimics[name]) == (
            model.mimics[name].leader,
            model.mimics[name].multiplier,
            model.mimics[name].offset,
        )
    assert dict(model.locked_joints) == pytest.approx(c.locked, rel=1e-14)
    tagged = [name for name, element in c.joints.items() if element.find("mimic") is not None]
    assert sorted(model.mimic_joints) == sorted(tagged)
    with pytest.raises(TypeError):
        model.mimics["another"] = None


def test_coupled_groups(robot):
    """The joints of each aggregate, base to tip, the aggregates too."""
    model, c = robot.model, robot.oracle.coupling
    assert isinstance(model.coupled_groups, tuple) and all(isinstance(g, tuple) for g in model.coupled_groups)
    assert sorted(map(sorted, model.coupled_groups)) == sorted(map(sorted, c.aggregates))
    for group in model.coupled_groups:
        place = {name: k for k, name in enumerate(group)}
        assert all(place[other] < place[name] for name in group for other in c.path(name)[:-1] if other in place)
    for k, group in enumerate(model.coupled_groups):
        for later in model.coupled_groups[k:]:
            assert not set(c.path(group[0])[:-1]) & set(later) - set(group)


# --- the laws of test_physics.py, to its tolerances; ancestors are those in the tree of aggregates

test_m_is_the_udu_factor = physics.test_m_is_the_udu_factor
test_m_factors_the_mass_matrix = physics.test_m_factors_the_mass_matrix
test_mass_matrix_is_symmetric = physics.test_mass_matrix_is_symmetric
test_l_inverts_m = physics.test_l_inverts_m
test_factors_have_the_sparsity_of_the_tree = physics.test_factors_have_the_sparsity_of_the_tree
test_determinant = physics.test_determinant
test_total_joint_rates = physics.test_total_joint_rates
test_working_moments = physics.test_working_moments
test_gravity = physics.test_gravity
test_energy = physics.test_energy
test_link_energy = physics.test_link_energy
test_base_energy = physics.test_base_energy
test_energy_of_a_joint_does_not_depend_on_the_order_of_its_dofs = (
    physics.test_energy_of_a_joint_does_not_depend_on_the_order_of_its_dofs
)
test_coriolis = physics.test_coriolis
test_coriolis_by_difference = physics.test_coriolis_by_difference
test_coriolis_unnormalized = physics.test_coriolis_unnormalized
test_coriolis_does_no_work = physics.test_coriolis_does_no_work
test_unnormalized_coriolis_does_work = physics.test_unnormalized_coriolis_does_work
test_bias = physics.test_bias
test_inverse_dynamics = physics.test_inverse_dynamics
test_forward_dynamics = physics.test_forward_dynamics
test_forward_undoes_inverse_dynamics = physics.test_forward_undoes_inverse_dynamics
test_equation_of_motion = physics.test_equation_of_motion
test_nu_moves_by_the_equation_of_motion = physics.test_nu_moves_by_the_equation_of_motion
test_power = physics.test_power
test_work = physics.test_work
test_external_wrenches = physics.test_external_wrenches
test_power_balance_by_difference = physics.test_power_balance_by_difference
test_sweeps_are_the_factors = physics.test_sweeps_are_the_factors
test_sweeps_invert_each_other = physics.test_sweeps_invert_each_other
test_sweeps_are_those_of_the_evaluation = physics.test_sweeps_are_those_of_the_evaluation
test_nu_ignores_outboard_rates = physics.test_nu_ignores_outboard_rates
test_epsilon_ignores_inboard_torques = physics.test_epsilon_ignores_inboard_torques
test_total_rate_is_own_rate_when_the_inboard_part_rests = (
    physics.test_total_rate_is_own_rate_when_the_inboard_part_rests
)
test_at_rest = physics.test_at_rest
test_without_torque = physics.test_without_torque
test_no_memory_of_earlier_calls = physics.test_no_memory_of_earlier_calls
test_nothing_is_left_unwritten = physics.test_nothing_is_left_unwritten


def test_unnormalized_equation_of_motion(robot):
    """D ξ̇ + C_ξ + κ_g = κ, each by its own D, along the dense solve's acceleration: ξ̇ = D^−½(ν̇ − ½ Ḋ D^−½ ξ)."""
    for case in robot.cases:
        s, t, root = case.s, case.truth, np.sqrt(case.truth.D)
        terms = (root * t.nu_dot - 0.5 * t.Ddot * t.xi, s.coriolis_unnormalized, root * s.gravity)
        scale = sum(norm(term / root) for term in (*terms, s.kappa)) + norm(t.Ddot * t.xi / root)
        assert_close(sum(terms) / root, s.kappa / root, tolerance(t), scale)


def test_nu_dot(robot):
    """ν̇ = ε − C − ε_g is mᵀq̈ + ṁᵀq̇ along the dense solve's acceleration."""
    for case in robot.cases:
        s, t = case.s, case.truth
        scale = sum(map(norm, (s.epsilon, s.gravity))) + t.coriolis_scale
        assert_close(s.nu_dot, t.nu_dot, tolerance(t), scale)


def test_reduced_manipulator(robot):
    """D, and the block of m of a node and what is outboard of it, ignore all positions not outboard of the node.

    A single joint's own position is among these; those of an aggregate are not.
    """
    case, o = robot.cases[1], robot.oracle
    for k in range(robot.model.nv):
        node = sorted(o.joint_mates(k))
        if k != node[0]:
            continue
        outboard = set.intersection(*(o.descendants(i) for i in node)) - set(node)
        kept = outboard | set(node) if o.is_coupled(k) else outboard
        q, _, _ = physics.others(robot, case, set(range(robot.model.nv)) - kept)
        same = np.isin(o.joint_of_coordinate, [o.joint_of_dof[i] for i in kept])
        q[same] = case.sample.q[same]  # to the bit: angles of planar joints have gone through sine and cosine
        f = case.dyn.factors(q)
        block = np.ix_(sorted(outboard | set(node)), sorted(outboard | set(node)))
        assert (f.D[node] == case.f.D[node]).all()
        assert (case.dyn.evaluate(q, case.sample.qd).articulated_inertia[node] == case.f.D[node]).all()
        assert (f.m[block] == case.f.m[block]).all()
        assert (f.unit[block] == case.f.unit[block]).all()


# --- followers and their leaders


def test_free_joints_that_move_alike(robot):
    """The robot with free joints, moved as the mimics say, has the same energy, and its efforts add up to τ."""
    o, c = robot.oracle, robot.oracle.coupling
    options = {"armature": dict(zip(o.full.dof_names, o.full.armature, strict=True)), "locked_joints": c.locked}
    options["armature"] = {name: a for name, a in options["armature"].items() if a}
    try:
        model = dd.load_urdf(
            ET.tostring(o.xml, encoding="unicode"), mimic="free", floating_base=robot.model.floating_base, **options
        )
    except dd.MasslessLinkError as error:
        assert {name.split("/")[0] for name in error.joints} & ({*c.mimics} | {m.leader for m in c.mimics.values()})
        return
    assert model.dof_names == o.full.dof_names
    free = dd.DiagonalDynamics(model)
    wrenches = physics.wrenches_on(model, 3)
    for case in robot.cases:
        (q, qd, tau, qdd), t = case.sample, case.truth
        full = o.q_full(q), o.G @ qd
        s = free.evaluate(*full)
        at = [model.link_names.index(name) for name in robot.model.link_names]
        assert_close(case.s.kinetic_energy, s.kinetic_energy, 1e-12 * t.cancellation)
        assert_close(case.s.link_energy, s.link_energy[at], 1e-12 * t.cancellation)
        for frame in ("link", "world"):
            # τ_full is what the constraint's moments, which GᵀF = 0, leave to the joints
            qdd = case.dyn.forward_dynamics(q, qd, tau, wrenches, frame=frame)
            efforts = o.G.T @ free.inverse_dynamics(*full, o.G @ qdd, wrenches, frame=frame)
            s = case.dyn.evaluate(q, qd, tau, wrenches, frame=frame)
            scale = sum(map(norm, (s.epsilon, s.coriolis, s.gravity, s.external)))
            assert_close(efforts / case.unit, tau / case.unit, tolerance(t), scale)


def with_dynamics(urdf, seed):
    """Return a URDF with damping, friction and limits of its own for every joint."""
    robot, rng = ET.fromstring(urdf), np.random.default_rng(seed)
    for element in robot.findall("joint"):
        numbers = {name: repr(float(rng.uniform(0.1, 2))) for name in ("damping", "friction")}
        for present in element.findall("dynamics"):
            element.remove(present)
        ET.SubElement(element, "dynamics", numbers)
        for name, low, high in (("lower", -9, -5), ("upper", 5, 9), ("effort", 10, 99), ("velocity", 10, 99)):
            if element.find("limit") is not None:
                element.find("limit").set(name, repr(float(rng.uniform(low, high))))
    return ET.tostring(robot, encoding="unicode")


@pytest.mark.parametrize("spec", ALL, ids=lambda robot: robot.id)
def test_friction(spec):
    """Followers brake their leaders: Σ multiplier² d and Σ |multiplier| f; a leader's limits are its own."""
    robot = load(spec._replace(source=with_dynamics(spec.urdf, len(spec.id))))
    model, o = robot.model, robot.oracle

    def of_joint(name, tag, attribute):
        element = o.coupling.joints.get(name)  # None: the floating base
        return 0.0 if element is None else float(element.find(tag).get(attribute))

    names = [o.full.model.names[j] for j in o.full._joint]
    damping, friction = (np.array([of_joint(n, "dynamics", a) for n in names]) for a in ("damping", "friction"))
    assert_close(model.damping, (o.G**2).T @ damping, 1e-14)
    assert_close(model.friction, np.abs(o.G).T @ friction, 1e-14)
    for k, name in enumerate(o.joint_of_dof):
        if o.coupling.joints.get(name) is not None and o.coupling.joints[name].find("limit") is not None:
            assert model.velocity_limit[k] == of_joint(name, "limit", "velocity")
            assert model.effort_limit[k] == of_joint(name, "limit", "effort")
            if o.coupling.kind(name) in ("revolute", "prismatic"):
                i = model.coordinate_names.index(name)
                assert model.lower[i] == of_joint(name, "limit", "lower")
                assert model.upper[i] == of_joint(name, "limit", "upper")
    for case in robot.cases[:2]:
        (q, qd, tau, qdd), t = case.sample, case.truth
        full = o.G @ qd
        resisting = o.G.T @ (damping * full) + model.friction * np.tanh(qd / model.friction_velocity)
        assert_close(case.dyn.friction_torque(qd), resisting, 1e-13, norm(np.abs(o.G).T @ np.abs(damping * full)))
        s = case.dyn.evaluate(q, qd, tau, friction=True)
        assert_close(s.friction, np.linalg.solve(t.m, resisting), tolerance(t))
        slowed = o.at(q, qd, tau - resisting).acceleration * case.unit
        actual = case.dyn.forward_dynamics(q, qd, tau, friction=True) * case.unit
        assert_close(actual, slowed, tolerance(t), norm(slowed) + norm(s.friction) + norm(s.epsilon))
        expected = (o.inverse_dynamics(q, qd, qdd) + resisting) / case.unit
        actual = case.dyn.inverse_dynamics(q, qd, qdd, friction=True) / case.unit
        assert_close(actual, expected, tolerance(t), norm(expected) + norm(resisting / case.unit))
        assert_close(s.power, s.nu @ (s.epsilon - s.gravity - s.friction), 1e-14, norm(s.nu) * norm(s.nu_dot) * 10)


LAWS = (
    physics.test_m_is_the_udu_factor,
    physics.test_m_factors_the_mass_matrix,
    physics.test_factors_have_the_sparsity_of_the_tree,
    physics.test_total_joint_rates,
    physics.test_working_moments,
    physics.test_gravity,
    physics.test_energy,
    physics.test_link_energy,
    physics.test_coriolis,
    physics.test_coriolis_unnormalized,
    physics.test_coriolis_does_no_work,
    physics.test_inverse_dynamics,
    physics.test_forward_dynamics,
    physics.test_power,
    physics.test_sweeps_are_the_factors,
    test_names,
    test_mimics,
    test_coupled_groups,
)


def check(robot):
    """Check the laws on one robot."""
    for law in LAWS:
        law(robot)


@examples(60)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from((1.0, 1e-5, 1e3)))
def test_random_trees(seed, floating, mass):
    """Many more of them, light and heavy."""
    spec = coupled_tree(seed)._replace(floating_base=floating)
    armature = {name: a * mass for name, a in spec.armature.items()}
    check(load(spec._replace(source=robots.in_other_units(spec.urdf, mass), armature=armature)))


@pytest.mark.parametrize("spec", ALL[::3], ids=lambda robot: robot.id)
def test_order_of_the_description(spec):
    """Joints and links may be written down in any order."""
    robot = ET.fromstring(spec.urdf)
    robot[:] = list(robot)[::-1]
    forth, back = (dd.load_urdf(urdf, **spec.options) for urdf in (spec.urdf, ET.tostring(robot, encoding="unicode")))
    assert back.dof_names == forth.dof_names and back.coupled_groups == forth.coupled_groups
    assert dict(back.mimics) == dict(forth.mimics) and dict(back.locked_joints) == dict(forth.locked_joints)
    sample = robots.samples(spec.id, Coupled(spec.urdf, forth.dof_names, **spec.options))[0]
    ours, theirs = (dd.DiagonalDynamics(model).evaluate(sample.q, sample.qd) for model in (back, forth))
    assert (ours.nu == theirs.nu).all() and (ours.coriolis == theirs.coriolis).all()


@pytest.mark.parametrize("floating", [False, True], ids=["fixed", "floating"])
@pytest.mark.parametrize("name", NAMED)
def test_locked_leader(name, floating):
    """Its followers stand where it has them stand, each of the leaders in turn."""
    spec = NAMED[name].floating if floating else NAMED[name]
    leaders = set(mimic_tags(spec.urdf).values()) - set(mimic_tags(spec.urdf))
    assert leaders
    for leader in sorted(leaders):
        if Coupling(ET.fromstring(spec.urdf), {}).kind(leader) == "fixed":
            continue
        held = spec._replace(locked_joints={leader: 0.7})
        c = Coupling(ET.fromstring(spec.urdf), held.locked_joints)
        assert leader not in {mimic.leader for mimic in c.mimics.values()}
        if not c.moving and not floating:
            model = dd.load_urdf(held.source, **held.options)
            assert model.nv == 0 and dict(model.locked_joints) == pytest.approx(c.locked)
            continue
        check(load(held))


@pytest.mark.parametrize("floating", [False, True], ids=["fixed", "floating"])
@pytest.mark.parametrize("name", NAMED)
def test_locked_follower(name, floating):
    """It is held alone, with what follows it; its leader and the leader's other followers move."""
    spec = NAMED[name].floating if floating else NAMED[name]
    free = Coupling(ET.fromstring(spec.urdf), {})
    for follower in free.mimics:
        held = spec._replace(locked_joints={follower: -0.4})
        c = Coupling(ET.fromstring(spec.urdf), held.locked_joints)
        assert free.mimics[follower].leader in c.moving and follower in c.locked
        if name == "massless leader link":
            with pytest.raises(dd.MasslessLinkError, match="'b'"):
                load(held)
        else:
            check(load(held))


def test_locked_on_the_way():
    """A follower that is held holds its own followers, where it has them stand."""
    urdf = NAMED["follower of a follower"].urdf
    model = dd.load_urdf(urdf, locked_joints={"b": 0.3})
    assert dict(model.locked_joints) == {"b": 0.3} and set(model.mimics) == {"b2", "c"}
    model = dd.load_urdf(urdf, locked_joints={"b2": 0.3})
    assert dict(model.locked_joints) == {"b2": 0.3, "c": 0.3} and not model.mimics and not model.coupled_groups
    model = dd.load_urdf(urdf, locked_joints={"a": 0.5})
    assert dict(model.locked_joints) == pytest.approx({"a": 0.5, "b2": -0.15, "c": -0.15}) and model.nv == 1
    released = model.with_locked_joints({})
    assert released.dof_names == dd.load_urdf(urdf).dof_names and set(released.mimics) == {"b2", "c"}
    again = released.with_locked_joints({"a": 0.5})
    assert again.bodies.tobytes() == model.bodies.tobytes()


@pytest.mark.parametrize("floating", [False, True], ids=["fixed", "floating"])
@pytest.mark.parametrize("name", NAMED)
def test_payloads(name, floating):
    """On links that followers move, and on others; from the start or later."""
    spec = NAMED[name].floating if floating else NAMED[name]
    c = Coupling(ET.fromstring(spec.urdf), {})
    rng = np.random.default_rng(len(name))
    movers = {*list(c.mimics)[:2], c.moving[-1]}
    payloads = {
        c.joints[mover].find("child").get("link"): dd.Payload(
            rng.uniform(0.5, 3), rng.uniform(-0.2, 0.2, 3), np.diag(rng.uniform(0.02, 0.03, 3))
        )
        for mover in movers
    }
    check(load(spec, payloads=payloads))
    loaded = dd.load_urdf(spec.source, **spec.options, payloads=payloads)
    later = dd.load_urdf(spec.source, **spec.options)
    before = dd.DiagonalDynamics(later).mass_matrix(later.neutral)
    for link_name, payload in payloads.items():
        later = later.with_payload(link_name, *payload)
    q = loaded.neutral
    actual, expected = (dd.DiagonalDynamics(model).mass_matrix(q) for model in (later, loaded))
    assert_close(actual, expected, 1e-14)
    for link_name in payloads:
        later = later.without_payload(link_name)
    assert_close(dd.DiagonalDynamics(later).mass_matrix(q), before, 1e-14)


@pytest.mark.parametrize("name", NAMED)
def test_gravity_argument(name):
    """Another gravity reaches what it belongs to, and nothing else."""
    spec, gravity = NAMED[name], (1.5, -2.5, 3.0)
    robot, earth = load(spec, gravity=gravity), load(spec)
    other = dd.DiagonalDynamics(earth.model.with_gravity(gravity))
    for case, before in zip(robot.cases, earth.cases, strict=True):
        scale = np.sqrt(robot.oracle.mass) * norm(gravity)
        assert_close(case.s.gravity, case.truth.gravity, tolerance(case.truth), scale)
        assert (case.s.coriolis == before.s.coriolis).all()
        q, qd, tau, _ = case.sample
        assert (other.evaluate(q, qd, tau).gravity == case.s.gravity).all()


# --- closed forms


def test_rack_and_pinion():
    """A prismatic joint that follows a wheel: M = I + m r² + a_wheel + a_rack r², C = 0."""
    wheel_inertia, mass, r = 0.03, 2.0, -0.15
    urdf = description(
        "rack",
        link("base"),
        link("wheel", 1.0, (0, 0, 0), (0.02, 0, 0, 0.02, 0, wheel_inertia)),
        link("rack", mass, (0.3, 0.1, 0), (0.1, 0, 0, 0.1, 0, 0.1)),
        joint("turn", "continuous", "base", "wheel"),
        mimicking(joint("slide", "prismatic", "base", "rack", axis=(0, 0, 1)), "turn", r, 0.05),
    )
    model = dd.load_urdf(urdf, armature={"turn": 0.01, "slide": 0.4})
    dyn = dd.DiagonalDynamics(model)
    D = wheel_inertia + mass * r**2 + 0.01 + 0.4 * r**2
    s = dyn.evaluate([2.0], [3.0], [1.2])
    assert model.dof_names == ("turn",) and model.coupled_groups in ((("turn", "slide"),), (("slide", "turn"),))
    assert s.articulated_inertia == pytest.approx([D], rel=1e-14)
    assert s.nu == pytest.approx([3 * np.sqrt(D)], rel=1e-14)
    assert np.abs([s.coriolis, s.coriolis_unnormalized]).max() < 1e-15
    weight = mass * 9.81 * r
    assert dyn.gravity_torque([2.0]) == pytest.approx([weight], rel=1e-14)
    assert dyn.forward_dynamics([2.0], [3.0], [1.2]) == pytest.approx([(1.2 - weight) / D], rel=1e-14)
    pushed = dyn.forward_dynamics([2.0], [3.0], [1.2], {"rack": [0, 0, 5.0, 0, 0, 0]})
    assert pushed == pytest.approx([(1.2 - weight + 5.0 * r) / D], rel=1e-14)
    energy = dict(zip(model.link_names, s.link_energy, strict=True))
    assert energy["rack"] == pytest.approx(0.5 * (mass + 0.4) * (3 * r) ** 2, rel=1e-14)
    assert energy["wheel"] == pytest.approx(0.5 * (wheel_inertia + 0.01) * 9, rel=1e-14)


def test_parallelogram():
    """A tip that undoes its bar's turn moves in a circle without turning: M = I₁ + m₁r² + m₂a², its I₂ for nothing."""
    m1, r, I1, m2, a = 0.7, 0.2, 0.01, 1.1, 0.5
    urdf = description(
        "parallelogram",
        link("base"),
        link("bar", m1, (r, 0, 0), (1e-3, 0, 0, I1, 0, I1)),
        link("tip", m2, (0.3, 0.1, 0.2), (0.2, 0, 0, 0.3, 0, 0.4)),
        joint("swing", "revolute", "base", "bar", axis=(0, 1, 0)),
        mimicking(joint("level", "revolute", "bar", "tip", axis=(0, 1, 0), xyz=(a, 0, 0)), "swing", -1.0),
    )
    dyn = dd.DiagonalDynamics(dd.load_urdf(urdf))
    D = I1 + m1 * r**2 + m2 * a**2
    for q, qd in np.random.default_rng(1).uniform(-3, 3, (5, 2)):
        s = dyn.evaluate([q], [qd])
        assert s.articulated_inertia == pytest.approx([D], rel=1e-13)
        assert np.abs([s.coriolis, s.coriolis_unnormalized]).max() < 1e-13 * qd**2
        assert dyn.gravity_torque([q]) == pytest.approx([-(m1 * r + m2 * a) * 9.81 * np.cos(q)], rel=1e-12)


@pytest.mark.parametrize("multiplier", [0.5, -1.0, -2.3])
def test_two_link_arm_of_one_freedom(multiplier):
    """The textbook arm with q₂ = k q₁ + b: D = gᵀM g, C = 0 as νᵀC = 0, C_ξ = ½Ḋξ; D' by hand."""
    arm = TwoLinkArm()
    b, g = 0.4, np.array([1.0, multiplier])
    urdf = ET.fromstring(arm.urdf)
    (elbow,) = (e for e in urdf.findall("joint") if e.get("name") == "elbow")
    ET.SubElement(elbow, "mimic", {"joint": "shoulder", "multiplier": repr(multiplier), "offset": repr(b)})
    dyn = dd.DiagonalDynamics(dd.load_urdf(ET.tostring(urdf, encoding="unicode")))
    for q, qd in np.random.default_rng(2).uniform(-3, 3, (5, 2)):
        full = np.array([q, multiplier * q + b])
        D = g @ arm.mass_matrix(full) @ g
        beta = arm._constants[1]
        D_dot = -2 * beta * np.sin(full[1]) * (1 + multiplier) * multiplier * qd
        s = dyn.evaluate([q], [qd])
        assert s.articulated_inertia == pytest.approx([D], rel=1e-13)
        assert s.nu == pytest.approx([np.sqrt(D) * qd], rel=1e-13)
        assert np.abs(s.coriolis).max() < 1e-13 * abs(s.nu[0] * qd)
        assert s.coriolis_unnormalized == pytest.approx([0.5 * D_dot * qd], rel=1e-11, abs=1e-13)
        assert dyn.bias([q], [qd]) == pytest.approx([g @ arm.bias(full, g * qd)], rel=1e-11, abs=1e-13)


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
    """Return a robot of two joints, a and b, which follows a; those of `massless` move no inertia."""
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
    """Where neither leader nor followers move inertia the leader is refused by name, or held with them."""
    urdf = tip("b", massless=("a", "b")).replace("</robot>", "") + (
        link("c_link", 1.0, (0.1, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1)) + joint("c", "revolute", "base", "c_link")
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
    held = Coupling(ET.fromstring(urdf.read_text()), {n: model.locked_joints[n] for n in ("LHand", "RHand")})
    assert dict(model.locked_joints) == pytest.approx(held.locked)
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
    """Of single multipliers that are legal; where the product of tiny ones vanishes it would hold the follower in silence."""
    body = {"mass": 1.0, "com": (0.1, 0.2, 0.3), "inertia": (0.1, 0, 0, 0.1, 0, 0.1)}
    elements = [link("base"), link("l0", **body), joint("j0", "revolute", "base", "l0", axis=(0, 0, 1))]
    for k in range(1, length + 1):
        hinge_ = joint(f"j{k}", "revolute", "base", f"l{k}", axis=(0, 0, 1))
        elements += [link(f"l{k}", **body), mimicking(hinge_, f"j{k - 1}", multiplier)]
    with pytest.raises(dd.MimicJointError, match=r"'j\d+' follows 'j\d+' with multiplier .*beyond 1e\+30"):
        dd.load_urdf(description("chain", *elements))


def test_errors_are_urdf_errors():
    assert issubclass(dd.MimicJointError, dd.UrdfError) and issubclass(dd.UrdfError, dd.ModelError)


def test_alex_names_leaders_it_does_not_have():
    urdf = robots.robot_path(ALEX)
    tags = mimic_tags(urdf.read_text(encoding="utf-8"))
    assert tags
    with pytest.raises(dd.UrdfError) as caught:
        dd.load_urdf(urdf)
    assert any(
        f"'{follower}'" in str(caught.value) and f"'{leader}'" in str(caught.value) for follower, leader in tags.items()
    )
    assert set(tags) <= set(dd.load_urdf(urdf, mimic="free").joint_names)


# --- other ways to treat them, copies


@pytest.mark.parametrize("name", NAMED)
def test_free_and_lock(name):
    """Free, all joints are independent; locked, followers stand where their leaders at zero have them."""
    spec = NAMED[name]
    c = Coupling(ET.fromstring(spec.urdf), {})
    if "massless" not in name:
        free = dd.load_urdf(spec.source, mimic="free", armature=spec.armature)
        assert set(free.joint_names) == {*c.moving, *c.locked}
        assert not free.mimics and not free.coupled_groups and not free.locked_joints
        assert set(free.mimic_joints) == set(mimic_tags(spec.urdf))
    held = {name: mimic.offset for name, mimic in c.mimics.items()} | c.locked
    if name not in ("massless leader link", "massless on the way"):
        locked = dd.load_urdf(spec.source, mimic="lock", armature=spec.armature)
        assert dict(locked.locked_joints) == pytest.approx(held, abs=1e-15)
        assert set(locked.joint_names) == set(c.independent)
        assert not locked.mimics and not locked.coupled_groups


UNCOUPLED = (
    robots.robot("ur_description/urdf/ur5_robot.urdf"),
    robots.robot(TALOS),
    *robots.random_robots(),
)


@pytest.mark.parametrize("spec", UNCOUPLED + tuple(spec.floating for spec in UNCOUPLED), ids=lambda robot: robot.id)
def test_without_coupled_joints_nothing_changes(spec):
    """Not a bit."""
    embedded, free = (dd.load_urdf(spec.source, mimic=mimic, **spec.options) for mimic in ("embed", "free"))
    assert embedded.bodies.tobytes() == free.bodies.tobytes() and embedded.links.tobytes() == free.links.tobytes()
    assert embedded.dof_names == free.dof_names and embedded.coordinate_names == free.coordinate_names
    assert not embedded.mimics and not embedded.coupled_groups
    oracle = Oracle(spec.urdf, free.dof_names, **spec.options)
    for sample in robots.samples(spec.id, oracle):
        ours, theirs = (everything(dd.DiagonalDynamics(model), sample) for model in (embedded, free))
        for name, value in theirs.items():
            assert (np.asarray(ours[name]) == np.asarray(value)).all(), name


@pytest.mark.parametrize("name", NAMED)
def test_pickling(name):
    """The same model, to the bit."""
    spec = NAMED[name].floating
    model = dd.load_urdf(spec.source, **spec.options)
    copy = pickle.loads(pickle.dumps(model))
    assert copy.dof_names == model.dof_names and copy.coupled_groups == model.coupled_groups
    assert dict(copy.mimics) == dict(model.mimics)
    sample = robots.samples(spec.id, Coupled(spec.urdf, model.dof_names, **spec.options))[1]
    ours, theirs = (everything(dd.DiagonalDynamics(m), sample) for m in (copy, model))
    for quantity, value in theirs.items():
        assert (np.asarray(ours[quantity]) == np.asarray(value)).all(), quantity


@pytest.mark.parametrize("name", ["parallel gripper", "leader is fixed", "planar joint inside an aggregate"])
def test_compiled_in_advance(name):
    """Also where all sweeps see an aggregate."""
    dd.DiagonalDynamics(dd.load_urdf(NAMED[name].source)).compile()


def test_input_errors_name_leaders():
    """What is wrong with an argument is said in terms of the independent joints."""
    dyn = dd.DiagonalDynamics(dd.load_urdf(GRIPPER.source))
    with pytest.raises(dd.InputError, match="left_finger"):
        dyn.evaluate([0.0, np.nan] if dyn.model.dof_names[1] == "left_finger" else [np.nan, 0.0], [0.0, 0.0])
    with pytest.raises(dd.InputError, match=r"shape \(7,\)"):
        dyn.evaluate(np.zeros(7), np.zeros(7))


# --- motion

SWINGING = ("parallel gripper", "nested three deep", "snake of two", "merged through a third group", "one freedom")


def start(name, speed):
    spec = NAMED[name]
    model = dd.load_urdf(spec.source, **spec.options)
    rng = np.random.default_rng(7)
    return spec, model, rng.uniform(-1, 1, model.nv), speed * rng.standard_normal(model.nv)


@pytest.mark.parametrize("gravity", [True, False], ids=["gravity", "weightless"])
@pytest.mark.parametrize("name", SWINGING)
def test_energy_of_a_simulation(name, gravity):
    """K + U stays, to 1e-6 of what is exchanged and falling as the method says; U is the oracle's, too."""
    spec, model, q, qd = start(name, 1.0 if gravity else 3.0)
    model = model if gravity else model.with_gravity((0, 0, 0))
    oracle = Coupled(spec.urdf, model.dof_names, model.gravity, **spec.options)
    drifts = []
    for h in (1e-3, 5e-4, 2.5e-4):
        sim = dd.Simulation(model, q, qd, step=h, damping=np.zeros(model.nv), limits=False)

        def energy(sim=sim):
            return 0.5 * sim.nu @ sim.nu + sim.potential_energy

        first, exchanged, drift, U = energy(), 0.0, 0.0, oracle.potential_energy(q) - sim.potential_energy
        for _ in range(10):
            sim.advance(steps=round(0.05 / h))
            exchanged = max(exchanged, 0.5 * sim.nu @ sim.nu)
            drift = max(drift, abs(energy() - first))
            assert oracle.potential_energy(sim.q) - sim.potential_energy == pytest.approx(U, abs=1e-11)
        drifts.append(drift / exchanged)
    assert exchanged > 1e-2, "nothing moved"
    assert drifts[0] < 1e-6, drifts
    floor = 1e-12
    assert drifts[1] < max(drifts[0] / 10, floor) and drifts[2] < max(drifts[1] / 10, floor), drifts


@pytest.mark.parametrize("name", SWINGING)
def test_trajectory(name):
    """The simulation's end is that of the classical Runge-Kutta method on the dense oracle."""
    spec, model, q, qd = start(name, 1.0)
    oracle = Coupled(spec.urdf, model.dof_names, **spec.options)
    tau = 0.1 * np.random.default_rng(2).standard_normal(model.nv)
    n, h, x = model.nv, 1e-3, np.concatenate([q, qd])

    def f(x):
        return np.concatenate([x[n:], oracle.forward_dynamics(x[:n], x[n:], tau)])

    for _ in range(250):
        k1 = f(x)
        k2 = f(x + h / 2 * k1)
        k3 = f(x + h / 2 * k2)
        k4 = f(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    sim = dd.Simulation(model, q, qd, step=2.5e-4, damping=np.zeros(n), limits=False)
    sim.advance(tau, steps=1000)
    assert norm(x[:n] - q) > 0.05, "nothing moved"
    assert_close(sim.q, x[:n], 1e-7)
    assert_close(sim.qd, x[n:], 1e-7)
