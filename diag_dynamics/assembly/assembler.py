# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Assembler of a robot's state from JointState messages, each of which may bring only some of its joints."""

import math
from collections import Counter
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.bounds import Bounds
from diag_dynamics.assembly.efforts import Efforts
from diag_dynamics.assembly.followers import Followers
from diag_dynamics.assembly.gaps import Gaps
from diag_dynamics.assembly.jumps import INTERLEAVED, Accepted, Jumps
from diag_dynamics.assembly.rejected import RejectedError
from diag_dynamics.assembly.stamps import SECOND, Stamps, nanoseconds, stamp_of
from diag_dynamics.assembly.velocities import VelocityEstimator
from diag_dynamics.entries import by_name
from diag_dynamics.model.single_joints import places, single_joints

_NONE = MappingProxyType({})


class Joints(NamedTuple):
    """Joints of a robot: the independent ones, whose states are needed, and their followers.

    `mimics` holds a :class:`Mimic` by name of the follower, `continuous` the joints whose position is an angle that turns
    round; `lower` and `upper` are position limits [rad, m], `velocity` and `effort` those of velocity [rad/s, m/s] and effort
    [N m, N], None for none.
    """

    names: tuple
    mimics: Mapping = _NONE
    continuous: frozenset = frozenset()
    lower: np.ndarray | None = None
    upper: np.ndarray | None = None
    velocity: np.ndarray | None = None
    effort: np.ndarray | None = None


class Options(NamedTuple):
    """Rules by which messages are judged: the monitor's parameters. Mappings are by joint, ``*`` for all others."""

    timeout: float = 0.5
    timeouts: Mapping = _NONE
    mimic_tolerance: float = 0.0
    max_age: float = 0.0
    refuse_foreign: bool = False
    estimate_velocity: bool = False
    velocity_filter_time: float = 0.01
    effort_available: Mapping = _NONE
    effort_scale: Mapping = _NONE
    effort_includes_gravity: Mapping = _NONE
    max_position: float = 0.0
    max_velocity: float = 0.0
    max_effort: float = 0.0
    beyond_limits: float = 0.0
    beyond_velocity: float = 0.0
    beyond_effort: float = 0.0
    jump: float = 0.0


class RobotState(NamedTuple):
    """A whole state; times are in nanoseconds."""

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray | None
    newest: int
    oldest: int
    stamp_is_receive_time: bool
    velocity_estimated: bool = False


JOINT_RULES = np.dtype(
    [
        ("lower", "f8"),  # as Bounds has these and `fastest`
        ("upper", "f8"),
        ("fastest", "f8"),
        ("factor", "f8"),  # as Efforts has it and `strongest`
        ("strongest", "f8"),
        ("reach", "f8"),  # as Jumps has these three
        ("lasting", "f8"),
        ("turns", "f8"),
        ("span", "f8"),  # how old a value may be [ns]
    ]
)
"""What the values of an independent joint are judged by."""

FOLLOWER_RULES = np.dtype(
    [
        ("leader", "i8"),  # as Followers has these three
        ("multiplier", "f8"),
        ("offset", "f8"),
        ("factor", "f8"),  # of its effort
        ("span", "f8"),
    ]
)
"""What those of a follower are judged by."""


class PlainJudgement(NamedTuple):
    """Rules by which a message is judged, and the memory of the assembler, which wire/joint_states.py writes in, too.

    All but the first six are arrays with an entry for each joint, or for each follower.
    """

    max_age: int
    """[ns]"""
    most_effort: float
    mimic_tolerance: float
    slack: float
    joints: np.ndarray
    """Of :data:`JOINT_RULES`."""
    followers: np.ndarray
    """Of :data:`FOLLOWER_RULES`."""
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    stamp: np.ndarray
    known: np.ndarray
    without_stamp: np.ndarray
    follower_effort: np.ndarray
    follower_stamp: np.ndarray


class JointStateAssembler:
    """Keeps the newest values of every joint and hands out a state once all of them are known and fresh.

    Joints that follow one of these may be listed, too. Their efforts are reflected to their leaders; one that is missing,
    NaN or stale counts as zero. Their positions are compared with those that their leaders give them, and disagreement is
    counted, but keeps no state back. A state's stamps are those of the joints that are needed. Joints that are neither are
    ignored.

    Parameters
    ----------
    joints : Joints
    options : Options
    map_name : callable, optional
        Returns the robot's name of a joint by its name in messages; without it they are the same.

    Attributes
    ----------
    counts : Counter
        Number of messages that made no state and were not rejected, by cause, and of other events.
    last_foreign : tuple of str
        Names in the last message without a joint of this robot.
    last_disagreement : str
        Text on the followers that were astray last.
    stamps : Stamps
    efforts : Efforts
    jumps : Jumps
    gaps : Gaps

    Raises
    ------
    InputError
        The options name a joint that is not there.
    """

    def __init__(self, joints, options, map_name=None):
        count = len(joints.names)
        self._map_name = map_name
        self.names = tuple(joints.names)
        self.followers = Followers(self.names, joints.mimics, options.mimic_tolerance, joints.continuous)
        self.counts = Counter()
        self.last_disagreement, self.last_foreign = "", ()
        self.stamps, self.gaps = Stamps(), Gaps()
        self._joints = joints
        self._index = {name: k for k, name in enumerate(self.names)}
        self._columns = None  # names of the last message, and the places _match found for them
        self._values = np.full((3, count), math.nan)
        self._position, self._velocity, self._effort = self._values
        self._stamp = np.zeros(count, dtype=np.int64)
        self._known, self._without_stamp, self._estimated = np.zeros((3, count), dtype=bool)
        self._follower_effort = self.followers.unknown()
        self._follower_stamp = np.zeros(len(self.followers.names), dtype=np.int64)
        turns = [name in joints.continuous for name in self.names]
        self._estimator = VelocityEstimator(turns)
        self.jumps = Jumps(self.names, turns, joints.velocity)
        self.configure(options)

    def configure(self, options):
        """Judge messages by other options from now on; nothing changes if the options are refused.

        Raises
        ------
        InputError
            They name a joint that is not there.
        """
        efforts, bounds, spans = self.judges(options)
        self.efforts, self._bounds, (self._spans, self._follower_spans) = efforts, bounds, spans
        self.options = options
        if not options.estimate_velocity:
            self._velocity[self._estimated] = math.nan
            self._estimated[:] = False
            self._estimator.forget()
        self.followers.tolerance, self.jumps.slack = options.mimic_tolerance, options.jump
        if not options.jump:
            self.jumps.forget()
        self.stamps.max_age, self.stamps.refuse_foreign = options.max_age, options.refuse_foreign

    def judges(self, options):
        """Return efforts, bounds and age limits as `options` would have them.

        Raises
        ------
        InputError
            They name a joint that is not there.
        """
        joints, count = self._joints, len(self.names)
        timeouts = by_name("joint_timeouts", options.timeouts, (*self.names, *self.followers.names))
        ages = [
            np.array([nanoseconds(timeouts.get(name, options.timeout)) or math.inf for name in names])
            for names in (self.names, self.followers.names)
        ]
        lower = np.full(count, -math.inf) if joints.lower is None else joints.lower
        upper = np.full(count, math.inf) if joints.upper is None else joints.upper
        efforts = Efforts(self.names, self.followers.names, options, joints.effort)
        turns = [name in joints.continuous for name in self.names]
        return efforts, Bounds(self.names, lower, upper, turns, options, joints.velocity), ages

    def plain_judgement(self):
        """Return what wire/joint_states.py judges a whole, ordinary message by, and where it keeps it.

        Returns
        -------
        PlainJudgement or None
            None if compiled code cannot judge every message: velocities are estimated, or a follower turns round.
        """
        bounds, efforts, jumps, follow = self._bounds, self.efforts, self.jumps, self.followers
        if self.options.estimate_velocity or (follow.tolerance and follow.turns.any()):
            return None
        joints = np.zeros(len(self.names), JOINT_RULES)
        joints["lower"], joints["upper"], joints["fastest"] = bounds.lower, bounds.upper, bounds.fastest
        joints["factor"], joints["strongest"], joints["span"] = efforts.factors, efforts.strongest, self._spans
        joints["reach"], joints["lasting"], joints["turns"] = jumps.reach, jumps.lasting, jumps.turns
        followers = np.zeros(len(follow.names), FOLLOWER_RULES)
        followers["leader"], followers["multiplier"], followers["offset"] = (
            follow.leaders,
            follow.multipliers,
            follow.offsets,
        )
        followers["factor"], followers["span"] = efforts.follower_factors, self._follower_spans
        return PlainJudgement(
            max_age=nanoseconds(self.options.max_age),
            most_effort=efforts.most,
            mimic_tolerance=follow.tolerance,
            slack=jumps.slack,
            joints=joints,
            followers=followers,
            position=self._position,
            velocity=self._velocity,
            effort=self._effort,
            stamp=self._stamp,
            known=self._known,
            without_stamp=self._without_stamp,
            follower_effort=self._follower_effort,
            follower_stamp=self._follower_stamp,
        )

    @property
    def mode(self):
        """By which rule compiled code may accept a stamp, see :attr:`Stamps.mode`; None where it may accept no message."""
        return None if self.jumps.interleaved else self.stamps.mode

    @property
    def missing(self):
        """Joints that have never arrived."""
        return [name for name, known in zip(self.names, self._known, strict=True) if not known]

    @property
    def without_effort(self):
        """Joints that have arrived, their efforts not."""
        return [self.names[k] for k in np.flatnonzero(self._known & ~np.isfinite(self._effort))]

    @property
    def estimated(self):
        """Joints whose velocities are estimated from their positions."""
        return [self.names[k] for k in np.flatnonzero(self._known & self._estimated)]

    @property
    def newest(self):
        """The newest stamp of the joints that have arrived [ns]; 0 without any."""
        return int(self._stamp[self._known].max(initial=0))

    def stale(self, now):
        """Joints that have arrived, but not within their age limit before `now` [ns]."""
        return [self.names[k] for k in np.flatnonzero(self._known & (now - self._stamp > self._spans))]

    def forget(self):
        """Start anew, as after a jump of time."""
        self._known[:] = False
        self._estimated[:] = False
        self._follower_effort[:] = math.nan
        self._estimator.forget()
        self.jumps.forget()
        self.gaps.pause()

    def update(self, message, now):
        """Take a message in and return the state it completes.

        Parameters
        ----------
        message : sensor_msgs.msg.JointState
        now : int
            Time of reception [ns], which stands for a stamp of zero.

        Returns
        -------
        RobotState or None
            None if the message brings none of the joints that are needed, or others have not arrived yet, or a velocity
            cannot be estimated yet.

        Raises
        ------
        RejectedError
            The message is malformed, out of time, absurd, a jump or without velocity: it leaves no trace but what a later
            restart of time, setting of a clock or jump is judged by. Or the message is accepted, and another joint is stale.
        """
        (there, here), (beside, following) = self._match(message)
        if not len(here) and not len(following):
            self.counts["foreign"] += 1
            self.last_foreign = tuple(message.name)
            return None
        stamp, unstamped = stamp_of(message, now)
        position, velocity, effort = (
            self._field(message, field, there) for field in ("position", "velocity", "effort")
        )
        self._require(position, "position", here)
        self._bounds.check(position, velocity, here)
        self._require_velocity(velocity, here, position, stamp, unstamped)
        judged = self._judge_stamp(stamp, unstamped, now, here, following)
        steps = self._judge_steps(stamp, unstamped, here, position, velocity)
        if self.options.estimate_velocity:
            velocity = self._with_estimates(stamp, unstamped, here, position, velocity, steps.moved)
        # The message is accepted. What rejects it must stand above, for a rejected message leaves no trace.
        self._accept(judged, steps, here, stamp, unstamped)
        absurd = False
        if len(here):
            absurd |= self._take(stamp, unstamped, here, position, velocity, effort)
        if len(following):
            absurd |= self._follow(message, beside, following, stamp)
        self.counts["absurd effort"] += absurd
        if len(here):
            return self._assembled()
        self.counts["followers only"] += 1
        return None

    def columns(self, message):
        """Places of joints in an accepted message and in the state, then those of followers: four arrays of int."""
        (there, here), (beside, following) = self._match(message)
        return tuple(np.ascontiguousarray(places) for places in (there, here, beside, following))

    def _match(self, message):
        """Places of the joints in the message and in the state; the same for the followers."""
        names = message.name
        if self._columns is None or names != self._columns[0]:
            joints = [self._map_name(name) for name in names] if self._map_name else names
            if len(set(joints)) != len(joints):
                twice = next(name for name, count in Counter(joints).items() if count > 1)
                raise RejectedError("duplicate name", f"joint '{twice}' is listed twice in one message")
            self._columns = (list(names), [_places(joints, index) for index in (self._index, self.followers.index)])
        return self._columns[1]

    def _judge_stamp(self, stamp, unstamped, now, here, following):
        """Reject a stamp that is out of time; forget all joints if time has started anew."""
        if len(here):
            # A stamp may be of another clock than a time of reception: comparing the two would refuse good messages.
            comparable = self._known[here] & (self._without_stamp[here] == unstamped)
            before = np.where(comparable, self._stamp[here], -1)
            k = int(np.argmax(before))
            last = int(before[k]) if comparable[k] else None
            source, what = int(here.min()), f"joint '{self.names[here[k]]}'"
            span = self._spans[here[k]]
        else:  # a late value of a follower does no harm: its leader decides
            source = last = None
            what, span = f"joint '{self.followers.names[following[0]]}'", 0.0
        span = max(int(span), SECOND) if math.isfinite(span) else SECOND
        judged = self.stamps.judge(source, what, stamp, 0 if unstamped else now, last, span)
        if judged.anew:  # then nothing is left that the message could contradict
            self.counts["time jumped back"] += 1
            self.forget()
        return judged

    def _last_of(self, here, unstamped):
        """Last positions, velocities and stamps of joints, and whether they are known by the same clock."""
        known = self._known[here] & (self._without_stamp[here] == unstamped)
        return self._position[here], self._velocity[here], self._stamp[here], known

    def _judge_steps(self, stamp, unstamped, here, position, velocity):
        """Reject positions that no motion explains, until three messages agree on them."""
        if not self.jumps.slack or not len(here):
            return Accepted()
        before = self._last_of(here, unstamped)
        return self.jumps.judge(here, position, velocity, self._bounds.fastest[here], stamp, before)

    def _accept(self, judged, steps, here, stamp, unstamped):
        """Store what later messages are judged by."""
        self.stamps.accept(judged)
        self.jumps.accept(steps)
        self.counts["positions jumped"] += len(steps.moved) > 0
        self.counts[INTERLEAVED] += steps.contradicts
        if len(here) and not unstamped:
            self.gaps.take(int(here.min()), stamp)

    def _field(self, message, field, there):
        """Values of one field of a message at some places; NaN for all if the array is empty."""
        values = getattr(message, field)
        if len(values) == 0:
            return np.full(len(there), math.nan)
        if len(values) != len(message.name):
            # The first joint without a value, or without a name, is the one to tell of.
            at = min(len(values), len(message.name) - 1)
            raise RejectedError(
                "wrong length",
                f"{field} has {len(values)} entries for {len(message.name)} names (first at '{message.name[at]}')",
            )
        return np.frombuffer(values, dtype=np.float64)[there]

    def _require(self, values, what, here):
        good = np.isfinite(values)
        if not good.all():
            k = int(np.argmin(good))
            hint = " (missing_velocity: estimate takes it from positions)" if what == "velocity" else ""
            raise RejectedError(
                f"no {what}", f"joint '{self.names[here[k]]}': {what} is {values[k]}, expected a finite number{hint}"
            )

    def _require_velocity(self, velocity, here, position, stamp, unstamped):
        """Reject a message without a velocity, but for missing ones that are to be estimated."""
        if self.options.estimate_velocity:
            self._require(np.where(np.isnan(velocity), 0.0, velocity), "velocity", here)
            return
        try:
            self._require(velocity, "velocity", here)
        except RejectedError as error:
            if not self.jumps.slack or not self.jumps.contradicts(
                here, position, stamp, self._last_of(here, unstamped)
            ):
                raise
            self.counts[INTERLEAVED] += 1
            raise RejectedError(error.cause, f"{error}; {self.jumps.contradiction}") from error

    def _take(self, stamp, unstamped, here, position, velocity, effort):
        """Keep the values of joints; return whether an effort is absurd."""
        effort, absurd = self.efforts.of(effort, here)
        self._position[here], self._velocity[here], self._effort[here] = position, velocity, effort
        self._stamp[here], self._without_stamp[here] = stamp, unstamped
        self._known[here] = True
        return absurd

    def _with_estimates(self, stamp, unstamped, here, position, velocity, moved):
        """Velocities, where they are missing estimated from positions."""
        missing = np.isnan(velocity)
        # A difference of two clocks is no interval, and a jump no motion.
        anew = (self._without_stamp[here] != unstamped) | np.isin(here, moved)
        estimate = self._estimate(stamp, here, position, missing, anew)
        self._estimated[here] = missing
        return np.where(missing, estimate, velocity)

    def _estimate(self, stamp, here, position, missing, anew):
        """Velocities estimated from positions; those that stand in for missing ones are judged."""
        longest = np.where(np.isfinite(self._spans[here]), self._spans[here], 0.0)
        fastest = np.where(missing, self.options.max_velocity or math.inf, math.inf)
        time = self.options.velocity_filter_time
        estimate = self._estimator.update(here, position, stamp, time, longest, fastest, anew)
        absurd = np.isinf(estimate)
        if absurd.any():
            k = int(np.argmax(absurd))
            raise RejectedError(
                "absurd value",
                f"joint '{self.names[here[k]]}': its step to position {position[k]:.9g} is faster than {fastest[k]:g} "
                "(absurd.velocity)",
            )
        return estimate

    def _follow(self, message, there, here, stamp):
        """Take in the efforts of followers, and compare their positions where their leaders' are fresh.

        Returns whether an effort is absurd.
        """
        own = self.followers.unknown()
        own[here] = self._field(message, "position", there)
        self._follower_effort[here], absurd = self.efforts.of_followers(self._field(message, "effort", there), here)
        self._follower_stamp[here] = stamp
        fresh = self._known & (np.abs(self._stamp - stamp) <= self._spans)
        disagreements = self.followers.disagreements(np.where(fresh, self._position, math.nan), own)
        if disagreements:
            self.counts["mimic disagreement"] += 1
            self.last_disagreement = "; ".join(disagreements)
        return absurd

    def _assembled(self):
        if not self._known.all():
            self.counts["incomplete"] += 1
            return None
        newest, oldest = int(self._stamp.max()), int(self._stamp.min())
        stale = self.stale(newest)
        if stale:
            k = self._index[stale[0]]
            raise RejectedError("stale joint", f"joint '{stale[0]}' is older than {self._spans[k] * 1e-9:g} s")
        if self.options.estimate_velocity and np.isnan(self._velocity).any():
            self.counts["awaiting velocity"] += 1
            return None
        self._require(self._velocity, "velocity", range(len(self.names)))
        effort = None
        if np.isfinite(self._effort).all():
            fresh = np.abs(newest - self._follower_stamp) <= self._follower_spans
            effort = self.followers.reflected(self._effort, np.where(fresh, self._follower_effort, math.nan))
        return RobotState(
            self._position.copy(),
            self._velocity.copy(),
            effort,
            newest,
            oldest,
            bool(self._without_stamp.any()),
            bool(self._estimated.any()),
        )


def _places(names, index):
    """Places of those names that are in an index: in the names, and in the index."""
    known = [(k, index[name]) for k, name in enumerate(names) if name in index]
    return np.array(known, dtype=int).reshape(-1, 2).T


def joints_of(model):
    """Return the :class:`Joints` of a model."""
    names = single_joints(model)
    at, dof = places(names, model.coordinate_names), places(names, model.dof_names)
    return Joints(
        names,
        model.mimics,
        frozenset(model.continuous_joints),
        model.lower[at],
        model.upper[at],
        model.velocity_limit[dof],
        model.effort_limit[dof],
    )
