# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What kernels compute is what Python computes with the same functions."""

import math

import numba
import numpy as np
import pytest

from diag_dynamics.compiled.kernel import COUNT, FILLED_MATRIX, FILLED_VECTOR, MATRIX, VECTOR, entry_kernel, kernel

STEP = 3


@kernel
def ranges(a, n, out):
    for k in range(n):
        out[k] += a[k]
    for k in range(2, n):
        out[k] += 10.0 * k
    for k in range(n - 1, -1, -1):
        out[k] += out[(k + 1) % n]
    for k in range(n - 1, 0, -STEP):
        out[k] -= 100.0
    for k in range(3, 3):
        out[k] = math.nan
    for k in range(5, 2):
        out[k] = math.nan
    for k in range(1, n, n):
        for j in range(k):
            out[j] += 0.5
    return k + j


@kernel
def extremes(a, n, out):
    for k in range(n):
        out[k] = min(a[k], a[k - 1], 0.5) + max(k, n - k, 2) * max(a[k], -0.0)
    out[0], out[1] = max(a[2], math.nan), max(math.nan, a[2])
    out[2], out[3] = math.copysign(1.0, min(0.0, -0.0)), math.copysign(1.0, max(-0.0, 0.0))
    return min(n, 4)


@kernel
def indices(a, n, out):
    found = (a[0], a[-1], a[2])
    total = 0.0
    for k in range(-3, 3):
        total += found[k] * (k + 5)
    for k in range(n):
        out[-1 - k] = total - a[k - n]
    return n


@kernel
def branches(a, n, out):
    last, how = 0.0, 0
    while how < n:
        if a[how] > 0.0:
            last = a[how]
        elif how == 3:
            how += 2
            continue
        else:
            before = last
            last = -1.0
            if before > 1.0:
                break
        out[how] = last
        how += 1
    return how


@kernel
def _apart(x, y, swap=False):
    if swap:
        x, y = y, x
    return (x, (y, x > y)), x < y


@kernel
def calls(a, n, out):
    for k in range(1, n):
        (x, (y, more)), less = _apart(a[k], a[k - 1])
        (u, _), _ = _apart(a[k], a[k - 1], k % 2 == 0)
        out[k] = x + 3.0 * y + (7.0 if more else 0.0) - (9.0 if less else 0.0) + 0.1 * u
    return len(a)


@pytest.mark.parametrize("function", [ranges, extremes, indices, branches, calls], ids=lambda f: f.py_func.__name__)
def test_a_kernel_does_what_python_does(function):
    @entry_kernel(VECTOR, COUNT, FILLED_VECTOR)
    def entry(a, n, out):
        return function(a, n, out)

    rng = np.random.default_rng(3)
    for _ in range(5):
        a = rng.normal(size=9)
        out, expected = np.zeros(9), np.zeros(9)
        assert entry(a, 9, out) == in_python(function)(a, 9, expected)
        np.testing.assert_array_equal(out, expected)


def in_python(function):
    """A kernel as Python runs it, with those that it calls."""
    code = function.py_func
    names = {**code.__globals__, "_apart": _apart.py_func}
    return type(code)(code.__code__, names)


def test_entries_of_matrices_lie_where_they_do_in_numpy():
    @entry_kernel(MATRIX, FILLED_MATRIX)
    def entry(A, out):
        m, n = A.shape
        for i in range(m):
            row = out[i]
            for j in range(n):
                row[j] = A[i, j] + 2.0 * A[i - m, -1 - j]
            out[i - m, 0] += A[-1][i % n]

    A, out = np.arange(12.0).reshape(3, 4), np.zeros((3, 4))
    entry(A, out)
    expected = A + 2.0 * A[:, ::-1]
    expected[:, 0] += A[-1, :3]
    np.testing.assert_array_equal(out, expected)


def test_exceptions_of_kernels_come_through():
    """Those of a kernel that a kernel calls, too; and one whose numbers are added by numba's own function."""

    @kernel
    def root(x):
        if x < 0.0:
            raise ValueError("negative")
        return math.sqrt(x)

    @kernel
    def total(a):
        return a.sum() + root(a[0])

    @entry_kernel(VECTOR)
    def entry(a):
        return total(a) + 1.0

    assert entry(np.array([4.0, 2.0])) == 9.0
    with pytest.raises(ValueError, match="negative"):
        entry(np.array([-1.0]))


def test_functions_of_others_may_call_kernels():
    """What is compiled by numba alone takes from a kernel what an entry takes, and its own exceptions still come through."""

    @kernel
    def both(x, y=2.0):
        return (x + y, x > y), y

    @numba.njit
    def foreign(x):
        (total, more), y = both(x)
        if more:
            raise ValueError("more")
        return total * y

    assert foreign(1.0) == 6.0
    with pytest.raises(ValueError, match="more"):
        foreign(3.0)
