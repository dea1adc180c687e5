"""Friction and limits: which joints slide, stick, rest at a stop or lean on a spring, and when that ends.

A joint of Coulomb friction f slides where it moves, with a torque of −f sign(q̇), and where it does not move sticks as long as
less than f will hold it. At a hard limit it rests as long as that pushes it back and no more. Which joints at rest stay there
is decided together: each held one needs a torque λ within its bounds, each released one goes the way it was released.
"""

import math

from diag_dynamics import sweeps
from diag_dynamics.compiled.kernel import kernel, large_kernel
from diag_dynamics.simulation.layout import DAMPING, FREE, FRICTION, HELD, LIMIT_DAMPING, LOWER, STIFFNESS, UPPER

ROUNDING = 1e-12
"""Rounding error of a torque, relative to the terms it is the difference of: within it a bound holds."""

NO_FORCE = 1e-9
"""Force of a compliant limit, relative to its parts, that counts as none."""

ALL_AT_ONCE = 3
"""Rounds that change all unsettled joints together. Later rounds change only the first one, or they might not end."""


@kernel
def reach(bounds, c, x):
    """Side of the limit that a coordinate is at or beyond (−1, 1, 0 for none), and the distance beyond, with that sign."""
    if x >= bounds[UPPER, c]:
        return 1.0, x - bounds[UPPER, c]
    if x <= bounds[LOWER, c]:
        return -1.0, x - bounds[LOWER, c]
    return 0.0, 0.0


@kernel
def limited(bodies, i):
    """Whether a body's degree of freedom can have limits: its joint has one, and it is no follower."""
    return bodies[i].dofs == 1 and sweeps.owns(bodies, i)


@kernel
def pushing_back(joints, k, side, depth, rate):
    """Force of a compliant limit into its range, and the sum of its parts' sizes."""
    elastic, viscous = joints[STIFFNESS, k] * side * depth, joints[LIMIT_DAMPING, k] * side * rate
    return elastic + viscous, elastic + abs(viscous)


@large_kernel
def look(bodies, joints, bounds, q, qd, mode, spring, depth):
    """Mode of every degree of freedom by where it is and how it moves; returns whether any may be held."""
    resting = False
    for i in range(1, len(bodies)):
        if not sweeps.owns(bodies, i):
            continue
        k = bodies[i].dof
        mode[k], spring[k], depth[k] = FREE, 0.0, 0.0
        side = 0.0
        if limited(bodies, i):
            side, depth[k] = reach(bounds, bodies[i].q, q[bodies[i].q])
            if side != 0.0 and math.isfinite(joints[STIFFNESS, k]):
                force, size = pushing_back(joints, k, side, depth[k], qd[k])
                if force > NO_FORCE * size or (size == 0.0 and side * qd[k] > 0.0):
                    spring[k] = side
                side = 0.0
        if qd[k] == 0.0 and (joints[FRICTION, k] > 0.0 or side != 0.0):
            mode[k] = HELD
            resting = True
        elif joints[FRICTION, k] > 0.0:
            mode[k] = 1.0 if qd[k] > 0.0 else -1.0
    return resting


@large_kernel
def settle(robot, armature, joints, bounds, tau, none, q, qd, mode, spring, depth, effort, qdd, needed):
    """Of the joints at rest, hold those that stay there and release the others; hold them in the robot, too.

    The mode of each must be HELD at first. It is a linear complementarity problem of a positive definite matrix, solved by
    exchange of joints that contradict themselves. Should rounding keep it from an end, the last choice stands: a joint
    held too long does no work.
    """
    bodies, _, _, _ = sweeps.opened(robot)
    n = len(qd)
    for round_ in range(ALL_AT_ONCE + 2 * n):
        sweeps.hold(bodies, armature, _held(mode, needed))
        for k in range(n):
            effort[k] = tau[k] - joints[DAMPING, k] * qd[k]
            if mode[k] != FREE and mode[k] != HELD:
                effort[k] -= joints[FRICTION, k] * mode[k]
            if spring[k] != 0.0:
                effort[k] -= joints[LIMIT_DAMPING, k] * qd[k] + joints[STIFFNESS, k] * depth[k]
        status = sweeps.accelerations_with_added_inertia(robot, q, qd, effort, none, qdd)
        if status != 0:
            return status
        for k in range(n):
            if mode[k] == HELD:
                qdd[k] = 0.0
        status = sweeps.inverse_dynamics(robot, q, qd, qdd, 1.0, needed)
        if status != 0:
            return status
        changed = False
        for i in range(1, len(bodies)):
            k = bodies[i].dof
            if not sweeps.owns(bodies, i) or mode[k] == FREE or qd[k] != 0.0 or (changed and round_ >= ALL_AT_ONCE):
                continue
            if mode[k] == HELD:
                low, high = -joints[FRICTION, k], joints[FRICTION, k]
                if limited(bodies, i) and not math.isfinite(joints[STIFFNESS, k]):
                    x = q[bodies[i].q]
                    high = math.inf if x <= bounds[LOWER, bodies[i].q] else high
                    low = -math.inf if x >= bounds[UPPER, bodies[i].q] else low
                slack = ROUNDING * (abs(needed[k]) + abs(effort[k]))
                torque = needed[k] - effort[k]
                if torque > high + slack:
                    mode[k], changed = -1.0, True
                elif torque < low - slack:
                    mode[k], changed = 1.0, True
            elif mode[k] * qdd[k] < 0.0:
                mode[k], changed = HELD, True
        if not changed:
            return 0
    sweeps.hold(bodies, armature, _held(mode, needed))
    return 0


@kernel
def _held(mode, marks):
    """Marks of the joints that are held."""
    for k in range(len(mode)):
        marks[k] = 1.0 if mode[k] == HELD else 0.0
    return marks


@large_kernel
def any_held(mode):
    """Whether a joint is held."""
    for k in range(len(mode)):
        if mode[k] == HELD:
            return True
    return False


@large_kernel
def gaps(bodies, joints, bounds, q, qd, mode, spring, depth, gap):
    """Distance of each degree of freedom beyond the end of its mode, negative before it; returns whether any is beyond.

    Sliding ends where the rate changes its sign, the first row; the second row is for limits: the way to one, the force of
    a compliant one on which a joint leans, or that force growing again in a joint that it let go. `depth` is that at the
    start.
    """
    beyond = False
    for i in range(1, len(bodies)):
        if not sweeps.owns(bodies, i):
            continue
        k = bodies[i].dof
        gap[0, k] = gap[1, k] = -math.inf
        if mode[k] == HELD:
            continue
        if mode[k] != FREE and joints[FRICTION, k] > 0.0:
            gap[0, k] = -mode[k] * qd[k]
        if limited(bodies, i):
            x, low, high = q[bodies[i].q], bounds[LOWER, bodies[i].q], bounds[UPPER, bodies[i].q]
            if spring[k] != 0.0:
                gap[1, k] = -pushing_back(joints, k, spring[k], x - (high if spring[k] > 0.0 else low), qd[k])[0]
            elif depth[k] == 0.0 or not math.isfinite(joints[STIFFNESS, k]):
                gap[1, k] = max(x - high, low - x)
            else:
                side = 1.0 if depth[k] > 0.0 else -1.0
                rest = x - (high if side > 0.0 else low)
                force = pushing_back(joints, k, side, rest, qd[k])[0]
                gap[1, k] = force if side * rest > 0.0 else -abs(force)
        beyond |= gap[0, k] > 0.0 or gap[1, k] > 0.0
    return beyond
