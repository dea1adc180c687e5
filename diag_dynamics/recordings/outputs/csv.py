# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""CSV: the same columns as Parquet has."""

from importlib import import_module

import numpy as np

from diag_dynamics.recordings.outputs.tables import TableOutput


class CsvOutput(TableOutput):
    """Writes pieces into a CSV file; its header has names of columns and units: ``nu.joint1 [J^0.5]``."""

    def table(self, units, values):
        """Table with units in the names; what is not known is an empty field."""
        names = [f"{name} [{unit}]" if unit else name for name, unit in units.items()]
        arrays = [self.arrow.array(column, mask=_missing(column)) for column in values]
        return self.arrow.Table.from_arrays(arrays, names=names)

    def opened(self, file, table):
        """Writer of text."""
        return import_module("pyarrow.csv").CSVWriter(file, table.schema)


def _missing(values):
    """Which of them are not known."""
    return np.isnan(values) if values.dtype.kind == "f" else None
