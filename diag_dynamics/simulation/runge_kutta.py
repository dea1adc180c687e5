# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A step of order 4 in which no joint changes its mode: the equations are smooth."""

from diag_dynamics.numerics.kernel import kernel, large_kernel
from diag_dynamics.simulation.memory import DAMPING, EFFORT, FRICTION, LIMITS, WRENCHES, opened
from diag_dynamics.simulation.modes import FREE, HELD
from diag_dynamics.simulation.tableau import EXPLICIT, GAMMA, IMPLICIT, STAGES, WEIGHTS
from diag_dynamics.sweeps import classical, configuration, evaluation, factorization, groups
from diag_dynamics.sweeps import workspace as ws

UNRESOLVED = 1.5
"""Ratio of the step to a damper's time constant above which the rates at the stages do not give the damper's work."""


@large_kernel
def wrench_efforts(robot, q, load, pushed):
    """Write Jᵀf of the wrenches at q into `pushed`, which stays as it is without wrenches."""
    if len(load.wrenches) == 0:
        return 0
    return classical.effort_of_wrenches(robot, q, load.wrenches, load.in_world, pushed)


@kernel
def integrate(flat, bodies, q, u, target):
    """Write q exp(u) to `target`."""
    if flat:
        for k in range(len(u)):
            target[k] = q[k] + u[k]
    else:
        configuration.integrate_positions(bodies, q, u, target)


@large_kernel
def runge_kutta(address, h, load):
    """Step (q, q̇, ν) by the pair of methods, and add the work done to the accounts. Held joints are locked already."""
    stiff = _start_stages(address, h, load.tau)
    for i in range(STAGES):
        status = _predict(address, h, i, stiff)
        if status == 0:
            status = _stage_rates(address, h, i, stiff)
        if status == 0:
            status = _explicit_accelerations(address, i, load)
        if status != 0:
            return status
    return _combine_stages(address, h, stiff, load)


@large_kernel
def _start_stages(address, h, tau):
    """Set what all stages share; return whether a joint has a damper or leans on a spring."""
    sim = opened(address)
    stiff = False
    for k in range(len(tau)):
        resistance, stiffness = sim.damping[k], 0.0
        if sim.spring[k] != 0.0:
            resistance += sim.limit_damping[k]
            stiffness = sim.stiffness[k]
        sim.added[k] = h * GAMMA * (resistance + h * GAMMA * stiffness)
        sim.impulse[k] = 0.0
        stiff |= sim.added[k] > 0.0
        sim.constant_effort[k] = tau[k]
        if abs(sim.mode[k]) == 1.0:
            sim.constant_effort[k] -= sim.friction[k] * sim.mode[k]
    return stiff


@large_kernel
def _predict(address, h, i, stiff):
    """Position and explicit ν of a stage from those before it."""
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    charts = sim.rates if sim.flat else sim.charts
    n = len(sim.qd)
    for k in range(n):
        sim.u[k], sim.stage_nu[k] = 0.0, sim.nu[k]
    for j in range(i):  # row by row: the compiler vectorizes this
        a, b = h * EXPLICIT[i, j], h * IMPLICIT[i, j]
        for k in range(n):
            sim.u[k] += a * charts[j, k]
            sim.stage_nu[k] += a * sim.explicit[j, k]
        if stiff:
            for k in range(n):
                sim.stage_nu[k] += b * sim.implicit[j, k]
    integrate(sim.flat, bodies, sim.q, sim.u, sim.place)
    return 0


@large_kernel
def _stage_rates(address, h, i, stiff):
    """q̇ of a stage and the implicit part of ν̇. The first stage is explicit."""
    sim = opened(address)
    rates, implicit, nu, momentum = sim.rates[i], sim.implicit[i], sim.stage_nu, sim.momentum
    n = len(nu)
    if i == 0:
        ws.copy(sim.qd, rates)
        if not stiff:
            return 0
        for k in range(n):
            momentum[k] = -sim.damping[k] * sim.qd[k]
            if sim.spring[k] != 0.0:
                momentum[k] -= sim.limit_damping[k] * sim.qd[k] + sim.stiffness[k] * sim.depth[k]
        return factorization.epsilon_from_tau(sim.robot, sim.place, momentum, implicit)
    if not stiff:
        return factorization.qd_from_nu(sim.robot, sim.place, nu, rates)
    ws.copy(nu, sim.explicit_nu)
    for k in range(n):
        if sim.spring[k] != 0.0:
            # The implicit method moves a spring's position on its own. Both methods agree at the end of the step.
            stretch = sim.depth[k]
            for j in range(i):
                stretch += h * IMPLICIT[i, j] * sim.rates[j, k]
            sim.impulse[k] = -h * GAMMA * sim.stiffness[k] * stretch
    status = factorization.rates_with_added_inertia(sim.robot, sim.place, nu, sim.added, sim.impulse, momentum, rates)
    if status == 0:
        status = factorization.nu_from_qd(sim.robot, sim.place, rates, nu)
    for k in range(n):
        implicit[k] = (nu[k] - sim.explicit_nu[k]) / (h * GAMMA)
    return status


@large_kernel
def _explicit_accelerations(address, i, load):
    """Explicit part of ν̇ at a stage: ε − C − ε_g."""
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    rates, pushed, explicit = sim.rates[i], sim.stage_pushed[i], sim.explicit[i]
    ws.copy(sim.constant_effort, sim.effort)
    if len(load.wrenches) > 0:
        status = wrench_efforts(sim.robot, sim.place, load, pushed)
        if status != 0:
            return status
        for k in range(len(pushed)):
            sim.effort[k] += pushed[k]
    if not sim.flat:
        configuration.dexp_inverse(bodies, sim.u, rates, sim.charts[i])
    status = evaluation.evaluate(sim.robot, sim.place, rates, sim.effort, sim.rows)
    for k in range(len(explicit)):
        explicit[k] = sim.rows[ws.EPSILON, k] - sim.rows[ws.CORIOLIS, k] - sim.rows[ws.GRAVITY, k]
    return status


@large_kernel
def _combine_stages(address, h, stiff, load):
    """q, q̇ and ν at the end of the step, and the accounts."""
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    charts = sim.rates if sim.flat else sim.charts
    n = len(sim.qd)
    for k in range(n):
        sim.u[k], sim.path[k], sim.square[k] = 0.0, 0.0, 0.0
    for i in range(STAGES):
        b = h * WEIGHTS[i]
        for k in range(n):
            sim.u[k] += b * charts[i, k]
            sim.nu[k] += b * sim.explicit[i, k]
            sim.path[k] += b * sim.rates[i, k]
            sim.square[k] += b * sim.rates[i, k] * sim.rates[i, k]
        if stiff:
            for k in range(n):
                sim.nu[k] += b * sim.implicit[i, k]
        if len(load.wrenches) > 0:
            for k in range(n):
                sim.accounts[WRENCHES] += b * sim.stage_pushed[i, k] * sim.rates[i, k]
    work = 0.0
    for k in range(n):
        if sim.mode[k] == HELD:
            sim.u[k], sim.path[k], sim.square[k] = 0.0, 0.0, 0.0
        elif sim.mode[k] != FREE:
            sim.accounts[FRICTION] -= sim.friction[k] * sim.mode[k] * sim.path[k]
        work += load.tau[k] * sim.path[k]
    sim.accounts[EFFORT] += work
    integrate(sim.flat, bodies, sim.q, sim.u, sim.q)
    status = factorization.qd_from_nu(sim.robot, sim.q, sim.nu, sim.qd)
    for k in range(n):
        if sim.mode[k] == HELD:
            sim.qd[k] = 0.0
    if stiff:
        _book_damping(address, h)
    return status


@large_kernel
def _book_damping(address, h):
    """Book the work of dampers, from ∫q̇², or from the first and last rates and ∫q̇.

    If a damper stops its joint within a fraction of the step, the rates at the stages do not give ∫q̇². The impulse times the
    mean rate is then the kinetic energy that the damper takes.
    """
    sim = opened(address)
    bodies, _, work, _ = ws.opened(sim.robot)
    for i in range(1, len(bodies)):
        if groups.is_leader(bodies, i):
            k = bodies[i].dof
            limit_damping = sim.limit_damping[k] if sim.spring[k] != 0.0 else 0.0
            square = sim.square[k]
            if h * (limit_damping + sim.damping[k]) > UNRESOLVED * work[i].D:
                square = max(0.0, 0.5 * sim.path[k] * (sim.rates[0, k] + sim.qd[k]))
            sim.accounts[DAMPING] -= sim.damping[k] * square
            sim.accounts[LIMITS] -= limit_damping * square
