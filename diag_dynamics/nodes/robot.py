"""Which robot a node works with: the parameters that say so, and the model they make of a description."""

from functools import cache

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.model import Payload, load_urdf
from diag_dynamics.model.options import FRICTION_VELOCITY, LARGEST_GRAVITY, inertias_told
from diag_dynamics.model.robot import MAX_COUPLED
from diag_dynamics.model.urdf import MAX_JOINTS, read_urdf
from diag_dynamics.nodes.inputs.joint_states import Joints
from diag_dynamics.nodes.parameters import LARGEST, Spec, assignments

PARAMETERS = {
    "mimic": Spec(
        "embed",
        "Mimic joints: coupled to their leaders (embed), independent (free), or locked (lock).",
        while_unconfigured=True,
        choices=("embed", "free", "lock"),
    ),
    "massless": Spec(
        "error",
        "Joints that move no inertia: refuse the robot (error), or lock them (lock).",
        while_unconfigured=True,
        choices=("error", "lock"),
    ),
    "locked_joints": Spec([""], "Joints that are held, each as joint=position [rad, m].", while_unconfigured=True),
    "armature": Spec(
        [""], "Reflected rotor inertias, each as joint=inertia [kg m^2, prismatic: kg].", while_unconfigured=True
    ),
    "gravity": Spec(
        [0.0, 0.0, -9.81],
        "Acceleration of gravity in the world, for a fixed base the root link [m/s^2]; each within 1000, which nothing a "
        "robot stands on reaches.",
        maximum=LARGEST_GRAVITY,
    ),
    "payloads": Spec(
        [""],
        "Payloads, each as link=mass, link=mass x y z, or link=mass x y z ixx iyy izz ixy ixz iyz: centre of mass and "
        "inertia about it in the link's axes [kg, m, kg m^2]. Those on links that a robot lacks are not applied.",
    ),
    "max_joints": Spec(
        MAX_JOINTS, "Most joints, fixed ones included, of a URDF that is not refused.", while_unconfigured=True
    ),
    "max_coupled": Spec(
        MAX_COUPLED,
        "Most bodies of a group of coupled joints that is not refused: its degrees of freedom and followers.",
        while_unconfigured=True,
    ),
    "floating_base": Spec(
        False, "Whether the root link moves freely; its state then comes from the topic odom.", while_unconfigured=True
    ),
}

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
        Values of :data:`PARAMETERS`; and `friction_velocity`, of a node that has it.

    Raises
    ------
    DiagDynamicsError
        As :func:`load_urdf`; and for a robot with a joint whose state no ROS topic brings.
    """
    node.get_logger().info("Loading a robot.")
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


def single_joints(model):
    """Joints of one degree of freedom, those that joint_states brings, in the model's order."""
    dofs = set(model.dof_names)
    return tuple(name for name in model.joint_names if name in dofs)


def places(names, among):
    """Where each of some names stands among others."""
    place = {name: k for k, name in enumerate(among)}
    return [place[name] for name in names]


def joints_of(model):
    """What assembling joint states has to know of a model."""
    names = single_joints(model)
    at, dof = places(names, model.coordinate_names), places(names, model.dof_names)
    return Joints(
        names,
        model.mimics,
        frozenset(model.continuous_joints),
        model.lower[at],
        model.upper[at],
        model.velocity_limit[dof],
        model.effort_limit[dof],
    )


def payloads_of(entries):
    """:class:`Payload` by link, from the parameter `payloads`.

    Raises
    ------
    InputError
        An entry is no link with 1, 4 or 10 numbers.
    """
    payloads = {}
    for link, text in assignments("payloads", entries, str).items():
        try:
            numbers = [float(number) for number in text.split()]
        except ValueError:
            numbers = []
        if len(numbers) not in (1, 4, 10) or not np.isfinite(numbers).all() or numbers[0] < 0.0:
            raise InputError(
                f"parameter 'payloads' has {link}={text}, expected link= and 1, 4 or 10 finite numbers, no mass below 0."
            )
        if max(map(abs, numbers)) > LARGEST:
            raise InputError(f"parameter 'payloads' has {link}={text}, expected numbers within ±{LARGEST:g}.")
        mass, com, inertia = numbers[0], numbers[1:4] or (0.0, 0.0, 0.0), numbers[4:] or (0.0,) * 6
        xx, yy, zz, xy, xz, yz = inertia
        payloads[link] = Payload(mass, tuple(com), ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    return payloads


def payload_entry(link, payload):
    """Entry of the parameter `payloads`: the inverse of :func:`payloads_of`."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = payload.inertia
    numbers = (payload.mass, *payload.com, xx, yy, zz, xy, xz, yz)
    return f"{link}=" + " ".join(repr(float(number)) for number in numbers)
