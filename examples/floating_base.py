# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot whose base moves freely: positions with a quaternion, the base's share of the energy."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("go2", floating_base=True)
dyn = dd.DiagonalDynamics(model)
print("positions:", ", ".join(model.coordinate_names[:8]), "…")

q = model.neutral
v = np.zeros(model.nv)
v[0], v[5] = 0.5, 0.2  # forward, and turning left, in the base's own axes
moved = model.integrate(q, v)  # a second later
print("base after a second:", np.round(moved[:7], 3))
print("back again:", np.round(model.difference(q, moved)[:6], 3))
s = dyn.evaluate(q, v)
print(f"K = {s.kinetic_energy:.3f} J, of which the base's total rates have {s.base_energy:.3f} J")
