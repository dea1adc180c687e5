# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tree of a robot's joints with D, and the ellipsoid of JM⁻¹Jᵀ at a link."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, PointLike, VectorLike
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel, end_effector_link
from diag_dynamics.model.single_joints import sliding_dofs
from diag_dynamics.plot import drawing
from diag_dynamics.plot.drawing import COLOURS, GREY, escape, set_title
from diag_dynamics.text import number

LARGEST = 0.25  # longest half axis over the robot's size


def tree(of: DiagonalDynamics | RobotModel, q: VectorLike | None = None) -> Any:
    """Plot the tree of joints, and D and M_kk of each degree of freedom on a logarithmic axis.

    D_k [kg m², kg] is the inertia that an effort of joint k accelerates while the joints outboard
    of it are free and all others locked (Algorithm 4.1); with those locked, too, it is M_kk ≥ D_k.

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
    D, M = dynamics.factors(position).D, np.diag(dynamics.mass_matrix(position))
    rows, slides = np.arange(model.nv), np.array(sliding_dofs(model), dtype=bool)
    size = (9.0, 1.3 + 0.3 * max(model.nv, 2))
    figure = drawing.pyplot().figure(figsize=size, layout="constrained")
    names, bars = figure.subplots(1, 2, sharey=True, width_ratios=(0.9, 1.6))
    low = 0.5 * min(D.min(initial=1.0), 1.0)
    of_kinds = ((~slides, COLOURS[0], "turns [kg m²]"), (slides, COLOURS[3], "slides [kg]"))
    for chosen, colour, label in of_kinds:
        if chosen.any():
            style = {"height": 0.62, "color": colour, "label": f"D, {label}"}
            bars.barh(rows[chosen], D[chosen] - low, left=low, **style)
    bars.plot(M, rows, color=COLOURS[1], label="M_kk: outboard joints locked", **drawing.MARK)
    bars.set_xscale("log")
    bars.set_xlim(low, 3.0 * max(M.max(initial=low), low))
    for y in rows.tolist():
        bars.text(max(D[y], M[y]) * 1.12, y, number(D[y]), va="center", fontsize="small")
    bars.set_ylim(model.nv - 0.4, -0.6)
    unit = "[kg m², kg]" if slides.any() else "[kg m²]"
    bars.set_xlabel(f"inertia that an effort of the joint accelerates {unit}")
    bars.tick_params(left=False, labelleft=False)
    place = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
    bars.legend(frameon=False, fontsize="small", ncols=3, **place)
    bars.spines["left"].set_visible(False)
    drawing.hide_frame(bars)
    names.set_xlim(-0.5, _draw_names(names, model) + 6.0)
    names.set_axis_off()
    set_title(names, model.name)
    return figure


def _draw_names(axes: Any, model: RobotModel) -> int:
    """Draw degrees of freedom, indented where the tree branches; return the largest indent."""
    parents = _carriers(model)
    indent = {-1: 0}
    for dof, parent in enumerate(parents):
        x = indent[dof] = indent[parent] + (parents.count(parent) > 1)
        if parent >= 0:
            above = indent[parent]
            axes.plot([above, above, x], [parent, dof, dof], color=GREY, linewidth=1.2, zorder=1)
        axes.plot([x], [dof], marker="o", markersize=5, color=drawing.text_colour(), zorder=2)
        axes.text(x + 0.35, dof, escape(model.dof_names[dof]), va="center", fontsize="small")
    return max(indent.values())


def _carriers(model: RobotModel) -> list[int]:
    """Return the degree of freedom that carries each one, -1 without."""
    bodies, of_body, carriers = model.bodies, {0: -1}, {}
    for k in range(1, len(bodies)):
        carrier = of_body[int(bodies["parent"][k])]
        is_free = bodies["owner"][k] == k
        of_body[k] = int(bodies["dof"][k]) if is_free else carrier
        if is_free:
            carriers[of_body[k]] = carrier
    return [carriers[dof] for dof in range(model.nv)]


def ellipsoid(
    of: DiagonalDynamics | RobotModel,
    q: VectorLike,
    link: str | None = None,
    qd: VectorLike | None = None,
    point: PointLike = (0.0, 0.0, 0.0),
    ax: Any = None,
) -> Any:
    """Plot the ellipsoid of the linear part of JM⁻¹Jᵀ at a point of a link [1/kg], on a sketch [m].

    Half axes are roots of eigenvalues: speeds at the same kinetic energy; at their ends stand the
    effective masses of a push [kg]. With `qd`, an arrow is the velocity, the title has its mass.

    Parameters
    ----------
    of : DiagonalDynamics or RobotModel
    q : array_like, shape (nq,)
        Positions.
    link : str, optional
        Name of the link; by default the end-effector link.
    qd : array_like, shape (nv,), optional
        Rates [rad/s, m/s].
    point : array_like, shape (3,)
        From the link's origin in the link's axes [m].
    ax : mpl_toolkits.mplot3d.Axes3D, optional
        By default those of a new figure.

    Returns
    -------
    mpl_toolkits.mplot3d.Axes3D

    Raises
    ------
    InputError
        No such link, a vector of another shape, or matplotlib is not installed.
    """
    dynamics = of if isinstance(of, DiagonalDynamics) else DiagonalDynamics(of)
    model = dynamics.model
    link = end_effector_link(model) if link is None else link
    roots, directions = _roots(dynamics.operational_inverse_inertia(q, link, point, "world")[:3, :3])
    X = dynamics.placement(q, link)
    centre = X[:3, :3] @ np.asarray(point, dtype=float) + X[:3, 3]
    origins = {name: dynamics.placement(q, name)[:3, 3] for name in model.link_names}
    points = np.array([*origins.values(), centre])
    reach = LARGEST * max(float(np.ptp(points, axis=0).max()), 0.1)
    half_axes = directions * (roots * reach / max(float(roots.max()), 1e-300))
    axes = drawing.make_axes(ax, (6.4, 5.6), "3d")
    _draw_robot(axes, model, origins)
    _draw_ellipsoid(axes, centre, half_axes, roots)
    title = f", {escape(link)}: JM⁻¹Jᵀ"
    if qd is not None:
        v = dynamics.link_velocity(q, qd, link, point, frame="world")[:3]
        speed = float(np.linalg.norm(v))
        title += f"; |v| = {number(speed)} m/s"
        if speed > 0.0:
            title += f", mass along v {number(dynamics.reflected_mass(q, link, v, point, 'world'))} kg"
            axes.quiver(*centre, *(v * 1.6 * reach / speed), color=COLOURS[1], linewidth=2.2)
    _set_limits(axes, np.vstack([points, centre - reach, centre + reach]))
    set_title(axes, model.name, title)
    return axes


def _roots(inverse: Array) -> tuple[Array, Array]:
    """Return roots of eigenvalues, zero where they are rounding errors, and directions."""
    values, directions = np.linalg.eigh(inverse)
    kept = np.where(values > 1e-12 * values.max(initial=0.0), values, 0.0)
    return np.sqrt(kept), directions


def _draw_robot(axes: Any, model: RobotModel, origins: dict[str, Array]) -> None:
    """Draw lines between the origins of moving links."""
    bodies, style = model.bodies, {"color": GREY, "linewidth": 3, "marker": "o", "markersize": 4}
    names = [model.root_link, *(model.link_names[k] for k in bodies["link"][1:])]
    for name, parent in zip(names[1:], bodies["parent"][1:], strict=True):
        axes.plot(*np.stack([origins[names[parent]], origins[name]]).T, **style)


def _draw_ellipsoid(axes: Any, centre: Array, half_axes: Array, roots: Array) -> None:
    around, along = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 41), np.linspace(0.0, np.pi, 21))
    x, y, z = np.cos(around) * np.sin(along), np.sin(around) * np.sin(along), np.cos(along)
    surface = np.einsum("ij,jkl->ikl", half_axes, np.stack([x, y, z])) + centre[:, None, None]
    axes.plot_surface(*surface, color=COLOURS[0], alpha=0.25, linewidth=0)
    for root, half in zip(roots, half_axes.T, strict=True):
        if root > 0.0:
            axes.plot(*np.stack([centre - half, centre + half]).T, color=COLOURS[3], linewidth=1)
            mass = f"{number(1.0 / root**2)} kg"
            axes.text(*(centre + 1.15 * half), mass, fontsize="small", ha="center")


def _set_limits(axes: Any, points: Array) -> None:
    """Set equal scales around all points, and faint panes."""
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low)
    for axis, label in ((axes.xaxis, "x [m]"), (axes.yaxis, "y [m]"), (axes.zaxis, "z [m]")):
        axis.set_label_text(label, fontsize="small")
        axis.set_pane_color((0.5, 0.5, 0.5, 0.06))
    axes.locator_params(nbins=4)
    axes.tick_params(labelsize="x-small")
