# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control laws against Pinocchio, and their Lyapunov functions along simulated motions.

Robots: Panda with its coupled fingers, UR5, a geared tree of 12 degrees of freedom.
"""

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
import robots
from coupling import Coupled
from diag_dynamics import control
from diag_dynamics.control.pose import rotation_of, rotation_vector
from diag_dynamics.exceptions import InputError, UnsupportedError
from examples import shortened

RANDOM = {robot.id: robot for robot in robots.random_robots()}
PANDA = robots.robot("panda_description/urdf/panda.urdf")
UR5 = robots.robot("ur_description/urdf/ur5_robot.urdf")
TREE = RANDOM["geared_tree_10"]
ARM = PANDA._replace(id="panda_arm", locked_joints={"panda_finger_joint1": 0.02})
FRAMES = {PANDA.id: "panda_hand", ARM.id: "panda_hand", UR5.id: "tool0", TREE.id: "link_11"}
POINT = np.array([0.03, -0.05, 0.1])
ALL = pytest.mark.parametrize("robot", (PANDA, UR5, TREE), ids=lambda robot: robot.id)
CLOSED = pytest.mark.parametrize("robot", (ARM, UR5, TREE), ids=lambda robot: robot.id)


class Subject(NamedTuple):
    """A robot in the library and in Pinocchio."""

    model: object
    dyn: dd.DiagonalDynamics
    oracle: Coupled
    link: str


def subject(robot):
    return _subject(robot.id)


@cache
def _subject(id):
    robot = next(robot for robot in (PANDA, ARM, UR5, TREE) if robot.id == id)
    model = dd.load_urdf(robot.source, **robot.options)
    oracle = Coupled(robot.urdf, model.dof_names, **robot.options)
    return Subject(model, dd.DiagonalDynamics(model), oracle, FRAMES[robot.id])


def configuration(model, rng, part=0.8):
    """Return a random configuration within the middle part of the limits."""
    lower, upper = np.maximum(model.lower, -2.0), np.minimum(model.upper, 2.0)
    return 0.5 * (lower + upper) + 0.5 * part * (upper - lower) * rng.uniform(-1, 1, model.nv)


def states(robot, count):
    """Yield a generator of numbers and the truths of the oracle at random states."""
    s, rng = subject(robot), np.random.default_rng(7)
    for _ in range(count):
        yield rng, s.oracle.at(configuration(s.model, rng), rng.normal(size=s.model.nv))


def dense_frame(s, q):
    """Return position, axes, and the Jacobian of both stacked, 12 rows, of the frame: from Pinocchio alone."""
    full, o = s.oracle.full, s.oracle
    configuration = full.configuration(o.q_full(q))
    at = full.model.getFrameId(s.link, pin.FrameType.BODY)
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
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-9 * max(1.0, np.abs(expected).max()))


def test_rotations():
    rng = np.random.default_rng(0)
    for angle in (0.0, 1e-9, 1e-5, 0.3, 2.0, np.pi - 1e-4, np.pi - 1e-9, np.pi):
        axis = rng.normal(size=3)
        R = pin.exp3(angle * axis / np.linalg.norm(axis))
        # From sin² + cos² = 1 an angle near 180° is known to the root of rounding, its axis as well.
        np.testing.assert_allclose(pin.exp3(rotation_vector(R)), R, atol=1e-7 if angle > 3 else 1e-14)
        np.testing.assert_allclose(rotation_of(pin.Quaternion(R).coeffs()), R, atol=1e-14)


# --- Commands against Pinocchio alone ---


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
        held = dd.GravityCompensation(s.dyn).command(t.q, t.qd)
        close(held.tau, t.g)
        assert not held.epsilon.any() and held.lyapunov_rate == 0.0


@ALL
def test_pose_commands(robot):
    """τ = m(−c₁ν + ℓJᵀC₂e) + g with J = ∂Y/∂q of 12 rows, dense; position, orientation or both."""
    s = subject(robot)
    for rng, t in states(robot, 4):
        c, k_p, k_o = rng.uniform(1, 9, s.model.nv), rng.uniform(50, 300, 3), 20.0
        law = dd.PoseRegulation(s.dyn, s.link, c, k_p, k_o, POINT)
        position, axes, J = dense_frame(s, t.q)
        target, target_axes = position + rng.uniform(-0.5, 0.5, 3), pin.exp3(rng.uniform(-1.5, 1.5, 3))
        e = stacked(target, target_axes) - stacked(position, axes)
        for aim, in_position, in_orientation in (
            ((target, None), True, False),
            ((None, target_axes), False, True),
            ((target, pin.Quaternion(target_axes).coeffs()), True, True),
        ):
            law.aim(*aim)
            command = law.command(t.q, t.qd)
            weights = np.concatenate([k_p * in_position, np.full(9, 0.5 * k_o * in_orientation)])
            close(command.tau, t.m @ (-c * t.nu) + J.T @ (weights * e) + t.g)
            close(t.m @ command.epsilon, command.tau - t.g)
            close(command.lyapunov, t.kinetic_energy + 0.5 * e @ (weights * e))
            close(command.lyapunov_rate, -t.nu @ (c * t.nu))
        close(command.error.position, target - position)
        close(command.error.orientation, pin.log3(target_axes @ axes.T))


@ALL
def test_tracking_commands(robot):
    """τ = m(ν̇_r + Bν_r + ε_g − Ks) with a dense B, and M q̈_r + C_s q̇_r + g − mKmᵀ(q̇ − q̇_r)."""
    s = subject(robot)
    for rng, t in states(robot, 5):
        K, L = rng.uniform(1, 30, (2, s.model.nv))
        q_d, qd_d, qdd_d = t.q + rng.uniform(-0.5, 0.5, s.model.nv), *rng.normal(size=(2, s.model.nv))
        command = dd.JointTracking(s.dyn, K, L).command(t.q, t.qd, q_d, qd_d, qdd_d)
        qd_r, qdd_r = qd_d - L * (t.q - q_d), qdd_d - L * (t.qd - qd_d)
        nu_r, nu_r_rate = t.m.T @ qd_r, t.m.T @ qdd_r + t.mdot.T @ qd_r
        B = t.l @ (t.C_s - t.m @ t.mdot.T) @ t.l.T
        np.testing.assert_allclose(B @ t.nu, t.coriolis, atol=1e-9 * t.coriolis_scale)
        error = t.nu - nu_r
        close(command.tau, t.m @ (nu_r_rate + B @ nu_r + t.gravity - K * error))
        close(command.tau, t.M @ qdd_r + t.C_s @ qd_r + t.g - t.m @ (K * (t.m.T @ (t.qd - qd_r))))
        close(t.m @ command.epsilon, command.tau - t.g)
        close(command.error, q_d - t.q)
        close(command.lyapunov, 0.5 * error @ error)
        close(command.lyapunov_rate, -error @ (K * error))


def test_tracking_goes_the_short_way_round():
    s = subject(TREE)
    turns = np.array([name in s.model.continuous_joints for name in s.model.dof_names])
    assert turns.any() and not turns.all()
    law = dd.JointTracking(s.dyn, 5.0, 5.0)
    for _, t in states(TREE, 2):
        q_d = t.q + 0.3
        near, far = (law.command(t.q, t.qd, q) for q in (q_d, q_d + 4 * np.pi * turns))
        close(far.tau, near.tau)
        assert np.abs(law.command(t.q, t.qd, q_d + 6.0).error[turns]).max() < np.pi


# --- Closed loops on the simulated plant ---


class Run(NamedTuple):
    """Times, V, its promised rate and K of a loop, and the state at the end."""

    time: np.ndarray
    V: np.ndarray
    rate: np.ndarray
    K: np.ndarray
    q: np.ndarray
    qd: np.ndarray


def run(s, law, q, qd, duration, period=1e-3, push=None):
    """Close the loop: `law(time, q, qd)` returns a Command, held for a period."""
    nothing = np.zeros(s.model.nv)
    options = {"damping": nothing, "friction": nothing, "limits": False, "effort_limits": False}
    plant = dd.Simulation(s.model, q, qd, step=period, **options)
    rows = []
    for k in range(round(duration / period)):
        command = law(k * period, plant.q, plant.qd)
        rows.append((k * period, command.lyapunov, command.lyapunov_rate, 0.5 * command.nu @ command.nu))
        plant.advance(command.tau if push is None else command.tau + push(plant))
    return Run(*np.transpose(rows), plant.q, plant.qd)


def assert_falls_as_promised(record, tolerance):
    """Assert that V follows the integral of its rate, and never rises."""
    step = record.time[1] - record.time[0]
    promised = record.V[0] + np.cumsum(0.5 * step * (record.rate[1:] + record.rate[:-1]))
    assert np.abs(record.V[1:] - promised).max() <= tolerance * record.V[0]
    assert np.diff(record.V).max() <= 1e-3 * tolerance * record.V[0]


@CLOSED
def test_energy_decays_exponentially(robot):
    """K = K₀ exp(−2ct) within 1 %, in many configurations and directions of motion."""
    s, rng, c = subject(robot), np.random.default_rng(3), 2.0
    law = dd.RateDamping(s.dyn, c)
    for _ in range(shortened(20, 3)):
        qd, q = rng.normal(size=s.model.nv), configuration(s.model, rng)
        record = run(s, lambda _, q, qd: law.command(q, qd), q, qd, 0.3)
        np.testing.assert_allclose(record.K, record.K[0] * np.exp(-2 * c * record.time), rtol=0.01)
        assert_falls_as_promised(record, 0.01)


def test_gravity_compensation_keeps_the_energy():
    """A compensated robot keeps its energy; with gravity compensated twice it does not."""
    s = subject(ARM)
    law = dd.GravityCompensation(s.dyn)
    q, qd = configuration(s.model, np.random.default_rng(1)), np.full(7, 0.3)
    record = run(s, lambda _, q, qd: law.command(q, qd), q, qd, 0.5)
    np.testing.assert_allclose(record.K, record.K[0], rtol=0.01)
    doubled = run(s, lambda _, q, qd: law.command(q, qd), q, qd, 0.5, push=lambda p: s.dyn.gravity_torque(p.q))
    assert np.abs(doubled.K / doubled.K[0] - 1).max() > 1


SHIFT, FAR = np.array([0.1, 0.1, -0.1]), np.array([2.0, 0.0, 0.0])
READY = np.array([0.0, -0.5, 0.1, -2.0, 0.1, 1.6, 0.5])
POSE_LAW = {"damping": 12.0, "position_stiffness": 250.0, "orientation_stiffness": 30.0}


def test_pose_is_reached_and_null_motion_damped():
    """The redundant arm comes to rest with the hand on its target, from null motion too; the printed sign diverges."""
    s = subject(ARM)
    law = dd.PoseRegulation(s.dyn, s.link, **POSE_LAW, point=POINT)
    position, axes = law.pose(READY)
    law.aim(position + SHIFT, pin.exp3(np.array([0.3, -0.4, 0.5])) @ axes)
    # At 1 kHz a held effort costs a small wrist some of the promised rate.
    fine = run(s, lambda _, q, qd: law.command(q, qd), READY, np.zeros(7), shortened(1.0, 0.4), 1e-4)
    assert_falls_as_promised(fine, 0.01)
    record = run(s, lambda _, q, qd: law.command(q, qd), READY, np.zeros(7), 3.0)
    error = law.command(record.q, record.qd).error
    assert np.abs(error.position).max() < 1e-3 and np.abs(error.orientation).max() < 3e-3
    assert record.V[-1] < 1e-4 * record.V[0] and np.diff(record.V).max() <= 1e-5 * record.V[0]

    law.aim(position, axes)
    J = dense_frame(s, READY)[2]
    null = np.linalg.svd(J)[2][6]
    assert np.abs(J @ null).max() < 1e-12
    record = run(s, lambda _, q, qd: law.command(q, qd), READY, null, 1.0)
    assert record.K[-1] < 1e-4 * record.K[0]

    def printed(_, q, qd):
        command = law.command(q, qd)
        epsilon = -2 * law.damping * command.nu - command.epsilon
        return command._replace(tau=command.gravity_torque + s.dyn.tau_from_epsilon(q, epsilon))

    law.aim(position + SHIFT, axes)
    wrong = run(s, printed, READY, np.zeros(7), 0.5)
    assert wrong.V[-1] > 1.5 * wrong.V[0]


def test_pose_stalls_as_documented():
    """Nothing pulls at exactly 180° of orientation error; out of reach, the arm comes to rest stretched out."""
    s = subject(ARM)
    law = dd.PoseRegulation(s.dyn, s.link, **POSE_LAW)
    position, axes = law.pose(READY)
    law.aim(None, pin.exp3(np.array([np.pi, 0, 0])) @ axes)
    command = law.command(READY, np.zeros(7))
    assert np.abs(command.epsilon).max() < 1e-12 and np.linalg.norm(command.error.orientation) == pytest.approx(np.pi)
    soft = dd.PoseRegulation(s.dyn, s.link, 12.0, 50.0, 10.0)
    soft.aim(position + FAR)
    record = run(s, lambda _, q, qd: soft.command(q, qd), READY, np.zeros(7), 4.0)
    assert_falls_as_promised(record, 0.01)
    assert record.K[-1] < 1e-3 * record.K.max()


@CLOSED
def test_tracking_converges_at_its_rate(robot):
    """V = V₀ exp(−2kt) within 2 % of its value, down to a hundredth; then q − q_d vanishes."""
    s, rng, k, period = subject(robot), np.random.default_rng(5), 5.0, 5e-4
    law = dd.JointTracking(s.dyn, k, 5.0)
    w = 1.0 + 0.3 * np.arange(s.model.nv)
    for _ in range(shortened(3, 1)):
        centre = configuration(s.model, rng, 0.5)

        def track(t, q, qd, centre=centre):
            sine, cosine = 0.3 * np.sin(w * t), 0.3 * w * np.cos(w * t)
            return law.command(q, qd, centre + sine, cosine, -(w**2) * sine)

        q, qd = centre + 0.3 * rng.normal(size=s.model.nv), rng.normal(size=s.model.nv)
        record = run(s, track, q, qd, 0.46, period)
        np.testing.assert_allclose(record.V, record.V[0] * np.exp(-2 * k * record.time), rtol=0.02)
        assert_falls_as_promised(record, 0.02)
    last = run(s, track, q, qd, 2.5, period)
    assert np.abs(last.q - centre - 0.3 * np.sin(2.5 * w)).max() < 1e-3 * np.abs(q - centre).max() + 1e-3


def test_tracking_goes_to_a_far_target_no_faster_than_it_may():
    """The error closes at most at the given rate, V falls as promised, and the target is reached."""
    s, fastest = subject(UR5), []
    law = dd.JointTracking(s.dyn, 20.0, 10.0, closing=0.5)
    start = np.array([0.3, -1.2, 1.4, -0.6, 0.5, 0.2])
    goal = start + np.array([1.0, 0.3, -0.2, 0.5, -1.0, 0.0])

    def track(_, q, qd):
        fastest.append(np.abs(qd).max())
        return law.command(q, qd, goal)

    record = run(s, track, start, np.zeros(6), 3.5)
    assert 0.49 < max(fastest) < 0.51
    assert_falls_as_promised(record, 0.05)  # a command is held while the reference's acceleration jumps: 2e-5 of V₀
    np.testing.assert_allclose(record.q, goal, atol=1e-3)


def test_documented_example_runs(tmp_path, monkeypatch):
    """The program of docs/control.md reaches its target, K within its bound, without a false alarm."""
    text = (Path(__file__).parents[2] / "docs" / "control.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"<!-- test: run -->\n```python\n(.*?)```", text, re.DOTALL)
    (tmp_path / "panda.urdf").write_text(PANDA.urdf)
    monkeypatch.chdir(tmp_path)
    energies, names = [], {}

    class Recorded(dd.Simulation):
        def advance(self, tau):
            super().advance(tau)
            energies.append(0.5 * self.nu @ self.nu)

    monkeypatch.setattr(dd, "Simulation", Recorded)
    exec(compile(program, "docs/control.md", "exec"), names)
    assert 0.45 < max(energies) < 1.001 * 0.5
    assert np.abs(names["command"].error.position).max() < 2e-3
    assert not names["seen"].collision and names["command"].limited == ()


# --- Input errors ---


def test_unactuated_robots_are_refused():
    bodies = UR5.floating, RANDOM["mobile_tree_20"]
    for robot, reason in zip(bodies, ("floating base", "several degrees of freedom"), strict=True):
        dyn = dd.DiagonalDynamics(dd.load_urdf(robot.source, **robot.options))
        for make, arguments in (
            (dd.GravityCompensation, ()),
            (dd.RateDamping, (1.0,)),
            (dd.JointTracking, (1.0, 1.0)),
            (dd.PoseRegulation, (dyn.model.link_names[-1], 1.0, 1.0, 1.0)),
            (dd.EnergyLimiter, (1.0, 1.0)),
            (dd.PositionRepulsion, (0.1, 1.0)),
        ):
            with pytest.raises(UnsupportedError, match=reason):
                make(dyn, *arguments)


ONE = np.ones(7)
HURT = np.where(np.arange(7) == 2, np.nan, 1.0)
NEGATIVE = np.where(np.arange(7) == 3, -2.0, 1.0)


def pose(dyn, link="panda_hand", damping=1.0, position=1.0, orientation=1.0, point=(0, 0, 0)):
    return dd.PoseRegulation(dyn, link, damping, position, orientation, point)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda d: dd.GravityCompensation(d.model), "dynamics is <RobotModel 'panda'"),
        (lambda d: dd.RateDamping(d, 0.0), "gain of 'panda_joint1' is 0.0"),
        (lambda d: dd.RateDamping(d, NEGATIVE), "gain of 'panda_joint4' is -2.0"),
        (lambda d: dd.RateDamping(d, HURT), "gain of 'panda_joint3' is nan"),
        (lambda d: dd.RateDamping(d, np.inf), "gain of 'panda_joint1' is inf"),
        (lambda d: dd.RateDamping(d, [1.0, 2.0]), "gain is"),
        (lambda d: dd.RateDamping(d, "strong"), "gain is 'strong'"),
        (lambda d: dd.RateDamping(d, 1.0).command(HURT, ONE), "q of joint 'panda_joint3' is nan"),
        (lambda d: dd.RateDamping(d, 1.0).command(ONE, ONE[:3]), "qd has shape"),
        (lambda d: dd.JointTracking(d, 1.0, 1.0, 0.0), "closing of 'panda_joint1' is 0.0"),
        (lambda d: dd.JointTracking(d, 1.0, -1), "convergence of 'panda_joint1' is -1.0"),
        (lambda d: dd.JointTracking(d, 1, 1).command(HURT, ONE, ONE), "q of joint 'panda_joint3'"),
        (lambda d: dd.JointTracking(d, 1, 1).command(ONE, ONE, HURT), "desired_q of joint 'panda_joint3'"),
        (lambda d: dd.JointTracking(d, 1, 1).command(ONE, ONE, ONE, 3), "desired_qd is 3"),
        (lambda d: dd.JointTracking(d, 1, 1).command(ONE, ONE, ONE, ONE, HURT), "desired_qdd of joint 'panda_joint3'"),
        (lambda d: pose(d, "hand"), "'hand' is not a link"),
        (lambda d: pose(d, damping=0), "damping of 'panda_joint1' is 0.0"),
        (lambda d: pose(d, position=-1), "position_stiffness of 'x' is -1.0"),
        (lambda d: pose(d, orientation="a"), "orientation_stiffness is 'a'"),
        (lambda d: pose(d, point=(0, 0)), "point is"),
        (lambda d: pose(d).command(ONE, ONE), "no target"),
        (lambda d: pose(d).aim(), "nothing to aim at"),
        (lambda d: pose(d).aim((0, np.nan, 1)), "position is"),
        (lambda d: pose(d).aim(None, (0, 0, 0, 2)), "of length 2"),
        (lambda d: pose(d).aim(None, 2 * np.eye(3)), "expected a rotation matrix"),
        (lambda d: pose(d).aim(None, np.diag([1, 1, -1])), "expected a rotation matrix"),
        (lambda d: pose(d).aim(None, [[1], [1, 2]]), "expected a rotation matrix"),
    ],
)
def test_errors_name_the_argument(make, key):
    with pytest.raises(InputError, match=key):
        make(subject(ARM).dyn)


def test_rejected_targets_leave_the_old_one():
    law = pose(subject(ARM).dyn)
    law.aim(*law.pose(READY))
    with pytest.raises(InputError):
        law.aim((0, 0, 0), np.zeros(4))
    assert np.abs(law.command(READY, np.zeros(7)).epsilon).max() < 1e-10


def test_commands_share_no_arrays():
    """Two commands share no array, and a caller may change the gains that it passed."""
    gain = np.ones(7)
    law = dd.RateDamping(subject(ARM).dyn, gain)
    gain[:] = 99.0
    first = law.command(READY, ONE)
    kept = [x.copy() for x in first[:4]]
    second = law.command(2 * READY, 2 * ONE)
    for x, y, z in zip(first[:4], kept, second[:4], strict=True):
        assert (x == y).all() and not np.shares_memory(x, z)
    assert np.allclose(first.epsilon, -first.nu)
    with pytest.raises(ValueError, match="read-only"):
        law.gain[0] = 5.0


def test_all_public_names_are_in_the_package():
    for name in set(control.__all__) - {"Command", "PoseError"}:
        assert getattr(dd, name) is getattr(control, name)


PLACED = (
    PANDA,
    UR5,
    TREE,
    RANDOM["mobile_tree_20"],
    RANDOM["mobile_tree_21"],
    RANDOM["random_tree_0"].floating,
)


@pytest.mark.parametrize("robot", PLACED, ids=lambda robot: robot.id)
def test_placement(robot):
    """Every link is where Pinocchio has it: mimic, planar and floating joints included."""
    model = dd.load_urdf(robot.source, **robot.options)
    o, dyn = Coupled(robot.urdf, model.dof_names, **robot.options), dd.DiagonalDynamics(model)
    full = o.full
    for sample in robots.samples(robot.id, o):
        pin.framesForwardKinematics(full.model, full.data, full.configuration(o.q_full(sample.q)))
        for link in model.link_names:
            expected = full.data.oMf[full.model.getFrameId(link, pin.FrameType.BODY)].homogeneous
            np.testing.assert_allclose(dyn.placement(sample.q, link), expected, rtol=0, atol=1e-12)
    with pytest.raises(InputError, match="'nowhere'"):
        dyn.placement(model.neutral, "nowhere")
