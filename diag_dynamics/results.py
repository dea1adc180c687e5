"""What DiagonalDynamics hands out: everything at one state, and the factors of the mass matrix."""

from typing import NamedTuple

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.exceptions import InputError


class _Lazy:
    """Attribute that is computed when it is first asked for, and kept.

    functools.cached_property, but for a lock that would cost more than the sweep of a small robot.
    """

    def __init__(self, function):
        self._function, self._name, self.__doc__ = function, function.__name__, function.__doc__

    def __set_name__(self, owner, name):
        self._name = name

    def __get__(self, instance, owner=None):
        if instance is None:
            return self
        value = instance.__dict__[self._name] = self._function(instance)
        return value


def _row(k, of_tau=False):
    """Attribute that is a row of what the sweep has filled; with a condition, None without efforts."""
    if of_tau:
        return _Lazy(lambda evaluation: evaluation._take(k) if evaluation._with_tau else None)
    return _Lazy(lambda evaluation: evaluation._take(k))


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
        ε_g = ℓ g(q) [J^½/s]; its un-normalized form κ_g [N m, N], as that of any such term, is √D times it.
    articulated_inertia : ndarray
        D [kg m², kg] (Algorithm 4.1); of a joint of several degrees of freedom, and so of a floating base, and of a
        coupled group the diagonal of its block's factor U D Uᵀ, in the order of the degrees of freedom.
    articulated_inertia_rate : ndarray
        Ḋ along the motion [kg m²/s, kg/s] (7.2).
    external : ndarray or None
        ℓ Jᵀf_ext [J^½/s]; None without wrenches.
    friction : ndarray or None
        ε_fric = ℓ τ_fric [J^½/s], on the side of C; None unless asked for.
    """

    __slots__ = ("__dict__", "_model", "_states", "_with_tau")  # made in less time

    external = friction = None

    def __init__(self, model, states, with_tau):
        self._model, self._states, self._with_tau = model, states, with_tau

    @property
    def rows(self):
        """The rows that the sweep has filled, see :mod:`diag_dynamics.sweeps.workspace`, shape (ROWS, nq)."""
        return self._states

    def _take(self, k):
        row = self._states[k]
        return row if len(row) == len(self._model.dof_names) else row[: self._model.nv]  # rows are of length nq

    nu = _row(sweeps.NU)
    xi = _row(sweeps.XI)
    epsilon = _row(sweeps.EPSILON, of_tau=True)
    kappa = _row(sweeps.KAPPA, of_tau=True)
    coriolis = _row(sweeps.CORIOLIS)
    coriolis_unnormalized = _row(sweeps.CORIOLIS_UNNORMALIZED)
    gravity = _row(sweeps.GRAVITY)
    articulated_inertia = _row(sweeps.ARTICULATED_INERTIA)
    articulated_inertia_rate = _row(sweeps.ARTICULATED_INERTIA_RATE)

    @_Lazy
    def kinetic_energy(self):
        """K = ½νᵀν [J]."""
        return self._energy_and_power[0]

    @_Lazy
    def energy_share(self):
        """½ν_k² of each total rate [J]; sums to K. It is not the energy of link k.

        The six shares of a floating base depend on the order of its twist's components, their sum `base_energy` does not.
        """
        return 0.5 * self.nu * self.nu

    @_Lazy
    def base_energy(self):
        """Sum of the shares of a floating base's six degrees of freedom [J]; 0 with a fixed base.

        It is the energy of the total rates' common part: ½V*ᵀPV* with P the articulated inertia of the whole robot.
        """
        return float(self.energy_share[:6].sum()) if self._model.floating_base else 0.0

    @_Lazy
    def link_energy(self):
        """Kinetic energy of each link [J], shape (len(model.link_names),): ½VᵀIV plus its joint's rotor; sums to K."""
        energy = np.empty(len(self._model.link_names))
        self.write_link_energy(energy)
        return energy

    def write_link_energy(self, energy):
        """Write :attr:`link_energy` into an array of its shape, for who has one already.

        Raises
        ------
        InputError
            A link's energy overflows, which it can where K does not: with an inertia that is no rigid body's.
        """
        if not sweeps.link_energies(self._model.bodies, self._model.links, self._states[None], energy[None]):
            raise InputError("qd is too large: the kinetic energy of a link overflows.")

    @_Lazy
    def nu_dot(self):
        """dν/dt = ε − C − ε_g + ℓJᵀf_ext − ε_fric [J^½/s] (eq. 3.1), of those terms asked for; None without tau."""
        if self.epsilon is None:
            return None
        rate = self.epsilon - self.coriolis - self.gravity
        if self.external is not None:
            rate = rate + self.external
        return rate if self.friction is None else rate - self.friction

    @_Lazy
    def xi_dot(self):
        """dξ/dt = D⁻¹(κ − κ_g − C_ξ + …) [rad/s², m/s²] (eq. 7.9), of the terms that nu_dot has; None without tau."""
        if self.epsilon is None:
            return None
        moments = np.sqrt(self.articulated_inertia) * (self.nu_dot + self.coriolis)
        return (moments - self.coriolis_unnormalized) / self.articulated_inertia

    @_Lazy
    def effort_power(self):
        """νᵀ(ε − ε_g) [W]: :attr:`power` of the efforts and gravity alone; None without tau."""
        return self._energy_and_power[1] if self._with_tau else None

    @_Lazy
    def _energy_and_power(self):
        """K and effort_power."""
        return sweeps.energy_and_power(self._states, self._model.nv)

    @_Lazy
    def power(self):
        """dK/dt = νᵀ(ε − ε_g + ℓJᵀf_ext − ε_fric) [W] (Lemma 7.2), of those terms that were asked for; None without tau."""
        if self.epsilon is None:
            return None
        return float(self.nu @ (self.nu_dot + self.coriolis))


class BatchEvaluation(Evaluation):
    """What :class:`Evaluation` holds, of T states at once: every attribute has a leading axis of length T.

    Numbers such as kinetic_energy are arrays of shape (T,). There are no wrenches.
    """

    def __len__(self):
        return len(self._states)

    @property
    def rows(self):
        """The rows that the sweep has filled, see :mod:`diag_dynamics.sweeps.workspace`, shape (ROWS, nq)."""
        return self._states

    def _take(self, k):
        return self._states[:, k, : self._model.nv]

    @_Lazy
    def kinetic_energy(self):
        """K [J], shape (T,)."""
        return 0.5 * np.einsum("tk,tk->t", self.nu, self.nu)

    @_Lazy
    def base_energy(self):
        """Sum of the shares of a floating base [J], shape (T,)."""
        return self.energy_share[:, : 6 if self._model.floating_base else 0].sum(axis=1)

    @_Lazy
    def link_energy(self):
        """Kinetic energy of each link [J], shape (T, len(model.link_names))."""
        energy = np.empty((len(self), len(self._model.link_names)))
        if not sweeps.link_energies(self._model.bodies, self._model.links, self._states, energy):
            raise InputError("QD is too large: the kinetic energy of a link overflows.")
        return energy

    @_Lazy
    def power(self):
        """dK/dt [W], shape (T,); None without TAU."""
        return None if self.epsilon is None else np.einsum("tk,tk->t", self.nu, self.nu_dot + self.coriolis)

    @_Lazy
    def effort_power(self):
        """νᵀ(ε − ε_g) [W], shape (T,); None without TAU."""
        return None if self.epsilon is None else np.einsum("tk,tk->t", self.nu, self.epsilon - self.gravity)


class Factors(NamedTuple):
    """Factors of the mass matrix at one configuration, M = m mᵀ = unit diag(D) unitᵀ and M⁻¹ = ℓᵀℓ (Identity 4.1).

    m and unit are upper triangular in the order of ``model.dof_names``, which is base to tip: they are the factors of the
    dense M = U D Uᵀ. [i, j] is exactly zero unless i = j, joint i carries joint j, or both are of one joint, or of one
    coupled group; a group carries what any of its joints carries.

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
