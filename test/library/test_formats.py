# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots by name, xacro and MJCF, each compared with its own tool; and URDFs with parameters
written into them.
"""

import sys
import types
import warnings

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import diag_dynamics as dd
from diag_dynamics.description.urdf_writer import urdf_with
from robots import robot_path

UR5 = robot_path("ur_description/urdf/ur5_robot.urdf")
PANDA = robot_path("panda_description/urdf/panda.urdf")


def assert_same(a, b):
    assert a.dof_names == b.dof_names and a.link_names == b.link_names
    assert a.bodies.tobytes() == b.bodies.tobytes() and a.links.tobytes() == b.links.tobytes()


# --- Robots by name


def test_example_robots():
    """A robot is found by its key, or by its file's name with or without `_robot`."""
    assert_same(dd.load_robot("panda"), dd.load_urdf(PANDA))
    assert_same(dd.load_robot("ur5"), dd.load_urdf(UR5))
    assert dd.load_robot("panda", floating_base=True).floating_base


@pytest.mark.parametrize(
    ("name", "key"),
    [
        ("pnada", "pnada"),
        ("ur", "neither a file nor an example robot"),
        ("anymal", "any of: anymal_b.*, anymal_c"),
        ("", "expected"),
        (3, "expected"),
        *((f"r5_robot{suffix}", "neither a file") for suffix in (".urdf", ".xml", ".xacro")),
    ],
)
def test_unknown_names(name, key):
    with pytest.raises(dd.InputError, match=key):
        dd.load_robot(name)


@pytest.fixture
def robot_descriptions(tmp_path, monkeypatch):
    """Replace the package robot_descriptions, which clones from the network."""
    urdf = tmp_path / "arm.urdf.xacro"
    urdf.write_text(UR5.read_text())
    has_urdf = {"arm": True, "lost": True, "bare": True, "xacro": True, "arm_mj": False}
    entries = ", ".join(f"'{name}_description': Entry({value})" for name, value in has_urdf.items())
    package = tmp_path / "robot_descriptions"
    package.mkdir()
    (package / "__init__.py").touch()  # DESCRIPTIONS is not in it in older versions
    (package / "_descriptions.py").write_text(
        f"class Entry:\n    def __init__(self, has_urdf): self.has_urdf = "
        f"has_urdf\n\nDESCRIPTIONS = {{{entries}}}\n"
    )
    (package / "arm_description.py").write_text(f"URDF_PATH = {str(UR5)!r}")
    (package / "xacro_description.py").write_text(f"XACRO_PATH = {str(urdf)!r}")
    (package / "bare_description.py").write_text("PACKAGE_PATH = ''")
    (package / "lost_description.py").write_text("raise ConnectionError('no route to host')")
    monkeypatch.syspath_prepend(tmp_path)
    yield
    for name in [name for name in sys.modules if name.split(".")[0] == "robot_descriptions"]:
        del sys.modules[name]


def test_robot_descriptions(robot_descriptions, capsys):
    assert dd.load_robot("arm_description").nv == 6
    assert "from the net" in capsys.readouterr().err
    for name, key in (
        ("lost_description", "ConnectionError: no route to host"),
        ("arm_mj_description", "arm_mj"),
        ("bare_description", "neither a URDF nor a xacro file"),
    ):
        with pytest.raises(dd.InputError, match=key):
            dd.load_robot(name)
    assert dd.load_robot("xacro_description").nv == 6


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
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>
    <axis xyz="0 1 0"/></joint>
  <xacro:if value="$(arg hand)">
    <xacro:part name="hand"/>
    <joint name="wrist" type="continuous"><parent link="upper"/><child link="hand"/>
      <axis xyz="1 0 0"/></joint>
  </xacro:if>
</robot>"""


@pytest.fixture
def xacro_file(tmp_path):
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(XACRO)
    return path


@pytest.mark.parametrize("arguments", [{}, {"mass": 3.5}, {"hand": True, "mass": "1"}])
def test_xacro(xacro_file, arguments, monkeypatch, capsys):
    """The model is that of the text that xacro's own command prints."""
    import xacro

    typed = [f"{name}:={str(value).lower()}" for name, value in arguments.items()]
    monkeypatch.setattr(sys, "argv", ["xacro", str(xacro_file), *typed])
    xacro.main()
    expected = dd.load_urdf(capsys.readouterr().out)
    assert_same(dd.load_urdf(xacro_file, xacro_args=arguments), expected)


def test_xacro_args_precede_those_behind_the_path(xacro_file):
    model = dd.load_urdf(f"{xacro_file} mass:=5 hand:=true", xacro_args={"mass": 7.0})
    assert model.total_mass == 14.0 and model.nv == 2


def not_found(name):
    """Raise the error of ament_index_python."""
    raise KeyError(f"package '{name}' not found, searching: ['/opt/ros/jazzy']")


def test_xacro_errors(xacro_file, monkeypatch):
    def assert_error(kind, key, source, **options):
        with pytest.raises(kind, match=key):
            dd.load_urdf(source, **options)

    assert_error(dd.UrdfError, "No such file", "nowhere.xacro")
    assert_error(dd.InputError, "xacro_args has mass", UR5, xacro_args={"mass": 1})
    assert_error(dd.InputError, "xacro_args is 3", xacro_file, xacro_args=3)
    with pytest.raises(dd.InputError, match="xacro_args has mass"):
        dd.load_mjcf(ARM, xacro_args={"mass": 1})
    macros = XACRO[: XACRO.index('<link name="base"/>')] + "</robot>"
    xacro_file.write_text(macros)
    assert_error(dd.UrdfError, "arm.urdf.xacro.*defines macros and calls none", xacro_file)
    xacro_file.write_text(macros.replace("</robot>", '<xacro:if value="false"/></robot>'))
    assert_error(dd.UrdfError, "SRDF", xacro_file)
    xacro_file.write_text(XACRO.replace("${0.1 * 2}", "${nothing}"))
    assert_error(dd.UrdfError, "xacro cannot expand .*nothing", xacro_file)
    xacro_file.write_text(
        XACRO.replace('<link name="base"/>', '<xacro:include filename="$(find arm)/x.xacro"/>')
    )
    packages = types.ModuleType("ament_index_python.packages")
    monkeypatch.setitem(sys.modules, "ament_index_python", types.ModuleType("ament_index_python"))
    monkeypatch.setitem(sys.modules, "ament_index_python.packages", packages)
    packages.get_package_share_directory = not_found
    assert_error(dd.UrdfError, "xacro cannot expand .*'arm' not found", xacro_file)
    monkeypatch.setitem(sys.modules, "xacro", None)
    assert_error(dd.InputError, "pip install xacro", xacro_file)
    assert_error(dd.UrdfError, "unexpanded xacro", XACRO)


# --- MJCF

ACTUATOR = '<motor joint="turn" gear="2" forcerange="-30 40" forcelimited="true"/>'

ARM = f"""<mujoco model="arm">
  <compiler angle="radian"/>
  <option gravity="0.3 -0.2 -9.5"/>
  <default><joint armature="0.02" damping="0.5"/></default>
  <worldbody>
    <site name="stand"/>
    <body name="a" pos="0.1 0.2 0.3" quat="0.9 0.1 0.3 -0.2">
      <joint name="turn" type="hinge" axis="0.2 1 0.4" pos="0.05 -0.1 0.02" ref="0.4" range="-2 2"/>
      <inertial pos="0.1 0 0.05" quat="0.8 0.3 -0.2 0.1" mass="2.5" diaginertia="0.05 0.04 0.03"/>
      <body name="b" pos="0 0.3 0.1" euler="0.4 -0.3 1.2">
        <joint name="shift" type="slide" axis="1 0 0.5" pos="0.3 0 0" ref="-0.1" range="-1 1"
        frictionloss="0.7"/>
        <joint name="about x" type="hinge" axis="1 0 0" pos="0 0.2 0"/>
        <joint type="hinge" axis="0 0 1" pos="0.1 0 0.1" armature="0.3"/>
        <geom type="capsule" size="0.04" fromto="0 0 0 0.2 0.1 0.3"/>
        <body pos="0.2 0.1 0.3" name="tool"><site name="tip"/>
          <geom type="box" size="0.05 0.03 0.1" mass="0.8"/></body>
      </body>
    </body>
    <body name="c" pos="-0.5 0 0"><joint name="other"/><geom size="0.1"/></body>
  </worldbody>
  <actuator>{ACTUATOR}</actuator>
</mujoco>"""

FREE_JOINT = '<freejoint name="flight"/>'

FREE = f"""<mujoco model="drone">
  <worldbody>
    <body name="hull" pos="1 2 3">{FREE_JOINT}<geom type="box" size="0.3 0.2 0.1"/>
      <body name="arm" pos="0.3 0 0"><joint name="elbow" axis="0 1 0" pos="0 0 0.05"/>
        <geom size="0.05" pos="0.2 0 0"/></body>
    </body>
  </worldbody>
</mujoco>"""

BALL = (
    '<body name="ball" pos="0 0 5"><freejoint name="roll"/><geom size="0.1" pos="0.02 0 0"/>'
    "</body></worldbody>"
)
TWO_FREE = FREE.replace("</worldbody>", BALL)
END = "</mujoco>"


def changed(old, new, text=ARM):
    assert old in text
    return text.replace(old, new)


def with_actuators(actuators):
    return changed(ACTUATOR, actuators)


def with_flags(text, *flags):
    flags = " ".join(f'{flag}="disable"' for flag in flags)
    return changed('-9.5"/>', f'-9.5"><flag {flags}/></option>', text)


@pytest.fixture
def mujoco():
    import mujoco

    return mujoco


def needs(mujoco, attribute):
    """Skip where the installed version of MuJoCo does not have an attribute."""
    if not hasattr(mujoco.MjModel, attribute):
        pytest.skip(f"models of this MuJoCo have no {attribute}")


class Reference:
    """A model in MuJoCo, and its quantities in the order of our rates."""

    def __init__(self, mujoco, text, model):
        self.mujoco = mujoco
        self.model = model
        self.m = mujoco.MjModel.from_xml_string(text)
        self.m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.d = mujoco.MjData(self.m)

    def set(self, q, qd):
        """Set the state. The angular part of a free body's twist is ours; the linear part is turned
        to the world.
        """
        model = self.model
        m = self.m
        d = self.d
        at = dict(zip(model.coordinate_names, q, strict=True))
        dof = {name: k for k, name in enumerate(model.dof_names)}
        self.transform = np.zeros((m.nv, model.nv))  # of our rates to MuJoCo's
        for j in range(m.njnt):
            name = self.mujoco.mj_id2name(m, self.mujoco.mjtObj.mjOBJ_JOINT, j) or f"joint{j}"
            p = m.jnt_qposadr[j]
            v = m.jnt_dofadr[j]
            if m.jnt_type[j] != self.mujoco.mjtJoint.mjJNT_FREE:
                d.qpos[p] = at[name]
                self.transform[v, dof[name]] = 1.0
                continue
            name = "root_joint" if model.floating_base else name
            x = [at[f"{name}/{suffix}"] for suffix in ("x", "y", "z", "qw", "qx", "qy", "qz")]
            d.qpos[p : p + 7] = x
            R = np.zeros(9)
            self.mujoco.mju_quat2Mat(R, x[3:])
            columns = [
                dof[f"{name}/{suffix}"] for suffix in ("v_x", "v_y", "v_z", "w_x", "w_y", "w_z")
            ]
            self.transform[v : v + 3, columns[:3]] = R.reshape(3, 3)
            self.transform[v + 3 : v + 6, columns[3:]] = np.eye(3)
        d.qvel[:] = self.transform @ qd
        self.mujoco.mj_forward(m, d)

    def mass_matrix(self):
        M = np.zeros((self.m.nv, self.m.nv))
        for row, unit in zip(M, np.eye(self.m.nv), strict=True):
            self.mujoco.mj_mulM(self.m, self.d, row, unit)
        return self.transform.T @ M @ self.transform

    def bias(self):
        """Return c + g, which is g at rest."""
        return self.transform.T @ self.d.qfrc_bias


def quiet(text):
    """Return the model of an MJCF, without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dd.ModelWarning)
        return dd.load_mjcf(text)


def compare(mujoco, text, seed=5, omits=False):
    """Compare mass matrix, damping, kinetic energy, places and gravity with MuJoCo's; return both
    models.

    With `omits`, MuJoCo has forces that the model omits: forward dynamics is MuJoCo's where these
    are among the torques.
    """
    model = quiet(text)
    reference = Reference(mujoco, text, model)
    dyn = dd.DiagonalDynamics(model)
    rng = np.random.default_rng(seed)
    assert model.nv == reference.m.nv
    for _ in range(3):
        q = model.random(rng)
        qd = rng.normal(size=model.nv)
        reference.set(q, qd)
        M = reference.mass_matrix()
        np.testing.assert_allclose(dyn.mass_matrix(q), M, rtol=0, atol=1e-11 * np.abs(M).max())
        assert dyn.evaluate(q, qd).kinetic_energy == pytest.approx(0.5 * qd @ M @ qd, rel=1e-11)
        passive = reference.transform.T @ reference.d.qfrc_passive
        if not omits:
            np.testing.assert_allclose(-model.damping * qd, passive, rtol=0, atol=1e-12)
        elif not any(name.endswith("/qw") for name in model.coordinate_names):
            tau = passive + reference.transform.T @ reference.d.qfrc_constraint
            qacc = np.linalg.solve(reference.transform, reference.d.qacc)
            acceleration = dyn.forward_dynamics(q, qd, tau)
            np.testing.assert_allclose(acceleration, qacc, rtol=0, atol=1e-8 * np.abs(qacc).max())
        for k in range(1, reference.m.nbody):
            if (name := mujoco.mj_id2name(reference.m, mujoco.mjtObj.mjOBJ_BODY, k)) in (
                "target",
                "arrow",
            ):
                continue  # of a mocap body, whose place is not the file's
            placement = dyn.placement(q, name)
            np.testing.assert_allclose(placement[:3, 3], reference.d.xpos[k], atol=1e-12)
            np.testing.assert_allclose(placement[:3, :3].ravel(), reference.d.xmat[k], atol=1e-12)
        if not any(
            name.endswith("/qw") for name in model.coordinate_names
        ):  # else rates are not the same
            np.testing.assert_allclose(
                dyn.coriolis_torque(q, qd) + dyn.gravity_torque(q),
                reference.bias(),
                rtol=0,
                atol=1e-10,
            )
        reference.set(q, np.zeros(model.nv))
        g = reference.bias()
        np.testing.assert_allclose(
            dyn.gravity_torque(q), g, rtol=0, atol=1e-10 * max(1.0, np.abs(g).max())
        )
    return reference, model


@pytest.mark.parametrize("text", [ARM, FREE, TWO_FREE], ids=["arm", "free", "two free"])
def test_mjcf(mujoco, text):
    compare(mujoco, text)


def test_mjcf_joints(mujoco):
    model = dd.load_mjcf(ARM)
    dof = {name: k for k, name in enumerate(model.dof_names)}
    assert set(dof) == {"turn", "shift", "about x", "joint3", "other"}
    k = dof["turn"]
    assert (model.lower[k], model.upper[k], model.effort_limit[k], model.damping[k]) == (
        -2.0,
        2.0,
        80.0,
        0.5,
    )
    assert model.friction[dof["shift"]] == 0.7 and model.armature[dof["joint3"]] == 0.3
    assert list(model.gravity) == [0.3, -0.2, -9.5]
    other = dd.load_mjcf(ARM, gravity=(0, 0, -1), armature={"turn": 2.0}, floating_base=True)
    assert other.floating_base and list(other.gravity) == [0, 0, -1]
    assert other.armature[-5:][dof["turn"]] == 2.0
    assert dd.load_mjcf(FREE).floating_base and not dd.load_mjcf(TWO_FREE).floating_base
    equality = (
        '<equality><joint joint1="other" joint2="turn" polycoef="0.2 -1.5 0 0 0"/></equality>'
    )
    coupled = dd.load_mjcf(changed(END, equality + END)).mimics["other"]
    assert (coupled.leader, coupled.multiplier) == ("turn", -1.5)
    assert coupled.offset == pytest.approx(0.2 + 1.5 * 0.4)  # the source's ref is 0.4


@pytest.mark.parametrize("joint", ["turn", "shift"])
def test_equality_without_a_second_joint(mujoco, joint):
    """It locks the joint where MuJoCo's constraint holds; locked_joints has precedence."""
    equality = f'<equality><joint joint1="{joint}" polycoef="0.3 5"/></equality>'
    text = changed(END, equality + END)
    model = dd.load_mjcf(text)
    m = mujoco.MjModel.from_xml_string(text)
    assert model.nv == m.nv - 1 and joint not in model.dof_names
    d = mujoco.MjData(m)
    d.joint(joint).qpos[:] = model.locked_joints[joint]
    mujoco.mj_forward(m, d)
    assert d.ne == 1 and abs(d.efc_pos[0]) < 1e-12
    assert dd.load_mjcf(text, locked_joints={joint: 0.1}).locked_joints == {joint: 0.1}


OTHER = '<joint name="other"/>'
TENDON = '<tendon><fixed name="wire"><joint joint="turn" coef="1"/></fixed></tendon>'
TWICE = "".join(
    f'<joint name="{name}" joint1="other" joint2="{on}"/>'
    for name, on in (("e1", "turn"), ("e2", "shift"))
)
BODY_C = f'<body name="c" pos="-0.5 0 0">{OTHER}<geom size="0.1"/></body>'


def with_tendon(attributes, kind="fixed"):
    """Return the end of an MJCF with a tendon that has these attributes."""
    path = {
        "fixed": '<joint joint="turn" coef="1"/>',
        "spatial": '<site site="stand"/><site site="tip"/>',
    }[kind]
    return f'<tendon><{kind} name="wire" {attributes}>{path}</{kind}></tendon>{END}'


UNSUPPORTED = {
    "ball": (OTHER, '<joint name="other" type="ball" armature="0.1"/>', "joint 'other' .* to zero"),
    "one joint twice": (END, f"<equality>{TWICE}</equality>{END}", "equality 'e2'"),
    "equality of a tendon": (
        END,
        with_tendon("", "spatial").replace(
            END, '<equality><tendon name="rope" tendon1="wire"/></equality>' + END
        ),
        "equality 'rope'",
    ),
    "armature of a tendon": (END, with_tendon('armature="0.1"'), "tendon 'wire' has armature"),
    "mocap body that holds": (
        "</worldbody>",
        '<body name="hand" mocap="true"/></worldbody><equality>'
        '<weld name="hold" body1="hand" body2="tool"/></equality>',
        "equality 'hold'",
    ),
}

PULL = f'{TENDON}<actuator><motor name="pull" tendon="wire" '

UNSUPPORTED_SINCE_3_4 = {
    "armature at a tendon": (
        "<actuator>",
        PULL + 'armature="0.1"/>',
        "actuator 'pull' has armature",
    ),
}
"""Attributes that older versions of MuJoCo do not read."""


@pytest.mark.parametrize("case", [*UNSUPPORTED, *UNSUPPORTED_SINCE_3_4])
def test_unsupported_features(mujoco, case):
    if case in UNSUPPORTED_SINCE_3_4:
        needs(mujoco, "actuator_armature")
    old, new, key = (UNSUPPORTED | UNSUPPORTED_SINCE_3_4)[case]
    with pytest.raises(dd.UnsupportedError, match=key):
        dd.load_mjcf(changed(old, new))


RIGID = {
    'body1="c"': "leaves none of its joints free",
    'site1="stand" site2="tip"': "cannot be closed",
}


@pytest.mark.parametrize("ends", RIGID)
def test_rigid_weld(mujoco, ends):
    with pytest.raises(dd.LoopError, match=f"'glue' {RIGID[ends]}"):
        dd.load_mjcf(changed(END, f'<equality><weld name="glue" {ends}/></equality>{END}'))


MARKER = (
    '<body name="target" mocap="true" pos="1 0 1"><geom size="0.1"/><body name="arrow">'
    '<geom size="0.02"/></body></body>'
)
OMITTED = {  # what is replaced in ARM, by what, and what model.omitted then has
    "spring": (
        OTHER,
        '<joint name="other" stiffness="3" springref="20"/>',
        ["spring of joint 'other'"],
    ),
    "two springs": (
        OTHER,
        '<joint name="other" stiffness="3"/><joint name="r" stiffness="2" type="slide"/>',
        ["spring of joint 'other', 'r'"],
    ),
    "tendon": (END, TENDON + END, ["tendon 'wire'"]),
    "tendon of an actuator": ("<actuator>", PULL + 'gear="4"/>', ["tendon 'wire'"]),
    "spatial tendon": (
        END,
        with_tendon('stiffness="5" springlength="0.1"', "spatial"),
        ["tendon 'wire'"],
    ),
    "gravity compensation": (
        '<body name="c"',
        '<body name="c" gravcomp="1"',
        ["gravity compensation of body 'c'"],
    ),
    "density": (
        "<option gravity",
        '<option density="1.2" wind="0 3 0" gravity',
        ["fluid (density 1.2, viscosity 0)"],
    ),
    "marker": ("</worldbody>", MARKER + "</worldbody>", ["mocap body 'target'"]),
    "welded marker": (
        "</worldbody>",
        f'{MARKER}</worldbody><equality><weld body1="target"/>'
        f'<weld body1="c" body2="tool" active="false"/></equality>',
        ["mocap body 'target'"],
    ),
    "mocap body with a robot": (
        BODY_C,
        f'<body name="base" mocap="true" pos="0.1 0 1" euler="0.3 0 0.2">'
        f'<geom size="0.2"/>{BODY_C}</body>',
        ["mocap body 'base'"],
    ),
}

OMITTED_SINCE_3_4 = {
    "polynomial of a spring": (
        OTHER,
        '<joint name="other" stiffness="0 3"/>',
        ["spring of joint 'other'"],
    ),
    "polynomial of an actuator": (
        "<motor ",
        '<motor name="drive" damping="0 3" ',
        ["nonlinear damping of actuator 'drive'"],
    ),
    "damping at a tendon": (
        "<actuator>",
        PULL + 'damping="0.1"/>',
        ["damping of actuator 'pull'", "tendon 'wire'"],
    ),
}
"""Attributes that older versions of MuJoCo do not read."""


@pytest.mark.parametrize("case", [*OMITTED, *OMITTED_SINCE_3_4])
def test_omitted_forces(mujoco, case):
    """One warning names what MuJoCo's forward dynamics has and ours has not; all other quantities
    are MuJoCo's.
    """
    if case in OMITTED_SINCE_3_4:
        needs(mujoco, "actuator_armature")
    old, new, omitted = (OMITTED | OMITTED_SINCE_3_4)[case]
    text = changed(old, new)
    with pytest.warns(dd.ModelWarning) as warned:
        model = dd.load_mjcf(text)
    assert list(model.omitted) == omitted and len(warned) == 1
    assert all(entry in str(warned[0].message) for entry in omitted)
    assert model.with_gravity([0, 0, -1]).with_payload("tool", 0.1).omitted == model.omitted
    compare(mujoco, text, omits=True)


@pytest.mark.parametrize("text", [FREE, TWO_FREE], ids=["free", "two free"])
@pytest.mark.parametrize(
    ("attribute", "key"),
    [("armature", None), ("damping", "damping"), ("frictionloss", "friction loss")],
)
def test_resistance_of_free_joints(mujoco, text, attribute, key):
    """MuJoCo applies a default to <joint type="free"> but not to <freejoint>. Armature changes M,
    and is refused.
    """
    as_joint = '<joint name="flight" type="free"/>'
    default = changed(
        "<worldbody>", f'<default><joint {attribute}="0.3"/></default><worldbody>', text
    )
    for without in (changed(FREE_JOINT, as_joint, text), default):
        assert dd.load_mjcf(without).omitted == ()
    text_with = changed(FREE_JOINT, f'<joint name="flight" type="free" {attribute}="0.3"/>', text)
    for resisting in (text_with, changed(FREE_JOINT, as_joint, default)):
        if key is None:
            with pytest.raises(dd.UnsupportedError, match="joint 'flight' is no hinge and has"):
                dd.load_mjcf(resisting)
            continue
        with pytest.warns(dd.ModelWarning, match=f"omit: {key} of joint 'flight'"):
            assert dd.load_mjcf(resisting).floating_base == (text is FREE)
        compare(mujoco, resisting, omits=True)
    if attribute != "frictionloss" and hasattr(mujoco.MjModel, "actuator_armature"):
        actuator = f'<actuator><motor name="lift" joint="flight" {attribute}="0.3"/></actuator>'
        driven = changed(END, actuator + END, text)
        if key is None:
            with pytest.raises(dd.UnsupportedError, match="actuator 'lift' has armature"):
                dd.load_mjcf(driven)
        else:
            assert quiet(driven).omitted == ("damping of actuator 'lift'",)


def test_flexible_bodies(mujoco):
    """Their points are bodies with mass, which passive forces hold together, or else equalities."""
    inside = '<elasticity young="9" poisson="0" thickness="0.01" elastic2d="both"/>'
    flex = (
        '<flexcomp name="sheet" type="grid" count="3 2 1" spacing="0.1 0.1 0.1" mass="1" '
        'radius="0.01">'
        f"{inside}</flexcomp></worldbody>"
    )
    arm = changed('<default><joint armature="0.02" damping="0.5"/></default>', "")
    text = changed("</worldbody>", flex, arm)
    assert quiet(text).omitted == ("flex 'sheet'",)
    compare(mujoco, text, omits=True)
    with pytest.raises(dd.UnsupportedError, match="equality 'equality0'"):
        dd.load_mjcf(changed(inside, '<edge equality="true"/>', text))


def test_markers_beside_a_floating_robot(mujoco):
    """A mocap body is no part of the robot: its mass does not count, and the base stays a floating
    one.
    """
    plain = dd.load_mjcf(FREE)
    marked = quiet(changed("</worldbody>", MARKER + "</worldbody>", FREE))
    assert marked.floating_base and marked.link_names == plain.link_names
    assert marked.total_mass == plain.total_mass and marked.omitted == ("mocap body 'target'",)


@pytest.mark.parametrize(
    ("flags", "old", "new"),
    [
        (["spring"], OTHER, '<joint name="other" stiffness="3"/>'),
        (["spring", "damper"], '<body name="c"', '<body name="c" gravcomp="1"'),
        (["spring", "damper"], "<option gravity", '<option density="1.2" gravity'),
    ],
    ids=["spring", "compensation", "fluid"],
)
def test_disabled_forces_are_not_omitted(mujoco, flags, old, new):
    """The model omits no force that MuJoCo does not compute either."""
    if not hasattr(mujoco.mjtDisableBit, "mjDSBL_DAMPER"):
        flags = list(
            dict.fromkeys("passive" if flag in ("spring", "damper") else flag for flag in flags)
        )
    text = changed(old, new)
    assert quiet(text).omitted and quiet(with_flags(text, *flags)).omitted == ()
    compare(mujoco, with_flags(text, *flags))


PID = '<pid joint="{}" input="pos vel ff" kp="1" kv="1" gear="7"/>'

GEARED = {
    "joint": '<motor joint="turn" gear="3" armature="0.1" damping="0.2"/>',
    "two": (
        '<motor joint="turn" gear="3" armature="0.1"/>'
        '<motor joint="turn" gear="2" armature="0.3" damping="0.4"/>'
    ),
    "several controls": PID.format("turn") + '<motor joint="shift" gear="2" armature="0.3"/>',
    "no gear": '<motor joint="turn" gear="0" armature="0.1" damping="0.2"/>',
}


@pytest.mark.parametrize("case", GEARED)
@pytest.mark.parametrize(
    "flags", [(), ("damper",), ("actuation",)], ids=["", "no damper", "no actuation"]
)
def test_armature_and_damping_of_actuators(mujoco, case, flags):
    needs(mujoco, "nactuator" if "several" in case else "actuator_armature")
    text = with_actuators(GEARED[case])
    compare(mujoco, with_flags(text, *flags) if flags else text)


EQUALITIES = f'{TWICE}<connect body1="tool" anchor="0 0 0"/>'


@pytest.mark.parametrize(
    "flag", ["gravity", "damper", "spring", "equality", "frictionloss", "limit", "constraint"]
)
def test_disabled_features(mujoco, flag):
    """MuJoCo counts its rows of constraints beyond the ranges, where each limit would be one."""
    newer = hasattr(mujoco.mjtDisableBit, "mjDSBL_DAMPER")
    name = flag if newer or flag not in ("damper", "spring") else "passive"
    text = {
        "spring": changed(OTHER, '<joint name="other" stiffness="3"/>'),
        "equality": changed(END, f"<equality>{EQUALITIES}</equality>{END}"),
        "constraint": changed(END, f"<equality>{EQUALITIES}</equality>{END}"),
    }.get(flag, ARM)
    if flag in ("equality", "constraint"):
        with pytest.raises(dd.UnsupportedError):
            dd.load_mjcf(text)
    reference, model = compare(mujoco, with_flags(text, name))
    assert np.any(model.gravity) != (flag == "gravity") and np.any(model.damping) != (
        name in ("damper", "passive")
    )
    reference.d.qpos[:] = 5.0
    mujoco.mj_forward(reference.m, reference.d)
    assert not model.mimics and reference.d.ne == 0
    assert (
        np.count_nonzero(model.friction)
        == reference.d.nf
        == (flag not in ("frictionloss", "constraint"))
    )
    assert (
        np.isfinite(model.upper).sum()
        == reference.d.nl
        == 2 * (flag not in ("limit", "constraint"))
    )


def test_hinges_of_a_ball_have_names_of_their_own(mujoco):
    text = """<mujoco><worldbody><body><joint name="a" type="ball"/><geom size="0.1"/>
        <body><joint name="{}" axis="0 1 0"/><geom size="0.1" pos="1 0 0"/></body></body>
        </worldbody></mujoco>"""
    assert len(dd.load_mjcf(text.format("b")).dof_names) == 4
    with pytest.raises(dd.UrdfError, match="Two joints have the name 'a_y'"):
        dd.load_mjcf(text.format("a_y"))


OF_JOINT = 'actuatorfrcrange="-3 5"'

EFFORTS = {  # actuators, attributes of the joint, its limit
    "force range": ('<motor joint="turn" gear="-2" forcerange="-30 40"/>', "", 80.0),
    "two": (
        '<motor joint="turn" gear="2" forcerange="-3 3"/><motor joint="turn" ctrlrange="-1 1"/>',
        "",
        7.0,
    ),
    "control range": ('<motor joint="turn" gear="-3" ctrlrange="-1 2"/>', "", 6.0),
    "both": ('<motor joint="turn" gear="3" ctrlrange="-1 2" forcerange="-1 1"/>', "", 3.0),
    "position": ('<position joint="turn" kp="2" ctrlrange="-1 1"/>', "", np.inf),
    "activation": (
        '<general joint="turn" dyntype="filter" dynprm="0.1" ctrlrange="-1 1"/>',
        "",
        np.inf,
    ),
    "no gear": ('<motor joint="turn" gear="0"/>', "", 0.0),
    "of the joint": ('<motor joint="turn"/>', OF_JOINT, 5.0),
    "of the joint is less": ('<motor joint="turn" forcerange="-9 9"/>', OF_JOINT, 5.0),
    "after several controls": (
        PID.format("shift") + '<motor joint="turn" gear="3" ctrlrange="-2 2"/>',
        "",
        6.0,
    ),
}


def largest_effort(mujoco, text):
    """Return MuJoCo's largest effort at `turn`, at states and controls of either sign far beyond
    any range.
    """
    m = mujoco.MjModel.from_xml_string(text)
    result = 0.0
    j = mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_JOINT, "turn")
    for value in (-1e9, 1e9):
        d = mujoco.MjData(m)
        d.ctrl[:] = value
        d.act[:] = value
        d.qpos[m.jnt_qposadr[j]] = -value
        mujoco.mj_fwdPosition(m, d)
        mujoco.mj_fwdVelocity(m, d)
        mujoco.mj_fwdActuation(m, d)
        result = max(result, abs(d.qfrc_actuator[m.jnt_dofadr[j]]))
    return result


def effort_limit(text):
    model = dd.load_mjcf(text)
    return model.effort_limit[model.dof_names.index("turn")]


@pytest.mark.parametrize("case", EFFORTS)
def test_effort_limits(mujoco, case):
    actuators, of_joint, limit = EFFORTS[case]
    if "<pid" in actuators:
        needs(mujoco, "nactuator")
    text = changed(
        '<joint name="turn"', f'<joint name="turn" {of_joint}', with_actuators(actuators)
    )
    result = largest_effort(mujoco, text)
    assert effort_limit(text) == limit
    assert result == pytest.approx(limit) if np.isfinite(limit) else result > 1e8


def test_recording_of_an_mjcf(mujoco, tmp_path):
    """The model is that of the file, but for what parameters say: gravity where it is not the
    default, and armature.
    """
    robot, table, beside = (tmp_path / name for name in ("arm.xml", "t.csv", "arm.yaml"))
    robot.write_text(f"<?xml version='1.0'?>\n<!-- <robot> --> {ARM}")
    model = dd.load_mjcf(robot)
    table.write_text("\n".join(["t,q_turn,qd_turn", *(f"{k / 100},0.1,0" for k in range(3))]))
    dd.Parameters(joints={"turn": dd.JointParameters(armature=0.7)}).save(beside)

    def read(**parameters):
        return dd.read_recording(table, str(robot), parameters=parameters).model

    plain = read()
    assert_same(plain, model)
    assert plain.gravity.tolist() == [0.3, -0.2, -9.5]
    assert read(gravity=[0.0, 0.0, -1.6]).gravity.tolist() == [0.0, 0.0, -1.6]
    k = model.dof_names.index("turn")
    expected = dict(zip(model.dof_names, model.armature, strict=True))
    for value, changed_model in (
        (0.7, read(parameters_file=str(beside))),
        (0.7, dd.load_mjcf(robot, parameters=beside)),
        (0.9, read(parameters_file=str(beside), armature=["turn=0.9"])),
    ):
        assert changed_model.armature[k] == value
        assert dict(zip(model.dof_names, changed_model.armature, strict=True)) == expected | {
            "turn": value
        }
    with pytest.raises(dd.InputError, match="'floating_base' is true; expected false"):
        read(floating_base=True)


def test_mjcf_errors(mujoco, monkeypatch, tmp_path):
    for source in ("<mujoco><nothing/></mujoco>", tmp_path / "nowhere.xml"):
        with pytest.raises(dd.UrdfError, match="MuJoCo"):
            dd.load_mjcf(source)
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    assert dd.load_mjcf(path, mimic="free").name == "arm"
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(dd.InputError, match="pip install mujoco"):
        dd.load_mjcf(ARM)


# --- URDFs with parameters written into them

GIVEN = dd.Parameters(
    joints={
        "panda_joint1": dd.JointParameters(damping=0.25, friction=1.5, armature=0.3),
        "panda_joint2": dd.JointParameters(effort_offset=0.2),
        "panda_finger_joint1": dd.JointParameters(friction=0.7),
    },
    links={
        "panda_link2": dd.Payload(
            2.5, (0.01, -0.1, 0.02), ((0.04, 0.001, 0.0), (0.001, 0.03, 0.002), (0, 0.002, 0.05))
        )
    },
    payloads={
        "panda_link8": dd.Payload(0.4, (0.0, 0.05, 0.1), np.diag((2e-3, 2e-3, 1e-3))),
        "panda_hand": dd.Payload(-0.3, (0.0, 0.0, 0.03)),
    },
    origin={"method": "a--b", "date": "2026-11-24"},
)


def test_written_numbers():
    """Our reader and Pinocchio find them; armature and offsets have no place in a URDF."""
    text = urdf_with(PANDA.read_text(), GIVEN)
    beside = {
        name: entry._replace(damping=None, friction=None) for name, entry in GIVEN.joints.items()
    }
    written = dd.load_urdf(text, parameters=dd.Parameters(joints=beside))
    expected = dd.load_urdf(PANDA, parameters=GIVEN)
    np.testing.assert_array_equal(written.damping, expected.damping)
    np.testing.assert_array_equal(written.friction, expected.friction)
    rng = np.random.default_rng(1)
    q = expected.random(rng)
    qd = rng.normal(size=expected.nv)
    a, b = (dd.DiagonalDynamics(model).evaluate(q, qd).link_energy for model in (written, expected))
    np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-16)
    model = pin.buildModelFromXML(text)
    inertia = model.inertias[model.getJointId("panda_joint2")]
    link = GIVEN.links["panda_link2"]
    assert inertia.mass == link.mass
    np.testing.assert_array_equal(inertia.lever, link.com)
    np.testing.assert_allclose(inertia.inertia, link.inertia, rtol=1e-15, atol=1e-18)
    assert model.damping[model.joints[model.getJointId("panda_joint1")].idx_v] == 0.25


def test_other_elements_stay():
    before = PANDA.read_text()
    after = urdf_with(PANDA.read_text(), GIVEN)

    def rest(text):
        root = etree.fromstring(
            text.encode(), etree.XMLParser(remove_comments=True, remove_blank_text=True)
        )
        for element in root.iter("inertial", "dynamics"):
            element.getparent().remove(element)
        return etree.tostring(root, method="c14n")

    assert rest(before) == rest(after)
    assert after.count("written by diag_dynamics, a- -b, 2026-11-24") == 1
    assert "diag_dynamics" not in urdf_with(before, dd.Parameters())


def test_robots_without_a_place_for_parameters():
    with pytest.raises(dd.InputError, match="'k'; expected"):
        urdf_with(PANDA.read_text(), dd.Parameters(joints={"k": dd.JointParameters(damping=1.0)}))
    with pytest.raises(dd.UrdfError, match="not well-formed"):
        urdf_with("<robot", dd.Parameters())
