# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Types of what the library takes and gives: arrays of float64 come out, anything that is numbers goes in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
"""What comes out."""

Whole: TypeAlias = npt.NDArray[np.int64]
"""Whole numbers, such as stamps [ns]."""

Flags: TypeAlias = npt.NDArray[np.bool_]
"""What is so, and what is not."""

Numbers: TypeAlias = npt.NDArray[np.floating[Any]] | npt.NDArray[np.integer[Any]]
"""An array of numbers, of any shape."""


class Labelled(Protocol):
    """A Series or DataFrame of pandas, which need not be installed."""

    @property
    def index(self) -> Any:
        """Its labels."""

    def to_numpy(self) -> Any:
        """Its numbers."""


PointLike: TypeAlias = Numbers | Sequence[float] | Sequence[np.floating[Any]]
"""Some numbers. Text, which NumPy's own ArrayLike has among it, is none."""

VectorLike: TypeAlias = PointLike | Mapping[str, float] | Labelled
"""One number for each of something, or by its name."""

RowsLike: TypeAlias = Numbers | Sequence[VectorLike]
"""Rows of numbers."""

MatrixLike: TypeAlias = RowsLike | Mapping[str, Any] | Labelled
"""Rows of numbers, or columns by name."""

StatesLike: TypeAlias = VectorLike | MatrixLike
"""Numbers of one state, or of many."""

Wrenches: TypeAlias = Mapping[str, VectorLike]
"""Six numbers, force [N] then moment [N m], by link name."""

ManyWrenches: TypeAlias = Mapping[str, VectorLike | MatrixLike]
"""The same for all of many states, or a row for each."""

Frame: TypeAlias = Literal["link", "world"]
"""Whose axes a wrench is in."""
