# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of the kinetic energy of a robot whose efforts last for a cycle.

In total joint rates ν the kinetic energy is ½|ν|²: a limit of it is a ball, and limits of the
shares ½ν_k² are a box.
"""

import math

from diag_dynamics.numerics import kernel as nk


@nk.kernel
def _approach(energy, limit, fraction):
    """Return the energy that a cycle may end with: a fraction of the way to the limit is gone."""
    return energy + fraction * (limit - energy)


@nk.entry_kernel(nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.NUMBER, nk.VECTOR, nk.FILLED_VECTOR)
def project(nu, end, fraction, limit, joint_limit, change):
    """Fill the change of the total rates at the end of a cycle by which they keep box and ball.

    `nu` are the rates at its begin. Energies approach their limits, from below and from above, by
    the `fraction` of a cycle.
    """
    # Box: |ν₊_k| ≤ √(2 b_k), b_k = ½ν_k² + fraction (K_k − ½ν_k²). `change` holds ν₊ so far.
    now = 0.0
    then = 0.0
    for k in range(len(nu)):
        share = 0.5 * nu[k] * nu[k]
        largest = math.sqrt(2.0 * _approach(share, joint_limit[k], fraction))
        change[k] = min(max(end[k], -largest), largest)
        now += share
        then += 0.5 * change[k] * change[k]
    # Ball: ν₊ times min(1, √(2b)/|ν₊|), b = K + fraction (K_max − K). Division by 0 gives inf.
    scale = math.sqrt(min(_approach(now, limit, fraction) / then, 1.0))
    for k in range(len(nu)):
        change[k] = scale * change[k] - end[k]


HEAVY = 0.9
"""Fraction of its effort limit beyond which gravity takes a joint out of the common scale."""


@nk.kernel
def _saturate(moving, lower, upper, heavy):
    """Scale efforts without gravity by a common s in [0, 1] into their bounds, and return s.

    One s keeps the sign of their power, where cuts joint by joint can turn braking into driving.
    Between the fraction `heavy` of its limit and all of it, gravity takes a joint out of s.
    """
    scale = 1.0
    for k in range(len(moving)):
        # Effort that gravity leaves in this direction; none where gravity exceeds the limit.
        margin = max(upper[k] if moving[k] > 0.0 else -lower[k], 0.0)
        if abs(moving[k]) > margin:
            # |g| by its limit b: the bounds ±b − g have the sum −2g and the difference 2b.
            weight = abs(upper[k] + lower[k]) / (upper[k] - lower[k])
            overload = 1.0 if weight >= 1.0 else max((weight - heavy) / (1.0 - heavy), 0.0)
            # overload = 1 leaves s as it is: gravity alone uses the joint's limit.
            factor = margin / abs(moving[k])
            scale = min(scale, factor + overload * (1.0 - factor))
    # Joints that gravity took out of s, and gravity beyond a limit, need the bounds themselves.
    for k in range(len(moving)):
        moving[k] = min(max(scale * moving[k], lower[k]), upper[k])
    return scale


STEPS, DOUBLED, BISECTIONS = 60, 15, 6
"""Steps of the prediction, after how many they are twice as long, and bisections between full
braking and the demanded effort."""

FORESEEN, PREDICTED = 0.8, 0.7
"""Fractions of the gap to a limit and of the effort rate that foreseen braking uses.

The rest covers its prediction: while efforts are removed, ℓ turns with the arm, and the rate serves
the change of gravity, too.
"""

ROWS = 16
"""Rows of memory of :func:`deliver`."""

ROUNDING = 1e-12
"""Rounding error of efforts from and to those without gravity."""


@nk.kernel
def _brake(momentum, rates, effort, change, period, cycles, lower, upper, braking):
    """Fill the next efforts −s p on the way to rest at a bounded rate, where they end at zero.

    p = Mq̇ = mν are the momenta, ṗ = u with a constant M: all decay alike, and K with them. Each is
    a double integrator with |u̇| ≤ R and the switching curve |u| = √(2R|p|). s is the largest rate
    at which all are within theirs and their bounds, and none reverses in a step of some cycles: K
    rises where some momenta decay and others do not.

    Where rates and bounds leave efforts that drive, uᵀq̇ > 0, each joint takes the lower power of
    two: on its way to −s p, or to zero if its effort drives and unchanged if it brakes. Without
    efforts K is constant in any motion, because Coriolis forces do no work.
    """
    # s ≤ 1/step: no momentum reverses within the step. s|p| ≤ √(2R|p|) with R = change/period.
    rate = 1.0 / (cycles * period)
    power = 0.0
    for j in range(len(momentum)):
        curve = 2.0 * change[j] / period
        if abs(momentum[j]) * rate * rate > curve:
            rate = math.sqrt(curve / abs(momentum[j]))
    # −s p within the effort bounds, by a common scale, so that all momenta decay alike.
    for j in range(len(momentum)):
        braking[j] = -rate * momentum[j]
    _saturate(braking, lower, upper, 1.0)
    # Efforts that the rate R reaches within the step, and their power uᵀq̇.
    for j in range(len(momentum)):
        most = cycles * change[j]
        braking[j] = min(max(braking[j], effort[j] - most), effort[j] + most)
        power += braking[j] * rates[j]
    # Where they drive: of each joint the lower power of this effort and of its last one, which is
    # on its way to zero if it drives.
    for j in range(len(momentum) if power > 0.0 else 0):
        other = effort[j]
        most = cycles * change[j]
        if other * rates[j] > 0.0:
            other -= min(max(other, -most), most)
        if other * rates[j] < braking[j] * rates[j]:
            braking[j] = min(max(other, lower[j]), upper[j])


@nk.kernel
def _keeps(inverse, momentum, rates, rows, change, period, limit, joint_limit, lower, upper):
    """Return whether braking after the efforts rows[0] keeps all limits [J].

    Momentum and rows change.
    """
    u = rows[0]
    braking = rows[1]
    cycles = 1.0
    for step in range(1, STEPS + 2):
        energy = 0.0
        for i in range(len(u)):
            rates[i] = 0.0
        # p ← p + h u with M constant, ν = ℓp, q̇ = ℓᵀν. ℓ is upper triangular: ν_i needs p_j of
        # j ≥ i at the end of the step, hence the order from the last joint to the first.
        for i in range(len(u) - 1, -1, -1):
            momentum[i] += cycles * period * u[i]
            total_rate = 0.0
            for j in range(i, len(u)):
                total_rate += inverse[i, j] * momentum[j]
            for j in range(i, len(u)):
                rates[j] += inverse[i, j] * total_rate
            share = 0.5 * total_rate * total_rate
            energy += share
            if share > joint_limit[i]:
                return False
        if energy > limit:
            return False
        # Steps double in length, so that their fixed number covers long ways to rest as well.
        if step % DOUBLED == 0:
            cycles *= 2.0
        _brake(momentum, rates, u, change, period, cycles, lower, upper, braking)
        for i in range(len(u)):
            u[i] = braking[i]
    return True


@nk.kernel
def _foreseen(energy, limit, fraction):
    """Return the limit of the energies that are foreseen."""
    return _approach(energy, limit, FORESEEN if energy < limit else fraction)


@nk.kernel
def _foresee(inverse, nu, effort, near, change, period, limit, joint_limit, fraction, rows):
    """Move the efforts `near` towards full braking until braking after them keeps the limits [J].

    Returns whether they brake: the part of the way is the least, or all of it where none suffices.
    Energies return to their limits by a `fraction` in each cycle from above. The prediction is
    ν̇ = ℓu with a constant `inverse` ℓ, where u are efforts without gravity within rows[0] and
    rows[1]. `effort` are the last ones, and `change` their largest change in a cycle.
    """
    lower = rows[0]
    upper = rows[1]
    brake = rows[2]
    ahead = rows[3]
    momentum = rows[4]
    allowed = rows[5]
    rates = rows[6]
    slow = rows[7]
    predicted = rows[8:]
    # From the last joint to the first: q̇ = ℓᵀν, and p = mν from ℓp = ν by back substitution,
    # with K, its shares, and the limits of both.
    for i in range(len(nu)):
        rates[i] = 0.0
    now = 0.0
    for i in range(len(nu) - 1, -1, -1):
        share = 0.5 * nu[i] * nu[i]
        rest = nu[i]
        now += share
        for j in range(i, len(nu)):
            rates[j] += inverse[i, j] * nu[i]
        allowed[i] = _foreseen(share, joint_limit[i], fraction)
        for j in range(i + 1, len(nu)):
            rest -= inverse[i, j] * momentum[j]
        momentum[i] = rest / inverse[i, i]
    limit = _foreseen(now, limit, fraction)
    # Full braking in this cycle, and bisection of the part of the way from there to `near`, which
    # is tried first. The prediction brakes at a lower rate than the first cycle.
    _brake(momentum, rates, effort, change, period, 1.0, lower, upper, brake)
    good = 0.0
    part = 1.0
    step = 1.0
    for i in range(len(nu)):
        slow[i] = PREDICTED * change[i]
    for _ in range(BISECTIONS + 1):
        for i in range(len(nu)):
            # _keeps changes its momenta and efforts.
            ahead[i] = momentum[i]
            predicted[0, i] = brake[i] + part * (near[i] - brake[i])
        step *= 0.5
        if _keeps(inverse, ahead, rates, predicted, slow, period, limit, allowed, lower, upper):
            good = part
            if part == 1.0:
                break
            part += step
        else:
            part -= step
    # good = 1: `near` itself keeps the limits; 0: no part does, and full braking remains.
    if good == 1.0:
        return False
    for i in range(len(nu)):
        near[i] = brake[i] + good * (near[i] - brake[i])
    return True


@nk.entry_kernel(
    *(nk.MATRIX, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.FLAG, nk.VECTOR),
    *(nk.NUMBER, nk.NUMBER, nk.VECTOR, nk.NUMBER, nk.FILLED_MATRIX),
)
def deliver(
    inverse,
    nu,
    tau,
    gravity,
    last,
    limit,
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
    effort = rows[0]
    demand = rows[1]
    saturated = rows[2]
    waiting = rows[3]
    moving = rows[4]
    change = rows[5]
    work = rows[6:]
    # Without gravity: demand τ − g and its bounds ±limit − g, then one scale into these.
    is_within = True
    for k in range(len(tau)):
        is_within = is_within and abs(tau[k]) <= limit[k]
        bound = limit[k]
        if compensated:  # weight beyond the limit is left to the robot
            bound = max(bound, abs(gravity[k]))
        work[0, k] = -bound - gravity[k]
        work[1, k] = bound - gravity[k]
        demand[k] = tau[k] - gravity[k]
    scale = _saturate(demand, work[0], work[1], HEAVY)
    for k in range(len(tau)):
        # A limit counts as reached within rounding, since g has been subtracted and added again.
        offset = 0.0 if compensated else gravity[k]
        saturated[k] = not is_within and abs(gravity[k] + demand[k]) >= limit[k] * (1.0 - ROUNDING)
        # The last effort less gravity of this cycle: its rate limit includes the change of gravity.
        moving[k] = last[k] - offset
        change[k] = period * effort_rate[k]
        effort[k] = min(max(demand[k], moving[k] - change[k]), moving[k] + change[k])
    # Foreseen braking moves the effort; the first command has no period and remains.
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
            min(energy_rate * period, 1.0),
            work,
        )
    )
    # Efforts to send have gravity again, unless the robot adds it.
    for k in range(len(tau)):
        offset = 0.0 if compensated else gravity[k]
        effort[k] += offset
        demand[k] += offset
        waiting[k] = abs(effort[k] - demand[k]) > ROUNDING * (1.0 + abs(demand[k]))
    return scale, brakes


@nk.entry_kernel(nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.FILLED_MATRIX)
def demand_rate(tau, gravity, rate, period, rows):
    """Return the rate of τ − g relative to the largest one, and the joint where it is largest.

    Of each joint the least demand of this and the last cycles counts. The rows have the last τ − g
    and the last demands. Without a period there is none.
    """
    largest = 0.0
    joint = 0
    for k in range(len(tau)):
        moving = tau[k] - gravity[k]
        if period > 0.0:
            # Change of τ − g in units of the largest one, R times the period.
            demand = abs(moving - rows[0, k]) / (period * rate[k])
            least = demand
            # From the oldest demand to the last: the least of all, each one row on.
            for row in range(len(rows) - 1, 0, -1):
                least = min(least, rows[row, k])
                rows[row, k] = rows[row - 1, k] if row > 1 else demand
            if least > largest:
                largest = least
                joint = k
        rows[0, k] = moving
    return largest, joint
