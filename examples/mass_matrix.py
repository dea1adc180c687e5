# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mass matrix, Coriolis and gravity efforts of an arm, and the accelerations that efforts give it."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)
q, qd = model.random(1), np.full(model.nv, 0.3)

M, c, g = dyn.mass_matrix(q), dyn.coriolis_torque(q, qd), dyn.gravity_torque(q)
tau = np.zeros(model.nv)
qdd = dyn.forward_dynamics(q, qd, tau)
print(f"{model.name}: {model.nv} degrees of freedom, {model.total_mass:.1f} kg")
print("diagonal of M [kg m², kg]:", np.round(np.diag(M), 3))
print("gravity efforts [N m, N]: ", np.round(g, 2))
print("M q̈ + c + g − τ:          ", np.abs(M @ qdd + c + g - tau).max())
