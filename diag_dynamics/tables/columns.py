"""What readers of tables hand out: rows of joints' values in pieces, in SI units."""

from typing import NamedTuple

import numpy as np


class Columns(NamedTuple):
    """Rows as they stand in the file; a value that is missing or cannot be read as a number is NaN."""

    time: np.ndarray
    """[s], float64, shape (n,); as in the file."""
    position: np.ndarray
    """[rad, m], float64, shape (n, k): a column for each of the joints."""
    velocity: np.ndarray | None
    """[rad/s, m/s], likewise; None where the file has none."""
    effort: np.ndarray | None
    """[N m, N], likewise."""
    rows: np.ndarray
    """Row of the file that each is, from 0 after the header: int64, shape (n,)."""
