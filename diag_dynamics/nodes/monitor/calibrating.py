# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Thresholds of alarms from the running monitor: a service that begins a run without contact, ends it, and proposes them."""

import math
from collections import Counter
from functools import partial
from typing import NamedTuple

from diag_dynamics.alarms.thresholds import AlarmThresholds
from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.descriptions import Descriptions
from diag_dynamics.nodes.support.diagnostics import FEW, steady
from diag_dynamics.nodes.support.guard import LATER, Fault, answered, attempt, settled
from diag_dynamics.nodes.support.late_answers import LateAnswers
from diag_dynamics.nodes.support.managed import ACTIVE, PATIENT
from diag_dynamics.nodes.support.messages import doubles
from diag_dynamics.recordings.calibration import calibrated, per_time, time_needed
from diag_dynamics.recordings.residuals import Residuals
from diag_dynamics.srv import Calibrate

FALSE_ALARMS = 1.0 / 60.0
"""Rate of false alarms where a request asks for none [1/s]."""


class CalibrationRun:
    """What an observer says at the monitor's states, from one moment on, for thresholds.

    Parameters
    ----------
    robot : MonitoredRobot
    false_alarms : float
        Rate that is asked for [1/s].

    Attributes
    ----------
    robot : MonitoredRobot
    watch : TorqueWatch
        What observes.
    false_alarms : float
    seen : Residuals
    first, last : int or None
        Stamps of the first and last state with a result [ns].
    ended : str
        Why it is over without anybody having ended it; empty if it is not.
    interrupted : int
        How often all was forgotten: time went back, positions jumped, or the node was inactive for some time.
    energy_alarms : int
        How often the kinetic energy rose above a threshold.
    """

    def __init__(self, robot, false_alarms):
        self.robot, self.watch, self.false_alarms = robot, robot.torque, false_alarms
        self.observation = self.watch.observation
        self.seen = Residuals(robot.model.nv, self.observation.max_gap)
        self.first = self.last = None
        self.ended, self.interrupted, self.energy_alarms = "", 0, 0
        self._alarms, self._without, self._reasons = 0, Counter(), {}

    def take(self, stamp, seen, begins):
        """Take in what the observer has seen, and whether an alarm begins by the thresholds in force."""
        self._alarms += bool(begins)
        if not seen.valid:
            kind = steady(seen.reason)
            self._without[kind] += 1
            self._reasons[kind] = seen.reason
            return
        if self.first is None:
            self.first = stamp
        self.last = stamp
        self.seen.add(stamp, seen.residual, seen.external_torque)

    def end(self, why):
        """It is over."""
        self.ended = self.ended or why

    def proposal(self, false_alarms):
        """A function that finds the Calibration of what was seen until now, in whichever thread.

        It raises InputError if that is too short for any threshold.
        """
        values = self.robot.settings.values
        release, hold_off, standing = (values[f"alarm.{name}"] for name in ("release", "hold_off", "standing"))
        return partial(
            calibrated,
            self.seen.pieces(),
            self.robot.model.dof_names,
            self.observation.gain,
            false_alarms,
            AlarmThresholds({}, release=release, hold_off=hold_off, standing=standing or math.inf),
            friction=self.observation.friction and self.robot.model.has_friction,
            warnings=self.warnings(),
        )

    def warnings(self):
        """Texts: what keeps the run from being one without contact."""
        told = []
        if self._alarms:
            told.append(
                f"alarms by the thresholds in force during the run: {self._alarms}; did something touch the robot?"
            )
        if self.energy_alarms:
            told.append(f"the kinetic energy rose above its threshold {self.energy_alarms} times during the run")
        return told

    def notes(self):
        """Texts: what is missing in the run."""
        told = []
        for kind, count in self._without.most_common(FEW):
            last = self._reasons[kind]
            told.append(f"states without a result: {count}, {last}{'' if last == kind else ' (the last one)'}")
        if self.seen.gaps:
            told.append(f"{self.seen.gaps} gaps, which count for nothing")
        if self.interrupted:
            told.append(f"begun anew after a jump of time or position, or a pause: {self.interrupted} times")
        return told


KEPT = "running", "duration", "states", "dof_names", "gain"
"""Fields of a response that says what is wrong."""


class _Told(NamedTuple):
    """What is said of a run as it was when it was to end."""

    size: str
    first: int
    last: int
    notes: list


class CalibrationService:
    """Offers calibrate on a node. A run costs nothing while there is none.

    Parameters
    ----------
    node : ManagedNode
    current : callable
        Returns the MonitoredRobot in force; None while there is none.
    """

    def __init__(self, node, current):
        self._node, self._current, self._run = node, current, None
        self._actions = {
            Calibrate.Request.STATUS: self._tell,
            Calibrate.Request.START: self._start,
            Calibrate.Request.END: self._end,
            Calibrate.Request.CANCEL: self._cancel,
        }
        callback = answered(node, Calibrate, self._answer, keep=KEPT)
        self._service = node.create_service(Calibrate, "~/calibrate", callback, qos_profile=PATIENT)
        self._late = LateAnswers(self._service)
        self._finding = Descriptions(node, lambda find, *_: find(), self._take_found)

    def destroy(self):
        """Take the service off the graph; a run is over."""
        self._stop()
        self._node.destroy_service(self._service)

    def _answer(self, request, response):
        action = self._actions.get(request.action)
        if action is None:
            raise InputError(f"action is {request.action}, expected STATUS = 0, START = 1, END = 2 or CANCEL = 3.")
        rate = request.false_alarms
        if not 0.0 <= rate < math.inf:
            raise InputError(f"false_alarms is {rate!r}, expected a rate > 0 [1/s], or 0 for one a minute.")
        self._look_after()
        self._describe(response)
        try:
            return action(rate, response)
        finally:
            self._describe(response)

    def _look_after(self):
        """End a run whose robot or observer is no more."""
        run = self._run
        if run and run.robot is not self._current():
            run.end("another robot_description is in force, or none")
        elif run and run.watch is not run.robot.torque:
            run.end("external_torque.gain was set to 0, and nothing is observed")

    def _describe(self, response):
        """How far the run is."""
        run = self._run
        response.running = run is not None and not run.ended
        if run:
            response.duration, response.states = run.seen.duration, run.seen.states
            response.dof_names = list(run.robot.model.dof_names)
            response.gain = float(run.observation.gain)

    def _start(self, rate, _):
        if self._run and not self._run.ended:
            raise InputError(f"a calibration run is on, {self._told(self._run)}: end or cancel it first.")
        robot = self._current()
        if robot is None:
            raise InputError("there is no robot model yet: waiting for a valid robot_description.")
        if robot.torque is None:
            raise InputError("external_torque.gain is 0, and nothing is observed: set it first, to 25.0 say.")
        self._run = robot.torque.run = CalibrationRun(robot, rate or FALSE_ALARMS)
        needed = (
            f"{time_needed(self._run.false_alarms):.3g} s without an alarm vouch for {per_time(self._run.false_alarms)}"
        )
        inactive = "" if self._node.phase == ACTIVE else f"; nothing is listened to while {self._node.phase}"
        return f"begun: move as at work, and touch nothing; {needed}{inactive}"

    def _tell(self, *_):
        run = self._run
        if run is None:
            return "no calibration run is on"
        if run.ended:
            return f"the run is over: {run.ended}"
        missing = time_needed(run.false_alarms) - run.seen.duration
        enough = (
            f"too short for {per_time(run.false_alarms)} by {missing:.3g} s" if missing > 0.0
            else f"long enough for {per_time(run.false_alarms)}"
        )  # fmt: skip
        return "; ".join([self._told(run), enough, *run.warnings(), *run.notes()])

    def _end(self, rate, response):
        """Have thresholds found in a thread, so that states are served meanwhile; see :meth:`_take_found`."""
        run = self._wanted()
        if self._late.awaited:
            raise InputError("thresholds of this run are being found already.")
        told = _Told(self._told(run), run.first, run.last, run.notes())
        self._finding.load(run.proposal(rate or run.false_alarms), run, told)
        self._late.put_off(response)
        return LATER

    def _take_found(self, found, _, run, told):
        """Answer END, with the Calibration or the exception that has come of it."""
        response = self._late.awaited
        message, fault = attempt(self._propose, response, found, run, told)
        self._answer_late(response, message, fault)

    def _answer_late(self, response, message, fault):
        answer = settled(self._node, Calibrate, response, message, fault, keep=KEPT)
        _, unsent = attempt(self._late.send, answer)
        if unsent:
            self._node.get_logger().warning(f"calibrate: nobody takes the answer: {unsent.text}")

    def _propose(self, response, found, run, told):
        """Fill in a response; returns its message."""
        if isinstance(found, InputError):
            raise InputError("; ".join([f"{str(found).rstrip('.')}; the run goes on", *told.notes])) from found
        if isinstance(found, Exception):
            raise found
        self._look_after()
        if run.ended:
            response.running = False
            raise InputError(f"the run is over, and proposes nothing: {run.ended}.")
        name = self._node.get_fully_qualified_name()
        notes = [f"From a run of '{name}', stamps {told.first * 1e-9:.3f} to {told.last * 1e-9:.3f} s.", *told.notes]
        if run.robot.settings.values["parameters_file"]:
            notes.append(f"By parameters_file {run.robot.settings.values['parameters_file']!r}.")
        response.joint_thresholds = doubles([found.joints.get(name, 0.0) for name in response.dof_names])
        response.torque_norm_threshold, response.threshold = found.external_torque, found.norm
        response.parameters = found.yaml(notes)
        self._forget()
        response.running = False
        low, high = found.rate_interval
        held_out = f"held out by parts {found.held_out} alarms, {per_time(low)} to {per_time(high)}"
        return "; ".join([f"{told.size}, for {per_time(found.asked)}", held_out, *found.warnings, *told.notes])

    def _cancel(self, *_):
        told = self._told(self._wanted())
        self._stop()
        return f"forgotten: {told}"

    def _wanted(self):
        """The run that is on."""
        run = self._run
        if run is None:
            raise InputError("no calibration run is on: START begins one.")
        if run.ended:
            self._run = None
            raise InputError(f"the run is over, and proposes nothing: {run.ended}.")
        return run

    def _told(self, run):
        return f"{run.seen.duration:.4g} s, {run.seen.states} states"

    def _stop(self):
        """Forget the run, and whoever waits for its thresholds is told so."""
        self._finding.drop()
        self._forget()
        if response := self._late.awaited:
            self._describe(response)
            self._answer_late(
                response, None, Fault(InputError("the run was forgotten while its thresholds were found."))
            )

    def _forget(self):
        run, self._run = self._run, None
        if run:
            run.watch.run = None
