# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that describe the robot, shared by the nodes."""

import numpy as np

from diag_dynamics.entries import LARGEST, assignments
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import Payload
from diag_dynamics.model.options import LARGEST_GRAVITY
from diag_dynamics.model.robot import MAX_COUPLED
from diag_dynamics.model.urdf import MAX_JOINTS
from diag_dynamics.parameters.spec import Spec

PARAMETERS = {
    "mimic": Spec(
        "embed",
        "Mimic joints: coupled to their leaders (embed), independent (free), or locked (lock).",
        read_only=True,
        choices=("embed", "free", "lock"),
    ),
    "massless": Spec(
        "error",
        "What to do about joints that move no inertia: refuse the robot (error), or lock them (lock).",
        read_only=True,
        choices=("error", "lock"),
    ),
    "locked_joints": Spec([""], "Joints that are held, each as joint=position [rad, m].", read_only=True),
    "armature": Spec([""], "Reflected rotor inertias, each as joint=inertia [kg m^2, prismatic: kg].", read_only=True),
    "parameters_file": Spec(
        "",
        "YAML file of parameters beside the URDF, as diag-dynamics identify writes it: friction, offset of the effort and "
        "rotor inertia of each joint, inertias of links, payloads. armature has precedence over it.",
        read_only=True,
    ),
    "gravity": Spec(
        [0.0, 0.0, -9.81],
        "Acceleration of gravity in the world, whose axes for a fixed base are those of the root link [m/s^2].",
        maximum=LARGEST_GRAVITY,
    ),
    "payloads": Spec(
        [""],
        "Payloads, each as link=mass, link=mass x y z, or link=mass x y z ixx iyy izz ixy ixz iyz: centre of mass and "
        "inertia about it in the link's axes [kg, m, kg m^2]. Those on links that a robot lacks are not applied.",
    ),
    "max_joints": Spec(MAX_JOINTS, "Most joints, fixed ones included, of a URDF that is not refused.", read_only=True),
    "max_coupled": Spec(
        MAX_COUPLED,
        "Most bodies of a group of coupled joints, its degrees of freedom and its followers, that is not refused. Every "
        "state takes time as the cube of that number.",
        read_only=True,
    ),
    "floating_base": Spec(
        False, "Whether the root link moves freely; its state then comes from the topic odom.", read_only=True
    ),
}


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
