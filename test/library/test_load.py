# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The estimator of loads: on external torques of Pinocchio's bodies and forces, low-passed with
noise.
"""

import numpy as np
import pytest

import diag_dynamics as dd
from controlled import RANDOM
from coupling import NAMED, Coupled
from described import subject
from diag_dynamics.exceptions import InputError
from loads import GAIN, STEP, Arm, low_pass

MIMIC = (NAMED["nested three deep"], NAMED["several followers of one leader"])
TREES = {r.id: r for r in (RANDOM["mobile_tree_20"], RANDOM["random_tree_0"].floating, *MIMIC)}
CENTER = (0.04, 0.02, -0.05)
TILTED = (3.0, -2.0, -9.0)


def no_inertia(mass, center=CENTER):
    """Inertia about the centre of a body that has none about the link's origin, as the estimator
    assumes.
    """
    c = np.array(center)
    return mass * (np.outer(c, c) - c @ c * np.eye(3))


def estimates(estimator, motion, seen):
    """The results for states STEP apart, of which the observer has no result for the first."""
    torques = [None, *seen[1:]]
    return [
        estimator.update(k * STEP, q, qd, torques[k])
        for k, (q, qd) in enumerate(zip(*motion[:2], strict=True))
    ]


def estimator_of(arm):
    return dd.LoadEstimator(arm.dynamics, arm.link, GAIN, np.diag(arm.deviation**2))


def check_counts(count, seed=0):
    """Of loads and pushes of both arms, 95 % of the loads and no push of 0.3 s are recognized as
    loads in time.
    """
    for name in ("panda", "ur5"):
        arm = Arm(name)
        rng = np.random.default_rng(seed)
        moving = [
            link
            for link in arm.dynamics.model.link_names
            if arm.dynamics.model.placement_in_body(link)[0] > 1
        ]
        loads = []
        pushes = []
        errors = []
        for _ in range(count):
            mass = rng.uniform(0.2, 3.0)
            center = rng.uniform(-0.1, 0.1, 3)
            motion = arm.motion(rng, np.arange(0.0, 3.0, STEP))
            torque = arm.load_torque(motion, mass, center)
            torque[: round(1.0 / STEP)] = 0.0  # picked up after 1 s of motion without it
            result = estimates(estimator_of(arm), motion, arm.observed(rng, torque))
            loads.append(any(estimate.is_load for estimate in result))
            errors.append(
                abs(result[-1].mass - mass) - 0.2 * mass - 3.0 * result[-1].mass_deviation
            )
            time = np.arange(0.0, 2.0, STEP)
            force = rng.normal(size=3)
            force *= rng.uniform(10.0, 60.0) / np.linalg.norm(force)
            motion = arm.motion(rng, time)
            during = (time >= 0.5) & (time < 0.8)
            push = arm.push_torque(
                motion[0], rng.choice(moving), rng.uniform(-0.1, 0.1, 3), during[:, None] * force
            )
            result = estimates(estimator_of(arm), motion, arm.observed(rng, push))
            pushes.append(any(estimate.is_load for estimate in result))
        assert np.mean(loads) >= 0.95, (name, np.mean(loads))
        assert not any(pushes), name
        assert max(errors) < 0.0, name  # a part of the mass is missing by states before the pick-up


def test_loads_are_recognized_and_pushes_are_not():
    check_counts(6)


@pytest.mark.full
def test_many_loads_are_recognized_and_pushes_are_not():
    check_counts(150, seed=1)


@pytest.mark.parametrize("name, gravity", [("panda", TILTED), ("ur5", (0.0, 0.0, -9.81))])
def test_mass_and_center_are_exact_without_noise(name, gravity):
    arm = Arm(name, gravity)
    rng = np.random.default_rng(2)
    motion = arm.motion(rng, np.arange(0.0, 2.0, STEP))
    seen = low_pass(arm.load_torque(motion, 1.3, CENTER, no_inertia(1.3)))
    covariance = 1e-6 * np.eye(arm.dynamics.model.nv)
    last = estimates(dd.LoadEstimator(arm.dynamics, arm.link, GAIN, covariance), motion, seen)[-1]
    assert last.is_load and last.explained > 1.0 - 1e-6
    assert last.mass == pytest.approx(1.3, rel=2e-4)
    np.testing.assert_allclose(last.center, CENTER, atol=1e-4)


def is_mimic(model, link):
    """Return whether a mimic joint with another multiplier than 1 moves a link."""
    body = model.bodies[model.placement_in_body(link)[0]]
    return body["multiplier"] not in (0.0, 1.0)


@pytest.mark.parametrize("id", TREES)
def test_any_tree_carries_a_load(id):
    """Mimic joints, planar joints and a floating base, at constant rates."""
    s = subject(TREES[id])
    rng = np.random.default_rng(3)
    model = s.dyn.model
    oracle = s.oracle
    link = max(
        model.link_names, key=lambda name: (is_mimic(model, name), model.placement_in_body(name)[0])
    )
    start = oracle.moved(oracle.neutral, rng.uniform(-0.8, 0.8, model.nv))
    rate = rng.normal(size=model.nv)
    still = np.zeros(model.nv)
    count = 400
    step = 0.5 * STEP
    q = np.array([oracle.moved(start, k * step * rate) for k in range(count)])
    torque = np.array([oracle.inverse_dynamics(estimate, rate, still) for estimate in q])
    loaded = Coupled(
        TREES[id].urdf,
        model.dof_names,
        payloads={link: (0.8, CENTER, no_inertia(0.8))},
        **TREES[id].options,
    )
    torque -= [loaded.inverse_dynamics(estimate, rate, still) for estimate in q]
    estimator = dd.LoadEstimator(s.dyn, link, GAIN, 1e-8 * np.eye(model.nv))
    seen = low_pass(torque, step)
    for k in range(count):
        last = estimator.update(k * step, q[k], rate, seen[k] if k else None)
    assert last.explained > 1.0 - 1e-5
    np.testing.assert_allclose(estimator.torque, seen[-1], atol=1e-3 * np.abs(seen[-1]).max())
    if not model.mimics:  # whose few joints do not show all parameters
        assert last.mass == pytest.approx(0.8, rel=1e-3)
        np.testing.assert_allclose(last.center, CENTER, atol=1e-3)


def test_load_ends_when_it_is_put_down():
    arm = Arm("panda")
    rng = np.random.default_rng(4)
    motion = arm.motion(rng, np.arange(0.0, 4.0, STEP))
    torque = arm.load_torque(motion, 1.5, (0.0, 0.0, 0.1))
    torque[500:] = 0.0  # after 2 s
    result = estimates(estimator_of(arm), motion, arm.observed(rng, torque))
    assert result[490].is_load and not any(estimate.is_load for estimate in result[700:])
    assert abs(result[-1].mass) < 0.4  # after three time constants of the memory
    assert result[490].mass == pytest.approx(1.5, abs=3.0 * result[490].mass_deviation)
    assert (np.abs(result[490].center - (0.0, 0.0, 0.1)) < 3.0 * result[490].center_deviation).all()


def test_accepted_payload_takes_the_load_off():
    """The estimate and the payload that was there are one payload; the model with it needs no
    external torque.
    """
    arm = Arm("ur5")
    rng = np.random.default_rng(5)
    motion = arm.motion(rng, np.arange(0.0, 2.0, STEP))
    seen = low_pass(arm.load_torque(motion, 2.0, CENTER, no_inertia(2.0)))
    model = arm.dynamics.model.with_payload(arm.link, 0.5, (0.0, 0.0, 0.02), 1e-3 * np.eye(3))
    dynamics = dd.DiagonalDynamics(model)
    covariance = 1e-6 * np.eye(6)
    estimator = dd.LoadEstimator(dynamics, arm.link, GAIN, covariance)
    with pytest.raises(InputError, match="unknown"):
        estimator.payload()
    estimates(estimator, motion, seen)
    mass, center, _ = estimator.payload()
    assert mass == pytest.approx(2.5, rel=1e-3)
    np.testing.assert_allclose(
        center, np.multiply(CENTER, 0.8) + np.array([0.0, 0.0, 0.004]), atol=1e-3
    )
    after = dd.DiagonalDynamics(model.with_payload(arm.link, *estimator.payload()))
    q = motion[0][-1]
    still = np.zeros(6)  # at rest, where the inertia does not matter
    added = after.gravity_torque(q) - dynamics.gravity_torque(q)
    needed = -arm.load_torque((q[None], still[None], still[None]), 2.0, CENTER)[0]
    np.testing.assert_allclose(added, needed, atol=0.01)
    estimator.use(after)
    assert not estimator.update(0.0, q, still, still).valid
    with pytest.raises(InputError, match="unknown: first state"):
        estimator.payload()


def test_reset_and_wrong_arguments():
    arm = Arm("ur5")
    rng = np.random.default_rng(6)
    q, qd, _ = arm.motion(rng, np.arange(0.0, 0.1, STEP))
    estimator = estimator_of(arm)
    torque = np.full(6, 0.5)
    assert not estimator.update(0.0, q[0], qd[0], torque).valid
    second = estimator.update(STEP, q[1], qd[1], torque)
    assert second.valid and estimator.update(STEP, q[1], qd[1], 2.0 * torque) is second
    assert not estimator.update(0.5 * STEP, q[1], qd[1], torque).valid  # time went back
    assert estimator.update(2.0 * STEP, q[2], qd[2], torque).valid
    assert not estimator.update(3.0 * STEP, q[3], qd[3], None).valid
    estimator.update(4.0 * STEP, q[4], qd[4], torque)
    with pytest.raises(InputError, match="external_torque"):
        estimator.update(5.0 * STEP, q[5], qd[5], [np.nan] * 6)
    with pytest.raises(InputError, match="covariance"):
        dd.LoadEstimator(arm.dynamics, arm.link, GAIN, np.zeros((6, 6)))
    with pytest.raises(InputError, match="covariance"):
        dd.LoadEstimator(arm.dynamics, arm.link, GAIN, np.eye(5))
    with pytest.raises(InputError, match="base_link"):
        dd.LoadEstimator(arm.dynamics, "base_link", GAIN, np.eye(6))
    with pytest.raises(InputError, match="'hook'; expected"):
        dd.LoadEstimator(arm.dynamics, "hook", GAIN, np.eye(6))


def test_payload_that_is_put_down():
    """A negative load takes the payload off; without a payload it is none."""
    arm = Arm("panda")
    rng = np.random.default_rng(7)
    motion = arm.motion(rng, np.arange(0.0, 2.0, STEP))
    seen = arm.observed(rng, -arm.load_torque(motion, 1.0, CENTER))
    assert not any(estimate.is_load for estimate in estimates(estimator_of(arm), motion, seen))
    carrying = dd.DiagonalDynamics(
        arm.dynamics.model.with_payload(arm.link, 1.0, CENTER, 1e-3 * np.eye(3))
    )
    estimator = dd.LoadEstimator(carrying, arm.link, GAIN, np.diag(arm.deviation**2))
    last = estimates(estimator, motion, seen)[-1]
    assert last.is_load and last.mass == pytest.approx(-1.0, abs=3.0 * last.mass_deviation)
    assert estimator.payload().mass == 0.0
    seen = arm.observed(rng, -arm.load_torque(motion, 0.6, CENTER))  # a part of it
    estimates(estimator, motion, seen)
    mass, _, inertia = estimator.payload()
    assert mass == pytest.approx(0.4, abs=3.0 * last.mass_deviation)
    np.testing.assert_allclose(inertia, mass * 1e-3 * np.eye(3), rtol=1e-9)


def test_gravity_that_turns_keeps_the_estimate():
    arm = Arm("ur5")
    rng = np.random.default_rng(8)
    motion = arm.motion(rng, np.arange(0.0, 1.0, STEP))
    estimator = estimator_of(arm)
    before = estimates(estimator, motion, arm.observed(rng, arm.load_torque(motion, 2.0, CENTER)))[
        -1
    ]
    turned = dd.DiagonalDynamics(arm.dynamics.model.with_gravity(TILTED))
    estimator.use(turned)
    assert estimator.last is before
    assert estimator.update(1.0, motion[0][-1], motion[1][-1], np.zeros(6)).valid
    estimator.use(dd.DiagonalDynamics(arm.dynamics.model.with_payload(arm.link, 1.0)))
    assert not estimator.last.valid


def at_rest(arm, count):
    """Positions, rates and accelerations at the ready pose."""
    still = np.zeros((count, arm.dynamics.model.nv))
    return still + arm.motion(np.random.default_rng(9), np.zeros(1))[0], still, still


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("name, size", [("panda", 60.0), ("ur5", 30.0)])
def test_long_pushes_are_no_loads(name, size, moves):
    """Downwards, as a weight, while the arm is at rest; sideways while it moves."""
    arm = Arm(name)
    rng = np.random.default_rng(10)
    time = np.arange(0.0, 6.0, STEP)
    motion = arm.motion(rng, time) if moves else at_rest(arm, len(time))
    force = np.tile([size, 0.0, 0.0] if moves else [0.0, 0.0, -size], (len(time), 1))
    push = arm.push_torque(motion[0], arm.link, np.array(CENTER), force)
    assert np.abs(push).max() > 5.0
    for duration in (1.0, 2.0, 5.0):
        during = ((time >= 0.5) & (time < 0.5 + duration))[:, None]
        observed = arm.observed(rng, during * push)
        assert not any(
            estimate.is_load for estimate in estimates(estimator_of(arm), motion, observed)
        )


def test_load_begins_in_motion_and_lasts_at_rest():
    arm = Arm("panda")
    rng = np.random.default_rng(11)
    moving = arm.motion(rng, np.arange(0.0, 2.0, STEP))
    count = 500
    last = [np.repeat(estimate[-1:], 2 * count, axis=0) for estimate in moving]
    last[1:] = np.zeros((2, *last[0].shape))  # stands after the motion, and before it
    for parts, expected in (([moving, last], True), ([last], False), ([last, moving], True)):
        motion = [np.concatenate(estimate) for estimate in zip(*parts, strict=True)]
        torque = arm.load_torque(motion, 1.5, CENTER)
        result = estimates(estimator_of(arm), motion, arm.observed(rng, torque))
        assert result[-1].is_load == expected
        if parts[0] is last:
            assert not any(estimate.is_load for estimate in result[: 2 * count])


def test_far_centre_is_no_load():
    arm = Arm("ur5")
    rng = np.random.default_rng(13)
    motion = arm.motion(rng, np.arange(0.0, 2.0, STEP))
    for distance, expected in ((0.37, True), (0.43, False)):
        center = (0.0, 0.0, distance)
        torque = low_pass(arm.load_torque(motion, 1.5, center, no_inertia(1.5, center)))
        last = estimates(
            dd.LoadEstimator(arm.dynamics, arm.link, GAIN, 1e-6 * np.eye(6)), motion, torque
        )[-1]
        assert last.center[2] == pytest.approx(distance, abs=0.01) and last.is_load == expected


def test_energy_near_that_of_the_noise_is_no_load():
    arm = Arm("panda")
    rng = np.random.default_rng(14)
    motion = arm.motion(rng, np.arange(0.0, 3.0, STEP))
    seen = low_pass(arm.load_torque(motion, 1.0, CENTER))
    square = np.mean((seen / arm.deviation) ** 2, axis=1)
    weights = np.exp(-np.arange(len(seen)) * STEP / 0.5)
    mean = np.convolve(square, weights)[: len(seen)] / np.cumsum(
        weights
    )  # of energy in that of the noise
    for level, expected in ((1.9 / mean.max(), False), (2.1 / mean[300:].min(), True)):
        last = estimates(estimator_of(arm), motion, np.sqrt(level) * seen)[-1]
        assert last.is_significant and last.explained > 0.9 and last.is_load == expected


def test_error_of_the_mass_that_is_put_down():
    """A tenth of the payload's mass counts as none."""
    arm = Arm("ur5")
    rng = np.random.default_rng(15)
    motion = arm.motion(rng, np.arange(0.0, 2.0, STEP))
    carrying = dd.DiagonalDynamics(arm.dynamics.model.with_payload(arm.link, 1.0, CENTER))
    for mass, remaining in ((1.2, None), (1.08, 0.0), (0.92, 0.0), (0.8, 0.2)):
        estimator = dd.LoadEstimator(carrying, arm.link, GAIN, 1e-6 * np.eye(6))
        last = estimates(estimator, motion, low_pass(-arm.load_torque(motion, mass, CENTER)))[-1]
        assert last.mass == pytest.approx(-mass, abs=1e-2) and last.is_load == (
            remaining is not None
        )
        if remaining is not None:
            assert estimator.payload().mass == pytest.approx(remaining, abs=1e-2)


def test_reset_while_the_observer_goes_on():
    arm = Arm("panda")
    rng = np.random.default_rng(16)
    motion = arm.motion(rng, np.arange(0.0, 2.0, STEP))
    seen = low_pass(arm.load_torque(motion, 1.5, CENTER, no_inertia(1.5)))
    estimator = dd.LoadEstimator(arm.dynamics, arm.link, GAIN, 1e-6 * np.eye(7))
    for k, (q, qd) in enumerate(zip(*motion[:2], strict=True)):
        if k == 250:
            estimator.reset()
            assert not estimator.last.valid
        last = estimator.update(k * STEP, q, qd, seen[k] if k else None)
        if k >= 260:
            assert last.mass == pytest.approx(1.5, abs=0.01), k
    assert last.is_load
