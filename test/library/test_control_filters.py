# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What commands pass through: energy limiter, effort and rate limits, soft position limits."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from coupling import Coupled
from diag_dynamics.exceptions import InputError

PANDA = robots.robot("panda_description/urdf/panda.urdf")._replace(locked_joints={"panda_finger_joint1": 0.02})
READY = np.array([0.0, -0.5, 0.1, -2.0, 0.1, 1.6, 0.5])
FAR = np.array([1.2, 0.8, -1.0, 1.0, 1.0, -1.0, 1.0])
N, PERIOD = 7, 1e-3


class Subject(NamedTuple):
    """The arm of the Panda, in the library and in Pinocchio."""

    model: object
    dyn: dd.DiagonalDynamics
    oracle: Coupled


@cache
def arm():
    model = dd.load_urdf(PANDA.source, **PANDA.options)
    return Subject(model, dd.DiagonalDynamics(model), Coupled(PANDA.urdf, model.dof_names, **PANDA.options))


def plant(q, qd, limits=False):
    return dd.Simulation(
        arm().model, q, qd, step=PERIOD, damping=np.zeros(N), friction=np.zeros(N), effort_limits=False, limits=limits
    )


def random_state(rng, speed=1.0):
    model = arm().model
    return rng.uniform(0.9 * model.lower, 0.9 * model.upper), speed * rng.normal(size=N)


def commands(count, gain=20.0, speed=1.0):
    """Commands of a tracking law at random states with far targets, and the states."""
    rng, s = np.random.default_rng(11), arm()
    law = dd.JointTracking(s.dyn, gain, gain)
    for _ in range(count):
        q, qd = random_state(rng, speed)
        yield rng, q, qd, law.command(q, qd, random_state(rng)[0])


# --- Kinetic energy ---


def test_limiter_takes_power_and_never_adds():
    """νᵀε becomes min(νᵀε, αh), the change is along ν, and efforts are m(ε + ε_g) by Pinocchio's m."""
    s = arm()
    acted = 0
    for rng, q, qd, command in commands(60):
        K, alpha = 0.5 * command.nu @ command.nu, rng.uniform(5, 200)
        limiter = dd.EnergyLimiter(s.dyn, K * rng.uniform(0.3, 3), alpha)
        limited = limiter.filter(q, command)
        before, after = command.nu @ command.epsilon, limited.nu @ limited.epsilon
        allowed = alpha * (limiter.limit - K)
        assert after <= before
        assert after == pytest.approx(min(before, allowed), rel=1e-9, abs=1e-9 * abs(before))
        taken = command.epsilon - limited.epsilon
        np.testing.assert_allclose(taken * (command.nu @ command.nu), command.nu * (command.nu @ taken), atol=1e-8)
        t = s.oracle.at(q, qd)
        expected = t.m @ limited.epsilon + t.g
        np.testing.assert_allclose(limited.tau, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
        acted += limited is not command
        np.testing.assert_array_equal(limited.gravity_torque, command.gravity_torque)
    assert 20 < acted < 60


def test_limiter_leaves_a_resting_robot_alone():
    s = arm()
    limiter = dd.EnergyLimiter(s.dyn, 1e-6, 100.0)
    command = dd.JointTracking(s.dyn, 9.0, 9.0).command(READY, np.zeros(N), READY + 1)
    assert limiter.filter(READY, command) is command
    assert limiter.filter(READY, command, np.ones(N)) is command
    slow = dd.JointTracking(s.dyn, 9.0, 9.0).command(READY, np.full(N, 1e-9), READY + 1)
    assert np.isfinite(limiter.filter(READY, slow).tau).all()


def test_limiter_bounds_what_a_law_does():
    """A law that would reach 40 J stays below half a joule, and from above the bound K comes back to it."""
    s, bound = arm(), 0.5
    law, limiter = dd.JointTracking(s.dyn, 20.0, 5.0), dd.EnergyLimiter(s.dyn, bound, 100.0)

    def most(limit, q, qd, steps):
        robot, energies = plant(q, qd), []
        for _ in range(steps):
            command = law.command(robot.q, robot.qd, READY + FAR)
            robot.advance((limiter.filter(robot.q, command) if limit else command).tau)
            energies.append(0.5 * robot.nu @ robot.nu)
        return np.array(energies)

    free, held = (most(limit, READY, np.zeros(N), 1500) for limit in (False, True))
    assert free.max() > 4 * bound
    assert 0.98 * bound < held.max() < 1.001 * bound
    above = most(True, READY, np.full(N, 1.0), 200)
    assert above[0] > 1.2 * bound and above[100:].max() < 1.001 * bound


def pushed(estimate, bound, alpha=50.0, force=30.0):
    """Largest K, and largest power of the push, of an arm that is led by hand and pushed at the hand for two seconds."""
    s = arm()
    law, limiter, robot = (
        dd.GravityCompensation(s.dyn),
        dd.EnergyLimiter(s.dyn, bound, alpha),
        plant(READY, np.zeros(N)),
    )
    observer = dd.DisturbanceObserver(s.dyn, 200.0, np.inf, effort="held")
    tau, K, power = None, 0.0, 0.0
    for k in range(2000):
        q, qd = robot.q, robot.qd
        direction = np.array([np.cos(3 * k * PERIOD), np.sin(3 * k * PERIOD), 0.3])
        push = s.oracle.effort_of(q, {"panda_hand": [*(force * direction), 0, 0, 0]}, "world")
        seen = observer.update(k * PERIOD, q, qd, np.zeros(N) if tau is None else tau)
        external = seen.residual if estimate and seen.valid else None
        tau = limiter.filter(q, law.command(q, qd), external).tau
        robot.advance(tau + push)
        K, power = max(K, 0.5 * robot.nu @ robot.nu), max(power, push @ robot.qd)
    return K, power


def test_limiter_holds_its_bound_under_pushes():
    """Within 2 % with the observer's estimate of the push; without one K_max + P/α, as documented, and that is more."""
    bound = 1.0
    K, _ = pushed(True, bound)
    assert 0.98 * bound < K < 1.02 * bound
    for alpha in (50.0, 500.0):
        K, power = pushed(False, bound, alpha)
        assert bound + 0.5 * power / alpha < K < bound + power / alpha


# --- Efforts ---


def test_saturation_scales_what_moves_and_not_what_holds():
    """Within the limits, τ − g scaled by the largest factor in [0, 1] that does it; the sign of the power stays."""
    s, acted = arm(), 0
    for rng, _, _, command in commands(200):
        limit = np.abs(command.gravity_torque) / 0.9 + np.exp(rng.uniform(-2, 7)) * rng.uniform(0.5, 1, N)
        result = dd.EffortSaturation(s.model, limit).filter(command)
        g, rest = command.gravity_torque, command.tau - command.gravity_torque
        assert (np.abs(result.tau) <= limit).all() and 0.0 <= result.scale <= 1.0
        np.testing.assert_allclose(result.tau, g + result.scale * rest, atol=1e-11 * np.abs(command.tau).max())
        np.testing.assert_array_equal(result.epsilon, result.scale * command.epsilon)
        assert (result.nu @ result.epsilon) * (command.nu @ command.epsilon) >= 0.0
        at_limit = np.isclose(np.abs(result.tau), limit, rtol=1e-12)
        if result is command:
            assert not at_limit.any() and result.scale == 1.0 and result.limited == ()
        else:
            acted += 1
            assert result.limited == tuple(n for n, x in zip(s.model.dof_names, at_limit, strict=True) if x) != ()
    assert 100 < acted < 200


def test_cutting_joints_one_by_one_can_drive():
    """Why there is one factor for all: with a clip of each joint braking turns into driving, with the factor never."""
    s, driving = arm(), 0
    law = dd.RateDamping(s.dyn, 60.0)
    rng = np.random.default_rng(2)
    for _ in range(200):
        q, qd = random_state(rng)
        command = law.command(q, qd)
        limit = np.abs(command.gravity_torque) / 0.9 + rng.uniform(0.1, 5, N)
        clipped = np.clip(command.tau, -limit, limit)
        driving += qd @ (clipped - command.gravity_torque) > 0
        scaled = dd.EffortSaturation(s.model, limit).filter(command)
        assert qd @ (scaled.tau - command.gravity_torque) <= 0
    assert driving > 0


@pytest.mark.parametrize("speed", (0.5, -0.5))
def test_saturation_of_a_joint_that_gravity_overloads(speed):
    """It gives what it can, whichever way it is to move; the others are scaled as if it were not there: here not at all."""
    s = arm()
    command = dd.RateDamping(s.dyn, 3.0).command(READY, np.full(N, speed))
    g = command.gravity_torque
    k = int(np.argmax(np.abs(g)))
    limit = np.abs(g) + 100.0
    limit[k] = 0.5 * abs(g[k])
    result = dd.EffortSaturation(s.model, limit).filter(command)
    assert result.tau[k] == np.sign(g[k]) * limit[k] and result.limited == (s.model.dof_names[k],)
    others = np.arange(N) != k
    np.testing.assert_allclose(result.tau[others], command.tau[others], rtol=1e-14)
    assert result.scale == 1.0


@pytest.mark.parametrize("speed", (0.5, -0.5, 20.0, -20.0))
def test_saturation_is_continuous_as_gravity_takes_a_limit(speed):
    """A joint whose limit shrinks to less than its weight: no effort jumps, and the others are never left without brakes."""
    s = arm()
    command = dd.RateDamping(s.dyn, 8.0).command(READY, np.full(N, speed))
    g, rest = command.gravity_torque, command.tau - command.gravity_torque
    k = int(np.argmax(np.abs(g)))
    parts = np.linspace(0.5, 1.5, 20001)  # of the limit that gravity takes
    results = []
    for part in parts:
        limit = np.full(N, 1e3)
        limit[k] = abs(g[k]) / part
        results.append(dd.EffortSaturation(s.model, limit).filter(command))
        assert abs(results[-1].tau[k]) <= limit[k]
    taus, scales = np.array([r.tau for r in results]), np.array([r.scale for r in results])
    assert np.abs(np.diff(taus, axis=0)).max() < 0.002 * (np.abs(rest).max() + np.abs(g[k]))
    assert (scales[parts > 1.0] == 1.0).all()
    room = (1.0 / 0.9 - 1.0) * abs(g[k]) if rest[k] * g[k] > 0.0 else np.inf
    assert scales.min() >= 0.99 * min(room / abs(rest[k]), 0.5)


def test_saturation_of_limits_in_the_description():
    s = arm()
    np.testing.assert_array_equal(dd.EffortSaturation(s.model).limit, s.model.effort_limit)
    free = dd.load_urdf(PANDA.urdf.replace('effort="87.0"', 'effort="0"'), **PANDA.options)
    with pytest.raises(InputError, match=r"effort limit of 'panda_joint1' is 0.0, expected a number > 0 \[N m, N\]"):
        dd.EffortSaturation(free)
    unlimited = dd.EffortSaturation(free, np.inf)
    for _, _, _, command in commands(3):
        assert unlimited.filter(command) is command


def test_rates_are_limited_joint_by_joint():
    """Each joint goes towards what is asked at its rate, gets there, and never leaves the effort limits."""
    s, rng = arm(), np.random.default_rng(4)
    rate = rng.uniform(100, 1000, N)
    limiter = dd.EffortRateLimiter(s.model, rate, np.zeros(N))
    last, goal = np.zeros(N), rng.uniform(-80, 80, N)
    for k in range(2000):
        dt = rng.uniform(0, 2e-3)
        if k % 500 == 0:
            goal = rng.uniform(-80, 80, N)
        tau, limited = limiter.filter(goal, dt)
        assert (np.abs(tau - last) <= rate * dt * (1 + 1e-12) + 1e-14).all() and (np.abs(tau) <= 80).all()
        assert limited == tuple(n for n, x in zip(s.model.dof_names, tau != goal, strict=True) if x)
        assert (np.abs(goal - tau) <= np.abs(goal - last)).all()
        last = tau
    np.testing.assert_array_equal(last, goal)
    assert limiter.filter(-goal, 0.0)[0].tolist() == goal.tolist()


def test_rate_limiter_starts_where_it_is_told():
    limiter = dd.EffortRateLimiter(arm().model, 10.0)
    assert limiter.filter(np.full(N, 50.0), 0.1) == (pytest.approx(np.full(N, 50.0)), ())
    limiter.reset(np.full(N, 20.0))
    assert limiter.filter(np.full(N, 50.0), 0.1)[0] == pytest.approx(np.full(N, 21.0))
    limiter.reset()
    tau, _ = limiter.filter(np.full(N, -50.0), 0.1)
    tau[:] = 0.0
    assert limiter.filter(np.full(N, -50.0), 0.1)[0] == pytest.approx(np.full(N, -50.0))


# --- Positions ---


def test_repulsion_is_the_gradient_of_its_potential():
    s, rng = arm(), np.random.default_rng(6)
    springs = dd.PositionRepulsion(s.dyn, 0.3, rng.uniform(10, 100, N), 5.0)
    for _ in range(20):
        q = rng.uniform(s.model.lower - 0.1, s.model.upper + 0.1)
        gradient = [(springs.potential(q + h) - springs.potential(q - h)) / 2e-6 for h in 1e-6 * np.eye(N)]
        np.testing.assert_allclose(springs.effort(q, np.zeros(N)), -np.array(gradient), atol=1e-6)
        inside = (q > s.model.lower + 0.3) & (q < s.model.upper - 0.3)
        assert (springs.effort(q, np.ones(N))[inside] == 0).all()
        qd = rng.normal(size=N)
        damped = springs.effort(q, qd) - springs.effort(q, np.zeros(N))
        assert (damped * qd <= 0).all()
        assert not damped[springs.depth(q) * qd <= 0].any()  # the way back is free
    q = 0.5 * (s.model.lower + s.model.upper)
    command = dd.GravityCompensation(s.dyn).command(q, np.ones(N))
    assert springs.filter(q, np.ones(N), command) is command


def coasted(damping, steps=1500, sign=1.0):
    """K + U, and the positions, of an arm without weight that coasts into its limits."""
    s = arm()
    law, springs = dd.GravityCompensation(s.dyn), dd.PositionRepulsion(s.dyn, 0.2, 60.0, damping)
    near = np.array([0.0, 1.5, 0.0, -0.4, 0.0, 3.5, 0.0])
    robot, energy, path = plant(near, np.array([0.0, 0.6, 0.0, 0.4, 0.0, 0.8, 0.0])), [], []
    for _ in range(steps):
        q, qd = robot.q, robot.qd
        command = springs.filter(q, qd, law.command(q, qd))
        np.testing.assert_allclose(
            s.dyn.tau_from_epsilon(q, command.epsilon), command.tau - command.gravity_torque, atol=1e-10
        )
        energy.append(0.5 * command.nu @ command.nu + springs.potential(q))
        path.append(q)
        robot.advance(command.gravity_torque + sign * (command.tau - command.gravity_torque))
    return springs, np.array(energy), np.array(path)


def test_repulsion_keeps_joints_off_their_stops():
    """K + U stays, or falls where there is damping, and no joint reaches its stop: they had too little energy."""
    s = arm()
    springs, energy, path = coasted(0.0)
    np.testing.assert_allclose(energy, energy[0], rtol=0.02)
    assert energy[0] < 0.5 * 60.0 * 0.2**2 < 2.0
    assert max(springs.potential(q) for q in path) > 0.3 * energy[0]
    assert (path > s.model.lower).all() and (path < s.model.upper).all()
    _, energy, path = coasted(40.0)
    assert energy[-1] < 0.8 * energy[0] and np.diff(energy).max() < 1e-3 * energy[0]
    _, energy, path = coasted(0.0, 250, sign=-1.0)
    assert (path > s.model.upper).any() and not np.allclose(energy, energy[0], rtol=0.02)


def test_repulsion_where_there_is_little_or_no_range():
    """Continuous joints are left alone, a margin is at most half of a range, and a joint without one is named."""
    tree = next(robot for robot in robots.random_robots() if robot.id == "geared_tree_10")
    model = dd.load_urdf(tree.source, **tree.options)
    springs = dd.PositionRepulsion(dd.DiagonalDynamics(model), 50.0, 1.0)
    turns = ~np.isfinite(model.upper)
    q = np.where(turns, 1e3, 0.0)
    assert turns.any() and not springs.effort(q, np.ones(model.nv)).any()
    narrow = PANDA.urdf.replace('lower="-3.0718" upper="-0.0698"', 'lower="-1.0" upper="-1.0"')
    assert narrow != PANDA.urdf
    dyn = dd.DiagonalDynamics(dd.load_urdf(narrow, **PANDA.options))
    with pytest.raises(InputError, match=r"joint 'panda_joint4' has limits \[-1.0, -1.0\]: no range to keep it in"):
        dd.PositionRepulsion(dyn, 0.1, 10.0)


# --- What is refused ---

HURT = np.where(np.arange(N) == 2, np.nan, 1.0)

REFUSED = {
    "limit": (lambda s: dd.EnergyLimiter(s.dyn, 0.0, 1.0), r"limit is 0.0, expected a finite number > 0 \[J\]"),
    "rate": (lambda s: dd.EnergyLimiter(s.dyn, 1.0, np.nan), r"rate is nan, expected a finite number > 0 \[1/s\]"),
    "dynamics": (lambda s: dd.EnergyLimiter(s.model, 1.0, 1.0), "dynamics is <RobotModel"),
    "external": (
        lambda s: dd.EnergyLimiter(s.dyn, 1.0, 1.0).filter(READY, command(s), HURT),
        "external of joint 'panda_joint3' is nan",
    ),
    "effort model": (lambda s: dd.EffortSaturation(s.dyn), "model is <diag_dynamics.*expected a RobotModel"),
    "effort": (lambda s: dd.EffortSaturation(s.model, HURT), "effort limit of 'panda_joint3' is nan"),
    "effort rate": (lambda s: dd.EffortRateLimiter(s.model, -HURT), "effort rate of 'panda_joint1' is -1.0"),
    "start": (lambda s: dd.EffortRateLimiter(s.model, 1.0, HURT), "tau of joint 'panda_joint3' is nan"),
    "tau": (lambda s: dd.EffortRateLimiter(s.model, 1.0).filter(HURT, 1.0), "tau of joint 'panda_joint3' is nan"),
    "dt": (lambda s: dd.EffortRateLimiter(s.model, 1.0).filter(READY, -1.0), r"dt is -1.0, expected .* >= 0 \[s\]"),
    "margin": (lambda s: dd.PositionRepulsion(s.dyn, 0.0, 1.0), "margin of 'panda_joint1' is 0.0"),
    "stiffness": (lambda s: dd.PositionRepulsion(s.dyn, 0.1, HURT), "stiffness of 'panda_joint3' is nan"),
    "damping": (lambda s: dd.PositionRepulsion(s.dyn, 0.1, 1.0, -1.0), "damping of 'panda_joint1' is -1.0"),
    "q": (lambda s: dd.PositionRepulsion(s.dyn, 0.1, 1.0).potential(HURT), "q of joint 'panda_joint3' is nan"),
    "qd": (lambda s: dd.PositionRepulsion(s.dyn, 0.1, 1.0).effort(READY, 3), "qd is 3, expected 7 finite numbers"),
}


def command(s):
    return dd.GravityCompensation(s.dyn).command(READY, np.ones(N))


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_name_the_thing(case):
    make, message = REFUSED[case]
    with pytest.raises(InputError, match=message):
        make(arm())
