# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The largest of each column of a piece, and where it is."""

import numpy as np

from diag_dynamics.compiled.kernel import FILLED_VECTOR, FLAG, MATRIX, entry_kernel


@entry_kernel(MATRIX, FLAG, FILLED_VECTOR, FILLED_VECTOR, nogil=True)
def find_largest(values, absolute, largest, at):
    """Write the largest of each column, or the largest magnitude, and its row; −inf where all are NaN."""
    count, n = values.shape
    for k in range(n):
        largest[k], at[k] = -np.inf, 0.0
    for t in range(count):
        for k in range(n):
            value = abs(values[t, k]) if absolute else values[t, k]
            if value > largest[k]:
                largest[k], at[k] = value, t
