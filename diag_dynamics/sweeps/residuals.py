# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Residuals of the disturbance observer over many samples: ṙ = K (ε_ext − r), as DisturbanceObserver has it."""

import numpy as np

from diag_dynamics.numerics.kernel import FILLED_MATRIX, FILLED_VECTOR, MATRIX, VECTOR, entry_kernel


@entry_kernel(VECTOR, VECTOR, *[MATRIX] * 3, FILLED_MATRIX, FILLED_MATRIX, FILLED_VECTOR, nogil=True)
def observe_samples(gain, interval, nu, resisting, epsilon, last, residual, norm):
    """Write r and |r| of samples; `last` has r, ν, ε_g + C + ε_fric and ε of the sample before, and then of the last one."""
    for t in range(len(interval)):
        square = 0.0
        for k in range(len(gain)):
            r = 0.0
            if interval[t] > 0.0:
                mean = 0.5 * (last[3, k] + epsilon[t, k] - last[2, k] - resisting[t, k])
                external = (nu[t, k] - last[1, k]) / interval[t] - mean
                r = last[0, k] - np.expm1(-gain[k] * interval[t]) * (external - last[0, k])
            residual[t, k] = r
            square += r * r
            last[0, k], last[1, k], last[2, k], last[3, k] = r, nu[t, k], resisting[t, k], epsilon[t, k]
        norm[t] = np.sqrt(square)
        if not np.isfinite(norm[t]):
            for k in range(len(gain)):
                last[0, k] = 0.0
