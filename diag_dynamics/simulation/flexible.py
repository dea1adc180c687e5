# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motors of flexible joints in an implicit step: eliminated before the links, computed after them.

With a spring k and a damper d between motor (B, θ) and link, and E = h d + h² k, a step of implicit Euler is

    M q̇⁺ = M q̇ + h(…) + h τ_J    B θ̇⁺ = B θ̇ + h(τ − τ_J)    h τ_J = h k(θ − q) + E(θ̇⁺ − q̇⁺)

Elimination of θ̇⁺ leaves the inertia EB/(E + B) on the joint, which enters the sweep as armature does. No spring is too
stiff for a step: E → ∞ is the rigid joint of armature B. Order 4 has h γ in place of h.
"""

from diag_dynamics.numerics.kernel import kernel, large_kernel
from diag_dynamics.simulation.memory import opened


@kernel
def rigid_part(B, stiffness, damping, h):
    """E/(E + B), the fraction of a motor that moves with its link in a step h: 1 at a rigid joint."""
    E = h * (damping + h * stiffness)
    return E / (E + B)


@large_kernel
def eliminate_motors(address, h, tau):
    """Set the efforts on links and the reflected inertias of a step of order 1; h k(θ − q) cancels in a rigid joint."""
    sim = opened(address)
    for k in range(len(tau)):
        sim.link_effort[k], sim.reflected[k] = tau[k], 0.0
        if sim.rotor_inertia[k] > 0.0:
            B = sim.rotor_inertia[k]
            part = rigid_part(B, sim.spring_stiffness[k], sim.spring_damping[k], h)
            torque = sim.spring_stiffness[k] * (sim.theta[k] - sim.q[sim.coordinate[k]])
            sim.reflected[k] = part * B
            sim.link_effort[k] = (1.0 - part) * torque + part * (
                tau[k] + B * (sim.thetad[k] - sim.qd[k]) / h
            )


@large_kernel
def move_motor(address, k, h, tau):
    """Move a motor after its link, whose q and q̇ are those after the step; return the lost energy [J]."""
    sim = opened(address)
    stiffness, after = sim.spring_stiffness[k], sim.qd[k]
    before = sim.theta[k] - (sim.q[sim.coordinate[k]] - sim.u[k])
    B = sim.rotor_inertia[k]
    part = rigid_part(B, stiffness, sim.spring_damping[k], h)
    free = sim.thetad[k] + h * (tau - stiffness * before) / B
    sim.thetad[k] = free + part * (after - free)
    rate = sim.thetad[k] - after
    sim.theta[k] = sim.q[sim.coordinate[k]] + before + h * rate
    return (
        h * rate * rate * (sim.spring_damping[k] + 0.5 * h * stiffness)
    )  # with the loss of implicit Euler


@large_kernel
def stored_energy(address):
    """Return ½k(θ − q)² of all springs [J]."""
    sim = opened(address)
    energy = 0.0
    for k in range(len(sim.rotor_inertia)):
        if sim.rotor_inertia[k] > 0.0:
            energy += 0.5 * sim.spring_stiffness[k] * (sim.theta[k] - sim.q[sim.coordinate[k]]) ** 2
    return energy
