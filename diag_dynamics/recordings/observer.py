# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque over a recording: the disturbance observer in columns, and collisions by its norm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, BoolArray, RowsLike, VectorLike
from diag_dynamics.checks import choice, instance, per_name, positive
from diag_dynamics.control.observer import SETTLES_ON, SettlesOn, influence
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.data_checks import EffortRange
from diag_dynamics.recordings.findings import explain_missing_efforts
from diag_dynamics.recordings.recording import SIZE, Recording
from diag_dynamics.recordings.windows import SampleChain
from diag_dynamics.results import ExternalWrench, TouchedLink, expand
from diag_dynamics.sweeps.evaluation import observe_samples


class Observed(NamedTuple):
    """Results of a disturbance observer at each state; rows of NaN where it has none.

    Attributes
    ----------
    t : ndarray, shape (T,)
        Times of the states as they are in the recording [s].
    residual : ndarray, shape (T, nv)
        r, which follows ε_ext = ℓτ_ext [J^½/s]; NaN where an unknown effort changes it.
    external_torque : ndarray, shape (T, nv)
        m r, which follows τ_ext [N m, N]; NaN at joints whose effort is unknown.
    norm : ndarray, shape (T,)
        |r| [J^½/s]; NaN if any component is.
    valid : ndarray of bool, shape (T,)
        Whether there is a result of any joint: not at the first state, after a gap, or without
        efforts.
    collision : ndarray of bool, shape (T,)
        Whether the norm has risen above the threshold, and not fallen below the release threshold
        since.
    q : ndarray, shape (T, nq)
        Positions [rad, m].
    dynamics : DiagonalDynamics
        Of the robot.
    """

    t: Array
    residual: Array
    external_torque: Array
    norm: Array
    valid: BoolArray
    collision: BoolArray
    q: Array
    dynamics: DiagonalDynamics

    def __repr__(self) -> str:
        name, valid = self.dynamics.model.name, int(self.valid.sum())
        collisions = int((np.diff(self.collision.astype(int), prepend=0) > 0).sum())
        return f"<Observed '{name}': {len(self.t)} states, {valid} valid, {collisions} collisions>"

    def wrench(
        self, link: str, covariance: RowsLike | None = None, **options: Any
    ) -> ExternalWrench:
        """Return the external wrench at a link in all states; NaN and not observed where there is no result.

        Arguments are those of :meth:`DiagonalDynamics.wrench`.
        """
        whole = self.valid & np.isfinite(self.norm)
        arguments = self.q[whole], link, self.external_torque[whole], covariance
        return expand(self.dynamics.wrench(*arguments, **options), whole)

    def touched_link(self, covariance: RowsLike | None, **options: Any) -> TouchedLink:
        """Return the touched link in all states; "" and NaN where there is no result.

        Arguments are those of :meth:`DiagonalDynamics.touched_link`.
        """
        whole = self.valid & np.isfinite(self.norm)
        rows = self.q[whole], self.external_torque[whole]
        return expand(self.dynamics.touched_link(*rows, covariance, **options), whole)


class ObservedStates(NamedTuple):
    """Columns of :class:`Observed` at states of a batch."""

    residual: Array
    external_torque: Array
    norm: Array
    valid: BoolArray
    collision: BoolArray

    @property
    def torque_norm(self) -> Array:
        """‖m r‖ of all joints together [N m, N of prismatic joints]."""
        return np.linalg.norm(self.external_torque, axis=1)

    def rows(self, which: Array) -> ObservedStates:
        """Return the columns at some states."""
        return ObservedStates(*(column[which] for column in self))


def observe(
    dynamics: DiagonalDynamics,
    recording: Recording,
    gain: VectorLike | float = 25.0,
    *,
    threshold: float = np.inf,
    release: float | None = None,
    friction: bool = True,
    max_gap: float = 0.1,
    settles_on: SettlesOn = "torque",
    threads: int | None = None,
) -> Observed:
    """Observe external torque over a recording, as :class:`DisturbanceObserver` does from state to state.

    Parameters
    ----------
    dynamics : DiagonalDynamics
        Of the recording's robot.
    recording : Recording
    gain, threshold, release, max_gap, settles_on
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
    options = {
        "friction": friction,
        "max_gap": max_gap,
        "settles_on": settles_on,
        "threads": threads,
    }
    observer = Observer(dynamics, gain, threshold, release, **options)
    batches = [columns for _, columns in observer.observe_states(recording.states)]
    columns = ObservedStates(*map(np.concatenate, zip(*batches, strict=True)))
    return Observed(recording.t, *columns, recording.q, dynamics)


def require_same_robot(dynamics: DiagonalDynamics, recording: Recording) -> None:
    """Reject a recording of another robot."""
    instance("recording", recording, Recording)
    if dynamics.model.dof_names != recording.model.dof_names:
        raise InputError(
            f"the recording is of robot '{recording.model.name}', whose degrees of freedom are not those of "
            f"the dynamics, of '{dynamics.model.name}'."
        )


def require_efforts(with_states: bool, counts: Mapping[str, int]) -> None:
    """Reject a recording that has no efforts, and perhaps no states either."""
    if not with_states:
        raise InputError("the recording has no states. Its findings give the causes.")
    raise InputError(f"{explain_missing_efforts(counts)}. External torque requires them.")


class Observer:
    """Observe states batch by batch; arguments are those of :func:`observe`."""

    def __init__(
        self,
        dynamics,
        gain,
        threshold=np.inf,
        release=None,
        *,
        friction,
        max_gap=0.1,
        settles_on="torque",
        threads=None,
    ):
        names, count = dynamics.model.dof_names, dynamics.model.nv
        gain = per_name("gain", gain, names, "a finite number > 0 [1/s]")
        self._threshold = (
            np.inf if threshold == np.inf else positive("threshold", threshold, "[J^½/s]")
        )
        self._release = (
            0.5 * self._threshold if release is None else positive("release", release, "[J^½/s]")
        )
        if self._release > self._threshold:
            raise InputError(
                f"release is {release!r} J^½/s, expected no more than the threshold, {threshold!r}."
            )
        choice("settles_on", settles_on, SETTLES_ON)
        self._on_torque = settles_on == "torque"
        self._dynamics, self._friction, self._threads = dynamics, friction, threads
        self._gain = np.array(np.broadcast_to(gain, count), dtype=float)
        self._chain = SampleChain(positive("max_gap", max_gap, "[s]"))
        self._sample = np.zeros((4, count))
        self._last = [
            *np.zeros((2, 1, count)),
            np.zeros(1),
            *np.zeros((2, 1), dtype=bool),
        ]  # of the last sample
        self._efforts, self._influence = EffortRange(dynamics.model), None

    def observe_states(self, states):
        """Evaluate and observe states; yield stamps [ns] and :class:`ObservedStates` of batches.

        Efforts that are constant while their joint moves are unknown.
        """
        states = self._efforts.hide_constant(states)
        for first in range(0, len(states), SIZE):
            part = states[first : first + SIZE]
            s, columns = None, (part.position, part.velocity, np.nan_to_num(part.effort))
            if not self._on_torque:
                s = self._dynamics.evaluate(
                    *columns, threads=self._threads, friction=self._friction
                )
            yield part.stamp, self.observe_batch(part, s)

    def observe_batch(self, states, s):
        """Return :class:`ObservedStates`, given the BatchEvaluation of states, which "torque" does not require."""
        known = np.isfinite(states.effort).any(axis=1) if self._on_torque else states.effort_known
        samples = self._chain.select(states, known)
        results = self._observe_samples(samples, states, s)
        if not isinstance(samples.rows, slice):  # not every state is a sample
            for k, (last, column) in enumerate(zip(self._last, results, strict=True)):
                results[k] = np.zeros((len(states.stamp), *column.shape[1:]), column.dtype)
                results[k][samples.known] = np.concatenate([last, column])[samples.sample + 1]
        if len(samples.known):
            self._last = [column[samples.known[-1:]] for column in results]
        invalid = np.flatnonzero(~results[3])
        for column in results[:3]:
            column[invalid] = np.nan
        return ObservedStates(*results)

    def _balance(self, rows, states, s):
        """Return momentum, resisting and applied terms of samples, as DisturbanceObserver has them."""
        if self._on_torque:
            q, rates = states.position[rows], states.velocity[rows]
            p, rate = self._dynamics.momentum(q, rates, threads=self._threads)
            friction = self._dynamics.friction_torque(rates, q) if self._friction else 0.0
            return np.ascontiguousarray(p), friction - rate, states.effort[rows]
        resisting = s.coriolis[rows] + s.gravity[rows]
        if self._friction:
            resisting += s.friction[rows]
        return s.nu[rows], resisting, s.epsilon[rows]

    def _observe_samples(self, samples, states, s):
        """Return residual, external torque, norm, whether they are valid, and collision of the samples."""
        rows, interval, threads = samples.rows, samples.interval, {"threads": self._threads}
        terms, positions = self._balance(rows, states, s), states.position[rows]
        x, norm = np.empty_like(terms[1]), np.empty(len(interval))
        observe_samples(self._gain, interval, *terms, self._sample, x, norm)
        valid = (interval > 0.0) & np.isfinite(norm) & np.isfinite(x).any(axis=1)
        x[~valid], norm[~valid] = 0.0, 0.0
        if self._on_torque:
            unknown = np.isnan(x)
            residual = self._dynamics.epsilon_from_tau(
                positions, np.where(unknown, 0.0, x), **threads
            )
            if unknown.any():
                self._influence = (
                    influence(self._dynamics) if self._influence is None else self._influence
                )
                residual[unknown @ self._influence] = np.nan
            torque, norm = x, np.sqrt((residual * residual).sum(axis=1))
        else:
            residual, torque = x, self._dynamics.tau_from_epsilon(positions, x, **threads)
        above = norm > self._threshold
        changes = np.append(True, above | ~valid | ~(norm >= self._release))
        last_change = np.maximum.accumulate(np.where(changes, np.arange(len(changes)), 0))
        return [residual, torque, norm, valid, np.append(self._last[4], above)[last_change][1:]]
