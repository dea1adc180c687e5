# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Placements, Jacobians and motions of bodies; positions along a twist, and locked joints.

Positions of a joint of several degrees of freedom lie on a manifold. Around positions q₀ they have
coordinates u, a twist each: q = q₀ exp(u) in the axes of the moving body. Of a joint of one degree
of freedom that is q₀ + u.
"""

import math

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.sweeps import groups, joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.COUNT, nk.FILLED_MATRIX)
def placement(robot, q, body, result):
    """R and, in the last column, the origin of a body in the world, shape (3, 4).

    It walks down the tree.
    """
    if not ws.positions_match(robot, q):
        return ws.BAD_LENGTH
    bodies, _, work, _ = ws.opened(robot)
    status = joints.update_placements(bodies, q, work)
    if status != 0:
        return status
    # Product of the X of all bodies that carry this one
    X = joints.pose(bodies, body, 0, work)
    for k in range(3):
        records.set_vector(result[k], 0, X.rotation[k])
        result[k, 3] = X.translation[k]
    return 0


@nk.large_kernel
def set_jacobian(bodies, body, point, work, J):
    """J of a point of a body, linear rows first, in the body's axes.

    It walks down the tree of placed bodies. Each body that carries the point adds its direction,
    seen from the point; a follower adds to its leader's column. Returns the number of columns up to
    the last one that is not zero.
    """
    for row in range(6):
        ws.clear(J[row])
    width = 0
    # T: placement in body i of a frame at the point, with the axes of the point's body
    T = sp.Placement(sp.IDENTITY, (point[0], point[1], point[2]))
    i = body
    while i > 0:
        S = sp.motion_along(bodies[i].direction, work[i].multiplier)
        # S r of body i, with its ratio r, seen in the frame at the point
        S = sp.motion_to_child(T, S)
        k = bodies[i].dof
        width = max(width, k + 1)
        for axis in range(3):
            J[axis, k] += S.linear[axis]
            J[3 + axis, k] += S.angular[axis]
        T = sp.compose_placements(records.placement_of(work[i]), T)
        i = bodies[i].parent
    return width


@nk.entry_kernel(nk.ROBOT, nk.COUNT, nk.VECTOR, nk.FLAG, nk.MATRIX, nk.FILLED_STATES)
def jacobians(robot, body, point, in_world, Q, results):
    """J of a point of a body at all states before the first that fails; return their number.

    Linear rows are first, in the axes of the body or the world. Further rows of the results remain.
    Calls for one state share memory among threads, so it keeps the interpreter's lock.
    """
    bodies, _, work, _ = ws.opened(robot)
    for t in range(len(Q)):
        J = results[t]
        if joints.update_placements(bodies, Q[t], work) != 0:
            return t
        set_jacobian(bodies, body, point, work, J)
        R = joints.pose(bodies, body, 0, work).rotation
        # R turns the linear and the angular part of each column to the axes of the world.
        for k in range(J.shape[1] if in_world else 0):
            for first in range(0, 6, 3):
                v = sp.apply(R, (J[first, k], J[first + 1, k], J[first + 2, k]))
                for axis in range(3):
                    J[first + axis, k] = v[axis]
    return len(Q)


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.COUNT, nk.FILLED_MATRIX)
def motion(robot, q, qd, qdd, body, result):
    """Twist of a body and its rate, shape (2, 6), in its axes at its origin, without gravity."""
    if not ws.lengths_match(robot, q, qd, qdd):
        return ws.BAD_LENGTH
    bodies, _, work, _ = ws.opened(robot)
    status = joints.start_motion(bodies, q, qd, work)
    if status != 0:
        return status
    if not joints.are_finite(qdd):
        return -1
    # From the base to the body: V and A = X A_p + S q̈ + ζ (4.3), with A₀ = 0
    records.set_motion(work[0].acceleration, sp.NO_MOTION)
    for i in range(1, body + 1):
        joints.update_motion(bodies, i, q, qd, qdd, work)
    records.set_motion(result[0], records.motion_of(work[body].V))
    records.set_motion(result[1], records.motion_of(work[body].acceleration))
    return 0 if joints.are_finite(result[0]) and joints.are_finite(result[1]) else -1


# --- Positions along a twist


@nk.large_kernel
def integrate_positions(robot, start, u, q):
    """Positions q displaced by u from those at the start.

    Quaternions have unit length. q may be the start.
    """
    bodies, _, work, _ = ws.opened(robot)
    for i in range(1, len(bodies)):
        body = bodies[i]
        k = bodies[i].q
        if body.dofs == 1:
            if groups.is_leader(bodies, i):
                q[k] = start[k] + u[body.dof]
        elif body.rank == 0 and groups.is_leader(bodies, i):
            # The displacement exp(U) is in the axes of the body at the start.
            U = joints.joint_motion(bodies, i, u, work)
            R, p = joints.moved_pose(body, start)
            p = sp.add(p, sp.apply(R, sp.screw_translation(U)))
            q[k] = p[0]
            q[k + 1] = p[1]
            if body.kind == records.FLOATING:
                q[k + 2] = p[2]
                # The product is normalized: the start may be off unit length, and rounding adds up.
                turn = joints.quaternion_of(body, start)
                x, y, z, w = sp.quaternion_product(turn, sp.rotation_quaternion(U.angular))
                length = math.sqrt(x * x + y * y + z * z + w * w)
                q[k + 3] = x / length
                q[k + 4] = y / length
                q[k + 5] = z / length
                q[k + 6] = w / length
            else:
                # The angle of a planar joint goes on beyond ±π.
                q[k + 2] = start[k + 2] + U.angular[2]


@nk.kernel
def _log(body, start, end):
    """Twist that moves a joint of several degrees of freedom from start to end positions."""
    k = body.q
    # exp(V) = start⁻¹ end
    R, p = joints.moved_pose(body, start)
    _, target = joints.moved_pose(body, end)
    if body.kind == records.FLOATING:
        x, y, z, w = joints.quaternion_of(body, start)
        # The conjugate is the inverse rotation; the shorter way round is taken.
        turn = sp.quaternion_product((-x, -y, -z, w), joints.quaternion_of(body, end))
        vector = sp.rotation_vector(turn[0], turn[1], turn[2], turn[3])
    else:
        vector = (0.0, 0.0, _wrapped(end[k + 2] - start[k + 2]))
    # Rᵀ: the translation in the axes of the body at the start
    return sp.screw_of_displacement(sp.apply_transposed(R, sp.subtract(target, p)), vector)


@nk.kernel
def _wrapped(angle):
    """An angle within ±π."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR)
def integrate(robot, q, v, result):
    """Positions reached from q along v.

    They are q exp(v) of joints of several degrees of freedom, and q + v of the others.
    """
    if not ws.lengths_match(robot, q, v, v):
        return ws.BAD_LENGTH
    bodies = ws.robot_of(robot).bodies
    if not (joints.are_positions(bodies, q) and joints.are_finite(v)):
        return -1
    integrate_positions(robot, q, v, result)
    return 0 if joints.are_finite(result) else -1


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, nk.FILLED_VECTOR)
def difference(robot, start, end, continuous, v):
    """Twist v that moves `start` to `end`.

    Where `continuous` is not 0, an angle takes the shorter way round.
    """
    if not (ws.positions_match(robot, start) and ws.positions_match(robot, end)):
        return ws.BAD_LENGTH
    bodies, _, _, _ = ws.opened(robot)
    if not (joints.are_positions(bodies, start) and joints.are_positions(bodies, end)):
        return -1
    for i in range(1, len(bodies)):
        body = bodies[i]
        if body.dofs == 1:
            if groups.is_leader(bodies, i):
                apart = end[body.q] - start[body.q]
                v[body.dof] = _wrapped(apart) if continuous[body.dof] != 0.0 else apart
        elif body.rank == 0 and groups.is_leader(bodies, i):
            # A twist of the whole joint; each of its directions picks an entry.
            U = _log(body, start, end)
            for j in range(i, i + body.dofs):
                v[bodies[j].dof] = sp.entry(bodies[j].direction, U.linear, U.angular)
    return 0 if joints.are_finite(v) else -1
