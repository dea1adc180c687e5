# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The disturbance observer: on prescribed motions, with efforts of Pinocchio less a known external
torque.
"""

import numpy as np
import pytest

import diag_dynamics as dd
from controlled import ARM, PANDA, RANDOM, READY, UR5
from described import subject
from diag_dynamics.exceptions import InputError
from motions import recorded

ROBOTS = {
    r.id: r
    for r in (
        ARM,
        PANDA,
        RANDOM["geared_tree_10"],
        RANDOM["mobile_tree_20"],
        RANDOM["random_tree_0"].floating,
    )
}
N, GAIN = 7, 25.0
GAINS = np.linspace(20.0, 80.0, N)
ROBOTS |= {UR5.id: UR5}


class Motion:
    """A motion at constant joint rates, and an external torque that changes."""

    def __init__(self, id, seed=0):
        self.s = subject(ROBOTS[id])
        rng = np.random.default_rng(seed)
        o = self.s.oracle
        self.start = o.moved(o.neutral, rng.uniform(-0.8, 0.8, o.nv))
        self.rate = 0.7 * rng.normal(size=o.nv)
        self.push = 3.0 * rng.normal(size=(2, o.nv))

    def q(self, t):
        return self.s.oracle.moved(self.start, t * self.rate)

    def external(self, t):
        return self.push[0] + self.push[1] * np.sin(9.0 * t)

    def effort(self, t):
        return self.s.oracle.inverse_dynamics(
            self.q(t), self.rate, np.zeros_like(self.rate)
        ) - self.external(t)

    def residual(self, end, gain, step=2e-4):
        """r(end), with the convolution of τ_ext with the filter by Simpson's rule from zero."""
        t = np.linspace(0.0, end, 2 * round(0.5 * end / step) + 1)
        weights = np.where(np.arange(len(t)) % 2, 4.0, 2.0)
        weights[[0, -1]] = 1.0
        weights *= (t[1] - t[0]) / 3
        kernel = gain * np.exp(-gain * (end - t)) * weights
        torque = kernel @ np.array([self.external(s) for s in t])
        return np.linalg.solve(self.s.oracle.factor(self.q(end)), torque)


def observe(motion, times, gain=GAIN, **options):
    """The observer's results at these times."""
    observer = dd.DisturbanceObserver(motion.s.dyn, gain, **{"friction": False} | options)
    return [observer.update(t, motion.q(t), motion.rate, motion.effort(t)) for t in times]


@pytest.mark.parametrize("id", ROBOTS)
def test_residual_is_the_filtered_disturbance(id):
    """Filtered τ_ext, to second order in the sample interval; and τ_ext ≈ m r, by Pinocchio's m."""
    motion = Motion(id)
    end = 0.24
    truth = motion.residual(end, GAIN)
    errors = []
    for count in (60, 120, 240):
        results = observe(motion, np.linspace(0, end, count + 1))
        assert not results[0].valid and all(result.valid for result in results[1:])
        errors.append(np.linalg.norm(results[-1].residual - truth))
    assert errors[2] < 1e-3 * np.linalg.norm(truth)
    assert 3.5 < errors[0] / errors[1] < 4.5 and 3.5 < errors[1] / errors[2] < 4.5
    last = results[-1]
    m = motion.s.oracle.factor(motion.q(end))
    np.testing.assert_allclose(last.external_torque, m @ last.residual, rtol=1e-9, atol=1e-9)
    assert last.norm == pytest.approx(np.linalg.norm(last.residual), rel=1e-14)
    M = motion.s.oracle.mass_matrix(motion.q(end))
    assert last.norm**2 == pytest.approx(
        last.external_torque @ np.linalg.solve(M, last.external_torque), rel=1e-8
    )


def test_the_torque_is_that_of_the_momentum_observer():
    """Of p = M q̇ with Pinocchio's M, C_s and g and a gain of each joint, on uneven steps and with
    the last efforts held.
    """
    motion = Motion("panda_arm")
    rng = np.random.default_rng(5)
    o = motion.s.oracle
    times = np.cumsum(rng.uniform(1e-3, 2e-2, 40))
    for effort in ("sampled", "held"):
        seen = observe(motion, times, GAINS, effort=effort)
        q = [motion.q(t) for t in times]
        tau = np.array([motion.effort(t) for t in times])
        p = np.array([o.mass_matrix(x) @ motion.rate for x in q])
        rate = np.array(
            [o.coriolis_matrix(x, motion.rate).T @ motion.rate - o.gravity_torque(x) for x in q]
        )
        torque = np.zeros(N)
        for k, dt in enumerate(np.diff(times), 1):
            applied = tau[k] if effort == "held" else 0.5 * (tau[k - 1] + tau[k])
            external = (p[k] - p[k - 1]) / dt - applied - 0.5 * (rate[k - 1] + rate[k])
            torque = external + np.exp(-GAINS * dt) * (torque - external)
            np.testing.assert_allclose(seen[k].external_torque, torque, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("options", [{}, {"friction": True}, {"friction": False}], ids=str)
def test_friction(options):
    """Without friction in the observer r follows −ε_fric; Coulomb friction and damping are those of
    the description.
    """
    urdf = PANDA.urdf.replace('damping="0.003" friction="0.0"', 'damping="2.0" friction="1.5"')
    model = dd.load_urdf(urdf, **ARM.options)
    motion = Motion("panda_arm")
    motion.push[:] = 0.0
    friction = 2.0 * motion.rate + 1.5 * np.tanh(motion.rate / 5e-3)
    observer = dd.DisturbanceObserver(dd.DiagonalDynamics(model), GAIN, **options)
    for t in np.arange(0, 0.4, 1e-3):
        seen = observer.update(t, motion.q(t), motion.rate, motion.effort(t) + friction)
    expected = np.linalg.solve(subject(ARM).oracle.factor(motion.q(t)), -friction) * (
        not options.get("friction", True)
    )
    assert np.linalg.norm(seen.residual - expected) < max(1e-4, 0.05 * np.linalg.norm(expected))


def test_friction_that_depends_on_the_load():
    motion = Motion("panda_arm")
    motion.push[:] = 0.0
    name = motion.s.model.dof_names[1]
    gravity = motion.s.oracle.gravity_torque
    model = motion.s.model.with_parameters(
        {"joints": {name: {"load_friction": 0.1, "root_friction": 0.5}}}
    )
    rate = motion.rate[1]
    root = 0.5 * rate / np.sqrt(np.abs(rate))
    dyn = dd.DiagonalDynamics(model)
    times = np.arange(0.0, 0.3, 1e-3)
    observer = dd.DisturbanceObserver(dyn, GAIN)
    efforts = []
    for t in times:
        effort = motion.effort(t) + 0.003 * motion.rate  # damping of the description
        effort[1] += 0.1 * abs(gravity(motion.q(t))[1]) * np.tanh(rate / 5e-3) + root
        efforts.append(effort)
        seen = observer.update(t, motion.q(t), motion.rate, effort)
    assert np.abs(seen.external_torque).max() < 1e-3
    q = np.array([motion.q(t) for t in times])
    recording = recorded(model, times, q, np.tile(motion.rate, (len(q), 1)), np.array(efforts))
    observed = dd.observe(dyn, recording, GAIN)
    np.testing.assert_allclose(
        observed.external_torque[-1], seen.external_torque, rtol=0, atol=1e-12
    )


def sample(motion, t):
    return motion.q(t), motion.rate, motion.effort(t)


def observer_at_work(**options):
    """Return a motion, an observer after 20 ms of a push, and its last result."""
    motion = Motion("panda_arm")
    observer = dd.DisturbanceObserver(motion.s.dyn, 200.0, **options)
    for k in range(21):
        result = observer.update(1e-3 * k, *sample(motion, 1e-3 * k))
    assert result.valid and result.norm > 1.0
    return motion, observer, result


def test_time_that_jumps_resets():
    motion, observer, before = observer_at_work(max_gap=0.05)
    assert observer.update(0.02, *sample(motion, 0.02)) is before  # the same sample once more
    assert observer.update(0.069, *sample(motion, 0.069)).valid
    for time, reason in ((0.059, "time went back by 0.01 s"), (0.2, "no sample for 0.141 s")):
        reset = observer.update(time, *sample(motion, time))
        assert not reset.valid and reset.residual is None and reset.reason == reason
    after = observer.update(0.201, *sample(motion, 0.201))
    assert after.valid and after.norm < 0.5 * before.norm  # from zero


def test_missing_efforts_are_lost_samples():
    """The next sample integrates over the gap; too long a gap resets."""
    motion, observer, _ = observer_at_work(max_gap=0.05)
    _, complete, _ = observer_at_work(max_gap=0.05)
    result = observer.update(0.021, motion.q(0.021), motion.rate, None)
    assert not result.valid and result.reason == "no effort of any joint"
    expected = [complete.update(t, *sample(motion, t)) for t in (0.021, 0.022)][1]
    result = observer.update(0.022, *sample(motion, 0.022))
    assert result.valid
    np.testing.assert_allclose(result.residual, expected.residual, rtol=1e-2, atol=1e-2)
    observer.update(0.08, motion.q(0.0), motion.rate, None)
    assert observer.update(0.09, *sample(motion, 0.09)).reason == "no sample for 0.068 s"


def test_another_payload_resets():
    """The observer starts anew with the new model; an undeclared payload appears as its weight."""
    motion, observer, _ = observer_at_work()
    loaded = dd.DiagonalDynamics(motion.s.model.with_payload("panda_hand", 2.0))
    unaware = observer_at_work()[1]
    observer.use(loaded)
    state = READY, np.zeros(N), loaded.gravity_torque(READY)
    assert observer.update(0.021, *state).reason == "first sample"
    for k in range(1, 200):
        seen, wrong = (o.update(0.021 + 1e-3 * k, *state) for o in (observer, unaware))
    assert seen.norm < 1e-9
    weight = motion.s.oracle.effort_of(READY, {"panda_hand": [0, 0, -2.0 * 9.81, 0, 0, 0]}, "world")
    np.testing.assert_allclose(wrong.external_torque, weight, atol=1e-6)
    with pytest.raises(InputError, match="degrees of freedom"):
        observer.use(subject(PANDA).dyn)


@pytest.mark.parametrize("effort", ("sampled", "held"))
def test_results_and_samples_are_the_callers_own(effort):
    """The caller may overwrite both; a rejected sample leaves the observer as it was."""
    motion, observer, before = observer_at_work(effort=effort)
    _, other, _ = observer_at_work(effort=effort)
    q, qd, tau = sample(motion, 0.021)
    hurt = np.where(np.arange(N) == 1, np.inf, 1.0)
    for bad, key in (
        ((np.nan, q, qd, tau), "time is nan"),
        ((0.021, hurt, qd, tau), "q of joint 'panda_joint2' is inf"),
        ((0.021, q, hurt, tau), "qd of joint 'panda_joint2' is inf"),
        ((0.021, q, qd, hurt), "tau of joint 'panda_joint2' is inf"),
        ((0.021, q, qd, tau[:3]), r"tau has shape \(3,\)"),
    ):
        with pytest.raises(InputError, match=key):
            observer.update(*bad)
    first = observer.update(0.021, q, qd.copy(), tau)
    other.update(0.021, *sample(motion, 0.021))
    for array in (q, tau, before.residual, first.residual, first.external_torque):
        array[:] = 9.0
    results = [o.update(0.022, *sample(motion, 0.022)) for o in (observer, other)]
    np.testing.assert_array_equal(results[0].residual, results[1].residual)


@pytest.mark.parametrize(
    ("arguments", "options", "key"),
    [
        (([1, 1, 1, 0, 1, 1, 1],), {}, "gain of 'panda_joint4'"),
        ((1.0,), {"effort": "no"}, "effort"),
        ((1.0,), {"max_gap": 0}, "max_gap"),
    ],
)
def test_errors_name_the_argument(arguments, options, key):
    with pytest.raises(InputError, match=key):
        dd.DisturbanceObserver(subject(ARM).dyn, *arguments, **options)
