# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of arguments and results: results are float64, arguments anything that converts to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
Numbers: TypeAlias = npt.NDArray[np.floating[Any]] | npt.NDArray[np.integer[Any]]


class PandasLike(Protocol):
    """A Series or DataFrame of pandas, which need not be installed."""

    @property
    def index(self) -> Any:
        """Return the labels."""

    def to_numpy(self) -> Any:
        """Return the numbers."""


PointLike: TypeAlias = Numbers | Sequence[float] | Sequence[np.floating[Any]]
"""Numbers, but no text, which NumPy's own ArrayLike includes."""

VectorLike: TypeAlias = PointLike | Mapping[str, float] | PandasLike
"""One number per joint, or by name."""

RowsLike: TypeAlias = Numbers | Sequence[VectorLike]
"""Rows of numbers."""

MatrixLike: TypeAlias = RowsLike | Mapping[str, Any] | PandasLike
"""Rows of numbers, or columns by name."""

StatesLike: TypeAlias = VectorLike | MatrixLike
"""One state, or one row per state."""

Wrenches: TypeAlias = Mapping[str, VectorLike]
"""Six numbers, force [N] then moment [N m], by link name."""

ManyWrenches: TypeAlias = Mapping[str, VectorLike | MatrixLike]
"""Six numbers for all states, or one row per state, by link name."""

Frame: TypeAlias = Literal["link", "world"]
"""Axes of a wrench, a twist or a Jacobian."""

FRAMES: tuple[str, ...] = get_args(Frame)
