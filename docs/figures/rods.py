# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The arm of the figures: three uniform rods that turn in a plane, so that each number can be checked by hand."""

import numpy as np

import diag_dynamics as dd

LENGTHS = (0.5, 0.4, 0.3)
"""Of the rods [m]; each has 2 kg per metre."""


def urdf():
    """Return the URDF: rods along x, joints about z."""
    parts = ['<robot name="rods"><link name="base"/>']
    for k, length in enumerate(LENGTHS, 1):
        mass = 2.0 * length
        turned = mass * length**2 / 12.0
        parts.append(
            f'<link name="rod{k}"><inertial><origin xyz="{length / 2} 0 0"/><mass value="{mass}"/>'
            f'<inertia ixx="1e-5" iyy="{turned}" izz="{turned}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="joint{k}" type="continuous"><parent link="{"base" if k == 1 else f"rod{k - 1}"}"/>'
            f'<child link="rod{k}"/><origin xyz="{0 if k == 1 else LENGTHS[k - 2]} 0 0"/><axis xyz="0 0 1"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def model():
    """Return the arm without gravity."""
    return dd.load_urdf(urdf(), gravity=(0.0, 0.0, 0.0))


def points(q):
    """Return where the joints and the tip are, (4, 2) [m]."""
    angles = np.cumsum(q)
    steps = np.array(LENGTHS)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
