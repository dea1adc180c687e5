# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot moving under its own dynamics: fixed steps of the midpoint rule, compiled.

The state is (q, q̇). Damping over D reaches 10⁶ s⁻¹ on the small links of a hand, so dampers and
springs are implicit: a step solves with M + A, which is the O(N) recursion with A added to the
armature. The rest is explicit: see midpoint.

Joints of several degrees of freedom move on a manifold: a step displaces their positions by exp(u)
with a twist u.

Friction and limits are not smooth. In a step a joint slides, sticks, rests at a hard limit or leans
on a compliant one: a linear complementarity problem decides on it, see modes.

simulation: the public class. memory: its arrays. modes: mode of each joint, and the solver of a
step. flexible: motors behind springs. midpoint: a step, and impacts. steps: many of them. plant,
drives, pace: the robot of the simulator node.
"""

from diag_dynamics.simulation.simulation import (
    CompliantLimits,
    EnergyAudit,
    Simulation,
    rest_position,
)

__all__ = ["CompliantLimits", "EnergyAudit", "Simulation", "rest_position"]
