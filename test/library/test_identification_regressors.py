# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regressors of identification: Pinocchio's, on regular robots, with followers, and with a floating base."""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.identification.equations import Equations
from diag_dynamics.identification.inertias import parameters_of_record
from diag_dynamics.identification.regressors import regressors
from diag_dynamics.identification.segments import Segment
from oracles import Oracle
from robots import random_robots, robot

PANDA = robot("panda_description/urdf/panda.urdf")
ROBOTS = [
    PANDA,
    robot("ur_description/urdf/ur5_robot.urdf"),
    robot("ur_description/urdf/ur5_robot.urdf").floating,
    robot("talos_data/robots/talos_reduced.urdf").floating,
    *random_robots()[2:6],
]
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")


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


def coupling(model, free):
    """G and q₀ of q = G q_r + q₀: positions of all joints from those of the independent ones."""
    G, start = np.zeros((free.nv, model.nv)), np.zeros(free.nv)
    for row, name in enumerate(free.dof_names):
        leader, multiplier, start[row] = model.mimics.get(name, (name, 1.0, 0.0))
        G[row, model.dof_names.index(leader)] = multiplier
    return G, start


def close(found, expected, scale):
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * max(scale, 1e-9))


@pytest.mark.parametrize("one", ROBOTS, ids=lambda one: one.id)
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


@pytest.mark.parametrize("one", ROBOTS, ids=lambda one: one.id)
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
        known = [parameters_of_record(model.bodies[body]) for body in equations.bodies]
        x = np.concatenate([*known, np.tile([0.7, 0.4, -0.1, 0.2], model.nv)])
        errors.append(np.sqrt(sums.squared_residuals(x) / (sums.effort / sums.weight)).max())
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 8.0
