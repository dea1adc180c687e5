# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Everything of a recording, piece by piece: evaluated, observed, balanced, judged, and handed on to whoever writes it."""

import queue
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from diag_dynamics.collision.detector import AlarmDetector, Judged
from diag_dynamics.collision.events import Alarms
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.recordings.balance import Windows, WindowSums
from diag_dynamics.recordings.collisions import Collisions
from diag_dynamics.recordings.observed import Observer
from diag_dynamics.recordings.outcome import Outcome
from diag_dynamics.recordings.quality import Quality
from diag_dynamics.recordings.recording import SIZE
from diag_dynamics.recordings.states import States
from diag_dynamics.recordings.touches import Touches
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
    judged: Judged | None = None
    """What alarms are made of, where there are thresholds of them."""


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
    outcome : Outcome
        What has been found.
    """

    def __init__(self, reading, *, gain=25.0, threads=None):
        model, settings = reading.model, reading.settings
        self.reading, self.model, self._threads = reading, model, threads
        self._dynamics = DiagonalDynamics(model)
        self.friction = model.has_friction
        wanted = settings.observation
        gain, threshold, release = (wanted.gain, wanted.threshold, wanted.release) if wanted else (gain, np.inf, None)
        self._observer = Observer(
            self._dynamics,
            gain,
            threshold,
            None if threshold == np.inf else release,
            friction=self.friction and settings.values["external_torque.friction"],
            max_gap=settings.values["external_torque.max_gap"],
            threads=threads,
        )
        self._windows = WindowSums(model.nv, self.friction)
        self._observing = gain, threshold, settings.unjudged_without
        alarms = wanted.alarms if wanted else None
        self._detector = AlarmDetector(model.dof_names, alarms) if alarms else None
        self._points, self._newest = self._limited_points(), None  # and the last stamp [ns]
        self.outcome = Outcome(model, Quality(model), *self._observing, self._collisions(), self._touches())

    def _limited_points(self):
        """ContactPoints, where limits are wanted."""
        if self.reading.settings.contact.limits is None:
            return None
        points, _ = self.reading.contact_points
        return points if points.limited.any() else None

    def _touches(self):
        """What gathers contact, where there is a limit."""
        return Touches(self._points.names) if self._points else None

    def _collisions(self, goes_on=False):
        """What gathers collisions: of the detector, or by the observer's own threshold."""
        return Alarms(self._detector) if self._detector else Collisions(self.model.dof_names, goes_on)

    @property
    def states(self):
        """How many there were."""
        return self.outcome.states

    def run(self, outputs=(), progress=None):
        """Read, evaluate and write all of it.

        Parameters
        ----------
        outputs : sequence
            Their `write(piece)` is called for each :class:`Piece`, in order.
        progress : callable, optional
            Called with the number of states and the last log time [ns] after each piece.

        Stages work side by side: reading and assembling, evaluating, writing. Of a reading that settles before it begins,
        nothing is written or counted until then.
        """
        if self.reading.settles:
            for piece in self.reading.settling(SIZE):
                self._settle(piece.states)
            self._begin()
        self._run(outputs, progress)
        outcome, reading = self.outcome, self.reading
        outcome.account, outcome.offset, outcome.end = reading.account(), reading.offset, self._memory()

    def _settle(self, states):
        if len(states):
            self.take(states)

    def _begin(self):
        """Go on from here as if nothing had been seen, but knowing what is known."""
        before = self.outcome
        self.reading.intake.anew()
        collisions = self._collisions(not self._detector and before.collisions.goes_on)
        self.outcome = Outcome(self.model, before.quality.anew(), *self._observing, collisions, self._touches())
        self.outcome.begin = self._memory()

    def _memory(self):
        """What later results depend on; see `diag_dynamics.recordings.seams`."""
        outcome = self.outcome
        return {
            "intake": self.reading.intake.memory(),
            "observer": self._observer.memory(),
            "windows": self._windows.memory(),
            "quality": outcome.quality.memory(),
            "colliding": self._detector.memory() if self._detector else outcome.collisions.goes_on,
        }

    def _run(self, outputs, progress):
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
                    if len(states) and not _put(evaluated, self.take(states), stop):
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
        observed, judged = self._observer.take(states, s), None
        self.outcome.observed += int(observed[3].sum())
        if self._detector:
            judged = self._detector.judge(states.stamp, observed[0], observed[1], observed[3], states.jumped)
            observed = *observed[:4], judged.alarm
        windows = self._windows.take(states, s)
        self.outcome.balance.take(windows)
        self.outcome.quality.take(states)
        self.outcome.efforts.take(states.position[:, -self.model.nv :], states.effort)
        self.outcome.motion.take(states)
        self._note(states, s, observed, judged)
        if self.outcome.touches and len(states):
            self._touch(states)
        return Piece(states, s, observed, windows, judged)

    def _touch(self, states):
        """Take note of what a touch would have cost."""
        stamps = states.stamp
        before = stamps[0] if self._newest is None else self._newest
        since = np.diff(stamps, prepend=before) * 1e-9
        self._newest = int(stamps[-1])
        contact = self._dynamics.contact_batch(states.position, states.velocity, self._points, threads=self._threads)
        self.outcome.touches.take(stamps, since, contact)

    def _evaluated(self, states):
        """States that can be evaluated, and their evaluation."""
        known = states.effort_known.all()
        while True:
            efforts = states.effort if known else np.where(states.effort_known[:, None], states.effort, 0.0)
            try:
                return states, self._dynamics.evaluate_batch(
                    states.position, states.velocity, efforts, threads=self._threads, friction=self.friction
                )
            except DiagDynamicsError as error:
                states = self._without_bad(states, efforts, error)

    def _without_bad(self, states, efforts, error):
        """States without those that cannot be evaluated, which are counted as the monitor counts them."""
        good = np.ones(len(states), dtype=bool)
        for t in range(len(states)):
            try:
                self._dynamics.evaluate(states.position[t], states.velocity[t], efforts[t])
            except DiagDynamicsError as one:
                good[t] = False
                self.reading.intake.reject(int(states.log_time[t]), one)
        if good.all():
            raise error  # of something else
        return states[good]

    def _note(self, states, s, observed, judged):
        stamps, names = states.stamp, self.model.dof_names
        residual, torque, norm, valid, collision = observed
        peaks = self.outcome.peaks
        self.outcome.take_energy(s.kinetic_energy)
        peaks.take("kinetic_energy", s.kinetic_energy, stamps)
        peaks.take("energy_share", s.energy_share, stamps, names)
        peaks.take("velocity", states.velocity, stamps, names, absolute=True)
        peaks.take("effort", states.effort, stamps, names, absolute=True)
        if valid.any():
            peaks.take("external_torque", torque, stamps, names, absolute=True)
            peaks.take("residual_norm", norm, stamps)
        if judged:
            self.outcome.collisions.take(stamps, norm, judged)
        else:
            self.outcome.collisions.take(stamps, residual, norm, collision)


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
