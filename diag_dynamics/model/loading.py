# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The way from a URDF to a RobotModel."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import IO, Any, Literal

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import choice, not_negative
from diag_dynamics.description.catalog import robot_path
from diag_dynamics.description.check_table import warn, warn_of
from diag_dynamics.description.constraints import read_couplings, with_couplings
from diag_dynamics.description.description import Description, Loop, Payload
from diag_dynamics.description.flexible_links import with_flexible_links
from diag_dynamics.description.mjcf import read_mjcf
from diag_dynamics.description.options import (
    with_armature,
    with_gravity,
    with_locked_joints,
    with_payloads,
)
from diag_dynamics.description.parameters import Parameters, read_parameters, with_parameters
from diag_dynamics.description.remarks import unphysical
from diag_dynamics.description.urdf import describe_urdf, parse_urdf
from diag_dynamics.description.urdf_text import expanded, urdf_text
from diag_dynamics.exceptions import LoopWarning
from diag_dynamics.model.robot import RobotModel, build

LoopsLike = str | os.PathLike[str] | Mapping[str, Any] | Sequence[Loop | Mapping[str, Any]] | None

NEAR_SINGULAR = np.sin(np.radians(10.0))
"""Cosine of the middle angle of a ball joint's hinges below which there is a warning."""


def load_urdf(
    source: str | bytes | os.PathLike[str] | IO[Any] | Description,
    floating_base: bool = False,
    gravity: VectorLike | None = None,
    mimic: Literal["embed", "free", "lock"] = "embed",
    massless: Literal["error", "lock"] = "error",
    locked_joints: Mapping[str, float] | None = None,
    armature: Mapping[str, float] | float | None = None,
    payloads: Mapping[str, Payload | tuple[Any, ...]] | None = None,
    friction_velocity: float | None = None,
    xacro_args: Mapping[str, Any] | None = None,
    parameters: str | os.PathLike[str] | Parameters | Mapping[str, Any] | None = None,
    loops: LoopsLike = None,
) -> RobotModel:
    """Build a model from a URDF, whose meshes are not read.

    Parameters
    ----------
    source : str, bytes, os.PathLike, file or Description
        Path of a URDF file, an open one, or XML text. The package `xacro`, if installed, expands a
        file whose name ends with .xacro; its arguments may follow the path: ``"arm.urdf.xacro
        prefix:=left_"``. A description has been read already.
    floating_base : bool
        Whether the root link moves freely.
    gravity : array_like, shape (3,)
        See :class:`RobotModel`; within ±1000 m/s². By default that of an MJCF, or 9.81 m/s² against
        z.
    mimic : {"embed", "free", "lock"}
        Treatment of mimic joints: couple them to their leaders, exactly; treat them as independent;
        or lock them at the positions that belong to leaders at zero, or at their locked positions.
    massless : {"error", "lock"}
        Treatment of joints that move no inertia: raise, or lock them at zero or the position limit
        next to it.
    locked_joints : dict
        Positions [rad, m] of locked joints. These numbers, and those of `armature` and `payloads`,
        are within ±1e9; those of the URDF within ±1e30.
    armature : dict or float
        Reflected rotor inertia [kg m², prismatic: kg] by joint name, or one number for all joints
        of one degree of freedom. It replaces that of `parameters`, which replaces N²J of the URDF's
        transmissions.
    payloads : dict
        :class:`Payload`, or a tuple of its fields, by link name.
    friction_velocity : float
        v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s]; 0 for f sign(q̇). By default that of
        `parameters`, or 5e-3.
    xacro_args : dict
        Arguments of a xacro file, by name.
    parameters : str, os.PathLike, Parameters or dict
        Parameters beside the URDF; `armature` and `friction_velocity` have precedence over those in
        it.
    loops : str, os.PathLike, dict or list
        Closed loops, non-linear mimic joints and flexible links: a YAML file or its content, or a
        list of :class:`Loop`. Loops that the URDF describes are closed without it; ``[]`` opens
        them.

    Raises
    ------
    UrdfError
        The URDF is malformed, not a tree, or too large; or a xacro file cannot be expanded.
    MimicJointError
        A mimic joint has no valid source.
    LoopError
        A loop cannot be closed from its start values, or its independent joints are not as many as
        it has.
    MasslessLinkError
        Joints move no inertia: the mass matrix would be singular.

    Warns
    -----
    ModelWarning
        The URDF has probable mistakes. InertiaWarning: a link's inertia is not that of any rigid
        body.
    """
    source = expanded(source, xacro_args)
    if not isinstance(source, Description):
        source = describe_urdf(parse_urdf(urdf_text(source)))
    choice("mimic", mimic, ("embed", "free", "lock"))
    choice("massless", massless, ("error", "lock"))
    description = source
    couplings = None
    if loops is not None:
        couplings = read_couplings(loops)
        description = with_couplings(description, couplings)
    additional = None
    if parameters is not None:
        additional = read_parameters(parameters)
        description = with_parameters(description, additional)
    _warn_of_mistakes(description, additional)
    if couplings is not None:
        description = with_flexible_links(description, couplings)
    if armature is not None:
        description = with_armature(description, armature)
    if friction_velocity is not None:
        velocity = not_negative("friction_velocity", friction_velocity, "[rad/s, m/s]")
        description = description._replace(friction_velocity=velocity)
    if locked_joints is not None:
        locked = with_locked_joints(description, locked_joints).locked
        description = description._replace(locked={**description.locked, **locked})
    if gravity is not None:
        description = with_gravity(description, gravity)
    if payloads is not None:
        description = with_payloads(description, payloads)
    floating_base = bool(floating_base or description.floating_base)
    model = build(
        description._replace(floating_base=floating_base, mimic=mimic, massless=massless),
        additional,
    )
    _warn_of_balls(model)
    return model


def _warn_of_mistakes(description: Description, additional: Parameters | None) -> None:
    """Warn of probable mistakes and of inertias, but for links that a payload lightens."""
    lighter = [] if additional is None else additional.lighter_links
    links = [link for link in description.links.values() if link.name not in lighter]
    warn_of(description.name, [*description.remarks, *unphysical(links)])


def _warn_of_balls(model: RobotModel) -> None:
    """Warn of ball joints that are near the singularity of their hinges at the start."""
    for name, angle in singular_balls(model, model.start).items():
        warn(
            f"ball joint '{name}' of robot '{model.name}' is at {np.degrees(angle):.3g}° about "
            "its y axis at the start; its three hinges are singular at ±90°. Turn the axes of "
            "its body in the file.",
            LoopWarning,
        )


def singular_balls(model: RobotModel, q: Array) -> dict[str, float]:
    """Return angles of middle hinges [rad] of ball joints within 10° of ±90°, by ball joint."""
    if not model.description.balls:
        return {}
    angles = dict(zip(model.coordinate_names, q.tolist(), strict=True))
    if model.followers:
        followers = model.followers_at(q)
        angles |= dict(zip(followers.names, followers.position.tolist(), strict=True))
    balls = {name: angles.get(f"{name}_y", 0.0) for name in model.description.balls}
    return {name: angle for name, angle in balls.items() if abs(np.cos(angle)) < NEAR_SINGULAR}


def load_robot(name: str, **options: Any) -> RobotModel:
    """Build the model of a robot by its name.

    Parameters
    ----------
    name : str
        One that ``diag-dynamics robots`` lists: ``panda``, or a robot of `example-robot-data`
        (``ur5``) by its key or its file's name; or one of `robot_descriptions`
        (``panda_description``), which it clones on first use.
    **options
        Those of :func:`load_urdf`, whose errors it has.
    """
    return load_urdf(robot_path(name), **options)


def load_mjcf(source: str | os.PathLike[str], **options: Any) -> RobotModel:
    """Build a model from an MJCF; `mujoco` has to be installed.

    `source` is the path of a file, or XML text. Options are those of :func:`load_urdf` without
    `xacro_args`. `gravity` and `armature` have precedence over the file. Its single free body is a
    floating base with any `floating_base`.

    Joints that an equality couples are mimic joints; one without joint2 locks its joint at
    polycoef[0], unless locked_joints has another position. Connect and weld are rigid closed
    loops. A ball joint is three hinges at one point about x, y and z of its body, ``NAME_x``,
    ``NAME_y`` and ``NAME_z``; at ±90° of the second they are singular.

    Names are the file's, or ``body<number>`` and ``joint<number>``. A single free body is a
    floating base. Degrees of freedom are in the order of :class:`RobotModel`, which need not be
    MuJoCo's. Forward and inverse dynamics omit some forces, such as those of springs: a
    ModelWarning names them, and `RobotModel.omitted` has them.

    Raises
    ------
    UrdfError
        MuJoCo rejects the file.
    UnsupportedError
        The file has what changes M, C, ν or K and cannot be modelled: equalities other than that of
        a joint, connect or weld, or armature of a ball or free joint, a tendon, or an actuator
        elsewhere than at a hinge or slide.

    Warns
    -----
    ModelWarning
        Forces are omitted.
    LoopWarning
        The start is within 10° of the singularity of a ball joint's hinges. `inspect` and `analyse`
        name these, too; nodes do not read an MJCF.
    """
    return load_urdf(read_mjcf(source), **options)
