# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exciting trajectories: limits, rest, efforts, and the message that the controller takes."""

import json

import numpy as np
import pytest
import yaml

import diag_dynamics as dd
from controlled import FINGERS, PANDA
from diag_dynamics import excite
from diag_dynamics.cli.main import main
from diag_dynamics.control.references import Trajectory, Waypoints
from examples import shortened
from motions import efforts
from oracles import Oracle


@pytest.fixture(scope="module")
def arm():
    return dd.load_urdf(PANDA.urdf, locked_joints=FINGERS)


@pytest.fixture(scope="module")
def found(arm):
    return excite(arm, ("inertias", "friction"), trials=shortened(60, 10), velocity=0.6, effort=0.8)


def test_within_limits_from_rest_to_rest(arm, found):
    """The velocity is the slope of the position, and the acceleration that of the velocity."""
    span = arm.upper - arm.lower
    assert (found.position >= arm.lower + 0.05 * span - 1e-12).all()
    assert (found.position <= arm.upper - 0.05 * span + 1e-12).all()
    assert (abs(found.velocity) <= 0.6 * arm.velocity_limit + 1e-12).all()
    assert (abs(found.effort) <= 0.8 * arm.effort_limit).all()
    assert len(found.time) == 1001 and found.time[-1] == 20.0
    assert (
        max(
            abs(column[at]).max()
            for column in (found.velocity, found.acceleration)
            for at in (0, -1)
        )
        < 1e-12
    )
    dt = np.diff(found.time)[:, None]
    for value, slope in ((found.position, found.velocity), (found.velocity, found.acceleration)):
        middle = 0.5 * (slope[1:] + slope[:-1])
        assert abs(np.diff(value, axis=0) / dt - middle).max() < 2e-3 * abs(slope).max()


def test_effort_is_that_of_pinocchio(arm, found):
    q, qd, qdd = (column[::97] for column in (found.position, found.velocity, found.acceleration))
    expected = efforts(Oracle(PANDA.urdf, arm.dof_names, locked_joints=FINGERS), q, qd, qdd)
    expected += arm.damping * qd + arm.friction * np.tanh(qd / arm.friction_velocity)
    assert np.allclose(found.effort[::97], expected, rtol=1e-9, atol=1e-9)


def test_joints_ranges_and_seeds(arm):
    names = arm.dof_names
    options = {
        "joints": names[2:5],
        "ranges": {names[2]: (0.0, 0.4)},
        "trials": 5,
        "duration": 10.0,
    }
    entry, same = (excite(arm, "friction", **options) for _ in range(2))
    assert np.array_equal(entry.position, same.position)
    assert excite(arm, "friction", **(options | {"trials": 30})).condition < entry.condition
    assert (entry.velocity[:, [0, 1, 5, 6]] == 0.0).all()
    assert entry.position[:, 2].min() >= -1e-12 and entry.position[:, 2].max() <= 0.4 + 1e-12
    assert np.ptp(entry.position[:, 3]) > 0.1


PIECE = (
    '<link name="{0}"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="{0}_joint" type="{1}"><parent link="{2}"/><child link="{0}"/>'
    '<axis xyz="0 1 0"/>{3}</joint>'
)


def two_joints(*limits, kind="revolute"):
    """Return the URDF of two joints, each with the attributes of its limit."""
    elements = [f"<limit {limit}/>" if limit else "" for limit in limits]
    pieces = [
        PIECE.format(*entry)
        for entry in zip(("upper", "lower"), (kind,) * 2, ("base", "upper"), elements, strict=True)
    ]
    return f'<robot name="two"><link name="base"/>{"".join(pieces)}</robot>'


FILLED = 'lower="-1" upper="1" effort="40" velocity="2"'
ZERO = 'lower="0" upper="0" effort="0" velocity="0"'
BOTH = "upper_joint, lower_joint"


@pytest.mark.parametrize(
    ("limits", "kind", "velocity", "position"),
    [
        ((FILLED, ZERO), "revolute", "lower_joint", "lower_joint"),
        (("", ""), "revolute", BOTH, BOTH),
        ((FILLED.replace('"2"', '"-1"'),) * 2, "revolute", BOTH, None),
        (('lower="-inf" upper="inf" effort="inf" velocity="inf"',) * 2, "prismatic", BOTH, BOTH),
        (('lower="-1e16" upper="1e16" effort="40" velocity="1e30"',) * 2, "revolute", BOTH, BOTH),
        ((FILLED, FILLED.replace('"1"', '"-1"')), "revolute", None, "lower_joint"),
        (('effort="40" velocity="0"',) * 2, "continuous", BOTH, BOTH),
    ],
    ids=["zero", "absent", "negative", "infinite", "placeholder", "lower is upper", "continuous"],
)
def test_limits_that_nobody_filled_in(limits, kind, velocity, position):
    """The joints are named; with limits that are given no plan exceeds any."""
    model = dd.load_urdf(two_joints(*limits, kind=kind))
    with pytest.raises(dd.InputError) as error:
        excite(model, trials=2)
    for which, names in (("Velocity", velocity), ("Position", position)):
        key = f"{which} limits of {names} are missing" if names else f"{which} limits"
        assert (key in str(error.value)) == bool(names)
    fast = {"*": 0.3} if velocity else None
    there = {"*": (-0.4, 0.2)} if position else None
    result = excite(model, trials=2, velocity=1.0, velocity_limits=fast, ranges=there)
    slow, narrow = (
        np.array([name in (names or "") for name in BOTH.split(", ")])
        for names in (velocity, position)
    )
    assert (abs(result.velocity).max(axis=0) <= np.where(slow, 0.3, 2.0) + 1e-12).all()
    assert (result.position >= np.where(narrow, -0.4, -1.6)).all()
    assert (result.position <= np.where(narrow, 0.2, 1.6)).all()
    assert (np.ptp(result.position, axis=0) > 0.01).all()


@pytest.mark.parametrize(
    ("options", "key"),
    [
        (
            {"velocity_limits": {"upper_joint": 3.0}},
            "Velocity limits of 'upper_joint' are .*3.0.* within 0 … 2",
        ),
        ({"joints": ()}, "move more joints"),
        ({"what": "payload:tool"}, "'tool'; expected"),
        ({"joints": ["elbow"]}, "joints: one of them is 'elbow'"),
        ({"ranges": {"upper_joint": (-9, 1)}}, "Position limits of 'upper_joint' are .*-9"),
        (
            {"ranges": {"upper_joint": (0.5, 0.5 + 1e-9)}},
            "'upper_joint' are .* that rise by 0.0001",
        ),
        ({"duration": 15.0}, "duration is 15 s"),
        ({"velocity": 2.0}, "velocity is 2.0"),
        ({"effort": 1e-3, "trials": 3}, "within the limits of effort"),
        ({"rate": 0.1}, "rate is 0.1 1/s; expected at least 1 1/s"),
    ],
)
def test_wrong_arguments(options, key):
    with pytest.raises(dd.InputError, match=key):
        excite(
            dd.load_urdf(two_joints(FILLED, FILLED)),
            **({"what": "friction", "trials": 2} | options),
        )


def test_no_plan_exceeds_limits_between_its_points():
    """The points are coarse; a plan of the same seed with a hundred times as many shows the motion
    between them.
    """
    model = dd.load_urdf(two_joints(FILLED, FILLED))
    options = {"trials": 1, "velocity": 1.0}
    coarse, fine = (excite(model, "friction", rate=rate, **options) for rate in (2.0, 200.0))
    np.testing.assert_allclose(coarse.position, fine.position[::100], atol=1e-12)
    assert abs(fine.velocity).max() <= 2.0 * (1.0 + 1e-4) and abs(fine.position).max() <= 1.0 + 1e-4


def test_command(arm, tmp_path, capsys):
    """The command writes the trajectory, and a message that the controller follows within the
    limits of velocity.
    """
    out = tmp_path / "out.json"
    message = tmp_path / "out.yaml"
    locks = "locked_joints=[panda_finger_joint1=0, panda_finger_joint2=0]"
    options = [
        "--trials",
        "3",
        "--range",
        "panda_joint1=-0.5:0.5",
        "--set",
        locks,
        "--approach",
        "4",
    ]
    assert main(["excite", "panda", *options, "-o", str(out), "--trajectory", str(message)]) == 0
    content = json.loads(out.read_text())
    sent = yaml.safe_load(message.read_text())
    points = sent["points"]
    assert sent["joint_names"] == content["joints"] == list(arm.dof_names)
    times = [
        point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"]
        for point in points
    ]
    assert np.allclose(times, 4.0 + np.array(content["time"]), atol=1e-9) and len(times) == 1001
    columns = [
        np.array([point[name] for point in points])
        for name in ("positions", "velocities", "accelerations")
    ]
    np.testing.assert_allclose(
        columns, [content[name] for name in ("position", "velocity", "acceleration")], atol=1e-9
    )
    assert abs(columns[0][:, 0]).max() <= 0.5 + 1e-9
    there = np.ones(len(points), bool)
    followed = Trajectory(Waypoints(np.array(times), *columns, there, there), arm.dof_names)
    followed.begin(0, columns[0][0], np.zeros(arm.nv))
    assert (followed.fastest() <= arm.velocity_limit).all()
    out.unlink()
    fixed = tmp_path / "fixed.urdf"
    zero = tmp_path / "zero.urdf"
    fixed.write_text(two_joints(FILLED, FILLED, kind="fixed"))
    zero.write_text(two_joints(ZERO, ZERO))
    for arguments, key in (
        (["panda", "--range", "panda_joint1"], "'--range' has 'panda_joint1'"),
        (["panda", "--range", "panda_joint1=1"], "--range has 'panda_joint1=1'; expected JOINT="),
        (["panda", "--velocity-limit", "panda_joint1=x"], "'--velocity-limit' has"),
        (["panda", "--set", "floating_base=true"], "floating"),
        ([str(fixed)], "robot 'two' has no degrees of freedom"),
        ([str(zero)], "Give --velocity-limit JOINT=LIMIT (velocity_limits). Position"),
    ):
        assert main(["excite", *arguments, "-o", str(out)]) == 2 and not out.exists()
        assert key in capsys.readouterr().err
