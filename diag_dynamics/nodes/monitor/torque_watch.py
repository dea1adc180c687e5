# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque over all states: the disturbance observer at the monitor's states, and what diagnostics say of it."""

import numpy as np

from diag_dynamics.collision.detector import AlarmDetector
from diag_dynamics.collision.events import Alarms, most_pushed
from diag_dynamics.control.observer import Disturbance, DisturbanceObserver
from diag_dynamics.nodes.monitor.collision_log import CollisionLog
from diag_dynamics.nodes.support.diagnostics import OK, STALE, WARN, Status, counted, steady
from diag_dynamics.nodes.support.messages import Alarming


class TorqueWatch:
    """A disturbance observer at states as they are assembled, with efforts that hold gravity.

    Of several states with one stamp the first one counts. A base on which nothing acts has efforts that are known, zero: what
    the ground does to it is external, and so is all that a drive does that is not among the joints.

    Parameters
    ----------
    dynamics : DiagonalDynamics
    observation : Observation

    Attributes
    ----------
    dynamics : DiagonalDynamics
    observation : Observation
    seen : Disturbance
        At the last state.
    alarm : Alarm or None
        The last one, where there are thresholds of alarms; it is on while `seen.collision` says so.
    active : tuple of str
        Detectors that keep it up.
    alarming : Alarming or None
        What it is judged by at the last state, joint by joint; None without thresholds of alarms.
    log : CollisionLog
    """

    def __init__(self, dynamics, observation):
        self._collisions, self._origin = 0, None
        self._colliding = self._without_effort = False
        self._reported = False  # whether diagnostics told of a collision last
        self._cause = ""  # what was above what when the last collision began
        self.log = CollisionLog(dynamics.model)
        self._begin()
        self.use(dynamics, observation)

    def use(self, dynamics, observation):
        """Observe anew, by another model or otherwise."""
        gain, threshold, release, friction, max_gap, alarms = observation
        self.dynamics, self.observation = dynamics, observation
        self._observer = DisturbanceObserver(dynamics, gain, threshold, release, friction=friction, max_gap=max_gap)
        self.seen, self.alarm = Disturbance(False, "no state yet"), None
        self._detector = AlarmDetector(dynamics.model.dof_names, alarms) if alarms else None
        self._alarms = Alarms(self._detector) if alarms else None
        self.log.use(dynamics.model, alarms.hold_off if alarms else 0.0)
        self._joints = np.zeros(len(dynamics.model.dof_names), dtype=bool)

    @property
    def active(self):
        """See above."""
        return self._detector.active if self._detector else ()

    @property
    def alarming(self):
        """See above."""
        return Alarming(self._detector.limits, self._joints) if self._detector else None

    def forget(self):
        """Begin anew at the next state, as after a jump of time or a pause."""
        self._observer.reset()
        self.log.end()
        if self._detector:
            self._detector.reset()
        self.seen = Disturbance(False, "no state yet")

    def _begin(self):
        """Begin another interval between two reports."""
        self._count = self._valid = 0
        self._largest, self._collided, self._above = 0.0, False, False

    def take(self, state):
        """Observe at a RobotState; return whether this is a collision, and the last report told of none."""
        if self._origin is None:
            self._origin = state.newest  # a double holds some hours to the nanosecond, but not the time since 1970
        time = 1e-9 * (state.newest - self._origin)
        seen = self._observer.update(time, state.position, state.velocity, state.effort)
        begins = False
        if self._detector:
            seen, begins = self._judged(state.newest, seen)
        self.seen = seen
        self._without_effort = state.effort is None
        self._count += 1
        self._valid += seen.valid
        self._largest = max(self._largest, seen.norm)
        self._collided |= seen.collision
        if not self._without_effort:
            self._log(state.newest)
        if self._detector:
            self._collisions += begins
            return seen.collision and not self._reported
        self._above |= seen.norm > self.observation.threshold
        if seen.collision and not self._colliding:
            self._cause = self._told(seen)
        if not self._without_effort:  # else the observer remembers
            self._collisions += seen.collision and not self._colliding
            self._colliding = seen.collision
        return seen.collision and not self._reported

    def _log(self, stamp):
        """Write log lines on the last state."""
        seen, torque = self.seen, self.seen.external_torque
        limits = np.full(len(self._joints), np.inf)
        if self._detector:
            limits = self._detector.limits[: len(limits)]
            self.log.accept_state(
                stamp, seen.collision, torque, limits, lambda: self.log.of_joints(torque, limits, self.alarm.describe())
            )
        else:
            threshold = self.observation.threshold
            self.log.accept_state(
                stamp, seen.collision, torque, limits, lambda: self.log.of_norm(seen.norm, threshold, torque)
            )

    def _judged(self, stamp, seen):
        """What the detector makes of it: the Disturbance, and whether an alarm begins."""
        nothing = np.zeros(len(self.dynamics.model.dof_names))
        r, torque = (seen.residual, seen.external_torque) if seen.valid else (nothing, nothing)
        stamps = np.array([stamp])
        judged = self._detector.judge(stamps, r[None], torque[None], np.array([seen.valid]))
        self._joints = judged.joints[0]
        if judged.alarm[0]:
            self._alarms.add_states(stamps, np.array([seen.norm]), judged)
            del self._alarms.found[:-1]
            self.alarm = self._alarms.found[0]
            self._cause = self.alarm.describe()
            self._above |= bool((judged.values[0] > self._detector.limits).any())
        return seen._replace(collision=bool(judged.alarm[0])), bool(judged.begins[0])

    def _told(self, seen):
        """Return what is above what, and which joint is pushed most."""
        names = self.dynamics.model.dof_names
        joint = most_pushed(names, seen.external_torque)[0]
        k = names.index(joint)
        return (
            f"|r| rose to {seen.norm:.6g} J^0.5/s, above external_torque.threshold = {self.observation.threshold:g}; "
            f"the largest external torque is {seen.external_torque[k]:.6g} N m (prismatic: N), at joint '{joint}', "
            f"with r {seen.residual[k]:.6g} J^0.5/s"
        )

    def report(self, without_effort):
        """Status of all states since the last report; `without_effort` names the joints whose efforts are not known."""
        if not self._count:
            return Status("external torque", STALE, "no state since")
        seen, threshold = self.seen, self.observation.threshold
        values = {"collisions": self._collisions, "states without result": self._count - self._valid}
        if self._valid:
            values["largest |r| [J^0.5/s]"] = f"{self._largest:.6g}"
        if seen.valid:
            values["|r| [J^0.5/s]"] = f"{seen.norm:.6g}"
        if self._collided:
            level, message = WARN, f"collision: {self._cause}"
            if self._detector and not self._above:
                message += f"; since then not below alarm.release = {self.observation.alarms.release:g} of it"
            elif not self._above:
                message += f"; since then not below external_torque.release_threshold = {self.observation.release:g}"
        elif self._valid:
            judges = self._detector or threshold < float("inf")
            level, message = OK, "no collision" if judges else "observed, without a threshold"
        else:
            level, message = WARN, steady(seen.reason)
            if self._without_effort and without_effort:
                message = f"no effort of {counted(without_effort)}"
        self._reported = self._collided
        self._begin()
        return Status("external torque", level, message, values)
