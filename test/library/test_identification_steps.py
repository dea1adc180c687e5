# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of identification on simulated motions of a UR5, whose efforts are Pinocchio's: which are
taken, and by what.
"""

import json

import numpy as np
import pytest

import desk_arm
import diag_dynamics as dd
from diag_dynamics.cli.main import main
from examples import some_of
from motions import changed, efforts, fourier, recorded
from oracles import Oracle
from robots import robot

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

UR5 = robot("ur_description/urdf/ur5_robot.urdf").urdf
DAMPING = np.array([3.0, 3.0, 2.0, 0.5, 0.5, 0.3])
FRICTION = np.array([4.0, 5.0, 3.0, 1.0, 0.8, 0.5])
LADDER = "friction", "rotors", "inertias"


@pytest.fixture(scope="module")
def arm():
    model = dd.load_urdf(UR5)
    return model, Oracle(UR5, model.dof_names)


def recording(model, oracle, seed, duration=15.0, noise=0.3, resist=lambda qd, g: 0.0 * qd):
    """Return a motion at 100 Hz with Pinocchio's efforts; noise 1 is 1e-4 rad, 1e-2 rad/s and 3 N
    m.
    """
    t = np.arange(0.0, duration, 0.01)
    rng = np.random.default_rng(seed)
    q, qd, qdd = fourier(rng, t, np.full(model.nv, -2.0), np.full(model.nv, 2.0))
    tau = efforts(oracle, q, qd, qdd) + resist(qd, efforts(oracle, q, 0.0 * qd, 0.0 * qd))
    q_noise, qd_noise, tau_noise = noise * rng.normal(size=(3, *q.shape))
    return recorded(model, t, q + 1e-4 * q_noise, qd + 1e-2 * qd_noise, tau + 3.0 * tau_noise)


def friction(qd, g):
    return DAMPING * qd + FRICTION * np.tanh(qd / 5e-3)


@pytest.mark.parametrize("seed", some_of((1, 7, 11, 18, 0), 4))
@pytest.mark.parametrize(
    "resist", [lambda qd, g: 0.0 * qd, friction], ids=["a perfect model", "friction alone"]
)
def test_steps_that_do_not_help_are_not_taken(arm, seed, resist):
    """Columns of efforts that are not there are random ones: rotors, inertias, and friction of a
    robot without any.
    """
    model, oracle = arm
    quality = dd.identify(
        recording(model, oracle, seed, noise=1.0, resist=resist), model, LADDER
    ).quality
    assert quality["taken"] == (["friction"] if resist is friction else [])
    assert [rung["taken"] for rung in quality["ladder"]].count(True) == 1 + len(quality["taken"])


def test_inertias_that_help_one_joint_of_six_by_files_in_any_order(arm):
    """The wrist loses a fifth of its error, the other five nothing: 3 % of the geometric mean over
    joints.
    """
    model, oracle = arm
    start = model.with_parameters(
        {"links": {"wrist_3_link": {"mass": 0.19, "com": [0.02, 0.0, 0.0]}}}
    )
    files = [
        recording(start, oracle, seed, 8.0 + seed, noise=np.array([1.0] * 5 + [0.03]))
        for seed in range(2)
    ]
    entry, other = (
        dd.identify(some, start, ("rotors", "inertias")) for some in (files, files[::-1])
    )
    before, after = (rung["score"] for rung in entry.quality["ladder"] if rung["taken"])
    assert entry.quality["taken"] == ["inertias"]
    assert entry.parameters.links
    assert 0.02 < 1.0 - after / before < 0.05
    pairs = np.array(list(entry.quality["row_residual"].values()))
    assert 0.7 < pairs[5, 1] / pairs[5, 0] < 0.85
    assert np.abs(pairs[:5, 1] / pairs[:5, 0] - 1.0).max() < 0.05
    assert other.quality["ladder"] == entry.quality["ladder"]
    np.testing.assert_array_equal(other.model.bodies, entry.model.bodies)


PENDULUM = """<robot name="pendulum"><link name="base"/><link name="rod"><inertial>
<origin xyz="0 0 -0.3"/><mass value="1.2"/>
<inertia ixx="{0}" iyy="{0}" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="continuous">
<axis xyz="0 1 0"/><parent link="base"/><child link="rod"/></joint></robot>"""


@pytest.mark.parametrize("seed", some_of(range(5), 2))
def test_a_pendulum_takes_the_few_parameters_that_it_has(seed):
    """Its URDF counts the parallel axis twice: inertia about the joint 0.226 kg m² in place of
    0.118.
    """
    true, wrong = (PENDULUM.format(inertia) for inertia in (0.01, 0.118))
    model = dd.load_urdf(wrong)
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 15.0, 0.01)
    q, qd, qdd = fourier(rng, t, np.array([-2.0]), np.array([2.0]), fastest=5.0)
    tau = efforts(Oracle(true, model.dof_names), q, qd, qdd) + 0.05 * qd + 0.1 * np.tanh(qd / 5e-3)
    result = dd.identify(recorded(model, t, q, qd, tau + 0.02 * rng.normal(size=tau.shape)), model)
    assert result.quality["taken"] == ["friction", "inertias"]
    about_joint = dd.DiagonalDynamics(result.model).mass_matrix([0.0])[0, 0]
    assert about_joint == pytest.approx(0.01 + 1.2 * 0.3**2, rel=0.02)
    assert result.model.damping[0] == pytest.approx(0.05, abs=0.01)


LOAD, ROOT = np.array([0.0, 0.15, 0.2, 0.1, 0.2, 0.0]), np.array([0.0, 6.0, 4.0, 2.0, 1.5, 1.0])
SEEDS = some_of(range(5), 2)


@pytest.fixture(scope="module")
def geared(arm):
    """Declared truth and results of identifications of an arm whose gears have friction of all
    kinds, by seed.
    """
    model, oracle = arm
    truth = {"damping": DAMPING, "friction": FRICTION, "load_friction": LOAD, "root_friction": ROOT}

    def resist(qd, g):
        root = np.sign(qd) * np.sqrt(np.abs(qd))
        return friction(qd, g) + LOAD * np.abs(g) * np.tanh(qd / 5e-3) + ROOT * root

    data = [recording(model, oracle, seed, 30.0, noise=0.3, resist=resist) for seed in SEEDS]
    return truth, [dd.identify(entry, model, ("friction", "gears")) for entry in data]


def test_friction_of_gears(geared):
    """Load and root friction are taken, and all are within 2σ of the truth as often as normal
    errors are.
    """
    truth, results = geared
    names = results[0].model.dof_names
    errors = []
    for result in results:
        assert result.quality["taken"] == ["friction", "gears"]
        deviations = result.parameters.origin["quality"]["deviations"]
        assert {"elbow_joint", "shoulder_lift_joint"} <= {
            name for name in names if "root_friction" in deviations[name]
        }
        without_load = deviations["shoulder_pan_joint"]  # its axis is vertical
        assert "load_friction" not in without_load
        joints = [k for k, name in enumerate(names) if "root_friction" in deviations[name]]
        errors += [
            (getattr(result.model, key)[k] - values[k]) / deviations[names[k]][key]
            for key, values in truth.items()
            for k in joints
            if key in deviations[names[k]]
        ]
    assert np.mean(np.abs(errors) < 2.0) > 0.85 and np.abs(errors).max() < 4.5


@pytest.fixture(scope="module")
def worn(arm):
    """A recording with friction of all joints; without noise of velocities, so that delays are
    exact.
    """
    model, oracle = arm
    return recording(model, oracle, 3, 15.0, noise=0.1, resist=friction)


@pytest.mark.parametrize("kind", ["missing", "constant"])
def test_efforts_of_some_joints_only(worn, kind):
    """Nothing is fitted to an effort that no sensor measured; the others are identified, and the
    joint is named.
    """
    tau = worn.tau.copy()
    model = worn.model
    tau[:, 3] = {"missing": np.nan, "constant": 2.5}[kind]
    result = dd.identify(changed(worn, tau=tau), model, ("friction", "inertias"))
    quality = result.quality
    others = np.array([0, 1, 2, 4, 5])
    assert "friction" in quality["taken"] and model.dof_names[3] not in result.parameters.joints
    np.testing.assert_allclose(result.model.friction[others], FRICTION[others], rtol=0.15)
    assert any("efforts of wrist_1_joint are" in text for text in quality["findings"])
    assert quality["torque_rms"]["wrist_1_joint"] == [None, None]
    assert quality["partial"] == [model.dof_names[k] for k in others]
    assert None not in quality["torque_rms"]["elbow_joint"] and quality["explained"][1] > 0.9
    masses = [
        dd.DiagonalDynamics(entry).mass_matrix(np.zeros(6))[3, 3] for entry in (model, result.model)
    ]
    assert 0.5 < masses[1] / masses[0] < 1.5
    with pytest.raises(dd.InputError, match="no effort follows the motion"):
        dd.identify(changed(worn, tau=np.tile(np.where(worn.t < 8.0, 1.0, 2.0)[:, None], 6)), model)


def test_efforts_that_one_of_two_recordings_lacks(worn):
    """Errors of the joint are those of the recording that has them."""
    tau = worn.tau.copy()
    tau[:, 3] = np.nan
    both, alone = (
        dd.identify(entry, worn.model, "friction")
        for entry in ([worn, changed(worn, tau=tau)], worn)
    )
    for key in ("torque_rms", "observer_spread", "explained"):
        assert str(both.quality[key]).count("None") == 0
    for key in ("torque_rms", "observer_spread"):
        pairs = (entry.quality[key]["wrist_1_joint"] for entry in (both, alone))
        np.testing.assert_allclose(*pairs, rtol=0.1)


def late(data, delay):
    t = data.t
    return changed(
        data, qd=np.column_stack([np.interp(t - delay, t, column) for column in data.qd.T])
    )


@pytest.mark.parametrize("delay", [0.173, -0.06])
def test_long_delays_of_velocities_are_removed(worn, delay):
    result = dd.identify(late(worn, delay), worn.model, "friction")
    assert result.quality["velocity_delay"] == [pytest.approx(delay, abs=1e-3)]
    np.testing.assert_allclose(result.model.friction, FRICTION, rtol=0.15)


def test_noise_of_velocities_is_no_wrong_unit(worn):
    noise = np.random.default_rng(0).normal(0.0, 0.3, worn.qd.shape)
    result = dd.identify(changed(worn, qd=worn.qd + noise), worn.model, "friction")
    assert result.quality["velocity_delay"] == [pytest.approx(0.0, abs=2e-3)]


def test_the_spread_of_external_torque_is_that_of_the_observer(worn):
    """Friction of 0.5 to 5 N m is no external torque once it is known; it is that of `observe`."""
    result = dd.identify(worn, worn.model, "friction")
    for column, model in enumerate((worn.model, result.model)):
        observed = dd.observe(dd.DiagonalDynamics(model), worn)
        spread = observed.external_torque[observed.valid].std(axis=0)
        content = [result.quality["observer_spread"][name][column] for name in worn.model.dof_names]
        np.testing.assert_allclose(content, spread, rtol=0.25)
    before, after = np.transpose(list(result.quality["observer_spread"].values()))
    assert (after < 0.5 * before).all()


def test_the_end_of_the_search_is_no_delay(worn):
    with pytest.raises(
        dd.InputError, match=r"recordings\[0\]: velocities are 300 ms or more later .* joint '\w+'"
    ):
        dd.identify(late(worn, 0.45), worn.model, "friction")


@pytest.mark.parametrize("seed", some_of(range(5), 2))
def test_friction_of_joints_that_stick(seed):
    """A simulated desk arm stands a quarter of the time, where stiction holds it: its friction is
    within 2σ of the truth.
    """
    model = dd.load_urdf(desk_arm.URDF)
    true = {"friction": [0.03, 0.05, 0.04], "damping": [0.02, 0.02, 0.01]}
    simulation = dd.Simulation(model, **true)
    dynamics = dd.DiagonalDynamics(model)
    t, q, qd, _ = desk_arm.motion(20.0, 1000.0, seed=seed)
    stands = t % 4.0 > 3.0
    states = []
    moved = np.cumsum(~stands) - 1
    q = q[moved]
    qd = np.where(stands[:, None], 0.0, qd[moved])
    simulation.reset(q[0], qd[0])
    for wanted, rate in zip(q, qd, strict=True):
        at = simulation.q
        v = simulation.qd
        tau = dynamics.inverse_dynamics(at, v, 400.0 * (wanted - at) + 40.0 * (rate - v))
        tau += true["friction"] * np.sign(rate) + true["damping"] * rate
        states.append((at, v, tau))
        simulation.advance(tau)
    rng = np.random.default_rng(seed)
    columns = np.array(states)[::5].swapaxes(0, 1)
    noise = np.array([1e-5, 1e-3, 5e-3])[:, None, None] * rng.normal(size=columns.shape)
    result = dd.identify(recorded(model, t[::5], *(columns + noise)), model, "friction")
    assert (columns[1] == 0.0).mean() > 0.1 and result.quality["taken"] == ["friction"]
    for key, values in true.items():
        for k, name in enumerate(model.dof_names):
            error = getattr(result.model, key)[k] - values[k]
            assert abs(error) < 2.0 * result.quality["deviations"][name][key] < values[k]


@pytest.mark.parametrize("seed", some_of(range(4), 4))
def test_a_known_payload_shows_gains_of_light_joints(arm, seed):
    """Without it gravity loads neither wrist_2 nor wrist_3 of a UR5."""
    model, _ = arm
    gains = np.array([0.1, 0.11, 0.12, 0.09, 0.02, 0.03])
    resist = {"resist": friction, "noise": 0.1}
    loaded = Oracle(UR5, model.dof_names)
    unloaded = Oracle(UR5, model.dof_names)
    loaded.append_body("wrist_3_link", 2.805, (0.04, 0.11, 0.02), np.diag([4e-3, 4e-3, 5e-3]))
    carrying, reference = (
        recording(model, oracle, seed + k, **resist) for k, oracle in enumerate((loaded, unloaded))
    )
    carrying, reference = (changed(entry, tau=entry.tau / gains) for entry in (carrying, reference))
    result = dd.identify(
        carrying, model, ("gains", "payload:wrist_3_link=2.805"), reference=reference
    )
    quality = result.quality
    found_gains = [quality["effort_gain"][name][0] for name in model.dof_names[1:]]
    np.testing.assert_allclose(found_gains[:-1], gains[1:-1], rtol=0.02)
    assert found_gains[-1] == pytest.approx(gains[-1], rel=0.1)  # beside an unknown inertia
    assert quality["payload"]["mass"] == pytest.approx(2.805, rel=0.03)
    assert quality["partial"] == list(model.dof_names[1:]) and None not in quality["explained"]
    alone = dd.identify(reference, model, "gains").quality
    assert alone["effort_gain"]["wrist_3_joint"] is None and "wrist_3_joint" not in alone["partial"]
    assert any("wrist_3_joint are in an unknown unit" in text for text in alone["findings"])
    unknown = dd.identify(reference, model, ("gains", "payload:wrist_3_link")).quality
    for warnings, is_absorbed in ((quality["warnings"], False), (unknown["warnings"], True)):
        assert any("contain the weight of the payload" in text for text in warnings) == is_absorbed


@pytest.mark.parametrize(
    ("what", "expected"),
    [
        ("payload:wrist_3_link=2", "expected gains beside a known payload"),
        (("gains", "payload:wrist_3_link=a"), "a mass > 0"),
        (("gains", "payload:wrist_3_link=-1"), "a mass > 0"),
    ],
)
def test_masses_of_payloads_that_cannot_be_used(worn, what, expected):
    with pytest.raises(dd.InputError, match=expected):
        dd.identify(worn, worn.model, what)


def test_gains_of_the_file_are_applied_once(tmp_path):
    """Readers multiply by them, options have precedence, efforts of other joints are unknown, and
    gains of gains are 1.
    """
    names = "pan", "lift", "elbow"
    gains = np.array([0.5, 0.02, 0.05])
    t, q, qd, tau = desk_arm.motion(20.0)
    table = desk_arm.write_table(tmp_path / "raw.csv", t, q, qd, tau / gains)
    (tmp_path / "desk.urdf").write_text(desk_arm.URDF)
    arguments = [str(table), "--urdf", str(tmp_path / "desk.urdf"), "--what", "gains", "--quiet"]
    first = tmp_path / "first.yaml"
    second = tmp_path / "second.yaml"
    assert main(["identify", *arguments, "-o", str(first)]) in (0, 1)
    assert main(["identify", *arguments, "--parameters", str(first), "-o", str(second)]) in (0, 1)
    for path in (first, second):
        model = dd.load_urdf(desk_arm.URDF, parameters=path)
        scale = [model.effort_scale[name] for name in names]
        assert np.isnan(scale[0]) and scale[1:] == pytest.approx(gains[1:], rel=0.01)
        read = dd.read_recording(table, model)
        np.testing.assert_allclose(read.tau[:, 1:], tau[:, 1:] * scale[1:] / gains[1:], rtol=1e-9)
        assert np.isnan(read.tau[:, 0]).all()
    summary = tmp_path / "summary.json"
    options = "--parameters", str(first), "--json", str(summary)
    assert main(["analyse", *arguments[:3], *options, "--quiet"]) == 0
    read = json.loads(summary.read_text())
    assert read["balance"]["partial"] == ["lift", "elbow"] and read["explained"] > 0.95
    assert read["observer"]["unobserved"] == ["pan"]
    assert read["warnings"][0] == "efforts of pan are in an unknown unit (effort_scale)"
    other = dd.read_recording(table, model, parameters={"effort_scale": ["*=0.1"]})
    np.testing.assert_allclose(other.tau, 0.1 * tau / gains, rtol=1e-12)
    assert main(["identify", *arguments, "--set", "effort_scale=*=2"]) == 2


def test_gains_beneath_noise_are_unknown():
    model = dd.load_urdf(desk_arm.URDF)
    t, q, qd, tau = desk_arm.motion(20.0)
    tau[:, 2] += 6.0 * tau[:, 2].std() * np.random.default_rng(5).normal(size=len(t))
    gains = dd.identify(desk_arm.recording(t, q, qd, tau), model, "gains").quality["effort_gain"]
    assert [name for name, gain in gains.items() if gain] == ["lift"]
