# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque and collisions at the monitor's states."""

import math

import numpy as np

from diag_dynamics.collision.detector import RELEASE, AlarmDetector, AlarmThresholds
from diag_dynamics.collision.events import Alarms
from diag_dynamics.control.observer import Disturbance, DisturbanceObserver
from diag_dynamics.nodes.monitor.load import LoadWatch
from diag_dynamics.nodes.support.diagnostics import OK, STALE, WARN, Status, counted, steady
from diag_dynamics.nodes.support.messages import CollisionThresholds


class TorqueWatch:
    """A disturbance observer, and a collision detector on its results.

    At the last state `seen` is the Disturbance, with the detector's collision, and `begins` whether a
    collision begins; `cause` describes the last collision of this interval of reports. `is_judged` is
    whether there are thresholds. The detector gets r and m r without the load of `load`, a LoadWatch or
    None.
    """

    def __init__(self, dynamics, observation, link=""):
        self._collisions, self._origin, self._is_reported = 0, None, False
        self.start_interval()
        self.use(dynamics, observation, link)

    def use(self, dynamics, observation, link=""):
        """Restart with another model or other parameters; `link` carries loads that are no contact."""
        self.dynamics, self.observation = dynamics, observation
        gain, threshold, release, friction, max_gap, alarms, settles_on = observation[:7]
        if alarms is None:
            ratio = release / threshold if threshold < math.inf else RELEASE
            alarms = AlarmThresholds({}, math.inf, threshold, ratio, 0.0, math.inf)
        options = {"friction": friction, "max_gap": max_gap, "settles_on": settles_on}
        self._observer = DisturbanceObserver(dynamics, gain, **options)
        self._detector = AlarmDetector(dynamics.model.dof_names, alarms)
        self.is_judged = bool(np.isfinite(self._detector.limits).any())
        self.load = LoadWatch(dynamics, link, observation) if link else None
        self.forget()

    def use_gravity(self, dynamics):
        """Use a model that differs in gravity alone, without a restart."""
        self.dynamics = dynamics
        self._observer.use(dynamics)
        if self.load:
            self.load.estimator.use(dynamics)

    def forget(self):
        """Restart at the next state, for example after a jump of time."""
        self._observer.reset()
        self._detector.reset()
        if self.load:
            self.load.forget()
        self._alarms = Alarms(self._detector)
        self._joints = np.zeros(len(self._detector.limits) - 2, dtype=bool)
        self.seen, self.begins = Disturbance(False, "no state yet"), False

    @property
    def alarming(self):
        """Thresholds of and collisions at joints; None without parameters `alarm.*`."""
        return CollisionThresholds(self._detector.limits, self._joints) if self.observation.alarms else None

    def start_interval(self):
        """Start a report interval."""
        self._count, self._valid, self._largest, self.cause = 0, 0, 0.0, ""

    def accept_state(self, state):
        """Return whether a RobotState with whole efforts is in a collision without a report."""
        stamps = np.array([state.newest])
        if self._origin is None:
            self._origin = state.newest  # a double resolves no nanoseconds since 1970
        time = 1e-9 * (state.newest - self._origin)
        seen = self._observer.update(time, state.position, state.velocity, state.effort)
        if self.observation.alarms is None and not seen.valid and state.effort is not None:
            self._detector.reset()  # as the observer has been
        torque = seen.external_torque if seen.valid else np.zeros(len(self._joints))
        r = seen.residual if seen.valid else torque
        if self.load:
            r, torque = self.load.accept_state(time, state, seen, r, torque)
        judged = self._detector.judge(stamps, r[None], torque[None], np.array([seen.valid]))
        self.seen, self._joints = seen._replace(collision=bool(judged.alarm[0])), judged.joints[0]
        self.begins = bool(judged.begins[0])
        self._collisions += self.begins
        self._count, self._valid = self._count + 1, self._valid + seen.valid
        self._largest = max(self._largest, seen.norm)
        if self.seen.collision:
            self._alarms.add_states(stamps, np.array([seen.norm]), judged)
            del self._alarms.found[:-1]
            self.cause = self._alarms.found[0].describe()
        return self.seen.collision and not self._is_reported

    def report(self, without_effort):
        """Return the status of this interval, given the names of joints without effort."""
        self._is_reported = bool(self.cause)
        if not self._count:
            return Status("external torque", STALE, "no states since the last report")
        values = {"collisions": self._collisions}
        values["states without result"] = self._count - self._valid
        if self._valid:
            values["largest |r| [J^0.5/s]"] = f"{self._largest:.6g}"
        if self.seen.valid:
            values["|r| [J^0.5/s]"] = f"{self.seen.norm:.6g}"
        level, message = WARN, f"collision: {self.cause}"
        if not self.cause and self._valid:
            level, message = OK, "no collision" if self.is_judged else "observer runs without thresholds"
        elif not self.cause:
            lacking = without_effort and f"joints without effort: {counted(without_effort)}"
            message = lacking or steady(self.seen.reason)
        return Status("external torque", level, message, values)
