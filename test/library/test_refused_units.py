# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings in degrees: every command that reads recordings rejects them, and says how to read them."""

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from motions import fourier
from robots import description, joint, link, robot_path

UR5 = robot_path("ur_description/urdf/ur5_robot.urdf")
DEGREES = 180.0 / np.pi


@pytest.fixture(scope="module")
def arm():
    """Return a model, times, positions, velocities and efforts of 10 s, of an arm that moves about a bent pose."""
    model = dd.load_urdf(UR5)
    t = np.arange(0.0, 10.0, 0.01)
    q, qd, _ = fourier(np.random.default_rng(3), t, np.full(6, 0.2), np.full(6, 1.5))
    return model, t, q, qd, dd.DiagonalDynamics(model).gravity_torque_batch(q)


def table(path, names, t, *columns):
    header = ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau")[: len(columns)] for name in names)]
    values = np.column_stack([t, *columns])
    np.savetxt(path, values, delimiter=",", comments="", fmt="%.17g", header=",".join(header))
    return path


def units(data):
    return [finding for finding in data.findings if finding.cause == "units"]


@pytest.mark.parametrize(
    ("command", "which", "scale"),
    [
        ("analyse", "positions and velocities", {"position": "deg", "velocity": "deg/s"}),
        ("identify", "positions", {"position": "deg"}),
        ("calibrate", "velocities", {"velocity": "deg/s"}),
    ],
)
def test_commands_name_degrees_and_how_to_read_them(arm, command, which, scale, tmp_path, capsys):
    """With the map of columns that they name the recording is read, in radians."""
    model, t, q, qd, tau = arm
    in_degrees = q * (DEGREES if "position" in scale else 1.0), qd * (DEGREES if "velocity" in scale else 1.0)
    path = table(tmp_path / "degrees.csv", model.dof_names, t, *in_degrees, tau)
    options = ["--gain", "25", "-o", str(tmp_path / "alarms.yaml")] if command == "calibrate" else []
    assert main([command, str(path), "--urdf", str(UR5), *options]) != 0
    printed = " ".join("".join(capsys.readouterr()).split())
    assert f"{which} seem to be in degrees" in printed
    assert f"scale: {{{', '.join(f'{key}: {value}' for key, value in scale.items())}}}" in printed
    data = dd.read_recording(path, model, {"scale": scale})
    assert len(data) == len(t) and not units(data)
    np.testing.assert_allclose(data.q, q, atol=1e-12)
    np.testing.assert_allclose(data.qd, qd, atol=1e-12)


def test_positions_alone_in_degrees(arm, tmp_path):
    model, t, q, _, _ = arm
    data = dd.read_recording(table(tmp_path / "q.csv", model.dof_names, t, q * DEGREES), model)
    (finding,) = units(data)
    assert finding.count == len(t) and "{position: deg}" in finding.text and "velocities" not in finding.text
    for use in (lambda: dd.identify(data, model), lambda: dd.calibrate(data, dd.DiagonalDynamics(model))):
        with pytest.raises(dd.InputError, match="positions seem to be in degrees"):
            use()


@pytest.mark.parametrize(
    ("rows", "garbage", "rejected"),
    [(slice(50, None), 253.0, 950), (slice(50, None), 1e297, 950), (slice(100, 300), None, 200)],
    ids=["one number in every field", "absurd numbers", "some rows in degrees"],
)
def test_garbage_is_not_taken_for_degrees(arm, rows, garbage, rejected, tmp_path):
    model, t, q, qd, tau = arm
    q, qd = q.copy(), qd.copy()
    if garbage is None:
        q[rows] *= DEGREES
    else:
        q[rows], qd[rows] = garbage, garbage
    data = dd.read_recording(table(tmp_path / "garbage.csv", model.dof_names, t, q, qd, tau), model)
    assert data.counts["rejected: absurd value"] == rejected and not units(data)


@pytest.mark.parametrize(("speed", "rejected"), [(20.0, False), (900.0, True)])
def test_a_continuous_joint_may_be_far_round(speed, rejected, tmp_path):
    """A wheel thousands of radians round is accepted, or too fast for its limit, and never in degrees."""
    inertia = (0.02, 0.0, 0.0, 0.025, 0.0, 0.01)
    wheel = link("wheel", 1.0, (0.0, 0.0, 0.0), inertia), joint("spin", "continuous", "base", "wheel")
    model = dd.load_urdf(description("wheel", link("base"), *wheel))
    t = np.arange(0.0, 20.0, 0.02)
    turned = (100.0 + speed * t)[:, None]
    path = table(tmp_path / "wheel.csv", model.dof_names, t, turned, np.full_like(turned, speed), 0.0 * turned)
    data = dd.read_recording(path, model)
    assert (data.counts["rejected: absurd value"] == len(t)) if rejected else (len(data) == len(t))
    assert not units(data)
