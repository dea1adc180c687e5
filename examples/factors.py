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
residuals = {
    "M − m mᵀ": M - f.m @ f.m.T,
    "M − unit D unitᵀ": M - f.unit @ np.diag(f.D) @ f.unit.T,
    "ℓ m − 1": f.l @ f.m - np.eye(model.nv),
    "ν − mᵀq̇": s.nu - f.m.T @ qd,
    "ν̇ + C + ε_g − ε": s.nu_dot + s.coriolis + s.gravity - s.epsilon,
}
print("; ".join(f"|{name}| {np.abs(residual).max():.1e}" for name, residual in residuals.items()))
