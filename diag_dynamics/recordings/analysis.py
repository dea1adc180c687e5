# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analysis of a recording: evaluate, observe and judge states in batches, and sum them up."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from diag_dynamics.collision.detector import Alarms, Detector, Judged, Thresholds
from diag_dynamics.control.dead_zone import DeadZone
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.recordings.balance import MIN_EXPLAINED, Balance
from diag_dynamics.recordings.data_checks import EffortRange, MotionSample
from diag_dynamics.recordings.external_torque import Observed, Observer, find_touched_links
from diag_dynamics.recordings.findings import REJECTED, explain_missing_efforts
from diag_dynamics.recordings.sampling import Quality
from diag_dynamics.recordings.states import States
from diag_dynamics.recordings.windows import column_maxima
from diag_dynamics.results import Evaluation

MAX_INTERVAL = 0.5  # longest interval between states that is counted [s]


class Piece(NamedTuple):
    """A batch of states and its analysis."""

    states: States
    s: Evaluation
    observed: Observed
    judged: Judged  # by the thresholds of collision
    contact: Judged  # by those of contact


class ContactExposure:
    """Compare predicted contact at ContactPoints with their limits, batch by batch."""

    def __init__(self, points):
        self._above = np.zeros(len(points.names))
        self._any_above = 0.0
        self._duration = 0.0
        self._names = points.names
        self._last = None
        self._worst = {"usage": 0.0}

    def add_states(self, stamps, contact):
        """Add states: stamps [ns] and PredictedContact."""
        since = np.diff(stamps, prepend=stamps[0] if self._last is None else self._last) * 1e-9
        self._last = int(stamps[-1])
        interval = np.where((since > 0.0) & (since <= MAX_INTERVAL), since, 0.0)
        usage = contact.usage
        above = usage > 1.0
        self._above += interval @ above
        self._any_above += float(interval @ above.any(axis=1))
        self._duration += float(interval.sum())
        t, k = np.unravel_index(np.argmax(usage), usage.shape)
        if usage[t, k] > self._worst["usage"]:
            names = {
                "point": contact.names[k],
                "link": contact.links[k],
                "region": contact.region(k, t),
            }
            numbers = {
                name: float(getattr(contact, name)[t, k])
                for name in ("speed", "reflected_mass", "energy", "force")
            }
            self._worst = {"usage": float(usage[t, k]), **names, **numbers, "at": int(stamps[t])}

    def summary(self, time):
        """Return `above`, `of`, `above_by_point` [s] and `worst`, the worst moment; None at rest.

        `time` converts stamps [ns] to times [s].
        """
        by_point = zip(self._names, self._above.tolist(), strict=True)
        worst = self._worst
        return {
            "above": self._any_above,
            "of": self._duration,
            "above_by_point": {name: seconds for name, seconds in by_point if seconds},
            "worst": worst | {"at": time(worst["at"])} if "at" in worst else None,
        }


class Analysis:
    """Analyse a Reading: :meth:`run` returns the summary.

    The observer has this gain [1/s] if the settings of the Reading have none.
    """

    def __init__(self, reading, *, gain=25.0, threads=None):
        model = reading.model
        settings = reading.settings
        values = settings.values
        names = model.dof_names
        observation = settings.observation
        collision = contact = Thresholds()
        self._covariance = None
        if observation:
            gain = observation.gain
            collision = observation.collision
            contact = observation.contact
            self._covariance = observation.covariance_of(names)
        self.reading = reading
        self.model = model
        self.gain = gain
        self._threads = threads
        self._options = {"threads": threads, "friction": model.has_friction}
        # parameters without which no collision is reported
        self._missing = settings.unjudged_without
        self._dynamics = DiagonalDynamics(model)
        self._observer = Observer(
            self._dynamics,
            gain,
            friction=model.has_friction and values["external_torque.friction"],
            threads=threads,
        )
        self._zone = DeadZone(self._dynamics, collision.stiction, gain)
        self._detectors = Detector(names, collision), Detector(names, contact)
        self._collisions, self._contacts = (Alarms(detector) for detector in self._detectors)
        points = reading.contact_points[0] if settings.contact_limits is not None else None
        self._points = points if points and points.limited.any() else None
        self._exposure = ContactExposure(self._points) if self._points else None
        self._balance = Balance(model.has_friction)
        self._quality = Quality(model)
        self._peaks = {}  # largest value, its stamp [ns], and its joint or None, by quantity
        self._shares = np.full(model.nv, -np.inf)
        self._efforts = EffortRange(model)
        self._motion = MotionSample(model)
        self._unavailable = np.isin(names, reading.intake.assembler.unavailable_efforts)
        # Joints without an external torque at some observed state
        self._unobserved = np.zeros(model.nv, bool)
        # Number of states, number with a residual, and sum of K [J]
        self.states = 0
        self._observed = 0
        self._kinetic = 0.0

    def run(self, outputs=(), progress=None):
        """Analyse all states, write them to outputs, and return the summary.

        The keys of the summary are listed in docs/recordings.md. An output has `write(piece)`,
        `close(summary)`, and `drop()` for a file that is not complete. `progress` is called with
        the number of states. Raise InputError without any state.
        """
        opened = []
        try:
            opened.extend(outputs)  # some may have been opened when another one fails
            for batch in self.reading.pieces():
                piece = self.analyse_batch(batch.states) if len(batch.states) else None
                if piece is None:
                    continue
                for output in opened:
                    output.write(piece)
                if progress:
                    progress(self.states)
            if not self.states:
                raise self.reading.no_states_error()
            summary = self._summarize()
            for output in opened:
                output.close(summary)
        except BaseException:
            for output in opened:
                output.drop()
            raise
        return summary

    def analyse_batch(self, states):
        """Evaluate states, add them to the results, and return the :class:`Piece`.

        Return None if no state can be evaluated.
        """
        states, s = self._evaluate(self._efforts.hide_constant(states))
        if not len(states):
            return None
        observed = self._observer.observe_batch(states)
        residual, torque, _, valid = observed
        self._unobserved |= np.isnan(torque[valid]).any(axis=0)
        motion = states.stamp, states.position, states.velocity
        lowered = self._zone.lower(*motion, residual, torque, states.jumped)
        # components that an unknown effort changes have no alarm
        columns = states.stamp, *map(np.nan_to_num, lowered), valid, states.jumped
        strength = np.linalg.norm(np.nan_to_num(residual), axis=1)
        judged = []
        for detector, alarms in zip(
            self._detectors, (self._collisions, self._contacts), strict=True
        ):
            judged.append(detector.judge(*columns))
            touched = find_touched_links(
                self._dynamics,
                states.position,
                observed,
                self._covariance,
                judged[-1].alarm,
                threads=self._threads,
            )
            alarms.add_states(states.stamp, strength, judged[-1], touched)
        self._balance.add_states(*self._with_model_efforts(states, s))
        self._balance.moved = self._efforts.moved
        self._quality.add_states(states)
        self._motion.add_states(states)
        if self._exposure:
            _, *motion = motion
            contact = self._dynamics.contact_limits(*motion, self._points, threads=self._threads)
            self._exposure.add_states(states.stamp, contact)
        self._add_figures(states, s, observed)
        return Piece(states, s, observed, *judged)

    def _with_model_efforts(self, states, s):
        """Return states and their evaluation with the model's efforts where none are available."""
        unknown = self._unavailable
        if not unknown.any() or unknown.all() or len(states) < 2:
            return states, s
        motion = states.position, states.velocity
        with np.errstate(all="ignore"):
            changes = np.gradient(states.velocity, states.stamp / SECOND, axis=0)
        changes = np.nan_to_num(changes, posinf=0.0, neginf=0.0)
        torque = self._dynamics.inverse_dynamics(*motion, changes, **self._options)
        effort = np.where(unknown, torque, states.effort)
        is_known = np.isfinite(effort).all(axis=1)
        s = self._dynamics.evaluate(*motion, np.nan_to_num(effort), **self._options)
        return replace(states, effort=effort, effort_known=is_known), s

    def _add_figures(self, states, s, observed):
        names = self.model.dof_names
        energy = s.kinetic_energy
        self.states += len(states)
        self._observed += int(observed.valid.sum())
        self._kinetic += float(energy.sum())
        self._shares = np.fmax(self._shares, column_maxima(s.energy_share))
        for quantity, values, joints in (
            ("kinetic_energy", energy[:, None], (None,)),
            ("energy_share", s.energy_share, names),
            ("velocity", np.abs(states.velocity), names),
            ("effort", np.abs(states.effort), names),
            ("external_torque", np.abs(observed.external_torque), names),
            ("residual_norm", observed.norm[:, None], (None,)),
        ):
            largest = column_maxima(values)
            peak = float(largest.max(initial=-np.inf))
            if peak > self._peaks.get(quantity, (-np.inf,))[0]:
                k = int(np.argmax(largest))
                t = np.argmax(values[:, k] == peak)
                self._peaks[quantity] = peak, int(states.stamp[t]), joints[k]

    def _evaluate(self, states):
        """Return the states that can be evaluated, and their evaluation.

        Others are counted as by the monitor.
        """
        effort = np.where(states.effort_known[:, None], states.effort, 0.0)
        columns = states.position, states.velocity, effort
        try:
            return states, self._dynamics.evaluate(*columns, **self._options)
        except DiagDynamicsError:
            good = np.ones(len(states), bool)
            for t, state in enumerate(zip(*columns, strict=True)):
                try:
                    self._dynamics.evaluate(*state)
                except DiagDynamicsError as error:
                    good[t] = False
                    self.reading.intake.reject(int(states.log_time[t]), error)
            if good.all():
                raise  # of something else
            return self._evaluate(states[good])

    # --- Summary ---

    def _summarize(self):
        time = self.reading.time
        names = np.array(self.model.dof_names)
        counts = dict(sorted(self.reading.counts.items()))
        alarms = self._collisions.alarms
        quality, warnings = self._quality.report()
        balance = self._balance
        energy, at, _ = self._peaks["kinetic_energy"]
        unmeasured = self._efforts.unmeasured()
        is_beside = balance.is_explained_beside(alarms)
        is_good = is_beside or (balance.explained or 0.0) >= MIN_EXPLAINED
        is_judged = self._efforts.moved and not (is_good or unmeasured)
        fault = self._motion.fault() if is_judged else None
        text = fault.text if fault else ""
        partial = names[~self._unavailable].tolist() if self._unavailable.any() else []
        contacts = (
            self._describe_unobserved(),
            self._describe_unknown_contacts(quality["without_effort"]),
            f"Collisions are doubtful: {text}." if text and alarms else "",
        )
        return {
            "robot": self.model.name,
            "degrees_of_freedom": names.tolist(),
            "states": self.states,
            "duration": self._quality.duration,
            "begin": time(self._quality.begin),
            "end": time(self._quality.end),
            "counts": counts,
            "rejected": {
                key.removeprefix(REJECTED): n
                for key, n in counts.items()
                if key.startswith(REJECTED) and n
            },
            "kinetic_energy": {
                "mean": self._kinetic / self.states,
                "max": energy,
                "at": time(at),
                "share": dict(zip(names.tolist(), self._shares.tolist(), strict=True)),
            },
            "peaks": {
                name: {"value": value, "at": time(at), "of": of}
                for name, (value, at, of) in self._peaks.items()
            },
            "explained": balance.explained,
            "explained_with_potential": balance.explained_total,
            "residual_power": balance.residual_power,
            "balance": balance.summary(unmeasured or text, is_beside, partial),
            "efforts": {"unmeasured": unmeasured, "text": text},
            "observer": {
                "gain": self.gain,
                "judged": list(self._collisions.judged),
                "missing": list(self._missing),
                "observed": self._observed,
                "unobserved": names[self._unobserved].tolist(),
                "text": " ".join(filter(None, contacts)),
            },
            "collisions": _list_alarms(alarms, time),
            "contacts": (
                _list_alarms(self._contacts.alarms, time) if self._contacts.judged else None
            ),
            "contact_limits": self._exposure.summary(time) if self._exposure else None,
            "quality": quality,
            "warnings": [unmeasured, *warnings] if unmeasured else warnings,
            "findings": [finding._asdict() for finding in self.reading.findings()],
            "recording": self.reading.path,
        }

    def _describe_unobserved(self):
        """Return a text on joints without external torque, because their efforts are unknown.

        The text is empty if there are none.
        """
        if not self._unobserved.any():
            return ""
        names = "all joints"
        others = ""
        if not self._unobserved.all():
            names = ", ".join(np.array(self.model.dof_names)[self._unobserved])
            others = " Other joints are judged."
        return (
            f"External torque of {names}, and with it |r|, is unknown, because efforts are.{others}"
        )

    def _describe_unknown_contacts(self, without_effort):
        """Return why collisions are unknown; or an empty text."""
        states = self.states
        unknown = states - self._observed
        missing = self._missing
        if not self._observed:
            why = "the observer has no result at any state"
            if without_effort == states:
                why = explain_missing_efforts(self.reading.counts)
        elif missing:
            why = (
                f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not set. "
                "diag-dynamics calibrate computes thresholds for --alarms"
            )
        elif unknown > 1:  # the first one never has a result
            return (
                f"Collisions are unknown at {unknown} of {states} states: "
                "the observer has no result there."
            )
        else:
            return ""
        return f"Collisions are unknown: {why}."


def _list_alarms(alarms, time):
    """Return the entries of collisions or contacts."""
    return [
        {
            "start": time(alarm.start),
            "end": time(alarm.end),
            "joints": list(alarm.joints),
            "norm": alarm.norm,
            "text": alarm.describe(),
        }
        | ({"link": alarm.link, "confidence": alarm.confidence} if alarm.chi_square else {})
        for alarm in alarms
    ]
