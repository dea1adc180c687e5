# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The lines of the table: what is measured, against what, and the target it has."""

from typing import NamedTuple

import numpy as np
from timing import Ratio


class Row(NamedTuple):
    """One line: ratios by what they were measured on, and a target for all of them or for each, or none."""

    subject: str
    peer: str
    over: str
    target: float | dict[str, float] | None
    ratios: dict[str, Ratio]

    def limit(self, name):
        """Return the target of one of the ratios, or None."""
        return self.target[name] if isinstance(self.target, dict) else self.target

    @property
    def worst(self):
        """What has the largest ratio to its target."""
        return max(
            self.ratios, key=lambda name: self.ratios[name].median / (self.limit(name) or 1.0)
        )

    @property
    def met(self):
        """Whether all of them are within their targets."""
        return self.ratios[self.worst].median <= self.limit(self.worst)


class Measured(NamedTuple):
    """All that a run has found. Times are arrays of seconds, an entry for each round."""

    agreement: tuple[float, str]  # largest relative error of any output, and where
    single: dict[str, dict[str, np.ndarray]]  # times by robot and call
    dof: dict[str, int]
    growth: dict[tuple[str, str, int], np.ndarray]  # times by kind, method and size
    slopes: dict[tuple[str, str], Ratio]  # exponents by kind and method
    throughput: dict[tuple[str, int], np.ndarray]  # states per second by library and threads
    batch_sizes: tuple[int, ...]
    batch_robot: str
    other_work: float  # processors that others kept busy meanwhile
    rows: list[Row]
    others: list[Row]  # those of the rows that have no table of their own
