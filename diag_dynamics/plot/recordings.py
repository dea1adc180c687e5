# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of motions: kinetic energy."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import instance
from diag_dynamics.exceptions import InputError
from diag_dynamics.plot import drawing
from diag_dynamics.plot.drawing import COLOURS, GREY, escape
from diag_dynamics.results import Evaluation

SIZE_OF_FIGURE = (9.0, 3.8)  # [inch]


def energy(of: Evaluation, t: VectorLike | None = None, ax: Any = None) -> Any:
    """Plot kinetic energy over time [J], stacked by the shares ½ν_k² of the total joint rates.

    The degrees of freedom of most energy have a layer each, all others one. Of very many states
    those of the largest and smallest K are drawn.

    Parameters
    ----------
    of : Evaluation of many states
        Of a motion, such as ``dyn.evaluate(recording.q, recording.qd)``.
    t : array_like, shape (T,), optional
        Times of the states [s], drawn from zero on; without them the states are numbered.
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes
    """
    values = instance("of", of, Evaluation).energy_share
    if values.ndim < 2:
        raise InputError("of is the evaluation of one state; expected that of many states.")
    if not values.size:
        raise InputError("of has no states, or its robot no joint that moves; expected energies.")
    times = np.arange(len(values)) if t is None else np.asarray(t, dtype=float)
    if times.shape != values.shape[:1]:
        raise InputError(f"t has shape {times.shape}; expected ({len(values)},), one per state.")
    with drawing.pyplot().rc_context(drawing.STYLE):
        axes = ax or drawing.pyplot().figure(figsize=SIZE_OF_FIGURE).add_subplot()
        _draw_layers(axes, times - times[0], *_merge(of.model.dof_names, values))
        axes.set_xlabel("state" if t is None else "time [s]")
        axes.set_title(f"{escape(of.model.name)}: kinetic energy by total joint rate")
    return axes


def _draw_layers(axes: Any, times: Array, names: list[str], values: Array) -> None:
    rows = drawing.find_peaks(values.sum(axis=1))
    at = times[rows].astype(float)
    at, values = drawing.insert_gaps(at, values[rows])
    axes.stackplot(at, *values.T, labels=names, colors=(*COLOURS, GREY), linewidth=0)
    axes.plot(at, values.sum(axis=1), color=drawing.text_colour(), linewidth=0.9, label="K")
    axes.set_ylabel("kinetic energy [J]")
    axes.set_ylim(bottom=0.0)
    entries = [entries[::-1] for entries in axes.get_legend_handles_labels()]
    axes.legend(*entries, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _merge(names: tuple[str, ...], values: Array) -> tuple[list[str], Array]:
    """Return names and energies of those of most energy, and of all others as one."""
    chosen = sorted(np.argsort(values.mean(axis=0))[::-1][: len(COLOURS)].tolist())
    layers = values[:, chosen]
    labels = [escape(names[k]) for k in chosen]
    if len(chosen) < len(names):
        labels.append("others")
        layers = np.column_stack([layers, values.sum(axis=1) - layers.sum(axis=1)])
    return labels, layers
