# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sine and cosine in one, without a branch up to :data:`LARGEST`: a loop over many angles runs in vector registers.

The angle less the nearest multiple of π/2, which is taken off in two parts (Cody and Waite 1980), then the polynomials of
fdlibm for |x| <= π/4. Errors are below one unit in the last place of 1.
"""

import math

from diag_dynamics.numerics.kernel import kernel

LARGEST = 1e6
"""Up to this angle [rad] a multiple of the first part of π/2 has no rounding error; beyond it, the C library is asked."""

TO_NEAREST = 6755399441055744.0
"""1.5 · 2⁵²: adding and subtracting it leaves the nearest whole number."""

HALF_PI, REST_OF_HALF_PI = 1.57079632673412561417, 6.07710050650619224932e-11

SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)

COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)


@kernel
def _nearest(x):
    return (x + TO_NEAREST) - TO_NEAREST


@kernel
def _polynomials(y, t):
    """Sine and cosine of y + t, |y| <= π/4 and t its rounding error."""
    z = y * y
    v = z * y
    p = SINE[1] + z * (SINE[2] + z * (SINE[3] + z * (SINE[4] + z * SINE[5])))
    sine = y - ((z * (0.5 * t - v * p) - t) - v * SINE[0])
    p = z * (COSINE[0] + z * (COSINE[1] + z * (COSINE[2] + z * (COSINE[3] + z * (COSINE[4] + z * COSINE[5])))))
    half = 0.5 * z
    rounded = 1.0 - half
    return sine, rounded + (((1.0 - rounded) - half) + (z * p - y * t))


@kernel
def near_sine_and_cosine(x):
    """Sine and cosine of |x| <= LARGEST, without a branch."""
    n = _nearest(x * (2.0 / math.pi))
    r = x - n * HALF_PI
    w = n * REST_OF_HALF_PI
    y = r - w
    s, c = _polynomials(y, (r - y) - w)
    odd = n - 2.0 * _nearest(0.5 * n)
    odd = odd * odd  # 1 where n is odd, else 0
    even = 1.0 - odd
    turns = 0.5 * (n - odd)
    back = turns - 2.0 * _nearest(0.5 * turns)
    sign = 1.0 - 2.0 * back * back
    return sign * (even * s + odd * c), sign * (even - odd) * (even * c + odd * s)


@kernel
def sine_and_cosine(x):
    """Sine and cosine of an angle [rad]."""
    if abs(x) < LARGEST:
        return near_sine_and_cosine(x)
    return math.sin(x), math.cos(x)
