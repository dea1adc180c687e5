# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hostile recordings of several robots, and the parameters of the monitor that they are read by."""

from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
from bags import ODOMETRY, Message, odometry, write_mcap
from coupling import NAMED
from described import PANDA
from diag_dynamics.joint_states.robot_joints import joints_of
from hostile import MS, START, Driver, S, hostile
from robots import robot_path


class Case(NamedTuple):
    """A robot, parameters of the monitor, and counts that a hostile recording must bring about."""

    robot: str
    parameters: dict
    counts: tuple = ()

    @property
    def urdf(self):
        """Description of the robot: text, or the path of a file."""
        return NAMED[self.robot].urdf if self.robot in NAMED else robot_path(self.robot)

    @property
    def model(self):
        """The robot, with a floating base where the parameters say so."""
        return dd.load_urdf(self.urdf, floating_base="floating_base" in self.parameters)

    @property
    def own_parameters(self):
        """Parameters without those that shape the model."""
        return {name: value for name, value in self.parameters.items() if name != "floating_base"}


REJECTED = (
    "malformed",
    "implausible value",
    "jump",
    "late",
    "no velocity",
    "wrong length",
    "no position",
    "duplicate name",
)
CASES = {
    "defaults": Case(
        PANDA,
        {},
        (
            *map("rejected: {}".format, REJECTED),
            "incomplete",
            "foreign",
            "implausible effort",
        ),
    ),
    "few rules": Case(
        PANDA,
        dict.fromkeys(("max_age", "plausibility.jump", "plausibility.beyond_limits"), 0.0)
        | {"joint_timeout": ["*=0"]},
    ),
    "estimated velocities": Case(PANDA, {"missing_velocity": "estimate"}),
    "scaled efforts": Case(
        PANDA, {"effort_scale": ["*=0.5"], "effort_available": ["panda_joint3=false"]}
    ),
    "mimic joint": Case("parallel gripper", {}, ("mimic disagreement", "followers only")),
    "floating base": Case(
        "solo_description/robots/solo12.urdf",
        {"floating_base": True},
        ("before odometry", "odometry rejected: malformed", "odometry rejected: late"),
    ),
}


class Base:
    """Sends odometry of a base in slow motion, with whatever goes wrong with it."""

    def __init__(self, link, seed):
        self.link = link
        self.rng = np.random.default_rng(seed)

    def message(self, stamp, odd):
        """Return the bytes of an odometry, which may be odd in one of many ways."""
        t = (stamp - START) / S
        link = self.link
        turn = np.array([0.1 * np.sin(t), 0.2 * np.cos(t), 0.3, 1.0])
        pose = np.concatenate([np.sin([t, 2 * t, 3 * t]), turn / np.linalg.norm(turn)])
        twist = 0.1 * np.cos([t, 2 * t, 3 * t, 3 * t, 2 * t, t])
        kind = self.rng.integers(9) if odd else None
        if kind == 0:
            link = str(self.rng.choice(["", "nowhere", "/" + self.link]))
        elif kind == 1:
            pose[1] = self.rng.choice([np.nan, np.inf, 1e9, -1e200])
        elif kind == 2:
            twist[5] = self.rng.choice([np.nan, -np.inf, 1e5, 1e300])
        elif kind == 3:
            pose[6] = self.rng.choice([np.nan, 0.0, -1.0, 17.0])
        elif kind == 4:
            pose[3:] = 0.0
        elif kind in (5, 6):
            stamp += int(self.rng.choice([1, 40, 900, 3000, 40_000])) * (MS if kind == 5 else -MS)
        elif kind == 7:
            stamp = 0
        raw = odometry(max(stamp, 0), link, pose, twist)
        return raw[: self.rng.integers(1, 700)] if kind == 8 else raw


def hostile_messages(case, seed, count=900):
    """Return messages in the order of their log time, no two of one time.

    A robot of :data:`coupling.NAMED` lists its mimic joints, too. Odometry of a floating base
    begins later, and pauses for a second.
    """
    model = case.model
    joints = joints_of(model)
    drivers = (
        [Driver(model, seed, [*joints.names, *joints.mimics])] if case.robot in NAMED else None
    )
    pairs = hostile(model, seed, count, drivers=drivers)
    messages = [Message("/joint_states", now, raw) for raw, now in pairs]
    if model.floating_base:
        rng = np.random.default_rng(seed)
        base = Base(model.root_link, seed)
        for k, (_, now) in enumerate(pairs):
            if k >= 5 and not count // 2 < k < count // 2 + 40 and rng.random() < 0.7:
                at = now + MS
                raw = base.message(at - 1000, rng.random() < 0.15)
                messages.append(Message("/odom", at, raw, ODOMETRY))
    return sorted(messages, key=lambda entry: entry.log_time)


def write_case(path, messages):
    """Write messages as a bag; return its path."""
    return write_mcap(path, messages, chunk_size=20_000)
