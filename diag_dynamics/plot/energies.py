# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinetic energy over time, shares of the joints, and the balance of power."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import instance
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.plot import drawing
from diag_dynamics.plot.drawing import COLOURS, GREY, envelope, escape, set_title
from diag_dynamics.recordings import balance as power
from diag_dynamics.recordings.findings import without_efforts
from diag_dynamics.recordings.recording import SIZE, Recording
from diag_dynamics.results import BatchEvaluation, Evaluation
from diag_dynamics.text import duration, number
from diag_dynamics.views.parts import oscillates, parts_of

JointEnergies = tuple[list[str], Array | None, Array]
MAX_BARS = 30  # joints of most energy; the others are one bar


def energy(of: Recording | BatchEvaluation, t: VectorLike | None = None, ax: Any = None) -> Any:
    """Plot kinetic energy over time [J], stacked by the shares ½ν_k² of the total joint rates.

    The joints of most energy have a layer each, all others one. Of very many states those of the
    largest K are drawn. With more than 100 oscillations the layers are means over a hundredth of
    the time, and a grey band reaches up to the largest K.

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

    Raises
    ------
    InputError
        There are no states, `t` does not fit, or matplotlib is not installed.
    """
    joints, times, values = _joint_energies(of, t)
    total = values.sum(axis=1)
    axes, label = drawing.make_axes(ax, (9.0, 3.8)), "kinetic energy [J]"
    if times is not None and oscillates(total):
        parts, largest = parts_of(times, values), parts_of(times, total[:, None]).maximum[:, 0]
        at, values = parts.time, parts.mean
        style = {"color": GREY, "alpha": 0.18, "linewidth": 0, "label": "maximum of K"}
        axes.fill_between(at, values.sum(axis=1), largest, **style)
        label += f", mean of {duration(parts.length)}"
    else:
        bounds = zip(*drawing.split(total), strict=True)
        rows = [first + int(np.argmax(total[first:last])) for first, last in bounds]
        at = np.arange(len(total), dtype=float) if times is None else times
        at, values = drawing.insert_gaps(at[rows], values[rows])
    _stack(axes, at, values, joints)
    axes.set_ylabel(label)
    axes.set_xlabel("state" if times is None else "time [s]")
    set_title(axes, of.model.name, ": kinetic energy by total joint rate")
    axes.margins(x=0)
    axes.set_ylim(bottom=0.0)
    drawing.hide_frame(axes)
    return axes


def _stack(axes: Any, t: Array, values: Array, joints: list[str]) -> None:
    """Draw layers of the joints of most energy, one of the others, K, and the legend."""
    means = np.nan_to_num(values).mean(axis=0)
    chosen = sorted(np.argsort(means)[::-1][: len(COLOURS)].tolist())
    layers, total = [values[:, k] for k in chosen], values.sum(axis=1)
    labels, colours = [escape(joints[k]) for k in chosen], list(COLOURS[: len(chosen)])
    if others := len(joints) - len(chosen):
        layers.append(total - np.sum(layers, axis=0))
        labels.append(f"{others} other{'s' * (others > 1)}")
        colours.append(GREY)
    axes.stackplot(t, layers, labels=labels, colors=colours, linewidth=0)
    axes.plot(t, total, color=drawing.text_colour(), linewidth=0.9, label="K")
    entries = [entries[::-1] for entries in axes.get_legend_handles_labels()]
    place = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)}
    axes.legend(*entries, frameon=False, fontsize="small", **place)


def shares(of: Recording | Evaluation, ax: Any = None) -> Any:
    """Plot the energy share ½ν_k² of each joint [J]: of one state, or mean and largest of many.

    Parameters
    ----------
    of : Recording, BatchEvaluation or Evaluation
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        There are no states, or matplotlib is not installed.
    """
    joints, _, values = _joint_energies(of)
    is_one = not isinstance(of, Recording | BatchEvaluation)
    labels, mean = list(map(escape, joints)), values.mean(axis=0)
    K = f"{number(mean.sum())} J"
    if not is_one:
        K += f" on average, at most {number(values.sum(axis=1).max())} J"
    if len(labels) > MAX_BARS:
        chosen = sorted(np.argsort(mean)[::-1][: MAX_BARS - 1].tolist())
        others = np.delete(values, chosen, axis=1)
        labels = [*(labels[k] for k in chosen), f"{others.shape[1]} others"]
        values = np.column_stack([values[:, chosen], others.sum(axis=1)])
        mean = values.mean(axis=0)
    largest, at = values.max(axis=0), np.arange(len(labels))
    axes = drawing.make_axes(ax, (7.0, 1.1 + 0.27 * len(labels)))
    axes.barh(at, mean, height=0.66, color=COLOURS[0], label="share" if is_one else "mean")
    if not is_one:
        axes.plot(largest, at, color=COLOURS[3], label="largest", **drawing.MARK)
        axes.legend(frameon=False, fontsize="small", loc="lower right")
    end = max(largest.max(), 1e-300)
    for y, percent in enumerate(100.0 * mean / (mean.sum() or 1.0)):
        axes.text(largest[y] + 0.015 * end, y, f"{percent:.0f} %", va="center", fontsize="small")
    axes.set_xlim(0.0, 1.12 * end)
    axes.set_yticks(at, labels)
    axes.invert_yaxis()
    percent_of = "" if is_one else "; in percent: part of the mean of K"
    axes.set_xlabel(f"energy share ½ν² [J]{percent_of}")
    set_title(axes, of.model.name, f": K = {K}")
    drawing.hide_frame(axes)
    return axes


def balance(of: Recording) -> Any:
    """Plot dK/dt over windows of 0.1 s [W], what efforts, gravity and friction explain, the rest.

    The rest is the power of pushes and of what the model lacks: νᵀ(ε − ε_g − ε_fric) = dK/dt
    without both (Lemma 7.2).

    Parameters
    ----------
    of : Recording
        With efforts.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        There are no states, no efforts, or no window in which all states have them; or matplotlib
        is not installed.
    """
    instance("of", of, Recording)
    _check_states(of)
    if of.tau is None:
        raise InputError(f"{without_efforts(of.counts)}. A balance of power needs them.")
    windows, judged = _integrate(of)
    if not len(windows.kinetic):
        raise InputError(f"there is no balance of power: {judged.judgement()}.")
    middle = 0.5e-9 * ((windows.begin - of.stamp[0]) + (windows.end - of.stamp[0]))
    explained = windows.kinetic - windows.residual
    powers = np.stack([windows.kinetic, explained, windows.residual], axis=1)
    t, powers = drawing.insert_gaps(middle, powers)
    figure = drawing.pyplot().figure(figsize=(9.0, 4.6), layout="constrained")
    both, rest = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    causes = "efforts, gravity and friction" if of.model.has_friction else "efforts and gravity"
    both.plot(*envelope(t, powers[:, 0]), color=COLOURS[4], linewidth=2.6, label="dK/dt")
    style = {"color": drawing.text_colour(), "linewidth": 0.9, "label": f"explained by {causes}"}
    both.plot(*envelope(t, powers[:, 1]), **style)
    rest.plot(*envelope(t, powers[:, 2]), color=COLOURS[3], linewidth=1.0)
    for axes, label in ((both, "power [W]"), (rest, "rest [W]")):
        axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
        axes.set_ylabel(label)
        axes.margins(x=0)
        drawing.hide_frame(axes)
    rest.set_xlabel("time [s]")
    place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
    both.legend(frameon=False, fontsize="small", ncols=2, **place)
    set_title(both, of.model.name, _summarize(judged))
    return figure


def _summarize(judged: power.Balance) -> str:
    """Return the explained share; that of d(K + U)/dt where gravity hides that of dK/dt."""
    explained, total, what = judged.explained, judged.explained_total, "dK/dt"
    if explained is None:
        return ""
    if explained < power.NOTHING_EXPLAINED and total is not None and total >= power.MIN_EXPLAINED:
        explained, what = total, "d(K + U)/dt"
    share = f"{100 * explained:.1f} %" if explained > 0.0 else "nothing"
    return f": {share} of {what} explained"


def _integrate(of: Recording) -> tuple[power.Windows, power.Balance]:
    model, windows = of.model, []
    judged, sums = power.Balance(model.dof_names), power.WindowSums(model.nv, model.has_friction)
    efforts = np.where(of.states.effort_known[:, None], of.states.effort, 0.0)
    options: dict[str, Any] = {"size": SIZE, "friction": model.has_friction}
    stream = DiagonalDynamics(model).evaluate_stream(of.q, of.qd, efforts, **options)
    for k, s in enumerate(stream):
        windows.append(sums.take(of.states[k * SIZE : (k + 1) * SIZE], s))
        judged.take(windows[-1])
    return power.Windows(*map(np.concatenate, zip(*windows, strict=True))), judged


def _check_states(of: Recording | Array) -> None:
    if not len(of):
        raise InputError("of has no states. The findings of a recording name the cause.")


def _joint_energies(of: Recording | Evaluation, t: VectorLike | None = None) -> JointEnergies:
    """Return joints, times from zero on [s], and the energy share of each joint [J]."""
    times = None if t is None else np.asarray(t, dtype=float)
    if isinstance(of, Recording):
        times, stream = of.t, DiagonalDynamics(of.model).evaluate_stream(of.q, of.qd)
        energies = np.concatenate([np.zeros((0, of.model.nv)), *(s.energy_share for s in stream)])
    elif isinstance(of, Evaluation):
        energies = np.atleast_2d(of.energy_share)
    else:
        raise InputError(f"of is {of!r}; expected a Recording or the result of an evaluation.")
    _check_states(energies)
    if times is not None and times.shape != (len(energies),):
        raise InputError(f"t has shape {times.shape}; expected ({len(energies)},), one per state.")
    joints = [joint for joint in of.model.joint_names if joint not in of.model.mimics]
    names = [name if name in joints else name.rpartition("/")[0] for name in of.model.dof_names]
    owned = np.array([[name == joint for joint in joints] for name in names], dtype=float)
    return joints, None if times is None else times - times[0], energies @ owned
