# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces on a simulated robot: friction, limits, efforts, wrenches, payloads; and the energy that each transfers."""

from itertools import pairwise, product

import numpy as np
import pytest

import diag_dynamics as dd
from examples import shortened, some_of
from oracles import Oracle
from robots import description, joint, link, robot_path

PANDA = "panda_description/urdf/panda.urdf"
UR5 = "ur_description/urdf/ur5_robot.urdf"
HAND = "allegro_hand_description/urdf/allegro_left_hand.urdf"
TALOS = "talos_data/robots/talos_reduced.urdf"
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
ORDERS = pytest.mark.parametrize("order", [4, 1])


SLIDER = description(
    "slider",
    link("base"),
    link("block", mass=2.0, inertia=(0.1, 0, 0, 0.1, 0, 0.1)),
    joint("rail", "prismatic", "base", "block", axis=(1, 0, 0)),
)
"""A mass on a level rail: every motion of it has a closed form."""

CHAIN = description(
    "chain",
    link("base"),
    link("upper", mass=1.0, com=(0.3, 0, 0), inertia=(0.01, 0, 0, 0.02, 0, 0.02)),
    link("lower", mass=0.7, com=(0.2, 0, 0.05), inertia=(0.01, 0, 0, 0.02, 0, 0.02)),
    joint("shoulder", "revolute", "base", "upper", axis=(0, 1, 0)),
    joint("elbow", "revolute", "upper", "lower", axis=(0, 1, 0), xyz=(0.5, 0, 0)),
)


def slider(x=0.0, v=0.0, **options):
    return dd.Simulation(dd.load_urdf(SLIDER), [x], [v], damping=[0.0], **options)


def load(robot, **options):
    return dd.load_urdf(robot_path(robot), **options)


# --- Friction ---


@ORDERS
def test_sliding_stops_where_it_should(order):
    """v²/2 = (f/m) x, and then it stays, exactly; at order 4 the stop is found in the midst of a step."""
    sim = slider(v=1.0, friction=[3.0], order=order, step=1.1e-2)
    sim.advance(steps=200)
    assert sim.qd[0] == 0.0
    assert sim.q[0] == pytest.approx(0.5 * 1.0**2 / 1.5, rel={4: 1e-8, 1: 2e-2}[order])
    assert sim.audit.friction == pytest.approx(-1.0, rel={4: 1e-8, 1: 2e-2}[order])
    rest = sim.q[0]
    sim.advance([2.999], steps=1000)
    assert sim.q[0] == rest and sim.qd[0] == 0.0, "sticks below the breakaway force"
    sim.advance([3.5], steps=100)
    assert sim.q[0] - rest == pytest.approx(0.5 * 0.25 * 1.1**2, rel={4: 1e-8, 1: 2e-2}[order])


def test_order_with_friction():
    """With joints that stop, stick and break away, two that are coupled converge with order 4 all the same.

    The reference is steps so fine that an error of order 1 in any of these instants would show.
    """
    model = dd.load_urdf(CHAIN)

    def end(h):
        sim = dd.Simulation(model, [0.3, 0.4], [2.0, -3.0], step=h, friction=[0.8, 0.9], damping=[0.1, 0.0])
        modes = set()
        for k in range(round(1.2 / h)):
            sim.advance([1.0, 2.5 * (k >= round(0.6 / h))])
            modes.add(tuple(np.sign(sim.qd)))
        return np.concatenate([sim.q, sim.qd]), modes

    exact, modes = end(5e-4)
    assert any(0.0 in mode for mode in modes) and len(modes) >= 4, modes
    errors = [np.abs(end(h)[0] - exact).max() for h in (1e-2, 5e-3, 2.5e-3)]
    assert errors[-1] < 1e-6 and errors[1] < errors[0] / 8 and errors[2] < errors[1] / 8, errors


@ORDERS
def test_friction_never_adds_energy(order):
    """Friction takes energy in every step, however coarse; joints that it stops do not move backwards."""
    model, friction, rng = dd.load_urdf(CHAIN), np.full(2, 1.5), np.random.default_rng(4)
    sim = dd.Simulation(model, order=order, step=5e-3, friction=friction, limits=False)
    stopped, last = 0, 0.0
    for k in range(400):
        if k % 10 == 0:
            tau = 3.0 * friction * rng.uniform(-1.0, 1.0, model.nv)
        q, qd = sim.q, sim.qd
        sim.advance(tau)
        assert sim.audit.friction <= last + 1e-12 * abs(last)
        last = sim.audit.friction
        ends = (qd != 0.0) & (sim.qd == 0.0)
        stopped += ends.sum()
        assert order == 4 or ((sim.q - q)[ends] == 0.0).all()
    assert stopped > 3 and abs(sim.audit.residual) < {4: 1e-8, 1: 1e-2}[order] * abs(last)


@ORDERS
@pytest.mark.parametrize("robot", [UR5, TALOS])
def test_brakes(robot, order):
    """Brakes of any strength stop joints where they are, and take no more than their energy."""
    model = load(robot, floating_base=robot == TALOS)
    own = slice(6 if robot == TALOS else 0, None)  # nothing brakes a base
    rng, friction = np.random.default_rng(7), np.zeros(model.nv)
    for strength in np.repeat([30.0, 1e5, 1e7, 1e100], 5):
        q, qd = model.neutral, rng.normal(size=model.nv)
        q[-len(qd[own]) :] = rng.uniform(*np.clip([model.lower, model.upper], -1.0, 1.0))[-len(qd[own]) :]
        friction[own] = strength
        options = {"damping": np.zeros(model.nv), "friction": friction, "effort_limits": False}
        sim = dd.Simulation(model, q, qd, order=order, **options)
        energy, q = sim.kinetic_energy, sim.q
        sim.advance()
        assert np.abs(sim.q - q).max() < 2e-3 * np.abs(qd).max()
        assert sim.audit.kinetic + sim.audit.potential < 0.0 and sim.audit.friction < 0.0
        assert abs(sim.audit.residual) < {4: 2e-2, 1: 5e-2}[order] * energy
        assert strength < 1e7 or not sim.qd[own].any()


# --- Limits ---


@ORDERS
def test_hard_limit_keeps_its_place(order):
    """An arm that falls on its stop stays there; energy is lost at impacts only."""
    sim = dd.Simulation(dd.load_urdf(CHAIN.replace('upper="10"', 'upper="1.0"', 1)), order=order)
    energies = []
    for _ in range(1500):
        sim.advance()
        audit = sim.audit
        energies.append(audit.kinetic + audit.potential)
    assert sim.q[0] == 1.0 and sim.qd[0] == 0.0 and sim.at_limit == ("shoulder",)
    assert sim.audit.limits < -0.1
    if order == 4:  # impacts are found, so energy is lost there and nowhere else
        assert max(np.diff(energies)) < 1e-9 and abs(sim.audit.residual) < 1e-8


@pytest.mark.parametrize(("stiffness", "damping"), list(some_of(product([1e2, 1e5, 1e9, 1e13], [0.0, 1.0, 1e6]), 4)))
@ORDERS
def test_compliant_limit_never_adds_energy(order, damping, stiffness):
    """However stiff, whatever the part of a step in which it is met: a block comes back no faster than it went."""
    for x in (9.9, 9.90013, 9.9007):
        sim = slider(x, 1.0, order=order, limits=dd.CompliantLimits(stiffness, damping))
        for _ in range(700):
            sim.advance()
            audit = sim.audit
            assert audit.kinetic <= 1e-9 and audit.kinetic + audit.elastic <= 1e-9
            assert audit.limits <= 1e-9
        if order == 4 and damping == 0.0 and stiffness == 1e2:
            assert sim.qd[0] == pytest.approx(-1.0, rel=1e-6), "a spring that the step resolves gives all back"


def test_compliant_limit_converges():
    """In contact a spring and damper of a coupled arm are integrated with order 4: the residual and the end say so."""
    model = dd.load_urdf(CHAIN.replace('upper="10"', 'upper="0.6"', 1))

    def run(h):
        sim = dd.Simulation(model, step=h, limits=dd.CompliantLimits(800.0, 3.0), damping=[0.02, 0.03])
        sim.advance(steps=round(0.8 / h))
        return np.concatenate([sim.q, sim.qd]), abs(sim.audit.residual), sim.audit

    exact, _, audit = run(1e-4)
    assert audit.limits < -0.05, "never touched"
    runs = [run(h) for h in (4e-3, 2e-3, 1e-3)]
    for errors in ([np.abs(end - exact).max() for end, _, _ in runs], [residual for _, residual, _ in runs]):
        assert errors[-1] < 1e-6 and errors[0] > 8 * errors[1] > 50 * errors[2], errors


# --- Efforts, wrenches, payloads ---


def test_efforts_saturate():
    """An effort beyond the limit is cut to it, and its joint is named."""
    sims = [slider(effort_limits=limits) for limits in (True, [100.0], False, [7.0])]
    for sim in sims:
        sim.advance([-150.0], steps=10)
    assert sims[0].saturated == sims[1].saturated == ("rail",) and sims[2].saturated == ()
    assert [sim.effort[0] for sim in sims] == [-100.0, -100.0, -150.0, -7.0]
    np.testing.assert_allclose([sim.qd[0] for sim in sims], np.array([-100, -100, -150, -7]) / 2 * 0.01, rtol=1e-12)
    unlimited = dd.Simulation(dd.load_urdf(SLIDER.replace('effort="100"', 'effort="0"')))
    unlimited.advance([1.0])
    assert unlimited.qd[0] > 0.0 and unlimited.saturated == () and unlimited.overspeed == ()
    unlimited.reset([0.0], [101.0])
    assert unlimited.overspeed == ("rail",)


@ORDERS
@pytest.mark.parametrize("frame", ["link", "world"])
def test_wrenches_are_efforts_of_their_jacobian(frame, order):
    """A step with a wrench is one with Jᵀf, that of Pinocchio; held in the world's axes it does not turn with the link."""
    model = load(UR5)
    q, qd = 0.3 * np.arange(1, 7), 0.1 * np.ones(6)
    f_ext = {"wrist_3_link": [3.0, -4.0, 5.0, 0.1, 0.2, -0.3], "forearm_link": [0, 0, 2.0, 0, 0, 0]}
    jacobian = Oracle(robot_path(UR5).read_text(), model.dof_names).effort_of(q, f_ext, frame)
    sims = [dd.Simulation(model, q, qd, step=1e-6, order=order, effort_limits=False) for _ in range(2)]
    sims[0].advance(f_ext=f_ext, frame=frame)
    sims[1].advance(jacobian)
    np.testing.assert_allclose(sims[0].qd, sims[1].qd, rtol=0, atol=1e-9)
    assert np.abs(sims[0].qd - qd).max() > 1e-5


def test_payload_taken_up_in_motion():
    """q and q̇ stay; the payload brings its energy at that speed and height, and the audit has it."""
    model = load(PANDA)
    sim = dd.Simulation(model, qd=0.2 * np.ones(model.nv))
    sim.advance(steps=100)
    q, qd, before = sim.q, sim.qd, sim.audit
    loaded = model.with_payload("panda_hand", 1.5, (0, 0, 0.1))
    sim.change_model(loaded)
    assert (sim.q == q).all() and (sim.qd == qd).all()
    s = dd.DiagonalDynamics(loaded).evaluate(q, qd)
    assert sim.kinetic_energy == pytest.approx(s.kinetic_energy, rel=1e-12)
    assert sim.audit.exchanged == pytest.approx(
        sim.audit.kinetic - before.kinetic + sim.audit.potential - before.potential
    )
    assert abs(sim.audit.exchanged) > 1e-3 and sim.audit.residual == pytest.approx(before.residual, abs=1e-12)
    sim.advance(steps=100)
    assert abs(sim.audit.residual) < 1e-8


# --- The audit ---


def driven(sim, seconds, largest, period=0.05, seed=1):
    """Advance a robot with random efforts, and a push on its last link; return audits in between."""
    model, rng = sim.model, np.random.default_rng(seed)
    scale = np.full(model.nv, largest)
    if model.floating_base:
        scale[:6] = 0.0
    link_name = model.link_names[-1]
    audits = [sim.audit]
    for _ in range(round(seconds / period)):
        push = {link_name: 0.5 * rng.normal(size=6)}
        sim.advance(scale * rng.uniform(-1, 1, model.nv), round(period / sim.step_size), push, "world")
        audits.append(sim.audit)
    return audits


ROBOTS = {
    "panda with its mimic gripper": (PANDA, {}),
    "ur5": (UR5, {}),
    "allegro hand": (HAND, {}),
    "talos, flying": (TALOS, {"floating_base": True}),
}


@pytest.mark.parametrize(
    ("limits", "seconds"), [("hard", shortened(120.0, 8.0)), ("compliant", 1.0)], ids=["hard", "compliant"]
)
@pytest.mark.parametrize("name", ROBOTS)
def test_energy_is_accounted_for(name, limits, seconds):
    """The audit's residual is small; friction, dampers and stops only take energy."""
    robot, options = ROBOTS[name]
    model = load(robot, **options)
    own = {}
    if robot == HAND:  # by its own friction it never moves; its own damping, 10⁵ s⁻¹, no step of a millisecond resolves
        own = {"friction": np.full(model.nv, 0.02), "damping": 1e-4 * model.damping}
    if robot == TALOS:
        own, seconds = {"step": 2e-3}, min(seconds, shortened(10.0, 3.0))
    D = dd.DiagonalDynamics(model).evaluate(model.neutral, np.zeros(model.nv)).articulated_inertia
    soft = dd.CompliantLimits(60.0**2 * D, 60.0 * D)  # 60 rad/s: what a step of a millisecond resolves
    sim = dd.Simulation(model, limits=soft if limits == "compliant" else True, **own)
    audits = driven(sim, seconds, 0.02 if robot == HAND else 1.5)  # [N m]
    steps = [y.since(x) for x, y in pairwise(audits)]
    turnover = sum(abs(a.effort) + abs(a.wrenches) + abs(a.kinetic) for a in steps)
    assert turnover > 1e-3
    assert abs(audits[-1].residual) < 1e-4 * turnover
    for step in steps:
        assert step.damping <= 0.0 and step.friction <= 0.0
        assert step.limits <= 1e-9 * turnover
