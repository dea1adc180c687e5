# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parts that judge inputs and watch energies, each by itself: closed forms, decision tables, slow models."""

import math
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

import diag_dynamics as dd
from diag_dynamics import sweeps
from diag_dynamics.assembly.assembler import Options, RobotState
from diag_dynamics.assembly.bounds import Bounds
from diag_dynamics.assembly.efforts import Efforts
from diag_dynamics.assembly.frozen import Frozen
from diag_dynamics.assembly.gaps import Gaps
from diag_dynamics.assembly.odometry import OdometryBase
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.assembly.stamps import PATIENCE, Stamps, stamp_of
from diag_dynamics.assembly.velocities import LONGEST, PERIODS, VelocityEstimator
from diag_dynamics.entries import assignments, by_name
from diag_dynamics.exceptions import InputError
from diag_dynamics.inspection import inspect_robot
from diag_dynamics.model import Payload
from diag_dynamics.nodes.monitor.described import MonitoredRobot, model_status
from diag_dynamics.nodes.monitor.energy_watch import EnergyWatch, numerical_health
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, STALE, WARN, counted
from diag_dynamics.nodes.support.managed import ACTIVE
from diag_dynamics.parameters.monitor import PARAMETERS, Settings, Thresholds, share_thresholds
from diag_dynamics.parameters.robots import model_of
from diag_dynamics.parameters.shared import payload_entry, payloads_of
from diag_dynamics.recordings.balance import Balance, WindowSums
from examples import examples
from nodes import MS, S, joint_state
from robots import TwoLinkArm, description, joint, link

NAN, INF = math.nan, math.inf


# --- estimated velocities


def estimates(times, positions, time, *, turns=False, longest=INF, fastest=INF):
    """Return what is estimated after each position of one joint; times in nanoseconds."""
    estimator = VelocityEstimator([turns])
    here, longest = np.array([0]), np.array([longest])
    return np.array(
        [
            estimator.update(here, np.array([position]), int(stamp), time, longest, fastest)[0]
            for stamp, position in zip(times, positions, strict=True)
        ]
    )


def grid(dt, count):
    """Return stamps [ns] that are dt [s] apart, and their times [s] since the first one."""
    stamps = 100 * S + np.arange(count) * round(dt * S)
    return stamps, (stamps - stamps[0]) * 1e-9


PACES = [(dt, T) for dt in (0.001, 0.01, 0.1) for T in (0.0, 0.002, 0.01, 0.05, 0.3)]


@pytest.mark.parametrize(("dt", "time"), PACES)
def test_constant_velocity_is_exact(dt, time):
    """From the first estimate on, however samples and filter time are."""
    stamps, t = grid(dt, 400)
    estimate = estimates(stamps, 0.3 - 1.7 * t, time)
    known = np.isfinite(estimate)
    assert known.any()
    np.testing.assert_allclose(estimate[known], -1.7, rtol=1e-9)


@pytest.mark.parametrize(("dt", "time"), PACES)
def test_nothing_before_the_filter_time_has_passed(dt, time):
    """The first estimate comes with the first sample that is no sooner than T after the first one, the second at least."""
    stamps, t = grid(dt, 400)
    known = np.isfinite(estimates(stamps, np.sin(t), time))
    first = max(1, math.ceil(round(time * S) / round(dt * S)))
    assert known.tolist() == [k >= first for k in range(400)]


@pytest.mark.parametrize(("dt", "time"), [(dt, T) for dt, T in PACES if T])
def test_delay_of_a_constant_acceleration(dt, time):
    """In the steady state it is seen as it was dt/2 + dt/(exp(dt/T) − 1) ago."""
    stamps, t = grid(dt, 3 + math.ceil(40 * max(time, dt) / dt))
    a, v = 0.8, -0.4
    estimate = estimates(stamps, 0.1 + v * t + 0.5 * a * t**2, time)[-1]
    delay = dt / 2 + dt / math.expm1(dt / time)
    assert t[-1] - (estimate - v) / a == pytest.approx(delay, abs=1e-9)


@pytest.mark.parametrize(("dt", "time", "limit"), [(1e-5, 0.01, 0.01), (1.0, 0.01, 0.5)])
def test_limits_of_the_delay(dt, time, limit):
    """T where samples are dense, dt/2 where they are sparse."""
    stamps, t = grid(dt, 3 + math.ceil(20 * max(time, dt) / dt))
    estimate = estimates(stamps, 0.5 * t**2, time)[-1]
    assert t[-1] - estimate == pytest.approx(limit, rel=1e-3)


@examples(100)
@given(
    st.lists(st.tuples(st.integers(1, 300_000), st.floats(-3, 3)), min_size=2, max_size=40),
    st.sampled_from((0.0, 0.001, 0.02, 0.1, 1.0)),
)
def test_irregular_samples(samples, time):
    """The estimate is the mean of all quotients, weighted by exp(−age/T)·(1 − exp(−dt/T)), summed anew for each sample."""
    stamps = 10 * S + 1000 * np.cumsum([step for step, _ in samples])
    positions = [position for _, position in samples]
    for n, estimate in enumerate(estimates(stamps, positions, time)):
        if n == 0 or stamps[n] - stamps[0] < round(time * S):
            assert math.isnan(estimate)
            continue
        dt = np.diff(stamps[: n + 1]) * 1e-9
        quotients = np.diff(positions[: n + 1]) / dt
        if time:
            ages = (stamps[n] - stamps[1 : n + 1]) * 1e-9
            weights = np.exp(-ages / time) * -np.expm1(-dt / time)
        else:
            weights = np.arange(n) == n - 1
        size = np.abs(quotients).max()
        assert estimate == pytest.approx(weights @ quotients / weights.sum(), rel=1e-9, abs=1e-9 * size)


@pytest.mark.parametrize("dt", [0.0002, 0.001, 0.01])
@pytest.mark.parametrize("time", [0.01, 0.05])
def test_noise_of_an_encoder(dt, time):
    """The error by quantised positions is no more than step/T, where single quotients are wrong by up to step/dt."""
    step = 2.0 * math.pi / 4096
    stamps, t = grid(dt, math.ceil(40 * time / dt))
    true = 0.2 * t + 0.05 * np.sin(3.0 * t)
    quantised = step * np.round(true / step)
    settled = t > 20 * time
    error = (estimates(stamps, quantised, time) - estimates(stamps, true, time))[settled]
    bound = -math.expm1(-dt / time) * step / dt  # of differences of roundings, summed by parts; less than step/T
    assert 0.05 * bound < np.abs(error).max() <= bound * (1 + 1e-9) < step / time
    quotients = (np.diff(quantised) - np.diff(true))[settled[1:]] / dt
    if dt < time / 2:
        assert np.abs(error).std() < 0.5 * quotients.std()


@pytest.mark.parametrize(("count", "weight"), [(51, 1.0 - math.exp(-1.0)), (500, 1.0)], ids=["at first", "settled"])
def test_a_single_step_is_bounded_however_short_the_time(count, weight):
    """Of two positions a microsecond apart: by the step over T and over the weight of all steps, which begins at 1 − 1/e."""
    stamps, _ = grid(0.001, count)
    stamps = np.append(stamps, stamps[-1] + 1000)
    estimate = estimates(stamps, np.append(np.zeros(count), 1e-3), 0.05)
    assert estimate[-2] == 0.0
    assert estimate[-1] == pytest.approx(1e-3 / 0.05 / weight, rel=1e-4)


@pytest.mark.parametrize("velocity", [2.0, -2.0, 25.0])
def test_wrapped_angles(velocity):
    """Of a joint that turns round, whole turns are no motion; of another one they are."""
    stamps, t = grid(0.01, 400)
    wrapped = np.remainder(velocity * t + math.pi, 2.0 * math.pi) - math.pi
    np.testing.assert_allclose(estimates(stamps, wrapped, 0.03, turns=True)[10:], velocity, rtol=1e-9)
    assert np.abs(estimates(stamps, wrapped, 0.03)[10:] - velocity).max() > 50.0


@pytest.mark.parametrize(("beyond", "goes_on"), [(0, True), (1, False)])
@pytest.mark.parametrize(
    ("period", "longest", "gap"),
    [(0.1, 0.5, 0.5), (0.1, 0.0, 0.3), (0.1, 0.2, 0.3), (2.0, 0.5, 6.0)],
    ids=["longest", "no longest", "three periods", "sparse"],
)
def test_gap(period, longest, gap, beyond, goes_on):
    """After more than the longest time, and than three periods, nothing of before counts; exactly as long is no gap."""
    stamps, _ = grid(period, 4)
    stamps = np.append(stamps, stamps[-1] + round(gap * S) + beyond)
    stamps = np.append(stamps, stamps[-1] + round(period * S))
    positions = np.array([0.0, 1.0, 2.0, 3.0, 99.0, 98.0]) * period
    estimate = estimates(stamps, positions, 0.0, longest=longest * S)
    first = 96.0 * period / gap if goes_on else NAN
    np.testing.assert_allclose(estimate, [NAN, 1, 1, 1, first, -1], rtol=1e-9)


def test_first_two_positions():
    """They may be up to ten seconds apart: how often positions come is not known yet."""
    assert LONGEST == 10 * S and PERIODS == 3
    for gap, estimate in ((LONGEST, 0.5), (LONGEST + 1, NAN)):
        stamps = [100 * S, 100 * S + round(gap)]
        np.testing.assert_allclose(estimates(stamps, [0.0, 5.0], 0.0, longest=0.0), [NAN, estimate], rtol=1e-9)


def test_same_stamp_again():
    """Positions of one stamp count as one, and what they differ by with the next stamp: no step is lost or counted twice."""
    stamps, _ = grid(0.1, 5)
    stamps = np.insert(stamps, 3, stamps[2])
    estimate = estimates(stamps, [0.0, 1.0, 2.0, 2.5, 3.0, 4.0], 0.0)
    np.testing.assert_allclose(estimate, [NAN, 10, 10, 10, 10, 10], rtol=1e-9)
    assert np.isnan(estimates([S, S, S], [0.0, 1.0, 2.0], 0.0)).all()


@examples(50)
@given(st.lists(st.tuples(st.integers(0, 3), st.floats(-1, 1)), min_size=2, max_size=30), st.sampled_from((0.0, 0.2)))
def test_repeated_stamps_change_nothing(samples, time):
    """With all but the first position of each stamp left out the estimates are the same."""
    stamps = 10 * S + 100 * MS * np.cumsum([step for step, _ in samples])
    positions = np.array([position for _, position in samples])
    first = np.insert(np.diff(stamps) > 0, 0, True)
    every = estimates(stamps, positions, time)
    np.testing.assert_array_equal(every[first], estimates(stamps[first], positions[first], time))


def test_step_that_no_joint_makes():
    """A quotient beyond the fastest is infinite, and the joint starts anew with the next position, whatever it is."""
    stamps, _ = grid(0.1, 9)
    positions = [0.0, 1.0, 2.0, 3.1, 4.1, 5.1, 6.1, -6.1, 0.0]
    estimate = estimates(stamps, positions, 0.15, fastest=10.5)
    np.testing.assert_allclose(estimate, [NAN, NAN, 10, INF, NAN, NAN, 10, INF, NAN], rtol=1e-9)
    assert np.isfinite(estimates(stamps, positions, 0.15)[2:]).all()


def test_step_that_no_joint_makes_leaves_others_alone():
    """As the message is refused, nothing of it counts for the others either."""
    estimator = VelocityEstimator([False, False])
    stamps, _ = grid(0.1, 4)
    velocities = [
        estimator.update(np.arange(2), np.array(both), int(stamp), 0.0, np.full(2, INF), 100.0)
        for stamp, both in zip(stamps, [(0.0, 0.0), (1.0, 1.0), (5.0, 99.0), (3.0, 1.5)], strict=True)
    ]
    assert velocities[2][1] == INF
    np.testing.assert_allclose(velocities[3], [10.0, NAN], rtol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 3, 10])
@pytest.mark.parametrize(("dt", "time"), [(0.01, 0.0), (0.01, 0.05), (0.1, 0.05)])
def test_many_positions_of_each_stamp(count, dt, time):
    """Of a joint that goes on between them the velocity is the true one: no step is lost, none counts twice."""
    stamps, t = grid(dt, 100)
    within = np.arange(count) / count * dt
    estimate = estimates(np.repeat(stamps, count), 0.3 - 1.7 * (t[:, None] + within).ravel(), time)
    known = np.isfinite(estimate)
    assert known.tolist() == np.repeat(np.isfinite(estimates(stamps, t, time)), count).tolist()
    np.testing.assert_allclose(estimate[known], -1.7, rtol=1e-9)


def test_stamps_that_go_back():
    """They begin anew, as if nothing had come before."""
    stamps, t = grid(0.01, 50)
    stamps = np.concatenate([stamps, stamps - 60 * S])
    estimate = estimates(stamps, np.concatenate([t, 5.0 - 3.0 * t]), 0.1)
    known = np.isfinite(estimate)
    assert known.tolist() == 2 * [k >= 10 for k in range(50)]
    np.testing.assert_allclose(estimate[50:][known[50:]], -3.0, rtol=1e-9)


def test_joints_have_estimates_of_their_own():
    """Those in a message move on, those that are not stay as they are; forgetting is for all."""
    estimator = VelocityEstimator([False] * 3)
    longest = np.full(3, INF)

    def update(stamp, **positions):
        here = np.array([int(name[1:]) for name in positions])
        values = np.array(list(positions.values()))
        return estimator.update(here, values, stamp, 0.0, longest[here]).tolist()

    assert np.isnan(update(10 * S, j0=0.0, j1=0.0, j2=0.0)).all()
    assert update(11 * S, j2=1.0, j0=5.0) == [1.0, 5.0]
    assert update(12 * S, j1=4.0, j2=1.0) == [2.0, 0.0]
    estimator.forget()
    assert np.isnan(update(13 * S, j0=9.0, j1=9.0, j2=9.0)).all()
    assert update(14 * S, j0=10.0, j1=9.0, j2=8.0) == [1.0, 0.0, -1.0]


# --- efforts

JOINTS = ("shoulder", "elbow", "wrist")
FOLLOWERS = ("thumb", "heel")
ALL_JOINTS = np.arange(3)


def efforts(**options):
    """Return the efforts of three joints and two that follow."""
    return Efforts(JOINTS, FOLLOWERS, Options(**options))


def test_efforts_as_they_come():
    """Undeclared, they are N m with gravity, and said to be undeclared; NaN is unknown, and not absurd."""
    undeclared = efforts()
    taken, absurd = undeclared.of(np.array([1.0, -2.0, NAN]), ALL_JOINTS)
    np.testing.assert_array_equal(taken, [1, -2, NAN])
    assert not absurd
    assert undeclared.without_gravity is None
    assert undeclared.undeclared == JOINTS


def test_scale():
    """By joint, wherever it stands in a message; * stands for all others, followers too."""
    scaled = efforts(effort_scale={"elbow": -0.5, "heel": 3.0, "*": 2.0})
    assert scaled.of(np.array([1.0, 10.0, 100.0]), ALL_JOINTS)[0].tolist() == [2, -5, 200]
    assert scaled.of(np.array([1.0, 10.0]), np.array([2, 1]))[0].tolist() == [2, -5]
    assert scaled.of_followers(np.array([1.0, 10.0]), np.arange(2))[0].tolist() == [2, 30]
    only = efforts(effort_scale={"elbow": 4.0})
    assert only.of(np.ones(3), ALL_JOINTS)[0].tolist() == [1, 4, 1]
    assert only.of_followers(np.ones(2), np.arange(2))[0].tolist() == [1, 1]


def test_availability():
    """Efforts that are not to be used are unknown, even infinite ones, which are then not absurd."""
    some = efforts(effort_available={"*": False, "wrist": True, "heel": True}, max_effort=10.0)
    for sent in (1.0, INF, 1e9):
        taken, absurd = some.of(np.array([sent, sent, 1.0]), ALL_JOINTS)
        np.testing.assert_array_equal(taken, [NAN, NAN, 1])
        assert not absurd
    np.testing.assert_array_equal(some.of_followers(np.ones(2), np.arange(2))[0], [NAN, 1])


@pytest.mark.parametrize(
    ("gravity", "mask"),
    [
        ({}, None),
        ({"elbow": True, "*": True}, None),
        ({"elbow": False}, [0, 1, 0]),
        ({"*": False}, [1, 1, 1]),
        ({"*": False, "shoulder": True}, [0, 1, 1]),
        ({"*": True, "wrist": False}, [0, 0, 1]),
    ],
)
def test_gravity_mask(gravity, mask):
    """1 for each joint whose efforts lack gravity; none at all is None."""
    without = efforts(effort_includes_gravity=gravity).without_gravity
    assert (None if without is None else without.tolist()) == mask


@pytest.mark.parametrize(
    ("options", "undeclared"),
    [
        ({"effort_scale": {"*": 1.0}}, JOINTS),
        ({"effort_includes_gravity": {"*": True}}, JOINTS),
        ({"effort_scale": {"*": 1.0}, "effort_includes_gravity": {"*": True}}, ()),
        ({"effort_scale": {"*": 1.0}, "effort_includes_gravity": {"elbow": True}}, ("shoulder", "wrist")),
        ({"effort_available": {"shoulder": False}}, ("elbow", "wrist")),
        ({"effort_available": {"*": False}}, ()),
        ({"effort_available": {"*": True}}, JOINTS),
    ],
)
def test_undeclared(options, undeclared):
    """Joints whose efforts count although scale or gravity is a guess."""
    assert efforts(**options).undeclared == undeclared


@pytest.mark.parametrize("parameter", ["effort_available", "effort_scale", "effort_includes_gravity"])
def test_efforts_of_an_unknown_joint(parameter):
    """The error names parameter and joint."""
    with pytest.raises(InputError, match=f"'{parameter}' names 'knee'"):
        efforts(**{parameter: {"knee": True}})


def test_gravity_of_a_follower():
    """It is its leader's to declare; * does not mean followers."""
    with pytest.raises(InputError, match="'effort_includes_gravity' names 'heel', which follows another joint"):
        efforts(effort_includes_gravity={"heel": False})
    assert efforts(effort_includes_gravity={"*": False}).without_gravity.tolist() == [1, 1, 1]


@pytest.mark.parametrize("most", [0.0, 50.0])
def test_absurd_efforts(most):
    """Beyond the bound, after scaling, and if infinite: unknown; exactly the bound is taken, and 0 is no bound."""
    some = efforts(max_effort=most, effort_scale={"elbow": 10.0, "heel": 10.0})
    for take, count in ((some.of, 3), (some.of_followers, 2)):
        sent = np.array([50.0, -5.0, 50.0])[:count]
        taken, absurd = take(sent, np.arange(count))
        assert taken.tolist() == [50, -50, 50][:count] and not absurd
        taken, absurd = take(np.array([51.0, 5.1, 0.0])[:count], np.arange(count))
        np.testing.assert_array_equal(taken, [NAN, NAN, 0][:count] if most else [51, 51, 0][:count])
        assert absurd == bool(most)
        taken, absurd = take(np.array([-INF, 1.0, 0.0])[:count], np.arange(count))
        np.testing.assert_array_equal(taken, [NAN, 10, 0][:count])
        assert absurd


# --- bounds


def bounds(lower=(-INF, -2.0, -1.0), upper=(INF, 1.0, INF), turns=(False, False, False), **options):
    """Return the bounds of three joints."""
    return Bounds(JOINTS, np.array(lower), np.array(upper), np.array(turns), Options(**options))


NOTHING = np.zeros(3)


@pytest.mark.parametrize(
    ("options", "position", "velocity", "named"),
    [
        ({"max_position": 5.0}, (0, 5.01, 9), NOTHING, ("'elbow'", "position is 5.01,", "-5 … 5", "absurd.position")),
        ({"beyond_limits": 3.0}, (9, 4.1, 9), NOTHING, ("'elbow'", "4.1,", "-5 … 4", "absurd.beyond_limits")),
        ({"beyond_limits": 3.0}, (9, 0, -4.5), NOTHING, ("'wrist'", "-4.5,", "-4 … inf")),
        ({"beyond_limits": 3.0, "max_position": 4.5}, (0, -4.6, 0), NOTHING, ("'elbow'", "-4.6,", "-4.5 … 4")),
        ({"max_velocity": 2.0}, NOTHING, (0, 0, -2.1), ("'wrist'", "velocity is -2.1,", "±2", "absurd.velocity")),
    ],
)
def test_beyond_bounds(options, position, velocity, named):
    """The error names the joint, its value and the bounds."""
    with pytest.raises(RejectedError) as rejection:
        bounds(**options).check(np.array(position, dtype=float), np.array(velocity, dtype=float), ALL_JOINTS)
    assert rejection.value.cause == "absurd value"
    for text in named:
        assert text in str(rejection.value)


@pytest.mark.parametrize(
    ("options", "position", "velocity"),
    [
        ({"max_position": 5.0, "max_velocity": 2.0}, (-5, 5, 5), (2, -2, 2)),  # exactly at them
        ({"beyond_limits": 3.0}, (1e9, 4, 1e9), NOTHING),  # limits that are infinite
        ({"beyond_limits": 3.0}, (-1e9, -5, -4), NOTHING),
        ({}, (1e300, -1e300, 1e300), (1e300, -1e300, 1e300)),  # 0: no bound
        ({"max_position": 5.0, "max_velocity": 2.0, "beyond_limits": 1.0}, (NAN, NAN, NAN), (NAN, NAN, NAN)),
        ({"max_velocity": 2.0}, NOTHING, (INF, -INF, NAN)),  # missing rather than absurd
    ],
)
def test_within_bounds(options, position, velocity):
    """Nothing is said of what is within, nor of NaN."""
    bounds(**options).check(np.array(position, dtype=float), np.array(velocity, dtype=float), ALL_JOINTS)


def test_joints_that_turn_round_have_no_bound_of_position():
    """However often they have turned; that of velocity they have."""
    some = bounds(turns=(True, False, False), max_position=5.0, max_velocity=2.0)
    some.check(np.array([1e9, 5, -5]), np.zeros(3), ALL_JOINTS)
    with pytest.raises(RejectedError, match="'wrist': position"):
        some.check(np.array([1e9, 5, -5.1]), np.zeros(3), ALL_JOINTS)
    with pytest.raises(RejectedError, match="'shoulder': velocity"):
        some.check(np.array([1e9, 0, 0]), np.array([2.1, 0, 0]), ALL_JOINTS)


def test_bounds_of_the_joints_in_a_message():
    """Values are judged by the bounds of their joints, in whatever order they come."""
    some = bounds(beyond_limits=1.0)
    some.check(np.array([-2.0, 2.0]), np.zeros(2), np.array([2, 1]))
    with pytest.raises(RejectedError, match="'wrist'"):
        some.check(np.array([2.0, -2.1]), np.zeros(2), np.array([1, 2]))
    with pytest.raises(RejectedError, match="'elbow': velocity"):
        bounds(max_velocity=1.0).check(np.zeros(2), np.array([0.5, 1.5]), np.array([2, 1]))


# --- stamps

CLOCK = 1000 * S
SPAN = S


def judged(stamps, stamp, now=CLOCK, last=None, source="arm"):
    """Return what becomes of a stamp: "accepted", "anew", or the cause of its rejection."""
    try:
        return "anew" if stamps.judge(source, "joint 'wrist'", stamp, now, last, SPAN) else "accepted"
    except RejectedError as rejection:
        return rejection.cause


@pytest.mark.parametrize(
    ("sec", "nanosec", "expected"),
    [(0, 0, (77, True)), (0, 1, (1, False)), (5, 7, (5 * S + 7, False)), (2**31 - 1, S - 1, (2**31 * S - 1, False))],
)
def test_stamp_of_a_message(sec, nanosec, expected):
    """In nanoseconds; zero stands for the time of reception, and is said to."""
    message = JointState()
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    assert stamp_of(message, 77) == expected


def test_neither_stamp_nor_clock():
    """Before simulated time has begun a message without stamp has no time at all, and is rejected."""
    with pytest.raises(RejectedError, match="use_sim_time") as rejection:
        stamp_of(JointState(), 0)
    assert rejection.value.cause == "no time"


@pytest.mark.parametrize(("sec", "nanosec"), [(-1, 0), (-(2**31), 5), (0, S), (7, 2**32 - 1)])
def test_stamp_that_is_none(sec, nanosec):
    """Rejected with both its numbers."""
    message = JointState()
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    with pytest.raises(RejectedError, match=f"{sec} s and {nanosec} ns") as rejection:
        stamp_of(message, 77)
    assert rejection.value.cause == "malformed stamp"


BY_CLOCK = [
    # before, refuse, distance from the clock [s]; outcome, in step afterwards
    (None, False, 0.0, "accepted", True),
    (None, False, 1.0, "accepted", True),
    (None, False, -1.0, "accepted", True),
    (None, False, 1.1, "accepted", False),
    (None, False, -1.1, "accepted", False),
    (None, True, 1.0, "accepted", True),
    (None, True, 1.1, "foreign time", None),
    (None, True, -1.1, "foreign time", None),
    (False, False, 1.1, "accepted", False),
    (False, False, -1.1, "accepted", False),
    (False, False, 0.9, "accepted", False),  # too near to the bound to be held to it from now on
    (False, False, -0.9, "accepted", False),
    (False, False, 0.5, "accepted", True),
    (False, False, -0.5, "accepted", True),
    (False, True, 1.1, "foreign time", False),
    (False, True, -1.1, "foreign time", False),
    (True, False, 1.0, "accepted", True),
    (True, False, -1.0, "accepted", True),
    (True, False, 1.1, "stamp from the past", True),
    (True, False, -1.1, "stamp from the future", True),
    (True, True, 1.1, "stamp from the past", True),
    (True, True, -1.1, "stamp from the future", True),
]


@pytest.mark.parametrize(("before", "refuse", "distance", "outcome", "after"), BY_CLOCK)
def test_stamps_by_the_clock(before, refuse, distance, outcome, after):
    """All cases: agreeing before or not, foreign stamps refused or not, within max_age or not, on both sides."""
    stamps = Stamps(1.0, refuse)
    stamps.in_step = before
    assert judged(stamps, CLOCK - round(distance * S)) == outcome
    assert stamps.in_step is after
    assert stamps.offset == pytest.approx(distance, abs=1e-9)


@pytest.mark.parametrize("before", [None, False, True])
@pytest.mark.parametrize("refuse", [False, True])
@pytest.mark.parametrize("distance", [0, 500, -500])
def test_without_a_clock_stamps_are_not_judged_by_it(before, refuse, distance):
    """Before it has begun, and of what has no stamp; nothing is learned of whether they agree."""
    stamps = Stamps(1.0, refuse)
    stamps.in_step = before
    assert judged(stamps, CLOCK - distance * S, now=0) == "accepted"
    assert stamps.in_step is before


@pytest.mark.parametrize("refuse", [False, True])
@pytest.mark.parametrize("before", [None, False, True])
def test_no_max_age(refuse, before):
    """Nothing is too old, and that stamps agree, or do not, is not said any longer."""
    stamps = Stamps(0.0, refuse)
    stamps.in_step = before
    assert judged(stamps, CLOCK - 500 * S) == judged(stamps, CLOCK + 500 * S) == "accepted"
    assert stamps.in_step is None


@pytest.mark.parametrize("most", [0.009, 0.3, 0.7, 1.1, 2.3])
def test_exactly_max_age(most):
    """Is allowed, also where the bound in nanoseconds is no whole number in floating point."""
    stamps = Stamps(most)
    stamps.in_step = True
    age = round(most * 1000) * MS
    assert judged(stamps, CLOCK - age) == judged(stamps, CLOCK + age) == "accepted"
    assert judged(stamps, CLOCK - age - 1) == "stamp from the past"
    assert judged(stamps, CLOCK + age + 1) == "stamp from the future"


def out_of_step(stamps, seconds, offset, step=0.5):
    """Return the seconds [s] after which stamps that are apart by an offset are accepted; None: not within so many."""
    for k in range(int(seconds / step)):
        now = CLOCK + round(k * step * S)
        if judged(stamps, now - round(offset * S), now) == "accepted":
            return k * step
    return None


@pytest.mark.parametrize("offset", [5.0, -5.0])
def test_a_clock_that_was_set(offset):
    """Stamps in step that are all apart by the same amount from now on are refused for ten seconds, and then foreign."""
    assert PATIENCE == 10 * S
    stamps = Stamps(1.0)
    assert judged(stamps, CLOCK - S) == "accepted"
    assert out_of_step(stamps, 60, offset) == 10.0
    assert stamps.in_step is False
    assert judged(stamps, CLOCK + 20 * S - round(offset * S), CLOCK + 20 * S) == "accepted"
    assert judged(stamps, CLOCK + 21 * S, CLOCK + 21 * S) == "accepted"
    assert stamps.in_step is True


def test_patience_needs_the_same_offset():
    """Refusals whose offsets differ by more than max_age begin anew each time; by no more they go on."""
    for drift, accepted in ((0.25, None), (0.01, 10.0)):
        stamps = Stamps(1.0)
        judged(stamps, CLOCK)
        outcomes = [judged(stamps, CLOCK + round((k * (1.0 - drift) - 5.0) * S), CLOCK + k * S) for k in range(40)]
        first = next((k for k, outcome in enumerate(outcomes) if outcome == "accepted"), None)
        assert first == accepted


def test_patience_needs_all_stamps():
    """Where some stamps still agree with the clock, it has not been set: the others stay refused."""
    stamps = Stamps(1.0)
    for k in range(100):
        now = CLOCK + k * 500 * MS
        assert judged(stamps, now, now, source="arm") == "accepted"
        assert judged(stamps, now - 5 * S, now, source="gripper") == "stamp from the past"


def test_foreign_stamps_are_refused_however_long():
    """With foreign_time refuse there is no patience, neither at first nor later."""
    stamps = Stamps(1.0, True)
    assert out_of_step(stamps, 60, 5.0) is None
    judged(stamps, CLOCK + 60 * S, CLOCK + 60 * S)
    assert out_of_step(stamps, 60, 5.0) is None


def test_forgotten_stamps():
    """What comes next is the first."""
    stamps = Stamps(1.0)
    judged(stamps, CLOCK)
    assert judged(stamps, CLOCK - 90 * S) == "stamp from the past"
    stamps.forget()
    assert stamps.in_step is None
    assert judged(stamps, CLOCK - 90 * S) == "accepted"
    assert stamps.in_step is False


@pytest.mark.parametrize(
    ("change", "believed"),
    [(S, True), (-S, True), (S + 1, False), (-S - 1, False)],
)
def test_apart_by_the_same_amount(change, believed):
    """Up to max_age more or less than at first, or else it is another amount, whose ten seconds begin then."""
    stamps = Stamps(1.0)
    assert judged(stamps, CLOCK) == "accepted"
    assert judged(stamps, CLOCK - 40 * S) == "stamp from the past"
    now = CLOCK + 10 * S
    assert judged(stamps, now - 40 * S - change, now=now) == ("accepted" if believed else "stamp from the past")
    if not believed:
        now += 10 * S - 1
        assert judged(stamps, now - 40 * S - change, now=now) == "stamp from the past"
        assert judged(stamps, now + 1 - 40 * S - change, now=now + 1) == "accepted"


@pytest.mark.parametrize(
    "between",
    [
        lambda stamps: judged(stamps, CLOCK + 5 * S, now=CLOCK + 5 * S),
        lambda stamps: stamps.forget() or judged(stamps, CLOCK + 5 * S, now=CLOCK + 5 * S),
    ],
    ids=["one in step", "all forgotten"],
)
def test_not_all_apart_from_the_clock(between):
    """One that agrees with the clock, of whatever source, or forgetting: the ten seconds begin anew."""
    stamps = Stamps(1.0)
    assert judged(stamps, CLOCK) == "accepted"
    assert judged(stamps, CLOCK + MS - 40 * S, now=CLOCK + MS) == "stamp from the past"
    assert between(stamps) == "accepted"
    for later, outcome in ((11, "stamp from the past"), (20, "stamp from the past"), (21, "accepted")):
        now = CLOCK + later * S
        assert judged(stamps, now - 40 * S, now=now) == outcome


def test_ten_seconds_of_a_clock_that_goes_back():
    """They are not over because the clock they are measured by was set back, nor do they last longer."""
    stamps = Stamps(1.0)
    assert judged(stamps, CLOCK) == "accepted"
    for since in (CLOCK, CLOCK - 500 * S):
        for later, outcome in ((0, "stamp from the past"), (10 * S - 1, "stamp from the past")):
            assert judged(stamps, since + later - 40 * S, now=since + later) == outcome
    now = CLOCK - 490 * S
    assert judged(stamps, now - 40 * S, now=now) == "accepted"


LAST = CLOCK
PAST = LAST - 100 * S
LATE = [LAST - 900 * MS + k * 125 * MS for k in range(7)]

BY_ORDER = [
    # stamps one after the other, all with the same last one; outcomes
    ([LAST], ["accepted"]),
    ([LAST + 1], ["accepted"]),
    ([LAST - 1], ["late"]),
    ([LAST - SPAN], ["late"]),
    ([LAST - SPAN - 1], ["stamp from the past"]),
    ([PAST, PAST], ["stamp from the past", "anew"]),
    ([PAST, PAST + S], ["stamp from the past", "anew"]),
    ([PAST, PAST + S + 1], ["stamp from the past", "stamp from the past"]),
    ([PAST, PAST - 1], ["stamp from the past", "stamp from the past"]),
    ([PAST, PAST - 1, PAST], ["stamp from the past", "stamp from the past", "anew"]),
    ([PAST, LAST, PAST], ["stamp from the past", "accepted", "stamp from the past"]),
    ([PAST, LAST - 1, PAST], ["stamp from the past", "late", "stamp from the past"]),
    ([PAST, PAST, PAST], ["stamp from the past", "anew", "stamp from the past"]),
    (LATE, ["late"] * 4 + ["anew", "late", "late"]),  # five in a row that span half a second
    ([LATE[0]] * 9 + [LATE[4]], ["late"] * 9 + ["anew"]),
    ([LAST - 900 * MS + k * 200 * MS for k in range(5)], ["late"] * 4 + ["anew"]),  # four are too few
    ([*LATE[:4], *(LAST - 650 * MS + k * 100 * MS for k in range(5))], ["late"] * 9),  # back, so they begin anew
    ([LATE[0] + k for k in range(20)], ["late"] * 20),  # too short a time
    ([*LATE[:4], LAST, *LATE[4:]], ["late"] * 4 + ["accepted"] + ["late"] * 3),
    ([*LATE[:4], LATE[2], *LATE[3:6]], ["late"] * 8),  # back again: they begin anew
    (
        [LAST - 1100 * MS + k * 150 * MS for k in range(5)],  # from the past into what would be late
        ["stamp from the past"] + ["late"] * 3 + ["anew"],
    ),
]


@pytest.mark.parametrize(("sequence", "outcomes"), BY_ORDER)
def test_stamps_by_their_order(sequence, outcomes):
    """Late within the span, unless many in a row are; beyond it the second of two that belong together is believed."""
    stamps = Stamps()
    assert [judged(stamps, stamp, last=LAST) for stamp in sequence] == outcomes


def test_stamps_that_nothing_precedes():
    """They are accepted, and neither suspected nor do they say anything of one that is."""
    stamps = Stamps()
    assert judged(stamps, PAST, last=LAST) == "stamp from the past"
    assert judged(stamps, 5 * S) == "accepted"
    assert judged(stamps, PAST + 1, last=LAST) == "anew"


def test_sources_are_suspected_each_by_itself():
    """What others do neither confirms nor refutes that time has started anew; once it has, it has for all."""
    stamps = Stamps()
    assert judged(stamps, PAST, last=LAST, source="arm") == "stamp from the past"
    assert judged(stamps, PAST, last=LAST, source="gripper") == "stamp from the past"
    assert judged(stamps, LAST + 1, last=LAST, source="camera") == "accepted"
    assert judged(stamps, PAST + 1, last=LAST, source="arm") == "anew"
    assert judged(stamps, PAST + 1, last=LAST, source="gripper") == "stamp from the past"  # of another jump


def test_forgotten_sources():
    """Of another subscription: whether stamps agree with the clock is not known, and nothing is suspected."""
    stamps = Stamps(1.0)
    assert judged(stamps, CLOCK) == "accepted"
    stamps.forget()
    assert stamps.in_step is None
    assert judged(stamps, CLOCK - 40 * S) == "accepted"
    assert stamps.in_step is False
    stamps = Stamps()
    assert judged(stamps, PAST, last=LAST) == "stamp from the past"
    stamps.forget()
    assert judged(stamps, PAST, last=LAST) == "stamp from the past"
    for later in range(4):
        assert judged(stamps, LAST - SPAN + later * 200 * MS, last=LAST) == "late"
    stamps.forget()
    assert judged(stamps, LAST - SPAN + 800 * MS, last=LAST) == "late"


def test_rejected_by_the_clock_is_no_suspect():
    """What is too far from the clock does not begin another time."""
    stamps = Stamps(1.0)
    assert judged(stamps, CLOCK, last=None) == "accepted"
    assert judged(stamps, PAST, last=LAST) == judged(stamps, PAST + 1, last=LAST) == "stamp from the past"
    stamps.max_age = 0.0
    assert judged(stamps, PAST + 2, last=LAST) == "stamp from the past"


def test_words_of_rejections():
    """Whose stamp it is, how far it is from what, and the bound."""
    stamps = Stamps(1.0)
    stamps.in_step = True
    for stamp, words in ((CLOCK - 2 * S, "2.000 s behind"), (CLOCK + 3 * S, "3.000 s ahead of")):
        with pytest.raises(RejectedError, match=f"joint 'wrist': stamp {words} this node's clock.*max_age = 1 s"):
            stamps.judge("arm", "joint 'wrist'", stamp, CLOCK, None, SPAN)
    for stamp in (CLOCK - 500 * MS, CLOCK - 90 * S):
        with pytest.raises(RejectedError, match=f"joint 'wrist': stamp {(CLOCK - stamp) / S:.6f} s older"):
            stamps.judge("arm", "joint 'wrist'", stamp, 0, CLOCK, SPAN)


# --- parameters


@pytest.mark.parametrize(
    ("entries", "kind", "values"),
    [
        ([""], float, {}),
        ([], bool, {}),
        (["a=1", "b=-2.5e-3", "*=0"], float, {"a": 1.0, "b": -0.0025, "*": 0.0}),
        ([" a = 1 ", "", "b c=2"], float, {"a": 1.0, "b c": 2.0}),
        (["a=b=1"], float, {"a=b": 1.0}),
        (["a=true", "b=False", "*=TRUE"], bool, {"a": True, "b": False, "*": True}),
        (["a=1 2 = 3", "b="], str, {"a=1 2": "3", "b": ""}),
    ],
)
def test_assignments(entries, kind, values):
    """Name and value, whatever the spaces; empty entries count for nothing."""
    assert assignments("armature", entries, kind) == values


@pytest.mark.parametrize(
    ("entries", "kind", "named"),
    [
        (["a"], float, ["'a'", "expected name=number"]),
        (["=1"], float, ["'=1'", "expected name=number"]),
        ([" "], float, ["' '", "expected name=number"]),
        (["a="], float, ["'a='", "expected name=number"]),
        (["a=one"], float, ["'a=one'", "expected name=number"]),
        (["a=nan"], float, ["'a=nan'", "expected name=number"]),
        (["a=-inf"], float, ["'a=-inf'", "expected name=number"]),
        (["a=-0.1"], float, ["'a=-0.1'", "no less than 0"]),
        (["a=1", "b=2", "a=1"], float, ["two entries for 'a'"]),
        (["a=1", " a =2"], float, ["two entries for 'a'"]),
        (["a=yes"], bool, ["'a=yes'", "expected name=true or name=false"]),
        (["a=1"], bool, ["'a=1'", "expected name=true or name=false"]),
        (["a"], str, ["'a'", "expected name="]),
        (["=a"], str, ["'=a'", "expected name="]),
    ],
)
def test_bad_assignments(entries, kind, named):
    """The error names parameter and entry, and says what was expected."""
    with pytest.raises(InputError) as error:
        assignments("armature", entries, kind, minimum=0.0 if kind is float else None)
    for text in ("'armature'", *named):
        assert text in str(error.value)


def test_by_name():
    """* stands for all names without an entry of their own; names that are not there are refused."""
    assert by_name("armature", {}, ("a", "b")) == {}
    assert by_name("armature", {"b": 2.0}, ("a", "b")) == {"b": 2.0}
    assert by_name("armature", {"b": 2.0, "*": 1.0}, ("a", "b", "c")) == {"a": 1.0, "b": 2.0, "c": 1.0}
    assert by_name("armature", {"*": 1.0}, ()) == {}
    for entries in ({"knee": 1.0}, {"*": 1.0, "a": 2.0, "knee": 1.0}):
        with pytest.raises(InputError, match="'armature' names 'knee'"):
            by_name("armature", entries, ("a", "b"))


def test_payloads():
    """Mass alone, with its place, or with its inertia: ixx iyy izz ixy ixz iyz."""
    payloads = payloads_of(["tip=2", "", "hand=1.5 0.1 -0.2 0.3", "foot = 1 0 0 0  1 2 3 0.4 0.5 0.6"])
    assert payloads == {
        "tip": Payload(2.0),
        "hand": Payload(1.5, (0.1, -0.2, 0.3)),
        "foot": Payload(1.0, (0.0, 0.0, 0.0), ((1.0, 0.4, 0.5), (0.4, 2.0, 0.6), (0.5, 0.6, 3.0))),
    }


@pytest.mark.parametrize(
    "entry",
    [
        "tip=",
        "tip=a",
        "tip=1 2",
        "tip=1 2 3",
        "tip=1,2,3,4",
        "tip=nan",
        "tip=1 0 0 inf",
        "tip=-1",
        "tip=-0.1 0 0 0",
        "tip=" + "1 " * 11,
    ],
)
def test_bad_payloads(entry):
    """The error names parameter and entry, and says what was expected."""
    with pytest.raises(InputError, match=r"'payloads'.*tip=.*expected.*1, 4 or 10 finite numbers"):
        payloads_of(["hand=1", entry])


@pytest.mark.parametrize("entry", ["tip", "=1"])
def test_payloads_without_link_or_number(entry):
    """They are refused by entry."""
    with pytest.raises(InputError, match=f"'payloads' has '{entry}'"):
        payloads_of([entry])


NUMBER = st.floats(-1e9, 1e9)
"""As large as a parameter may be."""


@examples(100)
@given(st.lists(NUMBER, min_size=10, max_size=10), st.text("abc_/-. 0", min_size=1).map(str.strip).filter(bool))
def test_payloads_round_trip(numbers, name):
    """The entry of a payload says all of it, bit for bit."""
    mass, *com, xx, yy, zz, xy, xz, yz = abs(numbers[0]), *numbers[1:]
    payload = Payload(mass, tuple(com), ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    assert payloads_of([payload_entry(name, payload)]) == {name: payload}
    arrays = Payload(np.float64(mass), np.array(com), np.array(payload.inertia))
    assert payloads_of([payload_entry(name, arrays)]) == {name: payload}


DEFAULTS = {name: spec.default for name, spec in PARAMETERS.items()}


def test_default_settings():
    """All defaults together make sense, and mean what their descriptions say."""
    settings = Settings.of(DEFAULTS)
    assert settings.values == DEFAULTS
    assert settings.inputs == Options(
        timeout=0.5,
        timeouts={},
        mimic_tolerance=0.01,
        max_age=1.0,
        velocity_filter_time=0.01,
        effort_available={},
        effort_scale={},
        effort_includes_gravity={},
        max_position=1e8,
        max_velocity=1e4,
        max_effort=1e6,
        beyond_limits=6.3,
        beyond_velocity=3.0,
        beyond_effort=4.0,
        jump=0.1,
    )
    assert settings.thresholds == Thresholds()


def test_settings_reach_their_options():
    """Each parameter to its own."""
    given = {
        "joint_timeout": 0.25,
        "joint_timeouts": ["elbow=2", "*=0"],
        "mimic_tolerance": 0.125,
        "max_age": 3.0,
        "foreign_time": "refuse",
        "missing_velocity": "estimate",
        "velocity_filter_time": 0.0625,
        "effort_available": ["elbow=false"],
        "effort_scale": ["elbow=-0.5"],
        "effort_includes_gravity": ["*=false"],
        "absurd.position": 11.0,
        "absurd.velocity": 12.0,
        "absurd.effort": 13.0,
        "absurd.beyond_limits": 14.0,
        "absurd.beyond_velocity": 15.0,
        "absurd.beyond_effort": 16.0,
        "absurd.jump": 17.0,
        "warn_energy": 1.0,
        "error_energy": 2.0,
        "warn_energy_share": ["elbow=3"],
        "error_energy_share": ["elbow=4", "*=5"],
    }
    settings = Settings.of(DEFAULTS | given)
    assert settings.inputs == Options(
        0.25,
        {"elbow": 2.0, "*": 0.0},
        0.125,
        3.0,
        True,
        True,
        0.0625,
        {"elbow": False},
        {"elbow": -0.5},
        {"*": False},
        11.0,
        12.0,
        13.0,
        14.0,
        15.0,
        16.0,
        17.0,
    )
    assert settings.thresholds == Thresholds(1.0, 2.0, {"elbow": 3.0}, {"elbow": 4.0, "*": 5.0})


LISTS = [name for name, spec in PARAMETERS.items() if spec.default == [""] and name != "contact.links"]  # names alone
NUMBERS = [name for name, spec in PARAMETERS.items() if isinstance(spec.default, float)]
CHOICES = [name for name, spec in PARAMETERS.items() if spec.choices]

WRONG = [
    *((name, value, "finite") for name in NUMBERS for value in (NAN, INF, -INF)),
    *((name, value, "one of") for name in CHOICES for value in ("", "sometimes")),
    *((name, ["elbow"], "expected name=") for name in LISTS),
    *((name, ["elbow=1 2"], "expected") for name in LISTS),
    *((name, ["elbow=1", "elbow=1"], "two entries for 'elbow'") for name in LISTS if name.startswith(("eff", "p")) < 1),
    ("gravity", [0.0, 0.0], "3 numbers"),
    ("gravity", [], "3 numbers"),
    ("gravity", [0.0, 0.0, NAN], "finite"),
    ("payloads", ["tip=1 2"], "1, 4 or 10"),
    ("joint_timeouts", ["elbow=-1"], "no less than 0"),
    ("warn_energy_share", ["elbow=-1"], "no less than 0"),
    ("error_energy_share", ["*=-1"], "no less than 0"),
    ("effort_available", ["elbow=1"], "name=true or name=false"),
    ("effort_includes_gravity", ["elbow=no"], "name=true or name=false"),
]


@pytest.mark.parametrize(("name", "value", "expected"), WRONG)
def test_wrong_settings(name, value, expected):
    """Refused by parameter, with what was expected."""
    with pytest.raises(InputError) as error:
        Settings.of(DEFAULTS | {name: value})
    assert name in str(error.value)
    assert expected in str(error.value)


@pytest.mark.parametrize(
    "values",
    [
        {"warn_energy": 2.0, "error_energy": 2.0},
        {"warn_energy": 2.0},
        {"error_energy": 2.0},
        {"warn_energy_share": ["elbow=2"], "error_energy_share": ["wrist=1"]},
        {"warn_energy_share": ["*=2"], "error_energy_share": ["*=2", "elbow=3"]},
        {"warn_energy_share": ["*=2", "elbow=1"], "error_energy_share": ["elbow=1"]},
        {"warn_energy_share": ["*=2", "elbow=0"], "error_energy_share": ["elbow=1"]},
        {"warn_energy_share": ["elbow=2"], "error_energy_share": ["*=1", "elbow=0"]},
        {"warn_energy": 5.0, "error_energy_share": ["*=1"]},
    ],
)
def test_thresholds_in_order(values):
    """Error no less than warning, each of them 0 for none: accepted."""
    Settings.of(DEFAULTS | values)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"warn_energy": 2.0, "error_energy": 1.0}, ("warn_energy is 2 J", "error_energy 1 J")),
        ({"warn_energy_share": ["elbow=2"], "error_energy_share": ["elbow=1"]}, ("'elbow' is 2 J", "1 J")),
        ({"warn_energy_share": ["*=2"], "error_energy_share": ["*=1"]}, ("'*' is 2 J", "1 J")),
        ({"warn_energy_share": ["*=2"], "error_energy_share": ["elbow=1"]}, ("'elbow'", "2 J", "1 J")),
        ({"warn_energy_share": ["elbow=2"], "error_energy_share": ["*=1"]}, ("'elbow'", "2 J", "1 J")),
        ({"warn_energy_share": ["*=2"], "error_energy_share": ["*=5", "elbow=1"]}, ("'elbow'", "2 J", "1 J")),
    ],
)
def test_thresholds_out_of_order(values, named):
    """An error before its warning is refused with both numbers; * stands for the joint that has no entry of its own."""
    with pytest.raises(InputError) as error:
        Settings.of(DEFAULTS | values)
    for text in named:
        assert text in str(error.value)


def test_share_thresholds():
    """By joint, infinite where there is none; a joint that is not there is refused by parameter and name."""
    thresholds = Thresholds(0.0, 0.0, {"elbow": 2.0, "*": 1.0}, {"wrist": 3.0, "elbow": 0.0})
    assert share_thresholds(thresholds, JOINTS) == [[1.0, 2.0, 1.0], [INF, INF, 3.0]]
    assert share_thresholds(Thresholds(), JOINTS) == [[INF] * 3] * 2
    for kind in ("warn", "error"):
        with pytest.raises(InputError, match=f"'{kind}_energy_share' names 'knee'"):
            share_thresholds(Thresholds(**{f"{kind}_share": {"knee": 1.0}}), JOINTS)


# --- odometry

TURTLE = description(
    "turtle",
    link("trunk", 4.0, (0.1, 0, 0.05), (0.2, 0, 0, 0.3, 0, 0.4)),
    link("camera"),
    link("arm", 1.0, (0.2, 0, 0), (0.01, 0, 0, 0.02, 0, 0.02)),
    joint("mount", "fixed", "trunk", "camera", xyz=(0.3, 0, 0.2)),
    joint("shoulder", "revolute", "trunk", "arm", xyz=(0, 0.2, 0)),
)


@pytest.fixture(scope="module")
def turtle():
    """Return a robot with a floating base, a camera on it, and one joint."""
    return dd.load_urdf(TURTLE, floating_base=True)


@pytest.fixture
def base(turtle):
    """Return the state of its base, of which nothing is known yet."""
    return OdometryBase(turtle, twist_in_header=False)


def odometry(stamp, position=(1.0, 2.0, 3.0), orientation=(0.0, 0.0, 0.0, 1.0), twist=(0.0,) * 6, child="trunk"):
    """Return a message."""
    message = Odometry(child_frame_id=child)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, S)
    for part, names, values in (
        (message.pose.pose.position, "xyz", position),
        (message.pose.pose.orientation, "xyzw", orientation),
        (message.twist.twist.linear, "xyz", twist[:3]),
        (message.twist.twist.angular, "xyz", twist[3:]),
    ):
        for name, value in zip(names, values, strict=True):
            setattr(part, name, float(value))
    return message


def joints_at(newest, oldest=None, effort=None, unstamped=False):
    """Return the state of the turtle's joint."""
    return RobotState(np.array([0.3]), np.array([0.4]), effort, newest, oldest or newest, unstamped)


def odometry_refused(base, message, cause, *named, now=CLOCK):
    """The message is rejected for this cause, in words that name these things, and leaves no trace."""
    before = (base.stamp, base.position, base.velocity, base._unstamped, base.jumps)
    with pytest.raises(RejectedError) as rejection:
        base.update(message, now)
    assert rejection.value.cause == cause
    for text in ("odom", *named):
        assert text in str(rejection.value)
    for one, other in zip(before, (base.stamp, base.position, base.velocity, base._unstamped, base.jumps), strict=True):
        assert one is other or one == other


def test_base_and_joints(base):
    """Base first, then the joints; no effort acts on the base; the stamps span both."""
    twist = (1, 2, 3, 4, 5, 6)
    base.update(odometry(CLOCK, twist=twist), CLOCK)
    state = base.with_joints(joints_at(CLOCK + 20 * MS, CLOCK - 30 * MS, np.array([7.0])), 0.5)
    assert state.position.tolist() == [1, 2, 3, 0, 0, 0, 1, 0.3]
    assert state.velocity.tolist() == [*twist, 0.4]
    assert state.effort.tolist() == [0] * 6 + [7]
    assert (state.newest, state.oldest) == (CLOCK + 20 * MS, CLOCK - 30 * MS)
    assert not state.stamp_is_receive_time
    assert base.with_joints(joints_at(CLOCK - 20 * MS), 0.5)[3:5] == (CLOCK, CLOCK - 20 * MS)
    assert base.with_joints(joints_at(CLOCK), 0.5).effort is None


def test_flags_of_the_joints_stay(base):
    """That velocities are estimated, and that a stamp is the time of reception, of either of the two."""
    base.update(odometry(CLOCK), CLOCK)
    state = base.with_joints(joints_at(CLOCK, unstamped=True)._replace(velocity_estimated=True), 0.5)
    assert state.stamp_is_receive_time and state.velocity_estimated
    base.forget()
    base.update(odometry(0), CLOCK)
    state = base.with_joints(joints_at(CLOCK), 0.5)
    assert state.stamp_is_receive_time and not state.velocity_estimated
    base.update(odometry(CLOCK), CLOCK)
    assert not base.with_joints(joints_at(CLOCK), 0.5).stamp_is_receive_time


def test_before_the_first_odometry(base):
    """There is no state, nor after all has been forgotten."""
    assert base.with_joints(joints_at(CLOCK), 0.5) is None
    base.update(odometry(CLOCK), CLOCK)
    assert base.with_joints(joints_at(CLOCK), 0.5) is not None
    base.forget()
    assert base.with_joints(joints_at(CLOCK), 0.5) is None
    assert base.with_joints(joints_at(CLOCK), 0.0) is None


def test_states_with_a_base_are_copies(base):
    """A state handed out does not change with what comes later, nor what comes later with it."""
    base.update(odometry(CLOCK), CLOCK)
    state = base.with_joints(joints_at(CLOCK), 0.5)
    state.position[:] = 99.0
    assert base.with_joints(joints_at(CLOCK), 0.5).position.tolist() == [1, 2, 3, 0, 0, 0, 1, 0.3]


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"child": ""}, ("child_frame_id is empty", "'trunk'")),
        ({"child": "nowhere"}, ("'nowhere'",)),
        ({"child": "arm"}, ("'arm'",)),
        ({"position": (NAN, 0, 0)}, ("position", "finite")),
        ({"position": (0, INF, 0)}, ("position", "finite")),
        ({"twist": (0, 0, NAN, 0, 0, 0)}, ("twist", "finite")),
        ({"twist": (0, 0, 0, 0, 0, -INF)}, ("twist", "finite")),
        ({"orientation": (0, 0, 0, NAN)}, ("orientation", "finite")),
        ({"orientation": (0, 0, 0, 0)}, ("quaternion", "length 0")),
        ({"orientation": (0, 0, 0, 1.02)}, ("quaternion", "length 1.02")),
        ({"orientation": (0.7, 0, 0, 0.69)}, ("quaternion", "length 0.983")),
        ({"orientation": (1, 1, 1, 1)}, ("quaternion", "length 2")),
    ],
)
def test_malformed_odometry(base, change, named):
    """A frame that is not on the base, numbers that are none, a quaternion that is no orientation: refused by name."""
    odometry_refused(base, odometry(CLOCK, **change), "malformed", *named)
    base.update(odometry(CLOCK), CLOCK)
    odometry_refused(base, odometry(CLOCK + MS, **change), "malformed", *named)


def test_malformed_stamp_of_odometry(base):
    """It is rejected like that of joint states."""
    message = odometry(CLOCK)
    message.header.stamp.sec = -1
    with pytest.raises(RejectedError) as rejection:
        base.update(message, CLOCK)
    assert rejection.value.cause == "malformed stamp"
    assert base.stamp is None


@pytest.mark.parametrize("length", [0.991, 0.9999, 1.009])
def test_quaternion_is_normalised(base, length):
    """A little too short or too long is rounding, which the state is free of."""
    w, z = math.cos(0.3), math.sin(0.3)
    base.update(odometry(CLOCK, orientation=(0, 0, length * z, length * w)), CLOCK)
    np.testing.assert_allclose(base.position, [1, 2, 3, 0, 0, z, w], atol=1e-12)


def test_slash_before_the_frame(base):
    """Frames of old begin with one."""
    base.update(odometry(CLOCK, child="/trunk"), CLOCK)
    assert base.position[:3].tolist() == [1, 2, 3]


def test_absurd_odometry(base):
    """Positions and twists beyond the bounds of joints: rejected with both; 0 is no bound."""
    base.configure(Options(max_position=100.0, max_velocity=10.0))
    base.update(odometry(CLOCK, (100, -100, 0), twist=(10, 0, 0, 0, -10, 0)), CLOCK)
    odometry_refused(base, odometry(CLOCK + 1, (0, -100.1, 0)), "absurd value", "position", "-100.1", "±100")
    odometry_refused(base, odometry(CLOCK + 1, twist=(0, 0, 10.1, 0, 0, 0)), "absurd value", "twist", "10.1", "±10")
    odometry_refused(base, odometry(CLOCK + 1, twist=(0, 0, 0, 0, 0, -10.1)), "absurd value", "twist")
    base.configure(Options(max_position=0.5))
    base.update(odometry(CLOCK, (0.5, 0, 0)), CLOCK)  # the quaternion is no position
    base.configure(Options())
    base.update(odometry(CLOCK + 1, (1e9, 0, 0), twist=(1e9, 0, 0, 0, 0, 0)), CLOCK)
    assert base.position[0] == base.velocity[0] == 1e9


def test_late_odometry(base):
    """Up to a second older than the last one it has been overtaken; with the same stamp it counts."""
    base.update(odometry(CLOCK), CLOCK)
    odometry_refused(base, odometry(CLOCK - 1), "late")
    odometry_refused(base, odometry(CLOCK - S), "late", "1.000000 s")
    base.update(odometry(CLOCK, (7, 8, 9)), CLOCK)
    assert base.position[:3].tolist() == [7, 8, 9]
    assert base.jumps == 0


def test_time_of_odometry_jumps_back(base):
    """Believed of the second message, as with joint states."""
    base.update(odometry(CLOCK), CLOCK)
    odometry_refused(base, odometry(CLOCK - S - 1), "stamp from the past")
    base.update(odometry(CLOCK + MS), CLOCK)
    odometry_refused(base, odometry(500 * S), "stamp from the past", "500.001000 s")
    base.update(odometry(501 * S, (7, 8, 9)), CLOCK)
    assert (base.jumps, base.stamp, base.position[0]) == (1, 501 * S, 7)
    base.update(odometry(502 * S), CLOCK)
    assert base.jumps == 1


def test_odometry_that_is_always_late(base):
    """Its clock was set back by less than a second: five in a row, growing, over half a second."""
    base.update(odometry(CLOCK), CLOCK)
    for k in range(4):
        odometry_refused(base, odometry(CLOCK - S + k * 150 * MS), "late")
    base.update(odometry(CLOCK - 400 * MS, (7, 8, 9)), CLOCK)
    assert (base.jumps, base.stamp, base.position[0]) == (1, CLOCK - 400 * MS, 7)


def test_odometry_without_stamp_and_clock(base):
    """There is no time that it could be of."""
    with pytest.raises(RejectedError) as rejection:
        base.update(odometry(0), 0)
    assert rejection.value.cause == "no time" and base.stamp is None


def test_odometry_by_the_clock(base):
    """Foreign from the first one on it is accepted or refused; once it was in step, it has to be."""
    base.configure(Options(max_age=1.0))
    base.update(odometry(5 * S), CLOCK)
    assert base.stamps.in_step is False
    base.update(odometry(CLOCK), CLOCK)
    assert base.stamps.in_step is True
    odometry_refused(base, odometry(CLOCK - S - 1), "stamp from the past", "max_age")
    odometry_refused(base, odometry(CLOCK + S + 1), "stamp from the future", "max_age")


def test_odometry_of_another_time_refused(base):
    """By the same cause as joint states."""
    base.configure(Options(max_age=1.0, refuse_foreign=True))
    odometry_refused(base, odometry(5 * S), "foreign time", "max_age")
    base.update(odometry(CLOCK), CLOCK)
    odometry_refused(base, odometry(5 * S), "stamp from the past")


@pytest.mark.parametrize("behind", [1, S, 500 * S])
def test_odometry_that_begins_to_be_stamped(base, behind):
    """Stamps and times of reception may be those of different clocks: neither is late by the other."""
    base.update(odometry(0), CLOCK)
    base.update(odometry(CLOCK - behind, (7, 8, 9)), CLOCK)
    assert (base.stamp, base.position[0], base.jumps) == (CLOCK - behind, 7, 0)
    base.update(odometry(0), CLOCK - behind - MS)
    assert base.stamp == CLOCK - behind - MS


@pytest.mark.parametrize("timeout", [0.1, 0.3, 0.5, 0.7, 1.1])
@pytest.mark.parametrize("sign", [1, -1], ids=["odom behind", "odom ahead"])
def test_stale_odometry(base, timeout, sign):
    """Exactly odom_timeout apart they belong together, older or newer by any more they do not."""
    apart = round(timeout * 10) * 100 * MS
    base.update(odometry(CLOCK), CLOCK)
    assert base.with_joints(joints_at(CLOCK + sign * apart), timeout).position[0] == 1
    with pytest.raises(RejectedError, match=f"odom is {timeout:.3f} s away from the joints") as rejection:
        base.with_joints(joints_at(CLOCK + sign * (apart + 1)), timeout)
    assert rejection.value.cause == "stale odometry"


@pytest.mark.parametrize(("timeout", "apart"), [(5.0, 2), (5.0, 5), (0.0, 2), (0.0, 5000)])
@pytest.mark.parametrize("sign", [1, -1], ids=["odom behind", "odom ahead"])
def test_odometry_within_a_long_timeout(base, timeout, apart, sign):
    """The parameter is the only limit, on both sides; 0 is none."""
    base.update(odometry(10_000 * S), CLOCK)
    state = base.with_joints(joints_at((10_000 + sign * apart) * S), timeout)
    assert state.newest - state.oldest == apart * S


def test_joints_of_another_time(turtle):
    """After the joints' time has started anew the base has to be heard of anew, be there a limit between them or not."""
    given = {"floating_base": True, "odom_timeout": 0.0, "max_age": 0.0}
    robot = MonitoredRobot(TURTLE, turtle, Settings.of(DEFAULTS | given), 1)

    def at(stamp):
        return robot.with_base(robot.assembler.update(joint_state(["shoulder"], [0.3], [0.4], [0.0], stamp), CLOCK))

    robot.base.update(odometry(100 * S), CLOCK)
    assert at(200 * S).oldest == 100 * S
    with pytest.raises(RejectedError, match="older"):
        at(5 * S)
    assert at(5 * S + MS) is None
    robot.base.update(odometry(4 * S), CLOCK)
    assert at(5 * S + 2 * MS)[3:5] == (5 * S + 2 * MS, 4 * S)


# --- states that never came


def gaps_of(stamps, source="arm"):
    """Return how many are lost of these stamps."""
    gaps = Gaps()
    for stamp in stamps:
        gaps.take(source, int(stamp))
    return gaps.lost


@pytest.mark.parametrize("part", [0.0, 0.05, 0.12])
@pytest.mark.parametrize("jitter", [0.0, 0.1])
def test_lost_between_stamps(part, jitter):
    """Whatever part is lost, at any rate, with stamps that jitter by a part of the period."""
    rng = np.random.default_rng(2)
    for period in (1e6, 2e6, 8e6, 1e8 / 3):
        stamps = 1e18 + period * (np.arange(4000) + jitter * rng.uniform(-0.5, 0.5, 4000))
        kept = rng.random(4000) >= part
        kept[0] = True
        places = np.flatnonzero(kept)
        places = places[: 1 + 32 * ((len(places) - 1) // 32)]
        assert gaps_of(stamps[places]) == places[-1] + 1 - len(places)


def test_what_is_no_gap():
    """Irregular senders, pauses, two senders of the same joint, stamps again, and what came, but was not looked at."""
    rng = np.random.default_rng(3)
    assert gaps_of(np.cumsum(rng.exponential(1e7, 500))) == 0
    assert gaps_of(np.cumsum([1e7, 2e9] * 200)) == 0
    assert gaps_of(np.repeat(np.arange(1, 200) * 10 * MS, 3)) == 0
    assert gaps_of(sorted([*(np.arange(200) * 10 * MS), *(np.arange(200) * 10 * MS + 3 * MS)])) == 0
    gaps = Gaps()
    for k in range(1, 400):
        if k % 10:
            gaps.take("arm", k * 10 * MS)
            gaps.take("gripper", k * 25 * MS)
        else:
            gaps.pause()
    assert gaps.lost == 0


# --- frozen values


def watched(states, timeout=0.5, refused=False):
    """Return what is said after each of states (stamp, position, velocity) of two joints."""
    watch, said = Frozen(("shoulder", "elbow"), timeout, refused), []
    for stamp, position, velocity in states:
        state = RobotState(np.array([9.0, *position]), np.array([9.0, *velocity]), None, stamp, stamp, False)
        try:
            watch.judge(stamp, lambda state=state: state)
            said.append(watch.text)
        except RejectedError as rejection:
            assert refused and rejection.cause == "frozen" and str(rejection) == watch.text
            said.append("refused")
    return said


def frozen_at(period, count, position, velocity):
    """Return states of one period, of functions of time."""
    return [(S + k * period, position(1e-9 * k * period), velocity(1e-9 * k * period)) for k in range(count)]


@pytest.mark.parametrize("period", [MS, 8 * MS, 100 * MS, 400 * MS])
def test_frozen(period):
    """A velocity without motion, from the timeout on until it moves; and motion without a velocity."""
    count = 2 * S // period
    said = watched(frozen_at(period, count, lambda t: (0.3, t), lambda t: (0.05, 1.0)))
    first = next(k for k, text in enumerate(said) if text)
    assert 0.5 <= 1e-9 * first * period <= max(0.61, 0.81 * (period == 400 * MS)) and all(said[first:])
    assert (
        said[-1]
        == "frozen values: joint 'shoulder' has a velocity, but no bit of its position changes (frozen_timeout)"
    )
    assert watched(frozen_at(period, count, lambda t: (0.3, t), lambda t: (0.05, 1.0)), refused=True)[-1] == "refused"
    said = watched(frozen_at(period, count, lambda t: (t, t), lambda t: (1.0, 0.0)))
    assert said[-1] == "frozen values: joint 'elbow' moves, but its velocity is 0 (frozen_timeout)" and not said[0]
    moving = [(S + count * period + k * 120 * MS, (3 + k, 3 + k), (1.0, 1.0)) for k in range(1, 9)]
    assert not watched(frozen_at(period, count, lambda t: (0.3, t), lambda t: (0.05, 1.0)) + moving)[-1]


@pytest.mark.parametrize(
    ("position", "velocity"),
    [
        (lambda t: (0.3, 0.3), lambda t: (0.0, 0.0)),  # at rest
        (lambda t: (0.3, 0.3), lambda t: (0.04, -0.04)),  # noise, an offset
        (lambda t: (0.3 + 1e-15 * round(1e3 * t), t), lambda t: (1.0, 1.0)),  # a bit changes
        (lambda t: (0.09 * t, -0.09 * t), lambda t: (0.0, 0.0)),  # creeps
        (lambda t: (round(t / 0.4), t), lambda t: (1.0, 1.0)),  # a coarse encoder
        (lambda t: (0.3, 0.3), lambda t: (float(round(1e3 * t) % 400 < 200), 0.0)),  # stands still now and then
    ],
)
def test_not_frozen(position, velocity):
    """What healthy joints and drivers do; nor what is seldom sent, or not judged."""
    assert not any(watched(frozen_at(8 * MS, 1000, position, velocity)))
    stuck = frozen_at(600 * MS, 20, lambda t: (0.3, t), lambda t: (1.0, 0.0))
    assert not any(watched(stuck)) and not any(watched(frozen_at(8 * MS, 500, lambda t: (0, 0), lambda t: (1, 1)), 0.0))


class Base:
    """The same as OdometryBase, slowly, of messages that are only late, lost or from another time."""

    def __init__(self):
        self.last, self.run = None, []  # the newest, and the older ones that followed it, one after the other
        self.jumps = 0

    def odometry(self, at, x):
        """Return the cause of a rejection, or None."""
        if self.last and at < self.last[0]:
            if self.run and not self.run[-1] <= at <= self.run[-1] + S:
                self.run = []
            self.run.append(at)
            late = self.last[0] - at <= S
            if late and (len(self.run) < 5 or at - self.run[0] < 0.5 * S):
                return "late"
            if not late and len(self.run) < 2:
                return "stamp from the past"
            self.jumps += 1
        self.last, self.run = (at, x), []
        return None

    def joints(self, newest, oldest, timeout):
        """Return x of the base and the stamps, None, or the cause of a rejection."""
        if self.last is None:
            return None
        at, x = self.last
        if timeout and not -timeout * S <= newest - at <= timeout * S:
            return "stale odometry"
        return x, max(newest, at), min(oldest, at)


@st.composite
def arrivals(draw):
    """Draw odometry and states of joints as they arrive: each delayed or lost, by clocks that may jump."""
    now, offset, arrived = 100_000, {"odom": 0, "joints": 0}, []
    for _ in range(draw(st.integers(1, 25))):
        now += draw(st.sampled_from((0, 1, 1, 1, 2, 5, 30)))
        what = draw(st.sampled_from(("odom", "joints")))
        if draw(st.integers(0, 11)) == 0:
            offset[draw(st.sampled_from(("odom", "joints")))] += draw(st.sampled_from((-300, -20, -5, 5, 20)))
        delay = draw(st.sampled_from((0, 0, 0, 1, 2, 4, 12)))
        arrived.append((what, (now + offset[what] - delay) * 100 * MS, draw(st.integers(0, 3)) * 100 * MS))
    return arrived


@examples(200)
@given(arrivals(), st.sampled_from((0.5, 0.2, 0.0, 2.0)))
def test_any_arrivals(turtle, arrived, timeout):
    """Whatever is lost, late or jumps: a state takes the newest odometry, and only within odom_timeout of the joints."""
    base, model = OdometryBase(turtle, twist_in_header=False), Base()
    for x, (what, at, age) in enumerate(arrived):
        try:
            if what == "odom":
                expected = model.odometry(at, x)
                outcome = base.update(odometry(at, (x, 0, 0)), CLOCK)
            else:
                expected = model.joints(at, at - age, timeout)
                state = base.with_joints(joints_at(at, at - age), timeout)
                outcome = state and (state.position[0], state.newest, state.oldest)
        except RejectedError as rejection:
            outcome = rejection.cause
        assert outcome == expected
        assert base.jumps == model.jumps


# --- energies


class FakeModel:
    """Names are all that is asked of a model."""

    joint_names = dof_names = ("shoulder", "elbow")
    nv, has_friction = 2, False


def at_energy(*shares, power=None):
    """Return what stands for an Evaluation with these shares of the kinetic energy, and a power [W]."""
    nu = np.sqrt(2.0 * np.array(shares, dtype=float))
    share = 0.5 * nu * nu
    rows = np.zeros((sweeps.ROWS, len(shares)))
    rows[sweeps.NU] = nu
    return SimpleNamespace(effort_power=power, kinetic_energy=share.sum(), energy_share=share, rows=rows)


def watching(**thresholds):
    """Return a watch on two joints."""
    return EnergyWatch(FakeModel(), Thresholds(**thresholds))


def reported(watch):
    """Return level, message and values of a report."""
    _, level, message, values = watch.report()
    return level, message, dict(values)


@pytest.mark.parametrize(
    ("thresholds", "shares", "level", "named"),
    [
        ({}, (1e9, 0), OK, ["within thresholds"]),
        ({"warn": 3.0, "error": 5.0}, (1, 2), OK, ["within thresholds"]),
        ({"warn": 3.0, "error": 5.0}, (1, 2.1), WARN, ["kinetic energy > warn_energy = 3 J"]),
        ({"warn": 3.0, "error": 5.0}, (3, 2), WARN, ["kinetic energy > warn_energy = 3 J"]),
        ({"warn": 3.0, "error": 5.0}, (3, 2.1), ERROR, ["kinetic energy > error_energy = 5 J"]),
        ({"error": 5.0}, (3, 2), OK, []),
        ({"error": 5.0}, (3, 2.1), ERROR, ["error_energy"]),
        ({"warn": 3.0}, (300, 0), WARN, ["warn_energy"]),
        ({"warn_share": {"elbow": 2.0}}, (9, 2), OK, []),
        ({"warn_share": {"elbow": 2.0}}, (9, 2.5), WARN, ["'elbow' > warn_energy_share = 2 J"]),
        ({"error_share": {"elbow": 2.0}}, (9, 2.5), ERROR, ["'elbow' > error_energy_share = 2 J"]),
        ({"warn_share": {"*": 2.0}, "error_share": {"*": 4.0}}, (1, 3), WARN, ["'elbow' > warn_energy_share"]),
        (
            {"warn_share": {"*": 2.0}, "error_share": {"*": 4.0}},
            (5, 3),
            ERROR,
            ["'shoulder' > error_energy_share"],
        ),
        ({"warn_share": {"*": 2.0, "elbow": 0.0}}, (1, 3), OK, []),
        ({"warn": 1.0, "error_share": {"shoulder": 2.0}}, (3, 0), ERROR, ["'shoulder' > error_energy_share"]),
        ({"error": 1.0, "warn_share": {"shoulder": 2.0}}, (3, 0), ERROR, ["error_energy"]),
    ],
)
def test_thresholds(thresholds, shares, level, named):
    """Of all energy, and of single joints' shares by name; exactly at a threshold is within, and 0 is none.

    The message names what is beyond; how far it is stands in the values, or the message would change with every state.
    """
    watch = watching(**thresholds)
    assert watch.take(CLOCK, at_energy(*shares)) == (level > OK)
    reported_level, message, values = reported(watch)
    assert reported_level == level
    for text in named:
        assert text in message
    assert values["largest kinetic energy [J]"] == f"{sum(shares):.6g}"
    largest = {
        f"largest energy share of '{name}' [J]": f"{share:.6g}"
        for name, share in zip(FakeModel.joint_names, shares, strict=False)
    }
    told = {key: value for key, value in values.items() if key.startswith("largest energy share")}
    assert told.items() <= largest.items()
    assert told or "share" not in message


def test_shares_of_a_floating_base(turtle):
    """The joints' shares come after the base's six."""
    watch = EnergyWatch(turtle, Thresholds(warn_share={"shoulder": 1.0}))
    assert not watch.take(CLOCK, at_energy(9, 9, 9, 9, 9, 9, 0.9))
    assert watch.take(CLOCK + MS, at_energy(0, 0, 0, 0, 0, 0, 1.1))
    _, message, values = reported(watch)
    assert "'shoulder' > warn_energy_share" in message
    assert values["largest energy share of 'shoulder' [J]"] == "1.1"


def test_threshold_of_a_joint_that_is_not_there():
    """It is refused by parameter and name, and what was watched before still is."""
    with pytest.raises(InputError, match="'warn_energy_share' names 'knee'"):
        watching(warn_share={"knee": 1.0})
    watch = watching(warn=1.0)
    watch.take(CLOCK, at_energy(0.5, 0.0, power=0.0))
    with pytest.raises(InputError, match="'error_energy_share' names 'knee'"):
        watch.configure(FakeModel(), Thresholds(error_share={"knee": 1.0}))
    assert watch.take(CLOCK + 100 * MS, at_energy(2.0, 0.0, power=0.0))
    level, _, values = reported(watch)
    assert level == WARN and float(values["power-balance residual [W]"]) == pytest.approx(15.0)


def test_told_only_when_worse_than_reported():
    """A state that is worse than what was last reported is to be told of at once, others at the next report."""
    watch = watching(warn=1.0, error=2.0)
    low, high, highest = at_energy(0.5, 0), at_energy(1.5, 0), at_energy(2.5, 0)
    stamps = iter(range(CLOCK, CLOCK + S, MS))

    def told(s):
        return watch.take(next(stamps), s)

    assert not told(low)
    assert told(high) and told(high) and told(low)  # until it has been told
    assert reported(watch)[0] == WARN
    assert not told(high) and not told(low)
    assert told(highest)
    assert reported(watch)[0] == ERROR
    assert not told(highest) and not told(high)
    assert reported(watch)[0] == ERROR
    assert not told(high)
    assert reported(watch)[0] == WARN
    assert told(highest)
    assert reported(watch)[0] == ERROR
    assert not told(low)
    level, message, _ = reported(watch)
    assert (level, message) == (OK, "within thresholds")
    assert told(high)


def test_largest_since_the_last_report():
    """Of all states between two reports; that of the last one stands beside it."""
    watch = watching()
    for k, energy in enumerate((1.0, 4.0, 2.0)):
        watch.take(CLOCK + k * MS, at_energy(energy, 0))
    values = reported(watch)[2]
    assert values["largest kinetic energy [J]"] == "4" and values["kinetic energy [J]"] == "2"
    watch.take(CLOCK + 3 * MS, at_energy(3.0, 0))
    assert reported(watch)[2]["largest kinetic energy [J]"] == "3"


def test_report_without_states():
    """Nothing is said of energies that nobody knows; what was told of before is not taken back."""
    watch = watching(warn=1.0)
    assert reported(watch) == (STALE, "no state since: within thresholds", {})
    watch.take(CLOCK, at_energy(2.0, 0))
    _, alarm, _ = reported(watch)
    for _ in range(2):
        assert reported(watch) == (STALE, f"no state since: {alarm}", {})
    assert not watch.take(CLOCK + MS, at_energy(2.0, 0))  # has been told
    assert reported(watch)[0] == WARN
    watch.take(CLOCK + 2 * MS, at_energy(0.5, 0))
    assert reported(watch)[:2] == (OK, "within thresholds")
    assert reported(watch)[:2] == (STALE, "no state since: within thresholds")


def residual(watch):
    """Return the power-balance residual of a report [W], None if there is none."""
    value = reported(watch)[2].get("power-balance residual [W]")
    return None if value is None else float(value)


def test_residual_of_given_powers():
    """Change of K less the trapezoid of the powers, per second of what was integrated, from report to report."""
    watch = watching()
    assert residual(watch) is None
    watch.take(CLOCK, at_energy(1.0, 0, power=2.0))
    assert residual(watch) is None
    watch.take(CLOCK + 100 * MS, at_energy(1.5, 0, power=4.0))
    watch.take(CLOCK + 300 * MS, at_energy(1.5, 0.5, power=-2.0))
    assert residual(watch) == pytest.approx((1.0 - 0.3 - 0.2) / 0.3, rel=1e-5)
    assert residual(watch) is None
    watch.take(CLOCK + 400 * MS, at_energy(1.0, 0.5, power=0.0))
    assert residual(watch) == pytest.approx((-0.5 + 0.1) / 0.1, rel=1e-5)


@pytest.mark.parametrize(("gap", "integrated"), [(500 * MS, True), (500 * MS + 1, False), (60 * S, False), (-S, False)])
def test_gaps_are_not_integrated(gap, integrated):
    """Beyond half a second, or back in time, the change of energy is not put down to powers; then it goes on."""
    watch = watching()
    watch.take(CLOCK, at_energy(1.0, 0, power=0.0))
    watch.take(CLOCK + gap, at_energy(3.0, 0, power=0.0))
    assert residual(watch) == (4.0 if integrated else None)
    watch.take(CLOCK + gap + 100 * MS, at_energy(4.0, 0, power=0.0))
    assert residual(watch) == pytest.approx(10.0)


def test_states_without_effort():
    """Their energies count, but between them and others nothing is put down to powers."""
    watch = watching(warn=2.0)
    watch.take(CLOCK, at_energy(1.0, 0, power=0.0))
    watch.take(CLOCK + 100 * MS, at_energy(1.5, 0, power=0.0))
    assert watch.take(CLOCK + 200 * MS, at_energy(9.0, 0))
    level, _, values = reported(watch)
    assert level == WARN and values["largest kinetic energy [J]"] == "9"
    assert "power [W]" not in values and values["power-balance residual [W]"] == "5"
    watch.take(CLOCK + 300 * MS, at_energy(1.0, 0, power=3.0))
    level, _, values = reported(watch)
    assert values["power [W]"] == "3" and "power-balance residual [W]" not in values
    watch.take(CLOCK + 400 * MS, at_energy(2.0, 0, power=3.0))
    assert residual(watch) == pytest.approx(7.0)


def test_forgetting_and_another_model():
    """The next state is the first one: what the model or the robot's place has changed is no motion."""
    watch = watching()
    for k, change in enumerate((watch.forget, lambda: watch.configure(FakeModel(), Thresholds()))):
        begin = CLOCK + k * S
        watch.take(begin, at_energy(1.0, 0, power=0.0))
        change()
        watch.report()
        watch.take(begin + 100 * MS, at_energy(5.0, 0, power=0.0))
        assert residual(watch) is None
        watch.take(begin + 200 * MS, at_energy(6.0, 0, power=0.0))
        assert residual(watch) == pytest.approx(10.0)


def test_of_states_with_one_stamp_the_last_one_counts():
    """A robot that comes in pieces has a state after each; only the last one of a stamp is all of that time."""
    watch = watching()
    for k in range(4):
        stamp = CLOCK + k * 100 * MS
        watch.take(stamp, at_energy(1.0 + k, 77.0, power=5.0))
        watch.take(stamp, at_energy(1.0 + k, 0.0, power=2.0))
    values = reported(watch)[2]
    assert values["kinetic energy [J]"] == "4" and values["power [W]"] == "2"
    assert float(values["power-balance residual [W]"]) == pytest.approx(10.0 - 2.0)


def swinging(model, watch, dt, *, scale=1.0, duration=1.0, damping=(0.0, 0.0), fine=20):
    """Let the arm swing under a constant effort; return exact mean powers [W] of the effort and of the damping.

    The watch sees a state each dt, with efforts that are wrong by a factor; the exact powers are by Simpson's rule over
    steps of dt/20.
    """
    tau, damping = np.array([1.5, -0.8]), np.array(damping)
    simulation = dd.Simulation(model, [0.4, 0.9], [0.5, -1.0], step=dt / fine, damping=damping, limits=False)
    rates = [simulation.qd]
    for k in range(round(duration / dt) + 1):
        if k:
            for _ in range(fine):
                simulation.advance(tau)
                rates.append(simulation.qd)
        watch.take(CLOCK + k * round(dt * S), simulation.evaluate(scale * tau))
    rates = np.array(rates)
    weights = np.ones(len(rates))
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    weights /= weights.sum()
    return weights @ (rates @ tau), weights @ (rates**2 @ damping)


@pytest.fixture(scope="module")
def arm():
    """Return the planar arm, hanging in a field of gravity in its plane."""
    return dd.load_urdf(TwoLinkArm(I1=0.02).urdf, gravity=(1.0, -9.81, 0.0))


STEPS = (0.04, 0.02, 0.01)


def test_balance_without_friction(arm):
    """No residual but that of the trapezoid rule, which falls with the square of the step; the powers are many watts."""
    residuals = []
    for dt in STEPS:
        watch = EnergyWatch(arm, Thresholds())
        swinging(arm, watch, dt)
        residuals.append(abs(residual(watch)))
    assert residuals[-1] < 0.01
    orders = np.log2(np.array(residuals[:-1]) / residuals[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_balance_with_damping(arm):
    """The residual is minus the mean power that damping takes out, up to what the trapezoid rule leaves."""
    errors = []
    for dt in STEPS:
        watch = EnergyWatch(arm, Thresholds())
        _, lost = swinging(arm, watch, dt, damping=(0.3, 0.1))
        assert lost > 0.3
        errors.append(abs(residual(watch) + lost))
    assert errors[-1] < 0.01 * lost
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.1)


@pytest.mark.parametrize("scale", [0.9, 1.25, -1.0])
def test_wrong_effort_scale_shows_up(arm, scale):
    """By what the efforts would have done if they were as they are said to be."""
    watch = EnergyWatch(arm, Thresholds())
    power, _ = swinging(arm, watch, 0.005, scale=scale)
    assert abs(power) > 0.3
    assert residual(watch) == pytest.approx((1.0 - scale) * power, abs=0.01)


def test_balance_does_not_depend_on_when_it_is_reported(arm):
    """Reports in between part the integral and lose nothing of it."""

    class Reporting(EnergyWatch):
        total = 0.0

        def take(self, stamp, s):
            told = super().take(stamp, s)
            if (stamp - CLOCK) % (250 * MS) == 0 and stamp > CLOCK:
                self.total += 0.25 * residual(self)
            return told

    whole, parted = EnergyWatch(arm, Thresholds()), Reporting(arm, Thresholds())
    for watch in (whole, parted):
        swinging(arm, watch, 0.0125, damping=(0.3, 0.1))
    assert parted.total == pytest.approx(residual(whole), rel=1e-4)


# --- the balance of the last minute


SHARE, RMS, WORDS = (
    "explained share of dK/dt (last minute)",
    "power-balance residual, rms (last minute) [W]",
    "balance of power (last minute)",
)


@pytest.fixture(scope="module")
def damped():
    """Return the arm with damping and Coulomb friction."""
    arm = TwoLinkArm(I1=0.02).urdf
    return dd.load_urdf(
        arm.replace("</joint>", '<dynamics damping="0.3" friction="0.2"/></joint>'), gravity=(1.0, -9.81, 0.0)
    )


def told_of(model, moving=None, *, seconds=4.0, friction=True, again=0.0, scale=1.0):
    """Values of a watch by `model` on a motion of `moving`, and those states: stamps, q, q̇, τ.

    The motion is prescribed, and so are the efforts that it takes; `again` is added to the velocities.
    """
    moving, dynamics = dd.DiagonalDynamics(moving or model), dd.DiagonalDynamics(model)
    watch, states = EnergyWatch(model, Thresholds()), []
    for k in range(round(seconds * 500)):
        t = 2e-3 * k
        w, size = np.array([3.0, 5.0]), np.array([0.8, 0.6])
        q, qd, qdd = size * np.sin(w * t), size * w * np.cos(w * t), -size * w * w * np.sin(w * t)
        tau = scale * moving.inverse_dynamics(q, qd, qdd, friction=friction)
        qd = qd + again
        s = dynamics.evaluate(q, qd, tau)
        watch.take(CLOCK + 2 * k * MS, s, s.nu @ s.gravity, qd @ dynamics.friction_torque(qd))
        states.append((CLOCK + 2 * k * MS, q, qd, tau))
        if k % 500 == 499:
            said = reported(watch)
    return said, states


@pytest.mark.parametrize("name", ["arm", "damped"])
def test_the_right_model_explains_its_motion(request, name):
    """With friction, too, where the URDF has it; how poor it is without is seen where the efforts hold none."""
    model = request.getfixturevalue(name)
    (level, _, values), _ = told_of(model)
    assert level == OK
    assert float(values[SHARE]) > 0.99
    assert values[WORDS] == "the efforts explain 100% of the change of kinetic energy"
    if name == "damped":
        assert float(told_of(model, friction=False)[0][2][SHARE]) < float(values[SHARE]) - 0.02


def test_what_the_model_does_not_know_changes_the_words(arm):
    """A payload, and efforts of another unit; the level does not change."""
    (_, _, right), _ = told_of(arm)
    for options in ({"moving": arm.with_payload(arm.link_names[-1], 1.5, (0.3, 0.0, 0.0))}, {"scale": 0.3}):
        (level, message, values), _ = told_of(arm, **options)
        assert (level, message) == (OK, "within thresholds")
        assert float(values[SHARE]) < 0.8 < float(right[SHARE])
        assert float(values[RMS]) > 10.0 * float(right[RMS])
        assert "payload (docs/recordings.md)" in values[WORDS]


@pytest.mark.parametrize("options", [{}, {"scale": 0.7}, {"scale": -1.0}, {"again": 0.2}], ids=str)
def test_the_last_minute_is_what_a_recording_says(damped, options):
    """Share, residual and words are those of the same states in a recording, but for the joints that it names."""
    (_, _, values), states = told_of(damped, **options)
    stamps, q, qd, tau = (np.array(column) for column in zip(*states, strict=True))
    balance, sums = Balance(damped.dof_names), WindowSums(damped.nv, friction=True)
    flags = {"with_effort": np.ones(len(stamps), bool), "moved": np.zeros(len(stamps), bool)}
    batch = dd.DiagonalDynamics(damped).evaluate_batch(q, qd, tau, friction=True)
    balance.take(sums.take(SimpleNamespace(newest=stamps, **flags), batch))
    assert values[SHARE] == f"{balance.explained:.4g}"
    assert values[RMS] == f"{balance.residual_power:.4g}"
    assert balance.judgement().split("; most of")[0] == values[WORDS].split("; most of")[0]
    assert ("wrong sign" in values[WORDS]) == (options == {"scale": -1.0})


@pytest.mark.parametrize("wrong", [0, 1])
@pytest.mark.parametrize("name", ["arm", "damped"])
def test_the_joint_at_which_the_fault_is(request, name, wrong):
    """It is named as a recording names it, from two seconds after the balance has become poor on."""
    model = request.getfixturevalue(name)
    scale = np.where(np.arange(2) == wrong, 0.2, 1.0)
    (level, _, values), states = told_of(model, scale=scale, seconds=8.0)
    stamps, q, qd, tau = (np.array(column) for column in zip(*states, strict=True))
    balance, sums = Balance(model.dof_names), WindowSums(model.nv, friction=True)
    flags = {"with_effort": np.ones(len(stamps), bool), "moved": np.zeros(len(stamps), bool)}
    batch = dd.DiagonalDynamics(model).evaluate_batch(q, qd, tau, friction=True)
    balance.take(sums.take(SimpleNamespace(newest=stamps, **flags), batch))
    assert level == OK and values[WORDS] == balance.judgement()
    assert model.dof_names[wrong] in values[WORDS].split("; most of what is missing is at ")[1]
    (_, _, early), _ = told_of(model, scale=scale, seconds=3.0)
    assert "most of what is missing" not in early[WORDS]


def test_joints_cost_nothing_where_all_is_well(arm):
    watch, dynamics = EnergyWatch(arm, Thresholds()), dd.DiagonalDynamics(arm)
    with mock.patch.object(watch, "_joints", side_effect=AssertionError):
        for k in range(1500):
            t = 2e-3 * k
            q, qd, qdd = (np.array([1.0, 0.5]) * x for x in (np.sin(3 * t), 3 * np.cos(3 * t), -9 * np.sin(3 * t)))
            s = dynamics.evaluate(q, qd, dynamics.inverse_dynamics(q, qd, qdd))
            watch.take(CLOCK + 2 * k * MS, s, s.nu @ s.gravity)
            if k % 500 == 499:
                reported(watch)


@pytest.mark.parametrize("velocity", [5e-3, 0.0])
def test_powers_of_states_that_are_served_at_once(velocity, tmp_path):
    """Gravity's and friction's are those of the library, where messages are served in one pass and where they are not."""
    urdf = TwoLinkArm(I1=0.02).urdf.replace("</joint>", '<dynamics damping="0.3" friction="0.2"/></joint>')
    path = tmp_path / "arm.yaml"
    dd.Parameters(joints={"elbow": dd.JointParameters(effort_offset=0.7)}).save(path)
    values = DEFAULTS | {"gravity": [1.0, -9.81, 0.0], "friction_velocity": velocity, "max_age": 0.0}
    values["parameters_file"] = str(path)
    settings = Settings.of(values)
    robot = MonitoredRobot(urdf, model_of(urdf, values), settings, 1)
    dynamics, names, served = robot.dynamics, robot.assembler.names, []
    for k, qd in enumerate(([0.5, -0.7], [1e-3, 0.0], [-1e-3, 2.0], [0.0, 0.0], [-3.0, -4e-3])):
        q, stamp = np.array([0.3, 0.4]) + 0.01 * k, CLOCK + 10 * k * MS
        raw = serialize_message(joint_state(names, q, qd, [0.1, 0.2], stamp))
        found = robot.serve_at_once(raw, stamp, 0)
        served.append(found)
        if not found:
            robot.evaluate(robot.joint_states.deserialized(raw, stamp) if found is None else robot.pipeline.state)
        s = dynamics.evaluate(q, qd, [0.1, 0.2], friction=True)
        expected = [s.nu @ s.gravity, s.nu @ s.friction]
        powers = robot.pipeline.powers if found else robot.powers(s)
        np.testing.assert_allclose(powers, expected, rtol=1e-12, atol=1e-15)
    assert served.count(True) >= 3 and not all(served)


def test_a_joint_that_moves_next_to_nothing_is_named():
    """By its D and its effort limit, as `inspect` does; no more with its rotor, and neither is one that has a heavy link."""
    limited = TwoLinkArm(I1=0.02).urdf.replace('effort="100" velocity="100"', 'effort="20000" velocity="3"')
    for armature, named in (([""], True), (["shoulder=10.0", "elbow=10.0"], False)):
        values = DEFAULTS | {"armature": armature}
        model = model_of(limited, values)
        if named:
            expected = {f.joints for f in inspect_robot(limited).findings if f.check == "rotor_inertia"}
            assert expected
        robot = MonitoredRobot(limited, model, Settings.of(values), 1)
        assert bool(robot.without_rotors) == named
        assert not named or {name for joints in expected for name in joints} == set(robot.without_rotors)
        status = model_status(robot, ACTIVE, 1, "", None, None)
        assert status.level == OK and status.values["joints without rotor inertia"] == counted(robot.without_rotors)


def feed_minute(watch, seconds, change):
    """States of 100 Hz, whose K changes by the power that is told but for `change`, from the watch's last stamp on."""
    begin = (watch._last or CLOCK - 10 * MS) + 10 * MS
    for k in range(round(seconds * 100)):
        stamp = begin + 10 * k * MS
        t = 1e-9 * (stamp - CLOCK)
        shares = 2.0 - np.cos(3.0 * t), 0.0
        watch.take(stamp, at_energy(*shares, power=change * 3.0 * np.sin(3.0 * t)))


def test_nothing_is_said_too_soon_or_at_rest():
    """Of less than two seconds, of a robot that stands still, and of states that come too seldom."""
    watch = watching()
    feed_minute(watch, 1.9, 1.0)
    assert SHARE not in reported(watch)[2]
    watch = watching()
    for k in range(500):
        watch.take(CLOCK + 10 * k * MS, at_energy(1e-6 * (k % 7), 0.0, power=1e-4))
    assert SHARE not in reported(watch)[2]
    watch = watching()
    for k in range(500):
        watch.take(CLOCK + 101 * k * MS, at_energy(1.0 + k % 7, 0.0, power=1.0))
    assert SHARE not in reported(watch)[2]


def test_only_the_last_minute_counts():
    """What was wrong more than a minute ago is forgotten; so is all with another model; a jump of time ends nothing else."""
    watch = watching()
    feed_minute(watch, 60.0, -1.0)
    assert float(reported(watch)[2][SHARE]) < -2.0
    feed_minute(watch, 30.0, 1.0)
    assert float(reported(watch)[2][SHARE]) < 0.0
    feed_minute(watch, 30.5, 1.0)
    assert float(reported(watch)[2][SHARE]) > 0.99
    watch.take(CLOCK + 300 * S, at_energy(1.0, 0.0))  # without effort: all windows are older than a minute by now
    assert SHARE not in reported(watch)[2]
    feed_minute(watch, 5.0, 1.0)
    last = watch._last
    watch.forget()
    watch.take(last + 10 * MS, at_energy(77.0, 0.0, power=0.0))
    assert float(reported(watch)[2][SHARE]) > 0.99
    watch.configure(FakeModel(), Thresholds())
    watch.take(last + 20 * MS, at_energy(1.0, 0.0, power=0.0))
    assert SHARE not in reported(watch)[2]


# --- numerical health


def test_health_before_any_state():
    """There is nothing to say yet."""
    for arguments in ((None, None), (object(), None)):
        status = numerical_health(*arguments)
        assert (status.level, status.message) == (STALE, "no state")


def test_health_of_a_state(arm):
    """What must hold does; the smallest D is that of its joint."""
    dynamics = dd.DiagonalDynamics(arm)
    state = RobotState(np.array([0.3, 0.4]), np.array([1.0, -2.0]), None, CLOCK, CLOCK, False)
    status = numerical_health(dynamics, state)
    assert status.level == OK
    assert float(status.values["|nu.C| / (|nu| |C|)"]) < 1e-12
    D = dynamics.factors(state.position).D
    assert float(status.values["smallest D [kg m^2, kg]"]) == pytest.approx(D.min(), rel=1e-5)
    assert status.values["its joint"] == arm.dof_names[int(np.argmin(D))]
    at_rest = numerical_health(dynamics, state._replace(velocity=np.zeros(2)))
    assert at_rest.level == OK
