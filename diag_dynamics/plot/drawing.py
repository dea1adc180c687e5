# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Colours, axes and downsampling of all plots."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.text import plain

COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#F0E442")
"""Colours that the colour-blind tell apart, on white and on black, after Okabe and Ito."""

GREY = "#666666"
"""Colour of remaining joints and secondary lines."""

MARK: dict[str, Any] = {"linestyle": "none", "marker": "|", "markersize": 12, "markeredgewidth": 2}

MIN_GAP = 1.0  # time without values over which no line is drawn, if they are more frequent [s]
MAX_POINTS = 2000  # of a curve: more than a screen has columns

Rows = npt.NDArray[np.intp]


def pyplot() -> Any:
    """Return matplotlib.pyplot, imported on first use."""
    try:
        return import_module("matplotlib.pyplot")
    except ImportError as error:
        raise InputError("matplotlib is not installed. Run: pip install matplotlib.") from error


def make_axes(ax: Any, size: tuple[float, float], projection: str | None = None) -> Any:
    """Return the axes that were passed, or those of a new figure of this size [inch]."""
    if ax is not None:
        return ax
    figure = pyplot().figure(figsize=size, layout="constrained")
    return figure.add_subplot(projection=projection)


def text_colour() -> str:
    """Return the colour of text in the current style."""
    return str(pyplot().rcParams["text.color"])


def escape(name: str) -> str:
    """Return a name as matplotlib shows it, without mathematics between dollars."""
    return plain(name).replace("$", r"\$")


def set_title(axes: Any, robot: str, text: str = "") -> None:
    """Set a title that begins with the robot's name."""
    axes.set_title(f"{escape(robot)}{text}", fontsize="medium", loc="left")


def hide_frame(axes: Any) -> None:
    """Hide the upper and the right edge."""
    axes.spines[["top", "right"]].set_visible(False)


def split(values: Array) -> tuple[Rows, Rows]:
    """Return first and last row of each part of a curve of at most :data:`MAX_POINTS` parts."""
    bounds = np.linspace(0, len(values), min(len(values), MAX_POINTS), endpoint=False)
    first = np.unique(bounds.astype(np.intp))
    return first, np.append(first[1:], len(values))


def envelope(t: Array, values: Array) -> tuple[Array, Array]:
    """Return a curve with the minimum and maximum of each part; NaN where a part has no value.

    Parameters
    ----------
    t, values : ndarray, shape (T,)
    """
    if len(values) <= 2 * MAX_POINTS:
        return t, values
    first, _ = split(values)
    low, high = np.fmin.reduceat(values, first), np.fmax.reduceat(values, first)
    return np.repeat(t[first], 2), np.stack([low, high], axis=1).ravel()


def insert_gaps(t: Array, values: Array) -> tuple[Array, Array]:
    """Return curves with NaN in every gap, so that no line is drawn over it.

    Parameters
    ----------
    t : ndarray, shape (T,)
    values : ndarray, shape (T,) or (T, n)
    """
    steps = np.diff(t)
    gap = max(MIN_GAP, 10.0 * float(np.median(steps))) if len(steps) else MIN_GAP
    after = np.flatnonzero(steps > gap) + 1
    return np.insert(t, after, t[after]), np.insert(values, after, np.nan, axis=0)
