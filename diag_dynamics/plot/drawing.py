# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all plots have in common: matplotlib, colours, axes with units, and curves of more states than there are pixels."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.text import plain

COLOURS: tuple[str, ...] = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#F0E442")
"""Colours that are told apart by the colour-blind, on white and on black, after Okabe and Ito."""

GREY = "#666666"
"""Of what is neither the one nor the other: all other joints, and lines that are looked at second."""

MARK: dict[str, Any] = {"linestyle": "none", "marker": "|", "markersize": 12, "markeredgewidth": 2}
"""A mark on or beside a bar."""

GAP = 1.0
"""Time without a value over which no line is drawn [s], unless values are rarer than that anyway."""

MOST = 2000
"""Points of a curve along time: more than a screen has columns."""


def pyplot() -> Any:
    """matplotlib.pyplot.

    Raises
    ------
    InputError
        matplotlib is not installed.
    """
    try:
        return import_module("matplotlib.pyplot")
    except ImportError as error:
        raise InputError("plots need matplotlib, which is not installed: pip install matplotlib.") from error


def axes_or_new(ax: Any, size: tuple[float, float], projection: str | None = None) -> Any:
    """Return the axes that were given, or those of a new figure of this size [inch]."""
    if ax is not None:
        return ax
    figure = pyplot().figure(figsize=size, layout="constrained")
    return figure.add_subplot(projection=projection)


def text_colour() -> str:
    """That of the style in force."""
    return str(pyplot().rcParams["text.color"])


def name(text: str) -> str:
    """Name of a joint as matplotlib shows it: a dollar in it is a dollar."""
    return plain(text).replace("$", r"\$")


def tidy(axes: Any) -> None:
    """Take away what frames the plot and says nothing."""
    axes.spines[["top", "right"]].set_visible(False)


def legend_beside(axes: Any, reverse: bool = False) -> None:
    """Legend to the right of the axes; in reverse, where layers lie one upon the other."""
    handles, labels = axes.get_legend_handles_labels()
    step = -1 if reverse else 1
    axes.legend(
        handles[::step], labels[::step], loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small"
    )


def bins(count: int) -> npt.NDArray[np.intp]:
    """Where each of :data:`MOST` parts of so many states begins; of fewer, each is a part."""
    return np.unique(np.linspace(0, count, min(count, MOST), endpoint=False).astype(np.intp))


def largest_of_bins(values: Array) -> npt.NDArray[np.intp]:
    """Index of the largest value in each of :func:`bins`: no peak is lost."""
    begins = bins(len(values))
    ends = [*begins[1:], len(values)]
    return np.array([a + int(np.argmax(values[a:b])) for a, b in zip(begins, ends, strict=True)], dtype=np.intp)


def envelope(t: Array, values: Array) -> tuple[Array, Array]:
    """Curve of fewer points with the lowest and the highest value of each part; gaps (NaN) stay gaps.

    Parameters
    ----------
    t, values : ndarray, shape (T,)
    """
    if len(values) <= 2 * MOST:
        return t, values
    begins = bins(len(values))
    known = ~np.isnan(values)
    low = np.minimum.reduceat(np.where(known, values, np.inf), begins)
    high = np.maximum.reduceat(np.where(known, values, -np.inf), begins)
    low, high = (np.where(np.isfinite(x), x, np.nan) for x in (low, high))
    return np.repeat(t[begins], 2), np.stack([low, high], axis=1).ravel()


def parted(t: Array, values: Array) -> tuple[Array, Array]:
    """Curves over time with NaN in every gap: nothing is drawn over what nobody has seen.

    Parameters
    ----------
    t : ndarray, shape (T,)
    values : ndarray, shape (T,) or (T, number)
    """
    steps = np.diff(t)
    longest = max(GAP, 10.0 * float(np.median(steps))) if len(steps) else GAP
    after = np.flatnonzero(steps > longest) + 1
    return np.insert(t, after, t[after]), np.insert(values, after, np.nan, axis=0)


def check_named(what: str, wanted: str, names: Sequence[str]) -> None:
    """Refuse a name that is none of these.

    Raises
    ------
    InputError
    """
    if wanted not in names:
        raise InputError(f"{what} {wanted!r} is none of {', '.join(names)}.")
