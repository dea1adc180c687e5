# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MuJoCo judges loops, mimic joints and ball joints."""

import warnings

import mujoco
import numpy as np
import pytest
from test_loops import ratios

import diag_dynamics as dd
from diag_dynamics.inspection import inspect_robot
from diag_dynamics.recordings.sampling import Quality
from motions import recorded

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")


MJCF = """<mujoco><compiler angle="radian"/><option jacobian="dense"/><worldbody>
<body name="crank"><joint name="j1" axis="0 1 0" ref="0.1"/>
<geom size="0.02" type="capsule" fromto="0 0 0 0.2 0 0"/>
<body name="coupler" pos="0.2 0 0" euler="0 -0.8 0">
<joint name="j2" axis="0 1 0"/><geom size="0.02" type="capsule" fromto="0 0 0 0.5 0.05 0"/>
<site name="a" pos="0.5 0 0"/></body></body>
<body name="rocker" pos="0.5 0 0" euler="0 -1.4 0"><joint name="j3" axis="0 1 0"/>
<geom size="0.02" type="capsule" fromto="0 0 0 0.4 0 0"/>
<body name="extra" pos="0 0 0.2"><joint name="j4" axis="1 0 0" ref="-0.2"/>
<geom size="0.05" pos="0.1 0.2 0"/></body>
<body name="end" pos="0.3 0 0"><joint name="j5" axis="0 1 0"/><geom size="0.03" pos="0 0 0.1"/>
</body></body></worldbody>
<equality>EQUALITY</equality><actuator><motor joint="j3"/></actuator></mujoco>"""


EQUALITIES = {  # and the degrees of freedom
    "connect": ('<connect name="e" body1="coupler" body2="rocker" anchor="0.5 0 0"/>', 3),
    "weld": ('<weld name="e" body1="end" body2="coupler" anchor="0.5 0 0.1"/>', 2),
    "polynomial": ('<joint joint1="j4" joint2="j1" polycoef="0.1 0.5 0.2 0.1 -0.3"/>', 4),
    "both": (
        '<connect body1="coupler" body2="rocker" anchor="0.5 0 0"/>'
        '<joint joint1="j4" joint2="j1" polycoef="0 0.5 0.2 0 0"/>',
        2,
    ),
}


@pytest.mark.parametrize("name", EQUALITIES)
def test_equalities(name):
    """MuJoCo's equalities hold where ours do, and their Jacobian vanishes along G."""
    equality, count = EQUALITIES[name]
    text = MJCF.replace("EQUALITY", equality)
    model = dd.load_mjcf(text)
    m = mujoco.MjModel.from_xml_string(text)
    assert model.nv == count and "j3" in model.dof_names
    d = mujoco.MjData(m)
    names = [m.joint(k).name for k in range(m.njnt)]
    for q in model.start + np.random.default_rng(2).uniform(-0.2, 0.2, (4, model.nq)):
        G, at = ratios(model, q)
        d.qpos[:] = [at[joint_name] for joint_name in names]
        mujoco.mj_forward(m, d)
        rows = np.reshape(d.efc_J, (-1, m.nv))[: d.ne]
        assert d.ne >= 1 and np.abs(d.efc_pos[: d.ne]).max() <= 1e-12
        assert (
            np.abs(rows @ np.array([G[joint_name] for joint_name in names])).max()
            <= 1e-13 * np.abs(rows).max()
        )


RODS = """<mujoco><compiler angle="radian"/><worldbody><body name="crank">
<joint name="motor" axis="0 1 0"/>
<geom type="capsule" size=".02" fromto="0 0 0 .2 0 0"/><body name="rod" pos=".2 0 0">
<joint name="rod" type="ball" pos=".01 0 0"/>
<geom type="capsule" size=".01" fromto="0 0 0 .4 .05 0"/></body></body>
<body name="rocker" pos=".6 0 .1"><joint name="rocker" axis="0 1 .2"/>
<geom type="capsule" size=".02" fromto="0 0 0 0 0 .3"/>
</body></worldbody>EQUALITY</mujoco>"""


@pytest.mark.parametrize(
    ("equality", "count"),
    [
        ("", 5),
        ('<equality><connect body1="rod" body2="rocker" anchor=".4 .05 0"/></equality>', 2),
    ],
)
def test_ball_joints(equality, count):
    """Energy and gravity are MuJoCo's at velocities that its quaternions have by differences."""
    text = RODS.replace("EQUALITY", equality)
    model = dd.load_mjcf(text)
    m = mujoco.MjModel.from_xml_string(text)
    dynamics = dd.DiagonalDynamics(model)
    d = mujoco.MjData(m)
    other = mujoco.MjData(m)
    assert model.nv == count

    def configuration(q):
        _, at = ratios(model, q)
        quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        for axis, letter in zip(np.eye(3), "xyz", strict=True):
            turn, product = np.zeros((2, 4))
            mujoco.mju_axisAngle2Quat(turn, axis, at[f"rod_{letter}"])
            mujoco.mju_mulQuat(product, quaternion, turn)
            quaternion = product
        return np.array([at["motor"], *quaternion, at["rocker"]])

    rng = np.random.default_rng(0)
    step = 1e-6
    for q in model.start + rng.uniform(-0.3, 0.3, (20, model.nq)):
        d.qpos[:] = configuration(q)
        qd = rng.normal(size=model.nv)
        ahead, behind = (configuration(q + sign * step * qd) for sign in (1, -1))
        mujoco.mj_differentiatePos(m, d.qvel, 2.0 * step, behind, ahead)
        mujoco.mj_forward(m, d)
        Mv = np.zeros(m.nv)
        mujoco.mj_mulM(m, d, Mv, d.qvel)
        assert dynamics.evaluate(q, qd).kinetic_energy == pytest.approx(0.5 * d.qvel @ Mv, rel=1e-7)
        other.qpos[:] = d.qpos
        mujoco.mj_forward(m, other)
        power = other.qfrc_bias @ d.qvel
        assert dynamics.gravity_torque(q) @ qd == pytest.approx(power, rel=1e-7, abs=1e-7)


PARALLEL = """<mujoco><worldbody><body name="crank"><joint name="motor" axis="0 1 0"/>
<geom type="capsule" size=".02"
fromto="0 0 0 0 0 .2"/><body name="rod" pos="0 0 .2"><joint name="rod" type="ball"/>
<geom type="capsule" size=".01"
fromto="0 0 0 .4 0 0"/></body></body><body name="rocker" pos=".4 0 0">
<joint name="rocker" axis="0 1 0"/>
<geom type="capsule" size=".02" fromto="0 0 0 0 0 .2"/></body></worldbody>
<equality><connect name="bar" body1="rod" body2="rocker" anchor=".4 0 0"/></equality></mujoco>"""


@pytest.mark.parametrize(("angle", "is_near"), [(1.45, True), (1.35, False)])
def test_ball_joint_near_the_singularity_of_its_hinges(angle, is_near, tmp_path):
    """The rod of a parallelogram stays level while the crank turns."""
    loops = [{"name": "bar", "start": {"motor": -angle, "rod_y": angle, "rocker": -angle}}]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        dd.load_mjcf(PARALLEL, loops=loops)
    assert ["singular at ±90°" in str(warning.message) for warning in caught] == [True] * is_near
    path = tmp_path / "parallel.xml"
    path.write_text(PARALLEL)
    report = inspect_robot(path, loops=loops)
    assert report.checks["loading"] == ("warning" if is_near else "ok")
    assert ["singular at ±90°" in finding.what for finding in report.findings] == [True] * is_near


def test_recording_near_the_singularity_of_hinges():
    """The crank turns from 0.3 to 1.5 rad at constant rate, and the rod is 10° from 90° at 1.396
    rad.
    """
    start = {"motor": -0.3, "rod_y": 0.3, "rocker": -0.3}
    model = dd.load_mjcf(PARALLEL, loops=[{"name": "bar", "start": start}])
    t = np.linspace(0.0, 1.2, 121)
    place = model.dof_names.index("motor")
    q, qd = np.zeros((2, len(t), model.nv))
    q[:, place] = -0.3 - t
    qd[:, place] = -1.0
    quality = Quality(model)
    quality.add_states(recorded(model, t, q, qd, 0.0 * q).states)
    expected = np.count_nonzero(0.3 + t > np.radians(80.0))
    text = f"ball joint 'rod' is within 10° of the singularity of its hinges in {expected} of"
    assert any(text in warning for warning in quality.report()[1])
