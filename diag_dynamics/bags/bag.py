# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all readers of bags have in common."""

from collections.abc import Iterable
from contextlib import contextmanager
from pathlib import Path

from diag_dynamics.bags.messages import Unread
from diag_dynamics.exceptions import InputError


class Bag:
    """Messages of a file or a folder, of which whatever can be read is handed out, and the rest is named.

    Nothing that a file holds raises an exception, but what a format or a compression needs may not be installed.

    Parameters
    ----------
    path : path
    name : str, optional
        What it is called, where it is not `path`.

    Attributes
    ----------
    connections : list of Connection
    unread : list of Unread
        What could not be read. It is complete after the last piece.
    findings : list of str
        What else is odd; nothing is lost by it.
    begin, end : int or None
        See :meth:`limit`.
    misplaced : bool
        Whether there were messages where the file has none of their time: who reads between limits may have missed some.

    Raises
    ------
    InputError
        It cannot be opened, or a package is needed and not installed.
    """

    misplaced = False

    def __init__(self, path, name=None):
        self.path, self.name = Path(path), str(path) if name is None else name
        self.connections, self.unread, self.findings = [], [], []
        self._kept = self.begin = self.end = None

    def limit(self, begin=None, end=None):
        """Say that messages before a log time, or from another one on [ns], are not wanted: those may be left out."""
        self.begin, self.end = begin, end

    def starts(self, wanted):
        """Log times [ns] where reading can begin, in their order; empty where all before has to be read for that."""
        return []

    def keep(self, folder):
        """Have a temporary folder, which the file is in, live as long as this."""
        self._kept = folder

    def lose(self, where, what):
        """Say what could not be read, once; pieces may be asked for again."""
        lost = Unread(self.name, where, what)
        if lost not in self.unread:
            self.unread.append(lost)

    def find(self, what):
        """Say what else is odd, once."""
        finding = f"'{self.name}'{what}"
        if finding not in self.findings:
            self.findings.append(finding)

    def chosen(self, wanted: Iterable | None):
        """Indices of the connections that are wanted, as a set; None is all.

        Raises
        ------
        InputError
            There is no such connection.
        """
        chosen = set(range(len(self.connections))) if wanted is None else {int(k) for k in wanted}
        for k in chosen:
            if not 0 <= k < len(self.connections):
                raise InputError(f"connection {k} is wanted of '{self.name}', which has {len(self.connections)}.")
        return chosen

    @contextmanager
    def opened(self):
        """Open the file for reading, without a buffer."""
        try:
            file = open(self.path, "rb", buffering=0)  # noqa: SIM115 (its errors are told from those of whoever uses it)
        except OSError as error:
            raise InputError(f"'{self.name}' cannot be read: {error.strerror}.") from error
        with file:
            yield file
