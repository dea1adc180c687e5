# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether the law may act: what becomes of the command while the state of the robot is not known."""

import time

from diag_dynamics.exceptions import InputError

INACTIVE, ACTIVE, HOLDING, RAMPING_DOWN = range(4)
"""Phases, numbered as in ControllerStatus."""

STANDSTILL = 1.0
"""How long the clock may stand still, at least, before a hold is over by the time of the machine [s]."""


class Supervisor:
    """Takes the law out of force while the state is not valid, and decides for how long gravity is held.

    The law acts on valid states alone. Without one the robot is held by its last gravity torque for at most `hold_time`,
    and after that given up in an orderly way. Before the first valid state nothing is commanded. A robot that has been given
    up is not taken up again by itself, unless `resumes`: a cable that comes and goes would let an arm sink and catch it,
    again and again, and somebody may be at work on it by then.

    Parameters
    ----------
    max_age : float
        Largest distance of a state's stamp from the clock [s], into the past or the future.
    hold_time : float
        How long gravity is held [s].
    resumes : bool
        Whether a valid state puts the law in force again after that.
    machine_time : callable
        Time of the machine [s], which counts where the clock stands still.

    Attributes
    ----------
    phase : int
    reason : str
        Why the law is not in force; empty if it is.
    """

    def __init__(self, max_age, hold_time, resumes=False, machine_time=time.monotonic):
        self.max_age, self.hold_time = max_age, hold_time
        self._resumes, self._machine_time = resumes, machine_time
        self.forget()

    def forget(self):
        """Wait for the first state."""
        self.phase, self.reason = INACTIVE, "no valid state yet"
        self._given_up, self._ready, self._released = "", False, False
        self._without = 0  # how long there has been no valid state, less how long there has been one since [ns]
        self._last = self._moved = (
            None  # when that was asked last [ns], and when the clock has moved, by the machine's [s]
        )
        self._good = None  # time of the last valid state, if that was the last one [ns]

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

    def valid(self, now):
        """Note a valid state, for which a command was found, at a time [ns].

        A hold that is over is forgotten no faster than valid states come: of a link that is dead nearly all the time single
        states would else prolong the hold for ever.
        """
        if self.phase != ACTIVE and self.anew:
            self._without = 0
        elif self._good is not None:
            self._without = max(self._without - max(now - self._good, 0), 0)
        self.phase, self.reason = ACTIVE, ""
        self._released, self._last, self._good = False, None, now

    def invalid(self, now, reason):
        """Note at a time [ns] that there is no valid state, and why."""
        self.reason = reason
        self._ready = self._released = False
        if self._good is not None:  # for as long as that state was good
            fresh = min(max(now - self._good, 0), round(self.max_age * 1e9))
            self._without, self._good = max(self._without - fresh, 0), None
        if self.phase == INACTIVE:
            return
        machine = self._machine_time()
        if now != self._last:
            self._moved = machine
        if self._last is not None:  # a clock that goes back takes nothing from it, however often
            self._without += max(now - self._last, 0)
        self._last = now
        if self.phase == RAMPING_DOWN:
            return
        stands_still = machine - self._moved > max(self.hold_time, STANDSTILL)
        over = self._without * 1e-9 >= self.hold_time or stands_still
        self.phase = RAMPING_DOWN if over else HOLDING
        if over:
            self._given_up = f"{reason}; the clock stands still" if stands_still else reason

    @property
    def latched(self):
        """Whether the robot has been given up, and not even a valid state puts the law in force."""
        return self.phase == RAMPING_DOWN and not (self._resumes or self._released)

    def wait(self):
        """Note a valid state while the robot is given up."""
        self._ready = True
        self.reason = f"states are valid again; choose a mode to go on. The robot was given up: {self._given_up}"

    def release(self):
        """Have the next valid state put the law in force, where the robot was given up.

        Raises
        ------
        InputError
            There is no valid state yet.
        """
        if not self.latched:
            return
        if not self._ready:
            raise InputError(f"the robot was given up, and there is no valid state yet: {self.reason}.")
        self._released = True
