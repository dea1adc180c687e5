"""The largest of each quantity over a recording, and when it was."""

import numpy as np


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

    def take(self, quantity, values, stamps, names=None):
        """Take in values, shape (T,) or (T, number of names); NaN counts for nothing."""
        if not len(values) or np.isnan(values).all():
            return
        if names is not None:
            each = np.fmax.reduce(values, axis=0)
            before = self.of_each.get(quantity)
            self.of_each[quantity] = each if before is None else np.fmax(before, each)
        at = np.unravel_index(np.nanargmax(values), values.shape)
        if quantity not in self.largest or values[at] > self.largest[quantity][0]:
            whose = None if names is None else names[at[1]]
            self.largest[quantity] = float(values[at]), int(stamps[at[0]]), whose
