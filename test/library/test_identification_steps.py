# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of identification on simulated motions of a UR5, whose efforts are Pinocchio's: which are taken, and by what."""

import numpy as np
import pytest

import diag_dynamics as dd
from examples import some_of
from motions import efforts, fourier, recorded
from oracles import Oracle
from robots import robot

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

UR5 = robot("ur_description/urdf/ur5_robot.urdf").urdf
DAMPING, FRICTION = np.array([3.0, 3.0, 2.0, 0.5, 0.5, 0.3]), np.array([4.0, 5.0, 3.0, 1.0, 0.8, 0.5])
LADDER = "friction", "rotors", "inertias"


@pytest.fixture(scope="module")
def arm():
    model = dd.load_urdf(UR5)
    return model, Oracle(UR5, model.dof_names)


def recording(model, oracle, seed, duration=15.0, noise=0.3, resist=np.zeros_like):
    """Return a motion at 100 Hz with Pinocchio's efforts; noise 1 is 1e-4 rad, 1e-2 rad/s and 3 N m."""
    t, rng = np.arange(0.0, duration, 0.01), np.random.default_rng(seed)
    q, qd, qdd = fourier(rng, t, np.full(model.nv, -2.0), np.full(model.nv, 2.0))
    tau = efforts(oracle, q, qd, qdd) + resist(qd)
    q_noise, qd_noise, tau_noise = noise * rng.normal(size=(3, *q.shape))
    return recorded(model, t, q + 1e-4 * q_noise, qd + 1e-2 * qd_noise, tau + 3.0 * tau_noise)


def friction(qd):
    return DAMPING * qd + FRICTION * np.tanh(qd / 5e-3)


@pytest.mark.parametrize("seed", some_of(range(5), 4))
@pytest.mark.parametrize("resist", [np.zeros_like, friction], ids=["a perfect model", "friction alone"])
def test_steps_that_do_not_help_are_not_taken(arm, seed, resist):
    """Columns of efforts that are not there are random ones: rotors, inertias, and friction of a robot without any."""
    model, oracle = arm
    quality = dd.identify(recording(model, oracle, seed, noise=1.0, resist=resist), model, LADDER).quality
    assert quality["taken"] == (["friction"] if resist is friction else [])
    assert [rung["taken"] for rung in quality["ladder"]].count(True) == 1 + len(quality["taken"])


def test_inertias_that_help_one_joint_of_six_by_files_in_any_order(arm):
    """The wrist loses a fifth of its error, the other five nothing: 3 % of the geometric mean over joints."""
    model, oracle = arm
    start = model.with_parameters({"links": {"wrist_3_link": {"mass": 0.19, "com": [0.02, 0.0, 0.0]}}})
    files = [recording(start, oracle, seed, 8.0 + seed, noise=np.array([1.0] * 5 + [0.03])) for seed in range(2)]
    one, other = (dd.identify(some, start, "inertias") for some in (files, files[::-1]))
    before, after = (rung["score"] for rung in one.quality["ladder"] if rung["taken"])
    assert one.quality["taken"] == ["inertias"] and one.parameters.links and 0.02 < 1.0 - after / before < 0.05
    pairs = np.array(list(one.quality["row_residual"].values()))
    assert 0.7 < pairs[5, 1] / pairs[5, 0] < 0.85 and np.abs(pairs[:5, 1] / pairs[:5, 0] - 1.0).max() < 0.05
    assert other.quality["ladder"] == one.quality["ladder"]
    np.testing.assert_array_equal(other.model.bodies, one.model.bodies)
