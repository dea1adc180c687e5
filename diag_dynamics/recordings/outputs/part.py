# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A file under a temporary name: whoever meets the real one has it whole."""

import os
from contextlib import suppress
from pathlib import Path

from diag_dynamics.exceptions import InputError


class Part:
    """A file that is being written, beside the path that it will have.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    name : str
        Of the file for now: it is there, with nothing in it.

    Raises
    ------
    InputError
        It cannot be written: its folder is not there, or it is a folder, or neither may be changed.
    """

    def __init__(self, path):
        self.path = Path(os.path.expanduser(os.fspath(path)))
        if not self.path.parent.is_dir():
            raise InputError(f"'{self.path}' cannot be written: there is no folder '{self.path.parent}'.")
        if self.path.is_dir():
            raise InputError(f"'{self.path}' cannot be written: it is a folder.")
        self.name = f"{self.path}.part"
        try:
            open(self.name, "wb").close()
        except OSError as error:
            raise InputError(f"'{self.path}' cannot be written: {error.strerror or error}.") from error

    def keep(self):
        """Give the file its name."""
        os.replace(self.name, self.path)

    def drop(self):
        """Delete what has been written."""
        with suppress(OSError):
            os.remove(self.name)
