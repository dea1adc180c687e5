# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sweeps over one robot: the kernel of each quantity, its call at one state or many, its errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, NoReturn

import numpy as np

from diag_dynamics import checks, threads
from diag_dynamics.arrays import Array, Frame, PointLike
from diag_dynamics.description.check_table import warn
from diag_dynamics.dynamics.arguments import States
from diag_dynamics.exceptions import (
    DiagDynamicsError,
    InputError,
    LoopWarning,
    SingularMassMatrixError,
)
from diag_dynamics.model import RobotModel
from diag_dynamics.model.links import point_in_body, wrenches_at, wrenches_on_links
from diag_dynamics.model.massless import joint_inertias
from diag_dynamics.model.mimic import FollowerMotion, loop_error, loop_title
from diag_dynamics.numerics.callback import FAILED
from diag_dynamics.sweeps import (
    batch,
    classical,
    contacts,
    couplings,
    external,
    factorization,
    joints,
    kinematics,
    mobilities,
    regressors,
)
from diag_dynamics.sweeps import workspace as ws


class Sweep(NamedTuple):
    """Kernels of one state and of many; the latter returns the first state that fails."""

    single: Any
    many: Any


def _vector_sweep(single: Any, number: int) -> Sweep:
    """Return a sweep whose result is a vector, by its number in batch.sweep_each."""

    def many(robot: int, q: Array, *arguments: Any) -> Any:
        *inputs, first, last, result = arguments
        unused = np.zeros((1, 1)), np.zeros((1, 1)), 0.0
        inputs.extend(unused[len(inputs) :])
        return batch.sweep_each(robot, number, q, *inputs, first, last, result)

    return Sweep(single, many)


def _transformation(number: int) -> Sweep:
    """Return a transformation of factorization.transform by its number."""

    def single(robot: int, q: Array, x: Array, result: Array) -> Any:
        return factorization.transform.run(robot, q, x, number, result)

    def many(robot: int, Q: Array, X: Array, first: int, last: int, result: Array) -> Any:
        return batch.sweep_each(robot, batch.TRANSFORM, Q, X, X, number, first, last, result)

    return Sweep(single, many)


def _factors_each(robot: int, Q: Array, first: int, last: int, factors: Array, D: Array) -> Any:
    """Fill the factors of many states, (T, 3, nv, nv), and their D."""
    matrices = factors.reshape(3 * len(Q), *factors.shape[2:])
    return batch.factors_each(robot, Q, first, last, matrices, D)


MASS_MATRIX = Sweep(classical.mass_matrix, batch.mass_matrix_each)
FACTORS = Sweep(factorization.factors, _factors_each)
REGRESSOR = Sweep(regressors.regressor, batch.regressor_each)
TOUCHED_LINK = Sweep(external.touched_link, external.touched_link_each)
CONTACTS = Sweep(contacts.contacts, contacts.contacts_each)
FORWARD_DYNAMICS = _vector_sweep(classical.forward_dynamics, batch.FORWARD)
INVERSE_DYNAMICS = _vector_sweep(classical.inverse_dynamics, batch.INVERSE)
MOMENTUM = _vector_sweep(classical.momentum, batch.MOMENTUM)
FIRST_MOMENT = _vector_sweep(classical.first_moment, batch.FIRST_MOMENT)
NU_FROM_QD, QD_FROM_NU, EPSILON_FROM_TAU, TAU_FROM_EPSILON = map(_transformation, range(4))


class Sweeps:
    """A robot with memory for its sweeps, and checks of their arguments."""

    def __init__(self, model: RobotModel) -> None:
        self.model = model
        self._nv = model.nv
        self._shape = ws.N_ROWS, max(model.nq, 1)  # numbers need an entry even without joints
        self._workspace = model.new_workspace()
        self._robot = self._workspace.robot
        self._workspaces = threads.Workspaces(model)
        self._zero = np.zeros(model.nv)  # for rates and efforts of one state or of many
        self._loops = bool(model.loops)
        friction = model.friction, model.load_friction, model.root_friction
        self._has_friction, self._depends_on_load, self._has_roots = (
            bool(values.any()) for values in friction
        )
        self._followers = FollowerMotion(model) if model.has_follower_friction else None
        self._ratios = self._workspace.couplings.ratio if model.loops else np.zeros(0)

    # --- Arguments

    def _state(self, q: Any, **vectors: Any) -> States:
        """Return the arguments of one state, copied; kernels check whether they are finite."""
        names = self.model.dof_names
        q = checks.vector("q", q, self.model.coordinate_names, finite=False)
        for name, x in vectors.items():
            if x is not self._zero:
                vectors[name] = checks.vector(name, x, names, finite=False)
        return States(q, vectors)

    def _states(self, q: Any, number: int | None, **vectors: Any) -> States:
        """Return the arguments of one state, or of many if q has rows.

        Many are for a number of threads or all processors.
        """
        if not checks.is_rows(q):
            return self._state(q, **vectors)
        q = checks.rows("q", q, self.model.coordinate_names)
        names = self.model.dof_names
        for name, x in vectors.items():
            is_zero = x is self._zero
            vectors[name] = x[None] if is_zero else checks.rows(name, x, names, len(q))
        number = threads.cores() if number is None else checks.whole("threads", number)
        return States(q, vectors, number)

    # --- Calls

    def _call(
        self,
        sweep: Sweep,
        at: States,
        *shapes: tuple[int, ...],
        before: tuple[Any, ...] = (),
        after: tuple[Any, ...] = (),
        memory: Sequence[Array] = (),
        problem: str = "",
    ) -> Sequence[Array]:
        """Return the results of a sweep at one state, or at many in threads.

        Parameters
        ----------
        sweep, at
            The sweep, and its states.
        *shapes : tuple of int
            Shapes of the results at one state.
        before, after : tuple
            Arguments of the kernels before q, and after the vectors.
        memory : sequence of ndarray
            Memory for the results at many states; by default their shapes have a leading axis.
        problem : str
            Error if a result overflows, by default that of an argument.
        """
        inputs = *before, at.q, *at.vectors.values(), *after
        if not at.threads:
            outputs: Sequence[Array] = list(map(np.empty, shapes))
            status = sweep.single(self._robot, *inputs, *outputs)
            if status or self._loops:
                self._check(status, at, problem)
            return outputs
        outputs = memory or [np.empty((len(at.q), *shape)) for shape in shapes]

        def run(robot: int, first: int, last: int) -> Any:
            return sweep.many(robot, *inputs, first, last, *outputs)

        failing = threads.run_chunks(self._workspaces, len(at.q), run, at.threads)
        for t in failing:
            try:
                self._call(sweep, at.at(t), *shapes, before=before, after=after, problem=problem)
            except DiagDynamicsError as error:
                error.args = f"state {t}: {error}", *error.args[1:]
                raise
        if failing:
            where = f"states {failing[0]} to {failing[-1]}"
            raise InputError(f"arguments have changed while {where} were evaluated.")
        return outputs

    def _vector(
        self, sweep: Sweep, at: States, *after: float, length: int = 0, problem: str = ""
    ) -> Array:
        """Return the vector of a sweep, of length nv by default."""
        return self._call(sweep, at, (length or self._nv,), after=after, problem=problem)[0]

    def _check(self, status: int, at: States, problem: str = "") -> None:
        """Raise the error of a kernel's status at one state, if there is one."""
        if not status:
            self._warn_of_loops()
            return
        if problem and status > couplings.OPEN_LOOP:
            raise InputError(f"{problem}.")
        D = np.nan
        if status > 0:  # in new memory: another thread may have used the shared one since
            workspace = self.model.new_workspace() if self.model.followers else None
            inertias, _ = joint_inertias(self.model, at.q, workspace)
            D = inertias[self.model.bodies["dof"][status]]
        raise_failure(self.model, status, D, at)

    def _warn_of_loops(self) -> None:
        """Warn once that a loop is nearly singular at the last state."""
        if not len(self._ratios) or min(self._ratios.tolist()) >= couplings.NEARLY_SINGULAR:
            return
        number = int(np.argmin(self._ratios))
        title = loop_title(self.model, number)
        ratio = self._ratios[number]
        warn(
            f"{title} of robot '{self.model.name}' is nearly singular for its independent joints, "
            f"by {ratio:.1g}.",
            LoopWarning,
        )
        self._ratios = np.zeros(0)

    # --- Joint space

    def _wrench_effort(self, at: States, f_ext: Mapping[str, Any], frame: Frame) -> Array:
        """Return Jᵀf_ext."""
        records = wrenches_on_links(self.model, f_ext, frame, *at.q.shape[:-1])

        def single(robot: int, q: Array, *arguments: Any) -> Any:
            return classical.effort_of_wrenches(robot, q, records, *arguments)

        def many(robot: int, q: Array, *arguments: Any) -> Any:
            return batch.effort_of_wrenches_each(robot, q, records, len(f_ext), *arguments)

        return self._vector(Sweep(single, many), States(at.q, {}, at.threads), frame == "world")

    def _friction(self, at: States) -> Array:
        """Return the friction that resists rates, shape (…, nv); q is for load and followers."""
        model = self.model
        qd = at.vectors["qd"]
        checks.check_finite("qd", qd, model.dof_names)
        v0 = model.friction_velocity
        resisting = model.damping * qd + model.effort_offset
        if self._has_roots:
            resisting += model.root_friction * root_of_rate(qd, v0)
        if self._depends_on_load or self._has_friction:
            load = np.abs(self._gravity_torque(at)) if self._depends_on_load else 0.0
            resisting += (model.friction + model.load_friction * load) * direction(qd, v0)
        if self._followers:
            efforts = []
            for q, rates in zip(at.q.reshape(-1, model.nq), qd.reshape(-1, model.nv), strict=True):
                G = self._followers.at(q, rates).ratios[len(model.mimics) :]
                coulomb = model.follower_friction * direction(G @ rates, v0)
                efforts.append((model.follower_damping * (G @ rates) + coulomb) @ G)
            resisting += np.reshape(efforts, qd.shape)
        return resisting

    def _gravity_torque(self, at: States) -> Array:
        """Return g(q)."""
        zero = self._zero[None] if at.threads else self._zero
        at = at._replace(vectors={"qd": zero, "qdd": zero})
        return self._vector(INVERSE_DYNAMICS, at, 1.0)

    def _epsilon(self, at: States, tau: Array, problem: str) -> Array:
        """Return ε = ℓτ."""
        at = at._replace(vectors={"tau": tau})
        problem = f"{problem}: a result overflows"
        return self._vector(EPSILON_FROM_TAU, at, problem=problem)

    # --- Links and contact

    def _point_frame(
        self, q: Array, link: str, point: PointLike, frame: Frame
    ) -> tuple[int, Array, Array]:
        """Return a link's body, a point in its axes, and their rotation to the axes of `frame`."""
        body, rotation, in_body = point_in_body(self.model, link, point, frame)
        X = np.empty((3, 4))
        self._check(kinematics.placement(self._robot, q, body, X), States(q))
        return body, in_body, rotation.T if frame == "link" else X[:, :3]

    def _wrench_factor(
        self, at: States, link: str, wrenches: Array, point: PointLike, frame: Frame
    ) -> Array:
        """Return ℓJᵀw of wrenches, shape (number, 6), at a point of a link, one column each."""
        records = wrenches_at(self.model, link, wrenches, point, frame)
        in_world = frame == "world"
        epsilon = np.empty((self._nv, len(records)))
        status = factorization.factor_of_wrenches(self._robot, at.q, records, in_world, epsilon)
        self._check(status, at)
        problem = f"point {list(point)} or the wrench are too large: a result overflows"
        require_finite(at, epsilon, problem)
        return epsilon

    @cached_property
    def _link_frames(self) -> Any:
        """Frames of all links as records for mobilities.mobilities."""
        records = np.zeros(len(self.model.link_names), mobilities.FRAME)
        for k, link in enumerate(self.model.link_names):
            body, X = self.model.placement_in_body(link)
            records[k] = body, X[:3, :3].ravel(), X[:3, 3]
        return records


def direction(qd: Array, v0: float) -> Array:
    """Return tanh(q̇/v₀), the sign of q̇ if v₀ is 0."""
    with np.errstate(over="ignore"):
        return np.tanh(qd / v0) if v0 else np.sign(qd)


def root_of_rate(qd: Array, v0: float) -> Array:
    """Return q̇/√max(|q̇|, v₀): √|q̇| sign q̇, and a straight line through 0 within ±v₀."""
    return qd / np.sqrt(np.maximum(np.abs(qd), max(v0, np.finfo(float).tiny)))


def square(factor: Array, point: PointLike) -> Any:
    """Return FᵀF of a factor ℓJᵀ at a point of a link, unless it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        product = factor.T @ factor
    problem = f"point {list(point)} is too far away: a result overflows"
    require_finite(States(product), product, problem)
    return product


# --- Errors

SUM = "tau, f_ext or friction are not finite or too large: their sum is not a finite number"


def require_finite(at: States, values: Array, problem: str) -> None:
    """Raise an error if results are not finite; it names the first of many states."""
    if not np.isfinite(values).all():
        where = f"state {np.argwhere(~np.isfinite(values))[0][0]}: " if at.threads else ""
        raise InputError(f"{where}{problem}.")


def raise_failure(model: RobotModel, status: int, D: float, at: States) -> NoReturn:
    """Raise the error of a kernel's status other than 0; D is of a singular joint, or NaN."""
    if status == FAILED:
        raise RuntimeError("a step of the sweep could not be compiled; see the error above.")
    if np.isfinite(D):
        joint = model.dof_names[model.bodies["dof"][status]]
        raise SingularMassMatrixError(
            f"The mass matrix of robot '{model.name}' is singular at this configuration: "
            f"joint '{joint}' moves no inertia there (D = {D:.3g}, less than "
            f"{joints.SINGULAR:g} of the inertias that it comes from).",
            joint,
            D,
        )
    checks.check_finite("q", at.q, model.coordinate_names)
    if status <= couplings.OPEN_LOOP:
        raise loop_error(model, status)
    for name, values in at.vectors.items():
        checks.check_finite(name, values, model.dof_names)
    model.integrate(at.q, np.zeros(model.nv))  # raises the error of a quaternion
    raise InputError(f"{', '.join(['q', *at.vectors])} are too large: a result overflows.")
