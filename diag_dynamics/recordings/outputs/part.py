"""A file under a temporary name: whoever meets the real one has it whole."""

import os
from contextlib import suppress
from pathlib import Path

from diag_dynamics.exceptions import InputError


class Part:
    """Path of a file that is being written, beside that which it will have.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    InputError
        Its folder is not there, or it is a folder.
    """

    def __init__(self, path):
        self.path = Path(os.path.expanduser(os.fspath(path)))
        if not self.path.parent.is_dir():
            raise InputError(f"'{self.path}' cannot be written: there is no folder '{self.path.parent}'.")
        if self.path.is_dir():
            raise InputError(f"'{self.path}' cannot be written: it is a folder.")
        self.name = f"{self.path}.part"

    def keep(self):
        """Give the file its name."""
        os.replace(self.name, self.path)

    def drop(self):
        """Delete what has been written."""
        with suppress(OSError):
            os.remove(self.name)
