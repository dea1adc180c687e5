"""The largest of each quantity over a recording, and when it was."""

import numpy as np

from diag_dynamics.recordings.kernels import prepare
from diag_dynamics.recordings.kernels.peaks import find_largest


class Peaks:
    """Largest values of columns, piece by piece.

    Attributes
    ----------
    largest : dict of tuple
        By quantity: its largest value, the stamp then [ns], and, of a quantity with an entry for each degree of freedom or
        link, whose it is.
    of_each : dict of ndarray
        Largest of each entry, by quantity.
    """

    def __init__(self):
        self.largest, self.of_each = {}, {}
        prepare(find_largest)

    def take(self, quantity, values, stamps, names=None, *, absolute=False):
        """Take in values, or their magnitudes, shape (T,) or (T, number of names); NaN counts for nothing."""
        matrix = np.ascontiguousarray(values.reshape(len(stamps), -1))
        each, at = np.empty((2, matrix.shape[1]))
        find_largest(matrix, absolute, each, at)
        k = int(np.argmax(each)) if len(each) else -1
        if k < 0 or each[k] == -np.inf:
            return
        if names is not None:
            before = self.of_each.get(quantity)
            self.of_each[quantity] = each if before is None else np.maximum(before, each)
        if quantity not in self.largest or each[k] > self.largest[quantity][0]:
            whose = None if names is None else names[k]
            self.largest[quantity] = float(each[k]), int(stamps[int(at[k])]), whose
