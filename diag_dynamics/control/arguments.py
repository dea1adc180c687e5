"""Arguments of laws and filters, checked: each wrong one is named."""

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.model import RobotModel


def actuated(dynamics):
    """The dynamics of a robot that has a motor at every degree of freedom, as far as its description tells."""
    if not isinstance(dynamics, DiagonalDynamics):
        raise InputError(f"dynamics is {dynamics!r}, expected a DiagonalDynamics.")
    model = dynamics.model
    if model.floating_base:
        raise UnsupportedError(
            f"robot '{model.name}' has a floating base, which no motor drives: control needs a fixed base."
        )
    for joint in model.joint_names:
        if joint not in model.dof_names:
            raise UnsupportedError(
                f"joint '{joint}' of robot '{model.name}' has several degrees of freedom, which no motor drives; lock it."
            )
    return dynamics


def per_dof(name, value, names, expected="a finite number > 0", valid=lambda x: np.isfinite(x) & (x > 0.0)):
    """One number for all of the names, or one for each, as a new read-only vector; a wrong one is named.

    Raises
    ------
    InputError
        Neither, or a number that is not valid.
    """
    try:
        given = np.array(value, dtype=float)
    except (TypeError, ValueError):
        given = np.array([[np.nan]])
    n = len(names)
    if given.shape not in ((), (n,)):
        raise InputError(f"{name} is {value!r}, expected {expected}, or {n} such: one for each of {', '.join(names)}.")
    vector = np.ascontiguousarray(np.broadcast_to(given, (n,)))
    for dof, number in zip(names, vector, strict=True):
        if not valid(number):
            raise InputError(f"{name} of '{dof}' is {number}, expected {expected}.")
    vector = vector.copy()
    vector.flags.writeable = False
    return vector


def positive(name, value, unit, *, zero=False):
    """A finite number above zero, or of zero too.

    Raises
    ------
    InputError
        It is none.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if isinstance(value, bool) or not np.isfinite(number) or number < 0.0 or (number == 0.0 and not zero):
        raise InputError(f"{name} is {value!r}, expected a finite number {'>=' if zero else '>'} 0 {unit}.")
    return number


def vector_of(name, value, names):
    """A vector of finite numbers, one for each name, as a new array; a wrong one is named."""
    try:
        vector = np.array(value, dtype=float)
    except (TypeError, ValueError):
        vector = np.array([[np.nan]])
    if vector.shape != (len(names),):
        raise InputError(f"{name} is {value!r}, expected {len(names)} finite numbers, one for each degree of freedom.")
    if not np.isfinite(vector).all():
        k = int(np.argmin(np.isfinite(vector)))
        raise InputError(f"{name} of joint '{names[k]}' is {vector[k]}, expected a finite number.")
    return vector


def robot_model(model):
    """The argument, if it is a RobotModel."""
    if not isinstance(model, RobotModel):
        raise InputError(f"model is {model!r}, expected a RobotModel.")
    return model
