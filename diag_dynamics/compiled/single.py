# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What kernels for lanes need where a lane is all that there is: the interface of registers, for a single number."""

import numba

from diag_dynamics.compiled.plain import kernel

WIDTH = 1
EIGHT = numba.float64


def spreader(lanes):
    """Kernel (number) that gives it."""
    return _same


@kernel
def _same(number):
    return number


@kernel
def nought(like):
    """Zero."""
    return 0.0


@kernel
def lane_of(x, lane):
    """Return the number."""
    return x


@kernel
def with_lane(x, lane, number):
    """Return the other number."""
    return number


@kernel
def lanes_at(a, k):
    """Entry k of a vector."""
    return a[k]


@kernel
def set_lanes(a, k, x):
    """Write entry k."""
    a[k] = x


@kernel
def set_lanes_from(a, k, x, first):
    """Write entry k, if the only lane is `first` or later."""
    if first <= 0:
        a[k] = x


@kernel
def from_lane(first, x, y):
    """Return x if the only lane is `first` or later, else y."""
    return x if first <= 0 else y


def record_of_lanes(dtype, lanes):
    """Type of a record of numbers."""
    return numba.from_dtype(dtype)
