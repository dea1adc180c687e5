"""Counting what comes in and what becomes of it, and saying so."""

import time
from collections import Counter

from diag_dynamics.nodes.diagnostics import OK, STALE, WARN, Status, counted, shortened


class Traffic:
    """Counters of a monitor's messages.

    Every joint state that was received has exactly one outcome: published, incomplete, foreign, followers only, before the
    model, before odometry, awaiting velocity, or rejected with its cause.

    Attributes
    ----------
    counts : Counter
    last_rejection : str
    last_stamp : int or None
        Of the last state that was published [ns].
    """

    def __init__(self):
        self.counts, self._reported = Counter(), Counter()
        self.last_rejection = ""
        self.last_stamp = None
        self._of_assemblers = Counter()
        self._latencies = []
        self._since = time.monotonic()

    def arrived(self, stamp, now):
        """Note how old a stamp [ns] is that has been accepted."""
        self._latencies.append((now - stamp) * 1e-9)

    def rejected(self, what, cause, message):
        """Count a rejection of `what`, "rejected" or "odometry rejected"."""
        self.counts[f"{what}: {cause}"] += 1
        self.last_rejection = shortened(message)

    def published(self, stamp):
        """Count a state stamped `stamp` [ns] that was evaluated and went to all who listen."""
        self.counts["published"] += 1
        self.last_stamp = stamp

    def keep(self, robot):
        """Add up what a robot that is about to go has counted."""
        self._of_assemblers += _counts_of(robot)

    def status(self, robot, now, notes):
        """Status of all since the last one.

        Parameters
        ----------
        robot : MonitoredRobot or None
        now : int
            This node's clock [ns].
        notes : dict
            Further values, and under None what is wrong with the inputs as such: a list of str.
        """
        notes = dict(notes)
        problems = list(notes.pop(None, ()))
        counts = self.counts + self._of_assemblers
        if robot:
            counts += _counts_of(robot)
        recent = counts - self._reported
        self._reported = counts
        before, self._since = self._since, time.monotonic()
        elapsed = max(self._since - before, 1e-3)
        values = {
            "input rate [Hz]": f"{recent['received'] / elapsed:.1f}",
            "output rate [Hz]": f"{recent['published'] / elapsed:.1f}",
        }
        if self.last_stamp is not None:
            values["age of the last state [s]"] = f"{(now - self.last_stamp) * 1e-9:.6f}"
        if self._latencies:
            values["latency of input, mean [s]"] = f"{sum(self._latencies) / len(self._latencies):.6f}"
            values["latency of input, largest [s]"] = f"{max(self._latencies):.6f}"
            self._latencies = []
        if robot:
            values |= _of_inputs(robot.assembler, now)
            problems += _of_stamps(robot)
        values |= notes | dict(sorted(counts.items()))
        if self.last_rejection:
            values["last rejection"] = self.last_rejection
        level, message = self._judge(robot, recent, problems)
        return Status("joint states", level, message, values)

    def _judge(self, robot, recent, problems):
        """Level and message for what happened since the last status."""
        if rejected := sum(n for cause, n in recent.items() if cause.startswith(("rejected", "odometry rejected"))):
            problems.insert(0, f"{rejected} messages rejected: {self.last_rejection}")
        if disagreeing := recent["mimic disagreement"]:
            problems.append(f"{disagreeing} messages with mimic joints astray: {robot.assembler.last_disagreement}")
        if absurd := recent["absurd effort"]:
            problems.append(f"{absurd} messages with efforts that cannot be: taken as unknown")
        if robot and recent["received"] and robot.assembler.missing:
            problems.append(f"joints that never arrived: {', '.join(robot.assembler.missing)}")
        if recent["before odometry"]:
            problems.append("no odometry yet")
        if problems:
            return WARN, "; ".join(problems)
        if recent["published"]:
            return OK, "publishing"
        if recent["awaiting velocity"]:
            return WARN, "no velocity has been estimated yet"
        return STALE, "no joint states"


def _counts_of(robot):
    """What the assembly of a robot's state has counted."""
    jumps = robot.base.jumps if robot.base else 0
    return robot.assembler.counts + Counter({"time jumped back": jumps})


def _of_inputs(assembler, now):
    """What is known of the joints, by key."""
    values = {
        "missing joints": counted(assembler.missing),
        "stale joints": counted(assembler.stale(now)),
        "joints without effort": counted(assembler.without_effort),
        "joints with estimated velocity": counted(assembler.estimated),
        "effort undeclared (taken as N m, with gravity)": counted(assembler.efforts.undeclared),
    }
    if assembler.last_disagreement:
        values["last mimic disagreement"] = assembler.last_disagreement
    return values


def _of_stamps(robot):
    """What is wrong with the times of the inputs."""
    sources = [("joint_states", robot.assembler.stamps)] + ([("odom", robot.base.stamps)] if robot.base else [])
    return [
        f"stamps of {what} are {abs(stamps.offset):.3f} s {'behind' if stamps.offset > 0.0 else 'ahead of'} this node's "
        "clock, so their age is unknown (a recording without use_sim_time, or hosts whose clocks differ)"
        for what, stamps in sources
        if stamps.in_step is False
    ]
