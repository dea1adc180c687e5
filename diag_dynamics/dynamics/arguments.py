# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments of DiagonalDynamics: checked vectors of one state or rows of many, and loads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from diag_dynamics import checks, threads
from diag_dynamics.arrays import Array, Frame, ManyWrenches
from diag_dynamics.model import RobotModel

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


class Arguments:
    """Checks of the arguments of one robot.

    The vector `zero` passes for rates and efforts of one state or of many.
    """

    def __init__(self, model: RobotModel) -> None:
        self._model = model
        self.zero = np.zeros(model.nv)

    def one(self, q: Any, **vectors: Any) -> States:
        """Return the arguments of one state, copied; kernels check whether they are finite."""
        names = self._model.dof_names
        q = checks.vector("q", q, self._model.coordinate_names, finite=False)
        for name, x in vectors.items():
            if x is not self.zero:
                vectors[name] = checks.vector(name, x, names, finite=False)
        return States(q, vectors)

    def states(self, q: Any, number: int | None, **vectors: Any) -> States:
        """Return the arguments of one state, or of many if q has rows.

        Many are for a number of threads or all processors.
        """
        if not checks.is_rows(q):
            return self.one(q, **vectors)
        q = checks.rows("q", q, self._model.coordinate_names)
        names = self._model.dof_names
        for name, x in vectors.items():
            is_zero = x is self.zero
            vectors[name] = x[None] if is_zero else checks.rows(name, x, names, len(q))
        number = threads.cores() if number is None else checks.whole("threads", number)
        return States(q, vectors, number)


class Loads:
    """Wrenches and friction, as arguments of methods."""

    def __init__(self, f_ext: ManyWrenches | None, frame: Frame, friction: bool) -> None:
        checks.choice("frame", frame, ("link", "world"))
        self.frame = frame
        self.friction = friction
        # All but None and an empty dict counts, to be checked.
        self.wrenches: Any = None if isinstance(f_ext, dict) and not f_ext else f_ext
