# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How well a model explains states that it was not fitted to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.recordings.balance import Balance, WindowSums
from diag_dynamics.recordings.effort_relation import Run, smoothed
from diag_dynamics.recordings.observer import Observer

GAIN = 25.0  # of the observer: the monitor's default [1/s]
MIN_SMOOTHED = 1.0  # shortest portion whose errors of effort count [s]: the filter has 5 Hz


class Validation(NamedTuple):
    """Errors of a model by degree of freedom, NaN if unknown, explained shares, None if unknown, and mean of K [J]."""

    torque: np.ndarray  # root mean square of the effort's error below 5 Hz [N m, N]
    explained: float | None  # of dK/dt
    explained_total: float | None  # of d(K + U)/dt
    spread: np.ndarray  # standard deviation of the observed external torque m r [N m, N]
    kinetic: float


def validate(model, friction, dataset, begin):
    """Return the :class:`Validation` by a dataset from a time on [s]; `friction` replaces the model's, (T, nv) to (T, nv)."""
    dynamics, sums, balance = DiagonalDynamics(model), WindowSums(model.nv), Balance(model.dof_names)
    balance.moved = True  # joints that do not move are not identified
    observer, errors, observed, energies = Observer(dynamics, GAIN), [], [], []
    for part in dataset.portions(begin):
        t, states = dataset.t[part], dataset.states[part]
        q, qd, tau = states.position, states.velocity, states.effort - friction(states.velocity)
        s = dynamics.evaluate_batch(q, qd, tau)
        balance.add_windows(sums.integrate_states(states, s))
        _, torque, _, valid, _ = observer.observe_batch(states, s)
        observed.append(torque[valid])
        energies.append(s.kinetic_energy.copy())
        if t[-1] - t[0] >= MIN_SMOOTHED:
            # Friction is that of rates as they are: that of filtered rates changes its sign later.
            q, qd, tau, qdd = smoothed(Run(t, q, qd, tau), tau)
            errors.append(tau - dynamics.inverse_dynamics_batch(q, qd, qdd))
    unknown, torque = np.full(model.nv, np.nan), np.concatenate(observed)
    return Validation(
        np.sqrt((np.concatenate(errors) ** 2).mean(axis=0)) if errors else unknown,
        balance.explained,
        balance.explained_total,
        torque.std(axis=0) if len(torque) else unknown,
        float(np.concatenate(energies).mean()),
    )
