# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dead zone of standing joints: stiction hides so much of an external torque."""

from __future__ import annotations

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, IntArray
from diag_dynamics.checks import instance, not_negative, positive
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.sweeps.alarms import apply_dead_zone


class DeadZone:
    """Lower |m r| of standing joints by their stiction.

    A joint stands once |q̇| has been below 5 mrad/s (mm/s) for 30 ms. Its dead zone is z =
    `fraction` (f_C + μ|g(q)|), through the filter of the observer, because stiction passes through
    the same filter. |m r| decreases to √(max(0, |m r|² − z²)), and r to ℓ m r: stiction and the
    errors of the model, for which a threshold is, are independent. f_C is the Coulomb friction of
    the model, μ its load friction.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    fraction : float
        Of the Coulomb friction; 0 for no dead zone.
    gain : float
        Of the observer [1/s].

    Raises
    ------
    InputError
        The fraction is below zero, or the gain not above it.
    """

    def __init__(self, dynamics: DiagonalDynamics, fraction: float, gain: float) -> None:
        self._gain = positive("gain", gain, "[1/s]")
        model = instance("dynamics", dynamics, DiagonalDynamics).model
        self._dynamics = dynamics
        self._fraction = not_negative("fraction", fraction, "(a fraction)")
        self._is_used = bool(fraction and (model.friction.any() or model.load_friction.any()))
        self._largest: Array = np.zeros((2, model.nv))  # of standing joints, and at all states
        if self._is_used:
            apply_dead_zone.compile()
            dynamics.compile("epsilon_from_tau", "gravity_torque")
        self.reset()

    @property
    def largest(self) -> Array:
        """Largest dead zone of each standing joint until now, or where it would stand [N m, N]."""
        return np.where(self._largest[0] > 0.0, *self._largest)

    def use(self, dynamics: DiagonalDynamics) -> None:
        """Use a model that differs in gravity alone."""
        self._dynamics = dynamics

    def reset(self) -> None:
        """Forget which joints stand."""
        self._standing: IntArray = np.zeros(self._dynamics.model.nv, dtype=np.int64)
        self._widths: Array = np.zeros(self._dynamics.model.nv)
        self._last: int | None = None

    def lower(
        self,
        stamps: IntArray,
        q: Array,
        qd: Array,
        residual: Array,
        external_torque: Array,
        restarts: Array | BoolArray | None = None,
    ) -> tuple[Array, Array]:
        """Return r and m r of states in order, after those of earlier calls.

        Parameters
        ----------
        stamps : ndarray of int64, shape (T,)
            [ns].
        q, qd : ndarray, shape (T, nq) and (T, nv)
            Positions and rates.
        residual, external_torque : ndarray, shape (T, nv)
            r [J^½/s] and m r [N m, N]; NaN where unknown.
        restarts : ndarray of bool, shape (T,), optional
            States before which there is no motion: slow joints are taken as standing.
        """
        if not self._is_used or not len(stamps):
            return residual, external_torque
        model = self._dynamics.model
        lowered = external_torque.copy()
        zones = np.broadcast_to(model.friction, lowered.shape)
        if model.load_friction.any():
            zones = zones + model.load_friction * np.abs(self._dynamics.gravity_torque(q))
        zones = np.ascontiguousarray(self._fraction * zones)
        self._largest[1] = np.maximum(self._largest[1], zones.max(axis=0))
        elapsed = np.diff(stamps, prepend=stamps[0] + 1 if self._last is None else self._last)
        self._last = int(stamps[-1])
        if restarts is not None:
            elapsed[restarts] = -1
        memory = self._standing, self._widths, self._largest[0]
        apply_dead_zone(elapsed, np.ascontiguousarray(qd), zones, self._gain, *memory, lowered)
        change = np.nan_to_num(lowered - external_torque)
        rows = np.flatnonzero(change.any(axis=1))
        if len(rows):
            residual = residual.copy()
            residual[rows] += self._dynamics.epsilon_from_tau(q[rows], change[rows])
        return residual, lowered
