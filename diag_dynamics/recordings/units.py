# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units of positions, velocities and times, by the regression of Δq on ∫q̇dt."""

import numpy as np

from diag_dynamics.assembly.stamps import SECOND

MIN_CORRELATION = 0.9
"""Least squared correlation of Δq and ∫q̇dt that determines a ratio."""


def position_changes(position, continuous, out=None):
    """Return changes of positions from row to row, shape (T − 1, n); those of continuous joints are within ±π."""
    changes = np.subtract(position[1:], position[:-1], out=out)
    changes[:, continuous] = (changes[:, continuous] + np.pi) % (2.0 * np.pi) - np.pi
    return changes


def position_ratios(stamps, position, velocity, continuous):
    """Return the slope of Δq over ∫q̇dt of each joint, 1 if units agree; NaN where they do not correlate.

    Parameters
    ----------
    stamps : ndarray of int64, shape (T,)
        [ns]
    position, velocity : ndarray, shape (T, n)
        Pairs of rows with a gap between them, or with a value that is not finite, are left out.
    continuous : ndarray of bool, shape (n,)
        Joints without limits, whose positions may be wrapped.

    Returns
    -------
    ndarray, shape (n,)
    """
    elapsed = np.diff(stamps)[:, None] / SECOND
    forward = elapsed > 0.0
    if not forward.any():
        return np.full(position.shape[1], np.nan)
    with np.errstate(all="ignore"):
        changes = position_changes(position, continuous)
        integrals = 0.5 * elapsed * (velocity[1:] + velocity[:-1])
        used = forward & (elapsed < 2.0 * np.median(elapsed[forward])) & np.isfinite(changes + integrals)
        changes, integrals = np.where(used, changes, 0.0), np.where(used, integrals, 0.0)
        size, square, product = ((a * b).sum(0) for a, b in ((changes,) * 2, (integrals,) * 2, (changes, integrals)))
        return np.where(product**2 > MIN_CORRELATION * size * square, product / square, np.nan)
