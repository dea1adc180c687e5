# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results of DiagonalDynamics: all quantities at one state or at many, and the factors of the mass matrix."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require
from diag_dynamics.sweeps import evaluation
from diag_dynamics.sweeps import workspace as ws

if TYPE_CHECKING:
    from diag_dynamics.model import RobotModel

PER_DOF = (
    "nu",
    "xi",
    "epsilon",
    "kappa",
    "coriolis",
    "coriolis_unnormalized",
    "gravity",
    "articulated_inertia",
    "articulated_inertia_rate",
    "external",
    "friction",
    "nu_dot",
    "xi_dot",
    "energy_share",
)
"""Quantities with one entry per degree of freedom."""

NAMES = (*PER_DOF[:-1], "kinetic_energy", "energy_share", "base_energy", "link_energy", "power", "effort_power")
"""Quantities of `to_dict` and `repr`, in this order."""

# Rows of the results, as global names: reading `ws.NU` takes twice as long as reading the row.
_NU, _XI, _EPSILON, _KAPPA = ws.NU, ws.XI, ws.EPSILON, ws.KAPPA
_CORIOLIS, _CORIOLIS_UNNORMALIZED, _GRAVITY = ws.CORIOLIS, ws.CORIOLIS_UNNORMALIZED, ws.GRAVITY
_D, _D_RATE = ws.ARTICULATED_INERTIA, ws.ARTICULATED_INERTIA_RATE
_NU_DOT, _XI_DOT, _ENERGY_SHARE = ws.NU_DOT, ws.XI_DOT, ws.ENERGY_SHARE
_KINETIC_ENERGY, _BASE_ENERGY = ws.KINETIC_ENERGY, ws.BASE_ENERGY
_POWER, _EFFORT_POWER = ws.POWER, ws.EFFORT_POWER


class Evaluation:
    """All quantities at one state; arrays have shape (nv,) unless stated otherwise.

    The equation of motion is ``d(nu)/dt + coriolis + gravity = epsilon``, with ``+ external`` on the right and
    ``+ friction`` on the left if these were requested (Jain and Rodriguez 1995, eq. 3.1, with gravity, wrenches and
    friction as separate terms).

    Results are read-only and permanent, except those of :meth:`DiagonalDynamics.new_evaluation`: these hold the last
    evaluation, and NaN after an error. ``copy.copy`` makes a permanent copy. Every attribute is read from memory, but
    `link_energy`, which is computed on each access.
    """

    __slots__ = ("_external", "_friction", "_memory", "_model", "_rows", "_state", "_with_tau")

    _model: RobotModel
    _state: Array  # rows of sweeps.workspace, of length max(nq, 1)
    _rows: Array | Sequence[Array]  # their first nv entries
    _with_tau: bool
    _external: Array | None
    _friction: Array | None
    _memory: Any  # memory that evaluate may write; not set in permanent results

    def __init__(
        self,
        model: RobotModel,
        state: Array,
        rows: Array | Sequence[Array],
        with_tau: bool,
        external: Array | None = None,
        friction: Array | None = None,
    ) -> None:
        self._model, self._state, self._rows = model, state, rows
        self._with_tau, self._external, self._friction = with_tau, external, friction

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (self._model, self._state.copy(), self._with_tau, self._external, self._friction)

    def __repr__(self) -> str:
        with np.printoptions(precision=6, threshold=60, linewidth=10**6):
            lines = [f"  {name}={self._text(name)}," for name in NAMES]
        return "\n".join([f"{type(self).__name__}(", *lines, ")"])

    def _text(self, name: str) -> str:
        try:
            value = getattr(self, name)
        except InputError as error:
            return f"<{error}>"
        return np.array2string(value, separator=", ") if isinstance(value, np.ndarray) else str(value)

    def to_dict(self) -> dict[str, Any]:
        """Return all quantities by name; None for absent ones."""
        return {name: getattr(self, name) for name in NAMES}

    def to_frame(self) -> Any:
        """Return the quantities per degree of freedom as a pandas DataFrame: one row per degree of freedom."""
        values = {name: getattr(self, name) for name in PER_DOF}
        columns = {name: value for name, value in values.items() if value is not None}
        return require("pandas", "to_frame").DataFrame(columns, index=list(self._model.dof_names))

    def set_terms(self, with_tau: bool, external: Array | None = None, friction: Array | None = None) -> None:
        """Set the terms of an evaluation into the memory of this result."""
        self._with_tau, self._external, self._friction = with_tau, external, friction

    @property
    def model(self) -> RobotModel:
        """Robot of these results."""
        return self._model

    @property
    def rows(self) -> Array:
        """Rows of `diag_dynamics.sweeps.workspace`, shape (ROWS, max(nq, 1)); of a batch (RESULTS, T, nv)."""
        return self._state

    @property
    def nu(self) -> Array:
        """Total joint rates ν = mᵀq̇ [J^½] (Table 1)."""
        return self._rows[_NU]

    @property
    def xi(self) -> Array:
        """Un-normalized total joint rates ξ = D^−½ν [rad/s, m/s] (eq. 7.7)."""
        return self._rows[_XI]

    @property
    def epsilon(self) -> Array | None:
        """Working moments ε = ℓτ [J^½/s] (Table 2), including the efforts that balance gravity; None without tau."""
        return self._rows[_EPSILON] if self._with_tau else None

    @property
    def kappa(self) -> Array | None:
        """Un-normalized working moments κ = D^½ε [N m, N] (Table 2); None without tau."""
        return self._rows[_KAPPA] if self._with_tau else None

    @property
    def coriolis(self) -> Array:
        """Coriolis term C(q, ν) [J^½/s] (Algorithm 7.1), without gravity; νᵀC = 0 (Lemma 7.1)."""
        return self._rows[_CORIOLIS]

    @property
    def coriolis_unnormalized(self) -> Array:
        """C_ξ(q, ξ) of D ξ̇ + C_ξ = κ [N m, N] (Lemma 7.3), without gravity."""
        return self._rows[_CORIOLIS_UNNORMALIZED]

    @property
    def gravity(self) -> Array:
        """ε_g = ℓ g(q) [J^½/s]; its un-normalized form is κ_g = D^½ε_g [N m, N]."""
        return self._rows[_GRAVITY]

    @property
    def articulated_inertia(self) -> Array:
        """D [kg m², kg] (Algorithm 4.1).

        For a joint of several degrees of freedom, a floating base and a coupled group it is the diagonal of the factor
        U D Uᵀ of the joint's block, in the order of the degrees of freedom.
        """
        return self._rows[_D]

    @property
    def articulated_inertia_rate(self) -> Array:
        """Ḋ along the motion [kg m²/s, kg/s] (7.2)."""
        return self._rows[_D_RATE]

    @property
    def external(self) -> Array | None:
        """ℓ Jᵀf_ext [J^½/s]; None without wrenches."""
        return self._external

    @property
    def friction(self) -> Array | None:
        """ε_fric = ℓ τ_fric [J^½/s], on the side of C; None unless requested."""
        return self._friction

    @property
    def nu_dot(self) -> Array | None:
        """dν/dt = ε − C − ε_g + ℓJᵀf_ext − ε_fric [J^½/s] (eq. 3.1), of the requested terms; None without tau."""
        return self._rows[_NU_DOT] if self._with_tau else None

    @property
    def xi_dot(self) -> Array | None:
        """dξ/dt = D⁻¹(κ − κ_g − C_ξ + …) [rad/s², m/s²] (eq. 7.9), of the terms of nu_dot; None without tau."""
        return self._rows[_XI_DOT] if self._with_tau else None

    @property
    def energy_share(self) -> Array:
        """½ν_k² of each total rate [J]; sums to K. It is not the energy of link k.

        The six shares of a floating base depend on the order of its twist's components; their sum `base_energy` does not.
        """
        return self._rows[_ENERGY_SHARE]

    @property
    def kinetic_energy(self) -> float:
        """K = ½νᵀν [J]."""
        return self._state.item(_KINETIC_ENERGY, 0)

    @property
    def base_energy(self) -> float:
        """Sum of the six energy shares of a floating base [J]; 0 with a fixed base.

        It is ½V*ᵀPV* of the total rates' common part V*, with the articulated inertia P of the whole robot.
        """
        return self._state.item(_BASE_ENERGY, 0) if self._model.floating_base else 0.0

    @property
    def power(self) -> float | None:
        """dK/dt = νᵀ(ε − ε_g + ℓJᵀf_ext − ε_fric) [W] (Lemma 7.2), of the requested terms; None without tau."""
        return self._state.item(_POWER, 0) if self._with_tau else None

    @property
    def effort_power(self) -> float | None:
        """νᵀ(ε − ε_g) [W]: :attr:`power` of efforts and gravity alone; None without tau."""
        return self._state.item(_EFFORT_POWER, 0) if self._with_tau else None

    @property
    def link_energy(self) -> Array:
        """Kinetic energy of each link [J], shape (len(model.link_names),): ½VᵀIV plus its joint's rotor; sums to K.

        It raises InputError if a link's energy overflows. With an inertia of no rigid body it may, although K does not.
        """
        energy = np.empty(self._link_energy_shape)
        self.write_link_energy(energy)
        return read_only(energy)

    def write_link_energy(self, energy: Array) -> None:
        """Write :attr:`link_energy` into an array of its shape."""
        shape = self._link_energy_shape
        if energy.shape != shape or not energy.flags.writeable:  # compiled code checks neither
            kind = "" if energy.flags.writeable else "read-only "
            raise InputError(
                f"energy is a {kind}array of shape {energy.shape}, expected one of shape {shape} to write into."
            )
        model, (Q, QD), energies = self._model, self._motion, energy.reshape(-1, shape[-1])
        if not evaluation.link_energies(model.bodies, model.links, Q, QD, energies):
            raise InputError(f"{self._RATES} is too large: the kinetic energy of a link overflows.")

    _RATES = "qd"

    @property
    def _link_energy_shape(self) -> tuple[int, ...]:
        return (len(self._model.link_names),)

    @property
    def _motion(self) -> tuple[Array, Array]:
        """Positions and rates, one row per state."""
        return self._state[ws.POSITIONS][None], self._state[ws.RATES][None]


class BatchEvaluation(Evaluation):
    """All quantities of :class:`Evaluation` at T states: every attribute has a leading axis of length T.

    Numbers such as kinetic_energy are arrays of shape (T,). A batch is a sequence: an index returns the Evaluation of one
    state, a slice a batch. A batch of :meth:`DiagonalDynamics.new_batch` holds the last batch evaluated into it.
    """

    __slots__ = ("_numbers", "_positions", "_rates")

    _numbers: Array
    _positions: Array
    _rates: Array
    _RATES = "QD"

    def __init__(
        self,
        model: RobotModel,
        memory: BatchMemory,
        with_tau: bool,
        external: Array | None = None,
        friction: Array | None = None,
        *,
        keep: bool = False,
    ) -> None:
        """Show memory of a sweep; it may be written again if `keep`."""
        for term in (external, friction):
            if term is not None:
                read_only(term)
        if keep:
            self._memory = memory
        results, self._numbers, self._positions, self._rates = (read_only(part.view()) for part in memory)
        super().__init__(model, results, tuple(results), with_tau, external, friction)

    def __reduce__(self) -> tuple[Any, ...]:
        memory = BatchMemory(*(x.copy() for x in (self._state, self._numbers, self._positions, self._rates)))
        return type(self), (self._model, memory, self._with_tau, self._external, self._friction)

    def __len__(self) -> int:
        return len(self._positions)

    def __iter__(self) -> Iterator[Evaluation]:
        return (self[t] for t in range(len(self)))

    @overload
    def __getitem__(self, t: int) -> Evaluation: ...
    @overload
    def __getitem__(self, t: slice) -> BatchEvaluation: ...
    def __getitem__(self, t: int | slice) -> Evaluation | BatchEvaluation:
        if isinstance(t, slice):
            return self._slice(t)
        if not isinstance(t, (int, np.integer)):
            raise InputError(f"{t!r} is no index of a batch, expected a whole number or a slice.")
        if not -len(self) <= t < len(self):
            raise IndexError(f"state {t} of a batch of {len(self)}")
        nv, nq = self._model.nv, self._model.nq
        state = np.empty((ws.N_ROWS, max(nq, 1)))
        state[: ws.N_RESULTS, :nv] = self._state[:, t]
        state[_ENERGY_SHARE, :nv] = 0.5 * self.nu[t] * self.nu[t]
        state[_KINETIC_ENERGY : _KINETIC_ENERGY + ws.N_NUMBERS, 0] = self._numbers[:, t]
        state[ws.POSITIONS, :nq], state[ws.RATES, :nv] = self._positions[t], self._rates[t]
        external, friction = (None if x is None else x[t] for x in (self._external, self._friction))
        write_rates(state[:, :nv], external, friction)
        return Evaluation(self._model, read_only(state), state[:, :nv], self._with_tau, external, friction)

    def _slice(self, t: slice) -> BatchEvaluation:
        """Copy some states: an `out` may be overwritten."""
        parts = self._state[:, t], self._numbers[:, t], self._positions[t], self._rates[t]
        memory = BatchMemory(*(np.array(part, order="C") for part in parts))
        external, friction = (None if x is None else x[t].copy() for x in (self._external, self._friction))
        return BatchEvaluation(self._model, memory, self._with_tau, external, friction)

    def to_frame(self) -> Any:
        """Return all quantities as a pandas DataFrame: rows are states, columns are quantity and dof or link."""
        columns = {}
        for name in NAMES:
            value = getattr(self, name)
            if value is None:
                continue
            if value.ndim == 1:
                columns[name, ""] = value
                continue
            labels = self._model.link_names if name == "link_energy" else self._model.dof_names
            columns |= {(name, label): value[:, k] for k, label in enumerate(labels)}
        frame = require("pandas", "to_frame").DataFrame(columns)
        frame.columns.names = ["quantity", "of"]
        return frame

    @property
    def nu_dot(self) -> Array | None:
        """dν/dt [J^½/s], shape (T, nv), computed on each access; None without TAU."""
        return read_only(_nu_dot(self._rows, self._external, self._friction)) if self._with_tau else None

    @property
    def xi_dot(self) -> Array | None:
        """dξ/dt [rad/s², m/s²], shape (T, nv), computed on each access; None without TAU."""
        nu_dot = self.nu_dot
        return None if nu_dot is None else read_only(_xi_dot(self._rows, nu_dot))

    @property
    def energy_share(self) -> Array:
        """½ν_k² of each total rate [J], shape (T, nv), computed on each access."""
        return read_only(0.5 * self.nu * self.nu)

    def _number(self, row: int) -> Array:
        return self._numbers[row - _KINETIC_ENERGY]

    @property
    def kinetic_energy(self) -> Array:  # type: ignore[override]  # many states
        """K [J], shape (T,)."""
        return self._number(_KINETIC_ENERGY)

    @property
    def base_energy(self) -> Array:  # type: ignore[override]  # many states
        """Sum of the energy shares of a floating base [J], shape (T,); 0 with a fixed base."""
        return self._number(_BASE_ENERGY) if self._model.floating_base else read_only(np.zeros(len(self)))

    @property
    def power(self) -> Array | None:  # type: ignore[override]  # many states
        """dK/dt [W], shape (T,); None without TAU."""
        return self._number(_POWER) if self._with_tau else None

    @property
    def effort_power(self) -> Array | None:  # type: ignore[override]  # many states
        """νᵀ(ε − ε_g) [W], shape (T,); None without TAU."""
        return self._number(_EFFORT_POWER) if self._with_tau else None

    @property
    def _link_energy_shape(self) -> tuple[int, ...]:
        return len(self), len(self._model.link_names)

    @property
    def _motion(self) -> tuple[Array, Array]:
        return self._positions, self._rates


class BatchMemory(NamedTuple):
    """Memory for the results of T states.

    Attributes
    ----------
    results : ndarray, shape (RESULTS, T, nv)
        Rows of `diag_dynamics.sweeps.workspace` from NU on.
    numbers : ndarray, shape (NUMBERS, T)
        Rows from KINETIC_ENERGY on.
    positions : ndarray, shape (T, nq)
    rates : ndarray, shape (T, nv)
    """

    results: Array
    numbers: Array
    positions: Array
    rates: Array

    @classmethod
    def allocate(cls, model: RobotModel, count: int) -> BatchMemory:
        """Return uninitialized memory for `count` states, in one piece."""
        nv, nq = model.nv, model.nq
        shapes = (ws.N_RESULTS, count, nv), (ws.N_NUMBERS, count), (count, nq), (count, nv)
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        parts = np.split(np.empty(ends[-1]), ends[:-1])
        return cls(*(part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)))

    def detach(self, array: Array) -> Array:
        """Return the array, or a copy if it may share this memory."""
        return array.copy() if np.may_share_memory(array, self.results.base) else array


class Factors(NamedTuple):
    """Factors of the mass matrix at one configuration, M = m mᵀ = unit diag(D) unitᵀ and M⁻¹ = ℓᵀℓ (Identity 4.1); read-only.

    m and unit are upper triangular in the order of ``model.dof_names``, base to tip: they are the factors of the dense
    M = U D Uᵀ. Entry [i, j] is exactly zero unless i = j, joint i carries joint j, or both belong to one joint or to one
    coupled group. A group carries the joints that any of its joints carries.

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

    def to_dict(self) -> dict[str, Array]:
        """Return all factors by name."""
        return self._asdict()


def new_evaluation(model: RobotModel, shape: tuple[int, int]) -> Evaluation:
    """Return an Evaluation that may be overwritten, filled with NaN; its views are made once."""
    memory = np.full(shape, np.nan)
    state = read_only(memory.view())
    result = Evaluation(model, state, tuple(state[:, : model.nv]), False)
    result._memory = memory
    return result


def memory_of(out: Evaluation, kind: type[Evaluation], model: RobotModel, maker: str) -> Any:
    """Return the memory of a result that may be overwritten."""
    if type(out) is kind and out._model is model:
        try:
            return out._memory
        except AttributeError:  # a permanent result
            pass
    elif type(out) is kind:
        other, names = out._model, model.dof_names
        why = f"{len(other.dof_names)} dof" if other.dof_names != names else "another model"
        raise InputError(f"out is of robot '{other.name}' ({why}), expected '{model.name}' ({len(names)} dof).")
    name = type(out).__name__
    found = f"an earlier call's {name}, which stays as it is" if isinstance(out, Evaluation) else f"of type {name}"
    raise InputError(f"out is {found}, expected what {maker} of this robot's dynamics has made.")


def _nu_dot(rows: Array | Sequence[Array], external: Array | None, friction: Array | None) -> Array:
    rate = rows[_EPSILON] - rows[_CORIOLIS] - rows[_GRAVITY]
    if external is not None:
        rate += external
    if friction is not None:
        rate -= friction
    return rate


def _xi_dot(rows: Array | Sequence[Array], nu_dot: Array) -> Array:
    moments = np.sqrt(rows[_D]) * (nu_dot + rows[_CORIOLIS])
    return (moments - rows[_CORIOLIS_UNNORMALIZED]) / rows[_D]


def write_rates(rows: Array, external: Array | None, friction: Array | None) -> None:
    """Write ν̇ and ξ̇ with wrenches and friction into rows of a single state."""
    with np.errstate(over="ignore", invalid="ignore"):
        rows[_NU_DOT] = _nu_dot(rows, external, friction)
        rows[_XI_DOT] = _xi_dot(rows, rows[_NU_DOT])


def add_power(nu: Array, power: Array, external: Array | None, friction: Array | None) -> None:
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


def _restore(
    model: RobotModel, state: Array, with_tau: bool, external: Array | None, friction: Array | None
) -> Evaluation:
    """Return the Evaluation of a copy or pickle; unpickled arrays are writable."""
    for term in (external, friction):
        if term is not None:
            read_only(term)
    return Evaluation(model, read_only(state), state[:, : model.nv], with_tau, external, friction)
