# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories that excite a robot: within every limit, from rest to rest, and well conditioned."""

import json

import numpy as np
import pinocchio as pin
import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.control.trajectory import Trajectory, Waypoints
from diag_dynamics.identification.exciting import excite
from examples import shortened
from robots import robot_path

PANDA = robot_path("panda_description/urdf/panda.urdf")
FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}


@pytest.fixture(scope="module")
def panda():
    return dd.load_urdf(PANDA, locked_joints=FINGERS)


@pytest.fixture(scope="module")
def found(panda):
    return excite(panda, ("inertias", "friction"), trials=shortened(60, 10), velocity=0.6, effort=0.8)


@pytest.fixture(scope="module")
def oracle():
    full = pin.buildModelFromUrdf(str(PANDA))
    model = pin.buildReducedModel(full, [full.getJointId(name) for name in FINGERS], pin.neutral(full))
    return model, model.createData()


def test_within_limits_from_rest_to_rest(panda, found):
    """The velocity is the slope of the position, and the acceleration that of the velocity."""
    span = panda.upper - panda.lower
    assert (found.position >= panda.lower + 0.05 * span - 1e-12).all()
    assert (found.position <= panda.upper - 0.05 * span + 1e-12).all()
    assert (abs(found.velocity) <= 0.6 * panda.velocity_limit + 1e-12).all()
    assert (abs(found.effort) <= 0.8 * panda.effort_limit).all()
    assert len(found.time) == 1001 and found.time[-1] == 20.0
    assert max(abs(column[at]).max() for column in (found.velocity, found.acceleration) for at in (0, -1)) < 1e-12
    dt = np.diff(found.time)[:, None]
    for value, slope in ((found.position, found.velocity), (found.velocity, found.acceleration)):
        middle = 0.5 * (slope[1:] + slope[:-1])
        assert abs(np.diff(value, axis=0) / dt - middle).max() < 2e-3 * abs(slope).max()


def test_effort_is_that_of_pinocchio(panda, oracle, found):
    for t in (0, 137, 500, 800):
        expected = pin.rnea(*oracle, found.position[t], found.velocity[t], found.acceleration[t])
        expected += panda.damping * found.velocity[t]
        expected += panda.friction * np.tanh(found.velocity[t] / panda.friction_velocity)
        assert np.allclose(found.effort[t], expected, rtol=1e-9, atol=1e-9)


def test_condition_is_what_an_oracle_finds(panda, oracle):
    """By Pinocchio's torque regressor, unfiltered, it is better conditioned than random trajectories."""

    def rows(one):
        weight = 1.0 / np.sqrt(one.effort.var(axis=0))
        columns = zip(one.position[::10], one.velocity[::10], one.acceleration[::10], strict=True)
        return np.vstack([weight[:, None] * pin.computeJointTorqueRegressor(*oracle, *state) for state in columns])

    others = [rows(excite(panda, "inertias", trials=1, seed=seed)) for seed in range(shortened(10, 5))]
    everything = np.vstack(others)
    scale = 1.0 / np.maximum(np.linalg.norm(everything, axis=0), 1e-9)
    _, values, basis = np.linalg.svd(everything * scale, full_matrices=False)
    basis = basis[values > 1e-5 * values[0]].T  # base parameters
    assert basis.shape[1] == 43  # of seven joints, gravity along the first one
    conditions = [np.linalg.cond(one * scale @ basis) for one in others]
    best = np.linalg.cond(rows(excite(panda, "inertias", trials=shortened(200, 60))) * scale @ basis)
    assert best < 0.75 * np.median(conditions)


def test_more_trials_are_better(panda):
    """And the same seed gives the same trajectory."""
    few, more = (excite(panda, "friction", trials=trials) for trials in (5, 30))
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
        ({"what": "colour"}, "what has 'colour'"),
        ({"what": "payload:tool"}, "what has 'payload:tool'"),
        ({"what": ()}, "what is empty"),
        ({"joints": ["elbow"]}, "joints: 'elbow' is not a joint of robot 'panda'"),
        ({"ranges": {"panda_joint1": (-9, 1)}}, "ranges: 'panda_joint1' has .*"),
        ({"ranges": {"panda_joint1": 3}}, "ranges: 'panda_joint1' has 3"),
        ({"duration": 15.0}, "duration is 15 s"),
        ({"velocity": 2.0}, "velocity is 2.0"),
        ({"effort": 0.01, "trials": 3}, "joint 'panda_joint2' would need"),
        ({"trials": 0}, "trials is 0"),
    ],
)
def test_errors(panda, options, message):
    with pytest.raises(dd.InputError, match=message):
        excite(panda, **({"trials": 1} | options))


def test_floating_base():
    with pytest.raises(dd.UnsupportedError, match="has a floating base"):
        excite(dd.load_urdf(PANDA, floating_base=True))


def test_command(panda, tmp_path, capsys):
    """It writes the trajectory and a message, which the controller's tracking takes."""
    out, message = tmp_path / "out.json", tmp_path / "out.yaml"
    locks = "locked_joints=[panda_finger_joint1=0, panda_finger_joint2=0]"
    options = ["--trials", "3", "--range", "panda_joint1=-0.5:0.5", "--set", locks, "--approach", "4"]
    assert main(["excite", "panda", *options, "-o", str(out), "--trajectory", str(message)]) == 0
    assert "panda: 20 s that excite friction, rotors" in capsys.readouterr().out
    content, sent = json.loads(out.read_text()), yaml.safe_load(message.read_text())
    points = sent["points"]
    assert sent["joint_names"] == content["joints"] == [f"panda_joint{k}" for k in range(1, 8)]
    times = [point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points]
    assert np.allclose(times, 4.0 + np.array(content["time"]), atol=1e-9) and len(times) == 1001
    columns = [np.array([point[name] for point in points]) for name in ("positions", "velocities", "accelerations")]
    for column, name in zip(columns, ("position", "velocity", "acceleration"), strict=True):
        assert np.allclose(column, content[name], atol=1e-9)
    assert abs(columns[0][:, 0]).max() <= 0.5 + 1e-9
    there = np.ones(len(points), dtype=bool)
    followed = Trajectory(Waypoints(np.array(times), *columns, there, there), panda.dof_names)
    followed.begin(0, columns[0][0], np.zeros(panda.nv))
    assert (followed.fastest() <= panda.velocity_limit).all()
    assert main(["excite", "panda", "-o", str(out), "--range", "panda_joint1"]) == 2
    assert "--range has 'panda_joint1'" in capsys.readouterr().err
    assert main(["excite", "nobody", "-o", str(out)]) == 2
