# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulation of joints of several degrees of freedom and floating bases, against fine integrations by Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from oracles import Oracle
from robots import description, link, random_robots, robot_path

SOLO = "solo_description/robots/solo12.urdf"
TALOS = "talos_data/robots/talos_reduced.urdf"
MOBILE = {robot.id: robot for robot in random_robots() if robot.id.startswith("mobile")}

BRICK = description(
    "brick", link("brick", mass=2.0, com=(0.1, -0.05, 0.2), inertia=(0.02, 0.003, 0, 0.05, 0.004, 0.06))
)
"""A rigid body with three different moments of inertia, whose origin is not its centre of mass."""


def start(model, seed, speed=1.0):
    """A state off every symmetry."""
    rng = np.random.default_rng(seed)
    q = model.neutral + 0.4 * rng.uniform(-1, 1, model.nq)
    for k, component in enumerate(model.orientations):
        if component == 3:
            q[k - 3 : k + 1] /= np.linalg.norm(q[k - 3 : k + 1])
    return q, speed * rng.normal(size=model.nv)


def reference(oracle, q, qd, effort, duration, h, more=lambda x, v: 0.0):
    """Runge-Kutta-Munthe-Kaas steps on Pinocchio's aba and integrate; its charts' rates by differences of pin.difference.

    `more` gives efforts that depend on configuration and velocity, all in Pinocchio's order. The chart is Pinocchio's own, so
    neither the exponential nor its differential is ours.
    """
    model, data = oracle.model, oracle.data
    x, v = oracle.configuration(q), oracle.to_pin(qd)

    def chart_rate(x, u, v):
        at, d = pin.integrate(model, x, u), 1e-4
        ends = (pin.difference(model, x, pin.integrate(model, at, s * d * v)) for s in (1, -1, 2, -2))
        f, b, ff, bb = ends
        return (8 * (f - b) - (ff - bb)) / (12 * d)

    def rates(u, v):
        at = pin.integrate(model, x, u)
        return chart_rate(x, u, v), pin.aba(model, data, at, v, oracle.to_pin(effort) + more(at, v))

    for _ in range(round(duration / h)):
        u1, a1 = rates(np.zeros(model.nv), v)
        u2, a2 = rates(h / 2 * u1, v + h / 2 * a1)
        u3, a3 = rates(h / 2 * u2, v + h / 2 * a2)
        u4, a4 = rates(h * u3, v + h * a3)
        x = pin.integrate(model, x, h / 6 * (u1 + 2 * u2 + 2 * u3 + u4))
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x, oracle.from_pin(v)


def distance(oracle, sim, x, qd):
    """From the simulation's state to the reference's."""
    apart = pin.difference(oracle.model, oracle.configuration(sim.q), x)
    return np.linalg.norm(apart) + np.linalg.norm(sim.qd - qd)


CASES = {
    "brick": (BRICK, True),
    "solo12": (robot_path(SOLO), True),
    "mobile_tree_20": (MOBILE["mobile_tree_20"].source, False),
    "mobile_tree_21+floating": (MOBILE["mobile_tree_21"].source, True),
}


@pytest.fixture(scope="module", params=CASES)
def motion(request):
    """A model, a state, an effort, and where Pinocchio says that it goes in 0.2 s."""
    source, floating = CASES[request.param]
    model = dd.load_urdf(source, floating_base=floating)
    text = source if isinstance(source, str) else source.read_text()
    oracle = Oracle(text, model.dof_names, floating_base=floating)
    q, qd = start(model, 1, speed=2.0 if request.param == "brick" else 0.5)
    tau = 0.01 * np.random.default_rng(2).normal(size=model.nv)
    return model, oracle, q, qd, tau, reference(oracle, q, qd, tau, 0.2, 1e-3)


@pytest.mark.parametrize("order", [4, 1])
def test_converges_with_its_order(motion, order):
    """The error against Pinocchio falls with the power of the step that the order says, the base's pose included."""
    model, oracle, q, qd, tau, end = motion
    steps, errors, zero = 0.2 / np.array([10, 20, 40, 80]), [], np.zeros(model.nv)
    for h in steps:
        sim = dd.Simulation(model, q, qd, step=h, damping=zero, friction=zero, limits=False, order=order)
        sim.advance(tau, steps=round(0.2 / h))
        errors.append(distance(oracle, sim, *end))
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope > 0.9 * order, (slope, errors)
    assert errors[-1] < {4: 1e-5, 1: 0.5}[order], errors
    lengths = [np.linalg.norm(sim.q[k - 3 : k + 1]) for k, c in enumerate(model.orientations) if c == 3]
    np.testing.assert_allclose(lengths, 1.0, atol=4e-16)


def momentum_in_world(oracle, q, qd):
    """Linear and angular momentum about the world's origin."""
    x, v = oracle.configuration(q), oracle.to_pin(qd)
    pin.computeCentroidalMomentum(oracle.model, oracle.data, x, v)
    h = oracle.data.hg
    return np.concatenate([h.linear, h.angular + np.cross(oracle.data.com[0], h.linear)])


@pytest.mark.parametrize("robot", ["brick", SOLO])
def test_tumbling_conserves_energy_and_momentum(robot):
    """A free body keeps both, to the order of the method, and its quaternion the unit length."""
    source = BRICK if robot == "brick" else robot_path(robot)
    model = dd.load_urdf(source, floating_base=True, gravity=(0, 0, 0))
    oracle = Oracle(BRICK if robot == "brick" else source.read_text(), model.dof_names, (0, 0, 0), floating_base=True)
    q, qd = start(model, 3, speed=3.0)
    energies, momenta = [], []
    for h in (8e-3, 4e-3, 2e-3):
        zero = np.zeros(model.nv)
        sim = dd.Simulation(model, q, qd, step=h, damping=zero, friction=zero, limits=False)
        first = momentum_in_world(oracle, sim.q, sim.qd)
        sim.advance(steps=round(0.8 / h))
        energies.append(abs(sim.audit.residual) / sim.kinetic_energy)
        momenta.append(np.linalg.norm(momentum_in_world(oracle, sim.q, sim.qd) - first) / np.linalg.norm(first))
        assert abs(np.linalg.norm(sim.q[3:7]) - 1.0) < 4e-16
    for errors in (energies, momenta):
        assert errors[-1] < 1e-6, errors
        assert errors[1] < errors[0] / 10 and errors[2] < errors[1] / 10, errors


def test_turns_without_wobble():
    """About a principal axis a body turns at a constant rate: positions have a closed form, over many turns."""
    model = dd.load_urdf(
        description("top", link("top", mass=1.0, inertia=(0.1, 0, 0, 0.2, 0, 0.3))),
        floating_base=True,
        gravity=(0, 0, 0),
    )
    for order in (4, 1):
        sim = dd.Simulation(model, qd=[0.3, 0, 0, 0, 0, 7.0], order=order)
        sim.advance(steps=10_000)
        half = 0.5 * 7.0 * 10.0
        expected = np.array([0, 0, np.sin(half), np.cos(half)])
        assert abs(abs(sim.q[3:7] @ expected) - 1.0) < 1e-12
        np.testing.assert_allclose(sim.qd[3:], [0, 0, 7.0], atol=1e-12)
        if order == 4:  # the centre of mass goes straight on
            np.testing.assert_allclose(sim.q[:3], [3.0, 0, 0], atol=1e-6)


def test_falls_freely():
    """The centre of mass falls by ½gt² while the body tumbles, whatever its origin does."""
    model = dd.load_urdf(BRICK, floating_base=True)
    oracle = Oracle(BRICK, model.dof_names, floating_base=True)
    q, qd = start(model, 4)

    def centre(q, qd):
        x = pin.centerOfMass(oracle.model, oracle.data, oracle.configuration(q), oracle.to_pin(qd))
        return x.copy(), oracle.data.vcom[0].copy()

    x, v = centre(q, qd)
    sim = dd.Simulation(model, q, qd)
    sim.advance(steps=1000)
    np.testing.assert_allclose(centre(sim.q, sim.qd)[0], x + v + [0, 0, -0.5 * 9.81], atol=1e-8)


def test_a_gripper_with_mimics_on_a_floating_base():
    """Coupled joints of a robot whose base floats: energy and momentum stay."""
    path = robot_path("panda_description/urdf/panda.urdf")
    model = dd.load_urdf(path, floating_base=True, gravity=(0, 0, 0))
    assert model.mimics and model.nq == model.nv + 1
    q, qd = start(model, 5, speed=0.3)
    zero, drifts = np.zeros(model.nv), []
    for h in (2e-3, 1e-3):
        sim = dd.Simulation(model, q, qd, step=h, damping=zero, friction=zero, limits=False)
        sim.advance(steps=round(0.4 / h))
        drifts.append(abs(sim.audit.residual) / sim.kinetic_energy)
    assert drifts[0] < 1e-6 and drifts[1] < max(drifts[0] / 10, 1e-13), drifts


def test_no_orientation_is_refused():
    model = dd.load_urdf(BRICK, floating_base=True)
    sim = dd.Simulation(model)
    with pytest.raises(dd.InputError, match="quaternion"):
        sim.reset(np.zeros(7), np.zeros(6))
    assert sim.q[6] == 1.0
    with pytest.raises(dd.InputError, match=r"q has shape \(6,\)"):
        sim.reset(np.zeros(6), np.zeros(6))
    sim.reset([0, 0, 0, 0, 0, 0, 1.0004], np.zeros(6))
    assert sim.q[6] == 1.0
