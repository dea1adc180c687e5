"""Which robot a node works with: the parameters that say so, and the model they make of a description."""

import warnings

from diag_dynamics.exceptions import InertiaWarning, InputError, UnsupportedError
from diag_dynamics.model import load_urdf
from diag_dynamics.nodes.parameters import Spec

PARAMETERS = {
    "mimic": Spec(
        "embed",
        "Mimic joints: coupled to their leaders (embed), independent (free), or locked (lock).",
        read_only=True,
        choices=("embed", "free", "lock"),
    ),
    "massless": Spec(
        "error",
        "Joints that move no inertia: refuse the robot (error), or lock them (lock).",
        read_only=True,
        choices=("error", "lock"),
    ),
    "locked_joints": Spec([""], "Joints that are held, each as joint=position [rad, m].", read_only=True),
    "armature": Spec([""], "Reflected rotor inertias, each as joint=inertia [kg m^2, prismatic: kg].", read_only=True),
    "gravity": Spec([0.0, 0.0, -9.81], "Acceleration of gravity in the world, for a fixed base the root link [m/s^2]."),
    "floating_base": Spec(
        False, "Whether the root link moves freely; its state then comes from the topic odom.", read_only=True
    ),
}


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


def load_robot(node, description, values):
    """Model of a description, with warnings of its inertias in the node's log.

    Parameters
    ----------
    node : rclpy.node.Node
    description : str
        URDF or its path.
    values : dict
        Values of :data:`PARAMETERS`.

    Raises
    ------
    DiagDynamicsError
        As :func:`load_urdf`; and for a robot with a joint whose state no ROS topic brings.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InertiaWarning)
        model = load_urdf(
            description,
            floating_base=values["floating_base"],
            gravity=values["gravity"],
            mimic=values["mimic"],
            massless=values["massless"],
            locked_joints=assignments("locked_joints", values["locked_joints"]),
            armature=assignments("armature", values["armature"]),
        )
    for warning in caught:
        node.get_logger().warning(str(warning.message))
    if len(model.joint_names) != len(single_joints(model)) + model.floating_base:
        several = next(n for n in model.joint_names[model.floating_base :] if n not in model.dof_names)
        raise UnsupportedError(
            f"joint '{several}' has several degrees of freedom, and joint_states has no place for its state. "
            "Only a floating base is supported (floating_base, with odom)."
        )
    return model


def single_joints(model):
    """Joints of one degree of freedom, those that joint_states brings, in the model's order."""
    return tuple(name for name in model.joint_names if name in model.dof_names)


def assignments(parameter, entries):
    """Numbers by name from strings such as ``joint=0.5``."""
    numbers = {}
    for entry in entries:
        if not entry:
            continue  # an empty list of strings cannot be told from one of anything else
        name, equals, number = entry.rpartition("=")
        try:
            numbers[name] = float(number)
        except ValueError:
            equals = ""
        if not equals or not name:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected name=number.")
    return numbers
