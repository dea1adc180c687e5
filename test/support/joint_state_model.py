# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Slow model of the rules of joint states, as an oracle: dictionaries by joint, of positions all steps. No library code.

It covers the robot ``arm`` of the table without stuck sensors and lost states.
"""

import math
from collections import Counter

from joint_state_messages import (
    BASE_PARAMETERS,
    EFFORT_LIMITS,
    INF,
    LIMITS,
    MIMICS,
    MS,
    NAMES,
    NAN,
    PI,
    VELOCITY_LIMITS,
    S,
)

CONTINUOUS = ("shoulder",)
FIELDS = ("position", "velocity", "effort")
DEFAULTS = {
    "joint_timeout": 0.5,
    "foreign_time": "warn",
    "missing_velocity": "refuse",
    "velocity_filter_time": 0.01,
} | BASE_PARAMETERS
"""Parameters that a sequence does not set."""


def _rest(entries):
    """Return whether all velocities are 0 or missing."""
    return not any(abs(entry["velocity"]) > 0.0 for entry in entries)


class RejectionError(Exception):
    """A message is rejected."""


class Model:
    """Assembles states of the arm from messages given as names, fields, stamp and time of reception."""

    def __init__(self, parameters):
        self._parameters = DEFAULTS | dict(parameters)
        self.counts, self.states, self.causes = Counter(), [], []
        self.known, self.efforts, self.tracks, self.away = {}, {}, {}, {}
        self.in_step = self.far_since = None
        self.bare = {}  # by first joint, the last message without velocity
        self.runs = {}  # by source, stamps in a row that were too old

    def read(self, message, now):
        """Take a message in and count what comes of it."""
        self.counts["received"] += 1
        try:
            outcome = self._outcome(*message, now)
        except RejectionError as rejection:
            outcome = f"rejected: {rejection}"
            self.causes.append(outcome)
        self.counts[outcome] += 1

    def _number(self, name):
        return self._parameters[name] or INF

    def _of_joint(self, parameter, name, default):
        """Return an entry of a joint, else that of all others, else the default."""
        entries = dict(entry.split("=") for entry in self._parameters.get(parameter, ()))
        value = entries.get(name, entries.get("*"))
        return default if value is None else value == "true" if value in ("true", "false") else float(value)

    def _timeout(self, name):
        """Return the age limit of a joint [ns]."""
        seconds = self._of_joint("joint_timeouts", name, self._parameters["joint_timeout"])
        return round(1000 * seconds) * MS or INF

    def _outcome(self, names, fields, stamp, now):
        if len(set(names)) < len(names):
            raise RejectionError("duplicate name")
        joints, mimics = ([name for name in names if name in some] for some in (NAMES, MIMICS))
        if not joints and not mimics:
            return "foreign"
        at, stamped = self._stamp(stamp, now)
        sent = self._fields(names, fields, joints)
        self._check_bounds(sent, joints)
        self._check_velocities(sent, joints, at, stamped)
        accept_stamp = self._check_stamp(at, stamped, now, joints)
        moved, accept_steps = self._check_steps(sent, at, stamped, joints)
        new = {name: sent[name] | {"at": at, "stamped": stamped, "estimated": False} for name in joints}
        if self._parameters["missing_velocity"] == "estimate":
            self._estimate(new, at, moved)
        accept_stamp()
        accept_steps()
        self.known |= new
        for name in mimics:
            self.efforts[name] = at, self._effort(name, sent[name]["effort"])
        self.counts["absurd effort"] += any(self._is_absurd(name, sent[name]["effort"]) for name in joints + mimics)
        self.counts["mimic disagreement"] += any(self._is_apart(name, sent[name]["position"], at) for name in mimics)
        return self._assemble() if joints else "followers only"

    def _stamp(self, stamp, now):
        sec, nanosec = stamp
        if sec < 0 or nanosec >= S:
            raise RejectionError("malformed stamp")
        if not (sec or nanosec or now):
            raise RejectionError("no time")
        return (sec * S + nanosec, True) if sec or nanosec else (now, False)

    def _fields(self, names, fields, joints):
        sent = {name: {} for name in names}
        for field, values in zip(FIELDS, fields, strict=True):
            values = values or [NAN] * len(names)
            if len(values) != len(names):
                raise RejectionError("wrong length")
            for name, value in zip(names, values, strict=True):
                sent[name][field] = value
        if not all(math.isfinite(sent[name]["position"]) for name in joints):
            raise RejectionError("no position")
        return sent

    def _fastest(self, name):
        limit = VELOCITY_LIMITS[name] * self._parameters["absurd.beyond_velocity"] or INF
        return min(limit, self._number("absurd.velocity"))

    def _check_bounds(self, sent, joints):
        for name in joints:
            position, velocity = sent[name]["position"], sent[name]["velocity"]
            lower, upper = LIMITS[name]
            outside = max(lower - position, position - upper) > self._number("absurd.beyond_limits")
            outside |= name not in CONTINUOUS and abs(position) > self._number("absurd.position")
            if outside or (math.isfinite(velocity) and abs(velocity) > self._fastest(name)):
                raise RejectionError("absurd value")

    def _check_velocities(self, sent, joints, at, stamped):
        """Reject a message without velocities, and count those that another source contradicts."""
        missing = self._parameters["missing_velocity"] == "estimate"
        velocities = [sent[name]["velocity"] for name in joints]
        if all(math.isfinite(v) or (missing and math.isnan(v)) for v in velocities):
            return
        if self._parameters["absurd.jump"] and not missing:
            before = self._alike(joints, stamped)
            newest = max((entry["at"] for entry in before.values()), default=-1)
            first = min(joints, key=NAMES.index)
            place, then, since = self.bare.get(first, (None, 0, 0))
            own = [sent[name]["position"] for name in joints]
            self.bare[first] = own, at, newest
            again = place == own and since != newest and abs(at - then) <= 5 * S
            apart = any(self._step(name, sent[name], old) > 1e-3 for name, old in before.items())
            self.counts["interleaved sources"] += apart and (again or at == newest)
        raise RejectionError("no velocity")

    def _alike(self, joints, stamped):
        """Return the last values of joints by the same clock."""
        return {name: self.known[name] for name in joints if self.known.get(name, {}).get("stamped") == stamped}

    def _check_stamp(self, at, stamped, now, joints):
        """Reject a stamp that is out of time; forget all joints where time has jumped back. Return what acceptance does."""
        far, most = None, round(self._parameters["max_age"] * 1000) * MS
        refuses = self._parameters["foreign_time"] == "refuse"
        if stamped and now and most:
            far = abs(now - at) > most
            if far and (self.in_step or refuses) and self._is_early(now, now - at, most, refuses):
                side = "past" if at < now else "future"
                raise RejectionError(f"stamp from the {side}" if self.in_step else "foreign time")
        alike, source = self._alike(joints, stamped), None
        if alike:
            newest = max(alike, key=lambda name: self.known[name]["at"])
            span = self._timeout(newest)
            span = max(S, span) if span < INF else S
            source = min(joints, key=NAMES.index)
            self._check_order(at, self.known[newest]["at"], span, source)

        def accept():
            self.runs.pop(source, None)
            if far is not None:
                self.far_since = None
                self.in_step = abs(now - at) <= most / 2 if self.in_step is False else not far

        return accept

    def _is_early(self, now, offset, most, refuses):
        """Return whether ten seconds of one distance from the clock are not over yet."""
        since = self.far_since
        if since is None or abs(offset - since[1]) > most or now < since[0]:
            self.far_since = now, offset
        return refuses or now < self.far_since[0] + 10 * S

    def _check_order(self, at, last, span, source):
        if at >= last:
            return
        run = self.runs.setdefault(source, [])
        if run and not run[-1] <= at <= run[-1] + span:
            run.clear()
        run.append(at)
        if last - at <= span:
            if len(run) < 5 or at - run[0] < S // 2:
                raise RejectionError("late")
        elif len(run) < 2:
            raise RejectionError("stamp from the past")
        self.counts["time jumped back"] += 1
        self.known, self.efforts, self.tracks, self.away, self.runs, self.bare = {}, {}, {}, {}, {}, {}

    def _step(self, name, new, old):
        """Return how far apart two positions of a joint are."""
        step = abs(new["position"] - old["position"])
        return min(step % (2 * PI), 2 * PI - step % (2 * PI)) if name in CONTINUOUS else step

    def _is_far(self, name, new, at, old, old_at, always=False):
        """Return whether velocities at both ends explain no such step."""
        limit = VELOCITY_LIMITS[name]
        seconds = (at - old_at) * 1e-9
        speeds = [abs(entry["velocity"]) for entry in (new, old) if not math.isnan(entry["velocity"])]
        reach = max(2.0 * max(speeds, default=0.0), limit)
        reach = self._fastest(name) if math.isnan(new["velocity"]) else reach
        step = self._step(name, new, old)
        most = reach * max(seconds, 0.01) + self._parameters["absurd.jump"]
        return step > most and (always or seconds <= (0.5 if limit else 0.05))

    def _check_steps(self, sent, at, stamped, joints):
        """Reject steps that no velocity explains, and messages of a second source. Return the joints that are elsewhere now,
        and what acceptance does.
        """
        if not self._parameters["absurd.jump"] or not joints:
            return [], lambda: None
        for name in [name for name, entry in self.away.items() if abs(at - entry["at"]) > 5 * S]:
            del self.away[name]
        before = self._alike(joints, stamped)
        far = [name for name, old in before.items() if self._is_far(name, sent[name], at, old, old["at"])]
        twice = any(at == old["at"] and self._step(name, sent[name], old) > 1e-3 for name, old in before.items())

        def contradict():
            self.counts["interleaved sources"] += twice

        stops = len(before) == len(joints) and self._stops_elsewhere(sent, at, before)
        is_known = any(entry["returns"] > 0 for entry in self.away.values())
        if not far and not stops and not is_known:
            return [], contradict
        new, same = self._candidate(sent, at, joints, before, far or list(before))
        if not far:
            apart = any(self._step(name, sent[name], old) > 0.0 for name, old in before.items())
            again = same and apart and _rest(sent[name] for name in joints)

            def store():
                contradict()
                self.away |= new

            if not again:
                return [], store if stops and not is_known else contradict
            if not any(new[name]["returns"] >= 2 for name in before):
                return [], store
        return self._judge_candidate(sent, at, before, far, new, same)

    def _stops_elsewhere(self, sent, at, before):
        """Return whether joints that moved rest at once where no motion leads."""
        if any(sent[name]["velocity"] != 0.0 for name in before) or _rest(before.values()):
            return False
        margin = 0.15 * self._parameters["absurd.jump"]
        speed = {name: 0.0 if math.isnan(old["velocity"]) else abs(old["velocity"]) for name, old in before.items()}
        return any(
            self._step(name, sent[name], old) > 2.0 * speed[name] * max(at - old["at"], 0) * 1e-9 + margin
            for name, old in before.items()
        )

    def _candidate(self, sent, at, joints, before, which):
        """Return the candidate that a message makes, by joint, and whether its positions are those of the last one."""
        none = {"count": 0, "returns": 0, "position": 0.0, "velocity": 0.0, "at": 0, "since": None}
        last = {name: self.away.get(name, none) for name in joints}
        same = {name: last[name]["count"] > 0 and last[name]["position"] == sent[name]["position"] for name in joints}
        agrees = all(
            last[name]["count"] > 0 and not self._is_far(name, sent[name], at, last[name], last[name]["at"], True)
            for name in which
        )
        new = {}
        for name in joints:
            since = (before[name]["at"], before[name]["position"]) if name in before else None
            row = agrees and since is not None and since == last[name]["since"]
            back = agrees and not row and (at - last[name]["at"]) * 1e-9 <= 0.5
            new[name] = sent[name] | {
                "at": at,
                "since": since,
                "count": last[name]["count"] + 1 if row else 1,
                "returns": last[name]["returns"] + back if row or back else 0,
            }
        return new, all(same.values())

    def _judge_candidate(self, sent, at, before, far, new, same):
        """Reject a message elsewhere, or return the joints that are elsewhere now, and what acceptance does."""
        which = far or list(before)
        interleaved = any(new[name]["returns"] >= (1 if far else 2) for name in which)
        silence = at - max(before[name]["at"] for name in which)
        believed = all(new[name]["count"] >= 3 for name in which) and (not interleaved or silence * 1e-9 > 0.5)
        rested = _rest(before.values())
        resting = _rest(sent[name] for name in new)
        goes_on = not same and (not resting or any(math.isnan(sent[name]["velocity"]) for name in new))
        moves = far and interleaved and rested and goes_on
        if not (believed or moves):
            self.away |= new
            raise RejectionError("interleaved sources" if interleaved else "jump")
        displaced = {}
        for name in new:
            old = self.known.get(name)
            if old is None or name not in before:
                displaced[name] = None
                continue
            returns = 0 if believed else max(new[name]["returns"], 1)
            displaced[name] = old | {"since": (old["at"], old["position"]), "count": 1, "returns": returns}

        def accept():
            for name, entry in displaced.items():
                self.away.pop(name, None)
                if entry:
                    self.away[name] = entry
            self.counts["positions jumped"] += bool(far)

        return far, accept

    def _estimate(self, new, at, moved):
        """Keep the steps that joints make, and put estimates where velocities are missing."""
        tracks, fast = {}, []
        for name, entry in new.items():
            track = None if name in moved else self.tracks.get(name)
            if track and self.known.get(name, entry)["stamped"] == entry["stamped"] and at >= track["at"]:
                seconds = (at - track["at"]) / S
                period = track["steps"][-1][1] if track["steps"] else 10.0 / 3.0
                timeout = self._timeout(name)
                longest = max(timeout if timeout < INF else 0, round(3 * period * S))
                if at == track["at"]:
                    continue
                if at - track["at"] <= longest:
                    step = entry["position"] - track["position"]
                    if name in CONTINUOUS:
                        step = (step + PI) % (2.0 * PI) - PI
                    steps = [*track["steps"], (at, seconds, step)]
                    tracks[name] = track | {"at": at, "position": entry["position"], "steps": steps}
                    if math.isnan(entry["velocity"]) and abs(step / seconds) > self._number("absurd.velocity"):
                        fast.append(name)
                    continue
            tracks[name] = {"since": at, "at": at, "position": entry["position"], "steps": []}
        if fast:
            raise RejectionError("absurd value")
        self.tracks |= tracks
        for name, entry in new.items():
            if math.isnan(entry["velocity"]):
                entry |= {"velocity": self._velocity(name, at), "estimated": True}

    def _velocity(self, name, at):
        """Return the mean of all quotients, weighted by their age; NaN before the filter time."""
        track, time = self.tracks[name], self._parameters["velocity_filter_time"]
        if not track["steps"] or at - track["since"] < round(time * S):
            return NAN
        if not time:
            _, seconds, step = track["steps"][-1]
            return step / seconds
        weights = [
            math.exp((then - at) / S / time) * -math.expm1(-seconds / time) for then, seconds, _ in track["steps"]
        ]
        quotients = [step / seconds for _, seconds, step in track["steps"]]
        return sum(w * x for w, x in zip(weights, quotients, strict=True)) / sum(weights)

    def _effort(self, name, sent):
        available = self._of_joint("effort_available", name, True)
        return (
            sent * self._of_joint("effort_scale", name, 1.0) if available and not self._is_absurd(name, sent) else NAN
        )

    def _is_absurd(self, name, sent):
        if math.isnan(sent) or not self._of_joint("effort_available", name, True):
            return False
        limit = EFFORT_LIMITS.get(name, 0.0) * self._parameters["absurd.beyond_effort"] or INF
        size = abs(sent * self._of_joint("effort_scale", name, 1.0))
        return size == INF or size > min(limit, self._number("absurd.effort"))

    def _is_apart(self, name, position, at):
        source, multiplier, offset = MIMICS[name]
        if source not in self.known or abs(self.known[source]["at"] - at) > self._timeout(source):
            return False
        distance = abs(position - multiplier * self.known[source]["position"] - offset)
        return math.isfinite(position) and 0.0 < self._parameters["mimic_tolerance"] < distance

    def _assemble(self):
        if len(self.known) < len(NAMES):
            return "incomplete"
        joints = [self.known[name] for name in NAMES]
        newest, oldest = (choose(joint["at"] for joint in joints) for choose in (max, min))
        if any(newest - self.known[name]["at"] > self._timeout(name) for name in NAMES):
            raise RejectionError("stale joint")
        velocity = [joint["velocity"] for joint in joints]
        if self._parameters["missing_velocity"] == "estimate" and any(map(math.isnan, velocity)):
            return "awaiting velocity"
        if not all(map(math.isfinite, velocity)):
            raise RejectionError("no velocity")
        effort = [self._effort(name, joint["effort"]) for name, joint in zip(NAMES, joints, strict=True)]
        effort = effort if all(map(math.isfinite, effort)) else None
        for name, (source, multiplier, _) in MIMICS.items() if effort else ():
            at, own = self.efforts.get(name, (0, NAN))
            if math.isfinite(own) and abs(newest - at) <= self._timeout(name):
                effort[NAMES.index(source)] += multiplier * own
        flags = any(not joint["stamped"] for joint in joints), any(joint["estimated"] for joint in joints)
        self.states.append(([joint["position"] for joint in joints], velocity, effort, newest, oldest, *flags))
        return "published"
