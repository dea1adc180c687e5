# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robot as a tree of joints, and the articulated inertia D that each of them feels."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import VectorLike
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel
from diag_dynamics.model.single_joints import sliding_dofs
from diag_dynamics.plot.drawing import COLOURS, GREY, MARK, name, pyplot, text_colour, tidy

TURNS, SLIDES, COMPOSITE = COLOURS[0], COLOURS[3], COLOURS[1]


def tree(of: DiagonalDynamics | RobotModel, q: VectorLike | None = None) -> Any:
    """The tree of a robot's joints, a row for each degree of freedom, and D of each of them on a logarithmic axis.

    D_k [kg m², kg] is what an effort of joint k meets while joints outboard of it are free and all others held (Algorithm
    4.1). A mark shows M_kk, what it meets while those are held, too: D_k ≤ M_kk, and the distance is what coupling takes off.
    At the tips they are the same.

    Parameters
    ----------
    of : DiagonalDynamics or RobotModel
    q : array_like, shape (nq,), optional
        Positions; by default all are zero.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        q has another shape, or matplotlib is not installed.
    """
    dynamics = of if isinstance(of, DiagonalDynamics) else DiagonalDynamics(of)
    model = dynamics.model
    position = model.neutral if q is None else q
    D, composite = dynamics.factors(position).D, np.diag(dynamics.mass_matrix(position))
    at, slides = np.arange(model.nv), np.array(sliding_dofs(model), dtype=bool)
    figure = pyplot().figure(figsize=(9.0, 1.3 + 0.3 * max(model.nv, 2)), layout="constrained")
    names, bars = figure.subplots(1, 2, sharey=True, width_ratios=(0.9, 1.6))
    depth = _joints(names, model)
    low = 0.5 * min(D.min(initial=1.0), 1.0)
    for turning, colour, label in ((~slides, TURNS, "D, turns [kg m²]"), (slides, SLIDES, "D, slides [kg]")):
        if turning.any():
            bars.barh(at[turning], D[turning] - low, left=low, height=0.62, color=colour, label=label)
    bars.plot(composite, at, color=COMPOSITE, label="M_kk: outboard joints held", **MARK)
    bars.set_xscale("log")
    bars.set_xlim(low, 3.0 * max(composite.max(initial=low), low))
    for y in at.tolist():
        bars.text(max(D[y], composite[y]) * 1.12, y, f"{D[y]:.3g}", va="center", fontsize="small")
    bars.set_ylim(model.nv - 0.4, -0.6)
    bars.set_xlabel("inertia that an effort of the joint meets" + (" [kg m², kg]" if slides.any() else " [kg m²]"))
    bars.tick_params(left=False, labelleft=False)
    bars.legend(
        frameon=False, fontsize="small", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2
    )
    bars.spines["left"].set_visible(False)
    tidy(bars)
    names.set_xlim(-0.5, depth + 6.0)
    names.set_axis_off()
    names.set_title(name(model.name), fontsize="medium", loc="left")
    return figure


def _joints(axes: Any, model: RobotModel) -> int:
    """Draw names of degrees of freedom, each indented below the one that carries it; return how deep the tree is.

    A chain is not indented, or that of an arm would leave no room: only where the tree branches does a row step inward.
    """
    bodies = model.bodies
    own = {int(bodies["dof"][k]): k for k in range(1, len(bodies)) if bodies["owner"][k] == k}
    dof_of = {k: dof for dof, k in own.items()}

    def carrier(k: int) -> int:
        """Degree of freedom next to the base from this one; -1 if there is none."""
        parent = int(bodies["parent"][k])
        while parent and parent not in dof_of:
            parent = int(bodies["parent"][parent])
        return dof_of.get(parent, -1)

    parents = [carrier(own[dof]) for dof in range(model.nv)]
    children: dict[int, int] = {}
    for parent in parents:
        children[parent] = children.get(parent, 0) + 1
    indent = {-1: 0}
    for dof, parent in enumerate(parents):
        indent[dof] = indent[parent] + (children[parent] > 1)
    for dof, parent in enumerate(parents):
        x, above = indent[dof], indent[parent]
        if parent >= 0:
            axes.plot([above, above, x], [parent, dof, dof], color=GREY, linewidth=1.2, zorder=1)
        axes.plot([x], [dof], marker="o", markersize=5, color=text_colour(), zorder=2)
        axes.text(x + 0.35, dof, name(model.dof_names[dof]), va="center", fontsize="small")
    return max(indent.values())
