# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Friction of gears, by the torque of gravity and by the root of the rate: dynamics, parameter file
and simulation.
"""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import diag_dynamics as dd
from oracles import Oracle
from robots import robot

UR5 = robot("ur_description/urdf/ur5_robot.urdf").urdf
LOAD, ROOT = np.array([0.0, 0.1, 0.2, 0.05, 0.3, 0.15]), np.array([2.0, 1.0, 0.5, 0.3, 0.2, 0.1])


def with_gears(source, load, root):
    model = dd.load_urdf(source)
    pairs = zip(model.dof_names, load, root, strict=True)
    joints = {name: {"load_friction": mu, "root_friction": s} for name, mu, s in pairs}
    return model.with_parameters({"joints": joints})


@pytest.mark.parametrize("v0", [5e-3, 0.0])
def test_friction_is_that_of_its_equation(v0, tmp_path):
    """τ_fric = d q̇ + (f + μ|g|) tanh(q̇/v₀) + s q̇/√max(|q̇|, v₀) + o with Pinocchio's g, in all
    terms that contain it.
    """
    pairs = zip(dd.load_urdf(UR5).dof_names, LOAD, ROOT, strict=True)
    joints = {name: dd.JointParameters(0.5, 1.5, -0.1, None, *pair) for name, *pair in pairs}
    dd.Parameters(joints, friction_velocity=v0).save(tmp_path / "arm.yaml")
    model = dd.load_urdf(UR5, parameters=tmp_path / "arm.yaml")
    oracle = Oracle(UR5, model.dof_names)
    rng = np.random.default_rng(4)
    dyn = dd.DiagonalDynamics(model)
    Q, QD, QDD = rng.uniform(-2.0, 2.0, (3, 7, 6))
    QD[0], QD[1] = 0.0, 1e-3 * QD[1]  # at rest, and within v₀
    expected = []
    for q, qd in zip(Q, QD, strict=True):
        g = oracle.from_pin(
            pin.computeGeneralizedGravity(oracle.model, oracle.data, oracle.configuration(q))
        )
        sign = np.tanh(qd / v0) if v0 else np.sign(qd)
        slow = np.abs(qd) < v0
        root = np.where(slow, qd / np.sqrt(v0 or 1.0), np.sign(qd) * np.sqrt(np.abs(qd)))
        expected.append(0.5 * qd + (1.5 + LOAD * np.abs(g)) * sign + ROOT * root - 0.1)
    np.testing.assert_allclose(dyn.friction_torque(QD, Q), expected, atol=1e-10)
    TAU = dyn.inverse_dynamics(Q, QD, QDD, friction=True)
    np.testing.assert_allclose(TAU - dyn.inverse_dynamics(Q, QD, QDD), expected, atol=1e-10)
    np.testing.assert_allclose(dyn.forward_dynamics(Q, QD, TAU, friction=True), QDD, atol=1e-9)
    many = dyn.evaluate(Q, QD, TAU, friction=True)
    for k in range(len(Q)):
        np.testing.assert_allclose(dyn.friction_torque(QD[k], Q[k]), expected[k], atol=1e-10)
        single = dyn.evaluate(Q[k], QD[k], TAU[k], friction=True)
        np.testing.assert_allclose(
            single.friction, dyn.epsilon_from_tau(Q[k], expected[k]), atol=1e-9
        )
        np.testing.assert_allclose(many.friction[k], single.friction, atol=1e-10)
    with pytest.raises(dd.InputError, match="q is missing"):
        dyn.friction_torque(QD)


def test_friction_of_gears_cannot_be_negative():
    with pytest.raises(dd.InputError, match=r"load_friction is -0\.1; expected a finite number"):
        with_gears(UR5, [-0.1] * 6, ROOT)


PENDULUM = """<robot name="pendulum"><link name="base"/><link name="rod"><inertial>
<origin xyz="0 0 -0.5"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="continuous">
<axis xyz="0 1 0"/><parent link="base"/><child link="rod"/></joint></robot>"""


def test_a_falling_pendulum_with_gears():
    """Until its rate reverses, against scipy's solution of its equation: I q̈ = −m g l sin q − μ|m
    g l sin q| − s √q̇.
    """
    mu = 0.2
    s = 1.5
    inertia = 0.1 + 2.0 * 0.25
    weight = 2.0 * 9.81 * 0.5
    model = with_gears(PENDULUM, [mu], [s])

    def rates(_, x):
        g = weight * np.sin(x[0])
        return x[1], (
            -g - mu * abs(g) * np.sign(x[1]) - s * np.sign(x[1]) * np.sqrt(abs(x[1]))
        ) / inertia

    truth = solve_ivp(rates, (0.0, 0.5), (-1.2, 0.5), rtol=1e-10, atol=1e-12).y[:, -1]
    errors = []
    for step in (1e-3, 2.5e-4):
        simulation = dd.Simulation(model, q=[-1.2], qd=[0.5], step=step)
        simulation.advance(steps=round(0.5 / step))
        errors.append(np.abs(np.r_[simulation.q, simulation.qd] - truth).max())
        audit = simulation.audit
        assert audit.loss < -0.5 and abs(audit.residual) < 0.02 * abs(audit.loss)
    assert errors[0] < 5e-3 and errors[1] < errors[0] / 3.0
    free = dd.Simulation(dd.load_urdf(PENDULUM), q=[-1.2], qd=[0.5])
    free.advance(steps=500)
    assert abs(free.q[0] - truth[0]) > 0.2
