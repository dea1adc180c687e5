"""Judging stamps: by this node's clock, and by those that came before."""

from diag_dynamics.assembly.rejected import RejectedError

SECOND = 1_000_000_000

PATIENCE = 10 * SECOND
"""How long all stamps have to be apart from this node's clock, by the same amount, to be believed anew [ns]."""

LATE_COUNT, LATE_TIME = 5, SECOND // 2
"""Late stamps in a row, and the time between the first and the last of them [ns], that are not late but of another time."""

UNJUDGED, NEAR, FAR = range(3)
"""Where a stamp has to be by this node's clock, within `max_age` or not, for nothing to change: see :attr:`Stamps.mode`."""


def nanoseconds(seconds):
    """The whole number that is meant: 1.001 s are no less than 1001 ms."""
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


class Stamps:
    """Tells a stamp that is right from one that is late, from another time, or after time has started anew.

    A source whose stamps are far from this node's clock from the first one on lives in another time: a recording, or a
    host whose clock is not synchronized. As soon as a stamp agrees with the clock, those that do not are refused, unless
    all of them are apart by the same amount for :data:`PATIENCE`: then one of the clocks has been set.

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
        What messages call `max_age`.
    offset : float
        This node's clock less the stamp, of the last one that was judged [s].
    suspects : dict
        Sources whose last stamp was older than the one before.
    """

    def __init__(self, max_age=0.0, refuse_foreign=False):
        self.max_age, self.refuse_foreign, self.limit = max_age, refuse_foreign, "max_age"
        self.offset = 0.0
        self.forget()

    def forget(self):
        """Know nothing of the sources any more."""
        self.in_step = None
        self._refused = None  # when refusals by the clock began, and how far apart it was then [ns]
        self.suspects = {}  # of each source the first and last stamp, and the number, of those that were too old

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
        """Accept a stamp; return whether time has started anew, so that all that came before has to be forgotten.

        Parameters
        ----------
        source : hashable or None
            Whose stamps are in order; None: nobody's.
        what : str
            Its name.
        stamp, now : int
            The stamp, and this node's clock, where 0 is a clock that has not begun, or is no measure of it [ns].
        last : int or None
            The newest stamp of the same source [ns].
        span : int
            How much older than `last` a stamp is merely late [ns].

        Raises
        ------
        RejectedError
            It is late, from the past or from the future.
        """
        far = None
        if self.max_age and now:
            far = self._far(what, stamp, now)
        anew = last is not None and stamp < last
        if anew:
            self._suspect(source, what, stamp, last, span)
            self.suspects.clear()
        elif last is not None:
            self.suspects.pop(source, None)
        if far is not None:
            self._refused = None
            # One that is foreign must come well into the bound to be held to it, lest a clock that is apart by as much as
            # the bound be let in and shut out by turns.
            well_within = 2 * abs(now - stamp) <= nanoseconds(self.max_age)
            self.in_step = not far and (self.in_step is not False or well_within)
        elif not self.max_age:
            self.in_step = self._refused = None
        return anew

    def _far(self, what, stamp, now):
        """Whether a stamp is far from the clock, and may be."""
        apart, most = now - stamp, nanoseconds(self.max_age)
        self.offset = apart * 1e-9
        far = abs(apart) > most
        if not far or not (self.in_step or self.refuse_foreign):
            return far
        if self._refused is None or abs(apart - self._refused[1]) > most or now < self._refused[0]:
            self._refused = now, apart
        if self.refuse_foreign or now - self._refused[0] < PATIENCE:
            when, word = ("past", "behind") if self.offset > 0.0 else ("future", "ahead of")
            raise RejectedError(
                f"stamp from the {when}" if self.in_step else "foreign time",
                f"{what}: stamp {abs(self.offset):.3f} s {word} this node's clock, expected within {self.limit} = "
                f"{self.max_age:g} s",
            )
        return True

    def _suspect(self, source, what, stamp, last, span):
        """Refuse a stamp older than `last`, unless those of the source go on from there."""
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
