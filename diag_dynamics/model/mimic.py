"""Mimic joints: whom each follows in the end, and which of them are held."""

from typing import NamedTuple

from diag_dynamics.exceptions import MimicJointError
from diag_dynamics.model.options import SINGLE
from diag_dynamics.model.urdf import LARGEST

_CURE = "mimic='free' takes every joint as independent."


class Mimic(NamedTuple):
    """How a joint follows another one: its position is multiplier · leader's + offset.

    Attributes
    ----------
    leader : str
        Name of an independent joint.
    multiplier : float
        [rad/rad, or as the joints are, m/rad, rad/m].
    offset : float
        [rad, m].
    """

    leader: str
    multiplier: float
    offset: float


def resolve_mimics(robot, mode, locked):
    """Followers of independent joints, and the positions of all joints that are held.

    Parameters
    ----------
    robot : yourdfpy.Robot
    mode : {"embed", "free", "lock"}
    locked : dict
        Positions of joints that are held [rad, m].

    Returns
    -------
    mimics : dict
        :class:`Mimic` by name of the follower; none unless `mode` is "embed".
    held : dict
        `locked`, and with it the followers that stand still: all of them where `mode` is "lock", those of a joint that is
        held or fixed, and those whose multipliers come to 0. "free" holds no follower.

    Raises
    ------
    MimicJointError
        A joint that is to follow mimics itself, or one that does not exist or has several degrees of freedom.
    """
    mimics, held = {}, dict(locked)
    if mode == "free":
        return mimics, held
    joints = {joint.name: joint for joint in robot.joints}
    for joint in robot.joints:
        if joint.mimic is None or joint.name in locked or joint.type == "fixed":
            continue
        leader, multiplier, offset = _followed(joint, joints, locked)
        if leader.name in locked or leader.type == "fixed":
            held[joint.name] = offset + multiplier * locked.get(leader.name, 0.0)
        elif mode == "lock" or multiplier == 0.0:
            held[joint.name] = offset
        else:
            mimics[joint.name] = Mimic(leader.name, multiplier, offset)
    return mimics, held


def _followed(joint, joints, locked):
    """The joint at the end of a chain of mimics, with multiplier and offset."""
    chain = [joint.name]
    multiplier, offset = 1.0, 0.0
    while joint.mimic is not None and joint.name not in locked and joint.type != "fixed":
        _require_single(joint, chain)
        own = joint.mimic
        factor = 1.0 if own.multiplier is None else own.multiplier
        offset += multiplier * (own.offset or 0.0)
        vanished = multiplier * factor == 0.0 and multiplier != 0.0 and factor != 0.0
        multiplier *= factor
        if vanished or not (abs(multiplier) <= LARGEST and abs(offset) <= LARGEST):
            raise MimicJointError(
                f"joint '{chain[0]}' follows '{own.joint}' with multiplier {multiplier:g} and offset {offset:g}: these are "
                f"beyond {LARGEST:g}, or vanish. {_CURE}",
                chain,
            )
        if own.joint not in joints:
            raise MimicJointError(
                f"joint '{joint.name}': it mimics '{own.joint}', which is not a joint of this URDF. {_CURE}",
                [joint.name],
            )
        if own.joint in chain:
            raise MimicJointError(
                f"joint '{own.joint}' mimics itself: {' → '.join(map(repr, [*chain, own.joint]))}. {_CURE}", chain
            )
        joint = joints[own.joint]
        chain.append(joint.name)
    _require_single(joint, chain)
    return joint, multiplier, offset


def _require_single(joint, chain):
    if joint.type not in (*SINGLE, "fixed"):
        follows = f"joint '{chain[-2]}' mimics it" if len(chain) > 1 else "it mimics another joint"
        raise MimicJointError(
            f"joint '{joint.name}' is {joint.type}, and {follows}: that takes joints of one degree of freedom. {_CURE}",
            chain,
        )


def coupled_groups(mimics, joints, carriers):
    """Joints that are eliminated together: from the lowest body that carries all of a coupling down to its members.

    Those that share a body are one group.

    Parameters
    ----------
    mimics : dict
        :class:`Mimic` by name of the follower.
    joints : iterable of str
        All moving joints.
    carriers : dict
        Of each moving joint the one that carries it, or None.

    Returns
    -------
    dict
        The group, a frozenset of names, of each joint that is in one.
    """
    members = {}
    for follower, mimic in mimics.items():
        members.setdefault(mimic.leader, [mimic.leader]).append(follower)
    group_of = {}
    for names in members.values():
        group = _paths(names, carriers)
        for name in list(group):
            group |= group_of.get(name, frozenset())
        group = frozenset(group)
        group_of.update(dict.fromkeys(group, group))
    return group_of


def _paths(names, carriers):
    """The joints on the ways from the last common carrier of some, exclusive, to them, inclusive."""
    paths = []
    for name in names:
        path = [name]
        while carriers[path[-1]] is not None:
            path.append(carriers[path[-1]])
        paths.append(path[::-1])
    common = 0
    shortest = min(map(len, paths)) - 1  # a member is never its own carrier
    while common < shortest and len({path[common] for path in paths}) == 1:
        common += 1
    return {name for path in paths for name in path[common:]}
