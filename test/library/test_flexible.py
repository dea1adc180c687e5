# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flexible joints: rotors as bodies of their own in Pinocchio, dense solves, energies,
and the rigid limit.
"""

import copy
import pickle
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import scipy.linalg

import diag_dynamics as dd
from accuracy import assert_close, norm
from diag_dynamics.exceptions import UnsupportedError
from diag_dynamics.joint_states.robot_joints import LinkPositions
from diag_dynamics.model.joint_types import places
from diag_dynamics.parameters.simulator import PARAMETERS
from diag_dynamics.simulation.plant import Plant
from oracles import Oracle
from robots import description, joint, link, robot_path

URDF = robot_path("panda_description/urdf/panda.urdf").read_text()
FLEXIBLE = {
    f"panda_joint{k}": {
        "stiffness": 2e4 / k,
        "damping": 3.0 / k,
        "rotor_inertia": (9 - k) * 1e-5,
        "gear": 50.0 + 10 * k,
        "effort": "spring",
    }
    for k in (1, 2, 3, 4, 6)
}
NAMES = tuple(FLEXIBLE)
EMPTY = 1e-14
"""Mass and inertia of a rotor's body, next to its armature."""

PENDULUM = description(
    "pendulum",
    link("base"),
    link("bob", mass=2.0, com=(0, 0, -0.5), inertia=(0.02, 0, 0, 0.02, 0, 0.01)),
    joint("hinge", "continuous", "base", "bob", axis=(0, 1, 0)),
)


def model(flexible=FLEXIBLE, **options):
    return dd.load_urdf(URDF, mimic="free", parameters={"flexible_joints": flexible}, **options)


@pytest.fixture(scope="module")
def panda():
    return dd.FlexibleDynamics(model())


def state(dynamics, seed, stretch=1e-3):
    """Return q, θ, q̇, θ̇ and τ."""
    rng = np.random.default_rng(seed)
    springs = dynamics.model
    q = springs.random(rng)
    qd = rng.normal(size=springs.nv)
    theta = q[places(dynamics.names, springs.coordinate_names)] + stretch * rng.normal(
        size=len(dynamics.names)
    )
    return q, theta, qd, rng.normal(size=len(dynamics.names)), 5.0 * rng.normal(size=springs.nv)


def with_rotors(urdf, names):
    """Return a URDF in which rotors are links beside those of flexible joints."""
    robot = ET.fromstring(urdf)
    for name in names:
        rotor = copy.deepcopy(
            next(entry for entry in robot.findall("joint") if entry.get("name") == name)
        )
        rotor.set("name", f"{name}_rotor")
        rotor.find("child").set("link", f"{name}_rotor")
        robot.append(rotor)
        robot.append(
            ET.fromstring(link(f"{name}_rotor", EMPTY, inertia=(EMPTY, 0, 0, EMPTY, 0, EMPTY)))
        )
    return ET.tostring(robot, encoding="unicode")


def inertias(dynamics):
    return {
        f"{name}_rotor": B for name, B in zip(dynamics.names, dynamics.rotor_inertia, strict=True)
    }


# --- equations


@pytest.mark.parametrize("seed", range(3))
def test_terms_against_pinocchio(panda, seed):
    """ν, C = ℓc − ṁᵀq̇, ε_g, ε and q̈ of the robot with its rotors; the spring's torque acts on
    both.
    """
    q, theta, qd, thetad, tau = state(panda, seed)
    oracle = Oracle(
        with_rotors(URDF, NAMES),
        (*panda.model.dof_names, *inertias(panda)),
        armature=inertias(panda),
    )
    e = panda.evaluate(q, theta, qd, thetad, tau)
    at = places(NAMES, oracle.dof_names)
    rates = np.append(qd, thetad)
    q_all = np.append(q, theta)
    m = oracle.factor(q_all)
    C_s = oracle.coriolis_matrix(q_all, rates)
    c = oracle.coriolis_torque(q_all, rates)
    N = np.linalg.solve(m, np.linalg.solve(m, C_s + C_s.T).T).T
    m_rate = m @ (np.triu(N, 1) + 0.5 * np.diag(np.diag(N)))
    C = np.linalg.solve(m, c) - m_rate.T @ rates
    assert_close(e.nu, m.T @ rates, 1e-13)
    assert_close(e.coriolis, C, 1e-12, norm(m_rate.T @ rates))
    assert_close(e.gravity, np.linalg.solve(m, oracle.gravity_torque(q_all)), 1e-12)
    springs = [FLEXIBLE[name] for name in NAMES]
    torque = [
        entry["stiffness"] * (theta[i] - q[at[i]]) + entry["damping"] * (thetad[i] - qd[at[i]])
        for i, entry in enumerate(springs)
    ]
    effort = np.append(tau, tau[at] - torque)
    effort[at] = torque
    assert_close(e.epsilon, np.linalg.solve(m, effort), 1e-12)
    accelerations = np.concatenate(panda.accelerations(q, theta, qd, thetad, tau))
    assert_close(accelerations, oracle.forward_dynamics(q_all, rates, effort), 1e-11)
    assert_close(e.spring_torque, np.array(torque), 1e-13)
    assert abs(e.nu @ e.coriolis) < 1e-13 * norm(e.nu) * norm(e.coriolis)


def test_power_balance(panda):
    """K̇ + spring power + loss is the power of efforts and gravity; energies are those of the
    states' numbers.
    """
    q, theta, qd, thetad, tau = state(panda, 3)
    push = {"panda_link7": np.array([3.0, -2.0, 5.0, 0.1, 0.2, -0.3])}
    e = panda.evaluate(q, theta, qd, thetad, tau, push)
    motors = np.isin(panda.model.dof_names, NAMES)
    oracle = Oracle(URDF, panda.model.dof_names)
    power = qd @ np.where(motors, 0.0, tau) + thetad @ tau[motors]
    power += qd @ (oracle.effort_of(q, push, "link") - oracle.gravity_torque(q))
    assert e.kinetic_power + e.spring_power.sum() + e.loss.sum() == pytest.approx(power, rel=1e-12)
    np.testing.assert_allclose(e.motor_energy, 0.5 * panda.rotor_inertia * thetad**2, rtol=1e-13)
    assert (e.loss > 0).all() and (e.spring_energy > 0).all()
    dt = 1e-6
    later = panda.evaluate(q + dt * qd, theta + dt * thetad, qd, thetad, tau)
    earlier = panda.evaluate(q - dt * qd, theta - dt * thetad, qd, thetad, tau)
    np.testing.assert_allclose(
        (later.spring_energy - earlier.spring_energy) / (2 * dt), e.spring_power, rtol=1e-6
    )


# --- simulation


def simulation(model, q, **options):
    options = {"friction": 0.0, "damping": 0.0, "limits": False, "effort_limits": False} | options
    return dd.Simulation(model, q, **options)


@pytest.mark.parametrize("h", [1e-4, 1e-2])
def test_implicit_step_against_a_dense_solve(panda, h):
    """A step solves the equations of links and motors with springs at its middle, or at its end for
    fast ones.
    """
    q, theta, qd, thetad, tau = state(panda, 5, 1e-2)
    nv = panda.model.nv
    at = places(NAMES, panda.model.dof_names)
    damping = np.linspace(0.01, 0.02, nv)
    sim = simulation(panda.model, q, step=h, damping=damping)
    sim.reset(q, qd, theta, thetad)
    sim.advance(tau)
    oracle = Oracle(URDF, panda.model.dof_names)
    k = np.diag(panda.stiffness)
    d = np.diag(panda.damping)
    S = np.eye(nv)[at]  # of flexible joints
    G = np.hstack([-S, np.eye(len(at))])  # stretch
    rates = np.append(qd, thetad)
    viscous = scipy.linalg.block_diag(np.diag(damping), np.zeros((len(at), len(at))))

    def solve(place, middle, h, w, v):
        """Return rates after a step of dampers and springs with weights w and v, of links and
        motors.
        """
        M = scipy.linalg.block_diag(oracle.mass_matrix(place), np.diag(panda.rotor_inertia))
        force = np.append(np.where(np.isin(np.arange(nv), at), 0.0, tau), tau[at])
        force[:nv] -= oracle.coriolis_torque(place, middle) + oracle.gravity_torque(place)
        force -= G.T @ k @ (theta - q[at])
        damper = w * viscous
        spring = v * G.T @ (d + v * h * k) @ G
        rest = (1.0 - w) * viscous + (1.0 - v) * G.T @ (d + v * h * k) @ G
        return np.linalg.solve(M + h * (damper + spring), M @ rates + h * (force - rest @ rates))

    middle = solve(q, qd, 0.5 * h, 1.0, 1.0)[:nv]
    weight = 1.0 if h > 1e-3 else 0.5
    expected = solve(q + 0.5 * h * middle, middle, h, 0.5, weight)
    assert_close(np.append(sim.qd, sim.thetad), expected, 1e-12)
    mean = (1.0 - weight) * rates + weight * expected
    stretch = theta - q[at] + h * (G @ mean)
    assert_close(sim.theta - sim.q[at], stretch, 1e-12)


def test_friction_and_limits_act_on_the_link():
    """A link that sticks lets its motor swing; at a hard limit it stops, and the audit has the
    loss.
    """
    spring = {"stiffness": 400.0, "rotor_inertia": 0.25}
    pendulum = dd.load_urdf(
        PENDULUM, parameters={"flexible_joints": {"hinge": spring}}, gravity=(0, 0, 0)
    )
    sim = dd.Simulation(pendulum, [0.0], friction=5.0)
    sim.reset([0.0], [0.0], [0.01], [0.0])
    angles = []
    for _ in range(200):
        sim.advance()
        angles.append(sim.theta[0])
    t = 1e-3 * np.arange(1, 201)
    error = np.abs(angles - 0.01 * np.cos(np.sqrt(400.0 / 0.25) * t)).max()
    assert sim.q[0] == sim.qd[0] == 0.0 and error < 2e-5
    bounded = PENDULUM.replace('"continuous"', '"revolute"').replace('upper="10"', 'upper="0.1"')
    sim = dd.Simulation(
        dd.load_urdf(bounded, parameters={"flexible_joints": {"hinge": spring}}), [0.0]
    )
    sim.reset([0.0], [2.0], [0.0], [2.0])
    sim.advance(steps=500)
    assert sim.q[0] <= 0.1 and sim.audit.loss < -0.1 and abs(sim.audit.residual) < 2e-3


def test_copies_models_and_resets(panda):
    """A copy goes on with the same bits; a payload keeps the springs; the start holds the links'
    weight.
    """
    q = state(panda, 7)[0]
    sim = dd.Simulation(panda.model, 0.3 * q + 0.7 * np.clip(q, -1, 1), limits=False)
    tau = panda.link.gravity_torque(sim.q)
    np.testing.assert_allclose(
        sim.spring_torque, tau[places(NAMES, panda.model.dof_names)], rtol=1e-9, atol=1e-9
    )
    sim.advance(tau, steps=3)
    assert norm(sim.qd) < 1e-9
    twin = copy.copy(sim)
    for entry in (sim, twin):
        entry.change_model(panda.model.with_payload("panda_hand", 2.0))
        entry.advance(tau, steps=20)
    assert np.array_equal(sim.theta, twin.theta) and norm(sim.qd) > 1e-3
    assert abs(sim.audit.residual) < 1e-4
    e = dd.FlexibleDynamics(sim.model).evaluate(sim.q, sim.theta, sim.qd, sim.thetad, tau)
    assert_close(sim.evaluate(tau).epsilon, e.epsilon[: len(q)], 1e-12)
    with pytest.raises(dd.InputError, match="other flexible or mimic joints"):
        sim.change_model(dd.load_urdf(URDF, mimic="free"))


# --- joint states


def plant(flexible, **values):
    defaults = {name: spec.default for name, spec in PARAMETERS.items()}
    return Plant(dd.load_urdf(URDF, parameters={"flexible_joints": flexible}), defaults | values)


@pytest.mark.parametrize("motion", ["free", "wave"])
def test_simulated_joint_states(motion):
    """The simulator measures what the file says; the links' positions follow from motor and
    spring.
    """
    kinds = [
        ("motor", "spring"),
        ("link", "spring"),
        ("motor", "motor"),
        ("link", "motor"),
        ("motor", "spring"),
    ]
    springs = {
        name: entry
        | {"position": position, "effort": effort, "damping": 0.0 if motion == "free" else 1.0}
        for (name, entry), (position, effort) in zip(FLEXIBLE.items(), kinds, strict=True)
    }
    robot = plant(springs, motion=motion, rate=1000.0)
    if motion == "free":
        robot.drives.command([0.0, -10.0, 3.0, 8.0, 1.0, 1.0, 0.5, 0.0], 0.0)
    robot.advance(400)
    sim = robot.simulation
    measured = robot.measure()
    for i, name in enumerate(NAMES):
        k = robot.names.index(name)
        assert measured.position[k] == (
            sim.theta[i] if springs[name]["position"] == "motor" else sim.q[k]
        )
        assert measured.velocity[k] == (
            sim.thetad[i] if springs[name]["position"] == "motor" else sim.qd[k]
        )
        assert measured.effort[k] == (
            sim.spring_torque[i] if springs[name]["effort"] == "spring" else sim.effort[k]
        )
        assert sim.theta[i] != sim.q[k]
    nv = sim.model.nv
    columns = measured.position[:nv], measured.velocity[:nv], measured.effort[:nv]
    q, _ = LinkPositions(sim.model).convert(
        np.array([1]), *(column[None] for column in columns), [False]
    )
    both = [
        k
        for k, name in enumerate(robot.names)
        if springs.get(name, {}).get("effort", "spring") == "spring"
    ]
    tolerance = {"free": 1e-13, "wave": 1e-4}[
        motion
    ]  # with damping the stretch also depends on its rate
    np.testing.assert_allclose(q[0, both[:-1]], sim.q[both[:-1]], atol=tolerance)


def test_brakes():
    with pytest.raises(
        UnsupportedError, match=r"'without_command' is 'brake'.*'panda_joint1' is flexible"
    ):
        plant(FLEXIBLE, without_command="brake")


def test_link_positions_without_a_state_before():
    """Gaps, jumps and unknown efforts give no rate of the stretch; an unknown effort gives the
    motor's position. Rows may come one by one.
    """
    robot = dd.load_urdf(
        PENDULUM, parameters={"flexible_joints": {"hinge": FLEXIBLE["panda_joint1"]}}
    )
    k = FLEXIBLE["panda_joint1"]["stiffness"]
    d = FLEXIBLE["panda_joint1"]["damping"]
    ms = np.array([0, 1, 2, 3, 4, 300, 301]) * 1_000_000
    torque = np.array([[1.0, 2.0, np.nan, 4.0, 6.0, 7.0, 8.0]]).T * k * 1e-6
    jumped = np.array([0, 0, 0, 0, 0, 0, 1], bool)
    columns = ms, np.zeros((7, 1)), np.zeros((7, 1)), torque, jumped
    rate = 1e-6 * np.array([0, 1, 0, 0, 2, 0, 0]) / 1e-3
    position = 1e-6 * np.array([1, 2, 0, 4, 6, 7, 8]) - d / k * rate
    for size in (1, 7):
        links = LinkPositions(robot)
        rows = [slice(first, first + size) for first in range(0, 7, size)]
        parts = [links.convert(*(column[part] for column in columns)) for part in rows]
        q, qd = (np.concatenate(values) for values in zip(*parts, strict=True))
        np.testing.assert_allclose(-qd[:, 0], rate, atol=1e-15)
        np.testing.assert_allclose(-q[:, 0], position, atol=1e-15)


# --- parameters


def test_sources(tmp_path):
    """A file gives the same model; later files replace entries; locked joints are rigid."""
    path = tmp_path / "arm.yaml"
    parameters = dd.Parameters.from_dict({"flexible_joints": FLEXIBLE})
    parameters.save(path)
    robot = model()
    for other in (
        dd.load_urdf(URDF, mimic="free", parameters=path),
        pickle.loads(pickle.dumps(robot)),
        robot.with_payload("panda_hand", 0.0),
    ):
        assert other.flexible_joints == robot.flexible_joints
    softer = {"panda_joint2": FLEXIBLE["panda_joint2"] | {"stiffness": 1.0}}
    later = parameters.merged_with(dd.Parameters.from_dict({"flexible_joints": softer}))
    assert later.flexible_joints["panda_joint2"].stiffness == 1.0
    assert len(later.flexible_joints) == len(FLEXIBLE)
    locked = robot.with_locked_joints({"panda_joint2": 0.1})
    assert set(locked.flexible_joints) == set(NAMES) - {"panda_joint2"}


def test_armature():
    """Efforts of motors make a joint rigid with armature B; spring torques have no rotor; a
    transmission's is replaced.
    """
    entry = {"stiffness": 100.0, "rotor_inertia": 1e-4, "gear": 30.0}
    gear = (
        '<transmission name="t"><joint name="hinge"/><actuator name="a">'
        "<mechanicalReduction>9</mechanicalReduction>"
        "<motorInertia>0.1</motorInertia></actuator></transmission></robot>"
    )
    urdf = PENDULUM.replace("</robot>", gear)
    assert dd.load_urdf(urdf).armature[0] == pytest.approx(8.1)
    for effort, B in (("motor", 0.09), ("spring", 0.0)):
        parameters = {"flexible_joints": {"hinge": entry | {"effort": effort}}}
        for robot in (
            dd.load_urdf(urdf, parameters=parameters),
            dd.load_urdf(urdf).with_parameters(parameters),
        ):
            assert robot.armature[0] == pytest.approx(B)
            assert dd.FlexibleDynamics(robot).link.model.armature[0] == 0.0


ENTRY = {"stiffness": 100.0, "rotor_inertia": 1e-4}
LEADER = "panda_finger_joint2"
WRONG = {
    "unknown joint": ({"elbow": ENTRY}, {}, "'elbow'; expected"),
    "fixed joint": ({"panda_joint8": ENTRY}, {}, "'panda_joint8' is fixed"),
    "mimic joint": ({LEADER: ENTRY}, {}, f"'{LEADER}' follows other joints"),
    "stiffness": (
        {"panda_joint1": ENTRY | {"stiffness": 0.0}},
        {},
        "'panda_joint1': stiffness is 0.0",
    ),
    "rotor": (
        {"panda_joint1": ENTRY | {"rotor_inertia": "x"}},
        {},
        "'panda_joint1': rotor_inertia is 'x'",
    ),
    "key": ({"panda_joint1": ENTRY | {"spring": 1.0}}, {}, "'panda_joint1' has 'spring'"),
    "position": (
        {"panda_joint1": ENTRY | {"position": "both"}},
        {},
        "'panda_joint1': position is 'both'",
    ),
    "armature": (
        {"panda_joint1": ENTRY},
        {"armature": {"panda_joint1": 0.1}},
        "'panda_joint1' has armature 0.1",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_parameters(case):
    flexible, options, text = WRONG[case]
    with pytest.raises(dd.InputError, match=text):
        dd.load_urdf(URDF, parameters={"flexible_joints": flexible}, **options)


def test_wrong_uses(panda):
    """Arguments of a wrong shape, and what rigid joints alone have, are named."""
    with pytest.raises(dd.InputError, match="theta has shape"):
        panda.spring_torque(np.zeros(9), [0.0], np.zeros(9), np.zeros(5))
    with pytest.raises(UnsupportedError, match="joint 'panda_joint1' is flexible"):
        dd.identify([], panda.model)
    with pytest.raises(dd.InputError, match=r"'panda_joint1' has armature 0\.1"):
        panda.model.with_parameters({"joints": {"panda_joint1": {"armature": 0.1}}})
