# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step in which no joint begins or ends to slide, to stick or to touch a limit: the equations are smooth."""

import math

from diag_dynamics import sweeps
from diag_dynamics.compiled.kernel import kernel, large_kernel
from diag_dynamics.simulation.layout import (
    FREE,
    HELD,
    conduct_of,
    last_of,
    memory_of,
    place_of,
    rows_of,
    stage_of,
    stages_of,
    state_of,
    system_of,
)
from diag_dynamics.simulation.tableau import EXPLICIT, GAMMA, IMPLICIT, STAGES, WEIGHTS

UNRESOLVED = 1.5
"""Step over a damper's time constant, from which on the rates at the stages no longer give the damper's work."""


@kernel
def stored(stiffness, depth):
    """Energy of a spring [J] that a limit is, so deep into it."""
    return 0.5 * stiffness * depth * depth if depth > 0.0 else 0.0


@large_kernel
def load_at(robot, q, load, pushed):
    """Write Jᵀf of wrenches at q into `pushed`; zeros without wrenches."""
    if len(load.wrenches) == 0:
        return 0
    return sweeps.effort_of_wrenches(robot, q, load.wrenches, load.in_world, pushed)


@large_kernel
def runge_kutta(simulation, h, load):
    """One step of the pair from (q, q̇, ν), in place, and the work done meanwhile, as that of a part of a step.

    The joints' conduct is given. Those that are held are so already, see sweeps.hold.
    """
    system, (q, qd, nu), conduct = system_of(simulation), state_of(simulation), conduct_of(simulation)
    memory, stage, stages = memory_of(simulation), stage_of(simulation), stages_of(simulation)
    place, rows, works = place_of(simulation), rows_of(simulation), simulation.part
    robot, bodies, flat, joints = system.robot, system.bodies, system.flat, system.joints
    added, momentum, effort, u = memory.added, memory.momentum, memory.effort, memory.u
    stage_nu, before, impulse, spent = stage.nu, stage.before, stage.impulse, stage.spent
    rates, explicit, implicit, pushed = stages.rates, stages.explicit, stages.implicit, stages.pushed
    charts = rates if flat else stages.charts
    tau, n = load.tau, len(qd)
    stiff, pushing = False, len(load.wrenches) > 0
    for k in range(n):
        resistance, stiffness = joints[k].damping, 0.0
        if conduct[k].spring != 0.0:
            resistance += joints[k].limit_damping
            stiffness = joints[k].stiffness
        added[k] = h * GAMMA * (resistance + h * GAMMA * stiffness)
        impulse[k] = 0.0
        stiff |= added[k] > 0.0
        spent[k] = tau[k]
        if abs(conduct[k].mode) == 1.0:
            spent[k] -= joints[k].friction * conduct[k].mode

    for i in range(STAGES):
        for k in range(n):
            u[k], stage_nu[k] = 0.0, nu[k]
        for j in range(i):  # row by row: the compiler vectorizes that
            a, b = h * EXPLICIT[i, j], h * IMPLICIT[i, j]
            for k in range(n):
                u[k] += a * charts[j, k]
                stage_nu[k] += a * explicit[j, k]
            if stiff:
                for k in range(n):
                    stage_nu[k] += b * implicit[j, k]
        if flat:
            for k in range(n):
                place[k] = q[k] + u[k]
        else:
            sweeps.displace(bodies, q, u, place)
        if i == 0:
            sweeps.copy(qd, rates[0])
            if stiff:  # the first stage is explicit: forces of joints from where they are
                for k in range(n):
                    momentum[k] = -joints[k].damping * qd[k]
                    if conduct[k].spring != 0.0:
                        momentum[k] -= joints[k].limit_damping * qd[k] + joints[k].stiffness * conduct[k].depth
                status = sweeps.epsilon_from_tau(robot, place, momentum, implicit[0])
            else:
                status = 0
        elif stiff:
            sweeps.copy(stage_nu, before)
            for k in range(n):
                if conduct[k].spring != 0.0:
                    # The implicit method moves a spring's position on its own. Both methods agree at the end of the step.
                    stretch = conduct[k].depth
                    for j in range(i):
                        stretch += h * IMPLICIT[i, j] * rates[j, k]
                    impulse[k] = -h * GAMMA * joints[k].stiffness * stretch
            status = sweeps.rates_with_added_inertia(robot, place, stage_nu, added, impulse, momentum, rates[i])
            if status == 0:
                status = sweeps.nu_from_qd(robot, place, rates[i], stage_nu)
            for k in range(n):
                implicit[i, k] = (stage_nu[k] - before[k]) / (h * GAMMA)
        else:
            status = sweeps.qd_from_nu(robot, place, stage_nu, rates[i])
        if status == 0 and pushing:
            status = load_at(robot, place, load, pushed[i])
        if status != 0:
            return status
        sweeps.copy(spent, effort)
        if pushing:
            for k in range(n):
                effort[k] += pushed[i, k]
        if not flat:
            sweeps.chart_rates(bodies, u, rates[i], charts[i])
        status = sweeps.evaluate(robot, place, rates[i], effort, rows)
        if status != 0:
            return status
        for k in range(n):
            explicit[i, k] = rows[sweeps.EPSILON, k] - rows[sweeps.CORIOLIS, k] - rows[sweeps.GRAVITY, k]

    path, square = memory.path, stage.square
    for k in range(n):
        u[k], path[k], square[k] = 0.0, 0.0, 0.0
    for i in range(STAGES):
        b = h * WEIGHTS[i]
        for k in range(n):
            u[k] += b * charts[i, k]
            nu[k] += b * explicit[i, k]
            path[k] += b * rates[i, k]
            square[k] += b * rates[i, k] * rates[i, k]
        if stiff:
            for k in range(n):
                nu[k] += b * implicit[i, k]
        if pushing:
            for k in range(n):
                works.wrenches += b * pushed[i, k] * rates[i, k]
    done = 0.0
    for k in range(n):
        if conduct[k].mode == HELD:
            u[k], path[k], square[k] = 0.0, 0.0, 0.0
        elif conduct[k].mode != FREE:
            works.friction -= joints[k].friction * conduct[k].mode * path[k]
        done += tau[k] * path[k]
    works.effort += done
    if flat:
        for k in range(n):
            q[k] += u[k]
    else:
        sweeps.displace(bodies, q, u, q)
    status = sweeps.qd_from_nu(robot, q, nu, qd)
    for k in range(n):
        if conduct[k].mode == HELD:
            qd[k] = 0.0
    if stiff:
        _dissipate(simulation, h, rates[0], qd, works)
    return status


@kernel
def _dissipate(simulation, h, first, last, works):
    """Add the work of dampers, from the first and last rates of a step, ∫q̇ and ∫q̇².

    Where they stop a joint within a fraction of the step its rates at the stages say nothing of ∫q̇², but the impulse times
    the mean rate is the kinetic energy that it takes.
    """
    system, conduct = system_of(simulation), conduct_of(simulation)
    bodies, path, square = system.bodies, memory_of(simulation).path, stage_of(simulation).square
    for i in range(1, len(bodies)):
        if sweeps.owns(bodies, i):
            k = bodies[i].dof
            joint = system.joints[k]
            damping = joint.limit_damping if conduct[k].spring != 0.0 else 0.0
            taken = square[k]
            if h * (damping + joint.damping) > UNRESOLVED * system.work[i].D:
                taken = max(0.0, 0.5 * path[k] * (first[k] + last[k]))
            works.damping -= joint.damping * taken
            works.limits -= damping * taken


@large_kernel
def euler_rates(simulation, h, tau, qd, after):
    """Rates after a step of semi-implicit Euler: (M + h d + h² k) q̈ = τ − d q̇ − k (x + h q̇) − c − g."""
    system, memory, conduct = system_of(simulation), memory_of(simulation), conduct_of(simulation)
    joints = system.joints
    added, effort, qdd = memory.added, memory.effort, memory.qdd
    for k in range(len(qd)):
        resistance = joints[k].damping
        effort[k], added[k] = tau[k] + memory.pushed[k], 0.0
        if abs(conduct[k].mode) == 1.0:
            effort[k] -= joints[k].friction * conduct[k].mode
        if conduct[k].spring != 0.0:
            resistance += joints[k].limit_damping
            effort[k] -= joints[k].stiffness * (conduct[k].depth + h * qd[k])
            added[k] = h * h * joints[k].stiffness
        effort[k] -= resistance * qd[k]
        added[k] += h * resistance
    status = sweeps.accelerations_with_added_inertia(system.robot, state_of(simulation).q, qd, effort, added, qdd)
    for k in range(len(qd)):
        after[k] = qd[k] + h * qdd[k] if conduct[k].mode != HELD else 0.0
    return status


@large_kernel
def euler_move(simulation, h, tau, first, works):
    """What remains of that step once its rates are known: where they lead, in place, and the work done on the way.

    `first` are the rates at its start. Friction takes as much as its impulse times the mean rate, unless the joint has
    turned round.
    """
    system, state, memory = system_of(simulation), state_of(simulation), memory_of(simulation)
    q, qd, u, conduct = state.q, state.qd, memory.u, conduct_of(simulation)
    n = len(qd)
    for k in range(n):
        u[k] = h * qd[k]
    if system.flat:
        for k in range(n):
            q[k] += u[k]
    else:
        sweeps.displace(system.bodies, q, u, q)
    done, damped, rubbed, stopped, pushing = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        if not (math.isfinite(u[k]) and math.isfinite(q[k])):
            return -1
        joint = system.joints[k]
        done += tau[k] * u[k]
        pushing += memory.pushed[k] * u[k]
        damped -= joint.damping * qd[k] * u[k]
        if abs(conduct[k].mode) == 1.0:
            mean = 0.5 * h * (first[k] + qd[k]) if first[k] * conduct[k].mode >= 0.0 else u[k]
            rubbed -= joint.friction * conduct[k].mode * mean
        if conduct[k].spring != 0.0:  # its work, by the force at the end, and what it has stored
            end = conduct[k].depth + u[k]
            stopped -= (joint.limit_damping * qd[k] + joint.stiffness * end) * u[k]
            stopped += stored(joint.stiffness, conduct[k].spring * end) - stored(
                joint.stiffness, conduct[k].spring * conduct[k].depth
            )
    works.effort += done
    works.wrenches += pushing
    works.damping += damped
    works.friction += rubbed
    works.limits += stopped
    return 0


@large_kernel
def glide(simulation, h, steps, tau):
    """Take steps of semi-implicit Euler until one would end at a limit or fails; returns how many were taken.

    The robot's joints have one degree of freedom each, without friction, wrenches and springs. Order 1 is chosen for speed:
    this is its shortest way.
    """
    system, state, memory = system_of(simulation), state_of(simulation), memory_of(simulation)
    joints, bounds, q, qd = system.joints, system.bounds, state.q, state.qd
    last_q, last_qd, _ = last_of(simulation)
    added, effort, qdd, path = memory.added, memory.effort, memory.qdd, memory.path
    n, taken, good = len(qd), 0, True
    for k in range(n):
        added[k], path[k] = h * joints[k].damping, 0.0
    damped = 0.0
    while good and taken < steps:
        for k in range(n):
            last_q[k], last_qd[k] = q[k], qd[k]
            effort[k] = tau[k] - joints[k].damping * qd[k]
        good = sweeps.accelerations_with_added_inertia(system.robot, q, qd, effort, added, qdd) == 0
        for k in range(n):
            qd[k] += h * qdd[k]
            q[k] += h * qd[k]
        for k in range(n):  # NaN must end here, too: it is within no limits
            good &= bounds[k].lower < q[k] and q[k] < bounds[k].upper
        if good:
            taken += 1
            for k in range(n):
                path[k] += h * qd[k]
                damped -= added[k] * qd[k] * qd[k]
    if not good:
        for k in range(n):
            q[k], qd[k] = last_q[k], last_qd[k]
    done = 0.0
    for k in range(n):
        done += tau[k] * path[k]
    works = simulation.done
    works.effort += done
    works.damping += damped
    return taken
