# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The detector of alarms: what it says of residuals, live and over columns, and of torques that stand."""

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.alarms.detector import AlarmDetector
from diag_dynamics.alarms.found import Alarms
from diag_dynamics.alarms.thresholds import AlarmThresholds
from diag_dynamics.exceptions import InputError

NAMES = ("shoulder", "elbow", "wrist")
PERIOD = 10_000_000  # [ns]
THRESHOLDS = AlarmThresholds({"shoulder": 10.0, "elbow": 5.0, "wrist": 1.0}, 12.0, 20.0, hold_off=0.5, standing=2.0)


@pytest.fixture(scope="module")
def ur5():
    return dd.load_robot("ur5")


def columns(seconds):
    """Stamps, and r and m r that are zero."""
    count = int(seconds * 1e9 / PERIOD)
    return np.arange(count) * PERIOD, np.zeros((count, 3)), np.zeros((count, 3)), np.ones(count, dtype=bool)


def between(stamps, start, end):
    return (stamps >= start * 1e9) & (stamps < end * 1e9)


def found(thresholds, stamps, r, torque, valid=None, anew=None):
    """Alarms, and whether one is on at each state."""
    detector = AlarmDetector(NAMES, thresholds)
    valid = np.ones(len(stamps), dtype=bool) if valid is None else valid
    judged, alarms = detector.judge(stamps, r, torque, valid, anew), Alarms(detector)
    alarms.take(stamps, np.linalg.norm(r, axis=1), judged)
    return alarms.found, judged.alarm


# --- What rises


def test_a_joint_above_its_threshold():
    stamps, r, torque, _ = columns(3.0)
    torque[between(stamps, 1.0, 1.2), 1] = -6.5
    torque[between(stamps, 1.1, 1.2), 2] = 1.5
    ((alarm,), on) = found(THRESHOLDS, stamps, r, torque)
    assert (alarm.start, alarm.end) == (int(1e9), int(1.19e9)) and alarm.first == "elbow"
    assert alarm.joints == ("elbow", "wrist")
    assert [(one.detector, one.value, one.threshold) for one in alarm.exceeded] == [
        ("wrist", 1.5, 1.0),
        ("elbow", 6.5, 5.0),
    ]
    assert alarm.told() == "wrist 1.5 N m > 1, elbow 6.5 N m > 5"
    assert np.array_equal(on, between(stamps, 1.0, 1.2))


def test_norms_without_a_joint():
    """‖m r‖ above its threshold, no joint above its own: the joint that comes nearest is named."""
    stamps, r, torque, _ = columns(3.0)
    torque[between(stamps, 1.0, 1.2)] = 9.9, 4.0, 0.9
    thresholds = AlarmThresholds(THRESHOLDS.joints, 10.0)
    (alarm,), _ = found(thresholds, stamps, r, torque)
    size = float(np.linalg.norm([9.9, 4.0, 0.9]))
    assert alarm.first == "external_torque" and alarm.joints == ("shoulder",)
    assert [one.detector for one in alarm.exceeded] == ["external_torque"]
    assert alarm.told() == f"|m r| {size:.3g} N m > 10, most of it at shoulder"
    r[between(stamps, 2.0, 2.1)] = 15.0
    found_, _ = found(THRESHOLDS, stamps, r, 0.0 * torque)
    assert [one.first for one in found_] == ["norm"] and found_[0].norm == pytest.approx(15.0 * 3**0.5)


def test_release_and_hold_off():
    """Down to 0.7 of a threshold the alarm is on; a rise half a second later is the same alarm, a later one another."""
    stamps, r, torque, _ = columns(6.0)
    torque[between(stamps, 1.0, 1.1), 0] = 11.0
    torque[between(stamps, 1.1, 1.4), 0] = 7.5
    torque[between(stamps, 1.4, 1.5), 0] = 6.9
    torque[between(stamps, 1.8, 1.9), 0] = 12.0
    torque[between(stamps, 3.0, 3.1), 0] = 13.0
    alarms, on = found(THRESHOLDS, stamps, r, torque)
    assert [(a.start, a.end) for a in alarms] == [(int(1e9), int(1.89e9)), (int(3e9), int(3.09e9))]
    assert alarms[0].exceeded[0].value == 12.0
    assert np.array_equal(on, between(stamps, 1.0, 1.4) | between(stamps, 1.8, 1.9) | between(stamps, 3.0, 3.1))


def test_one_that_does_not_exceed_does_not_hold_the_alarm_of_another():
    stamps, r, torque, _ = columns(4.0)
    torque[between(stamps, 1.0, 1.2), 0] = 11.0
    torque[:, 1] = 4.0  # 0.8 of its threshold, all the time
    ((alarm,), _) = found(AlarmThresholds(THRESHOLDS.joints), stamps, r, torque)
    assert alarm.end == int(1.19e9)


def test_states_without_a_result():
    """Nothing is on there, and the alarm is the same one afterwards; before a state that begins anew all is forgotten."""
    stamps, r, torque, valid = columns(4.0)
    torque[between(stamps, 1.0, 2.0), 0] = 11.0
    valid[between(stamps, 1.4, 1.5)] = False
    torque[~valid] = np.nan
    alarms, on = found(THRESHOLDS, stamps, r, torque, valid)
    assert [(a.start, a.end) for a in alarms] == [(int(1e9), int(1.99e9))]
    assert np.array_equal(on, between(stamps, 1.0, 2.0) & valid)
    anew = np.arange(len(stamps)) == 160
    alarms, _ = found(THRESHOLDS, stamps, r, torque, valid, anew)
    assert [a.start for a in alarms] == [int(1e9), int(1.6e9)]


def test_time_that_goes_back():
    stamps, r, torque, _ = columns(3.0)
    torque[between(stamps, 1.0, 1.2), 0] = 11.0
    stamps[150:] -= int(0.4e9)
    torque[150:170, 0] = 11.0
    alarms, _ = found(THRESHOLDS, stamps, r, torque)
    assert len(alarms) == 2


# --- What stands


def test_a_torque_that_stands_ends():
    """A push leaves 2.5 times the threshold behind for a minute: the alarm is over after seconds, and begins no more."""
    stamps, r, torque, _ = columns(70.0)
    torque[between(stamps, 5.0, 65.0), 1] = 12.5
    ((alarm,), _) = found(THRESHOLDS, stamps, r, torque)
    assert 2.0 < 1e-9 * (alarm.end - alarm.start) < 5.0
    never = AlarmThresholds(THRESHOLDS.joints, 12.0, 20.0, standing=np.inf)
    ((alarm,), _) = found(never, stamps, r, torque)
    assert alarm.end == int(64.99e9)


@pytest.mark.parametrize("time_constant", [1.0, 3.0, 10.0])
def test_an_offset_that_decays(time_constant):
    """Stiction that goes by over seconds is one alarm."""
    stamps, r, torque, _ = columns(60.0)
    after = between(stamps, 5.0, 60.0)
    torque[after, 1] = 12.5 * np.exp(-(1e-9 * stamps[after] - 5.0) / time_constant)
    ((alarm,), _) = found(THRESHOLDS, stamps, r, torque)
    assert 1e-9 * (alarm.end - alarm.start) < 5.0


def test_a_push_upon_what_stands_is_seen():
    """Upon an offset that has stood for long a further push is an alarm, at its full threshold, and so is one after it."""
    stamps, r, torque, _ = columns(60.0)
    torque[between(stamps, 5.0, 40.0), 1] = 12.5
    torque[between(stamps, 30.0, 30.2), 1] = 12.5 + 5.5
    torque[between(stamps, 35.0, 35.2), 0] = 10.5
    torque[between(stamps, 50.0, 50.2), 1] = 5.5
    alarms, _ = found(THRESHOLDS, stamps, r, torque)
    assert [alarm.start for alarm in alarms] == [int(5e9), int(30e9), int(35e9), int(50e9)]
    assert [alarm.joints for alarm in alarms] == [("elbow",), ("elbow",), ("shoulder",), ("elbow",)]


def test_an_offset_never_makes_an_alarm():
    """Whatever stands: what is judged is at most the torque itself, so fewer alarms come of it than without, never more."""
    rng = np.random.default_rng(1)
    stamps, r, torque, _ = columns(200.0)
    for k in range(1, len(stamps)):
        torque[k] = 0.995 * torque[k - 1] + rng.normal(size=3) * [1.0, 0.5, 0.1]
    _, on = found(THRESHOLDS, stamps, r, torque)
    never = AlarmThresholds(THRESHOLDS.joints, 12.0, 20.0, standing=np.inf)
    _, on_without = found(never, stamps, r, torque)
    assert on_without.any() and not (on & ~on_without).any()


def test_stiction_after_a_push_on_a_simulated_arm(ur5):
    """An arm held by springs is pushed, and friction keeps it where it was pushed to: r stands, the alarm does not."""
    dyn = dd.DiagonalDynamics(ur5)
    q0, n = np.array([0.0, -1.2, 1.4, 0.3, 0.5, 0.0]), ur5.nv
    robot = dd.Simulation(ur5, q0, step=1e-3, damping=np.full(n, 2.0), friction=np.full(n, 6.0), effort_limits=False)
    observer = dd.DisturbanceObserver(dyn, 25.0)
    detector = AlarmDetector(ur5.dof_names, AlarmThresholds({"*": 3.0}))
    stays = AlarmDetector(ur5.dof_names, AlarmThresholds({"*": 3.0}, standing=np.inf))
    stiffness = np.array([300.0, 300.0, 300.0, 100.0, 100.0, 100.0])
    on, torques = [], []
    for k in range(12_000):
        t, q, qd = 1e-3 * k, robot.q, robot.qd
        tau = dyn.gravity_torque(q) + stiffness * (q0 - q) - 0.1 * stiffness * qd
        seen = observer.update(t, q, qd, tau)
        if seen.valid:
            rows = [one.update(t, seen.residual, seen.external_torque).alarm[0] for one in (detector, stays)]
            on.append((t, *rows))
            torques.append(seen.external_torque)
        push = np.zeros(n)
        push[0] = 25.0 if 1.0 <= t < 2.0 else 0.0
        robot.advance(tau + push)
    on, torques = np.array(on), np.array(torques)
    assert torques[-1, 0] > 3.0  # friction holds: the offset stands above the threshold ten seconds later
    assert not on[on[:, 0] < 1.0, 1].any() and on[(on[:, 0] > 1.1) & (on[:, 0] < 2.0), 1].all()
    assert not on[on[:, 0] > 7.0, 1].any()
    assert on[-1, 2]


# --- One code for both


def test_state_by_state_is_what_columns_say():
    """Bit by bit, whatever the pieces are: alarms, offsets, values."""
    rng = np.random.default_rng(3)
    stamps, r, torque, valid = columns(60.0)
    stamps = stamps + rng.integers(0, PERIOD // 2, len(stamps))
    for k in range(1, len(stamps)):
        torque[k] = 0.99 * torque[k - 1] + rng.normal(size=3) * [1.5, 0.7, 0.15]
        r[k] = 0.9 * r[k - 1] + rng.normal(size=3) * 3.0
    torque[between(stamps, 20.0, 40.0), 1] += 9.0
    valid[rng.random(len(valid)) < 0.02] = False
    whole = AlarmDetector(NAMES, THRESHOLDS).judge(stamps, r, torque, valid)
    assert whole.begins.sum() > 5
    for sizes in (1, 7, 1000):
        one, parts = AlarmDetector(NAMES, THRESHOLDS), []
        for first in range(0, len(stamps), sizes):
            part = slice(first, first + sizes)
            parts.append(one.judge(stamps[part], r[part], torque[part], valid[part]))
        for column, of_parts in zip(whole, zip(*parts, strict=True), strict=True):
            assert np.array_equal(column, np.concatenate(of_parts))


def test_pieces_have_the_same_alarms():
    rng = np.random.default_rng(4)
    stamps, r, torque, valid = columns(30.0)
    for k in range(1, len(stamps)):
        torque[k] = 0.98 * torque[k - 1] + rng.normal(size=3) * [0.9, 0.45, 0.09]
    whole, _ = found(THRESHOLDS, stamps, r, torque)
    assert len(whole) > 4
    detector = AlarmDetector(NAMES, THRESHOLDS)
    together = Alarms(detector)
    for first in range(0, len(stamps), 37):
        part = slice(first, first + 37)
        one = Alarms(detector)
        judged = detector.judge(stamps[part], r[part], torque[part], valid[part])
        one.take(stamps[part], np.linalg.norm(r[part], axis=1), judged)
        together.add(one)
    assert together.found == whole


# --- What is refused


@pytest.mark.parametrize(
    ("arguments", "named"),
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
def test_wrong_thresholds(arguments, named):
    with pytest.raises(InputError, match=named):
        AlarmThresholds(**arguments)


def test_wrong_joint_or_state():
    with pytest.raises(InputError, match="knee"):
        AlarmDetector(NAMES, AlarmThresholds({"knee": 1.0}))
    detector = AlarmDetector(NAMES, THRESHOLDS)
    with pytest.raises(InputError, match="elbow"):
        detector.update(0.0, [0, np.nan, 0], [0, 0, 0])
    assert detector.limits.tolist() == [10.0, 5.0, 1.0, 12.0, 20.0]
    everyone = AlarmDetector(NAMES, AlarmThresholds({"*": 2.0, "wrist": np.inf}))
    assert everyone.limits.tolist() == [2.0, 2.0, np.inf, np.inf, np.inf]
