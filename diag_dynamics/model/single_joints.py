# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of one degree of freedom: a message has one number for each."""


def single_joints(model):
    """Joints of one degree of freedom, those that joint_states brings, in the model's order."""
    dofs = set(model.dof_names)
    return tuple(name for name in model.joint_names if name in dofs)


def places(names, among):
    """Place of each of some names among others."""
    place = {name: k for k, name in enumerate(among)}
    return [place[name] for name in names]
