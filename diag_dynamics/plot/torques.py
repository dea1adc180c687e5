# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque of each joint over time, with thresholds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.collision.calibration import Calibration
from diag_dynamics.collision.thresholds import AlarmThresholds
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.single_joints import sliding_dofs
from diag_dynamics.plot import drawing
from diag_dynamics.plot.drawing import COLOURS, GREY, envelope, escape
from diag_dynamics.recordings.observer import Observed, observe
from diag_dynamics.recordings.recording import Recording


def external_torque(
    of: Recording | Observed,
    thresholds: Calibration | AlarmThresholds | Mapping[str, float] | None = None,
    *,
    gain: float = 25.0,
    model: RobotModel | None = None,
) -> Any:
    """Plot the external torque of each joint over time [N m, N] by a disturbance observer.

    Values beyond the joint's threshold have another colour. Gaps are states without a result.

    Parameters
    ----------
    of : Recording or Observed
        An Observed is the result of :func:`diag_dynamics.observe`.
    thresholds : Calibration, AlarmThresholds or dict, optional
        Thresholds of joints by name, ``*`` for all others [N m, N].
    gain : float
        Of the observer of a recording [1/s]; a calibration's own has precedence.
    model : RobotModel
        The robot of an Observed.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        There are no states or no efforts, the robot is missing or another one, or matplotlib is not
        installed.
    """
    if isinstance(of, Recording):
        model = of.model
        gain = thresholds.gain if isinstance(thresholds, Calibration) else gain
        of = observe(DiagonalDynamics(model), of, gain)
    if not isinstance(of, Observed):
        raise InputError(f"of is {of!r}; expected a Recording or an Observed.")
    if model is None:
        raise InputError("model is None; expected the robot of the Observed.")
    if (count := of.external_torque.shape[1]) != model.nv:
        raise InputError(f"of has {count} degrees of freedom; expected {model.nv}, the model's.")
    limits, slides = _limits(thresholds, model), sliding_dofs(model)
    rows = -(-model.nv // 2)
    figure = drawing.pyplot().figure(figsize=(10.0, 0.9 + 1.25 * rows), layout="constrained")
    grid = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for k, dof in enumerate(model.dof_names):
        axes = grid.flat[k]
        _draw_panel(axes, of.t - of.t[0], of.external_torque[:, k], limits[k])
        title = f"{escape(dof)} [{'N' if slides[k] else 'N m'}]"
        axes.set_title(title, fontsize="small", loc="left")
    for axes in grid.flat[model.nv :]:
        axes.set_axis_off()
    for axes in grid.flat[max(0, model.nv - 2) : model.nv]:  # the last of each column
        axes.set_xlabel("time [s]")
        axes.tick_params(labelbottom=True)
    title = f"{escape(model.name)}: external torque"
    figure.suptitle(title, fontsize="medium", x=0.01, ha="left")
    return figure


def _draw_panel(axes: Any, t: Array, torque: Array, limit: float) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
    axes.plot(*envelope(t, torque), color=COLOURS[0], linewidth=0.9)
    if np.isfinite(limit):
        axes.axhspan(-limit, limit, color=GREY, alpha=0.18, linewidth=0, zorder=0)
        beyond = np.where(np.abs(torque) > limit, torque, np.nan)
        axes.plot(*envelope(t, beyond), color=COLOURS[3], linewidth=1.6)
    axes.margins(x=0)
    axes.tick_params(labelsize="small")
    drawing.hide_frame(axes)


def _limits(thresholds: Any, model: RobotModel) -> list[float]:
    """Return the threshold of each degree of freedom, inf without one."""
    thresholds = thresholds.thresholds if isinstance(thresholds, Calibration) else thresholds
    limits = thresholds.joints if isinstance(thresholds, AlarmThresholds) else thresholds or {}
    for joint in limits:
        if joint not in (*model.dof_names, ALL):
            known = ", ".join(model.dof_names)
            raise InputError(f"thresholds has joint {joint!r}; expected one of {known} or {ALL}.")
    return [float(limits.get(dof, limits.get(ALL, np.inf))) for dof in model.dof_names]
