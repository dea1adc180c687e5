# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of motions: energy, power balance, external torque."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import instance
from diag_dynamics.collision.calibration import Calibration
from diag_dynamics.collision.detector import Thresholds
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.plot import drawing
from diag_dynamics.plot.drawing import COLOURS, GREY, escape, styled
from diag_dynamics.recordings import balance as power
from diag_dynamics.recordings.findings import explain_missing_efforts
from diag_dynamics.recordings.observer import Observed, observe
from diag_dynamics.recordings.recording import SIZE, Recording
from diag_dynamics.results import BatchEvaluation


@styled
def energy(of: Recording | BatchEvaluation, t: VectorLike | None = None, ax: Any = None) -> Any:
    """Plot kinetic energy over time [J], stacked by the shares ½ν_k² of the total joint rates.

    The joints of most energy have a layer each, all others one. Of very many states those of the
    largest and smallest K are drawn.

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
    joints, times, values = _joint_energies(of, t)
    names, values = _merge_joints(joints, values)
    total, axes = values.sum(axis=1), drawing.make_axes(ax, (9.0, 3.8))
    rows = drawing.find_peaks(total)
    at = rows.astype(float) if times is None else times[rows]
    at, values = drawing.insert_gaps(at, values[rows])
    axes.stackplot(at, *values.T, labels=names, colors=(*COLOURS, GREY), linewidth=0)
    axes.plot(at, values.sum(axis=1), color=drawing.text_colour(), linewidth=0.9, label="K")
    axes.set(xlabel="state" if times is None else "time [s]")
    axes.set_ylabel("kinetic energy [J]")
    axes.set_title(f"{escape(of.model.name)}: kinetic energy by total joint rate")
    axes.set_ylim(bottom=0.0)
    entries = [entries[::-1] for entries in axes.get_legend_handles_labels()]
    axes.legend(*entries, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return axes


@styled
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
    """
    instance("of", of, Recording)
    _check_states(of.q)
    if of.tau is None:
        raise InputError(f"{explain_missing_efforts(of.counts)}. A balance of power needs them.")
    windows = _integrate(of)
    if not len(windows.kinetic):
        raise InputError(f"of has {len(of)} states; expected 0.1 s of them in a row with efforts.")
    middle = 0.5e-9 * ((windows.begin - of.stamp[0]) + (windows.end - of.stamp[0]))
    powers = (windows.kinetic, windows.kinetic - windows.residual, windows.residual)
    t, columns = drawing.insert_gaps(middle, np.column_stack(powers))
    figure = drawing.pyplot().figure(figsize=(9.0, 4.6))
    power_axes, rest_axes = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    causes = "efforts, gravity and friction" if of.model.has_friction else "efforts and gravity"
    explained = {"color": drawing.text_colour(), "label": f"explained by {causes}"}
    power_axes.plot(t, columns[:, 0], color=COLOURS[4], linewidth=2.6, label="dK/dt")
    power_axes.plot(t, columns[:, 1], linewidth=0.9, **explained)
    rest_axes.plot(t, columns[:, 2], color=COLOURS[3], linewidth=1.0)
    for axes in (power_axes, rest_axes):
        axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
    power_axes.set(ylabel="power [W]")
    rest_axes.set(ylabel="rest [W]", xlabel="time [s]")
    power_axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2, ncols=2)
    power_axes.set_title(f"{escape(of.model.name)}: power balance")
    return figure


@styled
def external_torque(
    of: Recording | Observed,
    thresholds: Thresholds | Mapping[str, float] | None = None,
    *,
    gain: float = 25.0,
) -> Any:
    """Plot the external torque of each joint over time [N m, N] by a disturbance observer.

    Values beyond the joint's threshold have another colour. Gaps are states without a result.

    Parameters
    ----------
    of : Recording or Observed
        An Observed is the result of :func:`diag_dynamics.observe`.
    thresholds : Thresholds or dict, optional
        Thresholds of joints by name, ``*`` for all others [N m, N].
    gain : float
        Of the observer of a recording [1/s]. Gain and friction of a calibration have precedence.

    Returns
    -------
    matplotlib.figure.Figure
    """
    options: dict[str, Any] = {"gain": gain}
    if isinstance(thresholds, Calibration):
        options = {"gain": thresholds.gain, "friction": thresholds.friction}
    elif not isinstance(thresholds, Thresholds):
        thresholds = Thresholds(thresholds or {})
    if isinstance(of, Recording):
        of = observe(DiagonalDynamics(of.model), of, **options)
    model = instance("of", of, Observed).dynamics.model
    rows = -(-model.nv // 2)
    figure = drawing.pyplot().figure(figsize=(10.0, 0.9 + 1.25 * rows))
    grid = figure.subplots(rows, 2, sharex=True, squeeze=False)
    columns = (model.dof_names, sliding_dofs(model), thresholds.of_names(model.dof_names))
    for k, (dof, slides, limit) in enumerate(zip(*columns, strict=False)):
        _draw_torque(grid.flat[k], of.t - of.t[0], of.external_torque[:, k], limit)
        grid.flat[k].set_title(f"{escape(dof)} [{'N' if slides else 'N m'}]", fontsize="small")
    for axes in grid.flat[model.nv :]:
        axes.set_axis_off()
    for axes in grid.flat[max(0, model.nv - 2) : model.nv]:  # the last of each column
        axes.set(xlabel="time [s]")
        axes.tick_params(labelbottom=True)
    title = f"{escape(model.name)}: external torque"
    figure.suptitle(title, fontsize="medium", x=0.01, ha="left")
    return figure


def _draw_torque(axes: Any, t: Array, torque: Array, limit: float) -> None:
    rows = drawing.find_peaks(torque)
    t, torque = t[rows], torque[rows]
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
    axes.plot(t, torque, color=COLOURS[0], linewidth=0.9)
    if np.isfinite(limit):
        axes.axhspan(-limit, limit, color=GREY, alpha=0.18, linewidth=0, zorder=0)
        beyond = np.where(np.abs(torque) > limit, torque, np.nan)
        axes.plot(t, beyond, color=COLOURS[3], linewidth=1.6)


def _integrate(of: Recording) -> power.Windows:
    """Return the powers of a recording over windows."""
    sums = power.WindowSums(of.model.nv, of.model.has_friction)
    efforts = np.where(of.states.effort_known[:, None], of.states.effort, 0.0)
    dynamics, windows = DiagonalDynamics(of.model), []
    for rows in _slices(of):
        motion = of.q[rows], of.qd[rows], efforts[rows]
        s = dynamics.evaluate(*motion, friction=of.model.has_friction)
        windows.append(sums.integrate_states(of.states[rows], s))
    return power.Windows(*map(np.concatenate, zip(*windows, strict=True)))


def _slices(of: Recording) -> list[slice]:
    """Return slices of SIZE states each, which bound the memory of evaluations."""
    return [slice(k, k + SIZE) for k in range(0, len(of), SIZE)]


def _joint_energies(
    of: Recording | BatchEvaluation, t: VectorLike | None
) -> tuple[list[str], Array | None, Array]:
    """Return joints, times from zero on [s], and the energy share of each joint [J]."""
    if isinstance(of, Recording):
        _check_states(of.q)
        t, dynamics = of.t, DiagonalDynamics(of.model)
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
    joints = [joint for joint in of.model.joint_names if joint not in of.model.mimics]
    if not of.model.nv:
        raise InputError(f"robot '{of.model.name}' has no joint that moves, so no energy to plot.")
    names = [name if name in joints else name.rpartition("/")[0] for name in of.model.dof_names]
    owned = np.array([[name == joint for joint in joints] for name in names], dtype=float)
    return joints, None if times is None else times - times[0], energies @ owned


def _merge_joints(joints: list[str], values: Array) -> tuple[list[str], Array]:
    """Return names and energies of the joints of most energy, and those of all others as one."""
    chosen = sorted(np.argsort(values.mean(axis=0))[::-1][: len(COLOURS)].tolist())
    rest = sorted({*range(len(joints))} - {*chosen})
    names = [escape(joints[k]) for k in chosen]
    if not rest:
        return names, values
    names.append(f"{len(rest)} others" if len(rest) > 1 else escape(joints[rest[0]]))
    return names, np.column_stack([values[:, chosen], values[:, rest].sum(axis=1)])


def _check_states(states: Array) -> None:
    if not len(states):
        raise InputError("of has no states. The findings of a recording name the cause.")
