# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analysis of recordings: figures are those of single calls, of NumPy and of motions whose truth is
known.
"""

import json
import re
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

import diag_dynamics as dd
from commands import quiet_compiler  # noqa: F401 (a fixture of all tests here)
from described import S
from diag_dynamics.cli.main import main
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.recordings.balance import Balance, Windows
from diag_dynamics.recordings.data_checks import EffortRange
from diag_dynamics.recordings.recording import Reading
from robots import TwoLinkArm

LOOSE = [
    "plausibility.jump=0",
    "plausibility.beyond_limits=0",
    "plausibility.beyond_velocity=0",
    "stuck_timeout=0",
]
"""Parameters that accept velocities and positions in wrong units."""


@pytest.fixture(scope="module")
def ur5():
    return dd.load_robot("ur5")


@pytest.fixture(scope="module")
def motion(ur5):
    """Times, positions, velocities and efforts of four seconds of a UR5 at 500 Hz."""
    return simulated(ur5)


@pytest.fixture(scope="module")
def gravity(ur5, motion):
    return dd.DiagonalDynamics(ur5).gravity_torque(motion[1])


def simulated(model, push=None, seconds=4.0):
    """Return times, positions, velocities and efforts under gravity compensation, damping and
    sines.
    """
    rng = np.random.default_rng(4)
    dynamics = dd.DiagonalDynamics(model)
    n = model.nv
    phase = rng.uniform(0.0, 6.0, n)
    period = 0.002
    simulation = dd.Simulation(model, np.full(n, 0.3), np.zeros(n), step=period)
    rows = []
    for k in range(int(seconds / period)):
        t = k * period
        q = simulation.q.copy()
        qd = simulation.qd.copy()
        tau = (
            dynamics.gravity_torque(q)
            + 8.0 * np.sin(3.0 * t + phase) * (np.arange(n) < 3)
            - 6.0 * qd
        )
        rows.append((t, q, qd, tau))
        simulation.advance(tau if push is None else tau + push(t), 1)
    return tuple(map(np.array, zip(*rows, strict=True)))


def broken(motion):
    """Return the motion with a gap, efforts that are missing for a time and at one state, a jump
    and repeated states.
    """
    t, q, qd, tau = (x.copy() for x in motion)
    t = np.arange(len(t)) / 512.0  # differences of these are exact in nanoseconds
    t[700:] += 0.5
    tau[100:140] = np.nan
    tau[300, 2] = np.nan
    tau[1495:1510] = np.nan
    tau[:, 0] = np.clip(tau[:, 0], -3.0, 3.0)
    q[1500:] += 0.3
    t, q, qd, tau = (np.insert(x, 900, x[899], axis=0) for x in (t, q, qd, tau))
    qd[900] += 0.01
    return t, q, qd, tau


def write_columns(path, t, q, qd, tau=None):
    """Write columns as npz; return the path."""
    np.savez(path, t=t, q=q, qd=qd, **({} if tau is None else {"tau": tau}))
    return path


@pytest.fixture
def analysed(tmp_path, capsys):
    """Run `analyse` on columns of a UR5; return the summary, all that is printed, and the exit
    status.
    """

    def run(*columns, parameters=()):
        path = write_columns(tmp_path / "x.npz", *columns)
        out = tmp_path / "summary.json"
        options = [word for parameter in parameters for word in ("--set", parameter)]
        status = main(["analyse", str(path), "--urdf", "ur5", "--json", str(out), *options])
        return json.loads(out.read_text()), " ".join("".join(capsys.readouterr()).split()), status

    return run


# --- Balance of power ---

FAULTS = {
    "none": (lambda tau, gravity: tau, None),
    "unit": (
        lambda tau, gravity: tau / 11.4,
        "another unit: they are 0.0863 times the model torque",
    ),
    "noise": (lambda tau, gravity: tau + 12.0 * np.sin(np.arange(len(tau)))[:, None], None),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_balance_names_the_likely_cause(analysed, motion, gravity, fault):
    t, q, qd, tau = motion
    change, printed = FAULTS[fault]
    summary, text, status = analysed(t, q, qd, change(tau, gravity))
    assert bool(summary["efforts"]["text"]) == (printed is not None)
    assert (printed or "") in text and status == (printed is not None)
    if fault == "none":
        assert summary["explained"] > 0.995 and summary["explained_with_potential"] > 0.995
        assert "check" not in summary["balance"]["text"] and summary["warnings"] == []
    elif printed:
        assert summary["explained"] < 0.3 and "check unit of the efforts" in text
        assert "the power balance explains less than 80 % of dK/dt" in text


def test_why_there_is_no_balance(analysed, motion, gravity):
    """At rest noise is no motion, so neither is the balance poor, nor are velocities wrong."""
    t, q, qd, tau = motion
    noise = np.random.default_rng(3).standard_normal((3, *q.shape))
    summary, text, _ = analysed(
        t, q[0] + 1e-5 * noise[0], 1e-3 * noise[1], gravity[0] + 0.05 * noise[2]
    )
    assert summary["explained"] is summary["explained_with_potential"] is None
    assert "No power balance: no joint moves" in text and summary["warnings"] == []
    summary, text, status = analysed(200.0 * t, q, qd, tau, parameters=LOOSE)
    assert "No power balance: 0 windows" in text and status == 1
    assert any("0.4 s apart" in warning for warning in summary["warnings"])
    summary, text, _ = analysed(t, q, qd)
    assert "No power balance: no efforts." in text and "Collisions are unknown: no state of" in text
    assert summary["explained"] is summary["residual_power"] is None and summary["collisions"] == []
    assert summary["quality"]["without_effort"] == len(t)


def test_a_standing_arm_has_no_balance(analysed, gravity, motion):
    """Pushes move it by up to 0.04 rad, and their power is in no effort: this is no fault of its
    model.
    """
    t = motion[0]
    q = motion[1]
    bump = np.sin(2.0 * t[:, None]) ** 8 * np.linspace(0.02, 0.04, 6)
    rate = np.gradient(bump, t, axis=0)
    noise = 0.05 * np.random.default_rng(0).standard_normal(q.shape)
    summary, text, status = analysed(t, q[0] + bump, rate, gravity[0] + noise)
    assert summary["explained"] is None and "explain only" not in text and status == 0
    summary, text, status = analysed(t, q[0] + 3.0 * bump, 3.0 * rate, gravity[0] + noise)
    assert summary["explained"] < 0.3 and status == 1


def test_collisions_of_a_standing_arm_explain_its_balance(analysed, gravity, motion):
    """A push by 0.2 rad is no fault of the model, unless nothing reports it."""
    t = motion[0]
    q = motion[1]
    bump = 0.2 * np.exp(-(((t - 2.0) / 0.2) ** 2))[:, None] * np.linspace(0.5, 1.0, 6)
    noise = 0.05 * np.random.default_rng(0).standard_normal(q.shape)
    columns = t, q[0] + bump, np.gradient(bump, t, axis=0), gravity[0] + noise
    for threshold, expected in ((1.0, 0), (1e3, 1)):
        parameters = "external_torque.gain=25", f"collision.threshold=norm={threshold}"
        summary, text, status = analysed(*columns, parameters=parameters)
        assert (
            bool(summary["collisions"]) == ("collisions explain the rest" in text) == (not expected)
        )
        assert summary["explained"] < 0.8 and status == expected


def test_windows_near_collisions_explain_nothing():
    """Those within 0.2 s of one are left out, unless collisions last for half of the time."""
    stamps = np.arange(101) * S // 10
    none = np.zeros(100)
    kinetic = np.resize([1.0, -1.0], 100)
    friction = none + 0.5
    cases = (30, 34, True), (29, 34, False), (35, 34, True), (36, 34, False), (31, 90, False)
    for wrong, end, expected in cases:
        effort = kinetic + friction - 5.0 * np.isin(np.arange(100), [31, wrong])
        columns = stamps[:-1], stamps[1:], kinetic, effort, none, friction
        balance = Balance()
        balance.add_windows(Windows(*columns))
        collision = SimpleNamespace(start=32 * S // 10, end=end * S // 10)
        assert balance.is_explained_beside([collision]) == expected
    few = Balance()
    few.add_windows(Windows(*(column[:19] for column in columns)))
    assert few.explained is None is few.residual_power


def test_a_joint_that_stands_is_not_judged_by_its_velocity(analysed, motion):
    t, q, qd, tau = (entry.copy() for entry in motion)
    q[:, 5] = 4e-4 * np.sin(t)
    qd[:, 5] = 2e-4 * np.cos(t)
    summary, text, _ = analysed(t, q, qd, tau)
    assert "as fast as the velocities" not in text and summary["quality"]["wrong_unit"] is None


def test_coordinates_of_a_floating_base_need_no_effort():
    """They move far without an effort; an elbow without one is named."""
    model = dd.load_robot("ur5", floating_base=True)
    rng = np.random.default_rng(3)
    efforts = rng.normal(size=(50, model.nv))
    efforts[:, :6] = 0.0
    for names in ([], ["elbow_joint"]):
        efforts[:, [model.dof_names.index(name) for name in names]] = 0.0
        effort_range = EffortRange(model)
        effort_range.add_values(rng.normal(size=(50, model.nv)), efforts)
        assert effort_range.measures and effort_range.groups() == ({"0": names} if names else {})


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (np.nan, "efforts of wrist_1_joint are missing or implausible throughout"),
        (0.0, "efforts of wrist_1_joint are 0 throughout"),
        (2.5, "efforts of wrist_1_joint are constant throughout"),
    ],
)
def test_efforts_of_a_joint_that_were_not_measured(analysed, motion, value, said):
    """They leave its external torque unknown, |r| and the balance; the other joints are judged."""
    t, q, qd, tau = motion
    tau = tau.copy()
    tau[:, 3] = value
    summary, text, result = analysed(t, q, qd, tau)
    assert said in text
    assert said in summary["efforts"]["unmeasured"]
    assert said in summary["warnings"][0]
    assert result == 1
    assert summary["explained"] is None
    assert f"No power balance: {said}" in " ".join(text.split())
    hint = re.search(r"\((effort_available): ([^)]+)\)", summary["warnings"][0])
    partial, _, status = analysed(t, q, qd, tau, parameters=[f"{hint[1]}={hint[2]}"])
    assert "wrist_1_joint" not in partial["balance"]["partial"] and partial["explained"] > 0.9
    assert status == 0 and len(partial["balance"]["partial"]) == 5
    assert summary["observer"]["unobserved"] == ["wrist_1_joint"]
    assert summary["observer"]["observed"] == len(t) - 1
    assert summary["peaks"]["external_torque"]["value"] > 0.0
    assert "residual_norm" not in summary["peaks"]


def windows_by_numpy(model, t, q, qd, tau):
    """Return mean powers over windows at multiples of 0.1 s [W]: dK/dt, the residual, and that of
    gravity.
    """
    s = dd.DiagonalDynamics(model).evaluate(q, qd, np.nan_to_num(tau), friction=True)
    is_known = np.isfinite(tau).all(axis=1)
    gravity, friction = ((s.nu * x).sum(axis=1) for x in (s.gravity, s.friction))
    power = np.column_stack([s.effort_power - friction, -gravity])[is_known]
    K = np.column_stack([s.kinetic_energy, 0.0 * gravity])[is_known]
    t = t[is_known]
    begins = np.flatnonzero(np.diff(np.floor(np.round(t * 1e9) / 1e8))) + 1
    result = []
    for first, last in pairwise(begins):
        if np.diff(t[first : last + 1]).max() <= 0.1 and np.diff(t[first - 1 : first + 1]) <= 0.1:
            span = t[last] - t[first]
            inside = slice(first, last + 1)
            change = (K[last] - K[first]) / span
            result.append(
                (change[0], *(change - np.trapezoid(power[inside], t[inside], axis=0) / span))
            )
    return np.array(result).T


@pytest.mark.parametrize("gaps", [False, True])
def test_explained_share_is_that_of_windows_by_numpy(analysed, ur5, motion, gaps):
    """Windows begin anew after gaps, and where efforts were missing."""
    t, q, qd, tau = (x.copy() for x in motion)
    tau *= 1.2
    if gaps:
        t[1000:] += 0.7
        tau[1500:1600] = np.nan
    summary, *_ = analysed(t, q, qd, tau, parameters=LOOSE)
    kinetic, residual, gravity = windows_by_numpy(ur5, t, q, qd, tau)
    assert summary["balance"]["windows"] == len(kinetic)
    for key, change in (("explained", kinetic), ("explained_with_potential", kinetic + gravity)):
        assert summary[key] == pytest.approx(1.0 - residual.var() / change.var(), rel=1e-6)
    assert summary["residual_power"] == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-6)


# --- Figures ---


def leaves(value):
    """Return all texts and numbers of a summary in order, with their keys."""
    pairs = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else None
    )
    return (
        [value]
        if pairs is None
        else [leaf for key, entry in pairs for leaf in (key, *leaves(entry))]
    )


@pytest.mark.parametrize("size", [1, 100])
def test_batches_do_not_matter(analysed, ur5, motion, monkeypatch, tmp_path, size):
    """Windows, observer, neighbours, collisions and the worst contact go on from batch to batch."""
    columns = [x if size > 1 else x[np.r_[600:920, 1450:1600]] for x in broken(motion)]
    (tmp_path / "limits.yaml").write_text("regions: {any: {energy: 0.5}}")
    options = [
        "external_torque.gain=25",
        "collision.threshold=norm=1",
        f"contact_limits.file={tmp_path}/limits.yaml",
    ]
    options += noise_parameters(ur5, 0.1)
    whole, *_ = analysed(*columns, parameters=options)
    pieces = Reading.pieces

    def small(reading):
        for states in (piece.states for piece in pieces(reading)):
            for first in range(0, len(states), size):
                yield SimpleNamespace(states=states[first : first + size])

    monkeypatch.setattr(Reading, "pieces", small)
    parts, *_ = analysed(*columns, parameters=options)
    for entry, other in zip(leaves(parts), leaves(whole), strict=True):
        assert entry == (
            pytest.approx(other, rel=1e-9, abs=1e-11) if isinstance(other, float) else other
        )
    assert any(entry["link"] for entry in whole["collisions"])
    assert whole["collisions"]
    assert whole["balance"]["windows"] > 4
    assert whole["quality"]["repeated_stamps"] == 1


def test_figures_are_the_largest_and_the_means(analysed, ur5, motion):
    """States that cannot be evaluated are rejected."""
    t, q, qd, tau = motion
    s = dd.DiagonalDynamics(ur5).evaluate(q, qd, tau)
    columns = [np.insert(x, 1500, x[1499], axis=0) for x in motion]
    columns[0][1500] = t[1499] + 1e-6
    columns[2][1500] = 1e200
    summary, *_ = analysed(*columns, parameters=LOOSE)
    assert [
        finding["count"]
        for finding in summary["findings"]
        if finding["cause"].startswith("rejected")
    ] == [1]
    energy = summary["kinetic_energy"]
    k = int(np.argmax(s.kinetic_energy))
    assert energy["max"] == s.kinetic_energy[k] and energy["at"] == pytest.approx(t[k], abs=1e-9)
    assert energy["mean"] == pytest.approx(s.kinetic_energy.mean(), rel=1e-12)
    assert energy["share"] == dict(
        zip(ur5.dof_names, s.energy_share.max(axis=0).tolist(), strict=True)
    )
    assert summary["states"] == len(t)
    at = np.unravel_index(np.argmax(np.abs(tau)), tau.shape)
    assert summary["peaks"]["effort"] | {"at": 0} == {
        "value": np.abs(tau[at]),
        "of": ur5.dof_names[at[1]],
        "at": 0,
    }
    assert summary["duration"] == pytest.approx(t[-1], abs=1e-8)


# --- Observer and contact ---


def test_observer_is_that_of_single_states(tmp_path, ur5, motion):
    """To the last bit, over gaps, lost efforts, jumps and repeated stamps."""
    recording = dd.read_recording(write_columns(tmp_path / "x.npz", *broken(motion)), ur5)
    dynamics = dd.DiagonalDynamics(ur5)
    states = recording.states
    seen = dd.observe(dynamics, recording, 30.0)
    single = dd.DisturbanceObserver(dynamics, 30.0, friction=True)
    for k, row in enumerate(zip(states.position, states.velocity, states.effort, strict=True)):
        if states.jumped[k]:
            single.reset()
        entry = single.update(recording.stamp[k] / 1e9, *row)
        assert entry.valid == seen.valid[k], k
        if entry.valid:
            np.testing.assert_array_equal(entry.residual, seen.residual[k])
            np.testing.assert_array_equal(entry.external_torque, seen.external_torque[k])
            assert entry.norm == pytest.approx(seen.norm[k], rel=1e-14, nan_ok=True)
        else:
            assert np.isnan(seen.residual[k]).all() and np.isnan(seen.norm[k])
    assert states.jumped.sum() == 1 and 1800 < seen.valid.sum() < len(recording) - 40


@pytest.mark.parametrize("value", [np.nan, 2.5])
def test_joints_are_observed_one_by_one(tmp_path, ur5, motion, value):
    """Torques of the others are those with all efforts; r is unknown from the joint with an unknown
    effort to the base.
    """
    t, q, qd, tau = motion
    pushed = tau - np.where(t[:, None] > 0.5 * t[-1], [0.0, 4.0, 0.0, 0.0, 1.0, 0.0], 0.0)
    part = np.where(np.arange(6) == 3, value, pushed)
    whole, some = (
        dd.observe(
            dd.DiagonalDynamics(ur5),
            dd.read_recording(write_columns(tmp_path / "x.npz", t, q, qd, entry), ur5),
        )
        for entry in (pushed, part)
    )
    is_known = np.arange(6) != 3
    np.testing.assert_array_equal(
        some.external_torque[:, is_known], whole.external_torque[:, is_known]
    )
    np.testing.assert_allclose(some.residual[:, 4:], whole.residual[:, 4:], rtol=1e-12, atol=1e-12)
    assert np.isnan(some.external_torque[:, 3]).all() and np.isnan(some.residual[:, :4]).all()
    np.testing.assert_array_equal(some.valid, whole.valid)
    assert np.isnan(some.norm).all()
    assert some.external_torque[-1, [1, 4]] == pytest.approx([4.0, 1.0], abs=0.3)


def test_observe_needs_efforts_and_the_same_robot(tmp_path, ur5, motion):
    t, q, qd, tau = (x[:100] for x in motion)
    recording = dd.read_recording(write_columns(tmp_path / "x.npz", t, q, qd, tau), ur5)
    seen = dd.observe(dd.DiagonalDynamics(ur5), recording, gain=25.0)
    assert not seen.valid[0] and seen.valid[1:].all()
    assert np.nanmax(np.abs(seen.external_torque)) < 0.5  # nobody pushes
    without = dd.read_recording(write_columns(tmp_path / "y.npz", t, q, qd), ur5)
    (tmp_path / "none.csv").write_text("t,q1,q2,q3,q4,q5,q6\n")
    nothing = dd.read_recording(tmp_path / "none.csv", ur5)
    panda = dd.load_robot("panda")
    for model, entry, what in (
        (ur5, without, "efforts"),
        (ur5, nothing, "no states"),
        (panda, recording, "panda"),
    ):
        with pytest.raises(dd.InputError, match=what):
            dd.observe(dd.DiagonalDynamics(model), entry)


def noise_parameters(ur5, deviation=0.5):
    """Parameters of a covariance without correlations."""
    joints = ",".join(ur5.dof_names)
    numbers = (deviation**2 * np.eye(6)).ravel().tolist()
    return [
        f"external_torque.covariance_joints=[{joints}]",
        f"external_torque.covariance={numbers}",
    ]


@pytest.mark.parametrize(
    "threshold", ["collision.threshold=norm=3", "collision.threshold=[elbow_joint=9]"]
)
def test_a_collision_has_a_touched_link(analysed, ur5, tmp_path, threshold):
    """Link and confidence are those at the largest χ² of the collision."""
    dynamics = dd.DiagonalDynamics(ur5)
    force = dynamics.jacobian(np.full(6, 0.3), "wrist_1_link")[:3].T @ [15.0, 30.0, -20.0]
    pushed = simulated(ur5, lambda t: force * (2.0 <= t < 2.2))
    parameters = ["external_torque.gain=25", threshold]
    summary, text, _ = analysed(*pushed, parameters=[*parameters, *noise_parameters(ur5)])
    (collision,) = summary["collisions"]
    recording = dd.read_recording(tmp_path / "x.npz", ur5)
    observed = dd.observe(dynamics, recording, 25.0)
    torque = np.nan_to_num(observed.external_torque)
    seen = dynamics.touched_link(recording.q, torque, 0.25 * np.eye(6))
    inside = (recording.t >= collision["start"]) & (recording.t <= collision["end"])
    k = int(np.argmax(np.where(inside, seen.chi_square, -1.0)))
    assert collision["link"] == seen.link[k] == "wrist_1_link"
    assert collision["confidence"] == seen.confidence[k] > 0.5
    assert f"touched wrist_1_link ({seen.confidence[k]:.0%})" in text
    summary, text, _ = analysed(*pushed, parameters=parameters)
    assert "link" not in summary["collisions"][0] and "touched wrist" not in text


def test_a_push_is_a_collision(analysed, ur5):
    def push(t):
        return np.array([0.0, 0.0, 25.0, 0.0, 0.0, 0.0]) * (2.0 <= t < 2.4)

    pushed = simulated(ur5, push)
    summary, text, _ = analysed(
        *pushed, parameters=["external_torque.gain=25", "collision.threshold=norm=3"]
    )
    (collision,) = summary["collisions"]
    assert 2.0 < collision["start"] < 2.1 and 2.4 < collision["end"] < 2.6
    # r is larger at the joint before
    assert collision["norm"] > 3.0 and collision["joints"] == ["elbow_joint"]
    assert summary["peaks"]["external_torque"]["value"] == pytest.approx(25.0, rel=0.02)
    assert "1 collision, by thresholds of norm" in text and summary["explained"] < 0.8
    assert "collisions explain the rest: no effort contains their power" in text
    summary, text, _ = analysed(
        *pushed, parameters=["external_torque.gain=25", "collision.threshold=[elbow_joint=9]"]
    )
    (collision,) = summary["collisions"]
    assert collision["text"] in text
    summary, text, _ = analysed(*pushed)  # unknown is no "none"
    missing = ["external_torque.gain", "collision.threshold"]
    assert summary["observer"]["missing"] == missing and "Collisions are unknown" in text


def test_a_dead_zone_leaves_unknown_residuals(analysed, ur5, tmp_path):
    """Stiction hides 0.2 N m of the last joint from r of joints before an unknown effort, too."""
    dd.Parameters.from_dict({"joints": {"wrist_3_joint": {"friction": 1.0}}}).save(tmp_path / "a")
    t = 0.004 * np.arange(500)
    q = np.full((500, 6), 0.3)
    tau = dd.DiagonalDynamics(ur5).gravity_torque(q) + 0.2 * np.eye(6)[5]
    tau[:, 3] = np.nan
    parameters = [f"parameters_file={tmp_path / 'a'}", "external_torque.gain=25"]
    parameters.append("collision.threshold=norm=0.1")
    for stiction, count in (("1.25", 0), ("0", 1)):
        chosen = [*parameters, f"collision.stiction={stiction}"]
        summary, _, _ = analysed(t, q, 0.0 * q, tau, parameters=chosen)
        assert len(summary["collisions"]) == count


def test_time_above_limits_of_contact_and_worst_moment(analysed, ur5, motion, tmp_path):
    """Sums and maxima over single calls of the library."""
    t, q, qd, tau = motion
    points = dd.ContactPoints(ur5, dd.link_geometry(ur5, find_urdf("ur5")).points, None)
    energy = dd.DiagonalDynamics(ur5).contact_limits(q, qd, points).energy
    limit = float(np.quantile(energy.max(axis=1), 0.7))
    path = tmp_path / "limits.yaml"
    path.write_text(f"regions: {{any: {{energy: {limit!r}}}}}")
    summary, text, _ = analysed(t, q, qd, tau, parameters=[f"contact_limits.file={path}"])
    contact = summary["contact_limits"]
    since = np.diff(t, prepend=t[0])
    assert contact["above"] == pytest.approx(since @ (energy > limit).any(axis=1), rel=1e-6)
    assert contact["of"] == pytest.approx(t[-1] - t[0])
    by_point = dict(zip(points.names, (since @ (energy > limit)).tolist(), strict=True))
    assert contact["above_by_point"] == pytest.approx(
        {name: s for name, s in by_point.items() if s}, rel=1e-6
    )
    worst = contact["worst"]
    k = np.unravel_index(np.argmax(energy), energy.shape)
    usage = np.sqrt(energy[k] / limit)
    assert [worst[key] for key in ("at", "usage", "energy")] == pytest.approx(
        [t[k[0]], usage, energy[k]]
    )
    assert worst["region"] == "any" and f"{worst['point']} at" in text


# --- Quality ---

UNITS = {
    "right": ((1, 1, 1), None, None),
    "days": ((1 / 86400, 1, 1), "times seem to be days, 86400 s each", 86400.0),
    "hours": ((1 / 3600, 1, 1), "times seem to be hours, 3600 s each", 3600.0),
    "minutes": ((1 / 60, 1, 1), "times seem to be minutes, 60 s each", 60.0),
    "ms": ((1e3, 1, 1), "times seem to be milliseconds", 1e-3),
    "us": ((1e6, 1, 1), "times seem to be microseconds", 1e-6),
    "unknown": ((5, 1, 1), "times, positions or velocities seem to have a wrong unit", 0.2),
    "unlike": ((1, [5, 0.2, 3, 5, 0.2, 3], 1), "velocities seem to have a wrong unit", None),
    "deg/s": ((1, 1, 180 / np.pi), "velocities seem to be in degrees", np.pi / 180.0),
    "deg": ((1, 180 / np.pi, 1), "positions seem to be in degrees", 180.0 / np.pi),
    "sign": (
        (1, 1, [1, 1, -1, 1, 1, 1]),
        "elbow_joint: positions change -1 times as fast",
        None,
    ),
}


@pytest.mark.parametrize("efforts", [True, False])
@pytest.mark.parametrize("unit", UNITS)
def test_units_that_do_not_agree_are_named(analysed, motion, unit, efforts):
    """Where all joints agree, the factor is among the numbers, and the exit status is 1."""
    t, q, qd, tau = (x[:500] for x in motion)
    factors, printed, factor = UNITS[unit]
    columns = [column * scale for column, scale in zip((t, q, qd), factors, strict=True)]
    summary, text, status = analysed(*columns, *([tau] if efforts else []), parameters=LOOSE)
    warnings = [
        warning for warning in summary["warnings"] if "times as fast as the velocities" in warning
    ]
    assert len(warnings) == (printed is not None)
    assert (printed or "") in "".join(warnings)
    assert (printed or "") in text
    wrong = summary["quality"]["wrong_unit"]
    assert (wrong is None) == (factor is None)
    if factor:
        assert status == 1 and wrong == {
            "cause": printed,
            "factor": pytest.approx(factor, rel=2e-3),
        }
        assert "exit status 1" in text and "times as fast as the velocities)" in text


def test_quality_of_good_data(analysed, motion):
    """Steps of an encoder are no disagreement."""
    t, q, qd, tau = motion
    report = analysed(*motion)[0]["quality"]
    assert report["rate"] == pytest.approx(500.0, rel=1e-4) and report["jitter"] < 1e-7
    assert report["gaps"] == report["repeated_states"] == report["without_effort"] == 0
    assert all(joint["velocity_error"] < 1e-3 for joint in report["joints"].values())
    report = analysed(t, np.round(q / 1e-4) * 1e-4, qd, tau)[0]["quality"]
    errors = np.array([joint["velocity_error"] for joint in report["joints"].values()])
    moving = np.abs(qd).max(axis=0) > 0.2
    assert moving.any() and (errors[moving] < 0.05).all()


def test_wrapped_positions_of_a_continuous_joint(tmp_path):
    """They are the integral of its velocity, and no wrong unit."""
    (tmp_path / "arm.urdf").write_text(TwoLinkArm().urdf.replace("revolute", "continuous"))
    t = np.arange(2000) * 0.002
    q = np.outer(t, [2.5, -2.0]) + 0.1 * np.sin(3.0 * t)[:, None]
    qd = [2.5, -2.0] + 0.3 * np.cos(3.0 * t)[:, None]
    path = write_columns(tmp_path / "x.npz", t, (q + np.pi) % (2.0 * np.pi) - np.pi, qd)
    main(
        [
            "analyse",
            str(path),
            "--urdf",
            str(tmp_path / "arm.urdf"),
            "--quiet",
            "--json",
            str(tmp_path / "a.json"),
        ]
    )
    report = json.loads((tmp_path / "a.json").read_text())["quality"]
    assert report["wrong_unit"] is None
    assert all(entry["velocity_error"] < 1e-3 for entry in report["joints"].values())


@pytest.mark.parametrize("delay", [0.006, -0.004, 0.02])
def test_late_velocities(analysed, motion, delay):
    t, q, qd, tau = motion
    late = np.column_stack([np.interp(t - delay, t, column) for column in qd.T])
    summary, *_ = analysed(*(x[50:-50] for x in (t, q, late, tau)))
    assert summary["quality"]["velocity_delay"] == pytest.approx(delay, rel=0.1)
    assert any(("later" if delay > 0 else "earlier") in text for text in summary["warnings"])


def test_joints_with_one_stamp_each_keep_their_motion(analysed, ur5, motion):
    """An arm and its gripper, with the same stamps in messages of their own: velocities are those
    of the positions.
    """
    once = motion
    last = ur5.nv - 1
    t, q, qd, tau = (np.repeat(x, 2, axis=0) for x in once)
    for values, sent in ((q, once[1]), (qd, once[2])):
        values[2::2, last] = sent[:-1, last]  # it comes after the others
    report = analysed(t, q, qd, tau, parameters=LOOSE)[0]["quality"]
    assert report["repeated_stamps"] == len(once[0])
    errors = {name: entry["velocity_error"] for name, entry in report["joints"].items()}
    assert max(errors.values()) < 0.05, errors


def test_gaps_and_repeats(analysed, motion):
    t, q, qd, tau = (x.copy() for x in motion)
    t[1500:] += 0.05
    t[1800:] -= 3.0  # a clock that was set back
    q[100:160] = q[99]
    qd[100:160] = qd[99]
    tau[100:160] = tau[99]
    q[159, 5] += 1e-9
    summary, *_ = analysed(t, q, qd, tau)
    report = summary["quality"]
    assert report["gaps"] == 1 and report["repeated_states"] == 59
    assert report["longest_gap"] == pytest.approx(0.052, abs=1e-6)
    assert report["repeated_stamps"] == 0
    assert all(word in " ".join(summary["warnings"]) for word in ("1 gap, ", "repeat"))
    summary, *_ = analysed(np.round(motion[0], 1), q, qd, tau)
    assert summary["quality"]["repeated_stamps"] > 0.9 * len(t)
    assert any("times with too few digits" in text for text in summary["warnings"])


def test_times_under_one_stamp_are_no_wrong_unit(analysed, motion):
    """What changes between such states belongs to the step after them."""
    t, *values = motion
    rows = slice(0, len(t) // 2 * 2)
    _, text, _ = analysed(np.repeat(t[rows][::2], 2), *(entry[rows] for entry in values))
    assert "repeat the previous time stamp" in text and "as fast as the velocities" not in text


def test_a_gap_is_no_wrong_unit(analysed, motion):
    """The motion in it is no part of the ratio of positions to velocities."""
    summary, text, _ = analysed(*(np.delete(x, slice(200, 1400), axis=0) for x in motion))
    assert summary["quality"]["gaps"] == 1 and "as fast as the velocities" not in text
