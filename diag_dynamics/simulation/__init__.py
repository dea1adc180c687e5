# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot moving under its own dynamics: fixed steps of the diagonalized equations (Algorithm 8.1), compiled.

The state is (q, ν) and its equations ν̇ = ε − C − ε_g − ε_d, q̇ = ℓᵀν, with ε_d = ℓ d q̇ the joint damping. Damping over D
reaches 10⁶ s⁻¹ on the small links of a hand, so it is implicit: a stage with step fraction hγ solves with (M + hγ d), which
is the same O(N) recursion with hγ d added to the armature. The rest is explicit: see runge_kutta.

Joints of several degrees of freedom move on a manifold: over a step their positions are q₀ exp(u), and the method
integrates the twist u, whose rate is q̇ but for terms of the commutator (Munthe-Kaas, Applied Numerical Mathematics 29, 1999).

Order 1 is for speed: semi-implicit Euler on (q, q̇) with implicit damping, one forward dynamics a step.

Friction and limits are not smooth. The equations are smooth while no joint changes its mode: it slides, sticks, rests at a
hard limit or leans on a compliant one; a joint that sticks is locked. A step in which a joint changes its mode is taken
again at order 1, in sub-steps.

simulation: the public class. memory: its arrays. modes: mode of each joint, and the solver of stiction.
flexible: motors behind springs. runge_kutta: order 4. euler: order 1 and impacts. steps: the choice between them. plant,
drives, pace: the robot of the simulator node.
"""

from diag_dynamics.simulation.simulation import (
    CompliantLimits,
    EnergyAudit,
    Simulation,
    potential_energy,
    rest_position,
)

__all__ = ["CompliantLimits", "EnergyAudit", "Simulation", "potential_energy", "rest_position"]
