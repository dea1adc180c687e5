"""Whether the law may act: what becomes of the command while the state of the robot is not known."""

INACTIVE, ACTIVE, HOLDING, RAMPING_DOWN = range(4)
"""Phases, numbered as in ControllerStatus."""


class Supervisor:
    """Takes the law out of force while the state is not valid, and decides for how long gravity is held.

    The law acts on valid states alone. Without one the robot is held by its last gravity torque for at most `hold_time`,
    and after that given up in an orderly way. Before the first valid state nothing is commanded.

    Parameters
    ----------
    max_age : float
        Largest distance of a state's stamp from the clock [s], into the past or the future.
    hold_time : float
        How long gravity is held [s].

    Attributes
    ----------
    phase : int
    reason : str
        Why the law is not in force; empty if it is.
    """

    def __init__(self, max_age, hold_time):
        self.max_age, self.hold_time = max_age, hold_time
        self.forget()

    def forget(self):
        """Wait for the first state."""
        self.phase, self.reason = INACTIVE, "no valid state yet"
        self._without, self._last = 0, None  # how long there has been no valid state, and when that was asked last [ns]

    def age_problem(self, stamp, now):
        """What is wrong about the age of a state, both times in nanoseconds; None if nothing is."""
        age = (now - stamp) * 1e-9
        if abs(age) <= self.max_age:
            return None
        if not now:
            return "use_sim_time, but nothing on /clock yet"
        if age < 0.0:
            return f"the state is {-age:.6g} s in the future, expected no more than max_state_age = {self.max_age:g} s"
        return f"the state is {age:.6g} s old, expected no more than max_state_age = {self.max_age:g} s"

    @property
    def anew(self):
        """Whether targets of before are void with the next valid state: it is the first one, or the hold is over."""
        return self.phase in (INACTIVE, RAMPING_DOWN)

    def valid(self):
        """Note a valid state, for which a command was found."""
        self.phase, self.reason = ACTIVE, ""
        self._without, self._last = 0, None

    def invalid(self, now, reason):
        """Note at a time [ns] that there is no valid state, and why."""
        self.reason = reason
        if self.phase == INACTIVE:
            return
        if self._last is not None:  # a clock that goes back takes nothing from it, however often
            self._without += max(now - self._last, 0)
        self._last = now
        if self.phase != RAMPING_DOWN:  # for which there is one way out: a valid state
            self.phase = HOLDING if self._without * 1e-9 < self.hold_time else RAMPING_DOWN
