# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A gripper whose fingers mimic each other: one degree of freedom, exactly coupled; or two that are independent."""

import diag_dynamics as dd

for mimic in ("embed", "free", "lock"):
    model = dd.load_robot("panda", mimic=mimic)
    dyn = dd.DiagonalDynamics(model)
    M = dyn.mass_matrix(model.neutral)
    print(
        f"mimic='{mimic}': {model.nv} dof, the fingers move {M[-1, -1]:.3f} kg; coupled: {dict(model.mimics)}"
    )
