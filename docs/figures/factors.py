# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The mass matrix of a humanoid and its factor: m has an entry only where one joint carries the other."""

import numpy as np
from style import COLOURS, figure

import diag_dynamics as dd


def data():
    """Return M and m, (nv, nv), of a humanoid in its neutral posture, its base fixed."""
    model = dd.load_robot("talos_reduced")
    dynamics = dd.DiagonalDynamics(model)
    return dynamics.mass_matrix(model.neutral), dynamics.factors(model.neutral).m


def draw():
    """Return the figure."""
    picture = figure(6.6, 3.2)
    for axes, matrix, name in zip(
        picture.subplots(1, 2), data(), ("M", "m,  M = m mᵀ"), strict=True
    ):
        rows, columns = np.nonzero(np.abs(matrix) > 1e-9 * np.abs(matrix).max())
        size = np.abs(matrix[rows, columns]) / np.sqrt(np.abs(matrix).max())
        axes.scatter(columns, rows, s=9, marker="s", color=COLOURS[0], alpha=0.9, linewidths=0)
        axes.set(
            title=f"{name}: {size.size} entries",
            xlim=(-0.5, len(matrix) - 0.5),
            ylim=(len(matrix) - 0.5, -0.5),
        )
        axes.set_aspect("equal")
        axes.set(xticks=[], yticks=[])
        axes.spines[["top", "right"]].set_visible(True)
    return picture
