# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The factors of the mass matrix: M = m mᵀ, its inverse ℓᵀℓ, and the diagonal form of the equations of motion."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("ur5")
dyn = dd.DiagonalDynamics(model)
q, qd, tau = model.random(2), np.ones(model.nv), np.arange(model.nv, dtype=float)

f, M = dyn.factors(q), dyn.mass_matrix(q)
s = dyn.evaluate(q, qd, tau)
print("|M − m mᵀ|           ", np.abs(M - f.m @ f.m.T).max())
print("|M − unit D unitᵀ|   ", np.abs(M - f.unit @ np.diag(f.D) @ f.unit.T).max())
print("|ℓ m − 1|            ", np.abs(f.l @ f.m - np.eye(model.nv)).max())
print("|ν − mᵀq̇|            ", np.abs(s.nu - f.m.T @ qd).max())
print("|ν̇ + C + ε_g − ε|    ", np.abs(s.nu_dot + s.coriolis + s.gravity - s.epsilon).max())
