# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robots that are measured, each at one state that is always the same."""

import warnings
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

CLASSES = {
    "6–50 dof": range(6, 51),
    "all robots": range(1, 1000),
}
"""Degrees of freedom of the robots that a line of the table is about."""


class Robot(NamedTuple):
    """A robot of the `example-robot-data` wheel, all its joints independent."""

    name: str
    floating_base: bool = False

    @property
    def label(self):
        """Name to show."""
        return f"{self.name} (floating)" if self.floating_base else self.name


ROBOTS = (
    Robot("double_pendulum"),  # hardly more than what a call costs
    Robot("ur5_robot"),
    Robot("kinova"),  # three joints without an end: two coordinates each in Pinocchio
    Robot("xarm7"),
    Robot("panda"),
    Robot("go2"),
    Robot("go2", floating_base=True),
    Robot("baxter"),
    Robot("g1_29dof_rev_1_0"),
    Robot("talos_reduced"),
    Robot("g1_29dof_rev_1_0", floating_base=True),
    Robot("centauro"),
    Robot("talos_full_v2"),
)

FEW = (
    Robot("ur5_robot"),
    Robot("kinova"),
    Robot("go2", floating_base=True),
    Robot("talos_reduced"),
)


WITH_TARGETS = ("ur5_robot", "panda", "talos_reduced")
"""Robots of 6, 9 and 32 degrees of freedom, for each of which there are targets."""

COMPARED = ", ".join(WITH_TARGETS)


def targets(*ratios):
    """Return targets by robot."""
    return dict(zip(WITH_TARGETS, ratios, strict=True))


class Case:
    """A robot, its dynamics, and random states of it.

    Attributes
    ----------
    urdf : str
        Description, as text for the peers.
    q, qd, tau : ndarray
        The state at which single calls are measured.
    """

    def __init__(self, robot):
        path = Path(find_urdf(robot.name))
        self.label, self.floating_base, self.urdf = (
            robot.label,
            robot.floating_base,
            path.read_text(encoding="utf-8"),
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", dd.InertiaWarning)  # peers are given the same inertias
            self.model = dd.load_urdf(path, mimic="free", floating_base=robot.floating_base)
        self.dynamics, self.dof = dd.DiagonalDynamics(self.model), self.model.nv
        (self.q,), (self.qd,), (self.tau,) = self.states(1)

    def states(self, count):
        """Random positions, rates and efforts, a row for each state, always the same ones."""
        rng = np.random.default_rng(zlib.crc32(self.label.encode()))
        Q = rng.uniform(-1.0, 1.0, (count, self.model.nq))
        QD, TAU = rng.standard_normal((2, count, self.dof))
        if self.floating_base:
            Q[:, 3:7] /= np.linalg.norm(Q[:, 3:7], axis=1, keepdims=True)
        return Q, QD, 5.0 * TAU
