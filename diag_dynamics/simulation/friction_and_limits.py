# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Friction and limits: which joints slide, stick, rest at a stop or lean on a spring, and when that ends.

A joint of Coulomb friction f slides where it moves, with a torque of −f sign(q̇), and where it does not move sticks as long as
less than f will hold it. At a hard limit it rests as long as that pushes it back and no more. Which joints at rest stay there
is decided together: each held one needs a torque λ within its bounds, each released one goes the way it was released.
"""

import math

from diag_dynamics import sweeps
from diag_dynamics.compiled.kernel import kernel, large_kernel
from diag_dynamics.simulation.layout import FREE, HELD, conduct_of, memory_of, state_of, system_of

ROUNDING = 1e-12
"""Rounding error of a torque, relative to the terms it is the difference of: within it a bound holds."""

NO_FORCE = 1e-9
"""Force of a compliant limit, relative to its parts, that counts as none."""

ALL_AT_ONCE = 3
"""Rounds that change all unsettled joints together. Later rounds change only the first one, or they might not end."""


@kernel
def reach(bound, x):
    """Side of the limit that a coordinate is at or beyond (−1, 1, 0 for none), and the distance beyond, with that sign."""
    if x >= bound.upper:
        return 1.0, x - bound.upper
    if x <= bound.lower:
        return -1.0, x - bound.lower
    return 0.0, 0.0


@kernel
def limited(bodies, i):
    """Whether a body's degree of freedom can have limits: its joint has one, and it is no follower."""
    return bodies[i].dofs == 1 and sweeps.owns(bodies, i)


@kernel
def compliant(joint):
    """Whether a joint's limits give way."""
    return math.isfinite(joint.stiffness)


@kernel
def pushing_back(joint, side, depth, rate):
    """Force of a compliant limit into its range, and the sum of its parts' sizes."""
    elastic, viscous = joint.stiffness * side * depth, joint.limit_damping * side * rate
    return elastic + viscous, elastic + abs(viscous)


@large_kernel
def look(simulation):
    """Mode of every degree of freedom by where it is and how it moves; returns whether any may be held."""
    system, state, conduct = system_of(simulation), state_of(simulation), conduct_of(simulation)
    bodies, q, qd = system.bodies, state.q, state.qd
    resting = False
    for i in range(1, len(bodies)):
        if not sweeps.owns(bodies, i):
            continue
        k, c = bodies[i].dof, bodies[i].q
        joint, own = system.joints[k], conduct[k]
        own.mode = FREE
        own.spring = own.depth = side = 0.0
        if limited(bodies, i):
            side, own.depth = reach(system.bounds[c], q[c])
            if side != 0.0 and compliant(joint):
                force, size = pushing_back(joint, side, own.depth, qd[k])
                if force > NO_FORCE * size or (size == 0.0 and side * qd[k] > 0.0):
                    own.spring = side
                side = 0.0
        if qd[k] == 0.0 and (joint.friction > 0.0 or side != 0.0):
            own.mode = HELD
            resting = True
        elif joint.friction > 0.0:
            own.mode = 1.0 if qd[k] > 0.0 else -1.0
    return resting


@large_kernel
def settle(simulation):
    """Of the joints at rest, hold those that stay there and release the others; hold them in the robot, too.

    The mode of each must be HELD at first. It is a linear complementarity problem of a positive definite matrix, solved by
    exchange of joints that contradict themselves. Should rounding keep it from an end, the last choice stands: a joint
    held too long does no work.
    """
    system, memory, conduct = system_of(simulation), memory_of(simulation), conduct_of(simulation)
    bodies, joints, (q, qd, _) = system.bodies, system.joints, state_of(simulation)
    effort, qdd, needed = memory.effort, memory.qdd, memory.needed
    n = len(qd)
    for round_ in range(ALL_AT_ONCE + 2 * n):
        sweeps.hold(bodies, system.armature, _held(conduct, needed))
        for k in range(n):
            effort[k] = memory.applied[k] - joints[k].damping * qd[k]
            if conduct[k].mode != FREE and conduct[k].mode != HELD:
                effort[k] -= joints[k].friction * conduct[k].mode
            if conduct[k].spring != 0.0:
                effort[k] -= joints[k].limit_damping * qd[k] + joints[k].stiffness * conduct[k].depth
        status = sweeps.accelerations_with_added_inertia(system.robot, q, qd, effort, memory.none, qdd)
        if status != 0:
            return status
        for k in range(n):
            if conduct[k].mode == HELD:
                qdd[k] = 0.0
        status = sweeps.inverse_dynamics(system.robot, q, qd, qdd, 1.0, needed)
        if status != 0:
            return status
        changed = False
        for i in range(1, len(bodies)):
            k = bodies[i].dof
            if (
                not sweeps.owns(bodies, i)
                or conduct[k].mode == FREE
                or qd[k] != 0.0
                or (changed and round_ >= ALL_AT_ONCE)
            ):
                continue
            if conduct[k].mode == HELD:
                low, high = -joints[k].friction, joints[k].friction
                if limited(bodies, i) and not compliant(joints[k]):
                    x, bound = q[bodies[i].q], system.bounds[bodies[i].q]
                    high = math.inf if x <= bound.lower else high
                    low = -math.inf if x >= bound.upper else low
                slack = ROUNDING * (abs(needed[k]) + abs(effort[k]))
                torque = needed[k] - effort[k]
                if torque > high + slack:
                    conduct[k].mode, changed = -1.0, True
                elif torque < low - slack:
                    conduct[k].mode, changed = 1.0, True
            elif conduct[k].mode * qdd[k] < 0.0:
                conduct[k].mode, changed = HELD, True
        if not changed:
            return 0
    sweeps.hold(bodies, system.armature, _held(conduct, needed))
    return 0


@kernel
def _held(conduct, marks):
    """Marks of the joints that are held."""
    for k in range(len(conduct)):
        marks[k] = 1.0 if conduct[k].mode == HELD else 0.0
    return marks


@large_kernel
def any_held(conduct):
    """Whether a joint is held."""
    for k in range(len(conduct)):
        if conduct[k].mode == HELD:
            return True
    return False


@large_kernel
def gaps(simulation, q, qd, gap):
    """Distance of each degree of freedom beyond the end of its mode, negative before it; returns whether any is beyond.

    Sliding ends where the rate changes its sign. At limits the gap is the way to one, the force of a compliant one on which
    a joint leans, or that force growing again in a joint that it let go. The depth is that at the start.
    """
    system, conduct = system_of(simulation), conduct_of(simulation)
    bodies = system.bodies
    beyond = False
    for i in range(1, len(bodies)):
        if not sweeps.owns(bodies, i):
            continue
        k, c = bodies[i].dof, bodies[i].q
        joint, does, own = system.joints[k], conduct[k], gap[k]
        own.sliding = own.limit = -math.inf
        if does.mode == HELD:
            continue
        if does.mode != FREE and joint.friction > 0.0:
            own.sliding = -does.mode * qd[k]
        if limited(bodies, i):
            x, bound = q[c], system.bounds[c]
            if does.spring != 0.0:
                own.limit = -pushing_back(
                    joint, does.spring, x - (bound.upper if does.spring > 0.0 else bound.lower), qd[k]
                )[0]
            elif does.depth == 0.0 or not compliant(joint):
                own.limit = max(x - bound.upper, bound.lower - x)
            else:
                side = 1.0 if does.depth > 0.0 else -1.0
                rest = x - (bound.upper if side > 0.0 else bound.lower)
                force = pushing_back(joint, side, rest, qd[k])[0]
                own.limit = force if side * rest > 0.0 else -abs(force)
        beyond |= own.sliding > 0.0 or own.limit > 0.0
    return beyond
