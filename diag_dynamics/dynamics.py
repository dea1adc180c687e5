"""DiagonalDynamics: the dynamics of one robot, as users call it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, NoReturn

import numpy as np

from diag_dynamics import batch, sweeps
from diag_dynamics.arrays import Array, Frame, MatrixLike, VectorLike, Wrenches
from diag_dynamics.checks import numbers
from diag_dynamics.compiled.progress import steps
from diag_dynamics.exceptions import InputError, SingularMassMatrixError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.wrenches import wrenches_at, wrenches_on_links
from diag_dynamics.results import BatchEvaluation, BatchMemory, Evaluation, Factors, reused_evaluation

ROUNDING = 4e-15
"""What ℓJᵀu may be of the entries of ℓJᵀ, for each degree of freedom, and still be nothing but rounding."""


class DiagonalDynamics:
    """Diagonalized and classical dynamics of one robot, in O(N) sweeps over its links.

    Only what is a matrix takes as long as its entries. It owns a workspace: use one per thread. Results never alias it.

    Vectors of rates and efforts have shape (nv,) and are in the order of ``model.dof_names``: qd [rad/s, m/s], tau [N m,
    N], nu [J^½], epsilon [J^½/s]. Positions q [rad, m] have shape (nq,), in the order of ``model.coordinate_names``.
    Every method raises :class:`InputError` if a vector has another shape, is not finite or no orientation, naming the
    joint, and those that factorize raise :class:`SingularMassMatrixError` if M is singular at q.

    External wrenches are a dict of six numbers, force [N] then moment [N m], by link name; each acts at its link's origin,
    in the link's axes (``frame="link"``) or in those of the world (``frame="world"``).

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
        self._q = np.zeros(model.nq)
        self._a, self._b, self._zero = np.zeros((3, model.nv))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.model,)  # a copy has a workspace of its own

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
        state = _empty(self._shape) if out is None else _memory_of(out, Evaluation, self.model, "new_evaluation()")
        effort, status = self._zero if tau is None else tau, _MISFIT
        try:
            # numba may take another byte order for this one
            if q.dtype is qd.dtype is effort.dtype is _FLOAT:  # type: ignore[union-attr]
                status = sweeps.evaluate(self._robot, q, qd, effort, state)
        except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
            pass
        if status or friction or f_ext is not None or frame != "link":
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
        return reused_evaluation(self.model, self._shape)

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
            _check_frame(frame)
            q, rate = self._positions(q), self._vector("qd", qd, self._a)
            effort = self._zero if tau is None else self._vector("tau", tau, self._b)
            self._checked(sweeps.evaluate(self._robot, q, rate, effort, state), qd=rate, tau=effort)
            nu, rate = state[sweeps.NU, : self._nv], state[sweeps.RATES, : self._nv]
            if _given(f_ext):
                external = self.epsilon_from_tau(q, self._effort_of(f_ext, frame))
                external.setflags(write=False)
            if friction:
                resisting = self.epsilon_from_tau(q, self.friction_torque(rate))
                resisting.setflags(write=False)
            _check_power(nu, external, resisting)
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
            if q.dtype is _FLOAT:  # type: ignore[union-attr]  # as in evaluate
                status = sweeps.factors(self._robot, q, factors, D)
        except (AttributeError, TypeError, ValueError):  # no vector of float64: no error yet
            pass
        if status:
            self._checked(sweeps.factors(self._robot, self._positions(q), factors, D))
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
                plain = q.dtype is qd.dtype is tau.dtype is _FLOAT  # type: ignore[union-attr]  # as in evaluate
                if plain and not sweeps.forward_dynamics(self._robot, q, qd, tau, qdd):
                    return qdd
            except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
                pass
        _check_frame(frame)
        q, qd, tau = self._positions(q), self._vector("qd", qd, self._a), self._vector("tau", tau, self._b)
        if friction:
            tau -= self.friction_torque(qd)
        if _given(f_ext):
            tau += self._effort_of(f_ext, frame)
        _check_sum(tau, friction, f_ext)
        self._checked(sweeps.forward_dynamics(self._robot, q, qd, tau, qdd), qd=qd, tau=tau)
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
        _check_frame(frame)
        tau = self._newton_euler(1.0, q, qd, qdd)
        if friction:
            tau += self.friction_torque(qd)
        if _given(f_ext):
            tau -= self._effort_of(f_ext, frame)
        _check_sum(tau, friction, f_ext)
        return tau

    def friction_torque(self, qd: VectorLike) -> Array:
        """τ_fric = d q̇ + f tanh(q̇/v₀) [N m, N], shape (nv,): URDF damping d and Coulomb friction f, resisting the motion.

        v₀ is the model's `friction_velocity`. At 5 v₀ it is f sign(q̇) but for 1e-4 of f, and at rest it does not jump with
        the sign of a velocity that is nothing but noise. No other quantity holds it unless it is asked to.
        """
        return _friction_torque(self.model, self._finite("qd", qd, np.empty(self.model.nv)))

    def mass_matrix(self, q: VectorLike) -> Array:
        """M(q) [kg m², kg, mixed kg m], shape (nv, nv), armature included."""
        q = self._positions(q)
        M = np.empty((self.model.nv, self.model.nv))
        self._checked(sweeps.mass_matrix(self._robot, q, M))
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

    # --- Along a motion, and at a frame ---

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
        q, rate = self._positions(q), self._finite("qd", qd, self._a)
        M, M_rate = np.zeros((2, self.model.nv, self.model.nv))
        self._checked(sweeps.mass_matrix_rate(self._robot, q, rate, M, M_rate), qd=rate)
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

    def placement(self, q: VectorLike, link: str) -> Array:
        """Placement of a link's frame in the world, shape (4, 4): its axes, and in the last column its origin [m].

        Raises
        ------
        InputError
            No such link.
        """
        body, in_body = self.model.placement_in_body(link)
        result = np.zeros((4, 4))
        result[3, 3] = 1.0
        self._checked(sweeps.placement(self._robot, self._positions(q), body, result[:3]))
        return result @ in_body

    def wrench_factor(
        self, q: VectorLike, link: str, point: VectorLike = (0.0, 0.0, 0.0), frame: Frame = "link"
    ) -> Array:
        """ℓJᵀ, shape (nv, 6): what unit wrenches at a point of a link add to ε, a column each; O(N).

        Parameters
        ----------
        q : array_like, shape (nq,)
            Positions.
        link : str
            Name of the link.
        point : array_like, shape (3,)
            Where the wrench acts, from the link's origin in the link's axes [m].
        frame : {"link", "world"}
            Axes of the wrench, force (x, y, z) [J^½/(s N)] first, then moment [J^½/(s N m)].

        Raises
        ------
        InputError
            No such link, or numbers that are not finite or of the wrong shape.
        """
        return self._factor_of_wrenches(q, link, np.eye(6), point, frame)

    def epsilon_from_wrench(
        self,
        q: VectorLike,
        link: str,
        wrench: VectorLike,
        point: VectorLike = (0.0, 0.0, 0.0),
        frame: Frame = "link",
    ) -> Array:
        """ℓJᵀw [J^½/s], shape (nv,), of one wrench, force [N] then moment [N m]; else as :meth:`wrench_factor`."""
        w = numbers("wrench", wrench, (6,), "six finite numbers, force [N] then moment [N m]")
        return self._factor_of_wrenches(q, link, w[None], point, frame)[:, 0]

    def operational_inverse_inertia(
        self, q: VectorLike, link: str, point: VectorLike = (0.0, 0.0, 0.0), frame: Frame = "link"
    ) -> Array:
        """J M⁻¹ Jᵀ = (ℓJᵀ)ᵀ(ℓJᵀ), shape (6, 6): how a wrench at a point of a link accelerates it; M is not formed.

        Blocks [1/kg], [1/(kg m)] and [1/(kg m²)]; arguments as of :meth:`wrench_factor`.
        """
        factor = self.wrench_factor(q, link, point, frame)
        return _squared(factor, point)

    def reflected_mass(
        self,
        q: VectorLike,
        link: str,
        direction: VectorLike,
        point: VectorLike = (0.0, 0.0, 0.0),
        frame: Frame = "link",
    ) -> float:
        """1/|ℓJᵀu|² [kg]: the mass that a push along u at a point of a link meets.

        It is inf where the point cannot move that way, or moves no more than rounding would have it.

        Parameters
        ----------
        direction : array_like, shape (3,)
            Any vector along u, in the axes that `frame` says.
        q, link, point, frame
            As of :meth:`wrench_factor`.

        Raises
        ------
        InputError
            As there, or the direction is zero.
        """
        u = numbers("direction", direction, (3,), "three finite numbers, not all zero")
        largest = np.abs(u).max()
        if not largest > 0.0:
            raise InputError(f"direction is {u.tolist()}, expected three finite numbers, not all zero.")
        u = u / largest
        u /= np.linalg.norm(u)
        factor = self.wrench_factor(q, link, point, frame)
        w = factor[:, :3] @ u
        if np.abs(w).max(initial=0.0) <= ROUNDING * max(self.model.nv, 3) * np.abs(factor).max(initial=0.0):
            return math.inf
        return 1.0 / float(_squared(w, point))

    # --- Many states ---

    def evaluate_batch(
        self,
        Q: MatrixLike,
        QD: MatrixLike,
        TAU: MatrixLike | None = None,
        *,
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
        threads : int, optional
            How many to use, by default as many as there are processors for this process.
        friction : bool
            Whether to evaluate friction, too, as :meth:`evaluate` does; it takes as long again.
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
        if threads is not None and not (isinstance(threads, (int, np.integer)) and threads >= 1):
            raise InputError(f"threads is {threads!r}, expected a whole number >= 1.")
        model = self.model
        states = batch.states("Q", Q, model.coordinate_names)
        count = len(states)
        rates = batch.states("QD", QD, model.dof_names, count)
        efforts = self._zero[None] if TAU is None else batch.states("TAU", TAU, model.dof_names, count)
        if out is None:
            memory = BatchMemory.of(model, count)
        else:
            memory = _memory_of(out, BatchEvaluation, model, "new_batch(T)")
            if len(out) != count:
                raise InputError(f"out has room for {len(out)} states, expected {count}: a row for each state of Q.")
            states, rates, efforts = memory.apart(states), memory.apart(rates), memory.apart(efforts)
        try:
            self._fill_batch(states, rates, efforts, TAU is not None, memory, threads)
            resisting = None
            if friction:
                resisting = self.evaluate_batch(states, rates, _friction_torque(model, rates), threads=threads).epsilon
        except BaseException:  # a Ctrl-C, too
            if out is not None:
                for part in memory:
                    part.fill(np.nan)
                out._friction = None  # that of an earlier batch
            raise
        if out is None:
            return BatchEvaluation(model, memory, TAU is not None, resisting)
        out._with_tau, out._friction = TAU is not None, resisting
        return out

    def _fill_batch(
        self, Q: Array, QD: Array, efforts: Array, with_tau: bool, memory: BatchMemory, threads: int | None
    ) -> None:
        """Evaluate all states into memory, or raise the error of the first that fails."""
        failing = batch.evaluate(self._workspaces, Q, QD, efforts, memory, threads or batch.cores())
        for t in failing:
            try:
                self.evaluate(Q[t], QD[t], efforts[t] if with_tau else None)
            except SingularMassMatrixError as error:
                raise SingularMassMatrixError(f"state {t}: {error}", error.joint, error.articulated_inertia) from None
            except InputError as error:
                raise InputError(f"state {t}: {error}") from None
        if failing:
            raise InputError(f"Q, QD or TAU have changed while states {failing[0]} to {failing[-1]} were evaluated.")

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
        memory = BatchMemory.of(self.model, int(count))
        for part in memory:
            part.fill(np.nan)
        return BatchEvaluation(self.model, memory, False, keep=True)

    def evaluate_stream(
        self,
        Q: MatrixLike,
        QD: MatrixLike,
        TAU: MatrixLike | None = None,
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

    def compile(self, *methods: str) -> None:
        """Compile methods, or load them from the cache: afterwards no call of them waits for the compiler.

        Parameters
        ----------
        *methods : str
            Names of methods of this class; all, if none is given.

        Raises
        ------
        InputError
            A name is not that of a method that is compiled.
        """
        probe = DiagonalDynamics(self.model)
        zero, q, root = self._zero, self.model.neutral, self.model.root_link
        wrench = {root: np.zeros(6)}

        def evaluate() -> tuple[float, Array]:
            s = probe.evaluate(q, zero, zero, wrench)
            return s.kinetic_energy, s.link_energy

        calls = {
            "evaluate": evaluate,
            "evaluate_batch": lambda: probe.evaluate_batch(q[None], zero[None], zero[None]).link_energy,
            "factors": lambda: probe.factors(q),
            "forward_dynamics": lambda: probe.forward_dynamics(q, zero, zero, wrench),
            "inverse_dynamics": lambda: probe.inverse_dynamics(q, zero, zero, wrench),
            "mass_matrix": lambda: probe.mass_matrix(q),
            "bias": lambda: probe.bias(q, zero),
            "gravity_torque": lambda: probe.gravity_torque(q),
            "nu_from_qd": lambda: probe.nu_from_qd(q, zero),
            "qd_from_nu": lambda: probe.qd_from_nu(q, zero),
            "epsilon_from_tau": lambda: probe.epsilon_from_tau(q, zero),
            "tau_from_epsilon": lambda: probe.tau_from_epsilon(q, zero),
            "m_rate_transposed": lambda: probe.m_rate_transposed(q, zero, zero),
            "coriolis_bracket": lambda: probe.coriolis_bracket(q, zero, zero),
            "coriolis_product": lambda: probe.coriolis_product(q, zero, zero),
            "mass_matrix_rate": lambda: probe.mass_matrix_rate(q, zero),
            "mass_matrix_rate_times": lambda: probe.mass_matrix_rate_times(q, zero, zero),
            "log_det": lambda: probe.log_det(q),
            "log_det_rate": lambda: probe.log_det_rate(q, zero),
            "placement": lambda: probe.placement(q, root),
            "wrench_factor": lambda: probe.wrench_factor(q, root),
            "epsilon_from_wrench": lambda: probe.epsilon_from_wrench(q, root, np.zeros(6)),
            "operational_inverse_inertia": lambda: probe.operational_inverse_inertia(q, root),
            "reflected_mass": lambda: probe.reflected_mass(q, root, (1.0, 0.0, 0.0)),
        }
        for name in methods:
            if name not in calls:
                raise InputError(f"compile: {name!r} is none of {', '.join(calls)}.")
        for name in steps(methods or tuple(calls)):
            with suppress(SingularMassMatrixError):  # at this one configuration; it is compiled all the same
                calls[name]()

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
        self._workspace.work["D"][:] = workspace.work["D"]
        self._positions(q)
        self._fail(status, **inputs)

    # --- Between Python and the sweeps ---

    def _vector(self, name: str, value: VectorLike, buffer: Array) -> Array:
        """The argument as a contiguous float64 vector of nv entries, in a buffer of this object."""
        return _fill(buffer, name, value, self.model.dof_names)

    def _positions(self, q: VectorLike) -> Array:
        """Positions as a contiguous float64 vector of nq entries, in a buffer of this object."""
        return self._q if q is self._q else _fill(self._q, "q", q, self.model.coordinate_names)

    def _finite(self, name: str, value: VectorLike, buffer: Array) -> Array:
        """As :meth:`_vector`, and all entries finite."""
        x = self._vector(name, value, buffer)
        if not np.isfinite(x).all():
            self._fail(-1, **{name: x})
        return x

    def _derivative(
        self, sweep: Callable[..., int], q: VectorLike, qd: VectorLike, x: VectorLike, scratch: int = 0
    ) -> Array:
        """A sweep along q̇ that takes x to a new vector."""
        q, qd, x = self._positions(q), self._vector("qd", qd, self._a), self._vector("x", x, self._b)
        more, result = np.empty((scratch, self.model.nv)), np.empty(self.model.nv)
        status = sweep(self._robot, q, qd, x, *more, result)
        self._checked(status, qd=qd, x=x)
        return result

    def _articulated_inertias(self, q: VectorLike, qd: VectorLike) -> tuple[Array, Array]:
        """D and Ḋ."""
        q, qd = self._positions(q), self._vector("qd", qd, self._a)
        D, D_rate = np.empty((2, self.model.nv))
        status = sweeps.articulated_inertias(self._robot, q, qd, D, D_rate)
        self._checked(status, qd=qd)
        return D, D_rate

    def _factor_of_wrenches(self, q: VectorLike, link: str, wrenches: Array, point: VectorLike, frame: Frame) -> Array:
        """ℓJᵀw of wrenches, shape (number, 6), at a point of a link, a column each."""
        records = wrenches_at(self.model, link, wrenches, point, frame)
        q, epsilon = self._positions(q), np.empty((self.model.nv, len(records)))
        self._checked(sweeps.factor_of_wrenches(self._robot, q, records, frame == "world", epsilon))
        if not np.isfinite(epsilon).all():
            raise InputError(f"point {list(point)} or the wrench are too large: a result overflows.")
        return epsilon

    def _newton_euler(self, weight: float, q: VectorLike, qd: VectorLike, qdd: VectorLike) -> Array:
        q, qd, qdd = self._positions(q), self._vector("qd", qd, self._a), self._vector("qdd", qdd, self._b)
        tau = np.empty(self.model.nv)
        status = sweeps.inverse_dynamics(self._robot, q, qd, qdd, weight, tau)
        self._checked(status, qd=qd, qdd=qdd)
        return tau

    def _sweep(self, sweep: Callable[..., int], q: VectorLike, name: str, value: VectorLike) -> Array:
        result, status = np.empty(self._nv), sweeps.MISFIT
        try:
            if q.dtype is value.dtype is _FLOAT:  # type: ignore[union-attr]  # as in evaluate
                status = sweep(self._robot, q, value, result)
        except (AttributeError, TypeError, ValueError):  # not vectors of float64: no error yet
            pass
        if status:
            q, x = self._positions(q), self._vector(name, value, self._a)
            self._checked(sweep(self._robot, q, x, result), **{name: x})
        return result

    def _effort_of(self, f_ext: Wrenches | None, frame: Frame) -> Array:
        """Jᵀf_ext at the positions in the buffer of this object."""
        model, tau = self.model, np.empty(self.model.nv)
        wrenches = wrenches_on_links(model, f_ext, frame)
        status = sweeps.effort_of_wrenches(self._robot, self._q, wrenches, frame == "world", tau)
        self._checked(status)
        return tau

    def _checked(self, status: int, **inputs: Array) -> None:
        if status:
            self._fail(status, **inputs)

    def _fail(self, status: int, **inputs: Array) -> NoReturn:
        """Raise what a sweep's status stands for, naming joint and value."""
        names = self.model.dof_names
        if status > 0 and np.isfinite(self._workspace.work["D"][status]):
            joint, D = names[self.model.bodies["dof"][status]], float(self._workspace.work["D"][status])
            raise SingularMassMatrixError(
                f"The mass matrix of robot '{self.model.name}' is singular at this configuration: joint '{joint}' "
                f"moves no inertia there (D = {D:.3g}, less than {sweeps.SINGULAR:g} of the inertias that it comes from).",
                joint,
                D,
            )
        coordinates = self.model.coordinate_names
        for argument, values in ({"q": self._q} | inputs).items():
            for name, value in zip(coordinates if argument == "q" else names, values, strict=True):
                if not np.isfinite(value):
                    raise InputError(f"{argument} of joint '{name}' is {value}, expected a finite number.")
        for k, orientation in enumerate(self.model.orientations):
            quaternion = self._q[k - 3 : k + 1]
            if orientation == 3 and abs(quaternion @ quaternion - 1.0) >= sweeps.UNIT_TOLERANCE:
                raise InputError(
                    f"q of joint '{coordinates[k].rpartition('/')[0]}' has the quaternion {quaternion.tolist()} "
                    "(x, y, z, w), expected one of length 1."
                )
        raise InputError(f"{', '.join(['q', *inputs])} are too large: a result overflows.")


_FLOAT, _MISFIT, _empty = np.dtype(np.float64), sweeps.MISFIT, np.empty
_new = tuple.__new__  # half of the time that a namedtuple's own takes


def _memory_of(out: Evaluation, kind: type[Evaluation], model: RobotModel, maker: str) -> Any:
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


def _squared(factor: Array, point: VectorLike) -> Any:
    """FᵀF of what belongs to a point of a link, refused if it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = factor.T @ factor
    if not np.isfinite(square).all():
        raise InputError(f"point {list(point)} is too far away: a result overflows.")
    return square


def _check_frame(frame: str) -> None:
    if frame not in ("link", "world"):
        raise InputError(f"frame is {frame!r}, expected 'link' or 'world'.")


def _friction_torque(model: RobotModel, qd: Array) -> Array:
    """Friction that resists rates, shape (…, nv)."""
    v0 = model.friction_velocity
    with np.errstate(over="ignore"):
        turned = np.tanh(qd / v0) if v0 else np.sign(qd)
    return model.damping * qd + model.friction * turned


def _check_sum(tau: Array, friction: bool, f_ext: Wrenches | None) -> None:
    """Refuse what only wrenches or friction have made infinite."""
    if (friction or _given(f_ext)) and not np.isfinite(tau).all():
        raise InputError("tau, f_ext or friction are not finite or too large: their sum is not a finite number.")


def _check_power(nu: Array, *terms: Array | None) -> None:
    """Refuse what wrenches or friction make of the power, which the sweep has found finite without them."""
    with np.errstate(over="ignore", invalid="ignore"):
        power = sum(float(nu @ term) for term in terms if term is not None)
    if not np.isfinite(power):
        raise InputError("qd, f_ext or friction are too large: the power overflows.")


def _given(f_ext: Wrenches | None) -> bool:
    """Whether there are wrenches; anything but None or an empty dict is."""
    return f_ext is not None and not (isinstance(f_ext, dict) and not f_ext)


def _fill(buffer: Array, name: str, value: VectorLike, names: Sequence[str]) -> Array:
    """Copy an argument into a buffer, checking its shape."""
    if type(value) is np.ndarray and value.dtype is _FLOAT and value.shape == buffer.shape:
        buffer[:] = value
        return buffer
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name} is not a vector of numbers: {error}.") from error
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name} is not a vector of numbers: it has dtype {array.dtype}.")
    if array.shape != buffer.shape:
        expected = f"({len(names)},): one entry for each of {_listed(names)}"
        raise InputError(f"{name} has shape {array.shape}, expected {expected}.")
    buffer[...] = array
    return buffer


def _listed(names: Sequence[str], most: int = 12) -> str:
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")
