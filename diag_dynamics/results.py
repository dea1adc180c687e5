# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What DiagonalDynamics hands out: everything at one state or at many, and the factors of the mass matrix."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require

if TYPE_CHECKING:
    from diag_dynamics.model import RobotModel

NAMES = (
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
    "kinetic_energy",
    "energy_share",
    "base_energy",
    "link_energy",
    "power",
    "effort_power",
)
"""What `to_dict` holds and `repr` shows, in this order."""

PER_DOF = (*NAMES[: NAMES.index("kinetic_energy")], "energy_share")
"""Those of them that have an entry for each degree of freedom."""

# Rows of the arrays below. These are global names: looking them up in the module takes twice as long as reading a row.
_NU, _XI, _EPSILON, _KAPPA = sweeps.NU, sweeps.XI, sweeps.EPSILON, sweeps.KAPPA
_CORIOLIS, _CORIOLIS_UNNORMALIZED, _GRAVITY = sweeps.CORIOLIS, sweeps.CORIOLIS_UNNORMALIZED, sweeps.GRAVITY
_D, _D_RATE = sweeps.ARTICULATED_INERTIA, sweeps.ARTICULATED_INERTIA_RATE
_ENERGY_SHARE, _KINETIC_ENERGY, _EFFORT_POWER = sweeps.ENERGY_SHARE, sweeps.KINETIC_ENERGY, sweeps.EFFORT_POWER


class Evaluation:
    """Everything the sweeps compute at one state; arrays have shape (nv,) unless said otherwise.

    The equation of motion is ``d(nu)/dt + coriolis + gravity = epsilon``, with ``+ external`` on the right and
    ``+ friction`` on the left where these were asked for (Jain and Rodriguez 1995, eq. 3.1, with gravity, wrenches and
    friction as terms of their own).

    Results are read-only, and nothing overwrites them later, unless they are of :meth:`DiagonalDynamics.new_evaluation`:
    these hold what was last evaluated into them, and NaN where that failed. ``copy.copy`` makes a result that stays.

    Terms of the equations, shares and energies are read from memory. `nu_dot`, `xi_dot`, `base_energy`, `link_energy` and
    `power` are computed whenever they are asked for.
    """

    __slots__ = ("_external", "_friction", "_memory", "_model", "_rows", "_state", "_with_tau")

    _model: RobotModel
    _state: Array  # all rows, of length nq, or 1 if that is 0
    _rows: Array | Sequence[Array]  # their first nv entries
    _with_tau: bool
    _external: Array | None
    _friction: Array | None
    _memory: Any  # where evaluate may write; not set in results that stay

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
        return _restored, (type(self), self._model, self._state.copy(), self._with_tau, self._external, self._friction)

    def __repr__(self) -> str:
        values = {name: self._value(name) for name in NAMES}
        with np.printoptions(precision=6, threshold=60, linewidth=10**6):
            lines = [f"  {name}={_shown(value)}," for name, value in values.items()]
        return "\n".join([f"{type(self).__name__}(", *lines, ")"])

    def _value(self, name: str) -> object:
        """An attribute to show: the text of the error where there is none."""
        try:
            return getattr(self, name)
        except InputError as error:
            return f"<{error}>"

    def to_dict(self) -> dict[str, Any]:
        """All results by name; those that are absent are None.

        Raises
        ------
        InputError
            As :attr:`link_energy`.
        """
        return {name: getattr(self, name) for name in NAMES}

    def to_frame(self) -> Any:
        """Quantities of each degree of freedom as a pandas DataFrame: a row for each, by its name.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        values = {name: getattr(self, name) for name in PER_DOF}
        columns = {name: value for name, value in values.items() if value is not None}
        return require("pandas", "to_frame").DataFrame(columns, index=list(self._model.dof_names))

    @property
    def model(self) -> RobotModel:
        """The robot whose results these are."""
        return self._model

    @property
    def rows(self) -> Array:
        """The rows that the sweep has filled, see `diag_dynamics.sweeps.workspace`, shape (ROWS, max(nq, 1))."""
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
        """Working moments ε = ℓτ [J^½/s] (Table 2), gravity not taken out; None without tau."""
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
        """ε_g = ℓ g(q) [J^½/s]; its un-normalized form κ_g [N m, N], as that of any such term, is √D times it."""
        return self._rows[_GRAVITY]

    @property
    def articulated_inertia(self) -> Array:
        """D [kg m², kg] (Algorithm 4.1).

        Of a joint of several degrees of freedom, and so of a floating base, and of a coupled group it is the diagonal of
        its block's factor U D Uᵀ, in the order of the degrees of freedom.
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
        """ε_fric = ℓ τ_fric [J^½/s], on the side of C; None unless asked for."""
        return self._friction

    @property
    def kinetic_energy(self) -> float:
        """K = ½νᵀν [J]."""
        return self._state.item(_KINETIC_ENERGY, 0)

    @property
    def energy_share(self) -> Array:
        """½ν_k² of each total rate [J]; sums to K. It is not the energy of link k.

        The six shares of a floating base depend on the order of its twist's components, their sum `base_energy` does not.
        """
        return self._rows[_ENERGY_SHARE]

    @property
    def base_energy(self) -> float:
        """Sum of the shares of a floating base's six degrees of freedom [J]; 0 with a fixed base.

        It is the energy of the total rates' common part: ½V*ᵀPV* with P the articulated inertia of the whole robot.
        """
        return float(self.energy_share[:6].sum()) if self._model.floating_base else 0.0

    @property
    def link_energy(self) -> Array:
        """Kinetic energy of each link [J], shape (len(model.link_names),): ½VᵀIV plus its joint's rotor; sums to K.

        Raises
        ------
        InputError
            A link's energy overflows, which it can where K does not: with an inertia that is no rigid body's.
        """
        energy = np.empty(len(self._model.link_names))
        self.write_link_energy(energy)
        return _sealed(energy)

    def write_link_energy(self, energy: Array) -> None:
        """Write :attr:`link_energy` into an array of its shape, for callers who have one already.

        Raises
        ------
        InputError
            As there; or the array has another shape, or is read-only.
        """
        _require_room(energy, (len(self._model.link_names),))
        q, qd = (self._state[row : row + 1] for row in (sweeps.POSITIONS, sweeps.RATES))
        if not sweeps.link_energies(self._model.bodies, self._model.links, q, qd, energy[None]):
            raise InputError("qd is too large: the kinetic energy of a link overflows.")

    @property
    def nu_dot(self) -> Array | None:
        """dν/dt = ε − C − ε_g + ℓJᵀf_ext − ε_fric [J^½/s] (eq. 3.1), of those terms asked for; None without tau."""
        epsilon = self.epsilon
        if epsilon is None:
            return None
        rate = epsilon - self.coriolis - self.gravity
        if self._external is not None:
            rate += self._external
        if self._friction is not None:
            rate -= self._friction
        return _sealed(rate)

    @property
    def xi_dot(self) -> Array | None:
        """dξ/dt = D⁻¹(κ − κ_g − C_ξ + …) [rad/s², m/s²] (eq. 7.9), of the terms that nu_dot has; None without tau."""
        rate = self.nu_dot
        if rate is None:
            return None
        moments = np.sqrt(self.articulated_inertia) * (rate + self.coriolis)
        return _sealed((moments - self.coriolis_unnormalized) / self.articulated_inertia)

    @property
    def power(self) -> float | None:
        """dK/dt = νᵀ(ε − ε_g + ℓJᵀf_ext − ε_fric) [W] (Lemma 7.2), of those terms that were asked for; None without tau."""
        rate = self.nu_dot
        return None if rate is None else float(self.nu @ (rate + self.coriolis))

    @property
    def effort_power(self) -> float | None:
        """νᵀ(ε − ε_g) [W]: :attr:`power` of the efforts and gravity alone; None without tau."""
        return self._state.item(_EFFORT_POWER, 0) if self._with_tau else None


class BatchEvaluation(Evaluation):
    """What :class:`Evaluation` holds, of T states at once: every attribute has a leading axis of length T.

    Numbers such as kinetic_energy are arrays of shape (T,). `energy_share` is computed when it is asked for, too.
    A batch is a sequence: an index gives the Evaluation of one state, a slice a batch. What
    :meth:`DiagonalDynamics.new_batch` gave holds the last batch that was evaluated into it.
    """

    __slots__ = ("_numbers", "_positions", "_rates")

    _numbers: Array
    _positions: Array
    _rates: Array

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
        """Take memory that a sweep has filled, or will fill again if it is kept."""
        for term in (external, friction):
            if term is not None:
                _sealed(term)
        self._model, self._with_tau, self._external, self._friction = model, with_tau, external, friction
        if keep:
            self._memory = memory
        self._state, self._numbers, self._positions, self._rates = (_sealed(part.view()) for part in memory)
        self._rows = tuple(self._state)

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
            parts = self._state[:, t], self._numbers[:, t], self._positions[t], self._rates[t]
            memory = BatchMemory(*(np.array(part, order="C") for part in parts))  # what is an `out` is written again
            external, friction = (None if x is None else x[t].copy() for x in (self._external, self._friction))
            return BatchEvaluation(self._model, memory, self._with_tau, external, friction)
        if not isinstance(t, (int, np.integer)):
            raise InputError(f"{t!r} is no index of a batch, expected a whole number or a slice.")
        if not -len(self) <= t < len(self):
            raise IndexError(f"state {t} of a batch of {len(self)}")
        nv, nq = self._model.nv, self._model.nq
        state = np.empty((sweeps.ROWS, max(nq, 1)))
        state[: sweeps.RESULTS, :nv] = self._state[:, t]
        state[_ENERGY_SHARE, :nv] = 0.5 * self.nu[t] * self.nu[t]
        state[_KINETIC_ENERGY, 0], state[_EFFORT_POWER, 0] = self._numbers[:, t]
        state[sweeps.POSITIONS, :nq], state[sweeps.RATES, :nv] = self._positions[t], self._rates[t]
        external, friction = (None if x is None else x[t] for x in (self._external, self._friction))
        return Evaluation(self._model, _sealed(state), state[:, :nv], self._with_tau, external, friction)

    def to_frame(self) -> Any:
        """Everything as a pandas DataFrame: a row for each state, columns by quantity and by degree of freedom or link.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        columns = {}
        for name in NAMES:
            value = getattr(self, name)
            if value is None:
                continue
            if value.ndim == 1:
                columns[name, ""] = value
                continue
            of = self._model.link_names if name == "link_energy" else self._model.dof_names
            columns |= {(name, one): value[:, k] for k, one in enumerate(of)}
        frame = require("pandas", "to_frame").DataFrame(columns)
        frame.columns.names = ["quantity", "of"]
        return frame

    @property
    def rows(self) -> Array:
        """The rows that the sweep has filled, shape (RESULTS, T, nv)."""
        return self._state

    @property
    def kinetic_energy(self) -> Array:  # type: ignore[override]
        """K [J], shape (T,)."""
        return self._numbers[0]

    @property
    def energy_share(self) -> Array:
        """½ν_k² of each total rate [J], shape (T, nv)."""
        return _sealed(0.5 * self.nu * self.nu)

    @property
    def base_energy(self) -> Array:  # type: ignore[override]
        """Sum of the shares of a floating base [J], shape (T,)."""
        nu = self.nu[:, : 6 if self._model.floating_base else 0]
        return _sealed((0.5 * nu * nu).sum(axis=1))

    @property
    def link_energy(self) -> Array:
        """Kinetic energy of each link [J], shape (T, len(model.link_names)).

        Raises
        ------
        InputError
            As :attr:`Evaluation.link_energy`.
        """
        energy = np.empty((len(self), len(self._model.link_names)))
        self.write_link_energy(energy)
        return _sealed(energy)

    def write_link_energy(self, energy: Array) -> None:
        """Write :attr:`link_energy` into an array of its shape, for callers who have one already.

        Raises
        ------
        InputError
            As there; or the array has another shape, or is read-only.
        """
        model = self._model
        _require_room(energy, (len(self), len(model.link_names)))
        if not sweeps.link_energies(model.bodies, model.links, self._positions, self._rates, energy):
            raise InputError("QD is too large: the kinetic energy of a link overflows.")

    @property
    def power(self) -> Array | None:  # type: ignore[override]
        """dK/dt [W], shape (T,); None without TAU."""
        rate = self.nu_dot
        return None if rate is None else _sealed(np.einsum("tk,tk->t", self.nu, rate + self.coriolis))

    @property
    def effort_power(self) -> Array | None:  # type: ignore[override]
        """νᵀ(ε − ε_g) [W], shape (T,); None without TAU."""
        return self._numbers[1] if self._with_tau else None


class BatchMemory(NamedTuple):
    """Where a sweep writes the results of T states.

    Attributes
    ----------
    results : ndarray, shape (RESULTS, T, nv)
        The rows of `diag_dynamics.sweeps.workspace` from NU on.
    numbers : ndarray, shape (2, T)
        K and νᵀ(ε − ε_g).
    positions : ndarray, shape (T, nq)
    rates : ndarray, shape (T, nv)
    """

    results: Array
    numbers: Array
    positions: Array
    rates: Array

    @classmethod
    def of(cls, model: RobotModel, count: int) -> BatchMemory:
        """Memory of one piece for a number of states, not filled."""
        nv, nq = model.nv, model.nq
        shapes = (sweeps.RESULTS, count, nv), (2, count), (count, nq), (count, nv)
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        parts = np.split(np.empty(ends[-1]), ends[:-1])
        return cls(*(part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)))

    def apart(self, array: Array) -> Array:
        """The array, or a copy if numbers of it may lie in this memory, whose parts are of one piece."""
        return array.copy() if np.may_share_memory(array, self.results.base) else array


class Factors(NamedTuple):
    """Factors of the mass matrix at one configuration, M = m mᵀ = unit diag(D) unitᵀ and M⁻¹ = ℓᵀℓ (Identity 4.1); read-only.

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

    m: Array
    l: Array  # noqa: E741
    unit: Array
    D: Array

    def to_dict(self) -> dict[str, Array]:
        """All factors by name."""
        return self._asdict()


def reused_evaluation(model: RobotModel, shape: tuple[int, int]) -> Evaluation:
    """Evaluation that :meth:`DiagonalDynamics.evaluate` can write into, again and again; NaN until then.

    Its holder gets views that are read-only and made here, once: reading a result takes no time but the lookup.
    """
    memory = np.full(shape, np.nan)
    state = _sealed(memory.view())
    result = Evaluation(model, state, tuple(state[:, : model.nv]), False)
    result._memory = memory
    return result


def _sealed(array: Array) -> Array:
    array.setflags(False)  # type: ignore[call-arg]  # by keyword it takes twice as long
    return array


def _require_room(energy: Array, shape: tuple[int, ...]) -> None:
    """Refuse what compiled code would write beyond, or although it is read-only: it looks at neither."""
    if energy.shape != shape or not energy.flags.writeable:
        kind = "" if energy.flags.writeable else "read-only "
        raise InputError(
            f"energy is a {kind}array of shape {energy.shape}, expected one of shape {shape} to write into."
        )


def _restored(
    kind: type[Evaluation],
    model: RobotModel,
    state: Array,
    with_tau: bool,
    external: Array | None,
    friction: Array | None,
) -> Evaluation:
    """Evaluation of a copy or pickle: arrays that were unpickled are not read-only."""
    for term in (external, friction):
        if term is not None:
            _sealed(term)
    return kind(model, _sealed(state), state[:, : model.nv], with_tau, external, friction)


def _shown(value: object) -> str:
    return np.array2string(value, separator=", ") if isinstance(value, np.ndarray) else str(value)
