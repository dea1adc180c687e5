# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot whose base moves freely: positions with a quaternion, the base's share of the energy."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("go2", floating_base=True)
dyn = dd.DiagonalDynamics(model)
q = model.neutral
v = np.zeros(model.nv)
v[0], v[5] = 0.5, 0.2  # forward, and turning left, in the base's own axes
moved = model.integrate(q, v)  # a second later
np.testing.assert_allclose(model.difference(q, moved), v, atol=1e-12)
s = dyn.evaluate(q, v)
print(
    f"base after 1 s {moved[:7].round(3)}; K = {s.kinetic_energy:.3f} J, {s.base_energy:.3f} J in it"
)
