# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Seams between pieces of a recording that are analysed apart: what crosses them.

A piece begins some time before its seam, so that whatever it knows there is what the piece before knows at its end. That is
checked, by what both of them give as their `memory`: nested lists and dicts of numbers, arrays, texts and None. Gaps in
stamps are counted by runs of 32 messages, which begin where the recording does: a piece keeps the stamps instead, and they
are taken in when pieces are put together.
"""

from array import array

import numpy as np

from diag_dynamics.assembly.gaps import Gaps

PART = 1e-12
"""Part of numbers by which two memories may be apart: of what decays, the rest is smaller."""

_PAUSE = -1


def agree(one, other):
    """Whether two memories are the same: numbers that are no doubles, bit by bit."""
    if isinstance(one, dict):
        return isinstance(other, dict) and one.keys() == other.keys() and all(agree(one[k], other[k]) for k in one)
    if isinstance(one, list | tuple):
        return (
            isinstance(other, list | tuple)
            and len(one) == len(other)
            and all(agree(*pair) for pair in zip(one, other, strict=True))
        )
    if isinstance(one, np.ndarray) and one.dtype.kind == "f":
        if not isinstance(other, np.ndarray) or one.shape != other.shape:
            return False
        scale = max(1.0, float(np.max(np.abs(one), initial=0.0, where=np.isfinite(one))))
        return bool(np.isclose(one, other, rtol=PART, atol=PART * scale, equal_nan=True).all())
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and np.array_equal(one, other)
    return type(one) is type(other) and one == other


class LoggedGaps(Gaps):
    """Keeps what it takes in, and counts nothing: see :class:`Gaps`."""

    def __init__(self):
        super().__init__()
        self._sources, self._stamps = array("q"), array("q")

    def take(self, source, stamp):
        """Keep the stamp of a message [ns]."""
        self._sources.append(source)
        self._stamps.append(stamp)

    def take_many(self, source, stamps):
        """Keep the stamps of messages of one source [ns]."""
        self._sources.extend([source] * len(stamps))
        self._stamps.frombytes(np.ascontiguousarray(stamps, np.int64).tobytes())

    def pause(self):
        """Keep that all begins anew."""
        self._sources.append(_PAUSE)
        self._stamps.append(0)

    def replay(self, gaps):
        """Have other gaps take in what this has kept."""
        sources, stamps = (np.frombuffer(kept, np.int64) for kept in (self._sources, self._stamps))
        bounds = np.flatnonzero(
            np.diff(sources, prepend=sources[:1] - 1, append=0 if not len(sources) else sources[-1] - 1)
        )
        for first, end in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
            source = int(sources[first])
            if source == _PAUSE:
                gaps.pause()
            elif end - first == 1:
                gaps.take(source, int(stamps[first]))
            else:
                gaps.take_many(source, stamps[first:end])
