# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data of plots: the numbers that the library computes, with units and names, and every peak."""

import re
import sys

import matplotlib as mpl
import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.plot.drawing import MOST, envelope
from diag_dynamics.plot.energies import ROWS
from motions import recorded

mpl.use("agg")
import matplotlib.pyplot as plt

PUSH = slice(600, 800)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def panda():
    return dd.load_robot("panda")


@pytest.fixture(scope="module")
def dyn(panda):
    return dd.DiagonalDynamics(panda)


@pytest.fixture(scope="module")
def motion(panda, dyn):
    """Times, positions, rates, efforts and external efforts: a motion with a push at the hand in it."""
    t = np.arange(6000) * 1e-3
    rng = np.random.default_rng(1)
    middle, wide = np.clip(panda.neutral, panda.lower, panda.upper), 0.2 * np.ones(panda.nv)
    middle[3], wide[-1] = -1.5, 0.01
    w, phase = rng.uniform(3.0, 7.0, panda.nv), rng.uniform(0.0, 6.0, panda.nv)
    angle = w * t[:, None] + phase
    q, qd, qdd = middle + wide * np.sin(angle), wide * w * np.cos(angle), -wide * w * w * np.sin(angle)
    q[:, -1] += 0.02
    external = np.zeros_like(q)
    for k in range(*PUSH.indices(len(t))):
        external[k] = dyn.jacobian(q[k], "panda_hand", frame="world")[:3].T @ [0.0, 8.0, 0.0]
    tau = dyn.inverse_dynamics_batch(q, qd, qdd, friction=True) - external
    return t, q, qd, tau, external


@pytest.fixture(scope="module")
def recording(panda, motion):
    t, q, qd, tau, _ = motion
    return recorded(panda, t, q, qd, tau)


def curve(axes, label):
    (line,) = [line for line in axes.lines if line.get_label() == label]
    return np.array(line.get_data())


# --- Energies ---


def test_energy_is_stacked_by_joint(recording, dyn, panda):
    """The top of the stack is K, each layer is as thick as the share of its joint."""
    s = dyn.evaluate_batch(recording.q[:MOST], recording.qd[:MOST])
    axes = dd.plot.energy(s, recording.t[:MOST])
    t, K = curve(axes, "K")
    assert np.array_equal(t, recording.t[:MOST] - recording.t[0]) and np.allclose(K, s.kinetic_energy, rtol=1e-12)
    shares = dict(zip(panda.dof_names, s.energy_share.T, strict=True))
    below, others = np.zeros(len(t)), set(panda.dof_names)
    for layer in axes.collections:
        at, top = layer.get_paths()[0].vertices.T
        edge = np.array([top[at == x].max() for x in t[::100]])
        if "other" in layer.get_label():
            expected = sum(shares[joint] for joint in others)
        else:
            others.remove(layer.get_label())
            expected = shares[layer.get_label()]
        assert np.allclose(edge - below[::100], expected[::100], atol=1e-12)
        below += expected
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "kinetic energy [J]")


def test_gaps_and_peaks(panda, motion):
    """Ten seconds without a state are a gap; the largest value of many is drawn."""
    t, q, qd, tau, _ = motion
    recording = recorded(panda, np.where(t < 3.0, t, t + 10.0), q, qd, tau)
    for at, y in (curve(dd.plot.energy(recording), "K"), dd.plot.balance(recording).axes[1].lines[0].get_data()):
        (gap,) = np.flatnonzero(np.isnan(y))
        assert at[gap - 1] < 3.0 and 12.9 < at[gap + 1] < 13.2
    seldom = recorded(panda, 2.0 * np.arange(30.0), q[:30], qd[:30], None)
    assert not np.isnan(curve(dd.plot.energy(seldom), "K")).any()
    values = np.zeros(50 * MOST)
    values[12345] = -1.0
    drawn, y = envelope(np.arange(len(values)) * 1.0, values)
    assert len(drawn) == 2 * MOST and y.min() == -1.0 and drawn[y.argmin()] == pytest.approx(12345, abs=50)


def test_shares_of_one_state_and_of_many(recording, dyn, panda):
    """A base is one bar; at most ROWS bars are drawn."""
    s = dyn.evaluate(recording.q[700], recording.qd[700])
    axes = dd.plot.shares(s)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx(s.energy_share.tolist())
    assert [label.get_text() for label in axes.get_yticklabels()] == list(panda.dof_names)
    many = dyn.evaluate_batch(recording.q, recording.qd)
    axes = dd.plot.shares(recording)
    assert [bar.get_width() for bar in axes.patches] == pytest.approx(many.energy_share.mean(axis=0).tolist())
    assert np.allclose(curve(axes, "largest")[0], many.energy_share.max(axis=0))
    for robot, floating in (("go2", True), ("talos_full_v2", False)):
        model = dd.load_robot(robot, floating_base=floating)
        s = dd.DiagonalDynamics(model).evaluate(model.neutral, np.linspace(0.1, 1.0, model.nv))
        axes = dd.plot.shares(s)
        assert len(axes.patches) == (model.nv - 5 if floating else ROWS)
        assert sum(bar.get_width() for bar in axes.patches) == pytest.approx(s.kinetic_energy)
        assert not floating or axes.patches[0].get_width() == pytest.approx(s.base_energy)


# --- Power and torque ---


def test_rest_of_the_balance_is_the_power_of_a_push(recording, motion, panda):
    t, _, qd, _, external = motion
    figure = dd.plot.balance(recording)
    both, rest = figure.axes
    at, power = np.array(rest.lines[0].get_data())
    pushing = (external * qd).sum(axis=1)
    expected = np.array([pushing[(t >= x - 0.05 - 1e-9) & (t <= x + 0.05 + 1e-9)].mean() for x in at])
    assert np.abs(expected).max() > 0.05
    assert np.abs(power - expected).max() < 0.02 * np.abs(expected).max() + 2e-3
    difference = curve(both, "dK/dt")[1] - curve(both, "explained by efforts, gravity and friction")[1]
    assert np.allclose(difference, power)
    assert re.search(r"panda: \d+\.\d % of dK/dt explained", both.get_title(loc="left"))
    assert both.get_ylabel() == "power [W]"


def test_external_torque_of_each_joint(recording, dyn, panda, motion):
    thresholds = dd.AlarmThresholds({"panda_joint1": 0.5, "*": 100.0})
    observed = dd.observe(dyn, recording, 40.0)
    part = dd.Observed(*(column[:MOST] for column in observed))
    seen = part.external_torque
    panels = dd.plot.external_torque(part, thresholds, model=panda).axes
    titles = [axes.get_title(loc="left") for axes in panels]
    assert titles == [f"{n} [{'N' if 'finger' in n else 'N m'}]" for n in panda.dof_names]
    for k, axes in enumerate(panels):
        assert np.array_equal(axes.lines[1].get_ydata(), seen[:, k], equal_nan=True)
    beyond = np.array(panels[0].lines[2].get_ydata())
    assert np.array_equal(~np.isnan(beyond), np.abs(seen[:, 0]) > 0.5) and np.isfinite(beyond).any()
    whole = dd.plot.external_torque(recording, {"panda_joint1": 0.5}, gain=40.0).axes
    for k in (0, 1):  # a panel without a threshold has one curve
        curves = np.concatenate([line.get_ydata() for line in whole[k].lines[1:]])
        assert len(whole[k].lines) == 3 - k and np.nanmax(curves) == np.nanmax(observed.external_torque[:, k])


# --- The robot ---


def test_ellipsoid_says_what_a_push_meets(panda, dyn, recording):
    q, qd = recording.q[100], recording.qd[100]
    axes = dd.plot.ellipsoid(panda, q, "panda_hand", qd, point=[0.0, 0.0, 0.1])
    J = dyn.jacobian(q, "panda_hand", [0.0, 0.0, 0.1], frame="world")[:3]
    masses = 1.0 / np.linalg.eigvalsh(J @ np.linalg.solve(dyn.mass_matrix(q), J.T))
    shown = [float(text.get_text().split()[0]) for text in axes.texts if text.get_text().endswith(" kg")]
    assert sorted(shown) == pytest.approx(sorted(masses), rel=5e-3)
    v = J @ qd
    along = 1.0 / (v @ (J @ np.linalg.solve(dyn.mass_matrix(q), J.T)) @ v / (v @ v))
    said = axes.get_title(loc="left")
    assert float(re.search(r"mass along v ([\d.e+-]+) kg", said)[1]) == pytest.approx(along, rel=5e-3)
    assert [axis.get_label_text() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)] == ["x [m]", "y [m]", "z [m]"]


def test_tree_has_every_freedom_with_its_inertia():
    model = dd.load_robot("go2", floating_base=True)
    dyn, q = dd.DiagonalDynamics(model), model.random(3)
    names, bars = dd.plot.tree(model, q).axes
    assert [text.get_text() for text in names.texts] == list(model.dof_names)
    D, M = dyn.factors(q).D, np.diag(dyn.mass_matrix(q))
    ends = {round(bar.get_y() + 0.5 * bar.get_height()): bar.get_x() + bar.get_width() for bar in bars.patches}
    assert [ends[k] for k in range(model.nv)] == pytest.approx(D.tolist())
    shown, rows = curve(bars, "M_kk: outboard joints held")
    assert np.allclose(shown, M) and np.array_equal(rows, np.arange(model.nv))
    # Lines go from a carrier to its children, a level further in where there are several.
    lines = [line for line in names.lines if len(line.get_xdata()) == 3]
    assert len(lines) == model.nv - 1
    for line in lines:
        assert line.get_ydata()[0] < line.get_ydata()[1] and line.get_xdata()[2] - line.get_xdata()[0] in (0, 1)


def test_errors_name_the_argument(recording, panda, dyn, monkeypatch):
    t, q, qd = recording.t, recording.q, recording.qd
    without, empty = (recorded(panda, t[:n], q[:n], qd[:n], None) for n in (100, 0))
    for draw, key in (
        (lambda: dd.plot.energy([1.0]), "expected a Recording"),
        (lambda: dd.plot.energy(dyn.evaluate_batch(q, qd), t=[0.0, 1.0, 2.0]), r"t has shape \(3,\)"),
        (lambda: dd.plot.balance(without), "no efforts"),
        (lambda: dd.plot.shares(empty), "no states"),
        (lambda: dd.plot.external_torque(dd.observe(dyn, recording)), "model"),
        (lambda: dd.plot.external_torque(recording, {"elbow": 1.0}), "'elbow'"),
        (lambda: dd.plot.ellipsoid(panda, panda.neutral, "hand"), "'hand'"),
    ):
        with pytest.raises(dd.InputError, match=key):
            draw()
    for name in ("matplotlib", "matplotlib.pyplot"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(dd.InputError, match="pip install matplotlib"):
        dd.plot.tree(panda)
