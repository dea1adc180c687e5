# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A file under a temporary name: whoever meets the real one has it whole."""

import os
from contextlib import suppress
from itertools import chain, count
from pathlib import Path

from diag_dynamics.exceptions import InputError


class Part:
    """A file that is being written, beside the path that it will have.

    Behind a link the file that it leads to is replaced, not the link. What is no file, such as /dev/null or a named pipe,
    is written itself: another file in its place would take it away from everybody.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    path : Path
        As it was given.
    name : str
        Of the file for now: it is there, with nothing in it.

    Raises
    ------
    InputError
        It cannot be written: its folder is not there, or it is a folder, or neither may be changed.
    """

    def __init__(self, path):
        self.path = Path(os.path.expanduser(os.fspath(path)))
        self._target = Path(os.path.realpath(self.path)) if self.path.is_symlink() else self.path
        self._is_direct = self.path.exists() and not self.path.is_file()
        if not self._is_direct and not self._target.parent.is_dir():
            raise InputError(f"'{self.path}' cannot be written: there is no folder '{self._target.parent}'.")
        if self.path.is_dir():
            raise InputError(f"'{self.path}' cannot be written: it is a folder.")
        if self._is_direct:  # not opened: whoever reads a pipe would take its closing for the end
            self.name = str(self.path)
            return
        for name in chain([f"{self._target}.part"], (f"{self._target}.{k}.part" for k in count(1))):
            try:
                open(name, "xb").close()
            except FileExistsError:  # somebody's, or of another process that writes the same
                continue
            except OSError as error:
                raise InputError(f"'{self.path}' cannot be written: {error.strerror or error}.") from error
            self.name = name
            return

    def keep(self):
        """Give the file its name."""
        if not self._is_direct:
            os.replace(self.name, self._target)

    def drop(self):
        """Delete what has been written."""
        if not self._is_direct:
            with suppress(OSError):
                os.remove(self.name)
