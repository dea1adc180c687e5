# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Energy tank: a ledger of the port's work bounds the energy that a person or a remote device
extracts from an arm.
"""

import numpy as np
import pytest

import diag_dynamics as dd
from arm import control_loop, state_at
from controlled import ARM, READY, TREE, UR5, Sampled, configuration, frictionless
from coupling import Coupled
from described import MS, S, subject
from diag_dynamics.exceptions import InputError
from examples import shortened

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

N, CAPACITY, RATE, PERIOD = 7, 0.5, 50.0, 1e-3


def tank_of(capacity=CAPACITY, robot=ARM):
    return dd.EnergyTank(subject(robot).dyn, capacity, RATE)


def plant_of(robot, q, qd=0.0, gravity=True):
    """Return a plant; of a robot that compensates gravity itself, one that weighs nothing."""
    options = {} if gravity else {"gravity": (0.0, 0.0, 0.0)}
    names = subject(robot).model.dof_names
    plant = Sampled(Coupled(robot.urdf, names, **robot.options, **options), q, 2.5e-4)
    plant.qd = plant.qd + qd
    return plant


@pytest.mark.parametrize("robot", (ARM, UR5, TREE))
@pytest.mark.parametrize("gravity", [True, False])
def test_the_measured_energy_is_exact(robot, gravity):
    """K + x changes by the work of external torques alone, for any held efforts, and positions that
    begin another turn.

    A robot that compensates gravity itself moves as if it weighed nothing.
    """
    s = subject(robot)
    rng = np.random.default_rng(3)
    nv = s.model.nv
    turns = ~np.isfinite(s.model.upper)
    start = np.where(turns, np.pi - 0.02, configuration(s.model, rng))
    plant = plant_of(robot, start, np.where(turns, 1.0, rng.normal(size=nv)), gravity)
    tank = dd.EnergyTank(s.dyn, 1e3, RATE, gravity)
    work = 0.0
    tau = None
    spent = []
    tank.energy = 500.0
    for _ in range(200):
        q = plant.q
        x = tank.measure(np.where(turns, np.remainder(q + np.pi, 2 * np.pi) - np.pi, q), tau)
        spent.append(x + plant.kinetic_energy - work)
        pulled = 2.0 * rng.normal(size=nv)
        tau = 10.0 * rng.normal(size=nv) + gravity * s.oracle.gravity_torque(q)
        plant.advance(tau + pulled, PERIOD)
        work += pulled @ (plant.q - q)
    np.testing.assert_allclose(spent, spent[0], rtol=0, atol=1e-8)
    assert abs(x - 500.0) > 0.02 and (plant.q[turns] > np.pi).all()


def test_what_exceeds_the_capacity_is_lost_and_changed_efforts_give_nothing_back():
    """Decision table of half a radian: x before, torque on the hand's joint, whether it was held, x
    after.
    """
    weightless = dd.DiagonalDynamics(subject(ARM).model.with_gravity((0.0, 0.0, 0.0)))
    tank = dd.EnergyTank(weightless, 2.0, RATE)
    q = READY
    assert tank.energy == 2.0
    table = [
        (1.0, 1.0, True, 0.5),
        (1.0, -1.0, True, 1.5),
        (1.0, -4.0, True, 2.0),
        (1.0, 4.0, True, -1.0),
        (1.0, 1.0, False, 0.5),
        (1.0, -1.0, False, 1.0),
    ]
    for before, torque, is_held, after in table:
        tank.energy = before
        assert tank.measure(q) == before
        q = q + 0.5 * np.eye(N)[6]
        assert tank.measure(q, torque * np.eye(N)[6], is_held) == pytest.approx(after, abs=1e-12)
    tank.fill()
    assert tank.energy == 2.0


def commands(count):
    """Yield random numbers, a state and a command, whose power is of either sign."""
    rng = np.random.default_rng(8)
    law = dd.GravityCompensation(subject(ARM).dyn)
    for _ in range(count):
        q = configuration(subject(ARM).model, rng)
        qd = rng.normal(size=N)
        command = law.command(q, qd)
        epsilon = np.exp(rng.uniform(-2, 6)) * rng.normal(size=N)
        yield (
            rng,
            q,
            qd,
            command._replace(
                tau=command.tau + subject(ARM).oracle.at(q, qd).m @ epsilon, epsilon=epsilon
            ),
        )


@pytest.mark.parametrize("pushed", [False, True])
def test_commands_of_the_filter(pushed):
    """Power and predicted work by Pinocchio's m, C and M: ε loses only power, then τ − g is scaled
    no more than needed.
    """
    h = 2e-3
    tank = tank_of()
    seen = np.zeros(3, int)
    for rng, q, qd, command in commands(300):
        t = subject(ARM).oracle.at(q, qd)
        nu = command.nu
        external = 5.0 * rng.normal(size=N) if pushed else None
        push = t.m @ external if pushed else np.zeros(N)
        tank.energy = CAPACITY * rng.choice([-0.1, 0.0, 1e-3, 0.05, rng.uniform(0.1, 1)])
        out = tank.filter(q, qd, command, h, external)
        power = nu @ command.epsilon
        covered = RATE * (tank.energy - 0.1 * CAPACITY)
        allowed = power if power <= covered else max(covered, min(power, 0.0) - RATE * nu @ nu)
        braked = command.epsilon + nu * (allowed - power) / (nu @ nu)
        scale = (out.epsilon @ braked) / (braked @ braked)
        np.testing.assert_allclose(
            out.epsilon, scale * braked, rtol=0, atol=1e-9 * np.abs(braked).max()
        )
        np.testing.assert_allclose(
            out.tau, t.m @ out.epsilon + t.g, rtol=0, atol=1e-8 * np.abs(command.tau).max()
        )

        def work(f, t=t, qd=qd, braked=braked, push=push):
            """Return the work [J] of a held effort by a step of second order."""
            effort = f * t.m @ braked
            return effort @ (
                h * qd + 0.5 * h * h * np.linalg.solve(t.M, effort + push - t.C_s @ qd)
            )

        x = max(tank.energy, 0.0)
        if scale > 1.0 - 1e-12:
            assert work(1.0) <= x + 1e-12
        else:
            assert work(scale) == pytest.approx(x, abs=1e-9) and scale >= 0.0 and work(1.0) > x
        seen += np.array([out is command, scale < 1.0 - 1e-9, abs(power - allowed) > 1e-6])
    assert (seen > 20).all()


@pytest.mark.parametrize("energy", [0.0, -0.2])
def test_an_empty_tank_brakes_and_holds(energy):
    """Damping and gravity compensation are unchanged; a far target moves a resting arm by no more
    than rounding and dt.
    """
    dyn = subject(ARM).dyn
    tank = tank_of()
    h = 1e-3
    tank.energy = energy
    for _, q, qd, command in commands(20):
        for law in (dd.RateDamping(dyn, 100.0), dd.GravityCompensation(dyn)):
            command = law.command(q, qd if isinstance(law, dd.RateDamping) else 0.0 * qd)
            assert tank.filter(q, qd, command, h) is command
    robot = frictionless(subject(ARM).model, READY, np.full(N, 0.5))
    law = dd.RateDamping(dyn, 10.0)
    tau = None
    K = robot.kinetic_energy
    for k in range(700):
        tank.measure(robot.q, tau)
        tank.energy = min(tank.energy, energy)  # it stays empty
        q = robot.q
        qd = robot.qd
        far = dd.JointTracking(dyn, 20.0, 10.0).command(q, qd, READY + 1.0)
        tau = tank.filter(q, qd, law.command(q, qd) if k < 500 else far, h).tau
        robot.advance(tau)
        if k == 499:
            rest = robot.q
    assert robot.kinetic_energy < 1e-3 * K and np.abs(robot.q - rest).max() < 2e-3
    np.testing.assert_allclose(tau, subject(ARM).oracle.gravity_torque(robot.q), atol=0.2)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda d: dd.EnergyTank(d, 0.0, 1.0), "capacity is 0.0"),
        (lambda d: dd.EnergyTank(d, 1.0, np.inf), "rate is inf"),
        (lambda d: tank_of().measure(READY[:3]), "q has shape"),
        (
            lambda d: (
                (tank := tank_of()).measure(READY) and tank.measure(READY, np.full(N, np.nan))
            ),
            "tau of joint",
        ),
        (
            lambda d: tank_of().filter(
                READY, READY, dd.GravityCompensation(d).command(READY, READY), 0.0
            ),
            "period is 0.0",
        ),
    ],
)
def test_errors_name_the_argument(make, key):
    with pytest.raises(InputError, match=key):
        make(subject(ARM).dyn)


# --- In the control loop


def loop_of(compensated=False, points=None, **values):
    """Return a loop of the arm, whose efforts have reached gravity compensation at READY."""
    values = {"following_energy": 0.0} | values
    loop = control_loop(subject(ARM).model, compensated, points, **values)
    loop.limits.reset(np.zeros(N) if compensated else subject(ARM).oracle.gravity_torque(READY))
    return loop


class Driven:
    """A loop on an arm without friction, with set-points at random."""

    def __init__(self, loop, seed=0, gravity=True):
        """Put the arm at rest."""
        self.loop = loop
        self.rng = np.random.default_rng(seed)
        self.stamp = S
        self.plant = plant_of(ARM, READY, gravity=gravity)

    def cycle(self, torque=0.0, valid=True):
        """Run a cycle with a state or without, and an external torque; return what was sent."""
        self.stamp += MS
        q = self.plant.q
        qd = self.plant.qd
        if valid:
            sent = self.loop.step(state_at(self.stamp, q, qd), self.stamp)
        else:
            sent = self.loop.without_state(self.stamp, "no state")
        self.plant.advance(sent.effort + torque, PERIOD)
        return sent

    def aim(self, size=0.8):
        """Choose another set-point."""
        model = subject(ARM).model
        self.loop.take_set_point(
            np.clip(READY + size * self.rng.uniform(-1, 1, N), model.lower, model.upper)
        )


@pytest.mark.parametrize("compensated", [False, True])
def test_the_loop_measures_what_it_sends(compensated):
    """Efforts at their rate and limits: K + x keeps the capacity; a mode fills x.

    Efforts of a robot with gravity compensation contain no weight and are the work.
    """
    driven = Driven(
        loop_of(
            compensated,
            tank_energy=CAPACITY,
            effort_rate=["*=500"],
            effort_limit=["*=60", "panda_joint5=12", "panda_joint6=12", "panda_joint7=12"],
            set_point_speed=1.0,
        ),
        gravity=not compensated,
    )
    tank = driven.loop.limits.tank
    refused = 0
    for k in range(shortened(2000, 800)):
        if k % 200 == 10:
            driven.aim()
        K = driven.plant.kinetic_energy
        sent = driven.cycle()
        refused += sent.energy_limited
        assert K + tank.energy == pytest.approx(CAPACITY, abs=1e-9)
    assert refused > 50 and driven.loop.energy > 1e-3
    driven.loop.switch("damping")
    assert tank.energy == CAPACITY


def test_a_hold_gives_nothing_back():
    """While states are missing, the last effort may have been replaced: only its positive work
    counts. A start fills x.
    """
    driven = Driven(loop_of(tank_energy=CAPACITY))
    tank = driven.loop.limits.tank
    for k in range(200):
        driven.cycle()
        if k == 10:
            driven.aim()
    assert tank.energy < CAPACITY - 0.01
    for sign in (1.0, -1.0):
        q = driven.plant.q
        effort = driven.cycle().effort
        x = tank.energy
        driven.cycle(valid=False)
        moving = effort - subject(ARM).oracle.gravity_torque(q)
        driven.plant.q = q + sign * 1e-3 * np.sign(moving)  # wherever the arm goes meanwhile
        U = dd.DiagonalDynamics(subject(ARM).model).potential_energy
        work = effort @ (driven.plant.q - q) - U(driven.plant.q) + U(q)
        driven.cycle()
        assert tank.energy == pytest.approx(x - max(work, 0.0), abs=1e-9) and work * sign > 0.0
    driven.loop.forget()
    driven.cycle()
    assert tank.energy == CAPACITY
