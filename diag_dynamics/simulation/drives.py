# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of a simulated robot: effort commands and external wrenches, held until a timeout in simulated time [s]."""

from collections import Counter

import numpy as np

from diag_dynamics.exceptions import InputError, RejectedError

ZERO, BRAKE = "zero", "brake"
"""Behaviour of drives without a command: no effort, or joints held by brakes."""

ROUNDING = 1e-9
"""Rounding error of a sum of steps [s]: a command that times out on a step must not last one longer."""

WAITING, DRIVEN, TIMED_OUT = "waiting for a command", "driven", "timed out"


class _Inputs:
    """Received values of one kind, each held for `timeout` [s of simulated time]; 0: until the next one.

    Attributes
    ----------
    counts : Counter
        Values received, rejected by cause, and timed out.
    last_rejection : str
    """

    def __init__(self, kind, timeout):
        self._kind, self.timeout = kind, timeout
        self.counts, self.last_rejection = Counter(), ""
        self.forget()

    def _receive(self):
        self.counts[f"{self._kind} received"] += 1

    def _is_expired(self, since, time):
        return bool(self.timeout) and time - since >= self.timeout - ROUNDING

    def _rejected(self, cause, message):
        self.counts[f"{self._kind} rejected: {cause}"] += 1
        self.last_rejection = message
        return RejectedError(cause, message)


class Drives(_Inputs):
    """Drives of all joints: each takes an effort. Attributes: those of its inputs.

    Parameters
    ----------
    names : sequence of str
        Joints that have a drive, in the robot's order.
    joints : sequence of str
        The order of a command's entries; a joint that is not there has no effort of its own.
    timeout : float
    without : {"zero", "brake"}
        Behaviour before the first command, and after one has timed out.

    Raises
    ------
    InputError
        `joints` names one twice, or one that has no drive.
    """

    def __init__(self, names, joints, timeout, without):
        joints = [name for name in joints if name] or list(names)
        for k, name in enumerate(joints):
            if name not in names:
                raise InputError(
                    f"parameter 'command_joints' names '{name}', which is no joint that can be driven; these are "
                    f"{', '.join(names)}."
                )
            if name in joints[:k]:
                raise InputError(f"parameter 'command_joints' names '{name}' twice.")
        self._joints, self._at = tuple(joints), np.array([list(names).index(name) for name in joints], dtype=int)
        self.without, self._effort = without, np.zeros(len(names))
        super().__init__("commands", timeout)

    def forget(self):
        """Drop the command: the phase is that before the first one."""
        self._effort[:] = 0.0
        self._since, self._timed_out = None, False

    def command(self, data, time):
        """Accept a command at a simulated time [s]. A rejected one leaves the last one in force.

        Raises
        ------
        RejectedError
            Wrong length, or an entry is not finite.
        """
        self._receive()
        if len(data) != len(self._joints):
            raise self._rejected(
                "wrong length",
                f"data has {len(data)} entries, expected {len(self._joints)}, for {', '.join(self._joints)}",
            )
        effort = np.array(data, dtype=float)
        wrong = np.flatnonzero(~np.isfinite(effort))
        if len(wrong):
            k = int(wrong[0])
            raise self._rejected(
                "not finite", f"effort of joint '{self._joints[k]}' is {effort[k]}, expected a finite number"
            )
        self._effort[self._at] = effort
        self._since, self._timed_out = time, False

    def effort(self, time):
        """Return the commanded efforts at a simulated time [s], zero without a command; shape (number of drives,)."""
        if self._since is not None and not self._timed_out and self._is_expired(self._since, time):
            self._timed_out = True
            self._effort[:] = 0.0
            self.counts["commands timed out"] += 1
        return self._effort

    @property
    def phase(self):
        """Waiting for a command, driven, or timed out."""
        if self._since is None:
            return WAITING
        return TIMED_OUT if self._timed_out else DRIVEN

    @property
    def braked(self):
        """Whether the brakes are closed."""
        return self.without == BRAKE and self.phase != DRIVEN


class Pushes(_Inputs):
    """External wrenches, each on one of the robot's `links`. Attributes: those of its inputs."""

    def __init__(self, links, timeout):
        self._links = frozenset(links)
        super().__init__("wrenches", timeout)

    def forget(self):
        """Drop all wrenches."""
        self._held = {}

    def push(self, link, wrench, time):
        """Accept a wrench on a link, force first, shape (6,), at a simulated time [s]; zeros end it.

        Raises
        ------
        RejectedError
            Unknown link, or a number is not finite. Nothing changes then.
        """
        self._receive()
        wrench = np.array(wrench, dtype=float)
        if link not in self._links:
            raise self._rejected("unknown link", f"header.frame_id '{link}' is no link of this robot")
        if not np.isfinite(wrench).all():
            raise self._rejected("not finite", f"wrench on '{link}' is {wrench.tolist()}, expected finite numbers")
        self._held.pop(link, None)
        if wrench.any():
            self._held[link] = wrench, time

    def at(self, time):
        """Return the wrenches by link at a simulated time [s], force first."""
        self._held = {link: held for link, held in self._held.items() if not self._is_expired(held[1], time)}
        return {link: wrench for link, (wrench, _) in self._held.items()}
