# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of positions that no motion explains: garbage, a re-zeroed encoder, a simulator's reset, a second source."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.rejected import RejectedError

INTERLEAVED = "interleaved sources"
"""Cause of rejections, and name of the count of other messages that contradict those of another source."""

STATES = 3
"""Messages in a row that agree on a new place before it is believed. The last of them is accepted."""

MIN_STEP_TIME, MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT = 0.01, 0.5, 0.05
"""Time between two states [s]: the shortest that counts, as stamps jitter and clocks tick; the longest over which a step is
judged, with a velocity limit and without. Over a longer one the two velocities do not bound the way in between."""

SOURCE_TIMEOUT = 0.5
"""Time [s] without a message of the source in force after which another source may take its place."""

CANDIDATE_TIMEOUT = 5.0
"""Time [s] after which a pose that comes again is no longer that of the source that sent it before."""

MARGIN = 1e-3
"""Largest distance [rad, m] between positions of one stamp that says nothing."""

STOP_FRACTION = 0.15
"""Fraction of the slack by which a robot may stop elsewhere than its velocities lead: some counts of a coarse encoder."""

NOTHING = np.zeros(0, dtype=int)


class Accepted(NamedTuple):
    """Verdict on the positions of a message: :meth:`Jumps.accept` stores what later verdicts depend on."""

    contradicts: bool = False
    """Whether a message of the same stamp had other positions."""
    here: np.ndarray = NOTHING
    """Joints whose candidate changes."""
    candidate: tuple = ()
    """Their position, velocity and stamp; stamp and position in force then; count in a row, and how often it returned."""
    moved: np.ndarray = NOTHING
    """Joints that are elsewhere without a motion."""
    step: str = ""


class Jumps:
    """Judge of the steps of positions by the velocities at both ends.

    A joint may move by twice the larger of both velocities times the time between them, or at its velocity limit, whatever
    the velocities are, and by a slack besides. A joint of unknown velocity may move at the highest velocity that is accepted.

    A message beyond that is rejected and stored as the candidate, apart from the state in force. The candidate takes the
    place of that state in two cases:

    * Three messages in a row agree with the candidate. The robot was moved, or its encoders were set.
    * The candidate came again between messages of the source in force: sources are interleaved. The candidate moves while
      the source in force rests, or that source has been silent for :data:`SOURCE_TIMEOUT`.

    A second source may rest within the slack of a moving robot. Where a robot in motion is at rest in the same pose to the
    bit again and again, and no motion explains that, that pose is the candidate's, too. Messages without a velocity say
    nothing on rest.

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
    contradiction : str
        Text on the last message without velocity that another source contradicts.
    """

    def __init__(self, names, turns, velocity_limit=None):
        self._names, count = names, len(names)
        self.turns = np.array(turns, dtype=float)
        limit = np.zeros(count) if velocity_limit is None else np.asarray(velocity_limit, dtype=float)
        self.reach = np.where(np.isfinite(limit), limit, 0.0)
        self.lasting = np.where(self.reach > 0.0, MAX_STEP_TIME, MAX_STEP_TIME_WITHOUT_LIMIT)
        self.slack, self.last = 0.0, ""
        self._position, self._velocity, self._since_position = np.zeros((3, count))
        self._stamp, self._since, self._count, self._returns = np.zeros((4, count), dtype=np.int64)
        self._bare, self.contradiction = {}, ""  # by first joint: position, stamp and stamp in force

    def forget(self):
        """Forget the candidate, and messages without velocity."""
        self._count[:] = self._returns[:] = 0
        self._bare.clear()

    @property
    def interleaved(self):
        """Whether a candidate has come again between messages of the source in force."""
        return bool((self._returns > 0).any())

    def _candidate(self):
        return (
            self._position,
            self._velocity,
            self._stamp,
            self._since,
            self._since_position,
            self._count,
            self._returns,
        )

    def _store(self, here, candidate):
        for values, new in zip(self._candidate(), candidate, strict=True):
            values[here] = new

    def judge(self, here, position, velocity, fastest, stamp, before):
        """Return the verdict on a message, or reject one in which a joint is where it cannot have got to.

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
        Accepted

        Raises
        ------
        RejectedError
            Names the joint, the step and what explains how much of it. The message is the candidate then.
        """
        last_position, last_velocity, last_stamp, known = before
        self._expire(stamp)
        far, most = self._farther(here, position, velocity, fastest, stamp, last_position, last_velocity, last_stamp)
        far &= known
        step = np.where(known, self._steps(here, position, last_position), 0.0)
        contradicts = bool((known & (stamp == last_stamp) & (step > MARGIN)).any())
        if not far.any() and not self.interleaved and not self._stops_elsewhere(velocity, stamp, step, before):
            return Accepted(contradicts)
        which, least = (far, 1) if far.any() else (known, 2)
        candidate, same = self._continued(here, position, velocity, fastest, stamp, before, which)
        interleaved = bool((candidate[-1][which] >= least).any())
        if not far.any():
            if not same.all() or not _rests(velocity) or not step.any():
                stops = not self.interleaved and self._stops_elsewhere(velocity, stamp, step, before)
                return Accepted(contradicts, here, candidate) if stops else Accepted(contradicts)
            if not interleaved:
                return Accepted(contradicts, here, candidate)
        silence = (stamp - int(last_stamp[which].max())) * 1e-9
        k = int(np.argmax(far if far.any() else step))
        text = f"joint '{self._names[here[k]]}': position went from {last_position[k]:.9g} to {position[k]:.9g}"
        returns = self._returns_of_displaced(velocity, before, far, candidate, same, interleaved, silence)
        if returns is not None:
            displaced = last_position, last_velocity, last_stamp, last_stamp, last_position, known.astype(int)
            return Accepted(False, here, (*displaced, np.where(known, returns, 0)), here[far], text)
        self._store(here, candidate)
        if interleaved:
            raise RejectedError(
                INTERLEAVED,
                f"{text}, {silence:g} s after another source's message: two sources publish this joint in turns",
            )
        raise RejectedError(
            "jump",
            f"{text} in {silence:g} s, expected a step of no more than {most[k]:g} at velocities of "
            f"{last_velocity[k]:g} and {velocity[k]:g} (absurd.jump)",
        )

    def _returns_of_displaced(self, velocity, before, far, candidate, same, interleaved, silence):
        """How often the state in force has returned as a candidate, if the candidate takes its place now; else None."""
        _, last_velocity, _, known = before
        which = far if far.any() else known
        if (candidate[-2][which] >= STATES).all() and (not interleaved or silence > SOURCE_TIMEOUT):
            return 0
        if far.any() and interleaved and _rests(last_velocity[known]) and self._moves(velocity, same):
            return np.maximum(candidate[-1], 1)
        return None

    def contradicts(self, here, position, stamp, before):
        """Whether a message without velocity is of another source than the state in force.

        It is where its stamp is that of the state in force, or where it comes again with the same positions to the bit after
        that source's next message. Nothing else depends on what is stored of it.
        """
        last_position, _, last_stamp, known = before
        first, newest = int(here.min()), int(np.where(known, last_stamp, -1).max())
        place, place_stamp, since = self._bare.pop(first, (position[:0], 0, 0))
        self._bare[first] = position, stamp, newest
        step = np.where(known, self._steps(here, position, last_position), 0.0)
        again = (
            np.array_equal(place, position) and since != newest and abs(stamp - place_stamp) <= CANDIDATE_TIMEOUT * 1e9
        )
        if not (again or stamp == newest) or not (step > MARGIN).any():
            return False
        name = self._names[here[int(np.argmax(step))]]
        self.contradiction = f"another source has other positions, most of joint '{name}': two sources publish in turns"
        return True

    def accept(self, accepted):
        """Store what a verdict changes."""
        if len(accepted.here):
            self._store(accepted.here, accepted.candidate)
        if len(accepted.moved):
            self.last = accepted.step
        if accepted.contradicts:
            self.contradiction = (
                "messages of one stamp have other positions: two sources publish in turns, or a slow clock"
            )

    def _expire(self, stamp):
        """Forget candidates that have not come for :data:`CANDIDATE_TIMEOUT`."""
        old = np.abs(stamp - self._stamp) > CANDIDATE_TIMEOUT * 1e9
        self._count[old] = self._returns[old] = 0

    def _continued(self, here, position, velocity, fastest, stamp, before, which):
        """Return the candidate that a message makes, and which of its positions are the candidate's to the bit."""
        last_position, _, last_stamp, is_last = before
        place, place_stamp, since = self._position[here], self._stamp[here], np.where(is_last, last_stamp, -1)
        _, most = self._farther(here, position, velocity, fastest, stamp, place, self._velocity[here], place_stamp)
        elsewhere = self._steps(here, position, place) > most
        known, same = self._count[here] > 0, position == place
        agrees = (known & ~elsewhere)[which].all()
        in_row = is_last & (self._since[here] == since) & (self._since_position[here] == last_position)
        recent = (stamp - place_stamp) * 1e-9 <= SOURCE_TIMEOUT
        count = np.where(agrees & in_row, self._count[here] + 1, 1)
        returned = agrees & ~in_row & recent
        returns = np.where(agrees & (in_row | recent), self._returns[here] + returned, 0)
        return (position, velocity, stamp, since, last_position, count, returns), known & same

    def _stops_elsewhere(self, velocity, stamp, step, before):
        """Whether a robot in motion is at rest at once where its velocities do not lead."""
        _, last_velocity, last_stamp, known = before
        if not known.all() or velocity.any() or _rests(last_velocity):  # NaN is no rest
            return False
        way = 2.0 * np.abs(np.nan_to_num(last_velocity)) * np.maximum(stamp - last_stamp, 0) * 1e-9
        return bool((step > way + STOP_FRACTION * self.slack).any())

    @staticmethod
    def _moves(velocity, same):
        """Whether a message is of a robot that moves: it has velocities, or goes on from the candidate where these lack."""
        return not same.all() and (not _rests(velocity) or bool(np.isnan(velocity).any()))

    def _steps(self, here, position, last_position):
        """Distances of positions [rad, m]."""
        with np.errstate(invalid="ignore", over="ignore"):
            step = np.abs(position - last_position)
            turned = step % (2.0 * np.pi)
        return np.where(self.turns[here] > 0.0, np.minimum(turned, 2.0 * np.pi - turned), step)

    def _farther(self, here, position, velocity, fastest, stamp, last_position, last_velocity, last_stamp):
        """Which steps are larger than the velocities explain, and the largest steps that they do explain.

        wire/joint_states.py has the same sum, compiled.
        """
        elapsed = (stamp - last_stamp) * 1e-9
        with np.errstate(over="ignore", invalid="ignore"):
            speed = np.maximum(2.0 * np.fmax(np.abs(velocity), np.abs(last_velocity)), self.reach[here])
            most = np.where(np.isnan(velocity), fastest, speed) * np.maximum(elapsed, MIN_STEP_TIME) + self.slack
            return (self._steps(here, position, last_position) > most) & (elapsed <= self.lasting[here]), most


def _rests(velocity):
    """Whether all velocities are 0 or missing."""
    return not (np.nan_to_num(velocity) != 0.0).any()
