# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A step of order 1, semi-implicit Euler on (q, q̇), with friction, compliant limits and impacts at hard ones."""

import math

from diag_dynamics.numerics.kernel import kernel, large_kernel
from diag_dynamics.simulation import flexible
from diag_dynamics.simulation.memory import DAMPING, EFFORT, FRICTION, LIMITS, WRENCHES, opened
from diag_dynamics.simulation.modes import HELD, classify_joints, is_tied, solve_stiction
from diag_dynamics.simulation.runge_kutta import wrench_efforts
from diag_dynamics.sweeps import classical, factorization, groups, kinematics
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.records import FLOATING

UNMOVED = 1e-6
"""Change of rate by an impact, relative to the largest one, below which a joint at rest stays at rest."""

SHORT = 1e-2
"""Fraction of a step: a joint that friction stops within it counts as not moved by an impact."""


@large_kernel
def euler_step(address, h, load):
    """Step (q, q̇), and add the work done to the accounts; ν is scratch. Return a status."""
    sim, tau = opened(address), load.tau
    ws.copy(sim.q, sim.first_q)
    ws.copy(sim.qd, sim.before)
    has_modes, has_springs = classify_joints(address)
    status, touching = wrench_efforts(address, sim.q, load, sim.pushed), True
    while touching and status == 0:
        status = (
            solve_stiction(address, h, tau)
            if has_modes or has_springs
            else _free_rates(address, h, tau)
        )
        touching = status == 0 and _touches_spring(address, h)
        has_springs |= touching
    if status == 0:
        status = _move(address, h, tau)
    if status == 0 and has_modes:
        status = _account_for_friction(address, h)
    account_for_left_springs(address)
    if status == 0 and is_beyond_hard_limit(address):
        status = factorization.nu_from_qd(sim.robot, sim.q, sim.qd, sim.nu)
        if status == 0:
            status = resolve_impacts(address, h)
    return status


@large_kernel
def _free_rates(address, h, tau):
    """Rates after a step of joints that only have dampers: (M + h d) q̈ = τ − d q̇ − c − g."""
    sim = opened(address)
    flexible.eliminate_motors(address, h, tau)
    for k in range(len(tau)):
        sim.effort[k] = sim.link_effort[k] + sim.pushed[k] - sim.damping[k] * sim.qd[k]
        sim.added[k] = h * sim.damping[k] + sim.reflected[k]
    status = classical.accelerations_with_added_inertia(
        sim.robot, sim.q, sim.qd, sim.effort, sim.added, sim.qdd
    )
    for k in range(len(tau)):
        sim.after[k] = sim.qd[k] + h * sim.qdd[k]
    return status


@large_kernel
def _touches_spring(address, h):
    """Set the spring of joints that pass a compliant limit in the step; return whether any does."""
    sim = opened(address)
    found = False
    for k in range(len(sim.after)):
        x, rate, lower, upper = sim.q[sim.coordinate[k]], sim.after[k], sim.lower[k], sim.upper[k]
        side = 1.0 if x + h * rate > upper else -1.0 if x + h * rate < lower else 0.0
        if side * rate > 0.0 and sim.spring[k] == 0.0 and sim.stiffness[k] < math.inf:
            sim.spring[k], found = side, True
            sim.depth[k] = x - (upper if side > 0.0 else lower)
    return found


@large_kernel
def _move(address, h, tau):
    """Move with the rates `after` to the end of the step; add all work but that of friction."""
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    for k in range(len(tau)):
        sim.u[k] = h * sim.after[k]
    _turn_floating_velocities(address, h)
    ws.copy(sim.after, sim.qd)
    kinematics.integrate_positions(bodies, sim.q, sim.u, sim.q)
    effort, damping, limits, wrenches = 0.0, 0.0, 0.0, 0.0
    for k in range(len(tau)):
        qd, u = sim.qd[k], sim.u[k]
        if not (math.isfinite(u) and math.isfinite(sim.q[k])):
            return -1
        if sim.rotor_inertia[k] > 0.0:
            damping -= flexible.move_motor(address, k, h, tau[k])
        effort += tau[k] * (h * sim.thetad[k] if sim.rotor_inertia[k] > 0.0 else u)
        wrenches += sim.pushed[k] * u
        damping -= sim.damping[k] * qd * u
        if sim.spring[k] != 0.0:  # work of its force at the end, and elastic energy
            stiffness, side, end = sim.stiffness[k], sim.spring[k], sim.depth[k] + u
            limits -= (sim.limit_damping[k] * qd + stiffness * end) * u
            start, end = (
                (sim.depth[k], end) if not is_tied(sim, k) else (abs(sim.depth[k]), abs(end))
            )
            limits += _stored(stiffness, side * end) - _stored(stiffness, side * start)
    sim.accounts[EFFORT] += effort
    sim.accounts[WRENCHES] += wrenches
    sim.accounts[DAMPING] += damping
    sim.accounts[LIMITS] += limits
    return 0


@large_kernel
def _turn_floating_velocities(address, h):
    """Turn the linear velocity of floating joints into their axes at the end of the step.

    Their displacement u takes the mean of both ends. v̇ in a body's axes is the acceleration less
    ω × v: with that term an explicit step would increase a large velocity.
    """
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    qd, after, u = sim.qd, sim.after, sim.u
    for i in range(1, len(bodies)):
        k = bodies[i].dof
        if bodies[i].kind != FLOATING or bodies[i].rank != 0:
            continue
        moving = True
        for j in range(k, k + 6):
            moving &= sim.mode[j] != HELD
        if not moving:
            continue
        before = sp.cross((qd[k + 3], qd[k + 4], qd[k + 5]), (qd[k], qd[k + 1], qd[k + 2]))
        v = sp.add((after[k], after[k + 1], after[k + 2]), sp.scale(before, h))
        x, y, z, w = sp.rotation_quaternion(
            (-h * after[k + 3], -h * after[k + 4], -h * after[k + 5])
        )
        turned = sp.apply(sp.rotation_of_quaternion(x, y, z, w), v)
        after[k], after[k + 1], after[k + 2] = turned
        u[k], u[k + 1], u[k + 2] = sp.scale(sp.add(v, turned), 0.5 * h)


@large_kernel
def _account_for_friction(address, h):
    """Add the work of friction: impulse times mean rate; of stopped joints their kinetic energy."""
    sim = opened(address)
    stopping, work, stopped, status = False, 0.0, 0.0, 0
    for k in range(len(sim.qd)):
        before, mode = sim.before[k], sim.mode[k]
        stopping |= mode == HELD and before != 0.0
        if abs(mode) == 1.0:
            mean = 0.5 * h * (before + sim.qd[k]) if before * mode >= 0.0 else sim.u[k]
            work -= sim.friction[k] * mode * mean
    if stopping:
        status = classical.inverse_dynamics(
            sim.robot, sim.first_q, sim.zeros, sim.before, 0.0, sim.momentum
        )
        for k in range(len(sim.qd)):
            if sim.mode[k] == HELD:
                stopped += 0.5 * sim.before[k] * (sim.needed[k] - sim.momentum[k])
    sim.accounts[FRICTION] += work + min(0.0, stopped)
    return status


@kernel
def _stored(stiffness, depth):
    """Energy [J] of a compliant limit at a depth [rad, m]."""
    return 0.5 * stiffness * depth * depth if depth > 0.0 else 0.0


@large_kernel
def account_for_left_springs(address):
    """Add the lost elastic energy of compliant limits from which joints have lifted off."""
    sim = opened(address)
    for k in range(len(sim.spring)):
        if sim.spring[k] == 0.0 and sim.stiffness[k] < math.inf:
            q, first_q = sim.q[sim.coordinate[k]], sim.first_q[sim.coordinate[k]]
            now, before = (
                max(q - sim.upper[k], sim.lower[k] - q),
                max(first_q - sim.upper[k], sim.lower[k] - first_q),
            )
            sim.accounts[LIMITS] += _stored(sim.stiffness[k], now) - _stored(
                sim.stiffness[k], before
            )


@kernel
def kinetic_energy(nu):
    """½νᵀν [J]."""
    energy = 0.0
    for k in range(len(nu)):
        energy += 0.5 * nu[k] * nu[k]
    return energy


@large_kernel
def _energy(address):
    """Kinetic and potential energy [J], ½νᵀν − g·Σ m c, and that of springs."""
    sim = opened(address)
    _, gravity, _, _ = ws.opened(sim.robot)
    classical.first_moment(sim.robot, sim.q, sim.moment)
    potential = -(
        gravity[0] * sim.moment[0] + gravity[1] * sim.moment[1] + gravity[2] * sim.moment[2]
    )
    return kinetic_energy(sim.nu) + potential + flexible.stored_energy(address)


@large_kernel
def is_beyond_hard_limit(address):
    """Whether a joint is beyond a hard limit."""
    sim = opened(address)
    beyond = False
    for k in range(len(sim.lower)):
        q = sim.q[sim.coordinate[k]]
        beyond |= (q < sim.lower[k] or q > sim.upper[k]) and sim.stiffness[k] == math.inf
    return beyond


@large_kernel
def resolve_impacts(address, h):
    """Move joints beyond hard limits back to them, and stop their outward motion by impulses.

    The impulse of one joint can move another one outward at its own limit: that one is stopped,
    too. No friction withstands an impulse, so joints at rest can start to move. Those below the
    thresholds UNMOVED and SHORT stay at rest. Uses ν; returns a status.
    """
    sim = opened(address)
    energy = _energy(address)
    ws.clear(sim.locks)
    ws.copy(sim.qd, sim.before)
    for k in range(len(sim.locks)):
        if sim.stiffness[k] == math.inf:
            c = sim.coordinate[k]
            sim.q[c] = min(max(sim.q[c], sim.lower[k]), sim.upper[k])
    status = factorization.qd_from_nu(sim.robot, sim.q, sim.nu, sim.qd)
    while status == 0 and _lock_stopped(address, h):
        status = factorization.tau_from_epsilon(sim.robot, sim.q, sim.nu, sim.momentum)
        if status == 0:
            status = factorization.qd_from_momentum(
                sim.robot, sim.q, sim.locks, sim.momentum, sim.qd
            )
        for k in range(len(sim.qd)):
            if sim.locks[k] != 0.0:
                sim.qd[k] = 0.0
        if status == 0:
            status = factorization.nu_from_qd(sim.robot, sim.q, sim.qd, sim.nu)
    sim.accounts[LIMITS] += _energy(address) - energy
    return status


@large_kernel
def _lock_stopped(address, h):
    """Mark in `locks` the joints that an impact stops; return whether there are new ones."""
    sim = opened(address)
    bodies, _, work, _ = ws.opened(sim.robot)
    largest, found = 0.0, False
    for k in range(len(sim.qd)):
        largest = max(largest, abs(sim.qd[k] - sim.before[k]))
    for i in range(1, len(bodies)):
        k = bodies[i].dof
        if not groups.is_leader(bodies, i) or sim.locks[k] != 0.0:
            continue
        q, rate, D = sim.q[sim.coordinate[k]], sim.qd[k], work[i].D  # the joint's inertia or more
        stays = abs(rate) <= UNMOVED * largest or D * abs(rate) <= SHORT * h * sim.friction[k]
        stopped = sim.before[k] == 0.0 and stays
        if sim.stiffness[k] == math.inf:
            stopped |= (q == sim.lower[k] and rate < 0.0) or (q == sim.upper[k] and rate > 0.0)
        if stopped:
            sim.locks[k], found = math.inf, True
    return found
