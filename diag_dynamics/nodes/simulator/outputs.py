# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator's messages: measurements, and its entries on /diagnostics."""

from collections import Counter

from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from diag_dynamics.nodes.support.diagnostics import ERROR, OK, WARN, Status, counted, steady
from diag_dynamics.nodes.support.messages import doubles
from diag_dynamics.simulation.drives import TIMED_OUT

WORLD = "world"
"""Frame of a floating base's pose."""


def joint_state_message(names, measured, stamp):
    """Return a JointState of these joints."""
    message = JointState(name=names)
    message.header.stamp = stamp
    message.position, message.velocity = doubles(measured.position), doubles(measured.velocity)
    message.effort = doubles(measured.effort)
    return message


def odometry_message(root_link, measured, stamp):
    """Return the Odometry of a floating base."""
    (x, y, z, *orientation), twist = measured.base
    message = Odometry(child_frame_id=root_link)
    message.header.stamp, message.header.frame_id = stamp, WORLD
    position, o, moving = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
    position.x, position.y, position.z = float(x), float(y), float(z)
    o.x, o.y, o.z, o.w = map(float, orientation)
    moving.linear.x, moving.linear.y, moving.linear.z = map(float, twist[:3])
    moving.angular.x, moving.angular.y, moving.angular.z = map(float, twist[3:])
    return message


def simulation_status(plant, paused, failure):
    """Return the status of the robot; `failure` is why the simulation has stopped, or empty."""
    simulation = plant.simulation
    values = {
        "robot": simulation.model.name,
        "simulated time [s]": f"{plant.time:.3f}",
        "kinetic energy [J]": f"{simulation.kinetic_energy:.6g}",
        "energy residual [J]": f"{simulation.audit.residual:.3g}",
        **{f"energy audit: {name} [J]": f"{value:.6g}" for name, value in simulation.audit._asdict().items()},
        "joints at their effort limit": counted(simulation.saturated),
        "joints at a position limit": counted(simulation.at_limit),
        "joints beyond their velocity limit": counted(simulation.overspeed),
        "payloads": counted(simulation.model.payloads),
        "joint states lost": plant.sensors.lost,
    }
    if failure:
        return Status("simulation", ERROR, f"stopped: {failure}", values)
    return Status("simulation", WARN, "paused", values) if paused else Status("simulation", OK, "running", values)


MAX_OVERRUNS = 0.1
"""Skipped ticks, as a fraction of those that were not, above which the pace is a warning."""


def pace_status(pace, lockstep, waits, time_values, problems):
    """Return the status of time; `time_values` and `problems` are those of its publishers."""
    report = pace.report()
    values = {
        "ticks": report.ticks,
        "lateness, mean [s]": f"{report.mean:.6f}",
        "lateness, maximum [s]": f"{report.largest:.6f}",
        "overruns": pace.overruns,
        "dropped lag [s]": f"{pace.dropped:.3f}",
        "real-time factor": "lockstep" if lockstep else f"{pace.factor:g}",
        **time_values,
    }
    if waits:
        problems = [*problems, "lockstep: waiting for a command"]
    elif report.dropped > 0.0 or report.overruns > MAX_OVERRUNS * report.ticks:
        problems = [*problems, "too slow: ticks skipped"]
    return Status("pace", WARN if problems else OK, "; ".join(problems) or "on schedule", values)


class CommandsReport:
    """Statuses of commands and wrenches, which warn of new rejections."""

    def __init__(self):
        self._reported = Counter()

    def status(self, drives, pushes):
        """Return the status since the last one."""
        counts = drives.counts + pushes.counts
        recent = counts - self._reported
        self._reported = counts
        values = {
            "drives": drives.phase,
            "brakes": "closed" if drives.braked else "open",
            **dict(sorted(counts.items())),
        }
        rejected = []
        for what, part in (("command", drives), ("wrench", pushes)):
            if part.last_rejection:
                values[f"last rejected {what}"] = part.last_rejection
            if any(key in part.counts and "rejected" in key for key in recent):
                rejected.append(steady(part.last_rejection))
        problems = [f"rejected: {'; '.join(rejected)}"] if rejected else []
        problems += [f"no command for {drives.timeout:g} s"] if drives.phase == TIMED_OUT else []
        return Status("commands", WARN if problems else OK, "; ".join(problems) or drives.phase, values)
