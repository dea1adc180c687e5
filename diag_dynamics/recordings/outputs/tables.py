# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What Parquet and CSV have in common: columns that pyarrow writes, piece by piece."""

import os
from contextlib import suppress
from importlib import import_module

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.atomic_file import AtomicFile
from diag_dynamics.recordings.outputs.columns import Columns


class TableOutput:
    """Writes pieces into a table: a column for each quantity and joint.

    Parameters
    ----------
    path : str or Path
    reading : Reading
    friction : bool
        Whether evaluations have it.

    Raises
    ------
    InputError
        pyarrow is not installed, or the file cannot be written.
    """

    def __init__(self, path, reading, friction=False):
        try:
            self.arrow = import_module("pyarrow")
        except ImportError as error:
            raise InputError(f"'{path}' is written by pyarrow, which is not installed: pip install pyarrow.") from error
        self.model = reading.model
        self._reading, self._friction = reading, friction
        self._columns = self._writer = self._file = None
        self._part = AtomicFile(path)

    def table(self, units, values):
        """The pyarrow Table of a piece: units by name of the column, and arrays of shape (T,)."""
        raise NotImplementedError

    def opened(self, file, table):
        """The writer into an open file, by its first table."""
        raise NotImplementedError

    def write(self, piece):
        """Write a piece."""
        if self._columns is None:
            self._columns = Columns(self.model, self._reading.offset, self._friction)
        table = self.table(self._columns.units, self._columns.values(piece))
        try:
            if self._writer is None:
                self._file = self.arrow.OSFile(os.fsencode(self._part.name), "w")  # bytes: a name may be no UTF-8
                self._writer = self.opened(self._file, table)
            self._writer.write_table(table)
        except BrokenPipeError:  # | head
            raise
        except OSError as error:  # "lseek failed", of Parquet into a pipe: pyarrow does not say where
            raise InputError(f"'{self._part.path}' cannot be written: {error}.") from error

    def close(self):
        """Have the file be whole; without a single state there is none."""
        if self._writer is None:
            raise InputError(f"'{self._part.path}' is not written: the recording has no states.")
        self._writer.close()
        self._file.close()
        self._part.commit()

    def drop(self):
        """Leave nothing behind."""
        if self._writer is not None:
            for one in (self._writer, self._file):
                with suppress(OSError):  # a full disk cannot take the rest, which is not wanted
                    one.close()
        self._part.discard()
