# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Watches of external torque and of loads: detectors, topics, reaction, log and statuses."""

import numpy as np

from diag_dynamics.collision.detector import Alarms, Detector
from diag_dynamics.control.dead_zone import DeadZone
from diag_dynamics.control.load import LoadEstimator
from diag_dynamics.control.observer import Disturbance, DisturbanceObserver
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.monitor.watch import Watch
from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.statuses import OK, STALE, WARN, Status, without_numbers
from diag_dynamics.parameters.shared import NO_PAYLOAD
from diag_dynamics.text import shortened
from diag_dynamics.wire.fields import Alarming


class LiveAlarm:
    """A detector at the monitor's states.

    At the last state `on` is whether its alarm is on, `begins` whether an event begins, `starts`
    whether this event is no rise within an alarm, and `joints` which joints are active. `count` is
    the number of events, `cause` describes the last one since the last report.
    """

    def __init__(self):
        self.count = 0
        self.cause = ""

    def use(self, names, thresholds):
        """Restart with other thresholds."""
        self._detector = Detector(names, thresholds)
        self.limits = self._detector.limits
        self.reset()

    def reset(self):
        """Restart at the next state."""
        self._detector.reset()
        self._alarms = Alarms(self._detector)
        self.on = self.begins = self.starts = False
        self.joints = np.zeros(len(self.limits) - 2, dtype=bool)

    def accept_state(self, stamps, r, torque, valid, norm, touched):
        """Judge rows r and m r, which are zero unless `valid`.

        `touched` returns the TouchedLink of this row, None if it is unknown.
        """
        judged = self._detector.judge(stamps, r, torque, np.array([valid]))
        self.on = bool(judged.alarm[0])
        self.begins = bool(judged.begins[0])
        self.starts = self.begins and self._detector.starts
        self.joints = judged.joints[0]
        self.count += self.begins
        if not self.on:
            return
        self._alarms.add_states(stamps, np.array([norm]), judged, touched())
        del self._alarms.alarms[:-1]
        last = self._alarms.alarms[0]
        link = f"{last.link} ({last.confidence:.2f}): " if last.link else ""
        self.cause = link + last.describe()


class CollisionWatch(Watch):
    """Collisions and contacts by a disturbance observer, if `external_torque.gain` is set.

    `observer` is a DisturbanceObserver or None. At the last state `seen` is the Disturbance;
    `collision` and `contact` are LiveAlarms.
    `covariance` is the noise of m r, None if it is unknown. `contact_torque` is m r without the
    load of the robot's LoadWatch; detectors and forces are about it.
    """

    def __init__(self, robot, node):
        super().__init__(robot, node)
        self.collision = LiveAlarm()
        self.contact = LiveAlarm()
        self.observer = self._options = self._origin = self.covariance = None
        self._message = ""  # while a collision lasts
        self._reported_count = 0
        self._unobserved_frame = ""  # that the log has
        self._start_interval()

    def configure(self, dynamics, settings):
        """See Watch. The observer restarts if model, parameters or input options changed."""
        model = dynamics.model
        observation = settings.observation
        link = settings.values["load.link"]
        _require_moved(model, "external_wrench.frames", settings.frames)
        _require_moved(model, "load.link", [link] if link else [])
        if observation:
            observation.collision.of_names(model.dof_names)
            observation.contact.of_names(model.dof_names, "contact.threshold")
            observation.covariance_of(model.dof_names)
        options = observation, settings.inputs._replace(stuck_timeout=0.0), link
        if observation is None:
            self.observer = None
            self._robot.load.use(dynamics, observation, "")
            self.forget()
        elif self.observer is None or self._dynamics is not dynamics or self._options != options:
            self._robot.load.use(dynamics, observation, link)  # raises InputError
            self._restart(dynamics, observation)
        self._options = options
        if settings.frames:
            dynamics.compile("wrench")
        if observation and observation.covariance:
            dynamics.compile("touched_link")

    def _restart(self, dynamics, observation):
        """Restart with another model or other parameters."""
        self._dynamics = dynamics
        names = dynamics.model.dof_names
        friction = observation.friction
        self.observer = DisturbanceObserver(dynamics, observation.gain, friction=friction)
        self._zone = DeadZone(dynamics, observation.collision.stiction, observation.gain)
        self.covariance = observation.covariance_of(names)
        self.collision.use(names, observation.collision)
        self.contact.use(names, observation.contact)
        self.is_judged = bool(observation.collision.limits)
        self.forget()

    def use_gravity(self, dynamics):
        """Use a model that differs in gravity alone, without a restart."""
        if self.observer:
            self._dynamics = dynamics
            self.observer.use(dynamics)
            self._zone.use(dynamics)
            self._robot.load.use_gravity(dynamics)

    def forget(self):
        """See Watch."""
        self.seen = Disturbance(False, "no state yet")
        self._touched = None
        if self.observer:
            self.observer.reset()
            self._zone.reset()
            self.collision.reset()
            self.contact.reset()

    @property
    def touched(self):
        """TouchedLink at the last state, computed on demand.

        It is None without a result or covariance.
        """
        if self._touched is None and self.seen.is_whole and self.covariance is not None:
            self._touched = self._dynamics.touched_link(
                self._position, self.contact_torque, self.covariance
            )
        return self._touched

    def _touched_row(self):
        """Return `touched` as a result of one row."""
        if not (touched := self.touched):
            return None
        names = "link", "confidence", "chi_square"
        arrays = {name: np.array([getattr(touched, name)]) for name in names}
        return touched._replace(probability=touched.probability[None], **arrays)

    def accept(self, moment):
        """See Watch. A collision starts the reaction before anything else."""
        if self.observer is None:
            return []
        state = moment.state
        if self._robot.effort_problem(self._node.commands):
            state = state._replace(effort=None, partial=None)
        self.accept_state(state)
        self._node.reaction.accept_state(self, moment.received)
        if self.collision.begins:
            self._node.log_warning(f"Collision: {self.collision.cause}.")
        elif self.contact.begins:
            text = shortened(f"Contact: {self.contact.cause}.")
            self._node.get_logger().info(text, throttle_duration_sec=1.0)
        if not self.collision.on or self._message:
            return []
        return [self._status(), *self._node.reaction.report()]

    def accept_state(self, state):
        """Judge a RobotState with whole or partial efforts."""
        stamps = np.array([state.newest])
        if self._origin is None:
            self._origin = state.newest  # a double resolves no nanoseconds since 1970
        time = 1e-9 * (state.newest - self._origin)
        effort = state.partial if state.effort is None else state.effort
        seen = self.observer.update(time, state.position, state.velocity, effort)
        r = torque = np.zeros(len(state.velocity))
        if seen.valid:  # components that an unknown effort changes have no alarm
            r = np.nan_to_num(seen.residual)
            torque = np.nan_to_num(seen.external_torque)
        r, torque = self._robot.load.remove(time, state, seen, r, torque)
        is_partial = seen.valid and not seen.is_whole
        if is_partial:
            torque = np.where(np.isnan(seen.external_torque), 0.0, torque)
        self.seen = seen
        self._touched = None
        self._position = state.position
        self.contact_torque = torque
        columns = state.position, state.velocity, r, torque
        r, torque = self._zone.lower(stamps, *(column[None] for column in columns))
        if is_partial:
            r = np.where(np.isnan(seen.residual), 0.0, r)
        for alarm in (self.collision, self.contact):
            alarm.accept_state(stamps, r, torque, seen.valid, seen.norm, self._touched_row)
        self._count += 1
        self._valid = self._valid + seen.valid
        self._largest = max(self._largest, seen.norm)

    def publish(self, moment, outputs):
        """See Watch."""
        if self.observer is None:
            return
        robot = self._robot
        state = moment.state
        outputs.publish_beside(
            "external_torque",
            state.newest,
            lambda: robot.encoder.external_torque(self.seen, state, self._alarming(), self.touched),
        )
        frames = robot.settings.frames
        if not (frames and outputs.publish_wrenches(frames, robot, state)):
            return
        self._withheld += 1
        if frames[0] != self._unobserved_frame:
            self._unobserved_frame = frames[0]
            reason = "the joints do not observe all directions (docs/external-wrench.md)"
            self._node.log_warning(f"No external wrench at {frames[0]}: {reason}.")

    def _alarming(self):
        """Return the Alarming of the last state."""
        collision = self.collision
        contact = self.contact
        limits = collision.limits, contact.limits
        return Alarming(*limits, collision.joints, collision.on, contact.on)

    def _start_interval(self):
        self._count = 0
        self._valid = 0
        self._largest = 0.0
        self._withheld = 0
        self.collision.cause = self.contact.cause = ""

    def report(self):
        """See Watch."""
        if self.observer is None:
            return []
        status = self._status()
        self._start_interval()
        return [status]

    def _status(self):
        """Return the status of this interval."""
        if not self.collision.cause:
            self._message = ""
        elif not self._message or self.collision.count != self._reported_count:
            self._message = f"collision: {without_numbers(self.collision.cause)}"
        self._reported_count = self.collision.count
        if not self._count:
            return Status("external torque", STALE, "no states since the last report")
        values = {"collisions": self.collision.count, "contacts": self.contact.count}
        values["states without result"] = self._count - self._valid
        if self._withheld:
            values["wrenches with unobserved directions"] = self._withheld
        if self._valid:
            values["largest |r| [J^0.5/s]"] = f"{self._largest:.6g}"
        if self.seen.valid:
            values["|r| [J^0.5/s]"] = f"{self.seen.norm:.6g}"
        if cause := self.collision.cause or self.contact.cause:
            values["detectors"] = cause
        if self._message:
            return Status("external torque", WARN, self._message, values, is_logged=True)
        lacking = self._robot.assembler.without_effort
        problem = f"joints without effort: {counted(lacking)}" if lacking else ""
        if not self._valid:
            problem = problem or without_numbers(self.seen.reason)
            return Status("external torque", WARN, problem, values)
        message = "no collision" if self.is_judged else "observer runs without thresholds"
        if self.contact.cause:
            message = f"contact: {without_numbers(self.contact.cause)}"
        if problem:
            return Status("external torque", WARN, f"{message}; {problem}", values)
        return Status("external torque", OK, message, values)


def _require_moved(model, parameter, links):
    """Raise InputError unless joints of a model move all links."""
    for link in links:
        if link not in model.link_names or not model.placement_in_body(link)[0]:
            raise InputError(
                f"parameter '{parameter}' is '{link}'; expected a link of robot '{model.name}' "
                "that a joint moves."
            )


class LoadWatch(Watch):
    """A load estimator on the observer's results of the CollisionWatch, if `load.link` is set.

    `link` is empty without it. `estimate` is the Load of the last state, `begins` whether `is_load`
    begins there.
    """

    link = ""
    estimator = None
    begins = False

    def use(self, dynamics, observation, link):
        """Restart with another model or other parameters."""
        estimator = None
        if link:
            covariance = observation.covariance_of(dynamics.model.dof_names)
            estimator = LoadEstimator(dynamics, link, observation.gain, covariance)
        self.link = link
        self.estimator = estimator
        self.forget()

    def use_gravity(self, dynamics):
        """Use a model that differs in gravity alone, without a restart."""
        if self.estimator:
            self.estimator.use(dynamics)

    def forget(self):
        """See Watch."""
        self.begins = False
        if self.estimator:
            self.estimator.reset()
            self.estimate = self.estimator.last

    def remove(self, time, state, seen, r, torque):
        """Return r and m r of a RobotState, without the part of the load while there is one.

        `seen` is the Disturbance. Without efforts the observer skips a state, and so does the
        estimator.
        """
        if not self.estimator:
            return r, torque
        was_load = self.estimate.is_load
        if state.effort is not None:
            external = torque if seen.valid else None
            self.estimate = self.estimator.update(time, state.position, state.velocity, external)
        self.begins = self.estimate.is_load and not was_load
        if seen.valid and self.estimate.is_load:
            torque = torque - self.estimator.torque
            r = self.estimator.dynamics.epsilon_from_tau(state.position, torque)
        return r, torque

    def publish(self, moment, outputs):
        """See Watch."""
        if not self.estimator:
            return
        robot = self._robot
        state = moment.state
        load = self.estimate
        payload = robot.model.payloads.get(self.link, NO_PAYLOAD)
        outputs.publish_beside(
            "load", state.newest, lambda: robot.encoder.load(self.link, load, payload, state)
        )
        if self.begins:
            change = "Picked up" if load.mass > 0.0 else "Put down"
            mass = f"{load.mass:.3g} ± {load.mass_deviation:.2g} kg"
            self._node.log_info(f"{change}: load {mass} at '{self.link}'.")

    def report(self):
        """See Watch."""
        if not self.estimator:
            return []
        load = self.estimate
        if not load.valid:
            return [Status("load", STALE, without_numbers(load.reason))]
        values = {
            "mass [kg]": f"{load.mass:.4g}",
            "standard deviation of mass [kg]": f"{load.mass_deviation:.2g}",
            "explained": f"{load.explained:.3f}",
        }
        if load.is_significant:
            values["centre of mass [m]"] = " ".join(f"{x:.3f}" for x in load.center)
        message = f"{'load' if load.is_load else 'no load'} at '{self.link}'"
        return [Status("load", OK, message, values)]
