# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque, collisions and loads at the monitor's states."""

import numpy as np

from diag_dynamics.collision.detector import Alarms, Detector
from diag_dynamics.control.dead_zone import DeadZone
from diag_dynamics.control.load import LoadEstimator
from diag_dynamics.control.observer import Disturbance, DisturbanceObserver
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.statuses import OK, STALE, WARN, Status, without_numbers
from diag_dynamics.wire.fields import Alarming


class LiveAlarm:
    """A detector at the monitor's states.

    At the last state `on` is whether its alarm is on, `begins` whether an event begins, and
    `joints` which joints are active.
    """

    def __init__(self, names, thresholds):
        self._detector, self.count = Detector(names, thresholds), 0
        self.limits = self._detector.limits
        self.reset()

    def reset(self):
        """Restart at the next state."""
        self._detector.reset()
        self._alarms = Alarms(self._detector)
        self.on = self.begins = False
        self.joints = np.zeros(len(self.limits) - 2, dtype=bool)

    def accept_state(self, stamps, r, torque, norm, touched):
        """Judge rows r and m r, which are None without a result.

        `touched` returns the TouchedLink of this row, None if it is unknown.
        """
        valid = np.array([r is not None])
        r, torque = (np.zeros((1, len(self.joints))),) * 2 if r is None else (r, torque)
        judged = self._detector.judge(stamps, r, torque, valid)
        self.on, self.begins = bool(judged.alarm[0]), bool(judged.begins[0])
        self.joints = judged.joints[0]
        self.count += self.begins
        if self.on:
            self._alarms.add_states(stamps, np.array([norm]), judged, touched())
            del self._alarms.alarms[:-1]

    def cause(self):
        """Return the touched link with its probability, and the detectors of the last alarm."""
        last = self._alarms.alarms[0]
        if not last.link:
            return last.describe()
        return f"{last.link} ({last.confidence:.2f}): {last.describe()}"


class LoadWatch:
    """A load estimator on the results of a disturbance observer.

    `estimate` is the Load of the last state, `begins` whether `is_load` begins there.
    """

    def __init__(self, dynamics, link, observation):
        covariance = observation.covariance_of(dynamics.model.dof_names)
        self.link, self.estimator = (
            link,
            LoadEstimator(dynamics, link, observation.gain, covariance),
        )
        self.forget()

    def forget(self):
        """Reset the estimate."""
        self.estimator.reset()
        self.estimate, self.begins = self.estimator.last, False

    def accept_state(self, time, state, seen, r, torque):
        """Return r and m r of a RobotState, without the part of the load while there is one.

        `seen` is the Disturbance. Without efforts the observer skips a state, and so does the
        estimator.
        """
        was_load = self.estimate.is_load
        if state.effort is not None:
            external = torque if seen.valid else None
            self.estimate = self.estimator.update(time, state.position, state.velocity, external)
        self.begins = self.estimate.is_load and not was_load
        if seen.valid and self.estimate.is_load:
            torque = torque - self.estimator.torque
            r = self.estimator.dynamics.epsilon_from_tau(state.position, torque)
        return r, torque

    def describe(self):
        """Return mass and link of the load as a text."""
        load = self.estimate
        return f"load {load.mass:.3g} ± {load.mass_deviation:.2g} kg at '{self.link}'"

    def report(self):
        """Return the status of the load."""
        load = self.estimate
        if not load.valid:
            return Status("load", STALE, without_numbers(load.reason))
        values = {
            "mass [kg]": f"{load.mass:.4g}",
            "standard deviation of mass [kg]": f"{load.mass_deviation:.2g}",
        }
        values["explained"] = f"{load.explained:.3f}"
        if load.is_significant:
            values["centre of mass [m]"] = " ".join(f"{x:.3f}" for x in load.center)
        return Status(
            "load", OK, f"{'load' if load.is_load else 'no load'} at '{self.link}'", values
        )


def check_load_link(model, link):
    """Raise InputError if the model lacks the link of the load."""
    if link and (link not in model.link_names or not model.placement_in_body(link)[0]):
        raise InputError(
            f"parameter 'load.link' is '{link}'; expected a link of robot '{model.name}' "
            "that a joint moves."
        )


class TorqueWatch:
    """A disturbance observer, and detectors of collision and contact on its results.

    At the last state `seen` is the Disturbance; `is_collision` and `is_contact` are whether there
    is one, `begins` and `contact_begins` whether one begins; `cause` and `contact_cause` describe
    the last one of this interval of reports. `is_judged` is whether there are thresholds of
    collisions, `covariance` the noise of m r, None if it is unknown. `load` is a LoadWatch or None.
    `contact_torque` is m r without that load; detectors and forces are about it.
    `withheld_wrenches` counts external wrenches that are not published in this interval.
    """

    def __init__(self, dynamics, observation, link):
        self._origin, self._collision = None, ""  # message while a collision lasts
        self._reported_count = 0
        self._alarm = self._contact = None
        self.start_interval()
        self.use(dynamics, observation, link)

    def use(self, dynamics, observation, link):
        """Restart with another model or other parameters; `link` carries loads that are no contact."""
        self.dynamics, names = dynamics, dynamics.model.dof_names
        self._observer = DisturbanceObserver(
            dynamics, observation.gain, friction=observation.friction
        )
        self._zone = DeadZone(dynamics, observation.collision.stiction)
        self.covariance = observation.covariance_of(names)
        before = self._alarm, self._contact
        self._alarm = LiveAlarm(names, observation.collision)
        self._contact = LiveAlarm(names, observation.contact)
        for alarm, earlier in zip((self._alarm, self._contact), before, strict=True):
            if earlier:
                alarm.count = earlier.count
        self.is_judged = bool(observation.collision.limits)
        self.load = LoadWatch(dynamics, link, observation) if link else None
        self.forget()

    def use_gravity(self, dynamics):
        """Use a model that differs in gravity alone, without a restart."""
        self.dynamics = dynamics
        self._observer.use(dynamics)
        self._zone.use(dynamics)
        if self.load:
            self.load.estimator.use(dynamics)

    def forget(self):
        """Restart at the next state, for example after a jump of time."""
        self._observer.reset()
        self._zone.reset()
        if self.load:
            self.load.forget()
        for alarm in (self._alarm, self._contact):
            alarm.reset()
        self.seen, self._touched = Disturbance(False, "no state yet"), None
        self._position = self.contact_torque = None

    @property
    def alarming(self):
        """Alarming of the last state."""
        limits = self._alarm.limits, self._contact.limits
        return Alarming(*limits, self._alarm.joints, self._alarm.on, self._contact.on)

    @property
    def is_collision(self):
        """Whether there is a collision at the last state."""
        return self._alarm.on

    @property
    def is_contact(self):
        """Whether there is a contact at the last state."""
        return self._contact.on

    @property
    def begins(self):
        """Whether a collision begins at the last state."""
        return self._alarm.begins

    @property
    def contact_begins(self):
        """Whether a contact begins at the last state."""
        return self._contact.begins

    @property
    def touched(self):
        """TouchedLink at the last state, computed on demand; None without a result or covariance."""
        if self._touched is None and self.seen.is_whole and self.covariance is not None:
            self._touched = self.dynamics.touched_link(
                self._position, self.contact_torque, self.covariance
            )
        return self._touched

    def start_interval(self):
        """Start a report interval."""
        self._count, self._valid, self._largest = 0, 0, 0.0
        self.withheld_wrenches = 0
        self.cause = self.contact_cause = ""

    def accept_state(self, state):
        """Return whether a RobotState with whole efforts is in a collision without a report."""
        stamps = np.array([state.newest])
        if self._origin is None:
            self._origin = state.newest  # a double resolves no nanoseconds since 1970
        time = 1e-9 * (state.newest - self._origin)
        effort = state.partial if state.effort is None else state.effort
        seen = self._observer.update(time, state.position, state.velocity, effort)
        r = torque = None
        if seen.valid:  # components that an unknown effort changes have no alarm
            r, torque = np.nan_to_num(seen.residual), np.nan_to_num(seen.external_torque)
        if self.load:
            r, torque = self.load.accept_state(time, state, seen, r, torque)
        self.seen, self._touched = seen, None
        self._position, self.contact_torque = state.position, torque
        nothing = np.zeros(len(state.velocity))
        columns = (r, torque) if seen.valid else (nothing, nothing)
        columns = state.position, state.velocity, *columns
        rows = self._zone.lower(stamps, *(column[None] for column in columns))
        if not seen.valid:
            rows = None, None
        self._alarm.accept_state(stamps, *rows, seen.norm, self._touched_row)
        self._contact.accept_state(stamps, *rows, seen.norm, self._touched_row)
        self._count, self._valid = self._count + 1, self._valid + seen.valid
        self._largest = max(self._largest, seen.norm)
        if self._alarm.on:
            self.cause = self._alarm.cause()
        if self._contact.on:
            self.contact_cause = self._contact.cause()
        return self._alarm.on and not self._collision

    def _touched_row(self):
        """Return `touched` as a result of one row."""
        if not (touched := self.touched):
            return None
        names = "link", "confidence", "chi_square"
        arrays = {name: np.array([getattr(touched, name)]) for name in names}
        return touched._replace(probability=touched.probability[None], **arrays)

    def report(self, without_effort):
        """Return the status of this interval, given the names of joints without effort."""
        if not self.cause:
            self._collision = ""
        elif not self._collision or self._alarm.count != self._reported_count:
            self._collision = f"collision: {without_numbers(self.cause)}"
        self._reported_count = self._alarm.count
        if not self._count:
            return Status("external torque", STALE, "no states since the last report")
        values = {"collisions": self._alarm.count, "contacts": self._contact.count}
        values["states without result"] = self._count - self._valid
        if self.withheld_wrenches:
            values["wrenches with unobserved directions"] = self.withheld_wrenches
        if self._valid:
            values["largest |r| [J^0.5/s]"] = f"{self._largest:.6g}"
        if self.seen.valid:
            values["|r| [J^0.5/s]"] = f"{self.seen.norm:.6g}"
        if cause := self.cause or self.contact_cause:
            values["detectors"] = cause
        if self.cause:
            return Status("external torque", WARN, self._collision, values, is_logged=True)
        lacking = without_effort and f"joints without effort: {counted(without_effort)}"
        if not self._valid:
            message = lacking or without_numbers(self.seen.reason)
            return Status("external torque", WARN, message, values)
        message = "no collision" if self.is_judged else "observer runs without thresholds"
        if self.contact_cause:
            message = f"contact: {without_numbers(self.contact_cause)}"
        if lacking:
            return Status("external torque", WARN, f"{message}; {lacking}", values)
        return Status("external torque", OK, message, values)
