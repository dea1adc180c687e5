# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of several sources in the order of their log time, with no more of them in memory than overlap in time."""

import heapq
from typing import NamedTuple

import numpy as np

from diag_dynamics.bags.messages import Messages

_LAST = np.iinfo(np.int64).max


class Source(NamedTuple):
    """Messages that are in order among themselves: a chunk of a file, or a file."""

    start: int
    """None of them has an earlier log time [ns]."""
    pieces: object
    """Function without arguments; gives an iterator of Messages."""


class _Open:
    """A source of which there is something in memory."""

    def __init__(self, place, pieces):
        self.place, self._pieces, self._held, self._next = place, pieces, [], None
        self._look()

    def _look(self):
        self._next = next((piece for piece in self._pieces if len(piece.at)), None)

    def fetch(self):
        """Hold the next piece."""
        self._held.append(self._next)
        self._look()

    @property
    def has_more(self):
        """Whether there are messages that are not held yet."""
        return self._next is not None

    @property
    def until(self):
        """Log time of the first message that is not held."""
        return int(self._next.log_time[0]) if self.has_more else _LAST

    @property
    def empty(self):
        """Whether nothing is held, and nothing will be."""
        return not self._held and not self.has_more

    def take(self, before):
        """Messages that are held, of a log time before `before`, which are held no longer: a list of Messages."""
        taken = []
        while self._held:
            piece = self._held[0]
            end = len(piece.at) if before == _LAST else int(np.searchsorted(piece.log_time, before))
            if end == len(piece.at):
                taken.append(self._held.pop(0))
                continue
            if end:
                taken.append(part_of(piece, 0, end))
                self._held[0] = part_of(piece, end, len(piece.at))
            break
        return taken


def part_of(piece, begin, end):
    """Messages `begin` to `end` of some."""
    return Messages(piece.data, *(column[begin:end] for column in piece[1:]))


def in_order(sources, late=None):
    """Hand out the messages of all sources in the order of their log time.

    Those of the same time are in the order of the sources. One that is wholly before all others is handed out as it is,
    without a copy.

    Parameters
    ----------
    sources : sequence of Source
    late : callable, optional
        Called with the place of a source in the sequence whose messages begin before its `start`, when later ones of others
        have been handed out already.

    Yields
    ------
    Messages
    """
    waiting = [(source.start, place) for place, source in enumerate(sources)]
    heapq.heapify(waiting)
    active, done = [], -_LAST
    while waiting or active:
        behind = min((source for source in active if source.has_more), key=lambda source: source.until, default=None)
        if waiting and (behind is None or waiting[0][0] <= behind.until):
            _, place = heapq.heappop(waiting)
            active.append(_Open(place, iter(sources[place].pieces())))
        elif behind is not None:
            behind.fetch()
        until = min([source.until for source in active] + [start for start, _ in waiting[:1]])
        active.sort(key=lambda source: source.place)
        taken = []
        for source in active:
            pieces = source.take(until)
            if late and pieces and pieces[0].log_time[0] < done:
                late(source.place)
            taken += pieces
        active = [source for source in active if not source.empty]
        if taken:
            piece = merged(taken)
            done = max(done, int(piece.log_time[-1]))
            yield piece


def merged(pieces):
    """One Messages of several, in the order of their log time; a copy if there is more than one."""
    if len(pieces) == 1:
        return pieces[0]
    data, at, begin = [], [], 0
    for piece in pieces:
        first, last = int(piece.at.min()), int((piece.at + piece.size).max())
        data.append(piece.data[first:last])
        at.append(piece.at + (begin - first))
        begin += last - first
    log_time = np.concatenate([piece.log_time for piece in pieces])
    order = np.argsort(log_time, kind="stable")
    connection, size = (np.concatenate([piece[k] for piece in pieces]) for k in (1, 3))
    return Messages(np.concatenate(data), connection[order], np.concatenate(at)[order], size[order], log_time[order])
