# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of diagonalized dynamics (support/laws.py) over fixed, floating and coupled robots,
against Pinocchio.

Also what depends on what, to the bit, and what the interface promises.
"""

import pickle
import re
from itertools import combinations

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import assert_close
from coupling import Coupled
from described import PANDA
from laws import LAWS, assert_same, everything, fields, load
from oracles import FLOATING

# Some example robots have inertias that no rigid body has; test_urdf.py is about that.
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")


@pytest.fixture(scope="module", params=robots.robots_to_test())
def robot(request):
    """Return each robot in turn; module scope, so that all tests of one robot share one
    evaluation.
    """
    return load(request.param)


@pytest.fixture(scope="module")
def panda():
    """Return the robot of the tests that need only one."""
    return load(robots.robot(PANDA))


@pytest.mark.parametrize("law", LAWS)
def test_law(robot, law):
    """Each law, for each robot."""
    for case in robot.cases:
        law(case)


# --- the model


def test_names(robot):
    """Joints are Pinocchio's but for mimic joints that are coupled, base to tip; links are the
    URDF's.
    """
    model = robot.model
    oracle = robot.oracle
    assert model.nv == len(model.dof_names) == oracle.nv
    assert model.nq == len(model.coordinate_names) == oracle.nq
    assert isinstance(model.dof_names, tuple) and isinstance(model.coordinate_names, tuple)
    assert model.joint_names == tuple(dict.fromkeys(name.split("/")[0] for name in model.dof_names))
    if not isinstance(oracle, Coupled):
        assert set(model.joint_names) == set(list(oracle.model.names)[1:])
        assert all(j < k for k in range(model.nv) for j in oracle.ancestors(k))
    assert (model.neutral == oracle.neutral).all()
    if model.floating_base:
        assert model.dof_names[:6] == tuple(f"root_joint/{suffix}" for suffix in FLOATING)
    assert sorted(model.link_names) == sorted(
        link.get("name") for link in oracle.xml.findall("link")
    )


def test_rate_of_coulomb_friction():
    """It stays with the model; f sign(q̇) without one."""
    urdf = re.sub(
        'damping="[^"]*" friction="[^"]*"', 'damping="0" friction="1.5"', robots.robot(PANDA).urdf
    )
    model = dd.load_urdf(urdf, friction_velocity=0.02)
    copies = model.with_gravity((0, 0, 0)), model.with_payload("panda_hand", 1.0)
    for copy in (*copies, pickle.loads(pickle.dumps(model))):
        assert copy.friction_velocity == 0.02
    jumping = dd.DiagonalDynamics(dd.load_urdf(urdf, friction_velocity=0))
    qd = np.linspace(-1e-9, 1e-9, model.nv)
    rubbing = model.friction > 0.0
    assert (jumping.friction_torque(qd)[rubbing] == 1.5 * np.sign(qd[rubbing])).all()
    for wrong in (-1e-3, np.nan, np.inf, "5e-3"):
        with pytest.raises(dd.InputError, match="friction_velocity"):
            dd.load_urdf(urdf, friction_velocity=wrong)


# --- what depends on what: exactly, by structure


def others(robot, case, names):
    """Return copies of the sample's q, q̇ and τ in which the dofs of `names` are changed, the rest
    to the bit.
    """
    step = 0.7 * np.isin(np.arange(robot.model.nv), list(names))
    q, qd, tau, _ = case.sample
    moved = robot.oracle.moved(q, step)
    o = robot.oracle
    same = ~np.isin(o.joint_of_coordinate, [o.joint_of_dof[k] for k in names])
    moved[same] = q[same]  # angles of planar joints have gone through sine and cosine
    return moved, qd + step, tau + step


def test_reduced_manipulator(robot):
    """D, and the block of m of a joint and all outboard of it, ignore all other positions.

    The joint's own positions are among these. Coupled joints depend on theirs.
    """
    if isinstance(robot.oracle, Coupled):
        return
    case = robot.cases[1]
    o = robot.oracle
    nv = robot.model.nv
    for node in {tuple(sorted(o.joint_mates(k))) for k in range(nv)}:
        outboard = set.intersection(*(o.descendants(k) for k in node)) - set(node)
        q, _, _ = others(robot, case, set(range(nv)) - outboard)
        f = case.dyn.factors(q)
        node = list(node)
        assert (f.D[node] == case.f.D[node]).all()
        assert (
            case.dyn.evaluate(q, case.sample.qd).articulated_inertia[node] == case.f.D[node]
        ).all()
        block = np.ix_(sorted(outboard | set(node)), sorted(outboard | set(node)))
        assert (f.m[block] == case.f.m[block]).all()
        assert (f.unit[block] == case.f.unit[block]).all()


def test_continuous_joint_has_one_angle(robot):
    """Full turns of an angle that no other joint follows change nothing but rounding."""
    case = robot.cases[0]
    model = robot.model
    sources = {mimic.leader for mimic in model.mimics.values()}
    turning = {
        name for k, name in enumerate(model.dof_names) if not robot.oracle.is_prismatic(k)
    } - sources
    turning |= {name for name in model.coordinate_names if name.endswith("/theta")}
    turns = np.array([2 * np.pi * (name in turning) for name in model.coordinate_names])
    s = case.dyn.evaluate(case.sample.q + turns, case.sample.qd)
    assert_close(s.nu, case.s.nu, case.tolerance)
    assert_close(s.coriolis, case.s.coriolis, case.tolerance, case.t.coriolis_scale)


# --- the interface's promises


def test_without_torque(robot):
    """No τ, no moments: None, and the rest unchanged to the bit."""
    case = robot.cases[0]
    s = case.dyn.evaluate(case.sample.q, case.sample.qd)
    assert s.epsilon is None and s.kappa is None and s.power is None
    assert_same(fields(s), fields(case.s, "epsilon", "kappa", "power"))


def test_no_memory_of_earlier_calls(robot):
    """Workspaces are reused; answers do not show it, and what was handed out stays as it was."""
    first = robot.cases[0].sample
    other = robot.cases[2].sample
    before = everything(robot.dyn, first)
    remaining = {name: np.array(value) for name, value in before.items()}
    everything(robot.dyn, other)
    assert_same(before, remaining)
    assert_same(everything(robot.dyn, first), remaining)
    assert_same(everything(dd.DiagonalDynamics(robot.model), first), remaining)


def test_nothing_is_left_unwritten(robot, monkeypatch):
    """Every entry handed out was computed: memory that starts as NaN changes no answer."""
    expected = everything(robot.dyn, robot.cases[1].sample)
    empty = np.empty

    def of_nan(shape, dtype=np.float64, **_):
        array = empty(shape, dtype)
        array.reshape(-1).view(np.uint8)[...] = 0xFF  # a NaN in every field of a record, too
        return array

    monkeypatch.setattr(np, "empty", of_nan)
    assert_same(everything(robot.dyn, robot.cases[1].sample), expected)


def test_answers_share_no_memory(panda):
    """No two arrays handed out overlap each other or the arguments, which stay as they are."""
    sample = panda.cases[0].sample
    inputs = [x.copy() for x in sample]
    answers = [*everything(panda.dyn, sample).items(), *everything(panda.dyn, sample).items()]
    arrays = [(name, a) for name, a in answers if isinstance(a, np.ndarray)] + [
        ("argument", x) for x in sample
    ]
    assert len(arrays) > 60
    for (name, a), (other, b) in combinations(arrays, 2):
        assert not np.shares_memory(a, b), (name, other)
    assert all((x == copy).all() for x, copy in zip(sample, inputs, strict=True))
