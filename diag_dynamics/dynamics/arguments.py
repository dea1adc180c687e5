# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments of DiagonalDynamics: checked vectors of one state or rows of many."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from diag_dynamics.arrays import Array

ARRAY, FLOAT = np.ndarray, np.dtype(np.float64)


def are_vectors(q: Any, x: Any, y: Any) -> TypeGuard[Array]:
    """Return whether kernels may get these arguments without conversion.

    Kernels would ignore the mask of a subclass, and may read another byte order as this machine's.
    For other shapes and strides they raise TypeError.
    """
    return type(q) is type(x) is type(y) is ARRAY and q.dtype is x.dtype is y.dtype is FLOAT


class States(NamedTuple):
    """Checked arguments: vectors (nq,) and (nv,) of one state, or rows of many states.

    Rates or efforts that are zero in many states have a single row. `threads` is 0 for one state.
    """

    q: Array
    vectors: Mapping[str, Array] = {}
    threads: int = 0

    def at(self, t: int) -> States:
        """Return the arguments at one of many states."""
        return States(self.q[t], {name: x[min(t, len(x) - 1)] for name, x in self.vectors.items()})
