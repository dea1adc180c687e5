# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is said of a recording: against the library's own single calls, sums by NumPy, and motions whose truth is known."""

import json

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.account import Account
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.balance import Moments, WindowSums
from diag_dynamics.recordings.intake import Intake, States
from diag_dynamics.recordings.observed import Observer
from diag_dynamics.recordings.quality import Quality
from diag_dynamics.recordings.recording import Reading, Recording
from diag_dynamics.recordings.summary import summary_of, text_of

DEFAULTS = {name: spec.default for name, spec in PARAMETERS.items()}
S = 10**9


def states_of(t, q, qd, tau=None, moved=None):
    """States of columns, times from zero."""
    count = len(t)
    no = np.zeros(count, dtype=bool)
    stamps = np.round(np.asarray(t) * 1e9).astype(int) + S
    effort = np.full(qd.shape, np.nan) if tau is None else tau
    known = np.isfinite(effort).all(axis=1)
    return States(stamps, stamps, stamps, q, qd, effort, known, no, no, no if moved is None else moved)


class Given:
    """A reading of states that are there already."""

    contact_points = Reading.contact_points

    def __init__(self, model, states, **parameters):
        self.model, self.settings, self._states = model, Settings.of(DEFAULTS | parameters), states
        self.offset, self.intake, self.settles = S, Intake(model, self.settings), False
        self.described = find_urdf("ur5") if model.name.startswith("ur5") else None

    def pieces(self, size):
        for first in range(0, self._states.number, size):
            yield Recording(self.model, self._states.part(slice(first, first + size)), S, {}, [])

    def account(self):
        return Account(self.intake)


def analysed(model, states, **parameters):
    analysis = Analysis(Given(model, states, **parameters))
    analysis.run()
    return analysis.outcome, summary_of(analysis.outcome)


@pytest.fixture(scope="module")
def ur5():
    return dd.load_robot("ur5")


@pytest.fixture(scope="module")
def motion(ur5):
    """Six seconds of a UR5 at 500 Hz under efforts that are held for 2 ms, by an integrator of order 4."""
    return simulated(ur5)


def simulated(model, push=None, seconds=6.0):
    """Times, positions, velocities and efforts of a model under gravity compensation, damping and sines."""
    rng = np.random.default_rng(4)
    dynamics, n = dd.DiagonalDynamics(model), model.nv
    q, qd = np.zeros(n) + 0.3, np.zeros(n)
    phase, period = rng.uniform(0.0, 6.0, n), 0.002
    simulation = dd.Simulation(model, q, qd, step=period)
    rows = []
    for k in range(int(seconds / period)):
        t = k * period
        q, qd = simulation.q.copy(), simulation.qd.copy()
        tau = dynamics.gravity_torque(q) + 8.0 * np.sin(3.0 * t + phase) * (np.arange(n) < 3) - 6.0 * qd
        rows.append((t, q, qd, tau))
        simulation.advance(tau if push is None else tau + push(t), 1)
    return tuple(map(np.array, zip(*rows, strict=True)))


# --- Balance of power ---


def test_right_model_explains_nearly_all(ur5, motion):
    outcome, summary = analysed(ur5, states_of(*motion))
    assert summary["explained"] > 0.995
    assert summary["explained_with_potential"] > 0.995
    assert summary["residual_power"] < 0.05 * np.sqrt(outcome.balance.kinetic.square)
    assert "explain" in summary["balance"]["says"]
    assert "check" not in summary["balance"]["says"]


def test_wrong_units_explain_nothing(ur5, motion):
    t, q, qd, tau = motion
    _, summary = analysed(ur5, states_of(t, q, qd, 0.1 * tau))
    assert summary["explained"] < 0.0
    assert summary["balance"]["says"].startswith("the balance explains nothing")
    assert "unit of efforts" in text_of(summary)


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda tau, gravity: -tau, "the efforts seem to have the wrong sign: times -1 "),
        (lambda tau, gravity: tau * [1, -1, 1, 1, 1, 1], "efforts of some joints seem to have the wrong sign"),
        (lambda tau, gravity: tau / 11.4, "another unit: times 11.4 "),
        (lambda tau, gravity: tau - gravity, "gravity seems not to be in the efforts (effort_includes_gravity)"),
        (lambda tau, gravity: tau, None),
        (lambda tau, gravity: tau + 12.0 * np.sin(np.arange(len(tau)))[:, None], None),
    ],
    ids=["sign", "a joint's sign", "unit", "gravity", "right", "noise"],
)
def test_likely_cause_is_named(ur5, motion, change, said):
    t, q, qd, tau = motion
    changed = change(tau, dd.DiagonalDynamics(ur5).gravity_torque_batch(q))
    _, summary = analysed(ur5, states_of(t, q, qd, changed))
    assert ("seem" in summary["balance"]["says"]) == (said is not None)
    assert (said or "") in " ".join(text_of(summary).split())


def test_nothing_is_said_of_a_robot_at_rest(ur5, motion):
    """Noise is no motion: neither is the balance poor, nor are velocities wrong."""
    t, q, _, _ = motion
    rng = np.random.default_rng(3)
    q = np.tile(q[0], (len(t), 1))
    tau = dd.DiagonalDynamics(ur5).gravity_torque_batch(q) + 0.05 * rng.standard_normal(q.shape)
    states = states_of(t, q + 1e-5 * rng.standard_normal(q.shape), 1e-3 * rng.standard_normal(q.shape), tau)
    _, summary = analysed(ur5, states)
    assert summary["explained"] is summary["explained_with_potential"] is None
    assert "No balance of power: the robot is at rest" in text_of(summary)
    assert summary["warnings"] == []


def test_why_there_is_no_balance(ur5, motion):
    t, q, qd, tau = motion
    _, summary = analysed(ur5, states_of(200.0 * t, q, qd, tau))
    assert "No balance of power: there are 0 windows" in text_of(summary)
    assert any("0.4 s apart" in one for one in summary["warnings"])
    _, summary = analysed(ur5, states_of(t, q, qd))
    assert "No balance of power: no efforts." in text_of(summary)


def test_fault_is_found_at_its_joint(ur5, motion):
    """Friction of one drive that the model does not know is missing at its total rate."""
    t, q, qd, tau = motion
    tau = tau.copy()
    tau[:, 1] += 12.0 * np.tanh(qd[:, 1] / 0.005)
    _, summary = analysed(ur5, states_of(t, q, qd, tau))
    joints = summary["balance"]["joints"]
    assert max(joints, key=lambda name: joints[name]["share"]) == ur5.dof_names[1]


def test_windows_are_sums_of_their_states(ur5, motion):
    """Against sums by NumPy over the windows' own times, cut anywhere into pieces."""
    t, q, qd, tau = motion
    states, dynamics = states_of(t, q, qd, tau), dd.DiagonalDynamics(ur5)
    s = dynamics.evaluate_batch(q, qd, tau, friction=True)
    whole = WindowSums(ur5.nv, True).take(states, s)
    pieces, sums = [], WindowSums(ur5.nv, True)
    for part in np.split(np.arange(len(t)), [7, 500, 501, 1777]):
        one = slice(part[0], part[-1] + 1)
        pieces.append(sums.take(states.part(one), dynamics.evaluate_batch(q[one], qd[one], tau[one], friction=True)))
    for name in whole._fields:
        joined = np.concatenate([getattr(piece, name) for piece in pieces])
        np.testing.assert_allclose(joined, getattr(whole, name), rtol=1e-9, atol=1e-12, err_msg=name)
    assert len(whole.end) == 58  # of the first tenth it is not known whether it is whole
    K, power = s.kinetic_energy, {"effort": s.epsilon, "gravity": s.gravity, "friction": s.friction}
    for w in range(len(whole.end)):
        first, last = np.searchsorted(states.newest, [whole.begin[w], whole.end[w]])
        span, inside = t[last] - t[first], slice(first, last + 1)
        assert span == pytest.approx(0.1, abs=0.0021)
        assert whole.kinetic[w] == pytest.approx((K[last] - K[first]) / span, rel=1e-9, abs=1e-9)
        for name, terms in power.items():
            rate = np.einsum("tk,tk->t", s.nu[inside], terms[inside])
            expected = np.trapezoid(rate, t[inside]) / span
            assert getattr(whole, name)[w] == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_windows_begin_anew_after_gaps_and_without_efforts(ur5, motion):
    t, q, qd, tau = motion
    t, tau = t.copy(), tau.copy()
    t[1000:] += 0.7
    tau[2000:2200] = np.nan
    windows = WindowSums(ur5.nv).take(
        states_of(t, q, qd, tau), dd.DiagonalDynamics(ur5).evaluate_batch(q, qd, np.nan_to_num(tau))
    )
    begin, end = (1e-9 * stamps - 1.0 for stamps in (windows.begin, windows.end))
    assert len(begin) > 30
    assert (np.abs(end - begin - 0.1) < 0.0021).all()
    assert not ((begin < t[999] + 1e-6) & (end > t[1000] - 1e-6)).any()
    assert not ((begin < t[2200] - 1e-6) & (end > t[2000] - 1e-6)).any()


def test_moments_of_pieces():
    rng = np.random.default_rng(1)
    values = 1e3 + rng.normal(size=(1000, 3))
    one, other = Moments(3), Moments(3)
    for part in np.split(values, [0, 1, 300]):
        one.take(part)
    for part in np.split(values, [500]):
        piece = Moments(3)
        piece.take(part)
        other.add(piece)
    for moments in (one, other):
        np.testing.assert_allclose(moments.variance, values.var(axis=0), rtol=1e-12)
        np.testing.assert_allclose(moments.square, (values**2).mean(axis=0), rtol=1e-12)


# --- Observer ---


def test_observer_is_that_of_single_states(ur5, motion):
    """To the last bit, over gaps, lost efforts, equal stamps and jumps, cut anywhere."""
    t, q, qd, tau = (x.copy() for x in motion)
    t = np.arange(len(t)) / 512.0  # differences of these are what they are in nanoseconds, to the last bit
    t[700:] += 0.5
    t[900:903] = t[900]
    tau[100:140] = np.nan
    moved = np.zeros(len(t), dtype=bool)
    moved[1500] = True
    states = states_of(t, q, qd, tau, moved)
    dynamics = dd.DiagonalDynamics(ur5)
    observer = Observer(dynamics, 30.0, 0.4, friction=True)
    pieces = [
        observer.take(
            states.part(part), dynamics.evaluate_batch(q[part], qd[part], np.nan_to_num(tau[part]), friction=True)
        )
        for part in np.split(np.arange(len(t)), [3, 720, 901])
    ]
    residual, torque, norm, valid, collision = map(np.concatenate, zip(*pieces, strict=True))
    single = dd.DisturbanceObserver(dynamics, 30.0, 0.4, friction=True)
    for k in range(len(t)):
        if moved[k]:
            single.reset()
        seen = single.update(t[k], q[k], qd[k], tau[k])
        assert seen.valid == valid[k], k
        if seen.valid:
            np.testing.assert_array_equal(seen.residual, residual[k])
            np.testing.assert_array_equal(seen.external_torque, torque[k])
            assert seen.norm == pytest.approx(norm[k], rel=1e-14)
            assert seen.collision == collision[k]
        else:
            assert np.isnan(residual[k]).all()
    assert valid.sum() > 2000
    assert not valid.all()


def test_a_push_is_a_collision(ur5):
    def push(t):
        return np.array([0.0, 25.0, 0.0, 0.0, 0.0, 0.0]) * (2.0 <= t < 2.4)

    t, q, qd, tau = simulated(ur5, push, 4.0)
    values = {"external_torque.gain": 25.0, "external_torque.threshold": 3.0}
    _, summary = analysed(ur5, states_of(t, q, qd, tau), **values)
    (collision,) = summary["collisions"]
    assert 2.0 < collision["start"] < 2.1
    assert 2.4 < collision["end"] < 2.6
    assert collision["norm"] > 3.0
    assert ur5.dof_names[1] in collision["joints"]
    assert summary["peaks"]["external_torque"]["value"] == pytest.approx(25.0, rel=0.02)
    assert "1 collision above" in text_of(summary)
    told = "the power of a push is in no effort" in " ".join(text_of(summary).split())
    assert told == (summary["explained"] < 0.8)
    assert told  # a push of 25 N m is far more than what moves this arm


def test_observe(ur5, motion):
    t, q, qd, tau = motion
    recording = Recording(ur5, states_of(t, q, qd, tau), S, {}, [])
    dynamics = dd.DiagonalDynamics(ur5)
    seen = dd.observe(dynamics, recording, gain=25.0)
    assert seen.residual.shape == seen.external_torque.shape == (len(t), ur5.nv)
    assert not seen.valid[0]
    assert seen.valid[1:].all()
    np.testing.assert_allclose(seen.t, t, atol=1e-9)
    assert np.nanmax(np.abs(seen.external_torque)) < 0.5  # nobody pushes: what is left is of the sampling
    with pytest.raises(dd.InputError, match="efforts"):
        dd.observe(dynamics, Recording(ur5, states_of(t, q, qd), S, {}, []))
    with pytest.raises(dd.InputError, match="panda"):
        dd.observe(dd.DiagonalDynamics(dd.load_robot("panda")), recording)


# --- Peaks, and what cannot be evaluated ---


def test_peaks_are_the_largest(ur5, motion):
    t, q, qd, tau = motion
    _, summary = analysed(ur5, states_of(t, q, qd, tau))
    s = dd.DiagonalDynamics(ur5).evaluate_batch(q, qd, tau)
    energy, k = summary["kinetic_energy"], int(np.argmax(s.kinetic_energy))
    assert energy["max"] == s.kinetic_energy[k]
    assert energy["at"] == pytest.approx(t[k], abs=1e-9)
    assert energy["mean"] == pytest.approx(s.kinetic_energy.mean(), rel=1e-12)
    assert energy["share"] == dict(zip(ur5.dof_names, s.energy_share.max(axis=0).tolist(), strict=True))
    at = np.unravel_index(np.argmax(np.abs(tau)), tau.shape)
    assert summary["peaks"]["effort"]["value"] == np.abs(tau[at])
    assert summary["peaks"]["effort"]["of"] == ur5.dof_names[at[1]]
    assert summary["states"] == len(t)
    assert summary["duration"] == pytest.approx(t[-1], abs=1e-8)
    json.dumps(summary, allow_nan=False)


def test_without_efforts(ur5, motion):
    t, q, qd, _ = motion
    _, summary = analysed(ur5, states_of(t, q, qd))
    assert summary["explained"] is summary["residual_power"] is None
    assert summary["collisions"] == []
    assert summary["quality"]["without_effort"] == len(t)
    assert "No balance of power" in text_of(summary)
    json.dumps(summary, allow_nan=False)


def test_states_that_cannot_be_evaluated_are_rejected(ur5, motion):
    t, q, qd, tau = (x.copy() for x in motion)
    qd[40], qd[2000] = 1e200, 1e200
    _, summary = analysed(ur5, states_of(t, q, qd, tau))
    assert summary["states"] == len(t) - 2
    (finding,) = [one for one in summary["findings"] if one["cause"].startswith("rejected")]
    assert finding["count"] == 2


# --- Quality ---


@pytest.mark.parametrize(
    "change, said",
    [
        (
            lambda t, q, qd: (1e3 * t, q, qd),
            "all joints: positions change 0.001 times as fast as velocities say: times seem",
        ),
        (lambda t, q, qd: (1e6 * t, q, qd), "times seem to be microseconds"),
        (lambda t, q, qd: (t, q, np.degrees(qd)), "velocities seem to be in degrees"),
        (lambda t, q, qd: (t, np.degrees(q), qd), "positions seem to be in degrees"),
        (lambda t, q, qd: (t, q, qd * [1, 1, -1, 1, 1, 1]), "elbow_joint: positions change -1 times as fast"),
        (lambda t, q, qd: (t, q, 3.0 * qd), "seem to have a wrong unit"),
        (lambda t, q, qd: (t, q, qd), None),
    ],
    ids=["ms", "us", "deg/s", "deg", "sign", "3", "right"],
)
def test_units_that_do_not_agree_are_named(ur5, motion, change, said):
    t, q, qd, _ = motion
    _, summary = analysed(ur5, states_of(*change(t, q, qd)))
    told = [one for one in summary["warnings"] if "times as fast as velocities say" in one]
    assert len(told) == (said is not None)
    assert (said or "") in "".join(told)


def quality_of(model, *columns, cuts=(900, 901)):
    quality = Quality(model)
    for part in np.split(np.arange(len(columns[0])), cuts):
        quality.take(states_of(*columns).part(part))
    return quality, quality.report()


def test_good_data_is(ur5, motion):
    quality, report = quality_of(ur5, *motion)
    assert report["rate"] == pytest.approx(500.0, rel=0.02)
    assert report["jitter"] < 2e-5
    assert report["gaps"] == report["repeated_states"] == report["without_effort"] == 0
    assert all(of["velocity_error"] < 1e-3 and not of["clipped"] for of in report["joints"].values())
    assert quality.warnings() == []


@pytest.mark.parametrize("delay", [0.006, -0.004, 0.02])
def test_late_velocities_are_told_of(ur5, motion, delay):
    t, q, qd, tau = motion
    late = np.column_stack([np.interp(t - delay, t, column) for column in qd.T])
    quality, report = quality_of(ur5, t[50:-50], q[50:-50], late[50:-50], tau[50:-50])
    assert report["velocity_delay"] == pytest.approx(delay, rel=0.1)
    assert any(("late" if delay > 0 else "early") in text for text in quality.warnings())


def test_steps_of_an_encoder_are_no_disagreement(ur5, motion):
    t, q, qd, tau = motion
    step = 1e-4
    _, report = quality_of(ur5, t, np.round(q / step) * step, qd, tau)
    moving = [of for of in report["joints"].values() if of["largest_velocity"] > 0.2]
    assert moving
    assert all(of["velocity_error"] < 0.05 for of in moving)


def test_gaps_repeats_and_bounds(ur5, motion):
    t, q, qd, tau = (x.copy() for x in motion)
    t[1500:] += 0.05
    q[100:160], qd[100:160], tau[100:160] = q[99], qd[99], tau[99]
    tau[:, 0] = np.clip(tau[:, 0], -3.0, 3.0)
    quality, report = quality_of(ur5, t, q, qd, tau)
    assert report["gaps"] == 1
    assert report["longest_gap"] == pytest.approx(0.052, abs=1e-6)
    assert report["longest_gap_at"] == pytest.approx(t[1499] * 1e9 + S, abs=2)
    assert report["repeated_states"] == 60
    assert report["joints"][ur5.dof_names[0]]["clipped"] == ["effort"]
    assert all(not of["clipped"] for name, of in report["joints"].items() if name != ur5.dof_names[0])
    told = " ".join(quality.warnings())
    assert "clipped" in told
    assert "gap" in told
    assert "repeat" in told


def test_times_that_lack_digits_are_told_of(ur5, motion):
    t, q, qd, tau = motion
    quality, report = quality_of(ur5, np.round(t, 1), q, qd, tau)
    assert report["repeated_stamps"] > 0.9 * len(t)
    assert any("times need more digits" in text for text in quality.warnings())


def test_text_for_people(ur5, motion):
    """Lines fit, no unit is apart from its number, times are from the first state on, and faults come before notes."""
    t, q, qd, tau = motion
    _, summary = analysed(ur5, states_of(t + 1.7e9, q, qd, 0.1 * tau))
    notes = [{"cause": "note", "count": 1, "text": f"note {k}."} for k in range(6)]
    summary["findings"] = [*notes, {"cause": "rejected: late", "count": 7, "text": "a message came late"}]
    at = summary["kinetic_energy"]["at"] - summary["begin"]
    for width in (40, 80, 100):
        lines = text_of(summary, width).split("\n")
        assert max(map(len, lines)) <= width
        assert not any(line.split()[0].rstrip(",;") in {"J", "W", "s"} for line in lines if line)
        flat = " ".join(line.strip() for line in lines)
        assert f"J at {at:.3f} s, " in flat
        assert "rejected: late (7 ×): a message came late" in flat
        assert flat.index("came late") < flat.index("How it was read") < flat.index("note 0.")
        assert "note (1" not in flat


def test_observing_without_states_says_so(ur5):
    nothing = Recording(ur5, States.none(ur5), 0, {}, [])
    with pytest.raises(dd.InputError, match="no states"):
        dd.observe(dd.DiagonalDynamics(ur5), nothing)


def test_velocities_in_degrees_are_told_of(ur5, motion):
    t, q, qd, tau = motion
    quality, _ = quality_of(ur5, t, q, np.degrees(qd), tau)
    assert sum("not the slope" in text for text in quality.warnings()) >= 3


def test_time_above_limits_of_contact_and_worst_moments(ur5, motion, tmp_path):
    """Sums and maxima over single calls of the library; in pieces as in one; nothing of it without limits."""
    t, q, qd, tau = motion
    points = dd.ContactPoints(ur5, dd.link_geometry(ur5, find_urdf("ur5")).points, None)
    energy = dd.DiagonalDynamics(ur5).contact_batch(q, qd, points).energy
    limit = float(np.quantile(energy.max(axis=1), 0.7))
    path = tmp_path / "limits.yaml"
    path.write_text(f"regions: {{any: {{energy: {limit!r}}}}}")
    outcome, summary = analysed(ur5, states_of(t, q, qd, tau), **{"contact.limits_file": str(path)})
    contact = summary["contact"]
    since = np.diff(t, prepend=t[0])
    assert contact["above"] == pytest.approx(since @ (energy > limit).any(axis=1), rel=1e-6)
    assert contact["of"] == pytest.approx(t[-1] - t[0])
    by_point = {name: since @ (energy[:, k] > limit) for k, name in enumerate(points.names)}
    assert contact["above_by_point"] == pytest.approx({name: s for name, s in by_point.items() if s}, rel=1e-6)
    worst = contact["worst"]
    k = np.unravel_index(np.argmax(energy), energy.shape)
    assert worst[0]["at"] == pytest.approx(t[k[0]]) and worst[0]["usage"] == pytest.approx(np.sqrt(energy[k] / limit))
    assert worst[0]["energy"] == pytest.approx(energy[k]) and worst[0]["region"] == "any"
    usages, times = [one["usage"] for one in worst], np.array([one["at"] for one in worst])
    assert usages == sorted(usages, reverse=True) and len(worst) == 5
    assert np.abs(times[:, None] - times)[~np.eye(5, dtype=bool)].min() >= 1.0 - 1e-9
    assert f"{worst[0]['point']} at" in text_of(summary) and "Limits of contact exceeded for" in text_of(summary)
    json.dumps(summary, allow_nan=False)
    half = len(t) // 2
    first, _ = analysed(ur5, states_of(t[:half], q[:half], qd[:half], tau[:half]), **{"contact.limits_file": str(path)})
    rest, _ = analysed(ur5, states_of(t[half:], q[half:], qd[half:], tau[half:]), **{"contact.limits_file": str(path)})
    first.touches.add(rest.touches)
    assert first.touches.any_above == pytest.approx(outcome.touches.any_above, abs=0.003)
    assert first.touches.moments[0] == outcome.touches.moments[0]
    assert analysed(ur5, states_of(t, q, qd, tau))[1]["contact"] is None
