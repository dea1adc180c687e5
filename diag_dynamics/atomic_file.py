# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A file under a temporary name until it is complete."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import chain, count
from pathlib import Path

from diag_dynamics.exceptions import InputError


class AtomicFile:
    """A file `name` beside `path` until :meth:`commit`; devices and pipes are written directly."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(os.path.expanduser(os.fspath(path)))
        self._target = Path(os.path.realpath(self.path)) if self.path.is_symlink() else self.path
        self._is_direct = self.path.exists() and not self.path.is_file()
        self.name = str(self.path)
        if not self._is_direct and not self._target.parent.is_dir():
            raise InputError(
                f"'{self.path}' cannot be written: there is no folder '{self._target.parent}'."
            )
        if self.path.is_dir():
            raise InputError(f"'{self.path}' cannot be written: it is a folder.")
        # A pipe is not opened: its reader would take the closing for the end.
        numbers = () if self._is_direct else chain([""], (f".{k}" for k in count(1)))
        for number in numbers:
            self.name = f"{self._target}{number}.part"
            with self.errors(), suppress(FileExistsError):  # of another process
                open(self.name, "xb").close()
                break

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Raise errors of writing as InputError with the path, but a broken pipe as it is."""
        try:
            yield
        except BrokenPipeError:
            raise
        except OSError as error:
            raise InputError(
                f"'{self.path}' cannot be written: {error.strerror or error}."
            ) from error

    def commit(self) -> None:
        """Give the file its final name and the mode of the file that it replaces."""
        if self._is_direct:
            return
        with self.errors():
            _synchronize(self.name)
            with suppress(FileNotFoundError):
                shutil.copymode(self._target, self.name)
            os.replace(self.name, self._target)
        with suppress(OSError):  # some file systems have no such call for folders
            _synchronize(self._target.parent)

    def write_text(self, text: str) -> None:
        """Write the whole file and give it its final name."""
        with self.errors():
            Path(self.name).write_text(text, encoding="utf-8", errors="backslashreplace")
        self.commit()

    def discard(self) -> None:
        """Delete the temporary file."""
        if not self._is_direct:
            with suppress(OSError):
                os.remove(self.name)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file, or leave the old one and raise InputError."""
    file = AtomicFile(path)
    try:
        file.write_text(text)
    except BaseException:
        file.discard()
        raise


def _synchronize(path: str | os.PathLike[str]) -> None:
    """Wait until a file or folder is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
