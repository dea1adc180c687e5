# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers side by side: every lane gets what a number would get alone, to the last bit."""

import math

import numba
import numpy as np
import pytest

from diag_dynamics.compiled.arrays import array_at
from diag_dynamics.compiled.kernel import VECTOR, entry_kernel
from diag_dynamics.compiled.registers import (
    EIGHT,
    FOUR,
    WIDTH,
    chooser,
    from_lane,
    lanes_at,
    loader,
    mover,
    nought,
    set_lanes,
    set_lanes_from,
    spreader,
    store,
)
from diag_dynamics.compiled.trigonometry import LARGEST, sine_and_cosine
from diag_dynamics.sweeps.workspace import aligned

_lanes_at = array_at(EIGHT, 1)


def in_registers(x):
    """Return a copy that lies where lanes may."""
    copy = aligned(WIDTH, np.dtype(float))
    copy[:] = x
    return copy


def of_lanes_and_of_numbers(formula):
    """Return two functions of vectors x and y of WIDTH numbers: the formula of all at once, and of one after the other."""
    inlined = numba.njit(error_model="numpy")(formula)

    @numba.njit(error_model="numpy")
    def wide(x, y, result):
        _lanes_at(result, (1,))[0] = inlined(_lanes_at(x, (1,))[0], _lanes_at(y, (1,))[0])

    @numba.njit(error_model="numpy")
    def narrow(x, y):
        return inlined(x, y)

    def both(x, y):
        x, y, result = in_registers(x), in_registers(y), in_registers(x)
        wide(x.ctypes.data, y.ctypes.data, result.ctypes.data)
        return result, np.array([narrow(a, b) for a, b in zip(x, y, strict=True)])

    return both


FORMULAS = {
    "arithmetic": lambda x, y: 2.0 * x + y / 3.0 - x * y / (1.0 + abs(y)) - (-x),
    "in place": lambda x, y: _in_place(x, y),
    "square root and larger": lambda x, y: math.sqrt(abs(x)) + max(x, y) - max(x, 0.5),
    "sine": lambda x, y: sine_and_cosine(x)[0] + 0.0 * y,
    "cosine": lambda x, y: sine_and_cosine(x)[1] + 0.0 * y,
    "nought": lambda x, y: nought(x) + y,
}


@numba.njit
def _in_place(x, y):
    x += y
    x -= 1
    x *= y
    x /= 3.0
    return x


@pytest.mark.parametrize("name", FORMULAS)
def test_lanes_have_the_bits_of_numbers(name):
    rng = np.random.default_rng(5)
    both = of_lanes_and_of_numbers(FORMULAS[name])
    for size in (1.0, 1e-8, 1e5, 1e9):  # at 1e9 some lanes are beyond LARGEST, some are not
        for _ in range(20):
            x, y = size * rng.standard_normal((2, WIDTH)) * rng.choice([1e-4, 1.0], (2, WIDTH))
            wide, narrow = both(x, y)
            assert wide.tobytes() == narrow.tobytes()


def test_a_comparison_holds_where_it_holds_in_every_lane():
    @numba.njit
    def holds(x, y):
        a, b = _lanes_at(x, (1,))[0], _lanes_at(y, (1,))[0]
        return a < b, math.isfinite(a)

    x, y = in_registers(0.0), in_registers(1.0)
    assert holds(x.ctypes.data, y.ctypes.data) == (True, True)
    for lane in range(WIDTH):
        for value, finite in ((1.0, True), (2.0, True), (np.nan, False), (np.inf, False)):
            other = in_registers(x)
            other[lane] = value
            assert holds(other.ctypes.data, y.ctypes.data) == (False, finite), (lane, value)


@pytest.mark.parametrize(("lanes", "width"), [(FOUR, 4), (EIGHT, 8)])
def test_matrices_of_lanes_are_read_moved_and_written(lanes, width):
    """Layouts of stacks: eight numbers from entry to entry, lanes moved among four."""
    load, spread = loader(lanes), spreader(lanes)
    move, choose = mover(None, 0, 1, None), chooser(False, True, False, True)

    @numba.njit
    def moved(a, b):
        M = move(load(a))
        x = choose(M[0][0], spread(7.0))
        store(b, ((x, M[0][1], M[0][2]), M[1], M[2]))

    a, b = np.arange(72.0) + 1.0, np.zeros(72)
    moved(a, b)
    given, found = a.reshape(9, 8)[:, :width], b.reshape(9, 8)
    expected = np.zeros((9, width))
    for first in range(0, width, 4):
        expected[:, first + 1 : first + 3] = given[:, first : first + 2]
    expected[0, 1::2] = 7.0
    np.testing.assert_array_equal(found[:, :width], expected)
    assert not found[:, width:].any()


@pytest.mark.parametrize("first", [-1, 0, 3, 7, 8, 9])
def test_lanes_from_one_on_are_chosen_and_written(first):
    """Where a row is shorter than a register, the lanes before `first` have no place in it."""

    @numba.njit
    def write(a, b, first):
        x = lanes_at(a, 1)
        set_lanes_from(b, 2, x, first)
        set_lanes(b, 12, from_lane(first, x, lanes_at(a, 9)))

    a, b = np.arange(20.0), np.full(22, -1.0)
    write(a, b, first)
    later = np.arange(WIDTH) >= first
    np.testing.assert_array_equal(b[2:10], np.where(later, a[1:9], -1.0))
    np.testing.assert_array_equal(b[12:20], np.where(later, a[1:9], a[9:17]))
    assert (b[[0, 1, 10, 11, 20, 21]] == -1.0).all()


# --- Sine and cosine ----------------------------------------------------------------------------------------


@entry_kernel(VECTOR, VECTOR, VECTOR)
def _tabulate(x, sine, cosine):
    for k in range(len(x)):
        sine[k], cosine[k] = sine_and_cosine(x[k])


def tabulated(x):
    sine, cosine = np.empty((2, len(x)))
    _tabulate(x, sine, cosine)
    return sine, cosine


def test_sine_and_cosine_agree_with_the_c_library():
    """To one unit in the last place of 1, also where one of them is nothing but rounding of π."""
    rng = np.random.default_rng(6)
    multiples = np.arange(-4000, 4001) * (0.5 * np.pi)
    x = np.concatenate([s * rng.uniform(-1.0, 1.0, 100_000) for s in (1e-6, 4.0, 1e3, 0.999 * LARGEST)] + [multiples])
    sine, cosine = tabulated(x)
    for found, expected in ((sine, np.sin(x)), (cosine, np.cos(x))):
        assert np.abs(found - expected).max() <= np.spacing(0.5)
        small = np.abs(expected) < 1e-9
        assert small.sum() >= 4000
        np.testing.assert_allclose(found[small], expected[small], rtol=1e-6, atol=0.0)
    assert np.abs(sine**2 + cosine**2 - 1.0).max() <= 2 * np.spacing(1.0)


def test_sine_and_cosine_far_out_and_of_nothing():
    x = np.array([LARGEST, -LARGEST, 1e9, -1e15, 1e300, 0.0, 5e-324])
    sine, cosine = tabulated(x)
    np.testing.assert_allclose(sine, np.sin(x), rtol=0.0, atol=np.spacing(0.5))
    np.testing.assert_allclose(cosine, np.cos(x), rtol=0.0, atol=np.spacing(0.5))
    with np.errstate(invalid="ignore"):
        assert np.isnan(tabulated(np.array([np.nan, np.inf, -np.inf]))).all()
