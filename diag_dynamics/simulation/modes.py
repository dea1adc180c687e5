# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Modes of joints: which slide, stick, rest at a hard limit or lean on a compliant one.

A sliding joint of Coulomb friction f has the torque −f sign(q̇). A joint at rest sticks while less than f holds it. At a hard
limit a joint rests while the limit pushes it back. Each degree of freedom has in a step

* a mode: FREE, HELD, or 1 and −1, the direction in which it slides;
* a spring: the side, 1 or −1, of the compliant limit on which it leans; 0 for none;
* a depth: its distance beyond a limit, negative beyond the lower one [rad, m].
"""

import math

from diag_dynamics.numerics.kernel import kernel, large_kernel
from diag_dynamics.simulation import flexible
from diag_dynamics.simulation.memory import opened
from diag_dynamics.sweeps import classical, factorization, kinematics
from diag_dynamics.sweeps import workspace as ws

FREE, HELD = 0.0, 2.0

ROUNDING = 1e-12
"""Rounding error of an impulse, relative to the terms of which it is the difference."""

NO_FORCE = 1e-9
"""Force of a compliant limit, relative to its parts, that counts as zero."""

ROUNDS_OF_ALL = 3
"""Rounds that change the modes of all joints together; later ones change one each, so that they end."""


@kernel
def _limit_force(stiffness, damping, side, depth, rate):
    """Force of a compliant limit into the range, and the sum of the sizes of its parts."""
    elastic, viscous = stiffness * side * depth, damping * side * rate
    return elastic + viscous, elastic + abs(viscous)


@kernel
def is_tied(sim, k):
    """Whether a spring draws a joint to one position from both sides, as a mode of a flexible link."""
    return sim.lower[k] == sim.upper[k] and sim.stiffness[k] < math.inf


@large_kernel
def classify_joints(address):
    """Set mode, spring and depth of each joint from q and q̇; return whether a joint has a mode, and whether one leans."""
    sim = opened(address)
    has_modes, has_springs = False, False
    for k in range(len(sim.qd)):
        x, rate = sim.q[sim.coordinate[k]], sim.qd[k]
        side, depth = 0.0, 0.0
        if x >= sim.upper[k]:
            side, depth = 1.0, x - sim.upper[k]
        elif x <= sim.lower[k]:
            side, depth = -1.0, x - sim.lower[k]
        sim.mode[k], sim.spring[k], sim.depth[k] = FREE, 0.0, depth
        if is_tied(sim, k):
            sim.spring[k], has_springs, side = 1.0, True, 0.0
        if side != 0.0 and sim.stiffness[k] < math.inf:
            force, size = _limit_force(sim.stiffness[k], sim.limit_damping[k], side, depth, rate)
            if force > NO_FORCE * size or (size == 0.0 and side * rate > 0.0):
                sim.spring[k], has_springs = side, True
            side = 0.0
        if rate == 0.0 and (sim.friction[k] > 0.0 or side != 0.0):
            sim.mode[k], has_modes = HELD, True
        elif sim.friction[k] > 0.0:
            sim.mode[k], has_modes = math.copysign(1.0, rate), True
    return has_modes, has_springs


@large_kernel
def solve_stiction(address, h, tau):
    """Solve an implicit Euler step with friction: set `mode` and `after`, the rates after it. Return a status.

    (M + A) q̇⁺ = M q̇ + h (τ + Jᵀf − c − g − k x) + λ with A = h d + h² k, dampers d and springs k. A held joint has q̇⁺ = 0
    and an impulse |λ| ≤ h f; a sliding one moves in its direction with λ = −h f mode. A hard limit bounds λ on one side only.
    This linear complementarity problem has a positive definite matrix. In each round joints that
    violate the condition of their mode change it. The last rounds release no joint: so they end in
    spite of rounding errors, and friction adds no energy.
    """
    sim = opened(address)
    n, changed = len(tau), True
    flexible.eliminate_motors(address, h, tau)
    for k in range(n):
        sim.qdd[k] = -sim.qd[k] / h
    status = classical.inverse_dynamics(sim.robot, sim.q, sim.qd, sim.qdd, 1.0, sim.bias)
    round_, last_release = 0, ROUNDS_OF_ALL + 2 * n
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
        mode, added = sim.mode[k], h * sim.damping[k] + sim.reflected[k]
        momentum = (
            h * (sim.link_effort[k] + sim.pushed[k] - sim.bias[k]) + sim.reflected[k] * sim.qd[k]
        )
        if sim.spring[k] != 0.0:
            added += h * (sim.limit_damping[k] + h * sim.stiffness[k])
            momentum -= h * sim.stiffness[k] * sim.depth[k]
        if abs(mode) == 1.0:
            momentum -= h * sim.friction[k] * mode
        sim.added[k], sim.momentum[k] = math.inf if mode == HELD else added, momentum
        holding |= mode == HELD
    status = factorization.qd_from_momentum(sim.robot, sim.q, sim.added, sim.momentum, sim.after)
    if status != 0 or not holding:
        return status
    for k in range(len(tau)):
        if sim.mode[k] == HELD:
            sim.after[k] = 0.0
    return classical.inverse_dynamics(sim.robot, sim.q, sim.zeros, sim.after, 0.0, sim.needed)


@large_kernel
def _exchange_modes(address, h, all_together, may_release):
    """Hold joints that slide back, release those beyond their bounds; return whether a mode changed."""
    sim = opened(address)
    changed = False
    for k in range(len(sim.mode)):
        if sim.mode[k] == FREE or (changed and not all_together):
            continue
        if sim.mode[k] != HELD:
            if sim.mode[k] * sim.after[k] < 0.0:
                sim.mode[k], changed = HELD, True
        elif may_release:
            low, high = -h * sim.friction[k], h * sim.friction[k]
            if sim.stiffness[k] == math.inf:
                x = sim.q[sim.coordinate[k]]
                low, high = (
                    -math.inf if x >= sim.upper[k] else low,
                    math.inf if x <= sim.lower[k] else high,
                )
            impulse = sim.needed[k] - sim.momentum[k]
            slack = ROUNDING * (abs(sim.needed[k]) + abs(sim.momentum[k]))
            if impulse > high + slack:
                sim.mode[k], changed = -1.0, True
            elif impulse < low - slack:
                sim.mode[k], changed = 1.0, True
    return changed


@large_kernel
def is_stopping(address):
    """Whether the solved step stops or reverses a joint that slides."""
    sim = opened(address)
    for k in range(len(sim.qd)):
        if sim.friction[k] > 0.0 and sim.qd[k] != 0.0 and sim.mode[k] * sim.qd[k] <= 0.0:
            return True
        if sim.mode[k] == HELD and sim.qd[k] != 0.0:
            return True
    return False


@large_kernel
def is_mode_left(address):
    """Whether a joint has left its mode in the step: it slid back, has passed a limit, or left one."""
    sim = opened(address)
    for k in range(len(sim.qd)):
        x, spring, stiffness = sim.q[sim.coordinate[k]], sim.spring[k], sim.stiffness[k]
        if sim.mode[k] == HELD:
            continue
        if sim.friction[k] > 0.0 and sim.mode[k] * sim.qd[k] < 0.0:
            return True
        if is_tied(sim, k):
            continue
        if spring == 0.0 and (sim.depth[k] == 0.0 or stiffness == math.inf):
            if x > sim.upper[k] or x < sim.lower[k]:
                return True
        else:
            side = spring if spring != 0.0 else math.copysign(1.0, sim.depth[k])
            depth = x - (sim.upper[k] if side > 0.0 else sim.lower[k])
            force, _ = _limit_force(stiffness, sim.limit_damping[k], side, depth, sim.qd[k])
            if (spring != 0.0 and force < 0.0) or (
                spring == 0.0 and side * depth > 0.0 and force > 0.0
            ):
                return True
    return False


@large_kernel
def lock_joints(address):
    """Lock the joints that are held; return whether there are any."""
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    holding = False
    for k in range(len(sim.mode)):
        sim.locks[k] = 1.0 if sim.mode[k] == HELD else 0.0
        holding |= sim.mode[k] == HELD
    kinematics.lock_joints(bodies, sim.armature, sim.locks)
    return holding


@large_kernel
def unlock_joints(address):
    """Unlock all joints."""
    sim = opened(address)
    bodies, _, _, _ = ws.opened(sim.robot)
    kinematics.lock_joints(bodies, sim.armature, sim.zeros)
