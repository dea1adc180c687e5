# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller's reports: its status message, and law, commands and inputs on /diagnostics."""

import math
from collections import Counter

from std_msgs.msg import Header

from diag_dynamics.control.laws import PoseError
from diag_dynamics.control.loop import BRAKING
from diag_dynamics.control.supervisor import ACTIVE as IN_FORCE
from diag_dynamics.control.supervisor import RAMPING_DOWN
from diag_dynamics.msg import ControllerStatus
from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.messages import doubles, to_time
from diag_dynamics.nodes.support.statuses import (
    ERROR,
    OK,
    WARN,
    Status,
    problem_status,
    without_numbers,
)
from diag_dynamics.text import listed, shortened

ROUNDING = 1.0 + 1e-6
"""Factor on its bound above which an energy exceeds it."""

_ABOVE = "contact energy above its limit"
_OF_COMMANDS = "commands", "stalls", "holds", _ABOVE


class Record:
    """Counts of commands and inputs since the start, and the last reasons."""

    def __init__(self):
        self.counts = Counter()
        self._told = Counter()
        self._last_refusal = self._last_hold = ""
        self._link_above = ""  # of the last contact energy above its limit
        self.begin()

    def begin(self):
        """Start anew: no gap ends with the next command."""
        self._last_sent = None
        self._acted = False

    def refuse(self, key, reason):
        """Count a rejection, or a target that was aborted."""
        self.counts[key] += 1
        self._last_refusal = f"{key}: {reason}"

    def command(self, now, sent, loop, max_gap):
        """Count a command sent at a time [ns]; a gap beyond `max_gap` [s] is a stall."""
        supervisor = loop.supervisor
        if self._acted and supervisor.phase != IN_FORCE:
            self.counts["holds"] += 1
            self._last_hold = supervisor.reason
        self._acted = supervisor.phase == IN_FORCE
        if self._last_sent is not None:
            self.counts["stalls"] += (now - self._last_sent) * 1e-9 > max_gap
        self._last_sent = now
        self.counts["commands"] += not sent.silent
        seen = loop.limits.contact and loop.limits.contact.seen
        if seen and sent.command and seen.energy > seen.limit * ROUNDING:
            self.counts[_ABOVE] += 1
            self._link_above = seen.link

    def take_recent(self):
        """Return the counts since the last call."""
        recent = self.counts - self._told
        self._told = self.counts.copy()
        return recent

    def law_status(self, recent, loop, values):
        """Return the status of an active controller."""
        supervisor = loop.supervisor
        mode = f"mode {loop.mode}"
        if supervisor.phase == IN_FORCE:
            if supervisor.cause:
                return _fault(
                    f"{mode}; choose a mode to go on after the ramp: ", supervisor.cause, values
                )
            if recent["holds"]:
                return _fault(f"{mode}; held gravity: ", self._last_hold, values)
            if loop.is_braking:
                return Status("control", WARN, f"{mode}; {BRAKING}", values)
            if loop.shortfall:
                return _fault(f"{mode}; target not reached: ", loop.shortfall, values)
            return Status("control", OK, mode, values)
        if loop.state is None:
            return _fault("no commands: ", supervisor.reason, values)
        if supervisor.phase == RAMPING_DOWN:
            return _fault("ramping down: ", supervisor.reason, values, ERROR)
        return _fault("holding gravity: ", supervisor.reason, values)

    def command_status(self, recent, problems, values):
        """Return the status of commands; `problems` are those of receivers and limits."""
        values = {key: self.counts[key] for key in _OF_COMMANDS} | values
        if recent[_ABOVE]:
            above = f"{_ABOVE} at '{self._link_above}' (external push, or effort limits)"
            problems = [*problems, above]
        if recent["stalls"]:
            problems = ["gaps between commands beyond max_state_age", *problems]
        return problem_status("commands", problems, "no gaps", values)

    def input_status(self, recent, values, problems):
        """Return the status of states, targets and time; `problems` are those of time."""
        values = {
            key: n for key, n in sorted(self.counts.items()) if key not in _OF_COMMANDS
        } | values
        refused = sum(n for key, n in recent.items() if "rejected" in key or "aborted" in key)
        if self._last_refusal:
            values["last rejection"] = self._last_refusal
        if recent["clock went back"]:
            problems = [*problems, "the clock went back"]
        is_logged = not problems  # by what rejects, or as the reason of a hold
        if refused:
            problems = [self._last_refusal, *problems]
        return problem_status("inputs", problems, "nothing rejected", values, is_logged)


def _fault(text, reason, values, level=WARN):
    """Return the status of a law that is not in force, or was not, for a reason."""
    values["reason"] = reason
    message = text + without_numbers(reason)
    return Status("control", level, message, values, text + reason)


def problems_of_limits(limits):
    """Return problems of effort limits that are too low and of an overdrawn energy tank."""
    problems = []
    if limits.tank and limits.tank.is_overdrawn:
        problems.append("the energy tank is overdrawn (late states, effort_rate or a push)")
    if heavy := limits.heavy:
        problems.append(f"gravity nearly reaches the effort limit of {listed(heavy)}")
    if slow := limits.slow:
        problems.append(f"effort_rate is too low to hold {listed(slow)} before the robot sinks")
    return problems


def values_of_loop(loop):
    """Return the diagnostic values of a loop."""
    bound = loop.limits.contact
    values = {
        "robot": loop.dynamics.model.name,
        "mode": loop.mode,
        "joints without effort limit": counted(loop.limits.unlimited),
        "kinetic energy [J]": f"{loop.energy:.6g}",
        "contact limits": f"{bound.points.count} points, scale {bound.scale:g}"
        if bound
        else "none",
    }
    if tank := loop.limits.tank:
        values["tank energy [J]"] = f"{tank.energy:.6g}"
    return values


def status_message(loop, sent, trajectories):
    """Return the ControllerStatus of a command of a loop, with the outcome of its Trajectories."""
    command = sent.command
    model = loop.dynamics.model
    limit = loop.limits.energy.limit if loop.limits.energy else math.inf
    message = ControllerStatus(
        header=Header(stamp=to_time(sent.stamp), frame_id=model.root_link),
        mode=loop.mode,
        phase=loop.supervisor.phase,
        message=shortened(loop.supervisor.reason or loop.shortfall or BRAKING * loop.is_braking),
        dof_names=list(model.dof_names),
        state_age=sent.age,
        effort_command=doubles(sent.effort),
        saturated_dofs=list(sent.saturated),
        energy=loop.energy,
        energy_limited=sent.energy_limited,
        energy_limit_valid=math.isfinite(limit),
        energy_limit=limit if math.isfinite(limit) else 0.0,
        contact_limited=sent.contact_limited,
        actual_position=doubles(loop.state.position),
        actual_velocity=doubles(loop.state.velocity),
        trajectory_active=trajectories.is_active,
        trajectory_code=trajectories.outcome.code,
        trajectory_reason=shortened(trajectories.outcome.reason),
    )
    if (bound := loop.limits.contact) and bound.seen and command is not None:
        message.contact_valid = True
        message.contact_link = bound.seen.link
        message.contact_energy = bound.seen.energy
        message.contact_energy_limit = bound.seen.limit
    if command is None:
        return message
    message.lyapunov = command.lyapunov
    message.lyapunov_rate_predicted = command.lyapunov_rate
    message.lyapunov_valid = sent.lyapunov_rate is not None
    message.lyapunov_rate_measured = sent.lyapunov_rate or 0.0
    if isinstance(command.error, PoseError):
        message.pose_error_valid = True
        for field, vector in zip(
            (message.position_error, message.orientation_error), command.error, strict=True
        ):
            field.x, field.y, field.z = map(float, vector)
    elif command.error is not None:
        message.tracking_error = doubles(command.error)
        message.tracking_error_valid = True
        message.desired_position = doubles(loop.desired.position)
        message.desired_velocity = doubles(loop.desired.velocity)
    return message
