# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regressors of a model at states: its momentum, gravity and energies, linear in the inertias of its bodies."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.kernels.regressors import PARAMETERS, regressors_many
from diag_dynamics.sweeps import Workspace


class Regressors(NamedTuple):
    """Columns for ten parameters of each body but the world, in its frame: m, mc (three), Ixx, Ixy, Iyy, Ixz, Iyz, Izz.

    Attributes
    ----------
    momentum : ndarray, shape (T, nv, 10 N)
        Y_p, of M q̇; armature is no part of it.
    velocity : ndarray, shape (T, nv, 10 N)
        Y_∂, of ∂K/∂q: d/dt M q̇ − ∂K/∂q + g is the effort.
    gravity : ndarray, shape (T, nv, 10 N)
        Y_g, of g.
    kinetic, potential : ndarray, shape (T, 10 N)
        y_K and y_U, of both energies.
    """

    momentum: Array
    velocity: Array
    gravity: Array
    kinetic: Array
    potential: Array


def regressors(model, Q, QD):
    """:class:`Regressors` at states.

    Parameters
    ----------
    model : RobotModel
    Q : ndarray, shape (T, nq)
    QD : ndarray, shape (T, nv)

    Raises
    ------
    InputError
        A state is not finite or no orientation.
    """
    count, bodies = len(Q), len(model.bodies)
    columns = PARAMETERS * (bodies - 1)
    found = Regressors(*np.empty((3, count, model.nv, columns)), *np.empty((2, count, columns)))
    workspace = Workspace(model.bodies, model.gravity)
    done = regressors_many(workspace.robot, Q, QD, np.zeros((bodies, bodies, 12)), *found)
    if done < count:
        raise InputError(f"state {done} is not finite, or its orientation is none.")
    return found
