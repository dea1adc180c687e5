# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a link gives way: the ellipsoid of JM⁻¹Jᵀ, drawn on the robot as it stands."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, PointLike, VectorLike
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel, end_effector_link
from diag_dynamics.plot.drawing import COLOURS, GREY, axes_or_new, name
from diag_dynamics.text import number

LARGEST = 0.25
"""Length of the longest half axis, as a part of the robot's size in the plot."""


def ellipsoid(
    of: DiagonalDynamics | RobotModel,
    q: VectorLike,
    link: str | None = None,
    qd: VectorLike | None = None,
    point: PointLike = (0.0, 0.0, 0.0),
    ax: Any = None,
) -> Any:
    """Ellipsoid of the linear part of JM⁻¹Jᵀ at a point of a link [1/kg], on a sketch of the robot [m].

    A half axis is as long as the root of its eigenvalue: with the same kinetic energy the point moves so fast that way. The
    mass that a push meets there, 1 over the eigenvalue, stands at its end [kg]; a direction in which the point cannot move
    has none. With `qd` an arrow shows the point's velocity, and the title the mass along it.

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
        Where to draw, by default in a new figure.

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
    inverse = dynamics.operational_inverse_inertia(q, link, point, "world")[:3, :3]
    values, directions = np.linalg.eigh(inverse)
    roots = np.sqrt(np.where(values > 1e-12 * values.max(initial=0.0), values, 0.0))
    X = dynamics.placement(q, link)
    centre = X[:3, :3] @ np.asarray(point, dtype=float) + X[:3, 3]
    origins = {one: dynamics.placement(q, one)[:3, 3] for one in model.link_names}
    everything = np.array([*origins.values(), centre])
    size = max(float(np.ptp(everything, axis=0).max()), 0.1)
    scale = LARGEST * size / max(float(roots.max()), 1e-300)

    axes = axes_or_new(ax, (6.4, 5.6), "3d")
    _sketch(axes, model, origins)
    _surface(axes, centre, directions * (roots * scale))
    for root, direction in zip(roots, directions.T, strict=True):
        if root > 0.0:
            half = scale * root * direction
            axes.plot(*np.stack([centre - half, centre + half]).T, color=COLOURS[3], linewidth=1)
            axes.text(*(centre + 1.15 * half), f"{number(1.0 / root**2)} kg", fontsize="small", ha="center")
    title = f"{name(model.name)}, {name(link)}: JM⁻¹Jᵀ"
    if qd is not None:
        v = dynamics.link_velocity(q, qd, link, point, frame="world")[:3]
        speed = float(np.linalg.norm(v))
        title += f"; |v| = {number(speed)} m/s"
        if speed > 0.0:
            mass = dynamics.reflected_mass(q, link, v, point, "world")
            title += f", mass along v {number(mass)} kg"
            axes.quiver(*centre, *(v * 1.6 * LARGEST * size / speed), color=COLOURS[1], linewidth=2.2)
    _equal(axes, np.vstack([everything, centre + LARGEST * size * np.array([[1, 1, 1], [-1, -1, -1]])]))
    axes.set_title(title, fontsize="medium", loc="left")
    return axes


def _sketch(axes: Any, model: RobotModel, origins: dict[str, Array]) -> None:
    """Lines from each moving link's origin to that of the link which carries it."""
    bodies = model.bodies
    for k in range(1, len(bodies)):
        parent = bodies["parent"][k]
        carrying = model.link_names[bodies["link"][parent]] if parent else model.root_link
        moved = model.link_names[bodies["link"][k]]
        axes.plot(*np.stack([origins[carrying], origins[moved]]).T, color=GREY, linewidth=3, marker="o", markersize=4)


def _surface(axes: Any, centre: Array, half_axes: Array) -> None:
    """An ellipsoid from its half axes, the columns of a matrix."""
    around, along = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 41), np.linspace(0.0, np.pi, 21))
    sphere = np.stack([np.cos(around) * np.sin(along), np.sin(around) * np.sin(along), np.cos(along)])
    x, y, z = np.einsum("ij,jkl->ikl", half_axes, sphere) + centre[:, None, None]
    axes.plot_surface(x, y, z, color=COLOURS[0], alpha=0.25, linewidth=0)


def _equal(axes: Any, points: Array) -> None:
    """Limits around all points, a metre being as long in each direction; faint panes."""
    low, high = points.min(axis=0), points.max(axis=0)
    for setter, a, b in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high, strict=True):
        setter(a, b)
    axes.set_box_aspect(high - low)
    for axis, label in ((axes.xaxis, "x [m]"), (axes.yaxis, "y [m]"), (axes.zaxis, "z [m]")):
        axis.set_label_text(label, fontsize="small")
        axis.set_pane_color((0.5, 0.5, 0.5, 0.06))
    axes.locator_params(nbins=4)
    axes.tick_params(labelsize="x-small")
