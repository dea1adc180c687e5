# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pinocchio's own sample models, written out as URDF: a manipulator and humanoids on a free-flyer."""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from robots import description, joint, link

SAMPLES = {
    "manipulator": pin.buildSampleModelManipulator,
    "humanoid": lambda: pin.buildSampleModelHumanoid(True),
    "random humanoid": lambda: pin.buildSampleModelHumanoidRandom(True),
}


def axis_of(model, i):
    """Axis of a joint of one degree of freedom, from its motion subspace, and whether it turns."""
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    column = pin.getJointJacobian(model, data, i, pin.LOCAL)[:, model.idx_vs[i]]
    return (column[3:], True) if np.abs(column[3:]).max() > 0.5 else (column[:3], False)


def urdf_of(model):
    """Description of a Pinocchio model: one link for each joint, at the joint."""
    elements = [link("world")] if model.nqs[1] != 7 else []
    for i in range(1, model.njoints):
        inertia = model.inertias[i]
        moments = inertia.inertia[np.triu_indices(3)]
        elements.append(link(f"l{i}", mass=inertia.mass, com=inertia.lever, inertia=moments))
        if model.nqs[i] == 7:
            continue
        axis, turns = axis_of(model, i)
        at = model.jointPlacements[i]
        parent = f"l{model.parents[i]}" if model.parents[i] else "world"
        kind = "revolute" if turns else "prismatic"
        rpy = pin.rpy.matrixToRpy(at.rotation)
        elements.append(joint(model.names[i], kind, parent, f"l{i}", axis, at.translation, rpy))
    return description("sample", *elements)


@pytest.mark.parametrize("sample", SAMPLES)
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_sample(sample):
    """Factors, C, bias, gravity and forward dynamics of the sample model itself, of which the URDF is a copy."""
    model = SAMPLES[sample]()
    data = model.createData()
    floating = model.nqs[1] == 7
    ours = dd.load_urdf(urdf_of(model), floating_base=floating)
    dynamics = dd.DiagonalDynamics(ours)
    # Each of our degrees of freedom in Pinocchio's vector: the six of the base first, the others by name.
    base = list(range(6)) if floating else []
    order = np.array(base + [model.idx_vs[model.getJointId(name)] for name in ours.dof_names[len(base) :]])
    rng = np.random.default_rng(5)
    for _ in range(3):
        q, pin_q = ours.neutral, pin.neutral(model)
        first = 7 if floating else 0
        q[first:] = rng.uniform(-1, 1, len(q) - first)
        if floating:
            turn = rng.normal(size=4)
            q[:3], q[3:7] = rng.normal(size=3), turn / np.linalg.norm(turn)
            pin_q[:7] = q[:7]
        for name, angle in zip(ours.coordinate_names[first:], q[first:], strict=True):
            pin_q[model.idx_qs[model.getJointId(name)]] = angle
        v, tau = rng.normal(size=(2, model.nv))
        M = pin.crba(model, data, pin_q)
        M = np.triu(M) + np.triu(M, 1).T
        factors, s = dynamics.factors(q), dynamics.evaluate(q, v[order], tau[order])
        tolerance = max(1e-10, 100 * np.finfo(float).eps * np.linalg.cond(M))
        near = {"rtol": tolerance, "atol": tolerance * np.abs(M).max()}
        np.testing.assert_allclose(factors.m @ factors.m.T, M[np.ix_(order, order)], **near)
        g = pin.computeGeneralizedGravity(model, data, pin_q)
        c = pin.nonLinearEffects(model, data, pin_q, v) - g
        np.testing.assert_allclose(dynamics.bias(q, v[order]), c[order], **near)
        np.testing.assert_allclose(dynamics.gravity_torque(q), g[order], **near)
        C_s = pin.computeCoriolisMatrix(model, data, pin_q, v)[np.ix_(order, order)]
        change = factors.l @ (C_s + C_s.T) @ factors.l.T
        mdot = factors.m @ (np.triu(change, 1) + 0.5 * np.diag(np.diag(change)))
        coriolis = factors.l @ c[order] - mdot.T @ v[order]
        np.testing.assert_allclose(s.coriolis, coriolis, rtol=0, atol=tolerance * np.abs(coriolis).max())
        assert abs(s.nu @ s.coriolis) < 1e-12 * np.linalg.norm(s.nu) * np.linalg.norm(s.coriolis)
        qdd = pin.aba(model, data, pin_q, v, tau)[order]
        ours_qdd = dynamics.forward_dynamics(q, v[order], tau[order])
        np.testing.assert_allclose(ours_qdd, qdd, rtol=0, atol=tolerance * np.abs(qdd).max())
