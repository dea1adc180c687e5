# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Placements, Jacobians and motions of bodies."""

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.sweeps import joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.COUNT, nk.FILLED_MATRIX)
def placement(robot, q, body, result):
    """R and, in the last column, the origin of one body in the world, shape (3, 4): a walk down the tree."""
    if not ws.positions_match(robot, q):
        return ws.BAD_LENGTH
    bodies, _, work, _ = ws.opened(robot)
    if not joints.are_positions(bodies, q):
        return -1
    joints.update_placements(bodies, q, work)
    X = joints.pose(bodies, body, 0, work)
    for k in range(3):
        records.set_vector(result[k], 0, X.rotation[k])
        result[k, 3] = X.translation[k]
    return 0


@nk.large_kernel
def set_jacobian(bodies, body, point, work, J):
    """J of a point of a body, linear rows first, in the body's axes: a walk down the tree of placed bodies.

    Each body that carries the point adds its direction, seen from the point; a follower adds to its leader's column. Returns
    the number of columns up to the last one that is not zero.
    """
    for row in range(6):
        ws.clear(J[row])
    width = 0
    R, p = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (point[0], point[1], point[2])
    i = body
    while i > 0:
        S, k = sp.motion_along(bodies[i].direction, bodies[i].multiplier), bodies[i].dof
        width = max(width, k + 1)
        linear = sp.apply_transposed(R, sp.add(S.linear, sp.cross(S.angular, p)))
        angular = sp.apply_transposed(R, S.angular)
        for axis in range(3):
            J[axis, k] += linear[axis]
            J[3 + axis, k] += angular[axis]
        X = records.placement_of(work[i])
        R, p = sp.product(X.rotation, R), sp.add(X.translation, sp.apply(X.rotation, p))
        i = bodies[i].parent
    return width


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.COUNT, nk.VECTOR, nk.FILLED_MATRIX)
def jacobian(robot, q, body, point, J):
    """J of a point of a body, linear rows first, in the body's axes, shape (6, nv)."""
    if not ws.positions_match(robot, q):
        return ws.BAD_LENGTH
    bodies, _, work, _ = ws.opened(robot)
    if not joints.are_positions(bodies, q):
        return -1
    joints.update_placements(bodies, q, work)
    set_jacobian(bodies, body, point, work, J)
    return 0


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.COUNT, nk.FILLED_MATRIX)
def motion(robot, q, qd, qdd, body, result):
    """Twist of a body and its rate, in the body's axes at its origin, shape (2, 6); without gravity."""
    if not ws.lengths_match(robot, q, qd, qdd):
        return ws.BAD_LENGTH
    bodies, _, work, _ = ws.opened(robot)
    if not (joints.are_positions(bodies, q) and joints.are_finite(qd) and joints.are_finite(qdd)):
        return -1
    joints.set_base_at_rest(work)
    records.set_motion(work[0].acceleration, sp.NO_MOTION)
    for i in range(1, body + 1):
        joints.update_motion(bodies, i, q, qd, qdd, work)
    records.set_motion(result[0], records.motion_of(work[body].V))
    records.set_motion(result[1], records.motion_of(work[body].acceleration))
    return 0 if joints.are_finite(result[0]) and joints.are_finite(result[1]) else -1
