# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of the kinetic energy of a robot whose efforts last for a cycle.

In total joint rates ν the kinetic energy is ½|ν|²: a limit of it is a ball, and limits of the shares ½ν_k² are a box.
"""

import math

from diag_dynamics.numerics import kernel as nk


@nk.entry_kernel(nk.VECTOR, nk.VECTOR, nk.NUMBER, nk.NUMBER, nk.VECTOR, nk.NUMBER, nk.FILLED_VECTOR)
def project(nu, flow, period, limit, joint_limit, rate, change):
    """Fill the change of ε by which ν + h·flow, the rates at the end of a cycle, keep box and ball; 1 if there is one.

    Energies approach their limits, from below and from above, at `rate` [1/s].
    """
    share_of_gap, now, ahead, is_limited = min(rate * period, 1.0), 0.0, 0.0, False
    for k in range(len(nu)):
        share, end = 0.5 * nu[k] * nu[k], nu[k] + period * flow[k]
        now += share
        if joint_limit[k] < math.inf:
            largest = math.sqrt(2.0 * (share + share_of_gap * (joint_limit[k] - share)))
            is_limited = is_limited or abs(end) > largest
            end = min(max(end, -largest), largest)
        change[k] = end
        ahead += 0.5 * end * end
    fraction = 1.0
    if limit < math.inf:
        allowed = now + share_of_gap * (limit - now)
        if ahead > allowed:
            fraction, is_limited = math.sqrt(allowed / ahead), True
    for k in range(len(nu)):
        change[k] = (fraction * change[k] - nu[k]) / period - flow[k]
    return 1 if is_limited else 0
