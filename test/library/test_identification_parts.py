# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of identification: inertias, the solver, regressors and their filter."""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from controlled import PANDA
from diag_dynamics.identification import inertias
from diag_dynamics.identification.fit import (
    BALL,
    PAYLOAD_WEIGHT,
    START,
    Body,
    Layout,
    Problem,
    solve,
)
from diag_dynamics.identification.normal_equations import FRICTION, LOAD, OFFSET, ROOT, Regressors
from diag_dynamics.identification.result import parameters_of
from examples import some_of
from motions import efforts
from oracles import Oracle
from robots import random_robots, robot

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
        np.testing.assert_allclose(
            inertias.moved(ours, M.homogeneous), placed, rtol=1e-11, atol=1e-11
        )
        for result, truth in zip(
            inertias.about_centre(ours), (body.mass, body.lever, body.inertia), strict=True
        ):
            np.testing.assert_allclose(result, truth, atol=1e-10)


def test_positive_numbers_have_a_closed_form():
    """min ½ a x² − b x + γ' (x/x₀ − ln x), also where least squares is negative, and beside an
    offset of the same rows.
    """
    for a, b in ((4.0, 8.0), (4.0, -8.0), (1e6, -1e3)):
        problem = Problem(np.array([[a]]), np.array([b]), [], np.array([0]))
        slope = b - 0.01 / START
        expected = (slope + np.sqrt(slope**2 + 0.04 * a)) / (2.0 * a)
        assert solve(problem, np.array([0.1]))[0][0] == pytest.approx(expected, rel=1e-3)
    problem = Problem(np.full((2, 2), 300.0), np.full(2, 1500.0), [], np.array([0]))
    x, _ = solve(problem, np.array([50.0, 0.0]))
    np.testing.assert_allclose(x, [START, 5.0 - START], rtol=1e-3)


@pytest.mark.parametrize(
    ("count", "payload"), [(0, False), (2, False), (4, False), (6, False), (9, True), (40, True)]
)
def test_every_solution_is_physical(count, payload):
    """Rows of an impossible body, also a thousand times more certain than the prior; without rows,
    the prior.
    """
    rng = np.random.default_rng(count)
    a = rng.normal(size=(4, 4))
    prior = inertias.floored(BALL) if payload else a @ a.T + 0.01 * np.eye(4)
    rows = rng.normal(size=(count, 10)) * 10.0 ** rng.uniform(0, 4, size=(count, 1))
    target = rng.normal(size=10)
    weight = PAYLOAD_WEIGHT if payload else 10.0
    body = Body(0, prior, weight, np.zeros((4, 4)))
    problem = Problem(rows.T @ rows, rows.T @ (rows @ target), [body], np.zeros(0, int))
    x, _ = solve(problem, inertias.parameters_of_pseudo(prior))
    assert inertias.is_physical(x)
    gradient = problem.A @ x - problem.b
    J = inertias.pseudo_inertia(x)
    barrier = weight * np.tensordot(inertias.BASIS, np.linalg.inv(prior) - np.linalg.inv(J), 2)
    scale = np.abs(gradient).max() + weight * np.abs(np.linalg.inv(J)).max()
    np.testing.assert_allclose(gradient, -barrier, atol=1e-4 * scale)


def choose_inertias(model, oracle, rng):
    """Give Pinocchio's bodies random inertias, and return the ten parameters of each of the
    model's.
    """
    x = np.zeros((len(model.bodies) - 1, 10))
    for body, record in enumerate(model.bodies[1:]):
        if record["rank"] == record["dofs"] - 1:  # others have no inertia
            link = model.link_names[record["link"]]
            joint = oracle.model.frames[
                oracle.model.getFrameId(link, pin.FrameType.BODY)
            ].parentJoint
            inertia = pin.Inertia(
                rng.uniform(0.1, 5.0), rng.normal(size=3), pin.Inertia.Random().inertia
            )
            oracle.model.inertias[joint] = inertia
            x[body] = pin.SE3(model.placement_in_body(link)[1]).act(inertia).toDynamicParameters()
    return x.ravel()


@pytest.mark.parametrize(
    "one",
    [(PANDA, "embed"), *((one, "free") for one in some_of(ROBOTS, 2))],
    ids=lambda one: f"{one[0].id}-{one[1]}",
)
def test_rows_are_pinocchios(one):
    """Y_p and Y_g − Y_∂ times parameters are M q̇ and g − Cᵀq̇; joints of an embedded mimic joint G
    are Gᵀ times these.
    """
    inputs, mimic = one
    rng = np.random.default_rng(2)
    model, free = (
        dd.load_urdf(inputs.urdf, mimic=how, **inputs.options) for how in (mimic, "free")
    )
    oracle = Oracle(inputs.urdf, free.dof_names, floating_base=free.floating_base)
    G = np.eye(free.nv)
    start = 0.0
    if free.nv > model.nv:
        leaders = [model.mimics.get(name, (name, 1.0, 0.0)) for name in free.dof_names]
        start = np.array([offset for _, _, offset in leaders])
        G = np.array(
            [
                [factor * (name == leader) for name in model.dof_names]
                for leader, factor, _ in leaders
            ]
        )
    regressors = Regressors(model, range(1, len(model.bodies)))
    for _ in range(3):
        x = np.append(choose_inertias(model, oracle, rng), np.zeros(6 * model.nv))
        q = model.random(rng)
        qd = rng.normal(size=model.nv)
        q_free = q if len(G) == model.nv else G @ q + start
        state = oracle.configuration(q_free)
        v = oracle.to_pin(G @ qd)
        none = np.zeros(oracle.model.nv)
        gravity = pin.rnea(oracle.model, oracle.data, state, none, none).copy()
        momentum = pin.rnea(oracle.model, oracle.data, state, none, v) - gravity
        bias = (
            gravity
            - pin.computeCoriolisMatrix(oracle.model, oracle.model.createData(), state, v).T @ v
        )
        for rows, expected in zip(
            regressors.evaluate(q[None], qd[None]), (momentum, bias), strict=True
        ):
            pairs = zip(regressors.rows, regressors.columns, strict=True)
            result = np.array([rows[0, part][:-1] @ x[columns] for part, columns in pairs])
            limit = 1e-12 * (
                1.0 + np.abs(momentum).max() + np.abs(gravity).max() + np.abs(bias).max()
            )
            np.testing.assert_allclose(result, G.T @ oracle.from_pin(expected), rtol=0, atol=limit)


def test_filtered_rows_hold_for_the_true_parameters():
    """Rows times parameters are Pinocchio's filtered efforts, with an error of second order in the
    interval.

    The stamps are irregular; rotors and friction are included.
    """
    model = dd.load_urdf(
        PANDA.urdf, mimic="free", armature=0.2, parameters={"friction_velocity": 0.5}
    )
    oracle = Oracle(PANDA.urdf, model.dof_names)
    errors = []
    for interval in (4e-3, 1e-3):
        rng = np.random.default_rng(5)
        t = np.cumsum(rng.uniform(0.5, 1.5, round(3.0 / interval))) * interval
        w = rng.uniform(2.0, 4.0, model.nv)
        phase = rng.uniform(0.0, 6.0, model.nv)
        mean = np.where(np.isfinite(model.lower), 0.5 * (model.lower + model.upper), 0.0)
        angles = t[:, None] * w + phase
        q = mean + 0.3 * np.sin(angles)
        qd = 0.3 * w * np.cos(angles)
        qdd = -0.3 * w**2 * np.sin(angles)
        tau = efforts(oracle, q, qd, qdd) + 0.2 * qdd + 0.7 * qd + 0.4 * np.tanh(qd / 0.5) - 0.1
        regressors = Regressors(model)
        sums = regressors.sum_segment(t, q, qd, tau)
        true_parameters = [
            inertias.parameters_of_record(model.bodies[body]) for body in regressors.bodies
        ]
        x = np.concatenate([*true_parameters, np.tile([0.7, 0.4, -0.1, 0.2, 0.0, 0.0], model.nv)])
        errors.append(
            np.sqrt(
                regressors.residual_squares(sums, x) / regressors.residual_squares(sums, 0.0 * x)
            ).max()
        )
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 8.0


def test_rows_of_unknown_efforts_say_nothing():
    """Whatever number stands for them; the rows of the other joints are as they were."""
    model = dd.load_urdf(PANDA.urdf, mimic="free")
    rng = np.random.default_rng(0)
    t = 0.01 * np.arange(200)
    q, qd, tau = rng.normal(size=(3, 200, model.nv))
    true_parameters = np.arange(model.nv) != 3
    regressors = Regressors(model)
    whole = regressors.sum_segment(t, q, qd, tau)
    part = regressors.sum_segment(t, q, qd, tau, true_parameters)
    assert whole[3].any() and not part[3].any()
    for k in np.flatnonzero(true_parameters):
        np.testing.assert_array_equal(part[k], whole[k])


@pytest.mark.parametrize("column", [FRICTION, LOAD, ROOT, OFFSET])
def test_the_file_has_the_friction_velocity_that_was_fitted_with(column):
    model = dd.load_urdf(PANDA.urdf, mimic="free", friction_velocity=0.02)
    layout = Layout(model, Regressors(model))
    free = np.zeros(layout.size, bool)
    free[layout.own(column)[2]] = True
    expected = None if column == OFFSET else 0.02
    assert parameters_of(layout, layout.known, free).friction_velocity == expected
