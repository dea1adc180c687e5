# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inside identification: inertias, the solver, regressors, rows, segments and portions of recordings."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.identification import inertias
from diag_dynamics.identification.equations import Equations
from diag_dynamics.identification.regressors import regressors
from diag_dynamics.identification.segments import Segment, in_portions, since
from diag_dynamics.identification.sifting import Beginnings
from diag_dynamics.identification.solver import Body, Problem, solved
from diag_dynamics.identification.unexplained import MOST, Curves
from examples import some_of
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


# --- Inertias and solver ---


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


def test_physical_is_what_points_of_mass_can_be():
    rng = np.random.default_rng(0)
    points, masses = rng.normal(size=(6, 3)), rng.uniform(0.1, 1.0, 6)
    parts = [inertias.of_body(m, r, np.zeros((3, 3))) for m, r in zip(masses, points, strict=True)]
    assert inertias.is_physical(sum(parts))
    assert not inertias.is_physical(sum(parts[:2]) - parts[2])
    flat = inertias.of_body(1.0, np.zeros(3), np.diag([1.0, 1.0, 2.5]))  # breaks the triangle inequality
    assert not inertias.is_physical(flat)


def test_what_a_body_has_is_shared_out_physically():
    rng = np.random.default_rng(1)
    parts = [a @ a.T + 1e-3 * np.eye(4) for a in rng.normal(size=(3, 4, 4))]
    root = rng.normal(size=(4, 4))
    whole = root @ root.T + 1e-2 * np.eye(4)
    shares = inertias.shared_out(parts, whole)
    np.testing.assert_allclose(sum(shares), whole, atol=1e-12)
    assert min(np.linalg.eigvalsh(share)[0] for share in shares) > 0.0
    np.testing.assert_allclose(inertias.shared_out(parts, sum(parts))[1], parts[1], atol=1e-10)


def test_prior_alone_is_the_model():
    rng = np.random.default_rng(2)
    a = rng.normal(size=(4, 4))
    prior = a @ a.T + 0.1 * np.eye(4)
    body = Body(0, prior, 10.0, np.zeros((4, 4)))
    problem = Problem(np.zeros((10, 10)), np.zeros(10), [body], np.zeros(0, int), 0.01)
    start = inertias.parameters_of_pseudo(3.0 * np.eye(4))
    np.testing.assert_allclose(solved(problem, start).x, inertias.parameters_of_pseudo(prior), atol=1e-4)


def test_positive_numbers_have_a_closed_form():
    """min ½ a x² − b x − γ' ln x is at (b + √(b² + 4 a γ')) / 2a, also where least squares is negative."""
    for a, b in ((4.0, 8.0), (4.0, -8.0), (1e6, -1e3)):
        problem = Problem(np.array([[a]]), np.array([b]), [], np.array([0]), 0.01)
        expected = (b + np.sqrt(b * b + 0.04 * a)) / (2.0 * a)
        assert solved(problem, np.array([0.1])).x[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("seed", range(8))
def test_every_solution_is_physical(seed):
    """Whatever the rows say: here what no body can be, a thousand times more certain than the prior, or nothing at all."""
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


# --- Regressors ---


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
    """Y_p, Y_g, y_K and y_U are its regressors; Y_p's rate less Y_∂ is the rest of that of the torque."""
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
        for body, joint, ours, theirs in of_bodies(model, oracle, rng):
            own, its = slice(10 * body, 10 * body + 10), slice(10 * joint, 10 * joint + 10)
            scale = size * np.abs(theirs).max()
            close(found.momentum[t][:, own] @ ours, oracle.from_pin(momentum[:, its] @ theirs), scale)
            close(found.gravity[t][:, own] @ ours, oracle.from_pin(gravity[:, its] @ theirs), scale)
            close(found.kinetic[t, own] @ ours, kinetic[its] @ theirs, scale)
            close(found.potential[t, own] @ ours, potential[its] @ theirs, scale)


@SOME
def test_rate_of_kinetic_energy_by_position(one):
    """Y_∂ times parameters is C_sᵀq̇ with Pinocchio's Coriolis matrix, for any inertias."""
    model = dd.load_urdf(one.urdf, mimic="free", **one.options)
    oracle = Oracle(one.urdf, model.dof_names, floating_base=model.floating_base)
    rng = np.random.default_rng(3)
    Q, QD = np.array([model.random(rng) for _ in range(4)]), rng.normal(size=(4, model.nv))
    found = regressors(model, Q, QD)
    for t in range(4):
        parameters = np.zeros(found.kinetic.shape[1])
        for body, joint, ours, theirs in of_bodies(model, oracle, rng):
            parameters[10 * body : 10 * body + 10] = ours
            oracle.model.inertias[joint + 1] = pin.Inertia.FromDynamicParameters(theirs)
        data = oracle.model.createData()
        C = pin.computeCoriolisMatrix(oracle.model, data, oracle.configuration(Q[t]), oracle.to_pin(QD[t]))
        expected = oracle.from_pin(C.T @ oracle.to_pin(QD[t]))
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


def test_a_wrong_state_is_named():
    model = dd.load_urdf(PANDA.urdf)
    Q, QD = np.zeros((2, 3, model.nv))
    QD[1, 2] = np.nan
    with pytest.raises(dd.InputError, match="state 1"):
        regressors(model, Q, QD)


def test_filtered_rows_hold_for_the_true_parameters():
    """On a motion with irregular stamps, in two takes with a gap between others: rows times parameters are filtered efforts.

    The efforts are Pinocchio's, with rotors and friction; what is left is of the second order in the interval, as the filter
    takes all to be straight between states.
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


# --- Segments and portions ---


V0 = 5e-3


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


@pytest.mark.parametrize("size", [3, 100])
def test_portions_are_even(size):
    """About as many states in each, whatever they came in: none is shorter than half of that but a whole segment."""
    none = np.zeros((1000, 1))
    segment = Segment(np.arange(1000), np.arange(1000.0), none, none, none)
    given = [(segment.part(slice(k, min(k + size, 740))), k == 0) for k in range(0, 740, size)]
    given += [(segment.part(slice(740, 743)), True), (segment.part(slice(743, 1000)), True)]
    found = [(len(states.t), begins) for states, begins in in_portions(given, 100)]
    assert found == [(100, True), *[(100, False)] * 5, (140, False), (3, True), (100, True), (100, False), (57, False)]
    assert sum(number for number, _ in found) == 1000 and all(50 <= number < 150 or number == 3 for number, _ in found)
    assert [begins for _, begins in found].count(True) == 3
    late = [(states.t[0], begins) for states, begins in in_portions(since(given, 601.0), 100)]
    assert late[0] == (601.0, True) and [begins for _, begins in late].count(True) == 3


@pytest.mark.parametrize("size", [997, 200_000])
def test_curves_of_any_length_are_some_steps_and_all_peaks(size):
    """Whatever the rows come in; gaps stay gaps."""
    number, rng = 200_000, np.random.default_rng(0)
    time, values = np.arange(float(number)), rng.normal(size=(number, 2))
    values[123_456, 0], values[77, 1] = 50.0, -60.0
    time[150_000:] += 1e5
    curves = Curves()
    bounds = sorted({*range(0, number, size), 150_000, number})
    for first, end in pairwise(bounds):
        curves.take(time[first:end], values[first:end], first in (0, 150_000))
    drawn, lines = curves.drawn()
    assert len(drawn) == len(lines) <= 2 * MOST + 1 and (np.diff(drawn) >= 0.0).all()
    assert np.nanmax(lines[:, 0]) == 50.0 and np.nanmin(lines[:, 1]) == -60.0
    ((gap,),) = np.nonzero(np.isnan(lines[:, 0]))
    assert drawn[gap - 1] < 150_000 and drawn[gap] == drawn[gap + 1] == 250_000
    few = Curves()
    few.take(time[:900], values[:900], True)
    np.testing.assert_array_equal(few.drawn()[1], values[:900])
