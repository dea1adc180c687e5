# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns of momentum, ∂K/∂q and gravity, and the load that they explain.

They are linear in inertial parameters. Parameters of a body are m, mc (three), Ixx, Ixy, Iyy, Ixz,
Iyz, Izz about its frame's origin. With the columns Y_p of momentum, Y_∂ of ∂K/∂q and Y_g of
gravity, parameters π need the torque d/dt(Y_p π) + (Y_g − Y_∂)π.
"""

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.tables import flat
from diag_dynamics.sweeps import joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.mobilities import FRAMES

PARAMETERS = 10
"""Parameters of a body."""

LOAD = 4
"""Parameters of a load: m and mc. Its inertia is that of a point."""


@nk.kernel
def coefficients(S, V):
    """Return the coefficients of a body's parameters in SᵀI V, S and V in the body's frame."""
    a = S.linear
    b = S.angular
    v = V.linear
    w = V.angular
    # S = (a, b) and V = (v, ω): SᵀI V = m aᵀv + (mc)ᵀ(a × ω + v × b) + bᵀI ω
    h = sp.add(sp.cross(a, w), sp.cross(v, b))
    # An entry off the diagonal stands in I twice
    xy = b[0] * w[1] + b[1] * w[0]
    xz = b[0] * w[2] + b[2] * w[0]
    yz = b[1] * w[2] + b[2] * w[1]
    return sp.dot(a, v), h[0], h[1], h[2], b[0] * w[0], xy, b[1] * w[1], xz, yz, b[2] * w[2]


@nk.kernel
def propagate_motions(bodies, last, gravity, q, qd, work):
    """Compute X, V and −g of the bodies up to `last`; returns a status."""
    status = joints.start_motion(bodies, q, qd, work)
    joints.set_base_acceleration(gravity, 1.0, work)
    for i in range(1, last + 1):
        body = bodies[i]
        w = work[i]
        X = joints.update_placement(body, q, w)
        joints.update_velocity(body, qd, work, w)
        records.set_motion(
            w.acceleration, sp.motion_to_child(X, records.motion_of(work[body.parent].acceleration))
        )
    return status


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, nk.VECTOR, FRAMES, nk.FILLED_MATRIX)
def regressor(robot, q, qd, qdd, frames, Y):
    """Fill Y of the parameters of the links with these frames: Sᵀ(I A + V ×* I V), A less gravity.

    The second term is (S × V)ᵀI V. A walk from each frame to the base has all S that move it.
    """
    bodies, gravity, work, _ = ws.opened(robot)
    status = joints.start_motion(bodies, q, qd, work)
    if status != 0:
        return status
    if not joints.are_finite(qdd):
        return -1
    # From the base to the tips: V, and A with A₀ = −g
    joints.set_base_acceleration(gravity, 1.0, work)
    for i in range(1, len(bodies)):
        joints.update_motion(bodies, i, q, qd, qdd, work)
    ws.clear(flat(Y))
    for link in range(len(frames)):
        frame = frames[link]
        i = frames[link].body
        # V and A of the link; T is its placement in body i, to which the walk has come
        T = records.placement_of(frame)
        V = sp.motion_to_child(T, records.motion_of(work[i].V))
        A = sp.motion_to_child(T, records.motion_of(work[i].acceleration))
        while i > 0:
            # S in the link's frame; a follower's is added G times to its leader's row
            S = sp.motion_along(bodies[i].direction, work[i].multiplier)
            S = sp.motion_to_child(T, S)
            inertial = coefficients(S, A)
            centrifugal = coefficients(sp.cross_motion(S, V), V)
            for j in range(PARAMETERS):
                Y[bodies[i].dof, PARAMETERS * link + j] += inertial[j] + centrifugal[j]
            # Placement of the link in the parent of body i
            T = sp.compose_placements(records.placement_of(work[i]), T)
            i = bodies[i].parent
    return 0 if joints.are_finite(flat(Y)) else -1


@nk.entry_kernel(nk.ROBOT, nk.VECTOR, nk.VECTOR, FRAMES, nk.FILLED_MATRIX, nk.FILLED_MATRIX)
def load_columns(robot, q, qd, frames, momentum, bias):
    """Fill Y_p and Y_g − Y_∂ of a load (m, mc) on a frame, (nv, 4) each; return a status.

    It walks from the frame to the base.
    """
    bodies, gravity, work, _ = ws.opened(robot)
    if not ws.lengths_match(robot, q, qd, qd):
        return ws.BAD_LENGTH
    frame = frames[0]
    status = propagate_motions(bodies, frames[0].body, gravity, q, qd, work)
    if status != 0:
        return status
    ws.clear(flat(momentum))
    ws.clear(flat(bias))
    # V and −g in the frame of the load
    T = records.placement_of(frame)
    i = frames[0].body
    V = sp.motion_to_child(T, records.motion_of(work[i].V))
    up = sp.motion_to_child(T, records.motion_of(work[i].acceleration))
    while i > 0:
        body = bodies[i]
        S = sp.motion_along(body.direction, work[i].multiplier)
        # Ṡ = V × S + Ġ along the axis; the joint's last body has V of the whole joint
        moving = records.motion_of(work[i - body.rank + body.dofs - 1].V)
        turning = sp.cross_motion(moving, S)
        turning = sp.add_motion(turning, sp.motion_along(body.direction, work[i].multiplier_rate))
        turning = sp.motion_to_child(T, turning)
        S = sp.motion_to_child(T, S)
        # Y_p = SᵀA(V), Y_g = SᵀA(−g) and Y_∂ = ṠᵀA(V), of the first four parameters
        own = coefficients(S, V)
        weight = coefficients(S, up)
        kinetic = coefficients(turning, V)
        for j in range(LOAD):
            momentum[body.dof, j] += own[j]
            bias[body.dof, j] += weight[j] - kinetic[j]
        T = sp.compose_placements(records.placement_of(work[i]), T)
        i = body.parent
    return 0
