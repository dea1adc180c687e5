# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Closed forms of what watches joint states over time: the velocity filter and stuck sensors."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diag_dynamics.joint_states.assembler import StateAssembler
from diag_dynamics.joint_states.robot_joints import Joints, Options
from examples import examples
from joint_state_messages import MS, NAN, S

# --- velocity filter


LONG = 1e6 * S


def accept(assembler, names, stamp, position, velocity=()):
    """Have an assembler judge a joint state stamped `stamp` [ns]."""
    values = [np.array(field, float) for field in (position, velocity, ())]
    return assembler.accept_values(names, *divmod(int(stamp), S), values, 0)


def estimates(times, positions, time, *, turns=False, longest=LONG):
    """Return the estimate after each position of one joint, NaN before there is one; times in
    nanoseconds.
    """
    options = Options({"*": 1e-9 * longest}, estimate_velocity=True, velocity_filter_time=time)
    assembler = StateAssembler(Joints(("joint",), continuous=frozenset(["joint"] * turns)), options)
    result = [
        accept(assembler, ("joint",), *estimate, [NAN])
        for estimate in zip(times, np.reshape(positions, (-1, 1)), strict=True)
    ]
    return np.array(
        [NAN if estimate.state is None else estimate.state.velocity[0] for estimate in result]
    )


def grid(dt, count):
    """Return stamps [ns] that are dt [s] apart, and their times [s] since the first one."""
    stamps = 100 * S + np.arange(count) * round(dt * S)
    return stamps, (stamps - stamps[0]) * 1e-9


@examples(100)
@given(
    st.lists(st.tuples(st.integers(1, 300_000), st.floats(-3e-3, 3e-3)), min_size=2, max_size=40),
    st.sampled_from((0.0, 0.001, 0.02, 0.1, 1.0)),
)
def test_irregular_samples(samples, time):
    """The estimate is the mean of all quotients, weighted by exp(−age/T)·(1 − exp(−dt/T))."""
    stamps = 10 * S + 1000 * np.cumsum([step for step, _ in samples])
    positions = [position for _, position in samples]
    for n, estimate in enumerate(estimates(stamps, positions, time)):
        if n == 0 or stamps[n] - stamps[0] < round(time * S):
            assert math.isnan(estimate)
            continue
        dt = np.diff(stamps[: n + 1]) * 1e-9
        quotients = np.diff(positions[: n + 1]) / dt
        ages = (stamps[n] - stamps[1 : n + 1]) * 1e-9
        weights = np.exp(-ages / time) * -np.expm1(-dt / time) if time else np.arange(n) == n - 1
        size = np.abs(quotients).max()
        assert estimate == pytest.approx(
            weights @ quotients / weights.sum(), rel=1e-9, abs=1e-9 * size
        )


@pytest.mark.parametrize("velocity", [2.0, -2.0, 25.0])
def test_wrapped_angles(velocity):
    """Whole turns of a continuous joint are no motion."""
    stamps, t = grid(0.01, 400)
    wrapped = np.remainder(velocity * t + math.pi, 2.0 * math.pi) - math.pi
    np.testing.assert_allclose(
        estimates(stamps, wrapped, 0.03, turns=True)[10:], velocity, rtol=1e-9
    )


@pytest.mark.parametrize(("beyond", "goes_on"), [(0, True), (1, False)])
@pytest.mark.parametrize(
    ("period", "longest", "gap"),
    [(0.1, 0.5, 0.5), (0.1, 0.0, 0.3), (0.1, 0.2, 0.3), (2.0, 0.5, 6.0)],
    ids=["longest", "no longest", "three periods", "sparse"],
)
def test_pause(period, longest, gap, beyond, goes_on):
    """After more than the longest time and than three periods nothing of before counts."""
    stamps, _ = grid(period, 4)
    stamps = np.append(stamps, stamps[-1] + round(gap * S) + beyond)
    stamps = np.append(stamps, stamps[-1] + round(period * S))
    estimate = estimates(
        stamps, np.array([0.0, 1.0, 2.0, 3.0, 99.0, 98.0]) * period, 0.0, longest=longest * S
    )
    first = 96.0 * period / gap if goes_on else NAN
    np.testing.assert_allclose(estimate, [NAN, 1, 1, 1, first, -1], rtol=1e-9)


@pytest.mark.parametrize(("beyond", "estimate"), [(0, 0.5), (1, NAN)])
def test_first_two_positions(beyond, estimate):
    """They may be ten seconds apart, because the period is not known yet."""
    stamps = [100 * S, 110 * S + beyond]
    np.testing.assert_allclose(
        estimates(stamps, [0.0, 5.0], 0.0, longest=0.0), [NAN, estimate], rtol=1e-9
    )


@pytest.mark.parametrize("count", [1, 2, 3, 10])
@pytest.mark.parametrize(("dt", "time"), [(0.01, 0.0), (0.01, 0.05), (0.1, 0.05)])
def test_many_positions_of_each_stamp(count, dt, time):
    """The velocity is the true one: no step is lost, none counts twice."""
    stamps, t = grid(dt, 100)
    within = np.arange(count) / count * dt
    estimate = estimates(np.repeat(stamps, count), 0.3 - 1.7 * (t[:, None] + within).ravel(), time)
    is_known = np.isfinite(estimate)
    assert is_known.tolist() == np.repeat(np.isfinite(estimates(stamps, t, time)), count).tolist()
    np.testing.assert_allclose(estimate[is_known], -1.7, rtol=1e-9)


# --- stuck sensors


def texts(period, count, position, velocity, timeout=0.5):
    """Return the text after each state of two joints, by functions of time."""
    names = "shoulder", "elbow"
    result = []
    assembler = StateAssembler(Joints(names), Options(stuck_timeout=timeout))
    for k in range(count):
        accept(
            assembler,
            names,
            S + k * period,
            position(1e-9 * k * period),
            velocity(1e-9 * k * period),
        )
        result.append(assembler.stuck_text)
    assert set(assembler.stuck) == set(result) - {""}
    return result


@pytest.mark.parametrize("period", [MS, 8 * MS, 100 * MS, 400 * MS])
@pytest.mark.parametrize(
    ("position", "velocity", "text"),
    [
        (lambda t: (0.3, t), lambda t: (0.05, 1.0), "'shoulder' has a velocity"),
        (lambda t: (t, t), lambda t: (1.0, 0.0), "'elbow' moves, but its velocity is 0"),
    ],
    ids=["velocity without motion", "motion without velocity"],
)
def test_stuck(period, position, velocity, text):
    """It is found once the timeout is over, a state later at most, and then stays."""
    result = texts(period, 2 * S // period, position, velocity)
    first = next(k for k, estimate in enumerate(result) if estimate)
    latest = 1.0 if "moves" in text else 0.61
    assert 0.4 <= 1e-9 * first * period <= max(latest, 1.21 * (period == 400 * MS))
    assert all(text in estimate and "stuck_timeout" in estimate for estimate in result[first:])


@pytest.mark.parametrize(
    ("position", "velocity"),
    [
        (lambda t: (0.3, 0.3), lambda t: (0.0, 0.0)),  # at rest
        (lambda t: (0.3, 0.3), lambda t: (0.04, -0.04)),  # noise, an offset
        (lambda t: (0.3 + 1e-15 * round(1e3 * t), t), lambda t: (1.0, 1.0)),  # a bit changes
        (lambda t: (0.09 * t, -0.09 * t), lambda t: (0.0, 0.0)),  # creeps
        (lambda t: (round(t / 0.4), t), lambda t: (1.0, 1.0)),  # a coarse encoder
        (
            lambda t: (0.3, 0.3),
            lambda t: (float(round(1e3 * t) % 400 < 200), 0.0),
        ),  # stands still now and then
    ],
)
def test_not_stuck(position, velocity):
    """Healthy joints and drivers are not, nor states too far apart, nor any without a timeout."""
    assert not any(texts(8 * MS, 1000, position, velocity))
    assert not any(texts(600 * MS, 20, lambda t: (0.3, t), lambda t: (1.0, 0.0)))
    assert not any(texts(8 * MS, 200, lambda t: (0.3, t), lambda t: (1.0, 0.0), timeout=0.0))
