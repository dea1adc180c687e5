# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joint states of a recording as bytes: runs of plainly good ones are taken in by one call."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.compiled.kernel import COUNT, entry_kernel, ready
from diag_dynamics.compiled.tables import Addresses, Table, array
from diag_dynamics.wire.joint_states import WITH_EFFORT, known_at, take

RUN = Table(
    "Run",
    data=array(np.uint8),  # bytes of all messages; these four as bags.messages.Messages has them
    at=array(int),
    size=array(int),
    now=array(int),
    lengths=array(int),  # of messages, and addresses, of each layout that is known
    layouts=array(int),
    by=array(int),  # of each message: the layout by which it was taken in, its stamp [ns], and the state it makes
    stamp=array(int),
    newest=array(int),
    oldest=array(int),
    with_effort=array(bool),
    position=array(float, 2),
    velocity=array(float, 2),
    effort=array(float, 2),
)
"""Messages, how they may be taken in, and the states that come of it."""


class Taken(NamedTuple):
    """States in columns, a row for each message; of those that made none, what is there means nothing."""

    newest: np.ndarray
    """[ns], int64, shape (n,); as RobotState has it, and the next four."""
    oldest: np.ndarray
    with_effort: np.ndarray
    position: np.ndarray
    """Shape (n, number of joints)."""
    velocity: np.ndarray
    effort: np.ndarray


class Run:
    """Takes in messages one after the other, as many at a time as are plainly good.

    Parameters
    ----------
    known : KnownJointStates
    messages : bags.messages.Messages
        Joint states, all of them; their log times are those of reception.
    width : int
        Number of joints.

    Attributes
    ----------
    taken : Taken
    """

    def __init__(self, known, messages, width):
        count = len(messages.at)
        self._known, self._now, self._layouts = known, messages.log_time, []
        self._by, self._stamp, newest, oldest = np.zeros((4, count), dtype=int)
        states = np.empty((3, count, width))
        self.taken = Taken(newest, oldest, np.zeros(count, dtype=bool), *states)
        nothing = np.zeros(0, dtype=int)
        self._addresses = Addresses(
            RUN,
            data=messages.data,
            at=messages.at,
            size=messages.size,
            now=messages.log_time,
            lengths=nothing,
            layouts=nothing,
            by=self._by,
            stamp=self._stamp,
            **self.taken._asdict(),
        )
        ready(_take_many)

    def take(self, first):
        """Take messages in from this one on; returns the first one that was left as it was. :meth:`note` has to follow."""
        known, mode, room, layouts = self._known.in_force()
        if not layouts:
            return first
        self._layouts = layouts
        self._addresses["lengths"] = np.array([length for length, _, _ in layouts])
        self._addresses["layouts"] = np.array([address for _, address, _ in layouts])
        return _take_many(known, self._addresses.at, mode, room, first)

    def note(self, first, end):
        """Take note of messages that :meth:`take` has taken in last, or of some of them, in their order."""
        if end == first:
            return
        sources = np.array([source for _, _, source in self._layouts])[self._by[first:end]]
        for source in np.unique(sources).tolist():  # each one's stamps are counted for themselves
            own = first + np.flatnonzero(sources == source)
            self._known.took(source, self._stamp[own], int(self._now[own[-1]]))

    def put(self, k, state):
        """Have the state of message k be this RobotState."""
        taken = self.taken
        taken.newest[k], taken.oldest[k], taken.with_effort[k] = state.newest, state.oldest, state.effort is not None
        taken.position[k], taken.velocity[k] = state.position, state.velocity
        taken.effort[k] = np.nan if state.effort is None else state.effort


_run_at = RUN.opened


@entry_kernel(*[COUNT] * 5, nogil=True)
def _take_many(known, run, mode, room, first):
    """Take messages in from `first` on, and return the first one that was left as it was; their number if none was."""
    own, of = known_at(known), _run_at(run)
    for k in range(first, len(of.at)):
        found = 0
        size, at = of.size[k], of.at[k]
        for n in range(len(of.lengths)):
            if of.lengths[n] != size or size > room or of.now[k] == 0:
                continue
            for i in range(size):
                own.room[i] = of.data[at + i]
            found, stamp = take(known, of.layouts[n], of.now[k], mode)
            if found != 0:
                of.by[k], of.stamp[k] = n, stamp
                break
        if found == 0:
            return k
        of.newest[k], of.oldest[k], of.with_effort[k] = own.stamps[0].newest, own.stamps[0].oldest, found == WITH_EFFORT
        for j in range(len(own.state_position)):
            of.position[k, j], of.velocity[k, j] = own.state_position[j], own.state_velocity[j]
            of.effort[k, j] = own.state_effort[j] if found == WITH_EFFORT else np.nan
    return len(of.at)
