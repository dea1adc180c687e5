# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contents of URDFs: origins by quaternions, rotor inertias of transmissions, loops, and probable
mistakes by name.
"""

import contextlib
import pickle
import warnings

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.inspection import inspect_robot
from examples import shortened
from robots import ARM, BOX, all_robots, arm, changed, joint, link, robot_path

COM = 'xyz="0.1 0.2 0.3"'
WELD = joint("weld", "fixed", "upper", "l")


def with_more(elements, text=ARM):
    return changed("</robot>", elements + "</robot>", text)


# --- Origins

TURN = (0.3, -1.2, 2.1)
QUATERNION = pin.Quaternion(pin.rpy.rpyToMatrix(*TURN)).coeffs()
SHAPE = "<geometry><box size='0.1 0.2 0.3'/></geometry>"


def with_origins(turn, version="1.2"):
    """Return an arm whose joint, inertial, visual and collision have the same origin."""
    origin = f'<origin xyz="0.1 0.2 0.3" {turn}/>'
    shapes = f"<visual>{origin}{SHAPE}</visual><collision>{origin}{SHAPE}</collision>"
    text = changed('<origin xyz="0.1 0.2 0.3" rpy="0.0 0.0 0.0"/>', origin)
    text = changed("</link><joint", f"{shapes}</link><joint", text)
    text = changed('<origin xyz="0.0 0.0 0.0" rpy="0.0 0.0 0.0"/>', origin, text)
    return changed("<robot", f'<robot version="{version}"', text)


def written(numbers):
    return " ".join(map(repr, map(float, numbers)))


RPY = f'rpy="{written(TURN)}"'


@pytest.mark.parametrize("length", [1.0, -1.0, 0.5, 2.0, 1e-3, 1e20])
def test_quaternions_turn_origins(length):
    """Pinocchio reads rpy and quat_xyzw of joints and inertials, and normalizes; geometry turns
    with its own origin.
    """
    quaternion = f'quat_xyzw="{written(length * QUATERNION)}"'
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dd.ModelWarning)
        model = dd.load_urdf(with_origins(quaternion))
    for turn in (RPY, quaternion) if length < 1e100 else (RPY,):
        reference = pin.buildModelFromXML(with_origins(turn))
        data = reference.createData()
        dyn = dd.DiagonalDynamics(model)
        q = np.array([0.7])
        assert dyn.mass_matrix(q) == pytest.approx(pin.crba(reference, data, q), rel=1e-12)
        gravity = pin.computeGeneralizedGravity(reference, data, q)
        assert abs(gravity[0]) > 1.0 and dyn.gravity_torque(q) == pytest.approx(gravity, rel=1e-12)
        pin.framesForwardKinematics(reference, data, q)
        placed = data.oMf[reference.getFrameId("upper")].homogeneous
        np.testing.assert_allclose(dyn.placement(q, "upper"), placed, atol=1e-12)
    for source in (quaternion, RPY):
        geometry = dd.link_geometry(model, with_origins(source), geometry="primitives")
        (point,) = [point for point in geometry.points if point.link == "upper"]
        corners = 0.5 * np.array(
            [[x, y, z] for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)]
        )
        corners = corners @ pin.rpy.rpyToMatrix(*TURN).T + [0.1, 0.2, 0.3]
        result = np.asarray(point.points)
        assert all(np.linalg.norm(result - corner, axis=1).min() < 1e-12 for corner in corners)


# --- Probable mistakes

AXIS = '<axis xyz="0.0 0.0 1.0"/>'
JOINT_ORIGIN = '<origin xyz="0.0 0.0 0.0" rpy="0.0 0.0 0.0"/>'
FOLLOWER = (
    '<joint name="follower" type="revolute"><parent link="upper"/><child link="l"/>'
    '<mimic joint="shoulder"{}/></joint>'
)


def plugin(filename, name, follower=""):
    """Return a plugin of a simulator, of a mimic joint if one is given."""
    content = (
        f"<mimicJoint>{follower}</mimicJoint>" if follower else "<parent_link>upper</parent_link>"
    )
    return f'<gazebo><plugin filename="{filename}" name="{name}">{content}</plugin></gazebo>'


MISTAKES = {
    # the text, and what the warning names
    "attribute of the robot": (
        changed("<robot", '<robot frame="z-up"'),
        "<robot> has the unknown attribute 'frame'",
    ),
    "attribute of a link": (
        changed('name="upper"', 'name="upper" mass="2"'),
        "link 'upper': <link> has the unknown ",
    ),
    "attribute of <inertial>": (
        changed("<inertial>", '<inertial xyz="1 0 0">'),
        "<inertial> has the unknown",
    ),
    "attribute of a mass": (
        changed('<mass value="2.0"', '<mass value="2.0" unit="g"'),
        "attribute 'unit'",
    ),
    "attribute of an inertia": (
        changed('ixy="0.0"', 'ixy="0.0" unit="g"'),
        "<inertia> has the unknown attribute 'unit'",
    ),
    "rotation of an inertial": (
        changed(COM, f'{COM} quat="0 0 1 0"'),
        "<origin> has the unknown attribute 'quat'",
    ),
    "rotation of a joint": (
        changed(JOINT_ORIGIN, '<origin rotation="0 0 1"/>'),
        "'shoulder': <origin> has the unknown",
    ),
    "attribute of a joint": (
        changed('type="revolute"', 'type="revolute" kp="2"'),
        "<joint> has the unknown attribute 'kp'",
    ),
    "offset of a parent": (
        changed('<parent link="base"', '<parent xyz="0 0 1" link="base"'),
        "<parent> has the unknown",
    ),
    "offset of a child": (
        changed('<child link="upper"', '<child xyz="0 0 1" link="upper"'),
        "<child> has the unknown",
    ),
    "empty axis": (changed(AXIS, "<axis/>"), "joint 'shoulder': <axis> has no xyz"),
    "axis with angles": (
        changed(AXIS, '<axis xyz="0 0 1" rpy="0 1 0"/>'),
        "<axis> has the unknown attribute 'rpy'",
    ),
    "attribute of a limit": (
        changed("<limit", '<limit max="3"'),
        "<limit> has the unknown attribute 'max'",
    ),
    "armature": (
        changed("</joint>", '<dynamics armature="1"/></joint>'),
        "<dynamics> has the unknown attribute 'armature'",
    ),
    "attribute of <mimic>": (
        arm(link("l", **BOX), FOLLOWER.format(' ratio="2"')),
        "<mimic> has the unknown attribute",
    ),
    "degrees of a joint": (
        changed(JOINT_ORIGIN, '<origin rpy="90 0 0"/>'),
        "joint 'shoulder' (90 rad): <origin rpy> is beyond",
    ),
    "degrees of an inertial": (
        changed('rpy="0.0 0.0 0.0"/><mass', 'rpy="0 0 -90"/><mass'),
        "link 'upper' (-90 rad)",
    ),
    "misspelt element": (
        changed(AXIS, '<Axis xyz="1 0 0"/>'),
        "joint 'shoulder': <Axis> within <joint> is ignored",
    ),
    "element in the plural": (
        changed("<limit ", "<limits "),
        "joint 'shoulder': <limits> within <joint> is ignored",
    ),
    "element of another format": (
        changed(AXIS, '<axes xyz="1 0 0"/>'),
        "'shoulder': <axes> within <joint> is ignored",
    ),
    "pose of a joint": (
        changed(AXIS, f"{AXIS}<pose>0 0 1</pose>"),
        "joint 'shoulder': <pose> within <joint>",
    ),
    "pose of an inertial": (
        changed("<inertial>", "<inertial><pose>1 0 0</pose>"),
        "'upper': <pose> within <inertial>",
    ),
    "elements of an origin": (
        changed(JOINT_ORIGIN, "<origin><xyz>0 0 1</xyz></origin>"),
        "joint 'shoulder': <xyz> within <origin> is ignored",
    ),
    "mass outside": (
        changed("<inertial>", '<mass value="1"/><inertial>'),
        "link 'upper': <mass> within <link> is ignored",
    ),
    "joint of a simulator": (
        changed(
            "</robot>",
            '<gazebo><joint name="g" type="ball"><child>base</child></joint></gazebo></robot>',
        ),
        "joint 'g': <joint> of <gazebo> is ignored",
    ),
    "DetachableJoint": (
        with_more(plugin("gz-sim", "gz::sim::systems::DetachableJoint")),
        "robot 'arm': plugin 'gz::sim::systems::DetachableJoint' of <gazebo> couples",
    ),
    "link attacher": (
        with_more(plugin("libgazebo_ros_link_attacher.so", "")),
        "plugin 'libgazebo_ros_link_attacher.so'",
    ),
    "plugin for another mimic joint": (
        with_more(plugin("libmimic.so", "a", "finger")),
        "plugin 'a' of <gazebo> couples",
    ),
    "mimic of ros2_control": (
        with_more(
            '<ros2_control><joint name="shoulder"><param name="mimic">x</param></joint>'
            "</ros2_control>"
        ),
        "joint 'shoulder': parameter 'mimic' of <ros2_control> is not modelled",
    ),
}

NO_MISTAKES = {
    "version": changed("<robot", '<robot version="1.1"'),
    "limits of 1.2": changed("<limit", '<limit acceleration="1" deceleration="2" jerk="3"'),
    "namespaces": changed("<robot", '<robot xmlns:x="urn:x" x:a="1" xmlns="urn:d"').replace(
        "<limit", '<limit x:b="1"'
    ),
    "undeclared prefix": changed("<limit", '<limit drake:acceleration="1"'),
    "a full turn": changed(JOINT_ORIGIN, '<origin rpy="6.2832 -6.283186 3.15"/>'),
    "transposed products": changed('ixy="0.0"', 'ixy="0.0" iyx="0.0"'),
    "axis of a fixed joint": arm(link("l"), changed(AXIS, '<axis rpy="1 0 0"/>', WELD)).replace(
        '<axis rpy="1 0 0"/>', "<axis/>"
    ),
    "type of a link": changed('<link name="base"', '<link type="laser" name="base"'),
    "Franka": changed(
        "</joint>",
        '<dynamics D="1" K="7000" damping="0.003" mu_coulomb="0" mu_viscous="16"/></joint>',
    ),
    "ANYmal": changed("<limit", '<limit command_effort="80" current="10" gear_velocity="10"'),
    "plugin for a mimic joint": arm(
        link("l", **BOX), FOLLOWER.format(""), plugin("libmimic.so", "mimic", "follower")
    ),
    "plugin without a coupling": with_more(plugin("libgazebo_ros_control.so", "gazebo")),
    "Unitree": changed('type="revolute"', 'type="revolute" dont_collapse="true"'),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_are_named(case):
    """One warning of load_urdf and a finding of inspect_robot name the element; the robot loads."""
    text, named = MISTAKES[case]
    with pytest.warns(dd.ModelWarning) as caught:
        assert dd.load_urdf(text).nv == 1
    assert len(caught) == 1 and named in str(caught[0].message)
    findings = [
        finding for finding in inspect_robot(text).findings if finding.check == "attributes"
    ]
    assert findings and all(
        finding.severity == "warning" and finding.remedy for finding in findings
    )


@pytest.mark.parametrize("case", NO_MISTAKES)
def test_no_mistakes_are_named(case):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert dd.load_urdf(NO_MISTAKES[case]).nv == 1


def test_many_mistakes_are_one_short_warning():
    """It names a caller, also one in a namespace without a name."""
    links = [link(f"l{k}") for k in range(100)]
    joints = [
        joint(f"j{k}", "fixed", "upper", f"l{k}").replace("<axis", f'<axis a{k // 4}="1"')
        for k in range(100)
    ]
    with pytest.warns(dd.ModelWarning) as caught:
        exec("load(text)", {"load": dd.load_urdf, "text": arm(*links, *joints)})
    text = str(caught[0].message)
    assert len(caught) == 1 and len(text) < 2000 and caught[0].filename == "<string>"
    assert "joint 'j0' and 3 more: <axis>" in text and "And 15 more mistakes" in text


@pytest.mark.parametrize("robot", shortened(all_robots(), all_robots()[::7]))
def test_public_robots_have_no_mistakes(robot):
    """Attributes of manufacturers are no mistakes."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", dd.ModelWarning)
        warnings.simplefilter("ignore", dd.InertiaWarning)
        with contextlib.suppress(dd.DiagDynamicsError):  # tested elsewhere
            dd.load_urdf(robot_path(robot), massless="lock")


# --- Rotor inertias of transmissions

SIMPLE = "<type>transmission_interface/SimpleTransmission</type>"
TWO = arm(
    link("l", **BOX), joint("elbow", "revolute", "upper", "l", xyz=(0.3, 0.0, 0.1), axis=(0, 1, 0))
)


def motor(content, name="m", joint="shoulder", transmission="t", more=""):
    """Return a transmission of one joint; `content` is that of its actuator."""
    return (
        f'<transmission name="{transmission}">{SIMPLE}<joint name="{joint}"/>{more}'
        f'<actuator name="{name}">{content}</actuator></transmission>'
    )


ROTOR = '<drake:rotor_inertia value="2e-4"/>'
GEAR = '<drake:gear_ratio value="100"/>'
REDUCTION = "<mechanicalReduction>100</mechanicalReduction>"

ROTORS = {
    # more elements, and N²J of shoulder and elbow
    "Drake": (motor(ROTOR + GEAR), (2.0, 0.0)),
    "Drake, prefix declared": (
        motor(
            '<d:rotor_inertia xmlns:d="urn:d" value="2e-4"/>'
            '<d:gear_ratio xmlns:d="urn:d" value="100"/>'
        ),
        (2.0, 0.0),
    ),
    "without a reduction": (motor(ROTOR), (2e-4, 0.0)),
    "without a rotor": (motor(GEAR + "<mechanicalReduction>1/50</mechanicalReduction>"), (0, 0)),
    "rotor of zero": (motor('<rotorInertia value="0"/>' + GEAR), (0.0, 0.0)),
    "ROS 1": (
        motor("<rotorInertia>2e-4</rotorInertia><mechanicalReduction>-100</mechanicalReduction>"),
        (2.0, 0.0),
    ),
    "reduction of the transmission": (motor(ROTOR, more=REDUCTION), (2.0, 0.0)),
    "motor inertia": (motor("<motorInertia>2e-4</motorInertia>" + REDUCTION), (2.0, 0.0)),
    "ROS 2": (
        f'<ros2_control name="r"><transmission name="t">'
        f'<actuator name="m" role="a">{ROTOR}</actuator><joint name="elbow">'
        "<mechanical_reduction>50.0</mechanical_reduction></joint></transmission></ros2_control>",
        (0.0, 0.5),
    ),
    "default reduction of ROS": (
        motor(f"{ROTOR}{GEAR}<mechanicalReduction>1</mechanicalReduction>"),
        (2.0, 0.0),
    ),
    "without an actuator": (
        f'<transmission name="t"><joint '
        f'name="elbow"/>{REDUCTION}<rotor_inertia>2e-4</rotor_inertia></transmission>',
        (0.0, 2.0),
    ),
    "two reductions of one ratio": (motor(ROTOR + GEAR, more=REDUCTION), (2.0, 0.0)),
    "motors of both joints": (motor(ROTOR + GEAR) + motor(ROTOR, "m2", "elbow", "t2"), (2.0, 2e-4)),
}


@pytest.mark.parametrize("case", ROTORS)
def test_rotor_inertias_of_transmissions(case):
    """Pinocchio's mass matrix with its armature; inspect names them."""
    more, armature = ROTORS[case]
    text = with_more(more, TWO)
    reference = pin.buildModelFromXML(TWO)
    q = np.array([0.3, -0.8])
    reference.armature = np.array(armature)
    M = np.triu(pin.crba(reference, reference.createData(), q))
    M += np.triu(M, 1).T
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = dd.load_urdf(text)
    np.testing.assert_allclose(dd.DiagonalDynamics(model).mass_matrix(q), M, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(model.armature, armature, rtol=1e-12)
    report = inspect_robot(text)
    rotors = {
        name: value
        for f in report.findings
        if f.check == "transmissions"
        for name, value in f.values.items()
    }
    expected = {
        name: value for name, value in zip(("shoulder", "elbow"), armature, strict=True) if value
    }
    assert {name: value for name, value in rotors.items() if value} == pytest.approx(expected)
    assert report.checks["transmissions"] == ("note" if rotors else "ok")


def test_rotor_inertia_of_a_mimic_joint():
    """A follower's rotor turns with its source: multiplier² N²J."""
    follower = (
        FOLLOWER.replace("shoulder", "elbow")
        .replace("follower", "tip")
        .replace('"l"', '"t"')
        .replace("upper", "l")
    )
    text = with_more(link("t", **BOX) + follower.format(' multiplier="-2"'), TWO)
    bare, geared = (
        dd.load_urdf(entry) for entry in (text, with_more(motor(ROTOR + GEAR, joint="tip"), text))
    )
    np.testing.assert_allclose(geared.armature - bare.armature, [0.0, 8.0], rtol=1e-12)
    difference = dd.DiagonalDynamics(geared).mass_matrix([0.1, 0.2]) - dd.DiagonalDynamics(
        bare
    ).mass_matrix([0.1, 0.2])
    np.testing.assert_allclose(difference, np.diag([0.0, 8.0]), atol=1e-12)


def test_precedence_of_armature():
    """The argument replaces parameters, these replace the transmission; a model with other joints
    locked keeps it.
    """
    text = with_more(motor(ROTOR + GEAR) + motor(ROTOR, "m2", "elbow", "t2"), TWO)
    parameters = {"joints": {"shoulder": {"armature": 0.5}}}
    assert dd.load_urdf(text, parameters=parameters).armature == pytest.approx([0.5, 2e-4])
    assert dd.load_urdf(text).with_parameters(parameters).armature == pytest.approx([0.5, 2e-4])
    assert dd.load_urdf(
        text, parameters=parameters, armature={"shoulder": 0.7}
    ).armature == pytest.approx([0.7, 2e-4])
    assert dd.load_urdf(text, armature=0.0).armature == pytest.approx([0.0, 0.0])
    assert dd.load_urdf(text).with_locked_joints({"shoulder": 0.1}).armature == pytest.approx(
        [2e-4]
    )
    assert pickle.loads(pickle.dumps(dd.load_urdf(text))).armature == pytest.approx([2.0, 2e-4])


LEFT_OUT = {
    "two joints": motor(ROTOR, more='<joint name="elbow"/>'),
    "a fixed joint": motor(ROTOR, joint="weld"),
    "no joint": f'<transmission name="t"><actuator name="m">{ROTOR}</actuator></transmission>',
    "two joints with reductions": motor(
        ROTOR + REDUCTION,
        more='<joint name="elbow"><mechanicalReduction>10</mechanicalReduction></joint>',
    ),
    "two actuators": motor(ROTOR, more=f'<actuator name="n">{ROTOR}</actuator>'),
    "two reductions": motor(ROTOR + GEAR, more="<mechanicalReduction>50</mechanicalReduction>"),
    "a joint and a fixed one": motor(ROTOR, more='<joint name="weld"/>'),
    "negative": motor('<drake:rotor_inertia value="-1e-4"/>'),
    "too large": motor('<drake:rotor_inertia value="1e200"/>'),
    "in words": motor('<rotorInertia value="${J}"/>'),
    "nothing": motor("<rotorInertia/>"),
    "reduction of zero": motor(f"{ROTOR}<mechanicalReduction>0</mechanicalReduction>"),
    "unknown joint": motor(ROTOR, joint="knee"),
}


@pytest.mark.parametrize("case", LEFT_OUT)
def test_rotor_inertias_without_one_joint_are_named(case):
    text = with_more(link("w") + WELD.replace('"l"', '"w"') + LEFT_OUT[case], TWO)
    with pytest.warns(dd.ModelWarning, match="the rotor inertia of transmission 't' is ignored"):
        assert not dd.load_urdf(text).armature.any()
    assert inspect_robot(text).checks["attributes"] == "warning"


def test_a_joint_has_the_rotor_of_its_first_transmission():
    text = with_more(motor(ROTOR + GEAR) + motor(ROTOR, "m2", transmission="t2"), TWO)
    with pytest.warns(dd.ModelWarning, match="the rotor inertia of transmission 't2' is ignored"):
        assert dd.load_urdf(text).armature == pytest.approx([2.0, 0.0])


# --- Contents that are rejected

REJECTED = {
    "rpy and quaternion": (
        with_origins(f'{RPY} quat_xyzw="0 0 0 1"'),
        "<origin> has rpy and quat_xyzw",
    ),
    "rpy and quaternion of a joint": (
        changed('<origin xyz="0.0 0.0 0.0"', '<origin quat_xyzw="0 0 0 1"'),
        "joint 'shoulder': <origin> has rpy and quat_xyzw",
    ),
    "zero quaternion": (
        with_origins('quat_xyzw="0 0 0 0"'),
        "'upper': <origin quat_xyzw='0 0 0 0'> is no rotation",
    ),
    "short quaternion": (
        with_origins('quat_xyzw="0 0 1"'),
        "<origin quat_xyzw='0 0 1'> is not 4 finite numbers",
    ),
    "two parents": (
        changed('<parent link="base"/>', '<parent link="base"/><parent link="upper"/>'),
        "joint 'shoulder' has 2 <parent> elements; expected one",
    ),
    "two children": (
        changed('<child link="upper"/>', '<child link="upper"/><child link="base"/>'),
        "joint 'shoulder' has 2 <child> elements",
    ),
    "loop of Isaac Sim": (
        changed(
            "</robot>",
            '<loop_joint name="l" type="spherical"><link1 link="base"/></loop_joint></robot>',
        ),
        "<loop_joint name='l'> is not supported",
    ),
    "loop of URDF+": (
        changed("</robot>", '<loop name="l"/></robot>'),
        "<loop name='l'> is not supported",
    ),
    "coupling of URDF+": (
        changed("</robot>", '<coupling name="c"/></robot>'),
        "<coupling name='c'>",
    ),
    "loop in other letters": (
        changed("</robot>", "<LoopJoint/></robot>"),
        "<LoopJoint> is not supported",
    ),
    "gear": (changed("</robot>", "<gear_joint/></robot>"), "<gear_joint> is not supported"),
    "loop of Gazebo": (
        changed("</robot>", '<gazebo><loop_joint name="l"/></gazebo></robot>'),
        "<loop_joint name='l'> is not supported",
    ),
    "constraint": (changed("</robot>", "<constraint/></robot>"), "<constraint> is not supported"),
    "constraint of Drake": (
        changed("</robot>", '<d:ball_constraint xmlns:d="http://drake.mit.edu"/></robot>'),
        "<d:ball_constraint> is not",
    ),
    "joint of Drake": (
        changed("</robot>", '<drake:joint name="s" type="screw"/></robot>'),
        "<drake:joint name='s'> is not supported",
    ),
}


@pytest.mark.parametrize("case", REJECTED)
def test_rejected_contents(case):
    text, named = REJECTED[case]
    with pytest.raises(dd.UrdfError) as caught:
        dd.load_urdf(text)
    assert named in str(caught.value)
