# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control laws and placements against Pinocchio; the documented program.

Robots: Panda with its coupled fingers, UR5, a geared tree of 12 degrees of freedom.
"""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
import robots
from controlled import (
    ALL,
    ARM,
    FRAMES,
    PANDA,
    POINT,
    RANDOM,
    UR5,
    close,
    dense_frame,
    stacked,
    states,
)
from described import subject
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.rotations import from_quaternion
from diag_dynamics.rotations import to_vector as rotation_vector

ONE = np.ones(7)
HURT = np.where(np.arange(7) == 2, np.nan, 1.0)


def test_rotations():
    rng = np.random.default_rng(0)
    for angle in (0.0, 1e-9, 1e-5, 0.3, 2.0, np.pi - 1e-4, np.pi - 1e-9, np.pi):
        axis = rng.normal(size=3)
        R = pin.exp3(angle * axis / np.linalg.norm(axis))
        np.testing.assert_allclose(pin.exp3(rotation_vector(R)), R, atol=1e-14)
        np.testing.assert_allclose(from_quaternion(*pin.Quaternion(R).coeffs()), R, atol=1e-14)


@ALL
def test_damping_commands(robot):
    s = subject(robot)
    for rng, t in states(robot, 5):
        c = rng.uniform(1, 9, s.model.nv)
        command = dd.RateDamping(s.dyn, c).command(t.q, t.qd)
        close(command.tau, t.m @ (-c * t.nu) + t.g)
        close(command.epsilon, -c * t.nu)
        close(command.gravity_torque, t.g)
        close(command.nu, t.nu)
        close(command.lyapunov, t.kinetic_energy)
        close(command.lyapunov_rate, -t.nu @ (c * t.nu))
        weight = dd.GravityCompensation(s.dyn).command(t.q, t.qd)
        close(weight.tau, t.g)
        assert not weight.epsilon.any() and weight.lyapunov_rate == 0.0


@ALL
def test_pose_commands(robot):
    """τ = m(−c₁ν + ℓJᵀC₂e) + g with J = ∂Y/∂q of 12 rows, dense."""
    s = subject(robot)
    for rng, t in states(robot, 4):
        c = rng.uniform(1, 9, s.model.nv)
        k_p = rng.uniform(50, 300, 3)
        k_o = 20.0
        law = dd.PoseRegulation(s.dyn, FRAMES[robot.id], c, k_p, k_o, POINT)
        position, axes, J = dense_frame(robot, t.q)
        target = position + rng.uniform(-0.5, 0.5, 3)
        target_axes = pin.exp3(rng.uniform(-1.5, 1.5, 3))
        e = stacked(target, target_axes) - stacked(position, axes)
        law.aim(target, target_axes)
        command = law.command(t.q, t.qd)
        weights = np.concatenate([k_p, np.full(9, 0.5 * k_o)])
        close(command.tau, t.m @ (-c * t.nu) + J.T @ (weights * e) + t.g)
        close(t.m @ command.epsilon, command.tau - t.g)
        close(command.lyapunov, t.kinetic_energy + 0.5 * e @ (weights * e))
        close(command.lyapunov_rate, -t.nu @ (c * t.nu))
        close(command.error.position, target - position)
        close(command.error.orientation, pin.log3(target_axes @ axes.T))


@pytest.mark.parametrize("closing", [np.inf, 2.0])
@ALL
def test_tracking_commands(robot, closing):
    """τ = M q̈_r + C_s q̇_r + g − mKmᵀ(q̇ − q̇_r), which is m(ν̇_r + Bν_r + ε_g − Ks).

    The part of q̇_r that reduces the position error is at most `closing`; a bound ρ of disturbances
    adds ρ sat(s/φ) to Ks.
    """
    s = subject(robot)
    for rng, t in states(robot, 3):
        K, L = rng.uniform(1, 30, (2, s.model.nv))
        rho, width = (
            (np.zeros(s.model.nv), 0.3) if closing == 2.0 else (rng.uniform(0, 60, s.model.nv), 0.5)
        )
        q_d, qd_d, qdd_d = (
            t.q + rng.uniform(-0.5, 0.5, s.model.nv),
            *rng.normal(size=(2, s.model.nv)),
        )
        command = dd.JointTracking(s.dyn, K, L, closing, bound=rho, width=width).command(
            t.q, t.qd, q_d, qd_d, qdd_d
        )
        back = -L * (t.q - q_d)
        qd_r = qd_d + np.clip(back, -closing, closing)
        qdd_r = qdd_d - np.where(np.abs(back) < closing, L * (t.qd - qd_d), 0.0)
        error = t.nu - t.m.T @ qd_r
        braking = K * error + rho * np.where(np.abs(error) < width, error / width, np.sign(error))
        close(command.tau, t.M @ qdd_r + t.C_s @ qd_r + t.g - t.m @ braking)
        close(t.m @ command.epsilon, command.tau - t.g)
        close(command.error, q_d - t.q)
        close(command.lyapunov, 0.5 * error @ error)
        close(command.lyapunov_rate, -error @ braking)


def test_documented_example_runs(tmp_path, monkeypatch):
    """The program of docs/control.md reaches its target, K within its bound, without a false
    alarm.
    """
    text = (Path(__file__).parents[2] / "docs" / "control.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"<!-- test: run -->\n```python\n(.*?)```", text, re.DOTALL)
    (tmp_path / "panda.urdf").write_text(PANDA.urdf)
    monkeypatch.chdir(tmp_path)
    energies = []
    names = {}

    class Recorded(dd.Simulation):
        def advance(self, tau):
            super().advance(tau)
            energies.append(0.5 * self.nu @ self.nu)

    monkeypatch.setattr(dd, "Simulation", Recorded)
    exec(compile(program, "docs/control.md", "exec"), names)
    assert 0.45 < max(energies) < 1.001 * 0.5
    assert np.abs(names["limited"].command.error.position).max() < 2e-3
    assert names["seen"].norm < 8.0 and names["limited"].limited == ()


@pytest.mark.parametrize(
    ("robot", "key"),
    [(UR5.floating, "floating base"), (RANDOM["mobile_tree_20"], "several degrees of freedom")],
)
def test_unactuated_robots_are_refused(robot, key):
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, **robot.options))
    for make, arguments in (
        (dd.GravityCompensation, ()),
        (dd.RateDamping, (1.0,)),
        (dd.JointTracking, (1.0, 1.0)),
        (dd.JointRegulation, (1.0, 1.0)),
        (partial(dd.AdaptiveTracking, rate=1.0), (dyn.model.link_names[-1], 1.0, 1.0)),
        (dd.PoseRegulation, (dyn.model.link_names[-1], 1.0, 1.0, 1.0)),
        (dd.EnergyLimiter, (1.0,)),
        (dd.EnergyTank, (1.0, 1.0)),
        (dd.PositionRepulsion, (0.1, 1.0)),
    ):
        with pytest.raises(UnsupportedError, match=key):
            make(dyn, *arguments)


def pose(dyn, link="panda_hand", damping=1.0, position=1.0, orientation=1.0, point=(0, 0, 0)):
    return dd.PoseRegulation(dyn, link, damping, position, orientation, point)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda d: dd.GravityCompensation(d.model), "dynamics is <RobotModel 'panda'"),
        (lambda d: dd.RateDamping(d, 0.0), "gain of 'panda_joint1' is 0.0"),
        (lambda d: dd.RateDamping(d, 1.0).command(HURT, ONE), "q of joint 'panda_joint3' is nan"),
        (lambda d: dd.RateDamping(d, 1.0).command(ONE, ONE[:3]), "qd has shape"),
        (lambda d: dd.JointTracking(d, 1.0, 1.0, 0.0), "closing of 'panda_joint1' is 0.0"),
        (
            lambda d: dd.JointTracking(d, 1, 1).command(ONE, ONE, HURT),
            "desired_q of joint 'panda_joint3'",
        ),
        (lambda d: dd.JointTracking(d, 1, 1, bound=-1.0), "bound of 'panda_joint1' is -1.0"),
        (lambda d: dd.JointRegulation(d, -1.0, 1.0), "stiffness of 'panda_joint1' is -1.0"),
        (lambda d: dd.JointRegulation(d, 1.0, 0.0), "damping_ratio is 0.0"),
        (
            lambda d: dd.PoseRegulation(d, "panda_hand"),
            "damping is None and damping_ratio is None; expected one",
        ),
        (
            lambda d: dd.PoseRegulation(d, "panda_hand", 1.0, damping_ratio=0.7),
            "damping is 1.0 and damping_ratio is 0.7",
        ),
        (lambda d: pose(d, "hand"), "'hand'; expected"),
        (lambda d: pose(d, position=-1), "position_stiffness of 'x' is -1.0"),
        (lambda d: pose(d, point=(0, 0)), "point is"),
        (lambda d: pose(d).command(ONE, ONE), "no target"),
        (lambda d: pose(d).aim((0, 0, 0), np.diag([1, 1, -1])), "expected a rotation matrix"),
    ],
)
def test_errors_name_the_argument(make, key):
    with pytest.raises(InputError, match=key):
        make(subject(ARM).dyn)


@pytest.mark.parametrize(
    "robot", (PANDA, RANDOM["mobile_tree_21"], RANDOM["random_tree_0"].floating)
)
def test_placement(robot):
    """Every link is where Pinocchio has it: mimic, planar and floating joints included."""
    model, dyn, o = subject(robot)
    full = o.full
    for sample in robots.samples(robot.id, o):
        pin.framesForwardKinematics(full.model, full.data, full.configuration(o.q_full(sample.q)))
        for link in model.link_names:
            expected = full.data.oMf[full.model.getFrameId(link, pin.FrameType.BODY)].homogeneous
            np.testing.assert_allclose(dyn.placement(sample.q, link), expected, rtol=0, atol=1e-12)
    with pytest.raises(InputError, match="'nowhere'"):
        dyn.placement(model.neutral, "nowhere")
