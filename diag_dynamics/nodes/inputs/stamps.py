"""Judging stamps: by this node's clock, and by those that came before."""

from diag_dynamics.nodes.inputs.rejected import RejectedError

SECOND = 1_000_000_000

CONTINUES = SECOND
"""A stamp from the past is not alone if another one follows it by no more than this [ns]."""


def stamp_of(message, now):
    """Stamp of a message [ns], `now` where it is zero, and whether it was.

    Raises
    ------
    RejectedError
        It is negative, or its nanoseconds are a second or more.
    """
    sec, nanosec = message.header.stamp.sec, message.header.stamp.nanosec
    if sec < 0 or nanosec >= SECOND:
        raise RejectedError("malformed stamp", f"header.stamp is {sec} s and {nanosec} ns, expected no less than 0 s")
    stamp = sec * SECOND + nanosec
    return (stamp, False) if stamp else (now, True)


class Stamps:
    """Tells a stamp that is right from one that is late, from another time, or after time has started anew.

    A source whose stamps are far from this node's clock from the first one on lives in another time: a recording, or a
    host whose clock is not synchronized. As soon as a stamp agrees with the clock, those that do not are refused.

    Parameters
    ----------
    max_age : float
        Largest distance of a stamp from this node's clock [s]; 0: not judged.
    refuse_foreign : bool
        Whether stamps of another time are refused from the first one on.

    Attributes
    ----------
    in_step : bool or None
        Whether stamps agree with this node's clock; None before it is known.
    offset : float
        This node's clock less the stamp, of the last one that was judged [s].
    """

    def __init__(self, max_age=0.0, refuse_foreign=False):
        self.max_age, self.refuse_foreign = max_age, refuse_foreign
        self.in_step = None
        self.offset = 0.0
        self._suspect = None

    def judge(self, what, stamp, now, last, span):
        """Accept a stamp; return whether time has started anew, so that all that came before has to be forgotten.

        Parameters
        ----------
        what : str
            Whose stamp it is.
        stamp, now : int
            The stamp, and this node's clock, where 0 is a clock that has not begun [ns].
        last : int or None
            The newest stamp of the same source [ns].
        span : int
            How much older than `last` a stamp is merely late [ns].

        Raises
        ------
        RejectedError
            It is late, from the past or from the future.
        """
        age = now - stamp
        far = None
        if self.max_age and now:
            self.offset = age * 1e-9
            far = abs(self.offset) > self.max_age
            if far and (self.in_step or self.refuse_foreign):
                when, word = ("past", "behind") if age > 0 else ("future", "ahead of")
                raise RejectedError(
                    f"stamp from the {when}",
                    f"{what}: stamp {abs(self.offset):.3f} s {word} this node's clock, expected within max_age = "
                    f"{self.max_age:g} s",
                )
        anew = last is not None and stamp < last and self._anew(what, stamp, last, span)
        if far is not None:
            # One that is foreign must come well into the bound to be held to it, lest a clock that is apart by as much as
            # the bound be let in and shut out by turns.
            self.in_step = not far and (self.in_step is not False or abs(self.offset) <= 0.5 * self.max_age)
        if not anew:
            self._suspect = None
        return anew

    def _anew(self, what, stamp, last, span):
        """Whether a stamp older than `last` goes on from one that was suspected of the same."""
        behind = f"{what}: stamp {(last - stamp) * 1e-9:.6f} s older than the one before"
        if last - stamp <= span:
            raise RejectedError("late", behind)
        suspect, self._suspect = self._suspect, stamp
        if suspect is None or not 0 <= stamp - suspect <= CONTINUES:
            raise RejectedError("stamp from the past", behind)
        self._suspect = None
        return True
