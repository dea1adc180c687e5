# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibration of alarm thresholds: rates, jerks, short recordings, files, the command."""

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.alarms.detector import AlarmDetector
from diag_dynamics.alarms.rates import poisson_interval, upper_limit
from diag_dynamics.alarms.thresholds import AlarmThresholds
from diag_dynamics.cli.main import main
from diag_dynamics.exceptions import InputError
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.calibration import calibrated
from diag_dynamics.recordings.observed import Observed
from diag_dynamics.recordings.residuals import Residuals
from examples import some_of
from motions import recorded

NAMES, HZ = ("a", "b", "c", "d"), 100
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
    residuals = Residuals(len(NAMES), **options)
    for stamps, observed in seen:
        residuals.take(stamps, observed.residual, observed.external_torque, observed.valid)
    return residuals


def calibrate_on(*seen, rate=1 / 60):
    return calibrated(residuals_of(*seen), NAMES, 25.0, rate, AlarmThresholds())


def count(thresholds, seen):
    """Alarms of what was seen."""
    stamps, observed = seen
    judged = AlarmDetector(NAMES, thresholds).judge(stamps, observed.residual, observed.external_torque, observed.valid)
    return int(judged.begins.sum())


# --- The rate


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


def test_each_joint_by_its_own_spread():
    """Thresholds follow the spreads of the joints, whatever their units; all together make the rate."""
    found = calibrate_on(noise(np.random.default_rng(1), 300))
    scaled = np.array([found.joints[name] for name in NAMES]) / TORQUE_SPREAD
    assert scaled.max() / scaled.min() < 1.25
    assert found.external_torque > 0.9 * max(found.joints.values())
    assert found.gain == 25.0 and found.release == 0.7 and found.hold_off == 0.5


def test_one_jerk_is_one_alarm():
    """A jerk of 25 times the spread moves no threshold by an eighth."""
    with_jerk = calibrate_on(noise(np.random.default_rng(2), 200, jerks=[0.37 * 200]))
    without = calibrate_on(noise(np.random.default_rng(2), 200))
    for name in NAMES:
        assert with_jerk.joints[name] == pytest.approx(without.joints[name], rel=0.12)
    assert with_jerk.norm == pytest.approx(without.norm, rel=0.12)
    assert with_jerk.alarms == without.alarms + 1
    assert with_jerk.held_out >= 1


# --- Short recordings


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


# --- Bounded memory


def test_residuals_of_any_portions():
    """What is kept depends on the states, not on how they came: all at once, in pieces, or one by one; thinned or not."""
    stamps, observed = noise(np.random.default_rng(11), 60)
    stamps = stamps.copy()
    stamps[3000:] += 5 * 10**8
    columns = stamps, observed.residual, observed.external_torque, observed.valid
    for most in (10**6, 20_000, 3000):
        whole, parts, single = (Residuals(len(NAMES), most=most) for _ in range(3))
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
        assert kept * (2 * len(NAMES) + 3) <= most and (kept == 6000) == (most == 10**6)


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


# --- Files and the command


def test_the_file_is_the_monitors(tmp_path):
    """The monitor reads the file and has thresholds no lower than the calibration's."""
    found = calibrate_on(noise(np.random.default_rng(7), 60))
    found.save(tmp_path / "alarms.yaml")
    values = parameters_of([tmp_path / "alarms.yaml"])
    seen = Settings.of({name: spec.default for name, spec in PARAMETERS.items()} | values).observation
    assert seen.gain == 25.0 and not seen.friction
    assert seen.alarms.limits(NAMES) == pytest.approx(found.thresholds.limits(NAMES), rel=1e-3)
    assert (seen.alarms.limits(NAMES) >= found.thresholds.limits(NAMES) * (1 - 1e-9)).all()
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
