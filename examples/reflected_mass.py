# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The mass that a push meets at the hand, in each direction, and what an impact there would cost."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)
q = dict(zip(model.dof_names, [0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8, 0.02], strict=True))
qd = dict.fromkeys(model.dof_names, 0.0) | {"panda_joint1": 1.0}

for axis, direction in {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}.items():
    mass = dyn.reflected_mass(q, "panda_hand", direction, frame="world")
    print(f"a push along {axis} meets {mass:.2f} kg of {model.total_mass:.1f} kg")

v = dyn.link_velocity(q, "panda_hand", qd, frame="world")[:3]
speed = float(np.linalg.norm(v))
mass = dyn.reflected_mass(q, "panda_hand", v, frame="world")
print(
    f"the hand moves at {speed:.2f} m/s with {mass:.2f} kg along its way: {0.5 * mass * speed**2:.3f} J"
)
