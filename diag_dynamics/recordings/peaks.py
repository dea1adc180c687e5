# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The largest of each quantity over a recording, and when it was."""

import numpy as np

from diag_dynamics.recordings.kernels import prepare
from diag_dynamics.recordings.kernels.peaks import find_largest


class Peaks:
    """Largest values of columns, piece by piece."""

    def __init__(self):
        self._peaks = {}  # by quantity: largest value of each entry, its stamp [ns], and the entries' names
        prepare(find_largest)

    def take(self, quantity, values, stamps, names=None, *, absolute=False):
        """Take in values, or their magnitudes, shape (T,) or (T, number of names); NaN counts for nothing."""
        matrix = np.ascontiguousarray(values.reshape(len(stamps), -1))
        each, at = np.empty((2, matrix.shape[1]))
        find_largest(matrix, absolute, each, at)
        if each.max(initial=-np.inf) > -np.inf:
            self._keep(quantity, each, stamps[at.astype(int)], names)

    def add(self, other):
        """Take in what another one has, of later states."""
        for quantity, peak in other._peaks.items():
            self._keep(quantity, *peak)

    def _keep(self, quantity, each, at, names):
        if quantity in self._peaks:
            before, before_at, _ = self._peaks[quantity]
            larger = each > before
            each, at = np.where(larger, each, before), np.where(larger, at, before_at)
        self._peaks[quantity] = each, at, names

    @property
    def largest(self):
        """By quantity: its largest value, the first stamp at which it was [ns], and whose it is, of one with names."""
        found = {}
        for quantity, (each, at, names) in self._peaks.items():
            k = int(np.argmax(each))
            found[quantity] = float(each[k]), int(at[k]), None if names is None else names[k]
        return found

    @property
    def of_each(self):
        """Largest of each entry, by quantity with names."""
        return {quantity: each for quantity, (each, _, names) in self._peaks.items() if names is not None}
