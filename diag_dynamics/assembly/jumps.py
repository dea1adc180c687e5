# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Jumps of positions that no motion explains: a row of garbage, a re-zeroed encoder, a simulator that was reset."""

import numpy as np

from diag_dynamics.assembly.rejected import RejectedError

STATES = 3
"""Messages in a row that agree on a new place before it is believed. The last of them is accepted."""

SHORTEST, LONGEST, LONGEST_WITHOUT_LIMIT = 0.01, 0.5, 0.05
"""Time between two states [s]: the shortest that counts, as stamps jitter and clocks tick; the longest over which a step is
judged, with a velocity limit and without. Over a longer one the two velocities do not bound the way in between."""


class Jumps:
    """Judges the steps of positions by the velocities at both ends.

    A joint may move by twice the larger of both velocities times the time between them, or at its velocity limit, whatever
    the velocities are, and by a slack besides. A joint of unknown velocity may move at the highest velocity that is accepted.

    Parameters
    ----------
    names : sequence of str
        The joints.
    turns : array_like of bool, shape (n,)
        Joints whose position is an angle that turns round: a step of it is the shorter way.
    velocity_limit : array_like, shape (n,), optional
        [rad/s, m/s]; infinite or 0 where there is none.

    Attributes
    ----------
    slack : float
        [rad, m]; 0: nothing is judged.
    turns, reach, lasting : ndarray
        1 for joints that turn round; their velocity limits, 0 for none [rad/s, m/s]; and up to when steps are judged [s].
    last : str
        The last one that was believed.
    """

    def __init__(self, names, turns, velocity_limit=None):
        self._names, count = names, len(names)
        self.turns = np.array(turns, dtype=float)
        limit = np.zeros(count) if velocity_limit is None else np.asarray(velocity_limit, dtype=float)
        self.reach = np.where(np.isfinite(limit), limit, 0.0)
        self.lasting = np.where(self.reach > 0.0, LONGEST, LONGEST_WITHOUT_LIMIT)
        self.slack, self.last = 0.0, ""
        self._position, self._velocity = np.zeros((2, count))
        self._stamp, self._since, self._count = np.zeros((3, count), dtype=np.int64)

    def forget(self):
        """Know of no refusal any more."""
        self._count[:] = 0

    def memory(self, stamps):
        """What later judgements depend on: refusals that still count, after those last stamps of the joints [ns]."""
        alive = (self._count > 0) & (self._since == stamps)
        known = self._count, self._since, self._stamp, self._position, self._velocity
        return [alive, *(values[alive] for values in known)]

    def judge(self, here, position, velocity, fastest, stamp, before):
        """Refuse a message in which a joint is where it cannot have got to.

        Parameters
        ----------
        here : ndarray of int, shape (k,)
            The joints of the message.
        position, velocity, fastest : ndarray, shape (k,)
            Theirs, and what velocities may be [rad/s, m/s]; a velocity that is NaN is not known.
        stamp : int
            Stamp of the message [ns].
        before : tuple
            Positions, velocities and stamps of the same joints in the last message that was taken in, and whether they are
            known, by the same clock.

        Returns
        -------
        ndarray of int
            Joints that have been elsewhere for :data:`STATES` messages and are believed now.

        Raises
        ------
        RejectedError
            Names the joint, the step and what explains how much of it.
        """
        last_position, last_velocity, last_stamp, known = before
        far, most = self._farther(here, position, velocity, fastest, stamp, last_position, last_velocity, last_stamp)
        far &= known
        if not far.any():
            return here[:0]
        at, q, qd = here[far], position[far], velocity[far]
        elsewhere, _ = self._farther(
            at, q, qd, fastest[far], stamp, self._position[at], self._velocity[at], self._stamp[at]
        )
        again = (self._count[at] > 0) & (self._since[at] == last_stamp[far]) & ~elsewhere
        self._count[at] = np.where(again, self._count[at] + 1, 1)
        self._position[at], self._velocity[at], self._stamp[at], self._since[at] = q, qd, stamp, last_stamp[far]
        k = int(np.argmax(far))
        step = f"joint '{self._names[here[k]]}': position went from {last_position[k]:.9g} to {position[k]:.9g}"
        if (self._count[at] >= STATES).all():
            self._count[at], self.last = 0, step
            return at
        raise RejectedError(
            "jump",
            f"{step} in {(stamp - last_stamp[k]) * 1e-9:g} s, expected a step of no more than {most[k]:g} at velocities of "
            f"{last_velocity[k]:g} and {velocity[k]:g} (absurd.jump)",
        )

    def _farther(self, here, position, velocity, fastest, stamp, last_position, last_velocity, last_stamp):
        """Which steps are larger than the velocities explain, and the largest steps that they do explain.

        wire/joint_states.py has the same sum, compiled.
        """
        elapsed = (stamp - last_stamp) * 1e-9
        with np.errstate(over="ignore", invalid="ignore"):
            speed = np.maximum(2.0 * np.fmax(np.abs(velocity), np.abs(last_velocity)), self.reach[here])
            most = np.where(np.isnan(velocity), fastest, speed) * np.maximum(elapsed, SHORTEST) + self.slack
            step = np.abs(position - last_position)
            turned = step % (2.0 * np.pi)
            step = np.where(self.turns[here] > 0.0, np.minimum(turned, 2.0 * np.pi - turned), step)
            return (step > most) & (elapsed <= self.lasting[here]), most
