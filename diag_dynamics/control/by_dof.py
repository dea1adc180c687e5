# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vectors and orders of a robot's joints from lists of parameters."""

from diag_dynamics.checks import per_name
from diag_dynamics.entries import ALL, assignments
from diag_dynamics.exceptions import InputError


def by_dof(parameter, entries, names, default=None):
    """Return a positive number for each name from entries such as ``joint=5.0`` and ``*=3.0``, or its default."""
    values = assignments(parameter, entries)
    for name in values:
        if name != ALL and name not in names:
            joints = ", ".join(names)
            raise InputError(f"parameter '{parameter}' names '{name}', which is no joint to control: {joints}.")
    missing = [name for name in names if name not in values]
    if missing and ALL not in values and default is None:
        raise InputError(f"parameter '{parameter}' has no entry for joint '{missing[0]}', and none for * (all others).")
    rest = [values.get(ALL, number) for number in default] if default is not None else [values.get(ALL)] * len(names)
    numbers = [values.get(name, other) for name, other in zip(names, rest, strict=True)]
    return per_name(f"parameter '{parameter}'", numbers, names, "a number > 0", lambda x: x > 0.0)


def effort_limits(entries, model):
    """Return the effort limits [N m, N] from entries as of :func:`by_dof`, at most and by default those of the URDF."""
    limits = by_dof("effort_limit", entries, model.dof_names, model.effort_limit)
    for name, limit, maximum in zip(model.dof_names, limits, model.effort_limit, strict=True):
        if limit > maximum > 0.0:
            raise InputError(
                f"parameter 'effort_limit' of '{name}' is {limit:g}, expected no more than the {maximum:g} of the URDF: "
                "if that is wrong, correct it there."
            )
    return limits


def command_order(entries, names):
    """Return the joints of a command's entries, each of the robot's once, and their indices in the robot's order."""
    joints, parameter = tuple(name for name in entries if name) or tuple(names), "parameter 'command_joints'"
    for k, name in enumerate(joints):
        if name not in names:
            raise InputError(f"{parameter} names '{name}', which is no joint to control: {', '.join(names)}.")
        if name in joints[:k]:
            raise InputError(f"{parameter} names '{name}' twice.")
    for name in names:
        if name not in joints:
            raise InputError(
                f"{parameter} lacks joint '{name}', which nothing would drive: name it, or lock it (locked_joints)."
            )
    return joints, [list(names).index(name) for name in joints]


def require_same_joints(own, theirs, controller):
    """Raise InputError if the order of commands differs from an effort controller's; name the first different entry."""
    if list(own) == list(theirs):
        return
    if len(own) != len(theirs):
        difference = f"{len(own)} joints here, {len(theirs)} there"
    else:
        k = next(k for k, pair in enumerate(zip(own, theirs, strict=True)) if pair[0] != pair[1])
        difference = f"entry {k} is '{own[k]}' here and '{theirs[k]}' there"
    raise InputError(
        f"commands and the joints of {controller} do not agree: {difference}. Set command_joints to "
        f"[{', '.join(theirs)}], or the other way round."
    )
