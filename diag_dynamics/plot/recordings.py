# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of motions: kinetic energy."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.plot import drawing
from diag_dynamics.plot.drawing import COLOURS, GREY, escape
from diag_dynamics.recordings.recording import SIZE, Recording
from diag_dynamics.results import BatchEvaluation

SIZE_OF_FIGURE = (9.0, 3.8)  # [inch]


def energy(of: Recording | BatchEvaluation, t: VectorLike | None = None, ax: Any = None) -> Any:
    """Plot kinetic energy over time [J], stacked by the shares ½ν_k² of the total joint rates.

    The degrees of freedom of most energy have a layer each, all others one. Of very many states
    those of the largest and smallest K are drawn.

    Parameters
    ----------
    of : Recording or BatchEvaluation
    t : array_like, shape (T,), optional
        Times of a batch [s]; without them its states are numbered.
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes
    """
    names, times, values = _energies(of, t)
    with drawing.pyplot().rc_context(drawing.STYLE):
        axes = ax or drawing.pyplot().figure(figsize=SIZE_OF_FIGURE).add_subplot()
        _draw_layers(axes, times, *_merge(names, values))
        axes.set_title(f"{escape(of.model.name)}: kinetic energy by total joint rate")
    return axes


def _draw_layers(axes: Any, times: Array | None, names: list[str], values: Array) -> None:
    rows = drawing.find_peaks(values.sum(axis=1))
    at = rows.astype(float) if times is None else times[rows]
    at, values = drawing.insert_gaps(at, values[rows])
    axes.stackplot(at, *values.T, labels=names, colors=(*COLOURS, GREY), linewidth=0)
    axes.plot(at, values.sum(axis=1), color=drawing.text_colour(), linewidth=0.9, label="K")
    axes.set(xlabel="state" if times is None else "time [s]")
    axes.set_ylabel("kinetic energy [J]")
    axes.set_ylim(bottom=0.0)
    entries = [entries[::-1] for entries in axes.get_legend_handles_labels()]
    axes.legend(*entries, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _slices(of: Recording) -> list[slice]:
    """Return slices of SIZE states each, which bound the memory of evaluations."""
    return [slice(k, k + SIZE) for k in range(0, len(of), SIZE)]


def _energies(
    of: Recording | BatchEvaluation, t: VectorLike | None
) -> tuple[tuple[str, ...], Array | None, Array]:
    """Return degrees of freedom, times from zero on [s], and their energy shares [J]."""
    if isinstance(of, Recording):
        _check_states(of.q)
        t = of.t
        dynamics = DiagonalDynamics(of.model)
        shares = [dynamics.evaluate(of.q[k], of.qd[k]).energy_share for k in _slices(of)]
        energies = np.concatenate(shares)
    elif isinstance(of, BatchEvaluation):
        energies = of.energy_share
        _check_states(energies)
    else:
        raise InputError(f"of is {of!r}; expected a Recording or an evaluation of many states.")
    times = None if t is None else np.asarray(t, dtype=float)
    if times is not None and times.shape != (len(energies),):
        raise InputError(f"t has shape {times.shape}; expected ({len(energies)},), one per state.")
    if not of.model.nv:
        raise InputError(f"robot '{of.model.name}' has no joint that moves, so no energy to plot.")
    return of.model.dof_names, None if times is None else times - times[0], energies


def _merge(names: tuple[str, ...], values: Array) -> tuple[list[str], Array]:
    """Return names and energies of those of most energy, and of all others as one."""
    chosen = sorted(np.argsort(values.mean(axis=0))[::-1][: len(COLOURS)].tolist())
    layers = values[:, chosen]
    labels = [escape(names[k]) for k in chosen]
    if len(chosen) < len(names):
        labels.append("others")
        layers = np.column_stack([layers, values.sum(axis=1) - layers.sum(axis=1)])
    return labels, layers


def _check_states(states: Array) -> None:
    if not len(states):
        raise InputError("of has no states. The findings of a recording name the cause.")
