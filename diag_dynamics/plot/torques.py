# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque of each joint over time, with the thresholds of its alarms."""

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
from diag_dynamics.plot.drawing import COLOURS, GREY, check_named, envelope, name, pyplot, tidy
from diag_dynamics.recordings.observer import Observed, observe
from diag_dynamics.recordings.recording import Recording


def external_torque(
    of: Recording | Observed,
    thresholds: Calibration | AlarmThresholds | Mapping[str, float] | None = None,
    *,
    gain: float = 25.0,
    model: RobotModel | None = None,
) -> Any:
    """External torque of each joint over time [N m, N], as a disturbance observer sees it; a panel for each joint.

    What is beyond the joint's threshold is drawn in another colour. Gaps are states without a result.

    Parameters
    ----------
    of : Recording or Observed
        What is observed here, or has been by :func:`diag_dynamics.observe`.
    thresholds : Calibration, AlarmThresholds or dict, optional
        Thresholds of joints by name, ``*`` for all others [N m, N].
    gain : float
        Of the observer of a recording [1/s]; a calibration's own has precedence.
    model : RobotModel
        The robot, which an Observed does not name.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        There are no states or no efforts, the robot is missing or another one, or matplotlib is not installed.
    """
    if isinstance(of, Recording):
        model = of.model
        gain = thresholds.gain if isinstance(thresholds, Calibration) else gain
        observed = observe(DiagonalDynamics(model), of, gain)
    elif isinstance(of, Observed):
        observed = of
    else:
        raise InputError(f"what is plotted is {of!r}, expected a Recording or an Observed.")
    if model is None:
        raise InputError("an Observed does not name its joints: model=… is expected.")
    if observed.external_torque.shape[1] != model.nv:
        raise InputError(
            f"what was observed has {observed.external_torque.shape[1]} degrees of freedom, and '{model.name}' {model.nv}."
        )
    t = observed.t - observed.t[0]
    limits = _limits(thresholds, model)
    rows = -(-model.nv // 2)
    figure = pyplot().figure(figsize=(10.0, 0.9 + 1.25 * rows), layout="constrained")
    grid = figure.subplots(rows, 2, sharex=True, squeeze=False)
    slides = sliding_dofs(model)
    for k, dof in enumerate(model.dof_names):
        axes = grid[k // 2, k % 2]
        _panel(axes, t, observed.external_torque[:, k], limits[k])
        axes.set_title(f"{name(dof)} [{'N' if slides[k] else 'N m'}]", fontsize="small", loc="left")
    for axes in grid.flat[model.nv :]:
        axes.set_axis_off()
    for column in range(2):
        last = grid[max(0, (model.nv - 1 - column) // 2), column]
        last.set_xlabel("time [s]")
        last.tick_params(labelbottom=True)
    figure.suptitle(f"{name(model.name)}: external torque", fontsize="medium", x=0.01, ha="left")
    return figure


def _panel(axes: Any, t: Array, torque: Array, limit: float) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
    axes.plot(*envelope(t, torque), color=COLOURS[0], linewidth=0.9)
    if np.isfinite(limit):
        axes.axhspan(-limit, limit, color=GREY, alpha=0.18, linewidth=0, zorder=0)
        beyond = np.where(np.abs(torque) > limit, torque, np.nan)
        axes.plot(*envelope(t, beyond), color=COLOURS[3], linewidth=1.6)
    axes.margins(x=0)
    axes.tick_params(labelsize="small")
    tidy(axes)


def _limits(thresholds: Any, model: RobotModel) -> list[float]:
    """Threshold of each degree of freedom, inf where there is none."""
    if isinstance(thresholds, Calibration):
        thresholds = thresholds.thresholds
    by_name = thresholds.joints if isinstance(thresholds, AlarmThresholds) else thresholds or {}
    for joint in by_name:
        check_named("threshold of joint", joint, (*model.dof_names, ALL))
    return [float(by_name.get(dof, by_name.get(ALL, np.inf))) for dof in model.dof_names]
