# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms by external torques: thresholds, hysteresis, standing torques, live and over columns."""

import numpy as np
import pytest

from diag_dynamics.alarms.detector import AlarmDetector
from diag_dynamics.alarms.found import Alarms
from diag_dynamics.alarms.thresholds import AlarmThresholds
from diag_dynamics.exceptions import InputError

NAMES = ("shoulder", "elbow", "wrist")
PERIOD = 10_000_000  # [ns]
THRESHOLDS = AlarmThresholds({"shoulder": 10.0, "elbow": 5.0, "wrist": 1.0}, 12.0, 20.0, hold_off=0.5, standing=2.0)
NEVER_STANDING = AlarmThresholds(THRESHOLDS.joints, 12.0, 20.0, standing=np.inf)


def columns(seconds, torque=()):
    """Return stamps, and r and m r that are zero but for (start, end, joint, value)."""
    count = int(seconds * 1e9 / PERIOD)
    stamps, r, external = np.arange(count) * PERIOD, np.zeros((count, 3)), np.zeros((count, 3))
    for start, end, joint, value in torque:
        external[between(stamps, start, end), joint] = value
    return stamps, r, external


def walk(rng, seconds, keeps, sizes):
    """Return stamps, r and m r of coloured noise."""
    stamps, r, torque = columns(seconds)
    for k in range(1, len(stamps)):
        torque[k] = keeps * torque[k - 1] + rng.normal(size=3) * sizes
        r[k] = 0.9 * r[k - 1] + rng.normal(size=3) * 3.0
    return stamps, r, torque


def between(stamps, start, end):
    return (stamps >= start * 1e9) & (stamps < end * 1e9)


def found(thresholds, stamps, r, torque, valid=None, anew=None):
    """Return the alarms, and whether one is on at each state."""
    detector = AlarmDetector(NAMES, thresholds)
    valid = np.ones(len(stamps), dtype=bool) if valid is None else valid
    judged, alarms = detector.judge(stamps, r, torque, valid, anew), Alarms(detector)
    alarms.take(stamps, np.linalg.norm(r, axis=1), judged)
    return alarms.found, judged.alarm


def spans(alarms):
    """Return start and end of alarms [s]."""
    return [(alarm.start / 1e9, alarm.end / 1e9) for alarm in alarms]


# --- Thresholds


def test_a_joint_above_its_threshold():
    stamps, r, torque = columns(3.0, [(1.0, 1.2, 1, -6.5), (1.1, 1.2, 2, 1.5)])
    ((alarm,), on) = found(THRESHOLDS, stamps, r, torque)
    assert (alarm.start, alarm.end) == (int(1e9), int(1.19e9)) and alarm.first == "elbow"
    assert alarm.joints == ("elbow", "wrist")
    exceeded = [(one.detector, one.value, one.threshold) for one in alarm.exceeded]
    assert exceeded == [("wrist", 1.5, 1.0), ("elbow", 6.5, 5.0)]
    assert alarm.told() == "wrist 1.5 N m > 1, elbow 6.5 N m > 5"
    assert np.array_equal(on, between(stamps, 1.0, 1.2))


def test_norms_without_a_joint():
    """‖m r‖ above its threshold with no joint above its own: the alarm names the nearest joint."""
    stamps, r, torque = columns(3.0, [(1.0, 1.2, 0, 9.9), (1.0, 1.2, 1, 4.0), (1.0, 1.2, 2, 0.9)])
    (alarm,), _ = found(AlarmThresholds(THRESHOLDS.joints, 10.0), stamps, r, torque)
    assert alarm.first == "external_torque" and alarm.joints == ("shoulder",)
    assert [(one.detector, one.value) for one in alarm.exceeded] == [
        ("external_torque", pytest.approx(np.linalg.norm([9.9, 4.0, 0.9])))
    ]
    r[between(stamps, 2.0, 2.1)] = 15.0
    alarms, _ = found(THRESHOLDS, stamps, r, 0.0 * torque)
    assert [one.first for one in alarms] == ["norm"] and alarms[0].norm == pytest.approx(15.0 * 3**0.5)


def test_release_and_hold_off():
    """Above 0.7 of a threshold the alarm stays on; a rise within half a second belongs to it, a later one does not."""
    pushes = [(1.0, 1.1, 0, 11.0), (1.1, 1.4, 0, 7.5), (1.4, 1.5, 0, 6.9), (1.8, 1.9, 0, 12.0), (3.0, 3.1, 0, 13.0)]
    stamps, r, torque = columns(6.0, pushes)
    alarms, on = found(THRESHOLDS, stamps, r, torque)
    assert spans(alarms) == [(1.0, 1.89), (3.0, 3.09)]
    assert alarms[0].exceeded[0].value == 12.0
    assert np.array_equal(on, between(stamps, 1.0, 1.4) | between(stamps, 1.8, 1.9) | between(stamps, 3.0, 3.1))


def test_a_joint_below_its_threshold_does_not_hold_the_alarm_of_another():
    stamps, r, torque = columns(4.0, [(1.0, 1.2, 0, 11.0), (0.0, 4.0, 1, 4.0)])
    ((alarm,), _) = found(AlarmThresholds(THRESHOLDS.joints), stamps, r, torque)
    assert alarm.end == int(1.19e9)


def test_states_without_a_result():
    """No alarm is on there, and it continues afterwards; a restart of the observer, or of time stamps, ends it."""
    stamps, r, torque = columns(4.0, [(1.0, 2.0, 0, 11.0)])
    valid = ~between(stamps, 1.4, 1.5)
    torque[~valid] = np.nan
    alarms, on = found(THRESHOLDS, stamps, r, torque, valid)
    assert spans(alarms) == [(1.0, 1.99)]
    assert np.array_equal(on, between(stamps, 1.0, 2.0) & valid)
    alarms, _ = found(THRESHOLDS, stamps, r, torque, valid, np.arange(len(stamps)) == 160)
    assert [start for start, _ in spans(alarms)] == [1.0, 1.6]
    stamps[150:] -= int(0.4e9)
    assert len(found(THRESHOLDS, stamps, r, np.nan_to_num(torque))[0]) == 2


# --- Standing torques


def test_a_standing_torque_ends_its_alarm():
    """A torque of 2.5 times the threshold stands for a minute: the alarm ends after seconds, once."""
    stamps, r, torque = columns(70.0, [(5.0, 65.0, 1, 12.5)])
    (((start, end),), ((_, last),)) = (spans(found(one, stamps, r, torque)[0]) for one in (THRESHOLDS, NEVER_STANDING))
    assert 2.0 < end - start < 5.0 and last == 64.99
    after = between(stamps, 5.0, 70.0)
    for time_constant in (1.0, 3.0, 10.0):  # stiction that decays is one alarm
        torque[after, 1] = 12.5 * np.exp(-(1e-9 * stamps[after] - 5.0) / time_constant)
        ((start, end),) = spans(found(THRESHOLDS, stamps, r, torque)[0])
        assert end - start < 5.0


def test_a_push_upon_a_standing_torque_is_an_alarm():
    """At its full threshold; and so is one after the standing torque."""
    pushes = [(5.0, 40.0, 1, 12.5), (30.0, 30.2, 1, 18.0), (35.0, 35.2, 0, 10.5), (50.0, 50.2, 1, 5.5)]
    stamps, r, torque = columns(60.0, pushes)
    alarms, _ = found(THRESHOLDS, stamps, r, torque)
    assert [alarm.start for alarm in alarms] == [int(5e9), int(30e9), int(35e9), int(50e9)]
    assert [alarm.joints for alarm in alarms] == [("elbow",), ("elbow",), ("shoulder",), ("elbow",)]


# --- One implementation for states and columns


def fields(alarm):
    """Return what an alarm holds, whatever the order of its joints."""
    return alarm._replace(joints=frozenset(alarm.joints))


def test_states_one_by_one_have_the_alarms_of_columns():
    """Bit by bit, in pieces of any size: alarms, standing torques, values."""
    rng = np.random.default_rng(3)
    stamps, r, torque = walk(rng, 60.0, 0.99, [1.5, 0.7, 0.15])
    stamps = stamps + rng.integers(0, PERIOD // 2, len(stamps))
    torque[between(stamps, 20.0, 40.0), 1] += 9.0
    valid = rng.random(len(stamps)) >= 0.02
    whole = AlarmDetector(NAMES, THRESHOLDS).judge(stamps, r, torque, valid)
    assert whole.begins.sum() > 5
    expected, _ = found(THRESHOLDS, stamps, r, torque, valid)
    for size in (1, 37, 1000):
        one, parts = AlarmDetector(NAMES, THRESHOLDS), []
        together = Alarms(one)
        for first in range(0, len(stamps), size):
            part, alarms = slice(first, first + size), Alarms(one)
            parts.append(one.judge(stamps[part], r[part], torque[part], valid[part]))
            alarms.take(stamps[part], np.linalg.norm(r[part], axis=1), parts[-1])
            together.add(alarms)
        for column, of_parts in zip(whole, zip(*parts, strict=True), strict=True):
            assert np.array_equal(column, np.concatenate(of_parts))
        assert list(map(fields, together.found)) == list(map(fields, expected))


# --- Input errors


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"joints": {"elbow": -1.0}}, "elbow"),
        ({"joints": {"elbow": np.nan}}, "elbow"),
        ({"external_torque": 0.0}, "external_torque"),
        ({"norm": -1.0}, "norm"),
        ({"release": 0.0}, "release"),
        ({"release": 1.5}, "release"),
        ({"hold_off": -1.0}, "hold_off"),
        ({"standing": 0.0}, "standing"),
    ],
)
def test_wrong_thresholds(arguments, key):
    with pytest.raises(InputError, match=key):
        AlarmThresholds(**arguments)


def test_limits_of_joints():
    assert AlarmDetector(NAMES, THRESHOLDS).limits.tolist() == [10.0, 5.0, 1.0, 12.0, 20.0]
    everyone = AlarmDetector(NAMES, AlarmThresholds({"*": 2.0, "wrist": np.inf}))
    assert everyone.limits.tolist() == [2.0, 2.0, np.inf, np.inf, np.inf]
    with pytest.raises(InputError, match="knee"):
        AlarmDetector(NAMES, AlarmThresholds({"knee": 1.0}))
    with pytest.raises(InputError, match="elbow"):
        AlarmDetector(NAMES, THRESHOLDS).update(0.0, [0, np.nan, 0], [0, 0, 0])
