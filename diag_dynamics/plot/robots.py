# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ellipsoid of JM⁻¹Jᵀ at a link."""

from __future__ import annotations

from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, PointLike, VectorLike
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import RobotModel, end_effector_link
from diag_dynamics.plot import drawing
from diag_dynamics.plot.drawing import COLOURS, GREY, escape, styled
from diag_dynamics.text import number

LARGEST = 0.25  # longest half axis over the robot's size


@styled
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
    """
    dynamics = of if isinstance(of, DiagonalDynamics) else DiagonalDynamics(of)
    model = dynamics.model
    link = end_effector_link(model) if link is None else link
    inverse = dynamics.operational_inverse_inertia(q, link, point, "world")[:3, :3]
    X = dynamics.placement(q, link)
    centre = X[:3, :3] @ np.asarray(point, dtype=float) + X[:3, 3]
    origins = {name: dynamics.placement(q, name)[:3, 3] for name in model.link_names}
    points = np.array([*origins.values(), centre])
    reach = LARGEST * max(float(np.ptp(points, axis=0).max()), 0.1)
    axes = drawing.make_axes(ax, (6.4, 5.6), "3d")
    _draw_robot(axes, model, origins)
    _draw_ellipsoid(axes, centre, inverse, reach)
    title = f"{escape(model.name)}, {escape(link)}: JM⁻¹Jᵀ"
    if qd is not None:
        v = dynamics.link_velocity(q, link, qd, point, frame="world")[:3]
        speed = float(np.linalg.norm(v))
        title += f"; |v| = {number(speed)} m/s"
        if speed > 0.0:
            mass = dynamics.reflected_mass(q, link, v, point, "world")
            title += f", mass along v {number(mass)} kg"
            axes.quiver(*centre, *(v * 1.6 * reach / speed), color=COLOURS[1], linewidth=2.2)
    axes.set_title(title, loc="left")  # in 3D the style does not count
    _scale_axes(axes)
    return axes


def _scale_axes(axes: Any) -> None:
    """Label axes of space and give them equal scales."""
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    sizes = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
    axes.set_box_aspect(sizes, zoom=0.9)  # leaves space for labels
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.label.set_size("small")
    axes.tick_params(labelsize="x-small")
    axes.locator_params(nbins=4)


def _draw_robot(axes: Any, model: RobotModel, origins: dict[str, Array]) -> None:
    """Draw lines between the origins of moving links."""
    bodies, style = model.bodies, {"color": GREY, "linewidth": 3, "marker": "o", "markersize": 4}
    names = [model.root_link, *(model.link_names[k] for k in bodies["link"][1:])]
    for name, parent in zip(names[1:], bodies["parent"][1:], strict=True):
        axes.plot(*np.stack([origins[names[parent]], origins[name]]).T, **style)


def _draw_ellipsoid(axes: Any, centre: Array, inverse: Array, reach: float) -> None:
    values, directions = np.linalg.eigh(inverse)
    roots = np.sqrt(np.where(values > 1e-12 * values.max(), values, 0.0))  # others are rounding
    half_axes = directions * (roots * reach / max(float(roots.max()), 1e-300))
    around, along = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 41), np.linspace(0.0, np.pi, 21))
    x, y, z = np.cos(around) * np.sin(along), np.sin(around) * np.sin(along), np.cos(along)
    surface = np.einsum("ij,jkl->ikl", half_axes, np.stack([x, y, z])) + centre[:, None, None]
    axes.plot_surface(*surface, color=COLOURS[0], alpha=0.25, linewidth=0)
    box = {"facecolor": axes.get_facecolor(), "alpha": 0.6, "linewidth": 0, "pad": 1}
    for root, half in zip(roots, half_axes.T, strict=True):
        if root > 0.0:
            axes.plot(*np.stack([centre - half, centre + half]).T, color=COLOURS[3], linewidth=1)
            mass = f"{number(1.0 / root**2)} kg"
            axes.text(*(centre + 1.3 * half), mass, fontsize="small", ha="center", bbox=box)
