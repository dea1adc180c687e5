# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps at a joint that several sweeps share: placement, motion, inertia and forces of a body."""

import math

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.numerics.callback import call_address
from diag_dynamics.numerics.tables import address_of
from diag_dynamics.sweeps import records
from diag_dynamics.sweeps import spatial as sp

UNIT_TOLERANCE = 1e-3
"""Largest distance from 1 of a quaternion's squared length that is accepted; the quaternion is then
normalized."""

SINGULAR = 1e-10
"""D below this fraction of the inertias that it is the difference of is rounding: the joint moves
no inertia."""

REMOTE = 1e-4
"""Weight of all inertia outboard in the size of P, relative to the articulated inertias of the
children. It matters where these are rounding errors, 1e-14 of the inertia outboard."""

# --- Positions ------------------------------------------------------------------------------------


POSITIONS, RATES, BOTH = range(3)
"""What :func:`couplings.couple` finds."""


@nk.kernel
def couple(q, work):
    """Find positions and changing ratios of followers before bodies are placed; return a status."""
    # The address of the code is 0 where no ratio of the robot changes.
    if work[0].couple == 0:
        return 0
    return call_address(work[0].couple, (work[0].couplings, address_of(q), 0, POSITIONS))


@nk.kernel
def couple_with_rates(q, qd, work):
    """As :func:`couple`, with the rates of ratios."""
    if work[0].couple == 0:
        return 0
    return call_address(work[0].couple, (work[0].couplings, address_of(q), address_of(qd), BOTH))


@nk.kernel
def start_motion(bodies, q, qd, work):
    """Couple followers to q and q̇, the base at rest; returns a status, -1 for wrong numbers."""
    # Wrong numbers come first: a coupling would report them as an open or singular loop.
    if not (are_positions(bodies, q) and are_finite(qd)):
        return -1
    set_base_at_rest(work)
    return couple_with_rates(q, qd, work)


@nk.kernel
def couple_rates(qd, work):
    """The rates of ratios behind :func:`couple`."""
    if work[0].couple != 0:
        call_address(work[0].couple, (work[0].couplings, 0, address_of(qd), RATES))


@nk.kernel
def _position(body, q, w):
    """Angle or displacement of the joint of a body, of one degree of freedom."""
    return body.multiplier * q[body.q] + w.offset


@nk.kernel
def placement(direction, body, position):
    """X of a body that turns about z by a reduced angle, or slides along z."""
    rotation = records.matrix_of(body.rotation)
    translation = records.vector_of(body.translation)
    # The joint's axis is z of the body: R Rz(θ).
    if direction == sp.ANGULAR_Z:
        sine, cosine = sp.sine_and_cosine(position)
        return sp.Placement(sp.turned_about_z(rotation, sine, cosine), translation)
    # A prismatic joint moves the origin along z of the body, seen in the parent's axes.
    return sp.Placement(rotation, sp.add(translation, sp.apply(rotation, (0.0, 0.0, position))))


@nk.kernel
def moved_pose(body, q):
    """Displacement of a planar or floating joint by its positions."""
    k = body.q
    if body.kind == records.FLOATING:
        # The rotation is that of the normalized quaternion.
        x, y, z, w = quaternion_of(body, q)
        return sp.Placement(sp.rotation_of_quaternion(x, y, z, w), (q[k], q[k + 1], q[k + 2]))
    # Planar: x and y, and the angle about z
    sine, cosine = sp.sine_and_cosine(sp.reduced_angle(q[k + 2]))
    turned = ((cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0))
    return sp.Placement(turned, (q[k], q[k + 1], 0.0))


@nk.kernel
def update_placement(body, q, w):
    """Write and return X of a body; the later bodies of a joint are in the frame of the first."""
    if body.kind == records.REVOLUTE:
        X = placement(sp.ANGULAR_Z, body, sp.reduced_angle(_position(body, q, w)))
        records.set_placement(w, X)
    else:
        _update_placement_general(body, q, w)
    return records.placement_of(w)


@nk.large_kernel
def _update_placement_general(body, q, w):
    # X at q = 0, which is the identity at the later bodies of a joint
    X = sp.Placement(records.matrix_of(body.rotation), records.vector_of(body.translation))
    if body.kind == records.PRISMATIC:
        X = placement(sp.LINEAR_Z, body, _position(body, q, w))
    elif body.rank == 0:
        X = sp.compose_placements(X, moved_pose(body, q))
    records.set_placement(w, X)


@nk.kernel
def update_placements(bodies, q, work):
    """X of every body; returns a status, -1 for wrong positions."""
    if not are_positions(bodies, q):
        return -1
    status = couple(q, work)
    for i in range(1, len(bodies)):
        update_placement(bodies[i], q, work[i])
    return status


@nk.kernel
def pose(bodies, i, base, work):
    """Placement of a placed body in one that carries it."""
    T = sp.Placement(sp.IDENTITY, sp.ZERO)
    # From the body toward the base: T ← X T
    while i != base:
        T = sp.compose_placements(records.placement_of(work[i]), T)
        i = bodies[i].parent
    return T


@nk.kernel
def initialize(bodies, q, work):
    """X of every body and P without its children; returns a status, -1 for wrong positions."""
    if not are_positions(bodies, q):
        return -1
    status = couple(q, work)
    for i in range(1, len(bodies)):
        update_placement(bodies[i], q, work[i])
        # P begins as I, to which the children add from the tips to the base.
        init_articulated_inertia(bodies[i], work[i])
        # A copy, to which a sweep may add other inertia of the joint
        work[i].armature = bodies[i].armature
    return status


@nk.kernel
def are_positions(bodies, q):
    """Whether all positions are finite, and orientations near unit length."""
    return are_finite(q) and are_orientations(bodies, q)


@nk.kernel
def are_orientations(bodies, q):
    """Whether orientations are near unit length."""
    for i in range(1, len(bodies)):
        if bodies[i].kind == records.FLOATING and bodies[i].rank == 0:
            x, y, z, w = quaternion_of(bodies[i], q)
            # The comparison is false for NaN, which is rejected as well.
            if not abs(x * x + y * y + z * z + w * w - 1.0) < UNIT_TOLERANCE:
                return False
    return True


@nk.kernel
def quaternion_of(body, q):
    """Quaternion of a floating joint."""
    k = body.q + 3
    return q[k], q[k + 1], q[k + 2], q[k + 3]


@nk.kernel
def are_finite(x):
    """Whether all entries of a vector are finite."""
    for k in range(len(x)):
        if not math.isfinite(x[k]):
            return False
    return True


# --- Motions --------------------------------------------------------------------------------------


@nk.kernel
def own_motion(body, w, rates):
    """S q̇ of one body; a follower's rate is its leader's, multiplied."""
    return sp.motion_along(body.direction, w.multiplier * rates[body.dof])


@nk.kernel
def joint_motion(bodies, i, rates, work):
    """v_J, the motion of body i's frame against its parent's; zero at later bodies of a joint."""
    if bodies[i].dofs == 1:
        return own_motion(bodies[i], work[i], rates)
    # v_J = Σ S q̇ over the bodies of the joint, where only the first one's X changes with q
    v_J = sp.NO_MOTION
    if bodies[i].rank == 0:
        for j in range(i, i + bodies[i].dofs):
            v_J = sp.add_motion(v_J, own_motion(bodies[j], work[j], rates))
    return v_J


@nk.kernel
def turning(bodies, i):
    """First of the bodies at whose rates the rotor of body i turns.

    They are all bodies of a follower, and body i alone otherwise.
    """
    return i - bodies[i].rank if bodies[i].kind == records.VIRTUAL else i


@nk.kernel
def joint_rate(bodies, i, rates, work):
    """Rate of the joint of one degree of freedom, or of the follower, whose first body is i."""
    rate = 0.0
    for j in range(i, i + bodies[i].dofs):
        rate += work[j].multiplier * rates[bodies[j].dof]
    return rate


@nk.kernel
def ratio_rate(bodies, i, rates, work):
    """Ġ q̇ of the joint with first body i: its acceleration at constant independent rates."""
    rate = 0.0
    for j in range(i, i + bodies[i].dofs):
        rate += work[j].multiplier_rate * rates[bodies[j].dof]
    return rate


@nk.kernel
def zeta(bodies, i, rates, work):
    """ζ = V × v_J + S Ġ q̇ of the joint whose first body is i; V of all its bodies is known."""
    # V of the last body includes all rates of the joint.
    turned = sp.cross_motion(
        records.motion_of(work[i + bodies[i].dofs - 1].V), joint_motion(bodies, i, rates, work)
    )
    # S Ġ q̇: a follower accelerates at constant rates of the independent joints.
    return sp.add_motion(
        turned, sp.motion_along(bodies[i].direction, ratio_rate(bodies, i, rates, work))
    )


@nk.kernel
def set_base_at_rest(work):
    """V of the world, and W and Ẇ for other rates."""
    records.set_motion(work[0].V, sp.NO_MOTION)
    records.set_motion(work[0].W, sp.NO_MOTION)
    records.set_motion(work[0].W_rate, sp.NO_MOTION)


@nk.kernel
def set_base_acceleration(gravity, weight, work):
    """Gravity as an acceleration of the world, −g, times a weight."""
    records.set_motion(
        work[0].acceleration, sp.Motion(sp.scale(records.vector_of(gravity), -weight), sp.ZERO)
    )


@nk.kernel
def update_velocity(body, rates, work, w):
    """V of a placed body."""
    # V = V⁺ + S q̇ with V⁺ = X V_p (Table 1)
    V_plus = sp.motion_to_child(records.placement_of(w), records.motion_of(work[body.parent].V))
    V = sp.add_motion(V_plus, own_motion(body, w, rates))
    records.set_motion(w.V, V)
    return V


@nk.kernel
def update_motion(bodies, i, q, qd, qdd, work):
    """X, V and A of a body, from V and A of its parent; returns V and A."""
    body = bodies[i]
    w = work[i]
    X = update_placement(body, q, w)
    V = update_velocity(body, qd, work, w)
    # A = X A_p + S q̈ + ζ (4.3)
    A = sp.motion_to_child(X, records.motion_of(work[body.parent].acceleration))
    A = sp.add_motion(A, own_motion(body, w, qdd))
    if body.rank == body.dofs - 1:  # the joint's last body: the earlier ones have no inertia
        A = sp.add_motion(A, zeta(bodies, i - body.rank, qd, work))
    records.set_motion(w.acceleration, A)
    return V, A


@nk.kernel
def moments_inward(bodies, work, tau):
    """Add the moment of y along every degree of freedom; y goes to the parent."""
    # From the tips to the base: τ = Sᵀy, and Xᵀy is added to the parent's y (4.3).
    for i in range(len(bodies) - 1, 0, -1):
        body = bodies[i]
        w = work[i]
        y = records.force_of(w.y)
        # A follower acts on its leader through the ratio: Gᵀτ.
        tau[body.dof] += w.multiplier * sp.along(body.direction, y)
        if body.parent > 0:
            records.add_to_force(work[body.parent].y, force_inboard(body, w, y))


# --- Inertias -------------------------------------------------------------------------------------


@nk.kernel
def momentum(body, V):
    """I V."""
    return sp.rigid_momentum(
        body.mass, records.vector_of(body.first_moment), records.symmetric_of(body.inertia), V
    )


@nk.kernel
def init_articulated_inertia(body, w):
    """P of a body before its children have been added, and its size."""
    own = sp.rigid_inertia(
        body.mass, records.vector_of(body.first_moment), records.symmetric_of(body.inertia)
    )
    records.set_inertia(w.P, own)
    # Ṗ of a rigid body is zero in its axes.
    records.set_inertia(w.P_rate, sp.NO_INERTIA)
    # Sizes are the traces of the blocks A and C of I.
    w.magnitude[0] = 3.0 * body.mass
    w.magnitude[1] = body.inertia[0] + body.inertia[3] + body.inertia[5]
    w.total[0] = w.magnitude[0]
    w.total[1] = w.magnitude[1]


@nk.kernel
def joint_inertia(direction, armature, P):
    """D, with the armature that theory adds to it, P S and G (Algorithm 4.1)."""
    column = sp.column_along(direction, P)
    D = sp.along(direction, column) + armature
    return D, column, sp.scale_force(column, 1.0 / D)


@nk.kernel
def scale_along(direction, w):
    """Magnitude of the two inertias whose difference is D, to which rounding of D is relative."""
    k = 0 if direction < sp.ANGULAR_X else 1
    return max(w.magnitude[k], REMOTE * w.total[k])


@nk.kernel
def is_singular(size, D):
    """Whether the joint moves no inertia: D is a rounding error of inertias of this size."""
    # The comparison is false for NaN, which counts as singular.
    return not SINGULAR * size < D


@nk.kernel
def accumulate_scale(w, X, parent):
    """Add the size of P, and of all inertia outboard, to the parent's."""
    # P and not P⁺, because rounding of the difference P⁺ is relative to P
    P = records.inertia_of(w.P)
    lever = sp.dot(X.translation, X.translation)
    linear = P.A[0][0] + P.A[1][1] + P.A[2][2]
    angular = P.C[0][0] + P.C[1][1] + P.C[2][2]
    # Sizes about the parent's origin, without first moments: angular + linear |r|²
    parent.magnitude[0] += linear
    parent.magnitude[1] += angular + linear * lever
    # All inertia outboard as that of one rigid body
    parent.total[0] += w.total[0]
    parent.total[1] += w.total[1] + w.total[0] * lever


@nk.kernel
def accumulate_inertia(w, P, parent):
    """Add XᵀP X of a body, or of its P⁺, to the parent's P, and its size to the parent's."""
    X = records.placement_of(w)
    records.add_to_inertia(parent.P, sp.inertia_to_parent(X, P))
    accumulate_scale(w, X, parent)


@nk.kernel
def wrench_on_body(bodies, wrench, in_world, work):
    """A wrench about the origin of its placed body, in the body's axes."""
    force = records.vector_of(wrench.force)
    moment = records.vector_of(wrench.moment)
    # From the axes of the world to those of the body: Rᵀ
    if in_world:
        R = pose(bodies, wrench.body, 0, work).rotation
        force = sp.apply_transposed(R, force)
        moment = sp.apply_transposed(R, moment)
    # The moment about the body's origin has r × f of the point.
    return sp.Force(force, sp.add(moment, sp.cross(records.vector_of(wrench.point), force)))


@nk.kernel
def force_inboard(body, w, F):
    """XᵀF; the later bodies of a joint share the first one's frame."""
    return F if body.rank > 0 else sp.force_to_parent(records.placement_of(w), F)


@nk.kernel
def motion_outboard(body, w, V):
    """X V; the later bodies of a joint share the first one's frame."""
    return V if body.rank > 0 else sp.motion_to_child(records.placement_of(w), V)
