# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms on external torque, and the calibration of their thresholds."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from described import MS, subject
from diag_dynamics.cli.calibrate import METHODS
from diag_dynamics.cli.main import main
from diag_dynamics.collision import calibration, residuals
from diag_dynamics.collision.calibration import calibrate_residuals
from diag_dynamics.collision.detector import Alarms
from diag_dynamics.collision.residuals import poisson_interval
from diag_dynamics.control.dead_zone import DeadZone
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from motions import recorded

NAMES = ("shoulder", "elbow", "wrist")
PERIOD = 10 * MS
JOINTS = {"shoulder": 10.0, "elbow": 5.0, "wrist": 1.0}
THRESHOLDS = dd.Thresholds({**JOINTS, "total": 12.0, "norm": 20.0}, hold_off=0.5)


def columns(seconds, torque=()):
    """Return stamps, and r and m r that are zero but for (start, end, joint, value)."""
    count = int(seconds * 1e9 / PERIOD)
    stamps = np.arange(count) * PERIOD
    r = np.zeros((count, 3))
    external = np.zeros((count, 3))
    for start, end, joint, value in torque:
        external[between(stamps, start, end), joint] = value
    return stamps, r, external


def between(stamps, start, end):
    return (stamps >= start * 1e9) & (stamps < end * 1e9)


def detect(thresholds, stamps, r, torque, valid=None, restarts=None):
    """Return the alarms, and whether one is on at each state."""
    detector = dd.Detector(NAMES, thresholds)
    valid = np.ones(len(stamps), dtype=bool) if valid is None else valid
    judged = detector.judge(stamps, r, torque, valid, restarts)
    alarms = Alarms(detector)
    alarms.add_states(stamps, np.linalg.norm(r, axis=1), judged)
    return alarms.alarms, judged.alarm


def spans(alarms):
    """Return start and end of alarms [s]."""
    return [(alarm.start / 1e9, alarm.end / 1e9) for alarm in alarms]


# --- Detection


def test_a_joint_above_its_threshold():
    pushes = [(0.5, 0.6, 1, 5.0), (1.0, 1.2, 1, -6.5), (1.1, 1.2, 2, 1.5)]
    stamps, r, torque = columns(3.0, pushes)  # the first one is at the threshold
    ((alarm,), on) = detect(THRESHOLDS, stamps, r, torque)
    assert (alarm.start, alarm.end, alarm.first) == (int(1e9), int(1.19e9), "elbow")
    assert alarm.joints == ("elbow", "wrist")
    assert alarm.exceeded == (("wrist", 1.5, 1.0), ("elbow", 6.5, 5.0))
    assert alarm.describe() == "wrist 1.5 N m or N > 1, elbow 6.5 N m or N > 5"
    assert np.array_equal(on, between(stamps, 1.0, 1.2))


def test_norms_without_a_joint():
    """‖m r‖ above its threshold with no joint above its own: the alarm names the nearest joint."""
    stamps, r, torque = columns(3.0, [(1.0, 1.2, 0, 9.9), (1.0, 1.2, 1, 4.0), (1.0, 1.2, 2, 0.9)])
    (alarm,), _ = detect(dd.Thresholds({**JOINTS, "total": 10.0}), stamps, r, torque)
    assert (alarm.first, alarm.joints, len(alarm.exceeded)) == ("total", ("shoulder",), 1)
    assert alarm.describe() == "|m r| 10.7 N m > 10, most of it at shoulder"
    r[between(stamps, 2.0, 2.1)] = 15.0
    (alarm,), _ = detect(THRESHOLDS, stamps, r, 0.0 * torque)
    assert alarm.first == "norm" and alarm.norm == pytest.approx(15.0 * 3**0.5)


def test_release_and_hold_off():
    """Above 0.7 of a threshold the alarm stays on; a rise within half a second belongs to it, a
    later one does not.
    """
    pushes = [
        (1.0, 1.1, 0, 11.0),
        (1.1, 1.4, 0, 7.5),
        (1.4, 1.5, 0, 6.9),
        (1.89, 1.99, 0, 12.0),
        (3.0, 3.1, 0, 13.0),
    ]
    stamps, r, torque = columns(6.0, pushes)
    alarms, on = detect(THRESHOLDS, stamps, r, torque)
    assert spans(alarms) == [(1.0, 1.98), (3.0, 3.09)]
    assert alarms[0].exceeded[0].value == 12.0
    assert np.array_equal(
        on, between(stamps, 1.0, 1.4) | between(stamps, 1.89, 1.99) | between(stamps, 3.0, 3.1)
    )
    data = columns(
        4.0, [(1.0, 1.2, 0, 11.0), (0.0, 4.0, 1, 4.0)]
    )  # a joint below its own threshold holds no alarm
    assert spans(detect(dd.Thresholds(JOINTS), *data)[0]) == [(1.0, 1.19)]


def test_states_without_a_result():
    """They end an alarm, to which a rise within the hold-off belongs. A restart, stamps that go
    back, and a gap above a second begin another one.
    """
    stamps, r, torque = columns(4.0, [(1.0, 2.0, 0, 11.0)])
    valid = ~between(stamps, 1.4, 1.5)
    torque[~valid] = np.nan
    alarms, on = detect(THRESHOLDS, stamps, r, torque, valid)
    assert spans(alarms) == [(1.0, 1.99)]
    assert np.array_equal(on, between(stamps, 1.0, 2.0) & valid)
    alarms, _ = detect(THRESHOLDS, stamps, r, torque, valid, np.arange(len(stamps)) == 160)
    assert [start for start, _ in spans(alarms)] == [1.0, 1.6]
    stamps[150:] -= int(0.4e9)
    for without in (valid, valid & (np.arange(len(stamps)) != 150)):
        assert len(detect(THRESHOLDS, stamps, r, torque, without)[0]) == 2
    stamps, r, torque = columns(200.0, [(1.0, 1.4, 0, 11.0), (119.0, 119.3, 0, 30.0)])
    judged = between(stamps, 0.0, 1.4) | between(stamps, 119.0, 120.0)
    for valid in (judged, judged[judged]):  # a pause with states that have no result, or with none
        rows = (column if valid is judged else column[judged] for column in (stamps, r, torque))
        assert spans(detect(THRESHOLDS, *rows, valid)[0]) == [(1.0, 1.39), (119.0, 119.29)]


def test_a_standing_torque_ends_its_alarm():
    """A torque of 2.5 times the threshold stands for a minute: the alarm ends after seconds,
    once.
    """
    stamps, r, torque = columns(70.0, [(5.0, 65.0, 1, 12.5)])
    ((start, end),) = spans(detect(THRESHOLDS, stamps, r, torque)[0])
    assert 2.0 < end - start < 5.0
    assert spans(detect(replace(THRESHOLDS, standing=np.inf), stamps, r, torque)[0]) == [
        (5.0, 64.99)
    ]
    after = between(stamps, 5.0, 70.0)
    for time_constant in (1.0, 3.0, 10.0):  # stiction that decays is one alarm
        torque[after, 1] = 12.5 * np.exp(-(1e-9 * stamps[after] - 5.0) / time_constant)
        ((start, end),) = spans(detect(THRESHOLDS, stamps, r, torque)[0])
        assert end - start < 5.0


def test_a_push_upon_a_standing_torque_is_an_alarm():
    """At its full threshold; and so is one after the standing torque."""
    pushes = [
        (5.0, 40.0, 1, 12.5),
        (30.0, 30.2, 1, 18.0),
        (35.0, 35.2, 0, 10.5),
        (50.0, 50.2, 1, 5.5),
    ]
    alarms, _ = detect(THRESHOLDS, *columns(60.0, pushes))
    assert [alarm.start for alarm in alarms] == [int(5e9), int(30e9), int(35e9), int(50e9)]
    assert [alarm.joints for alarm in alarms] == [("elbow",), ("elbow",), ("shoulder",), ("elbow",)]
    stamps, r, torque = columns(60.0, [(5.0, 60.0, 1, 12.5)])
    torque[:, 1] += (
        np.clip(1e-9 * stamps - 20.0, 0.0, 30.0) * 0.2
    )  # and so is a slow rise, each time it has grown
    assert len(detect(THRESHOLDS, stamps, r, torque)[0]) == 4


def test_a_push_within_an_alarm_is_a_further_event():
    """A rise by a whole threshold is one, also at another joint; a smaller rise, and the first one,
    is none. Of a strong push neither its own rise nor that of another joint is.
    """
    pushes = [
        (1.0, 2.5, 0, 11.0),
        (1.2, 1.25, 0, 25.0),  # belongs to the begin
        (1.6, 1.65, 0, 19.0),  # a rise by 8 of 10
        (2.0, 2.1, 0, 22.5),
        (2.3, 2.4, 1, 6.0),
    ]
    stamps, r, torque = columns(4.0, pushes)
    alarms, on = detect(dd.Thresholds(JOINTS), stamps, r, torque)
    assert spans(alarms) == [(1.0, 1.99), (2.0, 2.49)]
    assert np.array_equal(on, between(stamps, 1.0, 2.5))
    torque[between(stamps, 2.3, 2.4), 1] = 0.0
    torque[between(stamps, 2.35, 2.45), 1] = 6.0  # a whole threshold, 0.35 s after the last event
    alarms, _ = detect(dd.Thresholds(JOINTS), stamps, r, torque)
    assert [alarm.joints for alarm in alarms] == [
        ("shoulder",),
        ("shoulder",),
        ("shoulder", "elbow"),
    ]
    push = between(stamps, 1.0, 3.0)
    torque[push, :2] = 200.0 * np.sin(0.5 * np.pi * (1e-9 * stamps[push, None] - 1.0))
    torque[push, 1] *= 0.1
    assert len(detect(dd.Thresholds(JOINTS), stamps, r, torque)[0]) == 1
    ramp = between(stamps, 1.0, 3.9)
    torque[:] = 0.0
    torque[ramp, 0] = 10.5 + 3.0 * (1e-9 * stamps[ramp] - 1.0)  # no jump
    assert len(detect(dd.Thresholds(JOINTS, standing=math.inf), stamps, r, torque)[0]) == 1


def test_limits_of_joints():
    wrong = {"release": 1.5, "hold_off": -1.0, "standing": 0.0, "stiction": -0.1}
    limits = [{name: -1.0} for name in ("elbow", "total", "norm")] + [{"elbow": np.nan}]
    for key, value in (*wrong.items(), *(("limits", limit) for limit in limits)):
        with pytest.raises(InputError, match=next(iter(value)) if key == "limits" else key):
            dd.Thresholds(**{key: value})
    everyone = dd.Detector(NAMES, dd.Thresholds({"*": 2.0, "wrist": np.inf}))
    assert everyone.limits.tolist() == [2.0, 2.0, np.inf, np.inf, np.inf]
    with pytest.raises(InputError, match="knee"):
        dd.Detector(NAMES, dd.Thresholds({"knee": 1.0}))
    with pytest.raises(InputError, match="elbow"):
        everyone.update(0.0, [0, np.nan, 0], [0, 0, 0])


# --- Dead zone


FRICTION, LOAD = np.array([3.0, 0.0, 2.0, 1.0, 0.5, 0.5]), np.array([0.1, 0.2, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def arm():
    """A UR5 with Coulomb friction and load friction of some joints, and an oracle by Pinocchio."""
    model = subject(robots.robot("ur_description/urdf/ur5_robot.urdf")).model
    rows = zip(model.dof_names, FRICTION.tolist(), LOAD.tolist(), strict=True)
    joints = {name: {"friction": f, "load_friction": load} for name, f, load in rows}
    return dd.DiagonalDynamics(model.with_parameters({"joints": joints}))


def stopping(seed=2, count=2000):
    """Return stamps, q, q̇, r and m r of an arm whose joints stop at different times, and sometimes
    all.
    """
    rng = np.random.default_rng(seed)
    stamps = np.cumsum(rng.integers(1, 20, count)) * MS
    moves = np.repeat(rng.random((count // 50, 6)) < 0.4, 50, axis=0)
    moves[:200] = False
    rates = np.where(moves, rng.choice([0.005, 0.3], moves.shape), 0.0045) * rng.choice(
        [-1.0, 1.0], (count, 6)
    )
    q = np.cumsum(0.01 * rates, axis=0)
    torque = 4.0 * rng.normal(size=(count, 6))
    return stamps, q, rates, torque


def test_standing_joints_have_a_dead_zone(arm):
    """Of a fraction of Coulomb and load friction, from 30 ms below 5 mrad/s, by the observer's
    filter; |m r| is lowered to √(|m r|² − zone²), and r follows.
    """
    oracle = subject(robots.robot("ur_description/urdf/ur5_robot.urdf")).oracle
    stamps, q, rates, torque = stopping()
    rates[5:100:10] *= 2.0
    r = arm.epsilon_from_tau(q, torque)
    zone = DeadZone(arm, 0.5, 10.0)
    lowered_r, lowered = zone.lower(stamps, q, rates, r, torque)
    slow = np.zeros(6)
    width = np.zeros(6)
    standing = 0
    largest = np.zeros(6)
    for t, step in enumerate(np.diff(stamps / 1e9, prepend=stamps[0] / 1e9)):
        moves = np.abs(rates[t]) >= 0.005
        if t == 0:
            slow = np.where(moves, 0.0, 0.03)
        slow = np.clip(slow + np.where(moves, -min(4.0 * step, 0.03), step), 0.0, 0.06)
        stands = slow >= 0.03 - 1e-9
        zones = 0.5 * (FRICTION + LOAD * np.abs(oracle.gravity_torque(q[t])))
        width += (1.0 - np.exp(-10.0 * step)) * (zones * stands - width)
        expected = torque[t] * np.sqrt(np.maximum(0.0, 1.0 - (width / torque[t]) ** 2))
        np.testing.assert_allclose(lowered[t], expected, rtol=1e-12, atol=1e-12)
        standing += stands.sum()
        largest = np.maximum(largest, zones * stands)
        if t % 20 == 0:
            m = oracle.factor(q[t])
            np.testing.assert_allclose(m @ lowered_r[t], expected, rtol=1e-8, atol=1e-8)
    assert 4000 < standing < 11000
    np.testing.assert_allclose(zone.largest, largest, rtol=1e-9, atol=1e-9)


def test_a_dead_zone_in_parts(arm):
    """Parts of any size are the whole. Stamps that go back, and a reset, begin anew; unknown
    torques stay so.
    """
    stamps, q, rates, torque = stopping(3, 500)
    torque[100:150, 2] = np.nan
    r = arm.epsilon_from_tau(q, np.nan_to_num(torque))
    r[100:150, :3] = np.nan
    columns_of = stamps, q, rates, r, torque
    whole = DeadZone(arm, 0.7, 25.0).lower(*columns_of)
    zone = DeadZone(arm, 0.7, 25.0)
    parts = []
    for first in range(0, len(stamps), 33):
        parts.append(zone.lower(*(column[first : first + 33] for column in columns_of)))
    for column, of_parts in zip(whole, zip(*parts, strict=True), strict=True):
        np.testing.assert_allclose(np.concatenate(of_parts), column, rtol=1e-12, atol=1e-14)
    assert np.isnan(whole[1][100:150, 2]).all() and np.isnan(whole[0][100:150, :3]).all()
    rates[:] = 0.0
    rates[:, 5] = 0.3
    zone = DeadZone(arm, 0.7, 25.0)
    zone.lower(*columns_of)
    again = zone.lower(*(column[:3] for column in columns_of))[1]
    np.testing.assert_array_equal(again[0], torque[0])
    zone.lower(*columns_of)
    rows = stamps[:3] + stamps[-1], q[:3], rates[:3], r[:3], torque[:3]
    again = zone.lower(*rows, np.array([False, True, False]))[1]
    assert not np.array_equal(again[0], torque[0])
    np.testing.assert_array_equal(again[1], torque[1])
    zone.reset()
    np.testing.assert_array_equal(zone.lower(*rows)[1][0], torque[0])


def test_no_dead_zone_without_friction(arm):
    bare = dd.DiagonalDynamics(dd.load_robot("ur5"))
    stamps, q, rates, torque = stopping(4, 300)
    r = arm.epsilon_from_tau(q, torque)
    for dynamics, fraction in ((bare, 0.5), (arm, 0.0)):
        lowered = DeadZone(dynamics, fraction, 25.0).lower(stamps, q, rates, r, torque)
        assert lowered[0] is r and lowered[1] is torque
    with pytest.raises(InputError, match="fraction"):
        DeadZone(arm, -0.1, 25.0)
    with pytest.raises(InputError, match="gain"):
        DeadZone(arm, 0.1, 0.0)


# --- Calibration


FOUR, HZ = ("a", "b", "c", "d"), 100
R_SPREAD, TORQUE_SPREAD = np.array([1.0, 2.0, 0.3, 0.05]), np.array([3.0, 2.0, 0.6, 0.2])


def noise(rng, seconds, heavy=False, jerks=()):
    """Return stamps, r and m r of coloured noise (autoregressive, 50 ms), normal or with heavy
    tails, and jerks.
    """
    count = int(seconds * HZ)
    keeps = math.exp(-1.0 / (HZ * 0.05))
    new = rng.standard_t(4, (count, 4)) if heavy else rng.normal(size=(count, 4))
    response = math.sqrt(1.0 - keeps**2) * keeps ** np.arange(HZ)
    x = np.stack([np.convolve(column, response)[:count] for column in new.T], axis=1)
    for at in jerks:
        k = int(at * HZ)
        x[k : k + 20] += 25.0
    return np.arange(count) * (10**9 // HZ), x * R_SPREAD, x * TORQUE_SPREAD


def calibrate(stamps, r, torque, rate=1 / 60, part=20_000, recordings=1, factor=True, **options):
    """Return the Calibration of residuals that come in parts, of recordings of equal length."""
    collected = residuals.Residuals(len(FOUR))
    valid = np.ones(len(stamps), dtype=bool)
    for first in range(0, len(stamps), min(part, len(stamps) // recordings)):
        rows = slice(first, first + min(part, len(stamps) // recordings))
        if recordings > 1:
            collected.start_recording()
        collected.add_states(stamps[rows], r[rows], torque[rows], valid[rows])
    with pytest.MonkeyPatch.context() as patch:
        if not factor:
            patch.setattr(calibration, "FACTORS", [1.0])
        return calibrate_residuals(
            collected, FOUR, rate, dd.Thresholds(), gain=25.0, friction=False, **options
        )


@pytest.mark.parametrize(
    ("seconds", "rate", "method", "heavy", "share"),
    [(200, 1 / 60, "tail", True, 0.385), (600, 0.1, "counted", False, 0.84)],
)
def test_the_rate_that_was_asked_for(seconds, rate, method, heavy, share):
    """It is the upper limit of that of unseen noise, which has a share of it on average over eight
    calibrations. The share is the 10 % quantile of Γ(rate · seconds), the number of alarms.
    """
    ratios = []
    inside = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        result = calibrate(*noise(rng, seconds, heavy), rate=rate)
        assert result.method == method and (
            method == "tail" or result.peaks == int(share * rate * result.duration)
        )
        stamps, r, torque = noise(rng, 1000, heavy)
        judged = dd.Detector(FOUR, result).judge(
            stamps, r, torque, np.ones(len(stamps), dtype=bool)
        )
        ratios.append(judged.begins.sum() / (1000 * rate))
        low, high = result.rate_interval
        inside += low <= share * rate <= high
    assert 0.6 < np.mean(ratios) / share < 1.5 and max(ratios) < 1.5 and inside >= 7, ratios
    assert sum(ratio <= 1.0 for ratio in ratios) >= 7


def test_one_jerk_is_one_alarm():
    """A jerk of 25 times the spread moves no threshold by an eighth, and joints have thresholds by
    their own spread.
    """
    with_jerk = calibrate(*noise(np.random.default_rng(2), 200, jerks=[0.37 * 200]), factor=False)
    without = calibrate(*noise(np.random.default_rng(2), 200), factor=False)
    limits, expected = (result.of_names(FOUR).tolist() for result in (with_jerk, without))
    assert limits == pytest.approx(expected, rel=0.12)
    assert with_jerk.alarms == without.alarms + 1 and with_jerk.held_out >= 1
    ratios = [
        without.limits[name] / spread for name, spread in zip(FOUR, TORQUE_SPREAD, strict=True)
    ]
    assert max(ratios) < 1.25 * min(ratios)


def test_each_part_is_held_out():
    """Alarms are those by thresholds from the other parts: of fifths of one recording, or of whole
    recordings.
    """
    columns = noise(np.random.default_rng(5), 200)
    for number, parts in ((1, 5), (4, 4)):
        part = np.arange(20_000) * parts // 20_000
        held_out = 0
        for k in range(parts):
            inside = part == k
            others = calibrate(*(column[~inside] for column in columns), rate=0.1, factor=False)
            rows = (column[inside] for column in columns)
            judged = dd.Detector(FOUR, others).judge(*rows, np.ones(inside.sum(), dtype=bool))
            held_out += judged.begins.sum()
        result = calibrate(*columns, rate=0.1, recordings=number, factor=False)
        assert result.held_out == held_out > 10
        assert result.parts == ("5 parts of the time" if number == 1 else "4 recordings")
        assert result.describe_rate().endswith(
            f": {held_out} alarms in {result.duration:.4g} s, by {result.parts}."
        )
        low, high = (60.0 * entry / result.duration for entry in poisson_interval(result.held_out))
        assert (
            f"{60.0 * result.rate:.3g}/min ({low:.3g}/min to {high:.3g}/min"
            in result.describe_rate()
        )


def test_recordings_that_differ_raise_the_thresholds():
    """Of recordings that are rough by chance, other ones have the requested rate; by counts of the
    same, more than that.
    """
    rates = {True: [], False: []}
    rng = np.random.default_rng(3)

    def recording(seconds):
        return tuple(
            column * (1 if k == 0 else size)
            for size in [np.exp(0.25 * rng.normal())]
            for k, column in enumerate(noise(rng, seconds))
        )

    for _ in range(6):
        some = [
            np.concatenate(column)
            for column in zip(*(recording(60) for _ in range(6)), strict=True)
        ]
        some[0] = np.arange(len(some[0])) * (10**9 // HZ)
        others = [recording(60) for _ in range(20)]
        for factor, result in rates.items():
            thresholds = calibrate(*some, rate=0.05, recordings=6, factor=factor)
            judged = [
                dd.Detector(FOUR, thresholds).judge(*entry, np.ones(6000, dtype=bool))
                for entry in others
            ]
            result.append(sum(entry.begins.sum() for entry in judged) / (20 * 60 * 0.05))
    assert np.mean(rates[True]) < 1.3 < np.mean(rates[False]), rates


def test_warnings_of_the_recording():
    """A short recording cannot show a rate below −ln 0.05 alarms in its time; a rough part exceeds
    other thresholds.
    """
    result = calibrate(*noise(np.random.default_rng(3), 60))
    assert result.demonstrable_rate == pytest.approx(-math.log(0.05) / 59.99, rel=1e-6)
    assert any(
        "too short" in text and "3/min" in text and "180 s" in text for text in result.warnings
    )
    stamps, r, torque = noise(np.random.default_rng(3), 200)
    assert not calibrate(stamps, r, torque).warnings
    torque[12_345, 1] = 10.0 * torque.max()
    assert any("contact: 123." in text for text in calibrate(stamps, r, torque).warnings)
    with pytest.raises(InputError, match="too few"):
        calibrate(*noise(np.random.default_rng(3), 0.5))
    stamps, r, torque = noise(np.random.default_rng(4), 300)
    with pytest.raises(InputError, match="external torque is missing"):
        calibrate(stamps[:1], r[:1], torque[:1])
    r[24_000:] = 1.5 * r[24_000:]
    torque[24_000:] = 1.5 * torque[24_000:]
    result = calibrate(stamps, r, torque)
    assert (
        any("parts of the recordings differ" in text for text in result.warnings)
        and result.held_out > 2 * result.alarms
    )


@pytest.mark.parametrize("max_numbers", [10**6, 20_000])
def test_residuals_in_parts(max_numbers, monkeypatch):
    """Thresholds depend on the states, not on their parts; cells of 20 ms in place of states move
    none by 3 %.
    """
    stamps, r, torque = noise(np.random.default_rng(11), 60)
    stamps[3000:] += 5 * 10**8
    expected = calibrate(stamps, r, torque, part=len(stamps))
    monkeypatch.setattr(residuals, "MAX_NUMBERS", max_numbers)
    whole = calibrate(stamps, r, torque, part=len(stamps))
    assert whole.of_names(FOUR).tolist() == pytest.approx(
        expected.of_names(FOUR).tolist(), rel=0.03
    )
    assert whole.duration == pytest.approx(59.98, abs=0.04)
    assert (whole == expected) == (max_numbers == 10**6)
    for part in (1, 77):
        assert calibrate(stamps, r, torque, part=part) == whole


def test_peaks_before_motions_are_in_the_thresholds():
    """Peaks in the 0.3 s before each motion are alarms by thresholds without them, and at the rate
    by those with them.
    """
    stamps, r, torque = noise(np.random.default_rng(6), 600)
    quiet = calibrate(stamps, r, torque, rate=0.1)
    phase = 1e-9 * stamps % 6.0
    start = (phase > 2.7) & (phase < 3.0)
    for column, spread in ((r, R_SPREAD), (torque, TORQUE_SPREAD)):
        column[start, 1] += 8.0 * spread[1]
    valid = np.ones(len(stamps), dtype=bool)
    rates = []
    for thresholds in (quiet, calibrate(stamps, r, torque, rate=0.1)):
        judged = dd.Detector(FOUR, thresholds).judge(stamps, r, torque, valid)
        rates.append((judged.begins & start).sum() / 600.0)
    assert rates[0] > 0.14 and rates[1] < 0.05


def test_extrapolated_thresholds_are_a_warning():
    """A threshold above 1.5 times the largest value in the recordings is named with its joint."""
    columns = noise(np.random.default_rng(3), 200)
    assert not calibrate(*columns).warnings
    calibration = calibrate(*columns, rate=1e-9)
    (text,) = (text for text in calibration.warnings if text.startswith("extrapolated"))
    name = text.split("'")[1]
    largest = dict(zip(FOUR, np.abs(columns[2]).max(axis=0), strict=True))
    ratios = {name: calibration.limits[name] / largest[name] for name in FOUR}
    if name in FOUR:
        assert f"is {ratios[name]:.3g} times" in text
    assert max(ratios.values()) > 1.5


def test_contact_has_lower_thresholds():
    """Those of its own rate, by default ten times that of false alarms; each with alarms of
    held-out parts.
    """
    stamps, r, torque = noise(np.random.default_rng(3), 300)
    result = calibrate(stamps, r, torque)
    other = calibrate(stamps, r, torque, rate=1 / 6)
    contact = result.contact
    assert contact == replace(
        other, contact=None, covariance=None, names=(), warnings=contact.warnings
    )
    assert contact.requested == pytest.approx(1 / 6) and result.requested == pytest.approx(1 / 60)
    assert (
        contact.of_names(FOUR) < result.of_names(FOUR)
    ).all() and contact.held_out > result.held_out
    assert calibrate(stamps, r, torque, false_contacts=1 / 60).contact.limits == result.limits
    with pytest.raises(InputError, match=r"false_contacts is 0\.01"):
        calibrate(stamps, r, torque, false_contacts=0.01)


def test_the_covariance_is_the_second_moment(monkeypatch):
    """About zero, over states with all torques, also where only maxima of cells are kept."""
    stamps, r, torque = noise(np.random.default_rng(4), 120)
    torque = torque @ np.random.default_rng(5).normal(size=(4, 4)) + [0.0, 3.0, 0.0, -1.0]
    torque[::3, 2] = np.nan
    expected = np.mean([np.outer(x, x) for x in torque if not np.isnan(x[2])], axis=0)
    for max_numbers in (10**6, 10**4):
        monkeypatch.setattr(residuals, "MAX_NUMBERS", max_numbers)
        for part in (77, 20_000):
            result = calibrate(stamps, r, torque, part=part)
            np.testing.assert_allclose(result.covariance, expected, rtol=1e-10, atol=1e-12)
    assert result.names == FOUR and not any("covariance" in text for text in result.warnings)
    torque[:, 2] = np.nan
    assert any(
        "torque of 'c' has no noise" in text for text in calibrate(stamps, r, torque).warnings
    )


def test_poisson():
    """Garwood's limits as tables have them."""
    for count, limits in (
        (0, (0.0, 3.689)),
        (1, (0.0253, 5.572)),
        (10, (4.795, 18.390)),
        (1000, (938.97, 1063.96)),
    ):
        assert poisson_interval(count) == pytest.approx(limits, rel=5e-5, abs=1e-3)


def settings(values):
    """Return the Observation of parameters."""
    return Settings.of(
        {name: spec.default for name, spec in PARAMETERS.items()} | values
    ).observation


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"external_torque.covariance": [1.0, 0.0, 1.0]}, "3 numbers for 2 covariance_joints"),
        ({"external_torque.covariance": [1.0, 0.2, 0.3, 1.0]}, "not symmetric"),
        ({"external_torque.covariance": [1.0, 0.0, 0.0, 0.0]}, "singular at 'b'"),
        ({"external_torque.covariance": [1.0, 2.0, 2.0, 3.0]}, "singular at '[ab]'"),
        ({"external_torque.covariance_joints": ["a", "a"]}, "each joint once"),
        ({"external_torque.covariance_joints": [""]}, "4 numbers for 0"),
        ({"contact.threshold": ["*=1", "a=3"]}, r"contact\.threshold of 'a' is 3; .*at most 2"),
        ({"contact.threshold": ["norm=5"]}, r"contact\.threshold of 'norm' is 5; .*at most 4"),
        ({"contact.threshold": ["total=9"]}, r"contact\.threshold of 'total' is 9; .*at most 8"),
        ({"contact.threshold": ["a=-1"]}, "no less than 0"),
        ({"external_torque.gain": 0.0, "collision.threshold": [""]}, "gain"),
    ],
)
def test_parameters_of_noise_and_contact(values, key):
    """Wrong ones are named, with the joint; right ones are the Observation's."""
    right = {
        "external_torque.gain": 25.0,
        "collision.threshold": ["*=2", "norm=4", "total=8"],
        "contact.threshold": ["a=1"],
    }
    right |= {
        "external_torque.covariance_joints": ["a", "b"],
        "external_torque.covariance": [1.0, 0.5, 0.5, 2.0],
    }
    seen = settings(right)
    assert seen.covariance_of(["b", "a"]).tolist() == [[2.0, 0.5], [0.5, 1.0]]
    assert seen.contact.of_names(["a", "b"]).tolist() == [1.0, math.inf, math.inf, math.inf]
    with pytest.raises(InputError, match=key):
        settings(right | values)


def test_the_file_is_the_monitors(tmp_path):
    """The monitor reads the file: thresholds no lower than the calibration's, and the covariance in
    any order of joints.

    A joint without residuals has no threshold, and then the file has no covariance.
    """
    stamps, r, torque = noise(np.random.default_rng(7), 60)
    result = calibrate(stamps, r, torque)
    result.save(tmp_path / "all.yaml")
    seen = settings(parameters_of([tmp_path / "all.yaml"]))
    for k in ([0, 1, 2, 3], [2, 0, 3]):
        names = [FOUR[entry] for entry in k]
        np.testing.assert_allclose(
            seen.covariance_of(names), result.covariance[np.ix_(k, k)], rtol=1e-9
        )
    lower = seen.contact.of_names(FOUR)
    assert (lower >= result.contact.of_names(FOUR) * (1 - 1e-9)).all() and (
        lower < seen.collision.of_names(FOUR)
    ).all()
    with pytest.raises(InputError, match="covariance_joints lacks 'e'"):
        seen.covariance_of(["a", "e"])
    torque[:, 2] = 0.0
    result = calibrate(stamps, r, torque)
    assert set(result.limits) == {"a", "b", "d", "total", "norm"}
    assert any("external torque of 'c' has no noise" in text for text in result.warnings)
    for rate in (0.0, math.nan):
        with pytest.raises(InputError, match="false_alarms"):
            calibrate(stamps, r, torque, rate=rate)
    result.save(tmp_path / "alarms.yaml")
    seen = settings(parameters_of([tmp_path / "alarms.yaml"]))
    assert seen.covariance_of(FOUR) is None
    limits = seen.collision.of_names(FOUR)
    least = result.of_names(FOUR)
    assert (
        limits.tolist() == pytest.approx(least.tolist(), rel=1e-3)
        and (limits >= least * (1 - 1e-9)).all()
    )
    with pytest.raises(InputError, match="nowhere"):
        result.save(tmp_path / "nowhere" / "alarms.yaml")


# --- Recordings


@pytest.fixture(scope="module")
def ur5():
    return dd.load_robot("ur5")


@pytest.fixture(scope="module")
def tables(ur5, tmp_path_factory):
    """Half a minute of a UR5 with noise on efforts and rates; and the same with a push of 12 N m at
    the elbow at 20 s.
    """
    folder = tmp_path_factory.mktemp("tables")
    rng = np.random.default_rng(8)
    dyn = dd.DiagonalDynamics(ur5)
    t = np.arange(0.0, 30.0, 0.004)[:, None]
    pace = np.array([0.7, 1.1, 1.3, 1.7, 1.9, 2.3])
    size = np.array([0.6, 0.4, 0.5, 0.6, 0.6, 0.6])
    q = size * np.sin(pace * t) + [0.0, -1.2, 1.4, 0.0, 0.0, 0.0]
    qd = size * pace * np.cos(pace * t)
    qdd = -size * pace**2 * np.sin(pace * t)
    tau = dyn.inverse_dynamics(q, qd, qdd) + rng.normal(size=q.shape) * 0.5
    qd = qd + rng.normal(size=q.shape) * 1e-3
    push = np.zeros_like(tau)
    push[5000:5100, 2] = 12.0
    header = ",".join(
        ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in ur5.dof_names)]
    )
    for name, efforts in (("free", tau), ("pushed", tau - push)):
        rows = np.hstack([t, q, qd, efforts])
        np.savetxt(
            folder / f"{name}.csv", rows, delimiter=",", header=header, comments="", fmt="%.12g"
        )
    return folder


def calibrated(recording, path, *options):
    """Run `calibrate`; return its exit status."""
    return main(["calibrate", str(recording), "--urdf", "ur5", "-o", str(path), *options])


def test_the_command(ur5, tables, tmp_path, capsys):
    """The thresholds of a recording find the push in another one, its joint and its torque."""
    alarms = tmp_path / "alarms.yaml"
    out = tmp_path / "summary.json"
    joint = ur5.dof_names[2]
    parameters = {"joints": {joint: {"friction": 0.5}}}
    dd.Parameters.from_dict(parameters).save(tmp_path / "arm.yaml")
    options = (
        "--false-alarms",
        "10/min",
        "--gain",
        "25",
        "--set",
        "collision.hold_off=0.5",
        "collision.standing=1.5",
        "collision.stiction=0.4",
        "--parameters",
        str(tmp_path / "arm.yaml"),
    )
    assert calibrated(tables / "free.csv", alarms, *options) == 0
    values = parameters_of([alarms])
    assert values["collision.standing"] == 1.5 and values["collision.stiction"] == 0.4
    assert values["external_torque.friction"]
    assert f"# With '{tmp_path / 'arm.yaml'}'" in alarms.read_text()
    printed = capsys.readouterr().out
    assert (
        "10/min" in printed
        and "Held out: " in printed
        and all(name in printed for name in ur5.dof_names)
    )
    numbers = {"false_alarms": 1 / 6, "hold_off": 0.5}
    numbers.update(standing=1.5, stiction=0.4)
    model = ur5.with_parameters(parameters)
    recording = dd.read_recording(tables / "free.csv", model)
    result = dd.calibrate(recording, dd.DiagonalDynamics(model), **numbers)
    contact = result.contact
    methods = [METHODS[entry.method].format(entry.peaks) for entry in (result, contact)]
    assert f"Thresholds of collision, {methods[0]}, and of contact, {methods[1]};" in printed
    assert (
        printed.count(contact.describe_rate()) == 1 and f"{contact.limits['norm']:.4g}" in printed
    )
    smallest = np.hypot(result.limits[joint], 0.2)  # 0.4 of Coulomb friction 0.5 N m
    assert f"{contact.limits[joint]:.4g}  {smallest:.4g}\n" in printed
    options = ["--urdf", "ur5", "--alarms", str(alarms), "--quiet", "--json", str(out)]
    main(["analyse", str(tables / "pushed.csv"), *options])
    summary = json.loads(out.read_text())
    (result,) = (entry for entry in summary["collisions"] if 20.0 <= entry["start"] < 20.1)
    assert (
        joint in result["joints"]
        and result["norm"] > 0.0
        and joint in summary["observer"]["judged"]
    )
    assert len(summary["collisions"]) < 15
    assert result["link"] in ur5.link_names and 0.0 < result["confidence"] <= 1.0
    contacts = summary["contacts"]  # an interval around each collision, by lower thresholds
    assert len(contacts) > len(summary["collisions"])
    (touch,) = (entry for entry in contacts if entry["start"] <= result["start"] <= entry["end"])
    assert touch["end"] >= result["end"] and touch["link"] in ur5.link_names


def test_recordings_without_efforts(ur5, tables):
    recording = dd.read_recording(tables / "free.csv", ur5)
    dyn = dd.DiagonalDynamics(ur5)
    without = recorded(ur5, recording.t, recording.q, recording.qd, None)
    for recordings, key in (
        ([], "at least one"),
        ([[]], "no states"),
        (without, "efforts of all joints"),
    ):
        with pytest.raises(InputError, match=key):
            dd.calibrate(recordings, dyn)


def test_wrong_efforts_of_one_recording_are_a_warning(ur5, tables):
    recording = dd.read_recording(tables / "free.csv", ur5)
    dyn = dd.DiagonalDynamics(ur5)
    turned = recorded(ur5, recording.t, recording.q, recording.qd, -recording.tau)
    assert not any("thresholds are wrong" in text for text in dd.calibrate(recording, dyn).warnings)
    (text,) = [
        text
        for text in dd.calibrate([recording, turned], dyn).warnings
        if text.endswith("thresholds are wrong")
    ]
    assert text.startswith("efforts of all joints seem to have the opposite sign")


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (["--false-alarms", "often"], "often"),
        (["--gain", "0"], "gain"),
        (["--false-alarms", "1/week"], "--false-alarms is '1/week'"),
        (["--set", "collision.release=2"], "release"),
        (["-o", "FREE"], "is an input"),  # nothing is written over the recording
    ],
)
def test_the_command_refuses(tables, tmp_path, capsys, arguments, key):
    alarms = tmp_path / "alarms.yaml"
    free = tables / "free.csv"
    before = free.read_bytes()
    assert (
        calibrated(free, alarms, *(str(free) if word == "FREE" else word for word in arguments))
        == 2
    )
    assert key in capsys.readouterr().err and not alarms.exists() and free.read_bytes() == before
