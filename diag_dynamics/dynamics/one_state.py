# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Everything at one state: diagonalized and classical dynamics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeGuard

import numpy as np
import numpy.typing as npt

from diag_dynamics import sweeps
from diag_dynamics.arrays import Array, Frame, VectorLike, Wrenches
from diag_dynamics.dynamics.links import Links, check_frame
from diag_dynamics.dynamics.sweeping import ARRAY, FLOAT
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.wrenches import wrenches_on_links
from diag_dynamics.results import Evaluation, Factors, add_power, new_evaluation, write_rates


class OneState(Links):
    """The methods of DiagonalDynamics that take one state."""

    def evaluate(
        self,
        q: VectorLike,
        qd: VectorLike,
        tau: VectorLike | None = None,
        f_ext: Wrenches | None = None,
        *,
        frame: Frame = "link",
        friction: bool = False,
        out: Evaluation | None = None,
    ) -> Evaluation:
        """Every quantity of the diagonalized equations of motion at one state.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Positions.
        qd : array_like, shape (nv,)
            Rates.
        tau : array_like, shape (nv,), optional
            Joint efforts as applied, gravity included if they carry it.
        f_ext : dict, optional
            External wrenches.
        frame : {"link", "world"}
            Axes of the wrenches.
        friction : bool
            Whether to evaluate the friction of :meth:`friction_torque` as a term of its own.
        out : Evaluation, optional
            Where to write the results, made by :meth:`new_evaluation`; nothing is allocated then. If an error is raised
            while it is written, its results are NaN. Its own arrays may be arguments, as they are before.

        Returns
        -------
        Evaluation
            A new one, or `out`.

        Raises
        ------
        InputError
            `out` is of another robot, or not one that may be written; or as said above.
        """
        state = _empty(self._shape) if out is None else memory_of(out, Evaluation, self.model, "new_evaluation()")
        effort, status = self._zero if tau is None else tau, _MISFIT
        try:
            # numba may take another byte order for this one, and what a mask hides
            if (
                f_ext is None
                and type(q) is type(qd) is type(effort) is _ARRAY
                and q.dtype is qd.dtype is effort.dtype is _FLOAT
            ):
                status = sweeps.evaluate(self._robot, q, qd, effort, state)
        except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
            pass
        if status or friction or frame != "link":
            return self._evaluate(q, qd, tau, f_ext, frame, friction, state, out)
        if out is None:
            state.setflags(False)  # type: ignore[call-arg]  # by keyword it takes twice as long
            return Evaluation(self.model, state, state if self._whole else state[:, : self._nv], tau is not None)
        out._with_tau, out._external, out._friction = tau is not None, None, None
        return out

    def new_evaluation(self) -> Evaluation:
        """Evaluation that :meth:`evaluate` can write into, for loops that allocate nothing: ``evaluate(…, out=…)``.

        Only `evaluate` writes it; its arrays, also those that were read from it before, then hold the new results.

        Returns
        -------
        Evaluation
            Its results are NaN until something has been evaluated into it.
        """
        return new_evaluation(self.model, self._shape)

    def _evaluate(
        self,
        q: VectorLike,
        qd: VectorLike,
        tau: VectorLike | None,
        f_ext: Wrenches | None,
        frame: Frame,
        friction: bool,
        state: Array,
        out: Evaluation | None,
    ) -> Evaluation:
        """What :meth:`evaluate` does with arguments that are not plain vectors, are wrong, or not all there is."""
        model = self.model
        external = resisting = None
        try:
            check_frame(frame)
            q, rate = self._positions(q), self._vector("qd", qd)
            effort = self._zero if tau is None else self._vector("tau", tau)
            wrenches = wrenches_on_links(model, f_ext, frame) if given(f_ext) else None  # copied: they may lie in `out`
            self._checked(sweeps.evaluate(self._robot, q, rate, effort, state), q, qd=rate, tau=effort)
            rows, power, rate = state[:, : self._nv], state[sweeps.POWER, :1], state[sweeps.RATES, : self._nv]
            if wrenches is not None:
                external = self.epsilon_from_tau(q, self._effort_of(q, wrenches, frame))
                external.setflags(write=False)
            if friction:
                resisting = self.epsilon_from_tau(q, self.friction_torque(rate))
                resisting.setflags(write=False)
            write_rates(rows, external, resisting)
            add_power(rows[sweeps.NU], power, external, resisting)
            if not np.isfinite(power[0]):
                raise InputError("qd, f_ext or friction are too large: the power overflows.")
        except Exception:
            if out is not None:
                state.fill(np.nan)
                out._external = out._friction = None  # those of an earlier state
            raise
        if out is None:
            state.setflags(write=False)
            return Evaluation(model, state, state[:, : self._nv], tau is not None, external, resisting)
        out._with_tau, out._external, out._friction = tau is not None, external, resisting
        return out

    def factors(self, q: VectorLike) -> Factors:
        """m, ℓ, the unit factor and D at q: see :class:`Factors`."""
        factors, D, status = np.empty(self._factors_shape), np.empty(self._nv), sweeps.MISFIT
        try:
            if type(q) is _ARRAY and q.dtype is _FLOAT:  # as in evaluate
                status = sweeps.factors(self._robot, q, factors, D)
        except (AttributeError, TypeError, ValueError):  # no vector of float64: no error yet
            pass
        if status:
            q = self._positions(q)
            self._checked(sweeps.factors(self._robot, q, factors, D), q)
        factors.setflags(False)  # type: ignore[call-arg]  # as in evaluate
        D.setflags(False)  # type: ignore[call-arg]
        return _new(Factors, (factors[0], factors[1], factors[2], D))

    def forward_dynamics(
        self,
        q: VectorLike,
        qd: VectorLike,
        tau: VectorLike,
        f_ext: Wrenches | None = None,
        *,
        frame: Frame = "link",
        friction: bool = False,
    ) -> Array:
        """q̈ [rad/s², m/s²], shape (nv,), from M q̈ + c + g + τ_fric = τ + Jᵀf_ext (Algorithm 8.1 in closed form).

        τ_fric, see :meth:`friction_torque`, only where `friction` is true. Of a joint of several degrees of freedom it is
        the rate of its twist's components.
        """
        qdd = np.empty(self._nv)
        if f_ext is None and not friction and frame == "link":
            try:
                if (
                    type(q) is type(qd) is type(tau) is _ARRAY  # as in evaluate
                    and q.dtype is qd.dtype is tau.dtype is _FLOAT
                    and not sweeps.forward_dynamics(self._robot, q, qd, tau, qdd)
                ):
                    return qdd
            except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
                pass
        check_frame(frame)
        q, qd, tau = self._positions(q), self._vector("qd", qd), self._vector("tau", tau)
        if friction:
            tau -= self.friction_torque(qd)
        if given(f_ext):
            tau += self._effort_of(q, wrenches_on_links(self.model, f_ext, frame), frame)
        _check_sum(tau, friction, f_ext)
        self._checked(sweeps.forward_dynamics(self._robot, q, qd, tau, qdd), q, qd=qd, tau=tau)
        return qdd

    def inverse_dynamics(
        self,
        q: VectorLike,
        qd: VectorLike,
        qdd: VectorLike,
        f_ext: Wrenches | None = None,
        *,
        frame: Frame = "link",
        friction: bool = False,
    ) -> Array:
        """τ = M q̈ + c + g + τ_fric − Jᵀf_ext [N m, N], shape (nv,) (Newton–Euler, eq. 4.3).

        τ_fric only where `friction` is true.
        """
        check_frame(frame)
        tau = self._newton_euler(1.0, q, qd, qdd)
        if friction:
            tau += self.friction_torque(qd)
        if given(f_ext):
            tau -= self._effort_of(self._positions(q), wrenches_on_links(self.model, f_ext, frame), frame)
        _check_sum(tau, friction, f_ext)
        return tau

    def friction_torque(self, qd: VectorLike) -> Array:
        """τ_fric = d q̇ + f tanh(q̇/v₀) + o [N m, N], shape (nv,): damping d, Coulomb friction f and offset o of the model.

        v₀ is the model's `friction_velocity`. At 5 v₀ it is f sign(q̇) but for 1e-4 of f, and at rest it does not jump with
        the sign of a velocity that is nothing but noise. No other quantity holds it unless it is asked to.
        """
        return friction_of(self.model, self._finite("qd", qd))

    def mass_matrix(self, q: VectorLike) -> Array:
        """M(q) [kg m², kg, mixed kg m], shape (nv, nv), armature included."""
        q = self._positions(q)
        M = np.empty((self.model.nv, self.model.nv))
        self._checked(sweeps.mass_matrix(self._robot, q, M), q)
        return M

    def bias(self, q: VectorLike, qd: VectorLike) -> Array:
        """c(q, q̇) of M q̈ + c + g = τ [N m, N], shape (nv,), without gravity. It is not C(q, ν)."""
        return self._newton_euler(0.0, q, qd, self._zero)

    def gravity_torque(self, q: VectorLike) -> Array:
        """g(q) [N m, N], shape (nv,): the effort that holds the robot still."""
        return self._newton_euler(1.0, q, self._zero, self._zero)

    def nu_from_qd(self, q: VectorLike, qd: VectorLike) -> Array:
        """ν = mᵀq̇ [J^½], shape (nv,), in O(N) (Table 1)."""
        return self._sweep(sweeps.nu_from_qd, q, "qd", qd)

    def qd_from_nu(self, q: VectorLike, nu: VectorLike) -> Array:
        """q̇ = ℓᵀν [rad/s, m/s], shape (nv,), in O(N) (Table 1, right)."""
        return self._sweep(sweeps.qd_from_nu, q, "nu", nu)

    def epsilon_from_tau(self, q: VectorLike, tau: VectorLike) -> Array:
        """ε = ℓτ [J^½/s], shape (nv,), in O(N) (Table 2)."""
        return self._sweep(sweeps.epsilon_from_tau, q, "tau", tau)

    def tau_from_epsilon(self, q: VectorLike, epsilon: VectorLike) -> Array:
        """τ = mε [N m, N], shape (nv,), in O(N) (Table 2, right)."""
        return self._sweep(sweeps.tau_from_epsilon, q, "epsilon", epsilon)

    # --- Along a motion ---

    def m_rate_transposed(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """ṁᵀx [J^½/s], shape (nv,), of rates x that are constant [rad/s, m/s], m changing along q̇; in O(N).

        mᵀ's own rate, from d(mᵀx)/dt: with q̇ for x it is the difference of ν̇ and mᵀq̈.
        """
        return self._derivative(sweeps.m_rate_transposed, q, qd, x)

    def coriolis_bracket(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """B(q, ν)x [J^½/s], shape (nv,), of x [J^½], in O(N).

        B = ℓ(C_s − mṁᵀ)ℓᵀ is skew and B ν = C(q, ν) (Identity 7.1, Lemma 7.1), with C_s of :meth:`coriolis_product`.
        """
        return self._derivative(sweeps.coriolis_bracket, q, qd, x, scratch=2)

    def coriolis_product(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """C_s(q, q̇)x [N m, N], shape (nv,), of rates x [rad/s, m/s], in O(N): C_s q̇ = c, and Ṁ − 2C_s is skew.

        It is the Newton–Euler pass of two velocities that passivity-based tracking needs.
        """
        return self._derivative(sweeps.coriolis_product, q, qd, x)

    def mass_matrix_rate(self, q: VectorLike, qd: VectorLike) -> Array:
        """Ṁ = Σ q̇_i ∂M/∂q_i [kg m²/s, …], shape (nv, nv) (Identity 6.3); with a unit vector for qd a partial derivative.

        Of a joint of several degrees of freedom it is the rate along the motion with that twist.
        """
        q, rate = self._positions(q), self._finite("qd", qd)
        M, M_rate = np.zeros((2, self.model.nv, self.model.nv))
        self._checked(sweeps.mass_matrix_rate(self._robot, q, rate, M, M_rate), q, qd=rate)
        return M_rate

    def mass_matrix_rate_times(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """Ṁx [N m, N], shape (nv,), of rates x [rad/s, m/s], in O(N) without forming Ṁ (Identity 6.3)."""
        return self._derivative(sweeps.mass_matrix_rate_times, q, qd, x)

    def log_det(self, q: VectorLike) -> float:
        """Ln det M = Σ ln D_k, as of the numerical values in SI units."""
        return float(np.log(self._articulated_inertias(q, self._zero)[0]).sum())

    def log_det_rate(self, q: VectorLike, qd: VectorLike) -> float:
        """d/dt ln det M = Σ Ḋ_k/D_k [1/s] along q̇."""
        D, D_rate = self._articulated_inertias(q, qd)
        return float((D_rate / D).sum())

    # --- Between Python and the sweeps ---

    def _derivative(
        self, sweep: Callable[..., int], q: VectorLike, qd: VectorLike, x: VectorLike, scratch: int = 0
    ) -> Array:
        """A sweep along q̇ that takes x to a new vector."""
        q, qd, x = self._positions(q), self._vector("qd", qd), self._vector("x", x)
        more, result = np.empty((scratch, self.model.nv)), np.empty(self.model.nv)
        status = sweep(self._robot, q, qd, x, *more, result)
        self._checked(status, q, qd=qd, x=x)
        return result

    def _articulated_inertias(self, q: VectorLike, qd: VectorLike) -> tuple[Array, Array]:
        """D and Ḋ."""
        q, qd = self._positions(q), self._vector("qd", qd)
        D, D_rate = np.empty((2, self.model.nv))
        status = sweeps.articulated_inertias(self._robot, q, qd, D, D_rate)
        self._checked(status, q, qd=qd)
        return D, D_rate

    def _newton_euler(self, weight: float, q: VectorLike, qd: VectorLike, qdd: VectorLike) -> Array:
        q, qd, qdd = self._positions(q), self._vector("qd", qd), self._vector("qdd", qdd)
        tau = np.empty(self.model.nv)
        status = sweeps.inverse_dynamics(self._robot, q, qd, qdd, weight, tau)
        self._checked(status, q, qd=qd, qdd=qdd)
        return tau

    def _sweep(self, sweep: Callable[..., int], q: VectorLike, name: str, value: VectorLike) -> Array:
        result, status = np.empty(self._nv), sweeps.MISFIT
        try:
            if type(q) is type(value) is _ARRAY and q.dtype is value.dtype is _FLOAT:
                status = sweep(self._robot, q, value, result)
        except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
            pass
        if status:
            q, x = self._positions(q), self._vector(name, value)
            self._checked(sweep(self._robot, q, x, result), q, **{name: x})
        return result

    def _effort_of(self, q: Array, wrenches: npt.NDArray[np.void], frame: Frame) -> Array:
        """Jᵀf of wrenches on links at checked positions."""
        tau = np.empty(self.model.nv)
        self._checked(sweeps.effort_of_wrenches(self._robot, q, wrenches, frame == "world", tau), q)
        return tau


_ARRAY, _FLOAT, _MISFIT, _empty = ARRAY, FLOAT, sweeps.MISFIT, np.empty
_new = tuple.__new__  # half of the time that a namedtuple's own takes


def _check_sum(tau: Array, friction: bool, f_ext: Wrenches | None) -> None:
    """Refuse what only wrenches or friction have made infinite."""
    if (friction or given(f_ext)) and not np.isfinite(tau).all():
        raise InputError("tau, f_ext or friction are not finite or too large: their sum is not a finite number.")


def given(f_ext: Mapping[str, Any] | None) -> TypeGuard[Mapping[str, Any]]:
    """Whether there are wrenches; anything but None or an empty dict is."""
    return f_ext is not None and not (isinstance(f_ext, dict) and not f_ext)


def memory_of(out: Evaluation, kind: type[Evaluation], model: RobotModel, maker: str) -> Any:
    """Memory of a result that may be written; any other is an error."""
    if type(out) is kind and out._model is model:
        try:
            return out._memory
        except AttributeError:  # a result that stays
            pass
    elif type(out) is kind:
        other, names = out._model, model.dof_names
        why = f"{len(other.dof_names)} dof" if other.dof_names != names else "another model"
        raise InputError(f"out is of robot '{other.name}' ({why}), expected '{model.name}' ({len(names)} dof).")
    raise InputError(f"out is {_kind_of(out)}, expected what {maker} of this robot's dynamics has made.")


def _kind_of(out: object) -> str:
    kind = type(out).__name__
    return f"an earlier call's {kind}, which stays as it is" if isinstance(out, Evaluation) else f"of type {kind}"


def friction_of(model: RobotModel, qd: Array) -> Array:
    """Friction that resists rates, shape (…, nv)."""
    v0 = model.friction_velocity
    with np.errstate(over="ignore"):
        turned = np.tanh(qd / v0) if v0 else np.sign(qd)
    return model.damping * qd + model.friction * turned + model.effort_offset
