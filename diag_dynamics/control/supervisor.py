# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Phases of the control loop, and the timeout of a hold."""

import time

from diag_dynamics.text import distinct

INACTIVE, ACTIVE, HOLDING, RAMPING_DOWN = range(4)
"""Phases as ControllerStatus reports them."""

MIN_STANDSTILL = 1.0
"""Minimum time of the machine for which the clock stands still before a hold ends [s]."""


class Supervisor:
    """Phase of a control loop by validity and age of the robot's states.

    Without a valid state the loop holds the last gravity torque for at most `hold_time` [s], and
    then ramps the efforts down to zero. The next valid state starts the loop again.

    `max_age` is the maximum difference of a state's stamp and the clock [s], in both directions.
    `machine_time` returns a monotonic time [s], which ends a hold if the clock stands still, and
    which passes then: `still` is how much of it did since the last event [s].
    `starting` is whether the loop has started, and the efforts have not reached gravity
    compensation. `reason` is why the law is not in force, and `cause` that of the last ramp until a
    mode is chosen.
    """

    def __init__(self, max_age, hold_time, machine_time=time.monotonic):
        self.max_age = max_age
        self.hold_time = hold_time
        self._machine_time = machine_time
        self.forget()

    def forget(self):
        """Wait for the first valid state."""
        self.phase = INACTIVE
        self.starting = False
        self.reason = "no valid state yet"
        self.cause = ""
        self._outage = 0  # time without valid states, less that of later valid ones [ns]
        self._last = 0  # clock at the last event [ns]
        self._machine = 0.0  # machine time then [s]
        self._standstill = 0.0  # machine time since the clock moved [s]
        self.still = 0.0

    @property
    def will_start(self):
        """Whether the next valid state starts the loop. Earlier targets are then void."""
        return self.phase in (INACTIVE, RAMPING_DOWN)

    def age_problem(self, stamp, now):
        """Return the error of the age of a state; None if it is valid.

        Both times are in nanoseconds.
        """
        age = (now - stamp) * 1e-9
        if abs(age) <= self.max_age:
            return None
        if not now:
            return "use_sim_time, but nothing on /clock yet"
        where = "in the future" if age < 0.0 else "too old"
        age, limit = distinct(abs(age), self.max_age)
        return f"the state is {where}: {age} s; expected at most max_state_age = {limit} s"

    def valid(self, now, carried=True):
        """Accept a valid state at a time [ns].

        `carried` is whether efforts have reached gravity compensation.

        Valid states shorten an outage by no more than the time that they cover: else single states
        of a failing connection would prolong the hold without end.
        """
        if self.will_start:
            self._outage = 0
        elif self.phase == ACTIVE:
            self._outage = max(self._outage - max(now - self._last, 0), 0)
        self.starting = not carried and (self.starting or self.will_start)
        self.phase = ACTIVE
        self.reason = ""
        self._last = now

    def stand_by(self, now, reason):
        """Accept a valid state while the robot does not execute the commands; start again then."""
        self.phase = HOLDING
        self.starting = True
        self.reason = reason
        self._outage = 0
        self._last = now
        self._machine = self._machine_time()
        self._standstill = 0.0

    def invalid(self, now, reason):
        """Record the reason why no state is valid at a time [ns]; end a hold after its timeout."""
        self.reason = reason
        if self.phase == INACTIVE:
            return
        machine = self._machine_time()
        elapsed = now - self._last
        if self.phase == ACTIVE:  # the last state was valid for max_age at most
            self._outage = max(self._outage - min(max(elapsed, 0), round(self.max_age * 1e9)), 0)
        else:  # a clock that goes back does not shorten the outage
            self._outage += max(elapsed, 0)
        passed = machine - self._machine
        moves = elapsed or self.phase == ACTIVE
        self._standstill = 0.0 if moves else self._standstill + passed
        stands_still = self._standstill > max(self.hold_time, MIN_STANDSTILL)
        self.still = passed if stands_still else 0.0
        self._last = now
        self._machine = machine
        if self.phase == RAMPING_DOWN:
            return
        self.phase = HOLDING
        if stands_still or self._outage * 1e-9 >= self.hold_time:
            self.phase = RAMPING_DOWN
            self.starting = False
            self.cause = f"{reason}; the clock stands still" if stands_still else reason
