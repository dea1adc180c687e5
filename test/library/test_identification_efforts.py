# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Efforts that are judged before anything is fitted to them: unit, sign, gravity, order of joints,
at any size of a robot.
"""

import functools
import json
import re

import numpy as np
import pytest

import diag_dynamics as dd
from commands import quiet_compiler  # noqa: F401 (a fixture of all tests here)
from controlled import FINGERS
from desk_arm import DOWN, JOINTS, URDF, motion, recording, worn, write_table
from diag_dynamics.cli.main import main
from diag_dynamics.identification.fitting import FitData
from motions import efforts, fourier, recorded
from oracles import Oracle
from robots import robot


@pytest.fixture(scope="module")
def arm():
    return dd.load_urdf(URDF)


def noise(tau, size, seed=5):
    return size * tau.std(axis=0) * np.random.default_rng(seed).normal(size=tau.shape)


CAUSES = {
    "mN m": (
        DOWN,
        lambda tau: 1000.0 * tau,
        r"another unit: they are [\d.e+]+ times",
    ),
    "motor current": (
        DOWN,
        lambda tau: -640.0 * tau,
        r"another unit and the opposite sign: they are -6\d\d times",
    ),
    "kgf cm": (DOWN, lambda tau: 10.2 * tau, r"another unit: they are 10"),
    "each joint's own unit": (
        DOWN,
        lambda tau: tau * [900.0, 400.0, 30.0],
        r"is (9|4)\d\d ± .* Check unit",
    ),
    "sign of all": (
        DOWN,
        lambda tau: -tau,
        r"all joints seem to have the opposite sign \(effort_scale: '\*=-1'\)",
    ),
    "sign of one": (
        DOWN,
        lambda tau: tau * [1.0, 1.0, -1.0],
        r"joint 'elbow' has the opposite sign: .*'elbow=-1'\)",
    ),
    "no relation": (DOWN, lambda tau: noise(tau, 1.0), "no effort follows the motion"),
    "exchanged": (
        DOWN,
        lambda tau: tau[:, [0, 2, 1]],
        "exchanged: those of lift, elbow are in the columns of elbow, lift",
    ),
    "order": (
        DOWN,
        lambda tau: tau[:, [1, 2, 0]],
        "those of pan, lift, elbow are in the columns of elbow, pan, lift",
    ),
    "no gravity": (
        (0.0, 0.0, 0.0),
        lambda tau: tau,
        r"gravity seems to be missing in the efforts \(effort_includes_gravity",
    ),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_causes_are_named_on_a_desk_arm(arm, cause):
    """Friction and noise are a third of the arm's torque each."""
    gravity, changed, key = CAUSES[cause]
    t, q, qd, tau = motion(gravity=gravity)
    with pytest.raises(dd.InputError, match=key):
        dd.identify(recording(t, q, qd, changed(worn(tau, qd))), arm, "friction")


@pytest.mark.parametrize("factor", [0.3, 0.4, 1.7, 2.0, 3.0, 6.0])
@pytest.mark.parametrize("speed", [0.3, 2.5], ids=["by gravity", "by inertia"])
def test_a_factor_of_all_joints_is_named(arm, factor, speed):
    t, q, qd, _ = motion(rate=50.0)
    t = t / speed
    qd = speed * qd
    dynamics = dd.DiagonalDynamics(arm)
    qdd = np.gradient(qd, t, axis=0)
    tau = factor * dynamics.inverse_dynamics(q, qd, qdd)
    with pytest.raises(
        dd.InputError, match="efforts of all joints seem to have another unit: they"
    ):
        dd.identify(recording(t, q, qd, tau + noise(tau, 0.02)), arm, "friction")


@pytest.mark.parametrize("amplitude", [0.25, 0.5, 1.0])
def test_missing_gravity_is_named_in_small_motions(arm, amplitude):
    t, q, qd, _ = motion()
    q, qd = (
        amplitude * q / abs(q).max(axis=0) + [0.3, 0.2, -0.4],
        amplitude * qd / abs(q).max(axis=0),
    )
    weightless = dd.DiagonalDynamics(arm.with_gravity((0.0, 0.0, 0.0)))
    tau = weightless.inverse_dynamics(q, qd, np.gradient(qd, t, axis=0))
    with pytest.raises(dd.InputError, match="gravity seems to be missing"):
        dd.identify(recording(t, q, qd, tau + noise(tau, 0.02)), arm, "friction")


@pytest.mark.parametrize(
    ("lacks", "moving"),
    [(False, [0, 1, 2]), (True, [0, 1, 2]), (False, [2]), (True, [2]), (False, [0, 1])],
    ids=["carries", "lacks", "carries, elbow moves", "lacks, elbow moves", "carries, elbow stands"],
)
def test_an_unknown_payload_is_no_fault_of_efforts(arm, lacks, moving):
    """The model of a robot that lacks a load has it. One joint shows a moment and no mass; with a
    standing elbow no mass leaves nearly as little.
    """
    loaded = arm.with_payload("fore", 0.1, (0.1, 0.0, 0.01))
    model, real = (loaded, arm) if lacks else (arm, loaded)
    t, q, qd, _ = motion()
    is_moving = np.isin(np.arange(3), moving)
    q = np.where(is_moving, q, 0.3)
    qd = np.where(is_moving, qd, 0.0)
    tau = dd.DiagonalDynamics(real).inverse_dynamics(q, qd, np.gradient(qd, t, axis=0))
    result = dd.identify(recorded(model, t, q, qd, worn(tau, qd)), model, "friction")
    printed = " ".join(result.quality["findings"])
    assert not re.search("effort (doubtful|not judged)", printed)
    first, second = ("model", "robot") if lacks else ("robot", "model")
    text = rf"the {first} seems to have about (\S+) ± \S+ kg at fore that the {second} lacks"
    mass = re.search(text, printed)
    assert bool(mass) == (len(moving) > 2) == ("kg" in printed)
    assert not mass or float(mass[1]) == pytest.approx(0.1, rel=0.15)


@pytest.mark.parametrize("wear", [False, True], ids=["alone", "with friction and noise"])
def test_efforts_of_a_desk_arm_that_are_right(arm, wear):
    """The factor is 1 within its standard errors, and friction is found."""
    t, q, qd, tau = motion()
    result = dd.identify(recording(t, q, qd, worn(tau, qd) if wear else tau), arm, "friction")
    assert result.quality["efforts_judged"]
    factor, error = np.transpose([result.quality["effort_factor"][name] for name in arm.dof_names])
    assert (abs(factor - 1.0) < 4.0 * error + 1e-3).all() and error[1] < 0.1
    assert result.quality["taken"] == (["friction"] if wear else [])
    if wear:
        np.testing.assert_allclose(result.model.friction, 0.3 * tau.std(axis=0).max(), rtol=0.15)


def test_residuals_of_neighbours_in_time_are_alike(arm):
    """A slow drift as large as the arm's torque, at 1 kHz: 12 s hold few errors, though many
    states. Nothing is refused.
    """
    t, q, qd, tau = motion(rate=1000.0)
    knots = np.random.default_rng(0).normal(size=(13, 3)) * tau.std(axis=0).max()
    drift = np.column_stack([np.interp(t, np.arange(13.0), entry) for entry in knots.T])
    result = dd.identify(recording(t, q, qd, tau + drift), arm, "friction")
    factor, error = result.quality["effort_factor"]["lift"]
    assert abs(factor - 1.0) < 4.0 * error < 2.0


def test_no_relation_is_named_beside_a_payload(arm):
    """Wider limits would accept a factor of 0 with its errors."""
    t, q, qd, tau = motion()
    with pytest.raises(dd.InputError, match="no effort follows the motion"):
        dd.identify(recording(t, q, qd, noise(tau, 1.0)), arm, "payload:fore")


def test_slow_motion_does_not_tell_the_other_sign_from_a_ceiling(arm):
    t, q, qd, _ = motion()
    tau = 1e-3 * np.sin(t)[:, None] - dd.DiagonalDynamics(arm).gravity_torque(q)
    with pytest.raises(
        dd.InputError,
        match=r"opposite sign.* or gravity points the other way, as for a robot on a ceiling",
    ):
        dd.identify(recording(10.0 * t, q, qd / 10.0, tau), arm, "friction")


ARMS = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", {}),
    "panda": ("panda_description/urdf/panda.urdf", FINGERS),
}


@functools.cache
def large_arm(name):
    """Model, motion and Pinocchio's efforts of an arm, with friction of each joint and noise of 1 %
    of its largest torque.
    """
    name, locked = ARMS[name]
    text = re.sub("<dynamics[^>]*>", "", robot(name).urdf)
    model = dd.load_urdf(text, locked_joints=locked)
    t = np.arange(0.0, 20.0, 0.02)
    q, qd, qdd = fourier(
        np.random.default_rng(7), t, np.maximum(model.lower, -2.5), np.minimum(model.upper, 2.5)
    )
    tau = efforts(Oracle(text, model.dof_names, locked_joints=locked), q, qd, qdd)
    largest = abs(tau).max(axis=0)
    tau = tau + 0.1 * largest * np.tanh(qd / 5e-3) + noise(tau, 0.01)
    return model, t, q, qd, tau


LIGHT_JOINTS = {
    "right": ({}, None),
    "sign of the last": ({-1: -1.0}, r"joint '{-1}' has the opposite sign: .*'{-1}=-1'\)"),
    "unit of the last": ({-1: 10.0}, r"joint '{-1}' is (9\.\d+|10) ± .* Check unit"),
    "unit of wrist 2": ({-2: 0.01}, r"joint '{-2}' is 0\.0(10?|09\d*) ± .* Check unit"),
    "signs and unit": (
        {-3: -1.0, -2: -1.0, -1: 10.0},
        r"'{-3}=-1'\); .*'{-2}=-1'\); .* '{-1}' is ",
    ),
    "two units": ({-2: 0.01, -1: 10.0}, r"'{-2}' is [^.]*\.[^C]*'{-1}' is .* Check unit"),
}


@pytest.mark.parametrize(
    ("name", "case"),
    [*(("ur5", case) for case in LIGHT_JOINTS), ("panda", "right"), ("panda", "signs and unit")],
)
def test_light_joints_are_judged_by_their_own_errors(name, case):
    """What a model may miss at a large joint hides no sign and no unit of a wrist; parameters are
    found all the same.
    """
    model, t, q, qd, tau = large_arm(name)
    factors, key = LIGHT_JOINTS[case]
    scale = np.ones(model.nv)
    for k, factor in factors.items():
        scale[k] = factor
    result = dd.identify(recorded(model, t, q, qd, scale * tau), model, "friction")
    printed = " ".join(text for text in result.quality["findings"] if "effort doubtful" in text)
    assert result.quality["taken"] == ["friction"] and result.quality["efforts_judged"] == (
        key is None
    )
    for k in factors:
        key = key.replace(f"{{{k}}}", model.dof_names[k])
    assert re.search(key, printed) if key else not printed


def test_a_small_factor_of_a_lighter_joint_may_be_the_models_fault(arm):
    """Of a joint with less than half the torque of another one; another sign of it is no fault of
    the model.
    """
    t, q, qd, tau = motion(seed=4)
    result = dd.identify(recording(t, q, qd, tau * [1.0, 1.0, 0.01]), arm, "friction")
    assert any(
        "effort doubtful: the effort of joint 'elbow'" in text
        for text in result.quality["findings"]
    )
    with pytest.raises(dd.InputError, match="joint 'elbow' has the opposite sign"):
        dd.identify(recording(t, q, qd, tau * [1.0, 1.0, -1.0]), arm, "friction")


def test_noise_of_a_light_joint_is_no_fault():
    """The model may miss more than all of its torque."""
    model, t, q, qd, tau = large_arm("ur5")
    tau = np.where(np.arange(6) == 4, noise(tau, 1.0), tau)
    result = dd.identify(recorded(model, t, q, qd, tau), model, "friction")
    assert "effort doubtful" not in " ".join(result.quality["findings"])


AXES = {"prismatic": ("1 0 0", "0 1 0", "0 0 1"), "revolute": ("0 0 1",)}
MASSES = 5.0, 3.0, 1.0


def axes_alone(kind):
    """Return the URDF of linear axes that stand on one another, or of a turntable: no joint has
    gravity that changes.
    """
    parts = ["<robot name='axes'><link name='l0'/>"]
    for k, (axis, mass) in enumerate(zip(AXES[kind], MASSES, strict=False)):
        parts.append(
            f"<link name='l{k + 1}'><inertial><mass value='{mass}'/>"
            f"<inertia ixx='0.2' iyy='0.2' izz='0.2' ixy='0' ixz='0' "
            f"iyz='0'/></inertial></link><joint name='j{k + 1}' type='{kind}'>"
            f"<parent link='l{k}'/><child link='l{k + 1}'/>"
            f"<axis xyz='{axis}'/><limit lower='-9' upper='9' effort='0' velocity='0'/></joint>"
        )
    return "".join([*parts, "</robot>"])


@pytest.mark.parametrize("kind", AXES)
@pytest.mark.parametrize(
    ("factor", "key"),
    [
        (1.0, None),
        (-1.0, "the opposite sign"),
        (1000.0, r"(is|are) 1e\+03 .* model torque"),
        (0.0, "(does|do) not follow"),
    ],
)
def test_axes_whose_gravity_does_not_change(kind, factor, key):
    """Inertia tells unit and sign, though a rotor may be part of it; efforts in closed form: mass
    or inertia times q̈.
    """
    model = dd.load_urdf(axes_alone(kind))
    t, q, qd, tau = motion()
    count = model.nv
    weight = (0.0, 0.0, 9.81 * MASSES[2])[: model.nv]
    carried = np.cumsum(MASSES[::-1])[::-1] if kind == "prismatic" else np.array([0.2])
    q = q[:, :count]
    qd = qd[:, :count]
    efforts = (
        factor * (carried * np.gradient(qd, t, axis=0) + weight)
        + (factor == 0.0) * noise(tau, 1.0)[:, :count]
    )
    data = recorded(model, t, q, qd, efforts)
    if key is None:
        assert dd.identify(data, model, "friction").quality["efforts_judged"]
    else:
        with pytest.raises(dd.InputError, match=key):
            dd.identify(data, model, "friction")


def commanded(tmp_path, capsys, command, columns, *options):
    """Run a command on a table; return its status and what it said."""
    urdf = tmp_path / "desk.urdf"
    urdf.write_text(URDF)
    status = main(
        [command, str(write_table(tmp_path / "log.csv", *columns)), "--urdf", str(urdf), *options]
    )
    return status, " ".join("".join(capsys.readouterr()).split())


def test_joints_that_move_one_after_the_other(arm):
    """Stiction holds the others at any torque within their friction."""
    friction = np.array([0.03, 0.02, 0.01])
    recordings = []
    for k, level in enumerate((0.9, -0.8, 0.7)):
        moves = np.arange(3) == k
        t, q, qd, _ = motion()
        q = np.where(moves, q, 0.3)
        qd = np.where(moves, qd, 0.0)
        tau = dd.DiagonalDynamics(arm).inverse_dynamics(q, qd, np.gradient(qd, t, axis=0))
        tau += friction * np.where(moves, np.tanh(qd / arm.friction_velocity), level)
        recordings.append(recording(t, q, qd, tau))
    joints = dd.identify(recordings, arm, "friction").parameters.joints
    assert [joints[name].friction for name in JOINTS] == pytest.approx(friction, rel=0.02)
    assert max(abs(joints[name].effort_offset or 0.0) for name in JOINTS) < 2e-4
    sums = FitData(arm, None, recordings, None, False, {}).sum_recordings()
    counted = [[bool(products.any()) for products in rows[:-1]] for rows in sums]
    assert counted == np.eye(3, dtype=bool).tolist()


UNMEASURED = {
    "all": (lambda tau: 0.0 * tau, "efforts of pan, lift, elbow are 0 throughout"),
    "denormal": (lambda tau: 0.0 * tau + 1e-308, "efforts of pan, lift, elbow are 0 throughout"),
    "two constant": (
        lambda tau: tau * [1.0, 0.0, 0.0] + [0.0, 1.5, 2.5],
        "efforts of lift, elbow are constant throughout",
    ),
    "one constant": (
        lambda tau: tau * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.5],
        "efforts of elbow are constant throughout",
    ),
}


@pytest.mark.parametrize("case", UNMEASURED)
def test_efforts_that_nothing_measured(tmp_path, capsys, case):
    """All commands use the same words."""
    changed, key = UNMEASURED[case]
    t, q, qd, tau = motion()
    alarms = "-o", str(tmp_path / "alarms.yaml")
    for command, expected, *options in (
        ("identify", 0 if "constant" in case else 2),  # the model explains the other joints
        ("analyse", 1),
        ("calibrate", 1 if "constant" in case else 2, *alarms),
    ):
        status, printed = commanded(tmp_path, capsys, command, (t, q, qd, changed(tau)), *options)
        assert status == expected
        assert f"{key} (effort_available: " in printed
        assert "Traceback" not in printed


FAULTS = {
    "implausible": (
        lambda t, q, qd, tau: (
            t,
            q,
            qd,
            np.where((np.arange(len(t))[:, None] - [0, 1, 2]) % 3, 1e7, 1.0) * tau,
        ),
        "no plausible efforts of pan, lift, elbow: those",
    ),
    "one implausible": (
        lambda t, q, qd, tau: (t, q, qd, tau * [0.0, 1e7, 0.0]),
        "efforts of lift are missing or implausible throughout",
    ),
    "raw units": (lambda t, q, qd, tau: (t, q, qd, 20.0 * tau), "--what gains,friction"),
    "raw units beyond limits": (
        lambda t, q, qd, tau: (t, q, qd, 50.0 * tau),
        "no plausible efforts of lift: those",
    ),
    "velocities in degrees": (
        lambda t, q, qd, tau: (t, q, qd * [1.0, 1.0, 20.0], tau),
        "joint 'elbow'",
    ),
    "no run without a gap": (
        lambda *columns: [entry[:8] for entry in columns],
        "no run of 10 states",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_refusals_name_file_and_joint_or_remedy(tmp_path, capsys, case):
    changed, key = FAULTS[case]
    status, printed = commanded(
        tmp_path, capsys, "identify", changed(*motion()), "--what", "friction"
    )
    assert status == 2 and f"identify: '{tmp_path}/log.csv'" in printed and key in printed


def test_findings_of_several_recordings(tmp_path, capsys):
    """A finding that all share stands once; another one names its recording. Names of steps may
    have spaces.
    """
    t, q, qd, tau = motion()
    (tmp_path / "desk.urdf").write_text(URDF)
    paths = []
    for name, measured in (("a.csv", [1.0, 1.0, 1.0]), ("b.csv", [1.0, 1.0, 0.0])):
        columns = t, q, qd, (tau + 0.05 * np.tanh(qd / 5e-3)) * measured
        paths.append(str(write_table(tmp_path / name, *columns)))
    options = "--urdf", str(tmp_path / "desk.urdf"), "--what", "friction, rotors"
    for tables, owner in ((paths, f"'{paths[1]}': "), (2 * paths[1:], "")):
        assert main(["identify", *tables, *options]) == 0
        printed = capsys.readouterr().out
        assert printed.count("effort unknown") == 1
        assert f"\n  {owner}effort unknown: efforts of elbow" in printed
        assert "friction" in printed and "effort scale" not in printed


def test_implausible_efforts_of_one_recording_are_named(tmp_path, capsys):
    """In each order; the effort of the joint is missing in the other recording."""
    t, q, qd, tau = motion()
    (tmp_path / "desk.urdf").write_text(URDF)
    paths = [
        str(write_table(tmp_path / f"{k}.csv", t, q, qd, tau * [1.0, factor, 1.0]))
        for k, factor in enumerate((1e7, np.nan))
    ]
    options = "--urdf", str(tmp_path / "desk.urdf"), "-o", str(tmp_path / "alarms.yaml")
    for tables in (paths, paths[::-1]):
        main(["calibrate", *tables, *options])
        assert "efforts of lift are missing or implausible" in "".join(capsys.readouterr())


def test_thresholds_of_a_robot_at_rest(tmp_path, capsys):
    t, q, qd, tau = motion()
    columns = t, 0.0 * q + 0.3, 0.0 * qd, 0.1 + noise(tau, 0.01)
    status, printed = commanded(
        tmp_path, capsys, "calibrate", columns, "-o", str(tmp_path / "alarms.yaml")
    )
    assert status == 1 and "no joint moves: the thresholds hold for a robot at rest" in printed


def test_each_parameter_has_its_own_motion(arm):
    """The elbow moves over 0.3 rad, the pan only forward: an offset requires neither range nor both
    directions.
    """
    t, q, qd, _ = motion()
    q[:, 2], qd[:, 2] = 0.3 * q[:, 2] / np.ptp(q[:, 2]), 0.3 * qd[:, 2] / np.ptp(q[:, 2])
    q[:, 0] = 0.1 * t
    qd[:, 0] = 0.1
    tau = dd.DiagonalDynamics(arm).inverse_dynamics(q, qd, np.gradient(qd, t, axis=0))
    tau = tau + 0.03 * np.tanh(qd / 5e-3) * [0.0, 1.0, 1.0] + 0.05
    joints = dd.identify(
        recording(t, q, qd, tau + noise(tau, 0.01)), arm, "friction"
    ).parameters.joints
    assert joints["elbow"].friction == pytest.approx(0.03, rel=0.1)
    assert joints["pan"].friction is None
    for name in arm.dof_names:
        assert joints[name].effort_offset == pytest.approx(0.05, rel=0.1)


def test_joints_that_stand_are_no_evidence(tmp_path, capsys):
    """Stiction of standing joints carries any torque. A fault of a joint that moves names its
    file.
    """
    t, q, qd, tau = motion()
    *light, weak = motion(seed=4)
    standing = q.copy(), 0.0 * qd
    standing[0][:, :2] = q[0, :2]
    standing[1][:, 2] = qd[:, 2]
    alone = dd.DiagonalDynamics(dd.load_urdf(URDF)).inverse_dynamics(
        *standing, np.gradient(standing[1], t, axis=0)
    )
    options = "-o", str(tmp_path / "alarms.yaml")
    for columns, certain, expected in (
        ((t, *standing, alone * [9.0, 9.0, 1.0] + noise(alone, 0.02)), "", 0),
        ((t, q, qd, tau * [1.0, 1.0, -1.0]), "are", 2),
        ((*light, weak * [1.0, 1.0, 0.01]), "may be", 1),
    ):
        _, printed = commanded(tmp_path, capsys, "calibrate", columns, *options)
        text = re.search("log.csv': the effort of joint 'elbow'.*: thresholds (.*?) wrong", printed)
        assert (text[1] if text else "") == certain
        status, printed = commanded(tmp_path, capsys, "identify", columns, "--what", "friction")
        assert status == expected


def test_the_balance_of_a_desk_arm(tmp_path, capsys):
    """It has one in motion, though its dK/dt is less than 1 mW; efforts beyond what can be have
    none.
    """
    t, q, qd, tau = motion()
    status, printed = commanded(tmp_path, capsys, "analyse", (t, q, qd, tau))
    assert status == 0 and re.search(r"explained (0\.99|1\.00)", printed)
    status, printed = commanded(tmp_path, capsys, "analyse", (t, q, qd, 1e6 * tau))
    assert status == 1
    assert "no power balance, because efforts exceed 4 times the URDF limits" in printed


@pytest.mark.parametrize(("error", "expected"), [(0.0, 0), (2.0, 1)], ids=["perfect", "noisy"])
def test_exit_status_by_the_share_explained(tmp_path, capsys, error, expected):
    """A perfect model has nothing to identify; noise that the balance contains is doubtful."""
    t, q, qd, tau = motion()
    tau = tau + noise(tau, error) if error else tau
    status, printed = commanded(tmp_path, capsys, "identify", (t, q, qd, tau), "--what", "friction")
    assert status == expected and ("expected at least 0.8" in printed) == bool(expected)


def nothing_seen(tau, qd):
    """Noise hides a torque of any unit."""
    return (
        0.7 * noise(tau, 15.0) / 15.0 / tau.std(axis=0) + 0.5 * np.tanh(qd / 5e-3) + [0.2, 0.1, 0.3]
    )


@pytest.mark.parametrize(
    ("changed", "key"),
    [
        (nothing_seen, r"efforts not judged: no effort clearly follows the motion"),
    ],
)
def test_results_of_exit_status_1(tmp_path, capsys, changed, key):
    t, q, qd, tau = motion()
    columns = (t, q, qd, changed(tau, qd))
    out = tmp_path / "quality.json"
    status, printed = commanded(
        tmp_path, capsys, "identify", columns, "--what", "friction", "--json", str(out)
    )
    quality = json.loads(out.read_text())
    assert status == 1
    assert quality["taken"]
    assert not quality["efforts_judged"]
    assert re.search(key, printed)
