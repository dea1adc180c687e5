# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers and orders of a robot's joints from lists of parameters."""

from diag_dynamics.checks import per_name
from diag_dynamics.entries import ALL, assignments
from diag_dynamics.exceptions import InputError


def by_dof(parameter, entries, names, default=None):
    """One positive number for each name from entries such as ``joint=5.0`` and ``*=3.0``.

    Raises
    ------
    InputError
        An entry is malformed or names no joint, a joint has none and `default` is None, or a number is not positive.
    """
    values = assignments(parameter, entries)
    for name in values:
        if name != ALL and name not in names:
            raise InputError(
                f"parameter '{parameter}' names '{name}', which is no joint to control: {', '.join(names)}."
            )
    missing = [name for name in names if name not in values]
    if missing and ALL not in values and default is None:
        raise InputError(f"parameter '{parameter}' has no entry for joint '{missing[0]}', and none for * (all others).")
    rest = [values.get(ALL, number) for number in default] if default is not None else [values.get(ALL)] * len(names)
    numbers = [values.get(name, other) for name, other in zip(names, rest, strict=True)]
    return per_name(f"parameter '{parameter}'", numbers, names, "a number > 0", lambda x: x > 0.0)


def effort_limits(entries, model):
    """Largest effort of each joint [N m, N], of entries as :func:`by_dof` reads them; the URDF's where there is none.

    Raises
    ------
    InputError
        As by :func:`by_dof`; or a limit is above the URDF's, which is what the joint can bear.
    """
    limits = by_dof("effort_limit", entries, model.dof_names, model.effort_limit)
    for name, limit, bearable in zip(model.dof_names, limits, model.effort_limit, strict=True):
        if limit > bearable > 0.0:
            raise InputError(
                f"parameter 'effort_limit' of '{name}' is {limit:g}, expected no more than the {bearable:g} of the URDF: "
                "if that is wrong, correct it there."
            )
    return limits


def command_order(entries, names):
    """Places, in the robot's order, of a command's entries.

    Raises
    ------
    InputError
        A name is no joint of the robot, or there twice, or a joint has no place: every joint needs its effort.
    """
    joints = [name for name in entries if name] or list(names)
    place, seen = {name: k for k, name in enumerate(names)}, set()
    for name in joints:
        if name not in place:
            raise InputError(
                f"parameter 'command_joints' names '{name}', which is no joint to control: {', '.join(names)}."
            )
        if name in seen:
            raise InputError(f"parameter 'command_joints' names '{name}' twice.")
        seen.add(name)
    for name in names:
        if name not in seen:
            raise InputError(
                f"parameter 'command_joints' lacks joint '{name}', which nothing would drive: name it, or lock it "
                "(locked_joints)."
            )
    return tuple(joints), [place[name] for name in joints]


def require_same_joints(own, theirs, controller):
    """Compare the order of commands with that which an effort controller has.

    Raises
    ------
    InputError
        They differ; the first entry that does is named.
    """
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
