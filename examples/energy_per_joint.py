# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinetic energy of a moving arm, split by total joint rate and by link."""

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)
# By name, in any order; whatever a driver calls its joints.
q = dict.fromkeys(model.dof_names, 0.1) | {"panda_joint4": -1.5}
qd = dict.fromkeys(model.dof_names, 0.0) | {"panda_joint1": 1.0, "panda_joint2": -0.5}

s = dyn.evaluate(q, qd)
print(
    f"K = {s.kinetic_energy:.4f} J; |νᵀC| = {abs(s.nu @ s.coriolis):.1e}: the Coriolis term does no work"
)
for name, share in zip(model.dof_names, s.energy_share, strict=True):
    print(f"  {name:22}{share:8.4f} J  {100 * share / s.kinetic_energy:5.1f} %")
heaviest = max(zip(s.link_energy, model.link_names, strict=True))
print(f"most of it moves with the link {heaviest[1]}: {heaviest[0]:.4f} J")
