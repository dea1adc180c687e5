# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact limiter: energy and force along the motion of the worst point stay below their limits, whatever is asked."""

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.contact import contact_force
from robots import TwoLinkArm, robot

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

PANDA = "panda_description/urdf/panda.urdf"
FINGERS = dict.fromkeys(("panda_finger_joint1", "panda_finger_joint2"), 0.0)
LIMITS = dd.ContactLimits({"energy": {"energy": 0.3}, "force": {"mass": 4.0, "stiffness": 3e4, "force": 80.0}})


@pytest.fixture(scope="module")
def arm():
    """Return the Panda, its dynamics, and points of all links with limits of energy and force."""
    urdf = robot(PANDA).urdf
    model = dd.load_urdf(urdf, locked_joints=FINGERS)
    points = dd.ContactPoints(model, dd.link_geometry(model, urdf, "frames").points, LIMITS, "limit")
    return model, dd.DiagonalDynamics(model), points


def plant(model, q, qd, h):
    nothing = np.zeros(model.nv)
    return dd.Simulation(model, q, qd, step=h, limits=False, effort_limits=False, damping=nothing, friction=nothing)


class Swing:
    """A motion of all joints at speeds that break the limits, tracked; `limiter` is what its commands pass through."""

    def __init__(self, arm, seed, h, limiter=None):
        self.model, self.dyn, self.points = arm
        rng, n = np.random.default_rng(seed), self.model.nv
        self.h, self.limiter, self.law = h, limiter, dd.JointTracking(self.dyn, 20.0, 10.0)
        self.centre = np.clip(0.5 * (self.model.lower + self.model.upper), -2, 2)
        self.size, self.pace, self.phase = 0.5 * rng.uniform(0.5, 1, n), rng.uniform(1, 3, n), rng.uniform(0, 6, n)
        self.plant = plant(self.model, self.centre + self.size * np.sin(self.phase), np.zeros(n), h)
        self.k, self.limited = 0, 0

    def step(self, push=None):
        """One cycle; returns the largest part of an allowed speed before it, and the change of ε that the limiter made."""
        angle = self.pace * self.k * self.h + self.phase
        q, qd = self.plant.q, self.plant.qd
        goal = (
            self.size * np.sin(angle),
            self.size * self.pace * np.cos(angle),
            -self.size * self.pace**2 * np.sin(angle),
        )
        asked = self.law.command(q, qd, self.centre + goal[0], *goal[1:])
        command = self.limiter.filter(q, qd, asked, self.h) if self.limiter else asked
        self.plant.advance(command.tau if push is None else command.tau + push)
        self.k += 1
        self.limited += command is not asked
        return self.dyn.contact(q, qd, self.points).usage.max(), command, asked


@pytest.mark.parametrize("h", [1e-3, 4e-3])
def test_no_limit_is_exceeded(arm, h):
    """Of motions that would exceed them by far: no point of any link is ever above its limit of energy or force."""
    for seed in range(3):
        free, bound = Swing(arm, seed, h), Swing(arm, seed, h, dd.ContactLimiter(arm[1], arm[2], 30.0))
        steps = range(int(1.0 / h))
        assert max(free.step()[0] for _ in steps) > 1.3
        usage = [bound.step()[0] for _ in steps]
        assert 0.9 < max(usage) <= 1.0 and bound.limited > 10


def test_each_limit_by_its_own_formula(arm):
    """½mv² stays below the energy, v√(μk) below the force: at every point, by the mass and speed there."""
    bound = Swing(arm, 1, 2e-3, dd.ContactLimiter(arm[1], arm[2], 30.0))
    for _ in range(400):
        q, qd = bound.plant.q, bound.plant.qd
        bound.step()
        for link in ("panda_link4", "panda_hand"):
            v = bound.dyn.link_velocity(q, qd, link)[:3]
            if v.any():
                m = bound.dyn.reflected_mass(q, link, v)
                assert 0.5 * m * v @ v <= 0.3 and contact_force(np.linalg.norm(v), m, 3e4, 4.0) <= 80.0


def test_power_is_only_taken_away_and_slow_commands_pass(arm):
    """What the limiter changes takes power out of ν; a command that is far from any limit is the same object."""
    limiter = dd.ContactLimiter(arm[1], arm[2], 30.0)
    bound = Swing(arm, 2, 1e-3, limiter)
    for _ in range(600):
        _, command, asked = bound.step()
        if command is not asked:
            assert (command.epsilon - asked.epsilon) @ asked.nu < 1e-6
            taken = bound.dyn.tau_from_epsilon(bound.plant.q, command.epsilon - asked.epsilon)
            assert np.linalg.norm(command.tau - asked.tau - taken) < 0.05 * np.linalg.norm(taken)
    assert bound.limited
    model, dyn, _ = arm
    q = model.neutral + 0.1
    resting = dyn_command(dyn, q)
    assert limiter.filter(q, np.zeros(model.nv), resting, 1e-3) is resting
    assert limiter.seen.worst == -1 and limiter.seen.energy == 0.0


def dyn_command(dyn, q):
    return dd.GravityCompensation(dyn).command(q, np.zeros(len(q)))


def test_a_scale_lowers_the_bound(arm):
    """At half of the speeds a quarter of the energy; at zero the robot comes to rest, and no limit is above on the way."""
    limiter = dd.ContactLimiter(arm[1], arm[2], 30.0)
    bound = Swing(arm, 0, 2e-3, limiter)
    for _ in range(300):
        bound.step()
    limiter.scale = 0.5
    usage = [bound.step()[0] for _ in range(300)]
    assert max(usage[150:]) <= 0.5 and max(usage) <= 1.0
    limiter.scale = 0.0
    usage = [bound.step()[0] for _ in range(300)]
    assert usage[-1] < 0.01
    with pytest.raises(dd.InputError, match="scale"):
        limiter.scale = 1.5


def test_a_push_comes_on_top_and_is_taken_out(arm):
    """What a push puts in is above the bound, is said to be, and is gone after it; the command adds none of it."""
    _, dyn, points = arm
    limiter = dd.ContactLimiter(dyn, points, 30.0)
    bound = Swing(arm, 0, 1e-3, limiter)
    for _ in range(200):
        bound.step()
    push = dyn.jacobian(bound.plant.q, "panda_hand", frame="world")[:3].T @ np.array([60.0, 40.0, 0.0])
    pushed = [bound.step(push)[0] for _ in range(60)]
    assert max(pushed) > 1.05
    after = []
    for _ in range(300):
        after.append(bound.step()[0])
        assert limiter.seen.worst < 0 or (limiter.seen.energy > limiter.seen.limit) == (after[-1] > 1.0)
    assert max(after[200:]) <= 1.0
    known = dd.ContactLimiter(dyn, points, 30.0)  # of a push that is known, nothing comes on top
    bound = Swing(arm, 0, 1e-3)
    for k in range(260):
        q, qd = bound.plant.q, bound.plant.qd
        asked = bound.law.command(q, qd, q, np.zeros(7), np.zeros(7))
        force = push if k >= 200 else np.zeros(7)
        command = known.filter(q, qd, asked, 1e-3, dyn.epsilon_from_tau(q, force))
        bound.plant.advance(command.tau + force)
        assert known.seen.contact.usage.max() <= 1.0


def test_why_the_motion_itself_is_not_the_direction(arm):
    """Where a point is far lighter across its motion than along it, a brake along the motion makes its energy grow.

    The impulse Λv, which slows it without turning it, never does.
    """
    model = dd.load_urdf(TwoLinkArm().urdf)
    dyn, rng = dd.DiagonalDynamics(model), np.random.default_rng(0)
    tip, grown, steepest = model.link_names[-1], 0, 0.0
    for _ in range(400):
        q, qd = np.array([0.3, rng.uniform(0.05, 0.4)]), rng.normal(size=2)
        v = dyn.link_velocity(q, qd, tip, (1, 0, 0))[:3]
        W = dyn.operational_inverse_inertia(q, tip, (1, 0, 0))[:3, :3]
        energy = 0.5 * (v @ v) ** 2 / (v @ W @ v)
        ratio = (W @ v) @ (W @ v) * (v @ v) / (v @ W @ v) ** 2  # 1/cos² of the angle between v and Wv

        def after(impulse, q=q, qd=qd):
            w = dyn.epsilon_from_wrench(q, tip, [*impulse, 0, 0, 0], (1, 0, 0))
            u = dyn.link_velocity(q, qd - dyn.qd_from_nu(q, w), tip, (1, 0, 0))[:3]
            return 0.5 * (u @ u) ** 2 / (u @ dyn.operational_inverse_inertia(q, tip, (1, 0, 0))[:3, :3] @ u)

        little = 1e-4
        along = after(little * v / np.linalg.norm(W @ v) * np.linalg.norm(v))
        assert after(little * np.linalg.pinv(W, rcond=1e-9) @ v) == pytest.approx((1 - little) ** 2 * energy, rel=1e-8)
        assert (along > energy) == (ratio > 2.0) or abs(ratio - 2.0) < 0.05
        grown += along > energy
        steepest = max(steepest, ratio)
    assert grown > 5 and steepest > 4.0


def test_what_is_wrong_is_named(arm):
    model, dyn, points = arm
    with pytest.raises(dd.InputError, match="no limit"):
        dd.ContactLimiter(dyn, dd.ContactPoints(model, [("tip", "panda_hand")]), 30.0)
    with pytest.raises(dd.InputError, match="rate"):
        dd.ContactLimiter(dyn, points, 0.0)
    limiter = dd.ContactLimiter(dyn, points, 30.0)
    with pytest.raises(dd.InputError, match="period"):
        limiter.filter(model.neutral, np.zeros(7), dyn_command(dyn, model.neutral), 0.0)
