# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drives: they hold an effort command until it times out, then let go or brake."""

from collections import Counter

import numpy as np

from diag_dynamics.exceptions import InputError, RejectedError

ZERO, BRAKE = "zero", "brake"
"""Behaviour of drives without a command: no effort, or joints held by brakes."""

ROUNDING = 1e-9
"""Rounding error of a sum of steps [s]: a command that times out on a step must not last one longer."""

WAITING, DRIVEN, TIMED_OUT = "waiting for a command", "driven", "timed out"


class Drives:
    """Drives of all joints that take an effort each and hold it until the next one comes.

    Parameters
    ----------
    names : sequence of str
        Joints that have a drive, in the robot's order.
    joints : sequence of str
        The order of a command's entries; a joint that is not there has no effort of its own.
    timeout : float
        How long a command holds in simulated time [s]; 0: for ever.
    without : {"zero", "brake"}
        Behaviour before the first command, and after one has timed out.

    Attributes
    ----------
    counts : Counter
        Commands received, rejected by cause, and times that one has timed out.
    last_rejection : str

    Raises
    ------
    InputError
        `joints` names one twice, or one that has no drive.
    """

    def __init__(self, names, joints, timeout, without):
        joints = [name for name in joints if name] or list(names)
        place, seen = {name: k for k, name in enumerate(names)}, set()
        for name in joints:
            if name not in place:
                raise InputError(
                    f"parameter 'command_joints' names '{name}', which is no joint that can be driven; these are "
                    f"{', '.join(names)}."
                )
            if name in seen:
                raise InputError(f"parameter 'command_joints' names '{name}' twice.")
            seen.add(name)
        self._joints, self._at = tuple(joints), np.array([place[name] for name in joints], dtype=int)
        self.timeout, self.without = timeout, without
        self._effort = np.zeros(len(names))
        self.counts, self.last_rejection = Counter(), ""
        self.forget()

    def forget(self):
        """Have no command, as before the first one."""
        self._effort[:] = 0.0
        self._since, self._timed_out = None, False

    def command(self, data, time):
        """Take a command over at a simulated time [s]; one that is refused leaves the last one in force.

        Raises
        ------
        RejectedError
            It has another length, or an entry is not finite.
        """
        self.counts["commands received"] += 1
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

    def _rejected(self, cause, message):
        self.counts[f"commands rejected: {cause}"] += 1
        self.last_rejection = message
        return RejectedError(cause, message)

    def effort(self, time):
        """Commanded efforts at a simulated time [s], zero without a command; shape (number of drives,)."""
        late = self._since is not None and self.timeout and time - self._since >= self.timeout - ROUNDING
        if late and not self._timed_out:
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
