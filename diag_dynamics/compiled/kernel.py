# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The decorators that compile the physics, and the types that kernels are compiled for."""

from diag_dynamics.compiled.switch import PLAIN

if PLAIN:
    from diag_dynamics.compiled.plain import INLINED, array_of, entry_kernel, filled_of, kernel, large_kernel, ready
else:
    from diag_dynamics.compiled.native import INLINED, array_of, entry_kernel, filled_of, kernel, large_kernel, ready

import numba

ROBOT = numba.int64
"""Type of the argument that stands for a robot: see sweeps.Workspace."""

VECTOR, MATRIX, STATES = map(array_of, (1, 2, 3))
FILLED_VECTOR, FILLED_MATRIX, FILLED_STATES = map(filled_of, (1, 2, 3))
NUMBER, COUNT, FLAG = numba.float64, numba.int64, numba.boolean

__all__ = [
    "COUNT",
    "FILLED_MATRIX",
    "FILLED_STATES",
    "FILLED_VECTOR",
    "FLAG",
    "INLINED",
    "MATRIX",
    "NUMBER",
    "ROBOT",
    "STATES",
    "VECTOR",
    "entry_kernel",
    "kernel",
    "large_kernel",
    "ready",
]
