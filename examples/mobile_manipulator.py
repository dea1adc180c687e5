# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""An arm on a base that drives: three joints below the root of its URDF, and what moves with the base."""

import sys
from pathlib import Path

from lxml import etree

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

BASE = """<base>
  <link name="odom"/><link name="base_x"/><link name="base_y"/>
  <joint name="base_x_joint" type="prismatic"><parent link="odom"/><child link="base_x"/>
    <axis xyz="1 0 0"/><limit lower="-0.8" upper="0.8" velocity="1" effort="500"/></joint>
  <joint name="base_y_joint" type="prismatic"><parent link="base_x"/><child link="base_y"/>
    <axis xyz="0 1 0"/><limit lower="-0.8" upper="0.8" velocity="1" effort="500"/></joint>
  <joint name="base_yaw_joint" type="revolute"><parent link="base_y"/><child link="base_footprint"/>
    <axis xyz="0 0 1"/><limit lower="-1.5" upper="1.5" velocity="1" effort="500"/></joint>
</base>"""

robot = etree.parse(str(find_urdf("tiago_no_hand"))).getroot()
robot.set("name", "tiago_that_drives")
for joint in robot.iter("joint"):
    if joint.get("name", "").startswith(("wheel", "caster")):
        joint.set("type", "fixed")
for inertial in robot.xpath("link[starts-with(@name, 'base_antenna')]/inertial"):
    inertial.getparent().remove(inertial)  # no rigid body has such an inertia
robot.extend(etree.fromstring(BASE))
urdf = etree.tostring(robot, encoding="unicode")

dyn = dd.DiagonalDynamics(dd.load_urdf(urdf, massless="lock"))
q = dict.fromkeys(dyn.model.dof_names, 0.0)
s = dyn.evaluate(q, q | {"base_x_joint": 0.5, "arm_1_joint": 0.5})
print(f"K = {s.kinetic_energy:.2f} J, of which the base has {s.energy_share[:3].sum():.2f} J")

if len(sys.argv) > 1:
    Path(sys.argv[1]).write_text(urdf, encoding="utf-8")
