# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a reader of tables yields."""

from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

import pyarrow as pa

from diag_dynamics.arrays import Array
from diag_dynamics.recordings.tables.headers import Column

ROWS = 20_000  # about as many are in a piece
LEFT_OUT = "rows omitted"


@runtime_checkable
class Table(Protocol):
    """A file of rows: its columns, and blocks of cells. Readers of formats are Tables."""

    path: str
    unit: str  # what numbers of rows count: line or row
    columns: list[Column]
    texts: list[str]  # comments and metadata, which may name joints

    def blocks(
        self, numbers: list[int], texts: list[int], lose: Callable[..., None]
    ) -> Iterator[tuple[dict[int, pa.Array], Array]]:
        """Yield cells of columns of numbers, of times and names by column, and rows' numbers.

        `lose(cause, where, unit, count, example)` counts what cannot be read.
        """
