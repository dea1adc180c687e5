# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sweeps as a drawing: what goes from link to link on the way out, and what on the way back."""

from itertools import pairwise

from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from style import COLOURS, INK, figure

PLACES = (1.4, 5.0, 8.6)
"""Of the links, from the base to the tip."""

WAYS = (
    (2.35, COLOURS[0], "V", "velocities: ν = mᵀq̇", 1),
    (-0.35, COLOURS[1], "P, Λ, y, z", "inertias, biases, moments: D, C, ε = ℓτ", -1),
    (-1.55, COLOURS[2], "A", "accelerations: q̈", 1),
)
"""Height, colour, what is handed on, what comes of it, and the direction."""


def draw():
    """Return the figure."""
    picture = figure(6.6, 2.9)
    axes = picture.subplots()
    for k, x in enumerate(PLACES):
        axes.add_patch(
            FancyBboxPatch(
                (x - 0.6, 0.55), 1.2, 0.9, boxstyle="round,pad=0.1", fill=False, edgecolor=INK
            )
        )
        axes.text(x, 1.0, ("base", "link i", "tip")[k], ha="center", va="center")
    for a, b in pairwise(PLACES):
        axes.plot([a + 0.7, b - 0.7], [1.0, 1.0], color=INK, linewidth=1.0)
        axes.plot((a + b) / 2, 1.0, "o", color=INK, markersize=9, markerfacecolor="none")
        axes.text((a + b) / 2, 1.3, "joint", ha="center", fontsize=8)
    for y, colour, passed, result, way in WAYS:
        for a, b in pairwise(PLACES):
            ends = [(a, y), (b, y)][::way]
            arrow = FancyArrowPatch(
                *ends, arrowstyle="-|>", mutation_scale=12, color=colour, shrinkA=4, shrinkB=4
            )
            axes.add_patch(arrow)
            axes.text((a + b) / 2, y + 0.12, passed, ha="center", va="bottom", color=colour)
        axes.text(9.1, y, result, ha="left", va="center", color=colour)
    axes.set(xlim=(0.4, 14.6), ylim=(-2.0, 3.0))
    axes.set_axis_off()
    return picture
