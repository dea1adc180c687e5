# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinetic energy of a moving arm, by joint and by link."""

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)
# By name, in any order; whatever a driver calls its joints.
q = dict.fromkeys(model.dof_names, 0.1) | {"panda_joint4": -1.5}
qd = dict.fromkeys(model.dof_names, 0.0) | {"panda_joint1": 1.0, "panda_joint2": -0.5}

s = dyn.evaluate(q, qd)
joint, link = s.energy_share.argmax(), s.link_energy.argmax()
print(
    f"K = {s.kinetic_energy:.3f} J, most of it in {model.dof_names[joint]} "
    f"({s.energy_share[joint]:.3f} J) and in {model.link_names[link]} ({s.link_energy[link]:.3f} J)"
)
