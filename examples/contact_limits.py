# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Predicted contact of a two-link arm: the worked example of docs/contact-limits.md."""

import math

import diag_dynamics as dd

POINT_MASS = """<inertial><origin xyz='1 0 0'/><mass value='{}'/>
<inertia ixx='0' ixy='0' ixz='0' iyy='0' iyz='0' izz='0'/></inertial>"""
JOINT = """<joint name='{}' type='continuous'><parent link='{}'/><child link='{}'/>
<origin xyz='{} 0 0'/><axis xyz='0 0 1'/></joint>"""

ARM = f"""<robot name='two_link'>
<link name='base'/><link name='upper_arm'>{POINT_MASS.format(4)}</link><link name='forearm'>{POINT_MASS.format(2)}</link>
{JOINT.format("shoulder", "base", "upper_arm", 0)}{JOINT.format("elbow", "upper_arm", "forearm", 1)}
</robot>"""

LIMITS = dd.ContactLimits(
    {"example": {"mass": 3.0, "stiffness": 20_000.0, "force": 150.0}}
)  # of an invented body region

model = dd.load_urdf(ARM, gravity=(0, 0, 0))
dyn = dd.DiagonalDynamics(model)
tip = dd.ContactPoints(model, [("tip", "forearm", (1, 0, 0))], LIMITS)
q = (0.0, math.pi / 2)  # shoulder along x, elbow at a right angle: the tip is at (1, 1)
texts = []
for axis, qd in (("y", (0.5, -0.5)), ("x", (0.0, -0.5))):
    c = dyn.contact_limits(q, qd, tip)
    mass, force, allowed, margin = c.reflected_mass[0], c.force[0], c.allowed_speed[0], c.margin[0]
    speeds = f"allowed {allowed:.3f} m/s, margin {margin:.3f} m/s"
    texts.append(f"along {axis}: reflected mass {mass:.1f} kg, force {force:.1f} N, {speeds}")
print("; ".join(texts))
