# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A step of order 4 in which no joint changes its mode: the equations are smooth.

The tables are those of ARK4(3)6L[2]SA, a pair of Runge–Kutta methods of order 4 with one set of weights (Kennedy and
Carpenter, Applied Numerical Mathematics 44, 2003). One is explicit, the other implicit, L-stable and stiffly accurate.
"""

import numpy as np

from diag_dynamics.numerics.kernel import large_kernel
from diag_dynamics.simulation.flexible import rigid_part
from diag_dynamics.simulation.memory import (
    DAMPING,
    EFFORT,
    FRICTION,
    LIMITS,
    STAGES,
    WRENCHES,
    opened,
)
from diag_dynamics.simulation.modes import FREE, HELD
from diag_dynamics.sweeps import classical, evaluation, factorization, groups, kinematics
from diag_dynamics.sweeps import workspace as ws

GAMMA = 0.25

WEIGHTS = np.array([82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211, 1 / 4])

EXPLICIT = np.zeros((STAGES, STAGES))
EXPLICIT[1, :1] = [1 / 2]
EXPLICIT[2, :2] = [13861 / 62500, 6889 / 62500]
EXPLICIT[3, :2] = [-116923316275 / 2393684061468, -2731218467317 / 15368042101831]
EXPLICIT[3, 2] = 9408046702089 / 11113171139209
EXPLICIT[4, :2] = [-451086348788 / 2902428689909, -2682348792572 / 7519795681897]
EXPLICIT[4, 2:4] = [12662868775082 / 11960479115383, 3355817975965 / 11060851509271]
EXPLICIT[5, :2] = [647845179188 / 3216320057751, 73281519250 / 8382639484533]
EXPLICIT[5, 2:5] = [552539513391 / 3454668386233, 3354512671639 / 8306763924573, 4040 / 17871]

IMPLICIT = np.zeros((STAGES, STAGES))
IMPLICIT[1, :2] = [1 / 4, GAMMA]
IMPLICIT[2, :3] = [8611 / 62500, -1743 / 31250, GAMMA]
IMPLICIT[3, :4] = [5012029 / 34652500, -654441 / 2922500, 174375 / 388108, GAMMA]
IMPLICIT[4, :3] = [15267082809 / 155376265600, -71443401 / 120774400, 730878875 / 902184768]
IMPLICIT[4, 3:5] = [2285395 / 8070912, GAMMA]
IMPLICIT[5] = WEIGHTS

for _table in (EXPLICIT, IMPLICIT, WEIGHTS):
    _table.flags.writeable = False


UNRESOLVED = 1.5
"""Ratio of step to time constant of a damper above which the stages do not resolve its work."""


@large_kernel
def wrench_efforts(address, q, load, pushed):
    """Write Jᵀf of the wrenches at q into `pushed`, and efforts of bent links; return a status."""
    sim = opened(address)
    status = 0
    if len(load.wrenches) == 0:
        ws.clear(pushed)
    else:
        status = classical.effort_of_wrenches(sim.robot, q, load.wrenches, load.in_world, pushed)
    if len(sim.bends) > 0:
        _add_bending_efforts(address, q, pushed)
    return status


@large_kernel
def _add_bending_efforts(address, q, pushed):
    """Add −∂/∂η of ½ Σ κ²(σ² + σ⁴): see :func:`bending_energy`."""
    sim = opened(address)
    for p in range(len(sim.bends)):
        curvature, slope = sim.held_bends[p, 0], sim.held_bends[p, 1]
        for k in range(len(pushed)):
            curvature += sim.bends[p, 0, k] * q[sim.coordinate[k]]
            slope += sim.bends[p, 1, k] * q[sim.coordinate[k]]
        square = slope * slope
        by_curvature = curvature * square * (1.0 + square)
        by_slope = curvature * curvature * slope * (1.0 + 2.0 * square)
        for k in range(len(pushed)):
            pushed[k] -= by_curvature * sim.bends[p, 0, k] + by_slope * sim.bends[p, 1, k]


@large_kernel
def _add(target, scale, row):
    """Add scale · row to a vector."""
    for k in range(len(target)):
        target[k] += scale * row[k]


@large_kernel
def runge_kutta(address, h, load):
    """Step (q, q̇, ν) by the pair of methods, and add the work done to the accounts. Held joints are locked already."""
    stiff = _start_stages(address, h, load.tau)
    for i in range(STAGES):
        _predict(address, h, i, stiff)
        status = _stage_rates(address, h, i, stiff, load)
        if status != 0:
            return status
    return _combine_stages(address, h, stiff, load)


@large_kernel
def _start_stages(address, h, tau):
    """Set efforts and added inertia of all stages; return whether there are dampers or springs."""
    sim = opened(address)
    stiff = False
    for k in range(len(tau)):
        resistance, stiffness, friction = sim.damping[k], 0.0, 0.0
        if sim.spring[k] != 0.0:
            resistance, stiffness = resistance + sim.limit_damping[k], sim.stiffness[k]
        if abs(sim.mode[k]) == 1.0:
            friction = sim.friction[k] * sim.mode[k]
        sim.added[k] = h * GAMMA * (resistance + h * GAMMA * stiffness)
        sim.constant_effort[k] = tau[k] - friction
        if sim.rotor_inertia[k] > 0.0:
            B, rate = sim.rotor_inertia[k], sim.thetad[k]
            sim.added[k] += B * rigid_part(
                B, sim.spring_stiffness[k], sim.spring_damping[k], h * GAMMA
            )
            sim.constant_effort[k] = -friction
            sim.motor_rates[0, k] = rate
            sim.spring_torques[0, k] = sim.spring_stiffness[k] * (
                sim.theta[k] - sim.q[sim.coordinate[k]]
            )
            sim.spring_torques[0, k] += sim.spring_damping[k] * (rate - sim.qd[k])
        stiff |= sim.added[k] > 0.0
    return stiff


@large_kernel
def _predict(address, h, i, stiff):
    """Position and explicit ν of a stage from those before it."""
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    ws.clear(sim.u)
    ws.copy(sim.nu, sim.stage_nu)
    for j in range(i):
        a, b = h * EXPLICIT[i, j], h * IMPLICIT[i, j]
        _add(sim.u, a, sim.charts[j])
        _add(sim.stage_nu, a, sim.explicit[j])
        if stiff:
            _add(sim.stage_nu, b, sim.implicit[j])
    kinematics.integrate_positions(bodies, sim.q, sim.u, sim.place)


@large_kernel
def _stage_rates(address, h, i, stiff, load):
    """q̇ of a stage, and ν̇ without and with dampers and springs, from one factorization."""
    sim = opened(address)
    bodies, _, work, table = ws.opened(sim.robot)
    rates, nu, pushed = sim.rates[i], sim.stage_nu, sim.stage_pushed[i]
    status = wrench_efforts(address, sim.place, load, pushed)
    if status == 0:
        status = factorization.factorize_at(bodies, sim.place, work, table[0])
    if status != 0:
        return status
    ws.copy(sim.constant_effort, sim.effort)
    _add(sim.effort, 1.0, pushed)
    if i == 0:
        ws.copy(sim.qd, rates)
        factorization.xi_from_qd(bodies, rates, work, table[0], nu)
        if stiff:
            _first_implicit_part(address)
    elif stiff:
        status = _solve_implicitly(address, h, i, load.tau)
    else:
        ws.copy(nu, rates)
        factorization.scale_by_inertia(bodies, work, -0.5, rates)
        factorization.qd_from_xi(bodies, rates, work, table[0], rates)
    kinematics.dexp_inverse(bodies, sim.u, rates, sim.charts[i])
    if status != 0:
        return status
    return evaluation.nu_dot_from_tau(sim.robot, rates, sim.effort, sim.explicit[i])


@large_kernel
def _first_implicit_part(address):
    """ν̇ by dampers and springs at the first stage, which is explicit."""
    sim = opened(address)
    bodies, _, work, table = ws.opened(sim.robot)
    momentum, implicit = sim.momentum, sim.implicit[0]
    for k in range(len(momentum)):
        momentum[k] = -sim.damping[k] * sim.qd[k]
        if sim.spring[k] != 0.0:
            momentum[k] -= sim.limit_damping[k] * sim.qd[k] + sim.stiffness[k] * sim.depth[k]
        momentum[k] += sim.spring_torques[0, k]
    factorization.kappa_from_tau(bodies, momentum, work, table[0], implicit)
    factorization.scale_by_inertia(bodies, work, -0.5, implicit)


@large_kernel
def _solve_implicitly(address, h, i, tau):
    """q̇ and ν after the implicit part of a stage, and that part of ν̇."""
    sim = opened(address)
    bodies, _, work, table = ws.opened(sim.robot)
    rates, implicit, nu, momentum = sim.rates[i], sim.implicit[i], sim.stage_nu, sim.momentum
    ws.copy(nu, sim.explicit_nu)
    ws.copy(nu, momentum)
    factorization.scale_by_inertia(bodies, work, 0.5, momentum)
    factorization.tau_from_kappa(bodies, momentum, work, table[0], momentum)
    for k in range(len(nu)):
        if sim.spring[k] != 0.0:
            # The implicit method moves a spring's position on its own. Both methods agree at the end of the step.
            stretch = sim.depth[k]
            for j in range(i):
                stretch += h * IMPLICIT[i, j] * sim.rates[j, k]
            momentum[k] -= h * GAMMA * sim.stiffness[k] * stretch
        if sim.rotor_inertia[k] > 0.0:
            momentum[k] += _eliminate_motor(address, k, h, i, tau[k])
    status = factorization.qd_from_momentum(sim.damped_robot, sim.place, sim.added, momentum, rates)
    factorization.xi_from_qd(bodies, rates, work, table[0], nu)
    factorization.scale_by_inertia(bodies, work, 0.5, nu)
    for k in range(len(nu)):
        implicit[k] = (nu[k] - sim.explicit_nu[k]) / (h * GAMMA)
        if sim.rotor_inertia[k] > 0.0:
            part = rigid_part(
                sim.rotor_inertia[k], sim.spring_stiffness[k], sim.spring_damping[k], h * GAMMA
            )
            rate = (1.0 - part) * (sim.motor_start[k] - rates[k])
            sim.motor_rates[i, k] = rates[k] + rate
            sim.spring_torques[i, k] += (
                sim.spring_damping[k] + h * GAMMA * sim.spring_stiffness[k]
            ) * rate
    return status


@large_kernel
def _eliminate_motor(address, k, h, i, tau):
    """Return the impulse of a motor on its link in the implicit part of a stage, less that of the added inertia."""
    sim = opened(address)
    B, stiffness = sim.rotor_inertia[k], sim.spring_stiffness[k]
    stretch, rate = sim.theta[k] - sim.q[sim.coordinate[k]], sim.thetad[k]
    for j in range(i):
        stretch += h * IMPLICIT[i, j] * (sim.motor_rates[j, k] - sim.rates[j, k])
        rate += h * (EXPLICIT[i, j] * tau - IMPLICIT[i, j] * sim.spring_torques[j, k]) / B
    sim.spring_torques[i, k] = stiffness * stretch
    sim.motor_start[k] = rate - h * GAMMA * stiffness * stretch / B
    part = rigid_part(B, stiffness, sim.spring_damping[k], h * GAMMA)
    return h * GAMMA * stiffness * stretch + part * B * sim.motor_start[k]


@large_kernel
def _move_motor(address, k, h, tau):
    """Move a motor to the end of the step; add the loss of its spring and return ∫θ̇."""
    sim = opened(address)
    path, loss, impulse = 0.0, 0.0, h * tau
    for i in range(STAGES):
        b, rate = h * WEIGHTS[i], sim.motor_rates[i, k]
        path += b * rate
        loss += b * sim.spring_damping[k] * (rate - sim.rates[i, k]) ** 2
        impulse -= b * sim.spring_torques[i, k]
    sim.theta[k] += path
    sim.thetad[k] += impulse / sim.rotor_inertia[k]
    sim.accounts[DAMPING] -= loss
    return path


@large_kernel
def _combine_stages(address, h, stiff, load):
    """q, q̇ and ν at the end of the step, and the accounts."""
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    ws.clear(sim.u)
    ws.clear(sim.path)
    for i in range(STAGES):
        b = h * WEIGHTS[i]
        _add(sim.u, b, sim.charts[i])
        _add(sim.nu, b, sim.explicit[i])
        _add(sim.path, b, sim.rates[i])
        if stiff:
            _add(sim.nu, b, sim.implicit[i])
        for k in range(len(sim.qd)):
            sim.accounts[WRENCHES] += b * sim.stage_pushed[i, k] * sim.rates[i, k]
    work = 0.0
    for k in range(len(sim.qd)):
        if sim.mode[k] == HELD:
            sim.u[k], sim.path[k] = 0.0, 0.0
        elif sim.mode[k] != FREE:
            sim.accounts[FRICTION] -= sim.friction[k] * sim.mode[k] * sim.path[k]
        work += load.tau[k] * (
            _move_motor(address, k, h, load.tau[k]) if sim.rotor_inertia[k] > 0.0 else sim.path[k]
        )
    sim.accounts[EFFORT] += work
    kinematics.integrate_positions(bodies, sim.q, sim.u, sim.q)
    status = factorization.qd_from_nu(sim.robot, sim.q, sim.nu, sim.qd)
    for k in range(len(sim.qd)):
        if sim.mode[k] == HELD:
            sim.qd[k] = 0.0
    if stiff:
        _account_for_damping(address, h)
    return status


@large_kernel
def _account_for_damping(address, h):
    """Add the work of dampers, d ∫q̇².

    If a damper stops its joint within a fraction of the step, the stages do not resolve ∫q̇². The
    mean of the first and last rates times ∫q̇ then gives the energy that the damper removes.
    """
    sim = opened(address)
    bodies, _, work, _ = ws.opened(sim.robot)
    for i in range(1, len(bodies)):
        k = bodies[i].dof
        if groups.is_leader(bodies, i) and sim.mode[k] != HELD:
            limit_damping = sim.limit_damping[k] if sim.spring[k] != 0.0 else 0.0
            square = 0.0
            for j in range(STAGES):
                square += h * WEIGHTS[j] * sim.rates[j, k] * sim.rates[j, k]
            if h * (limit_damping + sim.damping[k]) > UNRESOLVED * work[i].D:
                square = max(0.0, 0.5 * sim.path[k] * (sim.rates[0, k] + sim.qd[k]))
            sim.accounts[DAMPING] -= sim.damping[k] * square
            sim.accounts[LIMITS] -= limit_damping * square
