# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How exact is exact: the tolerance of every comparison with an oracle, stated once."""

import numpy as np

from diag_dynamics.results import Evaluation

QUANTITIES = [
    name
    for name, value in vars(Evaluation).items()
    if isinstance(value, property) and name not in ("model", "rows")
]

EPS = np.finfo(float).eps
norm = np.linalg.norm


def tolerance(truth):
    """Return the relative tolerance against an oracle's `State`, which is exact but for rounding.

    It scales with cond(M), M in units in which its diagonal is 1: those of ν, in which all dofs
    weigh alike.
    """
    return max(1e-12, 100 * EPS * truth.scaled_condition)


def assert_close(actual, expected, tolerance, scale=None):
    """Arrays or numbers agree to `tolerance` relative to `scale`, by default the norm of the
    expected.
    """
    actual = np.asarray(actual)
    expected = np.asarray(expected)
    assert actual.shape == expected.shape
    assert actual.dtype == np.float64
    assert np.isfinite(actual).all()
    scale = norm(expected) if scale is None else scale
    error = norm(actual - expected)
    assert error <= tolerance * scale, (
        f"relative error {error / scale if scale else np.inf:.1e} > {tolerance:.1e}"
    )
