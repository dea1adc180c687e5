"""Assembling the state of a whole robot from JointState messages that each bring some of its joints."""

import math
from collections import Counter
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from diag_dynamics.nodes.followers import Followers


class RejectedError(Exception):
    """A message, or what would have been assembled from it, is not usable; `cause` is a short key to count by."""

    def __init__(self, cause, message):
        super().__init__(message)
        self.cause = cause


class RobotState(NamedTuple):
    """A whole state; times are in nanoseconds."""

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray | None
    newest: int
    oldest: int
    stamp_is_receive_time: bool


class JointStateAssembler:
    """Keeps the newest values of every joint and hands out a state once all of them are known and fresh.

    Joints that follow one of these may be listed, too. Their efforts are reflected to their leaders; one that is missing,
    NaN or stale counts as zero. Their positions are compared with those that their leaders give them, and disagreement is
    counted, but keeps no state back. A state's stamps are those of the joints that are needed.

    Parameters
    ----------
    names : sequence of str
        The joints that are needed; others in a message are ignored, unless they follow one of these.
    timeout : float
        Largest age of a joint against the newest one [s]; 0 for any.
    mimics : mapping
        :class:`Mimic` by name of the follower.
    mimic_tolerance : float
        Largest disagreement of a follower that is not counted [rad, m]; 0 for any.
    continuous : container of str
        Joints whose position is an angle that turns round.
    """

    def __init__(self, names, timeout, mimics=MappingProxyType({}), mimic_tolerance=0.0, continuous=()):
        self.names = tuple(names)
        self.timeout = timeout
        self.followers = Followers(self.names, mimics, mimic_tolerance, continuous)
        self.counts = Counter()
        self.last_disagreement = ""
        self._index = {name: k for k, name in enumerate(self.names)}
        self._columns = None  # (names of the last message, what _match returned for them)
        self._position, self._velocity, self._effort = np.full((3, len(self.names)), math.nan)
        self._stamp = np.zeros(len(self.names), dtype=np.int64)
        self._known = np.zeros(len(self.names), dtype=bool)
        self._without_stamp = np.zeros(len(self.names), dtype=bool)
        self._follower_effort = self.followers.unknown()
        self._follower_stamp = np.zeros(len(self.followers.names), dtype=np.int64)

    @property
    def missing(self):
        """Joints that have never arrived."""
        return [name for name, known in zip(self.names, self._known, strict=True) if not known]

    def stale(self, now):
        """Joints that have arrived, but not within the timeout before `now` [ns]."""
        return [self.names[k] for k in np.flatnonzero(self._known & (now - self._stamp > self._span))]

    @property
    def _span(self):
        """The timeout in nanoseconds."""
        return self.timeout * 1e9 or math.inf

    def forget(self):
        """Start anew, as after a jump of time."""
        self._known[:] = False
        self._follower_effort[:] = math.nan

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
            None if the message brings none of the joints that are needed, or others have not arrived yet.

        Raises
        ------
        RejectedError
            The message is malformed, too late or without velocity, or a joint is stale.
        """
        (there, here), (beside, following) = self._match(message)
        if not len(here) and not len(following):
            self.counts["foreign"] += 1
            return None
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        unstamped = stamp == 0
        if unstamped:
            stamp = now
        position, velocity, effort = (
            self._values(message, field, there) for field in ("position", "velocity", "effort")
        )
        self._require(position, "position", here)
        if len(here):
            self._keep_order(stamp, here)
        self._position[here], self._velocity[here], self._effort[here] = position, velocity, effort
        self._stamp[here] = stamp
        self._known[here] = True
        self._without_stamp[here] = unstamped
        if len(following):
            self._follow(message, beside, following, stamp)
        return self._assembled() if len(here) else None

    def _match(self, message):
        """Where the needed joints are in the message and where they belong; and likewise for the followers."""
        names = message.name
        if self._columns is None or names != self._columns[0]:
            if len(set(names)) != len(names):
                twice = next(name for name, count in Counter(names).items() if count > 1)
                raise RejectedError("duplicate name", f"joint '{twice}' is listed twice in one message")
            self._columns = (list(names), [_places(names, index) for index in (self._index, self.followers.index)])
        return self._columns[1]

    def _keep_order(self, stamp, here):
        """Drop what is older than what is known, unless time itself has jumped back."""
        before = np.where(self._known[here], self._stamp[here], stamp)
        newest = int(np.argmax(before))
        last = int(before[newest])
        if stamp >= last:
            return
        behind = (last - stamp) * 1e-9
        if behind > max(self.timeout, 1.0):
            self.counts["time jumped back"] += 1
            self.forget()
            return
        raise RejectedError(
            "late", f"joint '{self.names[here[newest]]}': stamp {behind:.6f} s older than the one before"
        )

    def _values(self, message, field, there):
        """One field of a message at the places wanted; an empty array stands for unknown."""
        values = getattr(message, field)
        if len(values) == 0:
            return np.full(len(there), math.nan)
        if len(values) != len(message.name):
            # The joint at which the two part is the first one that cannot be right.
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
            raise RejectedError(
                f"no {what}", f"joint '{self.names[here[k]]}': {what} is {values[k]}, expected a finite number"
            )

    def _follow(self, message, there, here, stamp):
        """Take in the efforts of followers, and compare their positions where their leaders' are fresh."""
        own = self.followers.unknown()
        own[here] = self._values(message, "position", there)
        self._follower_effort[here] = self._values(message, "effort", there)
        self._follower_stamp[here] = stamp
        fresh = self._known & (np.abs(self._stamp - stamp) <= self._span)
        disagreements = self.followers.disagreements(np.where(fresh, self._position, math.nan), own)
        if disagreements:
            self.counts["mimic disagreement"] += 1
            self.last_disagreement = "; ".join(disagreements)

    def _assembled(self):
        if not self._known.all():
            self.counts["incomplete"] += 1
            return None
        newest, oldest = int(self._stamp.max()), int(self._stamp.min())
        stale = self.stale(newest)
        if stale:
            raise RejectedError("stale joint", f"joint '{stale[0]}' is older than {self.timeout} s")
        self._require(self._velocity, "velocity", range(len(self.names)))
        effort = None
        if np.isfinite(self._effort).all():
            fresh = newest - self._follower_stamp <= self._span
            effort = self.followers.reflected(self._effort, np.where(fresh, self._follower_effort, math.nan))
        unstamped = bool(self._without_stamp.any())
        return RobotState(self._position.copy(), self._velocity.copy(), effort, newest, oldest, unstamped)


def _places(names, index):
    """Where those of the names that are in an index stand among the names, and what the index says of them."""
    known = [(k, index[name]) for k, name in enumerate(names) if name in index]
    return np.array(known, dtype=int).reshape(-1, 2).T
