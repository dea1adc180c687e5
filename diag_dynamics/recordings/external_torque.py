# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque over a recording: the disturbance observer in columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, RowsLike, VectorLike
from diag_dynamics.checks import instance, per_name
from diag_dynamics.control.observer import influence
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.balance import MAX_GAP
from diag_dynamics.recordings.data_checks import EffortRange
from diag_dynamics.recordings.findings import explain_missing_efforts
from diag_dynamics.recordings.recording import SIZE, Recording
from diag_dynamics.recordings.windows import SampleChain
from diag_dynamics.results import TouchedLink, expand
from diag_dynamics.sweeps.evaluation import observe_samples


class Observed(NamedTuple):
    """Results of a disturbance observer at each state; rows of NaN where it has none.

    Attributes
    ----------
    residual : ndarray, shape (T, nv)
        r, which follows ε_ext = ℓτ_ext [J^½/s]; NaN where an unknown effort changes it.
    external_torque : ndarray, shape (T, nv)
        m r, which follows τ_ext [N m, N]; NaN at joints whose effort is unknown.
    norm : ndarray, shape (T,)
        |r| [J^½/s]; NaN if any component is.
    valid : ndarray of bool, shape (T,)
        Whether there is a result of any joint: not at the first state, after a gap, or without
        efforts.
    """

    residual: Array
    external_torque: Array
    norm: Array
    valid: BoolArray

    def __repr__(self) -> str:
        return f"<Observed: {len(self.valid)} states, {int(self.valid.sum())} valid>"

    @property
    def torque_norm(self) -> Array:
        """‖m r‖ of all joints together [N m, N of prismatic joints]."""
        return np.linalg.norm(self.external_torque, axis=1)

    def rows(self, places: Array) -> Observed:
        """Return the results at some states."""
        return Observed(*(column[places] for column in self))


def observe(
    dynamics: DiagonalDynamics,
    recording: Recording,
    gain: VectorLike | float = 25.0,
    *,
    friction: bool = True,
    threads: int | None = None,
) -> Observed:
    """Observe external torque over a recording as :class:`DisturbanceObserver` by state.

    Parameters
    ----------
    dynamics : DiagonalDynamics
        Of the recording's robot.
    recording : Recording
    gain
        As of :class:`DisturbanceObserver`.
    friction : bool
        Whether friction that the model has is no external torque.
    threads : int, optional
        For the evaluation of the states, by default as many as there are processors.

    Returns
    -------
    Observed

    Raises
    ------
    InputError
        An argument has a wrong value, or the recording is of another robot or has no efforts.
    """
    instance("dynamics", dynamics, DiagonalDynamics)
    require_same_robot(dynamics, recording)
    if recording.tau is None:
        require_efforts(len(recording) > 0, recording.counts)
    observer = Observer(dynamics, gain, friction=friction, threads=threads)
    batches = [columns for _, columns in observer.observe_states(recording.states)]
    return Observed(*map(np.concatenate, zip(*batches, strict=True)))


def find_touched_links(
    dynamics: DiagonalDynamics,
    q: Array,
    observed: Observed,
    covariance: RowsLike | None,
    rows: BoolArray | bool = True,
    **options: Any,
) -> TouchedLink | None:
    """Return the TouchedLink of observed states, "" and NaN in others; None without any.

    `rows` selects some of the states.
    """
    whole = observed.valid & np.isfinite(observed.norm) & rows
    if covariance is None or not whole.any():
        return None
    columns = q[whole], observed.external_torque[whole], covariance
    return expand(dynamics.touched_link(*columns, **options), whole)


def require_same_robot(dynamics: DiagonalDynamics, recording: Recording) -> None:
    """Reject a recording of another robot."""
    instance("recording", recording, Recording)
    if dynamics.model.dof_names != recording.model.dof_names:
        raise InputError(
            f"the recording is of robot '{recording.model.name}', "
            f"whose degrees of freedom are not those of the dynamics, of '{dynamics.model.name}'."
        )


def require_efforts(with_states: bool, counts: Mapping[str, int]) -> None:
    """Reject a recording that has no efforts, and perhaps no states either."""
    if not with_states:
        raise InputError(
            "the recording has no states; expected at least one. Its findings give the causes."
        )
    raise InputError(f"{explain_missing_efforts(counts)}. External torque requires them.")


class Observer:
    """Observe states batch by batch; arguments are those of :func:`observe`."""

    def __init__(self, dynamics, gain, *, friction, threads=None):
        count = dynamics.model.nv
        gain = per_name("gain", gain, dynamics.model.dof_names, "a finite number > 0 [1/s]")
        self._dynamics = dynamics
        self._friction = friction
        self._threads = threads
        self._gain = np.array(np.broadcast_to(gain, count), float)
        self._chain = SampleChain(MAX_GAP)
        self._sample = np.zeros((4, count))
        # residual, external torque, norm and whether they are valid, of the last sample
        self._last = [*np.zeros((2, 1, count)), np.zeros(1), np.zeros(1, bool)]
        self._efforts = EffortRange(dynamics.model)
        self._influence = None

    def observe_states(self, states):
        """Observe states; yield batches and their :class:`Observed`.

        Efforts that are constant while their joint moves are unknown.
        """
        states = self._efforts.hide_constant(states)
        for first in range(0, len(states), SIZE):
            batch = states[first : first + SIZE]
            yield batch, self.observe_batch(batch)

    def observe_batch(self, states):
        """Return the :class:`Observed` of states."""
        samples = self._chain.select(states, np.isfinite(states.effort).any(axis=1))
        results = self._observe_samples(samples, states)
        if not isinstance(samples.rows, slice):  # not every state is a sample
            for k, (last, column) in enumerate(zip(self._last, results, strict=True)):
                results[k] = np.zeros((len(states.stamp), *column.shape[1:]), column.dtype)
                results[k][samples.known] = np.concatenate([last, column])[samples.sample + 1]
        if len(samples.known):
            self._last = [column[samples.known[-1:]] for column in results]
        invalid = np.flatnonzero(~results[3])
        for column in results[:3]:
            column[invalid] = np.nan
        return Observed(*results)

    def _observe_samples(self, samples, states):
        """Return residual, external torque, norm, and whether they are valid, of the samples."""
        rows = samples.rows
        interval = samples.interval
        threads = {"threads": self._threads}
        q = states.position[rows]
        rates = states.velocity[rows]
        momentum, rate = self._dynamics.momentum(q, rates, **threads)
        friction = self._dynamics.friction_torque(rates, q) if self._friction else 0.0
        terms = np.ascontiguousarray(momentum), friction - rate, states.effort[rows]
        torque = np.empty_like(terms[1])
        norm = np.empty(len(interval))
        observe_samples(self._gain, interval, *terms, self._sample, torque, norm)
        valid = (interval > 0.0) & np.isfinite(norm) & np.isfinite(torque).any(axis=1)
        torque[~valid] = 0.0
        unknown = np.isnan(torque)
        residual = self._dynamics.epsilon_from_tau(q, np.where(unknown, 0.0, torque), **threads)
        if unknown.any():
            if self._influence is None:
                self._influence = influence(self._dynamics)
            residual[unknown @ self._influence] = np.nan
        return [residual, torque, np.sqrt((residual * residual).sum(axis=1)), valid]
