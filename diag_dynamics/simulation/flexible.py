# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motors of flexible joints in an implicit step: eliminated before the links, computed after them.

With a spring k and a damper d between motor (B, θ) and link, stretch s = θ − q and
E = h w (d + w h k), a step is

    B θ̇⁺ = B θ̇ + h(τ − τ_J)    h τ_J = h k s + E (1 − w)/w ṡ + E ṡ⁺
    s⁺ = s + h ((1 − w)ṡ + w ṡ⁺)

with the weight w of the spring: see midpoint.py. Elimination of θ̇⁺ leaves the inertia EB/(E + B)
on the joint, which enters the sweep as armature does. No spring is too stiff for a step: E → ∞ is
the rigid joint of armature B.
"""

from diag_dynamics.numerics.kernel import kernel, large_kernel
from diag_dynamics.simulation.step_memory import opened


@kernel
def implicit_inertia(stiffness, damping, weight, h):
    """E of a spring and a damper: what they add to the inertia in a step [kg m², kg]."""
    return h * weight * (damping + weight * h * stiffness)


@kernel
def _spring(sim, k, h):
    """Return the torque of a spring without the part of ṡ⁺, and the fraction E/(E + B)."""
    weight = sim.motor_weight[k]
    B = sim.rotor_inertia[k]
    E = implicit_inertia(sim.spring_stiffness[k], sim.spring_damping[k], weight, h)
    stretch = sim.theta[k] - sim.first_q[sim.coordinate[k]]
    torque = sim.spring_stiffness[k] * stretch
    torque += E * (1.0 - weight) / (weight * h) * (sim.thetad[k] - sim.before[k])
    return torque, E / (E + B)


@large_kernel
def eliminate_motors(address, h, tau):
    """Set the efforts on links and the reflected inertias of a step."""
    sim = opened(address)
    for k in range(len(tau)):
        sim.link_effort[k] = tau[k]
        sim.reflected[k] = 0.0
        if sim.rotor_inertia[k] > 0.0:
            B = sim.rotor_inertia[k]
            torque, part = _spring(sim, k, h)
            sim.reflected[k] = part * B
            accelerating = tau[k] + B * (sim.thetad[k] - sim.before[k]) / h
            sim.link_effort[k] = (1.0 - part) * torque + part * accelerating


@large_kernel
def move_motor(address, k, h, tau):
    """Move a motor after its link, at q and q̇ after the step; return the lost energy [J]."""
    sim = opened(address)
    weight = sim.motor_weight[k]
    after = sim.qd[k]
    torque, part = _spring(sim, k, h)
    stretch = sim.theta[k] - sim.first_q[sim.coordinate[k]]
    rate = (1.0 - weight) * (sim.thetad[k] - sim.before[k])
    free = sim.thetad[k] + h * (tau - torque) / sim.rotor_inertia[k]
    sim.thetad[k] = free + part * (after - free)
    rate += weight * (sim.thetad[k] - after)
    sim.theta[k] = sim.q[sim.coordinate[k]] + stretch + h * rate
    return h * rate * rate * (sim.spring_damping[k] + (weight - 0.5) * h * sim.spring_stiffness[k])


@large_kernel
def stored_energy(address):
    """Return ½k(θ − q)² of all springs [J]."""
    sim = opened(address)
    energy = 0.0
    for k in range(len(sim.rotor_inertia)):
        if sim.rotor_inertia[k] > 0.0:
            energy += 0.5 * sim.spring_stiffness[k] * (sim.theta[k] - sim.q[sim.coordinate[k]]) ** 2
    return energy
