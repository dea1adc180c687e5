# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames: all that a page shows of a state, as one row of float32, of one state or of many in the same way."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.arrays import Array
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.page.layout import CAUSES, LATE, Layout
from diag_dynamics.results import Evaluation

GAP = 0.5
"""Time between two states beyond which their energies say nothing of the power in between [s]."""

AGREEMENT = 1e-6
"""Part of K by which the sum of the links' energies may miss it, before links are said to be another model's."""

_UPPER = np.triu_indices(3)


class States(NamedTuple):
    """T states with what has been evaluated at them, a row each; see :class:`~diag_dynamics.results.Evaluation`."""

    t: Array
    """Stamps [s], shape (T,)."""
    q: Array
    qd: Array
    effort: Array | None
    """None, or rows of NaN, where efforts are unknown; `epsilon` likewise."""
    nu: Array
    epsilon: Array | None
    coriolis: Array
    gravity: Array
    D: Array
    K: Array
    """[J], shape (T,)."""

    @classmethod
    def of(cls, t: Any, q: Any, qd: Any, effort: Any, s: Evaluation) -> States:
        """States of an Evaluation or a BatchEvaluation at stamps, positions, rates and efforts (None: unknown)."""
        rows = [
            None if x is None else np.atleast_2d(x) for x in (q, qd, effort, s.nu, s.epsilon, s.coriolis, s.gravity)
        ]
        return cls(np.atleast_1d(t), *rows, np.atleast_2d(s.articulated_inertia), np.atleast_1d(s.kinetic_energy))  # type: ignore[arg-type]


class Seen(NamedTuple):
    """What a disturbance observer says of T states, a row each."""

    valid: Any
    """Whether there is a result, shape (T,); where there is none, the numbers do not matter."""
    residual: Array
    external_torque: Array
    norm: Array
    """|r|, shape (T,)."""
    collision: Any
    """Shape (T,)."""


class Told(NamedTuple):
    """What else is known of T states: one value for all, or one each."""

    velocity_estimated: Any = False
    receive_time: Any = False
    latency: Any = np.nan
    """From the stamp to the reception [s]."""
    rate: Any = np.nan
    """States per second."""


class FrameMaker:
    """Makes the frames of a robot.

    Parameters
    ----------
    dynamics : DiagonalDynamics
        Used by one thread at a time.
    live : bool
        Whether frames have the fields of a chosen link.

    Attributes
    ----------
    layout : Layout
    """

    def __init__(self, dynamics: DiagonalDynamics, live: bool = True) -> None:
        self._dynamics = dynamics
        self.layout = Layout(dynamics.model, live)
        self._before: tuple[float, float] | None = None

    def prepare(self) -> None:
        """Compile what frames are made by, or load it: the first one then takes as long as any other."""
        q, none = self._dynamics.model.neutral, np.zeros(self._dynamics.model.nv)
        self.frames(States.of(0.0, q, none, none, self._dynamics.evaluate(q, none, none)))
        self.chosen(q, none, self._dynamics.model.root_link)
        self.forget()

    def forget(self) -> None:
        """Take the next state for the first one: there is no power from one before."""
        self._before = None

    def frames(self, states: States, seen: Seen | None = None, told: Told = Told()) -> Any:  # noqa: B008 (immutable)
        """Frames of states in their order, which go on from those of the last call.

        Returns
        -------
        ndarray of ``layout.dtype``, shape (T,)
            Those of one robot stand one after the other in memory as they are sent. What is unknown is NaN.
        """
        layout, model = self.layout, self._dynamics.model
        frames = np.empty(len(states.t), dtype=layout.dtype)
        frames["t"], x = states.t, frames["numbers"]
        nu, qd = states.nu, states.qd
        with np.errstate(over="ignore", invalid="ignore"):  # beyond float32 is infinite, which a page shows as unknown
            for name in ("q", "qd", "effort", "nu", "epsilon", "coriolis", "gravity", "D"):
                value = getattr(states, name)
                x[:, layout.place(name)] = np.nan if value is None else value
            x[:, layout.place("gravity_torque")] = self._gravity_torque(states)
            energies = self._link_energies(states)
            x[:, layout.place("link_energy")] = energies
            self._put(x, "K", states.K)
            self._put(x, "p_effort", np.nan if states.epsilon is None else _products(nu, states.epsilon))
            self._put(x, "p_gravity", -_products(nu, states.gravity))
            self._put(x, "p_friction", -_products(qd, self._friction(qd)) if model.has_friction else 0.0)
            self._put(x, "dK", self._energy_rate(states))
            self._put(x, "coriolis_work", _coriolis_work(nu, states.coriolis))
            flags = self._take_seen(x, nu, seen)
        effort_missing = states.effort is None or np.isnan(states.effort).any(axis=1)
        differs = ~(np.abs(energies.sum(axis=1) - states.K) <= AGREEMENT * states.K + 1e-12)
        for name, is_so in (
            ("velocity_estimated", told.velocity_estimated),
            ("effort_missing", effort_missing),
            ("receive_time", told.receive_time),
            ("late", np.asarray(told.latency) > LATE),
            ("other_model", differs),
        ):
            flags = flags + CAUSES[name] * np.asarray(is_so, dtype=int)
        self._put(x, "latency", told.latency)
        self._put(x, "rate", told.rate)
        self._put(x, "flags", flags)
        x[:, layout.common :] = np.nan
        return frames

    def chosen(self, q: Array, nu: Array, link: str) -> Any:
        """Return the fields of a chosen link, float32, in the world's axes.

        With F the linear columns of ℓJᵀ at the link's origin, the linear part of JM⁻¹Jᵀ is FᵀF [1/kg]. Its symmetric root
        maps the unit sphere to the ellipsoid of velocities that ½ J allows; the frame has its upper triangle, row by row.
        The velocity is Fᵀν [m/s].

        Raises
        ------
        InputError
            No such link.
        """
        factor = self._dynamics.wrench_factor(q, link, frame="world")[:, :3]
        values, axes = np.linalg.eigh(factor.T @ factor)
        root = (axes * np.sqrt(np.maximum(values, 0.0))) @ axes.T
        return np.concatenate([root[_UPPER], factor.T @ nu]).astype("<f4")

    def _put(self, x: Any, name: str, value: Any) -> None:
        x[:, self.layout.place(name).start] = value

    def _gravity_torque(self, states: States) -> Array:
        """G = m ε_g [N m, N]."""
        if len(states.t) == 1:
            return self._dynamics.tau_from_epsilon(states.q[0], states.gravity[0])
        return self._dynamics.tau_from_epsilon_batch(states.q, states.gravity)

    def _link_energies(self, states: States) -> Array:
        model = self._dynamics.model
        energies = np.empty((len(states.t), len(model.link_names)))
        q, qd = (np.ascontiguousarray(x, dtype=float) for x in (states.q, states.qd))
        if not sweeps.link_energies(model.bodies, model.links, q, qd, energies):
            energies[:] = np.nan
        return energies

    def _friction(self, qd: Array) -> Array:
        if len(qd) == 1:
            return self._dynamics.friction_torque(qd[0])[None]
        return self._dynamics.friction_torque_batch(qd)

    def _energy_rate(self, states: States) -> Array:
        """Change of K from the state before by the time in between [W]; NaN without one, or after a gap."""
        t, K = states.t, states.K
        if not len(t):
            return np.empty(0)
        step, change = np.empty((2, len(t)))
        step[0], change[0] = (
            (np.nan, np.nan) if self._before is None else (t[0] - self._before[0], K[0] - self._before[1])
        )
        step[1:], change[1:] = t[1:] - t[:-1], K[1:] - K[:-1]
        self._before = float(t[-1]), float(K[-1])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where((step > 0.0) & (step <= GAP), change / step, np.nan)

    def _take_seen(self, x: Any, nu: Array, seen: Seen | None) -> Any:
        """Write what an observer says; returns its flags."""
        names = ("residual", "external_torque")
        if seen is None:
            for name in (*names, "norm", "torque_norm", "p_external"):
                x[:, self.layout.place(name)] = np.nan
            return CAUSES["no_external_torque"]
        valid = np.asarray(seen.valid, dtype=bool)
        for name in names:
            x[:, self.layout.place(name)] = np.where(valid[:, None], getattr(seen, name), np.nan)
        norm = np.sqrt((seen.external_torque * seen.external_torque).sum(axis=1))
        self._put(x, "norm", np.where(valid, seen.norm, np.nan))
        self._put(x, "torque_norm", np.where(valid, norm, np.nan))
        self._put(x, "p_external", np.where(valid, _products(nu, seen.residual), np.nan))
        colliding = valid & np.asarray(seen.collision, dtype=bool)
        return np.where(valid, 0, CAUSES["no_external_torque"]) + CAUSES["collision"] * colliding


def _coriolis_work(nu: Array, coriolis: Array) -> Array:
    """|νᵀC| in parts of |ν||C|, which is rounding: that of these doubles, not of a frame's floats. NaN at rest."""
    sizes = np.linalg.norm(nu, axis=1) * np.linalg.norm(coriolis, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(sizes > 0.0, np.abs(_products(nu, coriolis)) / sizes, np.nan)


def _products(a: Array, b: Array) -> Array:
    """Scalar product of each pair of rows."""
    return (a[:, None, :] @ b[:, :, None])[:, 0, 0]
