# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque over a recording: the disturbance observer in columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Flags, VectorLike
from diag_dynamics.checks import instance, per_name, positive
from diag_dynamics.compiled.tables import Addresses
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.account import without_efforts
from diag_dynamics.recordings.kernels import prepare
from diag_dynamics.recordings.kernels.observation import HAS_SAMPLE, OBSERVED, OBSERVER, observe_many
from diag_dynamics.recordings.recording import SIZE, Recording


class Observed(NamedTuple):
    """What a disturbance observer says at each state; rows of NaN where it has no result.

    Attributes
    ----------
    t : ndarray, shape (T,)
        Times of the states as they are in the recording [s].
    residual : ndarray, shape (T, nv)
        r, which follows ε_ext = ℓτ_ext [J^½/s].
    external_torque : ndarray, shape (T, nv)
        m r, which follows τ_ext [N m, N].
    norm : ndarray, shape (T,)
        |r| [J^½/s].
    valid : ndarray of bool, shape (T,)
        Whether there is a result: not at first, after a gap, nor where efforts are missing.
    collision : ndarray of bool, shape (T,)
        Whether the norm has risen above the threshold, and not fallen below the release threshold since.
    """

    t: Array
    residual: Array
    external_torque: Array
    norm: Array
    valid: Flags
    collision: Flags


def observe(
    dynamics: DiagonalDynamics,
    recording: Recording,
    gain: VectorLike | float = 25.0,
    *,
    threshold: float = np.inf,
    release: float | None = None,
    friction: bool = True,
    max_gap: float = 0.1,
    threads: int | None = None,
) -> Observed:
    """Observe external torque over a recording, as :class:`DisturbanceObserver` does from state to state.

    Parameters
    ----------
    dynamics : DiagonalDynamics
        Of the recording's robot.
    recording : Recording
    gain, threshold, release, max_gap
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
    observer = Observer(dynamics, gain, threshold, release, friction=friction, max_gap=max_gap, threads=threads)
    pieces = [columns for _, columns in observer.observed(recording.states)]
    columns = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return Observed(recording.t, *columns)


def require_same_robot(dynamics: DiagonalDynamics, recording: Recording) -> None:
    """Refuse a recording of another robot."""
    instance("recording", recording, Recording)
    if dynamics.model.dof_names != recording.model.dof_names:
        raise InputError(
            f"the recording is of robot '{recording.model.name}', whose degrees of freedom are not those of the dynamics, "
            f"of '{dynamics.model.name}'."
        )


def require_efforts(with_states: bool, counts: Mapping[str, int]) -> None:
    """Refuse a recording that has no efforts, and perhaps no states either."""
    if not with_states:
        raise InputError("the recording has no states: its findings say why.")
    raise InputError(f"{without_efforts(counts)}, without which no external torque can be observed.")


class Observer:
    """Observes at states, piece by piece.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    gain, threshold, release, friction, max_gap, threads
        As of :func:`observe`.
    """

    def __init__(self, dynamics, gain, threshold=np.inf, release=None, *, friction=False, max_gap=0.1, threads=None):
        names = dynamics.model.dof_names
        gain = per_name("gain", gain, names, "a finite number > 0 [1/s]")
        self.threshold = np.inf if threshold == np.inf else positive("threshold", threshold, "[J^½/s]")
        self.release = 0.5 * self.threshold if release is None else positive("release", release, "[J^½/s]")
        if self.release > self.threshold:
            raise InputError(f"release is {release!r} J^½/s, expected no more than the threshold, {self.threshold!r}.")
        self._max_gap = positive("max_gap", max_gap, "[s]")
        self._dynamics, self._friction, self._threads = dynamics, friction, threads
        self._last = -1, None  # stamp and m r of the last state with efforts
        vectors = self._vectors = np.zeros((4, len(names)))
        self._stamp, self._flags = np.zeros(1, dtype=int), np.zeros(3, dtype=int)
        self._own = Addresses(
            OBSERVER,
            gain=np.array(np.broadcast_to(gain, len(names)), dtype=float),
            residual=vectors[0],
            nu=vectors[1],
            resisting=vectors[2],
            epsilon=vectors[3],
            stamp=self._stamp,
            flags=self._flags,
        )
        prepare(observe_many)

    def observed(self, states):
        """Evaluate states and take them in; yields stamps [ns] of some, and what :meth:`take` returns of these."""
        for first in range(0, len(states), SIZE):
            part = states[first : first + SIZE]
            s = self._dynamics.evaluate_batch(
                part.position,
                part.velocity,
                np.nan_to_num(part.effort),
                threads=self._threads,
                friction=self._friction,
            )
            yield part.stamp, self.take(part, s)

    def take(self, states, s):
        """Take in states and their BatchEvaluation; returns the columns of :class:`Observed` but for times."""
        count, width = s.nu.shape
        residual, norm = np.empty((count, width)), np.empty(count)
        valid, collision = np.zeros((2, count), dtype=bool)
        observed = Addresses(
            OBSERVED,
            stamp=np.ascontiguousarray(states.stamp),
            with_effort=np.ascontiguousarray(states.effort_known),
            moved=np.ascontiguousarray(states.jumped),
            nu=s.nu,
            coriolis=s.coriolis,
            gravity=s.gravity,
            epsilon=s.epsilon,
            friction=s.friction if self._friction else np.zeros((0, width)),
            residual=residual,
            norm=norm,
            valid=valid,
            collision=collision,
        )
        observe_many(self._own.at, observed.at, self.threshold, self.release, self._max_gap)
        torque = self._dynamics.tau_from_epsilon_batch(states.position, residual, threads=self._threads)
        self._keep_first(states, valid, torque)
        if not valid.all():
            for column in (residual, torque, norm):
                column[~valid] = np.nan
        return residual, torque, norm, valid, collision

    def _keep_first(self, states, valid, torque):
        """Of several states of one stamp the first one counts, whose position m is of."""
        known = np.flatnonzero(states.effort_known)
        stamps = states.stamp[known]
        before = np.concatenate([[self._last[0]], stamps[:-1]])
        for k in np.flatnonzero((stamps == before) & valid[known]).tolist():
            torque[known[k]] = torque[known[k - 1]] if k else self._last[1]
        if len(known):
            self._last = int(stamps[-1]), torque[known[-1]].copy()

    def memory(self):
        """What later results depend on; see `diag_dynamics.recordings.seams`."""
        if not self._flags[HAS_SAMPLE]:
            return None
        return [self._flags.copy(), self._stamp.copy(), self._vectors.copy(), *self._last]
