# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The mass that a push meets at the hand, in each direction."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)
q = dict(zip(model.dof_names, [0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8, 0.02], strict=True))
x, y, z = (dyn.reflected_mass(q, "panda_hand", axis, frame="world") for axis in np.eye(3))
print(f"a push along x meets {x:.2f} kg, y {y:.2f} kg, z {z:.2f} kg of {model.total_mass:.1f} kg")
