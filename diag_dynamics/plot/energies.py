# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinetic energy: when it is, and which total joint rates have it."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import VectorLike
from diag_dynamics.plot.drawing import (
    COLOURS,
    GREY,
    MARK,
    axes_or_new,
    largest_of_bins,
    legend_beside,
    name,
    parted,
    text_colour,
    tidy,
)
from diag_dynamics.plot.given import shares_of
from diag_dynamics.recordings.recording import Recording
from diag_dynamics.results import BatchEvaluation, Evaluation
from diag_dynamics.text import duration, number
from diag_dynamics.views.parts import oscillates, parts_of

ROWS = 30
"""Joints of which a bar is drawn, those with most energy; the others are one bar."""


def energy(of: Recording | BatchEvaluation, t: VectorLike | None = None, ax: Any = None) -> Any:
    """Kinetic energy over time [J], stacked by the shares ½ν_k² of the total joint rates, which sum to K.

    The joints with most energy have a layer each, all others are one. Of very many states those with the largest K are
    drawn, so that no peak is lost. Of more than 100 oscillations the layers are means over a hundredth of the time, and a
    grey band reaches up to the largest K.

    Parameters
    ----------
    of : Recording or BatchEvaluation
    t : array_like, shape (T,), optional
        Times of a batch [s]; without them its states are numbered.
    ax : matplotlib.axes.Axes, optional
        Where to draw, by default in a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        There are no states, `t` does not fit, or matplotlib is not installed.
    """
    found = shares_of(of, t)
    total = found.energy.sum(axis=1)
    times = np.arange(len(total), dtype=float) if found.t is None else found.t
    axes, label = axes_or_new(ax, (9.0, 3.8)), "kinetic energy [J]"
    if found.t is not None and oscillates(total):
        means, largest = parts_of(times, found.energy), parts_of(times, total[:, None]).maximum[:, 0]
        times, energies = means.time, means.mean
        axes.fill_between(
            times, energies.sum(axis=1), largest, color=GREY, alpha=0.18, linewidth=0, label="maximum of K"
        )
        label += f", mean of {duration(means.length)}"
    else:
        drawn = largest_of_bins(total)
        times, energies = parted(times[drawn], found.energy[drawn])
    total = energies.sum(axis=1)
    most = sorted(np.argsort(found.energy.mean(axis=0))[::-1][: len(COLOURS)].tolist())
    layers = [energies[:, k] for k in most]
    labels, colours = [name(found.joints[k]) for k in most], list(COLOURS[: len(most)])
    if others := len(found.joints) - len(most):
        layers.append(total - np.sum(layers, axis=0))
        labels.append(f"{others} other{'s' * (others > 1)}")
        colours.append(GREY)
    axes.stackplot(times, layers, labels=labels, colors=colours, linewidth=0)
    axes.plot(times, total, color=text_colour(), linewidth=0.9, label="K")
    axes.set_ylabel(label)
    axes.set_xlabel("state" if found.t is None else "time [s]")
    axes.set_title(f"{name(found.model.name)}: kinetic energy by total joint rate", fontsize="medium", loc="left")
    axes.margins(x=0)
    axes.set_ylim(bottom=0.0)
    tidy(axes)
    legend_beside(axes, reverse=True)
    return axes


def shares(of: Recording | Evaluation, ax: Any = None) -> Any:
    """Energy share ½ν_k² of each joint [J], base to tip: of one state, or the mean and the largest of many.

    Parameters
    ----------
    of : Recording, BatchEvaluation or Evaluation
    ax : matplotlib.axes.Axes, optional
        Where to draw, by default in a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        There are no states, or matplotlib is not installed.
    """
    found = shares_of(of)
    one = not isinstance(of, Recording | BatchEvaluation)
    mean, largest = found.energy.mean(axis=0), found.energy.max(axis=0)
    kept = list(range(len(mean)))
    if len(kept) > ROWS:
        kept = sorted(np.argsort(mean)[::-1][: ROWS - 1].tolist())
    labels = [name(found.joints[k]) for k in kept]
    bars, peaks, total = mean[kept].tolist(), largest[kept].tolist(), mean.sum()
    if others := len(mean) - len(kept):
        left = np.delete(found.energy, kept, axis=1).sum(axis=1)
        labels.append(f"{others} others")
        bars.append(float(left.mean()))
        peaks.append(float(left.max()))
    axes = axes_or_new(ax, (7.0, 1.1 + 0.27 * len(bars)))
    at = np.arange(len(bars))
    axes.barh(at, bars, height=0.66, color=COLOURS[0], label="share" if one else "mean")
    if not one:
        axes.plot(peaks, at, color=COLOURS[3], label="largest", **MARK)
        axes.legend(frameon=False, fontsize="small", loc="lower right")
    reach = max(max(bars if one else peaks), 1e-300)
    for y, (bar, end) in enumerate(zip(bars, bars if one else peaks, strict=True)):
        part = bar / total if total > 0.0 else 0.0
        axes.text(end + 0.015 * reach, y, f"{100 * part:.0f} %", va="center", fontsize="small")
    axes.set_xlim(0.0, 1.12 * reach)
    axes.set_yticks(at, labels)
    axes.invert_yaxis()
    axes.set_xlabel("energy share ½ν² [J]" + ("" if one else "; in percent: part of the mean of K"))
    title = (
        f"K = {number(total)} J"
        if one
        else f"K = {number(total)} J on average, at most {number(found.energy.sum(axis=1).max())} J"
    )
    axes.set_title(f"{name(found.model.name)}: {title}", fontsize="medium", loc="left")
    tidy(axes)
    return axes
