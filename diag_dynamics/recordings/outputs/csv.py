"""CSV: the same columns as Parquet has."""

from importlib import import_module

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.outputs.columns import Columns
from diag_dynamics.recordings.outputs.part import Part


class CsvOutput:
    """Writes pieces into a CSV file; its header has names of columns and units: ``nu.joint1 [J^0.5]``.

    Parameters
    ----------
    path : str or Path
    reading : Reading
    friction : bool
        Whether evaluations have it.
    """

    def __init__(self, path, reading, friction=False):
        try:
            self._arrow, self._csv = import_module("pyarrow"), import_module("pyarrow.csv")
        except ImportError as error:
            raise InputError(
                "CSV is written by pyarrow, which is not installed: pip install 'diag_dynamics[recordings]'."
            ) from error
        self._reading, self._friction = reading, friction
        self._part, self._writer, self._columns = Part(path), None, None

    def write(self, piece):
        """Write a piece."""
        if self._writer is None:
            self._columns = Columns(self._reading.model, self._reading.offset, self._friction)
        names = [f"{name} [{unit}]" if unit else name for name, unit in self._columns.units.items()]
        arrays = [self._arrow.array(values, mask=_missing(values)) for values in self._columns.values(piece)]
        table = self._arrow.Table.from_arrays(arrays, names=names)
        if self._writer is None:
            self._writer = self._csv.CSVWriter(self._part.name, table.schema)
        self._writer.write_table(table)

    def close(self):
        """Have the file be whole; without a single state there is none."""
        if self._writer is None:
            raise InputError(f"'{self._part.path}' is not written: the recording has no states.")
        self._writer.close()
        self._part.keep()

    def drop(self):
        """Leave nothing behind."""
        if self._writer is not None:
            self._writer.close()
        self._part.drop()


def _missing(values):
    """What is not known, which is an empty field."""
    return np.isnan(values) if values.dtype.kind == "f" else None
