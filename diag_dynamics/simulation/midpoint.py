# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A step of order 2: the midpoint rule, with friction, compliant limits and impacts at hard ones.

Half a step from the start gives rates in the middle of the step; the impulse of the whole step is
that at this middle. Both solve for rates implicitly in springs and dampers. The first acts at its
end. In the second a joint has a weight w: with w = ½ its springs and dampers act at the middle,
which keeps the energy of springs, and with w = 1 at the end of the step, which damps motions that
are faster than the step.
"""

import math

from diag_dynamics.numerics.kernel import kernel, large_kernel
from diag_dynamics.simulation import flexible
from diag_dynamics.simulation.joint_modes import (
    FREE,
    HELD,
    classify_joints,
    solve_step,
    spring_start,
)
from diag_dynamics.simulation.step_memory import LOSS, WORK, opened
from diag_dynamics.sweeps import classical, factorization, groups, kinematics
from diag_dynamics.sweeps import workspace as ws

UNMOVED = 1e-6
"""Change of rate by an impact, relative to the largest, below which a joint stays at rest."""

SHORT = 1e-2
"""Fraction of a step: a joint that friction stops within it counts as not moved by an impact."""


@large_kernel
def midpoint_step(address, h, load):
    """Step (q, q̇), and add work and loss to the accounts; ν is scratch. Return a status."""
    sim = opened(address)
    ws.copy(sim.q, sim.first_q)
    ws.copy(sim.q, sim.place)
    ws.copy(sim.qd, sim.before)
    ws.copy(sim.qd, sim.middle)
    classify_joints(address)
    for k in range(len(sim.weight)):
        sim.weight[k] = 1.0
        sim.motor_weight[k] = 1.0
        sim.fraction[k] = 1.0
    status = _wrench_efforts(address, load)
    if status == 0:
        status = solve_step(address, 0.5 * h, load.tau)
    if status == 0:
        _choose_weights(address, h)
        for k in range(len(sim.after)):
            sim.middle[k] = sim.after[k]
            sim.u[k] = 0.5 * h * sim.after[k]
        kinematics.integrate_positions(sim.robot, sim.q, sim.u, sim.place)
        status = _wrench_efforts(address, load)
    if status == 0:
        status = solve_step(address, h, load.tau)
    while status == 0 and _touches_spring(address, h):
        status = solve_step(address, h, load.tau)
        for k in range(len(sim.after)):
            sim.middle[k] = 0.5 * (sim.before[k] + sim.after[k])
        if status == 0:
            status = solve_step(address, h, load.tau)
    if status == 0:
        status = _move(address, h, load.tau)
    if status == 0:
        _account_for_friction(address, h)
    if status == 0 and is_beyond_hard_limit(address):
        status = factorization.transform(sim.robot, sim.q, sim.qd, factorization.NU_FROM_QD, sim.nu)
        if status == 0:
            status = resolve_impacts(address, h)
    return status


@large_kernel
def _wrench_efforts(address, load):
    """Set the efforts `pushed` of wrenches and of bent links at `place`; return a status."""
    sim = opened(address)
    status = 0
    if len(load.wrenches) == 0:
        ws.clear(sim.pushed)
    else:
        status = classical.effort_of_wrenches(
            sim.robot, sim.place, load.wrenches, load.in_world, sim.pushed
        )
    if len(sim.bends) > 0:
        _add_bending_efforts(address)
    return status


@large_kernel
def _add_bending_efforts(address):
    """Add −∂/∂η of ½ Σ κ²(σ² + σ⁴): see :func:`bending_energy`."""
    sim = opened(address)
    for p in range(len(sim.bends)):
        curvature = 0.0
        slope = 0.0
        for k in range(len(sim.pushed)):
            curvature += sim.bends[p, 0, k] * sim.place[sim.coordinate[k]]
            slope += sim.bends[p, 1, k] * sim.place[sim.coordinate[k]]
        square = slope * slope
        by_curvature = curvature * square * (1.0 + square)
        by_slope = curvature * curvature * slope * (1.0 + 2.0 * square)
        for k in range(len(sim.pushed)):
            sim.pushed[k] -= by_curvature * sim.bends[p, 0, k] + by_slope * sim.bends[p, 1, k]


@large_kernel
def _choose_weights(address, h):
    """Set the weight ½ of joints with h (d + h k) ≤ inertia: slower than a step, ωh ≤ 1."""
    sim = opened(address)
    bodies, _, work, _ = ws.opened(sim.robot)
    for i in range(1, len(bodies)):
        if not groups.is_leader(bodies, i):
            continue
        k = bodies[i].dof
        mobility = 0.0 if sim.mode[k] == HELD else 1.0 / (work[i].D - sim.added[k])
        impedance = sim.damping[k]
        if sim.spring[k] != 0.0:
            impedance += sim.limit_damping[k] + h * sim.stiffness[k]
        if h * impedance * mobility <= 1.0:
            sim.weight[k] = 0.5
        if sim.rotor_inertia[k] > 0.0:
            impedance = sim.spring_damping[k] + h * sim.spring_stiffness[k]
            if h * impedance * (mobility + 1.0 / sim.rotor_inertia[k]) <= 1.0:
                sim.motor_weight[k] = 0.5


@kernel
def _displacement(sim, k, h):
    """Displacement of a degree of freedom in the step [rad, m]."""
    weight = sim.weight[k]
    is_rigid = sim.rotor_inertia[k] == 0.0 or sim.motor_weight[k] == 1.0
    if is_rigid and weight == 0.5 and sim.mode[k] == FREE and sim.spring[k] == 0.0:
        return h * sim.middle[k]
    return h * ((1.0 - weight) * sim.before[k] + weight * sim.after[k])


@large_kernel
def _touches_spring(address, h):
    """Set the spring of joints that pass a compliant limit in the step; return whether any does.

    A spring that the step resolves acts during the fraction of the step beyond the limit, with the
    mean depth there: half of that at the end. A faster one acts at the end.
    """
    sim = opened(address)
    bodies, _, work, _ = ws.opened(sim.robot)
    touching = False
    for i in range(1, len(bodies)):
        if not groups.is_leader(bodies, i):
            continue
        k = bodies[i].dof
        x = sim.q[sim.coordinate[k]]
        u = _displacement(sim, k, h)
        side = float((x + u > sim.upper[k]) - (x + u < sim.lower[k]))
        if side * u > 0.0 and sim.spring[k] == 0.0 and sim.stiffness[k] < math.inf:
            sim.spring[k] = side
            touching = True
            sim.depth[k] = x - (sim.upper[k] if side > 0.0 else sim.lower[k])
            impedance = sim.limit_damping[k] + h * sim.stiffness[k]
            if h * (sim.damping[k] + impedance) > work[i].D:
                sim.weight[k] = 1.0
            if sim.weight[k] == 0.5:
                sim.fraction[k] = (sim.depth[k] + u) / u
    return touching


@large_kernel
def _move(address, h, tau):
    """Move to the end of the step with the rates `after`; add all work but that of friction."""
    sim = opened(address)
    for k in range(len(tau)):
        sim.u[k] = _displacement(sim, k, h)
    ws.copy(sim.after, sim.qd)
    kinematics.integrate_positions(sim.robot, sim.first_q, sim.u, sim.q)
    work = 0.0
    loss = 0.0
    for k in range(len(tau)):
        u = sim.u[k]
        if not (math.isfinite(u) and math.isfinite(sim.q[k])):
            return -1
        rate = u / h
        loss -= sim.damping[k] * rate * u
        work += sim.pushed[k] * u
        if sim.rotor_inertia[k] > 0.0:
            theta = sim.theta[k]
            loss -= flexible.move_motor(address, k, h, tau[k])
            work += tau[k] * (sim.theta[k] - theta)
        else:
            work += tau[k] * u
        if sim.spring[k] != 0.0:
            mean = spring_start(sim, k) + sim.weight[k] * u
            force = sim.limit_damping[k] * rate + sim.stiffness[k] * mean
            loss -= sim.fraction[k] * force * u
    sim.accounts[WORK] += work
    sim.accounts[LOSS] += loss
    return 0


@large_kernel
def _account_for_friction(address, h):
    """Add the work of friction, impulse times mean rate; joints that stop together are one sum."""
    sim = opened(address)
    sliding = 0.0
    stopping = 0.0
    for k in range(len(sim.qd)):
        before = sim.before[k]
        mode = sim.mode[k]
        if mode == HELD and before != 0.0:
            stopping += 0.5 * before * (sim.needed[k] - sim.momentum[k])
        elif abs(mode) == 1.0:
            mean = 0.5 * (before + sim.qd[k]) if before * mode >= 0.0 else sim.qd[k]
            sliding -= h * sim.friction[k] * mode * mean
    sim.accounts[LOSS] += sliding + min(0.0, stopping)


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
    status = factorization.transform(sim.robot, sim.q, sim.nu, factorization.QD_FROM_NU, sim.qd)
    while status == 0 and _lock_stopped(address, h):
        status = factorization.transform(
            sim.robot, sim.q, sim.nu, factorization.TAU_FROM_EPSILON, sim.momentum
        )
        if status == 0:
            status = factorization.qd_from_momentum(
                sim.robot, sim.q, sim.locks, sim.momentum, sim.qd
            )
        for k in range(len(sim.qd)):
            if sim.locks[k] != 0.0:
                sim.qd[k] = 0.0
        if status == 0:
            status = factorization.transform(
                sim.robot, sim.q, sim.qd, factorization.NU_FROM_QD, sim.nu
            )
    sim.accounts[LOSS] += _energy(address) - energy
    return status


@large_kernel
def _lock_stopped(address, h):
    """Mark in `locks` the joints that an impact stops; return whether there are new ones."""
    sim = opened(address)
    bodies, _, work, _ = ws.opened(sim.robot)
    largest = 0.0
    has_new = False
    for k in range(len(sim.qd)):
        largest = max(largest, abs(sim.qd[k] - sim.before[k]))
    for i in range(1, len(bodies)):
        k = bodies[i].dof
        if not groups.is_leader(bodies, i) or sim.locks[k] != 0.0:
            continue
        q = sim.q[sim.coordinate[k]]
        rate = sim.qd[k]
        D = work[i].D  # the joint's inertia or more
        stays = abs(rate) <= UNMOVED * largest or D * abs(rate) <= SHORT * h * sim.friction[k]
        stopped = sim.before[k] == 0.0 and stays
        if sim.stiffness[k] == math.inf:
            stopped |= (q == sim.lower[k] and rate < 0.0) or (q == sim.upper[k] and rate > 0.0)
        if stopped:
            sim.locks[k] = math.inf
            has_new = True
    return has_new
