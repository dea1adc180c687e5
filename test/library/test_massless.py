# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints that move no inertia: which ones the error names and what cures them; the robots that no
law runs over.
"""

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import assert_close, norm
from derivative_oracles import RateOracle
from diag_dynamics.inspection import inspect_robot
from diag_dynamics.model import massless as check
from laws import everything
from oracles import Oracle
from robots import BOX, description, joint, link

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

SINGULAR, MOTIONLESS, EMPTY = (
    [id for id, exclusion in robots.EXCLUDED.items() if exclusion.reason == reason]
    for reason in (robots.SINGULAR, robots.MOTIONLESS, robots.EMPTY)
)
ROD = {"mass": 1.0, "com": (0, 0, 1), "inertia": (0.1, 0, 0, 0.1, 0, 0)}  # no inertia about z
DOT = {"mass": 1.0, "com": (0, 0, 0.5), "inertia": (0, 0, 0, 0, 0, 0)}


def robot(*elements):
    """Return a description with a first joint that moves a box, and more beyond it."""
    return description(
        "r", link("base"), link("box", **BOX), joint("first", "revolute", "base", "box"), *elements
    )


# --- who is named

# Of each: the elements, the joints that are massless, and their links.
HINGE = joint("j", "revolute", "box", "a")
TWO = joint("inner", "revolute", "box", "a"), joint("outer", "revolute", "a", "b")
CASES = {
    "no inertial": ([link("a"), HINGE], {"j": "a"}),
    "rod turning about itself": (
        [link("a", **ROD), HINGE],
        {"j": "a"},
    ),
    "point on the axis": (
        [link("a", **DOT), HINGE],
        {"j": "a"},
    ),
    "frames behind a fixed joint": (
        [
            link("a"),
            link("b"),
            HINGE,
            joint("weld", "fixed", "a", "b"),
        ],
        {"j": "a"},
    ),
    "two tips and the joint that carries them": (
        [
            *(link(name) for name in "abc"),
            joint("arm", "revolute", "box", "a"),
            joint("left", "revolute", "a", "b"),
            joint("right", "prismatic", "a", "c"),
        ],
        {"arm": "a", "left": "b", "right": "c"},
    ),
    "the inner one of two joints about one axis": (
        [
            link("a"),
            link("b", **BOX),
            *TWO,
        ],
        {"inner": "a"},
    ),
    "nearly nothing": (
        [
            link("a", mass=1e-15, inertia=(1e-18, 0, 0, 1e-18, 0, 1e-18)),
            link("b", **BOX),
            *TWO,
        ],
        {"inner": "a"},
    ),
    "planar without mass": (
        [link("a"), joint("j", "planar", "box", "a")],
        {"j/v_x": "a", "j/v_y": "a", "j/w_z": "a"},
    ),
    "planar that cannot turn": (
        [link("a", **ROD), joint("j", "planar", "box", "a")],
        {"j/w_z": "a"},
    ),
    "floating rod": (
        [link("a", **ROD), joint("j", "floating", "box", "a")],
        {"j/w_z": "a"},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_every_massless_joint_is_named(case):
    """With its D, its link, and what would cure it."""
    elements, expected = CASES[case]
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(robot(*elements))
    error = caught.value
    message = str(caught.value)
    assert error.joints == tuple(sorted(expected))
    assert np.abs(error.articulated_inertia).max() < 1e-10
    for name, D in zip(error.joints, error.articulated_inertia, strict=True):
        link_text = f"which carries link '{expected[name]}'"
        assert f"joint '{name}' (D = {D:.3g}), {link_text}" in message
    for cure in ("armature: ", "locked_joints: ", "massless: lock"):
        assert cure in message


def test_payload_cures_and_without_it_the_joint_is_named_again():
    urdf = robot(link("a"), joint("j", "revolute", "box", "a"))
    model = dd.load_urdf(urdf, payloads={"a": (1.0, (0.1, 0.0, 0.0))})
    assert model.dof_names == ("first", "j")
    with pytest.raises(dd.MasslessLinkError, match="'j'"):
        model.without_payload("a")
    with pytest.raises(dd.MasslessLinkError, match="'j'"):
        model.with_payload("a", 1.0, (0.0, 0.0, 0.1))  # a point on the axis
    assert model.with_payload("a", 1e-3, (0.01, 0.0, 0.0)).nv == 2


def test_locked_at_zero_or_at_the_limit_next_to_it():
    def limited(lower, upper):
        tip = joint("j", "revolute", "box", "a").replace(
            'lower="-10" upper="10"', f'lower="{lower}" upper="{upper}"'
        )
        return dict(dd.load_urdf(robot(link("a"), tip), massless="lock").locked_joints)["j"]

    assert [limited(-1, 2), limited(0.5, 2), limited(-3, -1)] == [0.0, 0.5, -1.0]


def articulated_inertias(M):
    """Return D of M = U D Uᵀ by elimination from the tip, leaving out pivots that are zero."""
    M, D = M.copy(), np.zeros(len(M))
    for k in reversed(range(len(M))):
        D[k] = M[k, k]
        if D[k] > 1e-13:
            M[:k, :k] -= np.outer(M[:k, k], M[:k, k]) / D[k]
    return D


@pytest.mark.parametrize("floating", [False, True], ids=["fixed", "floating"])
@pytest.mark.parametrize("id", SINGULAR)
def test_singular_robots_of_the_wheel(id, floating):
    """The error names the joints whose D vanishes in Pinocchio's M, and locking them is locking
    just them.
    """
    source = robots.robot_path(id)
    names = robots.EXCLUDED[id].joints
    oracle = Oracle(robots.robot(id).urdf)
    for sample in robots.samples(id, oracle):
        M = oracle.mass_matrix(sample.q)
        D = articulated_inertias(M)
        assert np.linalg.cond(M) > 1e13
        assert {name for name, d in zip(oracle.dof_names, D, strict=True) if d < 1e-13} == set(
            names
        )
        assert min(d for d in D if d >= 1e-13) > 1e-6  # none is on the edge
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(source, mimic="free", floating_base=floating)
    assert set(caught.value.joints) == set(names)
    locked = dd.load_urdf(source, mimic="free", massless="lock", floating_base=floating)
    stiff = dd.load_urdf(
        source, mimic="free", locked_joints=dict.fromkeys(names, 0.0), floating_base=floating
    )
    assert dict(locked.locked_joints) == dict.fromkeys(names, 0.0)
    assert locked.bodies.tobytes() == stiff.bodies.tobytes()
    geared = dd.load_urdf(
        source, mimic="free", armature=dict.fromkeys(names, 1e-3), floating_base=floating
    )
    assert geared.nv == locked.nv + len(names)


def test_massless_base_cannot_float():
    for urdf in (robots.PENDULUM, robots.TwoLinkArm().urdf):
        for massless in ("error", "lock"):
            with pytest.raises(dd.MasslessLinkError, match="root_joint/"):
                dd.load_urdf(urdf, floating_base=True, massless=massless)


# --- singular at some configurations only

GIMBAL = robot(
    link("yoke"),
    link("ring"),
    link("rotor", **BOX),
    joint("roll", "continuous", "box", "yoke", axis=(1, 0, 0)),
    joint("pitch", "continuous", "yoke", "ring", axis=(0, 1, 0)),
    joint("yaw", "continuous", "ring", "rotor", axis=(0, 0, 1)),
)


def calls_that_need_the_factor(dyn, q, x):
    """Return the calls that divide by D."""
    sweeps = dyn.nu_from_qd, dyn.qd_from_nu, dyn.epsilon_from_tau, dyn.tau_from_epsilon
    rates = dyn.m_rate_transposed_times, dyn.coriolis_bracket_times
    links = (dyn.wrench_factor, dyn.operational_inverse_inertia)
    tip = dyn.model.link_names[-1]
    return (
        lambda: dyn.evaluate(q, x, x),
        lambda: dyn.factors(q),
        lambda: dyn.forward_dynamics(q, x, x),
        lambda: dyn.log_det(q),
        lambda: dyn.log_det_rate(q, x),
        lambda: dyn.epsilon_from_wrench(q, tip, np.ones(6)),
        lambda: dyn.reflected_mass(q, tip, (0, 0, 1)),
        *(lambda call=call: call(q, x) for call in sweeps),
        *(lambda call=call: call(q, x, x) for call in rates),
        *(lambda call=call: call(q, tip) for call in links),
    )


ICUB = "icub_description/robots/icub.urdf"


@pytest.mark.parametrize("turn", [1, -1, 3, None])
def test_singular_at_one_configuration(turn):
    """M is regular but for one configuration, where the error names the joint.

    Rings without mass have roll and yaw about one axis at a pitch of 90°. iCub's head is point
    masses, and D of its neck_roll vanishes at q = 0.
    """
    source = robots.robot_path(ICUB) if turn is None else GIMBAL
    dyn = dd.DiagonalDynamics(dd.load_urdf(source, mimic="free"))
    q = np.zeros(dyn.model.nv) if turn is None else np.array([0.3, 0.4, turn * np.pi / 2, 0.5])
    x = np.random.default_rng(2).standard_normal(len(q))
    name = "neck_roll" if turn is None else "roll"
    for call in calls_that_need_the_factor(dyn, q, x):
        with pytest.raises(dd.SingularMassMatrixError, match=f"'{name}'") as caught:
            call()
        assert caught.value.joint == name
        assert abs(caught.value.articulated_inertia) < 1e-12
    # calls without the factor still answer
    oracle = RateOracle(source if turn else source.read_text(encoding="utf-8"), dyn.model.dof_names)
    M = oracle.mass_matrix(q)
    C_s = oracle.coriolis_matrix(q, x)
    unit = np.sqrt(np.diag(M))
    weigh = np.outer(unit, unit)
    size = norm(C_s) * norm(x)
    assert_close(dyn.mass_matrix(q) / weigh, M / weigh, 1e-12)
    assert_close(dyn.inverse_dynamics(q, x, x), oracle.inverse_dynamics(q, x, x), 1e-12)
    assert_close(dyn.coriolis_matrix_times(q, x, x), C_s @ x, 1e-12, size)
    assert_close(dyn.mass_matrix_rate(q, x), C_s + C_s.T, 1e-12, norm(C_s))


# --- no false alarm; units and light links are in test_random_trees.py


def concurrent_wrist(joints):
    """Return an arm whose axes meet in the centre of mass of its only heavy link."""
    parts = [link("l0")]
    for k in range(joints):
        parts.append(
            joint(f"j{k + 1}", "revolute", f"l{k}", f"l{k + 1}", axis=((0, 0, 1), (0, 1, 0))[k % 2])
        )
        heavy = (2.0, (0, 0, 0), (0.01, 0, 0, 0.012, 0, 0.009)) if k == joints - 1 else ()
        parts.append(link(f"l{k + 1}", *heavy))
    return description("wrist", *parts)


@pytest.mark.parametrize("joints", [5, 6, 7])
def test_rounding_that_joints_outboard_leave_is_no_inertia(joints):
    """Three axes take up all inertia of the tip; what is left for those inboard is noise, be there
    a rotor between or not.
    """
    urdf = concurrent_wrist(joints)
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(urdf, armature={"j2": 0.1})
    assert "j1" in caught.value.joints
    assert "j2" not in caught.value.joints
    stiff = dd.load_urdf(urdf, armature={"j2": 0.1}, massless="lock")
    dyn = dd.DiagonalDynamics(stiff)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, qd, tau = rng.uniform(-1.0, 1.0, (3, stiff.nv))
        M = dyn.mass_matrix(q)
        assert np.linalg.cond(M) < 1e6
        assert_close(
            M @ dyn.forward_dynamics(q, qd, tau),
            tau - dyn.coriolis_torque(q, qd) - dyn.gravity_torque(q),
            1e-10,
        )


# --- the other robots that no law runs over


def test_robots_of_the_wheel():
    """Every URDF of the wheel is regular or excluded for a reason, and every exclusion exists."""
    everything = set(robots.all_robots())
    assert len(everything) >= 69
    assert set(robots.regular_robots()) | set(robots.EXCLUDED) == everything
    assert sorted(SINGULAR + MOTIONLESS + EMPTY) == sorted(robots.EXCLUDED)


@pytest.mark.parametrize("id", MOTIONLESS)
def test_motionless(id):
    """Where nothing moves answers are empty, ln det M is that of the empty matrix, and masses are
    infinite.
    """
    assert Oracle(robots.robot(id).urdf).nv == 0
    model = dd.load_urdf(robots.robot_path(id), mimic="free")
    assert (model.nv, model.nq, model.dof_names, model.joint_names) == (0, 0, (), ())
    scalars = {
        "kinetic_energy": 0.0,
        "power": 0.0,
        "log_det": 0.0,
        "log_det_rate": 0.0,
        "reflected_mass": np.inf,
    }
    answers = everything(dd.DiagonalDynamics(model), robots.Sample(*np.zeros((4, 0))))
    for name, value in answers.items():
        if name in scalars:
            assert value == scalars[name], name
        elif name in ("link_energy", "operational_inverse_inertia"):
            assert not value.any(), name
        else:
            assert value.size == 0 and value.shape[0] == 0, name
    assert answers["link_energy"].shape == (len(model.link_names),)
    assert answers["wrench_factor"].shape == (0, 6)
    assert answers["operational_inverse_inertia"].shape == (6, 6)
    for name in ("m", "l", "unit", "mass_matrix", "mass_matrix_rate"):
        assert answers[name].shape == (0, 0), name
    rows = np.zeros((3, 0))
    assert dd.DiagonalDynamics(model).factors(rows).m.shape == (3, 0, 0)


@pytest.mark.parametrize("id", EMPTY)
def test_empty(id):
    """A file without any link is no robot for anyone: the loader says so."""
    assert "<link" not in robots.robot(id).urdf
    with pytest.raises(dd.UrdfError, match="link"):
        dd.load_urdf(robots.robot_path(id), mimic="free")


def test_factorization_and_elimination_agree(monkeypatch):
    """Where all joints clearly move inertia D is that of a factorization, which is fast."""
    model = dd.load_robot("talos_full_v2")
    q = model.random(np.random.default_rng(0))
    fast, _ = check.joint_inertias(model, q, None)
    monkeypatch.setattr(check, "DISTINCT", np.inf)
    exact, size = check.joint_inertias(model, q, None)
    np.testing.assert_allclose(fast, exact, rtol=1e-9)
    D = dd.DiagonalDynamics(model).factors(q).D
    np.testing.assert_allclose(exact, D, rtol=1e-9)
    assert (exact / size < 1.0).all()


# --- Negative moments

NEGATIVE = (-0.02, 0.0, 0.0, -0.03, 0.0, -0.04)


@pytest.mark.parametrize("options", [{}, {"floating_base": True}])
def test_negative_moments_are_named(options):
    """They are the cause of an articulated inertia below zero."""
    arm = (link("base", 1.0, inertia=(1, 0, 0, 1, 0, 1)), link("a", 1.0, inertia=NEGATIVE))
    text = description("odd", *arm, joint("j", "revolute", "base", "a"))
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(text, **options)
    D = dict(zip(caught.value.joints, caught.value.articulated_inertia, strict=True))
    assert D["j"] < 0.0 and f"joint 'j' (D = {D['j']:.3g}), which carries link 'a'" in str(
        caught.value
    )
    first, second, *_ = inspect_robot(text, **options).findings
    assert (first.severity, first.joints) == ("error", ("j",)) and "with D" in first.what
    assert second.links == ("a",) and "moment of inertia is negative" in second.what
    assert second.values["a"] == pytest.approx(-0.04)


def test_negative_moments_of_other_links_are_no_cause():
    """A gripper that moves no inertia is named for itself, whatever the inertia of the link that it
    is on.
    """
    arm = (link("base", 1.0), link("a", 5.0, inertia=(-0.01, 0, 0, 1, 0, 1)), link("finger", 0.0))
    joints = joint("j", "revolute", "base", "a"), joint("grip", "revolute", "a", "finger")
    with pytest.raises(dd.MasslessLinkError, match="move no inertia") as caught:
        dd.load_urdf(description("odd", *arm, *joints))
    assert caught.value.joints == ("grip",)
