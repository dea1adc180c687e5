# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many states at once, on all cores."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from diag_dynamics import batch, sweeps
from diag_dynamics.arrays import Array, Frame, ManyWrenches, MatrixLike, RowsLike
from diag_dynamics.dynamics.one_state import OneState, friction_of, given, memory_of
from diag_dynamics.exceptions import InputError, SingularMassMatrixError
from diag_dynamics.model.wrenches import wrenches_on_links_of_many
from diag_dynamics.results import BatchEvaluation, BatchMemory, add_power


class ManyStates(OneState):
    """The methods of DiagonalDynamics that take many states."""

    def evaluate_batch(
        self,
        Q: MatrixLike,
        QD: MatrixLike,
        TAU: MatrixLike | None = None,
        f_ext: ManyWrenches | None = None,
        *,
        frame: Frame = "link",
        threads: int | None = None,
        friction: bool = False,
        out: BatchEvaluation | None = None,
    ) -> BatchEvaluation:
        """:meth:`evaluate` at many states, on all cores; what sweeps compute has the bits of single calls.

        Parameters
        ----------
        Q : array_like, shape (T, nq)
            Positions.
        QD : array_like, shape (T, nv)
            Rates.
        TAU : array_like, shape (T, nv), optional
            Joint efforts.
        f_ext : dict, optional
            External wrenches by link name: six numbers for all states, or an array of shape (T, 6).
        frame : {"link", "world"}
            Axes of the wrenches.
        threads : int, optional
            How many to use, by default as many as there are processors for this process.
        friction : bool
            Whether to evaluate friction, too, as :meth:`evaluate` does.
        out : BatchEvaluation, optional
            Where to write the results, made by :meth:`new_batch` for T states. If an error is raised while it is written,
            its results are NaN. Its own arrays may be arguments, as they are before: they are copied.

        Returns
        -------
        BatchEvaluation
            A new one, or `out`.

        Raises
        ------
        InputError, SingularMassMatrixError
            As :meth:`evaluate`, naming the first state that fails; `out` is of another number of states, too.
        """
        threads = threads_of(threads)
        model = self.model
        states = batch.states("Q", Q, model.coordinate_names)
        count = len(states)
        rates = batch.states("QD", QD, model.dof_names, count)
        efforts = self._zero[None] if TAU is None else batch.states("TAU", TAU, model.dof_names, count)
        if out is None:
            memory = BatchMemory.allocate(model, count)
        else:
            memory = memory_of(out, BatchEvaluation, model, "new_batch(T)")
            if len(out) != count:
                raise InputError(f"out has room for {len(out)} states, expected {count}: a row for each state of Q.")
            states, rates, efforts = memory.detach(states), memory.detach(rates), memory.detach(efforts)
        try:
            # Before anything is written: wrenches may lie in `out`.
            pushing = self._efforts_of_wrenches(states, f_ext, frame, threads) if given(f_ext) else None
            self._fill_batch(states, rates, efforts, TAU is not None, memory, threads)
            external = resisting = None
            if pushing is not None:
                external = self._working_moments(states, pushing, "f_ext is", threads)
            if friction:
                resisting = self._working_moments(states, friction_of(model, rates), "friction or QD are", threads)
            if external is not None or resisting is not None:
                power = memory.numbers[sweeps.POWER - sweeps.KINETIC_ENERGY]
                add_power(memory.results[sweeps.NU], power, external, resisting)
                _check_powers(power)
        except BaseException:  # a Ctrl-C, too
            if out is not None:
                for part in memory:
                    part.fill(np.nan)
                out._external = out._friction = None  # those of an earlier batch
            raise
        if out is None:
            return BatchEvaluation(model, memory, TAU is not None, external, resisting)
        for term in (external, resisting):
            if term is not None:
                term.setflags(write=False)
        out._with_tau, out._external, out._friction = TAU is not None, external, resisting
        return out

    def new_batch(self, count: int) -> BatchEvaluation:
        """BatchEvaluation that :meth:`evaluate_batch` can write into, again and again: ``evaluate_batch(…, out=…)``.

        Only `evaluate_batch` writes it; its arrays, also those that were read from it before, then hold the new results.

        Parameters
        ----------
        count : int
            Number of states T.

        Returns
        -------
        BatchEvaluation
            Its results are NaN until something has been evaluated into it.
        """
        if not (isinstance(count, (int, np.integer)) and count >= 0):
            raise InputError(f"count is {count!r}, expected a whole number >= 0.")
        memory = BatchMemory.allocate(self.model, int(count))
        for part in memory:
            part.fill(np.nan)
        return BatchEvaluation(self.model, memory, False, keep=True)

    def evaluate_stream(
        self,
        Q: RowsLike,
        QD: RowsLike,
        TAU: RowsLike | None = None,
        *,
        size: int = 16384,
        threads: int | None = None,
        friction: bool = False,
    ) -> Iterator[BatchEvaluation]:
        """:meth:`evaluate_batch` of any number of states in bounded memory: a generator of one batch after the other.

        Parameters
        ----------
        Q, QD, TAU
            As there; an array that is mapped from a file is read piece by piece.
        size : int
            States of a batch.

        Yields
        ------
        BatchEvaluation
        """
        if not (isinstance(size, (int, np.integer)) and size >= 1):
            raise InputError(f"size is {size!r}, expected a whole number >= 1.")
        for name, value in (("QD", QD), ("TAU", TAU)):
            if value is not None and len(value) != len(Q):
                raise InputError(f"{name} has {len(value)} states, expected as many as Q, {len(Q)}.")
        for first in range(0, len(Q), size):
            part = slice(first, first + size)
            efforts = None if TAU is None else TAU[part]
            yield self.evaluate_batch(Q[part], QD[part], efforts, threads=threads, friction=friction)

    # --- One quantity of many states ---

    def forward_dynamics_batch(
        self,
        Q: MatrixLike,
        QD: MatrixLike,
        TAU: MatrixLike,
        f_ext: ManyWrenches | None = None,
        *,
        frame: Frame = "link",
        friction: bool = False,
        threads: int | None = None,
    ) -> Array:
        """Q̈ [rad/s², m/s²], shape (T, nv): :meth:`forward_dynamics` of each row.

        As that of all methods of this name, it works on all cores, or on `threads` of them; wrenches are six numbers for all
        states or an array of shape (T, 6) for each link; an error names the first state that fails.
        """
        states, rates = self._states(Q=Q, QD=QD)
        torques = batch.states("TAU", TAU, self.model.dof_names, len(states))
        number = threads_of(threads)
        if friction or given(f_ext):
            for name, values in (("qd", rates), ("tau", torques)):
                _require_finite(name, values, self.model.dof_names)
            torques = torques - friction_of(self.model, rates) if friction else torques.copy()
            if given(f_ext):
                torques += self._efforts_of_wrenches(states, f_ext, frame, number)
            _check_sums(torques)
        return self._each(sweeps.FORWARD, self.forward_dynamics, states, rates, torques, threads=number)

    def inverse_dynamics_batch(
        self,
        Q: MatrixLike,
        QD: MatrixLike,
        QDD: MatrixLike,
        f_ext: ManyWrenches | None = None,
        *,
        frame: Frame = "link",
        friction: bool = False,
        threads: int | None = None,
    ) -> Array:
        """τ [N m, N], shape (T, nv): :meth:`inverse_dynamics` of each row."""
        states, rates = self._states(Q=Q, QD=QD)
        accelerations = batch.states("QDD", QDD, self.model.dof_names, len(states))
        number = threads_of(threads)
        tau = self._each(
            sweeps.INVERSE, self.inverse_dynamics, states, rates, accelerations, weight=1.0, threads=number
        )
        if friction:
            tau += friction_of(self.model, rates)
        if given(f_ext):
            tau -= self._efforts_of_wrenches(states, f_ext, frame, number)
        _check_sums(tau)
        return tau

    def mass_matrix_batch(self, Q: MatrixLike, *, threads: int | None = None) -> Array:
        """M(q) [kg m², kg, mixed kg m], shape (T, nv, nv): :meth:`mass_matrix` of each row."""
        (states,) = self._states(Q=Q)
        M = np.empty((len(states), self.model.nv, self.model.nv))

        def sweep(robot: int, first: int, last: int) -> int:
            return sweeps.mass_matrix_each(robot, states, first, last, M)

        failing = batch.in_pieces(self._workspaces, len(states), sweep, threads_of(threads))
        self._refuse_state(failing, lambda t: self.mass_matrix(states[t]))
        return M

    def bias_batch(self, Q: MatrixLike, QD: MatrixLike, *, threads: int | None = None) -> Array:
        """c(q, q̇) [N m, N], shape (T, nv), without gravity: :meth:`bias` of each row."""
        states, rates = self._states(Q=Q, QD=QD)
        return self._each(sweeps.INVERSE, self.inverse_dynamics, states, rates, threads=threads_of(threads))

    def gravity_torque_batch(self, Q: MatrixLike, *, threads: int | None = None) -> Array:
        """g(q) [N m, N], shape (T, nv): :meth:`gravity_torque` of each row."""
        (states,) = self._states(Q=Q)
        return self._each(sweeps.INVERSE, self.inverse_dynamics, states, weight=1.0, threads=threads_of(threads))

    def friction_torque_batch(self, QD: MatrixLike) -> Array:
        """τ_fric [N m, N], shape (T, nv): :meth:`friction_torque` of each row."""
        rates = batch.states("QD", QD, self.model.dof_names)
        if not np.isfinite(rates).all():
            t = int(np.argmin(np.isfinite(rates).all(axis=1)))
            self._refuse_state(range(t, t + 1), lambda t: self.friction_torque(rates[t]))
        return friction_of(self.model, rates)

    def nu_from_qd_batch(self, Q: MatrixLike, QD: MatrixLike, *, threads: int | None = None) -> Array:
        """ν = mᵀq̇ [J^½], shape (T, nv): :meth:`nu_from_qd` of each row."""
        return self._each(sweeps.NU_FROM_QD, self.nu_from_qd, *self._states(Q=Q, QD=QD), threads=threads_of(threads))

    def qd_from_nu_batch(self, Q: MatrixLike, NU: MatrixLike, *, threads: int | None = None) -> Array:
        """q̇ = ℓᵀν [rad/s, m/s], shape (T, nv): :meth:`qd_from_nu` of each row."""
        return self._each(sweeps.QD_FROM_NU, self.qd_from_nu, *self._states(Q=Q, NU=NU), threads=threads_of(threads))

    def epsilon_from_tau_batch(self, Q: MatrixLike, TAU: MatrixLike, *, threads: int | None = None) -> Array:
        """ε = ℓτ [J^½/s], shape (T, nv): :meth:`epsilon_from_tau` of each row."""
        arguments = self._states(Q=Q, TAU=TAU)
        return self._each(sweeps.EPSILON_FROM_TAU, self.epsilon_from_tau, *arguments, threads=threads_of(threads))

    def tau_from_epsilon_batch(self, Q: MatrixLike, EPSILON: MatrixLike, *, threads: int | None = None) -> Array:
        """τ = mε [N m, N], shape (T, nv): :meth:`tau_from_epsilon` of each row."""
        arguments = self._states(Q=Q, EPSILON=EPSILON)
        return self._each(sweeps.TAU_FROM_EPSILON, self.tau_from_epsilon, *arguments, threads=threads_of(threads))

    # --- Between Python and the sweeps ---

    def _states(self, Q: MatrixLike, **more: MatrixLike) -> tuple[Array, ...]:
        """Positions and whatever else is given of each state, checked."""
        states = batch.states("Q", Q, self.model.coordinate_names)
        others = (batch.states(name, value, self.model.dof_names, len(states)) for name, value in more.items())
        return states, *others

    def _fill_batch(
        self, Q: Array, QD: Array, efforts: Array, with_tau: bool, memory: BatchMemory, threads: int
    ) -> None:
        """Evaluate all states into memory, or raise the error of the first that fails."""
        failing = batch.evaluate(self._workspaces, Q, QD, efforts, memory, threads)
        self._refuse_state(failing, lambda t: self.evaluate(Q[t], QD[t], efforts[t] if with_tau else None))

    def _working_moments(self, Q: Array, tau: Array, what: str, threads: int) -> Array:
        """ε of the efforts of something, which an error names."""

        def too_large(q: Array, tau: Array) -> None:
            raise InputError(f"{what} too large: a result overflows.")

        return self._each(sweeps.EPSILON_FROM_TAU, too_large, Q, tau, threads=threads)

    def _each(
        self,
        which: int,
        single: Callable[..., Any],
        Q: Array,
        A: Array | None = None,
        B: Array | None = None,
        *,
        weight: float = 0.0,
        threads: int,
    ) -> Array:
        """A sweep of each state; `single` does the same for one, and says what is wrong with it."""
        zero = np.zeros((1, self.model.nv))
        first, second = zero if A is None else A, zero if B is None else B
        results = np.empty((len(Q), self.model.nv))

        def sweep(robot: int, begin: int, end: int) -> int:
            return sweeps.sweep_each(robot, which, Q, first, second, weight, begin, end, results)

        def again(t: int) -> None:
            vectors = [Q[t], first[min(t, len(first) - 1)]]
            single(*vectors, second[min(t, len(second) - 1)]) if which <= sweeps.INVERSE else single(*vectors)

        self._refuse_state(batch.in_pieces(self._workspaces, len(Q), sweep, threads), again)
        return results

    def _refuse_state(self, failing: range, single: Callable[[int], Any]) -> None:
        """Raise the error of the first of the states one of which fails, if there are any."""
        for t in failing:
            try:
                single(t)
            except SingularMassMatrixError as error:
                raise SingularMassMatrixError(f"state {t}: {error}", error.joint, error.articulated_inertia) from None
            except InputError as error:
                raise InputError(f"state {t}: {error}") from None
        if failing:
            raise InputError(f"arguments have changed while states {failing[0]} to {failing[-1]} were evaluated.")

    def _efforts_of_wrenches(self, Q: Array, f_ext: ManyWrenches, frame: Frame, threads: int) -> Array:
        """Jᵀf_ext of each state."""
        records = wrenches_on_links_of_many(self.model, f_ext, frame, len(Q))
        results, each = np.empty((len(Q), self.model.nv)), len(f_ext)

        def sweep(robot: int, first: int, last: int) -> int:
            return sweeps.effort_of_wrenches_each(robot, Q, records, each, frame == "world", first, last, results)

        failing = batch.in_pieces(self._workspaces, len(Q), sweep, threads)
        self._refuse_state(failing, lambda t: self.mass_matrix(Q[t]))  # only positions can be wrong
        return results


def threads_of(number: int | None) -> int:
    """How many threads to use."""
    if number is None:
        return batch.cores()
    if not (isinstance(number, (int, np.integer)) and number >= 1):
        raise InputError(f"threads is {number!r}, expected a whole number >= 1.")
    return int(number)


def _require_finite(name: str, values: Array, names: Sequence[str]) -> None:
    """Name the first entry that is not finite, and its state."""
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        t, k = wrong[0]
        raise InputError(f"state {t}: {name} of joint '{names[k]}' is {values[t, k]}, expected a finite number.")


def _check_powers(power: Array) -> None:
    """Refuse a power that wrenches or friction have made infinite, naming the state."""
    finite = np.isfinite(power)
    if not finite.all():
        raise InputError(f"state {int(np.argmin(finite))}: QD, f_ext or friction are too large: the power overflows.")


def _check_sums(tau: Array) -> None:
    """Refuse what wrenches or friction have made infinite, naming the state."""
    finite = np.isfinite(tau).all(axis=1)
    if not finite.all():
        t = int(np.argmin(finite))
        raise InputError(f"state {t}: efforts, f_ext or friction are not finite or too large: so is their sum.")
