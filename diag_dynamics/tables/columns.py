# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What readers of tables hand out: rows of joints' values in pieces, in SI units."""

from typing import NamedTuple

import numpy as np


class Columns(NamedTuple):
    """Rows as they stand in the file; a value that is missing or cannot be read as a number is NaN.

    Every row has a time. Rows without one, and rows that are none, are left out and counted in the reader's `unread`.
    """

    time: np.ndarray
    """[s], float64, shape (n,); as in the file."""
    stamp: np.ndarray
    """[ns], int64, likewise: exact where the file is, which a double is not (it holds 1.7e9 s to 2.4e-7 s). Cut at ±2⁶², so
    that differences of two do not overflow."""
    position: np.ndarray
    """[rad, m], float64, shape (n, k): a column for each of the joints."""
    velocity: np.ndarray | None
    """[rad/s, m/s], likewise; None where the file has none."""
    effort: np.ndarray | None
    """[N m, N], likewise."""
    rows: np.ndarray
    """Row of the file that each is, from 0 after the header: int64, shape (n,). Rows that are left out count, empty lines and
    comments do not."""
    names: np.ndarray | None = None
    """Joint of each value, str, shape (n, k), where rows name their joints; empty where a row has fewer. None: every row has
    the reader's `joints`."""
