# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulation against closed forms, a fine integration of Pinocchio's aba, and its own energy."""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics import simulation
from diag_dynamics.exceptions import InputError
from examples import shortened
from oracles import Oracle
from robots import description, joint, link, regular_robots, robot_path

PANDA = "panda_description/urdf/panda.urdf"
UR5 = "ur_description/urdf/ur5_robot.urdf"

# Their mass matrix is regular, but not everywhere: joints with axes in one point and massless links between them
# lose a direction (hip_X at 90°, neck at 0°), which a swinging robot reaches. A gram metre² of rotor is the cure.
GIMBALS = {"human_description/robots/human.urdf", "icub_description/robots/icub.urdf"}


def load(robot, **options):
    return dd.load_urdf(robot_path(robot), mimic="free", **options)


def random_state(model, seed, speed=1.0):
    rng = np.random.default_rng(seed)
    lower, upper = np.maximum(model.lower, -1.0), np.minimum(model.upper, 1.0)
    middle = np.where(lower < upper, 0.5 * (lower + upper), simulation.rest_position(model))
    span = np.where(lower < upper, upper - lower, 0.0)
    return middle + 0.4 * span * rng.uniform(-1, 1, model.nv), speed * rng.normal(size=model.nv)


def total_energy(sim):
    return 0.5 * sim.nu @ sim.nu + sim.potential_energy


# --- The method ---


def test_order_conditions():
    """Both tables, and every mixture of them, satisfy the conditions up to order 4."""
    A, B, b = simulation.EXPLICIT, simulation.IMPLICIT, simulation.WEIGHTS
    c = A.sum(axis=1)
    near = pytest.approx
    np.testing.assert_allclose(B.sum(axis=1), c, atol=1e-15)
    assert b.sum() == near(1) and b @ c == near(1 / 2) and b @ c**2 == near(1 / 3) and b @ c**3 == near(1 / 4)
    for X in (A, B):
        assert b @ X @ c == near(1 / 6)
        assert (b * c) @ X @ c == near(1 / 8)
        assert b @ X @ c**2 == near(1 / 12)
        for Y in (A, B):
            assert b @ X @ Y @ c == near(1 / 24)


def test_implicit_part_never_amplifies():
    """Its stability function lies within (-1, 1] on the negative axis and vanishes at its end."""
    B, b = simulation.IMPLICIT, simulation.WEIGHTS
    assert (B[-1] == b).all()

    def amplification(z):
        return np.linalg.solve(np.eye(6) - z * B, np.ones(6))[-1]  # the last stage is the result

    for z in -np.logspace(-3, 6, 200):
        assert abs(amplification(z)) < 1.0
    assert abs(amplification(-1e12)) < 1e-10


def reference(robot, q, qd, tau, damping, duration, h, **options):
    """Fixed steps of the classical Runge-Kutta method on Pinocchio's aba, far finer than what is tested."""
    oracle = Oracle(robot_path(robot).read_text(), **options)
    x = np.concatenate([q, qd])
    n = len(q)

    def f(x):
        return np.concatenate([x[n:], oracle.forward_dynamics(x[:n], x[n:], tau - damping * x[n:])])

    for _ in range(round(duration / h)):
        k1 = f(x)
        k2 = f(x + h / 2 * k1)
        k3 = f(x + h / 2 * k2)
        k4 = f(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x[:n], x[n:]


@pytest.mark.parametrize("order", [4, 1])
@pytest.mark.parametrize("damped", [False, True], ids=["undamped", "damped"])
@pytest.mark.parametrize("robot", [PANDA, UR5])
def test_converges_with_its_order(robot, damped, order):
    """The error against Pinocchio falls with the power of the step that the order says, over four step sizes."""
    model = load(robot)
    q, qd = random_state(model, 1, speed=0.5)
    tau = 0.1 * np.random.default_rng(2).normal(size=model.nv)
    # Damping that matters (a time constant of some tenths of a second), and that an explicit method could bear.
    damping = 3.0 * np.diag(dd.DiagonalDynamics(model).mass_matrix(q)) if damped else np.zeros(model.nv)
    duration = 0.4
    exact_q, exact_qd = reference(robot, q, qd, tau, damping, duration, 1e-4)
    steps = duration / np.array([50, 100, 200, 400])
    errors = []
    for h in steps:
        sim = dd.Simulation(model, q, qd, step=h, damping=damping, limits=False, order=order)
        sim.advance(tau, steps=round(duration / h))
        errors.append(np.linalg.norm(sim.q - exact_q) + np.linalg.norm(sim.qd - exact_qd))
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope > 0.93 * order, (slope, errors)
    assert errors[-1] < {4: 1e-6, 1: 0.25}[order], errors


def test_locked_joints():
    """They stay where they are, and weigh: the others move as those of Pinocchio's robot without them."""
    locked = {"panda_joint2": 0.4, "panda_joint5": -0.3, "panda_finger_joint1": 0.03, "panda_finger_joint2": 0.03}
    model = load(PANDA, locked_joints=locked)
    q, qd = random_state(model, 1, speed=0.5)
    tau, damping = 0.1 * np.random.default_rng(2).normal(size=model.nv), 0.2 * np.ones(model.nv)
    exact = reference(PANDA, q, qd, tau, damping, 0.2, 1e-4, locked_joints=locked, dof_names=model.dof_names)
    sim = dd.Simulation(model, q, qd, step=1e-3, damping=damping, friction=0.0 * damping, limits=False)
    sim.advance(tau, steps=200)
    np.testing.assert_allclose(np.concatenate([sim.q, sim.qd]), np.concatenate(exact), atol=1e-7)
    assert np.abs(exact[0] - q).max() > 0.05


@pytest.mark.parametrize("robot", [PANDA, UR5, "talos_data/robots/talos_reduced.urdf"])
def test_energy_without_damping_and_torque(robot):
    """Over 0.5 s of free swinging the drift is below 1e-6 of the energy exchanged, and falls as the method says."""
    model = load(robot)
    q, qd = random_state(model, 3, speed=0.1)
    drifts = []
    for h in (1e-3, 5e-4, 2.5e-4):
        zero = np.zeros(model.nv)
        sim = dd.Simulation(model, q, qd, step=h, damping=zero, friction=zero, limits=False)
        start, exchanged, drift = total_energy(sim), 0.0, 0.0
        for _ in range(10):
            sim.advance(steps=round(0.05 / h))
            exchanged = max(exchanged, 0.5 * sim.nu @ sim.nu)
            drift = max(drift, abs(total_energy(sim) - start))
        drifts.append(drift / exchanged)
    assert exchanged > 1e-2, "nothing moved"
    assert drifts[0] < 1e-6, drifts
    assert drifts[1] < drifts[0] / 10 and drifts[2] < drifts[1] / 10, drifts


def test_potential_energy():
    """Against Pinocchio, up to the constant of links that do not move."""
    model = load("talos_data/robots/talos_reduced.urdf")
    oracle = Oracle(robot_path("talos_data/robots/talos_reduced.urdf").read_text(), model.dof_names)
    rng = np.random.default_rng(4)
    ours, theirs = [], []
    for _ in range(3):
        q = rng.uniform(-1, 1, model.nv)
        ours.append(simulation.potential_energy(model, q))
        theirs.append(pin.computePotentialEnergy(oracle.model, oracle.data, oracle.configuration(q)))
    np.testing.assert_allclose(np.diff(ours), np.diff(theirs), rtol=1e-12)


# --- Damping and limits ---

PENDULUM = description(
    "pendulum",
    link("base"),
    link("bob", mass=1e-3, com=(0, 0, -0.1), inertia=(1e-7, 0, 0, 1e-7, 0, 1e-7)),
    joint("hinge", "revolute", "base", "bob", axis=(0, 1, 0)),
)


@pytest.mark.parametrize("order", [4, 1])
def test_heavy_damping_creeps(order):
    """With d/D near 10⁵ s⁻¹ a millisecond step still gives the speed τ/d: d θ' = −m g l sin θ has a closed form."""
    model = dd.load_urdf(PENDULUM)
    d, moment = 1.0, 1e-3 * 9.81 * 0.1
    D = dd.DiagonalDynamics(model).evaluate([0.0], [0.0]).articulated_inertia[0]
    assert d / D > 9e4
    sim = dd.Simulation(model, [2.0], [0.0], step=1e-3, damping=[d], order=order)
    sim.advance(steps=100_000)
    expected = 2.0 * np.arctan(np.tan(1.0) * np.exp(-moment / d * 100.0))
    assert sim.q[0] == pytest.approx(expected, rel={4: 1e-6, 1: 1e-5}[order])
    assert sim.qd[0] == pytest.approx(-moment / d * np.sin(sim.q[0]), rel=1e-3)


@pytest.mark.parametrize("order", [4, 1])
def test_damping_takes_energy(order):
    """Kinetic energy never rises under damping alone, however stiff."""
    model = load("allegro_hand_description/urdf/allegro_left_hand.urdf", gravity=(0, 0, 0))
    q, qd = random_state(model, 5, speed=3.0)
    assert model.damping.min() > 1.0
    sim = dd.Simulation(model, q, qd, order=order)
    last = 0.5 * sim.nu @ sim.nu
    assert last > 1e-4
    for _ in range(200):
        sim.advance()
        now = 0.5 * sim.nu @ sim.nu
        assert now <= last * (1 + 1e-12)
        last = now


@pytest.mark.parametrize("order", [4, 1])
def test_limits_hold_and_take_energy(order):
    """Thrown against its limits, a robot stays within them, and no stop adds energy."""
    model = load(PANDA, gravity=(0, 0, 0))
    q, qd = random_state(model, 6, speed=20.0)
    sim = dd.Simulation(model, q, qd, damping=np.zeros(model.nv), step={4: 1e-3, 1: 1e-5}[order], order=order)
    last, stops = 0.5 * sim.nu @ sim.nu, 0
    for _ in range(3000):
        sim.advance(steps={4: 1, 1: 100}[order])
        now = 0.5 * sim.nu @ sim.nu
        assert (sim.q >= model.lower).all() and (sim.q <= model.upper).all()
        assert now <= last * (1 + 1e-3)  # between stops the integrator's own error, at 20 rad/s
        stops += now < 0.99 * last
        last = now
    assert stops >= 3


@pytest.mark.parametrize("order", [4, 1])
def test_stopped_joint_rests(order):
    """A joint that gravity presses against its limit stays there without moving."""
    urdf = PENDULUM.replace('lower="-10"', 'lower="0.5"')
    sim = dd.Simulation(dd.load_urdf(urdf), [0.7], [0.0], order=order)
    sim.advance(steps=3000)
    assert sim.q[0] == 0.5
    assert sim.qd[0] == 0.0


def test_coupled_robot_at_order_1():
    """A step from rest is q̈ h, also of joints with followers."""
    model = dd.load_urdf(robot_path(PANDA))
    assert model.mimics
    q = random_state(model, 9)[0]
    sim = dd.Simulation(model, q, step=1e-4, damping=np.zeros(model.nv), order=1)
    sim.advance()
    expected = dd.DiagonalDynamics(model).forward_dynamics(q, np.zeros(model.nv), np.zeros(model.nv))
    np.testing.assert_allclose(sim.qd, 1e-4 * expected, rtol=1e-8)


# --- Whole robots ---


def run_for_long(robot):
    """Extremes of 8 s, or of 30, from a random state: energy against the start, how far a joint is beyond a limit."""
    model = load(robot, armature=1e-3 if robot in GIMBALS else 0.0)
    q, qd = random_state(model, 7, speed=0.5)
    sim = dd.Simulation(model, np.clip(q, model.lower, model.upper), qd)
    energies, kinetic = [total_energy(sim)], [0.5 * sim.nu @ sim.nu]
    for _ in range(shortened(60, 16)):
        sim.advance(steps=500)
        energies.append(total_energy(sim))
        kinetic.append(0.5 * sim.nu @ sim.nu)
        beyond = np.maximum(model.lower - sim.q, sim.q - model.upper).max()
        if not np.isfinite(energies[-1]) or beyond > 0.0:
            return np.inf, np.inf, beyond
    return max(energies) - energies[0], max(kinetic), beyond


@pytest.fixture(scope="module")
def extremes():
    with ThreadPoolExecutor(2) as pool:  # compiled code runs without the interpreter's lock
        return dict(zip(regular_robots(), pool.map(run_for_long, regular_robots()), strict=True))


@pytest.mark.parametrize("robot", regular_robots())
def test_energy_stays_bounded(robot, extremes):
    """Without effort no energy comes in: 8 s at 1 ms, or 30, stay below the start's energy, up to what stops round off."""
    rise, largest, beyond = extremes[robot]
    assert beyond <= 0.0
    assert rise <= 0.01 * largest + 1e-9


@pytest.mark.parametrize("order", [4, 1])
def test_deterministic(order):
    """The same start gives the same trajectory, bit for bit."""
    model = load(PANDA)
    ends = []
    for _ in range(2):
        sim = dd.Simulation(model, *random_state(model, 8), order=order)
        sim.advance(np.linspace(-1, 1, model.nv), steps=500)
        ends.append((sim.q.copy(), sim.nu.copy()))
    assert (ends[0][0] == ends[1][0]).all() and (ends[0][1] == ends[1][1]).all()


@pytest.mark.parametrize("robot", [PANDA, "allegro_hand_description/urdf/allegro_left_hand.urdf", UR5])
def test_wave_moves_within_limits(robot):
    """Driven along its waves a robot keeps moving, follows them and does not touch its limits."""
    model = load(robot)
    sim = dd.Simulation(model)
    wave = simulation.Wave(sim)
    low, high = sim.q.copy(), sim.q.copy()
    for _ in range(6000):
        sim.advance(wave.effort())
        low, high = np.minimum(low, sim.q), np.maximum(high, sim.q)
    assert (low > model.lower).all() and (high < model.upper).all()
    span = np.minimum(np.where(np.isfinite(model.upper - model.lower), model.upper - model.lower, 2.0), 2.0)
    assert ((high - low) > 0.2 * span).all()


# --- Wrong use ---


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"step": 0.0}, "step"),
        ({"step": np.nan}, "step"),
        ({"step": "fast"}, "step"),
        ({"order": 2}, "order is 2, expected 4 or 1"),
        ({"damping": [1.0]}, "damping"),
        ({"damping": [-1.0] * 9}, "damping"),
        ({"q": [0.0] * 8}, "q has shape"),
        ({"qd": [np.nan] * 9}, "panda_joint1"),
    ],
)
def test_bad_start(options, named):
    with pytest.raises(InputError, match=named):
        dd.Simulation(load(PANDA), **options)


@pytest.mark.parametrize("tau", [[0.0], [np.nan] * 9, [[0.0] * 9], "abc"])
def test_bad_effort(tau):
    sim = dd.Simulation(load(PANDA))
    before = sim.q.copy()
    with pytest.raises(InputError, match="tau"):
        sim.advance(tau)
    assert (sim.q == before).all()


@pytest.mark.parametrize("order", [4, 1])
def test_overflow_leaves_the_state_before(order):
    model = dd.load_urdf(PENDULUM)
    sim = dd.Simulation(model, [0.5], [0.1], step=100.0, damping=[0.0], limits=False, order=order, effort_limits=False)
    with pytest.raises(InputError):
        sim.advance([1e307])
    assert sim.q[0] == 0.5 and sim.time == 0.0
    assert sim.qd[0] == pytest.approx(0.1, rel=1e-12)


def test_damping_in_force_is_checked():
    sim = dd.Simulation(load(PANDA))
    for value in (np.zeros(1), -np.ones(9), [np.nan] * 9):
        with pytest.raises(InputError, match="damping is"):
            sim.damping = value
    sim.damping = [0.5] * 9
    sim.damping[:] = -1.0  # a copy
    assert (sim.damping == 0.5).all()


@pytest.mark.parametrize("steps", [2.7, -5, "3", 2**70])
def test_bad_steps(steps):
    sim = dd.Simulation(load(PANDA))
    with pytest.raises(InputError, match="steps"):
        sim.advance(steps=steps)
    assert sim.time == 0.0


def test_state_is_the_simulations_own():
    """What is handed out is a copy, so that nothing of the wrong size gets into compiled code."""
    sim = dd.Simulation(load(PANDA))
    sim.q[:] = 7.0
    assert (sim.q != 7.0).all()
    with pytest.raises(AttributeError):
        sim.q = np.zeros(2)
    with pytest.raises(InputError, match="q is"):
        simulation.potential_energy(sim.model, np.zeros(2))


@pytest.mark.parametrize(
    "copied",
    [copy.copy, copy.deepcopy, lambda sim: pickle.loads(pickle.dumps(sim))],
    ids=["shallow copy", "copy", "pickle"],
)
@pytest.mark.parametrize("order", [4, 1])
def test_a_copy_goes_its_own_way(order, copied):
    """A copy has arrays of its own, goes on with the same bits, and leaves the original where it is."""
    sim = dd.Simulation(load(PANDA), friction=0.1 * np.ones(9), order=order)
    sim.advance(np.ones(9), steps=5)
    before, other = (sim.q, sim.qd, sim.nu, sim.time, sim.audit), copied(sim)
    other.advance(np.ones(9), steps=5)
    for now, then in zip((sim.q, sim.qd, sim.nu, sim.time, sim.audit), before, strict=True):
        assert np.array_equal(now, then)
    assert (other.q != sim.q).any()
    sim.advance(np.ones(9), steps=5)
    assert sim.q.tobytes() == other.q.tobytes()
    assert sim.nu.tobytes() == other.nu.tobytes()
    assert sim.audit == other.audit


@pytest.mark.parametrize("order", [4, 1])
def test_singular_on_the_way(order):
    """Where the mass matrix becomes singular the simulation says so, and keeps the last good state.

    A gimbal of massless rings loses its first axis as the second one arrives at its limit of a right angle.
    """
    gimbal = description(
        "gimbal",
        *(link(name) for name in ("base", "outer", "inner")),
        link("rotor", mass=1.0, inertia=(0.1, 0, 0, 0.2, 0, 0.25)),
        joint("z", "revolute", "base", "outer", axis=(0, 0, 1)),
        joint("x", "revolute", "outer", "inner", axis=(1, 0, 0)).replace('upper="10"', f'upper="{np.pi / 2}"'),
        joint("y", "revolute", "inner", "rotor", axis=(0, 1, 0)),
    )
    sim = dd.Simulation(dd.load_urdf(gimbal), [0.0, 1.0, 0.0], [0.0, 2.0, 0.0], order=order)
    with pytest.raises(dd.SingularMassMatrixError, match="joint 'z' moves no inertia there") as raised:
        sim.advance(steps=1000)
    assert raised.value.articulated_inertia < 1e-6
    assert np.pi / 2 - 0.01 < sim.q[1] < np.pi / 2
    np.testing.assert_allclose(sim.qd, [0.0, 2.0, 0.0], atol=1e-9)
