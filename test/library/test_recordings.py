# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings: what is read is what the monitor would publish, and what is said of it is true.

States and counts are those of the monitor's assembler, message by message. Figures of `analyse` are compared with single
calls of the library, with sums by NumPy, and with motions whose truth is known.
"""

import json
import os
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import diag_dynamics as dd
from bags import ODOMETRY, Message, arm, description, serialized, write_mcap
from diag_dynamics.assembly.assembler import JointStateAssembler, joints_of
from diag_dynamics.assembly.frozen import Frozen
from diag_dynamics.assembly.odometry import OdometryBase
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.assembly.whole import WithBase
from diag_dynamics.cli.main import main
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.states import States
from diag_dynamics.wire.definitions import read_message
from hostile import MS, START, Driver, S, hostile
from recording_cases import CASES, hostile_messages, write_case

RECORDINGS = Path(
    os.environ.get("DIAG_DYNAMICS_RECORDINGS", Path(__file__).parents[2].parent / "shared" / "recordings")
)


@pytest.fixture(scope="module")
def panda():
    return dd.load_robot("panda")


def states_written(path, pairs, **options):
    """Write joint states, pairs of bytes and log time; return the path."""
    return write_mcap(path, [Message("/joint_states", now, raw) for raw, now in pairs], chunk_size=20_000, **options)


def driven(model, count, seed=3):
    """Return joint states about which nothing is wrong, at 500 Hz, as pairs of bytes and log time."""
    driver = Driver(model, seed)
    return [(driver.good(START + k * 2 * MS), START + k * 2 * MS + 1000) for k in range(count)]


# --- What the monitor would publish ---


def one_after_the_other(model, settings, messages):
    """Do with each message what the monitor does; return states and counts."""
    assembler, counts, states = JointStateAssembler(joints_of(model), settings.inputs), Counter(), []
    values = settings.values
    frozen = Frozen(assembler.names, values["frozen_timeout"], values["frozen_values"] == "refuse")
    if model.floating_base:
        base = OdometryBase(model, values["odom_twist_frame"] == "header")
        base.configure(settings.inputs)
        with_base = WithBase(base, assembler)
    for _, now, raw, kind in messages:
        is_odometry = kind == ODOMETRY
        counts["odometry received" if is_odometry else "received"] += 1
        try:
            try:
                message = read_message(raw, kind)
            except ValueError as error:
                raise RejectedError("malformed", str(error)) from error
            if is_odometry:
                base.update(message, now)
                continue
            state = assembler.update(message, now)
            if state is not None and model.floating_base:
                state = with_base.state(state, values["odom_timeout"])
                counts["before odometry"] += state is None
            if state is not None:
                frozen.judge(state.newest, lambda state=state: state)
        except RejectedError as error:
            counts[f"{'odometry ' * is_odometry}rejected: {error.cause}"] += 1
            if not is_odometry:
                assembler.gaps.pause()
            continue
        if state is not None:
            counts["published"] += 1
            states.append(state)
    jumps = base.jumps if model.floating_base else 0
    counts += assembler.counts + Counter({"lost by gaps in stamps": assembler.gaps.lost, "time jumped back": jumps})
    return states, counts


@pytest.mark.parametrize("seeds", [(0, 1), pytest.param((2, 3, 4, 5), marks=pytest.mark.full)], ids=str)
@pytest.mark.parametrize("name", CASES)
def test_states_and_counts_are_the_monitors(tmp_path, name, seeds):
    """To the last bit, of hostile recordings in pieces of any size; all that a case is about occurs."""
    case, total = CASES[name], Counter()
    settings = Settings.of({key: spec.default for key, spec in PARAMETERS.items()} | case.parameters)
    for seed in seeds:
        messages = hostile_messages(case, seed)
        path, size = write_case(tmp_path / "x.mcap", messages), int(np.random.default_rng(seed).integers(50, 900))
        expected, counts = one_after_the_other(case.model, settings, messages)
        pieces = list(dd.stream_recording(path, case.model, parameters=case.own_parameters, size=size))
        assert pieces[-1].counts == {key: value for key, value in counts.items() if value}
        states = States.concatenate([piece.states for piece in pieces])
        newest, oldest, _, position, velocity, effort, with_effort, received, estimated, _ = states.columns()
        assert len(newest) == len(expected) > 200
        for actual, field in ((position, "position"), (velocity, "velocity"), (newest, "newest"), (oldest, "oldest")):
            assert actual.tobytes() == np.array([getattr(one, field) for one in expected]).tobytes()
        assert with_effort.tolist() == [one.effort is not None for one in expected]
        known = [one.effort for one in expected if one.effort is not None]
        assert effort[with_effort].tobytes() == np.array(known).tobytes() and np.isnan(effort[~with_effort]).all()
        assert received.tolist() == [one.stamp_is_receive_time for one in expected]
        assert estimated.tolist() == [one.velocity_estimated for one in expected]
        total += counts
    assert seeds != (0, 1) or not [key for key in case.counts if not total[key]]


def test_counts_do_not_depend_on_where_a_recording_is_cut(tmp_path, panda):
    """A piece may end anywhere in gaps, frozen values, and messages out of order."""
    path = states_written(tmp_path / "x.mcap", hostile(panda, 7, 600))
    whole = dd.read_recording(path, panda, parameters={"frozen_timeout": 0.05})
    for size in (1, 37, 10_000):
        *_, last = dd.stream_recording(path, panda, parameters={"frozen_timeout": 0.05}, size=size)
        assert (last.counts, last.findings) == (whole.counts, whole.findings)


@pytest.mark.parametrize("velocity", [(), (0.0, 0.0)], ids=["no velocities", "zeros"])
@pytest.mark.parametrize("shift", [0, 5, -5], ids="{} ms".format)
def test_two_sources_in_one_topic(tmp_path, velocity, shift):
    """joint_state_publisher's zeros beside a driver: the driver is served, and a finding names the sources.

    Where a state of the zeros comes first, the driver's first message is a jump from there.
    """
    names, times = ("shoulder", "elbow"), 0.01 * np.arange(100)
    q, qd = (scale * of(3.0 * times + 1.0)[:, None] * (1.0, -0.7) for scale, of in ((0.8, np.sin), (2.4, np.cos)))
    stamps = [START + 10 * MS * k for k in range(1, 101)]
    moving = [(at, serialized(at, names, *row)) for at, *row in zip(stamps, q, qd, strict=True)]
    zeros = [(at + shift * MS, serialized(at + shift * MS, names, (0.0, 0.0), velocity)) for at in stamps]
    messages = [Message("/joint_states", at, raw) for at, raw in sorted(moving + zeros, key=lambda one: one[0])]
    recording = dd.read_recording(write_mcap(tmp_path / "x.mcap", messages), arm(*names))
    served = {row.tobytes() for row in recording.q}
    zeros_first = shift < 0 and bool(velocity)
    assert all(row.tobytes() in served for row in q[zeros_first:])
    assert len(recording.t) == 100 + zeros_first  # two of them of the zeros, where these came first
    (finding,) = [one for one in recording.findings if "interleaved sources" in one.cause]
    assert "publish" in finding.text and finding.count >= 98


# --- Reading ---


def test_the_robot_of_the_bag(tmp_path, panda):
    urdf = Path(find_urdf("panda")).read_text(encoding="utf-8")
    states = [Message("/joint_states", now, raw) for raw, now in driven(panda, 50)]
    path = write_mcap(tmp_path / "x.mcap", [description(urdf, START - S), *states])
    recording = dd.read_recording(str(path))
    assert recording.model.name == "panda" and recording.findings == [] and "50 states" in repr(recording)
    np.testing.assert_array_equal(recording.q, dd.read_recording(path, panda).q)


def test_recordings_of_0_1(tmp_path, panda):
    """A topic of this package with another definition, as version 0.1 had it, changes nothing."""
    kind = "diag_dynamics/msg/ExternalTorque"
    states = [Message("/joint_states", now, raw) for raw, now in driven(panda, 50)]
    old = [Message("/diag_dynamics/external_torque", one.log_time, b"\0\1\0\0" + bytes(90), kind) for one in states]
    whole = dd.read_recording(write_mcap(tmp_path / "new.mcap", states), panda)
    both = [one for pair in zip(states, old, strict=True) for one in pair]
    recording = dd.read_recording(write_mcap(tmp_path / "old.mcap", both), panda)
    assert recording.findings == [] and recording.counts == whole.counts
    np.testing.assert_array_equal(recording.q, whole.q)


def test_part_of_a_recording(tmp_path, panda):
    pairs = driven(panda, 1000)
    path, first = states_written(tmp_path / "x.mcap", pairs), pairs[0][1]
    whole = dd.read_recording(path, panda)
    part = dd.read_recording(path, panda, start=0.5, end=1.25)
    within = [first + 500 * MS <= now < first + 1250 * MS for _, now in pairs]
    np.testing.assert_array_equal(part.q, whole.q[within])
    assert part.counts["received"] == sum(within)
    assert sum(map(len, dd.stream_recording(path, panda, start=1.0, size=100))) == 500
    for start, end, what in ((2.0, 1.0, "end is 1"), (-1.0, None, "start is -1")):
        with pytest.raises(dd.InputError, match=what):
            dd.read_recording(path, panda, start=start, end=end)


def test_part_of_a_table(tmp_path):
    rows = [f"{0.01 * k},{0.001 * k},0.1" for k in range(100)]
    (tmp_path / "x.csv").write_text("\n".join(["t,q1,qd1", *rows]))
    part = dd.read_recording(tmp_path / "x.csv", arm("a"), start=0.3, end=0.5)
    np.testing.assert_allclose(part.t, 0.01 * np.arange(30, 50), atol=1e-9)


def test_errors_of_reading(tmp_path, panda):
    """Each names what there is, or what may be meant."""
    path = tmp_path / "recording.mcap"
    states = [Message("/joint_states", now, raw) for raw, now in driven(panda, 5)]

    def refused(what, path=path, model=panda, **options):
        with pytest.raises(dd.InputError, match=what):
            dd.read_recording(path, model, **options)

    refused(r"no file or folder.*nothing\.mcap", tmp_path / "nothing.mcap")
    for name in ("day.mcap", "day.csv", "day.db3"):
        (tmp_path / name).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:12\nsize 7\n")
        refused(rf"{name}' is a pointer of Git LFS\. Run git lfs pull", tmp_path / name)
    write_mcap(path, states)
    refused(r"recording\.mcap", tmp_path / "recordin.mcap")
    refused("robot_description", model=None)
    refused(r"no topic '/joint_state'.*'/joint_states'", topic="/joint_state")
    refused("map of columns", columns={"time": "t"})
    refused("no parameter 'max_agge'", parameters={"max_agge": 1.0})
    for name, value in (("locked_joints", ["a=0"]), ("gravity", [0.0, 0.0, -1.6]), ("friction_velocity", 0.1)):
        refused(f"'{name}' shapes a robot", parameters={name: value})
    assert len(dd.read_recording(path, panda, parameters={"gravity": [0.0, 0.0, -9.81]})) == 5
    write_mcap(path, states, encoding="json")
    refused("encoded as 'json'")
    write_mcap(path, [one._replace(topic=f"/{side}/states") for side in ("left", "right") for one in states])
    refused("/left/states, /right/states")
    assert len(dd.read_recording(path, panda, topic="/left/states")) == 5
    write_mcap(path, [])
    refused("has no joint states")
    refused("has not a file|is a folder|no bags in it", tmp_path.joinpath("empty").mkdir() or tmp_path / "empty")


def test_parameters_of_efforts(tmp_path, panda):
    path = states_written(tmp_path / "x.mcap", driven(panda, 20))
    whole = dd.read_recording(path, panda)
    half = dd.read_recording(path, panda, parameters={"effort_scale": ["*=0.5"]})
    np.testing.assert_array_equal(half.tau, 0.5 * whole.tau)
    assert dd.read_recording(path, panda, parameters={"effort_available": ["*=false"]}).tau is None
    without = dd.read_recording(path, panda, parameters={"effort_includes_gravity": ["*=false"]})
    gravity = dd.DiagonalDynamics(panda).gravity_torque_batch(whole.q)
    np.testing.assert_array_equal(without.tau, whole.tau + gravity)


# --- Analysis: a motion whose truth is known ---


@pytest.fixture(scope="module")
def ur5():
    return dd.load_robot("ur5")


@pytest.fixture(scope="module")
def motion(ur5):
    """Four seconds of a UR5 at 500 Hz."""
    return simulated(ur5)


def simulated(model, push=None, seconds=4.0):
    """Return times, positions, velocities and efforts under gravity compensation, damping and sines."""
    rng = np.random.default_rng(4)
    dynamics, n = dd.DiagonalDynamics(model), model.nv
    phase, period = rng.uniform(0.0, 6.0, n), 0.002
    simulation = dd.Simulation(model, np.full(n, 0.3), np.zeros(n), step=period)
    rows = []
    for k in range(int(seconds / period)):
        t = k * period
        q, qd = simulation.q.copy(), simulation.qd.copy()
        tau = dynamics.gravity_torque(q) + 8.0 * np.sin(3.0 * t + phase) * (np.arange(n) < 3) - 6.0 * qd
        rows.append((t, q, qd, tau))
        simulation.advance(tau if push is None else tau + push(t), 1)
    return tuple(map(np.array, zip(*rows, strict=True)))


LOOSE = [f"{name}=0" for name in ("absurd.jump", "absurd.beyond_limits", "absurd.beyond_velocity", "absurd.velocity")]
"""Parameters that let velocities and positions in wrong units through."""


def write_columns(path, t, q, qd, tau=None):
    """Write columns as npz; return the path."""
    np.savez(path, t=t, q=q, qd=qd, **({} if tau is None else {"tau": tau}))
    return path


@pytest.fixture
def analysed(tmp_path, capsys):
    """Run `analyse` on columns of a UR5; return the summary and the text."""

    def run(*columns, parameters=()):
        path, out = write_columns(tmp_path / "x.npz", *columns), tmp_path / "summary.json"
        given = [word for one in parameters for word in ("--set", one)]
        assert main(["analyse", str(path), "--urdf", "ur5", "--json", str(out), *given]) in (0, 1)
        return json.loads(out.read_text()), " ".join(capsys.readouterr().out.split())

    return run


def test_right_model_explains_nearly_all(analysed, motion):
    summary, _ = analysed(*motion)
    assert summary["explained"] > 0.995 and summary["explained_with_potential"] > 0.995
    assert "explain" in summary["balance"]["says"] and "check" not in summary["balance"]["says"]
    assert summary["warnings"] == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda tau, gravity: -tau, "the efforts seem to have the wrong sign: times -1 "),
        (lambda tau, gravity: tau * [1, -1, 1, 1, 1, 1], "efforts of some joints seem to have the wrong sign"),
        (lambda tau, gravity: tau / 11.4, "another unit: times 11.4 "),
        (lambda tau, gravity: tau - gravity, "gravity seems not to be in the efforts (effort_includes_gravity)"),
        (lambda tau, gravity: tau + 12.0 * np.sin(np.arange(len(tau)))[:, None], None),
    ],
    ids=["sign", "a joint's sign", "unit", "gravity", "noise"],
)
def test_likely_cause_is_named(analysed, ur5, motion, change, said):
    t, q, qd, tau = motion
    summary, text = analysed(t, q, qd, change(tau, dd.DiagonalDynamics(ur5).gravity_torque_batch(q)))
    assert ("seem" in summary["balance"]["says"]) == (said is not None)
    assert (said or "") in text
    if said:
        assert summary["explained"] < 0.3 and "check the unit of efforts" in text


def test_friction_that_the_model_lacks_is_at_its_joint(analysed, ur5, motion):
    t, q, qd, tau = motion
    tau = tau.copy()
    tau[:, 1] += 12.0 * np.tanh(qd[:, 1] / 0.005)
    joints = analysed(t, q, qd, tau)[0]["balance"]["joints"]
    assert max(joints, key=lambda name: joints[name]["share"]) == ur5.dof_names[1]


def test_why_there_is_no_balance(analysed, ur5, motion):
    """At rest noise is no motion, so neither is the balance poor, nor are velocities wrong."""
    t, q, qd, tau = motion
    rng = np.random.default_rng(3)
    still = np.tile(q[0], (len(t), 1))
    weight = dd.DiagonalDynamics(ur5).gravity_torque_batch(still) + 0.05 * rng.standard_normal(q.shape)
    noise = 1e-5 * rng.standard_normal(q.shape), 1e-3 * rng.standard_normal(q.shape)
    summary, text = analysed(t, still + noise[0], noise[1], weight)
    assert summary["explained"] is summary["explained_with_potential"] is None
    assert "No balance of power: the robot is at rest" in text and summary["warnings"] == []
    summary, text = analysed(200.0 * t, q, qd, tau, parameters=LOOSE)
    assert "No balance of power: there are 0 windows" in text
    assert any("0.4 s apart" in one for one in summary["warnings"])
    summary, text = analysed(t, q, qd)
    assert "No balance of power: no efforts." in text
    assert summary["explained"] is summary["residual_power"] is None and summary["collisions"] == []
    assert summary["quality"]["without_effort"] == len(t)


def windows_by_numpy(model, t, q, qd, tau):
    """Return mean powers over windows at multiples of 0.1 s: dK/dt and the residual [W]."""
    s = dd.DiagonalDynamics(model).evaluate_batch(q, qd, np.nan_to_num(tau), friction=True)
    power = np.einsum("tk,tk->t", s.nu, s.epsilon - s.gravity - s.friction)
    known = np.isfinite(tau).all(axis=1)
    t, power, K = t[known], power[known], s.kinetic_energy[known]
    begins = np.flatnonzero(np.diff(np.floor(np.round(t * 1e9) / 1e8))) + 1
    found = []
    for first, last in pairwise(begins):
        if np.diff(t[first : last + 1]).max() <= 0.1 and np.diff(t[first - 1 : first + 1]) <= 0.1:
            span, inside = t[last] - t[first], slice(first, last + 1)
            change = (K[last] - K[first]) / span
            found.append((change, change - np.trapezoid(power[inside], t[inside]) / span))
    return np.array(found).T


@pytest.mark.parametrize("gaps", [False, True])
def test_explained_share_is_that_of_windows_by_numpy(analysed, ur5, motion, gaps):
    """Windows begin anew after gaps, and where efforts were missing."""
    t, q, qd, tau = (x.copy() for x in motion)
    tau *= 1.2
    if gaps:
        t[1000:] += 0.7
        tau[1500:1600] = np.nan
    summary, _ = analysed(t, q, qd, tau, parameters=LOOSE)
    kinetic, residual = windows_by_numpy(ur5, t, q, qd, tau)
    assert summary["balance"]["windows"] == len(kinetic)
    assert summary["explained"] == pytest.approx(1.0 - residual.var() / kinetic.var(), rel=1e-6)
    assert summary["residual_power"] == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-6)


def test_figures_are_the_largest_and_the_means(analysed, ur5, motion):
    t, q, qd, tau = motion
    summary, _ = analysed(*motion)
    s = dd.DiagonalDynamics(ur5).evaluate_batch(q, qd, tau)
    energy, k = summary["kinetic_energy"], int(np.argmax(s.kinetic_energy))
    assert energy["max"] == s.kinetic_energy[k] and energy["at"] == pytest.approx(t[k], abs=1e-9)
    assert energy["mean"] == pytest.approx(s.kinetic_energy.mean(), rel=1e-12)
    assert energy["share"] == dict(zip(ur5.dof_names, s.energy_share.max(axis=0).tolist(), strict=True))
    assert sum(one["states"] for one in energy["histogram"]) == len(t)
    for one in energy["histogram"]:
        low, high = one["from"] * (1 - 1e-15), one["to"]
        assert one["states"] == np.sum((s.kinetic_energy >= low) & (s.kinetic_energy < high)) or high == 0.0
    at = np.unravel_index(np.argmax(np.abs(tau)), tau.shape)
    assert summary["peaks"]["effort"] | {"at": 0} == {"value": np.abs(tau[at]), "of": ur5.dof_names[at[1]], "at": 0}
    assert summary["states"] == len(t) and summary["duration"] == pytest.approx(t[-1], abs=1e-8)
    assert set(summary) >= {"rejected", "residual_power", "collisions", "observer", "quality", "findings", "counts"}


def test_states_that_cannot_be_evaluated_are_rejected(analysed, motion):
    t, q, qd, tau = (x.copy() for x in motion)
    qd[40], qd[1500] = 1e200, 1e200
    summary, _ = analysed(t, q, qd, tau, parameters=LOOSE)
    assert summary["states"] == len(t) - 2
    (finding,) = [one for one in summary["findings"] if one["cause"].startswith("rejected")]
    assert finding["count"] == 2


# --- Observer ---


def test_observer_is_that_of_single_states(tmp_path, ur5, motion):
    """To the last bit, over gaps, lost efforts and jumps."""
    t, q, qd, tau = (x.copy() for x in motion)
    t = np.arange(len(t)) / 512.0  # differences of these are what they are in nanoseconds, to the last bit
    t[700:] += 0.5
    tau[100:140] = np.nan
    q[1500:] += 0.3
    recording = dd.read_recording(write_columns(tmp_path / "x.npz", t, q, qd, tau), ur5)
    dynamics = dd.DiagonalDynamics(ur5)
    seen = dd.observe(dynamics, recording, 30.0, threshold=0.4)
    single = dd.DisturbanceObserver(dynamics, 30.0, 0.4, friction=True)
    for k, moved in enumerate(recording.states.jumped):
        if moved:
            single.reset()
        one = single.update(recording.stamp[k] / S, recording.q[k], recording.qd[k], recording.states.effort[k])
        assert one.valid == seen.valid[k], k
        if one.valid:
            np.testing.assert_array_equal(one.residual, seen.residual[k])
            np.testing.assert_array_equal(one.external_torque, seen.external_torque[k])
            assert one.norm == pytest.approx(seen.norm[k], rel=1e-14) and one.collision == seen.collision[k]
        else:
            assert np.isnan(seen.residual[k]).all()
    assert recording.states.jumped.sum() == 1 and 1800 < seen.valid.sum() < len(recording) - 40


def test_observe_needs_efforts_and_the_same_robot(tmp_path, ur5, motion):
    t, q, qd, tau = (x[:100] for x in motion)
    recording = dd.read_recording(write_columns(tmp_path / "x.npz", t, q, qd, tau), ur5)
    seen = dd.observe(dd.DiagonalDynamics(ur5), recording, gain=25.0)
    assert not seen.valid[0] and seen.valid[1:].all()
    assert np.nanmax(np.abs(seen.external_torque)) < 0.5  # nobody pushes
    without = dd.read_recording(write_columns(tmp_path / "y.npz", t, q, qd), ur5)
    (tmp_path / "none.csv").write_text("t,q1,q2,q3,q4,q5,q6\n")
    nothing = dd.read_recording(tmp_path / "none.csv", ur5)
    for model, one, what in (
        (ur5, without, "efforts"),
        (ur5, nothing, "no states"),
        (dd.load_robot("panda"), recording, "panda"),
    ):
        with pytest.raises(dd.InputError, match=what):
            dd.observe(dd.DiagonalDynamics(model), one)


def test_a_push_is_a_collision(analysed, ur5):
    def push(t):
        return np.array([0.0, 25.0, 0.0, 0.0, 0.0, 0.0]) * (2.0 <= t < 2.4)

    parameters = ["external_torque.gain=25", "external_torque.threshold=3"]
    summary, text = analysed(*simulated(ur5, push), parameters=parameters)
    (collision,) = summary["collisions"]
    assert 2.0 < collision["start"] < 2.1 and 2.4 < collision["end"] < 2.6
    assert collision["norm"] > 3.0 and ur5.dof_names[1] in collision["joints"]
    assert summary["peaks"]["external_torque"]["value"] == pytest.approx(25.0, rel=0.02)
    assert "1 collision above" in text and summary["explained"] < 0.8
    assert "the power of a push is in no effort" in text


# --- Quality ---


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t, q, qd: (1e3 * t, q, qd), "all joints: positions change 0.001 times as fast as velocities say"),
        (lambda t, q, qd: (1e6 * t, q, qd), "times seem to be microseconds"),
        (lambda t, q, qd: (t, q, np.degrees(qd)), "velocities seem to be in degrees"),
        (lambda t, q, qd: (t, np.degrees(q), qd), "positions seem to be in degrees"),
        (lambda t, q, qd: (t, q, qd * [1, 1, -1, 1, 1, 1]), "elbow_joint: positions change -1 times as fast"),
        (lambda t, q, qd: (t, q, 3.0 * qd), "seem to have a wrong unit"),
        (lambda t, q, qd: (t, q, qd), None),
    ],
    ids=["ms", "us", "deg/s", "deg", "sign", "3", "right"],
)
def test_units_that_do_not_agree_are_named(analysed, motion, change, said):
    summary, _ = analysed(*change(*motion[:3]), parameters=[*LOOSE, "frozen_timeout=0", "absurd.position=0"])
    told = [one for one in summary["warnings"] if "times as fast as velocities say" in one]
    assert len(told) == (said is not None)
    assert (said or "") in "".join(told)


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (86400.0, "times seem to be days, 86400 s each"),
        (3600.0, "times seem to be hours, 3600 s each"),
        (60.0, "times seem to be minutes, 60 s each"),
        (1e-3, "times seem to be milliseconds"),
        (1e-6, "times seem to be microseconds"),
        (0.2, "times, positions or velocities seem to have a wrong unit"),
        (1.0, None),
    ],
)
@pytest.mark.parametrize("efforts", [True, False])
def test_times_in_a_wrong_unit_are_no_good_recording(tmp_path, motion, capsys, seconds, said, efforts):
    """The factor is among the numbers, and the exit status is 1, with efforts and without."""
    t, q, qd, tau = (x[:500] for x in motion)
    path = write_columns(tmp_path / "x.npz", t / seconds, q, qd, tau if efforts else None)
    out, loose = tmp_path / "x.json", [word for one in (*LOOSE, "frozen_timeout=0") for word in ("--set", one)]
    status = main(["analyse", str(path), "--urdf", "ur5", "--json", str(out), *loose])
    printed = capsys.readouterr()
    wrong = json.loads(out.read_text())["quality"]["wrong_unit"]
    if said is None:
        assert wrong is None and "seem to" not in printed.err
        return
    assert status == 1 and said in printed.err and said in " ".join(printed.out.split())
    assert wrong["cause"] == said and wrong["factor"] == pytest.approx(seconds, rel=2e-3)


@pytest.mark.parametrize("unit", ["d", "day", "days", "h", "hours", "min", "minutes"])
def test_long_units_of_times(tmp_path, ur5, motion, unit):
    t, q, qd, _ = (x[:50] for x in motion)
    seconds = {"d": 86400.0, "h": 3600.0, "m": 60.0}[unit[0]]
    path = write_columns(tmp_path / "x.npz", t / seconds, q, qd)
    recording = dd.read_recording(path, ur5, {"scale": {"time": unit}})
    np.testing.assert_allclose(recording.t, t, rtol=0, atol=2e-9)


def test_quality_of_good_data(analysed, motion):
    """Steps of an encoder are no disagreement."""
    report = analysed(*motion)[0]["quality"]
    assert report["rate"] == pytest.approx(500.0, rel=0.02) and report["jitter"] < 2e-5
    assert report["gaps"] == report["repeated_states"] == report["without_effort"] == 0
    assert all(one["velocity_error"] < 1e-3 and not one["clipped"] for one in report["joints"].values())
    t, q, qd, tau = motion
    report = analysed(t, np.round(q / 1e-4) * 1e-4, qd, tau)[0]["quality"]
    moving = [one for one in report["joints"].values() if one["largest_velocity"] > 0.2]
    assert moving and all(one["velocity_error"] < 0.05 for one in moving)


@pytest.mark.parametrize("delay", [0.006, -0.004, 0.02])
def test_late_velocities(analysed, motion, delay):
    t, q, qd, tau = motion
    late = np.column_stack([np.interp(t - delay, t, column) for column in qd.T])
    summary, _ = analysed(*(x[50:-50] for x in (t, q, late, tau)))
    assert summary["quality"]["velocity_delay"] == pytest.approx(delay, rel=0.1)
    assert any(("late" if delay > 0 else "early") in text for text in summary["warnings"])


def test_gaps_repeats_and_bounds(analysed, ur5, motion):
    t, q, qd, tau = (x.copy() for x in motion)
    t[1500:] += 0.05
    q[100:160], qd[100:160], tau[100:160] = q[99], qd[99], tau[99]
    tau[:, 0] = np.clip(tau[:, 0], -3.0, 3.0)
    summary, _ = analysed(t, q, qd, tau)
    report = summary["quality"]
    assert report["gaps"] == 1 and report["repeated_states"] == 60
    assert report["longest_gap"] == pytest.approx(0.052, abs=1e-6)
    assert report["longest_gap_at"] == pytest.approx(t[1499], abs=1e-6)
    clipped = {name: one["clipped"] for name, one in report["joints"].items() if one["clipped"]}
    assert clipped == {ur5.dof_names[0]: ["effort"]}
    assert all(word in " ".join(summary["warnings"]) for word in ("clipped", "gap", "repeat"))


def test_times_that_lack_digits(analysed, motion):
    t, q, qd, tau = motion
    summary, _ = analysed(np.round(t, 1), q, qd, tau)
    assert summary["quality"]["repeated_stamps"] > 0.9 * len(t)
    assert any("times need more digits" in text for text in summary["warnings"])


def test_text_for_people(tmp_path, motion, capsys, monkeypatch):
    """Lines fit, no unit is apart from its number, times are from the first state on, losses come before notes."""
    t, q, qd, tau = motion
    path = write_columns(
        tmp_path / "x.npz", t + 1.7e9, q, qd, np.where(np.arange(len(t))[:, None] == 9, np.inf, 0.1 * tau)
    )
    main(["analyse", str(path), "--urdf", "ur5", "--json", "-"])
    summary = json.loads(capsys.readouterr().out)
    at = summary["kinetic_energy"]["at"] - summary["begin"]
    for width in (40, 80, 100):
        monkeypatch.setenv("COLUMNS", str(width))
        main(["analyse", str(path), "--urdf", "ur5"])
        lines = capsys.readouterr().out.split("\n")
        assert max(map(len, lines)) <= width
        assert not any(line.split()[0].rstrip(",;") in {"J", "W", "s"} for line in lines if line.strip())
        flat = " ".join(line.strip() for line in lines)
        assert f"J at {at:.3f} s, " in flat
        assert flat.index("Worth knowing") < flat.index("How it was read") < flat.index("time: t.")


# --- Contact ---


def test_time_above_limits_of_contact_and_worst_moments(analysed, ur5, motion, tmp_path):
    """Sums and maxima over single calls of the library."""
    t, q, qd, tau = motion
    points = dd.ContactPoints(ur5, dd.link_geometry(ur5, find_urdf("ur5")).points, None)
    energy = dd.DiagonalDynamics(ur5).contact_batch(q, qd, points).energy
    limit = float(np.quantile(energy.max(axis=1), 0.7))
    path = tmp_path / "limits.yaml"
    path.write_text(f"regions: {{any: {{energy: {limit!r}}}}}")
    summary, text = analysed(t, q, qd, tau, parameters=[f"contact.limits_file={path}"])
    contact, since = summary["contact"], np.diff(t, prepend=t[0])
    assert contact["above"] == pytest.approx(since @ (energy > limit).any(axis=1), rel=1e-6)
    assert contact["of"] == pytest.approx(t[-1] - t[0])
    by_point = {name: since @ (energy[:, k] > limit) for k, name in enumerate(points.names)}
    assert contact["above_by_point"] == pytest.approx({name: s for name, s in by_point.items() if s}, rel=1e-6)
    worst = contact["worst"]
    k = np.unravel_index(np.argmax(energy), energy.shape)
    assert worst[0]["at"] == pytest.approx(t[k[0]]) and worst[0]["usage"] == pytest.approx(np.sqrt(energy[k] / limit))
    assert worst[0]["energy"] == pytest.approx(energy[k]) and worst[0]["region"] == "any"
    usages, times = [one["usage"] for one in worst], np.array([one["at"] for one in worst])
    assert usages == sorted(usages, reverse=True)
    assert np.abs(times[:, None] - times)[~np.eye(len(worst), dtype=bool)].min() >= 1.0 - 1e-9
    assert f"{worst[0]['point']} at" in text and "Limits of contact exceeded for" in text
    assert analysed(*motion)[0]["contact"] is None


# --- Real arms ---


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="recordings of real arms are no part of this package")
@pytest.mark.parametrize("name", ["panda", "panda with a hand that is not mounted", "kuka"])
def test_real_arms(tmp_path, name):
    """The model without the hand explains what it should; with the hand, a payload is missing."""
    path, urdf = RECORDINGS / "panda" / "exciting_trajectory.csv.gz", tmp_path / "panda.urdf"
    tree, options = etree.parse(find_urdf("panda")).getroot(), []
    if name == "panda":
        hand = {"panda_hand", "panda_hand_tcp", "panda_leftfinger", "panda_rightfinger"}
        for part in list(tree):
            child = part.find("child")
            if part.get("name") in hand or (child is not None and child.get("link") in hand):
                tree.remove(part)
    else:
        locked = "locked_joints=['panda_finger_joint1=0.0', 'panda_finger_joint2=0.0']"
        options = ["--set", locked, "mimic=free", "massless=lock"]
    urdf.write_bytes(etree.tostring(tree))
    if name == "kuka":
        path, urdf, options = RECORDINGS / "kuka_lwr4/measurements_1.npz", RECORDINGS / "kuka_lwr4/kuka_lwr4.urdf", []
    status = main(["analyse", str(path), "--urdf", str(urdf), *options, "--quiet", "--json", str(tmp_path / "a.json")])
    summary = json.loads((tmp_path / "a.json").read_text())
    if name == "panda":
        assert status == 0 and summary["states"] == 20544
        assert summary["explained"] == pytest.approx(0.95, abs=0.01) and summary["explained_with_potential"] > 0.99
        assert summary["quality"]["velocity_delay"] == pytest.approx(0.005, abs=0.001)
    elif name == "kuka":
        assert summary["states"] == 5027
        assert summary["explained"] < 0.0 < 0.95 < summary["explained_with_potential"]
        recording = dd.read_recording(path, str(urdf))
        with np.load(path) as arrays:  # not what was commanded
            np.testing.assert_array_equal(recording.q, arrays["positions"])
    else:
        assert status == 1 and summary["explained"] == pytest.approx(0.29, abs=0.02)
        assert "payload" in summary["balance"]["says"]
