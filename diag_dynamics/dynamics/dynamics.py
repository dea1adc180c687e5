# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""DiagonalDynamics: the dynamics of one robot."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeAlias, TypeVar

import numpy as np

from diag_dynamics import results
from diag_dynamics.arrays import Array, Frame, ManyWrenches, MatrixLike, PointLike, RowsLike, StatesLike, VectorLike
from diag_dynamics.checks import check_finite, is_rows, numbers, rows, unit, vector, whole
from diag_dynamics.contact.impact import Impact, impact
from diag_dynamics.contact.points import ContactPoint, ContactPoints
from diag_dynamics.contact.results import Contact
from diag_dynamics.dynamics import calls
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.results import BatchEvaluation, BatchMemory, Evaluation, Factors
from diag_dynamics.sweeps import classical, derivatives, evaluation, kinematics, mobilities
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.sweeps.factors import factors as fill_factors
from diag_dynamics.threads import cores

_ARRAY, _FLOAT, _MISFIT, _empty = np.ndarray, np.dtype(np.float64), ws.BAD_LENGTH, np.empty
_memory_of, _new = results.memory_of, tuple.__new__  # half of the time that a namedtuple's own takes

_Result = TypeVar("_Result")
Points: TypeAlias = ContactPoints | Iterable[ContactPoint]
ORIGIN = 0.0, 0.0, 0.0

ROUNDING = 4e-15
"""Maximum of ℓJᵀu by rounding, as a fraction of the entries of ℓJᵀ, per degree of freedom."""


def _for_rows(method: Callable[..., _Result], names: str) -> Callable[..., _Result]:
    """Return a method for many states only: its first arguments are rows, and have these names."""
    capitals, parameters = names.split(), list(inspect.signature(method).parameters.values())
    has_threads = parameters[-1].name == "threads"
    for k, name in enumerate(capitals):
        parameters[1 + k] = parameters[1 + k].replace(name=name)

    def call(self: DiagonalDynamics, *arguments: Any, **options: Any) -> _Result:
        options = {name.lower() if name in capitals else name: x for name, x in options.items()}
        first = arguments[0] if arguments else options.get(capitals[0].lower())
        if not is_rows(first):
            model = self.model
            rows(capitals[0], first, model.dof_names if capitals[0] == "QD" else model.coordinate_names)  # its error
        if has_threads and options.get("threads") is None:
            options["threads"] = cores()  # the method does not take them for one state then
        return method(self, *arguments, **options)

    name = method.__name__
    call.__name__, call.__signature__ = f"{name}_batch", inspect.Signature(parameters)  # type: ignore[attr-defined]
    call.__doc__ = f"Return :meth:`{name}` of many states, with a leading axis T."
    return call


class DiagonalDynamics:
    """Diagonalized and classical dynamics of one robot, in O(N) sweeps over its links.

    Only matrices take as long as they have entries. Threads may share one object, but each is faster with its own.
    Results never alias its memory.

    Vectors of rates and efforts have shape (nv,) and the order of ``model.dof_names``: qd [rad/s, m/s], tau [N m, N],
    nu [J^½], epsilon [J^½/s]. Positions q [rad, m] have shape (nq,) and the order of ``model.coordinate_names``. Methods
    with an argument `threads` also take one row per state, shapes (T, nq) and (T, nv), and return results with a leading
    axis T. They use all processors, or `threads` of them, and name the first state that fails.

    Every method raises :class:`InputError` if an argument has another shape, is not finite or no orientation, naming
    joint, value and expectation. Methods that factorize raise :class:`SingularMassMatrixError` if M is singular at q.

    External wrenches are a dict of six numbers, force [N] then moment [N m], by link name; at many states also an array of
    shape (T, 6). Each acts at its link's origin, in the link's axes (``frame="link"``) or the world's (``frame="world"``).

    Parameters
    ----------
    model : RobotModel
        Result of :func:`load_urdf`.
    """

    def __init__(self, model: RobotModel) -> None:
        if not isinstance(model, RobotModel):
            raise InputError(f"DiagonalDynamics needs a RobotModel, as load_urdf returns, not {type(model).__name__}.")
        self.model = model
        self._caller = calls.SweepCaller(model)
        self._robot, self._zero = self._caller.robot, self._caller.zero
        self._nv, self._factors_shape = model.nv, (3, model.nv, model.nv)
        self._shape = ws.N_ROWS, max(model.nq, 1)  # rows of numbers have one entry even without joints
        self._whole = self._shape[1] == model.nv

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.model,)  # a copy has memory of its own

    def refuse(self, status: int, workspace: Any, q: Array, **inputs: Array) -> None:
        """Raise the error of a sweep's status in another workspace of this robot; `q` and `inputs` are its vectors."""
        calls.raise_failure(self.model, status, workspace.work, calls.States(q, inputs))

    def compile(self, *methods: str) -> None:
        """Compile methods by name, all if none is given, so that no later call waits for the compiler."""
        known = set(" ".join(calls.ENTRIES.values()).split())
        for name in methods:
            if name not in known:
                raise InputError(f"compile: {name!r} is none of {', '.join(sorted(known))}.")
        for entry, users in calls.ENTRIES.items():
            if not methods or not set(methods).isdisjoint(users.split()):
                entry.compile()

    # --- All quantities

    def evaluate(
        self,
        q: StatesLike,
        qd: StatesLike,
        tau: StatesLike | None = None,
        f_ext: ManyWrenches | None = None,
        *,
        frame: Frame = "link",
        friction: bool = False,
        out: Evaluation | None = None,
        threads: int | None = None,
    ) -> Evaluation:
        """Evaluate every quantity of the diagonalized equations of motion at one state, or at many.

        Parameters
        ----------
        q, qd : array_like, shape (nq,) and (nv,)
            Positions and rates.
        tau : array_like, shape (nv,), optional
            Joint efforts as applied, including those that balance gravity.
        f_ext, frame : optional
            External wrenches and their axes.
        friction : bool
            Whether to evaluate the friction of :meth:`friction_torque` as a separate term.
        out : Evaluation, optional
            Result of :meth:`new_evaluation` or :meth:`new_batch` to overwrite; nothing is allocated then. Its own arrays
            may be arguments. It keeps its numbers if an argument has a wrong type or shape, and is NaN after other errors.
        threads : int, optional
            Number of threads for many states.

        Returns
        -------
        Evaluation
            A new one, or `out`; of many states a :class:`BatchEvaluation` with the bits of single calls.
        """
        if out is None:
            state = _empty(self._shape)
        elif type(out) is BatchEvaluation and is_rows(q):
            return self._evaluate_rows(q, qd, tau, calls.Loads(f_ext, frame, friction), threads, out)
        else:
            state = _memory_of(out, Evaluation, self.model, "new_evaluation()")
        effort, status = self._zero if tau is None else tau, _MISFIT
        try:
            # numba may take another byte order for this one, and what a mask hides
            if (
                f_ext is None
                and not friction
                and frame == "link"
                and type(q) is type(qd) is type(effort) is _ARRAY
                and q.dtype is qd.dtype is effort.dtype is _FLOAT
            ):
                status = evaluation.evaluate.run(self._robot, q, qd, effort, state)
        except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
            pass
        if status:
            loads = calls.Loads(f_ext, frame, friction)
            if out is None and is_rows(q):
                return self._evaluate_rows(q, qd, tau, loads, threads, None)
            at = self._caller.one(q, qd=qd, tau=calls.ZEROS if tau is None else tau)
            return self._caller.evaluate(at, tau is not None, loads, state, out)
        if out is None:
            state.setflags(False)  # type: ignore[call-arg]  # by keyword it takes twice as long
            return Evaluation(self.model, state, state if self._whole else state[:, : self._nv], tau is not None)
        out.set_terms(tau is not None)
        return out

    def new_evaluation(self) -> Evaluation:
        """Return an Evaluation for loops that allocate nothing: ``evaluate(…, out=…)``; NaN until the first.

        Only `evaluate` writes it. Arrays that were read from it before then show the new results.
        """
        memory = np.empty(self._shape)
        state = results.read_only(memory.view())
        return results.reusable(Evaluation(self.model, state, tuple(state[:, : self._nv]), False), memory)

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
        """Evaluate many states, as :meth:`evaluate`."""
        return self._evaluate_rows(Q, QD, TAU, calls.Loads(f_ext, frame, friction), threads, out)

    def _evaluate_rows(
        self, Q: Any, QD: Any, TAU: Any, loads: calls.Loads, threads: int | None, out: BatchEvaluation | None
    ) -> BatchEvaluation:
        at = self._caller.many(Q, threads, qd=QD, tau=calls.ZEROS if TAU is None else TAU)
        if out is None:
            memory = BatchMemory.allocate(self.model, len(at.q))
        else:
            memory = results.memory_of(out, BatchEvaluation, self.model, "new_batch(T)")
            if len(out) != len(at.q):
                raise InputError(f"out has room for {len(out)} states, expected {len(at.q)}: a row for each of Q.")
            at = at.apart_from(memory)
        return self._caller.evaluate(at, TAU is not None, loads, memory, out)

    def new_batch(self, count: int) -> BatchEvaluation:
        """Return a BatchEvaluation of `count` states for ``evaluate(…, out=…)``; see :meth:`new_evaluation`."""
        if not (isinstance(count, (int, np.integer)) and count >= 0):
            raise InputError(f"count is {count!r}, expected a whole number >= 0.")
        memory = BatchMemory.allocate(self.model, int(count))
        return results.reusable(BatchEvaluation(self.model, memory, False), memory)

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
        """Yield evaluations of any number of states in batches of `size`, in bounded memory.

        Arrays that are mapped from files are read batch by batch.
        """
        whole("size", size)
        for name, value in (("QD", QD), ("TAU", TAU)):
            if value is not None and len(value) != len(Q):
                raise InputError(f"{name} has {len(value)} states, expected as many as Q, {len(Q)}.")
        for first in range(0, len(Q), size):
            part = slice(first, first + size)
            efforts = None if TAU is None else TAU[part]
            yield self.evaluate_batch(Q[part], QD[part], efforts, threads=threads, friction=friction)

    # --- Joint space

    def factors(self, q: VectorLike) -> Factors:
        """Return m, ℓ, the unit factor and D at q: see :class:`Factors`."""
        factors, D, status = np.empty(self._factors_shape), np.empty(self._nv), _MISFIT
        try:
            if type(q) is _ARRAY and q.dtype is _FLOAT:  # as in evaluate
                status = fill_factors.run(self._robot, q, factors, D)
        except (AttributeError, TypeError, ValueError):  # no vector of float64: no error yet
            pass
        if status:
            at = self._caller.one(q)
            self._caller.check(fill_factors(self._robot, at.q, factors, D), at)
        factors.setflags(False)  # type: ignore[call-arg]  # as in evaluate
        D.setflags(False)  # type: ignore[call-arg]  # as in evaluate
        return _new(Factors, (factors[0], factors[1], factors[2], D))

    def forward_dynamics(
        self,
        q: StatesLike,
        qd: StatesLike,
        tau: StatesLike,
        f_ext: ManyWrenches | None = None,
        *,
        frame: Frame = "link",
        friction: bool = False,
        threads: int | None = None,
    ) -> Array:
        """Return q̈ [rad/s², m/s²], shape (nv,), of M q̈ + c + g + τ_fric = τ + Jᵀf_ext (Algorithm 8.1 in closed form).

        τ_fric, see :meth:`friction_torque`, is zero unless `friction` is true. For a joint of several degrees of freedom q̈
        is the rate of its twist's components.
        """
        if f_ext is None and not friction and frame == "link" and threads is None:
            try:
                if (
                    type(q) is type(qd) is type(tau) is _ARRAY  # as in evaluate
                    and q.dtype is qd.dtype is tau.dtype is _FLOAT
                    and not classical.forward_dynamics.run(self._robot, q, qd, tau, qdd := _empty(self._nv))
                ):
                    return qdd
            except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
                pass
        at = self._caller.states(q, threads, qd=qd, tau=tau)
        return self._caller.forward_dynamics(at, calls.Loads(f_ext, frame, friction))

    def inverse_dynamics(
        self,
        q: StatesLike,
        qd: StatesLike,
        qdd: StatesLike,
        f_ext: ManyWrenches | None = None,
        *,
        frame: Frame = "link",
        friction: bool = False,
        threads: int | None = None,
    ) -> Array:
        """Return τ = M q̈ + c + g + τ_fric − Jᵀf_ext [N m, N], shape (nv,) (Newton–Euler, eq. 4.3).

        τ_fric is zero unless `friction` is true.
        """
        at = self._caller.states(q, threads, qd=qd, qdd=qdd)
        return self._caller.inverse_dynamics(at, calls.Loads(f_ext, frame, friction))

    def friction_torque(self, qd: StatesLike) -> Array:
        """Return τ_fric = d q̇ + f tanh(q̇/v₀) + o [N m, N], shape (nv,) or (T, nv).

        The model has damping d, Coulomb friction f, offset o and v₀, its `friction_velocity`. At 5 v₀ the tanh is 1 − 1e-4,
        and at rest τ_fric does not jump with the sign of a noisy velocity. Other quantities have no friction unless
        requested.
        """
        names = self.model.dof_names
        return self._caller.friction(rows("QD", qd, names) if is_rows(qd) else vector("qd", qd, names, finite=False))

    def mass_matrix(self, q: StatesLike, *, threads: int | None = None) -> Array:
        """Return M(q) [kg m², kg, mixed kg m], shape (nv, nv), including armature."""
        return self._caller.mass_matrix(self._caller.states(q, threads))

    def bias(self, q: StatesLike, qd: StatesLike, *, threads: int | None = None) -> Array:
        """Return c(q, q̇) of M q̈ + c + g = τ [N m, N], shape (nv,), without gravity. It is not C(q, ν)."""
        return self._caller.run(calls.WITHOUT_GRAVITY, self._caller.states(q, threads, qd=qd, qdd=calls.ZEROS))

    def gravity_torque(self, q: StatesLike, *, threads: int | None = None) -> Array:
        """Return g(q) [N m, N], shape (nv,): the effort that balances gravity at rest."""
        at = self._caller.states(q, threads, qd=calls.ZEROS, qdd=calls.ZEROS)
        return self._caller.run(calls.INVERSE_DYNAMICS, at)

    # --- The four sweeps

    def nu_from_qd(self, q: StatesLike, qd: StatesLike, *, threads: int | None = None) -> Array:
        """Return ν = mᵀq̇ [J^½], shape (nv,), in O(N) (Table 1)."""
        return self._transform(calls.NU_FROM_QD, q, "qd", qd, threads)

    def qd_from_nu(self, q: StatesLike, nu: StatesLike, *, threads: int | None = None) -> Array:
        """Return q̇ = ℓᵀν [rad/s, m/s], shape (nv,), in O(N) (Table 1, right)."""
        return self._transform(calls.QD_FROM_NU, q, "nu", nu, threads)

    def epsilon_from_tau(self, q: StatesLike, tau: StatesLike, *, threads: int | None = None) -> Array:
        """Return ε = ℓτ [J^½/s], shape (nv,), in O(N) (Table 2)."""
        return self._transform(calls.EPSILON_FROM_TAU, q, "tau", tau, threads)

    def tau_from_epsilon(self, q: StatesLike, epsilon: StatesLike, *, threads: int | None = None) -> Array:
        """Return τ = mε [N m, N], shape (nv,), in O(N) (Table 2, right)."""
        return self._transform(calls.TAU_FROM_EPSILON, q, "epsilon", epsilon, threads)

    def _transform(self, sweep: calls.Sweep, q: Any, name: str, x: Any, threads: int | None) -> Array:
        try:
            if (
                threads is None
                and type(q) is type(x) is _ARRAY  # as in evaluate
                and q.dtype is x.dtype is _FLOAT
                and not sweep.single(self._robot, q, x, result := _empty(self._nv))
            ):
                return result
        except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
            pass
        return self._caller.run(sweep, self._caller.states(q, threads, **{name: x}))

    # --- Along a motion

    def m_rate_transposed(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """Return ṁᵀx [J^½/s], shape (nv,), of constant rates x [rad/s, m/s], m changing along q̇; in O(N).

        It is mᵀ's own rate, from d(mᵀx)/dt: ṁᵀq̇ = ν̇ − mᵀq̈.
        """
        return self._caller.derivative(derivatives.m_rate_transposed, self._caller.one(q, qd=qd, x=x))

    def coriolis_bracket(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """Return B(q, ν)x [J^½/s], shape (nv,), of x [J^½], in O(N).

        B = ℓ(C_s − mṁᵀ)ℓᵀ is skew and B ν = C(q, ν) (Identity 7.1, Lemma 7.1), with C_s of :meth:`coriolis_product`.
        """
        return self._caller.derivative(derivatives.coriolis_bracket, self._caller.one(q, qd=qd, x=x), scratch=2)

    def coriolis_product(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """Return C_s(q, q̇)x [N m, N], shape (nv,), of rates x [rad/s, m/s], in O(N): C_s q̇ = c, and Ṁ − 2C_s is skew.

        It is the Newton–Euler pass of two velocities that passivity-based tracking needs.
        """
        return self._caller.derivative(derivatives.coriolis_product, self._caller.one(q, qd=qd, x=x))

    def mass_matrix_rate(self, q: VectorLike, qd: VectorLike) -> Array:
        """Return Ṁ = Σ q̇_i ∂M/∂q_i [kg m²/s, …], shape (nv, nv) (Identity 6.3).

        A unit vector qd gives a partial derivative. For a joint of several degrees of freedom it is the rate along the
        motion with that twist.
        """
        at = self._caller.one(q, qd=qd)
        check_finite("qd", at.vectors["qd"], self.model.dof_names)
        M, M_rate = np.zeros((2, self._nv, self._nv))
        status = derivatives.mass_matrix_rate(self._robot, at.q, at.vectors["qd"], M, M_rate)
        self._caller.check(status, at)
        return M_rate

    def mass_matrix_rate_times(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """Return Ṁx [N m, N], shape (nv,), of rates x [rad/s, m/s], in O(N) without forming Ṁ (Identity 6.3)."""
        return self._caller.derivative(derivatives.mass_matrix_rate_times, self._caller.one(q, qd=qd, x=x))

    def log_det(self, q: VectorLike) -> float:
        """Return ln det M = Σ ln D_k of the numerical values in SI units."""
        return float(np.log(self._caller.articulated_inertias(self._caller.one(q, qd=calls.ZEROS))[0]).sum())

    def log_det_rate(self, q: VectorLike, qd: VectorLike) -> float:
        """Return d/dt ln det M = Σ Ḋ_k/D_k [1/s] along q̇."""
        D, D_rate = self._caller.articulated_inertias(self._caller.one(q, qd=qd))
        return float((D_rate / D).sum())

    # --- Links

    def placement(self, q: VectorLike, link: str) -> Array:
        """Return the placement of a link's frame in the world, shape (4, 4): axes, and the origin [m] in column 3."""
        body, in_body = self.model.placement_in_body(link)
        at, result = self._caller.one(q), np.eye(4)
        self._caller.check(kinematics.placement(self._robot, at.q, body, result[:3]), at)
        return result @ in_body

    def jacobian(self, q: VectorLike, link: str, point: PointLike = ORIGIN, *, frame: Frame = "link") -> Array:
        """Return J of a point of a link, shape (6, nv): linear rows [m, 1] first, then angular ones [1, 1/m]; O(N).

        Parameters
        ----------
        q : array_like, shape (nq,)
            Positions.
        link : str
            Name of the link.
        point : array_like, shape (3,)
            From the link's origin in the link's axes [m].
        frame : {"link", "world"}
            Axes of the rows: Pinocchio's LOCAL, or its LOCAL_WORLD_ALIGNED.
        """
        at, J = self._caller.one(q), np.empty((6, self._nv))
        body, in_body, rotation = self._caller.point_frame(at.q, link, point, frame)
        self._caller.check(kinematics.jacobian(self._robot, at.q, body, in_body, J), at)
        return calls.rotate(rotation, J)

    def link_velocity(
        self, q: VectorLike, qd: VectorLike, link: str, point: PointLike = ORIGIN, *, frame: Frame = "link"
    ) -> Array:
        """Return J q̇ of a point of a link, shape (6,): velocity [m/s], angular velocity [rad/s]; see :meth:`jacobian`."""
        twist, _, rotation = self._caller.motion(self._caller.one(q, qd=qd, qdd=calls.ZEROS), link, point, frame)
        return calls.rotate(rotation, twist)

    def link_acceleration(
        self,
        q: VectorLike,
        qd: VectorLike,
        qdd: VectorLike,
        link: str,
        point: PointLike = ORIGIN,
        *,
        frame: Frame = "link",
        spatial: bool = False,
    ) -> Array:
        """Return the acceleration of a point of a link [m/s²] and of its rotation [rad/s²], shape (6,), in O(N).

        It is the second derivative of the point's place in the axes of `frame`, without gravity: Pinocchio's
        getFrameClassicalAcceleration. If `spatial`, it is the spatial acceleration, getFrameAcceleration: less ω × v. Other
        arguments are those of :meth:`jacobian`.
        """
        twist, rate, rotation = self._caller.motion(self._caller.one(q, qd=qd, qdd=qdd), link, point, frame)
        if not spatial:
            rate[:3] += np.cross(twist[3:], twist[:3])
        return calls.rotate(rotation, rate)

    def wrench_factor(self, q: VectorLike, link: str, point: PointLike = ORIGIN, frame: Frame = "link") -> Array:
        """Return ℓJᵀ, shape (nv, 6): ε of unit wrenches at a point of a link, one column each; O(N).

        Columns are force (x, y, z) [J^½/(s N)], then moment [J^½/(s N m)], in the axes of `frame`; `point` [m] is that of
        :meth:`jacobian`.
        """
        return self._caller.wrench_factor(self._caller.one(q), link, np.eye(6), point, frame)

    def epsilon_from_wrench(
        self, q: VectorLike, link: str, wrench: VectorLike, point: PointLike = ORIGIN, frame: Frame = "link"
    ) -> Array:
        """Return ℓJᵀw [J^½/s], shape (nv,), of one wrench, force [N] then moment [N m]; see :meth:`wrench_factor`."""
        w = numbers("wrench", wrench, (6,), "six finite numbers, force [N] then moment [N m]")
        return self._caller.wrench_factor(self._caller.one(q), link, w[None], point, frame)[:, 0]

    def operational_inverse_inertia(
        self, q: VectorLike, link: str, point: PointLike = ORIGIN, frame: Frame = "link"
    ) -> Array:
        """Return J M⁻¹ Jᵀ = (ℓJᵀ)ᵀ(ℓJᵀ), shape (6, 6), of a point of a link without forming M.

        Blocks [1/kg], [1/(kg m)] and [1/(kg m²)]; arguments are those of :meth:`wrench_factor`.
        """
        return calls.squared(self.wrench_factor(q, link, point, frame), point)

    def reflected_mass(
        self, q: VectorLike, link: str, direction: VectorLike, point: PointLike = ORIGIN, frame: Frame = "link"
    ) -> float:
        """Return 1/|ℓJᵀu|² [kg]: the mass that a push along u at a point of a link meets; inf if it cannot move so.

        The direction, shape (3,), is any vector along u in the axes of `frame`; see :meth:`wrench_factor`.
        """
        u, factor = unit("direction", direction), self.wrench_factor(q, link, point, frame)
        w = factor[:, :3] @ u
        if np.abs(w).max(initial=0.0) <= ROUNDING * max(len(w), 3) * np.abs(factor).max(initial=0.0):
            return math.inf
        return 1.0 / float(calls.squared(w, point))

    def mobilities(self, q: VectorLike) -> Array:
        """Return Υ = J M⁻¹Jᵀ of every link at its origin, in its axes, shape (links, 6, 6), in one O(N) sweep.

        Links are in the order of ``model.link_names``, linear parts first; blocks [1/kg], [1/(kg m)], [1/(kg m²)]. A wrench
        h accelerates the link by Υ h and meets the mass 1/hᵀΥh. Links that no joint moves have zeros. For other points see
        :meth:`operational_inverse_inertia`.
        """
        at, frames = self._caller.one(q), self._caller.link_frames
        result = np.empty((len(frames), 6, 6))
        self._caller.check(mobilities.mobilities(self._robot, at.q, frames, result), at)
        return result

    # --- Contact. It is advisory: no result is safety-rated.

    def contact(self, q: StatesLike, qd: StatesLike, points: Points, *, threads: int | None = None) -> Contact:
        """Return speed, reflected mass, energy ½(ŵᵀν)², force and allowed speed of contact at points; O(N).

        An iterable of :class:`ContactPoint` is converted on every call. Rotors count with their armature, as with rigid
        joints. It is conservative: they enlarge the reflected mass, and the drive train between them and the link is stiffer
        than a human body.
        """
        return self._caller.contact(self._caller.states(q, threads, qd=qd), points)

    def impact(
        self,
        q: VectorLike,
        qd: VectorLike,
        link: str,
        direction: VectorLike,
        point: PointLike = ORIGIN,
        frame: Frame = "link",
        *,
        mass: float = math.inf,
        restitution: float = 0.0,
    ) -> Impact:
        """Return ν⁺ = ν − (1+e) μ v_u ℓJᵀu of an impact with a mass at rest, along u at a point of a link; O(N).

        Parameters
        ----------
        q, qd, link
            State before the impact, and name of the link.
        direction : array_like, shape (3,)
            Any vector along u, from the link to the mass, in the axes of `frame`.
        point, frame
            Point [m], and axes of the direction, as of :meth:`jacobian`.
        mass : float
            m_H [kg] of the free mass; inf if it is clamped.
        restitution : float
            e: 0 if both go on together, 1 if no energy is lost.
        """
        u = unit("direction", direction)
        w = self.epsilon_from_wrench(q, link, np.concatenate([u, np.zeros(3)]), point, frame)
        after = impact(self.nu_from_qd(q, qd), w, mass, restitution)
        return after._replace(qd_after=self.qd_from_nu(q, after.nu_after))

    # --- Names of methods for many states only

    forward_dynamics_batch = _for_rows(forward_dynamics, "Q QD TAU")
    inverse_dynamics_batch = _for_rows(inverse_dynamics, "Q QD QDD")
    mass_matrix_batch = _for_rows(mass_matrix, "Q")
    friction_torque_batch = _for_rows(friction_torque, "QD")
    bias_batch = _for_rows(bias, "Q QD")
    gravity_torque_batch = _for_rows(gravity_torque, "Q")
    nu_from_qd_batch = _for_rows(nu_from_qd, "Q QD")
    qd_from_nu_batch = _for_rows(qd_from_nu, "Q NU")
    epsilon_from_tau_batch = _for_rows(epsilon_from_tau, "Q TAU")
    tau_from_epsilon_batch = _for_rows(tau_from_epsilon, "Q EPSILON")
    contact_batch = _for_rows(contact, "Q QD")
