# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a touch of a two-link arm would cost: the worked example of docs/contact-limits.md, which can be followed by hand."""

import math

import diag_dynamics as dd
from diag_dynamics.collision.predicted_contact import reduced_mass, simplified_mass

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
)  # numbers of nobody's body

model = dd.load_urdf(ARM, gravity=(0, 0, 0))
dyn = dd.DiagonalDynamics(model)
tip = dd.ContactPoints(model, [("tip", "forearm", (1, 0, 0))], LIMITS)
half = simplified_mass(model.total_mass)
impedance = math.sqrt(reduced_mass(half, 3.0) * 20e3)  # force by speed, from ½F²/k = ½μv²
q = (0.0, math.pi / 2)  # shoulder along x, elbow at a right angle: the tip is at (1, 1)
for name, qd in (("along y", (0.5, -0.5)), ("along x", (0.0, -0.5))):
    c = dyn.contact_limits(q, qd, tip)
    print(f"{name}, direction {c.direction[0].round(6) + 0.0}, at {c.position[0].round(6) + 0.0}")
    print(
        f"  speed {c.speed[0]:.3f} m/s, reflected mass {c.reflected_mass[0]:.3f} kg, simplified {half:.3f} kg"
    )
    print(f"  transferable energy {c.energy[0]:.4f} J of {c.kinetic_energy:.4f} J")
    print(f"  force {c.force[0]:.1f} N, by the simplified mass {impedance * c.speed[0]:.1f} N")
    print(f"  allowed {c.allowed_speed[0]:.3f} m/s, margin {c.margin[0]:.3f} m/s", end="; ")
    print(f"by the simplified mass {150.0 / impedance:.3f} m/s")

after = dyn.impact(q, "forearm", (0.5, -0.5), (0, 1, 0), (1, 0, 0), "world", mass=3.0)
print(
    f"impact: impulse {after.impulse:.3f} N s, the mass then moves with {after.mass_speed:.4f} m/s, lost {after.loss:.3f} J"
)
