# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots of the tests of control laws, their states, and frames by Pinocchio alone."""

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
import robots
from described import subject

RANDOM = {robot.id: robot for robot in robots.random_robots()}
PANDA = robots.robot("panda_description/urdf/panda.urdf")
UR5 = robots.robot("ur_description/urdf/ur5_robot.urdf")
TREE = RANDOM["geared_tree_10"]
FINGERS = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
ARM = PANDA._replace(id="panda_arm", locked_joints={"panda_finger_joint1": 0.02})
Z1 = robots.robot("z1_description/urdf/z1.urdf")._replace(locked_joints={"jointGripper": -0.5})
FRAMES = {PANDA.id: "panda_hand", ARM.id: "panda_hand", UR5.id: "tool0", TREE.id: "link_11"}
POINT = np.array([0.03, -0.05, 0.1])
READY = np.array([0.0, -0.5, 0.1, -2.0, 0.1, 1.6, 0.5])
START = {
    ARM.id: READY,
    UR5.id: np.array([0.0, -1.2, 1.2, -0.6, 0.5, 0.0]),
    Z1.id: np.array([0.0, 1.2, -1.0, 0.3, 0.2, 0.0]),
}
ALL = pytest.mark.parametrize("robot", (PANDA, UR5, TREE))


def configuration(model, rng, part=0.8):
    """Return a random configuration within the middle part of the limits."""
    lower = np.maximum(model.lower, -2.0)
    upper = np.minimum(model.upper, 2.0)
    return 0.5 * (lower + upper) + 0.5 * part * (upper - lower) * rng.uniform(-1, 1, model.nv)


def states(robot, count):
    """Yield a generator of numbers and the truths of the oracle at random states."""
    s = subject(robot)
    rng = np.random.default_rng(7)
    for _ in range(count):
        yield rng, s.oracle.at(configuration(s.model, rng), rng.normal(size=s.model.nv))


def dense_frame(robot, q):
    """Return position, axes, and the Jacobian of both stacked, 12 rows, of the frame: from
    Pinocchio alone.
    """
    o = subject(robot).oracle
    full = o.full
    configuration = full.configuration(o.q_full(q))
    at = full.model.getFrameId(FRAMES[robot.id], pin.FrameType.BODY)
    pin.framesForwardKinematics(full.model, full.data, configuration)
    placed = full.data.oMf[at].copy()
    J = pin.computeFrameJacobian(full.model, full.data, configuration, at, pin.LOCAL_WORLD_ALIGNED)
    J = J[:, full._order] @ o.G
    lever = placed.rotation @ POINT
    rows = [J[:3] - pin.skew(lever) @ J[3:]]
    rows += [-pin.skew(placed.rotation[:, j]) @ J[3:] for j in range(3)]
    return placed.translation + lever, placed.rotation, np.vstack(rows)


def stacked(position, axes):
    """Return Y: the position and the three axes."""
    return np.concatenate([position, axes.T.ravel()])


def close(actual, expected):
    """Assert equality to 1e-9, the accuracy of commands."""
    np.testing.assert_allclose(
        actual, expected, rtol=0, atol=1e-9 * max(1.0, np.abs(expected).max())
    )


def frictionless(model, q, qd=None, step=1e-3):
    """Return a simulation without friction and limits."""
    nothing = np.zeros(model.nv)
    options = {"damping": nothing, "friction": nothing, "effort_limits": False, "limits": False}
    return dd.Simulation(model, q, qd, step=step, **options)


class Sampled:
    """A robot at rest, without friction, whose efforts last for a cycle: classical Runge–Kutta
    steps by Pinocchio.
    """

    def __init__(self, oracle, q, step=5e-4):
        self.oracle = oracle
        self.q = np.array(q)
        self.qd = np.zeros(len(q))
        self._step = step

    def advance(self, tau, period):
        """Apply an effort for a period [s]."""
        count = round(period / self._step)
        h = period / count

        def acceleration(q, qd):
            return self.oracle.forward_dynamics(q, qd, tau)

        for _ in range(count):
            q = self.q
            qd = self.qd
            a = acceleration(q, qd)
            b = acceleration(q + 0.5 * h * qd, qd + 0.5 * h * a)
            c = acceleration(q + 0.5 * h * qd + 0.25 * h * h * a, qd + 0.5 * h * b)
            d = acceleration(q + h * qd + 0.5 * h * h * b, qd + h * c)
            self.q = q + h * qd + h * h / 6.0 * (a + b + c)
            self.qd = qd + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)

    @property
    def kinetic_energy(self):
        """K [J]."""
        return 0.5 * self.qd @ self.oracle.mass_matrix(self.q) @ self.qd
