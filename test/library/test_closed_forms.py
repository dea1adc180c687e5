# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots whose dynamics are known by hand, in the library and in the oracles."""

import re
from pathlib import Path

import numpy as np
import pytest
from pinocchio.rpy import rpyToMatrix

import diag_dynamics as dd
import robots
from accuracy import EPS, norm
from derivative_oracles import link_placement
from oracles import Oracle
from robots import description, joint, link

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

# --- the oracles


@pytest.mark.parametrize("name", ["oracles", "robots", "coupling", "derivative_oracles"])
def test_oracles_share_no_code_with_the_library(name):
    """An oracle that shared code with the library would share its mistakes."""
    source = (Path(robots.__file__).parent / f"{name}.py").read_text(encoding="utf-8")
    assert not re.search(r"^\s*(from|import) diag_dynamics", source, re.M)


# --- closed forms, of the library and of the oracle


@pytest.mark.parametrize("seed", range(5))
def test_two_link_arm(seed):
    """M, c, U, D, ν and C of the textbook arm, worked out by hand."""
    arm = robots.TwoLinkArm(*np.random.default_rng(seed).uniform(0.2, 2, 7))
    q, qd = np.random.default_rng(seed + 100).uniform(-3, 3, (2, 2))
    dyn, t = (
        dd.DiagonalDynamics(dd.load_urdf(arm.urdf)),
        Oracle(arm.urdf, ("shoulder", "elbow")).at(q, qd),
    )
    s, f, (unit, D) = dyn.evaluate(q, qd), dyn.factors(q), arm.factor(q)
    for exact, rtol, atol, *answers in (
        (arm.mass_matrix(q), 1e-12, 0, dyn.mass_matrix(q), t.M),
        (arm.coriolis_torque(q, qd), 1e-11, 1e-13, dyn.coriolis_torque(q, qd), t.c),
        (unit, 1e-12, 0, f.unit, t.unit),
        (D, 1e-12, 0, f.D, t.D),
        ((unit * np.sqrt(D)).T @ qd, 1e-12, 0, s.nu, t.nu),
        (arm.coriolis(q, qd), 1e-10, 1e-12, s.coriolis, t.coriolis),
        (arm.coriolis(q, qd), 1e-9, 1e-11, t.coriolis_by_difference),
    ):
        for answer in answers:
            np.testing.assert_allclose(answer, exact, rtol, atol)


def test_pendulum():
    """One joint: D is the inertia about the axis, g its gravity moment, and C = 0."""
    q, qd, tau = [4.0], [3.0], [1.5]
    dyn, t = (
        dd.DiagonalDynamics(dd.load_urdf(robots.PENDULUM)),
        Oracle(robots.PENDULUM).at(q, qd, tau),
    )
    s, (y, z) = dyn.evaluate(q, qd, tau), (0.05, -0.4)
    D = 0.02 + 0.8 * (y**2 + z**2)
    moment = (
        0.8 * 9.81 * (y * np.cos(4.0) - z * np.sin(4.0))
    )  # m g × lever arm of the turned centre of mass
    for exact, *answers in (
        (D, s.articulated_inertia, t.D),
        (moment, dyn.gravity_torque(q), t.g),
        (3 * np.sqrt(D), s.nu, t.nu),
        ((1.5 - moment) / D, dyn.forward_dynamics(q, qd, tau), t.acceleration),
    ):
        for answer in answers:
            assert answer == pytest.approx([exact], rel=1e-13)
    assert np.abs([s.coriolis, t.coriolis]).max() < 1e-14


@pytest.mark.parametrize("urdf", [robots.PENDULUM, robots.GANTRY], ids=["one joint", "gantry"])
def test_no_coriolis_term(urdf):
    """C = 0 for one joint, and where there are translations only; C_ξ too, as D is constant."""
    model = dd.load_urdf(urdf)
    dyn, oracle = dd.DiagonalDynamics(model), Oracle(urdf, model.dof_names)
    for q, qd in np.random.default_rng(5).uniform(-3, 3, (10, 2, model.nv)):
        s, t = dyn.evaluate(q, qd), oracle.at(q, qd)
        rounding = 10 * EPS * norm(s.nu) * norm(qd)
        assert norm(s.coriolis) <= rounding
        assert norm(s.coriolis_unnormalized / np.sqrt(s.articulated_inertia)) <= rounding
        assert (s.articulated_inertia == dyn.evaluate(0 * q, qd).articulated_inertia).all()
        assert max(norm(t.coriolis), norm(t.coriolis_by_difference)) < 1e-11
    if model.nv == 3:
        np.testing.assert_allclose(np.diag(dyn.mass_matrix(q)), [27, 7, 2], rtol=1e-14)
        np.testing.assert_allclose(np.diag(t.M), [27, 7, 2], rtol=1e-14)


# --- rates of change and operational space


@pytest.mark.parametrize("seed", range(5))
def test_rates_of_the_two_link_arm(seed):
    """The textbook arm: only β cos q₂ changes, D₂ is constant, and B has the one entry that makes its C."""
    arm = robots.TwoLinkArm(*np.random.default_rng(seed).uniform(0.2, 2, 7))
    q, qd = np.random.default_rng(seed + 100).uniform(-3, 3, (2, 2))
    dyn = dd.DiagonalDynamics(dd.load_urdf(arm.urdf))
    _, beta, _ = arm._constants
    (unit, D), s = arm.factor(q), beta * np.sin(q[1])
    assert np.allclose(
        dyn.mass_matrix_rate(q, qd), -s * qd[1] * np.array([[2, 1], [1, 0]]), rtol=1e-11, atol=1e-14
    )
    assert (dyn.mass_matrix_rate(q, [1.0, 0.0]) == 0).all()  # nothing depends on the shoulder
    # D₁ = M₁₁ − M₁₂²/M₂₂, u = M₁₂/M₂₂
    D_rate = np.array([-2 * s * qd[1] * (1 - unit[0, 1]), 0.0])
    m_rate = np.array([[0.5 * D_rate[0] / np.sqrt(D[0]), -s * qd[1] / np.sqrt(D[1])], [0.0, 0.0]])
    assert np.allclose(dyn.evaluate(q, qd).articulated_inertia_rate, D_rate, rtol=1e-10, atol=1e-13)
    assert np.allclose(
        dyn.m_rate_transposed_times(q, qd, [1.0, 0.0]), m_rate[0], rtol=1e-10, atol=1e-13
    )
    assert np.allclose(dyn.m_rate_transposed_times(q, qd, [0.0, 1.0]), 0.0, atol=1e-13)
    b = -s * (qd[0] + qd[1]) / np.sqrt(D[0] * D[1])  # C = b [ν₂, −ν₁]
    assert np.allclose(
        dyn.coriolis_bracket_times(q, qd, [0.0, 1.0]), [b, 0.0], rtol=1e-10, atol=1e-12
    )
    assert np.allclose(
        dyn.coriolis_bracket_times(q, qd, [1.0, 0.0]), [0.0, -b], rtol=1e-10, atol=1e-12
    )
    assert dyn.log_det(q) == pytest.approx(np.log(np.linalg.det(arm.mass_matrix(q))), abs=1e-13)
    assert dyn.log_det_rate(q, qd) == pytest.approx(D_rate[0] / D[0], rel=1e-10)


def test_rates_of_a_gantry():
    """Translations only: nothing changes; the hook's reflected mass along an axis is what that axis moves."""
    dyn = dd.DiagonalDynamics(dd.load_urdf(robots.GANTRY))
    q, qd, x = np.random.default_rng(5).uniform(-3, 3, (3, 3))
    rounding = 100 * EPS * norm(qd) * norm(x)
    for rate in (
        dyn.m_rate_transposed_times(q, qd, x),
        dyn.coriolis_bracket_times(q, qd, x),
        dyn.mass_matrix_rate_times(q, qd, x),
        dyn.mass_matrix_rate(q, qd),
        dyn.coriolis_matrix_times(q, qd, x),
        dyn.log_det_rate(q, qd),
        dyn.evaluate(q, qd).articulated_inertia_rate,
    ):
        assert norm(rate) <= rounding
    assert dyn.reflected_mass(q, "bridge", (1, 0, 0), frame="world") == pytest.approx(
        np.linalg.det(dyn.mass_matrix(q)) / np.linalg.det(dyn.mass_matrix(q)[1:, 1:]), rel=1e-12
    )
    for direction in ((0, 1, 0), (0, 0, 1), (0, 3, -2)):
        assert dyn.reflected_mass(q, "bridge", direction, frame="world") == np.inf


def test_reflected_mass_of_one_joint():
    """A slide carries its mass along its axis, mass/cos² beside it; a wheel D/r² along the tangent."""
    head = link("head", 2.5, (0.1, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1))
    pose = {"xyz": (0.3, 0, 0), "rpy": (0.4, 0.2, 0.1)}
    slide = joint("slide", "prismatic", "base", "head", (1, 2, 2), **pose)
    dyn = dd.DiagonalDynamics(dd.load_urdf(description("piston", link("base"), head, slide)))
    assert dyn.reflected_mass([0.7], "head", (1, 2, 2)) == pytest.approx(2.5, rel=1e-14)
    assert dyn.reflected_mass([0.7], "head", (0, 0, 1), (5.0, 1.0, 0.0)) == pytest.approx(
        2.5 * 9 / 4, rel=1e-13
    )
    pendulum = dd.DiagonalDynamics(dd.load_urdf(robots.PENDULUM))
    D = pendulum.evaluate([1.0], [0.0]).articulated_inertia[0]
    assert pendulum.reflected_mass([1.0], "rod", (0, 1, 0), (0.3, 0, -2.0)) == pytest.approx(
        D / 4, rel=1e-13
    )
    J_w = pendulum.wrench_factor(
        [1.0], "rod"
    )  # a turning joint feels the moment about its axis only
    assert J_w[0] == pytest.approx([0, 0, 0, 1 / np.sqrt(D), 0, 0], rel=1e-13, abs=1e-14)
    for direction, point in (
        ((1, 0, 0), (0.1, 0.2, 0.3)),
        ((0, 1, 0), (0, 0, 0)),
        ((0, 0, 2), (7.0, 0, 0)),
    ):
        assert pendulum.reflected_mass([0.3], "rod", direction, point) == np.inf
    assert pendulum.reflected_mass([0.3], "base", (0, 0, 1)) == np.inf


@pytest.mark.parametrize("frame", ["link", "world"])
@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_reflected_mass_beside_a_crooked_joint(kind, frame):
    """∞ across a slide and along lines through a hinge's axis: rounding is no motion. A push 10⁻⁶ beside is finite."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        axis, rpy = rng.standard_normal(3), rng.uniform(-3, 3, 3)
        head = link("head", 2.5, (0.1, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1))
        urdf = description(
            kind,
            link("base"),
            head,
            joint("only", kind, "base", "head", axis, (0.3, 0.1, 0.2), rpy),
        )
        axis, q, point = axis / norm(axis), rng.uniform(-2, 2, 1), rng.standard_normal(3)
        dyn = dd.DiagonalDynamics(dd.load_urdf(urdf))
        R = link_placement(Oracle(urdf), q, "head").rotation if frame == "world" else np.eye(3)
        if kind == "prismatic":
            stuck, free, mass = np.cross(axis, rng.standard_normal(3)), axis, 2.5
        else:
            stuck, free = (
                rng.standard_normal() * axis - point,
                np.cross(axis, point),
            )  # stuck: towards the axis
            mass = dyn.evaluate(q, [0.0]).articulated_inertia[0] / (free @ free)
        stuck, free = stuck / norm(stuck), free / norm(free)
        nearly = dyn.reflected_mass(q, "head", R @ (stuck + 1e-6 * free), point, frame=frame)
        assert nearly == pytest.approx(1e12 * mass, rel=1e-8)
        assert dyn.reflected_mass(q, "head", R @ stuck, point, frame=frame) == np.inf


@pytest.mark.parametrize("joints", [1, 3, 10, 30])
def test_reflected_mass_out_of_a_crooked_plane(joints):
    """∞ normal to the plane that a planar arm moves in, however many joints it has and however its frames are turned."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        normal, elements, at = rng.standard_normal(3), [link("link_0")], np.eye(3)
        for k in range(joints):
            rpy, xyz = rng.uniform(-3, 3, 3), at.T @ rng.uniform(-0.4, 0.4, 3)
            at = at @ rpyToMatrix(rpy)
            axis = at.T @ normal / norm(normal)
            elements.append(
                joint(f"joint_{k}", "revolute", f"link_{k}", f"link_{k + 1}", axis, xyz, rpy)
            )
            elements.append(link(f"link_{k + 1}", 1.0, (0.1, 0.05, 0), (0.01, 0, 0, 0.01, 0, 0.01)))
        dyn, point = (
            dd.DiagonalDynamics(dd.load_urdf(description("planar_arm", *elements))),
            rng.standard_normal(3),
        )
        q = rng.uniform(-2, 2, joints)
        assert dyn.reflected_mass(q, f"link_{joints}", normal, point, frame="world") == np.inf
        across = np.cross(normal, rng.standard_normal(3))
        assert dyn.reflected_mass(q, f"link_{joints}", across, point, frame="world") < 1e3
