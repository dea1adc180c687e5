"""Everything of a recording, piece by piece: evaluated, observed, balanced, judged, and handed on to whoever writes it."""

import queue
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.recordings.balance import Balance, Windows
from diag_dynamics.recordings.collisions import Collisions
from diag_dynamics.recordings.intake import States
from diag_dynamics.recordings.observed import Observer
from diag_dynamics.recordings.peaks import Peaks
from diag_dynamics.recordings.quality import Quality
from diag_dynamics.recordings.recording import SIZE
from diag_dynamics.results import BatchEvaluation

WAITING = 2
"""Pieces that wait for the next stage: more take memory and make nothing faster."""


class Piece(NamedTuple):
    """All about some states."""

    states: States
    s: BatchEvaluation
    observed: tuple
    """residual, external_torque, norm, valid, collision; see :class:`~observed.Observed`."""
    windows: Windows


class Analysis:
    """Analyses a recording.

    Parameters
    ----------
    reading : Reading
    gain : float
        Of the observer [1/s].
    threads : int, optional
        For evaluation, by default as many as there are processors.

    Attributes
    ----------
    balance : Balance
    quality : Quality
    peaks : Peaks
    collisions : Collisions
    states : int
    """

    def __init__(self, reading, *, gain=25.0, threads=None):
        model, settings = reading.model, reading.settings
        self.reading, self.model, self._threads = reading, model, threads
        self._dynamics = DiagonalDynamics(model)
        self.friction = bool((model.damping != 0.0).any() or (model.friction != 0.0).any())
        wanted = settings.observation
        gain, threshold, release = (wanted.gain, wanted.threshold, wanted.release) if wanted else (gain, np.inf, None)
        self.gain, self.threshold = gain, threshold
        self._observer = Observer(
            self._dynamics,
            gain,
            threshold,
            None if threshold == np.inf else release,
            friction=self.friction,
            max_gap=settings.values["external_torque.max_gap"],
            threads=threads,
        )
        self.balance = Balance(model.dof_names, self.friction)
        self.quality, self.peaks = Quality(model), Peaks()
        self.collisions, self.states = Collisions(model.dof_names), 0
        self._kinetic = 0.0

    def run(self, outputs=(), progress=None):
        """Read, evaluate and write all of it.

        Parameters
        ----------
        outputs : sequence
            Their `write(piece)` is called for each :class:`Piece`, in order.
        progress : callable, optional
            Called with the number of states and the last log time [ns] after each piece.

        Stages work side by side: reading and assembling, evaluating, writing.
        """
        read, evaluated, stop = queue.Queue(WAITING), queue.Queue(WAITING), threading.Event()

        def reading():
            try:
                for piece in self.reading.pieces(SIZE):
                    if not _put(read, piece.states, stop):
                        return
            finally:
                _put(read, None, stop)

        def evaluating():
            try:
                while (states := _get(read, stop)) is not None:
                    if states.number and not _put(evaluated, self.take(states), stop):
                        return
            finally:
                _put(evaluated, None, stop)

        with ThreadPoolExecutor(2, thread_name_prefix="diag_dynamics") as pool:
            stages = [pool.submit(stage) for stage in (reading, evaluating)]
            try:
                while (piece := _get(evaluated, stop)) is not None:
                    for output in outputs:
                        output.write(piece)
                    if progress:
                        progress(self.states, int(piece.states.log_time[-1]))
            finally:
                stop.set()  # what is still at work after a failure ends
        for stage in stages:
            stage.result()

    def take(self, states):
        """Evaluate states, take note of all that is told of them in the end, and return the :class:`Piece`."""
        states, s = self._evaluated(states)
        observed = self._observer.take(states, s)
        windows = self.balance.take(states, s)
        self.quality.take(states)
        self._note(states, s, observed)
        return Piece(states, s, observed, windows)

    def _evaluated(self, states):
        """States that can be evaluated, and their evaluation."""
        known = states.with_effort.all()
        while True:
            efforts = states.effort if known else np.where(states.with_effort[:, None], states.effort, 0.0)
            try:
                return states, self._dynamics.evaluate_batch(
                    states.position, states.velocity, efforts, threads=self._threads, friction=self.friction
                )
            except DiagDynamicsError as error:
                states = self._without_bad(states, efforts, error)

    def _without_bad(self, states, efforts, error):
        """States without those that cannot be evaluated, which are counted as the monitor counts them."""
        good = np.ones(states.number, dtype=bool)
        for t in range(states.number):
            try:
                self._dynamics.evaluate(states.position[t], states.velocity[t], efforts[t])
            except DiagDynamicsError as one:
                good[t] = False
                self.reading.intake.reject(int(states.log_time[t]), one)
        if good.all():
            raise error  # of something else
        return states.part(good)

    def _note(self, states, s, observed):
        stamps, names = states.newest, self.model.dof_names
        residual, torque, norm, valid, collision = observed
        K, peaks = s.kinetic_energy, self.peaks
        self.states += states.number
        self._kinetic += float(K.sum())
        peaks.take("kinetic_energy", K, stamps)
        peaks.take("energy_share", s.energy_share, stamps, names)
        peaks.take("velocity", states.velocity, stamps, names, absolute=True)
        peaks.take("effort", states.effort, stamps, names, absolute=True)
        if valid.any():
            peaks.take("external_torque", torque, stamps, names, absolute=True)
            peaks.take("residual_norm", norm, stamps)
        self.collisions.take(stamps, residual, norm, collision)

    @property
    def mean_energy(self):
        """Mean of K over the states [J]."""
        return self._kinetic / self.states if self.states else None


def _put(into, what, stop):
    """Hand something on; whether there was anybody to take it."""
    while not stop.is_set():
        try:
            into.put(what, timeout=0.1)
            return True
        except queue.Full:
            continue
    return False


def _get(out_of, stop):
    """What is handed on next; None at the end, or when a stage has failed."""
    while True:
        try:
            return out_of.get(timeout=0.1)
        except queue.Empty:
            if stop.is_set():
                return None
