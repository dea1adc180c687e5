# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an identification has changed, on a page: each joint's unexplained effort before and after, and in numbers."""

import numpy as np

from diag_dynamics.text import plain

BEFORE, AFTER, HELD_OUT = "#b9bcc2", "#0b6fb8", "#fff3d6"


def picture(path, title, time, torques, torque_rms, held_out):
    """Draw it into an image file (format by its suffix).

    Parameters
    ----------
    path : str or Path
    title : str
    time : ndarray, shape (T,)
        [s].
    torques : pair of ndarray, shape (T, nv)
        External torque that an observer sees where there was none, before and after [N m, N].
    torque_rms : dict
        Before and after, by joint, on the part held out [N m, N].
    held_out : pair of float
        Begin and end of that part [s].
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to import, and seldom needed
    from matplotlib.figure import Figure

    names = list(torque_rms)
    rows = -(-len(names) // 2)
    figure = Figure(figsize=(11, 2.6 + 1.55 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[1.0] * rows + [1.5])
    axes = None
    for k, name in enumerate(names):
        axes = figure.add_subplot(grid[k // 2, k % 2], sharex=axes)
        for torque, color, label in zip(torques, (BEFORE, AFTER), ("before", "after"), strict=True):
            axes.plot(time, torque[:, k], color=color, linewidth=0.8, label=label)
        axes.axvspan(*held_out, color=HELD_OUT, linewidth=0, zorder=0)
        axes.axhline(0.0, color="#444444", linewidth=0.5)
        axes.set_title(plain(name), loc="left", fontsize=9, parse_math=False)
        axes.margins(x=0)
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)
        if k % 2 == 0:
            axes.set_ylabel("N m, N", fontsize=8)
        if k + 2 >= len(names):  # the lowest one of its column
            axes.set_xlabel("time [s]", fontsize=8)
        else:
            axes.tick_params(labelbottom=False)
    figure.axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False, ncols=2)
    _bars(figure.add_subplot(grid[rows, :]), names, torque_rms)
    figure.suptitle("\n".join(map(plain, title.splitlines())), fontsize=10, parse_math=False)
    figure.savefig(path, dpi=120)


def _bars(axes, names, torque_rms):
    """Root mean square of each joint's error on the part held out."""
    pairs = np.array([torque_rms[name] for name in names], dtype=float)
    at = np.arange(len(names))
    for column, color, label in ((0, BEFORE, "before"), (1, AFTER, "after")):
        axes.bar(at + 0.38 * (column - 0.5), pairs[:, column], 0.36, color=color, label=label)
    axes.set_xticks(
        at, [plain(name) for name in names], fontsize=8, rotation=0 if len(names) < 9 else 45, parse_math=False
    )
    axes.set_ylabel("error of the effort\nbelow 5 Hz, rms [N m, N]", fontsize=8)
    axes.tick_params(axis="y", labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="upper right", fontsize=8, frameon=False)
