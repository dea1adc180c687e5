# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor as the force-torque sensor of an admittance law: simulator, monitor and law, each by DDS, in lockstep."""

import math

import numpy as np
import pytest
from diag_dynamics.msg import ExternalWrench
from geometry_msgs.msg import WrenchStamped

import diag_dynamics as dd
from controllers import START_AT, put
from nodes import START, UR5, Monitor, nanoseconds
from simulators import Simulator

pytestmark = [pytest.mark.full, pytest.mark.live]

LINK, RATE, GAIN = "tool0", 250.0, 40.0
"""Pushed link, joint states per second [Hz], gain of the observer [1/s]."""
NOISE = 0.3
"""Standard deviation of the measured efforts [N m]."""
FORCE = np.array([6.0, -12.0, 5.0])
"""Push in the axes of the link [N]."""
MASS, DAMPING, STIFFNESS = 4.0, 110.0, 600.0
"""Of the admittance [kg, N s/m, N/m]."""


class Admittance:
    """The law: MASS v̇ + DAMPING v + STIFFNESS x = f at the origin of the link, followed by computed torque."""

    def __init__(self, model, start):
        self.dynamics, self.start = dd.DiagonalDynamics(model), np.array(start)
        self.q, self.v, self.force = self.start.copy(), np.zeros(3), np.zeros(3)

    def take_wrench(self, message):
        """Keep the force of a WrenchStamped, whose frame is the link."""
        assert message.header.frame_id == LINK
        f = message.wrench.force
        self.force = np.array([f.x, f.y, f.z])

    def effort(self, q, qd):
        """Return the effort without gravity; one step of the law."""
        dt = 1.0 / RATE
        J = self.dynamics.jacobian(self.q, LINK, frame="link")[:3]
        x = J @ (self.q - self.start)  # small
        self.v = self.v + dt * (self.force - DAMPING * self.v - STIFFNESS * x) / MASS
        rates = np.linalg.pinv(J) @ self.v
        self.q = self.q + dt * rates
        acceleration = 400.0 * (self.q - q) + 40.0 * (rates - qd)
        moving = self.dynamics.inverse_dynamics(q, qd, acceleration) - self.dynamics.gravity_torque(q)
        return moving - J.T @ self.force  # the push moves the admittance, not the joints


@pytest.fixture
def loop(peer):
    """Start a UR5 that compensates its gravity, and a monitor that knows the noise of m r."""
    a = -math.expm1(-GAIN / RATE)  # of white noise n, the observer's filter of (n_k + n_k−1)/2 has the variance a/2
    with Simulator(
        peer,
        "/yielding",
        UR5,
        rate=RATE,
        lockstep=True,
        compensates_gravity=True,
        wrench_timeout=0.0,
        sensor_noise=[0.0, 0.0, NOISE],
    ) as simulator:
        put(simulator, START_AT)
        names = list(simulator.model.dof_names)
        noise = (0.5 * a * NOISE**2 * np.eye(len(names))).ravel().tolist()
        own = {
            "use_sim_time": True,
            "robot_description": simulator.robot.path,
            "effort_scale": ["*=1.0"],
            "effort_includes_gravity": ["*=true"],
            "external_torque.gain": GAIN,
            "external_torque.covariance_joints": names,
            "external_torque.covariance": noise,
            "external_wrench.frames": [LINK],
        }
        with Monitor(peer, "/yielding", outputs=["state"], **own) as monitor:
            yield Loop(peer, simulator, monitor)


class Loop:
    """Joint state → monitor → law → command, until the push has ended and the arm rests."""

    def __init__(self, peer, simulator, monitor):
        self.peer, self.simulator = peer, simulator
        self.law = Admittance(simulator.model, START_AT)
        self.wrench = peer.topic(WrenchStamped, f"{monitor.name}/external_wrench")
        self.estimates = peer.topic(ExternalWrench, f"{monitor.name}/external_wrench_estimates")
        self.stamp, self.order = 0, None

    def step(self):
        """Take a joint state and the estimate at its stamp, answer, and return positions, rates and the estimate."""
        states = self.simulator.states

        def answered():
            state = states.messages[-1]
            stamp = nanoseconds(state.header.stamp)
            return stamp > self.stamp and self.estimates.repeated(stamp) and state

        state = self.peer.wait_until(answered, "an estimate at the last joint state", START)
        self.stamp = nanoseconds(state.header.stamp)
        estimate = self.estimates.repeated(self.stamp)
        if estimate.valid:
            self.peer.wait_until(lambda: self.wrench.repeated(self.stamp), "its wrench")
            self.law.take_wrench(self.wrench.repeated(self.stamp))
        at = [list(state.name).index(name) for name in self.simulator.model.dof_names]
        q, qd = np.array(state.position)[at], np.array(state.velocity)[at]
        self.simulator.command(*self.law.effort(q, qd))
        return q, qd, estimate

    def run(self, seconds):
        """Return positions, rates and estimates of some simulated time."""
        q, qd, estimates = zip(*(self.step() for _ in range(round(seconds * RATE))), strict=True)
        return np.array(q), np.array(qd), estimates


def test_an_arm_that_yields(loop):
    """It moves along the push by f/k, rests there, and returns; the wrench is the push within its stated deviation."""
    dynamics = loop.law.dynamics
    loop.run(0.5)
    loop.simulator.push(LINK, *FORCE, 0, 0, 0)
    q, qd, found = loop.run(3.0)
    J = dynamics.jacobian(np.array(START_AT), LINK, frame="link")[:3]
    moved = J @ (q[-250:].mean(axis=0) - START_AT)
    np.testing.assert_allclose(moved, FORCE / STIFFNESS, atol=0.1 * np.linalg.norm(FORCE) / STIFFNESS)
    assert np.abs(qd[-250:].mean(axis=0)).max() < 1e-3  # it rests
    assert np.linalg.norm((q - START_AT) @ J.T, axis=1).max() < 1.2 * np.linalg.norm(FORCE) / STIFFNESS  # no overshoot
    errors = np.array([vector(one) for one in found[-500:]]) - [*FORCE, 0, 0, 0]
    sigma = np.sqrt([np.diag(np.reshape(one.covariance, (6, 6))) for one in found[-500:]])
    assert all(one.valid and not one.unobserved for one in found[-500:])
    assert 0.5 < (np.abs(errors) < sigma).mean() < 0.85  # 0.68 of normal errors
    assert np.abs(errors[:, :3].mean(axis=0)).max() < sigma[:, :3].max()
    loop.simulator.push(LINK, *np.zeros(6))
    q, qd, _ = loop.run(3.0)
    assert np.linalg.norm(J @ (q[-250:].mean(axis=0) - START_AT)) < 0.1 * np.linalg.norm(FORCE) / STIFFNESS
    assert np.abs(qd[-250:].mean(axis=0)).max() < 1e-3


def vector(estimate):
    """Return a wrench as six numbers."""
    f, n = estimate.wrench.force, estimate.wrench.torque
    return np.array([f.x, f.y, f.z, n.x, n.y, n.z])
