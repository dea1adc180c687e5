# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of DiagonalDynamics: quantities at one state or many, factors of the mass matrix."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from diag_dynamics.arrays import Array, BoolArray
from diag_dynamics.exceptions import InputError
from diag_dynamics.sweeps import evaluation
from diag_dynamics.sweeps import workspace as ws

if TYPE_CHECKING:
    from diag_dynamics.model import RobotModel

    _T = TypeVar("_T")

    class _Quantity(Generic[_T]):
        """A property of a type that mypy knows."""

        def __get__(self, result: object, kind: object = None) -> _T: ...


Term: TypeAlias = Array | None


def _quantity(read: Callable[[Any], _T], doc: str) -> _Quantity[_T]:
    return property(read, doc=doc)  # type: ignore[return-value]


def _row(row: int, doc: str) -> _Quantity[Array]:
    return _quantity(lambda s: s._rows[row], doc)


def _row_with_tau(row: int, doc: str) -> _Quantity[Term]:
    return _quantity(lambda s: s._rows[row] if s._with_tau else None, doc)


def _number(row: int, doc: str, with_tau: bool = False) -> _Quantity[Any]:
    def read(s: Evaluation) -> Any:
        if with_tau and not s._with_tau:
            return None
        return s._memory[0][row - ws.KINETIC_ENERGY] if s._memory else s._state.item(row, 0)

    return _quantity(read, doc)


class Evaluation:
    """Quantities of the diagonalized equations of motion at one state, returned by `evaluate`.

    They show how energy, torque and Coriolis terms split among joints. Arrays have shape (nv,)
    unless stated otherwise. Those of T states have a leading axis T, and numbers such as
    `kinetic_energy` are arrays of shape (T,).

    The equation of motion is ``d(nu)/dt + coriolis + gravity = epsilon``, with ``+ external`` on
    the right and ``+ friction`` on the left if these were requested (Jain and Rodriguez 1995, eq.
    3.1, with gravity, wrenches and friction as separate terms).

    Results are read-only and permanent. `nu_dot`, `xi_dot`, `energy_share`, `link_energy` and the
    power of wrenches and friction are new arrays at each access; all other attributes are read from
    memory.
    """

    __slots__ = ("_external", "_friction", "_memory", "_model", "_rows", "_state", "_with_tau")

    def __init__(
        self,
        model: RobotModel,
        state: Array,
        with_tau: bool,
        external: Term = None,
        friction: Term = None,
        memory: Sequence[Array] = (),
    ) -> None:
        # `state` has the rows of sweeps.workspace, of length max(nq, 1); of many states it is the
        # first array of batch_memory, and `memory` has the others.
        state.setflags(False)  # type: ignore[call-arg]  # by keyword it takes twice as long
        self._model = model
        self._state = state
        self._rows = state if state.shape[-1] == model.nv else state[:, : model.nv]
        self._with_tau = with_tau
        self._external = None if external is None else read_only(external)
        self._friction = None if friction is None else read_only(friction)
        self._memory = memory
        for array in memory:
            read_only(array)

    nu = _row(ws.NU, "Total joint rates ν = mᵀq̇ [J^½] (Table 1).")
    xi = _row(ws.XI, "Un-normalized total joint rates ξ = D^−½ν [rad/s, m/s] (eq. 7.7).")
    epsilon = _row_with_tau(
        ws.EPSILON,
        """Working moments ε = ℓτ [J^½/s] (Table 2); None without tau.

        They include the efforts that balance gravity.
        """,
    )
    kappa = _row_with_tau(
        ws.KAPPA,
        "Un-normalized working moments κ = D^½ε [N m, N] (Table 2); None without tau.",
    )
    coriolis = _row(
        ws.CORIOLIS,
        "Coriolis term C(q, ν) [J^½/s] (Algorithm 7.1) without gravity; νᵀC = 0 (Lemma 7.1).",
    )
    coriolis_unnormalized = _row(
        ws.CORIOLIS_UNNORMALIZED,
        "C_ξ(q, ξ) of D ξ̇ + C_ξ = κ [N m, N] (Lemma 7.3), without gravity.",
    )
    gravity = _row(
        ws.GRAVITY,
        "Gravity term ε_g = ℓ g(q) [J^½/s]; un-normalized it is κ_g = D^½ε_g [N m, N].",
    )
    articulated_inertia = _row(
        ws.ARTICULATED_INERTIA,
        """Articulated joint inertias D [kg m², kg] (Algorithm 4.1).

        For a joint of several degrees of freedom, a floating base and a coupled group they are the
        diagonal of the factor U D Uᵀ of the joint's block, in the order of the degrees of freedom.
        """,
    )
    articulated_inertia_rate = _row(
        ws.ARTICULATED_INERTIA_RATE,
        "Rate Ḋ of the articulated inertias along the motion [kg m²/s, kg/s] (eq. 7.2).",
    )
    external: _Quantity[Term] = _quantity(
        attrgetter("_external"),
        "Term of wrenches ℓ Jᵀf_ext [J^½/s]; None without wrenches.",
    )
    friction: _Quantity[Term] = _quantity(
        attrgetter("_friction"),
        "Friction term ε_fric = ℓ τ_fric [J^½/s], on the side of C; None unless requested.",
    )

    kinetic_energy = _number(ws.KINETIC_ENERGY, "K = ½νᵀν [J].")
    effort_power = _number(
        ws.EFFORT_POWER,
        "Power νᵀ(ε − ε_g) [W] of efforts and gravity alone; None without tau.",
        with_tau=True,
    )
    _base_energy = _number(ws.BASE_ENERGY, "Energy of the first six total rates [J].")

    @property
    def nu_dot(self) -> Term:
        """Rate dν/dt = ε − C − ε_g + ℓJᵀf_ext − ε_fric [J^½/s] (eq. 3.1); None without tau.

        Wrenches and friction count if they were requested.
        """
        if self.epsilon is None:
            return None
        rate = self.epsilon - self.coriolis - self.gravity
        if self._external is not None:
            rate += self._external
        if self._friction is not None:
            rate -= self._friction
        return rate

    @property
    def xi_dot(self) -> Term:
        """Rate dξ/dt = D⁻¹(κ − κ_g − C_ξ + …) [rad/s², m/s²] (eq. 7.9); None without tau.

        The other terms are D^½ times those of `nu_dot`.
        """
        rate = self.nu_dot
        if rate is None:
            return None
        D = self.articulated_inertia
        return (np.sqrt(D) * (rate + self.coriolis) - self.coriolis_unnormalized) / D

    @property
    def energy_share(self) -> Array:
        """Kinetic energy ½ν_k² of each total rate [J]; sums to K. It is not the energy of link k.

        The six shares of a floating base depend on the order of its twist's components; their sum
        `base_energy` does not.
        """
        return 0.5 * self.nu * self.nu if self._memory else self._rows[ws.ENERGY_SHARE]

    @property
    def base_energy(self) -> Any:
        """Sum of the six energy shares of a floating base [J]; 0 with a fixed base.

        It is ½V*ᵀPV*, V* being the total rates' common part and P the articulated inertia of the
        whole robot.
        """
        return self._base_energy if self._model.floating_base else 0.0 * self.kinetic_energy

    @property
    def link_energy(self) -> Array:
        """Kinetic energy of each link [J], shape (links,): ½VᵀIV plus its joint's rotor; sums to K.

        It raises InputError if a link's energy overflows, as it may although K does not if an
        inertia is not that of a rigid body.
        """
        model = self._model
        Q, QD = self._motion()
        energy = np.empty((len(Q), len(model.link_names)))
        workspace = model.new_workspace()
        if not evaluation.link_energies(workspace.robot, model.links, Q, QD, energy):
            raise InputError("qd is too large: the kinetic energy of a link overflows.")
        return energy[0] if self.nu.ndim == 1 else energy

    @property
    def power(self) -> Any:
        """Power dK/dt = νᵀ(ε − ε_g + ℓJᵀf_ext − ε_fric) [W] (Lemma 7.2); None without tau.

        Wrenches and friction count if they were requested.
        """
        power = self.effort_power
        if power is None or (self._external is None and self._friction is None):
            return power
        with np.errstate(over="ignore", invalid="ignore"):
            if self._external is not None:
                power = power + np.einsum("...k,...k->...", self.nu, self._external)
            if self._friction is not None:
                power = power - np.einsum("...k,...k->...", self.nu, self._friction)
        return power

    model: _Quantity[RobotModel] = _quantity(attrgetter("_model"), "Model of the robot.")
    rows: _Quantity[Array] = _quantity(
        attrgetter("_state"),
        """Memory with the rows of `diag_dynamics.sweeps.workspace`.

        Its shape is (N_ROWS, max(nq, 1)); that of many states (N_RESULTS, T, nv).
        """,
    )

    def _motion(self) -> tuple[Array, Array]:
        """Return positions and rates, one row per state."""
        if self._memory:
            return self._memory[1], self._memory[2]
        return self._state[ws.POSITIONS][None], self._state[ws.RATES][None]

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of '{self._model.name}': shape {self.nu.shape}>"

    def __reduce__(self) -> tuple[Any, ...]:
        terms = self._with_tau, self._external, self._friction
        return type(self), (self._model, self._state, *terms, self._memory)


def batch_memory(model: RobotModel, count: int) -> list[Array]:
    """Return uninitialized memory for `count` states, see batch.evaluate_many."""
    shapes = (ws.N_RESULTS, count, model.nv), (ws.N_NUMBERS, count)
    return [np.empty(shape) for shape in (*shapes, (count, model.nq), (count, model.nv))]


class Factors(NamedTuple):
    """Factors of the mass matrix: M = m mᵀ = unit diag(D) unitᵀ and M⁻¹ = ℓᵀℓ (Identity 4.1).

    They are read-only. m and unit are upper triangular in the order of ``model.dof_names``, base to
    tip: the factors of the dense M = U D Uᵀ. Entry [i, j] is exactly zero unless i = j, joint i
    carries joint j, or both belong to one joint or to one coupled group. A group carries the joints
    that any of its joints carries.

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

    m: Array
    l: Array  # noqa: E741  # the name in the paper
    unit: Array
    D: Array

    def __repr__(self) -> str:
        return f"<Factors of M: shape {self.m.shape}>"


class Momentum(NamedTuple):
    """Generalized momentum and its rate without efforts, ṗ = τ + rate; of one state or rows.

    Attributes
    ----------
    p : ndarray, shape (nv,) or (T, nv)
        M q̇ [N m s, N s].
    rate : ndarray, shape (nv,) or (T, nv)
        C_sᵀq̇ − g [N m, N].
    """

    p: Array
    rate: Array


class ExternalWrench(NamedTuple):
    """A wrench estimated from external torque, and its covariance.

    Results of many states have a leading axis T. Force comes first, then moment. Arrays are
    read-only. See docs/external-wrench.md.

    Attributes
    ----------
    wrench : ndarray, shape (6,)
        f̂ [N, N m] of the environment on the robot: zero along the directions that are not
        observed.
    covariance : ndarray, shape (6, 6)
        Σ deviation² d dᵀ over the observed directions d [N², N² m, N² m²]. Variances of components
        in which an unobserved direction has a part are infinite.
    directions : ndarray, shape (6, 6)
        Rows are wrenches d [N, N m] with independent estimates, orthonormal in units of
        `max_deviation`. The best known one is the first.
    deviation : ndarray, shape (6,)
        Standard deviation of the estimate along each direction, as a fraction of d; inf if no joint
        moves along it, or if it is not estimated.
    observed : ndarray of bool, shape (6,)
        Whether it is at most 1; without a covariance, whether it is finite.
    chi_square : float
        Squared length of Σ^−½(τ̂ − Jᵀf̂): what the wrench does not explain. For a contact at the
        point its mean is nv less the number of observed directions.
    """

    wrench: Array
    covariance: Array
    directions: Array
    deviation: Array
    observed: BoolArray
    chi_square: Any


class TouchedLink(NamedTuple):
    """The link that external torque points to; of many states with a leading axis T.

    Attributes
    ----------
    link : str, or ndarray of str, shape (T,)
        The most probable link; "" if χ² is within the noise.
    confidence : float
        Its probability if exactly one link is touched; 0 without a link.
    probability : ndarray, shape (number of links,)
        Of each link; they add up to 1, or are all 0 without a link.
    links : tuple of str
        Links that may be touched: of those fixed to each other the first one.
    chi_square : float
        τ̂ᵀΣ⁻¹τ̂; of noise alone its mean is nv.
    """

    link: Any
    confidence: Any
    probability: Array
    links: tuple[str, ...]
    chi_square: Any

    @classmethod
    def of_rows(cls, links: tuple[str, ...], rows: Array) -> TouchedLink:
        """Return the results in rows of sweeps.external.touched_link."""
        probability = read_only(rows)[..., 1:]
        confidence = probability.max(axis=-1)
        names = np.array([*links, ""])[np.where(confidence > 0.0, probability.argmax(axis=-1), -1)]
        return cls(names, confidence, probability, links, rows[..., 0][()])


_Result = TypeVar("_Result", "ExternalWrench", "TouchedLink")


def expand(result: _Result, rows: BoolArray) -> _Result:
    """Return results of the true rows as those of all: NaN, False or "" in the others."""

    def expanded(x: Any) -> Any:
        if isinstance(x, tuple):
            return x
        empty: Any = {"b": False, "U": ""}.get(x.dtype.kind, np.nan)
        full = np.full((len(rows), *x.shape[1:]), empty, x.dtype)
        full[rows] = x
        return read_only(full)

    return type(result)(*map(expanded, result))


def read_only(array: Array) -> Array:
    """Mark an array as read-only and return it."""
    array.setflags(False)  # type: ignore[call-arg]  # by keyword it takes twice as long
    return array
