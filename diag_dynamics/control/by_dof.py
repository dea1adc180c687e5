# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vectors and orders of a robot's joints from lists of parameters."""

import numpy as np

from diag_dynamics.checks import per_name
from diag_dynamics.entries import assignments, by_name
from diag_dynamics.exceptions import InputError
from diag_dynamics.text import distinct


def by_dof(parameter, entries, names, default=None):
    """Return a positive number for each name, or its default.

    Entries are such as ``joint=5.0`` and ``*=3.0``.
    """
    values = by_name(parameter, assignments(parameter, entries), names)
    if default is not None:
        values = dict(zip(names, default, strict=True)) | values
    for name in names:
        if name not in values:
            raise InputError(
                f"parameter '{parameter}' has no entry for joint '{name}'; expected one for it or "
                "for * (all others)."
            )
    return per_name(f"parameter '{parameter}'", values, names, "a number > 0", lambda x: x > 0.0)


def effort_limits(entries, model):
    """Return the effort limits [N m, N] from entries as of :func:`by_dof`.

    They are at most, and by default, those of the URDF.
    """
    limits = by_dof("effort_limit", entries, model.dof_names, model.effort_limit)
    for name, limit, maximum in zip(model.dof_names, limits, model.effort_limit, strict=True):
        if limit > maximum > 0.0:
            value, bound = distinct(limit, maximum)
            raise InputError(
                f"parameter 'effort_limit' of '{name}' is {value}; "
                f"expected at most {bound}, the limit of the URDF."
            )
    return limits


def beyond_limits(model, positions, margin=0.0):
    """Return row and text of the first of positions, shape (..., nv), outside of its limits.

    It is None if all are within a margin of them.
    """
    rows = np.atleast_2d(positions)
    is_within = (model.lower - margin <= rows) & (rows <= model.upper + margin)
    if is_within.all():
        return None
    row, k = np.argwhere(~is_within)[0]
    position, lower, upper = distinct(rows[row, k], model.lower[k], model.upper[k])
    return row, f"joint '{model.dof_names[k]}' is {position}; expected within {lower} … {upper}"


def command_order(entries, names, complete=True):
    """Return the joints of a command's entries and their indices among `names`.

    All joints are the default, and required if `complete`.
    """
    joints = tuple(name for name in entries if name) or tuple(names)
    parameter = "parameter 'command_joints'"
    for name in joints:
        if name not in names:
            raise InputError(f"{parameter} names '{name}'; expected one of {', '.join(names)}.")
        if joints.count(name) > 1:
            raise InputError(f"{parameter} names '{name}' twice; expected each joint once.")
    for name in names:
        if complete and name not in joints:
            raise InputError(
                f"{parameter} lacks joint '{name}'; expected all joints. Name it, or lock it."
            )
    return joints, [names.index(name) for name in joints]


def require_same_joints(joints, executed, controller):
    """Raise InputError if commands are in another order than those of the effort controller."""
    if list(joints) != list(executed):
        order = ", ".join(executed)
        raise InputError(
            f"joints of {controller} are {order}; expected {', '.join(joints)}. "
            f"Set command_joints to [{order}]."
        )
