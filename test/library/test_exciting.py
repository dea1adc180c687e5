# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories that excite a robot: within every limit, from rest to rest, and telling what they are to tell."""

import json

import numpy as np
import pinocchio as pin
import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.control.trajectory import Trajectory, Waypoints
from diag_dynamics.identification.exciting import excite
from robots import robot_path

PANDA = robot_path("panda_description/urdf/panda.urdf")
FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}


@pytest.fixture(scope="module")
def panda():
    return dd.load_urdf(PANDA, locked_joints=FINGERS)


@pytest.fixture(scope="module")
def found(panda):
    return excite(panda, ("inertias", "friction"), trials=60, velocity=0.6, effort=0.8)


def test_within_limits(panda, found):
    span = panda.upper - panda.lower
    assert (found.position >= panda.lower + 0.05 * span - 1e-12).all()
    assert (found.position <= panda.upper - 0.05 * span + 1e-12).all()
    assert (abs(found.velocity) <= 0.6 * panda.velocity_limit + 1e-12).all()
    assert (abs(found.effort) <= 0.8 * panda.effort_limit).all()
    assert len(found.time) == 1001
    assert found.time[-1] == 20.0


def test_from_rest_to_rest(found):
    """And what is called the velocity is the slope of the position, and so on."""
    for at in (0, -1):
        assert abs(found.velocity[at]).max() < 1e-12
        assert abs(found.acceleration[at]).max() < 1e-12
    dt = np.diff(found.time)[:, None]
    for value, slope in ((found.position, found.velocity), (found.velocity, found.acceleration)):
        middle = 0.5 * (slope[1:] + slope[:-1])
        assert abs(np.diff(value, axis=0) / dt - middle).max() < 2e-3 * abs(slope).max()


def test_effort_is_that_of_pinocchio(panda, found):
    full = pin.buildModelFromUrdf(str(PANDA))
    model = pin.buildReducedModel(full, [full.getJointId(name) for name in FINGERS], pin.neutral(full))
    data = model.createData()
    for t in (0, 137, 500, 800):
        wanted = pin.rnea(model, data, found.position[t], found.velocity[t], found.acceleration[t])
        wanted += panda.damping * found.velocity[t]
        wanted += panda.friction * np.tanh(found.velocity[t] / panda.friction_velocity)
        assert np.allclose(found.effort[t], wanted, rtol=1e-9, atol=1e-9)


def test_condition_is_what_an_oracle_finds(panda):
    """Pinocchio's torque regressor, unfiltered: better conditioned than over ten trajectories by chance."""
    full = pin.buildModelFromUrdf(str(PANDA))
    model = pin.buildReducedModel(full, [full.getJointId(name) for name in FINGERS], pin.neutral(full))
    data = model.createData()

    def rows(one):
        weight = 1.0 / np.sqrt(one.effort.var(axis=0))
        stacked = [
            weight[:, None] * pin.computeJointTorqueRegressor(model, data, q, v, a)
            for q, v, a in zip(one.position[::10], one.velocity[::10], one.acceleration[::10], strict=True)
        ]
        return np.vstack(stacked)

    others = [rows(excite(panda, "inertias", trials=1, seed=seed)) for seed in range(10)]
    everything = np.vstack(others)
    scale = 1.0 / np.maximum(np.linalg.norm(everything, axis=0), 1e-9)
    _, values, basis = np.linalg.svd(everything * scale, full_matrices=False)
    basis = basis[values > 1e-5 * values[0]].T  # base parameters
    assert basis.shape[1] == 43  # of seven joints, gravity along the first one
    conditions = [np.linalg.cond(one * scale @ basis) for one in others]
    best = np.linalg.cond(rows(excite(panda, "inertias", trials=200)) * scale @ basis)
    assert best < 0.75 * np.median(conditions)


def test_more_trials_are_better(panda):
    """And the same seed gives the same trajectory."""
    few, more = (excite(panda, "friction", trials=trials) for trials in (5, 80))
    assert more.condition < few.condition
    again = excite(panda, "friction", trials=5)
    assert np.array_equal(again.position, few.position)


def test_joints_and_ranges(panda):
    names = panda.dof_names
    one = excite(panda, "friction", joints=names[2:5], ranges={names[2]: (0.0, 0.4)}, trials=5, duration=10.0)
    assert (one.velocity[:, [0, 1, 5, 6]] == 0.0).all()
    assert one.position[:, 2].min() >= -1e-12
    assert one.position[:, 2].max() <= 0.4 + 1e-12
    assert np.ptp(one.position[:, 3]) > 0.1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"what": "colour"}, "what has 'colour', expected some of friction, rotors, inertias, payload:<link>"),
        ({"what": "payload:tool"}, "what has 'payload:tool', expected"),
        ({"what": ()}, "what is empty"),
        ({"joints": ["elbow"]}, "joints: 'elbow' is not a joint of robot 'panda'"),
        ({"ranges": {"panda_joint1": (-9, 1)}}, "ranges: 'panda_joint1' has .*, expected a lower and an upper bound"),
        ({"ranges": {"panda_joint1": 3}}, "ranges: 'panda_joint1' has 3, expected"),
        ({"duration": 15.0}, "duration is 15 s, expected a whole number of periods of 10 s"),
        ({"velocity": 2.0}, "velocity is 2.0, expected a number within 0 … 1"),
        ({"effort": 0.01, "trials": 3}, "joint 'panda_joint2' would need .* times the effort that may be used"),
        ({"trials": 0}, "trials is 0, expected"),
    ],
)
def test_errors(panda, options, message):
    with pytest.raises(dd.InputError, match=message):
        excite(panda, **({"trials": 1} | options))


def test_floating_base():
    with pytest.raises(dd.UnsupportedError, match="has a floating base"):
        excite(dd.load_urdf(PANDA, floating_base=True))


def check_tracking_takes(sent):
    """The controller's trajectory goes through the points, no faster than the robot can."""
    panda, points = dd.load_urdf(PANDA, locked_joints=FINGERS), sent["points"]
    times = [point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points]
    columns = [np.array([point[name] for point in points]) for name in ("positions", "velocities", "accelerations")]
    there = np.ones(len(points), dtype=bool)
    followed = Trajectory(Waypoints(np.array(times), *columns, there, there), panda.dof_names)
    followed.begin(0, columns[0][0], np.zeros(panda.nv))
    assert (followed.fastest() <= panda.velocity_limit).all()


def test_command(tmp_path, capsys):
    out, message = tmp_path / "out.json", tmp_path / "out.yaml"
    locks = "locked_joints=[panda_finger_joint1=0, panda_finger_joint2=0]"
    options = ["--trials", "3", "--range", "panda_joint1=-0.5:0.5", "--set", locks, "--approach", "4"]
    assert main(["excite", "panda", *options, "-o", str(out), "--trajectory", str(message)]) == 0
    said = capsys.readouterr().out
    assert "panda: 20 s that excite friction, rotors" in said
    assert "Nobody has looked whether the robot hits itself" in said
    content, sent = json.loads(out.read_text()), yaml.safe_load(message.read_text())
    assert sent["joint_names"] == content["joints"] == [f"panda_joint{k}" for k in range(1, 8)]
    assert len(sent["points"]) == len(content["time"]) == 1001
    assert sent["points"][0]["time_from_start"] == {"sec": 4, "nanosec": 0}
    assert sent["points"][-1]["time_from_start"] == {"sec": 24, "nanosec": 0}
    assert np.allclose(sent["points"][500]["positions"], content["position"][500], atol=1e-9)
    assert np.allclose(sent["points"][500]["accelerations"], content["acceleration"][500], atol=1e-9)
    assert abs(np.array(content["position"])[:, 0]).max() <= 0.5 + 1e-9
    check_tracking_takes(sent)
    assert main(["excite", "panda", "-o", str(out), "--range", "panda_joint1"]) == 2
    assert "--range has 'panda_joint1', expected JOINT=LOWER:UPPER" in capsys.readouterr().err
    assert main(["excite", "nobody", "-o", str(out)]) == 2
