# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments of DiagonalDynamics: one state as vectors, or many as rows. Every error is an InputError."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, TypeGuard

import numpy as np

from diag_dynamics import threads
from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import has_names, in_order, listed
from diag_dynamics.exceptions import InputError, SingularMassMatrixError
from diag_dynamics.model import RobotModel
from diag_dynamics.sweeps import joints

ARRAY, FLOAT = np.ndarray, np.dtype(np.float64)


def is_batch(q: Any) -> bool:
    """Whether positions are rows of many states, or columns by name."""
    if isinstance(q, (list, tuple)):
        return all(map(_is_row, q)) and len({len(row) for row in q}) == 1
    if isinstance(q, Mapping):
        return any(isinstance(x, (list, tuple)) or getattr(x, "ndim", 0) for x in q.values())
    return getattr(q, "ndim", 1) == 2


def _is_row(value: Any) -> bool:
    return isinstance(value, (list, tuple, Mapping)) or getattr(value, "ndim", 0) == 1


def to_vector(name: str, value: VectorLike, names: Sequence[str]) -> Array:
    """Return an argument as a new float64 vector with one entry per name.

    It is a copy, because another thread could change the argument between its check and the sweep.
    """
    if type(value) is ARRAY and value.dtype is FLOAT and value.shape == (len(names),):
        return np.array(value, dtype=FLOAT)
    array = _numbers(name, in_order(name, value, names), "a vector")
    if array.shape != (len(names),):
        expected = f"({len(names)},): one entry for each of {listed(names)}"
        raise InputError(f"{name} has shape {array.shape}, expected {expected}.")
    return np.array(array, dtype=FLOAT)


def to_rows(name: str, value: MatrixLike, names: Sequence[str], count: int | None = None) -> Array:
    """Return an argument as a contiguous float64 array with one row per state, `count` of them if given."""
    value = in_order(name, value, names)
    if isinstance(value, (list, tuple)) and any(has_names(row) or isinstance(row, Mapping) for row in value):
        value = [in_order(f"{name}[{t}]", row, names) for t, row in enumerate(value)]
    array = _numbers(name, value, "an array")
    if array.ndim != 2 or array.shape[1] != len(names) or count not in (None, len(array)):
        rows = "T" if count is None else count
        raise InputError(f"{name} has shape {array.shape}, expected ({rows}, {len(names)}): a row for each state.")
    return np.ascontiguousarray(array, dtype=np.float64)


def _numbers(name: str, value: Any, kind: str) -> Any:
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} is not {kind} of numbers: {error}.") from error
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name} is not {kind} of numbers: it has dtype {array.dtype}.")
    return array


def check_finite(name: str, values: Array, names: Sequence[str]) -> None:
    """Name the first entry of a vector or of rows that is not finite."""
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        *state, k = wrong[0]
        where = f"state {state[0]}: " if state else ""
        raise InputError(f"{where}{name} of joint '{names[k]}' is {values[tuple(wrong[0])]}, expected a finite number.")


def check_sum(tau: Array) -> None:
    """Reject efforts that wrenches or friction have made infinite."""
    finite = np.isfinite(tau).all(axis=-1)
    if not finite.all():
        where = f"state {int(np.argmin(finite))}: " if tau.ndim == 2 else ""
        raise InputError(
            f"{where}tau, f_ext or friction are not finite or too large: their sum is not a finite number."
        )


def check_power(power: Array) -> None:
    """Reject a power, shape (T,), that wrenches or friction have made infinite."""
    finite = np.isfinite(power)
    if not finite.all():
        raise InputError(f"state {int(np.argmin(finite))}: QD, f_ext or friction are too large: the power overflows.")


def check_frame(frame: str) -> None:
    """Reject unknown axes."""
    if frame not in ("link", "world"):
        raise InputError(f"frame is {frame!r}, expected 'link' or 'world'.")


def thread_count(number: int | None) -> int:
    """Return the number of threads, by default that of processors."""
    if number is None:
        return threads.cores()
    if not (isinstance(number, (int, np.integer)) and number >= 1):
        raise InputError(f"threads is {number!r}, expected a whole number >= 1.")
    return int(number)


def has_wrenches(f_ext: Mapping[str, Any] | None) -> TypeGuard[Mapping[str, Any]]:
    """Whether an argument has wrenches; anything but None and an empty dict counts, to be checked."""
    return f_ext is not None and not (isinstance(f_ext, dict) and not f_ext)


def raise_failure(model: RobotModel, status: int, work: Any, q: Array, inputs: Mapping[str, Array]) -> NoReturn:
    """Raise the error of a sweep's status, naming joint and value.

    Parameters
    ----------
    status : int
        Not zero.
    work : ndarray
        Records of the workspace, which have the D of the failed sweep.
    q : ndarray, shape (nq,)
        Positions.
    inputs : dict
        Other vectors of the sweep by name, shape (nv,).
    """
    names, coordinates = model.dof_names, model.coordinate_names
    if status > 0 and np.isfinite(work["D"][status]):
        joint, D = names[model.bodies["dof"][status]], float(work["D"][status])
        raise SingularMassMatrixError(
            f"The mass matrix of robot '{model.name}' is singular at this configuration: joint '{joint}' "
            f"moves no inertia there (D = {D:.3g}, less than {joints.SINGULAR:g} of the inertias that it comes from).",
            joint,
            D,
        )
    check_finite("q", q, coordinates)
    for name, values in inputs.items():
        check_finite(name, values, names)
    for k, orientation in enumerate(model.orientations):
        quaternion = q[k - 3 : k + 1]
        if orientation == 3 and abs(quaternion @ quaternion - 1.0) >= joints.UNIT_TOLERANCE:
            raise InputError(
                f"q of joint '{coordinates[k].rpartition('/')[0]}' has the quaternion {quaternion.tolist()} "
                "(x, y, z, w), expected one of length 1."
            )
    raise InputError(f"{', '.join(['q', *inputs])} are too large: a result overflows.")
