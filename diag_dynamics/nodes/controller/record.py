# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the controller says on /diagnostics of the law in force, of its commands and of what it is told."""

from collections import Counter

from diag_dynamics.control.limits import HEAVY
from diag_dynamics.control.supervisor import ACTIVE as IN_FORCE
from diag_dynamics.control.supervisor import RAMPING_DOWN
from diag_dynamics.nodes.support.diagnostics import ERROR, OK, WARN, Status, counted, shortened, steady

ROUNDING = 1.0 + 1e-6
"""How many times its bound an energy has to be to be above it."""

_OF_COMMANDS = ("commands", "commands limited", "stalls")


class Record:
    """What has happened, in all and since the last report.

    Attributes
    ----------
    counts : Counter
        In all, by what has happened.
    """

    def __init__(self):
        self.counts, self._told = Counter(), Counter()
        self._last_refusal = self._last_hold = ""
        self._largest_gap, self._smallest_scale = 0.0, 1.0
        self._above = 0.0, ""  # energy of a contact above its bound [J] since the last report, and the link
        self.begin()

    def begin(self):
        """Have the next command be the first one."""
        self._last_sent, self._acted = None, False

    def refuse(self, key, reason):
        """Something was refused, or given up."""
        self.counts[key] += 1
        self._last_refusal = reason

    def command(self, now, sent, loop, max_gap):
        """Something was sent at a time [ns]; a gap beyond `max_gap` [s] is a stall."""
        supervisor = loop.supervisor
        if self._acted and supervisor.phase != IN_FORCE:
            self.counts["holds"] += 1
            self._last_hold = supervisor.reason
        self._acted = supervisor.phase == IN_FORCE
        if self._last_sent is not None:
            gap = (now - self._last_sent) * 1e-9
            self._largest_gap = max(self._largest_gap, gap)
            self.counts["stalls"] += gap > max_gap
        self._last_sent = now
        self.counts["commands"] += 1
        self.counts["commands limited"] += bool(sent.saturated)
        self._smallest_scale = min(self._smallest_scale, loop.efforts.scale)
        bound = loop.efforts.contact_limiter
        if sent.command is not None and bound and bound.seen and bound.seen.energy > bound.seen.limit * ROUNDING:
            self.counts["contact energy above its bound"] += 1
            self._above = max(self._above, (bound.seen.energy - bound.seen.limit, bound.seen.link))

    def take_recent(self):
        """Return what has been counted since this was asked last."""
        recent = self.counts - self._told
        self._told = self.counts.copy()
        return recent

    def law_status(self, recent, loop, values):
        """Status of an active controller; `values` are what else there is to say."""
        supervisor, mode = loop.supervisor, f"mode {loop.mode}"
        if supervisor.phase == IN_FORCE:
            if recent["holds"]:
                values["last hold"] = self._last_hold
                return Status("control", WARN, f"{mode}; gravity was held: {steady(self._last_hold)}", values)
            if loop.taking_up:
                return Status("control", WARN, f"{mode}; the robot is taken up: damped until efforts carry it", values)
            return Status("control", OK, mode, values)
        values["reason"] = supervisor.reason
        reason = steady(supervisor.reason)
        if loop.state is None:
            return Status("control", WARN, f"no commands: {reason}", values)
        if supervisor.phase == RAMPING_DOWN:
            return Status("control", ERROR, f"ramping down: {reason}", values)
        return Status("control", WARN, f"holding gravity: {reason}", values)

    def problems_of_contact(self):
        """That energy of a contact was above its bound since the last report: a push put it in, or efforts were limited."""
        above, link = self._above
        self._above = 0.0, ""
        if above > 0.0:
            yield f"contact energy above its bound at '{link}': pushed, lowered, or held back by effort limits"

    def command_status(self, recent, problems, values):
        """Status of commands; `problems` are those of who listens and of what limits them."""
        values = {key: self.counts[key] for key in _OF_COMMANDS} | {
            "largest gap [s]": f"{self._largest_gap:.6f}",
            "smallest scale for effort limits": f"{self._smallest_scale:.3f}",
            **values,
        }
        if recent["stalls"]:
            problems = ["gaps between commands beyond max_state_age", *problems]
        self._largest_gap, self._smallest_scale = 0.0, 1.0
        if problems:
            return Status("commands", WARN, "; ".join(problems), values)
        return Status("commands", OK, "limited" if recent["commands limited"] else "within limits", values)

    def input_status(self, recent, values, problems):
        """Status of states, targets and time; `problems` are those of the latter."""
        values = {key: n for key, n in sorted(self.counts.items()) if key not in _OF_COMMANDS} | values
        refused = sum(n for key, n in recent.items() if "rejected" in key or "refused" in key or "given up" in key)
        if self._last_refusal:
            values["last refusal"] = self._last_refusal
        if refused:
            problems = [f"refused: {steady(self._last_refusal)}", *problems]
        if problems:
            return Status("inputs", WARN, "; ".join(problems), values)
        return Status("inputs", OK, "nothing refused", values)


def problems_of_limits(efforts):
    """What limits leave too little of."""
    if heavy := efforts.heavy:
        yield f"gravity takes more than {HEAVY:.0%} of the effort limit of {shortened(', '.join(heavy))}"
    if slow := efforts.slow:
        yield f"effort_rate is too low to carry {shortened(', '.join(slow))} before the robot sinks"


def values_of_loop(loop):
    """What there is to say of a loop, whatever it does."""
    bound = loop.efforts.contact_limiter
    return {
        "robot": loop.dynamics.model.name,
        "mode": loop.mode,
        "joints without effort limit": counted(loop.efforts.unlimited),
        "kinetic energy [J]": f"{loop.energy:.6g}",
        "contacts bounded at": f"{bound.points.count} points, scale {bound.scale:g}" if bound else "nowhere",
        **_contact_values(bound),
    }


def _contact_values(bound):
    """What a contact limiter has seen last."""
    if not (bound and bound.seen):
        return {}
    return {
        "contact energy [J]": f"{bound.seen.energy:.6g}",
        "its bound [J]": f"{bound.seen.limit:.6g}",
        "worst contact at": bound.seen.link or "nothing moves",
    }
