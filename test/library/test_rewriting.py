# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""URDFs with parameters written into them: Pinocchio and our own reader find the numbers, and all else is as it was."""

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import diag_dynamics as dd
from diag_dynamics.model.rewriting import urdf_with
from robots import description, joint, link, robot_path

PANDA = robot_path("panda_description/urdf/panda.urdf")

GIVEN = dd.Parameters(
    joints={
        "panda_joint1": dd.JointParameters(damping=0.25, friction=1.5, armature=0.3),
        "panda_joint2": dd.JointParameters(effort_offset=0.2),
        "panda_finger_joint1": dd.JointParameters(friction=0.7),
    },
    links={
        "panda_link2": dd.Payload(2.5, (0.01, -0.1, 0.02), ((0.04, 0.001, 0.0), (0.001, 0.03, 0.002), (0, 0.002, 0.05)))
    },
    payloads={
        "panda_link8": dd.Payload(0.4, (0.0, 0.05, 0.1), np.diag((2e-3, 2e-3, 1e-3))),
        "panda_hand": dd.Payload(-0.3, (0.0, 0.0, 0.03)),
    },
    origin={"method": "inertias", "date": "2026-11-24", "recordings": ["a--b.mcap"]},
)


def test_written_numbers_are_those_of_the_model():
    text = urdf_with(PANDA.read_text(), GIVEN)
    beside = dd.Parameters(
        joints={name: one._replace(damping=None, friction=None) for name, one in GIVEN.joints.items()}
    )
    written, expected = dd.load_urdf(text, parameters=beside), dd.load_urdf(PANDA, parameters=GIVEN)
    assert written.damping.tolist() == expected.damping.tolist()
    assert written.friction.tolist() == expected.friction.tolist()
    rng = np.random.default_rng(1)
    q, qd = expected.random(rng), rng.normal(size=expected.nv)
    a, b = (dd.DiagonalDynamics(model).evaluate(q, qd) for model in (written, expected))
    assert np.allclose(a.nu, b.nu, rtol=1e-13, atol=1e-14)
    assert np.allclose(a.coriolis, b.coriolis, rtol=1e-11, atol=1e-13)
    assert np.allclose(a.link_energy, b.link_energy, rtol=1e-12, atol=1e-16)


def test_pinocchio_reads_them():
    model = pin.buildModelFromXML(urdf_with(PANDA.read_text(), GIVEN))
    inertia, given = model.inertias[model.getJointId("panda_joint2")], GIVEN.links["panda_link2"]
    assert inertia.mass == given.mass
    assert np.array_equal(inertia.lever, np.array(given.com))
    assert np.allclose(inertia.inertia, np.array(given.inertia), rtol=1e-15, atol=1e-18)
    at = model.joints[model.getJointId("panda_joint1")].idx_v
    assert model.damping[at] == 0.25


def test_all_else_stays():
    before, after = PANDA.read_text(), urdf_with(PANDA.read_text(), GIVEN)

    def rest(text):
        root = etree.fromstring(text.encode(), etree.XMLParser(remove_comments=True, remove_blank_text=True))
        for element in root.iter("inertial", "dynamics"):
            element.getparent().remove(element)
        return etree.tostring(root, method="c14n")

    assert rest(before) == rest(after)
    assert after.count("written by diag_dynamics, inertias, 2026-11-24, from a- -b.mcap") == 3 + 2
    untouched = urdf_with(before, dd.Parameters())
    assert "diag_dynamics" not in untouched
    assert dd.load_urdf(untouched).total_mass == dd.load_urdf(PANDA).total_mass


def test_lines_are_indented_as_the_file_is():
    text = (
        '<robot name="r">\n  <link name="base"/>\n  <link name="arm">\n    <visual/>\n    <inertial>\n'
        '      <mass value="1"/>\n      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>\n    </inertial>\n'
        '  </link>\n  <joint name="j" type="revolute">\n    <parent link="base"/>\n    <child link="arm"/>\n'
        '    <limit effort="1" velocity="1"/>\n  </joint>\n</robot>'
    )
    given = dd.Parameters(
        joints={"j": dd.JointParameters(damping=0.5)},
        links={"arm": dd.Payload(2.0, (0, 0, 1), np.eye(3)), "base": dd.Payload(3.0)},
    )
    assert urdf_with(text, given).splitlines() == [
        '<robot name="r">',
        '  <link name="base">',
        "    <inertial>",
        "      <!-- written by diag_dynamics -->",
        '      <origin xyz="0.0 0.0 0.0" rpy="0 0 0"/>',
        '      <mass value="3.0"/>',
        '      <inertia ixx="0.0" ixy="0.0" ixz="0.0" iyy="0.0" iyz="0.0" izz="0.0"/>',
        "    </inertial>",
        "  </link>",
        '  <link name="arm">',
        "    <inertial>",
        "      <!-- written by diag_dynamics -->",
        '      <origin xyz="0.0 0.0 1.0" rpy="0 0 0"/>',
        '      <mass value="2.0"/>',
        '      <inertia ixx="1.0" ixy="0.0" ixz="0.0" iyy="1.0" iyz="0.0" izz="1.0"/>',
        "    </inertial>",
        "    <visual/>",
        "  </link>",
        '  <joint name="j" type="revolute">',
        "    <!-- written by diag_dynamics -->",
        '    <dynamics damping="0.5"/>',
        '    <parent link="base"/>',
        '    <child link="arm"/>',
        '    <limit effort="1" velocity="1"/>',
        "  </joint>",
        "</robot>",
    ]


def test_errors():
    urdf = description(
        "r", link("base"), link("arm", 1.0, inertia=(1, 0, 0, 1, 0, 1)), joint("j", "revolute", "base", "arm")
    )
    with pytest.raises(dd.InputError, match="'k' is not a joint of robot 'r'"):
        urdf_with(urdf, dd.Parameters(joints={"k": dd.JointParameters(damping=1.0)}))
    with pytest.raises(dd.UrdfError, match="not well-formed"):
        urdf_with("<robot", dd.Parameters())
