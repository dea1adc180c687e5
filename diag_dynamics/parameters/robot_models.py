# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models of the robots of nodes and recordings, by their parameters."""

from diag_dynamics.description.catalog import describe
from diag_dynamics.description.mjcf import is_mjcf
from diag_dynamics.entries import ALL, assignments
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.model import load_urdf
from diag_dynamics.model.joint_types import single_joints
from diag_dynamics.parameters.shared import PARAMETERS, payloads_of


def model_of(description, values, recorded=None):
    """Return the model of a description; ``joint_states`` has a place for every joint.

    Parameters
    ----------
    description : str or bytes
        URDF; or the path of a URDF, a xacro file with its arguments, or an MJCF. An MJCF determines
        whether the base floats; its gravity counts where the parameter has its default, its
        armature where no parameter has another.
    values : dict
        Values of :data:`~parameters.shared.PARAMETERS`.
    recorded : callable, optional
        Returns names of the joints in a recording, given the model with all joints. Without it,
        `locked_joints` cannot have ``*``, the joints that a recording lacks.

    Raises
    ------
    DiagDynamicsError
        As :func:`load_urdf` and :func:`load_mjcf`; or the state of a joint is on no ROS topic.
    """
    described = describe(description)
    gravity = values["gravity"]
    floating_base = values["floating_base"]
    payloads = payloads_of(values["payloads"])
    payloads = {link: load for link, load in payloads.items() if link in described.links}
    if floating_base and not described.floating_base and is_mjcf(description):
        raise InputError(
            "parameter 'floating_base' is true; expected false, "
            "because the MJCF has no free body, or several. Give the base a <freejoint/>."
        )
    locked = assignments(
        "locked_joints",
        [f"{ALL}=0" if entry == ALL else entry for entry in values["locked_joints"]],
    )
    rest = locked.pop(ALL, None)
    if rest is not None and recorded is None:
        problem = "parameter 'locked_joints' has '*', the joints that a recording lacks"
        raise InputError(f"{problem}; expected names of joints, because no recording is read here.")
    if list(gravity) == PARAMETERS["gravity"].default:
        gravity = described.gravity
    model = load_urdf(
        described,
        floating_base=bool(floating_base or described.floating_base),
        gravity=gravity,
        locked_joints=locked,
        armature=assignments("armature", values.get("armature", ())),
        payloads=payloads,
        parameters=values["parameters_file"] or None,
        loops=values["loops_file"] or None,
        mimic=values["mimic"],
        massless=values["massless"],
    )
    require_single_joints(model)
    if rest is not None:
        joints = single_joints(model)
        names = recorded(model)
        if names & set(joints):  # other names are a finding of the reader
            model = model.with_locked_joints(
                model.locked_joints | {name: rest for name in joints if name not in names}
            )
    return model


def require_as_made(values):
    """Reject parameters that would change a RobotModel, which is final."""
    for name, spec in PARAMETERS.items():
        if name != "floating_base" and values[name] != spec.default:
            raise InputError(
                f"parameter '{name}' is {values[name]!r}; expected its default "
                "because a RobotModel is final. Pass the URDF, or set the option of load_urdf."
            )


def require_single_joints(model):
    """Reject a robot with a joint whose state is on no ROS topic."""
    if len(model.joint_names) != len(single_joints(model)) + model.floating_base:
        single = set(single_joints(model))
        several = next(
            name for name in model.joint_names[model.floating_base :] if name not in single
        )
        raise UnsupportedError(
            f"joint '{several}' has several degrees of freedom; expected one: "
            "joint_states cannot hold its state. Only the root may float (floating_base, odom)."
        )
