# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Counts of the monitor's messages by outcome, and their status."""

from collections import Counter

from diag_dynamics.nodes.support.diagnostics import counted
from diag_dynamics.nodes.support.statuses import ERROR, STALE, WARN, Status, problem_status
from diag_dynamics.text import shortened

OVERLOAD = "skipped: overload"
PUBLISHED = ("published", "published from odometry")  # the second is no outcome of a joint state

WARNINGS = {  # by counter; a text of the event follows
    "mimic disagreement": "mimic joint deviates from its source joint: ",
    "implausible effort": "implausible efforts ignored",
    OVERLOAD: "messages dropped: CPU overload",
    f"odometry {OVERLOAD}": "odometry dropped: CPU overload",
    "positions jumped": "positions jumped: ",
    "time jumped back": "stamps restarted; all joints reset",
    "clock jumped back": "clock jumped back; all joints reset",
    "before odometry": "no odometry yet",
}

STAMPS = {True: "of this node's clock", False: "of another clock", None: "unknown"}


class InputStatistics:
    """Counts of messages by their outcome.

    Each joint state has exactly one of the outcomes in docs/troubleshooting.md.
    """

    def __init__(self, steady):
        self._steady = steady
        self.counts = Counter()
        self._reported = Counter()
        self.last_rejection = ""
        self._last_stamp = None
        self.is_foreign = False  # whether no recent message had a joint of the robot
        self.is_empty = False  # whether no recent message had a name
        self._start_interval()

    def _start_interval(self):
        self._start = self._steady()
        self._latencies = []

    def add_latency(self, stamp, now):
        """Add the age of a stamp at its reception [ns]."""
        self._latencies.append(1e-9 * (now - stamp))

    def count_rejected(self, outcome, cause, text):
        """Count a message as "rejected" or "odometry rejected"."""
        self.counts[f"{outcome}: {cause}"] += 1
        self.last_rejection = shortened(f"{cause}: {text}")

    def count_published(self, outcome, stamp):
        """Count a state with a stamp [ns]."""
        self.counts[outcome] += 1
        self._last_stamp = stamp

    def keep(self, robot):
        """Keep the counts of a MonitoredRobot that is replaced."""
        self.counts += _counts_of(robot)

    def report(self, robot, now, values, problems):
        """Return the status since the last report, with values and problems of the graph."""
        counts = self.counts + (_counts_of(robot) if robot else Counter())
        recent = counts - self._reported
        self._reported = counts
        if recent["received"]:
            self.is_foreign = recent["foreign"] + recent["empty"] == recent["received"]
            self.is_empty = recent["empty"] == recent["received"]
        elapsed = max(self._steady() - self._start, 1e-3)
        values = values | {"input rate [Hz]": f"{recent['received'] / elapsed:.4g}"}
        values["output rate [Hz]"] = (
            f"{sum(recent[outcome] for outcome in PUBLISHED) / elapsed:.4g}"
        )
        if self._last_stamp is not None:
            values["age of the last state [s]"] = f"{1e-9 * (now - self._last_stamp):.6f}"
        if latencies := self._latencies:
            values["latency of input, mean [s]"] = f"{sum(latencies) / len(latencies):.6f}"
            values["latency of input, maximum [s]"] = f"{max(latencies):.6f}"
        self._start_interval()
        problems = self._problems(robot, recent) + problems
        for source, offset in unsynchronized(robot):
            values[f"clock minus stamps of {source} [s]"] = f"{offset:.3f}"
            problems.append(
                f"stamps of {source} are of another clock, so their age is unknown. Play "
                "bags with --clock and set use_sim_time, or synchronize the clocks of the hosts"
            )
        if robot:
            values |= _joint_values(robot.assembler, now)
        values |= dict(sorted(counts.items()))
        if self.last_rejection:
            values["last rejection"] = self.last_rejection
        if not problems and not any(recent[outcome] for outcome in PUBLISHED):
            return Status("joint states", *_silence(robot, recent), values)
        status = problem_status("joint states", problems, "publishing", values)
        return status._replace(level=ERROR) if recent["rejected: open loop"] else status

    def _problems(self, robot, recent):
        problems = []
        texts = robot.assembler.last_texts if robot else {}
        if any(outcome.startswith(("rejected", "odometry rejected")) for outcome in recent):
            problems.append(f"messages rejected: {self.last_rejection}")
        for key, text in WARNINGS.items():
            if recent[key]:
                problems.append(text + texts.get(key, ""))
        return problems


def _silence(robot, recent):
    """Return level and text of an interval without a state and without a problem."""
    if robot is None:
        return STALE, "no robot yet"
    if recent["awaiting velocity"]:
        return WARN, "no velocity estimate yet"
    if recent["received"]:
        return STALE, "no complete state of this robot"
    return WARN, "no joint states"


def _counts_of(robot):
    jumps = robot.base.jumps if robot.base else 0
    return robot.assembler.counts + Counter({"time jumped back": jumps})


def _joint_values(assembler, now):
    if not assembler.in_step:
        now = assembler.newest  # of the same clock
    values = {
        "stamps": STAMPS[assembler.in_step],
        "stale joints": counted(assembler.stale(now)),
        "joints without effort": counted(assembler.without_effort),
        "joints with estimated velocity": counted(assembler.estimated),
        "effort undeclared (assumed: N m, with gravity)": counted(assembler.efforts.undeclared),
    }
    return values | {f"last {event}": text for event, text in assembler.last_texts.items() if text}


def unsynchronized(robot):
    """Return inputs with stamps of another clock, and the offsets of that clock.

    An offset is this node's clock less the last stamp [s].
    """
    sources = {"joint_states": robot.assembler} if robot else {}
    if robot and robot.base:
        sources["odom"] = robot.base.stamps
    return [(name, stamps.offset) for name, stamps in sources.items() if stamps.in_step is False]
