# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How well parameters explain states that they were not fitted to."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.identification.segments import parts_of
from diag_dynamics.identification.torques import smoothed
from diag_dynamics.recordings.balance import Balance, WindowSums
from diag_dynamics.recordings.observed import Observer
from diag_dynamics.recordings.recording import SIZE

GAIN = 25.0
"""Of the observer whose spread is told [1/s]: the monitor's default."""

SMOOTHED = 1.0
"""Shortest segment whose errors of effort are looked at [s]: a filter of 5 Hz has no more to say of a shorter one."""


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


class _States(NamedTuple):
    """The columns of recordings.intake.States that balance and observer ask for."""

    newest: np.ndarray
    with_effort: np.ndarray
    moved: np.ndarray
    position: np.ndarray


def judged(model, friction, segments):
    """Judge parameters by segments.

    Parameters
    ----------
    model : RobotModel
        With the inertias, payload and rotors in question; its own friction is not looked at.
    friction : callable
        Friction and offset at rates, (T, nv) to (T, nv).
    segments : list of Segment

    Returns
    -------
    Verdict
    """
    dynamics = DiagonalDynamics(model)
    sums, balance, observer = WindowSums(model.nv), Balance(model.dof_names), Observer(dynamics, GAIN)
    squares, count, kinetic, number, torques = np.zeros(model.nv), 0, 0.0, 0, []
    for segment in segments:
        for first in range(0, len(segment.t), SIZE):
            part = segment.part(slice(first, first + SIZE))
            s = dynamics.evaluate_batch(part.q, part.qd, part.tau - friction(part.qd))
            moved = np.zeros(len(part.t), dtype=bool)
            moved[0] = first == 0
            states = _States(part.stamp, np.ones(len(part.t), dtype=bool), moved, part.q)
            balance.take(sums.take(states, s))
            _, torque, _, valid, _ = observer.take(states, s)
            torques.append(torque[valid])
            kinetic, number = kinetic + float(s.kinetic_energy.sum()), number + len(part.t)
        if segment.t[-1] - segment.t[0] >= SMOOTHED:
            for part in parts_of(segment):
                error = torque_errors(dynamics, friction, part)
                squares, count = squares + (error**2).sum(axis=0), count + len(error)
    spread = np.concatenate(torques).std(axis=0) if torques else np.full(model.nv, np.nan)
    torque = np.sqrt(squares / count) if count else np.full(model.nv, np.nan)
    return Verdict(torque, balance.explained, balance.explained_total, spread, kinetic / max(number, 1))


def torque_errors(dynamics, friction, segment):
    """Effort less friction and that of inverse dynamics, all below 5 Hz and at even times, (T, nv) [N m, N].

    Friction is that of rates as they are: that of filtered ones turns round later.
    """
    nq, nv = segment.q.shape[1], segment.qd.shape[1]
    _, columns, rates = smoothed(segment.t, np.hstack([segment.q, segment.qd, segment.tau - friction(segment.qd)]))
    q, qd, tau = np.split(columns, [nq, nq + nv], axis=1)
    qdd = rates[:, nq : nq + nv]
    return tau - dynamics.inverse_dynamics_batch(*map(np.ascontiguousarray, (q, qd, qdd)))
