# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A long recording in pieces that are analysed apart, and put together to what one piece would be."""

from copy import deepcopy
from itertools import pairwise

from diag_dynamics.assembly.stamps import SECOND

DECAYS = 36.0
"""Time constants of the observer after which nothing is left of how it began, in double precision."""

REST = 1.0
"""What of the time to settle is for everything else [s]: windows, gaps, late stamps."""

WHOLE = None, None
"""The only piece of a recording."""


def settling_time(settings, gain):
    """Time before a seam from which on a piece is read [ns].

    Parameters
    ----------
    settings : Settings
    gain : float
        Of the observer [1/s], where the settings have none.
    """
    values = settings.values
    gain = settings.observation.gain if settings.observation else gain
    times = DECAYS / gain, 2.0 * values["frozen_timeout"], values["joint_timeout"], REST
    return round(SECOND * (sum(times) + values["external_torque.max_gap"]))


def seams(reading, length):
    """Begin and end of pieces of a recording of about a length [s]: a list of tuples of log times [ns].

    They are where chunks of the file begin, so that few chunks are read twice, and no piece is empty however far apart the
    times in a file are. A recording without an index is one piece.
    """
    found, starts = [], reading.starts()
    last = starts[0] if starts else 0
    for start in starts:
        if start - last >= length * SECOND:
            found.append(start)
            last = start
    return spans(found)


def spans(cuts):
    """Begin and end of each piece between cuts [ns]: None at the ends of the recording."""
    return list(pairwise([None, *cuts, None]))


def repaired(pieces, outcomes):
    """Pieces to be analysed instead of these, where a piece did not begin as the one before ended.

    Parameters
    ----------
    pieces : list of tuple
        As of :func:`spans`.
    outcomes : list of Outcome

    Returns
    -------
    list of tuple
        The same, where all is well; else those on both sides of a seam are one. All are one where messages are not where the
        file says that those of their time are.
    """
    if any(outcome.account.misplaced for outcome in outcomes):
        return [WHOLE]
    found = [pieces[0]]
    for k in range(1, len(pieces)):
        if outcomes[k - 1].is_followed_by(outcomes[k]):
            found.append(pieces[k])
        else:
            found[-1] = found[-1][0], pieces[k][1]
    return found


def together(outcomes):
    """One Outcome of those of all pieces, which stay as they are."""
    whole = deepcopy(outcomes[0])
    for other in outcomes[1:]:
        whole.add(other)
    return whole
