# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings in degrees, and identification on recordings of real arms: errors of effort on the
other half.

Real recordings are no part of the package, so their tests are in the full tier.
"""

import gzip
import json
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.description.catalog import find_urdf
from motions import fourier
from robots import robot_path, without_hand

RECORDINGS = Path(
    os.environ.get(
        "DIAG_DYNAMICS_RECORDINGS", Path(__file__).parents[2].parent / "shared" / "recordings"
    )
)
FULL = pytest.mark.full
HELD = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
KUKA = {"time": "times", "position": "positions", "velocity": "velocities", "effort": "torques"}
PATHS = {"kuka": "kuka_lwr4/measurements_1.npz", "panda": "panda/exciting_trajectory.csv.gz"}


def path_of(name):
    path = RECORDINGS / PATHS[name]
    if not path.exists() and "DIAG_DYNAMICS_RECORDINGS" not in os.environ:
        pytest.skip(f"no recording {path} of a real arm: set DIAG_DYNAMICS_RECORDINGS")
    assert path.exists(), f"{path} is absent; expected it in DIAG_DYNAMICS_RECORDINGS"
    return path


@pytest.fixture(scope="module")
def kuka():
    """Model, and a function that reads a part of the recording [s]."""
    path = path_of("kuka")
    model = dd.load_urdf(path.with_name("kuka_lwr4.urdf"))
    columns = KUKA | {"joints": list(model.dof_names)}
    return model, lambda start, end: dd.read_recording(path, model, columns, start=start, end=end)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The Panda's table; it was recorded without its hand."""
    path = path_of("panda")
    table = tmp_path_factory.mktemp("panda") / "panda.csv"
    table.write_bytes(gzip.decompress(path.read_bytes()))
    return table


@pytest.fixture(scope="module")
def panda(measured):
    text = without_hand(Path(find_urdf("panda")).read_text(encoding="utf-8"))
    model = dd.load_urdf(text, locked_joints=HELD)
    return model, lambda start, end: dd.read_recording(measured, model, start=start, end=end)


def torque_error(model, recording):
    """Root mean square of the effort's error below 5 Hz, the mean over joints [N m]."""
    first = np.r_[True, np.diff(recording.t) > 0.0]
    t = recording.t[first]
    n = model.nv
    even = np.linspace(t[0], t[-1], len(t))
    interval = even[1] - even[0]
    columns = np.hstack([recording.q, recording.qd, recording.tau])[first]
    columns = np.column_stack([np.interp(even, t, column) for column in columns.T])
    columns = sosfiltfilt(butter(2, 5.0, fs=1.0 / interval, output="sos"), columns, axis=0)
    q, qd, tau = (np.ascontiguousarray(part) for part in np.split(columns, [n, 2 * n], axis=1))
    dynamics = dd.DiagonalDynamics(model)
    expected = dynamics.inverse_dynamics(q, qd, np.gradient(qd, interval, axis=0))
    expected += dynamics.friction_torque(qd, q)
    error = (tau - expected)[
        round(0.2 / interval) : -round(0.2 / interval)
    ]  # without what the filter makes of the ends
    return np.sqrt((error**2).mean(axis=0)).mean()


def without_friction(model):
    names = model.dof_names
    return model.with_parameters(
        {
            "joints": {
                name: {"damping": 0.0, "friction": 0.0, "effort_offset": 0.0} for name in names
            }
        }
    )


@FULL
@pytest.mark.parametrize(
    ("arm", "middle", "urdf", "friction", "inertias"),
    [("kuka", 12.57, (0.9, 1.1), 0.60, 0.27), ("panda", 10.5, (0.36, 0.42), 0.20, 0.12)],
)
def test_second_half_by_the_first(request, arm, middle, urdf, friction, inertias):
    """Torque error on the second half: of the URDF, with friction and offset, by default, fitted to
    the first half.
    """
    model, read = request.getfixturevalue(arm)
    first = read(None, middle)
    second = read(middle, None)
    assert urdf[0] < torque_error(without_friction(model), second) < urdf[1]
    for options, taken, limit in (
        ((("friction", "rotors"),), {"friction"}, friction),
        ((), {"inertias"}, inertias),
    ):
        result = dd.identify(first, model, *options)
        assert taken <= set(result.quality["taken"])
        assert "rotors" not in result.quality["taken"]  # sensors behind the gear
        assert torque_error(result.model, second) <= limit


@FULL
def test_the_wrist_whose_torque_goes_with_its_posture(kuka):
    """Its error is a curve over its position, which friction of its own would take for an offset:
    0.155 to 0.28 N m.
    """
    model, read = kuka
    result = dd.identify(read(None, None), model, ("friction", "inertias"))
    assert list(result.quality["kept"]["friction"]) == ["lwr_6_joint"]
    assert result.parameters.joints["lwr_6_joint"] == dd.JointParameters(
        armature=0.0
    )  # sensors feel no rotor
    before, after = np.transpose(list(result.quality["torque_rms"].values()))
    assert (after <= 1.1 * before).all() and after.mean() < 0.29
    assert (
        sum(
            "friction of lwr_6_joint: the model's values are kept" in warning
            for warning in result.quality["warnings"]
        )
        == 1
    )


@FULL
def test_the_hand_that_the_panda_lacks(measured):
    """A payload of minus the hand's mass: the efforts then explain the change of energy, and with
    friction nearly all.
    """
    model = dd.load_robot("panda", locked_joints=HELD)
    data = dd.read_recording(measured, model)
    for what, least in (("payload:panda_hand", 0.94), (("payload:panda_hand", "friction"), 0.97)):
        result = dd.identify(data, model, what)
        assert result.quality["payload"]["mass"] == pytest.approx(-0.7, abs=0.07)
        before, after = result.quality["explained"]
        assert before < 0.6 and after >= least
    assert 0.004 < result.quality["velocity_delay"][0] < 0.007
    unaware = dd.identify(data, model, ("friction", "rotors")).quality["warnings"]
    assert any("add payload:LINK to what" in text for text in unaware)


@FULL
@pytest.mark.parametrize(
    "hand", [False, True], ids=["without the hand", "with a hand that is not mounted"]
)
def test_balance_of_the_panda(tmp_path, hand):
    """The model without the hand explains what it should; with the hand, a payload is missing."""
    path = path_of("panda")
    urdf = tmp_path / "panda.urdf"
    out = tmp_path / "summary.json"
    text = Path(find_urdf("panda")).read_text(encoding="utf-8")
    urdf.write_text(text if hand else without_hand(text), encoding="utf-8")
    locked = f"locked_joints={[f'{name}={position}' for name, position in HELD.items()]}"
    options = ["--set", locked, "mimic=free", "--quiet", "--json", str(out)]
    status = main(["analyse", str(path), "--urdf", str(urdf), *options])
    summary = json.loads(out.read_text())
    assert summary["states"] == 20544 and status == hand
    assert summary["explained"] == pytest.approx(0.29 if hand else 0.95, abs=0.02)
    assert ("payload" in summary["balance"]["text"]) == hand
    if not hand:
        assert summary["explained_with_potential"] > 0.99
        assert summary["quality"]["velocity_delay"] == pytest.approx(0.005, abs=0.001)


@FULL
def test_balance_of_the_kuka(tmp_path):
    """In slow motion the change of kinetic and potential energy is explained."""
    path = path_of("kuka")
    out = tmp_path / "summary.json"
    urdf = str(path.with_name("kuka_lwr4.urdf"))
    main(["analyse", str(path), "--urdf", urdf, "--quiet", "--json", str(out)])
    summary = json.loads(out.read_text())
    assert summary["states"] == 5027
    assert summary["explained"] < 0.0 < 0.95 < summary["explained_with_potential"]
    with np.load(path) as arrays:  # not what was commanded
        np.testing.assert_array_equal(dd.read_recording(path, urdf).q, arrays["positions"])


UR5 = robot_path("ur_description/urdf/ur5_robot.urdf")
DEGREES = 180.0 / np.pi


@pytest.fixture(scope="module")
def arm():
    """Return a model, times, positions, velocities and efforts of 10 s, of an arm that moves about
    a bent pose.
    """
    model = dd.load_urdf(UR5)
    t = np.arange(0.0, 10.0, 0.01)
    q, qd, _ = fourier(np.random.default_rng(3), t, np.full(6, 0.2), np.full(6, 1.5))
    return model, t, q, qd, dd.DiagonalDynamics(model).gravity_torque(q)


def table(path, names, t, *columns):
    header = [
        "t",
        *(f"{kind}_{name}" for kind in ("q", "qd", "tau")[: len(columns)] for name in names),
    ]
    values = np.column_stack([t, *columns])
    np.savetxt(path, values, delimiter=",", comments="", fmt="%.17g", header=",".join(header))
    return path


@pytest.mark.parametrize(
    ("command", "scale"),
    [
        ("analyse", {"position": "deg", "velocity": "deg/s"}),
        ("identify", {"position": "deg"}),
        ("calibrate", {"velocity": "deg/s"}),
    ],
)
def test_commands_name_degrees_and_how_to_read_them(arm, command, scale, tmp_path, capsys):
    """With the column map that they name the recording is read, in radians."""
    model, t, q, qd, tau = arm
    in_degrees = (
        q * (DEGREES if "position" in scale else 1.0),
        qd * (DEGREES if "velocity" in scale else 1.0),
    )
    path = table(tmp_path / "degrees.csv", model.dof_names, t, *in_degrees, tau)
    options = (
        ["--gain", "25", "-o", str(tmp_path / "alarms.yaml")] if command == "calibrate" else []
    )
    assert main([command, str(path), "--urdf", str(UR5), *options]) != 0
    printed = " ".join("".join(capsys.readouterr()).split())
    quantity, unit = next(iter(scale.items()))
    assert f"If they are degrees, set scale: {{{quantity}: {unit}" in printed
    data = dd.read_recording(path, model, {"scale": scale})
    assert len(data) == len(t)
    np.testing.assert_allclose(data.q, q, atol=1e-12)
    np.testing.assert_allclose(data.qd, qd, atol=1e-12)


def test_few_implausible_values_are_garbage(arm, tmp_path):
    model, t, q, qd, tau = arm
    q = q.copy()
    q[100:300] *= DEGREES
    data = dd.read_recording(table(tmp_path / "garbage.csv", model.dof_names, t, q, qd, tau), model)
    assert data.counts["rejected: implausible value"] == 200
    assert not any("degrees" in finding.text for finding in data.findings)
