# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filters of commands on the Panda's arm: limits of energy, contact, effort and its rate; springs
at position limits.
"""

from functools import cache

import numpy as np
import pytest

import diag_dynamics as dd
from controlled import ARM as PANDA
from controlled import READY, START, TREE, UR5, Z1, Sampled, close, frictionless
from described import subject
from diag_dynamics.exceptions import InputError
from examples import shortened

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

N, PERIOD = 7, 1e-3


def arm():
    return subject(PANDA)


def plant(q, qd, step=PERIOD):
    return frictionless(arm().model, q, qd, step)


def random_state(rng):
    model = arm().model
    return rng.uniform(0.9 * model.lower, 0.9 * model.upper), rng.normal(size=N)


def commands(count, gain=20.0):
    """Yield commands of a tracking law at random states with far targets, and the states."""
    rng = np.random.default_rng(11)
    s = arm()
    law = dd.JointTracking(s.dyn, gain, gain)
    for _ in range(count):
        q, qd = random_state(rng)
        yield rng, q, qd, law.command(q, qd, random_state(rng)[0])


@pytest.mark.parametrize("pushed", [False, True])
def test_energies_are_limited_at_the_end_of_a_cycle(pushed):
    """Pinocchio's ν after a cycle is in box and ball of the energies that it allows, and at their
    border if the limiter acts.
    """
    s = arm()
    h = 2e-3
    acted = 0

    def after(q, qd, tau):
        plant = Sampled(s.oracle, q)
        plant.qd = qd
        plant.advance(tau, h)
        t = s.oracle.at(plant.q, plant.qd)
        return t.m.T @ t.qd

    for rng, q, qd, command in commands(60):
        t = s.oracle.at(q, qd)
        share = 0.5 * command.nu**2
        alpha = rng.uniform(5, 200)
        joint_limit = np.where(rng.uniform(size=N) < 0.5, np.inf, rng.uniform(0.3, 2, N))
        joint_limit = share.mean() * joint_limit
        limit = share.sum() * rng.uniform(0.3, 3)
        external = 20.0 * rng.normal(size=N) if pushed else None
        push = t.m @ external if pushed else 0.0
        limited = dd.EnergyLimiter(s.dyn, limit, joint_limit, alpha).filter(
            q, qd, command, h, external
        )
        energies = []
        allowed = share + alpha * h * (joint_limit - share)
        allowed = np.append(allowed, share.sum() + alpha * h * (limit - share.sum()))
        for tau in (command.tau, limited.tau):
            ahead = 0.5 * after(q, qd, tau + push) ** 2
            energies.append(np.append(ahead, ahead.sum()) / allowed)
        assert energies[1].max() < 1.005
        if limited is command:
            assert energies[0].max() < 1.005
        else:
            acted += 1
            assert energies[0].max() > 0.995 and energies[1].max() > 0.995
            change = t.m @ (limited.epsilon - command.epsilon)
            close(limited.tau - command.tau, change)
    assert 10 < acted < 60


def swing_to(robot, stiffness, period):
    """Return the largest K [J] of a sampled loop whose set-point jumps by 0.8 rad in all joints."""
    s = subject(robot)
    target = START[robot.id] + 0.8
    filters = dd.Limits(s.dyn, effort_rate=1e9, energy_limit=0.25)
    law = dd.JointRegulation(s.dyn, stiffness, 0.7)
    plant = Sampled(s.oracle, START[robot.id])
    largest = 0.0
    law.require_stable(plant.q, period)
    for _ in range(round(shortened(0.5, 0.25) / period)):
        command = law.command(plant.q, plant.qd, target)
        plant.advance(filters.filter(plant.q, plant.qd, command, period).effort, period)
        largest = max(largest, plant.kinetic_energy)
    return largest


@pytest.mark.parametrize(
    ("robot", "stiffness", "period"),
    [(UR5, 600.0, 1e-3), (UR5, 200.0, 8e-3), (PANDA, 600.0, 4e-3), (Z1, 200.0, 2e-3)],
)
def test_a_sampled_loop_keeps_the_limit(robot, stiffness, period):
    """K of a jump of 0.8 rad comes near its limit and exceeds it by less than 2 %, by Pinocchio."""
    assert 0.24 < swing_to(robot, stiffness, period) < 1.02 * 0.25


def test_saturation_scales_what_moves_and_not_what_holds():
    """Within the limits, τ − g is scaled by the largest factor in [0, 1] that suffices; the sign of
    the power stays.

    A clip of each joint alone would turn the braking of some commands into driving.
    """
    s = arm()
    acted = 0
    driving = 0
    for rng, q, qd, command in commands(200):
        limit = np.abs(command.gravity_torque) / 0.9 + np.exp(rng.uniform(-2, 7)) * rng.uniform(
            0.5, 1, N
        )
        limits = dd.Limits(s.dyn, effort_limit=limit, effort_rate=1e12)
        effort, _, _, limited, *_ = limits.filter(q, qd, command, PERIOD)
        g = command.gravity_torque
        rest = command.tau - command.gravity_torque
        assert (np.abs(effort) <= limit * (1.0 + 1e-15)).all() and 0.0 <= limits.scale <= 1.0
        np.testing.assert_allclose(
            effort, g + limits.scale * rest, atol=1e-11 * np.abs(command.tau).max()
        )
        driving += (qd @ (np.clip(command.tau, -limit, limit) - g)) * (qd @ rest) < 0.0
        at_limit = np.isclose(np.abs(effort), limit, rtol=1e-12)
        if limits.scale == 1.0:
            assert not at_limit.any() and limited == ()
        else:
            acted += 1
            assert (
                limited
                == tuple(n for n, x in zip(s.model.dof_names, at_limit, strict=True) if x)
                != ()
            )
    assert 100 < acted < 200 and driving > 0


@pytest.mark.parametrize("compensated", [False, True])
def test_efforts_move_at_their_rates(compensated):
    """Each joint moves to its effort at its rate and reaches it, from gravity compensation or the
    given effort on.
    """
    s = arm()
    rng = np.random.default_rng(4)
    rate = rng.uniform(100, 1000, N)
    gravity = s.oracle.gravity_torque(READY)
    limits = dd.Limits(s.dyn, effort_rate=rate, compensated=compensated)
    last = np.zeros(N) if compensated else gravity
    command = dd.GravityCompensation(s.dyn).command(READY, np.zeros(N))
    for k in range(2000):
        h = rng.uniform(0, 4e-3)
        if k % 1000 == 0:  # it demands a fast change, for which the law is scaled for a second
            moving = rng.uniform(-8, 8, N)
        pushing = command._replace(tau=gravity + moving)
        effort, demand, *_, limited, _, _ = limits.filter(READY, np.zeros(N), pushing, h)
        assert (np.abs(effort - last) <= rate * h * (1 + 1e-12) + 1e-14).all()
        late = np.array(s.model.dof_names)[np.abs(effort - demand) > 1e-9]
        assert set(late) <= set(limited)
        last = effort.copy()
        effort[:] = 0.0  # the caller's own
    np.testing.assert_allclose(last, moving + (not compensated) * gravity, atol=1e-9)
    assert limited == ()
    limits.reset(np.full(N, 20.0))
    assert limits.ramp(np.full(N, 50.0), 1e-3) == pytest.approx(20.0 + 1e-3 * rate)


def released(robot, stiffness, period, away, start="gravity", seconds=1.0, rate=1e3, **options):
    """Return K [J] of a sampled loop released at rest and away from its set-point, and the last
    distance from it.

    Efforts begin at gravity compensation, or at a law's command.
    """
    s = subject(robot)
    target = START[robot.id]
    law = dd.JointRegulation(s.dyn, stiffness, 0.7)
    plant = Sampled(s.oracle, target + away)
    law.require_stable(plant.q, period)
    limits = dd.Limits(s.dyn, effort_rate=rate, **options)
    energies = []
    if start == "command":
        command = law.command(plant.q, plant.qd, target)
        at_once = dd.Limits(s.dyn, effort_rate=1e9, **options)
        limits.reset(at_once.filter(plant.q, plant.qd, command, period).effort)
    for _ in range(round(seconds / period)):
        command = law.command(plant.q, plant.qd, target)
        plant.advance(limits.filter(plant.q, plant.qd, command, period).effort, period)
        energies.append(plant.kinetic_energy)
    return np.array(energies), np.abs(plant.q - target).max()


def test_a_joint_that_scales_the_law_is_limited():
    """It demands too much in three successive cycles, though its effort arrives in each. The law is
    scaled no longer once it rests.
    """
    s = arm()
    limited = []
    limits = dd.Limits(s.dyn, effort_rate=1000.0)
    command = gravity_command(s)
    for k in range(1000):
        tau = command.tau.copy()
        tau[2] += 0.7 if k < 20 and k % 2 else 0.0
        sent = limits.filter(READY, np.zeros(N), command._replace(tau=tau), PERIOD)
        np.testing.assert_allclose(sent.effort, sent.demand)
        limited.append(sent.limited)
    assert set(limited[3:20]) == {("panda_joint3",)} and {*limited[:3], limited[-1]} == {()}


def test_a_large_effort_rate_does_not_stop_an_arm():
    """All joints brake at once in the prediction, light ones of an xArm beside heavy ones."""
    dyn = dd.DiagonalDynamics(dd.load_robot("xarm7"))
    q = np.full(N, 0.3)
    rest = np.zeros(N)
    law = dd.JointRegulation(dyn, [20.0, 20.0, 10.0, 10.0, 2.0, 2.0, 1.0], 1.0)
    limits = dd.Limits(dyn, energy_limit=0.1, effort_rate=1e9)
    plant = dd.Simulation(dyn.model, q=q, limits=False, friction=rest, damping=rest)
    energies = []
    for _ in range(50):
        command = law.command(plant.q, plant.qd, q + 0.5)
        plant.advance(limits.filter(plant.q, plant.qd, command, 8e-3).effort, steps=8)
        energies.append(plant.kinetic_energy)
    assert 0.098 < max(energies) < 0.102


def test_noise_does_not_weaken_a_law():
    """Rates are measured with a noise of 5 mrad/s, as of a differentiated encoder."""
    s = subject(UR5)
    rng = np.random.default_rng(3)
    law = dd.JointRegulation(s.dyn, 300.0, 0.7)
    limits = dd.Limits(s.dyn)
    q = START[UR5.id]
    demanded = []
    passed = []
    for _ in range(1000):
        command = law.command(q, rng.normal(0.0, 5e-3, len(q)), q)
        demanded.append(command.tau - command.gravity_torque)
        passed.append(limits.filter(q, 0.0 * q, command, 1e-3).demand - command.gravity_torque)
    assert np.sum(np.multiply(passed, demanded)) > 0.95 * np.sum(np.square(demanded))


def test_braking_keeps_the_effort_limit():
    """A joint whose weight exceeds its effort limit is braked within this limit."""
    s = subject(UR5)
    q = START[UR5.id]
    limit = np.where(np.arange(len(q)) == 1, 0.5, 1.0) * np.abs(s.oracle.gravity_torque(q)) + 1.0
    limits = dd.Limits(s.dyn, energy_limit=0.25, effort_limit=limit)
    law = dd.RateDamping(s.dyn, 10.0)
    plant = Sampled(s.oracle, q)
    for _ in range(100):
        effort = limits.filter(plant.q, plant.qd, law.command(plant.q, plant.qd), 1e-3).effort
        assert (np.abs(effort) <= limit * (1.0 + 1e-12)).all()
        plant.advance(effort, 1e-3)
    assert plant.kinetic_energy > 0.25


def test_braking_near_an_effort_limit_lowers_the_energy():
    """Gravity takes a joint out of the common scale of efforts, not out of that of braking.

    K returns to its limit at the rate of the filter, no faster.
    """
    s = subject(UR5)
    q = START[UR5.id]
    rng = np.random.default_rng(0)
    limit = np.where(np.arange(6) == 1, np.abs(s.oracle.gravity_torque(q)) / 0.92, 40.0)
    law = dd.GravityCompensation(s.dyn)
    for _ in range(40):
        plant = Sampled(s.oracle, q)
        plant.qd = rng.normal(size=6)
        energy = plant.kinetic_energy
        limits = dd.Limits(s.dyn, energy_limit=energy / 2, effort_limit=limit, effort_rate=1e9)
        for _ in range(3):
            command = law.command(plant.q, plant.qd)
            plant.advance(limits.filter(plant.q, plant.qd, command, 4e-3).effort, 4e-3)
            assert plant.kinetic_energy < energy
        assert plant.kinetic_energy > 0.7 * energy  # (1 + 0.8³)/2 = 0.756


def test_braking_removes_driving_efforts():
    """Joint 3 turns against its momentum, so that its effort on the way to rest drives."""
    s = arm()
    q = np.where(np.arange(N) == 1, 0.3, READY)
    qd = np.array([-5.7, 0.0, 5.1, 0.0, 0.0, 0.0, 0.0])
    moving = np.array([8.0, 0.0, 13.0, 0.0, 0.0, 0.0, 0.0])
    truth = s.oracle.at(q, qd)
    g = s.oracle.gravity_torque(q)
    energy = 0.5 * np.sum((truth.m.T @ qd) ** 2)
    limits = dd.Limits(s.dyn, energy_limit=energy, start=g + moving)
    command = dd.GravityCompensation(s.dyn).command(q, qd)._replace(tau=g + 3.0 * moving)
    effort = limits.filter(q, qd, command, PERIOD).effort - g
    assert effort @ qd < moving @ qd - 10.0


WRISTS = np.array([0.0, 0.0, 0.0, 0.3, -0.3, 0.3])


@pytest.mark.parametrize(
    ("robot", "stiffness", "period", "away", "start", "rate", "bound"),
    [
        (UR5, 300.0, 1e-3, WRISTS, "gravity", 1e3, 0.255),
        (UR5, 300.0, 1e-3, WRISTS, "command", 1e3, 1.1),
        (UR5, 200.0, 8e-3, 0.8, "command", 1e3, 0.255),
        (UR5, 100.0, 1e-3, 0.8, "gravity", 50.0, 0.255),  # 0.2 s of braking
        (PANDA, 600.0, 4e-3, 0.8, "gravity", 1e3, 0.255),
        (Z1, 600.0, 1e-3, 0.3, "gravity", 1e3, 0.255),
    ],
)
def test_a_rate_limit_keeps_the_energy_limit(robot, stiffness, period, away, start, rate, bound):
    """Efforts begin at gravity compensation, or at a command that cannot be removed in time."""
    seconds = shortened(1.0, 0.3)
    energies, _ = released(robot, stiffness, period, away, start, seconds, rate, energy_limit=0.25)
    assert 0.2 < energies.max() < bound and energies[-1] < 0.255


@pytest.mark.parametrize(
    ("robot", "stiffness", "period", "away", "start"),
    [
        (UR5, 300.0, 1e-3, WRISTS, "command"),
        (PANDA, 600.0, 4e-3, 0.3, "gravity"),
        (Z1, 100.0, 2e-3, 0.3, "command"),
    ],
)
def test_a_rate_limit_alone_comes_to_rest(robot, stiffness, period, away, start):
    """A law that demands faster efforts than the limit's is scaled: no energy remains, and the
    target is reached.
    """
    energies, distance = released(robot, stiffness, period, away, start, 2.0)
    assert energies.max() > 0.2 and energies[-1] < 1e-3 and distance < 0.01


def effort_of(springs, q, qd):
    """Return the efforts that springs add in a cycle so short that no impulse is too large."""
    command = dd.GravityCompensation(springs.dynamics).command(q, qd)
    return springs.filter(q, qd, command, 1e-6).tau - command.tau


def energy_of(springs, margin, q):
    """Return the energy of springs whose force does not grow beyond a limit [J]."""
    model = springs.dynamics.model
    beyond = np.maximum(np.maximum(q - model.upper, model.lower - q) + margin, 0.0)
    depth = np.minimum(beyond, margin)
    return springs.stiffness @ (0.5 * depth**2 + margin * (beyond - depth))


def test_repulsion_is_the_gradient_of_its_potential():
    s = arm()
    rng = np.random.default_rng(6)
    margin = 0.3
    springs = dd.PositionRepulsion(s.dyn, margin, rng.uniform(10, 100, N), 5.0)
    for _ in range(20):
        q = rng.uniform(s.model.lower - 0.1, s.model.upper + 0.1)
        qd = rng.normal(size=N)
        steps = 1e-6 * np.eye(N)
        energies = [[energy_of(springs, margin, q + sign * h) for h in steps] for sign in (1, -1)]
        effort = effort_of(springs, q, np.zeros(N))
        np.testing.assert_allclose(effort, -np.subtract(*energies) / 2e-6, atol=1e-6)
        inside = (q > s.model.lower + margin) & (q < s.model.upper - margin)
        assert not effort_of(springs, q, np.ones(N))[inside].any()
        damped = effort_of(springs, q, qd) - effort
        assert (damped * qd <= 1e-12).all()
        upper = q > s.model.upper - margin
        lower = q < s.model.lower + margin
        back = np.where(upper, qd, -qd) <= 0.0
        assert np.abs(damped[(upper | lower) & back]).max(initial=0.0) < 1e-3  # is free
        command = dd.GravityCompensation(s.dyn).command(q, qd)
        filtered = springs.filter(q, qd, command, 1e-6)
        np.testing.assert_allclose(
            s.oracle.at(q, qd).m @ filtered.epsilon, filtered.tau - command.tau, atol=1e-9
        )
    q = 0.5 * (s.model.lower + s.model.upper)
    command = dd.GravityCompensation(s.dyn).command(q, np.ones(N))
    assert springs.filter(q, np.ones(N), command, PERIOD) is command


@pytest.mark.parametrize(("begins", "energy", "speed"), [(False, 0.016, 10.0), (True, 1e-6, 0.05)])
def test_repulsion_does_not_drive_a_light_joint(begins, energy, speed):
    """A wrist of 0.8 g m² between its limits at 250 Hz, under gravity compensation.

    No joint is thrown where the filter begins in the margin.
    """
    s = subject(Z1)
    q = START[Z1.id].copy()
    largest = 0.0
    limits = dd.Limits(s.dyn, margin=0.1, effort_rate=1e6)
    law = dd.GravityCompensation(s.dyn)
    if not begins:
        limits.filter(q, 0.0 * q, law.command(q, 0.0 * q), 4e-3)
    q[5] = s.model.upper[5] - 0.05
    plant = Sampled(s.oracle, q)
    fastest = 0.0
    for _ in range(500):
        command = law.command(plant.q, plant.qd)
        plant.advance(limits.filter(plant.q, plant.qd, command, 4e-3).effort, 4e-3)
        largest = max(largest, plant.kinetic_energy)
        fastest = max(fastest, np.abs(plant.qd).max())
    assert 0.5 * energy < largest < energy and fastest < speed
    assert begins or plant.kinetic_energy < 0.2 * largest


def test_springs_are_not_scaled_with_a_fast_law():
    """A law whose efforts change too fast is scaled; springs before position limits stay as stiff
    as they are.
    """
    s = arm()
    q = READY.copy()
    rest = np.zeros(N)
    limits = dd.Limits(arm().dyn, margin=0.1)
    limits.filter(q, rest, dd.GravityCompensation(s.dyn).command(q, rest), PERIOD)
    q[3] = s.model.upper[3] - 0.05
    command = dd.GravityCompensation(s.dyn).command(q, rest)
    for sign in 20 * [1.0, -1.0]:
        fast = command._replace(tau=command.tau + sign)
        pushed = limits.filter(q, rest, fast, PERIOD).demand
    stiffness = 5.0 * s.model.effort_limit  # half of the effort limit at the position limit
    springs = dd.PositionRepulsion(s.dyn, 0.1, stiffness).filter(q, rest, command, PERIOD)
    assert springs.tau[3] < command.tau[3] - 1.0 and np.abs(pushed - springs.tau).max() < 0.6
    np.testing.assert_allclose(limits.filter(q, rest, command, PERIOD).demand, springs.tau)


def test_repulsion_where_there_is_little_or_no_range():
    """Continuous joints have no springs, a margin is at most half of a range, and a joint without
    one is an error.
    """
    model = dd.load_urdf(TREE.source, **TREE.options)
    springs = dd.PositionRepulsion(dd.DiagonalDynamics(model), 50.0, 1.0)
    turns = ~np.isfinite(model.upper)
    assert (
        turns.any() and not effort_of(springs, np.where(turns, 1e3, 0.0), np.zeros(model.nv)).any()
    )
    narrow = PANDA.urdf.replace('lower="-3.0718" upper="-0.0698"', 'lower="-1.0" upper="-1.0"')
    dyn = dd.DiagonalDynamics(dd.load_urdf(narrow, **PANDA.options))
    with pytest.raises(InputError, match="'panda_joint4' has limits"):
        dd.PositionRepulsion(dyn, 0.1, 10.0)


LIMITS = dd.ContactLimits(
    {"energy": {"energy": 0.3}, "force": {"mass": 4.0, "stiffness": 3e4, "force": 80.0}}
)


@cache
def contact_points():
    """Return points of all links with limits of energy and force."""
    model = arm().model
    return dd.ContactPoints(
        model, dd.link_geometry(model, PANDA.urdf, "frames").points, LIMITS, "limit"
    )


class Swing:
    """A tracked motion of all joints at speeds that exceed the limits; `limiter` filters its
    commands.
    """

    def __init__(self, seed, h, limiter=None):
        s = arm()
        rng = np.random.default_rng(seed)
        self.h = h
        self.limiter = limiter
        self.law = dd.JointTracking(s.dyn, 20.0, 10.0)
        self.centre = np.clip(0.5 * (s.model.lower + s.model.upper), -2, 2)
        self.size = 0.5 * rng.uniform(0.5, 1, N)
        self.pace = rng.uniform(1, 3, N)
        self.phase = rng.uniform(0, 6, N)
        self.plant = plant(self.centre + self.size * np.sin(self.phase), np.zeros(N), h)
        self.k = 0
        self.limited = 0

    def step(self):
        """Run one cycle; return the largest ratio of speed to limit, and the command after and
        before the filter.
        """
        angle = self.pace * self.k * self.h + self.phase
        q = self.plant.q
        qd = self.plant.qd
        sine = self.size * np.sin(angle)
        cosine = self.size * np.cos(angle)
        asked = self.law.command(
            q, qd, self.centre + sine, self.pace * cosine, -(self.pace**2) * sine
        )
        command = self.limiter.filter(q, qd, asked, self.h) if self.limiter else asked
        self.plant.advance(command.tau)
        self.k += 1
        self.limited += command is not asked
        return arm().dyn.contact_limits(q, qd, contact_points()).usage.max(), command, asked


def contact_limiter():
    return dd.ContactLimiter(arm().dyn, contact_points(), 30.0)


@pytest.mark.parametrize(("h", "scale"), [(1e-3, 1.0), (4e-3, 0.7)])
def test_no_contact_limit_is_exceeded(h, scale):
    """Motions that would exceed the limits stay below them; the limiter takes power out of ν alone.

    ½mv² stays below the energy and v√(μk) below the force, by the mass and speed at every point.
    """
    dyn = arm().dyn
    q = arm().model.neutral + 0.1
    limiter = contact_limiter()
    resting = dd.GravityCompensation(dyn).command(q, np.zeros(N))
    assert limiter.filter(q, np.zeros(N), resting, h) is resting
    assert limiter.seen.link == "" and limiter.seen.energy == 0.0
    limiter.scale = scale
    free = Swing(0, h)
    bound = Swing(0, h, limiter)
    usage = []
    steps = range(int(shortened(1.0, 0.5) / h))
    assert max(free.step()[0] for _ in steps) > 1.3
    for k in steps:
        q = bound.plant.q
        qd = bound.plant.qd
        part, command, asked = bound.step()
        usage.append(part)
        assert (command.epsilon - asked.epsilon) @ asked.nu < 1e-6
        for link in ("panda_link4", "panda_hand") if k % 10 == 0 else ():
            v = dyn.link_velocity(q, link, qd)[:3]
            if v.any():
                m = dyn.reflected_mass(q, link, v)
                force = np.linalg.norm(v) * np.sqrt(3e4 / (1.0 / m + 1.0 / 4.0))
                assert 0.5 * m * v @ v <= 0.3 * scale**2 and force <= 80.0 * scale
    assert 0.9 < max(usage) / scale <= 0.991 and bound.limited > 10
    difference = dyn.tau_from_epsilon(q, command.epsilon - asked.epsilon)
    np.testing.assert_allclose(
        command.tau - asked.tau, difference, atol=0.05 * np.linalg.norm(difference) + 1e-9
    )


def test_a_push_adds_to_the_contact_energy():
    """The energy of a push exceeds the bound and is reported; with a known push nothing exceeds the
    bound.
    """
    dyn = arm().dyn
    law = dd.JointTracking(dyn, 20.0, 10.0)
    push = dyn.jacobian(READY, "panda_hand", frame="world")[:3].T @ np.array([60.0, 40.0, 0.0])
    for is_known in (False, True):
        limiter = contact_limiter()
        robot = plant(READY, np.zeros(N))
        usage = []
        for _ in range(60):
            q = robot.q
            qd = robot.qd
            asked = law.command(q, qd, q, np.zeros(N), np.zeros(N))
            external = dyn.epsilon_from_tau(q, push) if is_known else None
            robot.advance(limiter.filter(q, qd, asked, 1e-3, external).tau + push)
            usage.append(limiter.seen.contact.usage.max())
        assert (max(usage) > 1.05) != is_known
        assert is_known or limiter.seen.energy > limiter.seen.limit


HURT = np.where(np.arange(N) == 2, np.nan, 1.0)


def gravity_command(s):
    return dd.GravityCompensation(s.dyn).command(READY, np.ones(N))


def without_limits(s):
    return dd.ContactPoints(s.model, [("tip", "panda_hand")])


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda s: dd.EnergyLimiter(s.dyn, 0.0, 1.0), "limit is 0.0"),
        (lambda s: dd.EnergyLimiter(s.dyn, joint_limit=-HURT), "joint_limit of 'panda_joint1'"),
        (lambda s: dd.EnergyLimiter(s.dyn, 1.0, rate=np.nan), "rate is nan"),
        (
            lambda s: dd.EnergyLimiter(s.dyn).filter(
                READY, READY, gravity_command(s), PERIOD, HURT
            ),
            "external of joint 'panda_joint3' is nan",
        ),
        (
            lambda s: dd.Limits(s.dyn, effort_limit=HURT),
            "effort_limit of 'panda_joint3' is nan",
        ),
        (
            lambda s: dd.Limits(s.dyn).filter(HURT, READY, gravity_command(s), PERIOD),
            "q of joint 'panda_joint3' is nan",
        ),
        (
            lambda s: dd.Limits(s.dyn).filter(READY, HURT[:2], gravity_command(s), PERIOD),
            r"qd has shape \(2,\)",
        ),
        (lambda s: dd.Limits(s.dyn, effort_rate=-HURT), "effort_rate of 'panda_joint1' is -1.0"),
        (lambda s: dd.Limits(s.dyn, start=HURT), "effort of joint 'panda_joint3' is nan"),
        (
            lambda s: dd.Limits(s.dyn).filter(READY, READY, gravity_command(s), -1.0),
            "period is -1.0",
        ),
        (
            lambda s: dd.Limits(s.dyn).filter(
                READY, READY, gravity_command(s)._replace(gravity_torque=HURT[:2]), PERIOD
            ),
            r"command.gravity_torque has shape \(2,\)",
        ),
        (
            lambda s: dd.Limits(s.dyn).filter(
                READY, READY, gravity_command(s)._replace(tau=READY[:2]), PERIOD
            ),
            r"command.tau has shape \(2,\)",
        ),
        (lambda s: dd.PositionRepulsion(s.dyn, 0.0, 1.0), "margin of 'panda_joint1' is 0.0"),
        (
            lambda s: dd.PositionRepulsion(s.dyn, 0.1, 1.0, -1.0),
            "damping of 'panda_joint1' is -1.0",
        ),
        (lambda s: dd.ContactLimiter(s.dyn, without_limits(s), 30.0), "no limit"),
        (lambda s: dd.ContactLimiter(s.dyn, contact_points(), 0.0), "rate"),
        (lambda s: setattr(contact_limiter(), "scale", 1.5), "scale"),
        (lambda s: contact_limiter().filter(READY, np.zeros(N), gravity_command(s), 0.0), "period"),
    ],
)
def test_errors_name_the_argument(make, key):
    with pytest.raises(InputError, match=key):
        make(arm())
