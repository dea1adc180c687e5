# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Placements, Jacobians and motions of bodies."""

from diag_dynamics.numerics.kernel import COUNT, FILLED_MATRIX, ROBOT, VECTOR, entry_kernel
from diag_dynamics.sweeps import joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps.workspace import BAD_LENGTH, clear, lengths_match, opened, positions_match


@entry_kernel(ROBOT, VECTOR, COUNT, FILLED_MATRIX)
def placement(robot, q, body, result):
    """R and, in the last column, the origin of one body in the world, shape (3, 4): a walk down the tree."""
    if not positions_match(robot, q):
        return BAD_LENGTH
    bodies, _, work, _ = opened(robot)
    if not joints.are_positions(bodies, q):
        return -1
    joints.update_placements(bodies, q, work)
    R, origin = joints.orientation(bodies, body, work), sp.ZERO
    while body > 0:
        X = records.placement_of(work[body])
        origin = sp.add(X.translation, sp.apply(X.rotation, origin))
        body = bodies[body].parent
    for k in range(3):
        records.set_vector(result[k], 0, R[k])
        result[k, 3] = origin[k]
    return 0


@entry_kernel(ROBOT, VECTOR, COUNT, VECTOR, FILLED_MATRIX)
def jacobian(robot, q, body, point, J):
    """J of a point of a body, linear rows first, in the body's axes, shape (6, nv): a walk down the tree.

    Each body that carries the point adds its direction, seen from the point; a follower adds to its leader's column.
    """
    if not positions_match(robot, q):
        return BAD_LENGTH
    bodies, _, work, _ = opened(robot)
    if not joints.are_positions(bodies, q):
        return -1
    joints.update_placements(bodies, q, work)
    for row in range(6):
        clear(J[row])
    R, p = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (point[0], point[1], point[2])
    i = body
    while i > 0:
        S, k = sp.motion_along(bodies[i].direction, bodies[i].multiplier), bodies[i].dof
        linear = sp.apply_transposed(R, sp.add(S.linear, sp.cross(S.angular, p)))
        angular = sp.apply_transposed(R, S.angular)
        for axis in range(3):
            J[axis, k] += linear[axis]
            J[3 + axis, k] += angular[axis]
        X = records.placement_of(work[i])
        R, p = sp.product(X.rotation, R), sp.add(X.translation, sp.apply(X.rotation, p))
        i = bodies[i].parent
    return 0


@entry_kernel(ROBOT, VECTOR, VECTOR, VECTOR, COUNT, FILLED_MATRIX)
def motion(robot, q, qd, qdd, body, result):
    """Twist of a body and its rate, in the body's axes at its origin, shape (2, 6); without gravity."""
    if not lengths_match(robot, q, qd, qdd):
        return BAD_LENGTH
    bodies, gravity, work, _ = opened(robot)
    if not (joints.are_positions(bodies, q) and joints.are_finite(qd) and joints.are_finite(qdd)):
        return -1
    joints.set_base_at_rest(work)
    joints.set_base_acceleration(gravity, 0.0, work)
    for i in range(1, body + 1):
        one, w, parent = bodies[i], work[i], work[bodies[i].parent]
        X = joints.update_placement(one, q, w)
        joints.update_velocity(one, qd, work, w)
        A = sp.add_motion(sp.motion_to_child(X, records.motion_of(parent.acceleration)), joints.own_motion(one, qdd))
        if one.rank == one.dofs - 1:  # the joint's last body, to which its links belong
            A = sp.add_motion(A, joints.zeta(bodies, i - one.rank, qd, work))
        records.set_motion(w.acceleration, A)
    if body > 0:
        records.set_motion(result[0], records.motion_of(work[body].V))
        records.set_motion(result[1], records.motion_of(work[body].acceleration))
    else:
        clear(result[0])
        clear(result[1])
    return 0 if joints.are_finite(result[0]) and joints.are_finite(result[1]) else -1
