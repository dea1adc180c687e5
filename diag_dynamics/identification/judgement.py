# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How well parameters explain states that they were not fitted to."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.recordings.balance import Balance, Moments, WindowSums
from diag_dynamics.recordings.effort_relation import smoothed
from diag_dynamics.recordings.observer import Observer

GAIN = 25.0
"""Of the observer whose spread is told [1/s]: the monitor's default."""

SMOOTHED = 1.0
"""Shortest portion whose errors of effort are looked at [s]: a filter of 5 Hz has no more to say of a shorter one."""


class Verdict(NamedTuple):
    """What the states say of one set of parameters."""

    torque: np.ndarray
    """Root mean square of the effort's error below 5 Hz, by degree of freedom [N m, N]; NaN without a segment long enough."""
    explained: float | None
    """Explained share of dK/dt, see recordings.balance; None without windows enough."""
    explained_total: float | None
    """Likewise of d(K + U)/dt."""
    spread: np.ndarray
    """Standard deviation of the observed external torque m r [N m, N]."""
    kinetic: float
    """Mean of K [J]."""


class States(NamedTuple):
    """The columns of recordings.states.States that balance and observer ask for."""

    stamp: np.ndarray
    effort_known: np.ndarray
    jumped: np.ndarray
    position: np.ndarray


def states_of(segment, begins):
    """Columns of a Portion that balance and observer ask for."""
    moved = np.zeros(len(segment.t), dtype=bool)
    moved[0] = begins
    return States(segment.stamp, np.ones(len(segment.t), dtype=bool), moved, segment.q)


class Judge:
    """Judges parameters by states, portion by portion.

    Parameters
    ----------
    model : RobotModel
        With the inertias, payload and rotors in question; its own friction is not looked at.
    friction : callable
        Friction and offset at rates, (T, nv) to (T, nv).
    """

    def __init__(self, model, friction):
        self._dynamics, self._friction = DiagonalDynamics(model), friction
        self._sums, self._balance = WindowSums(model.nv), Balance(model.dof_names)
        self._balance.moved = True  # what does not move is not identified
        self._observer = Observer(self._dynamics, GAIN)
        self._torque, self._errors, self._kinetic = Moments(model.nv), Moments(model.nv), Moments()

    def take(self, segment, begins):
        """Take in a Portion."""
        tau = segment.tau - self._friction(segment.qd)
        s, states = self._dynamics.evaluate_batch(segment.q, segment.qd, tau), states_of(segment, begins)
        self._balance.take(self._sums.take(states, s))
        _, torque, _, valid, _ = self._observer.take(states, s)
        self._torque.take(torque[valid])
        self._kinetic.take(s.kinetic_energy)
        if segment.t[-1] - segment.t[0] >= SMOOTHED:
            self._errors.take(self._error(segment, tau))

    def _error(self, segment, tau):
        """Effort less friction and that of inverse dynamics, all below 5 Hz and at even times, (T, nv) [N m, N].

        Friction is that of rates as they are: that of filtered ones turns round later.
        """
        q, qd, tau, qdd = smoothed(segment, tau)
        return tau - self._dynamics.inverse_dynamics_batch(q, qd, qdd)

    def verdict(self):
        """The :class:`Verdict` on all that was taken in."""
        unknown = np.full(len(self._errors.mean), np.nan)
        errors, spread = np.sqrt(self._errors.square), np.sqrt(self._torque.variance)
        return Verdict(
            errors if self._errors.count else unknown,
            self._balance.explained,
            self._balance.explained_total,
            spread if self._torque.count else unknown,
            float(self._kinetic.mean),
        )
