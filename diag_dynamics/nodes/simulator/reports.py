# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the simulator says on /diagnostics of its robot, its pace and those who command it."""

from collections import Counter

from diag_dynamics.nodes.support.diagnostics import ERROR, OK, WARN, Status, counted, steady
from diag_dynamics.nodes.support.managed import INACTIVE
from diag_dynamics.simulation.drives import TIMED_OUT


def simulation_status(plant, phase, paused, failure):
    """Status of the robot, in a phase of the node; `failure` is why it stands still, if anything is."""
    simulation = plant.simulation
    values = {
        "lifecycle": phase,
        "robot": simulation.model.name,
        "simulated time [s]": f"{plant.time:.3f}",
        "kinetic energy [J]": f"{simulation.kinetic_energy:.6g}",
        "energy residual [J]": f"{simulation.audit.residual:.3g}",
        "efforts cut to their limits": counted(simulation.saturated),
        "joints at a position limit": counted(simulation.at_limit),
        "joints beyond their velocity limit": counted(simulation.overspeed),
        "payloads": counted(simulation.model.payloads),
        "joint states lost": plant.sensors.lost,
    }
    if failure:
        return Status("simulation", ERROR, f"stopped: {failure}", values)
    if phase == INACTIVE or paused:
        return Status("simulation", WARN, "paused" if paused else "inactive: time stands still", values)
    return Status("simulation", OK, "running", values)


def pace_status(pace, lockstep, waits, time_values, problems):
    """Status of time, which is kept by a pace or by commands, and which may wait for one of them.

    `time_values` are those of who publishes it, `problems` what is wrong with them.
    """
    kept = pace.kept()
    values = {
        "ticks": kept.ticks,
        "late, mean [s]": f"{kept.mean:.6f}",
        "late, largest [s]": f"{kept.largest:.6f}",
        "overruns": pace.overruns,
        "time let go [s]": f"{kept.let_go:.3f}",
        "real-time factor": "lockstep" if lockstep else f"{pace.factor:g}",
        **time_values,
    }
    if waits:
        problems = [*problems, "in lockstep: waiting for a command"]
    elif kept.overruns:
        problems = [*problems, "ticks overran since the last report"]
    if problems:
        return Status("pace", WARN, "; ".join(problems), values)
    return Status("pace", OK, "kept", values)


class CommandsReport:
    """Remembers what it has told of commands and wrenches, so that it warns of what is new."""

    def __init__(self):
        self._told = Counter()

    def status(self, drives, pushes):
        """Status of commands and wrenches."""
        counts = drives.counts + pushes.counts
        recent = counts - self._told
        self._told = counts
        values = {
            "drives": drives.phase,
            "brakes": "closed" if drives.braked else "open",
            **dict(sorted(counts.items())),
        }
        refused = []
        for what, part in (("command", drives), ("wrench", pushes)):
            if part.last_rejection:
                values[f"last rejected {what}"] = part.last_rejection
            if any(key in part.counts and "rejected" in key for key in recent):
                refused.append(steady(part.last_rejection))
        if refused:
            return Status("commands", WARN, f"refused: {'; '.join(refused)}", values)
        if drives.phase == TIMED_OUT:
            return Status("commands", WARN, f"no command for {drives.timeout:g} s", values)
        return Status("commands", OK, drives.phase, values)
