# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inspection of a robot: every check on an arm with the mistake and on one without, and on real
robots.
"""

import json
import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.cli.inspect import report_lines
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.inspection import CHECKS, SEVERITIES, inspect_robot
from examples import some_of
from robots import changed, robot_path

LOWER_SHAPE = """<collision><origin xyz="0.15 0 0" rpy="0 1.5707963 0"/>
    <geometry><cylinder radius="0.03" length="0.3"/></geometry></collision>"""

ARM = f"""<robot name="arm">
<link name="base"><inertial><mass value="10"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.3 0.3 0.1"/></geometry></collision></link>
<link name="left_upper"><inertial><origin xyz="0.2 0 0"/><mass value="3.2"/>
  <inertia ixx="0.0042" iyy="0.0448" izz="0.0448" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.09 0.09"/></geometry></collision>
    </link>
<link name="left_lower"><inertial><origin xyz="0.15 0 0"/><mass value="1.2"/>
  <inertia ixx="0.0006" iyy="0.0093" izz="0.0093" ixy="0" ixz="0" iyz="0"/>
    </inertial>{LOWER_SHAPE}</link>
<link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="left_upper"/>
<axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" effort="24" velocity="2"/></joint>
<joint name="elbow" type="revolute"><parent link="left_upper"/><child link="left_lower"/>
<origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="20" velocity="3"/>
</joint>
<joint name="flange" type="fixed"><parent link="left_lower"/><child link="tool"/>
<origin xyz="0.3 0 0"/></joint>
</robot>
"""

UPPER, LOWER = 'ixx="0.0042" iyy="0.0448" izz="0.0448"', 'ixx="0.0006" iyy="0.0093" izz="0.0093"'
BASE = 'ixx="0.1" iyy="0.1" izz="0.1"'
LIMIT = '<limit lower="-2.5" upper="2.5" effort="20" velocity="3"/>'
BOX, TOOL = '<box size="0.4 0.09 0.09"/>', '<link name="tool"/>'
REACH_LOWER = np.hypot(0.15, 0.03 * np.sqrt(2))


def arm(*changes):
    """Return the arm with changes: old and new text in turn."""
    text = ARM
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        text = changed(old, new, text)
    return text


def moments(old, *new):
    return arm(old, 'ixx="{}" iyy="{}" izz="{}"'.format(*new))


def more(elements):
    return arm("</robot>", elements + "</robot>")


def ball(name, mass, ixx, radius, izz=None):
    inertia = f'ixx="{ixx}" iyy="{ixx}" izz="{izz or ixx}" ixy="0" ixz="0" iyz="0"'
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia {inertia}/></inertial>'
        f'<collision><geometry><sphere radius="{radius}"/></geometry></collision></link>'
    )


def welded(name, *numbers):
    joint = (
        f'<joint name="to_{name}" type="fixed"><parent link="base"/><child link="{name}"/></joint>'
    )
    return ball(name, *numbers) + joint


def mimic(attributes, lower, upper, velocity):
    """Return the arm with a joint that mimics the elbow."""
    return more(
        f'{ball("finger", 0.5, 0.005, 0.2)}<joint name="follows" type="revolute">'
        f'<parent link="base"/>'
        f'<child link="finger"/><axis xyz="0 1 0"/><mimic joint="elbow" {attributes}/>'
        f'<limit lower="{lower}" upper="{upper}" effort="5" velocity="{velocity}"/></joint>'
    )


def bare(name):
    """Return the arm with a link without <inertial>."""
    return re.sub(rf"(?s)({name}\">)<inertial>.*?</inertial>", r"\1", ARM)


ROTOR = (
    '<transmission name="t"><joint name="elbow"/><actuator name="m">'
    '<drake:rotor_inertia value="2e-6"/>'
    '<drake:gear_ratio value="100"/></actuator></transmission>'
)
ELBOW = 'elbow" type="revolute"'

# check, severity, links or joints, number of the first (None: there is none), the arm with the
# mistake
MISTAKES = (
    (
        "possible_inertias",
        "warning",
        "left_upper",
        100 * 0.0098 / 0.0588,
        moments(UPPER, 0.0042, 0.0448, 0.0588),
    ),
    ("possible_inertias", "warning", "left_lower", -0.01, moments(LOWER, -0.01, 0.0093, 0.0093)),
    ("possible_inertias", "note", "dot", 100 / 3, more(welded("dot", 1e-6, 1e-9, 0.1, 3e-9))),
    ("missing_inertias", "warning", "left_lower", None, bare("left_lower")),
    ("missing_inertias", "warning", "left_lower", 1.2, moments(LOWER, 0, 0, 0)),
    ("missing_inertias", "warning", "left_lower", None, arm('"1.2"', '"0"')),
    ("centre_of_mass", "warning", "left_upper", 0.2, arm('"0.2 0 0"/><mass', '"0.6 0 0"/><mass')),
    (
        "gyration",
        "warning",
        "left_lower",
        np.sqrt(9300 / 1.2) / REACH_LOWER,
        moments(LOWER, 600, 9300, 9300),
    ),
    (
        "gyration",
        "note",
        "left_lower",
        np.sqrt(6e-6 / 1.2) / REACH_LOWER,
        moments(LOWER, 6e-6, 6e-6, 6e-6),
    ),
    ("gyration", "note", "base", 0.9**0.5 / np.hypot(0.15 * 2**0.5, 0.05), moments(BASE, 9, 9, 9)),
    ("placeholders", "warning", "left_upper", 2 * np.sqrt(2.5 / 3.2), moments(UPPER, 1, 1, 1)),
    ("meshes", "warning", "left_upper", None, arm(BOX, '<mesh filename="package://no/a.stl"/>')),
    ("meshes", "warning", "left_upper", None, arm(BOX, "<cone/>")),
    ("elements", "warning", "elbow", None, arm(LIMIT, LIMIT * 2)),
    ("attributes", "warning", "elbow", None, arm('lower="-2.5"', 'Lower="-2.5"')),
    ("attributes", "warning", "flange", 90.0, arm('"0.3 0 0"', '"0.3 0 0" rpy="0 90 0"')),
    ("transmissions", "note", "elbow", 0.02, more(ROTOR)),
    ("freedom", "note", "elbow", None, arm(ELBOW, 'elbow" type="planar"')),
    ("position_limits", "warning", "elbow", None, arm(LIMIT, "")),
    ("position_limits", "warning", "elbow", 2.5, arm('"-2.5"', '"2.5"')),
    ("position_limits", "warning", "elbow", 170.0, arm('"-2.5"', '"-170"')),
    (
        "position_limits",
        "note",
        "elbow",
        300.0,
        arm('"-2.5"', '"-300"', ELBOW, 'elbow" type="prismatic"'),
    ),
    ("effort_limits", "warning", "elbow", None, arm('effort="20"', 'effort="0"')),
    ("effort_limits", "note", "elbow", 1e6, arm('effort="20"', 'effort="1e6"')),
    ("velocity_limits", "note", "elbow", None, arm('velocity="3"', "")),
    ("velocity_limits", "warning", "elbow", None, arm('velocity="3"', 'velocity="0"')),
    ("velocity_limits", "note", "elbow", 1.7e308, arm('velocity="3"', 'velocity="1.7e308"')),
    ("rotor_inertia", "note", "elbow", 1e3 * 0.0363 * 3 / 200, arm('effort="20"', 'effort="200"')),
    ("gravity", "note", "shoulder", None, arm('effort="24"', 'effort="12"')),
    ("gravity", "warning", "shoulder", None, arm('effort="24"', 'effort="2"')),
)


def findings_of(report, check, severity):
    return [
        finding
        for finding in report.findings
        if (finding.check, finding.severity) == (check, severity)
    ]


def test_arm_without_mistakes():
    report = inspect_robot(ARM)
    assert report.findings == () and report.status == 0
    assert report.checks == dict.fromkeys(CHECKS, "ok")
    path = "/folder-of-robots" * 6
    assert f"  file     {path}" in report_lines(replace(report, source=path))
    assert {check for check, *_ in MISTAKES} | {"loading"} == set(CHECKS)


def test_attached_links_are_one_body():
    """Geometry at a link that a fixed joint attaches is compared with the mass of the other one."""
    shape = changed('"0.15 0 0"', '"-0.15 0 0"', LOWER_SHAPE)
    moved = arm(LOWER_SHAPE, "", TOOL, f'<link name="tool">{shape}</link>')
    assert inspect_robot(moved).findings == ()
    (finding,) = inspect_robot(moved.replace('"-0.15 0 0"', '"0.6 0 0"')).findings
    assert (finding.check, finding.links) == ("centre_of_mass", ("left_lower",))


@pytest.mark.parametrize(
    "mistake", range(len(MISTAKES)), ids=lambda k: "{}-{}-{}".format(*MISTAKES[k])
)
def test_mistakes(mistake):
    """A check finds its mistake with severity, place and number."""
    check, severity, where, number, text = MISTAKES[mistake]
    report = inspect_robot(text)
    (finding,) = findings_of(report, check, severity)
    assert {*finding.links, *finding.joints} == set(where.split())
    if number is not None:
        assert finding.values[where.split()[0]] == pytest.approx(number, rel=2e-3) and finding.unit
    numbers = list(finding.values.values())
    assert numbers == sorted(numbers, key=abs, reverse=True)  # the worst first
    assert finding.what and finding.remedy
    assert check == "missing_inertias" or report.checks["loading"] == "ok"
    worst = {*report.checks.values(), "note"} - {"skipped"}
    assert report.checks[check] in worst and report.status == max(map(SEVERITIES.index, worst)) - 1


def test_facts_against_pinocchio():
    """Energy at the velocity limits over the same poses, and the largest gravity torque."""
    path = robot_path("ur_description/urdf/ur5_robot.urdf")
    model = dd.load_urdf(path)
    facts = inspect_robot(path).facts
    reference = pin.buildModelFromUrdf(str(path))
    data = reference.createData()
    rng = np.random.default_rng(0)
    poses = np.array([model.random(rng) for _ in range(facts["poses"])])
    QD = np.random.default_rng(1).choice([-1.0, 1.0], poses.shape) * reference.velocityLimit
    energies = [
        pin.computeKineticEnergy(reference, data, q, qd) for q, qd in zip(poses, QD, strict=True)
    ]
    assert facts["kinetic_energy_at_velocity_limits"] == pytest.approx(max(energies), rel=1e-9)
    weak = re.sub(r'(<limit effort=")[\d.]+', r"\g<1>1e-3", path.read_text())
    (finding,) = findings_of(inspect_robot(weak), "gravity", "warning")
    torque = np.abs([pin.computeGeneralizedGravity(reference, data, q) for q in poses]).max(axis=0)
    for name, ratio in finding.values.items():
        assert ratio == pytest.approx(1e3 * torque[model.dof_names.index(name)], rel=1e-9)


# --- Robots that do not load


def test_rejected_joints_are_left_out():
    """Massless joints are locked and mimic joints without their source free for the checks that
    follow.
    """
    report = inspect_robot(bare("left_lower"))
    (finding,) = findings_of(report, "loading", "error")
    assert finding.joints == ("elbow",) and finding.values == {"elbow": 0.0}
    assert "massless=lock" in finding.remedy
    assert report.facts["locked_joints"] == ["elbow"] and report.facts["degrees_of_freedom"] == 1
    assert report.checks["gravity"] == "ok" and report.status == 2
    report = inspect_robot(
        changed('mimic joint="elbow"', 'mimic joint="knee"', mimic("", -4, 4, 9))
    )
    (finding,) = findings_of(report, "loading", "error")
    assert "'knee'" in finding.what
    assert finding.joints == ("follows",)
    assert report.facts["degrees_of_freedom"] == 3


def test_sources_that_are_hardly_a_robot():
    huge = "<link name='a'><visual><geometry><sphere radius='1e200'/></geometry></visual></link>"
    assert inspect_robot(f"<robot>{huge}</robot>").checks["meshes"] == "warning"
    sources = ("nowhere.urdf", "<robot", "<sdf/>", "", "<robot/>", arm('lower="-2.5"', 'lower="x"'))
    for source in sources:
        with pytest.raises(dd.UrdfError):
            inspect_robot(source)


def test_missing_and_broken_attributes():
    """An inspection without an attribute or element, or with nonsense in it, is a report or the
    loader's error.
    """
    elements = r"<(?:origin|axis|limit|mass|inertia|parent|child)\b[^>]*/>"
    pieces = [*re.finditer(r' \w+="[^"]*"', ARM), *re.finditer(elements, ARM)]
    assert len(pieces) > 80
    for piece in some_of(pieces, 4):
        for other in ("", re.sub('"[^"]*"', '"x 1e999"', piece[0])):
            try:
                report = inspect_robot(ARM[: piece.start()] + other + ARM[piece.end() :])
            except dd.UrdfError:
                continue
            json.dumps(report.to_dict(), allow_nan=False)
            assert max(map(len, report_lines(report))) <= 80


# --- Real robots

WELL_MADE = (
    "panda",
    "kinova",
    "go2",
    "g1_29dof_rev_1_0",
    "xarm7",
    "z1",
    "a1",
    "hyq_no_sensors",
    "so100",
    "talos_full_v2",
)

ILL_MADE = {
    # UR5 and UR10: the inertials of the wrists are known to be in other frames, and too large.
    "ur5": {"centre_of_mass": "wrist_1_link", "gyration": "wrist_3_link"},
    "simple_humanoid": {"placeholders": "torso", "gravity": "WAIST_P"},
    "pr2": {"possible_inertias": "double_stereo_link", "gyration": "sensor_mount_link"},
    "iris": {"effort_limits": "iris__rotor_0_joint"},
    "double_pendulum_simple": {"placeholders": "base_link", "position_limits": "joint1"},
    "icub": {"missing_inertias": "neck_1", "centre_of_mass": "l_upper_leg"},
    "tiago": {"gyration": "hand_thumb_link"},
}


@pytest.mark.parametrize("name", [*some_of(WELL_MADE, 9), *some_of(ILL_MADE, 4)])
def test_real_robots(name):
    """Well-made ones have notes at most; each mistake of others is found where it is known to
    be.
    """
    report = inspect_robot(find_urdf(name))
    expected = ILL_MADE.get(name, {})
    assert report.status == bool(expected) and set(report.checks.values()) <= {
        "ok",
        "note",
        "warning",
    }
    for check, where in expected.items():
        (finding,) = findings_of(report, check, "warning")
        assert where in (*finding.links, *finding.joints), check


def test_facts_of_a_humanoid():
    path = robot_path("talos_data/robots/talos_reduced.urdf")
    model = dd.load_urdf(path)
    facts = inspect_robot(path, floating_base=True).facts
    assert facts["total_mass"] == pytest.approx(model.total_mass, rel=1e-12)
    assert facts["root_link"] == "base_link"
    assert (facts["links"], facts["degrees_of_freedom"]) == (len(model.link_names), model.nv + 6)
