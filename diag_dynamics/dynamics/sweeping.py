# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all methods of DiagonalDynamics share: the robot, memory for sweeps, checked arguments, errors of sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np

from diag_dynamics import batch, sweeps
from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import in_order, listed
from diag_dynamics.exceptions import InputError, SingularMassMatrixError
from diag_dynamics.model import RobotModel


class Sweeping:
    """A robot and memory for sweeps over its links.

    Parameters
    ----------
    model : RobotModel
        What :func:`load_urdf` returned.
    """

    def __init__(self, model: RobotModel) -> None:
        if not isinstance(model, RobotModel):
            raise InputError(f"DiagonalDynamics needs a RobotModel, as load_urdf returns, not {type(model).__name__}.")
        self.model = model
        self._workspace = sweeps.Workspace(model.bodies, model.gravity)
        self._robot = self._workspace.robot
        self._workspaces = batch.Workspaces(model)
        self._nv, self._factors_shape = model.nv, (3, model.nv, model.nv)
        self._shape = sweeps.ROWS, max(model.nq, 1)  # the row of a number has one entry even if there are no joints
        self._whole = self._shape[1] == model.nv
        self._zero = np.zeros(model.nv)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.model,)  # a copy has a workspace of its own

    def refuse(self, status: int, workspace: Any, q: Array, **inputs: Array) -> None:
        """Raise what the status of a sweep stands for that failed in another workspace of this robot.

        Parameters
        ----------
        status : int
            Of the sweep, not zero.
        workspace : Workspace
            In which it ran.
        q : ndarray, shape (nq,)
            Positions at which it failed.
        **inputs
            Its vectors by name, shape (nv,) each.

        Raises
        ------
        InputError, SingularMassMatrixError
            Naming joint and value.
        """
        self._fail(status, workspace, q, **inputs)

    # Arguments are copied to new arrays, not to memory of this object: another thread would write to it between the copy
    # and the sweep. A sweep itself holds the interpreter's lock, or works in memory that no other thread has.

    def _vector(self, name: str, value: VectorLike) -> Array:
        """The argument as a new contiguous float64 vector of nv entries."""
        return _copied(name, value, self.model.dof_names)

    def _positions(self, q: VectorLike) -> Array:
        """Positions as a new contiguous float64 vector of nq entries."""
        return _copied("q", q, self.model.coordinate_names)

    def _finite(self, name: str, value: VectorLike) -> Array:
        """As :meth:`_vector`, and all entries finite."""
        x = self._vector(name, value)
        _refuse_infinite(name, x, self.model.dof_names)
        return x

    def _checked(self, status: int, q: Array, **inputs: Array) -> None:
        if status:
            # Factorized anew in memory of its own: in the shared one another thread may have been since.
            own = sweeps.Workspace(self.model.bodies, self.model.gravity)
            sweeps.joint_inertias(own.robot, q, *np.empty((2, self._nv)))
            self._fail(status, own, q, **inputs)

    def _fail(self, status: int, workspace: sweeps.Workspace, q: Array, **inputs: Array) -> NoReturn:
        """Raise what a sweep's status stands for, naming joint and value; the workspace has its D."""
        names = self.model.dof_names
        if status > 0 and np.isfinite(workspace.work["D"][status]):
            joint, D = names[self.model.bodies["dof"][status]], float(workspace.work["D"][status])
            raise SingularMassMatrixError(
                f"The mass matrix of robot '{self.model.name}' is singular at this configuration: joint '{joint}' "
                f"moves no inertia there (D = {D:.3g}, less than {sweeps.SINGULAR:g} of the inertias that it comes from).",
                joint,
                D,
            )
        coordinates = self.model.coordinate_names
        for argument, values in ({"q": q} | inputs).items():
            _refuse_infinite(argument, values, coordinates if argument == "q" else names)
        for k, orientation in enumerate(self.model.orientations):
            quaternion = q[k - 3 : k + 1]
            if orientation == 3 and abs(quaternion @ quaternion - 1.0) >= sweeps.UNIT_TOLERANCE:
                raise InputError(
                    f"q of joint '{coordinates[k].rpartition('/')[0]}' has the quaternion {quaternion.tolist()} "
                    "(x, y, z, w), expected one of length 1."
                )
        raise InputError(f"{', '.join(['q', *inputs])} are too large: a result overflows.")


ARRAY, FLOAT = np.ndarray, np.dtype(np.float64)


def _refuse_infinite(argument: str, values: Array, names: Sequence[str]) -> None:
    """Name the first entry that is not finite."""
    for name, value in zip(names, values, strict=True):
        if not np.isfinite(value):
            raise InputError(f"{argument} of joint '{name}' is {value}, expected a finite number.")


def _copied(name: str, value: VectorLike, names: Sequence[str]) -> Array:
    """An argument as a new vector, its shape checked."""
    if type(value) is np.ndarray and value.dtype is FLOAT and value.shape == (len(names),):
        return np.array(value, dtype=FLOAT)
    value = in_order(name, value, names)
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} is not a vector of numbers: {error}.") from error
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name} is not a vector of numbers: it has dtype {array.dtype}.")
    if array.shape != (len(names),):
        many = " For many states at once there are methods whose names end in _batch." if array.ndim == 2 else ""
        expected = f"({len(names)},): one entry for each of {listed(names)}"
        raise InputError(f"{name} has shape {array.shape}, expected {expected}.{many}")
    return np.array(array, dtype=FLOAT)
