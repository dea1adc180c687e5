# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Xacro and MJCF, each compared with its own tool; open files, and what is refused by name."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
from robots import robot_path

UR5 = robot_path("ur_description/urdf/ur5_robot.urdf")


def same(a, b):
    assert a.dof_names == b.dof_names and a.link_names == b.link_names
    assert a.bodies.tobytes() == b.bodies.tobytes() and a.links.tobytes() == b.links.tobytes()


# --- open files and paths


def test_sources():
    """Path, text of a path, open files and bytes are the same robot; `~` is the user's folder."""
    expected = dd.load_urdf(UR5)
    same(dd.load_urdf(str(UR5)), expected)
    with open(UR5) as text, open(UR5, "rb") as data:
        same(dd.load_urdf(text), expected)
        same(dd.load_urdf(data), expected)
    same(dd.load_urdf(io.StringIO(UR5.read_text())), expected)


def test_home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "arm.urdf").write_text(UR5.read_text())
    assert dd.load_urdf("~/arm.urdf").nv == dd.load_urdf(Path("~/arm.urdf")).nv == 6


@pytest.mark.parametrize("source", [".", Path("."), "/"])
def test_a_folder_is_refused_once(source):
    with pytest.raises(dd.UrdfError) as error:
        dd.load_urdf(source)
    assert str(error.value).count("Cannot read") == 1


# --- xacro

XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="mass" default="2"/>
  <xacro:arg name="hand" default="false"/>
  <xacro:macro name="part" params="name">
    <link name="${name}"><inertial><mass value="$(arg mass)"/>
      <inertia ixx="${0.1 * 2}" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
  </xacro:macro>
  <link name="base"/>
  <xacro:part name="upper"/>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <xacro:if value="$(arg hand)">
    <xacro:part name="hand"/>
    <joint name="wrist" type="continuous"><parent link="upper"/><child link="hand"/><axis xyz="1 0 0"/></joint>
  </xacro:if>
</robot>"""


@pytest.fixture
def xacro_file(tmp_path):
    pytest.importorskip("xacro", reason="xacro is not installed")
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(XACRO)
    return path


@pytest.mark.parametrize("arguments", [{}, {"mass": 3.5}, {"hand": True, "mass": "1"}])
def test_xacro(xacro_file, arguments):
    """The model is that of what xacro's own command prints."""
    typed = [f"{name}:={str(value).lower()}" for name, value in arguments.items()]
    command = [sys.executable, "-c", "import xacro; xacro.main()", str(xacro_file), *typed]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    same(dd.load_urdf(xacro_file, xacro_args=arguments), dd.load_urdf(text))
    same(dd.load_urdf(str(xacro_file), xacro_args=arguments), dd.load_urdf(text))


def test_xacro_that_cannot_be(xacro_file, monkeypatch):
    with pytest.raises(dd.UrdfError, match="no such file"):
        dd.load_urdf("nowhere.xacro")
    with pytest.raises(dd.InputError, match="xacro_args has mass, but the source is no path"):
        dd.load_urdf(UR5, xacro_args={"mass": 1})
    with pytest.raises(dd.InputError, match="xacro_args is 3"):
        dd.load_urdf(xacro_file, xacro_args=3)
    xacro_file.write_text(XACRO.replace("${0.1 * 2}", "${nothing}"))
    with pytest.raises(dd.UrdfError, match=r"xacro cannot expand .*nothing"):
        dd.load_urdf(xacro_file)
    xacro_file.write_text(XACRO.replace('<link name="base"/>', '<xacro:include filename="$(find arm)/x.xacro"/>'))
    monkeypatch.setitem(sys.modules, "ament_index_python", None)
    monkeypatch.setitem(sys.modules, "ament_index_python.packages", None)
    with pytest.raises(dd.UrdfError, match=r"ament_index_python.* is needed"):
        dd.load_urdf(xacro_file)
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(dd.UrdfError, match="pip install xacro"):
        dd.load_urdf(xacro_file)
    with pytest.raises(dd.UrdfError, match="unexpanded xacro"):
        dd.load_urdf(XACRO)


# --- MJCF

ARM = """<mujoco model="arm">
  <compiler angle="radian"/>
  <option gravity="0.3 -0.2 -9.5"/>
  <default><joint armature="0.02" damping="0.5"/></default>
  <worldbody>
    <body name="a" pos="0.1 0.2 0.3" quat="0.9 0.1 0.3 -0.2">
      <joint name="turn" type="hinge" axis="0.2 1 0.4" pos="0.05 -0.1 0.02" ref="0.4" range="-2 2"/>
      <inertial pos="0.1 0 0.05" quat="0.8 0.3 -0.2 0.1" mass="2.5" diaginertia="0.05 0.04 0.03"/>
      <body name="b" pos="0 0.3 0.1" euler="0.4 -0.3 1.2">
        <joint name="shift" type="slide" axis="1 0 0.5" pos="0.3 0 0" ref="-0.1" range="-1 1" frictionloss="0.7"/>
        <joint name="about x" type="hinge" axis="1 0 0" pos="0 0.2 0"/>
        <joint type="hinge" axis="0 0 1" pos="0.1 0 0.1" armature="0.3"/>
        <geom type="capsule" size="0.04" fromto="0 0 0 0.2 0.1 0.3"/>
        <body pos="0.2 0.1 0.3" name="tool"><geom type="box" size="0.05 0.03 0.1" mass="0.8"/></body>
      </body>
    </body>
    <body name="c" pos="-0.5 0 0"><joint name="other"/><geom size="0.1"/></body>
  </worldbody>
  <actuator><motor joint="turn" gear="2" forcerange="-30 40" forcelimited="true"/></actuator>
</mujoco>"""

FREE = """<mujoco model="drone">
  <worldbody>
    <body name="hull" pos="1 2 3"><freejoint name="flight"/><geom type="box" size="0.3 0.2 0.1"/>
      <body name="arm" pos="0.3 0 0"><joint name="elbow" axis="0 1 0" pos="0 0 0.05"/><geom size="0.05" pos="0.2 0 0"/></body>
    </body>
  </worldbody>
</mujoco>"""

TWO_FREE = FREE.replace(
    "</worldbody>",
    '<body name="ball" pos="0 0 5"><freejoint name="roll"/><geom size="0.1" pos="0.02 0 0"/></body></worldbody>',
)


class Mujoco:
    """A model in MuJoCo, and its quantities in our order."""

    def __init__(self, text, model):
        self.mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
        self.m = self.mujoco.MjModel.from_xml_string(text)
        self.m.opt.disableflags |= self.mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.d, self.model = self.mujoco.MjData(self.m), model

    def _joint(self, name):
        found = self.mujoco.mj_name2id(self.m, self.mujoco.mjtObj.mjOBJ_JOINT, name)
        return found if found >= 0 else int(name.removeprefix("joint"))

    def set(self, q, qd):
        """Set the state; the free body's twist is ours turned to the world, its angular part stays."""
        model, m, d = self.model, self.m, self.d
        at = dict(zip(model.coordinate_names, q, strict=True))
        self.transform = np.zeros((m.nv, model.nv))  # of our rates to MuJoCo's
        dof = {name: k for k, name in enumerate(model.dof_names)}
        for j in range(m.njnt):
            name = self.mujoco.mj_id2name(m, self.mujoco.mjtObj.mjOBJ_JOINT, j) or f"joint{j}"
            p, v = m.jnt_qposadr[j], m.jnt_dofadr[j]
            if m.jnt_type[j] == self.mujoco.mjtJoint.mjJNT_FREE:
                name = "root_joint" if model.floating_base else name
                x = [at[f"{name}/{suffix}"] for suffix in ("x", "y", "z", "qw", "qx", "qy", "qz")]
                d.qpos[p : p + 7] = x
                R = np.zeros(9)
                self.mujoco.mju_quat2Mat(R, x[3:])
                columns = [dof[f"{name}/{suffix}"] for suffix in ("v_x", "v_y", "v_z", "w_x", "w_y", "w_z")]
                self.transform[v : v + 3, columns[:3]] = R.reshape(3, 3)
                self.transform[v + 3 : v + 6, columns[3:]] = np.eye(3)
            else:
                d.qpos[p] = at[name]
                self.transform[v, dof[name]] = 1.0
        d.qvel[:] = self.transform @ qd
        self.mujoco.mj_forward(m, d)

    def mass_matrix(self):
        M = np.zeros((self.m.nv, self.m.nv))
        for row, unit in zip(M, np.eye(self.m.nv), strict=True):
            self.mujoco.mj_mulM(self.m, self.d, row, unit)
        return self.transform.T @ M @ self.transform

    def gravity(self):
        self.d.qvel[:] = 0.0
        self.mujoco.mj_forward(self.m, self.d)
        return self.transform.T @ self.d.qfrc_bias


@pytest.mark.parametrize("text", [ARM, FREE, TWO_FREE], ids=["arm", "free", "two free"])
def test_mjcf(text):
    """Mass matrix, gravity, kinetic energy, places and accelerations are MuJoCo's at random states."""
    model = dd.load_mjcf(text)
    other, dyn, rng = Mujoco(text, model), dd.DiagonalDynamics(model), np.random.default_rng(5)
    assert model.nv == other.m.nv
    for _ in range(3):
        q, qd = model.random(rng), rng.normal(size=model.nv)
        other.set(q, qd)
        M = other.mass_matrix()
        np.testing.assert_allclose(dyn.mass_matrix(q), M, rtol=0, atol=1e-11 * np.abs(M).max())
        assert dyn.evaluate(q, qd).kinetic_energy == pytest.approx(0.5 * qd @ M @ qd, rel=1e-11)
        for b in range(1, other.m.nbody):
            name = other.mujoco.mj_id2name(other.m, other.mujoco.mjtObj.mjOBJ_BODY, b)
            place = dyn.placement(q, name)
            np.testing.assert_allclose(place[:3, 3], other.d.xpos[b], atol=1e-12)
            np.testing.assert_allclose(place[:3, :3], other.d.xmat[b].reshape(3, 3), atol=1e-12)
        g = other.gravity()
        np.testing.assert_allclose(dyn.gravity_torque(q), g, rtol=0, atol=1e-10 * max(1.0, np.abs(g).max()))


def test_mjcf_without_a_free_body_has_mujocos_bias():
    """c + g too, where rates are the same ones."""
    model = dd.load_mjcf(ARM)
    other, dyn, rng = Mujoco(ARM, model), dd.DiagonalDynamics(model), np.random.default_rng(2)
    q, qd = model.random(rng), rng.normal(size=model.nv)
    other.set(q, qd)
    expected = other.transform.T @ other.d.qfrc_bias
    np.testing.assert_allclose(dyn.bias(q, qd) + dyn.gravity_torque(q), expected, rtol=0, atol=1e-10)


def test_what_an_mjcf_says_of_joints():
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    model = dd.load_mjcf(ARM)
    k = model.dof_names.index("turn")
    assert set(model.dof_names) == {"turn", "shift", "about x", "joint3", "other"}
    assert (model.lower[k], model.upper[k]) == (-2.0, 2.0) and model.effort_limit[k] == 80.0
    assert model.friction[model.dof_names.index("shift")] == 0.7 and model.damping[k] == 0.5
    assert model.armature[model.dof_names.index("joint3")] == 0.3
    assert list(model.gravity) == [0.3, -0.2, -9.5]
    assert dd.load_mjcf(FREE).floating_base and not dd.load_mjcf(TWO_FREE).floating_base


def test_mjcf_couplings_are_mimic_joints():
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    coupled = ARM.replace(
        "</mujoco>", '<equality><joint joint1="other" joint2="turn" polycoef="0.2 -1.5 0 0 0"/></equality></mujoco>'
    )
    model = dd.load_mjcf(coupled)
    assert model.mimics["other"].leader == "turn" and model.mimics["other"].multiplier == -1.5
    assert model.mimics["other"].offset == pytest.approx(0.2 + 1.5 * 0.4)  # the leader's ref is 0.4


REFUSED = {
    "ball": ('<joint name="other"/>', '<joint name="other" type="ball"/>', "joint 'other' is a ball joint"),
    "spring": ('<joint name="other"/>', '<joint name="other" stiffness="3"/>', "joint 'other' has a spring"),
    "tendon": (
        "</mujoco>",
        '<tendon><fixed name="wire"><joint joint="turn" coef="1"/></fixed></tendon></mujoco>',
        "tendon 'wire'",
    ),
    "weld": ("</mujoco>", '<equality><weld name="glue" body1="c"/></equality></mujoco>', "equality 'glue'"),
    "fluid": ("<option gravity", '<option density="1.2" gravity', "fluid"),
    "balance": ('<body name="c"', '<body name="c" gravcomp="1"', "body 'c' compensates"),
    "mocap": ("</worldbody>", '<body name="hand" mocap="true"/></worldbody>', "body 'hand' is a mocap body"),
    "one joint twice": (
        "</mujoco>",
        '<equality><joint name="first" joint1="other" joint2="turn"/>'
        '<joint name="second" joint1="other" joint2="shift"/></equality></mujoco>',
        "equality 'second' couples joint 'other', as equality 'first' does",
    ),
}

REFUSED_LATER = {
    "spring's polynomial": (
        '<joint name="other"/>',
        '<joint name="other" stiffness="0 3"/>',
        "joint 'other' has a spring",
    ),
    "damping's polynomial": (
        '<joint name="other"/>',
        '<joint name="other" damping="0 0 3"/>',
        "joint 'other' has damping with higher coefficients",
    ),
    "actuator's polynomial": (
        "<motor ",
        '<motor name="drive" damping="0 3" ',
        "actuator 'drive' has damping with higher coefficients",
    ),
    "armature at a tendon": (
        "<actuator>",
        '<tendon><fixed name="wire"><joint joint="turn" coef="1"/></fixed></tendon>'
        '<actuator><motor name="pull" tendon="wire" armature="0.1"/>',
        "actuator 'pull' has armature, but is not at a hinge or slide",
    ),
    "damping at a tendon": (
        "<actuator>",
        '<tendon><fixed name="wire"><joint joint="turn" coef="1"/></fixed></tendon>'
        '<actuator><motor name="pull" tendon="wire" damping="0.1"/>',
        "actuator 'pull' has damping, but is not at a hinge or slide",
    ),
}
"""What older versions of MuJoCo do not read."""


def needs(attribute):
    """Skip where MuJoCo's model does not have it: older versions have fewer attributes."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    if not hasattr(mujoco.MjModel, attribute):
        pytest.skip(f"this MuJoCo's models have no {attribute}")


@pytest.mark.parametrize("case", [*REFUSED, *REFUSED_LATER])
def test_what_an_mjcf_may_not_have(case):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    if case in REFUSED_LATER:
        needs("actuator_armature")
    before, after, text = (REFUSED | REFUSED_LATER)[case]
    assert before in ARM
    with pytest.raises(dd.UnsupportedError, match=text):
        dd.load_mjcf(ARM.replace(before, after))


FREE_JOINT = '<freejoint name="flight"/>'


@pytest.mark.parametrize("text", [FREE, TWO_FREE], ids=["free", "two free"])
@pytest.mark.parametrize(
    ("attribute", "said"), [("armature", "armature"), ("damping", "damping"), ("frictionloss", "friction loss")]
)
def test_what_a_free_joint_may_not_have(text, attribute, said):
    """Of its own, and by a default, which MuJoCo applies to <joint type="free"> but not to <freejoint>."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    assert dd.load_mjcf(text.replace(FREE_JOINT, '<joint name="flight" type="free"/>')).nv == dd.load_mjcf(text).nv
    default = text.replace("<worldbody>", f'<default><joint {attribute}="0.3"/></default><worldbody>')
    assert dd.load_mjcf(default).nv == dd.load_mjcf(text).nv
    for source in (
        text.replace(FREE_JOINT, f'<joint name="flight" type="free" {attribute}="0.3"/>'),
        default.replace(FREE_JOINT, '<joint name="flight" type="free"/>'),
    ):
        with pytest.raises(dd.UnsupportedError, match=f"joint 'flight' is free and has {said}"):
            dd.load_mjcf(source)


def test_an_actuator_of_a_free_joint_may_not_have_armature():
    needs("actuator_armature")
    for attribute in ("armature", "damping"):
        actuator = f'<actuator><motor name="lift" joint="flight" {attribute}="0.3"/></actuator></mujoco>'
        with pytest.raises(
            dd.UnsupportedError, match=f"actuator 'lift' has {attribute}, but is not at a hinge or slide"
        ):
            dd.load_mjcf(FREE.replace("</mujoco>", actuator))


ACTUATOR = '<motor joint="turn" gear="2" forcerange="-30 40" forcelimited="true"/>'


def with_actuators(actuators):
    assert ACTUATOR in ARM
    return ARM.replace(ACTUATOR, actuators)


def with_flags(text, *flags):
    assert '-9.5"/>' in text
    flags = " ".join(f'{flag}="disable"' for flag in flags)
    return text.replace('-9.5"/>', f'-9.5"><flag {flags}/></option>')


def has_mujocos_mass_and_damping(text):
    """Compare at a random state; return MuJoCo's and our model."""
    model = dd.load_mjcf(text)
    other, dyn, rng = Mujoco(text, model), dd.DiagonalDynamics(model), np.random.default_rng(3)
    q, qd = model.random(rng), rng.normal(size=model.nv)
    other.set(q, qd)
    M = other.mass_matrix()
    np.testing.assert_allclose(dyn.mass_matrix(q), M, rtol=0, atol=1e-11 * np.abs(M).max())
    np.testing.assert_allclose(-model.damping * qd, other.transform.T @ other.d.qfrc_passive, rtol=0, atol=1e-12)
    np.testing.assert_allclose(dyn.gravity_torque(q), other.gravity(), rtol=0, atol=1e-10)
    return other, model


@pytest.mark.parametrize(
    "actuators",
    [
        '<motor joint="turn" gear="3" armature="0.1" damping="0.2"/>',
        '<motor jointinparent="turn" gear="-3" armature="0.1" damping="0.2"/>',
        '<motor joint="turn" gear="3" armature="0.1"/><motor joint="turn" gear="2" armature="0.3" damping="0.4"/>',
        '<motor joint="turn" gear="5"/><motor joint="shift" gear="2" armature="0.3" damping="0.4"/>',
        '<pid joint="turn" input="pos vel ff" kp="1" kv="1" gear="7"/><motor joint="shift" gear="2" armature="0.3"/>',
        '<motor joint="turn" gear="0" armature="0.1" damping="0.2"/>',
    ],
    ids=["joint", "in parent", "two", "second", "after several controls", "no gear"],
)
@pytest.mark.parametrize("flags", [(), ("damper",), ("actuation",)], ids=["", "no damper", "no actuation"])
def test_armature_and_damping_of_actuators(actuators, flags):
    needs("nactuator" if "<pid" in actuators else "actuator_armature")
    text = with_actuators(actuators)
    has_mujocos_mass_and_damping(with_flags(text, *flags) if flags else text)


def test_an_actuator_after_one_of_several_outputs():
    """The gears of the first are several rows."""
    needs("nactuator")
    text = with_actuators(
        '<orientation site="tip" refsite="stand" kp="1"/>'
        '<motor joint="shift" gear="3" ctrlrange="-2 2" armature="0.1" damping="0.2"/>'
    )
    text = text.replace('<geom type="box"', '<site name="tip"/><geom type="box"')
    _, model = has_mujocos_mass_and_damping(text.replace("<worldbody>", '<worldbody><site name="stand"/>'))
    assert model.effort_limit[model.dof_names.index("shift")] == 6.0


FRICTION_AND_MORE = ARM.replace(
    "</mujoco>",
    '<equality><joint joint1="other" joint2="turn"/><connect body1="tool" anchor="0 0 0"/></equality></mujoco>',
)


@pytest.mark.parametrize("flag", ["gravity", "damper", "equality", "frictionloss", "limit", "constraint"])
def test_what_flags_disable(flag):
    """Neither has it: MuJoCo's rows of constraints are counted beyond the ranges, where each limit would be one."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    passive = "damper" if hasattr(mujoco.mjtDisableBit, "mjDSBL_DAMPER") else "passive"
    text = FRICTION_AND_MORE if flag in ("equality", "constraint") else ARM
    other, model = has_mujocos_mass_and_damping(with_flags(text, passive if flag == "damper" else flag))
    assert np.any(model.gravity) != (flag == "gravity") and np.any(model.damping) != (flag == "damper")
    other.d.qpos[:] = 5.0
    mujoco.mj_forward(other.m, other.d)
    assert not model.mimics and other.d.ne == 0
    assert np.count_nonzero(model.friction) == other.d.nf == (flag not in ("frictionloss", "constraint"))
    assert np.isfinite(model.upper).sum() == other.d.nl == 2 * (flag not in ("limit", "constraint"))
    if text is FRICTION_AND_MORE:
        with pytest.raises(dd.UnsupportedError, match="equality 'equality1'"):
            dd.load_mjcf(text)


def test_a_spring_that_a_flag_disables():
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    flag = "spring" if hasattr(mujoco.mjtDisableBit, "mjDSBL_SPRING") else "passive"
    has_mujocos_mass_and_damping(with_flags(ARM.replace('name="other"/>', 'name="other" stiffness="3"/>'), flag))


OF_JOINT = 'actuatorfrcrange="-3 5"'

EFFORTS = {  # actuators, attributes of the joint, its limit
    "none": ("", "", np.inf),
    "force range": ('<motor joint="turn" gear="-2" forcerange="-30 40"/>', "", 80.0),
    "force range of one sign": ('<motor joint="turn" gear="-2" forcerange="-30 0"/>', "", 60.0),
    "no range": ('<motor joint="turn"/>', "", np.inf),
    "two": ('<motor joint="turn" gear="2" forcerange="-3 3"/><motor joint="turn" ctrlrange="-1 1"/>', "", 7.0),
    "one without": ('<motor joint="turn" forcerange="-3 3"/><motor joint="turn"/>', "", np.inf),
    "one without after": ('<motor joint="turn"/><motor joint="turn" forcerange="-3 3"/>', "", np.inf),
    "in parent": ('<motor jointinparent="turn" gear="2" forcerange="-3 3"/>', "", 6.0),
    "control range": ('<motor joint="turn" gear="-3" ctrlrange="-1 2"/>', "", 6.0),
    "gain": ('<general joint="turn" gear="3" gainprm="-4" ctrlrange="-1 2"/>', "", 24.0),
    "both": ('<motor joint="turn" gear="3" ctrlrange="-1 2" forcerange="-1 1"/>', "", 3.0),
    "control range is less": ('<motor joint="turn" gear="3" ctrlrange="-1 1" forcerange="-9 9"/>', "", 3.0),
    "position": ('<position joint="turn" kp="2" ctrlrange="-1 1"/>', "", np.inf),
    "position with force range": ('<position joint="turn" kp="2" ctrlrange="-1 1" forcerange="-4 4"/>', "", 4.0),
    "activation": ('<general joint="turn" dyntype="filter" dynprm="0.1" ctrlrange="-1 1"/>', "", np.inf),
    "no gear": ('<motor joint="turn" gear="0"/>', "", 0.0),
    "no gear, and another": ('<motor joint="turn" gear="0"/><motor joint="turn" ctrlrange="-1 1"/>', "", 1.0),
    "of the joint": ('<motor joint="turn"/>', OF_JOINT, 5.0),
    "of the joint is less": ('<motor joint="turn" forcerange="-9 9"/>', OF_JOINT, 5.0),
    "of the joint is more": ('<motor joint="turn" forcerange="-2 2"/>', OF_JOINT, 2.0),
}


def largest_effort(text):
    """Largest effort at `turn` in MuJoCo, at states and controls of either sign that are far out of any range."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    m, found = mujoco.MjModel.from_xml_string(text), 0.0
    j = mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_JOINT, "turn")
    for value in (-1e9, 1e9):
        d = mujoco.MjData(m)
        d.ctrl[:], d.act[:] = value, value
        d.qpos[m.jnt_qposadr[j]] = -value
        mujoco.mj_fwdPosition(m, d)
        mujoco.mj_fwdVelocity(m, d)
        mujoco.mj_fwdActuation(m, d)
        found = max(found, abs(d.qfrc_actuator[m.jnt_dofadr[j]]))
    return found


def effort_limit(text):
    model = dd.load_mjcf(text)
    return model.effort_limit[model.dof_names.index("turn")]


@pytest.mark.parametrize("case", EFFORTS)
def test_effort_limits(case):
    """As said, and what MuJoCo can bring at most."""
    actuators, of_joint, limit = EFFORTS[case]
    text = with_actuators(actuators).replace('<joint name="turn"', f'<joint name="turn" {of_joint}')
    found = largest_effort(text)
    assert effort_limit(text) == limit
    if actuators:
        assert found == pytest.approx(limit) if np.isfinite(limit) else found > 1e8


def test_effort_limits_of_what_is_disabled():
    """Groups and actuation that are off; ranges of control that do not clamp."""
    text = with_actuators('<motor joint="turn" group="3"/><motor joint="turn" ctrlrange="-2 2"/>')
    assert effort_limit(text) == np.inf
    grouped = text.replace('-9.5"/>', '-9.5" actuatorgroupdisable="3"/>')
    assert effort_limit(grouped) == largest_effort(grouped) == 2.0
    loose = with_flags(with_actuators('<motor joint="turn" ctrlrange="-2 2"/>'), "clampctrl")
    assert effort_limit(loose) == np.inf and largest_effort(loose) > 1e8
    off = with_flags(with_actuators('<motor joint="turn" ctrlrange="-2 2"/>'), "actuation")
    assert effort_limit(off) == np.inf and largest_effort(off) == 0.0


def test_effort_limits_after_several_controls():
    """Ranges of controls are numbered by control, those of force by actuator."""
    needs("nactuator")
    several = '<pid joint="shift" input="pos vel ff" kp="1" kv="1" gear="7"/>'
    for motor, limit in (('ctrlrange="-2 2"', 6.0), ('forcerange="-3 3"', 9.0), ("", np.inf)):
        text = with_actuators(f'{several}<motor joint="turn" gear="3" {motor}/>')
        found = largest_effort(text)
        assert effort_limit(text) == limit
        assert found == pytest.approx(limit) if np.isfinite(limit) else found > 1e8


def test_mjcf_that_cannot_be(monkeypatch, tmp_path):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    with pytest.raises(dd.UrdfError, match="MuJoCo refuses"):
        dd.load_mjcf("<mujoco><nothing/></mujoco>")
    with pytest.raises(dd.UrdfError, match="MuJoCo refuses"):
        dd.load_mjcf(tmp_path / "nowhere.xml")
    with pytest.raises(dd.InputError, match="gravity is what the MJCF says"):
        dd.load_mjcf(ARM, gravity=(0, 0, 0))
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    assert dd.load_mjcf(path, mimic="free").name == "arm"
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(dd.InputError, match="pip install mujoco"):
        dd.load_mjcf(ARM)
