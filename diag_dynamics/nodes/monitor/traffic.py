# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Counting what comes in and what becomes of it, and saying so."""

from collections import Counter

from diag_dynamics.nodes.support.diagnostics import OK, STALE, WARN, Status, counted, shortened, steady

OVERLOAD = "skipped: overload"
"""Outcome of what comes while there is more to do than can be done."""

PUBLISHED = ("published", "published from odometry")
"""Outcomes that are states which went out; the second, of a robot that is all base, is none of a joint state."""


class Traffic:
    """Counters of a monitor's messages.

    Every joint state that was received has exactly one outcome: published, incomplete, foreign, followers only, before the
    model, before odometry, awaiting velocity, skipped for want of time, or rejected with its cause.

    Parameters
    ----------
    steady : callable
        Returns steady time [s].

    Attributes
    ----------
    counts : Counter
    last_rejection : str
    last_stamp : int or None
        Of the last state that was published [ns].
    """

    def __init__(self, steady):
        self._steady = steady
        self.counts, self._reported = Counter(), Counter()
        self.last_rejection = ""
        self.last_stamp = None
        self._of_assemblers, self._texts = Counter(), {}
        self._begin()

    def _begin(self):
        """Begin another interval between two statuses."""
        self._since = self._steady()
        self._aged, self._age, self._oldest = 0, 0.0, 0.0

    def arrived(self, stamp, now):
        """Note how old a stamp [ns] is that has been accepted."""
        age = (now - stamp) * 1e-9
        self._oldest = max(self._oldest, age) if self._aged else age
        self._aged, self._age = self._aged + 1, self._age + age

    def rejected(self, what, cause, message):
        """Count a rejection of `what`, "rejected" or "odometry rejected"."""
        self.counts[f"{what}: {cause}"] += 1
        self.last_rejection = shortened(message)

    def published(self, what, stamp):
        """Count a state stamped `stamp` [ns] that was evaluated and went to all who listen, as `what`."""
        self.counts[what] += 1
        self.last_stamp = stamp

    def keep(self, robot):
        """Add up what a robot that is about to go has counted, and keep the texts."""
        self._of_assemblers += _counts_of(robot)
        self._texts |= robot.assembler.last_texts

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
        elapsed = max(self._steady() - self._since, 1e-3)
        values = {
            "input rate [Hz]": f"{recent['received'] / elapsed:.4g}",
            "output rate [Hz]": f"{sum(recent[what] for what in PUBLISHED) / elapsed:.4g}",
        }
        if self.last_stamp is not None:
            values["age of the last state [s]"] = f"{(now - self.last_stamp) * 1e-9:.6f}"
        if self._aged:
            values["latency of input, mean [s]"] = f"{self._age / self._aged:.6f}"
            values["latency of input, largest [s]"] = f"{self._oldest:.6f}"
        self._begin()
        if robot:
            values |= _of_inputs(robot.assembler, now)
            foreign = foreign_stamps(robot)
            values |= {f"clock less stamps of {what} [s]": f"{offset:.3f}" for what, offset in foreign}
            problems += [
                f"stamps of {what} are {'behind' if offset > 0.0 else 'ahead of'} this node's clock, so their age is unknown "
                "(a recording without use_sim_time, or hosts whose clocks differ)"
                for what, offset in foreign
            ]
        values |= notes | dict(sorted(counts.items()))
        if self.last_rejection:
            values["last rejection"] = self.last_rejection
        level, message = self._judge(robot, recent, problems)
        return Status("joint states", level, message, values)

    def _judge(self, robot, recent, problems):
        """Level and message for what happened since the last status, perhaps to a robot that was replaced since."""
        texts = self._texts | robot.assembler.last_texts if robot else self._texts
        if any(cause.startswith(("rejected", "odometry rejected")) for cause in recent):
            problems.insert(0, f"messages rejected: {steady(self.last_rejection)}")
        if recent["mimic disagreement"]:
            problems.append(f"mimic joints astray: {steady(texts['mimic disagreement'])}")
        if recent["absurd effort"]:
            problems.append("efforts that cannot be: taken as unknown")
        if recent[OVERLOAD] + recent[f"odometry {OVERLOAD}"]:
            problems.append("messages skipped: more come in than this machine can take")
        if robot and robot.assembler.frozen_text and recent["received"]:
            problems.append(robot.assembler.frozen_text)
        if recent["positions jumped"]:
            problems.append(f"positions jumped, and stayed: {steady(texts['positions jumped'])}")
        if recent["interleaved sources"]:
            problems.append(f"interleaved sources: {steady(texts['interleaved sources'])}")
        for jump in ("time jumped back", "clock jumped back"):
            if recent[jump]:
                problems.append(f"{jump}: all joints were forgotten")
        if robot and recent["received"] and robot.assembler.missing:
            problems.append(f"joints that never arrived: {', '.join(robot.assembler.missing)}")
        if recent["before odometry"]:
            problems.append("no odometry yet")
        if problems:
            return WARN, "; ".join(problems)
        if any(recent[what] for what in PUBLISHED):
            return OK, "publishing"
        if recent["awaiting velocity"]:
            return WARN, "no velocity has been estimated yet"
        if robot and recent["foreign"] and robot.assembler.last_foreign:
            other = shortened(robot.assembler.last_foreign[0])
            return STALE, f"no joint states of this robot: messages are of other joints, as '{other}'"
        return STALE, "no joint states"


def _counts_of(robot):
    """Return what the rules of joint states and the base have counted."""
    jumps = robot.base.jumps if robot.base else 0
    own = {"time jumped back": jumps, "lost by gaps in stamps": robot.assembler.lost}
    return robot.assembler.counts + Counter(own)


def _of_inputs(assembler, now):
    """What is known of the joints, by key."""
    in_step = assembler.in_step
    if not in_step:
        now = assembler.newest  # theirs may be another time
    values = {
        "stamps": {True: "of this node's clock", False: "of another time", None: "not judged"}[in_step],
        "missing joints": counted(assembler.missing),
        "stale joints": counted(assembler.stale(now)),
        "joints without effort": counted(assembler.without_effort),
        "joints with estimated velocity": counted(assembler.estimated),
        "effort undeclared (taken as N m, with gravity)": counted(assembler.efforts.undeclared),
    }
    if text := assembler.last_texts.get("mimic disagreement"):
        values["last mimic disagreement"] = text
    return values


def foreign_stamps(robot):
    """Inputs whose stamps are of another time, and this node's clock less the last of them [s]."""
    sources = [("joint_states", robot.assembler)] + ([("odom", robot.base.stamps)] if robot.base else [])
    return [(what, stamps.offset) for what, stamps in sources if stamps.in_step is False]
