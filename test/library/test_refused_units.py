# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings in degrees: refused by their values, and told of as degrees, by every command that takes recordings."""

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from motions import fourier
from robots import description, joint, link, robot_path

UR5 = robot_path("ur_description/urdf/ur5_robot.urdf")
DEGREES = 180.0 / np.pi
SCALES = {"both": "position: deg, velocity: deg/s", "positions": "position: deg", "velocities": "velocity: deg/s"}
SAID = {"both": "positions and velocities"}


@pytest.fixture(scope="module")
def arm():
    """A model, times, positions, velocities and efforts of 10 s, of an arm that moves about a bent pose."""
    model = dd.load_urdf(UR5)
    t = np.arange(0.0, 10.0, 0.01)
    q, qd, _ = fourier(np.random.default_rng(3), t, np.full(6, 0.2), np.full(6, 1.5))
    return model, t, q, qd, dd.DiagonalDynamics(model).gravity_torque_batch(q)


def table(path, names, t, *columns):
    header = ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau")[: len(columns)] for name in names)]
    values = np.column_stack([t, *columns])
    np.savetxt(path, values, delimiter=",", comments="", fmt="%.17g", header=",".join(header))
    return path


@pytest.fixture(params=SCALES)
def degrees(request, arm, tmp_path):
    """Which quantities are in degrees, and the file."""
    model, t, q, qd, tau = arm
    q = q if request.param == "velocities" else q * DEGREES
    qd = qd if request.param == "positions" else qd * DEGREES
    return request.param, table(tmp_path / "degrees.csv", model.dof_names, t, q, qd, tau)


@pytest.mark.parametrize("command", ["analyse", "identify", "calibrate"])
def test_every_command_says_degrees_and_what_to_do(degrees, command, tmp_path, capsys):
    which, path = degrees
    options = ["--gain", "25", "-o", str(tmp_path / "alarms.yaml")] if command == "calibrate" else []
    assert main([command, str(path), "--urdf", str(UR5), *options]) != 0
    told = " ".join("".join(capsys.readouterr()).split())
    assert f"{SAID.get(which, which)} seem to be in degrees" in told
    assert f"scale: {{{SCALES[which]}}} in a map of columns" in told
    assert "positions then change as velocities say" in told


def test_with_what_it_says_all_of_it_is_read(arm, degrees):
    model, t, q, qd, _ = arm
    which, path = degrees
    scale = dict(one.split(": ") for one in SCALES[which].split(", "))
    data = dd.read_recording(path, model, {"scale": scale})
    assert len(data) == len(t) and not any(finding.cause == "units" for finding in data.findings)
    np.testing.assert_allclose(data.q, q, atol=1e-12)
    np.testing.assert_allclose(data.qd, qd, atol=1e-12)


def test_without_velocities_positions_are_told_of(arm, tmp_path):
    model, t, q, _, _ = arm
    data = dd.read_recording(table(tmp_path / "q.csv", model.dof_names, t, q * DEGREES), model)
    (told,) = [finding for finding in data.findings if finding.cause == "units"]
    assert told.count == len(t) and told.text.startswith("positions seem to be in degrees: ")
    assert "{position: deg}" in told.text and "velocities" not in told.text
    with pytest.raises(dd.InputError, match="positions seem to be in degrees"):
        dd.identify(data, model)
    with pytest.raises(dd.InputError, match="positions seem to be in degrees"):
        dd.calibrate(data, dd.DiagonalDynamics(model))


@pytest.mark.parametrize("value", [253.0, 1e297, 500.0])
def test_garbage_is_no_degree(arm, value, tmp_path):
    """Most rows have one number in every field; and positions that as degrees are beyond the limits as well."""
    model, t, q, qd, tau = arm
    q, qd = q.copy(), qd.copy()
    q[50:], qd[50:] = value, value
    data = dd.read_recording(table(tmp_path / "garbage.csv", model.dof_names, t, q, qd, tau), model)
    assert data.counts["rejected: absurd value"] > 900
    assert not any(finding.cause == "units" for finding in data.findings)


def test_a_row_in_degrees_among_others_is_none(arm, tmp_path):
    model, t, q, qd, tau = arm
    q, qd = q.copy(), qd.copy()
    q[100:300] *= DEGREES
    data = dd.read_recording(table(tmp_path / "some.csv", model.dof_names, t, q, qd, tau), model)
    assert data.counts["rejected: absurd value"] == 200
    assert not any(finding.cause == "units" for finding in data.findings)


@pytest.mark.parametrize(("speed", "refused"), [(20.0, False), (900.0, True)])
def test_a_joint_that_turns_for_ever_may_be_far_round(speed, refused, tmp_path):
    """A wheel thousands of radians round: taken as it is, or too fast for its limit, and never called degrees."""
    inertia = (0.02, 0.0, 0.0, 0.025, 0.0, 0.01)
    wheel = link("wheel", 1.0, (0.0, 0.0, 0.0), inertia), joint("spin", "continuous", "base", "wheel")
    model = dd.load_urdf(description("wheel", link("base"), *wheel))
    t = np.arange(0.0, 100.0, 0.02)
    turned = (speed * t)[:, None]
    path = table(tmp_path / "wheel.csv", model.dof_names, t, turned, np.full_like(turned, speed), 0.0 * turned)
    data = dd.read_recording(path, model)
    assert (data.counts["rejected: absurd value"] == len(t)) if refused else (len(data) == len(t))
    assert not any("degrees" in finding.text for finding in data.findings)
