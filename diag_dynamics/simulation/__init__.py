# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot moving under its own dynamics: fixed steps of the diagonalized equations (Algorithm 8.1), compiled.

The state is (q, ν) and its equations ν̇ = ε − C − ε_g − ε_d, q̇ = ℓᵀν, with ε_d = ℓ d q̇ the joint damping.
Damping over D reaches 10⁶ s⁻¹ on the small links of a hand, far beyond what an explicit step of a millisecond
bears, so it is taken implicitly: at a stage with step fraction hγ it costs one solve with (M + hγ d), which is the
same O(N) recursion with hγ d added to the armature. The rest is explicit. Without damping the method is the
explicit Runge–Kutta method of the pair, see tableau.

Joints of several degrees of freedom move on a manifold: over a step their positions are q₀ exp(u), and what is integrated is
the twist u, whose rate is q̇ but for terms of the commutator (Munthe-Kaas, Applied Numerical Mathematics 29, 1999).
Quaternions so keep their length and the method its order.

Order 1 is there for speed: semi-implicit Euler on (q, q̇), as most simulators have it, damping implicit here too. A step
costs one forward dynamics, which adds hd to the armature.

Friction and limits are not smooth. While a joint slides, sticks, rests at a stop or leans on a spring the equations are: a
joint that sticks is held, as by a rotor that nothing moves, and every sweep takes the robot for one that is locked there.
friction_and_limits says which joints do what, and steps finds, at order 4, the instants in which joints stop and come to
limits; which break away is seen where a step begins. At order 1 all that is decided there.

layout: records and memory, found by name. tableau: the method. smooth: a step in which nothing changes its mode.
friction_and_limits: what changes it. steps: all of it. states, resistance: what is given to it, checked. audit: where the
energy went. plant: what users call. wave: something to do.
"""

from diag_dynamics.simulation.audit import EnergyAudit
from diag_dynamics.simulation.resistance import CompliantLimits
from diag_dynamics.simulation.simulation import Simulation
from diag_dynamics.simulation.states import potential_energy, rest_position
from diag_dynamics.simulation.tableau import EXPLICIT, IMPLICIT, STAGES, WEIGHTS
from diag_dynamics.simulation.wave import Wave

__all__ = [
    "EXPLICIT",
    "IMPLICIT",
    "STAGES",
    "WEIGHTS",
    "CompliantLimits",
    "EnergyAudit",
    "Simulation",
    "Wave",
    "potential_energy",
    "rest_position",
]
