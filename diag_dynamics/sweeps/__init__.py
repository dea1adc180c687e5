# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recursions over the links: the only place with the physics, compiled by numba.

Names are those of Jain and Rodriguez (1995), written in body frames and base-to-tip order. There is
one body for each degree of freedom and for each mimic joint; body 0 is the world, and a parent
comes before its children. Outward sweeps run from the base to the tips, inward ones back, and each
does a fixed amount of work per body. A joint of several degrees of freedom is as many bodies in one
and the same frame, all but the last without inertia. These, and joints coupled by mimicry, are a
group: degrees of freedom that are eliminated together, see groups.

    X   placement of a body in its parent         P   articulated body inertia (Riccati, Algorithm
    4.1) S   direction of the degree of freedom        D   SᵀPS + armature, articulated joint
    inertia V   twist of the body                         G   P S D⁻¹ V⁺  parent's twist seen in the
    body           Ṗ   rate of P in the body frame (the paper's λ̇) v_J motion of the joint, sum of
    S q̇           P⁺, Ṗ⁺, y⁺, z⁺   the same beyond the joint, τ̄ = I − G Sᵀ applied ζ   V × v_J,
    velocity-dependent acceleration

A sweep takes the address of a memory.Workspace: `bodies` are the records of RobotModel (see model),
`work` those of records.WORK, one each per body, `table` the matrices 𝓜 and 𝓜̇ of groups. Sweeps
that can fail return a status: 0, `i` if body i has no articulated inertia, -1 if an input is not
finite or no orientation, or is so large that a result is not finite, BAD_LENGTH if a vector has not
the robot's length, callback.FAILED if a step could not be compiled.

records: memory of a body; workspace, memory: that of a robot. joints: steps that sweeps share.
groups: degrees of freedom that are eliminated together. evaluation, factorization, classical,
derivatives, kinematics: the sweeps. group_steps: their steps at groups, for robots that
have some. contacts: contact at points. batch: sweeps over many states.
"""
