# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a joint feels of the arm beyond it: all of it where that is rigid, less where that is free to give way."""

import numpy as np
from rods import model
from style import COLOURS, INK, figure

import diag_dynamics as dd


def data():
    """Return elbow angles (T,) [rad], M₁₁ and D₁ (T,) [kg m²] with the third joint straight."""
    dynamics = dd.DiagonalDynamics(model())
    elbow = np.linspace(0.0, np.pi, 121)
    rigid = [dynamics.mass_matrix([0.0, angle, 0.0])[0, 0] for angle in elbow]
    free = [dynamics.factors([0.0, angle, 0.0]).D[0] for angle in elbow]
    return elbow, np.array(rigid), np.array(free)


def draw():
    """Return the figure."""
    elbow, rigid, free = data()
    picture = figure(6.6, 2.5)
    axes = picture.subplots()
    axes.plot(np.degrees(elbow), rigid, color=INK, label="M₁₁: elbow and wrist held")
    axes.plot(np.degrees(elbow), free, color=COLOURS[0], label="D₁: elbow and wrist free")
    axes.fill_between(np.degrees(elbow), free, rigid, color=COLOURS[0], alpha=0.12, linewidth=0)
    axes.set(
        xlabel="elbow angle [°]",
        ylabel="inertia at the shoulder [kg m²]",
        xlim=(0, 180),
        ylim=(0, None),
    )
    axes.set_xticks(range(0, 181, 30))
    axes.legend(loc="upper right")
    return picture
