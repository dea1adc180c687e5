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

ROWS = 9
"""Rows of memory of :func:`foresee`."""


@nk.kernel
def _brake(inverse, mobility, slope, nu, effort, change, period, lower, upper, braking):
    """Fill the next efforts on the fastest way to rest of each joint, at a bounded rate.

    They end without effort. D q̈ = u, D = 1/(ℓᵀℓ)_jj the inertia of a joint while all others are
    free, and |u̇| ≤ R make it a double integrator, whose switching curve is u = −sign(q̇)
    √(2RD|q̇|).
    """
    for j in range(len(nu)):
        rate = 0.0
        for i in range(j + 1):
            rate += inverse[i, j] * nu[i]
        momentum = abs(rate) / mobility[j]
        size = min(math.sqrt(slope[j] * momentum), momentum / period)
        target = min(max(math.copysign(size, -rate), lower[j]), upper[j])
        braking[j] = min(max(target, effort[j] - change[j]), effort[j] + change[j])


@nk.kernel
def _keeps(inverse, mobility, slope, nu, u, change, period, limit, joint_limit, lower, upper):
    """Return whether braking after the efforts u keeps all limits [J]; ν and u change."""
    for _ in range(STEPS + 1):
        energy = 0.0
        for i in range(len(nu)):
            total_rate = nu[i]
            for j in range(i, len(nu)):
                total_rate += period * inverse[i, j] * u[j]
            nu[i], share = total_rate, 0.5 * total_rate * total_rate
            energy += share
            if share > joint_limit[i]:
                return False
        if energy > limit:
            return False
        _brake(inverse, mobility, slope, nu, u, change, period, lower, upper, u)
    return True


@nk.entry_kernel(
    *(nk.MATRIX, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.NUMBER),
    *(nk.NUMBER, nk.VECTOR, nk.NUMBER, nk.VECTOR, nk.VECTOR, nk.FILLED_MATRIX),
)
def foresee(
    inverse, nu, effort, demand, change, period, limit, joint_limit, rate, gravity, bound, rows
):
    """Fill rows[0] with efforts between full braking and those within the change of `effort`.

    Returns 1 if they brake. They are the nearest to the demand after which braking keeps the limits
    [J], to which energies return at `rate` [1/s] from above; without any, full braking. The
    prediction is ν̇ = ℓu with a constant `inverse` ℓ, where u are efforts without gravity. `change`
    is the largest change of an effort in a cycle, `bound` the largest effort with gravity; rows:
    (ROWS, nv).
    """
    near, brake, ahead, u = rows[0], rows[1], rows[2], rows[3]
    lower, upper, mobility, slope, allowed = rows[4], rows[5], rows[6], rows[7], rows[8]
    remaining, now = 1.0 - min(rate * period, 1.0), 0.0
    for j in range(len(nu)):
        share, mobility[j] = 0.5 * nu[j] * nu[j], 0.0
        now += share
        allowed[j] = max(joint_limit[j], share * remaining)
        lower[j], upper[j] = -bound[j] - gravity[j], bound[j] - gravity[j]
        slope[j] = 2.0 * change[j] / period
        for i in range(j + 1):
            mobility[j] += inverse[i, j] * inverse[i, j]
        near[j] = min(max(demand[j], effort[j] - change[j]), effort[j] + change[j])
    limit = max(limit, now * remaining)
    _brake(inverse, mobility, slope, nu, effort, change, period, lower, upper, brake)
    good, fraction, step = 0.0, 1.0, 1.0
    for _ in range(BISECTIONS + 1):
        for i in range(len(nu)):
            ahead[i], u[i] = nu[i], brake[i] + fraction * (near[i] - brake[i])
        step *= 0.5
        if _keeps(inverse, mobility, slope, ahead, u, change, period, limit, allowed, lower, upper):
            good = fraction
            if fraction == 1.0:
                break
            fraction += step
        else:
            fraction -= step
    if good == 1.0:
        return 0
    for i in range(len(nu)):
        near[i] = brake[i] + good * (near[i] - brake[i])
    return 1
