# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Modes of joints: which slide, stick, rest at a hard limit or lean on a compliant one.

A sliding joint of Coulomb friction f has the torque −f sign(q̇). A joint at rest sticks while less
than f holds it. At a hard limit a joint rests while the limit pushes it back. Each degree of
freedom has in a step

* a mode: FREE, HELD, or 1 and −1, the direction in which it slides;
* a spring: the side, 1 or −1, of the compliant limit on which it leans; 0 for none;
* a depth: its distance beyond a limit, negative beyond the lower one [rad, m].
"""

import math

from diag_dynamics.numerics.kernel import kernel, large_kernel
from diag_dynamics.simulation import flexible
from diag_dynamics.simulation.step_memory import opened
from diag_dynamics.sweeps import classical, factorization

FREE, HELD = 0.0, 2.0

ROUNDING = 1e-12
"""Rounding error of an impulse, relative to the terms of which it is the difference."""

NO_FORCE = 1e-9
"""Force of a compliant limit, relative to its parts, that counts as zero."""

ROUNDS_OF_ALL = 3
"""Rounds that change the modes of all joints together; later rounds change one each and end."""


@kernel
def _limit_force(stiffness, damping, side, depth, rate):
    """Force of a compliant limit into the range, and the sum of the sizes of its parts."""
    elastic = stiffness * side * depth
    viscous = damping * side * rate
    return elastic + viscous, elastic + abs(viscous)


@kernel
def is_tied(sim, k):
    """Whether a spring draws a joint to one position from both sides: a flexible link's mode."""
    return sim.lower[k] == sim.upper[k] and sim.stiffness[k] < math.inf


@kernel
def spring_start(sim, k):
    """Depth from which a spring acts: of one that is met in the step, half the way counts."""
    is_met = sim.spring[k] * sim.depth[k] < 0.0 and sim.weight[k] == 0.5 and not is_tied(sim, k)
    return 0.5 * sim.depth[k] if is_met else sim.depth[k]


@large_kernel
def classify_joints(address):
    """Set mode, spring and depth of each joint from q and q̇."""
    sim = opened(address)
    for k in range(len(sim.qd)):
        x = sim.q[sim.coordinate[k]]
        rate = sim.qd[k]
        side = 0.0
        depth = 0.0
        if x >= sim.upper[k]:
            side = 1.0
            depth = x - sim.upper[k]
        elif x <= sim.lower[k]:
            side = -1.0
            depth = x - sim.lower[k]
        sim.mode[k] = FREE
        sim.spring[k] = 0.0
        sim.depth[k] = depth
        if is_tied(sim, k):
            sim.spring[k] = 1.0
            side = 0.0
        if side != 0.0 and sim.stiffness[k] < math.inf:
            force, size = _limit_force(sim.stiffness[k], sim.limit_damping[k], side, depth, rate)
            if force > NO_FORCE * size or (size == 0.0 and side * rate > 0.0):
                sim.spring[k] = side
            side = 0.0
        if rate == 0.0 and (sim.friction[k] > 0.0 or side != 0.0):
            sim.mode[k] = HELD
        elif sim.friction[k] > 0.0:
            sim.mode[k] = math.copysign(1.0, rate)


@large_kernel
def solve_step(address, h, tau):
    """Solve a step for q̇⁺ with friction: set `mode` and `after`. Return a status.

    (M + A) q̇⁺ = M q̇ − A (1 − w)/w q̇ + h (τ + Jᵀf − c − g − k x) + λ

    with A = h w (d + w h k), dampers d, springs k and weights w. M, g and Jᵀf are at the position
    `place`, c has the rates `middle`. A held joint has q̇⁺ = 0 and an impulse |λ| ≤ h f. A sliding
    one moves in its direction with λ = −h f mode. A hard limit bounds λ on one side only. This
    linear complementarity problem has a positive definite matrix. In each round joints that violate
    the condition of their mode change it. The last rounds release no joint: so they end in spite of
    rounding errors, and friction adds no energy.
    """
    sim = opened(address)
    n = len(tau)
    changed = True
    flexible.eliminate_motors(address, h, tau)
    for k in range(n):
        sim.qdd[k] = -sim.before[k] / h
    status = classical.inverse_dynamics(sim.robot, sim.place, sim.middle, sim.qdd, 1.0, sim.bias)
    round_ = 0
    last_release = ROUNDS_OF_ALL + 2 * n
    while changed and status == 0:
        status = _solve_modes(address, h, tau)
        changed = status == 0 and _exchange_modes(
            address, h, round_ < ROUNDS_OF_ALL, round_ < last_release
        )
        round_ += 1
    return status


@large_kernel
def _solve_modes(address, h, tau):
    """Solve for `after`, q̇⁺ of the present modes; `momentum` is the right side, `needed` M q̇⁺."""
    sim = opened(address)
    holding = False
    for k in range(len(tau)):
        mode = sim.mode[k]
        weight = sim.weight[k]
        before = sim.before[k]
        damping = sim.damping[k]
        stiffness = 0.0
        if sim.spring[k] != 0.0:
            damping += sim.fraction[k] * sim.limit_damping[k]
            stiffness = sim.fraction[k] * sim.stiffness[k]
        E = flexible.implicit_inertia(stiffness, damping, weight, h)
        momentum = h * (sim.link_effort[k] + sim.pushed[k] - sim.bias[k])
        momentum += (sim.reflected[k] - E * (1.0 - weight) / weight) * before
        momentum -= h * stiffness * spring_start(sim, k)
        if abs(mode) == 1.0:
            momentum -= h * sim.friction[k] * mode
        sim.momentum[k] = momentum
        sim.added[k] = math.inf if mode == HELD else E + sim.reflected[k]
        holding |= mode == HELD
    status = factorization.qd_from_momentum(
        sim.robot, sim.place, sim.added, sim.momentum, sim.after
    )
    if status != 0 or not holding:
        return status
    for k in range(len(tau)):
        if sim.mode[k] == HELD:
            sim.after[k] = 0.0
    return classical.inverse_dynamics(sim.robot, sim.place, sim.zeros, sim.after, 0.0, sim.needed)


@large_kernel
def _exchange_modes(address, h, all_together, may_release):
    """Hold joints that slide back, release those beyond bounds; return whether a mode changed."""
    sim = opened(address)
    changed = False
    for k in range(len(sim.mode)):
        if sim.mode[k] == FREE or (changed and not all_together):
            continue
        if sim.mode[k] != HELD:
            if sim.mode[k] * sim.after[k] < 0.0:
                sim.mode[k] = HELD
                changed = True
        elif may_release:
            low = -h * sim.friction[k]
            high = h * sim.friction[k]
            if sim.stiffness[k] == math.inf:
                x = sim.first_q[sim.coordinate[k]]
                low = -math.inf if x >= sim.upper[k] else low
                high = math.inf if x <= sim.lower[k] else high
            impulse = sim.needed[k] - sim.momentum[k]
            slack = ROUNDING * (abs(sim.needed[k]) + abs(sim.momentum[k]))
            if impulse > high + slack:
                sim.mode[k] = -1.0
                changed = True
            elif impulse < low - slack:
                sim.mode[k] = 1.0
                changed = True
    return changed
