# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of the kinetic energy of a robot whose efforts last for a cycle.

In total joint rates ν the kinetic energy is ½|ν|²: a limit of it is a ball, and limits of the
shares ½ν_k² are a box.
"""

import math

from diag_dynamics.numerics import kernel as nk


@nk.entry_kernel(nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.NUMBER, nk.VECTOR, nk.NUMBER, nk.FILLED_VECTOR)
def project(nu, flow, period, limit, joint_limit, rate, change):
    """Fill the change of ε by which ν + h·flow, the next rates, keep box and ball.

    Returns 1 if there is one. Energies approach their limits, from below and from above, at `rate`
    [1/s].
    """
    share_of_gap, now, ahead, is_limited = min(rate * period, 1.0), 0.0, 0.0, False
    for k in range(len(nu)):
        share, end = 0.5 * nu[k] * nu[k], nu[k] + period * flow[k]
        now += share
        if joint_limit[k] < math.inf:
            largest = math.sqrt(2.0 * (share + share_of_gap * (joint_limit[k] - share)))
            is_limited = is_limited or abs(end) > largest
            end = min(max(end, -largest), largest)
        change[k] = end
        ahead += 0.5 * end * end
    fraction = 1.0
    if limit < math.inf:
        allowed = now + share_of_gap * (limit - now)
        if ahead > allowed:
            fraction, is_limited = math.sqrt(allowed / ahead), True
    for k in range(len(nu)):
        change[k] = (fraction * change[k] - nu[k]) / period - flow[k]
    return 1 if is_limited else 0


@nk.entry_kernel(nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.FILLED_VECTOR)
def saturate(tau, gravity, limit, heavy, saturated):
    """Fill g + s(τ − g) within ± limit, and return s in [0, 1].

    Between the fraction `heavy` of its limit and all of it, gravity takes a joint out of s.
    """
    scale = 1.0
    for k in range(len(tau)):
        moving = tau[k] - gravity[k]
        margin = limit[k] - gravity[k] if moving > 0.0 else limit[k] + gravity[k]
        overload = max((abs(gravity[k]) / limit[k] - heavy) / (1.0 - heavy), 0.0)
        if abs(moving) > max(margin, 0.0) and overload < 1.0:
            factor = margin / abs(moving)
            scale = min(scale, factor + overload * (1.0 - factor))
    for k in range(len(tau)):
        effort = gravity[k] + scale * (tau[k] - gravity[k])
        saturated[k] = min(max(effort, -limit[k]), limit[k])
    return scale


STEPS, BISECTIONS = 60, 6
"""Cycles of the prediction, and bisections between full braking and the demanded effort."""

ROWS = 13
"""Rows of memory of :func:`deliver`."""

ROUNDING = 1e-12
"""Rounding error of efforts from and to those without gravity."""


@nk.kernel
def _brake(momentum, effort, change, period, lower, upper, braking):
    """Fill the next efforts −s p on the way to rest at a bounded rate, where they end at zero.

    p = Mq̇ = mν are the momenta, ṗ = u with a constant M: all decay alike, and K with them. Each is
    a double integrator with |u̇| ≤ R and the switching curve |u| = √(2R|p|). s is the largest rate
    at which all are within theirs and none reverses in a cycle.
    """
    rate = 1.0 / period
    for j in range(len(momentum)):
        if abs(momentum[j]) * rate * rate > 2.0 * change[j] / period:
            rate = math.sqrt(2.0 * change[j] / (period * abs(momentum[j])))
    for j in range(len(momentum)):
        target = min(max(-rate * momentum[j], lower[j]), upper[j])
        braking[j] = min(max(target, effort[j] - change[j]), effort[j] + change[j])


@nk.kernel
def _keeps(inverse, momentum, u, change, period, limit, joint_limit, lower, upper):
    """Return whether braking after the efforts u keeps all limits [J]; momentum and u change."""
    for _ in range(STEPS + 1):
        energy = 0.0
        for i in range(len(u) - 1, -1, -1):
            momentum[i] += period * u[i]
            total_rate = 0.0
            for j in range(i, len(u)):
                total_rate += inverse[i, j] * momentum[j]
            share = 0.5 * total_rate * total_rate
            energy += share
            if share > joint_limit[i]:
                return False
        if energy > limit:
            return False
        _brake(momentum, u, change, period, lower, upper, u)
    return True


@nk.kernel
def _foresee(inverse, nu, effort, near, change, period, limit, joint_limit, rate, rows):
    """Move the efforts `near` towards full braking until braking after them keeps the limits [J].

    Returns whether they brake: the fraction of the way is the least, or all of it where none
    suffices. Energies return to their limits at `rate` [1/s] from above. The prediction is ν̇ = ℓu
    with a constant `inverse` ℓ, where u are efforts without gravity within rows[0] and rows[1].
    `effort` are the last ones, and `change` their largest change in a cycle.
    """
    lower, upper, brake, ahead, u = rows[0], rows[1], rows[2], rows[3], rows[4]
    momentum, allowed = rows[5], rows[6]
    remaining, now = 1.0 - min(rate * period, 1.0), 0.0
    for i in range(len(nu) - 1, -1, -1):
        share, rest = 0.5 * nu[i] * nu[i], nu[i]
        now += share
        allowed[i] = max(joint_limit[i], share * remaining)
        for j in range(i + 1, len(nu)):
            rest -= inverse[i, j] * momentum[j]
        momentum[i] = rest / inverse[i, i]
    limit = max(limit, now * remaining)
    _brake(momentum, effort, change, period, lower, upper, brake)
    good, fraction, step = 0.0, 1.0, 1.0
    for _ in range(BISECTIONS + 1):
        for i in range(len(nu)):
            ahead[i], u[i] = momentum[i], brake[i] + fraction * (near[i] - brake[i])
        step *= 0.5
        if _keeps(inverse, ahead, u, change, period, limit, allowed, lower, upper):
            good = fraction
            if fraction == 1.0:
                break
            fraction += step
        else:
            fraction -= step
    if good == 1.0:
        return False
    for i in range(len(nu)):
        near[i] = brake[i] + good * (near[i] - brake[i])
    return True


@nk.entry_kernel(
    *(nk.MATRIX, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.FLAG),
    *(nk.VECTOR, nk.NUMBER, nk.NUMBER, nk.VECTOR, nk.NUMBER, nk.FILLED_MATRIX),
)
def deliver(
    inverse,
    nu,
    tau,
    gravity,
    last,
    limit,
    heavy,
    compensated,
    effort_rate,
    period,
    energy_limit,
    joint_energy_limit,
    energy_rate,
    rows,
):
    """Fill the rows with the effort to send, the demand and two masks.

    Returns the scale of the effort limits, and whether the effort brakes for the energy. The demand
    is `tau` within the limits; the effort is the nearest to it that `effort_rate` allows after the
    `last` one. Masks: joints at their limits, and joints that wait for their rate. A robot that is
    `compensated` receives efforts without gravity. `inverse` ℓ is empty without an energy limit.
    """
    effort, demand, saturated, waiting = rows[0], rows[1], rows[2], rows[3]
    moving, change, work = rows[4], rows[5], rows[6:]
    scale, is_within = 1.0, True
    for k in range(len(tau)):
        is_within = is_within and abs(tau[k]) <= limit[k]
        demand[k] = tau[k]
    if not is_within:
        scale = saturate(tau, gravity, limit, heavy, demand)
    for k in range(len(tau)):
        bound, offset = limit[k], gravity[k]
        saturated[k] = not is_within and abs(demand[k]) >= bound * (1.0 - ROUNDING)
        if compensated:  # weight beyond the limit is left to the robot
            bound, offset = max(bound, abs(gravity[k])), 0.0
            total = gravity[k] + scale * (tau[k] - gravity[k])
            demand[k] = min(max(total, -bound), bound) - gravity[k]
        work[0, k], work[1, k] = -bound - gravity[k], bound - gravity[k]
        moving[k], change[k] = last[k] - offset, period * effort_rate[k]
        effort[k] = min(max(demand[k] - offset, moving[k] - change[k]), moving[k] + change[k])
    brakes = (
        len(inverse) > 0
        and period > 0.0
        and _foresee(
            inverse,
            nu,
            moving,
            effort,
            change,
            period,
            energy_limit,
            joint_energy_limit,
            energy_rate,
            work,
        )
    )
    for k in range(len(tau)):
        effort[k] += 0.0 if compensated else gravity[k]
        waiting[k] = abs(effort[k] - demand[k]) > ROUNDING * (1.0 + abs(demand[k]))
    return scale, brakes


@nk.entry_kernel(nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.FILLED_MATRIX)
def demand_rate(tau, gravity, rate, period, rows):
    """Return the rate of τ − g relative to the largest one, and the joint where it is largest.

    Of each joint the least demand of this and the last cycles counts. The rows have the last τ − g
    and the last demands. Without a period there is none.
    """
    largest, joint = 0.0, 0
    for k in range(len(tau)):
        moving = tau[k] - gravity[k]
        if period > 0.0:
            demand = abs(moving - rows[0, k]) / (period * rate[k])
            least = demand
            for row in range(len(rows) - 1, 0, -1):
                least = min(least, rows[row, k])
                rows[row, k] = rows[row - 1, k] if row > 1 else demand
            if least > largest:
                largest, joint = least, k
        rows[0, k] = moving
    return largest, joint
