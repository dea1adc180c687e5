"""Targets as they arrive: a pose in the axes of a link, and a joint set-point."""

import numpy as np

from diag_dynamics.control.pose import rotation_of
from diag_dynamics.exceptions import InputError


def aimed(message, dynamics, q):
    """Position [m] and axes, in the root link's axes, of a PoseStamped.

    It is in the axes of the link `frame_id`, from that one's origin, as that link is at the positions q: a pose in the axes
    of a link that moves does not move with it.

    Raises
    ------
    InputError
        No such link, a number that is not finite, or no unit quaternion.
    """
    model, link = dynamics.model, message.header.frame_id
    if link not in model.link_names:
        raise InputError(
            f"target.header.frame_id is '{link}', which is no link of robot '{model.name}'; its root is '{model.root_link}'."
        )
    p, o = message.pose.position, message.pose.orientation
    position = np.array([p.x, p.y, p.z])
    if not np.isfinite(position).all():
        raise InputError(f"target.pose.position is {position.tolist()}, expected finite numbers.")
    axes = rotation_of((o.x, o.y, o.z, o.w))
    X = dynamics.placement(q, link)
    return X[:3, :3] @ position + X[:3, 3], _orthonormal(X[:3, :3] @ axes)


def _orthonormal(R):
    """The rotation nearest to one that has gathered rounding errors of a URDF's angles."""
    U, _, V = np.linalg.svd(R)
    return U @ V


def require_within(what, positions, model):
    """Refuse positions [rad, m], shape (..., nv) in the robot's order, that it cannot have.

    Parameters
    ----------
    what : str
        Name of the positions, with a place for the index of a row if there are several.

    Raises
    ------
    InputError
        A position is outside of its joint's limits: followed there, the robot would press on its stop.
    """
    positions = np.atleast_2d(positions)
    beyond = np.argwhere(~((model.lower <= positions) & (positions <= model.upper)))
    if beyond.size:
        row, k = beyond[0]
        raise InputError(
            f"{what.format(row)} of joint '{model.dof_names[k]}' is {positions[row, k]:.6g}, expected within its limits "
            f"{model.lower[k]:g} … {model.upper[k]:g}."
        )


def set_point(message, names):
    """Positions of all joints [rad, m], in the order of `names`, of a JointState, in any order.

    Raises
    ------
    InputError
        A joint is missing, unknown or listed twice, or its position is missing or not finite; or it is to move there.
    """
    for k, name in enumerate(message.name):
        if name not in names:
            raise InputError(f"set_point.name has '{name}', which is no joint to control: {', '.join(names)}.")
        if name in message.name[:k]:
            raise InputError(f"set_point.name has '{name}' twice.")
    for name in names:
        if name not in message.name:
            raise InputError(f"set_point.name lacks joint '{name}'.")
    if len(message.position) != len(names):
        raise InputError(f"set_point.position has {len(message.position)} entries, expected {len(names)}.")
    if any(message.velocity) or any(message.effort):
        raise InputError("set_point has velocities or efforts, expected positions alone: the robot rests there.")
    position = np.array(message.position, dtype=float)[[list(message.name).index(name) for name in names]]
    for name, value in zip(names, position, strict=True):
        if not np.isfinite(value):
            raise InputError(f"set_point.position of joint '{name}' is {value}, expected a finite number.")
    return position
