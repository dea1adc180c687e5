"""Mimic joints that are not coupled: refused, or locked where they belong."""

from diag_dynamics.exceptions import MimicJointError, UrdfError


def refuse_mimics(robot, followers):
    """Raise, for want of embedding or because a leader does not exist."""
    names = {joint.name for joint in robot.joints}
    for follower in followers:
        leader = follower.joint.mimic.joint
        if leader not in names:
            raise UrdfError(
                f"joint '{follower.name}': it mimics '{leader}', which is not a joint of this URDF. "
                "mimic='free' treats it as an independent joint."
            )
    listed = ", ".join(joint.name for joint in followers)
    raise MimicJointError(
        f"robot '{robot.name}' has mimic joints ({listed}), and exact embedding of their coupling is not there yet. "
        "mimic='free' treats them as independent joints, mimic='lock' locks them.",
        [joint.name for joint in followers],
    )


def with_mimics_locked(robot, options):
    """Locked joints, and the followers that are locked with them: all of them, or those of leaders that are locked."""
    locked = dict(options.locked)
    if options.mimic == "free":
        return locked
    joints = {joint.name: joint for joint in robot.joints}
    for joint in robot.joints:
        if joint.mimic is None or joint.name in locked or joint.type == "fixed":
            continue
        if options.mimic == "lock" or _leader(joint, joints, options.locked) in options.locked:
            locked[joint.name] = _follow(joint, joints, options.locked)
    return locked


def _leader(joint, joints, locked):
    """Name of the joint that a follower follows in the end."""
    seen = set()
    while (
        joint.mimic is not None and joint.name not in locked and joint.name not in seen and joint.mimic.joint in joints
    ):
        seen.add(joint.name)
        joint = joints[joint.mimic.joint]
    return joint.name


def _follow(joint, joints, locked):
    """Position of a mimic joint with its leader as locked, or at zero."""
    position, scale, seen = 0.0, 1.0, []
    while joint.mimic is not None and joint.name not in locked:
        if joint.name in seen:
            raise UrdfError(f"joint '{joint.name}' mimics itself through {', '.join(seen)}.")
        seen.append(joint.name)
        position += scale * (joint.mimic.offset or 0.0)
        scale *= 1.0 if joint.mimic.multiplier is None else joint.mimic.multiplier
        if joint.mimic.joint not in joints:
            raise UrdfError(
                f"joint '{joint.name}': it mimics '{joint.mimic.joint}', which is not a joint of this URDF."
            )
        joint = joints[joint.mimic.joint]
    return position + scale * locked.get(joint.name, 0.0)
