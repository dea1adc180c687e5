# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""DiagonalDynamics: the dynamics of one robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from inspect import signature
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from diag_dynamics.arrays import (
    FRAMES,
    Array,
    Frame,
    ManyWrenches,
    PointLike,
    RowsLike,
    StatesLike,
    VectorLike,
)
from diag_dynamics.checks import (
    check_finite,
    choice,
    instance,
    is_rows,
    numbers,
    rows,
    unit,
    vector,
)
from diag_dynamics.collision.contact_points import ContactPoint, ContactPoints
from diag_dynamics.collision.predicted_contact import Impact, PredictedContact, impact
from diag_dynamics.dynamics import calls, external_wrench, noise
from diag_dynamics.dynamics.arguments import ARRAY, FLOAT, States, are_vectors
from diag_dynamics.exceptions import DiagDynamicsError, InputError, attribute_error
from diag_dynamics.model import RobotModel
from diag_dynamics.results import (
    Evaluation,
    ExternalWrench,
    Factors,
    Momentum,
    TouchedLink,
    batch_memory,
    read_only,
)
from diag_dynamics.sweeps import (
    batch,
    classical,
    contacts,
    derivatives,
    evaluation,
    factorization,
    kinematics,
    mobilities,
    regressors,
)
from diag_dynamics.sweeps import workspace as ws

Points: TypeAlias = ContactPoints | Iterable[ContactPoint]
ORIGIN = 0.0, 0.0, 0.0

MAX_TABLES = 32
"""Tables of covariances, links and points that are kept: making one takes longer than a state."""

ROUNDING = 4e-15
"""Maximum of ℓJᵀu by rounding, as a fraction of the entries of ℓJᵀ, per degree of freedom."""


class DiagonalDynamics(calls.Sweeps):
    """Compute the dynamics of one robot: diagonalized equations of motion, classical quantities.

    It answers what a robot does under efforts and wrenches, and how much energy and torque each
    joint has. Every method is a sweep over the links, O(N) where its result is a vector.

    Vectors of rates and efforts have shape (nv,) and the order of ``model.dof_names``:
    qd [rad/s, m/s], tau [N m, N], nu [J^½], epsilon [J^½/s]. Positions q [rad, m] have shape (nq,)
    and the order of ``model.coordinate_names``. A dict or pandas Series is matched by name.

    Methods with an argument `threads` also take one row per state, shapes (T, nq) and (T, nv), and
    return results with a leading axis T. They use all processors, or `threads` of them, and name
    the first state that fails.

    Every method raises :class:`InputError` if an argument has another shape or is not finite; it
    names joint, value and expectation. Methods that factorize M raise
    :class:`SingularMassMatrixError` if it is singular at q.

    External wrenches are a dict of six numbers, force [N] then moment [N m], by link name; for many
    states also of arrays of shape (T, 6). Each acts at its link's origin, in the link's axes
    (``frame="link"``) or in the world's (``frame="world"``).

    Threads may share one object, but each is faster with its own. Results never alias its memory.

    Parameters
    ----------
    model : RobotModel
        Result of :func:`load_urdf`.
    """

    def __init__(self, model: RobotModel) -> None:
        super().__init__(instance("model", model, RobotModel))
        self._tables: dict[Any, Any] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.model,)  # a copy has memory of its own

    if not TYPE_CHECKING:  # mypy would accept any attribute

        def __getattr__(self, name):
            raise attribute_error(self, name)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} '{self.model.name}': {self._nv} dof>"

    def compile(self, *methods: str) -> None:
        """Call methods by name, or all methods, so that no later call waits for the compiler.

        Parameters
        ----------
        *methods : str
            Names; without names all methods. Those for rows of states compile when they are called.
        """
        model = self.model
        link = model.link_names[model.bodies["link"][-1]]
        arguments = {
            "q": model.start,
            "link": link,
            "f_ext": {link: np.zeros(6)},
            "wrench": np.zeros(6),
            "direction": np.ones(3),
            "covariance": np.eye(self._nv),
            "points": (),
        }
        public = [name for name in vars(DiagonalDynamics) if name[0] != "_" and name != "compile"]
        for name in methods or public:
            choice("method", name, public)
            method = getattr(self, name)
            values = {
                parameter.name: arguments.get(parameter.name, self._zero)
                for parameter in signature(method).parameters.values()
                if parameter.name in arguments or parameter.default is parameter.empty
            }
            with suppress(DiagDynamicsError):  # the start may be singular
                method(**values)
            if name == "evaluate":
                evaluation.link_energies.compile()  # for Evaluation.link_energy

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
        threads: int | None = None,
    ) -> Evaluation:
        """Evaluate every quantity of the diagonalized equations of motion at one state or many.

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
        threads : int, optional
            Number of threads for many states.

        Returns
        -------
        Evaluation
            For many states with a leading axis, and the same bits as evaluations of one; with
            closed loops equal within rounding, because each closing starts at the last state.
        """
        effort = self._zero if tau is None else tau
        status = ws.BAD_LENGTH
        try:
            if (
                f_ext is None
                and frame == "link"
                and not friction
                and type(q) is type(qd) is type(effort) is ARRAY
                and q.dtype is qd.dtype is effort.dtype is FLOAT
                and q.ndim == 1  # numba takes long to reject rows
            ):
                state = np.empty(self._shape)
                status = evaluation.evaluate.run(self._robot, q, qd, effort, state)
        except TypeError:  # another shape, or strides
            pass
        if not status:
            if self._loops:
                self._warn_of_loops()
            return Evaluation(self.model, state, tau is not None)
        # with checked arguments, which name the error if there is one
        choice("frame", frame, FRAMES)
        at = self._states(q, threads, qd=qd, tau=effort)
        kernels = calls.Sweep(evaluation.evaluate, batch.evaluate_many)
        memory = batch_memory(self.model, len(at.q)) if at.threads else ()
        rows, *numbers = self._call(kernels, at, self._shape, memory=memory)
        external = resisting = None
        if f_ext is not None:
            torque = self._wrench_effort(at, f_ext, frame)
            external = self._epsilon(at, torque, "f_ext is too large")
        if friction:
            torque = self._friction(at)
            resisting = self._epsilon(at, torque, "friction or qd are too large")
        s = Evaluation(self.model, rows, tau is not None, external, resisting, numbers)
        if tau is not None:
            problem = "qd, f_ext or friction are too large: the power overflows"
            calls.require_finite(at, s.power, problem)
        return s

    # --- Joint space

    def factors(self, q: StatesLike, *, threads: int | None = None) -> Factors:
        """Return the factors m, ℓ, the unit factor and D of M(q) as :class:`Factors`."""
        nv = self._nv
        status = ws.BAD_LENGTH
        factors = np.empty((3, nv, nv))
        D = np.empty(nv)
        try:
            if are_vectors(q, q, q) and q.ndim == 1:
                status = factorization.factors.run(self._robot, q, factors, D)
        except TypeError:  # as in evaluate
            pass
        if status:
            at = self._states(q, threads)
            factors, D = self._call(calls.FACTORS, at, (3, nv, nv), (nv,))
            factors = np.moveaxis(factors, -3, 0)
        factors.setflags(False)  # type: ignore[call-arg]  # as in results.Evaluation
        D.setflags(False)  # type: ignore[call-arg]  # as in results.Evaluation
        # Half of the time that Factors(…) takes.
        return tuple.__new__(Factors, (factors[0], factors[1], factors[2], D))

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
        """Return q̈ [rad/s², m/s²], shape (nv,), of M q̈ + c + g + τ_fric = τ + Jᵀf_ext.

        It is Algorithm 8.1 in closed form. τ_fric, see :meth:`friction_torque`, is zero unless
        `friction` is true. For a joint of several degrees of freedom q̈ is the rate of its twist's
        components.
        """
        try:
            if f_ext is None and frame == "link" and not friction and are_vectors(q, qd, tau):
                qdd = np.empty(self._nv)
                if not classical.forward_dynamics.run(self._robot, q, qd, tau, qdd):
                    return qdd
        except TypeError:  # as in evaluate
            pass
        choice("frame", frame, FRAMES)
        at = self._states(q, threads, qd=qd, tau=tau)
        if friction or f_ext is not None:
            for name, x in at.vectors.items():
                check_finite(name, x, self.model.dof_names)
            effort = at.vectors["tau"]
            if friction:
                effort = effort - self._friction(at)
            if f_ext is not None:
                effort = effort + self._wrench_effort(at, f_ext, frame)
            calls.require_finite(at, effort, calls.SUM)
            at = at._replace(vectors={"qd": at.vectors["qd"], "tau": effort})
        return self._vector(calls.FORWARD_DYNAMICS, at)

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
        choice("frame", frame, FRAMES)
        at = self._states(q, threads, qd=qd, qdd=qdd)
        tau = self._vector(calls.INVERSE_DYNAMICS, at, 1.0)
        if friction:
            tau += self._friction(at)
        if f_ext is not None:
            tau -= self._wrench_effort(at, f_ext, frame)
        calls.require_finite(at, tau, calls.SUM)
        return tau

    def friction_torque(
        self, qd: StatesLike, q: StatesLike | None = None, *, threads: int | None = None
    ) -> Array:
        """Return the torque of friction τ_fric [N m, N], shape (nv,) or (T, nv).

        τ_fric = d q̇ + (f + μ|g(q)|) tanh(q̇/v₀) + s q̇/√max(|q̇|, v₀) + o.

        The model has damping d, Coulomb friction f, load friction μ, root friction s, offset o and
        v₀, its `friction_velocity`. At 5 v₀ the tanh is 1 − 1e-4. At rest τ_fric does not jump with
        the sign of a noisy velocity. Friction of followers acts at their own rates: Gᵀτ_fric(Gq̇).
        Positions q are required with it or load friction only. Other quantities include no friction
        unless requested.
        """
        if q is not None:
            return self._friction(self._states(q, threads, qd=qd))
        names = self.model.dof_names
        if self.model.load_friction.any() or self.model.has_follower_friction:
            raise InputError(
                "q is missing; expected positions, because the friction of this model depends on "
                "load or followers."
            )
        rates = rows("qd", qd, names) if is_rows(qd) else vector("qd", qd, names, finite=False)
        return self._friction(States(rates, {"qd": rates}))

    def mass_matrix(self, q: StatesLike, *, threads: int | None = None) -> Array:
        """Return M(q) [kg m², kg, mixed kg m], shape (nv, nv), including armature."""
        at = self._states(q, threads)
        return self._call(calls.MASS_MATRIX, at, (self._nv, self._nv))[0]

    def inverse_mass_matrix(self, q: StatesLike, *, threads: int | None = None) -> Array:
        """Return M⁻¹ = ℓᵀℓ [1/(kg m²), 1/kg, mixed 1/(kg m)], shape (nv, nv), without forming M."""
        inverse = self.factors(q, threads=threads).l
        return np.swapaxes(inverse, -1, -2) @ inverse

    def coriolis_torque(
        self, q: StatesLike, qd: StatesLike, *, threads: int | None = None
    ) -> Array:
        """Return c(q, q̇) of M q̈ + c + g = τ [N m, N], shape (nv,), without gravity.

        It is not C(q, ν), which is :attr:`Evaluation.coriolis`.
        """
        at = self._states(q, threads, qd=qd, qdd=self._zero)
        return self._vector(calls.INVERSE_DYNAMICS, at, 0.0)

    def gravity_torque(self, q: StatesLike, *, threads: int | None = None) -> Array:
        """Return g(q) [N m, N], shape (nv,): the effort that balances gravity at rest."""
        return self._gravity_torque(self._states(q, threads))

    def potential_energy(self, q: StatesLike, *, threads: int | None = None) -> Any:
        """Return U = −g·Σ m_i c_i [J] of all links in the field of gravity; of rows an array (T,).

        It is zero where the centre of mass is level with the world's origin, and g(q) is its
        gradient. Springs are no part of it.
        """
        energy = -self._first_moment(q, threads) @ self.model.gravity
        return energy if energy.ndim else float(energy)

    def center_of_mass(self, q: StatesLike, *, threads: int | None = None) -> Array:
        """Return Σ m_i c_i/Σ m_i [m], shape (3,), of all links in the world's axes.

        A fixed root link counts, too. Raises InputError if no link has mass.
        """
        moment = self._first_moment(q, threads)
        mass = self.model.total_mass
        if mass == 0.0:
            raise InputError(
                f"total_mass of robot '{self.model.name}' is 0; expected a link with mass. "
                "Add its inertial element."
            )
        return moment / mass

    def _first_moment(self, q: StatesLike, threads: int | None) -> Array:
        """Return Σ m_i c_i [kg m]."""
        at = self._states(q, threads)
        return self._vector(calls.FIRST_MOMENT, at, length=3)

    def regressor(
        self, q: StatesLike, qd: StatesLike, qdd: StatesLike, *, threads: int | None = None
    ) -> Array:
        """Return Y of M q̈ + c + g = Y π, shape (nv, 10·links), π the inertial parameters of links.

        Each link of ``model.link_names`` has ten columns, in Pinocchio's order: m [kg], m c (three)
        [kg m], I_xx, I_xy, I_yy, I_xz, I_yz, I_zz [kg m²]. The centre of mass c and the inertia
        about the link's origin are in the link's axes. Rotor inertia, which adds
        ``model.armature * qdd`` to joints without followers, and friction are apart.
        """
        at = self._states(q, threads, qd=qd, qdd=qdd)
        frames = self._link_frames
        shape = self._nv, regressors.PARAMETERS * len(frames)
        return self._call(calls.REGRESSOR, at, shape, after=(frames,))[0]

    def momentum(self, q: StatesLike, qd: StatesLike, *, threads: int | None = None) -> Momentum:
        """Return p = M q̇ and C_sᵀq̇ − g, its rate without efforts, as :class:`Momentum`.

        It takes O(N) without M. ṗ = τ + C_sᵀq̇ − g with Ṁ = C_s + C_sᵀ. The rate is
        ½ ∂(q̇ᵀM q̇)/∂q − g where q̇ is the derivative of q, and that of the components in body axes
        for joints of several degrees of freedom.
        """
        vectors = self._transform(calls.MOMENTUM, q, "qd", qd, threads, 2 * self._nv)
        return Momentum(vectors[..., : self._nv], vectors[..., self._nv :])

    # --- The four sweeps

    def nu_from_qd(self, q: StatesLike, qd: StatesLike, *, threads: int | None = None) -> Array:
        """Return ν = mᵀq̇ [J^½], shape (nv,), in O(N) (Table 1)."""
        return self._transform(calls.NU_FROM_QD, q, "qd", qd, threads)

    def qd_from_nu(self, q: StatesLike, nu: StatesLike, *, threads: int | None = None) -> Array:
        """Return q̇ = ℓᵀν [rad/s, m/s], shape (nv,), in O(N) (Table 1, right)."""
        return self._transform(calls.QD_FROM_NU, q, "nu", nu, threads)

    def epsilon_from_tau(
        self, q: StatesLike, tau: StatesLike, *, threads: int | None = None
    ) -> Array:
        """Return ε = ℓτ [J^½/s], shape (nv,), in O(N) (Table 2)."""
        return self._transform(calls.EPSILON_FROM_TAU, q, "tau", tau, threads)

    def tau_from_epsilon(
        self, q: StatesLike, epsilon: StatesLike, *, threads: int | None = None
    ) -> Array:
        """Return τ = mε [N m, N], shape (nv,), in O(N) (Table 2, right)."""
        return self._transform(calls.TAU_FROM_EPSILON, q, "epsilon", epsilon, threads)

    def _transform(
        self, sweep: calls.Sweep, q: Any, name: str, x: Any, threads: int | None, length: int = 0
    ) -> Array:
        try:
            if are_vectors(q, x, x):
                result = np.empty(length or self._nv)
                if not sweep.single(self._robot, q, x, result):
                    return result
        except TypeError:  # as in evaluate
            pass
        at = self._states(q, threads, **{name: x})
        return self._vector(sweep, at, length=length)

    # --- Along a motion

    def m_rate_transposed_times(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """Return ṁᵀx [J^½/s], shape (nv,), in O(N), of constant rates x [rad/s, m/s].

        It is the rate of mᵀ itself along q̇, from d(mᵀx)/dt: ṁᵀq̇ = ν̇ − mᵀq̈.
        """
        return self._differentiate(derivatives.m_rate_transposed_times, q, qd, x)

    def coriolis_bracket_times(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """Return B(q, ν)x [J^½/s], shape (nv,), of x [J^½], in O(N).

        B = ℓ(C_s − mṁᵀ)ℓᵀ is skew and B ν = C(q, ν) (Identity 7.1, Lemma 7.1), with C_s of
        :meth:`coriolis_matrix_times`.
        """
        at = self._state(q, qd=qd, x=x)
        check_finite("x", at.vectors["x"], self.model.dof_names)
        u = self.qd_from_nu(at.q, at.vectors["x"])
        force = self.coriolis_matrix_times(at.q, at.vectors["qd"], u)
        rate = self.m_rate_transposed_times(at.q, at.vectors["qd"], u)
        return self.epsilon_from_tau(at.q, force) - rate

    def coriolis_matrix_times(self, q: VectorLike, qd: VectorLike, x: VectorLike) -> Array:
        """Return C_s(q, q̇)x [N m, N], shape (nv,), of rates x [rad/s, m/s], in O(N).

        C_s q̇ = c, and Ṁ − 2C_s is skew: the product that passivity-based tracking needs.
        """
        return self._differentiate(derivatives.coriolis_matrix_times, q, qd, x)

    def _differentiate(self, sweep: Callable[..., int], q: Any, qd: Any, x: Any) -> Array:
        """Return the vector of a sweep along q̇."""
        result = np.empty(self._nv)
        try:
            if (
                not self._loops
                and are_vectors(q, qd, x)
                and (q.size, qd.size, x.size) == (self.model.nq, self._nv, self._nv)
                and not sweep(self._robot, q, qd, x, result)
            ):
                return result
        except TypeError:  # as in evaluate
            pass
        at = self._state(q, qd=qd, x=x)
        self._check(sweep(self._robot, at.q, *at.vectors.values(), result), at)
        return result

    def mass_matrix_rate(self, q: VectorLike, qd: VectorLike) -> Array:
        """Return Ṁ = Σ q̇_i ∂M/∂q_i [kg m²/s, …], shape (nv, nv) (Identity 6.3).

        A unit vector qd gives a partial derivative. For a joint of several degrees of freedom it is
        the rate along the motion with that twist.
        """
        at = self._state(q, qd=qd)
        check_finite("qd", at.vectors["qd"], self.model.dof_names)
        M, M_rate = np.zeros((2, self._nv, self._nv))
        status = derivatives.mass_matrix_rate(self._robot, at.q, at.vectors["qd"], M, M_rate)
        self._check(status, at)
        return M_rate

    def log_det(self, q: VectorLike) -> float:
        """Return ln det M = Σ ln D_k of the numerical values in SI units."""
        return np.log(self.evaluate(q, self._zero).articulated_inertia).sum(axis=-1)

    def log_det_rate(self, q: VectorLike, qd: VectorLike) -> float:
        """Return d/dt ln det M = Σ Ḋ_k/D_k [1/s] along q̇."""
        s = self.evaluate(q, qd)
        return (s.articulated_inertia_rate / s.articulated_inertia).sum(axis=-1)

    # --- Links

    def placement(self, q: VectorLike, link: str) -> Array:
        """Return the placement of a link's frame in the world, shape (4, 4).

        Columns are the frame's axes, then its origin [m].
        """
        body, in_body = self.model.placement_in_body(link)
        at = self._state(q)
        result = np.eye(4)
        self._check(kinematics.placement(self._robot, at.q, body, result[:3]), at)
        return result @ in_body

    def jacobian(
        self, q: VectorLike, link: str, point: PointLike = ORIGIN, frame: Frame = "link"
    ) -> Array:
        """Return J of a point of a link, shape (6, nv), in O(N): linear rows, then angular ones.

        Linear rows have the units [m, 1], angular ones [1, 1/m].

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
        at = self._state(q)
        J = np.empty((6, self._nv))
        body, in_body, rotation = self._point_frame(at.q, link, point, frame)
        kinematics.jacobians(self._robot, body, in_body, False, at.q[None], J[None])
        return np.concatenate([rotation @ J[:3], rotation @ J[3:]])

    def link_velocity(
        self,
        q: VectorLike,
        link: str,
        qd: VectorLike,
        point: PointLike = ORIGIN,
        frame: Frame = "link",
    ) -> Array:
        """Return J q̇ of a point of a link, shape (6,): velocity [m/s], angular velocity [rad/s].

        Other arguments are those of :meth:`jacobian`.
        """
        rates = vector("qd", qd, self.model.dof_names)
        return self.jacobian(q, link, point, frame) @ rates

    def link_acceleration(
        self,
        q: VectorLike,
        link: str,
        qd: VectorLike,
        qdd: VectorLike,
        point: PointLike = ORIGIN,
        frame: Frame = "link",
        *,
        spatial: bool = False,
    ) -> Array:
        """Return J q̈ + J̇ q̇ of a point of a link, shape (6,): linear [m/s²], angular [rad/s²].

        It is the second derivative of the point's position in the axes of `frame`, without gravity:
        Pinocchio's getFrameClassicalAcceleration. If `spatial`, it is the spatial acceleration,
        getFrameAcceleration: less ω × v. Other arguments are those of :meth:`jacobian`.
        """
        at = self._state(q, qd=qd, qdd=qdd)
        body, in_body, rotation = self._point_frame(at.q, link, point, frame)
        motions = np.empty((2, 6))
        status = kinematics.motion(self._robot, at.q, *at.vectors.values(), body, motions)
        self._check(status, at)
        linear = motions[:, :3] + np.cross(motions[:, 3:], in_body)
        if not spatial:
            linear[1] += np.cross(motions[0, 3:], linear[0])
        return np.concatenate([rotation @ linear[1], rotation @ motions[1, 3:]])

    def wrench_factor(
        self, q: VectorLike, link: str, point: PointLike = ORIGIN, frame: Frame = "link"
    ) -> Array:
        """Return ℓJᵀ, shape (nv, 6), in O(N): ε of unit wrenches at a point of a link.

        Columns are force (x, y, z) [J^½/(s N)], then moment [J^½/(s N m)], in the axes of `frame`.
        Other arguments are those of :meth:`jacobian`.
        """
        return self._wrench_factor(self._state(q), link, np.eye(6), point, frame)

    def epsilon_from_wrench(
        self,
        q: VectorLike,
        link: str,
        wrench: VectorLike,
        point: PointLike = ORIGIN,
        frame: Frame = "link",
    ) -> Array:
        """Return ℓJᵀw [J^½/s], shape (nv,), of a wrench w: force [N], then moment [N m].

        Other arguments are those of :meth:`wrench_factor`.
        """
        w = numbers("wrench", wrench, (6,), "six finite numbers, force [N] then moment [N m]")
        return self._wrench_factor(self._state(q), link, w[None], point, frame)[:, 0]

    def operational_inverse_inertia(
        self, q: VectorLike, link: str, point: PointLike = ORIGIN, frame: Frame = "link"
    ) -> Array:
        """Return J M⁻¹ Jᵀ = (ℓJᵀ)ᵀ(ℓJᵀ), shape (6, 6), of a point of a link, without forming M.

        Blocks are in [1/kg], [1/(kg m)] and [1/(kg m²)]; arguments are those of
        :meth:`wrench_factor`.
        """
        return calls.square(self.wrench_factor(q, link, point, frame), point)

    def reflected_mass(
        self,
        q: VectorLike,
        link: str,
        direction: VectorLike,
        point: PointLike = ORIGIN,
        frame: Frame = "link",
    ) -> float:
        """Return m_u = 1/|ℓJᵀu|² [kg], the mass that resists a push along u at a point of a link.

        The direction, shape (3,), is any vector along u in the axes of `frame`. The mass is inf if
        the point cannot move along u. Other arguments are those of :meth:`wrench_factor`.
        """
        u = unit("direction", direction)
        factor = self.wrench_factor(q, link, point, frame)
        w = factor[:, :3] @ u
        rounding = ROUNDING * max(len(w), 3) * np.abs(factor).max(initial=0.0)
        if np.abs(w).max(initial=0.0) <= rounding:
            return math.inf
        return 1.0 / float(calls.square(w, point))

    def mobilities(self, q: VectorLike) -> Array:
        """Return Υ = J M⁻¹Jᵀ of every link at its origin, shape (links, 6, 6), in one O(N) sweep.

        Links are in the order of ``model.link_names``. Rows and columns are linear, then angular,
        in the link's axes; blocks are in [1/kg], [1/(kg m)] and [1/(kg m²)]. A wrench h accelerates
        the link by Υ h and meets the mass 1/hᵀΥh. Υ is zero for links that no joint moves. For
        other points see :meth:`operational_inverse_inertia`.
        """
        at = self._state(q)
        frames = self._link_frames
        result = np.empty((len(frames), 6, 6))
        self._check(mobilities.mobilities(self._robot, at.q, frames, result), at)
        return result

    # --- External contact, from external torque. It is advisory: no result is safety-rated.

    def wrench(
        self,
        q: StatesLike,
        link: str,
        external_torque: StatesLike,
        covariance: RowsLike | None = None,
        point: PointLike = ORIGIN,
        frame: Frame = "link",
        *,
        force_only: bool = False,
        max_deviation: tuple[float, float] = (10.0, 1.0),
        threads: int | None = None,
    ) -> ExternalWrench:
        """Return the wrench at a point of a link that explains external torque τ̂.

        It is f̂ = (JΣ⁻¹Jᵀ)⁻¹JΣ⁻¹τ̂ and acts from the environment on the robot. Directions with a
        standard deviation above `max_deviation` are not estimated: they are zero in the wrench and
        unknown in the result.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Positions.
        link : str
            Name of the link.
        external_torque : array_like, shape (nv,)
            τ̂ = m r [N m, N] of a :class:`DisturbanceObserver`. Of a floating base its six entries
            count, too.
        covariance : array_like, shape (nv, nv), optional
            Σ: second moment of m r without contact, in the order of ``model.dof_names``. Without it
            f̂ is J⁻ᵀτ̂, or the wrench of least |τ̂ − Jᵀf̂| that `max_deviation` does not limit.
        point, frame
            Point of application and axes of the wrench, as of :meth:`jacobian`.
        force_only : bool
            Whether the moment about the point is zero.
        max_deviation : tuple of float
            Standard deviations of a force [N] and of a moment [N m]. Directions are orthogonal in
            these units.
        threads : int, optional
            Number of threads for many states.

        Returns
        -------
        ExternalWrench
        """
        at = self._states(q, threads, external_torque=external_torque)
        options = link, point, frame, force_only, max_deviation
        place = self._table(external_wrench.point_of_wrench, covariance, *options)
        shapes = (6,), (6, 6), (6, 6), (6,), (6,), ()
        *numbers, observed, chi_square = self._call(external_wrench.sweep(place), at, *shapes)
        problem = "external_torque is too large: a result overflows"
        calls.require_finite(at, chi_square, problem)
        fields: list[Any] = [*numbers, observed != 0.0, chi_square]
        return ExternalWrench._make(read_only(field)[()] for field in fields)

    def touched_link(
        self,
        q: StatesLike,
        external_torque: StatesLike,
        covariance: RowsLike | None,
        *,
        significance: float = 3.0,
        forces: PointLike = noise.FORCES,
        threads: int | None = None,
    ) -> TouchedLink:
        """Return the link that external torque τ̂ points to, and its probability.

        The evidence for link k is N(τ̂; 0, Σ + J_kᵀQ_kJ_k), averaged over magnitudes F. Q_k is the
        covariance of a force F of random direction at a random point. With probability ½ it is in
        a box in the link's axes around its origin, the joints and links on it and its centre of
        mass, with 5 cm on all sides, else within 5 cm of its origin. All links are equally probable
        without τ̂.

        Parameters
        ----------
        q, external_torque, covariance, threads
            As of :meth:`wrench`.
        significance : float
            A contact stands out if τ̂ᵀΣ⁻¹τ̂ exceeds the quantile of χ² with nv degrees of freedom
            that a normal variable exceeds at this number of standard deviations: at 3 in 0.13 % of
            the samples of normal noise.
        forces : array_like
            Magnitudes F [N].

        Returns
        -------
        TouchedLink
        """
        at = self._states(q, threads, external_torque=external_torque)
        links, table = self._table(noise.candidates, covariance, significance, forces)
        shape = (1 + len(links),)
        rows = self._call(calls.TOUCHED_LINK, at, shape, before=(table.at,))[0]
        return TouchedLink.of_rows(links, rows)

    def _table(self, make: Callable[..., Any], covariance: RowsLike | None, *options: Any) -> Any:
        """Return the table that `make` returns, or that of an earlier call with equal arguments."""
        content: Any = covariance
        if isinstance(covariance, np.ndarray):
            content = covariance.dtype.str, covariance.shape, covariance.tobytes()
        key = make, content, options
        try:
            table = self._tables.get(key)
        except TypeError:  # lists have no hash
            return make(self.model, covariance, *options)
        if table is None:
            if len(self._tables) >= MAX_TABLES:
                self._tables.clear()
            table = self._tables[key] = make(self.model, covariance, *options)
        return table

    # --- Predicted contact. It is advisory: no result is safety-rated.

    def contact_limits(
        self, q: StatesLike, qd: StatesLike, points: Points, *, threads: int | None = None
    ) -> PredictedContact:
        """Return speed, reflected mass, energy, force and allowed speed of contact.

        A sweep of O(N), and for each point a walk to the base.

        The transferable energy is ½(ŵᵀν)². An iterable of :class:`ContactPoint` is converted on
        every call. Rotors count with their armature, as with rigid joints. It is conservative: they
        enlarge the reflected mass, and the drive train between them and the link is stiffer than a
        human body.
        """
        model = self.model
        at = self._states(q, threads, qd=qd)
        points = points if isinstance(points, ContactPoints) else ContactPoints(model, points)
        names = points.model.link_names, points.model.dof_names
        if names != (model.link_names, model.dof_names):
            raise InputError(
                f"points are of robot '{points.model.name}'; expected those of '{model.name}'."
            )
        shapes = (self._nv,), (len(points), contacts.CONTACT_COLUMNS)
        outputs = self._call(calls.CONTACTS, at, *shapes, before=(points.table,))
        return PredictedContact(points, *outputs)

    def impact(
        self,
        q: VectorLike,
        link: str,
        qd: VectorLike,
        direction: VectorLike,
        point: PointLike = ORIGIN,
        frame: Frame = "link",
        *,
        mass: float = math.inf,
        restitution: float = 0.0,
    ) -> Impact:
        """Return ν⁺ = ν − (1+e) μ v_u ℓJᵀu after an impact with a mass at rest, in O(N).

        Parameters
        ----------
        q, link, qd
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
        after = impact(self.nu_from_qd(q, qd), w, float(calls.square(w, point)), mass, restitution)
        return after._replace(qd_after=self.qd_from_nu(q, after.nu_after))
