# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checked arguments of a simulation: start state, friction, damping and limits."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import VectorLike
from diag_dynamics.checks import array_of, in_order, numbers
from diag_dynamics.exceptions import InputError


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

    Attributes
    ----------
    stiffness : float or array_like, shape (nv,)
        [N m/rad, N/m], greater than zero; inf is a hard limit.
    damping : float or array_like, shape (nv,)
        [N m s/rad, N s/m].
    """

    stiffness: VectorLike | float
    damping: VectorLike | float = 0.0


def resistance(name, value, names):
    """Return `value` as a new vector of numbers ≥ 0, one for each name."""
    value, length = in_order(name, value, names), len(names)
    array = numbers(name, value, (length,), f"{length} finite numbers")
    if (array < 0.0).any():
        raise InputError(f"{name} is {array.tolist()}, expected {length} finite numbers >= 0.")
    return array


def limits_of(value, model):
    """Return the bounds, shape (2, nq), and stiffness and damping of the limits, shape (nv,) each."""
    nv, bounds = model.nv, np.array([model.lower, model.upper])
    if isinstance(value, (bool, np.bool_)):
        unlimited = np.array([[-np.inf], [np.inf]]) * np.ones(model.nq)
        return bounds if value else unlimited, np.full(nv, np.inf), np.zeros(nv)
    if not isinstance(value, CompliantLimits):
        raise InputError(f"limits is {value!r}, expected True, False or CompliantLimits(stiffness, damping).")
    checked = []
    for name, given in zip(("stiffness", "damping"), value, strict=True):
        array = array_of(in_order(f"{name} of limits", given, model.dof_names))
        if array is None or array.shape not in ((), (1,), (nv,)):
            array = np.array(np.nan)
        array = np.array(np.broadcast_to(array, (nv,)))
        wrong = array <= 0.0 if name == "stiffness" else (array < 0.0) | np.isinf(array)
        if np.isnan(array).any() or wrong.any():
            expected = "greater than zero" if name == "stiffness" else ">= 0 and finite"
            raise InputError(f"{name} of limits is {given!r}, expected a number or {nv} numbers, {expected}.")
        checked.append(array)
    return bounds, *checked


def effort_limits_of(value, model):
    """Return the largest efforts, shape (nv,): `value`, those of the model, or inf.

    A URDF must give each joint an effort limit. Authors who know none write 0, so 0 counts as no limit.
    """
    if isinstance(value, (bool, np.bool_)):
        own = np.where(model.effort_limit > 0.0, model.effort_limit, np.inf)
        return own if value else np.full(model.nv, np.inf)
    array = array_of(in_order("effort_limits", value, model.dof_names))
    if array is None or array.shape != (model.nv,) or not (array >= 0.0).all():
        raise InputError(f"effort_limits is {value!r}, expected True, False or {model.nv} numbers >= 0, inf for none.")
    return array
