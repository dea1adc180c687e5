# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Placements, Jacobians and motions of bodies."""

from diag_dynamics.compiled.kernel import COUNT, FILLED_MATRIX, ROBOT, VECTOR, entry_kernel
from diag_dynamics.sweeps.bodies import motion_of, placement_of, set_motion, set_vector
from diag_dynamics.sweeps.joints import (
    accelerate_world,
    are_finite,
    are_positions,
    move,
    orientation,
    own_motion,
    place,
    place_all,
    rest_at_world,
    zeta,
)
from diag_dynamics.sweeps.spatial import (
    ZERO,
    add,
    add_motion,
    apply,
    apply_transposed,
    cross,
    motion_along,
    motion_to_child,
    product,
)
from diag_dynamics.sweeps.workspace import MISFIT, clear, fit, fit_positions, opened


@entry_kernel(ROBOT, VECTOR, COUNT, FILLED_MATRIX)
def placement(robot, q, body, result):
    """R and, in the last column, the origin of one body in the world, shape (3, 4): a walk down the tree."""
    if not fit_positions(robot, q):
        return MISFIT
    bodies, _, work, _ = opened(robot)
    if not are_positions(bodies, q):
        return -1
    place_all(bodies, q, work)
    R, origin = orientation(bodies, body, work), ZERO
    while body > 0:
        X = placement_of(work[body])
        origin = add(X.translation, apply(X.rotation, origin))
        body = bodies[body].parent
    for k in range(3):
        set_vector(result[k], 0, R[k])
        result[k, 3] = origin[k]
    return 0


@entry_kernel(ROBOT, VECTOR, COUNT, VECTOR, FILLED_MATRIX)
def jacobian(robot, q, body, point, J):
    """J of a point of a body, linear rows first, in the body's axes, shape (6, nv): a walk down the tree.

    Each body that carries the point adds its direction, seen from the point; a follower adds to its leader's column.
    """
    if not fit_positions(robot, q):
        return MISFIT
    bodies, _, work, _ = opened(robot)
    if not are_positions(bodies, q):
        return -1
    place_all(bodies, q, work)
    for row in range(6):
        clear(J[row])
    R, p = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (point[0], point[1], point[2])
    i = body
    while i > 0:
        S, k = motion_along(bodies[i].direction, bodies[i].multiplier), bodies[i].dof
        linear = apply_transposed(R, add(S.linear, cross(S.angular, p)))
        angular = apply_transposed(R, S.angular)
        for axis in range(3):
            J[axis, k] += linear[axis]
            J[3 + axis, k] += angular[axis]
        X = placement_of(work[i])
        R, p = product(X.rotation, R), add(X.translation, apply(X.rotation, p))
        i = bodies[i].parent
    return 0


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, COUNT, FILLED_MATRIX)
def motion(robot, q, qd, qdd, body, result):
    """Twist of a body and its rate, in the body's axes at its origin, shape (2, 6); without gravity."""
    if not fit(robot, q, qd, qdd):
        return MISFIT
    bodies, gravity, work, _ = opened(robot)
    if not (are_positions(bodies, q) and are_finite(qd) and are_finite(qdd)):
        return -1
    rest_at_world(work)
    accelerate_world(gravity, 0.0, work)
    for i in range(1, body + 1):
        one, w, parent = bodies[i], work[i], work[bodies[i].parent]
        X = place(one, q, w)
        move(one, qd, work, w)
        A = add_motion(motion_to_child(X, motion_of(parent.acceleration)), own_motion(one, qdd))
        if one.rank == one.dofs - 1:  # the joint's last body, to which its links belong
            A = add_motion(A, zeta(bodies, i - one.rank, qd, work))
        set_motion(w.acceleration, A)
    if body > 0:
        set_motion(result[0], motion_of(work[body].V))
        set_motion(result[1], motion_of(work[body].acceleration))
    else:
        clear(result[0])
        clear(result[1])
    return 0 if are_finite(result[0]) and are_finite(result[1]) else -1
