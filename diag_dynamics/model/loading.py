# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The way from a URDF to a RobotModel."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import IO, Any, Literal

from diag_dynamics.arrays import VectorLike
from diag_dynamics.checks import choice, not_negative, whole
from diag_dynamics.exceptions import InertiaWarning
from diag_dynamics.model.flexible_links import (
    read_flexible_links,
    with_flexible_links,
)
from diag_dynamics.model.geometry import estimated
from diag_dynamics.model.inertias import Payload, checked_payloads, not_physical
from diag_dynamics.model.loop_elements import curves_of, loops_of
from diag_dynamics.model.loops import (
    Loop,
    read_couplings,
)
from diag_dynamics.model.options import (
    FRICTION_VELOCITY,
    MAX_COUPLED,
    Options,
    checked_armature,
    checked_gravity,
    checked_locked,
)
from diag_dynamics.model.parameters import (
    Parameters,
    apply_parameters,
    read_parameters,
)
from diag_dynamics.model.remarks import remarks_of, warn, warning_of
from diag_dynamics.model.robot import RobotModel, model_of
from diag_dynamics.model.sources import expanded, folder_of, urdf_text
from diag_dynamics.model.transmissions import driven_joints, reflected_inertias
from diag_dynamics.model.urdf import MAX_JOINTS, parse_urdf, read_urdf


def load_urdf(
    source: str | bytes | os.PathLike[str] | IO[Any],
    floating_base: bool = False,
    gravity: VectorLike = (0.0, 0.0, -9.81),
    mimic: Literal["embed", "free", "lock"] = "embed",
    massless: Literal["error", "lock"] = "error",
    locked_joints: Mapping[str, float] | None = None,
    armature: Mapping[str, float] | float | None = None,
    payloads: Mapping[str, Payload | tuple[Any, ...]] | None = None,
    max_joints: int = MAX_JOINTS,
    max_coupled: int = MAX_COUPLED,
    friction_velocity: float | None = None,
    xacro_args: Mapping[str, Any] | None = None,
    estimate_inertias: float | None = None,
    parameters: str | os.PathLike[str] | Parameters | Mapping[str, Any] | None = None,
    loops: str
    | os.PathLike[str]
    | Mapping[str, Any]
    | Sequence[Loop | Mapping[str, Any]]
    | None = None,
) -> RobotModel:
    """Build a model from a URDF; meshes are read by `estimate_inertias` only.

    Parameters
    ----------
    source : str, bytes, os.PathLike or file
        Path of a URDF file, an open one, or XML text. The package `xacro`, if installed, expands a
        file whose name ends with .xacro; its arguments may follow the path: ``"arm.urdf.xacro
        prefix:=left_"``.
    floating_base : bool
        Whether the root link moves freely.
    gravity : array_like, shape (3,)
        See :class:`RobotModel`; within ±1000 m/s².
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
    max_joints, max_coupled : int
        Maximum number of joints, fixed ones included, and of bodies of a coupled group. Loading
        takes time in proportion to the former, an evaluation as the cube of the latter.
    friction_velocity : float
        v₀ of Coulomb friction f tanh(q̇/v₀) [rad/s, m/s]; 0 for f sign(q̇). By default that of
        `parameters`, or 5e-3.
    xacro_args : dict
        Arguments of a xacro file, by name.
    estimate_inertias : float
        Density [kg/m³] of links that have geometry and no <inertial>. It opens the files that the
        URDF names, so it is not for untrusted descriptions; meshes need trimesh.
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
        A mimic joint has no valid source, or a coupled group is too large.
    LoopError
        A loop cannot be closed from its start values, or its independent joints are not as many as
        it has.
    MasslessLinkError
        Joints move no inertia: the mass matrix would be singular.

    Warns
    -----
    ModelWarning
        The URDF has probable mistakes. InertiaWarning: a link's inertia is not that of any rigid
        body, or was estimated.
    """
    choice("mimic", mimic, ("embed", "free", "lock"))
    choice("massless", massless, ("error", "lock"))
    g = checked_gravity(gravity)
    folder, source = folder_of(source), expanded(source, xacro_args)
    found = None
    if estimate_inertias is not None:
        found = estimated(urdf_text(source), estimate_inertias, folder)
        source = found.text
    element = parse_urdf(urdf_text(source))
    of_file, curves = read_couplings(loops, loops_of(element), curves_of(element))
    robot, root = read_urdf(element, whole("max_joints", max_joints))
    given = Parameters() if parameters is None else read_parameters(parameters)
    robot = apply_parameters(robot, given)
    rotors, ignored = reflected_inertias(element)
    if mistakes := warning_of(robot.name, [*remarks_of(element), *ignored]):
        warn(mistakes)
    if found and found.warning:
        warn(f"robot '{robot.name}': {found.warning}", InertiaWarning)
    for link in robot.links:
        reason = (
            None
            if link.inertial is None
            else not_physical(link.inertial.inertia, link.inertial.mass)
        )
        if reason and link.name not in given.lighter_links:
            text = f"link '{link.name}' of robot '{robot.name}' has an inertia {reason}: no rigid body is like that."
            warn(text, InertiaWarning)
    rotors = {
        name: inertia for name, inertia in rotors.items() if name not in given.flexible_joints
    }
    robot, flexible = with_flexible_links(robot, read_flexible_links(loops))
    v_0 = next(
        (v for v in (friction_velocity, given.friction_velocity) if v is not None),
        FRICTION_VELOCITY,
    )
    options = Options(
        floating_base=bool(floating_base),
        gravity=g,
        mimic=mimic,
        massless=massless,
        locked=checked_locked({} if locked_joints is None else locked_joints, robot),
        armature=rotors | given.by_joint("armature") | checked_armature(armature, robot),
        effort_offset=given.by_joint("effort_offset"),
        load_friction=given.by_joint("load_friction"),
        root_friction=given.by_joint("root_friction"),
        effort_scale=given.by_joint("effort_scale"),
        couplings=dict(given.couplings),
        motor_efforts=given.motor_efforts,
        payloads=checked_payloads({} if payloads is None else payloads, robot),
        max_coupled=whole("max_coupled", max_coupled),
        friction_velocity=not_negative("friction_velocity", v_0, "[rad/s, m/s]"),
        estimated_links=tuple(estimate.link for estimate in found.estimates) if found else (),
        loops=of_file,
        curves={} if mimic == "free" else curves,
        driven=driven_joints(element),
        omitted=(),
        held={},
        flexible_joints=dict(given.flexible_joints),
        flexible_links=flexible,
    )
    return model_of(robot, root, options, given)
