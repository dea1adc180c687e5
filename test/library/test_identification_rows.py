# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inside identification: inertias, the solver, regressors, rows, portions of recordings; exciting trajectories."""

import json

import numpy as np
import pinocchio as pin
import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.cli.main import main
from diag_dynamics.control.trajectory import Trajectory, Waypoints
from diag_dynamics.identification import inertias
from diag_dynamics.identification.equations import Equations
from diag_dynamics.identification.exciting import excite
from diag_dynamics.identification.regressors import regressors
from diag_dynamics.identification.segments import Segment
from diag_dynamics.identification.sifting import Beginnings
from diag_dynamics.identification.solver import Body, Problem, solved
from examples import shortened, some_of
from oracles import Oracle
from robots import random_robots, robot

PANDA = robot("panda_description/urdf/panda.urdf")
ROBOTS = [
    PANDA,
    robot("ur_description/urdf/ur5_robot.urdf").floating,
    *random_robots()[2:4],
    robot("ur_description/urdf/ur5_robot.urdf"),
    robot("talos_data/robots/talos_reduced.urdf").floating,
    *random_robots()[4:6],
]
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
SOME = pytest.mark.parametrize("one", list(some_of(ROBOTS, 2)), ids=lambda one: one.id)


def test_parameters_are_pinocchios():
    rng = np.random.default_rng(0)
    for _ in range(20):
        body = pin.Inertia(rng.uniform(0.1, 3.0), rng.normal(size=3), pin.Inertia.Random().inertia)
        M = pin.SE3.Random()
        ours = inertias.of_body(body.mass, body.lever, body.inertia)
        np.testing.assert_allclose(ours, body.toDynamicParameters(), atol=1e-12)
        np.testing.assert_allclose(
            inertias.moved(ours, M.homogeneous), M.act(body).toDynamicParameters(), rtol=1e-11, atol=1e-11
        )
        mass, centre, about = inertias.about_centre(ours)
        assert mass == pytest.approx(body.mass)
        np.testing.assert_allclose(centre, body.lever, atol=1e-12)
        np.testing.assert_allclose(about, body.inertia, atol=1e-10)


def test_positive_numbers_have_a_closed_form():
    """min ½ a x² − b x − γ' ln x is at (b + √(b² + 4 a γ')) / 2a, also where least squares is negative."""
    for a, b in ((4.0, 8.0), (4.0, -8.0), (1e6, -1e3)):
        problem = Problem(np.array([[a]]), np.array([b]), [], np.array([0]), 0.01)
        expected = (b + np.sqrt(b * b + 0.04 * a)) / (2.0 * a)
        assert solved(problem, np.array([0.1])).x[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("seed", range(0, 8, 2))
def test_every_solution_is_physical(seed):
    """Rows of an impossible body, also a thousand times more certain than the prior; without rows, the prior."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(4, 4))
    prior = a @ a.T + 0.01 * np.eye(4)
    rows = rng.normal(size=(seed, 10)) * 10.0 ** rng.uniform(0, 4, size=(seed, 1))
    target = rng.normal(size=10)
    body = Body(0, prior, 10.0, np.zeros((4, 4)))
    problem = Problem(rows.T @ rows, rows.T @ (rows @ target), [body], np.zeros(0, int), 0.01)
    solution = solved(problem, inertias.parameters_of_pseudo(prior))
    assert inertias.is_physical(solution.x)
    gradient = problem.A @ solution.x - problem.b
    J = inertias.pseudo_inertia(solution.x)
    barrier = 10.0 * np.tensordot(inertias.BASIS, np.linalg.inv(prior) - np.linalg.inv(J), 2)
    scale = np.abs(gradient).max() + 10.0 * np.abs(np.linalg.inv(J)).max()
    np.testing.assert_allclose(gradient, -barrier, atol=1e-4 * scale)


def random_inertia(rng):
    inertia = pin.Inertia.Random()
    return pin.Inertia(rng.uniform(0.1, 5.0), rng.normal(size=3), inertia.inertia)


def of_bodies(model, oracle, rng):
    """A random inertia for each body, as parameters in Pinocchio's frame of its joint and in the library's."""
    for body in range(1, len(model.bodies)):
        record = model.bodies[body]
        if record["rank"] < record["dofs"] - 1:
            continue
        link = model.link_names[record["link"]]
        placed, placement = model.placement_in_body(link)
        assert placed == body
        frame = oracle.model.frames[oracle.model.getFrameId(link, pin.FrameType.BODY)]
        np.testing.assert_allclose(frame.placement.homogeneous, np.eye(4), atol=1e-12)
        for _ in range(11):  # ten span all there are
            inertia = random_inertia(rng)
            turned = pin.SE3(placement).act(inertia)
            yield body - 1, frame.parentJoint - 1, turned.toDynamicParameters(), inertia.toDynamicParameters()


def close(found, expected, scale):
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * max(scale, 1e-9))


@SOME
def test_columns_are_pinocchios(one):
    """Y_p, Y_g, y_K and y_U are its regressors; Y_∂ times parameters is C_sᵀq̇ with its Coriolis matrix."""
    model = dd.load_urdf(one.urdf, mimic="free", **one.options)
    oracle = Oracle(one.urdf, model.dof_names, floating_base=model.floating_base)
    rng = np.random.default_rng(2)
    Q, QD = np.array([model.random(rng) for _ in range(2)]), rng.normal(size=(2, model.nv))
    found = regressors(model, Q, QD)
    for t in range(2):
        q, v, none = oracle.configuration(Q[t]), oracle.to_pin(QD[t]), np.zeros(model.nv)
        gravity = pin.computeJointTorqueRegressor(oracle.model, oracle.data, q, none, none).copy()
        momentum = pin.computeJointTorqueRegressor(oracle.model, oracle.data, q, none, v) - gravity
        kinetic = pin.computeKineticEnergyRegressor(oracle.model, oracle.data, q, v).copy()
        potential = pin.computePotentialEnergyRegressor(oracle.model, oracle.data, q).copy()
        size = 10.0 * (1.0 + np.abs(momentum).max() + np.abs(gravity).max())
        parameters = np.zeros(found.kinetic.shape[1])
        for body, joint, ours, theirs in of_bodies(model, oracle, rng):
            own, its = slice(10 * body, 10 * body + 10), slice(10 * joint, 10 * joint + 10)
            scale = size * np.abs(theirs).max()
            close(found.momentum[t][:, own] @ ours, oracle.from_pin(momentum[:, its] @ theirs), scale)
            close(found.gravity[t][:, own] @ ours, oracle.from_pin(gravity[:, its] @ theirs), scale)
            close(found.kinetic[t, own] @ ours, kinetic[its] @ theirs, scale)
            close(found.potential[t, own] @ ours, potential[its] @ theirs, scale)
            parameters[own] = ours
            oracle.model.inertias[joint + 1] = pin.Inertia.FromDynamicParameters(theirs)
        C = pin.computeCoriolisMatrix(oracle.model, oracle.model.createData(), q, v)
        expected = oracle.from_pin(C.T @ v)
        np.testing.assert_allclose(found.velocity[t] @ parameters, expected, atol=1e-12 * (1.0 + np.abs(C).max()))


def coupling(model, free):
    """G and q₀ of q = G q_r + q₀: positions of all joints from those of the independent ones."""
    G, start = np.zeros((free.nv, model.nv)), np.zeros(free.nv)
    for row, name in enumerate(free.dof_names):
        leader, multiplier, start[row] = model.mimics.get(name, (name, 1.0, 0.0))
        G[row, model.dof_names.index(leader)] = multiplier
    return G, start


def test_followers_are_reflected_to_leaders():
    """Rows of an embedded mimic are Gᵀ times those of all joints free, whose own are Pinocchio's."""
    model, free = (dd.load_urdf(PANDA.urdf, mimic=mimic) for mimic in ("embed", "free"))
    assert free.nv == model.nv + 1
    G, start = coupling(model, free)
    oracle = Oracle(PANDA.urdf, free.dof_names)
    rng = np.random.default_rng(4)
    q, qd = model.random(rng), rng.normal(size=model.nv)
    found = regressors(model, q[None], qd[None])
    pq, pv, none = oracle.configuration(G @ q + start), oracle.to_pin(G @ qd), np.zeros(free.nv)
    gravity = pin.computeJointTorqueRegressor(oracle.model, oracle.data, pq, none, none).copy()
    momentum = pin.computeJointTorqueRegressor(oracle.model, oracle.data, pq, none, pv) - gravity
    for body, joint, ours, theirs in of_bodies(model, oracle, rng):
        own, its = slice(10 * body, 10 * body + 10), slice(10 * joint, 10 * joint + 10)
        scale = 100.0 * np.abs(theirs).max()
        close(found.momentum[0][:, own] @ ours, G.T @ oracle.from_pin(momentum[:, its] @ theirs), scale)
        close(found.gravity[0][:, own] @ ours, G.T @ oracle.from_pin(gravity[:, its] @ theirs), scale)


def test_filtered_rows_hold_for_the_true_parameters():
    """Rows times parameters are Pinocchio's filtered efforts, with an error of second order in the interval.

    The stamps are irregular and have a gap; rotors and friction are included.
    """
    model = dd.load_urdf(PANDA.urdf, mimic="free", armature=0.2)
    oracle = Oracle(PANDA.urdf, model.dof_names)
    errors = []
    for interval in (4e-3, 1e-3):
        rng = np.random.default_rng(5)
        t = np.cumsum(rng.uniform(0.5, 1.5, round(3.0 / interval))) * interval
        w, phase = rng.uniform(2.0, 4.0, model.nv), rng.uniform(0.0, 6.0, model.nv)
        mean = np.where(np.isfinite(model.lower), 0.5 * (model.lower + model.upper), 0.0)
        q = mean + 0.3 * np.sin(t[:, None] * w + phase)
        qd, qdd = 0.3 * w * np.cos(t[:, None] * w + phase), -0.3 * w**2 * np.sin(t[:, None] * w + phase)
        tau = 0.2 * qdd + 0.7 * qd + 0.4 * np.tanh(qd / 0.5) - 0.1
        for k in range(len(t)):
            arguments = oracle.configuration(q[k]), oracle.to_pin(qd[k]), oracle.to_pin(qdd[k])
            tau[k] += oracle.from_pin(pin.rnea(oracle.model, oracle.data, *arguments))
        segment = Segment(np.round(t * 1e9).astype(int), t, q, qd, tau)
        equations = Equations(model, 2.0 * np.pi, 0.5)
        third = len(t) // 3
        equations.take(segment.part(slice(0, third)))
        equations.take(segment.part(slice(third, 2 * third)), anew=False)
        equations.take(segment.part(slice(2 * third + 50, None)))
        sums = equations.sums()
        known = [inertias.parameters_of_record(model.bodies[body]) for body in equations.bodies]
        x = np.concatenate([*known, np.tile([0.7, 0.4, -0.1, 0.2], model.nv)])
        errors.append(np.sqrt(sums.squared_residuals(x) / (sums.effort / sums.weight)).max())
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 8.0


@pytest.mark.parametrize(
    ("stamps", "begins"),
    [
        (range(40), []),
        ([*range(20), 18, *range(20, 40)], []),  # one late row
        ([*range(20), *range(12, 40)], []),  # a stretch that was written twice
        ([*range(20), *range(20)], [20]),
        ([*range(20), *range(5)], []),  # too short to tell
        ([*range(100, 120), *range(50, 70), *range(15)], [20, 40]),
    ],
)
def test_time_begins_anew_where_stamps_go_on_from_before(stamps, begins):
    stamps = np.array(stamps)
    assert Beginnings().among(stamps, len(stamps)) == begins
    one_by_one = Beginnings()
    assert [k for k in range(len(stamps)) if one_by_one.among(stamps[k:], 1)] == begins


FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}


@pytest.fixture(scope="module")
def arm():
    return dd.load_urdf(PANDA.urdf, locked_joints=FINGERS)


@pytest.fixture(scope="module")
def found(arm):
    return excite(arm, ("inertias", "friction"), trials=shortened(60, 10), velocity=0.6, effort=0.8)


@pytest.fixture(scope="module")
def oracle():
    full = pin.buildModelFromXML(PANDA.urdf)
    model = pin.buildReducedModel(full, [full.getJointId(name) for name in FINGERS], pin.neutral(full))
    return model, model.createData()


def test_within_limits_from_rest_to_rest(arm, found):
    """The velocity is the slope of the position, and the acceleration that of the velocity."""
    span = arm.upper - arm.lower
    assert (found.position >= arm.lower + 0.05 * span - 1e-12).all()
    assert (found.position <= arm.upper - 0.05 * span + 1e-12).all()
    assert (abs(found.velocity) <= 0.6 * arm.velocity_limit + 1e-12).all()
    assert (abs(found.effort) <= 0.8 * arm.effort_limit).all()
    assert len(found.time) == 1001 and found.time[-1] == 20.0
    assert max(abs(column[at]).max() for column in (found.velocity, found.acceleration) for at in (0, -1)) < 1e-12
    dt = np.diff(found.time)[:, None]
    for value, slope in ((found.position, found.velocity), (found.velocity, found.acceleration)):
        middle = 0.5 * (slope[1:] + slope[:-1])
        assert abs(np.diff(value, axis=0) / dt - middle).max() < 2e-3 * abs(slope).max()


def test_effort_is_that_of_pinocchio(arm, oracle, found):
    for t in (0, 137, 500, 800):
        expected = pin.rnea(*oracle, found.position[t], found.velocity[t], found.acceleration[t])
        expected += arm.damping * found.velocity[t]
        expected += arm.friction * np.tanh(found.velocity[t] / arm.friction_velocity)
        assert np.allclose(found.effort[t], expected, rtol=1e-9, atol=1e-9)


def test_joints_ranges_and_seeds(arm):
    names = arm.dof_names
    options = {"joints": names[2:5], "ranges": {names[2]: (0.0, 0.4)}, "trials": 5, "duration": 10.0}
    one, same = (excite(arm, "friction", **options) for _ in range(2))
    assert np.array_equal(one.position, same.position)
    assert excite(arm, "friction", **(options | {"trials": 30})).condition < one.condition
    assert (one.velocity[:, [0, 1, 5, 6]] == 0.0).all()
    assert one.position[:, 2].min() >= -1e-12 and one.position[:, 2].max() <= 0.4 + 1e-12
    assert np.ptp(one.position[:, 3]) > 0.1


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"what": "payload:tool"}, "what has 'payload:tool'"),
        ({"joints": ["elbow"]}, "joints: 'elbow' is not a joint"),
        ({"ranges": {"panda_joint1": (-9, 1)}}, "ranges: 'panda_joint1'"),
        ({"duration": 15.0}, "duration is 15 s"),
        ({"velocity": 2.0}, "velocity is 2.0"),
        ({"effort": 0.01, "trials": 3}, "joint 'panda_joint2' would need"),
    ],
)
def test_errors(arm, options, key):
    with pytest.raises(dd.InputError, match=key):
        excite(arm, **({"trials": 1} | options))


PIECE = (
    '<link name="{0}"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="{0}_joint" type="{1}"><parent link="{2}"/><child link="{0}"/><axis xyz="0 1 0"/>{3}</joint>'
)


def two_joints(*limits, kind="revolute"):
    """Return the URDF of two joints, each with the attributes of its limit."""
    elements = [f"<limit {limit}/>" if limit else "" for limit in limits]
    pieces = [
        PIECE.format(*one) for one in zip(("upper", "lower"), (kind,) * 2, ("base", "upper"), elements, strict=True)
    ]
    return f'<robot name="two"><link name="base"/>{"".join(pieces)}</robot>'


FILLED = 'lower="-1" upper="1" effort="40" velocity="2"'
ZERO = 'lower="0" upper="0" effort="0" velocity="0"'
BOTH = "upper_joint, lower_joint"


@pytest.mark.parametrize(
    ("limits", "kind", "velocity", "position"),
    [
        ((ZERO, ZERO), "revolute", BOTH, BOTH),
        ((FILLED, ZERO), "revolute", "lower_joint", "lower_joint"),
        (("", ""), "revolute", BOTH, BOTH),
        ((FILLED.replace('"2"', '"-1"'),) * 2, "revolute", BOTH, None),
        (('lower="-inf" upper="inf" effort="inf" velocity="inf"',) * 2, "prismatic", BOTH, BOTH),
        (('lower="-1e16" upper="1e16" effort="40" velocity="1e30"',) * 2, "revolute", BOTH, BOTH),
        ((FILLED, FILLED.replace('"1"', '"-1"')), "revolute", None, "lower_joint"),
        (('effort="40" velocity="0"',) * 2, "continuous", BOTH, None),
    ],
    ids=["zero", "one joint", "absent", "negative", "infinite", "placeholder", "lower is upper", "continuous"],
)
def test_limits_that_nobody_filled_in(tmp_path, capsys, limits, kind, velocity, position):
    """The command names the joints, and writes nothing; with limits that are given no plan exceeds any."""
    urdf, out = tmp_path / "two.urdf", tmp_path / "out.json"
    urdf.write_text(two_joints(*limits, kind=kind))
    command = ["excite", str(urdf), "--trials", "2", "-o", str(out)]
    assert main(command) == 2 and not out.exists()
    said = capsys.readouterr().err
    for which, names, option in (
        ("Velocity", velocity, "--velocity-limit"),
        ("Position", position, "--position-limit"),
    ):
        assert (names is None) == (option not in said)
        assert names is None or f"{which} limits of {names} are missing" in said
    options = ["--velocity-limit", "*=0.3"] * (velocity is not None)
    options += ["--position-limit", "*=-0.4:0.2"] * (position is not None)
    assert main([*command, "--velocity", "1", *options]) == 0
    found = {name: np.array(values) for name, values in json.loads(out.read_text()).items() if name[0] in "pv"}
    lacks = [
        [False, False] if not names else [name in names for name in BOTH.split(", ")] for names in (velocity, position)
    ]
    assert (abs(found["velocity"]).max(axis=0) <= np.where(lacks[0], 0.3, 2.0) + 1e-12).all()
    low, high = (np.where(lacks[1], given, filled) for given, filled in ((-0.4, -1.6), (0.2, 1.6)))
    assert (found["position"] >= low).all() and (found["position"] <= high).all()
    assert (np.ptp(found["position"], axis=0) > 0.01).all()


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"velocity_limits": {"upper_joint": 3.0}}, "velocity_limits: 'upper_joint' has 3.0; .* the model's limit, 2"),
        ({"position_limits": {"upper_joint": (-2.0, 1.0)}}, "position_limits: 'upper_joint'"),
        ({"velocity_limits": {"elbow": 1.0}}, "velocity_limits: 'elbow' is not a joint"),
        ({"joints": ()}, "joints is empty"),
        ({"ranges": {"upper_joint": (0.0, 1e-9)}}, "joint 'upper_joint' stands still: it moves over"),
        ({"velocity": 1e-9}, "joint 'upper_joint' stands still"),
        ({"rate": 0.1}, "rate is 0.1 1/s; expected 1 1/s at least"),
    ],
)
def test_plans_that_stand_still_and_limits_above_those_of_the_robot(options, key):
    with pytest.raises(dd.InputError, match=key):
        excite(dd.load_urdf(two_joints(FILLED, FILLED)), "friction", trials=2, **options)


def test_no_plan_exceeds_limits_between_its_points():
    """The points are coarse; a plan of the same seed with a hundred times as many shows the motion between them."""
    model = dd.load_urdf(two_joints(FILLED, FILLED))
    options = {"trials": 1, "velocity": 1.0, "margin": 1e-9}
    coarse, fine = (excite(model, "friction", rate=rate, **options) for rate in (2.0, 200.0))
    np.testing.assert_allclose(coarse.position, fine.position[::100], atol=1e-12)
    assert abs(fine.velocity).max() <= 2.0 * (1.0 + 1e-4) and abs(fine.position).max() <= 1.0 + 1e-4


def test_a_robot_without_degrees_of_freedom(tmp_path, capsys):
    urdf = tmp_path / "fixed.urdf"
    urdf.write_text(two_joints(FILLED, FILLED, kind="fixed"))
    for options in ([], ["--set", "locked_joints=[upper_joint=0, lower_joint=0]"]):
        assert main(["excite", str(urdf), *options, "-o", str(tmp_path / "out.json")]) == 2
        assert "robot 'two' has no degrees of freedom" in capsys.readouterr().err
        urdf.write_text(two_joints(FILLED, FILLED))


def test_command(arm, tmp_path, capsys):
    """The command writes the trajectory, and a message that the controller follows within the limits of velocity."""
    out, message = tmp_path / "out.json", tmp_path / "out.yaml"
    locks = "locked_joints=[panda_finger_joint1=0, panda_finger_joint2=0]"
    options = ["--trials", "3", "--range", "panda_joint1=-0.5:0.5", "--set", locks, "--approach", "4"]
    assert main(["excite", "panda", *options, "-o", str(out), "--trajectory", str(message)]) == 0
    content, sent = json.loads(out.read_text()), yaml.safe_load(message.read_text())
    points = sent["points"]
    assert sent["joint_names"] == content["joints"] == list(arm.dof_names)
    times = [point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points]
    assert np.allclose(times, 4.0 + np.array(content["time"]), atol=1e-9) and len(times) == 1001
    columns = [np.array([point[name] for point in points]) for name in ("positions", "velocities", "accelerations")]
    for column, name in zip(columns, ("position", "velocity", "acceleration"), strict=True):
        assert np.allclose(column, content[name], atol=1e-9)
    assert abs(columns[0][:, 0]).max() <= 0.5 + 1e-9
    there = np.ones(len(points), dtype=bool)
    followed = Trajectory(Waypoints(np.array(times), *columns, there, there), arm.dof_names)
    followed.begin(0, columns[0][0], np.zeros(arm.nv))
    assert (followed.fastest() <= arm.velocity_limit).all()
    for arguments, key in ((["--range", "panda_joint1"], "--range has"), (["--set", "floating_base=true"], "floating")):
        assert main(["excite", "panda", *arguments, "-o", str(out)]) == 2
        assert key in capsys.readouterr().err
