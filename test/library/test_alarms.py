# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms by external torques, and the calibration of their thresholds."""

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.collision.detector import AlarmDetector
from diag_dynamics.collision.events import Alarms
from diag_dynamics.collision.residuals import Residuals
from diag_dynamics.collision.tail import poisson_interval, upper_limit
from diag_dynamics.collision.thresholds import AlarmThresholds
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.calibration import calibrated
from diag_dynamics.recordings.observed import Observed
from examples import some_of
from motions import recorded

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


# --- Calibration


FOUR, HZ = ("a", "b", "c", "d"), 100
R_SPREAD, TORQUE_SPREAD = np.array([1.0, 2.0, 0.3, 0.05]), np.array([3.0, 2.0, 0.6, 0.2])


def noise(rng, seconds, heavy=False, jerks=()):
    """Coloured noise (autoregressive, 50 ms) of four joints, normal or with heavy tails, and jerks at some times."""
    count, keeps = int(seconds * HZ), math.exp(-1.0 / (HZ * 0.05))
    new = rng.standard_t(4, (count, 4)) if heavy else rng.normal(size=(count, 4))
    response = math.sqrt(1.0 - keeps**2) * keeps ** np.arange(HZ)
    x = np.stack([np.convolve(column, response)[:count] for column in new.T], axis=1)
    for at in jerks:
        k = int(at * HZ)
        x[k : k + 20] += 25.0
    stamps = np.arange(count) * (10**9 // HZ)
    residual, torque = x * R_SPREAD, x * TORQUE_SPREAD
    norm, yes = np.linalg.norm(residual, axis=1), np.ones(count, dtype=bool)
    return stamps, Observed(1e-9 * stamps, residual, torque, norm, yes, ~yes)


def residuals_of(*seen, **options):
    """What was seen, gathered."""
    residuals = Residuals(len(FOUR), **options)
    for stamps, observed in seen:
        residuals.take(stamps, observed.residual, observed.external_torque, observed.valid)
    return residuals


def calibrate_on(*seen, rate=1 / 60):
    return calibrated(residuals_of(*seen), FOUR, 25.0, rate, AlarmThresholds())


def count(thresholds, seen):
    """Alarms of what was seen."""
    stamps, observed = seen
    judged = AlarmDetector(FOUR, thresholds).judge(stamps, observed.residual, observed.external_torque, observed.valid)
    return int(judged.begins.sum())


RATES = (
    (200, 1 / 60, "tail", True),
    (200, 1 / 60, "tail", False),
    (600, 0.1, "counted", False),
    (600, 0.1, "counted", True),
)


@pytest.mark.parametrize(("seconds", "rate", "method", "heavy"), list(some_of(RATES, 2)))
def test_the_rate_that_was_asked_for(seconds, rate, method, heavy):
    """Of unseen noise, on average over eight calibrations; each of them is near, and its interval contains the rate."""
    ratios, inside = [], 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        found = calibrate_on(noise(rng, seconds, heavy), rate=rate)
        assert found.method == method
        ratios.append(count(found.thresholds, noise(rng, 1000, heavy)) / (1000 * rate))
        low, high = found.rate_interval
        inside += low <= rate <= high
    assert 0.6 < np.mean(ratios) < 1.5
    assert min(ratios) > 0.2 and max(ratios) < 4.0
    assert inside >= 7


def test_one_jerk_is_one_alarm():
    """A jerk of 25 times the spread moves no threshold by an eighth."""
    with_jerk = calibrate_on(noise(np.random.default_rng(2), 200, jerks=[0.37 * 200]))
    without = calibrate_on(noise(np.random.default_rng(2), 200))
    for name in FOUR:
        assert with_jerk.joints[name] == pytest.approx(without.joints[name], rel=0.12)
    assert with_jerk.norm == pytest.approx(without.norm, rel=0.12)
    assert with_jerk.alarms == without.alarms + 1
    assert with_jerk.held_out >= 1
    ratios = [without.joints[name] / spread for name, spread in zip(FOUR, TORQUE_SPREAD, strict=True)]
    assert max(ratios) < 1.25 * min(ratios)


def test_warnings_of_the_recording():
    """A short recording cannot show a rate below −ln 0.05 alarms in its time; a rough part exceeds other thresholds."""
    found = calibrate_on(noise(np.random.default_rng(3), 60))
    assert found.vouched == pytest.approx(-math.log(0.05) / 59.99, rel=1e-6)
    assert any("too short" in text and "3/min" in text and "180 s" in text for text in found.warnings)
    assert not calibrate_on(noise(np.random.default_rng(3), 200)).warnings
    with pytest.raises(InputError, match="too short"):
        calibrate_on(noise(np.random.default_rng(3), 0.5))
    seen = noise(np.random.default_rng(4), 300)
    rough = slice(24_000, None)
    seen[1].residual[rough] *= 4.0
    seen[1].external_torque[rough] *= 4.0
    assert any("unlike" in text for text in calibrate_on(seen).warnings)


def test_residuals_of_any_portions():
    """What is kept depends on the states, not on how they came: all at once, in pieces, or one by one; thinned or not."""
    stamps, observed = noise(np.random.default_rng(11), 60)
    stamps = stamps.copy()
    stamps[3000:] += 5 * 10**8
    columns = stamps, observed.residual, observed.external_torque, observed.valid
    for most in (10**6, 20_000, 3000):
        whole, parts, single = (Residuals(len(FOUR), most=most) for _ in range(3))
        whole.take(*columns)
        for k in range(0, 6000, 77):
            parts.take(*(column[k : k + 77] for column in columns))
        for stamp, r, torque in zip(*columns[:3], strict=True):
            single.add(int(stamp), r, torque)
        assert [one.gaps for one in (whole, parts, single)] == [1, 1, 1]
        assert [one.states for one in (whole, parts, single)] == [6000] * 3
        for other in (parts, single):
            assert other.duration == whole.duration == pytest.approx(59.98)
            for one, two in zip(whole.pieces(), other.pieces(), strict=True):
                for left, right in zip(one, two, strict=True):
                    np.testing.assert_array_equal(left, right)
        kept = sum(len(piece.stamps) for piece in whole.pieces())
        assert kept * (2 * len(FOUR) + 3) <= most and (kept == 6000) == (most == 10**6)


def test_poisson():
    """Garwood's limits as tables have them."""
    assert poisson_interval(0) == pytest.approx((0.0, 3.689), abs=1e-3)
    assert poisson_interval(1) == pytest.approx((0.0253, 5.572), abs=1e-3)
    assert poisson_interval(10) == pytest.approx((4.795, 18.390), abs=1e-3)
    assert poisson_interval(1000) == pytest.approx((938.97, 1063.96), abs=0.05)
    assert upper_limit(0) == pytest.approx(2.9957, abs=1e-4)
    assert upper_limit(3) == pytest.approx(7.754, abs=1e-3)


def test_a_joint_without_residuals_has_no_threshold():
    seen = noise(np.random.default_rng(6), 100)
    seen[1].external_torque[:, 2] = 0.0
    assert set(calibrate_on(seen).joints) == {"a", "b", "d"}
    for rate in (0.0, math.nan):
        with pytest.raises(InputError, match="false_alarms"):
            calibrate_on(seen, rate=rate)


def test_the_file_is_the_monitors(tmp_path):
    """The monitor reads the file and has thresholds no lower than the calibration's."""
    found = calibrate_on(noise(np.random.default_rng(7), 60))
    found.save(tmp_path / "alarms.yaml")
    values = parameters_of([tmp_path / "alarms.yaml"])
    seen = Settings.of({name: spec.default for name, spec in PARAMETERS.items()} | values).observation
    assert seen.gain == 25.0 and not seen.friction
    assert seen.alarms.limits(FOUR) == pytest.approx(found.thresholds.limits(FOUR), rel=1e-3)
    assert (seen.alarms.limits(FOUR) >= found.thresholds.limits(FOUR) * (1 - 1e-9)).all()
    assert (seen.alarms.release, seen.alarms.hold_off, seen.alarms.standing) == (0.7, 0.5, 2.0)
    with pytest.raises(InputError, match="nowhere"):
        found.save(tmp_path / "nowhere" / "alarms.yaml")


@pytest.fixture(scope="module")
def ur5():
    return dd.load_robot("ur5")


@pytest.fixture(scope="module")
def tables(ur5, tmp_path_factory):
    """Half a minute of a UR5 with noise on efforts and rates; and the same with a push of 12 N m at the elbow at 20 s."""
    folder, rng, dyn = tmp_path_factory.mktemp("tables"), np.random.default_rng(8), dd.DiagonalDynamics(ur5)
    t = np.arange(0.0, 30.0, 0.004)[:, None]
    pace, size = np.array([0.7, 1.1, 1.3, 1.7, 1.9, 2.3]), np.array([0.6, 0.4, 0.5, 0.6, 0.6, 0.6])
    q = size * np.sin(pace * t) + [0.0, -1.2, 1.4, 0.0, 0.0, 0.0]
    qd, qdd = size * pace * np.cos(pace * t), -size * pace**2 * np.sin(pace * t)
    tau = dyn.inverse_dynamics_batch(q, qd, qdd) + rng.normal(size=q.shape) * 0.5
    qd = qd + rng.normal(size=q.shape) * 1e-3
    push = np.zeros_like(tau)
    push[5000:5100, 2] = 12.0
    header = ",".join(["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in ur5.dof_names)])
    for name, efforts in (("free", tau), ("pushed", tau - push)):
        rows = np.hstack([t, q, qd, efforts])
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=header, comments="", fmt="%.12g")
    return folder


def test_the_command(ur5, tables, tmp_path, capsys):
    """The thresholds of a recording find the push in another one, its joint and its torque."""
    free, pushed, alarms = tables / "free.csv", tables / "pushed.csv", tmp_path / "alarms.yaml"
    asked = ["--false-alarms", "20/min", "--gain", "25", "-o", str(alarms)]
    assert main(["calibrate", str(free), "--urdf", "ur5", *asked]) == 0
    printed = capsys.readouterr().out
    assert "20/min" in printed and "Held out" in printed and all(name in printed for name in ur5.dof_names)
    summaries = []
    for path in (free, pushed):
        out = tmp_path / "summary.json"
        main(["analyse", str(path), "--urdf", "ur5", "--alarms", str(alarms), "--quiet", "--json", str(out)])
        summaries.append(json.loads(out.read_text()))
    joint = ur5.dof_names[2]
    found = [one for one in summaries[1]["collisions"] if 20.0 <= one["start"] < 20.1]
    assert len(found) == 1 and joint in found[0]["joints"] and found[0]["norm"] > 0.0
    assert found[0]["exceeded"][joint]["value"] > 8.0 > found[0]["exceeded"][joint]["threshold"]
    assert len(summaries[0]["collisions"]) < 15
    assert joint in summaries[0]["observer"]["judged"]


def test_the_library_and_the_command_write_the_same(ur5, tables, tmp_path):
    """Friction of a parameter file raises the thresholds, and the file says that the monitor needs it."""
    free, arm = tables / "free.csv", tmp_path / "arm.yaml"
    recording, dyn = dd.read_recording(free, ur5), dd.DiagonalDynamics(ur5)
    found = dd.calibrate([recording], dyn, gain=25.0, false_alarms=1 / 3)
    found.save(tmp_path / "a.yaml")
    asked = ["calibrate", str(free), "--urdf", "ur5", "--false-alarms", "20/min", "--quiet", "-o"]
    main([*asked, str(tmp_path / "b.yaml")])
    by_library, by_command = ((tmp_path / name).read_text() for name in ("a.yaml", "b.yaml"))
    assert by_library == "".join(line for line in by_command.splitlines(True) if not line.startswith("# From"))
    assert dd.calibrate(recording, dyn, false_alarms=1 / 3) == found
    assert found.rate_interval[0] <= 1 / 3 <= found.rate_interval[1]
    arm.write_text("joints:\n" + "".join(f"  {name}: {{friction: 4.0}}\n" for name in ur5.dof_names))
    main([*asked, str(tmp_path / "c.yaml"), "--parameters", str(arm)])
    without, known = (parameters_of([tmp_path / name]) for name in ("b.yaml", "c.yaml"))
    assert not without["external_torque.friction"] and known["external_torque.friction"]
    assert known["alarm.external_torque"] > 4.0 > without["alarm.external_torque"]
    assert f"# By '{arm}'" in (tmp_path / "c.yaml").read_text()
    with pytest.raises(InputError, match="at least one"):
        dd.calibrate([], dyn)
    with pytest.raises(InputError, match="no efforts"):
        dd.calibrate(recorded(ur5, recording.t, recording.q, recording.qd, None), dyn)


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (["--false-alarms", "often"], "often"),
        (["--gain", "0"], "gain"),
        (["--release", "2"], "release"),
        (["--urdf", "no_such_robot"], "no_such_robot"),
        (["-o", "FREE"], "is read"),  # nothing is written over the recording
    ],
)
def test_the_command_refuses(tables, tmp_path, capsys, arguments, key):
    alarms, free = tmp_path / "alarms.yaml", tables / "free.csv"
    before = free.read_bytes()
    arguments = [str(free) if word == "FREE" else word for word in arguments]
    assert main(["calibrate", str(free), "--urdf", "ur5", "-o", str(alarms), *arguments]) == 2
    assert key in capsys.readouterr().err and not alarms.exists() and free.read_bytes() == before


RECORDINGS = Path(
    os.environ.get("DIAG_DYNAMICS_RECORDINGS", Path(__file__).parents[2].parent / "shared" / "recordings")
)
KUKA = RECORDINGS / "kuka_lwr4"


@pytest.mark.full
@pytest.mark.skipif(not KUKA.exists(), reason="recordings of real arms are no part of this package")
def test_a_real_arm():
    """Thresholds from one half of a KUKA's motion let few alarms of the other half through; they are joints' own."""
    columns = {"time": "times", "position": "positions", "velocity": "velocities", "effort": "torques"}
    model = dd.load_urdf(str(KUKA / "kuka_lwr4.urdf"))
    dyn = dd.DiagonalDynamics(model)
    halves = [
        dd.read_recording(KUKA / "measurements_1.npz", model, columns, **part)
        for part in ({"end": 12.5}, {"start": 12.5})
    ]
    for one, other in (halves, halves[::-1]):
        found = dd.calibrate(one, dyn)
        assert any("too short" in text for text in found.warnings)
        seen = dd.observe(dyn, other, 25.0, friction=found.friction)
        detector = dd.AlarmDetector(model.dof_names, found.thresholds)
        assert detector.judge(other.stamp, seen.residual, seen.external_torque, seen.valid).begins.sum() <= 2
        assert 0.1 < min(found.joints.values()) < max(found.joints.values()) < 15.0
