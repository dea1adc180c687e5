# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The model of a description, by the parameters of a node, and the compilation of what nodes call."""

from functools import cache

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import UnsupportedError
from diag_dynamics.model import load_urdf
from diag_dynamics.model.catalog import read_source
from diag_dynamics.model.mjcf import is_mjcf
from diag_dynamics.model.remarks import handle_warnings
from diag_dynamics.parameters.robots import model_of
from diag_dynamics.text import plain

MAX_WARNINGS = 20
"""Warnings of a robot that are logged one by one."""

COMPILED = (
    *("evaluate", "factors", "forward_dynamics", "inverse_dynamics", "mass_matrix", "bias", "gravity_torque"),
    *("contact", "nu_from_qd", "qd_from_nu", "placement", "link_velocity", "wrench_factor"),
    *("momentum", "epsilon_from_tau"),
)
"""Methods of DiagonalDynamics that nodes call."""

SMALL = (
    '<robot name="any"><link name="a"/><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
    'ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>'
)
"""A robot to compile for: the matrices of a large one take time, and compiled code is the same for all."""


@cache
def compile_dynamics():
    """Compile what nodes call, or load it from the cache."""
    DiagonalDynamics(load_urdf(SMALL)).compile(*COMPILED)


def text_of(description):
    """Return the URDF text of a description; see :func:`load_robot`."""
    _refuse_mjcf(description)
    return read_source(description).text


def _refuse_mjcf(description):
    """Refuse an MJCF: its gravity and its base would differ from the node's parameters."""
    if is_mjcf(description):
        raise UnsupportedError(
            f"robot_description is '{description}', an MJCF; expected a URDF or xacro file. Nodes do not read MJCFs."
        )


def load_robot(node, description, values):
    """Return the model of a description by parameters of a node, and log its warnings; raise as :func:`model_of`.

    A description is a URDF, or the path of a URDF or xacro file with arguments of xacro behind it.
    """
    _refuse_mjcf(description)
    node.get_logger().info("Loading the robot.")
    warnings = []
    with handle_warnings(warnings.append):
        model = model_of(description, values)
    for text in warnings[:MAX_WARNINGS]:
        node.get_logger().warning(plain(text))
    if len(warnings) > MAX_WARNINGS:
        node.get_logger().warning(f"{len(warnings) - MAX_WARNINGS} more warnings about this robot.")
    return model
