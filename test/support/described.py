# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots of the wheel with their oracles and states, and units of time: what tests with and without
ROS 2 share.
"""

import copy
from functools import cache, partial
from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
import robots
from coupling import NAMED, Coupled
from oracles import Oracle

PANDA = "panda_description/urdf/panda.urdf"
UR5 = "ur_description/urdf/ur5_robot.urdf"
TALOS = "talos_data/robots/talos_reduced.urdf"

S = 1_000_000_000
MS = 1_000_000
"""A second and a millisecond [ns]."""


class Robot:
    """A robot, its oracle, and its states; mimic joints are coupled, or else `free`."""

    def __init__(self, id, free=False):
        """Load it into the oracle."""
        self.id = id
        self.path = None if id in NAMED else robots.robot_path(id)
        self.urdf = (NAMED[id] if id in NAMED else robots.robot(id)).urdf
        self.make_oracle = Oracle if free else Coupled
        self.oracle = self.make_oracle(self.urdf)
        self.names = self.oracle.dof_names
        bounds = 3.0 * np.array(self.effort_limits())  # below those of implausible efforts
        samples = robots.samples(id, self.oracle)
        self.samples = [s._replace(tau=np.clip(s.tau, -bounds, bounds)) for s in samples]
        self.root = next(
            link.get("name")
            for link in self.oracle.xml.findall("link")
            if link.get("name")
            not in {child.get("link") for child in self.oracle.xml.findall("joint/child")}
        )
        rng = np.random.default_rng(len(self.names))
        self.shuffled = tuple(rng.permutation(self.names).tolist())

    def effort_limits(self):
        """Return the effort limit of each degree of freedom; inf without one."""
        limits = {
            joint.get("name"): float(joint.find("limit").get("effort") or 0.0) or np.inf
            for joint in self.oracle.xml.findall("joint")
            if joint.find("limit") is not None
        }
        return [limits.get(name, np.inf) for name in self.names]

    def changed(self, urdf=None, **options):
        """Return the same robot by another description of the same joints, or with options of the
        oracle.
        """
        other = copy.copy(self)
        other.urdf = urdf or self.urdf
        other.make_oracle = partial(self.make_oracle, **options)
        other.oracle = other.make_oracle(other.urdf)
        assert other.oracle.dof_names == self.names
        return other


@cache
def robot(id, free=False):
    """Return a robot of the wheel, or one of `coupling.NAMED`, loaded once."""
    return Robot(id, free)


class Subject(NamedTuple):
    """A robot in the library and in Pinocchio."""

    model: dd.RobotModel
    dyn: dd.DiagonalDynamics
    oracle: Coupled


_subjects = {}


def subject(robot):
    """Return a `robots.Robot` in the library and in Pinocchio, loaded once for each id."""
    if robot.id not in _subjects:
        model = dd.load_urdf(robot.source, **robot.options)
        oracle = Coupled(robot.urdf, model.dof_names, **robot.options)
        _subjects[robot.id] = Subject(model, dd.DiagonalDynamics(model), oracle)
    return _subjects[robot.id]
