# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots and messages of the decision table: URDFs, and bytes of joint states and odometry."""

import math
from types import MappingProxyType

import bags

MS, S = 10**6, 10**9
NOW = 100 * S
"""Stamp of most first messages, and time of reception of all messages unless a case says
otherwise.
"""

NAN, INF = math.nan, math.inf
NAMES = ("shoulder", "elbow", "wrist")
LIMITS = {"shoulder": (-INF, INF), "elbow": (-5.0, 4.0), "wrist": (-6.0, 60.0)}
VELOCITY_LIMITS = {"shoulder": 6.0, "elbow": 3.0, "wrist": 0.0}
EFFORT_LIMITS = {"shoulder": 500.0, "elbow": 0.0, "wrist": 1000.0}
MIMICS = {"thumb": ("wrist", -2.0, 0.5), "heel": ("elbow", 0.5, 0.0), "pinky": ("wrist", 3.0, -1.0)}
IN_PLACE = {"thumb": -5.5, "heel": 1.0, "pinky": 8.0}
"""Positions of the mimic joints where the joints are at 1, 2, 3."""

BASE_PARAMETERS = MappingProxyType(
    {
        "max_age": 0.0,
        "mimic_tolerance": 0.01,
        "stuck_timeout": 0.0,
        "plausibility.beyond_limits": 0.0,
        "plausibility.beyond_velocity": 0.0,
        "plausibility.jump": 0.0,
    }
)
"""Parameters of every case: each rule is off unless the case turns it on; joints have 0.5 s."""


# --- robots


def _link(name, mass=1.0):
    inertia = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 -0.5"/>'
        f'<mass value="{mass}"/>{inertia}</inertial></link>'
    )


def _joint(name, parent, kind="revolute", mimic=""):
    lower, upper = LIMITS.get(name, (-100.0, 100.0))
    of = f'velocity="{VELOCITY_LIMITS.get(name, 0.0)}" effort="{EFFORT_LIMITS.get(name, 0.0)}"'
    of = of if kind == "continuous" else f'lower="{lower}" upper="{upper}" {of}'
    if mimic:
        source, multiplier, offset = mimic
        mimic = f'<mimic joint="{source}" multiplier="{multiplier}" offset="{offset}"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>'
        f'<axis xyz="1 0 0"/><limit {of}/>{mimic}</joint>{_link(f"{name}_link")}'
    )


def _robot(*parts):
    return f'<robot name="robot">{_link("trunk")}{"".join(parts)}</robot>'


ROBOTS = {
    "arm": _robot(
        _joint("shoulder", "trunk", "continuous"),
        _joint("elbow", "shoulder_link"),
        _joint("wrist", "elbow_link"),
        *(_joint(name, "wrist_link", mimic=mimic) for name, mimic in MIMICS.items()),
    ),
    "wheel": _robot(
        _joint("drive", "trunk", "continuous"),
        _joint("wheel", "trunk", "continuous", ("drive", 1.0, 0.0)),
    ),
    "floating": _robot(_joint("shoulder", "trunk", "continuous")),
    "brick": _robot(),
}
"""URDF by name. The last two have a floating base, whose state comes from odometry."""

FLOATING = ("floating", "brick")


# --- messages as bytes, by rosbags


def joint_state(names, position=(), velocity=(), effort=(), stamp=NOW, frame="", order="<"):
    """Return the bytes of a sensor_msgs/JointState; `stamp` in nanoseconds, or seconds and
    nanoseconds.
    """
    return bags.serialized(stamp, names, position, velocity, effort, frame, order)


def odometry(
    stamp=NOW, position=(1, 2, 3), orientation=(0, 0, 0, 1), twist=(0,) * 6, child="trunk"
):
    """Return the bytes of a nav_msgs/Odometry."""
    return bags.odometry(stamp, child, (*position, *orientation), twist)
