# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balance of power: how much of the change of energy the model and the efforts explain, and when they do not."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.checks import instance
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.plot.drawing import COLOURS, GREY, envelope, name, parted, pyplot, text_colour, tidy
from diag_dynamics.plot.given import require_states
from diag_dynamics.recordings.balance import MIN_EXPLAINED, NOTHING_EXPLAINED, Balance, Windows, WindowSums
from diag_dynamics.recordings.findings import without_efforts
from diag_dynamics.recordings.recording import SIZE, Recording


def balance(of: Recording) -> Any:
    """Balance of power over windows of 0.1 s [W]: dK/dt, what the efforts, gravity and friction explain of it, and the rest.

    The rest is what pushes the robot, and what the model lacks: νᵀ(ε − ε_g − ε_fric) = dK/dt without both (Lemma 7.2).

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
        There are no states, no efforts, or no window in which all states have them; or matplotlib is not installed.
    """
    instance("what is plotted", of, Recording)
    require_states(of)
    if of.tau is None:
        raise InputError(f"{without_efforts(of.counts)}, without which there is no balance of power.")
    windows, judged = _windows(of)
    if not len(windows.kinetic):
        raise InputError(f"there is no balance of power: {judged.judgement()}.")
    middle = 0.5 * ((windows.begin - of.stamp[0]) + (windows.end - of.stamp[0])) * 1e-9
    figure = pyplot().figure(figsize=(9.0, 4.6), layout="constrained")
    both, rest = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    at, powers = parted(
        middle, np.stack([windows.kinetic, windows.kinetic - windows.residual, windows.residual], axis=1)
    )
    kinetic, explained, residual = powers.T
    parts = "efforts, gravity and friction" if of.model.has_friction else "efforts and gravity"
    both.plot(*envelope(at, kinetic), color=COLOURS[4], linewidth=2.6, label="dK/dt")
    both.plot(*envelope(at, explained), color=text_colour(), linewidth=0.9, label=f"explained by {parts}")
    rest.plot(*envelope(at, residual), color=COLOURS[3], linewidth=1.0)
    for axes, label in ((both, "power [W]"), (rest, "rest [W]")):
        axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
        axes.set_ylabel(label)
        axes.margins(x=0)
        tidy(axes)
    rest.set_xlabel("time [s]")
    both.legend(
        frameon=False, fontsize="small", ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2
    )
    both.set_title(f"{name(of.model.name)}{_share(judged)}", fontsize="medium", loc="left")
    return figure


def _share(judged: Balance) -> str:
    """What is explained, in words: of a slow robot's dK/dt nothing is, while all but a little is of d(K + U)/dt."""
    explained, total, what = judged.explained, judged.explained_total, "dK/dt"
    if explained is None:
        return ""
    if explained < NOTHING_EXPLAINED and total is not None and total >= MIN_EXPLAINED:
        explained, what = total, "d(K + U)/dt"
    return f": {100 * explained:.1f} % of {what} explained" if explained > 0.0 else f": nothing of {what} explained"


def _windows(recording: Recording) -> tuple[Windows, Balance]:
    """Windows of all states, and what they say."""
    model, states = recording.model, recording.states
    dynamics, sums, judged = DiagonalDynamics(model), WindowSums(model.nv, model.has_friction), Balance(model.dof_names)
    found = []
    for first in range(0, len(states), SIZE):
        part = states[first : first + SIZE]
        efforts = np.where(part.effort_known[:, None], part.effort, 0.0)
        s = dynamics.evaluate_batch(part.position, part.velocity, efforts, friction=model.has_friction)
        found.append(sums.take(part, s))
        judged.take(found[-1])
    return Windows(*(np.concatenate(column) for column in zip(*found, strict=True))), judged
