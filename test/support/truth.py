# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of a monitor compared with Pinocchio."""

import numpy as np
from sensor_msgs.msg import JointState

from accuracy import assert_close, tolerance
from described import S
from oracles import EARTH


def nanoseconds(stamp):
    """Return a builtin_interfaces/Time as an integer."""
    return stamp.sec * S + stamp.nanosec


class Truth:
    """What Pinocchio says of a robot in a state, in its own order of dofs; checks messages by name.

    Efforts are unknown where tau is None. `estimated`: velocities are the node's, from positions.
    """

    def __init__(self, robot, q, qd, tau=None, gravity=None, estimated=False):
        """Take the state in the order of robot.names."""
        self.robot = robot
        self.estimated = estimated
        oracle = robot.oracle if gravity is None else robot.make_oracle(robot.urdf, gravity=gravity)
        self.state = oracle.at(q, qd, tau)
        self.tolerance = tolerance(self.state)
        # |ε_g| ≤ √mass |g|: where gravity happens to have little moment, errors are relative to
        # that
        self.gravity_scale = np.sqrt(oracle.mass) * np.linalg.norm(
            EARTH if gravity is None else gravity
        )
        self.unit = np.sqrt(np.diag(self.state.M))

    def check_header(self, message, stamp):
        """Stamp, frame and names: those of the input, the root link, and the joints from base to
        tip.
        """
        assert nanoseconds(message.header.stamp) == stamp
        assert message.header.frame_id == self.robot.root
        assert (
            tuple(message.name if type(message) is JointState else message.dof_names)
            == self.robot.names
        )

    def check_vector(self, actual, expected, scale=None):
        """One number per dof, compared in the units given by the caller."""
        assert_close(np.array(actual), expected, self.tolerance, scale)

    def check_matrix(self, actual, expected, weight):
        """A row-major matrix, compared with each entry divided by its weight."""
        nv = len(self.robot.names)
        assert len(actual) == nv * nv
        assert_close(np.array(actual).reshape(nv, nv) / weight, expected / weight, self.tolerance)

    def check_total_joint_rates(self, message):
        s = self.state
        self.check_vector(message.nu, s.nu)
        self.check_vector(np.sqrt(s.D) * message.xi, s.nu)

    def check_working_moments(self, message):
        s = self.state
        assert message.effort_valid == (s.tau is not None)
        if s.tau is None:
            assert len(message.epsilon) == len(message.kappa) == 0
            return
        self.check_vector(message.epsilon, s.epsilon)
        self.check_vector(message.kappa / np.sqrt(s.D), s.epsilon)

    def check_coriolis(self, message):
        s = self.state
        self.check_vector(message.coriolis, s.coriolis, s.coriolis_scale)
        root = np.sqrt(s.D)
        scale = s.coriolis_scale + np.linalg.norm(s.Ddot * s.xi / root)
        self.check_vector(
            message.coriolis_unnormalized / root, s.coriolis_unnormalized / root, scale
        )
        self.check_gravity(message.gravity)

    def check_gravity(self, epsilon_g):
        expected = self.state.gravity
        self.check_vector(
            epsilon_g, expected, max(np.linalg.norm(expected), 1e-3 * self.gravity_scale)
        )

    def check_mass_matrix_factors(self, message, with_inverse=False):
        s = self.state
        nv = len(self.robot.names)
        assert message.nv == nv
        self.check_matrix(message.m, s.m, self.unit[:, None])
        self.check_vector(message.d / s.D, np.ones(nv))
        assert message.l_valid == with_inverse
        if with_inverse:
            self.check_matrix(message.l, s.l, 1 / self.unit)
        else:
            assert len(message.l) == 0

    def check_kinetic_energy(self, message):
        s = self.state
        K = s.kinetic_energy
        assert_close(message.total, K, 1e-12)
        self.check_vector(message.energy_share, 0.5 * s.nu**2)
        assert message.base_energy == 0.0  # a fixed base
        assert_close(sum(message.energy_share), K, 1e-12)
        assert sorted(message.link_names) == sorted(s.link_energy)
        assert_close(
            np.array(message.link_energy),
            [s.link_energy[name] for name in message.link_names],
            1e-12,
        )
        assert message.power_valid == (s.tau is not None)
        self.check_power(message.power)

    def check_power(self, power):
        s = self.state
        if s.tau is None:
            assert power == 0.0
            return
        scale = np.linalg.norm(s.nu) * (
            np.linalg.norm(s.epsilon) + np.linalg.norm(s.gravity) + s.coriolis_scale
        )
        assert_close(power, s.power, self.tolerance, scale)

    def check_joint_space_dynamics(self, message):
        s = self.state
        unit = self.unit
        self.check_matrix(message.mass_matrix, s.M, np.outer(unit, unit))
        scale = max(np.linalg.norm(s.c / unit), 1e-3 * np.linalg.norm(s.nu) * np.linalg.norm(s.qd))
        self.check_vector(message.coriolis_torque / unit, s.c / unit, scale)
        scale = max(np.linalg.norm(s.g / unit), 1e-3 * self.gravity_scale)
        self.check_vector(message.gravity / unit, s.g / unit, scale)

    def check_state(self, message):
        s = self.state
        assert list(message.position) == s.q.tolist()
        assert list(message.velocity) == s.qd.tolist()
        assert_close(np.array(message.effort), [] if s.tau is None else s.tau, 1e-15)
        assert message.velocity_estimated == self.estimated
        self.check_total_joint_rates(message)
        self.check_working_moments(message)
        self.check_vector(message.coriolis, s.coriolis, s.coriolis_scale)
        self.check_gravity(message.gravity)
        self.check_vector(message.articulated_inertia / s.D, np.ones(len(s.D)))
        assert_close(message.kinetic_energy, s.kinetic_energy, 1e-12)
        self.check_power(message.power)

    def check(self, published, stamp):
        """Every message of a dict by topic."""
        for topic, message in published.items():
            self.check_header(message, stamp)
            if hasattr(message, "velocity_estimated"):
                assert message.velocity_estimated == self.estimated
            getattr(self, f"check_{topic}")(message)
