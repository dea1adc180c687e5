# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What could not be read of a table: counted by cause, so that a damaged day takes no more memory than a damaged second."""

from typing import NamedTuple


class Unread(NamedTuple):
    """Part of a file that could not be read."""

    file: str
    where: str
    """Of the first of its kind: ``line 18`` of a text, from 1; ``row 17`` of anything else, from 0."""
    what: str
    """What is wrong, and how much is lost: ``no number of columns as in the header (5 instead of 22): 3 rows left out``."""


class Losses:
    """Counts of what is lost, by cause.

    Parameters
    ----------
    file : str

    Attributes
    ----------
    without_values : int
        Rows that have no value of any joint.
    """

    def __init__(self, file):
        self._file = file
        self._causes = {}
        self._overruled, self._choice, self.without_values = None, None, 0

    def add(self, cause, where, unit, count=1, example=""):
        """Count one kind of loss.

        Parameters
        ----------
        cause : str
            One of few: what differs from row to row is an example.
        where : str
            Kept of the first only, as is the example.
        unit : str
            What is counted: ``rows left out``.
        """
        first, example, before = self._causes.get((cause, unit), (where, example, 0))
        self._causes[cause, unit] = first, example, before + count

    def overrule(self, choice, where, names, count):
        """Count rows whose names of joints the map of columns overrules."""
        first, others, before = self._overruled or (where, names, 0)
        self._overruled, self._choice = (first, others, before + count), choice

    def notes(self):
        """What the map of columns has overruled: a list of str."""
        if not self._overruled:
            return []
        (where, names, count), choice = self._overruled, self._choice
        return [
            f"joints: the map of columns gives {', '.join(choice.joints)}; '{choice.overruled.pattern}' names "
            f"{', '.join(names)} in {where} and differs from the map in {count} rows. It is not used."
        ]

    def listed(self):
        """All of them as a list of :class:`Unread`, in the order in which they were met first."""
        return [
            Unread(
                self._file, where, f"{cause}{f' ({example})' if example else ''}{f': {count} {unit}' if unit else ''}"
            )
            for (cause, unit), (where, example, count) in self._causes.items()
        ]
