# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulation's method: order, closed forms, conserved quantities, long runs; against Pinocchio's aba."""

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics import simulation
from diag_dynamics.exceptions import InputError
from engines import distance, reference, start
from examples import shortened, some_of
from oracles import Oracle
from robots import description, joint, link, random_robots, regular_robots, robot_path

PANDA = "panda_description/urdf/panda.urdf"
UR5 = "ur_description/urdf/ur5_robot.urdf"
TALOS = "talos_data/robots/talos_reduced.urdf"
SOLO = "solo_description/robots/solo12.urdf"
HAND = "allegro_hand_description/urdf/allegro_left_hand.urdf"
MOBILE = {robot.id: robot.urdf for robot in random_robots() if robot.id.startswith("mobile")}
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
ORDERS = pytest.mark.parametrize("order", [4, 1])

# Their mass matrix is regular, but not everywhere: joints with axes in one point and massless links between them
# lose a direction (hip_X at 90°, neck at 0°), which a swinging robot reaches. A gram metre² of rotor is the cure.
GIMBALS = {"human_description/robots/human.urdf", "icub_description/robots/icub.urdf"}

BRICK = description(
    "brick", link("brick", mass=2.0, com=(0.1, -0.05, 0.2), inertia=(0.02, 0.003, 0, 0.05, 0.004, 0.06))
)
"""A rigid body with three different moments of inertia, whose origin is not its centre of mass."""

PENDULUM = description(
    "pendulum",
    link("base"),
    link("bob", mass=1e-3, com=(0, 0, -0.1), inertia=(1e-7, 0, 0, 1e-7, 0, 1e-7)),
    joint("hinge", "revolute", "base", "bob", axis=(0, 1, 0)),
)


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


LOCKED = {"panda_joint2": 0.4, "panda_joint5": -0.3, "panda_finger_joint1": 0.03, "panda_finger_joint2": 0.03}
CASES = {
    "panda, damped": (robot_path(PANDA).read_text(), {}, 3.0),
    "panda, locked joints": (robot_path(PANDA).read_text(), {"locked_joints": LOCKED}, 0.0),
    "ur5": (robot_path(UR5).read_text(), {}, 0.0),
    "brick": (BRICK, {"floating_base": True}, 0.0),
    "solo12": (robot_path(SOLO).read_text(), {"floating_base": True}, 0.0),
    "mobile_tree_20": (MOBILE["mobile_tree_20"], {}, 0.0),
    "mobile_tree_21+floating": (MOBILE["mobile_tree_21"], {"floating_base": True}, 0.0),
}
"""URDF, options, and damping in units of the mass matrix's diagonal."""


@pytest.fixture(scope="module", params=CASES)
def motion(request):
    """Return a model, its oracle, a state, an effort, damping, and where Pinocchio says that it is after 0.2 s."""
    urdf, options, share = CASES[request.param]
    model = dd.load_urdf(urdf, mimic="free", **options)
    oracle = Oracle(urdf, model.dof_names, **options)
    q, qd = start(model, 1, speed=2.0 if request.param == "brick" else 0.5)
    tau = 0.01 * np.random.default_rng(2).normal(size=model.nv)
    damping = share * np.diag(dd.DiagonalDynamics(model).mass_matrix(q))
    d = oracle.to_pin(damping)
    return model, oracle, q, qd, tau, damping, reference(oracle, q, qd, tau, 0.2, 1e-3, lambda _, v: -d * v)


@ORDERS
def test_converges_with_its_order(motion, order):
    """The error against Pinocchio falls with the power of the step that the order says, the base's pose included."""
    model, oracle, q, qd, tau, damping, end = motion
    steps, errors = 0.2 / np.array([10, 20, 40, 80]), []
    for h in steps:
        sim = dd.Simulation(model, q, qd, step=h, damping=damping, friction=0.0 * damping, limits=False, order=order)
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


FREE = {"floating_base": True, "gravity": (0, 0, 0)}


@pytest.mark.parametrize(
    ("urdf", "options", "speed", "coarsest"),
    [
        (BRICK, FREE, 3.0, 8e-3),
        (robot_path(SOLO).read_text(), FREE, 3.0, 8e-3),
        (robot_path(PANDA).read_text(), {}, 0.1, 2e-3),  # with a coupled gripper
    ],
    ids=["brick", "solo12", "panda"],
)
def test_energy_and_momentum_are_conserved(urdf, options, speed, coarsest):
    """A free robot keeps both, an arm in gravity its energy, to the order of the method."""
    model = dd.load_urdf(urdf, **options)
    oracle = Oracle(urdf, model.dof_names, (0, 0, 0), floating_base=True) if options else None
    q, qd = start(model, 3, speed=speed)
    energies, momenta, zero = [], [], np.zeros(model.nv)
    for h in coarsest / np.array([1, 2, 4]):
        sim = dd.Simulation(model, q, qd, step=h, damping=zero, friction=zero, limits=False)
        first = momentum_in_world(oracle, sim.q, sim.qd) if oracle else 0.0
        sim.advance(steps=round(0.8 / h))
        energies.append(abs(sim.audit.residual) / sim.kinetic_energy)
        if oracle:
            change = momentum_in_world(oracle, sim.q, sim.qd) - first
            momenta.append(np.linalg.norm(change) / np.linalg.norm(first))
            assert abs(np.linalg.norm(sim.q[3:7]) - 1.0) < 4e-16
    for errors in (energies, momenta) if momenta else (energies,):
        assert errors[-1] < 1e-6, errors
        assert errors[1] < errors[0] / 10 and errors[2] < errors[1] / 10, errors


@ORDERS
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


@pytest.mark.parametrize("robot", list(some_of(regular_robots(), 8)))
def test_energy_stays_bounded(robot):
    """Without effort the energy stays below the start's, up to rounding at stops: 4 s at 1 ms, or 30 of every robot."""
    model = load(robot, armature=1e-3 if robot in GIMBALS else 0.0)
    q, qd = random_state(model, 7, speed=0.5)
    sim = dd.Simulation(model, np.clip(q, model.lower, model.upper), qd)
    energies, kinetic = [total_energy(sim)], [sim.kinetic_energy]
    for _ in range(shortened(60, 8)):
        sim.advance(steps=500)
        energies.append(total_energy(sim))
        kinetic.append(sim.kinetic_energy)
        assert (sim.q >= model.lower).all() and (sim.q <= model.upper).all()
    assert max(energies) - energies[0] <= 0.01 * max(kinetic) + 1e-9


def test_wave_moves_within_limits():
    model = load(PANDA)
    sim = dd.Simulation(model)
    wave = simulation.Wave(sim)
    low, high = sim.q.copy(), sim.q.copy()
    for _ in range(6000):
        sim.advance(wave.effort())
        low, high = np.minimum(low, sim.q), np.maximum(high, sim.q)
    assert (low > model.lower).all() and (high < model.upper).all()
    assert ((high - low) > 0.2 * np.minimum(model.upper - model.lower, 2.0)).all()


# --- Input errors ---


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"step": 0.0}, "step"),
        ({"step": np.nan}, "step"),
        ({"order": 2}, "order is 2"),
        ({"damping": [1.0]}, "damping"),
        ({"damping": [-1.0] * 9}, "damping"),
        ({"q": [0.0] * 8}, "q has shape"),
        ({"qd": [np.nan] * 9}, "panda_joint1"),
        ({"friction": [-1.0] * 9}, "friction is"),
        ({"effort_limits": [-1.0] * 9}, "effort_limits is"),
        ({"effort_limits": "none"}, "effort_limits is"),
        ({"limits": "soft"}, "limits is 'soft'"),
        ({"limits": dd.CompliantLimits(0.0)}, "stiffness of limits is 0.0"),
        ({"limits": dd.CompliantLimits(1.0, -1.0)}, "damping of limits is -1.0"),
        ({"limits": dd.CompliantLimits([1.0, 2.0])}, "stiffness of limits"),
    ],
)
def test_bad_options(options, key):
    with pytest.raises(InputError, match=key):
        dd.Simulation(load(PANDA), **options)


@pytest.mark.parametrize(
    ("use", "key"),
    [
        (lambda sim: sim.advance([0.0]), "tau"),
        (lambda sim: sim.advance([np.nan] * 9), "tau"),
        (lambda sim: sim.advance(steps=-5), "steps"),
        (lambda sim: sim.advance(steps=2**70), "steps"),
        (lambda sim: sim.advance(f_ext={"nowhere": np.zeros(6)}), "'nowhere' is not a link"),
        (lambda sim: sim.advance(f_ext={"panda_hand": [np.nan] * 6}), "f_ext on link 'panda_hand'"),
        (lambda sim: sim.advance(f_ext={"panda_hand": np.zeros(5)}), "f_ext on link 'panda_hand'"),
        (lambda sim: sim.advance(f_ext={}, frame="body"), "frame is 'body'"),
        (lambda sim: setattr(sim, "damping", -np.ones(9)), "damping is"),
        (lambda sim: sim.reset(np.zeros(2), np.zeros(9)), "q has shape"),
        (lambda sim: sim.change_model(load(UR5)), "degrees of freedom"),
        (lambda sim: sim.change_model(None), "needs a RobotModel"),
        (lambda sim: dd.Simulation(dd.load_urdf(BRICK, floating_base=True), np.zeros(7)), "quaternion"),
        (lambda sim: simulation.potential_energy(sim.model, np.zeros(2)), "q is"),
    ],
)
def test_bad_arguments_leave_the_state(use, key):
    """The caller's copy of the state is not the simulation's."""
    sim = dd.Simulation(load(PANDA))
    before = sim.q
    sim.q[:] = sim.damping[:] = 7.0
    with pytest.raises(InputError, match=key):
        use(sim)
    assert (sim.q == before).all() and sim.time == 0.0 and (sim.damping != 7.0).all()


@ORDERS
def test_overflow_leaves_the_state_before(order):
    model = dd.load_urdf(PENDULUM)
    sim = dd.Simulation(model, [0.5], [0.1], step=100.0, damping=[0.0], limits=False, order=order, effort_limits=False)
    with pytest.raises(InputError):
        sim.advance([1e307])
    assert sim.q[0] == 0.5 and sim.time == 0.0
    assert sim.qd[0] == pytest.approx(0.1, rel=1e-12)


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda sim: pickle.loads(pickle.dumps(sim))], ids=["shallow", "deep", "pickle"]
)
def test_a_copy_goes_its_own_way(copied):
    """A copy has arrays of its own, has the same bits in one call or in many, and leaves the original as it is."""
    sim = dd.Simulation(load(PANDA), friction=0.1 * np.ones(9))
    sim.advance(np.ones(9), steps=5)
    before, other = (sim.q, sim.qd, sim.nu, sim.time, sim.audit), copied(sim)
    other.advance(np.ones(9), steps=5)
    for now, then in zip((sim.q, sim.qd, sim.nu, sim.time, sim.audit), before, strict=True):
        assert np.array_equal(now, then)
    assert (other.q != sim.q).any()
    for _ in range(5):
        sim.advance(np.ones(9))
    assert sim.q.tobytes() == other.q.tobytes() and sim.nu.tobytes() == other.nu.tobytes()
    assert sim.audit == other.audit


@ORDERS
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
