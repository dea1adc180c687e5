# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inspection of a robot: every check on an arm with the mistake and on one without, and on real robots."""

import json
import re

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.cli.inspect import shown
from diag_dynamics.inspection import CHECKS, SEVERITIES, inspect_robot
from diag_dynamics.inspection.motion import Motion
from examples import some_of
from robots import robot_path

ARM = """<robot name="arm">
<link name="base"><inertial><mass value="10"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.3 0.3 0.1"/></geometry></collision></link>
<link name="left_upper"><inertial><origin xyz="0.2 0 0"/><mass value="3.2"/>
  <inertia ixx="0.0042" iyy="0.0448" izz="0.0448" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.09 0.09"/></geometry></collision></link>
<link name="left_lower"><inertial><origin xyz="0.15 0 0"/><mass value="1.2"/>
  <inertia ixx="0.0006" iyy="0.0093" izz="0.0093" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.15 0 0" rpy="0 1.5707963 0"/>
    <geometry><cylinder radius="0.03" length="0.3"/></geometry></collision></link>
<link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="left_upper"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" effort="60" velocity="2"/></joint>
<joint name="elbow" type="revolute"><parent link="left_upper"/><child link="left_lower"/>
  <origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" effort="20" velocity="3"/></joint>
<joint name="flange" type="fixed"><parent link="left_lower"/><child link="tool"/><origin xyz="0.3 0 0"/></joint>
</robot>
"""

UPPER = 'ixx="0.0042" iyy="0.0448" izz="0.0448"'
LOWER = 'ixx="0.0006" iyy="0.0093" izz="0.0093"'
LIMIT = '<limit lower="-2" upper="2" effort="20" velocity="3"/>'
TOOL = '<link name="tool"/>'
VISIBLE_TOOL = '<link name="tool"><visual><geometry><sphere radius="0.01"/></geometry></visual></link>'
BOX = '<box size="0.4 0.09 0.09"/>'
END = "</robot>"


def inertial(mass, moment):
    moments = f'ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"'
    return f'<inertial><mass value="{mass}"/><inertia {moments}/></inertial>'


def ball(name, mass, moment, radius):
    return (
        f'<link name="{name}">{inertial(mass, moment)}'
        f'<collision><geometry><sphere radius="{radius}"/></geometry></collision></link>'
        f'<joint name="to_{name}" type="fixed"><parent link="base"/><child link="{name}"/></joint>'
    )


def changed(old, new, text=ARM):
    assert old in text
    return text.replace(old, new)


def with_more(elements):
    return changed(END, elements + END)


def mass_of(old, new, text=ARM):
    return changed(f'<mass value="{old}"/>', f'<mass value="{new}"/>', text)


def limit(old, new):
    """Return the arm with another limit of the elbow."""
    return changed(LIMIT, changed(old, new, LIMIT))


RIGHT = ARM[ARM.index('<link name="left_upper">') : ARM.index('<link name="left_lower">')].replace("left", "right")
"""A link of the other side."""

TO_RIGHT = (
    '<joint name="other" type="continuous"><parent link="base"/><child link="right_upper"/><axis xyz="0 1 0"/>'
    '<limit effort="60" velocity="2"/></joint>'
)


def follower(attributes, lower, upper, velocity):
    """Return a link and a joint that mimics the elbow."""
    return (
        f'<link name="finger">{inertial(0.5, 0.005)}<collision><geometry><sphere radius="0.2"/></geometry></collision></link>'
        '<joint name="follows" type="revolute"><parent link="base"/><child link="finger"/><axis xyz="0 1 0"/>'
        f'<limit lower="{lower}" upper="{upper}" effort="5" velocity="{velocity}"/>'
        f'<mimic joint="elbow" {attributes}/></joint>'
    )


DOT = ball("dot", 1e-6, 1e-9, 0.1).replace('izz="1e-09"', 'izz="3e-09"')
BALLS = "".join(ball(f"ball{k}", 0.5, 0.001, 0.05 + 0.01 * k) for k in range(3))
VOLUME = 0.4 * 0.09**2
REACH_UPPER, REACH_LOWER = np.hypot(0.2, np.hypot(0.045, 0.045)), np.hypot(0.15, np.hypot(0.03, 0.03))

VOLUMES = {"10": 0.3 * 0.3 * 0.1, "3.2": 0.4 * 0.09**2, "1.2": np.pi * 0.03**2 * 0.3}
"""Volumes of the arm's shapes [m³] by the mass of their links, as it is written."""


def made_of(*densities):
    """Return the arm at densities of its links [kg/m³], with masses of three digits and the inertias of solids."""
    text = ARM
    for (mass, volume), density in zip(VOLUMES.items(), densities * (3 // len(densities)), strict=True):
        text = mass_of(mass, f"{density * volume:.3g}", text)
    for moments, (link_mass, k) in {UPPER: ("3.2", 1), LOWER: ("1.2", 2)}.items():
        factor = (densities * 3)[k % len(densities)] * VOLUMES[link_mass] / float(link_mass)
        scaled = re.sub(r'"([\d.]+)"', lambda found, factor=factor: f'"{float(found[1]) * factor:.4g}"', moments)
        text = changed(moments, scaled, text)
    return text


# the mistake: check, severity, link or joint, its number (None: there is none), the arm with the mistake
MISTAKES = {
    "inertia beyond a plate's": (
        *("possible_inertias", "warning", "left_upper", 100 * 0.0098 / 0.0588),
        changed(UPPER, 'ixx="0.0042" iyy="0.0448" izz="0.0588"'),
    ),
    "negative moment": (
        *("possible_inertias", "warning", "left_lower", -0.01),
        changed(LOWER, 'ixx="-0.01" iyy="0.0093" izz="0.0093"'),
    ),
    "negative moment of one digit": (
        *("possible_inertias", "warning", "left_lower", -0.004),
        changed(LOWER, 'ixx="-0.004" iyy="0.009" izz="0.009"'),
    ),
    "impossible, of little mass": ("possible_inertias", "note", "dot", 100 / 3, with_more(DOT)),
    "impossible by the last digit": (
        *("possible_inertias", "note", "left_upper", 20.0),
        changed(UPPER, 'ixx="0.02" iyy="0.02" izz="0.05"'),
    ),
    "geometry without inertia": ("missing_inertias", "note", "tool", None, changed(TOOL, VISIBLE_TOOL)),
    "a moving link without inertia": (
        *("missing_inertias", "warning", "left_lower", None),
        re.sub(r"(?s)(left_lower\">)<inertial>.*?</inertial>", r"\1", ARM),
    ),
    "a point": ("missing_inertias", "warning", "left_lower", 1.2, changed(LOWER, 'ixx="0" iyy="0" izz="0"')),
    "mass without geometry": (
        *("mass_without_geometry", "note", "left_upper", 3.2),
        re.sub(r"<collision>.{1,90}box size=\"0.4.*?</collision>", "", ARM),
    ),
    "lead in grams": ("density", "warning", "left_upper", 3200 / VOLUME, mass_of("3.2", "3200")),
    "dense": ("density", "note", "left_upper", 39 / VOLUME, mass_of("3.2", "39")),
    "an arm of steel": (
        *("uniform_density", "warning", "base left_upper left_lower", 7850.0),
        made_of(7850.0),
    ),
    "an arm of several steels": (
        *("uniform_density", "warning", "base left_upper left_lower", 7200.0),
        made_of(7200.0, 8000.0, 7800.0),
    ),
    "an arm of water": ("uniform_density", "note", "base left_upper left_lower", 1000.0, made_of(1000.0)),
    "another frame": (
        *("centre_of_mass", "warning", "left_upper", 0.2),
        changed('<origin xyz="0.2 0 0"/><mass', '<origin xyz="0.6 0 0"/><mass'),
    ),
    "kg mm²": (
        *("gyration", "warning", "left_lower", np.sqrt(9300 / 1.2) / REACH_LOWER),
        changed(LOWER, 'ixx="600" iyy="9300" izz="9300"'),
    ),
    "too large about an axis without effect": (
        *("gyration", "note", "left_upper", np.sqrt(0.8 / 3.2) / REACH_UPPER),
        changed(UPPER, 'ixx="0.8" iyy="0.0448" izz="0.8"'),
    ),
    "a bar along another axis": (
        *("inertia_axes", "warning", "left_lower", None),
        changed(LOWER, 'ixx="0.0093" iyy="0.0093" izz="0.0006"'),
    ),
    "the identity": (
        *("placeholders", "warning", "left_upper", 2 * np.sqrt(2.5 / 3.2)),
        changed(UPPER, 'ixx="1" iyy="1" izz="1"'),
    ),
    "one inertia for all": ("placeholders", "note", "ball0 ball1 ball2", None, with_more(BALLS)),
    "sides": ("sides", "note", "left_upper right_upper", 3.2, with_more(RIGHT.replace('"3.2"', '"2.8"') + TO_RIGHT)),
    "a lost mesh": ("meshes", "warning", "left_upper", None, changed(BOX, '<mesh filename="package://no/a.stl"/>')),
    "an unknown shape": ("meshes", "note", "left_upper", None, changed(BOX, "<cone/>")),
    "an element twice": ("elements", "warning", "elbow", None, changed(LIMIT, LIMIT * 2)),
    "an unknown attribute": ("attributes", "warning", "elbow", None, limit("lower", "Lower")),
    "an attribute of a manufacturer": ("attributes", "note", "elbow", None, limit("/>", ' current="1"/>')),
    "an origin in degrees": (
        *("attributes", "warning", "flange", 90.0),
        changed('<origin xyz="0.3 0 0"/></joint>', '<origin xyz="0.3 0 0" rpy="0 90 0"/></joint>'),
    ),
    "a visual in degrees": (
        *("attributes", "warning", "left_upper", 180.0),
        changed('<collision><origin xyz="0.2 0 0"/>', '<collision><origin xyz="0.2 0 0" rpy="0 0 180"/>'),
    ),
    "a rotor": (
        *("transmissions", "note", "elbow", 0.02),
        with_more(
            '<transmission name="t"><joint name="elbow"/><actuator name="m"><drake:rotor_inertia value="2e-6"/>'
            '<drake:gear_ratio value="100"/></actuator></transmission>'
        ),
    ),
    "a long axis": (
        *("axes", "note", "elbow", np.sqrt(2)),
        changed('<axis xyz="0 1 0"/>\n  ' + LIMIT, '<axis xyz="0 1 1"/>\n  ' + LIMIT),
    ),
    "no limits": ("position_limits", "warning", "elbow", None, changed(LIMIT, "")),
    "degrees": ("position_limits", "warning", "elbow", 170.0, limit('"-2"', '"-170"')),
    "ignored limits": (
        *("position_limits", "note", "other", None),
        with_more(RIGHT + TO_RIGHT.replace("<limit", '<limit lower="-1" upper="1"')),
    ),
    "no effort": ("effort_limits", "warning", "elbow", None, limit('effort="20"', 'effort="0"')),
    "any effort": ("effort_limits", "note", "elbow", 1e6, limit('effort="20"', 'effort="1e6"')),
    "no velocity": ("velocity_limits", "warning", "elbow", None, limit('velocity="3"', 'velocity="0"')),
    "a mimic joint that stops": (
        *("mimic_joints", "note", "follows", 0.5),
        with_more(follower('multiplier="-2" offset="0.5"', -3.5, 4.0, 9)),
    ),
    "a slow mimic joint": ("mimic_joints", "note", "follows", 3.0, with_more(follower('multiplier="2"', -4, 4, 2))),
    "no rotor": ("rotor_inertia", "note", "elbow", 1e3 * 0.0363 * 3 / 200, limit('effort="20"', 'effort="200"')),
    "weak": ("gravity", "note", "shoulder", None, changed('effort="60"', 'effort="12"')),
    "far too weak": ("gravity", "warning", "shoulder", None, changed('effort="60"', 'effort="2"')),
    "light beside heavy": (
        *("conditioning", "note", "elbow shoulder", None),
        mass_of("1.2", "1e-9", changed(LOWER, 'ixx="0" iyy="1e-11" izz="1e-11"')),
    ),
    "velocity of a placeholder": (
        *("kinetic_energy", "warning", "elbow shoulder", None),
        changed('velocity="2"', 'velocity="1000"'),
    ),
}


def findings_of(report, check, severity):
    return [finding for finding in report.findings if (finding.check, finding.severity) == (check, severity)]


def test_arm_without_mistakes():
    report = inspect_robot(ARM)
    assert report.findings == () and report.status == 0
    assert report.checks == dict.fromkeys(CHECKS, "ok")
    assert {check for check, *_ in MISTAKES.values()} | {"loading"} == set(CHECKS)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes(mistake):
    """A check finds its mistake with severity, place and number."""
    check, severity, where, number, text = MISTAKES[mistake]
    report = inspect_robot(text)
    (finding,) = findings_of(report, check, severity)
    assert {*finding.links, *finding.joints} == set(where.split())
    if number is not None:
        assert finding.values[where.split()[0]] == pytest.approx(number, rel=2e-3)
        assert finding.unit
    assert finding.what and finding.remedy
    assert SEVERITIES.index(report.checks[check]) >= SEVERITIES.index(severity)


# --- Numbers against Pinocchio


def test_motion_against_pinocchio():
    """Gravity torque, energy at the velocity limits, condition and reflected mass in the same poses."""
    path = robot_path("ur_description/urdf/ur5_robot.urdf")
    model = dd.load_urdf(path)
    motion = Motion(model)
    reference = pin.buildModelFromUrdf(str(path))
    data, frame = reference.createData(), reference.getFrameId("ee_link")
    assert (model.lower <= motion.Q).all() and (model.upper >= motion.Q).all()
    masses = motion.reflected_mass("ee_link")
    signs = np.random.default_rng(1).choice([-1.0, 1.0], (len(motion.Q), 6))
    for k in range(0, 50, 7):
        q = motion.Q[k]
        M = pin.crba(reference, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        assert motion.condition[k] == pytest.approx(np.linalg.cond(M), rel=1e-9)
        qd = signs[k] * reference.velocityLimit
        assert motion.energy_at_limits[k] == pytest.approx(0.5 * qd @ M @ qd, rel=1e-9)
        assert np.allclose(motion.gravity_torque[k], pin.computeGeneralizedGravity(reference, data, q), rtol=1e-9)
        J = pin.computeFrameJacobian(reference, data, q, frame, pin.LOCAL)[:3]
        assert masses[k] == pytest.approx(1.0 / np.linalg.eigvalsh(J @ np.linalg.solve(M, J.T))[-1], rel=1e-6)


# --- Robots that do not load


def test_rejected_robot_has_a_report():
    """It has the error of the loader and the findings of checks that need no model."""
    report = inspect_robot(changed('type="fixed"', 'type="screw"', MISTAKES["lead in grams"][-1]))
    (finding,) = findings_of(report, "loading", "error")
    assert "joint 'flange': unknown type 'screw'" in finding.what
    assert findings_of(report, "density", "warning") and report.status == 2
    assert report.checks["gravity"] == "skipped" and report.facts["degrees_of_freedom"] is None
    assert report.facts["links"] == 4 and report.facts["total_mass"] == pytest.approx(3211.2)


def test_massless_joints():
    """They are locked for the checks that follow."""
    report = inspect_robot(MISTAKES["a moving link without inertia"][-1])
    (finding,) = findings_of(report, "loading", "error")
    assert finding.joints == ("elbow",) and finding.values == {"elbow": 0.0}
    assert "massless='lock'" in finding.remedy and "--estimate-inertias" in finding.remedy
    assert report.facts["locked_joints"] == ["elbow"] and report.facts["degrees_of_freedom"] == 1
    assert report.checks["gravity"] == "ok" and report.status == 2


def test_mimic_joint_without_source():
    text = changed('mimic joint="elbow"', 'mimic joint="knee"', with_more(follower('multiplier="1"', -4, 4, 9)))
    report = inspect_robot(text)
    (finding,) = findings_of(report, "loading", "error")
    assert "'knee'" in finding.what and finding.joints == ("follows",) and report.facts["degrees_of_freedom"] == 3


def test_sources_that_are_hardly_a_robot():
    huge = "<link><visual><geometry><sphere radius='1e200'/></geometry></visual></link>"
    assert inspect_robot(f"<robot>{huge}</robot>").checks["meshes"] == "note"
    for text in ("<robot/>", "<robot><link/></robot>", '<robot><link name="a"/><joint/></robot>'):
        assert inspect_robot(text).checks["loading"] == "error"
    for source in ("nowhere.urdf", "<robot", "<sdf/>", ""):
        with pytest.raises(dd.UrdfError):
            inspect_robot(source)


def test_missing_and_broken_attributes():
    """An inspection without an attribute or element, or with nonsense in it, is a report."""
    pieces = [
        *re.finditer(r' \w+="[^"]*"', ARM),
        *re.finditer(r"<(?:origin|axis|limit|mass|inertia|parent|child)\b[^>]*/>", ARM),
    ]
    assert len(pieces) > 80
    for piece in some_of(pieces, 4):
        for other in ("", re.sub('"[^"]*"', '"x 1e999"', piece[0])):
            report = inspect_robot(ARM[: piece.start()] + other + ARM[piece.end() :])
            json.dumps(report.to_dict(), allow_nan=False)
            assert max(map(len, shown(report))) <= 80


# --- Real robots

WELL_MADE = (
    *("panda_description/urdf/panda", "talos_data/robots/talos_full_v2", "kinova_description/robots/kinova"),
    *("go2_description/urdf/go2", "g1_description/urdf/g1_29dof_rev_1_0", "xarm_description/urdf/xarm7"),
    *("z1_description/urdf/z1", "a1_description/urdf/a1", "hyq_description/robots/hyq_no_sensors"),
    "so_arm_description/urdf/so100",
)

ILL_MADE = {
    # UR5 and UR10: the inertials of the wrists are known to be in other frames, and too large.
    "ur_description/urdf/ur5_robot": {"centre_of_mass": "wrist_1_link", "gyration": "wrist_3_link"},
    "simple_humanoid_description/urdf/simple_humanoid": {"placeholders": "torso", "gravity": "WAIST_P"},
    "pr2_description/urdf/pr2": {"possible_inertias": "double_stereo_link", "gyration": "sensor_mount_link"},
    "bolt_description/robots/bolt": {"kinetic_energy": "FL_HAA"},
    "iris_description/robots/iris": {"effort_limits": "iris__rotor_0_joint"},
    "double_pendulum_description/urdf/double_pendulum_simple": {
        "placeholders": "base_link",
        "position_limits": "joint1",
    },
    "icub_description/robots/icub": {"missing_inertias": "neck_1", "centre_of_mass": "l_upper_leg"},
    "tiago_description/robots/tiago": {"density": "hand_thumb_link", "gyration": "hand_thumb_link"},
}


@pytest.mark.parametrize("name", some_of(WELL_MADE, 9))
def test_well_made_robots(name):
    report = inspect_robot(robot_path(f"{name}.urdf"))
    assert report.status == 0 and set(report.checks.values()) <= {"ok", "note"}
    assert not findings_of(report, "meshes", "warning")


@pytest.mark.parametrize("name", some_of(ILL_MADE, 4))
def test_ill_made_robots(name):
    report = inspect_robot(robot_path(f"{name}.urdf"))
    assert report.status == 1
    for check, where in ILL_MADE[name].items():
        (finding,) = findings_of(report, check, "warning")
        assert where in (*finding.links, *finding.joints), check


def test_facts():
    """A humanoid has tips, mimic joints and a floating base."""
    path = robot_path("talos_data/robots/talos_reduced.urdf")
    model, facts = dd.load_urdf(path), inspect_robot(path).facts
    assert facts["degrees_of_freedom"] == model.nv and facts["total_mass"] == pytest.approx(model.total_mass, rel=1e-12)
    assert facts["root_link"] == "base_link" and facts["links"] == len(model.link_names) and facts["poses"] == 200
    assert {"left_sole_link", "right_sole_link"} <= set(facts["tips"])
    sole = facts["tips"]["left_sole_link"]
    assert 0.0 < sole["least"] <= sole["greatest"] < model.total_mass
    assert inspect_robot(path, floating_base=True).facts["degrees_of_freedom"] == model.nv + 6
