# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A payload in the hand: what it adds to the efforts that hold the arm, and how it is told to a running model."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("panda")
loaded = model.with_payload("panda_hand", mass=2.0, com=(0.0, 0.0, 0.1))
q = dict(zip(model.dof_names, [0.0, 0.6, 0.0, -1.5, 0.0, 2.0, 0.8, 0.02], strict=True))

without, with_it = (dd.DiagonalDynamics(one).gravity_torque(q) for one in (model, loaded))
print(
    f"{model.total_mass:.2f} kg and {loaded.total_mass:.2f} kg; payloads: {list(loaded.payloads)}"
)
print("efforts without [N m, N]:", np.round(without, 2))
print("efforts with    [N m, N]:", np.round(with_it, 2))
