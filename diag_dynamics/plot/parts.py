# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Means, minima and maxima over parts of time, for curves with more oscillations than a picture can show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array

MAX_OSCILLATIONS = 100
"""Maximum number of oscillations that a picture shows one by one; a line of more of them covers everything else."""

COUNT = 100
"""Number of parts."""


class Parts(NamedTuple):
    """Values of each part; NaN in a part without samples."""

    time: Array
    """Middle of each part [s], shape (COUNT,)."""
    mean: Array
    """Shape (COUNT, n)."""
    minimum: Array
    maximum: Array
    length: float
    """Length of a part [s]."""


def oscillates(values: Array) -> bool:
    """Return whether a curve has more than :data:`MAX_OSCILLATIONS` oscillations about its mean, shape (T,)."""
    known = values[np.isfinite(values)]
    above = known > known.mean() if len(known) else known
    return int(np.count_nonzero(above[1:] != above[:-1])) > 2 * MAX_OSCILLATIONS


def parts_of(time: Array, values: Array) -> Parts:
    """Return means, minima and maxima over :data:`COUNT` parts of time of equal length.

    Parameters
    ----------
    time : ndarray, shape (T,)
        Increasing [s].
    values : ndarray, shape (T, n)
        NaN where unknown.
    """
    edges = np.linspace(time[0], time[-1], COUNT + 1)
    part = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, COUNT - 1)
    mean, minimum, maximum = np.full((3, COUNT, values.shape[1]), np.nan)
    begins = np.flatnonzero(np.diff(part, prepend=-1))
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        sums = np.add.reduceat(np.where(known, values, 0.0), begins)
        mean[part[begins]] = sums / np.add.reduceat(known, begins, dtype=int)
    low = np.minimum.reduceat(np.where(known, values, np.inf), begins)
    high = np.maximum.reduceat(np.where(known, values, -np.inf), begins)
    minimum[part[begins]] = np.where(np.isfinite(low), low, np.nan)
    maximum[part[begins]] = np.where(np.isfinite(high), high, np.nan)
    return Parts(0.5 * (edges[1:] + edges[:-1]), mean, minimum, maximum, float(edges[1] - edges[0]))
