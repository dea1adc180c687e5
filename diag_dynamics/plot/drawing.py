# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Colours, style and downsampling of plots."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from diag_dynamics.arrays import Array
from diag_dynamics.optional import require
from diag_dynamics.text import plain

COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#F0E442")
"""Colours that the colour-blind tell apart, on white and on black, after Okabe and Ito."""

GREY = "#666666"
"""Colour of remaining joints."""

STYLE = {
    **{"axes.spines.top": False, "axes.spines.right": False, "axes.xmargin": 0.0},
    **{"axes.titlelocation": "left", "axes.titlesize": "medium"},
    **{"legend.frameon": False, "legend.fontsize": "small", "figure.constrained_layout.use": True},
}

MIN_GAP = 1.0  # time without values over which no line is drawn, if they are more frequent [s]
MAX_PARTS = 2000  # of a curve: more than a screen has columns


def pyplot() -> Any:
    """Return matplotlib.pyplot, imported on first use."""
    return require("matplotlib.pyplot", "plotting")


def text_colour() -> str:
    """Return the colour of text in the current style."""
    return str(pyplot().rcParams["text.color"])


def escape(name: str) -> str:
    """Return a name as matplotlib shows it, without mathematics between dollars."""
    return plain(name).replace("$", r"\$")


def find_peaks(values: Array) -> npt.NDArray[np.intp]:
    """Return rows that show a curve: the minimum and the maximum of each of its parts, or all."""
    rows = np.arange(len(values))
    if len(values) <= 2 * MAX_PARTS:
        return rows
    parts = np.array_split(rows, MAX_PARTS)
    peaks = [(part[values[part].argmin()], part[values[part].argmax()]) for part in parts]
    return np.unique(peaks)


def insert_gaps(t: Array, values: Array) -> tuple[Array, Array]:
    """Return times (T,) and curves (T,) or (T, n) with NaN where no line is drawn over a gap."""
    steps = np.diff(t)
    usual = float(np.median(steps)) if len(steps) else 0.0
    after = np.flatnonzero(steps > max(MIN_GAP, 10.0 * usual)) + 1
    return np.insert(t, after, t[after]), np.insert(values, after, np.nan, axis=0)
