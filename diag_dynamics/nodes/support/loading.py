"""Which robot a node works with: the parameters that say so, and the model they make of a description."""

from functools import cache

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.entries import assignments
from diag_dynamics.exceptions import UnsupportedError
from diag_dynamics.model import load_urdf
from diag_dynamics.model.options import FRICTION_VELOCITY, inertias_told
from diag_dynamics.model.single_joints import single_joints
from diag_dynamics.model.urdf import read_urdf
from diag_dynamics.model.xacro_files import expanded
from diag_dynamics.parameters.shared import payloads_of

MOST_TOLD = 20
"""Links whose inertias are warned of one by one."""

COMPILED = (
    "evaluate",
    "factors",
    "forward_dynamics",
    "inverse_dynamics",
    "mass_matrix",
    "bias",
    "gravity_torque",
    "nu_from_qd",
    "qd_from_nu",
)
"""Methods of DiagonalDynamics that nodes call."""

ANY = (
    '<robot name="any"><link name="a"/><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
    'ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>'
)
"""A robot to compile for: compiled code is no robot's own, but the matrices of a large one take their time."""


@cache
def compile_dynamics():
    """Compile what nodes call, or load it from the cache."""
    DiagonalDynamics(load_urdf(ANY)).compile(*COMPILED)


def load_robot(node, description, values):
    """Model of a description, with warnings of its inertias in the node's log.

    Parameters
    ----------
    node : rclpy.node.Node
    description : str
        URDF or its path.
    values : dict
        Values of :data:`~parameters.shared.PARAMETERS`; and `friction_velocity`, of a node that has it.

    Raises
    ------
    DiagDynamicsError
        As :func:`load_urdf`; and for a robot with a joint whose state no ROS topic brings.
    """
    node.get_logger().info("Loading a robot.")
    description = expanded(description, None)
    payloads = payloads_of(values["payloads"])
    if payloads:
        links = {link.name for link in read_urdf(description, values["max_joints"])[0].links}
        payloads = {link: payload for link, payload in payloads.items() if link in links}
    told = []
    with inertias_told(told.append):
        model = load_urdf(
            description,
            floating_base=values["floating_base"],
            gravity=values["gravity"],
            mimic=values["mimic"],
            massless=values["massless"],
            locked_joints=assignments("locked_joints", values["locked_joints"]),
            armature=assignments("armature", values["armature"]),
            payloads=payloads,
            max_joints=values["max_joints"],
            max_coupled=values["max_coupled"],
            friction_velocity=values.get("friction_velocity", FRICTION_VELOCITY),
        )
    for text in told[:MOST_TOLD]:
        node.get_logger().warning(text)
    if len(told) > MOST_TOLD:
        node.get_logger().warning(f"{len(told) - MOST_TOLD} more links have such inertias.")
    if len(model.joint_names) != len(single_joints(model)) + model.floating_base:
        single = set(single_joints(model))
        several = next(name for name in model.joint_names[model.floating_base :] if name not in single)
        raise UnsupportedError(
            f"joint '{several}' has several degrees of freedom, and joint_states has no place for its state. "
            "Only a floating base is supported (floating_base, with odom)."
        )
    return model
