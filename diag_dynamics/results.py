# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of DiagonalDynamics: quantities at one state or many, factors of the mass matrix."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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


def _number(row: int, doc: str) -> _Quantity[float]:
    return _quantity(lambda s: s._state.item(row, 0), doc)


def _number_with_tau(row: int, doc: str) -> _Quantity[float | None]:
    return _quantity(lambda s: s._state.item(row, 0) if s._with_tau else None, doc)


class Evaluation:
    """Quantities of the diagonalized equations of motion at one state, returned by `evaluate`.

    They show how energy, torque and Coriolis terms split among joints. Arrays have shape (nv,)
    unless stated otherwise.

    The equation of motion is ``d(nu)/dt + coriolis + gravity = epsilon``, with ``+ external`` on
    the right and ``+ friction`` on the left if these were requested (Jain and Rodriguez 1995, eq.
    3.1, with gravity, wrenches and friction as separate terms).

    Results are read-only and permanent. `link_energy` is computed on each access; all other
    attributes are read from memory.
    """

    __slots__ = ("_external", "_friction", "_model", "_rows", "_state", "_with_tau")

    def __init__(
        self,
        model: RobotModel,
        state: Array,
        with_tau: bool,
        external: Term = None,
        friction: Term = None,
    ) -> None:
        # `state` has the rows of sweeps.workspace, of length max(nq, 1).
        self._model = model
        self._state = state
        self._rows: Any = state[:, : model.nv]
        self._with_tau = with_tau
        self._external = external
        self._friction = friction

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
    nu_dot = _row_with_tau(
        ws.NU_DOT,
        """Rate dν/dt = ε − C − ε_g + ℓJᵀf_ext − ε_fric [J^½/s] (eq. 3.1); None without tau.

        Wrenches and friction count if they were requested.
        """,
    )
    xi_dot = _row_with_tau(
        ws.XI_DOT,
        """Rate dξ/dt = D⁻¹(κ − κ_g − C_ξ + …) [rad/s², m/s²] (eq. 7.9); None without tau.

        The other terms are D^½ times those of `nu_dot`.
        """,
    )
    kinetic_energy = _number(ws.KINETIC_ENERGY, "K = ½νᵀν [J].")
    energy_share = _row(
        ws.ENERGY_SHARE,
        """Kinetic energy ½ν_k² of each total rate [J]; sums to K. It is not the energy of link k.

        The six shares of a floating base depend on the order of its twist's components; their sum
        `base_energy` does not.
        """,
    )

    @property
    def base_energy(self) -> float:
        """Sum of the six energy shares of a floating base [J]; 0 with a fixed base.

        It is ½V*ᵀPV*, V* being the total rates' common part and P the articulated inertia of the
        whole robot.
        """
        return self._state.item(ws.BASE_ENERGY, 0) if self._model.floating_base else 0.0

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
        return read_only(energy[0] if self.nu.ndim == 1 else energy)

    power = _number_with_tau(
        ws.POWER,
        """Power dK/dt = νᵀ(ε − ε_g + ℓJᵀf_ext − ε_fric) [W] (Lemma 7.2); None without tau.

        Wrenches and friction count if they were requested.
        """,
    )
    effort_power = _number_with_tau(
        ws.EFFORT_POWER,
        "Power νᵀ(ε − ε_g) [W] of efforts and gravity alone; None without tau.",
    )

    model: _Quantity[RobotModel] = _quantity(attrgetter("_model"), "Model of the robot.")
    rows: _Quantity[Array] = _quantity(
        attrgetter("_state"),
        """Memory with the rows of `diag_dynamics.sweeps.workspace`.

        Its shape is (N_ROWS, max(nq, 1)); that of a batch (N_RESULTS, T, nv).
        """,
    )

    def _motion(self) -> tuple[Array, Array]:
        """Return positions and rates, one row per state."""
        return self._state[ws.POSITIONS][None], self._state[ws.RATES][None]

    def to_dict(self) -> dict[str, Any]:
        """Return all quantities by name; None for absent ones."""
        return {name: getattr(self, name) for name in NAMES}

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of '{self._model.name}': shape {self.nu.shape}>"

    def __reduce__(self) -> tuple[Any, ...]:
        terms = self._with_tau, self._external, self._friction
        return evaluation_of, (self._model, self._state, *terms)


NAMES = tuple(
    name
    for name, value in vars(Evaluation).items()
    if isinstance(value, property) and name not in ("model", "rows")
)
"""Quantities of `to_dict`."""


class _BatchRows(dict[int, Array]):
    """Results of many states by row; energy shares and rates are computed on first access."""

    terms: tuple[Term, Term] = None, None

    def __missing__(self, row: int) -> Array:
        if row == ws.ENERGY_SHARE:
            self[row] = read_only(energy_shares(self[ws.NU]))
        else:
            self[ws.NU_DOT], self[ws.XI_DOT] = map(read_only, rates(self, *self.terms))
        return self[row]


class BatchEvaluation(Evaluation):
    """All quantities of :class:`Evaluation` at T states, with a leading axis of length T.

    Numbers such as `kinetic_energy` are arrays of shape (T,). An index returns the Evaluation of
    one state.
    """

    __slots__ = ("_parts",)

    _parts: BatchMemory  # read-only

    def __init__(
        self,
        model: RobotModel,
        memory: BatchMemory,
        with_tau: bool,
        external: Term = None,
        friction: Term = None,
    ) -> None:
        for part in (*memory, external, friction):
            if part is not None:
                read_only(part)
        self._parts = memory
        self._model = model
        self._state = memory.results
        self._rows = _BatchRows(enumerate(self._state))
        self._rows.update(enumerate(self._parts.numbers, ws.KINETIC_ENERGY))
        if not model.floating_base:
            self._rows[ws.BASE_ENERGY] = read_only(np.zeros(len(self)))
        self._with_tau = with_tau
        self._external = external
        self._friction = friction
        self._rows.terms = external, friction

    kinetic_energy = _row(ws.KINETIC_ENERGY, "K [J], shape (T,).")  # type: ignore[assignment]
    base_energy = _row(  # type: ignore[assignment]
        ws.BASE_ENERGY,
        "Sum of the energy shares of a floating base [J], shape (T,); 0 with a fixed base.",
    )
    power = _row_with_tau(  # type: ignore[assignment]  # an array or None, not a float
        ws.POWER, "Power dK/dt [W], shape (T,); None without TAU."
    )
    effort_power = _row_with_tau(  # type: ignore[assignment]  # as power
        ws.EFFORT_POWER, "Power νᵀ(ε − ε_g) [W], shape (T,); None without TAU."
    )

    def _motion(self) -> tuple[Array, Array]:
        return self._parts.positions, self._parts.rates

    def __len__(self) -> int:
        return len(self._parts.positions)

    def __iter__(self) -> Iterator[Evaluation]:
        return (self[t] for t in range(len(self)))

    def __getitem__(self, t: int) -> Evaluation:
        results, numbers, positions, speeds = self._parts
        if not isinstance(t, (int, np.integer)):
            raise InputError(f"{t!r} is no index of a batch, expected a whole number.")
        if not -len(self) <= t < len(self):
            raise IndexError(f"state {t} of a batch of {len(self)}")
        nv = self._model.nv
        nq = self._model.nq
        state = np.empty((ws.N_ROWS, max(nq, 1)))
        state[: ws.N_RESULTS, :nv] = results[:, t]
        state[ws.ENERGY_SHARE, :nv] = energy_shares(self.nu[t])
        state[ws.KINETIC_ENERGY : ws.KINETIC_ENERGY + ws.N_NUMBERS, 0] = numbers[:, t]
        state[ws.POSITIONS, :nq] = positions[t]
        state[ws.RATES, :nv] = speeds[t]
        external, friction = (None if x is None else x[t] for x in (self._external, self._friction))
        rows = state[:, :nv]
        rows[ws.NU_DOT], rows[ws.XI_DOT] = rates(rows, external, friction)
        return evaluation_of(self._model, state, self._with_tau, external, friction)

    def __reduce__(self) -> tuple[Any, ...]:
        terms = self._with_tau, self._external, self._friction
        return type(self), (self._model, self._parts, *terms)


class BatchMemory(NamedTuple):
    """Memory for the results of T states."""

    results: Array  # (N_RESULTS, T, nv): rows of sweeps.workspace from NU on
    numbers: Array  # (N_NUMBERS, T): those from KINETIC_ENERGY on
    positions: Array  # (T, nq)
    rates: Array  # (T, nv)

    @classmethod
    def allocate(cls, model: RobotModel, count: int) -> BatchMemory:
        """Return uninitialized memory for `count` states."""
        return cls(
            np.empty((ws.N_RESULTS, count, model.nv)),
            np.empty((ws.N_NUMBERS, count)),
            np.empty((count, model.nq)),
            np.empty((count, model.nv)),
        )


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

    @classmethod
    def allocate(cls, count: int) -> ExternalWrench:
        """Return uninitialized memory for the results of `count` states."""
        return cls(
            wrench=np.empty((count, 6)),
            covariance=np.empty((count, 6, 6)),
            directions=np.empty((count, 6, 6)),
            deviation=np.empty((count, 6)),
            observed=np.empty((count, 6), dtype=bool),
            chi_square=np.empty(count),
        )

    def as_read_only(self) -> ExternalWrench:
        """Mark all arrays as read-only and return the wrench."""
        for array in self:
            array.setflags(write=False)
        return self


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
        if names.ndim == 0:
            return cls(str(names), float(confidence), probability, links, float(rows[0]))
        return cls(names, read_only(confidence), probability, links, rows[:, 0])


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


def energy_shares(nu: Array) -> Array:
    """Return ½ν_k² [J] of total rates ν [J^½]."""
    return 0.5 * nu * nu


def rates(rows: Any, external: Term, friction: Term) -> tuple[Array, Array]:
    """Return ν̇ and ξ̇ of one state or many from their other rows."""
    D = rows[ws.ARTICULATED_INERTIA]
    C = rows[ws.CORIOLIS]
    with np.errstate(over="ignore", invalid="ignore"):
        nu_dot = rows[ws.EPSILON] - C - rows[ws.GRAVITY]
        if external is not None:
            nu_dot += external
        if friction is not None:
            nu_dot -= friction
        return nu_dot, (np.sqrt(D) * (nu_dot + C) - rows[ws.CORIOLIS_UNNORMALIZED]) / D


def add_power(nu: Array, power: Array, external: Term, friction: Term) -> None:
    """Add the power of wrenches and friction to that of efforts, at one state or many."""
    with np.errstate(over="ignore", invalid="ignore"):
        if external is not None:
            power += np.einsum("...k,...k->...", nu, external)
        if friction is not None:
            power -= np.einsum("...k,...k->...", nu, friction)


def read_only(array: Array) -> Array:
    """Mark an array as read-only and return it."""
    array.setflags(False)  # type: ignore[call-arg]  # by keyword it takes twice as long
    return array


def evaluation_of(
    model: RobotModel, state: Array, with_tau: bool, external: Term, friction: Term
) -> Evaluation:
    """Return the permanent result of a state, whose arrays are read-only from now on."""
    for term in (external, friction):
        if term is not None:
            read_only(term)
    return Evaluation(model, read_only(state), with_tau, external, friction)
