# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A desk arm, whose joints carry 0.02 to 0.3 N m, and motions of it with efforts that are
Pinocchio's.
"""

import numpy as np
import pinocchio as pin

import diag_dynamics as dd
from motions import recorded

LINK = (
    '<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>'
    '<inertia ixx="{small}" iyy="{large}" '
    'izz="{large}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{origin}"/>'
    '<axis xyz="{axis}"/><limit lower="-3" upper="3" effort="1.5" velocity="6"/></joint>'
)
JOINTS = "pan", "lift", "elbow"
URDF = "".join(
    (
        '<robot name="desk"><link name="base"/>',
        LINK.format(name="column", centre="0 0 0.03", mass=0.15, small=6e-5, large=6e-5),
        LINK.format(name="upper", centre="0.06 0 0", mass=0.12, small=2e-5, large=1.6e-4),
        LINK.format(name="fore", centre="0.05 0.004 0", mass=0.09, small=1e-5, large=9e-5),
        JOINT.format(name="pan", parent="base", child="column", origin="0 0 0.05", axis="0 0 1"),
        JOINT.format(
            name="lift", parent="column", child="upper", origin="0 0.02 0.06", axis="0 1 0"
        ),
        JOINT.format(name="elbow", parent="upper", child="fore", origin="0.12 0 0", axis="0 1 0"),
        "</robot>",
    )
)
DOWN = 0.0, 0.0, -9.81


def motion(duration=12.0, rate=100.0, gravity=DOWN, seed=1):
    """Return times, positions, rates and Pinocchio's efforts of a smooth motion."""
    rng = np.random.default_rng(seed)
    count = len(JOINTS)
    t = np.arange(0.0, duration, 1.0 / rate)
    w = 2.0 * np.pi * rng.uniform(0.15, 0.6, (3, count))
    phase = rng.uniform(0.0, 2.0 * np.pi, (3, count))
    size = rng.uniform(0.25, 0.55, (3, count))
    angles = w * t[:, None, None] + phase
    q, qd, qdd = (
        (size * values).sum(axis=1)
        for values in (np.sin(angles), w * np.cos(angles), -(w**2) * np.sin(angles))
    )
    model = pin.buildModelFromXML(URDF)
    assert tuple(model.names)[1:] == JOINTS
    model.gravity.linear = np.array(gravity)
    data = model.createData()
    return (
        t,
        q,
        qd,
        np.array([pin.rnea(model, data, *state) for state in zip(q, qd, qdd, strict=True)]),
    )


def worn(tau, qd, seed=2):
    """Return efforts with friction of gears and noise, each a third of the arm's torque."""
    largest = tau.std(axis=0).max()
    noise = 0.3 * largest * np.random.default_rng(seed).normal(size=tau.shape)
    return tau + 0.3 * largest * np.tanh(qd / 5e-3) + noise


def recording(t, q, qd, tau):
    """Return a Recording of the arm."""
    return recorded(dd.load_urdf(URDF), t, q, qd, tau)


def write_table(path, t, q, qd, tau):
    """Write a table of the motion, whose columns `analyse` and `identify` read without a map."""
    header = ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in JOINTS)]
    np.savetxt(
        path,
        np.column_stack([t, q, qd, tau]),
        delimiter=",",
        comments="",
        header=",".join(header),
        fmt="%.17g",
    )
    return path
