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


def recording(model, oracle, seed, duration=15.0, noise=0.3, resist=lambda qd, g: 0.0 * qd):
    """Return a motion at 100 Hz with Pinocchio's efforts; noise 1 is 1e-4 rad, 1e-2 rad/s and 3 N m."""
    t, rng = np.arange(0.0, duration, 0.01), np.random.default_rng(seed)
    q, qd, qdd = fourier(rng, t, np.full(model.nv, -2.0), np.full(model.nv, 2.0))
    tau = efforts(oracle, q, qd, qdd) + resist(qd, efforts(oracle, q, 0.0 * qd, 0.0 * qd))
    q_noise, qd_noise, tau_noise = noise * rng.normal(size=(3, *q.shape))
    return recorded(model, t, q + 1e-4 * q_noise, qd + 1e-2 * qd_noise, tau + 3.0 * tau_noise)


def friction(qd, g):
    return DAMPING * qd + FRICTION * np.tanh(qd / 5e-3)


@pytest.mark.parametrize("seed", some_of(range(5), 4))
@pytest.mark.parametrize("resist", [lambda qd, g: 0.0 * qd, friction], ids=["a perfect model", "friction alone"])
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


PENDULUM = """<robot name="pendulum"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.3"/><mass value="1.2"/>
<inertia ixx="{0}" iyy="{0}" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="swing" type="continuous">
<axis xyz="0 1 0"/><parent link="base"/><child link="rod"/></joint></robot>"""


@pytest.mark.parametrize("seed", some_of(range(5), 2))
def test_a_pendulum_takes_the_few_parameters_that_it_has(seed):
    """Its URDF counts the parallel axis twice: inertia about the joint 0.226 kg m² in place of 0.118."""
    true, wrong = (PENDULUM.format(inertia) for inertia in (0.01, 0.118))
    model, rng, t = dd.load_urdf(wrong), np.random.default_rng(seed), np.arange(0.0, 15.0, 0.01)
    q, qd, qdd = fourier(rng, t, np.array([-2.0]), np.array([2.0]), fastest=5.0)
    tau = efforts(Oracle(true, model.dof_names), q, qd, qdd) + 0.05 * qd + 0.1 * np.tanh(qd / 5e-3)
    found = dd.identify(recorded(model, t, q, qd, tau + 0.02 * rng.normal(size=tau.shape)), model)
    assert found.quality["taken"] == ["friction", "inertias"]
    about_joint = dd.DiagonalDynamics(found.model).mass_matrix([0.0])[0, 0]
    assert about_joint == pytest.approx(0.01 + 1.2 * 0.3**2, rel=0.02)
    assert found.model.damping[0] == pytest.approx(0.05, abs=0.01)


LOAD, ROOT = np.array([0.0, 0.15, 0.2, 0.1, 0.2, 0.0]), np.array([0.0, 6.0, 4.0, 2.0, 1.5, 1.0])
SEEDS = some_of(range(5), 2)


@pytest.fixture(scope="module")
def geared(arm):
    """Declared truth and results of identifications of an arm whose gears have friction of all kinds, by seed."""
    model, oracle = arm
    truth = {"damping": DAMPING, "friction": FRICTION, "load_friction": LOAD, "root_friction": ROOT}

    def resist(qd, g):
        root = np.sign(qd) * np.sqrt(np.abs(qd))
        return friction(qd, g) + LOAD * np.abs(g) * np.tanh(qd / 5e-3) + ROOT * root

    data = [recording(model, oracle, seed, 30.0, noise=0.3, resist=resist) for seed in SEEDS]
    return truth, [dd.identify(one, model, ("friction", "gears")) for one in data]


def test_friction_of_gears(geared):
    """Load and root friction are taken, and all are within 2σ of the truth as often as normal errors are."""
    truth, results = geared
    names, errors = results[0].model.dof_names, []
    for found in results:
        assert found.quality["taken"] == ["friction", "gears"]
        deviations = found.parameters.origin["quality"]["deviations"]
        assert {"elbow_joint", "shoulder_lift_joint"} <= {name for name in names if "root_friction" in deviations[name]}
        without_load = deviations["shoulder_pan_joint"]  # its axis is vertical
        assert "load_friction" not in without_load
        joints = [k for k, name in enumerate(names) if "root_friction" in deviations[name]]
        errors += [
            (getattr(found.model, key)[k] - values[k]) / deviations[names[k]][key]
            for key, values in truth.items()
            for k in joints
            if key in deviations[names[k]]
        ]
    assert np.mean(np.abs(errors) < 2.0) > 0.85 and np.abs(errors).max() < 4.5
