# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of a simulated robot: effort commands and external wrenches, held until a timeout [s].

A rejected input raises RejectedError and changes nothing. Sensors have noise.
"""

from collections import Counter

import numpy as np

from diag_dynamics.control.by_dof import command_order
from diag_dynamics.exceptions import InputError, RejectedError

ZERO, BRAKE = "zero", "brake"
"""Behaviour of drives without a command: no effort, or joints held by brakes."""

ROUNDING = 1e-9
"""Rounding error of a sum of steps [s], by which a command may last longer than its timeout."""

WAITING, DRIVEN, TIMED_OUT = "waiting for a command", "driven", "timed out"


class _Inputs:
    """Received values of one kind, each held for a timeout [s of simulated time].

    With a timeout of 0 a value is held until the next one.

    `counts` has how many were received, rejected by cause, and timed out; `last_rejection` is a
    text.
    """

    def __init__(self, kind, timeout):
        self._kind = kind
        self.timeout = timeout
        self.counts = Counter()
        self.last_rejection = ""
        self.forget()

    def _is_expired(self, since, time):
        return bool(self.timeout) and time - since >= self.timeout - ROUNDING

    def _rejected(self, cause, message):
        self.counts[f"{self._kind} rejected: {cause}"] += 1
        self.last_rejection = f"{cause}: {message}"
        return RejectedError(cause, message)


class Drives(_Inputs):
    """Drives of the joints `names`. `phase` is WAITING, DRIVEN or TIMED_OUT.

    `joints` is the order of a command's entries, by default `names`; the effort of other joints is
    zero. `without` is the behaviour before the first command and after a timeout.
    """

    def __init__(self, names, joints, timeout, without):
        self._joints, self._at = command_order(joints, names, complete=False)
        self._without = without
        self._effort = np.zeros(len(names))
        super().__init__("commands", timeout)

    def forget(self):
        """Drop the command, and wait for the next one."""
        self._effort[:] = 0.0
        self.phase = WAITING
        self._since = None

    def command(self, data, time):
        """Accept a command at a simulated time [s]."""
        self.counts["commands received"] += 1
        expected = len(self._joints)
        if len(data) != expected:
            message = (
                f"data has {len(data)} entries; expected {expected}, for {', '.join(self._joints)}"
            )
            raise self._rejected("wrong length", message)
        effort = np.array(data, dtype=float)
        if not np.isfinite(effort).all():
            k = int(np.argmin(np.isfinite(effort)))
            message = (
                f"effort of joint '{self._joints[k]}' is {effort[k]}; expected a finite number"
            )
            raise self._rejected("not finite", message)
        self._effort[self._at] = effort
        self.phase = DRIVEN
        self._since = time

    def effort(self, time):
        """Return the commanded efforts of the drives at a simulated time [s]; zero without one."""
        if self.phase == DRIVEN and self._is_expired(self._since, time):
            self.forget()
            self.phase = TIMED_OUT
            self.counts["commands timed out"] += 1
        return self._effort

    @property
    def braked(self):
        """Whether the brakes are closed."""
        return self._without == BRAKE and self.phase != DRIVEN


class Pushes(_Inputs):
    """External wrenches, each on one of the robot's `links`."""

    def __init__(self, links, timeout):
        self._links = frozenset(links)
        super().__init__("wrenches", timeout)

    def forget(self):
        """Drop all wrenches."""
        self._held = {}

    def push(self, link, wrench, time):
        """Accept a wrench on a link, force first, shape (6,), at a time [s]; zeros end it."""
        self.counts["wrenches received"] += 1
        wrench = np.array(wrench, dtype=float)
        if link not in self._links:
            raise self._rejected(
                "unknown link", f"header.frame_id '{link}' is no link of this robot"
            )
        if not np.isfinite(wrench).all():
            raise self._rejected(
                "not finite", f"wrench on '{link}' is {wrench.tolist()}; expected finite numbers"
            )
        self._held.pop(link, None)
        if wrench.any():
            self._held[link] = wrench, time

    def at(self, time):
        """Return the wrenches by link at a simulated time [s], force first."""
        self._held = {
            link: entry
            for link, entry in self._held.items()
            if not self._is_expired(entry[1], time)
        }
        return {link: wrench for link, (wrench, _) in self._held.items()}


# --- Sensors


class Sensors:
    """Sensors of all joints; the same states give the same errors.

    `noise` is the standard deviation of white noise on position [rad, m], velocity [rad/s, m/s]
    and effort [N m, N].
    """

    def __init__(self, noise):
        if len(noise) != 3 or min(noise) < 0.0:
            raise InputError(f"parameter 'sensor_noise' is {list(noise)}; expected 3 numbers >= 0.")
        self._noise = noise
        self.restart()

    def restart(self):
        """Restart the sequence of errors."""
        self._random = np.random.default_rng(0)

    def measure(self, position, velocity, effort):
        """Return three vectors with noise."""
        values = []
        for value, noise in zip((position, velocity, effort), self._noise, strict=True):
            if noise:
                value = value + noise * self._random.normal(size=len(value))
            values.append(value)
        return values
