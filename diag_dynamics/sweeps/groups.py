# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Degrees of freedom that are eliminated together.

They are coupled by mimic joints, or belong to one joint. A group is all bodies from the one that
carries it (A, exclusive) down to its members, seen as a single aggregate body whose velocity is
(V_A, q̇) with q̇ the rates of the group's own degrees of freedom (constraint embedding, A. Jain
2012). Each of its bodies, with everything articulated that hangs on it from outside the group,
moves with V_i = T_i (V_A, q̇), T_i made of the placements and directions in between, a follower's
direction counted as its leader's, multiplied. So the aggregate has the mass matrix and the rate

    𝓜 = Σ T_iᵀ P_i T_i + armature = [[P, F], [Fᵀ, Q]]        𝓜̇ = [[Ṗ, Ḟ], [Ḟᵀ, Q̇]]

in the axes of A. Eliminating its degrees of freedom one by one, the last first, is the recursion
over axes in another form: with D = Q_cc, G = F_c / D and g_b = Q_bc / D,

    𝓜 ← 𝓜 − g D gᵀ        𝓜̇ ← 𝓜̇ − g uᵀ − u gᵀ + g Ḋ gᵀ,  u = 𝓜̇_c
    ξ_c = q̇_c + GᵀV_A + Σ_b g_b q̇_b

and the remaining P and Ṗ are added to A. Costs grow with the square of the number of bodies in a
group and the cube of its degrees of freedom. Within a group accuracy is that of a dense U D Uᵀ:
rounding grows with the ratio Q_cc / D of a joint before and after the others are eliminated. The
recursion from body to body has no such ratio.

`Q[b, c]` is kept for global indices b and c - start, start the group's first degree of freedom: a
row for each. F and G of a degree of freedom, Ḟ, D and the size D is judged by are in the workspace
of the body that owns it.
"""

from diag_dynamics.numerics import kernel as nk
from diag_dynamics.sweeps import joints, records
from diag_dynamics.sweeps import spatial as sp
from diag_dynamics.sweeps import workspace as ws


@nk.kernel
def is_grouped(body):
    """Whether a body's degree of freedom is eliminated together with others."""
    return body.first < body.last


@nk.kernel
def is_leader(bodies, i):
    """Whether body i has a degree of freedom of its own: it is no follower."""
    return bodies[i].leader == i


# --- 𝓜 and its elimination ------------------------------------------------------------------------


@nk.large_kernel
def compose(bodies, first, last, work, Q):
    """Q and F of a group.

    P of its bodies becomes the composite inertia outboard, and is added to the base.
    """
    start = bodies[first].start
    # F_c is summed in the field G of the body that owns c, until it is divided by D.
    for i in range(first, last + 1):
        if is_leader(bodies, i):
            work[i].size = 0.0
            records.set_force(work[i].G, sp.NO_FORCE)
            ws.clear(Q[bodies[i].dof])
    # From the tips to the base: P of body i includes all bodies outboard already.
    for i in range(last, first - 1, -1):
        body = bodies[i]
        w = work[i]
        P = records.inertia_of(w.P)
        d = body.dof
        owner = work[body.leader]
        # P S of the body, times its ratio: part of Q_cc and, inboard, of Q_bc and F_c
        column = sp.scale_force(sp.column_along(body.direction, P), w.multiplier)
        Q[d, d - start] += w.multiplier * (
            sp.along(body.direction, column) + w.multiplier * w.armature
        )
        owner.size += w.multiplier * w.multiplier * joints.scale_along(body.direction, w)
        column = joints.force_inboard(body, w, column)
        # Bodies inboard in the group. Two bodies of one degree of freedom add to Q_cc twice.
        j = body.parent
        while j >= first:
            product = work[j].multiplier * sp.along(bodies[j].direction, column)
            if (
                body.kind == records.VIRTUAL and j >= i - body.rank
            ):  # one rotor turns at the sum of their rates
                product += work[j].multiplier * w.multiplier * w.armature
            Q[bodies[j].dof, d - start] += product
            Q[d, bodies[j].dof - start] += product
            column = joints.force_inboard(bodies[j], work[j], column)
            j = bodies[j].parent
        records.add_to_force(owner.G, column)
        # P goes inboard whole: the group's degrees of freedom are not eliminated yet.
        if body.rank > 0:
            records.add_to_inertia(work[body.parent].P, P)
            for k in range(2):
                work[body.parent].magnitude[k] += w.magnitude[k]
                work[body.parent].total[k] += w.total[k]
        elif body.parent > 0:
            joints.accumulate_inertia(w, P, work[body.parent])


@nk.large_kernel
def eliminate(bodies, first, last, work, Q):
    """D and G of a group's degrees of freedom, and g in the columns of Q.

    P⁺ is added to the base, see factorize.
    """
    start = bodies[first].start
    base = bodies[first].parent
    for i in range(last, first - 1, -1):
        if not is_leader(bodies, i):
            continue
        w = work[i]
        c = bodies[i].dof
        # All later degrees of freedom are eliminated from Q_cc, so that it is D.
        D = Q[c, c - start]
        column = records.force_of(w.G)
        w.D = D
        if joints.is_singular(w.size, D):
            return i
        # G = F_c / D and g_b = Q_bc / D; 𝓜 ← 𝓜 − g D gᵀ, entries of earlier degrees of freedom
        inverse = 1.0 / D
        G = sp.scale_force(column, inverse)
        records.set_force(w.G, G)
        for j in range(first, i):
            if is_leader(bodies, j):
                b = bodies[j].dof
                records.add_to_force(work[j].G, sp.scale_force(G, -Q[b, c - start]))
                for a in range(start, b + 1):
                    Q[a, b - start] -= Q[a, c - start] * inverse * Q[b, c - start]
        # Column c is of no further use, and becomes g.
        for b in range(start, c):
            Q[b, c - start] *= inverse
        # P⁺ = P − G D Gᵀ, with D G = F_c
        if base > 0:
            records.set_inertia(
                work[base].P, sp.less_rank_one(records.inertia_of(work[base].P), G, column)
            )
    return 0


@nk.large_kernel
def compose_rates(bodies, first, last, qd, work, Q_rate):
    """Q̇ and Ḟ of a group after :func:`compose`.

    Ṗ of its bodies becomes composite too, and is added to the base.
    """
    start = bodies[first].start
    # Ḟ_c is summed in the field u of the body that owns c.
    for i in range(first, last + 1):
        if is_leader(bodies, i):
            records.set_force(work[i].u, sp.NO_FORCE)
            ws.clear(Q_rate[bodies[i].dof])
    # From the tips to the base: r is the multiplier of body i, and changes at the rate ṙ.
    for i in range(last, first - 1, -1):
        body = bodies[i]
        w = work[i]
        P = records.inertia_of(w.P)
        P_rate = records.inertia_of(w.P_rate)
        d = body.dof
        column = sp.column_along(body.direction, P)
        # Rate of P S times the ratio; S is constant in the axes of the body
        rate = sp.scale_force(sp.column_along(body.direction, P_rate), w.multiplier)
        rate = sp.add_force(rate, sp.scale_force(column, w.multiplier_rate))
        column = sp.scale_force(column, w.multiplier)
        # Q̇_cc: r Sᵀ(r P S)˙ + ṙ Sᵀ(r P S), and the rate of r² armature
        own = w.multiplier * sp.along(body.direction, rate) + w.multiplier_rate * sp.along(
            body.direction, column
        )
        Q_rate[d, d - start] += own + 2.0 * w.multiplier * w.multiplier_rate * w.armature
        # Inboard the same column and its rate give Q̇_bc and Ḟ_c.
        # The rate comes first, because it needs the column in the axes of body i.
        rate = rate_inboard(bodies, i, qd, work, column, rate)
        column = joints.force_inboard(body, w, column)
        j = body.parent
        while j >= first:
            product = work[j].multiplier * sp.along(bodies[j].direction, rate)
            product += work[j].multiplier_rate * sp.along(bodies[j].direction, column)
            if body.kind == records.VIRTUAL and j >= i - body.rank:
                changing = (
                    work[j].multiplier_rate * w.multiplier + work[j].multiplier * w.multiplier_rate
                )
                product += changing * w.armature
            Q_rate[bodies[j].dof, d - start] += product
            Q_rate[d, bodies[j].dof - start] += product
            rate = rate_inboard(bodies, j, qd, work, column, rate)
            column = joints.force_inboard(bodies[j], work[j], column)
            j = bodies[j].parent
        records.add_to_force(work[body.leader].u, rate)
        if body.rank > 0:
            records.add_to_inertia(work[body.parent].P_rate, P_rate)
        elif body.parent > 0:
            # Ṗ of the parent: Xᵀ (Ṗ − (v_J×)ᵀ P − P (v_J×)) X
            X = records.placement_of(w)
            parent = work[body.parent]
            records.add_to_inertia(parent.P_rate, sp.inertia_to_parent(X, P_rate))
            moved = sp.transport(joints.joint_motion(bodies, i, qd, work), P)
            records.add_to_inertia(parent.P_rate, sp.inertia_to_parent(X, moved))


@nk.kernel
def rate_inboard(bodies, i, qd, work, F, rate):
    """Rate of XᵀF, as Ẋ = −(v_J×) X."""
    if bodies[i].rank > 0:
        return rate
    moved = sp.cross_force(joints.joint_motion(bodies, i, qd, work), F)
    return sp.force_to_parent(records.placement_of(work[i]), sp.add_force(rate, moved))


@nk.large_kernel
def eliminate_rate(bodies, first, i, work, Q, Q_rate):
    """Eliminate the degree of freedom that body i owns from 𝓜̇, after all later ones."""
    start = bodies[first].start
    base = bodies[first].parent
    c = bodies[i].dof - start
    # Column c of Q is g by now. The field u is Ḟ_c without later degrees of freedom.
    D_rate = Q_rate[bodies[i].dof, c]
    G = records.force_of(work[i].G)
    u = records.force_of(work[i].u)
    # −g uᵀ − u gᵀ + g Ḋ gᵀ = −g (u − Ḋ g)ᵀ − u gᵀ
    rest = sp.subtract_force(u, sp.scale_force(G, D_rate))
    for j in range(first, i):
        if is_leader(bodies, j):
            b = bodies[j].dof
            g = Q[b, c]
            g_rate = Q_rate[b, c]
            # Ḟ_b ← Ḟ_b − g_b (Ḟ_c − Ḋ G) − Q̇_bc G
            records.add_to_force(work[j].u, sp.scale_force(rest, -g))
            records.add_to_force(work[j].u, sp.scale_force(G, -g_rate))
            # Q̇_ab ← Q̇_ab − g_a (u_b − g_b Ḋ) − u_a g_b
            for a in range(start, b + 1):
                Q_rate[a, b - start] -= Q[a, c] * (g_rate - g * D_rate) + Q_rate[a, c] * g
    if base > 0:
        # Ṗ ← Ṗ − G hᵀ − h Gᵀ, h = u − ½ Ḋ G
        half = sp.subtract_force(u, sp.scale_force(G, 0.5 * D_rate))
        records.set_inertia(
            work[base].P_rate, sp.less_rank_two(records.inertia_of(work[base].P_rate), G, half)
        )


# --- Rates and moments through a group ------------------------------------------------------------


@nk.kernel
def base_motion(bodies, i, work):
    """V_A of the group of body i, in the axes of A."""
    return records.motion_of(work[bodies[bodies[i].first].parent].V)


@nk.kernel
def induced_rate(bodies, i, V_A, qd, Q, G):
    """ξ − q̇ of the degree of freedom of body i.

    It is the rate induced by A and by the degrees of freedom before it in the group.
    """
    body = bodies[i]
    rate = sp.power(G, V_A)
    for b in range(body.start, body.dof):
        rate += Q[b, body.dof - body.start] * qd[b]
    return rate


@nk.kernel
def filter_moments(bodies, first, last, work, Q, sign, moments):
    """Turn moments τ of a group's degrees of freedom into κ, in place; return Σ G κ on the base.

    With a positive sign κ become their τ alone, by [I + HφK] within the group.
    """
    F = sp.NO_FORCE
    for step in range(last - first + 1):
        # From the last on to κ and from the first on to τ: moments of later ones are κ
        i = first + step if sign > 0.0 else last - step
        if is_leader(bodies, i):
            c = bodies[i].dof
            start = bodies[i].start
            F = sp.add_force(F, sp.scale_force(records.force_of(work[i].G), moments[c]))
            # τ_b = κ_b + Σ g_b κ_c over later c
            for b in range(start, c):
                moments[b] += sign * Q[b, c - start] * moments[c]
    return F


@nk.kernel
def momentum_rate(bodies, i, V_A, qd, work, Q_rate):
    """𝓜̇_c (V_A, q̇) of the degree of freedom c of body i, with 𝓜̇ at the elimination of c."""
    body = bodies[i]
    rate = sp.power(records.force_of(work[i].u), V_A)
    for b in range(body.start, body.dof + 1):
        rate += Q_rate[b, body.dof - body.start] * qd[b]
    return rate


@nk.kernel
def moments_of_wrench(bodies, i, first, work, F, moments):
    """Add the moments of a wrench on body i along the rigid joints from body `first` outward.

    Returns the wrench inboard.
    """
    while i >= first:
        moments[bodies[i].dof] += work[i].multiplier * sp.along(bodies[i].direction, F)
        F = joints.force_inboard(bodies[i], work[i], F)
        i = bodies[i].parent
    return F


@nk.kernel
def working_moments_of_wrench(bodies, i, work, Q, F, kappa):
    """Add κ of a wrench on body i at every degree of freedom that carries it, all articulated."""
    while i > 0:
        body = bodies[i]
        w = work[i]
        if is_grouped(body):
            # Moments along the rigid joints of the group, then κ. F − Σ G κ goes inboard.
            F = moments_of_wrench(bodies, i, body.first, work, F, kappa)
            F = sp.subtract_force(
                F, filter_moments(bodies, body.first, body.last, work, Q, -1.0, kappa)
            )
            i = bodies[body.first].parent
            continue
        # κ = Sᵀ F, and Xᵀ τ̄ F goes inboard
        moment = sp.along(body.direction, F)
        kappa[body.dof] = moment
        F = joints.force_inboard(
            body, w, sp.subtract_force(F, sp.scale_force(records.force_of(w.G), moment))
        )
        i = body.parent


@nk.large_kernel
def gather(bodies, first, last, work, sign, moments):
    """Add the moments of z of a group's bodies, times a sign; returns the wrench on the base."""
    F = sp.NO_FORCE
    for i in range(last, first - 1, -1):
        body = bodies[i]
        f = records.force_of(work[i].z)
        moments[body.dof] += sign * work[i].multiplier * sp.along(body.direction, f)
        f = joints.force_inboard(body, work[i], f)
        if body.parent >= first:
            records.add_to_force(work[body.parent].z, f)
        else:
            F = sp.add_force(F, f)
    return F


@nk.large_kernel
def gather_bias(bodies, first, last, qd, work, moments):
    """Subtract the bias moments of a group with V and V̇ of A and q̈ zero.

    Returns the bias wrench on the base. It follows :func:`compose`.
    """
    # From the base to the tips: A = X A_p + ζ, the acceleration at V̇_A = 0 and q̈ = 0
    for i in range(first, last + 1):
        body = bodies[i]
        w = work[i]
        A = zeta = sp.NO_MOTION
        if body.parent >= first:
            A = joints.motion_outboard(body, w, records.motion_of(work[body.parent].bias))
        if body.rank == 0:
            # ζ = V⁺ × v_J + S Ġ q̇ once for a joint; V⁺ × v_J is V × v_J, as v_J × v_J = 0.
            V_plus = sp.motion_to_child(
                records.placement_of(w), records.motion_of(work[body.parent].V)
            )
            zeta = sp.cross_motion(V_plus, joints.joint_motion(bodies, i, qd, work))
            changing = joints.ratio_rate(bodies, i, qd, work)
            zeta = sp.add_motion(zeta, sp.motion_along(body.direction, changing))
        records.set_motion(w.zeta, zeta)
        records.set_motion(w.bias, sp.add_motion(A, zeta))
    # From the tips to the base: y + P ζ goes inboard. P X A_p is in P A of the parent, because
    # P is composite.
    F = sp.NO_FORCE
    for i in range(last, first - 1, -1):
        body = bodies[i]
        w = work[i]
        P = records.inertia_of(w.P)
        y = records.force_of(w.y)
        # Sᵀ(y + P A), and the rotor, whose acceleration is Ġ q̇
        f = sp.add_force(y, sp.inertia_times(P, records.motion_of(w.bias)))
        moment = sp.along(body.direction, f)
        if body.armature != 0.0:
            joint = joints.turning(bodies, i)
            moment += body.armature * joints.ratio_rate(bodies, joint, qd, work)
        moments[body.dof] -= w.multiplier * moment
        f = joints.force_inboard(
            body, w, sp.add_force(y, sp.inertia_times(P, records.motion_of(w.zeta)))
        )
        if body.parent >= first:
            records.add_to_force(work[body.parent].y, f)
        else:
            F = sp.add_force(F, f)
    return F
