# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checked arguments of a simulation: start state, friction, damping and limits."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import VectorLike
from diag_dynamics.checks import array_of, in_order, vector
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps.records import WRENCH

NO_WRENCHES = np.zeros(0, WRENCH)


def rest_position(model):
    """Return zero, or the middle of a joint's limits where zero lies outside them; [rad, m], shape (nq,)."""
    lower, upper = np.maximum(model.lower, -1e6), np.minimum(model.upper, 1e6)
    outside = (lower > 0.0) | (upper < 0.0)
    return np.where(outside, 0.5 * (lower + upper), model.neutral)


def with_unit_quaternions(model, q):
    """Return a copy of q with quaternions of unit length."""
    q = np.array(q, dtype=float)
    for k, component in enumerate(model.orientations):
        if component == 3:
            q[k - 3 : k + 1] /= np.linalg.norm(q[k - 3 : k + 1])
    return q


class CompliantLimits(NamedTuple):
    """Position limits that give way: a spring and a damper that push a joint back into its range, and never pull.

    Each number is for all joints, or an array of shape (nv,). Of degrees of freedom without limits it has no effect.
    """

    stiffness: VectorLike | float
    """[N m/rad, N/m], greater than zero; inf is a hard limit."""
    damping: VectorLike | float = 0.0
    """[N m s/rad, N s/m]."""


def not_negative(name, value, names):
    """Return `value` as a new vector of numbers ≥ 0, one for each name."""
    array = vector(name, value, names)
    if (array < 0.0).any():
        raise InputError(f"{name} is {array.tolist()}, expected {len(names)} finite numbers >= 0.")
    return array


def limits_of(value, model):
    """Return whether there are limits, and their stiffness and damping, shape (nv,) each."""
    nv, checked = model.nv, []
    if isinstance(value, (bool, np.bool_)):
        return bool(value), np.full(nv, np.inf), np.zeros(nv)
    if not isinstance(value, CompliantLimits):
        raise InputError(f"limits is {value!r}, expected True, False or CompliantLimits(stiffness, damping).")
    for name, given in value._asdict().items():
        array = array_of(in_order(f"{name} of limits", given, model.dof_names))
        if array is None or array.shape not in ((), (1,), (nv,)):
            array = np.array(np.nan)
        array = np.array(np.broadcast_to(array, (nv,)))
        valid = array > 0.0 if name == "stiffness" else (array >= 0.0) & np.isfinite(array)
        if not valid.all():
            expected = "greater than zero" if name == "stiffness" else ">= 0 and finite"
            raise InputError(f"{name} of limits is {given!r}, expected a number or {nv} numbers, {expected}.")
        checked.append(array)
    return True, *checked


def effort_limits_of(value, model):
    """Return the largest efforts, shape (nv,): `value`, those of the model, or inf."""
    if isinstance(value, (bool, np.bool_)):
        return model.effort_bound.copy() if value else np.full(model.nv, np.inf)
    array = array_of(in_order("effort_limits", value, model.dof_names))
    if array is None or array.shape != (model.nv,) or not (array >= 0.0).all():
        raise InputError(f"effort_limits is {value!r}, expected True, False or {model.nv} numbers >= 0, inf for none.")
    return array
