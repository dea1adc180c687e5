"""DiagonalDynamics: the dynamics of one robot, as users call it."""

from contextlib import suppress
from functools import cached_property
from typing import NamedTuple

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.exceptions import InputError, SingularMassMatrixError, UnsupportedError
from diag_dynamics.model import RobotModel


class Evaluation:
    """Everything the sweeps compute at one state; arrays have shape (nv,) unless said otherwise.

    The equation of motion is ``d(nu)/dt + coriolis + gravity = epsilon``, with ``+ external`` on the right and
    ``+ friction`` on the left where these were asked for (Jain and Rodriguez 1995, eq. 3.1, with gravity, wrenches and
    friction as terms of their own). Results are the caller's own: nothing is overwritten later.

    Attributes
    ----------
    nu : ndarray
        Total joint rates ν = mᵀq̇ [J^½] (Table 1).
    xi : ndarray
        Un-normalized total joint rates ξ = D^−½ν [rad/s, m/s] (eq. 7.7).
    epsilon, kappa : ndarray or None
        Working moments ε = ℓτ [J^½/s] and κ = D^½ε [N m, N] (Table 2), gravity not taken out; None without tau.
    coriolis : ndarray
        Coriolis term C(q, ν) [J^½/s] (Algorithm 7.1), without gravity; νᵀC = 0 (Lemma 7.1).
    coriolis_unnormalized : ndarray
        C_ξ(q, ξ) of D ξ̇ + C_ξ = κ [N m, N] (Lemma 7.3), without gravity.
    gravity : ndarray
        ε_g = ℓ g(q) [J^½/s].
    articulated_inertia : ndarray
        D [kg m², kg] (Algorithm 4.1); at a joint of several degrees of freedom, and so for a floating base, the diagonal
        of its block's factor U D Uᵀ.
    external : ndarray or None
        ℓ Jᵀf_ext [J^½/s]; None without wrenches.
    friction : ndarray or None
        ε_fric = ℓ τ_fric [J^½/s], on the side of C; None unless asked for.
    """

    __slots__ = ("__dict__", "_model", "_qd", "_rows", "_twists")

    def __init__(self, model, rows, twists, qd, with_tau, external=None, friction=None):
        self._model, self._rows, self._twists, self._qd = model, rows, twists, qd
        self.external, self.friction = external, friction
        self.nu = rows[sweeps.NU]
        self.xi = rows[sweeps.XI]
        self.epsilon = rows[sweeps.EPSILON] if with_tau else None
        self.kappa = rows[sweeps.KAPPA] if with_tau else None
        self.coriolis = rows[sweeps.CORIOLIS]
        self.coriolis_unnormalized = rows[sweeps.CORIOLIS_UNNORMALIZED]
        self.gravity = rows[sweeps.GRAVITY]
        self.articulated_inertia = rows[sweeps.ARTICULATED_INERTIA]

    @cached_property
    def kinetic_energy(self):
        """K = ½νᵀν [J]."""
        return 0.5 * float(self.nu @ self.nu)

    @cached_property
    def energy_share(self):
        """½ν_k² of each total rate [J]; sums to K. It is not the energy of link k.

        The six shares of a floating base depend on the order of its twist's components, their sum `base_energy` does not.
        """
        return 0.5 * self.nu * self.nu

    @cached_property
    def base_energy(self):
        """Sum of the shares of a floating base's six degrees of freedom [J]; 0 with a fixed base.

        It is the energy of the total rates' common part: ½V*ᵀPV* with P the articulated inertia of the whole robot.
        """
        return float(self.energy_share[:6].sum()) if self._model.floating_base else 0.0

    @cached_property
    def link_energy(self):
        """Kinetic energy of each link [J], shape (len(model.link_names),): ½VᵀIV plus its joint's rotor; sums to K."""
        energy = np.empty(len(self._model.link_names))
        sweeps.link_energy(self._model.bodies, self._model.links, self._twists, self._qd, energy)
        return energy

    @cached_property
    def nu_dot(self):
        """dν/dt = ε − C − ε_g + ℓJᵀf_ext − ε_fric [J^½/s] (eq. 3.1), of those terms asked for; None without tau."""
        if self.epsilon is None:
            return None
        rate = self.epsilon - self.coriolis - self.gravity
        if self.external is not None:
            rate = rate + self.external
        return rate if self.friction is None else rate - self.friction

    @cached_property
    def power(self):
        """dK/dt = νᵀ(ε − ε_g + ℓJᵀf_ext − ε_fric) [W] (Lemma 7.2), of those terms that were asked for; None without tau."""
        if self.epsilon is None:
            return None
        return float(self.nu @ (self.nu_dot + self.coriolis))


class Factors(NamedTuple):
    """Factors of the mass matrix at one configuration, M = m mᵀ = unit diag(D) unitᵀ and M⁻¹ = ℓᵀℓ (Identity 4.1).

    m and unit are upper triangular in base-to-tip order, and [i, j] is zero unless i = j or joint i carries joint j.

    Attributes
    ----------
    m : ndarray, shape (nv, nv)
        [I + HφK] D^½.
    l : ndarray, shape (nv, nv)
        D^−½ [I − HψK] = m⁻¹.
    unit : ndarray, shape (nv, nv)
        [I + HφK], unit upper triangular.
    D : ndarray, shape (nv,)
        Articulated joint inertias [kg m², kg].
    """

    m: np.ndarray
    l: np.ndarray  # noqa: E741
    unit: np.ndarray
    D: np.ndarray


class DiagonalDynamics:
    """Diagonalized and classical dynamics of one robot, each in O(N) sweeps over its links.

    It owns a workspace: use one per thread. Results never alias the workspace.

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

    def __init__(self, model):
        if not isinstance(model, RobotModel):
            raise InputError(f"DiagonalDynamics needs a RobotModel, as load_urdf returns, not {type(model).__name__}.")
        self.model = model
        self._work = np.zeros(model.nv + 1, sweeps.WORK)
        self._q = np.zeros(model.nq)
        self._a, self._b, self._zero = np.zeros((3, model.nv))

    def evaluate(self, q, qd, tau=None, f_ext=None, *, frame="link", friction=False):
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

        Returns
        -------
        Evaluation
        """
        model = self.model
        _check_frame(frame)
        q, rate = self._positions(q), self._vector("qd", qd, self._a)
        effort = self._zero if tau is None else self._vector("tau", tau, self._b)
        rows, twists = np.empty((8, model.nv)), np.empty((model.nv + 1, 6))
        status = sweeps.evaluate(model.bodies, model.gravity, q, rate, effort, self._work, rows, twists)
        if status:
            self._fail(status, qd=rate, tau=effort)
        rate = rate.copy()
        external = self.epsilon_from_tau(q, self._effort_of(f_ext, frame)) if _given(f_ext) else None
        resisting = self.epsilon_from_tau(q, self.friction_torque(rate)) if friction else None
        return Evaluation(model, rows, twists, rate, tau is not None, external, resisting)

    def factors(self, q):
        """m, ℓ, the unit factor and D at q: see :class:`Factors`."""
        q = self._positions(q)
        unit, inverse = np.empty((2, self.model.nv, self.model.nv))
        D = np.empty(self.model.nv)
        self._checked(sweeps.factors(self.model.bodies, q, self._work, unit, inverse, D))
        root = np.sqrt(D)
        return Factors(unit * root, inverse / root[:, None], unit, D)

    def forward_dynamics(self, q, qd, tau, f_ext=None, *, frame="link", friction=False):
        """q̈ [rad/s², m/s²], shape (nv,), from M q̈ + c + g + τ_fric = τ + Jᵀf_ext (Algorithm 8.1 in closed form).

        τ_fric, see :meth:`friction_torque`, only where `friction` is true. Of a joint of several degrees of freedom it is
        the rate of its twist's components.
        """
        _check_frame(frame)
        q, qd, tau = self._positions(q), self._vector("qd", qd, self._a), self._vector("tau", tau, self._b)
        if friction:
            tau -= self.friction_torque(qd)
        if _given(f_ext):
            tau += self._effort_of(f_ext, frame)
        _check_sum(tau, friction, f_ext)
        qdd = np.empty(self.model.nv)
        status = sweeps.forward_dynamics(self.model.bodies, self.model.gravity, q, qd, tau, self._work, qdd)
        self._checked(status, qd=qd, tau=tau)
        return qdd

    def inverse_dynamics(self, q, qd, qdd, f_ext=None, *, frame="link", friction=False):
        """τ = M q̈ + c + g + τ_fric − Jᵀf_ext [N m, N], shape (nv,) (Newton–Euler, eq. 4.3).

        τ_fric only where `friction` is true.
        """
        _check_frame(frame)
        tau = self._newton_euler(self.model.gravity, q, qd, qdd)
        if friction:
            tau += self.friction_torque(qd)
        if _given(f_ext):
            tau -= self._effort_of(f_ext, frame)
        _check_sum(tau, friction, f_ext)
        return tau

    def friction_torque(self, qd):
        """τ_fric = d q̇ + f sign(q̇) [N m, N], shape (nv,): URDF damping d and Coulomb friction f, resisting the motion.

        No other quantity holds it unless it is asked to.
        """
        qd = self._vector("qd", qd, np.empty(self.model.nv))
        if not np.isfinite(qd).all():
            self._fail(-1, qd=qd)
        return self.model.damping * qd + self.model.friction * np.sign(qd)

    def mass_matrix(self, q):
        """M(q) [kg m², kg, mixed kg m], shape (nv, nv), armature included."""
        q = self._positions(q)
        M = np.empty((self.model.nv, self.model.nv))
        self._checked(sweeps.mass_matrix(self.model.bodies, q, self._work, M))
        return M

    def bias(self, q, qd):
        """c(q, q̇) of M q̈ + c + g = τ [N m, N], shape (nv,), without gravity. It is not C(q, ν)."""
        return self._newton_euler(_NO_GRAVITY, q, qd, self._zero)

    def gravity_torque(self, q):
        """g(q) [N m, N], shape (nv,): the effort that holds the robot still."""
        return self._newton_euler(self.model.gravity, q, self._zero, self._zero)

    def nu_from_qd(self, q, qd):
        """ν = mᵀq̇ [J^½], shape (nv,), in O(N) (Table 1)."""
        return self._sweep(sweeps.nu_from_qd, q, "qd", qd)

    def qd_from_nu(self, q, nu):
        """q̇ = ℓᵀν [rad/s, m/s], shape (nv,), in O(N) (Table 1, right)."""
        return self._sweep(sweeps.qd_from_nu, q, "nu", nu)

    def epsilon_from_tau(self, q, tau):
        """ε = ℓτ [J^½/s], shape (nv,), in O(N) (Table 2)."""
        return self._sweep(sweeps.epsilon_from_tau, q, "tau", tau)

    def tau_from_epsilon(self, q, epsilon):
        """τ = mε [N m, N], shape (nv,), in O(N) (Table 2, right)."""
        return self._sweep(sweeps.tau_from_epsilon, q, "epsilon", epsilon)

    def evaluate_batch(self, Q, QD, TAU=None):
        """Not offered yet: raises :class:`UnsupportedError`."""
        raise UnsupportedError("evaluate_batch is not offered yet: call evaluate for each state.")

    def compile(self):
        """Compile everything, or load it from the cache: afterwards no call waits for the compiler."""
        zero, q = self._zero, self.model.neutral
        probe = DiagonalDynamics(self.model)
        wrench = {self.model.root_link: np.zeros(6)}
        steps = (
            lambda: probe.evaluate(q, zero, zero).link_energy,
            lambda: probe.factors(q),
            lambda: probe.forward_dynamics(q, zero, zero),
            lambda: probe.inverse_dynamics(q, zero, zero, wrench),
            lambda: probe.mass_matrix(q),
            lambda: probe.nu_from_qd(q, zero),
            lambda: probe.qd_from_nu(q, zero),
            lambda: probe.epsilon_from_tau(q, zero),
            lambda: probe.tau_from_epsilon(q, zero),
        )
        for step in steps:
            with suppress(SingularMassMatrixError):  # at this one configuration; it is compiled all the same
                step()

    # --- Between Python and the sweeps ---

    def _vector(self, name, value, buffer):
        """The argument as a contiguous float64 vector of nv entries, in a buffer of this object."""
        return _fill(buffer, name, value, self.model.dof_names)

    def _positions(self, q):
        """Positions as a contiguous float64 vector of nq entries, in a buffer of this object."""
        return q if q is self._q else _fill(self._q, "q", q, self.model.coordinate_names)

    def _newton_euler(self, gravity, q, qd, qdd):
        q, qd, qdd = self._positions(q), self._vector("qd", qd, self._a), self._vector("qdd", qdd, self._b)
        tau = np.empty(self.model.nv)
        status = sweeps.inverse_dynamics(self.model.bodies, gravity, q, qd, qdd, self._work, tau)
        self._checked(status, qd=qd, qdd=qdd)
        return tau

    def _sweep(self, sweep, q, name, value):
        q, x = self._positions(q), self._vector(name, value, self._a)
        if not np.isfinite(x).all():
            self._fail(-1, **{name: x})
        result = np.empty(self.model.nv)
        self._checked(sweep(self.model.bodies, q, x, self._work, result))
        if not np.isfinite(result).all():
            self._fail(-1, **{name: x})
        return result

    def _effort_of(self, f_ext, frame):
        """Jᵀf_ext at the positions in the buffer of this object."""
        model, tau = self.model, np.empty(self.model.nv)
        wrenches = model.wrenches(f_ext, frame)
        status = sweeps.effort_of_wrenches(model.bodies, self._q, wrenches, frame == "world", self._work, tau)
        self._checked(status)
        return tau

    def _checked(self, status, **inputs):
        if status:
            self._fail(status, **inputs)

    def _fail(self, status, **inputs):
        """Raise what a sweep's status stands for, naming joint and value."""
        names = self.model.dof_names
        if status > 0 and np.isfinite(self._work["D"][status]):
            joint, D = names[status - 1], float(self._work["D"][status])
            raise SingularMassMatrixError(
                f"The mass matrix of robot '{self.model.name}' is singular at this configuration: joint '{joint}' "
                f"moves no inertia there (D = {D:.3g}, within rounding of the inertias that it comes from).",
                joint,
                D,
            )
        coordinates = self.model.coordinate_names
        for argument, values in ({"q": self._q} | inputs).items():
            for name, value in zip(coordinates if argument == "q" else names, values, strict=True):
                if not np.isfinite(value):
                    raise InputError(f"{argument} of joint '{name}' is {value}, expected a finite number.")
        for k, orientation in enumerate(self.model._tree.orientations):
            quaternion = self._q[k - 3 : k + 1]
            if orientation == 3 and abs(quaternion @ quaternion - 1.0) >= sweeps.UNIT_TOLERANCE:
                raise InputError(
                    f"q of joint '{coordinates[k].rpartition('/')[0]}' has the quaternion {quaternion.tolist()} "
                    "(x, y, z, w), expected one of length 1."
                )
        raise InputError(f"{', '.join(['q', *inputs])} are too large: a result overflows.")


_NO_GRAVITY = np.zeros(3)
_NO_GRAVITY.flags.writeable = False


def _check_frame(frame):
    if frame not in ("link", "world"):
        raise InputError(f"frame is {frame!r}, expected 'link' or 'world'.")


def _check_sum(tau, friction, f_ext):
    """Refuse what only wrenches or friction have made infinite."""
    if (friction or _given(f_ext)) and not np.isfinite(tau).all():
        raise InputError("tau, f_ext or friction are not finite or too large: their sum is not a finite number.")


def _given(f_ext):
    """Whether there are wrenches; anything but None or an empty dict is."""
    return f_ext is not None and not (isinstance(f_ext, dict) and not f_ext)


def _fill(buffer, name, value, names):
    """Copy an argument into a buffer, checking its shape."""
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


def _listed(names, most=12):
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")
