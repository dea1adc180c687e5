# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Judge of stamps, by this node's clock and by earlier stamps."""

from typing import NamedTuple

from diag_dynamics.assembly.rejected import RejectedError

SECOND = 1_000_000_000

PATIENCE = 10 * SECOND
"""Time [ns] for which all stamps must differ from this node's clock by the same amount before they are accepted again."""

LATE_COUNT, LATE_TIME = 5, SECOND // 2
"""Late stamps in a row, and time [ns] from the first to the last of them, after which time has started anew instead."""

UNJUDGED, NEAR, FAR = range(3)
"""Where a stamp has to be by this node's clock, within `max_age` or not, for nothing to change: see :attr:`Stamps.mode`."""


def nanoseconds(seconds):
    """Nanoseconds of seconds, rounded: truncated, 1.001 s would fall short of 1001 ms."""
    return round(seconds * SECOND)


def stamp_of(message, now):
    """Stamp of a message [ns], `now` where it is zero, and whether it was.

    Raises
    ------
    RejectedError
        It is negative, or its nanoseconds are a second or more; or it is zero, and so is this node's clock.
    """
    sec, nanosec = message.header.stamp.sec, message.header.stamp.nanosec
    if sec < 0 or nanosec >= SECOND:
        raise RejectedError(
            "malformed stamp",
            f"header.stamp is {sec} s and {nanosec} ns, expected no less than 0 s and less than 1e9 ns",
        )
    stamp = sec * SECOND + nanosec
    if stamp:
        return stamp, False
    if not now:
        raise RejectedError("no time", "header.stamp is zero, and so is the clock: use_sim_time without /clock")
    return now, True


class AcceptedStamp(NamedTuple):
    """Verdict on a stamp: :meth:`Stamps.accept` stores what later verdicts depend on."""

    source: object
    """Source with an earlier stamp; None for none."""
    anew: bool
    """Whether time has started anew, so that all that came before has to be forgotten."""
    far: bool | None
    """Whether the stamp is far from this node's clock; None where that is not judged."""
    apart: int
    """This node's clock less the stamp [ns]."""


class Stamps:
    """Judge that tells apart stamps that are right, late, of another time, or of a time that has started anew.

    A source whose stamps are far from this node's clock from the first one on is foreign: a recording, or a host
    whose clock is not synchronized. Once a stamp has agreed with the clock, stamps that do not agree are refused. If all
    stamps differ by the same amount for :data:`PATIENCE`, one of the clocks has been set, and they are accepted.

    Parameters
    ----------
    max_age : float
        Largest distance of a stamp from this node's clock [s]; 0: not judged.
    refuse_foreign : bool
        Whether stamps of another time are refused whatever came before.

    Attributes
    ----------
    in_step : bool or None
        Whether stamps agree with this node's clock; None before it is known.
    limit : str
        Name of `max_age` in messages.
    offset : float
        This node's clock less the stamp, of the last message that was accepted [s].
    suspects : dict
        Sources whose last stamp was older than the one before.
    """

    def __init__(self, max_age=0.0, refuse_foreign=False):
        self.max_age, self.refuse_foreign, self.limit = max_age, refuse_foreign, "max_age"
        self.offset = 0.0
        self.forget()

    def forget(self):
        """Forget all sources."""
        self.in_step = None
        self._refused = None  # time of the first refusal by the clock, and the distance then [ns]
        self.suspects = {}  # by source: first and last stamp older than the one before [ns], and their number

    @property
    def mode(self):
        """By which of these rules a stamp no older than the source's last is accepted; None while the clocks are in doubt.

        Nothing changes by it, unless its source is among the suspects.
        """
        if self._refused:
            return None
        if not self.max_age:
            return UNJUDGED if self.in_step is None else None
        if self.in_step:
            return NEAR
        return FAR if self.in_step is False and not self.refuse_foreign else None

    def judge(self, source, what, stamp, now, last, span):
        """Return the verdict on a stamp.

        Parameters
        ----------
        source : hashable or None
            Source whose stamps have to be in order; None: none has.
        what : str
            Its name.
        stamp, now : int
            The stamp, and this node's clock, where 0 is a clock that has not begun, or is no measure of it [ns].
        last : int or None
            The newest stamp of the same source [ns].
        span : int
            How much older than `last` a stamp is merely late [ns].

        Returns
        -------
        AcceptedStamp

        Raises
        ------
        RejectedError
            It is late, from the past or from the future. Only what this source, or this clock, is suspected of is stored.
        """
        far = None
        if self.max_age and now:
            far = self._far(what, stamp, now)
        anew = last is not None and stamp < last
        if anew:
            self._suspect(source, what, stamp, last, span)
        return AcceptedStamp(None if last is None else source, anew, far, now - stamp)

    def accept(self, accepted):
        """Store what a verdict changes, once the whole message is accepted."""
        if accepted.anew:
            self.suspects.clear()
        elif accepted.source is not None:
            self.suspects.pop(accepted.source, None)
        if accepted.far is not None:
            self._refused, self.offset = None, accepted.apart * 1e-9
            # A foreign stamp must come within half of the bound before the bound holds for its source: at the bound itself,
            # a clock that differs by just that much would be accepted and refused by turns.
            well_within = 2 * abs(accepted.apart) <= nanoseconds(self.max_age)
            self.in_step = not accepted.far and (self.in_step is not False or well_within)
        elif not self.max_age:
            self.in_step = self._refused = None

    def _far(self, what, stamp, now):
        """Whether a stamp is far from the clock and accepted all the same."""
        apart, most = now - stamp, nanoseconds(self.max_age)
        far = abs(apart) > most
        if not far or not (self.in_step or self.refuse_foreign):
            return far
        if self._refused is None or abs(apart - self._refused[1]) > most or now < self._refused[0]:
            self._refused = now, apart
        if self.refuse_foreign or now - self._refused[0] < PATIENCE:
            when, word = ("past", "behind") if apart > 0 else ("future", "ahead of")
            raise RejectedError(
                f"stamp from the {when}" if self.in_step else "foreign time",
                f"{what}: stamp {abs(apart) * 1e-9:.3f} s {word} this node's clock, expected within {self.limit} = "
                f"{self.max_age:g} s",
            )
        return True

    def _suspect(self, source, what, stamp, last, span):
        """Refuse a stamp older than `last`, unless the source goes on from it: its time has started anew."""
        behind = f"{what}: stamp {(last - stamp) * 1e-9:.6f} s older than the one before"
        first, before, count = self.suspects.get(source, (stamp, stamp, 0))
        if count and not 0 <= stamp - before <= span:
            first, count = stamp, 0
        self.suspects[source] = first, stamp, count + 1
        if last - stamp <= span:
            if count + 1 < LATE_COUNT or stamp - first < LATE_TIME:
                raise RejectedError("late", behind)
        elif not count:
            raise RejectedError("stamp from the past", behind)
