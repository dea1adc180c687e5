# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints of one degree of freedom, of which a message has one number each, and degrees of freedom that slide."""

import numpy as np

from diag_dynamics.sweeps.spatial import LINEAR_X, LINEAR_Y, LINEAR_Z


def single_joints(model):
    """Joints of one degree of freedom, those that joint_states brings, in the model's order."""
    dofs = set(model.dof_names)
    return tuple(name for name in model.joint_names if name in dofs)


def places(names, among):
    """Place of each of some names among others."""
    place = {name: k for k, name in enumerate(among)}
    return [place[name] for name in names]


def sliding_dofs(model):
    """Return whether each degree of freedom slides, a list of nv bool; the others turn."""
    bodies = model.bodies
    own = [k for k in range(1, len(bodies)) if bodies["owner"][k] == k]
    slides = np.zeros(model.nv, dtype=bool)
    slides[bodies["dof"][own]] = np.isin(bodies["direction"][own], (LINEAR_X, LINEAR_Y, LINEAR_Z))
    return slides.tolist()
