# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calls of sweeps at one state or at many: memory, checked arguments, errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics import threads
from diag_dynamics.arrays import Array, Frame, ManyWrenches, MatrixLike, VectorLike
from diag_dynamics.dynamics.arguments import (
    check_finite,
    check_frame,
    check_sum,
    has_wrenches,
    is_batch,
    raise_failure,
    thread_count,
    to_rows,
    to_vector,
)
from diag_dynamics.exceptions import InputError, SingularMassMatrixError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.wrenches import wrenches_on_links, wrenches_on_links_of_many
from diag_dynamics.sweeps import batch, classical, derivatives, factorization
from diag_dynamics.sweeps import workspace as ws


class States(NamedTuple):
    """Checked arguments of a sweep at one state, shapes (nq,) and (nv,), or at many with one row each.

    Vectors that are zero at many states have a single row. `threads` is 0 for one state.
    """

    q: Array
    vectors: dict[str, Array]
    threads: int

    def at(self, t: int) -> States:
        """Return the arguments at one of many states."""
        return States(self.q[t], {name: x[min(t, len(x) - 1)] for name, x in self.vectors.items()}, 0)


class Sweep(NamedTuple):
    """A sweep that returns a vector: its kernel for one state, and its number in `batch.sweep_each`."""

    single: Callable[..., int]
    each: int
    options: tuple[float, ...] = ()


FORWARD_DYNAMICS = Sweep(classical.forward_dynamics, batch.FORWARD)
INVERSE_DYNAMICS = Sweep(classical.inverse_dynamics, batch.INVERSE, (1.0,))
WITHOUT_GRAVITY = Sweep(classical.inverse_dynamics, batch.INVERSE, (0.0,))
NU_FROM_QD = Sweep(factorization.nu_from_qd, batch.NU_FROM_QD)
QD_FROM_NU = Sweep(factorization.qd_from_nu, batch.QD_FROM_NU)
EPSILON_FROM_TAU = Sweep(factorization.epsilon_from_tau, batch.EPSILON_FROM_TAU)
TAU_FROM_EPSILON = Sweep(factorization.tau_from_epsilon, batch.TAU_FROM_EPSILON)


ZEROS: Any = object()
"""Argument that stands for zeros."""


class SweepCaller:
    """A robot with memory for its sweeps."""

    def __init__(self, model: RobotModel) -> None:
        self.model, self.nv = model, model.nv
        self._workspace = ws.Workspace(model.bodies, model.gravity)
        self.robot = self._workspace.robot
        self.workspaces = threads.Workspaces(model)
        self.zero = np.zeros(model.nv)

    # --- Arguments

    def positions(self, q: VectorLike) -> Array:
        """Return positions as a new vector."""
        return to_vector("q", q, self.model.coordinate_names)

    def vector(self, name: str, value: VectorLike) -> Array:
        """Return an argument with one entry per degree of freedom as a new vector."""
        return to_vector(name, value, self.model.dof_names)

    def one(self, q: VectorLike, **vectors: VectorLike) -> States:
        """Return checked arguments of one state; `ZEROS` stands for zeros."""
        q = self.positions(q)
        rest = {name: self.zero if x is ZEROS else self.vector(name, x) for name, x in vectors.items()}
        return States(q, rest, 0)

    def many(self, Q: MatrixLike, number: int | None, **rows: MatrixLike) -> States:
        """Return checked arguments of many states; `ZEROS` stands for zeros."""
        Q, names = to_rows("Q", Q, self.model.coordinate_names), self.model.dof_names
        rest = {
            name: self.zero[None] if x is ZEROS else to_rows(name.upper(), x, names, len(Q)) for name, x in rows.items()
        }
        return States(Q, rest, thread_count(number))

    def states(self, q: Any, number: int | None, **arguments: Any) -> States:
        """Return checked arguments of one state or of many."""
        return self.many(q, number, **arguments) if is_batch(q) else self.one(q, **arguments)

    # --- Sweeps

    def run(self, sweep: Sweep, states: States) -> Array:
        """Return the vector of a sweep, at many states one row each."""
        if states.threads:
            return self.run_many(sweep, states, lambda t: self.run(sweep, states.at(t)))
        result = np.empty(self.nv)
        status = sweep.single(self.robot, states.q, *states.vectors.values(), *sweep.options, result)
        self.check(status, states.q, **states.vectors)
        return result

    def run_many(self, sweep: Sweep, states: States, single: Callable[[int], Any]) -> Array:
        """Return the vectors of a sweep at many states; `single` raises the error of one state."""
        Q, results = states.q, np.empty((len(states.q), self.nv))
        A, B = (*states.vectors.values(), self.zero[None])[:2]
        weight = sweep.options[0] if sweep.options else 0.0

        def call(robot: int, first: int, last: int) -> int:
            return batch.sweep_each(robot, sweep.each, Q, A, B, weight, first, last, results)

        self.run_chunks(call, len(Q), states.threads, single)
        return results

    def run_chunks(
        self,
        call: Callable[[int, int, int], int],
        count: int,
        number: int,
        single: Callable[[int], Any],
        width: int = 1,
    ) -> None:
        """Call a sweep of many states in threads, and raise the error of the first state that fails."""
        failing = threads.run_chunks(self.workspaces, count, call, number, width)
        for t in failing:
            try:
                single(t)
            except SingularMassMatrixError as error:
                raise SingularMassMatrixError(f"state {t}: {error}", error.joint, error.articulated_inertia) from None
            except InputError as error:
                raise InputError(f"state {t}: {error}") from None
        if failing:
            raise InputError(f"arguments have changed while states {failing[0]} to {failing[-1]} were evaluated.")

    def check(self, status: int, q: Array, **inputs: Array) -> None:
        """Raise the error of a sweep's status, if there is one."""
        if status:
            # Factorized again in new memory: another thread may have used the shared one since.
            own = ws.Workspace(self.model.bodies, self.model.gravity)
            factorization.joint_inertias(own.robot, q, *np.empty((2, self.nv)))
            raise_failure(self.model, status, own.work, q, inputs)

    # --- Efforts of wrenches and friction

    def wrench_effort(self, states: States, f_ext: ManyWrenches, frame: Frame) -> Array:
        """Return Jᵀf_ext at one state or at many."""
        in_world, Q = frame == "world", states.q
        if not states.threads:
            tau = np.empty(self.nv)
            records = wrenches_on_links(self.model, f_ext, frame)
            self.check(classical.effort_of_wrenches(self.robot, Q, records, in_world, tau), Q)
            return tau
        records, results = wrenches_on_links_of_many(self.model, f_ext, frame, len(Q)), np.empty((len(Q), self.nv))

        def call(robot: int, first: int, last: int) -> int:
            return batch.effort_of_wrenches_each(robot, Q, records, len(f_ext), in_world, first, last, results)

        self.run_chunks(call, len(Q), states.threads, lambda t: mass_matrix(self, states.at(t)))  # only Q can be wrong
        return results

    def epsilon(self, states: States, tau: Array, cause: str) -> Array:
        """Return ε = ℓτ of wrenches or friction, as read-only memory; `cause` begins the error of many states."""

        def fail(t: int) -> None:
            raise InputError(f"{cause} too large: a result overflows.")

        given = states._replace(vectors={"tau": tau})
        epsilon = self.run_many(EPSILON_FROM_TAU, given, fail) if states.threads else self.run(EPSILON_FROM_TAU, given)
        epsilon.setflags(write=False)
        return epsilon


def friction_of(model: RobotModel, qd: Array) -> Array:
    """Return the friction that resists rates, shape (…, nv)."""
    check_finite("qd", qd, model.dof_names)
    v0 = model.friction_velocity
    with np.errstate(over="ignore"):
        direction = np.tanh(qd / v0) if v0 else np.sign(qd)
    return model.damping * qd + model.friction * direction + model.effort_offset


def friction_torque(caller: SweepCaller, qd: Any) -> Array:
    """Return the friction of rates at one state or at many."""
    names = caller.model.dof_names
    return friction_of(caller.model, to_rows("QD", qd, names) if is_batch(qd) else to_vector("qd", qd, names))


def forward_dynamics(
    caller: SweepCaller, states: States, f_ext: ManyWrenches | None, frame: Frame, friction: bool
) -> Array:
    """Return q̈ with wrenches and friction."""
    check_frame(frame)
    qd, tau = states.vectors["qd"], states.vectors["tau"]
    if friction or has_wrenches(f_ext):
        check_finite("qd", qd, caller.model.dof_names)
        check_finite("tau", tau, caller.model.dof_names)
        if friction:
            tau = tau - friction_of(caller.model, qd)
        if has_wrenches(f_ext):
            tau = tau + caller.wrench_effort(states, f_ext, frame)
        check_sum(tau)
    return caller.run(FORWARD_DYNAMICS, states._replace(vectors={"qd": qd, "tau": tau}))


def inverse_dynamics(
    caller: SweepCaller, states: States, f_ext: ManyWrenches | None, frame: Frame, friction: bool
) -> Array:
    """Return τ with wrenches and friction."""
    check_frame(frame)
    tau = caller.run(INVERSE_DYNAMICS, states)
    if friction:
        tau += friction_of(caller.model, states.vectors["qd"])
    if has_wrenches(f_ext):
        tau -= caller.wrench_effort(states, f_ext, frame)
    check_sum(tau)
    return tau


def mass_matrix(caller: SweepCaller, states: States) -> Array:
    """Return M, with a leading axis for many states."""
    Q, M = states.q, np.empty((*states.q.shape[:-1], caller.nv, caller.nv))
    if not states.threads:
        caller.check(classical.mass_matrix(caller.robot, Q, M), Q)
        return M

    def call(robot: int, first: int, last: int) -> int:
        return batch.mass_matrix_each(robot, Q, first, last, M)

    caller.run_chunks(call, len(Q), states.threads, lambda t: mass_matrix(caller, states.at(t)))
    return M


def derivative(
    caller: SweepCaller, sweep: Callable[..., int], q: VectorLike, qd: VectorLike, x: VectorLike, scratch: int = 0
) -> Array:
    """Return the vector of a sweep along q̇ that maps x."""
    at, more, result = caller.one(q, qd=qd, x=x), np.empty((scratch, caller.nv)), np.empty(caller.nv)
    caller.check(sweep(caller.robot, at.q, *at.vectors.values(), *more, result), at.q, **at.vectors)
    return result


def articulated_inertias(caller: SweepCaller, q: VectorLike, qd: VectorLike) -> tuple[Array, Array]:
    """Return D and Ḋ."""
    at, (D, D_rate) = caller.one(q, qd=qd), np.empty((2, caller.nv))
    status = derivatives.articulated_inertias(caller.robot, at.q, at.vectors["qd"], D, D_rate)
    caller.check(status, at.q, **at.vectors)
    return D, D_rate
