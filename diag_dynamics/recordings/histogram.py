# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How often a quantity was how large, in bins that are the same for all recordings."""

from collections import Counter

import numpy as np

DECADE = 10
"""Bins in a power of ten: bin k begins at 10^(k/10)."""

NOTHING = None
"""The bin of what is not above zero."""


class Histogram:
    """Counts of numbers in logarithmic bins.

    Attributes
    ----------
    counts : Counter
        By number of the bin, or :data:`NOTHING`.
    """

    def __init__(self, counts=()):
        self.counts = Counter(dict(counts))

    def take(self, values):
        """Count numbers."""
        positive = values[values > 0.0]
        bins, numbers = np.unique(np.floor(DECADE * np.log10(positive)).astype(int), return_counts=True)
        self.counts.update(dict(zip(bins.tolist(), numbers.tolist(), strict=True)))
        if len(positive) < len(values):
            self.counts[NOTHING] += len(values) - len(positive)

    def add(self, other):
        """Count what another one has counted."""
        self.counts.update(other.counts)

    def told(self):
        """Bins from the lowest: a list of dicts `from`, `to` (the bounds) and `states` (the count)."""
        bins = sorted(self.counts.items(), key=lambda one: (one[0] is not NOTHING, one[0] or 0))
        return [dict(zip(("from", "to"), _bounds(k), strict=True), states=number) for k, number in bins]

    @classmethod
    def of(cls, told):
        """That which :meth:`told` tells of."""
        counts = Counter()
        for one in told:
            k = round(DECADE * np.log10(one["from"])) if one["from"] > 0.0 else NOTHING
            counts[k] += one["states"]
        return cls(counts)


def _bounds(k):
    return (0.0, 0.0) if k is NOTHING else (float(10.0 ** (k / DECADE)), float(10.0 ** ((k + 1) / DECADE)))
