# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a robot: shared by the nodes, and by the library where it reads robots."""

from diag_dynamics.description.options import LARGEST_GRAVITY
from diag_dynamics.entries import ALL, LARGEST, assignments
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import Payload
from diag_dynamics.parameters.spec import Spec, fixed

MIMIC = ("embed", "free", "lock")

NO_PAYLOAD = Payload(0.0)
"""Removes the payload of a link."""

ROBOT = "URDF, or the path of a URDF, an MJCF, or a xacro file followed by NAME:=VALUE arguments"
"""Description of the parameter robot_description."""

_FIXED = {
    "mimic": Spec(
        "embed",
        "Mimic joints: coupled to their source joints, independent, or locked.",
        choices=MIMIC,
    ),
    "massless": Spec(
        "error",
        "Joints that move no inertia: reject the robot, or lock them.",
        choices=("error", "lock"),
    ),
    "locked_joints": Spec(
        [""], "Joints locked at a fixed position, each as joint=position [rad, m]."
    ),
    "armature": Spec(
        [""], "Reflected rotor inertias, each as joint=inertia [kg m^2, prismatic: kg]."
    ),
    "parameters_file": Spec(
        "", "YAML file of friction, offsets, inertias and payloads from diag-dynamics identify."
    ),
    "loops_file": Spec("", "YAML file of closed loops and non-linear mimic joints."),
    "floating_base": Spec(
        False, "Whether the root link moves freely; its state is read from the topic odom."
    ),
}

PARAMETERS = fixed(_FIXED) | {
    "gravity": Spec(
        [0.0, 0.0, -9.81], "Acceleration of gravity in world axes [m/s^2].", maximum=LARGEST_GRAVITY
    ),
    "payloads": Spec(
        [""],
        "Payloads, each as link=mass, link=mass x y z, "
        "or link=mass x y z ixx iyy izz ixy ixz iyz in link axes [kg, m, kg m^2]; "
        "unknown links are ignored with a warning at the start, and rejected later.",
    ),
}
"""Specs by name."""


def payloads_of(entries):
    """Return the :class:`Payload` by link of the parameter `payloads`."""
    payloads = {}
    for link, text in assignments("payloads", entries, str).items():
        try:
            numbers = [float(number) for number in text.split()]
        except ValueError:
            numbers = []
        is_bounded = all(abs(number) <= LARGEST for number in numbers)  # and no NaN
        if len(numbers) not in (1, 4, 10) or not is_bounded or numbers[0] < 0.0:
            expected = f"1, 4 or 10 finite numbers within ±{LARGEST:g}, the mass at least 0"
            raise InputError(f"parameter 'payloads' has {link}={text}; expected {expected}.")
        mass = numbers[0]
        com = numbers[1:4] or (0.0, 0.0, 0.0)
        inertia = numbers[4:] or (0.0,) * 6
        xx, yy, zz, xy, xz, yz = inertia
        payloads[link] = Payload(mass, tuple(com), ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    return payloads


def with_payloads(model, payloads):
    """Return a model with these payloads by link in place of its own."""
    for link in {**model.payloads, **payloads}:
        model = model.with_payload(link, *payloads.get(link, NO_PAYLOAD))
    return model


def check_entries(values):
    """Raise InputError for values of PARAMETERS that are wrong for every robot of a node."""
    payloads_of(values["payloads"])
    for name in ("locked_joints", "armature"):
        entries = values.get(name, ())  # the simulator has no armature
        if ALL in entries:
            raise InputError(f"parameter '{name}' has '{ALL}'; expected names of joints.")
        assignments(name, entries)


def payload_entry(link, payload):
    """Return the entry of the parameter `payloads`, the inverse of :func:`payloads_of`."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = payload.inertia
    numbers = (payload.mass, *payload.com, xx, yy, zz, xy, xz, yz)
    return f"{link}=" + " ".join(repr(float(number)) for number in numbers)
