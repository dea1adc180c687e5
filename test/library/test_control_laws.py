# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws with one damping ratio, bounded robust tracking and adaptation to a payload, against
Pinocchio's quantities.
"""

import numpy as np
import pytest
import scipy.linalg

import diag_dynamics as dd
from controlled import (
    ALL,
    ARM,
    FRAMES,
    PANDA,
    POINT,
    READY,
    TREE,
    UR5,
    close,
    configuration,
    dense_frame,
    frictionless,
    states,
)
from coupling import Coupled, with_payloads
from described import subject
from diag_dynamics.control.laws import Law
from diag_dynamics.exceptions import InputError

ROBOTS = pytest.mark.parametrize("robot", (PANDA, ARM, UR5, TREE))
RATIO = 0.7


def joint_damping(law, t, *target):
    """Return the damping matrix of a law for efforts and rates, column by column, which is linear
    in the rates at q.
    """
    nv = len(t.q)
    rest = law.command(t.q, np.zeros(nv), *target).tau
    return np.column_stack([rest - law.command(t.q, unit, *target).tau for unit in np.eye(nv)])


def modal(M, K, damping):
    """Return frequencies [rad/s] of M z'' + K z and the damping in their modes, which is 2ζω on its
    diagonal.
    """
    squares, modes = scipy.linalg.eigh(K, M)
    return np.sqrt(squares.clip(0.0)), modes.T @ damping @ modes


@ROBOTS
def test_every_mode_of_joint_springs_has_the_damping_ratio(robot):
    """Over 300 poses: modes of Pinocchio's M and of the stiffness, and the damping of the law's
    commands in them.
    """
    s = subject(robot)
    rng = np.random.default_rng(3)
    stiffness = rng.uniform(50, 500, s.model.nv)
    law = dd.JointRegulation(s.dyn, stiffness, RATIO)
    errors = []
    for _ in range(300):
        t = s.oracle.at(configuration(s.model, rng), np.zeros(s.model.nv))
        frequencies, damping = modal(t.M, np.diag(stiffness), joint_damping(law, t, t.q))
        errors.append(np.abs(np.diag(damping) / (2.0 * frequencies) - RATIO).max())
        coupling = damping - np.diag(np.diag(damping))
        assert np.abs(coupling).max() < 1e-9 * np.diag(damping).max()
    assert max(errors) < 1e-10


@ROBOTS
def test_every_mode_of_a_frame_has_the_damping_ratio(robot):
    """The same about a pose, in modes faster than null_frequency; slower ones and the null space
    are damped as this one.
    """
    s = subject(robot)
    rng = np.random.default_rng(4)
    k_p = np.array([300.0, 400.0, 500.0])
    k_o = 30.0
    law = dd.PoseRegulation(
        s.dyn, FRAMES[robot.id], None, k_p, k_o, POINT, damping_ratio=RATIO, null_frequency=3.0
    )
    fast = []
    slow = 0
    for _ in range(300):
        t = s.oracle.at(configuration(s.model, rng), np.zeros(s.model.nv))
        position, axes, J = dense_frame(robot, t.q)
        law.aim(position, axes)
        # Half of the weight of the axes in JᵀC₂J: the stiffness against small rotations is k_o.
        K = J.T @ (np.concatenate([k_p, np.full(9, 0.5 * k_o)])[:, None] * J)
        frequencies, damping = modal(t.M, K, joint_damping(law, t))
        at_least = np.maximum(frequencies, 3.0)
        np.testing.assert_allclose(np.diag(damping), 2.0 * RATIO * at_least, rtol=1e-6)
        is_fast = frequencies > 6.0
        fast.append(np.abs(np.diag(damping)[is_fast] / (2.0 * frequencies[is_fast]) - RATIO).max())
        slow += np.count_nonzero(frequencies < 3.0)
        assert np.linalg.eigvalsh(damping + damping.T).min() > 0.0
    assert max(fast) < 1e-10 and (slow > 0 or robot is UR5)


@ALL
def test_regulation_commands(robot):
    """τ = M q̈_d + C_s q̇_d + g + K_q(q_d − q) − m c mᵀ(q̇ − q̇_d), with scipy's root of ℓK_qℓᵀ."""
    s = subject(robot)
    law = dd.JointRegulation(s.dyn, 1.0, RATIO)
    for rng, t in states(robot, 4):
        root = rng.uniform(-5, 10, (s.model.nv, s.model.nv))
        law.stiffness = K = root @ root.T + np.diag(rng.uniform(50, 500, s.model.nv))
        q_d, qd_d, qdd_d = (
            t.q + rng.uniform(-0.5, 0.5, s.model.nv),
            *rng.normal(size=(2, s.model.nv)),
        )
        command = law.command(t.q, t.qd, q_d, qd_d, qdd_d)
        c = 2.0 * RATIO * scipy.linalg.sqrtm(t.l @ K @ t.l.T).real
        rates = t.m.T @ (t.qd - qd_d)
        close(command.tau, t.M @ qdd_d + t.C_s @ qd_d + t.g + K @ (q_d - t.q) - t.m @ c @ rates)
        close(t.m @ command.epsilon, command.tau - t.g)
        close(command.lyapunov, 0.5 * rates @ rates + 0.5 * (q_d - t.q) @ K @ (q_d - t.q))
        close(command.lyapunov_rate, -rates @ c @ rates)


@pytest.mark.parametrize(
    "wrong", [np.ones(7), np.ones((7, 7)), np.diag([1.0] * 6 + [np.nan]), np.tri(7) + np.eye(7)]
)
def test_a_stiffness_is_a_positive_definite_matrix(wrong):
    law = dd.JointRegulation(subject(ARM).dyn, 100.0, RATIO)
    with pytest.raises(InputError, match=r"stiffness is .* expected 7 x 7 finite numbers"):
        law.stiffness = wrong
    assert (law.stiffness == 100.0 * np.eye(7)).all()


def growth(law, period, q, qd, *target, cycles=800):
    """Return by what V grows in the second half of cycles of a period [s] with torques held; 0
    where it has vanished.
    """
    robot = frictionless(subject(ARM).model, q, qd, period / 4)
    values = []
    for _ in range(cycles):
        command = law.command(robot.q, robot.qd, *target)
        values.append(command.lyapunov)
        if values[-1] > 1e4 * values[0]:
            return np.inf
        for _ in range(4):
            robot.advance(command.tau)
    return 0.0 if values[-1] < 1e-12 * values[0] else values[-1] / values[cycles // 2]


def gain_of(message):
    """Return the largest gain that an error names."""
    return float(str(message.value).split("expected at most ")[1].split()[0])


def coupled_springs(dyn, stiffness):
    law = dd.JointRegulation(dyn, 1.0, 0.7)
    neighbours = np.eye(7, k=1) + np.eye(7, k=-1)
    law.stiffness = stiffness * (np.eye(7) + 0.4 * neighbours)
    return law


def pose_law(dyn, stiffness, **damping):
    law = dd.PoseRegulation(
        dyn, "panda_hand", position_stiffness=300.0, orientation_stiffness=stiffness, **damping
    )
    law.aim(*law.pose(READY))
    return law


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda dyn, gain: dd.RateDamping(dyn, gain), "gain of 'panda_joint1'"),
        (
            lambda dyn, gain: dd.JointTracking(dyn, gain, 20.0),
            "gain .* convergence of 'panda_joint1'",
        ),
        (
            lambda dyn, gain: dd.JointTracking(dyn, 20.0, 20.0, bound=0.1 * gain, width=0.1),
            "bound/width",
        ),
        (lambda dyn, gain: dd.JointRegulation(dyn, gain, 0.7), "stiffness of 'panda_joint7'"),
        (lambda dyn, gain: dd.JointRegulation(dyn, gain, 0.2), "stiffness of 'panda_joint7'"),
        (coupled_springs, "stiffness of 'panda_joint7'"),
        (lambda dyn, gain: pose_law(dyn, gain, damping_ratio=0.7), "orientation_stiffness"),
        (lambda dyn, gain: pose_law(dyn, gain, damping=30.0), "orientation_stiffness"),
        (lambda dyn, gain: pose_law(dyn, 1.0, damping=gain), "damping of 'panda_joint1'"),
    ],
)
def test_gains_that_a_period_makes_unstable_are_refused(make, key):
    """The gain that the error names is accepted and stable; 4 % above the bound of the same loop V
    grows.
    """
    dyn = subject(ARM).dyn
    period = 0.01
    with pytest.raises(InputError, match=rf"{key}.* is .*expected at most .* at 100 Hz") as message:
        make(dyn, 1e6).require_stable(READY, period)
    largest = gain_of(message)
    if "bound/width" in key:
        largest -= 40.0
    elif "convergence" in key:
        largest -= 20.0
    target = (
        () if "damping" in key or "orientation" in key or key.startswith("gain of") else (READY,)
    )
    qd = 1e-4 * np.random.default_rng(1).normal(size=7)
    stable = make(dyn, largest)
    unstable = make(dyn, 1.04 * largest / 0.995)
    stable.require_stable(READY, period)
    assert growth(stable, period, READY, qd, *target) < 0.9
    with pytest.raises(InputError, match=key):
        unstable.require_stable(READY, period)
    assert growth(unstable, period, READY, qd, *target) > 1.5


def test_laws_without_a_check_of_their_gains_are_refused():
    """A subclass that does not define require_stable has no instances; a law without gains accepts
    every period.
    """
    dyn = subject(ARM).dyn
    with pytest.raises(TypeError, match="require_stable"):
        type("Unchecked", (Law,), {})(dyn)
    dd.GravityCompensation(dyn).require_stable(READY, 1.0)


# --- Unknown payloads


def loaded_oracle(robot, link, payload):
    """Return Pinocchio's robot with a payload (mass, centre, inertia about it)."""
    s = subject(robot)
    return Coupled(with_payloads(robot.urdf, {link: payload}), s.model.dof_names, **robot.options)


def random_payload(rng):
    """Return mass, centre and inertia of a physical body."""
    points = rng.normal(size=(6, 3)) * 0.1
    masses = rng.uniform(0.1, 0.4, 6)
    center = masses @ points / masses.sum()
    lever = points - center
    return (
        masses.sum(),
        center,
        sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, lever, strict=True)),
    )


def pseudo(mass, center, inertia):
    """Return ∫ r̄r̄ᵀdm of a body."""
    r = np.append(center, 1.0)
    P = mass * np.outer(r, r)
    P[:3, :3] += 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return P


def payload_torque(robot, link, payload, q, x, y, acceleration):
    """Return M q̈ + c(x, y) + g of a payload by Pinocchio with and without it; c is bilinear, by
    polarization.
    """
    with_it = loaded_oracle(robot, link, payload)
    without = subject(robot).oracle
    bias = (
        with_it.coriolis_torque(q, x + y)
        - with_it.coriolis_torque(q, x - y)
        - without.coriolis_torque(q, x + y)
        + without.coriolis_torque(q, x - y)
    )
    mass = with_it.mass_matrix(q) - without.mass_matrix(q)
    g = with_it.gravity_torque(q) - without.gravity_torque(q)
    return mass @ acceleration + 0.25 * bias + g, g


ON = {**FRAMES, PANDA.id: "panda_leftfinger"}


@ALL
def test_adaptive_commands(robot):
    """Those of JointTracking and Y(q, q̇, q̇_r, q̈_r)π of the payload by Pinocchio; the estimate
    follows −γP̂LP̂.
    """
    s = subject(robot)
    link = ON[robot.id]
    law = dd.AdaptiveTracking(s.dyn, link, 20.0, 10.0, rate=2.0)
    payload_is_known = dd.JointTracking(s.dyn, 20.0, 10.0)
    nominal = law.pseudo_inertia
    for rng, t in states(robot, 3):
        q_d, qd_d, qdd_d = (
            t.q + rng.uniform(-0.5, 0.5, s.model.nv),
            *rng.normal(size=(2, s.model.nv)),
        )
        payload = random_payload(rng)
        other = random_payload(rng)
        law.reset(nominal + pseudo(*payload))
        mass, moment = law.payload
        np.testing.assert_allclose(
            [mass, *moment], [payload[0], *(payload[0] * payload[1])], atol=1e-12
        )
        command = law.command(t.q, t.qd, q_d, qd_d, qdd_d)
        without = payload_is_known.command(t.q, t.qd, q_d, qd_d, qdd_d)
        qd_r = qd_d + 10.0 * (q_d - t.q)
        qdd_r = qdd_d + 10.0 * (qd_d - t.qd)
        torque, g = payload_torque(robot, link, payload, t.q, t.qd, qd_r, qdd_r)
        close(command.tau, without.tau + torque)
        close(command.gravity_torque, without.gravity_torque + g)
        close(t.m @ command.epsilon, command.tau - command.gravity_torque)
        P = law.pseudo_inertia
        step = 1e-9
        law.adapt(step)
        rate = np.linalg.solve(P, np.linalg.solve(P, (law.pseudo_inertia - P) / step).T)  # −γL
        power = (t.qd - qd_r) @ payload_torque(robot, link, other, t.q, t.qd, qd_r, qdd_r)[0]
        assert np.trace(rate @ pseudo(*other)) == pytest.approx(-2.0 * power, rel=1e-4)


def test_estimates_stay_physical_in_any_step():
    """However long a step and however wrong the motion; a fixed link and an estimate that is no
    body are rejected by name.
    """
    dyn = subject(ARM).dyn
    rng = np.random.default_rng(2)
    law = dd.AdaptiveTracking(dyn, "panda_hand", 20.0, 10.0, rate=100.0)
    for _ in range(200):
        law.command(configuration(dyn.model, rng), rng.normal(size=7), READY, rng.normal(size=7))
        law.adapt(10.0)
        assert np.linalg.eigvalsh(law.pseudo_inertia)[0] > 0.0 and law.payload[0] < 5.0
    heavy = dd.AdaptiveTracking(dyn, "panda_hand", 20.0, 10.0, rate=100.0, max_mass=1e9)
    heavy.command(READY, np.zeros(7), READY + 0.1)
    for _ in range(200):
        heavy.adapt(10.0)
    assert np.linalg.cond(heavy.pseudo_inertia) < 1e12
    for make, key in (
        (
            lambda: dd.AdaptiveTracking(dyn, "panda_link0", 1, 1, rate=1),
            "link is 'panda_link0'; expected a link that",
        ),
        (lambda: dd.AdaptiveTracking(dyn, "panda_hand", 1, 1, rate=0), "rate is 0"),
        (lambda: dd.AdaptiveTracking(dyn, "panda_hand", 1, 1, rate=1, max_mass=0), "max_mass is 0"),
        (lambda: law.reset(np.diag([1.0, 1, 1, -1])), "pseudo_inertia is .* positive definite"),
        (lambda: law.adapt(-1.0), "period is -1"),
        (
            lambda: law.require_stable(READY, 0.01),
            "rate of adaptation .* is 100; expected at most .* 1/J at 100 Hz",
        ),
    ):
        with pytest.raises(InputError, match=key):
            make()
