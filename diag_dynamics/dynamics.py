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

    The equation of motion is ``d(nu)/dt + coriolis + gravity = epsilon`` (Jain and Rodriguez 1995, eq. 3.1,
    with gravity as a term of its own). Results are the caller's own: nothing is overwritten later.

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
        D [kg m², kg] (Algorithm 4.1).
    """

    __slots__ = ("__dict__", "_model", "_qd", "_rows", "_twists")

    def __init__(self, model, rows, twists, qd, with_tau):
        self._model, self._rows, self._twists, self._qd = model, rows, twists, qd
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
        """½ν_k² of each total rate [J]; sums to K. It is not the energy of link k."""
        return 0.5 * self.nu * self.nu

    @cached_property
    def link_energy(self):
        """Kinetic energy of each link [J], shape (len(model.link_names),): ½VᵀIV plus its joint's rotor; sums to K."""
        energy = np.empty(len(self._model.link_names))
        sweeps.link_energy(self._model.bodies, self._model.links, self._twists, self._qd, energy)
        return energy

    @cached_property
    def power(self):
        """dK/dt = νᵀ(ε − ε_g) [W] without friction and other external wrenches (Lemma 7.2); None without tau."""
        if self.epsilon is None:
            return None
        return float(self.nu @ (self.epsilon - self.gravity))


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

    Vectors are in the order of ``model.dof_names``: q [rad, m], qd [rad/s, m/s], tau [N m, N], nu [J^½],
    epsilon [J^½/s]. Every method raises :class:`InputError` if a vector has not shape (nv,) or is not finite, naming
    the joint, and those that factorize raise :class:`SingularMassMatrixError` if M is singular at q.

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
        self._a, self._b, self._c, self._zero = np.zeros((4, model.nv))
        self._momentum = np.zeros(model.nv)

    def evaluate(self, q, qd, tau=None, f_ext=None):
        """Every quantity of the diagonalized equations of motion at one state.

        Parameters
        ----------
        q, qd : array_like, shape (nv,)
            Positions and rates.
        tau : array_like, shape (nv,), optional
            Joint efforts as applied, gravity included if they carry it.
        f_ext : dict, optional
            External wrenches; not offered yet.

        Returns
        -------
        Evaluation
        """
        _no_wrenches(f_ext)
        model = self.model
        q, rate = self._vector("q", q, self._a), self._vector("qd", qd, self._b)
        effort = self._zero if tau is None else self._vector("tau", tau, self._c)
        rows, twists = np.empty((8, model.nv)), np.empty((model.nv + 1, 6))
        status = sweeps.evaluate(model.bodies, model.gravity, q, rate, effort, self._work, rows, twists)
        if status:
            self._fail(status, q=q, qd=rate, tau=effort)
        return Evaluation(model, rows, twists, rate.copy(), tau is not None)

    def factors(self, q):
        """m, ℓ, the unit factor and D at q: see :class:`Factors`."""
        q = self._vector("q", q, self._a)
        unit, inverse = np.empty((2, self.model.nv, self.model.nv))
        D = np.empty(self.model.nv)
        self._checked(sweeps.factors(self.model.bodies, q, self._work, unit, inverse, D), q=q)
        root = np.sqrt(D)
        return Factors(unit * root, inverse / root[:, None], unit, D)

    def forward_dynamics(self, q, qd, tau, f_ext=None):
        """q̈ [rad/s², m/s²], shape (nv,), from M q̈ + c + g = τ (Algorithm 8.1 in closed form)."""
        _no_wrenches(f_ext)
        q, qd, tau = self._vector("q", q, self._a), self._vector("qd", qd, self._b), self._vector("tau", tau, self._c)
        qdd = np.empty(self.model.nv)
        status = sweeps.forward_dynamics(self.model.bodies, self.model.gravity, q, qd, tau, self._work, qdd)
        self._checked(status, q=q, qd=qd, tau=tau)
        return qdd

    def inverse_dynamics(self, q, qd, qdd, f_ext=None):
        """τ = M q̈ + c + g [N m, N], shape (nv,) (Newton–Euler, eq. 4.3)."""
        _no_wrenches(f_ext)
        return self._newton_euler(self.model.gravity, q, qd, qdd)

    def mass_matrix(self, q):
        """M(q) [kg m², kg, mixed kg m], shape (nv, nv), armature included."""
        q = self._vector("q", q, self._a)
        M = np.empty((self.model.nv, self.model.nv))
        self._checked(sweeps.mass_matrix(self.model.bodies, q, self._work, M), q=q)
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
        zero = self._zero
        probe = DiagonalDynamics(self.model)
        steps = (
            lambda: probe.evaluate(zero, zero, zero).link_energy,
            lambda: probe.factors(zero),
            lambda: probe.forward_dynamics(zero, zero, zero),
            lambda: probe.gravity_torque(zero),
            lambda: probe.mass_matrix(zero),
            lambda: probe.nu_from_qd(zero, zero),
            lambda: probe.qd_from_nu(zero, zero),
            lambda: probe.epsilon_from_tau(zero, zero),
            lambda: probe.tau_from_epsilon(zero, zero),
        )
        for step in steps:
            with suppress(SingularMassMatrixError):  # at this one configuration; it is compiled all the same
                step()

    # --- Between Python and the sweeps ---

    def _vector(self, name, value, buffer):
        """The argument as a contiguous float64 vector of nv entries, in a buffer of this object."""
        array = np.asarray(value)
        if array.shape != buffer.shape:
            raise InputError(
                f"{name} has shape {array.shape}, expected ({self.model.nv},): one entry for each of "
                f"{_listed(self.model.dof_names)}."
            )
        try:
            buffer[...] = array
        except (TypeError, ValueError) as error:
            raise InputError(f"{name} is not a vector of numbers: {error}.") from error
        return buffer

    def _newton_euler(self, gravity, q, qd, qdd):
        q, qd, qdd = self._vector("q", q, self._a), self._vector("qd", qd, self._b), self._vector("qdd", qdd, self._c)
        tau = np.empty(self.model.nv)
        status = sweeps.inverse_dynamics(self.model.bodies, gravity, q, qd, qdd, self._work, tau)
        self._checked(status, q=q, qd=qd, qdd=qdd)
        return tau

    def _sweep(self, sweep, q, name, value):
        q, x = self._vector("q", q, self._a), self._vector(name, value, self._b)
        result = np.empty(self.model.nv)
        self._checked(sweep(self.model.bodies, q, x, self._work, result), q=q)
        if not np.isfinite(x).all():
            self._fail(-1, **{name: x})
        return result

    def _checked(self, status, **inputs):
        if status:
            self._fail(status, **inputs)

    def _fail(self, status, **inputs):
        """Raise what a sweep's status stands for, naming joint and value."""
        names = self.model.dof_names
        if status > 0:
            joint, D = names[status - 1], float(self._work["D"][status])
            raise SingularMassMatrixError(
                f"The mass matrix of robot '{self.model.name}' is singular at this configuration: joint '{joint}' "
                f"moves no inertia there (D = {D:.3g}).",
                joint,
                D,
            )
        for argument, values in inputs.items():
            for name, value in zip(names, values, strict=True):
                if not np.isfinite(value):
                    raise InputError(f"{argument} of joint '{name}' is {value}, expected a finite number.")
        raise InputError(f"{', '.join(inputs)} are too large: their sum overflows.")


_NO_GRAVITY = np.zeros(3)
_NO_GRAVITY.flags.writeable = False


def _no_wrenches(f_ext):
    if f_ext:
        raise UnsupportedError("External wrenches (f_ext) are not offered yet.")


def _listed(names, most=12):
    return ", ".join(names[:most]) + (", …" if len(names) > most else "")
