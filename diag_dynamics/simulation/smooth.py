"""One step in which no joint begins or ends to slide, to stick or to touch a limit: the equations are smooth."""

import math

from diag_dynamics import sweeps
from diag_dynamics.compiled.kernel import kernel, large_kernel
from diag_dynamics.simulation.layout import (
    DAMPING,
    DAMPING_WORK,
    EFFORT_WORK,
    FREE,
    FRICTION,
    FRICTION_WORK,
    HELD,
    LIMIT_DAMPING,
    LIMIT_WORK,
    LOWER,
    STIFFNESS,
    UPPER,
    WRENCH_WORK,
)
from diag_dynamics.simulation.tableau import EXPLICIT, GAMMA, IMPLICIT, STAGES, WEIGHTS

VECTORS = 8 + 5 * STAGES
"""Rows of memory of a step of order 4, one entry for each degree of freedom."""


UNRESOLVED = 1.5
"""Step over a damper's time constant, from which on the rates at the stages no longer give the damper's work."""


@kernel
def stored(stiffness, depth):
    """Energy of a spring [J] that a limit is, so deep into it."""
    return 0.5 * stiffness * depth * depth if depth > 0.0 else 0.0


@large_kernel
def load_at(robot, q, tau, wrenches, in_world, pushed):
    """Write Jᵀf of wrenches at q into `pushed`; zeros without wrenches."""
    if len(wrenches) == 0:
        return 0
    return sweeps.effort_of_wrenches(robot, q, wrenches, in_world, pushed)


@large_kernel
def runge_kutta(
    robot, flat, joints, h, tau, wrenches, in_world, mode, spring, depth, q, qd, nu, works, memory, place, rows
):
    """One step of the pair from (q, q̇, ν), in place, and the work done meanwhile.

    `mode` says which joints slide and are held, `spring` which lean on a compliant limit, and `depth` how far, with a sign.
    Joints that are held are so already, see sweeps.hold.
    """
    bodies, _, work, _ = sweeps.opened(robot)
    n = len(qd)
    added, impulse, momentum, before, stage_nu, u, effort, spent = (
        memory[0],
        memory[1],
        memory[2],
        memory[3],
        memory[4],
        memory[5],
        memory[6],
        memory[7],
    )
    rates = memory[8 : 8 + STAGES]
    charts = rates if flat else memory[8 + STAGES : 8 + 2 * STAGES]
    explicit = memory[8 + 2 * STAGES : 8 + 3 * STAGES]
    implicit = memory[8 + 3 * STAGES : 8 + 4 * STAGES]
    pushed = memory[8 + 4 * STAGES : 8 + 5 * STAGES]
    stiff, pushing = False, len(wrenches) > 0
    for k in range(n):
        resistance, stiffness = joints[DAMPING, k], 0.0
        if spring[k] != 0.0:
            resistance += joints[LIMIT_DAMPING, k]
            stiffness = joints[STIFFNESS, k]
        added[k] = h * GAMMA * (resistance + h * GAMMA * stiffness)
        impulse[k] = 0.0
        stiff |= added[k] > 0.0
        spent[k] = tau[k]
        if abs(mode[k]) == 1.0:
            spent[k] -= joints[FRICTION, k] * mode[k]

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
                    momentum[k] = -joints[DAMPING, k] * qd[k]
                    if spring[k] != 0.0:
                        momentum[k] -= joints[LIMIT_DAMPING, k] * qd[k] + joints[STIFFNESS, k] * depth[k]
                status = sweeps.epsilon_from_tau(robot, place, momentum, implicit[0])
            else:
                status = 0
        elif stiff:
            sweeps.copy(stage_nu, before)
            for k in range(n):
                if spring[k] != 0.0:
                    # The implicit method moves a spring's position on its own. Both methods agree at the end of the step.
                    stretch = depth[k]
                    for j in range(i):
                        stretch += h * IMPLICIT[i, j] * rates[j, k]
                    impulse[k] = -h * GAMMA * joints[STIFFNESS, k] * stretch
            status = sweeps.rates_with_added_inertia(robot, place, stage_nu, added, impulse, momentum, rates[i])
            if status == 0:
                status = sweeps.nu_from_qd(robot, place, rates[i], stage_nu)
            for k in range(n):
                implicit[i, k] = (stage_nu[k] - before[k]) / (h * GAMMA)
        else:
            status = sweeps.qd_from_nu(robot, place, stage_nu, rates[i])
        if status == 0 and pushing:
            status = load_at(robot, place, tau, wrenches, in_world, pushed[i])
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

    path, square = before, momentum  # ∫q̇ and ∫q̇² of each degree of freedom
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
                works[WRENCH_WORK] += b * pushed[i, k] * rates[i, k]
    done = 0.0
    for k in range(n):
        if mode[k] == HELD:
            u[k], path[k], square[k] = 0.0, 0.0, 0.0
        elif mode[k] != FREE:
            works[FRICTION_WORK] -= joints[FRICTION, k] * mode[k] * path[k]
        done += tau[k] * path[k]
    works[EFFORT_WORK] += done
    if flat:
        for k in range(n):
            q[k] += u[k]
    else:
        sweeps.displace(bodies, q, u, q)
    status = sweeps.qd_from_nu(robot, q, nu, qd)
    for k in range(n):
        if mode[k] == HELD:
            qd[k] = 0.0
    if stiff:
        _dissipate(bodies, work, joints, h, spring, rates[0], qd, path, square, works)
    return status


@kernel
def _dissipate(bodies, work, joints, h, spring, first, last, path, square, works):
    """Add the work of dampers, from the first and last rates of a step, ∫q̇ and ∫q̇².

    Where they stop a joint within a fraction of the step its rates at the stages say nothing of ∫q̇², but the impulse times
    the mean rate is the kinetic energy that it takes.
    """
    for i in range(1, len(bodies)):
        if sweeps.owns(bodies, i):
            k = bodies[i].dof
            damping = joints[LIMIT_DAMPING, k] if spring[k] != 0.0 else 0.0
            taken = square[k]
            if h * (damping + joints[DAMPING, k]) > UNRESOLVED * work[i].D:
                taken = max(0.0, 0.5 * path[k] * (first[k] + last[k]))
            works[DAMPING_WORK] -= joints[DAMPING, k] * taken
            works[LIMIT_WORK] -= damping * taken


@large_kernel
def euler_rates(robot, joints, h, tau, pushed, mode, spring, depth, q, qd, after, memory):
    """Rates after a step of semi-implicit Euler: (M + h d + h² k) q̈ = τ − d q̇ − k (x + h q̇) − c − g."""
    added, effort, qdd = memory[0], memory[1], memory[2]
    for k in range(len(qd)):
        resistance = joints[DAMPING, k]
        effort[k], added[k] = tau[k] + pushed[k], 0.0
        if abs(mode[k]) == 1.0:
            effort[k] -= joints[FRICTION, k] * mode[k]
        if spring[k] != 0.0:
            resistance += joints[LIMIT_DAMPING, k]
            effort[k] -= joints[STIFFNESS, k] * (depth[k] + h * qd[k])
            added[k] = h * h * joints[STIFFNESS, k]
        effort[k] -= resistance * qd[k]
        added[k] += h * resistance
    status = sweeps.accelerations_with_added_inertia(robot, q, qd, effort, added, qdd)
    for k in range(len(qd)):
        after[k] = qd[k] + h * qdd[k] if mode[k] != HELD else 0.0
    return status


@large_kernel
def euler_move(robot, flat, joints, h, tau, pushed, mode, spring, depth, first, q, qd, works, memory):
    """What remains of that step once its rates are known: where they lead, in place, and the work done on the way.

    `first` are the rates at its start. Friction takes as much as its impulse times the mean rate, unless the joint has
    turned round.
    """
    bodies, _, _, _ = sweeps.opened(robot)
    n, u = len(qd), memory[3]
    for k in range(n):
        u[k] = h * qd[k]
    if flat:
        for k in range(n):
            q[k] += u[k]
    else:
        sweeps.displace(bodies, q, u, q)
    done, damped, rubbed, stopped, pushing = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        if not (math.isfinite(u[k]) and math.isfinite(q[k])):
            return -1
        done += tau[k] * u[k]
        pushing += pushed[k] * u[k]
        damped -= joints[DAMPING, k] * qd[k] * u[k]
        if abs(mode[k]) == 1.0:
            mean = 0.5 * h * (first[k] + qd[k]) if first[k] * mode[k] >= 0.0 else u[k]
            rubbed -= joints[FRICTION, k] * mode[k] * mean
        if spring[k] != 0.0:  # its work, by the force at the end, and what it has stored
            end = depth[k] + u[k]
            stopped -= (joints[LIMIT_DAMPING, k] * qd[k] + joints[STIFFNESS, k] * end) * u[k]
            stopped += stored(joints[STIFFNESS, k], spring[k] * end) - stored(
                joints[STIFFNESS, k], spring[k] * depth[k]
            )
    works[EFFORT_WORK] += done
    works[WRENCH_WORK] += pushing
    works[DAMPING_WORK] += damped
    works[FRICTION_WORK] += rubbed
    works[LIMIT_WORK] += stopped
    return 0


@large_kernel
def glide(robot, joints, bounds, h, steps, tau, q, qd, last_q, last_qd, added, effort, qdd, path, works):
    """Take steps of semi-implicit Euler until one would end at a limit or fails; returns how many were taken.

    The robot's joints have one degree of freedom each, without friction, wrenches and springs. Order 1 is chosen for speed:
    this is its shortest way.
    """
    n, taken, good = len(qd), 0, True
    for k in range(n):
        added[k], path[k] = h * joints[DAMPING, k], 0.0
    damped = 0.0
    while good and taken < steps:
        for k in range(n):
            last_q[k], last_qd[k] = q[k], qd[k]
            effort[k] = tau[k] - joints[DAMPING, k] * qd[k]
        good = sweeps.accelerations_with_added_inertia(robot, q, qd, effort, added, qdd) == 0
        for k in range(n):
            qd[k] += h * qdd[k]
            q[k] += h * qd[k]
        for k in range(n):
            good &= (
                bounds[LOWER, k] < q[k] and q[k] < bounds[UPPER, k]
            )  # NaN must end here, too: it is within no limits
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
    works[EFFORT_WORK] += done
    works[DAMPING_WORK] += damped
    return taken
