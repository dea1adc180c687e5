# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of identification: inertias, the solver, regressors and their filter."""

from itertools import product

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.identification import inertias
from diag_dynamics.identification.regressors import Regressors
from diag_dynamics.identification.solver import Body, Problem, solve
from examples import some_of
from motions import efforts
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


def test_parameters_are_pinocchios():
    rng = np.random.default_rng(0)
    for _ in range(20):
        body = pin.Inertia(rng.uniform(0.1, 3.0), rng.normal(size=3), pin.Inertia.Random().inertia)
        M = pin.SE3.Random()
        ours = inertias.of_body(body.mass, body.lever, body.inertia)
        np.testing.assert_allclose(ours, body.toDynamicParameters(), atol=1e-12)
        placed = M.act(body).toDynamicParameters()
        np.testing.assert_allclose(inertias.moved(ours, M.homogeneous), placed, rtol=1e-11, atol=1e-11)
        for found, truth in zip(inertias.about_centre(ours), (body.mass, body.lever, body.inertia), strict=True):
            np.testing.assert_allclose(found, truth, atol=1e-10)


def test_positive_numbers_have_a_closed_form():
    """min ½ a x² − b x − γ' ln x is at (b + √(b² + 4 a γ')) / 2a, also where least squares is negative."""
    for a, b in ((4.0, 8.0), (4.0, -8.0), (1e6, -1e3)):
        problem = Problem(np.array([[a]]), np.array([b]), [], np.array([0]), 0.01)
        expected = (b + np.sqrt(b * b + 0.04 * a)) / (2.0 * a)
        assert solve(problem, np.array([0.1]))[0][0] == pytest.approx(expected, rel=1e-3)


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
    x, _ = solve(problem, inertias.parameters_of_pseudo(prior))
    assert inertias.is_physical(x)
    gradient, J = problem.A @ x - problem.b, inertias.pseudo_inertia(x)
    barrier = 10.0 * np.tensordot(inertias.BASIS, np.linalg.inv(prior) - np.linalg.inv(J), 2)
    scale = np.abs(gradient).max() + 10.0 * np.abs(np.linalg.inv(J)).max()
    np.testing.assert_allclose(gradient, -barrier, atol=1e-4 * scale)


def of_bodies(model, oracle, rng):
    """Yield body, joint of Pinocchio, and random parameters in the frames of both; eleven of each body."""
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
            inertia = pin.Inertia(rng.uniform(0.1, 5.0), rng.normal(size=3), pin.Inertia.Random().inertia)
            ours = pin.SE3(placement).act(inertia).toDynamicParameters()
            yield body, frame.parentJoint - 1, ours, inertia.toDynamicParameters()


def columns_of(model, q, qd):
    """Return Y_p and Y_g − Y_∂ at a state by body: functions of its ten parameters, (nv,)."""
    bodies = range(1, len(model.bodies))
    regressors = Regressors(model, bodies)
    momentum, bias = (rows[0] for rows in regressors.evaluate(q[None], qd[None]))

    def times(rows, body, parameters):
        x = np.zeros(regressors.size)
        x[10 * (body - 1) : 10 * body] = parameters
        pairs = zip(regressors.columns, regressors.rows, strict=True)
        return np.array([rows[part][:-1] @ x[columns] for columns, part in pairs])

    return (lambda *one: times(momentum, *one)), (lambda *one: times(bias, *one))


@pytest.mark.parametrize("one", list(some_of(ROBOTS, 2)), ids=lambda one: one.id)
def test_columns_are_pinocchios(one):
    """Y_p and Y_g are its regressors; Y_∂ times parameters is Cᵀq̇ with its Coriolis matrix."""
    model = dd.load_urdf(one.urdf, mimic="free", **one.options)
    oracle = Oracle(one.urdf, model.dof_names, floating_base=model.floating_base)
    rng = np.random.default_rng(2)
    ours_q, ours_qd, none = model.random(rng), rng.normal(size=model.nv), np.zeros(model.nv)
    q, v = oracle.configuration(ours_q), oracle.to_pin(ours_qd)
    gravity = pin.computeJointTorqueRegressor(oracle.model, oracle.data, q, none, none).copy()
    momentum = pin.computeJointTorqueRegressor(oracle.model, oracle.data, q, none, v) - gravity
    of_momentum, of_bias = columns_of(model, ours_q, ours_qd)
    size, still = 10.0 * (1.0 + np.abs(momentum).max() + np.abs(gravity).max()), columns_of(model, ours_q, none)[1]
    parameters = {}
    for body, joint, ours, theirs in of_bodies(model, oracle, rng):
        its, limit = slice(10 * joint, 10 * joint + 10), 1e-12 * size * np.abs(theirs).max()
        for found, expected in ((of_momentum, momentum), (still, gravity)):
            expected = oracle.from_pin(expected[:, its] @ theirs)
            np.testing.assert_allclose(found(body, ours), expected, rtol=0, atol=limit)
        parameters[body] = ours
        oracle.model.inertias[joint + 1] = pin.Inertia.FromDynamicParameters(theirs)
    C = pin.computeCoriolisMatrix(oracle.model, oracle.model.createData(), q, v)
    expected, found = oracle.from_pin(C.T @ v), sum(still(*pair) - of_bias(*pair) for pair in parameters.items())
    np.testing.assert_allclose(found, expected, atol=1e-12 * (1.0 + np.abs(C).max()))


def coupling(model, free):
    """G and q₀ of q = G q_r + q₀: positions of all joints from those of the independent ones."""
    G, start = np.zeros((free.nv, model.nv)), np.zeros(free.nv)
    for row, name in enumerate(free.dof_names):
        leader, multiplier, start[row] = model.mimics.get(name, (name, 1.0, 0.0))
        G[row, model.dof_names.index(leader)] = multiplier
    return G, start


def test_followers_are_reflected_to_leaders():
    """Rows of an embedded mimic are Gᵀ times those of all joints free, which are Pinocchio's by the test above."""
    model, free = (dd.load_urdf(PANDA.urdf, mimic=mimic) for mimic in ("embed", "free"))
    assert free.nv == model.nv + 1 and free.link_names == model.link_names
    G, start = coupling(model, free)
    rng = np.random.default_rng(4)
    q, qd = model.random(rng), rng.normal(size=model.nv)
    pairs = zip(columns_of(model, q, qd), columns_of(free, G @ q + start, G @ qd), strict=True)
    for (embedded, each), body in product(pairs, range(1, len(model.bodies))):
        x = rng.normal(size=10)
        np.testing.assert_allclose(embedded(body, x), G.T @ each(body, x), rtol=0, atol=1e-10)


def test_filtered_rows_hold_for_the_true_parameters():
    """Rows times parameters are Pinocchio's filtered efforts, with an error of second order in the interval.

    The stamps are irregular; rotors and friction are included.
    """
    model = dd.load_urdf(PANDA.urdf, mimic="free", armature=0.2, parameters={"friction_velocity": 0.5})
    oracle = Oracle(PANDA.urdf, model.dof_names)
    errors = []
    for interval in (4e-3, 1e-3):
        rng = np.random.default_rng(5)
        t = np.cumsum(rng.uniform(0.5, 1.5, round(3.0 / interval))) * interval
        w, phase = rng.uniform(2.0, 4.0, model.nv), rng.uniform(0.0, 6.0, model.nv)
        mean = np.where(np.isfinite(model.lower), 0.5 * (model.lower + model.upper), 0.0)
        angles = t[:, None] * w + phase
        q, qd, qdd = mean + 0.3 * np.sin(angles), 0.3 * w * np.cos(angles), -0.3 * w**2 * np.sin(angles)
        tau = efforts(oracle, q, qd, qdd) + 0.2 * qdd + 0.7 * qd + 0.4 * np.tanh(qd / 0.5) - 0.1
        regressors = Regressors(model)
        sums = regressors.sum_segment(t, q, qd, tau)
        known = [inertias.parameters_of_record(model.bodies[body]) for body in regressors.bodies]
        x = np.concatenate([*known, np.tile([0.7, 0.4, -0.1, 0.2], model.nv)])
        errors.append(np.sqrt(regressors.residual_squares(sums, x) / regressors.residual_squares(sums, 0.0 * x)).max())
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 8.0
