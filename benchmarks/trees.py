# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots of any size for measuring growth, as URDF text."""

INERTIAL = (
    '<inertial><origin xyz="0.02 0.01 0.1"/><mass value="1.0"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0.001" izz="0.02"/></inertial>'
)


def chain(joints, coupled=False):
    """Serial chain of revolute joints with turning axes; with a gripper of two followers at the tip, if coupled."""
    parts = ['<robot name="chain"><link name="link_0"/>']
    for k in range(joints):
        parts.append(
            _joint(f"joint_{k}", f"link_{k}", f"link_{k + 1}", ("1 0 0", "0 1 0", "0 0 1")[k % 3])
        )
    if coupled:
        tip = f"link_{joints}"
        parts.append(_joint("palm_a", tip, "finger_a", "0 0 1"))
        parts.append(_joint("palm_b", tip, "finger_b", "0 0 1", _mimic("palm_a", -1.0)))
        parts.append(_joint("knuckle_a", "finger_a", "tip_a", "0 1 0", _mimic("palm_a", 0.5)))
    return "".join(parts) + "</robot>"


def balanced(joints):
    """Binary tree of revolute joints, filled level by level."""
    parts = ['<robot name="balanced"><link name="link_0"/>']
    for k in range(joints):
        parts.append(
            _joint(
                f"joint_{k:05}",
                f"link_{k // 2}",
                f"link_{k + 1}",
                ("1 0 0", "0 1 0", "0 0 1")[k % 3],
            )
        )
    return "".join(parts) + "</robot>"


def _joint(name, parent, child, axis, more=""):
    return (
        f'<link name="{child}">{INERTIAL}</link><joint name="{name}" type="continuous"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="0.01 0.02 0.2" rpy="0.1 0.2 0.3"/><axis xyz="{axis}"/>{more}</joint>'
    )


def _mimic(leader, multiplier):
    return f'<mimic joint="{leader}" multiplier="{multiplier}" offset="0.1"/>'
