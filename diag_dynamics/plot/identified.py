# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of `diag-dynamics identify`: errors of each joint before and after identification."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.text import plain

Pairs = Mapping[str, tuple[float, float]]

BEFORE, AFTER = "#b9bcc2", "#0b6fb8"


def draw_identification(
    path: str | Path,
    title: str,
    time: Array,
    torques: tuple[Array, Array],
    torque_rms: Pairs,
) -> None:
    """Draw the picture into an image file (format by its suffix).

    Parameters
    ----------
    path : str or Path
    title : str
    time : ndarray, shape (T,)
        [s].
    torques : pair of ndarray, shape (T, nv)
        External torque of the observer without contact, before and after [N m, N].
    torque_rms : dict
        Before and after, by joint, in cross-validation [N m, N].
    """
    from matplotlib.figure import Figure  # slow to import, and seldom needed

    names = list(torque_rms)
    rows = -(-len(names) // 2)
    figure = Figure(figsize=(11, 2.6 + 1.55 * rows), layout="constrained")
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[1.0] * rows + [1.5])
    axes = None
    for k, name in enumerate(names):
        axes = figure.add_subplot(grid[k // 2, k % 2], sharex=axes)
        for torque, color, label in zip(torques, (BEFORE, AFTER), ("before", "after"), strict=True):
            axes.plot(time, torque[:, k], color=color, linewidth=0.8, label=label)
        axes.axhline(0.0, color="#444444", linewidth=0.5)
        axes.set_title(plain(name), loc="left", fontsize=9, parse_math=False)
        axes.margins(x=0)
        axes.tick_params(labelsize=8, labelbottom=k + 2 >= len(names))  # the lowest one of its column
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_ylabel("N m, N" if k % 2 == 0 else "", fontsize=8)
        axes.set_xlabel("time [s]" if k + 2 >= len(names) else "", fontsize=8)
    figure.axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False, ncols=2)
    _draw_bars(figure.add_subplot(grid[rows, :]), torque_rms)
    figure.suptitle("\n".join(map(plain, title.splitlines())), fontsize=10, parse_math=False)
    figure.savefig(path, dpi=120)


def _draw_bars(axes: Any, torque_rms: Pairs) -> None:
    """Draw the error of each joint in cross-validation."""
    at, pairs = np.arange(len(torque_rms)), np.array(list(torque_rms.values()), dtype=float)
    for column, color, label in ((0, BEFORE, "before"), (1, AFTER, "after")):
        axes.bar(at + 0.38 * (column - 0.5), pairs[:, column], 0.36, color=color, label=label)
    rotation = 0 if len(at) < 9 else 45
    axes.set_xticks(at, [plain(name) for name in torque_rms], fontsize=8, rotation=rotation, parse_math=False)
    axes.set_ylabel("error of the effort\nbelow 5 Hz, rms [N m, N]", fontsize=8)
    axes.tick_params(axis="y", labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper right", fontsize=8, frameon=False)
