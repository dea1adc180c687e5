"""Types of what the library takes and gives: arrays of float64 come out, anything that is numbers goes in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[np.float64]
"""What comes out."""

Numbers: TypeAlias = npt.NDArray[np.floating[Any]] | npt.NDArray[np.integer[Any]]
"""An array of numbers, of any shape."""

VectorLike: TypeAlias = Numbers | Sequence[float] | Sequence[np.floating[Any]]
"""One number for each of something. Text, which NumPy's own ArrayLike has among it, is none."""

MatrixLike: TypeAlias = Numbers | Sequence[VectorLike]
"""Rows of numbers."""

Wrenches: TypeAlias = Mapping[str, VectorLike]
"""Six numbers, force [N] then moment [N m], by link name."""

Frame: TypeAlias = Literal["link", "world"]
"""Whose axes a wrench is in."""
