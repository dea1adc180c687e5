# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all readers of tables do with the columns that they have read."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.tables.column_map import QUANTITIES
from diag_dynamics.tables.columns import Columns
from diag_dynamics.tables.csv_head import MISSING
from diag_dynamics.tables.names import names_in_rows
from diag_dynamics.tables.times import unit_in_doubt

ROWS = 50_000
"""About as many rows are in a piece."""

NO_TIME = "no time, or one that is no number"

NO_NAME = "values without the name of a joint"

OTHER_LENGTH = "list of another length than there are joints"

LEFT_OUT = "rows left out"


class Read(NamedTuple):
    """What a reader has of a piece of its table."""

    time: np.ndarray
    """[s], float64, shape (n,)."""
    stamp: np.ndarray
    """[ns], int64."""
    rows: np.ndarray
    """Rows of the file."""
    numbers: Callable
    """Numbers of a column by its index: (n,) float64, or (n, k) of a whole array."""
    texts: Callable
    """Texts of a column by its index, or lists of them."""
    blank: Callable
    """Whether cells of a column have nothing in them, by its index: (n,) bool. NaN is a value."""
    where: Callable
    """Place of the k-th row in the file, as text."""


def piece(choice, read, losses):
    """One piece of a table, without the rows that have no time or no value.

    Parameters
    ----------
    choice : Choice
    read : Read
    losses : Losses

    Returns
    -------
    Columns
    """
    count = len(read.rows)
    values, names = [_gathered(one, count, read.numbers) for one in choice.quantities()], None
    if choice.names:
        names = names_in_rows(choice.names, read.texts, count)
        values, names = _by_place(values, names, choice, read, losses)
    if choice.overruled:
        _compare(choice, read, losses)
    untimed, empty = np.isnan(read.time), _without_values(choice, values, names, read)
    if untimed.any():
        texts = [read.texts(k) for k in choice.time]
        lost = [k for k in np.flatnonzero(untimed) if not empty[k] or any(map(_is_said, (one[k] for one in texts)))]
        empty[lost] = False
        if lost:
            text = " and ".join(f"'{one[lost[0]][:40]}'" for one in texts if isinstance(one[lost[0]], str))
            losses.add(NO_TIME, read.where(lost[0]), LEFT_OUT, len(lost), text)
    kept = ~(untimed | empty)
    values = [one if one is None else one[kept] for one in values]
    names = None if names is None else names[kept]
    losses.without_values += int(empty.sum())
    return Columns(read.time[kept], read.stamp[kept], *values, read.rows[kept], names)


def _is_said(text):
    """Whether a text is more than a sign of no value."""
    return isinstance(text, str) and text.strip() not in MISSING


def _gathered(quantity, count, numbers):
    """Values of a quantity in SI units, a column for each joint; None of none."""
    if quantity is None:
        return None
    if quantity.whole is not None:
        values = numbers(quantity.whole)
        return values * (quantity.scale if values.shape[1] == len(quantity.scale) else _common(quantity.scale))
    values = np.full((count, len(quantity.columns)), np.nan)
    for joint, column in enumerate(quantity.columns):
        if column is not None:
            values[:, joint] = numbers(column) * quantity.scale[joint]
    return values


def _common(scale):
    """The scale of lists whose lengths differ."""
    if len(set(scale.tolist())) > 1:
        raise InputError(
            f"scale has {len(scale)} numbers; expected one number, or one by joint, for rows that name different joints."
        )
    return scale[0] if len(scale) else 1.0


def _without_values(choice, values, names, read):
    """Whether rows have neither a value nor the name of any joint, and no NaN in place of one: bool, shape (n,)."""
    empty = np.ones(len(read.rows), bool)
    for one in values:
        if one is not None:
            empty &= np.isnan(one).all(axis=1)
    if names is not None:
        empty &= (names == "").all(axis=1)
    columns = {k for one in choice.quantities() if one for k in (*one.columns, one.whole) if k is not None}
    for k in columns if empty.any() else ():
        empty &= read.blank(k)
    return empty


def _by_place(values, names, choice, read, losses):
    """Values and names of as many places, values in the scale of their joint; values without a name are lost."""
    width = max(names.shape[1], *(one.shape[1] for one in values if one is not None))
    names = _widened(names, width, "")
    unnamed, found = names == "", []
    for quantity, one in zip(QUANTITIES, values, strict=True):
        if one is None:
            found.append(None)
            continue
        one = _widened(one, width, np.nan)
        if quantity in choice.scale_of:
            one = one * _factors(choice.scale_of[quantity], names, quantity)
        odd = unnamed & ~np.isnan(one)
        if odd.any():
            k = int(np.argmax(odd.any(axis=1)))
            losses.add(NO_NAME, read.where(k), "values left out", int(odd.sum()), f"{quantity} {one[k][odd[k]][0]:g}")
            one = np.where(odd, np.nan, one)
        found.append(one)
    return found, names


def _widened(values, width, fill):
    """Columns behind the last one."""
    return np.pad(values, ((0, 0), (0, width - values.shape[1])), constant_values=fill)


def _factors(scale, names, quantity):
    """The scale of each value by its joint."""
    factors = {name: scale.get(name, scale.get(ALL)) for name in set(names.ravel().tolist())}
    factors[""] = 1.0
    lacking = [name for name, factor in factors.items() if factor is None]
    if lacking:
        raise InputError(f"scale: {quantity} has nothing for '{min(lacking)}', which rows name. Add it, or \"*\".")
    return np.array([factors[name] for name in names.ravel().tolist()], float).reshape(names.shape)


def _compare(choice, read, losses):
    """Count rows that name other joints than the map of columns."""
    names = names_in_rows(choice.overruled, read.texts, len(read.rows))
    cut = [tuple(filter(None, row)) for row in names.tolist()]
    odd = [k for k, row in enumerate(cut) if row and row != choice.joints]
    if odd:
        losses.overrule(choice, read.where(odd[0]), cut[odd[0]], len(odd))


def of_one_length(values, lengths, width, losses, where, name):
    """Lists of numbers (n, k) as (n, width): NaN where one has another length, which is counted unless it is empty."""
    odd = (lengths != width) & (lengths > 0)
    if odd.any():
        at = int(np.argmax(odd))
        example = f"column '{name}': {lengths[at]} instead of {width}"
        losses.add(OTHER_LENGTH, where(at), "rows of it are NaN", int(odd.sum()), example)
    fitted = np.full((len(values), width), np.nan)
    fit = lengths == width
    fitted[fit] = values[fit][:, :width]
    return fitted


def refuse_doubtful(choice, time, path):
    """Refuse times of the first piece that cannot be seconds if nothing says what they are."""
    unit = unit_in_doubt(time) if choice.time_in_doubt else None
    if unit:
        raise InputError(
            f"'{path}': times are about {np.nanmedian(time):.6g}, which in seconds is no time: say what they are by "
            f"`scale: {{time: {unit}}}` in the map of columns."
        )
