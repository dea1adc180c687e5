# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How figures look: no background, and colours that can be read on white and on black."""

from matplotlib.figure import Figure

INK = "#767676"
"""Of text and axes."""

COLOURS = ("#3a7fc1", "#d07a22", "#3d9a6a")
"""Of joints 1, 2 and 3."""

RULES = {
    "svg.hashsalt": "diag_dynamics",
    "svg.fonttype": "none",  # text stays text: it is searched, and read aloud
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Helvetica", "Arial", "sans-serif"],
    "font.size": 9,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
}
"""matplotlib's rcParams of every figure."""


def figure(width, height):
    """Return an empty figure [inch]."""
    return Figure(figsize=(width, height), layout="constrained")
