# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulation: order, closed forms and conserved quantities; friction, limits, efforts and their
energy.
"""

import copy
import pickle
from itertools import pairwise, product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from described import PANDA, TALOS, UR5
from diag_dynamics import simulation
from diag_dynamics.exceptions import InputError
from engines import distance, reference, start
from examples import shortened, some_of
from oracles import Oracle
from pages import blocks_of
from robots import description, joint, link, random_robots, robot_path

DOCS = Path(__file__).parents[2] / "docs"
SOLO = "solo_description/robots/solo12.urdf"
HAND = "allegro_hand_description/urdf/allegro_left_hand.urdf"
MOBILE = {robot.id: robot.urdf for robot in random_robots() if robot.id.startswith("mobile")}
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

BRICK = description(
    "brick",
    link("brick", mass=2.0, com=(0.1, -0.05, 0.2), inertia=(0.02, 0.003, 0, 0.05, 0.004, 0.06)),
)
"""A rigid body with three different moments of inertia, whose origin is not its centre of mass."""

PENDULUM = description(
    "pendulum",
    link("base"),
    link("bob", mass=1e-3, com=(0, 0, -0.1), inertia=(1e-7, 0, 0, 1e-7, 0, 1e-7)),
    joint("hinge", "revolute", "base", "bob", axis=(0, 1, 0)),
)


def load(robot, **options):
    return dd.load_urdf(robot_path(robot), **options)


LOCKED = {
    "panda_joint2": 0.4,
    "panda_joint5": -0.3,
    "panda_finger_joint1": 0.03,
    "panda_finger_joint2": 0.03,
}
CASES = {
    "panda, damped": (robot_path(PANDA).read_text(), {}, 3.0),
    "panda, locked joints": (robot_path(PANDA).read_text(), {"locked_joints": LOCKED}, 0.0),
    "brick": (BRICK, {"floating_base": True}, 0.0),
    "solo12": (robot_path(SOLO).read_text(), {"floating_base": True}, 0.0),
    "mobile_tree_20": (MOBILE["mobile_tree_20"], {}, 0.0),
    "mobile_tree_21+floating": (MOBILE["mobile_tree_21"], {"floating_base": True}, 0.0),
}
"""URDF, options, and damping in units of the mass matrix's diagonal."""
PUSH = np.array([0.03, -0.04, 0.05, 0.002, 0.001, -0.003])
"""Force [N] and torque [N m] at the origin of the last link, in world axes."""


@pytest.fixture(scope="module", params=CASES)
def motion(request):
    """Return a model, its oracle, a state, efforts, damping, and the state after 0.2 s of PUSH by
    Pinocchio.
    """
    urdf, options, share = CASES[request.param]
    model = dd.load_urdf(urdf, mimic="free", **options)
    oracle = Oracle(urdf, model.dof_names, **options)
    q, qd = start(model, 1, speed=2.0 if request.param == "brick" else 0.5)
    tau = 0.01 * np.random.default_rng(2).normal(size=model.nv)
    damping = share * np.diag(dd.DiagonalDynamics(model).mass_matrix(q))
    d = oracle.to_pin(damping)
    frame = oracle.model.getFrameId(model.link_names[-1])

    def push_and_damping(x, v):
        J = pin.computeFrameJacobian(oracle.model, oracle.data, x, frame, pin.LOCAL_WORLD_ALIGNED)
        return J.T @ PUSH - d * v

    end = reference(oracle, q, qd, tau, 0.2, 1e-3, push_and_damping)
    return model, oracle, q, qd, tau, damping, end


def test_converges_with_its_order(motion):
    """The error against Pinocchio falls with the square of the step, the base's pose included."""
    model, oracle, q, qd, tau, damping, end = motion
    steps = 0.2 / np.array([10, 20, 40, 80])
    errors = []
    for h in steps:
        sim = dd.Simulation(
            model, q, qd, step=h, damping=damping, friction=0.0 * damping, limits=False
        )
        sim.advance(tau, round(0.2 / h), {model.link_names[-1]: PUSH}, "world")
        errors.append(distance(oracle, sim, *end))
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope > 1.8, (slope, errors)
    assert errors[-1] < 1e-2, errors
    lengths = [
        np.linalg.norm(sim.q[k - 3 : k + 1]) for k, c in enumerate(model.orientations) if c == 3
    ]
    np.testing.assert_allclose(lengths, 1.0, atol=4e-16)


SINGLE = [name for name in CASES if not name.startswith("mobile")]
"""Cases whose joints behind the base have one degree of freedom."""


@pytest.mark.parametrize("motion", SINGLE, indirect=True)
def test_integration_by_scipy(motion):
    """The function of docs/simulation.md agrees with Pinocchio, a floating base included."""
    model, oracle, q, qd, tau, damping, end = motion
    [code] = [
        block.code for block in blocks_of(DOCS / "simulation.md") if "solve_ivp" in block.code
    ]
    names = {}
    exec(code, names)
    dynamics = dd.DiagonalDynamics(model)
    push = {model.link_names[-1]: PUSH}

    def efforts(_, q, qd):
        return tau - damping * qd + oracle.effort_of(q, push, "world")

    integrated = names["integrate"](dynamics, q, qd, efforts, 0.2)
    assert distance(oracle, SimpleNamespace(q=integrated[0], qd=integrated[1]), *end) < 1e-7


def test_heavy_damping_creeps():
    """With d/D near 10⁵ s⁻¹ a millisecond step still gives the speed τ/d: d θ' = −m g l sin θ has a
    closed form.
    """
    model = dd.load_urdf(PENDULUM)
    d = 1.0
    moment = 1e-3 * 9.81 * 0.1
    D = dd.DiagonalDynamics(model).evaluate([0.0], [0.0]).articulated_inertia[0]
    assert d / D > 9e4
    sim = dd.Simulation(model, [2.0], [0.0], step=1e-3, damping=[d])
    sim.advance()
    assert sim.qd[0] == pytest.approx(-moment / d * np.sin(2.0), rel=0.02)
    sim.advance(steps=99_999)
    expected = 2.0 * np.arctan(np.tan(1.0) * np.exp(-moment / d * 100.0))
    assert sim.q[0] == pytest.approx(expected, rel=1e-5)
    assert sim.qd[0] == pytest.approx(-moment / d * np.sin(sim.q[0]), rel=1e-3)


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


def test_sliding_stops_where_it_should():
    """v²/2 = (f/m) x, and then it stays, exactly; friction takes all of the kinetic energy."""
    sim = slider(v=1.0, friction=[3.0], step=1.1e-2)
    sim.advance(steps=200)
    assert sim.qd[0] == 0.0
    assert sim.q[0] == pytest.approx(0.5 * 1.0**2 / 1.5, rel=1e-4)
    assert sim.audit.loss == pytest.approx(-1.0, rel=1e-8)
    rest = sim.q[0]
    sim.advance([2.999], steps=1000)
    assert sim.q[0] == rest and sim.qd[0] == 0.0, "sticks below the breakaway force"
    sim.advance([3.5], steps=100)
    assert sim.q[0] - rest == pytest.approx(0.5 * 0.25 * 1.1**2, rel=1e-8)


def test_order_while_joints_slide_or_stick():
    """While no joint starts or stops, two coupled ones with friction converge with order 2, one of
    them at rest, too.
    """
    model = dd.load_urdf(CHAIN)

    def end(h, qd, friction):
        sim = dd.Simulation(model, [0.3, 0.4], qd, step=h, friction=friction, damping=[0.1, 0.0])
        sim.advance([6.0, 3.0], steps=round(0.1 / h))
        np.testing.assert_allclose(sim.nu, sim.dynamics.nu_from_qd(sim.q, sim.qd), rtol=1e-12)
        return np.concatenate([sim.q, sim.qd])

    for qd, friction in (([3.0, 8.0], [0.8, 0.9]), ([3.0, 0.0], [0.8, 50.0])):
        exact = end(5e-4, qd, friction)
        assert (exact[2:] > 0.5).tolist() == [True, qd[1] > 0.0]
        errors = [np.abs(end(h, qd, friction) - exact).max() for h in (2e-2, 1e-2, 5e-3)]
        assert errors[-1] < 1e-3, errors
        assert errors[1] < errors[0] / 3 and errors[2] < errors[1] / 3, errors


@pytest.mark.parametrize("robot", [UR5, TALOS])
def test_brakes(robot):
    """Brakes of any strength stop joints where they are, and take no more than their energy."""
    model = load(robot, floating_base=robot == TALOS)
    special = slice(6 if robot == TALOS else 0, None)  # nothing brakes a base
    rng = np.random.default_rng(7)
    friction = np.zeros(model.nv)
    for strength in np.repeat([30.0, 1e5, 1e7, 1e100], 5):
        q = model.neutral
        qd = rng.normal(size=model.nv)
        q[-len(qd[special]) :] = rng.uniform(*np.clip([model.lower, model.upper], -1.0, 1.0))[
            -len(qd[special]) :
        ]
        friction[special] = strength
        options = {"damping": np.zeros(model.nv), "friction": friction, "effort_limits": False}
        sim = dd.Simulation(model, q, qd, **options)
        energy = sim.kinetic_energy
        q = sim.q
        sim.advance()
        assert np.abs(sim.q - q).max() < 2e-3 * np.abs(qd).max()
        assert sim.audit.energy < 0.0 and sim.audit.loss < 0.0
        assert abs(sim.audit.residual) < 2e-2 * energy
        assert strength < 1e7 or not sim.qd[special].any()


def test_hard_limit_keeps_its_place():
    """An arm that falls on its stop stays there; energy is lost at impacts only."""
    sim = dd.Simulation(dd.load_urdf(CHAIN.replace('upper="10"', 'upper="1.0"', 1)))
    energies = []
    for _ in range(1500):
        sim.advance()
        energies.append(sim.audit.energy)
    assert sim.q[0] == 1.0 and sim.qd[0] == 0.0 and sim.at_limit == ("shoulder",)
    assert sim.audit.loss < -0.1
    assert max(np.diff(energies)) < 1e-5, "energy is lost at impacts and nowhere else"
    assert abs(sim.audit.residual) < 1e-4 * abs(sim.audit.loss)


@pytest.mark.parametrize(
    ("stiffness", "damping"), list(some_of(product([1e2, 1e5, 1e9, 1e13], [0.0, 1.0, 1e6]), 4))
)
def test_compliant_limit_never_adds_energy(damping, stiffness):
    """However stiff, whatever the part of a step in which it is met: a block comes back no faster
    than it went.
    """
    for x in (9.9, 9.90013, 9.9007):
        sim = slider(x, 1.0, limits=dd.CompliantLimits(stiffness, damping))
        start = sim.kinetic_energy
        for _ in range(700):
            sim.advance()
            assert sim.kinetic_energy <= start + 1e-9
            assert sim.audit.energy <= 1e-9 and sim.audit.loss <= 1e-9
        if damping == 0.0 and stiffness == 1e2:
            assert sim.qd[0] == pytest.approx(-1.0, rel=1e-4), (
                "a spring that the step resolves gives all back"
            )


@pytest.mark.parametrize(
    ("start", "seconds", "order"), [(0.61, 0.024, 2), (0.0, 0.8, 1)], ids=["in contact", "touching"]
)
def test_compliant_limit_converges(start, seconds, order):
    """In contact a spring and damper of a coupled arm are integrated with order 2; a step that
    comes to them has order 1.
    """
    model = dd.load_urdf(CHAIN.replace('upper="10"', 'upper="0.6"', 1))

    def run(h):
        limits = dd.CompliantLimits(800.0, 3.0)
        sim = dd.Simulation(model, [start, 0.0], step=h, limits=limits, damping=[0.02, 0.03])
        sim.advance(steps=round(seconds / h))
        return np.concatenate([sim.q, sim.qd]), abs(sim.audit.residual), sim.audit

    exact, _, audit = run(1e-5)
    assert audit.loss < -1e-3, "never touched"
    runs = [run(h) for h in (4e-3, 2e-3, 1e-3)]
    for errors in (
        [np.abs(end - exact).max() for end, _, _ in runs],
        [residual for _, residual, _ in runs],
    ):
        if order == 2:
            assert errors[-1] < 1e-3 and errors[0] > 3 * errors[1] > 9 * errors[2], errors
        else:
            assert max(errors) < 2e-2, errors


def test_names_at_either_limit():
    sim = slider(limits=dd.CompliantLimits(2.0))
    for x, names, energy in ((-11.0, ("rail",), 1.0), (0.0, (), 0.0), (11.0, ("rail",), 1.0)):
        sim.reset([x], [0.0])
        assert sim.at_limit == names and sim.elastic_energy == pytest.approx(energy)


def test_limits_of_a_flying_robot():
    """Each limit is that of its own coordinate, behind the seven of the base; without limits there
    is none.
    """
    chain = CHAIN.replace('upper="10"', 'upper="1.0"', 1)
    heavy = link("base", mass=3.0, inertia=(0.1, 0, 0, 0.1, 0, 0.1))
    model = dd.load_urdf(chain.replace(link("base"), heavy), floating_base=True)
    for angles, names in (([1.5, 0.0], ("shoulder",)), ([0.0, 1.5], ()), ([0.0, 10.5], ("elbow",))):
        q = np.append(model.neutral[:7], angles)
        assert dd.Simulation(model, q).at_limit == names
        assert dd.Simulation(model, q, limits=False).at_limit == ()


def test_efforts_saturate():
    """An effort beyond the limit is cut to it, and its joint is named."""
    sims = [slider(effort_limits=limits) for limits in (True, [100.0], False, [7.0])]
    for sim in sims:
        sim.advance([-150.0], steps=10)
    assert sims[0].saturated == sims[1].saturated == ("rail",) and sims[2].saturated == ()
    assert [sim.effort[0] for sim in sims] == [-100.0, -100.0, -150.0, -7.0]
    np.testing.assert_allclose(
        [sim.qd[0] for sim in sims], np.array([-100, -100, -150, -7]) / 2 * 0.01, rtol=1e-12
    )
    unlimited = dd.Simulation(dd.load_urdf(SLIDER.replace('effort="100"', 'effort="0"')))
    unlimited.advance([1.0])
    assert unlimited.qd[0] > 0.0 and unlimited.saturated == () and unlimited.overspeed == ()
    for rate in (101.0, -101.0):
        unlimited.reset([0.0], [rate])
        assert unlimited.overspeed == ("rail",)


@pytest.mark.parametrize("frame", ["link", "world"])
def test_wrenches_are_efforts_of_their_jacobian(frame):
    """A step with a wrench is one with Jᵀf, that of Pinocchio; held in the world's axes it does not
    turn with the link.
    """
    model = load(UR5)
    q = 0.3 * np.arange(1, 7)
    qd = 0.1 * np.ones(6)
    f_ext = {"wrist_3_link": [3.0, -4.0, 5.0, 0.1, 0.2, -0.3], "forearm_link": [0, 0, 2.0, 0, 0, 0]}
    jacobian = Oracle(robot_path(UR5).read_text(), model.dof_names).effort_of(q, f_ext, frame)
    sims = [dd.Simulation(model, q, qd, step=1e-6, effort_limits=False) for _ in range(2)]
    for wrenches, efforts in ((f_ext, jacobian), (None, None)):  # a push ends
        sims[0].advance(f_ext=wrenches, frame=frame)
        sims[1].advance(efforts)
        np.testing.assert_allclose(sims[0].qd, sims[1].qd, rtol=0, atol=1e-9)
    assert np.abs(sims[0].qd - qd).max() > 1e-5


def test_model_with_another_mimic_joint_is_rejected():
    """Friction of followers is by body: a model of the same degrees of freedom may have more
    bodies.
    """
    links = [link(name, 1.0, inertia=(1, 0, 0, 1, 0, 1)) for name in ("base", "arm", "tip")]
    hinge = joint("hinge", "revolute", "base", "arm")
    end = joint("end", "fixed", "arm", "tip")
    sim = dd.Simulation(dd.load_urdf(description("arm", *links, hinge, end)))
    follower = end.replace("fixed", "revolute").replace("<limit", '<mimic joint="hinge"/><limit')
    with pytest.raises(InputError, match="other flexible or mimic joints"):
        sim.change_model(dd.load_urdf(description("arm", *links, hinge, follower)))


def test_payload_taken_up_in_motion():
    """q and q̇ stay; the payload brings its energy at that speed and height, and the audit has
    it.
    """
    model = load(PANDA)
    sim = dd.Simulation(model, qd=0.2 * np.ones(model.nv))
    sim.advance(steps=100)
    q = sim.q
    qd = sim.qd
    before = sim.audit
    loaded = model.with_payload("panda_hand", 1.5, (0, 0, 0.1))
    sim.change_model(loaded)
    assert (sim.q == q).all() and (sim.qd == qd).all()
    s = dd.DiagonalDynamics(loaded).evaluate(q, qd)
    assert sim.kinetic_energy == pytest.approx(s.kinetic_energy, rel=1e-12)
    assert sim.audit.exchanged == pytest.approx(sim.audit.energy - before.energy)
    assert abs(sim.audit.exchanged) > 1e-3 and sim.audit.residual == pytest.approx(
        before.residual, abs=1e-12
    )
    sim.advance(steps=100)
    assert abs(sim.audit.residual) < 1e-4


def driven(sim, seconds, largest, period=0.05, seed=1):
    """Advance a robot with random efforts, and a push on its last link; return audits in
    between.
    """
    model = sim.model
    rng = np.random.default_rng(seed)
    scale = np.full(model.nv, largest)
    if model.floating_base:
        scale[:6] = 0.0
    link_name = model.link_names[-1]
    audits = [sim.audit]
    for _ in range(round(seconds / period)):
        push = {link_name: 0.5 * rng.normal(size=6)}
        sim.advance(
            scale * rng.uniform(-1, 1, model.nv), round(period / sim.step_size), push, "world"
        )
        audits.append(sim.audit)
    return audits


ROBOTS = {
    "panda with its mimic gripper": (PANDA, {}),
    "ur5": (UR5, {}),
    "allegro hand": (HAND, {}),
    "talos, flying": (TALOS, {"floating_base": True}),
}


@pytest.mark.parametrize(
    ("limits", "seconds"),
    [("hard", shortened(120.0, 8.0)), ("compliant", 1.0)],
    ids=["hard", "compliant"],
)
@pytest.mark.parametrize("name", ROBOTS)
def test_energy_is_accounted_for(name, limits, seconds):
    """The audit's residual is small; friction, dampers and stops only take energy, but for joints
    brought back to stops.
    """
    robot, options = ROBOTS[name]
    model = load(robot, **options)
    special = {}
    if (
        robot == HAND
        # by its own friction it never moves; its own damping, 10⁵ s⁻¹, no step of a millisecond
        # resolves
    ):
        special = {"friction": np.full(model.nv, 0.02), "damping": 1e-4 * model.damping}
    if robot == TALOS:
        special = {"step": 2e-3}
        seconds = min(seconds, shortened(10.0, 3.0))
    D = dd.DiagonalDynamics(model).evaluate(model.neutral, np.zeros(model.nv)).articulated_inertia
    soft = dd.CompliantLimits(
        60.0**2 * D, 60.0 * D
    )  # 60 rad/s: what a step of a millisecond resolves
    sim = dd.Simulation(model, limits=soft if limits == "compliant" else True, **special)
    audits = driven(sim, seconds, 0.02 if robot == HAND else 1.5)  # [N m]
    steps = [
        simulation.EnergyAudit(*np.subtract(after, before)) for before, after in pairwise(audits)
    ]
    turnover = sum(abs(step.work) + abs(step.energy) for step in steps)
    assert turnover > 1e-3
    assert abs(audits[-1].residual) < (5e-3 if robot == HAND else 5e-4) * turnover
    for step in steps:
        assert step.loss <= 1e-6 * turnover


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"step": 0.0}, "step"),
        ({"damping": [-1.0] * 9}, "damping"),
        ({"q": [0.0] * 8}, "q has shape"),
        ({"qd": [np.nan] * 9}, "panda_joint1"),
        ({"friction": [-1.0] * 9}, "friction of .panda_joint1. is -1"),
        ({"effort_limits": "none"}, "effort_limits is"),
        ({"limits": "soft"}, "limits is 'soft'"),
        ({"limits": dd.CompliantLimits(0.0)}, "stiffness of limits of .panda_joint1. is 0.0"),
        ({"limits": dd.CompliantLimits(1.0, -1.0)}, "damping of limits of .panda_joint1. is -1.0"),
    ],
)
def test_bad_options(options, key):
    with pytest.raises(InputError, match=key):
        dd.Simulation(load(PANDA, mimic="free"), **options)


@pytest.mark.parametrize(
    ("use", "key"),
    [
        (lambda sim: sim.advance([0.0]), "tau"),
        (lambda sim: sim.advance(steps=2**70), "steps"),
        (lambda sim: sim.advance(f_ext={"nowhere": np.zeros(6)}), "'nowhere'; expected"),
        (lambda sim: sim.advance(f_ext={}, frame="body"), "frame is 'body'"),
        (lambda sim: setattr(sim, "damping", -np.ones(9)), "damping of .panda_joint1. is -1"),
        (lambda sim: sim.reset(np.zeros(2), np.zeros(9)), "q has shape"),
        (lambda sim: sim.change_model(load(UR5)), "degrees of freedom"),
        (lambda sim: sim.change_model(None), "expected an object of class RobotModel"),
        (
            lambda sim: dd.Simulation("arm.urdf"),
            "model is 'arm.urdf'; expected an object of class RobotModel",
        ),
        (
            lambda sim: dd.Simulation(dd.load_urdf(BRICK, floating_base=True), np.zeros(7)),
            "quaternion",
        ),
    ],
)
def test_bad_arguments_leave_the_state(use, key):
    """The caller's copy of the state is not the simulation's."""
    sim = dd.Simulation(load(PANDA, mimic="free"))
    before = sim.q
    sim.q[:] = sim.damping[:] = 7.0
    with pytest.raises(InputError, match=key):
        use(sim)
    assert (sim.q == before).all() and sim.time == 0.0 and (sim.damping != 7.0).all()


@pytest.mark.parametrize(
    "copied",
    [copy.copy, copy.deepcopy, lambda sim: pickle.loads(pickle.dumps(sim))],
    ids=["shallow", "deep", "pickle"],
)
def test_a_copy_goes_its_own_way(copied):
    """A copy has arrays of its own, has the same bits in one call or in many, and leaves the
    original as it is.
    """
    sim = dd.Simulation(load(PANDA, mimic="free"), friction=0.1 * np.ones(9))
    sim.advance(np.ones(9), steps=5)
    before = (sim.q, sim.qd, sim.nu, sim.time, sim.audit)
    other = copied(sim)
    other.advance(np.ones(9), steps=5)
    for now, then in zip((sim.q, sim.qd, sim.nu, sim.time, sim.audit), before, strict=True):
        assert np.array_equal(now, then)
    assert (other.q != sim.q).any()
    for _ in range(5):
        sim.advance(np.ones(9))
    assert sim.q.tobytes() == other.q.tobytes() and sim.nu.tobytes() == other.nu.tobytes()
    assert sim.audit == other.audit


def test_singular_on_the_way():
    """Where the mass matrix becomes singular the simulation says so, and keeps the last good state.

    A gimbal of massless rings loses its first axis as the second one arrives at its limit of a
    right angle.
    """
    gimbal = description(
        "gimbal",
        *(link(name) for name in ("base", "outer", "inner")),
        link("rotor", mass=1.0, inertia=(0.1, 0, 0, 0.2, 0, 0.25)),
        joint("z", "revolute", "base", "outer", axis=(0, 0, 1)),
        joint("x", "revolute", "outer", "inner", axis=(1, 0, 0)).replace(
            'upper="10"', f'upper="{np.pi / 2}"'
        ),
        joint("y", "revolute", "inner", "rotor", axis=(0, 1, 0)),
    )
    sim = dd.Simulation(dd.load_urdf(gimbal), [0.0, 1.0, 0.0], [0.0, 2.0, 0.0])
    with pytest.raises(
        dd.SingularMassMatrixError, match="joint 'z' moves no inertia there"
    ) as raised:
        sim.advance(steps=1000)
    assert raised.value.articulated_inertia < 1e-6
    assert np.pi / 2 - 0.01 < sim.q[1] < np.pi / 2
    np.testing.assert_allclose(sim.qd, [0.0, 2.0, 0.0], atol=1e-9)
