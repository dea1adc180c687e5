# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of what was measured."""

from itertools import pairwise

import matplotlib
import numpy as np
from growth import CHAIN, FIRST, TREE

matplotlib.use("agg")
from matplotlib import pyplot as plt

OURS, DARK, PINOCCHIO, MUJOCO, DENSE = "#0b6fb8", "#0a3d62", "#d1495b", "#8a6fb0", "#7a7a7a"

STYLE = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "figure.constrained_layout.use": True,
    "figure.dpi": 120,
    "figure.figsize": (7.2, 4.4),
    "font.size": 10,
    "grid.alpha": 0.25,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "lines.markersize": 5,
}

SINGLE = {
    "dense_evaluate": ("NumPy and Pinocchio, to the same outputs", DENSE, "s"),
    "mj_forward": ("MuJoCo mj_forward: M, LᵀDL, bias, q̈", MUJOCO, "^"),
    "aba": ("Pinocchio aba: q̈", PINOCCHIO, "v"),
    "fields": ("evaluate, fields read", DARK, "D"),
    "evaluate": ("evaluate", OURS, "o"),
    "forward_dynamics": ("forward_dynamics: q̈", "#5fb3ce", "P"),
}

METHODS = {"evaluate": OURS, "forward_dynamics": "#5fb3ce", "nu_from_qd": DARK}


def draw(folder, measured):
    """Write all of them into a folder."""
    with plt.rc_context(STYLE):
        _against_dof(measured.single, measured.dof).savefig(folder / "dof.png")
        _growth(measured.growth).savefig(folder / "growth.png")
        _throughput(measured).savefig(folder / "batch.png")
        plt.close("all")


def _against_dof(times, dof):
    figure, axes = plt.subplots(figsize=(7.2, 5.4))
    fixed = sorted((name for name in times if "floating" not in name), key=dof.get)
    floating = [name for name in times if "floating" in name]
    for call, (label, color, marker) in SINGLE.items():
        for names, style in ((fixed, {"label": label}), (floating, {"ls": "", "mfc": "white"})):
            medians = [1e6 * np.median(times[name][call]) for name in names]
            axes.plot([dof[name] for name in names], medians, marker=marker, color=color, **style)
    axes.plot([], [], "o", mfc="white", color="0.4", label="hollow: floating base")
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="degrees of freedom",
        ylabel="time of one call from Python [µs]",
    )
    axes.set_title("One state: time against degrees of freedom")
    axes.xaxis.set_major_locator(
        matplotlib.ticker.FixedLocator(_apart(sorted({dof[name] for name in times})))
    )
    axes.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
    _plain(axes.xaxis, axes.yaxis)
    axes.legend(ncols=2, loc="upper left", bbox_to_anchor=(0, -0.13), fontsize=9)
    return figure


def _growth(times):
    figure, axes = plt.subplots()
    sizes = sorted({n for _, _, n in times})
    for method, color in METHODS.items():
        for kind, style in ((CHAIN, "o-"), (TREE, "s--")):
            medians = [1e6 * np.median(times[kind, method, n]) for n in sizes]
            axes.plot(sizes, medians, style, color=color, label=f"{method}, {kind}")
    above = np.array([n for n in sizes if n >= FIRST])
    slope = 1.5e6 * np.median(times[CHAIN, "evaluate", sizes[-1]]) * above / sizes[-1]
    axes.plot(above, slope, color="0.4", lw=1, ls=":", label="slope 1: O(N)")
    axes.set(xscale="log", yscale="log", xlabel="joints", ylabel="time of one call [µs]")
    axes.set_title("Growth with the number of joints")
    axes.set_xticks(sizes)
    axes.xaxis.set_minor_locator(matplotlib.ticker.NullLocator())
    _plain(axes.xaxis, axes.yaxis)
    axes.legend(fontsize=9)
    return figure


def _throughput(measured):
    figure, axes = plt.subplots()
    counts = sorted({count for _, count in measured.throughput})
    styles = dict(zip(counts, ("-", "--", "-.", ":") * len(counts), strict=False))
    for (name, count), states in measured.throughput.items():
        color, marker = (OURS, "o") if name == "evaluate" else (PINOCCHIO, "v")
        label = f"{name}, {count} thread{'s' * (count > 1)}"
        axes.plot(
            measured.batch_sizes, states, styles[count], color=color, marker=marker, label=label
        )
    axes.set(xscale="log", yscale="log", xlabel="states of a batch", ylabel="states per second")
    axes.set_title(
        f"Many states: throughput ({measured.batch_robot}; abaInParallel computes q̈ only)"
    )
    axes.legend(fontsize=9)
    return figure


def _apart(values):
    """Those of the values that are far enough from the one before to have a tick label each."""
    kept = values[:1]
    for _, value in pairwise(values):
        if value >= 1.12 * kept[-1]:
            kept.append(value)
    return kept


def plain(axis, subs=(1, 2, 5)):
    """Numbers on a logarithmic axis as they are, not powers of ten, and enough of them."""
    axis.set_major_locator(matplotlib.ticker.LogLocator(subs=subs))
    axis.set_minor_locator(matplotlib.ticker.NullLocator())
    axis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))


def _plain(x, y):
    """Plain numbers at the places that x has, and those of :func:`plain` on y."""
    plain(y)
    x.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
