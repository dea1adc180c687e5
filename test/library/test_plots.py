# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots: numbers of what they draw against results of the library, gaps, peaks,
colours and errors.
"""

import sys
from importlib import import_module

import matplotlib as mpl
import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.plot import recordings
from motions import fourier
from robots import description, joint, link

mpl.use("agg")
import matplotlib.pyplot as plt

CUBE = (1.0, (0, 0, 0), (0.1, 0, 0, 0.1, 0, 0.1))
SLIDES = [f"to_{name}" for name in "abcdefgh"]
MODEL = dd.load_urdf(
    description(
        "$slides$",
        link("base"),
        *(link(name, *CUBE) for name in SLIDES),
        *(joint(f"{name}_joint", "prismatic", "base", name) for name in SLIDES),
    )
)
"""Eight masses of 1 kg that slide by themselves: ½ν² is half the square of each velocity."""

PANDA = dd.load_robot("panda")
DYN = dd.DiagonalDynamics(PANDA)
T = np.arange(2500) * 1e-3
Q, QD, _ = fourier(np.random.default_rng(1), T, PANDA.lower, PANDA.upper, base=0.6)


@pytest.fixture(autouse=True)
def _closed():
    plt.close("all")
    yield
    plt.close("all")


def curve(axes, label):
    (line,) = [line for line in axes.lines if line.get_label() == label]
    return np.array(line.get_data())


def sliding(velocity):
    """Return the evaluation of the eight masses at velocities (T, 8)."""
    return dd.DiagonalDynamics(MODEL).evaluate(np.zeros_like(velocity), velocity)


@pytest.mark.parametrize("count", [5, 7])
def test_energy_is_stacked_by_joint(count, monkeypatch):
    """The top of the stack is K, each layer is as thick as the share of its joint; one layer is of
    several others.
    """
    monkeypatch.setattr(recordings, "COLOURS", recordings.COLOURS[:count])
    s = DYN.evaluate(Q[:2000], QD[:2000])
    figure, ax = plt.subplots()
    axes = dd.plot.energy(s, T[:2000] + 7.0, ax=ax)
    assert axes is ax and plt.get_fignums() == [figure.number]
    t, K = curve(axes, "K")
    assert np.allclose(t, T[:2000], atol=1e-12) and np.allclose(K, s.kinetic_energy, rtol=1e-12)
    shares = dict(zip(PANDA.dof_names, s.energy_share.T, strict=True))
    below = np.zeros(len(t))
    others = set(PANDA.dof_names)
    for layer in axes.collections:
        at, top = layer.get_paths()[0].vertices.T
        edge = np.array([top[at == x].max() for x in t[::100]])
        label = layer.get_label()
        chosen = others if label == "others" else {label}
        expected = sum(shares[joint] for joint in chosen)
        assert np.allclose(edge - below[::100], expected[::100], atol=1e-12)
        others = others - chosen
        below = below + expected
    assert not others and axes.get_ylabel() == "kinetic energy [J]"


def test_gaps_have_no_line():
    """Ten seconds without a state are a gap, states that come every two seconds are a line."""
    at, y = curve(dd.plot.energy(DYN.evaluate(Q, QD), np.where(T < 1.0, T, T + 10.0)), "K")
    (gap,) = np.flatnonzero(np.isnan(y))
    assert at[gap - 1] < 1.0 and 10.9 < at[gap + 1] < 11.2
    seldom = dd.plot.energy(DYN.evaluate(Q[:30], QD[:30]), 2.0 * np.arange(30.0))
    assert not np.isnan(curve(seldom, "K")).any()


def test_peaks_are_drawn():
    """The largest of 100 000 values, and the smallest, at its time."""
    velocity = np.full((100_000, 8), 1.0)
    velocity[12345] = 0.5
    velocity[54321] = 2.0
    at, K = curve(dd.plot.energy(sliding(velocity), np.arange(100_000) * 1e-3), "K")
    assert len(K) < 5000
    assert (K.min(), K.max()) == pytest.approx((1.0, 16.0))
    assert (at[K.argmin()], at[K.argmax()]) == pytest.approx((12.345, 54.321))


# --- Style, names and errors


def test_errors_name_the_argument():
    fixed = dd.DiagonalDynamics(dd.load_urdf(description("fixed", link("base"))))
    for draw, key in (
        (lambda: dd.plot.energy([1.0]), "class Evaluation"),
        (lambda: dd.plot.energy(DYN.evaluate(Q[0], QD[0])), "of one state"),
        (
            lambda: dd.plot.energy(DYN.evaluate(Q, QD), t=[0.0, 1.0, 2.0]),
            r"t has shape \(3,\)",
        ),
        (lambda: dd.plot.energy(DYN.evaluate(Q[:0], QD[:0])), "no states"),
        (lambda: dd.plot.energy(fixed.evaluate([[]], [[]])), "no joint that moves"),
    ):
        with pytest.raises(dd.InputError, match=key):
            draw()


def test_matplotlib_is_imported_on_first_use(monkeypatch):
    monkeypatch.setattr(dd, "plot", dd.plot)  # restored, as the modules are
    for name in [name for name in sys.modules if name.startswith("diag_dynamics.plot")]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("matplotlib", "matplotlib.pyplot"):
        monkeypatch.setitem(sys.modules, name, None)
    plot = import_module("diag_dynamics.plot")
    with pytest.raises(dd.InputError, match="pip install matplotlib"):
        plot.energy(DYN.evaluate(Q, QD))
