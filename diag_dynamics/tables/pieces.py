# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all readers of tables do with the columns that they have read."""

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.tables.columns import Columns
from diag_dynamics.tables.times import unit_in_doubt

ROWS = 50_000
"""About as many rows are in a piece."""

NO_TIME = "no time, or one that is no number"

LEFT_OUT = "rows left out"


def piece(choice, time, stamp, rows, of, losses, where):
    """One piece of a table, without the rows that have no time.

    Parameters
    ----------
    choice : Choice
    time, stamp, rows : (n,) array
    of : callable
        Numbers of a column by its index: (n,) float64, or (n, k) of a whole array.
    losses : Losses
    where : callable
        Where in the file the k-th row is, as text.

    Returns
    -------
    Columns
    """
    values = [_gathered(one, len(rows), of) for one in (choice.position, choice.velocity, choice.effort)]
    known = ~np.isnan(time)
    if not known.all():
        losses.add(NO_TIME, where(int(np.argmin(known))), LEFT_OUT, int(len(known) - known.sum()))
        time, stamp, rows = time[known], stamp[known], rows[known]
        values = [one if one is None else one[known] for one in values]
    return Columns(time, stamp, *values, rows)


def _gathered(quantity, count, of):
    """Values of a quantity in SI units, a column for each joint; None of none."""
    if quantity is None:
        return None
    if quantity.whole is not None:
        return of(quantity.whole) * quantity.scale
    values = np.full((count, len(quantity.columns)), np.nan)
    for joint, column in enumerate(quantity.columns):
        if column is not None:
            values[:, joint] = of(column) * quantity.scale[joint]
    return values


def refuse_doubtful(choice, time, path):
    """Refuse times of the first piece that cannot be seconds if nothing says what they are."""
    unit = unit_in_doubt(time) if choice.time_in_doubt else None
    if unit:
        raise InputError(
            f"'{path}': times are about {np.nanmedian(time):.6g}, which in seconds is no time: say what they are by "
            f"`scale: {{time: {unit}}}` in the map of columns."
        )
